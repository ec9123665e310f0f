"""Fuzzing of the readers: ``python test/system/fuzz.py READER --cases 1000000 [--seed S] [--json]``.

READER is ``all`` or a name of the table. Each reader reads the files of test/corpus and random mutations of them. It
must give a result or a ValueError of one line; anything else counts as a crash, and the file is kept. Times are
processor times; memory is the peak of the process, libraries included.
"""

import argparse
import json
import multiprocessing
import random
import resource
import shutil
import signal
import struct
import sys
import tempfile
import time
import traceback
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from importlib import import_module
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import NamedTuple

from rich.console import Console
from rich.table import Table
from rich.text import Text

from seal_friction_ros.core.estimation.configuration import parse_snapshot, snapshot_text
from seal_friction_ros.core.friction.seal_file import parse_seal
from seal_friction_ros.core.messages.coder import DECODERS
from seal_friction_ros.files import load_parameter_file, read_yaml
from seal_friction_ros.offline.bags import mcap_reader
from seal_friction_ros.offline.bags.bag import bag_topics, read_messages
from seal_friction_ros.offline.bags.import_log import read_samples
from seal_friction_ros.offline.bags.recover import recover
from seal_friction_ros.offline.bags.rig_file import read_rig

CORPUS = Path(__file__).parents[1] / 'corpus'
SLOWEST = 1.0  # [s]
MOST_MEMORY = 200.0  # [MB]
COMPILER = 120.0  # [MB] more for readers that load the compiler
WITH_COMPILER = ('bag_bulk', 'parameters')  # the second one to suggest a name of the simulator for an unknown one
_HANGS = 5.0  # [s] of the processor after which a case is given up
_ROOM = 1 << 30  # [bytes] of address space beyond what is in use: a claim of 1 TB fails at once
_LONGEST_ERROR = 100_000  # characters


# --- readers ---


def read_bag(path: Path) -> None:
    """Read a bag as every command does: topics, messages, then their contents."""
    bag_topics(path)
    for message in read_messages(path):
        decode = DECODERS.get(message.type_name)
        if decode is not None:
            with suppress(ValueError):
                decode(message.data)


def read_metadata(path: Path) -> None:
    """Read the metadata.yaml of a folder with one good file."""
    bag = path.with_name('bag_0.mcap')
    if not bag.exists():
        shutil.copy(CORPUS / 'mcap' / 'plain', bag)
    read_bag(path.parent)


def read_seal(path: Path) -> None:
    """Read a seal and compute its friction at one pressure."""
    seal = parse_seal(read_yaml(path))
    seal.coulomb_law.coulomb_friction(1e6)


def read_snapshot(path: Path) -> None:
    """Read a snapshot; write and read it once more."""
    snapshot = parse_snapshot(path.read_bytes().decode())
    snapshot.configuration.parameters()
    if parse_snapshot(snapshot_text(snapshot)) is None:
        raise AssertionError


def read_wire(path: Path) -> None:
    """Decode the bytes as each message type; accepted if one of them does."""
    data, taken = path.read_bytes(), 0
    for decode in DECODERS.values():
        with suppress(ValueError):
            decode(data)
            taken += 1
    if not taken:
        raise ValueError('no message')


def read_and_recover(path: Path) -> None:
    """Recover a file; the result must be a readable bag."""
    out = path.with_name('out')
    shutil.rmtree(out, ignore_errors=True)
    found = recover(path, out)
    if found.messages != sum(1 for _ in read_messages(out)):
        raise AssertionError(f'{found.messages} messages recovered, but not read')


def log_reader() -> Callable[[Path], None]:
    """Reader of logs with a rig file of the corpus."""
    import_module('scipy.signal')  # which takes longer than any log
    rig = read_rig(CORPUS / 'rig' / 'position')
    return lambda path: void(read_samples(path, rig))


def bulk_reader() -> Callable[[Path], None]:
    """Bulk reader of bags: what it accepts it must read like the general reader."""
    from seal_friction_ros.core.messages.blocks import Kind, UnsuitedError  # noqa: PLC0415  loads the compiler
    from seal_friction_ros.offline.bags.block_reader import compile_now, read_in_bulk  # noqa: PLC0415  the compiler is slow to load

    compile_now()

    def read(path: Path) -> None:
        """Read all messages with both readers."""
        try:
            ours = [
                block.message(number)
                for block in read_in_bulk(path, lambda *_: Kind.OTHER)
                for number in range(len(block.kinds))
            ]
        except (UnsuitedError, OSError, *mcap_reader.ERRORS) as error:  # as `replay_in_bulk` does
            raise ValueError(type(error).__name__) from None
        try:
            theirs = [message.data for message in read_messages(path)]
        except ValueError as error:
            raise AssertionError(f'read in bulk, but: {error}') from None
        if ours != theirs:
            raise AssertionError(f'{len(ours)} messages in bulk, not those of the general reader')

    return read


