"""Replay of several bags in parallel."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path

from seal_friction_ros.core.estimation.configuration import Configuration
from seal_friction_ros.offline.replay.answer_comparison import ReplayResult
from seal_friction_ros.offline.replay.replay import BULK_FROM, replay
from seal_friction_ros.offline.work.executor import Outcome, try_all

_INPUT_SIZE = 80  # [bytes] of an input in an uncompressed bag


def replay_many(
    bags: Sequence[Path], override: Configuration | None = None, namespace: str = '', workers: int = 1
) -> list[Outcome[ReplayResult]]:
    """Replay bags as `replay` does, ``workers`` of them at a time; outcomes in the order of the bags.

    If the bags together are long, the estimator is compiled before the worker processes begin, so that all of them
    inherit it.
    """
    bulk_from = BULK_FROM
    if sum(map(_size, bags)) > _INPUT_SIZE * BULK_FROM:
        from seal_friction_ros.offline.replay.compiled_replay import compile_now  # noqa: PLC0415  loads the compiler

        compile_now()
        bulk_from = 0
    calls = [partial(replay, bag, override, namespace=namespace, bulk_from=bulk_from) for bag in bags]
    outcomes = try_all(f'replay {len(bags)} bags', calls, workers)
    return [o._replace(error=_naming(bag, o.error)) if o.error else o for bag, o in zip(bags, outcomes, strict=True)]


def _naming(bag: Path, error: str) -> str:
    return error if str(bag) in error else f'{bag}: {error}'


def _size(bag: Path) -> int:
    """Size of the files of a bag [bytes]; 0 if there is none."""
    files = bag.glob('*') if bag.is_dir() else [bag]
    return sum(file.stat().st_size for file in files if file.is_file())
