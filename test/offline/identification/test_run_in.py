"""Logs of a seal that runs in: the seal file holds the settled seal, the numbers beside it the readings as measured."""

import re

import numpy as np
import pytest
from harness.identify_run import Run, delft, estimates_of
from harness.two_kinds import BAR, RIG

from seal_friction_ros.files import read_yaml
from seal_friction_ros.offline.commands.main import main

PRESSURES = (1.0, 2.5, 4.0, 6.0)
STEP = 0.01  # [s]


def settled_friction(bar):
    return 3.0 + 1.1 * bar


def logs(folder, course, noise=0.05, pressures=PRESSURES):
    """One log per pressure of a simulated pneumatic rig, ten strokes out and back; own friction, encoder of 10 um.

    ``course`` is the friction over that of the settled seal, by the travel since the seal was mounted [m] and the
    pressure [bar].
    """
    rng = np.random.default_rng(5)
    paths = []
    for bar in pressures:
        sides = [side for _ in range(10) for side in (1.0, -1.0)]
        velocity = np.concatenate([np.r_[np.full(400, 0.01 * side), np.zeros(40)] for side in sides])
        travel = np.cumsum(np.abs(velocity)) * STEP
        force = (
            np.sign(velocity) * settled_friction(bar) * course(travel, bar) - 1.5 + noise * rng.normal(size=len(travel))
        )
        position = np.round((0.1 + np.cumsum(velocity) * STEP) / 1e-5) * 1e-5 + 1e-7 * rng.normal(size=len(travel))
        pressure = bar * (1.0 + 0.003 * rng.normal(size=len(travel)))
        columns = (np.arange(len(travel)) * STEP, 1e3 * position, pressure, 0.0 * pressure, force)
        paths.append(folder / f'run_{bar:g}.csv')
        header = 'time_s,position_mm,pa_bar,pb_bar,force_N'
        np.savetxt(paths[-1], np.column_stack(columns), delimiter=',', header=header, comments='', fmt='%.5f')
    (folder / 'rig.yaml').write_text(RIG)
    return [*map(str, paths), '--rig', str(folder / 'rig.yaml'), '--seal-chambers', 'a']


