"""A Dask scheduler and workers as processes on the loopback interface, and calls that the workers can import."""

import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from paths import ROOT

PATIENCE = 60.0  # [s] for a process of Dask to start, beside busy ones
ONE_THREAD = dict.fromkeys(('OPENBLAS_NUM_THREADS', 'MKL_NUM_THREADS', 'OMP_NUM_THREADS'), '1')
IDLE = {  # a worker that waits looks at itself a hundred times a second, half of the time that it takes
    'DASK_DISTRIBUTED__WORKER__PROFILE__ENABLED': 'False',
    'DASK_DISTRIBUTED__ADMIN__SYSTEM_MONITOR__INTERVAL': '10s',
}
ENVIRONMENT = {**os.environ, **ONE_THREAD, **IDLE, 'PYTHONPATH': str(ROOT / 'test')}
"""of everything here"""


class DaskCluster(NamedTuple):
    """Processes of a cluster."""

    address: str
    scheduler: subprocess.Popen[bytes]
    workers: list[subprocess.Popen[bytes]]


@contextmanager
def dask_cluster(
    folder: Path, workers: int = 2, environment: Mapping[str, str] = ENVIRONMENT, options: Sequence[str] = (),
    threads: int = 1,
) -> Iterator[DaskCluster]:  # fmt: skip
    """Start a scheduler and workers, and end them after the block."""
    folder.mkdir(exist_ok=True)
    file = folder / 'scheduler.json'
    common = ['--host', '127.0.0.1', '--dashboard-address', '127.0.0.1:0', *options]
    started: list[subprocess.Popen[bytes]] = []

    def start(*arguments: str) -> None:
        command = [sys.executable, '-m', *arguments, *common]
        with (folder / f'{len(started)}.log').open('wb') as log:
            started.append(subprocess.Popen(command, cwd=folder, env=dict(environment), stdout=log, stderr=log))

    try:
        start('distributed.cli.dask_scheduler', '--port', '0', '--scheduler-file', str(file))
        address = str(wait_for(lambda: read(file))['address'])
        for number in range(workers):
            name = ['--name', str(number), '--local-directory', str(folder), '--no-nanny', '--nthreads', str(threads)]
            start('distributed.cli.dask_worker', address, *name)
        yield DaskCluster(address, started[0], started[1:])
    finally:
        for process in started:
            process.kill()
            process.wait()


def read(file: Path) -> Any:
    """Content of a JSON file; None as long as it is not whole."""
    try:
        return json.loads(file.read_text())
    except (OSError, ValueError):
        return None


def wait_for(look: Any) -> Any:
    """What ``look`` returns, as soon as it is true."""
    deadline = time.monotonic() + PATIENCE
    while not (found := look()):
        assert time.monotonic() < deadline
        time.sleep(0.02)
    return found


# -- calls ------------------------------------------------------------------------------------------------------------


def square(number: int) -> dict[str, int]:
    """A result at once."""
    return {'square': number**2}


def square_once_open(folder: Path, number: int) -> dict[str, int]:
    """Note that the call begins, and in which process; wait until there is the file ``open NUMBER``."""
    with (folder / 'begun').open('a') as file:
        file.write(f'{number} {os.getpid()}\n')
    wait_for((folder / f'open {number}').exists)
    return {'square': number**2}


def begun(folder: Path) -> list[tuple[int, int]]:
    """Number and process of every call that began, in order."""
    file = folder / 'begun'
    lines = file.read_text().splitlines() if file.exists() else []
    return [(int(number), int(process)) for number, process in map(str.split, lines)]


def fail(text: str) -> None:
    """An expected error."""
    raise ValueError(text)


def bug() -> None:
    """An error that nobody expects."""
    raise KeyError('a bug')


def die() -> None:
    """End the worker."""
    os.kill(os.getpid(), 9)


def size(path: Path) -> int:
    """Size of a file [bytes]."""
    return path.stat().st_size
