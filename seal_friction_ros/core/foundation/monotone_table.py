"""Monotone interpolation through measured points: no overshoot, no bump between two points."""

from bisect import bisect_right
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from seal_friction_ros.core.foundation.compiled import bound

Column = tuple[float, ...]


def interpolated(
    knots: Column,
    cubic: Column,
    square: Column,
    slope: Column,
    value: Column,
    last: float,
    slope_beyond: float,
    x: float,
    _unused: float = 0.0,
) -> float:
    """Piecewise cubic at ``x``; before the first knot its ordinate, beyond the last a straight line.

    ``cubic``, ``square`` and ``slope`` are the coefficients of the powers of the distance from each of the increasing
    knots, shape (n - 1,), ``value`` its ordinate. A bound function takes two arguments, so one is not used.
    """
    if x >= knots[-1]:
        return last + slope_beyond * (x - knots[-1]) if slope_beyond else last  # at an infinite x, too
    x = max(x, knots[0])
    i = bisect_right(knots, x) - 1
    t = x - knots[i]
    return ((cubic[i] * t + square[i]) * t + slope[i]) * t + value[i]


class MonotoneTable:
    """Monotone piecewise cubic through points [Fritsch1980]_, constant beyond both ends.

    Above its last point a table that ``rises`` is no constant but goes on with the slope that it has there.

    ``scipy.interpolate.PchipInterpolator`` gives the coefficients. `interpolated` evaluates one value twenty times
    faster than SciPy, since the live estimate asks for one value at a time. Abscissae x and ordinates y have the shape
    (n,), n >= 2; ``name`` is for error messages. ValueError: the points are too few, not finite or not in increasing
    order.
    """

    def __init__(self, x: Sequence[float], y: Sequence[float], name: str, *, rises: bool = False) -> None:
        if len(x) != len(y) or len(x) < 2:
            raise ValueError(f'{name}: needs at least two points with as many ordinates, got {len(x)} and {len(y)}')
        if not (np.isfinite(x).all() and np.isfinite(y).all()):
            raise ValueError(f'{name}: not every point is finite')
        if any(b <= a for a, b in pairwise(x)):
            raise ValueError(f'{name}: abscissae do not increase: {list(x)}')
        from scipy.interpolate import PchipInterpolator  # noqa: PLC0415  half a second, for seals with a table only

        try:
            with np.errstate(all='ignore'):
                spline = PchipInterpolator(x, y)
        except ValueError:  # a slope beyond the largest number
            spline = None
        if spline is None or not np.isfinite(spline.c).all():
            raise ValueError(f'{name}: points too close together or too far apart: {list(x)}')
        self.knots: Column = tuple(float(v) for v in spline.x)
        self.cubic, self.square, self.slope, self.value = (tuple(map(float, row)) for row in spline.c)
        self.last = float(y[-1])
        self.end_slope = float(spline.derivative()(x[-1]))  # Slope at the last point, in units of y over x.
        self.slope_beyond = self.end_slope if rises else 0.0
        self.bound = bound(interpolated, self)

    def __call__(self, x: float) -> float:
        """Value at ``x``."""
        return self.bound(x)
