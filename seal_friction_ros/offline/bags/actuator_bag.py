"""One actuator of a bag, whatever recorded it: topics and messages in the layout of this project.

A bag of ``friction_estimator`` is read as it is. A bag of ``machine_estimator`` holds its mapping; a bag of another
machine takes a mapping file, which counts as the configuration that a ``machine_estimator`` would have recorded first.
Both become messages of this project on the way, so that no reader asks what recorded them: the records that the live
node makes of the same messages, at their log times.
"""

from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from seal_friction_ros.core.estimation.configuration import Configuration, Recorded, snapshot_text
from seal_friction_ros.core.machine.machine import (
    QUANTITIES,
    Machine,
    MachineActuator,
    MachineState,
    init,
    make_machine,
    receive,
    records_of,
    stamp_of,
)
from seal_friction_ros.core.machine.machine_file import MachineFile, parse_machine
from seal_friction_ros.core.machine.machine_snapshot import (
    MachineSnapshot,
    machine_of,
    machine_text,
    parse_machine_text,
    snapshot_of,
)
from seal_friction_ros.core.messages import coder, layouts, records
from seal_friction_ros.core.messages.blocks import Messages
from seal_friction_ros.core.messages.definitions import short_name
from seal_friction_ros.core.messages.layouts import MACHINE_TYPE
from seal_friction_ros.core.messages.records import Clock
from seal_friction_ros.core.messages.together import decode_together
from seal_friction_ros.files import machine_configurations, read_machine
from seal_friction_ros.offline.bags.bag import (
    BagError,
    BagMessage,
    TopicInfo,
    bag_topics,
    read_messages,
)
from seal_friction_ros.offline.bags.definitions import read_definitions
from seal_friction_ros.offline.bags.gathered import KindOf, gathered
from seal_friction_ros.offline.bags.topics import RECORDED, TYPES, Topics, find_topics

MACHINE_CONFIGURATION = '/machine_estimator/configuration'
LARGEST_CLOCK_STEP = 1_000_000_000  # [ns] stamps further from the log time are of another clock; our choice
_LAST_PARTS = {
    **layouts.INPUTS,
    **layouts.OUTPUTS,
    'watchdog_tick': layouts.TICK_TYPE,
    'configuration': layouts.CONFIGURATION_TYPE,
}
_NAMES = {kind: topic for topic, kind in _LAST_PARTS.items()}
"""message type -> last part of its topic"""
_OWN = {layouts.ESTIMATE_TYPE: 'estimate', layouts.FEEDFORWARD_TYPE: 'feedforward', layouts.TICK_TYPE: 'tick'}
"""message type that the node of a machine makes for each actuator -> field of `Topics`"""


class MappingFile(NamedTuple):
    """A mapping file with the configurations of its actuators."""

    name: str  # as given
    file: MachineFile
    configurations: dict[str, Configuration]

    def only(self, actuator: str) -> 'MappingFile':
        """The same machine with one of its actuators."""
        document = self.file.document or {}
        document = {**document, 'actuators': {actuator: document['actuators'][actuator]}}
        return self._replace(file=parse_machine(document, self.name))


def read_mapping(name: str) -> MappingFile:
    """Mapping file: a path, or the name of one in ``config/machines``.

    Raises:
        ValueError: It, or a seal file in it, cannot be read or is invalid; one line that names file and actuator.
    """
    file = read_machine(name)
    return MappingFile(name, file, machine_configurations(file, name))


def machine_in(bag: Path, mapping: MappingFile) -> tuple[Machine, MachineState]:
    """Machine of a mapping file with the definitions in a bag, and its state before the first message.

    Raises:
        ValueError: The mapping does not fit the bag; one line that names file, actuator or topic.
        BagError: The bag cannot be read.
    """
    known = {topic: info.type_name for topic, info in bag_topics(bag).items()}
    for topic, kind in mapping.file.topics.items():
        if topic in known and short_name(known[topic]) != kind:
            raise ValueError(f'{mapping.name}: topics.{topic} is {kind}, but {bag} has {known[topic]} there')
    if not any(topic in known for topic in mapping.file.topics):
        raise ValueError(f'{bag}: none of the topics of {mapping.name}; it has {", ".join(sorted(known)) or "none"}')
    machine = make_machine(mapping.file, mapping.configurations, read_definitions(bag, mapping.file.topics.values()))
    offset = _clock_offset(machine, bag)
    states = (one._replace(pipeline=one.pipeline._replace(clock_offset=offset)) for one in init(machine).actuators)
    return machine, MachineState(tuple(states))


