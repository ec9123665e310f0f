"""Compiled code shared by all processes of the tests; to be imported before numba.

numba keeps it in a folder whose name is a hash of the sources, so every change compiles anew. One process compiles a
function; another one that needs it meanwhile waits, then loads it.
"""

import fcntl
import hashlib
import importlib.metadata
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from paths import ROOT


def cache_folder() -> str:
    """Folder for the compiled code of the present sources; removes those of other sources.

    The sources are those of core, which compiled code calls, and the modules elsewhere that compile functions.
    """
    digest = hashlib.sha256(importlib.metadata.version('numba').encode())
    for path in sorted((ROOT / 'seal_friction_ros').rglob('*.py')):
        source = path.read_bytes()
        if 'core' in path.relative_to(ROOT).parts or b'foundation.compiled import' in source:
            digest.update(source)
    folder = ROOT / 'build' / 'numba' / digest.hexdigest()[:16]
    folder.mkdir(parents=True, exist_ok=True)
    for other in folder.parent.iterdir():
        if other != folder:
            shutil.rmtree(other, ignore_errors=True)
    return str(folder)


if 'NUMBA_CACHE_DIR' not in os.environ:  # else the process that started this one has set it
    os.environ['NUMBA_CACHE_DIR'] = cache_folder()

_held: set[str] = set()
"""Functions that this process compiles: one that is compiled within itself, for other types, must not wait."""


@contextmanager
def alone(name: str) -> Iterator[None]:
    """Keep other processes from the function ``name`` while the block runs."""
    if name in _held:
        yield
        return
    locks = Path(os.environ['NUMBA_CACHE_DIR']) / 'locks'
    locks.mkdir(parents=True, exist_ok=True)
    _held.add(name)
    with (locks / name).open('w') as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        try:
            yield
        finally:
            fcntl.flock(lock, fcntl.LOCK_UN)  # closing is not enough: a process forked meanwhile has the file, too
            _held.discard(name)


def compile_in_turn() -> None:
    """Make numba compile a function that it keeps on disk in one process at a time."""
    from numba.core.dispatcher import Dispatcher  # noqa: PLC0415  NUMBA_CACHE_DIR is read first

    at_once = Dispatcher.compile

    def compile_function(self: Any, signature: Any) -> Any:
        """In the place of `Dispatcher.compile`."""
        if self._cache.cache_path is None:
            return at_once(self, signature)
        with alone(f'{self.py_func.__module__}.{self.py_func.__qualname__}'):
            return at_once(self, signature)

    Dispatcher.compile = compile_function
