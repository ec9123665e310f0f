"""Friction readings -> a law, what it is worth, and what the data cannot tell.

Every rung of the ladder (`core/friction_laws.py`) is fitted by least squares, together with one offset of the force sum
for each source, and scored on readings that it has not seen. The lowest rung that no other beats beyond the noise is
recommended. Nothing here is drawn by chance, so there is no seed: the same readings give the same numbers.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import least_squares, nnls
from scipy.stats import t as student_t

from seal_friction_ros.core.foundation.arrays import BoolArray, FloatArray, IntArray
from seal_friction_ros.core.foundation.normal_distribution import BAND_95
from seal_friction_ros.core.identification.ladder import Conditions, Rung, Values, values_of
from seal_friction_ros.core.identification.readings import Readings, level_friction
from seal_friction_ros.core.identification.signal_preparation import half_range

COLLINEAR = 0.9  # correlation of two regressors from which on they are called collinear (our choice)
TRADED_OFF = 0.95  # correlation of two fitted parameters from which on neither is known alone (our choice)
ILL_CONDITIONED = 30.0  # condition number of the scaled Jacobian; after [Belsley1980]_
BEATEN = 0.95  # how sure it must be that a law is beaten (our choice)
WORTHWHILE = 0.1  # share of its loss by which a law must be beaten (our choice)
OUTLIER = 3.0  # standard deviations from what the other pressures say (our choice)
CHANGED = 0.2  # share by which two files must differ to be called two states; runs on a rig repeat within 10 to 15 %
SETTLED = 0.1  # change of the friction over one run from which on the run is said not to have settled (our choice)

Ticks = Callable[[int], None]


# -- one fit ----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Fit:
    """A rung fitted to readings."""

    rung: Rung
    values: dict[str, float]
    """parameters of one seal"""
    offsets: FloatArray
    """[N] of each source's force sum, shape (sources,)"""
    jacobian: FloatArray
    """derivative of the weighted deviations by the parameters, offsets taken out, shape (n, parameters)"""

    def friction(self, at: Conditions) -> FloatArray:
        """Magnitude of the friction of all seals [N], shape (n,)."""
        return self.rung.friction(at, self.values)

    @property
    def condition_number(self) -> float:
        """Condition number of the Jacobian with columns of unit length; infinite if a parameter has no effect."""
        lengths = np.linalg.norm(self.jacobian, axis=0)
        if not np.all(lengths > 0.0):
            return math.inf
        return float(np.linalg.cond(self.jacobian / lengths))

    @property
    def correlation(self) -> FloatArray:
        """Correlation of the parameters, shape (parameters, parameters); NaN where the data do not tell them at all."""
        normal = self.jacobian.T @ self.jacobian
        size = np.sqrt(np.diag(normal))
        if not np.all(size > 0.0) or self.condition_number > 1e8:
            return np.full(normal.shape, np.nan)
        covariance = np.linalg.inv(normal / np.outer(size, size))
        std = np.sqrt(np.diag(covariance))
        result: FloatArray = covariance / np.outer(std, std)
        return result


def offsets_of(readings: Readings, friction: FloatArray) -> FloatArray:
    """Offset of each source's force sum that leaves the least squares [N], shape (sources,).

    0 N where a source has one direction only: there it cannot be told from friction.
    """
    signed = readings.force - readings.at.direction * friction
    result = np.zeros(len(readings.names))
    for source, index in enumerate(readings.two_sided):
        if len(index):
            weight = 1.0 / readings.scale[index] ** 2
            result[source] = float(np.sum(weight * signed[index])) / float(weight.sum())
    return result


def deviations(readings: Readings, friction: FloatArray, offsets: FloatArray) -> FloatArray:
    """Measured magnitude less a law's, offset removed [N], shape (n,)."""
    return readings.at.direction * (readings.force - offsets[readings.source]) - friction


