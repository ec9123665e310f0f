"""Sensors of the simulated servo: noise, resolution, drop-outs, reproducibility."""

import itertools
import math
from statistics import fmean, stdev

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from seal_friction_ros.core.servo.sensors import Readings, SensorSettings, read

TRUTH = Readings((3e6, 1e6), 0.02, -40.0, 0.005)
NOISY = SensorSettings(
    pressure_noise=2e4, velocity_noise=1e-3, force_noise=2.0, position_noise=1e-5, drop_out=0.1, seed=7
)


def flat(readings: Readings) -> list[float | None]:
    pressure, *rest = readings
    return [*(pressure if pressure is not None else (None, None)), *rest]


@given(st.integers(0, 2**40))
def test_ideal_sensors_read_the_true_values(index):
    assert read(SensorSettings(), index, TRUTH) == TRUTH


def test_the_same_sample_reads_the_same_in_any_order_and_another_seed_reads_otherwise():
    forth = [read(NOISY, i, TRUTH) for i in range(300)]
    back = [read(NOISY, i, TRUTH) for i in reversed(range(300))][::-1]
    other = [read(SensorSettings(pressure_noise=2e4, seed=8), i, TRUTH) for i in range(300)]
    assert forth == back
    assert not {r.pressure for r in other} & {r.pressure for r in forth}


def test_noise_has_the_standard_deviation_asked_for_and_no_bias():
    rows = [flat(read(NOISY, i, TRUTH)) for i in range(20_000)]
    wanted = (2e4, 2e4, 1e-3, 2.0, 1e-5)
    for column, sigma, truth in zip(zip(*rows, strict=True), wanted, flat(TRUTH), strict=True):
        values = [value for value in column if value is not None]
        assert stdev(values) == pytest.approx(sigma, rel=0.03)
        assert fmean(values) == pytest.approx(truth, abs=5.0 * sigma / math.sqrt(len(values)))
        assert 1.0 - len(values) / len(rows) == pytest.approx(0.1, abs=0.01)


def test_noise_is_white():
    noise = [read(NOISY, i, TRUTH).velocity for i in range(5000)]
    pairs = [(a - 0.02, b - 0.02) for a, b in itertools.pairwise(noise) if a is not None and b is not None]
    assert abs(sum(a * b for a, b in pairs) / sum(a * a for a, _ in pairs)) < 0.05


def test_errors_and_losses_of_one_sensor_tell_nothing_of_another():
    rows = [flat(read(NOISY, i, TRUTH)) for i in range(10_000)]
    complete = np.array([row for row in rows if None not in row])
    together = np.corrcoef(complete.T)
    assert np.abs(together[~np.eye(5, dtype=bool)]).max() < 0.05
    lost = np.array([[value is None for value in row[1:]] for row in rows])
    assert np.array_equal(lost[:, 0], [row[0] is None for row in rows])  # both pressures are of one sensor
    for i, j in itertools.combinations(range(4), 2):
        assert np.mean(lost[:, i] & lost[:, j]) == pytest.approx(0.1 * 0.1, abs=0.005)


def test_all_samples_are_lost_none_are_and_what_is_not_there_cannot_be_read():
    nothing = Readings(None, None, None, None)
    for i in range(200):
        assert read(SensorSettings(drop_out=1.0), i, TRUTH) == nothing
        assert read(SensorSettings(), i, TRUTH) == TRUTH
    for name in Readings._fields:
        assert read(SensorSettings(), 5, TRUTH._replace(**{name: None})) == TRUTH._replace(**{name: None})


def test_resolution_rounds_to_the_nearest_step():
    coarse = SensorSettings(pressure_resolution=7e5, velocity_resolution=0.03, force_resolution=25.0)
    readings = read(coarse, 3, TRUTH)
    assert read(SensorSettings(position_resolution=0.004), 3, TRUTH).position == 0.004
    assert readings.pressure == pytest.approx((2.8e6, 7e5))
    assert (readings.velocity, readings.force_sum, readings.position) == (0.03, -50.0, 0.005)


def test_invalid_settings_are_rejected():
    with pytest.raises(ValueError, match=r'SensorSettings\.drop_out = 1\.5 1 is above its upper bound'):
        SensorSettings(drop_out=1.5)


def test_a_sample_has_the_random_numbers_of_its_place_in_a_block_of_64():
    """A recording can be made again later: numpy's generator with seed and block, five normal numbers each."""
    settings = SensorSettings(velocity_noise=1.0, position_noise=0.1, seed=7)
    for index, block, place in ((0, 0, 0), (63, 0, 63), (64, 1, 0), (200, 3, 8)):
        normal = np.random.default_rng([7, block]).standard_normal((64, 5))[place]
        reading = read(settings, index, Readings((0.0, 0.0), 0.0, 0.0, 0.0))
        assert (reading.velocity, reading.position) == (normal[2], 0.1 * normal[4])