def void(result: object) -> None:
    """Drop a result."""
    del result


class Reader(NamedTuple):
    """A reader, the name of its file and its folder of the corpus."""

    make: Callable[[], Callable[[Path], None]]
    """prepares the reader, in the process that reads"""
    file_name: str
    corpus: str


READERS = {
    'bag': Reader(lambda: read_bag, 'bag.mcap', 'mcap'),
    'bag_bulk': Reader(bulk_reader, 'bag.mcap', 'mcap'),
    'bag_folder': Reader(lambda: read_metadata, 'metadata.yaml', 'metadata'),
    'bag_sqlite': Reader(lambda: read_bag, 'bag.db3', 'sqlite'),
    'seal': Reader(lambda: read_seal, 'seal.yaml', 'seal'),
    'rig': Reader(lambda: lambda path: void(read_rig(path)), 'rig.yaml', 'rig'),
    'parameters': Reader(lambda: lambda path: void(load_parameter_file(path)), 'parameters.yaml', 'parameters'),
    'log': Reader(log_reader, 'log.csv', 'log'),
    'snapshot': Reader(lambda: read_snapshot, 'snapshot.json', 'snapshot'),
    'wire': Reader(lambda: read_wire, 'message', 'wire'),
    'recover': Reader(lambda: read_and_recover, 'bag.mcap', 'mcap'),
}

# --- mutations ---

NUMBERS = (0, 1, 2, 21, 22, 127, 255, 1 << 15, (1 << 16) - 1, (1 << 31) - 1, 1 << 31, (1 << 32) - 1, 1 << 40, 1 << 62)
NUMBERS += ((1 << 63) - 1, 1 << 63, (1 << 64) - 1)
TEXTS = (
    *(
        '&a ',
        '*a',
        '[',
        ']',
        '{',
        '}',
        '- ',
        ': ',
        ', ',
        '"',
        "'",
        '#',
        '!!',
        '? ',
        '<<: ',
        '|',
        '../',
        '/',
        '~',
        '\u2028',
    ),
    *('\n', '\t', '\r', '\x00', 'nan', '.inf', '1e999', '-1', '0x', 'null', 'true', '9' * 30, '9' * 400, '[' * 60),
    *('1:' * 60, '!!python/object/apply:os.system [x]', 'zstd', 'lz4'),
)
WORDS = [*(text.encode() for text in TEXTS), b'\xff', b'\x89MCAP0\r\n', *(bytes([opcode]) for opcode in range(16))]


def mutated(chance: random.Random, seeds: list[bytes]) -> bytes:
    """A seed with one to eight random changes."""
    data = bytearray(chance.choice(seeds))
    for _ in range(min(1 + int(chance.expovariate(0.8)), 8)):
        place = chance.randrange(len(data) + 1)
        _change(chance, data, place, seeds)
    return bytes(data)


def _change(chance: random.Random, data: bytearray, place: int, seeds: list[bytes]) -> None:
    kind = chance.choice(('flip', 'byte', 'cut', 'double', 'end', 'insert', 'overwrite', 'number', 'number', 'splice'))
    if kind == 'flip':
        data[place : place + 1] = bytes(byte ^ 1 << chance.randrange(8) for byte in data[place : place + 1])
    elif kind == 'byte':
        data[place : place + 1] = bytes([chance.randrange(256)])
    elif kind == 'cut':
        del data[place : place + int(chance.expovariate(0.05))]
    elif kind == 'double':
        data[place:place] = data[place : place + int(chance.expovariate(0.02))] * chance.choice((1, 1, 1, 2, 50))
    elif kind == 'end':
        del data[place:]
    elif kind == 'splice':
        other = chance.choice(seeds)
        data[place:] = other[chance.randrange(len(other) + 1) :]
    elif kind == 'number':
        width = chance.choice((2, 4, 8))
        data[place : place + width] = struct.pack('<Q', chance.choice(NUMBERS))[:width]
    else:
        word = chance.choice(WORDS)
        data[place : place + len(word) * (kind == 'overwrite')] = word


# --- the run ---


def most_memory(reader: str) -> float:
    """Memory limit of a reader [MB]."""
    return MOST_MEMORY + COMPILER * (reader in WITH_COMPILER)


@dataclass
class Outcome:
    """Outcome of the cases of one reader."""

    reader: str
    cases: int = 0
    taken: int = 0
    """cases that are valid files"""
    crashes: int = 0
    slowest: float = 0.0
    """[s] of processor time"""
    memory: float = 0.0
    """peak memory of the process [MB]"""
    kept: list[str] = field(default_factory=list)
    """first crashes: the file that causes it and the exception"""

    @property
    def good(self) -> bool:
        """Whether the limits are kept."""
        return not self.crashes and self.slowest <= SLOWEST and self.memory <= most_memory(self.reader)