def fit(rung: Rung, readings: Readings, known: Values | None = None, *, is_close: bool = False) -> Fit:
    """Least squares of a rung, with one offset of the force sum per source.

    The offsets are linear, so they are solved for inside. A Stribeck velocity has local minima: the fit begins from
    several ones, and the best result counts.

    Args:
        rung: The law.
        readings: What it is fitted to.
        known: Parameters to begin from, where they are known from a fit to much the same readings or of a lower rung.
        is_close: ``known`` is complete and near the result, so the fit begins from it alone.

    Raises:
        ValueError: The fit does not end in finite numbers.
    """
    lower = np.array([p.lower for p in rung.parameters])
    upper = np.array([p.upper for p in rung.parameters])
    scale = readings.scale

    def left(vector: FloatArray) -> FloatArray:
        friction = rung.friction(readings.at, values_of(rung, vector))
        return deviations(readings, friction, offsets_of(readings, friction)) / scale

    best: Any = None
    known = known or {}
    starts = [np.array([known[p.name] for p in rung.parameters])] if is_close else _starts(rung, readings, known)
    for guess in starts:
        inside = np.clip(guess, lower, upper)
        size = np.maximum(np.abs(inside), 1e-3 * np.minimum(upper, 1.0))
        found = least_squares(left, inside, bounds=(lower, upper), x_scale=size, xtol=1e-9, ftol=1e-9, gtol=1e-9)
        if best is None or found.cost < best.cost * (1.0 - 1e-9):
            best = found
    if best is None or not np.isfinite(best.x).all():
        raise ValueError(f'{rung.name}: the fit does not end in finite numbers')
    typical = readings.at.typical(_mean_friction(readings))
    size = np.abs([p.start(typical) for p in rung.parameters])
    at_zero = (lower == 0.0) & (np.abs(best.x) < 1e-6 * size)
    values = values_of(rung, np.where(at_zero, 0.0, best.x))  # a term that does not pay is nothing, not 1e-18
    jacobian: FloatArray = np.asarray(best.jac)
    return Fit(rung, values, offsets_of(readings, rung.friction(readings.at, values)), jacobian)


def _mean_friction(readings: Readings) -> float:
    """Mean force of one seal [N], to begin from."""
    return float(np.abs(readings.force).mean() / readings.at.pressure.shape[1])


_TRIED = (0.2, 1.0, 4.0)  # Stribeck velocities that a fit begins from, as factors on the first guess


def _starts(rung: Rung, readings: Readings, known: Values) -> Iterator[FloatArray]:
    """First guesses: what is known from a lower rung, and several Stribeck velocities."""
    typical = readings.at.typical(_mean_friction(readings))
    guess = {p.name: p.start(typical) for p in rung.parameters}
    guess |= {name: value for name, value in known.items() if name in guess}
    for factor in _TRIED if 'stribeck_velocity' in guess else (1.0,):
        tried = guess | {name: factor * guess[name] for name in ('stribeck_velocity',) if name in guess}
        yield np.array([tried[p.name] for p in rung.parameters])


# -- out of sample ----------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class CrossValidation:
    """How a rung predicts readings that it has not seen: each group from all others."""

    predicted: FloatArray
    """[N] shape (n,)"""
    deviation: FloatArray
    """[N] measured less predicted, shape (n,)"""
    losses: FloatArray
    """root mean square of the weighted deviation in each group [-], shape (groups,)"""
    parameters: FloatArray
    """fitted without each group, shape (groups, parameters)"""

    @property
    def rms(self) -> float:
        """Root mean square of the deviation [N]."""
        return _rms(self.deviation)

    @property
    def error(self) -> float:
        """Sum of the deviations over the sum of what was measured [-], both as magnitudes."""
        return float(np.abs(self.deviation).sum() / np.abs(self.predicted + self.deviation).sum())

    @property
    def mean_deviation(self) -> float:
        """Mean magnitude of the deviation [N]."""
        return float(np.abs(self.deviation).mean())


