"""Monotone interpolation through measured points: no overshoot, no invented bumps."""

from bisect import bisect_right
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from seal_friction_ros.core.foundation.arrays import FloatArray


class MonotoneTable:
    """Monotone piecewise cubic through points [Fritsch1980]_; held constant beyond both ends.

    The coefficients come from ``scipy.interpolate.PchipInterpolator``; a single value is evaluated here, some twenty
    times faster than there, since the live estimate asks for one value at a time.

    Args:
        x: Abscissae, strictly increasing, shape (n,), n >= 2.
        y: Ordinates, shape (n,), finite.
        name: What the table is, for error messages.

    Raises:
        ValueError: The points are too few, not finite or not in increasing order.
    """

    def __init__(self, x: Sequence[float], y: Sequence[float], name: str) -> None:
        if len(x) != len(y) or len(x) < 2:
            raise ValueError(f'{name}: needs at least two points with as many ordinates, got {len(x)} and {len(y)}')
        if not (np.isfinite(x).all() and np.isfinite(y).all()):
            raise ValueError(f'{name}: not every point is finite')
        if any(b <= a for a, b in pairwise(x)):
            raise ValueError(f'{name}: abscissae do not increase: {list(x)}')
        from scipy.interpolate import PchipInterpolator  # noqa: PLC0415  half a second, for seals with a table only

        with np.errstate(all='ignore'):
            spline = PchipInterpolator(x, y)
        if not np.isfinite(spline.c).all():
            raise ValueError(f'{name}: points too close together or too far apart: {list(x)}')
        self._knots = [float(v) for v in spline.x]
        self._cubics = [tuple(float(c) for c in column) for column in spline.c.T]
        self._last = float(y[-1])
        self.end_slope = float(spline.derivative()(x[-1]))
        """Slope at the last point, in units of y over x."""

    def __call__(self, x: float) -> float:
        """Value at ``x``; the first or last ordinate beyond the ends."""
        knots = self._knots
        if x >= knots[-1]:
            return self._last
        x = max(x, knots[0])
        interval = bisect_right(knots, x) - 1
        cubic, square, slope, value = self._cubics[interval]
        t = x - knots[interval]
        return ((cubic * t + square) * t + slope) * t + value

    def at_each(self, x: FloatArray) -> FloatArray:
        """Value at each of ``x``, finite, shape (n,): the same bits as one by one, being sums and products."""
        knots = np.array(self._knots)
        inside = np.where(x < knots[0], knots[0], x)
        interval = np.minimum(np.searchsorted(knots, inside, side='right') - 1, len(self._cubics) - 1)
        cubic, square, slope, value = np.array(self._cubics).T[:, interval]
        t = inside - knots[interval]
        return np.where(x >= knots[-1], self._last, ((cubic * t + square) * t + slope) * t + value)
