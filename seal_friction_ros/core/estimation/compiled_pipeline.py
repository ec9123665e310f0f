"""Many messages at once through the same functions as one by one (`pipeline.receive`), compiled: the same bytes.

``state, answers = receive_all(parameters, state, messages)``. The messages stay as they lie in memory, one array of
bytes; the answers come as bytes, too. Three passes: what friction is asked for, that friction for all answers
(`bulk_friction`), and the answers. The state is that of `pipeline`, so blocks of messages follow each other, and single
messages between them.

What one pass does at a message is what `pipeline.receive` does, with the functions that are in `COMPILABLE`; the tests
hold the two together. What does not fit is refused (`UnsuitedError`), and `pipeline.receive` has the last word on it.
"""

import dataclasses
from collections import namedtuple
from enum import IntEnum
from functools import lru_cache
from typing import Any, NamedTuple

import numba
import numpy as np
import numpy.typing as npt

from seal_friction_ros.core.estimation import estimator, feedforward
from seal_friction_ros.core.estimation.bulk_friction import ActuatorFrictions, actuator_frictions
from seal_friction_ros.core.estimation.feedforward import FeedForward, Motion
from seal_friction_ros.core.estimation.pipeline import (
    PipelineParameters,
    PipelineState,
    Reference,
    is_fading,
    motion_at,
)
from seal_friction_ros.core.estimation.records import (
    NEVER,
    NO_ESTIMATE,
    Force,
    FrictionEstimate,
    Pressure,
    RodSample,
    Status,
)
from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.foundation.compilable import COMPILABLE
from seal_friction_ros.core.foundation.compiled import compiled
from seal_friction_ros.core.friction.actuator import ActuatorFriction

Bytes = npt.NDArray[np.uint8]
Integers = npt.NDArray[np.int64]

MOST_MESSAGES = 1 << 16  # that are computed at once: enough to be fast, and memory is bounded
_LATEST = 1 << 61  # [ns] stamps up to here, as messages have them: differences fit into 64 bits
_LONGEST_FRAME = 1024  # [bytes] as in `wire`

_observe, _answer, _feedforward = estimator.observe, estimator.answer, feedforward.step
_wanted_velocity = feedforward.wanted_velocity
_PRESSURE_MISSING = int(Status.PRESSURE_MISSING)
_NO_FRICTION = ActuatorFriction(0.0, 0.0, 0.0, True, 0.0)

for _function in COMPILABLE:
    numba.extending.register_jitable(error_model='numpy')(_function)


class Kind(IntEnum):
    """What a message is to the estimator; inputs from FORCE to VELOCITY, those with two values next to each other."""

    OTHER = 0
    FORCE = 1
    PRESSURE = 2
    REFERENCE = 3
    VELOCITY = 4
    ESTIMATE = 5
    FEEDFORWARD = 6
    CONFIGURATION = 7
    OTHER_ESTIMATE = 8
    """of another estimator"""


_PRESSURE, _FORCE, _REFERENCE, _VELOCITY = (
    int(kind) for kind in (Kind.PRESSURE, Kind.FORCE, Kind.REFERENCE, Kind.VELOCITY)
)


class UnsuitedError(Exception):
    """Messages that are not for this way: malformed, or with numbers beyond what compiled code holds."""


class Messages(NamedTuple):
    """Serialised messages in order of receipt, n of them."""

    data: Bytes
    """all their bytes, and others between them"""
    kinds: Bytes
    """`Kind` of each, shape (n,)"""
    offsets: Integers
    """where each begins in ``data``, shape (n,)"""
    sizes: Integers
    """[bytes] shape (n,)"""

    def taken(self, first: int, end: int) -> 'Messages':
        """Some that follow each other."""
        return Messages(self.data, self.kinds[first:end], self.offsets[first:end], self.sizes[first:end])

    def message(self, number: int) -> bytes:
        """Bytes of one."""
        offset = self.offsets[number]
        return self.data[offset : offset + self.sizes[number]].tobytes()


