r"""Several kinds of seals in one cylinder, fitted together: rod seals on a chamber, a piston seal on the difference.

.. math:: F = \mathrm{sgn}(v)\,\Big[f_0 + \sigma\,|v| + \sum_k K_k \sum_j (P_{kj}/1\,\mathrm{bar})^{m_k}\Big]
          + F_{0,s} + \Delta A_a\,p_a + \Delta A_b\,p_b

with the pressure :math:`P_{kj}` that seal j of kind k sees. Only the rise over the pressure tells the kinds apart, and
only where their pressures are varied independently. The friction at no pressure and the viscous friction are the sum
over all kinds at every pressure: no log of the cylinder divides them.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations, product
from typing import NamedTuple

import numpy as np
from scipy.optimize import nnls

from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.foundation.units import BAR
from seal_friction_ros.core.friction.laws.pressure_power_law import ELASTIC_EXPONENT
from seal_friction_ros.core.friction.mounting import pressures_at_seals
from seal_friction_ros.core.identification.candidate_laws import OperatingConditions
from seal_friction_ros.core.identification.readings import NARROWEST_PRESSURES, FrictionReadings
from seal_friction_ros.core.identification.selection import is_beaten, regroupings
from seal_friction_ros.core.identification.signal_preparation import half_range, held_pressures, pressure_levels
from seal_friction_ros.core.identification.validation import group_losses, jackknife_errors

EXPONENTS = (ELASTIC_EXPONENT, 0.75, 0.85, 1.0, 1.15, 1.3, 1.5, 1.75, 2.0)
"""of the pressure, tried for each kind: a coarse row would put the misfit of one kind on the other (our choice)"""
COARSE = (ELASTIC_EXPONENT, 0.85, 1.0, 1.5)  # where there are more than two kinds (our choice)
TOGETHER = 0.98  # correlation of the pressures of the kinds above which they moved together (our choice)
LARGEST_KIND_ERROR = 0.10  # of the friction of a kind: standard error up to which it is told apart (our choice)
SMALL_ERROR = 0.05  # of the friction of all seals: a standard error that is as small does no harm (our choice)
SPEEDS_DIFFER = 1.5  # fast over slow readings from which viscous friction is tried (our choice)
HELD = 0.02  # of the highest pressure: standard deviation of one that did not change (our choice)
MOST_CONDITIONS = 4  # that are proposed (our choice)
NOTICED = 0.02  # [-] disagreement of laws from which a condition is proposed (our choice)
SINGULAR = 1e-10  # share of the largest eigenvalue below which one counts as 0


class SealKind(NamedTuple):
    """Equal seals of one kind in a cylinder."""

    name: str
    chambers: tuple[str, ...]  # of each seal of the kind, of `CHAMBERS`


class KindsRung(NamedTuple):
    """One combination of laws."""

    exponents: tuple[float, ...]  # of the pressure, one for each kind
    viscous: bool  # with viscous friction
    areas: bool  # with areas of the force sum that are corrected

    @property
    def parameters(self) -> int:
        """Number of fitted parameters, offsets left out."""
        return 1 + len(self.exponents) + self.viscous + 2 * self.areas


@dataclass(frozen=True, eq=False)
class KindsReadings:
    """Readings of a rig with several kinds of seals."""

    readings: FrictionReadings  # seals of all kinds in order; the levels are conditions: pressures of all kinds
    chamber_pressures: FloatArray  # [Pa] of chambers a and b, shape (n, 2)
    kinds: tuple[SealKind, ...]

    def columns_of(self, kind: int) -> slice:
        """Seals of a kind, as columns of the pressures."""
        first = sum(len(each.chambers) for each in self.kinds[:kind])
        return slice(first, first + len(self.kinds[kind].chambers))

    def power_sum(self, kind: int, exponent: float, at: OperatingConditions | None = None) -> FloatArray:
        """Sum over the seals of a kind of (P / 1 bar)^exponent [-], shape (n,)."""
        pressure = (at or self.readings.at).pressure[:, self.columns_of(kind)]
        return np.asarray(((pressure / BAR) ** exponent).sum(axis=1))


def kinds_readings(
    readings: FrictionReadings, chamber_pressures: FloatArray, kinds: Sequence[SealKind]
) -> KindsReadings:
    """Readings whose levels are conditions: each combination of held pressures of the kinds. Swept logs stay as is."""
    found = KindsReadings(readings, chamber_pressures, tuple(kinds))
    if readings.are_samples:
        return found
    levels = []
    for kind in range(len(kinds)):
        pressure = readings.at.pressure[:, found.columns_of(kind)].mean(axis=1)
        for source in np.unique(readings.source):
            inside = readings.source == source
            pressure[inside] = held_pressures(pressure[inside], readings.at.direction[inside])
        levels.append(pressure_levels(pressure))
    condition = np.unique(np.column_stack(levels), axis=0, return_inverse=True)[1].reshape(-1)
    return replace(found, readings=replace(readings, level=condition, group=condition, left_out_by='pressure'))


@dataclass(frozen=True, eq=False)
class KindsFit:
    """Friction of each kind, fitted together."""

    data: KindsReadings
    rung: KindsRung
    rises: FloatArray  # K_k [N] of one seal of each kind at 1 bar, shape (kinds,)
    constant: float  # f_0 [N] of all seals
    viscous: float  # sigma [N s/m] of all seals
    offsets: FloatArray  # [N] of the force sum of each source, shape (sources,)
    areas: FloatArray  # [m^2] error of the areas of chambers a and b in the force sum, shape (2,)

    @property
    def parts(self) -> FloatArray:
        """Mean friction that rises with the pressure, of each kind [N], shape (kinds,)."""
        sums = [self.data.power_sum(k, m).mean() for k, m in enumerate(self.rung.exponents)]
        return np.asarray(self.rises * np.array(sums))

    @property
    def division(self) -> FloatArray:
        """Share of each kind in the friction that no pressure divides [-], shape (kinds,): that of `parts`.

        A seal that is pressed harder at no pressure gains more by pressure, too: our choice. Without any rise, each
        seal has the same.
        """
        parts = self.parts
        if not parts.sum() > 0.0:
            parts = np.array([float(len(kind.chambers)) for kind in self.data.kinds])
        return np.asarray(parts / parts.sum())

    def frictions(self, at: OperatingConditions) -> FloatArray:
        """Magnitude of the sliding friction of all seals of each kind [N], shape (n, kinds)."""
        rising = [rise * self.data.power_sum(k, m, at)
                  for k, (rise, m) in enumerate(zip(self.rises, self.rung.exponents, strict=True))]  # fmt: skip
        undivided = self.constant + self.viscous * np.nan_to_num(np.abs(at.velocity))
        return np.column_stack(rising) + undivided[:, np.newaxis] * self.division

    def coulomb_friction(self, at: OperatingConditions) -> FloatArray:
        """Magnitude of the Coulomb friction of all seals [N], shape (n,)."""
        return np.asarray(self.frictions(at._replace(velocity=np.zeros(len(at.velocity)))).sum(axis=1))

    def corrected_readings(self) -> FrictionReadings:
        """The readings with the areas of the force sum corrected."""
        readings = self.data.readings
        return replace(readings, force=readings.force - self.data.chamber_pressures @ self.areas, samples=())


@dataclass(frozen=True, eq=False)
class KindsIdentification:
    """The chosen fit and how well it tells the kinds apart."""

    fit: KindsFit
    predicted: FloatArray  # [N] by the fit to the other groups, shape (n,)
    deviation: FloatArray  # [N] measured less predicted, shape (n,)
    errors: FloatArray  # [N] standard error of the rising part of each kind, mean over the readings, shape (kinds,)
    rivals: tuple[tuple[float, KindsFit], ...]  # weight and fit of the combinations that are not beaten
    correlation: FloatArray  # of the rising parts of the kinds, shape (kinds, kinds)
    together: FloatArray  # multiple correlation of the pressure of each kind with those of the others, shape (kinds,)
    tried: int  # combinations of laws

    @property
    def spread(self) -> FloatArray:
        """Weighted spread of the mean friction of each kind over the rivals [N], shape (kinds,)."""
        at = self.fit.data.readings.at
        chosen = self.fit.frictions(at).mean(axis=0)
        squares = [weight * (rival.frictions(at).mean(axis=0) - chosen) ** 2 for weight, rival in self.rivals]
        return np.asarray(np.sqrt(np.sum(squares, axis=0)))

    @property
    def division_std(self) -> FloatArray:
        r"""Standard deviation of what is divided by assumption [N], shape (kinds,): :math:`f_0 \sqrt{w (1 - w) / 3}`.

        That of a Dirichlet distribution of concentration 2 about the division w: for two kinds with equal parts every
        division is equally likely (our choice).
        """
        found = self.fit
        speed = float(np.nan_to_num(np.abs(found.data.readings.at.velocity)).mean())
        undivided = found.constant + found.viscous * speed
        return np.asarray(undivided * np.sqrt(found.division * (1.0 - found.division) / 3.0))

    @property
    def apart_std(self) -> FloatArray:
        """Standard deviation of the mean friction of each kind [N] because kinds and laws are hard to tell apart."""
        return np.sqrt(self.errors**2 + self.spread**2 + self.division_std**2)


@dataclass(frozen=True, eq=False)
class _Rows:
    """Weighted rows of all combinations: one Gram matrix serves every fit."""

    matrix: FloatArray  # powers of each kind and exponent, 1, speed | areas, offsets | force; shape (n, columns)
    scale: FloatArray  # length of each column but the last, shape (columns - 1,)
    weight: FloatArray  # [1/N] of each row, shape (n,)
    sources: int  # with an offset
    kinds: int

    def chosen(self, rung: KindsRung) -> tuple[list[int], list[int]]:
        """Columns that must not be negative, and free columns, of a combination."""
        powers = [k * len(EXPONENTS) + EXPONENTS.index(m) for k, m in enumerate(rung.exponents)]
        one = self.kinds * len(EXPONENTS)
        areas = [one + 2, one + 3] if rung.areas else []
        return [*powers, one, *([one + 1] if rung.viscous else [])], [*areas, *range(one + 4, one + 4 + self.sources)]


def _rows(data: KindsReadings) -> _Rows:
    readings = data.readings
    direction, weight = readings.at.direction, 1.0 / readings.scale
    powers = [data.power_sum(k, m) for k in range(len(data.kinds)) for m in EXPONENTS]
    friction = np.column_stack([*powers, np.ones(readings.count), np.nan_to_num(np.abs(readings.at.velocity))])
    two_sided = [index for index in readings.two_sided if len(index)]
    offsets = np.zeros((readings.count, len(two_sided)))
    for column, index in enumerate(two_sided):
        offsets[index, column] = 1.0
    free = np.column_stack((data.chamber_pressures, offsets))
    rows = np.column_stack((direction[:, np.newaxis] * friction, free, readings.force)) * weight[:, np.newaxis]
    scale = np.maximum(np.linalg.norm(rows[:, :-1], axis=0), 1e-300)
    rows[:, :-1] /= scale
    return _Rows(rows, scale, weight, len(two_sided), len(data.kinds))


def _inverse(matrix: FloatArray) -> FloatArray:
    return np.asarray(np.linalg.pinv(matrix, rcond=SINGULAR, hermitian=True))


def _without_free(gram: FloatArray, bound: list[int], free: list[int]) -> tuple[FloatArray, FloatArray]:
    """Normal matrix and right side of the bound columns, the free ones eliminated (Schur complement)."""
    cross = gram[np.ix_(bound, free)] @ _inverse(gram[np.ix_(free, free)])
    normal = gram[np.ix_(bound, bound)] - cross @ gram[np.ix_(free, bound)]
    return np.asarray(normal), np.asarray(gram[bound, -1] - cross @ gram[free, -1])


def _solve(gram: FloatArray, bound: list[int], free: list[int]) -> tuple[FloatArray, FloatArray]:
    """Least squares with the bound columns not negative [LawsonHanson1974]_: their values, and those of the free."""
    normal, right = _without_free(gram, bound, free)
    values, vectors = np.linalg.eigh(normal)
    kept = values > SINGULAR * max(float(values.max()), 1e-300)
    root = np.sqrt(values[kept])
    found = nnls(root[:, np.newaxis] * vectors[:, kept].T, (vectors[:, kept].T @ right) / root)[0]
    rest = gram[free, -1] - gram[np.ix_(free, bound)] @ found
    return found, np.asarray(_inverse(gram[np.ix_(free, free)]) @ rest)


def _left_out(
    rows: _Rows, readings: FrictionReadings, rung: KindsRung, gram: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Predicted friction and deviation [N], shape (n,) each, and the scaled parameters without each group.

    A source that is in the left-out group alone gets its offset from its own readings in both directions.
    """
    bound, free = rows.chosen(rung)
    predicted, deviation, parameters = np.empty(readings.count), np.empty(readings.count), []
    direction = readings.at.direction
    for out in readings.groups:
        part = rows.matrix[out]
        found, loose = _solve(gram - part.T @ part, bound, free)
        signed = (part[:, -1] - part[:, bound] @ found - part[:, free] @ loose) / rows.weight[out]
        elsewhere = set(readings.source[~out].tolist())
        for source in set(readings.source[out].tolist()) - elsewhere:
            inside = readings.source[out] == source
            side = direction[out][inside].astype(np.int64)
            if len(readings.two_sided[source]) and len(np.unique(side)) == 2:
                signed[inside] -= half_range(signed[inside], side, of_medians=False).offset
        deviation[out] = direction[out] * signed
        predicted[out] = direction[out] * (part[:, bound] @ found) / rows.weight[out]
        parameters.append(found)
    return predicted, deviation, np.array(parameters)


