"""The limits of a number."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from seal_friction_ros.core.foundation.limits import between

finite = st.floats(allow_nan=False)


@given(finite, finite, finite)
def test_it_is_the_middle_one_of_value_and_limits(value, one, other):
    lowest, highest = min(one, other), max(one, other)
    assert between(lowest, value, highest) == sorted((lowest, value, highest))[1]


@pytest.mark.parametrize('zero', [0.0, -0.0])
def test_a_value_at_a_limit_is_itself_to_the_bit(zero):
    for lowest, highest in ((0.0, 1.0), (-0.0, 1.0), (-1.0, 0.0), (-1.0, -0.0)):
        assert math.copysign(1.0, between(lowest, zero, highest)) == math.copysign(1.0, zero)
