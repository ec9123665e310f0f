r"""What presses on the ring from outside: rigid walls and fluid, as one pressure on the deformed surface.

.. math:: q = \mathrm{smax}(p, \kappa g_{rod}, \kappa g_{gland}, \kappa g_{wall}), \quad
    \mathrm{smax}(a_i) = \delta \ln \sum_i e^{a_i / \delta}

g is how deep a point of the surface is inside a wall, kappa the penalty stiffness, and p the fluid pressure on the
upstream side, 0 on the other. So fluid enters wherever the contact stress falls below its pressure. A hard maximum
makes Newton's method jump to and fro, and lets the edge of the fluid move by whole nodes; the smooth one differs from
it within a few delta. What the walls take is q less the fluid's share of p: the contact stress. A share is the
derivative of smax:

.. math:: \sigma = q - w_p\,p, \quad w_i = e^{(a_i - q) / \delta}

The pressure acts along the normal of the deformed surface and on its deformed area (a follower load), so the axial
forces of fluid and wall balance by themselves. It is sampled at the nodes, each standing for the surface halfway to its
two neighbours: samples inside the edges would ask for more contact conditions than there are nodes to meet them.

All of it is our own choice.
"""

from typing import NamedTuple

import numpy as np

from seal_friction_ros.core.foundation.arrays import BoolArray, FloatArray, IntArray

ROD, GLAND, WALL = 0, 1, 2
_WALL_NORMALS = np.array([[-1.0, 0.0], [1.0, 0.0], [0.0, 1.0]])  # into the wall, over (r, z)
_TURN = np.array([[0.0, 1.0], [-1.0, 0.0]])  # tangent to outward normal, for an outline that runs counterclockwise


class Surroundings(NamedTuple):
    """Walls, fluid, and how sharply they are told apart."""

    rod_radius: float
    """[m]"""
    gland_radius: float
    """[m]"""
    wall_position: float
    """z of the downstream wall [m]; infinite if there is none"""
    pressure: float
    """of the fluid [Pa, gauge]"""
    wetted: BoolArray
    """nodes of the outline on the upstream side, shape (s,)"""
    penalty: float
    """kappa [Pa/m]"""
    transition: float
    """delta [Pa]"""
    friction: float = 0.0
    """axial traction of rod and gland on the ring, upstream, over their share of q [-]"""


class SurfacePressure(NamedTuple):
    """Pressure on the outline, by node."""

    total: FloatArray
    """q [Pa], shape (s,)"""
    shares: FloatArray
    """w of fluid, rod, gland and wall [-], shape (s, 4)"""
    contact_stress: FloatArray
    """sigma [Pa], shape (s,)"""


class SurfaceForces(NamedTuple):
    """What the surroundings add to the balance of the nodes of the outline."""

    force: FloatArray
    """minus the force (r, z) on each node, all around the axis [N], shape (s, 2)"""
    stiffness: FloatArray
    """its change with r and z of the node before, the node and the node after [N/m], shape (s, 2, 6)"""


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
    """Penalty times depth inside rod, gland and wall [Pa], shape (s, 3); negative outside."""
    r, z = position[:, 0], position[:, 1]
    depths = (surroundings.rod_radius - r, r - surroundings.gland_radius, z - surroundings.wall_position)
    return surroundings.penalty * np.stack(depths, axis=1)


def node_areas(position: FloatArray) -> FloatArray:
    """Outward normal of the surface that each node stands for, as long as its area [m^2], shape (s, 2)."""
    return 2.0 * np.pi * position[:, :1] * _normals(position)


def surface_forces(surroundings: Surroundings, position: FloatArray) -> SurfaceForces:
    """Forces and their derivative for an outline at ``position`` [m], shape (s, 2)."""
    total, shares, _ = surface_pressure(surroundings, position)
    walls = surroundings.penalty * _WALL_NORMALS
    total_rows = shares[:, 1:] @ walls  # dq/dx [Pa/m]
    normal, radius = _normals(position), position[:, 0]
    # force = 2 pi r q n: its parts change with the node itself and, through n, with its neighbours
    force = (radius * total)[:, None] * normal
    by_node = radius[:, None, None] * normal[:, :, None] * total_rows[:, None, :]
    by_node[:, :, 0] += total[:, None] * normal
    by_normal = (radius * total)[:, None, None] * np.eye(2)
    if surroundings.friction:  # traction -mu w q along z on the length of n; the balance takes minus the force
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
    """R and z of the node before, each node of the outline and the node after, shape (s, 6)."""
    nodes = np.stack((np.roll(surface, 1), surface, np.roll(surface, -1)), axis=1)
    return (2 * nodes[:, :, None] + np.arange(2)).reshape(-1, 6)


def _normals(position: FloatArray) -> FloatArray:
    tangent = 0.5 * (np.roll(position, -1, axis=0) - np.roll(position, 1, axis=0))
    normal: FloatArray = tangent @ _TURN.T
    return normal
