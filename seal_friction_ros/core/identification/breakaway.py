"""Breakaway friction above the Coulomb friction: its own ladder of laws.

A seal at rest sticks the harder the longer it rests [Rabinowicz1958]_ [Kato1972]_. Where the time at rest was varied,
the laws with it are tried, too.
"""

from typing import NamedTuple

import numpy as np
from scipy.optimize import nnls

from seal_friction_ros.core.foundation.arrays import BoolArray, FloatArray
from seal_friction_ros.core.identification.fitting import root_mean_square
from seal_friction_ros.core.identification.readings import FrictionReadings
from seal_friction_ros.core.identification.selection import is_beaten
from seal_friction_ros.core.identification.validation import group_losses, jackknife_errors

LAWS = {
    'constant': (True, False, False, False),
    'load_dependent': (False, True, False, False),
    'both': (True, True, False, False),
    'constant_dwell': (True, False, True, False),
    'load_dependent_dwell': (False, True, False, True),
    'both_dwell': (True, True, False, True),
}
"""Name -> whether the stiction has a constant part, a part proportional to the Coulomb friction, and one of each that
grows with the logarithm of the dwell."""
LESS_OFF = 0.1  # of the deviation where a law is worst: another that is less off there is taken (our choice)
DWELL_VARIES = 3.0  # long over short dwell at one pressure from which the laws with it are tried (our choice)
DWELL_UNIT = 1.0  # [s] in the logarithm (our choice)


class BreakawayFit(NamedTuple):
    """Breakaway force of one seal above its Coulomb friction: stiction + ratio * f_c, both at the dwell ``dwell``."""

    law: str  # of `LAWS`
    stiction: float  # [N] of one seal
    ratio: float  # [-]
    standard_errors: tuple[float, float]  # of stiction [N] and ratio [-]
    cross_validation_rms: dict[str, float]  # [N] all seals: law -> root mean square of the left-out deviations
    dwell: float | None = None  # [s] at which stiction and ratio hold; None if the law has no dwell
    stiction_per_decade: float = 0.0  # [N] of one seal, gained by a dwell ten times as long
    ratio_per_decade: float = 0.0  # [-] likewise
    dwells: tuple[float, float] | None = None  # [s] shortest and longest dwell of the readings; None without dwell


def dwell_growth(dwell: FloatArray) -> FloatArray:
    r"""Growth of the stiction over the time at rest in decades [-], :math:`\log_{10}(1 + t / 1\,s)`, shape (n,).

    Source: after [Rabinowicz1958]_, whose static friction grows without bound with the time of stick; the logarithm,
    which starts at 0, is our choice, in place of the power of the time there and of the bounded growth of [Kato1972]_.
    """
    return np.log10(1.0 + dwell / DWELL_UNIT)


def dwell_varies(readings: FrictionReadings) -> bool:
    """Whether the dwell differs by `DWELL_VARIES` (upper over lower fifth) at most of the pressures."""
    if not len(readings.dwell) or not np.isfinite(readings.dwell).all() or (readings.dwell <= 0.0).any():
        return False
    ends = [np.quantile(readings.dwell[inside], (0.2, 0.8)) for inside in readings.levels.values()]
    return bool(np.mean([high > DWELL_VARIES * low for low, high in ends]) > 0.5)


def fit_breakaway(readings: FrictionReadings, friction: FloatArray, offsets: FloatArray) -> BreakawayFit:
    """Stiction that is constant, proportional to the Coulomb friction, or both, by least squares.

    Where the dwell was varied, each also with a part that grows by `dwell_growth`; stiction and ratio are then those at
    the dwell of its mean. Of the laws that none beats on readings left out, the simplest is taken, unless another is
    less off by `LESS_OFF` at the pressure where it is worst: the rod breaks away at one pressure at a time (our
    choice).

    excess = stiction + ratio * f_c, all parts not negative, by least squares of the deviation over the breakaway force.
    ``friction`` is the Coulomb friction of the law at each breakaway reading [N]; ``offsets`` are those of the sources.

    Source: thesis, section 5.2 (static above dynamic friction by about 0.5 lbf for each seal); the share of the Coulomb
    friction is our choice, after the rise of the stiction over pressure in Tables A-1 to A-3.
    """
    measured = readings.magnitudes(offsets)
    excess, seals = measured - friction, readings.at.pressure.shape[1]
    with_dwell = dwell_varies(readings)
    growth = dwell_growth(readings.dwell) if with_dwell else np.zeros(readings.count)
    regressors = np.column_stack((np.ones(readings.count), friction, growth, growth * friction))
    laws = {name: parts for name, parts in LAWS.items() if with_dwell or not any(parts[2:])}

    def coefficients(parts: tuple[bool, ...], inside: BoolArray | slice) -> FloatArray:
        """Non-negative least squares over the regressors in use."""
        used = regressors[inside] * np.array(parts) / readings.scale[inside][:, np.newaxis]
        return np.asarray(nnls(used, excess[inside] / readings.scale[inside])[0])

    left_out, losses, rms = {}, {}, {}
    for name, parts in laws.items():
        left_out[name] = np.array([coefficients(parts, ~out) for out in readings.groups])
        residuals = np.empty(readings.count)
        for out, found in zip(readings.groups, left_out[name], strict=True):
            residuals[out] = excess[out] - regressors[out] @ found
        losses[name], rms[name] = group_losses(readings, residuals), root_mean_square(residuals)
    best = min(losses.values(), key=np.mean)
    not_beaten = [name for name, values in losses.items() if not is_beaten(values, best)]

    def worst(name: str) -> float:
        """Largest deviation of the breakaway force at any pressure, over the force [-]."""
        off = excess - regressors @ coefficients(laws[name], slice(None))
        return max(abs(float(off[inside].sum() / measured[inside].sum())) for inside in readings.levels.values())

    chosen = not_beaten[0]
    for name in not_beaten[1:]:
        if worst(name) < (1.0 - LESS_OFF) * worst(chosen):
            chosen = name
    decades = float(growth.mean())
    at_dwell = np.array([[1.0, 0.0, decades, 0.0], [0.0, 1.0, 0.0, decades]])  # parts -> stiction and ratio there
    found = coefficients(laws[chosen], slice(None))
    (stiction, ratio), errors = at_dwell @ found, jackknife_errors(left_out[chosen] @ at_dwell.T)
    each = (float(errors[0]) / seals, float(errors[1]))
    law = BreakawayFit(chosen, float(stiction) / seals, float(ratio), each, rms)
    if not any(laws[chosen][2:]):
        return law
    return law._replace(
        dwell=DWELL_UNIT * (10.0**decades - 1.0),
        stiction_per_decade=float(found[2]) / seals,
        ratio_per_decade=float(found[3]),
        dwells=(float(readings.dwell.min()), float(readings.dwell.max())),
    )