class Answers(NamedTuple):
    """What the messages made come out, for each of them; the size is 0 where nothing did."""

    data: Bytes
    estimate_offsets: Integers
    estimate_sizes: Integers
    feedforward_offsets: Integers
    feedforward_sizes: Integers


def receive_all(
    parameters: PipelineParameters, state: PipelineState, messages: Messages
) -> tuple[PipelineState, Answers]:
    """Take messages as `pipeline.receive` takes one after the other.

    Args:
        parameters: Settings and seals.
        state: From `pipeline.init`, a snapshot, or the messages before.
        messages: At most `MOST_MESSAGES`, or memory is what they need; those that are no input are passed over.

    Raises:
        UnsuitedError: A message is not what its kind says, or a stamp is out of bounds.
    """
    if not _fits(state):
        raise UnsuitedError('a whole number in the state')
    settings, guiding = _numbers(parameters.estimator.settings), _numbers(parameters.feedforward)
    kinds, count = messages.kinds, len(messages.kinds)
    stamps, values, heads = np.zeros(count, np.int64), np.zeros((count, 2)), np.zeros(count, np.int64)
    wrong, room = _decode(*messages, stamps, values, heads)
    if wrong >= 0:
        raise UnsuitedError(f'message {wrong}')
    asked = np.zeros((4, int(np.count_nonzero(kinds == _VELOCITY))))
    _ask(settings, guiding, state, kinds, stamps, values, asked)
    frictions, guiding_friction = _frictions(parameters, asked)
    answers = Answers(np.zeros(room, np.uint8), *np.zeros((4, count), np.int64))
    views = (answers.data, answers.data.view(np.uint32), answers.data.view(np.float64))
    inputs = (kinds, stamps, values, messages.data, messages.offsets, heads)
    state = _make_answers(settings, guiding, state, inputs, frictions, guiding_friction, views, answers[1:])
    return state, answers


def _fits(value: Any) -> bool:
    """Whether all whole numbers are small enough, so that differences do not leave 64 bits."""
    if isinstance(value, tuple):
        return all(map(_fits, value))
    return isinstance(value, float) or value == NEVER or abs(value) <= _LATEST


@lru_cache(maxsize=8)
def _numbers(settings: Any) -> Any:
    """Settings as a named tuple, which is what can be compiled."""
    values = dataclasses.asdict(settings)
    return _record(type(settings).__name__, tuple(values))(**values)


@lru_cache(maxsize=8)
def _record(name: str, fields: tuple[str, ...]) -> Any:
    return namedtuple(name, fields)


def _frictions(parameters: PipelineParameters, asked: FloatArray) -> tuple[ActuatorFrictions, FloatArray]:
    """Friction for each answer, and the velocity friction [N] at the velocity that the feed-forward is for."""
    seals = parameters.estimator.seals
    pressure_a, pressure_b, velocity, wanted = asked
    with np.errstate(all='ignore'):
        frictions = actuator_frictions(seals, pressure_a, pressure_b, velocity)
        guiding = np.zeros(len(wanted))
        if any(mounted.seal.velocity_law for mounted in seals):
            known = ~np.isnan(wanted)
            at_wanted = actuator_frictions(seals, pressure_a, pressure_b, np.where(known, wanted, 0.0))
            guiding = np.where(known, at_wanted.velocity_friction, 0.0)
    if not all(np.isfinite(values).all() for values in (*frictions, guiding)):
        raise UnsuitedError('a friction is not finite')
    return frictions, guiding


# -- compiled ---------------------------------------------------------------------------------------------------------


@compiled
def _integer(data: Bytes, offset: int, size: int) -> int:
    """Whole number of ``size`` bytes, little endian, without a sign if it is shorter than 8."""
    value = np.int64(0)
    for i in range(size):
        value |= np.int64(data[offset + i]) << np.int64(8 * i)
    return int(value)


