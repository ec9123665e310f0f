r"""One model of the friction for one kind of seals or several: the batch solution of the filter of the estimate.

.. math:: y = d\,(1 + a\,d)\,\Big[f_0 + \sum_k K_k \sum_j (P_{kj}/1\,\mathrm{bar})^{m_k} + \sigma\,|v|
          + f_S\,e^{-|v|/v_S}\Big] + b_s + \Delta A_a\,p_a + \Delta A_b\,p_b + e

with the pressure :math:`P_{kj}` that seal j of kind k sees, an offset of each source and errors of the areas in the
force sum. Every term has a prior, so a term that the data do not excite stays where its prior has it, and what cannot
be told apart stays in the covariance of the posterior: laws are averaged, none is chosen. The error e has a part that
all readings of a cluster share (a stroke of a swept log, a held pressure), so that many samples of few strokes do not
count as many readings.

Source: maximum a posteriori with the covariance of Laplace, [Gelman2013]_ chapter 4. Model and priors are our choice.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import NamedTuple

import numpy as np

from seal_friction_ros.core.foundation.arrays import BoolArray, FloatArray, IntArray
from seal_friction_ros.core.foundation.units import BAR
from seal_friction_ros.core.identification.candidate_laws import OperatingConditions
from seal_friction_ros.core.identification.readings import FrictionReadings, numbered

# Priors: mean, standard deviation, lower and upper bound. A share is one of the mean friction.
FRICTION_PRIOR = (0.0, 10.0, 0.0, 100.0)  # [-] share: f_0, and the rise of each kind at its mean pressure
EXPONENT_PRIOR = (1.0, 0.3, 0.3, 2.5)  # [-] m: an elastic contact has 2/3, lip seals up to 3/2
VISCOUS_PRIOR = (0.0, 1.0, 0.0, 100.0)  # [-] share at the mean speed
STRIBECK_PRIOR = (0.0, 0.3, 0.0, 10.0)  # [-] share
STRIBECK_SPEED_PRIOR = (math.log(0.3), 1.0, math.log(0.01), math.log(3.0))  # ln of v_S over the mean speed
ASYMMETRY_PRIOR = (0.0, 0.08, -0.9, 0.9)  # [-]
AREA_PRIOR = (0.0, 5.0, -100.0, 100.0)  # [-] share at the highest pressure of the chamber
OFFSET_PRIOR = (0.0, 1e3, -1e9, 1e9)  # [-] share
NOT_TOLD = (0.0, 1e-6, -1e-5, 1e-5)  # of a term that readings do not tell: it stays 0
OPTIONAL = ('stribeck', 'asymmetry', 'areas')  # terms of `Told` that stay out unless they are more probable
LOG_ODDS = math.log(2.0)  # [-] of an optional term to be absent, before the readings are seen (our choice)
CLUSTER_PRIOR = 0.03  # [-] standard deviation of the friction between clusters, expected
CLUSTER_FREEDOM = 1.0  # with this weight
NOTHING = 1e-6  # [-] share that counts as 0
MOST_STEPS = 100  # of a fit
CONVERGED = 1e-9  # [-] change of the cost that ends it


class Told(NamedTuple):
    """Terms that the readings can tell."""

    viscous: bool
    stribeck: bool
    asymmetry: bool
    areas: bool


class _Layout(NamedTuple):
    """Where the parameters stand in a vector: first what friction is linear in, f_0, rises, viscous, Stribeck."""

    linear: slice
    exponents: slice
    speed: int  # ln v_S
    asymmetry: int
    areas: slice
    offsets: slice


def _layout(kinds: int) -> _Layout:
    first = kinds + 3
    exponents, speed = slice(first, first + kinds), first + kinds
    return _Layout(slice(first), exponents, speed, speed + 1, slice(speed + 2, speed + 4), slice(speed + 4, None))


Columns = tuple[int, ...] | slice


class Problem(NamedTuple):
    """Readings in the form of the fit."""

    readings: FrictionReadings
    columns: tuple[Columns, ...]  # seals of each kind
    size: float  # [N] mean friction
    speed: float  # [m/s] mean
    highest: FloatArray  # [Pa] pressure of chambers a and b, shape (2,)
    free: FloatArray  # columns of areas and offsets [N], shape (n, 2 + sources)
    prior: FloatArray  # mean, standard deviation, lower and upper bound of each parameter, shape (count, 4)
    sources: IntArray  # that have an offset


@dataclass(frozen=True, eq=False)
class ModelFit:
    """The model fitted to readings."""

    problem: Problem
    vector: FloatArray  # f_0, rises, viscous, Stribeck [share]; m, ln v_S, a; areas, offsets [share]
    covariance: FloatArray  # of the vector
    rows: FloatArray  # weighted derivatives of what is left of each reading, shape (n, parameters)
    left: FloatArray  # weighted rest of each reading, shape (n,)
    scatter: float  # [-] standard deviation of one more reading, or one more stroke of a swept log, from the model

    @property
    def told(self) -> BoolArray:
        """Which parameters of the friction readings tell, shape (parameters,); the others are 0."""
        return np.asarray(self.problem.prior[: self.layout.asymmetry + 1, 1] > NOT_TOLD[1])

    @property
    def columns(self) -> tuple[Columns, ...]:
        """Seals of each kind, as columns of the pressures."""
        return self.problem.columns

    @property
    def size(self) -> float:
        """Mean friction of the readings [N]."""
        return self.problem.size

    @property
    def layout(self) -> '_Layout':
        """Where the parameters stand in the vector."""
        return _layout(len(self.columns))

    @property
    def constant(self) -> float:
        """f_0 [N] of all seals."""
        return float(self.vector[0]) * self.size

    @property
    def parts(self) -> FloatArray:
        """Mean friction that rises with the pressure, of each kind [N], shape (kinds,)."""
        return np.asarray(self.vector[1 : 1 + len(self.columns)] * self.size)

    @property
    def division(self) -> FloatArray:
        """Share of each kind in the friction that no pressure divides [-], shape (kinds,): that of the rising parts.

        A seal that is pressed harder at no pressure gains more by pressure, too: our choice. Without any rise, each
        seal has the same.
        """
        pressure = self.problem.readings.at.pressure
        seals = np.array([float(pressure[:, each].shape[1]) for each in self.columns])
        parts = self.parts if self.parts.sum() > 0.0 else seals
        return np.asarray(parts / parts.sum())

    @property
    def areas(self) -> FloatArray:
        """Error of the areas of chambers a and b in the force sum [m^2], shape (2,)."""
        return np.asarray(self.vector[self.layout.areas] * self.size / self.problem.highest)

    @property
    def offsets(self) -> FloatArray:
        """Offset of the force sum of each source [N], shape (sources,)."""
        found = np.zeros(len(self.problem.readings.names))
        found[self.problem.sources] = self.vector[self.layout.offsets] * self.size
        return found

    @property
    def exponents(self) -> tuple[float, ...]:
        """Exponent m of each kind."""
        return tuple(self.vector[self.layout.exponents].tolist())

    @property
    def rises(self) -> FloatArray:
        """K of one seal of each kind at 1 bar [N], shape (kinds,)."""
        means = [total for total, _ in _means(self.problem, self.exponents)]
        return np.asarray(self.parts / np.maximum(means, 1e-300))

    @property
    def viscous(self) -> float:
        """Viscous friction of all seals [N s/m]."""
        return float(self.vector[len(self.columns) + 1]) * self.size / self.problem.speed

    @property
    def stribeck(self) -> tuple[float, float]:
        """Stribeck friction of all seals [N] and its speed [m/s]."""
        speed = self.problem.speed * math.exp(self.vector[self.layout.speed])
        return float(self.vector[len(self.columns) + 2]) * self.size, speed

    @property
    def asymmetry(self) -> float:
        """Share a by which friction is larger on extension."""
        return float(self.vector[self.layout.asymmetry])

    @property
    def errors(self) -> FloatArray:
        """Standard error of `parts` [N], shape (kinds,)."""
        return np.asarray(np.sqrt(np.diag(self.covariance)[1 : 1 + len(self.columns)]) * self.size)

    def friction(self, at: OperatingConditions) -> FloatArray:
        """Magnitude of the friction of all seals [N], shape (n,)."""
        return _magnitude(self.problem, self.vector, at)[0]

    def slopes(self, at: OperatingConditions) -> FloatArray:
        """Derivative of the friction [N] by each of its parameters, shape (n, parameters)."""
        return _magnitude(self.problem, self.vector, at)[1]

    def std(self, at: OperatingConditions) -> FloatArray:
        """Standard deviation of the friction [N], shape (n,), by the covariance of the posterior."""
        slopes = self.slopes(at)
        known = slopes.shape[1]
        return np.asarray(np.sqrt(np.einsum('ni,ij,nj->n', slopes, self.covariance[:known, :known], slopes)))


def _power_sum(at: OperatingConditions, columns: Columns, m: float) -> tuple[FloatArray, FloatArray]:
    """Sum over seals of (P / 1 bar)^m, and its derivative by m, shape (n,) each."""
    pressure = np.maximum(at.pressure[:, columns] / BAR, 1e-9)
    powers = pressure**m
    return powers.sum(axis=1), (powers * np.log(pressure)).sum(axis=1)


def _means(problem: Problem, exponents: Sequence[float] | FloatArray) -> list[tuple[float, float]]:
    """Means of `_power_sum` over the fitted readings, of each kind."""
    each = [_power_sum(problem.readings.at, c, float(m)) for c, m in zip(problem.columns, exponents, strict=True)]
    return [(float(total.mean()), float(slope.mean())) for total, slope in each]


def _magnitude(problem: Problem, vector: FloatArray, at: OperatingConditions) -> tuple[FloatArray, FloatArray]:
    """Friction [N], shape (n,), and its derivatives by the parameters of the friction, shape (n, parameters)."""
    layout, size, columns = _layout(len(problem.columns)), problem.size, problem.columns
    means, typical = _means(problem, vector[layout.exponents]), problem.speed
    speed, direction = np.nan_to_num(np.abs(at.velocity)) / typical, at.direction
    falling = math.exp(-vector[layout.speed]) * speed
    rising, bending = [], []
    for kind, (chosen, (mean, slope)) in enumerate(zip(columns, means, strict=True)):
        powers, slopes = _power_sum(at, chosen, float(vector[layout.exponents][kind]))
        rising.append(powers / max(mean, 1e-300))
        bending.append(vector[1 + kind] * (slopes - rising[-1] * slope) / max(mean, 1e-300))
    linear = np.column_stack((np.ones(len(speed)), *rising, speed, np.exp(-falling)))
    symmetric = linear @ vector[layout.linear]
    by_speed = vector[len(columns) + 2] * np.exp(-falling) * falling
    side = (1.0 + vector[layout.asymmetry] * direction)[:, np.newaxis]
    slopes = np.column_stack((side * np.column_stack((linear, *bending, by_speed)), direction * symmetric))
    return size * side[:, 0] * symmetric, size * slopes


def _problem(readings: FrictionReadings, columns: Sequence[Columns], told: Told) -> Problem:
    two_sided = np.array([s for s, index in enumerate(readings.two_sided) if len(index)], dtype=np.int64)
    size = max(float(np.abs(readings.magnitudes(readings.offsets)).mean()), 1e-12)
    speed = max(float(np.nan_to_num(np.abs(readings.at.velocity)).mean()), 1e-9)
    highest, both = np.ones(2), np.zeros((readings.count, 2))
    if told.areas:
        highest = np.maximum(np.abs(readings.chamber_pressures).max(axis=0), 1.0)
        both = readings.chamber_pressures / highest
    free = size * np.column_stack((both, readings.source[:, np.newaxis] == two_sided))
    prior = [FRICTION_PRIOR] * (1 + len(columns))
    prior += [VISCOUS_PRIOR if told.viscous else NOT_TOLD, STRIBECK_PRIOR if told.stribeck else NOT_TOLD]
    prior += [EXPONENT_PRIOR] * len(columns)
    prior += [STRIBECK_SPEED_PRIOR, ASYMMETRY_PRIOR if told.asymmetry else NOT_TOLD]
    prior += [AREA_PRIOR if told.areas else NOT_TOLD] * 2 + [OFFSET_PRIOR] * len(two_sided)
    table = np.array(prior)
    return Problem(readings, tuple(columns), size, speed, highest, free, table, two_sided)


def _solved(problem: Problem, weight: FloatArray, start: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Vector, and weighted Jacobian and rest with the rows of the prior: Levenberg and Marquardt within bounds."""
    readings, prior = problem.readings, problem.prior
    at, direction = readings.at, readings.at.direction[:, np.newaxis]
    known = _layout(len(problem.columns)).asymmetry + 1

    def both(vector: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Weighted rest and Jacobian at a vector, the rows of the prior last."""
        friction, slopes = _magnitude(problem, vector, at)
        rest = readings.force - direction[:, 0] * friction - problem.free @ vector[known:]
        jacobian = -np.column_stack((direction * slopes, problem.free)) * weight[:, np.newaxis]
        ahead = (vector - prior[:, 0]) / prior[:, 1]
        return np.concatenate((rest * weight, ahead)), np.vstack((jacobian, np.diag(1.0 / prior[:, 1])))

    low, high = prior[:, 2], prior[:, 3]
    vector = np.clip(start, low, high)
    rest, jacobian = both(vector)
    damping = 1e-3
    for _ in range(MOST_STEPS):
        gradient, normal = jacobian.T @ rest, jacobian.T @ jacobian
        free = np.flatnonzero(~((vector <= low) & (gradient > 0.0)) & ~((vector >= high) & (gradient < 0.0)))
        damped = normal[np.ix_(free, free)] + damping * np.diag(np.diag(normal)[free])
        tried = vector.copy()
        tried[free] = np.clip(vector[free] - np.linalg.solve(damped, gradient[free]), low[free], high[free])
        gain = float(rest @ rest)
        other, slopes = both(tried)
        gain -= float(other @ other)
        damping *= 0.2 if gain > 0.0 else 5.0
        if gain > 0.0:
            vector, rest, jacobian = tried, other, slopes
        if abs(gain) <= CONVERGED * float(rest @ rest):
            break
    vector = np.where(np.abs(vector) < NOTHING, 0.0, vector)
    rest, jacobian = both(vector)
    return vector, jacobian, rest


def _clusters(readings: FrictionReadings) -> IntArray:
    """Number of the cluster of each reading: a stroke of a swept log, or a pressure that a source held."""
    if readings.are_samples:
        turns = np.diff(readings.at.direction) != 0.0
        return np.concatenate(([0], np.cumsum(turns | (np.diff(readings.source) != 0))))
    return numbered(readings.source, readings.level)


def _weights(
    readings: FrictionReadings, residual: FloatArray, size: float, fitted: float, least: float = 0.0
) -> tuple[FloatArray, float]:
    """Weight of each reading [1/N], and the scatter of one more reading or stroke [-].

    ``residual`` is that of the magnitudes [N], shape (n,), after a fit of ``fitted`` effective parameters. The variance
    of a reading is that within a cluster, and as many times that between clusters as the cluster has readings. The
    latter is the geometric mean of that found, with its degrees of freedom, and of the prior (our choice), but at
    ``least`` that standard deviation.
    """
    cluster = _clusters(readings)
    share = residual / np.maximum(readings.scale, 1e-3 * size)
    count = np.bincount(cluster)
    mean = np.bincount(cluster, share) / count
    within = float(np.sum((share - mean[cluster]) ** 2)) / max(len(share) - len(count), 1)
    freedom = max(len(count) - fitted, 0.0)
    found = max(float(np.sum(mean**2 - within / count)), 0.0) / max(freedom, 1.0)
    of_prior = CLUSTER_FREEDOM / (CLUSTER_FREEDOM + freedom)
    between = max(found, 1e-8) ** (1.0 - of_prior) * CLUSTER_PRIOR ** (2.0 * of_prior)
    between = max(between, least**2)
    variance = within + count[cluster] * between
    scatter = math.sqrt(within / (float(count.mean()) if readings.are_samples else 1.0) + between)
    return np.asarray(1.0 / (np.maximum(readings.scale, 1e-3 * size) * np.sqrt(variance))), scatter


def fit_model(readings: FrictionReadings, columns: Sequence[Columns], told: Told) -> ModelFit:
    """Most probable parameters and their covariance, with those of the `OPTIONAL` terms that are more probable.

    The ``columns`` of the pressures are the seals of each kind; none for a friction without pressure. Terms that are
    not ``told`` are 0.
    """
    problem = _problem(readings, columns, told)
    vector = _start(problem)
    scatter = CLUSTER_PRIOR
    weight = 1.0 / (np.maximum(readings.scale, 1e-3 * problem.size) * scatter)
    for _ in range(2):
        vector, jacobian, left = _solved(problem, weight, vector)
        fit = _model_fit(problem, vector, jacobian, left, scatter)
        free = problem.free @ vector[fit.layout.asymmetry + 1 :]
        residual = readings.at.direction * (readings.force - free) - fit.friction(readings.at)
        fitted = len(vector) - float(np.sum(np.diag(fit.covariance) / problem.prior[:, 1] ** 2))
        weight, scatter = _weights(readings, residual, problem.size, fitted)
    # An area must not explain what strokes and pressures usually differ by.
    unsure = _weights(readings, residual, problem.size, fitted, CLUSTER_PRIOR if told.areas else 0.0)[0]
    optional = [sorted({getattr(told, name), False}) for name in OPTIONAL]
    choices = [told._replace(**dict(zip(OPTIONAL, one, strict=True))) for one in product(*optional)]
    odds = [
        _log_evidence(_problem(readings, columns, one), unsure, vector)
        - LOG_ODDS * sum(getattr(one, name) for name in OPTIONAL)
        for one in choices
    ]
    problem = _problem(readings, columns, choices[int(np.argmax(odds))])
    vector, jacobian, left = _solved(problem, weight, vector)
    return _model_fit(problem, vector, jacobian, left, scatter)


def without_group(fit: ModelFit, out: BoolArray) -> ModelFit:
    """The fit to all readings but those ``out``, by one step of Newton, which is exact where the model is linear.

    Parameters at a bound stay there.
    """
    low, high = fit.problem.prior[:, 2], fit.problem.prior[:, 3]
    margin = 1e-6 * (high - low)
    free = np.flatnonzero((fit.vector > low + margin) & (fit.vector < high - margin))
    rows = fit.rows[out][:, free]
    everything = np.linalg.pinv(fit.covariance, hermitian=True)[np.ix_(free, free)]
    step = np.linalg.lstsq(everything - rows.T @ rows, rows.T @ fit.left[out], rcond=1e-14)[0]
    vector = fit.vector.copy()
    vector[free] += step
    vector[fit.layout.linear] = np.maximum(vector[fit.layout.linear], 0.0)
    vector[fit.layout.exponents] = np.clip(vector[fit.layout.exponents], *EXPONENT_PRIOR[2:])
    return replace(fit, vector=vector)


def left_out(fit: ModelFit, readings: FrictionReadings) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Predicted friction and what it is off by [N], shape (n,) each, and the vectors, each group by the others.

    A source that is in the left-out group alone gets its offset from its own readings in both directions.
    """
    predicted, signed, vectors = np.empty(readings.count), np.empty(readings.count), []
    for out in readings.groups:
        others, tested = without_group(fit, out), readings.taken(out)
        predicted[out] = others.friction(tested.at)
        rest = tested.force - tested.at.direction * predicted[out]
        offsets = tested.offsets_with_own(others.offsets, rest, readings.source[~out])
        signed[out] = tested.at.direction * (rest - offsets[tested.source])
        vectors.append(others.vector)
    return predicted, signed, np.array(vectors)


def _log_evidence(problem: Problem, weight: FloatArray, start: FloatArray) -> float:
    """Logarithm of the probability of the readings by the method of Laplace, but for a constant."""
    _, jacobian, left = _solved(problem, weight, start)
    determinant = float(np.linalg.slogdet(jacobian.T @ jacobian)[1])
    return -0.5 * float(left @ left) - 0.5 * determinant - float(np.log(problem.prior[:, 1]).sum())


def _start(problem: Problem) -> FloatArray:
    kinds, start = len(problem.columns), problem.prior[:, 0].copy()
    start[: kinds + 1] = 1.0 / (kinds + 1)
    start[kinds + 1 : kinds + 3] = 0.1
    start[_layout(kinds).offsets] = problem.readings.offsets[problem.sources] / problem.size
    return start


def _model_fit(
    problem: Problem, vector: FloatArray, jacobian: FloatArray, left: FloatArray, scatter: float
) -> ModelFit:
    count, covariance = problem.readings.count, np.asarray(np.linalg.inv(jacobian.T @ jacobian))
    return ModelFit(problem, vector, covariance, jacobian[:count], left[:count], scatter)
