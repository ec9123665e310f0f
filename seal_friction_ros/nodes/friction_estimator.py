"""Live node: estimates friction and feed-forward from pressure, velocity, force sum and reference, and records all."""

import sys
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.qos import QoSProfile
from std_srvs.srv import Trigger

from seal_friction_ros.core.estimation.adaptation import NOT_ADAPTED, AdaptationSettings
from seal_friction_ros.core.estimation.configuration import (
    PLACEHOLDER_WARNING,
    Configuration,
    SealSelection,
    Snapshot,
    snapshot_text,
)
from seal_friction_ros.core.estimation.estimator import EstimatorSettings
from seal_friction_ros.core.estimation.feedforward import FeedForwardSettings
from seal_friction_ros.core.estimation.messages import (
    CONFIGURATION_TYPE,
    DECODERS,
    ESTIMATE_TYPE,
    INPUTS,
    OUTPUTS,
    TICK_TYPE,
    Output,
    encode,
    encode_text,
    type_of,
)
from seal_friction_ros.core.estimation.node_options import (
    FRICTION_ESTIMATOR_PARAMETERS,
    InputOptions,
    RecordingOptions,
)
from seal_friction_ros.core.estimation.pipeline import init, is_tick_due, receive
from seal_friction_ros.core.estimation.records import WatchdogTick
from seal_friction_ros.files import load_configuration
from seal_friction_ros.nodes import qos
from seal_friction_ros.nodes.estimator_diagnostics import EstimatorDiagnostics
from seal_friction_ros.nodes.executor import run
from seal_friction_ros.nodes.graph_watch import GraphWatch
from seal_friction_ros.nodes.managed_node import ManagedNode, message_class
from seal_friction_ros.nodes.recording import Recording

_WATCH_PERIOD = 0.05  # [s]
_HEALTH_PERIOD = 60.0  # [s]
_WATCHDOG_PERIOD = 0.01  # [s] more than `pipeline.TICK_INTERVAL`, so that jitter skips no tick
_LARGEST_CLOCK_STEP = 10_000_000  # [ns] a clock that is further off was set
_STOP_PERIOD = 0.005  # [s] between two forces while the node stops
_LAST_FORCES = (
    10  # number of forces of 0 N at the end: a subscriber may lose what it has not taken when a publisher goes
)
SWITCH_INTERVAL = 5e-5  # [s] longest time that the recorder thread delays a sample; Python's default is 5 ms