@compiled
def _head_size(frame_length: int) -> int:
    """Bytes of stamp and frame name, padded to where a float64 may begin."""
    return (12 + frame_length + 7) // 8 * 8


@compiled
def _decode(
    data: Bytes,
    kinds: Bytes,
    offsets: Integers,
    sizes: Integers,
    stamps: Integers,
    values: FloatArray,
    heads: Integers,
) -> tuple[int, int]:
    """As `wire` decodes inputs: stamps [ns], the values that count, and sizes of the heads that their answers have.

    Returns:
        The first message that is not what its kind says, or -1; and the room [bytes] that all answers may need.
    """
    room = 0
    for i in range(len(kinds)):
        kind, offset, size = kinds[i], offsets[i], sizes[i]
        if not _FORCE <= kind <= _VELOCITY:
            continue
        if size < 16 or data[offset] != 0 or data[offset + 1] != 1:
            return i, 0
        seconds = np.int64(np.int32(np.uint32(_integer(data, offset + 4, 4))))
        nanoseconds, length = _integer(data, offset + 8, 4), _integer(data, offset + 12, 4)
        if length > _LONGEST_FRAME or nanoseconds >= 1_000_000_000:
            return i, 0
        body = 4 + _head_size(length)
        whole = body + (24 if kind == _REFERENCE else 16 if kind == _PRESSURE else 8)
        if not whole <= size <= whole + 3:
            return i, 0
        stamps[i] = seconds * 1_000_000_000 + nanoseconds
        body += offset + (8 if kind == _REFERENCE else 0)  # the position wanted is of no use here
        values[i, 0] = np.int64(_integer(data, body, 8)).view(np.float64)
        if _PRESSURE <= kind <= _REFERENCE:
            values[i, 1] = np.int64(_integer(data, body + 8, 8)).view(np.float64)
        heads[i] = _head_size(length)  # an answer to a name of no bytes has one of one byte, with the same padding
        if kind == _VELOCITY:
            room += 8 + heads[i] + 48
        if kind >= _REFERENCE:
            room += 8 + heads[i] + 24
    return -1, room


@compiled
def _newest(
    kind: int, stamp: int, values: FloatArray, pressure: Pressure, force: Force, reference: Reference
) -> tuple[Pressure, Force, Reference]:
    """Inputs in use after a message."""
    if kind == _PRESSURE:
        pressure = Pressure(stamp, values[0], values[1])
    elif kind == _FORCE:
        force = Force(stamp, values[0])
    elif kind == _REFERENCE:
        reference = Reference(stamp, values[0], values[1])
    return pressure, force, reference


@compiled
def _ask(
    settings: Any,
    guiding: Any,
    state: PipelineState,
    kinds: Bytes,
    stamps: Integers,
    values: FloatArray,
    asked: FloatArray,
) -> None:
    """First pass: pressures [Pa] and velocity [m/s] of each answer, and the velocity of its feed-forward (or NaN)."""
    known, _, pressure, force, reference, refused = state
    answers = 0
    for i in range(len(kinds)):
        stamp, kind = stamps[i], kinds[i]
        pressure, force, reference = _newest(kind, stamp, values[i], pressure, force, reference)
        if kind == _VELOCITY:
            known, seen = _observe(settings, known, RodSample(stamp, values[i, 0], pressure, force, refused))
            asked[0, answers] = known.pressure.chamber_a
            asked[1, answers] = known.pressure.chamber_b
            asked[2, answers] = seen.velocity
            asked[3, answers] = _wanted_velocity(guiding, motion_at(reference, stamp, values[i, 0]))
            answers += 1


