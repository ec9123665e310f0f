"""The live estimate: pressure, velocity and force sum in, friction estimate out, all of it recorded."""

import sys
import time
from dataclasses import replace
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rcl_interfaces.msg import SetParametersResult
from rclpy.clock import Clock, ClockType
from rclpy.exceptions import ParameterException
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile, ReliabilityPolicy
from seal_friction_msgs.msg import (
    CylinderPressure,
    EstimatorConfiguration,
    ForceSum,
    FrictionEstimate,
    RodVelocity,
)
from std_srvs.srv import Trigger

from seal_friction_ros.core import wire
from seal_friction_ros.core.configuration import Configuration, SealSelection, Snapshot, snapshot_text
from seal_friction_ros.core.estimator import EstimatorSettings, init, step
from seal_friction_ros.core.held_inputs import HeldInputs
from seal_friction_ros.core.validated import meanings
from seal_friction_ros.files import load_configuration
from seal_friction_ros.nodes import qos
from seal_friction_ros.nodes.executor import run
from seal_friction_ros.nodes.live_statistics import LiveStatistics
from seal_friction_ros.nodes.parameters import NodeOptions, declare, read
from seal_friction_ros.nodes.recording import Recording

_DIAGNOSTICS_PERIOD = 1.0  # [s]
INPUTS: dict[str, tuple[type, str]] = {
    'cylinder_pressure': (CylinderPressure, wire.PRESSURE_TYPE),
    'force_sum': (ForceSum, wire.FORCE_TYPE),
    'rod_velocity': (RodVelocity, wire.VELOCITY_TYPE),
}
"""Input topic -> its message type, for rclpy and by name."""

_RECORDS: tuple[type, ...] = (SealSelection, EstimatorSettings, NodeOptions)


