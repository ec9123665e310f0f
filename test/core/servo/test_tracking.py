import numpy as np
import pytest

from seal_friction_ros.core.servo.tracking import dwell_per_reversal, reversals, tracking_peak, tracking_rms


def test_dwell_counts_rest_between_opposite_motions_only():
    velocity = np.array([0, 0, 1, 1, 0, 0, 0, -1, -1, 0, -1, 1, 1, 0, 0.0])
    assert dwell_per_reversal(velocity, 0.1) == pytest.approx((3 + 0) / 2 * 0.1)
    assert reversals(velocity) == 2


def test_no_reversal_no_dwell():
    assert dwell_per_reversal(np.array([0.0, 1.0, 0.0, 1.0]), 0.1) == 0.0
    assert dwell_per_reversal(np.zeros(5), 0.1) == 0.0
    assert reversals(np.zeros(5)) == 0


def test_standstill_speed_counts_as_rest():
    velocity = np.array([1.0, 0.05, -0.05, -1.0])
    assert dwell_per_reversal(velocity, 1.0, 0.1) == 2.0
    assert reversals(velocity, 0.1) == 1


def test_rms_and_peak():
    reference, position = np.array([0.0, 0.0, 3.0, 0.0]), np.array([0.0, 4.0, 3.0, 0.0])
    assert tracking_rms(reference, position) == 2.0
    assert tracking_peak(reference, position) == 4.0
