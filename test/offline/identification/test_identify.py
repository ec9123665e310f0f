"""Identification from real measurements, against what is known of them; and garbage, which never becomes a file."""

import csv
import io
import json
import shutil
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

import numpy as np
import pytest
from paths import ROOT

from seal_friction_ros.core.estimation.configuration import SealSelection
from seal_friction_ros.core.estimation.estimator import EstimatorParameters, EstimatorSettings, init, step
from seal_friction_ros.core.estimation.records import Force, Pressure, RodSample, Status
from seal_friction_ros.core.foundation.units import LBF, PSI
from seal_friction_ros.core.friction.actuator import MountedSeal, actuator_friction
from seal_friction_ros.core.friction.seal_file import parse_seal
from seal_friction_ros.core.friction.states import FrictionState
from seal_friction_ros.files import config_path, load_configuration, read_yaml
from seal_friction_ros.offline.bags.import_log import Samples, read_rig, read_samples, write_samples
from seal_friction_ros.offline.bags.import_thesis import import_thesis
from seal_friction_ros.offline.commands.main import main

DATA = ROOT.parent / 'shared' / 'data'
THESIS = ROOT / 'data' / 'thesis' / 'friction_tests.csv'
BARS = (1, 3, 5, 7)
DELFT = {'O-ring257': [4.7, 5.8, 7.1, 7.9], 'X-ring257': [4.6, 6.5, 8.6, 15.5]}
"""[N] half-range friction at 1, 3, 5, 7 bar; README of the data"""
FRICTION_ID, OTHER = 'FrictionIDMovesWithBiasCurr.exp', '2022.01.28T16.46.31_new.exp'
KEYS = ('law', 'parameters', 'standard_errors', 'pressure_Pa', 'measured_N', 'fitted_N', 'cross_validation_error',
        'warnings')  # fmt: skip


def data(name: str) -> Path:
    path = DATA / name
    if not path.exists():
        pytest.skip(f'{name} of the shared data is not there')
    return path


def delft(ring: str) -> list[str]:
    return [str(data(f'delft/{ring}_{bar}bar.csv')) for bar in BARS]


class Run:
    """One run of the command, its figures and its seal file."""

    def __init__(self, folder: Path, *arguments: str, name: str = 'seal') -> None:
        self.out = folder / f'{name}.yaml'
        figures, errors = io.StringIO(), io.StringIO()
        with redirect_stdout(figures), redirect_stderr(errors):
            self.code = main(['identify', *arguments, '--out', str(self.out), '--json'])
        self.errors = errors.getvalue()
        self.figures = json.loads(figures.getvalue()) if self.code == 0 else {}

    @property
    def document(self):
        return read_yaml(self.out)

    def ladder(self, law: str):
        return next(rung for rung in self.figures['ladder'] if rung['law'] == law)

    def has_warning(self, *words: str) -> bool:
        return any(all(word in warning for word in words) for warning in self.figures['warnings'])


THESIS_RIG = ('--seal', 'ms28775_114', '--seal-chambers', 'a,b')


# --- thesis ---


@pytest.fixture(scope='module', params=['physics_based', 'pressure_power_law'])
def thesis(request, tmp_path_factory):
    return Run(tmp_path_factory.mktemp('thesis'), str(THESIS), *THESIS_RIG, '--law', request.param)


def test_thesis_mean_friction_per_pressure_is_that_of_the_tables(thesis):
    expected = [2.50, 5.25, 6.42, 7.67, 8.42, 9.50, 10.17, 10.92, 11.67, 12.58, 13.33]  # [lbf]
    assert thesis.figures['pressure_Pa'] == pytest.approx([100.0 * i * PSI for i in range(11)], rel=1e-5)
    assert np.array(thesis.figures['measured_N']) / LBF == pytest.approx(expected, abs=0.006)


def test_thesis_a_left_out_test_is_predicted_better_than_by_the_mean_of_the_other_two(thesis):
    assert thesis.figures['left_out_by'] == 'test'
    assert thesis.figures['cross_validation_mean_deviation_N'] <= thesis.figures['plain_mean_deviation_N']
    assert thesis.figures['plain_mean_deviation_N'] == pytest.approx(3.295, abs=0.001)


def test_thesis_the_band_covers_90_to_99_percent_of_left_out_readings(thesis):
    assert 0.90 <= thesis.figures['band_coverage'] <= 0.99


