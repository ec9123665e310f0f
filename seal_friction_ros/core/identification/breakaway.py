"""Breakaway friction above the Coulomb friction: its own ladder of laws."""

from typing import NamedTuple

import numpy as np
from scipy.optimize import nnls

from seal_friction_ros.core.foundation.arrays import BoolArray, FloatArray
from seal_friction_ros.core.identification.fitting import root_mean_square
from seal_friction_ros.core.identification.readings import FrictionReadings
from seal_friction_ros.core.identification.selection import WORTHWHILE, is_beaten
from seal_friction_ros.core.identification.validation import group_losses, jackknife_errors

LAWS = {'constant': (True, False), 'load_dependent': (False, True), 'both': (True, True)}
"""Name -> whether the stiction has a constant part, and a part proportional to the Coulomb friction."""


class BreakawayFit(NamedTuple):
    """Breakaway force of one seal above its Coulomb friction: stiction + ratio * f_c."""

    law: str  # of `LAWS`
    stiction: float  # [N] of one seal
    ratio: float  # [-]
    standard_errors: tuple[float, float]  # of stiction [N] and ratio [-]
    cross_validation_rms: dict[str, float]  # [N] all seals: law -> root mean square of the left-out deviations


def fit_breakaway(readings: FrictionReadings, friction: FloatArray, offsets: FloatArray) -> BreakawayFit:
    """Stiction that is constant, proportional to the Coulomb friction, or both, by least squares.

    Of the laws that none beats on readings left out, the simplest is taken, unless another is less off by `WORTHWHILE`
    at the pressure where it is worst: the rod breaks away at one pressure at a time (our choice).

    excess = stiction + ratio * f_c, both not negative, by least squares of the deviation over the breakaway force.
    ``friction`` is the Coulomb friction of the law at each breakaway reading [N]; ``offsets`` are those of the sources.

    Source: thesis, section 5.2 (static above dynamic friction by about 0.5 lbf for each seal); the share of the Coulomb
    friction is our choice, after the rise of the stiction over pressure in Tables A-1 to A-3.
    """
    measured = readings.magnitudes(offsets)
    excess, seals = measured - friction, readings.at.pressure.shape[1]
    regressors = np.column_stack((np.ones(readings.count), friction))

    def coefficients(parts: tuple[bool, bool], inside: BoolArray | slice) -> FloatArray:
        """Non-negative least squares over the regressors in use."""
        used = regressors[inside] * np.array(parts) / readings.scale[inside][:, np.newaxis]
        return np.asarray(nnls(used, excess[inside] / readings.scale[inside])[0])

    left_out, losses, rms = {}, {}, {}
    for name, parts in LAWS.items():
        left_out[name] = np.array([coefficients(parts, ~out) for out in readings.groups])
        residuals = np.empty(readings.count)
        for out, found in zip(readings.groups, left_out[name], strict=True):
            residuals[out] = excess[out] - regressors[out] @ found
        losses[name], rms[name] = group_losses(readings, residuals), root_mean_square(residuals)
    best = min(losses.values(), key=np.mean)
    not_beaten = [name for name, values in losses.items() if not is_beaten(values, best)]

    def worst(name: str) -> float:
        """Largest deviation of the breakaway force at any pressure, over the force [-]."""
        off = excess - regressors @ coefficients(LAWS[name], slice(None))
        return max(abs(float(off[inside].sum() / measured[inside].sum())) for inside in readings.levels.values())

    chosen = not_beaten[0]
    for name in not_beaten[1:]:
        if worst(name) < (1.0 - WORTHWHILE) * worst(chosen):
            chosen = name
    (stiction, ratio), errors = coefficients(LAWS[chosen], slice(None)), jackknife_errors(left_out[chosen])
    each = (float(errors[0]) / seals, float(errors[1]))
    return BreakawayFit(chosen, float(stiction) / seals, float(ratio), each, rms)
