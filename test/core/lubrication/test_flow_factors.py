"""Flow and stress factors of rough surfaces: the numbers that Patir and Cheng published, and where their fits join."""

import math

import pytest

from seal_friction_ros.core.lubrication.flow_factors import (
    PEKLENIK_NUMBERS,
    flow_factor_coefficients,
    pressure_flow_factor,
    shear_flow_factor,
    shear_stress_coefficients,
    shear_stress_factors,
)

# Patir and Cheng 1978, Table 2: C, r; 1979, Table 2: A_1, alpha_1, alpha_2, alpha_3, A_2
FLOW = {
    1.0: (0.90, 0.56, 1.899, 0.98, 0.92, 0.05, 1.126),
    3.0: (0.225, 1.5, 1.560, 0.85, 1.13, 0.08, 0.556),
    6.0: (0.520, 1.5, 1.290, 0.62, 1.09, 0.08, 0.388),
    9.0: (0.870, 1.5, 1.011, 0.54, 1.07, 0.08, 0.295),
}
# 1979, Tables 3 and 4: A_3, alpha_4, alpha_5, alpha_6; D, s
STRESS = {
    1.0: (11.1, 2.31, 2.38, 0.11, 1.40, 0.66),
    3.0: (9.8, 2.25, 2.80, 0.18, 0.98, 0.79),
    6.0: (10.1, 2.25, 2.90, 0.18, 0.97, 0.91),
    9.0: (8.7, 2.15, 2.97, 0.18, 0.73, 0.91),
}


@pytest.mark.parametrize('number', PEKLENIK_NUMBERS)
@pytest.mark.parametrize('ratio', [0.5, 2.0, 5.0, 5.5])
def test_flow_factors_are_those_of_the_published_tables(number, ratio):
    c, r, a_1, alpha_1, alpha_2, alpha_3, a_2 = FLOW[number]
    coefficients = flow_factor_coefficients(number)
    hindered = 1.0 - c * math.exp(-r * ratio) if number == 1.0 else 1.0 + c / ratio**r
    carried = a_1 * ratio**alpha_1 * math.exp(-alpha_2 * ratio + alpha_3 * ratio**2)
    if ratio > 5.0:
        carried = a_2 * math.exp(-0.25 * ratio)
    assert pressure_flow_factor(coefficients, ratio)[0] == pytest.approx(hindered, rel=1e-12)
    assert shear_flow_factor(coefficients, ratio)[0] == pytest.approx(carried, rel=1e-12)


@pytest.mark.parametrize('number', PEKLENIK_NUMBERS)
@pytest.mark.parametrize('ratio', [0.5, 3.0, 7.0, 7.5, 40.0])
def test_stress_factors_are_those_of_the_published_tables(number, ratio):
    """phi_f at H = 3 is 7 / 6 and at 7 and 7.5 that of its series in 1 / z^2; from H = 30 on it is 1."""
    a_3, alpha_4, alpha_5, alpha_6, d, s = STRESS[number]
    z = ratio / 3.0
    polynomial = -55.0 + 132.0 * z + 345.0 * z**2 - 160.0 * z**3 - 405.0 * z**4 + 60.0 * z**5 + 147.0 * z**6
    thin = 35.0 / 32.0 * z * ((1.0 - z**2) ** 3 * math.log(300.0 * (z + 1.0)) + polynomial / 60.0)
    even = 1.0  # mean of 1 / (1 + d / H) over the density of the heights d, term by term: moments of (1 - x^2)^3
    moment = 1.0
    for k in range(1, 60):
        moment *= (2.0 * k - 1.0) / (2.0 * k + 7.0)
        even += moment / z ** (2 * k)
    mean = {0.5: thin, 3.0: 7.0 / 6.0, 40.0: 1.0}.get(ratio, even)
    dragged = a_3 * ratio**alpha_4 * math.exp(-alpha_5 * ratio + alpha_6 * ratio**2) if ratio <= 7.0 else 0.0
    by_sliding, by_pressure = shear_stress_factors(shear_stress_coefficients(number), ratio)
    assert by_sliding == pytest.approx(mean + dragged, rel=1e-9)
    assert by_pressure == pytest.approx(1.0 - d * math.exp(-s * ratio), rel=1e-12)


def test_coefficients_carry_the_peklenik_number_before_them():
    assert [flow_factor_coefficients(number)[0] for number in (1.0, 3.0, 6.0, 9.0)] == list(PEKLENIK_NUMBERS)
