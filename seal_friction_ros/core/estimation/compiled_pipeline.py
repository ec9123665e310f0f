"""`pipeline.receive` compiled, many messages in one pass: the same source, the same bytes, two hundred times faster.

``state, answers = receive_all(parameters, state, messages)``. The messages stay as they lie in memory, one array of
bytes; the answers come as bytes, too. The state is that of `pipeline`, so blocks of messages follow each other, with
single messages between them.

This module decodes and encodes by `messages.LAYOUTS`; everything between is `pipeline`. Messages that do not fit are
refused (`UnsuitedError`); `pipeline.receive` then decides about them.
"""

import struct
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numba import literal_unroll
from numba.extending import overload

from seal_friction_ros.core.estimation.feedforward import FeedForward
from seal_friction_ros.core.estimation.message_blocks import Bytes, Integers, Kind, Messages, UnsuitedError
from seal_friction_ros.core.estimation.messages import (
    ESTIMATE_TYPE,
    FEEDFORWARD_TYPE,
    FORCE_TYPE,
    LAYOUTS,
    LONGEST_FRAME,
    PRESSURE_TYPE,
    REFERENCE_TYPE,
    SECOND,
    TEMPERATURE_TYPE,
    TICK_TYPE,
    VELOCITY_TYPE,
    Layout,
    head_size,
)
from seal_friction_ros.core.estimation.pipeline import (
    PipelineParameters,
    PipelineState,
    acting_since,
    receive_force,
    receive_pressure,
    receive_reference,
    receive_temperature,
    receive_tick,
    receive_velocity,
    send,
)
from seal_friction_ros.core.estimation.records import (
    NEVER,
    Force,
    FrictionEstimate,
    Pressure,
    ServoReference,
    Temperature,
    Velocity,
    WatchdogTick,
    numbers_in,
)
from seal_friction_ros.core.foundation.compiled import (
    INNER,
    closed,
    compiled,
    for_compiler,
    from_compiler,
    opened,
)

LATEST = 1 << 61  # [ns] stamps up to here, as messages have them: differences fit into 64 bits

