"""One actuator of a bag, whatever recorded it: topics and messages in the layout of this project.

A bag of ``friction_estimator`` is read as it is. A bag of ``machine_estimator`` holds its mapping; a bag of another
machine takes a mapping file, which counts as the configuration that a ``machine_estimator`` would have recorded first.
Both become messages of this project on the way, so that no reader asks what recorded them: the records that the live
node makes of the same messages, at their log times.
"""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from seal_friction_ros.core.estimation.configuration import Recorded, snapshot_text
from seal_friction_ros.core.foundation.errors import named_errors
from seal_friction_ros.core.machine.machine import QUANTITIES, Machine, MachineActuator, MachineState
from seal_friction_ros.core.machine.machine_snapshot import MachineSnapshot, machine_of, parse_machine_text
from seal_friction_ros.core.messages import coder, layouts
from seal_friction_ros.core.messages.blocks import Messages
from seal_friction_ros.core.messages.together import decode_together
from seal_friction_ros.offline.bags import bag as rosbag
from seal_friction_ros.offline.bags.mapped_bag import (
    LAST_PART,
    MappingFile,
    Translation,
    is_for,
    lacking,
    machine_in,
    machine_messages,
)

MADE = {layouts.ESTIMATE_TYPE: 'estimate', layouts.FEEDFORWARD_TYPE: 'feedforward', layouts.TICK_TYPE: 'tick'}
"""Message type that the node of a machine makes for each actuator -> field of `Topics`."""
ANSWER_TOPICS = {layouts.ESTIMATE_TYPE: rosbag.ESTIMATE_TOPIC, layouts.FEEDFORWARD_TYPE: rosbag.FEEDFORWARD_TOPIC}
"""Message type of an answer -> topic, if the bag has no topic of that type."""

RECORDED = '_recorded'
"""End of the name of the topic that keeps the feed-forward that acted, in a bag of ``seal_friction replay``."""


class Topics(NamedTuple):
    """Names of the estimator's topics in a bag; empty if there is no such topic."""

    pressure: str
    velocity: str
    force: str
    reference: str
    position: str
    estimate: str
    feedforward: str
    configuration: str
    tick: str
    temperature: str
    clock: str

    @property
    def inputs(self) -> set[str]:
        """Topics that the estimator takes."""
        used = self.pressure, self.velocity, self.force, self.reference, self.tick, self.temperature, self.clock
        return set(used) - {''}

    @property
    def answers(self) -> dict[str, str]:
        """Message type of an answer -> its topic; empty if there is no such topic."""
        return {layouts.ESTIMATE_TYPE: self.estimate, layouts.FEEDFORWARD_TYPE: self.feedforward}

    @property
    def state(self) -> str:
        """Topic of the states amid the bag, if there are any."""
        return f'{(self.configuration or rosbag.CONFIGURATION_TOPIC).rpartition("/")[0]}/{rosbag.STATE_NAME}'


TYPES = Topics(*(getattr(layouts, f'{name.upper()}_TYPE') for name in Topics._fields))  # Message type of each topic.


def find_topics(bag: Path, namespace: str = '', infos: Mapping[str, rosbag.TopicInfo] | None = None) -> Topics:
    """The estimator's topics in a bag, found by message type, so that names and remapping do not matter.

    Only topics below the ``namespace`` count, in bags of several actuators. BagError: there is no velocity topic, or a
    type of this project has several topics.
    """
    known = rosbag.bag_topics(bag) if infos is None else infos
    result = Topics(*(find_topic(bag, wanted, namespace, known) for wanted in TYPES))
    if not result.velocity:
        raise rosbag.BagError(
            f'{bag}: no message of {TYPES.velocity} in it, so nothing to estimate from: a bag of another machine needs '
            'its mapping file (--mapping, or seal_friction import bag)'
        )
    return result


