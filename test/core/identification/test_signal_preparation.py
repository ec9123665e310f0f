"""Strokes, reversals, starts, offsets and levels of signals whose truth is known."""

from dataclasses import replace

import numpy as np
import pytest

from seal_friction_ros.core.identification.signal_preparation import (
    LONGEST_GAP,
    SavitzkyGolay,
    Signals,
    Sliding,
    breakaways,
    clipped_share,
    even_sliding,
    half_range,
    held_pressures,
    longest_stretch,
    motions,
    offset_line,
    pressure_levels,
    slope,
    strokes,
)

RATE = 100.0  # [Hz]
SLIDING = Sliding()
FRICTION, OFFSET, PRESSURE = 8.0, -3.0, 5e5  # [N], [N], [Pa]


def trapezoid(speeds, seconds=2.0, rest=0.5, peak=0.0) -> Signals:
    """A rod that rests, breaks out at ``peak`` above its friction and slides, once for each speed [m/s]."""
    velocity, force = [], []
    for speed in speeds:
        side = np.sign(speed)
        resting, ramp, even = int(rest * RATE), int(0.2 * RATE), int(seconds * RATE)
        velocity += [
            np.zeros(resting),
            np.linspace(0.0, speed, ramp),
            np.full(even, speed),
            np.linspace(speed, 0, ramp),
        ]
        force += [
            OFFSET + side * np.linspace(0.0, FRICTION + peak, resting),
            np.full(2 * ramp + even, OFFSET + side * FRICTION),
        ]
    v, f = np.concatenate(velocity), np.concatenate(force)
    n = len(v)
    return Signals(np.arange(n) / RATE, v, np.full(n, PRESSURE), np.zeros(n), f)


def test_acceleration_from_a_position_is_the_slope_of_its_slope():
    time = np.arange(500) / RATE
    law = SavitzkyGolay(window=0.2, order=2, largest_gap=0.05)
    velocity = slope(time, 0.1 + 0.02 * time + 0.03 * time**2, law)
    assert velocity == pytest.approx(0.02 + 0.06 * time, abs=1e-9)
    assert slope(time, velocity, law) == pytest.approx(np.full(500, 0.06), abs=1e-9)
    assert np.gradient(velocity, time) == pytest.approx(np.full(500, 0.06), abs=1e-9)


def test_starting_and_stopping_are_no_even_sliding():
    signals = trapezoid([0.02])
    even = even_sliding(signals, SLIDING)
    assert even.sum() == pytest.approx(2.0 * RATE, abs=3)
    assert np.abs(np.gradient(signals.velocity, signals.time))[even].max() < SLIDING.largest_acceleration


def test_every_stroke_gives_its_force_and_pressure_and_nothing_of_its_ends():
    found = strokes(trapezoid([0.02, -0.01, 0.02, -0.01]), SLIDING)
    assert [s.direction for s in found] == [1, -1, 1, -1]
    assert [s.force_sum for s in found] == pytest.approx([OFFSET + FRICTION, OFFSET - FRICTION] * 2)
    assert [s.velocity for s in found] == pytest.approx([0.02, -0.01] * 2)
    assert {s.pressure_a for s in found} == {PRESSURE}


def test_a_stroke_whose_speed_or_pressure_sweeps_is_no_reading():
    signals = trapezoid([0.02] * 2)
    ramp = np.linspace(0.005, 0.05, 400)
    swept = Signals(np.arange(400) / RATE, ramp, np.full(400, PRESSURE), np.zeros(400), np.full(400, FRICTION))
    assert not strokes(swept, SLIDING)
    rising = signals._replace(pressure_a=np.linspace(1e5, 9e5, len(signals.time)))
    assert not strokes(rising, SLIDING)


def test_a_pause_in_the_log_ends_a_stroke():
    signals = trapezoid([0.02])
    paused = signals._replace(time=signals.time + np.where(signals.time > 1.5, 2.0 * LONGEST_GAP, 0.0))
    assert len(strokes(signals, SLIDING)) == 1
    assert len(strokes(paused, SLIDING)) == 2


