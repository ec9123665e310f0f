"""Answers of the pipeline to one message, collected for tests."""

from typing import Any, NamedTuple

from seal_friction_ros.core.estimation.pipeline import PipelineParameters, PipelineState, receive
from seal_friction_ros.core.messages.records import FeedForward, FrictionEstimate


class Answer(NamedTuple):
    """What one message makes the pipeline emit."""

    estimate: FrictionEstimate | None
    feedforward: FeedForward | None
    frame_id: bytes


NOTHING = Answer(None, None, b'')


def receive_one(
    parameters: PipelineParameters,
    state: PipelineState,
    message: Any,
    received: int | None = None,
    sent: int | None = None,
) -> tuple[PipelineState, Answer]:
    """The next state and the answer; by default the message is received at its stamp, and sent just then."""
    answer = NOTHING

    def take(record: Any, frame_id: bytes) -> None:
        nonlocal answer
        field = 'estimate' if isinstance(record, FrictionEstimate) else 'feedforward'
        answer = answer._replace(**{field: record, 'frame_id': frame_id})

    received = message.stamp if received is None else received
    state = state.copy()
    receive(parameters, state, message, received, take, sent)
    return state, answer
