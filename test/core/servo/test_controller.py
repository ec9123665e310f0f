"""The controller against its equations, the inverse of the valve, and the linear model that judges its stability."""

import dataclasses
import math

import numpy as np
import pytest

from seal_friction_ros.core.friction.actuator import MountedSeal
from seal_friction_ros.core.servo.controller import (
    ControllerState,
    Limited,
    Measurement,
    ServoController,
    air_opening,
    control,
    gains,
    limit_reference,
    load_pressure_gains,
    oil_gains,
    oil_opening,
    spectral_radius,
    transition_matrix,
)
from seal_friction_ros.core.servo.cylinder import AMBIENT, Cylinder
from seal_friction_ros.core.servo.hydraulics import ServoValve, oil_rates
from seal_friction_ros.core.servo.motions import Setpoint
from seal_friction_ros.core.servo.plant import Load
from seal_friction_ros.core.servo.pneumatics import PneumaticValve, air_pressures_at_rest, chamber_rates
from seal_friction_ros.core.servo.position_servo import ServoParameters, ServoState, init, step
from seal_friction_ros.files import default_configuration

LOCK = tuple(
    MountedSeal(dataclasses.replace(mounted.seal, stiction=1e6), chamber)
    for mounted, chamber in zip(default_configuration().parameters().estimator.seals, 'ab', strict=True)
)
SERVO = ServoParameters(
    load=Load(mass=5.0, spring_stiffness=2e4, spring_position=1e-3, viscous_damping=20.0),
    controller=ServoController(integral_gain=1e6),
    seals=(),
)
SINGLE_ROD = Cylinder(type='single_rod', bore_diameter=0.04, rod_diameter=0.022, stroke=0.3, dead_volume=5e-5)
VALVE = ServoValve(supply_pressure=1.4e7, return_pressure=5e5, rated_flow=3e-4)
AIR = PneumaticValve(null_conductance=0.0, heat_conductance=0.0)
AIR_CYLINDER = Cylinder(type='single_rod', bore_diameter=0.032, rod_diameter=0.012, stroke=0.2, dead_volume=2e-5)


def compiled(valve, cylinder, **changes):
    parts = {
        'load': Load(mass=80.0),
        'controller': ServoController(
            position_gain=8e3, velocity_gain=150.0, force_bandwidth=100.0, reference_speed_max=0.5
        ),
        'control_period': 1e-3,
    }
    return ServoParameters(valve=valve, cylinder=cylinder, seals=(), **{**parts, **changes}).constants


# --- force command ---

REFERENCE, MEASURED = Setpoint(2e-4, 0.01, 0.5), Measurement(1.5e-4, 0.012, 3.6e6, 3.5e6)


def test_force_command_is_the_sum_of_gains_known_load_integral_and_feed_forward():
    state, command = control(SERVO.gains, SERVO.constants, ControllerState(2e-4, 2.0), MEASURED, REFERENCE, 7.0)
    integral = 2.0 + 1e6 * 5e-5 * 5e-4
    load = 5.0 * 0.5 + 20.0 * 0.01 + 2e4 * (2e-4 - 1e-3)
    assert state == pytest.approx((2e-4, integral))
    assert command.force == pytest.approx(1e5 * 5e-5 + 300.0 * (0.01 - 0.012) + integral + load + 7.0)
    delay = 2.0 * 0.8 / 1257.0 + 0.5 * 5e-4  # of spool and sampling
    speed = 0.8 * 0.012 + 0.2 * 0.01 + delay * 0.5
    c = SERVO.constants
    assert command.spool == pytest.approx(oil_opening(c.valve, c.cylinder, 500.0, MEASURED, command.force, speed))
    assert command.limited == 0


@pytest.mark.parametrize(('force', 'velocity'), [(1e9, 0.0), (-1e9, 0.0), (0.0, 9.0), (0.0, -9.0)])
def test_an_integrator_stops_while_force_or_spool_is_at_its_limit(force, velocity):
    fast = MEASURED._replace(velocity=velocity)
    state, command = control(SERVO.gains, SERVO.constants, ControllerState(2e-4, 2.0), fast, REFERENCE, force)
    assert state.integral == 2.0
    assert command.limited & (Limited.SPOOL if velocity else Limited.FORCE)
    assert abs(command.spool) <= 1.0


