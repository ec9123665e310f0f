"""Experiment design: the next readings that make the friction most certain, and what they break.

The criterion is the mean variance of the prediction over a range of pressures and speeds (V-optimality
[AtkinsonDonevTobias2007]_), by the covariance of the one model of the friction (`friction_model`), whose terms all have
a prior. Readings are chosen one after the other from a grid, each time the one that reduces the variance most.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import NamedTuple

import numpy as np
from scipy.special import stdtrit

from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.foundation.units import BAR
from seal_friction_ros.core.identification.candidate_laws import OperatingConditions
from seal_friction_ros.core.identification.friction_model import ModelFit, Told, fit_model
from seal_friction_ros.core.identification.readings import FrictionReadings, are_far_apart
from seal_friction_ros.core.identification.runs import PRIOR_FREEDOM, BetweenRuns
from seal_friction_ros.core.identification.selection import variation_of

READINGS = 8  # pressures and speeds that are proposed, each in both directions (our choice)
GRID_PRESSURES, GRID_SPEEDS = 6, 5  # of the readings to choose from (our choice)
RANGE_POINTS = 5  # pressures and speeds each at which the prediction variance is averaged (our choice)
MOST_SPEEDS = 0.95  # quantile of the speeds that is the fastest one: a single stroke does not count (our choice)
SPEED_VARIES = 1.5  # fastest over slowest speed, above which speed is varied (our choice)
SPEED_FACTORS = (0.2, 0.5, 1.0, 2.0, 5.0)  # of the used speed, where speed was not varied (our choice)
SPEED_LIMITS = (1e-4, 1.0)  # [m/s] of the speeds made with these factors (our choice)
ASSUMED_SPEED = 0.01  # [m/s] of readings without a speed: a slow pull by hand (our choice)
MOST_REPEATED = 10  # pressures of a repeated run (our choice)
DIRECTIONS = (-1, 1)

RUN_TO_RUN, LAW, SCATTER = 'run to run', 'law', 'scatter'
"""what limits the band: spread between runs, standard error of the law, scatter of single readings"""


class ProposedReading(NamedTuple):
    """A pressure and speed to be measured, once in each direction."""

    pressure: float  # [Pa, gauge] at every seal
    speed: float  # [m/s]
    directions: tuple[int, ...]
    shrink: float  # [-] standard error of the friction with this reading and those before it, over that without any
    is_repeated: bool  # repeats a reading at hand, to see how runs differ


class RepeatedRun(NamedTuple):
    """Effect of one more run, on another day."""

    freedom: int  # degrees of freedom that it adds
    shrink: float  # [-] of the run-to-run part of the band, if runs differ as expected: by Student's t alone
    shrink_at_best: float  # [-] of it, if the runs agree


class CorrelationChange(NamedTuple):
    """Correlation of the errors of two terms, without and with the proposed readings."""

    parameters: tuple[str, str]
    before: float
    after: float


@dataclass(frozen=True, eq=False)
class ExperimentDesign:
    """Proposed readings, in the order of their use, and their predicted effect."""

    readings: tuple[ProposedReading, ...]
    pressures: tuple[float, float]  # [Pa] lowest and highest of the range that the error is averaged over
    speeds: tuple[float, float]  # [m/s] slowest and fastest of it
    error_before: float  # [-] relative standard error of the friction over the range (root mean square)
    error_after: float  # [-]
    correlation: CorrelationChange  # of the two terms whose correlation falls most
    parts: dict[str, float]
    """[-] relative standard deviations in the band: `RUN_TO_RUN`, `LAW` (where it is identified), `SCATTER`"""
    repeated: RepeatedRun | None  # None if the spread between runs is stated, or in the left-out readings
    speed_is_measured: bool
    speed_is_varied: bool

    @property
    def limit(self) -> str:
        """What limits the band: the largest of its parts."""
        return max(self.parts, key=self.parts.__getitem__)

    @property
    def shrink(self) -> float:
        """Standard error of the friction with all proposed readings over that without them [-]."""
        return self.error_after / self.error_before


_Points = Sequence[tuple[float, float]]  # pressures [Pa] and speeds [m/s]


def design_experiment(
    readings: FrictionReadings, between: BetweenRuns | None, of_band: float, count: int = READINGS
) -> ExperimentDesign:
    r"""The next readings, greedily chosen such that the mean prediction variance of the friction falls most.

    .. math:: \min \frac1m \sum_{i=1}^m \frac{g_i^T C g_i}{f_i^2}, \qquad C^{-1} = C_0^{-1} + A^T A

    over m points of the range: :math:`g_i` derivative of the friction :math:`f_i` [N] by the parameters, :math:`C_0`
    their covariance by the readings at hand and the priors; A derivatives of the proposed readings over their standard
    deviation, one unknown offset eliminated.

    The range is that of the readings; if they hold one pressure it goes down to 0, if they hold one speed it is that of
    `SPEED_FACTORS`. If the spread between runs limits the band, the pressures of the readings are proposed once more,
    for another day, and other speeds only if speed was not varied.

    The spread ``between`` runs is None if it is stated, or if groups left out are runs; ``of_band`` is the relative
    standard deviation between runs in the band [-], ``count`` the number of points without repeated ones.

    Source: linear criteria and their greedy (sequential) minimisation are in [AtkinsonDonevTobias2007]_.
    """
    is_measured = bool(np.isfinite(readings.at.velocity).all())
    if not is_measured:
        at = readings.at._replace(velocity=ASSUMED_SPEED * readings.at.direction)
        readings = replace(readings, at=at)
    speed, is_varied = np.abs(readings.at.velocity), _is_speed_varied(readings.at)
    used_speeds = _ends(speed) if is_varied else (float(np.median(speed)),)
    low, high = float(readings.seal_pressure.min()), float(readings.seal_pressure.max())
    pressures = (low if are_far_apart(np.array([low, high])) else 0.0, high)
    speeds = _grid_speeds(used_speeds)
    design = _Design(_model(readings, is_varied=is_varied), _range_points(pressures, speeds))
    model = design.model
    law_error = _Design(model, _range_points((low, high), used_speeds)).error(design.information)
    parts = {RUN_TO_RUN: of_band, LAW: law_error, SCATTER: model.scatter}
    is_limited_by_runs = of_band >= max(parts.values())

    repeats = _levels(readings, speed) if is_limited_by_runs else []
    grid = [point for point in _grid(high, speeds) if point not in repeats]
    more = [] if is_limited_by_runs and is_varied else grid
    points, errors, information = design.greedy(repeats, more, count)
    before = design.error(design.information)
    proposed = tuple(
        ProposedReading(*point, DIRECTIONS, error / before, number < len(repeats))
        for number, (point, error) in enumerate(zip(points, errors, strict=True))
    )
    freedom = 1 if readings.are_samples else len(readings.levels)
    return ExperimentDesign(
        readings=proposed,
        pressures=pressures,
        speeds=(speeds[0], speeds[-1]),
        error_before=before,
        error_after=errors[-1] if errors else before,
        correlation=_correlation_change(design.information, information, len(model.columns)),
        parts=parts,
        repeated=None if between is None else repeated_run(between, freedom),
        speed_is_measured=is_measured,
        speed_is_varied=is_varied,
    )


def _model(readings: FrictionReadings, *, is_varied: bool) -> ModelFit:
    """The model of one kind of seals, of any exponent, with viscous friction even if the speed was not varied."""
    variation = variation_of(readings)
    told = Told(viscous=True, stribeck=is_varied, asymmetry=variation.asymmetry, areas=False)
    return fit_model(readings, [slice(None)] * (variation.pressures > 0), told, is_open=True)


def repeated_run(between: BetweenRuns, freedom: int) -> RepeatedRun:
    r"""Effect of one more run, which adds ``freedom`` degrees of freedom, on the run-to-run part of the band.

    .. math:: r = \frac{t_{0.975}(\nu + n)}{t_{0.975}(\nu)}, \qquad r_0 = r \sqrt{\nu / (\nu + n)}

    with :math:`\nu` those of the prior and of the runs at hand and n = ``freedom``: r if runs differ as expected,
    :math:`r_0` if they agree; see `runs.between_runs`.
    """
    had = PRIOR_FREEDOM + between.freedom
    shrink = float(stdtrit(had + freedom, 0.975) / stdtrit(had, 0.975))
    return RepeatedRun(freedom, shrink, shrink * math.sqrt(had / (had + freedom)))


class _Design:
    """Error of the model over a range of pressures and speeds."""

    def __init__(self, model: ModelFit, points: _Points) -> None:
        self.model = model
        at = self.conditions(points)
        self._told = np.flatnonzero(model.told)
        self._range = self._slopes(at) / self.friction(at)[:, np.newaxis]
        self.information = np.asarray(
            np.linalg.inv(model.chosen.covariance[np.ix_(self._told, self._told)]), np.float64
        )

    def friction(self, at: OperatingConditions) -> FloatArray:
        """Friction [N], not below 5 % of its mean, so that a relative error is finite."""
        return np.maximum(self.model.friction(at), 0.05 * self.model.size)

    def conditions(self, points: _Points) -> OperatingConditions:
        """Each pressure [Pa] and speed [m/s] in both directions, with the same pressure at every seal."""
        pressure, speed = np.repeat(np.array(points), len(DIRECTIONS), axis=0).T
        direction = np.tile(np.array(DIRECTIONS, dtype=np.float64), len(points))
        seals = self.model.problem.readings.at.pressure.shape[1]
        of_seals = np.repeat(pressure[:, np.newaxis], seals, axis=1)
        return OperatingConditions(of_seals, direction * speed, direction)

    def _slopes(self, at: OperatingConditions) -> FloatArray:
        """Derivative of the friction [N] by each parameter that readings tell, shape (n, parameters)."""
        return self.model.slopes(at)[:, self._told]

    def error(self, information: FloatArray) -> float:
        """Relative standard error over the range, root mean square; rounded, so that a tie goes to the first."""
        covariance = np.linalg.inv(information)
        error = math.sqrt(float(np.mean(np.sum((self._range @ covariance) * self._range, axis=1))))
        return float(f'{error:.9g}')

    def _of_point(self, point: tuple[float, float]) -> FloatArray:
        """Information of a reading in each direction on the parameters and, in the last row, one offset."""
        at = self.conditions([point])
        rows = np.column_stack((at.direction[:, np.newaxis] * self._slopes(at), np.ones(len(DIRECTIONS))))
        scale = self.model.size if self.model.problem.readings.are_samples else self.friction(at)[:, np.newaxis]
        rows = rows / (scale * self.model.scatter)
        return np.asarray(rows.T @ rows)

    def greedy(
        self, first: _Points, grid: _Points, count: int
    ) -> tuple[list[tuple[float, float]], list[float], FloatArray]:
        """Points in the order of their use, the error after each, and the information with all of them.

        The points ``first`` come first, then ``count`` of the ``grid``. All are one source with one unknown offset.
        """
        each = {point: self._of_point(point) for point in (*first, *grid)}
        total = np.zeros_like(next(iter(each.values()))) if each else np.zeros((len(self.information) + 1,) * 2)
        points: list[tuple[float, float]] = []
        errors: list[float] = []

        def error_with(point: tuple[float, float]) -> float:
            return self.error(self.information + _without_offset(total + each[point]))

        for number in range(len(first) + min(count, len(grid))):
            open_points = [first[number]] if number < len(first) else [p for p in grid if p not in points]
            points.append(min(open_points, key=error_with))
            errors.append(error_with(points[-1]))
            total = total + each[points[-1]]
        return points, errors, self.information + _without_offset(total)


def _without_offset(information: FloatArray) -> FloatArray:
    r"""Information on the parameters, the offset in the last row eliminated: :math:`A - b\,b^T / c`."""
    mixed = information[:-1, -1]
    return np.asarray(information[:-1, :-1] - np.outer(mixed, mixed) / max(float(information[-1, -1]), 1e-300))


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


def _correlation_change(before: FloatArray, after: FloatArray, kinds: int) -> CorrelationChange:
    """The two linear terms whose correlation r falls most, by that of the variance inflation 1 / (1 - r^2)."""
    names = ('friction_at_no_pressure', *['friction_at_one_bar'] * kinds, 'viscous_friction')
    both = []
    for information in (before, after):
        covariance = np.linalg.inv(information)
        std = np.sqrt(np.diag(covariance))
        both.append(covariance / np.outer(std, std))
    inflation = [-np.log(np.maximum(1.0 - each**2, 1e-16)) for each in both]
    fall = inflation[0] - inflation[1]
    i, j = max(combinations(range(len(names)), 2), key=lambda pair: float(fall[pair]))
    return CorrelationChange((names[i], names[j]), float(both[0][i, j]), float(both[1][i, j]))
