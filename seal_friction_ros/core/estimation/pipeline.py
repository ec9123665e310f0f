"""The path of every message: what comes in, what is kept of it, what goes out. The same for the node and for replay.

``state = init(parameters)``, then ``state, answer = receive(parameters, state, message)`` for every message, in the
order of receipt. A velocity sample makes an estimate with the pressure and force sum that came last, and, once there
has been a reference, a feed-forward. While velocity samples fail to come, references make the feed-forward, so that it
fades out instead of standing still.

Inputs that are refused, since several nodes publish them and nobody knows which one is right, still make estimates, so
that everybody sees it, but these are marked and the feed-forward fades out.
"""

import math
from collections.abc import Iterator
from typing import NamedTuple

from seal_friction_ros.core.estimation import estimator, feedforward
from seal_friction_ros.core.estimation.estimator import EstimatorParameters, EstimatorState
from seal_friction_ros.core.estimation.feedforward import FeedForward, FeedForwardSettings, FeedForwardState, Motion
from seal_friction_ros.core.estimation.messages import (
    ESTIMATE_TYPE,
    FEEDFORWARD_TYPE,
    Input,
    Position,
    Velocity,
    encode_estimate,
    encode_feedforward,
)
from seal_friction_ros.core.estimation.records import (
    NEVER,
    NO_ESTIMATE,
    NO_FORCE,
    NO_PRESSURE,
    Force,
    FrictionEstimate,
    Pressure,
    RodSample,
)
from seal_friction_ros.core.foundation.compilable import compilable
from seal_friction_ros.core.friction.actuator import actuator_friction


class PipelineParameters(NamedTuple):
    """All that is known beforehand."""

    estimator: EstimatorParameters
    feedforward: FeedForwardSettings


class Reference(NamedTuple):
    """How the rod shall move."""

    stamp: int
    """[ns] the moment it is for"""
    velocity: float
    """[m/s]"""
    acceleration: float
    """[m/s^2]"""


NO_REFERENCE = Reference(NEVER, 0.0, 0.0)


class PipelineState(NamedTuple):
    """What one message leaves for the next, the newest inputs among it."""

    estimator: EstimatorState
    feedforward: FeedForwardState
    pressure: Pressure = NO_PRESSURE
    force: Force = NO_FORCE
    reference: Reference = NO_REFERENCE
    refused: bool = False
    """whether inputs come from somebody who should not send them"""


class Answer(NamedTuple):
    """What a message makes come out."""

    estimate: FrictionEstimate | None
    feedforward: FeedForward | None
    frame_id: bytes
    """frame of the message that is answered"""


NOTHING = Answer(None, None, b'')


def init(parameters: PipelineParameters) -> PipelineState:
    """State before the first message."""
    return PipelineState(estimator.init(parameters.estimator), feedforward.init(parameters.feedforward))


def receive(parameters: PipelineParameters, state: PipelineState, message: Input) -> tuple[PipelineState, Answer]:
    """Take one message: `observe`, and after a velocity `compensate`.

    Args:
        parameters: Settings and seals.
        state: From `init` or the message before.
        message: As `wire` decodes it; its values may be anything.

    Returns:
        The next state and what goes out, every number of which is finite.
    """
    state, answer = observe(parameters, state, message)
    return compensate(parameters, state, message, answer) if isinstance(message, Velocity) else (state, answer)


def observe(parameters: PipelineParameters, state: PipelineState, message: Input) -> tuple[PipelineState, Answer]:
    """First half of `receive`: everything but the feed-forward that follows an estimate.

    The node publishes the estimate before it computes that feed-forward.
    """
    seen, fed, pressure, force, reference, refused = state  # _replace would take three times as long
    if isinstance(message, Velocity):
        sample = RodSample(message.stamp, message.velocity, pressure, force, refused)
        seen, estimate = estimator.step(parameters.estimator, seen, sample)
        return PipelineState(seen, fed, pressure, force, reference, refused), Answer(estimate, None, message.frame_id)
    if isinstance(message, Pressure):
        return PipelineState(seen, fed, message, force, reference, refused), NOTHING
    if isinstance(message, Force):
        return PipelineState(seen, fed, pressure, message, reference, refused), NOTHING
    if isinstance(message, Position):  # nothing depends on it; it is kept in bags to show how the servo tracks
        return state, NOTHING
    reference = Reference(message.stamp, message.velocity, message.acceleration)
    if not is_fading(parameters.feedforward, seen.stamp, message.stamp):
        return PipelineState(seen, fed, pressure, force, reference, refused), NOTHING
    motion = Motion(reference.velocity, reference.acceleration)
    fed, compensation = feedforward.step(parameters.feedforward, fed, message.stamp, NO_ESTIMATE, motion)
    return PipelineState(seen, fed, pressure, force, reference, refused), Answer(None, compensation, message.frame_id)


def compensate(
    parameters: PipelineParameters, state: PipelineState, velocity: Velocity, answer: Answer
) -> tuple[PipelineState, Answer]:
    """Second half of `receive`: what `observe` answered to a velocity, and the feed-forward that goes with it."""
    seen, fed, pressure, force, reference, refused = state
    estimate, _, frame_id = answer
    if estimate is None or (reference.stamp == NEVER and not parameters.feedforward.use_measured_velocity):
        return state, answer
    motion = motion_at(reference, velocity.stamp, velocity.velocity)
    motion = _with_velocity_friction(parameters, motion, seen.pressure)
    fed, compensation = feedforward.step(parameters.feedforward, fed, velocity.stamp, estimate, motion)
    return PipelineState(seen, fed, pressure, force, reference, refused), Answer(estimate, compensation, frame_id)


@compilable
def is_fading(settings: FeedForwardSettings, last_velocity: int, reference: int) -> bool:
    """Whether a reference makes the feed-forward, since velocities fail to come. Stamps in [ns]."""
    return last_velocity == NEVER or abs(reference - last_velocity) * 1e-9 > settings.estimate_timeout


@compilable
def motion_at(reference: Reference, stamp: int, measured: float) -> Motion:
    """Motion at a velocity sample of ``stamp`` [ns] and ``measured`` [m/s], without the velocity friction."""
    if reference.stamp == NEVER:
        return Motion(0.0, 0.0, measured, math.inf, 0.0)
    age = (stamp - reference.stamp) * 1e-9
    return Motion(reference.velocity, reference.acceleration, measured, age, 0.0)


def _with_velocity_friction(parameters: PipelineParameters, motion: Motion, pressure: Pressure) -> Motion:
    seals = parameters.estimator.seals
    if pressure.stamp == NEVER or not any(mounted.seal.velocity_law for mounted in seals):
        return motion
    velocity = feedforward.wanted_velocity(parameters.feedforward, motion)
    if math.isnan(velocity):
        return motion
    friction = actuator_friction(seals, pressure.chamber_a, pressure.chamber_b, velocity)
    return motion._replace(velocity_friction=friction.velocity_friction)


def encoded(answer: Answer) -> Iterator[tuple[str, bytes]]:
    """Messages of an answer: message type and bytes, in the order they are published."""
    if answer.estimate is not None:
        yield ESTIMATE_TYPE, encode_estimate(answer.estimate, answer.frame_id)
    if answer.feedforward is not None:
        yield FEEDFORWARD_TYPE, encode_feedforward(answer.feedforward, answer.frame_id)
