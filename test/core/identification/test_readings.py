"""Readings of a rig: friction, offset and weights, and data that are refused with the reason, each at its limit."""

from contextlib import nullcontext
from dataclasses import replace

import numpy as np
import pytest

from seal_friction_ros.core.identification.candidate_laws import OperatingConditions
from seal_friction_ros.core.identification.readings import (
    FrictionReadings,
    ManualReadings,
    RecordedLog,
    are_far_apart,
    check_clipping,
    check_log,
    check_manual_readings,
    check_readings,
    has_pressures,
)
from seal_friction_ros.core.identification.signal_preparation import Signals, Sliding

BAR = 1e5  # [Pa]


def held(bars, frictions, offsets=0.0, sources=1, samples=False, count=1):
    """Readings in both directions at each pressure, of each source."""
    rows = [
        (s, i, side) for s in range(sources) for i in range(len(bars)) for side in (1.0, -1.0) for _ in range(count)
    ]
    source, level, direction = np.array(rows).T
    source, level = source.astype(int), level.astype(int)
    force = direction * np.asarray(frictions, float)[level] + np.broadcast_to(offsets, len(bars))[level]
    at = OperatingConditions(np.asarray(bars, float)[level][:, np.newaxis] * BAR, 0.02 * direction, direction)
    names = tuple(f'log {s}' for s in range(sources))
    return FrictionReadings(at, force, source, level, level, names, 'pressure', samples)


def refused(reason):
    return nullcontext() if reason is None else pytest.raises(ValueError, match=reason)


# --- friction, offset, weights ---


def test_friction_and_offset_of_several_sources_are_their_mean_weighted_with_their_readings():
    one, other = held([10.0], [20.0], 4.0), held([10.0], [26.0], -2.0, count=3)
    both = FrictionReadings(
        OperatingConditions(
            np.concatenate((one.at.pressure, other.at.pressure)),
            np.concatenate((one.at.velocity, other.at.velocity)),
            np.concatenate((one.at.direction, other.at.direction)),
        ),
        np.concatenate((one.force, other.force)),
        np.repeat([0, 1], [2, 6]), np.zeros(8, int), np.zeros(8, int), ('one', 'other'), 'file', are_samples=False,
    )  # fmt: skip
    everything = np.ones(8, bool)
    assert both.half_range(everything) == pytest.approx((20.0 * 0.25 + 26.0 * 0.75, 4.0 * 0.25 - 2.0 * 0.75))
    assert both.frictions_of_sources(everything) == pytest.approx({0: 20.0, 1: 26.0})
    assert both.magnitudes(np.array([4.0, -2.0])) == pytest.approx(np.repeat([20.0, 26.0], [2, 6]))
    forward = both.taken(both.at.direction > 0.0)
    assert forward.half_range(np.ones(4, bool)) == pytest.approx((24.0, 0.0))  # one direction: all of it is friction
    assert [len(index) for index in forward.two_sided] == [0, 0]
    assert [len(index) for index in both.two_sided] == [2, 6]


def test_medians_of_the_samples_behind_the_readings_count():
    made = held([10.0], [20.0])
    samples = (np.array([19.0, 20.0, 90.0]), np.array([-90.0, -22.0, -21.0]))
    assert replace(made, samples=samples).half_range(np.ones(2, bool)) == pytest.approx((21.0, -1.0))


def test_deviations_count_as_shares_of_the_friction_at_their_pressure_and_of_the_mean_in_a_sweep():
    made = held([10.0, 20.0], [20.0, 40.0], 6.0)
    assert made.scale == pytest.approx([20.0, 20.0, 40.0, 40.0])
    (shares,) = made.shares
    assert shares == pytest.approx(np.array([4.0, 4.0, 1.0, 1.0]) / 10.0)
    swept = replace(made, are_samples=True)
    assert swept.scale == pytest.approx(np.full(4, np.abs(made.force).mean()))


