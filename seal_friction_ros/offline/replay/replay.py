"""Replay of a bag through the estimator, without ROS graph or clock: byte for byte the answers of the live node."""

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from seal_friction_ros.core.estimation import pipeline
from seal_friction_ros.core.estimation.configuration import Configuration, SealSelection
from seal_friction_ros.core.estimation.estimator import DEFAULT_ADAPTATION, EstimatorSettings
from seal_friction_ros.core.estimation.feedforward import FeedForwardSettings
from seal_friction_ros.core.machine.machine import Machine, MachineState, TopicPlan, named_emits, receive, record_plan
from seal_friction_ros.core.machine.machine_file import MachineFile
from seal_friction_ros.core.machine.machine_snapshot import (
    MachineSnapshot,
    first_of_replay,
    machine_of,
    machine_text,
    parse_machine_text,
    snapshot_of,
)
from seal_friction_ros.core.machine.outputs import due_commands
from seal_friction_ros.core.messages import layouts
from seal_friction_ros.core.messages.coder import decode_text, encode, encode_text, type_of
from seal_friction_ros.core.messages.definitions import full_name
from seal_friction_ros.core.messages.records import NEVER, Output
from seal_friction_ros.core.messages.together import NamedAnswer, encode_together
from seal_friction_ros.files import default_configuration, load_configuration, load_parameter_file, with_seal
from seal_friction_ros.offline.bags import bag as rosbag
from seal_friction_ros.offline.bags.actuator_bag import (
    ANSWER_TOPICS,
    MADE,
    RECORDED,
    TYPES,
    ActuatorBag,
    find_topics,
    open_actuator,
    source_of,
)
from seal_friction_ros.offline.bags.bag import STATE_PERIOD
from seal_friction_ros.offline.bags.columns import collected
from seal_friction_ros.offline.bags.mapped_bag import MappingFile
from seal_friction_ros.offline.bags.recorded_run import RecordedRun, RunCollector, read_run, wanted_of_run
from seal_friction_ros.offline.replay.answer_comparison import AnswerStream, ReplayResult, replay_result
from seal_friction_ros.offline.work.progress import counted, progress


def chosen_configuration(
    params: str | Path | None, seals: str | Path | Sequence[str | Path] | None
) -> Configuration | None:
    """Configuration from a ROS parameter file, and a seal file for all seals or the parameter ``seals``; None: neither.

    ValueError: a file cannot be read, or a value is invalid.
    """
    if params is None and not seals:
        return None
    selection, feedforward, adaptation = SealSelection(), FeedForwardSettings(), DEFAULT_ADAPTATION
    settings = EstimatorSettings(stamp_age_max=0.0)  # off: stamps of a bag that was played are older than its receipt
    if params:
        selection, settings, feedforward, adaptation = load_parameter_file(Path(params))
    if isinstance(seals, str | Path):
        selection = with_seal(selection, str(seals))
    elif seals:
        selection = SealSelection(tuple(map(str, seals)))
    return load_configuration(selection, settings, feedforward, adaptation)


class Step(NamedTuple):
    """One message, and the answers of the estimator to it."""

    message: rosbag.BagMessage
    answers: tuple[rosbag.BagMessage, ...]


