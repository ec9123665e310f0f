"""What becomes a reading, in which group, at which level, and of which seal."""

import numpy as np
import pytest

from seal_friction_ros.core.identification.admission import Account
from seal_friction_ros.core.identification.prepare_readings import (
    prepare_logs,
    prepare_manual_readings,
)
from seal_friction_ros.core.identification.readings import ManualReadings, RecordedLog
from seal_friction_ros.core.identification.signal_preparation import Signals, Sliding

BAR = 1e5  # [Pa]
RATE = 100.0  # [Hz]
FRICTION, OFFSET = 8.0, -3.0  # [N]


# --- manual readings ---


def manual(tests, name='sheet', more=0.0) -> ManualReadings:
    """Readings of both directions; ``tests`` are the pressures [bar] of each test. Friction 10 N + 1 N/bar."""
    rows = [(t, p, d) for t, pressures in enumerate(tests) for p in pressures for d in (1, -1)]
    test, bar, direction = (np.array(column) for column in zip(*rows, strict=True))
    return ManualReadings(name, test, bar * BAR, direction, 10.0 + more + bar, np.full(len(rows), 0.02))


def test_manual_readings_get_the_sign_of_their_direction_and_every_seal_the_pressure():
    prepared = prepare_manual_readings([manual([(-0.5, 10, 20), (0, 10, 20)])], [], 3)
    readings = prepared.readings
    assert readings.at.pressure.shape == (12, 3)
    assert readings.at.pressure[:, 2].tolist() == [p * BAR for p in (0, 0, 10, 10, 20, 20) * 2]
    assert readings.at.direction.tolist() == [1.0, -1.0] * 6
    assert readings.at.velocity.tolist() == [0.02, -0.02] * 6
    assert readings.force[:4].tolist() == [9.5, -9.5, 20.0, -20.0]
    assert readings.level.tolist() == [0, 0, 1, 1, 2, 2] * 2
    assert readings.chamber_pressures.tolist() == [[p, p] for p in readings.at.pressure[:, 0]]
    assert (prepared.breakaway, prepared.accounts) == (None, (Account('sheet', 12, {}),))
    assert not readings.are_samples


@pytest.mark.parametrize(
    ('tests', 'kind', 'groups'),
    [
        ([(0, 10, 20), (0, 10, 20)], 'test', 2),
        ([(0, 10, 20), (0, 10)], 'test', 2),
        ([(0, 10, 20, 30), (0, 10)], 'pressure', 4),  # half of the pressures are not most of them
        ([(0, 10, 20)], 'pressure', 3),
    ],
)
def test_whole_tests_are_left_out_if_each_has_most_of_the_pressures_else_pressures(tests, kind, groups):
    readings = prepare_manual_readings([manual(tests)], [], 2).readings
    assert (readings.left_out_by, len(readings.groups)) == (kind, groups)
    if kind == 'pressure':
        assert readings.group.tolist() == readings.level.tolist()


def test_tests_of_two_sources_are_different_tests():
    readings = prepare_manual_readings([manual([(0, 10, 20)], 'one'), manual([(0, 10, 20)], 'other')], [], 1).readings
    assert readings.names == ('one', 'other')
    assert readings.source.tolist() == readings.group.tolist() == [0] * 6 + [1] * 6


@pytest.mark.parametrize(('tests', 'by'), [([(0, 10, 20)] * 2, 'test'), ([(0, 10, 20)], 'pressure')])
def test_breakaway_readings_belong_to_the_nearest_level_and_are_left_out_with_it(tests, by):
    static = manual([(1, 19)], more=5.0)
    breakaway = prepare_manual_readings([manual(tests)], [static], 2).breakaway
    assert breakaway.level.tolist() == [0, 0, 2, 2]
    assert breakaway.force.tolist() == [16.0, -16.0, 34.0, -34.0]
    assert breakaway.left_out_by == 'pressure'
    assert breakaway.group.tolist() == ([0, 0, 2, 2] if by == 'pressure' else breakaway.group.tolist())


# --- logs ---


