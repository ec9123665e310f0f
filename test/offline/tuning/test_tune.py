"""``seal_friction tune``: parameter file, report, JSON, and rejected input."""

import contextlib
import dataclasses
import io
import json
from pathlib import Path

import numpy as np
import pytest
from harness.compensation import compensating
from harness.example_bags import rewrite
from harness.report_page import checked_page

from seal_friction_ros.core.estimation.configuration import Configuration, first_snapshot, snapshot_text
from seal_friction_ros.core.messages.coder import encode, encode_text
from seal_friction_ros.core.messages.layouts import (
    CONFIGURATION_TYPE,
    FORCE_TYPE,
    POSITION_TYPE,
    PRESSURE_TYPE,
    REFERENCE_TYPE,
    VELOCITY_TYPE,
)
from seal_friction_ros.core.messages.records import Force, Position, Pressure, ServoReference, Velocity
from seal_friction_ros.core.servo import position_servo as servo
from seal_friction_ros.core.servo.closed_loop import with_wrong_friction
from seal_friction_ros.core.servo.motions import Sine, Step
from seal_friction_ros.core.tuning import simulated_axis
from seal_friction_ros.core.tuning.settings import TuningSettings
from seal_friction_ros.core.tuning.simulated_axis import force_limit
from seal_friction_ros.files import load_configuration, load_parameter_file
from seal_friction_ros.offline.bags import bag as b
from seal_friction_ros.offline.bags.actuator_bag import open_actuator
from seal_friction_ros.offline.commands.main import main
from seal_friction_ros.offline.reports.formatting import number
from seal_friction_ros.offline.tuning.tune import MADE_BY, read_recording, sensor_noise, tune_simulator

SURE = ['--friction-error', '0', '--delay-error', '0']  # one case: a search of seconds
QUICK = ['--amplitude', '5e-4', '--frequency', '10', '--hold-time', '0.1', *SURE]
COMMON_KEYS = {'tracking_rms_without', 'tracking_rms_with', 'dwell_without', 'dwell_with', 'robustness'}
TRUE_SCALE, TRUE_MASS, OFFSET = 0.8, 5.0, 3.0  # [-], [kg], [N]
LEAVE_OUT = {
    'reference': 'ServoReference',
    'force': 'ForceSum',
    'pressure': 'CylinderPressure',
}


def write_axis(path: Path, wave=None, seconds=2.0, leave_out='', configuration: Configuration | None = None, sign=1.0):
    """Bag of a simulated axis without feed-forward, with less friction than its model, and with noisy sensors."""
    wave = wave or Sine()
    known = configuration or compensating()
    seals = with_wrong_friction(known.parameters(), TRUE_SCALE - 1.0).estimator.seals
    plant = servo.ServoParameters(seals=seals, control_period=1e-3)
    state = servo.init(plant)
    out = servo.outputs(plant, state.plant)
    noise = np.random.default_rng(3).normal(size=(round(seconds * 1e3), 4)) * [2e3, 1.0, 2e-4, 1e-6]
    with b.BagWriter(path) as writer:
        text = snapshot_text(first_snapshot(known))
        writer.write(b.CONFIGURATION_TOPIC, CONFIGURATION_TYPE, 0, encode_text(text))
        for i, (p, f, v, x) in enumerate(noise.tolist()):
            stamp, reference = i * 1_000_000, wave.at(i * 1e-3)
            pressure = Pressure(stamp, out.pressure_a + p, out.pressure_b + p)
            force = Force(stamp, sign * (out.force_sum + f + OFFSET))
            velocity = Velocity(stamp, out.velocity + v, b'rod')
            data = {
                'pressure': (b.PRESSURE_TOPIC, PRESSURE_TYPE, encode(pressure)),
                'force': (b.FORCE_TOPIC, FORCE_TYPE, encode(force)),
                'reference': (
                    b.REFERENCE_TOPIC, REFERENCE_TYPE, encode(ServoReference(stamp, *reference))
                ),
                'position': (
                    b.POSITION_TOPIC, POSITION_TYPE, encode(Position(stamp, out.position + x))
                ),
                'velocity': (b.VELOCITY_TOPIC, VELOCITY_TYPE, encode(velocity)),
            }  # fmt: skip
            for name, (topic, type_name, message) in data.items():
                if name != leave_out:
                    writer.write(topic, type_name, stamp, message)
            state, out = servo.step(plant, state, reference)
    return path


