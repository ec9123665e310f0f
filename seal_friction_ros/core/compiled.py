"""Compile a numeric function where numba is installed; leave it as it is where not.

The function is written once, in plain Python on floats and tuples, and is the readable reference of itself: with numba
it runs some twenty times faster, without it gives the same numbers (test/core/test_servo_compiled.py). Set
``NUMBA_DISABLE_JIT=1`` to have it as Python although numba is there.
"""

import hashlib
from collections.abc import Callable
from importlib.util import find_spec
from os import environ
from pathlib import Path
from typing import Any, TypeVar, cast

import numpy as np

Function = TypeVar('Function', bound=Callable[..., Any])

COMPILED = find_spec('numba') is not None and environ.get('NUMBA_DISABLE_JIT', '0') in ('', '0')
"""Whether functions are compiled in this process."""


def compiled(function: Function) -> Function:
    """Decorator: ``function`` compiled at its first call and kept on disk; ``function`` itself without numba.

    No fast-math: sums keep their order, so both ways round alike.
    """
    if not COMPILED:
        return function
    import numba  # noqa: PLC0415  optional

    before = numba.config.CACHE_DIR
    numba.config.CACHE_DIR = before or str(_cache_folder())
    try:
        return cast(Function, numba.njit(cache=True, error_model='numpy')(function))
    finally:
        numba.config.CACHE_DIR = before


def table(values: list[float]) -> Any:
    """Values as the compiled functions want them: an array for numba, a list (ten times faster there) for Python."""
    return np.array(values) if COMPILED else values


def _cache_folder() -> Path:
    """Folder of the user's cache, one for each version of this package's sources.

    numba looks only at the file of a function, not at the files of those it calls: a change there would go unseen.
    """
    sources = b''.join(path.read_bytes() for path in sorted(Path(__file__).parent.glob('*.py')))
    base = environ.get('XDG_CACHE_HOME') or str(Path.home() / '.cache')
    return Path(base) / 'seal_friction_ros' / hashlib.sha256(sources).hexdigest()[:16]
