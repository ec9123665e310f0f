"""Live node: estimates friction and feed-forward from pressure, velocity, force sum and reference, and records all."""

import sys
import time
from collections.abc import Collection, Mapping
from dataclasses import replace
from typing import Any, ClassVar

from diagnostic_msgs.msg import DiagnosticStatus

from seal_friction_ros.core.estimation.adaptation import NOT_ADAPTED, AdaptationSettings
from seal_friction_ros.core.estimation.configuration import (
    PLACEHOLDER_WARNING,
    Configuration,
    SealSelection,
    Snapshot,
    snapshot_text,
)
from seal_friction_ros.core.estimation.estimator import EstimatorSettings
from seal_friction_ros.core.estimation.feedforward import FeedForwardSettings, newest_force
from seal_friction_ros.core.estimation.messages import (
    CLOCK_TOPIC,
    CONFIGURATION_TYPE,
    DECODERS,
    ESTIMATE_TYPE,
    INPUTS,
    OUTPUTS,
    TICK_TYPE,
    Output,
    encode,
    type_of,
)
from seal_friction_ros.core.estimation.node_options import (
    FRICTION_ESTIMATOR_PARAMETERS,
)
from seal_friction_ros.core.estimation.pipeline import init, is_tick_due, receive
from seal_friction_ros.core.estimation.records import WatchdogTick
from seal_friction_ros.core.machine.answers_together import NamedAnswer
from seal_friction_ros.files import load_configuration
from seal_friction_ros.nodes import qos
from seal_friction_ros.nodes.estimator_diagnostics import EstimatorDiagnostics
from seal_friction_ros.nodes.estimator_node import LAST_FORCES, STOP_PERIOD, EstimatorNode
from seal_friction_ros.nodes.executor import run
from seal_friction_ros.nodes.graph_watch import GraphWatch
from seal_friction_ros.nodes.managed_node import message_class

SWITCH_INTERVAL = 5e-5  # [s] longest time that the recorder thread delays a sample; Python's default is 5 ms
NEEDED_INPUTS = (
    'cylinder_pressure',
    'force_sum',
    'rod_velocity',
    CLOCK_TOPIC,
)  # the others are for the feed-forward, or only recorded


