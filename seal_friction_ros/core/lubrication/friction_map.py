"""The friction map of a case: steady friction over speed and pressure, and its memory length."""

import dataclasses
import math
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy.integrate import trapezoid

from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.foundation.errors import NotConvergedError, named_errors
from seal_friction_ros.core.friction.laws.friction_map import FrictionMap
from seal_friction_ros.core.lubrication.contact import ContactState, contact_step
from seal_friction_ros.core.lubrication.lubrication_case import LubricationCase, MapGrid
from seal_friction_ros.core.lubrication.model import (
    LubricationModel,
    film_at_rest,
    fluid_force,
    profile_model,
    real_area_share,
    solid_limit,
)
from seal_friction_ros.core.lubrication.oring_film import oring_film, oring_films
from seal_friction_ros.core.oring_contact.ring_friction import DISCRETISATION

_PASSAGES = (0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 20.0, 100.0, math.inf)  # steps to the steady film
_MOST_RETRIES = 20
_MEMORY_STEPS = 200
_LONG_PASSAGES = 250.0  # a step of so many is nearly one to the steady film
PERCOLATION = 0.42
"""[-] real contact above which the contact leaves the lubricant no way through.

Source: W. B. Dapp, A. Lücke, B. N. J. Persson, M. H. Müser 2012: the flow ends where the contact percolates."""
THINNEST_OF_CLOSURES = 0.5  # [-] gap over rms roughness from which the flow factors of Patir and Cheng hold


class SteadyFriction(NamedTuple):
    """Steady sliding friction at one pressure, over n speeds; at several pressures each field has one more axis."""

    pressure: Any  # [Pa, gauge] on one side
    friction: FloatArray  # [N] mean of both directions, shape (n,)
    solid: FloatArray  # [N] mean of both directions, shape (n,)
    direction_difference: FloatArray  # [N] friction towards the pressure less that away from it, shape (n,)
    stiffness: Any  # [N/m] of seal and groove against axial motion of the contact
    retried_steps: Any
    real_contact: Any = 0.0  # [-] largest share of the seal that touches, at rest
    thinnest: Any = math.inf  # [-] smallest gap over the rms roughness, at rest


def stacked(rows: Iterable[SteadyFriction]) -> SteadyFriction:
    """Rows at several pressures as one record, each field over the pressures."""
    return SteadyFriction(*(np.array(column) for column in zip(*rows, strict=True)))


class MemoryLength(NamedTuple):
    """Travel over which friction follows a change of speed."""

    length: float  # [m] of sliding
    retried_steps: int


def map_speeds(grid: MapGrid) -> FloatArray:
    """Speeds of a map [m/s], in equal ratios."""
    return np.geomspace(grid.velocity_min, grid.velocity_max, grid.velocities)


def map_pressures(grid: MapGrid) -> FloatArray:
    """Pressures of a map [Pa], in equal steps from 0."""
    return np.linspace(0.0, grid.pressure_max, grid.pressures)


def _at_rest(case: LubricationCase, pressure: float) -> tuple[LubricationModel, ContactState, float]:
    """The seal of a case at rest on a plain flooded wall, ``pressure`` [Pa] on its left; its axial stiffness [N/m]."""
    if case.oring is not None:
        return oring_film(case, case.oring, pressure)
    model = profile_model(case, pressure, 0.0)
    return model, film_at_rest(model), case.groove.stiffness


def _friction(model: LubricationModel, state: ContactState, velocity: float) -> tuple[float, float]:
    """Friction and solid friction [N], magnitudes, at a sliding ``velocity`` [m/s]."""
    solid = solid_limit(model, state)
    return solid + math.copysign(1.0, velocity) * fluid_force(model, state, velocity), solid


