r"""One model of the friction for one kind of seals or several: the batch solution of the filter of the estimate.

.. math:: y = d\,(1 + a\,d)\,(1 + w\,\tau)\,\Big[f_c\,(1 + r\,e^{-|v|/v_S}) + \sigma\,|v|\,(1 + q\,d)
          + f_S\,e^{-|v|/v_S}\Big] + b_s + \Delta A_a\,p_a + \Delta A_b\,p_b + e, \qquad
          f_c = f_0 + \sum_k K_k \sum_j (P_{kj}/1\,\mathrm{bar})^{m_k}

with the pressure :math:`P_{kj}` that seal j of kind k sees, the share :math:`\tau` of the way of a source that is still
to come, an offset of each source and errors of the areas in the force sum. Every term has a prior. Models with and
without each term, and with exponents that contacts have or free ones, are weighted by their evidence: parameters are
those of the most probable one, and what the others say is in the standard deviation. A term that the data cannot tell
from an offset is left out. The error e has the noise of the sensors, a part of each reading and one that all readings
of a cluster share (a stroke of a swept log, a held pressure), so that many samples of few strokes do not count as many
readings.

Source: maximum a posteriori with the covariance of Laplace, [Gelman2013]_ chapter 4. Model and priors are our choice.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from seal_friction_ros.core.foundation.arrays import BoolArray, FloatArray, IntArray
from seal_friction_ros.core.foundation.units import BAR
from seal_friction_ros.core.identification.candidate_laws import EXPONENTS, OperatingConditions
from seal_friction_ros.core.identification.readings import FrictionReadings, numbered

# Priors: mean, standard deviation, lower and upper bound. A share is one of the mean friction.
FRICTION_PRIOR = (0.0, 10.0, 0.0, 100.0)  # [-] share: f_0, and the rise of each kind at its mean pressure
EXPONENT_PRIOR = (1.0, 0.3, 0.3, 2.0)  # [-] m where it is free
VISCOUS_PRIOR = (0.0, 1.0, 0.0, 100.0)  # [-] share at the mean speed
STRIBECK_PRIOR = (0.0, 0.3, 0.0, 10.0)  # [-] r, and f_S as a share
STRIBECK_SPEED_PRIOR = (math.log(0.3), 1.0, math.log(0.01), math.log(3.0))  # ln of v_S over the mean speed
ASYMMETRY_PRIOR = (0.0, 0.08, -0.9, 0.9)  # [-] a
VISCOUS_ASYMMETRY_PRIOR = (0.0, 0.15, -0.9, 0.9)  # [-] q
DRIFT_PRIOR = (0.0, 0.15, -0.9, 3.0)  # [-] w
AREA_PRIOR = (0.0, 5.0, -100.0, 100.0)  # [-] share at the highest pressure of the chamber
OFFSET_PRIOR = (0.0, 1e3, -1e9, 1e9)  # [-] share
FIXED = 1e-6  # standard deviation of a parameter that is not fitted
BEND = 0.5  # [-] standard deviation of the exponent of viscous friction over the speed, which the law has as 1
LOG_ODDS = math.log(2.0)  # [-] of an optional term to be absent, before the readings are seen (our choice)
COLLINEAR = 0.5  # [-] of its prior: standard deviation of a term from which it is not told from an offset (our choice)
CLUSTER_PRIOR = 0.03  # [-] standard deviation of the friction between clusters, expected
CLUSTER_FREEDOM = 1.0  # with this weight
WITHIN_FREEDOM = 5.0  # degrees of freedom by which readings of one cluster are expected to differ by noise alone
SMALLEST_SCATTER = 1e-4  # [-] of the friction
SMALLEST_WEIGHT = 1e-4  # [-] of a model that is averaged
NOTHING = 1e-6  # [-] share that counts as 0
MOST_STEPS = 100  # of a fit
CONVERGED = 1e-6  # [-] change of the cost that ends it


class Told(NamedTuple):
    """Terms that the readings can tell."""

    viscous: bool
    stribeck: bool
    asymmetry: bool
    areas: bool
    drift: bool = False


class _Terms(NamedTuple):
    """Terms of one model; those that are absent are 0."""

    speed: tuple[bool, bool, bool]  # viscous friction, Stribeck friction by r and by f_S
    asymmetry: tuple[bool, bool]  # a, q
    drift: bool
    areas: bool
    exponents: tuple[float | None, ...]  # of each kind; None: free

    @property
    def optional(self) -> int:
        """Number of the terms that are less probable than none before the readings are seen."""
        return sum((*self.speed[1:], *self.asymmetry, self.drift, self.areas))


class _Layout(NamedTuple):
    """Where the parameters stand in a vector: first what friction is linear in: f_0, rises, viscous, r, f_S."""

    linear: slice
    viscous: int
    exponents: slice
    speed: int  # ln v_S
    asymmetry: int  # a, then q
    drift: int
    areas: slice
    offsets: slice


def _layout(kinds: int) -> _Layout:
    viscous, speed = kinds + 1, 2 * kinds + 4
    return _Layout(
        linear=slice(kinds + 4),
        viscous=viscous,
        exponents=slice(viscous + 3, speed),
        speed=speed,
        asymmetry=speed + 1,
        drift=speed + 3,
        areas=slice(speed + 4, speed + 6),
        offsets=slice(speed + 6, None),
    )


Columns = tuple[int, ...] | slice


class Problem(NamedTuple):
    """Readings in the form of the fit."""

    readings: FrictionReadings
    columns: tuple[Columns, ...]  # seals of each kind
    size: float  # [N] mean friction
    speed: float  # [m/s] mean
    highest: FloatArray  # [Pa] pressure of chambers a and b, shape (2,)
    free: FloatArray  # columns of areas and offsets [N], shape (n, 2 + sources)
    to_come: FloatArray  # [-] share of the way of its source after each reading, shape (n,); 0 where it is not known
    scale: FloatArray  # [N] friction about each reading, shape (n,)
    noise: FloatArray  # [-] of the sensors, of that friction, shape (n,)
    cluster: IntArray  # number of the cluster of each reading, shape (n,)
    sources: IntArray  # that have an offset


class _Scatter(NamedTuple):
    """Relative standard deviation of the friction from the model."""

    within: float  # [-] of a reading within its cluster, beyond the noise of the sensors
    between: float  # [-] of a cluster


class _Fit(NamedTuple):
    """One model fitted to the readings."""

    terms: _Terms
    prior: FloatArray  # mean, standard deviation, lower and upper bound of each parameter, shape (count, 4)
    vector: FloatArray
    information: FloatArray  # on the vector, by readings and prior, shape (parameters, parameters)
    covariance: FloatArray  # its inverse
    rows: FloatArray  # weighted derivatives of what is left of each reading, shape (n, parameters)
    left: FloatArray  # weighted rest of each reading, shape (n,)
    log_evidence: float  # of the readings by the method of Laplace, but for a constant, and of the terms


@dataclass(frozen=True, eq=False)
class ModelFit:
    """The model fitted to readings."""

    problem: Problem
    chosen: _Fit
    vector: FloatArray  # f_0, rises, viscous, r, f_S [share]; m, ln v_S, a, q, w; areas, offsets [share]
    scatter: float  # [-] standard deviation of one more reading, or one more stroke of a swept log, from the model
    averaged: tuple[tuple[float, _Fit, '_Bend'], ...]  # weight of each probable model

    @property
    def told(self) -> BoolArray:
        """Which parameters of the friction readings tell, shape (parameters,); the others are fixed."""
        return np.asarray(self.chosen.prior[: self.layout.drift + 1, 1] > FIXED)

    @cached_property
    def covariance(self) -> FloatArray:
        """Covariance of the vector, by the posterior of all probable models, shape (parameters, parameters)."""
        off = [fit.vector - self.chosen.vector for _, fit, _ in self.averaged]
        each = [
            weight * (fit.covariance + np.outer(d, d)) for (weight, fit, _), d in zip(self.averaged, off, strict=True)
        ]
        return np.asarray(np.sum(each, axis=0))

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
        return float(self.vector[self.layout.viscous]) * self.size / self.problem.speed

    @property
    def stribeck(self) -> tuple[float, float]:
        """Stribeck friction of all seals that does not follow the pressure [N], and its speed [m/s]."""
        speed = self.problem.speed * math.exp(self.vector[self.layout.speed])
        return float(self.vector[self.layout.viscous + 2]) * self.size, speed

    @property
    def stribeck_ratio(self) -> float:
        """Stribeck friction as a share r of the Coulomb friction [-]."""
        return float(self.vector[self.layout.viscous + 1])

    @property
    def asymmetry(self) -> float:
        """Share a by which friction is larger on extension."""
        return float(self.vector[self.layout.asymmetry])

    @property
    def viscous_asymmetry(self) -> float:
        """Share q by which viscous friction is larger on extension, beside a."""
        return float(self.vector[self.layout.asymmetry + 1])

    @property
    def drift(self) -> tuple[float, float]:
        """Share w by which friction was larger at the start of a source than at its end, and its standard error."""
        index = self.layout.drift
        return float(self.vector[index]), math.sqrt(float(self.covariance[index, index]))

    @property
    def errors(self) -> FloatArray:
        """Standard error of `parts` [N], shape (kinds,)."""
        return np.asarray(np.sqrt(np.diag(self.covariance)[1 : 1 + len(self.columns)]) * self.size)

    def friction(self, at: OperatingConditions) -> FloatArray:
        """Magnitude of the friction of all seals [N] at the end of the way, shape (n,)."""
        return _magnitude(self.problem, self.vector, at)[0]

    def slopes(self, at: OperatingConditions) -> FloatArray:
        """Derivative of the friction [N] by each of its parameters, shape (n, parameters)."""
        return _magnitude(self.problem, self.vector, at)[1]

    def std(self, at: OperatingConditions) -> FloatArray:
        """Standard deviation of the friction [N], shape (n,), by the posterior of all probable models.

        It has what they differ by, and how far viscous friction may be from a line over the speed (`BEND`).
        """
        chosen, known = self.friction(at), len(self.told)
        variance = np.zeros(len(chosen))
        for weight, fit, bend in self.averaged:
            friction, slopes = _magnitude(self.problem, fit.vector, at)
            own = np.einsum('ni,ij,nj->n', slopes, fit.covariance[:known, :known], slopes)
            bent = _bending(self.problem, fit.vector, at) - slopes @ bend.compensated[:known]
            variance += weight * (own + bend.variance * bent**2 + (friction - chosen) ** 2)
        return np.asarray(np.sqrt(variance))


def _power_sum(at: OperatingConditions, columns: Columns, m: float) -> tuple[FloatArray, FloatArray]:
    """Sum over seals of (P / 1 bar)^m, and its derivative by m, shape (n,) each."""
    pressure = np.maximum(at.pressure[:, columns] / BAR, 1e-9)
    powers = pressure**m
    return powers.sum(axis=1), (powers * np.log(pressure)).sum(axis=1)


def _means(problem: Problem, exponents: Sequence[float] | FloatArray) -> list[tuple[float, float]]:
    """Means of `_power_sum` over the fitted readings, of each kind."""
    each = [_power_sum(problem.readings.at, c, float(m)) for c, m in zip(problem.columns, exponents, strict=True)]
    return [(float(total.mean()), float(slope.mean())) for total, slope in each]


def _magnitude(
    problem: Problem, vector: FloatArray, at: OperatingConditions, to_come: FloatArray | float = 0.0
) -> tuple[FloatArray, FloatArray]:
    """Friction [N], shape (n,), and its derivatives by the parameters of the friction, shape (n, parameters)."""
    layout, size, columns = _layout(len(problem.columns)), problem.size, problem.columns
    means = _means(problem, vector[layout.exponents])
    viscous, ratio, force = vector[layout.viscous : layout.viscous + 3]
    even, uneven, drift = vector[layout.asymmetry : layout.drift + 1]
    speed, direction = np.nan_to_num(np.abs(at.velocity)) / problem.speed, at.direction
    falling = math.exp(-vector[layout.speed]) * speed
    mixed = np.exp(-falling)
    rising, bending = [], []
    for kind, (chosen, (mean, slope)) in enumerate(zip(columns, means, strict=True)):
        powers, slopes = _power_sum(at, chosen, float(vector[layout.exponents][kind]))
        rising.append(powers / max(mean, 1e-300))
        bending.append(vector[1 + kind] * (slopes - rising[-1] * slope) / max(mean, 1e-300))
    pressed = np.column_stack((np.ones(len(speed)), *rising))
    coulomb, share = pressed @ vector[: len(columns) + 1], (1.0 + ratio * mixed)[:, np.newaxis]
    film, side, later = viscous * speed, 1.0 + even * direction, 1.0 + drift * to_come
    symmetric = coulomb * share[:, 0] + film * (1.0 + uneven * direction) + force * mixed
    by_speed = (coulomb * ratio + force) * mixed * falling
    inner = (share * pressed, speed * (1.0 + uneven * direction), coulomb * mixed, mixed,
             *(share[:, 0] * each for each in bending), by_speed)  # fmt: skip
    slopes = np.column_stack(
        (
            (side * later)[:, np.newaxis] * np.column_stack(inner),
            direction * later * symmetric,
            side * later * film * direction,
            side * symmetric * to_come,
        )
    )
    return size * side * later * symmetric, size * slopes


def _bending(problem: Problem, vector: FloatArray, at: OperatingConditions) -> FloatArray:
    """Derivative of the friction [N] by the exponent of its viscous part over the speed, at 1, shape (n,)."""
    speed = np.maximum(np.nan_to_num(np.abs(at.velocity)) / problem.speed, 1e-9)
    return np.asarray(problem.size * vector[_layout(len(problem.columns)).viscous] * speed * np.log(speed))


def _problem(readings: FrictionReadings, columns: Sequence[Columns], told: Told) -> Problem:
    two_sided = np.array([s for s, index in enumerate(readings.two_sided) if len(index)], dtype=np.int64)
    size = max(float(np.abs(readings.magnitudes(readings.offsets)).mean()), 1e-12)
    speed = max(float(np.nan_to_num(np.abs(readings.at.velocity)).mean()), 1e-9)
    highest, both = np.ones(2), np.zeros((readings.count, 2))
    if told.areas:
        highest = np.maximum(np.abs(readings.chamber_pressures).max(axis=0), 1.0)
        both = readings.chamber_pressures / highest
    free = size * np.column_stack((both, readings.source[:, np.newaxis] == two_sided))
    scale = np.maximum(readings.scale, 1e-3 * size)
    noise = readings.noise(readings.force) / scale if readings.samples else np.zeros(readings.count)
    return Problem(
        readings=readings,
        columns=tuple(columns),
        size=size,
        speed=speed,
        highest=highest,
        free=free,
        to_come=_way_to_come(readings) if told.drift else np.zeros(readings.count),
        scale=scale,
        noise=noise,
        cluster=_clusters(readings),
        sources=two_sided,
    )


def _way_to_come(readings: FrictionReadings) -> FloatArray:
    """Share of the way of its source after each reading [-], shape (n,)."""
    found = np.zeros(readings.count)
    for source in np.unique(readings.source):
        travel = readings.travel[inside := readings.source == source]
        found[inside] = (travel.max() - travel) / max(float(np.ptp(travel)), 1e-9)
    return found


def _prior(problem: Problem, terms: _Terms) -> FloatArray:
    """Prior of each parameter of a model; an absent term has `FIXED` about 0."""

    def fixed(value: float) -> tuple[float, float, float, float]:
        """Prior of a parameter that stays where it is."""
        return value, FIXED, value, value

    optional = (VISCOUS_PRIOR, STRIBECK_PRIOR, STRIBECK_PRIOR)
    rows = [FRICTION_PRIOR] * (1 + len(problem.columns))
    rows += [prior if there else fixed(0.0) for prior, there in zip(optional, terms.speed, strict=True)]
    rows += [EXPONENT_PRIOR if m is None else fixed(m) for m in terms.exponents]
    rows += [STRIBECK_SPEED_PRIOR]
    optional = (ASYMMETRY_PRIOR, VISCOUS_ASYMMETRY_PRIOR, DRIFT_PRIOR)
    there = (*terms.asymmetry, terms.drift)
    rows += [prior if there else fixed(0.0) for prior, there in zip(optional, there, strict=True)]
    rows += [AREA_PRIOR if terms.areas else fixed(0.0)] * 2 + [OFFSET_PRIOR] * len(problem.sources)
    return np.array(rows)


class _Weighting:
    """Columns of readings so weighted that their errors are independent and of variance 1.

    An error that readings of a cluster share is taken out as in a model of random effects: of each column, a share of
    its mean over the cluster.
    """

    def __init__(self, problem: Problem, scatter: _Scatter) -> None:
        self._cluster, self._count = problem.cluster, np.bincount(problem.cluster)
        relative = np.hypot(problem.noise, scatter.within)
        self._std = problem.scale * relative
        shared = self._count * (scatter.between * np.bincount(self._cluster, 1.0 / relative) / self._count) ** 2
        self._share = 1.0 - 1.0 / np.sqrt(1.0 + shared)
        self.log_determinant = 2.0 * float(np.log(self._std).sum()) + float(np.log1p(shared).sum())

    def of(self, columns: FloatArray) -> FloatArray:
        """Weighted columns, shape (n, ...)."""
        weighted = columns / self._std.reshape(-1, *[1] * (columns.ndim - 1))
        flat = weighted.reshape(len(weighted), -1)
        means = np.column_stack([np.bincount(self._cluster, each) for each in flat.T]) / self._count[:, np.newaxis]
        return np.asarray((flat - (self._share[:, np.newaxis] * means)[self._cluster]).reshape(weighted.shape))


def _fitted(problem: Problem, terms: _Terms, weighting: _Weighting, start: FloatArray) -> _Fit:
    """Most probable vector by Levenberg and Marquardt within bounds."""
    readings, prior = problem.readings, _prior(problem, terms)
    at, direction = readings.at, readings.at.direction[:, np.newaxis]
    known = _layout(len(problem.columns)).drift + 1

    def both(vector: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Weighted rest and Jacobian at a vector, the rows of the prior last."""
        friction, slopes = _magnitude(problem, vector, at, problem.to_come)
        rest = readings.force - direction[:, 0] * friction - problem.free @ vector[known:]
        jacobian = -weighting.of(np.column_stack((direction * slopes, problem.free)))
        ahead = (vector - prior[:, 0]) / prior[:, 1]
        return np.concatenate((weighting.of(rest), ahead)), np.vstack((jacobian, np.diag(1.0 / prior[:, 1])))

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
    normal = jacobian.T @ jacobian
    evidence = -0.5 * (float(rest @ rest) + weighting.log_determinant + float(np.linalg.slogdet(normal)[1]))
    evidence -= float(np.log(prior[:, 1]).sum()) + LOG_ODDS * terms.optional
    return _Fit(
        terms=terms,
        prior=prior,
        vector=vector,
        information=normal,
        covariance=np.asarray(np.linalg.inv(normal)),
        rows=jacobian[: readings.count],
        left=rest[: readings.count],
        log_evidence=evidence,
    )


