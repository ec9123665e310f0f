"""A hydraulic cylinder with two areas against closed forms, its own energy, and its balanced relative."""

import dataclasses
import itertools
import math

import numpy as np
import pytest

from seal_friction_ros.core.servo.controller import ServoController
from seal_friction_ros.core.servo.cylinder import Cylinder, pressure_force
from seal_friction_ros.core.servo.hydraulics import ServoValve, oil_pressures_at_rest
from seal_friction_ros.core.servo.motions import Sine
from seal_friction_ros.core.servo.plant import Load, stored_energy
from seal_friction_ros.core.servo.position_servo import ServoParameters, advance, init, outputs, simulate
from seal_friction_ros.core.servo.tracking import tracking_rms
from seal_friction_ros.files import default_configuration

SEALS = default_configuration().parameters().estimator.seals
CYLINDER = Cylinder(
    type='single_rod', bore_diameter=0.04, rod_diameter=0.022, stroke=0.3, dead_volume=5e-5, internal_leakage=0.0
)
VALVE = ServoValve(supply_pressure=1.4e7, return_pressure=0.0, rated_flow=3e-4, null_leakage=0.0)
CONTROLLER = ServoController(position_gain=2e6, velocity_gain=1e4, force_bandwidth=200.0, reference_speed_max=0.5)


def single_rod(**changes):
    parts = {'valve': VALVE, 'cylinder': CYLINDER, 'load': Load(mass=80.0), 'controller': CONTROLLER, 'seals': ()}
    return ServoParameters(**{**parts, 'control_period': 1e-3, **changes})


def test_areas_are_those_of_bore_and_rod():
    assert CYLINDER.area_a == pytest.approx(math.pi / 4 * 0.04**2)
    assert CYLINDER.area_b == pytest.approx(math.pi / 4 * (0.04**2 - 0.022**2))
    assert CYLINDER.rod_area == pytest.approx(math.pi / 4 * 0.022**2)
    balanced = dataclasses.replace(CYLINDER, type='balanced')
    assert balanced.area_a == balanced.area_b == CYLINDER.area_b
    assert balanced.rod_area == 0.0


def test_pressures_push_with_their_areas_and_vapour_is_nearly_a_bar_below_ambient():
    assert pressure_force(CYLINDER, 3e6, 5e6) == pytest.approx(3e6 * CYLINDER.area_a - 5e6 * CYLINDER.area_b)
    assert CYLINDER.vapour == 1e3 - 101325.0
    assert CYLINDER.mid_volume_a == pytest.approx(CYLINDER.area_a * 0.15 + 5e-5)
    assert CYLINDER.mid_volume_b == pytest.approx(CYLINDER.area_b * 0.15 + 5e-5)


def test_a_chamber_has_at_least_one_percent_of_the_swept_volume_at_its_stop():
    swept = CYLINDER.area_a * CYLINDER.stroke
    assert dataclasses.replace(CYLINDER, dead_volume=0.01001 * swept).dead_volume == 0.01001 * swept
    with pytest.raises(ValueError, match='1 % of the swept volume'):
        dataclasses.replace(CYLINDER, dead_volume=0.00999 * swept)


def test_unknown_type_is_rejected_with_the_known_ones():
    with pytest.raises(ValueError, match='balanced, single_rod'):
        Cylinder(type='telescopic')


@pytest.mark.parametrize('position', [0.0, 0.1, -0.12])
def test_natural_frequency_is_that_of_both_volumes(position):
    # omega^2 = beta/m (A_a^2/V_a + A_b^2/V_b)
    free = single_rod(load=Load(mass=80.0, viscous_damping=0.0))
    state = init(free, position).plant._replace(velocity=1e-3, direction=1)
    positions = []
    for _ in range(1000):
        state = advance(free, state, 0.0)
        positions.append(state.position)
    moved = np.array(positions) - np.mean(positions)
    k = np.flatnonzero((moved[:-1] < 0.0) & (moved[1:] >= 0.0))
    crossing = k + moved[k] / (moved[k] - moved[k + 1])
    measured = 2.0 * math.pi * (len(k) - 1) / ((crossing[-1] - crossing[0]) * free.control_period)
    c = free.cylinder
    volume_a, volume_b = c.mid_volume_a + c.area_a * position, c.mid_volume_b - c.area_b * position
    stiffness = c.bulk_modulus * (c.area_a**2 / volume_a + c.area_b**2 / volume_b)
    assert measured == pytest.approx(math.sqrt(stiffness / 80.0), rel=2e-3)


@pytest.mark.parametrize('spool', [0.2, -0.2])
def test_pressures_and_speed_at_even_motion_are_those_of_the_text_book(spool):
    # Both orifices, the flow ratio of the areas, no load: extending p_b = alpha^2 p_s / (1 + alpha^3), retracting
    # p_b = p_s / (1 + alpha^3), p_a = alpha p_b [Jelali2003].
    moving = single_rod(load=Load(mass=80.0, viscous_damping=0.0))
    state = init(moving, -0.1 * math.copysign(1.0, spool)).plant
    for _ in range(1500):
        state = advance(moving, state, spool)
    alpha, supply = CYLINDER.area_ratio, VALVE.supply_pressure
    p_b = (alpha**2 if spool > 0.0 else 1.0) * supply / (1.0 + alpha**3)
    assert state.charge_b == pytest.approx(p_b, rel=2e-3)
    assert state.charge_a == pytest.approx(alpha * p_b, rel=2e-3)
    drop = supply - alpha * p_b if spool > 0.0 else alpha * p_b
    speed = VALVE.orifice_gain * spool * math.sqrt(drop) / CYLINDER.area_a
    assert state.velocity == pytest.approx(speed, rel=2e-3)


