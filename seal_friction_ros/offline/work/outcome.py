"""Outcome of one call: its result, or one line that says what went wrong."""

from collections.abc import Callable
from typing import Any, Generic, NamedTuple, TypeVar

Result = TypeVar('Result')
CRASHED = 'its process ended before it was done: is there enough memory?'
THREAD_VARIABLES = tuple(f'{library}_NUM_THREADS' for library in ('OPENBLAS', 'MKL', 'OMP'))
"""environment variables of the number of threads of linear algebra: the last bits of a sum depend on it"""


class Outcome(NamedTuple, Generic[Result]):
    """Outcome of one call."""

    result: Result | None
    error: str = ''  # one line; empty if there is a result


def outcome_of(call: Callable[[], Any]) -> Outcome[Any]:
    """Outcome of a call; raises what is no expected error, and BrokenPipeError if who reads the result has gone."""
    try:
        return Outcome(call())
    except BrokenPipeError:
        raise
    except (ValueError, OSError) as error:
        return Outcome(None, error_text(error))


def error_text(error: ValueError | OSError) -> str:
    """One line for an expected error."""
    if isinstance(error, OSError) and error.strerror:
        return f'{error.filename}: {error.strerror}' if error.filename else error.strerror
    return str(error)
