"""The coder of single messages for compiled code, which takes messages and makes answers within arrays of bytes."""

import struct
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from seal_friction_ros.core.foundation.arrays import BoolArray
from seal_friction_ros.core.foundation.compiled import compiled
from seal_friction_ros.core.messages import layouts
from seal_friction_ros.core.messages.blocks import Bytes, Messages
from seal_friction_ros.core.messages.cdr import LITTLE_ENDIAN, ORIGIN
from seal_friction_ros.core.messages.layouts import FRAME_AT, LENGTH_AT, LONGEST_FRAME, Layout, numbers_at

_FIRST, _SECOND = LITTLE_ENDIAN
_LARGEST = 2048  # [bytes] a message with numbers and the longest frame name has fewer
_SLOT = 8 - ORIGIN  # [bytes] before a message in an `Outbox`, so that its numbers stand at multiples of 8


class Outbox(NamedTuple):
    """Where compiled code puts answers: three views of the same bytes, and where each answer is in them."""

    small: Any
    words: Any
    numbers: Any
    offsets: Any  # of the estimate and the feed-forward to each message, shape (2, n); likewise
    sizes: Any
    cursor: Any  # [bytes] used so far, shape (1,)
    row: Any  # an answer as numbers, shape (16,)
    data: Any  # the messages, whose stamps and frame names the answers take over
    message_offsets: Any


@compiled
def integer_at(data: Bytes, offset: int, size: int) -> int:
    """Whole number of ``size`` bytes, little endian, without a sign if it is shorter than 8."""
    value = np.int64(0)
    for i in range(size):
        value |= np.int64(data[offset + i]) << np.int64(8 * i)
    return int(value)


@compiled
def _number(data: Bytes, offset: int) -> float:
    """float64 at any byte."""
    return float(np.int64(integer_at(data, offset, 8)).view(np.float64))


@compiled
def is_message(data: Bytes, offset: int, size: int, count: int) -> bool:
    """Whether ``size`` bytes at an offset are a stamped message with ``count`` float64, as `coder.decode` takes it."""
    if size < FRAME_AT or data[offset] != _FIRST or data[offset + 1] != _SECOND:
        return False
    length = integer_at(data, offset + LENGTH_AT, 4)
    if length > LONGEST_FRAME or integer_at(data, offset + layouts.NANOSECONDS_AT, 4) >= layouts.SECOND:
        return False
    whole = numbers_at(length) + 8 * count
    return bool(whole <= size <= whole + 3)


@compiled
def message_at(data: Bytes, offset: int, count: int) -> tuple[int, float, float, float]:
    """Stamp [ns] and the first ``count`` numbers, 1 to 3, all float64, of the message at an offset; then zeros."""
    seconds = np.int64(np.int32(np.uint32(integer_at(data, offset + layouts.SECONDS_AT, 4))))
    stamp = int(seconds * layouts.SECOND + integer_at(data, offset + layouts.NANOSECONDS_AT, 4))
    place = offset + numbers_at(integer_at(data, offset + LENGTH_AT, 4))
    first = _number(data, place)
    second = _number(data, place + 8) if count > 1 else 0.0
    third = _number(data, place + 16) if count > 2 else 0.0
    return stamp, first, second, third


def body_size(layout: Layout) -> int:
    """Room [bytes] of the numbers of an answer in an `Outbox`, a multiple of 8."""
    return (layout.size + 7) // 8 * 8


def outbox_for(messages: Messages, is_answered: BoolArray, numbers_size: int) -> Outbox:
    """Empty outbox with room for an estimate and a feed-forward to each message that may be answered.

    ``numbers_size`` is that of the numbers of both answers [bytes].
    """
    heads = (np.minimum(messages.sizes[is_answered], _LARGEST) + 23) // 8 * 8  # at most that of the message and 12 more
    small = np.zeros(2 * int(heads.sum()) + len(heads) * numbers_size, np.uint8)
    offsets, sizes = np.zeros((2, 2, len(messages.kinds)), np.int64)
    views = small, small.view(np.uint32), small.view(np.float64)
    return Outbox(*views, offsets, sizes, np.zeros(1, np.int64), np.zeros(16), messages.data, messages.offsets)


@cache
def writer(layout: Layout) -> Any:
    """Function that writes the answer in ``outbox.row`` by its layout.

    It takes the outbox apart at once: each access to an array of a record counts references, which costs more than the
    writing. Likewise all is one function, with a loop for each size of numbers.
    """
    places = list(zip(layout.offsets, map(struct.calcsize, layout.codes), strict=True))
    eights, fours, ones = (
        np.array([(k, at) for k, (at, size) in enumerate(places, start=1) if size == wanted], np.int64).reshape(-1, 2)
        for wanted in (8, 4, 1)
    )  # which number of the row, and where it goes [bytes]; an empty array compiles, an empty tuple does not
    size, padded = layout.size, body_size(layout)

    @compiled
    def write(outbox: Any, column: int, number: int) -> None:
        """Write the answer to message ``number``.

        Stamp and frame name are those of the message; the name ends in a zero byte, whatever its last byte was.
        """
        small, words, numbers, answer_offsets, answer_sizes, cursor, row, data, message_offsets = outbox
        slot, offset = cursor[0] + _SLOT, message_offsets[number]
        small[slot], small[slot + 1] = _FIRST, _SECOND
        for k in range(layouts.SECONDS_AT, LENGTH_AT):
            small[slot + k] = data[offset + k]
        length = max(integer_at(data, offset + LENGTH_AT, 4), 1)
        small[slot + LENGTH_AT] = length & 0xFF
        small[slot + LENGTH_AT + 1] = length >> 8
        for k in range(FRAME_AT, FRAME_AT + length - 1):
            small[slot + k] = data[offset + k]
        answer_offsets[column, number] = slot
        answer_sizes[column, number] = numbers_at(length) + size
        body = slot + numbers_at(length)
        finite = True
        for i in range(len(eights)):
            value = row[eights[i, 0]]
            finite = finite and np.isfinite(value)
            numbers[(body + eights[i, 1]) // 8] = value
        for i in range(len(fours)):
            words[(body + fours[i, 1]) // 4] = np.uint32(row[fours[i, 0]])
        for i in range(len(ones)):
            small[body + ones[i, 1]] = np.uint8(np.int64(row[ones[i, 0]]))
        cursor[0] = body + padded if finite else -1

    return write