@pytest.fixture(
    scope='module',
    params=[lambda s, _: 1.0 - 0.2 * np.exp(-s / 0.25), lambda s, _: 1.0 + 0.25 / (1.0 + s / 0.1)],
    ids=['rising', 'falling hyperbola'],
)
def ran_in(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp('run_in')
    return Run(folder, *logs(folder, request.param))


def test_the_seal_file_holds_the_friction_of_the_settled_seal(ran_in):
    for bar in PRESSURES:
        estimate = estimates_of(ran_in, bar * BAR, 0.01)
        assert estimate.coulomb_friction == pytest.approx(settled_friction(bar), rel=0.06)
    settled = ran_in.figures['settled']
    truth = np.array([settled_friction(bar) for bar in PRESSURES])
    share = settled['relative_std_of_settling']
    assert np.abs(np.array(settled['fitted_N']) / truth - 1.0).max() < 2.0 * share + 0.01
    assert ran_in.document['uncertainty']['relative_std'] > ran_in.figures['as_measured']['relative_std']


def test_the_numbers_beside_it_are_of_the_readings_as_measured(ran_in):
    measured, fitted = (np.array(ran_in.figures[name]) for name in ('measured_N', 'fitted_N'))
    truth = np.array([settled_friction(bar) for bar in PRESSURES])
    assert np.abs(measured / truth - 1.0).min() > 0.03
    assert fitted == pytest.approx(measured, rel=0.03)
    assert ran_in.figures['left_out_N'] == pytest.approx(measured.tolist(), rel=0.05)
    assert ran_in.figures['parameters'] == ran_in.figures['settled']['parameters']
    assert ran_in.figures['parameters'] != ran_in.figures['as_measured']['parameters']
    assert ran_in.has_warning('run-in', 'the law of the settled seal', 'as measured')
    assert all(row['is_evident'] for row in ran_in.figures['run_in'])


def test_the_summary_and_the_page_say_which_numbers_are_of_the_settled_seal(tmp_path, capsys):
    out, page = tmp_path / 'seal.yaml', tmp_path / 'page.html'
    arguments = logs(tmp_path, lambda s, _: 1.0 - 0.2 * np.exp(-s / 0.25))
    assert main(['identify', *arguments, '--out', str(out), '--report', str(page)]) == 0
    text, found = capsys.readouterr().out, read_yaml(out)['identification']
    for name, error in found['standard_errors'].items():
        saved, measured = (where['parameters'][name] for where in (found, found['as_measured']))
        assert saved != measured
        assert f'{name} = {saved:.4g} N, standard error {error:.2g} (settled seal; {measured:.4g} as measured)' in text
    assert 'laws on left-out readings (of the settled seal, left out by pressure)' in text
    assert 'The readings here are those of the settled seal.' in page.read_text()
    assert 'friction_at_one_bar, as measured' in page.read_text()


def test_with_three_pressures_ladder_and_errors_are_of_the_readings_as_measured(tmp_path, capsys):
    """Two numbers would decide whether the pressures agree better: so the law is chosen as measured."""
    out, page = tmp_path / 'seal.yaml', tmp_path / 'page.html'
    arguments = logs(tmp_path, lambda s, _: 1.0 - 0.2 * np.exp(-s / 0.25), pressures=PRESSURES[:3])
    assert main(['identify', *arguments, '--out', str(out), '--report', str(page)]) == 0
    text, found = capsys.readouterr().out, read_yaml(out)['identification']
    for name, error in found['standard_errors'].items():
        saved, measured = (where['parameters'][name] for where in (found, found['as_measured']))
        assert saved != measured
        assert f'{name} = {measured:.4g} N, standard error {error:.2g} (as measured; {saved:.4g} settled seal)' in text
    assert 'laws on left-out readings (left out by pressure)' in text
    assert 'The readings here are those of the settled seal.' not in page.read_text()
    assert 'friction_at_one_bar, settled seal' in page.read_text()


def test_the_next_readings_are_designed_by_the_readings_that_the_law_was_chosen_on(tmp_path):
    """Against the law of the settled seal, readings as measured would be off by the run-in, as if they scattered."""
    run = Run(tmp_path, *logs(tmp_path, lambda s, _: 1.0 - 0.3 * np.exp(-s / 0.4)), '--next', str(tmp_path / 'n.csv'))
    parts = run.figures['next_effect']['parts']
    way = np.linspace(0.0, 0.8, 21)
    course = 1.0 - 0.3 * np.exp(-way / 0.4)
    drifting = course.std() / course.mean()
    assert parts['scatter'] < 1.3 * drifting < 1.0 / course.mean() - 1.0


def test_without_a_drift_nothing_is_corrected(tmp_path):
    run = Run(tmp_path, *logs(tmp_path, lambda s, _: np.ones_like(s)))
    assert run.figures['settled'] is None
    assert run.figures['parameters'] == run.figures['as_measured']['parameters']
    assert not run.has_warning('run-in')
    assert not any(row['is_evident'] for row in run.figures['run_in'])
    for bar, fitted in zip(PRESSURES, run.figures['fitted_N'], strict=True):
        assert estimates_of(run, bar * BAR, 0.01).coulomb_friction == pytest.approx(fitted, rel=0.01)


def test_the_law_is_chosen_on_the_settled_seal(tmp_path):
    """Two of four pressures run in: as measured, friction hardly rises between them and the others."""
    run = Run(tmp_path, *logs(tmp_path, lambda s, bar: 1.0 - (0.3 if bar > 3.0 else 0.0) * np.exp(-s / 0.4)))
    measured, left_out = (np.array(run.figures[name]) for name in ('measured_N', 'left_out_N'))
    assert measured[2] / settled_friction(PRESSURES[2]) < 0.95
    assert left_out == pytest.approx(measured, rel=0.06)
    for bar in PRESSURES:
        assert estimates_of(run, bar * BAR, 0.01).coulomb_friction == pytest.approx(settled_friction(bar), rel=0.05)


def test_a_drift_that_is_no_run_in_is_not_extrapolated(tmp_path):
    """Friction fell over one run, as a leak or a warmer day does: the readings as measured fit one law, others not."""
    run = Run(tmp_path, *logs(tmp_path, lambda s, bar: 1.0 + (0.12 - 0.3 * s if bar == 2.5 else 0.0)))
    assert run.figures['settled'] is None
    assert run.has_warning('run-in', 'the pressures agree less', 'as measured')
    assert any(row['is_evident'] for row in run.figures['run_in'])
    assert run.figures['parameters'] == run.figures['as_measured']['parameters']


def test_delft_two_days_of_one_ring_agree_better_once_settled(tmp_path):
    """Each day ran in by another amount; the settled friction was extrapolated for each day by itself."""
    days = [Run(tmp_path, *delft(ring)) for ring in ('O-ring257', 'O-ring257_run2')]

    def apart(numbers):
        one, other = (np.array(each['measured_N']) for each in numbers)
        return np.sqrt(np.mean(np.log(one / other) ** 2))

    assert apart([day.figures['settled'] for day in days]) < 0.9 * apart([day.figures for day in days])


def test_a_number_without_unit_is_shown_without_one(tmp_path, capsys):
    arguments = logs(tmp_path, lambda s, _: 1.0 + 0.0 * s)
    assert main(['identify', *arguments, '--law', 'all_terms', '--out', str(tmp_path / 'seal.yaml')]) == 0
    assert re.search(r'pressure_exponent = [\d.]+, standard error', capsys.readouterr().out)
