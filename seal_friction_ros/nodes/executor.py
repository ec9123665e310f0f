"""How the nodes of this package are spun and how they stop."""

from collections.abc import Callable

import rclpy
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.task import Future

try:
    from rclpy.experimental import EventsExecutor
except ImportError:  # ROS 2 Jazzy
    EventsExecutor = None

_LONG = 86400.0  # [s] a wait without end overflows the clock of the events executor and dispatches nothing


def spin(node: Node) -> None:
    """Spin until the context is shut down, by the events executor where there is one: a third of the processor time."""
    executor = EventsExecutor() if EventsExecutor is not None else SingleThreadedExecutor()
    executor.add_node(node)
    while rclpy.ok():
        executor.spin_until_future_complete(Future(), timeout_sec=_LONG)


def run(make_node: Callable[[], Node], stop: Callable[[Node], None], args: list[str] | None = None) -> int:
    """Make a node, spin it, and on SIGINT or SIGTERM stop it in order.

    Args:
        make_node: Makes the node; a ValueError it raises ends the process with one line.
        stop: Called with the node when spinning has ended.
        args: Command line with ``--ros-args``.

    Returns:
        Exit code: 0, or 2 for a node that could not start.
    """
    rclpy.init(args=args)
    try:
        node = make_node()
    except ValueError as error:
        if not rclpy.ok():  # stopped by a signal while it started
            return 0
        rclpy.logging.get_logger('seal_friction_ros').fatal(str(error))
        rclpy.try_shutdown()
        return 2
    try:
        spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        stop(node)
        node.destroy_node()
        rclpy.try_shutdown()
    return 0
