"""Several seals on one spool: each is computed alone, and their frictions are added (paper, section 6.4)."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from seal_friction_ros.core.foundation.arrays import BoolArray, FloatArray
from seal_friction_ros.core.lubrication.kinematics import SpoolMotion
from seal_friction_ros.core.lubrication.lubrication_case import SpoolSeal
from seal_friction_ros.core.lubrication.transient import TransientResult, last_cycle


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