def test_thesis_fit_is_within_four_percent_of_every_mean(thesis):
    shares = np.array(thesis.figures['fitted_N']) / np.array(thesis.figures['measured_N'])
    assert np.abs(shares - 1.0).max() <= 0.041


def test_thesis_stiction_is_half_a_pound_for_each_seal(thesis):
    assert thesis.figures['stiction']['law'] == 'constant'
    assert thesis.document['stiction'] / LBF == pytest.approx(1.11 / 2.0, abs=0.02)


def test_thesis_constant_friction_is_beaten_and_the_repeatability_is_the_floor(thesis):
    assert thesis.ladder('constant_coulomb')['is_beaten']
    assert thesis.figures['recommended_law'] == 'pressure_power_law'
    assert not thesis.ladder('physics_based')['is_beaten']
    assert thesis.figures['repeatability'] == pytest.approx(0.085, abs=0.005)
    assert thesis.ladder('physics_based')['error'] < thesis.figures['repeatability']


def test_thesis_physics_based_law_is_that_of_the_shipped_seal(tmp_path):
    run = Run(tmp_path, str(THESIS), *THESIS_RIG, '--law', 'physics_based')
    shipped = read_yaml(config_path('seals', 'ms28775_114'))['friction_coefficient']
    assert run.figures['parameters']['exponent'] == pytest.approx(shipped['exponent'], abs=0.01)
    assert run.figures['parameters']['coefficient'] == pytest.approx(shipped['coefficient'], rel=0.03)
    errors = run.figures['standard_errors']
    assert abs(run.figures['parameters']['exponent'] - shipped['exponent']) < errors['exponent']
    assert run.has_warning('coefficient and exponent trade off')


def test_thesis_as_a_bag_gives_the_same_law_as_the_table(tmp_path):
    import_thesis(tmp_path / 'bag')
    bag = Run(tmp_path, str(tmp_path / 'bag'), *THESIS_RIG, '--law', 'physics_based', name='of_bag')
    table = Run(tmp_path, str(THESIS), *THESIS_RIG, '--law', 'physics_based', name='of_table')
    assert bag.figures['measured_N'] == pytest.approx(
        table.figures['measured_N'], rel=0.06
    )  # three readings: their median there, their mean here
    assert bag.figures['parameters'] == pytest.approx(table.figures['parameters'], rel=0.03)
    assert bag.document['stiction'] == pytest.approx(table.document['stiction'], rel=0.05)


# --- Delft ---


@pytest.mark.parametrize('ring', DELFT)
def test_delft_half_range_friction_is_recovered(ring, tmp_path):
    run = Run(tmp_path, *delft(ring))
    assert run.figures['measured_N'] == pytest.approx(DELFT[ring], abs=0.2)
    assert np.array(run.figures['pressure_Pa']) / 1e5 == pytest.approx(BARS, abs=0.1)


@pytest.mark.parametrize('more', [(), ('--seal', 'delft_o_ring', '--squeeze-force', '--law', 'physics_based')])
def test_delft_o_ring_law_predicts_a_pressure_it_has_not_seen(more, tmp_path):
    run = Run(tmp_path, *delft('O-ring257'), *more)
    assert run.figures['left_out_by'] == 'pressure'
    assert run.figures['worst_left_out_error'] <= 0.12
    assert run.figures['cross_validation_error'] <= 0.05
    constant, law = run.ladder('constant_coulomb'), run.ladder(run.figures['law'])
    assert constant['error'] >= 2.0 * law['error']
    assert constant['rms_N'] >= 2.0 * law['rms_N']
    assert not any(run.figures['is_outlier'])
    assert run.has_warning('collinear', 'speed', 'pressure')


def test_delft_standard_deviation_covers_runs_that_repeat_within_10_to_15_percent(tmp_path):
    run = Run(tmp_path, *delft('O-ring257'))
    shares = np.array(run.figures['std_N']) / np.array(run.figures['fitted_N'])
    assert 0.10 <= shares.min() <= shares.max() <= 0.20
    assert run.has_warning('every pressure was measured in one run', 'drift')
    known = Run(tmp_path, *delft('O-ring257'), '--run-to-run', '0.05', name='known')
    assert known.figures['relative_std'] < run.figures['relative_std']


