"""The messages of this project: their fields once, and their bytes (CDR, little endian, padding zero).

The layouts are fixed but for the frame name, so a ``struct`` does the work of a general serialiser in a tenth of the
time, and the same numbers give the same bytes (rclpy's serialiser leaves padding bytes uninitialised). CDR aligns each
number to its size, counted from the end of the 4-byte encapsulation header. `LAYOUTS` serves the coders here and the
coders of compiled replay (`compiled_pipeline`).

Source: OMG DDS-RTPS 2.5, section 10 (CDR); message layouts: ``msg_defs/msg``.
"""

import struct
from collections.abc import Callable
from typing import Any, NamedTuple

from seal_friction_ros.core.estimation.feedforward import FeedForward
from seal_friction_ros.core.estimation.records import (
    Clock,
    Force,
    FrictionEstimate,
    Position,
    Pressure,
    ServoReference,
    Temperature,
    Velocity,
    WatchdogTick,
)
from seal_friction_ros.core.friction.states import FrictionState

PACKAGE = 'seal_friction_msgs'
PRESSURE_TYPE = f'{PACKAGE}/msg/CylinderPressure'
VELOCITY_TYPE = f'{PACKAGE}/msg/RodVelocity'
FORCE_TYPE = f'{PACKAGE}/msg/ForceSum'
POSITION_TYPE = f'{PACKAGE}/msg/RodPosition'
REFERENCE_TYPE = f'{PACKAGE}/msg/ServoReference'
ESTIMATE_TYPE = f'{PACKAGE}/msg/FrictionEstimate'
FEEDFORWARD_TYPE = f'{PACKAGE}/msg/FrictionFeedForward'
TICK_TYPE = f'{PACKAGE}/msg/WatchdogTick'
CONFIGURATION_TYPE = f'{PACKAGE}/msg/EstimatorConfiguration'
TEMPERATURE_TYPE = 'sensor_msgs/msg/Temperature'
CLOCK_TYPE = 'rosgraph_msgs/msg/Clock'

CLOCK_TOPIC = '/clock'
"""Simulated time, an input of nodes with ``use_sim_time``."""

INPUTS: dict[str, str] = {
    'cylinder_pressure': PRESSURE_TYPE,
    'force_sum': FORCE_TYPE,
    'servo_reference': REFERENCE_TYPE,
    'rod_position': POSITION_TYPE,
    'seal_temperature': TEMPERATURE_TYPE,
    'rod_velocity': VELOCITY_TYPE,
}
"""Topic that the estimator subscribes to -> message type. The position is only recorded."""

OUTPUTS: dict[str, str] = {'friction_estimate': ESTIMATE_TYPE, 'friction_feedforward': FEEDFORWARD_TYPE}
"""Topic that the estimator publishes -> message type."""

Input = Pressure | Force | ServoReference | Position | Temperature | Velocity | Clock | WatchdogTick
"""A message that the estimator takes."""
Output = FrictionEstimate | FeedForward
"""A message that the estimator makes."""


Check = Callable[[Any], object]
"""Raises ValueError for a record that is not valid."""


class Layout(NamedTuple):
    """A message with a header: stamp and frame name, then numbers."""

    message_type: str
    record: type  # named tuple: the stamp [ns], the numbers in the order of the message, and for some the frame name
    codes: str  # type of each number as of `struct`: d float64, I uint32, B uint8, b int8
    check: Check | None = None
    older_numbers: int | None = None  # how many numbers the message had before it grew; None: it never grew

    @property
    def keeps_frame(self) -> bool:
        """Whether the record has the frame name."""
        return 'frame_id' in self.record.__annotations__

    @property
    def fields(self) -> tuple[str, ...]:
        """Name of each number."""
        return tuple(self.record.__annotations__)[1 : 1 + len(self.codes)]

    @property
    def offsets(self) -> tuple[int, ...]:
        """Distance of each number from the first one [bytes]; the first one is aligned to 8."""
        offsets, end = [], 0
        for code in self.codes:
            size = struct.calcsize(code)
            offsets.append(end + -end % size)
            end = offsets[-1] + size
        return tuple(offsets)

    @property
    def size(self) -> int:
        """Size of all numbers [bytes]."""
        return self.offsets[-1] + struct.calcsize(self.codes[-1])

    def body(self, count: int | None = None) -> str:
        """Format of the numbers for `struct`, of the first ``count`` or of all, with the padding between them."""
        text, end = '', 0
        for code, offset in list(zip(self.codes, self.offsets, strict=True))[:count]:
            text += f'{offset - end}x{code}' if offset > end else code
            end = offset + struct.calcsize(code)
        return text


