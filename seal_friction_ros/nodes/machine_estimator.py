"""Live node for a machine of several actuators with messages of any type, see `core.machine`."""

import sys
import time
from collections import Counter
from collections.abc import Collection, Mapping
from dataclasses import replace
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus

from seal_friction_ros.core.estimation.adaptation import NOT_ADAPTED, AdaptationSettings
from seal_friction_ros.core.estimation.configuration import PLACEHOLDER_WARNING, Configuration
from seal_friction_ros.core.estimation.estimator import EstimatorSettings
from seal_friction_ros.core.estimation.feedforward import FeedForward, FeedForwardSettings
from seal_friction_ros.core.estimation.messages import (
    CLOCK_TOPIC,
    CLOCK_TYPE,
    CONFIGURATION_TYPE,
    ESTIMATE_TYPE,
    OUTPUTS,
    TICK_TYPE,
    Output,
    encode,
    type_of,
)
from seal_friction_ros.core.estimation.node_options import (
    ADAPTATION_PREFIX,
    FEEDFORWARD_PREFIX,
    MACHINE_ESTIMATOR_PARAMETERS,
    MachineOptions,
)
from seal_friction_ros.core.estimation.records import WatchdogTick
from seal_friction_ros.core.foundation.parameters import ParameterGroup
from seal_friction_ros.core.machine.answers_together import MACHINE_TYPE, NamedAnswer, encode_together
from seal_friction_ros.core.machine.gauge_or_absolute import Lowest, pressure_remarks
from seal_friction_ros.core.machine.machine import (
    Machine,
    MachineActuator,
    MachineState,
    due,
    init,
    make_machine,
    missing,
    receive,
    record_plan,
)
from seal_friction_ros.core.machine.machine_file import Actuator, MachineFile
from seal_friction_ros.core.machine.machine_snapshot import machine_text, snapshot_of
from seal_friction_ros.core.machine.message_fields import Definition, full_name, parse_definition
from seal_friction_ros.core.machine.outputs import Command, due_commands
from seal_friction_ros.files import load_configuration, read_machine, read_machine_document
from seal_friction_ros.nodes import qos
from seal_friction_ros.nodes.estimator_diagnostics import EstimatorDiagnostics
from seal_friction_ros.nodes.estimator_node import LAST_FORCES, STOP_PERIOD, EstimatorNode
from seal_friction_ros.nodes.executor import run
from seal_friction_ros.nodes.friction_estimator import SWITCH_INTERVAL
from seal_friction_ros.nodes.graph_watch import GraphWatch
from seal_friction_ros.nodes.managed_node import message_class
from seal_friction_ros.offline.bags.bag import message_definition