def _rungs(data: KindsReadings) -> list[KindsRung]:
    """Every combination of exponents, without and with viscous friction and corrected areas."""
    speed = np.abs(data.readings.at.velocity)
    varied = bool(np.isfinite(speed).all())
    if varied:
        slow, fast = np.quantile(speed, (0.05, 0.95))
        varied = bool(fast > SPEEDS_DIFFER * slow)
    swings = bool((np.ptp(data.chamber_pressures, axis=0) > NARROWEST_PRESSURES).any())
    return [
        KindsRung(exponents, viscous, areas)
        for viscous in ((False, True) if varied else (False,))
        for areas in ((False, True) if swings else (False,))
        for exponents in product(EXPONENTS if len(data.kinds) <= 2 else COARSE, repeat=len(data.kinds))
    ]


def fit_kinds(data: KindsReadings, largest_error: float = LARGEST_KIND_ERROR) -> KindsIdentification:
    """Fit every combination of laws, and take the simplest that is not beaten on readings left out.

    Standard errors are the larger of those of least squares, whose residuals are white, and those of the jackknife over
    the groups, whose readings go together.

    Args:
        data: Readings of the cylinder.
        largest_error: Standard error up to which a kind is told apart, a share of its friction [-].

    Raises:
        ValueError: The pressures moved together, or the friction of a kind is lost in the noise; what to measure.
    """
    readings = data.readings
    _check_pressures(data)
    rows = _rows(data)
    gram = rows.matrix.T @ rows.matrix
    others = regroupings(readings)
    results = []
    for rung in _rungs(data):
        predicted, deviation, parameters = _left_out(rows, readings, rung, gram)
        more = [group_losses(other, _left_out(rows, other, rung, gram)[1]) for other in others]
        losses = np.concatenate((group_losses(readings, deviation), *more))
        results.append((rung, losses, predicted, deviation, parameters))
    best = min((losses for _, losses, *_ in results), key=np.mean)
    left = [result for result in results if not is_beaten(result[1], best)]
    fewest = min(rung.parameters for rung, *_ in left)
    rung, _, predicted, deviation, parameters = min(
        (result for result in left if result[0].parameters == fewest), key=lambda result: float(result[1].mean())
    )
    found = _fit(data, rows, gram, rung)
    errors, correlation = _errors(data, rows, gram, rung, found, parameters)
    result = KindsIdentification(
        fit=found,
        predicted=predicted,
        deviation=deviation,
        errors=errors,
        rivals=_rivals(data, rows, gram, [(result[0], result[1]) for result in left]),
        correlation=correlation,
        together=moved_together(data),
        tried=len(results),
    )
    _check_told_apart(result, largest_error)
    return result