def _clusters(readings: FrictionReadings) -> IntArray:
    """Number of the cluster of each reading: a stroke of a swept log, or a pressure that a source held."""
    if readings.are_samples:
        turns = np.diff(readings.at.direction) != 0.0
        return np.concatenate(([0], np.cumsum(turns | (np.diff(readings.source) != 0))))
    return numbered(readings.source, readings.level)


def _scatter(problem: Problem, fit: _Fit) -> _Scatter:
    """Scatter of the readings about a model.

    Within clusters by the analysis of variance, beyond the noise of the sensors. Between clusters the geometric mean of
    that found, with its degrees of freedom, and of the prior (our choice).
    """
    readings, known = problem.readings, len(problem.free[0])
    friction = _magnitude(problem, fit.vector, readings.at, problem.to_come)[0]
    free = problem.free @ fit.vector[-known:] if known else 0.0
    share = (readings.at.direction * (readings.force - free) - friction) / problem.scale
    count = np.bincount(problem.cluster)
    mean = np.bincount(problem.cluster, share) / count
    freedom, noise = len(share) - len(count), float(np.mean(problem.noise**2))
    squares = float(np.sum((share - mean[problem.cluster]) ** 2)) - freedom * noise
    is_known = bool(problem.noise.any())
    within = max(squares, 0.0) / max(freedom + WITHIN_FREEDOM * is_known, 1.0)
    fitted = len(fit.vector) - float(np.sum(np.diag(fit.covariance) / fit.prior[:, 1] ** 2))
    left = max(len(count) - fitted, 0.0)
    found = max(float(np.sum(mean**2 - (within + noise) / count)), 0.0) / max(left, 1.0)
    of_prior = CLUSTER_FREEDOM / (CLUSTER_FREEDOM + left)
    between = max(found, SMALLEST_SCATTER**2) ** (1.0 - of_prior) * CLUSTER_PRIOR ** (2.0 * of_prior)
    return _Scatter(max(math.sqrt(within), SMALLEST_SCATTER), math.sqrt(between))


