"""Several seals on one spool: each is computed alone, and their frictions are added (paper, section 6.4)."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from seal_friction_ros.core.foundation.arrays import BoolArray, FloatArray
from seal_friction_studies.core.kinematics import SpoolMotion
from seal_friction_studies.core.study_case import SpoolSeal
from seal_friction_studies.core.transient import TransientResult, last_cycle


class SpoolSealMotion:
    """Motion of the spool in the frame of one seal: shifted, and reversed if the seal is mirrored."""

    def __init__(self, motion: SpoolMotion, member: SpoolSeal) -> None:
        self._motion, self._member = motion, member

    @property
    def duration(self) -> float:
        """Time the motion takes [s]."""
        return self._motion.duration

    def position(self, time: float) -> float:
        """Position [m] in the frame of the case at ``time`` [s]."""
        place = self._motion.position(time)
        return self._member.shift + (-place if self._member.mirrored else place)


class SpoolResult(NamedTuple):
    """Friction of a spool over its motion; arrays with one entry per step."""

    time: FloatArray  # [s]
    position: FloatArray  # of the spool [m]
    friction: FloatArray  # of all seals [N], with the sign of the velocity it resists
    members: FloatArray  # of each seal [N], shape (seals, steps)
    last_cycle: BoolArray  # whether each step is in the last cycle


class SpoolStroke(NamedTuple):
    """Friction of a spool on its last stroke in one direction, magnitudes."""

    peak: float  # largest [N]
    level: float  # median while the spool is within 1 % of its highest speed [N]
    peak_position: float  # of the spool [m]


def stroke_friction(result: SpoolResult, direction: float) -> SpoolStroke:
    """Peak and level of the friction of a spool while it moves in a ``direction``, 1.0 or -1.0.

    The paper compares its peaks with the friction before and after them (section 6.4); the median over the stroke is
    that level, since the peaks are short (our choice).

    Raises:
        ValueError: The spool does not move in that direction.
    """
    speed = direction * np.gradient(result.position, result.time)
    moving = np.flatnonzero(result.last_cycle & (speed > 0.0))
    if not len(moving):
        raise ValueError(f'stroke_friction: the spool does not move in direction {direction:g}')
    friction = np.abs(result.friction)
    fast = moving[speed[moving] >= 0.99 * speed[moving].max()]
    at_peak = moving[friction[moving].argmax()]
    return SpoolStroke(float(friction[at_peak]), float(np.median(friction[fast])), float(result.position[at_peak]))


def superposed(members: Sequence[SpoolSeal], runs: Sequence[TransientResult]) -> SpoolResult:
    """Sum of the frictions of the seals of a spool, from the run of each with its `SpoolSealMotion`.

    Raises:
        ValueError: The runs do not share their times.
    """
    first = runs[0]
    if any(len(run.time) != len(first.time) or not np.allclose(run.time, first.time) for run in runs):
        raise ValueError('superposed: the seals have different time steps: give their cases the same')
    frictions = np.array([-run.friction if m.mirrored else run.friction for m, run in zip(members, runs, strict=True)])
    position = (first.position - members[0].shift) * (-1.0 if members[0].mirrored else 1.0)
    return SpoolResult(first.time, position, frictions.sum(axis=0), frictions, last_cycle(first))
