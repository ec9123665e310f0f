"""An estimator that counts messages, so that tests wait for events instead of time."""

from typing import Any

from seal_friction_ros.core.estimation.messages import Output
from seal_friction_ros.nodes.friction_estimator import FrictionEstimator


class CountedEstimator(FrictionEstimator):
    """`FrictionEstimator` with ``taken``, the number of input messages taken, and ``sent``, the number of answers."""

    def __init__(self, **kwargs: Any) -> None:
        self.taken = self.sent = 0
        super().__init__(**kwargs)

    def _on_input(self, name: str, data: bytes) -> None:
        super()._on_input(name, data)
        self.taken += 1

    def _send(self, answer: Output, frame_id: bytes) -> None:
        super()._send(answer, frame_id)
        self.sent += 1
