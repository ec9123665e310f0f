"""What rclpy has not: callbacks that know when a message was sent, and messages taken without a callback."""

import inspect
import sys
from collections.abc import Callable
from typing import Any

_TWO = inspect.Signature([inspect.Parameter(name, inspect.Parameter.POSITIONAL_ONLY) for name in ('message', 'info')])


def with_source_time(callback: Callable[[Any, int, int], None]) -> Callable[..., None]:
    """Callback for rclpy that calls ``callback`` with a message, and when it was sent and received by the middleware.

    Both times are [ns] of the system clocks of sender and receiver.

    rclpy gives the information about a message to a callback of two arguments; its events executor gives both as one
    tuple.
    """

    def call(message: Any, info: Any = None) -> None:
        """What rclpy calls."""
        if info is None:
            message, info = message
        callback(message, info['source_timestamp'], info['received_timestamp'])

    vars(call)['__signature__'] = _TWO
    return call


def taken(subscription: Any, most: int = sys.maxsize) -> list[tuple[bytes, dict[str, Any]]]:
    """Messages that wait in the middleware, at most so many, as bytes, and what it knows of each."""
    found: list[tuple[bytes, dict[str, Any]]] = []
    with subscription.handle:
        while len(found) < most:
            message = subscription.handle.take_message(subscription.msg_type, True)
            if message is None:
                break
            found.append(message)
    return found
