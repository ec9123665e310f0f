"""Nodes of one context, spun here and now: what one of them raises comes up where it is waited for."""

from collections.abc import Callable, Iterable
from time import monotonic

from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.publisher import Publisher

_LONGEST_WAIT = 0.01  # [s] until a condition is looked at again
_STANDSTILL = 1.0  # [s] one turn does not take longer, unless all processes were stopped


class Spun:
    """Some nodes, spun together."""

    def __init__(self, context: Context, *nodes: Node) -> None:
        self.context = context
        self._executor = SingleThreadedExecutor(context=context)
        for node in nodes:
            self._executor.add_node(node)

    def spin_until(self, condition: Callable[[], object], patience: float = 10.0) -> bool:
        """Spin until it holds; False if it does not within ``patience`` [s] of a machine that runs."""
        left = patience
        while not condition():
            if left <= 0.0:
                return False
            start = monotonic()
            self._executor.spin_once(timeout_sec=min(left, _LONGEST_WAIT))
            left -= min(monotonic() - start, _STANDSTILL)
        return True

    def spin(self, seconds: float) -> None:
        """Spin for a while."""
        self.spin_until(lambda: False, seconds)

    def connect_to(self, publishers: Iterable[Publisher]) -> None:
        """Spin until every publisher is heard, and a moment more for what is heard in return.

        Raises:
            RuntimeError: One is not.
        """
        waiting = list(publishers)
        if not self.spin_until(lambda: all(publisher.get_subscription_count() for publisher in waiting), 20.0):
            unheard = ', '.join(p.topic_name for p in waiting if not p.get_subscription_count())
            raise RuntimeError(f'nobody subscribes to {unheard}')
        self.spin(0.2)