class FrictionEstimator(ManagedNode):
    """Lifecycle node around `core.estimation.pipeline`.

    Raises:
        ValueError: A parameter has the wrong type or is out of bounds.
    """

    def __init__(self, **kwargs: Any) -> None:
        self._logged_errors: dict[str, str] = {}
        self._configuration: Configuration | None = None
        self._inputs: dict[str, Any] = {}
        self._outputs: dict[str, Any] = {}
        self._topics: dict[str, str] = {}
        self._timers: list[Any] = []
        self._sent: list[tuple[str, Output, bytes]] = []
        super().__init__('friction_estimator', FRICTION_ESTIMATOR_PARAMETERS, **kwargs)
        self._recording = Recording(self.get_fully_qualified_name())
        self.create_service(Trigger, '~/start_recording', self._on_start_recording)
        self.create_service(Trigger, '~/stop_recording', self._on_stop_recording)
        self.create_service(Trigger, '~/reset_adaptation', self._on_reset_adaptation)

    # --- lifecycle ---

    def make(self) -> None:
        """Read the seal files; create publishers and subscriptions."""
        settings = map(self.settings, (EstimatorSettings, FeedForwardSettings, AdaptationSettings))
        configuration = load_configuration(self.settings(SealSelection), *settings)
        if configuration.has_placeholder:
            self.get_logger().warning(PLACEHOLDER_WARNING)
        self._statistics = EstimatorDiagnostics()
        self._watch = GraphWatch(self, self._inputs, self._outputs, self._subscribe)
        for topic, type_name in OUTPUTS.items():
            self._outputs[type_name] = self.create_lifecycle_publisher(
                message_class(type_name),
                topic,
                qos.STREAM,
                qos_overriding_options=qos.overridable(),
                event_callbacks=PublisherEventCallbacks(
                    incompatible_qos=partial(self._watch.on_incompatible_subscriber, type_name)
                ),
            )
        self._outputs[CONFIGURATION_TYPE] = self.create_lifecycle_publisher(
            message_class(CONFIGURATION_TYPE), '~/configuration', qos.LATCHED
        )
        self._health = self.create_publisher(DiagnosticArray, '~/health', 10)
        self._topics = {type_name: publisher.topic_name for type_name, publisher in self._outputs.items()}
        for name in INPUTS:
            self._subscribe(name, qos.STREAM)
        self._topics[TICK_TYPE] = self.resolve_topic_name('~/watchdog_tick')
        self._timers = [
            self.create_steady_timer(_WATCH_PERIOD, self._on_watch_timer),
            self.create_steady_timer(_WATCHDOG_PERIOD, self._on_watchdog),
            self.create_steady_timer(_HEALTH_PERIOD, self._on_health_timer),
        ]
        self._configuration = configuration

    def release(self) -> None:
        """Destroy publishers and subscriptions."""
        for subscription in self._inputs.values():
            self.destroy_subscription(subscription)
        for publisher in self._outputs.values():
            self.destroy_publisher(publisher)
        self._inputs.clear()
        self._outputs.clear()
        self.destroy_publisher(self._health)
        for timer in self._timers:
            self.destroy_timer(timer)
        self._timers.clear()
        self._configuration = None

    def start(self) -> None:
        """Start to estimate from the initial state, and to record if ``record`` is set."""
        self._known = self._configuration.parameters()
        self._state = init(self._known)._replace(refused=self._is_refused(self._watch.duplicate_publishers()))
        self._statistics = EstimatorDiagnostics()
        self._logged_errors.clear()
        self._receipt_offset = time.time_ns() - time.monotonic_ns()
        self._received = 0
        self._now = self._receipt_clock()
        if self.settings(RecordingOptions).record:
            self._start_recording()
        else:
            self._publish_configuration()
        self.get_logger().info('estimating')

    def finish(self) -> None:
        """Bring the force to 0 N, stop estimating, finish the bag."""
        if self.active:
            self._fade_out()
        self.active = False
        outcome = self._recording.close()
        if outcome:
            self.get_logger().info(outcome)

    def _subscribe(self, name: str, profile: QoSProfile) -> None:
        if name in self._inputs:
            self.destroy_subscription(self._inputs[name])
        overriding = qos.overridable() if profile is qos.STREAM else None
        kind, callback = message_class(INPUTS[name]), partial(self._on_input, name)
        self._inputs[name] = self.create_subscription(
            kind,
            name,
            callback,
            profile,
            raw=True,
            qos_overriding_options=overriding,
            # An event of a subscription that is replaced meanwhile is a segmentation fault of the events executor.
            event_callbacks=SubscriptionEventCallbacks(use_default_callbacks=False),
        )
        self._topics[name] = self._inputs[name].topic_name

    def _on_watch_timer(self) -> None:
        """Publish diagnostics when a publisher of an input has appeared or disappeared; follow a clock that was set.

        If the next bag is due, let it begin with a snapshot.
        """
        if self._watch.has_changed():
            self.publish_diagnostics()
        following = self._recording.continue_in_next_bag()
        if following:
            self._publish_configuration()
            self.get_logger().info(f'recording to {following}')
        if self.active and self._now == self._steady_time:
            offset = time.time_ns() - self._now()
            if abs(offset - self._state.clock_offset) > _LARGEST_CLOCK_STEP:
                self._follow_clock(offset)

    def _follow_clock(self, offset: int) -> None:
        """Judge the age of stamps by a clock that was set; the time of receipt goes on."""
        self.get_logger().warning(f'the clock was set by {(offset - self._state.clock_offset) * 1e-9:.3f} s')
        self._state = self._state._replace(clock_offset=offset)
        self._publish_configuration()

    def _receipt_clock(self) -> Callable[[], int]:
        return self._simulated_time if self.get_parameter('use_sim_time').value else self._steady_time

    def _simulated_time(self) -> int:
        """Time of receipt [ns] with ``use_sim_time``: it increases at every call, as the log time of a bag does."""
        shown = self.get_clock().now().nanoseconds
        if shown - self._state.clock_offset < self._received - _LARGEST_CLOCK_STEP:
            self._follow_clock(shown - self._received)
        self._received = max(shown - self._state.clock_offset, self._received + 1)
        return self._received

    def _steady_time(self) -> int:
        """Time of receipt [ns]: the clock as it was at activation, which no setting of the clock changes."""
        return time.monotonic_ns() + self._receipt_offset

    # --- the live path ---

    def _on_input(self, name: str, data: bytes) -> None:
        taken = time.perf_counter_ns()
        if not self.active:
            return
        type_name = INPUTS[name]
        try:
            message = DECODERS[type_name](data)
        except ValueError as error:
            self._statistics.on_malformed(name)
            self.get_logger().error(f'{self._topics[name]}: {error}', throttle_duration_sec=1.0)
            return
        received = self._now()
        self._sent.clear()
        self._state = receive(self._known, self._state, message, received, self._send)
        done = time.perf_counter_ns()

        # Nobody waits for what follows.
        self._recording.record(self._topics[name], type_name, received, data)
        self._statistics.on_input(name, message.stamp)
        self._record_answers(done - taken)
        if name == 'rod_velocity':
            if self._known.estimator.adapts:
                self._statistics.on_adaptation(self._state.estimator.adaptation)
            self._recording.flush_if_idle()

    def _record_answers(self, latency: int = 0) -> None:
        """Record and count what was sent, ``latency`` [ns] after its input was taken."""
        for answer_type, answer, answer_data in self._sent:
            self._recording.record(self._topics[answer_type], answer_type, self._now(), answer_data)
            if answer_type == ESTIMATE_TYPE:
                self._statistics.on_estimate(answer, latency)
            else:
                self._statistics.on_feedforward(answer)

    def _on_watchdog(self) -> None:
        """Renew the feed-forward while no velocity sample does, so that it fades out."""
        if self.active and is_tick_due(self._state, self._now()):
            self._tick(self._now())

    def _tick(self, received: int) -> None:
        tick = WatchdogTick(received + self._state.clock_offset, (received - self._state.feedforward.received) * 1e-9)
        self._sent.clear()
        self._state = receive(self._known, self._state, tick, received, self._send)
        self._recording.record(self._topics[TICK_TYPE], TICK_TYPE, received, encode(tick))
        self._record_answers()

    def _fade_out(self) -> None:
        """Fade the force to 0 N within ``fade_time``, whatever comes, also if simulated time stands still."""
        if self._state.feedforward.fade * self._state.feedforward.force == 0.0:
            return
        self._state = self._state._replace(refused=True)
        self._publish_configuration()  # a replay fades from here on
        began, start, left = time.monotonic(), self._now(), _LAST_FORCES
        while left:
            time.sleep(_STOP_PERIOD)
            self._tick(start + int((time.monotonic() - began) * 1e9))
            left -= self._state.feedforward.fade == 0.0

    def _send(self, answer: Output, frame_id: bytes) -> None:
        """Publish an answer at once; the rest waits until all answers are out."""
        type_name, data = type_of(answer), encode(answer, frame_id)
        self._outputs[type_name].publish(data)
        self._sent.append((type_name, answer, data))

    def _publish(self, type_name: str, data: bytes) -> None:
        self._outputs[type_name].publish(data)
        self._recording.record(self._topics[type_name], type_name, self._now(), data)

    # --- parameters ---

    def on_change(self) -> None:
        """Apply changed settings, between two samples."""
        self._refuse_inputs(self._watch.duplicate_publishers())
        changed = replace(
            self._configuration,
            settings=self.settings(EstimatorSettings),
            feedforward=self.settings(FeedForwardSettings),
            adaptation=self.settings(AdaptationSettings),
        )
        if changed == self._configuration:
            return
        self._configuration = changed
        if self.active:
            self._known = changed.parameters()
            self._publish_configuration()

    def _publish_configuration(self) -> None:
        text = snapshot_text(Snapshot(self._configuration, self._state))
        self._publish(CONFIGURATION_TYPE, encode_text(text))

    # --- recording ---

    def _start_recording(self) -> tuple[bool, str]:
        """Start a bag, which begins with a snapshot; success, and the folder of the bag or the error."""
        try:
            path = self._recording.start(self.settings(RecordingOptions))
        except ValueError as error:
            self._log_error_once('recorder', str(error))
            self._publish_configuration()
            return False, str(error)
        self._publish_configuration()
        self.get_logger().info(f'recording to {path}')
        return True, str(path)

    def _on_start_recording(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        del request
        if self.active:
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

    def _on_reset_adaptation(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        """Forget what the adaptation has learnt."""
        del request
        response.success = self.active
        response.message = 'scale 1, offset 0 N' if self.active else 'not active: nothing is learnt'
        if self.active:
            known = self._state.estimator._replace(adaptation=NOT_ADAPTED)
            self._state = self._state._replace(estimator=known)
            self._publish_configuration()  # a replay forgets at the same message
        return response

    # --- diagnostics ---

    def diagnostics(self) -> dict[str, DiagnosticStatus]:
        """Status of the estimate, of its inputs and outputs, and of the recorder."""
        graph = self._watch.findings(self._statistics.silent_inputs, retry=self.active)
        self._refuse_inputs(graph.duplicates)
        adapting = self._known.estimator if self._adapts else None
        estimate = self._statistics.report(self.active, self.active and self._state.refused, graph, adapting)
        recorder = self._recording.report()
        self._log_error_once('publishers', '; '.join(graph.duplicates))
        self._log_error_once('unheard', '; '.join(graph.unheard))
        self._log_error_once('recorder', recorder.message if recorder.level == DiagnosticStatus.ERROR else '')
        return {'estimate': estimate, 'recorder': recorder}

    @property
    def _adapts(self) -> bool:
        return self.active and self._known.estimator.adapts

    def _on_health_timer(self) -> None:
        """Publish the health of the seals while the adaptation learns."""
        if self._adapts:
            status = self._statistics.health(self._known.estimator)
            status.name = f'{self.get_fully_qualified_name()}: seals'
            message = DiagnosticArray(status=[status])
            message.header.stamp = self.get_clock().now().to_msg()
            self._health.publish(message)

    def end_interval(self) -> None:
        """Start a new interval of rates and latencies."""
        self._statistics.start_interval()

    def _log_error_once(self, subject: str, error: str) -> None:
        """Log an error when it appears or changes, not every second."""
        if error and error != self._logged_errors.get(subject):
            self.get_logger().error(error)
        self._logged_errors[subject] = error

    def _is_refused(self, duplicates: list[str]) -> bool:
        return bool(duplicates) and self.settings(InputOptions).refuse_second_publisher

    def _refuse_inputs(self, duplicates: list[str]) -> None:
        """Reject the inputs while ``refuse_second_publisher`` is set and topics have several publishers."""
        refused = self._is_refused(duplicates)
        if self.active and refused != self._state.refused:
            self._state = self._state._replace(refused=refused)
            self._publish_configuration()  # a replay rejects the inputs from the same message on


def main() -> int:
    """Run the node: ``friction_estimator --ros-args -p seals:=[...] --params-file FILE``."""
    sys.setswitchinterval(SWITCH_INTERVAL)
    return run(FrictionEstimator, FrictionEstimator.autostart, FrictionEstimator.finish)


if __name__ == '__main__':
    sys.exit(main())
