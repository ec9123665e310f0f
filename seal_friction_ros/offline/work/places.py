"""Inputs of a command: paths, URLs of fsspec, and the bags of a folder or of a list.

What a URL names is copied to the computer that reads it, while it reads. fsspec is loaded by the first URL, never
before. What speaks a protocol is the user's: ``s3://`` needs the package s3fs where the bag is read, and its
credentials there.
"""

import hashlib
import json
import os
import re
import signal
import sys
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from urllib.parse import unquote, urlsplit

from seal_friction_ros.offline.work.outcome import error_text
from seal_friction_ros.packages import MissingPackageError, needed

Place = Path | str  # path of a file or folder, or a URL

_URL = re.compile(r'[A-Za-z][A-Za-z0-9+.:-]*://.+')
_VERSION = ('etag', 'md5', 'md5hash', 'contentmd5', 'crc32c', 'checksum', 'mtime', 'lastmodified', 'modified')
"""entries of a listing that change with a file, in lower case letters alone"""


def place_of(text: str) -> Place:
    """What a text names: a URL, or a path; ``file://`` is a path. ValueError if it is that of another computer."""
    if not _URL.fullmatch(text):
        return Path(text)
    parts = urlsplit(text)
    if parts.scheme != 'file':
        return text
    if parts.netloc not in ('', 'localhost'):
        raise ValueError(f'{text} is a file of computer {parts.netloc}: write file:///PATH, as this computer sees it')
    return Path(unquote(parts.path))


def name_of(place: Place) -> str:
    """Name of a folder, or of a file without its suffix; the last part of a URL always is without."""
    if isinstance(place, str):
        return Path(place.rstrip('/').rpartition('/')[2]).stem
    path = place.resolve()
    return path.name if path.is_dir() else path.stem


def with_name(place: Place, error: str) -> str:
    """An error that names the place."""
    return error if str(place) in error else f'{place}: {error}'


@contextmanager
def as_path(place: Place) -> Iterator[Path]:
    """Path of a file or bag, in the block; of a URL a copy, which is removed after the block.

    Raises MissingPackageError without fsspec; ValueError, in one line that names it, if the URL cannot be read. Errors
    of the block name it, too, and not the copy.
    """
    if isinstance(place, Path):
        yield place
        return
    with _ended_in_order(), TemporaryDirectory(prefix='seal_friction_') as folder:
        path = _copied(place, Path(folder))
        try:
            yield path
        except (ValueError, OSError) as error:
            raise ValueError(error_text(error).replace(str(path), place)) from None


def url_digest(url: str) -> str:
    """Digest of what tells that the files of a URL have changed: as their store lists them, else their content.

    Raises as `as_path`.
    """
    with _as_one_line(url):
        system, _, files = _listed(url)
        versions = [[name, _version(details) or _content(system, name)] for name, details in sorted(files.items())]
    return hashlib.sha256(json.dumps(versions).encode()).hexdigest()


def _listed(url: str) -> tuple[Any, str, Mapping[str, Mapping[str, Any]]]:
    """File system, place in it, and details of the file, or of each file of the bag, there."""
    system, place = needed('fsspec.core').url_to_fs(url)
    files = system.find(place, maxdepth=1, detail=True)
    if not files:
        raise FileNotFoundError
    if not system.isfile(place) and not any(name.endswith('/metadata.yaml') for name in files):
        raise ValueError('not a rosbag2 bag: there is no metadata.yaml')
    return system, place, files


def _version(details: Mapping[str, Any]) -> str:
    """Version of a file as its store lists it; empty if the store does not tell."""
    by_name = {re.sub('[^a-z0-9]', '', name.lower()): value for name, value in details.items() if value is not None}
    found = [f'{name} {by_name[name]}' for name in _VERSION if name in by_name]
    return ' '.join([*found, f'size {by_name.get("size")}']) if found else ''


def _content(system: Any, name: str) -> str:
    with system.open(name, 'rb') as file:
        return hashlib.file_digest(file, 'sha256').hexdigest()


def _copied(url: str, folder: Path) -> Path:
    """Copy of the file, or of the files of the bag, that a URL names."""
    with _as_one_line(url):
        system, place, files = _listed(url)
        target = folder / (Path(place).name or 'bag')
        if system.isfile(place):
            system.get_file(place, str(target))
            return target
        target.mkdir()
        for name in files:
            system.get_file(name, str(target / Path(name).name))
    return target


@contextmanager
def _as_one_line(url: str) -> Iterator[None]:
    """Make one line of whatever a file system raises."""
    try:
        yield
    except MissingPackageError:
        raise
    except FileNotFoundError:
        raise ValueError(f'{url}: there is no such file or bag') from None
    except Exception as error:  # noqa: BLE001  of a plugin of the user
        reason = (str(error).splitlines() or [''])[0] or type(error).__name__
        raise ValueError(f'{url}: cannot be read: {reason}') from None


@contextmanager
def _ended_in_order() -> Iterator[None]:
    """Let a signal that ends this process end the block first, so that no copy is left."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    signals = [one for one in (signal.SIGTERM, signal.SIGINT) if signal.getsignal(one) is signal.SIG_DFL]
    try:
        for one in signals:
            signal.signal(one, lambda number, _: sys.exit(128 + number))
        yield
    finally:
        for one in signals:
            signal.signal(one, signal.SIG_DFL)


# -- many bags ---------------------------------------------------------------------------------------------------------

_FILES = ('.mcap', '.db3')
_LONGEST_LIST = 100 << 20  # [bytes] our choice


def find_bags(where: Path) -> list[Place]:
    """Bags below a folder, sorted by path, or in a text file, in its order; each once.

    In a file every line is the path of a bag, relative to the folder of the file, or a URL; empty lines and those that
    begin with ``#`` do not count. A path of a list need not exist: the computation on it says what is wrong.

    Raises ValueError if there is no bag, or the file is no list; OSError if it cannot be read.
    """
    found: list[Place] = [*sorted(_below(where))] if where.is_dir() else list(_in_list(where))
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


def _in_list(file: Path) -> Iterator[Place]:
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
