"""The messages of this project as bytes: CDR, little endian, padding zero.

The layouts are fixed but for the frame name, so a ``struct`` does what a general serialiser would, in a tenth of the
time, and gives the same bytes for the same numbers (rclpy's serialiser leaves padding bytes uninitialised).
CDR aligns each number to its size, counted from the end of the 4-byte encapsulation header.

Source: OMG DDS-RTPS 2.5, section 10 (CDR); message layouts: ``msg_defs/msg``.
"""

import struct
from collections.abc import Callable
from functools import lru_cache
from typing import Any, NamedTuple

from seal_friction_ros.core.estimation.feedforward import FeedForward
from seal_friction_ros.core.estimation.records import Force, FrictionEstimate, Pressure
from seal_friction_ros.core.friction.states import FrictionState

PACKAGE = 'seal_friction_msgs'
PRESSURE_TYPE = f'{PACKAGE}/msg/CylinderPressure'
VELOCITY_TYPE = f'{PACKAGE}/msg/RodVelocity'
FORCE_TYPE = f'{PACKAGE}/msg/ForceSum'
POSITION_TYPE = f'{PACKAGE}/msg/RodPosition'
REFERENCE_TYPE = f'{PACKAGE}/msg/ServoReference'
ESTIMATE_TYPE = f'{PACKAGE}/msg/FrictionEstimate'
FEEDFORWARD_TYPE = f'{PACKAGE}/msg/FrictionFeedForward'
CONFIGURATION_TYPE = f'{PACKAGE}/msg/EstimatorConfiguration'

INPUTS: dict[str, str] = {
    'cylinder_pressure': PRESSURE_TYPE,
    'force_sum': FORCE_TYPE,
    'servo_reference': REFERENCE_TYPE,
    'rod_position': POSITION_TYPE,
    'rod_velocity': VELOCITY_TYPE,
}
"""Topic that the estimator takes -> message type. The position is only recorded."""

OUTPUTS: dict[str, str] = {'friction_estimate': ESTIMATE_TYPE, 'friction_feedforward': FEEDFORWARD_TYPE}
"""Topic that the estimator publishes -> message type."""

_ENCAPSULATION = b'\x00\x01\x00\x00'  # CDR, little endian, no options
_FIRST_HEADER_PART = struct.Struct('<4siII')
_SECOND = 1_000_000_000  # [ns]
_LONGEST_FRAME = 1024  # [bytes] our choice; a longer frame name is not one


class Velocity(NamedTuple):
    """One rod-velocity sample, and the frame it names."""

    stamp: int
    """[ns]"""
    velocity: float
    """[m/s]"""
    frame_id: bytes


class ServoReference(NamedTuple):
    """Where the rod shall be at one moment, and the frame it names."""

    stamp: int
    """[ns]"""
    position: float
    """[m]"""
    velocity: float
    """[m/s]"""
    acceleration: float
    """[m/s^2] 0.0 if it is not known"""
    frame_id: bytes = b''


class Position(NamedTuple):
    """One rod-position sample."""

    stamp: int
    """[ns]"""
    position: float
    """[m]"""


Input = Pressure | Force | ServoReference | Position | Velocity
"""A message that the estimator takes."""


@lru_cache(maxsize=64)
def _body(frame_length: int, body: str) -> struct.Struct:
    """Layout of a stamped message: encapsulation, stamp, frame name of ``frame_length`` bytes with its end, body."""
    padding = -(12 + frame_length) % 8  # the body starts with a float64
    return struct.Struct(f'<4siII{frame_length}s{padding}x{body}')


def _encode(stamp: int, frame_id: bytes, body: str, *values: Any) -> bytes:
    seconds, nanoseconds = divmod(stamp, _SECOND)
    length = len(frame_id) + 1
    return _body(length, body).pack(_ENCAPSULATION, seconds, nanoseconds, length, frame_id, *values)


def _decode(data: bytes, body: str) -> tuple[int, bytes, tuple[Any, ...]]:
    """Stamp [ns], frame and body values of a stamped message.

    Raises:
        ValueError: The bytes are not such a message.
    """
    if len(data) < _FIRST_HEADER_PART.size:
        raise ValueError(f'{len(data)} bytes are too few for a stamped message')
    encapsulation, seconds, nanoseconds, length = _FIRST_HEADER_PART.unpack_from(data)
    if encapsulation[:2] != b'\x00\x01':
        raise ValueError(f'encapsulation {encapsulation.hex()} is not little-endian CDR')
    if not 0 <= length <= _LONGEST_FRAME or not 0 <= nanoseconds < _SECOND:
        raise ValueError(f'header with {nanoseconds} ns and a frame name of {length} bytes makes no sense')
    layout = _body(length, body)
    if not layout.size <= len(data) <= layout.size + 3:  # some writers pad the whole to a multiple of 4
        raise ValueError(f'{len(data)} bytes where the message has {layout.size}')
    fields = layout.unpack_from(data)
    return seconds * _SECOND + nanoseconds, fields[4][:-1], fields[5:]


