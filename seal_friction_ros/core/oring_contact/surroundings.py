r"""External load on the ring: rigid walls and fluid as one pressure on the deformed surface.

.. math:: q = \mathrm{smax}(p, \kappa g_{rod}, \kappa g_{gland}, \kappa g_{wall}), \quad
    \mathrm{smax}(a_i) = \delta \ln \sum_i e^{a_i / \delta}

g is the penetration depth of a surface point into a wall, kappa the penalty stiffness, and p the fluid pressure on the
upstream side, 0 on the downstream side. Fluid therefore enters wherever the contact stress falls below its pressure.
With a hard maximum Newton's method oscillates and the edge of the fluid moves in steps of whole nodes; the smooth
maximum differs from it only where two terms are within a few delta. The contact stress is q less the fluid's share of
p; the shares w are the derivatives of smax:

.. math:: \sigma = q - w_p\,p, \quad w_i = e^{(a_i - q) / \delta}

The pressure acts along the normal of the deformed surface, on the deformed area (follower load), so the axial forces
of fluid and wall balance. It is evaluated at the nodes, each of which represents the surface halfway to its two
neighbours: evaluation points inside the edges would impose more contact conditions than there are nodes.

A node at a corner of a section has a normal that leans from that of the wall, and may touch two walls. So for sections
with corners (``faces_walls``) each wall acts on its own, along its own normal and on the area that faces it, with what
it adds to the pressure of the fluid.

This formulation is our choice.
"""

from typing import NamedTuple

import numpy as np
from scipy.special import expit

from seal_friction_ros.core.foundation.arrays import BoolArray, FloatArray, IntArray

ROD, GLAND, WALL = 0, 1, 2
_WALL_NORMALS = np.array([[-1.0, 0.0], [1.0, 0.0], [0.0, 1.0]])  # into the wall, (r, z)
_TURN = np.array([[0.0, 1.0], [-1.0, 0.0]])  # tangent to outward normal of a counterclockwise outline


class Surroundings(NamedTuple):
    """Walls, fluid, penalty stiffness and width of the transition."""

    rod_radius: float  # [m]
    gland_radius: float  # [m]
    wall_position: float  # z of the downstream wall [m]; infinity: no wall
    pressure: float  # of the fluid [Pa, gauge]
    wetted: BoolArray  # nodes of the outline on the upstream side, shape (s,)
    penalty: float  # kappa [Pa/m]
    transition: float  # delta [Pa]
    friction: float = 0.0  # axial traction of rod and gland on the ring, directed upstream, over their share of q [-]
    faces_walls: bool = False  # walls push along their own normals, not along that of the surface


class SurfacePressure(NamedTuple):
    """Pressure on each node of the outline."""

    total: FloatArray  # q [Pa], shape (s,)
    shares: FloatArray  # w of fluid, rod, gland and downstream wall [-], shape (s, 4)
    contact_stress: FloatArray  # sigma [Pa], shape (s,)


class SurfaceForces(NamedTuple):
    """Contributions of the surroundings to the balance of forces on the nodes of the outline."""

    force: FloatArray  # minus the force (r, z) on each node, over the full circumference [N], shape (s, 2)
    stiffness: FloatArray
    """derivative by r and z of the previous node, the node and the next node [N/m], shape (s, 2, 6)"""


def surface_pressure(surroundings: Surroundings, position: FloatArray) -> SurfacePressure:
    """Pressure on the nodes of the outline at ``position`` [m], shape (s, 2)."""
    fluid = np.where(surroundings.wetted, surroundings.pressure, 0.0)
    stresses = np.concatenate((fluid[:, None], wall_stresses(surroundings, position)), axis=1)
    highest = stresses.max(axis=1, keepdims=True)
    parts = np.exp((stresses - highest) / surroundings.transition)
    sums = parts.sum(axis=1, keepdims=True)
    shares = parts / sums
    total: FloatArray = (highest + surroundings.transition * np.log(sums))[:, 0]
    return SurfacePressure(total, shares, total - fluid * shares[:, 0])


def wall_stresses(surroundings: Surroundings, position: FloatArray) -> FloatArray:
    """Penalty times penetration into rod, gland and downstream wall [Pa], shape (s, 3); negative outside."""
    r, z = position[:, 0], position[:, 1]
    depths = (surroundings.rod_radius - r, r - surroundings.gland_radius, z - surroundings.wall_position)
    return surroundings.penalty * np.stack(depths, axis=1)


def node_areas(position: FloatArray) -> FloatArray:
    """Outward normal times area of the surface that each node represents [m^2], shape (s, 2)."""
    return 2.0 * np.pi * position[:, :1] * _normals(position)


