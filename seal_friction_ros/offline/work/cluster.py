"""Calls on a Dask cluster instead of the processes of this computer: the same calls, the same results.

A worker runs one call at a time. It has to have the same version of this package and of its libraries, and it reads
files by the same paths: a relative path begins at the folder where the command was started. Whoever can reach a
scheduler without TLS can run code on its workers. Dask is loaded by the first call, never before.
"""

import asyncio
import logging
import os
import re
import sys
import time
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from seal_friction_ros.core.foundation.errors import named_errors
from seal_friction_ros.offline.work.outcome import CRASHED, THREAD_VARIABLES, Outcome, outcome_of
from seal_friction_ros.offline.work.progress import report_shares_to
from seal_friction_ros.offline.work.versions import versions
from seal_friction_ros.packages import needed

ANSWER_TIME = 10.0  # [s] within which a scheduler and its workers answer (our choice)
WORKERLESS_TIME = 60.0  # [s] without any worker after which the work ends (our choice)
_CALLS_OF_A_WORKER = 4  # calls that are sent to the cluster before the first of them is done (our choice)
_LOOK_PERIOD = 1.0  # [s] between two looks at the scheduler while no call is done
_ADDRESS = re.compile(r'(tcp|tls)://(\[[0-9a-fA-F:.%]+\]|[\w.-]+):(\d{1,5})')


@dataclass(frozen=True)
class Cluster:
    """A Dask cluster.

    ValueError: the address is none, or TLS is for one of both only.
    """

    address: str  # of its scheduler, ``tcp://HOST:PORT`` or, with TLS, ``tls://HOST:PORT``
    tls: tuple[Path, Path, Path] | None = None  # certificate of the authority, own certificate, own key, in PEM

    def __post_init__(self) -> None:
        match = _ADDRESS.fullmatch(self.address)
        if not match or not 0 < int(match[3]) < 65536:
            raise ValueError(f'{self.address!r} is no address of a scheduler: write tcp://HOST:PORT or tls://HOST:PORT')
        if (match[1] == 'tls') != (self.tls is not None):
            raise ValueError(f'{self.address}: a tls:// address and --scheduler-tls CA CERT KEY belong together')
        for file in self.tls or ():
            if not file.is_file():
                raise ValueError(f'{file}: no such file; --scheduler-tls takes CA CERT KEY in PEM')


class _Refusal(NamedTuple):
    """Why a worker does not run a call."""

    reason: str


_GONE = (
    'the scheduler has gone before the work was done: start it and its workers again, then repeat the command; '
    'with --work FOLDER it goes on where it was'
)


def completed_on(
    cluster: Cluster, calls: Sequence[Callable[[], Any]], *, stop_at_error: bool
) -> Iterator[tuple[int, Outcome[Any]]]:
    """Number and outcome of each call as it is done; arguments as of `executor.try_all`.

    At most a few calls for each worker are under way, so that memory does not grow with the number of calls. Of a
    worker that ends another one repeats the call; a call that ends several workers has crashed. Workers import calls by
    name. MissingPackageError: Dask is not installed; ValueError: the cluster cannot be used, or not any more.
    """
    with _connected(cluster) as client:
        most = _CALLS_OF_A_WORKER * _checked_workers(client)
        done = needed('distributed').as_completed(loop=client.loop)
        numbers: dict[Any, int] = {}  # of the calls under way, by their futures
        start = str(Path.cwd()), dict(versions())
        waiting, lonely_since = list(range(len(calls)))[::-1], None
        while waiting or numbers:
            while waiting and len(numbers) < most:
                call = calls[waiting[-1]]
                future = client.submit(_run, call, _paths_here(call), *start, pure=False)
                numbers[future] = waiting.pop()
                done.add(future)
            with done.thread_condition:
                if not done.has_ready():
                    done.thread_condition.wait(_LOOK_PERIOD)
            if not done.has_ready():  # also after a notification of a call that was taken before it came
                lonely_since = _lonely_since(client, lonely_since)
                continue
            future = next(done)
            if future not in numbers:
                continue
            try:
                outcome = _answer(future)
            except TimeoutError:  # the worker with the result has gone: another one computes it again
                done.add(future)
                lonely_since = _lonely_since(client, lonely_since)
                continue
            number, lonely_since = numbers.pop(future), None
            if outcome.error and stop_at_error:
                waiting.clear()
                for later in [one for one, other in numbers.items() if other > number]:
                    del numbers[later]
                    later.release()
            yield number, outcome


def _answer(future: Any) -> Outcome[Any]:
    """Outcome of a call that is done; ValueError: the scheduler has gone, or the worker refuses the call."""
    if future.status in ('cancelled', 'lost'):
        raise ValueError(_GONE)
    if future.status == 'error':
        error = future.exception(timeout=ANSWER_TIME)
        if type(error).__name__ not in ('KilledWorker', 'MemoryError'):  # a bug is seen
            sys.stderr.write(''.join(traceback.format_exception(error)))
        return Outcome(None, CRASHED)
    answer: Outcome[Any] | _Refusal = future.result(timeout=ANSWER_TIME)
    if isinstance(answer, _Refusal):
        raise ValueError(answer.reason)
    return answer


def _lonely_since(client: Any, before: float | None) -> float | None:
    """Time since when there is no worker; None if there is one. ValueError: there is none for long, or no scheduler."""
    if client.status != 'running':
        raise ValueError(_GONE)
    if client.scheduler_info()['workers']:
        return None
    now = time.monotonic()
    since = now if before is None else before
    if now - since > WORKERLESS_TIME:
        raise ValueError(f'no worker is left for {WORKERLESS_TIME:.0f} s: start one, then repeat the command')
    return since