def test_the_largest_forces_are_supply_on_one_side_and_return_on_the_other():
    c = compiled(VALVE, SINGLE_ROD)
    g = gains(ServoController(stop_distance=0.01), c, 1e-3)
    assert g.extending_force_max == pytest.approx(SINGLE_ROD.area_a * 1.4e7 - SINGLE_ROD.area_b * 5e5)
    assert g.retracting_force_max == pytest.approx(SINGLE_ROD.area_b * 1.4e7 - SINGLE_ROD.area_a * 5e5)
    assert g.reach == pytest.approx(0.14)
    assert gains(ServoController(stop_distance=0.2), c, 1e-3).reach == 0.0


# --- limits of the reference ---

REACH, WAY = SERVO.gains.reach, 0.2 * 5e-4  # [m] short of the stops; at the largest speed in one sample


@pytest.mark.parametrize('side', [1.0, -1.0])
@pytest.mark.parametrize(
    ('last', 'wish', 'followed', 'flag'),
    [
        (REACH, Setpoint(REACH, 0.1, 1.0), None, 0),
        (0.0, Setpoint(0.0, 0.2, 50.0), None, 0),
        (0.0, Setpoint(WAY, 0.2, 0.0), None, 0),
        (0.0, Setpoint(0.0, 0.1, 60.0), Setpoint(0.0, 0.1, 50.0), Limited.REFERENCE_TOO_FAST),
        (0.0, Setpoint(0.0, 0.3, 5.0), Setpoint(0.0, 0.2, 5.0), Limited.REFERENCE_TOO_FAST),
        (REACH, Setpoint(REACH + 1e-9, 0.1, 1.0), Setpoint(REACH, 0.0, 0.0), Limited.REFERENCE_OUT_OF_STROKE),
        (0.0, Setpoint(1.0001 * WAY, 0.1, 1.0), Setpoint(WAY, 0.2, 0.0), Limited.REFERENCE_TOO_FAST),
        (0.0, Setpoint(0.0, 0.1, math.nan), Setpoint(0.0, 0.0, 0.0), Limited.REFERENCE_NOT_FINITE),
    ],
)
def test_a_reference_at_a_limit_is_followed_and_one_beyond_is_not(side, last, wish, followed, flag):
    there = Setpoint(*(side * value for value in wish))
    reference, limited = limit_reference(SERVO.gains, side * last, there)
    assert reference == pytest.approx([side * value for value in followed or wish])
    assert limited == flag


# --- opening of the valve ---


@pytest.mark.parametrize('cylinder', [SINGLE_ROD, dataclasses.replace(SINGLE_ROD, type='balanced')])
@pytest.mark.parametrize(('direction', 'drop'), [(1, 6e6), (1, 2e6), (-1, 6e6), (-1, 2e6)])
def test_oil_at_even_speed_needs_the_opening_of_both_orifices_with_any_load(cylinder, direction, drop):
    """Q_a = K s sqrt(drop of its land), Q_b = alpha Q_a: the drop of the other land is alpha^2 times as large."""
    c = compiled(VALVE, cylinder)
    alpha, spool = cylinder.area_ratio, 0.3 * direction
    supplied, drained = VALVE.supply_pressure - drop, VALVE.return_pressure + alpha**2 * drop
    if direction < 0:
        supplied, drained = VALVE.supply_pressure - alpha**2 * drop, VALVE.return_pressure + drop
    a, b = (supplied, drained) if direction > 0 else (drained, supplied)
    speed = VALVE.orifice_gain * spool * math.sqrt(drop) / cylinder.area_a
    force = cylinder.area_a * (a - alpha * b)
    found = oil_opening(c.valve, c.cylinder, 500.0, Measurement(0.0, speed, a, b), force, speed)
    assert found == pytest.approx(spool, rel=1e-9)


@pytest.mark.parametrize('cylinder', [SINGLE_ROD, dataclasses.replace(SINGLE_ROD, type='balanced')])
@pytest.mark.parametrize('force', [3000.0, -2000.0])
def test_at_standstill_the_load_pressure_of_oil_follows_the_force_with_the_bandwidth(cylinder, force):
    c, alpha = compiled(VALVE, cylinder), cylinder.area_ratio
    a = b = 5e6
    load_pressure = a - alpha * b
    spool = oil_opening(c.valve, c.cylinder, 200.0, Measurement(0.0, 0.0, a, b), force, 0.0)
    if spool > 0.0:
        drop = VALVE.supply_pressure - alpha * VALVE.return_pressure - load_pressure
    else:
        drop = alpha * VALVE.supply_pressure - VALVE.return_pressure + load_pressure
    flow = VALVE.orifice_gain * spool * math.sqrt(drop / (1.0 + alpha**3))
    rate = cylinder.bulk_modulus * flow * (1.0 / cylinder.mid_volume_a + alpha**2 / cylinder.mid_volume_b)
    assert rate == pytest.approx(200.0 * (force / cylinder.area_a - load_pressure))