class Replay:
    """The machine of a bag, or one actuator of it, on its way through the messages, and what it answers to each.

    A bag of ``friction_estimator`` is that of a machine with the built-in mapping. The machine is that of the newest
    configuration in the bag. A bag without configuration is replayed by the default one, with the built-in mapping. The
    ``override`` is the configuration of each actuator instead of the recorded one; ``namespace`` as of `source_of`.
    BagError: the bag cannot be read, or has not what the estimator needs.
    """

    def __init__(self, bag: Path | ActuatorBag, override: Configuration | None = None, namespace: str = '') -> None:
        self._bag, self.topics, self._read, self._configuration, first, self._own = source_of(bag, namespace)
        """topics of the bag"""
        self.answers: dict[str, str] = {}
        """topic -> message type of all that the machine makes, in the order in which it makes them"""
        self.compared: dict[str, str] = {}  # those of them that the bag has
        self.has_names = False  # whether its actuators have names
        self.estimates = 0  # made so far
        self.versions: set[int] = set()  # of the algorithm that made the recorded configurations used
        self._override = override
        self.configuration = self._configuration or rosbag.CONFIGURATION_TOPIC  # topic of the configuration in `steps`
        self._state_topic = f'{self.configuration.rpartition("/")[0]}/{rosbag.STATE_NAME}'
        self.kept: Collection[str] = {*self.topics, self._state_topic}
        """topics that the bag of a replay keeps, besides the answers"""
        self._topic_of: dict[tuple[str, str], str] = {}  # name of an actuator and message type -> topic
        self._plans: dict[str, TopicPlan] = {}
        self._emits: Sequence[pipeline.Emit] = ()
        self._machine: Machine | None = None
        self._state: MachineState | None = None
        self._tells_sending = False
        self._made: list[NamedAnswer] = []
        self.is_replayed = first is not None and first.is_replayed
        """whether the answers in the bag are replayed, so that they did not act"""
        if self._own is not None:
            self._take_up(first_of_replay(override or default_configuration()))

    def steps(self) -> Iterator[Step]:
        """Each message in order, with the answers to it; BagError if a message does not match its type.

        The configuration messages that are returned hold the configuration used: that of the replay replaces recorded
        ones, and if the bag has none, one is inserted at the start. They are marked as replayed, with the settings that
        acted. Every `STATE_PERIOD` there is the state, too, in place of those in the bag.
        """
        if not self._configuration:
            text = machine_text(first_of_replay(self._override or default_configuration()))
            yield Step(rosbag.BagMessage(self.configuration, layouts.CONFIGURATION_TYPE, 0, encode_text(text)), ())
        newest, due = NEVER, NEVER  # [ns] log time of the message before, and of the next state
        for message in self._read():
            if message.topic == self._state_topic:
                continue
            if due <= message.log_time > newest:  # of messages of one time none is before a state and another after it
                if due != NEVER:
                    yield from self._state_at(message.log_time)
                due = message.log_time + round(STATE_PERIOD * 1e9)
            newest = message.log_time
            used = message if self._tells_sending else message._replace(publish_time=message.log_time)
            if message.topic == self._configuration:
                yield Step(self._configure(message), ())
            else:
                yield Step(used, tuple(self._answers_to(used)))

    def acted(self) -> dict[str, str]:
        """Topic of each recorded feed-forward that acted -> topic that keeps it in the bag of a replay."""
        guided = [topic for topic, kind in self.answers.items() if kind == layouts.FEEDFORWARD_TYPE]
        kept = {topic: topic + RECORDED for topic in guided}
        return {name if name in self.topics or self.is_replayed else topic: name for topic, name in kept.items()}

    def kept_of(self, step: Step) -> Iterator[rosbag.BagMessage]:
        """What the bag of a replay keeps of a step: inputs, configuration, new answers and the force that acted."""
        message, acted = step.message, self.acted()
        if message.topic in acted:
            yield message._replace(topic=acted[message.topic])
        elif message.topic in self.kept and message.topic not in self.answers:
            yield from (message, *step.answers)

    def _state_at(self, log_time: int) -> Iterator[Step]:
        if self._machine is not None and self._state is not None:
            text = encode_text(machine_text(snapshot_of(self._machine, self._state)))
            yield Step(rosbag.BagMessage(self._state_topic, rosbag.STATE_TYPE, log_time, text), ())

    def _configure(self, message: rosbag.BagMessage) -> rosbag.BagMessage:
        """Take a configuration; the message with the one that is used."""
        with rosbag.named(self._bag, message):
            snapshot = parse_machine_text(decode_text(message.data))
            self._tells_sending = snapshot.tells_sending
            if self._override is None:
                self.versions.add(snapshot.version)
            used = snapshot.replayed(self._override)
            self._take_up(used)
        return message._replace(data=encode_text(machine_text(used)))

    def _take_up(self, snapshot: MachineSnapshot) -> None:
        """Continue with the machine and the state of a snapshot."""
        file = snapshot.file
        self.has_names = file.document is not None
        if self.has_names:
            self._machine, self._state = machine_of(snapshot, rosbag.read_definitions(self._bag, file.topics.values()))
            self._plans = {**self._machine.plans, **self._ticks_and_clock(file)}
            self._topic_of = self._answers_of(file)
        else:
            topics = self._own or find_topics(self._bag, infos=self.topics)
            inputs = {topic: kind for topic, kind in zip(topics, TYPES, strict=True) if topic in topics.inputs}
            self._machine, self._state = machine_of(snapshot, {}, inputs)
            self._plans = dict(self._machine.plans)
            self._topic_of = {('', kind): topic or ANSWER_TOPICS[kind] for kind, topic in topics.answers.items()}
            self.kept = {*topics, rosbag.CONFIGURATION_TOPIC, self._state_topic}
        self._emits = named_emits(self._machine, self._collect)
        outputs = {one.output.topic: full_name(one.output.type_name) for one in file.actuators if one.output}
        self.answers = {topic: kind for (_, kind), topic in self._topic_of.items()} | outputs
        present = {topic for topic, info in self.topics.items() if info.message_count and topic in self.kept}
        self.compared = {topic: kind for topic, kind in self.answers.items() if topic in present}

    def _ticks_and_clock(self, file: MachineFile) -> dict[str, TopicPlan]:
        numbers = range(len(file.actuators))
        ticks = [self._topic(f'/{one.name}/watchdog_tick', layouts.TICK_TYPE) for one in file.actuators]
        plans = {topic: record_plan(topic, layouts.TICK_TYPE, (number,)) for number, topic in enumerate(ticks)}
        clocks = [topic for topic, info in self.topics.items() if info.type_name == layouts.CLOCK_TYPE]
        return plans | {topic: record_plan(topic, layouts.CLOCK_TYPE, numbers) for topic in clocks}

    def _answers_of(self, file: MachineFile) -> dict[tuple[str, str], str]:
        if file.together:
            return {('', layouts.MACHINE_TYPE): self._topic('/friction', layouts.MACHINE_TYPE)}
        return {
            (actuator.name, kind): self._topic(f'/{actuator.name}/{topic}', kind)
            for actuator in file.actuators
            for topic, kind in layouts.OUTPUTS.items()
        }

    def _topic(self, end: str, kind: str) -> str:
        """Topic in the bag, whatever the namespace of the node was."""
        found = [topic for topic, info in self.topics.items() if info.type_name == kind and topic.endswith(end)]
        return found[0] if found else end

    def _answers_to(self, message: rosbag.BagMessage) -> Iterable[rosbag.BagMessage]:
        """Answers to a message; BagError if it does not match its type."""
        plan = self._plans.get(message.topic)
        if plan is None or self._machine is None or self._state is None:
            return ()
        try:
            record = plan.read(message.data)
        except ValueError:
            if self.has_names:  # as the node: it counts the message as malformed
                return ()
            with rosbag.named(self._bag, message):
                raise
        self._made.clear()
        receive(self._machine, self._state, plan, record, message.log_time, self._emits, message.publish_time)
        return self._encoded(self._machine, self._state, message.log_time)

    def _collect(self, name: str, answer: Output, frame_id: bytes) -> None:
        self._made.append(NamedAnswer(name, answer, frame_id))

    def _encoded(self, machine: Machine, state: MachineState, received: int) -> Iterator[rosbag.BagMessage]:
        """What was collected, and the commands that follow from it, as messages."""
        kinds = [type_of(answer.record) for answer in self._made]
        self.estimates += kinds.count(layouts.ESTIMATE_TYPE)
        if not machine.file.together:
            for kind, (name, record, frame_id) in zip(kinds, self._made, strict=True):
                yield rosbag.BagMessage(self._topic_of[name, kind], kind, received, encode(record, frame_id))
        elif self._made:
            topic = self._topic_of['', layouts.MACHINE_TYPE]
            yield rosbag.BagMessage(topic, layouts.MACHINE_TYPE, received, encode_together(self._made))
        for command in due_commands(machine, state, layouts.FEEDFORWARD_TYPE in kinds, received):
            yield rosbag.BagMessage(command.topic, full_name(command.type_name), received, command.data)


