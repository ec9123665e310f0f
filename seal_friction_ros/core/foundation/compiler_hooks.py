"""What else happens when code is compiled, set by those who know files: see `seal_friction_ros.compiled_code`."""

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from typing import NamedTuple

AloneWith = Callable[[str], AbstractContextManager[None]]


class CompilerHooks(NamedTuple):
    """Functions that are called around the work of the compiler."""

    before_loading: Callable[[], None]  # called before the compiler is loaded
    alone_with: AloneWith  # gives the context in which the function of a name is compiled, and written to disk


_hooks = [CompilerHooks(lambda: None, lambda _: nullcontext())]


def set_hooks(hooks: CompilerHooks) -> None:
    """Use ``hooks`` from now on."""
    _hooks[:] = [hooks]


def hooks() -> CompilerHooks:
    """The hooks in use."""
    return _hooks[0]
