"""Velocity from position: delay and noise are the ones stated, on quantised and uneven samples."""

import math

import numpy as np
import pytest

from seal_friction_ros.core.machine.differentiator import (
    LONGEST_DELAY,
    NO_WINDOW,
    chosen_differentiator,
    differentiate,
)


def velocities(differentiator, stamps, positions):
    window, found = NO_WINDOW, []
    for stamp, position in zip(stamps, positions, strict=True):
        window, velocity = differentiate(differentiator, window, stamp, position)
        found.append(math.nan if velocity is None else velocity)
    return np.array(found)


def grid(count: int, rate: float) -> list[int]:
    return [round(i * 1e9 / rate) for i in range(count)]


@pytest.mark.parametrize(('step', 'rate'), [(1e-6, 1000.0), (5e-6, 500.0), (2e-5, 200.0)])
def test_the_noise_of_a_moving_encoder_is_the_one_stated(step, rate):
    differentiator = chosen_differentiator(step, rate, 1e-3)
    errors = []
    for speed in np.random.default_rng(7).uniform(20.0, 60.0, 200) * step * rate:  # many steps a sample
        stamps = grid(100, rate)
        rounded = np.round(speed * np.array(stamps) * 1e-9 / step) * step
        errors.append(velocities(differentiator, stamps, rounded)[differentiator.samples :] - speed)
    assert np.std(np.concatenate(errors)) == pytest.approx(differentiator.noise, rel=0.1)
    assert np.max(np.abs(np.concatenate(errors))) <= differentiator.largest_error * (1.0 + 1e-6)
    assert differentiator.noise <= 1e-3
    assert differentiator.delay <= LONGEST_DELAY


def test_the_velocity_of_a_parabola_is_that_of_the_stated_delay_ago():
    differentiator = chosen_differentiator(2e-5, 1000.0, 1e-3)
    seconds = np.array(grid(100, 1000.0)) * 1e-9
    found = velocities(differentiator, grid(100, 1000.0), 0.5 * 3.0 * seconds**2)
    assert differentiator.samples > 2
    np.testing.assert_allclose(found[50:], 3.0 * (seconds[50:] - differentiator.delay), rtol=1e-9)


def test_uneven_samples_of_an_even_motion_give_its_velocity():
    stamps = np.cumsum(np.random.default_rng(1).integers(500_000, 1_500_000, 200)).tolist()
    found = velocities(chosen_differentiator(2e-5, 1000.0, 1e-3), stamps, [0.3 + 0.2e-9 * s for s in stamps])
    np.testing.assert_allclose(found[20:], 0.2, rtol=1e-9)


def test_a_finer_noise_takes_a_longer_delay_and_one_that_is_too_fine_is_refused():
    delays = [chosen_differentiator(5e-6, 500.0, noise).delay for noise in (2e-3, 1e-3, 5e-4)]
    assert delays == sorted(delays)
    with pytest.raises(ValueError, match='is possible'):
        chosen_differentiator(1e-3, 100.0, 1e-4)


def test_a_pause_or_a_stamp_that_goes_back_never_makes_a_velocity_across_it():
    differentiator = chosen_differentiator(0.0, 1000.0, 1e-3)
    stamps = [0, 1_000_000, 500_000_000, 501_000_000, 3_000_000, 4_000_000, 4_000_000]
    found = velocities(differentiator, stamps, [0.0, 0.001, 5.0, 5.001, 9.0, 9.001, 9.5])
    np.testing.assert_allclose(found, [math.nan, 1.0, math.nan, 1.0, math.nan, 1.0, math.nan])


def test_a_position_that_is_not_finite_begins_a_new_window():
    differentiator = chosen_differentiator(0.0, 1000.0, 1e-3)
    found = velocities(differentiator, grid(4, 1000.0), [0.0, math.inf, 0.0, 0.001])
    np.testing.assert_allclose(found, [math.nan, math.nan, math.nan, 1.0])