def log(pressures, name='log', speed=0.03, peak=4.0, swept=False) -> RecordedLog:
    """Strokes to and fro at each pressure [bar] of chamber a; chamber b has half of it; 1 s of even sliding each."""
    velocity, force, bar = [], [], []
    rest, ramp, even = 50, 20, 100
    for pressure in pressures:
        for side in (1.0, -1.0):
            v = np.concatenate([np.zeros(rest), np.linspace(0.0, speed, ramp), np.full(even, speed)])
            velocity.append(side * np.concatenate([v, np.linspace(speed, 0.0, ramp)]))
            size = FRICTION + pressure
            push = np.concatenate([np.linspace(0.0, size + peak, rest), np.full(2 * ramp + even, size)])
            force.append(OFFSET + side * push)
            bar.append(np.full(len(push), float(pressure)) if not swept else pressure + np.linspace(0, 9, len(push)))
    v, f, p = (np.concatenate(parts) for parts in (velocity, force, bar))
    return RecordedLog(name, Signals(np.arange(len(v)) / RATE, v, p * BAR, 0.5 * p * BAR, f), Sliding())


def test_each_stroke_of_a_log_is_a_reading_of_the_chamber_of_each_seal():
    prepared = prepare_logs([log((5, 15, 30))], ('b', 'a', 'b'))
    readings = prepared.readings
    assert (readings.count, readings.are_samples, readings.left_out_by) == (6, False, 'pressure')
    assert readings.at.direction.tolist() == [1.0, -1.0] * 3
    assert readings.at.velocity == pytest.approx(np.array([0.03, -0.03] * 3))
    assert readings.at.pressure[::2] == pytest.approx(np.array([[2.5, 5, 2.5], [7.5, 15, 7.5], [15, 30, 15]]) * BAR)
    assert readings.chamber_pressures[::2] == pytest.approx(np.array([[5, 2.5], [15, 7.5], [30, 15]]) * BAR)
    sizes = FRICTION + np.repeat([5.0, 15.0, 30.0], 2)
    assert readings.force == pytest.approx(OFFSET + np.tile([1.0, -1.0], 3) * sizes)
    assert readings.level.tolist() == readings.group.tolist() == [0, 0, 1, 1, 2, 2]
    assert [len(samples) for samples in readings.samples] == [len(readings.samples[0])] * 6
    (samples,) = prepared.accounts
    assert samples.used == sum(len(each) for each in readings.samples)
    assert samples.total == 6 * 190


def test_each_start_from_rest_is_a_breakaway_reading_of_the_level_it_is_at():
    prepared = prepare_logs([log((5, 15, 30))], ('a',))
    breakaway = prepared.breakaway
    assert breakaway.level.tolist() == breakaway.group.tolist() == [0, 0, 1, 1, 2, 2]
    assert breakaway.force[:2] == pytest.approx(np.array([OFFSET + 17.0, OFFSET - 17.0]))
    assert breakaway.samples == ()


def test_whole_files_are_left_out_if_each_has_most_of_the_pressures():
    prepared = prepare_logs([log((5, 15, 30), 'one'), log((5, 15, 30), 'two')], ('a',))
    assert prepared.readings.left_out_by == 'file'
    assert prepared.readings.group.tolist() == prepared.breakaway.group.tolist() == [0] * 6 + [1] * 6
    assert prepared.readings.names == ('one', 'two')
    assert [samples.name for samples in prepared.accounts] == ['one', 'two']


def test_what_is_not_used_is_counted_by_its_reason():
    one = log((5, 15, 30))
    one.signals.force_sum[[7, 8, 120]] = np.nan
    prepared = prepare_logs([one], ('a',))
    (samples,) = prepared.accounts
    assert samples.total == 6 * 190
    assert samples.left_out['not finite'] == 3
    still = np.abs(one.signals.velocity) <= 3e-3
    assert samples.left_out['at rest'] == np.count_nonzero(still & np.isfinite(one.signals.force_sum))


def test_a_swept_log_gives_samples_in_ten_blocks_and_too_few_are_refused():
    prepared = prepare_logs([log((0, 10, 20), 'one', swept=True), log((0, 10, 20), 'two', swept=True)], ('a', 'b'))
    readings = prepared.readings
    assert (readings.are_samples, readings.left_out_by, prepared.breakaway) == (True, 'block', None)
    assert len(readings.groups) == 20
    sizes = [np.count_nonzero(group) for group in readings.groups]
    assert max(sizes) - min(sizes) <= 1
    assert readings.group.tolist() == sorted(readings.group)
    assert (readings.group >= 10).tolist() == (readings.source == 1).tolist()
    assert len(readings.levels) == 10
    assert list(readings.levels) == list(range(10))
    assert np.all(np.diff(readings.level_pressures) > 0.0)
    assert readings.at.pressure[:, 1] == pytest.approx(0.5 * readings.at.pressure[:, 0])
    short = log((0,), swept=True)
    with pytest.raises(ValueError, match='samples of even sliding, 200 are needed'):
        prepare_logs([short._replace(signals=short.signals.taken(np.r_[0:150, 190:340]))], ('a',))


