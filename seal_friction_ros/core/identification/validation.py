"""Cross-validation of laws, and the uncertainty of a new reading.

Each group of readings is predicted by the law fitted to all others. The computation uses no random numbers: the same
readings give the same result.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, cast

import numpy as np
from scipy.optimize import nnls

from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.foundation.normal_distribution import BAND_95
from seal_friction_ros.core.identification import friction_model
from seal_friction_ros.core.identification.candidate_laws import CandidateLaw, OperatingConditions, ParameterValues
from seal_friction_ros.core.identification.fitting import (
    LawFit,
    covariance_of_terms,
    fit,
    offsets_of,
    root_mean_square,
    values_of_model,
)
from seal_friction_ros.core.identification.friction_model import ModelFit
from seal_friction_ros.core.identification.readings import FrictionReadings

Ticks = Callable[[int], None]
# The band of a law with priors holds between these shares of the slowest and the fastest speed driven (our choice).
SLOWER, FASTER = 0.7, 1.5  # [-]
SPEEDS = 6  # at which it is computed,
MOST_CONDITIONS = 200  # at the pressures of so many readings


@dataclass(frozen=True, eq=False)
class CrossValidation:
    """Prediction of each group of readings from all others."""

    predicted: FloatArray  # [N] shape (n,)
    deviation: FloatArray  # [N] measured - predicted, shape (n,)
    losses: FloatArray  # root mean square of the weighted deviation in each group [-], shape (groups,)
    values: tuple[ParameterValues, ...]  # parameters that were fitted without each group

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
    if law.has_prior:
        return _left_out_of_model(law, readings)
    predicted, deviation = np.empty(readings.count), np.empty(readings.count)
    each = []
    for out, (others, left_out) in zip(readings.groups, readings.splits, strict=True):
        values, predicted[out], deviation[out] = predict(law, others, left_out, near)
        each.append(values)
        tick(1)
    return CrossValidation(predicted, deviation, group_losses(readings, deviation), tuple(each))


def model_with_priors(law: CandidateLaw, readings: FrictionReadings) -> ModelFit:
    """The model behind the fit of a law with priors."""
    return cast(ModelFit, fit(law, readings).model)


def _left_out_of_model(law: CandidateLaw, readings: FrictionReadings) -> CrossValidation:
    model = model_with_priors(law, readings)
    predicted, deviation, vectors = friction_model.left_out(model, readings)
    seals = readings.at.pressure.shape[1]
    values = tuple(values_of_model(law, replace(model, vector=vector), seals) for vector in vectors)
    return CrossValidation(predicted, deviation, group_losses(readings, deviation), values)


def predict(
    law: CandidateLaw, trained: FrictionReadings, tested: FrictionReadings, near: ParameterValues
) -> tuple[ParameterValues, FloatArray, FloatArray]:
    """Law fitted to ``trained``: parameters, friction of ``tested``, and measured less predicted friction [N].

    The offset of a source comes from ``trained``. A source that is not in ``trained`` gets its offset from its own
    readings in both directions, in which the friction cancels.
    """
    found = fit(law, trained, near)
    friction = found.friction(tested.at)
    signed = tested.force - tested.at.direction * friction
    offsets = tested.offsets_with_own(found.offsets, signed, trained.source)
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
    losses = group_losses(readings, measured - predicted)
    return CrossValidation(predicted, measured - predicted, losses, ())


def group_losses(readings: FrictionReadings, deviation: FloatArray) -> FloatArray:
    """Root mean square of the weighted ``deviation`` [N], shape (n,), in each group; shape (groups,)."""
    return np.array([root_mean_square((deviation / readings.scale)[inside]) for inside in readings.groups])


def jackknife_errors(estimates: FloatArray) -> FloatArray:
    """Standard error by the jackknife; argument and source as of `jackknife_covariance`."""
    return np.asarray(np.sqrt(np.diag(jackknife_covariance(estimates))))


def jackknife_covariance(estimates: FloatArray) -> FloatArray:
    """Covariance by the jackknife, shape (parameters, parameters), from ``estimates``, shape (groups, parameters).

    An error that all readings of a group share (a test, a pressure, a minute) counts once, not once for each reading.

    Source: [Efron1982]_.
    """
    groups, off = len(estimates), estimates - estimates.mean(axis=0)
    return np.asarray((groups - 1) / groups * off.T @ off)


def covariance_of(
    found: LawFit, left_out: CrossValidation, seals: int, terms: Callable[[ParameterValues], Sequence[float]]
) -> FloatArray:
    """Covariance of numbers that follow from the parameters of a law: by its posterior, else by the jackknife."""
    by_posterior = covariance_of_terms(found, seals, terms)
    if by_posterior is not None:
        return by_posterior
    return jackknife_covariance(np.array([terms(each) for each in left_out.values]))


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
    raw = _two_parts(friction, deviation**2)
    std = np.maximum(raw.std(friction), 1e-12)
    n = len(deviation)
    rank = min(math.ceil(0.95 * (n + 1)), n)
    quantile = float(np.sort(np.abs(deviation) / std)[rank - 1]) / BAND_95
    size = quantile * math.sqrt(1.0 + 1.0 / groups)
    return PredictionUncertainty(math.hypot(raw.relative * size, in_addition), raw.absolute * size)


def _two_parts(friction: FloatArray, squares: FloatArray) -> PredictionUncertainty:
    """Uncertainty whose squares are nearest to ``squares`` [N^2] at a friction [N], shape (n,) each."""
    found = PredictionUncertainty(0.0, max(math.sqrt(float(squares.mean())), 1e-12))
    for _ in range(10):
        variance = np.maximum(found.std(friction) ** 2, 1e-24)
        columns = np.column_stack((friction**2, np.ones_like(friction))) / variance[:, np.newaxis]
        found = PredictionUncertainty(*np.sqrt(nnls(columns, squares / variance)[0]).tolist())
    return found


def model_uncertainty(model: ModelFit, readings: FrictionReadings, in_addition: float) -> PredictionUncertainty:
    r"""Standard deviation of the friction by a model with priors, which its readings were fitted by.

    .. math:: \sigma^2 = \sigma_m^2 + (q\,F)^2\,(N / (N - k) - \overline{n^2} / \overline{r^2})

    with the standard deviation :math:`\sigma_m` of the posterior (`ModelFit.std`) at the pressures of the readings and
    `SLOWER` to `FASTER` times their speeds, and what the model misses: the quantile q that holds 95 % of the rest r of
    the readings, over the mean friction F of their pressure, without the noise n of their sensors, which is none of
    the friction; N readings, k terms fitted. ``in_addition``, as of `prediction_uncertainty`,
    is added in square. Our choice.
    """
    readings = readings.as_means
    friction = model.friction(readings.at)
    rest = readings.magnitudes(model.offsets) - friction
    fitted = 0 if readings.are_samples else int(model.told.sum())
    squares = float(np.mean(rest**2)) * readings.count / max(readings.count - fitted, 1)
    noise = float(np.mean(readings.noise(readings.at.direction * rest) ** 2))
    quantile = float(np.quantile(np.abs(rest) / readings.scale, 0.95)) / BAND_95
    missed = quantile**2 * max(squares - noise, 0.0) / max(float(np.mean(rest**2)), 1e-24)
    some = np.unique(np.linspace(0, readings.count - 1, min(readings.count, MOST_CONDITIONS)).round().astype(np.int64))
    at, scale = readings.at.taken(some), readings.scale[some]
    speed = np.abs(readings.at.velocity)
    if np.isfinite(speed).all() and speed.min() > 0.0:
        speeds = np.geomspace(SLOWER * float(speed.min()), FASTER * float(speed.max()), SPEEDS)
        at = OperatingConditions(*(np.concatenate([column] * SPEEDS) for column in at))
        at, scale = at._replace(velocity=at.direction * np.repeat(speeds, len(some))), np.tile(scale, SPEEDS)
    relative, absolute = _two_parts(model.friction(at), model.std(at) ** 2 + missed * scale**2)
    return PredictionUncertainty(math.hypot(relative, in_addition), absolute)


def deviations_in_std(
    law: CandidateLaw,
    trained: FrictionReadings,
    tested: FrictionReadings,
    near: ParameterValues,
    in_addition: float = 0.0,
    tick: Ticks = lambda _: None,
) -> FloatArray:
    """Deviations of ``tested`` over the standard deviation of a band that is made from ``trained`` alone [-], (n,).

    The band comes from the groups of ``trained``, each left out in turn; that of a law with priors from its posterior.
    That is one of the friction, so the noise of the sensors is added for ``tested``. ``in_addition`` is as of
    `prediction_uncertainty`.
    """
    if law.has_prior:
        tested = tested.as_means
        _, friction, deviation = predict(law, trained, tested, near)
        band = model_uncertainty(model_with_priors(law, trained), trained, in_addition)
        return _with_noise(deviation, band.std(friction), tested)
    _, friction, deviation = predict(law, trained, tested, near)
    inner = cross_validate(law, trained, near, tick)
    band = prediction_uncertainty(inner.predicted, inner.deviation, len(trained.groups), in_addition)
    return np.asarray(np.abs(deviation) / np.maximum(band.std(friction), 1e-12))


def _with_noise(deviation: FloatArray, std: FloatArray, readings: FrictionReadings) -> FloatArray:
    """Deviations of readings over the standard deviation of the friction and the noise of their sensors [-], (n,)."""
    noise = readings.noise(readings.at.direction * deviation)
    return np.asarray(np.abs(deviation) / np.maximum(np.hypot(std, noise), 1e-12))


def deviations_of_left_out(
    law: CandidateLaw, readings: FrictionReadings, near: ParameterValues, tick: Ticks = lambda _: None
) -> FloatArray:
    """Deviations of each group over the standard deviation of a band that was made without it [-], shape (n,).

    For each group, law and uncertainty come from the other groups alone, the uncertainty by leaving out each of those
    in turn. Two groups are too few for that: the band of all readings is used. The terms of a law with priors are those
    that all readings show, and the noise of the sensors, from neighbours among the readings, is added to its band.
    """
    ratios = np.empty(readings.count)
    if law.has_prior:
        model, std = model_with_priors(law, readings), np.empty(readings.count)
        friction, deviation, _ = friction_model.left_out(model, readings.as_means)
        for out in readings.groups:
            others = friction_model.without_group(model, out)
            std[out] = model_uncertainty(others, readings.taken(~out), 0.0).std(friction[out])
        return _with_noise(deviation, std, readings)
    for out in readings.groups:
        trained = readings.taken(~out) if len(readings.groups) >= 3 else readings
        ratios[out] = deviations_in_std(law, trained, readings.taken(out), near, tick=tick)
    return ratios


def band_coverage(
    law: CandidateLaw, readings: FrictionReadings, near: ParameterValues, tick: Ticks = lambda _: None
) -> float:
    """Share of the readings inside a 95 % band that was made without them [-], as of `deviations_of_left_out`."""
    return float(np.mean(deviations_of_left_out(law, readings, near, tick) <= BAND_95))
