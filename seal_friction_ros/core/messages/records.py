"""Records of the messages: inputs and outputs of the estimator.

They are named tuples, since each sample makes several: immutable, and three times cheaper than frozen dataclasses. A
record with the stamp `NEVER` stands for a missing one, so that each field has one type and the estimator compiles as it
stands.
"""

from collections import namedtuple
from collections.abc import Iterator
from enum import IntFlag
from typing import Any, NamedTuple, cast

from seal_friction_ros.core.friction.states import UNKNOWN

NEVER = -(2**63)  # [ns] stamp of a missing record


class Status(IntFlag):
    """Faults of an estimate; 0: none. FrictionEstimate.msg has the meanings."""

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
    PRESSURE_LEAP = 4096
    FORCE_LEAP = 8192
    VELOCITY_LEAP = 16384
    INPUT_REFUSED = 32768
    STAMP_AGE = 65536
    MOTION_UNCERTAIN = 131072
    FASTER_THAN_IDENTIFIED = 262144
    SLOWER_THAN_IDENTIFIED = 524288
    DIRECTION_NOT_IDENTIFIED = 1048576
    FORCE_CONTAINS_LOAD = 2097152
    MODEL_DISAGREES = 4194304
    TEMPERATURE_MISSING = 8388608
    OUTSIDE_IDENTIFIED_TEMPERATURE = 16777216
    PRESLIDING = 33554432
    LATE_INPUT = 67108864


class Limited(IntFlag):
    """What limited the force; 0 means nothing. The meanings are written in FrictionFeedForward.msg."""

    SLEW = 1
    CLAMP = 2
    FADE = 4


Bits: Any = cast(Any, namedtuple)('Bits', Status.__members__)
BITS: Any = Bits(*map(int, Status))
"""The bits as plain integers: arithmetic of an IntFlag takes a microsecond each time."""

EXTRAPOLATED = (
    Status.OUTSIDE_IDENTIFIED_RANGE
    | Status.FASTER_THAN_IDENTIFIED
    | Status.SLOWER_THAN_IDENTIFIED
    | Status.DIRECTION_NOT_IDENTIFIED
    | Status.OUTSIDE_IDENTIFIED_TEMPERATURE
)
"""Status bits of good inputs that are outside what a law was identified with."""


class Pressure(NamedTuple):
    """One cylinder-pressure sample."""

    stamp: int  # [ns]
    chamber_a: float  # [Pa, gauge]
    chamber_b: float  # [Pa, gauge]


class Force(NamedTuple):
    """One force-sum sample: every axial force on the moving mass except seal friction."""

    stamp: int  # [ns]
    force: float  # [N] positive on extension


class Temperature(NamedTuple):
    """One sample of the temperature of the seals, as sensor_msgs/Temperature has it."""

    stamp: int  # [ns]
    temperature: float  # [degC]
    variance: float = 0.0  # [K^2] 0.0: not known; nothing depends on it


NO_PRESSURE = Pressure(NEVER, 0.0, 0.0)
NO_FORCE = Force(NEVER, 0.0)


class Velocity(NamedTuple):
    """One rod-velocity sample."""

    stamp: int  # [ns]
    velocity: float  # [m/s] positive on extension
    frame_id: Any = b''  # bytes; in compiled code the number of the message


class Position(NamedTuple):
    """One rod-position sample."""

    stamp: int  # [ns]
    position: float  # [m]


class ServoReference(NamedTuple):
    """Motion that the servo shall make at one moment."""

    stamp: int  # [ns]
    position: float  # [m]
    velocity: float  # [m/s]
    acceleration: float  # [m/s^2] 0.0 if it is not known
    frame_id: Any = b''  # bytes; in compiled code the number of the message


class Clock(NamedTuple):
    """One message of simulated time (``/clock``)."""

    stamp: int  # [ns] simulated time


class WatchdogTick(NamedTuple):
    """The watchdog of the node acts: there is a force, and no velocity sample has renewed it."""

    stamp: int  # [ns] when it acts, on the clock of the stamps
    idle_time: float  # [s] since the last feed-forward
    frame_id: Any = b''  # bytes; in compiled code the number of the message


class FrictionEstimate(NamedTuple):
    """Friction of the seals at one rod-velocity sample. Every number is finite for any input."""

    stamp: int  # [ns] of the velocity sample
    coulomb_friction: float  # [N] magnitude of the friction of all seals while sliding
    coulomb_friction_std: float  # [N] one standard deviation of a new reading; at least ``friction_force_std``
    breakaway_force: float  # [N] below ``coulomb_friction`` only where a seal has less friction in this direction
    friction_force: float  # [N] ``m a = force_sum - friction_force``
    state: int  # a `FrictionState`
    direction: int  # -1, 0 or 1
    status: int  # bits of `Status`
    input_age: float  # [s] age of the older of pressure and force in use; -1.0 while one is missing
    adaptation_scale: float = 1.0  # [-] friction of the machine over that of the seal file; 1.0 until it is learnt
    adaptation_scale_std: float = 0.0  # [-] its standard deviation; 0.0 without adaptation
    adaptation_offset: float = 0.0  # [N] part of the force sum that does not change sign with the direction
    residual: float = 0.0  # [N] force sum less inertia, ``friction_force`` and offset; 0.0 at rest
    friction_force_std: float = -1.0  # [N] one standard deviation of ``friction_force``; -1.0: not known


NO_ESTIMATE = FrictionEstimate(NEVER, 0.0, 0.0, 0.0, 0.0, UNKNOWN, 0, 0, -1.0)


class FeedForward(NamedTuple):
    """Compensation at one moment. Every number is finite, whatever came in."""

    stamp: int  # [ns]
    force: float  # [N] positive on extension
    scale: float  # [-] share of the estimated friction that is compensated
    limited: int  # bits of `Limited`


Input = Pressure | Force | ServoReference | Position | Temperature | Velocity | Clock | WatchdogTick
"""A message that the estimator takes."""
Output = FrictionEstimate | FeedForward  # A message that the estimator makes.


def field_names(record: Any) -> tuple[str, ...]:
    """Names of the fields of a named tuple or a dataclass, in order; empty for a number."""
    names: tuple[str, ...] = getattr(record, '__match_args__', ())
    return names


def numbers_in(record: Any) -> Iterator[float]:
    """All numbers in a record and its records, in order."""
    names = field_names(record)
    if not names:
        yield record
    for name in names:
        yield from numbers_in(getattr(record, name))
