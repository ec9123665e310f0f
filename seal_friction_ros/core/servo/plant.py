r"""Plant of the servo: valve, cylinder and load with seals; parameters, equations, one inner step.

Source: valve [Merritt1967]_ chapter 5, cylinder chapter 6; seals as in `friction.actuator`. A Runge-Kutta step of
fourth order integrates the smooth equations between events. An event ends a step early: the rod comes to rest, breaks
away or meets an end stop, a cavity begins or collapses. The time of the event is found inside the step, so a stuck rod
has a velocity of exactly 0.0 and a constant position, to the bit [Karnopp1985]_.

Our choices, none of them in the sources:

- Stuck is a discrete state, without the velocity band of Karnopp: in a simulation the velocity is exact.
- A rod that decelerates asymptotically, for example against a leaking chamber, is at rest below 1 nm/s.
- End stops are rigid and dissipate all of the kinetic energy.
- A chamber that is emptied faster than it is filled holds a cavity at vapour pressure (see `chamber_pressures`).
- Below ``transition_pressure`` an orifice is laminar (see `signed_root`).
- Input energy and dissipated energy are integrated as states, to check the energy balance.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any, ClassVar, NamedTuple, cast

import numpy as np

from seal_friction_ros.core.foundation.compiled import compiled, for_compiler
from seal_friction_ros.core.foundation.parameters import CheckedParameters, parameter
from seal_friction_ros.core.foundation.units import INCH, PSI
from seal_friction_ros.core.friction.actuator import (
    NO_SEALS,
    MountedSeal,
    friction_of_seals,
    numbers_of_seals,
    sliding_friction_of_seals,
)

AMBIENT = 101325.0  # [Pa, absolute] zero of gauge pressure
CREEP_SPEED = 1e-9  # [m/s] a rod that slides slower than this and decelerates is at rest
MAX_EVENTS = 16  # in one inner step; then the rod is held until its end


@dataclass(frozen=True)
class ServoValve(CheckedParameters):
    """Four-way servo valve with critical lap, and its supply pressure.

    Raises:
        ValueError: A value is out of bounds, or supply is below return pressure.
    """

    supply_pressure: float = parameter(1000.0 * PSI, unit='Pa', lower=0.0, upper=1e8, description='Supply, gauge.')
    return_pressure: float = parameter(1e5, unit='Pa', lower=0.0, upper=1e8, description='Return, gauge.')
    rated_flow: float = parameter(2.5e-5, unit='m3/s', lower=1e-8, upper=0.1, description='Fully open, at rated drop.')
    rated_pressure_drop: float = parameter(
        1000.0 * PSI, unit='Pa', lower=1e4, upper=1e8, description='Pressure drop over both lands for the rated flow.'
    )
    natural_frequency: float = parameter(1257.0, unit='rad/s', lower=1.0, upper=1e5, description='Spool, undamped.')
    damping_ratio: float = parameter(0.8, unit='1', lower=0.05, upper=10.0, description='Damping ratio of the spool.')
    null_leakage: float = parameter(
        6e-14, unit='m3/(s Pa)', lower=0.0, upper=1e-9, description='Laminar leakage of each of the four lands.'
    )
    transition_pressure: float = parameter(
        3e5, unit='Pa', lower=1e3, upper=1e7, description='Pressure drop below which an orifice is laminar.'
    )

    COMPILED: ClassVar = (
        'supply_pressure', 'return_pressure', 'natural_frequency', 'damping_ratio', 'null_leakage',
        'transition_pressure', 'orifice_gain',
    )  # fmt: skip

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.supply_pressure < self.return_pressure:
            raise ValueError(
                f'ServoValve.supply_pressure = {self.supply_pressure} Pa is below '
                f'return_pressure = {self.return_pressure} Pa'
            )

    @property
    def orifice_gain(self) -> float:
        """K of one fully open land, Q = K sqrt(dp) [m^3/(s Pa^0.5)]: each land takes half of the rated drop."""
        return self.rated_flow / math.sqrt(self.rated_pressure_drop / 2.0)


@dataclass(frozen=True)
class Cylinder(CheckedParameters):
    """Balanced cylinder: the rod goes through both ends, so both chambers have the same area.

    The stroke runs from -stroke/2 to +stroke/2; chamber a extends the rod (positive).

    Raises:
        ValueError: A value is out of bounds, the bore is not wider than the rod, or the dead volume is too small.
    """

    rod_diameter: float = parameter(0.625 * INCH, unit='m', lower=1e-4, upper=1.0, description='Rod diameter.')
    bore_diameter: float = parameter(0.75 * INCH, unit='m', lower=1e-4, upper=2.0, description='Bore diameter.')
    stroke: float = parameter(0.05, unit='m', lower=1e-4, upper=10.0, description='Distance between the stops.')
    dead_volume: float = parameter(
        2e-6, unit='m3', lower=1e-9, upper=1.0, description='Volume of each chamber, with its line, at its stop.'
    )
    internal_leakage: float = parameter(
        1e-14, unit='m3/(s Pa)', lower=0.0, upper=1e-8, description='Laminar leakage past the piston.'
    )
    external_leakage: float = parameter(
        0.0, unit='m3/(s Pa)', lower=0.0, upper=1e-8, description='Laminar leakage of each chamber to ambient.'
    )
    bulk_modulus: float = parameter(7e8, unit='Pa', lower=1e7, upper=5e9, description='Effective: oil, lines, walls.')
    vapour_pressure: float = parameter(1e3, unit='Pa', lower=1.0, upper=1e5, description='Of the oil, absolute.')

    COMPILED: ClassVar = (
        'area', 'limit', 'mid_volume', 'internal_leakage', 'external_leakage', 'bulk_modulus', 'vapour',
    )  # fmt: skip

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.bore_diameter <= self.rod_diameter:
            raise ValueError(
                f'Cylinder.bore_diameter = {self.bore_diameter} m is not above rod_diameter = {self.rod_diameter} m'
            )
        if self.dead_volume < 0.01 * self.area * self.stroke:
            raise ValueError(
                f'Cylinder.dead_volume = {self.dead_volume} m3 is below 1 % of the swept volume '
                f'{self.area * self.stroke:.3g} m3: a chamber without volume is infinitely stiff'
            )

    @property
    def area(self) -> float:
        """Piston area of each chamber [m^2]: A = pi/4 (D_bore^2 - D_rod^2)."""
        return math.pi / 4.0 * (self.bore_diameter**2 - self.rod_diameter**2)

    @property
    def total_volume(self) -> float:
        """Volume of both chambers [m^3], the same at every position: V_t = A stroke + 2 V_dead."""
        return self.area * self.stroke + 2.0 * self.dead_volume

    @property
    def mid_volume(self) -> float:
        """Volume of one chamber at position 0 [m^3]."""
        return self.total_volume / 2.0

    @property
    def limit(self) -> float:
        """Position of the stops [m]."""
        return self.stroke / 2.0

    @property
    def vapour(self) -> float:
        """Vapour pressure [Pa, gauge]."""
        return self.vapour_pressure - AMBIENT


@dataclass(frozen=True)
class Load(CheckedParameters):
    """Load of the rod."""

    mass: float = parameter(5.0, unit='kg', lower=1e-3, upper=1e6, description='Piston, rod and load.')
    spring_stiffness: float = parameter(0.0, unit='N/m', lower=0.0, upper=1e9, description='Spring to ground.')
    spring_position: float = parameter(0.0, unit='m', lower=-10.0, upper=10.0, description='Spring rest position.')
    viscous_damping: float = parameter(20.0, unit='N s/m', lower=0.0, upper=1e7, description='Force per speed.')


class Constants(NamedTuple):
    """Parameters of the equations for compiled code."""

    valve: ServoValve
    cylinder: Cylinder
    load: Load
    supply_enthalpy: float  # [Pa] -H(p), see `rates`
    return_enthalpy: float  # [Pa] the same at return pressure
    seals: Any  # from `numbers_of_seals`


class PlantState(NamedTuple):
    """State of valve, chambers and rod."""

    position: float  # [m]
    velocity: float  # [m/s] exactly 0.0 while stuck
    charge_a: float
    """[Pa, gauge] pressure of chamber a; below vapour pressure a measure of the cavity, see `chamber_pressures`"""
    charge_b: float  # [Pa, gauge] the same of chamber b
    spool: float  # [-] -1 to 1; positive opens supply to chamber a
    spool_rate: float  # [1/s]
    energy_in: float  # [J] from supply, return and load force since the start
    energy_dissipated: float  # [J] in valve, leakage, viscous load, seals and end stops
    direction: int  # -1 or 1: sliding that way; 0: stuck
    transitions: int  # number of times that the rod came to rest or broke away since the start


Integrated = tuple[float, float, float, float, float, float, float, float]
"""The integrated part of the state: the first eight numbers of `PlantState`."""


def constants(valve: ServoValve, cylinder: Cylinder, load: Load, seals: tuple[MountedSeal, ...]) -> Constants:
    """Parameters of the equations from the parts of the plant."""
    beta = cylinder.bulk_modulus
    supply, ret = (-beta * math.expm1(-p / beta) for p in (valve.supply_pressure, valve.return_pressure))
    plant = Constants(valve, cylinder, load, supply, ret, numbers_of_seals(seals) or NO_SEALS)
    return cast(Constants, for_compiler(plant))


@compiled
def signed_root(drop: float, transition: float) -> float:
    r"""Root of a pressure drop with its sign, laminar (finite slope) near zero.

    .. math:: \sqrt{|\Delta p|}\,\mathrm{sgn}(\Delta p) \text{ for } |\Delta p| \ge p_t, \quad
        \sqrt{p_t}\, r (5 - r^2) / 4,\; r = \Delta p / p_t \text{ below}

    Source: two flow regimes as in [Ellman1999]_; the cubic, which meets value and slope of the root, is our choice.
    """
    if drop >= transition:
        return math.sqrt(drop)
    if drop <= -transition:
        return -math.sqrt(-drop)
    r = drop / transition
    return math.sqrt(transition) * r * (5.0 - r * r) / 4.0


@compiled
def chamber_pressures(c: Constants, y: Sequence[float]) -> tuple[float, float]:
    r"""Pressures of both chambers [Pa, gauge]: their charge, but never below vapour pressure.

    The charge is the pressure of the oil if it filled the whole chamber, beta ln(m / (rho_0 V)). Below vapour pressure,
    oil at vapour pressure fills V exp((charge - vapour) / beta) and a cavity fills the rest. This conserves volume
    through growth and collapse of the cavity.
    """
    return max(y[2], c.cylinder.vapour), max(y[3], c.cylinder.vapour)


@compiled
def active_force(c: Constants, y: Integrated, load_force: float) -> float:
    r"""Axial forces on the rod except seals and end stops [N].

    .. math:: A (p_a - p_b) - k (x - x_k) - b v + F_{load}
    """
    pressure_a, pressure_b = chamber_pressures(c, y)
    spring = c.load.spring_stiffness * (y[0] - c.load.spring_position)
    return c.cylinder.area * (pressure_a - pressure_b) - spring - c.load.viscous_damping * y[1] + load_force


@compiled
def force_sum(c: Constants, y: Integrated, load_force: float) -> float:
    """Axial forces on the rod except its seals [N]; 0 where the rod presses on a stop, which then carries it."""
    force = active_force(c, y, load_force)
    at_stop = y[1] == 0.0 and abs(y[0]) >= c.cylinder.limit and y[0] * force > 0.0
    return 0.0 if at_stop else force


@compiled
def port_flow(c: Constants, opening: float, outside: float, pressure: float) -> float:
    """Flow into a chamber through one land [m^3/s]: orifice and null leakage.

    Source: [Merritt1967]_ chapter 5.
    """
    drop = outside - pressure
    return c.valve.orifice_gain * opening * signed_root(drop, c.valve.transition_pressure) + c.valve.null_leakage * drop


@compiled
def rates(c: Constants, y: Integrated, direction: int, command: float, load_force: float) -> Integrated:
    r"""Time derivatives of the first eight numbers of `PlantState`.

    .. math::
        \dot x &= v, \qquad m \dot v = \Sigma F - d f(p_a, p_b, v) \quad (\text{stuck, } d = 0: \dot x = \dot v = 0) \\
        \dot p_a &= \beta / V_a\, (Q_a - C_i (p_a - p_b) - C_e p_a - A v), \quad V_a = V_t/2 + A x \\
        \ddot s &= \omega^2 (u - s) - 2 \zeta \omega \dot s

    With constant bulk modulus a volume V of oil stores the energy V (H - p), with H(p) = beta (exp(p / beta) - 1) the
    enthalpy per volume at p, and a flow Q carries the power H Q. A flow through a land brings the enthalpy of the other
    side; the difference to the enthalpy of the chamber is dissipated in the land.

    Source: [Merritt1967]_ chapters 5 and 6; the energy is our derivation.
    """
    valve, cylinder, load = c.valve, c.cylinder, c.load
    position, velocity, charge_a, charge_b, spool, spool_rate = y[0], y[1], y[2], y[3], y[4], y[5]
    beta, vapour = cylinder.bulk_modulus, cylinder.vapour
    a, b = chamber_pressures(c, y)
    to_a, to_b = max(spool, 0.0), max(-spool, 0.0)
    supply, ret = valve.supply_pressure, valve.return_pressure
    supply_a, return_a = port_flow(c, to_a, supply, a), port_flow(c, to_b, ret, a)
    supply_b, return_b = port_flow(c, to_b, supply, b), port_flow(c, to_a, ret, b)
    past_piston = cylinder.internal_leakage * (a - b)
    flow_a = supply_a + return_a - past_piston - cylinder.external_leakage * a
    flow_b = supply_b + return_b + past_piston - cylinder.external_leakage * b

    swept = cylinder.area * velocity
    oil_a = cylinder.mid_volume + cylinder.area * position
    oil_b = cylinder.mid_volume - cylinder.area * position
    charge_flow_a = flow_a if charge_a >= vapour else flow_a * math.exp((vapour - charge_a) / beta)
    charge_flow_b = flow_b if charge_b >= vapour else flow_b * math.exp((vapour - charge_b) / beta)

    friction = acceleration = 0.0
    if direction != 0:
        friction = direction * sliding_friction_of_seals(c.seals, a, b, max(velocity * direction, 0.0), direction)
        acceleration = (active_force(c, y, load_force) - friction) / load.mass

    density_a, density_b = math.exp(a / beta), math.exp(b / beta)
    power_in = density_a * (supply_a * c.supply_enthalpy + return_a * c.return_enthalpy) + density_b * (
        supply_b * c.supply_enthalpy + return_b * c.return_enthalpy
    )
    into_chambers = beta * ((density_a - 1.0) * flow_a + (density_b - 1.0) * flow_b)
    rubbing = load.viscous_damping * velocity * velocity + friction * velocity
    w = valve.natural_frequency
    return (
        velocity,
        acceleration,
        beta / oil_a * (charge_flow_a - swept),
        beta / oil_b * (charge_flow_b + swept),
        spool_rate,
        w * (w * (command - spool) - 2.0 * valve.damping_ratio * spool_rate),
        power_in + load_force * velocity,
        power_in - into_chambers + rubbing,
    )


@compiled
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
    )


@compiled
def smooth_step(c: Constants, y: Integrated, direction: int, command: float, load_force: float, h: float) -> Integrated:
    """Runge-Kutta step of fourth order over ``h`` [s] in one friction state; the spool stops at its ends."""
    k1 = rates(c, y, direction, command, load_force)
    k2 = rates(c, along(y, k1, 0.5 * h), direction, command, load_force)
    k3 = rates(c, along(y, k2, 0.5 * h), direction, command, load_force)
    k4 = rates(c, along(y, k3, h), direction, command, load_force)
    y = along(along(along(along(y, k1, h / 6.0), k2, h / 3.0), k3, h / 3.0), k4, h / 6.0)
    if abs(y[4]) > 1.0:
        return (y[0], y[1], y[2], y[3], math.copysign(1.0, y[4]), 0.0, y[6], y[7])
    return y


@compiled
def margin(c: Constants, y: Integrated, direction: int, load_force: float) -> float:
    """Distance of the friction state from its end: stuck ends below zero, sliding ends at zero.

    Stuck: holding force minus force sum [N]. Sliding: the smaller of speed [m/s] and distance to the stop ahead [m].
    The holding force is the breakaway force, or the friction at velocity 0 where this is larger (our choice: otherwise
    the rod would break away and stop at once).
    """
    if direction == 0:
        force = force_sum(c, y, load_force)
        pressure_a, pressure_b = chamber_pressures(c, y)
        at_rest = friction_of_seals(c.seals, pressure_a, pressure_b, 0.0)
        slowest = sliding_friction_of_seals(c.seals, pressure_a, pressure_b, 0.0, 1 if force > 0.0 else -1)
        return max(at_rest.coulomb_friction + at_rest.stiction, slowest) - abs(force)
    return min(y[1] * direction, c.cylinder.limit - y[0] * direction)


@compiled
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
        y = (position, 0.0, y[2], y[3], y[4], y[5], y[6], y[7] + lost)
        if margin(c, y, 0, load_force) >= 0.0:
            return y, 0
    return y, 1 if force_sum(c, y, load_force) > 0.0 else -1


@compiled
def cavity_margin(c: Constants, before: Integrated, after: Integrated) -> float:
    """Smaller distance of the charges from vapour pressure [Pa]; negative if one crossed it since ``before``."""
    nearest = 1e12
    for i in (2, 3):
        side = before[i] - c.cylinder.vapour
        if side != 0.0:
            nearest = min(nearest, math.copysign(1.0, side) * (after[i] - c.cylinder.vapour))
    return nearest


@compiled
def time_of_event(c: Constants, y: Integrated, direction: int, command: float, load_force: float, h: float) -> float:
    """Time within ``h`` [s] at or just after which the friction state ends or a cavity begins or collapses.

    The smaller of `margin` and `cavity_margin` must be positive at 0 and not positive at ``h``. Illinois method.
    """
    early, late, side = 0.0, h, 0
    margin_early = min(margin(c, y, direction, load_force), cavity_margin(c, y, y))
    new = smooth_step(c, y, direction, command, load_force, h)
    margin_late = min(margin(c, new, direction, load_force), cavity_margin(c, y, new))
    for _ in range(60):
        if late - early <= 1e-9 * h:
            break
        middle = early + (late - early) * margin_early / (margin_early - margin_late)
        middle = min(max(middle, early + 4e-10 * h), late - 4e-10 * h)
        new = smooth_step(c, y, direction, command, load_force, middle)
        margin_middle = min(margin(c, new, direction, load_force), cavity_margin(c, y, new))
        if margin_middle > 0.0:
            early, margin_early = middle, margin_middle
            margin_late *= 0.5 if side == 1 else 1.0
            side = 1
        else:
            late, margin_late = middle, margin_middle
            margin_early *= 0.5 if side == -1 else 1.0
            side = -1
    return late


@compiled
def lasts(margin_now: float, direction: int) -> bool:
    """Whether a friction state goes on: stuck also at a margin of exactly 0, sliding only above 0."""
    return margin_now > 0.0 or (direction == 0 and margin_now == 0.0)


@compiled
def inner_step(c: Constants, state: PlantState, command: float, load_force: float, h: float) -> PlantState:
    """Advance valve, chambers and rod by ``h`` [s] with command [-1 to 1] and load force [N] held.

    A rod that breaks away without motion within the step (no stiction, force at the limit) is held for the rest of the
    step, and so is a rod after `MAX_EVENTS` events. This excludes Zeno behaviour.
    """
    y = state[:8]
    direction, transitions = state.direction, state.transitions
    rest = h
    for _ in range(MAX_EVENTS):
        new = smooth_step(c, y, direction, command, load_force, rest)
        goes_on = lasts(margin(c, new, direction, load_force), direction)
        starts_inside = margin(c, y, direction, load_force) > 0.0
        if goes_on and (cavity_margin(c, y, new) > 0.0 or not starts_inside):
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
    y = (y[0], 0.0, y[2], y[3], y[4], y[5], y[6], y[7])
    transitions += 1 if direction != 0 else 0
    return PlantState(*smooth_step(c, y, 0, command, load_force, rest), 0, transitions)


@compiled
def stored_energy(c: Constants, state: PlantState) -> float:
    r"""Energy in both chambers, mass and spring [J].

    .. math:: E = \sum_{a,b} [V_{oil} (H(p) - p) - p V_{cavity}] + m v^2 / 2 + k (x - x_k)^2 / 2
    """
    beta, load = c.cylinder.bulk_modulus, c.load
    energy = 0.5 * load.mass * state.velocity**2
    energy += 0.5 * load.spring_stiffness * (state.position - load.spring_position) ** 2
    pressure_a, pressure_b = chamber_pressures(c, state[:8])
    for charge, pressure, side in ((state.charge_a, pressure_a, 1.0), (state.charge_b, pressure_b, -1.0)):
        volume = c.cylinder.mid_volume + side * c.cylinder.area * state.position
        oil = volume * math.exp((charge - pressure) / beta)
        energy += oil * (beta * math.expm1(pressure / beta) - pressure) - pressure * (volume - oil)
    return energy


def fastest_rate(
    valve: ServoValve, cylinder: Cylinder, load: Load, seals: tuple[MountedSeal, ...] = ()
) -> tuple[float, str]:
    """Largest rate of the equations [1/s], which limits the inner step, and the part of the plant with this rate.

    Spool: its natural frequency. Chamber: slope of a laminar orifice, 5/4 K / sqrt(p_t), and leakages, over the
    smallest volume; plus oscillation of the mass on the oil at a stop; plus damping of load and seals.
    """
    beta, volume = cylinder.bulk_modulus, cylinder.dead_volume
    slope = 1.25 * valve.orifice_gain / math.sqrt(valve.transition_pressure)
    leakage = 2.0 * valve.null_leakage + 2.0 * cylinder.internal_leakage + cylinder.external_leakage
    largest = cylinder.total_volume - volume
    stiffness = beta * cylinder.area**2 * (1.0 / volume + 1.0 / largest) + load.spring_stiffness
    damping = (load.viscous_damping + steepest_friction(seals, valve.supply_pressure)) / load.mass
    oscillation = math.sqrt(stiffness / load.mass) + damping
    chamber = beta / volume * (slope + leakage)
    spool = valve.natural_frequency * max(1.0, 2.0 * valve.damping_ratio)
    hydraulics = chamber + oscillation
    text = (
        f'chamber and orifice {chamber:.4g} 1/s (lower rated_flow, or higher dead_volume or transition_pressure) '
        f'plus hydraulic oscillation and damping {oscillation:.4g} 1/s'
    )
    return (spool, 'spool of the valve') if spool > hydraulics else (hydraulics, text)


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
