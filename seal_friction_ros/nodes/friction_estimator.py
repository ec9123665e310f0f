"""The live estimate: pressure, velocity, force sum and reference in, friction and feed-forward out, all recorded."""

import sys
import time
from dataclasses import replace
from functools import partial
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.qos import QoSProfile, ReliabilityPolicy
from std_srvs.srv import Trigger

from seal_friction_ros.core.estimation.configuration import Configuration, SealSelection, Snapshot, snapshot_text
from seal_friction_ros.core.estimation.estimator import EstimatorSettings
from seal_friction_ros.core.estimation.feedforward import FeedForwardSettings
from seal_friction_ros.core.estimation.messages import (
    CONFIGURATION_TYPE,
    DECODERS,
    ESTIMATE_TYPE,
    INPUTS,
    OUTPUTS,
    Output,
    encode,
    encode_text,
    type_of,
)
from seal_friction_ros.core.estimation.pipeline import init, receive
from seal_friction_ros.files import FEEDFORWARD_PREFIX, load_configuration
from seal_friction_ros.nodes import qos
from seal_friction_ros.nodes.executor import run
from seal_friction_ros.nodes.live_statistics import LiveStatistics
from seal_friction_ros.nodes.managed_node import ManagedNode, message_class
from seal_friction_ros.nodes.parameters import Group, InputOptions, RecordingOptions
from seal_friction_ros.nodes.publishers import (
    full_name,
    incompatibility,
    is_named,
    offers_best_effort_only,
    publishers,
    why_unheard,
)
from seal_friction_ros.nodes.recording import Recording

SWITCH_INTERVAL = 5e-5  # [s] the recorder keeps a sample waiting no longer than this; Python's own choice is 5 ms