def even_stroke(n=400, **columns) -> Signals:
    """One stroke at an even speed, with other columns."""
    plain = {
        'time': np.arange(n) / RATE, 'velocity': np.full(n, 0.02), 'pressure_a': np.full(n, 1e6),
        'pressure_b': np.zeros(n), 'force_sum': np.full(n, FRICTION),
    }  # fmt: skip
    return Signals(**plain | columns)


@pytest.mark.parametrize(
    ('column', 'span', 'held'),
    [
        ('pressure_a', 1.05e5, True),  # of 1 MPa; nine tenths of the samples count
        ('pressure_a', 1.2e5, False),
        ('pressure_b', 1.05e5, True),  # of the pressure of the other chamber, too
        ('pressure_b', 1.2e5, False),
    ],
)
def test_pressures_are_held_within_a_tenth_of_the_higher_one(column, span, held):
    base = {'pressure_a': 1e6, 'pressure_b': 0.0}[column]
    found = strokes(even_stroke(**{column: base + span * np.linspace(-0.5, 0.5, 400)}), SLIDING)
    assert bool(found) is held


@pytest.mark.parametrize(('off', 'held'), [(0.24, True), (0.26, False)])
@pytest.mark.parametrize(('share', 'few'), [(0.49, True), (0.6, False)])
def test_a_speed_is_held_where_half_of_the_samples_are_within_a_quarter_of_it(off, held, share, few):
    velocity = np.full(400, 0.02)
    velocity[: round(0.5 * share * 400)] *= 1.0 - off
    velocity[400 - round(0.5 * share * 400) :] *= 1.0 + off
    found = strokes(even_stroke(velocity=velocity), Sliding(largest_acceleration=5.0))
    assert bool(found) is (held or few)


@pytest.mark.parametrize(('samples', 'counts'), [(9, False), (10, True)])
def test_a_stroke_has_ten_even_samples(samples, counts):
    signals = even_stroke(samples)
    assert bool(strokes(signals, SLIDING)) is counts


@pytest.mark.parametrize(('rest', 'counts'), [(0.12, True), (0.07, False)])
def test_a_rest_before_a_start_takes_a_tenth_of_a_second(rest, counts):
    found = breakaways(trapezoid([0.02, -0.02], rest=rest, peak=5.0), Sliding(slowest=1e-9))
    assert bool(found) is counts


@pytest.mark.parametrize(('pause', 'strokes_'), [(0.49, 1), (0.52, 2)])
def test_half_a_second_without_a_sample_is_a_pause(pause, strokes_):
    signals = trapezoid([0.02])
    time = signals.time + np.where(signals.time > 1.5, pause - 1.0 / RATE, 0.0)
    assert len(strokes(signals._replace(time=time), SLIDING)) == strokes_


def test_a_sample_at_the_limit_of_rest_rests_and_one_at_the_limit_of_acceleration_is_not_even():
    limit = Sliding(slowest=0.02, largest_acceleration=0.5)
    assert not even_sliding(even_stroke(), limit).any()
    assert even_sliding(even_stroke(velocity=np.full(400, 0.0201)), limit).all()
    for slope_, even in ((0.49, True), (0.51, False)):
        rising = even_stroke(velocity=0.03 + slope_ * np.arange(400) / RATE)
        assert even_sliding(rising, limit).any() == even
    lost = even_stroke(velocity=np.full(400, 0.03))
    lost.force_sum[7] = np.nan
    assert np.flatnonzero(~even_sliding(lost, limit)).tolist() == [7]


@pytest.mark.parametrize(
    ('pressures', 'levels'),
    [
        ([1e6, 1.052e6], [0, 0]),
        ([1e6, 1.054e6], [0, 1]),  # a step of a twentieth of the higher one
        ([1e4, 1.9e4], [0, 0]),
        ([1e4, 2.1e4], [0, 1]),  # a step of a tenth of a bar near zero
        ([3e6, 1e6, 2e6, 1e6], [2, 0, 1, 0]),
    ],
)
def test_a_twentieth_of_the_pressure_and_a_tenth_of_a_bar_part_two_levels(pressures, levels):
    assert pressure_levels(np.array(pressures)).tolist() == levels


