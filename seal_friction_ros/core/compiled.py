"""Compile a numeric function where numba is installed; leave it as it is where not.

The function is written once, in plain Python on floats and tuples, and is the readable reference of itself: with numba
it runs some twenty times faster, without it gives the same numbers (test/core/test_servo_compiled.py).
"""

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numpy as np

try:
    import numba
except ImportError:  # an extra: nothing but speed depends on it
    numba = None

Function = TypeVar('Function', bound=Callable[..., Any])

COMPILED = numba is not None
"""Whether functions are compiled in this process."""


def compiled(function: Function) -> Function:
    """Decorator: ``function`` compiled at its first call; ``function`` itself without numba.

    No fast-math: sums keep their order, so both ways round alike. Not kept on disk: numba looks only at the file of a
    function, not at the files of those it calls, so a change there would go unseen.
    """
    if not COMPILED:
        return function
    return cast(Function, numba.njit(error_model='numpy')(function))


def table(values: list[float]) -> Any:
    """Values as the compiled functions want them: an array for numba, a list (ten times faster there) for Python."""
    return np.array(values) if COMPILED else values
