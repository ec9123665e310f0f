"""Many bags at once, each in a process of its own; what comes out does not depend on how many processes there are."""

import multiprocessing
import os
import signal
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import NamedTuple

from seal_friction_ros.core.estimation.configuration import Configuration
from seal_friction_ros.offline.replay.replay import BULK_FROM, replay
from seal_friction_ros.offline.replay.verdict import Verdict
from seal_friction_ros.offline.work.progress import progress

_SIZE = 80  # [bytes] of an input in a bag that is not compressed


class Outcome(NamedTuple):
    """What became of one bag."""

    bag: Path
    verdict: Verdict | None
    error: str = ''
    """why there is no verdict"""


def available_cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0))


def replay_many(
    bags: Sequence[Path], override: Configuration | None = None, namespace: str = '', workers: int = 1
) -> list[Outcome]:
    """Replay bags as `replay` does, ``workers`` of them at a time; outcomes in the order of the bags.

    If they are long together, the compiled estimator is made before the processes begin, so that all of them have it.
    """
    bulk_from = BULK_FROM
    if sum(map(_size, bags)) > _SIZE * BULK_FROM:
        from seal_friction_ros.offline.replay.compiled_replay import compile_now  # noqa: PLC0415  loads the compiler

        compile_now()
        bulk_from = 0

    def work(bag: Path, pipe: Connection) -> None:
        signal.signal(signal.SIGINT, signal.SIG_DFL)  # ends it without a word; the words are the parent's
        with suppress(BrokenPipeError):  # the parent is gone
            pipe.send(_outcome(bag, override, namespace, bulk_from, pipe.send))

    outcomes: dict[int, Outcome] = {}
    waiting = list(enumerate(bags))[::-1]
    running: dict[Connection, tuple[int, BaseProcess]] = {}
    with progress(f'replay {len(bags)} bags', len(bags)) as advance:
        try:
            while waiting or running:
                while waiting and len(running) < workers:
                    number, bag = waiting.pop()
                    pipe, process = _begun(work, bag)
                    running[pipe] = (number, process)
                ready = wait(list(running))
                for pipe, (number, process) in list(running.items()):
                    if pipe not in ready:
                        continue
                    said = _said(pipe, bags[number])
                    if isinstance(said, Outcome):
                        outcomes[number] = said
                        del running[pipe]
                        pipe.close()
                        process.join()
                    else:
                        advance(said)
        finally:
            for _, process in running.values():
                process.terminate()
    return [outcomes[number] for number in range(len(bags))]


def _begun(work: Callable[[Path, Connection], None], bag: Path) -> tuple[Connection, BaseProcess]:
    """A process at work, forked: it shares what was loaded and compiled, and leaves the progress to its parent."""
    context = multiprocessing.get_context('fork')
    ours, its = context.Pipe(duplex=False)
    process = context.Process(target=work, args=(bag, its))
    process.start()
    its.close()
    return ours, process


def _said(pipe: Connection, bag: Path) -> Outcome | float:
    """What a process says: how much more of its bag is done, as a share, and at last the outcome."""
    try:
        said: Outcome | float = pipe.recv()
    except EOFError:
        return Outcome(bag, None, f'{bag}: its process ended before it was done; is there enough memory?')
    return said


def _outcome(
    bag: Path, override: Configuration | None, namespace: str, bulk_from: int, say: Callable[[float], None]
) -> Outcome:
    @contextmanager
    def show(_: str, total: int) -> Iterator[Callable[[float], None]]:
        yield lambda messages: say(messages / max(total, 1))

    try:
        return Outcome(bag, replay(bag, override, namespace=namespace, bulk_from=bulk_from, show=show))
    except ValueError as error:
        return Outcome(bag, None, str(error))
    except OSError as error:
        return Outcome(bag, None, f'{error.filename}: {error.strerror}')


def _size(bag: Path) -> int:
    """[bytes] of the files of a bag; 0 if there is none."""
    files = bag.glob('*') if bag.is_dir() else [bag]
    return sum(file.stat().st_size for file in files if file.is_file())
