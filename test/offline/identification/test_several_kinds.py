"""Rod seals on one chamber and a piston seal on the difference, in one cylinder that is not the package's plant."""

import csv
import itertools
from pathlib import Path

import numpy as np
import pytest
from harness.identify_run import Run
from harness.report_page import checked_page
from harness.two_kinds import BAR, held, piston_friction, rod_friction, swept, write_log

from seal_friction_ros.core.estimation.configuration import SealSelection
from seal_friction_ros.core.estimation.estimator import EstimatorSettings
from seal_friction_ros.core.friction.actuator import actuator_friction
from seal_friction_ros.files import load_configuration, read_yaml

KINDS = ('--seal-kind', 'rod=a', '--seal-kind', 'piston=difference')
GRID = tuple(itertools.product((0.0, 40.0, 80.0, 120.0), (0.0, 60.0, 120.0)))


def rng():
    return np.random.default_rng(3)


def rising(motion):
    """Friction above that at no pressure, of rod seals and piston seal, mean over the motion [N]."""
    _, a, b = (column[motion[0] != 0.0] for column in motion)
    return [float((rod_friction(a) - rod_friction(0.0)).mean()), float((piston_friction(a - b) - 38.0).mean())]


def mounted_friction(run: Run, a: float, b: float, speed: float):
    """Friction and its standard deviation by the two seal files, mounted as they say [N]."""
    files = tuple(run.figures['seal_files'].values())
    seals = load_configuration(SealSelection(files, ('mounting',)), EstimatorSettings()).parameters().estimator.seals
    found = actuator_friction(seals, a * BAR, b * BAR, speed)
    return found.coulomb_friction + found.velocity_friction, found.coulomb_friction_std


