"""Records of an identification, from the data it uses to the document it makes."""

from dataclasses import dataclass
from typing import Any, NamedTuple

from seal_friction_ros.core.friction.geometry import SealGeometry
from seal_friction_ros.core.friction.laws.normal_force import NormalForceLaw
from seal_friction_ros.core.identification.candidate_laws import CandidateLaw
from seal_friction_ros.core.identification.diagnostics import FrictionChange, Outlier
from seal_friction_ros.core.identification.fitting import (
    BreakawayFit,
    CrossValidation,
    LawFit,
    LawScore,
    PredictionUncertainty,
)
from seal_friction_ros.core.identification.readings import FrictionReadings, PreparedReadings
from seal_friction_ros.core.identification.signal_preparation import OffsetLine
from seal_friction_ros.offline.identification.sources import Sources

FEWEST_PRESSURES_FOR_EXPONENT = 6  # with fewer, leaving each out in turn does not determine an exponent (our choice)


class Ring(NamedTuple):
    """Ring of known geometry."""

    geometry: SealGeometry
    normal_force_law: NormalForceLaw


@dataclass(frozen=True, eq=False)
class IdentificationData:
    """Readings that the law is fitted to, and those that are excluded."""

    sources: Sources
    prepared: PreparedReadings
    """every reading of the sources that agree, including outliers"""
    used: FrictionReadings
    """without outliers"""
    ring: Ring | None
    outlier: Outlier | None
    changes: tuple[FrictionChange, ...]
    """each further swept log against the law of the first one"""
    kept: tuple[int, ...]
    """numbers of the sources behind ``prepared``"""

    def is_outlier(self, level: int) -> bool:
        """Whether a pressure level is the outlier, which the law is not fitted to."""
        return self.outlier is not None and level == self.outlier.level


@dataclass(frozen=True, eq=False)
class LawSelection:
    """All candidate laws with their scores, and the law that is saved."""

    scores: tuple[LawScore, ...]
    best: LawScore
    """recommended: the simplest law that no other law beats beyond the noise"""
    fit: LawFit
    validation: CrossValidation
    reference: CrossValidation | None
    """prediction by the mean of the other readings at the same pressure, without a law"""

    @property
    def law(self) -> CandidateLaw:
        """The law that is saved."""
        return self.fit.law


@dataclass(frozen=True, eq=False)
class LawQuality:
    """Uncertainty of the selected law."""

    uncertainty: PredictionUncertainty
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
    breakaway: BreakawayFit | None
    """None if no stroke starts from rest"""
    offset_line: OffsetLine | None
    """offset of the force sum over pressure; None for swept logs and tables"""
    standard_errors: dict[str, float]
    """of the parameters, by name"""


class PressureLevel(NamedTuple):
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
    levels: tuple[PressureLevel, ...]
    document: dict[str, Any]
    """seal file"""
    warnings: tuple[str, ...]
    """limits of the law that its user has to know"""
    remarks: tuple[str, ...]
    """assumptions, and how an option changes them"""