# --- parts of it ---


def test_the_way_of_the_rod_counts_no_pause_and_no_missing_velocity():
    made = log((5, 15, 30))

    def way(**changes):
        return prepare_logs([made._replace(signals=made.signals._replace(**changes))], ('a',)).readings.travel[-1]

    time, velocity = made.signals.time.copy(), made.signals.velocity.copy()
    time[120:] += 10.0  # in the first stroke; after a pause half a second counts
    velocity[120] = np.nan
    assert way(time=time) - way() == pytest.approx(0.03 * (0.5 - 0.01))
    assert way(velocity=velocity) - way() == pytest.approx(-0.03 * 0.01)


def test_strokes_of_one_log_at_one_pressure_have_four_parts():
    one = prepare_logs([log((15,) * 4)], ('a',))
    assert one.readings.left_out_by == 'block'
    assert one.readings.group.tolist() == one.breakaway.group.tolist() == [0, 0, 1, 1, 2, 2, 3, 3]
    five = prepare_logs([log((15,) * 5)], ('a',))
    assert five.readings.group.tolist() == [0, 0, 0, 1, 1, 2, 2, 2, 3, 3]


def test_a_reading_has_the_mean_temperature_way_and_dwell_of_its_samples():
    made = log((5, 15, 30))
    kelvin = 300.0 + np.arange(len(made.signals.time))
    prepared = prepare_logs([made._replace(temperature=kelvin)], ('a',))
    middle = 190.0 * np.arange(6) + 50.0 + 20.0 + 49.5  # rest, ramp, middle of the even samples
    assert prepared.readings.temperature == pytest.approx(300.0 + middle, abs=1.5)
    stroke = 0.03 * (1.0 + 0.2)  # [m] 1 s even, two ramps of 0.2 s
    assert prepared.readings.travel == pytest.approx(stroke * (np.arange(6) + 0.5), abs=1e-3)
    assert prepared.breakaway.dwell[1:] == pytest.approx(np.full(5, 0.5), abs=0.06)
    assert prepared.breakaway.temperature == pytest.approx(300.0 + 190.0 * np.arange(6) + 49.0)
    assert len(prepared.breakaway.travel) == 0
    without = prepare_logs([made._replace(temperature=kelvin), log((5, 15, 30), 'cold')], ('a',))
    assert len(without.readings.temperature) == 0


def test_samples_are_counted_once_by_the_first_reason():
    one = log((5, 15, 30))
    prepared = prepare_logs([one], ('a',))
    speed = np.abs(one.signals.velocity)
    moving, even = speed > 3e-3, np.abs(np.gradient(one.signals.velocity, 0.01)) < 0.05
    (samples,) = prepared.accounts
    used = samples.used
    assert samples.left_out == {
        'at rest': np.count_nonzero(~moving),
        'accelerated': np.count_nonzero(moving & ~even),
    } | ({'in no even stroke': np.count_nonzero(moving & even) - used} if (moving & even).sum() > used else {})
    assert samples.total == len(speed)


