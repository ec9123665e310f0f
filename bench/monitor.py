"""What the live view costs an estimator: ``python bench/monitor.py [--seconds 10] [--rounds 5] [--own-processor]``.

The same estimator runs without the monitor and with it and its page open, in turn: one actuator with its own messages
beside the simulated servo, and a machine of three actuators, both at 1 kHz. Processor time is that of the whole process
of the estimator; the p99 of its latency is what its diagnostics say, the median over the seconds of a round.

In a third round a process without ROS computes as much as the monitor: what any neighbour costs.

With ``--own-processor`` the estimator alone has the first processor, as on a machine that isolates its control loop.
Without, simulator, monitor, page and estimator share all of them: on two, the p99 is mostly that of their queue.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node

sys.path.insert(0, str(Path(__file__).parents[1] / 'test'))
from harness.browser import browser, chromium
from harness.campaign import tell
from harness.compensation import LIVE
from harness.monitor_process import Reader, monitor
from harness.moving_machine import machine
from harness.processes import free_domain, node_process
from harness.spin_nodes import SpunNodes, ros_context
from paths import ROOT

CASES = ('one actuator', 'machine of three')
PROCESSORS = os.sched_getaffinity(0)
P99, RATE = 'latency p99 [us]', 'estimate rate [Hz]'

SHARE = 0.15  # of a processor, of the process without ROS: what the monitor takes, see its column
COMPUTE = f"""
import time
while True:
    end = time.process_time() + {SHARE} * 0.05
    while time.process_time() < end:
        sum(range(1000))
    time.sleep({1.0 - SHARE} * 0.05)
"""


class Times(NamedTuple):
    """Durations of a round [s]."""

    counted: float
    warm_up: float


class Round(NamedTuple):
    """Figures of some seconds."""

    cpu: float  # [us] of the estimator per estimate
    p99: float  # [us]
    monitor_cpu: float  # [s] of the monitor per second; 0.0 without


class Rounds(NamedTuple):
    """Rounds in the order in which they were measured."""

    alone: list[Round]
    neighbour: list[Round]
    monitor: list[Round]


class Listener(Node):
    """Keeps the p99 that the estimator reports each second."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__('bench', **kwargs)
        self.p99: list[float] = []
        self.rates: list[float] = []
        self.create_subscription(DiagnosticArray, '/diagnostics', self._on_diagnostics, 10)

    def _on_diagnostics(self, array: DiagnosticArray) -> None:
        found = [v.value for status in array.status for v in status.values if v.key == P99 and v.value != 'none']
        if found:
            self.p99.append(max(map(float, found)))
            self.rates.append(sum(float(v.value) for s in array.status for v in s.values if v.key == RATE))


def cpu(pid: int) -> float:
    """Processor time of a process [s]."""
    threads = Path(f'/proc/{pid}/task').glob('*/schedstat')
    return sum(int(thread.read_text().split()[0]) for thread in threads) * 1e-9


@contextmanager
def estimator(case: str, folder: Path, domain: int) -> Iterator[int]:
    """Process number of a running estimator whose inputs come."""
    with ExitStack() as stack:
        if case == CASES[1]:
            process = stack.enter_context(machine(folder, domain))
        else:
            simulator = ROOT / 'config' / 'servo_simulator.yaml'
            log = folder / 'log'
            stack.enter_context(node_process('servo_simulator', domain, {}, log, parameter_file=simulator))
            process = stack.enter_context(node_process('friction_estimator', domain, LIVE, log))
        yield process.pid


def give_a_processor_to(pid: int) -> None:
    """Let every thread of a process run on the first processor alone."""
    for thread in Path(f'/proc/{pid}/task').iterdir():
        os.sched_setaffinity(int(thread.name), {min(PROCESSORS)})


def measure(pid: int, times: Times, spun: SpunNodes, listener: Listener, watching: int) -> Round:
    """One round."""
    spun.spin(times.warm_up)
    listener.p99.clear()
    listener.rates.clear()
    began, own, other = time.monotonic(), cpu(pid), cpu(watching) if watching else 0.0
    spun.spin(times.counted)
    if not spun.spin_until(lambda: listener.p99):
        raise RuntimeError('the estimator does not estimate any more')
    taken = time.monotonic() - began
    used = (cpu(watching) - other) / taken if watching else 0.0
    estimates = median(listener.rates) * taken  # fewer than sent where processors are short
    return Round((cpu(pid) - own) / estimates * 1e6, median(listener.p99), used)