class FrictionEstimator(EstimatorNode):
    """Lifecycle node around `core.estimation.pipeline`.

    Raises:
        ValueError: A parameter has the wrong type or is out of bounds.
    """

    RECORDS_STATES: ClassVar = True

    def __init__(self, **kwargs: Any) -> None:
        self._configuration: Configuration | None = None
        self._sent: list[tuple[str, Output, bytes]] = []
        super().__init__('friction_estimator', FRICTION_ESTIMATOR_PARAMETERS, **kwargs)

    # --- lifecycle ---

    def make(self) -> None:
        """Read the seal files; create publishers and subscriptions."""
        settings = map(self.settings, (EstimatorSettings, FeedForwardSettings, AdaptationSettings))
        configuration = load_configuration(self.settings(SealSelection), *settings).without_placeholder_force()
        if configuration.has_placeholder:
            self.get_logger().warning(PLACEHOLDER_WARNING)
        self._types = self.input_types(INPUTS)
        self._statistics = EstimatorDiagnostics(self._types)
        answers = {type_name: type_name for type_name in OUTPUTS.values()}
        self._watch = GraphWatch(self, self._inputs, self._types, self._outputs, answers, self.subscribe)
        for topic, type_name in OUTPUTS.items():
            self.create_output(type_name, topic, type_name)
        self._outputs[CONFIGURATION_TYPE] = self.create_lifecycle_publisher(
            message_class(CONFIGURATION_TYPE), '~/configuration', qos.LATCHED
        )
        self._topics = {type_name: publisher.topic_name for type_name, publisher in self._outputs.items()}
        for name in self._types:
            self.subscribe(name, qos.STREAM)
        self._topics[TICK_TYPE] = self.resolve_topic_name('~/watchdog_tick')
        self.create_timers()
        self._configuration = configuration

    def release(self) -> None:
        """Destroy publishers and subscriptions."""
        super().release()
        self._configuration = None

    def start(self) -> None:
        """Start to estimate from the initial state, and to record if ``record`` is set."""
        self._known = self._configuration.parameters()
        refused = self.is_refused(self._watch.duplicate_publishers())
        self._state = init(self._known)._replace(refused=refused)
        if CLOCK_TOPIC in self._types:
            self._state = self._state._replace(clock=0)  # stands still until it comes
        self._statistics = EstimatorDiagnostics(self._types)
        self.begin()

    def input_type(self, name: str) -> str:
        """Message type of an input."""
        return self._types[name]

    @property
    def needed_inputs(self) -> Collection[str]:
        """Inputs without which there is no good estimate."""
        return [name for name in self._types if name in NEEDED_INPUTS]

    def received(self) -> Mapping[str, int]:
        """Messages of each input since activation."""
        return self._statistics.received

    @property
    def clock_offset(self) -> int:
        """What the clock of the stamps shows after the clock of receipt [ns]."""
        return self._state.clock_offset

    def set_clock_offset(self, offset: int) -> None:
        """Use another offset [ns] from now on."""
        self._state = self._state._replace(clock_offset=offset)

    # --- the live path ---

    def on_input(self, name: str, data: bytes, lateness: int) -> None:
        """Take one message of an input, ``lateness`` [ns] after it was sent."""
        taken = time.perf_counter_ns()
        if not self.active:
            return
        type_name = self._types[name]
        try:
            message = DECODERS[type_name](data)
        except ValueError as error:
            self._statistics.on_malformed(name)
            self.get_logger().error(f'{self._topics[name]}: {error}', throttle_duration_sec=1.0)
            self.look_after_timers(taken)
            return
        received = self._now()
        sent = max(received - lateness, 0)
        self._sent.clear()
        before = self._state
        self._state = receive(self._known, before, message, received, self._send, sent)
        done = time.perf_counter_ns()

        # Nobody waits for what follows.
        self._recording.record(self._topics[name], type_name, received, data, sent)
        if self.has_viewer:
            self.keep_for_view(self._topics[name], type_name, data)
        self._statistics.on_input(name, message.stamp, lateness)
        if name == CLOCK_TOPIC:
            self._statistics.on_clock(message.stamp)
        if self._sent:
            self._record_answers(done - taken)
        if name == 'rod_velocity':
            if self._known.estimator.adapts:
                self._statistics.on_adaptation(self._known.estimator, self._state.turn_since(before))
            self._recording.flush_if_idle()
        self.look_after_timers(done)

    def _record_answers(self, latency: int = 0) -> None:
        """Record and count what was sent, ``latency`` [ns] after its input was taken."""
        for answer_type, answer, answer_data in self._sent:
            self._recording.record(self._topics[answer_type], answer_type, self._now(), answer_data)
            if answer_type == ESTIMATE_TYPE:
                self._statistics.on_estimate(answer, latency)
            else:
                self._statistics.on_feedforward(answer)

    def on_watchdog(self) -> bool:
        """Renew the feed-forward while no velocity sample does, so that it fades out."""
        if not self.active or not is_tick_due(self._state, self._now()):
            return False
        self._tick(self._now())
        return True

    def _tick(self, received: int) -> None:
        tick = WatchdogTick(received + self._state.clock_offset, (received - self._state.feedforward.received) * 1e-9)
        self._sent.clear()
        self._state = receive(self._known, self._state, tick, received, self._send)
        self._recording.record(self._topics[TICK_TYPE], TICK_TYPE, received, encode(tick))
        self._record_answers()

    def fade_out(self) -> None:
        """Fade the force to 0 N within ``fade_time``, whatever comes."""
        if newest_force(self._state.feedforward) == 0.0:
            return
        self._state = self._state._replace(refused=True)
        self.publish_configuration()  # a replay fades from here on
        left = LAST_FORCES
        while left:
            time.sleep(STOP_PERIOD)
            self._tick(self._now())
            self.publish_newest()
            left -= self._state.feedforward.fade == 0.0

    def _send(self, answer: Output, frame_id: bytes) -> None:
        """Publish an answer at once; the rest waits until all answers are out."""
        type_name, data = type_of(answer), encode(answer, frame_id)
        self._publish[type_name](data)
        self._sent.append((type_name, answer, data))

    # --- parameters ---

    def has_placeholder(self, prefix: str) -> bool:
        """Whether a seal is the placeholder."""
        del prefix  # of the only actuator
        return self._configuration is not None and self._configuration.has_placeholder

    def apply_change(self) -> None:
        """Apply the present parameters."""
        self._refuse_inputs(self._watch.duplicate_publishers())
        changed = replace(
            self._configuration,
            settings=self.settings(EstimatorSettings),
            feedforward=self.settings(FeedForwardSettings),
            adaptation=self.settings(AdaptationSettings),
        ).without_placeholder_force()
        if changed == self._configuration:
            return
        self._configuration = changed
        if self.active:
            self._known = changed.parameters(self._known.estimator.seals)
            self.publish_configuration()

    def snapshot(self) -> str:
        """All that the next answer depends on, as text."""
        return snapshot_text(Snapshot(self._configuration, self._state))

    def reset_adaptation(self) -> None:
        """Forget what the adaptation has learnt."""
        self._state = self._state._replace(estimator=self._state.estimator._replace(adaptation=NOT_ADAPTED))
        self._statistics.on_reset()

    # --- diagnostics ---

    def diagnostics(self) -> dict[str, DiagnosticStatus]:
        """Status of the estimate, of its inputs and outputs, and of the recorder."""
        graph = self._watch.findings(self._statistics.silent_inputs, retry=self.active)
        self._refuse_inputs(graph.duplicates)
        adapting = self._known.estimator if self._adapts else None
        known = self._state.estimator if self.active else None
        estimate = self._statistics.report(self.active, self.active and self._state.refused, graph, adapting, known)
        return {'estimate': estimate, 'recorder': self.report_graph(graph), **self.report_sets()}

    @property
    def _adapts(self) -> bool:
        return self.active and self._known.estimator.adapts

    def health(self) -> dict[str, DiagnosticStatus]:
        """Indicators of the seals while the adaptation learns."""
        if not self._adapts:
            return {}
        return {'seals': self._statistics.health(self._known.estimator, self._state.estimator.adaptation)}

    def newest_answers(self) -> list[NamedAnswer]:
        """The newest answers since the last call."""
        return self._statistics.take_newest('')

    def end_interval(self) -> None:
        """Start a new interval of rates and latencies."""
        self._statistics.start_interval()

    def _refuse_inputs(self, duplicates: list[str]) -> None:
        """Reject the inputs while ``refuse_second_publisher`` is set and topics have several publishers."""
        refused = self.is_refused(duplicates)
        if self.active and refused != self._state.refused:
            self._state = self._state._replace(refused=refused)
            self.publish_configuration()  # a replay rejects the inputs from the same message on


def main() -> int:
    """Run the node: ``friction_estimator --ros-args -p seals:=[...] --params-file FILE``."""
    sys.setswitchinterval(SWITCH_INTERVAL)
    return run(FrictionEstimator, FrictionEstimator.autostart, FrictionEstimator.finish)


if __name__ == '__main__':
    sys.exit(main())
