"""The pneumatic plant against ISO 6358, closed forms of charging and stiffness, and its own energy."""

import dataclasses
import itertools
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from seal_friction_ros.core.friction.actuator import MountedSeal
from seal_friction_ros.core.servo.controller import ServoController
from seal_friction_ros.core.servo.cylinder import AMBIENT, Cylinder
from seal_friction_ros.core.servo.motions import Sine
from seal_friction_ros.core.servo.plant import Load, fastest_rate, stored_energy
from seal_friction_ros.core.servo.pneumatics import (
    GAS_CONSTANT,
    PneumaticValve,
    air_chamber_rate,
    air_pressures_at_rest,
    chamber_rates,
    iso6358_flow,
)
from seal_friction_ros.core.servo.position_servo import ServoParameters, advance, init, outputs, simulate
from seal_friction_ros.core.servo.tracking import tracking_rms
from seal_friction_ros.files import default_configuration

SEALS = default_configuration().parameters().estimator.seals
LOCK = tuple(
    MountedSeal(dataclasses.replace(mounted.seal, stiction=1e6), chamber)
    for mounted, chamber in zip(SEALS, 'ab', strict=True)
)
CYLINDER = Cylinder(type='single_rod', bore_diameter=0.032, rod_diameter=0.012, stroke=0.2, dead_volume=2e-5)
BALANCED = dataclasses.replace(CYLINDER, type='balanced')
CONTROLLER = ServoController(position_gain=8e3, velocity_gain=150.0, force_bandwidth=100.0, reference_speed_max=0.8)
AIR = PneumaticValve()
TIGHT = PneumaticValve(null_conductance=0.0, heat_conductance=0.0)
LITRE_PER_S_BAR = 1e-8  # [m3/(s Pa)]


def axis(**changes):
    parts = {'valve': AIR, 'cylinder': CYLINDER, 'load': Load(mass=3.0), 'controller': CONTROLLER, 'seals': ()}
    return ServoParameters(**{**parts, 'control_period': 1e-3, **changes})


def flow(upstream, downstream, conductance=1e-8, valve=AIR, temperature=293.15):
    return iso6358_flow(valve, conductance, upstream, temperature, downstream, temperature)


AS_RECORD = axis().constants.valve


# -- valve ------------------------------------------------------------------------------------------------------------


def test_choked_flow_is_conductance_times_pressure_at_the_reference_atmosphere():
    # ISO 6358: C = 1 l/(s bar) passes 7 l/s (ANR) of air, 1.185 kg/m3, from 7 bar at 20 degC.
    assert flow(7e5, 1e5, valve=AS_RECORD) / 1.185 == pytest.approx(7e-3, rel=1e-12)
    assert flow(7e5, 0.3 * 7e5, valve=AS_RECORD) == flow(7e5, 1e5, valve=AS_RECORD)
    hot = flow(7e5, 1e5, valve=AS_RECORD, temperature=4.0 * 293.15)
    assert hot == pytest.approx(0.5 * flow(7e5, 1e5, valve=AS_RECORD), rel=1e-12)


def test_subsonic_flow_is_the_quarter_of_an_ellipse():
    for ratio in (0.4, 0.6, 0.8, 0.95, 0.99):
        expected = math.sqrt(1.0 - ((ratio - 0.3) / 0.7) ** 2)
        measured = flow(7e5, ratio * 7e5, valve=AS_RECORD) / flow(7e5, 1e5, valve=AS_RECORD)
        assert measured == pytest.approx(expected, rel=1e-12)


def test_nominal_flow_of_a_catalogue_follows_from_conductance_and_critical_ratio():
    # Nominal flow: 7 bar to 6 bar absolute. A 5/3 proportional valve G1/8 of 700 l/min with b = 0.3 has
    # C = q / (p1 psi(6/7)) = 2.75 l/(s bar).
    conductance = 700.0 / 60.0 / (7.0 * math.sqrt(1.0 - ((6.0 / 7.0 - 0.3) / 0.7) ** 2))
    assert conductance == pytest.approx(2.75, abs=0.02)
    passed = flow(7e5, 6e5, conductance * LITRE_PER_S_BAR, valve=AS_RECORD) / 1.185
    assert passed * 6e4 == pytest.approx(700.0, rel=1e-9)
    assert AIR.sonic_conductance == pytest.approx(conductance * LITRE_PER_S_BAR, rel=0.03)