def _clock_offset(machine: Machine, bag: Path) -> int:
    """What the clock of the stamps shows after the log time [ns], by the first stamp; 0 if it is the same clock.

    Stamps of a simulation begin near 0, log times are those of the day.
    """
    for message in read_messages(bag):
        plan = machine.plans.get(message.topic)
        stamp = plan.read(message.data).stamp if plan is not None else None
        if stamp is not None:
            offset = stamp - message.log_time
            return offset if abs(offset) > LARGEST_CLOCK_STEP else 0
    return 0


def machine_messages(bag: Path, mapping: MappingFile | None, *, with_answers: bool = True) -> Iterator[BagMessage]:
    """Messages of a bag; with a mapping file as ``machine_estimator`` would have recorded them.

    What an estimator of this project may have recorded in it is left out then.

    Args:
        bag: The bag.
        mapping: Of its machine; None: the bag as it is.
        with_answers: Whether to estimate, too.

    Raises:
        ValueError: As of `machine_in`.
        BagError: The bag cannot be read.
    """
    if mapping is None:
        yield from read_messages(bag)
        return
    machine, state = machine_in(bag, mapping)
    answers: list[tuple[str, str, bytes]] = []

    def collect(name: str, record: records.Output, frame_id: bytes) -> None:
        kind = coder.type_of(record)
        answers.append((f'/{name}/{_NAMES[kind]}', kind, coder.encode(record, frame_id)))

    text = coder.encode_text(machine_text(snapshot_of(machine, state)))
    for number, message in enumerate(read_messages(bag)):
        if number == 0:
            yield BagMessage(MACHINE_CONFIGURATION, layouts.CONFIGURATION_TYPE, message.log_time, text)
        if message.topic in machine.plans:
            yield message._replace(publish_time=message.log_time)  # it does not tell when it was sent
            if with_answers:
                plan = machine.plans[message.topic]
                with named(bag, message):
                    state = receive(machine, state, plan, plan.read(message.data), message.log_time, collect)
                yield from (BagMessage(topic, kind, message.log_time, data) for topic, kind, data in answers)
                answers.clear()
        elif message.type_name not in (*coder.DECODERS, MACHINE_TYPE):
            yield message


class Translation:
    """Records of this project in the messages of a machine, as its estimator makes them.

    Args:
        machine: The machine.
        state: Its state; only clocks and what the newest messages held count.
        only: Actuator whose records are made; empty: all of them.
    """

    def __init__(self, machine: Machine, state: MachineState, only: str = '') -> None:
        self._actuators, self._states = machine.actuators, list(state.actuators)
        self._plans = {
            topic: plan._replace(taken=tuple(one for one in plan.taken if only in ('', machine.actuators[one[0]].name)))
            for topic, plan in machine.plans.items()
        }

    @property
    def topics(self) -> Collection[str]:
        """Topics of the machine."""
        return self._plans.keys()

    def records(self, message: BagMessage, missing: Counter[str]) -> Iterator[tuple[int, records.Input, bytes]]:
        """Number of the actuator, record and frame name of what a message makes, in the order of the estimator.

        Args:
            message: On one of the topics.
            missing: Counts what messages lacked.

        Raises:
            ValueError: The message does not match its type.
        """
        plan, received = self._plans[message.topic], message.log_time
        if not plan.taken:
            return
        reading = plan.read(message.data)
        missing.update(f'{message.topic}: {text}' for text in reading.missing)
        for number, taken in plan.taken:
            actuator, known = self._actuators[number], self._states[number]
            stamp = reading.stamp
            if stamp is None:
                stamp = stamp_of(actuator, known.pipeline, received, message.publish_time)
            try:
                memory, made = records_of(actuator, known.memory, taken, reading.numbers, stamp, reading.frame_id)
            except (ArithmeticError, ValueError):
                continue  # as the node: the actuator does not take the message
            self._states[number] = known._replace(memory=memory)
            yield from ((number, record, reading.frame_id) for record in made)

    def follow(self, clock: Clock, received: int) -> None:
        """Follow simulated time."""
        offset = clock.stamp - received
        self._states = [known._replace(pipeline=known.pipeline._replace(clock_offset=offset)) for known in self._states]


