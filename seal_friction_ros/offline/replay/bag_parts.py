"""The same computation on each of several bags: in parallel, resumable, and one bad bag spoils no other."""

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from seal_friction_ros.core.estimation.configuration import Configuration, first_snapshot, snapshot_text
from seal_friction_ros.core.estimation.findings import USUAL_LIMITS, Limits
from seal_friction_ros.offline.bags.mapped_bag import MappingFile
from seal_friction_ros.offline.work.executor import Workers, nothing
from seal_friction_ros.offline.work.finished_parts import Kept, Part, keys_of, try_parts
from seal_friction_ros.offline.work.outcome import Outcome
from seal_friction_ros.offline.work.places import Place, as_path, with_name


class Chosen(NamedTuple):
    """What of a bag is used, and how."""

    namespace: str = ''  # as of `open_actuator`
    mapping: MappingFile | None = None  # likewise
    override: Configuration | None = None  # instead of the recorded configuration
    limits: Limits = USUAL_LIMITS  # of alarms


AS_RECORDED = Chosen()


def try_bags(
    kind: str,
    bags: Sequence[Place],
    record: Any,
    call: Callable[[Path, Chosen], Any],
    chosen: Chosen,
    workers: Workers,
    kept: Kept,
    prepare: Callable[[], None] = nothing,
) -> list[Outcome[Any]]:
    """Outcome of a computation on each bag, in the order of the bags.

    ``kind`` says what is computed, also beside the progress bar; ``call`` is a picklable function of a bag and
    ``chosen`` that makes a ``record``, a named tuple whose values are as of `Part`. Outcomes are kept by content and
    path of a bag and by the settings. A URL is copied where it is computed. ValueError: the work folder or the cluster
    cannot be used.
    """
    override, mapping = chosen.override, chosen.mapping
    known = [chosen.namespace, snapshot_text(first_snapshot(override)) if override else '', repr(chosen.limits)]
    keys = keys_of(kind, bags, list(map(str, bags)), [*known, mapping], workers, kept)
    calls = [partial(_computed, bag, call, chosen) for bag in bags]
    parts = [Part(key, record._fields, one) for key, one in zip(keys, calls, strict=True)]
    outcomes = try_parts(f'{kind} of {len(bags)} bags', parts, workers, kept, prepare)
    return [
        Outcome(None, with_name(bag, error)) if values is None else Outcome(record(**values))
        for bag, (values, error) in zip(bags, outcomes, strict=True)
    ]


def _computed(bag: Place, call: Callable[[Path, Chosen], Any], chosen: Chosen) -> Any:
    with as_path(bag) as path:
        return call(path, chosen)
