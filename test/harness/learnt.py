"""States of the adaptation that know what a test wants them to."""

from typing import Any

from seal_friction_ros.core.estimation.adaptation import AdaptationSettings, AdaptationState, outlook_of
from seal_friction_ros.core.estimation.estimator import DEFAULT_ADAPTATION


def learnt_state(
    state: AdaptationState, settings: AdaptationSettings = DEFAULT_ADAPTATION, **changes: Any
) -> AdaptationState:
    """``state`` with ``changes``, and the outlook that belongs to them."""
    state = state._replace(**changes)
    outlook = outlook_of(
        settings, state.filter, state.way, settings.moving_mass * state.motion.acceleration, False, False
    )
    return state._replace(outlook=outlook)