def with_constant_friction(friction: float) -> Configuration:
    """One seal with ``friction`` [N]."""
    known = compensating()
    names = ('name', 'source', 'uncertainty', 'identified_pressure', 'stiction')
    seal = {name: known.seal_documents[0][name] for name in names}
    law = {'coulomb_friction_at_any_pressure': friction}
    seal |= {'name': 'ram', 'coulomb_law': 'constant_coulomb', 'constant_coulomb': law}
    selection = dataclasses.replace(known.selection, seals=('ram',), seal_chambers=('a',))
    return dataclasses.replace(known, selection=selection, seal_documents=(seal,))


@pytest.fixture(scope='module')
def axis(tmp_path_factory) -> Path:
    return write_axis(tmp_path_factory.mktemp('bags') / 'axis')


@pytest.fixture(scope='module')
def simulated(tmp_path_factory) -> Path:
    """Files of two runs on the simulated servo, and the JSON output of the second.

    The search stops early to save time; ``test_simulated_axis.py`` searches to the end.
    """
    folder = tmp_path_factory.mktemp('simulated')
    for run, options in (('one', []), ('two', ['--json'])):
        (folder / run).mkdir()
        with contextlib.redirect_stdout(io.StringIO()) as output, pytest.MonkeyPatch.context() as patch:
            patch.setattr(simulated_axis, 'MOST_CANDIDATES', 20)
            assert main(['tune', '--out', str(folder / run / 'feedforward.yaml'), *QUICK, *options]) == 0
    (folder / 'numbers.json').write_text(output.getvalue())
    return folder


def numbers_of(arguments: list[str], capsys) -> dict:
    capsys.readouterr()
    assert main([*arguments, '--json']) == 0
    return json.loads(capsys.readouterr().out)


def files_below(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob('*') if path.is_file()}


# -- the simulated servo ----------------------------------------------------------------------------------------------


def test_two_runs_write_the_same_bytes(simulated: Path):
    one, two = (files_below(simulated / run) for run in ('one', 'two'))
    assert {'feedforward.yaml', 'feedforward.html', 'feedforward_figures/tracking.png'} <= set(one)
    page, again = one.pop('feedforward.html'), two.pop('feedforward.html')
    assert page.replace(b'/one/', b'/two/') == again.replace(b' --json', b'')  # the page names the command
    assert one == two


def test_file_is_a_parameter_file_of_the_node(simulated: Path):
    path = simulated / 'one' / 'feedforward.yaml'
    selection, settings, feedforward, _ = load_parameter_file(path)
    known = compensating()
    assert load_configuration(selection, settings).selection == known.selection
    assert settings == known.settings
    assert feedforward != known.feedforward
    numbers = json.loads((simulated / 'numbers.json').read_text())
    assert numbers['largest_force'] < feedforward.force_limit == force_limit(numbers['largest_friction'])
    text = path.read_text()
    assert text.startswith(MADE_BY)
    assert 'sine of 0.5 mm at 10 Hz' in text
    assert 'placeholder on chamber a' in text
    assert 'Warning: the seals are the placeholder' in ' '.join(text.replace('#', ' ').split())
    assert all(len(line) <= 120 for line in text.splitlines())


def test_report_stands_alone_and_shows_every_case(simulated: Path):
    page = checked_page(simulated / 'one' / 'feedforward.html')
    numbers = json.loads((simulated / 'numbers.json').read_text())
    assert page.figures == ['tracking', 'force', 'move', 'robustness']
    assert 'http' not in page.prose
    (case,) = numbers['robustness']
    without, shown = page.table('friction model')
    assert shown['tracking RMS [µm]'] == number(1e6 * case['tracking_rms'], 1)
    assert without['dwell [ms]'] == number(1e3 * numbers['dwell_without'])
    assert shown['reversals at rest'] == page.tiles['reversals at rest, all cases'] == '0'
    now = {row['parameter']: row['now'] for row in page.table('parameter')}
    assert float(now['scale']) == numbers['parameters']['scale']


