"""How the nodes of this package are spun and how they stop."""

import gc
import signal
import socket
import sys
import threading
from collections.abc import Callable
from typing import TypeVar

import rclpy
from rclpy.context import Context
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future

from seal_friction_ros.nodes.discovery import set_up_discovery

try:
    from rclpy.experimental import EventsExecutor
except ImportError:  # ROS 2 Jazzy
    EventsExecutor = None

AnyNode = TypeVar('AnyNode', bound=Node)
_LONG = 86400.0  # [s] a wait without end overflows the clock of the events executor and dispatches nothing
_SIGNALS = (signal.SIGINT, signal.SIGTERM)


def spin(node: Node, stopped: Future, context: Context | None = None) -> None:
    """Spin until ``stopped`` is done, by the events executor where there is one: a third of the processor time."""
    executor = (EventsExecutor or SingleThreadedExecutor)(context=context)
    executor.add_node(node)
    while rclpy.ok(context=context) and not stopped.done():
        executor.spin_until_future_complete(stopped, timeout_sec=_LONG)


def run(
    make_node: Callable[[], AnyNode],
    start: Callable[[AnyNode], bool],
    stop: Callable[[AnyNode], None],
    args: list[str] | None = None,
) -> int:
    """Make a node, start it, spin it, and on SIGINT or SIGTERM stop it in order, between two callbacks.

    Args:
        make_node: Makes the node; a ValueError it raises ends the process with one line.
        start: Called with the node before spinning; False for a node that could not start, and has said why.
        stop: Called with the node at the end, whatever happened.
        args: Command line with ``--ros-args``.

    Returns:
        Exit code: 0, or 2 for a node that could not start.
    """
    # A thread waits for the signals. ROS's own handler would take the graph away from under a callback that publishes;
    # Python's own would wait for the executor to come back from C++.
    said, heard = socket.socketpair()
    said.setblocking(False)
    signal.set_wakeup_fd(said.fileno())
    for number in _SIGNALS:
        signal.signal(number, lambda *_: None)
    try:
        set_up_discovery()
        rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
        node = make_node()
    except (ValueError, RuntimeError) as error:  # RCLError, of a parameter file for example, is a RuntimeError
        print(f'not started: {" ".join(str(error).split())}', file=sys.stderr)
        rclpy.try_shutdown()
        return 2
    stopped = Future()
    threading.Thread(target=_await_signal, args=(heard, stopped), daemon=True).start()
    try:
        if not start(node):
            return 2
        gc.freeze()  # what lives until the end is not looked through again: with numba 60 ms each time
        spin(node, stopped)
    except ExternalShutdownException:
        pass
    finally:
        stop(node)
        node.destroy_node()
        rclpy.try_shutdown()
    return 0


def _await_signal(heard: socket.socket, stopped: Future) -> None:
    heard.recv(1)
    stopped.set_result(None)