def find_topic(bag: Path, wanted: str, namespace: str, known: Mapping[str, rosbag.TopicInfo]) -> str:
    """The topic of a message type, empty if there is none; raises as `find_topics`."""
    below = f'/{namespace.strip("/")}/'.replace('//', '/')
    found = [
        topic
        for topic, info in sorted(known.items())
        if info.type_name == wanted and info.message_count and not topic.endswith(RECORDED)
        if topic.startswith(below) or wanted == TYPES.clock  # simulated time is one for all
    ]
    if len(found) > 1 and wanted == TYPES.temperature:  # a standard type: others may be of a motor or a battery
        found = [topic for topic in found if topic.endswith(rosbag.TEMPERATURE_TOPIC)]
    if len(found) > 1:
        raise rosbag.BagError(f'{bag}: several topics of {wanted}: {", ".join(found)}: choose with --namespace')
    return found[0] if found else ''


class ActuatorBag(NamedTuple):
    """One actuator of a bag."""

    path: Path
    topics: Topics
    infos: Mapping[str, rosbag.TopicInfo]  # topics of the bag, as they are
    actuator: str = ''  # of a machine; empty: the bag has the messages of one actuator
    several: bool = False  # whether the machine has other actuators
    mapping: MappingFile | None = None  # of a bag without configuration
    velocity_source: str = ''  # topic that the velocity of an actuator of a machine is made of

    @property
    def name(self) -> str:
        """Name of the bag, with that of the actuator if it is one of several."""
        name = self.path.resolve().name
        return f'{name} {self.actuator}' if self.several else name

    @property
    def used(self) -> Mapping[str, rosbag.TopicInfo]:
        """Topics of the actuator among its messages; their numbers are not known."""
        return {topic: rosbag.TopicInfo(kind, 1) for topic, kind in zip(self.topics, TYPES, strict=True) if topic}

    @property
    def total(self) -> int:
        """Number of messages in the bag."""
        return sum(info.message_count for info in self.infos.values())

    def messages(
        self, *, with_answers: bool = False, malformed: Counter[str] | None = None
    ) -> Iterator[rosbag.BagMessage]:
        """Messages in order of log time, with estimates by a mapping file if wanted; BagError where it is damaged.

        ``malformed`` counts by topic the messages of a machine that could not be read.
        """
        if not self.actuator:
            return rosbag.read_messages(self.path)
        found = _OfActuator(self, Counter() if malformed is None else malformed)
        return found.messages(machine_messages(self.path, self.mapping, with_answers=with_answers))

    def blocks(self, kind_of: rosbag.KindOf) -> Iterator[Messages]:
        """Messages in blocks, by the compiler, which reads bags of this project many times faster.

        Raises as `block_reader.read_in_bulk`, and UnsuitedError.
        """
        if self.actuator:
            return rosbag.gathered(self.messages(), kind_of)
        from seal_friction_ros.offline.bags.block_reader import read_in_bulk  # noqa: PLC0415  loads the compiler

        return read_in_bulk(self.path, kind_of)


def open_actuator(bag: Path, namespace: str = '', mapping: MappingFile | None = None) -> ActuatorBag:
    """Find an actuator in a bag of ``friction_estimator``, ``machine_estimator``, or with a mapping file in any rosbag.

    Only topics below the ``namespace`` count; of a machine it is the name of the actuator. BagError: the bag cannot be
    read, it has no velocity, or there are several actuators and none is named; ValueError: the mapping does not fit the
    bag.
    """
    infos = rosbag.bag_topics(bag)
    if mapping is not None and is_for(mapping, infos):
        names = [one.name for one in mapping.file.actuators]
        mapping = mapping.only(_chosen(bag, names, namespace))
        machine, _ = machine_in(bag, mapping)
        return _opened(machine.actuators[0], bag, infos, len(names), mapping)
    snapshot = recorded_machine(bag, infos) if mapping is None else None
    if snapshot is not None:
        return actuator_of(bag, infos, snapshot, namespace)
    return ActuatorBag(bag, find_topics(bag, namespace, infos), infos)


def actuator_of(
    bag: Path, infos: Mapping[str, rosbag.TopicInfo], snapshot: MachineSnapshot, namespace: str
) -> ActuatorBag:
    """An actuator of a bag of ``machine_estimator``; arguments and errors as of `open_actuator`."""
    machine, _ = _machine_of(bag, snapshot)
    actuators = {one.name: one for one in machine.actuators}
    return _opened(actuators[_chosen(bag, [*actuators], namespace)], bag, infos, len(actuators))