def encode_pressure(pressure: Pressure, frame_id: bytes = b'') -> bytes:
    """CylinderPressure as bytes."""
    return _encode(pressure.stamp, frame_id, 'dd', pressure.chamber_a, pressure.chamber_b)


def decode_pressure(data: bytes) -> Pressure:
    """CylinderPressure from bytes.

    Raises:
        ValueError: The bytes are not such a message (so for each decoder here).
    """
    stamp, _, (chamber_a, chamber_b) = _decode(data, 'dd')
    return Pressure(stamp, chamber_a, chamber_b)


def encode_force(force: Force, frame_id: bytes = b'') -> bytes:
    """ForceSum as bytes."""
    return _encode(force.stamp, frame_id, 'd', force.force)


def decode_force(data: bytes) -> Force:
    """ForceSum from bytes."""
    stamp, _, (force,) = _decode(data, 'd')
    return Force(stamp, force)


def encode_velocity(velocity: Velocity) -> bytes:
    """RodVelocity as bytes."""
    return _encode(velocity.stamp, velocity.frame_id, 'd', velocity.velocity)


def decode_velocity(data: bytes) -> Velocity:
    """RodVelocity from bytes."""
    stamp, frame_id, (velocity,) = _decode(data, 'd')
    return Velocity(stamp, velocity, frame_id)


def encode_position(position: Position, frame_id: bytes = b'') -> bytes:
    """RodPosition as bytes."""
    return _encode(position.stamp, frame_id, 'd', position.position)


def decode_position(data: bytes) -> Position:
    """RodPosition from bytes."""
    stamp, _, (position,) = _decode(data, 'd')
    return Position(stamp, position)


def encode_reference(reference: ServoReference) -> bytes:
    """ServoReference as bytes."""
    stamp, position, velocity, acceleration, frame_id = reference
    return _encode(stamp, frame_id, 'ddd', position, velocity, acceleration)


def decode_reference(data: bytes) -> ServoReference:
    """ServoReference from bytes."""
    stamp, frame_id, values = _decode(data, 'ddd')
    return ServoReference(stamp, values[0], values[1], values[2], frame_id)


def encode_input(record: Input, frame_id: bytes = b'') -> bytes:
    """Any input as bytes; ``frame_id`` is for those that name no frame themselves."""
    match record:
        case Velocity():
            return encode_velocity(record)
        case ServoReference():
            return encode_reference(record)
        case Pressure():
            return encode_pressure(record, frame_id)
        case Force():
            return encode_force(record, frame_id)
        case Position():
            return encode_position(record, frame_id)


def encode_estimate(estimate: FrictionEstimate, frame_id: bytes = b'') -> bytes:
    """FrictionEstimate as bytes."""
    stamp, coulomb, std, breakaway, friction, state, direction, status, input_age = estimate
    return _encode(
        stamp, frame_id, 'ddddBb2xId', coulomb, std, breakaway, friction, state, direction, status, input_age
    )


def decode_estimate(data: bytes) -> FrictionEstimate:
    """FrictionEstimate from bytes."""
    stamp, _, (coulomb, std, breakaway, friction, state, direction, status, input_age) = _decode(data, 'ddddBb2xId')
    return FrictionEstimate(
        stamp, coulomb, std, breakaway, friction, FrictionState(state), direction, status, input_age
    )


def encode_feedforward(feedforward: FeedForward, frame_id: bytes = b'') -> bytes:
    """FrictionFeedForward as bytes."""
    stamp, force, scale, limited = feedforward
    return _encode(stamp, frame_id, 'ddI', force, scale, limited)


def decode_feedforward(data: bytes) -> FeedForward:
    """FrictionFeedForward from bytes."""
    stamp, _, (force, scale, limited) = _decode(data, 'ddI')
    return FeedForward(stamp, force, scale, limited)


def encode_text(text: str) -> bytes:
    """EstimatorConfiguration (one text) as bytes."""
    data = text.encode() + b'\x00'
    return struct.pack(f'<4sI{len(data)}s', _ENCAPSULATION, len(data), data)


def decode_text(data: bytes) -> str:
    """EstimatorConfiguration from bytes."""
    if len(data) < 9 or data[:2] != b'\x00\x01':
        raise ValueError(f'{len(data)} bytes are not a text in little-endian CDR')
    (length,) = struct.unpack_from('<I', data, 4)
    if length < 1 or len(data) < 8 + length:
        raise ValueError(f'text of {length} bytes in a message of {len(data)} bytes')
    return data[8 : 8 + length - 1].decode()


DECODERS: dict[str, Callable[[bytes], Any]] = {
    PRESSURE_TYPE: decode_pressure,
    FORCE_TYPE: decode_force,
    VELOCITY_TYPE: decode_velocity,
    POSITION_TYPE: decode_position,
    REFERENCE_TYPE: decode_reference,
    ESTIMATE_TYPE: decode_estimate,
    FEEDFORWARD_TYPE: decode_feedforward,
    CONFIGURATION_TYPE: decode_text,
}
"""Message type -> decoder."""