def cross_validate(rung: Rung, readings: Readings, near: Values, tick: Ticks = lambda _: None) -> CrossValidation:
    """Leave one group out, fit the others, predict it; for every group.

    The offset of a source comes from the readings that were fitted; where none of that source were, from the left-out
    ones themselves, in both directions, so that it holds nothing of the friction.

    Args:
        rung: The law.
        readings: At least two groups.
        near: Parameters of the fit to all readings, to begin from.
        tick: Called with 1 after each fit.
    """
    predicted, deviation = np.empty(readings.count), np.empty(readings.count)
    groups = np.unique(readings.group)
    parameters = []
    losses = []
    for group in groups:
        out = readings.group == group
        trained, tested = readings.taken(~out), readings.taken(out)
        found = fit(rung, trained, near, is_close=True)
        friction = found.friction(tested.at)
        own = _own_offsets(tested, friction)
        known = np.isin(np.arange(len(readings.names)), trained.source)
        left = deviations(tested, friction, np.where(known, found.offsets, own))
        predicted[out], deviation[out] = friction, left
        losses.append(_rms(left / readings.scale[out]))
        parameters.append([found.values[p.name] for p in rung.parameters])
        tick(1)
    return CrossValidation(predicted, deviation, np.array(losses), np.array(parameters))


def _own_offsets(readings: Readings, friction: FloatArray) -> FloatArray:
    """Offset of each source from readings that no law was fitted to: half the sum of the two directions."""
    signed = readings.force - readings.at.direction * friction
    result = np.zeros(len(readings.names))
    for source, index in enumerate(readings.two_sided):
        if len(index):
            direction = readings.at.direction[index].astype(np.int64)
            result[source] = half_range(signed[index], direction, of_medians=False).offset
    return result


def plain_mean(readings: Readings) -> CrossValidation | None:
    """No law at all: each reading predicted by the mean of the other groups' readings at the same pressure.

    None where a pressure is in one group only, or where readings are samples.
    """
    if readings.are_samples or readings.left_out_by == 'pressure':
        return None
    offsets = offsets_of(readings, readings.scale)
    measured = readings.at.direction * (readings.force - offsets[readings.source])
    predicted = np.empty(readings.count)
    for i in range(readings.count):
        others = (readings.level == readings.level[i]) & (readings.group != readings.group[i])
        if not others.any():
            return None
        predicted[i] = measured[others].mean()
    left = measured - predicted
    groups = np.unique(readings.group)
    losses = [_rms((left / readings.scale)[readings.group == g]) for g in groups]
    return CrossValidation(predicted, left, np.array(losses), np.empty((len(groups), 0)))


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def standard_errors(validation: CrossValidation) -> FloatArray:
    """Standard error of each parameter by the jackknife over the groups, shape (parameters,).

    What the readings of a group have in common (a test, a pressure, a minute) counts once and not with every reading.

    Source: [Efron1982]_.
    """
    groups = len(validation.parameters)
    spread = validation.parameters - validation.parameters.mean(axis=0)
    result: FloatArray = np.sqrt((groups - 1) / groups * np.sum(spread**2, axis=0))
    return result


# -- the ladder -------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Score:
    """One rung: fitted and scored, or why not."""

    rung: Rung
    fit: Fit | None = None
    validation: CrossValidation | None = None
    why_not: str = ''

    @property
    def is_scored(self) -> bool:
        """Whether it was fitted."""
        return self.validation is not None


def climb(rungs: Sequence[Rung], readings: Readings, tick: Ticks = lambda _: None) -> tuple[Score, ...]:
    """Fit and score every rung.

    Args:
        rungs: From the lowest.
        readings: At least two groups.
        tick: Called with 1 after each fit; there are (groups + 1) fits for each rung.
    """
    scores: list[Score] = []
    known: dict[str, float] = {}
    for rung in rungs:
        scores.append(_score(rung, readings, known, tick))
        known |= scores[-1].fit.values if scores[-1].fit is not None else {}
    return tuple(scores)