def test_readings_that_are_taken_keep_all_that_is_known_of_them():
    made = held([10.0, 20.0, 30.0], [20.0, 40.0, 50.0])
    full = replace(
        made, samples=tuple(np.full(2, f) for f in made.force), travel=np.arange(6.0), dwell=10.0 + np.arange(6.0),
        temperature=300.0 + np.arange(6.0),
    )  # fmt: skip
    taken = full.taken(np.array([1, 4]))
    assert (taken.travel.tolist(), taken.dwell.tolist(), taken.temperature.tolist()) == ([1, 4], [11, 14], [301, 304])
    assert [part[0] for part in taken.samples] == taken.force.tolist() == [-20.0, 50.0]
    assert made.taken(np.array([1, 4])).samples == ()
    left = full.without(full.level == 1)
    assert (left.level.tolist(), left.group.tolist(), left.count) == ([0, 0, 1, 1], [0, 0, 1, 1], 4)
    by_file = replace(full, group=np.array([7, 7, 7, 8, 8, 8]), left_out_by='file').without(full.level == 1)
    assert by_file.group.tolist() == [7, 7, 8, 8]
    assert [(others.count, own.count) for others, own in full.splits] == [(4, 2)] * 3


# --- what shows how friction depends on pressure ---


@pytest.mark.parametrize(
    ('pressures', 'apart'),
    [([0.0, 0.51], True), ([0.0, 0.49], False), ([18.1, 20.0], False), ([17.9, 20.0], True)],
)
def test_pressures_are_apart_by_half_a_bar_and_a_tenth_of_the_highest(pressures, apart):
    assert are_far_apart(np.array(pressures) * BAR) is apart
    made = held([pressures[0], np.mean(pressures), pressures[1]], [20.0] * 3)
    assert has_pressures(made) is apart
    assert has_pressures(made.taken(made.level != 1)) is False  # two pressures are too few
    assert has_pressures(replace(made.taken(made.level != 1), are_samples=True)) is apart


@pytest.mark.parametrize(('bar', 'reason'), [(0.49, r'as without pressure: drive under pressure'), (0.51, None)])
def test_without_pressure_there_is_nothing_to_fit(bar, reason):
    with refused(reason):
        check_readings(held([bar], [20.0]))
    check_readings(held([0.45, 0.55], [20.0, 20.0]))  # the highest counts


@pytest.mark.parametrize(('scatter', 'reason'), [(0.29, None), (0.31, 'at 20 bar readings scatter by 31 %')])
def test_readings_at_one_pressure_that_scatter_by_a_third_depend_on_something_else(scatter, reason):
    made = held([20.0], [50.0], 3.0, count=2)
    force = made.force + made.at.direction * 50.0 * scatter * np.tile([1.0, -1.0], 2)
    with refused(reason):
        check_readings(replace(made, force=force))


@pytest.mark.parametrize(('negative', 'reason'), [(1, None), (2, r'friction is -3 N at 20 bar, so it would drive')])
def test_a_fifth_of_the_pressures_may_show_no_friction(negative, reason):
    frictions = [*[-3.0] * negative, *(30.0 + np.arange(5 - negative))]
    with refused(reason):
        check_readings(held([10.0, 20.0, 30.0, 40.0, 50.0], frictions))


@pytest.mark.parametrize(('share', 'reason'), [(4.9, None), (5.1, r'offset of the force sum changes by 102 N over')])
def test_an_offset_may_change_by_five_times_the_friction_over_the_pressures(share, reason):
    offsets = share * 20.0 * np.array([0.0, 0.5, 1.0])
    with refused(reason):
        check_readings(held([10.0, 20.0, 30.0], [20.0] * 3, offsets))


@pytest.mark.parametrize(
    ('frictions', 'reason'),
    [
        ([10.0, 3000.0, 7960.0], None),  # 19.9 cm2 over 40 bar
        ([10.0, 3000.0, 8050.0], 'as for a seal of 20.1 cm2: force or pressure is in a wrong unit'),
        ([0.2, 0.25, 0.305], None),  # 0.061 mm2 at 50 bar
        ([0.2, 0.25, 0.295], '0.059 mm2: force or pressure is in a wrong unit'),
    ],
)
def test_forces_and_pressures_belong_to_one_seal(frictions, reason):
    with refused(reason):
        check_readings(held([10.0, 30.0, 50.0], frictions))


@pytest.mark.parametrize(
    ('frictions', 'reason'),
    [
        ([10.0, 20.0, 25.0, 25.0], None),
        ([10.0, 25.0, 25.0, 25.0], 'exactly 25 N at 3 pressures and lower at the others'),
        ([25.0, 25.0, 25.0, 25.0], None),
    ],
)
def test_a_scale_that_stands_at_its_end_is_clipped(frictions, reason):
    with refused(reason):
        check_readings(held([10.0, 20.0, 30.0, 40.0], frictions))


