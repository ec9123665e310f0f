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
from typing import NamedTuple

import numpy as np

from seal_friction_ros.core.foundation.arrays import BoolArray, FloatArray, IntArray
from seal_friction_ros.core.foundation.units import BAR
from seal_friction_ros.core.identification.candidate_laws import OperatingConditions
from seal_friction_ros.core.identification.readings import FrictionReadings
from seal_friction_ros.core.identification.signal_preparation import half_range

# Priors: mean, standard deviation, lower and upper bound. A share is one of the mean friction.
FRICTION_PRIOR = (0.0, 10.0, 0.0, 100.0)  # [-] share: f_0, and the rise of each kind at its mean pressure
EXPONENT_PRIOR = (1.0, 0.3, 0.3, 2.5)  # [-] m: an elastic contact has 2/3, lip seals up to 3/2
VISCOUS_PRIOR = (0.0, 1.0, 0.0, 100.0)  # [-] share at the mean speed
STRIBECK_PRIOR = (0.0, 0.3, 0.0, 10.0)  # [-] share
STRIBECK_SPEED_PRIOR = (math.log(0.3), 1.0, math.log(0.01), math.log(3.0))  # ln of v_S over the mean speed
ASYMMETRY_PRIOR = (0.0, 0.08, -0.9, 0.9)  # [-]
AREA_PRIOR = (0.0, 5.0, -100.0, 100.0)  # [-] share at the highest pressure of the chamber
OFFSET_PRIOR = (0.0, 1e3, -1e9, 1e9)  # [-] share
CLUSTER_PRIOR = 0.03  # [-] standard deviation of the friction between clusters, expected
CLUSTER_FREEDOM = 1.0  # with this weight
NOTHING = 1e-6  # [-] share that counts as 0
MOST_STEPS = 100  # of a fit
CONVERGED = 1e-9  # [-] change of the cost that ends it
STARTS = (0.1, 0.3, 1.0)  # of v_S over the mean speed, where a fit begins


class Told(NamedTuple):
    """Terms that the readings can tell."""

    viscous: bool
    stribeck: bool
    asymmetry: bool
    areas: bool


class _Layout(NamedTuple):
    """Where the parameters stand in a vector."""

    kinds: int
    sources: int  # with an offset

    @property
    def exponents(self) -> slice:
        return slice(self.kinds + 3, 2 * self.kinds + 3)

    @property
    def speed(self) -> int:  # ln v_S
        return 2 * self.kinds + 3

    @property
    def asymmetry(self) -> int:
        return 2 * self.kinds + 4

    @property
    def parameters(self) -> int:
        return 2 * self.kinds + 7 + self.sources


