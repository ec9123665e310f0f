"""How the nodes of this package are spun and how they stop."""

import sys
from collections.abc import Callable
from typing import TypeVar

import rclpy
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.task import Future

try:
    from rclpy.experimental import EventsExecutor
except ImportError:  # ROS 2 Jazzy
    EventsExecutor = None

AnyNode = TypeVar('AnyNode', bound=Node)
_LONG = 86400.0  # [s] a wait without end overflows the clock of the events executor and dispatches nothing


def spin(node: Node) -> None:
    """Spin until the context is shut down, by the events executor where there is one: a third of the processor time."""
    executor = EventsExecutor() if EventsExecutor is not None else SingleThreadedExecutor()
    executor.add_node(node)
    while rclpy.ok():
        executor.spin_until_future_complete(Future(), timeout_sec=_LONG)


def run(
    make_node: Callable[[], AnyNode],
    start: Callable[[AnyNode], bool],
    stop: Callable[[AnyNode], None],
    args: list[str] | None = None,
) -> int:
    """Make a node, start it, spin it, and on SIGINT or SIGTERM stop it in order.

    Args:
        make_node: Makes the node; a ValueError it raises ends the process with one line.
        start: Called with the node before spinning; False for a node that could not start, and has said why.
        stop: Called with the node at the end, whatever happened.
        args: Command line with ``--ros-args``.

    Returns:
        Exit code: 0, or 2 for a node that could not start.
    """
    try:
        rclpy.init(args=args)
        node = make_node()
    except (ValueError, RuntimeError) as error:  # RCLError, of a parameter file for example, is a RuntimeError
        print(f'not started: {" ".join(str(error).split())}', file=sys.stderr)
        rclpy.try_shutdown()
        return 2
    except KeyboardInterrupt:
        rclpy.try_shutdown()
        return 0
    try:
        if not start(node):
            return 2 if rclpy.ok() else 0  # not ok: stopped by a signal while it started
        spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        stop(node)
        node.destroy_node()
        rclpy.try_shutdown()
    return 0
