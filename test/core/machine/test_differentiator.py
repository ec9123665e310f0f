"""Velocity from position: delay and noise are the ones stated, on quantised and uneven samples."""

import math

import numpy as np
import pytest

from seal_friction_ros.core.machine.differentiator import (
    LONGEST_DELAY,
    NO_WINDOW,
    Differentiator,
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


@pytest.mark.parametrize(
    ('samples', 'delay', 'gain', 'largest'),
    [
        (2, 0.5, math.sqrt(2.0), 1.0),  # the backward difference
        (3, 1.0, 1.0 / math.sqrt(2.0), 0.5),
        (4, 1.5, 1.0 / math.sqrt(5.0), 0.4),
    ],
)
def test_delay_noise_and_largest_error_of_a_few_samples_are_those_by_hand(samples, delay, gain, largest):
    """In units of the period T, of 1 / T, and of the step over T."""
    period, step = 0.004, 3e-6
    differentiator = Differentiator(samples, period, step)
    assert differentiator.delay == pytest.approx(delay * period)
    assert differentiator.noise_gain == pytest.approx(gain / period)
    assert differentiator.noise == pytest.approx(gain * step / math.sqrt(12.0) / period)
    assert differentiator.largest_error == pytest.approx(largest * step / period)


@pytest.mark.parametrize(('rate', 'most'), [(1000.0, 41), (500.0, 21), (1e4, 64), (20.0, 2)])
def test_the_window_is_the_shortest_with_the_noise_and_has_20_ms_delay_64_samples_or_two_at_most(rate, most):
    for samples in range(2, most + 1):
        noise = Differentiator(samples, 1.0 / rate, 1e-3).noise
        assert chosen_differentiator(1e-3, rate, 1.0001 * noise).samples == samples
    with pytest.raises(ValueError, match=f'^steps of 0.001 m at {rate:g} Hz: .* is possible'):
        chosen_differentiator(1e-3, rate, 0.9999 * noise)


@pytest.mark.parametrize(('rate', 'most'), [(1000.0, 41), (500.0, 21), (1e4, 64), (20.0, 2)])
def test_the_least_noise_that_is_possible_is_told(rate, most):
    with pytest.raises(
        ValueError, match=f'more than 64 samples; {Differentiator(most, 1.0 / rate, 1e-3).noise:.2g} m/s is possible'
    ):
        chosen_differentiator(1e-3, rate, 1e-9)


@pytest.mark.parametrize(('gap', 'velocity'), [(4_000_000, 0.25), (4_100_000, None), (0, None), (-1_000_000, None)])
def test_over_four_periods_there_is_a_velocity_and_over_more_a_new_window(gap, velocity):
    differentiator = Differentiator(2, 1e-3, 0.0)
    window, _ = differentiate(differentiator, NO_WINDOW, 7_000_000, 0.5)
    following, found = differentiate(differentiator, window, 7_000_000 + gap, 0.501)
    assert found == (None if velocity is None else pytest.approx(velocity))
    if gap == 0:
        assert following is window  # a repeated stamp is no sample
    elif velocity is None:
        assert following == ((7_000_000 + gap,), (0.501,))


def test_a_long_window_keeps_as_many_samples_as_it_fits_a_line_to():
    differentiator, window = Differentiator(3, 1e-3, 0.0), NO_WINDOW
    for i in range(9):
        window, _ = differentiate(differentiator, window, i * 1_000_000, 0.001 * i)
    assert window == ((6_000_000, 7_000_000, 8_000_000), pytest.approx((0.006, 0.007, 0.008)))
