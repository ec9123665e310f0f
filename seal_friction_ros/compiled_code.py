"""Compiled code is kept on disk, so that a command compiles once for each version and not at each start.

It is in ``$XDG_CACHE_HOME/seal_friction_ros``, by default ``~/.cache/seal_friction_ros``, in a folder whose name is a
hash of path, size and time of the sources: a change compiles anew. ``NUMBA_CACHE_DIR`` names another folder. Where none
can be written, nothing is kept. What stands there is run: a folder that another user could write to is refused with one
line, and nothing is kept.
"""

import fcntl
import hashlib
import os
import shutil
import stat
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path

from seal_friction_ros.core.foundation.compiled import CompilerHooks, set_hooks

VARIABLE = 'NUMBA_CACHE_DIR'
KEPT_FOR = 30.0  # [days] after its last use the code of another version is removed
_DAY = 86400.0  # [s]
_HERE = Path(__file__).parent


def keep_compiled_code(parent: Path | None = None) -> None:
    """Keep what is compiled from now on; to be called before anything is compiled.

    Child processes take the same folder. One process compiles a function; another one that needs it meanwhile waits,
    then loads it.

    Args:
        parent: Folder of the folders; None: that of the user.
    """
    set_hooks(CompilerHooks(partial(use_folder, parent), _alone))


def use_folder(parent: Path | None) -> None:
    """Name the folder for numba, if none is named; in ``parent``, or in that of the user."""
    if VARIABLE in os.environ:
        if _is_refused(Path(os.environ[VARIABLE])):
            _set_folder('')
        return
    try:
        above = parent or _folder_of_user()
        folder = above / key_of(_HERE)
        above.parent.mkdir(parents=True, exist_ok=True)
        for one in (above, folder, folder / 'locks'):
            one.mkdir(mode=0o700, exist_ok=True)
            if _is_refused(one):
                return
        os.utime(folder)
        _remove_old(folder)
    except (OSError, RuntimeError):  # the latter: there is no home
        return
    _set_folder(str(folder))


def _is_refused(folder: Path) -> bool:
    """Whether a folder exists that another user owns or may write to; says so."""
    try:
        found = folder.stat()
    except OSError:
        return False
    if found.st_uid == os.geteuid() and not found.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        return False
    whose = 'others may write there' if found.st_uid == os.geteuid() else 'it belongs to another user'
    sys.stderr.write(f'compiled code is not kept in {folder}: {whose}; make it yours alone (chmod go-w)\n')
    return True


def _set_folder(folder: str) -> None:
    """Name the folder for numba, loaded or not; empty: none."""
    if folder:
        os.environ[VARIABLE] = folder
    else:
        del os.environ[VARIABLE]
    if 'numba' in sys.modules:
        sys.modules['numba'].config.CACHE_DIR = folder


def _folder_of_user() -> Path:
    return Path(os.environ.get('XDG_CACHE_HOME') or Path.home() / '.cache') / 'seal_friction_ros'


def key_of(sources: Path) -> str:
    """Hash of path, size and time of the Python files in a folder."""
    digest = hashlib.sha256()
    for path in sorted(sources.rglob('*.py')):
        found = path.stat()
        digest.update(f'{path} {found.st_size} {found.st_mtime_ns}\n'.encode())
    return digest.hexdigest()[:16]


def _remove_old(folder: Path) -> None:
    for other in folder.parent.iterdir():
        with suppress(OSError):  # another process removes it, too
            if other != folder and time.time() - other.stat().st_mtime > KEPT_FOR * _DAY:
                shutil.rmtree(other, ignore_errors=True)


_held: set[str] = set()
"""Functions that this process compiles: one that is compiled within itself, for other types, must not wait."""


@contextmanager
def _alone(name: str) -> Iterator[None]:
    """Keep other processes from compiling the function ``name``: numba would mix up the files of two that write."""
    if name in _held:
        yield
        return
    locks = Path(os.environ[VARIABLE]) / 'locks'
    locks.mkdir(parents=True, exist_ok=True)
    _held.add(name)
    with (locks / name).open('w') as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        try:
            yield
        finally:
            fcntl.flock(lock, fcntl.LOCK_UN)  # closing is not enough: a process forked meanwhile has the file, too
            _held.discard(name)
