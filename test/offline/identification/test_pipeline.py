"""Identification from real measurements, against what is known of them."""

from pathlib import Path

import numpy as np
import pytest
from harness.identify_run import BARS, DELFT, FRICTION_ID, OTHER, THESIS, THESIS_RIG, Run, data, delft, estimates_of

from seal_friction_ros.core.foundation.normal_distribution import BAND_95
from seal_friction_ros.core.foundation.units import LBF, PSI
from seal_friction_ros.core.friction.actuator import MountedSeal, actuator_friction
from seal_friction_ros.core.friction.seal_file import parse_seal
from seal_friction_ros.core.identification.fitting import offsets_of, root_mean_square
from seal_friction_ros.core.identification.selection import NEAR
from seal_friction_ros.files import config_path, read_yaml
from seal_friction_ros.offline.bags.import_log import read_samples
from seal_friction_ros.offline.bags.import_thesis import import_thesis
from seal_friction_ros.offline.bags.rig_file import read_rig
from seal_friction_ros.offline.identification.pipeline import IdentifyOptions, fitted_readings, gather, select_law
from seal_friction_ros.offline.identification.sources import SourceOptions, read_sources

# --- thesis ---


@pytest.fixture(scope='module', params=['physics_based', pytest.param('pressure_power_law', marks=pytest.mark.long)])
def thesis(request, run_of):
    return run_of(str(THESIS), *THESIS_RIG, '--law', request.param)


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


def test_thesis_breakaway_is_within_eight_percent_at_every_pressure(thesis):
    breakaway = thesis.figures['breakaway']
    assert breakaway['law'] == 'both'
    off = np.array(breakaway['fitted_N']) / np.array(breakaway['measured_N']) - 1.0
    assert np.abs(off).max() <= 0.08
    seal = parse_seal(thesis.document)
    both = (MountedSeal(seal, 'a'), MountedSeal(seal, 'b'))
    of_node = [actuator_friction(both, p, p) for p in breakaway['pressure_Pa']]
    assert breakaway['fitted_N'] == pytest.approx([f.coulomb_friction + f.stiction for f in of_node], rel=1e-4)
    more = np.array(breakaway['fitted_N']) - np.array(thesis.figures['fitted_N'])
    assert more.mean() / LBF == pytest.approx(1.11, abs=0.1)


def test_thesis_constant_friction_is_beaten_and_the_repeatability_is_the_floor(thesis):
    assert thesis.ladder('constant_coulomb')['is_beaten']
    assert thesis.figures['recommended_law'] == 'physics_based'
    assert not thesis.ladder('physics_based')['is_beaten']
    assert thesis.figures['repeatability'] == pytest.approx(0.085, abs=0.005)
    assert thesis.ladder('physics_based')['error'] < thesis.figures['repeatability']


def test_thesis_physics_based_law_is_that_of_the_shipped_seal(run_of):
    run = run_of(str(THESIS), *THESIS_RIG, '--law', 'physics_based')
    shipped = read_yaml(config_path('seals', 'ms28775_114'))['friction_coefficient']
    assert run.figures['parameters']['exponent'] == pytest.approx(shipped['exponent'], abs=0.01)
    assert run.figures['parameters']['coefficient'] == pytest.approx(shipped['coefficient'], rel=0.03)
    errors = run.figures['standard_errors']
    assert abs(run.figures['parameters']['exponent'] - shipped['exponent']) < errors['exponent']
    assert run.has_warning('coefficient and exponent trade off')


@pytest.mark.long  # an identification more
def test_thesis_as_a_bag_gives_the_same_law_as_the_table(tmp_path, run_of):
    import_thesis(tmp_path / 'bag')
    bag = Run(tmp_path, str(tmp_path / 'bag'), *THESIS_RIG, '--law', 'physics_based', name='of_bag')
    table = run_of(str(THESIS), *THESIS_RIG, '--law', 'physics_based')
    assert bag.figures['measured_N'] == pytest.approx(
        table.figures['measured_N'], rel=0.06
    )  # three readings: their median there, their mean here
    assert bag.figures['parameters'] == pytest.approx(table.figures['parameters'], rel=0.03)
    assert bag.document['stiction'] == pytest.approx(table.document['stiction'], rel=0.05)


# --- Delft ---


@pytest.mark.parametrize('ring', ['O-ring257', 'X-ring257', 'NAPN'])
def test_delft_half_range_friction_is_recovered(ring, run_of):
    run = run_of(*delft(ring))
    assert run.figures['measured_N'] == pytest.approx(DELFT[ring], abs=0.3)
    assert np.array(run.figures['pressure_Pa']) / 1e5 == pytest.approx(BARS, abs=0.1)


