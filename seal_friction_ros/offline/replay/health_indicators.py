"""Indicators of the health of the seals from what bags show: values with their uncertainty, trends, changes, alarms."""

import math
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np

from seal_friction_ros.core.estimation.findings import BAD, Finding, Limits
from seal_friction_ros.core.estimation.friction_change import FrictionChange, watch
from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.foundation.normal_distribution import BAND_95
from seal_friction_ros.offline.replay.bag_health import BagHealth

INDEPENDENT = 8  # reversals between two scales that share no ratio: the median is over six, and the scale lags
HOUR = 3600.0  # [s]
SPREAD_OF_FRICTION = 0.2  # [-] least spread of the friction by the law that tells asymmetry from load


class Value(NamedTuple):
    """A number and its standard deviation; NaN where the data do not tell."""

    value: float
    std: float


NOT_TOLD = Value(math.nan, math.nan)


class Day(NamedTuple):
    """Indicators of one bag."""

    name: str
    time: float  # [s] stamp of its middle
    reversals: int
    scale: Value  # [-] friction over that of the seal file, at the pressures and speeds of both
    offset: Value  # [N]
    breakaway: Value  # [-] largest friction of a start after a rest, over Coulomb friction
    asymmetry: Value  # [-] part of the friction that has another size in the two directions
    break_in: Value  # [-] friction of the first quarter of the bag over that of the last, less 1
    noise: Value  # [N]
    friction: float  # [N] by the seal file, median over the reversals


UNKNOWN_DAY = Day('', math.nan, 0, NOT_TOLD, NOT_TOLD, NOT_TOLD, NOT_TOLD, NOT_TOLD, NOT_TOLD, math.nan)


def day_of(name: str, seen: BagHealth) -> Day:
    """Indicators of a bag."""
    count = len(seen.scale)
    quarter = max(count // 4, 1)
    if not count:
        return UNKNOWN_DAY._replace(name=name)
    early, late = _mean(seen.scale[:quarter]), _mean(seen.scale[-quarter:])
    change = Value(early.value / late.value - 1.0, math.hypot(early.std, late.std) / late.value)
    known = math.sqrt(float(np.mean(seen.scale_std**2)))
    scale = _mean(seen.scale[-max(count // 2, 1) :])
    pairs = 0.5 * (seen.offset[1:] + seen.offset[:-1])  # strokes alternate, so the half of the scale error cancels
    return Day(
        name,
        float(np.median(seen.time)),
        count,
        Value(scale.value, max(scale.std, known)),
        _mean(pairs) if len(pairs) else NOT_TOLD,
        _mean(seen.starts) if len(seen.starts) else NOT_TOLD,
        _asymmetry(seen),
        change if count >= 4 * INDEPENDENT else NOT_TOLD,
        Value(seen.noise, seen.noise / math.sqrt(2.0 * count)),
        float(np.median(seen.friction)),
    )


def _mean(values: FloatArray) -> Value:
    """Mean and its standard deviation, with one independent value in `INDEPENDENT`."""
    independent = max(len(values) / INDEPENDENT, 1.0)
    return Value(float(values.mean()), float(values.std(ddof=min(len(values) - 1, 1)) / math.sqrt(independent)))


def _asymmetry(seen: BagHealth) -> Value:
    """Slope of the offset over the friction: a load has none. Only where the friction by the law varies enough."""
    if len(seen.friction) < 2 * INDEPENDENT or np.ptp(seen.friction) < SPREAD_OF_FRICTION * seen.friction.mean():
        return NOT_TOLD
    pairs, friction = 0.5 * (seen.offset[1:] + seen.offset[:-1]), seen.friction[1:]
    fit, covariance = np.polyfit(friction, pairs, 1, cov=True)
    return Value(float(fit[0]), math.sqrt(INDEPENDENT * float(covariance[0, 0])))


def trend(days: Sequence[Any], name: str) -> Value:
    """Change of an indicator [1/h], from a line weighted with the uncertainties; not told by fewer than 3 bags.

    ``days`` are `Day`, or any records with a ``time`` [s] and the indicator of that ``name``.
    """
    known = [(day.time, *getattr(day, name)) for day in days if math.isfinite(getattr(day, name).value)]
    if len(known) < 3 or np.ptp([time for time, *_ in known]) == 0.0:
        return NOT_TOLD
    time, value, std = np.array(known).T
    least = max(float(np.median(std)), 1e-12)
    hours = (time - time.mean()) / HOUR
    fit, covariance = np.polyfit(hours, value, 1, w=1.0 / np.maximum(std, least), cov='unscaled')
    misfit = value - np.polyval(fit, hours)
    inflated = max(1.0, float(np.sum((misfit / np.maximum(std, least)) ** 2)) / (len(known) - 2))
    return Value(float(fit[0]), math.sqrt(float(covariance[0, 0]) * inflated))


def changes_of(seen: Iterable[BagHealth]) -> list[dict[str, float]]:
    """When the friction changed, over all bags."""
    known, found = FrictionChange(), []
    for bag in seen:
        for i in range(0, len(bag.scale), INDEPENDENT):
            before = known.changes
            known = watch(known, round(bag.time[i] * 1e9), float(bag.scale[i]))
            if known.changes > before:
                scales = {'scale_before': known.before, 'scale_then': float(bag.scale[i])}
                found.append({'time_s': known.changed_at * 1e-9, **scales})
    return found


def alarms_of(day: Day, limits: Limits) -> list[Finding]:
    """What is beyond its limit, of what was learnt from the reversals."""
    found = []
    low, high = day.scale.value - BAND_95 * day.scale.std, day.scale.value + BAND_95 * day.scale.std
    if low > limits.scale_high or high < limits.scale_low:
        found.append(f'friction is {day.scale.value:.2f} times that of the seal file')
    if day.breakaway.value - BAND_95 * day.breakaway.std > limits.breakaway:
        found.append(f'a start takes {day.breakaway.value:.2f} times the Coulomb friction')
    if day.noise.value > limits.noise * day.friction * max(day.scale.value, 1e-9):
        found.append(f'the residual is {day.noise.value / day.friction:.0%} of the friction')
    return [Finding(BAD, text, 'inspect seals, oil and sensors; after a repair fit again') for text in found]
