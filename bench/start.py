"""How long things take to start: ``python bench/start.py [--times 7] [--json]``.

``seal_friction --help`` and the completion of a command beside the bare interpreter, and the estimator from the start
of its process to its first estimate, while inputs come at 1 kHz. Medians; the caches of the operating system are warm
after the first round.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from statistics import median
from types import MappingProxyType

from live import ALONE, Asker
from rich.console import Console
from rich.table import Table

sys.path.insert(0, str(Path(__file__).parents[1] / 'test'))
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


def first_estimate(compiled: bool = False) -> float:
    """Time [s] from the start of the node's process to its first estimate.

    Raises:
        RuntimeError: None comes.
    """
    domain = free_domain()
    with Asker(ALONE, domain, None) as asker, tempfile.TemporaryDirectory() as folder:
        start = time.perf_counter()
        with node_process('friction_estimator', domain, {'compiled': compiled}, Path(folder) / 'log'):
            while not asker.round_trips:
                if time.perf_counter() > start + PATIENCE:
                    raise RuntimeError('no estimate comes')
                asker.ask()
                time.sleep(0.001)
            return time.perf_counter() - start


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
        'estimator, to the first estimate': first_estimate,
        'compiled estimator, to the first estimate': lambda: first_estimate(compiled=True),
    }
    times: dict[str, list[float]] = {name: [] for name in measured}
    for number in range(arguments.times + 1):
        for name, measure in measured.items():
            duration = measure()
            if number:  # the first round warms the caches
                times[name].append(duration)
    found = {name: round(median(durations), 3) for name, durations in times.items()}
    if arguments.json:
        print(json.dumps({f'{name} [s]': duration for name, duration in found.items()}))
        return 0
    table = Table('what', 'median', title='Start')
    for name, duration in found.items():
        table.add_row(name, f'{duration:.3f} s')
    Console().print(table)
    return 0


if __name__ == '__main__':
    sys.exit(main())