@pytest.fixture(scope='module', params=['held', pytest.param('swept', marks=pytest.mark.long)])
def told_apart(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp(request.param)
    motion = held(GRID, rng()) if request.param == 'held' else swept(240.0)
    return motion, Run(folder, *write_log(folder, motion), *KINDS)


def test_friction_that_rises_with_the_pressure_of_a_kind_is_found_within_ten_percent(told_apart):
    motion, run = told_apart
    assert run.code == 0, run.errors
    assert [kind['rising_N'] for kind in run.figures['kinds']] == pytest.approx(rising(motion), rel=0.1)


def test_the_share_of_each_kind_is_within_its_standard_deviation(told_apart):
    motion, run = told_apart
    _, a, b = (column[motion[0] != 0.0] for column in motion)
    both = [float(rod_friction(a).mean()), float(piston_friction(a - b).mean())]
    for kind, friction in zip(run.figures['kinds'], both, strict=True):
        assert abs(kind['share'] - friction / sum(both)) < 1.96 * kind['share_std']
        assert kind['share_std'] < 0.2


def test_the_seal_files_together_give_the_friction_at_pressures_that_were_not_driven(told_apart):
    _, run = told_apart
    for a, b in ((100.0, 30.0), (20.0, 90.0), (60.0, 60.0)):
        truth = rod_friction(a * BAR) + piston_friction((a - b) * BAR) + 150.0 * 0.03
        friction, std = mounted_friction(run, a, b, 0.03)
        assert friction == pytest.approx(truth, rel=0.04)
        assert std < 0.5 * friction


def test_each_kind_has_a_seal_file_with_its_mounting(told_apart):
    _, run = told_apart
    files = {kind: read_yaml(Path(path)) for kind, path in run.figures['seal_files'].items()}
    assert {kind: file['mounting']['chambers'] for kind, file in files.items()} == {
        'rod': ['a'],
        'piston': ['difference'],
    }
    assert [file['name'] for file in files.values()] == ['seal_rod', 'seal_piston']
    for file in files.values():
        known = dict(zip(file['covariance']['terms'], file['covariance']['std'], strict=True))
        assert file['velocity_terms']['asymmetry'] == 0.0
        assert known['asymmetry'] == 0.08  # less probable than none: its prior
    assert not run.out.exists()
    assert run.has_warning('friction at no pressure', 'cannot be divided')


def test_left_out_pressures_are_predicted_within_five_percent(tmp_path):
    run = Run(tmp_path, *write_log(tmp_path, held(GRID, rng())), *KINDS)
    off = np.array(run.figures['left_out_N']) / np.array(run.figures['measured_N']) - 1.0
    assert np.abs(off).max() < 0.05
    assert run.figures['left_out_by'] == 'pressure'


@pytest.mark.parametrize(
    ('pairs', 'words'),
    [
        ([(a, 0.0) for a in (0, 20, 40, 60, 80, 100)], ['rod and piston', 'moved together', 'correlation +1']),
        ([(a, 0.2 * a + 2 * (i % 2)) for i, a in enumerate((5, 25, 45, 65, 85))], ['moved together', 'a and b at']),
        ([(60.0, b) for b in (0, 30, 60, 90, 120)], ['rod saw 60 to 60 bar', 'a and b at']),
    ],
    ids=['b vented', 'b follows a', 'a held'],
)  # fmt: skip
def test_kinds_that_cannot_be_told_apart_are_refused_with_the_pressures_to_drive(pairs, words, tmp_path):
    run = Run(tmp_path, *write_log(tmp_path, held(pairs, rng())), *KINDS)
    assert run.code == 2
    assert [word for word in words if word not in run.errors] == []
    assert run.errors.count('\n') == 1
    assert not list(tmp_path.glob('seal*.yaml'))


def test_kinds_that_are_poorly_told_apart_are_taken_if_asked_and_their_deviations_say_so(tmp_path):
    motion = held([(60, 25), (100, 40), (60, 15), (100, 30)], rng())
    logs = write_log(tmp_path, motion)
    refused = Run(tmp_path, *logs, *KINDS)
    assert refused.code == 2
    assert 'the friction of rod cannot be told from that of the others: 64 N with a standard error' in refused.errors
    asked = refused.errors.strip().rpartition('or take it with that error: ')[2].split()
    run = Run(tmp_path, *logs, *KINDS, *asked)
    assert run.code == 0, run.errors
    assert run.has_warning('rod: 64 N', '--largest-kind-error', 'use the seal files in this cylinder only')
    off = np.array(run.figures['fitted_N']) / np.array(run.figures['measured_N']) - 1.0
    assert np.abs(off).max() < 0.05  # the sum of both is known
    rod, piston = (read_yaml(Path(path)) for path in run.figures['seal_files'].values())
    for seal in (rod, piston):
        alone = seal['identification']
        assert alone['std_of_this_kind_alone_N'] > 0.2 * alone['friction_N']
        assert seal['uncertainty']['relative_std'] < 0.2  # of both together
    for a, b in ((100.0, 100.0), (0.0, 60.0)):  # not driven
        truth = rod_friction(a * BAR) + piston_friction((a - b) * BAR) + 150.0 * 0.03
        friction, std = mounted_friction(run, a, b, 0.03)
        assert abs(friction - truth) < 1.96 * std


def test_the_proposed_pressures_make_the_kinds_tell_apart(tmp_path):
    vented = [(a, 0.0) for a in (0, 20, 40, 60, 80, 100)]
    refused = Run(tmp_path, *write_log(tmp_path, held(vented, rng())), *KINDS)
    proposed = refused.errors.split('chambers a and b at ')[1].split(' bar')[0].split(', ')
    pairs = [tuple(float(word) for word in pair.split(' and ')) for pair in proposed]
    more = [*vented, *pairs, *((0.5 * a, 0.5 * b) for a, b in pairs)]
    run = Run(tmp_path, *write_log(tmp_path, held(more, rng())), *KINDS)
    assert run.code == 0, run.errors
    assert max(kind['pressure_correlation'] for kind in run.figures['kinds']) < 0.9


def test_the_runs_of_the_next_sheet_tell_the_kinds_apart_better(tmp_path):
    """Few pressures of chamber b at first; the sheet is driven, and both are given to the same command."""
    first = [*((a, 0.0) for a in (0, 30, 60, 90, 120)), (60.0, 30.0), (120.0, 60.0), (90.0, 90.0)]
    sheet = tmp_path / 'next.csv'
    before = Run(tmp_path, *write_log(tmp_path, held(first, rng())), *KINDS, '--next', str(sheet))
    assert before.code == 0, before.errors
    lines = sheet.read_text().splitlines()
    notes = [line for line in lines if line.startswith('#')]
    rows = [{name: float(cell) for name, cell in row.items()} for row in csv.DictReader(lines[len(notes) :])]
    assert before.figures['sheet'] == str(sheet)
    assert [row['pressure_a_Pa'] / BAR for row in before.figures['next']] == pytest.approx(
        [row['pressure_a_bar'] for row in rows]
    )
    assert all(row['speed_mm_per_s'] > 0.0 for row in rows)
    driven = [(row['pressure_a_bar'], row['pressure_b_bar']) for row in rows]
    after = Run(tmp_path, *write_log(tmp_path, held([*first, *driven], rng())), *KINDS, name='after')
    together = [max(kind['pressure_correlation'] for kind in run.figures['kinds']) for run in (before, after)]
    assert f'{together[0]:.2f} now' in notes[-1]
    assert together[1] < together[0] - 0.2
    again = Run(tmp_path, *write_log(tmp_path, held(first, rng())), *KINDS, '--next', str(sheet), name='again')
    assert again.code == 2
    assert 'not overwriting' in again.errors


def test_friction_of_one_kind_alone_is_not_given_to_the_other(tmp_path):
    motion = held(GRID, rng())
    run = Run(tmp_path, *write_log(tmp_path, motion, kinds=lambda a, _: 40.0 + 2.0 * a / BAR), *KINDS)
    rod, piston = run.figures['kinds']
    assert rod['rising_N'] == pytest.approx(2.0 * motion[1][motion[0] != 0.0].mean() / BAR, rel=0.05)
    assert piston['rising_N'] < 0.02 * rod['rising_N']


def test_equal_kinds_of_names_and_options_of_one_kind_are_refused(tmp_path):
    log = write_log(tmp_path, held(GRID, rng()))
    for more, word in (
        (('--seal-kind', 'rod=a'), 'two kinds'),
        ((*KINDS, '--seal-chambers', 'a,b'), '--seal-chambers'),
        ((*KINDS, '--law', 'constant_coulomb'), "--law 'constant_coulomb' is not one of all_terms"),
        ((*KINDS, '--seal', 'ms28775_114'), '--seal is for one kind'),
        (('--largest-kind-error', '0.2'), '--seal-kind'),
    ):
        run = Run(tmp_path, *log, *more)
        assert run.code == 2
        assert word in run.errors


def test_options_of_one_kind_are_taken_for_several_and_change_nothing_where_they_ask_for_what_is(tmp_path):
    log, work = write_log(tmp_path, held(GRID[::2], rng())), tmp_path / 'work'
    plain = Run(tmp_path, *log, *KINDS, name='plain')
    more = ('--law', 'all_terms', '--refuse-changed', '--workers', '2', '--work', str(work))
    asked = Run(tmp_path, *log, *KINDS, *more, name='asked')
    assert asked.code == 0, asked.errors
    assert asked.figures['kinds'] == plain.figures['kinds']
    assert asked.figures['calibration'] == plain.figures['calibration']


def test_a_source_with_other_friction_is_refused_for_several_kinds_too(tmp_path):
    def both(a, b):
        return rod_friction(a) + piston_friction(a - b)

    for name, share in (('one', 1.0), ('two', 1.4)):
        (tmp_path / name).mkdir()
        write_log(tmp_path / name, held(GRID[::2], rng()), kinds=lambda a, b, s=share: s * both(a, b))
    logs, rig = (
        [str(next((tmp_path / name).glob('*.csv'))) for name in ('one', 'two')],
        next(tmp_path.glob('one/*.yaml')),
    )
    run = Run(tmp_path, *logs, '--rig', str(rig), *KINDS, '--refuse-changed')
    assert run.code == 2
    assert 'two seals or two states of one' in run.errors


def test_the_page_has_the_share_of_each_kind_and_every_pressure_left_out(tmp_path):
    log, out = write_log(tmp_path, held(GRID, rng())), tmp_path / 'page.html'
    run = Run(tmp_path, *log, *KINDS, '--report', str(out))
    assert run.code == 0, run.errors
    assert run.figures['report'] == str(out)
    page = checked_page(out)
    of_kinds = {'friction_of_kinds', 'measured_over_left_out'}
    assert set(page.figures) == of_kinds | {'calibration', 'measured_against_model', 'residuals'}
    for kind in run.figures['kinds']:
        assert f'{100.0 * kind["share"]:.1f}' in page.prose
    assert 'use the seal files together: seals: [seal_rod.yaml, seal_piston.yaml]' in page.prose
    assert len(run.figures['left_out_N']) == len(GRID)
    assert 'difference' in page.prose


def test_a_seal_file_that_another_made_is_not_overwritten(tmp_path):
    (tmp_path / 'seal_rod.yaml').write_text('name: mine\n')
    run = Run(tmp_path, *write_log(tmp_path, held(GRID, rng())), *KINDS)
    assert run.code == 2
    assert (tmp_path / 'seal_rod.yaml').read_text() == 'name: mine\n'


def test_the_band_holds_left_out_samples_of_a_swept_log_with_the_noise_of_their_sensors(tmp_path):
    run = Run(tmp_path, *write_log(tmp_path, swept(60.0)), *KINDS)
    assert run.code == 0, run.errors
    assert 0.90 <= run.figures['band_coverage'] <= 0.99