def replay(
    bag: Path, override: Configuration | None = None, out: Path | None = None, namespace: str = ''
) -> ReplayResult:
    """Replay a bag and compare the answers with the recorded ones; with ``out``, write inputs and answers as a new bag.

    The new bag keeps the recorded feed-forward, which acted on the axis, on a topic whose name ends with `RECORDED`.
    Other arguments as of `Replay`. BagError: the bag cannot be read, or ``out`` exists already; then nothing is left at
    ``out``.
    """
    replayed = Replay(bag, override, namespace)
    with progress(f'replay {bag.name}', count_messages(replayed.topics)) as advance:
        steps = counted(replayed.steps(), advance)
        if out is None:
            return _compare(steps, replayed)
        with rosbag.BagWriter(out) as writer:
            return _compare(_written(steps, replayed, writer), replayed)


def answered_anew(
    actuator: ActuatorBag, override: Configuration | None = None
) -> tuple[ActuatorBag, Iterator[rosbag.BagMessage]]:
    """An actuator with the topics of new answers, and its messages with these answers; arguments as of `Replay`."""
    replayed = Replay(actuator, override)
    answers = {MADE[kind]: topic for topic, kind in replayed.answers.items()}
    topics = actuator.topics._replace(configuration=replayed.configuration, **answers)
    kept = (message for step in replayed.steps() for message in replayed.kept_of(step))
    return actuator._replace(topics=topics), kept