@compiled
def _make_answers(
    settings: Any,
    guiding: Any,
    state: PipelineState,
    inputs: Any,
    frictions: ActuatorFrictions,
    guiding_friction: FloatArray,
    views: Any,
    places: Any,
) -> PipelineState:
    """Last pass: all that `pipeline.receive` does, but for the friction, which is there."""
    kinds, stamps, values, data, offsets, heads = inputs
    estimate_offsets, estimate_sizes, feedforward_offsets, feedforward_sizes = places
    known, guided, pressure, force, reference, refused = state
    answers = slot = 0
    for i in range(len(kinds)):
        stamp, kind = stamps[i], kinds[i]
        motion = Motion(0.0, 0.0, 0.0, 0.0, 0.0)
        estimate = NO_ESTIMATE
        makes_feedforward = False
        pressure, force, reference = _newest(kind, stamp, values[i], pressure, force, reference)
        if kind == _REFERENCE:
            makes_feedforward = is_fading(guiding, known.stamp, stamp)
            motion = Motion(reference.velocity, reference.acceleration, 0.0, 0.0, 0.0)
        elif kind == _VELOCITY:
            known, seen = _observe(settings, known, RodSample(stamp, values[i, 0], pressure, force, refused))
            friction = _NO_FRICTION
            if not seen.status & _PRESSURE_MISSING:
                friction = ActuatorFriction(
                    frictions.coulomb_friction[answers],
                    frictions.coulomb_friction_std[answers],
                    frictions.stiction[answers],
                    frictions.in_identified_range[answers],
                    frictions.velocity_friction[answers],
                )
            estimate = _answer(settings, known, seen, friction)
            estimate_offsets[i] = slot + 4
            estimate_sizes[i] = 4 + heads[i] + 48
            _write_head(views[0], slot, data, offsets[i])
            _write_estimate(views, (slot + 8 + heads[i]) // 8, estimate)
            slot += 8 + heads[i] + 48
            makes_feedforward = reference.stamp != NEVER or guiding.use_measured_velocity
            at = motion_at(reference, stamp, values[i, 0])
            added = guiding_friction[answers] if known.pressure.stamp != NEVER else 0.0
            motion = Motion(
                at.reference_velocity, at.reference_acceleration, at.measured_velocity, at.reference_age, added
            )
            answers += 1
        if makes_feedforward:
            guided, compensation = _feedforward(guiding, guided, stamp, estimate, motion)
            feedforward_offsets[i] = slot + 4
            feedforward_sizes[i] = 4 + heads[i] + 20
            _write_head(views[0], slot, data, offsets[i])
            _write_feedforward(views, (slot + 8 + heads[i]) // 8, compensation)
            slot += 8 + heads[i] + 24
    return PipelineState(known, guided, pressure, force, reference, refused)


@compiled
def _write_head(out: Bytes, slot: int, data: Bytes, offset: int) -> None:
    """Encapsulation, stamp and frame name of the message that is answered; it ends in a zero whatever stood there."""
    out[slot + 5] = 1
    length = _integer(data, offset + 12, 4)
    for k in range(8):
        out[slot + 8 + k] = data[offset + 4 + k]
    if length == 0:
        length = 1
    out[slot + 16] = length & 0xFF
    out[slot + 17] = length >> 8
    for k in range(length - 1):
        out[slot + 20 + k] = data[offset + 16 + k]


@compiled
def _write_estimate(views: Any, place: int, estimate: FrictionEstimate) -> None:
    """Body of a FrictionEstimate; ``place`` is where it begins, in units of 8 bytes."""
    small, words, numbers = views
    numbers[place] = estimate.coulomb_friction
    numbers[place + 1] = estimate.coulomb_friction_std
    numbers[place + 2] = estimate.breakaway_force
    numbers[place + 3] = estimate.friction_force
    small[8 * place + 32] = np.uint8(estimate.state.value)
    small[8 * place + 33] = np.uint8(estimate.direction)
    words[2 * place + 9] = estimate.status
    numbers[place + 5] = estimate.input_age


@compiled
def _write_feedforward(views: Any, place: int, compensation: FeedForward) -> None:
    """Body of a FrictionFeedForward."""
    _, words, numbers = views
    numbers[place] = compensation.force
    numbers[place + 1] = compensation.scale
    words[2 * place + 4] = compensation.limited
