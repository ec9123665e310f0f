"""Compile a numeric function that is written in plain Python on floats, tuples and arrays: twenty times faster.

The Python function stays the readable reference: with ``NUMBA_DISABLE_JIT=1`` in the environment it runs as it is and
gives the same numbers (test/core/test_servo_compiled.py).
"""

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba

Function = TypeVar('Function', bound=Callable[..., Any])


def compiled(function: Function) -> Function:
    """Decorator: ``function`` compiled at its first call.

    No fast-math: sums keep their order, so both ways round alike. Not kept on disk: numba looks only at the file of a
    function, not at the files of those it calls, so a change there would go unseen.
    """
    return cast(Function, numba.njit(error_model='numpy')(function))
