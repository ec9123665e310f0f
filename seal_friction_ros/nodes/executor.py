"""Runs a node: start, spin, and orderly stop on SIGINT and SIGTERM."""

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
_LONG_WAIT = 86400.0  # [s] an infinite wait overflows the clock of the events executor, which then dispatches nothing
_SIGNALS = (signal.SIGINT, signal.SIGTERM)


def spin(node: Node, stopped: Future, context: Context | None = None) -> None:
    """Spin until ``stopped`` is done; the events executor, if available, takes a third of the processor time."""
    executor = (EventsExecutor or SingleThreadedExecutor)(context=context)
    executor.add_node(node)
    while rclpy.ok(context=context) and not stopped.done():
        executor.spin_until_future_complete(stopped, timeout_sec=_LONG_WAIT)


def run(
    make_node: Callable[[], AnyNode],
    start: Callable[[AnyNode], bool],
    stop: Callable[[AnyNode], None],
    args: list[str] | None = None,
) -> int:
    """Create, start and spin a node; on SIGINT or SIGTERM stop it between two callbacks. Exit code 2: no start.

    Args:
        make_node: Creates the node; its ValueError ends the process with one line.
        start: Called with the node before spinning; False if the node could not start and logged the reason.
        stop: Called with the node at the end, also after an error.
        args: Command line with ``--ros-args``.
    """
    # A thread waits for the signals. The handler of ROS would shut the context down during a callback that publishes;
    # the handler of Python would wait until the executor returns from C++.
    sender, receiver = socket.socketpair()
    sender.setblocking(False)
    signal.set_wakeup_fd(sender.fileno())
    for number in _SIGNALS:
        signal.signal(number, lambda *_: None)
    try:
        set_up_discovery()
        rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
        node = make_node()
    except (ValueError, RuntimeError) as error:  # RCLError (of a parameter file, for example) is a RuntimeError
        print(f'not started: {" ".join(str(error).split())}', file=sys.stderr)
        rclpy.try_shutdown()
        return 2
    stopped = Future()
    threading.Thread(target=_await_signal, args=(receiver, stopped), daemon=True).start()
    try:
        if not start(node):
            return 2
        gc.freeze()  # the collector skips permanent objects; with numba they would cost 60 ms each time
        spin(node, stopped)
    except ExternalShutdownException:
        pass
    finally:
        stop(node)
        node.destroy_node()
        rclpy.try_shutdown()
    return 0


def run_tool(make_node: Callable[[], AnyNode], act: Callable[[AnyNode], int], name: str) -> int:
    """Create a node, let it act once, return its exit code; 2 with one line for a ValueError, 130 after Ctrl-C."""
    set_up_discovery()
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)  # Ctrl-C is a KeyboardInterrupt
    node = make_node()
    try:
        return act(node)
    except ValueError as error:
        print(f'{name}: {" ".join(str(error).split())}', file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        return 130
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


def _await_signal(receiver: socket.socket, stopped: Future) -> None:
    receiver.recv(1)
    stopped.set_result(None)
