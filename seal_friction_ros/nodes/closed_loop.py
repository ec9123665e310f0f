"""The loop closed live: simulated servo and estimator on one graph, first without feed-forward, then with it."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.parameter_client import AsyncParameterClient
from seal_friction_msgs.msg import FrictionEstimate

from seal_friction_ros.core.estimation.feedforward import FeedForwardSettings
from seal_friction_ros.nodes.discovery import set_up_discovery
from seal_friction_ros.nodes.processes import running

_START = 60.0  # [s] for the simulator to compile and the first estimate to come
_SCALE = 'feedforward.coulomb_scale'


class _Operator(Node):
    """Reads diagnostics and sets parameters, as a person would."""

    def __init__(self, context: Context) -> None:
        super().__init__('operator', context=context)
        self.said: dict[str, str] = {}
        self.estimating = False
        self._first = self.create_subscription(FrictionEstimate, 'friction_estimate', self._on_estimate, 1, raw=True)
        self.create_subscription(DiagnosticArray, '/diagnostics', self._on_diagnostics, 10)
        self._estimator = AsyncParameterClient(self, 'friction_estimator')
        self._executor = SingleThreadedExecutor(context=context)
        self._executor.add_node(self)

    def _on_estimate(self, _: bytes) -> None:
        self.estimating = True
        self.destroy_subscription(self._first)  # one is enough

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            self.said |= {value.key: value.value for value in status.values}

    def wait(self, seconds: float) -> None:
        """Let time pass [s]."""
        until = time.monotonic() + seconds
        while (left := until - time.monotonic()) > 0.0:
            self._executor.spin_once(timeout_sec=left)

    def set_scale(self, scale: float) -> None:
        """Set the share of the Coulomb friction that is compensated.

        Raises:
            RuntimeError: The estimator does not answer, or refuses.
        """
        future = self._estimator.set_parameters([Parameter(_SCALE, value=scale)])
        self._executor.spin_until_future_complete(future, timeout_sec=10.0)
        if not future.done() or not all(result.successful for result in future.result().results):
            raise RuntimeError(f'friction_estimator did not take {_SCALE} = {scale}')


@contextmanager
def _operator(domain: int) -> Iterator[_Operator]:
    set_up_discovery()
    context = Context()
    rclpy.init(context=context, domain_id=domain)
    node = _Operator(context)
    try:
        yield node
    finally:
        node.destroy_node()
        rclpy.try_shutdown(context=context)


def close_loop_live(out: Path, domain: int, seconds: float, simulator: Path, priority: int = 0) -> dict[str, str]:
    """Run simulator and estimator in separate processes and record: first without feed-forward, then as long with it.

    Args:
        out: Bag to record; must not exist.
        domain: ROS domain.
        seconds: How long each half lasts [s].
        simulator: ROS parameter file of the simulator.
        priority: Real-time priority of both; 0: none.

    Returns:
        What the two nodes said last on ``/diagnostics``.

    Raises:
        RuntimeError: No estimate came, or there is no recording; with what the processes said.
    """
    out.parent.mkdir(parents=True, exist_ok=True)
    log = out.with_suffix('.log')
    recording = {'record': True, 'record_directory': str(out.parent), 'record_name': out.name}
    realtime = {'realtime_priority': priority}
    with (
        running('friction_estimator', domain, {**recording, **realtime, _SCALE: 0.0}, log),
        running('servo_simulator', domain, realtime, log, parameter_file=simulator),
        _operator(domain) as operator,
    ):
        start = time.monotonic()
        while not operator.estimating:
            if time.monotonic() > start + _START:
                raise RuntimeError(f'no estimate within {_START} s; {log}: {log.read_text().strip()}')
            operator.wait(0.1)
        operator.wait(seconds)
        operator.set_scale(FeedForwardSettings().coulomb_scale)
        operator.wait(seconds)
        said = dict(operator.said)
    if not (out / 'metadata.yaml').is_file():
        raise RuntimeError(f'nothing recorded; {log}: {log.read_text().strip()}')
    return said
