"""Messages of this project as bytes: one by one, for the live path and for what is written.

The layouts are fixed but for the frame name, so a ``struct`` does the work of a general serialiser in a tenth of the
time, and the same numbers give the same bytes (rclpy's serialiser leaves padding bytes uninitialised).
"""

import struct
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from seal_friction_ros.core.messages import layouts
from seal_friction_ros.core.messages.cdr import ENCAPSULATION, LITTLE_ENDIAN, walked
from seal_friction_ros.core.messages.layouts import FRAME_AT, LENGTH_AT, LONGEST_FRAME, SECOND, Layout, struct_of
from seal_friction_ros.core.messages.records import Clock

_CLOCK, _NUMBER = struct_of(layouts.CLOCK_TYPE), struct_of(layouts.NUMBER_TYPE)
_FRAME_LENGTH = slice(LENGTH_AT, FRAME_AT)


def _encoder(layout: Layout) -> Callable[[Any, bytes], bytes]:
    """Makes the bytes of a message from its record, with a frame name if the record has none."""
    keeps_frame, packers = layout.keeps_frame, dict[int, Callable[..., bytes]]()  # by length of the frame name with end

    def encode_record(record: Any, frame_id: bytes) -> bytes:
        """Bytes of one message."""
        numbers = record[1:]
        if keeps_frame:
            frame_id, numbers = record[-1], record[1:-1]
        length = len(frame_id) + 1
        pack = packers.get(length)
        if pack is None:
            pack = packers[length] = struct_of(layout.message_type, length).pack
        seconds, nanoseconds = divmod(record[0], SECOND)
        head = ENCAPSULATION, seconds, nanoseconds, length, frame_id
        return pack(*head + numbers)  # one tuple: faster than to unpack two

    return encode_record


def _decoder(layout: Layout) -> Callable[[bytes], Any]:
    """Makes the record of a message from its bytes."""
    record, check, keeps_frame = layout.record, layout.check, layout.keeps_frame
    known: dict[int, Callable[[bytes], tuple[Any, ...]]] = {}  # by the size of the message
    # Numbers that an older message has not get their defaults; else half the time of a call of the class.
    make: Any = (lambda values: record(*values)) if layout.older_numbers else partial(tuple.__new__, record)

    def decode_bytes(data: bytes) -> Any:
        """Record of one message; ValueError for bytes that are none."""
        fields = known.get(len(data), _no_fields)(data)
        if fields[0] != ENCAPSULATION or fields[3] != len(fields[4]):  # another frame name, padded to the same size
            if data[:2] != LITTLE_ENDIAN:
                raise ValueError(f'encapsulation {data[:4].hex()} of {len(data)} bytes is not little-endian CDR')
            unpack = known[len(data)] = _struct_of_bytes(layout, data).unpack_from
            fields = unpack(data)
        nanoseconds = fields[2]
        if nanoseconds >= SECOND:
            raise ValueError(f'header with {nanoseconds} ns is not valid')
        values = (fields[1] * SECOND + nanoseconds,) + fields[5:]  # noqa: RUF005  unpacking takes longer
        if keeps_frame:
            values += (fields[4][:-1],)
        decoded = make(values)
        if check is not None:
            check(decoded)
        return decoded

    return decode_bytes


def _no_fields(_data: bytes) -> tuple[Any, ...]:
    """Fields of bytes that are no message."""
    return b'', 0, 0, 0, b''


def _struct_of_bytes(layout: Layout, data: bytes) -> struct.Struct:
    """Format of messages with the size of this one and the length of its frame name; ValueError if there is none."""
    if len(data) < FRAME_AT:
        raise ValueError(f'{len(data)} bytes are too few for a stamped message')
    length = int.from_bytes(data[_FRAME_LENGTH], 'little')
    if length > LONGEST_FRAME:
        raise ValueError(f'header with a frame name of {length} bytes is not valid')
    known = struct_of(layout.message_type, length)
    for numbers in layout.older_numbers:
        if len(data) < known.size:
            known = struct_of(layout.message_type, length, numbers=numbers)
    if not known.size <= len(data) <= known.size + 3:  # some writers pad the whole to a multiple of 4
        raise ValueError(f'{len(data)} bytes where the message has {known.size}')
    return known


