"""Import of any rosbag with standard messages: bag and mapping file -> one bag of this project for each actuator.

The records are those that the live node makes of the same messages (`core.machine.machine`), with their log times, so
``identify``, ``tune``, ``health`` and ``replay`` take the bags as if this package had recorded them.
"""

from array import array
from collections import Counter
from collections.abc import Callable, Collection, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import NamedTuple

import numpy as np

from seal_friction_ros.core.estimation import pipeline
from seal_friction_ros.core.estimation.configuration import Configuration, Snapshot, snapshot_text
from seal_friction_ros.core.estimation.messages import CONFIGURATION_TYPE, INPUTS, Input, encode, encode_text, type_of
from seal_friction_ros.core.estimation.records import Force, Position, Pressure, ServoReference, Velocity
from seal_friction_ros.core.machine.gauge_or_absolute import Lowest, pressure_remarks
from seal_friction_ros.core.machine.machine import (
    QUANTITIES,
    Machine,
    MachineActuator,
    TopicPlan,
    first_memory,
    make_machine,
    records_of,
)
from seal_friction_ros.core.machine.machine_file import MachineFile
from seal_friction_ros.core.machine.message_fields import Reading, short_name
from seal_friction_ros.files import machine_configurations, read_machine
from seal_friction_ros.offline.bags.bag import (
    CONFIGURATION_TOPIC,
    BagError,
    BagMessage,
    BagWriter,
    bag_topics,
    read_messages,
)
from seal_friction_ros.offline.bags.definitions import read_definitions
from seal_friction_ros.offline.work.progress import progress

LARGEST_CLOCK_STEP = 1_000_000_000  # [ns] stamps further from the log time are of another clock; our choice
_TOPICS = {type_name: f'/{topic}' for topic, type_name in INPUTS.items()}


class ActuatorImport(NamedTuple):
    """What one actuator got out of a bag."""

    bag: Path
    messages: dict[str, int]  # topic of this project -> number of messages
    tracking_rms: float | None  # [m] of reference minus position; None without one of them
    remarks: tuple[str, ...]  # what was missing or looks wrong


class MappingFile(NamedTuple):
    """A mapping file with the configurations of its actuators."""

    name: str  # as given
    file: MachineFile
    configurations: dict[str, Configuration]


def read_mapping(name: str) -> MappingFile:
    """Mapping file: a path, or the name of one in ``config/machines``.

    Raises:
        ValueError: It, or a seal file in it, cannot be read or is invalid; one line that names file and actuator.
    """
    file = read_machine(name)
    return MappingFile(name, file, machine_configurations(file, name))


def import_bag(bag: Path, mapping: str, out: Path, also: Collection[str] = ()) -> dict[str, ActuatorImport]:
    """Convert a bag with standard messages.

    Args:
        bag: Any rosbag2 bag, MCAP or SQLite.
        mapping: Mapping file: a path, or the name of one in ``config/machines``.
        out: Bag to write; with several actuators a folder with one bag each, by their names. Must not exist.
        also: Topics to copy as they are, for example the command of a controller.

    Raises:
        ValueError: The mapping does not fit the bag; one line that names file, actuator or topic. Nothing is written.
        BagError: The bag cannot be read, or ``out`` exists or cannot be made.
    """
    return convert_bag(bag, out, read_mapping(mapping), also)


def convert_bag(bag: Path, out: Path, mapping: MappingFile, also: Collection[str] = ()) -> dict[str, ActuatorImport]:
    """`import_bag` with a mapping file that is read already.

    Raises:
        ValueError: The mapping does not fit the bag; one line that names file, actuator or topic. Nothing is written.
        BagError: The bag cannot be read, or ``out`` exists or cannot be made.
    """
    file = mapping.file
    topics = bag_topics(bag)
    _check_types(file, {topic: info.type_name for topic, info in topics.items()}, mapping.name, bag)
    if absent := [topic for topic in also if topic not in topics]:
        raise ValueError(f'{bag}: {absent[0]} is not in it; it has {", ".join(sorted(topics))}')
    definitions = read_definitions(bag, file.topics.values())
    machine = make_machine(file, mapping.configurations, definitions)
    several = len(machine.actuators) > 1
    folders = {one.name: out / one.name if several else out for one in machine.actuators}
    if several and out.exists():
        raise BagError(f'{out} exists already: not overwriting')
    try:
        with ExitStack() as stack:
            writers = [stack.enter_context(BagWriter(folder)) for folder in folders.values()]
            total = sum(info.message_count for info in topics.values())
            present = {topic for topic, info in topics.items() if info.message_count}
            counts, missing, lowest, tracks = _write(
                machine, bag, writers, _clock_offset(machine, bag), total, present, also
            )
            for one, count in zip(machine.actuators, counts, strict=True):
                if not count['/rod_velocity']:
                    reason = '; '.join(missing) or 'its topic has no message'
                    raise ValueError(f'{bag}: {one.name}: no velocity in it, so nothing to estimate from: {reason}')
    except BaseException:
        if several and out.is_dir() and not any(out.iterdir()):
            out.rmdir()
        raise
    absent = [f'{topic} is not in the bag' for topic in machine.plans if topic not in topics]
    found = {}
    for one, count, low, track in zip(machine.actuators, counts, lowest, tracks, strict=True):
        remarks = (*absent, *missing, *(f'{one.name}: {text}' for text in pressure_remarks(file, one.mapping, low)))
        found[one.name] = ActuatorImport(folders[one.name], dict(count), track.rms, remarks)
    return found