class ActuatorBag(NamedTuple):
    """One actuator of a bag."""

    path: Path
    topics: Topics
    infos: Mapping[str, TopicInfo]  # topics of the bag, as they are
    actuator: str = ''  # of a machine; empty: the bag has the messages of one actuator
    several: bool = False  # whether the machine has other actuators
    mapping: MappingFile | None = None  # of a bag without configuration

    @property
    def name(self) -> str:
        """Name of the bag, with that of the actuator if it is one of several."""
        name = self.path.resolve().name
        return f'{name} {self.actuator}' if self.several else name

    @property
    def used(self) -> Mapping[str, TopicInfo]:
        """Topics of the actuator among its messages; their numbers are not known."""
        return {topic: TopicInfo(kind, 1) for topic, kind in zip(self.topics, TYPES, strict=True) if topic}

    @property
    def total(self) -> int:
        """Number of messages in the bag."""
        return sum(info.message_count for info in self.infos.values())

    def messages(self, *, with_answers: bool = False) -> Iterator[BagMessage]:
        """Messages in order of log time.

        Args:
            with_answers: Whether to estimate, too, if the bag has a mapping file and so no estimates.

        Raises:
            BagError: The bag is damaged; raised when the damage is reached.
        """
        if not self.actuator:
            return read_messages(self.path)
        return _OfActuator(self).messages(machine_messages(self.path, self.mapping, with_answers=with_answers))

    def blocks(self, kind_of: KindOf, *, in_bulk: bool = True, with_answers: bool = False) -> Iterator[Messages]:
        """Messages in blocks.

        Args:
            kind_of: Kind of the messages on a topic.
            in_bulk: Whether to load the compiler, which reads bags of this project many times faster.
            with_answers: As of `messages`.

        Raises:
            UnsuitedError: As of `block_reader.read_in_bulk`.
            BagError: The bag cannot be read.
        """
        if self.actuator or not in_bulk:
            return gathered(self.messages(with_answers=with_answers), kind_of)
        from seal_friction_ros.offline.bags.block_reader import read_in_bulk  # noqa: PLC0415  loads the compiler

        return read_in_bulk(self.path, kind_of)


def open_actuator(bag: Path, namespace: str = '', mapping: MappingFile | None = None) -> ActuatorBag:
    """Find an actuator in a bag.

    Args:
        bag: Of ``friction_estimator``, of ``machine_estimator``, or with a mapping file any rosbag.
        namespace: Use only topics below it; of a machine the name of the actuator.
        mapping: Mapping file of the machine.

    Raises:
        BagError: The bag cannot be read, it has no velocity, or there are several actuators and none is named.
        ValueError: The mapping does not fit the bag.
    """
    infos = bag_topics(bag)
    if not is_of_machine(bag, infos, mapping):
        return ActuatorBag(bag, find_topics(bag, namespace, infos), infos)
    if mapping is not None:
        names = [one.name for one in mapping.file.actuators]
        mapping = mapping.only(_chosen(bag, names, namespace))
        machine, _ = machine_in(bag, mapping)
    else:
        machine, _ = _machine_of(bag, _first_snapshot(bag))
        names = [one.name for one in machine.actuators]
    name = _chosen(bag, names, namespace)
    actuator = next(one for one in machine.actuators if one.name == name)
    topics = _topics_of(actuator, infos, has_mapping=mapping is not None)
    if not topics.velocity:
        raise BagError(no_velocity(bag, name))
    return ActuatorBag(bag, topics, infos, name, len(names) > 1, mapping)