def surface_forces(surroundings: Surroundings, position: FloatArray) -> SurfaceForces:
    """Forces and their derivatives for an outline at ``position`` [m], shape (s, 2)."""
    total, shares, _ = surface_pressure(surroundings, position)
    walls = surroundings.penalty * _WALL_NORMALS
    total_rows = shares[:, 1:] @ walls  # dq/dx [Pa/m]
    normal, radius = _normals(position), position[:, 0]
    # force = 2 pi r q n: r and q depend on the node itself, n on its two neighbours
    by_normal = (radius * total)[:, None, None] * np.eye(2)
    if surroundings.faces_walls:
        traction, by_node, by_normal = _facing_forces(surroundings, position, normal)
        by_node, by_normal = radius[:, None, None] * by_node, radius[:, None, None] * by_normal
    else:
        traction = total[:, None] * normal
        by_node = radius[:, None, None] * normal[:, :, None] * total_rows[:, None, :]
    force = radius[:, None] * traction
    by_node[:, :, 0] += traction
    if surroundings.friction:  # traction -mu w q along z on the length of n; `SurfaceForces` holds minus the force
        share = shares[:, 1 + ROD] + shares[:, 1 + GLAND]
        stress = surroundings.friction * share * total
        leaning = shares[:, [1 + ROD, 1 + GLAND]] @ walls[[ROD, GLAND]]
        share_rows = (leaning - share[:, None] * total_rows) / surroundings.transition
        stress_rows = surroundings.friction * (share_rows * total[:, None] + share[:, None] * total_rows)
        length = np.linalg.norm(normal, axis=1)
        force[:, 1] += radius * stress * length
        by_node[:, 1, :] += (radius * length)[:, None] * stress_rows
        by_node[:, 1, 0] += stress * length
        by_normal[:, 1, :] += (radius * stress / length)[:, None] * normal
    by_neighbour = 0.5 * by_normal @ _TURN
    stiffness = np.concatenate((-by_neighbour, by_node, by_neighbour), axis=2)
    return SurfaceForces(2.0 * np.pi * force, 2.0 * np.pi * stiffness)


class WallContacts(NamedTuple):
    """What each wall adds to the fluid at the nodes of the outline, see `Surroundings.faces_walls`."""

    excess: FloatArray  # of the pressure on the surface over that of the fluid [Pa], shape (s, 3)
    share: FloatArray  # of the pressure that the wall bears and not the fluid [-], shape (s, 3)


def wall_contacts(surroundings: Surroundings, position: FloatArray) -> WallContacts:
    r"""Contacts with each wall on its own: smax of fluid and that wall, less p.

    .. math:: c_i = \delta \ln(1 + e^{(\kappa g_i - p) / \delta})
    """
    fluid = np.where(surroundings.wetted, surroundings.pressure, 0.0)
    above = (wall_stresses(surroundings, position) - fluid[:, None]) / surroundings.transition
    return WallContacts(surroundings.transition * np.logaddexp(0.0, above), expit(above))


def _facing_forces(
    surroundings: Surroundings, position: FloatArray, normal: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    r"""Traction times length of `Surroundings.faces_walls`, shape (s, 2), and its derivatives by position and normal.

    .. math:: t = p n + \sum_i c_i \max(n N_i, 0) N_i
    """
    fluid = np.where(surroundings.wetted, surroundings.pressure, 0.0)
    excess, share = wall_contacts(surroundings, position)
    facing = normal @ _WALL_NORMALS.T
    faces, facing = facing > 0.0, np.maximum(facing, 0.0)
    into = _WALL_NORMALS[:, :, None] * _WALL_NORMALS[:, None, :]
    traction = fluid[:, None] * normal + (excess * facing) @ _WALL_NORMALS
    by_node = surroundings.penalty * np.einsum('si,ikl->skl', share * facing, into)
    by_normal = fluid[:, None, None] * np.eye(2) + np.einsum('si,ikl->skl', excess * faces, into)
    return traction, by_node, by_normal


def facing_areas(position: FloatArray, wall: int) -> FloatArray:
    """Area of each node that faces a wall [m^2], shape (s,)."""
    areas: FloatArray = np.maximum(node_areas(position) @ _WALL_NORMALS[wall], 0.0)
    return areas


def outline_freedoms(surface: IntArray) -> IntArray:
    """Degrees of freedom (r, z) of previous node, node and next node of the outline, shape (s, 6)."""
    nodes = np.stack((np.roll(surface, 1), surface, np.roll(surface, -1)), axis=1)
    return (2 * nodes[:, :, None] + np.arange(2)).reshape(-1, 6)


def _normals(position: FloatArray) -> FloatArray:
    tangent = 0.5 * (np.roll(position, -1, axis=0) - np.roll(position, 1, axis=0))
    normal: FloatArray = tangent @ _TURN.T
    return normal
