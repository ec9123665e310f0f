"""Three actuators that follow sines, as their drivers publish them: standard messages. Run, it moves them."""

import json
import math
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import rclpy
from rclpy.context import Context
from rclpy.node import Node
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from harness.compensation import SCALE
from harness.processes import graph_environment, node_process

NAMES = ('boom', 'arm', 'bucket')
AREA_A, AREA_B = math.pi / 4 * 0.040**2, math.pi / 4 * (0.040**2 - 0.022**2)  # [m2]
FRICTION = 45.0  # [N] that the drivers measure while the rods slide
BAR = 1e5  # [Pa]
AMPLITUDE, FREQUENCY = 0.02, 0.5  # [m], [Hz]
LONGEST_CATCH_UP = 0.02  # [s] after a longer stall the lost samples are left out
LAG = 0.002  # [s] of the rod behind its reference


def mapping() -> str:
    """Mapping file of the machine, as JSON, which is YAML."""
    actuators = {
        name: {
            'seals': ['ms28775_114@a', 'ms28775_114@b'],
            'bore': '40 mm',
            'rod': '22 mm',
            'inputs': {
                'velocity': f'/joint_states velocity[{name}]',
                'position': f'/joint_states position[{name}]',
                'reference_position': f'/set position[{name}]',
                'reference_velocity': f'/set velocity[{name}]',
                'pressure_a': {'topic': '/a', 'field': f'data[{i}]', 'unit': 'bar'},
                'pressure_b': {'topic': '/b', 'field': f'data[{i}]', 'unit': 'bar'},
            },
            'force_sum': {'pressures': True, 'load_force': f'/joint_states effort[{name}]'},
            'parameters': {'feedforward': {'scale': SCALE}},
        }
        for i, name in enumerate(NAMES)
    }
    joints, array = 'sensor_msgs/msg/JointState', 'std_msgs/msg/Float64MultiArray'
    topics = {'/joint_states': joints, '/set': joints, '/a': array, '/b': array}
    return json.dumps({'name': 'three_axes', 'topics': topics, 'actuators': actuators})


class MovingMachine:
    """Publishes in a thread of its own while the block runs.

    Args:
        domain: ROS domain; None: that of the environment.
        rate: Samples a second.
    """

    def __init__(self, domain: int | None, rate: float) -> None:
        self._context, self._rate = Context(), rate
        rclpy.init(context=self._context, domain_id=domain)
        self._node = Node('drivers', context=self._context)
        kinds = {'/a': Float64MultiArray, '/b': Float64MultiArray, '/set': JointState, '/joint_states': JointState}
        self._publishers = {topic: self._node.create_publisher(kind, topic, 10) for topic, kind in kinds.items()}
        self._stopped = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self) -> 'MovingMachine':
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stopped.set()
        self._thread.join()
        self._node.destroy_node()
        rclpy.try_shutdown(context=self._context)

    def _run(self) -> None:
        start, began, number = time.monotonic(), time.time_ns(), 0
        while not self._stopped.is_set():
            time.sleep(max(start + number / self._rate - time.monotonic(), 0.0))
            self._publish(number / self._rate, began + round(number * 1e9 / self._rate))
            late = round((time.monotonic() - start) * self._rate) - number
            number += late if late > LONGEST_CATCH_UP * self._rate else 1

    def _publish(self, moment: float, stamp: int) -> None:
        for topic, message in messages_at(moment).items():
            if isinstance(message, JointState):
                message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, 10**9)
            self._publishers[topic].publish(serialize_message(message))


def messages_at(moment: float) -> dict[str, Any]:
    """Messages of a moment [s], by topic; the velocities come last, since they make the estimates."""
    omega = 2 * math.pi * FREQUENCY
    phases = [omega * moment + 2.0 * i for i in range(len(NAMES))]
    seen = [phase - omega * LAG for phase in phases]
    velocities = [AMPLITUDE * omega * math.cos(phase) for phase in seen]
    pressures = [30.0 + 2.0 * math.sin(phase) for phase in seen], [28.0 - 1.0 * math.sin(phase) for phase in seen]
    loads = [
        math.copysign(FRICTION, velocity) - (a * AREA_A - b * AREA_B) * BAR
        for velocity, a, b in zip(velocities, *pressures, strict=True)
    ]
    return {
        '/a': Float64MultiArray(data=pressures[0]),
        '/b': Float64MultiArray(data=pressures[1]),
        '/set': JointState(
            name=NAMES,
            position=[AMPLITUDE * math.sin(phase) for phase in phases],
            velocity=[AMPLITUDE * omega * math.cos(phase) for phase in phases],
        ),
        '/joint_states': JointState(
            name=NAMES, position=[AMPLITUDE * math.sin(phase) for phase in seen], velocity=velocities, effort=loads
        ),
    }


@contextmanager
def machine(folder: Path, domain: int, rate: float = 1000.0, **parameters: object) -> Iterator[subprocess.Popen[bytes]]:
    """Drivers and the estimator of three actuators with ``parameters``; the process of the estimator."""
    environment = {**graph_environment(domain), 'PYTHONPATH': str(Path(__file__).parents[1])}
    path = folder / 'machine.yaml'
    path.write_text(mapping())
    with node_process('machine_estimator', domain, {'machine': str(path), **parameters}, folder / 'log') as estimator:
        drivers = subprocess.Popen([sys.executable, '-m', 'harness.moving_machine', str(rate)], env=environment)
        try:
            yield estimator
        finally:
            drivers.terminate()
            drivers.wait()


if __name__ == '__main__':
    with MovingMachine(None, float(sys.argv[1])):
        threading.Event().wait()