def test_flow_is_odd_zero_at_equal_pressures_and_steady():
    assert flow(5e5, 5e5, valve=AS_RECORD) == 0.0
    for upstream, downstream in ((7e5, 1e5), (7e5, 6e5), (5e5, 4.99e5)):
        assert flow(downstream, upstream, valve=AS_RECORD) == -flow(upstream, downstream, valve=AS_RECORD)
    ratios = np.linspace(0.05, 1.0, 2001)
    flows = np.array([flow(7e5, ratio * 7e5, valve=AS_RECORD) for ratio in ratios])
    assert (np.diff(flows) <= 0.0).all()
    assert np.abs(np.diff(flows)).max() < 0.02 * flows[0]


# -- chambers ---------------------------------------------------------------------------------------------------------


def locked(valve, pressure, **changes):
    servo = axis(valve=valve, seals=LOCK, **changes)
    return servo, init(servo).plant._replace(charge_a=pressure, charge_b=pressure)


def test_locked_chamber_is_charged_at_constant_rate_through_a_choked_orifice():
    # Adiabatic, choked: dp/dt = gamma R T_s m' / V = gamma p_0 C p_s / V, whatever the pressure in the chamber.
    valve = dataclasses.replace(TIGHT, supply_pressure=2e6, sonic_conductance=1e-9, natural_frequency=1e4)
    servo, state = locked(valve, 0.0)
    state = state._replace(spool=1.0)
    mass_flow = 1e-9 * (2e6 + AMBIENT) * 1.185
    rate = 1.4 * GAS_CONSTANT * 293.15 * mass_flow / CYLINDER.mid_volume_a
    for i in range(1, 101):
        state = advance(servo, state, 1.0)
        assert state.charge_a == pytest.approx(rate * i * 1e-3, rel=1e-9)
    assert state.position == 0.0


def test_isothermal_chamber_empties_exponentially_through_a_choked_orifice():
    # Isothermal, choked: dp/dt = -R T m' / V, m' = C p rho_0: time constant V / (R T_0 rho_0 C), a published result.
    valve = dataclasses.replace(TIGHT, sonic_conductance=2e-10, heat_conductance=200.0, natural_frequency=1e4)
    servo, state = locked(valve, 0.0, inner_step=2e-5)
    state = state._replace(charge_a=1.5e6, spool=-1.0)
    constant = CYLINDER.mid_volume_a / (GAS_CONSTANT * 293.15 * 1.185 * 2e-10)
    for i in range(1, 1001):
        state = advance(servo, state, -1.0)
        expected = (1.5e6 + AMBIENT) * math.exp(-i * 1e-3 / constant)
        assert state.charge_a + AMBIENT == pytest.approx(expected, rel=1e-3)
    assert state.temperature_a == pytest.approx(293.15, abs=0.2)


def test_adiabatic_charging_of_an_empty_tank_heats_it_by_gamma():
    # Text book: an empty tank filled from a line at T_0 comes to gamma T_0 (here from 1 % of the mass).
    valve = dataclasses.replace(TIGHT, supply_pressure=4e6, sonic_conductance=1e-10, natural_frequency=1e4)
    servo, state = locked(valve, 0.0)
    state = state._replace(charge_a=-0.99 * AMBIENT, spool=1.0)
    while state.charge_a < 0.9 * 4e6:
        state = advance(servo, state, 1.0)
    absolute, empty = state.charge_a + AMBIENT, 0.01 * AMBIENT
    # mass balance: (p/T - p_0/T_0) V/R = m, energy: (p - p_0) V / (gamma - 1) = c_p T_0 m
    expected = absolute / (empty / 293.15 + (absolute - empty) / (1.4 * 293.15))
    assert state.temperature_a == pytest.approx(expected, rel=1e-6)
    assert state.temperature_a == pytest.approx(1.4 * 293.15, rel=0.01)


