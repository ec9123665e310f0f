"""Normal force -> coefficient of friction."""

import math

import pytest
from harness.thesis_fit import power_law_from_points
from hypothesis import given
from hypothesis import strategies as st

from seal_friction_ros.core.friction.laws.friction_coefficient import CoefficientTable, PowerLaw

TABLE = CoefficientTable((10.0, 100.0, 400.0), (0.3, 0.15, 0.07))
forces = st.floats(1e-3, 1e6)


def test_the_power_law_gives_its_coefficient_at_one_newton():
    assert PowerLaw(2.0, 0.5).coefficient_of_friction(1.0) == 2.0


def test_the_coefficient_halves_where_the_force_grows_fourfold_at_an_exponent_of_one_half():
    law = PowerLaw(2.0, 0.5)
    assert law.coefficient_of_friction(4.0) == pytest.approx(1.0)


def test_an_exponent_of_zero_is_a_constant_coefficient():
    assert {PowerLaw(0.2, 0.0).coefficient_of_friction(force) for force in (1e-6, 1.0, 1e6)} == {0.2}


@given(st.floats(1e-3, 10.0), st.floats(0.0, 0.99), forces, forces)
def test_the_coefficient_falls_with_force_while_the_friction_rises(coefficient, exponent, a, b):
    law = PowerLaw(coefficient, exponent)
    low, high = sorted((a, b))
    mu_low, mu_high = law.coefficient_of_friction(low), law.coefficient_of_friction(high)
    assert mu_low >= mu_high * (1.0 - 1e-12)
    assert mu_low * low <= mu_high * high * (1.0 + 1e-12)


@given(st.floats(1e-2, 10.0), st.floats(0.01, 0.98))
def test_a_power_law_is_found_again_from_points_on_it(coefficient, exponent):
    law = PowerLaw(coefficient, exponent)
    normal = [4.0, 20.0, 90.0, 400.0]
    found = power_law_from_points(normal, [law.coefficient_of_friction(n) * n for n in normal])
    assert found.coefficient == pytest.approx(coefficient, rel=1e-6)
    assert found.exponent == pytest.approx(exponent, rel=1e-6)


def test_relative_deviations_count_alike_in_the_fit():
    # Twice too high and twice too low at each end cancel, though the differences in force do not.
    far = math.e**2
    found = power_law_from_points([1.0, 1.0, far, far], [2.0, 0.5, 2.0 * math.e, 0.5 * math.e])
    assert found.coefficient == pytest.approx(1.0)
    assert found.exponent == pytest.approx(0.5)


@pytest.mark.parametrize('frictions', [[0.0, 1.0], [-1.0, 1.0]])
def test_friction_that_is_not_positive_makes_no_power_law(frictions):
    with pytest.raises(ValueError):
        power_law_from_points([1.0, 2.0], frictions)


def test_friction_that_falls_with_normal_force_makes_no_power_law():
    with pytest.raises(ValueError, match=r'exponent = .* is above its upper bound 0.99'):
        power_law_from_points([1.0, 2.0], [2.0, 1.0])


def test_the_table_goes_through_its_points_and_stays_there_beyond_them():
    assert [TABLE.coefficient_of_friction(n) for n in TABLE.normal_forces] == pytest.approx(TABLE.coefficients)
    assert TABLE.coefficient_of_friction(1.0) == 0.3
    assert TABLE.coefficient_of_friction(1e6) == 0.07


@given(forces, forces)
def test_a_falling_table_falls_everywhere(a, b):
    low, high = sorted((a, b))
    assert TABLE.coefficient_of_friction(low) >= TABLE.coefficient_of_friction(high) * (1.0 - 1e-12)


@pytest.mark.parametrize(
    ('normal', 'coefficients', 'complaint'),
    [
        ((1.0, 2.0), (0.3, 0.0), '(is not above 0 everywhere|lower bound)'),
        ((1.0, 2.0), (0.3, -0.1), '(is not above 0 everywhere|lower bound)'),
        ((2.0, 1.0), (0.3, 0.2), 'do not increase'),
        ((1.0, 2.0), (0.3,), 'as many ordinates'),
        ((1.0, math.nan), (0.3, 0.2), '(not every point is|is not) finite'),
    ],
)
def test_an_invalid_table_is_refused(normal, coefficients, complaint):
    with pytest.raises(ValueError, match=f'^CoefficientTable.*{complaint}'):
        CoefficientTable(normal, coefficients)


@pytest.mark.parametrize(
    ('coefficient', 'exponent', 'complaint'),
    [
        (0.0, 0.5, 'coefficient = 0.0 1 is below its lower bound 1e-06 1'),
        (1.0, 1.0, 'exponent = 1.0 1 is above its upper bound 0.99 1'),
        (1.0, -0.1, 'exponent = -0.1 1 is below its lower bound 0.0 1'),
        (math.inf, 0.5, 'coefficient = inf 1 is not finite'),
    ],
)
def test_a_power_law_out_of_bounds_is_refused(coefficient, exponent, complaint):
    with pytest.raises(ValueError, match=f'^PowerLaw.{complaint}'):
        PowerLaw(coefficient, exponent)