def _slid(
    model: LubricationModel, start: ContactState, velocity: float, durations: Sequence[float]
) -> tuple[ContactState, list[ContactState], int]:
    """Sliding at a ``velocity`` [m/s] by implicit Euler steps of ``durations`` [s]; one that fails is taken in halves.

    An infinite step, to the steady film, is taken again after a finite one. Returns the last state, that after each of
    the durations, and how many steps failed. NotConvergedError: more than 20 steps failed.
    """
    state, states, retried = start, [], 0
    for duration in durations:
        left = [duration]
        while left:
            old = state.saturation * state.gap
            try:
                done = contact_step(model.contact, state, model.profile, -velocity, model.ends(), old, left[-1])
            except NotConvergedError:
                retried += 1
                if retried > _MOST_RETRIES:
                    raise
                failed = left.pop()
                if math.isinf(failed):
                    left += [failed, _LONG_PASSAGES * model.film_width / abs(velocity)]
                else:
                    left += [0.5 * failed, 0.5 * failed]
                continue
            left.pop()
            state = done.state
        states.append(state)
    return state, states, retried


def steady_state(model: LubricationModel, start: ContactState, velocity: float) -> tuple[ContactState, int]:
    """Film of steady sliding at a ``velocity`` [m/s] by ever longer steps from ``start``; how many steps failed.

    NotConvergedError: more than 20 steps failed.
    """
    passage = model.film_width / abs(velocity)
    state, _, retried = _slid(model, start, velocity, [share * passage for share in _PASSAGES])
    return state, retried


def steady_friction(case: LubricationCase, pressure: float) -> SteadyFriction:
    """Steady sliding friction of a case at one pressure [Pa], both directions, over the speeds of its grid.

    NotConvergedError: a film did not converge; the message says at which speed and pressure.
    """
    return _steady(case, pressure, _at_rest(case, pressure))


def steady_table(case: LubricationCase) -> SteadyFriction:
    """`steady_friction` at the pressures of the grid; an O-ring is loaded once, from pressure to pressure."""
    pressures = tuple(map_pressures(case.map).tolist())
    if case.oring is None:
        return stacked(steady_friction(case, pressure) for pressure in pressures)
    films = oring_films(case, case.oring, pressures)
    return stacked(_steady(case, pressure, film) for pressure, film in zip(pressures, films, strict=True))


def _steady(
    case: LubricationCase, pressure: float, rest: tuple[LubricationModel, ContactState, float]
) -> SteadyFriction:
    model, begin, stiffness = rest
    real_contact = float(real_area_share(model.contact, begin.gap).max())
    thinnest = float(begin.gap.min()) / case.topography.rms_height
    speeds = map_speeds(case.map)
    values = np.empty((2, 2, len(speeds)))
    retried = 0
    for k, direction in enumerate((1.0, -1.0)):
        state = begin
        for i, speed in enumerate(speeds):
            where = f'case {case.name} at {speed:.4g} m/s, {pressure:.4g} Pa'
            with named_errors(where, NotConvergedError, NotConvergedError):
                state, more = steady_state(model, state, direction * float(speed))
            retried += more
            values[k, :, i] = _friction(model, state, direction * float(speed))
    friction, solid = values.mean(axis=0)
    return SteadyFriction(
        pressure, friction, solid, values[1, 0] - values[0, 0], stiffness, retried, real_contact, thinnest
    )


def memory_length(case: LubricationCase) -> MemoryLength:
    """Sliding over which friction follows a change of speed [m], without pressure.

    From steady sliding at a fifth of the highest speed of the motion the speed is set to the highest; the length is
    that of an exponential of the same area, the integral of (F - F_end) / (F_start - F_end) over the way.
    NotConvergedError: a step did not converge.
    """
    model, start, _ = _at_rest(case, 0.0)
    fast = case.motion.speed
    slow, first = steady_state(model, start, 0.2 * fast)
    steady, second = steady_state(model, slow, fast)
    step = 4.0 * model.film_width / fast / _MEMORY_STEPS
    _, states, third = _slid(model, slow, fast, [step] * _MEMORY_STEPS)
    course = np.array([_friction(model, state, fast)[0] for state in (slow, *states)])
    end = _friction(model, steady, fast)[0]
    over = (course - end) / (course[0] - end)
    return MemoryLength(float(trapezoid(over) * step * fast), first + second + third)


