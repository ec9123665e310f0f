"""The servo's valve, cylinder and load against closed forms, an independent solver, and their own energy."""

import dataclasses
import math
from contextlib import nullcontext
from itertools import pairwise

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from paths import ROOT
from scipy.integrate import solve_ivp

from seal_friction_ros.core.foundation.units import PSI
from seal_friction_ros.core.friction.actuator import MountedSeal, actuator_friction, numbers_of_seals
from seal_friction_ros.core.friction.laws.constant_coulomb import ConstantCoulomb
from seal_friction_ros.core.friction.laws.friction_map import FrictionMap
from seal_friction_ros.core.friction.laws.velocity_terms import VelocityTerms
from seal_friction_ros.core.friction.pressure_asymmetry import PressureAsymmetry
from seal_friction_ros.core.friction.seal_file import parse_seal
from seal_friction_ros.core.friction.states import FrictionState
from seal_friction_ros.core.servo.controller import ServoController
from seal_friction_ros.core.servo.cylinder import AMBIENT, Cylinder
from seal_friction_ros.core.servo.hydraulics import ServoValve, oil_chamber_rate, oil_rates, port_flow, signed_root
from seal_friction_ros.core.servo.plant import (
    Constants,
    Load,
    cavity_margin,
    fastest_rate,
    margin,
    smooth_step,
    steepest_friction,
    stored_energy,
    time_of_event,
)
from seal_friction_ros.core.servo.position_servo import ServoParameters, advance, init, outputs

SEAL = parse_seal(yaml.safe_load((ROOT / 'config/seals/ms28775_114.yaml').read_text()))
SEALS = (MountedSeal(SEAL, 'a'), MountedSeal(SEAL, 'b'))
LOCK = tuple(MountedSeal(dataclasses.replace(SEAL, stiction=1e6), chamber) for chamber in 'ab')
SERVO = ServoParameters(seals=SEALS)
TIGHT_VALVE = ServoValve(null_leakage=0.0)
TIGHT_CYLINDER = Cylinder(internal_leakage=0.0)


def plant(servo, **changes):
    return init(servo).plant._replace(**changes)


def with_inner_step(servo, time):
    return dataclasses.replace(servo, control_period=time, inner_step=time)


def test_natural_frequency_is_that_of_merritt_within_1_percent():
    free = ServoParameters(
        valve=TIGHT_VALVE, cylinder=TIGHT_CYLINDER, load=Load(viscous_damping=0.0), seals=(), inner_step=2e-5
    )
    state = plant(free, velocity=1e-3, direction=1)
    position = []
    for _ in range(2000):
        state = advance(free, state, 0.0)
        position.append(state.position)
    position = np.array(position) - np.mean(position)
    k = np.flatnonzero((position[:-1] < 0.0) & (position[1:] >= 0.0))
    crossing = k + position[k] / (position[k] - position[k + 1])
    measured = 2.0 * math.pi * (len(k) - 1) / ((crossing[-1] - crossing[0]) * free.control_period)
    cylinder = free.cylinder
    expected = math.sqrt(2.0 * cylinder.bulk_modulus * cylinder.area_a**2 / (cylinder.mid_volume_a * free.load.mass))
    assert measured == pytest.approx(expected, rel=1e-4)


def test_pressure_of_a_locked_piston_rises_as_the_closed_form():
    # dp/dt = (beta/V) K s sqrt(p_s - p)  =>  sqrt(p_s - p) = sqrt(p_s - p_0) - beta K s t / (2 V)
    locked = ServoParameters(valve=TIGHT_VALVE, cylinder=TIGHT_CYLINDER, seals=LOCK)
    valve, cylinder, opening = locked.valve, locked.cylinder, 0.05
    state = plant(locked, charge_a=1e6, spool=opening)
    volume = cylinder.mid_volume_a
    for i in range(1, 5):
        state = advance(locked, state, opening)
        fall = cylinder.bulk_modulus * valve.orifice_gain * opening * i * locked.control_period / (2.0 * volume)
        root = math.sqrt(valve.supply_pressure - 1e6) - fall
        assert state.charge_a == pytest.approx(valve.supply_pressure - root**2, rel=1e-9)
        assert root**2 > valve.transition_pressure
    assert state.position == 0.0


