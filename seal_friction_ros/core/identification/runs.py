"""How much one seal differs from run to run.

A run is one mounting, one day: a ring on the Delft rig differs by 10 to 65 % between two of them. A law that was fitted
to one run says nothing about that, so a prior stands in until runs are repeated.
"""

import math
from typing import NamedTuple

import numpy as np
from scipy.special import stdtrit

from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.foundation.normal_distribution import BAND_95
from seal_friction_ros.core.identification.readings import FrictionReadings

PRIOR_STD = 0.15  # [-] of the friction between runs of one seal, expected before any is seen (our choice)
PRIOR_FREEDOM = 8.0  # degrees of freedom that this is worth (our choice)
ANOTHER_SEAL = 2.0  # ratio of the friction of two sources above which they are two seals (our choice)


class BetweenRuns(NamedTuple):
    """Relative standard deviation of the friction between runs."""

    std: float  # [-] of a new run
    measured: float  # [-] of the runs at hand; NaN if none was repeated
    freedom: int  # degrees of freedom behind ``measured``

    @property
    def of_band(self) -> float:
        """Standard deviation whose 95 % band holds 95 % of new runs [-]: of Student's t, since ``std`` is uncertain."""
        return self.std * float(stdtrit(PRIOR_FREEDOM + self.freedom, 0.975)) / BAND_95


def between_runs(readings: FrictionReadings, friction: FloatArray, offsets: FloatArray) -> BetweenRuns:
    """Standard deviation between runs, from sources that repeat a pressure, or from swept logs.

    std^2 = (nu_0 s_0^2 + nu s^2) / (nu_0 + nu): the scale of a scaled inverse chi-squared posterior with the prior
    s_0 = `PRIOR_STD` of weight nu_0 = `PRIOR_FREEDOM`, where s is measured with nu degrees of freedom. The conjugate
    prior of a variance is in [Gelman2013]_, section 2.6; its numbers are our choice.
    ``friction`` [N], shape (n,), and ``offsets`` of the sources [N] are by the law that was fitted to all runs.
    """
    squares, freedom = 0.0, 0
    if readings.are_samples:
        parts = [np.array(list(shares_of_law(readings, friction, offsets).values()))]
    else:
        of_sources = (readings.frictions_of_sources(inside) for inside in readings.levels.values())
        parts = [np.array(list(found.values())) for found in of_sources]
    for part in parts:
        squares += float(np.sum((part / part.mean() - 1.0) ** 2))
        freedom += len(part) - 1
    measured_std = math.sqrt(squares / freedom) if freedom else math.nan
    std = math.sqrt((PRIOR_FREEDOM * PRIOR_STD**2 + squares) / (PRIOR_FREEDOM + freedom))
    return BetweenRuns(std, measured_std, freedom)


def shares_of_law(readings: FrictionReadings, friction: FloatArray, offsets: FloatArray) -> dict[int, float]:
    r"""Source -> its friction as a share of a law that was fitted to all sources [-], by least squares.

    .. math:: \min_s \sum_i (F_i - s f_i)^2
    """
    measured = readings.magnitudes(offsets)
    each = {int(source): readings.source == source for source in np.unique(readings.source)}
    return {
        source: float(np.sum(measured[inside] * friction[inside]) / np.sum(friction[inside] ** 2))
        for source, inside in each.items()
    }
