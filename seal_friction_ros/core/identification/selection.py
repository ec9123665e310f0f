"""Choice of a law: every candidate is scored on readings left out of its fit, and the simplest that suffices is taken.

Four pressures give four numbers to compare two laws by, which has no power: whether friction rises with pressure at all
is told by a line. A law whose parameters the data do not determine is not recommended while a sound one is near.
"""

import math
import operator
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import numpy as np
from scipy.special import stdtrit

from seal_friction_ros.core.foundation.arrays import BoolArray, FloatArray
from seal_friction_ros.core.foundation.units import BAR
from seal_friction_ros.core.identification.candidate_laws import (
    CandidateLaw,
    Variation,
    law_of_all_terms,
    with_velocity_terms,
)
from seal_friction_ros.core.identification.diagnostics import LEVEL_SCATTER
from seal_friction_ros.core.identification.fitting import LawFit, fit
from seal_friction_ros.core.identification.readings import FrictionReadings, are_far_apart, has_pressures
from seal_friction_ros.core.identification.validation import CrossValidation, Ticks, cross_validate, predict

BEATEN_CONFIDENCE = 0.95  # of the test whether a law is beaten (our choice)
NEAR = 2.0  # a sound law is near if its loss is at most as many times that of the best (our choice)
RISES = 2.0  # standard errors of the rise over the pressures from which friction rises (our choice)
SPEEDS_DIFFER = 1.5  # fastest over slowest speed, from which velocity terms are tried (our choice)
FEWEST_PRESSURES_FOR_EXPONENT = 6  # with fewer, leaving each out in turn does not determine an exponent (our choice)
STRATA = 3  # quantiles of speed and of pressure, whose cells of a swept log are left out in turn (our choice)


def variation_of(readings: FrictionReadings) -> Variation:
    """What the readings vary.

    Speeds count where they differ by `SPEEDS_DIFFER` beyond what pressures and direction explain: speeds that follow
    these tell nothing apart. One direction has no asymmetry, and if each source holds one pressure, asymmetry is its
    offset.
    """
    several = [len(np.unique(readings.level[readings.source == source])) > 1 for source in np.unique(readings.source)]
    return Variation(
        pressures=_pressures(readings),
        speeds=_has_speeds(readings),
        asymmetry=any(several) and all(len(index) for index in readings.two_sided),
        exponent=readings.are_samples or len(readings.levels) >= FEWEST_PRESSURES_FOR_EXPONENT,
    )


def _has_speeds(readings: FrictionReadings) -> bool:
    """Whether speeds differ; for strokes, whether pressures and direction leave them as uneven as two that differ."""
    speed, side = np.abs(readings.at.velocity), readings.at.direction
    if not np.isfinite(speed).all():
        return False
    if readings.are_samples:
        low, high = np.quantile(speed, (0.05, 0.95))
        return bool(high > SPEEDS_DIFFER * low)
    causes = readings.at.pressure / BAR if readings.free_rod is None else np.empty((readings.count, 0))
    even = np.column_stack((np.ones(readings.count), causes))
    columns = np.column_stack((even, even * side[:, np.newaxis]))
    rest = speed - columns @ np.linalg.lstsq(columns, speed, rcond=1e-9)[0]
    return float(rest.std()) > (SPEEDS_DIFFER - 1.0) / (SPEEDS_DIFFER + 1.0) * float(speed.mean())


def _pressures(readings: FrictionReadings) -> int:
    """Pressures that tell something of the friction: up to 3; 0 if they are its effect."""
    if readings.free_rod is not None:
        return 0
    if has_pressures(readings):
        return 3
    return min(len(readings.levels), 2) if are_far_apart(readings.seal_pressure) else 1


def rises_over_pressures(readings: FrictionReadings) -> bool:
    """Whether a line through the friction at three held pressures at least rises beyond what pressures scatter by.

    That is `RISES` standard errors of the slope, with the scatter `LEVEL_SCATTER` of the friction at each pressure.
    """
    if readings.are_samples or len(readings.levels) < 3:
        return False
    pressure, friction = readings.level_pressures, readings.half_ranges[0]
    if (friction <= 0.0).any():
        return False
    centred = pressure - pressure.mean()
    return float(centred @ friction) > RISES * LEVEL_SCATTER * float(friction.mean() * np.linalg.norm(centred))


@dataclass(frozen=True, eq=False)
class LawScore:
    """Fit and cross-validation of a law."""

    law: CandidateLaw
    fit: LawFit
    validation: CrossValidation
    losses: FloatArray
    """in each group, and for swept logs in each stratum of speed and pressure and in each file [-]"""

    @property
    def mean_loss(self) -> float:
        """Mean loss over the groups [-]."""
        return float(self.losses.mean())


