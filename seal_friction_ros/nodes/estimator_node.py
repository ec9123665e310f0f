"""The live node: estimates friction and feed-forward of every actuator of a machine, and records all."""

import sys
import time
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import chain
from operator import itemgetter
from typing import Any, NamedTuple

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from std_srvs.srv import Trigger

from seal_friction_ros.core.estimation import node_options, pipeline
from seal_friction_ros.core.estimation.adaptation import NOT_ADAPTED, AdaptationSettings, AdaptationState
from seal_friction_ros.core.estimation.configuration import PLACEHOLDER_WARNING, Configuration, SealSelection
from seal_friction_ros.core.estimation.estimator import EstimatorSettings
from seal_friction_ros.core.estimation.feedforward import FeedForwardSettings
from seal_friction_ros.core.estimation.node_options import FEEDFORWARD_PREFIX, RecordingOptions
from seal_friction_ros.core.foundation.parameters import ParameterGroup
from seal_friction_ros.core.machine.gauge_or_absolute import Lowest, pressure_remarks
from seal_friction_ros.core.machine.machine import (
    Machine,
    MachineActuator,
    MachineState,
    TopicPlan,
    due,
    init,
    make_machine,
    missing,
    receive,
    record_plan,
)
from seal_friction_ros.core.machine.machine_file import Actuator, MachineFile, own_file
from seal_friction_ros.core.machine.machine_snapshot import machine_text, snapshot_of
from seal_friction_ros.core.machine.outputs import Command, due_commands
from seal_friction_ros.core.messages import layouts
from seal_friction_ros.core.messages.coder import ENCODERS, TYPES, encode, encode_text, type_of
from seal_friction_ros.core.messages.definitions import full_name
from seal_friction_ros.core.messages.layouts import CLOCK_TOPIC, CONFIGURATION_TYPE, MACHINE_TYPE, OUTPUTS, TICK_TYPE
from seal_friction_ros.core.messages.records import FeedForward, FrictionEstimate, Output, WatchdogTick
from seal_friction_ros.core.messages.together import NamedAnswer, TopicMessage, encode_newest, encode_together
from seal_friction_ros.files import load_configuration, read_machine
from seal_friction_ros.nodes import qos
from seal_friction_ros.nodes.estimator_diagnostics import EstimatorDiagnostics
from seal_friction_ros.nodes.executor import run
from seal_friction_ros.nodes.graph_watch import GraphFindings, GraphWatch
from seal_friction_ros.nodes.input_watch import InputWatch
from seal_friction_ros.nodes.managed_node import OVERDUE, ManagedNode, message_class, status_of
from seal_friction_ros.nodes.recording import Recording
from seal_friction_ros.nodes.subscription import taken, with_info
from seal_friction_ros.offline.bags.bag import STATE_NAME, STATE_TYPE
from seal_friction_ros.offline.bags.definitions import installed_definitions

SWITCH_INTERVAL = 5e-5  # [s] longest time that the recorder thread delays a sample; Python's default is 5 ms
_OPTIONAL_INPUTS = ('servo_reference', 'rod_position', 'seal_temperature')  # without them there are good estimates
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
_SORTING = 1_000_000_000  # [ns] after a late message, until the executor has heard of all taken before its turn
_STOP_PERIOD = 0.005  # [s] between two forces while the node stops
_LAST_FORCES = 10  # of 0 N at the end: a subscriber may lose what it has not taken when a publisher goes
_HEALTH, _MONITOR = 'health', 'monitor'  # keys of their publishers
_TOPIC_OF = {type_name: topic for topic, type_name in OUTPUTS.items()}


def _lateness(source: int) -> int:
    """Time [ns] since a message was sent at ``source`` [ns of the system clock]; 0 if the middleware does not tell."""
    return time.time_ns() - source if source else 0


class _Input(NamedTuple):
    """An input of an active node."""

    plan: TopicPlan
    topic: str
    type_name: str
    statistics: list[EstimatorDiagnostics]  # of the actuators that take it
    uncounted: list[tuple[int | None, int]]  # stamp and lateness [ns] of each message since the last `_count`


class _Output(NamedTuple):
    """An answer of an actuator of an active node."""

    actuator: str
    topic: str
    type_name: str
    encode: Callable[[Output, bytes], bytes]
    publish: Callable[[bytes], None] | None  # None: the answers of all actuators are one message
    count: Callable[[Sequence[tuple[Any, int]]], None]
    uncounted: list[tuple[Output, int]]  # each since the last `_count`, and when [ns] after its input it was sent


