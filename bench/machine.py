"""A machine of several actuators in one node, all recorded: ``python bench/machine.py [--actuators 3 12]``.

One ``sensor_msgs/JointState`` with all velocities, two ``std_msgs/Float64MultiArray`` with all pressures and one
``JointState`` with all references at ``--rate``; two answers of each actuator out, all recorded. Beside it, in the same
run and in turn, the estimator of one actuator with its own messages (four in, two out, recorded), the machine,
and the machine with an array of commands for a controller as well. Ratios are those of a round, and of them the median.
Processor time is that of the whole process, its middleware and its recorder among it.

The bare node takes and sends as many messages with rclpy; it decodes, computes and records nothing.
"""

import argparse
import json
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

import rclpy
from rclpy.context import Context
from rclpy.node import Node
from rclpy.serialization import deserialize_message, serialize_message
from rclpy.task import Future
from seal_friction_msgs.msg import (
    CylinderPressure,
    ForceSum,
    FrictionEstimate,
    FrictionFeedForward,
    MachineFriction,
    RodVelocity,
    ServoReference,
)
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

sys.path.insert(0, str(Path(__file__).parents[1] / 'test'))
from harness.campaign import tell
from harness.compensation import LIVE, SCALE
from harness.processes import free_domain, graph_environment, node_process

from seal_friction_ros.core.messages.coder import encode
from seal_friction_ros.core.messages.records import NO_ESTIMATE, FeedForward
from seal_friction_ros.nodes import qos
from seal_friction_ros.nodes.discovery import set_up_discovery
from seal_friction_ros.nodes.executor import spin
from seal_friction_ros.offline.replay.replay import replay

OWN = 'one actuator, own messages'
WARM_UP = 0.5  # [s] of a round, not counted
_PATIENCE = 60.0  # [s] until the first answer
NO_FORCE = FeedForward(0, 0.0, 0.0, 0)


class Case(NamedTuple):
    """A node under test."""

    count: int  # of actuators; 0: one, with its own messages
    together: bool = False  # whether the answers are one message
    commands: bool = False  # whether it also publishes what a controller takes
    bare: bool = False  # whether it is a node that only takes and sends

    @property
    def name(self) -> str:
        """For the table."""
        if not self.count:
            return OWN
        kind = 'bare node with the messages of' if self.bare else 'machine of'
        form = ', answers together' * self.together + ', and commands' * self.commands
        return f'{kind} {self.count}{form}'


def mapping(case: Case) -> str:
    """Mapping file of a machine."""
    fixed = {
        'seals': ['ms28775_114@a', 'ms28775_114@b'],
        'bore': '40 mm',
        'rod': '22 mm',
        'force_sum': {'pressures': True},
    }
    actuators = {
        f'axis_{i}': fixed
        | {
            'parameters': {'feedforward': {'scale': SCALE}},
            'inputs': {
                'velocity': f'/joint_states velocity[axis_{i}]',
                'reference_velocity': f'/set velocity[axis_{i}]',
                'pressure_a': {'topic': '/a', 'field': f'data[{i}]', 'unit': 'bar'},
                'pressure_b': {'topic': '/b', 'field': f'data[{i}]', 'unit': 'bar'},
            },
        }
        for i in range(case.count)
    }
    if case.commands:
        for i, actuator in enumerate(actuators.values()):
            actuator['output'] = {'topic': '/effort', 'type': 'std_msgs/msg/Float64MultiArray', 'index': i}
    joints, array = 'sensor_msgs/msg/JointState', 'std_msgs/msg/Float64MultiArray'
    topics = {'/joint_states': joints, '/set': joints, '/a': array, '/b': array}
    answers = 'together' if case.together else 'each'
    return json.dumps({'name': 'bench', 'topics': topics, 'answers': answers, 'actuators': actuators})  # which is YAML


