"""How long things take to start: ``python bench/start.py [--times 7] [--json]``.

``seal_friction --help`` and the completion of a command beside the bare interpreter, and the estimator from the start
of its process to its first estimate, while inputs come at 1 kHz. Medians; the caches of the
operating system are warm after the first round. Once each: the compiled estimator where no compiled code is kept, and
the memory of both.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from statistics import median
from types import MappingProxyType
from typing import NamedTuple

from live import ALONE, Asker

sys.path.insert(0, str(Path(__file__).parents[1] / 'test'))
from harness.campaign import tell
from harness.compensation import LIVE
from harness.processes import free_domain, node_process

from seal_friction_ros.nodes.discovery import set_up_discovery

PATIENCE = 60.0  # [s]
COMMAND = [sys.executable, '-m', 'seal_friction_ros.offline.commands.main']
TYPED = 'seal_friction rep'
ASKED = {
    '_ARGCOMPLETE': '1',
    '_ARGCOMPLETE_STDOUT_FILENAME': os.devnull,
    'COMP_LINE': TYPED,
    'COMP_POINT': str(len(TYPED)),
}
BARE = [sys.executable, '-c', 'pass']


def run(command: list[str], environment: Mapping[str, str] = MappingProxyType({})) -> float:
    """Time [s] that a command takes."""
    start = time.perf_counter()
    subprocess.run(command, check=True, capture_output=True, env={**os.environ, **environment})
    return time.perf_counter() - start


class Start(NamedTuple):
    """From the start of the process of a node to its first estimate."""

    seconds: float
    memory: float  # [MB] resident then


def first_estimate() -> Start:
    """Start the estimator while inputs come.

    Raises:
        RuntimeError: None comes.
    """
    domain = free_domain()
    with Asker(ALONE, domain, None) as asker, tempfile.TemporaryDirectory() as folder:
        start = time.perf_counter()
        with node_process('friction_estimator', domain, LIVE, Path(folder) / 'log') as process:
            while not asker.round_trips:
                if time.perf_counter() > start + PATIENCE:
                    raise RuntimeError('no estimate comes')
                asker.ask()
                time.sleep(0.001)
            seconds = time.perf_counter() - start
            status = Path(f'/proc/{process.pid}/status').read_text()
    return Start(seconds, int(status.partition('VmRSS:')[2].split()[0]) / 1024.0)


def main() -> int:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n', maxsplit=1)[0])
    parser.add_argument('--times', type=int, default=7)
    parser.add_argument('--json', action='store_true')
    arguments = parser.parse_args()
    set_up_discovery()
    measured: dict[str, Callable[[], float]] = {
        'bare interpreter': lambda: run(BARE),
        'seal_friction --help': lambda: run([*COMMAND, '--help']),
        'completion of a command': lambda: run(COMMAND, ASKED),
        'estimator, to the first estimate': lambda: first_estimate().seconds,
    }
    times: dict[str, list[float]] = {name: [] for name in measured}
    for number in range(arguments.times + 1):
        for name, measure in measured.items():
            duration = measure()
            if number:  # the first round warms the caches
                times[name].append(duration)
    found = {f'{name} [s]': round(median(durations), 3) for name, durations in times.items()}
    found['estimator, memory [MB]'] = round(first_estimate().memory)
    tell(found, as_json=arguments.json, title='Start, medians of times')
    return 0


if __name__ == '__main__':
    sys.exit(main())
