"""Long work in parts: parts that an interrupted run has finished are not computed again.

A part is kept under a key made from its inputs, its settings and the code that computes it, so a changed input or a new
version of the package never finds an old result.
"""

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from seal_friction_ros import core
from seal_friction_ros.offline.work.atomic_file import write_whole
from seal_friction_ros.offline.work.executor import run_all

Values = Mapping[str, Any]
"""Result of a part: numbers, texts and arrays of at least one element, by name."""


class Part(NamedTuple):
    """One independent part of a longer computation."""

    key: str  # from `part_key`
    names: tuple[str, ...]  # of the values in the result
    call: Callable[[], Any]
    """picklable function that computes the part; returns `Values`, or a named tuple with these fields"""


def part_key(kind: str, inputs: Any) -> str:
    """Key of a part.

    Args:
        kind: What the part computes.
        inputs: All inputs and settings that its result depends on, as JSON can hold them; a file by its digest.
    """
    text = f'{kind} {json.dumps(inputs, sort_keys=True)} {_code_digest()}'
    return hashlib.sha256(text.encode()).hexdigest()[:32]


@cache
def _code_digest() -> str:
    """Digest of the source of core and of the versions of the libraries that core computes with."""
    digest = hashlib.sha256(' '.join(map(version, ('numpy', 'scipy', 'numba'))).encode())
    for source in sorted(Path(str(core.__file__)).parent.rglob('*.py')):
        digest.update(source.read_bytes())
    return digest.hexdigest()


def run_parts(
    label: str, parts: Sequence[Part], workers: int, folder: Path | None, prepare: Callable[[], None] = lambda: None
) -> list[Values]:
    """Results of all parts, in their order; parts that are kept in ``folder`` are not computed.

    Args:
        label: Of the progress bar.
        parts: The parts.
        workers: Parts at a time.
        folder: Keeps every finished part as a JSON file, also when a later part fails; None keeps none.
        prepare: Called before the processes begin, if a part is missing; they inherit what it loads and compiles.

    Raises:
        ValueError: A part failed, or the folder cannot be used.
    """
    if folder is not None:
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise ValueError(f'{folder}: {error.strerror}') from None
    results = {number: kept for number, part in enumerate(parts) if (kept := _kept(folder, part)) is not None}
    missing = [number for number in range(len(parts)) if number not in results]

    def keep(place: int, result: Any) -> None:
        """Take the result of a missing part, and write its file."""
        number, values = missing[place], result._asdict() if hasattr(result, '_asdict') else result
        results[number] = values
        if folder is not None:
            plain = {name: v.tolist() if isinstance(v, np.ndarray) else v for name, v in values.items()}
            write_whole(folder / f'{parts[number].key}.json', json.dumps(plain).encode())

    if missing:
        prepare()
    run_all(label, [parts[number].call for number in missing], workers, keep)
    return [results[number] for number in range(len(parts))]


def _kept(folder: Path | None, part: Part) -> Values | None:
    """The kept result of a part; None if there is none that can be read."""
    if folder is None:
        return None
    try:
        kept = json.loads((folder / f'{part.key}.json').read_text(encoding='utf-8'))
    except (OSError, ValueError):
        return None
    if not isinstance(kept, dict) or kept.keys() != set(part.names):
        return None
    return {name: np.array(value) if isinstance(value, list) else value for name, value in kept.items()}
