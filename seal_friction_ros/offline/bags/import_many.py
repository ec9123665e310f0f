"""Import of several sources in parallel, here or on a cluster: the same bags whatever the number of workers."""

import shutil
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any
from uuid import uuid4

from seal_friction_ros.offline.bags.bag import BagError
from seal_friction_ros.offline.work.executor import Workers, try_all
from seal_friction_ros.offline.work.outcome import Outcome
from seal_friction_ros.offline.work.places import Place, as_path, name_of


def import_many(
    convert: Callable[[Path, Path], Any], sources: Sequence[Place], out: Path, workers: Workers
) -> list[Outcome[Any]]:
    """Convert every source, whatever becomes of the others.

    All bags appear together at the end, so that an interrupted command leaves none.

    Args:
        convert: Picklable function of a source and of the bag to write.
        sources: Logs or bags: paths, or URLs that are copied where they are converted.
        out: The bag of one source; of several a folder with a bag each, by `bag_names`. Must not exist.
        workers: Sources at a time, or a cluster, whose workers write into the folder of ``out``.

    Returns:
        Outcomes in the order of the sources.

    Raises:
        ValueError: Two sources have one name, or the cluster cannot be used.
        BagError: ``out`` exists already, or cannot be made.
    """
    names = bag_names(sources) if len(sources) > 1 else [out.name]
    if out.exists():
        raise BagError(f'{out} exists already: not overwriting')
    place = out.with_name(f'.{out.name}.{uuid4().hex}')  # a worker checks that it has this folder
    done = place / 'done'
    try:
        done.mkdir(parents=True)
    except OSError as error:
        raise BagError(f'{out}: cannot make a bag there: {error.strerror}') from None
    try:
        calls = [partial(_import, convert, source, place, name) for source, name in zip(sources, names, strict=True)]
        outcomes = try_all(f'import {len(sources)} sources', calls, workers)
        if any(not outcome.error for outcome in outcomes):
            (done if len(sources) > 1 else done / out.name).rename(out)
    finally:
        shutil.rmtree(place, ignore_errors=True)
    return [
        one._replace(error=one.error if str(source) in one.error else f'{source}: {one.error}') if one.error else one
        for source, one in zip(sources, outcomes, strict=True)
    ]


def _import(convert: Callable[[Path, Path], Any], source: Place, place: Path, name: str) -> Any:
    """Convert one source; a call that a cluster repeats, since its worker was killed, begins anew."""
    own, done = place / uuid4().hex, place / 'done' / name
    try:
        with as_path(source) as path:
            result = convert(path, own / name)
        shutil.rmtree(done, ignore_errors=True)
        (own / name).rename(done)
    finally:
        shutil.rmtree(own, ignore_errors=True)
    return result


def bag_names(sources: Sequence[Place]) -> list[str]:
    """Name of the bag of each source, by `name_of`.

    Raises:
        ValueError: Two are the same.
    """
    names = list(map(name_of, sources))
    for number, name in enumerate(names):
        if name in names[:number]:
            raise ValueError(f'{sources[names.index(name)]} and {sources[number]} would both be bag {name}: rename one')
    return names
