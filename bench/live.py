"""Round trip through the live node beside that of bare echo nodes: ``python bench/live.py [--json]``.

Four nodes, each a process and a graph of its own, are asked in turn, round by round, so that a slow moment of the
machine hits all of them: an rclpy node that sends each message back, with the SingleThreadedExecutor and with the
events executor, and the estimator without and with recording. The echo has one topic; the estimator three in and two
out, all recorded. A round trip is from the publishing of a velocity to the arrival of the answer in this process.

``--busy 2 --realtime 50`` keeps both cores of a small machine busy and gives all processes real-time priority.
"""

import argparse
import json
import os
import struct
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.task import Future
from rich.console import Console
from rich.markup import escape
from rich.progress import Progress
from rich.table import Table
from seal_friction_msgs.msg import CylinderPressure, ForceSum, FrictionEstimate, FrictionFeedForward, RodVelocity

from seal_friction_ros.core import wire
from seal_friction_ros.core.records import Force, Pressure
from seal_friction_ros.core.wire import Velocity
from seal_friction_ros.nodes import qos
from seal_friction_ros.nodes.discovery import set_up_discovery
from seal_friction_ros.nodes.executor import spin
from seal_friction_ros.nodes.processes import free_domain, graph_environment, running

RATES = (100, 500, 1000)  # [Hz]
ROUNDS = 3
BARE, EVENTS = 'bare echo, SingleThreadedExecutor', 'bare echo, events executor'
ALONE, RECORDING = 'estimator', 'estimator, recording'
CASES = (BARE, EVENTS, ALONE, RECORDING)
_STAMP = struct.Struct('<4xiI')
_PATIENCE = 30.0  # [s]
_BUSY = 'import os; os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))\nwhile True: pass'


def echo(kind: str) -> None:
    """Send every velocity back, as a beginner's node does it."""
    rclpy.init()
    node = Node('echo')
    answer = node.create_publisher(RodVelocity, 'echo', qos.STREAM)
    node.create_subscription(RodVelocity, 'rod_velocity', answer.publish, qos.STREAM)
    if kind == EVENTS:
        spin(node, Future())
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    executor.spin()


class Asker:
    """Publishes inputs and hears the answers, on the graph of one case, while its block runs."""

    def __init__(self, case: str, domain: int, process: subprocess.Popen[bytes] | None) -> None:
        self.case, self.process = case, process
        self.context = Context()
        rclpy.init(context=self.context, domain_id=domain)
        self.node = Node(f'asker_{domain}', context=self.context)
        self.velocity = self.node.create_publisher(RodVelocity, 'rod_velocity', qos.STREAM)
        self.others = []
        self.sent: dict[int, int] = {}
        self.round_trips: list[int] = []
        if case in (BARE, EVENTS):
            self.node.create_subscription(RodVelocity, 'echo', self._hear, qos.STREAM, raw=True)
        else:
            pressure = self.node.create_publisher(CylinderPressure, 'cylinder_pressure', qos.STREAM)
            force = self.node.create_publisher(ForceSum, 'force_sum', qos.STREAM)
            self.others = [
                (pressure, lambda stamp: wire.encode_pressure(Pressure(stamp, 2e6, 1e6))),
                (force, lambda stamp: wire.encode_force(Force(stamp, 10.0))),
            ]
            self.node.create_subscription(FrictionEstimate, 'friction_estimate', self._hear, qos.STREAM, raw=True)
            self.node.create_subscription(
                FrictionFeedForward, 'friction_feedforward', lambda _: None, qos.STREAM, raw=True
            )
        self.stamp = time.time_ns()

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

    def _hear(self, data: bytes) -> None:
        now = time.perf_counter_ns()
        seconds, nanoseconds = _STAMP.unpack_from(data)
        sent = self.sent.pop(seconds * 10**9 + nanoseconds, None)
        if sent is not None:
            self.round_trips.append(now - sent)

    def is_answered(self) -> bool:
        """Ask once; whether an answer came."""
        self.ask()
        time.sleep(0.05)
        return bool(self.round_trips)

    def ask(self) -> None:
        """Publish the inputs of one moment, the velocity last."""
        self.stamp += 1_000_000
        for publisher, encoded in self.others:
            publisher.publish(encoded(self.stamp))
        data = wire.encode_velocity(Velocity(self.stamp, 0.1, b''))
        self.sent[self.stamp] = time.perf_counter_ns()
        self.velocity.publish(data)

    def cpu(self) -> float:
        """Processor time of the node under test [s]."""
        values = Path(f'/proc/{self.process.pid}/stat').read_text().rpartition(')')[2].split()
        return (int(values[11]) + int(values[12])) / os.sysconf('SC_CLK_TCK')


@dataclass
class Figures:
    """What was measured of one case at one rate."""

    round_trips: list[int] = field(default_factory=list)
    """[ns]"""
    sent: int = 0
    cpu: float = 0.0
    """[s]"""

    def summary(self) -> dict[str, float]:
        """Percentiles, processor time, missed."""
        ordered = sorted(self.round_trips)
        at = {'p50 [us]': 0.5, 'p90 [us]': 0.9, 'p99 [us]': 0.99}
        found = {name: ordered[int(share * len(ordered))] / 1e3 for name, share in at.items()}
        found |= {'max [us]': ordered[-1] / 1e3, 'CPU per sample [us]': self.cpu / self.sent * 1e6}
        return {**{name: round(value, 1) for name, value in found.items()}, 'missed': self.sent - len(ordered)}


