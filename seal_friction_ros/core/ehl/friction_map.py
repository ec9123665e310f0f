r"""Friction against speed and pressure as a table that the live estimate can afford, and how it is computed.

The table is the steady sliding friction. Two lengths say how it lags: over ``memory_length`` of sliding the film follows
a change of speed, F' = (F_steady - F) / memory_length; over ``presliding_length`` the spool moves before the seal does.
"""

import dataclasses
import math
from bisect import bisect_right
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from seal_friction_ros.core.ehl.case import Case, MapGrid
from seal_friction_ros.core.ehl.contact import ContactState, contact_step
from seal_friction_ros.core.ehl.reynolds import NotConvergedError
from seal_friction_ros.core.ehl.shear import fluid_shear, solid_shear
from seal_friction_ros.core.ehl.transient import Model, rest
from seal_friction_ros.core.validated import check, parameter

FloatArray = npt.NDArray[np.float64]

_PASSAGES = (0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 20.0, 100.0, math.inf)  # steps to the steady film
_MOST_RETRIES = 20
_MEMORY_STEPS = 200


@dataclass(frozen=True)
class FrictionMap:
    """Coulomb friction of one seal from a table over speed and pressure.

    Between the points the table is linear in pressure and in the logarithm of the speed, beyond its ends constant. The law
    without a velocity is the table at ``reference_speed``.

    Raises:
        ValueError: The table is not of the size of its axes, or an axis does not increase.
    """

    speeds: tuple[float, ...] = parameter(unit='m/s', lower=1e-9, upper=1e3, description='Increasing, in equal ratios.')
    pressures: tuple[float, ...] = parameter(unit='Pa', lower=0.0, upper=1e9, description='Gauge, increasing.')
    frictions: tuple[float, ...] = parameter(
        unit='N', lower=0.0, upper=1e6, description='Pressure by pressure, one for each speed.'
    )
    reference_speed: float = parameter(unit='m/s', lower=1e-9, upper=1e3, description='Speed of the plain Coulomb law.')
    memory_length: float = parameter(
        0.0, unit='m', lower=0.0, upper=10.0, description='Sliding over which friction follows a change of speed.'
    )
    presliding_length: float = parameter(
        0.0, unit='m', lower=0.0, upper=1.0, description='Way of the rod before the seal slides: friction over stiffness.'
    )
    _rows: tuple[tuple[float, ...], ...] = field(init=False, repr=False, compare=False)
    _start: float = field(init=False, repr=False, compare=False)
    _rate: float = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        check(self)
        n = len(self.speeds)
        if n < 2 or len(self.pressures) < 2 or len(self.frictions) != n * len(self.pressures):
            raise ValueError(
                f'FrictionMap.frictions has {len(self.frictions)} values for {n} speeds and {len(self.pressures)} pressures'
            )
        for name in ('speeds', 'pressures'):
            values = getattr(self, name)
            if any(b <= a for a, b in zip(values, values[1:], strict=False)):
                raise ValueError(f'FrictionMap.{name} = {list(values)} does not increase')
        start, end = math.log(self.speeds[0]), math.log(self.speeds[-1])
        even = np.linspace(start, end, n)
        if not np.allclose(np.log(self.speeds), even, atol=1e-3 * (end - start) / n, rtol=0.0):
            raise ValueError('FrictionMap.speeds are not in equal ratios')
        rows = tuple(self.frictions[i * n : (i + 1) * n] for i in range(len(self.pressures)))
        object.__setattr__(self, '_rows', rows)
        object.__setattr__(self, '_start', start)
        object.__setattr__(self, '_rate', (n - 1) / (end - start))

    def sliding_friction(self, pressure: float, speed: float) -> float:
        """Magnitude of the steady sliding friction [N] at ``pressure`` [Pa, gauge] and ``speed`` [m/s, >= 0]."""
        last = len(self.speeds) - 1
        column = (math.log(speed) - self._start) * self._rate if speed > self.speeds[0] else 0.0
        j = min(int(column), last - 1)
        along = min(column - j, 1.0)
        pressures = self.pressures
        i = min(max(bisect_right(pressures, pressure) - 1, 0), len(pressures) - 2)
        across = min(max((pressure - pressures[i]) / (pressures[i + 1] - pressures[i]), 0.0), 1.0)
        low, high = self._rows[i], self._rows[i + 1]
        at_low = low[j] + along * (low[j + 1] - low[j])
        at_high = high[j] + along * (high[j + 1] - high[j])
        return at_low + across * (at_high - at_low)

    def coulomb_friction(self, pressure: float) -> float:
        """Magnitude of the sliding friction [N] at ``pressure`` [Pa, gauge] and the reference speed."""
        return self.sliding_friction(pressure, self.reference_speed)

    def lagged(self, friction: float, pressure: float, speed: float, way: float) -> float:
        """Friction [N] after sliding on by ``way`` [m] at ``speed`` [m/s], when it was ``friction`` [N] before."""
        steady = self.sliding_friction(pressure, speed)
        if self.memory_length == 0.0:
            return steady
        return steady + (friction - steady) * math.exp(-way / self.memory_length)


