"""What files cost against size: ``python bench/offline.py [--largest N] [--tasks NAME...] [--json]``.

A synthetic log of a cylinder (pressure, force sum and velocity at 1 kHz) is imported, replayed, identified from and
reported on, in sizes a factor of ten apart, each in a process of its own. Beside them the same bag is merely decoded,
with ``rosbags`` and with ``mcap-ros2-support`` where they are installed. Times are those of the processor, so that
others on the machine count less; what is loaded and compiled first has a row of its own. The exponent is the slope of
log time over log size, here from the two largest sizes. Memory is the most that the one process of a task ever held:
`replay --workers N` has N such processes. The last row replays several bags by one process and by two, in time on the
wall: the machine has to be idle for that one. A million samples take some four minutes, ten million ten times as long.
"""

import argparse
import json
import math
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / 'test'))
from harness.campaign import show

SMALLEST = 10_000  # [samples]
RATE = 1000  # [Hz]
RIG = """
name: bench
source: synthetic
frame_id: rod
header: none
skip_rows: 0
start: 1.0
time: {column: 0, unit: s}
chamber_a: {terms: [{column: 1, unit: Pa}]}
chamber_b: {terms: [{column: 2, unit: Pa}]}
force_sum: {terms: [{column: 3, unit: N}]}
velocity: {terms: [{column: 4, unit: m/s}]}
"""


def write_log(path: Path, samples: int) -> None:
    """A rod that is driven to and fro at five pressures, 2 s each, with noise on all."""
    random = np.random.default_rng(1)
    with path.open('w') as file:
        for first in range(0, samples, 100_000):
            at = np.arange(first, min(first + 100_000, samples)) / RATE
            pressure = 1e6 * (1.0 + at // 2.0 % 5.0)
            velocity = 0.05 * np.clip(3.0 * np.sin(2.0 * np.pi * at), -1.0, 1.0)
            force = np.sign(velocity) * (10.0 + 2.0 * (pressure / 1e5) ** (2.0 / 3.0))
            noise = random.normal(size=(4, len(at))) * [[1e3], [1e3], [0.5], [1e-5]]
            columns = [at, *(np.array([pressure, pressure, force, velocity]) + noise)]
            np.savetxt(file, np.column_stack(columns), fmt='%.9g', delimiter=',')


# -- tasks, each a function of the log, of the bag and of a folder for what it makes ----------------------------------


def _import() -> Callable[[Path], object]:
    from seal_friction_ros.offline.bags.import_log import convert_log
    from seal_friction_ros.offline.bags.rig_file import read_rig

    return lambda folder: convert_log(folder / 'log.csv', folder / 'bag', read_rig(folder / 'rig.yaml'))


def _replay() -> Callable[[Path], object]:
    from seal_friction_ros.offline.replay.compiled_replay import compile_now
    from seal_friction_ros.offline.replay.parallel_replay import verify

    compile_now()
    return lambda folder: verify(folder / 'bag', bulk_from=0)


def _replay_one_by_one() -> Callable[[Path], object]:
    from seal_friction_ros.offline.replay.parallel_replay import verify

    return lambda folder: verify(folder / 'bag', bulk_from=sys.maxsize)


def _replay_to_a_bag() -> Callable[[Path], object]:
    from seal_friction_ros.offline.replay.replay import replay

    return lambda folder: replay(folder / 'bag', out=folder / 'replayed')


def _verify() -> Callable[[Path], object]:
    from seal_friction_ros.offline.replay.compiled_replay import compile_now
    from seal_friction_ros.offline.replay.parallel_replay import verify

    def check(folder: Path) -> None:
        if not verify(folder / 'replayed', bulk_from=0).identical:
            raise SystemExit('replay --verify found a difference')

    compile_now()
    return check


def _health() -> Callable[[Path], object]:
    from seal_friction_ros.offline.replay.bag_health import bag_health
    from seal_friction_ros.offline.replay.compiled_replay import compile_now

    compile_now()
    return lambda folder: bag_health(folder / 'bag')


def _identify() -> Callable[[Path], object]:
    from seal_friction_ros.offline.identification.pipeline import IdentifyOptions, identify
    from seal_friction_ros.offline.identification.sources import SourceOptions

    return lambda folder: identify(
        [folder / 'bag'], IdentifyOptions(sources=SourceOptions(chambers=('a', 'b'))), 'bench'
    )


def _report() -> Callable[[Path], object]:
    from seal_friction_ros.offline.reports.bag_report import write_report

    return lambda folder: write_report(folder / 'replayed', folder / 'report.html', '')


def _rosbags() -> Callable[[Path], object]:
    from rosbags.highlevel import AnyReader

    def decode(folder: Path) -> None:
        with AnyReader([folder / 'bag']) as reader:
            for connection, _, data in reader.messages():
                reader.deserialize(data, connection.msgtype)

    return decode


def _mcap_ros2() -> Callable[[Path], object]:
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    def decode(folder: Path) -> None:
        """Decode every message, keep none."""
        for path in (folder / 'bag').glob('*.mcap'):
            with path.open('rb') as file:
                for _ in make_reader(file, decoder_factories=[DecoderFactory()]).iter_decoded_messages():
                    pass

    return decode


TASKS: dict[str, Callable[[], Callable[[Path], object]]] = {
    'import': _import,
    'replay': _replay,
    'replay, message by message': _replay_one_by_one,
    'replay to a new bag': _replay_to_a_bag,
    'replay --verify of it': _verify,
    'health': _health,
    'identify': _identify,
    'report': _report,
    'decoded by rosbags': _rosbags,
    'decoded by mcap-ros2-support': _mcap_ros2,
}
"""Name -> what makes ready and gives the task."""
OTHER_READERS = {'decoded by rosbags': 'rosbags', 'decoded by mcap-ros2-support': 'mcap_ros2'}
"""Task -> module that it needs."""


def run_task(name: str, folder: Path) -> dict[str, float]:
    """Do a task in this process; processor time [s] to make ready and to do it, and the memory of the process [MB]."""
    task = TASKS[name]()
    ready = time.process_time()
    task(folder)
    done = time.process_time()
    return {'ready': ready, 'time': done - ready, 'memory': resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3}


def timed(name: str, folder: Path) -> dict[str, float]:
    """Do a task in a process of its own."""
    words = [sys.executable, __file__, '--task', name, str(folder)]
    found = subprocess.run(words, stdout=subprocess.PIPE, text=True, check=True)
    figures: dict[str, float] = json.loads(found.stdout.splitlines()[-1])
    return figures


def measure_workers(bag: Path, copies: int) -> dict[str, float]:
    """Wall time [s] of a bag that is given so many times, by one process and by two, with kept compiled code."""
    figures: dict[str, float] = {'bags': copies}
    for workers in (1, 1, 2):  # the first run compiles
        words = ['replay', *[str(bag)] * copies, '--workers', str(workers), '--json']
        start = time.monotonic()
        command = [sys.executable, '-m', 'seal_friction_ros.offline.commands.main', *words]
        subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, check=True)
        figures[f'{workers}'] = time.monotonic() - start
    return figures | {'ratio': figures['1'] / figures['2']}