def test_an_orifice_without_pressure_drop_is_not_asked_for_an_infinite_opening():
    c = compiled(VALVE, SINGLE_ROD)
    full = Measurement(0.0, 0.0, VALVE.supply_pressure, 0.0)
    found = oil_opening(c.valve, c.cylinder, 200.0, full, 0.0, 1.0)
    flow = SINGLE_ROD.area_a * 1.0 - 200.0 * SINGLE_ROD.mid_volume_a * VALVE.supply_pressure / (
        (1.0 + SINGLE_ROD.area_ratio**2 * SINGLE_ROD.mid_volume_a / SINGLE_ROD.mid_volume_b) * SINGLE_ROD.bulk_modulus
    )
    share = 1.0 + SINGLE_ROD.area_ratio**3
    assert flow > 0.0
    assert found == pytest.approx(flow / (VALVE.orifice_gain * math.sqrt(2.0 * 3e5 / share)))


@pytest.mark.parametrize('cylinder', [AIR_CYLINDER, dataclasses.replace(AIR_CYLINDER, type='balanced')])
@pytest.mark.parametrize('force', [150.0, -100.0])
@pytest.mark.parametrize(('position', 'speed'), [(0.0, 0.0), (0.04, 0.3), (-0.05, -0.2)])
def test_the_load_pressure_of_air_has_the_wanted_rate_at_once(cylinder, force, position, speed):
    c = compiled(AIR, cylinder, load=Load(mass=3.0))
    a, b = 3e5, 3.3e5
    spool = air_opening(c.valve, c.cylinder, 20.0, Measurement(position, speed, a, b), force, speed)
    to_a, to_b = max(spool, 0.0), max(-spool, 0.0)
    volume_a = cylinder.mid_volume_a + cylinder.area_a * position
    volume_b = cylinder.mid_volume_b - cylinder.area_b * position
    rate_a = chamber_rates(c.valve, to_a, to_b, a, AIR.temperature, volume_a, cylinder.area_a * speed)[0]
    rate_b = chamber_rates(c.valve, to_b, to_a, b, AIR.temperature, volume_b, -cylinder.area_b * speed)[0]
    wanted = 20.0 * (force / cylinder.area_a - (a - cylinder.area_ratio * b))
    by_valve = wanted + 1.4 * speed * (
        (a + AMBIENT) * cylinder.area_a / volume_a + cylinder.area_ratio * (b + AMBIENT) * cylinder.area_b / volume_b
    )
    # The normal atmosphere of ISO 6358 has 0.3 % less pressure than the density of air gives it.
    assert rate_a - cylinder.area_ratio * rate_b == pytest.approx(wanted, abs=4e-3 * abs(by_valve))


def test_a_full_chamber_of_air_counts_as_a_tenth_of_the_supply():
    c = compiled(AIR, AIR_CYLINDER, load=Load(mass=3.0))
    full = Measurement(0.0, 0.0, 6e5, -0.99 * AMBIENT)
    found = air_opening(c.valve, c.cylinder, 20.0, full, 1000.0, 0.0)
    wanted = 20.0 * (1000.0 / AIR_CYLINDER.area_a - 6e5 - AIR_CYLINDER.area_ratio * 0.99 * AMBIENT)
    least = 0.1 * (6e5 + AMBIENT)
    by_volume = least / AIR_CYLINDER.mid_volume_a + AIR_CYLINDER.area_ratio * least / AIR_CYLINDER.mid_volume_b
    assert found == pytest.approx(wanted / (1.4 * 1e5 * AIR.sonic_conductance * by_volume), rel=1e-3)