def test_pressure_of_a_locked_piston_leaks_away_as_the_closed_form():
    # d(p_a - p_b)/dt = -(2 beta/V) (C_i + C_n) (p_a - p_b)
    locked = ServoParameters(seals=LOCK, cylinder=Cylinder(internal_leakage=5e-14))
    state = plant(locked)
    state = state._replace(charge_a=state.charge_a + 1e6, charge_b=state.charge_b - 1e6)
    for _ in range(100):
        state = advance(locked, state, 0.0)
    rate = 2.0 * locked.cylinder.bulk_modulus / locked.cylinder.mid_volume_a * (5e-14 + 6e-14)
    expected = 2e6 * math.exp(-rate * 100 * locked.control_period)
    assert state.charge_a - state.charge_b == pytest.approx(expected, rel=1e-7)


def test_oil_leaks_to_ambient_from_each_chamber_as_the_closed_form():
    # dp/dt = -(beta/V) C_e p, of either chamber for itself
    leaking = ServoParameters(
        seals=LOCK, valve=TIGHT_VALVE, cylinder=Cylinder(internal_leakage=0.0, external_leakage=5e-14)
    )
    start = state = plant(leaking, charge_a=2e6, charge_b=5e6)
    for _ in range(100):
        state = advance(leaking, state, 0.0)
    cylinder = leaking.cylinder
    share = math.exp(-cylinder.bulk_modulus / cylinder.mid_volume_a * 5e-14 * 100 * leaking.control_period)
    assert (state.charge_a, state.charge_b) == pytest.approx((2e6 * share, 5e6 * share), rel=1e-7)
    lost = stored_energy(leaking.constants, start) - stored_energy(leaking.constants, state)
    assert state.energy_dissipated == pytest.approx(lost, rel=1e-6)
    assert state.energy_in == 0.0


@pytest.mark.parametrize('chamber', ['a', 'b'])
def test_oil_that_flows_into_a_cavity_fills_it_by_its_volume(chamber):
    # The oil is V exp((charge - vapour) / beta) at vapour pressure; its rate is the flow.
    c, charge = SERVO.constants, -5e6
    y = list(plant(SERVO, **{f'charge_{chamber}': charge}))[:10]
    rates = oil_rates(c.valve, c.cylinder, c.enthalpies, tuple(y))
    beta, volume = SERVO.cylinder.bulk_modulus, SERVO.cylinder.mid_volume_a
    vapour = SERVO.cylinder.vapour
    oil = volume * math.exp((charge - vapour) / beta)
    other = y[3] if chamber == 'a' else y[2]
    flow = 6e-14 * (1000.0 * PSI + 1e5 - 2.0 * vapour) + 1e-14 * (other - vapour)
    assert getattr(rates, f'pressure_{chamber}') * oil / beta == pytest.approx(flow, rel=1e-9)


def test_the_rated_flow_passes_two_lands_that_share_the_rated_drop():
    valve = SERVO.constants.valve
    drop = 1000.0 * PSI / 2.0
    assert port_flow(valve, 1.0, 3e6, 3e6 - drop) == pytest.approx(2.5e-5 + 6e-14 * drop)
    assert port_flow(valve, 0.5, 3e6 - drop, 3e6) == pytest.approx(-0.5 * 2.5e-5 - 6e-14 * drop)


def test_fastest_rate_is_that_of_the_spool_or_of_oil_with_the_mass_on_it():
    slow = Cylinder(type='single_rod', bore_diameter=0.04, rod_diameter=0.022, stroke=0.3, dead_volume=5e-5)
    valve, load = ServoValve(natural_frequency=2e4, damping_ratio=0.3), Load(mass=80.0, spring_stiffness=5e7)
    assert fastest_rate(valve, slow, load)[0] == 2e4
    assert fastest_rate(dataclasses.replace(valve, damping_ratio=0.8), slow, load)[0] == pytest.approx(1.6 * 2e4)
    load = Load(mass=80.0, spring_stiffness=5e7, viscous_damping=800.0)
    valve = ServoValve(natural_frequency=100.0)
    rate, part = fastest_rate(valve, slow, load)
    a, b, v = slow.area_a, slow.area_b, slow.dead_volume
    stiffness = slow.bulk_modulus * (a**2 / v + b**2 / (b * 0.3 + v)) + 5e7  # at the stop of the larger chamber
    assert rate == pytest.approx(oil_chamber_rate(valve, slow) + math.sqrt(stiffness / 80.0) + 10.0)
    assert part.startswith('chamber and orifice')
    orifice = 1.25 * ServoValve().orifice_gain / math.sqrt(3e5)
    assert oil_chamber_rate(TIGHT_VALVE, TIGHT_CYLINDER) == pytest.approx(7e8 / 2e-6 * orifice)


