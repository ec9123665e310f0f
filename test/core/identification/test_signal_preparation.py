"""Strokes, reversals, starts, offsets and levels of signals whose truth is known."""

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
    is_ambient,
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


def test_reversals_without_rest_part_the_motion():
    time = np.arange(800) / RATE
    signals = Signals(time, 0.02 * np.sign(np.sin(np.pi * time)), *(np.ones((3, 800))))
    assert [direction for direction, _ in motions(signals, SLIDING) if direction] == [1, -1] * 4


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


@pytest.mark.parametrize(('ambient', 'clipped'), [(99.5e3, False), (0.2e3, False), (3e5, True)])
def test_a_vented_chamber_stands_at_the_pressure_of_the_air_and_is_not_clipped(ambient, clipped):
    swinging = ambient + 4e5 * np.maximum(np.sin(np.arange(2000) / 50.0), 0.0)
    assert is_ambient(ambient) is not clipped
    assert (clipped_share(swinging, low_is_real=is_ambient(ambient)) > 0.0) is clipped


def test_longest_stretch():
    assert longest_stretch(np.array([0, 1, 0, 1, 1, 1, 0, 1], dtype=bool)) == (3, 3)
    assert longest_stretch(np.zeros(4, dtype=bool)) == (0, 0)


def test_a_clipped_sensor_shows_and_a_coarse_or_held_one_does_not():
    noise = np.random.default_rng(1).normal(size=5000)
    wave = 10.0 * np.sin(np.arange(5000) / 200.0) + noise
    assert clipped_share(np.minimum(wave, 6.0)) > 0.1
    assert clipped_share(wave) == 0.0
    assert clipped_share(np.round(wave)) == 0.0
    assert clipped_share(np.repeat([1.0, 2.0, 3.0], 1000)) == 0.0
