"""A bag of a machine by its mapping file: the messages that ``machine_estimator`` would have recorded of it."""

from collections import Counter
from collections.abc import Collection, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from seal_friction_ros.core.estimation.configuration import Configuration
from seal_friction_ros.core.estimation.pipeline import acting_since
from seal_friction_ros.core.machine.machine import (
    Machine,
    MachineState,
    init,
    make_machine,
    named_emits,
    receive,
    records_of,
    stamp_of,
)
from seal_friction_ros.core.machine.machine_file import MachineFile, parse_machine
from seal_friction_ros.core.machine.machine_snapshot import machine_text, snapshot_of
from seal_friction_ros.core.messages import coder, layouts, records
from seal_friction_ros.core.messages.definitions import short_name
from seal_friction_ros.core.messages.records import Clock
from seal_friction_ros.files import machine_configurations, read_machine
from seal_friction_ros.offline.bags.bag import BagMessage, TopicInfo, bag_topics, named, read_definitions, read_messages

MACHINE_CONFIGURATION = '/machine_estimator/configuration'
LARGEST_CLOCK_STEP = 1_000_000_000  # [ns] stamps further from the log time are of another clock; our choice
_OTHERS = {'watchdog_tick': layouts.TICK_TYPE, 'configuration': layouts.CONFIGURATION_TYPE}
LAST_PART = {kind: topic for topic, kind in {**layouts.INPUTS, **layouts.OUTPUTS, **_OTHERS}.items()}
"""message type -> last part of its topic"""


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

    ValueError, which names file and actuator: it, or a seal file in it, cannot be read or is invalid.
    """
    file = read_machine(name)
    return MappingFile(name, file, machine_configurations(file, name))


def machine_in(bag: Path, mapping: MappingFile) -> tuple[Machine, MachineState]:
    """Machine of a mapping file with the definitions in a bag, and its state before the first message.

    Raises BagError if the bag cannot be read, ValueError, which names file, actuator or topic, if the mapping does not
    fit.
    """
    known = {topic: info.type_name for topic, info in bag_topics(bag).items()}
    for topic, kind in mapping.file.topics.items():
        if topic in known and short_name(known[topic]) != kind:
            raise ValueError(f'{mapping.name}: topics.{topic} is {kind}, but {bag} has {known[topic]} there')
    if not any(topic in known for topic in mapping.file.topics):
        raise ValueError(f'{bag}: none of the topics of {mapping.name}; it has {", ".join(sorted(known)) or "none"}')
    machine = make_machine(mapping.file, mapping.configurations, read_definitions(bag, mapping.file.topics.values()))
    offset = _clock_offset(machine, bag)
    state = init(machine)
    for one in state.actuators:
        one.pipeline.clock_offset = offset
    return machine, state


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
    """Messages of a bag; with a mapping file as ``machine_estimator`` would have recorded them, answers included.

    What an estimator of this project may have recorded in it is left out then. Without ``with_answers`` nothing is
    estimated. Raises as `machine_in`.
    """
    if mapping is None:
        yield from read_messages(bag)
        return
    machine, state = machine_in(bag, mapping)
    answers: list[tuple[str, str, bytes]] = []

    def collect(name: str, record: records.Output, frame_id: bytes) -> None:
        kind = coder.type_of(record)
        answers.append((f'/{name}/{LAST_PART[kind]}', kind, coder.encode(record, frame_id)))

    emits = named_emits(machine, collect)
    text = coder.encode_text(machine_text(snapshot_of(machine, state)))
    for number, message in enumerate(read_messages(bag)):
        if number == 0:
            yield BagMessage(MACHINE_CONFIGURATION, layouts.CONFIGURATION_TYPE, message.log_time, text)
        if message.topic in machine.plans:
            yield message._replace(publish_time=message.log_time)  # it does not tell when it was sent
            if with_answers:
                plan = machine.plans[message.topic]
                with named(bag, message):
                    receive(machine, state, plan, plan.read(message.data), message.log_time, emits)
                yield from (BagMessage(topic, kind, message.log_time, data) for topic, kind, data in answers)
                answers.clear()
        elif message.type_name not in (*coder.DECODERS, layouts.MACHINE_TYPE):
            yield message


class Translation:
    """Records of this project in the messages of a machine, as its estimator makes them.

    Of the state only clocks and what the newest messages held count. ``only`` names the actuator whose records are
    made; empty: all. ``malformed`` counts the messages that could not be read, by topic.
    """

    def __init__(
        self, machine: Machine, state: MachineState, only: str = '', malformed: Counter[str] | None = None
    ) -> None:
        self._actuators, self._states = machine.actuators, [replace(one) for one in state.actuators]
        self.malformed: Counter[str] = Counter() if malformed is None else malformed
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

        ``missing`` counts what messages lacked.
        """
        plan, received = self._plans[message.topic], message.log_time
        if not plan.taken:
            return
        try:
            reading = plan.read(message.data)
        except ValueError as error:  # as the node: it counts the message as malformed and goes on
            missing[f'{message.topic}: {error}'] += 1
            self.malformed[message.topic] += 1
            return
        missing.update(f'{message.topic}: {text}' for text in reading.missing)
        for number, taken in plan.taken:
            actuator, known = self._actuators[number], self._states[number]
            stamp = reading.stamp
            if stamp is None:
                since = acting_since(actuator.pipeline.feedforward, received, message.publish_time or received)
                stamp = stamp_of(known.pipeline, received, since)
            try:
                memory, made = records_of(actuator, known.memory, taken, reading.numbers, stamp, reading.frame_id)
            except (ArithmeticError, ValueError):
                continue  # as the node: the actuator does not take the message
            known.memory = memory
            yield from ((number, record, reading.frame_id) for record in made)

    def follow(self, clock: Clock, received: int) -> None:
        """Follow simulated time."""
        offset = clock.stamp - received
        for one in self._states:
            one.pipeline = replace(one.pipeline, clock_offset=offset)


def is_for(mapping: MappingFile, infos: Mapping[str, TopicInfo]) -> bool:
    """Whether a bag is read by a mapping file: not if it has none of its topics, but velocities of this project."""
    present = {info.type_name for info in infos.values() if info.message_count}
    return layouts.VELOCITY_TYPE not in present or not infos.keys().isdisjoint(mapping.file.topics)


def lacking(missing: Mapping[str, int]) -> list[str]:
    """What messages lacked, in words."""
    return [f'{text} ({count} messages)' for text, count in missing.items()]