def test_spool_follows_its_second_order_step_response():
    valve = ServoValve(damping_ratio=0.5)
    servo = ServoParameters(valve=valve, seals=LOCK)
    state = plant(servo)
    for i in range(1, 21):
        state = advance(servo, state, 0.4)
        t, w, z = i * servo.control_period, valve.natural_frequency, 0.5
        damped = w * math.sqrt(1 - z * z)
        expected = 0.4 * (1 - math.exp(-z * w * t) * (math.cos(damped * t) + z * w / damped * math.sin(damped * t)))
        assert state.spool == pytest.approx(expected, abs=1e-5)


def test_spool_stays_within_full_opening():
    servo = ServoParameters(valve=ServoValve(damping_ratio=0.4), seals=LOCK)
    state = plant(servo)
    spool = []
    for _ in range(200):
        state = advance(servo, state, 5.0)
        spool.append(state.spool)
    assert max(spool) == 1.0


def test_root_meets_value_and_slope_at_the_transition():
    e = 1.0
    for sign in (1.0, -1.0):
        assert signed_root(sign * (3e5 - e), 3e5) == pytest.approx(signed_root(sign * (3e5 + e), 3e5), rel=1e-5)
    inside = (signed_root(3e5, 3e5) - signed_root(3e5 - e, 3e5)) / e
    outside = (signed_root(3e5 + e, 3e5) - signed_root(3e5, 3e5)) / e
    assert inside == pytest.approx(outside, rel=1e-4)
    assert signed_root(0.0, 3e5) == 0.0