@dataclass(frozen=True, eq=False)
class ModelFit:
    """The model fitted to readings."""

    vector: FloatArray  # f_0, rises, viscous, Stribeck [share]; m, ln v_S, a; areas, offsets [share]
    covariance: FloatArray  # of the vector
    columns: tuple[tuple[int, ...], ...]  # seals of each kind
    size: float  # [N] mean friction
    speed: float  # [m/s] mean
    at: OperatingConditions  # of the readings
    highest: FloatArray  # [Pa] pressure of chambers a and b, shape (2,)
    sources: int
    scatter: float  # [-] standard deviation of the friction between clusters
    rows: FloatArray  # weighted derivatives of what is left of each reading, shape (n, parameters)
    left: FloatArray  # weighted rest of each reading, shape (n,)
    two_sided: IntArray  # sources with an offset
    is_free: BoolArray  # parameters that are at no bound

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
        parts = self.parts if self.parts.sum() > 0.0 else np.array([float(len(each)) for each in self.columns])
        return np.asarray(parts / parts.sum())

    @property
    def areas(self) -> FloatArray:
        """Error of the areas of chambers a and b in the force sum [m^2], shape (2,)."""
        first = _Layout(len(self.columns), 0).asymmetry + 1
        return np.asarray(self.vector[first : first + 2] * self.size / self.highest)

    @property
    def offsets(self) -> FloatArray:
        """Offset of the force sum of each source [N], shape (sources,)."""
        found = np.zeros(self.sources)
        found[self.two_sided] = self.vector[_Layout(len(self.columns), 0).asymmetry + 3 :] * self.size
        return found

    @property
    def exponents(self) -> tuple[float, ...]:
        """Exponent m of each kind."""
        return tuple(self.vector[_Layout(len(self.columns), 0).exponents].tolist())

    @property
    def rises(self) -> FloatArray:
        """K of one seal of each kind at 1 bar [N], shape (kinds,)."""
        means = [_power_sum(self.at, c, m)[0].mean() for c, m in zip(self.columns, self.exponents, strict=True)]
        return np.asarray(self.parts / np.maximum(means, 1e-300))

    @property
    def viscous(self) -> float:
        """Viscous friction of all seals [N s/m]."""
        return float(self.vector[len(self.columns) + 1]) * self.size / self.speed

    @property
    def stribeck(self) -> tuple[float, float]:
        """Stribeck friction of all seals [N] and its speed [m/s]."""
        layout = _Layout(len(self.columns), 0)
        return float(self.vector[layout.kinds + 2]) * self.size, self.speed * math.exp(self.vector[layout.speed])

    @property
    def asymmetry(self) -> float:
        """Share a by which friction is larger on extension."""
        return float(self.vector[_Layout(len(self.columns), 0).asymmetry])

    @property
    def errors(self) -> FloatArray:
        """Standard error of `parts` [N], shape (kinds,)."""
        return np.asarray(np.sqrt(np.diag(self.covariance)[1 : 1 + len(self.columns)]) * self.size)

    @property
    def surest_area(self) -> float:
        """Standard errors by which an area of the force sum is off [-]."""
        first = _Layout(len(self.columns), 0).asymmetry + 1
        both = slice(first, first + 2)
        return float((np.abs(self.vector[both]) / np.sqrt(np.diag(self.covariance)[both])).max())

    def friction(self, at: OperatingConditions) -> FloatArray:
        """Magnitude of the friction of all seals [N], shape (n,)."""
        return self._with_slopes(at)[0]

    def std(self, at: OperatingConditions) -> FloatArray:
        """Standard deviation of the friction [N], shape (n,), by the covariance of the posterior."""
        slopes = self._with_slopes(at)[1]
        known = slopes.shape[1]
        return np.asarray(np.sqrt(np.einsum('ni,ij,nj->n', slopes, self.covariance[:known, :known], slopes)))

    def _with_slopes(self, at: OperatingConditions) -> tuple[FloatArray, FloatArray]:
        means = [_power_sum(self.at, c, m) for c, m in zip(self.columns, self.exponents, strict=True)]
        logs = [(float(total.mean()), float(slope.mean())) for total, slope in means]
        return _magnitude(self.vector, at, self.columns, logs, (self.size, self.speed))


def _power_sum(at: OperatingConditions, columns: Sequence[int], m: float) -> tuple[FloatArray, FloatArray]:
    """Sum over seals of (P / 1 bar)^m, and its derivative by m, shape (n,) each."""
    pressure = np.maximum(at.pressure[:, list(columns)] / BAR, 1e-9)
    powers = pressure**m
    return powers.sum(axis=1), (powers * np.log(pressure)).sum(axis=1)


