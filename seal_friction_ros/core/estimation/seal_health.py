"""What the adaptation has seen so far, in a form that is read now and then: by diagnostics and by ``~/health``."""

import math
from typing import NamedTuple

from seal_friction_ros.core.estimation.adaptation import FEWEST_SAMPLES, AdaptationState
from seal_friction_ros.core.estimation.disagreement import (
    Reversal,
    Stroke,
    input_fault,
    last_reversal,
    likely_reason,
    reversal_between,
)
from seal_friction_ros.core.estimation.estimator import EstimatorParameters, EstimatorState, temperature_in_use
from seal_friction_ros.core.estimation.friction_change import REFERENCE_REVERSALS, FrictionChange, watch
from seal_friction_ros.core.estimation.records import (
    NEVER,
    NO_TEMPERATURE,
    FrictionEstimate,
    SealTemperature,
    Status,
)
from seal_friction_ros.core.friction.actuator import at_temperature, friction_of_seals
from seal_friction_ros.core.friction.states import SLIDING

KEPT_REVERSALS = 60  # for the likely reason
FEWEST_OF_REFERENCE = 5  # reversals (our choice): a mean of fewer says little
REST = 500_000_000  # [ns] our choice: after a rest of this length a start counts as a breakaway
START = 100_000_000  # [ns] our choice: the friction of a start is the largest within this time


class Starts(NamedTuple):
    """Friction of the starts after a rest, over the Coulomb friction then."""

    resting_since: int = NEVER  # [ns]
    began: int = NEVER  # [ns] of the start that is under way
    largest: float = 0.0  # [-] of it so far; at rest: of the newest estimate
    number: int = 0
    mean: float = 0.0  # [-]
    squares: float = 0.0  # [-] sum of squared deviations

    @property
    def std(self) -> float:
        """Standard deviation of the mean [-]; NaN of fewer than two starts."""
        return math.sqrt(self.squares / (self.number - 1) / self.number) if self.number > 1 else math.nan


def with_sample(starts: Starts, estimate: FrictionEstimate) -> Starts:
    """Starts after one more estimate of an adapting estimator.

    The friction of a start is force sum less offset and inertia: friction force plus residual. The last estimate at
    rest counts, too: the force is largest just before the rod moves.
    """
    resting_since, began, largest, number, mean, squares = starts
    coulomb = estimate.coulomb_friction
    seen = abs(estimate.friction_force + estimate.residual) / coulomb if coulomb > 0.0 else 0.0
    if estimate.state != SLIDING:
        since = estimate.stamp if resting_since == NEVER else resting_since
        return Starts(since, NEVER, seen, number, mean, squares)
    if began == NEVER:
        if resting_since == NEVER:
            return starts
        if estimate.stamp - resting_since < REST:
            return Starts(NEVER, NEVER, 0.0, number, mean, squares)
        began = estimate.stamp
    if estimate.stamp - began <= START:
        return Starts(NEVER, began, max(largest, seen), number, mean, squares)
    deviation = largest - mean
    mean += deviation / (number + 1)
    return Starts(NEVER, NEVER, 0.0, number + 1, mean, squares + deviation * (largest - mean))


class SealHealth(NamedTuple):
    """Last reversals and the watch on them."""

    learnt: int = 0  # number of reversals followed
    reversals: tuple[Reversal, ...] = ()  # the last ones
    change: FrictionChange = FrictionChange()
    first: float = 0.0  # [-] mean ratio of the first `REFERENCE_REVERSALS`; NaN if they were not followed
    stroke: Stroke | None = None  # the last one, if the scale was not learnt from it


def followed(
    known: SealHealth,
    parameters: EstimatorParameters,
    before: EstimatorState,
    state: EstimatorState,
    temperature: SealTemperature = NO_TEMPERATURE,
) -> SealHealth:
    """Health after a sample; nothing is done but at a reversal.

    Args:
        known: Before the sample.
        parameters: Of the estimator.
        before: State before the sample.
        state: State after it.
        temperature: Of the seals.
    """
    last, learnt = before.adaptation.learnt, state.adaptation.learnt
    if learnt.direction == last.direction and learnt.reversals == known.learnt:
        return known
    if learnt.reversals < known.learnt:  # the adaptation was reset
        return SealHealth(learnt.reversals)
    if learnt.reversals == known.learnt:
        return _with_stroke(known, parameters, before, temperature)
    newest = last_reversal(learnt)
    number = learnt.reversals
    first = known.first + (newest.ratio - known.first) / number if number <= REFERENCE_REVERSALS else known.first
    if number != known.learnt + 1:  # learnt before this node began
        first = math.nan
    return SealHealth(
        learnt.reversals,
        (*known.reversals[1 - KEPT_REVERSALS :], newest),
        watch(known.change, newest.stamp, newest.ratio),
        first,
    )


