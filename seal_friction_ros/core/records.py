"""What goes into the estimator and what comes out of it.

These are made for every sample, so they are named tuples: immutable, and three times cheaper than frozen dataclasses.
"""

from enum import IntEnum, IntFlag
from typing import NamedTuple


class FrictionState(IntEnum):
    """Friction state of the thesis, chapter 7; with ``direction`` these are its six states, and UNKNOWN."""

    UNKNOWN = 0
    SLIDING = 1
    BREAKAWAY = 2
    STUCK = 3


class Status(IntFlag):
    """What is wrong with an estimate; 0 means nothing. The meanings are written in FrictionEstimate.msg."""

    PRESSURE_MISSING = 1
    FORCE_MISSING = 2
    PRESSURE_STALE = 4
    FORCE_STALE = 8
    PRESSURE_NOT_FINITE = 16
    FORCE_NOT_FINITE = 32
    VELOCITY_NOT_FINITE = 64
    PRESSURE_OUT_OF_RANGE = 128
    FORCE_OUT_OF_RANGE = 256
    VELOCITY_OUT_OF_RANGE = 512
    OUTSIDE_IDENTIFIED_RANGE = 1024
    STAMP_NOT_INCREASING = 2048


class Pressure(NamedTuple):
    """One cylinder-pressure sample."""

    stamp: int
    """[ns]"""
    chamber_a: float
    """[Pa, gauge]"""
    chamber_b: float
    """[Pa, gauge]"""


class Force(NamedTuple):
    """One force-sum sample: every axial force on the moving mass except seal friction."""

    stamp: int
    """[ns]"""
    force: float
    """[N] positive on extension"""


class RodSample(NamedTuple):
    """One rod-velocity sample with the newest pressure and force sum that came before it (None: none came yet)."""

    stamp: int
    """[ns]"""
    velocity: float
    """[m/s] positive on extension"""
    pressure: Pressure | None
    force: Force | None


class FrictionEstimate(NamedTuple):
    """What the seals do at one rod-velocity sample. Every number is finite, whatever came in."""

    stamp: int
    """[ns] of the velocity sample"""
    coulomb_friction: float
    """[N] magnitude of the friction of all seals while sliding"""
    coulomb_friction_std: float
    """[N] one standard deviation, for a new reading"""
    breakaway_force: float
    """[N] at least ``coulomb_friction``"""
    friction_force: float
    """[N] ``m a = force_sum - friction_force``"""
    state: FrictionState
    direction: int
    """-1, 0 or 1"""
    status: int
    """bits of `Status`"""
    input_age: float
    """[s] age of the older of pressure and force in use; -1.0 while one is missing"""