def _magnitude(
    vector: FloatArray,
    at: OperatingConditions,
    columns: Sequence[tuple[int, ...]],
    means: Sequence[tuple[float, float]],
    sizes: tuple[float, float],
) -> tuple[FloatArray, FloatArray]:
    """Friction [N], shape (n,), and its derivatives by the parameters of the friction, shape (n, parameters).

    ``means`` are those of `_power_sum` over the fitted readings, ``sizes`` friction [N] and speed [m/s].
    """
    layout, (size, typical) = _Layout(len(columns), 0), sizes
    speed, direction = np.nan_to_num(np.abs(at.velocity)) / typical, at.direction
    falling = math.exp(-vector[layout.speed]) * speed
    rising, bending = [], []
    for kind, (chosen, (mean, slope)) in enumerate(zip(columns, means, strict=True)):
        powers, slopes = _power_sum(at, chosen, float(vector[layout.exponents][kind]))
        rising.append(powers / max(mean, 1e-300))
        bending.append(vector[1 + kind] * (slopes - rising[-1] * slope) / max(mean, 1e-300))
    linear = np.column_stack((np.ones(len(speed)), *rising, speed, np.exp(-falling)))
    symmetric = linear @ vector[: linear.shape[1]]
    by_speed = vector[layout.kinds + 2] * np.exp(-falling) * falling
    side = (1.0 + vector[layout.asymmetry] * direction)[:, np.newaxis]
    slopes = np.column_stack((side * np.column_stack((linear, *bending, by_speed)), direction * symmetric))
    return size * side[:, 0] * symmetric, size * slopes


class _Problem(NamedTuple):
    """Readings in the form of the fit."""

    readings: FrictionReadings
    columns: tuple[tuple[int, ...], ...]
    size: float  # [N]
    speed: float  # [m/s]
    free: FloatArray  # columns of areas and offsets [N], shape (n, 2 + sources)
    prior: FloatArray  # mean, standard deviation, lower and upper bound of each parameter, shape (count, 4)
    sources: IntArray  # that have an offset


def _problem(
    readings: FrictionReadings, columns: Sequence[tuple[int, ...]], told: Told, chamber_pressures: FloatArray | None
) -> _Problem:
    two_sided = np.array([s for s, index in enumerate(readings.two_sided) if len(index)], dtype=np.int64)
    offsets = offsets_by_half_range(readings)
    size = max(float(np.abs(readings.magnitudes(offsets)).mean()), 1e-12)
    speed = max(float(np.nan_to_num(np.abs(readings.at.velocity)).mean()), 1e-9)
    highest = np.ones(2) if chamber_pressures is None else np.maximum(np.abs(chamber_pressures).max(axis=0), 1.0)
    both = np.zeros((readings.count, 2)) if chamber_pressures is None else chamber_pressures / highest
    free = size * np.column_stack((both, readings.source[:, np.newaxis] == two_sided))
    off = (0.0, 1e-6, -1e-5, 1e-5)
    prior = [FRICTION_PRIOR] * (1 + len(columns))
    prior += [VISCOUS_PRIOR if told.viscous else off, STRIBECK_PRIOR if told.stribeck else off]
    prior += [EXPONENT_PRIOR] * len(columns)
    prior += [STRIBECK_SPEED_PRIOR, ASYMMETRY_PRIOR if told.asymmetry else off]
    prior += [AREA_PRIOR if told.areas else off] * 2 + [OFFSET_PRIOR] * len(two_sided)
    table = np.array(prior)
    return _Problem(readings, tuple(columns), size, speed, free, table, two_sided)


def offsets_by_half_range(readings: FrictionReadings) -> FloatArray:
    """Offset of the force sum of each source [N], in which the friction of its two directions cancels."""
    each = [readings.source == source for source in range(len(readings.names))]
    return np.array([readings.half_range(inside).offset if inside.any() else 0.0 for inside in each])