def test_delft_offsets_of_the_force_sum_are_told(tmp_path):
    run = Run(tmp_path, *delft('O-ring257'))
    assert run.figures['offset_N'] == pytest.approx([-1.2, -1.9, -2.2, -2.0], abs=0.15)  # config/rigs/delft.yaml
    line = run.figures['offset_line']
    assert line['area_error_m2'] * 1e6 == pytest.approx(-1.1, abs=0.4)  # [mm2] of a bore of 519
    assert line['constant_N'] == pytest.approx(-1.35, abs=0.2)


def test_delft_x_ring_at_7_bar_is_an_outlier_with_a_reason_to_look(tmp_path):
    run = Run(tmp_path, *delft('X-ring257'))
    assert run.figures['is_outlier'] == [False, False, False, True]
    assert run.has_warning('outlier', '6.92 bar', 'A reason to look', 'had not settled')
    assert not run.has_warning('one direction only')  # the outlier has both
    assert run.figures['drift'][3] > 0.2  # the reason: it is still rising
    assert max(map(abs, run.figures['drift'][:3])) < 0.1
    assert run.figures['measured_N'][3] > 1.4 * run.figures['fitted_N'][3]
    assert run.document['identified_pressure'][1] < 5.2e5  # nothing is claimed up there


def test_delft_o_ring_and_x_ring_are_not_averaged(tmp_path):
    run = Run(tmp_path, *delft('O-ring257'), *delft('X-ring257'))
    assert run.code == 2
    assert 'the friction has changed: 7.912 N in O-ring257_7bar.csv and 15.63 N in X-ring257_7bar.csv' in run.errors
    assert not run.out.exists()


# --- MBARI ---


@pytest.fixture(scope='module')
def friction_id(tmp_path_factory):
    return Run(tmp_path_factory.mktemp('mbari'), str(data(f'mbari/{FRICTION_ID}')))


@pytest.fixture(scope='module')
def other(tmp_path_factory):
    return Run(tmp_path_factory.mktemp('mbari'), str(data(f'mbari/{OTHER}')))


@pytest.mark.parametrize(('name', 'bar', 'table'), [('friction_id', 150.0, 197.0), ('other', 200.0, 504.0)])
def test_mbari_blocks_are_predicted_from_the_others(name, bar, table, request):
    run = request.getfixturevalue(name)
    assert run.figures['left_out_by'] == 'block'
    assert run.figures['cross_validation_rms_N'] <= bar < table
    assert run.has_warning('velocity and pressure difference are collinear')
    assert 0.90 <= run.figures['band_coverage'] <= 0.99
    with_pressure = run.figures['law'].startswith('pressure')
    assert with_pressure == (name == 'friction_id')  # there it pays out of sample, in the other it does not
    assert run.has_warning('no gain is claimed for pressure') == (not with_pressure)
    pays = [remark for remark in run.figures['remarks'] if remark.startswith('pressure pays')]
    assert bool(pays) == with_pressure


def test_mbari_uses_the_samples_that_the_bars_are_over(friction_id):
    rig = read_rig(config_path('rigs', 'mbari'))
    samples = read_samples(data(f'mbari/{FRICTION_ID}'), rig).samples
    acceleration = np.gradient(samples.velocity, samples.stamp * 1e-9)
    chosen = (np.abs(samples.velocity) > 0.01) & (np.abs(acceleration) < 0.05)  # [m/s], [m/s2]
    assert friction_id.figures['samples_used'] == {FRICTION_ID: int(chosen.sum())}
    assert sum(friction_id.figures['samples_left_out'].values()) == int((~chosen).sum())


def test_mbari_friction_has_changed_between_the_files_and_is_not_averaged(tmp_path, friction_id):
    both = Run(tmp_path, *(str(data(f'mbari/{name}')) for name in (FRICTION_ID, OTHER)))
    (change,) = both.figures['changes']
    assert change['is_change']
    assert change['ratio'] == pytest.approx(0.64, abs=0.05)
    assert both.has_warning('the friction has changed', '-36 %', 'was not averaged in')
    assert both.figures['parameters'] == friction_id.figures['parameters']
    assert [file['name'] for file in both.document['identification']['data']] == [FRICTION_ID]


# --- the file works in the node ---


def estimates_of(run: Run, pressure: float, velocity: float, force: float = 0.0):
    """What the estimator says with the identified seals at one sample."""
    chambers = tuple(run.figures['seal_chambers'])
    selection = SealSelection((str(run.out),) * len(chambers), chambers)
    parameters = load_configuration(selection, EstimatorSettings()).parameters().estimator
    sample = RodSample(10, velocity, Pressure(10, pressure, pressure), Force(10, force))
    return step(parameters, init(parameters), sample)[1]