# --- notes of a person ---


def notes(**changes) -> ManualReadings:
    columns = {
        'test': np.zeros(6, int), 'pressure': np.repeat([0.0, 10.0, 20.0], 2) * BAR, 'direction': np.array([1, -1] * 3),
        'friction': np.array([10.0, 10.0, 15.0, 15.0, 20.0, 20.0]), 'velocity': np.full(6, 0.02),
    }  # fmt: skip
    return ManualReadings('sheet', **columns | changes)


def at(place, value, column):
    changed = getattr(notes(), column).copy()
    changed[place] = value
    return notes(**{column: changed})


@pytest.mark.parametrize(
    ('manual', 'reason'),
    [
        (notes(), None),
        (at(2, np.nan, 'pressure'), '1 readings have no pressure'),
        (at(2, np.nan, 'friction'), '1 readings have no friction'),
        (at(2, np.nan, 'velocity'), None),
        (at(2, 0.0, 'friction'), None),
        (at(2, -0.1, 'friction'), 'friction of -0.1 N is negative'),
        (at(2, -1.19 * BAR, 'pressure'), None),
        (at(2, -1.21 * BAR, 'pressure'), r'pressure of -1.21 bar .gauge. is not between -1.2 and 450 bar'),
        (at(2, 449.0 * BAR, 'pressure'), None),
        (at(2, 451.0 * BAR, 'pressure'), r'pressure of 451 bar .gauge. is not between'),
        (at(2, 9.99, 'velocity'), None),
        (at(2, -10.0, 'velocity'), 'speed of 10 m/s is not between 0 and 10 m/s'),
        (at(2, 0.99e6, 'friction'), None),
        (at(2, 1.01e6, 'friction'), r'force of 1.01e.06 N is not between 0 and 1e.06 N'),
        (ManualReadings('sheet', *(column[:4] for column in notes()[1:6])), None),
        (ManualReadings('sheet', *(column[:3] for column in notes()[1:6])), '3 readings are too few'),
    ],
)
def test_notes_are_refused_beyond_what_a_machine_can_have_and_not_at_it(manual, reason):
    with refused(reason and f'^sheet: .*{reason}'):
        check_manual_readings(manual)


# --- logs ---


def strokes(seconds=2.0, rate=100.0, speed=0.02, back=1.0):
    """A stroke out, and a share of it back, with 0.1 s of rest."""
    n = round(seconds * rate)
    parts = [np.zeros(10), np.full(n, speed), np.zeros(10), np.full(round(back * n), -speed)]
    velocity = np.concatenate(parts)
    k = np.arange(len(velocity))
    force = 20.0 * np.sign(velocity) + 8.0 * np.sin(0.05 * k)
    return RecordedLog('log', Signals(k / rate, velocity, 5e5 + 50.0 * np.sin(k), np.zeros(len(k)), force), Sliding())


def changed(**columns):
    log = strokes()
    signals = log.signals._replace(
        **{name: change(getattr(log.signals, name).copy()) for name, change in columns.items()}
    )
    return log._replace(signals=signals)


def missing(first, count):
    def cut(values):
        values[first : first + count] = np.nan
        return values

    return cut


@pytest.mark.parametrize(
    ('log', 'reason'),
    [
        (strokes(), None),
        (strokes(rate=2.1, seconds=20.0), None),
        (strokes(rate=1.9, seconds=20.0), 's apart, too far to see starts and stops'),
        (changed(force_sum=lambda f: np.full(len(f), np.nan)), 'no force sum is a number'),
        (changed(force_sum=missing(50, 4)), None),
        (changed(force_sum=missing(50, 6)), '6 of 420 samples have no force sum'),
        (changed(velocity=lambda v: 0.1 * v), 'the rod does not move'),
        (strokes(back=0.05), None),
        (strokes(back=0.0), 'the rod moves one way only'),
        (changed(force_sum=lambda f: np.clip(f, None, 25.0)), 'force sum stays at its extreme'),
        (changed(pressure_a=lambda p: np.clip(p, None, 5e5)), 'pressure of chamber a stays at its extreme'),
        (
            changed(velocity=lambda v: v * (1.0 + 0.5 * np.sin(np.arange(len(v)) * np.pi / 4.0 + 0.4))),
            'always accelerates by more than',
        ),
        (changed(pressure_b=lambda p: p + 451.0 * BAR), 'pressure of 451 bar'),
    ],
)
def test_a_log_is_refused_with_what_is_wrong_and_not_before(log, reason):
    with refused(reason and f'^log: .*{reason}'):
        check_log(log)


