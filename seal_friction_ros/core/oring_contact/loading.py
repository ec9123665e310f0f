"""Loading of the ring: squeeze between rod and gland, seat on the downstream wall, raise the pressure."""

import math
from collections.abc import Iterator
from contextlib import AbstractContextManager
from typing import NamedTuple

import numpy as np

from seal_friction_ros.core.foundation.arrays import BoolArray, FloatArray
from seal_friction_ros.core.foundation.errors import NotConvergedError, named_errors
from seal_friction_ros.core.friction.geometry import projected_area
from seal_friction_ros.core.oring_contact.equilibrium import (
    Assembly,
    OringModel,
    OringState,
    follow_path,
    make_assembly,
    make_model,
    outline,
    solve_equilibrium,
    unstressed_state,
)
from seal_friction_ros.core.oring_contact.material import rubber_field
from seal_friction_ros.core.oring_contact.mesh import CROWDING, o_grid
from seal_friction_ros.core.oring_contact.oring_case import OringCase, check_pressures
from seal_friction_ros.core.oring_contact.section import first_crossing, placed
from seal_friction_ros.core.oring_contact.section_mesh import inside, section_mesh
from seal_friction_ros.core.oring_contact.surroundings import (
    GLAND,
    ROD,
    WALL,
    Surroundings,
    node_areas,
    surface_pressure,
    wall_stresses,
)

_SOFTER = 100.0  # factor by which the penalty is reduced during squeezing
_SQUEEZE_STRIDE, _STIFFEN_STRIDE, _FRICTION_STRIDE = 1.0, 0.5, 0.1  # first steps, as fractions of their paths
_DRY = 0.1  # transition without fluid over transition with fluid
_SEATING = 1e-3  # first penetration of the ring into the downstream wall, over d
_FLAT_SEATING = 0.02  # first stress of another section, which may be flat there, on that wall over E


class LoadedRing(NamedTuple):
    """Equilibrium of the ring under one pressure."""

    pressure: float  # [Pa, gauge]
    surroundings: Surroundings
    state: OringState
    newton_steps: int  # since the last requested pressure


def oring_model(case: OringCase, crowding: float = CROWDING) -> OringModel:
    """Model of a case; the ``crowding`` of the elements is that of a round ring, see `mesh`."""
    geometry, numerics = case.geometry, case.numerics
    if case.section is not None:
        section = placed(case.section, geometry.ring_inner_diameter, geometry.section_diameter)
        mesh = section_mesh(section, 0.25 * math.pi * geometry.section_diameter / (numerics.lines - 1))
        field = None
        if section.cap is not None:
            in_cap = inside(mesh.nodes[mesh.elements].mean(axis=1), section.cap)
            field = rubber_field((case.rubber, case.cap or case.rubber), in_cap.astype(int))
        return make_model(mesh, case.rubber, geometry.section_diameter, 0.0, field)
    center = (geometry.ring_inner_diameter + geometry.section_diameter) / 2.0
    mesh = o_grid(geometry.section_diameter, center, numerics.lines, crowding)
    return make_model(mesh, case.rubber, geometry.section_diameter, numerics.guide)


