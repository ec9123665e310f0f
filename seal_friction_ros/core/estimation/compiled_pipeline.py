"""`pipeline.receive` compiled, many messages in one pass: the same source, the same bytes, two hundred times faster.

``state, answers = receive_all(parameters, state, messages)``. The messages stay as they lie in memory, one array of
bytes; the answers come as bytes, too. The state is that of `pipeline`, so blocks of messages follow each other, with
single messages between them.

`compiled_coder` decodes and encodes; everything between is `pipeline`. Messages that do not fit are
refused (`UnsuitedError`); `pipeline.receive` then decides about them.
"""

from typing import Any, NamedTuple

from numba import literal_unroll
from numba.extending import overload

from seal_friction_ros.core.estimation.pipeline import (
    LATEST,
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
from seal_friction_ros.core.foundation.compiled import (
    INNER,
    closed,
    compiled,
    for_compiler,
    from_compiler,
    opened,
)
from seal_friction_ros.core.messages.blocks import Bytes, Integers, Kind, Messages, UnsuitedError
from seal_friction_ros.core.messages.compiled_coder import Outbox, body_size, is_message, message_at, outbox_for, writer
from seal_friction_ros.core.messages.layouts import (
    ESTIMATE_TYPE,
    FEEDFORWARD_TYPE,
    FORCE_TYPE,
    LAYOUT_OF,
    PRESSURE_TYPE,
    REFERENCE_TYPE,
    TEMPERATURE_TYPE,
    TICK_TYPE,
    VELOCITY_TYPE,
    Layout,
)
from seal_friction_ros.core.messages.records import (
    NEVER,
    FeedForward,
    Force,
    FrictionEstimate,
    Pressure,
    ServoReference,
    Temperature,
    Velocity,
    WatchdogTick,
    numbers_in,
)

_FORCE, _PRESSURE, _REFERENCE = int(Kind.FORCE), int(Kind.PRESSURE), int(Kind.REFERENCE)
_TEMPERATURE, _TICK, _VELOCITY = int(Kind.TEMPERATURE), int(Kind.TICK), int(Kind.VELOCITY)
_INPUT_TYPES = {
    _FORCE: FORCE_TYPE,
    _PRESSURE: PRESSURE_TYPE,
    _REFERENCE: REFERENCE_TYPE,
    _TEMPERATURE: TEMPERATURE_TYPE,
    _TICK: TICK_TYPE,
    _VELOCITY: VELOCITY_TYPE,
}
_NUMBERS = tuple(len(LAYOUT_OF[_INPUT_TYPES[kind]].codes) if kind in _INPUT_TYPES else 0 for kind in Kind)
"""How many numbers an input of each kind has, all of them float64."""
_ANSWERS: dict[type, tuple[int, Layout]] = {
    FrictionEstimate: (0, LAYOUT_OF[ESTIMATE_TYPE]),
    FeedForward: (1, LAYOUT_OF[FEEDFORWARD_TYPE]),
}
"""Record of an answer -> its column in `Outbox`, and its layout."""
_ANSWERS_SIZE = sum(body_size(layout) for _, layout in _ANSWERS.values())  # [bytes] of the numbers of both


class Answers(NamedTuple):
    """What each message made the estimator send; the size is 0 where it sent nothing."""

    data: Bytes
    estimate_offsets: Integers
    estimate_sizes: Integers
    feedforward_offsets: Integers
    feedforward_sizes: Integers


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
    is_answered = (messages.kinds == _TICK) | (messages.kinds == _VELOCITY)
    outbox = outbox_for(messages, is_answered, _ANSWERS_SIZE)
    record, wrong = _receive_all(for_compiler(parameters), for_compiler(state), messages, outbox)
    if wrong >= 0:
        raise UnsuitedError(
            f'message {wrong}' if outbox.cursor[0] >= 0 else f'an answer to message {wrong} is not finite'
        )
    (estimates, feedforwards), (estimate_sizes, feedforward_sizes) = outbox.offsets, outbox.sizes
    data = outbox.small[: outbox.cursor[0]]
    answers = Answers(data, estimates, estimate_sizes, feedforwards, feedforward_sizes)
    return from_compiler(PipelineState, record), answers


def _fits(number: Any) -> bool:
    """Whether a whole number is small enough, so that differences do not leave 64 bits."""
    return isinstance(number, float) or number == NEVER or abs(number) <= LATEST


# -- compiled ---------------------------------------------------------------------------------------------------------


@compiled
def _receive_all(parameters: Any, before: Any, messages: Messages, outbox: Any) -> tuple[Any, int]:
    """The pass: the next state, and the number of the first message that does not fit, or its answer, or -1."""
    state, cursor = opened(before), outbox.cursor
    data, kinds, message_offsets = messages.data, messages.kinds, messages.offsets
    sizes, receipts, sent = messages.sizes, messages.received, messages.sent
    for i in range(len(kinds)):
        kind = kinds[i]
        if not _FORCE <= kind <= _VELOCITY:
            continue
        offset, received = message_offsets[i], receipts[i]
        in_bounds = 0 <= received <= LATEST and 0 <= sent[i] <= LATEST
        if not (in_bounds and is_message(data, offset, sizes[i], _NUMBERS[kind])):
            return before, i
        since = acting_since(parameters.feedforward, received, sent[i])
        stamp, first, second, third = message_at(data, offset, _NUMBERS[kind])
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
    if getattr(emit, 'instance_class', None) is not Outbox:
        return None
    column, layout = _ANSWERS[record.instance_class]
    write = writer(layout)

    def implementation(emit: Any, record: Any, frame_id: Any) -> None:
        """What compiled code runs."""
        k = 0
        for value in literal_unroll(record):
            emit.row[k] = value
            k += 1  # noqa: SIM113  enumerate cannot be unrolled
        write(emit, column, frame_id)

    return implementation