@pytest.mark.parametrize('law', ['constant_coulomb', 'pressure_power_law', 'physics_based', 'physics_based_asymmetric'])
def test_the_node_says_what_was_fitted(law, tmp_path):
    run = Run(tmp_path, str(THESIS), *THESIS_RIG, '--law', law)
    for pressure, fitted, std in zip(*(run.figures[k] for k in ('pressure_Pa', 'fitted_N', 'std_N')), strict=True):
        estimate = estimates_of(run, pressure, 0.01)
        assert estimate.coulomb_friction == pytest.approx(fitted, rel=1e-5)
        assert estimate.coulomb_friction_std == pytest.approx(std, rel=0.06)
        assert estimate.status == 0
        assert estimate.state == FrictionState.SLIDING
        assert estimate.breakaway_force > estimate.coulomb_friction
    asymmetry = run.figures['parameters'].get('asymmetry', 0.0)
    both = [abs(estimates_of(run, 2e6, side * 0.01).friction_force) for side in (1.0, -1.0)]
    assert both[0] / both[1] == pytest.approx((1.0 + asymmetry) / (1.0 - asymmetry))


def test_viscous_friction_acts_in_the_node_and_is_not_in_the_coulomb_friction(friction_id):
    run = friction_id
    slow, fast = (estimates_of(run, 2e6, velocity) for velocity in (0.1, 0.4))
    assert fast.coulomb_friction == slow.coulomb_friction
    more = 2.0 * run.figures['parameters']['viscous_friction'] * 0.3  # [N] two seals, 0.3 m/s faster
    assert fast.friction_force - slow.friction_force == pytest.approx(more, rel=1e-5)
    assert estimates_of(run, 2e6, -0.4).friction_force == pytest.approx(-fast.friction_force)
    at_rest = estimates_of(run, 2e6, 0.0, force=1e5)
    assert at_rest.friction_force == at_rest.breakaway_force


def test_beyond_the_pressures_that_were_measured_the_node_says_so(tmp_path):
    run = Run(tmp_path, str(THESIS), *THESIS_RIG)
    assert estimates_of(run, 8e6, 0.01).status == Status.OUTSIDE_IDENTIFIED_RANGE


def test_a_bag_of_the_node_identifies_and_its_seal_file_replays(tmp_path):
    run = Run(tmp_path, str(ROOT / 'bags' / 'pull_test'))
    assert run.code == 0, run.errors
    assert run.figures['seal_chambers'] == ['a', 'b']  # from the configuration in the bag, as is the geometry
    assert run.ladder('physics_based')['error'] < 0.1
    assert run.figures['measured_N'] == pytest.approx([x * LBF for x in (2.75, 5.0, 6.0)], rel=1e-5)
    assert run.document['stiction'] > 1.0  # [N] the static readings are above the dynamic ones
    replayed = tmp_path / 'replayed'
    arguments = ['replay', str(ROOT / 'bags' / 'pull_test'), '--seal', str(run.out), '--out', str(replayed)]
    assert main(arguments) == 0
    assert main(['replay', str(replayed), '--verify']) == 0
    again = Run(tmp_path, str(replayed), name='again')
    assert again.figures['parameters'] == run.figures['parameters']


def test_a_log_and_the_bag_imported_from_it_give_the_same_law(tmp_path):
    bags = []
    for bar in BARS:
        log = data(f'delft/O-ring257_{bar}bar.csv')
        bags.append(str(tmp_path / f'O{bar}'))
        assert main(['import', 'log', str(log), '--rig', 'delft', '--out', bags[-1]]) == 0
    of_bags = Run(tmp_path, *bags, name='bags')
    of_logs = Run(tmp_path, *delft('O-ring257'), name='logs')
    assert of_bags.figures['parameters'] == of_logs.figures['parameters']


# --- the file itself ---


def test_json_has_the_promised_keys_and_the_file_says_where_it_is_from(tmp_path):
    run = Run(tmp_path, str(THESIS), *THESIS_RIG)
    assert set(KEYS) <= set(run.figures)
    part = run.document['identification']
    assert {'law', 'parameters', 'standard_errors', 'residual_N', 'data', 'left_out_by', 'warnings'} <= set(part)
    (source,) = part['data']
    assert source['name'] == 'friction_tests.csv'
    assert len(source['sha256']) == 64
    assert run.figures['standard_errors'].keys() == run.figures['parameters'].keys()
    assert np.array(part['measured_N']) - np.array(part['fitted_N']) == pytest.approx(part['residual_N'], abs=1e-4)