class EstimatorNode(ManagedNode):
    """Lifecycle node around `core.machine.machine`.

    With a parameter ``machine`` it has the actuators of that mapping file; without, one with the built-in mapping.
    ValueError: A parameter has the wrong type or is out of bounds, or the mapping file is not valid.
    """

    _watch: GraphWatch
    _input_watch: InputWatch
    _machine: Machine
    _state: MachineState

    def __init__(self, name: str, groups: tuple[ParameterGroup, ...], **kwargs: Any) -> None:
        self._mapping: MachineFile | None = None
        self._sent: list[tuple[_Output, Output, bytes]] = []  # where to, answer, its bytes or frame name
        self._together = b''
        self._newest: dict[str, bytes] = {}
        self._bound: dict[str, _Input] = {}  # by name
        self._sending: list[dict[type, _Output]] = []  # of each actuator, by the record of an answer
        self._emits: list[pipeline.Emit] = []  # of each actuator
        self._learnt: list[AdaptationState] = []  # of each actuator, when it was last followed
        self._receipt_offset = 0  # [ns] of the clock over the steady one, as it was at activation
        self._complete: set[str] = set()  # topics that had all numbers of all actuators in a message
        self._logged_errors: dict[str, str] = {}
        self._inputs: dict[str, Any] = {}
        self._recorded_only: list[Any] = []  # subscriptions to topics of the mapping file that no input uses
        self._outputs: dict[Any, Any] = {}
        self._publish: dict[Any, Callable[[bytes], None]] = {}
        self._topics: dict[Any, str] = {}
        self._newest_inputs: dict[str, TopicMessage] = {}
        self.has_viewer = False  # by a live view
        self._ticked = self._watched = 0  # [ns] of `time.perf_counter_ns`
        self._watchdog_called = 0  # [ns] as of `now`
        self._is_ticking = False
        self._sorts_until = 0  # [ns] of `time.perf_counter_ns`; 0: messages are taken as they come
        self._is_change_due, self._applied = False, 0  # [ns] of `time.perf_counter_ns`
        self._sets = self._applications = 0  # of parameters since the last report
        super().__init__(name, groups, **kwargs)
        self.recording = Recording(self.get_fully_qualified_name())
        for service, act, refusal in (
            ('start_recording', self._start_recording, 'not active: nothing to record'),
            ('stop_recording', self._stop_recording, ''),
            ('reset_adaptation', self._reset_adaptation, 'not active: nothing is learnt'),
        ):
            self.create_service(Trigger, f'~/{service}', partial(self._serve, act, refusal))

    # --- lifecycle ---

    def more_groups(self) -> tuple[ParameterGroup, ...]:
        """Read the mapping file; the parameters of each of its actuators begin with its name."""
        if not self.has_parameter('machine'):
            return ()
        name = self.settings(node_options.MachineOptions).machine
        if not name:
            raise ValueError('machine is not set: give the mapping file, -p machine:=robot.yaml')
        self._mapping = read_machine(name)
        return tuple(group for actuator in self._mapping.actuators for group in _groups(actuator))

    def make(self) -> None:
        """Read the seal files; create publishers and subscriptions."""
        self._file = self._mapping or own_file(self.settings(SealSelection))
        self._machine = self._made()
        if any(actuator.configuration.has_placeholder for actuator in self._machine.actuators):
            self.get_logger().warning(PLACEHOLDER_WARNING)
        numbers = range(len(self._file.actuators))
        self._plans: dict[str, TopicPlan] = {
            **self._machine.plans,
            CLOCK_TOPIC: record_plan(CLOCK_TOPIC, layouts.CLOCK_TYPE, numbers),
        }
        self._types = {topic: full_name(self._file.topics[topic]) for topic in self._machine.plans}
        if self.get_parameter('use_sim_time').value:
            self._types[CLOCK_TOPIC] = layouts.CLOCK_TYPE
        self._new_statistics()
        self._create_outputs()
        ticks = [self.resolve_topic_name(f'{actuator.name or "~"}/watchdog_tick') for actuator in self._file.actuators]
        self._ticks = [record_plan(topic, TICK_TYPE, (number,)) for number, topic in enumerate(ticks)]
        for topic in self._types:
            self.subscribe(topic, qos.STREAM)
        for topic, kind in self._file.topics.items() if self._mapping else ():
            if topic not in self._types and topic not in self._topics.values():
                self._record_only(topic, full_name(kind))
        self._create_timers()

    def _create_outputs(self) -> None:
        answers = {('', MACHINE_TYPE): '~/friction'}
        if not self._file.together:
            answers = {
                (actuator.name, kind): f'{actuator.name}/{topic}'.removeprefix('/')
                for actuator in self._file.actuators
                for topic, kind in OUTPUTS.items()
            }
        types = {key: key[1] for key in answers}
        self._watch = GraphWatch(self, self._inputs, self._types, self._outputs, types, self.subscribe)
        for key, topic in answers.items():
            self._create_output(key, topic, key[1])
        outputs = {a.output.topic: a.output.type_name for a in self._file.actuators if a.output}
        self._has_rest = self._file.together or bool(outputs)  # to be sent after the answers
        for topic, kind in outputs.items():
            self._create_output(('', topic), topic, full_name(kind))
        kind = message_class(CONFIGURATION_TYPE)
        self._outputs[CONFIGURATION_TYPE] = self.create_lifecycle_publisher(kind, '~/configuration', qos.LATCHED)
        self._topics = {key: publisher.topic_name for key, publisher in self._outputs.items()}

    def _made(self) -> Machine:
        configurations = {actuator.name: self._configuration(actuator) for actuator in self._file.actuators}
        kinds = self._file.topics.values() if self._mapping else ()
        return make_machine(self._file, configurations, installed_definitions(kinds))

    def _configuration(self, actuator: Actuator) -> Configuration:
        try:
            return load_configuration(actuator.selection, *self._settings(actuator)).without_placeholder_force()
        except ValueError as error:
            raise ValueError(f'{actuator.name}: {error}'.removeprefix(': ')) from None

    def _changed(self, actuator: MachineActuator) -> MachineActuator:
        """Actuator with the present parameters; itself if they are as they were."""
        names = ('settings', 'feedforward', 'adaptation')
        changed = dict(zip(names, self._settings(actuator.mapping), strict=True))
        configuration = replace(actuator.configuration, **changed).without_placeholder_force()
        if configuration == actuator.configuration:
            return actuator
        pipeline = configuration.parameters(actuator.pipeline.estimator.seals)
        return replace(actuator, configuration=configuration, pipeline=pipeline)

    def _settings(self, actuator: Actuator) -> list[Any]:
        return [self.settings(group.record_type, group.prefix) for group in _groups(actuator)]

    def _new_statistics(self) -> None:
        self._statistics = {
            actuator.name: EstimatorDiagnostics([t for t in self._types if number in dict(self._plans[t].taken)])
            for number, actuator in enumerate(self._file.actuators)
        }
        self._lowest = [Lowest() for _ in self._statistics]

    def _bind(self) -> None:
        """Look up once what each message needs."""
        every = list(self._statistics.values())
        for name, kind in self._types.items():
            taking = [every[number] for number, _ in self._plans[name].taken]
            self._bound[name] = _Input(self._plans[name], self._topics[name], kind, taking, [])
        self._sending = [self._outputs_of(*named) for named in self._statistics.items()]
        self._emits = [partial(self._send, outputs) for outputs in self._sending]
        self._learnt = [known.pipeline.estimator.adaptation for known in self._state.actuators]

    def _outputs_of(self, name: str, statistics: EstimatorDiagnostics) -> dict[type, _Output]:
        counts = {FrictionEstimate: statistics.on_estimates, FeedForward: statistics.on_feedforwards}
        found = {}
        for record, count in counts.items():
            key = name, TYPES[record]
            topic, publish = self._topics.get(key, ''), self._publish.get(key)
            found[record] = _Output(name, topic, key[1], ENCODERS[record], publish, count, [])
        return found

    def start(self) -> None:
        """Start to estimate from the initial state, and to record if ``record`` is set."""
        self._state = init(self._machine)
        self._set(refused=self._is_refused(self._watch.duplicate_publishers()))
        if CLOCK_TOPIC in self._types:
            self._set(clock=0)  # stands still until it comes
        self._new_statistics()
        self._bind()
        self._newest.clear()
        self._logged_errors.clear()
        self._receipt_offset = time.time_ns() - time.monotonic_ns()
        self._watchdog_called = self.now()
        needed = [name for name in self._types if name not in _OPTIONAL_INPUTS]
        self._input_watch = InputWatch(needed, time.monotonic(), self._about_input)
        if self.settings(RecordingOptions).record:
            self._start_recording()
        else:
            self.publish_configuration()
        self.get_logger().info('estimating')

    def release(self) -> None:
        """Destroy publishers and subscriptions."""
        for subscription in (*self._inputs.values(), *self._recorded_only):
            self.destroy_subscription(subscription)
        for publisher in self._outputs.values():
            self.destroy_publisher(publisher)
        for made in (self._inputs, self._recorded_only, self._outputs, self._publish):
            made.clear()

    def _create_timers(self) -> None:
        self._outputs[_HEALTH] = self.create_publisher(DiagnosticArray, '~/health', 10)
        kind = message_class(layouts.NEWEST_TYPE)
        self._outputs[_MONITOR] = self.create_publisher(kind, '~/monitor', qos.best_effort(qos.STREAM))
        self.has_viewer = False
        self._newest_inputs.clear()
        self._state_topic = self.resolve_topic_name(f'~/{STATE_NAME}')
        self._tick_timer = self.create_steady_timer(_TICK_PERIOD, self._on_watchdog_timer)
        self._tick_timer.cancel()
        self._is_ticking = False
        self.create_steady_timer(_WATCHDOG_PERIOD, self._on_watchdog_timer)
        self.create_steady_timer(_HEALTH_PERIOD, self._on_health_timer)
        self.create_steady_timer(_INPUT_PERIOD, self._on_input_timer)

    def finish(self) -> None:
        """Bring the force to 0 N, stop estimating, finish the bag."""
        if self.active:
            self.fade_out()
        self.active = False
        if outcome := self.recording.close():
            self.get_logger().info(outcome)

    # --- the live path ---

    def on_input(self, name: str, data: bytes, lateness: int) -> None:
        """Take one message of an input, ``lateness`` [ns] after it was sent."""
        if not self.active:
            return
        received, heard = self.now(), self._bound[name]
        plan = heard.plan
        try:
            message = plan.read(data)
        except ValueError as error:
            self._on_malformed(heard, error)
            return
        sent = received - lateness if received > lateness else 0
        self._sent.clear()  # what an error has left
        receive(self._machine, self._state, plan, message, received, self._emits, sent)
        commands = self._send_rest(received) if self._has_rest else []

        # Nobody waits for what follows.
        recorder = self.recording.recorder
        if recorder is not None:
            recorder.record(heard.topic, heard.type_name, received, data, sent)
        if self.has_viewer:
            self._newest_inputs[heard.topic] = TopicMessage(heard.topic, heard.type_name, data)
        stamp = message.stamp
        if not plan.holds_records:
            stamp, self._newest[name] = None, data
        heard.uncounted.append((stamp, lateness))
        if self._sent:
            self._record_answers(commands, received)
            self._follow(plan)
            if recorder is not None:
                recorder.flush_if_idle()
        if received - self._watchdog_called > _STARVED:
            self.call_overdue_timers()

    def _on_malformed(self, heard: _Input, error: ValueError) -> None:
        for statistics in heard.statistics:
            statistics.on_malformed(heard.plan.topic)
        self.get_logger().error(f'{heard.topic}: {error}', throttle_duration_sec=1.0)
        self.call_overdue_timers()

    def _send(self, outputs: Mapping[type, _Output], answer: Output, frame_id: bytes) -> None:
        """Publish an answer at once, if it is a message of its own; the rest waits until all answers are out."""
        output, data = outputs[type(answer)], frame_id
        if output.publish is not None:
            data = output.encode(answer, frame_id)
            output.publish(data)
        self._sent.append((output, answer, data))

    def _send_rest(self, received: int) -> list[Command]:
        """Publish the answers to a message that are one, and what the controllers take, which is returned."""
        self._together = b''
        if self._file.together and self._sent:
            named = [NamedAnswer(output.actuator, answer, frame_id) for output, answer, frame_id in self._sent]
            self._together = encode_together(named)
            self._publish['', MACHINE_TYPE](self._together)
        guided = FeedForward in [type(answer) for _, answer, _ in self._sent]
        commands = due_commands(self._machine, self._state, guided, received)
        for command in commands:
            self._publish['', command.topic](command.data)
        return commands

    def _record_answers(self, commands: list[Command], received: int) -> None:
        """Record and count what was sent in answer to what was ``received`` [ns]."""
        recorder, done = self.recording.recorder, self.now()
        for output, answer, data in self._sent:
            if recorder is not None and output.publish is not None:
                recorder.record(output.topic, output.type_name, done, data)
            output.uncounted.append((answer, done - received))
        self._sent.clear()
        if self._together:
            self.recording.record(self._topics['', MACHINE_TYPE], MACHINE_TYPE, done, self._together)
        for command in commands:
            self.recording.record(command.topic, full_name(command.type_name), done, command.data)

    def _follow(self, plan: TopicPlan) -> None:
        """Follow pressures and adaptation of the actuators that have taken a message."""
        for number, _ in plan.taken:
            known = self._state.actuators[number].pipeline
            if self._machine.actuators[number].wiring.pressure:
                self._lowest[number] = self._lowest[number].after(known.pressure)
            learnt, last = known.estimator.adaptation, self._learnt[number]
            self._learnt[number] = learnt
            if learnt is not last and (turn := known.turn_since(last)):
                self._statistics[self._machine.actuators[number].name].on_turn(turn)

    def _count(self) -> None:
        """Count the messages since the last call, all in one go: between two samples it would delay the next one."""
        for heard in self._bound.values():
            for statistics in heard.statistics if heard.uncounted else ():
                statistics.on_inputs(heard.plan.topic, heard.uncounted)
            heard.uncounted.clear()
        for output in chain.from_iterable(outputs.values() for outputs in self._sending):
            if output.uncounted:
                output.count(output.uncounted)
                output.uncounted.clear()

    def on_watchdog(self) -> bool:
        """Renew each feed-forward that no velocity sample renews, so that it fades out."""
        if not self.active:
            return False
        numbers = due(self._state, self.now())
        for number in numbers:
            self._tick(number, self.now())  # a bag holds each message at a time of its own
        return bool(numbers)

    def _tick(self, number: int, received: int) -> None:
        made, plan = self._state.actuators[number].pipeline.feedforward.received, self._ticks[number]
        tick = WatchdogTick(received + self._clock_offset, (received - made) * 1e-9)
        self._sent.clear()
        receive(self._machine, self._state, plan, tick, received, self._emits)
        commands = self._send_rest(received) if self._has_rest else []
        self.recording.record(plan.topic, TICK_TYPE, received, encode(tick))
        self._record_answers(commands, received)

    def fade_out(self) -> None:
        """Fade every force to 0 N within ``fade_time``, whatever comes."""
        acting = [number for number, known in enumerate(self._state.actuators) if known.force != 0.0]
        if not acting:
            return
        self._set(refused=True)
        self.publish_configuration()  # a replay fades from here on
        left = _LAST_FORCES
        while left:
            time.sleep(_STOP_PERIOD)
            for number in acting:
                self._tick(number, self.now())
            self.publish_newest()
            left -= all(self._state.actuators[number].pipeline.feedforward.fade == 0.0 for number in acting)

    # --- subscriptions and publishers ---

    def subscribe(self, name: str, profile: QoSProfile) -> None:
        """Subscribe to an input, in place of the present subscription."""
        if name in self._inputs:
            self.destroy_subscription(self._inputs[name])
        overriding = qos.overridable() if profile is qos.STREAM else None
        self._inputs[name] = self.create_subscription(
            message_class(self._types[name]),
            name,
            with_info(partial(self._on_message, name)),
            profile,
            raw=True,
            qos_overriding_options=overriding,
            # An event of a subscription that is replaced meanwhile is a segmentation fault of the events executor.
            event_callbacks=SubscriptionEventCallbacks(use_default_callbacks=False),
        )
        # A bag has the names of a mapping file, and the resolved ones of the built-in mapping.
        self._topics[name] = name if name.startswith('/') else self._inputs[name].topic_name

    def _record_only(self, topic: str, type_name: str) -> None:
        """Subscribe to a topic that no input uses, for the bag: `tune` takes the command of a controller from it."""
        kind, callback, profile = (
            message_class(type_name),
            with_info(partial(self._on_recorded, topic, type_name)),
            qos.best_effort(qos.STREAM),
        )
        self._recorded_only.append(self.create_subscription(kind, topic, callback, profile, raw=True))

    def _on_recorded(self, topic: str, type_name: str, message: Any, info: Any = None) -> None:
        """Record a message of a topic that no input uses; arguments after the type as of `with_info`."""
        data, info = message if info is None else (message, info)
        if self.active:
            received = self.now()
            sent = max(received - _lateness(info['source_timestamp']), 0)
            self.recording.record(topic, type_name, received, data, sent)

    def _on_message(self, name: str, message: Any, info: Any = None) -> None:
        """Take a message, and those that wait behind a late one; arguments after the name as of `with_info`."""
        data, info = message if info is None else (message, info)
        source = info['source_timestamp']
        lateness = _lateness(source)
        if lateness > _BACKLOG:
            self._sorts_until = time.perf_counter_ns() + _SORTING
        if not self._sorts_until:
            self.on_input(name, data, lateness)
            return
        for _, of, its_data, its_source in self._backlog((info['received_timestamp'], name, data, source)):
            self.on_input(of, its_data, _lateness(its_source))
        if time.perf_counter_ns() >= self._sorts_until:
            self._sorts_until = 0

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
        waiting = taken(self._inputs[name], _MOST_WAITING)
        return [(info['received_timestamp'], name, data, info['source_timestamp']) for data, info in waiting]

    def _create_output(self, key: Any, topic: str, type_name: str) -> None:
        """Create the publisher of an answer or a command; ``_publish[key]`` sends the bytes of one.

        Only an active node answers, so the publisher is none of the life cycle, and the bytes go past the checks of
        `Publisher.publish`: both take time.
        """
        kind, note = message_class(type_name), partial(self._watch.on_incompatible_subscriber, key)
        options = {
            'qos_overriding_options': qos.overridable(),
            'event_callbacks': PublisherEventCallbacks(incompatible_qos=note),
        }
        self._outputs[key] = self.create_publisher(kind, topic, qos.STREAM, **options)
        self._publish[key] = self._outputs[key].handle.publish_raw

    def _on_watchdog_timer(self) -> None:
        """Let the watchdog act; every `_TICK_PERIOD` while it has to or somebody looks on, else seldom.

        Graph and clocks have no timer of their own: each call of one wakes two threads.
        """
        now, self._watchdog_called = time.perf_counter_ns(), self.now()
        if self.on_watchdog():
            self._ticked = now
        self._count()
        self.publish_newest()
        self._apply_due_change()
        is_ticking = self.has_viewer or now - self._ticked < _TICKING
        if is_ticking != self._is_ticking:
            self._is_ticking = is_ticking
            (self._tick_timer.reset if is_ticking else self._tick_timer.cancel)()
        if now - self._watched >= _WATCH_PERIOD:
            self._watched = now
            self._look_at_graph()

    def publish_newest(self) -> None:
        """Publish the newest messages for the live view, if there is one: 100 a second and not thousands."""
        if not self.has_viewer:
            return
        newest = list(self._newest_inputs.values())
        self._newest_inputs.clear()
        for actuator, statistics in self._statistics.items():
            for answer in statistics.take_newest():
                kind = type_of(answer)
                newest.append(TopicMessage(f'{actuator}/{_TOPIC_OF[kind]}', kind, encode(answer)))
        if newest:
            self._outputs[_MONITOR].publish(encode_newest(newest))

    # --- parameters and state ---

    @property
    def machine(self) -> Machine:
        """The machine, while the node is configured."""
        return self._machine

    @property
    def _clock_offset(self) -> int:
        """What the clock of the stamps shows after the clock of receipt [ns]."""
        return self._state.actuators[0].pipeline.clock_offset

    def _apply_change(self) -> None:
        self._refuse_inputs(self._watch.duplicate_publishers())
        changed = tuple(map(self._changed, self._machine.actuators))
        if all(new is old for new, old in zip(changed, self._machine.actuators, strict=True)):
            return
        self._machine = replace(self._machine, actuators=changed)
        if self.active:
            self.publish_configuration()

    def _set(self, **values: Any) -> None:
        for known in self._state.actuators:
            for name, value in values.items():
                setattr(known.pipeline, name, value)

    def _snapshot(self) -> str:
        return machine_text(snapshot_of(self._machine, self._state))

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
            self._apply_change()

    def _report_sets(self) -> dict[str, DiagnosticStatus]:
        """A warning if parameters are set more often than they are applied."""
        sets, applied = self._sets, self._applications
        self._sets = self._applications = 0
        if sets <= applied + 1:
            return {}
        message = f'parameters were set {sets} times since the last report and applied {applied} times'
        return {'parameters': status_of(DiagnosticStatus.WARN, message)}

    def _has_placeholder(self, prefix: str) -> bool:
        """Whether the parameters with a prefix are of an actuator with a placeholder seal, while configured."""
        actuators = self._machine.actuators if self.configured else ()
        return any(one.configuration.has_placeholder for one in actuators if prefix.startswith(_prefix(one.name)))

    def check_change(self, changed: Mapping[ParameterGroup, Any]) -> None:
        """Reject a force from placeholder seals, by a ValueError."""
        for group, record in changed.items():
            if isinstance(record, FeedForwardSettings) and record.scale > 0.0 and self._has_placeholder(group.prefix):
                raise ValueError(f'{group.prefix}scale = {record.scale}: {PLACEHOLDER_WARNING}')

    # --- clock and graph ---

    def _look_at_graph(self) -> None:
        """Publish diagnostics when a publisher of an input has appeared or disappeared; follow a clock that was set.

        If the next bag is due, let it begin with a snapshot.
        """
        self.has_viewer = self._outputs[_MONITOR].get_subscription_count() > 0
        if self._watch.has_changed():
            self.publish_diagnostics()
        if following := self.recording.continue_in_next_bag():
            self.publish_configuration()
            self.get_logger().info(f'recording to {following}')
        if self.active and self._mapping is None and self.recording.is_state_due(time.monotonic()):
            self.recording.record(self._state_topic, STATE_TYPE, self.now(), encode_text(self._snapshot()))
        if self.active and CLOCK_TOPIC not in self._inputs:
            self._follow_clock(time.time_ns() - self.now())

    def _on_input_timer(self) -> None:
        """Say what the node waits for, which input has stopped, and which is back."""
        if not self.active:
            return
        for remark in self._input_watch.look(self._arrived(), time.monotonic()):
            if remark.is_warning:
                self.get_logger().warning(remark.text)
            else:  # a line of its own: rclpy allows one severity a line
                self.get_logger().info(remark.text)

    def _follow_clock(self, offset: int) -> None:
        """Judge the age of stamps by a clock that was set; the time of receipt goes on."""
        change = offset - self._clock_offset
        if abs(change) > _LARGEST_CLOCK_STEP:
            self.get_logger().warning(f'the clock was set by {change * 1e-9:.3f} s')
            self._set(clock_offset=offset)
            self.publish_configuration()

    def now(self) -> int:
        """Time of receipt [ns]: the clock as it was at activation. It goes on whatever clocks and simulated time do."""
        return time.monotonic_ns() + self._receipt_offset

    # --- recording ---

    def publish_configuration(self) -> None:
        """Publish and record all that the next answer depends on."""
        self.publish_recorded(CONFIGURATION_TYPE, CONFIGURATION_TYPE, encode_text(self._snapshot()))

    def publish_recorded(self, key: Any, type_name: str, data: bytes) -> None:
        """Publish a message by the publisher ``key``, and record it."""
        self._outputs[key].publish(data)
        self.recording.record(self._topics[key], type_name, self.now(), data)

    def _start_recording(self) -> tuple[bool, str]:
        """Start a bag, which begins with a snapshot; success, and the folder of the bag or the error."""
        try:
            path = self.recording.start(self.settings(RecordingOptions))
        except ValueError as error:
            self._log_error_once('recorder', str(error))
            self.publish_configuration()
            return False, str(error)
        self.publish_configuration()
        self.get_logger().info(f'recording to {path}')
        return True, str(path)

    def _stop_recording(self) -> tuple[bool, str]:
        """Finish the bag in the background; success, and its path and counts or the error."""
        outcome = self.recording.stop()
        return bool(outcome) and not self.recording.failure, outcome or 'not recording'

    def _reset_adaptation(self) -> tuple[bool, str]:
        for known in self._state.actuators:
            known.pipeline.estimator.adaptation = NOT_ADAPTED
        self._learnt = [NOT_ADAPTED for _ in self._learnt]
        for statistics in self._statistics.values():
            statistics.on_reset()
        self.publish_configuration()  # a replay forgets at the same message
        return True, 'scale 1, offset 0 N'

    def _serve(
        self, act: Callable[[], tuple[bool, str]], refusal: str, _request: Any, response: Trigger.Response
    ) -> Trigger.Response:
        """Answer a service by what ``act`` returns; by ``refusal``, if there is one, while the node is not active."""
        response.success, response.message = act() if self.active or not refusal else (False, refusal)
        return response

    # --- diagnostics ---

    def diagnostics(self) -> dict[str, DiagnosticStatus]:
        """Status of each actuator, of the inputs and outputs, and of the recorder."""
        self._count()
        silent = dict.fromkeys(name for statistics in self._statistics.values() for name in statistics.silent_inputs)
        graph = self._watch.findings(list(silent), retry=self.active)
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
            parts[name or 'estimate'] = status
        return {**parts, 'recorder': self._report_graph(graph), **self._report_sets()}

    def _unanswered(self, number: int) -> list[str]:
        """What is wrong with the messages of an actuator: not taken, without its numbers, gauge or absolute."""
        said = [self._state.actuators[number].fault] if self._state.actuators[number].fault else []
        for topic, data in self._newest.items():
            said += [f'{topic}: {text}' for text in missing(self._machine, number, topic, data)]
        return said + pressure_remarks(self._file, self._file.actuators[number], self._lowest[number])

    def _about_input(self, topic: str) -> str:
        """Why an input is not there: what its newest message lacks, else its publishers."""
        data, numbers = self._newest.get(topic), range(len(self._machine.actuators))
        lacking = (
            [] if data is None else [one for number in numbers for one in missing(self._machine, number, topic, data)]
        )
        return lacking[0] if lacking else self._watch.publishers_text(topic)

    def _arrived(self) -> Mapping[str, int]:
        """Messages of each input; none of one whose messages never had the numbers that an actuator wants."""
        self._count()
        numbers, newest = range(len(self._machine.actuators)), self._newest.items()
        lacking = {t for t, data in newest if any(missing(self._machine, number, t, data) for number in numbers)}
        self._complete |= self._newest.keys() - lacking
        never = lacking - self._complete
        counts = {topic: count for one in self._statistics.values() for topic, count in one.received.items()}
        return {topic: 0 if topic in never else count for topic, count in counts.items()}

    def end_interval(self) -> None:
        """Start a new interval of rates and latencies."""
        self._count()
        for statistics in self._statistics.values():
            statistics.start_interval()

    def _refuse_inputs(self, duplicates: list[str]) -> None:
        """Reject the inputs while ``refuse_second_publisher`` is set and topics have several publishers."""
        refused = self._is_refused(duplicates)
        if self.active and refused != self._state.actuators[0].pipeline.refused:
            self._set(refused=refused)
            self.publish_configuration()  # a replay rejects the inputs from the same message on

    def _on_health_timer(self) -> None:
        """Publish indicators of the seals of each actuator whose adaptation learns."""
        self._count()
        found = {}
        for actuator, known in zip(self._machine.actuators, self._state.actuators if self.active else (), strict=False):
            parameters, statistics = actuator.pipeline.estimator, self._statistics[actuator.name]
            if parameters.adapts:
                part = f'{actuator.name} seals'.lstrip()
                found[part] = statistics.health(parameters, known.pipeline.estimator.adaptation)
        if found:
            self._outputs[_HEALTH].publish(self.status_array(found))

    def _report_graph(self, graph: GraphFindings) -> DiagnosticStatus:
        """Log what is new about the graph and the recorder; status of the recorder."""
        recorder = self.recording.report()
        self._log_error_once('publishers', '; '.join(graph.duplicates))
        self._log_error_once('unheard', '; '.join(graph.unheard))
        self._log_error_once('recorder', recorder.message if recorder.level == DiagnosticStatus.ERROR else '')
        return recorder

    def _log_error_once(self, subject: str, error: str) -> None:
        """Log an error when it appears or changes, not every second."""
        if error and error != self._logged_errors.get(subject):
            self.get_logger().error(error)
        self._logged_errors[subject] = error

    def _is_refused(self, duplicates: list[str]) -> bool:
        """Whether the inputs are rejected, since these topics have several publishers."""
        return bool(duplicates) and self.settings(node_options.InputOptions).refuse_second_publisher


def _prefix(actuator: str) -> str:
    """Start of the names of the parameters of an actuator."""
    return f'{actuator}.' if actuator else ''


def _groups(actuator: Actuator) -> tuple[ParameterGroup, ...]:
    """Parameters of an actuator, which change while the node runs; their defaults are those of the mapping file."""
    name = _prefix(actuator.name)
    return (
        ParameterGroup(EstimatorSettings, name, defaults=actuator.settings),
        ParameterGroup(FeedForwardSettings, name + FEEDFORWARD_PREFIX, defaults=actuator.feedforward),
        ParameterGroup(AdaptationSettings, name + node_options.ADAPTATION_PREFIX, defaults=actuator.adaptation),
    )


def main(node: Callable[[], EstimatorNode]) -> int:
    """Run the node that a call makes."""
    sys.setswitchinterval(SWITCH_INTERVAL)
    return run(node, EstimatorNode.autostart, EstimatorNode.finish)
