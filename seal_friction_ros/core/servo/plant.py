r"""Plant of the servo: valve, cylinder and load with seals; parameters, equations, one inner step.

Oil is in `hydraulics`, air in `pneumatics`, the seals in `friction.actuator`. A Runge-Kutta step of fourth order
integrates the smooth equations between events. An event ends a step early: the rod comes to rest, breaks away or meets
an end stop, a cavity begins or collapses. The time of the event is found inside the step, so a stuck rod has a velocity
of exactly 0.0 and a constant position, to the bit [Karnopp1985]_.

Our choices, none of them in the sources:

- Stuck is a discrete state, without the velocity band of Karnopp: in a simulation the velocity is exact.
- A rod that decelerates asymptotically, for example against a leaking chamber, is at rest below 1 nm/s.
- End stops are rigid and dissipate all of the kinetic energy.
- Input energy and dissipated energy are integrated as states, to check the energy balance.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any, NamedTuple, cast

import numpy as np

from seal_friction_ros.core.foundation.compiled import chosen_by_type, compilable, for_compiler
from seal_friction_ros.core.foundation.parameters import CheckedParameters, parameter
from seal_friction_ros.core.friction.actuator import (
    NO_SEALS,
    MountedSeal,
    breakaway_in,
    friction_of_seals,
    numbers_of_seals,
    sliding_friction_of_seals,
)
from seal_friction_ros.core.servo.cylinder import AMBIENT, Cylinder
from seal_friction_ros.core.servo.hydraulics import (
    ServoValve,
    oil_chamber_rate,
    oil_energy,
    oil_pressures_at_rest,
    oil_rates,
)
from seal_friction_ros.core.servo.pneumatics import (
    ADIABATIC_INDEX,
    PneumaticValve,
    air_chamber_rate,
    air_energy,
    air_pressures_at_rest,
    air_rates,
)

Valve = ServoValve | PneumaticValve  # The valve of a plant. Its type says what the fluid is: oil or air.

CREEP_SPEED = 1e-9  # [m/s] a rod that slides slower than this and decelerates is at rest
MAX_EVENTS = 16  # in one inner step; then the rod is held until its end


@dataclass(frozen=True)
class Load(CheckedParameters):
    """Load of the rod."""

    mass: float = parameter(5.0, unit='kg', lower=1e-3, upper=1e6, description='Piston, rod and load.')
    spring_stiffness: float = parameter(0.0, unit='N/m', lower=0.0, upper=1e9, description='Spring to ground.')
    spring_position: float = parameter(0.0, unit='m', lower=-10.0, upper=10.0, description='Spring rest position.')
    viscous_damping: float = parameter(20.0, unit='N s/m', lower=0.0, upper=1e7, description='Force per speed.')


class Constants(NamedTuple):
    """Parameters of the equations for compiled code."""

    valve: Any  # a `ServoValve` or `PneumaticValve`
    cylinder: Cylinder
    load: Load
    enthalpies: tuple[float, float]  # [Pa] -H of supply and return, see `oil_rates`
    seals: Any  # from `numbers_of_seals`


class PlantState(NamedTuple):
    """State of valve, chambers and rod."""

    position: float  # [m]
    velocity: float  # [m/s] exactly 0.0 while stuck
    charge_a: float
    """[Pa, gauge] pressure of chamber a; of oil, below vapour pressure, a measure of the cavity: `chamber_pressures`"""
    charge_b: float  # [Pa, gauge] the same of chamber b
    spool: float  # [-] -1 to 1; positive opens supply to chamber a
    spool_rate: float  # [1/s]
    energy_in: float  # [J] from supply, return and load force since the start
    energy_dissipated: float  # [J] in valve, leakage, viscous load, seals and end stops
    temperature_a: float  # [K] of the air in chamber a; constant with oil
    temperature_b: float  # [K] the same of chamber b
    direction: int  # -1 or 1: sliding that way; 0: stuck
    transitions: int  # number of times that the rod came to rest or broke away since the start


Integrated = tuple[float, float, float, float, float, float, float, float, float, float]
"""The integrated part of the state: the first ten numbers of `PlantState`."""


def constants(valve: Valve, cylinder: Cylinder, load: Load, seals: tuple[MountedSeal, ...]) -> Constants:
    """Parameters of the equations from the parts of the plant."""
    beta = cylinder.bulk_modulus
    supply, ret = (-beta * math.expm1(-p / beta) for p in (valve.supply_pressure, valve.return_pressure))
    made = for_compiler(Constants(valve, cylinder, load, (0.0, 0.0), numbers_of_seals(seals) or NO_SEALS))
    return cast(Constants, made._replace(enthalpies=(supply, ret)))  # a tuple of numbers would become an array


@compilable
def chamber_pressures(cylinder: Cylinder, y: Sequence[float]) -> tuple[float, float]:
    r"""Pressures of both chambers [Pa, gauge]: their charge, but never below vapour pressure.

    The charge is the pressure of the oil if it filled the whole chamber, beta ln(m / (rho_0 V)). Below vapour pressure,
    oil at vapour pressure fills V exp((charge - vapour) / beta) and a cavity fills the rest. This conserves volume
    through growth and collapse of the cavity.
    """
    return max(y[2], cylinder.vapour), max(y[3], cylinder.vapour)


@compilable
def active_force(cylinder: Cylinder, load: Load, y: Integrated, load_force: float) -> float:
    r"""Axial forces on the rod except seals and end stops [N].

    .. math:: A_a p_a - A_b p_b - k (x - x_k) - b v + F_{load}

    A_a p_a - A_b p_b is written as A_b (p_a - p_b) + (A_a - A_b) p_a, which loses no digits.
    """
    pressure_a, pressure_b = chamber_pressures(cylinder, y)
    spring = load.spring_stiffness * (y[0] - load.spring_position)
    pressing = cylinder.area_b * (pressure_a - pressure_b) + cylinder.rod_area * pressure_a
    return pressing - spring - load.viscous_damping * y[1] + load_force


@compilable
def force_sum(cylinder: Cylinder, load: Load, y: Integrated, load_force: float) -> float:
    """Axial forces on the rod except its seals [N]; 0 where the rod presses on a stop, which then carries it."""
    force = active_force(cylinder, load, y, load_force)
    at_stop = y[1] == 0.0 and abs(y[0]) >= cylinder.limit and y[0] * force > 0.0
    return 0.0 if at_stop else force


fluid_rates = chosen_by_type({ServoValve: oil_rates, PneumaticValve: air_rates})
"""Rates of both chambers from valve, cylinder, enthalpies and the numbers of the state."""


@compilable
def rates(c: Constants, y: Integrated, direction: int, command: float, load_force: float) -> Integrated:
    r"""Time derivatives of the first ten numbers of `PlantState`.

    .. math::
        \dot x &= v, \qquad m \dot v = \Sigma F - d f(p_a, p_b, v) \quad (\text{stuck, } d = 0: \dot x = \dot v = 0) \\
        \ddot s &= \omega^2 (u - s) - 2 \zeta \omega \dot s

    The chambers follow `oil_rates` or `air_rates`.

    Source: [Merritt1967]_ chapter 6.
    """
    valve, load = c.valve, c.load
    velocity, spool, spool_rate = y[1], y[4], y[5]
    a, b = chamber_pressures(c.cylinder, y)
    chambers = fluid_rates(valve, c.cylinder, c.enthalpies, y)
    friction = acceleration = 0.0
    if direction != 0:
        friction = direction * sliding_friction_of_seals(c.seals, a, b, max(velocity * direction, 0.0), direction)
        acceleration = (active_force(c.cylinder, load, y, load_force) - friction) / load.mass
    rubbing = load.viscous_damping * velocity * velocity + friction * velocity
    w = valve.natural_frequency
    return (
        velocity,
        acceleration,
        chambers.pressure_a,
        chambers.pressure_b,
        spool_rate,
        w * (w * (command - spool) - 2.0 * valve.damping_ratio * spool_rate),
        chambers.power_in + load_force * velocity,
        chambers.dissipated + rubbing,
        chambers.temperature_a,
        chambers.temperature_b,
    )


@compilable
def along(y: Integrated, k: Integrated, h: float) -> Integrated:
    """State ``y`` a time ``h`` [s] along the rates ``k``."""
    return (
        y[0] + h * k[0],
        y[1] + h * k[1],
        y[2] + h * k[2],
        y[3] + h * k[3],
        y[4] + h * k[4],
        y[5] + h * k[5],
        y[6] + h * k[6],
        y[7] + h * k[7],
        y[8] + h * k[8],
        y[9] + h * k[9],
    )


@compilable
def smooth_step(c: Constants, y: Integrated, direction: int, command: float, load_force: float, h: float) -> Integrated:
    """Runge-Kutta step of fourth order over ``h`` [s] in one friction state; the spool stops at its ends."""
    k1 = rates(c, y, direction, command, load_force)
    k2 = rates(c, along(y, k1, 0.5 * h), direction, command, load_force)
    k3 = rates(c, along(y, k2, 0.5 * h), direction, command, load_force)
    k4 = rates(c, along(y, k3, h), direction, command, load_force)
    y = along(along(along(along(y, k1, h / 6.0), k2, h / 3.0), k3, h / 3.0), k4, h / 6.0)
    if abs(y[4]) > 1.0:
        return (y[0], y[1], y[2], y[3], math.copysign(1.0, y[4]), 0.0, y[6], y[7], y[8], y[9])
    return y


@compilable
def margin(c: Constants, y: Integrated, direction: int, load_force: float) -> float:
    """Distance of the friction state from its end: stuck ends below zero, sliding ends at zero.

    Stuck: holding force minus force sum [N]. Sliding: the smaller of speed [m/s] and distance to the stop ahead [m].
    The holding force is the breakaway force, or the friction at velocity 0 where this is larger (our choice: otherwise
    the rod would break away and stop at once).
    """
    if direction == 0:
        force = force_sum(c.cylinder, c.load, y, load_force)
        pressure_a, pressure_b = chamber_pressures(c.cylinder, y)
        at_rest = friction_of_seals(c.seals, pressure_a, pressure_b, 0.0)
        ahead = 1 if force > 0.0 else -1
        slowest = sliding_friction_of_seals(c.seals, pressure_a, pressure_b, 0.0, ahead)
        return max(breakaway_in(at_rest, ahead, with_stiction=True), slowest) - abs(force)
    return min(y[1] * direction, c.cylinder.limit - y[0] * direction)


@compilable
def stopped(y: Integrated, position: float, lost: float) -> tuple[Integrated, int]:
    """State and direction of a rod at rest at ``position`` [m] after the loss of an energy ``lost`` [J].

    Compiled code knows a direction from here as a number, and one from a literal 0 as a type of its own, for which it
    would compile the equations again.
    """
    return (position, 0.0, y[2], y[3], y[4], y[5], y[6], y[7] + lost, y[8], y[9]), 0


@compilable
def after_event(c: Constants, y: Integrated, direction: int, load_force: float) -> tuple[Integrated, int]:
    """State and direction after the friction state ended at ``y``.

    A sliding rod comes to rest, at an end stop with the loss of its kinetic energy, and stays at rest unless the force
    sum exceeds the breakaway force; a stuck rod slides in the direction of the force sum.
    """
    if direction != 0:
        position, velocity = y[0], y[1]
        if c.cylinder.limit - position * direction <= 0.0:
            position = c.cylinder.limit * direction
        lost = 0.5 * c.load.mass * velocity * velocity
        y, direction = stopped(y, position, lost)
        if margin(c, y, direction, load_force) >= 0.0:
            return y, direction
    return y, 1 if force_sum(c.cylinder, c.load, y, load_force) > 0.0 else -1


@compilable
def cavity_margin(cylinder: Cylinder, before: Integrated, after: Integrated) -> float:
    """Smaller distance of the charges from vapour pressure [Pa]; negative if one crossed it since ``before``."""
    nearest = 1e12
    for i in (2, 3):
        side = before[i] - cylinder.vapour
        if side != 0.0:
            nearest = min(nearest, math.copysign(1.0, side) * (after[i] - cylinder.vapour))
    return nearest


@compilable
def time_of_event(c: Constants, y: Integrated, direction: int, command: float, load_force: float, h: float) -> float:
    """Time within ``h`` [s] at or just after which the friction state ends or a cavity begins or collapses.

    `margin` and `cavity_margin` must be positive at 0, and one of them not positive at ``h``. Illinois method on the
    smaller of the two; if a cavity begins or collapses, in shares of their values at 0, since their units differ.
    """
    early, late, side = 0.0, h, 0
    margin_early, cavity_early = margin(c, y, direction, load_force), cavity_margin(c.cylinder, y, y)
    new = smooth_step(c, y, direction, command, load_force, h)
    margin_late, cavity_late = margin(c, new, direction, load_force), cavity_margin(c.cylinder, y, new)
    scale = margin_early / cavity_early if cavity_late <= 0.0 else 1.0
    margin_early = min(margin_early, scale * cavity_early)
    margin_late = min(margin_late, scale * cavity_late)
    for _ in range(60):
        if late - early <= 1e-9 * h:
            break
        middle = early + (late - early) * margin_early / (margin_early - margin_late)
        middle = min(max(middle, early + 4e-10 * h), late - 4e-10 * h)
        new = smooth_step(c, y, direction, command, load_force, middle)
        margin_middle = min(margin(c, new, direction, load_force), scale * cavity_margin(c.cylinder, y, new))
        if margin_middle > 0.0:
            early, margin_early = middle, margin_middle
            margin_late *= 0.5 if side == 1 else 1.0
            side = 1
        else:
            late, margin_late = middle, margin_middle
            margin_early *= 0.5 if side == -1 else 1.0
            side = -1
    return late


@compilable
def lasts(margin_now: float, direction: int) -> bool:
    """Whether a friction state goes on: stuck also at a margin of exactly 0, sliding only above 0."""
    return margin_now > 0.0 or (direction == 0 and margin_now == 0.0)


@compilable
def inner_step(c: Constants, state: PlantState, command: float, load_force: float, h: float) -> PlantState:
    """Advance valve, chambers and rod by ``h`` [s] with command [-1 to 1] and load force [N] held.

    A rod that breaks away without motion within the step (no stiction, force at the limit) is held for the rest of the
    step, and so is a rod after `MAX_EVENTS` events. This excludes Zeno behaviour.
    """
    y = state[:10]
    direction, transitions = state.direction, state.transitions
    rest = h
    for _ in range(MAX_EVENTS):
        new = smooth_step(c, y, direction, command, load_force, rest)
        goes_on = lasts(margin(c, new, direction, load_force), direction)
        starts_inside = margin(c, y, direction, load_force) > 0.0
        if goes_on and (cavity_margin(c.cylinder, y, new) > 0.0 or not starts_inside):
            # A rod that decelerates below CREEP_SPEED would come to rest only after infinite time.
            if direction == 0 or new[1] * direction >= min(CREEP_SPEED, y[1] * direction):
                return PlantState(*new, direction, transitions)
            y, rest = new, 0.0
        elif starts_inside:
            before = time_of_event(c, y, direction, command, load_force, rest)
            y = smooth_step(c, y, direction, command, load_force, before)
            rest = rest - before
            if lasts(margin(c, y, direction, load_force), direction):
                continue  # only a cavity began or collapsed
        elif direction != 0:
            break
        was, (y, direction) = direction, after_event(c, y, direction, load_force)
        transitions += 1 if (was == 0) != (direction == 0) else 0
        if rest <= 0.0:
            return PlantState(*y, direction, transitions)
    transitions += 1 if direction != 0 else 0
    y, direction = stopped(y, y[0], 0.0)
    return PlantState(*smooth_step(c, y, direction, command, load_force, rest), direction, transitions)


chamber_energy = chosen_by_type({ServoValve: oil_energy, PneumaticValve: air_energy})
"""Energy in one chamber [J] from its charge [Pa] and volume [m^3]."""


def stored_energy(c: Constants, state: PlantState) -> float:
    r"""Energy in both chambers, mass and spring [J].

    .. math:: E = E_a + E_b + m v^2 / 2 + k (x - x_k)^2 / 2
    """
    load, cylinder = c.load, c.cylinder
    energy = 0.5 * load.mass * state.velocity**2
    energy += 0.5 * load.spring_stiffness * (state.position - load.spring_position) ** 2
    volume_a = cylinder.mid_volume_a + cylinder.area_a * state.position
    volume_b = cylinder.mid_volume_b - cylinder.area_b * state.position
    energy += chamber_energy(c.valve, cylinder, state.charge_a, volume_a)
    energy += chamber_energy(c.valve, cylinder, state.charge_b, volume_b)
    return float(energy)


pressures_at_rest = chosen_by_type({ServoValve: oil_pressures_at_rest, PneumaticValve: air_pressures_at_rest})
"""Pressures of a resting rod without load, valve closed [Pa, gauge], for a valve and a cylinder."""


def fastest_rate(
    valve: Valve, cylinder: Cylinder, load: Load, seals: tuple[MountedSeal, ...] = ()
) -> tuple[float, str]:
    """Largest rate of the equations [1/s], which limits the inner step, and the part of the plant with this rate.

    Spool: its natural frequency. Chamber: `oil_chamber_rate` or `air_chamber_rate`; plus oscillation of the mass on
    oil or air at the stop of chamber a, which has the larger area; plus damping of load and seals.
    """
    if isinstance(valve, PneumaticValve):
        chamber, modulus = air_chamber_rate(valve, cylinder), ADIABATIC_INDEX * (valve.supply_pressure + AMBIENT)
        remedy = 'lower sonic_conductance, laminar_ratio or heat_conductance, or higher dead_volume'
    else:
        chamber, modulus = oil_chamber_rate(valve, cylinder), cylinder.bulk_modulus
        remedy = 'lower rated_flow, or higher dead_volume or transition_pressure'
    smallest, other = cylinder.dead_volume, 2.0 * cylinder.mid_volume_b - cylinder.dead_volume
    springs = cylinder.area_a**2 / smallest + cylinder.area_b**2 / other
    stiffness = modulus * springs + load.spring_stiffness
    damping = (load.viscous_damping + steepest_friction(seals, valve.supply_pressure)) / load.mass
    oscillation = math.sqrt(stiffness / load.mass) + damping
    spool = valve.natural_frequency * max(1.0, 2.0 * valve.damping_ratio)
    fluid = chamber + oscillation
    text = f'chamber and orifice {chamber:.4g} 1/s ({remedy}) plus oscillation and damping {oscillation:.4g} 1/s'
    return (spool, 'spool of the valve') if spool > fluid else (fluid, text)


def steepest_friction(seals: tuple[MountedSeal, ...], highest_pressure: float) -> float:
    """Largest slope of the seal friction over speed [N s/m], on a grid of speeds and pressures (our choice).

    Both chambers have the pressure, or chamber a alone, for seals that see the difference.
    """
    if not any(mounted.seal.depends_on_velocity for mounted in seals):
        return 0.0
    numbers, speeds = numbers_of_seals(seals), np.geomspace(1e-6, 10.0, 141)
    steepest = 0.0
    for p, share, direction in product(np.linspace(0.0, highest_pressure, 5).tolist(), (1.0, 0.0), (-1, 1)):
        friction = [sliding_friction_of_seals(numbers, p, share * p, v, direction) for v in speeds.tolist()]
        steepest = max(steepest, float(np.max(np.diff(friction) / np.diff(speeds))))
    return steepest
