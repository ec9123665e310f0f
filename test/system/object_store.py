"""Bags in an object store: ``python test/system/object_store.py [--bags 4]``.

moto, a store that speaks S3, runs as a server on the loopback interface; recordings are put into it. The commands read
them by ``s3://`` URL, here and on a Dask cluster of two workers, and have to say what they say of the folders. Finished
parts have to follow the store: no object is read twice, and a recording that changed is computed anew alone. What the
store was asked for is counted in its log. Before that: ``pip install s3fs 'moto[server]'``.

Exit code 1 if a claim does not hold.
"""

import re
import shutil
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

sys.path.insert(0, str(Path(__file__).parents[1]))
from harness.campaign import parser_of, tell
from harness.compensation import compensating
from harness.dask_cluster import ENVIRONMENT, dask_cluster, wait_for
from harness.example_bags import write_recorded
from paths import ROOT

from seal_friction_ros.core.estimation.estimator import EstimatorSettings

BUCKET = 's3://rig-7'
COMMAND = [sys.executable, '-m', 'seal_friction_ros.offline.commands.main']
NO_STORE = 'http://127.0.0.1:9'  # nothing listens on the port of the discard service


class ObjectStore(NamedTuple):
    """A running store."""

    environment: dict[str, str]  # of a process that reads it
    log: Path  # a line for each request

    def reads(self) -> int:
        """Number of bag files that were read so far."""
        return len(re.findall(r'"GET /\S+\.mcap[ ?]', self.log.read_text()))


@contextmanager
def object_store(folder: Path) -> Iterator[ObjectStore]:
    """Start a store, and end it after the block."""
    with socket.socket() as free:
        free.bind(('127.0.0.1', 0))
        port = free.getsockname()[1]
    log = folder / 'store.log'
    with log.open('wb') as output:
        words = [sys.executable, '-m', 'moto.server', '--host', '127.0.0.1', '--port', str(port)]
        process = subprocess.Popen(words, stdout=output, stderr=output)
    try:
        wait_for(lambda: f':{port}' in log.read_text() or process.poll() is not None)
        if process.poll() is not None:
            raise SystemExit(f"the store does not start: pip install s3fs 'moto[server]'\n{log.read_text()}")
        yield ObjectStore(reading(f'http://127.0.0.1:{port}', folder), log)
    finally:
        process.kill()
        process.wait()


def reading(endpoint: str, folder: Path) -> dict[str, str]:
    """Environment of a process that reads the store at ``endpoint`` and copies bags into ``folder / 'copies'``."""
    copies = folder / 'copies'
    copies.mkdir(exist_ok=True)
    key = {'AWS_ACCESS_KEY_ID': 'key', 'AWS_SECRET_ACCESS_KEY': 'secret', 'AWS_DEFAULT_REGION': 'us-east-1'}
    return {**ENVIRONMENT, **key, 'AWS_ENDPOINT_URL': endpoint, 'TMPDIR': str(copies)}


def put(store: ObjectStore, bag: Path, name: str) -> None:
    """Put a bag into the store."""
    program = (
        'import sys, fsspec\n'
        "files = fsspec.filesystem('s3')\n"
        'files.makedirs(sys.argv[2].rpartition("/")[0], exist_ok=True)\n'
        'files.put(sys.argv[1] + "/", sys.argv[2] + "/", recursive=True)\n'
    )
    subprocess.run([sys.executable, '-c', program, str(bag), f'{BUCKET}/{name}'], env=store.environment, check=True)


def recording(folder: Path, number: int) -> Path:
    """A recorded bag; each number has a configuration of its own."""
    made = write_recorded(
        folder / f'made{number}', compensating(EstimatorSettings(pressure_timeout=0.02 + 0.001 * number))
    )
    return made.rename(folder / f'bag{number}')


class Said(NamedTuple):
    """What a command did."""

    code: int
    out: str
    errors: str
    seconds: float


