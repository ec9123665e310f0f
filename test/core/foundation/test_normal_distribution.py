"""The constant of the 95 % band."""

import math

import pytest

from seal_friction_ros.core.foundation.normal_distribution import BAND_95


def test_95_percent_of_a_normal_distribution_are_in_the_band():
    assert math.erf(BAND_95 / math.sqrt(2.0)) == pytest.approx(0.95, abs=1e-7)
