"""`pipeline.receive` compiled, message by message, for the live node: the same source, the same bytes.

``state = receive(parameters, CompiledState(...), message, received, emit)``. A state of records would have to be
converted at each call, which takes 8 us each way. So the state stays in compiled memory: a message changes it in place,
and a call costs 1 us. Pressure and force make no answer, so they wait for the next message and go with its call. Who
reads an attribute of `PipelineState` gets the converted one.

What compiled code cannot take (as of `compiled_pipeline.UnsuitedError`, or of a kind not in `_INPUTS`) is taken by
`pipeline.receive`. If that raises, the state is as it was before the first record with this time of receipt: the
records that one raw message makes are taken all or none, as `machine.receive` does it.
"""

import math
from typing import Any, NamedTuple, cast

import numpy as np
from numba import literal_unroll
from numba.extending import overload

from seal_friction_ros.core.estimation import pipeline
from seal_friction_ros.core.estimation.compiled_pipeline import LATEST, Kind
from seal_friction_ros.core.estimation.estimator import EstimatorState
from seal_friction_ros.core.estimation.feedforward import FeedForward, FeedForwardState
from seal_friction_ros.core.estimation.messages import LAYOUTS, Input
from seal_friction_ros.core.estimation.pipeline import (
    Emit,
    PipelineParameters,
    PipelineState,
    Turn,
    receive_force,
    receive_pressure,
    receive_reference,
    receive_temperature,
    receive_tick,
    receive_velocity,
    send,
    turn_between,
)
from seal_friction_ros.core.estimation.records import (
    NEVER,
    Force,
    FrictionEstimate,
    Position,
    Pressure,
    ServoReference,
    Temperature,
    Velocity,
    WatchdogTick,
)
from seal_friction_ros.core.foundation.compiled import INNER, compiled, for_compiler, keep

_REFERENCE, _TEMPERATURE, _TICK, _VELOCITY = (
    int(kind) for kind in (Kind.REFERENCE, Kind.TEMPERATURE, Kind.TICK, Kind.VELOCITY)
)
_NONE = int(Kind.OTHER)
_ZEROS = (0.0, 0.0, 0.0)
_INPUTS: dict[type, tuple[int, int, tuple[float, ...]]] = {
    ServoReference: (_REFERENCE, 4, ()),
    Temperature: (_TEMPERATURE, 3, _ZEROS[:1]),
    WatchdogTick: (_TICK, 2, _ZEROS[:2]),
    Velocity: (_VELOCITY, 2, _ZEROS[:2]),
}
"""Record of an input -> kind, end of its numbers, and what makes them three."""
_WAITING = (Pressure, Force)  # inputs that make no answer
_NO_PRESSURE, _NO_FORCE = (-1, 0, 0.0, 0.0), (-1, 0, 0.0)
"""Nothing waits: time of receipt, stamp, numbers."""
_ESTIMATED, _GUIDED, _TURNED, _FAILED = 1, 2, 4, 8  # bits of what a message did
_WHOLE = {
    layout.record: tuple(k for k, code in enumerate(layout.codes) if code != 'd')
    for layout in LAYOUTS
    if layout.record in (FrictionEstimate, FeedForward)
}
"""Record of an answer -> places of its numbers, without the stamp, that are whole."""


class _Rows(NamedTuple):
    """Where compiled code puts answers as numbers, without their stamps."""

    estimate: Any
    feedforward: Any
    done: Any  # bits, shape (1,)


