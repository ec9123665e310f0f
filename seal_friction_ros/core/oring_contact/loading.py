"""The way of the ring from free to pressed: squeeze between rod and gland, seat on the wall, raise the pressure."""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from seal_friction_ros.core.oring_contact.arrays import BoolArray, FloatArray
from seal_friction_ros.core.oring_contact.case import OringCase, check_pressures
from seal_friction_ros.core.oring_contact.equilibrium import (
    Assembly,
    Model,
    NotConverged,
    State,
    at_rest,
    make_assembly,
    make_model,
    outline,
    solve,
)
from seal_friction_ros.core.oring_contact.mesh import o_grid
from seal_friction_ros.core.oring_contact.surroundings import (
    GLAND,
    ROD,
    Surroundings,
    node_areas,
    surface_pressure,
    wall_stresses,
)
from seal_friction_ros.core.seal import projected_area

_SOFTER = (100.0, 10.0, 1.0)  # walls while the ring is squeezed: softer at first
_SEATING = 1e-3  # depth of the ring in the wall when it is seated, over d
_EASY, _GROW, _SHRINK = 6, 1.6, 0.5  # Newton steps of an easy load step; how the next one changes
_SMALLEST = 1e-4  # load step over E


class Loaded(NamedTuple):
    """The ring in equilibrium under one pressure."""

    pressure: float
    """[Pa, gauge]"""
    surroundings: Surroundings
    state: State
    newton_steps: int
    """since the last pressure that was asked for"""


class _March(NamedTuple):
    """Two load steps in a row, and how far the next one goes."""

    before: Loaded
    now: Loaded
    rise: float
    """[Pa]"""


def model_of(case: OringCase) -> Model:
    """Mesh and material of a case."""
    geometry, numerics = case.geometry, case.numerics
    center = (geometry.ring_inner_diameter + geometry.section_diameter) / 2.0
    mesh = o_grid(geometry.section_diameter, center, numerics.lines)
    return make_model(mesh, case.rubber, geometry.section_diameter, numerics.guide)


def loaded_states(case: OringCase, model: Model, pressures: tuple[float, ...]) -> Iterator[Loaded]:
    """The ring under one pressure [Pa, gauge] after the other.

    At no pressure the ring is squeezed only and touches no wall, as in the first case of the thesis.

    Raises:
        ValueError: The pressures make no sense, the squeezed ring is longer than the groove, or fluid passes the ring.
        NotConverged: No equilibrium was found.
    """
    check_pressures(case, pressures)
    squeezed = squeeze(case, model)
    if pressures[0] == 0.0:
        yield squeezed
        squeezed, pressures = squeezed._replace(newton_steps=0), pressures[1:]
    if not pressures:
        return
    free = make_assembly(model)
    seated = seat(case, model, free, squeezed)
    march = _March(seated, seated, seated.pressure)
    for pressure in pressures:
        march = _raised(case, model, free, march, pressure)
        _check_sealed(case, model, march.now)
        yield march.now
        march = march._replace(now=march.now._replace(newton_steps=0))


def squeeze(case: OringCase, model: Model) -> Loaded:
    """The ring squeezed between rod and gland, held at one node along the axis.

    Raises:
        ValueError: It is longer than the groove is wide.
        NotConverged: No equilibrium was found.
    """
    held = make_assembly(model, _held(model))
    state = at_rest(model, _fitted(case, model))
    surroundings = _around(case, model)
    total = 0
    for softer in _SOFTER:
        try:
            state, steps = solve(model, held, surroundings._replace(penalty=surroundings.penalty / softer), state)
        except NotConverged as error:
            raise NotConverged(f'case {case.name}: the squeezed ring finds no equilibrium: {error}') from None
        total += steps
    length = float(np.ptp(outline(model, state)[:, 1]))
    if length >= case.groove.width:
        raise ValueError(
            f'case {case.name}: overfilled gland: the squeezed ring is {length:.6g} m long, more than groove.width = '
            f'{case.groove.width} m'
        )
    return Loaded(0.0, surroundings, state, total)


def seat(case: OringCase, model: Model, free: Assembly, squeezed: Loaded) -> Loaded:
    """The squeezed ring against the wall, and the small pressure that keeps it there.

    The wall is put where the ring is, so nothing has to be moved across a gap; the ring is held by one node until the
    wall holds it, and let go under the pressure that balances what the wall then bears.

    Raises:
        NotConverged: No equilibrium was found.
    """
    top = float(outline(model, squeezed.state)[:, 1].max())
    wall = squeezed.surroundings._replace(wall_position=top - _SEATING * case.geometry.section_diameter)
    try:
        state, steps = solve(model, make_assembly(model, _held(model)), wall, squeezed.state)
        position = outline(model, state)
        axial = surface_pressure(wall, position).total * node_areas(position)[:, 1]
        pressure = float(axial[position[:, 1] > 0.0].sum()) / projected_area(case.geometry)
        surroundings = wall._replace(pressure=pressure, wetted=wetted_nodes(wall, position))
        state, more = solve(model, free, surroundings, state)
    except NotConverged as error:
        raise NotConverged(f'case {case.name}: the ring does not come to rest on the wall: {error}') from None
    return Loaded(pressure, surroundings, state, squeezed.newton_steps + steps + more)


