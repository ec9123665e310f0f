r"""Average Reynolds equation with mass-conserving cavitation, on cells of one width.

.. math:: \partial_t(\theta h) + \partial_x q = 0,\quad
    q = -M(h)\,\partial_x p + u\,\theta\,c(h),\quad p \ge 0,\ \theta \le 1,\ p\,(1 - \theta) = 0

with the mobility M = phi_x h^3 / (12 eta), the mean velocity u of the two walls, and the height c = h + sigma Phi_s
that shear carries. Pressure counts from the cavitation pressure. The complementarity is kept as an equation of Fischer
and Burmeister, p / p_s + (1 - theta) = sqrt((p / p_s)^2 + (1 - theta)^2), solved by Newton's method; in each cell the
unknown that this equation determines best is eliminated from it (the Schur complement), so one unknown a cell is left.

Saturation is taken from upwind, gap and mobility from both sides of a face: of second order where the film is full
(our choice; upwind of the product, as often done, is of first order everywhere).

Source: T. Woloszynski, P. Podsiadlo, G. W. Stachowiak 2015; N. Patir, H. S. Cheng 1978 and 1979; B. Jakobsson,
L. Floberg 1957; K.-O. Olsson 1965.
"""

from typing import NamedTuple

import numpy as np

from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.foundation.compiled import compiled


class FilmEnds(NamedTuple):
    """Conditions beyond both ends of the film. Where the pressure is above 0 the saturation is 1."""

    pressure_left: float = 0.0  # [Pa] above the cavitation pressure
    pressure_right: float = 0.0  # [Pa] above the cavitation pressure
    saturation_left: float = 1.0  # of the inflow
    saturation_right: float = 1.0  # of the inflow


@compiled
def reynolds_rows(
    gap: FloatArray,
    pressure: FloatArray,
    saturation: FloatArray,
    properties: FloatArray,
    mean_velocity: float,
    rate: float,
    old_thickness: FloatArray,
    width: float,
    ends: FilmEnds,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Outflow less inflow plus storage of each cell, and its derivatives.

    Args:
        gap: h [m], shape (n,).
        pressure: p [Pa], shape (n,).
        saturation: theta, shape (n,).
        properties: M, dM/dh, c, dc/dh of each cell, shape (4, n).
        mean_velocity: u [m/s].
        rate: 1 / time step [1/s]; 0 for the steady film.
        old_thickness: theta h before the step [m], shape (n,).
        width: Width of a cell [m].
        ends: `FilmEnds`.

    Returns:
        Residual [m^2/s], shape (n,); derivatives by pressure, saturation and gap of the cell to the left, itself and
        the cell to the right, shape (3, 3, n); flow through the faces [m^2/s], shape (n + 1,).
    """
    n = gap.shape[0]
    residual, flow = np.empty(n), np.empty(n + 1)
    rows = np.zeros((3, 3, n))
    u = mean_velocity
    for i in range(n):
        residual[i] = (saturation[i] * gap[i] - old_thickness[i]) * width * rate
        rows[1, 1, i] = gap[i] * width * rate
        rows[2, 1, i] = saturation[i] * width * rate
    for face in range(n + 1):
        left, right = max(face - 1, 0), min(face, n - 1)
        inside = 0 < face < n
        span = width if inside else 0.5 * width
        p_left = pressure[left] if face > 0 else ends[0]
        p_right = pressure[right] if face < n else ends[1]
        fall = (p_left - p_right) / span
        mobility = 0.5 * (properties[0, left] + properties[0, right])
        height = 0.5 * (properties[2, left] + properties[2, right])
        upwind = left if u > 0.0 else right
        from_outside = (face == 0 and u > 0.0) or (face == n and u <= 0.0)
        filled = saturation[upwind]
        if from_outside:
            filled = ends[2] if face == 0 else ends[3]
        flow[face] = mobility * fall + u * filled * height
        by_left = 0.5 * (properties[1, left] * fall + u * filled * properties[3, left])
        by_right = 0.5 * (properties[1, right] * fall + u * filled * properties[3, right])
        for row in range(face - 1, face + 1):  # the face is the right one of cell face - 1, the left one of cell face
            if row < 0 or row >= n:
                continue
            sign = 1.0 if row == face - 1 else -1.0
            residual[row] += sign * flow[face]
            at_left, at_right = left - row + 1, right - row + 1
            if face > 0:
                rows[0, at_left, row] += sign * mobility / span
            if face < n:
                rows[0, at_right, row] -= sign * mobility / span
            if not from_outside:
                rows[1, upwind - row + 1, row] += sign * u * height
            rows[2, at_left, row] += sign * by_left
            rows[2, at_right, row] += sign * by_right
    return residual, rows, flow


@compiled
def complementarity(pressure: FloatArray, saturation: FloatArray, scale: float) -> tuple[FloatArray, float]:
    """Newton's equation of Fischer and Burmeister, solved in each cell for the unknown that it determines best.

    Pressure p [Pa] and saturation theta have the shape (n,), the ``scale`` is p_s [Pa]. Returns numbers a, b, c, d of
    each cell, so that the changes of p and theta are a + b x and c + d x of the one unknown x that is left, shape (4,
    n), and the largest residual of the equation.
    """
    n = pressure.shape[0]
    kept = np.empty((4, n))
    largest = 0.0
    for i in range(n):
        p, void = pressure[i] / scale, 1.0 - saturation[i]
        root = np.sqrt(p * p + void * void)
        residual = p + void - root
        largest = max(largest, abs(residual))
        by_p, by_void = 1.0 - np.sqrt(0.5), 1.0 - np.sqrt(0.5)
        if root > 0.0:
            by_p, by_void = 1.0 - p / root, 1.0 - void / root
        if by_p > by_void:  # cavitated: the equation gives the pressure, the saturation is left
            kept[0, i], kept[1, i] = -residual / by_p * scale, by_void / by_p * scale
            kept[2, i], kept[3, i] = 0.0, 1.0
        else:
            kept[0, i], kept[1, i] = 0.0, scale
            kept[2, i], kept[3, i] = residual / by_void, by_p / by_void
    return kept, largest
