"""Round trip through the live node beside that of bare echo nodes: ``python bench/live.py [--before TREE] [--json]``.

Nodes, each a process and a graph of its own, are asked in turn, in many short rounds: an rclpy node that sends each
message back, with the SingleThreadedExecutor and with the events executor, and the estimator without and with
recording. The echo has one topic; the estimator three in and two out, all recorded. A round
trip is from the publishing of a velocity to the arrival of the answer in this process. The bare nodes and who asks have
Fast DDS as it comes, the estimator as this package sets it up.

Percentiles are those of a round, and of them the median over all rounds; so is the ratio to the bare echo, taken round
by round: a slow moment of the machine is one bad round, not a wrong result. The maximum and what is missed are of all.

``--before TREE`` measures the estimator beside that of another checkout, which has its own ``.venv``, instead of bare
nodes. The ratio is close to 1 then: it is given with its standard error, and rounds are longer. Processor time differs
by a tenth from one launch of the same node to the next: ``--launches 10`` starts all nodes anew so often.

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
from collections.abc import Collection, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median
from typing import Any

import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.task import Future
from rich.console import Console
from rich.progress import Progress
from seal_friction_msgs.msg import CylinderPressure, ForceSum, FrictionEstimate, FrictionFeedForward, RodVelocity

sys.path.insert(0, str(Path(__file__).parents[1] / 'test'))
from harness.campaign import show
from harness.compensation import LIVE
from harness.processes import free_domain, graph_environment, node_process

from seal_friction_ros.core.messages.coder import encode
from seal_friction_ros.core.messages.records import Force, Pressure, Velocity
from seal_friction_ros.nodes import qos
from seal_friction_ros.nodes.discovery import PROFILES, RANGE
from seal_friction_ros.nodes.executor import spin

RATES = (100, 500, 1000)  # [Hz]
BARE, EVENTS = 'bare echo, SingleThreadedExecutor', 'bare echo, events executor'
ALONE, RECORDING = 'estimator', 'estimator, recording'
BEFORE, BEFORE_RECORDING = 'estimator before', 'estimator before, recording'
CASES = {
    BARE: '',
    EVENTS: BARE,
    ALONE: BARE,
    RECORDING: BARE,
}
"""Each case, and the one that it is compared with."""
CASES_BEFORE = {
    BEFORE: '',
    ALONE: BEFORE,
    BEFORE_RECORDING: '',
    RECORDING: BEFORE_RECORDING,
}
"""The same with another tree."""


@dataclass(frozen=True)
class Rounds:
    """Length of a round of one case."""

    duration: float  # [s]
    samples: int  # at least
    warm_up: float  # [s] at its beginning that does not count: the node has slept while others were asked

    def number(self, rate: int) -> int:
        """Samples of a round at ``rate`` [Hz]."""
        return max(round(self.duration * rate), self.samples)


SHORT = Rounds(0.5, 300, 0.02)
LONG = Rounds(1.0, 300, 1.2)  # the watchdog acts a hundred times a second in the first second after a pause
_STAMP = struct.Struct('<4xiI')
_PATIENCE = 60.0  # [s] until the first answer
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
                (pressure, lambda stamp: encode(Pressure(stamp, 2e6, 1e6))),
                (force, lambda stamp: encode(Force(stamp, 10.0))),
            ]
            self.node.create_subscription(FrictionEstimate, 'friction_estimate', self._hear, qos.STREAM, raw=True)
            self.node.create_subscription(
                FrictionFeedForward, 'friction_feedforward', lambda _: None, qos.STREAM, raw=True
            )

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
        self.stamp = time.time_ns()
        for publisher, encoded in self.others:
            publisher.publish(encoded(self.stamp))
        data = encode(Velocity(self.stamp, 0.1, b''))
        self.sent[self.stamp] = time.perf_counter_ns()
        self.velocity.publish(data)

    def cpu(self) -> float:
        """Processor time of the node under test [s]."""
        threads = Path(f'/proc/{self.process.pid}/task').glob('*/schedstat')
        return sum(int(thread.read_text().split()[0]) for thread in threads) * 1e-9

    def wakes(self) -> int:
        """How often the event thread of Fast DDS in the node under test has gone to sleep."""
        for thread in Path(f'/proc/{self.process.pid}/task').iterdir():
            if (thread / 'comm').read_text().startswith('dds.ev'):
                return int((thread / 'status').read_text().partition('\nvoluntary_ctxt_switches:')[2].split()[0])
        return 0


PERCENTILES = {'p50': 0.5, 'p90': 0.9, 'p99': 0.99}


@dataclass
class Figures:
    """What was measured of one case at one rate."""

    round_trips: list[list[int]] = field(default_factory=list)
    """of each round, sorted [ns]"""
    cpu: list[float] = field(default_factory=list)
    """processor time per sample of each round [s]"""
    sent: int = 0
    wakes: int = 0
    """of the event thread of the middleware"""

    def of_rounds(self) -> dict[str, list[float]]:
        """Percentiles and processor time per sample of each round [us]."""
        found = {
            name: [times[int(share * len(times))] * 1e-3 for times in self.round_trips]
            for name, share in PERCENTILES.items()
        }
        return {**found, 'CPU per sample': [each * 1e6 for each in self.cpu]}

    def summary(self) -> dict[str, float]:
        """Of all rounds."""
        found = {f'{name} [us]': round(median(values), 1) for name, values in self.of_rounds().items()}
        found['max [us]'] = round(max(times[-1] for times in self.round_trips) / 1e3, 1)
        found['event thread woken per sample'] = round(self.wakes / self.sent, 2)
        return {**found, 'missed': self.sent - sum(map(len, self.round_trips))}


def ask(asker: Asker, rate: int, rounds: Rounds, figures: Figures) -> None:
    """Ask at a rate [Hz] for one round.

    Raises:
        RuntimeError: Nothing is answered.
    """
    start, number, warm_up = time.perf_counter_ns(), rounds.number(rate), max(round(rounds.warm_up * rate), 20)
    for index in range(warm_up + number):
        time.sleep(max(start + index * 10**9 // rate - time.perf_counter_ns(), 0) * 1e-9)
        if index == warm_up:
            asker.sent.clear()
            asker.round_trips.clear()
            cpu, wakes = asker.cpu(), asker.wakes()
        asker.ask()
    time.sleep(0.05)  # for the last answer
    if not asker.round_trips:
        raise RuntimeError(f'{asker.case} answers no more')
    figures.round_trips.append(sorted(asker.round_trips))
    figures.cpu.append((asker.cpu() - cpu) / number)
    figures.wakes += asker.wakes() - wakes
    figures.sent += number


def of_tree(tree: Path) -> dict[str, Any]:
    """How `node_process` runs the node of another tree, with the middleware as that tree sets it up."""
    without = (part for name in PROFILES for part in ('-u', name))
    return {
        'prefix': ('env', *without, '-C', str(tree)),
        'interpreter': str(tree.resolve() / '.venv' / 'bin' / 'python'),
    }


@contextmanager
def node(case: str, folder: Path, realtime: int, before: Path | None = None) -> Iterator[Asker]:
    """The node under test in a process of its own, and who asks it.

    Args:
        case: One of `CASES` or `CASES_BEFORE`.
        folder: Of logs and bags.
        realtime: SCHED_FIFO priority; 0: none.
        before: The other tree.

    Raises:
        RuntimeError: It does not answer.
    """
    domain, log = free_domain(), folder / 'log'
    with ExitStack() as stack:
        if case in (BARE, EVENTS):
            command = [sys.executable, __file__, '--echo', case, '--realtime', str(realtime)]
            environment = {name: value for name, value in graph_environment(domain).items() if name not in PROFILES}
            process = stack.enter_context(subprocess.Popen(command, env=environment))
            stack.callback(process.kill)
        else:
            values: dict[str, Any] = {**LIVE, 'feedforward.use_measured_velocity': True, 'realtime_priority': realtime}
            if case in (RECORDING, BEFORE_RECORDING):
                values |= {'record': True, 'record_directory': str(folder), 'record_name': case}
            tree = of_tree(before) if before is not None and case in (BEFORE, BEFORE_RECORDING) else {}
            process = stack.enter_context(node_process('friction_estimator', domain, values, log, **tree))
        for name in PROFILES:
            os.environ.pop(name, None)
        os.environ[RANGE] = 'LOCALHOST'
        asker = stack.enter_context(Asker(case, domain, process))
        deadline = time.monotonic() + _PATIENCE
        while not asker.is_answered():
            if time.monotonic() > deadline:
                raise RuntimeError(f'{case} does not answer')
        yield asker


def measure(
    cases: Collection[str],
    lengths: Rounds,
    seconds: float,
    realtime: int,
    rates: tuple[int, ...],
    before: Path | None,
    found: dict[str, dict[int, Figures]],
) -> None:
    """Launch all of them, ask them in turn, to and fro, and add what was found."""
    os.environ[RANGE] = 'LOCALHOST'
    with ExitStack() as stack, Progress(console=Console(stderr=True)) as progress:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        askers = [stack.enter_context(node(case, folder, realtime, before)) for case in cases]
        rounds = {rate: max(round(seconds * rate / lengths.number(rate)), 1) for rate in rates}
        task = progress.add_task('round trips', total=sum(rounds.values()) * len(askers))
        for rate in rates:
            for turn in range(rounds[rate]):
                for asker in askers[:: 1 if turn % 2 == 0 else -1]:
                    ask(asker, rate, lengths, found[asker.case][rate])
                    progress.advance(task)


def ratios(
    found: dict[str, dict[int, Figures]], compared: Mapping[str, str]
) -> dict[str, dict[str, tuple[float, float]]]:
    """Of each case to the one that it is compared with, at each rate: median of the rounds, and its standard error."""
    result = {}
    for case, other in compared.items():
        if not other:
            continue
        for rate, figures in found[case].items():
            base = found[other][rate].of_rounds()
            result[f'{case}, {rate} Hz'] = {
                name: _median_and_error([own / its for own, its in zip(values, base[name], strict=True)])
                for name, values in figures.of_rounds().items()
            }
    return result


def _median_and_error(values: list[float]) -> tuple[float, float]:
    """The error from the median distance to the median, which a burst of the machine does not change."""
    middle = median(values)
    spread = 1.48 * median(abs(value - middle) for value in values)  # the standard deviation of a normal distribution
    return round(middle, 2), round(1.25 * spread / len(values) ** 0.5, 2)  # 1.25: of a median, not of a mean


def main() -> int:
    """Measure; print tables or JSON."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n', maxsplit=1)[0])
    parser.add_argument('--seconds', type=float, default=12.0, help='of each case at each rate')
    parser.add_argument('--rates', type=int, nargs='+', default=list(RATES), help='[Hz]')
    parser.add_argument('--realtime', type=int, default=0, help='SCHED_FIFO priority of all processes; 0: none')
    parser.add_argument('--busy', type=int, default=0, help='processes that compute without end beside them')
    parser.add_argument('--launches', type=int, default=1, help='of each node; the seconds are divided among them')
    parser.add_argument('--before', type=Path, metavar='TREE', help='another checkout, with its own .venv')
    parser.add_argument('--echo', help=argparse.SUPPRESS)
    parser.add_argument('--json', action='store_true')
    arguments = parser.parse_args()
    if arguments.realtime:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(arguments.realtime))
    if arguments.echo:
        echo(arguments.echo)
        return 0
    compared, lengths = (CASES_BEFORE, LONG) if arguments.before else (CASES, SHORT)
    sys.setswitchinterval(1e-4)
    busy = [subprocess.Popen([sys.executable, '-c', _BUSY]) for _ in range(arguments.busy)]
    try:
        rates, seconds = tuple(arguments.rates), arguments.seconds / arguments.launches
        found = {case: {rate: Figures() for rate in rates} for case in compared}
        for _ in range(arguments.launches):
            measure(compared, lengths, seconds, arguments.realtime, rates, arguments.before, found)
    finally:
        for process in busy:
            process.kill()
    if arguments.json:
        figures = {case: {rate: f.summary() for rate, f in rates.items()} for case, rates in found.items()}
        print(json.dumps({'figures': figures, 'ratios': ratios(found, compared)}))
        return 0
    _print(found, compared)
    return 0


def _print(found: dict[str, dict[int, Figures]], compared: Mapping[str, str]) -> None:
    show(
        [
            {'node': case, 'rate [Hz]': rate, **figures.summary()}
            for case, rates in found.items()
            for rate, figures in rates.items()
        ],
        'Round trip',
    )
    for other in dict.fromkeys(filter(None, compared.values())):
        rows = ratios(found, {case: its for case, its in compared.items() if its == other})
        texts = {
            node: {name: f'{middle:g} ± {error:g}' for name, (middle, error) in values.items()}
            for node, values in rows.items()
        }
        show(texts, f'Ratio to the {other}: median of rounds ± its error')


if __name__ == '__main__':
    sys.exit(main())
