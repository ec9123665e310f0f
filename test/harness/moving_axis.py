"""One actuator that follows a sine, as its drivers publish it; a test stops single drivers, or all of them."""

import math
import subprocess
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import rclpy
from rclpy.context import Context
from rclpy.node import Node

from harness.processes import graph_environment, node_process
from seal_friction_ros.core.messages.coder import encode
from seal_friction_ros.core.messages.layouts import INPUTS
from seal_friction_ros.core.messages.records import Force, Position, Pressure, ServoReference, Velocity
from seal_friction_ros.nodes import qos
from seal_friction_ros.nodes.managed_node import message_class

AMPLITUDE, FREQUENCY = 0.02, 0.5  # [m], [Hz]
FRICTION = 45.0  # [N] that the drivers measure
RATE = 200.0  # [Hz]
TOPICS = {
    Pressure: 'cylinder_pressure',
    Force: 'force_sum',
    ServoReference: 'servo_reference',
    Position: 'rod_position',
    Velocity: 'rod_velocity',
}


class MovingAxis:
    """Publishes in a thread of its own while the block runs.

    Args:
        domain: ROS domain.
        begin_stopped: Whether nothing is published at first.
        frame: Name of the frame in every message.
    """

    def __init__(self, domain: int, *, begin_stopped: bool = False, frame: bytes = b'rod') -> None:
        graph_environment(domain)
        self._context = Context()
        rclpy.init(context=self._context, domain_id=domain)
        self._node = Node('drivers', context=self._context)
        self._publishers = {
            kind: self._node.create_publisher(message_class(INPUTS[topic]), topic, qos.STREAM)
            for kind, topic in TOPICS.items()
        }
        self.stopped: set[type] = set(TOPICS) if begin_stopped else set()
        """inputs that are not published"""
        self._frame, self._ended = frame, threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self) -> 'MovingAxis':
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._thread.join()
        self._node.destroy_node()
        rclpy.try_shutdown(context=self._context)

    def stop(self, *kinds: type) -> None:
        """Publish some inputs no longer; none named: all."""
        self.stopped = set(kinds or TOPICS)

    def go_on(self) -> None:
        """Publish all inputs again."""
        self.stopped = set()

    def _run(self) -> None:
        due = time.monotonic()
        while not self._ended.wait(max(due - time.monotonic(), 0.0)):
            due = max(due + 1.0 / RATE, time.monotonic())
            self._publish(time.time_ns())

    def _publish(self, stamp: int) -> None:
        omega = 2 * math.pi * FREQUENCY
        phase = omega * (stamp % 10**12) * 1e-9
        position, velocity = AMPLITUDE * math.sin(phase), AMPLITUDE * omega * math.cos(phase)
        acceleration = -AMPLITUDE * omega**2 * math.sin(phase)
        for record in (
            Pressure(stamp, 2e6 + 1e5 * math.sin(phase), 1.8e6),
            Force(stamp, math.copysign(FRICTION, velocity)),
            ServoReference(stamp, position + 1e-4, velocity, acceleration),
            Position(stamp, position),
            Velocity(stamp, velocity, self._frame),
        ):
            if type(record) not in self.stopped:
                self._publishers[type(record)].publish(encode(record, self._frame))


@contextmanager
def compensated(domain: int, log: Path) -> Iterator[subprocess.Popen[bytes]]:
    """The estimator of a `MovingAxis`, with a feed-forward, in a process of its own."""
    parameters = {'feedforward.scale': 0.9, 'seals': ['ms28775_114@a', 'ms28775_114@b']}
    with node_process('friction_estimator', domain, parameters, log) as process:
        yield process