@pytest.mark.parametrize(('force', 'pressures'), [(1000.0, (8e5, -0.5 * AMBIENT)), (-1000.0, (-0.5 * AMBIENT, 8e5))])
def test_a_chamber_fuller_than_its_source_counts_as_a_tenth_of_the_supply_too(force, pressures):
    """Whether the rod extends or retracts: no air comes from the supply, none goes to the exhaust."""
    c = compiled(AIR, AIR_CYLINDER, load=Load(mass=3.0))
    found = air_opening(c.valve, c.cylinder, 20.0, Measurement(0.0, 0.0, *pressures), 20.0 * force, 0.0)
    load_pressure = pressures[0] - AIR_CYLINDER.area_ratio * pressures[1]
    wanted = 20.0 * (20.0 * force / AIR_CYLINDER.area_a - load_pressure)
    least = 0.1 * (6e5 + AMBIENT)
    by_volume = least / AIR_CYLINDER.mid_volume_a + AIR_CYLINDER.area_ratio * least / AIR_CYLINDER.mid_volume_b
    assert wanted * force > 0.0
    assert found == pytest.approx(wanted / (1.4 * 1e5 * AIR.sonic_conductance * by_volume))


# --- linear model ---

OIL_AXIS = {
    'cylinder': Cylinder(internal_leakage=1e-13),
    'load': Load(mass=5.0, spring_stiffness=2e4, viscous_damping=200.0),
    'controller': ServoController(integral_gain=1e6),
}
AIR_AXIS = {
    'valve': AIR,
    'cylinder': dataclasses.replace(AIR_CYLINDER, type='balanced'),
    'load': Load(mass=3.0, viscous_damping=20.0),
    'controller': ServoController(position_gain=8e3, velocity_gain=150.0, force_bandwidth=100.0),
    'control_period': 1e-3,
}


@pytest.mark.parametrize('parts', [OIL_AXIS, pytest.param(AIR_AXIS, marks=pytest.mark.long)], ids=['oil', 'air'])
@pytest.mark.parametrize('held', [False, True], ids=['free', 'held'])
def test_small_motions_of_the_servo_are_those_of_its_transition_matrix(parts, held):
    servo = ServoParameters(**parts, seals=LOCK if held else ())
    frequency = servo.valve.natural_frequency
    state = init(servo)
    plant = state.plant._replace(charge_a=state.plant.charge_a + 20.0, charge_b=state.plant.charge_b - 20.0)
    if not held:
        plant = plant._replace(position=1e-7, direction=1)
    state = ServoState(plant, ControllerState(0.0, 0.0))
    linear = np.array([plant.position, 0.0, 40.0, 0.0, 0.0, 0.0])
    matrix = transition_matrix(servo.gains, servo.constants, held=held)
    rows, expected = [], []
    for _ in range(25):
        state, _ = step(servo, state, Setpoint(0.0, 0.0, 0.0))
        linear = matrix @ linear
        p, integral = state.plant, state.controller.integral
        pressure, rate = p.charge_a - p.charge_b, p.spool_rate / frequency
        rows.append((p.position, p.velocity, pressure, p.spool, rate, integral))
        expected.append(linear)
    rows, expected = np.array(rows), np.array(expected)
    for column in (2, 3, 4) if held else range(6):
        size = np.abs(expected[:, column]).max()
        np.testing.assert_allclose(rows[:, column], expected[:, column], atol=5e-3 * size + 1e-30)


def test_air_at_rest_is_symmetric_in_a_balanced_cylinder():
    a, b = air_pressures_at_rest(AIR, AIR_AXIS['cylinder'])
    assert a == b


def test_without_an_integrator_its_state_is_no_part_of_the_loop():
    servo = ServoParameters(seals=())
    matrix = transition_matrix(servo.gains, servo.constants)
    assert not matrix[5].any()
    with_integrator = transition_matrix(SERVO.gains, SERVO.constants)[5]
    assert with_integrator == pytest.approx([-1e6 * 5e-4, 0.0, 0.0, 0.0, 0.0, 1.0])


