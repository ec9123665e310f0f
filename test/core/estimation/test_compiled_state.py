"""The state in compiled memory is that of plain Python, also where compiled code gives up; nothing compiles late.

That any run of messages gives the same bytes and the same state is in `test_compiled_pipeline`.
"""

import dataclasses
import math
from functools import partial

import numpy as np
import pytest

from seal_friction_ros.core.estimation import compiled_state, pipeline
from seal_friction_ros.core.estimation.adaptation import NOT_ADAPTED, AdaptationSettings
from seal_friction_ros.core.estimation.compiled_state import CompiledState, compile_now, receive
from seal_friction_ros.core.estimation.estimator import EstimatorSettings
from seal_friction_ros.core.estimation.feedforward import FADED_IN, FeedForward, FeedForwardSettings
from seal_friction_ros.core.estimation.pipeline import init
from seal_friction_ros.core.estimation.records import (
    Force,
    FrictionEstimate,
    Position,
    Pressure,
    ServoReference,
    Temperature,
    Velocity,
)
from seal_friction_ros.files import default_configuration

CONFIGURATION = default_configuration()
KNOWN = CONFIGURATION.parameters()
MS = 1_000_000  # [ns]


def nobody(_record, _frame_id):
    """Emit to nobody."""


def ram(samples: int, period: int = 400):
    """Messages of a ram that slides to and fro, a reversal each ``period`` samples of 1 ms, with noise, by time."""
    random = np.random.default_rng(5)
    for i in range(1, samples):
        stamp, side = i * MS, 1.0 if i // period % 2 else -1.0
        a, f, v = random.normal(size=3).tolist()
        yield stamp, Pressure(stamp, 2e6 + 1e4 * a, 1e6)
        yield stamp + 1000, Force(stamp, side * 40.0 + 2.0 + f)
        yield stamp + 2000, Velocity(stamp, side * 0.05 + 1e-4 * v, b'rod')


def test_each_end_of_a_stroke_is_told_as_plain_python_tells_it():
    state, held, turns = init(KNOWN), CompiledState(KNOWN, init(KNOWN)), []
    for received, message in ram(3000):
        before = state
        state = pipeline.receive(KNOWN, state, message, received, nobody)
        held = receive(KNOWN, held, message, received, nobody)
        turns.append(state.turn_since(before))
        assert held.turn_since(held) == turns[-1]
        assert held.turn_since(held) is None  # told once
    found = [turn for turn in turns if turn is not None]
    assert len(found) >= 6
    assert found[-1].after.adaptation.learnt.reversals > 2


def test_a_position_changes_nothing():
    held = CompiledState(KNOWN, init(KNOWN))
    assert receive(KNOWN, held, Position(5, 0.1), 5, nobody).records == init(KNOWN)


@pytest.mark.parametrize('received', [-1, 2**62])
@pytest.mark.parametrize('kind', [Pressure, Force, Temperature, Velocity])
def test_times_that_compiled_code_does_not_hold_are_taken_by_plain_python(received, kind):
    message = kind(MS, *((20.0,) * (2 if kind in (Pressure, Temperature) else 1)))
    before = [(1, Pressure(1, 3e6, 2e6)), (2, Force(1, 7.0))]
    state, held = init(KNOWN), CompiledState(KNOWN, init(KNOWN))
    expected, found = [], []
    for at, one in [*before, (received, message), (3 * MS, Velocity(3 * MS, 0.01, b'x'))]:
        state = pipeline.receive(KNOWN, state, one, at, lambda *answer: expected.append(answer))
        held = receive(KNOWN, held, one, at, lambda *answer: found.append(answer))
    assert (found, held.records) == (expected, state)
    assert held.pressure == state.pressure


@pytest.mark.parametrize('force', [math.inf, -math.inf])
def test_an_answer_that_is_not_finite_is_that_of_plain_python(force):
    """No settings make one; a state that somebody else wrote may."""
    state = init(KNOWN)._replace(feedforward=FADED_IN._replace(force=force))
    held, expected, found = CompiledState(KNOWN, state), [], []
    for at, one in [(1, Force(1, 2.0)), (2, ServoReference(2, 0.0, 0.1, 0.0)), (3, Velocity(3, 0.1, b'x'))]:
        state = pipeline.receive(KNOWN, state, one, at, lambda *answer: expected.append(answer))
        held = receive(KNOWN, held, one, at, lambda *answer: found.append(answer))
    assert (repr(found), repr(held.records)) == (repr(expected), repr(state))
    assert not math.isfinite(found[-1][0].force)


