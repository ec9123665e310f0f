"""Import of several sources in parallel, here or on a cluster: the same bags whatever the number of workers."""

import json
import shutil
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any
from uuid import uuid4

from seal_friction_ros.core.foundation.errors import named_errors
from seal_friction_ros.offline.bags.bag import BagError
from seal_friction_ros.offline.work.executor import Workers
from seal_friction_ros.offline.work.finished_parts import NOWHERE, Kept, Part, Values, keys_of, try_parts
from seal_friction_ros.offline.work.outcome import Outcome
from seal_friction_ros.offline.work.places import Place, as_path, name_of, with_name

Convert = Callable[[Path, Path], tuple[dict[str, Any], str]]
"""Picklable function of a source and of the bag to write; returns numbers and text for people."""


def import_many(
    convert: Convert, sources: Sequence[Place], out: Path, workers: Workers, kept: Kept = NOWHERE, settings: Any = None
) -> list[Outcome[Values]]:
    """Convert every source, whatever becomes of the others; outcomes in their order, with ``numbers`` and ``text``.

    All bags appear together at the end, so that an interrupted command leaves none, except in a work folder: there each
    is kept until the bags appear, also if some could not be made. The workers of a cluster write into the folder of
    ``out`` or the work folder. ``out`` is the bag of one source; of several a folder with a bag each, by `bag_names`.
    The conversion depends on the ``settings``, as of `content_of`. ValueError: two sources have one name, or the work
    folder or the cluster cannot be used; BagError: ``out`` exists already, or cannot be made.
    """
    names = bag_names(sources) if len(sources) > 1 else [out.name]
    if out.exists():
        raise BagError(f'{out} exists already: not overwriting')
    place = out.with_name(f'.{out.name}.{uuid4().hex}')  # a worker checks that it has this folder
    done = place / 'done'
    with named_errors(f'{out}: cannot make a bag there', OSError, BagError):
        done.mkdir(parents=True)
    try:
        keys = keys_of('import', sources, names, settings, workers, kept)
        folders = [(kept.folder or place) / f'{key}.bag' for key in keys]
        parts = [
            Part(key, ('numbers', 'text'), partial(_import, convert, source, folder / name), folder)
            for key, source, folder, name in zip(keys, sources, folders, names, strict=True)
        ]
        outcomes = try_parts(f'import of {len(sources)} sources', parts, workers, kept)
        for folder, name, outcome in zip(folders, names, outcomes, strict=True):
            if not outcome.error:
                shutil.move(folder / name, done / name)
                folder.rmdir()
        if any(not outcome.error for outcome in outcomes):
            (done if len(sources) > 1 else done / out.name).rename(out)
    finally:
        shutil.rmtree(place, ignore_errors=True)
    named = zip(sources, outcomes, strict=True)
    return [one._replace(error=with_name(source, one.error)) if one.error else one for source, one in named]


def _import(convert: Convert, source: Place, bag: Path) -> Values:
    """Convert one source to ``bag``; a call that a cluster repeats, since its worker was killed, begins anew."""
    folder = bag.parent
    own = folder.with_name(f'.{folder.name}.{uuid4().hex}')
    try:
        with as_path(source) as path:
            numbers, text = convert(path, own / bag.name)
        shutil.rmtree(folder, ignore_errors=True)
        own.rename(folder)
    finally:
        shutil.rmtree(own, ignore_errors=True)
    return {'numbers': json.loads(json.dumps(numbers, default=str)), 'text': text}


def bag_names(sources: Sequence[Place]) -> list[str]:
    """Name of the bag of each source, by `name_of`; ValueError if two are the same."""
    names = list(map(name_of, sources))
    for number, name in enumerate(names):
        if name in names[:number]:
            raise ValueError(f'{sources[names.index(name)]} and {sources[number]} would both be bag {name}: rename one')
    return names
