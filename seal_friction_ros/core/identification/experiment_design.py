"""Experiment design: the next readings that make a law most certain, and what they break.

The criterion is the mean variance of the prediction over a range of pressures and speeds (V-optimality
[AtkinsonDonevTobias2007]_), of the richest law that is not beaten. Readings are chosen one after the other from a grid,
each time the one that reduces the variance most. How much the laws that are not beaten disagree at each reading
(T-optimality [AtkinsonFedorov1975]_) is reported with it.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import NamedTuple

import numpy as np
from scipy.special import stdtrit

from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.foundation.units import BAR
from seal_friction_ros.core.identification.candidate_laws import (
    CandidateLaw,
    OperatingConditions,
    ParameterValues,
    Variation,
    candidate_laws,
    with_velocity_terms,
)
from seal_friction_ros.core.identification.diagnostics import CorrelatedPair
from seal_friction_ros.core.identification.fitting import LawFit, slopes
from seal_friction_ros.core.identification.readings import FrictionReadings, are_far_apart
from seal_friction_ros.core.identification.runs import PRIOR_FREEDOM, BetweenRuns
from seal_friction_ros.core.identification.selection import LawScore, Scores, is_beaten, scored
from seal_friction_ros.core.identification.validation import jackknife_errors

READINGS = 8  # pressures and speeds that are proposed, each in both directions (our choice)
GRID_PRESSURES, GRID_SPEEDS = 6, 5  # of the readings to choose from (our choice)
RANGE_POINTS = 5  # pressures and speeds each at which the prediction variance is averaged (our choice)
MOST_SPEEDS = 0.95  # quantile of the speeds that is the fastest one: a single stroke does not count (our choice)
SPEED_VARIES = 1.5  # fastest over slowest speed, above which speed is varied (our choice)
SPEED_FACTORS = (0.2, 0.5, 1.0, 2.0, 5.0)  # of the used speed, where speed was not varied (our choice)
SPEED_LIMITS = (1e-4, 1.0)  # [m/s] of the speeds made with these factors (our choice)
ASSUMED_SPEED = 0.01  # [m/s] of readings without a speed: a slow pull by hand (our choice)
PRIOR_CHANGE = 1.0  # [-] standard deviation by which a parameter changes the friction, before any reading (our choice)
SMALLEST_SCATTER = 0.01  # [-] of a reading: no load cell repeats within less (our choice)
MOST_REPEATED = 10  # pressures of a repeated run (our choice)
SINGULAR = 1e-14  # [-] smallest eigenvalue of columns of unit length below which parameters are not identifiable
DIRECTIONS = (-1, 1)

RUN_TO_RUN, LAW, SCATTER = 'run to run', 'law', 'scatter'
"""what limits the band: spread between runs, standard error of the law, scatter of single readings"""


class ProposedReading(NamedTuple):
    """A pressure and speed to be measured, once in each direction."""

    pressure: float  # [Pa, gauge] at every seal
    speed: float  # [m/s]
    directions: tuple[int, ...]
    shrink: float  # [-] standard error of the law with this reading and those before it, over that without any
    disagreement: float  # [-] largest difference of the laws that are not beaten there, over their mean
    is_repeated: bool  # repeats a reading at hand, to see how runs differ


class RepeatedRun(NamedTuple):
    """Effect of one more run, on another day."""

    freedom: int  # degrees of freedom that it adds
    shrink: float  # [-] of the run-to-run part of the band, if runs differ as expected: by Student's t alone
    shrink_at_best: float  # [-] of it, if the runs agree


@dataclass(frozen=True, eq=False)
class ExperimentDesign:
    """Proposed readings, in the order of their use, and their predicted effect."""

    law: CandidateLaw  # that the readings are chosen for
    readings: tuple[ProposedReading, ...]
    pressures: tuple[float, float]  # [Pa] lowest and highest of the range that the error is averaged over
    speeds: tuple[float, float]  # [m/s] slowest and fastest of it
    error_before: float  # [-] relative standard error of the law over the range (root mean square)
    error_after: float  # [-]
    correlation_before: CorrelatedPair | None  # of the two parameters whose correlation falls most; None for one
    correlation_after: CorrelatedPair | None
    condition_before: float  # condition number of the scaled Jacobian; infinite if a parameter is not identifiable
    condition_after: float
    parts: dict[str, float]
    """[-] relative standard deviations in the band: `RUN_TO_RUN`, `LAW` (where it is identified), `SCATTER`"""
    repeated: RepeatedRun | None  # None if the spread between runs is stated, or in the left-out readings
    speed_is_measured: bool
    speed_is_varied: bool

    @property
    def limit(self) -> str:
        """What limits the band: the largest of its parts."""
        return _largest(self.parts)

    @property
    def shrink(self) -> float:
        """Standard error of the law with all proposed readings over that without them [-]."""
        return self.error_after / self.error_before


def _largest(parts: Mapping[str, float]) -> str:
    return max(parts, key=lambda part: parts[part])


@dataclass(frozen=True, eq=False)
class _Model:
    """Law linearised about its fitted parameters."""

    law: CandidateLaw
    values: ParameterValues
    seals: int
    mean: float  # [N] mean friction of the readings
    held_scale: float  # [N] divisor of a deviation; NaN if it is the friction

    def friction(self, at: OperatingConditions) -> FloatArray:
        """Friction [N], not below 5 % of its mean, so that a relative error is finite."""
        return np.maximum(self.law.friction(at, self.values), 0.05 * self.mean)

    def slopes(self, at: OperatingConditions) -> FloatArray:
        """Derivative of the friction [N] by each parameter, shape (n, parameters)."""
        return slopes(self.law, self.values, at)

    def scale(self, at: OperatingConditions) -> FloatArray:
        """Divisor of the deviation of a new reading [N], as of `FrictionReadings.scale`; of pairs of directions."""
        if math.isfinite(self.held_scale):
            return np.full(len(at.direction), self.held_scale)
        pairs = self.friction(at).reshape(-1, len(DIRECTIONS))
        return np.repeat(pairs.mean(axis=1), len(DIRECTIONS))

    def conditions(self, points: Sequence[tuple[float, float]]) -> OperatingConditions:
        """Each pressure [Pa] and speed [m/s] in both directions, with the same pressure at every seal."""
        pressure, speed = np.repeat(np.array(points), len(DIRECTIONS), axis=0).T
        direction = np.tile(np.array(DIRECTIONS, dtype=np.float64), len(points))
        return OperatingConditions(
            np.repeat(pressure[:, np.newaxis], self.seals, axis=1), None, direction * speed, direction
        )


def design_experiment(
    scores: Scores,
    readings: FrictionReadings,
    between: BetweenRuns | None,
    of_band: float,
    count: int = READINGS,
) -> ExperimentDesign:
    r"""The next readings, greedily chosen such that the mean prediction variance of the law falls most.

    .. math:: \min \frac1m \sum_{i=1}^m \frac{g_i^T C g_i}{f_i^2}, \qquad
        C^{-1} = \frac{J^T J}{\kappa s^2} + \frac{A^T A}{s^2} + \Lambda

    over m points of the range: :math:`g_i` derivative of the friction :math:`f_i` [N] by the parameters; J, A
    derivatives of the weighted deviations [-] of the readings at hand and of the proposed ones, offsets eliminated; s
    scatter of one reading [-]. :math:`\kappa \ge 1` is the number of readings at hand that are worth one independent
    reading: with it the variance at the readings is that of the jackknife [Efron1982]_. :math:`\Lambda` is a weak
    prior: each parameter alone changes the friction by `PRIOR_CHANGE`. It keeps the variance finite where a parameter
    is not determined.

    The range is that of the readings; if they hold one pressure it goes down to 0, if they hold one speed it is that of
    `SPEED_FACTORS`. If the spread between runs limits the band, the pressures of the readings are proposed once more,
    for another day, and other speeds only if speed was not varied.

    Args:
        scores: Ladder of laws.
        readings: That the laws were fitted to.
        between: Spread between runs; None if it is stated, or if groups left out are runs.
        of_band: Relative standard deviation between runs that is in the band [-].
        count: Number of pressures and speeds, without repeated ones.

    Raises:
        ValueError: No law was fitted.

    Source: linear criteria and their greedy (sequential) minimisation are in [AtkinsonDonevTobias2007]_, prior and
    :math:`\kappa` are our choice.
    """
    near = laws_not_beaten(scores)
    chosen = _richest(near)
    at, is_measured = readings.at, bool(np.isfinite(readings.at.velocity).all())
    if not is_measured:
        at = at._replace(velocity=ASSUMED_SPEED * at.direction)
    speed = np.abs(at.velocity)
    is_varied = _is_speed_varied(at)
    used_speeds = _ends(speed) if is_varied else (float(np.median(speed)),)
    model = _model(chosen, readings, at)
    scatter = _scatter(chosen, readings)
    identified, pressures = _pressure_ranges(readings)
    speeds = _grid_speeds(used_speeds)
    prior = _prior(model, *pressures, speeds)
    at_readings = model.slopes(at)
    had = _information_at_hand(at_readings, at.direction, readings, scatter)
    had = had / _readings_worth_one(chosen, readings, scatter)

    range_slopes = _relative_slopes(model, pressures, speeds)
    relative = at_readings / model.friction(at)[:, np.newaxis]
    identified_slopes = _relative_slopes(model, identified, used_speeds) if is_varied else relative
    before = _error(range_slopes, had + prior)
    law_error = _error(identified_slopes, had + prior)
    parts = {RUN_TO_RUN: of_band, LAW: law_error, SCATTER: scatter}
    is_limited_by_runs = _largest(parts) == RUN_TO_RUN

    repeats = _levels(readings, speed) if is_limited_by_runs else []
    grid = [point for point in _grid(identified[1], speeds) if point not in repeats]
    more = [] if is_limited_by_runs and is_varied else grid
    points, errors, information = _greedy(model, range_slopes, had + prior, scatter, repeats, more, count)
    freedom = 1 if readings.are_samples else len(readings.levels)
    correlations = _correlated_pair(model.law, had + prior, had + prior + information)
    proposed = tuple(
        ProposedReading(*point, DIRECTIONS, error / before, _disagreement(near, model, point), number < len(repeats))
        for number, (point, error) in enumerate(zip(points, errors, strict=True))
    )
    return ExperimentDesign(
        law=model.law,
        readings=proposed,
        pressures=pressures,
        speeds=(speeds[0], speeds[-1]),
        error_before=before,
        error_after=errors[-1] if errors else before,
        correlation_before=correlations[0],
        correlation_after=correlations[1],
        condition_before=_condition(had),
        condition_after=_condition(had + information),
        parts=parts,
        repeated=None if between is None else repeated_run(between, freedom),
        speed_is_measured=is_measured,
        speed_is_varied=is_varied,
    )


def _information_at_hand(
    slopes: FloatArray, direction: FloatArray, readings: FrictionReadings, scatter: float
) -> FloatArray:
    """Information of the readings about the parameters, offsets of sources with both directions eliminated."""
    two_sided = [source for source, index in enumerate(readings.two_sided) if len(index)]
    offsets = direction[:, np.newaxis] * (readings.source[:, np.newaxis] == two_sided)
    return _without_offsets(_information(slopes, offsets, readings.scale * scatter), slopes.shape[1])


def laws_not_beaten(scores: Scores) -> list[LawScore]:
    """Laws that the best law (smallest mean loss) does not beat, each parameter of which has an effect.

    Raises:
        ValueError: No law was fitted.
    """
    found = scored(scores)
    best = min(found, key=lambda score: score.mean_loss)
    left = [s for s in found if s is best or not is_beaten(s.losses, best.losses, many_times=True)]
    return [score for score in left if math.isfinite(score.fit.condition_number)] or [best]


def repeated_run(between: BetweenRuns, freedom: int) -> RepeatedRun:
    r"""Effect of one more run, which adds ``freedom`` degrees of freedom, on the run-to-run part of the band.

    .. math:: r = \frac{t_{0.975}(\nu + n)}{t_{0.975}(\nu)}, \qquad r_0 = r \sqrt{\nu / (\nu + n)}

    with :math:`\nu` those of the prior and of the runs at hand and n = ``freedom``: r if runs differ as expected,
    :math:`r_0` if they agree; see `runs.between_runs`.
    """
    had = PRIOR_FREEDOM + between.freedom
    shrink = float(stdtrit(had + freedom, 0.975) / stdtrit(had, 0.975))
    return RepeatedRun(freedom, shrink, shrink * math.sqrt(had / (had + freedom)))


def _richest(near: Sequence[LawScore]) -> LawScore:
    """The law with the most parameters, of equally many the one with the smallest mean loss.

    A law with a parameter at its upper bound does not count where there are others.
    """

    def is_inside(fit: LawFit) -> bool:
        return all(fit.values[p.name] <= p.upper - 1e-6 * (p.upper - p.lower) for p in fit.law.parameters)

    return min(
        [score for score in near if is_inside(score.fit)] or near,
        key=lambda score: (-len(score.law.parameters), score.mean_loss),
    )


def _model(score: LawScore, readings: FrictionReadings, at: OperatingConditions) -> _Model:
    """The law with what the readings could not tell: friction at no pressure, and viscous friction; both then 0.

    A law that itself depends on speed gets no viscous friction.
    """
    law, values = score.law, dict(score.fit.values)
    if 'friction_at_no_pressure' in law.fixed:
        laws = candidate_laws(Variation(speeds=False))
        law = next(found for found in laws if found.name == 'pressure_power_law_2_3')
    if not law.depends_on_speed and 'viscous_friction' not in law.velocity_terms:
        law = with_velocity_terms(law, Variation(asymmetry=False))[0]
        values['viscous_friction'] = 0.0
    mean = float(score.fit.friction(readings.at).mean())
    scale = float(readings.scale[0]) if readings.are_samples else math.nan
    return _Model(law, values, at.pressure.shape[1], mean, scale)


def _scatter(score: LawScore, readings: FrictionReadings) -> float:
    """Standard deviation of a weighted deviation from the fitted law [-]."""
    fit = score.fit
    deviation = (readings.magnitudes(fit.offsets) - fit.friction(readings.at)) / readings.scale
    freedom = readings.count - len(fit.law.parameters) - sum(len(index) > 0 for index in readings.two_sided)
    return max(math.sqrt(float(np.sum(deviation**2)) / max(freedom, 1)), SMALLEST_SCATTER)


def _information(slopes: FloatArray, offsets: FloatArray, scale: FloatArray) -> FloatArray:
    """Information of readings with the standard deviations ``scale`` [N] on the parameters, the offsets last."""
    rows = np.column_stack((slopes, offsets)) / scale[:, np.newaxis]
    return np.asarray(rows.T @ rows)


def _without_offsets(information: FloatArray, count: int) -> FloatArray:
    r"""Information on ``count`` parameters, the offsets in the last rows eliminated: :math:`A - B\,C^{-1} B^T`."""
    mixed = information[:count, count:]
    return np.asarray(information[:count, :count] - mixed @ np.linalg.pinv(information[count:, count:]) @ mixed.T)


def _readings_worth_one(score: LawScore, readings: FrictionReadings, scatter: float) -> float:
    """Variance of the law at the readings by the jackknife over that of independent readings, at least 1."""
    fit = score.fit
    estimates = [fit.law.friction(readings.at, fit.law.named(vector)) for vector in score.validation.parameters]
    found = jackknife_errors(np.array(estimates) / readings.scale)
    orthonormal = np.linalg.svd(fit.jacobian, full_matrices=False)[0]
    independent = scatter**2 * np.sum(orthonormal**2, axis=1)
    return max(float(np.mean(found**2) / np.mean(independent)), 1.0)


def _ends(speed: FloatArray) -> tuple[float, float]:
    """Slowest and fastest speed [m/s] without the tails beyond `MOST_SPEEDS`."""
    return float(np.quantile(speed, 1.0 - MOST_SPEEDS)), float(np.quantile(speed, MOST_SPEEDS))


def _is_speed_varied(at: OperatingConditions) -> bool:
    """Whether the speed varies within one direction; a speed that follows the direction counts as one speed."""
    ends = [_ends(np.abs(at.velocity[at.direction == side])) for side in np.unique(at.direction)]
    return any(fastest > SPEED_VARIES * slowest for slowest, fastest in ends)


def _grid_speeds(used_speeds: Sequence[float]) -> list[float]:
    """Speeds to choose from [m/s], increasing: from slowest to fastest, or `SPEED_FACTORS` times the only one."""
    if len(used_speeds) > 1:
        slowest, fastest = used_speeds
        made = np.geomspace(max(slowest, SPEED_LIMITS[0], 1e-3 * fastest), fastest, GRID_SPEEDS)
    else:
        (used,) = used_speeds
        made = np.clip(np.array(SPEED_FACTORS) * used, min(SPEED_LIMITS[0], used), max(SPEED_LIMITS[1], used))
    return sorted({_three_digits(value) for value in made.tolist()})


def _three_digits(value: float) -> float:
    """A value to be set by a person: three significant digits, not above the value."""
    if value <= 0.0:
        return 0.0
    unit = 10.0 ** (math.floor(math.log10(value)) - 2)
    return float(f'{math.floor(value / unit * (1.0 + 1e-12)) * unit:.3g}')


def _grid(highest: float, speeds: Sequence[float]) -> list[tuple[float, float]]:
    """Pressures from 0 to the highest [Pa], each with every speed [m/s]."""
    pressures = [_three_digits(p / BAR) * BAR for p in np.linspace(0.0, highest, GRID_PRESSURES).tolist()]
    return [(pressure, speed) for pressure in pressures for speed in speeds]


def _levels(readings: FrictionReadings, speed: FloatArray) -> list[tuple[float, float]]:
    """Pressure [Pa] and speed [m/s] of each level, `MOST_REPEATED` at most."""
    every = list(zip(readings.levels.values(), readings.level_pressures.tolist(), strict=True))
    taken = np.unique(np.linspace(0, len(every) - 1, min(len(every), MOST_REPEATED)).round().astype(int)).tolist()
    points = [every[i] for i in taken]
    found = [(_three_digits(p / BAR) * BAR, _three_digits(float(np.median(speed[inside])))) for inside, p in points]
    return list(dict.fromkeys(found))


def _range_points(pressures: Sequence[float], speeds: Sequence[float]) -> list[tuple[float, float]]:
    """Grid over a range of pressures [Pa] and speeds [m/s]."""
    every = [np.linspace(float(ends[0]), float(ends[-1]), RANGE_POINTS).tolist() for ends in (pressures, speeds)]
    return [(pressure, speed) for pressure in every[0] for speed in every[1]]


def _relative_slopes(model: _Model, pressures: Sequence[float], speeds: Sequence[float]) -> FloatArray:
    """Relative change of the friction over a range by each parameter, shape (points, parameters)."""
    at = model.conditions(_range_points(pressures, speeds))
    return np.asarray(model.slopes(at) / model.friction(at)[:, np.newaxis])


def _prior(model: _Model, low: float, high: float, speeds: Sequence[float]) -> FloatArray:
    """Information matrix of the prior: each parameter changes the friction by `PRIOR_CHANGE` where it changes most."""
    slopes = model.slopes(model.conditions(_range_points((low, high), speeds))) / model.mean
    strongest = np.abs(slopes).max(axis=0)
    return np.diag((np.maximum(strongest, 1e-12) / PRIOR_CHANGE) ** 2)


def _covariance(information: FloatArray) -> FloatArray:
    """Covariance of the parameters."""
    sizes = np.sqrt(np.outer(np.diag(information), np.diag(information)))
    return np.asarray(np.linalg.pinv(information / sizes, hermitian=True) / sizes)


def _error(slopes: FloatArray, information: FloatArray) -> float:
    """Relative standard error of the law, root mean square over the points of ``slopes``."""
    return math.sqrt(float(np.mean(np.sum((slopes @ _covariance(information)) * slopes, axis=1))))


def _greedy(
    model: _Model,
    range_slopes: FloatArray,
    information: FloatArray,
    scatter: float,
    first: Sequence[tuple[float, float]],
    grid: Sequence[tuple[float, float]],
    count: int,
) -> tuple[list[tuple[float, float]], list[float], FloatArray]:
    """Points in the order of their use, error of the law after each, and the information of all of them.

    The points ``first`` come first, then ``count`` of the ``grid``. All are one source with one unknown offset.
    """
    parameters = len(information)
    total = np.zeros((parameters + 1, parameters + 1))
    points: list[tuple[float, float]] = []
    errors: list[float] = []
    each = {}
    for point in (*first, *grid):
        at = model.conditions([point])
        each[point] = _information(model.slopes(at), at.direction, model.scale(at) * scatter)

    def error_with(point: tuple[float, float]) -> float:
        """Rounded, so that a tie goes to the first of the grid."""
        more = _without_offsets(total + each[point], parameters)
        return float(f'{_error(range_slopes, information + more):.9g}')

    for number in range(len(first) + min(count, len(grid))):
        open_points = [first[number]] if number < len(first) else [p for p in grid if p not in points]
        points.append(min(open_points, key=error_with))
        errors.append(error_with(points[-1]))
        total = total + each[points[-1]]
    return points, errors, _without_offsets(total, parameters)


def _correlation(information: FloatArray) -> FloatArray:
    """Correlation of the parameters, shape (parameters, parameters)."""
    covariance = _covariance(information)
    std = np.sqrt(np.diag(covariance))
    return np.asarray(covariance / np.outer(std, std))


def _pressure_ranges(readings: FrictionReadings) -> tuple[tuple[float, float], tuple[float, float]]:
    """Lowest and highest pressure [Pa] of the readings, and of the range: down to 0 if they hold one pressure."""
    low, high = float(readings.seal_pressure.min()), float(readings.seal_pressure.max())
    return (low, high), (low if are_far_apart(np.array([low, high])) else 0.0, high)


def _correlated_pair(law: CandidateLaw, before: FloatArray, after: FloatArray) -> list[CorrelatedPair | None]:
    """The two parameters whose correlation r falls most from one information to the other, with both correlations.

    It falls by that of 1 / (1 - r^2), the variance inflation. None for one parameter.
    """
    both = [_correlation(information) for information in (before, after)]
    inflation = [-np.log(np.maximum(1.0 - each**2, 1e-16)) for each in both]
    fall, names = inflation[0] - inflation[1], [parameter.name for parameter in law.parameters]
    pair = max(combinations(range(len(names)), 2), key=lambda pair: float(fall[pair]), default=None)
    return [pair and CorrelatedPair(names[pair[0]], names[pair[1]], float(each[pair])) for each in both]


def _condition(information: FloatArray) -> float:
    """Condition number of the Jacobian with columns of unit length, as of `LawFit.condition_number`."""
    size = np.sqrt(np.maximum(np.diag(information), 0.0))
    if not np.all(size > 0.0):
        return math.inf
    values = np.linalg.eigvalsh(information / np.outer(size, size))
    if values[0] <= SINGULAR:
        return math.inf
    return math.sqrt(float(values[-1] / values[0]))


def _disagreement(near: Sequence[LawScore], model: _Model, point: tuple[float, float]) -> float:
    """Largest difference of the laws at a point over their mean [-]."""
    at = model.conditions([point])
    frictions = np.array([score.fit.friction(at) for score in near])
    mean = np.maximum(frictions.mean(axis=0), 0.05 * model.mean)
    return float((np.ptp(frictions, axis=0) / mean).max())
