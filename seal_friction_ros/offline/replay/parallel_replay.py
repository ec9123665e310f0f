"""Replay of long bags, compiled, and of several bags in parallel."""

from collections.abc import Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path

from seal_friction_ros.core.estimation.configuration import Configuration
from seal_friction_ros.core.foundation.compiled import has_compiler
from seal_friction_ros.offline.bags.actuator_bag import Topics, find_topics
from seal_friction_ros.offline.bags.bag import BagError, bag_topics
from seal_friction_ros.offline.replay.answer_comparison import ReplayResult
from seal_friction_ros.offline.replay.bag_parts import Chosen, try_bags
from seal_friction_ros.offline.replay.replay import count_messages, replay
from seal_friction_ros.offline.work.executor import Workers, nothing
from seal_friction_ros.offline.work.finished_parts import NOWHERE, Kept
from seal_friction_ros.offline.work.outcome import Outcome
from seal_friction_ros.offline.work.places import Place
from seal_friction_ros.offline.work.progress import progress

BULK_FROM = 500_000
"""Bags of at least so many messages are replayed compiled: compiling takes as long as replaying them one by one.

Without numba all are replayed one by one, with the same result."""

_INPUT_SIZE = 80  # [bytes] of an input in an uncompressed bag


def verify(
    bag: Path, override: Configuration | None = None, namespace: str = '', *, bulk_from: int = BULK_FROM
) -> ReplayResult:
    """`replay` without writing; a bag of at least ``bulk_from`` messages compiled, with the same result and errors."""
    total = count_messages(bag_topics(bag))
    topics = _own_topics(bag, namespace) if total >= bulk_from and has_compiler() else None
    if topics is not None:
        from seal_friction_ros.offline.replay.compiled_replay import replay_in_bulk  # noqa: PLC0415  loads the compiler

        with progress(f'replay {bag.name}', total) as advance:
            result = replay_in_bulk(bag, topics, override, advance)
        if result is not None:
            return result
    return replay(bag, override, namespace=namespace)


def verify_shared(
    bag: Path, namespace: str = '', workers: Workers = 1, *, bulk_from: int = BULK_FROM
) -> ReplayResult | None:
    """Result of `verify` with the bag's own configuration, by several workers; ValueError without such a cluster.

    None: the bag is too short to share, without states between which it can be shared, or it is not identical, so that
    it has to be replayed in one go.
    """
    if workers == 1 or count_messages(bag_topics(bag)) < bulk_from or not has_compiler():
        return None
    from seal_friction_ros.offline.replay.shared_replay import verify_stretches  # noqa: PLC0415  loads the compiler

    topics = _own_topics(bag, namespace)
    return None if topics is None else verify_stretches(bag, topics, workers)


def _own_topics(bag: Path, namespace: str) -> Topics | None:
    """Topics of this project, whose messages are replayed in bulk; None: there are not what the estimator needs."""
    try:
        return find_topics(bag, namespace)
    except BagError:
        return None


def replay_many(
    bags: Sequence[Place],
    override: Configuration | None = None,
    namespace: str = '',
    workers: Workers = 1,
    kept: Kept = NOWHERE,
) -> list[Outcome[ReplayResult]]:
    """`verify` bags, ``workers`` of them at a time; outcomes in the order of the bags. A single one is shared by them.

    If the bags together are long, the estimator is compiled before the worker processes begin, so that all of them
    inherit it. A cluster compiles once for each of its workers. Raises as `try_bags`.
    """
    if len(bags) == 1 and isinstance(bags[0], Path) and override is None and kept == NOWHERE:
        with suppress(BagError, OSError):  # `verify` below says what is wrong with the bag
            shared = verify_shared(bags[0], namespace, workers)
            if shared is not None:
                return [Outcome(shared)]
    chosen, bulk_from, prepare = Chosen(namespace, override=override), BULK_FROM, nothing
    if sum(map(_size, bags)) > _INPUT_SIZE * BULK_FROM and has_compiler():
        bulk_from, prepare = 0, partial(_compile, bags, chosen)
    return try_bags('replay', bags, ReplayResult, partial(_verified, bulk_from), chosen, workers, kept, prepare)


def _verified(bulk_from: int, bag: Path, chosen: Chosen) -> ReplayResult:
    return verify(bag, chosen.override, chosen.namespace, bulk_from=bulk_from)


def _compile(bags: Sequence[Place], chosen: Chosen) -> None:
    from seal_friction_ros.offline.replay.compiled_replay import compile_first  # noqa: PLC0415  loads the compiler

    compile_first(bags, chosen)


def _size(bag: Place) -> int:
    """Size of the files of a bag [bytes]; 0 if there is none, and of a URL, which is not here."""
    if isinstance(bag, str):
        return 0
    files = bag.glob('*') if bag.is_dir() else [bag]
    return sum(file.stat().st_size for file in files if file.is_file())