def oscillation(valve, servo_cylinder, position, inner_step=1e-4):
    """Measured natural frequency [rad/s] of the free rod, and A_a^2 p_a / V_a + A_b^2 p_b / V_b [N/m]."""
    load = Load(mass=3.0, viscous_damping=0.0)
    free = axis(valve=valve, cylinder=servo_cylinder, load=load, inner_step=inner_step)
    start = init(free, position).plant
    state, positions = start._replace(velocity=1e-3, direction=1), []
    for _ in range(3000):
        state = advance(free, state, 0.0)
        positions.append(state.position)
    moved = np.array(positions) - np.mean(positions)
    k = np.flatnonzero((moved[:-1] < 0.0) & (moved[1:] >= 0.0))
    crossing = k + moved[k] / (moved[k] - moved[k + 1])
    frequency = 2.0 * math.pi * (len(k) - 1) / ((crossing[-1] - crossing[0]) * 1e-3)
    c = servo_cylinder
    volume_a, volume_b = c.mid_volume_a + c.area_a * position, c.mid_volume_b - c.area_b * position
    pressures = start.charge_a + AMBIENT, start.charge_b + AMBIENT
    return frequency, c.area_a**2 * pressures[0] / volume_a + c.area_b**2 * pressures[1] / volume_b


@pytest.mark.parametrize('cylinder', [CYLINDER, BALANCED])
@pytest.mark.parametrize('position', [0.0, 0.06])
def test_natural_frequency_is_adiabatic_without_heat(cylinder, position):
    frequency, per_index = oscillation(TIGHT, cylinder, position)
    assert frequency == pytest.approx(math.sqrt(1.4 * per_index / 3.0), rel=2e-3)


def test_natural_frequency_is_isothermal_with_much_heat():
    frequency, per_index = oscillation(dataclasses.replace(TIGHT, heat_conductance=400.0), CYLINDER, 0.0, 5e-5)
    assert frequency == pytest.approx(math.sqrt(per_index / 3.0), rel=5e-3)


# -- cylinder ---------------------------------------------------------------------------------------------------------


def test_rest_is_the_balance_of_the_leakage_and_of_the_areas():
    # Choked out, subsonic in, b = 0.3: r = psi(r) has 1.49 r^2 - 0.6 r - 0.4 = 0, r = 0.757 of the supply pressure,
    # absolute; text books say 0.75 to 0.8.
    a, b = air_pressures_at_rest(AIR, CYLINDER)
    root = (0.6 + math.sqrt(0.36 + 4 * 1.49 * 0.4)) / (2 * 1.49)
    assert (b + AMBIENT) / (6e5 + AMBIENT) == pytest.approx(root, rel=1e-9)
    assert a == pytest.approx(CYLINDER.area_ratio * b, rel=1e-12)
    resting = axis()
    assert outputs(resting, init(resting).plant).force_sum == pytest.approx(0.0, abs=1e-9)


def test_stuck_rod_leaks_to_the_same_pressure_in_both_chambers():
    servo, state = locked(dataclasses.replace(AIR, null_conductance=3e-9), 2e5)
    for _ in range(3000):
        state = advance(servo, state, 0.0)
    _, balance = air_pressures_at_rest(AIR, CYLINDER)
    assert state.charge_a == pytest.approx(balance, rel=1e-3)
    assert state.charge_b == pytest.approx(balance, rel=1e-3)


