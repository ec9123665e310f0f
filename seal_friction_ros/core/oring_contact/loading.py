"""The way of the ring from free to pressed: squeeze between rod and gland, seat on the wall, raise the pressure."""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from seal_friction_ros.core.foundation.arrays import BoolArray, FloatArray
from seal_friction_ros.core.foundation.errors import NotConvergedError
from seal_friction_ros.core.friction.geometry import projected_area
from seal_friction_ros.core.oring_contact.continuation import follow_path
from seal_friction_ros.core.oring_contact.equilibrium import (
    Assembly,
    OringModel,
    OringState,
    make_assembly,
    make_model,
    outline,
    solve_equilibrium,
    unstressed_state,
)
from seal_friction_ros.core.oring_contact.mesh import o_grid
from seal_friction_ros.core.oring_contact.oring_case import OringCase, check_pressures
from seal_friction_ros.core.oring_contact.surroundings import (
    GLAND,
    ROD,
    Surroundings,
    node_areas,
    surface_pressure,
    wall_stresses,
)

_SOFTER = 100.0  # walls while the ring is squeezed: their penalty is this much smaller
_SQUEEZE_STRIDE, _STIFFEN_STRIDE, _FRICTION_STRIDE = 1.0, 0.5, 0.1  # parts of their ways to try first
_DRY = 0.1  # transition without fluid, where there is nothing to tell contact from, over that with it
_SEATING = 1e-3  # depth of the ring in the wall when it is seated, over d


class LoadedRing(NamedTuple):
    """The ring in equilibrium under one pressure."""

    pressure: float
    """[Pa, gauge]"""
    surroundings: Surroundings
    state: OringState
    newton_steps: int
    """since the last pressure that was asked for"""


def oring_model(case: OringCase) -> OringModel:
    """Mesh and material of a case."""
    geometry, numerics = case.geometry, case.numerics
    center = (geometry.ring_inner_diameter + geometry.section_diameter) / 2.0
    mesh = o_grid(geometry.section_diameter, center, numerics.lines)
    return make_model(mesh, case.rubber, geometry.section_diameter, numerics.guide)


def loaded_states(case: OringCase, model: OringModel, pressures: tuple[float, ...]) -> Iterator[LoadedRing]:
    """The ring under one pressure [Pa, gauge] after the other.

    At no pressure the ring is squeezed only and touches no wall, as in the first case of the thesis.

    Raises:
        ValueError: The pressures make no sense, the squeezed ring is longer than the groove, or fluid passes the ring.
        NotConvergedError: No equilibrium was found.
    """
    check_pressures(case, pressures)
    now = squeeze_ring(case, model)
    if pressures[0] == 0.0:
        yield now
        now, pressures = now._replace(newton_steps=0), pressures[1:]
    if not pressures:
        return
    free = make_assembly(model)
    base = seat_ring(case, model, free, now)
    lowest, rise = base.pressure, base.pressure
    for pressure in pressures:
        now, next_rise = _raised(case, model, free, base, pressure, rise)
        loaded = _held_back(case, model, free, now)
        _check_sealed(case, model, loaded)
        yield loaded
        if pressure > lowest:  # below, the wall hardly holds the ring: no good place to start from
            base, rise = now, next_rise
        base = base._replace(newton_steps=0)


def squeeze_ring(case: OringCase, model: OringModel) -> LoadedRing:
    """The ring squeezed between rod and gland, held at one node along the axis.

    The walls come in from where they just touch the free ring, soft at first, and are stiffened when they are in place.

    Raises:
        ValueError: The squeezed ring is longer than the groove is wide.
        NotConvergedError: No equilibrium was found.
    """
    assembly, walls = make_assembly(model, _held(model)), _walls(case, model)
    inner = case.geometry.ring_inner_diameter / 2.0
    rod_way = walls.rod_radius - inner
    gland_way = walls.gland_radius - inner - case.geometry.section_diameter

    def closing(share: float, _: OringState) -> Surroundings:
        left = 1.0 - share
        rod, gland = walls.rod_radius - left * rod_way, walls.gland_radius - left * gland_way
        return walls._replace(rod_radius=rod, gland_radius=gland, penalty=walls.penalty / _SOFTER)

    def drawn(state: OringState, done: float, wanted: float) -> OringState:
        return _drawn_along(model, state, closing(done, state), closing(wanted, state))

    def stiffening(share: float, _: OringState) -> Surroundings:
        return walls._replace(penalty=walls.penalty * _SOFTER ** (share - 1.0))

    try:
        closed = follow_path(model, assembly, closing, unstressed_state(model), _SQUEEZE_STRIDE, drawn)
        reached = follow_path(model, assembly, stiffening, closed.state, _STIFFEN_STRIDE)
    except NotConvergedError as error:
        raise NotConvergedError(f'case {case.name}: the squeezed ring finds no equilibrium: {error}') from None
    length = float(np.ptp(outline(model, reached.state)[:, 1]))
    if length >= case.groove.width:
        raise ValueError(
            f'case {case.name}: overfilled gland: the squeezed ring is {length:.6g} m long, groove.width = '
            f'{case.groove.width} m'
        )
    return LoadedRing(0.0, walls, reached.state, closed.newton_steps + reached.newton_steps)