@contextmanager
def _connected(cluster: Cluster) -> Iterator[Any]:
    """Client of a cluster; every error of the scheduler names its address."""
    distributed = needed('distributed')
    parts = (f'distributed.{part}' for part in ('client', 'comm', 'core', 'batched'))
    for name in ('distributed', *parts, 'tornado.application', 'asyncio'):
        logging.getLogger(name).setLevel(logging.CRITICAL + 1)  # one line tells the error, and we write it
    security = None
    if cluster.tls:
        authority, certificate, key = map(str, cluster.tls)
        security = distributed.Security(
            tls_ca_file=authority, tls_client_cert=certificate, tls_client_key=key, require_encryption=True
        )
    try:
        kind = asyncio.run(asyncio.wait_for(_kind_of_server(cluster.address, security), ANSWER_TIME))
        if kind != 'Scheduler':
            raise ValueError(f'a Dask {kind.lower()} answers')
        client = distributed.Client(cluster.address, timeout=ANSWER_TIME, security=security, set_as_default=False)
    except Exception as error:  # noqa: BLE001  whatever a stranger at this address answers
        reason = f' ({str(error).splitlines()[0][:200]})' if str(error) else ''
        hint = f'is the address right, and does `dask scheduler` run there?{reason}'
        what = f'{cluster.address}: no Dask scheduler answers within {ANSWER_TIME:.0f} s'
        raise ValueError(f'{what}: {hint}') from None
    try:
        with named_errors(cluster.address):
            yield client
    finally:
        with suppress(TimeoutError):
            client.close(timeout=2.0)


async def _kind_of_server(address: str, security: Any) -> str:
    """What kind of Dask server answers; a client that meets a stranger would not end for a long time."""
    core = needed('distributed.core')
    connection = {} if security is None else security.get_connection_args('client')
    async with core.rpc(address, connection_args=connection, timeout=ANSWER_TIME) as server:
        return str((await server.identity())['type'])


def _checked_workers(client: Any) -> int:
    """Number of workers; ValueError if there is none, or one that cannot give the results of this computer."""
    try:
        client.wait_for_workers(1, timeout=ANSWER_TIME)
        answers = client.run(_unsuited, dict(versions()), on_error='return')
        answers = {f'worker {address}': answer for address, answer in sorted(answers.items())}
        answers['the scheduler'] = _of_scheduler(client)
    except (TimeoutError, OSError):
        lonely = f'it has no worker after {ANSWER_TIME:.0f} s: start one with `dask worker ADDRESS --nthreads 1`'
        raise ValueError(lonely if client.status == 'running' else _GONE) from None
    for place, answer in answers.items():
        if isinstance(answer, BaseException):
            raise ValueError(f'{place} cannot load this version of seal_friction_ros: install it there')
        if answer:
            raise ValueError(f'{place}: {answer}')
    return len(answers) - 1


def _of_scheduler(client: Any) -> Any:
    """`_other_version` on the scheduler, which unpickles calls too, or the exception there."""
    try:
        return client.run_on_scheduler(_other_version, dict(versions()))
    except (ImportError, AttributeError) as error:
        return error


# -- on a worker ------------------------------------------------------------------------------------------------------


def _unsuited(expected: Mapping[str, str], dask_worker: Any = None) -> str:
    """Why the worker that runs this cannot give the results of the computer with the ``expected`` versions; else empty.

    Without ``dask_worker`` it was asked about its number of threads before.
    """
    if reason := _other_version(expected):
        return reason
    threads = 1 if dask_worker is None else dask_worker.state.nthreads
    if threads != 1:
        return f'it has {threads} threads: start it with --nthreads 1, and one worker for each core'
    if several := [name for name in THREAD_VARIABLES if os.environ.get(name) != '1']:
        return f'linear algebra may take several threads there: start it with {several[0]}=1 in its environment'
    return ''


def _other_version(expected: Mapping[str, str]) -> str:
    """What differs here from the ``expected`` `versions`; empty if nothing."""
    for name, wanted in expected.items():
        if (there := versions().get(name)) != wanted:
            return f'{name} {there} there, {wanted} here: install the same version everywhere'
    return ''


def _run(
    call: Callable[[], Any], paths: Sequence[str], folder: str, expected: Mapping[str, str]
) -> Outcome[Any] | _Refusal:
    """Run a call on this worker, in ``folder`` if the worker has it; ``paths`` have to exist."""
    if reason := _unsuited(expected):
        return _Refusal(f'worker {_own_address()}: {reason}')
    with suppress(OSError):
        os.chdir(folder)
    for path in paths:
        if not os.path.lexists(path):
            return _Refusal(
                f'{path} is on the computer of the command, and not where worker {_own_address()} reads: put it on a '
                'folder that both mount by the same path'
            )
    report_shares_to(lambda _: None)
    return outcome_of(call)


def _own_address() -> str:
    address: str = needed('distributed').get_worker().address
    return address


def _paths_here(call: Callable[[], Any]) -> list[str]:
    """Arguments of a call that are paths of this computer."""
    arguments = (*getattr(call, 'args', ()), *getattr(call, 'keywords', {}).values())
    return [str(path) for path in arguments if isinstance(path, Path) and path.exists()]