LAYOUTS = (
    Layout(PRESSURE_TYPE, Pressure, 'dd'),
    Layout(FORCE_TYPE, Force, 'd'),
    Layout(VELOCITY_TYPE, Velocity, 'd'),
    Layout(POSITION_TYPE, Position, 'd'),
    Layout(REFERENCE_TYPE, ServoReference, 'ddd'),
    Layout(TEMPERATURE_TYPE, Temperature, 'dd'),
    Layout(TICK_TYPE, WatchdogTick, 'd'),
    Layout(ESTIMATE_TYPE, FrictionEstimate, 'ddddBbIddddd', lambda estimate: FrictionState(estimate.state), 8),
    Layout(FEEDFORWARD_TYPE, FeedForward, 'ddI'),
)

GROWN = {
    layout.message_type: layout.size - struct.calcsize('<' + layout.body(layout.older_numbers)) for layout in LAYOUTS
}
"""By how many bytes each message is longer than it was; what it had before is its beginning."""

LONGEST_FRAME = 1024  # [bytes] our choice; a longer frame name is not valid
SECOND = 1_000_000_000  # [ns]
_ENCAPSULATION = b'\x00\x01\x00\x00'  # CDR, little endian, no options
_LITTLE_ENDIAN = b'\x00\x01'  # begin of the encapsulation
_CLOCK = struct.Struct('<4xiI')
_SHORTEST = 16  # [bytes] encapsulation, stamp and length of the frame name


def head_size(frame_length: int) -> int:
    """Size [bytes] of stamp and frame name of ``frame_length`` bytes, its end included, padded to the first number."""
    return (12 + frame_length + 7) // 8 * 8


def _struct(frame_length: int, body: str) -> struct.Struct:
    """Of a whole message, with the length of the frame name as bytes."""
    padding = head_size(frame_length) - 12 - frame_length
    return struct.Struct(f'<4siI4s{frame_length}s{padding}x{body}')


def _encoder(layout: Layout) -> Callable[[int, bytes, tuple[Any, ...]], bytes]:
    """Makes the bytes of a message from its stamp, frame name and numbers."""
    body = layout.body()
    known: dict[int, tuple[Callable[..., bytes], bytes]] = {}  # by the length of the frame name

    def encode_numbers(stamp: int, frame_id: bytes, numbers: tuple[Any, ...]) -> bytes:
        """Bytes of one message."""
        found = known.get(len(frame_id))
        if found is None:
            length = len(frame_id) + 1
            found = known[len(frame_id)] = _struct(length, body).pack, length.to_bytes(4, 'little')
        pack, length_bytes = found
        seconds, nanoseconds = divmod(stamp, SECOND)
        return pack(_ENCAPSULATION, seconds, nanoseconds, length_bytes, frame_id, *numbers)

    return encode_numbers


def _decoder(layout: Layout) -> Callable[[bytes], Any]:
    """Makes the record of a message from its bytes."""
    record, check, keeps_frame = layout.record, layout.check, layout.keeps_frame
    known: dict[int, tuple[Callable[[bytes], tuple[Any, ...]], bytes]] = {}  # by the size of the message

    def decode_bytes(data: bytes) -> Any:
        """Record of one message; ValueError for bytes that are none."""
        if data[:2] != _LITTLE_ENDIAN:
            raise ValueError(f'encapsulation {data[:4].hex()} of {len(data)} bytes is not little-endian CDR')
        found = known.get(len(data))
        if found is None or found[1] != data[12:16]:
            found = known[len(data)] = _layout_of(layout, data)
        fields = found[0](data)
        nanoseconds = fields[2]
        if nanoseconds >= SECOND:
            raise ValueError(f'header with {nanoseconds} ns is not valid')
        stamp = fields[1] * SECOND + nanoseconds
        if keeps_frame:
            return record(stamp, *fields[5:], fields[4][:-1])
        decoded = record(stamp, *fields[5:])
        if check is not None:
            check(decoded)
        return decoded

    return decode_bytes