def _score(rung: Rung, readings: Readings, known: Values, tick: Ticks) -> Score:
    groups = len(np.unique(readings.group))
    levels = len(np.unique(readings.level))
    needed = len(rung.parameters) + (readings.left_out_by == 'pressure')
    if not readings.are_samples and levels < needed:
        tick(groups + 1)
        return Score(rung, why_not=f'{len(rung.parameters)} parameters need {needed} pressures, there are {levels}')
    try:
        found = fit(rung, readings, known)
        tick(1)
        return Score(rung, found, cross_validate(rung, readings, found.values, tick))
    except ValueError as error:
        return Score(rung, why_not=str(error))


def recommended(scores: Sequence[Score]) -> Score:
    """The lowest rung that is not beaten beyond the noise.

    The best rung has the smallest mean loss over the groups. Another is beaten if its losses are higher, group by
    group, by more than chance allows.

    Raises:
        ValueError: No rung was scored.

    Source: after the one-standard-error rule of [Breiman1984]_; the paired t-test in its place is our choice.
    """
    scored = [(score, score.validation) for score in scores if score.validation is not None]
    if not scored:
        reasons = '; '.join(f'{score.rung.name}: {score.why_not}' for score in scores)
        raise ValueError(f'no law could be fitted: {reasons}')
    best = min(scored, key=lambda pair: float(pair[1].losses.mean()))[1]
    return next(score for score, validation in scored if not is_beaten(validation.losses, best.losses))


def is_beaten(losses: FloatArray, others: FloatArray) -> bool:
    """Whether ``others`` are lower than ``losses`` beyond the noise, and by enough to be worth a term.

    Beyond the noise: by a one-sided paired t-test at `BEATEN`. Enough: `WORTHWHILE` of the mean loss.

    Args:
        losses: Of each group, shape (groups,), groups >= 2.
        others: Of the same groups by another law.
    """
    difference = losses - others
    groups = len(difference)
    error = float(difference.std(ddof=1)) / math.sqrt(groups)
    noise = float(student_t.ppf(BEATEN, groups - 1)) * error
    return float(difference.mean()) > max(noise, WORTHWHILE * float(losses.mean()))


# -- how sure ---------------------------------------------------------------------------------------------------------


class Spread(NamedTuple):
    """Standard deviation of a new reading of all seals: std^2 = (relative f)^2 + absolute^2."""

    relative: float
    """[-]"""
    absolute: float
    """[N]"""

    def std(self, friction: FloatArray) -> FloatArray:
        """Standard deviation [N] at a friction [N], shape (n,)."""
        return np.sqrt((self.relative * friction) ** 2 + self.absolute**2)


def spread_of(predicted: FloatArray, deviation: FloatArray, groups: int, in_addition: float = 0.0) -> Spread:
    """Standard deviation for new readings, from deviations of readings that were left out.

    Its form comes from non-negative least squares of the squared deviations over the squared friction and one, weighted
    by the variance that results, ten times over. Its size is such that 1.96 of it holds 95 % of the deviations, counted
    as for one more reading [Vovk2005]_. With few groups one more group is a little further off than those left out:
    (1 + 1 / groups).

    Args:
        predicted: Friction [N], shape (n,).
        deviation: Measured less predicted [N], shape (n,).
        groups: Groups that were left out.
        in_addition: Relative standard deviation that these data cannot show, added in square.
    """
    friction = np.maximum(np.abs(predicted), 0.05 * float(np.abs(predicted).mean()))
    raw = Spread(0.0, max(_rms(deviation), 1e-12))
    for _ in range(10):
        variance = np.maximum(raw.std(friction) ** 2, 1e-24)
        columns = np.column_stack((friction**2, np.ones_like(friction))) / variance[:, np.newaxis]
        squares, _ = nnls(columns, deviation**2 / variance)
        raw = Spread(*(math.sqrt(value) for value in squares))
    std = np.maximum(raw.std(friction), 1e-12)
    n = len(deviation)
    rank = min(math.ceil(0.95 * (n + 1)), n)
    quantile = float(np.sort(np.abs(deviation) / std)[rank - 1]) / BAND_95
    size = quantile * math.sqrt(1.0 + 1.0 / groups)
    return Spread(math.hypot(raw.relative * size, in_addition), raw.absolute * size)


