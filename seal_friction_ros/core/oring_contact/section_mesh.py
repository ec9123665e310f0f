"""Mesh of any section: points on the outline, Delaunay refinement inside, triangles cut into three quadrilaterals.

Written here because `triangle` and `meshpy` (Triangle) are not free for commercial use and `gmsh` is under the GPL.
"""

from itertools import pairwise

import numpy as np
from scipy.spatial import Delaunay, KDTree
from scipy.spatial.distance import cdist

from seal_friction_ros.core.foundation.arrays import BoolArray, FloatArray, IntArray
from seal_friction_ros.core.oring_contact.mesh import Mesh
from seal_friction_ros.core.oring_contact.section import CORNER, NEAR_WALL, Section, cross, turns_of

_GROWTH = 0.35  # of the edges per distance from the outline (our choice)
_COARSE = 2.0  # edges of the outline that face no wall, over those that do (our choice)
_SHARP, _ON_ARC = 0.05, 0.8
"""radius over the height below which an arc is a rounded corner, whose edges are shorter than others by radius over
height times the second number (our choice)"""
_SMALLEST = 0.2  # shortest edge over the wanted one, in thin parts
_ROUNDS = 40
_SMOOTHING = 8


def section_mesh(section: Section, edge: float) -> Mesh:
    """Mesh whose edges are about ``edge`` [m] long where the section faces a wall.

    ValueError: a part of the section is too thin for edges of a fifth of that.
    """
    for across in (2.0, 3.0, 5.0):
        loop, middles, sizes = _points_along(section, 2.0 * edge, across)
        inner = np.zeros((0, 2)) if section.cap is None else _interface(section.cap, 2.0 * edge)
        fixed = np.concatenate((loop, inner))
        sizes = np.concatenate((sizes, np.full(len(inner), 2.0 * edge)))
        points, triangles = _refined(fixed, sizes, section.outline)
        if _has_edges(triangles, np.arange(len(loop))):
            return _quadrilaterals(points, triangles, middles)
    raise ValueError(f'section_mesh: a part of the section is too thin for edges of {edge:.3g} m')


def inside(points: FloatArray, polygon: FloatArray) -> BoolArray:
    """Whether points, shape (n, 2), lie inside a polygon, shape (m, 2), by the parity of crossings."""
    x, y = points[:, :1], points[:, 1:]
    (x0, y0), (x1, y1) = polygon.T, np.roll(polygon, -1, axis=0).T
    spans = (y0 > y) != (y1 > y)
    with np.errstate(divide='ignore', invalid='ignore'):
        left = x < x0 + (y - y0) / (y1 - y0) * (x1 - x0)
    odd: BoolArray = (spans & left).sum(axis=1) % 2 == 1
    return odd


# -- outline ----------------------------------------------------------------------------------------------------------