def test_the_same_sources_give_the_same_bytes(tmp_path):
    one, two = (Run(tmp_path, str(THESIS), *THESIS_RIG, '--name', 'x', name=n) for n in ('one', 'two'))
    assert one.out.read_bytes() == two.out.read_bytes()
    moved = shutil.copytree(ROOT / 'bags' / 'pull_test', tmp_path / 'elsewhere' / 'pull_test')
    here = Run(tmp_path, str(ROOT / 'bags' / 'pull_test'), '--name', 'x', name='here')
    there = Run(tmp_path, str(moved), '--name', 'x', name='there')
    assert here.out.read_bytes() == there.out.read_bytes()


def test_the_uncertainty_of_the_seals_adds_up_to_that_of_the_rig(tmp_path):
    run = Run(tmp_path, str(THESIS), *THESIS_RIG)
    seal = parse_seal(run.document)
    both = actuator_friction((MountedSeal(seal, 'a'), MountedSeal(seal, 'b')), 2e6, 2e6)
    expected = np.hypot(run.figures['relative_std'] * both.coulomb_friction, run.figures['absolute_std_N'])
    assert both.coulomb_friction_std == pytest.approx(expected, rel=1e-4)


def test_a_law_by_name_is_saved_and_the_recommended_one_still_told(tmp_path):
    run = Run(tmp_path, str(THESIS), '--law', 'constant_coulomb')
    assert (run.figures['law'], run.figures['recommended_law']) == ('constant_coulomb', 'pressure_power_law')
    assert Run(tmp_path, str(THESIS), '--law', 'magic').code == 2


# --- garbage ---


def wave(pressures=(1e5, 3e5, 5e5, 7e5), speed=0.01, friction=lambda p: 4.0 + 6e-6 * p, offset=1.0) -> Samples:
    """A rod that goes to and fro three times at each pressure; a little sensor noise on every signal."""
    rng = np.random.default_rng(7)
    signs = np.tile(np.repeat([1.0, -1.0], 200), 3 * len(pressures))
    pressure = np.repeat(pressures, 1200) + 200.0 * rng.normal(size=len(signs))
    force = offset + signs * friction(pressure) + 0.1 * rng.normal(size=len(signs))
    velocity = speed * signs + 1e-5 * rng.normal(size=len(signs))
    stamp = 1_000_000_000 + 10_000_000 * np.arange(len(signs))
    return Samples(stamp, pressure, np.zeros(len(signs)), force, velocity)


def with_nan(samples: Samples, part: str, first: int, last: int) -> Samples:
    column = getattr(samples, part).copy()
    column[first:last] = np.nan
    return samples._replace(**{part: column})