def band_coverage(
    rung: Rung, readings: Readings, near: Values, in_addition: float = 0.0, tick: Ticks = lambda _: None
) -> float:
    """Share of the readings inside the 95 % band of a law, and of a standard deviation, that have not seen them [-].

    For each group, law and standard deviation are made from the other groups alone, the latter by leaving each of those
    out in turn. With two groups there is nothing left to do so: the band is then the one of all.
    """
    groups = np.unique(readings.group)
    inside = 0
    for group in groups:
        out = readings.group == group
        trained, tested = readings.taken(~out), readings.taken(out)
        if len(groups) < 3:
            trained = readings
        found = fit(rung, trained, near, is_close=True)
        inner = cross_validate(rung, trained, near, tick)
        spread = spread_of(inner.predicted, inner.deviation, len(groups) - 1, in_addition)
        friction = found.friction(tested.at)
        known = np.isin(np.arange(len(readings.names)), trained.source)
        offsets = np.where(known, found.offsets, _own_offsets(tested, friction))
        left = deviations(tested, friction, offsets)
        inside += int(np.count_nonzero(np.abs(left) <= BAND_95 * spread.std(friction)))
    return inside / readings.count


def repeatability(readings: Readings, offsets: FloatArray) -> float:
    """Scatter of readings taken under the same conditions, as a share of the friction [-]: no law can do better.

    Readings at one pressure level, or samples in one cell of a grid of 12 speeds by 6 pressures of each seal by
    direction (quantiles of each). Squares are pooled over levels or cells.
    """
    measured = readings.at.direction * (readings.force - offsets[readings.source])
    cells = _cells(readings) if readings.are_samples else readings.level
    squares = freedom = 0.0
    for cell in np.unique(cells):
        inside = measured[cells == cell]
        if len(inside) > 1:
            unit = 1.0 if readings.are_samples else float(inside.mean())
            squares += float(np.sum((inside - inside.mean()) ** 2)) / max(unit**2, 1e-24)
            freedom += len(inside) - 1
    if not freedom:
        return math.nan
    return math.sqrt(squares / freedom) / (float(measured.mean()) if readings.are_samples else 1.0)


def _cells(readings: Readings) -> IntArray:
    """Number of the cell of each sample, in a grid of quantiles of speed and of each pressure."""
    cells = (readings.at.direction > 0.0).astype(np.int64)
    columns = [(np.abs(readings.at.velocity), 12), *((column, 6) for column in readings.at.pressure.T)]
    for column, parts in columns:
        edges = np.quantile(column, np.linspace(0.0, 1.0, parts + 1)[1:-1])
        cells = cells * parts + np.searchsorted(edges, column)
    return cells


def run_drift(readings: Readings, offsets: FloatArray) -> dict[int, float]:
    """Relative change of the friction from the first to the last stroke of the run at each level [-].

    The slope of a line through the strokes of each direction in the order they were made; mean of the directions,
    and of the sources. Levels with fewer than four strokes in a direction are left out.
    """
    measured = readings.at.direction * (readings.force - offsets[readings.source])
    result: dict[int, list[float]] = {}
    for level in np.unique(readings.level):
        for source in np.unique(readings.source[readings.level == level]):
            for side in (-1.0, 1.0):
                run = measured[
                    (readings.level == level) & (readings.source == source) & (readings.at.direction == side)
                ]
                if len(run) >= 4:
                    slope = float(np.polyfit(np.arange(len(run)), run, 1)[0])
                    result.setdefault(int(level), []).append(slope * (len(run) - 1) / float(run.mean()))
    return {level: float(np.mean(values)) for level, values in result.items()}