def test_a_ramp_is_cut_into_parts_of_a_tenth_of_the_highest_pressure():
    ramp = np.linspace(1e6, 2e6, 1001)
    labels = pressure_levels(ramp)
    assert labels.max() == 4  # 1 MPa of 2 MPa: five parts of 0.2 MPa
    widths = [np.ptp(ramp[labels == level]) for level in range(5)]
    assert max(widths) <= 2e5
    assert max(widths) - min(widths) <= 2e3


@pytest.mark.parametrize(('other', 'one_level'), [(1.21e6, True), (1.23e6, False)])
def test_two_directions_are_one_level_within_a_fifth_of_their_mean(other, one_level):
    direction = np.tile([1.0, -1.0], 10)
    found = held_pressures(np.where(direction > 0.0, 1e6, other), direction)
    assert (len(set(found.tolist())) == 1) is one_level
    low = held_pressures(np.where(direction > 0.0, 0.0, 1.9e4), direction)
    assert set(low.tolist()) == {9.5e3}  # near zero: within a fifth of a bar
    assert len(set(held_pressures(np.where(direction > 0.0, 0.0, 2.1e4), direction).tolist())) == 2
    assert held_pressures(np.full(5, 1e6), np.ones(5)).tolist() == [1e6] * 5


def test_a_sensor_is_clipped_where_it_stays_five_samples_at_its_end_in_a_hundredth_of_them():
    wave = np.sin(np.arange(1000) * 0.9)
    for run, clipped in ((4, False), (5, True), (12, True)):
        values = wave.copy()
        for start in (100, 400, 700):
            values[start : start + run] = 2.0
        assert (clipped_share(values) > 0.0) is clipped
        if clipped:
            assert clipped_share(values) == pytest.approx(3 * run / 1000)
            assert clipped_share(-values) == pytest.approx(3 * run / 1000)
            assert clipped_share(-values, low_is_real=True) == 0.0
    assert clipped_share(np.full(200, 3.0)) == 0.0  # a signal that never changes is not assessed
    once = wave.copy()
    once[100:109] = 2.0
    assert clipped_share(once) == 0.0  # nine in a thousand
    once[100:110] = 2.0
    assert clipped_share(once) == pytest.approx(0.01)
    assert clipped_share(once[50:149]) == 0.0  # fewer than a hundred samples tell nothing
    assert clipped_share(once[50:150]) > 0.0


def test_slopes_reach_across_no_pause_and_need_a_window_of_samples():
    time = np.arange(100) / RATE
    law = SavitzkyGolay(window=0.1, order=2, largest_gap=0.05)
    broken = time + np.where(np.arange(100) >= 50, 0.06, 0.0)
    steps = np.where(np.arange(100) >= 50, 7.0, 0.0) + 2.0 * broken
    assert slope(broken, steps, law) == pytest.approx(np.full(100, 2.0), abs=1e-9)
    assert np.abs(slope(time, steps, law)).max() > 10.0  # without the pause it is a jump
    lost = 2.0 * time
    lost[30] = np.nan
    found = slope(time, lost, law)
    assert np.flatnonzero(np.isnan(found)).tolist() == [30]
    assert np.delete(found, 30) == pytest.approx(np.full(99, 2.0))
    with pytest.raises(ValueError, match=r'holds 1 samples, 0.01 s apart: order 2 needs 3'):
        slope(time, time, SavitzkyGolay(window=0.009, order=2, largest_gap=0.05))
    with pytest.raises(ValueError, match=r'is long enough for a Savitzky-Golay window of 2.0 s'):
        slope(time, time, SavitzkyGolay(window=2.0, order=2, largest_gap=0.05))
    assert slope(time[:11], time[:11], law) == pytest.approx(np.ones(11))
    with pytest.raises(ValueError, match='long enough'):
        slope(time[:10], time[:10], law)


def test_reversals_without_rest_part_the_motion():
    time = np.arange(800) / RATE
    signals = Signals(time, 0.02 * np.sign(np.sin(np.pi * time)), *(np.ones((3, 800))))
    assert [direction for direction, _ in motions(signals, SLIDING) if direction] == [1, -1] * 4


