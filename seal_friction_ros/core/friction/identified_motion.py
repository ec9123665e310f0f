"""Speeds and directions of sliding in which a friction law was identified."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from seal_friction_ros.core.foundation.parameters import CheckedParameters, parameter

SPEED_MARGIN = 0.1  # [-] our choice: up to this share beyond its ends a speed counts as identified


@dataclass(frozen=True)
class IdentifiedMotion(CheckedParameters):
    """Motions in which one seal was measured; the default is any.

    ValueError: a speed is out of bounds, the highest is below the lowest, or a direction is neither -1 nor 1.
    """

    slowest: float = parameter(0.0, unit='m/s', lower=0.0, upper=1e3, description='Lowest speed identified.')
    fastest: float = parameter(1e3, unit='m/s', lower=1e-9, upper=1e3, description='Highest speed identified.')
    directions: tuple[int, ...] = parameter((-1, 1), unit='', description='1: extension, -1: retraction.')

    def __post_init__(self) -> None:
        super().__post_init__()
        self.check_order('fastest', 'slowest', may_be_equal=True)
        if sorted(self.directions) not in ([-1], [1], [-1, 1]):
            raise ValueError(f'IdentifiedMotion.directions = {list(self.directions)} is not [-1], [1] or [-1, 1]')


ANY_MOTION = IdentifiedMotion()


class MotionLimits(NamedTuple):
    """Motions in which every seal of an actuator was measured, `SPEED_MARGIN` included, as numbers."""

    slowest: float  # [m/s]
    fastest: float  # [m/s]
    extends: bool
    retracts: bool


def motion_limits(motions: Sequence[IdentifiedMotion]) -> MotionLimits:
    """Limits from the identified motion of each seal: what one seal was not measured in, the actuator was not."""
    return MotionLimits(
        slowest=max(motion.slowest for motion in motions) * (1.0 - SPEED_MARGIN),
        fastest=min(motion.fastest for motion in motions) * (1.0 + SPEED_MARGIN),
        extends=all(1 in motion.directions for motion in motions),
        retracts=all(-1 in motion.directions for motion in motions),
    )