def estimated_run(
    bag: Path, namespace: str = '', mapping: MappingFile | None = None, override: Configuration | None = None
) -> RecordedRun:
    """`read_run`; the estimates are made anew where there are none, or by the ``override``, as of `Replay`."""
    actuator = open_actuator(bag, namespace, mapping)
    if override is None and actuator.topics.estimate:
        return read_run(bag, namespace, mapping)
    source, messages = answered_anew(actuator, override)
    return collected(source, wanted_of_run(source), RunCollector, messages=messages).run(source)


def count_messages(topics: Mapping[str, rosbag.TopicInfo]) -> int:
    """Number of messages on all topics."""
    return sum(info.message_count for info in topics.values())


def _written(steps: Iterable[Step], replayed: Replay, writer: rosbag.BagWriter) -> Iterator[Step]:
    for step in steps:
        for message in replayed.kept_of(step):
            writer.write(*message)
        yield step


def _compare(steps: Iterable[Step], replayed: Replay) -> ReplayResult:
    """Compare recorded and replayed answers in order.

    A recorded estimate answers the velocity sample before it; an estimate without one is a difference. A recording may
    stop between a message and the last of its answers, so an answer to its last message may be missing.
    """
    is_cut, streams = False, dict[str, AnswerStream]()
    for message, answers in steps:
        for answer in answers:
            if answer.topic in replayed.compared:
                _stream(streams, answer.topic, answer.type_name).add_replayed(answer.data)
        is_answer = replayed.compared.get(message.topic) == message.type_name
        if is_answer:
            _stream(streams, message.topic, message.type_name).compare_recorded(message.data)
        is_cut = bool(answers) or message.type_name == layouts.ESTIMATE_TYPE
        is_cut = is_cut or (is_answer and message.topic != next(reversed(replayed.answers)))
    ordered = {topic: streams[topic] for topic in replayed.answers if topic in streams}
    return replay_result(replayed.estimates, ordered, replayed.versions, is_cut=is_cut, names_topics=replayed.has_names)


def _stream(streams: dict[str, AnswerStream], topic: str, kind: str) -> AnswerStream:
    return streams.get(topic) or streams.setdefault(topic, AnswerStream(kind))