def between_runs(readings: Readings) -> float:
    """Relative standard deviation of the friction between sources at one pressure [-]; NaN where none was repeated."""
    squares = freedom = 0.0
    for level in np.unique(readings.level):
        inside = readings.level == level
        sources = np.unique(readings.source[inside])
        frictions = np.array([level_friction(readings, inside & (readings.source == s)).friction for s in sources])
        squares += float(np.sum((frictions / frictions.mean() - 1.0) ** 2))
        freedom += len(sources) - 1
    return math.sqrt(squares / freedom) if freedom else math.nan


# -- what the data cannot tell ----------------------------------------------------------------------------------------


class Collinear(NamedTuple):
    """Two regressors that changed together."""

    one: str
    other: str
    correlation: float


def collinear_regressors(readings: Readings, chamber_pressures: FloatArray) -> list[Collinear]:
    """Every pair of regressors whose correlation is beyond `COLLINEAR`.

    Speed and seal pressure, which make viscous and pressure-dependent friction; velocity and pressure difference,
    which make viscous friction and an area error. Readings at held pressures are averaged over each pressure first.

    Args:
        readings: The readings.
        chamber_pressures: [Pa] of chambers a and b, shape (n, 2).
    """
    velocity = readings.at.velocity
    if not np.isfinite(velocity).all():
        return []
    pairs = [
        ('speed', np.abs(velocity), 'pressure of the seals', readings.seal_pressure),
        ('velocity', velocity, 'pressure difference', chamber_pressures[:, 0] - chamber_pressures[:, 1]),
    ]
    found = []
    for one, x, other, y in pairs:
        both = np.array([x, y]) if readings.are_samples else _level_means(readings, np.array([x, y]))
        varied = np.ptp(both, axis=1) > 1e-3 * np.abs(both).max(axis=1)
        if both.shape[1] < 3 or not varied.all():
            continue
        correlation = float(np.corrcoef(both)[0, 1])
        if abs(correlation) > COLLINEAR:
            found.append(Collinear(one, other, correlation))
    return found


def _level_means(readings: Readings, columns: FloatArray) -> FloatArray:
    """Mean of each row of ``columns``, shape (rows, n), at each pressure level, shape (rows, levels)."""
    levels = np.unique(readings.level)
    return np.array([[column[readings.level == level].mean() for level in levels] for column in columns])


def traded_off(found: Fit) -> list[Collinear]:
    """Every pair of fitted parameters whose correlation is beyond `TRADED_OFF`."""
    correlation = found.correlation
    names = [p.name for p in found.rung.parameters]
    return [
        Collinear(names[i], names[j], float(correlation[i, j]))
        for i, j in combinations(range(len(names)), 2)
        if abs(correlation[i, j]) > TRADED_OFF
    ]


class Outlier(NamedTuple):
    """A pressure at which the friction is not what the other pressures say."""

    level: int
    measured: float
    """[N]"""
    expected: float
    """[N] by the law fitted to the other levels"""
    standard_deviations: float


def outlying_level(rung: Rung, readings: Readings, near: Values, floor: float) -> Outlier | None:
    """The pressure level that disagrees most with the law of the others, if it does beyond `OUTLIER`.

    Each level is left out; the law is fitted to the rest; the deviation counts relative to how well the rest agree
    with their own law, to how well readings repeat, and to how far the law has to reach. A level that pulls the law to
    itself makes the rest agree badly when another one is left out, so it is the one whose absence makes them agree.

    Args:
        rung: The law.
        readings: At held pressures, at least four levels.
        near: Parameters of the fit to all readings, to begin from.
        floor: Relative standard deviation of repeated readings.
    """
    levels = np.unique(readings.level)
    if len(levels) < 4:
        return None
    worst: Outlier | None = None
    for level in levels:
        out = readings.level == level
        rest = readings.taken(~out)
        found = fit(rung, rest, near, is_close=True)
        expected = _level_law(found, readings, out)
        others = [rest.level == other for other in np.unique(rest.level)]
        misfits = [level_friction(rest, inside).friction / _level_law(found, rest, inside) - 1.0 for inside in others]
        freedom = max(len(misfits) - len(rung.parameters), 1)
        noise = math.hypot(math.sqrt(sum(m**2 for m in misfits) / freedom), floor)
        known = np.array([_relative_slope(found, rest, inside) for inside in others])
        asked = _relative_slope(found, readings, out)
        leverage = float(asked @ np.linalg.pinv(known.T @ known) @ asked)
        measured = level_friction(readings, out).friction
        size = abs(measured / expected - 1.0) / (noise * math.sqrt(1.0 + leverage))
        if size > OUTLIER and (worst is None or size > worst.standard_deviations):
            worst = Outlier(int(level), measured, expected, size)
    return worst


