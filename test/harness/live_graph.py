"""The estimator on a graph of its own, with a probe that publishes its inputs and collects its outputs."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.context import Context
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from seal_friction_msgs.msg import (
    CylinderPressure,
    EstimatorConfiguration,
    ForceSum,
    FrictionEstimate,
    RodVelocity,
)

from harness.counted_estimator import CountedEstimator
from harness.spin_nodes import SpunNodes, ros_context
from seal_friction_ros.core.estimation.estimator import EstimatorSettings
from seal_friction_ros.core.estimation.feedforward import FeedForwardSettings

DEFAULTS = {
    'stamp_age_max': EstimatorSettings().stamp_age_max,
    'feedforward.lateness_max': FeedForwardSettings().lateness_max,
}
"""Parameters of a graph on which time matters, see `graph`."""


class Probe(Node):
    """In the place of drivers and controller."""

    def __init__(self, qos: QoSProfile | int = 10, **kwargs: Any) -> None:
        super().__init__('probe', **kwargs)
        self.pressure = self.create_publisher(CylinderPressure, 'cylinder_pressure', qos)
        self.force = self.create_publisher(ForceSum, 'force_sum', qos)
        self.velocity = self.create_publisher(RodVelocity, 'rod_velocity', qos)
        self.estimates: list[FrictionEstimate] = []
        self.diagnostics: list[DiagnosticArray] = []
        self.configurations: list[EstimatorConfiguration] = []
        self.create_subscription(FrictionEstimate, 'friction_estimate', self.estimates.append, 100)
        self.create_subscription(DiagnosticArray, '/diagnostics', self.diagnostics.append, 10)
        latched = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.create_subscription(
            EstimatorConfiguration, 'friction_estimator/configuration', self.configurations.append, latched
        )

    def send(self, stamp: int, velocity: float, pressure: float = 1e6, force: float = 0.0) -> None:
        """Publish pressure [Pa], force sum [N] and velocity [m/s] of one moment, ``stamp`` [ns]."""
        self.send_pressure(stamp, pressure)
        self.send_force(stamp, force)
        self.send_velocity(stamp, velocity)

    def send_pressure(self, stamp: int, pressure: float) -> None:
        message = CylinderPressure(chamber_a=pressure, chamber_b=pressure)
        self.pressure.publish(stamped(message, stamp))

    def send_force(self, stamp: int, force: float) -> None:
        self.force.publish(stamped(ForceSum(force=force), stamp))

    def send_velocity(self, stamp: int, velocity: float) -> None:
        self.velocity.publish(stamped(RodVelocity(velocity=velocity), stamp))

    def values(self, part: str) -> dict[str, str]:
        """Newest diagnostics of ``estimate`` or ``recorder``: values by key, level and message."""
        for array in reversed(self.diagnostics):
            for status in array.status:
                if status.name.endswith(part):
                    values = {value.key: value.value for value in status.values}
                    return {**values, 'level': str(ord(status.level)), 'message': status.message}
        return {}


def stamped(message: Any, stamp: int) -> Any:
    """The message with a stamp [ns] and a frame name."""
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, 10**9)
    message.header.frame_id = 'rod'
    return message


class Graph(SpunNodes):
    """Estimator and probe."""

    def __init__(self, context: Context, probe: Probe, estimator: CountedEstimator) -> None:
        super().__init__(context, estimator, probe)
        self.probe, self.estimator = probe, estimator

    def estimate(self, stamp: int, velocity: float, pressure: float = 1e6, force: float = 0.0) -> FrictionEstimate:
        """Send the inputs of one moment; the estimate for it, without MOTION_UNCERTAIN, which the first ones have."""
        before, taken = len(self.probe.estimates), self.estimator.taken
        self.probe.send_pressure(stamp, pressure)
        self.probe.send_force(stamp, force)
        assert self.spin_until(lambda: self.estimator.taken >= taken + 2)
        self.probe.send_velocity(stamp, velocity)
        assert self.spin_until(lambda: len(self.probe.estimates) > before)
        newest = self.probe.estimates[-1]
        newest.status &= ~FrictionEstimate.MOTION_UNCERTAIN
        return newest

    def call(self, kind: type, name: str, request: Any) -> Any:
        """Call a service of the estimator; its response."""
        client = self.probe.create_client(kind, name)
        assert self.spin_until(client.service_is_ready)
        future = client.call_async(request)
        assert self.spin_until(future.done)
        self.probe.destroy_client(client)
        return future.result()


@contextmanager
def graph(
    parameters: dict[str, Any] | None = None,
    *,
    autostart: bool = True,
    qos: QoSProfile | int = 10,
    arguments: tuple[str, ...] = (),
    namespace: str = '',
) -> Iterator[Graph]:
    """Estimator with ROS ``parameters`` and command-line ``arguments`` (remapping), and a probe in ``namespace``.

    The age of stamps is not checked: tests choose them. Nor is it a fault that a machine with other work is late.
    """
    values = {'stamp_age_max': 0.0, 'feedforward.lateness_max': 10.0, **(parameters or {})}
    overrides = [Parameter(name, value=value) for name, value in values.items()]
    with ros_context() as context:
        estimator = CountedEstimator(
            context=context, parameter_overrides=overrides, cli_args=['--ros-args', *arguments] if arguments else None
        )
        probe = Probe(qos, context=context, namespace=namespace)
        try:
            if autostart:
                assert estimator.autostart()
            yield Graph(context, probe, estimator)
        finally:
            estimator.finish()
            estimator.destroy_node()
            probe.destroy_node()
