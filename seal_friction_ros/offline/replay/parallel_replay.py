"""Replay of long bags, compiled, and of several bags in parallel."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path

from seal_friction_ros.core.estimation.configuration import Configuration
from seal_friction_ros.core.foundation.compiled import has_compiler
from seal_friction_ros.offline.bags.bag import bag_topics
from seal_friction_ros.offline.bags.topics import find_topics
from seal_friction_ros.offline.replay.answer_comparison import ReplayResult
from seal_friction_ros.offline.replay.machine_replay import is_machine_bag
from seal_friction_ros.offline.replay.replay import count_messages, replay
from seal_friction_ros.offline.work.executor import Outcome, try_all
from seal_friction_ros.offline.work.progress import progress

BULK_FROM = 500_000
"""Bags of at least so many messages are replayed compiled: compiling takes as long as replaying them one by one.

Without numba all are replayed one by one, with the same result."""

_INPUT_SIZE = 80  # [bytes] of an input in an uncompressed bag


def verify(
    bag: Path, override: Configuration | None = None, namespace: str = '', *, bulk_from: int = BULK_FROM
) -> ReplayResult:
    """`replay` without writing; a bag of at least ``bulk_from`` messages compiled, with the same result.

    Raises:
        BagError: The bag cannot be read.
    """
    known = bag_topics(bag)
    total = count_messages(known)
    if total >= bulk_from and has_compiler() and not is_machine_bag(bag, known):
        from seal_friction_ros.offline.replay.compiled_replay import replay_in_bulk  # noqa: PLC0415  loads the compiler

        with progress(f'replay {bag.name}', total) as advance:
            result = replay_in_bulk(bag, find_topics(bag, namespace, known), override, advance)
        if result is not None:
            return result
    return replay(bag, override, namespace=namespace)


def replay_many(
    bags: Sequence[Path], override: Configuration | None = None, namespace: str = '', workers: int = 1
) -> list[Outcome[ReplayResult]]:
    """`verify` bags, ``workers`` of them at a time; outcomes in the order of the bags.

    If the bags together are long, the estimator is compiled before the worker processes begin, so that all of them
    inherit it.
    """
    bulk_from = BULK_FROM
    if sum(map(_size, bags)) > _INPUT_SIZE * BULK_FROM and has_compiler():
        from seal_friction_ros.offline.replay.compiled_replay import (  # noqa: PLC0415  loads the compiler
            compile_now,
            first_configurations,
        )

        compile_now(first_configurations(bags, namespace, override))
        bulk_from = 0
    calls = [partial(verify, bag, override, namespace, bulk_from=bulk_from) for bag in bags]
    outcomes = try_all(f'replay {len(bags)} bags', calls, workers)
    return [o._replace(error=_naming(bag, o.error)) if o.error else o for bag, o in zip(bags, outcomes, strict=True)]


def _naming(bag: Path, error: str) -> str:
    return error if str(bag) in error else f'{bag}: {error}'


def _size(bag: Path) -> int:
    """Size of the files of a bag [bytes]; 0 if there is none."""
    files = bag.glob('*') if bag.is_dir() else [bag]
    return sum(file.stat().st_size for file in files if file.is_file())
