"""Periodic look of a node at itself, at the cost of a comparison for each message."""

import threading
import time
from collections.abc import Callable

from rclpy.node import Node

GRACE = 2_000_000  # [ns] in which a message is awaited before the executor has to look; messages at 500 Hz come in time

_FIRST_PERIOD = 10_000_000  # [ns] until the first call
_NEVER = 1 << 62  # [ns]


class Watchdog:
    """Calls a function every period, while messages come after one of them, and otherwise from the executor.

    A timer of rclpy wakes two threads at each call, the executor among them. Here a thread of its own sleeps until the
    function is late by `GRACE`, which does not happen while messages come, and only then asks the executor.

    Args:
        node: Its executor calls the function.
        look: What is called, with the time [ns] of `time.perf_counter_ns`; returns the period until the next call [ns].
    """

    def __init__(self, node: Node, look: Callable[[int], int]) -> None:
        self._node, self._look = node, look
        self.due = _NEVER
        """when to call the function [ns] of `time.perf_counter_ns`; never before `start` and after `stop`"""
        self._period = _FIRST_PERIOD
        self._is_asked = False
        self._failure: Exception | None = None
        self._wake = threading.Event()
        self._thread: threading.Thread | None = None

    def start(self) -> None:
        """Begin to look."""
        self._period, self._is_asked, self._failure = _FIRST_PERIOD, False, None
        self.due = time.perf_counter_ns() + self._period
        self._thread = threading.Thread(target=self._run, name='watchdog', daemon=True)
        self._thread.start()

    def call_if_due(self, now: int) -> bool:
        """Call the function if it is time, after a message; whether it was.

        Args:
            now: [ns] of `time.perf_counter_ns`.
        """
        if now < self.due:
            return False
        self.due = now + self._period  # also if the function raises
        period = self._look(now)
        if self.due != _NEVER:  # the function may have stopped all this
            self.due = now + period
        if period < self._period:  # the thread sleeps longer
            self._wake.set()
        self._period = period
        return True

    def check(self) -> None:
        """Raise what a call from the executor has raised: the events executor does not raise what its tasks do."""
        if self._failure is not None:
            raise self._failure

    def stop(self) -> None:
        """Call nothing from now on, not even what the executor was asked for; ends the thread."""
        self.due = _NEVER
        thread, self._thread = self._thread, None
        if thread is not None:
            self._wake.set()
            thread.join()

    def _run(self) -> None:
        while self._thread is not None:
            wait = self.due + GRACE - time.perf_counter_ns()
            if wait <= 0:
                wait = self._period + GRACE
                self._ask()
            self._wake.wait(min(wait * 1e-9, threading.TIMEOUT_MAX))
            self._wake.clear()

    def _ask(self) -> None:
        """Ask the executor; this thread must not keep it for longer, since its end belongs to the thread that spins."""
        executor = self._node.executor
        if executor is not None and not self._is_asked:
            self._is_asked = True
            executor.create_task(self._on_silence)

    def _on_silence(self) -> None:
        self._is_asked = False
        try:
            self.call_if_due(time.perf_counter_ns())
        except Exception as error:  # noqa: BLE001  see `check`
            self._failure = error