GOOD = wave()
GARBAGE = {
    'one velocity': (GOOD._replace(velocity=np.full(4800, 0.01)), ['one way only', 'in both directions']),
    'no motion': (GOOD._replace(velocity=np.zeros(4800)), ['does not move', 'drive strokes']),
    'one pressure': (wave((3e5,)), ['one pressure, 3 bar', 'measure at 3 pressures']),
    'two pressures': (wave((3e5, 5e5)), ['2 pressures', 'measure at 3']),
    'two samples': (Samples(*(c[:2] for c in GOOD)), ['2 samples are too few', 'record several strokes']),
    'NaN velocity': (with_nan(GOOD, 'velocity', 900, 1100), ['200 of 4800 samples have no velocity', 'measure again']),
    'NaN force': (with_nan(GOOD, 'force_sum', 900, 1100), ['no force sum', 'from 9 s on']),
    'NaN pressure': (with_nan(GOOD, 'chamber_a', 900, 1100), ['no pressure a']),
    'clipped force': (GOOD._replace(force_sum=np.minimum(GOOD.force_sum, 7.0)), ['clipped', 'larger range']),
    'clipped pressure': (GOOD._replace(chamber_a=np.minimum(GOOD.chamber_a, 4e5)), ['clipped', 'chamber a']),
    'turned force': (GOOD._replace(force_sum=-GOOD.force_sum), ['sign', 'would drive the rod']),
    'turned velocity': (GOOD._replace(velocity=-GOOD.velocity), ['sign', 'would drive the rod']),
    'turned pressure': (GOOD._replace(chamber_a=-GOOD.chamber_a), ['pressure of -7', 'sign and unit']),
    'force x 1000': (GOOD._replace(force_sum=1e3 * GOOD.force_sum), ['wrong unit', 'kN']),
    'force / 1000': (GOOD._replace(force_sum=1e-3 * GOOD.force_sum), ['wrong unit', 'kN']),
    'pressure x 1000': (GOOD._replace(chamber_a=1e3 * GOOD.chamber_a), ['is not between', 'unit']),
    'pressure / 1000': (GOOD._replace(chamber_a=1e-3 * GOOD.chamber_a), ['one pressure', 'in Pa']),
    'velocity x 1000': (GOOD._replace(velocity=1e3 * GOOD.velocity), ['is not below 10 m/s', 'unit']),
    'velocity / 1000': (GOOD._replace(velocity=1e-3 * GOOD.velocity), ['does not move', 'in m/s']),
    'time x 1000': (GOOD._replace(stamp=GOOD.stamp * 1000), ['10 s apart', 'unit']),
    'noise for force': (GOOD._replace(force_sum=np.random.default_rng(1).normal(size=4800)), []),
    'no force': (GOOD._replace(force_sum=np.zeros(4800)), ['friction comes out as 0 N']),
    'always accelerated': (
        GOOD._replace(velocity=0.5 * np.sin(np.arange(4800) / 20.0)),
        ['samples of even sliding'],
    ),
}


def test_the_garbage_is_made_from_good_measurements(tmp_path):
    write_samples(tmp_path / 'bag', GOOD, 'rod')
    run = Run(tmp_path, str(tmp_path / 'bag'))
    assert run.code == 0
    assert run.figures['measured_N'] == pytest.approx([4.6, 5.8, 7.0, 8.2], rel=0.01)
    assert run.figures['offset_N'] == pytest.approx([1.0] * 4, abs=0.05)


@pytest.mark.parametrize('name', GARBAGE)
def test_garbage_gets_one_line_that_says_what_to_do_and_no_file(name, tmp_path):
    samples, words = GARBAGE[name]
    write_samples(tmp_path / 'bag', samples, 'rod')
    before = sorted(tmp_path.rglob('*'))
    report = tmp_path / 'page.html'
    run = Run(tmp_path, str(tmp_path / 'bag'), '--report', str(report))
    assert run.code == 2
    assert run.errors.count('\n') == 1
    assert len(run.errors) < 500
    assert [word for word in words if word not in run.errors] == []
    assert sorted(tmp_path.rglob('*')) == before


def test_a_few_samples_that_are_not_numbers_are_left_out_and_counted(tmp_path):
    write_samples(tmp_path / 'bag', with_nan(GOOD, 'force_sum', 900, 905), 'rod')
    run = Run(tmp_path, str(tmp_path / 'bag'))
    assert run.code == 0
    assert run.figures['samples_left_out']['not finite'] == 5


def test_runs_that_were_repeated_tell_how_far_a_new_one_may_be_off(tmp_path):
    """Two runs at each pressure, one 17 % above the other, which is 11 % as a standard deviation between runs."""
    for name, factor in (('low', 0.9), ('high', 1.2)):
        for bar in (1, 3, 5, 7):
            part = wave((bar * 1e5,), friction=lambda p, k=factor: k * (4.0 + 6e-6 * p))
            write_samples(tmp_path / f'{name}{bar}', part, 'rod')
    bags = sorted(str(path) for path in tmp_path.iterdir())
    run = Run(tmp_path, *bags)
    assert run.code == 2  # a quarter apart: that is no repetition
    assert 'the friction has changed' in run.errors
    for bar in (1, 3, 5, 7):
        shutil.rmtree(tmp_path / f'high{bar}')
        part = wave((bar * 1e5,), friction=lambda p: 1.05 * (4.0 + 6e-6 * p))
        write_samples(tmp_path / f'high{bar}', part, 'rod')
    run = Run(tmp_path, *bags)
    assert run.code == 0, run.errors
    assert not run.has_warning('every pressure was measured in one run')
    between = 0.15 / 1.95 * 2.0**0.5  # standard deviation of 0.9 and 1.05 over their mean
    shares = np.array(run.figures['std_N']) / np.array(run.figures['fitted_N'])
    assert between < shares.min()
    assert shares.max() < 2.0 * between