class SteadyFriction(NamedTuple):
    """Steady sliding friction at one pressure, over the speeds of the grid."""

    pressure: float
    """[Pa, gauge] on one side"""
    friction: FloatArray
    """[N] mean of both directions"""
    solid: FloatArray
    """[N] mean of both directions"""
    direction_difference: FloatArray
    """[N] friction towards the pressure less that away from it"""


def map_speeds(grid: MapGrid) -> FloatArray:
    """Speeds of a map [m/s], in equal ratios."""
    return np.geomspace(grid.velocity_min, grid.velocity_max, grid.velocities)


def map_pressures(grid: MapGrid) -> FloatArray:
    """Pressures of a map [Pa], in equal steps from 0."""
    return np.linspace(0.0, grid.pressure_max, grid.pressures)


def _plain(case: Case, pressure: float) -> Case:
    """The case on a plain flooded wall, elastic, with ``pressure`` [Pa] on its left."""
    air = dataclasses.replace(case.air, pressure_left=pressure, pressure_right=0.0)
    return dataclasses.replace(case, air=air, control_edge=None, film_supply=None, viscoelasticity=None)


def _friction(model: Model, state: ContactState, velocity: float) -> tuple[float, float]:
    """Friction and solid friction [N], magnitudes, at a sliding ``velocity`` [m/s]."""
    width = model.contact.half_plane.cell_width
    solid = model.circumference * solid_shear(model.contact, state.gap, model.case.seal.solid_shear_stress)
    wall = -velocity
    fluid = float(fluid_shear(*state, wall, model.case.grease.numbers, width, model.ends()))
    return solid + model.circumference * fluid * math.copysign(1.0, wall), solid


def steady_state(model: Model, start: ContactState, velocity: float) -> ContactState:
    """Film of steady sliding at a ``velocity`` [m/s], by ever longer steps from ``start``, a quarter where one fails.

    Raises:
        NotConvergedError: A step did not converge.
    """
    passage = model.case.numerics.film_width / abs(velocity)
    state = start
    shares = list(reversed(_PASSAGES))
    retried = 0
    while shares:
        old = state.saturation * state.gap
        try:
            step = contact_step(model.contact, state, model.profile, -velocity, model.ends(), old, shares[-1] * passage)
        except NotConvergedError:
            retried += 1
            if retried > _MOST_RETRIES:
                raise
            shares.append(0.25 * min(shares[-1], 1000.0))
            continue
        shares.pop()
        state = step.state
    return state


def steady_friction(case: Case, pressure: float) -> SteadyFriction:
    """Steady sliding friction of a case at one pressure [Pa], both directions, over the speeds of its grid.

    Raises:
        NotConvergedError: A film did not converge; the message says at which speed and pressure.
    """
    model = Model(_plain(case, pressure))
    speeds = map_speeds(case.map)
    values = np.empty((2, 2, len(speeds)))
    begin = rest(model, 0.0).state
    for k, direction in enumerate((1.0, -1.0)):
        state = begin
        for i, speed in enumerate(speeds):
            try:
                state = steady_state(model, state, direction * float(speed))
            except NotConvergedError as error:
                raise NotConvergedError(f'case {case.name} at {speed:.4g} m/s, {pressure:.4g} Pa: {error}') from None
            values[k, :, i] = _friction(model, state, direction * float(speed))
    friction, solid = values.mean(axis=0)
    return SteadyFriction(pressure, friction, solid, values[1, 0] - values[0, 0])


def memory_length(case: Case) -> float:
    """Sliding over which friction follows a change of speed [m], without pressure.

    From steady sliding at a fifth of the highest speed of the motion the speed is set to the highest; the length is that
    of an exponential of the same area, the integral of (F - F_end) / (F_start - F_end) over the way.

    Raises:
        NotConvergedError: A step did not converge.
    """
    model = Model(_plain(case, 0.0))
    fast = case.motion.speed
    state = steady_state(model, rest(model, 0.0).state, 0.2 * fast)
    end = _friction(model, steady_state(model, state, fast), fast)[0]
    step = 4.0 * case.numerics.film_width / fast / _MEMORY_STEPS
    course = [_friction(model, state, fast)[0]]
    for _ in range(_MEMORY_STEPS):
        old = state.saturation * state.gap
        state = contact_step(model.contact, state, model.profile, -fast, model.ends(), old, step).state
        course.append(_friction(model, state, fast)[0])
    over = (np.array(course) - end) / (course[0] - end)
    return float(np.trapezoid(over) * step * fast)


def friction_map(case: Case, rows: list[SteadyFriction], memory: float) -> FrictionMap:
    """The law from its computed rows, one for each pressure of the grid, in any order.

    Raises:
        ValueError: The rows are not those of the grid.
    """
    ordered = sorted(rows, key=lambda row: row.pressure)
    pressures = map_pressures(case.map)
    if len(ordered) != len(pressures) or not np.allclose([row.pressure for row in ordered], pressures):
        raise ValueError('friction_map: the rows are not those of the pressures of the grid')
    return FrictionMap(
        speeds=tuple(map_speeds(case.map).tolist()),
        pressures=tuple(pressures.tolist()),
        frictions=tuple(float(value) for row in ordered for value in row.friction),
        reference_speed=case.motion.speed,
        memory_length=memory,
        presliding_length=float(ordered[0].friction[0]) / case.groove.stiffness,
    )

