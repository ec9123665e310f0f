"""Fit of candidate laws to friction readings, cross-validation, choice of a law, and its uncertainty.

Each law is fitted by least squares, together with one offset of the force sum for each source, and scored on readings
left out of the fit. The simplest law that no other law beats beyond the noise is recommended. The computation uses no
random numbers: the same readings give the same result.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import least_squares, nnls
from scipy.stats import t as student_t

from seal_friction_ros.core.foundation.arrays import BoolArray, FloatArray
from seal_friction_ros.core.foundation.normal_distribution import BAND_95
from seal_friction_ros.core.identification.candidate_laws import CandidateLaw, OperatingConditions, ParameterValues
from seal_friction_ros.core.identification.readings import FrictionReadings
from seal_friction_ros.core.identification.signal_preparation import half_range

BEATEN_CONFIDENCE = 0.95  # of the test whether a law is beaten (our choice)
WORTHWHILE = 0.1  # share of its loss by which a law must be beaten (our choice)
_START_FACTORS = (0.2, 1.0, 4.0)  # on the first guess of the Stribeck velocity, each the start of a fit

Ticks = Callable[[int], None]


@dataclass(frozen=True, eq=False)
class LawFit:
    """A law fitted to readings."""

    law: CandidateLaw
    values: dict[str, float]  # parameters of one seal
    offsets: FloatArray  # [N] offset of the force sum of each source, shape (sources,)
    jacobian: FloatArray
    """derivative of the weighted deviations by the parameters, offsets eliminated, shape (n, parameters)"""

    def friction(self, at: OperatingConditions) -> FloatArray:
        """Magnitude of the friction of all seals [N], shape (n,)."""
        return self.law.friction(at, self.values)

    @property
    def condition_number(self) -> float:
        """Condition number of the Jacobian with columns of unit length; infinite if a parameter has no effect."""
        lengths = np.linalg.norm(self.jacobian, axis=0)
        return float(np.linalg.cond(self.jacobian / lengths)) if np.all(lengths > 0.0) else math.inf

    @property
    def correlation(self) -> FloatArray:
        """Correlation of the parameters, shape (parameters, parameters); NaN if they are not identifiable."""
        normal = self.jacobian.T @ self.jacobian
        size = np.sqrt(np.diag(normal))
        if not np.all(size > 0.0) or self.condition_number > 1e8:
            return np.full(normal.shape, np.nan)
        covariance = np.linalg.inv(normal / np.outer(size, size))
        std = np.sqrt(np.diag(covariance))
        return np.asarray(covariance / np.outer(std, std))


def offsets_of(readings: FrictionReadings, friction: FloatArray) -> FloatArray:
    """Least-squares offset of the force sum of each source [N], shape (sources,), for a ``friction`` [N], shape (n,).

    The offset of a source in one direction only is 0 N, because it cannot be separated from friction.
    """
    signed = readings.force - readings.at.direction * friction
    result = np.zeros(len(readings.names))
    for source, index in enumerate(readings.two_sided):
        if len(index):
            result[source] = np.average(signed[index], weights=1.0 / readings.scale[index] ** 2)
    return result


def fit(
    law: CandidateLaw, readings: FrictionReadings, known: ParameterValues | None = None, *, is_close: bool = False
) -> LawFit:
    """Least-squares fit of a law, with one offset of the force sum for each source.

    The offsets are linear and are eliminated. The sum of squares has local minima over the Stribeck velocity: the fit
    starts from several velocities and the best result counts. ``known`` are start values from a simpler law or similar
    readings; if ``is_close``, they are complete and near the result, and the fit starts from them alone.

    Raises:
        ValueError: The result is not finite.
    """
    lower, upper = np.array([(p.lower, p.upper) for p in law.parameters]).T

    def residuals(vector: FloatArray) -> FloatArray:
        friction = law.friction(readings.at, law.named(vector))
        return np.asarray((readings.magnitudes(offsets_of(readings, friction)) - friction) / readings.scale)

    mean_friction = float(np.abs(readings.force).mean() / readings.at.pressure.shape[1])  # [N] of one seal
    typical = readings.at.typical(mean_friction)
    first_guess = {p.name: p.start(typical) for p in law.parameters}
    start = first_guess | {name: value for name, value in (known or {}).items() if name in first_guess}
    best: Any = None
    for factor in (1.0,) if is_close or 'stribeck_velocity' not in start else _START_FACTORS:
        guess = [value * (factor if name == 'stribeck_velocity' else 1.0) for name, value in start.items()]
        inside = np.clip(guess, lower, upper)
        size = np.maximum(np.abs(inside), 1e-3 * np.minimum(upper, 1.0))
        found = least_squares(residuals, inside, bounds=(lower, upper), x_scale=size, xtol=1e-9, ftol=1e-9, gtol=1e-9)
        if best is None or found.cost < best.cost * (1.0 - 1e-9):
            best = found
    if not np.isfinite(best.x).all():
        raise ValueError(f'{law.name}: the result of the fit is not finite')
    at_zero = (lower == 0.0) & (np.abs(best.x) < 1e-6 * np.abs(list(first_guess.values())))
    values = law.named(np.where(at_zero, 0.0, best.x))  # exactly 0 for a term without effect, instead of about 1e-18
    return LawFit(law, values, offsets_of(readings, law.friction(readings.at, values)), np.asarray(best.jac))


@dataclass(frozen=True, eq=False)
class CrossValidation:
    """Prediction of each group of readings from all others."""

    predicted: FloatArray  # [N] shape (n,)
    deviation: FloatArray  # [N] measured - predicted, shape (n,)
    losses: FloatArray  # root mean square of the weighted deviation in each group [-], shape (groups,)
    parameters: FloatArray  # fitted without each group, shape (groups, parameters)

    @property
    def rms(self) -> float:
        """Root mean square of the deviation [N]."""
        return root_mean_square(self.deviation)

    @property
    def error(self) -> float:
        """Sum of the deviations over the sum of the measured friction [-], both as magnitudes."""
        return float(np.abs(self.deviation).sum() / np.abs(self.predicted + self.deviation).sum())

    @property
    def mean_deviation(self) -> float:
        """Mean magnitude of the deviation [N]."""
        return float(np.abs(self.deviation).mean())


def cross_validate(
    law: CandidateLaw, readings: FrictionReadings, near: ParameterValues, tick: Ticks = lambda _: None
) -> CrossValidation:
    """Predict each group (of two at least) by the law fitted to all other groups.

    The fits start ``near`` the parameters of the fit to all readings. ``tick`` is called with 1 after each fit.
    """
    predicted, deviation = np.empty(readings.count), np.empty(readings.count)
    parameters = []
    for out in readings.groups:
        values, predicted[out], deviation[out] = _predict(law, readings.taken(~out), readings.taken(out), near)
        parameters.append([values[p.name] for p in law.parameters])
        tick(1)
    return CrossValidation(predicted, deviation, _group_losses(readings, deviation), np.array(parameters))


def _predict(
    law: CandidateLaw, trained: FrictionReadings, tested: FrictionReadings, near: ParameterValues
) -> tuple[ParameterValues, FloatArray, FloatArray]:
    """Law fitted to ``trained``: parameters, friction of ``tested``, and measured less predicted friction [N].

    The offset of a source comes from ``trained``. A source that is not in ``trained`` gets its offset from its own
    readings in both directions, in which the friction cancels.
    """
    found = fit(law, trained, near, is_close=True)
    friction = found.friction(tested.at)
    signed = tested.force - tested.at.direction * friction
    offsets = found.offsets.copy()
    for source in set(range(len(tested.names))) - set(trained.source.tolist()):
        index = tested.two_sided[source]
        direction = tested.at.direction[index].astype(np.int64)
        offsets[source] = half_range(signed[index], direction, of_medians=False).offset if len(index) else 0.0
    return found.values, friction, tested.magnitudes(offsets) - friction


def plain_mean(readings: FrictionReadings) -> CrossValidation | None:
    """Prediction without a law: each reading by the mean of the readings of other groups at the same pressure.

    None if a pressure is in one group only, or for samples of swept logs.
    """
    if readings.are_samples or readings.left_out_by == 'pressure':
        return None
    measured = readings.magnitudes(offsets_of(readings, readings.scale))
    predicted = np.empty(readings.count)
    for i in range(readings.count):
        others = (readings.level == readings.level[i]) & (readings.group != readings.group[i])
        if not others.any():
            return None
        predicted[i] = measured[others].mean()
    losses = _group_losses(readings, measured - predicted)
    return CrossValidation(predicted, measured - predicted, losses, np.empty((len(losses), 0)))


def root_mean_square(values: FloatArray) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(values**2)))


def _group_losses(readings: FrictionReadings, deviation: FloatArray) -> FloatArray:
    return np.array([root_mean_square((deviation / readings.scale)[inside]) for inside in readings.groups])


def jackknife_errors(estimates: FloatArray) -> FloatArray:
    """Standard error by the jackknife, from ``estimates`` without each group, shape (groups, parameters).

    An error that all readings of a group share (a test, a pressure, a minute) counts once, not once for each reading.

    Source: [Efron1982]_.
    """
    groups = len(estimates)
    return np.asarray(np.sqrt((groups - 1) / groups * np.sum((estimates - estimates.mean(axis=0)) ** 2, axis=0)))


@dataclass(frozen=True, eq=False)
class LawScore:
    """Fit and cross-validation of a law, or the reason why there are none."""

    law: CandidateLaw
    fit: LawFit | None = None
    validation: CrossValidation | None = None
    why_not: str = ''


def score_laws(
    laws: Sequence[CandidateLaw], readings: FrictionReadings, tick: Ticks = lambda _: None
) -> tuple[LawScore, ...]:
    """Fit and cross-validate every law on readings of at least two groups.

    The laws go from simple to complex; results of simpler laws are start values for the others. ``tick`` is called with
    1 after each of the (groups + 1) fits of a law.
    """
    scores: list[LawScore] = []
    known: dict[str, float] = {}
    for law in laws:
        levels, count = len(readings.levels), len(law.parameters)
        needed = count + (readings.left_out_by == 'pressure')
        if not readings.are_samples and levels < needed:
            tick(len(readings.groups) + 1)
            scores.append(LawScore(law, why_not=f'{count} parameters need {needed} pressures, there are {levels}'))
            continue
        try:
            found = fit(law, readings, known)
            tick(1)
            scores.append(LawScore(law, found, cross_validate(law, readings, found.values, tick)))
        except ValueError as error:
            scores.append(LawScore(law, why_not=str(error)))
        else:
            known |= found.values
    return tuple(scores)


def recommended(scores: Sequence[LawScore]) -> LawScore:
    """The simplest law that the best law (smallest mean loss over the groups) does not beat.

    Raises:
        ValueError: No law was fitted.

    Source: after the one-standard-error rule of [Breiman1984]_; the paired t-test in its place is our choice.
    """
    scored = [(score, score.validation.losses) for score in scores if score.validation is not None]
    if not scored:
        reasons = '; '.join(f'{score.law.name}: {score.why_not}' for score in scores)
        raise ValueError(f'no law could be fitted: {reasons}')
    best = min((losses for _, losses in scored), key=np.mean)
    return next(score for score, losses in scored if not is_beaten(losses, best))


def is_beaten(losses: FloatArray, others: FloatArray) -> bool:
    """Whether the losses of another law are lower beyond the noise, and by enough to justify a term.

    Beyond the noise: by a one-sided paired t-test at `BEATEN_CONFIDENCE`. Enough: `WORTHWHILE` of the mean loss.
    Losses are those of each group, shape (groups >= 2,).
    """
    difference = losses - others
    groups = len(difference)
    error = float(difference.std(ddof=1)) / math.sqrt(groups)
    noise = float(student_t.ppf(BEATEN_CONFIDENCE, groups - 1)) * error
    return float(difference.mean()) > max(noise, WORTHWHILE * float(losses.mean()))


class PredictionUncertainty(NamedTuple):
    """Standard deviation of a new reading of all seals: std^2 = (relative f)^2 + absolute^2."""

    relative: float  # [-]
    absolute: float  # [N]

    def std(self, friction: FloatArray) -> FloatArray:
        """Standard deviation [N] at a friction [N], shape (n,)."""
        return np.sqrt((self.relative * friction) ** 2 + self.absolute**2)


def prediction_uncertainty(
    predicted: FloatArray, deviation: FloatArray, groups: int, in_addition: float = 0.0
) -> PredictionUncertainty:
    """Standard deviation of new readings, from the deviations of left-out readings.

    Non-negative least squares of the squared deviations over squared friction and 1, iteratively weighted with the
    resulting variance (ten times), gives the ratio of the two parts. The size is such that 1.96 std holds 95 % of the
    deviations, counted for one more reading [Vovk2005]_. The factor (1 + 1 / groups) on the variance accounts for a new
    group. ``in_addition`` is a relative standard deviation that these data cannot show, added in square. ``deviation``
    is measured - ``predicted`` friction [N], shape (n,).
    """
    friction = np.maximum(np.abs(predicted), 0.05 * float(np.abs(predicted).mean()))
    raw = PredictionUncertainty(0.0, max(root_mean_square(deviation), 1e-12))
    for _ in range(10):
        variance = np.maximum(raw.std(friction) ** 2, 1e-24)
        columns = np.column_stack((friction**2, np.ones_like(friction))) / variance[:, np.newaxis]
        squares, _ = nnls(columns, deviation**2 / variance)
        raw = PredictionUncertainty(*(math.sqrt(value) for value in squares))
    std = np.maximum(raw.std(friction), 1e-12)
    n = len(deviation)
    rank = min(math.ceil(0.95 * (n + 1)), n)
    quantile = float(np.sort(np.abs(deviation) / std)[rank - 1]) / BAND_95
    size = quantile * math.sqrt(1.0 + 1.0 / groups)
    return PredictionUncertainty(math.hypot(raw.relative * size, in_addition), raw.absolute * size)


def band_coverage(
    law: CandidateLaw,
    readings: FrictionReadings,
    near: ParameterValues,
    in_addition: float = 0.0,
    tick: Ticks = lambda _: None,
) -> float:
    """Share of the readings inside a 95 % band that was made without them [-].

    For each group, law and uncertainty come from the other groups alone, the uncertainty by leaving out each of those
    in turn. Two groups are too few for that: the band of all readings is used.
    """
    inside = 0
    for out in readings.groups:
        trained = readings.taken(~out) if len(readings.groups) >= 3 else readings
        inner = cross_validate(law, trained, near, tick)
        band = prediction_uncertainty(inner.predicted, inner.deviation, len(readings.groups) - 1, in_addition)
        _, friction, deviation = _predict(law, trained, readings.taken(out), near)
        inside += int(np.count_nonzero(np.abs(deviation) <= BAND_95 * band.std(friction)))
    return inside / readings.count


class BreakawayFit(NamedTuple):
    """Breakaway force of one seal above its Coulomb friction: stiction + ratio * f_c."""

    law: str  # constant or load_dependent
    stiction: float  # [N] of one seal
    ratio: float  # [-]
    standard_error: float  # of the value that is not zero
    cross_validation_rms: dict[str, float]  # [N] all seals: law -> root mean square of the left-out deviations


def fit_breakaway(readings: FrictionReadings, friction: FloatArray, offsets: FloatArray) -> BreakawayFit:
    """Constant or load-dependent stiction, by cross-validation; the constant one unless it is beaten.

    ``friction`` is the Coulomb friction of the law at each breakaway reading [N]; ``offsets`` are those of the sources.

    Source: thesis, section 5.2 (static above dynamic friction by about 0.5 lbf for each seal); the share of the Coulomb
    friction is our choice, after the rise of the stiction over pressure in Tables A-1 to A-3.
    """
    excess = readings.magnitudes(offsets) - friction
    regressors = {'constant': np.ones(readings.count), 'load_dependent': friction}

    def slope(regressor: FloatArray, inside: BoolArray | slice) -> float:
        """Non-negative least-squares slope of the excess through the origin."""
        x = regressor[inside]
        return max(float(np.sum(x * excess[inside])) / float(np.sum(x**2)), 0.0)

    slopes, losses, rms = {}, {}, {}
    for name, regressor in regressors.items():
        slopes[name] = np.array([slope(regressor, ~out) for out in readings.groups])
        residuals = np.empty(readings.count)
        for out, of_others in zip(readings.groups, slopes[name], strict=True):
            residuals[out] = excess[out] - of_others * regressor[out]
        losses[name], rms[name] = _group_losses(readings, residuals), root_mean_square(residuals)
    best = min(losses.values(), key=np.mean)
    chosen = next(name for name, values in losses.items() if not is_beaten(values, best))
    found, error = slope(regressors[chosen], slice(None)), float(jackknife_errors(slopes[chosen]))
    if chosen == 'load_dependent':
        return BreakawayFit(chosen, 0.0, found, error, rms)
    seals = readings.at.pressure.shape[1]
    return BreakawayFit(chosen, found / seals, 0.0, error / seals, rms)