@pytest.mark.parametrize('together', [True, False])
def test_the_records_of_a_message_are_taken_all_or_none(monkeypatch, together):
    """As `machine.receive` keeps the last state of an actuator whose arithmetic fails."""
    held = CompiledState(KNOWN, init(KNOWN)._replace(feedforward=FADED_IN._replace(force=math.inf)))
    for received, message in [(1, Pressure(1, 1e6, 1e6)), (1, Force(1, 3.0)), (1, ServoReference(1, 0.0, 0.1, 0.0))]:
        receive(KNOWN, held, message, received, nobody)
    before = held.records

    def failing(*_):
        raise OverflowError('arithmetic')

    monkeypatch.setattr(pipeline, 'receive', failing)
    for number, message in enumerate([Pressure(MS, 2e6, 1e6), Force(MS, 4.0)]):
        receive(KNOWN, held, message, 9 if together else 7 + number, nobody)
    with pytest.raises(OverflowError):
        receive(KNOWN, held, Velocity(MS, 0.1, b'x'), 9, nobody)
    monkeypatch.undo()
    expected = before
    if not together:  # earlier messages of their own
        for number, message in enumerate([Pressure(MS, 2e6, 1e6), Force(MS, 4.0)]):
            expected = pipeline.receive(KNOWN, expected, message, 7 + number, nobody)
    assert held.records == expected


def test_what_waits_is_judged_by_the_settings_of_its_time():
    stricter = dataclasses.replace(CONFIGURATION, settings=EstimatorSettings(force_max=10.0)).parameters()
    state, held = init(KNOWN), CompiledState(KNOWN, init(KNOWN))
    state = pipeline.receive(KNOWN, state, Force(1, 20.0), 1, nobody)
    held = receive(KNOWN, held, Force(1, 20.0), 1, nobody)
    state = pipeline.receive(stricter, state, Velocity(2, 0.1, b''), 2, nobody)
    held = receive(stricter, held, Velocity(2, 0.1, b''), 2, nobody)
    assert held.records == state
    assert state.receipt.force == 1


def test_nothing_compiles_after_the_configuration():
    """Neither another setting of any kind nor what services and the graph change: a machine must not wait for that."""
    compile_now(KNOWN)
    functions = [compiled_state._take, compiled_state._newest, compiled_state._saved]
    before = [len(function.signatures) for function in functions]
    others = [
        dataclasses.replace(CONFIGURATION, **{field: value})
        for field, values in {
            'settings': [EstimatorSettings(velocity_resolution=1e-3, use_stiction=False, stamp_age_max=0.0)],
            'feedforward': [
                FeedForwardSettings(scale=0.0),
                FeedForwardSettings(use_measured_velocity=True, presliding=False, lead_time=0.01),
            ],
            'adaptation': [AdaptationSettings(mode) for mode in ('off', 'observe', 'on')],
        }.items()
        for value in values
    ]
    held = CompiledState(KNOWN, init(KNOWN))
    take = partial(receive, emit=nobody)
    for number, configuration in enumerate(others):
        known, at = configuration.parameters(), 10 * MS * (number + 1)
        for message in (
            Temperature(at, 20.0),
            Pressure(at, 3e6, 1e6),
            Force(at, 3.0),
            ServoReference(at, 0.0, 0.1, 0.0),
        ):
            held = take(known, held, message, at)
        held = take(known, held, Velocity(at, 0.1, b'rod'), at)
        held = held._replace(refused=number % 2 == 0, clock_offset=number)
        held = held._replace(estimator=held.estimator._replace(adaptation=NOT_ADAPTED))
        held = take(known, held, Velocity(2**62, 0.1, b'rod'), at + 1)  # plain Python
    assert [len(function.signatures) for function in functions] == before
    assert min(before) >= 1


def test_answers_have_the_types_of_plain_python():
    held, answers = CompiledState(KNOWN, init(KNOWN)), []
    for received, message in [(1, ServoReference(1, 0.0, 0.1, 0.0)), (2, Velocity(2, 0.1, b'rod'))]:
        receive(KNOWN, held, message, received, lambda *answer: answers.append(answer))
    (estimate, frame), (feedforward, _) = answers
    assert (type(estimate), type(feedforward), frame) == (FrictionEstimate, FeedForward, b'rod')
    assert [type(value) for value in estimate] == [int, *[float] * 4, int, int, int, *[float] * 5]
    assert [type(value) for value in feedforward] == [int, float, float, int]