_FORCE, _PRESSURE, _REFERENCE = int(Kind.FORCE), int(Kind.PRESSURE), int(Kind.REFERENCE)
_TEMPERATURE, _TICK, _VELOCITY = int(Kind.TEMPERATURE), int(Kind.TICK), int(Kind.VELOCITY)
_LAYOUTS = {layout.message_type: layout for layout in LAYOUTS}
_INPUT_TYPES = {
    _FORCE: FORCE_TYPE,
    _PRESSURE: PRESSURE_TYPE,
    _REFERENCE: REFERENCE_TYPE,
    _TEMPERATURE: TEMPERATURE_TYPE,
    _TICK: TICK_TYPE,
    _VELOCITY: VELOCITY_TYPE,
}
_NUMBERS = tuple(len(_LAYOUTS[_INPUT_TYPES[kind]].codes) if kind in _INPUT_TYPES else 0 for kind in Kind)
"""How many numbers an input of each kind has, all of them float64."""
_ANSWERS: dict[type, tuple[int, Layout]] = {
    FrictionEstimate: (0, _LAYOUTS[ESTIMATE_TYPE]),
    FeedForward: (1, _LAYOUTS[FEEDFORWARD_TYPE]),
}
"""Record of an answer -> its column in `_Outbox`, and its layout."""
_BODY_SIZES = tuple((layout.size + 7) // 8 * 8 for _, layout in _ANSWERS.values())  # [bytes] padded to 8


class Answers(NamedTuple):
    """What each message made the estimator send; the size is 0 where it sent nothing."""

    data: Bytes
    estimate_offsets: Integers
    estimate_sizes: Integers
    feedforward_offsets: Integers
    feedforward_sizes: Integers


class _Room(NamedTuple):
    """The bytes of the answers, in three views."""

    small: Any  # bytes
    words: Any  # uint32
    numbers: Any  # float64


class _Places(NamedTuple):
    """Where each answer is in its room."""

    offsets: Any  # of the estimate and the feed-forward to each message, shape (2, n); likewise
    sizes: Any
    cursor: Any  # [bytes] used so far, shape (1,)


class _Outbox(NamedTuple):
    """Where compiled code puts answers."""

    room: _Room
    places: _Places
    row: Any  # an answer as numbers, shape (16,)
    data: Any  # the messages, whose stamps and frame names the answers take over
    message_offsets: Any


def receive_all(
    parameters: PipelineParameters, state: PipelineState, messages: Messages
) -> tuple[PipelineState, Answers]:
    """Take messages as `pipeline.receive` takes them one after the other.

    Args:
        parameters: Settings and seals.
        state: From `pipeline.init`, a snapshot, or the messages before; it stays as it is.
        messages: At most `MOST_MESSAGES`, which bounds memory; those that are no input are passed over.

    Raises:
        UnsuitedError: A message is not of its kind, a stamp is out of bounds, or an answer is not finite.
    """
    if not all(map(_fits, numbers_in(state))):
        raise UnsuitedError('a whole number in the state')
    wrong, room = _check(*messages)
    if wrong >= 0:
        raise UnsuitedError(f'message {wrong}')
    small = np.zeros(room, np.uint8)
    places = np.zeros((2, 2, len(messages.kinds)), np.int64)
    outbox = _Outbox(
        room=_Room(small, small.view(np.uint32), small.view(np.float64)),
        places=_Places(places[0], places[1], np.zeros(1, np.int64)),
        row=np.zeros(16),
        data=messages.data,
        message_offsets=messages.offsets,
    )
    record, wrong = _receive_all(
        for_compiler(parameters), for_compiler(state), messages.kinds, messages.received, messages.sent, outbox
    )
    if wrong >= 0:
        raise UnsuitedError(f'an answer to message {wrong} is not finite')
    (estimates, feedforwards), (estimate_sizes, feedforward_sizes) = places
    answers = Answers(small, estimates, estimate_sizes, feedforwards, feedforward_sizes)
    return from_compiler(PipelineState, record), answers


def _fits(number: Any) -> bool:
    """Whether a whole number is small enough, so that differences do not leave 64 bits."""
    return isinstance(number, float) or number == NEVER or abs(number) <= LATEST


# -- compiled ---------------------------------------------------------------------------------------------------------


@compiled
def _integer(data: Bytes, offset: int, size: int) -> int:
    """Whole number of ``size`` bytes, little endian, without a sign if it is shorter than 8."""
    value = np.int64(0)
    for i in range(size):
        value |= np.int64(data[offset + i]) << np.int64(8 * i)
    return int(value)


@compiled
def _number(data: Bytes, offset: int) -> float:
    """float64 at any byte."""
    return float(np.int64(_integer(data, offset, 8)).view(np.float64))


@compiled
def _numbers(data: Bytes, offset: int, count: int) -> tuple[float, float, float]:
    """The first ``count`` numbers of a message, 1 to 3, then zeros."""
    first = _number(data, offset)
    second = _number(data, offset + 8) if count > 1 else 0.0
    third = _number(data, offset + 16) if count > 2 else 0.0
    return first, second, third


_head_size = compiled(head_size)


@compiled
def _stamp(data: Bytes, offset: int) -> int:
    """Stamp [ns] of a message."""
    seconds = np.int64(np.int32(np.uint32(_integer(data, offset + 4, 4))))
    return int(seconds * SECOND + _integer(data, offset + 8, 4))


@compiled
def _check(
    data: Bytes, kinds: Bytes, offsets: Integers, sizes: Integers, received: Integers, sent: Integers
) -> tuple[int, int]:
    """Check inputs as `messages.decode` does.

    Returns:
        The first message that is not of its kind, or -1; and the room [bytes] that all answers may need.
    """
    room = 0
    for i in range(len(kinds)):
        kind, offset, size = kinds[i], offsets[i], sizes[i]
        if not _FORCE <= kind <= _VELOCITY:
            continue
        if not (0 <= received[i] <= LATEST and 0 <= sent[i] <= LATEST):
            return i, 0
        if size < 16 or data[offset] != 0 or data[offset + 1] != 1:
            return i, 0
        nanoseconds, length = _integer(data, offset + 8, 4), _integer(data, offset + 12, 4)
        if length > LONGEST_FRAME or nanoseconds >= SECOND:
            return i, 0
        whole = 4 + _head_size(length) + 8 * _NUMBERS[kind]
        if not whole <= size <= whole + 3:
            return i, 0
        head = _head_size(max(length, 1))  # an empty name is answered by one of one byte, its end
        if kind == _VELOCITY:
            room += 8 + head + _BODY_SIZES[0]
        if kind >= _TICK:
            room += 8 + head + _BODY_SIZES[1]
    return -1, room


@compiled
def _receive_all(
    parameters: Any, before: Any, kinds: Bytes, receipts: Integers, sent: Integers, outbox: Any
) -> tuple[Any, int]:
    """The pass: the next state, and the number of the first message whose answer is not finite, or -1."""
    state, data, message_offsets, cursor = opened(before), outbox.data, outbox.message_offsets, outbox.places.cursor
    for i in range(len(kinds)):
        kind = kinds[i]
        if not _FORCE <= kind <= _VELOCITY:
            continue
        offset, received = message_offsets[i], receipts[i]
        since = acting_since(parameters.feedforward, received, sent[i])
        body = offset + 4 + _head_size(_integer(data, offset + 12, 4))
        stamp = _stamp(data, offset)
        first, second, third = _numbers(data, body, _NUMBERS[kind])
        if kind == _VELOCITY:
            receive_velocity(parameters, state, Velocity(stamp, first, i), received, since, outbox)
        elif kind == _PRESSURE:
            receive_pressure(parameters, state, Pressure(stamp, first, second), received, since, outbox)
        elif kind == _FORCE:
            receive_force(parameters, state, Force(stamp, first), received, since, outbox)
        elif kind == _TEMPERATURE:
            receive_temperature(parameters, state, Temperature(stamp, first, second), received, since, outbox)
        elif kind == _TICK:
            receive_tick(parameters, state, WatchdogTick(stamp, first, i), received, since, outbox)
        else:
            wanted = ServoReference(stamp, first, second, third, i)
            receive_reference(parameters, state, wanted, received, since, outbox)
        if cursor[0] < 0:
            return before, i
    return closed(state), -1


@overload(send, jit_options=INNER)
def _send(emit: Any, record: Any, frame_id: Any) -> Any:
    """`pipeline.send` in compiled code: the record goes into the outbox. The frame is the number of the message."""
    del frame_id  # overload compares the names with those of `send`
    if getattr(emit, 'instance_class', None) is not _Outbox:
        return None
    column, layout = _ANSWERS[record.instance_class]
    write = _writer(layout)

    def implementation(emit: Any, record: Any, frame_id: Any) -> None:
        """What compiled code runs."""
        k = 0
        for value in literal_unroll(record):
            emit.row[k] = value
            k += 1  # noqa: SIM113  enumerate cannot be unrolled
        write(emit, column, frame_id)

    return implementation


@cache
def _writer(layout: Layout) -> Any:
    """Function that writes the answer in ``outbox.row`` by its layout.

    It takes the outbox apart at once: each access to an array of a record counts references, which costs more than the
    writing. Likewise all is one function, with a loop for each size of numbers.
    """
    places = list(zip(layout.offsets, map(struct.calcsize, layout.codes), strict=True))
    eights, fours, ones = (
        np.array([(k, at) for k, (at, size) in enumerate(places, start=1) if size == wanted], np.int64).reshape(-1, 2)
        for wanted in (8, 4, 1)
    )  # which number of the row, and where it goes [bytes]; an empty array compiles, an empty tuple does not
    size, padded = layout.size, (layout.size + 7) // 8 * 8

    @compiled
    def write(outbox: Any, column: int, number: int) -> None:
        """Write the answer to message ``number``.

        Stamp and frame name are those of the message; the name ends in a zero byte, whatever its last byte was. The
        numbers that follow are aligned to 8 bytes.
        """
        small, words, numbers = outbox.room
        answer_offsets, answer_sizes, cursor = outbox.places
        row, data = outbox.row, outbox.data
        slot, offset = cursor[0], outbox.message_offsets[number]
        small[slot + 5] = 1  # encapsulation
        for k in range(8):
            small[slot + 8 + k] = data[offset + 4 + k]
        length = max(_integer(data, offset + 12, 4), 1)
        small[slot + 16] = length & 0xFF
        small[slot + 17] = length >> 8
        for k in range(length - 1):
            small[slot + 20 + k] = data[offset + 16 + k]
        head = _head_size(length)
        answer_offsets[column, number] = slot + 4
        answer_sizes[column, number] = 4 + head + size
        body = slot + 8 + head
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