def _layout_of(layout: Layout, data: bytes) -> tuple[Callable[[bytes], tuple[Any, ...]], bytes]:
    """How to unpack messages with the size of this one and the length of its frame name, and that length as bytes.

    Raises:
        ValueError: No message has this size and this length.
    """
    if len(data) < _SHORTEST:
        raise ValueError(f'{len(data)} bytes are too few for a stamped message')
    length = int.from_bytes(data[12:16], 'little')
    if length > LONGEST_FRAME:
        raise ValueError(f'header with a frame name of {length} bytes is not valid')
    known = _struct(length, layout.body())
    if len(data) < known.size and layout.older_numbers is not None:
        known = _struct(length, layout.body(layout.older_numbers))
    if not known.size <= len(data) <= known.size + 3:  # some writers pad the whole to a multiple of 4
        raise ValueError(f'{len(data)} bytes where the message has {known.size}')
    return known.unpack_from, data[12:16]


_ENCODERS = {layout.record: (_encoder(layout), layout.keeps_frame) for layout in LAYOUTS}
_TYPES = {layout.record: layout.message_type for layout in LAYOUTS}


def type_of(record: Any) -> str:
    """Message type of a record."""
    return _TYPES[type(record)]


def encode(record: Any, frame_id: bytes = b'') -> bytes:
    """Message of a record as bytes; ``frame_id`` is for records without a frame name of their own."""
    encode_numbers, keeps_frame = _ENCODERS[type(record)]
    if keeps_frame:
        return encode_numbers(record[0], record[-1], record[1:-1])
    return encode_numbers(record[0], frame_id, record[1:])


def encode_text(text: str) -> bytes:
    """EstimatorConfiguration (one text) as bytes."""
    data = text.encode() + b'\x00'
    return struct.pack(f'<4sI{len(data)}s', _ENCAPSULATION, len(data), data)


def decode_text(data: bytes) -> str:
    """EstimatorConfiguration from bytes.

    Raises:
        ValueError: The bytes are not such a message.
    """
    if len(data) < 9 or data[:2] != b'\x00\x01':
        raise ValueError(f'{len(data)} bytes are not a text in little-endian CDR')
    (length,) = struct.unpack_from('<I', data, 4)
    if length < 1 or len(data) < 8 + length:
        raise ValueError(f'text of {length} bytes in a message of {len(data)} bytes')
    return data[8 : 8 + length - 1].decode()


def decode_clock(data: bytes) -> Clock:
    """Simulated time from the bytes of a rosgraph_msgs/Clock.

    Raises:
        ValueError: The bytes are not such a message.
    """
    if not _CLOCK.size <= len(data) <= _CLOCK.size + 3 or data[:2] != _LITTLE_ENDIAN:
        raise ValueError(f'{len(data)} bytes are not a time in little-endian CDR')
    seconds, nanoseconds = _CLOCK.unpack_from(data)
    if nanoseconds >= SECOND:
        raise ValueError(f'time with {nanoseconds} ns is not valid')
    return Clock(seconds * SECOND + nanoseconds)


DECODERS: dict[str, Callable[[bytes], Any]] = {
    **{layout.message_type: _decoder(layout) for layout in LAYOUTS},
    CONFIGURATION_TYPE: decode_text,
    CLOCK_TYPE: decode_clock,
}
"""Message type -> its decoder: bytes to record. Raises ValueError for bytes that are not such a message."""


def decode(message_type: str, data: bytes) -> Any:
    """Record of a message.

    Raises:
        ValueError: The bytes are not a message of this type.
    """
    return DECODERS[message_type](data)
