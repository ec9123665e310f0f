"""Nodes of one context, spun in the calling thread: an exception in a callback reaches the caller."""

import gc
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import monotonic

import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from harness.processes import free_domain
from seal_friction_ros.nodes.discovery import set_up_discovery

try:
    from rclpy.experimental import EventsExecutor  # a fifth of the processor time
except ImportError:  # ROS 2 Jazzy
    EventsExecutor = None

TIMEOUT = 60.0  # [s] ends a test that hangs; no test measures time by it
_LONGEST_WAIT = 0.01  # [s] between two checks of a condition


@contextmanager
def ros_context(domain: int | None = None) -> Iterator[Context]:
    """Context on a ROS domain, by default on one that no other process uses."""
    gc.collect()  # nodes hold reference cycles: until they are collected, their participants stay on their domain
    set_up_discovery()
    context = Context()
    rclpy.init(context=context, domain_id=free_domain() if domain is None else domain)
    try:
        yield context
    finally:
        rclpy.try_shutdown(context=context)


class SpunNodes:
    """Nodes with one executor."""

    def __init__(self, context: Context, *nodes: Node) -> None:
        self.context = context
        self._nodes = nodes
        self._executor = (EventsExecutor or SingleThreadedExecutor)(context=context)
        for node in nodes:
            self._executor.add_node(node)
        context.on_shutdown(self._release)

    def _release(self) -> None:
        """Let go of the nodes: an executor holds their timers, and so their context and its participant."""
        for node in self._nodes:
            self._executor.remove_node(node)
        self._executor.shutdown(timeout_sec=0)

    def spin_until(self, condition: Callable[[], object], timeout: float = TIMEOUT) -> bool:
        """Spin until ``condition`` holds; whether it does within ``timeout`` [s]."""
        end = monotonic() + timeout
        while not condition():
            left = end - monotonic()
            if left <= 0.0:
                return False
            self._executor.spin_once(timeout_sec=min(left, _LONGEST_WAIT))
        return True

    def spin(self, seconds: float) -> None:
        """Spin once at least, and for ``seconds`` [s]: a pace for what is sent, no guarantee of what is received."""
        self._executor.spin_once(timeout_sec=max(min(seconds, _LONGEST_WAIT), 0.0))
        self.spin_until(lambda: False, seconds)

    def connect(self) -> None:
        """Spin until the topics between these nodes are connected.

        Raises:
            RuntimeError: A topic is not.
        """
        if not self.spin_until(lambda: not self._unconnected()):
            raise RuntimeError(f'not connected: {", ".join(sorted(self._unconnected()))}')

    def _unconnected(self) -> set[str]:
        """Topics on which one of these nodes has no connection to another one yet, seen from either end."""
        publishers = [publisher for node in self._nodes for publisher in node.publishers]
        subscriptions = [subscription for node in self._nodes for subscription in node.subscriptions]
        published = Counter(publisher.topic_name for publisher in publishers)
        subscribed = Counter(subscription.topic_name for subscription in subscriptions)
        waiting = {p.topic_name for p in publishers if p.get_subscription_count() < subscribed[p.topic_name]}
        for subscription in subscriptions:
            count = getattr(subscription, 'get_publisher_count', None)  # not in ROS 2 Jazzy
            if count is not None and count() < published[subscription.topic_name]:
                waiting.add(subscription.topic_name)
        return waiting