def ask(asker: Asker, rate: int, seconds: float, figures: Figures) -> None:
    """Ask at a rate [Hz] for a while."""
    asker.round_trips.clear()
    asker.sent.clear()
    cpu, start = asker.cpu(), time.perf_counter_ns()
    number = round(rate * seconds)
    for index in range(number):
        time.sleep(max(start + index * 10**9 // rate - time.perf_counter_ns(), 0) * 1e-9)
        asker.ask()
    time.sleep(0.2)
    figures.round_trips += asker.round_trips
    figures.sent += number
    figures.cpu += asker.cpu() - cpu


@contextmanager
def node(case: str, folder: Path, realtime: int) -> Iterator[Asker]:
    """The node under test in a process of its own, and who asks it.

    Raises:
        RuntimeError: It does not answer.
    """
    domain, log = free_domain(), folder / 'log'
    with ExitStack() as stack:
        if case in (BARE, EVENTS):
            command = [sys.executable, __file__, '--echo', case, '--realtime', str(realtime)]
            process = stack.enter_context(subprocess.Popen(command, env=graph_environment(domain)))
            stack.callback(process.kill)
        else:
            values: dict[str, Any] = {'feedforward.use_measured_velocity': True, 'realtime_priority': realtime}
            if case == RECORDING:
                values |= {'record': True, 'record_directory': str(folder), 'record_name': 'bag'}
            process = stack.enter_context(running('friction_estimator', domain, values, log))
        asker = stack.enter_context(Asker(case, domain, process))
        deadline = time.monotonic() + _PATIENCE
        while not asker.is_answered():
            if time.monotonic() > deadline:
                raise RuntimeError(f'{case} does not answer')
        yield asker


def measure(seconds: float, realtime: int, rates: tuple[int, ...]) -> dict[str, dict[int, Figures]]:
    """Ask all of them in turn."""
    set_up_discovery()
    found = {case: {rate: Figures() for rate in rates} for case in CASES}
    with ExitStack() as stack, Progress(console=Console(stderr=True)) as progress:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        askers = [stack.enter_context(node(case, folder, realtime)) for case in CASES]
        task = progress.add_task('round trips', total=ROUNDS * len(rates) * len(askers))
        for _ in range(ROUNDS):
            for rate in rates:
                for asker in askers:
                    ask(asker, rate, seconds / ROUNDS, found[asker.case][rate])
                    progress.advance(task)
    return found


def ratios(found: dict[str, dict[int, Figures]]) -> dict[str, dict[str, float]]:
    """Of each case to the bare echo with the SingleThreadedExecutor, at each rate."""
    result = {}
    for case in CASES[1:]:
        for rate, figures in found[case].items():
            ours, bare = figures.summary(), found[BARE][rate].summary()
            names = ('p50 [us]', 'p90 [us]', 'p99 [us]', 'CPU per sample [us]')
            result[f'{case}, {rate} Hz'] = {
                name.rpartition(' [')[0]: round(ours[name] / bare[name], 2) for name in names
            }
    return result


def main() -> int:
    """Measure; print tables or JSON."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n', maxsplit=1)[0])
    parser.add_argument('--seconds', type=float, default=6.0, help='of each case at each rate')
    parser.add_argument('--rates', type=int, nargs='+', default=list(RATES), help='[Hz]')
    parser.add_argument('--realtime', type=int, default=0, help='SCHED_FIFO priority of all processes; 0: none')
    parser.add_argument('--busy', type=int, default=0, help='processes that compute without end beside them')
    parser.add_argument('--echo', help=argparse.SUPPRESS)
    parser.add_argument('--json', action='store_true')
    arguments = parser.parse_args()
    if arguments.realtime:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(arguments.realtime))
    if arguments.echo:
        echo(arguments.echo)
        return 0
    sys.setswitchinterval(1e-4)
    busy = [subprocess.Popen([sys.executable, '-c', _BUSY]) for _ in range(arguments.busy)]
    try:
        found = measure(arguments.seconds, arguments.realtime, tuple(arguments.rates))
    finally:
        for process in busy:
            process.kill()
    if arguments.json:
        figures = {case: {rate: f.summary() for rate, f in rates.items()} for case, rates in found.items()}
        print(json.dumps({'figures': figures, 'ratios': ratios(found)}))
        return 0
    _print(found)
    return 0


def _print(found: dict[str, dict[int, Figures]]) -> None:
    console = Console()
    names = list(next(iter(found[BARE].values())).summary())
    table = Table(*map(escape, ('node', 'rate [Hz]', *names)), title='Round trip')
    for case, rates in found.items():
        for rate, figures in rates.items():
            table.add_row(case, str(rate), *(f'{value:g}' for value in figures.summary().values()))
    console.print(table)
    compared = ratios(found)
    table = Table('node', *next(iter(compared.values())), title=f'Ratio to the {BARE}')
    for name, values in compared.items():
        table.add_row(name, *(f'{value:g}' for value in values.values()))
    console.print(table)


if __name__ == '__main__':
    sys.exit(main())