def echo(count: int) -> None:
    """Take the messages of a machine, and send as many bytes as its answers have, whatever they say."""
    rclpy.init()
    node = Node('bare')
    answers = [
        (FrictionEstimate, 'friction_estimate', NO_ESTIMATE._replace(stamp=0)),
        (FrictionFeedForward, 'feedforward', NO_FORCE),
    ]
    sent = [
        (node.create_publisher(kind, f'/axis_{i}/{topic}', qos.STREAM), encode(record))
        for i in range(count)
        for kind, topic, record in answers
    ]

    def answer(_data: bytes) -> None:
        for publisher, data in sent:
            publisher.publish(data)

    for kind, topic in ((Float64MultiArray, '/a'), (Float64MultiArray, '/b'), (JointState, '/set')):
        node.create_subscription(kind, topic, lambda _data: None, qos.STREAM, raw=True)
    node.create_subscription(JointState, '/joint_states', answer, qos.STREAM, raw=True)
    spin(node, Future())


class Asker:
    """Publishes the inputs of a node under test, and counts its answers, while its block runs."""

    def __init__(self, process: Any, domain: int, case: Case) -> None:
        count = case.count
        self.process, self.count, self.answers = process, max(count, 1), 0
        self.context = Context()
        rclpy.init(context=self.context, domain_id=domain)
        self.node = Node(f'asker_{domain}', context=self.context)
        self.messages: list[tuple[Any, Any]] = []
        if count:
            names = [f'axis_{i}' for i in range(count)]
            moving = JointState(name=names, position=[0.1] * count, velocity=[0.05] * count, effort=[0.0] * count)
            self._add(Float64MultiArray, '/a', Float64MultiArray(data=[30.0] * count))
            self._add(Float64MultiArray, '/b', Float64MultiArray(data=[28.0] * count))
            self._add(JointState, '/set', JointState(name=names, velocity=[0.05] * count))
            self._add(JointState, '/joint_states', moving)
            topics = [f'/{name}/friction_estimate' for name in names]
        else:
            self._add(CylinderPressure, 'cylinder_pressure', CylinderPressure(chamber_a=3e6, chamber_b=2.8e6))
            self._add(ForceSum, 'force_sum', ForceSum(force=10.0))
            self._add(ServoReference, 'servo_reference', ServoReference(velocity=0.05))
            self._add(RodVelocity, 'rod_velocity', RodVelocity(velocity=0.05))
            topics = ['friction_estimate']
        kind = MachineFriction if case.together else FrictionEstimate
        for topic in ['/machine_estimator/friction'] if case.together else topics:
            hear = self._hear_all if case.together else self._hear
            self.node.create_subscription(kind, topic, hear, qos.STREAM, raw=True)

    def _add(self, kind: Any, topic: str, message: Any) -> None:
        self.messages.append((self.node.create_publisher(kind, topic, qos.STREAM), message))

    def _hear(self, _data: bytes) -> None:
        self.answers += 1

    def _hear_all(self, data: bytes) -> None:
        self.answers += len(deserialize_message(data, MachineFriction).estimated)

    def __enter__(self) -> 'Asker':
        self._stopped = Future()
        self._thread = threading.Thread(target=spin, args=(self.node, self._stopped, self.context), daemon=True)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stopped.set_result(None)
        self._thread.join()
        self.node.destroy_node()
        rclpy.try_shutdown(context=self.context)

    def ask(self) -> None:
        """Publish the inputs of one moment."""
        stamp = self.node.get_clock().now().to_msg()
        for publisher, message in self.messages:
            if hasattr(message, 'header'):
                message.header.stamp = stamp
            publisher.publish(serialize_message(message))

    def cpu(self) -> float:
        """Processor time of the node under test [s]."""
        threads = Path(f'/proc/{self.process.pid}/task').glob('*/schedstat')
        return sum(int(thread.read_text().split()[0]) for thread in threads) * 1e-9

    def round(self, rate: int, seconds: float) -> tuple[float, float, int]:
        """Processor time per actuator and sample [us], load of one core [-], answers missed."""
        warm, number = round(WARM_UP * rate), round(seconds * rate)
        start = time.perf_counter_ns()
        for index in range(warm + number):
            time.sleep(max(start + index * 10**9 // rate - time.perf_counter_ns(), 0) * 1e-9)
            if index == warm:
                time.sleep(0.1)
                start += 100_000_000
                self.answers, cpu, began = 0, self.cpu(), time.perf_counter()
            self.ask()
        taken = time.perf_counter() - began
        time.sleep(0.3)  # for the last answers
        used = self.cpu() - cpu
        return used / number / self.count * 1e6, used / taken, number * self.count - self.answers


@contextmanager
def node(case: Case, folder: Path) -> Iterator[Asker]:
    """A node under test, and who asks it.

    Raises:
        RuntimeError: It does not answer.
    """
    domain = free_domain()
    values: dict[str, Any] = {
        'record': True,
        'record_directory': str(folder),
        'record_name': case.name,
    }
    if case.count:
        path = folder / f'{case.name}.yaml'
        path.write_text(mapping(case))
        values['machine'] = str(path)
    else:
        values |= LIVE
    with ExitStack() as stack:
        name, log = 'machine_estimator' if case.count else 'friction_estimator', folder / f'{case.name}.log'
        if case.bare:
            command = [sys.executable, __file__, '--bare', str(case.count)]
            process = stack.enter_context(subprocess.Popen(command, env=graph_environment(domain)))
            stack.callback(process.kill)
        else:
            process = stack.enter_context(node_process(name, domain, values, log))
        asker = stack.enter_context(Asker(process, domain, case))
        deadline = time.monotonic() + _PATIENCE
        while not asker.answers:
            asker.ask()
            time.sleep(0.05)
            if time.monotonic() > deadline:
                raise RuntimeError(f'{case.name} does not answer; see {log}')
        yield asker


class Round(NamedTuple):
    """Result of one round."""

    cost: float  # [us] per actuator and sample
    of_own: float  # [-] of the cost of one actuator with its own messages in this round
    load: float  # [-] of one core
    missed: int


def groups(count: int) -> list[list[Case]]:
    """Machines of ``count`` actuators that are asked in turn: the nodes of a group run at the same time."""
    return [
        [Case(count), Case(count, together=True)],
        [Case(count, together=True, commands=True), Case(count, bare=True)],
    ]


def main() -> int:
    """Ask all of them in turn, and print a table, or JSON."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n', maxsplit=1)[0])
    parser.add_argument('--actuators', type=int, nargs='+', default=[3, 12])
    parser.add_argument('--rate', type=int, default=500, help='[Hz]')
    parser.add_argument('--seconds', type=float, default=4.0, help='of a round')
    parser.add_argument('--rounds', type=int, default=3)
    parser.add_argument('--json', action='store_true')
    parser.add_argument('--bare', type=int, default=0, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    set_up_discovery()
    if arguments.bare:
        echo(arguments.bare)
        return 0
    found: dict[Case, list[Round]] = {}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for group in (group for count in arguments.actuators for group in groups(count)):
            with ExitStack() as stack:
                askers = {one: stack.enter_context(node(one, folder)) for one in (Case(0), *group)}
                for _ in range(arguments.rounds):
                    rounds = {one: asker.round(arguments.rate, arguments.seconds) for one, asker in askers.items()}
                    for one, (cost, load, missed) in rounds.items():
                        found.setdefault(one, []).append(Round(cost, cost / rounds[Case(0)][0], load, missed))
            shutil.rmtree(folder / OWN)
        identical = {one: replay(folder / one.name).identical for one in found if one.count and not one.bare}
    figures = {
        one.name: {
            'per actuator and sample [us]': round(median(r.cost for r in rounds), 1),
            'of one with own messages': round(median(r.of_own for r in rounds), 2),
            'load of one core [%]': round(100 * median(r.load for r in rounds)),
            'missed': sum(r.missed for r in rounds),
            'replay identical': identical.get(one, ''),
        }
        for one, rounds in found.items()
    }
    title = f'{arguments.rate} Hz, recorded, median of {arguments.rounds} rounds'
    tell(figures, as_json=arguments.json, title=title)
    return 0


if __name__ == '__main__':
    sys.exit(main())