class _Track:
    """Wanted and measured position of an actuator."""

    def __init__(self) -> None:
        self._wanted = array('d')  # stamp [ns] and position [m] in turn: tuples take seven times the memory
        self._measured = array('d')

    def take(self, record: Input) -> None:
        """Take one record."""
        if isinstance(record, ServoReference):
            self._wanted.extend((record.stamp, record.position))
        elif isinstance(record, Position):
            self._measured.extend((record.stamp, record.position))

    @property
    def rms(self) -> float | None:
        """Root of the mean square of measured minus wanted position at the same time [m]; None without both."""
        wanted, measured = (np.array(part).reshape(-1, 2) for part in (self._wanted, self._measured))
        if len(wanted) < 2:
            return None
        at = np.interp(measured[:, 0], wanted[:, 0], wanted[:, 1], left=np.nan, right=np.nan)
        error = (measured[:, 1] - at)[np.isfinite(measured[:, 1] - at)]
        return float(np.sqrt(np.mean(error**2))) if len(error) else None


def _check_types(file: MachineFile, types: dict[str, str], mapping: str, bag: Path) -> None:
    for topic, kind in file.topics.items():
        if topic in types and short_name(types[topic]) != kind:
            raise ValueError(f'{mapping}: topics.{topic} is {kind}, but {bag} has {types[topic]} there')
    if not any(topic in types for topic in file.topics):
        raise ValueError(f'{bag}: none of the topics of {mapping}; it has {", ".join(sorted(types)) or "none"}')


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


def _write(
    machine: Machine,
    bag: Path,
    writers: list[BagWriter],
    offset: int,
    total: int,
    present: set[str],
    also: Collection[str],
) -> tuple[list[Counter[str]], list[str], list[Lowest], list[_Track]]:
    """Write what each actuator gets, its velocity from the first pressure and force sum on.

    A recorder hears its topics one after the other, so the first messages of some are missing.

    Returns:
        Number of messages by topic, what messages lacked, and of each actuator its lowest pressures and its tracking.
    """
    lowest = [Lowest() for _ in machine.actuators]
    tracks = [_Track() for _ in machine.actuators]
    awaited = [_awaited(one, present) for one in machine.actuators]
    memories = [first_memory(one) for one in machine.actuators]
    counts: list[Counter[str]] = [Counter() for _ in machine.actuators]
    missing: Counter[str] = Counter()
    with progress(f'import {bag.name}', total) as advance:
        for message in _messages_of(machine, bag, also, advance):
            if not writers[0].message_count:
                _write_configurations(machine, writers, message.log_time, offset)
            if message.topic in also:
                for writer in writers:
                    writer.write(*message)
            if message.topic not in machine.plans:
                continue
            plan = machine.plans[message.topic]
            reading = _read(plan, message, bag)
            missing.update(f'{message.topic}: {text}' for text in reading.missing)
            stamp = reading.stamp if reading.stamp is not None else message.log_time + offset
            for number, taken in plan.taken:
                memories[number], records = records_of(
                    machine.actuators[number], memories[number], taken, reading.numbers, stamp, reading.frame_id
                )
                for record in records:
                    awaited[number].discard(type(record))
                    if isinstance(record, Velocity) and awaited[number]:
                        continue
                    kind = type_of(record)
                    writers[number].write(_TOPICS[kind], kind, message.log_time, encode(record, reading.frame_id))
                    counts[number][_TOPICS[kind]] += 1
                    tracks[number].take(record)
                    if isinstance(record, Pressure):
                        lowest[number] = lowest[number].after(record)
    return counts, [f'{text} ({count} messages)' for text, count in missing.items()], lowest, tracks


def _read(plan: TopicPlan, message: BagMessage, bag: Path) -> Reading:
    try:
        reading: Reading = plan.read(message.data)
    except ValueError as error:
        raise BagError(f'{bag}: message on {message.topic} at {message.log_time} ns: {error}') from None
    return reading


def _awaited(actuator: MachineActuator, present: set[str]) -> set[type]:
    """Records without which a velocity makes no good estimate, if the bag has all topics that they are made of."""
    signals, wiring = actuator.mapping.signals(), actuator.wiring
    parts = {Pressure: wiring.pressure, Force: wiring.force}
    return {
        kind
        for kind, quantities in parts.items()
        if quantities and all(signals[QUANTITIES[quantity]].topic in present for quantity in quantities)
    }


def _messages_of(
    machine: Machine, bag: Path, also: Collection[str], advance: Callable[[int], object]
) -> Iterator[BagMessage]:
    """Messages that an actuator listens to, and those to copy."""
    for number, message in enumerate(read_messages(bag), start=1):
        if number % 1000 == 0:
            advance(1000)
        if message.topic in machine.plans or message.topic in also:
            yield message


def _write_configurations(machine: Machine, writers: list[BagWriter], log_time: int, offset: int) -> None:
    for actuator, writer in zip(machine.actuators, writers, strict=True):
        state = pipeline.init(actuator.pipeline)._replace(clock_offset=offset)
        text = encode_text(snapshot_text(Snapshot(actuator.configuration, state)))
        writer.write(CONFIGURATION_TOPIC, CONFIGURATION_TYPE, log_time, text)