@contextmanager
def computing() -> Iterator[None]:
    """A process that computes as much as the monitor and talks to nobody."""
    with subprocess.Popen([sys.executable, '-c', COMPUTE]) as process:
        try:
            yield
        finally:
            process.kill()


def run(case: str, times: Times, rounds: int, *, with_browser: bool) -> Rounds:
    """Rounds without, beside a process that computes, and with the monitor, in turn."""
    found = Rounds([], [], [])
    domain = free_domain()
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        pid = stack.enter_context(estimator(case, folder, domain))
        context = stack.enter_context(ros_context(domain))
        listener = Listener(context=context)
        stack.callback(listener.destroy_node)
        spun = SpunNodes(context, listener)
        if not spun.spin_until(lambda: listener.p99, 120.0):
            raise RuntimeError(f'no estimates: {(folder / "log").read_text()}')
        if os.sched_getaffinity(0) != PROCESSORS:
            give_a_processor_to(pid)
        for _ in range(rounds):
            found.alone.append(measure(pid, times, spun, listener, 0))
            with computing():
                found.neighbour.append(measure(pid, times, spun, listener, 0))
            with ExitStack() as page, monitor(domain) as watching:
                if with_browser:
                    page.enter_context(browser(folder)).open(watching.url)
                else:
                    Reader(watching.url)
                found.monitor.append(measure(pid, times, spun, listener, watching.process.pid))
    return found


def ratio(these: list[float], those: list[float]) -> float:
    """Median of the ratios of rounds that followed each other."""
    return round(median(one / other for one, other in zip(these, those, strict=True)), 3)


def main() -> int:
    """Measure; print a table or JSON."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n', maxsplit=1)[0])
    parser.add_argument('--seconds', type=float, default=10.0, help='of a round')
    parser.add_argument(
        '--warm-up', type=float, default=3.0, help='of a round, not counted: discovery, compilation of the page'
    )
    parser.add_argument('--rounds', type=int, default=5)
    parser.add_argument('--cases', nargs='+', choices=CASES, default=list(CASES))
    parser.add_argument('--browser', action='store_true', help='open the page in a headless Chromium on this machine')
    parser.add_argument('--own-processor', action='store_true', help='the estimator alone on the first processor')
    parser.add_argument('--json', action='store_true')
    arguments = parser.parse_args()
    if arguments.own_processor:
        if len(PROCESSORS) < 2:
            parser.error('--own-processor needs two processors')
        os.sched_setaffinity(0, PROCESSORS - {min(PROCESSORS)})
    if arguments.browser and not chromium():
        parser.error('chromium is not installed: apt-get install chromium')
    figures = {}
    for case in arguments.cases:
        found = run(case, Times(arguments.seconds, arguments.warm_up), arguments.rounds, with_browser=arguments.browser)
        figures[case] = {
            'processor per estimate, without [us]': round(median(one.cpu for one in found.alone), 1),
            'processor, with [us]': round(median(one.cpu for one in found.monitor), 1),
            'ratio of processor time': ratio([one.cpu for one in found.monitor], [one.cpu for one in found.alone]),
            'with a neighbour instead': ratio([one.cpu for one in found.neighbour], [one.cpu for one in found.alone]),
            'p99, without [us]': round(median(one.p99 for one in found.alone), 1),
            'p99, with [us]': round(median(one.p99 for one in found.monitor), 1),
            'ratio of p99': ratio([one.p99 for one in found.monitor], [one.p99 for one in found.alone]),
            'ratio of p99, neighbour': ratio([one.p99 for one in found.neighbour], [one.p99 for one in found.alone]),
            'monitor itself [%]': round(100 * median(one.monitor_cpu for one in found.monitor), 1),
            'load of the machine': round(os.getloadavg()[0], 1),
        }
    title = f'1 kHz, median of {arguments.rounds} rounds of {arguments.seconds:g} s'
    tell(figures, as_json=arguments.json, title=title)
    return 0


if __name__ == '__main__':
    sys.exit(main())
