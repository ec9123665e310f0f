"""What a fleet costs: ``python bench/scale.py [--seconds 600] [--bags 20 200] [--bag-seconds 2] [--json]``.

One cylinder (pressure, force sum and velocity at 1 kHz) is recorded for some time, without and with the answers of the
estimator. Each step over the bag runs in a process of its own; figures are scaled to an hour of recording. Times are
those of the processor, so that others on the machine count less; what is loaded and compiled first is left out and has
a column of its own. Then ``fleet`` runs over numbers of small bags, by one and by two processes of this machine, and by
a Dask cluster of one and of two workers on the loopback interface (if distributed is installed), all of which have
compiled before: wall time, and the memory of the command.
"""

import argparse
import hashlib
import json
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from offline import RATE, RIG, write_log

sys.path.insert(0, str(Path(__file__).parents[1] / 'test'))
from harness.campaign import show
from harness.dask_cluster import dask_cluster

HOUR = 3600.0  # [s]
YEAR = 365.0 * 24.0  # [h]
MACHINES = 1000
WORKERS = 2
COMMAND = [sys.executable, '-m', 'seal_friction_ros.offline.commands.main']


def files_of(bag: Path) -> list[Path]:
    """Files of a bag."""
    return sorted(bag.glob('*.mcap'))


def make_bag(folder: Path, seconds: float) -> Path:
    """A bag without answers, and beside it one with them."""
    from seal_friction_ros.offline.bags.import_log import convert_log
    from seal_friction_ros.offline.bags.rig_file import read_rig
    from seal_friction_ros.offline.replay.replay import replay

    folder.mkdir(parents=True)
    write_log(folder / 'log.csv', round(seconds * RATE))
    (folder / 'rig.yaml').write_text(RIG)
    convert_log(folder / 'log.csv', folder / 'inputs', read_rig(folder / 'rig.yaml'))
    replay(folder / 'inputs', out=folder / 'recorded')
    (folder / 'log.csv').unlink()
    return folder / 'recorded'


# -- steps over one bag: each makes ready and gives the step --------------------------------------------------------


def _read(_: Path) -> Callable[[Path], object]:
    def read(bag: Path) -> None:
        """Read every byte."""
        for file in files_of(bag):
            with file.open('rb', buffering=0) as content:
                while content.read(1 << 20):
                    pass

    return read


def _digest(_: Path) -> Callable[[Path], object]:
    def digest(bag: Path) -> None:
        for file in files_of(bag):
            with file.open('rb') as content:
                hashlib.file_digest(content, 'sha256')

    return digest


def _decode(_: Path) -> Callable[[Path], object]:
    from seal_friction_ros.offline.bags.actuator_bag import find_topics
    from seal_friction_ros.offline.bags.block_reader import compile_now, read_in_bulk
    from seal_friction_ros.offline.replay.compiled_replay import kinds_of_topics

    def decode(bag: Path) -> None:
        for _ in read_in_bulk(bag, kinds_of_topics(find_topics(bag))):
            pass

    compile_now()
    return decode


def _verify(bag: Path) -> Callable[[Path], object]:
    from seal_friction_ros.offline.replay.compiled_replay import compile_first
    from seal_friction_ros.offline.replay.parallel_replay import verify

    compile_first([bag])
    return lambda bag: verify(bag, bulk_from=0)


def _fleet(bag: Path) -> Callable[[Path], object]:
    from seal_friction_ros.offline.replay.bag_summary import bag_summary
    from seal_friction_ros.offline.replay.compiled_replay import compile_first

    compile_first([bag])
    return bag_summary


STEPS: dict[str, tuple[str, Callable[[Path], Callable[[Path], object]]]] = {
    'read': ('recorded', _read),
    'digest, with --work': ('recorded', _digest),
    'read and decode': ('recorded', _decode),
    'replay': ('inputs', _verify),
    'replay --verify': ('recorded', _verify),
    'fleet: verify and health': ('recorded', _fleet),
}
"""Name -> which bag, and what makes ready and gives the step."""


def run_step(name: str, folder: Path) -> dict[str, float]:
    """Do a step in this process: processor time [s] to make ready and to do it, most memory [MB]."""
    bag, make = STEPS[name]
    step = make(folder / bag)
    ready = time.process_time()
    step(folder / bag)
    done = time.process_time()
    return {'ready': ready, 'time': done - ready, 'memory': resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3}


def of_an_hour(folder: Path, seconds: float) -> dict[str, Any]:
    """Bytes and processor time of an hour of one cylinder."""
    scale = HOUR / seconds
    kinds = ('inputs', 'recorded')
    sizes = {kind: scale * sum(file.stat().st_size for file in files_of(folder / kind)) for kind in kinds}
    steps = {}
    for name in STEPS:
        words = [sys.executable, __file__, '--step', name, str(folder)]
        found = json.loads(subprocess.run(words, stdout=subprocess.PIPE, text=True, check=True).stdout)
        steps[name] = {'time [s/h]': scale * found['time'], 'ready [s]': found['ready'], 'memory [MB]': found['memory']}
    return {'bytes [MB/h]': {name: size / 1e6 for name, size in sizes.items()}, 'steps': steps}


