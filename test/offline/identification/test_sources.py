"""Sources that are unfit for identification get one line that says what to do, and never a file."""

import csv
import shutil

import numpy as np
import pytest
from harness.identify_run import THESIS, Run
from paths import ROOT

from seal_friction_ros.offline.bags.import_log import Samples, write_samples
from seal_friction_ros.offline.identification.sources import SourceOptions, read_sources
from seal_friction_ros.offline.work.finished_parts import content_of

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
    'pressure / 1000': (GOOD._replace(chamber_a=1e-3 * GOOD.chamber_a), ['as without pressure', 'not in Pa']),
    'velocity x 1000': (GOOD._replace(velocity=1e3 * GOOD.velocity), ['is not between 0 and 10 m/s', 'unit']),
    'velocity / 1000': (GOOD._replace(velocity=1e-3 * GOOD.velocity), ['does not move', 'in m/s']),
    'time x 1000': (GOOD._replace(stamp=GOOD.stamp * 1000), ['10 s apart', 'unit']),
    'noise for force': (GOOD._replace(force_sum=np.random.default_rng(1).normal(size=4800)), []),
    'no force': (GOOD._replace(force_sum=np.zeros(4800)), ['the friction is 0 N']),
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
    assert run.code == 0, run.errors
    assert run.has_warning('friction differs between runs', '-25 %')
    assert Run(tmp_path, *bags, '--refuse-changed', name='refused').code == 2
    for bar in (1, 3, 5, 7):
        shutil.rmtree(tmp_path / f'high{bar}')
        part = wave((bar * 1e5,), friction=lambda p: 2.5 * (4.0 + 6e-6 * p))
        write_samples(tmp_path / f'high{bar}', part, 'rod')
    run = Run(tmp_path, *bags, name='another')
    assert run.code == 2
    assert 'are two seals or two states of one' in run.errors
    for bar in (1, 3, 5, 7):
        shutil.rmtree(tmp_path / f'high{bar}')
        part = wave((bar * 1e5,), friction=lambda p: 1.05 * (4.0 + 6e-6 * p))
        write_samples(tmp_path / f'high{bar}', part, 'rod')
    run = Run(tmp_path, *bags)
    assert run.code == 0, run.errors
    assert not run.has_warning('this is one run')
    between = 0.15 / 1.95 * 2.0**0.5  # standard deviation of 0.9 and 1.05 over their mean
    assert run.figures['between_runs_measured'] == pytest.approx(between, rel=0.01)
    shares = np.array(run.figures['std_N']) / np.array(run.figures['fitted_N'])
    assert between < shares.min()
    assert shares.max() < 2.0 * between


@pytest.mark.parametrize('law', ['pressure_power_law_1', 'all_terms'])
def test_the_band_of_a_law_holds_what_runs_differ_by(tmp_path, law):
    """Each run has all pressures, so one is predicted from the other; a fit to both is nearer than a new run."""
    for name, factor in (('low', 0.9), ('high', 1.2)):
        part = wave((1e5, 3e5, 5e5, 7e5), friction=lambda p, k=factor: k * (4.0 + 6e-6 * p))
        write_samples(tmp_path / name, part, 'rod')
    run = Run(tmp_path, str(tmp_path / 'low'), str(tmp_path / 'high'), '--law', law)
    between = 0.3 / 2.1 * 2.0**0.5  # standard deviation of 0.9 and 1.2 over their mean
    shares = np.array(run.figures['std_N']) / np.array(run.figures['fitted_N'])
    assert between < shares.min()
    assert shares.max() < 1.3 * between


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
        (lambda r: r | {'pressure_psig': '500'}, ['scatter by', 'record the pressure']),
        (lambda r: r | {'friction_lbf': '-' + r['friction_lbf']}, ['is negative']),
        (lambda r: r | {'friction_lbf': 'nan'}, ['have no friction']),
        (lambda r: r | {'friction_lbf': ''}, ['row 2', 'not a number']),
        (lambda r: r | {'direction': 'up'}, ['row 2', "'up'"]),
        (lambda r: r | {'friction_lbf': str(min(float(r['friction_lbf']), 9.0))}, ['clipped']),
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
        ((str(THESIS), '--seal', 'missing'), 'config/seals has no missing: there are'),
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


def test_a_table_with_the_dwell_gives_a_breakaway_that_grows_with_it_and_says_so(tmp_path):
    rng = np.random.default_rng(4)
    rows = ['pressure_bar,friction_N,direction,kind,test,dwell_s']
    for test in (1, 2, 3):
        for bar in (0, 20, 40, 60):
            for direction in ('extend', 'retract'):
                friction = 5.0 + 0.2 * bar
                rows.append(f'{bar},{friction * rng.normal(1.0, 0.02):.3f},{direction},dynamic,{test},0')
                for dwell in (1, 30, 600):
                    start = friction * (1.1 + 0.12 * np.log10(1.0 + dwell)) * rng.normal(1.0, 0.02)
                    rows.append(f'{bar},{start:.3f},{direction},static,{test},{dwell}')
    table = tmp_path / 'table.csv'
    table.write_text('\n'.join(rows))
    run = Run(tmp_path, str(table))
    assert run.code == 0, run.errors
    breakaway = run.figures['breakaway']
    assert breakaway['law'].endswith('_dwell')
    assert breakaway['ratio_per_decade'] == pytest.approx(0.12, rel=0.15)
    assert run.has_warning('breakaway grows with the time at rest', 'the seal file holds that after')
    held = 0.1 + 0.12 * np.log10(1.0 + breakaway['dwell'])
    both = run.document['stiction_ratio'] + run.document['stiction'] / 11.0  # [-] of the mean friction of the seal
    assert both == pytest.approx(held, rel=0.15)


def test_sources_are_read_by_workers_as_by_one_and_the_first_error_counts(tmp_path):
    paths = []
    for number in range(3):
        paths.append(tmp_path / f'{number}.csv')
        paths[-1].write_text(f'pressure_bar,friction_N\n1,{2 + number}\n5,{7 + number}\n')
    one, several = (read_sources(paths, SourceOptions(), workers) for workers in (1, 3))
    assert content_of(one) == content_of(several)
    for path in paths[1:]:
        path.write_text(f'pressure_bar,friction_N\n1,{path.stem}x\n')
    for workers in (1, 3):
        with pytest.raises(ValueError, match='1x'):
            read_sources(paths, SourceOptions(), workers)


@pytest.mark.parametrize('column', ['chamber_a', 'force_sum', 'velocity'])
def test_two_percent_of_single_missing_values_are_bridged_and_said(tmp_path, column):
    lost = getattr(GOOD, column).copy()
    lost[7::50] = np.nan
    write_samples(tmp_path / 'bag', GOOD._replace(**{column: lost}), 'rod')
    sources = read_sources([tmp_path / 'bag'], SourceOptions())
    count = int(np.isnan(lost).sum())
    assert f'bag: {count} samples had no value, and are on a straight line between their neighbours' in sources.remarks
    assert sources.prepare().readings.two_sided


def test_one_held_pressure_holds_over_the_noise_of_its_own_log(tmp_path):
    part = wave((60e5,))
    write_samples(tmp_path / 'bag', part, 'rod')
    run = Run(tmp_path, str(tmp_path / 'bag'))
    assert run.code == 0, run.errors
    low, high = run.document['identified_pressure']
    assert low <= 60e5 * 0.991 < 60e5 * 1.009 <= high  # three times 0.3 %