def _choices(told: Told, kinds: int, *, is_open: bool) -> dict[str, list[Any]]:
    """What each field of `_Terms` may be."""
    mixed = ((False, False), (True, False), (False, True)) if told.stribeck else ((False, False),)
    sides = ((False, False), (True, False), (True, True)) if told.asymmetry else ((False, False),)
    return {
        'speed': [(viscous, *which) for viscous, which in product({told.viscous, is_open and told.viscous}, mixed)],
        'asymmetry': list(sides),
        'drift': sorted({told.drift, False}),
        'areas': sorted({told.areas, False}),
        'exponents': list(product((None,) if is_open else (*EXPONENTS.values(), None), repeat=kinds)),
    }


def _neighbours(terms: _Terms, choices: dict[str, list[Any]]) -> Iterator[_Terms]:
    """Models that differ in one field; in the exponent of one kind, or in those of all kinds, which are then alike."""
    for name, values in choices.items():
        for value in values:
            other = terms._replace(**{name: value})
            if name == 'exponents':
                changed = sum(one != two for one, two in zip(terms.exponents, other.exponents, strict=True))
                if changed > 1 and len(set(other.exponents)) > 1:
                    continue
            yield other if other.speed[0] else other._replace(asymmetry=(other.asymmetry[0], False))