def of_bags(source: Path, folder: Path, counts: list[int]) -> dict[str, dict[str, dict[str, float]]]:
    """Wall time [s] and memory of the command [MB] of ``fleet`` over so many links to a small bag.

    One worker alone takes the first number of bags only.
    """
    for count in {WORKERS, *counts}:
        for number in range(count):
            target = folder / f'{count}' / f'rig{number % 10}' / f'bag{number}'
            target.mkdir(parents=True)
            for file in source.iterdir():
                (target / file.name).hardlink_to(file)

    def timed(workers: int, options: list[str]) -> dict[str, dict[str, float]]:
        return {f'{n}': timed_fleet(folder / f'{n}', options) for n in (counts if workers == WORKERS else counts[:1])}

    found = {}
    for workers, name in ((1, '1 {}'), (WORKERS, f'{WORKERS} {{}}s')):
        timed_fleet(folder / f'{WORKERS}', ['--workers', f'{workers}'])  # compiles, if nothing is kept
        found[name.format('forked worker')] = timed(workers, ['--workers', f'{workers}'])
        if find_spec('distributed'):
            with dask_cluster(folder / f'cluster {workers}', workers) as cluster:
                timed_fleet(folder / f'{WORKERS}', ['--scheduler', cluster.address])  # each worker compiles, once
                found[name.format('Dask worker')] = timed(workers, ['--scheduler', cluster.address])
    return found


def timed_fleet(bags: Path, options: list[str]) -> dict[str, float]:
    """Wall time [s] of the command and most memory [MB] of its own process."""
    words = [*COMMAND, 'fleet', str(bags), '--out', f'{bags}.html', *options]
    begin = time.monotonic()
    process = subprocess.Popen(words, stdout=subprocess.DEVNULL)
    peak = 0.0
    while process.poll() is None:
        for line in _status(process.pid):
            peak = max(peak, float(line.split()[1]) / 1e3) if line.startswith('VmHWM') else peak
        time.sleep(0.05)
    if process.returncode:
        raise SystemExit(f'fleet ended with exit code {process.returncode}')
    return {'time [s]': time.monotonic() - begin, 'memory [MB]': peak}


def _status(process: int) -> list[str]:
    try:
        return Path(f'/proc/{process}/status').read_text().splitlines()
    except OSError:
        return []


def measure(seconds: float, counts: list[int], bag_seconds: float, folder: Path) -> dict[str, Any]:
    """All figures."""
    make_bag(folder / 'long', seconds)
    small = make_bag(folder / 'small', bag_seconds)
    hour = of_an_hour(folder / 'long', seconds)
    size = hour['bytes [MB/h]']['recorded'] * YEAR * MACHINES / 1e6
    work = hour['steps']['fleet: verify and health']['time [s/h]'] * YEAR * MACHINES / HOUR
    year = {'recorded [TB]': size, 'fleet [core h]': work, 'cores to keep up': work / YEAR}
    return {'an hour': hour, f'a year of {MACHINES} cylinders': year, 'bags': of_bags(small, folder / 'bags', counts)}


def print_figures(figures: dict[str, Any]) -> None:
    """Print the tables."""
    hour = figures['an hour']
    show(hour['steps'], 'An hour of one cylinder at 1 kHz, processor time')
    print(', '.join(f'{name}: {size:.0f} MB/h' for name, size in hour['bytes [MB/h]'].items()))
    year = f'a year of {MACHINES} cylinders'
    print(f'{year}: ' + ', '.join(f'{name} {value:.3g}' for name, value in figures[year].items()))
    for kind, rows in figures['bags'].items():
        for count, row in rows.items():
            print(f'fleet over {count} bags by {kind}: {row["time [s]"]:.1f} s, {row["memory [MB]"]:.0f} MB')


def main() -> int:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n', maxsplit=1)[0])
    parser.add_argument('--seconds', type=float, default=600.0, help='of the long bag, default 600')
    parser.add_argument('--bags', type=int, nargs='+', default=[20, 200], metavar='N', help='numbers of small bags')
    parser.add_argument('--bag-seconds', type=float, default=2.0, help='of a small bag, default 2')
    parser.add_argument('--json', action='store_true')
    parser.add_argument('--step', nargs=2, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.step:
        print(json.dumps(run_step(arguments.step[0], Path(arguments.step[1]))))
        return 0
    with tempfile.TemporaryDirectory() as name:
        figures = measure(arguments.seconds, arguments.bags, arguments.bag_seconds, Path(name))
    if arguments.json:
        print(json.dumps(figures))
    else:
        print_figures(figures)
    return 0


if __name__ == '__main__':
    sys.exit(main())
