"""Results of an equilibrium: contact stress along each wall, contact width, normal and axial force, shape."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.polynomial.legendre import leggauss

from seal_friction_ros.core.foundation.arrays import BoolArray, FloatArray, IntArray
from seal_friction_ros.core.oring_contact import surroundings as walls
from seal_friction_ros.core.oring_contact.elements import deformation_gradient, volume_ratios
from seal_friction_ros.core.oring_contact.equilibrium import OringModel, outline
from seal_friction_ros.core.oring_contact.loading import LoadedRing, loaded_states, oring_model
from seal_friction_ros.core.oring_contact.material import von_mises_stress
from seal_friction_ros.core.oring_contact.oring_case import OringCase

_SHARES, _WEIGHTS = (0.5 * (values + shift) for values, shift in zip(leggauss(5), (1.0, 0.0), strict=True))
"""Points and weights of a quadrature by Gauss and Legendre from 0 to 1."""
_TOUCHING = 20.0  # distance from a wall, in transitions, beyond which the contact stress is negligible


class WallContact(NamedTuple):
    """Contact on one wall; position is z, positive downstream, on rod and gland, and r on the downstream wall."""

    position: FloatArray  # of the nodes in contact, and of the edges between two lips [m], increasing, shape (k,)
    stress: FloatArray  # contact stress, 0 at those edges [Pa], shape (k,)
    force: float  # contact stress, what the wall bears beyond the share of the fluid, over the circumference [N]
    wall_force: float
    """all stress of the wall where it is above the pressure of the fluid, over the circumference: the usual definition,
    which a sharp transition between fluid and contact gives [N]"""
    peak_stress: float  # [Pa]
    edges: tuple[float, float]  # begin and end of the contact, of all lips [m]; equal without contact
    circumference: float = 0.0  # of the wall at the contact [m]
    between_lips: float = 0.0  # width inside the edges that does not touch [m]

    @property
    def width(self) -> float:
        """Contact width [m]."""
        return self.edges[1] - self.edges[0] - self.between_lips

    def sheared_area(self, knee_stress: float) -> float:
        r"""Area that the tau_0 of a `ShearLaw` acts on [m^2]: :math:`A = \int arsinh(\sigma / \sigma_0)\,dA`.

        The square of the stress is linear between the nodes and the edges, as at the edge of Hertz (our choice). All
        stress is scaled so that its integral is the normal force: the step at the edge of the fluid is not in the
        profile.
        """
        if not len(self.position):
            return 0.0
        place = np.concatenate(([self.edges[0]], self.position, [self.edges[1]]))
        ends = np.sort(np.stack((np.r_[0.0, self.stress], np.r_[self.stress, 0.0])), axis=0)  # of each part
        stress = ends[0] + np.multiply.outer(_SHARES, ends[1] - ends[0])
        area = np.diff(place) * np.multiply.outer(_WEIGHTS, np.ones(len(place) - 1))
        area *= self.circumference * 2.0 * stress / np.maximum(ends.sum(axis=0), np.finfo(float).tiny)
        stress *= self.force / float((stress * area).sum())
        return float((np.arcsinh(stress / knee_stress) * area).sum())


class DeformedSection(NamedTuple):
    """Deformed section with its stress."""

    nodes: FloatArray  # (r, z) [m], shape (n, 2)
    elements: IntArray  # shape (e, 4)
    von_mises: FloatArray  # mean von Mises stress of each element [Pa], shape (e,)


class OringResult(NamedTuple):
    """Contacts, forces and shape under one pressure."""

    pressure: float  # [Pa, gauge]
    rod: WallContact
    gland: WallContact
    wall: WallContact
    axial_force: float  # axial force of the supports on the downstream side [N]; in equilibrium that of the fluid
    volume_ratio: float  # volume of the ring over that of the undeformed ring [-]
    expected_volume_ratio: float  # volume ratio that follows from mean tension and bulk modulus [-]
    newton_steps: int
    shape: DeformedSection


def oring_results(case: OringCase, pressures: tuple[float, ...]) -> Iterator[OringResult]:
    """Results of a case at increasing pressures [Pa, gauge], each yielded when it is computed.

    ValueError: the pressures are invalid, or the ring does not fit or does not seal; NotConvergedError: Newton's method
    did not converge.
    """
    model = oring_model(case)
    for loaded in loaded_states(case, model, pressures):
        yield evaluate_contact(model, loaded)


def evaluate_contact(model: OringModel, loaded: LoadedRing) -> OringResult:
    """Contact, forces and shape of an equilibrium."""
    position = outline(model, loaded.state)
    pressure = walls.surface_pressure(loaded.surroundings, position)
    upstream = _upstream(loaded, position)
    if loaded.surroundings.faces_walls:
        axial = float(walls.surface_forces(loaded.surroundings, position).force[~upstream, 1].sum())
    else:
        axial = _axial_force(pressure, walls.node_areas(position)[:, 1], upstream)
    gradient = deformation_gradient(model.elements, loaded.state.displacement)
    volumes = model.elements.weights.sum(axis=1)
    ratios = volume_ratios(model.elements, gradient)
    dilatation = (loaded.state.tension / np.ravel(model.rubber.bulk_modulus) * volumes).sum() / volumes.sum()
    nodes = model.mesh.nodes + loaded.state.displacement.reshape(-1, 2)
    von_mises = von_mises_stress(model.rubber, gradient).mean(axis=1)
    rod, gland, wall = (_contact(loaded, position, which) for which in (walls.ROD, walls.GLAND, walls.WALL))
    return OringResult(
        pressure=loaded.pressure,
        rod=rod,
        gland=gland,
        wall=wall,
        axial_force=axial,
        volume_ratio=float((ratios * volumes).sum() / volumes.sum()),
        expected_volume_ratio=float(1.0 + dilatation),
        newton_steps=loaded.newton_steps,
        shape=DeformedSection(nodes, model.mesh.elements, von_mises),
    )


def _axial_force(pressure: walls.SurfacePressure, axial_areas: FloatArray, upstream: BoolArray) -> float:
    """Axial force on the downstream side, corrected for tilted facets at rod and gland upstream [N].

    Rod and gland carry no axial load. The facets at the upstream edges of their contacts are not exactly parallel to
    the axis: a discretisation error.
    """
    axial = pressure.total * axial_areas
    tilted = (pressure.shares[:, 1 + walls.ROD] + pressure.shares[:, 1 + walls.GLAND]) * axial
    return float(axial[~upstream].sum() + tilted[upstream].sum())


def _upstream(loaded: LoadedRing, position: FloatArray) -> BoolArray:
    """Nodes on the fluid side; without pressure, the upstream half (z < 0)."""
    return loaded.surroundings.wetted if loaded.pressure > 0.0 else position[:, 1] < 0.0


def _contact(loaded: LoadedRing, position: FloatArray, wall: int) -> WallContact:
    surroundings = loaded.surroundings
    stresses = walls.wall_stresses(surroundings, position)
    near = (stresses.argmax(axis=1) == wall) & (stresses[:, wall] > -_TOUCHING * surroundings.transition)
    areas = np.linalg.norm(walls.node_areas(position), axis=1)
    stress = walls.surface_pressure(surroundings, position).contact_stress
    fluid = np.where(surroundings.wetted, surroundings.pressure, 0.0)
    if surroundings.faces_walls:
        near = stresses[:, wall] > -_TOUCHING * surroundings.transition
        areas = walls.facing_areas(position, wall)
        contacts = walls.wall_contacts(surroundings, position)
        stress = contacts.excess[:, wall] + contacts.share[:, wall] * fluid
    force = float((stress * areas)[near].sum())
    along = position[:, 0] if wall == walls.WALL else position[:, 1]
    inside = near & (stresses[:, wall] > fluid)
    wall_force = float((stresses[inside, wall] * areas[inside]).sum())
    if not inside.any():
        return WallContact(np.zeros(0), np.zeros(0), force, 0.0, 0.0, (0.0, 0.0))
    touching = np.flatnonzero(inside)
    touching = touching[np.argsort(along[inside], kind='stable')]
    apart = np.abs(np.diff(touching))
    lips = np.split(touching, np.flatnonzero((apart > 1) & (apart < len(along) - 1)) + 1)
    above = stresses[:, wall] - fluid
    edges = [(_edge(along[lip], above[lip]), _edge(along[lip][::-1], above[lip][::-1])) for lip in lips]
    if surroundings.faces_walls:  # a contact ends at a corner
        edges = [_inside_corners(along, lip, ends) for lip, ends in zip(lips, edges, strict=True)]
    places, values, gaps = [along[lips[0]]], [stress[lips[0]]], 0.0
    for lip, before, after in zip(lips[1:], edges, edges[1:], strict=False):
        gap = np.sort([before[1], after[0]])  # two lips that all but touch overlap
        places += [gap, along[lip]]
        values += [np.zeros(2), stress[lip]]
        gaps += float(np.ptp(gap))
    return WallContact(
        np.concatenate(places),
        np.concatenate(values),
        force,
        wall_force,
        float(stress[touching].max()),
        (edges[0][0], edges[-1][1]),
        2.0 * np.pi * float(position[inside, 0].mean()),
        gaps,
    )


def _inside_corners(along: FloatArray, lip: IntArray, edges: tuple[float, float]) -> tuple[float, float]:
    """Edges of a lip, moved to the next nodes of the outline where these lie nearer, to halfway for a single node."""
    around = np.concatenate((along[lip - 1], along[(lip + 1) % len(along)], along[lip]))
    if len(lip) == 1:
        around = 0.5 * (around + along[lip])
        return float(around.min()), float(around.max())
    return max(edges[0], float(around.min())), min(edges[1], float(around.max()))


def _edge(position: FloatArray, above: FloatArray) -> float:
    """Edge of the contact [m], outside the first node in contact.

    Near the edge the contact stress above the fluid pressure grows with the square root of the distance
    [Johnson1985]_: its square is extrapolated linearly, by one node spacing at most.
    """
    if len(position) < 2:
        return float(position[0])
    rise = above[1] ** 2 - above[0] ** 2
    spacings = min(above[0] ** 2 / rise, 1.0) if rise > 0.0 else 1.0
    return float(position[0] - spacings * (position[1] - position[0]))
