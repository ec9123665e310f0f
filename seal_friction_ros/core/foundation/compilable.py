"""Functions of the estimator that replay also runs compiled: the same source, the same bytes, two hundred times faster.

Live they are plain Python, and nothing here imports the compiler, which would double the time the node takes to start.
"""

from collections.abc import Callable
from typing import Any, TypeVar

Function = TypeVar('Function', bound=Callable[..., Any])

COMPILABLE: list[Callable[..., Any]] = []
"""All of them; `core.bulk` has them compiled."""


def compilable(function: Function) -> Function:
    """Decorator: ``function`` uses numbers and named tuples of numbers only, so it can be compiled as it stands.

    Where the order of two values decides, it compares them by ``if``: ``min`` and ``max`` of a compiler may choose
    another one of two zeros, or of a number and NaN, than Python does.
    """
    COMPILABLE.append(function)
    return function
