"""Fit of a candidate law to friction readings, together with one offset of the force sum for each source."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from scipy.optimize import least_squares, nnls

from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.identification.candidate_laws import (
    CandidateLaw,
    OperatingConditions,
    ParameterValues,
    columns_of,
)
from seal_friction_ros.core.identification.friction_model import (
    ASYMMETRY_PRIOR,
    STRIBECK_PRIOR,
    STRIBECK_SPEED_PRIOR,
    VISCOUS_ASYMMETRY_PRIOR,
    ModelFit,
    Told,
    fit_model,
)
from seal_friction_ros.core.identification.readings import FrictionReadings

DIFFERENCE = 1e-6  # of a parameter of the model, for a derivative
ILL_CONDITIONED = 30.0  # condition number of the scaled Jacobian; after [Belsley1980]_
LINEAR = {'coulomb_friction_at_any_pressure', 'friction_at_no_pressure', 'friction_at_one_bar', 'viscous_friction'}
"""Parameters in which a law is linear, where all its parameters are of them."""


@dataclass(frozen=True, eq=False)
class LawFit:
    """A law fitted to readings."""

    law: CandidateLaw
    values: dict[str, float]  # parameters of one seal
    offsets: FloatArray  # [N] offset of the force sum of each source, shape (sources,)
    jacobian: FloatArray
    """derivative of the weighted deviations by the parameters, offsets eliminated, shape (n, parameters)"""
    model: ModelFit | None = None  # of a law whose terms have a prior

    def friction(self, at: OperatingConditions) -> FloatArray:
        """Magnitude of the friction of all seals [N], shape (n,)."""
        return self.law.friction(at, self.values)

    @property
    def condition_number(self) -> float:
        """Condition number of the Jacobian with columns of unit length; infinite if a parameter has no effect."""
        lengths = np.linalg.norm(self.jacobian, axis=0)
        return float(np.linalg.cond(self.jacobian / lengths)) if np.all(lengths > 0.0) else math.inf

    @property
    def why_unsound(self) -> str:
        """Why the parameters should not be believed: at a bound, or ill-conditioned; '' if they are sound.

        A lower bound of 0 is a term that the data do not show, which is sound.
        """
        if self.model is not None:
            return ''
        for parameter in self.law.parameters:
            value, margin = self.values[parameter.name], 1e-6 * (parameter.upper - parameter.lower)
            if value > parameter.upper - margin or (parameter.lower != 0.0 and value < parameter.lower + margin):
                return f'{parameter.name} is at its bound of {value:.3g}'
        if not self.condition_number <= ILL_CONDITIONED:
            return f'ill-conditioned: condition number {self.condition_number:.0f} (good below {ILL_CONDITIONED:.0f})'
        return ''

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
    return _means_of_sources(readings, readings.force - readings.at.direction * friction)


def _means_of_sources(readings: FrictionReadings, force: FloatArray) -> FloatArray:
    """Weighted mean of a ``force`` [N], shape (n,), over each source, shape (sources,); 0 N as in `offsets_of`."""
    means = [np.sum(force[index] * share) for index, share in zip(readings.two_sided, readings.shares, strict=True)]
    return np.array(means)


def fit(law: CandidateLaw, readings: FrictionReadings, start_values: ParameterValues | None = None) -> LawFit:
    """Least-squares fit of a law, with one offset of the force sum for each source.

    The offsets are linear and are eliminated. ``start_values`` are those of a simpler law or of similar readings.
    ValueError: the result is not finite.
    """
    if law.has_prior:
        return _fit_with_prior(law, readings)
    if LINEAR.issuperset(parameter.name for parameter in law.parameters):
        return _fit_linear(law, readings)
    lower, upper = np.array([(p.lower, p.upper) for p in law.parameters]).T

    def residuals(vector: FloatArray) -> FloatArray:
        friction = law.friction(readings.at, law.named(vector))
        return np.asarray((readings.magnitudes(offsets_of(readings, friction)) - friction) / readings.scale)

    mean_friction = float(np.abs(readings.force).mean() / readings.at.pressure.shape[1])  # [N] of one seal
    first_guess = law.first_guess(readings.at, mean_friction)
    start = first_guess | {name: value for name, value in (start_values or {}).items() if name in first_guess}
    inside = np.clip(list(start.values()), lower, upper)
    size = np.maximum(np.abs(inside), 1e-3 * np.minimum(upper, 1.0))
    best = least_squares(residuals, inside, bounds=(lower, upper), x_scale=size, xtol=1e-9, ftol=1e-9, gtol=1e-9)
    if not np.isfinite(best.x).all():
        raise ValueError(f'{law.name}: the result of the fit is not finite')
    at_zero = (lower == 0.0) & (np.abs(best.x) < 1e-6 * np.abs(list(first_guess.values())))
    values = law.named(np.where(at_zero, 0.0, best.x))  # exactly 0 for a term without effect, instead of about 1e-18
    return LawFit(law, values, offsets_of(readings, law.friction(readings.at, values)), np.asarray(best.jac))


@lru_cache(maxsize=2)
def _fit_with_prior(law: CandidateLaw, readings: FrictionReadings) -> LawFit:
    """As `fit`, for a law of all terms: the most probable one, kept for who leaves groups out next."""
    model = model_of(law, readings)
    values = values_of_model(law, model, readings.at.pressure.shape[1])
    return LawFit(law, values, model.offsets, slopes(law, values, readings.at) / readings.scale[:, np.newaxis], model)


def model_of(law: CandidateLaw, readings: FrictionReadings, *, drift: bool = False) -> ModelFit:
    """The model of a law of all terms, with a ``drift`` over the way of each source if it is asked for."""
    terms = law.velocity_terms
    told = Told('viscous_friction' in terms, 'stribeck_friction' in terms, 'asymmetry' in terms, False, drift)
    columns = [columns_of(law.kinds, number) for number in range(len(law.kinds))]
    return fit_model(readings, columns or [slice(None)] * law.depends_on_pressure, told)


def values_of_model(law: CandidateLaw, model: ModelFit, seals: int) -> dict[str, float]:
    """Parameters of the law of all terms: of one seal, or of all seals of several kinds and the shares of the kinds."""
    falling, speed = model.stribeck
    of = 1 if law.kinds else seals
    values = {
        'coulomb_friction_at_any_pressure': model.constant / of,
        'friction_at_no_pressure': model.constant / of,
        'viscous_friction': model.viscous / of,
        'stribeck_friction': falling / of,
        'stribeck_velocity': speed,
        'asymmetry': model.asymmetry,
        'stribeck_ratio': model.stribeck_ratio,
        'viscous_asymmetry': model.viscous_asymmetry,
    }
    names = [f'{kind.name}.' for kind in law.kinds] or ['']
    for name, rise, exponent in zip(names, model.rises.tolist(), model.exponents, strict=False):
        values |= {f'{name}friction_at_one_bar': rise, f'{name}pressure_exponent': exponent}
    shares = zip(names, model.division.tolist(), strict=False) if law.kinds else ()
    return {p.name: values[p.name] for p in law.parameters} | {f'{name}share': share for name, share in shares}


def covariance_of_terms(
    found: LawFit, seals: int, terms: Callable[[ParameterValues], Sequence[float]]
) -> FloatArray | None:
    """Covariance of numbers that follow from the parameters, by the posterior of a law with priors; None for others.

    ``terms`` gives the numbers; by their differences, to first order.
    """
    model = found.model
    if model is None:
        return None
    base, columns = np.array(terms(values_of_model(found.law, model, seals))), []
    for index in range(len(model.vector)):
        vector = model.vector.copy()
        vector[index] += DIFFERENCE
        moved = values_of_model(found.law, replace(model, vector=vector), seals)
        columns.append((np.array(terms(moved)) - base) / DIFFERENCE)
    slopes = np.column_stack(columns)
    return np.asarray(slopes @ model.covariance @ slopes.T)


def std_of_none(law: CandidateLaw, model: ModelFit, seals: int) -> dict[str, float]:
    """Prior standard deviation of each velocity term that is less probable than none, as of `values_of_model`."""
    layout, of = model.layout, 1 if law.kinds else seals
    priors = {
        'stribeck_ratio': (layout.viscous + 1, STRIBECK_PRIOR[1]),
        'stribeck_friction': (layout.viscous + 2, STRIBECK_PRIOR[1] * model.size / of),
        'asymmetry': (layout.asymmetry, ASYMMETRY_PRIOR[1]),
        'viscous_asymmetry': (layout.asymmetry + 1, VISCOUS_ASYMMETRY_PRIOR[1]),
    }
    found = {name: std for name, (index, std) in priors.items() if name in law.velocity_terms and not model.told[index]}
    if {'stribeck_ratio', 'stribeck_friction'} <= set(found):
        found['stribeck_velocity'] = STRIBECK_SPEED_PRIOR[1] * model.stribeck[1]
    return found


def slopes(law: CandidateLaw, values: ParameterValues, at: OperatingConditions) -> FloatArray:
    """Derivative of the friction of all seals [N] by each parameter, by differences, shape (n, parameters)."""
    base, columns = law.friction(at, values), []
    for parameter in law.parameters:
        value = values[parameter.name]
        step = 1e-4 * (abs(value) or 1.0)
        step = step if value + step <= parameter.upper else -step
        columns.append((law.friction(at, {**values, parameter.name: value + step}) - base) / step)
    return np.column_stack(columns)


def _fit_linear(law: CandidateLaw, readings: FrictionReadings) -> LawFit:
    """As `fit`, for a law that is linear in its parameters, none of them negative [LawsonHanson1974]_."""

    def without_offset(friction: FloatArray) -> FloatArray:
        means = _means_of_sources(readings, readings.at.direction * friction)
        return np.asarray((friction - readings.at.direction * means[readings.source]) / readings.scale)

    units = np.eye(len(law.parameters))
    columns = np.column_stack([without_offset(law.friction(readings.at, law.named(unit))) for unit in units])
    measured = without_offset(readings.at.direction * readings.force)
    lengths = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    solution = nnls(columns / lengths, measured)[0] / lengths
    values = law.named(solution)
    return LawFit(law, values, offsets_of(readings, law.friction(readings.at, values)), columns)


def root_mean_square(values: FloatArray) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(values**2)))