ENCODERS = {layout.record: _encoder(layout) for layout in layouts.LAYOUTS}
"""Record -> its encoder, see `encode`."""
TYPES = {layout.record: layout.message_type for layout in layouts.LAYOUTS}
"""Record -> its message type."""


def type_of(record: Any) -> str:
    """Message type of a record."""
    return TYPES[type(record)]


def encode(record: Any, frame_id: bytes = b'') -> bytes:
    """Message of a record as bytes; ``frame_id`` is for records without a frame name of their own."""
    return ENCODERS[type(record)](record, frame_id)


def encode_text(text: str) -> bytes:
    """EstimatorConfiguration (one text) as bytes."""
    data = text.encode()
    return struct_of(layouts.CONFIGURATION_TYPE, len(data) + 1).pack(ENCAPSULATION, len(data) + 1, data)


def decode_text(data: bytes) -> str:
    """EstimatorConfiguration from bytes; ValueError if they are not such a message."""
    _, root = walked(layouts.DEFINITIONS, layouts.CONFIGURATION_TYPE, data)
    begin, _, length = root['json']
    if not length:
        raise ValueError(f'a text without its end in a message of {len(data)} bytes')
    return str(data[begin : begin + length - 1], 'utf-8')


def decode_clock(data: bytes) -> Clock:
    """Simulated time from the bytes of a rosgraph_msgs/Clock; ValueError if they are none."""
    if not _CLOCK.size <= len(data) <= _CLOCK.size + 3 or data[:2] != LITTLE_ENDIAN:
        raise ValueError(f'{len(data)} bytes are not a time in little-endian CDR')
    _, seconds, nanoseconds = _CLOCK.unpack_from(data)
    if nanoseconds >= SECOND:
        raise ValueError(f'time with {nanoseconds} ns is not valid')
    return Clock(seconds * SECOND + nanoseconds)


DECODERS: dict[str, Callable[[bytes], Any]] = {
    **{layout.message_type: _decoder(layout) for layout in layouts.LAYOUTS},
    layouts.CONFIGURATION_TYPE: decode_text,
    layouts.CLOCK_TYPE: decode_clock,
}
"""Message type -> its decoder: bytes to record. Raises ValueError for bytes that are not such a message."""


def decode(message_type: str, data: bytes) -> Any:
    """Record of a message; ValueError if the bytes are not a message of this type."""
    return DECODERS[message_type](data)


# -- commands for controllers -----------------------------------------------------------------------------------------


def encode_number(value: float) -> bytes:
    """A ``std_msgs/Float64``."""
    return _NUMBER.pack(ENCAPSULATION, value)


def encode_numbers(values: Sequence[float]) -> bytes:
    """A ``std_msgs/Float64MultiArray`` without dimensions."""
    return struct_of(layouts.NUMBERS_TYPE, 0, len(values)).pack(ENCAPSULATION, 0, 0, len(values), *values)


def encode_efforts(stamp: int, efforts: Sequence[tuple[str, float]]) -> bytes:
    """A ``sensor_msgs/JointState`` with the effort of each named joint; ``stamp``: [ns]."""
    names = [name.encode() for name, _ in efforts]
    lengths, count = [len(name) + 1 for name in names], len(names)
    texts = (part for pair in zip(lengths, names, strict=True) for part in pair)
    layout = struct_of(layouts.JOINTS_TYPE, 1, count, *lengths, 0, 0, count)
    head = (*divmod(stamp, SECOND), 1, b'')
    return layout.pack(ENCAPSULATION, *head, count, *texts, 0, 0, count, *(effort for _, effort in efforts))


def encode_wrench(stamp: int, frame: str, force: float) -> bytes:
    """A ``geometry_msgs/WrenchStamped`` with a force along x of a frame, no torque; ``stamp``: [ns]."""
    name = frame.encode()
    layout = struct_of(layouts.WRENCH_TYPE, len(name) + 1)
    return layout.pack(ENCAPSULATION, *divmod(stamp, SECOND), len(name) + 1, name, force, *[0.0] * 5)
