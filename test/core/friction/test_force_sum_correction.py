"""Correction of the force sum: what it adds, and that a simulated machine measures what it takes away."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from seal_friction_ros.core.friction.force_sum_correction import (
    ForceSumCorrection,
    corrected_force_sum,
    measured_force_sum,
    one_correction,
)

corrections = st.builds(ForceSumCorrection, st.floats(-1e-2, 1e-2), st.floats(-1e-2, 1e-2), st.floats(-1e3, 1e3))
pressures = st.floats(-1e5, 3e7)


def test_the_sum_gains_area_times_pressure_of_each_chamber_and_the_offset():
    correction = ForceSumCorrection(area_a=1e-4, area_b=-2e-4, offset=5.0)
    assert corrected_force_sum(correction, 40.0, 1e6, 3e5) == pytest.approx(40.0 + 100.0 - 60.0 + 5.0)


@given(corrections, st.floats(-1e5, 1e5), pressures, pressures)
def test_a_simulated_machine_measures_what_the_correction_makes_true(correction, force, a, b):
    measured = measured_force_sum(correction, force, a, b)
    assert corrected_force_sum(correction, measured, a, b) == pytest.approx(force, abs=1e-6)


def test_seals_without_a_correction_and_seals_with_the_same_one_agree():
    one = ForceSumCorrection(1e-5)
    assert one_correction([None, None]) is None
    assert one_correction([None, one, ForceSumCorrection(1e-5), None]) == one
    with pytest.raises(ValueError, match='two seals have different force_sum_correction'):
        one_correction([one, ForceSumCorrection(2e-5)])