def test_json_has_every_number_without_and_with_feedforward(simulated: Path):
    numbers = json.loads((simulated / 'numbers.json').read_text())
    assert set(numbers) >= COMMON_KEYS
    assert numbers['dwell_without'] == pytest.approx(0.05)  # the rod does not even move
    assert numbers['tracking_rms_with'] < 0.4 * numbers['tracking_rms_without']
    assert numbers['dwell_with'] < 0.2 * numbers['dwell_without']
    (case,) = numbers['robustness']
    assert set(case) >= {'friction_error', 'delay_error', 'tracking_rms', 'dwell', 'limit_cycle_reversals'}
    assert case['tracking_rms'] == numbers['tracking_rms_with']
    written = dataclasses.asdict(load_parameter_file(simulated / 'two' / 'feedforward.yaml')[2])
    assert numbers['parameters'] == written


MAP = {
    'speeds': [1e-3, 1e-2, 1e-1], 'pressures': [0.0, 7e6], 'frictions': [9.0, 7.0, 8.0, 32.0, 28.0, 30.0],
    'reference_speed': 0.02,
}  # fmt: skip
BY_VELOCITY = {
    'velocity terms': {'velocity_terms': {'viscous_friction': 150.0, 'stribeck_friction': 4.0, 'asymmetry': 0.1}},
    'friction map': {'coulomb_law': 'friction_map', 'friction_map': MAP},
}


@pytest.mark.parametrize('law', ['velocity terms', pytest.param('friction map', marks=pytest.mark.long)])
def test_friction_over_velocity_can_be_tuned(law, monkeypatch):
    monkeypatch.setattr(simulated_axis, 'MOST_CANDIDATES', 14)  # the grid, to save time
    known = compensating()
    changed = {**known.seal_documents[0], **BY_VELOCITY[law]}
    if law == 'friction map':
        del changed['normal_force'], changed['friction_coefficient']
    configuration = dataclasses.replace(known, seal_documents=(changed, known.seal_documents[1]))
    assert configuration.parameters().estimator.seals[0].seal.depends_on_velocity
    settings = TuningSettings(amplitude=5e-4, frequency=10.0, hold_time=0.1, friction_error=0.0, delay_error=0.0)
    tuning = tune_simulator(settings, configuration)
    assert tuning.found.better_in_every_case
    assert tuning.found.nominal.tracking_rms < 0.5 * tuning.found.without.tracking_rms
    assert tuning.found.nominal.dwell < 0.5 * tuning.found.without.dwell
    assert json.dumps(tuning.numbers, allow_nan=False)


def test_noise_is_seeded():
    one, same, other = (sensor_noise(TuningSettings(seed=seed)) for seed in (1, 1, 2))
    np.testing.assert_array_equal(one, same)
    assert not (one == other).any()
    np.testing.assert_allclose(one.std(axis=0), [2e3, 2e3, 1.0, 2e-4], rtol=0.05)


# -- a recorded axis --------------------------------------------------------------------------------------------------


def test_scale_mass_and_offset_are_identified_from_a_bag(axis: Path, tmp_path: Path, capsys):
    numbers = numbers_of(['tune', '--bag', str(axis), '--out', str(tmp_path / 'f.yaml')], capsys)
    assert numbers['friction_over_model'] == pytest.approx(TRUE_SCALE, abs=0.01)
    assert numbers['mass'] == pytest.approx(TRUE_MASS, rel=0.1)
    assert numbers['force_offset'] == pytest.approx(OFFSET, abs=0.5)
    assert numbers['residual_with']['sliding'] < 0.15 * numbers['residual_without']['sliding']
    assert load_parameter_file(tmp_path / 'f.yaml')[2].scale == pytest.approx(TRUE_SCALE, abs=0.01)