def _rivals(
    data: KindsReadings, rows: _Rows, gram: FloatArray, left: Sequence[tuple[KindsRung, FloatArray]]
) -> tuple[tuple[float, KindsFit], ...]:
    r"""Fits of the combinations that are not beaten, with the weight :math:`L^{-g}` of their loss L in g groups.

    That is the likelihood of g independent normal deviations with the root mean square L: readings of one group share
    their error. Pseudo-likelihood weights are our choice.
    """
    sizes = np.array([float(np.sqrt(np.mean(losses**2))) for _, losses in left])
    groups = len(data.readings.groups)
    weights = (np.maximum(sizes, 1e-12) / max(float(sizes.min()), 1e-12)) ** -groups
    weights = weights / weights.sum()
    pairs = zip(weights.tolist(), left, strict=True)
    return tuple((weight, _fit(data, rows, gram, rung)) for weight, (rung, _) in pairs if weight > 1e-4)


def _fit(data: KindsReadings, rows: _Rows, gram: FloatArray, rung: KindsRung) -> KindsFit:
    bound, free = rows.chosen(rung)
    values, loose = _solve(gram, bound, free)
    values, loose = values / rows.scale[bound], loose / rows.scale[free]
    count, readings = len(data.kinds), data.readings
    offsets = np.zeros(len(readings.names))
    offsets[[source for source, index in enumerate(readings.two_sided) if len(index)]] = loose[2 * rung.areas :]
    return KindsFit(
        data=data,
        rung=rung,
        rises=values[:count],
        constant=float(values[count]),
        viscous=float(values[count + 1]) if rung.viscous else 0.0,
        offsets=offsets,
        areas=loose[:2] if rung.areas else np.zeros(2),
    )