class NotScored(NamedTuple):
    """A law that could not be fitted."""

    law: CandidateLaw
    why_not: str


Scores = Sequence[LawScore | NotScored]


def scored(scores: Scores) -> list[LawScore]:
    """The laws that could be fitted. ValueError: there is none; with the reasons."""
    found = [score for score in scores if isinstance(score, LawScore)]
    if not found:
        reasons = '; '.join(f'{score.law.name}: {score.why_not}' for score in scores if isinstance(score, NotScored))
        raise ValueError(f'no law could be fitted: {reasons}')
    return found


def score_ladder(
    laws: Sequence[CandidateLaw], readings: FrictionReadings, variation: Variation, tick: Ticks = lambda _: None
) -> tuple[LawScore | NotScored, ...]:
    """Score every law, then the best law that depends on pressure again with velocity terms; from simple to complex.

    Several kinds of seals have the law of all terms alone.
    """
    if readings.kinds:
        return score_laws([law_of_all_terms(variation, readings.kinds)], readings, tick)
    scores = score_laws(laws, readings, tick)
    rising = [score for score in scores if isinstance(score, LawScore) and score.law.depends_on_pressure]
    if not rising:
        return (*scores, *score_laws([law_of_all_terms(variation)] * (variation.pressures == 0), readings, tick))
    sound = [score for score in rising if not score.fit.why_unsound]
    best = min(sound or rising, key=_mean_loss)
    more = [*with_velocity_terms(best.law, variation), *[law_of_all_terms(variation)] * (variation.pressures == 3)]
    return (*scores, *score_laws(more, readings, tick))


def score_laws(
    laws: Sequence[CandidateLaw], readings: FrictionReadings, tick: Ticks = lambda _: None
) -> tuple[LawScore | NotScored, ...]:
    """Fit and cross-validate every law on readings of at least two groups.

    The laws go from simple to complex; results of simpler laws are start values for the others. ``tick`` is called with
    1 after each law.
    """
    scores: list[LawScore | NotScored] = []
    start_values: dict[str, float] = {}
    others = regroupings(readings)
    for law in laws:
        levels, count = len(readings.levels), len(law.parameters) - len(law.velocity_terms)
        needed = count + (readings.left_out_by == 'pressure')
        if not readings.are_samples and not law.has_prior and levels < needed:
            scores.append(NotScored(law, f'{count} parameters need {needed} pressures, there are {levels}'))
        else:
            try:
                found = fit(law, readings, start_values)
                validation = cross_validate(law, readings, found.values)
                more = [cross_validate(law, other, found.values).losses for other in others]
            except ValueError as error:
                scores.append(NotScored(law, str(error)))
            else:
                scores.append(LawScore(law, found, validation, np.concatenate((validation.losses, *more))))
                start_values |= found.values
        tick(1)
    return tuple(scores)


def regroupings(readings: FrictionReadings) -> list[FrictionReadings]:
    """Samples of swept logs with other groups: cells of speed and pressure, and files if there are several.

    Contiguous blocks of one log all hold the same motions. A cell that is left out asks whether the law extrapolates.
    """
    if not readings.are_samples:
        return []
    cell = np.zeros(readings.count, dtype=np.int64)
    for values in (np.abs(readings.at.velocity), readings.seal_pressure):
        edges = np.quantile(values, np.linspace(0.0, 1.0, STRATA + 1)[1:-1])
        cell = cell * STRATA + np.searchsorted(edges, values)
    groups = [cell] if len(np.unique(cell)) > 1 else []
    if len(readings.names) > 1:
        groups.append(readings.source)
    return [replace(readings, group=group) for group in groups]


def recommended(scores: Scores, *, rises: bool = False) -> LawScore:
    """The simplest law that the best law (smallest mean loss) does not beat.

    Laws whose parameters are at a bound or ill-conditioned only compete if no sound law is `NEAR`. Where friction
    ``rises`` (`rises_over_pressures`), a law without pressure and speed does not compete. Of laws with equally many
    parameters the one with the smallest mean loss is taken. ValueError: no law was fitted.

    Source: after the one-standard-error rule of [Breiman1984]_; the rest is our choice.
    """
    left = scored(scores)
    if rises:
        left = [score for score in left if score.law.depends_on_pressure or score.law.velocity_terms] or left
    least = min(map(_mean_loss, left))
    sound = [score for score in left if not score.fit.why_unsound]
    if sound and min(map(_mean_loss, sound)) <= NEAR * least:
        left = sound
    best = min(left, key=_mean_loss)
    if best.law.has_prior and all(
        best.mean_loss < (1.0 - worthwhile(best.losses)) * other.mean_loss for other in left if other is not best
    ):
        return best
    left = [score for score in left if not score.law.has_prior] or left
    best = min(left, key=_mean_loss)
    left = [score for score in left if not is_beaten(score.losses, best.losses)]
    fewest = min(len(score.law.parameters) for score in left)
    return min((score for score in left if len(score.law.parameters) == fewest), key=_mean_loss)