def moved(servo, steps, inner):
    """The axis after to and fro with two rests: state and relative error of its energy."""
    fine = dataclasses.replace(servo, control_period=inner, inner_step=inner / steps)
    start = state = init(servo).plant
    turnover = 0.0
    for i in range(4000):
        before = state.energy_in
        state = advance(fine, state, (0.05, 0.0, -0.05, 0.0)[i // 500 % 4], 5.0)
        turnover += abs(state.energy_in - before)
    stored = stored_energy(servo.constants, state) - stored_energy(servo.constants, start)
    return state, abs(state.energy_in - stored - state.energy_dissipated) / turnover


def test_energy_in_is_stored_and_rubbed_off_to_a_millionth_and_better_with_smaller_steps():
    servo = axis(seals=SEALS, load=Load(mass=3.0, spring_stiffness=200.0, viscous_damping=20.0))
    errors = []
    for steps in (1, 2, 4):
        state, error = moved(servo, steps, 4e-4)
        errors.append(error)
        assert state.transitions > 4
        assert state.energy_dissipated > 1.0
    assert errors[1] < 1e-6
    for coarse, fine in itertools.pairwise(errors):
        assert fine < 0.5 * coarse or fine < 1e-10


def test_step_of_the_valve_moves_the_rod_as_an_independent_solver_says():
    """The equations of the text book in mass and energy instead of pressure and temperature, DOP853 of scipy."""
    servo = axis(valve=dataclasses.replace(AIR, natural_frequency=200.0), load=Load(mass=3.0, viscous_damping=20.0))
    c, valve = servo.cylinder, servo.valve
    start = init(servo).plant
    supply = valve.supply_pressure + AMBIENT

    def passed(conductance, p1, t1, p2, t2):
        if p2 > p1:
            return -passed(conductance, p2, t2, p1, t1)
        r, b, last = p2 / p1, 0.3, 0.99
        ellipse = math.sqrt(1.0 - max((min(r, last) - b) / (1 - b), 0.0) ** 2)
        return conductance * p1 * 1.185 * math.sqrt(293.15 / t1) * ellipse * min((1 - r) / (1 - last), 1.0)

    def equations(_, y):
        x, v, m_a, u_a, m_b, u_b, s, rate = y
        cv = GAS_CONSTANT / 0.4
        t = [u_a / (m_a * cv), u_b / (m_b * cv)]
        volumes = [c.mid_volume_a + c.area_a * x, c.mid_volume_b - c.area_b * x]
        p = [0.4 * u / volume for u, volume in zip((u_a, u_b), volumes, strict=True)]
        mass, energy = [], []
        for i, opening in enumerate((s, -s)):
            lands = [(max(opening, 0.0), supply), (max(-opening, 0.0), AMBIENT)]
            flows = [
                passed(valve.sonic_conductance * part + valve.null_conductance, outside, 293.15, p[i], t[i])
                for part, outside in lands
            ]
            work = p[i] * (c.area_a, -c.area_b)[i] * v
            heat = valve.heat_conductance * (293.15 - t[i])
            mass.append(sum(flows))
            energy.append(sum(1.4 * cv * (293.15 if q > 0 else t[i]) * q for q in flows) - work + heat)
        force = (p[0] - AMBIENT) * c.area_a - (p[1] - AMBIENT) * c.area_b - 20.0 * v
        return [v, force / 3.0, mass[0], energy[0], mass[1], energy[1], rate, 200.0**2 * (0.3 - s) - 320.0 * rate]

    begin = [0.0, 0.0]
    for charge, volume in ((start.charge_a, c.mid_volume_a), (start.charge_b, c.mid_volume_b)):
        absolute = charge + AMBIENT
        begin += [absolute * volume / (GAS_CONSTANT * 293.15), absolute * volume / 0.4]
    exact = solve_ivp(equations, (0.0, 0.08), [*begin, 0.0, 0.0], 'DOP853', rtol=1e-9, atol=1e-12, max_step=1e-4)
    state = start._replace(direction=1)
    for _ in range(80):
        state = advance(servo, state, 0.3)
    assert 0.01 < state.position < 0.09
    assert state.position == pytest.approx(exact.y[0, -1], rel=1e-5)
    assert state.velocity == pytest.approx(exact.y[1, -1], rel=1e-4)
    cv = GAS_CONSTANT / 0.4
    assert state.temperature_b == pytest.approx(exact.y[5, -1] / (exact.y[4, -1] * cv), rel=1e-5)


def test_rod_meets_the_stops_and_pressures_stay_between_vacuum_and_supply():
    servo = axis(seals=SEALS)
    state, seen = init(servo).plant, set()
    for i in range(3000):
        state = advance(servo, state, 1.0 if i // 750 % 2 else -1.0)
        assert all(map(math.isfinite, state))
        assert abs(state.position) <= CYLINDER.limit
        seen.add(state.position)
    assert {CYLINDER.limit, -CYLINDER.limit} <= seen
    assert -AMBIENT < min(state.charge_a, state.charge_b) < max(state.charge_a, state.charge_b) < 1.01 * 6e5


def test_servo_tracks_a_sine_without_friction_and_lags_with_it():
    wave = Sine(0.02, 1.0)
    reference = np.array([wave.at((i + 1) * 1e-3).position for i in range(3000)])
    errors = []
    for seals in ((), SEALS):
        servo = axis(seals=seals)
        _, track = simulate(servo, init(servo), [wave.at(i * 1e-3) for i in range(3000)])
        assert not track.limited.any()
        errors.append(tracking_rms(reference[1000:], track.position[1000:]))
    assert errors[0] < 0.002 * 0.02
    assert errors[1] > 20.0 * errors[0]


def test_step_that_is_too_long_for_the_air_is_rejected_with_the_part():
    rate, part = fastest_rate(AIR, CYLINDER, Load(mass=3.0))
    assert 'sonic_conductance' in part
    with pytest.raises(ValueError, match='sonic_conductance'):
        axis(inner_step=5.0 / rate, control_period=5.0 / rate)


def test_loop_that_is_too_stiff_for_the_air_is_rejected():
    with pytest.raises(ValueError, match='closed loop is unstable'):
        axis(controller=dataclasses.replace(CONTROLLER, force_bandwidth=2000.0))


@pytest.mark.parametrize('pressure', [-5e4, 3e5])
def test_air_brings_the_enthalpy_of_where_it_comes_from(pressure):
    """A chamber below the ambient pressure draws air as warm as it is outside; one above it loses its own."""
    valve, hot = axis(valve=TIGHT).constants.valve, 350.0
    rate, _, power = chamber_rates(valve, 0.0, 0.5, pressure, hot, 1e-4, 0.0)
    land = 0.5 * valve.sonic_conductance
    flow_in = iso6358_flow(valve, land, AMBIENT, valve.temperature, pressure + AMBIENT, hot)
    source = valve.temperature if pressure < 0.0 else hot
    assert power == pytest.approx(1.4 / 0.4 * GAS_CONSTANT * flow_in * source, rel=1e-9)
    assert rate * pressure < 0.0


def test_rate_of_a_chamber_is_the_slope_of_its_pressure_near_that_of_the_supply():
    """One open land, at the stop; the standard atmosphere of ISO 8778 and R T_0 rho_0 differ by 0.05 %."""
    valve, supply, volume = axis(valve=TIGHT).constants.valve, 6e5, CYLINDER.dead_volume
    rates = [chamber_rates(valve, 1.0, 0.0, supply - below, 293.15, volume, 0.0)[0] for below in (100.0, 200.0)]
    assert air_chamber_rate(TIGHT, CYLINDER) == pytest.approx((rates[1] - rates[0]) / 100.0, rel=1e-3)


def test_leakage_of_both_closed_lands_and_heat_add_their_rates():
    rate, volume = air_chamber_rate(TIGHT, CYLINDER), CYLINDER.dead_volume
    leaking = dataclasses.replace(TIGHT, null_conductance=0.5 * TIGHT.sonic_conductance)
    assert air_chamber_rate(leaking, CYLINDER) == pytest.approx(2.0 * rate)
    warm = dataclasses.replace(TIGHT, heat_conductance=3.0)
    # 3 W/K over the heat capacity at constant pressure of the least air, p V / (R T) c_v, times gamma
    capacity = AMBIENT * volume / (GAS_CONSTANT * 293.15) * GAS_CONSTANT / 0.4
    assert air_chamber_rate(warm, CYLINDER) - rate == pytest.approx(1.4 * 3.0 / capacity, rel=1e-6)


def test_fastest_rate_of_air_has_the_mass_on_air_at_supply_pressure_at_a_stop():
    load = Load(mass=3.0, spring_stiffness=2e3, viscous_damping=12.0)
    a, b, v = CYLINDER.area_a, CYLINDER.area_b, CYLINDER.dead_volume
    stiffness = 1.4 * (6e5 + AMBIENT) * (a**2 / v + b**2 / (b * 0.2 + v)) + 2e3
    expected = air_chamber_rate(AIR, CYLINDER) + math.sqrt(stiffness / 3.0) + 12.0 / 3.0
    assert fastest_rate(AIR, CYLINDER, load)[0] == pytest.approx(expected)


def test_air_without_supply_rests_at_ambient():
    assert air_pressures_at_rest(PneumaticValve(supply_pressure=0.0), CYLINDER) == (0.0, 0.0)
