"""The answers of all actuators to one message as one message, ``seal_friction_msgs/MachineFriction``.

One message instead of two for each actuator: most of what an answer costs is the middleware's. Its bytes are CDR,
little endian, padding zero, as in `core.estimation.messages`: one ``struct`` for all numbers, kept for each set of
names.
"""

import struct
from collections.abc import Iterator, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

from seal_friction_ros.core.estimation.feedforward import FeedForward
from seal_friction_ros.core.estimation.messages import LAYOUTS, PACKAGE, SECOND, Output
from seal_friction_ros.core.estimation.records import FrictionEstimate

MACHINE_TYPE = f'{PACKAGE}/msg/MachineFriction'
_CODES = {layout.record: layout.codes for layout in LAYOUTS}
_ENCAPSULATION = b'\x00\x01\x00\x00'  # CDR, little endian, no options


class NamedAnswer(NamedTuple):
    """An answer of one actuator."""

    actuator: str
    record: Output
    frame_id: bytes


class _Parts(NamedTuple):
    """What the layout of a message depends on: name and length of the frame name of each answer."""

    estimates: tuple[tuple[str, int], ...]
    feedforwards: tuple[tuple[str, int], ...]


def encode_together(answers: Sequence[NamedAnswer]) -> bytes:
    """The answers to one message, at least one, in the order in which they were made."""
    parts: dict[type, list[tuple[str, int]]] = {FrictionEstimate: [], FeedForward: []}
    values: dict[type, list[Any]] = {FrictionEstimate: [], FeedForward: []}
    for actuator, record, frame_id in answers:
        kind, length = type(record), len(frame_id)
        seconds, nanoseconds = divmod(record.stamp, SECOND)
        parts[kind].append((actuator, length))
        values[kind] += (seconds, nanoseconds, length + 1, frame_id, *record[1:])
    estimates, feedforwards = values.values()
    layout, names, feedforward_names = _layout(_Parts(*map(tuple, parts.values())))
    return layout.pack(
        _ENCAPSULATION, *(estimates or feedforwards)[:2], 1, b'', *names, len(parts[FrictionEstimate]), *estimates,
        *feedforward_names, len(parts[FeedForward]), *feedforwards,
    )  # fmt: skip


def decode_together(data: bytes) -> list[NamedAnswer]:
    """The answers in a message: inverse of `encode_together`.

    Raises:
        ValueError: The bytes are not such a message.
    """
    if data[:4] != _ENCAPSULATION:
        raise ValueError(f'encapsulation {data[:4].hex()} is not little-endian CDR')
    try:
        _, place = _stamp_and_frame(data, 4)
        answers: list[NamedAnswer] = []
        for record in (FrictionEstimate, FeedForward):
            (count,), place = _numbers(data, place, 'I')
            names = []
            for _ in range(count):
                text, place = _text(data, place)
                names.append(text.decode())
            (count,), place = _numbers(data, place, 'I')
            if count != len(names):
                raise ValueError(f'{count} answers of {len(names)} actuators')
            for name in names:
                (stamp, frame_id), place = _stamp_and_frame(data, place)
                values, place = _numbers(data, place, _CODES[record])
                answers.append(NamedAnswer(name, record(stamp, *values), frame_id))
    except (struct.error, UnicodeDecodeError) as error:
        raise ValueError(f'{len(data)} bytes are no {MACHINE_TYPE}: {error}') from None
    return answers


def _stamp_and_frame(data: bytes, place: int) -> tuple[tuple[int, bytes], int]:
    (seconds, nanoseconds), place = _numbers(data, place, 'iI')
    frame_id, place = _text(data, place)
    return (seconds * SECOND + nanoseconds, frame_id), place


def _text(data: bytes, place: int) -> tuple[bytes, int]:
    (length,), place = _numbers(data, place, 'I')
    if not 1 <= length <= len(data) - place:
        raise ValueError(f'a text of {length} bytes in a message of {len(data)} bytes')
    return data[place : place + length - 1], place + length


def _numbers(data: bytes, place: int, codes: str) -> tuple[list[Any], int]:
    """Numbers from ``place`` on, each aligned to its size counted from the end of the encapsulation; and their end."""
    values: list[Any] = []
    for code in codes:
        size = struct.calcsize('<' + code)
        place += (4 - place) % size
        values += struct.unpack_from('<' + code, data, place)
        place += size
    return values, place


@lru_cache(maxsize=256)
def _layout(parts: _Parts) -> tuple[struct.Struct, tuple[Any, ...], tuple[Any, ...]]:
    """Format of a message; count, lengths and texts of the names of the estimates, and of the feed-forwards."""
    codes = [*'iII', '1s']
    codes += _names_format(parts.estimates)
    codes += _answers_format(parts.estimates, _CODES[FrictionEstimate])
    codes += _names_format(parts.feedforwards)
    codes += _answers_format(parts.feedforwards, _CODES[FeedForward])
    return struct.Struct('<4s' + ''.join(_padded(codes))), _names(parts.estimates), _names(parts.feedforwards)


def _names_format(answers: tuple[tuple[str, int], ...]) -> list[str]:
    return ['I', *(code for name, _ in answers for code in ('I', f'{len(name.encode()) + 1}s'))]


def _names(answers: tuple[tuple[str, int], ...]) -> tuple[Any, ...]:
    texts = [name.encode() for name, _ in answers]
    return (len(texts), *(part for text in texts for part in (len(text) + 1, text)))


def _answers_format(answers: tuple[tuple[str, int], ...], codes: str) -> list[str]:
    return ['I', *(code for _, frame in answers for code in ('i', 'I', 'I', f'{frame + 1}s', *codes))]


def _padded(codes: list[str]) -> Iterator[str]:
    """Each code after the padding that aligns it to its size."""
    end = 0
    for code in codes:
        size = struct.calcsize('<' + code)
        padding = 0 if code.endswith('s') else -end % size
        yield f'{padding}x{code}' if padding else code
        end += padding + size