@pytest.mark.parametrize('more', [(), ('--seal', 'delft_o_ring', '--squeeze-force', '--law', 'physics_based')])
def test_delft_o_ring_law_predicts_a_pressure_it_has_not_seen(more, run_of):
    run = run_of(*delft('O-ring257'), *more)
    assert run.figures['left_out_by'] == 'pressure'
    assert run.figures['worst_left_out_error'] <= 0.12
    assert run.figures['cross_validation_error'] <= 0.05
    constant, law = run.ladder('constant_coulomb'), run.ladder(run.figures['law'])
    assert constant['error'] >= 2.0 * law['error']
    assert constant['rms_N'] >= 2.0 * law['rms_N']
    assert not any(run.figures['is_outlier'])
    assert run.has_warning('collinear', 'speed', 'pressure')


def test_delft_standard_deviation_covers_runs_that_repeat_within_10_to_15_percent(run_of):
    run = run_of(*delft('O-ring257'))
    shares = np.array(run.figures['std_N']) / np.array(run.figures['fitted_N'])
    assert 0.10 <= shares.min() <= shares.max() <= 0.20
    assert run.has_warning('one run', 'a prior of 15 %')
    known = run_of(*delft('O-ring257'), '--run-to-run', '0.05')
    assert known.figures['relative_std'] < run.figures['relative_std']


def test_delft_offsets_of_the_force_sum_are_told(run_of):
    run = run_of(*delft('O-ring257'))
    assert run.figures['offset_N'] == pytest.approx([-1.2, -1.9, -2.2, -2.0], abs=0.15)  # config/rigs/delft.yaml
    line = run.figures['offset_line']
    assert line['area_error_m2'] * 1e6 == pytest.approx(-1.1, abs=0.4)  # [mm2] of a bore of 519
    assert line['constant_N'] == pytest.approx(-1.35, abs=0.2)
    assert not run.has_warning('area')  # too little to matter


def test_delft_a_wrong_bore_is_found_told_and_corrected(run_of):
    """The cylinder has 490.9 mm2, the rig file 518.7 mm2; README of the data."""
    run = run_of(*delft('NAPN'))
    assert run.figures['area_correction_m2'] * 1e6 == pytest.approx(-24.0, abs=4.0)
    assert run.has_warning(
        'the bore is nearer to 25.1 than 25.7 mm', 'the seal file carries', 'or it is corrected twice'
    )
    offsets = np.array(run.figures['offset_N'])
    assert np.ptp(offsets) < 0.1 * max(run.figures['measured_N'])


def test_delft_an_area_that_was_put_right_in_the_rig_file_is_not_corrected_again(tmp_path):
    rig = config_path('rigs', 'delft').read_text()
    assert rig.count('518.748') == 1
    right = tmp_path / 'right.yaml'
    right.write_text(rig.replace('518.748', '495.9'))
    run = Run(tmp_path, *delft('NAPN'), '--rig', str(right))
    assert not run.has_warning('area of chamber')
    assert run.document.get('force_sum_correction', {}).get('area_a', 0.0) == 0.0


def test_delft_both_directions_of_a_held_file_are_one_level(run_of):
    run = run_of(*(str(data(f'delft/Stadium_lc_{bar}bar.csv')) for bar in range(1, 6)))
    assert np.array(run.figures['pressure_Pa']) / 1e5 == pytest.approx([1, 2, 3, 4, 5], abs=0.1)
    assert run.figures['measured_N'] == pytest.approx(DELFT['Stadium_lc'], abs=0.3)


def test_delft_two_runs_of_one_ring_are_fitted_together_and_the_band_holds_the_other_run(tmp_path, run_of):
    runs = [delft('O-ring257'), delft('O-ring257_run2')]
    both = Run(tmp_path, *runs[0], *runs[1])
    assert 0.10 <= both.figures['between_run_std'] <= 0.20
    assert both.has_warning('friction differs between runs')
    refused = Run(tmp_path, *runs[0], *runs[1], '--refuse-changed', name='refused')
    assert refused.code == 2
    assert 'two seals or two states of one' in refused.errors
    for first, other in (runs, runs[::-1]):
        alone = run_of(*first)
        half_width = BAND_95 * np.array(alone.figures['std_N']) / np.array(alone.figures['fitted_N'])
        assert half_width.max() <= 0.45
        log = read_sources([Path(path) for path in other], SourceOptions(rig='delft')).prepare()
        mounted = (MountedSeal(parse_seal(alone.document), 'a'),)
        fitted, std = fitted_readings(mounted, log.readings.chamber_pressures, log.readings.at.velocity)
        strokes = log.readings.magnitudes(offsets_of(log.readings, fitted))
        assert np.mean(np.abs(strokes - fitted) <= BAND_95 * std) >= 0.9