def is_of_machine(bag: Path, infos: Mapping[str, TopicInfo], mapping: MappingFile | None) -> bool:
    """Whether a bag is read by a mapping, its own or that of the file.

    A mapping file is for other bags if this one has none of its topics, but velocities of this project.

    Args:
        bag: The bag.
        infos: Its topics.
        mapping: Mapping file.

    Raises:
        BagError: The bag, or its configuration, cannot be read.
    """
    present = {info.type_name for info in infos.values() if info.message_count}
    if mapping is not None:
        return layouts.VELOCITY_TYPE not in present or not infos.keys().isdisjoint(mapping.file.topics)
    if layouts.CONFIGURATION_TYPE not in present:
        return False
    try:
        return _first_snapshot(bag).file.document is not None
    except BagError:
        if layouts.VELOCITY_TYPE in present:  # a bag with a configuration that cannot be read is still worth a report
            return False
        raise


def _first_snapshot(bag: Path) -> MachineSnapshot:
    """Snapshot in the first configuration of a bag."""
    first = next(message for message in read_messages(bag) if message.type_name == layouts.CONFIGURATION_TYPE)
    with named(bag, first):
        return parse_machine_text(coder.decode_text(first.data))


def _machine_of(bag: Path, snapshot: MachineSnapshot) -> tuple[Machine, MachineState]:
    try:
        return machine_of(snapshot, read_definitions(bag, snapshot.file.topics.values()))
    except BagError:
        raise
    except ValueError as error:
        raise BagError(f'{bag}: {error}') from None


def _chosen(bag: Path, names: Sequence[str], namespace: str) -> str:
    """Name of the actuator that a namespace means.

    Raises:
        BagError: It means none, or there are several and it is not given.
    """
    wanted = namespace.strip('/').rpartition('/')[2]
    if not wanted and len(names) == 1:
        return names[0]
    if wanted in names:
        return wanted
    said = f'no actuator {wanted}: choose one' if wanted else 'several actuators: choose one'
    raise BagError(f'{bag}: {said} with --namespace: {", ".join(names)}')


def sources_of(actuator: MachineActuator) -> dict[str, tuple[str, ...]]:
    """Input of the estimator, as a field of `Topics`, -> topics of the numbers that it is made of."""
    signals, wiring = actuator.mapping.signals(), actuator.wiring
    parts: dict[str, list[str]] = {
        'pressure': [QUANTITIES[quantity] for quantity in wiring.pressure],
        'force': [QUANTITIES[quantity] for quantity in wiring.force],
        'reference': [QUANTITIES[wiring.reference]] if wiring.reference >= 0 else [],
        'velocity': [QUANTITIES[wiring.velocity]],
        **{name: [name] if name in signals else [] for name in ('position', 'temperature')},
    }
    return {name: tuple(signals[one].topic for one in quantities) for name, quantities in parts.items() if quantities}


def _topics_of(actuator: MachineActuator, infos: Mapping[str, TopicInfo], *, has_mapping: bool) -> Topics:
    """Topics of an actuator, as its own messages have them."""
    present = {topic: info.type_name for topic, info in infos.items() if info.message_count}
    made = {name for name, needed in sources_of(actuator).items() if {*needed} <= present.keys()} | {'configuration'}
    if has_mapping or MACHINE_TYPE in present.values():
        made |= {'estimate', 'feedforward'}
    if not has_mapping:
        made |= {_OWN[kind] for topic, kind in present.items() if kind in _OWN and _is_of(actuator.name, topic)}
    names = {
        name: f'/{actuator.name}/{_NAMES[kind]}' if name in made else ''
        for name, kind in zip(TYPES._fields, TYPES, strict=True)
    }
    clocks = [topic for topic, kind in present.items() if kind == layouts.CLOCK_TYPE and not has_mapping]
    return Topics(**{**names, 'clock': clocks[0] if clocks else ''})


