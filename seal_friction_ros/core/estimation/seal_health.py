"""What the adaptation has seen so far, in a form that is read now and then: by diagnostics and by ``~/health``."""

import math
from typing import NamedTuple

from seal_friction_ros.core.estimation.adaptation import AdaptationState, learnt
from seal_friction_ros.core.estimation.disagreement import Reversal, input_fault, likely_reason, reversal_between
from seal_friction_ros.core.estimation.estimator import EstimatorParameters, EstimatorState
from seal_friction_ros.core.estimation.friction_change import REFERENCE_REVERSALS, FrictionChange, watch
from seal_friction_ros.core.friction.states import SLIDING
from seal_friction_ros.core.messages.records import NEVER, FrictionEstimate, Status

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
    resting_since, began, largest = starts.resting_since, starts.began, starts.largest
    number, mean, squares = starts.number, starts.mean, starts.squares
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


def followed(
    known: SealHealth,
    before: EstimatorState,
    state: EstimatorState,
) -> SealHealth:
    """Health after a sample; nothing is done but at a reversal.

    Args:
        known: Before the sample.
        before: State before the sample.
        state: State after it.
    """
    last, now = before.adaptation.strokes, state.adaptation.strokes
    if now.present.direction == last.present.direction and now.reversals == known.learnt:
        return known
    if now.reversals < known.learnt:  # the adaptation was reset
        return SealHealth(now.reversals)
    pressure = before.pressure
    newest = reversal_between(last.before, now.before, pressure.chamber_a, pressure.chamber_b)
    reversals = known.reversals if newest is None else (*known.reversals[1 - KEPT_REVERSALS :], newest)
    if now.reversals == known.learnt:  # outside the identified range
        return known._replace(reversals=reversals)
    number = now.reversals
    first = known.first + (now.ratio - known.first) / number if number <= REFERENCE_REVERSALS else known.first
    if number != known.learnt + 1:  # learnt before this node began
        first = math.nan
    return SealHealth(number, reversals, watch(known.change, now.before.stamp, now.ratio), first)


def health_values(
    parameters: EstimatorParameters, state: AdaptationState, health: SealHealth, starts: Starts
) -> dict[str, str]:
    """Indicators as text, by name and unit.

    Friction that differs in the two directions cannot be told from a constant load: both are the offset. So the offset
    is given over the friction.
    """
    known, change = learnt(state), health.change
    age = 'never' if state.filter.stamp == NEVER else f'{(state.stamp - state.filter.stamp) * 1e-9:.1f}'
    friction = known.scale * known.friction
    first = health.first if known.reversals >= REFERENCE_REVERSALS else 0.0
    return {
        'adaptation mode': parameters.adaptation.mode,
        'adaptation scale': f'{known.scale:.4f}',
        'adaptation scale std': 'not learnt' if known.scale_std < 0.0 else f'{known.scale_std:.4f}',
        'adaptation offset [N]': f'{known.offset:.4g}',
        'adaptation residual std [N]': 'not learnt' if known.noise < 0.0 else f'{known.noise:.4g}',
        'friction of this stroke [N]': f'{friction:.4g}' if friction else 'none',
        'offset over friction': f'{known.offset / friction:.3f}' if friction else 'none',
        'residual std over friction': f'{known.noise / friction:.3f}' if friction else 'none',
        'scale over that of the first reversals': f'{known.scale / first:.4f}' if first > 0.0 else 'none',
        'starts after a rest': str(starts.number),
        'start over Coulomb friction': f'{starts.mean:.3f}' if starts.number else 'none',
        'start over Coulomb friction std': f'{starts.std:.3f}' if starts.number > 1 else 'none',
        'reversals learnt from': str(known.reversals),
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