def test_delft_x_ring_at_7_bar_is_an_outlier_with_a_reason_to_look(run_of):
    run = run_of(*delft('X-ring257'))
    assert run.figures['is_outlier'] == [False, False, False, True]
    assert run.has_warning('outlier', '6.92 bar', 'A reason to look', 'had not settled')
    assert not run.has_warning('one direction only')  # the outlier has both
    assert not run.has_warning('pressures agree less')  # three pressures are not compared
    assert run.figures['drift'][3] > 0.2  # the reason: it is still rising
    assert max(map(abs, run.figures['drift'][:3])) < 0.1
    assert run.figures['measured_N'][3] > 1.4 * run.figures['fitted_N'][3]
    assert run.document['identified_pressure'][1] < 5.2e5  # nothing is claimed up there


@pytest.mark.parametrize('seal', [*DELFT, 'O-ring257_run2'])
def test_delft_a_left_out_pressure_is_predicted_within_12_percent(seal, run_of):
    """Outliers aside, one a seal. The law rises where the friction does."""
    bars = range(1, 6) if seal == 'Stadium_lc' else BARS
    run = run_of(*(str(data(f'delft/{seal}_{bar}bar.csv')) for bar in bars))
    off = np.array(run.figures['left_out_N']) / np.array(run.figures['measured_N']) - 1.0
    used = ~np.array(run.figures['is_outlier'])
    assert np.count_nonzero(~used) <= 1
    assert np.abs(off[used]).max() <= 0.12
    assert run.figures['fitted_N'] == sorted(run.figures['fitted_N'])
    assert run.figures['fitted_N'][-1] > 1.3 * run.figures['fitted_N'][0]
    nested = np.array(run.figures['left_out_nested_N']) / np.array(run.figures['measured_N']) - 1.0
    worst = {'X-ring257': 0.22, 'O-ring257_run2': 0.2}  # X-ring: two pressures are left of three, a prior stands in
    assert np.abs(nested[used]).max() <= worst.get(seal, 0.15)
    same = np.array(run.figures['left_out_nested_laws']) == run.figures['law']
    assert nested[used][same] == pytest.approx(off[used][same], abs=1e-6)


def test_without_its_highest_pressure_another_law_is_chosen_and_the_nested_error_says_so(run_of):
    run = run_of(*delft('O-ring257_run2'))
    assert run.figures['law'].startswith('pressure_power_law')
    assert run.figures['left_out_nested_laws'][3] == 'pressure_power_law_3_2'
    off, nested = (
        run.figures[key][3] / run.figures['measured_N'][3] - 1.0 for key in ('left_out_N', 'left_out_nested_N')
    )
    assert nested > off + 0.05
    named = run_of(*delft('O-ring257_run2'), '--law', run.figures['law'])
    assert named.figures['left_out_nested_N'] == [None] * 4  # nothing was chosen


@pytest.mark.parametrize(('higher', 'code'), [((1,), 0), ((1, 3, 5), 2)])
def test_two_seals_are_refused_if_they_differ_at_most_of_the_pressures(higher, code, tmp_path):
    random, tables = np.random.default_rng(4), []
    for run in range(2):
        rows = ['pressure_bar,friction_N,direction']
        for bar in (1, 3, 5, 7, 9):
            friction = (2.0 + 0.5 * bar) * (2.2 if run and bar in higher else 1.0)
            rows += [f'{bar},{friction * random.normal(1.0, 0.01)},{way}' for way in ('extend', 'retract') * 4]
        tables.append(tmp_path / f'run{run}.csv')
        tables[-1].write_text('\n'.join(rows))
    run = Run(tmp_path, *map(str, tables))
    assert run.code == code, run.errors
    assert ('two seals or two states of one' in run.errors) == (code == 2)


