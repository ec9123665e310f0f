"""Simulator and estimator at 1 kHz with recording for a set time: ``python bench/soak.py [--minutes 30] [--json]``.

Both run in processes of their own. Every few seconds memory, file handles and threads of both are read; latency and
counts come from their diagnostics; what was lost is counted in the recording, from the stamps. Exit code 1 if memory
grew by more than 1 MB after the first minute (or the first third of a shorter run), a handle or a thread was left over,
or the number of samples lost is not the one reported.
"""

import argparse
import json
import sys
import tempfile
import time
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from statistics import median
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rich.console import Console
from rich.progress import Progress
from rich.table import Table
from rich.text import Text

from seal_friction_ros.core.estimation.messages import VELOCITY_TYPE, decode
from seal_friction_ros.nodes.discovery import set_up_discovery
from seal_friction_ros.nodes.processes import free_domain, running
from seal_friction_ros.offline.bags.bag import VELOCITY_TOPIC, read_messages

PERIOD = 1_000_000  # [ns] of the simulator
LOOK = 2.0  # [s] between two looks at the processes
SETTLED = 60.0  # [s] until memory has to stand still
LARGEST_GROWTH = 1.0  # [MB]
SIMULATOR = Path(__file__).parents[1] / 'config' / 'servo_simulator.yaml'


@dataclass(frozen=True)
class Look:
    """One process at one moment."""

    time: float
    """[s] since the start"""
    memory: float
    """[MB] resident"""
    handles: int
    threads: int


def look(pid: int, since: float) -> Look:
    """Look at a process through ``/proc``."""
    status = dict(line.split(':', 1) for line in Path(f'/proc/{pid}/status').read_text().splitlines() if ':' in line)
    memory = int(status['VmRSS'].split()[0]) / 1024.0
    handles = len(list(Path(f'/proc/{pid}/fd').iterdir()))
    return Look(time.monotonic() - since, memory, handles, int(status['Threads']))


class Listener(Node):
    """Keeps what the two nodes say of themselves."""

    def __init__(self, context: Context) -> None:
        super().__init__('soak', context=context)
        self.said: dict[str, dict[str, str]] = {}
        self.latencies: list[tuple[float, float]] = []
        self.create_subscription(DiagnosticArray, '/diagnostics', self._on_diagnostics, 100)

    def _on_diagnostics(self, array: DiagnosticArray) -> None:
        for status in array.status:
            part = status.name.rpartition(': ')[2]
            self.said[part] = {value.key: value.value for value in status.values}
            latency = self.said[part].get('latency p50 [us]', 'none')
            if latency != 'none':
                self.latencies.append((float(latency), float(self.said[part]['latency p99 [us]'])))


def soak(minutes: float, folder: Path) -> dict[str, Any]:
    """Run both, look at them, count what was recorded.

    Raises:
        RuntimeError: No estimate came within half a minute.
    """
    domain, log, bag = free_domain(), folder / 'log', folder / 'bag'
    set_up_discovery()
    recording = {
        'record': True,
        'record_directory': str(folder),
        'record_name': bag.name,
        'record_split_duration': 60.0,
    }
    context = Context()
    rclpy.init(context=context, domain_id=domain)
    listener = Listener(context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(listener)
    looks: dict[str, list[Look]] = {'estimator': [], 'simulator': []}
    with (
        running('friction_estimator', domain, recording, log) as estimator,
        running('servo_simulator', domain, {}, log, parameter_file=SIMULATOR) as simulator,
        Progress(console=Console(stderr=True)) as progress,
    ):
        start = time.monotonic()
        while not listener.latencies:
            if time.monotonic() > start + 30.0:
                raise RuntimeError(f'no estimate: {log.read_text()}')
            executor.spin_once(timeout_sec=0.1)
        start, task = time.monotonic(), progress.add_task('soak', total=60.0 * minutes)
        while time.monotonic() < start + 60.0 * minutes:
            until = time.monotonic() + LOOK
            while time.monotonic() < until:
                executor.spin_once(timeout_sec=0.1)
            looks['estimator'].append(look(estimator.pid, start))
            looks['simulator'].append(look(simulator.pid, start))
            progress.update(task, completed=time.monotonic() - start)
    said = listener.said
    listener.destroy_node()
    rclpy.try_shutdown(context=context)
    return {**figures(looks, listener.latencies, said), **lost(bag, said['estimate'])}


def figures(
    looks: dict[str, list[Look]], latencies: list[tuple[float, float]], said: dict[str, dict[str, str]]
) -> dict[str, Any]:
    """Growth of each process, drift of the latency, counts."""
    found: dict[str, Any] = {}
    for name, seen in looks.items():
        settled = [one for one in seen if one.time >= min(SETTLED, seen[-1].time / 3.0)]
        fifth = max(len(settled) // 5, 1)
        found[f'{name} memory [MB]'] = round(settled[-1].memory, 1)
        ends = [max(one.memory for one in part) for part in (settled[:fifth], settled[-fifth:])]
        found[f'{name} memory growth [MB]'] = round(ends[1] - ends[0], 2)
        found[f'{name} handles more'] = settled[-1].handles - settled[0].handles
        found[f'{name} threads more'] = settled[-1].threads - settled[0].threads
    fifth = max(len(latencies) // 5, 1)
    for number, name in enumerate(('p50', 'p99')):
        first, last = (median(pair[number] for pair in part) for part in (latencies[:fifth], latencies[-fifth:]))
        found[f'latency {name} [us]'] = round(last, 1)
        found[f'latency {name} drift [us]'] = round(last - first, 1)
    found['missed ticks'] = int(said['simulator']['missed ticks'])
    found['ticks'] = int(said['simulator']['ticks'])
    found['dropped by the recorder'] = int(said['recorder'].get('dropped', 0))
    return found


def lost(bag: Path, said: dict[str, str]) -> dict[str, int]:
    """Velocity samples that are not in the recording, by their stamps, and what the estimator reported."""
    stamps = [
        decode(VELOCITY_TYPE, message.data).stamp for message in read_messages(bag) if message.topic == VELOCITY_TOPIC
    ]
    steps = [round((b - a) / PERIOD) - 1 for a, b in pairwise(stamps)]
    return {'received': len(stamps), 'lost': sum(steps), 'reported missing': int(said['rod_velocity missing'])}


def complaints(found: dict[str, Any]) -> list[str]:
    """What must not be."""
    wrong = [f'{key} = {value}' for key, value in found.items() if key.endswith(' more') and value > 0]
    wrong += [
        f'{key} = {value}' for key, value in found.items() if key.endswith('growth [MB]') and value > LARGEST_GROWTH
    ]
    if found['lost'] != found['reported missing']:
        wrong.append(f'{found["lost"]} samples lost, {found["reported missing"]} reported')
    return wrong


def main() -> int:
    """Run, print, judge."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n', maxsplit=1)[0])
    parser.add_argument('--minutes', type=float, default=30.0)
    parser.add_argument('--json', action='store_true')
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        found = soak(arguments.minutes, Path(folder))
    wrong = complaints(found)
    if arguments.json:
        print(json.dumps({**found, 'complaints': wrong}))
    else:
        table = Table('figure', 'value', title=f'{arguments.minutes:g} minutes at 1 kHz with recording')
        for key, value in found.items():
            table.add_row(Text(key), str(value))
        console = Console()
        console.print(table)
        console.print('\n'.join(wrong) or 'nothing leaks, what was lost was reported, no more and no less')
    return int(bool(wrong))


if __name__ == '__main__':
    sys.exit(main())