def friction_map(case: LubricationCase, table: SteadyFriction, memory: float) -> FrictionMap:
    """The law from its table, of each pressure of the grid, in any order.

    The presliding length is friction over stiffness at 0 Pa. An O-ring that no pressure holds on its wall rolls, so its
    length is that of the next pressure (our choice). ValueError: the pressures are not those of the grid.
    """
    order, pressures = np.argsort(table.pressure), map_pressures(case.map)
    if len(order) != len(pressures) or not np.allclose(table.pressure[order], pressures):
        raise ValueError('friction_map: the rows are not those of the pressures of the grid')
    held = order[1 if case.oring else 0]
    return FrictionMap(
        speeds=tuple(map_speeds(case.map).tolist()),
        pressures=tuple(pressures.tolist()),
        frictions=tuple(table.friction[order].ravel().tolist()),
        reference_speed=case.motion.speed,
        memory_length=memory,
        presliding_length=float(table.friction[held, 0] / table.stiffness[held]),
    )


def carries_film(table: SteadyFriction) -> bool:
    """Whether lubricant gets under the seal at every pressure: no real contact at rest is above `PERCOLATION`."""
    return bool(table.real_contact.max() <= PERCOLATION)


def live_map(law: FrictionMap, table: SteadyFriction) -> FrictionMap:
    """The map that a seal file has: without the speeds where the contact carries no film.

    There the film that the model computes has no way in, and the change with speed that follows from it is refuted:
    docs/ehl.md. The friction is that at the reference speed, with no length over which it follows a change of speed.
    Where the friction at the reference speed falls from one pressure to the next by less than `DISCRETISATION`, the
    row is raised to the one before: rubber under more pressure does not rub less.
    """
    if carries_film(table):
        return dataclasses.replace(law, frictions=_levelled(law))
    at_reference = tuple(law.coulomb_friction(pressure) for pressure in law.pressures)
    law = dataclasses.replace(
        law,
        speeds=(law.reference_speed,),
        frictions=at_reference,
        memory_length=0.0,
        presliding_length=law.presliding_length * at_reference[0] / law.frictions[0],
    )
    return dataclasses.replace(law, frictions=_levelled(law))


def pressure_asymmetry(law: FrictionMap, table: SteadyFriction) -> float:
    """Share by which the friction is larger towards the highest pressure than the mean [-], and smaller away from it.

    Half the difference of the directions over their sum at the reference speed grows with the pressure; the share is
    that at the highest pressure of the line through 0 that fits it best (least squares).
    """
    loaded = table.pressure / law.pressures[-1]
    towards, away = directions(law, table)
    uneven = (towards - away) / (towards + away)
    return float(uneven @ loaded / (loaded @ loaded))


def directions(law: FrictionMap, table: SteadyFriction) -> FloatArray:
    """Friction [N] towards the pressure and away from it at the reference speed, shape (2, pressures)."""
    speed, speeds = math.log(law.reference_speed), np.log(law.speeds)
    columns = (table.friction, table.direction_difference)
    mean, difference = (np.array([np.interp(speed, speeds, row) for row in column]) for column in columns)
    return np.array([mean + 0.5 * difference, mean - 0.5 * difference])


def _levelled(law: FrictionMap) -> tuple[float, ...]:
    table = np.reshape(law.frictions, (len(law.pressures), -1))
    at_reference = np.array([law.coulomb_friction(pressure) for pressure in law.pressures])
    raised = np.maximum.accumulate(at_reference) / at_reference
    raised[raised > 1.0 + DISCRETISATION] = 1.0
    return tuple((table * raised[:, None]).ravel().tolist())