def _errors(
    data: KindsReadings, rows: _Rows, gram: FloatArray, rung: KindsRung, found: KindsFit, left_out: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Standard error of the rising part of each kind [N], shape (kinds,), and their correlation, (kinds, kinds)."""
    bound, free = rows.chosen(rung)
    normal, _ = _without_free(gram, bound, free)
    readings, count = found.corrected_readings(), len(data.kinds)
    residual = (readings.magnitudes(found.offsets) - found.frictions(readings.at).sum(axis=1)) * rows.weight
    variance = float(residual @ residual) / max(readings.count - len(bound) - len(free), 1)
    covariance = variance * _inverse(normal)[:count, :count]
    size = np.array([data.power_sum(k, m).mean() for k, m in enumerate(rung.exponents)]) / rows.scale[bound[:count]]
    white = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    grouped = jackknife_errors(left_out)[:count]
    std = np.maximum(white, 1e-300)
    return np.asarray(np.maximum(white, grouped) * size), np.asarray(covariance / np.outer(std, std))


def moved_together(data: KindsReadings) -> FloatArray:
    """Multiple correlation of the pressure of each kind with those of all others [-], shape (kinds,).

    1 if the pressure of a kind did not change. Pressures themselves are compared, not their powers: a difference in the
    exponents alone tells no kinds apart.
    """
    pressures = np.column_stack([data.power_sum(k, 1.0) for k in range(len(data.kinds))])
    return _multiple_correlation(pressures)


def _multiple_correlation(pressures: FloatArray) -> FloatArray:
    centred = pressures - pressures.mean(axis=0)
    lengths = np.linalg.norm(centred, axis=0)
    if (lengths <= HELD * np.sqrt(len(pressures)) * np.abs(pressures).max(axis=0)).any():
        return np.ones(len(lengths))
    correlation = (centred / lengths).T @ (centred / lengths)
    values, vectors = np.linalg.eigh(correlation)
    inflation = np.diag(vectors @ np.diag(1.0 / np.maximum(values, 1e-12)) @ vectors.T)
    return np.sqrt(np.maximum(1.0 - 1.0 / np.maximum(inflation, 1.0), 0.0))


class ChamberPressures(NamedTuple):
    """Pressures of both chambers to be held [Pa, gauge]."""

    a: float
    b: float


def proposed_conditions(
    data: KindsReadings, rivals: Sequence[tuple[float, KindsFit]] = ()
) -> tuple[tuple[ChamberPressures, ...], float]:
    """Chamber pressures that separate the kinds best, and the largest correlation of `moved_together` with them.

    From a grid of 0, half and all of the highest pressure in each chamber. First, one after the other, those that lower
    the largest multiple correlation most, until it is below half; each weighs as much as a quarter of the readings at
    hand. Then those where the ``rivals`` disagree most on the friction of all seals, beyond `NOTICED` of it
    (T-optimality [AtkinsonFedorov1975]_). Grid and limits are our choice.
    """
    high = float(np.abs(data.chamber_pressures).max())
    grid = [ChamberPressures(a * high, b * high) for a, b in product((0.0, 0.5, 1.0), repeat=2)]
    chambers = [chamber for kind in data.kinds for chamber in kind.chambers]
    seen = pressures_at_seals(chambers, *np.array(grid).T)
    sums = np.column_stack([seen[:, data.columns_of(k)].sum(axis=1) for k in range(len(data.kinds))]) / BAR
    rows = np.column_stack([data.power_sum(k, 1.0) for k in range(len(data.kinds))])
    weight = max(len(rows) // 4, 1)
    chosen: list[int] = []

    def with_condition(index: int) -> float:
        return float(_multiple_correlation(np.vstack((rows, np.repeat(sums[[index]], weight, axis=0)))).max())

    largest = float(_multiple_correlation(rows).max())
    while len(chosen) < MOST_CONDITIONS and largest > 0.5:
        index = min((i for i in range(len(grid)) if i not in chosen), key=with_condition)
        largest = with_condition(index)
        rows = np.vstack((rows, np.repeat(sums[[index]], weight, axis=0)))
        chosen.append(index)
    if rivals:
        speed = float(np.nan_to_num(np.abs(data.readings.at.velocity)).mean())
        at = OperatingConditions(seen, None, np.full(len(grid), speed), np.ones(len(grid)))
        weights = np.array([each for each, _ in rivals])
        totals = np.array([rival.frictions(at).sum(axis=1) for _, rival in rivals])
        middle = weights @ totals / weights.sum()
        disagreement = np.sqrt(weights @ (totals - middle) ** 2 / weights.sum()) / np.maximum(middle, 1e-12)
        order = [int(i) for i in np.argsort(-disagreement) if disagreement[i] > NOTICED and int(i) not in chosen]
        chosen += order[: MOST_CONDITIONS - len(chosen)]
    return tuple(grid[i] for i in chosen), largest


def advice(data: KindsReadings, rivals: Sequence[tuple[float, KindsFit]] = ()) -> str:
    """What to measure so that the kinds can be told apart, in words."""
    conditions, _ = proposed_conditions(data, rivals)
    if not conditions:
        return 'measure more strokes at each pair of pressures, in both directions'
    pairs = ', '.join(f'{c.a / BAR:.3g} and {c.b / BAR:.3g}' for c in conditions)
    return f'drive both directions also with chambers a and b at {pairs} bar'


def _check_pressures(data: KindsReadings) -> None:
    """Check that the pressures of the kinds were varied, and independently.

    Raises:
        ValueError: A kind sees one pressure only, or pressures moved together; what to measure.
    """
    where = ', '.join(data.readings.names)
    for k, kind in enumerate(data.kinds):
        pressure = data.readings.at.pressure[:, data.columns_of(k)]
        low, high = (float(np.quantile(pressure, share)) for share in (0.02, 0.98))
        if set(kind.chambers) == {'ambient'}:
            raise ValueError(
                f'{where}: {kind.name} sees no pressure, so its friction is a part of the friction at no pressure of '
                'the other kinds: leave it out (it counts with them), or measure it alone'
            )
        if high - low < max(NARROWEST_PRESSURES, 0.1 * high):
            raise ValueError(
                f'{where}: {kind.name} saw {low / BAR:.3g} to {high / BAR:.3g} bar only, so its friction cannot be '
                f'told from that of the others: {advice(data)}'
            )
    together = moved_together(data)
    if float(together.max()) <= TOGETHER:
        _check_not_by_one(data, where)
        return
    pressures = np.column_stack([data.power_sum(k, 1.0) for k in range(len(data.kinds))])
    correlation = np.asarray(np.corrcoef(pressures.T))
    one, other = max(combinations(range(len(data.kinds)), 2), key=lambda pair: abs(float(correlation[pair])))
    raise ValueError(
        f'{where}: {data.kinds[one].name} and {data.kinds[other].name} cannot be told apart: their pressures moved '
        f'together (correlation {float(correlation[one, other]):+.3g}): {advice(data)}'
    )


def _check_not_by_one(data: KindsReadings, where: str) -> None:
    """Check that no single group of readings tells the kinds apart: its error would be that of the division.

    Raises:
        ValueError: One does; what to measure.
    """
    readings = data.readings
    pressures = np.column_stack([data.power_sum(k, 1.0) for k in range(len(data.kinds))])
    for out in readings.groups:
        if float(_multiple_correlation(pressures[~out]).max()) > TOGETHER:
            a, b = (data.chamber_pressures[out].mean(axis=0) / BAR).tolist()
            raise ValueError(
                f'{where}: only the readings with chambers a and b at {a:.3g} and {b:.3g} bar tell the kinds apart: '
                f'{advice(data)}, and at another pair between'
            )


def poorly_told_apart(
    found: KindsIdentification, largest_error: float = LARGEST_KIND_ERROR
) -> list[tuple[str, float, float]]:
    """Kinds whose standard error is larger than that share of their friction, and not small beside all friction.

    Returns:
        Name, friction [N] and its standard error [N] of each.
    """
    frictions = found.fit.frictions(found.fit.data.readings.at).mean(axis=0).tolist()
    errors = np.hypot(found.errors, found.spread).tolist()
    return [
        (kind.name, friction, error)
        for kind, friction, error in zip(found.fit.data.kinds, frictions, errors, strict=True)
        if error > largest_error * friction and error > SMALL_ERROR * sum(frictions)
    ]


def _check_told_apart(found: KindsIdentification, largest_error: float) -> None:
    """Check the standard error of each kind.

    Raises:
        ValueError: It is too large; what to measure.
    """
    poor = poorly_told_apart(found, largest_error)
    if poor:
        name, friction, error = poor[0]
        share = max(error / friction for _, friction, error in poor)
        raise ValueError(
            f'{", ".join(found.fit.data.readings.names)}: the friction of {name} cannot be told from that of the '
            f'others: {friction:.3g} N with a standard error of {error:.2g} N: {advice(found.fit.data, found.rivals)}; '
            f'or take it with that error: --largest-kind-error {math.ceil(20.0 * share) / 20.0:.2f}'
        )