def _mean_loss(score: LawScore) -> float:
    return score.mean_loss


def worthwhile(losses: FloatArray) -> float:
    """Share of the loss that is worth a term [-]: one that tells nothing changes the square of n losses by 1/n."""
    return 0.5 / len(losses)


def is_beaten(losses: FloatArray, others: FloatArray) -> bool:
    """Whether the losses of another law are lower beyond the noise, and by enough to justify a term.

    Beyond the noise: by a one-sided paired t-test at `BEATEN_CONFIDENCE`. Enough: `worthwhile`. Losses are those of
    each group, shape (groups >= 2,).
    """
    difference = losses - others
    groups = len(difference)
    error = float(difference.std(ddof=1)) / math.sqrt(groups)
    noise = float(stdtrit(groups - 1, BEATEN_CONFIDENCE)) * error
    return float(difference.mean()) > max(noise, worthwhile(losses) * float(losses.mean()))


class ChosenAnew(NamedTuple):
    """Prediction of each group by a law that was chosen and fitted without it."""

    predicted: FloatArray  # [N] shape (n,); NaN where no law could be chosen
    laws: tuple[str, ...]  # name of the law without each group; '' where none could be chosen


class LeftOut(NamedTuple):
    """Prediction of one group by a law that was chosen and fitted without it."""

    predicted: FloatArray  # [N] shape (readings of the group,); NaN where no law could be chosen
    law: str  # its name; '' where none could be chosen


Chosen = Callable[[Sequence[Callable[[], LeftOut]]], Sequence[LeftOut]]
"""runs independent calls and returns their results in order"""


def choose_anew(
    readings: FrictionReadings,
    choose: Callable[[FrictionReadings], LawScore],
    run: Chosen = lambda calls: list(map(operator.call, calls)),
) -> ChosenAnew:
    """Predict each group by the law that ``choose`` recommends for the other groups.

    Unlike `cross_validate`, which fits a given law anew, the choice of the law has not seen the group either. ``run``
    computes the groups, which are independent of each other.

    Source: nested cross-validation, [VarmaSimon2006]_.
    """
    groups = list(readings.groups)
    found = run([partial(choose_without, readings, out, choose) for out in groups])
    predicted = np.full(readings.count, np.nan)
    for out, one in zip(groups, found, strict=True):
        predicted[out] = one.predicted
    return ChosenAnew(predicted, tuple(one.law for one in found))


def choose_without(
    readings: FrictionReadings, out: BoolArray, choose: Callable[[FrictionReadings], LawScore]
) -> LeftOut:
    """Predict the readings ``out`` by the law that ``choose`` recommends for the others."""
    others, left_out = readings.without(out), readings.taken(out)
    try:
        chosen = choose(others)
    except ValueError:
        return LeftOut(np.full(left_out.count, np.nan), '')
    _, predicted, _ = predict(chosen.law, others, left_out, chosen.fit.values)
    return LeftOut(predicted, chosen.law.name)


def collinear_spread(scores: Scores, selected: LawFit, readings: FrictionReadings) -> float:
    """Relative spread of laws that fit nearly as well, where speed and pressure part [-]: the data cannot tell them.

    Sound laws within `NEAR` of the best are compared at every pair of a speed and a pressure (quartiles of each), also
    pairs that never occurred: where speed and pressure always changed together, laws agree on the readings and differ
    there. The spread is the root mean square deviation from the ``selected`` law. 0 for held readings.
    """
    if not readings.are_samples:
        return 0.0
    fitted = scored(scores)
    least = min(map(_mean_loss, fitted))
    near = [score.fit for score in fitted if score.mean_loss <= NEAR * least and not score.fit.why_unsound]
    shares = (0.125, 0.375, 0.625, 0.875)
    speeds = np.quantile(np.abs(readings.at.velocity), shares)
    order = np.argsort(readings.seal_pressure)
    rows = order[(np.array(shares) * (len(order) - 1)).astype(int)]
    at = readings.taken(np.tile(rows, 2 * len(speeds))).at
    direction = np.repeat([1.0, -1.0], len(rows) * len(speeds))
    at = at._replace(velocity=direction * np.tile(np.repeat(speeds, len(rows)), 2), direction=direction)
    chosen = selected.friction(at)
    deviations = [(fit.friction(at) - chosen) / chosen.mean() for fit in near]
    return float(np.sqrt(np.mean(np.square(deviations)))) if deviations else 0.0