def test_noise_at_rest_that_looks_like_motion_does_not_end_the_rest():
    signals = trapezoid([0.02, -0.02], peak=5.0)
    noisy = signals.velocity.copy()
    noisy[10:50:8] = [0.004, -0.004, 0.005, -0.005, 0.004]
    noisy[290:330:7] = 0.004
    found = breakaways(signals._replace(velocity=noisy), SLIDING)
    whole = breakaways(signals, SLIDING)
    assert [start.dwell for start in found] == pytest.approx([start.dwell for start in whole], abs=0.05)
    assert [start.force_sum for start in found] == [start.force_sum for start in whole]


def test_breakaway_is_the_peak_before_the_rod_slides():
    found = breakaways(trapezoid([0.02, -0.02], peak=5.0), SLIDING)
    assert [start.direction for start in found] == [1, -1]
    assert [start.force_sum for start in found] == pytest.approx([OFFSET + FRICTION + 5.0, OFFSET - FRICTION - 5.0])


def test_a_reversal_without_a_rest_is_no_start():
    assert not breakaways(trapezoid([0.02, -0.02], rest=0.02, peak=5.0), SLIDING)


def test_half_the_difference_is_the_friction_and_half_the_sum_the_offset():
    signals = trapezoid([0.02, -0.01])
    even = even_sliding(signals, SLIDING)
    found = half_range(signals.force_sum[even], np.sign(signals.velocity[even]).astype(int))
    assert found == pytest.approx((FRICTION, OFFSET))


def test_one_direction_tells_no_friction():
    with pytest.raises(ValueError, match='one direction only'):
        half_range(np.ones(3), np.ones(3, dtype=int))


def test_offset_line_tells_a_load_cell_from_an_area():
    pressures = np.array([1e5, 3e5, 5e5, 7e5])
    found = offset_line(pressures, -1.5 + 2e-6 * pressures)
    assert found == pytest.approx((-1.5, 2e-6, 0.0), abs=1e-12)


def test_pressures_of_a_plan_are_levels_and_the_sides_of_a_regulator_are_one():
    psi = np.repeat(np.arange(0.0, 1001.0, 100.0), 2) * 6894.76
    assert list(pressure_levels(psi)) == list(np.repeat(np.arange(11), 2))
    assert list(pressure_levels(np.array([1.04e5, 0.953e5, 3.04e5, 2.94e5]))) == [0, 0, 1, 1]


def test_a_ramp_is_cut_into_levels():
    labels = pressure_levels(np.linspace(1e6, 2e6, 1001))
    assert len(np.unique(labels)) >= 5
    assert list(labels) == sorted(labels)


def test_both_directions_of_a_held_log_are_one_level():
    direction = np.tile([1.0, -1.0], 10)
    held = np.where(direction > 0.0, 0.95e5, 1.06e5)
    assert held_pressures(held, direction) == pytest.approx(np.full(20, 1.005e5))
    stepped = np.concatenate((held, held + 1e5))
    both = held_pressures(stepped, np.tile(direction, 2))
    assert len(set(pressure_levels(both))) == 2
    two = np.where(direction > 0.0, 1e5, 2e5)  # two pressures, one for each direction: not one level
    assert held_pressures(two, direction) == pytest.approx(two)


def test_a_signal_that_stands_at_its_lowest_is_clipped_unless_that_is_real():
    swinging = 4e5 * np.maximum(np.sin(np.arange(2000) / 50.0), 0.0)
    assert clipped_share(swinging) > 0.0
    assert clipped_share(swinging, low_is_real=True) == 0.0


def test_the_longest_stretch_is_found_with_its_start_and_length():
    assert longest_stretch(np.array([0, 1, 0, 1, 1, 1, 0, 1], dtype=bool)) == (3, 3)
    assert longest_stretch(np.zeros(4, dtype=bool)) == (0, 0)


def test_a_clipped_sensor_shows_and_a_coarse_or_held_one_does_not():
    noise = np.random.default_rng(1).normal(size=5000)
    wave = 10.0 * np.sin(np.arange(5000) / 200.0) + noise
    assert clipped_share(np.minimum(wave, 6.0)) > 0.1
    assert clipped_share(wave) == 0.0
    assert clipped_share(np.round(wave)) == 0.0
    assert clipped_share(np.repeat([1.0, 2.0, 3.0], 1000)) == 0.0


