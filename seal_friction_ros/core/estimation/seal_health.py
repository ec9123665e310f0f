"""What the adaptation has seen so far, in a form that is read now and then: by diagnostics and by ``~/health``."""

from typing import NamedTuple

from seal_friction_ros.core.estimation.adaptation import AdaptationState
from seal_friction_ros.core.estimation.disagreement import Reversal, last_reversal, likely_reason
from seal_friction_ros.core.estimation.estimator import EstimatorParameters
from seal_friction_ros.core.estimation.friction_change import FrictionChange, watch
from seal_friction_ros.core.estimation.records import NEVER

KEPT_REVERSALS = 12  # for the likely reason


class SealHealth(NamedTuple):
    """Last reversals and the watch on them."""

    learnt: int = 0  # number of reversals followed
    reversals: tuple[Reversal, ...] = ()  # the last ones
    change: FrictionChange = FrictionChange()


def followed(known: SealHealth, state: AdaptationState) -> SealHealth:
    """Health after a sample; nothing is done but at a reversal that was learnt from."""
    learnt = state.learnt
    if learnt.reversals == known.learnt:
        return known
    if learnt.reversals < known.learnt:  # the adaptation was reset
        return SealHealth(learnt.reversals)
    newest = last_reversal(learnt)
    return SealHealth(
        learnt.reversals,
        (*known.reversals[1 - KEPT_REVERSALS :], newest),
        watch(known.change, newest.stamp, newest.ratio),
    )


def health_values(parameters: EstimatorParameters, state: AdaptationState, health: SealHealth) -> dict[str, str]:
    """Indicators as text, by name and unit."""
    learnt, change = state.learnt, health.change
    age = 'never' if state.learnt_stamp == NEVER else f'{(state.stamp - state.learnt_stamp) * 1e-9:.1f}'
    friction = f'{learnt.scale * learnt.level.friction:.4g}' if learnt.level.samples else 'none'
    return {
        'adaptation mode': parameters.adaptation.mode,
        'adaptation scale': f'{learnt.scale:.4f}',
        'adaptation scale std': 'not learnt' if learnt.scale_std < 0.0 else f'{learnt.scale_std:.4f}',
        'adaptation offset [N]': f'{learnt.offset:.4g}',
        'adaptation residual std [N]': 'not learnt' if learnt.noise < 0.0 else f'{learnt.noise:.4g}',
        'friction of this stroke [N]': friction,
        'reversals learnt from': str(learnt.reversals),
        'last learnt [s ago]': age,
        'changes of the friction': str(change.changes),
        'last change began [ns]': 'none' if change.changed_at == NEVER else str(change.changed_at),
    }


def findings(parameters: EstimatorParameters, health: SealHealth, disagrees: bool) -> list[str]:
    """What a person should know, in words; empty if all is well.

    Args:
        parameters: Of the estimator.
        health: As followed.
        disagrees: Whether the status of the estimate says MODEL_DISAGREES.
    """
    found = []
    if disagrees:
        found.append(likely_reason(parameters.seal_numbers, health.reversals))
    change = health.change
    if change.changes and change.reversals >= 5:  # our choice: a mean of fewer says little
        found.append(
            f'the friction has changed from {change.before:.2f} to {change.reference:.2f} times that of the file'
        )
    return [text for text in found if text]