def _is_told(problem: Problem, fit: _Fit) -> bool:
    """Whether the readings tell asymmetry and drift from what is free in every model."""
    layout = _layout(len(problem.columns))
    std = np.sqrt(np.diag(fit.covariance))
    looked_at = ((layout.asymmetry, fit.terms.asymmetry[0]), (layout.drift, fit.terms.drift))
    return all(std[index] <= COLLINEAR * fit.prior[index, 1] for index, is_there in looked_at if is_there)


class _Bend(NamedTuple):
    """How far viscous friction may be from a line over the speed."""

    variance: float  # [-] of the exponent, by readings and prior
    compensated: FloatArray  # change of the parameters by which the readings are met, for an exponent of 1 more


def _bend(problem: Problem, fit: _Fit, weighting: _Weighting) -> _Bend:
    """The exponent of viscous friction beside the parameters of a model, to first order."""
    if not fit.terms.speed[0]:
        return _Bend(0.0, np.zeros(len(fit.vector)))
    at = problem.readings.at
    column = -weighting.of(at.direction * _bending(problem, fit.vector, at))
    compensated = fit.covariance @ (fit.rows.T @ column)
    alone = float(column @ column - (fit.rows.T @ column) @ compensated)
    return _Bend(1.0 / (max(alone, 0.0) + 1.0 / BEND**2), compensated)


