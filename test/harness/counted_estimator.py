"""An estimator that counts messages, so that tests wait for events instead of time."""

from collections.abc import Callable
from typing import Any

from seal_friction_ros.core.estimation.messages import Output
from seal_friction_ros.core.estimation.pipeline import is_tick_due
from seal_friction_ros.nodes.friction_estimator import FrictionEstimator


class CountedEstimator(FrictionEstimator):
    """`FrictionEstimator` with ``taken``, the number of input messages taken, and ``sent``, the number of answers.

    ``clock`` may be set before activation: the time of receipt [ns] instead of that of the machine.
    """

    def __init__(self, **kwargs: Any) -> None:
        self.taken = self.sent = 0
        self.clock: Callable[[], int] | None = None
        super().__init__(**kwargs)

    def _receipt_clock(self) -> Callable[[], int]:
        return self.clock or super()._receipt_clock()

    @property
    def is_tick_due(self) -> bool:
        """Whether the watchdog will act at its next call."""
        return self.active and is_tick_due(self._state, self._now())

    def on_input(self, name: str, data: bytes) -> None:
        super().on_input(name, data)
        self.taken += 1

    def _send(self, answer: Output, frame_id: bytes) -> None:
        super()._send(answer, frame_id)
        self.sent += 1
