"""Simulator and estimator at 1 kHz with recording, for long: ``python test/system/soak.py [--minutes 30] [--json]``.

Both run in processes of their own. Memory, file handles and threads of both are read every ``--look`` seconds; latency
and counts come from their diagnostics; lost samples are counted in the recording by their stamps. Exit code 1 if memory
grows by more than 1 MB after the first minute (or the first third of a shorter run), if a file handle or a thread is
left over, or if the number of lost samples is not the reported one.
"""

import sys
import tempfile
import time
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from statistics import median
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.context import Context
from rclpy.node import Node
from rich.console import Console
from rich.progress import Progress

sys.path.insert(0, str(Path(__file__).parents[1]))
from harness.campaign import parser_of, tell
from harness.compensation import LIVE
from harness.processes import free_domain, node_process
from harness.spin_nodes import SpunNodes, ros_context

from seal_friction_ros.core.messages.coder import decode
from seal_friction_ros.core.messages.layouts import VELOCITY_TYPE
from seal_friction_ros.offline.bags.bag import VELOCITY_TOPIC, read_messages

PERIOD = 1_000_000  # [ns] of the simulator
SETTLED = 60.0  # [s] after which memory must not grow
LARGEST_GROWTH = 1.0  # [MB]
SIMULATOR = Path(__file__).parents[2] / 'config' / 'servo_simulator.yaml'


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
    """Keeps the diagnostics of both nodes."""

    def __init__(self, context: Context) -> None:
        super().__init__('soak', context=context)
        self.diagnostics: dict[str, dict[str, str]] = {}
        self.latencies: list[tuple[float, float]] = []
        self.reports = 0
        """number of diagnostics of the estimator"""
        self.create_subscription(DiagnosticArray, '/diagnostics', self._on_diagnostics, 100)

    def _on_diagnostics(self, array: DiagnosticArray) -> None:
        for status in array.status:
            part = status.name.rpartition(': ')[2]
            self.reports += part == 'estimate'
            self.diagnostics[part] = {value.key: value.value for value in status.values}
            latency = self.diagnostics[part].get('latency p50 [us]', 'none')
            if latency != 'none':
                self.latencies.append((float(latency), float(self.diagnostics[part]['latency p99 [us]'])))


def soak(minutes: float, look_every: float, folder: Path) -> dict[str, Any]:
    """Run both nodes, look at them every ``look_every`` [s], count what was recorded.

    Raises:
        RuntimeError: No estimate comes.
    """
    domain, log, bag = free_domain(), folder / 'log', folder / 'bag'
    recording = {
        **LIVE,
        'record': True,
        'record_directory': str(folder),
        'record_name': bag.name,
        'record_split_duration': 60.0,
    }
    looks: dict[str, list[Look]] = {'estimator': [], 'simulator': []}
    with (
        node_process('friction_estimator', domain, recording, log) as estimator,
        ros_context(domain) as context,
    ):
        listener = Listener(context)
        spun = SpunNodes(context, listener)
        with (
            node_process('servo_simulator', domain, {}, log, parameter_file=SIMULATOR) as simulator,
            Progress(console=Console(stderr=True)) as progress,
        ):
            if not spun.spin_until(lambda: listener.latencies and 'simulator' in listener.diagnostics):
                raise RuntimeError(f'no estimate: {log.read_text()}')
            start, task = time.monotonic(), progress.add_task('soak', total=60.0 * minutes)
            while time.monotonic() < start + 60.0 * minutes:
                spun.spin(look_every)
                looks['estimator'].append(look(estimator.pid, start))
                looks['simulator'].append(look(simulator.pid, start))
                progress.update(task, completed=time.monotonic() - start)
        reports = listener.reports
        spun.spin_until(lambda: listener.reports > reports + 1)  # the second one covers all samples
        listener.destroy_node()
    found = figures(looks, listener.latencies, listener.diagnostics)
    return {**found, **lost(bag, listener.diagnostics['estimate'])}


def figures(
    looks: dict[str, list[Look]], latencies: list[tuple[float, float]], diagnostics: dict[str, dict[str, str]]
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
    found['missed ticks'] = int(diagnostics['simulator']['missed ticks'])
    found['ticks'] = int(diagnostics['simulator']['ticks'])
    found['dropped by the recorder'] = int(diagnostics['recorder'].get('dropped', 0))
    return found


def lost(bag: Path, diagnostics: dict[str, str]) -> dict[str, int]:
    """Velocity samples missing in the recording, by their stamps, and the number that the estimator reports."""
    stamps = [
        decode(VELOCITY_TYPE, message.data).stamp for message in read_messages(bag) if message.topic == VELOCITY_TOPIC
    ]
    steps = [round((b - a) / PERIOD) - 1 for a, b in pairwise(stamps)]
    return {'received': len(stamps), 'lost': sum(steps), 'reported missing': int(diagnostics['rod_velocity missing'])}


def violations(found: dict[str, Any]) -> list[str]:
    """Limits that are exceeded."""
    wrong = [f'{key} = {value}' for key, value in found.items() if key.endswith(' more') and value > 0]
    wrong += [
        f'{key} = {value}' for key, value in found.items() if key.endswith('growth [MB]') and value > LARGEST_GROWTH
    ]
    if found['lost'] != found['reported missing']:
        wrong.append(f'{found["lost"]} samples lost, {found["reported missing"]} reported')
    return wrong


def main() -> int:
    """Run; print the figures and the limits exceeded."""
    parser = parser_of(__doc__, minutes=(30.0, 'of the run'), look=(2.0, 'time between two looks [s]'))
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        found = soak(arguments.minutes, arguments.look, Path(folder))
    wrong = violations(found)
    tell(
        {**found, 'violations': wrong},
        as_json=arguments.json,
        title=f'{arguments.minutes:g} minutes, at 1 kHz with recording',
    )
    return int(bool(wrong))


if __name__ == '__main__':
    sys.exit(main())
