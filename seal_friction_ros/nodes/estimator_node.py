"""What the estimator of one actuator and that of a machine share: clock of receipt, recording, watch of the graph."""

import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Mapping
from functools import partial
from operator import itemgetter
from typing import Any, ClassVar

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from std_srvs.srv import Trigger

from seal_friction_ros.core.estimation.configuration import PLACEHOLDER_WARNING
from seal_friction_ros.core.estimation.feedforward import FeedForwardSettings
from seal_friction_ros.core.estimation.messages import (
    CLOCK_TOPIC,
    CLOCK_TYPE,
    CONFIGURATION_TYPE,
    OUTPUTS,
    encode,
    encode_text,
    type_of,
)
from seal_friction_ros.core.estimation.node_options import FEEDFORWARD_PREFIX, InputOptions, RecordingOptions
from seal_friction_ros.core.foundation.parameters import ParameterGroup
from seal_friction_ros.core.machine.answers_together import NamedAnswer
from seal_friction_ros.core.machine.newest_messages import NEWEST_TYPE, TopicMessage, encode_newest
from seal_friction_ros.nodes import qos
from seal_friction_ros.nodes.graph_watch import GraphFindings, GraphWatch
from seal_friction_ros.nodes.input_watch import InputWatch
from seal_friction_ros.nodes.managed_node import OVERDUE, ManagedNode, message_class
from seal_friction_ros.nodes.recording import Recording
from seal_friction_ros.nodes.subscription import with_source_time
from seal_friction_ros.offline.bags.bag import STATE_NAME, STATE_TYPE

_WATCH_PERIOD = 45_000_000  # [ns] of the graph and the clocks: every other call of the watchdog, even of an early one
_WATCHDOG_PERIOD = 0.025  # [s] less than the default timeouts of the feed-forward; a call costs 0.3 ms, mostly waking
_TICK_PERIOD = 0.01  # [s] while ticks keep a force up; more than `pipeline.TICK_INTERVAL`, so that jitter skips no tick
_TICKING = 1_000_000_000  # [ns] after the last tick: inputs slower than the ticks need them again and again
_STARVED = round(_TICK_PERIOD * 1e9) + OVERDUE  # [ns] without the watchdog
_HEALTH_PERIOD = 60.0  # [s]
_CHANGE_PERIOD = 100_000_000  # [ns] between two applications of changed parameters, which take half a millisecond
_INPUT_PERIOD = 0.5  # [s]
_LARGEST_CLOCK_STEP = 10_000_000  # [ns] a clock that is further off was set
_BACKLOG = 5_000_000  # [ns] late by more, others may wait behind a message: the node takes them all in one go
_MOST_WAITING = 10_000  # [messages] that it takes in one go
_SORTING = (
    1_000_000_000  # [ns] after a late message, until the executor has heard of all that was taken before its turn
)
STOP_PERIOD = 0.005  # [s] between two forces while the node stops
LAST_FORCES = (
    10  # number of forces of 0 N at the end: a subscriber may lose what it has not taken when a publisher goes
)
_HEALTH, _MONITOR = 'health', 'monitor'  # keys of their publishers
_TOPIC_OF = {type_name: topic for topic, type_name in OUTPUTS.items()}


def _lateness(source: int) -> int:
    """Time [ns] since a message was sent at ``source`` [ns of the system clock]; 0 if the middleware does not tell."""
    return time.time_ns() - source if source else 0