def command(environment: dict[str, str], *words: str) -> Said:
    """Run a command to its end."""
    begin = time.monotonic()
    done = subprocess.run([*COMMAND, *words], cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    return Said(done.returncode, done.stdout, done.stderr, time.monotonic() - begin)


class Claim(NamedTuple):
    """One row of the table."""

    text: str
    measured: str
    holds: bool


def same_words(store: ObjectStore, bags: list[Path], folder: Path, options: list[str], where: str) -> Iterator[Claim]:
    """The commands say the same of folders, here, and of objects, with ``options``."""
    urls = [f'{BUCKET}/{bag.name}' for bag in bags]
    paths, seal = [str(bag) for bag in bags], str(folder / 'seal.yaml')
    lists = {'folders.txt': paths, 'objects.txt': urls}
    for name, places in lists.items():
        (folder / name).write_text('\n'.join(places) + '\n', encoding='utf-8')
    commands = {
        'replay --verify': lambda places, _: ['replay', *places, '--verify'],
        'health --json': lambda places, _: ['health', *places, '--json'],
        'identify --json': lambda places, _: ['identify', places[-1], '--json', '--out', seal, '--force'],
        'fleet --json': lambda _, name: ['fleet', str(folder / name), '--out', str(folder / 'fleet.html'), '--json'],
    }
    for name, words in commands.items():
        local = command(store.environment, *words(paths, 'folders.txt'))
        distant = command(store.environment, *words(urls, 'objects.txt'), *options)
        out, errors = (text.replace(BUCKET, str(bags[0].parent)) for text in (distant.out, distant.errors))
        same = (0, local.out, local.errors) == (distant.code, out, errors)
        measured = f'exit code {distant.code}, {distant.seconds:.1f} s (folders {local.seconds:.1f} s)'
        yield Claim(f'{name}, {where}: the same words as of the folders', measured, same)
        if not same:
            print(local, distant, sep='\n', file=sys.stderr)


def finished_parts(store: ObjectStore, bags: list[Path], folder: Path) -> Iterator[Claim]:
    """Finished parts follow the objects."""
    urls = [f'{BUCKET}/{bag.name}' for bag in bags]
    words = ['replay', *urls, '--verify', '--work', str(folder / 'work')]
    before = store.reads()
    first = command(store.environment, *words)
    between = store.reads()
    again = command(store.environment, *words)
    same = (again.code, again.out) == (first.code, first.out)
    counts = f'{between - before} objects read, then {store.reads() - between}'
    yield Claim(
        '--work: a second run reads no object', counts, same and between - before >= len(bags) == between - before
    )
    put(store, recording(folder, len(bags)), bags[0].name)
    between = store.reads()
    changed = command(store.environment, *words)
    counts = f'exit code {changed.code}, {store.reads() - between} object read'
    yield Claim(
        '--work: a recording that changed is computed alone', counts, changed.code == 0 and store.reads() == between + 1
    )


def one_line(store: ObjectStore, folder: Path) -> Iterator[Claim]:
    """What cannot be read is one line, and leaves no copy."""
    unreachable = reading(NO_STORE, folder)
    without_key = {name: value for name, value in store.environment.items() if not name.startswith('AWS_')}
    without_key |= {'AWS_ENDPOINT_URL': store.environment['AWS_ENDPOINT_URL'], 'AWS_EC2_METADATA_DISABLED': 'true'}
    for text, environment, place in (
        ('no such recording', store.environment, f'{BUCKET}/gone'),
        ('no such bucket', store.environment, 's3://nobody/bag'),
        ('no store at that address', unreachable, f'{BUCKET}/bag0'),
        ('no credentials', without_key, f'{BUCKET}/bag0'),
    ):
        said = command(environment, 'replay', place, '--verify')
        lines = said.errors.strip().splitlines()
        short = lines[-1][:70] if lines else ''
        yield Claim(f'{text}: one line', f'exit code {said.code}: {short}', said.code == 2 and len(lines) == 1)
    left = list((folder / 'copies').glob('seal_friction_*'))
    yield Claim('no copy is left', ', '.join(path.name for path in left) or 'none', not left)


def measured_claims(folder: Path, bags: int) -> list[Claim]:
    """All claims."""
    rig = folder / BUCKET.rpartition('/')[2]  # `fleet` says the name of the rig without what is before it
    rig.mkdir()
    recordings = [recording(rig, number) for number in range(bags)]
    recordings.append(shutil.copytree(ROOT / 'bags' / 'pull_test', rig / 'pull_test'))  # one to identify
    with object_store(folder) as store:
        for bag in recordings:
            put(store, bag, bag.name)
        claims = list(same_words(store, recordings, folder, ['--workers', '2'], 'here'))
        with dask_cluster(folder / 'cluster', 2, store.environment) as cluster:
            claims += same_words(store, recordings, folder, ['--scheduler', cluster.address], 'on a cluster')
        return [*claims, *finished_parts(store, recordings, folder), *one_line(store, folder)]


def main() -> int:
    """Try every claim; print a table."""
    arguments = parser_of(__doc__, bags=(4, 'number of recordings')).parse_args()
    with tempfile.TemporaryDirectory() as name:
        claims = measured_claims(Path(name), arguments.bags)
    tell([claim._asdict() for claim in claims], as_json=arguments.json)
    return 0 if all(claim.holds for claim in claims) else 1


if __name__ == '__main__':
    sys.exit(main())
