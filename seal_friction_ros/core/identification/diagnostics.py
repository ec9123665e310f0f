"""Diagnostics of friction readings: repeatability, collinearity, outliers, and differences between sources."""

import math
from collections.abc import Iterable, Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np

from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.identification import runs
from seal_friction_ros.core.identification.candidate_laws import CandidateLaw
from seal_friction_ros.core.identification.fitting import LawFit, fit, slopes
from seal_friction_ros.core.identification.readings import FrictionReadings

COLLINEAR = 0.9  # correlation above which two regressors are called collinear (our choice)
TRADED_OFF = 0.95  # correlation above which two fitted parameters cannot be determined separately (our choice)
LEVEL_SCATTER = 0.08  # [-] between pressures held one after the other, on one day (our choice)
OUTLIER = 3.0  # standard deviations from the law of the other pressures (our choice)
CHANGED = 0.15  # relative difference of two files that is worth a warning (our choice)
SETTLED = 0.1  # relative change of the friction over one run above which the seal has not settled (our choice)


def repeatability(readings: FrictionReadings, offsets: FloatArray) -> float:
    """Scatter of readings under the same conditions over the friction [-]: a lower bound for the error of any law.

    Same conditions are one pressure level, or for samples one cell of a grid (quantiles) of 12 speeds, 6 pressures of
    each seal, and the direction. NaN if no condition was repeated. ``offsets`` [N] are those of each source.
    """
    measured = readings.magnitudes(offsets)
    if not readings.are_samples:
        return _pooled_std(measured[inside] for inside in readings.levels.values())
    cells = (readings.at.direction > 0.0).astype(np.int64)
    for column, parts in [(np.abs(readings.at.velocity), 12), *((column, 6) for column in readings.at.pressure.T)]:
        edges = np.quantile(column, np.linspace(0.0, 1.0, parts + 1)[1:-1])
        cells = cells * parts + np.searchsorted(edges, column)
    return _pooled_std((measured[cells == cell] for cell in np.unique(cells)), float(measured.mean()))


def _pooled_std(parts: Iterable[FloatArray], unit: float | None = None) -> float:
    """Standard deviation within the parts, pooled, over ``unit``; None: each over the mean of its part."""
    squares = freedom = 0.0
    for part in parts:
        mean = float(part.mean())
        squares += float(np.sum((part - mean) ** 2)) / (max(mean**2, 1e-24) if unit is None else 1.0)
        freedom += len(part) - 1
    return math.sqrt(squares / freedom) / (unit or 1.0) if freedom else math.nan


class CorrelatedPair(NamedTuple):
    """Two correlated regressors or parameters."""

    one: str
    other: str
    correlation: float


def collinear_regressors(readings: FrictionReadings) -> list[CorrelatedPair]:
    """Pairs of regressors whose correlation is above `COLLINEAR`.

    Speed and seal pressure determine viscous and pressure-dependent friction; velocity and pressure difference
    determine viscous friction and an area error. Readings at held pressures are averaged over each pressure first.
    """
    velocity, chamber_pressures = readings.at.velocity, readings.chamber_pressures
    if not np.isfinite(velocity).all():
        return []
    found = []
    for one, x, other, y in (
        ('speed', np.abs(velocity), 'pressure of the seals', readings.seal_pressure),
        ('velocity', velocity, 'pressure difference', chamber_pressures[:, 0] - chamber_pressures[:, 1]),
    ):
        both = np.array([x, y])
        if not readings.are_samples:
            both = readings.level_means(both.T).T
        varied = np.ptp(both, axis=1) > 1e-3 * np.abs(both).max(axis=1)
        if both.shape[1] < 3 or not varied.all():
            continue
        correlation = float(np.corrcoef(both)[0, 1])
        if abs(correlation) > COLLINEAR:
            found.append(CorrelatedPair(one, other, correlation))
    return found


def traded_off(found: LawFit) -> list[CorrelatedPair]:
    """Pairs of fitted parameters whose correlation is above `TRADED_OFF`."""
    parameters = enumerate(p.name for p in found.law.parameters)
    pairs = [CorrelatedPair(a, b, float(found.correlation[i, j])) for (i, a), (j, b) in combinations(parameters, 2)]
    return [pair for pair in pairs if abs(pair.correlation) > TRADED_OFF]


class Outlier(NamedTuple):
    """A pressure level whose friction disagrees with the law of the other levels."""

    level: int
    measured: float  # [N]
    expected: float  # [N] by the law fitted to the other levels
    standard_deviations: float