def loaded_states(case: OringCase, model: OringModel, pressures: tuple[float, ...]) -> Iterator[LoadedRing]:
    """Equilibria at increasing pressures [Pa, gauge].

    At 0 Pa the ring is squeezed only and does not touch the downstream wall, as in the first case of the thesis.
    ValueError: the pressures are invalid, the squeezed ring is longer than the groove, or fluid passes the ring;
    NotConvergedError: Newton's method did not converge.
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
        now, next_rise = _raise_pressure(case, model, free, base, pressure, rise)
        loaded = _apply_wall_friction(case, model, free, now)
        _check_sealed(case, model, loaded)
        _check_unfolded(case, model, loaded)
        yield loaded
        if pressure > lowest:  # at lower pressure the wall hardly supports the ring: a poor start for the next step
            base, rise = now, next_rise
        base = base._replace(newton_steps=0)


def squeeze_ring(case: OringCase, model: OringModel) -> LoadedRing:
    """Ring squeezed between rod and gland, with one node fixed along the axis.

    The walls move from first contact with the free ring to their final radii at reduced penalty, then the penalty rises
    to its full value. ValueError: the squeezed ring is longer than the groove; NotConvergedError: Newton's method did
    not converge.
    """
    assembly, walls = make_assembly(model, _fixed(model)), _dry_walls(case, model)
    inner = case.geometry.ring_inner_diameter / 2.0
    rod_travel = walls.rod_radius - inner
    gland_travel = walls.gland_radius - inner - case.geometry.section_diameter

    def closing(share: float, _: OringState, __: float) -> Surroundings:
        left = 1.0 - share
        rod, gland = walls.rod_radius - left * rod_travel, walls.gland_radius - left * gland_travel
        return walls._replace(rod_radius=rod, gland_radius=gland, penalty=walls.penalty / _SOFTER)

    def stretched(state: OringState, done: float, wanted: float) -> OringState:
        return _stretched_with_walls(model, state, closing(done, state, done), closing(wanted, state, done))

    def stiffening(share: float, _: OringState, __: float) -> Surroundings:
        return walls._replace(penalty=walls.penalty * _SOFTER ** (share - 1.0))

    with _named(case, 'of the squeezed ring'):
        guess = stretched if case.section is None else None
        closed = follow_path(model, assembly, closing, unstressed_state(model), _SQUEEZE_STRIDE, guess)
        reached = follow_path(model, assembly, stiffening, closed.state, _STIFFEN_STRIDE)
    length = float(np.ptp(outline(model, reached.state)[:, 1]))
    if length >= case.groove.width:
        raise ValueError(
            f'case {case.name}: overfilled gland: the squeezed ring is {length:.6g} m long, groove.width = '
            f'{case.groove.width} m'
        )
    return LoadedRing(0.0, walls, reached.state, closed.newton_steps + reached.newton_steps)


def seat_ring(case: OringCase, model: OringModel, free: Assembly, squeezed: LoadedRing) -> LoadedRing:
    """Squeezed ring on the downstream wall, with the small pressure that holds it there.

    The wall is placed at the ring, with a small penetration, so the ring need not cross a gap. One node of the ring
    stays fixed while the wall takes load; it is then released under the pressure that balances the wall force.
    NotConvergedError: Newton's method did not converge.
    """
    seating = _SEATING if case.section is None else _FLAT_SEATING / case.numerics.penalty
    top = float(outline(model, squeezed.state)[:, 1].max())
    wall = squeezed.surroundings._replace(
        wall_position=top - seating * case.geometry.section_diameter,
        transition=case.numerics.transition * case.rubber.modulus,
    )
    with _named(case, 'of the ring on the downstream wall'):
        state, steps = solve_equilibrium(model, make_assembly(model, _fixed(model)), wall, squeezed.state)
        position = outline(model, state)
        stress = surface_pressure(wall, position)
        axial = stress.total * stress.shares[:, 1 + WALL] * node_areas(position)[:, 1]
        pressure = float(axial.sum()) / projected_area(case.geometry)
        surroundings = wall._replace(pressure=pressure, wetted=wetted_nodes(wall, position))
        state, more = solve_equilibrium(model, free, surroundings, state)
    return LoadedRing(pressure, surroundings, state, squeezed.newton_steps + steps + more)


def _named(case: OringCase, which: str) -> AbstractContextManager[None]:
    return named_errors(f'case {case.name}: no equilibrium {which}', NotConvergedError, NotConvergedError)


def wetted_nodes(surroundings: Surroundings, position: FloatArray) -> BoolArray:
    """Whether each node of the outline is upstream of the lips on rod and gland that hold the fluid, shape (s,)."""
    stresses = wall_stresses(surroundings, position)
    away = np.where(stresses.max(axis=1) < 0.0, position[:, 1], np.inf)
    start = int(np.argmin(away))
    rod = _holding(stresses[:, ROD], surroundings.pressure, start, -1)
    gland = _holding(stresses[:, GLAND], surroundings.pressure, start, 1)
    wetted: BoolArray = (np.arange(len(position)) - rod) % len(position) <= (gland - rod) % len(position)
    return wetted


def _holding(stress: FloatArray, pressure: float, start: int, direction: int) -> int:
    """Node with the peak stress of the first lip, from ``start`` on, that is above the pressure; else the highest one.

    The fluid passes a lip whose peak stress is below its pressure; a lip ends where what the stress has above the
    pressure has fallen to half (our choice).
    """
    order = (start + direction * np.arange(len(stress))) % len(stress)
    along = stress[order]
    above = along - max(pressure, 0.0)
    peak = np.maximum.accumulate(above)
    behind = np.flatnonzero((peak > 0.0) & (above < 0.5 * peak))
    return int(order[np.argmax(along[: behind[0]] if len(behind) else along)])


def _fixed(model: OringModel) -> tuple[int]:
    """Axial degree of freedom of the central node, which carries no load while the ring is squeezed symmetrically."""
    return (2 * int(np.argmin(np.linalg.norm(model.mesh.nodes - model.mesh.nodes.mean(axis=0), axis=1))) + 1,)


def _raise_pressure(
    case: OringCase, model: OringModel, free: Assembly, now: LoadedRing, target: float, rise: float
) -> tuple[LoadedRing, float]:
    """Ring under the pressure ``target`` [Pa], and the pressure rise [Pa] to try in the next step."""

    def rising(share: float, state: OringState, done: float) -> Surroundings:
        """Surroundings at a share of the rise; the fluid wets what it wets by the pressure before."""
        before, risen = (
            now.surroundings._replace(pressure=now.pressure + part * (target - now.pressure)) for part in (done, share)
        )
        return risen._replace(wetted=wetted_nodes(before, outline(model, state)))

    total_rise = abs(target - now.pressure)
    with _named(case, f'between {now.pressure:.6g} and {target:.6g} Pa'):
        reached = follow_path(model, free, rising, now.state, min(rise / total_rise, 1.0))
    newton_steps = now.newton_steps + reached.newton_steps
    return LoadedRing(target, reached.surroundings, reached.state, newton_steps), reached.stride * total_rise


def _apply_wall_friction(case: OringCase, model: OringModel, free: Assembly, loaded: LoadedRing) -> LoadedRing:
    """Add the friction of rod and gland to a ring under pressure."""
    if case.wall_friction == 0.0:
        return loaded

    def rubbing(share: float, _: OringState, __: float) -> Surroundings:
        return loaded.surroundings._replace(friction=share * case.wall_friction)

    with _named(case, f'at {loaded.pressure:.6g} Pa with wall_friction = {case.wall_friction}'):
        reached = follow_path(model, free, rubbing, loaded.state, _FRICTION_STRIDE)
    return LoadedRing(loaded.pressure, reached.surroundings, reached.state, loaded.newton_steps + reached.newton_steps)


def _check_sealed(case: OringCase, model: OringModel, now: LoadedRing) -> None:
    highest = wall_stresses(now.surroundings, outline(model, now.state)).max(axis=0)
    for name, wall in (('rod', ROD), ('gland', GLAND)):
        if highest[wall] <= now.pressure:
            raise ValueError(
                f'case {case.name}: at {now.pressure:.6g} Pa the fluid passes the ring at the {name}: the peak '
                f'contact stress there is {highest[wall]:.6g} Pa'
            )


def _check_unfolded(case: OringCase, model: OringModel, now: LoadedRing) -> None:
    """A section whose outline crosses itself would touch itself, a contact that is not computed."""
    crossing = None if case.section is None else first_crossing(outline(model, now.state))
    if crossing is not None:
        r, z = crossing
        raise ValueError(
            f'case {case.name}: at {now.pressure:.6g} Pa the section folds onto itself at r = {r:.6g} m, '
            f'z = {z:.6g} m: contact of a seal with itself is not computed'
        )


def _dry_walls(case: OringCase, model: OringModel) -> Surroundings:
    """Rod and gland at their final radii, no fluid, no downstream wall."""
    geometry, elastic_modulus = case.geometry, case.rubber.modulus
    return Surroundings(
        rod_radius=geometry.rod_diameter / 2.0,
        gland_radius=geometry.gland_diameter / 2.0,
        wall_position=math.inf,
        pressure=0.0,
        wetted=np.zeros(len(model.mesh.surface), dtype=bool),
        penalty=case.numerics.penalty * elastic_modulus / geometry.section_diameter,
        transition=_DRY * case.numerics.transition * elastic_modulus,
        faces_walls=case.section is not None,
    )


def _stretched_with_walls(
    model: OringModel, state: OringState, before: Surroundings, after: Surroundings
) -> OringState:
    """Start state for moved walls: the ring stretched linearly with the walls, at about constant volume."""
    r, z = (model.mesh.nodes + state.displacement.reshape(-1, 2)).T
    thinning = (after.gland_radius - after.rod_radius) / (before.gland_radius - before.rod_radius)
    widening = (after.gland_radius + after.rod_radius) / (before.gland_radius + before.rod_radius)
    position = np.stack((after.rod_radius + (r - before.rod_radius) * thinning, z / (thinning * widening)), axis=1)
    return state._replace(displacement=(position - model.mesh.nodes).ravel())
