"""Film of a given smooth gap: the equations of `reynolds` by themselves, as the tests set them against closed forms."""

from typing import NamedTuple

import numpy as np
from scipy.linalg import solve_banded

from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.foundation.errors import NotConvergedError
from seal_friction_ros.core.lubrication.reynolds import FilmEnds, complementarity, reynolds_rows

ITERATIONS = 100
_TOLERANCE = 1e-14  # of the largest flow, and of the complementarity
OPEN = FilmEnds()


class Film(NamedTuple):
    """Film of a given gap."""

    pressure: FloatArray
    """[Pa] above the cavitation pressure, shape (n,)"""
    saturation: FloatArray
    """share of the gap that is filled, shape (n,)"""
    flow: FloatArray
    """through each face of the cells [m^2/s], to the right, shape (n + 1,)"""
    iterations: int


def film_of_gap(
    gap: FloatArray,
    cell_width: float,
    mean_velocity: float,
    viscosity: float | FloatArray,
    ends: FilmEnds = OPEN,
    old_thickness: FloatArray | None = None,
    time_step: float | None = None,
    density: float | FloatArray = 1.0,
) -> Film:
    """Film of a Newtonian fluid in a given smooth gap, steady or one implicit Euler step in time.

    Args:
        gap: h at the centres of the cells [m], shape (n,).
        cell_width: [m]
        mean_velocity: Half the sum of the velocities of the walls [m/s].
        viscosity: [Pa s], of each cell if shape (n,).
        ends: What is beyond both ends.
        old_thickness: theta h before the step [m], shape (n,); not needed for the steady film.
        time_step: [s]; None for the steady film.
        density: Over that at ambient pressure, of each cell if shape (n,); the flow is that of mass over the latter.

    Raises:
        NotConvergedError: Newton's method did not converge.
    """
    h = np.asarray(gap, dtype=float)
    n = len(h)
    properties = np.array([density * h**3 / (12.0 * viscosity), np.zeros(n), density * h, np.zeros(n)])
    scale = max(
        12.0 * float(np.max(viscosity)) * abs(mean_velocity) * n * cell_width / float(h.min()) ** 2,
        ends.pressure_left,
        ends.pressure_right,
        1.0,
    )
    rate = 0.0 if time_step is None else 1.0 / time_step
    before = np.zeros(n) if old_thickness is None else old_thickness
    largest_flow = max(
        abs(mean_velocity) * float(h.max()),
        abs(ends.pressure_left - ends.pressure_right) * float(properties[0].max()) / (n * cell_width),
        rate * cell_width * float(h.max()),
    )
    pressure, saturation = np.zeros(n), np.ones(n)
    for iteration in range(ITERATIONS):
        residual, rows, flow = reynolds_rows(
            h, pressure, saturation, properties, mean_velocity, rate, before, cell_width, ends
        )
        kept, imperfection = complementarity(pressure, saturation, scale)
        if imperfection <= _TOLERANCE and np.abs(residual).max() <= n * _TOLERANCE * largest_flow:
            return Film(pressure, saturation, flow, iteration)
        change = _eliminated_change(residual, rows, kept)
        pressure = pressure + kept[0] + kept[1] * change
        saturation = saturation + kept[2] + kept[3] * change
    raise NotConvergedError(
        f'film_of_gap: no solution after {ITERATIONS} iterations: complementarity {imperfection:.2g}, '
        f'flow residual {np.abs(residual).max() / largest_flow:.2g} of the largest flow; refine the grid'
    )


def _eliminated_change(residual: FloatArray, rows: FloatArray, kept: FloatArray) -> FloatArray:
    """Newton change of the one unknown that is left in each cell."""
    a, b, c, d = kept
    by_p, by_saturation = rows[0], rows[1]
    right = -residual - _times(by_p, a) - _times(by_saturation, c)
    diagonals = by_p[1] * b + by_saturation[1] * d
    lower, upper = np.zeros_like(b), np.zeros_like(b)
    lower[1:] = by_p[0, 1:] * b[:-1] + by_saturation[0, 1:] * d[:-1]
    upper[:-1] = by_p[2, :-1] * b[1:] + by_saturation[2, :-1] * d[1:]
    return solve_banded((1, 1), (np.append(0.0, upper[:-1]), diagonals, np.append(lower[1:], 0.0)), right)


def _times(rows: FloatArray, x: FloatArray) -> FloatArray:
    """Product of a tridiagonal matrix, rows of shape (3, n), and a vector."""
    product: FloatArray = rows[1] * x
    product[1:] += rows[0, 1:] * x[:-1]
    product[:-1] += rows[2, :-1] * x[1:]
    return product
