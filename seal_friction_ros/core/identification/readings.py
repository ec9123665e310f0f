"""Friction readings of one rig, to which a law is fitted, and the records that they are made from."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from seal_friction_ros.core.foundation.arrays import BoolArray, FloatArray, IntArray
from seal_friction_ros.core.identification.candidate_laws import OperatingConditions
from seal_friction_ros.core.identification.signal_preparation import HalfRange, Signals, Sliding, half_range


class RecordedLog(NamedTuple):
    """Signals of one source."""

    name: str
    signals: Signals
    sliding: Sliding


class ManualReadings(NamedTuple):
    """Readings of one source that a person wrote down; arrays of shape (n,)."""

    name: str
    test: IntArray
    pressure: FloatArray
    """[Pa, gauge]"""
    direction: IntArray
    """-1 or 1"""
    friction: FloatArray
    """[N] magnitude, of all seals"""
    velocity: FloatArray
    """[m/s] magnitude; NaN if not measured"""


@dataclass(frozen=True, eq=False)
class FrictionReadings:
    """n friction readings of one rig, from one or several sources."""

    at: OperatingConditions
    force: FloatArray
    """[N] force sum, signed, shape (n,)"""
    source: IntArray
    """index into ``names``, shape (n,)"""
    group: IntArray
    """readings of one group are left out together in cross-validation, shape (n,)"""
    level: IntArray
    """pressure level, 0 for the lowest, shape (n,)"""
    names: tuple[str, ...]
    """of the sources"""
    left_out_by: str
    """meaning of ``group``: test, pressure, file or block"""
    are_samples: bool
    """samples of a swept log; otherwise strokes or manual readings at held pressures"""
    samples: tuple[FloatArray, ...] = ()
    """[N] force sums behind each reading; empty if there is only the reading"""

    @property
    def count(self) -> int:
        """Number of readings."""
        return len(self.force)

    @property
    def seal_pressure(self) -> FloatArray:
        """Mean pressure of the seals [Pa, gauge, >= 0], shape (n,)."""
        return np.asarray(self.at.pressure.mean(axis=1))

    @cached_property
    def levels(self) -> dict[int, BoolArray]:
        """Pressure level -> mask of its readings, in increasing order of pressure."""
        return {int(level): self.level == level for level in np.unique(self.level)}

    @property
    def level_pressures(self) -> FloatArray:
        """Mean pressure of each level [Pa, gauge], shape (levels,)."""
        return np.array([self.seal_pressure[inside].mean() for inside in self.levels.values()])

    @cached_property
    def groups(self) -> list[BoolArray]:
        """Mask of the readings of each group."""
        return [self.group == group for group in np.unique(self.group)]

    def taken(self, index: BoolArray | IntArray) -> 'FrictionReadings':
        """The readings in ``index``."""
        where = np.arange(self.count)[index]
        return replace(
            self,
            at=self.at.taken(where),
            force=self.force[where],
            source=self.source[where],
            group=self.group[where],
            level=self.level[where],
            samples=tuple(self.samples[i] for i in where) if self.samples else (),
        )

    def magnitudes(self, offsets: FloatArray) -> FloatArray:
        """Measured friction [N], shape (n,): force sum without the offset of its source [N], along the direction."""
        return np.asarray(self.at.direction * (self.force - offsets[self.source]))

    def half_range(self, inside: BoolArray) -> HalfRange:
        """Friction and offset of the readings ``inside``: weighted mean over the sources, [N].

        For a source in one direction only, the friction is its mean magnitude and the offset is 0.
        """
        found, weights = [], []
        for source in np.unique(self.source[inside]):
            index = np.flatnonzero(inside & (self.source == source))
            direction, force = self.at.direction[index].astype(np.int64), self.force[index]
            if len(np.unique(direction)) < 2:
                found.append(HalfRange(float(np.mean(direction * force)), 0.0))
            elif self.samples:
                parts = [self.samples[i] for i in index]
                found.append(half_range(np.concatenate(parts), np.repeat(direction, [len(part) for part in parts])))
            else:
                found.append(half_range(force, direction, of_medians=False))
            weights.append(len(index))
        friction, offset = np.average(np.array(found), axis=0, weights=weights)
        return HalfRange(float(friction), float(offset))

    def frictions_of_sources(self, inside: BoolArray) -> dict[int, float]:
        """Source -> friction of its readings ``inside`` [N]."""
        sources = np.unique(self.source[inside])
        return {int(source): self.half_range(inside & (self.source == source)).friction for source in sources}

    @cached_property
    def scale(self) -> FloatArray:
        """Divisor of each deviation in the fit [N], shape (n,).

        It is the mean force for samples of a swept log, and the friction at the pressure for readings at held
        pressures, whose scatter is proportional to the friction.
        """
        if self.are_samples:
            return np.full(self.count, max(float(np.abs(self.force).mean()), 1e-12))
        result = np.empty(self.count)
        for inside in self.levels.values():
            result[inside] = max(abs(self.half_range(inside).friction), 1e-12)
        return result

    @cached_property
    def two_sided(self) -> tuple[IntArray, ...]:
        """Indices of the readings of each source; empty for a source in one direction only."""
        of_source = [np.flatnonzero(self.source == source) for source in range(len(self.names))]
        return tuple(index if len(np.unique(self.at.direction[index])) == 2 else index[:0] for index in of_source)


class PreparedReadings(NamedTuple):
    """Readings of all sources."""

    readings: FrictionReadings
    chamber_pressures: FloatArray
    """[Pa] of chambers a and b at each reading, shape (n, 2)"""
    breakaway: FrictionReadings | None
    """None if no motion starts from rest"""
    used: dict[str, int]
    """source -> number of samples behind the readings"""
    total: dict[str, int]
    """source -> number of its samples"""
    left_out: dict[str, int]
    """reason -> number of samples not used"""