def even_log(name, count, bar=20.0, warm=True):
    """Even sliding of ``count`` samples, half of them each way with two at the turn, at pressures that rise."""
    k = np.arange(count + 2)
    velocity = np.where(k < count // 2 + 1, 0.03, -0.03)
    pressure = (1.0 + bar * k / count) * BAR
    force = np.sign(velocity) * (FRICTION + pressure / BAR) + OFFSET
    signals = Signals(k / RATE, velocity, pressure, pressure, force)
    return RecordedLog(name, signals, Sliding(), 300.0 + 0.0 * k if warm else None)


def test_of_long_sweeps_every_nth_sample_is_taken_but_200_of_each():
    def readings_of(**counts):
        return prepare_logs([even_log(name, count) for name, count in counts.items()], ('a',)).readings

    readings = readings_of(long=9000, short=300)
    assert np.bincount(readings.source).tolist() == [3000, 300]  # of 9300 every third, so that it is 4000 at most
    assert readings.force[:2].tolist() == even_log('long', 9000).signals.force_sum[[0, 3]].tolist()
    assert readings.temperature.tolist() == [300.0] * 3300
    assert readings.at.direction.tolist() == np.sign(readings.at.velocity).tolist()
    assert np.bincount(readings_of(long=9000, short=599).source).tolist() == [3000, 300]  # every second: 200 at least
    assert len(prepare_logs([even_log('cold', 4000, warm=False)], ('a',)).readings.temperature) == 0
    assert readings_of(all=4000).count == 4000
    enough = readings_of(few=200)
    assert [np.count_nonzero(group) for group in enough.groups] == [20] * 10
    assert [np.count_nonzero(level) for level in enough.levels.values()] == [20] * 10
    with pytest.raises(ValueError, match='few: 199 samples of even sliding, 200 are needed'):
        readings_of(all=400, few=199)


@pytest.mark.parametrize(('longer', 'held'), [(1.4, True), (1.6, False)])
def test_a_log_is_held_where_four_fifths_of_its_even_samples_are(longer, held):
    """Six strokes of 1 s at held pressure, and one while the pressure rises by 9 bar."""
    strokes = log((5, 15, 30)).signals
    count = round(RATE * longer)
    k = np.arange(count)
    more = np.full(count, 0.03)
    rise = Signals(k, more, (30.0 + 20.0 * k / count) * BAR, 0.0 * k, FRICTION + 30.0 + 20.0 * k / count + OFFSET)
    joined = Signals(*(np.concatenate(columns) for columns in zip(strokes, rise, strict=True)))
    joined = joined._replace(time=np.arange(len(joined.time)) / RATE)
    # Six times a second and the rise: 6 of 7.4 s are 81 %, 6 of 7.6 s are 79 %.
    prepared = prepare_logs([RecordedLog('log', joined, Sliding())], ('a',))
    assert prepared.readings.are_samples is not held


def test_breakaway_of_several_files_is_left_out_by_file_and_of_one_by_its_parts():
    files = prepare_logs([log((15,) * 4, 'one'), log((15,) * 4, 'two')], ('a',))
    assert files.readings.left_out_by == 'file'
    assert files.breakaway.group.tolist() == files.breakaway.source.tolist() == [0] * 8 + [1] * 8
    assert files.breakaway.level.tolist() == [0] * 16


def test_the_dwell_of_manual_readings_is_known_if_every_sheet_has_it():
    sheet = manual([(0, 10, 20)])
    noted = sheet._replace(dwell=np.arange(6.0))
    both = prepare_manual_readings([manual([(0, 10, 20)])], [noted, noted._replace(name='other')], 1).breakaway
    assert both.dwell.tolist() == [0, 1, 2, 3, 4, 5] * 2
    assert len(prepare_manual_readings([sheet], [noted, sheet], 1).breakaway.dwell) == 0


def test_manual_breakaway_at_one_pressure_keeps_its_tests_and_at_several_those_of_the_sliding_readings():
    sliding = manual([(0, 10, 20)] * 2)
    one = prepare_manual_readings([sliding], [manual([(10, 10), (10, 10)], more=3.0)], 1).breakaway
    assert (one.left_out_by, one.group.tolist()) == ('test', [0] * 4 + [1] * 4)
    tests = prepare_manual_readings([sliding], [manual([(0, 10, 20)] * 2, more=3.0)], 1).breakaway
    assert (tests.left_out_by, tests.group.tolist()) == ('test', [0] * 6 + [1] * 6)
    by_pressure = prepare_manual_readings([manual([(0, 10, 20)])], [manual([(0, 10, 20)] * 2, more=3.0)], 1).breakaway
    assert (by_pressure.left_out_by, by_pressure.group.tolist()) == ('pressure', [0, 0, 1, 1, 2, 2] * 2)
    empty = manual([(0, 10, 20)])
    none = ManualReadings(empty.name, *(column[:0] for column in empty[1:6]))
    with pytest.raises(ValueError, match='0 readings are too few'):
        prepare_manual_readings([empty], [none], 1)


def test_both_directions_of_a_regulator_are_one_level_of_a_log():
    """20 bar on extension and 22 bar on retraction."""
    made = log((20, 40, 60))
    regulated = np.where(made.signals.force_sum - OFFSET < 0.0, 1.1, 1.0) * made.signals.pressure_a
    one = prepare_logs([made._replace(signals=made.signals._replace(pressure_a=regulated))], ('a',)).readings
    assert one.level.tolist() == [0, 0, 1, 1, 2, 2]
    assert one.level_pressures == pytest.approx(np.array([21.0, 42.0, 63.0]) * BAR)
