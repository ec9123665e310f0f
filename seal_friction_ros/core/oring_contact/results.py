"""What the pressed ring tells: contact stress along each wall, contact width, normal and axial force, shape."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from seal_friction_ros.core.foundation.arrays import BoolArray, FloatArray, IntArray
from seal_friction_ros.core.oring_contact.elements import deformation_gradient, volume_ratios
from seal_friction_ros.core.oring_contact.equilibrium import OringModel, outline
from seal_friction_ros.core.oring_contact.loading import LoadedRing, loaded_states, oring_model
from seal_friction_ros.core.oring_contact.material import von_mises_stress
from seal_friction_ros.core.oring_contact.oring_case import OringCase
from seal_friction_ros.core.oring_contact.surroundings import (
    GLAND,
    ROD,
    WALL,
    SurfacePressure,
    node_areas,
    surface_pressure,
    wall_stresses,
)

_TOUCHING = 20.0  # transitions outside a wall beyond which the contact stress is nothing


class WallContact(NamedTuple):
    """Contact on one wall. Positions run along the wall: z for rod and gland, positive downstream; r for the wall."""

    position: FloatArray
    """of the nodes in contact, increasing [m], shape (k,)"""
    stress: FloatArray
    """contact stress there [Pa], shape (k,)"""
    force: float
    """on the whole wall, all around the axis [N]"""
    peak_stress: float
    """[Pa]"""
    edges: tuple[float, float]
    """first and last position in contact [m]; equal if there is none"""

    @property
    def width(self) -> float:
        """Contact width [m]."""
        return self.edges[1] - self.edges[0]


class DeformedSection(NamedTuple):
    """The deformed section."""

    nodes: FloatArray
    """(r, z) [m], shape (n, 2)"""
    elements: IntArray
    """shape (e, 4)"""
    von_mises: FloatArray
    """mean of each element [Pa], shape (e,)"""


class OringResult(NamedTuple):
    """The ring under one pressure."""

    pressure: float
    """[Pa, gauge]"""
    rod: WallContact
    gland: WallContact
    wall: WallContact
    axial_force: float
    """of what bears the ring on its downstream side, which must be that of the fluid [N]"""
    volume_ratio: float
    """volume of the rubber over that of the free ring [-]"""
    expected_volume_ratio: float
    """that which its mean pressure and bulk modulus make [-]"""
    newton_steps: int
    shape: DeformedSection


def oring_results(case: OringCase, pressures: tuple[float, ...]) -> Iterator[OringResult]:
    """Contact of a case at increasing pressures [Pa, gauge], one after the other as they are computed.

    Raises:
        ValueError: The pressures make no sense, or the ring does not fit or does not seal.
        NotConvergedError: No equilibrium was found.
    """
    model = oring_model(case)
    for loaded in loaded_states(case, model, pressures):
        yield evaluate_contact(model, loaded)


def evaluate_contact(model: OringModel, loaded: LoadedRing) -> OringResult:
    """Contact, forces and shape of an equilibrium."""
    position = outline(model, loaded.state)
    pressure = surface_pressure(loaded.surroundings, position)
    axial = _axial_force(pressure, node_areas(position)[:, 1], _upstream(loaded, position))
    gradient = deformation_gradient(model.elements, loaded.state.displacement)
    volumes = model.elements.weights.sum(axis=1)
    ratios = volume_ratios(model.elements, gradient)
    mean_tension = (loaded.state.tension * volumes).sum() / volumes.sum()
    nodes = model.mesh.nodes + loaded.state.displacement.reshape(-1, 2)
    von_mises = von_mises_stress(model.rubber, gradient).mean(axis=1)
    rod, gland, wall = (_contact(loaded, position, which) for which in (ROD, GLAND, WALL))
    return OringResult(
        pressure=loaded.pressure,
        rod=rod,
        gland=gland,
        wall=wall,
        axial_force=axial,
        volume_ratio=float((ratios * volumes).sum() / volumes.sum()),
        expected_volume_ratio=float(1.0 + mean_tension / model.rubber.bulk_modulus),
        newton_steps=loaded.newton_steps,
        shape=DeformedSection(nodes, model.mesh.elements, von_mises),
    )


def _axial_force(pressure: SurfacePressure, axial_areas: FloatArray, upstream: BoolArray) -> float:
    """Everything on the downstream side, less what tilted facets of rod and gland add from upstream [N].

    Rod and gland are smooth and bear nothing along the axis, but the facets where their contact begins are not quite
    parallel to them, which is an error of the mesh.
    """
    axial = pressure.total * axial_areas
    tilted = (pressure.shares[:, 1 + ROD] + pressure.shares[:, 1 + GLAND]) * axial
    return float(axial[~upstream].sum() + tilted[upstream].sum())


def _upstream(loaded: LoadedRing, position: FloatArray) -> BoolArray:
    """Nodes on the side of the fluid; of a ring that is squeezed only, the half away from the wall."""
    if loaded.pressure > 0.0:
        return loaded.surroundings.wetted
    return position[:, 1] < 0.0


def _contact(loaded: LoadedRing, position: FloatArray, wall: int) -> WallContact:
    surroundings = loaded.surroundings
    stresses = wall_stresses(surroundings, position)
    near = (stresses.argmax(axis=1) == wall) & (stresses[:, wall] > -_TOUCHING * surroundings.transition)
    areas = np.linalg.norm(node_areas(position), axis=1)
    stress = surface_pressure(surroundings, position).contact_stress
    force = float((stress * areas)[near].sum())
    along = position[:, 0] if wall == WALL else position[:, 1]
    fluid = np.where(surroundings.wetted, surroundings.pressure, 0.0)
    inside = near & (stresses[:, wall] > fluid)
    order = np.argsort(along[inside], kind='stable')
    if not inside.any():
        return WallContact(np.zeros(0), np.zeros(0), force, 0.0, (0.0, 0.0))
    where, height = along[inside][order], stress[inside][order]
    above = (stresses[:, wall] - fluid)[inside][order]
    edges = _edge(where, above), _edge(where[::-1], above[::-1])
    return WallContact(where, height, force, float(height.max()), edges)


def _edge(where: FloatArray, above: FloatArray) -> float:
    """Where contact begins, just outside the first node in it [m].

    Near its edge a contact stress rises, from the fluid's pressure on, with the root of the distance [Johnson1985]_:
    its square is carried on in a straight line, by one spacing of the nodes at most.
    """
    if len(where) < 2:
        return float(where[0])
    rise = above[1] ** 2 - above[0] ** 2
    spacings = min(above[0] ** 2 / rise, 1.0) if rise > 0.0 else 1.0
    return float(where[0] - spacings * (where[1] - where[0]))