def test_parameters_that_a_bag_does_not_identify_are_named(axis: Path, tmp_path: Path, capsys):
    numbers = numbers_of(['tune', '--bag', str(axis), '--out', str(tmp_path / 'f.yaml')], capsys)
    assert set(numbers) >= COMMON_KEYS
    assert numbers['tracking_rms_with'] is numbers['dwell_with'] is None
    assert not numbers['told_by_bag']['lead_time']
    assert numbers['parameters']['lead_time'] == compensating().feedforward.lead_time
    assert numbers['recorded_tracking_rms'] > 1e-4
    assert len(numbers['robustness']) == 9
    assert 'lead_time' in (tmp_path / 'f.yaml').read_text().split('ros__parameters')[0]


def test_given_mass_and_delay_are_used(axis: Path, tmp_path: Path, capsys):
    arguments = ['tune', '--bag', str(axis), '--out', str(tmp_path / 'f.yaml'), '--mass', '5', '--whole-delay', '0.004']
    numbers = numbers_of(arguments, capsys)
    assert (numbers['mass'], numbers['mass_is_fitted']) == (5.0, False)
    assert numbers['parameters']['lead_time'] == 0.004


def test_recording_has_the_inputs_of_the_pipeline(axis: Path):
    recording, track, configuration = read_recording(open_actuator(axis))
    assert len(recording.stamps) == len(track.position) == 2000
    assert recording.reference_velocity[50] == Sine().at(0.05).velocity
    assert np.isfinite(recording.force_sum).all()
    assert configuration == compensating()


def test_a_velocity_that_no_rod_has_is_no_sample_of_the_recording(axis: Path, tmp_path: Path):
    times = [one.log_time for one in b.read_messages(axis) if one.type_name == VELOCITY_TYPE]

    def at_half(_: int, one: b.BagMessage) -> b.BagMessage:
        is_chosen = one.type_name == VELOCITY_TYPE and one.log_time == times[1000]
        return one._replace(data=encode(Velocity(1000 * 1_000_000, 99.0, b'rod'))) if is_chosen else one

    recording, _, _ = read_recording(open_actuator(rewrite(axis, tmp_path / 'bag', at_half)))
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(recording.velocity)), [1000])


@pytest.mark.long
@pytest.mark.renders
def test_own_file_is_replaced_and_two_runs_write_the_same_bytes(axis: Path, tmp_path: Path):
    arguments = ['tune', '--bag', str(axis), '--out', str(tmp_path / 'f.yaml')]
    assert main(arguments) == 0
    before = files_below(tmp_path)
    (tmp_path / 'f.yaml').write_text(f'{MADE_BY}\nold')
    assert main(arguments) == 0
    assert files_below(tmp_path) == before


def test_name_of_a_bag_cannot_break_the_file(tmp_path: Path):
    bag = write_axis(tmp_path / 'bag\nforce_limit: 9e9 <b>')
    assert main(['tune', '--bag', str(bag), '--out', str(tmp_path / 'f.yaml')]) == 0
    assert load_parameter_file(tmp_path / 'f.yaml')[2].force_limit < 100.0
    page = checked_page(tmp_path / 'f.html')
    assert page.texts['h1'] == ['Feed-forward for bag bag force_limit: 9e9 <b>']
    found = page.tiles['friction of the axis over that of the model'].split()[0]
    assert float(found) == pytest.approx(TRUE_SCALE, abs=0.01)
    assert len(page.table('friction model')) == 10
    assert page.figures == ['match', 'law', 'robustness', 'recorded']


def test_force_limit_follows_the_friction_of_the_axis_and_the_summary_says_so(tmp_path: Path, capsys):
    configuration = with_constant_friction(275.0 / TRUE_SCALE)
    bag = write_axis(tmp_path / 'bag', Sine(amplitude=0.005, frequency=2.0), 3.0, configuration=configuration)
    assert main(['tune', '--bag', str(bag), '--out', str(tmp_path / 'f.yaml')]) == 0
    said = capsys.readouterr().out
    limit = load_parameter_file(tmp_path / 'f.yaml')[2].force_limit
    assert limit == pytest.approx(1.5 * 275.0, rel=0.1)
    assert f'force_limit: {limit:g} N (was 150 N): 1.5 times the largest friction found' in said
    assert 'placeholder' not in said
    assert f'force_limit: {limit:.1f}' in (tmp_path / 'f.yaml').read_text()


