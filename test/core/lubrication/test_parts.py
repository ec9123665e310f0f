"""Grease, roughness, flow factors, half-plane, groove, wall, motion: each against its own book."""

import dataclasses
import math
from itertools import pairwise

import numpy as np
import pytest
from harness.blow_by import ATMOSPHERE, blow_by
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import trapezoid

from seal_friction_ros.core.lubrication.contact import film_properties
from seal_friction_ros.core.lubrication.elasticity import BondedLayer, HalfPlane, condensed_body, hat_functions
from seal_friction_ros.core.lubrication.flow_factors import (
    PEKLENIK_NUMBERS,
    flow_factor_coefficients,
    pressure_flow_factor,
    shear_flow_factor,
    shear_stress_coefficients,
    shear_stress_factors,
)
from seal_friction_ros.core.lubrication.grease import Grease, apparent_viscosity
from seal_friction_ros.core.lubrication.groove import GrooveSpring
from seal_friction_ros.core.lubrication.kinematics import ConstantAcceleration, MeasuredMotion
from seal_friction_ros.core.lubrication.krylov import StalledError, gmres
from seal_friction_ros.core.lubrication.measuring_chain import MeasuringChain, transducer_force
from seal_friction_ros.core.lubrication.topography import Topography, contact_pressure
from seal_friction_ros.core.lubrication.wall import ControlEdge, WallFilm

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


def test_rough_wall_carries_more_than_a_rough_seal():
    gap = np.array([2e-6])
    carried = [
        film_properties(gap, 0.03, Grease().numbers, (2e-6, asymmetry, flow_factor_coefficients(1.0)))[2, 0]
        for asymmetry in (-1.0, 0.0, 1.0)
    ]
    assert carried[0] < carried[1] == 2e-6 < carried[2]


def test_hertz_pressure_flattens_the_half_plane_into_a_parabola():
    cells, length, half_width, radius = 800, 0.6e-3, 0.15e-3, 1e-3
    plane = HalfPlane(cells, length / cells, MODULUS, 1e-3)
    x = (np.arange(cells) + 0.5) * length / cells - 0.5 * length
    largest = MODULUS * half_width / (2.0 * radius)
    pressure = largest * np.sqrt(np.maximum(0.0, 1.0 - (x / half_width) ** 2))
    flat = plane.deflection(pressure) + x**2 / (2.0 * radius)
    inside = np.abs(x) < 0.9 * half_width
    assert np.ptp(flat[inside]) < 1e-3 * half_width**2 / (2.0 * radius)


def test_fast_deflection_is_the_product_with_the_matrix():
    plane = HalfPlane(113, 3e-6, MODULUS, 1e-3)
    pressure = np.sin(np.arange(113.0)) * 1e6
    exact = plane.matrix() @ pressure
    assert np.allclose(plane.deflection(pressure), exact, rtol=0.0, atol=1e-13 * np.abs(exact).max())


def test_half_plane_shallower_than_wide_is_refused():
    with pytest.raises(ValueError, match=r'depth = 0.0001 m is less than'):
        HalfPlane(100, 1e-5, MODULUS, 1e-4)


def test_half_plane_may_be_as_deep_as_its_film_is_wide_and_has_sixteen_cells_at_least():
    width = 2.0**-16  # [m]
    assert HalfPlane(16, width, MODULUS, 16.0 * width).influence.shape == (16,)
    with pytest.raises(ValueError, match=r'^HalfPlane.cells = 15 is too few: take 16 at least$'):
        HalfPlane(15, width, MODULUS, 1.0)


