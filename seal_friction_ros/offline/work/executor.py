"""Independent calls in parallel processes: the results do not depend on the number of processes, or on their place.

Every call runs in a forked process of its own, which inherits what the parent has loaded and compiled. A call that
crashes (out of memory, signal) therefore costs its own result only. With a `Cluster` instead of a number of processes
the calls run on its workers.
"""

import gc
import multiprocessing
import os
import signal
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from typing import Any, TypeVar, cast

from seal_friction_ros.offline.work.cluster import Cluster, completed_on
from seal_friction_ros.offline.work.outcome import CRASHED, Outcome, outcome_of
from seal_friction_ros.offline.work.progress import progress, report_shares_to

Result = TypeVar('Result')
Workers = int | Cluster  # number of processes of this computer, or a cluster


def nothing() -> None:
    """Prepare nothing."""


def available_cores() -> int:
    """Number of cores that this process may use."""
    return len(os.sched_getaffinity(0))


def try_all(
    label: str,
    calls: Sequence[Callable[[], Result]],
    workers: Workers,
    on_outcome: Callable[[int, Outcome[Result]], None] = lambda *_: None,
    prepare: Callable[[], None] = nothing,
    *,
    stop_at_error: bool = False,
) -> list[Outcome[Result]]:
    """Run every call, whatever becomes of the others, and return the outcomes in their order.

    ValueError: the cluster cannot be used.

    Args:
        label: Of the progress bar.
        calls: Picklable functions without arguments that return picklable results. ``ValueError`` and ``OSError`` are
            the errors of a call; any other exception is a bug: its traceback goes to stderr, and the call has crashed.
        workers: Calls at a time, or a cluster.
        on_outcome: Called in this process with the number of a call and its outcome, as soon as it is done.
        prepare: Called before the processes of this computer begin; they inherit what it loads and compiles.
        stop_at_error: Begin no further call after an error; those that were not begun are left out.
    """
    outcomes: dict[int, Outcome[Result]] = {}
    for number, outcome in _completed(label, calls, workers, prepare, stop_at_error=stop_at_error):
        outcomes[number] = outcome
        on_outcome(number, outcome)
    return [outcomes[number] for number in sorted(outcomes)]


def run_all(
    label: str, calls: Sequence[Callable[[], Result]], workers: Workers, prepare: Callable[[], None] = nothing
) -> list[Result]:
    """Run calls that are of use only together, and return their results in order; arguments as `try_all`.

    ValueError: a call failed: the first one, in the order of the calls; or the cluster cannot be used.
    """
    return results_of(label, try_all(label, calls, workers, prepare=prepare, stop_at_error=True))


def results_of(label: str, outcomes: Sequence[Outcome[Result]]) -> list[Result]:
    """Results of calls; ValueError with the first error."""
    for _, error in outcomes:
        if error:
            raise ValueError(f'{label}: {error}' if error == CRASHED else error)
    return [cast(Result, outcome.result) for outcome in outcomes]


class _Worker:
    """One call in a process of its own.

    The process closes its copies of the parent's connections to ``others``, so that a worker whose parent has gone
    finds its connection broken.
    """

    def __init__(self, number: int, call: Callable[[], Any], others: Sequence[Connection]) -> None:
        context = multiprocessing.get_context('fork')
        self.number = number
        self.done = 0.0  # share of the call
        self.connection, its_end = context.Pipe(duplex=False)
        arguments = (call, its_end, [*others, self.connection])
        self._process: BaseProcess = context.Process(target=_work, args=arguments, daemon=True)
        self._process.start()
        its_end.close()

    def receive(self) -> tuple[float, Outcome[Any] | None]:
        """Share of the call done since the last time, and the outcome once there is one."""
        try:
            received: float | Outcome[Any] = self.connection.recv()
        except EOFError:
            received = Outcome(None, CRASHED)
        outcome = None if isinstance(received, float) else received
        share = 1.0 - self.done if isinstance(received, Outcome) else min(received, 1.0 - self.done)
        self.done += share
        return share, outcome

    def end(self) -> None:
        """End the process, finished or not."""
        self._process.terminate()
        self._process.join()
        self.connection.close()


def _work(call: Callable[[], Any], connection: Connection, inherited: Sequence[Connection]) -> None:
    """Body of a worker process."""
    gc.freeze()  # what the parent had is the parent's: to collect a node of a graph here would end this process
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # ends silently: the parent writes the message
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    for other in inherited:
        other.close()
    report_shares_to(connection.send)
    with suppress(BrokenPipeError):  # the parent has gone
        connection.send(outcome_of(call))


@contextmanager
def _sigint_delayed() -> Iterator[None]:
    """Deliver an interrupt after the block."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, ())
    try:
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _completed(
    label: str,
    calls: Sequence[Callable[[], Any]],
    workers: Workers,
    prepare: Callable[[], None],
    *,
    stop_at_error: bool,
) -> Iterator[tuple[int, Outcome[Any]]]:
    """Number and outcome of each call as it is done; calls begin in the order given."""
    if isinstance(workers, int):
        if calls:
            prepare()
        with progress(label, len(calls)) as advance:
            yield from _completed_here(calls, workers, advance, stop_at_error=stop_at_error)
    elif calls:
        with progress(label, len(calls)) as advance:
            for done in completed_on(workers, calls, stop_at_error=stop_at_error):
                advance(1.0)
                yield done


def _completed_here(
    calls: Sequence[Callable[[], Any]], workers: int, advance: Callable[[float], None], *, stop_at_error: bool
) -> Iterator[tuple[int, Outcome[Any]]]:
    """The same in processes of this computer; ``advance`` takes the share of a call done since the last time."""
    waiting = list(range(len(calls)))[::-1]
    running: dict[Connection, _Worker] = {}
    try:
        while waiting or running:
            while waiting and len(running) < max(workers, 1):
                number = waiting.pop()
                with _sigint_delayed():  # else a worker could begin and not be known
                    worker = _Worker(number, calls[number], list(running))
                    running[worker.connection] = worker
            ready = wait(list(running))
            for worker in [worker for connection, worker in running.items() if connection in ready]:
                share, outcome = worker.receive()
                advance(share)
                if outcome is not None:
                    running.pop(worker.connection).end()
                    if outcome.error and stop_at_error:
                        waiting.clear()
                    yield worker.number, outcome
    finally:
        for worker in running.values():
            worker.end()