def _solved(problem: _Problem, weight: FloatArray, start: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Vector, and weighted Jacobian and rest with the rows of the prior: Levenberg and Marquardt within bounds."""
    readings, prior = problem.readings, problem.prior
    at, direction = readings.at, readings.at.direction[:, np.newaxis]
    layout = _Layout(len(problem.columns), len(problem.sources))
    known = layout.asymmetry + 1

    def both(vector: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Weighted rest and Jacobian at a vector, the rows of the prior last."""
        means = [_power_sum(at, c, float(m)) for c, m in zip(problem.columns, vector[layout.exponents], strict=True)]
        pairs = [(float(total.mean()), float(slope.mean())) for total, slope in means]
        friction, slopes = _magnitude(vector, at, problem.columns, pairs, (problem.size, problem.speed))
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
    return np.asarray(np.unique(np.column_stack((readings.source, readings.level)), axis=0, return_inverse=True)[1])


def _weights(readings: FrictionReadings, residual: FloatArray, size: float, fitted: float) -> tuple[FloatArray, float]:
    """Weight of each reading [1/N], and standard deviation of the friction between clusters [-].

    ``residual`` is that of the magnitudes [N], shape (n,), after a fit of ``fitted`` effective parameters. The variance
    of a reading is that within a cluster, and as many times that between clusters as the cluster has readings. The
    latter is the geometric mean of that found, with its degrees of freedom, and of the prior (our choice).
    """
    cluster = _clusters(readings).reshape(-1)
    share = residual / np.maximum(readings.scale, 1e-3 * size)
    count = np.bincount(cluster)
    mean = np.bincount(cluster, share) / count
    within = float(np.sum((share - mean[cluster]) ** 2)) / max(len(share) - len(count), 1)
    freedom = max(len(count) - fitted, 0.0)
    found = float(np.sum(np.maximum(mean**2 - within / count, 0.0))) / max(freedom, 1.0)
    of_prior = CLUSTER_FREEDOM / (CLUSTER_FREEDOM + freedom)
    between = max(found, 1e-8) ** (1.0 - of_prior) * CLUSTER_PRIOR ** (2.0 * of_prior)
    variance = within + count[cluster] * between
    return 1.0 / (np.maximum(readings.scale, 1e-3 * size) * np.sqrt(variance)), math.sqrt(between)


def fit_model(
    readings: FrictionReadings,
    columns: Sequence[tuple[int, ...]],
    told: Told,
    chamber_pressures: FloatArray | None = None,
    near: FloatArray | None = None,
) -> ModelFit:
    """Most probable parameters and their covariance, with Stribeck friction and asymmetry where they are more probable.

    Args:
        readings: Of one or several sources.
        columns: Seals of each kind, as columns of the pressures; empty for a friction without pressure.
        told: Terms that the readings can tell; the others are 0.
        chamber_pressures: Of chambers a and b [Pa], shape (n, 2), for errors of the areas.
        near: Vector of a fit to similar readings, from which this one starts.
    """
    problem = _problem(readings, columns, told, chamber_pressures)
    layout = _Layout(len(columns), len(problem.sources))
    starts = [near] if near is not None and len(near) == layout.parameters else _starts(problem, layout, told)
    weight = 1.0 / (np.maximum(readings.scale, 1e-3 * problem.size) * CLUSTER_PRIOR)
    scatter = CLUSTER_PRIOR
    for _ in range(2):
        solved = (_solved(problem, weight, start) for start in starts)
        vector, jacobian, left = min(solved, key=lambda found: float(found[2] @ found[2]))
        fit = _model_fit(problem, vector, jacobian, scatter, left, chamber_pressures)
        free = problem.free @ vector[layout.asymmetry + 1 :]
        residual = readings.at.direction * (readings.force - free) - fit.friction(readings.at)
        fitted = layout.parameters - float(np.sum(np.diag(fit.covariance) / problem.prior[:, 1] ** 2))
        weight, scatter = _weights(readings, residual, problem.size, fitted)
        starts = [vector]
    choices = [
        _problem(readings, columns, told._replace(stribeck=falling, asymmetry=uneven), chamber_pressures)
        for falling in sorted({told.stribeck, False})
        for uneven in sorted({told.asymmetry, False})
    ]
    found = [(each, *_solved(each, weight, starts[0])) for each in choices]
    problem, vector, jacobian, left = max(found, key=lambda one: _evidence(*one))
    return _model_fit(problem, vector, jacobian, scatter, left, chamber_pressures)


def without_group(fit: ModelFit, out: BoolArray) -> ModelFit:
    """The fit to all readings but those ``out``, by one step of Newton, which is exact where the model is linear.

    Parameters at a bound stay there.
    """
    free = np.flatnonzero(fit.is_free)
    rows = fit.rows[out][:, free]
    everything = np.linalg.pinv(fit.covariance, hermitian=True)[np.ix_(free, free)]
    step = np.linalg.lstsq(everything - rows.T @ rows, rows.T @ fit.left[out], rcond=1e-14)[0]
    vector = fit.vector.copy()
    vector[free] += step
    linear = slice(0, len(fit.columns) + 3)
    vector[linear] = np.maximum(vector[linear], 0.0)
    layout = _Layout(len(fit.columns), 0)
    vector[layout.exponents] = np.clip(vector[layout.exponents], *EXPONENT_PRIOR[2:])
    return replace(fit, vector=vector)


def left_out(
    fit: ModelFit, readings: FrictionReadings, chamber_pressures: FloatArray | None = None
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Predicted friction and what it is off by [N], shape (n,) each, and the vectors, each group by the others.

    A source that is in the left-out group alone gets its offset from its own readings in both directions.
    """
    predicted, signed, vectors = np.empty(readings.count), np.empty(readings.count), []
    for out in readings.groups:
        others, tested = without_group(fit, out), readings.taken(out)
        predicted[out] = others.friction(tested.at)
        offsets = others.offsets.copy()
        rest = tested.force - tested.at.direction * predicted[out]
        if chamber_pressures is not None:
            rest = rest - chamber_pressures[out] @ others.areas
        for source in set(tested.source.tolist()) - set(readings.source[~out].tolist()):
            index = tested.two_sided[source]
            side = tested.at.direction[index].astype(np.int64)
            offsets[source] = half_range(rest[index], side, of_medians=False).offset if len(index) else 0.0
        signed[out] = tested.at.direction * (rest - offsets[tested.source])
        vectors.append(others.vector)
    return predicted, signed, np.array(vectors)


def _evidence(problem: _Problem, _: FloatArray, jacobian: FloatArray, left: FloatArray) -> float:
    """Logarithm of the probability of the readings by the method of Laplace, but for a constant."""
    determinant = float(np.linalg.slogdet(jacobian.T @ jacobian)[1])
    return -0.5 * float(left @ left) - 0.5 * determinant - float(np.log(problem.prior[:, 1]).sum())


def _starts(problem: _Problem, layout: _Layout, told: Told) -> list[FloatArray]:
    start = np.zeros(layout.parameters)
    start[: layout.kinds + 1] = 1.0 / (layout.kinds + 1)
    start[layout.exponents] = EXPONENT_PRIOR[0]
    start[layout.kinds + 1 : layout.kinds + 3] = 0.1
    start[layout.speed] = STRIBECK_SPEED_PRIOR[0]
    start[layout.asymmetry + 3 :] = offsets_by_half_range(problem.readings)[problem.sources] / problem.size
    found = []
    for share in STARTS if told.stribeck else (0.3,):
        one = start.copy()
        one[layout.speed] = math.log(share)
        found.append(one)
    return found


def _model_fit(
    problem: _Problem,
    vector: FloatArray,
    jacobian: FloatArray,
    scatter: float,
    left: FloatArray,
    chamber_pressures: FloatArray | None,
) -> ModelFit:
    low, high = problem.prior[:, 2], problem.prior[:, 3]
    highest = np.ones(2) if chamber_pressures is None else np.maximum(np.abs(chamber_pressures).max(axis=0), 1.0)
    return ModelFit(
        vector=vector,
        covariance=np.asarray(np.linalg.inv(jacobian.T @ jacobian)),
        columns=problem.columns,
        size=problem.size,
        speed=problem.speed,
        at=problem.readings.at,
        highest=highest,
        sources=len(problem.readings.names),
        scatter=scatter,
        rows=jacobian[: problem.readings.count],
        left=left[: problem.readings.count],
        two_sided=problem.sources,
        is_free=(vector > low + 1e-6 * (high - low)) & (vector < high - 1e-6 * (high - low)),
    )