@pytest.mark.parametrize(('wrong', 'claimed'), [(7, (1.0, 5.0)), (3, (5.0, 11.0)), (11, (1.0, 9.0)), (1, (3.0, 11.0))])
def test_nothing_is_claimed_beyond_a_pressure_that_disagrees_with_the_others(wrong, claimed, tmp_path):
    random = np.random.default_rng(3)
    rows = ['pressure_bar,friction_N,direction']
    for bar in (1, 3, 5, 7, 9, 11):
        friction = (2.0 + 0.5 * bar) * (2.0 if bar == wrong else 1.0)
        rows += [f'{bar},{friction * random.normal(1.0, 0.01)},{way}' for way in ('extend', 'retract') * 4]
    (tmp_path / 'table.csv').write_text('\n'.join(rows))
    run = Run(tmp_path, str(tmp_path / 'table.csv'))
    assert run.figures['is_outlier'] == [bar == wrong for bar in (1, 3, 5, 7, 9, 11)]
    assert run.document['identified_pressure'] == [pytest.approx(1e5 * bar) for bar in claimed]
    for bar in (1, 3, 5, 7, 9, 11):
        status = estimates_of(run, 1e5 * bar, 0.01).status
        assert bool(status) == (not claimed[0] <= bar <= claimed[1])


def test_the_same_bytes_given_twice_are_refused(tmp_path):
    copy = tmp_path / 'copy.csv'
    copy.write_bytes(data('delft/O-ring257_1bar.csv').read_bytes())
    run = Run(tmp_path, *delft('O-ring257'), str(copy))
    assert run.code == 2
    assert 'are the same bytes: name it once' in run.errors


def test_one_pressure_gives_a_law_that_holds_there_and_says_so(tmp_path):
    run = Run(tmp_path, str(data('delft/O-ring257_3bar.csv')))
    assert run.code == 0, run.errors
    assert run.figures['fitted_N'] == pytest.approx([5.85], abs=0.2)
    low, high = run.document['identified_pressure']
    assert 2.8e5 < low < high < 3.2e5
    assert run.has_warning('there the law holds', 'from a prior')


# --- tables ---


def readings_table(path, scatter, friction):
    """Table of readings at 0 to 70 bar and three speeds, with a relative scatter."""
    random = np.random.default_rng(7)
    rows = ['pressure_bar,friction_N,direction,velocity_m_per_s,test']
    for test in range(1, 4):
        for bar in range(0, 71, 10):
            for speed in (0.02, 0.1, 0.3):
                measured = friction(bar, speed) * random.normal(1.0, scatter)
                rows.append(f'{bar},{measured:.3f},extend,{speed},{test}')
    path.write_text('\n'.join(rows))
    return str(path)


@pytest.mark.long
def test_the_number_of_workers_changes_no_byte(tmp_path):
    table, files = readings_table(tmp_path / 'table.csv', 0.02, lambda bar, _: 2.0 + 0.1 * bar), []
    for workers in ('1', '2'):
        (folder := tmp_path / workers).mkdir()
        run = Run(folder, table, '--workers', workers, '--name', 'seal')
        assert run.code == 0, run.errors
        assert all(run.figures['left_out_nested_laws'])
        files.append([path.read_bytes() for path in sorted(folder.glob('*.yaml'))])
    assert files[0] == files[1] != []


@pytest.mark.long  # two identifications
def test_a_level_at_which_the_law_of_the_others_gives_no_friction_is_no_outlier(tmp_path):
    """The power law fitted to the other pressures gives 0 N at 0 bar, where no relative deviation exists."""
    table = readings_table(
        tmp_path / 'table.csv', 0.01, lambda bar, speed: (6.0 + 20.0 * np.tanh(bar / 40.0)) * np.exp(-speed / 0.5)
    )
    run = Run(tmp_path, table)
    assert run.code == 0, run.errors
    assert run.figures['measured_N'][0] == pytest.approx(4.62, rel=0.05)  # 6 N times the mean of exp over the speeds
    assert run.figures['is_outlier'] == [False] * 8


def test_readings_without_scatter_have_no_outlier(tmp_path):
    run = Run(tmp_path, readings_table(tmp_path / 'table.csv', 0.0, lambda *_: 5.0))
    assert run.code == 0, run.errors
    assert run.figures['is_outlier'] == [False] * 8


# --- MBARI ---


@pytest.fixture(scope='module')
def friction_id(run_of):
    return run_of(str(data(f'mbari/{FRICTION_ID}')))


@pytest.fixture(scope='module')
def other(run_of):
    return run_of(str(data(f'mbari/{OTHER}')))