class CompiledState:
    """A `PipelineState` in compiled memory.

    Args:
        parameters: Settings and seals; whoever makes a state for them for the first time compiles.
        state: As records.
    """

    def __init__(self, parameters: PipelineParameters, state: PipelineState) -> None:
        self.parameters = parameters
        self._known = keep(for_compiler(parameters))
        self._rows = _Rows(np.zeros(16), np.zeros(8), np.zeros(1, np.int64))
        self._hold(state, state, NEVER)
        self._records: PipelineState | None = state
        self._turn: Turn | None = None
        self._waiting_pressure: tuple[int, int, float, float] = _NO_PRESSURE
        self._waiting_force: tuple[int, int, float] = _NO_FORCE
        self.clock_offset, self.pressure = state.clock_offset, state.pressure
        """as of `PipelineState`; read often"""

    def _hold(self, state: PipelineState, saved: PipelineState, since: int) -> None:
        self._held = keep((state, saved, since))
        self._job = keep((self._known, self._held, self._rows))  # a call takes 0.4 us for each argument of this kind

    @property
    def records(self) -> PipelineState:
        """The state as records."""
        if self._records is None:
            self._pass_on(NEVER)
            self._records = PipelineState(*_newest(self._held))
        return self._records

    @property
    def estimator(self) -> EstimatorState:
        """As of `PipelineState`."""
        return self.records.estimator

    @property
    def feedforward(self) -> FeedForwardState:
        """As of `PipelineState`."""
        return self.records.feedforward

    @property
    def refused(self) -> bool:
        """As of `PipelineState`."""
        return self.records.refused

    def turn_since(self, _before: Any) -> Turn | None:
        """As of `PipelineState`, since the last message."""
        turn, self._turn = self._turn, None  # a message without a sample of this actuator asks again
        return turn

    def _replace(self, **changed: Any) -> 'CompiledState':
        """A new state with changed fields of `PipelineState`."""
        return CompiledState(self.parameters, self.records._replace(**changed))

    def take(self, message: Input, received: int, emit: Emit) -> None:
        """Take one message, see `receive`."""
        if isinstance(message, Position):
            return
        self._turn = self._records = None
        stamp, done, known = message[0], _FAILED, _INPUTS.get(type(message))
        if -LATEST <= stamp <= LATEST and 0 <= received <= LATEST:
            if isinstance(message, _WAITING):
                self._let_wait(message, received)
                return
            if known is not None:
                kind, end, more = known
                done = self._pass_on(received, kind, stamp, (*message[1:end], *more))
        if done & _FAILED:
            self._take_as_records(message, received, emit)
        elif done:
            frame_id = cast(bytes, message[-1])
            if done & _ESTIMATED:
                emit(_answer(FrictionEstimate, stamp, self._rows.estimate), frame_id)
            if done & _GUIDED:
                emit(_answer(FeedForward, stamp, self._rows.feedforward), frame_id)
            if done & _TURNED:
                self._turn = turn_between(PipelineState(*_saved(self._held)), self.records)

    def _let_wait(self, message: Pressure | Force, received: int) -> None:
        if isinstance(message, Pressure):
            if self._waiting_pressure is not _NO_PRESSURE:
                self._pass_on(received)
            self._waiting_pressure = (received, *message)
            self.pressure = message
        else:
            if self._waiting_force is not _NO_FORCE:
                self._pass_on(received)
            self._waiting_force = (received, *message)

    def _pass_on(self, received: int, kind: int = _NONE, stamp: int = 0, numbers: tuple[Any, ...] = _ZEROS) -> int:
        """Let compiled code take what waits, and then a message of any ``kind``; bits of what it did."""
        inputs: list[Any] = [*numbers, *self._waiting_pressure, *self._waiting_force]
        self._waiting_pressure, self._waiting_force = _NO_PRESSURE, _NO_FORCE
        return _take(self._job, received, kind, stamp, *inputs)

    def _take_as_records(self, message: Input, received: int, emit: Emit) -> None:
        self._pass_on(received)
        before, saved = PipelineState(*_newest(self._held)), PipelineState(*_saved(self._held))
        try:
            self._records = pipeline.receive(self.parameters, before, message, received, emit)
        except BaseException:
            self._hold(saved, saved, NEVER)
            raise
        self._hold(self._records, saved, received)
        self._turn = turn_between(before, self._records)
        self.pressure = self._records.pressure


def receive(
    parameters: PipelineParameters, state: CompiledState, message: Input, received: int, emit: Emit
) -> CompiledState:
    """As `pipeline.receive`; the state itself changes."""
    if parameters is not state.parameters:
        state = CompiledState(parameters, state.records)
    state.take(message, received, emit)
    return state


