import numpy as np
import pytest

from seal_friction_ros.core.servo.tracking import (
    dwell_per_reversal,
    error_area,
    reversal_rms,
    reversals,
    tracking_peak,
    tracking_rms,
)


def test_dwell_counts_rest_between_opposite_motions_only():
    velocity = np.array([0, 0, 1, 1, 0, 0, 0, -1, -1, 0, -1, 1, 1, 0, 0.0])
    assert dwell_per_reversal(velocity, 0.1) == pytest.approx((3 + 0) / 2 * 0.1)
    assert reversals(velocity) == 2


def test_without_a_reversal_there_is_no_dwell():
    assert dwell_per_reversal(np.array([0.0, 1.0, 0.0, 1.0]), 0.1) == 0.0
    assert dwell_per_reversal(np.zeros(5), 0.1) == 0.0
    assert reversals(np.zeros(5)) == 0


def test_standstill_speed_counts_as_rest():
    velocity = np.array([1.0, 0.05, -0.05, -1.0])
    assert dwell_per_reversal(velocity, 1.0, 0.1) == 2.0
    assert reversals(velocity, 0.1) == 1


def test_a_rod_exactly_at_the_standstill_speed_rests():
    velocity = np.array([1.0, 0.1, -1.0, -0.1, 0.1, -1.0])
    assert dwell_per_reversal(velocity, 1.0, 0.1) == 1.0
    assert reversals(velocity, 0.1) == 1
    assert reversals(velocity) == 3


def test_rms_and_peak_are_those_of_the_difference():
    reference, position = np.array([0.0, 0.0, 3.0, 0.0]), np.array([0.0, 4.0, 3.0, 0.0])
    assert tracking_rms(reference, position) == 2.0
    assert tracking_peak(reference, position) == 4.0


def test_error_near_reversals_counts_the_outer_tenths_alone():
    reference = 2.0 + np.sin(np.linspace(0.0, 4.0 * np.pi, 4001))
    flat = np.clip(reference, 1.3, 2.7)  # a rod that stays behind before it reverses
    middle = np.where(np.abs(reference - 2.0) < 0.79, reference + 0.5, reference)
    assert reversal_rms(reference, reference) == 0.0
    assert 0.1 < reversal_rms(reference, flat) < 0.3
    assert reversal_rms(reference, middle) == 0.0


def test_error_area_is_the_integral_of_the_error_per_reversal():
    time = np.arange(0.0, 2.0, 1e-3)
    assert error_area(np.sin(time), np.sin(time) + 0.25, 1e-3, 4) == pytest.approx(0.25 * 2.0 / 4)
    assert error_area(np.sin(time), np.sin(time) - 0.25, 1e-3, 4) == pytest.approx(0.25 * 2.0 / 4)