class Hang(BaseException):
    """A case that does not end."""


def fuzz(name: str, cases: int, seed: int, keep: Path) -> Outcome:
    """Run a reader on its corpus and on mutations of it."""
    reader, outcome, chance = READERS[name], Outcome(name), random.Random(f'{name} {seed}')  # noqa: S311  no secret
    seeds = [path.read_bytes() for path in sorted((CORPUS / reader.corpus).iterdir())]
    signal.signal(signal.SIGPROF, _give_up)
    read = reader.make()
    _limit_memory()
    shared = Path('/dev/shm')  # noqa: S108  a folder of its own is made in it
    with tempfile.TemporaryDirectory(dir=shared if shared.is_dir() else None) as folder:
        path = Path(folder) / reader.file_name
        for case in range(cases):
            data = seeds[case] if case < len(seeds) else mutated(chance, seeds)
            path.write_bytes(data)
            _one(read, path, data, outcome, keep)
    outcome.memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    return outcome


def _one(read: Callable[[Path], None], path: Path, data: bytes, outcome: Outcome, keep: Path) -> None:
    failure = ''
    signal.setitimer(signal.ITIMER_PROF, _HANGS)
    started = time.process_time()
    try:
        read(path)
        outcome.taken += 1
    except ValueError as error:
        failure = (
            '' if len(str(error).splitlines()) <= 1 and len(str(error)) < _LONGEST_ERROR else 'error of many lines'
        )
    except (Exception, Hang) as error:  # noqa: BLE001  every other exception is a crash
        failure = f'{type(error).__name__}: {error}; {traceback.format_exc().splitlines()[-3].strip()}'
    seconds = time.process_time() - started
    signal.setitimer(signal.ITIMER_PROF, 0.0)
    outcome.cases += 1
    outcome.slowest = max(outcome.slowest, seconds)
    outcome.crashes += bool(failure)
    if (failure or seconds > SLOWEST) and len(outcome.kept) < 10:
        keep.mkdir(parents=True, exist_ok=True)
        kept = keep / f'{outcome.reader}_{outcome.cases}'
        kept.write_bytes(data)
        outcome.kept.append(f'{kept}: {failure or f"{seconds:.1f} s"}')


def _give_up(*_: object) -> None:
    raise Hang


def _limit_memory() -> None:
    in_use = int(Path('/proc/self/statm').read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (in_use + _ROOM, -1))


def _start(name: str, arguments: argparse.Namespace) -> tuple[str, BaseProcess, Connection]:
    """Start a process for one reader: its memory is that of one reader, and a killed process is noticed."""
    context = multiprocessing.get_context('fork')
    ours, theirs = context.Pipe(duplex=False)

    def run() -> None:
        theirs.send(fuzz(name, arguments.cases, arguments.seed, arguments.keep))

    process = context.Process(target=run)
    process.start()
    theirs.close()
    return name, process, ours


def _outcome(name: str, process: BaseProcess, pipe: Connection) -> Outcome:
    try:
        outcome: Outcome = pipe.recv()
    except EOFError:
        process.join()
        outcome = Outcome(name, crashes=1, kept=[f'the process ended with exit code {process.exitcode}'])
    process.join()
    return outcome


def main() -> int:
    """Fuzz, each reader in a process of its own; print a table, or JSON."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n', maxsplit=1)[0])
    parser.add_argument('reader', choices=['all', *READERS])
    parser.add_argument('--cases', type=int, default=10_000)
    parser.add_argument('--seed', type=int, default=1)
    parser.add_argument('--parallel', type=int, default=1)
    parser.add_argument('--keep', type=Path, default=Path('build/fuzz'), help='folder for files that crash a reader')
    parser.add_argument('--json', action='store_true')
    arguments = parser.parse_args()
    names = list(READERS) if arguments.reader == 'all' else [arguments.reader]
    outcomes = []
    for first in range(0, len(names), arguments.parallel):
        started = [_start(name, arguments) for name in names[first : first + arguments.parallel]]
        outcomes += [_outcome(*run) for run in started]
    good = all(outcome.good for outcome in outcomes)
    if arguments.json:
        print(json.dumps({'good': good, 'readers': [asdict(outcome) for outcome in outcomes]}))
        return 0 if good else 1
    table = Table(title=f'seed {arguments.seed}')
    for heading in ('reader', 'cases', 'taken', 'crashes', 'slowest [s]', 'memory [MB]'):
        table.add_column(Text(heading), justify='left' if heading == 'reader' else 'right')
    for o in outcomes:
        table.add_row(o.reader, str(o.cases), str(o.taken), str(o.crashes), f'{o.slowest:.3f}', f'{o.memory:.0f}')
    Console().print(table)
    for outcome in outcomes:
        print(*outcome.kept, sep='\n', end='\n' if outcome.kept else '')
    return 0 if good else 1


if __name__ == '__main__':
    sys.exit(main())