class MachineEstimator(EstimatorNode):
    """Lifecycle node around `core.machine.machine`.

    Raises:
        ValueError: A parameter has the wrong type or is out of bounds, or the mapping file is not valid.
    """

    def __init__(self, **kwargs: Any) -> None:
        self._sent: list[NamedAnswer] = []
        self._together = b''
        self._newest: dict[str, bytes] = {}
        super().__init__('machine_estimator', MACHINE_ESTIMATOR_PARAMETERS, **kwargs)

    def more_groups(self) -> tuple[ParameterGroup, ...]:
        """Read the mapping file; the parameters of each actuator begin with its name."""
        name = self.settings(MachineOptions).machine
        if not name:
            raise ValueError('machine is not set: give the mapping file, -p machine:=robot.yaml')
        self._document: Mapping[str, Any] = read_machine_document(name)
        self._file: MachineFile = read_machine(name)
        return tuple(group for actuator in self._file.actuators for group in _groups(actuator))

    # --- lifecycle ---

    def make(self) -> None:
        """Read the seal files; create publishers and subscriptions."""
        self._definitions: dict[str, Definition] = {
            kind: parse_definition(kind, message_definition(full_name(kind))[0]) for kind in self._file.topics.values()
        }
        self._machine = self._made()
        if any(actuator.configuration.has_placeholder for actuator in self._machine.actuators):
            self.get_logger().warning(PLACEHOLDER_WARNING)
        clock = record_plan(CLOCK_TOPIC, CLOCK_TYPE, range(len(self._file.actuators)))
        self._plans = {**self._machine.plans, CLOCK_TOPIC: clock}
        self._types = self.input_types({topic: full_name(self._file.topics[topic]) for topic in self._machine.plans})
        self._new_statistics()
        answers = {('', MACHINE_TYPE): '~/friction'}
        if not self._file.together:
            answers = {
                (actuator.name, kind): f'{actuator.name}/{topic}'
                for actuator in self._file.actuators
                for topic, kind in OUTPUTS.items()
            }
        types = {key: key[1] for key in answers}
        self._watch = GraphWatch(self, self._inputs, self._types, self._outputs, types, self.subscribe)
        for key, topic in answers.items():
            self.create_output(key, topic, key[1])
        outputs = {a.output.topic: a.output.type_name for a in self._file.actuators if a.output}
        self._has_outputs = bool(outputs)
        for topic, kind in outputs.items():
            self.create_output(('', topic), topic, full_name(kind))
        self._outputs[CONFIGURATION_TYPE] = self.create_lifecycle_publisher(
            message_class(CONFIGURATION_TYPE), '~/configuration', qos.LATCHED
        )
        self._topics = {key: publisher.topic_name for key, publisher in self._outputs.items()}
        self._ticks = [self.resolve_topic_name(f'{actuator.name}/watchdog_tick') for actuator in self._file.actuators]
        for topic in self._types:
            self.subscribe(topic, qos.STREAM)
        self.create_timers()

    def _made(self) -> Machine:
        """Machine with the present parameters."""
        configurations = {actuator.name: self._configuration(actuator) for actuator in self._file.actuators}
        return make_machine(self._file, configurations, self._definitions)

    def _configuration(self, actuator: Actuator) -> Configuration:
        try:
            return load_configuration(actuator.selection, *self._settings(actuator)).without_placeholder_force()
        except ValueError as error:
            raise ValueError(f'{actuator.name}: {error}') from None

    def _changed(self, actuator: MachineActuator) -> MachineActuator:
        """Actuator with the present parameters; itself if they are as they were."""
        settings, feedforward, adaptation = self._settings(actuator.mapping)
        configuration = replace(
            actuator.configuration, settings=settings, feedforward=feedforward, adaptation=adaptation
        ).without_placeholder_force()
        if configuration == actuator.configuration:
            return actuator
        return replace(
            actuator,
            configuration=configuration,
            pipeline=configuration.parameters(actuator.pipeline.estimator.seals),
        )

    def _settings(self, actuator: Actuator) -> list[Any]:
        """Present settings of estimator, feed-forward and adaptation of an actuator."""
        return [self.settings(group.record_type, group.prefix) for group in _groups(actuator)]

    def _new_statistics(self) -> None:
        """Count anew."""
        listens: dict[str, list[str]] = {actuator.name: [] for actuator in self._file.actuators}
        for topic, plan in self._machine.plans.items():
            for number, _ in plan.taken:
                listens[self._file.actuators[number].name].append(topic)
        if CLOCK_TOPIC in self._types:
            for topics in listens.values():
                topics.append(CLOCK_TOPIC)
        self._counted: Counter[str] = Counter()  # messages of each topic
        self._statistics = {name: EstimatorDiagnostics(topics, self._counted) for name, topics in listens.items()}
        self._lowest = [Lowest() for _ in self._file.actuators]
        self._listeners = {
            topic: [self._file.actuators[number].name for number, _ in plan.taken]
            for topic, plan in self._machine.plans.items()
        }
        self._listeners[CLOCK_TOPIC] = list(listens)

    def start(self) -> None:
        """Start to estimate from the initial state, and to record if ``record`` is set."""
        self._state = _with(init(self._machine), refused=self.is_refused(self._watch.duplicate_publishers()))
        if CLOCK_TOPIC in self._types:
            self._state = _with(self._state, clock=0)  # stands still until it comes
        self._new_statistics()
        self._newest.clear()
        self.begin()

    # --- the live path ---

    def on_input(self, name: str, data: bytes, lateness: int) -> None:
        """Take one message of a topic, ``lateness`` [ns] after it was sent."""
        taken = time.perf_counter_ns()
        if not self.active:
            return
        received, before = self._now(), self._state
        sent = max(received - lateness, 0)
        self._sent.clear()
        try:
            plan = self._plans[name]
            self._state = receive(self._machine, before, plan, plan.read(data), received, self._send, sent)
        except ValueError as error:
            for listener in self._listeners[name]:
                self._statistics[listener].on_malformed(name)
            self.get_logger().error(f'{name}: {error}', throttle_duration_sec=1.0)
            self.look_after_timers(taken)
            return
        self._send_together()
        made = self._command(received)
        done = time.perf_counter_ns()

        # Nobody waits for what follows.
        self._recording.record(name, self._types[name], received, data, sent)  # by its name in the mapping file
        if name != CLOCK_TOPIC:
            self._newest[name] = data
        if self.has_viewer:
            self.keep_for_view(name, self._types[name], data)
        self._counted[name] += 1
        for listener in self._listeners[name]:
            self._statistics[listener].on_lateness(name, lateness)
            if name == CLOCK_TOPIC:
                self._statistics[listener].on_clock(self._state.actuators[0].pipeline.clock)
        if self._sent:
            self._record_answers(made, done - taken)
            self._follow(before)
            self._recording.flush_if_idle()
        self.look_after_timers(done)

    def _send(self, name: str, answer: Output, frame_id: bytes) -> None:
        """Publish an answer at once, if it is a message of its own; the rest waits until all answers are out."""
        data = frame_id
        if not self._file.together:
            data = encode(answer, frame_id)
            self._publish[name, type_of(answer)](data)
        self._sent.append(NamedAnswer(name, answer, data))

    def _send_together(self) -> None:
        """Publish the answers to a message as one, if they are no messages of their own."""
        self._together = b''
        if self._file.together and self._sent:
            self._together = encode_together(self._sent)
            self._publish['', MACHINE_TYPE](self._together)

    def _command(self, received: int) -> list[Command]:
        """Publish what the controllers take after a message."""
        if not self._has_outputs:
            return []
        guided = FeedForward in [type(answer) for _, answer, _ in self._sent]
        made = due_commands(self._machine, self._state, guided, received)
        for command in made:
            self._publish['', command.topic](command.data)
        return made

    def _record_answers(self, made: list[Command], latency: int = 0) -> None:
        """Record and count what was sent, ``latency`` [ns] after its input was taken."""
        for name, answer, data in self._sent:
            kind, statistics = type_of(answer), self._statistics[name]
            if not self._together:
                self._recording.record(self._topics[name, kind], kind, self._now(), data)
            if kind == ESTIMATE_TYPE:
                statistics.on_estimate(answer, latency)
            else:
                statistics.on_feedforward(answer)
        if self._together:
            self._recording.record(self._topics['', MACHINE_TYPE], MACHINE_TYPE, self._now(), self._together)
        for command in made:
            self._recording.record(command.topic, full_name(command.type_name), self._now(), command.data)

    def _follow(self, before: MachineState) -> None:
        """Follow pressures and adaptation of the actuators that have answered."""
        states = zip(self._machine.actuators, before.actuators, self._state.actuators, strict=True)
        for number, (actuator, known, newest) in enumerate(states):
            if newest is known:
                continue
            self._lowest[number] = self._lowest[number].after(newest.pipeline.pressure)
            parameters = actuator.pipeline.estimator
            if parameters.adapts:
                turn = newest.pipeline.turn_since(known.pipeline)
                self._statistics[actuator.name].on_adaptation(parameters, turn)

    def on_watchdog(self) -> bool:
        """Renew each feed-forward that no velocity sample renews, so that it fades out."""
        if not self.active:
            return False
        numbers = due(self._state, self._now())
        for number in numbers:
            self._tick(number, self._now())  # a bag holds each message at a time of its own
        return bool(numbers)

    def _tick(self, number: int, received: int) -> None:
        made = self._state.actuators[number].pipeline.feedforward.received
        tick = WatchdogTick(received + self.clock_offset, (received - made) * 1e-9)
        self._sent.clear()
        plan = record_plan(self._ticks[number], TICK_TYPE, (number,))
        self._state = receive(self._machine, self._state, plan, tick, received, self._send)
        self._send_together()
        made = self._command(received)
        self._recording.record(self._ticks[number], TICK_TYPE, received, encode(tick))
        self._record_answers(made)

    def fade_out(self) -> None:
        """Fade every force to 0 N within ``fade_time``, whatever comes."""
        acting = [number for number, known in enumerate(self._state.actuators) if known.force != 0.0]
        if not acting:
            return
        self._state = _with(self._state, refused=True)
        self.publish_configuration()  # a replay fades from here on
        left = LAST_FORCES
        while left:
            time.sleep(STOP_PERIOD)
            for number in acting:
                self._tick(number, self._now())
            self.publish_newest()
            left -= all(known.pipeline.feedforward.fade == 0.0 for known in self._at(acting))

    def _at(self, numbers: list[int]) -> list[Any]:
        return [self._state.actuators[number] for number in numbers]

    # --- parameters and state ---

    def has_placeholder(self, prefix: str) -> bool:
        """Whether a seal of the actuator whose parameters begin with a prefix is the placeholder."""
        found = [one.configuration for one in self._machine.actuators if prefix.startswith(f'{one.name}.')]
        return any(configuration.has_placeholder for configuration in found)

    def input_type(self, name: str) -> str:
        """Message type of a topic."""
        return self._types[name]

    @property
    def needed_inputs(self) -> Collection[str]:
        """Topics of the mapping file."""
        return tuple(self._types)

    def received(self) -> Mapping[str, int]:
        """Messages of each topic since activation."""
        return {topic: count for one in self._statistics.values() for topic, count in one.received.items()}

    @property
    def clock_offset(self) -> int:
        """What the clock of the stamps shows after the clock of receipt [ns]."""
        return self._state.actuators[0].pipeline.clock_offset

    def set_clock_offset(self, offset: int) -> None:
        """Use another offset [ns] from now on."""
        self._state = _with(self._state, clock_offset=offset)

    def apply_change(self) -> None:
        """Apply the present parameters."""
        self._refuse_inputs(self._watch.duplicate_publishers())
        changed = tuple(map(self._changed, self._machine.actuators))
        if all(new is old for new, old in zip(changed, self._machine.actuators, strict=True)):
            return
        self._machine = replace(self._machine, actuators=changed)
        if self.active:
            self.publish_configuration()

    def snapshot(self) -> str:
        """All that the next answer depends on, as text."""
        return machine_text(snapshot_of(self._machine, self._state))

    def reset_adaptation(self) -> None:
        """Forget what the adaptation of every actuator has learnt."""
        states = [
            known._replace(
                pipeline=known.pipeline._replace(estimator=known.pipeline.estimator._replace(adaptation=NOT_ADAPTED))
            )
            for known in self._state.actuators
        ]
        self._state = MachineState(tuple(states))
        for statistics in self._statistics.values():
            statistics.on_reset()

    # --- diagnostics ---

    def diagnostics(self) -> dict[str, DiagnosticStatus]:
        """Status of each actuator, of the inputs and outputs, and of the recorder."""
        silent = {topic for statistics in self._statistics.values() for topic in statistics.silent_inputs}
        graph = self._watch.findings(sorted(silent), retry=self.active)
        self._refuse_inputs(graph.duplicates)
        parts = {}
        for number, actuator in enumerate(self._machine.actuators):
            name, active = actuator.name, self.active
            adapting = actuator.pipeline.estimator if active and actuator.pipeline.estimator.adapts else None
            known = self._state.actuators[number].pipeline if active else None
            refused = known is not None and known.refused
            status = self._statistics[name].report(active, refused, graph, adapting, known.estimator if known else None)
            said = self._unanswered(number) if active else []
            if said:
                status.level = max(status.level, DiagnosticStatus.WARN)
                status.message = '; '.join([*said, status.message])
            parts[name] = status
        return {**parts, 'recorder': self.report_graph(graph), **self.report_sets()}

    def _unanswered(self, number: int) -> list[str]:
        """What is wrong with the messages of an actuator: not taken, without its numbers, gauge or absolute."""
        said = [self._state.actuators[number].fault] if self._state.actuators[number].fault else []
        for topic, data in self._newest.items():
            said += [f'{topic}: {text}' for text in missing(self._machine, number, topic, data)]
        return said + pressure_remarks(self._file, self._file.actuators[number], self._lowest[number])

    def health(self) -> dict[str, DiagnosticStatus]:
        """Indicators of the seals of each actuator whose adaptation learns."""
        found = {}
        for actuator, known in zip(self._machine.actuators, self._state.actuators if self.active else (), strict=False):
            if actuator.pipeline.estimator.adapts:
                adaptation = known.pipeline.estimator.adaptation
                found[f'{actuator.name} seals'] = self._statistics[actuator.name].health(
                    actuator.pipeline.estimator, adaptation
                )
        return found

    def newest_answers(self) -> list[NamedAnswer]:
        """The newest answers of each actuator since the last call."""
        return [answer for name, statistics in self._statistics.items() for answer in statistics.take_newest(name)]

    def end_interval(self) -> None:
        """Start a new interval of rates and latencies."""
        for statistics in self._statistics.values():
            statistics.start_interval()

    def _refuse_inputs(self, duplicates: list[str]) -> None:
        """Reject the inputs while ``refuse_second_publisher`` is set and topics have several publishers."""
        refused = self.is_refused(duplicates)
        if self.active and refused != self._state.actuators[0].pipeline.refused:
            self._state = _with(self._state, refused=refused)
            self.publish_configuration()  # a replay rejects the inputs from the same message on


def _groups(actuator: Actuator) -> tuple[ParameterGroup, ...]:
    """Parameters of an actuator, which change while the node runs; their defaults are those of the mapping file."""
    name = f'{actuator.name}.'
    return (
        ParameterGroup(EstimatorSettings, name, defaults=actuator.settings),
        ParameterGroup(FeedForwardSettings, name + FEEDFORWARD_PREFIX, defaults=actuator.feedforward),
        ParameterGroup(AdaptationSettings, name + ADAPTATION_PREFIX, defaults=actuator.adaptation),
    )


def _with(state: MachineState, **changed: Any) -> MachineState:
    """State with fields of the pipeline of every actuator changed."""
    return MachineState(tuple(k._replace(pipeline=k.pipeline._replace(**changed)) for k in state.actuators))


def main() -> int:
    """Run the node: ``machine_estimator --ros-args -p machine:=robot.yaml``."""
    sys.setswitchinterval(SWITCH_INTERVAL)
    return run(MachineEstimator, MachineEstimator.autostart, MachineEstimator.finish)


if __name__ == '__main__':
    sys.exit(main())
