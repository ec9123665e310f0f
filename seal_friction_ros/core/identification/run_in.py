r"""Run-in: how the friction of a seal drifts over one run, and what it is once the seal has settled.

.. math:: f(s) = f_\infty\,(1 + d\,e^{-s / L})

over the travel s of the rod. Lubricant is pushed out, or a dry seal is wetted: the friction of the Delft rings changes
by up to 24 % over 0.75 m. The law of a seal file is that of the settled seal. An exponential approach is our choice.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.identification.candidate_laws import CandidateLaw
from seal_friction_ros.core.identification.fitting import LawFit, model_of, root_mean_square
from seal_friction_ros.core.identification.readings import FrictionReadings
from seal_friction_ros.core.identification.validation import CrossValidation

FEWEST_STROKES = 6  # for a drift term (our choice)
EVIDENT = 4.0  # standard errors of the approach from which it is evident (our choice)
WORTHWHILE = 0.02  # [-] smallest difference of the settled seal from the run that is corrected (our choice)
LENGTHS = 15  # lengths of travel that are tried, of `SHORTEST` to all of the travel (our choice)
SHORTEST = 0.05
OTHER_FORM = 0.15  # of the height: standard deviation since the approach may be no exponential (our choice)
UNSURE = 0.3  # of the settled friction: standard deviation up to which the end of the drift is told (our choice)
UNSEEN = 0.5  # standard deviation of what is extrapolated, as a share of it (our choice)


class Drift(NamedTuple):
    """Friction of one source at one pressure over the travel of the rod."""

    source: int
    level: int
    change: float  # [-] from the first stroke to the last, relative to the mean
    is_evident: bool  # beyond the scatter of the strokes, with an end that can be told
    settled_share: float  # [-] friction of the settled seal over the mean of the run; 1 if no drift is evident
    settled_std: float  # [-] standard deviation of it


def drifts(readings: FrictionReadings, offsets: FloatArray) -> list[Drift]:
    """Drift of each source at each pressure with `FEWEST_STROKES` strokes at least.

    The change is the slope of a line over the strokes, mean of the two directions. The drift is evident if the height
    of the approach that fits best is above `EVIDENT` of its standard errors from the scatter about it (a lag-one
    autocorrelation of the scatter counts), and the settled friction differs from the mean by more than `WORTHWHILE` and
    is told within `UNSURE`.
    Readings without travel have no evident drift.
    """
    measured, found = readings.magnitudes(offsets), []
    for level, inside in readings.levels.items():
        for source in np.unique(readings.source[inside]):
            index = np.flatnonzero(inside & (readings.source == source))
            if len(index) >= FEWEST_STROKES:
                travel = readings.travel[index] if len(readings.travel) else np.empty(0)
                drift = _drift(travel, measured[index], readings.at.direction[index])
                found.append(drift._replace(source=int(source), level=level))
    return found


def _drift(travel: FloatArray, friction: FloatArray, direction: FloatArray) -> Drift:
    mean = float(friction.mean())
    sides = [friction[direction == side] for side in (-1.0, 1.0)]
    slopes = [np.polyfit(np.arange(len(side)), side, 1)[0] * (len(side) - 1) for side in sides if len(side) >= 2]
    change = float(np.mean(slopes)) / mean if slopes else math.nan
    nothing = Drift(0, 0, change, False, 1.0, 0.0)
    if not len(travel) or float(np.ptp(travel)) <= 0.0 or not mean > 0.0:
        return nothing
    approaches = _approaches(travel, friction, direction)
    best = min(approaches, key=lambda one: one.square)
    settled, std = _settled(approaches, len(friction))
    if abs(best.height) < EVIDENT * best.height_error or abs(settled / mean - 1.0) < WORTHWHILE:
        return nothing
    if not std <= UNSURE * settled:  # also a friction below 0
        return nothing
    return nothing._replace(is_evident=True, settled_share=settled / mean, settled_std=std / mean)


class _Approach(NamedTuple):
    """Exponential approach with one length, fitted by least squares."""

    asymptote: float  # [N]
    error: float  # [N] standard error of it
    last: float  # [N] at the end of the run
    height: float  # [N] start of the run less asymptote
    height_error: float  # [N] standard error of it, autocorrelation of the residuals included
    square: float  # [N^2] sum of the squared residuals


def _approaches(travel: FloatArray, friction: FloatArray, direction: FloatArray) -> list[_Approach]:
    """Approaches of lengths up to the whole travel; an offset that is left is fitted with each."""
    spanned, found = float(np.ptp(travel)), []
    side = direction - direction.mean()
    for length in spanned * np.geomspace(SHORTEST, 1.0, LENGTHS):
        left = np.exp(-(travel - travel.min()) / length)
        design = np.column_stack((np.ones_like(travel), left, side))
        values, *_ = np.linalg.lstsq(design, friction, rcond=None)
        residual = friction - design @ values
        square = float(residual @ residual)
        covariance = np.linalg.pinv(design.T @ design) * square / max(len(friction) - 4, 1)
        error, height_error = np.sqrt(np.diag(covariance)[:2]).tolist()
        correlation = min(max(float(residual[1:] @ residual[:-1]) / max(square, 1e-300), 0.0), 0.9)
        height_error *= math.sqrt((1.0 + correlation) / (1.0 - correlation))
        last = float(values[0] + values[1] * math.exp(-spanned / length))
        found.append(_Approach(float(values[0]), error, last, float(values[1]), height_error, square))
    return found


def _settled(found: Sequence[_Approach], strokes: int) -> tuple[float, float]:
    r"""Friction of the settled seal [N] and its standard deviation [N].

    Mean over lengths up to the whole travel, so that 63 % of the approach was seen at least: the extrapolation is
    bounded by 0.58 of the change that was seen. The weight of a length is its likelihood :math:`S^{-n/4}` with the sum
    of squares S of n strokes, each of which counts half, since neighbours go together. The standard deviation holds the
    spread over the lengths, the standard errors, `UNSEEN` of what lies beyond the last stroke, and `OTHER_FORM` of the
    height: a hyperbola of the same course ends that much elsewhere. All our choice.
    """
    squares = np.array([each.square for each in found])
    weights = (np.maximum(squares, 1e-300) / max(float(squares.min()), 1e-300)) ** (-strokes / 4.0)
    weights = weights / weights.sum()
    asymptotes, errors, lasts, heights = (
        np.array([getattr(each, name) for each in found]) for name in ('asymptote', 'error', 'last', 'height')
    )
    settled = float(weights @ asymptotes)
    beyond = settled - float(weights @ lasts)
    variance = float(weights @ (errors**2 + (asymptotes - settled) ** 2)) + (UNSEEN * beyond) ** 2
    variance += (OTHER_FORM * float(weights @ heights)) ** 2
    return settled, math.sqrt(variance)


class SettledReadings(NamedTuple):
    """Readings as the settled seal would have given them."""

    readings: FrictionReadings
    share: FloatArray  # [-] friction of the settled seal over that of the run, of each reading, shape (n,)
    relative_std: float  # [-] of the friction, because that of the settled seal is extrapolated


def settled_readings(
    readings: FrictionReadings, offsets: FloatArray, everything: CandidateLaw | None = None
) -> SettledReadings | None:
    """Readings of the settled seal: the friction of each run with an evident drift, times its settled share.

    None for swept logs, and where no drift is evident. The standard deviation of the settled shares counts as common to
    all pressures: they are extrapolated by one model (our choice). Where no pressure has `FEWEST_STROKES` strokes, it
    is the drift over all pressures of a source, beside ``everything`` else (the law of all terms).
    """
    if readings.are_samples:
        return None
    of_runs = drifts(readings, offsets)
    if not of_runs and everything is not None:
        return _at_the_end(readings, offsets, everything)
    if not any(drift.is_evident for drift in of_runs):
        return None
    share = np.ones(readings.count)
    for drift in of_runs:
        share[(readings.source == drift.source) & (readings.level == drift.level)] = drift.settled_share
    unsure = np.array([drift.settled_std / drift.settled_share for drift in of_runs])
    return SettledReadings(readings.scaled(share, offsets), share, root_mean_square(unsure))


def _at_the_end(readings: FrictionReadings, offsets: FloatArray, everything: CandidateLaw) -> SettledReadings | None:
    """Readings as at the end of the way of their source, by a linear drift over it; None where none is probable."""
    if not len(readings.travel) or readings.count < FEWEST_STROKES:
        return None
    model = model_of(everything, readings, drift=True)
    drift, error = model.drift
    if not drift:
        return None
    to_come = model.problem.to_come
    mean = float(to_come.mean())
    share = 1.0 / (1.0 + drift * to_come)
    return SettledReadings(readings.scaled(share, offsets), share, error * mean / (1.0 + drift * mean))


def as_measured(found: CrossValidation, share: FloatArray) -> CrossValidation:
    """Prediction of readings as measured, from one of settled readings: by the share of the run that is predicted.

    The share of a run comes from the course of its own strokes, as its offset comes from its two directions; its level
    does not enter.
    """
    return replace(found, predicted=found.predicted / share, deviation=found.deviation / share)


@dataclass(frozen=True, eq=False)
class SettledLaw:
    """Law of the settled seal."""

    fit: LawFit  # the law, fitted to the settled readings
    relative_std: float  # [-] of its friction, because the friction of the settled seal is extrapolated
    readings: FrictionReadings  # as the settled seal would have given them