def test_a_slope_of_a_cubic_takes_an_order_of_three():
    time = np.arange(200) / RATE
    cubic = SavitzkyGolay(window=0.2, order=3, largest_gap=0.05)
    assert slope(time, time**3, cubic) == pytest.approx(3.0 * time**2, abs=1e-9)
    square = SavitzkyGolay(window=0.2, order=2, largest_gap=0.05)
    # A parabola through 21 samples of t^3 has the slope 3 t^2 + (sum of i^4 / sum of i^2) of the steps.
    i = np.arange(-10.0, 11.0) / RATE
    extra = np.sum(i**4) / np.sum(i**2)
    assert slope(time, time**3, square)[50] == pytest.approx(3.0 * time[50] ** 2 + extra)
    assert SavitzkyGolay(window=0.2, largest_gap=0.05).order == 2
    uneven = time + 0.3 / RATE * np.sin(np.arange(200.0))
    assert slope(uneven, 2.0 * uneven, square) == pytest.approx(np.full(200, 2.0))
    with pytest.raises(ValueError, match='order 2 needs 3'):
        slope(time, time, SavitzkyGolay(window=1e-4, order=2, largest_gap=0.05))
    assert np.isfinite(slope(time, time, SavitzkyGolay(window=0.03, order=2, largest_gap=0.05))).all()
    one_short = np.concatenate((time[:3], time[3:] + 1.0))  # three samples before a pause
    found = slope(one_short, one_short, square)
    assert np.flatnonzero(np.isnan(found)).tolist() == [0, 1, 2]
    narrow = SavitzkyGolay(window=0.022, order=2, largest_gap=0.05)
    assert np.isnan(slope(one_short, one_short, narrow)[:3]).all()  # a parabola meets three samples whatever they are
    four = np.concatenate((time[:4], time[4:] + 1.0))
    assert np.isfinite(slope(four, four, narrow)).all()


def test_a_motion_has_its_direction_its_samples_and_its_place_in_time():
    velocity = np.array([0.0, 0.0, 0.02, 0.02, np.nan, 0.02, -0.02, 0.0, 0.003, 0.02])
    time = np.arange(10) * 0.1
    found = motions(Signals(time, velocity, *np.zeros((3, 10))), SLIDING)
    assert [(side, run.tolist()) for side, run in found] == [
        (0, [0, 1]), (1, [2, 3, 5]), (-1, [6]), (0, [7, 8]), (1, [9])
    ]  # fmt: skip
    paused = np.where(np.arange(10) >= 3, time + 0.41, time)
    split = motions(Signals(paused, velocity, *np.zeros((3, 10))), SLIDING)
    assert [(side, run.tolist()) for side, run in split][1:3] == [(1, [2]), (1, [3, 5])]
    assert motions(Signals(*np.full((5, 4), np.nan)), SLIDING) == []


def test_a_peak_is_looked_for_from_the_rest_to_the_first_even_sample():
    signals = trapezoid([0.02])
    rest, ramp = 50, 20
    for place, counts in ((0, True), (rest + 3, True), (rest + ramp + 5, False)):
        force = signals.force_sum.copy()
        force[place] = 77.0
        (start,) = breakaways(signals._replace(force_sum=force), SLIDING)
        assert (start.force_sum == 77.0) is counts
        assert not counts or start.samples.tolist() == [place]
        assert start.velocity == 0.0
        assert (start.pressure_a, start.pressure_b) == (PRESSURE, 0.0)
    lost = signals.force_sum.copy()
    lost[rest - 1] = np.nan  # where the peak was
    (start,) = breakaways(signals._replace(force_sum=lost), SLIDING)
    assert start.force_sum == pytest.approx(np.nanmax(lost[: rest + ramp]))
    gone = signals._replace(pressure_b=np.where(np.arange(len(signals.time)) < rest + ramp, np.nan, 0.0))
    assert breakaways(gone, SLIDING) == []  # it is not known under which pressure
    late = signals.time + np.where(np.arange(len(signals.time)) >= rest + 3, 0.6, 0.0)
    assert breakaways(signals._replace(time=late), SLIDING) == []  # the start was not seen
    (start,) = breakaways(signals, SLIDING)
    assert start.dwell == pytest.approx(0.52)  # 50 samples, and three of the ramp up to 3 mm/s