def _level_law(found: Fit, readings: Readings, inside: BoolArray) -> float:
    """Mean friction of a law over the readings ``inside`` [N]."""
    return float(found.friction(readings.at.taken(np.flatnonzero(inside))).mean())


def _relative_slope(found: Fit, readings: Readings, inside: BoolArray) -> FloatArray:
    """Relative change of that mean by a relative change of each parameter, shape (parameters,); finite differences."""
    middle = _level_law(found, readings, inside)
    result = np.empty(len(found.rung.parameters))
    for i, parameter in enumerate(found.rung.parameters):
        value = found.values[parameter.name]
        share = 1e-4 if value + 1e-4 * (abs(value) or 1.0) <= parameter.upper else -1e-4
        moved = replace(found, values=found.values | {parameter.name: value + share * (abs(value) or 1.0)})
        result[i] = (_level_law(moved, readings, inside) / middle - 1.0) / share
    return result


class Change(NamedTuple):
    """Friction of another source against a law."""

    name: str
    ratio: float
    """friction there over friction by the law [-]"""
    standard_error: float
    """of the ratio [-]"""
    rms: float
    """[N] what the law leaves there, offset removed"""
    own_rms: float
    """[N] what the same law leaves when it is fitted there"""

    @property
    def is_change(self) -> bool:
        """Whether the friction has changed: beyond `CHANGED`, and beyond twice its standard error."""
        return abs(self.ratio - 1.0) > max(CHANGED, 2.0 * self.standard_error)


def compare_with_law(found: Fit, fitted: Readings, other: Readings) -> Change:
    """How the friction of another source compares with a law that was fitted without it.

    The ratio is that of least squares, offset taken out, over the samples up to the highest pressure and speed that the
    law was fitted to; its standard error comes from leaving each group out.

    Args:
        found: The law.
        fitted: What it was fitted to.
        other: Samples of the other source.

    Raises:
        ValueError: Hardly any sample of the other source is under conditions of the law.
    """
    inside = other.seal_pressure <= fitted.seal_pressure.max()
    if np.isfinite(other.at.velocity).all() and np.isfinite(fitted.at.velocity).all():
        inside &= np.abs(other.at.velocity) <= np.abs(fitted.at.velocity).max()
    if inside.sum() < 0.1 * other.count:
        raise ValueError(
            f'{other.names[0]}: {100.0 * inside.mean():.0f} % of its samples are at pressures and speeds of '
            f'{fitted.names[0]}, so they cannot be compared: identify each for itself'
        )
    other = other.taken(inside)
    friction = found.friction(other.at)

    def ratio(index: BoolArray) -> float:
        """Slope of measured over predicted friction among some samples."""
        x = other.at.direction[index] * friction[index]
        y = other.force[index]
        x = x - x.mean()
        return float(np.sum(x * (y - y.mean())) / np.sum(x * x))

    groups = np.unique(other.group)
    parts = np.array([ratio(other.group != group) for group in groups])
    error = math.sqrt((len(groups) - 1) / len(groups) * float(np.sum((parts - parts.mean()) ** 2)))
    left = deviations(other, friction, offsets_of(other, friction))
    own = fit(found.rung, other, found.values, is_close=True)
    own_friction = own.friction(other.at)
    own_left = deviations(other, own_friction, own.offsets)
    name = other.names[int(other.source[0])]
    return Change(
        name, ratio(np.ones(other.count, dtype=bool)), error, *(float(np.sqrt(np.mean(x**2))) for x in (left, own_left))
    )