def _with_stroke(
    known: SealHealth, parameters: EstimatorParameters, before: EstimatorState, temperature: SealTemperature
) -> SealHealth:
    """Health after a stroke that the scale was not learnt from: outside the identified range its level is empty."""
    learnt, pressure = before.adaptation.learnt, before.pressure
    if learnt.direction == 0 or learnt.level.samples or learnt.samples < FEWEST_SAMPLES:
        return known._replace(stroke=None)
    law = friction_of_seals(parameters.seal_numbers, pressure.chamber_a, pressure.chamber_b, before.velocity.velocity)
    if parameters.has_temperature_scale:
        scale = parameters.temperature_scale
        law = at_temperature(law, scale, temperature_in_use(scale, temperature))
    friction = law.coulomb_friction + law.velocity_friction
    reading = learnt.scale * friction * learnt.direction + learnt.offset
    stroke = Stroke(before.stamp, learnt.direction, reading, friction, pressure.chamber_a, pressure.chamber_b)
    reversal = None if known.stroke is None else reversal_between(known.stroke, stroke)
    if reversal is None:
        return known._replace(stroke=stroke)
    return known._replace(stroke=stroke, reversals=(*known.reversals[1 - KEPT_REVERSALS :], reversal))


def health_values(
    parameters: EstimatorParameters, state: AdaptationState, health: SealHealth, starts: Starts
) -> dict[str, str]:
    """Indicators as text, by name and unit.

    Friction that differs in the two directions cannot be told from a constant load: both are the offset. So the offset
    is given over the friction.
    """
    learnt, change = state.learnt, health.change
    age = 'never' if state.learnt_stamp == NEVER else f'{(state.stamp - state.learnt_stamp) * 1e-9:.1f}'
    of_stroke = learnt.scale * learnt.level.friction if learnt.level.samples else 0.0
    first = health.first if learnt.reversals >= REFERENCE_REVERSALS else 0.0
    return {
        'adaptation mode': parameters.adaptation.mode,
        'adaptation scale': f'{learnt.scale:.4f}',
        'adaptation scale std': 'not learnt' if learnt.scale_std < 0.0 else f'{learnt.scale_std:.4f}',
        'adaptation offset [N]': f'{learnt.offset:.4g}',
        'adaptation residual std [N]': 'not learnt' if learnt.noise < 0.0 else f'{learnt.noise:.4g}',
        'friction of this stroke [N]': f'{of_stroke:.4g}' if of_stroke else 'none',
        'offset over friction': f'{learnt.offset / of_stroke:.3f}' if of_stroke else 'none',
        'residual std over friction': f'{learnt.noise / of_stroke:.3f}' if of_stroke else 'none',
        'scale over that of the first reversals': f'{learnt.scale / first:.4f}' if first > 0.0 else 'none',
        'starts after a rest': str(starts.number),
        'start over Coulomb friction': f'{starts.mean:.3f}' if starts.number else 'none',
        'start over Coulomb friction std': f'{starts.std:.3f}' if starts.number > 1 else 'none',
        'reversals learnt from': str(learnt.reversals),
        'last learnt [s ago]': age,
        'changes of the friction': str(change.changes),
        'last change began [ns]': 'none' if change.changed_at == NEVER else str(change.changed_at),
    }


def findings(parameters: EstimatorParameters, health: SealHealth, status: int) -> list[str]:
    """What a person should know, in words; empty if all is well.

    Args:
        parameters: Of the estimator.
        health: As followed.
        status: Bits of `Status` of the last estimates.
    """
    found = []
    if status & Status.MODEL_DISAGREES:
        found.append(likely_reason(parameters.seal_numbers, health.reversals))
    elif status & Status.OUTSIDE_IDENTIFIED_RANGE:
        found.append(input_fault(parameters.seal_numbers, health.reversals))
    change = health.change
    if change.changes and change.reversals >= FEWEST_OF_REFERENCE:
        found.append(
            f'the friction has changed from {change.before:.2f} to {change.reference:.2f} times that of the file'
        )
    return [text for text in found if text]
