"""Several kinds of seals in one cylinder: what tells them apart, and what to drive so that they can be.

The law is that of `friction_model`, for one kind or several. Only the rise over the pressure tells kinds apart, and
only where their pressures are varied independently. The friction at no pressure and that over the speed are the sum
over all kinds at every pressure: no log of the cylinder divides them.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations, product
from typing import NamedTuple

import numpy as np

from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.foundation.units import BAR
from seal_friction_ros.core.friction.mounting import pressures_at_seals
from seal_friction_ros.core.identification.candidate_laws import OperatingConditions, SealKind, columns_of
from seal_friction_ros.core.identification.force_correction import ForceCorrection
from seal_friction_ros.core.identification.friction_model import ModelFit, Told, fit_model
from seal_friction_ros.core.identification.readings import NARROWEST_PRESSURES, FrictionReadings, numbered
from seal_friction_ros.core.identification.signal_preparation import held_pressures, pressure_levels

TOGETHER = 0.98  # correlation of the pressures of the kinds above which they moved together (our choice)
LARGEST_KIND_ERROR = 0.10  # of the friction of a kind: standard error up to which it is told apart (our choice)
SMALL_ERROR = 0.05  # of the friction of all seals: a standard error that is as small does no harm (our choice)
HELD = 0.02  # of the highest pressure: standard deviation of one that did not change (our choice)
MOST_CONDITIONS = 4  # that are proposed (our choice)
NOTICED = 0.05  # [-] standard deviation of the friction from which a condition is proposed (our choice)


def kinds_readings(readings: FrictionReadings, kinds: Sequence[SealKind]) -> FrictionReadings:
    """Readings of several kinds, whose levels are conditions: each combination of held pressures of the kinds.

    Those of swept logs stay.
    """
    found = replace(readings, kinds=tuple(kinds))
    if readings.are_samples:
        return found
    levels = []
    for number in range(len(kinds)):
        pressure = readings.at.pressure[:, columns_of(kinds, number)].mean(axis=1)
        for source in np.unique(readings.source):
            inside = readings.source == source
            pressure[inside] = held_pressures(pressure[inside], readings.at.direction[inside])
        levels.append(pressure_levels(pressure))
    condition = numbered(*levels)
    return replace(found, level=condition, group=condition, left_out_by='pressure')


def area_errors(readings: FrictionReadings, told: Told) -> ForceCorrection | None:
    """Errors of the areas in the force sum, fitted together with the terms ``told``; None if no pressure swung."""
    if not (np.ptp(readings.chamber_pressures, axis=0) > NARROWEST_PRESSURES).any():
        return None
    columns = [columns_of(readings.kinds, number) for number in range(len(readings.kinds))]
    model = fit_model(readings, columns, told._replace(areas=True))
    area_a, area_b = (-model.areas).tolist()
    return ForceCorrection((area_a, area_b), any((area_a, area_b)))


class ToldApart(NamedTuple):
    """How well readings tell the kinds of seals apart; arrays of shape (kinds,)."""

    friction: FloatArray  # [N] mean of each kind
    rising: FloatArray  # [N] of it, what rises with the pressure
    errors: FloatArray  # [N] standard error of that by the covariance of the posterior
    division_std: FloatArray  # [N] of what is divided by assumption
    correlation: FloatArray  # of the rising parts, shape (kinds, kinds)
    together: FloatArray  # multiple correlation of the pressure of each kind with those of the others

    @property
    def apart_std(self) -> FloatArray:
        """Standard deviation of the mean friction of each kind [N] because kinds are hard to tell apart."""
        return np.hypot(self.errors, self.division_std)


def told_apart(model: ModelFit, readings: FrictionReadings) -> ToldApart:
    r"""How well the model of readings tells the kinds apart.

    What is divided by assumption has the standard deviation :math:`f_0 \sqrt{w (1 - w) / 3}` of a Dirichlet
    distribution of concentration 2 about the division w: for two kinds with equal parts every division is equally
    likely (our choice).
    """
    share, rising = model.division, model.parts
    undivided = float(model.friction(readings.at).mean()) - rising.sum()
    side = 1.0 + model.asymmetry * float(np.mean(readings.at.direction))
    covariance = model.covariance[1 : 1 + len(share), 1 : 1 + len(share)]
    std = np.sqrt(np.diag(covariance))
    return ToldApart(
        friction=side * rising + (float(model.friction(readings.at).mean()) - side * rising.sum()) * share,
        rising=rising,
        errors=model.errors,
        division_std=np.asarray(undivided * np.sqrt(share * (1.0 - share) / 3.0)),
        correlation=np.asarray(covariance / np.maximum(np.outer(std, std), 1e-300)),
        together=moved_together(readings),
    )


def pressure_sums(readings: FrictionReadings) -> FloatArray:
    """Sum of the pressures of the seals of each kind [bar], shape (n, kinds).

    Pressures themselves are compared, not their powers: a difference in the exponents alone tells no kinds apart.
    """
    return _sums(readings.kinds, readings.at.pressure)


def _sums(kinds: Sequence[SealKind], pressure: FloatArray) -> FloatArray:
    return np.column_stack([pressure[:, columns_of(kinds, k)].sum(axis=1) for k in range(len(kinds))]) / BAR


def moved_together(readings: FrictionReadings) -> FloatArray:
    """Multiple correlation of the pressure of each kind with those of all others [-], shape (kinds,).

    1 if the pressure of a kind did not change.
    """
    return _multiple_correlation(pressure_sums(readings))


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


def _grid(readings: FrictionReadings) -> tuple[list[ChamberPressures], OperatingConditions]:
    """Pairs of 0, half and all of the highest pressure, and the conditions there at the mean speed."""
    high = float(np.abs(readings.chamber_pressures).max())
    grid = [ChamberPressures(a * high, b * high) for a, b in product((0.0, 0.5, 1.0), repeat=2)]
    seen = pressures_at_seals([chamber for kind in readings.kinds for chamber in kind.chambers], *np.array(grid).T)
    speed = float(np.nan_to_num(np.abs(readings.at.velocity)).mean())
    return grid, OperatingConditions(seen, np.full(len(grid), speed), np.ones(len(grid)))


def proposed_conditions(
    readings: FrictionReadings, model: ModelFit | None = None
) -> tuple[tuple[ChamberPressures, ...], float]:
    """Chamber pressures that separate the kinds best, and the largest correlation of `moved_together` with them.

    From a grid of 0, half and all of the highest pressure in each chamber. First, one after the other, those that lower
    the largest multiple correlation most, until it is below half; each weighs as much as a quarter of the readings at
    hand. Then those where the ``model`` knows the friction of all seals least, beyond `NOTICED` of it. The grid and
    the limits are our choice.
    """
    grid, at = _grid(readings)
    sums, rows = _sums(readings.kinds, at.pressure), pressure_sums(readings)
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
    if model is not None:
        unsure = model.std(at) / np.maximum(model.friction(at), 1e-12)
        order = [int(i) for i in np.argsort(-unsure) if unsure[i] > NOTICED and int(i) not in chosen]
        chosen += order[: MOST_CONDITIONS - len(chosen)]
    return tuple(grid[i] for i in chosen), largest


def advice(readings: FrictionReadings, model: ModelFit | None = None) -> str:
    """What to measure so that the kinds can be told apart, in words."""
    conditions, _ = proposed_conditions(readings, model)
    if not conditions:
        return 'measure more strokes at each pair of pressures, in both directions'
    pairs = ', '.join(f'{c.a / BAR:.3g} and {c.b / BAR:.3g}' for c in conditions)
    return f'drive both directions also with chambers a and b at {pairs} bar'


def check_kinds(readings: FrictionReadings) -> None:
    """Check that the pressures of the kinds were varied, and independently.

    ValueError: a kind sees one pressure only, or pressures moved together; what to measure.
    """
    where, kinds = ', '.join(readings.names), readings.kinds
    for number, kind in enumerate(kinds):
        pressure = readings.at.pressure[:, columns_of(kinds, number)]
        low, high = (float(np.quantile(pressure, share)) for share in (0.02, 0.98))
        if set(kind.chambers) == {'ambient'}:
            raise ValueError(
                f'{where}: {kind.name} sees no pressure, so its friction is a part of the friction at no pressure of '
                'the other kinds: leave it out (it counts with them), or measure it alone'
            )
        if high - low < max(NARROWEST_PRESSURES, 0.1 * high):
            raise ValueError(
                f'{where}: {kind.name} saw {low / BAR:.3g} to {high / BAR:.3g} bar only, so its friction cannot be '
                f'told from that of the others: {advice(readings)}'
            )
    if float(moved_together(readings).max()) <= TOGETHER:
        return
    correlation = np.asarray(np.corrcoef(pressure_sums(readings).T))
    one, other = max(combinations(range(len(kinds)), 2), key=lambda pair: abs(float(correlation[pair])))
    raise ValueError(
        f'{where}: {kinds[one].name} and {kinds[other].name} cannot be told apart: their pressures moved '
        f'together (correlation {float(correlation[one, other]):+.3g}): {advice(readings)}'
    )


def poorly_told_apart(
    found: ToldApart, kinds: Sequence[SealKind], largest_error: float = LARGEST_KIND_ERROR
) -> list[tuple[str, float, float]]:
    """Kinds with a standard error above that share of their friction, and not small: name, friction and error [N]."""
    small = SMALL_ERROR * float(found.friction.sum())
    return [
        (kind.name, friction, error)
        for kind, friction, error in zip(kinds, found.friction.tolist(), found.errors.tolist(), strict=True)
        if error > max(largest_error * max(friction, small), small)
    ]


def check_told_apart(
    found: ToldApart, model: ModelFit, readings: FrictionReadings, largest_error: float = LARGEST_KIND_ERROR
) -> None:
    """Check the standard error of each kind. ValueError: it is too large; what to measure."""
    poor = poorly_told_apart(found, readings.kinds, largest_error)
    if poor:
        name, friction, error = poor[0]
        total = float(found.friction.sum())
        share = max(error / max(friction, SMALL_ERROR * total) for _, friction, error in poor)
        raise ValueError(
            f'{", ".join(readings.names)}: the friction of {name} cannot be told from that of the '
            f'others: {friction:.3g} N with a standard error of {error:.2g} N: {advice(readings, model)}; '
            f'or take it with that error: --largest-kind-error {math.ceil(20.0 * share) / 20.0:.2f}'
        )