def _opened(
    actuator: MachineActuator,
    bag: Path,
    infos: Mapping[str, rosbag.TopicInfo],
    count: int,
    mapping: MappingFile | None = None,
) -> ActuatorBag:
    topics = _topics_of(actuator, infos, has_mapping=mapping is not None)
    if not topics.velocity:
        raise rosbag.BagError(no_velocity(bag, actuator.name))
    (source,) = sources_of(actuator)['velocity']
    return ActuatorBag(bag, topics, infos, actuator.name, count > 1, mapping, source)


def recorded_machine(bag: Path, infos: Mapping[str, rosbag.TopicInfo]) -> MachineSnapshot | None:
    """Machine whose ``machine_estimator`` recorded a bag; None: another bag. Raises BagError if it cannot be read."""
    present = {info.type_name for info in infos.values() if info.message_count}
    if layouts.CONFIGURATION_TYPE not in present:
        return None
    try:
        first = first_snapshot(bag, rosbag.read_messages(bag))
    except rosbag.BagError:
        if layouts.VELOCITY_TYPE in present:  # a bag with a configuration that cannot be read is still worth a report
            return None
        raise
    return None if first is None or first.file.document is None else first


def first_snapshot(bag: Path, messages: Iterable[rosbag.BagMessage], topic: str = '') -> MachineSnapshot | None:
    """Snapshot in the first configuration, on a topic if one is given; None without one; BagError if it is none."""
    found = (one for one in messages if one.type_name == layouts.CONFIGURATION_TYPE and topic in ('', one.topic))
    first = next(found, None)
    if first is None:
        return None
    with rosbag.named(bag, first):
        return parse_machine_text(coder.decode_text(first.data))


def _machine_of(bag: Path, snapshot: MachineSnapshot) -> tuple[Machine, MachineState]:
    with named_errors(bag, raised=rosbag.BagError):
        return machine_of(snapshot, rosbag.read_definitions(bag, snapshot.file.topics.values()))


def _chosen(bag: Path, names: Sequence[str], namespace: str) -> str:
    """Name of the actuator that a namespace means; BagError if it means none, or is not given and there are several."""
    wanted = namespace.strip('/').rpartition('/')[2]
    if not wanted and len(names) == 1:
        return names[0]
    if wanted in names:
        return wanted
    said = f'no actuator {wanted}: choose one' if wanted else 'several actuators: choose one'
    raise rosbag.BagError(f'{bag}: {said} with --namespace: {", ".join(names)}')


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


def _topics_of(actuator: MachineActuator, infos: Mapping[str, rosbag.TopicInfo], *, has_mapping: bool) -> Topics:
    """Topics of an actuator, as its own messages have them."""
    present = {topic: info.type_name for topic, info in infos.items() if info.message_count}
    made = {name for name, needed in sources_of(actuator).items() if {*needed} <= present.keys()} | {'configuration'}
    if has_mapping or layouts.MACHINE_TYPE in present.values():
        made |= {'estimate', 'feedforward'}
    if not has_mapping:
        made |= {MADE[kind] for topic, kind in present.items() if kind in MADE and _is_of(actuator.name, topic)}
    names = {
        name: f'/{actuator.name}/{LAST_PART[kind]}' if name in made else ''
        for name, kind in zip(TYPES._fields, TYPES, strict=True)
    }
    clocks = [topic for topic, kind in present.items() if kind == layouts.CLOCK_TYPE and not has_mapping]
    return Topics(**{**names, 'clock': clocks[0] if clocks else ''})


def _is_of(actuator: str, topic: str) -> bool:
    """Whether a topic of the types of this project is one of an actuator."""
    return topic.split('/')[-2:-1] == [actuator]


