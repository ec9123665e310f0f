"""What rclpy has not: callbacks that know when a message was sent, and messages taken without a callback."""

import inspect
import sys
from functools import partial
from typing import Any

_TWO = inspect.Signature([inspect.Parameter(name, inspect.Parameter.POSITIONAL_ONLY) for name in ('message', 'info')])


def with_info(callback: partial[None]) -> partial[None]:
    """A callback that rclpy gives what the middleware knows of a message, too.

    It comes as a second argument, from the events executor of rclpy as the second part of the message.
    ``source_timestamp`` and ``received_timestamp`` in it are [ns] of the system clocks of sender and receiver.
    """
    vars(callback)['__signature__'] = _TWO
    return callback


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
