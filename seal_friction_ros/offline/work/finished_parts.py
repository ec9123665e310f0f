"""Long work in parts: parts that an interrupted run has finished are not computed again.

A part is kept under a key made from its inputs, its settings and the code that computes it, so a changed input or a new
version of the package never finds an old result. Where parts may fail one by one, a failure is kept, too.
"""

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, is_dataclass
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from seal_friction_ros.core.foundation.documents import parse_json
from seal_friction_ros.core.foundation.errors import named_errors
from seal_friction_ros.offline.work.atomic_file import write_whole
from seal_friction_ros.offline.work.executor import Workers, nothing, results_of, try_all
from seal_friction_ros.offline.work.outcome import CRASHED, Outcome
from seal_friction_ros.offline.work.places import Place, url_digest
from seal_friction_ros.offline.work.versions import versions

Values = Mapping[str, Any]  # Result of a part: numbers, texts and arrays of at least one element, by name.


class Part(NamedTuple):
    """One independent part of a longer computation."""

    key: str  # from `part_key`
    names: tuple[str, ...]  # of the values in the result
    call: Callable[[], Any]
    """picklable function that computes the part; returns `Values`, or a named tuple with these fields"""
    output: Path | None = None  # folder that the call makes; without it the part is not finished


class Kept(NamedTuple):
    """Where finished parts are kept."""

    folder: Path | None = None  # None: nowhere
    retry_failed: bool = False  # compute parts again that failed


NOWHERE = Kept()


def part_key(kind: str, inputs: Any) -> str:
    """Key of a part from all that its result depends on, as JSON can hold it; a file by its digest."""
    text = f'{kind} {json.dumps([inputs, dict(versions())], sort_keys=True)}'
    return hashlib.sha256(text.encode()).hexdigest()[:32]


def content_of(value: Any) -> Any:
    """A value as `part_key` takes it: records and sequences as lists, an array by its shape and digest."""
    if isinstance(value, np.ndarray):
        return [list(value.shape), value.dtype.str, hashlib.sha256(value.tobytes()).hexdigest()]
    if is_dataclass(value):
        return [type(value).__name__, *(content_of(getattr(value, one.name)) for one in fields(value) if one.init)]
    if isinstance(value, Mapping):
        return {str(name): content_of(item) for name, item in value.items()}
    return [content_of(item) for item in value] if isinstance(value, list | tuple) else value


def input_digest(path: Place) -> str:
    """Digest of the content of a file, or of the files in a folder with their names; of a URL its `url_digest`.

    ValueError if it is neither a file nor a folder, or a URL that cannot be read; OSError if it cannot be read.
    """
    if isinstance(path, str):
        return url_digest(path)
    if not path.is_dir() and not path.is_file():  # a device may have no end
        raise ValueError(f'{path}: neither a file nor a folder')
    digest = hashlib.sha256()
    for file in sorted(one for one in path.iterdir() if one.is_file()) if path.is_dir() else [path]:
        with file.open('rb') as content:
            one = hashlib.file_digest(content, 'sha256').hexdigest()
        digest.update(f'{file.name if path.is_dir() else ""} {one}\n'.encode(errors='surrogateescape'))
    return digest.hexdigest()


def run_parts(
    label: str, parts: Sequence[Part], workers: Workers, folder: Path | None, prepare: Callable[[], None] = nothing
) -> list[Values]:
    """Results, in order, of parts that are of use only together; parts that are kept in ``folder`` are not computed.

    The folder keeps every finished part as a JSON file, also when a later part fails; None keeps none. Other arguments
    as of `try_all`. ValueError: a part failed, or the folder or the cluster cannot be used.
    """
    kept = Kept(folder, retry_failed=True)
    return results_of(label, try_parts(label, parts, workers, kept, prepare, stop_at_error=True))


def try_parts(
    label: str,
    parts: Sequence[Part],
    workers: Workers,
    kept: Kept,
    prepare: Callable[[], None] = nothing,
    *,
    stop_at_error: bool = False,
) -> list[Outcome[Values]]:
    """Outcomes, in order, of parts that may fail one by one; other arguments as of `run_parts` and `try_all`.

    An error of a part is kept like a result, unless it ends the work; that its process crashed is not. ValueError: the
    folder or the cluster cannot be used.
    """
    outcomes, missing = _found(parts, kept)

    def keep(place: int, outcome: Outcome[Any]) -> None:
        """Take the outcome of a missing part, and write it to the folder."""
        result: Any = outcome.result
        values = result._asdict() if hasattr(result, '_asdict') else result
        outcomes[missing[place]] = outcome._replace(result=values)
        if kept.folder is not None and not (outcome.error == CRASHED or (outcome.error and stop_at_error)):
            _write(kept.folder, parts[missing[place]].key, outcomes[missing[place]])

    calls = [parts[number].call for number in missing]
    try_all(label, calls, workers, keep, prepare, stop_at_error=stop_at_error)
    return [outcomes[number] for number in sorted(outcomes)]


def keys_of(
    kind: str, places: Sequence[Place], names: Sequence[str], settings: Any, workers: Workers, kept: Kept
) -> list[str]:
    """Key of the part of each place by its name, content and the settings; its number where nothing is kept."""
    if kept.folder is None:
        return [str(number) for number in range(len(places))]
    digests = try_all(f'digests of {len(places)} inputs', [partial(input_digest, one) for one in places], workers)
    known = content_of(settings)
    return [part_key(kind, [name, *digest, known]) for name, digest in zip(names, digests, strict=True)]


def _found(parts: Sequence[Part], kept: Kept) -> tuple[dict[int, Outcome[Values]], list[int]]:
    """Outcomes that are kept, by number of the part, and the numbers of the others; makes the folder."""
    if kept.folder is not None:
        try:
            kept.folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise ValueError(f'{kept.folder}: cannot be the work folder: {error.strerror}: name another one') from None
    read = ((number, _read(kept, part)) for number, part in enumerate(parts))
    outcomes = {number: outcome for number, outcome in read if outcome is not None}
    return outcomes, [number for number in range(len(parts)) if number not in outcomes]


def _write(folder: Path, key: str, outcome: Outcome[Values]) -> None:
    plain = {name: v.tolist() if isinstance(v, np.ndarray) else v for name, v in (outcome.result or {}).items()}
    content = {_ERROR: outcome.error} if outcome.error else plain
    with named_errors(f'{folder}: cannot keep a finished part', OSError):
        write_whole(folder / f'{key}.json', json.dumps(content).encode())


_ERROR = 'error: '  # the only name in the file of a part that failed; no name of a value is spelled like this


def _read(kept: Kept, part: Part) -> Outcome[Values] | None:
    """The kept outcome of a part; None if there is none that can be read, or one that is to be tried again."""
    if kept.folder is None:
        return None
    try:
        found = parse_json((kept.folder / f'{part.key}.json').read_text(encoding='utf-8'), part.key)
    except (OSError, ValueError):
        return None
    if not isinstance(found, dict):
        return None
    if found.keys() == {_ERROR}:
        return None if kept.retry_failed else Outcome(None, str(found[_ERROR]))
    if found.keys() != set(part.names) or (part.output is not None and not part.output.is_dir()):
        return None
    return Outcome({name: np.array(value) if isinstance(value, list) else value for name, value in found.items()})