class _OfActuator:
    """Messages of one actuator from those of its machine."""

    def __init__(self, source: ActuatorBag, malformed: Counter[str]) -> None:
        self._bag, self._name, self._topics, self._malformed = source.path, source.actuator, source.topics, malformed
        self._did_not_act = source.mapping is not None or any(
            _is_of(self._name, topic) and topic.endswith(RECORDED) for topic in source.infos
        )
        self._translation: Translation | None = None
        self._missing: Counter[str] = Counter()
        self._has_velocity = False

    def messages(self, given: Iterable[rosbag.BagMessage]) -> Iterator[rosbag.BagMessage]:
        """Messages of the actuator. Raises BagError if a message does not match its type, or there is no velocity."""
        for message in given:
            with rosbag.named(self._bag, message):
                yield from self._taken(message)
        if not self._has_velocity:
            raise rosbag.BagError(no_velocity(self._bag, self._name, lacking(self._missing)))

    def _taken(self, message: rosbag.BagMessage) -> Iterable[rosbag.BagMessage]:
        kind, translation = message.type_name, self._translation
        if kind == layouts.CONFIGURATION_TYPE:
            return [self._configured(message)]
        if translation is None:
            return []
        if message.topic in translation.topics:
            made = [(record, frame_id) for _, record, frame_id in translation.records(message, self._missing)]
            return self._encoded(message, made)
        if kind == layouts.MACHINE_TYPE:
            answers = decode_together(message.data)
            return self._encoded(message, [one[1:] for one in answers if one.actuator == self._name])
        if kind == layouts.CLOCK_TYPE:
            translation.follow(coder.decode_clock(message.data), message.log_time)
            return [message]
        if kind in MADE and _is_of(self._name, message.topic):
            return [message._replace(topic=f'/{self._name}/{message.topic.rpartition("/")[2]}')]
        return [] if kind in coder.DECODERS else [message]

    def _configured(self, message: rosbag.BagMessage) -> rosbag.BagMessage:
        """Take a configuration of the machine; that of the actuator."""
        known = parse_machine_text(coder.decode_text(message.data))
        if self._name not in known.actuators:
            raise ValueError(f'no {self._name} in the configuration: {", ".join(known.actuators)}')
        self._translation = Translation(*_machine_of(self._bag, known), self._name, self._malformed)
        snapshot = known.actuators[self._name].snapshot
        if self._did_not_act:
            snapshot = snapshot._replace(recorded=Recorded(None))
        return message._replace(topic=self._topics.configuration, data=coder.encode_text(snapshot_text(snapshot)))

    def _encoded(self, message: rosbag.BagMessage, made: Iterable[tuple[Any, bytes]]) -> Iterator[rosbag.BagMessage]:
        for record, frame_id in made:
            kind = coder.type_of(record)
            self._has_velocity |= kind == layouts.VELOCITY_TYPE
            topic = f'/{self._name}/{LAST_PART[kind]}'
            yield message._replace(topic=topic, type_name=kind, data=coder.encode(record, frame_id))


def no_velocity(bag: Path, actuator: str, reasons: Sequence[str] = ()) -> str:
    """Error of a bag that has no velocity of an actuator."""
    said = '; '.join(reasons) or 'its topic has no message'
    return f'{bag}: {actuator}: no velocity in it, so nothing to estimate from: {said}'


# -- to replay --------------------------------------------------------------------------------------------------------


class Source(NamedTuple):
    """Messages of a bag that are replayed: all of them, or those of one actuator."""

    path: Path
    infos: Mapping[str, rosbag.TopicInfo]
    read: Callable[[], Iterator[rosbag.BagMessage]]
    configuration: str  # topic; empty if there is none
    first: MachineSnapshot | None  # in the first configuration
    own: Topics | None  # of the built-in mapping; None: the machine has a mapping file


def source_of(bag: Path | ActuatorBag, namespace: str) -> Source:
    """Messages to replay, of a bag or an actuator of it; BagError: it cannot be read, or lacks what is needed.

    Only topics below the ``namespace`` count; the name of an actuator of a machine means that actuator alone.
    """
    infos: Mapping[str, rosbag.TopicInfo]
    read: Callable[[], Iterator[rosbag.BagMessage]]
    if isinstance(bag, Path):
        path, infos, read = bag, rosbag.bag_topics(bag), partial(rosbag.read_messages, bag)
        configuration = find_topic(bag, layouts.CONFIGURATION_TYPE, namespace, infos)
        machine = recorded_machine(bag, infos) if namespace and not configuration else None
        if machine is not None:
            return source_of(actuator_of(bag, infos, machine, namespace), '')
    else:
        path, infos, read, configuration = bag.path, bag.used, bag.messages, bag.topics.configuration
    first = first_snapshot(path, read(), configuration) if configuration else None
    is_own = first is None or first.file.document is None
    own = find_topics(path, namespace, infos) if is_own else None
    return Source(path, infos, read, configuration, first, own)