def fit_model(readings: FrictionReadings, columns: Sequence[Columns], told: Told, *, is_open: bool = False) -> ModelFit:
    """The most probable model, and all that are probable.

    The ``columns`` of the pressures are the seals of each kind; none for a friction without pressure. Terms that are
    not ``told`` are 0. With ``is_open``, viscous friction and free exponents stay, since other readings may tell them.
    Models are compared by the scatter about that of all terms.
    """
    problem, kinds = _problem(readings.as_means, columns, told), len(columns)
    speed = (told.viscous, told.stribeck, told.stribeck)
    everything = _Terms(speed, (told.asymmetry, False), told.drift, told.areas, (None,) * kinds)
    start, scatter = _start(problem), _Scatter(CLUSTER_PRIOR, CLUSTER_PRIOR)
    for _ in range(3):
        chosen = _fitted(problem, everything, _Weighting(problem, scatter), start)
        start, scatter = chosen.vector, _scatter(problem, chosen)
    # An area must not explain what strokes and pressures usually differ by.
    unsure = scatter._replace(between=max(scatter.between, CLUSTER_PRIOR)) if told.areas else scatter
    choices = _choices(told, kinds, is_open=is_open)
    weights = _weighed(problem, everything, choices, _Weighting(problem, unsure), start)
    _, chosen = max(weights.values(), key=lambda each: each[0])
    for _ in range(2):
        chosen = _fitted(problem, chosen.terms, _Weighting(problem, scatter), chosen.vector)
        scatter = _scatter(problem, chosen)
    weights[chosen.terms] = (weights[chosen.terms][0], chosen)
    weighting = _Weighting(problem, scatter)
    count = np.bincount(problem.cluster).mean() if readings.are_samples else 1.0
    noise = float(np.mean(problem.noise**2))
    return ModelFit(
        problem=problem,
        chosen=chosen,
        vector=chosen.vector,
        scatter=math.sqrt((scatter.within**2 + noise) / float(count) + scatter.between**2),
        averaged=tuple((weight, each, _bend(problem, each, weighting)) for weight, each in weights.values()),
    )


