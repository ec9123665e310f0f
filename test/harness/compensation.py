"""A feed-forward with a force: the default scale is 0, which makes none."""

from dataclasses import replace
from typing import Any

from seal_friction_ros.core.estimation.configuration import Configuration, SealSelection
from seal_friction_ros.core.estimation.estimator import EstimatorSettings
from seal_friction_ros.core.estimation.feedforward import FeedForwardSettings
from seal_friction_ros.files import load_configuration

SCALE = 0.9
"""Share of the friction that is compensated."""
COMPENSATING = FeedForwardSettings(scale=SCALE)
REAL_SEALS = ('ms28775_114', 'ms28775_114')
"""Seals with the law of the placeholder: a live node makes no force from placeholder seals."""
LIVE: dict[str, Any] = {'seals': list(REAL_SEALS), 'feedforward.scale': SCALE}
"""Parameters of a live node with a force."""


def compensating(settings: EstimatorSettings | None = None, **changes: Any) -> Configuration:
    """The default configuration with a force.

    Args:
        settings: Of the estimator; default: the default ones.
        changes: Settings of the feed-forward.
    """
    return load_configuration(SealSelection(), settings or EstimatorSettings(), replace(COMPENSATING, **changes))