def _held(model: Model) -> tuple[int]:
    """Axial displacement of one node in the middle, which carries no load while the ring is squeezed evenly."""
    return (2 * int(np.argmin(np.linalg.norm(model.mesh.nodes - model.mesh.nodes.mean(axis=0), axis=1))) + 1,)


def _raised(case: OringCase, model: Model, free: Assembly, march: _March, target: float) -> _March:
    """March to a pressure in steps that grow while they are easy and shrink where they fail."""
    before, now, rise = march
    if target < now.pressure:  # below the one it was seated with
        return _March(now, _step(model, free, now, now, target), rise)
    while now.pressure < target:
        wanted = now.pressure + rise
        wanted = target if wanted > target - 0.1 * rise else wanted
        try:
            after = _step(model, free, before, now, wanted)
        except NotConverged as error:
            rise = _SHRINK * (wanted - now.pressure)
            if rise < _SMALLEST * case.rubber.elastic_modulus:
                raise NotConverged(f'case {case.name}: no equilibrium at {wanted:.6g} Pa: {error}') from None
            before = now  # next time no guess, but a start from where it is
            continue
        if after.newton_steps - now.newton_steps <= _EASY:
            rise = max(rise, _GROW * (wanted - now.pressure))
        before, now = now, after
    return _March(before, now, rise)


def _step(model: Model, free: Assembly, before: Loaded, now: Loaded, pressure: float) -> Loaded:
    """One load step, from a guess that goes on as the last one went."""
    wetted = wetted_nodes(now.surroundings, outline(model, now.state))
    surroundings = now.surroundings._replace(pressure=pressure, wetted=wetted)
    start = now.state
    if before.pressure < now.pressure:
        ahead = (pressure - now.pressure) / (now.pressure - before.pressure)
        change = now.state.displacement - before.state.displacement
        start = now.state._replace(displacement=now.state.displacement + ahead * change)
    state, steps = solve(model, free, surroundings, start)
    return Loaded(pressure, surroundings, state, now.newton_steps + steps)


def wetted_nodes(surroundings: Surroundings, position: FloatArray) -> BoolArray:
    """Nodes of the outline between the highest contact stresses on rod and gland, on the upstream side, shape (s,)."""
    stresses = wall_stresses(surroundings, position)
    rod, gland = int(np.argmax(stresses[:, ROD])), int(np.argmax(stresses[:, GLAND]))
    wetted: BoolArray = (np.arange(len(position)) - rod) % len(position) <= (gland - rod) % len(position)
    return wetted


def _check_sealed(case: OringCase, model: Model, now: Loaded) -> None:
    highest = wall_stresses(now.surroundings, outline(model, now.state))[:, : GLAND + 1].max(axis=0)
    for name, stress in zip(('rod', 'gland'), highest, strict=True):
        if stress <= now.pressure:
            raise ValueError(
                f'case {case.name}: at {now.pressure:.6g} Pa the fluid passes the ring at the {name}: the contact stress '
                f'reaches {stress:.6g} Pa only'
            )


def _around(case: OringCase, model: Model) -> Surroundings:
    geometry, elastic_modulus = case.geometry, case.rubber.elastic_modulus
    return Surroundings(
        rod_radius=geometry.rod_diameter / 2.0,
        gland_radius=geometry.gland_diameter / 2.0,
        wall_position=math.inf,
        pressure=0.0,
        wetted=np.zeros(len(model.mesh.surface), dtype=bool),
        penalty=case.numerics.penalty * elastic_modulus / geometry.section_diameter,
        transition=case.numerics.transition * elastic_modulus,
        rod_friction=case.rod_friction,
        gland_friction=case.gland_friction,
    )


def _fitted(case: OringCase, model: Model) -> FloatArray:
    """Displacements to start the squeeze from: the free ring drawn straight into the gap, its volume kept."""
    geometry = case.geometry
    gap = (geometry.gland_diameter - geometry.rod_diameter) / 2.0
    r, z = model.mesh.nodes.T
    thinner = gap / geometry.section_diameter
    wider = (geometry.rod_diameter + gap) / (geometry.ring_inner_diameter + geometry.section_diameter)
    inner = geometry.rod_diameter / 2.0
    fitted = np.stack((inner + (r - geometry.ring_inner_diameter / 2.0) * thinner, z / (thinner * wider)), axis=1)
    displacement: FloatArray = (fitted - model.mesh.nodes).ravel()
    return displacement
