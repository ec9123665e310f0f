"""CDR, little endian: where the numbers and texts of a message stand, by its definition.

One walk over the fields serves readers and writers: a reader finds the lengths of texts and lists in the bytes
(`walked`), a writer knows them (`laid_out`). CDR aligns each number to its size, counted from the end of the 4-byte
encapsulation header; padding is zero.

Source: OMG DDS-RTPS 2.5, section 10 (CDR).
"""

import struct
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from seal_friction_ros.core.messages.definitions import PRIMITIVES, STRING, Definition, Field, short_name

ENCODING = 'cdr'  # Name of this encoding in bags.
ENCAPSULATION = b'\x00\x01\x00\x00'  # little endian, no options
LITTLE_ENDIAN = ENCAPSULATION[:2]
ORIGIN = len(ENCAPSULATION)  # [bytes] alignment counts from here
_SIZES = {code: struct.calcsize(f'<{code}') for code in ('s', *PRIMITIVES.values())}  # [bytes]


class Place(NamedTuple):
    """Where a number, a list of numbers or a text stands."""

    offset: int  # of the first byte
    code: str  # of one of them, as of `struct`; 's': a text, or a list of bytes
    amount: int = 1  # of the numbers, or of the bytes of a text with its end

    def element(self, number: int) -> 'Place':
        """One number of a list."""
        return Place(self.offset + number * _SIZES[self.code], 'B' if self.code == 's' else self.code)


class Walk:
    """Walks over the fields of one message of ``end`` bytes and notes where they are.

    ``length_at`` gives the length of the text or list that stands at an offset.
    """

    def __init__(self, definition: Definition, length_at: Callable[[int], int], end: int) -> None:
        self._definition, self._length_at, self._end = definition, length_at, end
        self.offset = ORIGIN
        self.slack = 3  # [bytes] that may follow: some writers pad to a multiple of 4, rclpy to the size it estimated
        self.lengths: list[Place] = []  # which the places behind them depend on
        self.places = [Place(0, 's', ORIGIN)]  # of all, lengths included, in order

    def message(self, kind: str) -> dict[str, Any]:
        """Places of the fields of a message, by their names."""
        return {field.name: self._field(field) for field in self._definition[kind]}

    def _field(self, field: Field) -> Any:
        if not field.form:
            return self._one(field.kind)
        count = self._length() if field.form == 'sequence' else field.size
        code = PRIMITIVES.get(field.kind)
        if code is not None:
            self.slack += 0 if count else 7
            return self._place('s' if code == 'B' else code, count)
        if count > self._end - self.offset:  # each one has a byte or more
            raise ValueError(f'{field.name} of {count} elements in {self._end} bytes')
        self.slack += 7 * count if '/' in field.kind else 0
        return [self._one(field.kind) for _ in range(count)]

    def _one(self, kind: str) -> Any:
        if kind == STRING:
            return self._place('s', self._length())
        code = PRIMITIVES.get(kind)
        return self.message(kind) if code is None else self._place(code)

    def _length(self) -> int:
        place = self._place('I')
        self.lengths.append(place)
        return self._length_at(place.offset)

    def _place(self, code: str, count: int = 1) -> Place:
        """The next ``count`` of a kind; ValueError if the message ends before."""
        size = _SIZES[code]
        if count:
            self.offset += -(self.offset - ORIGIN) % size
        place = Place(self.offset, code, count)
        self.places.append(place)
        self.offset += count * size
        if self.offset > self._end:
            raise ValueError(f'{self._end} bytes are too few for the message')
        return place


def walked(definition: Definition, type_name: str, data: bytes) -> tuple[Walk, dict[str, Any]]:
    """The walk over a message, and the places of its fields; ValueError if the bytes are not a message of the type."""
    if data[:2] != LITTLE_ENDIAN:
        raise ValueError(f'encapsulation {data[:4].hex()} is not little-endian CDR')
    walk = Walk(definition, lambda at: int.from_bytes(data[at : at + 4], 'little'), len(data))
    root = walk.message(short_name(type_name))
    if not walk.offset <= len(data) <= walk.offset + walk.slack:
        raise ValueError(f'{len(data)} bytes where the message has {walk.offset}')
    return walk, root


def laid_out(definition: Definition, type_name: str, lengths: Sequence[int]) -> list[Place]:
    """Places of all that a message has whose texts (with their ends) and lists have these lengths."""
    following = iter(lengths)
    walk = Walk(definition, lambda _: next(following), 1 << 62)
    walk.message(short_name(type_name))
    return walk.places


def struct_at(places: Sequence[Place]) -> struct.Struct:
    """Format of numbers and texts at these places, whose offsets increase."""
    text, end = '<', 0
    for offset, code, amount in places:
        text += f'{offset - end}x{amount}{code}'
        end = offset + amount * _SIZES[code]
    return struct.Struct(text)