def wave_commands(n, size=0.03):
    """There, rest, back, rest: each 20 ms."""
    return [(size, 0.0, -size, 0.0)[i // 40 % 4] for i in range(n)]


@pytest.mark.parametrize('load', [Load(), Load(spring_stiffness=2e4, viscous_damping=200.0)])
def test_energy_in_is_stored_and_dissipated(load):
    servo = ServoParameters(load=load, seals=SEALS)
    start = state = plant(servo)
    for command in wave_commands(2000):
        state = advance(servo, state, command, 10.0)
    stored = stored_energy(servo.constants, state) - stored_energy(servo.constants, start)
    assert state.energy_in > 1.0
    assert state.transitions > 40
    assert abs(state.energy_in - stored - state.energy_dissipated) < 1e-8 * state.energy_in


def reference_solution(servo, commands, command_time):
    """Stick and slip as events of scipy's solver, the equations written again, with the laws and not their tables."""
    valve, cylinder, load = servo.valve, servo.cylinder, servo.load
    area, beta, gain = cylinder.area_a, cylinder.bulk_modulus, valve.orifice_gain
    middle = cylinder.mid_volume_a
    w, z = valve.natural_frequency, valve.damping_ratio

    def root(dp):
        r = dp / valve.transition_pressure
        return (
            math.copysign(math.sqrt(abs(dp)), dp)
            if abs(r) >= 1
            else (math.sqrt(valve.transition_pressure) * r * (5 - r * r) / 4)
        )

    def force(y):
        return area * (y[2] - y[3]) - load.viscous_damping * y[1]

    def holding(y):
        friction = actuator_friction(SEALS, y[2], y[3])
        return friction.coulomb_friction + friction.stiction

    def equations(_, y, direction, u):
        x, v, pa, pb, s, rate = y
        source_a, source_b = (valve.supply_pressure, valve.return_pressure)[:: 1 if s > 0 else -1]
        qa = gain * abs(s) * root(source_a - pa)
        qb = gain * abs(s) * root(source_b - pb)
        ends = valve.supply_pressure + valve.return_pressure
        leak = cylinder.internal_leakage * (pa - pb)
        qa += valve.null_leakage * (ends - 2 * pa) - leak
        qb += valve.null_leakage * (ends - 2 * pb) + leak
        acceleration = (force(y) - direction * actuator_friction(SEALS, pa, pb).coulomb_friction) / load.mass
        return [
            v * abs(direction),
            acceleration * abs(direction),
            beta / (middle + area * x) * (qa - area * v),
            beta / (middle - area * x) * (qb + area * v),
            rate,
            w * w * (u - s) - 2 * z * w * rate,
        ]

    y, direction, t = np.array(init(servo).plant[:6]), 0, 0.0
    for i, u in enumerate(commands):
        end = (i + 1) * command_time
        while t < end:
            event = (lambda _, y, *_a: y[1]) if direction else (lambda _, y, *_a: holding(y) - abs(force(y)))
            event.terminal, event.direction = True, -direction if direction else -1
            accuracy = {'rtol': 1e-10, 'atol': 1e-12, 'max_step': 1e-3}
            solution = solve_ivp(equations, (t, end), y, 'DOP853', args=(direction, u), events=event, **accuracy)
            t, y = solution.t[-1], solution.y[:, -1]
            if solution.status == 1 and direction:
                y[1] = 0.0
                direction = 0 if abs(force(y)) <= holding(y) else int(np.sign(force(y)))
            elif solution.status == 1:
                direction = int(np.sign(force(y)))
    return y


def test_halving_the_step_halves_the_error_at_least():
    commands, command_time = [0.05, -0.05, 0.05, -0.05, 0.0], 0.01
    exact = reference_solution(SERVO, commands, command_time)
    scale = np.array([1e-4, 1e-2, 1e6, 1e6, 1.0, 1e3])
    errors = []
    for steps in (50, 100, 200, 400):
        fine, state = with_inner_step(SERVO, command_time / steps), plant(SERVO)
        for command in commands:
            for _ in range(steps):
                state = advance(fine, state, command)
        errors.append(float(np.max(np.abs(np.array(state[:6]) - exact) / scale)))
    assert state.transitions >= 6
    assert errors[1] < 1e-4
    for coarse, fine in pairwise(errors):
        assert fine < 0.5 * coarse or fine < 1e-8


@pytest.mark.parametrize('direction', [1.0, -1.0])
def test_force_ramp_to_99_percent_of_breakaway_moves_nothing_at_101_it_moves(direction):
    state = plant(SERVO)
    breakaway = outputs(SERVO, state).breakaway_force
    for share in np.linspace(0.0, 0.99, 2000):
        state = advance(SERVO, state, 0.0, direction * share * breakaway)
        assert state.position == 0.0
        assert state.velocity == 0.0
    at_rest = outputs(SERVO, state, load_force=direction * 0.99 * breakaway)
    assert at_rest.friction_state == FrictionState.STUCK
    assert at_rest.friction_force == at_rest.force_sum
    assert state.transitions == 0
    for share in np.linspace(0.99, 1.01, 200):
        state = advance(SERVO, state, 0.0, direction * share * breakaway)
    assert direction * state.position > 0.0


@pytest.mark.parametrize('direction', [1.0, -1.0])
def test_a_rod_breaks_away_and_slides_by_its_direction_relative_to_the_pressure(direction):
    """One rod seal in chamber a: out of it is away from its pressure, in is towards it.

    A seal without friction stands beside it, so that the compiled code of two seals serves here, too.
    """
    uneven = dataclasses.replace(SEAL, pressure_asymmetry=PressureAsymmetry(asymmetry=-0.4, full_pressure=1e6))
    servo = ServoParameters(seals=(MountedSeal(uneven, 'a'), MountedSeal(SEAL, 'b', friction_scale=0.0)))
    state = plant(servo)
    mean = actuator_friction((MountedSeal(SEAL, 'a'),), state.charge_a, 0.0)
    breakaway = outputs(servo, state, load_force=direction).breakaway_force
    factor = 1.0 + 0.4 * direction
    assert breakaway == pytest.approx(factor * (mean.coulomb_friction + mean.stiction), rel=1e-3)
    assert advance(servo, state, 0.0, direction * 0.99 * breakaway).position == 0.0
    assert direction * advance(servo, state, 0.0, direction * 1.01 * breakaway).position > 0.0
    slides = outputs(servo, plant(servo, velocity=0.02 * direction, direction=int(direction)))
    assert slides.friction_force == pytest.approx(direction * factor * mean.coulomb_friction, rel=1e-3)


def test_rod_meets_the_stops_and_stays_within():
    state = plant(SERVO)
    limit, seen = SERVO.cylinder.stroke / 2.0, set()
    for i in range(1200):
        state = advance(SERVO, state, 1.0 if i < 600 else -1.0)
        assert abs(state.position) <= limit
        seen.add(state.position)
        if abs(state.position) == limit:
            assert state.velocity == 0.0
    assert {limit, -limit} <= seen
    assert outputs(SERVO, state).force_sum == 0.0


def test_cavitating_chamber_keeps_its_oil():
    # No flow: the charge depends on the volume alone, p_0 + beta ln(V_0 / V), while the cavity grows and collapses.
    shut = ServoParameters(valve=TIGHT_VALVE, cylinder=TIGHT_CYLINDER, load=Load(mass=50.0), seals=())
    state = plant(shut)
    start, middle, area = state.charge_a, shut.cylinder.mid_volume_a, shut.cylinder.area_a
    lowest, collapsed = 0.0, False
    for i in range(400):
        state = advance(shut, state, 0.0, 3000.0 if i < 60 else -3000.0)
        volume = middle + area * state.position
        expected = start + shut.cylinder.bulk_modulus * math.log(middle / volume)
        assert state.charge_a == pytest.approx(expected, abs=200.0)
        lowest = min(lowest, state.charge_a)
        collapsed = collapsed or (lowest < -1e6 and state.charge_a > 0.0)
        assert outputs(shut, state).pressure_a + AMBIENT >= 0.99 * shut.cylinder.vapour_pressure
    assert lowest < -1e6
    assert collapsed


@settings(max_examples=15, deadline=None)
@given(
    st.lists(st.tuples(st.floats(-2.0, 2.0), st.floats(-5000.0, 5000.0)), min_size=5, max_size=12),
    st.sampled_from([SEALS, ()]),
)
def test_whatever_is_done_to_it_stays_physical(inputs, seals):
    servo = dataclasses.replace(SERVO, seals=seals)
    start = state = plant(servo)
    turnover = 0.0
    for command, force in inputs:
        for _ in range(40):
            before = state
            state = advance(servo, state, command, force)
            turnover += abs(state.energy_in - before.energy_in)
            out = outputs(servo, state, load_force=force)
            assert all(map(math.isfinite, state))
            assert out.pressure_a + AMBIENT > 0.0
            assert out.pressure_b + AMBIENT > 0.0
            assert abs(out.position) <= servo.cylinder.stroke / 2.0
            assert abs(out.spool) <= 1.0
            assert state.energy_dissipated >= before.energy_dissipated - 1e-9
    stored = stored_energy(servo.constants, state) - stored_energy(servo.constants, start)
    assert abs(state.energy_in - stored - state.energy_dissipated) < 1e-4 * turnover + 1e-9


@pytest.mark.parametrize(
    ('changes', 'reason'),
    [
        ({'inner_step': 5e-4}, r'inner_step = 0.0005 s is too long: at most .* chamber and orifice'),
        ({'valve': ServoValve(natural_frequency=6e4)}, 'spool of the valve'),
        ({'inner_step': 1.5e-4}, 'not a multiple'),
        ({'inner_step': 2e-3}, 'not a multiple'),
        ({'controller': ServoController(position_gain=3e6)}, 'closed loop is unstable'),
        ({'control_period': 1e-2}, 'closed loop is unstable'),
    ],
)
def test_servo_that_cannot_work_is_rejected_with_the_reason(changes, reason):
    with pytest.raises(ValueError, match=reason):
        ServoParameters(seals=SEALS, **changes)


@pytest.mark.parametrize(
    ('part', 'reason'),
    [
        (lambda: ServoValve(supply_pressure=0.0), 'below return_pressure'),
        (lambda: Cylinder(bore_diameter=0.01), 'not above rod_diameter'),
        (lambda: Cylinder(dead_volume=2e-9), '1 % of the swept volume'),
        (lambda: Load(mass=-1.0), 'below its lower bound'),
        (lambda: Load(viscous_damping=math.nan), 'not finite'),
        (lambda: init(SERVO, 0.03), 'not within the stroke'),
    ],
)
def test_part_that_is_not_physical_is_rejected_with_the_reason(part, reason):
    with pytest.raises(ValueError, match=reason):
        part()


def test_largest_inner_step_that_is_accepted_is_stable():
    rate, _ = fastest_rate(SERVO.valve, SERVO.cylinder, SERVO.load)
    longest = ServoParameters(seals=LOCK, inner_step=2e-4, control_period=4e-4)
    assert rate * 2e-4 > 2.0
    for product, taken in ((2.49, True), (2.51, False)):  # 2.78 is the limit of Runge-Kutta on the real axis
        with nullcontext() if taken else pytest.raises(ValueError, match='too long'):
            ServoParameters(seals=(), inner_step=product / rate, control_period=2.0 * product / rate)
    state = plant(longest, position=-longest.cylinder.stroke / 2.0, spool=1.0)
    for _ in range(200):
        state = advance(longest, state, 1.0)
    assert state.charge_a == pytest.approx(longest.valve.supply_pressure, rel=0.01)


def test_each_leakage_of_a_chamber_at_its_stop_adds_its_rate():
    """Both lands of the valve and both sides of the piston let oil out; the other chamber moves the other way."""
    rate = oil_chamber_rate(TIGHT_VALVE, TIGHT_CYLINDER)
    per_leakage = TIGHT_CYLINDER.bulk_modulus / TIGHT_CYLINDER.dead_volume
    for part, name, factor in (
        ('valve', 'null_leakage', 2.0), ('cylinder', 'internal_leakage', 2.0), ('cylinder', 'external_leakage', 1.0)
    ):  # fmt: skip
        parts = {'valve': TIGHT_VALVE, 'cylinder': TIGHT_CYLINDER}
        parts[part] = dataclasses.replace(parts[part], **{name: 1e-12})
        added = oil_chamber_rate(parts['valve'], parts['cylinder']) - rate
        assert added == pytest.approx(factor * 1e-12 * per_leakage, rel=1e-6)


def test_one_seal_with_viscous_friction_makes_the_friction_steep():
    rigid = SEALS[0].seal
    viscous = dataclasses.replace(rigid, velocity_terms=VelocityTerms(viscous_friction=500.0))
    assert steepest_friction(SEALS, 20e6) == 0.0
    mixed = (MountedSeal(rigid, 'a'), MountedSeal(viscous, 'b'))
    assert steepest_friction(mixed, 20e6) == pytest.approx(500.0, rel=1e-6)


CALM = {
    'valve': ServoValve(null_leakage=0.0, rated_flow=1e-8),
    'cylinder': Cylinder(internal_leakage=1e-8, stroke=0.2, dead_volume=1e-2),  # both chambers at one pressure
    'load': Load(mass=5.0, viscous_damping=500.0),
}


@pytest.mark.parametrize('side', [1, -1])
def test_a_rod_that_slows_down_for_ever_is_at_rest_below_a_nanometre_per_second(side):
    """A force of 10 N against friction of 10 N: v falls by e every 10 ms, from 3 nm/s it is at rest after 11 ms."""
    seal = dataclasses.replace(SEAL, coulomb_law=ConstantCoulomb(10.0), stiction=1.0)
    servo = ServoParameters(**CALM, seals=(MountedSeal(seal, 'a'),))
    state, speeds = plant(servo, velocity=side * 3e-9, direction=side), []
    for _ in range(40):
        state = advance(servo, state, 0.0, side * 10.0)
        speeds.append(side * state.velocity)
    moving = [speed for speed in speeds if speed]
    assert 20 <= len(moving) <= 22  # half milliseconds
    assert min(moving) < 1.1e-9
    assert (speeds[-1], state.direction, state.transitions) == (0.0, 0, 1)


@pytest.mark.parametrize('side', [1, -1])
def test_a_rod_without_seals_starts_with_the_smallest_force(side):
    servo = ServoParameters(**CALM, seals=())
    state = plant(servo)
    for i in range(1, 6):
        state = advance(servo, state, 0.0, side * 1e-6)
        elapsed = i * servo.control_period
        speed = 1e-6 / 500.0 * (1.0 - math.exp(-100.0 * elapsed))  # below 1 nm/s: it accelerates
        assert side * state.velocity == pytest.approx(speed, rel=2e-2)
    assert speed < 1e-9
    assert (state.direction, state.transitions) == (side, 1)


def test_a_servo_starts_at_rest_with_nothing_done_and_its_valve_closed():
    """Half the sum of 1000 psi and 1 bar in both chambers of a balanced cylinder, oil at 20 degrees Celsius."""
    state = init(SERVO, -SERVO.cylinder.limit)
    middle = 0.5 * (1000.0 * PSI + 1e5)
    assert state.plant == pytest.approx((-0.025, 0.0, middle, middle, 0.0, 0.0, 0.0, 0.0, 293.15, 293.15, 0, 0))
    assert state.controller == (-0.025, 0.0)
    out = outputs(SERVO, init(SERVO).plant)
    assert (out.command.spool, out.command.force, out.command.limited) == (0.0, 0.0, 0)
    assert (out.position, out.velocity, out.spool, out.direction) == (0.0, 0.0, 0.0, 0)


def test_a_spool_command_beyond_full_opening_is_full_opening():
    start = plant(SERVO)
    for command in (1.0, -1.0):
        full = advance(SERVO, start, command)
        assert advance(SERVO, start, 7.0 * command) == full
        assert advance(SERVO, start, 0.9 * command) != full
        assert full.spool * command > 0.1


@pytest.mark.parametrize('side', [1.0, -1.0])
def test_a_rod_at_a_stop_is_carried_by_it_while_it_presses_and_not_while_it_is_drawn_away(side):
    state = plant(SERVO, position=side * SERVO.cylinder.limit)
    assert outputs(SERVO, state, load_force=side * 30.0).force_sum == 0.0
    assert outputs(SERVO, state, load_force=-side * 30.0).force_sum == pytest.approx(-side * 30.0)
    inside = state._replace(position=side * 0.999 * SERVO.cylinder.limit)
    assert outputs(SERVO, inside, load_force=side * 30.0).force_sum == pytest.approx(side * 30.0)
    leaving = state._replace(velocity=side * 0.1, direction=int(side))  # a moving rod is not carried
    assert outputs(SERVO, leaving, load_force=side * 30.0).force_sum == pytest.approx(side * 28.0)  # 20 N s/m


def test_the_kinetic_energy_is_lost_at_a_stop():
    """5 kg at 0.2 m/s: 0.1 J, in one inner step, before anything else takes energy."""
    limit = SERVO.cylinder.limit
    state = plant(SERVO, position=limit - 1e-9, velocity=0.2, direction=1)
    new = advance(with_inner_step(SERVO, 1e-6), state, 0.0)
    assert (new.position, new.velocity, new.direction, new.transitions) == (limit, 0.0, 0, 1)
    assert new.energy_dissipated == pytest.approx(0.5 * 5.0 * 0.2**2, rel=1e-3)


def test_a_seal_that_sees_the_pressure_difference_is_steepest_with_one_chamber_empty():
    """The rise over speed is in proportion to the pressure: four times as large at 20 MPa as at 5 MPa."""
    law = FrictionMap(speeds=(1e-3, 1.0), pressures=(0.0, 2e7), frictions=(1.0, 1.0, 1.0, 301.0), reference_speed=0.02)
    seal = dataclasses.replace(SEALS[0].seal, coulomb_law=law)
    steepest = {
        (sees, pressure): steepest_friction((MountedSeal(seal, sees),), pressure)
        for sees in ('a', 'b', 'difference')
        for pressure in (5e6, 2e7)
    }
    for sees in ('a', 'b', 'difference'):
        assert steepest[sees, 2e7] == pytest.approx(4.0 * steepest[sees, 5e6], rel=1e-6)
        assert steepest[sees, 2e7] == pytest.approx(steepest['a', 2e7], rel=1e-6)
    for asymmetry in (0.3, -0.3):  # 30 % more in one direction
        terms = VelocityTerms(viscous_friction=500.0, asymmetry=asymmetry)
        uneven = dataclasses.replace(SEALS[0].seal, velocity_terms=terms)
        assert steepest_friction((MountedSeal(uneven, 'a'),), 20e6) == pytest.approx(650.0, rel=1e-6)
    assert steepest['a', 2e7] > 300.0  # [N s/m] over the whole range of speeds it is 300 N in 1 m/s


BRAKED = ServoParameters(load=Load(viscous_damping=7.5e4), seals=SEALS, inner_step=5e-5)  # falls by e in 67 us
EVENTS = {  # each within 0.1 ms: friction of 40 N stops 5 kg at 8 m/s2, an open valve adds 15 N
    'rest': (SERVO, {'velocity': 5e-4, 'direction': 1}, 0.0, 0.0, 1e-9),
    'rest from the other side': (SERVO, {'velocity': -5e-4, 'direction': -1}, 0.0, 0.0, 1e-9),
    'rest, braked hard': (BRAKED, {'velocity': 1.472e-3, 'direction': 1}, 0.0, 0.0, 1e-9),
    'end stop': (SERVO, {'position': SERVO.cylinder.limit - 1e-6, 'velocity': 0.02, 'direction': 1}, 0.0, 0.0, 1e-9),
    'breakaway': (SERVO, {'spool': 1.0}, 1.0, outputs(SERVO, plant(SERVO)).breakaway_force - 8.0, 1e-9),
    'breakaway by a valve that opens': (SERVO, {}, 1.0, outputs(SERVO, plant(SERVO)).breakaway_force - 0.007, 1e-9),
    'cavity': (SERVO, {'velocity': 0.2, 'direction': 1, 'charge_a': 0.0}, 0.0, 0.0, 1e-9),
    'collapse': (SERVO, {'velocity': -0.2, 'direction': -1, 'charge_a': -2e5}, 0.0, 0.0, 1e-9),
}


@pytest.mark.parametrize(('servo', 'changes', 'command', 'load_force', 'sharpness'), EVENTS.values(), ids=EVENTS)
def test_the_time_of_an_event_is_that_of_a_bisection_and_not_before_it(servo, changes, command, load_force, sharpness):
    h = 1e-4
    c = Constants(servo.valve, servo.cylinder, servo.load, servo.constants.enthalpies, numbers_of_seals(servo.seals))
    state = plant(servo, **changes)
    y, direction = state[:10], state.direction

    def left(time):
        new = smooth_step(c, y, direction, command, load_force, time)
        return min(margin(c, new, direction, load_force), cavity_margin(c.cylinder, y, new))

    early, late = 0.0, h
    for _ in range(60):
        middle = 0.5 * (early + late)
        early, late = (middle, late) if left(middle) > 0.0 else (early, middle)
    assert 0.1 * h < late < 0.99 * h
    found = time_of_event(c, y, direction, command, load_force, h)
    assert left(found) <= 0.0
    assert late <= found * (1.0 + 1e-12)
    assert found == pytest.approx(late, abs=sharpness * h)


@pytest.mark.parametrize('side', [1, -1])
def test_a_rod_whose_force_turns_round_within_a_step_before_it_moves_is_held_for_this_step(side):
    """1 N above breakaway at the start; the valve takes 100 N in 0.2 ms: all else is as with a locked rod."""
    start = plant(SERVO, spool=-float(side), energy_in=1.0, energy_dissipated=2.0, temperature_a=290.0, transitions=3)
    force = side * (outputs(SERVO, start).breakaway_force + 1.0)
    held = advance(with_inner_step(SERVO, 2e-4), start, -float(side), force)
    locked = advance(with_inner_step(ServoParameters(seals=LOCK), 2e-4), start, -float(side), force)
    assert held == locked._replace(transitions=5)  # broke away, came to rest
    assert (held.position, held.velocity, held.direction) == (0.0, 0.0, 0)
    assert side * (outputs(SERVO, held, load_force=force).force_sum) < -outputs(SERVO, held).breakaway_force
