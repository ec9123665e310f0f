"""Progress of long-running work: a bar on stderr, or a report to the parent process."""

import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import TypeVar

from seal_friction_ros.offline.work.status import show_status

try:
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
except ModuleNotFoundError:
    HAS_BAR = False
else:
    HAS_BAR = True

Item = TypeVar('Item')
_SMALLEST_SHARE = 0.01  # of a call: a worker process reports no smaller progress (our choice)
_REFRESH_PERIOD = 0.1  # [s]

_report_share: Callable[[float], None] | None = None  # set in a worker process


def report_shares_to(report: Callable[[float], None]) -> None:
    """Make `progress` in this process call ``report`` with the share done since the last call, instead of a bar."""
    global _report_share  # noqa: PLW0603  one per process, like stderr
    _report_share = report


@contextmanager
def progress(label: str, total: int | None) -> Iterator[Callable[[float], None]]:
    """Show a bar on stderr while the block runs, if stderr is a terminal and the package rich is installed.

    No thread draws the bar, so that a process may fork inside the block. ``total`` is the number of steps, None if
    unknown. Yields a function to call with the number of steps done since the last call.
    """
    if _report_share is not None:
        yield _shares(total, _report_share)
        return
    if not HAS_BAR:
        yield lambda _: None
        return
    show_status('')
    console = Console(stderr=True)
    if not console.is_terminal:  # a bar that is only disabled still ends in an empty line before rich 14
        yield lambda _: None
        return
    columns = (TextColumn('{task.description}'), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True, auto_refresh=False) as bar:
        task = bar.add_task(label, total=total)
        refreshed = time.monotonic()

        def advance(steps: float) -> None:
            """Move the bar on."""
            nonlocal refreshed
            bar.advance(task, steps)
            if time.monotonic() > refreshed + _REFRESH_PERIOD:
                bar.refresh()
                refreshed = time.monotonic()

        yield advance
    show_status('...')


def counted(items: Iterable[Item], advance: Callable[[float], None]) -> Iterator[Item]:
    """The items as they are; calls ``advance`` after each thousand of them."""
    for count, item in enumerate(items, start=1):
        if count % 1000 == 0:
            advance(1000)
        yield item


def _shares(total: int | None, report: Callable[[float], None]) -> Callable[[float], None]:
    pending = 0.0

    def advance(steps: float) -> None:
        """Collect steps and report them by whole shares."""
        nonlocal pending
        pending += steps / total if total else 0.0
        if abs(pending) >= _SMALLEST_SHARE:
            report(pending)
            pending = 0.0

    return advance