class FrictionEstimator(ManagedNode):
    """Lifecycle node around ``core.pipeline``.

    Raises:
        ValueError: A parameter is of the wrong type or out of bounds.
    """

    GROUPS = (
        Group(SealSelection),
        Group(EstimatorSettings),
        Group(FeedForwardSettings, FEEDFORWARD_PREFIX),
        Group(InputOptions),
        Group(RecordingOptions),
    )

    def __init__(self, **kwargs: Any) -> None:
        self._said: dict[str, str] = {}
        self._deaf_to: set[str] = set()
        self._unnamed: set[str] = set()
        self._best_effort: dict[str, str] = {}
        self._recording = Recording()
        self._configuration: Configuration | None = None
        self._inputs: dict[str, Any] = {}
        self._outputs: dict[str, Any] = {}
        self._topics: dict[str, str] = {}
        self._sent: list[tuple[str, Output, bytes]] = []
        super().__init__('friction_estimator', self.GROUPS, **kwargs)
        self.create_service(Trigger, '~/start_recording', self._on_start_recording)
        self.create_service(Trigger, '~/stop_recording', self._on_stop_recording)

    # --- lifecycle ---

    def make(self) -> None:
        """Read the seal files; make publishers and subscriptions."""
        settings = self.settings(EstimatorSettings), self.settings(FeedForwardSettings)
        configuration = load_configuration(self.settings(SealSelection), *settings)
        self._statistics = LiveStatistics()
        for topic, type_name in OUTPUTS.items():
            self._outputs[type_name] = self.create_lifecycle_publisher(
                message_class(type_name),
                topic,
                qos.STREAM,
                qos_overriding_options=qos.overridable(),
                event_callbacks=PublisherEventCallbacks(incompatible_qos=partial(self._on_deaf, type_name)),
            )
        self._outputs[CONFIGURATION_TYPE] = self.create_lifecycle_publisher(
            message_class(CONFIGURATION_TYPE), '~/configuration', qos.LATCHED
        )
        self._topics = {type_name: publisher.topic_name for type_name, publisher in self._outputs.items()}
        for name in INPUTS:
            self._subscribe(name, qos.STREAM)
        self._configuration = configuration

    def release(self) -> None:
        """Give publishers and subscriptions back."""
        for subscription in self._inputs.values():
            self.destroy_subscription(subscription)
        for publisher in self._outputs.values():
            self.destroy_publisher(publisher)
        self._inputs.clear()
        self._outputs.clear()
        for noted in (self._deaf_to, self._unnamed, self._best_effort):
            noted.clear()
        self._configuration = None

    def start(self) -> None:
        """Start estimating, from a state in which nothing is known, and recording if asked to."""
        self._known = self._configuration.parameters()
        self._state = init(self._known)._replace(refused=self._is_refused(self._crowd()))
        self._statistics = LiveStatistics()
        self._said.clear()
        self._now = self._ros_time if self.get_parameter('use_sim_time').value else time.time_ns
        if self.settings(RecordingOptions).record:
            self._start_recording()
        else:
            self._publish_configuration()
        self.get_logger().info('estimating')

    def finish(self) -> None:
        """Stop estimating; finish the bag."""
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
            event_callbacks=SubscriptionEventCallbacks(matched=self.on_matched),
        )
        self._topics[name] = self._inputs[name].topic_name

    def _on_deaf(self, type_name: str, _: Any) -> None:
        self._deaf_to.add(type_name)  # the name of the node comes later, see diagnostics

    def _who_is_deaf(self) -> list[str]:
        """Nodes that want more than a publisher offers, so hear nothing, in words."""
        deaf = []
        for type_name in sorted(self._deaf_to):
            topic, offered = self._topics[type_name], self._outputs[type_name].qos_profile
            for subscriber in self.get_subscriptions_info_by_topic(topic):
                reason = incompatibility(offered, subscriber.qos_profile)
                if reason:
                    deaf.append(f'{topic}: {full_name(subscriber)} wants incompatible quality of service ({reason})')
        return deaf

    def _ros_time(self) -> int:
        return self.get_clock().now().nanoseconds

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
        self._state = receive(self._known, self._state, message, self._send)
        done = time.perf_counter_ns()

        # Nobody waits for what follows.
        self._recording.record(self._topics[name], type_name, received, data)
        self._statistics.on_input(name, message.stamp)
        for answer_type, answer, answer_data in self._sent:
            self._recording.record(self._topics[answer_type], answer_type, self._now(), answer_data)
            if answer_type == ESTIMATE_TYPE:
                self._statistics.on_estimate(answer, done - taken)
            else:
                self._statistics.on_feedforward(answer)
        if name == 'rod_velocity':
            self._recording.now_is_a_good_time()

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
        """Take changed settings over, between two samples."""
        self._look_at_publishers()
        settings, feedforward = self.settings(EstimatorSettings), self.settings(FeedForwardSettings)
        changed = replace(self._configuration, settings=settings, feedforward=feedforward)
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
        """Start a bag, which begins with a snapshot; whether that went well, and where the bag is or why not."""
        try:
            path = self._recording.start(self.settings(RecordingOptions))
        except ValueError as error:
            self.get_logger().error(str(error))
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

    # --- diagnostics ---

    def diagnostics(self) -> dict[str, DiagnosticStatus]:
        """What comes in and goes out, and the recorder."""
        crowd = self._look_at_publishers()
        counts = {name: self._publisher_count(name) for name in INPUTS}
        recorder = self._recording.report()
        unheard = (self._listen_to_the_silent() if self.active else []) + self._who_is_deaf()
        estimate = self._statistics.report(self.active, counts)
        if self.active and self._state.refused:
            estimate.level = DiagnosticStatus.ERROR
        elif (crowd or unheard) and estimate.level == DiagnosticStatus.OK:
            estimate.level = DiagnosticStatus.WARN
        estimate.values += [
            KeyValue(key=f'{name} best effort only, from', value=who) for name, who in self._best_effort.items()
        ]
        estimate.message = '; '.join([*crowd, *unheard, estimate.message])
        self._say_once('publishers', '; '.join(crowd))
        self._say_once('unheard', '; '.join(unheard))
        self._say_once('recorder', recorder.message if recorder.level == DiagnosticStatus.ERROR else '')
        return {'estimate': estimate, 'recorder': recorder}

    def end_interval(self) -> None:
        """Count anew what is told of the last second."""
        self._statistics.start_interval()

    def _say_once(self, what: str, words: str) -> None:
        """Log an error when it comes up or changes, not each second."""
        if words and words != self._said.get(what):
            self.get_logger().error(words)
        self._said[what] = words

    def _publisher_count(self, name: str) -> int:
        # Connected publishers; ROS 2 Jazzy only knows the discovered ones.
        count = getattr(self._inputs[name], 'get_publisher_count', None)
        return int(count()) if count is not None else self.count_publishers(self._topics[name])

    def _crowd(self) -> list[str]:
        """Topics with several publishers, in words."""
        crowded = [self._topics[name] for name in INPUTS if self._publisher_count(name) > 1]
        answers = [self._topics[type_name] for type_name in OUTPUTS.values()]  # of a second estimator
        crowded += [topic for topic in answers if self.count_publishers(topic) > 1]
        crowd = []
        for topic in crowded:
            names = ', '.join(full_name(publisher) for publisher in publishers(self, topic))
            crowd.append(f'{topic} has several publishers: {names}')
        return crowd

    def _is_refused(self, crowd: list[str]) -> bool:
        return bool(crowd) and self.settings(InputOptions).refuse_second_publisher

    def _look_at_publishers(self) -> list[str]:
        """Topics with several publishers, in words; refuse the inputs if the parameter says so."""
        crowd = self._crowd()
        refused = self._is_refused(crowd)
        if self.active and refused != self._state.refused:
            self._state = self._state._replace(refused=refused)
            self._publish_configuration()  # so that a replay refuses from here on, too
        return crowd

    def _listen_to_the_silent(self) -> list[str]:
        """Subscribe anew where a publisher offers only best effort, or no longer; why others cannot be heard."""
        unheard = []
        for name in list(self._best_effort):
            if not any(map(offers_best_effort_only, publishers(self, self._topics[name]))):
                del self._best_effort[name]
                self._subscribe(name, qos.STREAM)
        for name in self._statistics.silent_inputs:
            topic, wanted = self._topics[name], self._inputs[name].qos_profile
            for publisher in publishers(self, topic):
                if offers_best_effort_only(publisher) and wanted.reliability == ReliabilityPolicy.RELIABLE:
                    if not is_named(publisher) and name not in self._unnamed:
                        self._unnamed.add(name)  # it may have a name by the next time
                        break
                    self._best_effort[name] = who = full_name(publisher)
                    self.get_logger().warning(f'{topic}: {who} offers best effort only: taken as such')
                    self._subscribe(name, qos.best_effort(qos.STREAM))
                    break
                reason = why_unheard(publisher, INPUTS[name], wanted)
                if reason:
                    unheard.append(f'{topic}: {reason}')
        return unheard


def main() -> int:
    """Run the node: ``friction_estimator --ros-args -p seals:=[...] --params-file FILE``."""
    sys.setswitchinterval(SWITCH_INTERVAL)
    return run(FrictionEstimator, FrictionEstimator.autostart, FrictionEstimator.finish)


if __name__ == '__main__':
    sys.exit(main())
