"""The command that runs: its command line as typed, and one line on a terminal that says what is being done."""

import shlex
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar

_typed: ContextVar[str] = ContextVar('typed', default='')
_CLEAR = '\r\x1b[K'


def show_status(text: str) -> None:
    """Show in one line what is being done, in place of the line before; only on a terminal."""
    if sys.stderr.isatty():
        sys.stderr.write(f'{_CLEAR}{text}')
        sys.stderr.flush()


@contextmanager
def as_typed(arguments: Sequence[str]) -> Iterator[None]:
    """Remember in the block how the command was called, for its pages."""
    token = _typed.set(shlex.join(['seal_friction', *arguments]))
    try:
        yield
    finally:
        _typed.reset(token)


def command_line() -> str:
    """The command as it was typed; empty if this process runs none."""
    return _typed.get()