def test_directions_with_unlike_numbers_of_levels_stay_apart():
    direction = np.tile([1.0, -1.0], 3)
    three = np.array([1e6, 1.01e6, 2e6, 2.02e6, 3e6, 2.02e6])
    assert held_pressures(three, direction).tolist() == three.tolist()
    even = np.array([1e6, 1.02e6, 2e6, 2.02e6, 2e6, 2.04e6])
    assert held_pressures(even, direction) == pytest.approx([1.01e6, 1.01e6, 2.015e6, 2.015e6, 2.015e6, 2.015e6])


def test_a_ramp_is_cut_from_a_tenth_of_the_highest_pressure_on_and_levels_are_numbered_on():
    step = np.linspace(0.0, 1.0, 11)
    narrow = np.concatenate(([1e6], 9e6 + 0.99e6 * step))
    assert pressure_levels(narrow).tolist() == [0] + [1] * 11
    wide = np.concatenate(([1e6], 9e6 + 1.02e6 * step, [12e6]))
    # The highest is 12 MPa: 1.02 MPa are less than a tenth of it.
    assert pressure_levels(wide).tolist() == [0] + [1] * 11 + [2]
    cut = np.concatenate(([1e6], 8.9e6 + 1.1e6 * step, [0.5e6]))
    assert pressure_levels(cut).tolist() == [1] + [2] * 5 + [3] * 6 + [0]
    low = 1.9e4 * step  # near zero two tenths of a bar are one level
    assert pressure_levels(low).tolist() == [0] * 11
    assert pressure_levels(np.array([5e5])).tolist() == [0]


def test_a_line_through_offsets_has_the_rms_of_what_it_leaves():
    pressures = np.array([0.0, 1e5, 2e5, 3e5])
    scatter = np.array([1.0, -1.0, -1.0, 1.0])  # no line explains any of it
    found = offset_line(pressures, 4.0 - 2e-5 * pressures + scatter)
    assert found == pytest.approx((4.0, -2e-5, 1.0))


def test_friction_is_of_medians_for_samples_and_of_means_for_readings():
    force, side = np.array([8.0, 9.0, 40.0, -4.0, -5.0, -36.0]), np.array([1, 1, 1, -1, -1, -1])
    assert half_range(force, side) == pytest.approx((7.0, 2.0))
    assert half_range(force, side, of_medians=False) == pytest.approx((17.0, 2.0))
    with pytest.raises(ValueError, match='one direction only'):
        half_range(np.ones(3), -np.ones(3, dtype=int))


@pytest.mark.parametrize(
    ('law', 'name', 'lower', 'upper'),
    [
        (SavitzkyGolay(window=1.0, largest_gap=1.0), 'window', 1e-6, 3600.0),
        (SavitzkyGolay(window=1.0, largest_gap=1.0), 'largest_gap', 1e-6, 3600.0),
        (SavitzkyGolay(window=1.0, largest_gap=1.0), 'order', 1, 6),
        (SLIDING, 'slowest', 0.0, 10.0),
        (SLIDING, 'largest_acceleration', 1e-6, 1e4),
    ],
)
def test_a_setting_is_taken_at_its_bounds_and_refused_beyond_them(law, name, lower, upper):
    for value in (lower, upper):
        assert getattr(replace(law, **{name: value}), name) == value
    for value in (lower - (1 if name == 'order' else 1e-9), upper + (1 if name == 'order' else 1e-3)):
        with pytest.raises(ValueError, match=name):
            replace(law, **{name: value})


def test_a_rod_rests_up_to_3_mm_a_second_and_slides_evenly_below_0_05_m_a_second_squared():
    assert (SLIDING.slowest, SLIDING.largest_acceleration) == (3e-3, 0.05)


@pytest.mark.parametrize('counts', [(14.4, 14.5), (60.0, 60.1, 60.2)])
def test_a_held_pressure_that_dithers_between_counts_is_not_clipped(counts):
    dither = np.random.default_rng(1).choice(counts, 5000)
    dither[1000:1100] = max(counts)
    assert clipped_share(dither) == 0.0
    assert clipped_share(np.concatenate((dither, np.linspace(20.0, 60.0, 5000)))) > 0.0