def test_retraction_is_slower_than_extension_by_the_root_of_the_area_ratio():
    # v_retract / v_extend = sqrt(p_a,retract / (p_s - p_a,extend)) = sqrt(alpha), with a symmetric valve
    speeds = []
    for spool in (0.2, -0.2):
        moving = single_rod(load=Load(mass=80.0, viscous_damping=0.0))
        state = init(moving, -0.1 * math.copysign(1.0, spool)).plant
        for _ in range(1500):
            state = advance(moving, state, spool)
        speeds.append(abs(state.velocity))
    assert speeds[1] / speeds[0] == pytest.approx(math.sqrt(CYLINDER.area_ratio), rel=2e-3)


def test_resting_rod_without_load_has_the_pressure_split_of_its_areas_and_stays():
    servo = single_rod(valve=dataclasses.replace(VALVE, null_leakage=1e-13))
    state = init(servo).plant
    assert state.charge_a == pytest.approx(CYLINDER.area_ratio * state.charge_b)
    assert outputs(servo, state).force_sum == pytest.approx(0.0, abs=1e-9)
    start = state.charge_b
    for _ in range(2000):
        state = advance(servo, state, 0.0)
    assert state.charge_b == pytest.approx(start, rel=1e-3)  # the split at which the leakage of the lands is even
    assert state.charge_a == pytest.approx(CYLINDER.area_ratio * start, rel=1e-3)


def test_equal_pressures_push_the_rod_out():
    servo = single_rod()
    state = init(servo).plant._replace(charge_a=5e6, charge_b=5e6)
    assert outputs(servo, state).force_sum == pytest.approx(5e6 * CYLINDER.rod_area)


def test_energy_in_is_stored_and_dissipated():
    servo = single_rod(seals=SEALS, load=Load(mass=80.0, spring_stiffness=2e4, viscous_damping=200.0))
    start = state = init(servo).plant
    for i in range(2000):
        state = advance(servo, state, (0.1, 0.0, -0.1, 0.0)[i // 60 % 4], 100.0)
    stored = stored_energy(servo.constants, state) - stored_energy(servo.constants, start)
    assert state.energy_in > 100.0
    assert state.transitions > 10
    assert abs(state.energy_in - stored - state.energy_dissipated) < 1e-8 * state.energy_in


def test_halving_the_step_reduces_the_error_of_the_energy():
    servo = single_rod(seals=SEALS)
    errors = []
    for steps in (2, 4, 8):
        fine = dataclasses.replace(servo, control_period=5e-4, inner_step=5e-4 / steps)
        start = state = init(servo).plant
        for i in range(400):
            state = advance(fine, state, (0.1, -0.1)[i // 60 % 2])
        stored = stored_energy(servo.constants, state) - stored_energy(servo.constants, start)
        errors.append(abs(state.energy_in - stored - state.energy_dissipated) / state.energy_in)
    assert errors[0] < 1e-4
    for coarse, fine in itertools.pairwise(errors):
        assert fine < 0.25 * coarse or fine < 1e-10


def test_servo_holds_a_sine_with_both_areas_to_a_thousandth_of_the_amplitude():
    servo = single_rod(seals=SEALS, valve=dataclasses.replace(VALVE, null_leakage=6e-14))
    wave = Sine(0.03, 1.0)
    _, track = simulate(servo, init(servo), [wave.at(i * 1e-3) for i in range(4000)])
    reference = np.array([wave.at((i + 1) * 1e-3).position for i in range(4000)])
    assert tracking_rms(reference[1000:], track.position[1000:]) < 1e-3 * 0.03
    assert not track.limited.any()


def test_a_bore_is_wider_than_its_rod():
    with pytest.raises(ValueError, match='not above rod_diameter'):
        Cylinder(bore_diameter=0.02, rod_diameter=0.02)
    assert Cylinder(bore_diameter=0.0201, rod_diameter=0.02).area_a == pytest.approx(
        math.pi / 4 * 0.0201 * 2e-4, rel=0.01
    )


def test_supply_and_return_push_the_pressures_at_rest():
    """Supply 14 MPa, return 2 MPa: 8 MPa in both chambers of a balanced cylinder; single rod by the areas."""
    valve = dataclasses.replace(VALVE, return_pressure=2e6)
    balanced = dataclasses.replace(CYLINDER, type='balanced')
    assert oil_pressures_at_rest(valve, balanced) == pytest.approx((8e6, 8e6))
    a, b = oil_pressures_at_rest(valve, CYLINDER)
    alpha = CYLINDER.area_ratio
    assert a * CYLINDER.area_a == pytest.approx(b * CYLINDER.area_b)
    # The lands let 16 MPa - 2 p through their leakage, into chamber a as much as out of b per area.
    assert alpha * (16e6 - 2.0 * a) == pytest.approx(2.0 * b - 16e6)


def test_oil_keeps_its_temperature():
    servo = single_rod()
    state = init(servo).plant
    for _ in range(20):
        state = advance(servo, state, 0.2)
    assert (state.temperature_a, state.temperature_b) == (293.15, 293.15)
    assert state.velocity > 0.0