@pytest.mark.parametrize('wave_number', [0.5, 1.0, 2.0, 5.0])  # times the height of the layer
def test_a_bonded_layer_gives_way_to_a_wave_as_the_closed_form_says(wave_number):
    height, cells = 1e-3, 2400
    layer = BondedLayer(cells, 24.0 * height / cells, MODULUS, height)
    x = (np.arange(cells) + 0.5 - cells / 2) * layer.cell_width
    q, y = wave_number / height, wave_number
    share = (math.sinh(2 * y) - 2 * y) / (math.cosh(2 * y) + 1 + 2 * y**2)
    found = layer.deflection(1e6 * np.cos(q * x))[cells // 2]
    assert found == pytest.approx(1e6 * 2.0 * share / (MODULUS * q) * math.cos(q * x[cells // 2]), rel=5e-3)


def test_an_even_pressure_hardly_deflects_an_incompressible_layer():
    layer, plane = (
        kind(2400, 1e-5, MODULUS, 24e-3 if kind is HalfPlane else 1e-3) for kind in (BondedLayer, HalfPlane)
    )
    even = np.full(2400, 1e6)
    assert abs(layer.deflection(even)[1200]) < 1e-3 * plane.deflection(even)[1200]


def test_near_the_load_a_bonded_layer_is_a_half_plane_of_0_377_of_its_height():
    height = 0.1
    layer, plane = BondedLayer(200, 3e-6, MODULUS, height), HalfPlane(200, 3e-6, MODULUS, 0.377 * height)
    assert layer.influence == pytest.approx(plane.influence, rel=1e-3)


def test_far_from_the_load_an_incompressible_layer_does_not_move():
    layer = BondedLayer(300, 0.1e-3, MODULUS, 1e-3)
    assert np.abs(layer.influence[100:]).max() < 2e-4 * layer.influence[0]  # from ten heights on


def test_bodies_push_back_alike():
    """Reciprocity: the deflection here by a load there is that there by a load here; and no load gains energy."""
    for body in (HalfPlane(64, 1e-5, MODULUS, 1e-3), BondedLayer(64, 1e-5, MODULUS, 1e-3)):
        matrix = body.matrix()
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
    plane = HalfPlane(cells, width, MODULUS, 2.0 * cells * width)
    places = (np.arange(cells) + 0.5) * width
    nodes = np.linspace(0.0, cells * width, 9)
    follows = np.linalg.pinv(hat_functions(places, nodes))
    compliance = follows @ plane.matrix() @ follows.T / (CIRCUMFERENCE * width)
    return condensed_body(places, nodes, compliance_of(compliance), MODULUS, CIRCUMFERENCE), plane


def test_body_whose_nodes_give_way_as_a_half_plane_is_that_half_plane_whatever_the_mesh():
    body, plane = condensed(lambda compliance: compliance)
    assert body.matrix() == pytest.approx(plane.matrix(), rel=1e-9)
    pressure = 1e6 * np.sin(np.arange(32.0))
    assert body.deflection(pressure) == pytest.approx(plane.deflection(pressure), rel=1e-6)
    assert body.stiffness_band == pytest.approx(plane.stiffness_band)
    assert (body.cells, body.modulus) == (32, MODULUS)
    assert body.cell_width == pytest.approx(5e-6)


def test_body_gives_way_alike_both_ways_even_where_its_nodes_do_not():
    """Half of what is unsymmetric goes to either side, so it leaves the body as it is."""
    twist = 1e-9 * np.triu(np.ones((9, 9)), 1)  # [m/N]
    body, plane = condensed(lambda compliance: compliance + twist - twist.T)
    assert body.matrix() == pytest.approx(plane.matrix(), rel=1e-9)


def test_no_pressure_meets_a_stiffer_body_than_the_stiffest_half_plane():
    body, plane = condensed(lambda compliance: -compliance)
    stiffest = np.linalg.eigvalsh(plane.matrix()).min()
    assert np.linalg.eigvalsh(body.matrix()).min() == pytest.approx(stiffest, rel=1e-6)


def test_gmres_solves_and_says_when_it_cannot():
    matrix = np.diag(np.arange(1.0, 21.0)) + np.triu(np.full((20, 20), 0.1), 1)
    right = np.ones(20)
    assert matrix @ gmres(lambda x: matrix @ x, right, 1e-10, 40) == pytest.approx(right, abs=1e-10)
    with pytest.raises(StalledError, match=r'after 3 iterations'):
        gmres(lambda x: matrix @ x, right, 1e-10, 3)


def test_groove_with_clearance_has_two_seats_and_a_ridge():
    groove = GrooveSpring(stiffness=1e4, half_clearance=1e-4)
    assert [groove.force(lag) for lag in (-1e-4, 0.0, 1e-4)] == [0.0, 0.0, 0.0]
    assert groove.force(-0.5e-4) > 0.0 > groove.force(0.5e-4)
    assert groove.force(3e-4) == pytest.approx(2.0)
    for seat in (-1e-4, 1e-4):  # the springs join with their slope
        assert (groove.force(seat + 1e-9) - groove.force(seat - 1e-9)) / 2e-9 == pytest.approx(1e4, rel=1e-4)


def test_groove_without_clearance_is_a_spring():
    assert GrooveSpring(stiffness=1e4).force(-2e-4) == pytest.approx(-2.0)


GROOVE = GrooveSpring(stiffness=2e4, half_clearance=1e-4, friction_coefficient=0.15)


def groove_run(groove: GrooveSpring, lags: np.ndarray, loads: np.ndarray | float) -> tuple[np.ndarray, np.ndarray]:
    """Force and seat along ``lags`` under normal forces ``loads``, from rest at the first lag."""
    seats = [float(lags[0])]
    for lag, load in zip(lags[1:], np.broadcast_to(loads, lags.shape)[1:], strict=True):
        seats.append(groove.seat(seats[-1], lag, load))
    return np.array([groove.force(lag, seat) for lag, seat in zip(lags, seats, strict=True)]), np.array(seats)


def bottom(groove: GrooveSpring, seats: np.ndarray) -> np.ndarray:
    """Lag of the bottom of the seal [m]."""
    return seats - np.array([groove.force(seat) for seat in seats]) / groove.stiffness


def test_groove_with_friction_is_a_spring_with_a_coulomb_slider():
    """From rest on the ridge, where F = -k e / 2: the shear k, then -k s / 2 + mu N with s = e - mu N / k."""
    load, k = 1e-3, GROOVE.stiffness
    play = 0.15 * load / k
    lags = np.linspace(0.0, 4.0 * play, 401)
    force, _ = groove_run(GROOVE, lags, load)
    held = lags <= play
    assert force[held] == pytest.approx(k * lags[held], abs=1e-15)
    assert force[~held] == pytest.approx(0.15 * load - 0.5 * k * (lags[~held] - play), rel=1e-6, abs=1e-7 * load)


def test_groove_takes_its_friction_times_the_way_of_the_bottom_from_a_closed_motion():
    lags = np.concatenate([np.linspace(a, b, 40_001) for a, b in ((2e-4, -2e-4), (-2e-4, 2e-4), (2e-4, -2e-4))])
    force, seats = groove_run(GROOVE, lags, 5.0)
    loop = slice(40_001, None)
    work = trapezoid(force[loop], lags[loop])
    way = np.abs(np.diff(bottom(GROOVE, seats[loop]))).sum()
    assert work == pytest.approx(0.15 * 5.0 * way, rel=1e-6)
    assert way == pytest.approx(4e-4, rel=1e-6)  # flank to flank and back


@given(
    st.lists(st.floats(-3e-4, 3e-4), min_size=2, max_size=6),
    st.lists(st.floats(0.0, 10.0), min_size=6, max_size=6),
)
def test_groove_never_gives_energy(turns, loads):
    """Work done on it at least the rise of the stored energy, whatever motion and load."""
    lags = np.concatenate([np.linspace(a, b, 1001) for a, b in pairwise(turns)])
    force, seats = groove_run(GROOVE, lags, np.repeat(loads[: len(turns) - 1], 1001))
    k, c = GROOVE.stiffness, GROOVE.half_clearance
    ridge = k * c**2 / 8.0 * np.maximum(1.0 - (seats / c) ** 2, 0.0) ** 3
    stored = 0.5 * k * (lags - bottom(GROOVE, seats)) ** 2 + ridge
    work = (0.5 * (force[1:] + force[:-1]) * np.diff(lags)).cumsum()
    assert (work - (stored[1:] - stored[0])).min() > -1e-4 * k * c**2


@given(st.floats(-1e-3, 1e-3), st.floats(-1e-3, 1e-3), st.floats(0.0, 10.0))
def test_friction_does_nothing_in_a_groove_without_clearance(before, lag, load):
    groove = dataclasses.replace(GROOVE, half_clearance=0.0)
    assert groove.force(lag, groove.seat(before, lag, load)) == pytest.approx(groove.force(lag), abs=1e-12)


def test_control_edge_falls_by_its_depth_with_its_slope():
    edge = ControlEdge(position=0.0, slope=0.4, depth=80e-6, rounding=5e-6)
    place = np.array([-1e-3, 100e-6, 1e-3])
    fall, slope = edge.fall(place)
    assert fall == pytest.approx([0.0, 40e-6, 80e-6], abs=0.3e-6)
    assert slope == pytest.approx([0.0, 0.4, 0.0], abs=1e-3)
    beyond, _ = edge.fall(place + 1e-9)
    assert (beyond - fall) / 1e-9 == pytest.approx(slope, abs=1e-6)


def test_corners_of_the_control_edge_are_hyperbolas():
    """Half of the fall in the middle of the chamfer; half of its slope where it begins and where it ends."""
    edge = ControlEdge(position=0.3e-3, slope=0.5, depth=50e-6, rounding=20e-6)
    fall, slope = edge.fall(np.array([0.3e-3, 0.35e-3, 0.4e-3]))
    corner = 0.25 * (100e-6 + 20e-6 - math.hypot(100e-6, 20e-6))
    assert fall == pytest.approx([corner, 25e-6, 50e-6 - corner], rel=1e-9)
    steep = 0.25 * 100e-6 / math.hypot(100e-6, 20e-6)
    assert slope == pytest.approx([steep, 0.5 * 50e-6 / math.hypot(50e-6, 20e-6), steep], rel=1e-9)


def test_air_in_an_even_gap_flows_as_the_square_of_pressure_says():
    """Step by step along the gap: m R T = -p h^3 / (12 eta) dp/dx."""
    cells, width, height, pressure = 2000, 1e-7, 1e-6, 6e5
    flow = blow_by(np.full(cells, height), width, pressure, 0.3, 0.03).viscous
    squares = np.linspace((ATMOSPHERE + pressure) ** 2, ATMOSPHERE**2, cells + 1)
    inside = np.sqrt(0.5 * (squares[1:] + squares[:-1]))
    by_cell = inside / (287.05 * 293.15) * height**3 / (12.0 * 1.82e-5) * -np.diff(np.sqrt(squares)) / width
    assert by_cell == pytest.approx(flow, rel=1e-4)


def test_air_chokes_as_a_nozzle_of_iso_6358_and_only_above_its_critical_ratio():
    gap = np.full(100, 20e-6)
    wide = blow_by(gap, 1e-6, 6e5, 0.3, 0.03)
    assert wide.is_choked
    assert wide.choked == pytest.approx(0.0404 * 20e-6 * (6e5 + ATMOSPHERE) / math.sqrt(293.15), rel=1e-3)
    assert wide.reynolds_number == pytest.approx(2.0 * wide.choked / 1.82e-5)
    assert blow_by(gap, 1e-6, 0.8 * ATMOSPHERE, 0.3, 0.03).choked == math.inf
    assert not blow_by(gap, 1e-6, 0.8 * ATMOSPHERE, 0.3, 0.03).is_choked


def test_grease_is_blown_out_of_a_wide_gap_and_not_of_a_narrow_one():
    narrow, wide = (blow_by(np.full(100, h), 1e-6, 6e5, 0.3, 0.03).blow_out for h in (1e-6, 1e-5))
    assert narrow == pytest.approx(1e-12 * 6e5 / (12.0 * 0.3 * 1e-4) / 0.03)
    assert wide == pytest.approx(100.0 * narrow)


def test_film_on_the_wall_is_moved_and_never_made():
    film = WallFilm(0.0, 1e-6, np.full(100, 2e-12))
    taken = film.ahead(50e-6, 52.5e-6, 30e-6, 50e-6)
    assert taken.sum() == pytest.approx(2.5 * 2e-12)
    after = film.moved(taken, 1e-12, 52.5e-6, 30e-6, 32.5e-6, 3e-12)
    assert after.volume.sum() == pytest.approx(film.volume.sum() - 2.5 * 2e-12 + 1e-12 + 3e-12, rel=1e-14)
    assert after.volume.min() >= 0.0


FILM = WallFilm(-2e-6, 1e-6, np.array([1.0, 2.0, 3.0, 4.0]) * 1e-12)
"""Cells from -2 to 2 um."""


def test_lubricant_of_a_cell_lies_in_the_part_that_the_seal_leaves_free():
    """A seal from -1.5 to 0.5 um: half of the first and of the third cell, all of the second, none of the last."""
    seal = (-1.5e-6, 0.5e-6)
    assert FILM.ahead(0.5e-6, 1.25e-6, *seal) == pytest.approx([0.0, 0.0, 3e-12, 1e-12])
    assert FILM.ahead(0.5e-6, 0.75e-6, *seal) == pytest.approx([0.0, 0.0, 1.5e-12, 0.0])
    assert FILM.ahead(-1.75e-6, -1.5e-6, *seal) == pytest.approx([0.5e-12, 0.0, 0.0, 0.0])
    assert FILM.ahead(-9e-6, 9e-6, *seal) == pytest.approx([1e-12, 0.0, 3e-12, 4e-12])  # never more than all


def test_what_a_stroke_leaves_is_laid_evenly_and_what_does_not_fit_is_pushed_ahead():
    none = np.zeros(4)
    laid = FILM.moved(none, 0.0, 0.0, -1.5e-6, 0.0, 6e-12).volume - FILM.volume
    assert laid == pytest.approx([2e-12, 4e-12, 0.0, 0.0], abs=1e-25)
    pushed = FILM.moved(np.array([0.0, 0.5, 1.0, 0.0]) * 1e-12, 1.5e-12, 1.5e-6, 0.0, 0.0, 0.0)
    assert pushed.volume == pytest.approx([1e-12, 1.5e-12, 2e-12, 5.5e-12])
    assert (pushed.start, pushed.width) == (-2e-6, 1e-6)
    assert FILM.volume == pytest.approx([1e-12, 2e-12, 3e-12, 4e-12])  # as before


@pytest.mark.parametrize(('place', 'cell'), [(-9e-6, 0), (-1.5e-6, 0), (-0.5e-6, 1), (0.5e-6, 2), (9e-6, 3)])
def test_what_leaves_a_seal_at_rest_stays_where_it_stands_or_at_the_end_of_the_wall(place, cell):
    left = FILM.moved(np.zeros(4), 0.0, place, place, place, 2e-12).volume - FILM.volume
    assert left == pytest.approx(2e-12 * np.eye(4)[cell], abs=1e-25)


def test_constant_acceleration_is_the_motion_of_table_1():
    motion = ConstantAcceleration(cycles=2)
    assert motion.stroke_time == pytest.approx(1.8e-3 / 34e-3 + 34e-3 / 0.68)
    times = np.linspace(0.0, motion.duration, 20_001)
    position = np.array([motion.position(t) for t in times])
    velocity = np.gradient(position, times)
    assert (position.min(), position.max()) == pytest.approx((-0.9e-3, 0.9e-3))
    assert np.abs(velocity).max() == pytest.approx(34e-3, rel=1e-9)
    assert np.abs(np.gradient(velocity, times)[2:-2]).max() == pytest.approx(0.68, rel=0.01)
    assert position[0] == position[-1] == pytest.approx(-0.9e-3)


def test_motion_that_never_reaches_its_speed_is_refused():
    with pytest.raises(ValueError, match=r'speed = 0.1 m/s is not reached within distance = 0.0018 m'):
        ConstantAcceleration(speed=0.1)


def test_way_of_the_spool_is_that_of_the_laws_of_motion_about_its_centre():
    """0.1 m/s after 0.2 s and 0.01 m; then 0.06 m in 0.6 s: 1 s from end to end."""
    motion = ConstantAcceleration(distance=0.08, speed=0.1, acceleration=0.5, cycles=2, centre=0.5)
    assert (motion.stroke_time, motion.duration) == pytest.approx((1.0, 4.0))
    course = {0.1: 0.4625, 0.2: 0.47, 0.5: 0.5, 0.8: 0.53, 0.9: 0.5375, 1.0: 0.54, 1.1: 0.5375, 1.5: 0.5, 2.0: 0.46}
    course |= {2.3: 0.48, 3.3: 0.52, 4.0: 0.46, -1.0: 0.46, 9.0: 0.46}  # it stands before its start and after its end
    assert {time: motion.position(time) for time in course} == pytest.approx(course, abs=1e-12)


def test_motion_may_reach_its_speed_in_the_middle_alone():
    motion = ConstantAcceleration(distance=1.0, speed=0.5, acceleration=0.25)
    assert motion.stroke_time == 4.0
    assert (motion.position(2.0), motion.position(4.0)) == (0.0, 0.5)


def test_measured_motion_passes_through_its_samples():
    motion = MeasuredMotion([5.0, 6.0, 8.0], [0.0, 1.0, 0.0])
    assert motion.duration == 3.0
    assert [motion.position(t) for t in (0.0, 0.5, 1.0, 2.0, 9.0)] == [0.0, 0.5, 1.0, 0.5, 0.0]
    assert MeasuredMotion([0.0, 2.0], [1.0, 3.0]).position(0.5) == 1.5


@pytest.mark.parametrize(
    ('times', 'positions', 'words'),
    [
        ([0.0], [0.0], '1 times and 1 positions: give two or more'),
        ([0.0, 1.0, 2.0], [0.0, 1.0], '3 times and 2 positions: give two or more of each'),
        ([0.0, 0.0], [1.0, 2.0], 'do not increase'),
        ([0.0, 1.0], [0.0, math.nan], 'finite'),
    ],
)
def test_measured_motion_without_sense_is_refused(times, positions, words):
    with pytest.raises(ValueError, match=words):
        MeasuredMotion(times, positions)


def test_transducer_rings_at_its_frequency_and_settles_on_the_force():
    chain = MeasuringChain(natural_frequency=157.0, damping_ratio=0.02)
    time = np.arange(0.0, 1.0, 1e-4)
    friction = np.where(time < 0.1, 0.0, 1.0)
    shown = transducer_force(chain, time, friction)
    after = time > 0.1
    crossings = np.flatnonzero(np.diff(np.sign(shown[after] - 1.0)) != 0)[:20]
    assert 0.5 / (np.diff(crossings).mean() * 1e-4) == pytest.approx(157.0, rel=0.01)
    assert shown.max() == pytest.approx(1.0 + math.exp(-math.pi * 0.02), rel=0.01)
    assert shown[-1] == pytest.approx(1.0, abs=1e-6)


def test_transducer_follows_a_ramp_the_same_with_any_step():
    chain = MeasuringChain()
    fine, coarse = np.linspace(0.0, 0.1, 1001), np.linspace(0.0, 0.1, 11)
    assert transducer_force(chain, fine, 3.0 * fine)[::100] == pytest.approx(
        transducer_force(chain, coarse, 3.0 * coarse)
    )


@pytest.mark.parametrize('start', [0.0, 5.0, -5.0])
def test_transducer_starts_at_rest_under_the_first_force_whenever_that_is(start):
    """A force of 3 N shows 3 N; undamped, a ramp of 100 N/s shows the ramp less 100 N/s / w sin(w t)."""
    chain = MeasuringChain(natural_frequency=100.0, damping_ratio=0.0)
    time = start + 1e-3 * np.arange(6)  # half an oscillation lasts 5 ms
    assert transducer_force(chain, time, np.full(6, 3.0)) == pytest.approx(np.full(6, 3.0), rel=1e-12)
    ramp = transducer_force(chain, time, 3.0 + 100.0 * (time - start))
    omega_t = 2.0 * math.pi * 100.0 * (time - start)
    assert ramp == pytest.approx(3.0 + 100.0 * (time - start) - 100.0 / (200.0 * math.pi) * np.sin(omega_t), rel=1e-9)


def test_transducer_gives_one_reading_for_one_sample():
    assert transducer_force(MeasuringChain(), np.array([0.0]), np.array([2.0])).tolist() == [2.0]


def test_body_prints_as_the_numbers_it_is_made_of():
    body, _ = condensed(lambda compliance: compliance)
    assert (
        repr(HalfPlane(16, 1e-6, 1e7, 1e-3)) == 'HalfPlane(cells=16, cell_width=1e-06, modulus=10000000.0, depth=0.001)'
    )
    assert 'stiffness_band' not in repr(body)