def compile_now(parameters: PipelineParameters) -> None:
    """Compile, or load from disk, all that a state for these parameters needs."""
    state = CompiledState(parameters, pipeline.init(parameters))
    state.take(Velocity(0, 0.0), 0, lambda _record, _frame: None)
    _saved(state._held)
    CompiledState(parameters, state.records)


def _answer(kind: Any, stamp: int, row: Any) -> Any:
    """Record of an answer from its row, its whole numbers as such."""
    numbers = row.tolist()
    for place in _WHOLE[kind]:
        numbers[place] = int(numbers[place])
    return kind(stamp, *numbers[: len(kind._fields) - 1])


# -- compiled ---------------------------------------------------------------------------------------------------------


@compiled
def _newest(held: Any) -> Any:
    return held.value[0]


@compiled
def _saved(held: Any) -> Any:
    return held.value[1]


@compiled
def _with_message(
    parameters: Any, state: Any, emit: Any, received: int, kind: int, stamp: int, numbers: tuple[float, float, float]
) -> Any:
    first, second, third = numbers
    if kind == _VELOCITY:
        return receive_velocity(parameters, state, Velocity(stamp, first, 0), received, emit)
    if kind == _TEMPERATURE:
        return receive_temperature(parameters, state, Temperature(stamp, first, second), received, emit)
    if kind == _TICK:
        return receive_tick(parameters, state, WatchdogTick(stamp, first, 0), received, emit)
    if kind == _REFERENCE:
        wanted = ServoReference(stamp, first, second, third, 0)
        return receive_reference(parameters, state, wanted, received, emit)
    return state


@compiled
def _take(
    job: Any, received: int, kind: int, stamp: int, first: float, second: float, third: float,
    pressure_received: int, pressure_stamp: int, pressure_a: float, pressure_b: float,
    force_received: int, force_stamp: int, force: float,
) -> int:  # fmt: skip
    """Take the pressure and the force that wait, and then one message of any ``kind``; bits of what it did.

    The state stays as it was before the message where an answer is not finite.
    """
    known, held, emit = job.value
    parameters, (state, saved, since), done = known.value, held.value, emit.done
    done[0] = 0
    pressure, force_sum = Pressure(pressure_stamp, pressure_a, pressure_b), Force(force_stamp, force)
    if 0 <= pressure_received != received:
        state = receive_pressure(parameters, state, pressure, pressure_received, emit)
    if 0 <= force_received != received:
        state = receive_force(parameters, state, force_sum, force_received, emit)
    if received != since:
        saved = state
    if pressure_received == received:
        state = receive_pressure(parameters, state, pressure, received, emit)
    if force_received == received:
        state = receive_force(parameters, state, force_sum, received, emit)
    newest = _with_message(parameters, state, emit, received, kind, stamp, (first, second, third))
    if done[0] & _FAILED:
        held.value = (state, saved, received)
        return _FAILED
    held.value = (newest, saved, received)
    last, learnt = saved.estimator.adaptation.learnt, newest.estimator.adaptation.learnt
    if learnt.direction != last.direction or learnt.reversals != last.reversals:
        done[0] |= _TURNED
    return int(done[0])


@overload(send, jit_options=INNER)
def _send(emit: Any, record: Any, frame_id: Any) -> Any:
    """`pipeline.send` in compiled code: the record goes into its row."""
    del frame_id  # overload compares the names with those of `send`
    if getattr(emit, 'instance_class', None) is not _Rows:
        return None
    column, bit = (0, _ESTIMATED) if record.instance_class is FrictionEstimate else (1, _GUIDED)

    def implementation(emit: Any, record: Any, frame_id: Any) -> None:  # noqa: ARG001  numba compares the names
        """What compiled code runs."""
        row, done, k = emit[column], emit.done, -1
        done[0] |= bit
        for value in literal_unroll(record):
            if k >= 0:
                row[k] = value
                if not math.isfinite(value):
                    done[0] |= _FAILED
            k += 1

    return implementation