def test_a_force_loop_that_swings_against_a_held_rod_is_unstable_though_the_free_rod_is_not_judged_alone():
    """Discrete first-order lag with gain omega_F T: a fast spool holds up to 2 / T, with a delay of T / 2 less."""
    fast = ServoValve(natural_frequency=2e4, damping_ratio=0.7)
    soft = ServoController(position_gain=0.0, velocity_gain=0.0, velocity_compensation=1.0, force_bandwidth=1.0)
    radii = {}
    for bandwidth in (1.0, 1000.0, 8000.0):
        servo = ServoParameters(valve=fast, seals=(), controller=soft, control_period=5e-4, inner_step=5e-5)
        g = gains(dataclasses.replace(soft, force_bandwidth=bandwidth), servo.constants, 5e-4)
        held = transition_matrix(g, servo.constants, held=True)
        assert not held[0, 1:5].any()
        assert not held[1, 2:5].any()
        force_loop = np.abs(np.linalg.eigvals(held[2:5, 2:5])).max()
        free = np.abs(np.linalg.eigvals(transition_matrix(g, servo.constants))).max()
        radii[bandwidth] = spectral_radius(g, servo.constants), force_loop, free
        assert radii[bandwidth][0] == pytest.approx(max(force_loop, free))
    assert radii[1000.0][1] < 1.0 < radii[8000.0][1]


@pytest.mark.parametrize('cylinder', [SINGLE_ROD, dataclasses.replace(SINGLE_ROD, type='balanced')])
def test_the_linear_model_of_oil_is_that_of_the_flows(cylinder):
    """Opening as `oil_opening` inverts it without load, motion and leakage as the chambers have them."""
    leaking = dataclasses.replace(cylinder, internal_leakage=2e-13, external_leakage=5e-13)
    valve = dataclasses.replace(VALVE, null_leakage=3e-13)
    c = compiled(valve, leaking)
    found, alpha = oil_gains(c.valve, c.cylinder), cylinder.area_ratio
    b = 6e6
    at_null = Measurement(0.0, 0.0, alpha * b, b)
    spool = oil_opening(c.valve, c.cylinder, 200.0, at_null, 100.0, 0.0)
    assert found.opening * spool == pytest.approx(200.0 * 100.0 / cylinder.area_a)

    def load_rate(velocity, change):
        y = (0.0, velocity, alpha * b + change, b - change, 0.0, 0.0, 0.0, 0.0, 293.15, 293.15)
        rates = oil_rates(c.valve, c.cylinder, c.enthalpies, y)
        return rates.pressure_a - alpha * rates.pressure_b

    assert load_rate(0.1, 0.0) - load_rate(0.0, 0.0) == pytest.approx(-0.1 * found.motion)
    if alpha == 1.0:  # of a single rod the leakage is a balanced one's: our choice
        assert load_rate(0.0, 1e5) - load_rate(0.0, 0.0) == pytest.approx(-2e5 * found.leakage)
    volumes = 1.0 / cylinder.mid_volume_a + alpha**2 / cylinder.mid_volume_b
    assert found.leakage == pytest.approx(cylinder.bulk_modulus * volumes * (2e-13 + 2.5e-13 + 3e-13))


def test_a_valve_without_pressure_drop_has_the_gain_of_the_least_drop_of_its_inverse():
    level = ServoValve(supply_pressure=5e5, return_pressure=5e5, rated_flow=3e-4, transition_pressure=3e5)
    found = oil_gains(level, dataclasses.replace(SINGLE_ROD, type='balanced'))
    stiffness = 2.0 * SINGLE_ROD.bulk_modulus / dataclasses.replace(SINGLE_ROD, type='balanced').mid_volume_a
    assert found.opening == pytest.approx(stiffness * level.orifice_gain * math.sqrt(3e5))


def test_the_linear_model_of_air_is_that_of_the_chambers_while_the_valve_extends_the_rod():
    """In mid-stroke at the pressures of rest; REFERENCE_PRESSURE is 0.05 % from that of the reference density."""
    c = compiled(AIR, AIR_CYLINDER, load=Load(mass=3.0))
    a, b = air_pressures_at_rest(AIR, AIR_CYLINDER)
    alpha = AIR_CYLINDER.area_ratio

    def load_rate(opening, speed):
        rate_a = chamber_rates(
            c.valve, opening, 0.0, a, AIR.temperature, AIR_CYLINDER.mid_volume_a, AIR_CYLINDER.area_a * speed
        )[0]
        rate_b = chamber_rates(
            c.valve, 0.0, opening, b, AIR.temperature, AIR_CYLINDER.mid_volume_b, -AIR_CYLINDER.area_b * speed
        )[0]
        return rate_a - alpha * rate_b

    found = load_pressure_gains(c.valve, c.cylinder)
    assert found.opening == pytest.approx(load_rate(0.2, 0.0) / 0.2, rel=1e-3)
    assert found.motion == pytest.approx(-load_rate(0.0, 0.3) / 0.3, rel=1e-9)
    assert found.leakage == 0.0