def _is_of(actuator: str, topic: str) -> bool:
    """Whether a topic of the types of this project is one of an actuator."""
    return topic.split('/')[-2:-1] == [actuator]


class _OfActuator:
    """Messages of one actuator from those of its machine.

    Args:
        source: The actuator.
    """

    def __init__(self, source: ActuatorBag) -> None:
        self._bag, self._name, self._topics = source.path, source.actuator, source.topics
        self._did_not_act = source.mapping is not None or any(
            _is_of(self._name, topic) and topic.endswith(RECORDED) for topic in source.infos
        )
        self._translation: Translation | None = None
        self._missing: Counter[str] = Counter()
        self._has_velocity = False

    def messages(self, given: Iterable[BagMessage]) -> Iterator[BagMessage]:
        """Messages of the actuator.

        Raises:
            BagError: A message does not match its type, or there is no velocity.
        """
        for message in given:
            with named(self._bag, message):
                yield from self._taken(message)
        if not self._has_velocity:
            raise BagError(no_velocity(self._bag, self._name, lacking(self._missing)))

    def _taken(self, message: BagMessage) -> Iterable[BagMessage]:
        kind, translation = message.type_name, self._translation
        if kind == layouts.CONFIGURATION_TYPE:
            return [self._configured(message)]
        if translation is None:
            return []
        if message.topic in translation.topics:
            made = [(record, frame_id) for _, record, frame_id in translation.records(message, self._missing)]
            return self._encoded(message, made)
        if kind == MACHINE_TYPE:
            answers = decode_together(message.data)
            return self._encoded(
                message, [(record, frame_id) for name, record, frame_id in answers if name == self._name]
            )
        if kind == layouts.CLOCK_TYPE:
            translation.follow(coder.decode_clock(message.data), message.log_time)
            return [message]
        if kind in _OWN and _is_of(self._name, message.topic):
            return [message._replace(topic=f'/{self._name}/{message.topic.rpartition("/")[2]}')]
        return [] if kind in coder.DECODERS else [message]

    def _configured(self, message: BagMessage) -> BagMessage:
        """Take a configuration of the machine; that of the actuator."""
        known = parse_machine_text(coder.decode_text(message.data))
        if self._name not in known.actuators:
            raise ValueError(f'no {self._name} in the configuration: {", ".join(known.actuators)}')
        self._translation = Translation(*_machine_of(self._bag, known), self._name)
        snapshot = known.actuators[self._name].snapshot
        if self._did_not_act:
            snapshot = snapshot._replace(recorded=Recorded(None))
        return message._replace(topic=self._topics.configuration, data=coder.encode_text(snapshot_text(snapshot)))

    def _encoded(self, message: BagMessage, made: Iterable[tuple[Any, bytes]]) -> Iterator[BagMessage]:
        """Records as messages of the actuator."""
        for record, frame_id in made:
            kind = coder.type_of(record)
            self._has_velocity |= kind == layouts.VELOCITY_TYPE
            topic = f'/{self._name}/{_NAMES[kind]}'
            yield message._replace(topic=topic, type_name=kind, data=coder.encode(record, frame_id))


def lacking(missing: Mapping[str, int]) -> list[str]:
    """What messages lacked, in words."""
    return [f'{text} ({count} messages)' for text, count in missing.items()]


def no_velocity(bag: Path, actuator: str, reasons: Sequence[str] = ()) -> str:
    """Error of a bag that has no velocity of an actuator."""
    said = '; '.join(reasons) or 'its topic has no message'
    return f'{bag}: {actuator}: no velocity in it, so nothing to estimate from: {said}'


@contextmanager
def named(bag: Path, message: BagMessage) -> Iterator[None]:
    """Convert the error of a message to one that names it."""
    try:
        yield
    except BagError:
        raise
    except ValueError as error:
        raise BagError(f'{bag}: message on {message.topic} at {message.log_time} ns: {error}') from None
