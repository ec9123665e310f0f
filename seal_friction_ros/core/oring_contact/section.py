"""Sections of seals as polygons: what a drawing gives, and shapes of which some proportions are enough.

A polygon is an array of (r, z), shape (n, 2), r away from the axis and z downstream. Shapes have a height of 1 along r
and lie around the origin; `placed` scales and moves them.
"""

import inspect
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from seal_friction_ros.core.foundation.arrays import FloatArray

CORNER = np.deg2rad(25.0)  # a turn of the outline by more is a corner, which stays a node of a mesh (our choice)
NEAR_WALL = 0.12  # distance from the innermost or outermost point over the height, within which the outline may touch
_ARC = np.deg2rad(3.0)  # angle between the points of an arc


class Section(NamedTuple):
    """Outline of a seal of rubber, of which a part may be a stiffer cap that is bonded to it."""

    outline: FloatArray  # (r, z) [m], counterclockwise with r to the right and z up, shape (n, 2)
    cap: FloatArray | None = None  # outline of the cap [m], shape (m, 2): it shares edges with the outline

    @property
    def height(self) -> float:
        """Extent along r [m]."""
        return float(np.ptp(self.outline[:, 0]))

    @property
    def length(self) -> float:
        """Extent along z [m]."""
        return float(np.ptp(self.outline[:, 1]))

    @property
    def volume(self) -> float:
        """Volume of the seal [m^3]: 2 pi times the first moment of the section about the axis."""
        (r, z), (r_next, z_next) = self.outline.T, np.roll(self.outline, -1, axis=0).T
        return float(np.pi / 3.0 * ((r + r_next) * (r * z_next - r_next * z)).sum())


def checked_outline(points: FloatArray, name: str) -> FloatArray:
    """Outline of a closed polygon without doubled points, counterclockwise.

    ValueError: the polygon has fewer than three corners or no area, or it crosses or touches itself.
    """
    points = np.asarray(points, dtype=float)
    if points.ndim != 2 or points.shape[1] != 2 or not np.isfinite(points).all():
        raise ValueError(f'{name}: the outline is not a list of finite pairs r, z')
    nearest = 1e-6 * max(float(np.ptp(points, axis=0).max(initial=0.0)), 1e-12)
    points = points[np.linalg.norm(points - np.roll(points, 1, axis=0), axis=1) > nearest]
    if len(points) < 3:
        raise ValueError(f'{name}: the outline has {len(points)} different corners, not three or more')
    crossing = first_crossing(points)
    if crossing is not None:
        r, z = crossing
        raise ValueError(f'{name}: the outline crosses or touches itself near r = {r:.6g}, z = {z:.6g}')
    area = signed_area(points)
    if abs(area) < nearest**2:
        raise ValueError(f'{name}: the outline has no area')
    return points if area > 0.0 else points[::-1]


def signed_area(points: FloatArray) -> float:
    """Area of a polygon, positive if its corners are counterclockwise."""
    return float(0.5 * cross(points, np.roll(points, -1, axis=0)).sum())


def first_crossing(points: FloatArray) -> tuple[float, float] | None:
    """Where two edges of a polygon that are not neighbours meet; None if it is simple."""
    start, along = points, np.roll(points, -1, axis=0) - points
    count = len(points)
    for i in range(count - 2):
        others = np.arange(i + 2, count if i else count - 1)
        between = start[others] - start[i]
        turn = cross(along[i], along[others])
        with np.errstate(divide='ignore', invalid='ignore'):
            here, there = cross(between, along[others]) / turn, cross(between, along[i]) / turn
        met = (here >= 0.0) & (here <= 1.0) & (there >= 0.0) & (there <= 1.0)
        if met.any():
            r, z = start[i] + here[met][0] * along[i]
            return float(r), float(z)
    return None


def cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Cross product of vectors of the plane, shape (..., 2) each."""
    crossed: FloatArray = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    return crossed


def turns_of(polygon: FloatArray) -> FloatArray:
    """Turn of the outline at each corner [rad], shape (n,)."""
    before, after = polygon - np.roll(polygon, 1, axis=0), np.roll(polygon, -1, axis=0) - polygon
    turn: FloatArray = np.arctan2(cross(before, after), (before * after).sum(axis=1))
    return turn


def placed(section: Section, inner_diameter: float, height: float | None = None) -> Section:
    """Section scaled to a ``height`` [m], at a free ``inner_diameter`` [m], the middle of its length at z = 0."""
    scale = 1.0 if height is None else height / section.height
    low, high = section.outline.min(axis=0), section.outline.max(axis=0)
    origin = np.array([low[0], 0.5 * (low[1] + high[1])])
    place = np.array([0.5 * inner_diameter, 0.0])
    cap = None if section.cap is None else scale * (section.cap - origin) + place
    return Section(scale * (section.outline - origin) + place, cap)


def mirrored(section: Section) -> Section:
    """Section with its inside out: that of a piston from that of a rod."""
    turn = np.array([-1.0, 1.0])
    return Section((turn * section.outline)[::-1], None if section.cap is None else (turn * section.cap)[::-1])


def rounded(section: Section, radius: float, *, outside: bool) -> Section:
    """Section whose corners on the inside or ``outside`` are arcs of a ``radius``, smaller where an edge is too short.

    A lip that ends at a sharp corner has no finite rise of pressure there.
    """
    low, high = section.outline[:, 0].min(), section.outline[:, 0].max()

    def with_arcs(polygon: FloatArray) -> FloatArray:
        """Polygon of shape (n, 2) with an arc for each corner near the wall."""
        before, after = polygon - np.roll(polygon, 1, axis=0), np.roll(polygon, -1, axis=0) - polygon
        near = (high - polygon[:, 0] if outside else polygon[:, 0] - low) < NEAR_WALL * (high - low)
        points = []
        for corner, back, on, turn, faces in zip(polygon, before, after, turns_of(polygon), near, strict=True):
            if not faces or turn < CORNER:
                points.append(corner[None])
                continue
            half, shorter = np.tan(0.5 * turn), min(np.linalg.norm(back), np.linalg.norm(on))
            fitting = min(radius, 0.45 * float(shorter) / half)
            direction = back / np.linalg.norm(back)
            center = corner - fitting * half * direction + fitting * np.array([-direction[1], direction[0]])
            begin = np.arctan2(-direction[0], direction[1])
            points.append(_arc(tuple(center), fitting, begin, begin + turn))
        return np.concatenate(points)

    return Section(with_arcs(section.outline), None if section.cap is None else with_arcs(section.cap))


# -- shapes -----------------------------------------------------------------------------------------------------------


def circle() -> Section:
    """O-ring of diameter 1."""
    return Section(_arc((0.0, 0.0), 0.5, 0.0, 2.0 * np.pi)[:-1])


def x_ring(lobe_radius: float = 0.2, groove_depth: float = 0.12) -> Section:
    """X-ring: four lobes in a square of side 1, joined by round grooves that touch them tangentially.

    Makers do not publish the radii; the defaults are ours.
    """
    center = 0.5 - lobe_radius  # of a lobe, on both axes
    bottom = 0.5 - groove_depth
    # groove of radius R about (bottom + R, 0): distance to the lobe (center, center) is R + lobe_radius
    ahead = bottom - center
    radius = (ahead**2 + center**2 - lobe_radius**2) / (2.0 * (lobe_radius - ahead))
    if not (0.0 < lobe_radius < 0.5 and radius > 0.0):
        raise ValueError(f'x_ring: no groove of depth {groove_depth} touches lobes of radius {lobe_radius}')
    lean = np.arctan2(center, radius + ahead)  # of the line from the groove to the lobe
    groove = _arc((bottom + radius, 0.0), radius, np.pi + lean, np.pi - lean)
    lobe = _arc((center, center), lobe_radius, -lean, 0.5 * np.pi + lean)
    side = np.concatenate((groove[:-1], lobe[:-1]))
    turns = [np.array([[c, -s], [s, c]]) for c, s in ((1, 0), (0, 1), (-1, 0), (0, -1))]
    return Section(np.concatenate([side @ turn.T for turn in turns]))


def u_cup(
    length: float = 1.3,
    heel: float = 0.84,
    groove_depth: float = 0.65,
    lip_thickness: float = 0.24,
    tip: float = 0.15,
) -> Section:
    """U-cup of height 1 over the free lips, open against the pressure; all sizes over that height.

    ``heel`` is the height of its back. The flanks rise from the heel to the edges of the lips, which lie ``tip``
    behind the front.
    """
    lip = _lip('u_cup', length, 0.5 * heel, groove_depth, lip_thickness, tip)
    return Section(checked_outline(np.concatenate((lip, (lip * (-1.0, 1.0))[::-1])), 'u_cup'))


def lip_seal(
    length: float = 1.3,
    heel: float = 0.84,
    groove_depth: float = 0.65,
    lip_thickness: float = 0.2,
    tip: float = 0.3,
) -> Section:
    """Asymmetric lip seal of height 1: the lip on the inside slides; that on the outside is longer, thicker, steeper.

    Its ``lip_thickness`` is 0.1 larger, its edge half of ``tip`` behind the front, its flank half as far from the wall.
    """
    rise = (1.0 - heel) / 3.0
    inside = _lip('lip_seal', length, 0.5 - 2.0 * rise, groove_depth, lip_thickness, tip)
    outside = _lip('lip_seal', length, 0.5 - rise, groove_depth, lip_thickness + 0.1, 0.5 * tip)
    return Section(checked_outline(np.concatenate((outside, (inside * (-1.0, 1.0))[::-1])), 'lip_seal'))


def wiper(
    length: float = 1.1,
    heel: float = 0.8,
    groove_depth: float = 0.5,
    lip_thickness: float = 0.3,
    tip: float = 0.1,
) -> Section:
    """Wiper of height 1: a straight leg on the outside, a lip on the inside that points away from the pressure.

    It holds no pressure.
    """
    lip = _lip('wiper', length, heel - 0.5, groove_depth, lip_thickness, tip)
    leg = np.concatenate((lip[:3], [(0.5 - lip_thickness, -0.5 * length), (0.5, -0.5 * length), (0.5, 0.5 * length)]))
    turned = np.concatenate((leg, (lip * (-1.0, 1.0))[::-1])) * (1.0, -1.0)
    return Section(checked_outline(turned, 'wiper'))


def _lip(shape: str, length: float, flank: float, groove_depth: float, lip_thickness: float, tip: float) -> FloatArray:
    """Outer half of a lip in front of a body that reaches to r = ``flank``, from the bottom of its groove to its back.

    Proportions are ours.
    """
    if not (0.0 < lip_thickness < 0.5 and 0.0 < tip < groove_depth < length and 0.1 < flank <= 0.5):
        raise ValueError(
            f'{shape}: 0 < lip_thickness < 0.5, 0 < tip < groove_depth < length, and a body that '
            'reaches 0.1 to 0.5 of the height from the middle (heel) are needed'
        )
    front, back = -0.5 * length, 0.5 * length
    root, inner = front + groove_depth, 0.5 - lip_thickness
    return np.array([
        (0.0, root), (0.5 * inner, root), (inner, root - 0.5 * inner),  # bottom of the groove, bevelled
        (0.5 - 0.75 * lip_thickness, front), (0.5 - 0.35 * lip_thickness, front),  # front of the lip
        (0.5, front + tip), (flank, root), (flank, back - 0.05), (flank - 0.05, back),
    ])  # fmt: skip


def capped_ring(cap_height: float = 0.3, cap_length: float = 0.8) -> Section:
    """Capped ring of height 1: a rectangular cap on the inside, its back bonded to a ring that is round elsewhere.

    A whole ring would touch the cap along a line and roll onto it, a contact of the seal with itself, which is not
    computed: it is cut flat as wide as the cap is long.
    """
    left = 1.0 - cap_height  # radius + sqrt(radius^2 - half^2)
    half, bevel = 0.5 * cap_length, 0.1 * cap_height
    if not (0.05 <= cap_height < 0.8 and 0.0 < half < left):
        raise ValueError('capped_ring: cap_height 0.05 to 0.8, and cap_length below twice the rest, are needed')
    radius = 0.5 * (left + half**2 / left)
    ends = np.pi - np.arcsin(half / radius)
    round_part = _arc((1.0 - radius, 0.0), radius, -ends, ends)
    face = np.array([(bevel, half), (0.0, half - bevel), (0.0, bevel - half), (bevel, -half)])
    return Section(np.concatenate((round_part, face)), np.concatenate((round_part[-1:], face, round_part[:1])))


Shape = Callable[..., Section]
SHAPES: dict[str, Shape] = {one.__name__: one for one in (circle, x_ring, u_cup, lip_seal, wiper, capped_ring)}


def section_of_shape(shape: str, proportions: Mapping[str, Any]) -> Section:
    """Section of a named shape with other ``proportions`` than its own. ValueError: there is no such shape."""
    if shape not in SHAPES:
        raise ValueError(f'section: shape {shape!r} is none of {", ".join(SHAPES)}')
    known = inspect.signature(SHAPES[shape]).parameters
    for name, value in proportions.items():
        if name not in known or not isinstance(value, int | float):
            raise ValueError(f'section: {shape} has no {name} = {value!r}; it has {", ".join(known) or "no sizes"}')
    return SHAPES[shape](**proportions)


def _arc(center: tuple[float, float], radius: float, begin: float, end: float) -> FloatArray:
    angle = np.linspace(begin, end, 1 + max(1, round(abs(end - begin) / _ARC)))
    return np.asarray(center) + radius * np.stack((np.cos(angle), np.sin(angle)), axis=1)
