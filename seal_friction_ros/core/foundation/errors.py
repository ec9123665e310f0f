"""Errors in one line, which says where; and what an iteration raises that found no solution, never a number."""

from collections.abc import Iterator
from contextlib import contextmanager


class NotConvergedError(ValueError):
    """No solution was found; the message says where, and how far it came."""


@contextmanager
def named_errors(
    where: object, caught: type[Exception] = ValueError, raised: type[ValueError] = ValueError
) -> Iterator[None]:
    """Convert an error of the block to ``where: reason``; one that already is of another type ``raised`` passes."""
    try:
        yield
    except caught as error:
        if raised not in (ValueError, caught) and isinstance(error, raised):
            raise
        reason = error.strerror if isinstance(error, OSError) else None
        raise raised(f'{where}: {reason or error}') from None