class LevelChange(NamedTuple):
    """Two sources that disagree at one pressure."""

    pressure: float
    """[Pa]"""
    name: str
    friction: float
    """[N]"""
    other_name: str
    other_friction: float
    """[N]"""


def changed_levels(readings: Readings) -> list[LevelChange]:
    """Pressures at which a later source differs from the first one there by more than `CHANGED`."""
    found = []
    for level in np.unique(readings.level):
        inside = readings.level == level
        sources = [int(source) for source in np.unique(readings.source[inside])]
        frictions = [level_friction(readings, inside & (readings.source == source)).friction for source in sources]
        for source, friction in zip(sources[1:], frictions[1:], strict=True):
            if abs(friction / frictions[0] - 1.0) > CHANGED:
                pressure = float(readings.seal_pressure[inside].mean())
                names = readings.names[sources[0]], readings.names[source]
                found.append(LevelChange(pressure, names[0], frictions[0], names[1], friction))
    return found


# -- breakaway --------------------------------------------------------------------------------------------------------


class Stiction(NamedTuple):
    """Breakaway force of one seal above its Coulomb friction: stiction + ratio * f_c."""

    law: str
    """constant or load_dependent"""
    stiction: float
    """[N] of one seal"""
    ratio: float
    """[-]"""
    standard_error: float
    """of whichever is not zero"""
    cross_validation_rms: dict[str, float]
    """[N] all seals: law -> what it leaves, out of sample"""


def identify_stiction(readings: Readings, friction: FloatArray, offsets: FloatArray) -> Stiction:
    """Constant or load-dependent breakaway, whichever predicts readings left out; the constant one unless beaten.

    Args:
        readings: Breakaway readings, of all seals.
        friction: Coulomb friction of the law at each of them [N], shape (n,).
        offsets: Of the force sum of each source [N].

    Source: thesis, section 5.2 (static above dynamic friction by about 0.5 lbf a seal); the share of the Coulomb
    friction is our choice, after the rise of the stiction over pressure in Tables A-1 to A-3.
    """
    seals = readings.at.pressure.shape[1]
    excess = deviations(readings, friction, offsets)
    laws = {'constant': np.ones(readings.count), 'load_dependent': friction}
    groups = np.unique(readings.group)
    losses, rms = {}, {}
    for name, regressor in laws.items():
        left = np.empty(readings.count)
        for group in groups:
            out = readings.group == group
            left[out] = excess[out] - _slope(regressor[~out], excess[~out]) * regressor[out]
        weighted = left / readings.scale
        losses[name] = np.array([_rms(weighted[readings.group == group]) for group in groups])
        rms[name] = float(np.sqrt(np.mean(left**2)))
    chosen = _lowest_unbeaten(losses)
    slope = _slope(laws[chosen], excess)
    parts = np.array([_slope(laws[chosen][readings.group != g], excess[readings.group != g]) for g in groups])
    count = len(groups)
    error = math.sqrt((count - 1) / count * float(np.sum((parts - parts.mean()) ** 2)))
    if chosen == 'load_dependent':
        return Stiction(chosen, 0.0, slope, error, rms)
    return Stiction(chosen, slope / seals, 0.0, error / seals, rms)


def _slope(regressor: FloatArray, excess: FloatArray) -> float:
    """Non-negative slope of least squares through the origin."""
    return max(float(np.sum(regressor * excess)) / float(np.sum(regressor**2)), 0.0)


def _lowest_unbeaten(losses: dict[str, FloatArray]) -> str:
    best = min(losses.values(), key=lambda values: float(values.mean()))
    return next(name for name, values in losses.items() if not is_beaten(values, best))