def test_friction_against_the_motion_is_a_failed_check(tmp_path: Path, capsys):
    bag = write_axis(tmp_path / 'bag', sign=-1.0)
    assert main(['tune', '--bag', str(bag), '--out', str(tmp_path / 'f.yaml')]) == 1
    assert 'NOT better than none' in capsys.readouterr().out


# -- rejected input ----------------------------------------------------------------------------------------------------


def rejected(arguments: list[str], folder: Path, capsys) -> str:
    """Error message of one line; no file in ``folder`` changed."""
    before = files_below(folder)
    capsys.readouterr()
    assert main(arguments) == 2
    text = capsys.readouterr().err
    assert text.count('\n') == 1
    assert files_below(folder) == before
    return text


@pytest.mark.parametrize('missing', LEAVE_OUT)
def test_bag_without_an_input_is_rejected_with_the_input_to_record(missing: str, tmp_path: Path, capsys):
    bag = write_axis(tmp_path / 'bag', seconds=0.05, leave_out=missing)
    text = rejected(['tune', '--bag', str(bag), '--out', str(tmp_path / 'f.yaml')], tmp_path, capsys)
    assert LEAVE_OUT[missing] in text
    assert 'record' in text


@pytest.mark.parametrize(
    ('wave', 'seconds', 'text'),
    [
        (Step(size=0.001), 0.5, 'reverses 0 times'),
        (Sine(amplitude=1e-5), 1.0, 'slides in'),
    ],
)
def test_bag_that_shows_no_friction_is_rejected_with_the_motion_to_record(wave, seconds, text, tmp_path: Path, capsys):
    bag = write_axis(tmp_path / 'bag', wave, seconds)
    assert text in rejected(['tune', '--bag', str(bag), '--out', str(tmp_path / 'f.yaml')], tmp_path, capsys)


@pytest.mark.parametrize(
    ('arguments', 'text'),
    [
        (['--amplitude', '5'], 'amplitude'),
        (['--amplitude', 'nan'], 'amplitude'),
        (['--amplitude', '0.02'], 'more than'),
        (['--mass', '5'], '--mass is only for a --bag'),
        (['--namespace', 'left'], '--namespace is only for a --bag'),
        (['--params', 'absent.yaml'], 'absent.yaml'),
    ],
)
def test_invalid_option_is_rejected(arguments: list[str], text: str, tmp_path: Path, capsys):
    assert text in rejected(['tune', '--out', str(tmp_path / 'f.yaml'), *arguments], tmp_path, capsys)


def test_option_of_the_simulator_is_rejected_with_a_bag(axis: Path, tmp_path: Path, capsys):
    arguments = ['tune', '--bag', str(axis), '--out', str(tmp_path / 'f.yaml'), '--frequency', '5']
    assert '--frequency is not for a --bag' in rejected(arguments, tmp_path, capsys)


@pytest.mark.parametrize('kind', ['html', 'folder', 'other file', 'other page', 'below a file'])
def test_target_that_must_not_be_written_is_rejected_before_the_work(kind: str, tmp_path: Path, capsys):
    out = tmp_path / ('f.html' if kind == 'html' else 'f.yaml')
    if kind == 'folder':
        out.mkdir()
    elif kind == 'other file':
        out.write_text('friction_estimator: {ros__parameters: {stick_velocity: 0.002}}\n')
    elif kind == 'other page':
        out.with_suffix('.html').write_text('my notes')
    elif kind == 'below a file':
        out.write_text('')
        out = out / 'g.yaml'
    assert str(out.with_suffix('')) in rejected(['tune', '--out', str(out)], tmp_path, capsys)