def outlying_level(laws: Sequence[CandidateLaw], readings: FrictionReadings) -> Outlier | None:
    """The pressure level that deviates most from the law of the others, if by more than `OUTLIER`; else None.

    Each level is left out, and each of the ``laws`` is fitted to the rest; the one that fits the rest best counts. The
    standard deviation of the deviation contains the residuals of the rest, the scatter of a pressure held anew
    (`LEVEL_SCATTER`), and the leverage of the level. A level at which the law of the rest gives 0 N has no relative
    deviation: it is not assessed and has no residual. Fewer than four levels have no outlier.
    """
    if len(readings.levels) < 4:
        return None
    measured = readings.half_ranges[0]
    found: list[Outlier] = []
    for index, (level, out) in enumerate(readings.levels.items()):
        trained = readings.taken(~out)
        fits = [fit(law, trained) for law in laws]
        expectations = [readings.level_means(each.friction(readings.at)) for each in fits]
        deviations = [measured / np.where(e > 0.0, e, np.inf) - 1.0 for e in expectations]
        rests = [(e > 0.0) & (np.arange(len(e)) != index) for e in expectations]
        errors = [math.hypot(*d[rest]) if rest.any() else math.inf for d, rest in zip(deviations, rests, strict=True)]
        best = int(np.argmin(errors))
        expected, deviation, rest = expectations[best], deviations[best], rests[best]
        if expected[index] == 0.0 or not rest.any():
            continue
        residual = errors[best] / math.sqrt(max(rest.sum() - len(laws[best].parameters), 1))
        noise = math.hypot(residual, LEVEL_SCATTER)
        slopes = _relative_slopes(fits[best], readings, expected)
        leverage = float(slopes[index] @ np.linalg.pinv(slopes[rest].T @ slopes[rest]) @ slopes[index])
        size = abs(float(deviation[index])) / (noise * math.sqrt(1.0 + leverage))
        found.append(Outlier(level, float(measured[index]), float(expected[index]), size))
    worst = max(found, key=lambda outlier: outlier.standard_deviations, default=None)
    return worst if worst is not None and worst.standard_deviations > OUTLIER else None


def _relative_slopes(found: LawFit, readings: FrictionReadings, means: FloatArray) -> FloatArray:
    """Relative change of ``means`` > 0 by a relative change of each parameter, shape (levels, parameters)."""
    sizes = np.array([abs(found.values[p.name]) or 1.0 for p in found.law.parameters])
    of_levels = readings.level_means(slopes(found.law, found.values, readings.at))
    return np.asarray(of_levels * sizes / np.where(means > 0.0, means, np.inf)[:, np.newaxis])


class RunChange(NamedTuple):
    """Friction of two sources under the same conditions."""

    pressure: float | None  # [Pa] held by both; None: that of a swept log, by its share of the fitted law
    name: str
    friction: float  # [N]
    other_name: str
    other_friction: float  # [N]

    @property
    def ratio(self) -> float:
        """The larger friction over the smaller one [-]; infinite if one is not positive."""
        low, high = sorted((self.friction, self.other_friction))
        return high / low if low > 0.0 else math.inf

    @property
    def is_changed(self) -> bool:
        """Whether they differ by more than `CHANGED`."""
        return self.ratio > 1.0 + CHANGED


def shared_levels(readings: FrictionReadings) -> list[RunChange]:
    """Each source against the first one at each held pressure that they share; none for samples of swept logs."""
    found: list[RunChange] = []
    if readings.are_samples:  # one level holds several speeds there
        return found
    for inside, pressure in zip(readings.levels.values(), readings.level_pressures.tolist(), strict=True):
        (first, friction), *others = readings.frictions_of_sources(inside).items()
        names = readings.names
        found += [RunChange(pressure, names[first], friction, names[i], of_source) for i, of_source in others]
    return found


def swept_logs_compared(readings: FrictionReadings, found: LawFit) -> list[RunChange]:
    """Each swept log against the first one, by its share of the law that was fitted to all; none for held pressures."""
    if not readings.are_samples:
        return []
    friction = found.friction(readings.at)
    (first, share), *others = runs.shares_of_law(readings, friction, found.offsets).items()
    mean, names = float(friction.mean()), readings.names
    return [RunChange(None, names[first], share * mean, names[i], other * mean) for i, other in others]
