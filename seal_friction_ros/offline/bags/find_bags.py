"""The bags of a fleet: all below a folder, or those of a list."""

import os
from collections.abc import Iterator
from pathlib import Path

from seal_friction_ros.offline.work.places import Place, place_of

_FILES = ('.mcap', '.db3')
_LONGEST_LIST = 100 << 20  # [bytes] our choice


def find_bags(where: Path) -> list[Place]:
    """Bags below a folder, sorted by path, or in a text file, in its order; each once.

    In a file every line is the path of a bag, relative to the folder of the file, or a URL; empty lines and those that
    begin with ``#`` do not count. A path of a list need not exist: the computation on it says what is wrong.

    Raises ValueError if there is no bag, or the file is no list; OSError if it cannot be read.
    """
    found: list[Place] = [*sorted(_below(where))] if where.is_dir() else list(_listed(where))
    known: dict[str, Place] = {}
    for bag in found:
        known.setdefault(bag if isinstance(bag, str) else os.path.realpath(bag), bag)
    if not known:
        raise ValueError(
            f'{where}: no bag in it: give a folder with bags below it, or a text file with one path a line'
        )
    return list(known.values())


def _below(folder: Path) -> Iterator[Path]:
    """Every bag folder, every bag file outside of one, and every folder that cannot be read; no link to a folder."""
    unreadable: list[OSError] = []
    for place, folders, files in os.walk(folder, onerror=unreadable.append):
        if 'metadata.yaml' in files:
            folders.clear()
            yield Path(place)
        else:
            yield from (Path(place, file) for file in files if Path(file).suffix in _FILES)
    yield from (Path(str(error.filename)) for error in unreadable)


def _listed(file: Path) -> Iterator[Place]:
    if file.stat().st_size > _LONGEST_LIST:
        raise ValueError(f'{file}: larger than {_LONGEST_LIST >> 20} MB: no list of bags')
    try:
        text = file.read_text(encoding='utf-8')
    except UnicodeDecodeError:
        raise ValueError(f'{file}: no text in UTF-8: a list has the path of a bag in each line') from None
    for line in map(str.strip, text.splitlines()):
        if line and not line.startswith('#'):
            if not line.isprintable():
                raise ValueError(f'{file}: {line[:60]!r} is no path: a list has the path of a bag in each line')
            place = place_of(line)
            yield place if isinstance(place, str) else file.parent / place