class EstimatorNode(ManagedNode, ABC):
    """Lifecycle node that estimates and records; a subclass has the live path.

    A subclass overrides what is listed first, makes ``_watch`` and calls `create_timers` in `make`, and calls `begin`
    at the end of `start`.

    Raises:
        ValueError: A parameter has the wrong type or is out of bounds.
    """

    RECORDS_STATES: ClassVar = False
    """whether a bag can be replayed from a state amid it"""
    _watch: GraphWatch
    _input_watch: InputWatch

    def __init__(self, name: str, groups: tuple[ParameterGroup, ...], **kwargs: Any) -> None:
        self._logged_errors: dict[str, str] = {}
        self._inputs: dict[str, Any] = {}
        self._outputs: dict[Any, Any] = {}
        self._publish: dict[Any, Callable[[bytes], None]] = {}
        self._topics: dict[Any, str] = {}
        self._newest_inputs: dict[str, TopicMessage] = {}
        self.has_viewer = False  # by a live view
        self._watchdog_called = self._ticked = self._watched = 0  # [ns] of `time.perf_counter_ns`
        self._is_ticking = False
        self._sorts_until = 0  # [ns] of `time.perf_counter_ns`
        self._is_change_due, self._applied = False, 0  # [ns] of `time.perf_counter_ns`
        self._sets = self._applications = 0  # of parameters since the last report
        self._timers: list[Any] = []
        super().__init__(name, groups, **kwargs)
        self._recording = Recording(self.get_fully_qualified_name())
        self.create_service(Trigger, '~/start_recording', self._on_start_recording)
        self.create_service(Trigger, '~/stop_recording', self._on_stop_recording)
        self.create_service(Trigger, '~/reset_adaptation', self._on_reset_adaptation)

    # --- overridden by subclasses ---

    @property
    @abstractmethod
    def clock_offset(self) -> int:
        """What the clock of the stamps shows after the clock of receipt [ns]."""

    @abstractmethod
    def set_clock_offset(self, offset: int) -> None:
        """Use another offset [ns] from now on."""

    @abstractmethod
    def snapshot(self) -> str:
        """All that the next answer depends on, as text."""

    @abstractmethod
    def reset_adaptation(self) -> None:
        """Forget what the adaptation has learnt."""

    @abstractmethod
    def input_type(self, name: str) -> str:
        """Message type of an input."""

    @abstractmethod
    def on_input(self, name: str, data: bytes, lateness: int) -> None:
        """Take one message of an input, ``lateness`` [ns] after it was sent."""

    @property
    @abstractmethod
    def needed_inputs(self) -> Collection[str]:
        """Inputs without which there is no good estimate."""

    @abstractmethod
    def received(self) -> Mapping[str, int]:
        """Messages of each input since activation."""

    @abstractmethod
    def apply_change(self) -> None:
        """Apply the present parameters."""

    @abstractmethod
    def has_placeholder(self, prefix: str) -> bool:
        """Whether the parameters with a prefix are of an actuator with a placeholder seal, while configured."""

    @abstractmethod
    def on_watchdog(self) -> bool:
        """Renew each feed-forward that no sample renews, so that it fades out; whether there was one."""

    @abstractmethod
    def fade_out(self) -> None:
        """Fade every force to 0 N."""

    @abstractmethod
    def health(self) -> dict[str, DiagnosticStatus]:
        """Indicators of the seals, by the name of the part."""

    @abstractmethod
    def newest_answers(self) -> list[NamedAnswer]:
        """The newest answers of each actuator since the last call, see `EstimatorDiagnostics.take_newest`."""

    # --- lifecycle ---

    def release(self) -> None:
        """Destroy publishers, subscriptions and timers."""
        for subscription in self._inputs.values():
            self.destroy_subscription(subscription)
        for publisher in self._outputs.values():
            self.destroy_publisher(publisher)
        for timer in self._timers:
            self.destroy_timer(timer)
        self._inputs.clear()
        self._outputs.clear()
        self._publish.clear()
        self._timers.clear()

    def create_timers(self) -> None:
        """Timers of the graph, the watchdog and the health, and the publisher of the health."""
        self._outputs[_HEALTH] = self.create_publisher(DiagnosticArray, '~/health', 10)
        self._outputs[_MONITOR] = self.create_publisher(
            message_class(NEWEST_TYPE), '~/monitor', qos.best_effort(qos.STREAM)
        )
        self.has_viewer = False
        self._newest_inputs.clear()
        self._state_topic = self.resolve_topic_name(f'~/{STATE_NAME}')
        self._tick_timer = self.create_steady_timer(_TICK_PERIOD, self._on_watchdog_timer)
        self._tick_timer.cancel()
        self._is_ticking = False
        self._timers = [
            self._tick_timer,
            self.create_steady_timer(_WATCHDOG_PERIOD, self._on_watchdog_timer),
            self.create_steady_timer(_HEALTH_PERIOD, self._on_health_timer),
            self.create_steady_timer(_INPUT_PERIOD, self._on_input_timer),
        ]

    def begin(self) -> None:
        """Begin to record if ``record`` is set; at the end of `start`."""
        self._logged_errors.clear()
        self._watchdog_called = time.perf_counter_ns()
        self._receipt_offset = time.time_ns() - time.monotonic_ns()
        self._input_watch = InputWatch(self.needed_inputs, time.monotonic(), self._watch.publishers_text)
        if self.settings(RecordingOptions).record:
            self._start_recording()
        else:
            self.publish_configuration()
        self.get_logger().info('estimating')

    def finish(self) -> None:
        """Bring the force to 0 N, stop estimating, finish the bag."""
        if self.active:
            self.fade_out()
        self.active = False
        outcome = self._recording.close()
        if outcome:
            self.get_logger().info(outcome)

    def subscribe(self, name: str, profile: QoSProfile) -> None:
        """Subscribe to an input, in place of the present subscription."""
        if name in self._inputs:
            self.destroy_subscription(self._inputs[name])
        overriding = qos.overridable() if profile is qos.STREAM else None
        self._inputs[name] = self.create_subscription(
            message_class(self.input_type(name)),
            name,
            with_source_time(partial(self._on_message, name)),
            profile,
            raw=True,
            qos_overriding_options=overriding,
            # An event of a subscription that is replaced meanwhile is a segmentation fault of the events executor.
            event_callbacks=SubscriptionEventCallbacks(use_default_callbacks=False),
        )
        self._topics[name] = self._inputs[name].topic_name

    def input_types(self, types: Mapping[str, str]) -> dict[str, str]:
        """Message type of each input; simulated time is one with ``use_sim_time``."""
        return {**types, CLOCK_TOPIC: CLOCK_TYPE} if self.get_parameter('use_sim_time').value else dict(types)

    def _on_message(self, name: str, data: bytes, source: int, received: int) -> None:
        """Take a message that was sent at ``source`` [ns, system clock], and those that wait behind a late one.

        Args:
            name: Input.
            data: Bytes.
            source: When it was sent [ns of the system clock]; 0: not known.
            received: When the middleware received it [ns].
        """
        lateness, now = _lateness(source), time.perf_counter_ns()
        if lateness > _BACKLOG:
            self._sorts_until = now + _SORTING
        if now >= self._sorts_until:
            self.on_input(name, data, lateness)
            return
        for _, of, its_data, its_source in self._backlog((received, name, data, source)):
            self.on_input(of, its_data, _lateness(its_source))

    def _backlog(self, first: tuple[int, str, bytes, int]) -> list[tuple[int, str, bytes, int]]:
        """A message and all that wait in the middleware, in order of their receipt there.

        An executor takes messages one by one, with a pass through itself for each: a node that is behind would stay
        behind. It hears of each message once, also of those that are taken here: for them it takes the next one of the
        same topic, before older ones of other topics. So all messages are sorted until it has heard of all of them.
        """
        waiting, found = [first], [first]
        while found and len(waiting) < _MOST_WAITING:  # what comes while another topic is emptied is in order, too
            found = [message for name in list(self._inputs) for message in self._waiting(name)]
            waiting += found
        return sorted(waiting, key=itemgetter(0))

    def _waiting(self, name: str) -> list[tuple[int, str, bytes, int]]:
        """Messages that wait in the middleware: time of receipt there [ns], input, bytes, time of sending [ns]."""
        found: list[tuple[int, str, bytes, int]] = []
        subscription = self._inputs[name]
        with subscription.handle:
            while len(found) < _MOST_WAITING:
                taken = subscription.handle.take_message(subscription.msg_type, True)
                if taken is None:
                    break
                data, info = taken
                found.append((info['received_timestamp'], name, data, info['source_timestamp']))
        return found

    def create_output(self, key: Any, topic: str, type_name: str) -> None:
        """Create the publisher of an answer or a command; ``_publish[key]`` sends the bytes of one.

        Only an active node answers, so the publisher is none of the life cycle, and the bytes go past the checks of
        `Publisher.publish`: both take time.
        """
        publisher = self._outputs[key] = self.create_publisher(
            message_class(type_name),
            topic,
            qos.STREAM,
            qos_overriding_options=qos.overridable(),
            event_callbacks=PublisherEventCallbacks(
                incompatible_qos=partial(self._watch.on_incompatible_subscriber, key)
            ),
        )
        self._publish[key] = publisher.handle.publish_raw

    def _on_watchdog_timer(self) -> None:
        """Let the watchdog act; every `_TICK_PERIOD` while it has to or somebody looks on, else seldom.

        Graph and clocks have no timer of their own: each call of one wakes two threads.
        """
        now = self._watchdog_called = time.perf_counter_ns()
        if self.on_watchdog():
            self._ticked = now
        self.publish_newest()
        self._apply_due_change()
        is_ticking = self.has_viewer or now - self._ticked < _TICKING
        if is_ticking != self._is_ticking:
            self._is_ticking = is_ticking
            (self._tick_timer.reset if is_ticking else self._tick_timer.cancel)()
        if now - self._watched >= _WATCH_PERIOD:
            self._watched = now
            self._look_at_graph()

    def look_after_timers(self, now: int) -> None:
        """Call what is overdue, if the watchdog was not called for long; after a message, at ``now`` [ns].

        Args:
            now: Of `time.perf_counter_ns`.
        """
        if now - self._watchdog_called > _STARVED:
            self.call_overdue_timers()

    def keep_for_view(self, topic: str, type_name: str, data: bytes) -> None:
        """Keep a message of an input for the live view; to be called while `has_viewer`."""
        self._newest_inputs[topic] = TopicMessage(topic, type_name, data)

    def publish_newest(self) -> None:
        """Publish the newest messages for the live view, if there is one: 100 a second and not thousands."""
        if not self.has_viewer:
            return
        newest = list(self._newest_inputs.values())
        self._newest_inputs.clear()
        for actuator, answer, frame_id in self.newest_answers():
            type_name = type_of(answer)
            topic = f'{actuator}/{_TOPIC_OF[type_name]}'
            newest.append(TopicMessage(topic, type_name, encode(answer, frame_id)))
        if newest:
            self._outputs[_MONITOR].publish(encode_newest(newest))

    # --- parameters ---

    def on_change(self, changed: Collection[Parameter]) -> None:
        """Apply changed settings between two samples, at most every `_CHANGE_PERIOD`; a force that is off, at once."""
        self._sets += 1
        self._is_change_due = True
        is_off = any(one.name.endswith(f'{FEEDFORWARD_PREFIX}scale') and one.value == 0.0 for one in changed)
        self._apply_due_change(is_urgent=is_off or not self.active)

    def _apply_due_change(self, *, is_urgent: bool = False) -> None:
        now = time.perf_counter_ns()
        if self._is_change_due and (is_urgent or now - self._applied >= _CHANGE_PERIOD):
            self._is_change_due, self._applied = False, now
            self._applications += 1
            self.apply_change()

    def report_sets(self) -> dict[str, DiagnosticStatus]:
        """A warning if parameters are set more often than they are applied."""
        sets, applied = self._sets, self._applications
        self._sets = self._applications = 0
        if sets <= applied + 1:
            return {}
        message = f'parameters were set {sets} times since the last report and applied {applied} times'
        return {'parameters': DiagnosticStatus(level=DiagnosticStatus.WARN, message=message)}

    def check_change(self, changed: Mapping[ParameterGroup, Any]) -> None:
        """Reject a force from placeholder seals.

        Raises:
            ValueError: The change is invalid.
        """
        for group, record in changed.items():
            if isinstance(record, FeedForwardSettings) and record.scale > 0.0 and self.has_placeholder(group.prefix):
                raise ValueError(f'{group.prefix}scale = {record.scale}: {PLACEHOLDER_WARNING}')

    # --- clock and graph ---

    def _look_at_graph(self) -> None:
        """Publish diagnostics when a publisher of an input has appeared or disappeared; follow a clock that was set.

        If the next bag is due, let it begin with a snapshot.
        """
        self.has_viewer = self._outputs[_MONITOR].get_subscription_count() > 0
        if self._watch.has_changed():
            self.publish_diagnostics()
        following = self._recording.continue_in_next_bag()
        if following:
            self.publish_configuration()
            self.get_logger().info(f'recording to {following}')
        if self.active and self.RECORDS_STATES and self._recording.is_state_due(time.monotonic()):
            self._recording.record(self._state_topic, STATE_TYPE, self._now(), encode_text(self.snapshot()))
        if self.active and CLOCK_TOPIC not in self._inputs:
            offset = time.time_ns() - self._now()
            if abs(offset - self.clock_offset) > _LARGEST_CLOCK_STEP:
                self._follow_clock(offset)

    def _on_input_timer(self) -> None:
        """Say what the node waits for, which input has stopped, and which is back."""
        if not self.active:
            return
        for remark in self._input_watch.look(self.received(), time.monotonic()):
            if remark.is_warning:
                self.get_logger().warning(remark.text)
            else:  # a line of its own: rclpy allows one severity a line
                self.get_logger().info(remark.text)

    def _follow_clock(self, offset: int) -> None:
        """Judge the age of stamps by a clock that was set; the time of receipt goes on."""
        self.get_logger().warning(f'the clock was set by {(offset - self.clock_offset) * 1e-9:.3f} s')
        self.set_clock_offset(offset)
        self.publish_configuration()

    def _now(self) -> int:
        """Time of receipt [ns]: the clock as it was at activation. It goes on whatever clocks and simulated time do."""
        return time.monotonic_ns() + self._receipt_offset

    # --- recording ---

    def publish_configuration(self) -> None:
        """Publish and record all that the next answer depends on."""
        self.publish_recorded(CONFIGURATION_TYPE, CONFIGURATION_TYPE, encode_text(self.snapshot()))

    def publish_recorded(self, key: Any, type_name: str, data: bytes) -> None:
        """Publish a message by the publisher ``key``, and record it."""
        self._outputs[key].publish(data)
        self._recording.record(self._topics[key], type_name, self._now(), data)

    def _start_recording(self) -> tuple[bool, str]:
        """Start a bag, which begins with a snapshot; success, and the folder of the bag or the error."""
        try:
            path = self._recording.start(self.settings(RecordingOptions))
        except ValueError as error:
            self.log_error_once('recorder', str(error))
            self.publish_configuration()
            return False, str(error)
        self.publish_configuration()
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
        del request
        response.success = self.active
        response.message = 'scale 1, offset 0 N' if self.active else 'not active: nothing is learnt'
        if self.active:
            self.reset_adaptation()
            self.publish_configuration()  # a replay forgets at the same message
        return response

    # --- diagnostics ---

    def _on_health_timer(self) -> None:
        """Publish the health of the seals while the adaptation learns."""
        message = DiagnosticArray()
        for part, status in self.health().items():
            status.name = f'{self.get_fully_qualified_name()}: {part}'
            message.status.append(status)
        if message.status:
            message.header.stamp = self.get_clock().now().to_msg()
            self._outputs[_HEALTH].publish(message)

    def report_graph(self, graph: GraphFindings) -> DiagnosticStatus:
        """Log what is new about the graph and the recorder; status of the recorder."""
        recorder = self._recording.report()
        self.log_error_once('publishers', '; '.join(graph.duplicates))
        self.log_error_once('unheard', '; '.join(graph.unheard))
        self.log_error_once('recorder', recorder.message if recorder.level == DiagnosticStatus.ERROR else '')
        return recorder

    def log_error_once(self, subject: str, error: str) -> None:
        """Log an error when it appears or changes, not every second."""
        if error and error != self._logged_errors.get(subject):
            self.get_logger().error(error)
        self._logged_errors[subject] = error

    def is_refused(self, duplicates: list[str]) -> bool:
        """Whether the inputs are rejected, since these topics have several publishers."""
        return bool(duplicates) and self.settings(InputOptions).refuse_second_publisher
