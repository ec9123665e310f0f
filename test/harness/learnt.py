"""States of the adaptation that know what a test wants them to."""

from typing import Any

from seal_friction_ros.core.estimation.adaptation import AdaptationSettings, AdaptationState, outlook_of
from seal_friction_ros.core.estimation.estimator import DEFAULT_ADAPTATION
from seal_friction_ros.core.estimation.moving_mass import inertia_of


def learnt_state(
    state: AdaptationState, settings: AdaptationSettings = DEFAULT_ADAPTATION, **changes: Any
) -> AdaptationState:
    """``state`` with ``changes``, and the outlook that belongs to them."""
    state = state._replace(**changes)
    inertia = inertia_of(settings.moving_mass, state.mass)
    outlook = outlook_of(settings, inertia, state.filter, state.way, state.acceleration, False)
    return state._replace(outlook=outlook)
