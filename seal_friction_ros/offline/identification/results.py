"""Records of an identification, from the data it uses to the document it makes."""

from dataclasses import dataclass
from typing import Any, NamedTuple

from seal_friction_ros.core.friction.geometry import SealGeometry
from seal_friction_ros.core.identification.fitting import (
    Change,
    CrossValidation,
    Fit,
    Outlier,
    Score,
    Spread,
    Stiction,
)
from seal_friction_ros.core.identification.ladder import Rung
from seal_friction_ros.core.identification.readings import Prepared, Readings
from seal_friction_ros.core.identification.signal_preparation import OffsetLine
from seal_friction_ros.offline.identification.sources import Sources

FEWEST_PRESSURES_FOR_EXPONENT = 6  # with fewer, leaving each out in turn does not determine an exponent (our choice)


class Ring(NamedTuple):
    """Ring of known geometry."""

    geometry: SealGeometry
    normal_force: dict[str, Any]
    """section ``normal_force`` of a seal file"""


@dataclass(frozen=True, eq=False)
class IdentificationData:
    """Readings that the law is fitted to, and those that are excluded."""

    sources: Sources
    prepared: Prepared
    """every reading of the sources that agree, including outliers"""
    used: Readings
    """without outliers"""
    ring: Ring | None
    outlier: Outlier | None
    changes: tuple[Change, ...]
    """each further swept log against the law of the first one"""
    kept: tuple[int, ...]
    """numbers of the sources behind ``prepared``"""

    def is_outlier(self, level: int) -> bool:
        """Whether a pressure level is the outlier, which the law is not fitted to."""
        return self.outlier is not None and level == self.outlier.level


@dataclass(frozen=True, eq=False)
class LawSelection:
    """All laws of the ladder with their scores, and the law that is saved."""

    scores: tuple[Score, ...]
    best: Score
    """recommended: the lowest rung that no other beats beyond the noise"""
    fit: Fit
    validation: CrossValidation
    reference: CrossValidation | None
    """prediction by the mean of the other readings at the same pressure, without a law"""

    @property
    def rung(self) -> Rung:
        """The law that is saved."""
        return self.fit.rung


@dataclass(frozen=True, eq=False)
class LawQuality:
    """Uncertainty of the selected law."""

    spread: Spread
    """standard deviation of a new reading, all seals"""
    run_to_run: float
    """[-] relative standard deviation between runs, the part that deviations within runs do not contain"""
    is_drift: bool
    """whether the drift within the runs is used in its place"""
    coverage: float
    """share of the left-out readings inside a 95 % band that was made without them"""
    repeatability: float
    """[-] scatter of repeated readings"""
    drift: dict[int, float]
    """pressure level -> relative change of the friction over its run"""
    stiction: Stiction | None
    """None if no stroke starts from rest"""
    offset_line: OffsetLine | None
    """offset of the force sum over pressure; None for swept logs and tables"""
    standard_errors: dict[str, float]
    """of the parameters, by name"""


class Level(NamedTuple):
    """Measured and fitted friction at one pressure."""

    pressure: float
    """[Pa, gauge] mean over seals and readings"""
    speed: float
    """[m/s] mean; NaN if not measured"""
    measured: float
    """[N] all seals"""
    fitted: float
    """[N] all seals, by the law of the seal file"""
    std: float
    """[N] of a new reading, by the law of the seal file"""
    left_out: float
    """[N] prediction by the law fitted without these readings"""
    offset: float
    """[N] of the force sum"""
    readings: int
    drift: float
    """[-] relative change of the friction over the run; NaN if unknown"""
    is_used: bool
    """false for an outlier, which the law is not fitted to"""


@dataclass(frozen=True, eq=False)
class Identification:
    """Result of an identification."""

    data: IdentificationData
    selection: LawSelection
    quality: LawQuality
    levels: tuple[Level, ...]
    document: dict[str, Any]
    """seal file"""
    warnings: tuple[str, ...]
    """limits of the law that its user has to know"""
    remarks: tuple[str, ...]
    """assumptions, and how an option changes them"""