@pytest.mark.parametrize(
    ('name', 'bar', 'table'),
    [('friction_id', 150.0, 197.0), pytest.param('other', 200.0, 504.0, marks=pytest.mark.long)],
)
def test_mbari_blocks_are_predicted_from_the_others(name, bar, table, request):
    run = request.getfixturevalue(name)
    assert run.figures['left_out_by'] == 'block'
    assert run.figures['cross_validation_rms_N'] <= bar < table
    assert run.has_warning('velocity and pressure difference are collinear')
    assert 0.90 <= run.figures['band_coverage'] <= 0.99
    with_pressure = run.figures['law'].startswith('pressure')
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


def test_mbari_the_law_of_one_log_is_sound_and_its_band_holds_the_other(friction_id):
    assert friction_id.figures['condition_number'] < 30.0
    assert not friction_id.has_warning('are not determined')
    chambers = tuple(friction_id.figures['seal_chambers'])
    log = read_sources([data(f'mbari/{OTHER}')], SourceOptions(rig='mbari')).prepare()
    chosen = np.arange(0, log.readings.count, 7)
    mounted = tuple(MountedSeal(parse_seal(friction_id.document), chamber) for chamber in chambers)
    fitted, std = fitted_readings(mounted, log.readings.chamber_pressures[chosen], log.readings.at.velocity[chosen])
    signed = log.readings.force[chosen] - log.readings.at.direction[chosen] * fitted
    deviation = signed - signed.mean()
    assert np.sqrt(np.mean(deviation**2)) < 460.0  # [N] the laws with a constant or a free exponent leave 418 to 560 N
    assert np.mean(np.abs(deviation) <= BAND_95 * std) >= 0.9


@pytest.mark.long  # the ladder on both logs: 8 s
@pytest.mark.parametrize(('known', 'new'), [(FRICTION_ID, OTHER), (OTHER, FRICTION_ID)])
def test_mbari_the_recommended_law_is_on_the_other_log_as_good_as_any_that_predicts_its_own(known, new):
    """Of the laws whose loss on their own log is below twice the least, none is better by a tenth on the other log.

    A law that misses its own log may be better on the other by chance: nothing in the log recommends it.
    """
    rig = IdentifyOptions(sources=SourceOptions(rig='mbari'))
    tested = gather([data(f'mbari/{new}')], rig).used
    selection = select_law(gather([data(f'mbari/{known}')], rig), None)
    least = min(score.losses.mean() for score in selection.scores)

    def missed(fit):
        friction = fit.friction(tested.at)
        return root_mean_square(tested.magnitudes(offsets_of(tested, friction)) - friction)

    near = [missed(score.fit) for score in selection.scores if score.losses.mean() < NEAR * least]
    assert len(near) >= 3
    assert missed(selection.fit) <= 1.1 * min(near)


@pytest.mark.long  # a fit of 29 000 samples with every log left out
def test_mbari_two_logs_are_fitted_together_and_their_difference_is_in_the_band(tmp_path, friction_id):
    both = Run(tmp_path, *(str(data(f'mbari/{name}')) for name in (FRICTION_ID, OTHER)))
    assert both.figures['between_runs_measured'] > 0.15
    assert both.figures['between_run_std'] > friction_id.figures['between_run_std']
    assert len(both.document['identification']['data']) == 2
    (change,) = both.figures['changes']
    assert change['pressure'] is None  # one pressure holds several speeds
    assert (change['name'], change['other_name']) == (FRICTION_ID, OTHER)
    assert 0.5 < change['other_friction'] / change['friction'] < 0.85  # the first log has more friction
    assert both.has_warning('friction differs between runs: of the same law')
    logs = [str(data(f'mbari/{name}')) for name in (FRICTION_ID, OTHER)]
    refused = Run(tmp_path, *logs, '--refuse-changed', name='refused')
    assert refused.code == 2
    assert 'over their speeds and pressures' in refused.errors


def test_viscous_friction_acts_in_the_node_and_is_not_in_the_coulomb_friction(friction_id):
    run = friction_id
    slow, fast = (estimates_of(run, 2e6, velocity) for velocity in (0.1, 0.4))
    assert fast.coulomb_friction == slow.coulomb_friction
    more = 2.0 * run.figures['parameters']['viscous_friction'] * 0.3  # [N] two seals, 0.3 m/s faster
    assert fast.friction_force - slow.friction_force == pytest.approx(more, rel=1e-5)
    assert estimates_of(run, 2e6, -0.4).friction_force == pytest.approx(-fast.friction_force)
    at_rest = estimates_of(run, 2e6, 0.0, force=1e5)
    assert at_rest.friction_force == at_rest.breakaway_force
