r"""Roughness from a measured surface: what `Topography` needs of heights from a profilometer or a microscope.

The heights, less their form, have the autocorrelation :math:`\rho(r)`. A self-affine surface of Hurst exponent 0.8,
that of `Topography`, with the longest wavelength :math:`2 \pi / q_0` has

.. math:: \rho(r) = 2 H \int_1^\infty s^{-1 - 2 H} J_0(s\,q_0 r)\,ds

so the length over which it falls to 0.2 [ISO25178]_ gives the longest wavelength.
"""

import math
from typing import NamedTuple

import numpy as np

from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.lubrication.flow_factors import PEKLENIK_NUMBERS

CORRELATED = 0.2  # autocorrelation at the autocorrelation length, as of ISO 25178-2
_ROLL_OFF = 4.926  # longest wavelength over autocorrelation length, by the equation above
_FEWEST = 64  # heights along a profile
_LENGTHS = 10.0  # autocorrelation lengths that a profile has to have (our choice)


class Roughness(NamedTuple):
    """Statistics of one measured surface."""

    rms_height: float  # Rq of a profile, Sq of a map [m]
    rms_slope: float  # of the steepest descent [-]; a profile counts as isotropic
    autocorrelation_length: float  # along the motion; across it, where there is a map, by the Peklenik number [m]
    peklenik_number: float  # length along over across the motion; 1 for a profile


def measured_roughness(heights: FloatArray, spacing: tuple[float, float]) -> Roughness:
    """Roughness of heights [m], shape (m, n), at steps of ``spacing`` [m] across and along the motion.

    A profile has the shape (1, n). A parabola along each axis is taken away as form (our choice). The slope is that at
    these steps: finer steps give a steeper one.

    ValueError: there are too few heights, they are level, or the surface is shorter than ten of its autocorrelation
    lengths.
    """
    if heights.shape[1] < _FEWEST or not np.isfinite(heights).all():
        raise ValueError(f'a surface needs {_FEWEST} finite heights or more along the motion, not {heights.shape[1]}')
    rough = _without_form(heights)
    rms = float(np.sqrt((rough**2).mean()))
    if not rms > 1e-12:
        raise ValueError(f'the surface is level: its rms roughness is {rms:.2g} m')
    is_map = len(heights) >= _FEWEST
    length = _correlated(rough, spacing[1])
    across = _correlated(rough.T, spacing[0]) if is_map else length
    slopes = [float((np.diff(rough, axis=1) ** 2).mean()) / spacing[1] ** 2]
    slopes.append(float((np.diff(rough, axis=0) ** 2).mean()) / spacing[0] ** 2 if is_map else slopes[0])
    return Roughness(rms, math.sqrt(sum(slopes)), length, length / across)


def topography_of(wall: Roughness | None, seal: Roughness | None) -> dict[str, float]:
    """Fields of `Topography` for the surfaces that were measured, None: smooth; squares of heights and slopes add.

    The longest wavelength is the mean of both by the squares of the heights, as their autocorrelations add; the number
    of Peklenik is the nearest one that has flow factors. ValueError: nothing was measured.
    """
    surfaces = [one for one in (wall, seal) if one is not None]
    if not surfaces:
        raise ValueError('no surface was measured')
    squares = np.array([one.rms_height**2 for one in surfaces])
    shares = squares / squares.sum()
    number = math.exp(float(shares @ [math.log(one.peklenik_number) for one in surfaces]))
    return {
        'rms_height': math.sqrt(squares.sum()),
        'rms_slope': math.sqrt(sum(one.rms_slope**2 for one in surfaces)),
        'roll_off_length': _ROLL_OFF * float(shares @ [one.autocorrelation_length for one in surfaces]),
        'wall_share': 0.0 if wall is None else float(wall.rms_height**2 / squares.sum()),
        'peklenik_number': min(PEKLENIK_NUMBERS, key=lambda known: abs(math.log(known / number))),
    }


def _without_form(heights: FloatArray) -> FloatArray:
    """Heights less the best sum of a parabola along each axis."""
    places = np.meshgrid(*(np.linspace(-1.0, 1.0, count) for count in heights.shape), indexing='ij')
    columns = [np.ones(heights.size)]
    columns += [place.ravel() ** k for place in places for k in (1, 2) if np.ptp(place) > 0.0]
    form = np.stack(columns, axis=1)
    rest: FloatArray = heights.ravel() - form @ np.linalg.lstsq(form, heights.ravel(), rcond=None)[0]
    return rest.reshape(heights.shape)


def _correlated(rough: FloatArray, spacing: float) -> float:
    """Length along the last axis over which the autocorrelation falls to `CORRELATED` [m]."""
    count = rough.shape[1]
    power = np.abs(np.fft.rfft(rough, 2 * count, axis=1)) ** 2
    overlap = np.fft.irfft(power, axis=1)[:, :count].mean(axis=0) / (count - np.arange(count))
    correlation = overlap / overlap[0]
    fallen = int(np.argmax(correlation < CORRELATED))
    if not 0 < fallen <= count / _LENGTHS:
        raise ValueError(
            f'the surface is shorter than {_LENGTHS:g} of its autocorrelation lengths: measure a longer one'
        )
    high, low = correlation[fallen - 1], correlation[fallen]
    return float(spacing * (fallen - 1 + (high - CORRELATED) / (high - low)))