@pytest.mark.parametrize(('samples', 'reason'), [(19, '19 samples are too few'), (20, 'the rod moves one way only')])
def test_a_log_has_twenty_samples(samples, reason):
    log = strokes()
    with refused(reason):
        check_log(log._replace(signals=log.signals.taken(np.arange(20, 20 + samples))))


def long_log(seconds=60.0):
    """Strokes to and fro that take long, at 100 Hz."""
    log = strokes(seconds=seconds / 2.0)
    n = len(log.signals.time)
    return log, n


@pytest.mark.parametrize(
    ('count', 'reason'), [(51, None), (52, r'52 of \d+ samples have no force sum, 0.51 s in a row')]
)
def test_a_signal_may_be_lost_for_half_a_second(count, reason):
    """From the first to the last lost sample, where they are far less than a hundredth of the log."""
    log, _ = long_log(200.0)
    force = log.signals.force_sum.copy()
    force[5000 : 5000 + count] = np.nan
    with refused(reason):
        check_log(log._replace(signals=log.signals._replace(force_sum=force)))


@pytest.mark.parametrize(('share', 'reason'), [(0.0095, None), (0.0105, 'samples have no velocity')])
def test_a_hundredth_of_a_signal_may_be_lost_here_and_there(share, reason):
    log, n = long_log()
    velocity = log.signals.velocity.copy()
    velocity[np.linspace(20, n - 20, round(share * n)).astype(int)] = np.nan
    with refused(reason):
        check_log(log._replace(signals=log.signals._replace(velocity=velocity)))


@pytest.mark.parametrize(('share', 'reason'), [(0.015, None), (0.005, 'the rod does not move: 99 % of the speeds')])
def test_a_rod_moves_where_a_hundredth_of_the_speeds_are_above_rest(share, reason):
    log, n = long_log()
    slow = np.arange(n) % 2000 >= round(share * 2000)
    velocity = np.where(slow, 0.0, np.where(np.arange(n) % 4000 < 2000, 0.02, -0.02))
    with refused(reason):
        check_log(log._replace(signals=log.signals._replace(velocity=velocity)))


@pytest.mark.parametrize(('back', 'reason'), [(0.02, None), (0.006, r'the rod moves one way only')])
def test_a_hundredth_of_the_way_has_to_be_back(back, reason):
    with refused(reason):
        check_log(strokes(seconds=30.0, back=back))


def test_a_sensor_may_stand_at_its_end_while_the_rod_rests_and_not_while_it_moves():
    log = strokes()
    force, resting = log.signals.force_sum, np.abs(log.signals.velocity) < 3e-3
    end = 0.9 * float(np.abs(force[~resting]).max())
    at_rest, in_motion = np.where(resting, 99.0, force), np.clip(force, -end, end)
    with refused(None):
        check_log(log._replace(signals=log.signals._replace(force_sum=at_rest)))
    with refused('the force sum stays at its extreme'):
        check_log(log._replace(signals=log.signals._replace(force_sum=in_motion)))


def test_a_pressure_may_stand_at_its_lowest_and_a_force_at_no_end():
    wave = 40e4 * np.maximum(np.sin(np.arange(2000) * 0.3), 0.0)
    check_clipping('log', 'pressure', wave, is_pressure=True)
    with pytest.raises(ValueError, match=r'^log: the force stays at its extreme .0 or 400000. in 50 % of the samples'):
        check_clipping('log', 'force', wave)
    with pytest.raises(ValueError, match='the pressure stays at its extreme'):
        check_clipping('log', 'pressure', 4e5 - wave, is_pressure=True)
    lost = wave.copy()
    lost[::50] = np.nan
    check_clipping('log', 'pressure', lost, is_pressure=True)
