"""Many serialised messages at once, as they lie in memory: for bulk readers and for the compiled pipeline."""

from collections.abc import Iterator
from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from seal_friction_ros.core.foundation.arrays import FloatArray, IntArray
from seal_friction_ros.core.foundation.errors import named_errors
from seal_friction_ros.core.friction.states import FrictionState
from seal_friction_ros.core.messages import layouts
from seal_friction_ros.core.messages.cdr import LITTLE_ENDIAN
from seal_friction_ros.core.messages.coder import decode
from seal_friction_ros.core.messages.layouts import FRAME_AT, LAYOUT_OF, LENGTH_AT, LONGEST_FRAME, SECOND

Bytes = npt.NDArray[np.uint8]
Integers = npt.NDArray[np.int64]

MOST_MESSAGES = 1 << 16  # in one call: enough to be fast, and memory is bounded


class Kind(IntEnum):
    """What a message is to the estimator."""

    OTHER = 0
    FORCE = 1
    PRESSURE = 2
    REFERENCE = 3
    TEMPERATURE = 4
    TICK = 5
    VELOCITY = 6
    ESTIMATE = 7
    FEEDFORWARD = 8
    CONFIGURATION = 9
    OTHER_ESTIMATE = 10  # of another estimator
    POSITION = 11


class UnsuitedError(Exception):
    """Messages that compiled code cannot process: malformed, or with numbers beyond what it holds."""


class Messages(NamedTuple):
    """Serialised messages in order of receipt, n of them."""

    data: Bytes  # all their bytes, and others between them
    kinds: Bytes  # `Kind` of each, shape (n,)
    offsets: Integers  # where each begins in ``data``, shape (n,)
    sizes: Integers  # [bytes] shape (n,)
    received: Integers  # [ns] log time of each, shape (n,)
    sent: Integers  # [ns] publish time of each, shape (n,)

    def taken(self, first: int, end: int) -> 'Messages':
        """The messages from number ``first`` to before number ``end``."""
        return self.in_order(slice(first, end))

    def in_order(self, order: slice | Integers) -> 'Messages':
        """Some of the messages, or all in another order."""
        data, kinds, *columns = self
        return Messages(data, kinds[order], *(column[order] for column in columns))

    def message(self, number: int) -> bytes:
        """Bytes of one message."""
        offset = self.offsets[number]
        return self.data[offset : offset + self.sizes[number]].tobytes()


class Numbers(NamedTuple):
    """The messages of one kind in a block, n of them."""

    places: IntArray  # numbers in the block
    stamps: IntArray  # [ns]
    numbers: FloatArray  # shape (fields, n)


def numbers_of(messages: Messages, kind: int, type_name: str, topic: str = '') -> Numbers:
    """Numbers of all messages of a kind, of a type in `LAYOUTS`; ValueError, with topic and time, of a bad one."""
    layout = LAYOUT_OF[type_name]
    places = np.flatnonzero(messages.kinds == kind)
    offsets, sizes, data = messages.offsets[places], messages.sizes[places], messages.data
    data = data if len(data) >= FRAME_AT else np.zeros(FRAME_AT, np.uint8)  # then every message is malformed
    stamps, numbers = np.zeros(len(places), np.int64), np.zeros((len(layout.codes), len(places)))
    is_usual = sizes >= FRAME_AT
    head = data[np.where(is_usual, offsets, 0)[:, np.newaxis] + np.arange(FRAME_AT)]
    seconds, nanoseconds, length = (
        head[:, at : at + 4].view(code)[:, 0].astype(np.int64)
        for at, code in ((layouts.SECONDS_AT, '<i4'), (layouts.NANOSECONDS_AT, '<u4'), (LENGTH_AT, '<u4'))
    )
    begin = layouts.numbers_at(length)
    spare = sizes - begin - layout.size
    is_usual &= (head[:, 0] == LITTLE_ENDIAN[0]) & (head[:, 1] == LITTLE_ENDIAN[1])
    is_usual &= (nanoseconds < SECOND) & (length <= LONGEST_FRAME) & (spare >= 0) & (spare <= 3)
    usual = slice(None) if is_usual.all() else is_usual
    stamps[usual] = (seconds * SECOND + nanoseconds)[usual]
    starts = (offsets + begin)[usual, np.newaxis]
    for row, code, at in zip(numbers, layout.codes, layout.offsets, strict=True):
        kept = np.dtype(code).newbyteorder('<')
        row[usual] = data[starts + (at + np.arange(kept.itemsize))].view(kept)[:, 0]
    if 'state' in layout.fields:
        is_usual &= np.isin(numbers[layout.fields.index('state')], list(FrictionState))
    for number in np.flatnonzero(~is_usual).tolist():  # of an older layout, or malformed
        place = int(places[number])
        with named_errors(f'message on {topic} at {messages.received[place]} ns'):
            stamps[number], *values = decode(type_name, messages.message(place))
        numbers[:, number] = values[: len(numbers)]
    return Numbers(places, stamps, numbers)


def frame_names(messages: Messages, places: IntArray) -> Iterator[bytes]:
    """Frame name of each message with another one than those before; the messages have headers that are valid."""
    offsets = messages.offsets[places]
    while len(offsets):
        begin = int(offsets[0]) + LENGTH_AT
        length = int.from_bytes(messages.data[begin : begin + FRAME_AT - LENGTH_AT].tobytes(), 'little')
        name: Any = messages.data[begin : begin + FRAME_AT - LENGTH_AT + length]
        yield name[FRAME_AT - LENGTH_AT : -1].tobytes()
        inside = offsets + FRAME_AT + length <= len(messages.data)
        offsets = offsets[inside]
        others = messages.data[offsets[:, np.newaxis] + LENGTH_AT + np.arange(len(name))]
        offsets = offsets[(others != name).any(axis=1)]
