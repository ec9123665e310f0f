"""Grease, roughness, flow factors, half-plane: each against its own book."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import trapezoid

from seal_friction_ros.core.lubrication.contact import StalledError, film_properties, scipy_gmres
from seal_friction_ros.core.lubrication.elasticity import condensed_body, half_plane, hat_functions
from seal_friction_ros.core.lubrication.flow_factors import (
    PEKLENIK_NUMBERS,
    flow_factor_coefficients,
    pressure_flow_factor,
    shear_flow_factor,
    shear_stress_coefficients,
    shear_stress_factors,
)
from seal_friction_ros.core.lubrication.grease import Grease, apparent_viscosity
from seal_friction_ros.core.lubrication.topography import Topography, contact_pressure
from seal_friction_studies.core.bonded_layer import bonded_layer

MODULUS = 14.28e6  # [Pa]


def test_grease_of_table_1_flows_as_palacios_says():
    rate = 1e5  # [1/s]
    stress = 530.96 + 6.7823 * rate**0.6327 + 94.779e-3 * rate
    assert apparent_viscosity(Grease().numbers, rate) == pytest.approx(stress / rate, rel=1e-6)
    assert apparent_viscosity(Grease().numbers, -rate) == apparent_viscosity(Grease().numbers, rate)


def test_grease_without_yield_and_thickener_is_newtonian():
    oil = Grease(yield_stress=0.0, consistency_index=0.0, base_viscosity=0.3)
    assert {apparent_viscosity(oil.numbers, rate) for rate in (0.0, 1.0, 1e6)} == {0.3}


def test_grease_at_rest_is_as_stiff_as_at_the_floor_of_its_shear_rate():
    assert apparent_viscosity(Grease().numbers, 0.0) == pytest.approx(
        (530.96 + 6.7823 * 100.0**0.6327) / 100.0 + 94.779e-3, rel=1e-12
    )
    assert apparent_viscosity(Grease(shear_rate_floor=30.0).numbers, -40.0) == pytest.approx(
        (530.96 + 6.7823 * 50.0**0.6327) / 50.0 + 94.779e-3, rel=1e-12
    )


@pytest.mark.parametrize('number', PEKLENIK_NUMBERS)
def test_flow_factors_tend_to_those_of_a_smooth_gap_and_have_their_slope(number):
    coefficients = flow_factor_coefficients(number)
    assert pressure_flow_factor(coefficients, 200.0)[0] == pytest.approx(1.0, abs=1e-3)
    assert shear_flow_factor(coefficients, 200.0)[0] == pytest.approx(0.0, abs=1e-12)
    assert shear_flow_factor(coefficients, 5.0)[0] == pytest.approx(
        shear_flow_factor(coefficients, 5.0 + 1e-9)[0], rel=0.02
    )
    for factor in (pressure_flow_factor, shear_flow_factor):
        for ratio in (0.3, 1.0, 3.0, 8.0):
            slope = (factor(coefficients, ratio + 1e-6)[0] - factor(coefficients, ratio - 1e-6)[0]) / 2e-6
            assert factor(coefficients, ratio)[1] == pytest.approx(slope, rel=1e-5, abs=1e-9)


def test_isotropic_flow_factors_are_those_of_patir_and_cheng():
    coefficients = flow_factor_coefficients(1.0)
    assert pressure_flow_factor(coefficients, 3.0)[0] == pytest.approx(1.0 - 0.9 * math.exp(-1.68))
    assert shear_flow_factor(coefficients, 2.0)[0] == pytest.approx(1.899 * 2.0**0.98 * math.exp(-1.84 + 0.2))


@pytest.mark.parametrize('ratio', [0.7, 1.0, 2.0, 2.9, 3.1, 5.0, 12.0, 29.0])
def test_shear_factor_is_the_mean_of_one_over_the_gap(ratio):
    """Of heights d with the density 35 / 96 (1 - (d / 3)^2)^3, as far as the gap is above 3 / 300; all over the rms."""
    heights = np.linspace(max(-3.0, 0.01 - ratio), 3.0, 400_001)
    density = 35.0 / 96.0 * (1.0 - (heights / 3.0) ** 2) ** 3
    mean = trapezoid(density / (ratio + heights), heights) * ratio
    a_3, alpha_4, alpha_5, alpha_6, *_ = coefficients = shear_stress_coefficients(1.0)
    dragged = a_3 * ratio**alpha_4 * math.exp(-alpha_5 * ratio + alpha_6 * ratio**2) if ratio <= 7.0 else 0.0
    assert shear_stress_factors(coefficients, ratio)[0] - dragged == pytest.approx(mean, rel=0.01)


@pytest.mark.parametrize('number', PEKLENIK_NUMBERS)
def test_shear_stress_factors_tend_to_one_in_thick_films(number):
    coefficients = shear_stress_coefficients(number)
    assert shear_stress_factors(coefficients, 29.9)[0] == pytest.approx(1.0, abs=2e-3)
    assert shear_stress_factors(coefficients, 30.1) == pytest.approx((1.0, 1.0), abs=1e-3)
    below, above = (shear_stress_factors(coefficients, 3.0 + x)[0] for x in (-1e-9, 1e-9))
    assert below == pytest.approx(above, rel=1e-6)


def test_roughness_that_has_no_flow_factors_is_refused():
    with pytest.raises(
        ValueError, match=r'^peklenik_number = 2.0 has no Patir-Cheng coefficients here: choose 1, 3, 6, 9'
    ):
        Topography(peklenik_number=2.0)


def test_roughness_cannot_be_flatter_than_its_longest_wave():
    with pytest.raises(ValueError, match=r'rms_slope = 0.1 is below 0.5027'):
        Topography(rms_slope=0.1)
    assert Topography(rms_slope=2.0 * math.pi * 2e-6 / 25e-6).rms_slope == pytest.approx(0.50265, rel=1e-5)


def test_roughness_of_persson_has_the_lengths_and_pressures_of_its_spectrum():
    """h_rms = 1 um, q_0 = 2 pi / 20 um, h' = 0.5, E* = 10 MPa."""
    surface = Topography(rms_height=1e-6, rms_slope=0.5, roll_off_length=20e-6)
    assert surface.separation_length == pytest.approx(0.486e-6, rel=1e-12)
    assert surface.contact_stiffness(1e7) == pytest.approx(1.1780972e6, rel=1e-7)  # 0.375 q_0 h_rms E*
    assert surface.real_area_pressure(1e7) == pytest.approx(3.5355339e6, rel=1e-7)  # E* h' / sqrt 2