class FrictionEstimator(LifecycleNode):
    """Lifecycle node around ``core.estimator``.

    Raises:
        ValueError: A parameter is of the wrong type or out of bounds.
    """

    def __init__(self, **kwargs: Any) -> None:
        super().__init__('friction_estimator', **kwargs)
        self._active = False
        self._failure_said = ''
        self._recording = Recording()
        self._inputs: dict[str, Any] = {}
        self._topics: dict[str, str] = {}
        self._forget()
        try:
            for record_type in _RECORDS:
                declare(self, record_type)
        except ParameterException as error:
            raise ValueError(str(error)) from None
        self._warn_of_unknown_parameters()
        self.add_on_set_parameters_callback(self._on_set_parameters)
        self.add_post_set_parameters_callback(self._on_parameters_set)
        self.create_service(Trigger, '~/start_recording', self._on_start_recording)
        self.create_service(Trigger, '~/stop_recording', self._on_stop_recording)

    def _warn_of_unknown_parameters(self) -> None:
        # rclpy passes over what nobody declares, so a misspelt name would leave its default without a word.
        given = getattr(self, '_parameter_overrides', {})
        unknown = sorted(n for n in given if not n.startswith('qos_overrides') and not self.has_parameter(n))
        if unknown:
            self.get_logger().warning(f'no such parameter: {", ".join(unknown)}')

    def _forget(self) -> None:
        self._configuration: Configuration | None = None
        self._diagnostics_timer: Any = None
        self._estimate_publisher: Any = None
        self._configuration_publisher: Any = None
        self._diagnostics_publisher: Any = None

    def autostart(self) -> bool:
        """Configure and activate, if the parameters say so; False if that failed, which is logged."""
        if not read(self, NodeOptions).autostart:
            return True
        success = TransitionCallbackReturn.SUCCESS
        return self.trigger_configure() == success and self.trigger_activate() == success

    def finish(self) -> None:
        """Stop estimating; finish the bag."""
        self._active = False
        outcome = self._recording.stop()
        if outcome and self.context.ok():
            self.get_logger().info(outcome)
        elif outcome:  # stopped by a signal: the logger has no graph any more
            print(outcome, file=sys.stderr)

    # --- lifecycle ---

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Read the seal files; make publishers and subscriptions."""
        try:
            self._make()
        except Exception as error:  # noqa: BLE001  rclpy swallows what a transition raises, so it is said here
            self.get_logger().error(str(error))
            self._release()
            return TransitionCallbackReturn.FAILURE
        return super().on_configure(state)

    def _make(self) -> None:
        configuration = load_configuration(read(self, SealSelection), read(self, EstimatorSettings))
        self._statistics = LiveStatistics()
        self._estimate_publisher = self.create_lifecycle_publisher(
            FrictionEstimate, 'friction_estimate', qos.STREAM, qos_overriding_options=qos.overridable()
        )
        self._estimate_topic = self._estimate_publisher.topic_name
        self._configuration_publisher = self.create_lifecycle_publisher(
            EstimatorConfiguration, '~/configuration', qos.LATCHED
        )
        self._diagnostics_publisher = self.create_publisher(DiagnosticArray, '/diagnostics', 10)
        for name in INPUTS:
            self._subscribe(name, qos.STREAM)
        steady = Clock(clock_type=ClockType.STEADY_TIME)  # diagnostics go on while simulated time stands still
        self._diagnostics_timer = self.create_timer(_DIAGNOSTICS_PERIOD, self._on_diagnostics, clock=steady)
        self._configuration = configuration

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Start estimating, from a state in which nothing is known, and recording if asked to."""
        result = super().on_activate(state)
        self._estimator_parameters = self._configuration.parameters()
        self._estimator_state, self._held = init(self._estimator_parameters), HeldInputs()
        self._statistics = LiveStatistics()
        self._now = self._ros_time if self.get_parameter('use_sim_time').value else time.time_ns
        if read(self, NodeOptions).record:
            self._start_recording()
        else:
            self._publish_configuration()
        self._active = True
        self.get_logger().info('estimating')
        return result

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop estimating; finish the bag."""
        self.finish()
        return super().on_deactivate(state)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Give back what `on_configure` made."""
        self._release()
        return super().on_cleanup(state)

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Finish the bag and give everything back."""
        self.finish()
        self._release()
        return super().on_shutdown(state)

    def _release(self) -> None:
        if self._diagnostics_timer is not None:
            self.destroy_timer(self._diagnostics_timer)
        for subscription in self._inputs.values():
            self.destroy_subscription(subscription)
        for publisher in (self._estimate_publisher, self._configuration_publisher, self._diagnostics_publisher):
            if publisher is not None:
                self.destroy_publisher(publisher)
        self._inputs.clear()
        self._forget()

    def _subscribe(self, name: str, profile: QoSProfile) -> None:
        if name in self._inputs:
            self.destroy_subscription(self._inputs[name])
        message_type, _ = INPUTS[name]
        callback = {'cylinder_pressure': self._on_pressure, 'force_sum': self._on_force}.get(name, self._on_velocity)
        overriding = qos.overridable() if profile is qos.STREAM else None
        self._inputs[name] = self.create_subscription(
            message_type, name, callback, profile, raw=True, qos_overriding_options=overriding
        )
        self._topics[name] = self._inputs[name].topic_name

    def _ros_time(self) -> int:
        return self.get_clock().now().nanoseconds

    # --- the live path ---

    def _on_pressure(self, data: bytes) -> None:
        pressure = self._take('cylinder_pressure', data)
        if pressure is not None:
            self._held = self._held._replace(pressure=pressure)

    def _on_force(self, data: bytes) -> None:
        force = self._take('force_sum', data)
        if force is not None:
            self._held = self._held._replace(force=force)

    def _on_velocity(self, data: bytes) -> None:
        taken = time.perf_counter_ns()
        velocity = self._take('rod_velocity', data)
        if velocity is None:
            return
        sample = self._held.rod_sample(velocity.stamp, velocity.velocity)
        self._estimator_state, estimate = step(self._estimator_parameters, self._estimator_state, sample)
        estimate_bytes = wire.encode_estimate(estimate, velocity.frame_id)
        self._estimate_publisher.publish(estimate_bytes)
        self._recording.record(self._estimate_topic, wire.ESTIMATE_TYPE, self._now(), estimate_bytes)
        self._statistics.on_estimate(estimate, time.perf_counter_ns() - taken)

    def _take(self, name: str, data: bytes) -> Any:
        """Decode, record and count one message that came in; None if it is not for us: inactive, or not a message."""
        if not self._active:
            return None
        _, type_name = INPUTS[name]
        try:
            record = wire.DECODERS[type_name](data)
        except ValueError as error:
            self._statistics.on_malformed(name)
            self.get_logger().error(f'{self._topics[name]}: {error}', throttle_duration_sec=1.0)
            return None
        self._statistics.on_input(name)
        self._recording.record(self._topics[name], type_name, self._now(), data)
        return record

    # --- parameters ---

    def _on_set_parameters(self, parameters: list[Parameter]) -> SetParametersResult:
        """Accept or refuse a set of changes as a whole."""
        changed = {p.name: p.value for p in parameters}
        for record_type in _RECORDS:
            names = changed.keys() & meanings(record_type).keys()
            fixed = sorted(name for name in names if not meanings(record_type)[name].live)
            if fixed and self._configuration is not None:
                reason = f'{", ".join(fixed)}: can only change while the node is unconfigured; clean it up first'
                return SetParametersResult(successful=False, reason=reason)
            try:
                read(self, record_type, **{name: changed[name] for name in names})
            except (ValueError, TypeError) as error:
                return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _on_parameters_set(self, parameters: list[Parameter]) -> None:
        """Take changed settings over, between two samples."""
        del parameters
        if self._configuration is None:
            return
        settings = read(self, EstimatorSettings)
        if settings == self._configuration.settings:
            return
        self._configuration = replace(self._configuration, settings=settings)
        if self._active:
            self._estimator_parameters = self._configuration.parameters()
            self._publish_configuration()

    def _publish_configuration(self) -> None:
        data = wire.encode_text(snapshot_text(Snapshot(self._configuration, self._estimator_state, self._held)))
        self._configuration_publisher.publish(data)
        self._recording.record(self._configuration_publisher.topic_name, wire.CONFIGURATION_TYPE, self._now(), data)

    # --- recording ---

    def _start_recording(self) -> tuple[bool, str]:
        """Start a bag, which begins with a snapshot; whether that went well, and where the bag is or why not."""
        options = read(self, NodeOptions)
        try:
            path = self._recording.start(options.record_directory, options.record_name)
        except ValueError as error:
            self.get_logger().error(str(error))
            self._publish_configuration()
            return False, str(error)
        self._publish_configuration()
        self.get_logger().info(f'recording to {path}')
        return True, str(path)

    def _on_start_recording(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        del request
        if self._active:
            response.success, response.message = self._start_recording()
        else:
            response.success, response.message = False, 'not active: nothing to record'
        return response

    def _on_stop_recording(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        del request
        outcome = self._recording.stop()
        response.success = bool(outcome) and not self._recording.failure
        response.message = outcome or 'not recording'
        return response

    # --- diagnostics ---

    def _on_diagnostics(self) -> None:
        publishers = {name: self._publisher_count(name) for name in INPUTS}
        statuses = [self._statistics.report(self._active, publishers), self._recording.report()]
        message = DiagnosticArray(status=statuses)
        if statuses[1].level == DiagnosticStatus.ERROR and statuses[1].message != self._failure_said:
            self._failure_said = statuses[1].message
            self.get_logger().error(self._failure_said)
        for status, part in zip(message.status, ('estimate', 'recorder'), strict=True):
            status.name = f'{self.get_fully_qualified_name()}: {part}'
        message.header.stamp = self.get_clock().now().to_msg()
        self._diagnostics_publisher.publish(message)
        for name in self._statistics.silent_inputs:
            self._accept_best_effort(name)

    def _publisher_count(self, name: str) -> int:
        # Connected publishers; ROS 2 Jazzy only knows the discovered ones.
        count = getattr(self._inputs[name], 'get_publisher_count', None)
        return int(count()) if count is not None else self.count_publishers(self._topics[name])

    def _accept_best_effort(self, name: str) -> None:
        """Subscribe anew where nothing comes because the publisher offers only best effort."""
        if self._inputs[name].qos_profile.reliability != ReliabilityPolicy.RELIABLE:
            return
        for publisher in self.get_publishers_info_by_topic(self._topics[name]):
            if publisher.qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT:
                who = f'{publisher.node_namespace}/{publisher.node_name}'.replace('//', '/')
                self.get_logger().warning(f'{self._topics[name]}: {who} offers best effort only: taken as such')
                self._subscribe(name, qos.best_effort(qos.STREAM))
                return


def main() -> int:
    """Run the node: ``friction_estimator --ros-args -p seals:=[...] --params-file FILE``."""
    return run(FrictionEstimator, FrictionEstimator.autostart, FrictionEstimator.finish)


if __name__ == '__main__':
    sys.exit(main())