def test_a_sensor_that_stands_still_while_the_rod_rests_is_not_clipped(tmp_path):
    rest = Samples(*(np.repeat(column[:1], 600) for column in GOOD))
    rest = rest._replace(velocity=np.zeros(600), force_sum=np.full(600, -30.0))
    parts = [np.concatenate(columns) for columns in zip(rest, GOOD, strict=True)]
    stamp = 1_000_000_000 + 10_000_000 * np.arange(5400)
    write_samples(tmp_path / 'bag', Samples(stamp, *parts[1:]), 'rod')
    assert Run(tmp_path, str(tmp_path / 'bag')).code == 0


def rows_of_thesis() -> list[dict[str, str]]:
    with THESIS.open() as file:
        return list(csv.DictReader(file))


@pytest.mark.parametrize(
    ('change', 'words'),
    [
        (lambda r: r | {'friction_lbf': str(1000.0 * float(r['friction_lbf']))}, ['wrong unit']),
        (lambda r: r | {'friction_lbf': str(0.001 * float(r['friction_lbf']))}, ['wrong unit']),
        (lambda r: r | {'pressure_psig': str(1000.0 * float(r['pressure_psig']))}, ['is not between']),
        (lambda r: r | {'pressure_psig': '500'}, ['one pressure']),
        (lambda r: r | {'friction_lbf': '-' + r['friction_lbf']}, ['is negative']),
        (lambda r: r | {'friction_lbf': 'nan'}, ['have no friction']),
        (lambda r: r | {'friction_lbf': ''}, ['row 2', 'not a number']),
        (lambda r: r | {'direction': 'up'}, ['row 2', "'up'"]),
        (lambda r: r | {'friction_lbf': str(min(float(r['friction_lbf']), 9.0))}, ['come to its end']),
        (lambda r: {('friction' if k == 'friction_lbf' else k): v for k, v in r.items()}, ['friction_lbf']),
    ],
)
def test_a_spoiled_table_is_refused(change, words, tmp_path):
    rows = [change(row) for row in rows_of_thesis()]
    table = tmp_path / 'table.csv'
    table.write_text('\n'.join([','.join(rows[0]), *(','.join(row.values()) for row in rows)]) + '\n')
    run = Run(tmp_path, str(table))
    assert run.code == 2
    assert [word for word in words if word not in run.errors] == []
    assert not run.out.exists()


def test_a_table_in_one_direction_is_taken_with_a_warning(tmp_path):
    lines = THESIS.read_text().splitlines()
    table = tmp_path / 'table.csv'
    table.write_text('\n'.join([lines[0], *(line for line in lines if ',extend,' in line)]))
    assert Run(tmp_path, str(table)).has_warning('one direction only')


@pytest.mark.parametrize(
    ('arguments', 'words'),
    [
        ((str(THESIS), str(THESIS)), 'is named twice'),
        ((str(THESIS), str(ROOT / 'bags' / 'pull_test')), 'cannot be fitted together'),
        (('missing.csv',), 'No such file'),
        ((str(ROOT / 'LICENSE'),), 'no log of a known rig'),
        ((str(THESIS), '--seal', 'missing'), 'No such file'),
    ],
)
def test_sources_that_are_none_or_do_not_fit_are_refused(arguments, words, tmp_path):
    run = Run(tmp_path, *arguments)
    assert run.code == 2
    assert words in run.errors


def test_a_fit_that_means_nothing_is_not_saved(tmp_path):
    """Friction that has nothing to do with pressure, speed or direction."""
    rng = np.random.default_rng(2)
    spoiled = [f'{t},{p},{d},{abs(rng.normal()) ** 3 + 0.01}' for t in (1, 2, 3) for p in range(0, 1001, 100)
               for d in ('extend', 'retract')]  # fmt: skip
    table = tmp_path / 'table.csv'
    table.write_text('\n'.join(['test,pressure_psig,direction,friction_lbf', *spoiled]))
    run = Run(tmp_path, str(table))
    assert run.code == 2
    assert 'no law predicts these readings' in run.errors
    assert not run.out.exists()


def test_estimator_needs_no_more_than_the_file(tmp_path):
    run = Run(tmp_path, str(THESIS), *THESIS_RIG)
    seal = parse_seal(run.document)
    assert EstimatorParameters(EstimatorSettings(), (MountedSeal(seal, 'a'),))