def _points_along(section: Section, edge: float, across: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Nodes along the outline, the middles after each, and the wanted edge at the nodes."""
    dense = _subdivided(section.outline, 0.25 * edge)
    sizes = _wanted_sizes(dense, section, edge, across)
    corners = section.outline[np.abs(turns_of(section.outline)) > CORNER]
    if section.cap is not None:
        corners = np.concatenate((corners, section.cap[[0, -1]]))
    if len(corners) < 2:
        corners = section.outline[[0, len(section.outline) // 2]]
    stops = np.unique(cdist(corners, dense).argmin(axis=1))
    nodes, middles, wanted = [], [], []
    for begin, end in pairwise([*stops, stops[0] + len(dense)]):
        run = np.arange(begin, end + 1) % len(dense)
        length = np.linalg.norm(np.diff(dense[run], axis=0), axis=1)
        steps = np.concatenate(([0.0], np.cumsum(length / (0.5 * (sizes[run][:-1] + sizes[run][1:])))))
        count = max(1, round(float(steps[-1])))
        places = np.interp(np.linspace(0.0, 1.0, 2 * count + 1), steps / steps[-1], np.arange(len(run)))
        at = np.stack([np.interp(places, np.arange(len(run)), dense[run, k]) for k in (0, 1)], axis=1)
        nodes.append(at[:-1:2])
        middles.append(at[1::2])
        wanted.append(np.interp(places[:-1:2], np.arange(len(run)), sizes[run]))
    loop, between, size = np.concatenate(nodes), np.concatenate(middles), np.concatenate(wanted)
    first = int(np.argmin(loop[:, 0]))
    return np.roll(loop, -first, axis=0), np.roll(between, -first, axis=0), np.roll(size, -first)


def _subdivided(polygon: FloatArray, step: float) -> FloatArray:
    after = np.roll(polygon, -1, axis=0)
    counts = np.ceil(np.linalg.norm(after - polygon, axis=1) / step).astype(int)
    shares = [np.arange(count)[:, None] / count for count in np.maximum(counts, 1)]
    points: FloatArray = np.concatenate(
        [a + share * (b - a) for a, b, share in zip(polygon, after, shares, strict=True)]
    )
    return points


def _rounded_corners(polygon: FloatArray, sharpest: float) -> tuple[FloatArray, FloatArray]:
    """Points of arcs of a radius below ``sharpest``, shape (n, 2), and their radii, shape (n,)."""
    length = np.linalg.norm(np.roll(polygon, -1, axis=0) - polygon, axis=1)
    turns = np.abs(turns_of(polygon))
    radii = np.minimum(length, np.roll(length, 1)) / np.maximum(turns, 1e-9)
    arc = (turns < CORNER) & (radii < sharpest)
    return polygon[arc], radii[arc]


def _wanted_sizes(dense: FloatArray, section: Section, edge: float, across: float) -> FloatArray:
    """Wanted edge along the outline: short at the walls and in thin parts, growing gradually from there."""
    low, high = section.outline[:, 0].min(), section.outline[:, 0].max()
    near = np.minimum(dense[:, 0] - low, high - dense[:, 0]) < NEAR_WALL * (high - low)
    sizes = np.where(near, edge, _COARSE * edge)
    sizes = np.clip(np.minimum(sizes, _thickness(dense, section.outline) / across), _SMALLEST * edge, None)
    arcs, radii = _rounded_corners(section.outline, _SHARP * (high - low))
    on_arcs = _ON_ARC * edge * radii / (high - low) + _GROWTH * cdist(dense, arcs)
    sizes = np.minimum(sizes, on_arcs.min(axis=1, initial=np.inf))
    grown: FloatArray = (sizes + _GROWTH * cdist(dense, dense)).min(axis=1)
    return grown


def _thickness(dense: FloatArray, polygon: FloatArray) -> FloatArray:
    """Length of the chord inwards along the normal, from each of the points of the outline."""
    tangent = np.roll(dense, -1, axis=0) - np.roll(dense, 1, axis=0)
    inward = np.stack((-tangent[:, 1], tangent[:, 0]), axis=1) / np.linalg.norm(tangent, axis=1)[:, None]
    along = np.roll(polygon, -1, axis=0) - polygon
    between = polygon[None] - dense[:, None]
    turn = cross(inward[:, None], along)
    with np.errstate(divide='ignore', invalid='ignore'):
        far, at = cross(between, along) / turn, cross(between, inward[:, None]) / turn
    far[~((far > 1e-3 * np.ptp(polygon, axis=0).max()) & (at >= 0.0) & (at <= 1.0))] = np.inf
    chord: FloatArray = far.min(axis=1)
    return chord


def _interface(cap: FloatArray, edge: float) -> FloatArray:
    """Points between cap and rubber, without the two ends, which lie on the outline: the closing edge of the cap."""
    begin, end = cap[-1], cap[0]
    count = max(2, round(float(np.linalg.norm(end - begin)) / edge))
    places: FloatArray = begin + np.linspace(0.0, 1.0, count + 1)[1:-1, None] * (end - begin)
    return places


# -- inside -----------------------------------------------------------------------------------------------------------


def _refined(fixed: FloatArray, sizes: FloatArray, outline: FloatArray) -> tuple[FloatArray, IntArray]:
    """Points and triangles inside the outline: centres of too large triangles are added, then points are smoothed."""
    points = fixed
    for _ in range(_ROUNDS):
        added = _new_points(points, _triangles(points, outline), fixed, sizes, outline)
        if not len(added):
            break
        points = np.concatenate((points, added))
    for _ in range(_SMOOTHING):
        points = _smoothed(points, _triangles(points, outline), len(fixed))
    return points, _triangles(points, outline)


def _triangles(points: FloatArray, outline: FloatArray) -> IntArray:
    """Counterclockwise triangles of Delaunay whose middle is inside the outline."""
    corners: IntArray = np.asarray(Delaunay(points).simplices, dtype=int)
    size = float(np.ptp(outline, axis=0).max())
    corners = corners[inside(points[corners].mean(axis=1), outline)]
    a, b, c = points[corners.T]
    return corners[cross(b - a, c - a) > 1e-9 * size**2]


def _new_points(
    points: FloatArray, triangles: IntArray, fixed: FloatArray, sizes: FloatArray, outline: FloatArray
) -> FloatArray:
    """Centres of the circles around triangles that are larger than wanted, no two close to each other."""
    p = points[triangles]
    a, b = p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]
    doubled = 2.0 * cross(a, b)
    aa, bb = (a**2).sum(axis=1), (b**2).sum(axis=1)
    offset = np.stack((b[:, 1] * aa - a[:, 1] * bb, a[:, 0] * bb - b[:, 0] * aa), axis=1) / doubled[:, None]
    center, radius = p[:, 0] + offset, np.linalg.norm(offset, axis=1)
    wanted = (sizes + _GROWTH * cdist(center, fixed)).min(axis=1)
    order = np.argsort(-radius / wanted, kind='stable')
    order = order[(radius > 0.7 * wanted)[order]]
    order = order[inside(center[order], outline)]
    order = order[KDTree(fixed).query(center[order])[0] > 0.6 * wanted[order]] if len(order) else order
    added: list[FloatArray] = []
    for i in order.tolist():
        if all(np.hypot(*(center[i] - other)) > 0.8 * wanted[i] for other in added):
            added.append(center[i])
    return np.array(added).reshape(-1, 2)


def _smoothed(points: FloatArray, triangles: IntArray, fixed: int) -> FloatArray:
    """Points moved to the mean of their neighbours, but for the first ones."""
    pairs = np.concatenate([triangles[:, [i, j]] for i in range(3) for j in range(3) if i != j])
    sums = np.stack([np.bincount(pairs[:, 0], points[pairs[:, 1], k], len(points)) for k in (0, 1)], axis=1)
    counts = np.maximum(np.bincount(pairs[:, 0], minlength=len(points)), 1)[:, None]
    moved = points.copy()
    moved[fixed:] = (sums / counts)[fixed:]
    return moved


def _has_edges(triangles: IntArray, loop: IntArray) -> bool:
    """Whether all edges of a closed loop of nodes are edges of one triangle each."""
    directed = {(int(a), int(b)) for t in triangles for a, b in ((t[0], t[1]), (t[1], t[2]), (t[2], t[0]))}
    return all((int(a), int(b)) in directed for a, b in zip(loop, np.roll(loop, -1), strict=True))


def _quadrilaterals(points: FloatArray, triangles: IntArray, middles: FloatArray) -> Mesh:
    """Each triangle cut from its middle to the middles of its edges; those of the outline lie on it."""
    used = np.unique(triangles)
    renumber = np.full(len(points), -1)
    renumber[used] = np.arange(len(used))
    points, triangles = points[used], renumber[triangles]
    edges = np.sort(np.concatenate([triangles[:, [i, (i + 1) % 3]] for i in range(3)]), axis=1)
    unique, which = np.unique(edges, axis=0, return_inverse=True)
    which = np.reshape(which, -1)
    between = points[unique].mean(axis=1)
    loop = np.arange(len(middles))
    key = {(int(a), int(b)): k for k, (a, b) in enumerate(unique)}
    on = np.array([key[min(a, b), max(a, b)] for a, b in zip(loop.tolist(), np.roll(loop, -1).tolist(), strict=True)])
    between[on] = middles
    first, second = len(points), len(points) + len(unique)
    nodes = np.concatenate((points, between, points[triangles].mean(axis=1)))
    count = len(triangles)
    side = first + which.reshape(3, count).T  # middle node after each corner
    center = second + np.arange(count)
    quads = [np.stack((triangles[:, i], side[:, i], center, side[:, i - 1]), axis=1) for i in range(3)]
    surface = np.stack((loop, first + on), axis=1).ravel()
    return Mesh(nodes, np.concatenate(quads), surface)