def _weighed(
    problem: Problem, everything: _Terms, choices: dict[str, list[Any]], weighting: _Weighting, start: FloatArray
) -> dict[_Terms, tuple[float, _Fit]]:
    """Probability and fit of each probable model, of those that a search from that of all terms meets."""
    fits: dict[_Terms, _Fit] = {}

    def evidence(terms: _Terms) -> float:
        """Logarithm of the probability of a model; minus infinity if a term of it is not told from an offset."""
        if terms not in fits:
            fits[terms] = _fitted(problem, terms, weighting, start)
        return fits[terms].log_evidence if _is_told(problem, fits[terms]) else -math.inf

    best = everything._replace(asymmetry=(False, False), drift=False)  # what is told for certain
    while evidence(other := max(_neighbours(best, choices), key=evidence)) > evidence(best):
        best = other
    each = np.exp([evidence(terms) - evidence(best) for terms in fits])
    weights = zip(fits.items(), (each / each.sum()).tolist(), strict=True)
    return {terms: (weight, fit) for (terms, fit), weight in weights if weight > SMALLEST_WEIGHT}


def without_group(fit: ModelFit, out: BoolArray) -> ModelFit:
    """The fit to all readings but those ``out``, by one step of Newton, which is exact where the model is linear.

    Parameters at a bound stay there.
    """
    low, high = fit.chosen.prior[:, 2], fit.chosen.prior[:, 3]
    margin = 1e-6 * (high - low)
    free = np.flatnonzero((fit.vector > low + margin) & (fit.vector < high - margin))
    rows = fit.chosen.rows[out][:, free]
    everything = fit.chosen.information[np.ix_(free, free)]
    step = np.linalg.lstsq(everything - rows.T @ rows, rows.T @ fit.chosen.left[out], rcond=1e-14)[0]
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


def _start(problem: Problem) -> FloatArray:
    kinds = len(problem.columns)
    layout = _layout(kinds)
    start = np.zeros(layout.areas.stop + len(problem.sources))
    start[: kinds + 1] = 1.0 / (kinds + 1)
    start[layout.viscous : layout.viscous + 2] = 0.1
    start[layout.exponents], start[layout.speed] = EXPONENT_PRIOR[0], STRIBECK_SPEED_PRIOR[0]
    start[layout.offsets] = problem.readings.offsets[problem.sources] / problem.size
    return start
