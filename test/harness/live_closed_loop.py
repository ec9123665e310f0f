"""A closed loop recorded live: simulated servo and estimator, first without feed-forward, then with it."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.context import Context
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.parameter_client import AsyncParameterClient
from seal_friction_msgs.msg import FrictionEstimate

from harness.compensation import LIVE, SCALE
from harness.processes import node_process
from harness.spin_nodes import SpunNodes, ros_context

_SCALE = 'feedforward.scale'


class Operator(SpunNodes):
    """Reads the diagnostics of both nodes and sets parameters of the estimator."""

    def __init__(self, context: Context) -> None:
        self.node = Node('operator', context=context)
        super().__init__(context, self.node)
        self.diagnostics: dict[str, str] = {}
        self.is_estimating = False
        self._first = self.node.create_subscription(
            FrictionEstimate, 'friction_estimate', self._on_estimate, 1, raw=True
        )
        self.node.create_subscription(DiagnosticArray, '/diagnostics', self._on_diagnostics, 10)
        self._estimator = AsyncParameterClient(self.node, 'friction_estimator')

    def _on_estimate(self, _: bytes) -> None:
        self.is_estimating = True
        self.node.destroy_subscription(self._first)  # the first estimate is enough

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            self.diagnostics |= {value.key: value.value for value in status.values}

    def set_scale(self, scale: float) -> None:
        """Set the share of the Coulomb friction that is compensated.

        Raises:
            RuntimeError: The estimator does not answer or rejects the value.
        """
        future = self._estimator.set_parameters([Parameter(_SCALE, value=scale)])
        if not self.spin_until(future.done) or not all(result.successful for result in future.result().results):
            raise RuntimeError(f'friction_estimator did not accept {_SCALE} = {scale}')


@contextmanager
def operator_on(domain: int) -> Iterator[Operator]:
    """An operator on a ROS domain."""
    with ros_context(domain) as context:
        operator = Operator(context)
        try:
            yield operator
        finally:
            operator.node.destroy_node()


def record_closed_loop(out: Path, domain: int, seconds: float, simulator: Path, priority: int = 0) -> dict[str, str]:
    """Run simulator and estimator in processes of their own and record both parts, without and with feed-forward.

    Args:
        out: Bag to record; must not exist.
        domain: ROS domain.
        seconds: Duration of each part [s].
        simulator: ROS parameter file of the simulator.
        priority: Real-time priority of both nodes; 0: none.

    Returns:
        The last values of both nodes on ``/diagnostics``.

    Raises:
        RuntimeError: No estimate came or there is no recording; with the output of the processes.
    """
    out.parent.mkdir(parents=True, exist_ok=True)
    log = out.with_suffix('.log')
    recording = {'record': True, 'record_directory': str(out.parent), 'record_name': out.name}
    realtime = {'realtime_priority': priority}
    with (
        node_process('friction_estimator', domain, {**LIVE, **recording, **realtime, _SCALE: 0.0}, log),
        node_process('servo_simulator', domain, realtime, log, parameter_file=simulator),
        operator_on(domain) as operator,
    ):
        if not operator.spin_until(lambda: operator.is_estimating):  # the simulator compiles first
            raise RuntimeError(f'no estimate; {log}: {log.read_text().strip()}')
        operator.spin(seconds)
        operator.set_scale(SCALE)
        operator.spin(seconds)
        diagnostics = dict(operator.diagnostics)
    if not (out / 'metadata.yaml').is_file():
        raise RuntimeError(f'nothing recorded; {log}: {log.read_text().strip()}')
    return diagnostics