def test_asperities_push_by_the_exponential_and_below_it_by_its_tangent():
    stiffness, length = 3e6, 2e-6
    for filling, less, least in ((False, 0.0, 0.0), (True, 1.0, 0.02)):
        for ratio in (1.0, 3.0):
            pressure, slope = contact_pressure(stiffness, length, filling, ratio * length)
            assert pressure == pytest.approx(stiffness / (math.exp(ratio) - less), rel=1e-12)
            assert slope == pytest.approx(-stiffness / length * math.exp(ratio) / (math.exp(ratio) - less) ** 2)
        at_least, steepest = contact_pressure(stiffness, length, filling, least * length)
        below, slope = contact_pressure(stiffness, length, filling, (least - 0.5) * length)
        assert slope == pytest.approx(steepest, rel=1e-12)
        assert below == pytest.approx(at_least - 0.5 * length * steepest, rel=1e-12)


@pytest.mark.parametrize('filling', [False, True])
def test_surfaces_far_apart_do_not_touch(filling):
    assert contact_pressure(1e6, 1e-6, filling, 0.8e-3) == (0.0, 0.0)
    assert 0.0 < contact_pressure(1e6, 1e-6, filling, 0.69e-3)[0] < 1e-290


@pytest.mark.parametrize('filling', [False, True])
def test_asperities_bear_nothing_from_700_decay_lengths_on(filling):
    assert contact_pressure(1e6, 1.0, filling, 700.0) == (0.0, 0.0)
    assert contact_pressure(1e6, 1.0, filling, 699.9)[0] > 0.0


@given(st.floats(-2e-6, 6e-6), st.booleans())
def test_asperities_push_less_the_farther_apart_and_have_their_slope(gap, filling):
    pressure, slope = contact_pressure(1e6, 1e-6, filling, gap)
    nearer, farther = (contact_pressure(1e6, 1e-6, filling, gap + away)[0] for away in (-1e-12, 1e-12))
    assert nearer > pressure > farther > 0.0
    assert slope == pytest.approx((farther - nearer) / 2e-12, rel=1e-3)


def test_roughness_that_is_filled_is_partial_contact_at_small_pressures_and_never_closed():
    light, same = (contact_pressure(1e6, 1e-6, filling, 8e-6)[0] for filling in (True, False))
    assert light == pytest.approx(same, rel=1e-3)
    assert contact_pressure(1e6, 1e-6, True, 0.1e-6)[0] > 9.0 * contact_pressure(1e6, 1e-6, False, 0.1e-6)[0]


@pytest.mark.parametrize('wall_share', [0.0, 0.5, 1.0])
def test_mobility_and_carried_height_have_their_slopes(wall_share):
    t = Topography(wall_share=wall_share)
    rough = (t.rms_height, 2.0 * wall_share - 1.0, flow_factor_coefficients(1.0))
    gap, by = np.array([0.5e-6, 2e-6, 9e-6, 30e-6]), 1e-12
    here, more, less = (film_properties(gap + d, 0.03, Grease().numbers, rough) for d in (0.0, by, -by))
    assert here[1] == pytest.approx((more[0] - less[0]) / (2.0 * by), rel=1e-4)
    assert here[3] == pytest.approx((more[2] - less[2]) / (2.0 * by), rel=1e-4)


