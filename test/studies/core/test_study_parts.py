"""Bonded layer, groove, wall, air, motion, measuring chain: each against its own book."""

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
from seal_friction_ros.core.lubrication.elasticity import half_plane
from seal_friction_ros.core.lubrication.flow_factors import (
    flow_factor_coefficients,
)
from seal_friction_ros.core.lubrication.grease import Grease
from seal_friction_studies.core.bonded_layer import bonded_layer
from seal_friction_studies.core.groove import GrooveSpring
from seal_friction_studies.core.kinematics import ConstantAcceleration, MeasuredMotion
from seal_friction_studies.core.measuring_chain import MeasuringChain, transducer_force
from seal_friction_studies.core.wall import ControlEdge, WallFilm

MODULUS = 14.28e6  # [Pa]


def test_rough_wall_carries_more_than_a_rough_seal():
    gap = np.array([2e-6])
    carried = [
        film_properties(gap, 0.03, Grease().numbers, (2e-6, asymmetry, flow_factor_coefficients(1.0)))[2, 0]
        for asymmetry in (-1.0, 0.0, 1.0)
    ]
    assert carried[0] < carried[1] == 2e-6 < carried[2]


@pytest.mark.parametrize('wave_number', [0.5, 1.0, 2.0, 5.0])  # times the height of the layer
def test_a_bonded_layer_gives_way_to_a_wave_as_the_closed_form_says(wave_number):
    height, cells = 1e-3, 2400
    layer = bonded_layer(cells, 24.0 * height / cells, MODULUS, height)
    x = (np.arange(cells) + 0.5 - cells / 2) * layer.cell_width
    q, y = wave_number / height, wave_number
    share = (math.sinh(2 * y) - 2 * y) / (math.cosh(2 * y) + 1 + 2 * y**2)
    found = layer.deflection(1e6 * np.cos(q * x))[cells // 2]
    assert found == pytest.approx(1e6 * 2.0 * share / (MODULUS * q) * math.cos(q * x[cells // 2]), rel=5e-3)


def test_an_even_pressure_hardly_deflects_an_incompressible_layer():
    layer, plane = (
        kind(2400, 1e-5, MODULUS, 24e-3 if kind is half_plane else 1e-3) for kind in (bonded_layer, half_plane)
    )
    even = np.full(2400, 1e6)
    assert abs(layer.deflection(even)[1200]) < 1e-3 * plane.deflection(even)[1200]


def test_near_the_load_a_bonded_layer_is_a_half_plane_of_0_377_of_its_height():
    height = 0.1
    layer, plane = bonded_layer(200, 3e-6, MODULUS, height), half_plane(200, 3e-6, MODULUS, 0.377 * height)
    assert layer.matrix[0] == pytest.approx(plane.matrix[0], rel=1e-3)


def test_far_from_the_load_an_incompressible_layer_does_not_move():
    layer = bonded_layer(300, 0.1e-3, MODULUS, 1e-3)
    assert np.abs(layer.matrix[0][100:]).max() < 2e-4 * layer.matrix[0][0]  # from ten heights on


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


def test_the_film_of_a_stroke_is_laid_evenly_and_excess_film_is_pushed_ahead():
    none = np.zeros(4)
    laid = FILM.moved(none, 0.0, 0.0, -1.5e-6, 0.0, 6e-12).volume - FILM.volume
    assert laid == pytest.approx([2e-12, 4e-12, 0.0, 0.0], abs=1e-25)
    pushed = FILM.moved(np.array([0.0, 0.5, 1.0, 0.0]) * 1e-12, 1.5e-12, 1.5e-6, 0.0, 0.0, 0.0)
    assert pushed.volume == pytest.approx([1e-12, 1.5e-12, 2e-12, 5.5e-12])
    assert (pushed.start, pushed.width) == (-2e-6, 1e-6)
    assert FILM.volume == pytest.approx([1e-12, 2e-12, 3e-12, 4e-12])  # as before


@pytest.mark.parametrize(('place', 'cell'), [(-9e-6, 0), (-1.5e-6, 0), (-0.5e-6, 1), (0.5e-6, 2), (9e-6, 3)])
def test_film_that_leaves_a_seal_at_rest_stays_beside_it_or_at_the_end_of_the_wall(place, cell):
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
def test_an_invalid_measured_motion_is_refused(times, positions, words):
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
