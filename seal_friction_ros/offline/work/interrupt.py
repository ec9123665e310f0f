"""Ctrl-C at any moment: where a `KeyboardInterrupt` would be lost or would break the process, it comes a moment later.

Python calls the handler of a signal between two bytecodes of whatever function runs. To return a named tuple, compiled
code calls two functions of Python: one that finds its class, and its constructor. numba does not check whether they
raise: a record that lacks a record in it ends the process with SIGSEGV. Where numba asks for the type of an argument it
drops what is raised, and Python does so in a finalizer or a callback of C: the command would go on.
"""

import atexit
import signal
import sys
from types import FrameType
from typing import Any

AGAIN = 0.001  # [s] our choice: until the next try
_UNCHECKED = (
    'namedtuple_',  # constructors
    'numba.core.serialize.',  # the class of a record
    'numba.core.dispatcher.typeof_pyval',  # the type of an argument ...
    'numba.experimental.structref.',  # ... that `compiled.keep` made
)
"""How the names of functions begin that compiled code calls without a check."""


def take_interrupts() -> None:
    """Raise `KeyboardInterrupt` in the main thread at SIGINT, as Python does, but only where it ends the command."""
    if signal.getsignal(signal.SIGINT) is not signal.default_int_handler:  # ignored, in the background of a shell
        return
    for number in (signal.SIGINT, signal.SIGALRM):
        signal.signal(number, _interrupt)
    sys.unraisablehook = _on_lost_exception
    atexit.register(signal.setitimer, signal.ITIMER_REAL, 0.0)  # after it SIGALRM would end the process


def _interrupt(_number: int, frame: FrameType | None) -> None:
    while frame is not None:
        if f'{frame.f_globals.get("__name__")}.{frame.f_code.co_name}'.startswith(_UNCHECKED):
            return _try_again()
        frame = frame.f_back
    raise KeyboardInterrupt


def _on_lost_exception(lost: Any) -> None:
    if lost.exc_type is KeyboardInterrupt:
        _try_again()
    else:
        sys.__unraisablehook__(lost)


def _try_again() -> None:
    signal.setitimer(signal.ITIMER_REAL, AGAIN)
