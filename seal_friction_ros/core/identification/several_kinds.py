"""Several kinds of seals in one cylinder, fitted together: rod seals on a chamber, a piston seal on the difference.

The model is that of `friction_model`. Only the rise over the pressure tells the kinds apart, and only where their
pressures are varied independently. The friction at no pressure and that over the speed are the sum over all kinds at
every pressure: no log of the cylinder divides them.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations, product
from typing import NamedTuple

import numpy as np

from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.foundation.units import BAR
from seal_friction_ros.core.friction.mounting import pressures_at_seals
from seal_friction_ros.core.identification.candidate_laws import OperatingConditions
from seal_friction_ros.core.identification.friction_model import ModelFit, Told, fit_model, left_out
from seal_friction_ros.core.identification.readings import NARROWEST_PRESSURES, FrictionReadings
from seal_friction_ros.core.identification.signal_preparation import held_pressures, pressure_levels

TOGETHER = 0.98  # correlation of the pressures of the kinds above which they moved together (our choice)
LARGEST_KIND_ERROR = 0.10  # of the friction of a kind: standard error up to which it is told apart (our choice)
SMALL_ERROR = 0.05  # of the friction of all seals: a standard error that is as small does no harm (our choice)
SPEEDS_DIFFER = 1.5  # fast over slow readings from which viscous friction is tried (our choice)
HELD = 0.02  # of the highest pressure: standard deviation of one that did not change (our choice)
MOST_CONDITIONS = 4  # that are proposed (our choice)
NOTICED = 0.05  # [-] standard deviation of the friction from which a condition is proposed (our choice)
SURE_AREA = 4.0  # standard errors of an area of the force sum from which it is corrected (our choice)


class SealKind(NamedTuple):
    """Equal seals of one kind in a cylinder."""

    name: str
    chambers: tuple[str, ...]  # of each seal of the kind, of `CHAMBERS`


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
    model: ModelFit

    @property
    def division(self) -> FloatArray:
        """Share of each kind in the friction that no pressure divides [-], shape (kinds,): that of the rising parts.

        A seal that is pressed harder at no pressure gains more by pressure, too: our choice. Without any rise, each
        seal has the same.
        """
        parts = self.model.parts
        if not parts.sum() > 0.0:
            parts = np.array([float(len(kind.chambers)) for kind in self.data.kinds])
        return np.asarray(parts / parts.sum())

    def frictions(self, at: OperatingConditions) -> FloatArray:
        """Magnitude of the sliding friction of all seals of each kind [N], shape (n, kinds)."""
        rising = self._rising(at)
        side = 1.0 + self.model.asymmetry * at.direction
        undivided = self.model.friction(at) - side * rising.sum(axis=1)
        return np.asarray(side[:, np.newaxis] * rising + undivided[:, np.newaxis] * self.division)

    def coulomb_friction(self, at: OperatingConditions) -> FloatArray:
        """Magnitude of the Coulomb friction of all seals [N], shape (n,)."""
        return np.asarray(self._rising(at).sum(axis=1) + self.model.constant)

    def corrected_readings(self) -> FrictionReadings:
        """The readings with the areas of the force sum corrected."""
        readings = self.data.readings
        return replace(readings, force=readings.force - self.data.chamber_pressures @ self.model.areas, samples=())

    def _rising(self, at: OperatingConditions) -> FloatArray:
        powers = zip(self.model.rises.tolist(), self.model.exponents, strict=True)
        return np.column_stack([rise * self.data.power_sum(k, m, at) for k, (rise, m) in enumerate(powers)])


@dataclass(frozen=True, eq=False)
class KindsIdentification:
    """The fit and how well it tells the kinds apart."""

    fit: KindsFit
    predicted: FloatArray  # [N] by the fit to the other groups, shape (n,)
    deviation: FloatArray  # [N] measured less predicted, shape (n,)
    together: FloatArray  # multiple correlation of the pressure of each kind with those of the others, shape (kinds,)

    @property
    def correlation(self) -> FloatArray:
        """Correlation of the rising parts of the kinds, shape (kinds, kinds)."""
        kinds = slice(1, 1 + len(self.fit.data.kinds))
        covariance = self.fit.model.covariance[kinds, kinds]
        std = np.sqrt(np.diag(covariance))
        return np.asarray(covariance / np.outer(std, std))

    @property
    def division_std(self) -> FloatArray:
        r"""Standard deviation of what is divided by assumption [N], shape (kinds,): :math:`f_0 \sqrt{w (1 - w) / 3}`.

        That of a Dirichlet distribution of concentration 2 about the division w: for two kinds with equal parts every
        division is equally likely (our choice).
        """
        undivided = float((self.fit.model.friction(self.fit.data.readings.at)).mean()) - self.fit.model.parts.sum()
        return np.asarray(undivided * np.sqrt(self.fit.division * (1.0 - self.fit.division) / 3.0))

    @property
    def unseen_std(self) -> float:
        """Relative standard deviation of all friction by the covariance of the posterior, RMS over `_grid` [-]."""
        at = _grid(self.fit.data)[1]
        model = self.fit.model
        return float(np.sqrt(np.mean((model.std(at) / np.maximum(model.friction(at), 1e-12)) ** 2)))

    @property
    def apart_std(self) -> FloatArray:
        """Standard deviation of the mean friction of each kind [N] because kinds are hard to tell apart."""
        return np.hypot(self.fit.model.errors, self.division_std)


def _told(data: KindsReadings) -> Told:
    """Terms that the readings can tell."""
    readings = data.readings
    speed = np.abs(readings.at.velocity)
    varied = bool(np.isfinite(speed).all())
    if varied:
        slow, fast = np.quantile(speed, (0.05, 0.95))
        varied = bool(fast > SPEEDS_DIFFER * slow)
    swings = bool((np.ptp(data.chamber_pressures, axis=0) > NARROWEST_PRESSURES).any())
    return Told(varied, varied, all(len(index) for index in readings.two_sided), swings)


def fit_kinds(data: KindsReadings, largest_error: float = LARGEST_KIND_ERROR) -> KindsIdentification:
    """Fit the model; areas of the force sum are corrected where one is off beyond `SURE_AREA`.

    Args:
        data: Readings of the cylinder.
        largest_error: Standard error up to which a kind is told apart, a share of its friction [-].

    Raises:
        ValueError: The pressures moved together, or the friction of a kind is lost in the noise; what to measure.
    """
    _check_pressures(data)
    told, columns = _told(data), [tuple(range(*data.columns_of(k).indices(10**6))) for k in range(len(data.kinds))]
    model = fit_model(data.readings, columns, told._replace(areas=False))
    if told.areas:
        wider = fit_model(data.readings, columns, told, data.chamber_pressures)
        if wider.surest_area > SURE_AREA:
            model = wider
    predicted, deviation, _ = left_out(model, data.readings, data.chamber_pressures)
    result = KindsIdentification(KindsFit(data, model), predicted, deviation, moved_together(data))
    _check_told_apart(result, largest_error)
    return result


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


def _grid(data: KindsReadings) -> tuple[list[ChamberPressures], OperatingConditions]:
    """Pairs of 0, half and all of the highest pressure, and the conditions there at the mean speed."""
    high = float(np.abs(data.chamber_pressures).max())
    grid = [ChamberPressures(a * high, b * high) for a, b in product((0.0, 0.5, 1.0), repeat=2)]
    seen = pressures_at_seals([chamber for kind in data.kinds for chamber in kind.chambers], *np.array(grid).T)
    speed = float(np.nan_to_num(np.abs(data.readings.at.velocity)).mean())
    return grid, OperatingConditions(seen, None, np.full(len(grid), speed), np.ones(len(grid)))


def proposed_conditions(data: KindsReadings, fit: KindsFit | None = None) -> tuple[tuple[ChamberPressures, ...], float]:
    """Chamber pressures that separate the kinds best, and the largest correlation of `moved_together` with them.

    From a grid of 0, half and all of the highest pressure in each chamber. First, one after the other, those that lower
    the largest multiple correlation most, until it is below half; each weighs as much as a quarter of the readings at
    hand. Then those where the ``fit`` knows the friction of all seals least, beyond `NOTICED` of it. The grid and
    the limits are our choice.
    """
    grid, at = _grid(data)
    seen = at.pressure
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
    if fit is not None:
        disagreement = fit.model.std(at) / np.maximum(fit.model.friction(at), 1e-12)
        order = [int(i) for i in np.argsort(-disagreement) if disagreement[i] > NOTICED and int(i) not in chosen]
        chosen += order[: MOST_CONDITIONS - len(chosen)]
    return tuple(grid[i] for i in chosen), largest


def advice(data: KindsReadings, fit: KindsFit | None = None) -> str:
    """What to measure so that the kinds can be told apart, in words."""
    conditions, _ = proposed_conditions(data, fit)
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
    errors = found.fit.model.errors.tolist()
    return [
        (kind.name, friction, error)
        for kind, friction, error in zip(found.fit.data.kinds, frictions, errors, strict=True)
        if error > largest_error * max(friction, SMALL_ERROR * sum(frictions)) and error > SMALL_ERROR * sum(frictions)
    ]


def _check_told_apart(found: KindsIdentification, largest_error: float) -> None:
    """Check the standard error of each kind.

    Raises:
        ValueError: It is too large; what to measure.
    """
    poor = poorly_told_apart(found, largest_error)
    if poor:
        name, friction, error = poor[0]
        total = float(found.fit.model.friction(found.fit.data.readings.at).mean())
        share = max(error / max(friction, SMALL_ERROR * total) for _, friction, error in poor)
        raise ValueError(
            f'{", ".join(found.fit.data.readings.names)}: the friction of {name} cannot be told from that of the '
            f'others: {friction:.3g} N with a standard error of {error:.2g} N: {advice(found.fit.data, found.fit)}; '
            f'or take it with that error: --largest-kind-error {math.ceil(20.0 * share) / 20.0:.2f}'
        )
