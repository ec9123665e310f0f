"""Mesh of the ring section: an O-grid of quadrilaterals, a square core surrounded by layers that follow the circle."""

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from seal_friction_ros.core.foundation.arrays import FloatArray, IntArray

CORE = 0.5  # Half width of the core over the section radius (our choice: well-shaped elements).
ROUNDING = 0.4  # Bending of the core's sides towards a circle, 0 to 1 (our choice: well-shaped elements).
LAYER_RATIO = 0.5
"""Thickness of the outermost over that of the innermost layer (our choice: the contact is at the surface)."""
CROWDING = 0.4
"""Relative shortening of the edges in the middle of each side (our choice: the edge of the fluid lies there)."""
AXIAL_SHARE = 0.6
"""Number of edges facing the wall over that facing the rod (our choice: rod and gland need the higher resolution)."""


class Mesh(NamedTuple):
    """Quadrilaterals of the section of the undeformed ring, in the (r, z) half plane."""

    nodes: FloatArray  # position (r, z) [m], shape (n, 2)
    elements: IntArray  # corner nodes, counterclockwise with r to the right and z up, shape (e, 4)
    surface: IntArray  # nodes of the outline, counterclockwise from the one nearest to the axis, shape (s,)


def o_grid(section_diameter: float, center_radius: float, lines: int, crowding: float = CROWDING) -> Mesh:
    """O-grid of a circular section of diameter d [m], whose centre is ``center_radius`` [m] off the axis.

    So many grid ``lines`` end on the quarter of the outline that faces the rod; the same number face the gland, fewer
    the wall and the fluid. With a ``crowding`` below 0 the edges are short at both ends of each side. ValueError:
    ``lines`` is below 5.
    """
    if lines < 5:
        raise ValueError(f'o_grid: lines = {lines} is below 5: the contact would have one or two nodes')
    z_sides = lines - 1
    r_sides = max(2, round(AXIAL_SHARE * z_sides))
    layers = max(2, round(0.5 * z_sides))
    position, index = _core(r_sides, z_sides, crowding)
    around = np.roll(outline_of(index), index.shape[1] // 2)  # from the middle of the side nearest to the axis
    circle = position[around] / np.linalg.norm(position[around], axis=1, keepdims=True)
    share = np.cumsum(np.geomspace(1.0, LAYER_RATIO, layers))
    nodes, rows = [position], [around]
    for layer, fraction in enumerate(share / share[-1]):
        nodes.append((1.0 - fraction) * position[around] + fraction * circle)
        rows.append(len(position) + layer * len(around) + np.arange(len(around)))
    blocks = [quadrilaterals_of(index), *(_layer_quadrilaterals(a, b) for a, b in pairwise(rows))]
    center = np.array([center_radius, 0.0])
    return Mesh(center + section_diameter / 2.0 * np.concatenate(nodes), np.concatenate(blocks), rows[-1])


def _core(r_sides: int, z_sides: int, crowding: float) -> tuple[FloatArray, IntArray]:
    """Nodes of the core of a unit circle, shape (n, 2), and their indices, shape (r_sides + 1, z_sides + 1)."""
    sides = [_tangents(count, crowding) for count in (r_sides, z_sides)]
    grid = np.stack(np.meshgrid(*sides, indexing='ij'), axis=-1).reshape(-1, 2)
    level = np.abs(grid).max(axis=1, keepdims=True)
    length = np.linalg.norm(grid, axis=1, keepdims=True)
    length[length == 0.0] = 1.0
    mean_radius = 4.0 / np.pi * np.log(1.0 + np.sqrt(2.0))  # of a square of half width 1
    bent = ROUNDING * level
    position = CORE * ((1.0 - bent) * grid + bent * level * mean_radius * grid / length)
    return position, np.arange(len(grid)).reshape(r_sides + 1, z_sides + 1)


def _tangents(sides: int, crowding: float) -> FloatArray:
    """Positions along a side of the core, -1 to 1, of the grid lines to the surface; denser in the middle."""
    even = np.linspace(-1.0, 1.0, sides + 1)
    angle: FloatArray = np.pi / 4.0 * (even - crowding * np.sin(np.pi * even) / np.pi)
    return np.tan(angle)


def outline_of(index: IntArray) -> IntArray:
    """Indices around a grid of them, counterclockwise from its first corner."""
    return np.concatenate((index[:-1, 0], index[-1, :-1], index[:0:-1, -1], index[0, :0:-1]))


def quadrilaterals_of(index: IntArray) -> IntArray:
    """Corners of the quadrilaterals of a grid of indices, shape (e, 4)."""
    corners = (index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:])
    return np.stack([corner.ravel() for corner in corners], axis=1)


def _layer_quadrilaterals(inner: IntArray, outer: IntArray) -> IntArray:
    return np.stack((inner, outer, np.roll(outer, -1), np.roll(inner, -1)), axis=1)
