"""An estimator that counts messages, so that tests wait for events instead of time."""

import time
from collections.abc import Callable
from typing import Any

from seal_friction_ros.core.machine.machine import due
from seal_friction_ros.core.messages.records import FeedForward, Output
from seal_friction_ros.nodes.friction_estimator import FrictionEstimator


class CountedEstimator(FrictionEstimator):
    """`FrictionEstimator` with the numbers of input messages ``taken``, and of answers ``sent``, ``forces`` among them.

    ``clock`` may be set before activation: the time of receipt [ns] instead of that of the machine. Messages are sent
    at their receipt then, and no clock is followed.
    """

    def __init__(self, **kwargs: Any) -> None:
        self.taken = self.sent = self.forces = 0
        self.clock: Callable[[], int] | None = None
        super().__init__(**kwargs)

    def now(self) -> int:
        return self.clock() if self.clock else super().now()

    def _follow_clock(self, offset: int) -> None:
        if self.clock is None:
            super()._follow_clock(offset)

    @property
    def is_tick_due(self) -> bool:
        """Whether the watchdog will act at its next call."""
        return self.active and bool(due(self._state, self.now()))

    def on_input(self, name: str, data: bytes, lateness: int) -> None:
        super().on_input(name, data, 0 if self.clock else lateness)
        self.taken += 1

    def fade_out(self) -> None:
        """Fade with the time of the machine: a clock of the test stands still meanwhile."""
        kept = self.clock
        if kept is not None:
            begin = kept() - time.monotonic_ns()
            self.clock = lambda: begin + time.monotonic_ns()
        super().fade_out()
        self.clock = kept

    def _send(self, outputs: Any, answer: Output, frame_id: bytes) -> None:
        super()._send(outputs, answer, frame_id)
        self.sent += 1
        self.forces += isinstance(answer, FeedForward)
