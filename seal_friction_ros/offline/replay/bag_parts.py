"""The same computation on each of several bags: in parallel, resumable, and one bad bag spoils no other."""

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from seal_friction_ros.core.estimation.configuration import Configuration, first_snapshot, snapshot_text
from seal_friction_ros.offline.work.executor import Workers, nothing
from seal_friction_ros.offline.work.finished_parts import Kept, Part, Values, input_digests, part_key, try_parts
from seal_friction_ros.offline.work.outcome import Outcome
from seal_friction_ros.offline.work.places import Place, as_path


def try_bags(
    kind: str,
    bags: Sequence[Place],
    names: tuple[str, ...],
    call: Callable[[Path, str, Configuration | None], Any],
    settings: tuple[str, Configuration | None],
    workers: Workers,
    kept: Kept,
    prepare: Callable[[], None] = nothing,
) -> list[Outcome[Values]]:
    """Outcome of a computation on each bag, in the order of the bags.

    Args:
        kind: What is computed, also the label of the progress bar.
        bags: The bags: paths, or URLs that are copied where they are computed.
        names: Of the values in a result.
        call: Picklable function of a bag, a namespace and a configuration, with a result as of `Part`.
        settings: Namespace and configuration.
        workers: Bags at a time, or a cluster.
        kept: Where outcomes are kept, by content and path of a bag and by the settings.
        prepare: As of `try_all`.

    Raises:
        ValueError: The work folder or the cluster cannot be used.
    """
    namespace, override = settings
    chosen = [namespace, snapshot_text(first_snapshot(override)) if override else '']
    keys = [f'{number}' for number in range(len(bags))]
    if kept.folder is not None:
        digests = input_digests(bags, workers)
        keys = [
            part_key(kind, [str(bag), one.result or one.error, *chosen]) for bag, one in zip(bags, digests, strict=True)
        ]
    calls = [partial(_computed, bag, call, namespace, override) for bag in bags]
    parts = [Part(key, names, one) for key, one in zip(keys, calls, strict=True)]
    outcomes = try_parts(f'{kind} of {len(bags)} bags', parts, workers, kept, prepare)
    return [o._replace(error=_naming(bag, o.error)) if o.error else o for bag, o in zip(bags, outcomes, strict=True)]


def _computed(
    bag: Place, call: Callable[[Path, str, Configuration | None], Any], namespace: str, override: Configuration | None
) -> Any:
    with as_path(bag) as path:
        return call(path, namespace, override)


def _naming(bag: Place, error: str) -> str:
    return error if str(bag) in error else f'{bag}: {error}'