def test_hertz_pressure_flattens_the_half_plane_into_a_parabola():
    cells, length, half_width, radius = 800, 0.6e-3, 0.15e-3, 1e-3
    plane = half_plane(cells, length / cells, MODULUS, 1e-3)
    x = (np.arange(cells) + 0.5) * length / cells - 0.5 * length
    largest = MODULUS * half_width / (2.0 * radius)
    pressure = largest * np.sqrt(np.maximum(0.0, 1.0 - (x / half_width) ** 2))
    flat = plane.deflection(pressure) + x**2 / (2.0 * radius)
    inside = np.abs(x) < 0.9 * half_width
    assert np.ptp(flat[inside]) < 1e-3 * half_width**2 / (2.0 * radius)


def test_half_plane_shallower_than_wide_is_refused():
    with pytest.raises(ValueError, match=r'depth = 0.0001 m is less than'):
        half_plane(100, 1e-5, MODULUS, 1e-4)


def test_half_plane_may_be_as_deep_as_its_film_is_wide_and_has_sixteen_cells_at_least():
    width = 2.0**-16  # [m]
    assert half_plane(16, width, MODULUS, 16.0 * width).matrix.shape == (16, 16)
    with pytest.raises(ValueError, match=r'^half_plane: cells = 15 is too few: take 16 at least$'):
        half_plane(15, width, MODULUS, 1.0)


def test_bodies_push_back_alike():
    """Reciprocity: the deflection here by a load there is that there by a load here; and no load gains energy."""
    for body in (half_plane(64, 1e-5, MODULUS, 1e-3), bonded_layer(64, 1e-5, MODULUS, 1e-3)):
        matrix = body.matrix
        assert np.array_equal(matrix, matrix.T)
        assert np.linalg.eigvalsh(matrix).min() > 0.0


def test_hat_functions_are_one_at_their_node_and_fall_to_the_next():
    values = hat_functions(np.array([0.0, 0.25, 1.0, 2.5]), np.array([0.0, 1.0, 3.0]))
    assert values == pytest.approx(np.array([[1.0, 0.0, 0.0], [0.75, 0.25, 0.0], [0.0, 1.0, 0.0], [0.0, 0.25, 0.75]]))


CIRCUMFERENCE = 20e-3  # [m]


def condensed(compliance_of, cells: int = 32, width: float = 5e-6):
    """A body whose nodes answer to a force as ``compliance_of`` their half-plane; and that half-plane.

    A force F on a node is F / (width * circumference) of pressure, shared by the cells as the hat function says.
    """
    plane = half_plane(cells, width, MODULUS, 2.0 * cells * width)
    places = (np.arange(cells) + 0.5) * width
    nodes = np.linspace(0.0, cells * width, 9)
    follows = np.linalg.pinv(hat_functions(places, nodes))
    compliance = follows @ plane.matrix @ follows.T / (CIRCUMFERENCE * width)
    return condensed_body(places, nodes, compliance_of(compliance), MODULUS, CIRCUMFERENCE), plane


def test_body_whose_nodes_give_way_as_a_half_plane_is_that_half_plane_whatever_the_mesh():
    body, plane = condensed(lambda compliance: compliance)
    assert body.matrix == pytest.approx(plane.matrix, rel=1e-9)
    pressure = 1e6 * np.sin(np.arange(32.0))
    assert body.deflection(pressure) == pytest.approx(plane.deflection(pressure), rel=1e-6)
    assert body.stiffness_band == pytest.approx(plane.stiffness_band)
    assert (body.cells, body.modulus) == (32, MODULUS)
    assert body.cell_width == pytest.approx(5e-6)


def test_body_gives_way_alike_both_ways_even_where_its_nodes_do_not():
    """Half of what is unsymmetric goes to either side, so it leaves the body as it is."""
    twist = 1e-9 * np.triu(np.ones((9, 9)), 1)  # [m/N]
    body, plane = condensed(lambda compliance: compliance + twist - twist.T)
    assert body.matrix == pytest.approx(plane.matrix, rel=1e-9)


def test_no_pressure_meets_a_stiffer_body_than_the_stiffest_half_plane():
    body, plane = condensed(lambda compliance: -compliance)
    stiffest = np.linalg.eigvalsh(plane.matrix).min()
    assert np.linalg.eigvalsh(body.matrix).min() == pytest.approx(stiffest, rel=1e-6)


def test_gmres_of_scipy_solves_and_says_when_it_cannot():
    matrix = np.diag(np.arange(1.0, 21.0)) + np.triu(np.full((20, 20), 0.1), 1)
    right = np.ones(20)
    assert matrix @ scipy_gmres(lambda x: matrix @ x, right, 1e-10, 40) == pytest.approx(right, abs=1e-10)
    with pytest.raises(StalledError, match=r'after 3 iterations'):
        scipy_gmres(lambda x: matrix @ x, right, 1e-10, 3)


def test_body_prints_as_the_numbers_it_is_made_of():
    body, _ = condensed(lambda compliance: compliance)
    assert repr(body) == f'ElasticBody(cell_width={body.cell_width}, modulus={MODULUS})'