def exponent(times: dict[int, float]) -> float:
    """Slope of log time over log size between the two largest sizes; NaN if there are not two."""
    if len(times) < 2:
        return math.nan
    (small, before), (large, after) = sorted(times.items())[-2:]
    return math.log(after / before) / math.log(large / small)


def measure(largest: int, names: list[str], folder: Path, copies: int) -> dict[str, Any]:
    """All figures, by task and size; those of the workers if import and replay are asked for."""
    sizes = [SMALLEST * 10**k for k in range(1 + int(math.log10(max(largest, SMALLEST) / SMALLEST) + 1e-9))]
    tasks: dict[str, dict[int, dict[str, float]]] = {name: {} for name in names}
    workers: dict[str, float] = {}
    for samples in sizes:
        with tempfile.TemporaryDirectory(dir=folder) as name:
            place = Path(name)
            write_log(place / 'log.csv', samples)
            (place / 'rig.yaml').write_text(RIG)
            for task in names:
                if find_spec(OTHER_READERS.get(task, 'sys')):
                    tasks[task][samples] = timed(task, place)
            if samples == min(sizes[-1], 1_000_000) and {'import', 'replay'} <= set(names):
                workers = measure_workers(place / 'bag', copies)
    found = {
        task: {
            'time [s]': {samples: figures['time'] for samples, figures in rows.items()},
            'ready [s]': max((figures['ready'] for figures in rows.values()), default=math.nan),
            'memory [MB]': max((figures['memory'] for figures in rows.values()), default=math.nan),
            'exponent': exponent({samples: figures['time'] for samples, figures in rows.items()}),
        }
        for task, rows in tasks.items()
    }
    return {'sizes': sizes, 'tasks': found, 'workers [s]': workers}


def print_figures(figures: dict[str, Any]) -> None:
    """Print the table."""
    rows = {}
    for task, row in figures['tasks'].items():
        rows[task] = {f'{samples:.0e}': _text(row['time [s]'].get(samples)) for samples in figures['sizes']}
        rows[task] |= {'exponent': f'{row["exponent"]:.2f}', 'ready [s]': f'{row["ready [s]"]:.2f}'}
        rows[task]['memory [MB]'] = f'{row["memory [MB]"]:.0f}'
    show(rows, 'Processor time [s] against samples; a sample is three messages; memory: most of a process')
    if not all(map(find_spec, OTHER_READERS.values())):
        print('rosbags or mcap-ros2-support is not installed, so its row is empty: make test installs both')
    if figures['workers [s]']:
        copies, one, two, ratio = figures['workers [s]'].values()
        print(
            f'The largest bag {copies} times: {one:.1f} s by one process, '
            f'{two:.1f} s by two on the wall, so {ratio:.2f} times as fast'
        )


def _text(time: float | None) -> str:
    return '-' if time is None else f'{time:.3g}'


def main() -> int:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n', maxsplit=1)[0])
    parser.add_argument('--largest', type=int, default=100_000, metavar='N', help='samples, default 100000')
    parser.add_argument('--tasks', nargs='+', choices=TASKS, default=list(TASKS), help='default: all of them')
    parser.add_argument('--folder', type=Path, help='for bags; default: that of temporary files')
    parser.add_argument('--copies', type=int, default=8, metavar='N', help='of the largest bag, by one process and two')
    parser.add_argument('--json', action='store_true')
    parser.add_argument('--task', nargs=2, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.task:
        print(json.dumps(run_task(arguments.task[0], Path(arguments.task[1]))))
        return 0
    figures = measure(
        arguments.largest, arguments.tasks, arguments.folder or Path(tempfile.gettempdir()), arguments.copies
    )
    if arguments.json:
        print(json.dumps(figures))
    else:
        print_figures(figures)
    return 0


if __name__ == '__main__':
    sys.exit(main())
