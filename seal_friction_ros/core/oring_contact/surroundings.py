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

This formulation is our choice.
"""

from typing import NamedTuple

import numpy as np

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
    force = (radius * total)[:, None] * normal
    by_node = radius[:, None, None] * normal[:, :, None] * total_rows[:, None, :]
    by_node[:, :, 0] += total[:, None] * normal
    by_normal = (radius * total)[:, None, None] * np.eye(2)
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


def outline_freedoms(surface: IntArray) -> IntArray:
    """Degrees of freedom (r, z) of previous node, node and next node of the outline, shape (s, 6)."""
    nodes = np.stack((np.roll(surface, 1), surface, np.roll(surface, -1)), axis=1)
    return (2 * nodes[:, :, None] + np.arange(2)).reshape(-1, 6)


def _normals(position: FloatArray) -> FloatArray:
    tangent = 0.5 * (np.roll(position, -1, axis=0) - np.roll(position, 1, axis=0))
    normal: FloatArray = tangent @ _TURN.T
    return normal