def seat_ring(case: OringCase, model: OringModel, free: Assembly, squeezed: LoadedRing) -> LoadedRing:
    """The squeezed ring against the wall, and the small pressure that keeps it there.

    The wall is put where the ring is, so nothing has to be moved across a gap; the ring is held by one node until the
    wall holds it, and let go under the pressure that balances what the wall then bears.

    Raises:
        NotConvergedError: No equilibrium was found.
    """
    top = float(outline(model, squeezed.state)[:, 1].max())
    wall = squeezed.surroundings._replace(
        wall_position=top - _SEATING * case.geometry.section_diameter,
        transition=case.numerics.transition * case.rubber.elastic_modulus,
    )
    try:
        state, steps = solve_equilibrium(model, make_assembly(model, _held(model)), wall, squeezed.state)
        position = outline(model, state)
        axial = surface_pressure(wall, position).total * node_areas(position)[:, 1]
        pressure = float(axial[position[:, 1] > 0.0].sum()) / projected_area(case.geometry)
        surroundings = wall._replace(pressure=pressure, wetted=wetted_nodes(wall, position))
        state, more = solve_equilibrium(model, free, surroundings, state)
    except NotConvergedError as error:
        raise NotConvergedError(f'case {case.name}: the ring does not come to rest on the wall: {error}') from None
    return LoadedRing(pressure, surroundings, state, squeezed.newton_steps + steps + more)


def wetted_nodes(surroundings: Surroundings, position: FloatArray) -> BoolArray:
    """Nodes of the outline between the highest contact stresses on rod and gland, on the upstream side, shape (s,)."""
    stresses = wall_stresses(surroundings, position)
    rod, gland = int(np.argmax(stresses[:, ROD])), int(np.argmax(stresses[:, GLAND]))
    wetted: BoolArray = (np.arange(len(position)) - rod) % len(position) <= (gland - rod) % len(position)
    return wetted


def _held(model: OringModel) -> tuple[int]:
    """Axial displacement of one node in the middle, which carries no load while the ring is squeezed evenly."""
    return (2 * int(np.argmin(np.linalg.norm(model.mesh.nodes - model.mesh.nodes.mean(axis=0), axis=1))) + 1,)


def _raised(
    case: OringCase, model: OringModel, free: Assembly, now: LoadedRing, target: float, rise: float
) -> tuple[LoadedRing, float]:
    """The ring under another pressure, and the rise of pressure [Pa] that is good for the next step."""

    def rising(share: float, state: OringState) -> Surroundings:
        wetted = wetted_nodes(now.surroundings, outline(model, state))
        return now.surroundings._replace(pressure=now.pressure + share * (target - now.pressure), wetted=wetted)

    way = abs(target - now.pressure)
    try:
        reached = follow_path(model, free, rising, now.state, min(rise / way, 1.0))
    except NotConvergedError as error:
        raise NotConvergedError(
            f'case {case.name}: no equilibrium on the way from {now.pressure:.6g} to {target:.6g} Pa: {error}'
        ) from None
    newton_steps = now.newton_steps + reached.newton_steps
    return LoadedRing(target, reached.surroundings, reached.state, newton_steps), reached.stride * way


def _held_back(case: OringCase, model: OringModel, free: Assembly, loaded: LoadedRing) -> LoadedRing:
    """Add the friction of rod and gland to a ring that is under pressure."""
    if case.wall_friction == 0.0:
        return loaded

    def rubbing(share: float, _: OringState) -> Surroundings:
        return loaded.surroundings._replace(friction=share * case.wall_friction)

    try:
        reached = follow_path(model, free, rubbing, loaded.state, _FRICTION_STRIDE)
    except NotConvergedError as error:
        raise NotConvergedError(
            f'case {case.name}: no equilibrium at {loaded.pressure:.6g} Pa with wall_friction = {case.wall_friction}: '
            f'{error}'
        ) from None
    return LoadedRing(loaded.pressure, reached.surroundings, reached.state, loaded.newton_steps + reached.newton_steps)


def _check_sealed(case: OringCase, model: OringModel, now: LoadedRing) -> None:
    highest = wall_stresses(now.surroundings, outline(model, now.state)).max(axis=0)
    for name, wall in (('rod', ROD), ('gland', GLAND)):
        if highest[wall] <= now.pressure:
            raise ValueError(
                f'case {case.name}: at {now.pressure:.6g} Pa the fluid passes the ring at the {name}: the contact '
                f'stress there reaches {highest[wall]:.6g} Pa only'
            )


def _walls(case: OringCase, model: OringModel) -> Surroundings:
    """Rod and gland in place, no fluid, no downstream wall."""
    geometry, elastic_modulus = case.geometry, case.rubber.elastic_modulus
    return Surroundings(
        rod_radius=geometry.rod_diameter / 2.0,
        gland_radius=geometry.gland_diameter / 2.0,
        wall_position=math.inf,
        pressure=0.0,
        wetted=np.zeros(len(model.mesh.surface), dtype=bool),
        penalty=case.numerics.penalty * elastic_modulus / geometry.section_diameter,
        transition=_DRY * case.numerics.transition * elastic_modulus,
    )


def _drawn_along(model: OringModel, state: OringState, before: Surroundings, after: Surroundings) -> OringState:
    """A guess for moved walls: the ring drawn straight along with them, its volume kept as far as that goes."""
    r, z = (model.mesh.nodes + state.displacement.reshape(-1, 2)).T
    thinner = (after.gland_radius - after.rod_radius) / (before.gland_radius - before.rod_radius)
    wider = (after.gland_radius + after.rod_radius) / (before.gland_radius + before.rod_radius)
    drawn = np.stack((after.rod_radius + (r - before.rod_radius) * thinner, z / (thinner * wider)), axis=1)
    return state._replace(displacement=(drawn - model.mesh.nodes).ravel())
