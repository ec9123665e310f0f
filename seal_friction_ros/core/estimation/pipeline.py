"""The path of every message: what comes in, what is kept of it, what goes out. The same for the node and for replay.

``state = init(parameters)``, then ``state = receive(parameters, state, message, emit)`` for every message, in order of
receipt. The node passes a function that publishes, replay one that collects.

A velocity sample makes an estimate with the newest pressure and force sum, and, once there has been a reference, a
feed-forward. The estimate is emitted before the feed-forward is computed. While no velocity sample comes, references
make the feed-forward, so that it fades out.

Inputs with several publishers are refused, since nobody knows which publisher is right: they still make estimates, so
that everybody sees it, but the estimates are marked and the feed-forward fades out.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

from seal_friction_ros.core.estimation import estimator, feedforward
from seal_friction_ros.core.estimation.estimator import EstimatorParameters, EstimatorState
from seal_friction_ros.core.estimation.estimator import step as estimator_step
from seal_friction_ros.core.estimation.feedforward import (
    FeedForwardSettings,
    FeedForwardState,
    Motion,
    wanted_velocity,
)
from seal_friction_ros.core.estimation.feedforward import step as feedforward_step
from seal_friction_ros.core.estimation.messages import Input, Output, encode, type_of
from seal_friction_ros.core.estimation.records import (
    NEVER,
    NO_ESTIMATE,
    NO_FORCE,
    NO_PRESSURE,
    Force,
    Position,
    Pressure,
    RodSample,
    ServoReference,
    Velocity,
)
from seal_friction_ros.core.foundation.compiled import compilable
from seal_friction_ros.core.friction.actuator import friction_of_seals

Emit = Callable[[Output, bytes], object]
"""Takes what goes out, and the frame name of the message that it answers."""


class PipelineParameters(NamedTuple):
    """Everything that is known beforehand."""

    estimator: EstimatorParameters
    feedforward: FeedForwardSettings


class WantedMotion(NamedTuple):
    """Motion that the rod shall make."""

    stamp: int  # [ns] the moment it is for
    velocity: float  # [m/s]
    acceleration: float  # [m/s^2]


NO_REFERENCE = WantedMotion(NEVER, 0.0, 0.0)


class PipelineState(NamedTuple):
    """What one message leaves for the next, the newest inputs among it."""

    estimator: EstimatorState
    feedforward: FeedForwardState
    pressure: Pressure = NO_PRESSURE
    force: Force = NO_FORCE
    reference: WantedMotion = NO_REFERENCE
    refused: bool = False  # whether an input has several publishers


def init(parameters: PipelineParameters) -> PipelineState:
    """State before the first message."""
    return PipelineState(estimator.init(parameters.estimator), feedforward.init(parameters.feedforward))


def receive(parameters: PipelineParameters, state: PipelineState, message: Input, emit: Emit) -> PipelineState:
    """Take one message.

    Args:
        parameters: Settings and seals.
        state: From `init` or the message before.
        message: As `messages.decode` makes it; its values may be anything.
        emit: Called with each estimate and feed-forward that the message makes; every number in them is finite.

    Returns:
        The next state.
    """
    return _RECEIVERS[type(message)](parameters, state, message, emit)


def answered(
    parameters: PipelineParameters, state: PipelineState, message: Input
) -> tuple[PipelineState, list[tuple[str, bytes]]]:
    """`receive` with the answers collected: message type and bytes of each, in the order they are emitted."""
    answers: list[tuple[str, bytes]] = []

    def collect(record: Output, frame_id: bytes) -> None:
        answers.append((type_of(record), encode(record, frame_id)))

    return receive(parameters, state, message, collect), answers


def send(emit: Any, record: Any, frame_id: Any) -> None:
    """Emit a record. Compiled code writes it into an array instead, see `compiled_pipeline`."""
    emit(record, frame_id)


@compilable
def receive_velocity(parameters: Any, state: PipelineState, velocity: Any, emit: Any) -> PipelineState:
    """An estimate, and with a reference a feed-forward."""
    known, guided, pressure, force, reference, refused = state
    sample = RodSample(velocity.stamp, velocity.velocity, pressure, force, refused)
    known, estimate = estimator_step(parameters.estimator, known, sample)
    send(emit, estimate, velocity.frame_id)
    if reference.stamp != NEVER or parameters.feedforward.use_measured_velocity:
        motion = _motion(parameters, reference, velocity.stamp, velocity.velocity, known.pressure)
        guided, compensation = feedforward_step(parameters.feedforward, guided, velocity.stamp, estimate, motion)
        send(emit, compensation, velocity.frame_id)
    return PipelineState(known, guided, pressure, force, reference, refused)


@compilable
def receive_pressure(_parameters: Any, state: PipelineState, newest: Pressure, _emit: Any) -> PipelineState:
    """Keep the pressure for the next velocity sample."""
    known, guided, _, force, reference, refused = state
    return PipelineState(known, guided, newest, force, reference, refused)


@compilable
def receive_force(_parameters: Any, state: PipelineState, newest: Force, _emit: Any) -> PipelineState:
    """Keep the force sum for the next velocity sample."""
    known, guided, pressure, _, reference, refused = state
    return PipelineState(known, guided, pressure, newest, reference, refused)


@compilable
def receive_reference(parameters: Any, state: PipelineState, wanted: Any, emit: Any) -> PipelineState:
    """Keep the reference; while no velocity comes, let the feed-forward fade."""
    known, guided, pressure, force, _, refused = state
    reference = WantedMotion(wanted.stamp, wanted.velocity, wanted.acceleration)
    timeout = parameters.feedforward.estimate_timeout
    if known.stamp == NEVER or abs(reference.stamp - known.stamp) * 1e-9 > timeout:
        motion = Motion(reference.velocity, reference.acceleration, 0.0, 0.0, 0.0)
        guided, compensation = feedforward_step(parameters.feedforward, guided, reference.stamp, NO_ESTIMATE, motion)
        send(emit, compensation, wanted.frame_id)
    return PipelineState(known, guided, pressure, force, reference, refused)


def receive_position(_parameters: Any, state: PipelineState, _position: Position, _emit: Any) -> PipelineState:
    """Nothing depends on the position; it is recorded to show how the servo tracks."""
    return state


_RECEIVERS: dict[type, Callable[[Any, PipelineState, Any, Any], PipelineState]] = {
    Velocity: receive_velocity,
    Pressure: receive_pressure,
    Force: receive_force,
    ServoReference: receive_reference,
    Position: receive_position,
}


@compilable
def _motion(parameters: Any, reference: WantedMotion, stamp: int, measured: float, pressure: Pressure) -> Motion:
    """Motion at a velocity sample of ``stamp`` [ns] and ``measured`` [m/s], with the velocity friction of the seals."""
    age = math.inf
    if reference.stamp != NEVER:
        age = (stamp - reference.stamp) * 1e-9
    motion = Motion(reference.velocity, reference.acceleration, measured, age, 0.0)
    if pressure.stamp == NEVER or not parameters.estimator.depends_on_velocity:
        return motion
    velocity = wanted_velocity(parameters.feedforward, motion)
    if math.isnan(velocity):
        return motion
    seals = parameters.estimator.seal_numbers
    friction = friction_of_seals(seals, pressure.chamber_a, pressure.chamber_b, velocity)
    return Motion(reference.velocity, reference.acceleration, measured, age, friction.velocity_friction)
