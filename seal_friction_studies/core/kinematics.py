"""Position of the spool over time: constant acceleration as in the paper, or a measured signal."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Protocol

import numpy as np

from seal_friction_ros.core.foundation.parameters import parameter
from seal_friction_ros.core.lubrication.lubrication_case import ReferenceMotion


class SpoolMotion(Protocol):
    """Position over time; velocity follows from it step by step."""

    @property
    def duration(self) -> float:
        """Time the motion takes [s]."""
        ...

    def position(self, time: float) -> float:
        """Position [m] at ``time`` [s], 0 to ``duration``."""
        ...


@dataclass(frozen=True)
class ConstantAcceleration(ReferenceMotion):
    """Reciprocation about ``centre`` without dwell: acceleration, constant speed, deceleration, and return.

    Defaults: Table 1 of the spool-valve paper.

    Raises:
        ValueError: A value is out of bounds, or the speed is not reached within the distance.
    """

    distance: float = parameter(1.8e-3, unit='m', lower=1e-6, upper=10.0, description='Stroke, end to end, s_max.')
    acceleration: float = parameter(
        0.68, unit='m/s2', lower=1e-4, upper=1e5, description='Magnitude at both ends, a_const.'
    )
    cycles: int = parameter(2, unit='1', lower=1, upper=1000, description='Number of cycles; the last is evaluated.')
    centre: float = parameter(0.0, unit='m', lower=-10.0, upper=10.0, description='Middle of the stroke.')

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.speed**2 / self.acceleration > self.distance:
            raise ValueError(
                f'ConstantAcceleration.speed = {self.speed} m/s is not reached within distance = {self.distance} m '
                f'at acceleration = {self.acceleration} m/s2'
            )

    @property
    def stroke_time(self) -> float:
        """Time from end to end [s]."""
        return self.distance / self.speed + self.speed / self.acceleration

    @property
    def duration(self) -> float:
        """Time of all cycles [s]."""
        return 2.0 * self.cycles * self.stroke_time

    def position(self, time: float) -> float:
        """Position [m] at ``time`` [s], 0 to ``duration``; at 0 it stands at its left end."""
        stroke, inside = divmod(min(max(time, 0.0), self.duration), self.stroke_time)
        way = self._way(inside)
        forth = int(stroke) % 2 == 0
        return self.centre - 0.5 * self.distance + (way if forth else self.distance - way)

    def _way(self, time: float) -> float:
        """Way from one end [m] at a ``time`` since leaving it [s]."""
        speed_up = self.speed / self.acceleration
        left = self.stroke_time - time
        if time < speed_up:
            return 0.5 * self.acceleration * time * time
        if left < speed_up:
            return self.distance - 0.5 * self.acceleration * left * left
        return self.speed * (time - 0.5 * speed_up)


class MeasuredMotion:
    """Measured position, linear between its samples.

    Args:
        times: Increasing [s], shape (n,), n >= 2; the motion starts at the first.
        positions: [m], shape (n,).

    Raises:
        ValueError: The samples are too few, not finite, or not in order of time.
    """

    def __init__(self, times: Sequence[float], positions: Sequence[float]) -> None:
        if len(times) != len(positions) or len(times) < 2:
            raise ValueError(
                f'MeasuredMotion: {len(times)} times and {len(positions)} positions: give two or more of each'
            )
        if not all(math.isfinite(value) for value in (*times, *positions)):
            raise ValueError('MeasuredMotion: not every time and position is finite')
        if any(later <= earlier for earlier, later in pairwise(times)):
            raise ValueError('MeasuredMotion: times do not increase')
        self._times = np.asarray(times, dtype=float) - times[0]
        self._positions = np.asarray(positions, dtype=float)

    @property
    def duration(self) -> float:
        """Time the motion takes [s]."""
        return float(self._times[-1])

    def position(self, time: float) -> float:
        """Position [m] at ``time`` [s]; constant beyond both ends."""
        return float(np.interp(time, self._times, self._positions))
