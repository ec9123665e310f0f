"""Import of any rosbag with standard messages: bag and mapping file -> one bag of this project for each actuator.

The records are those that the live node makes of the same messages (`core.machine.machine`), with their log times, so
``identify``, ``tune``, ``health`` and ``replay`` take the bags as if this package had recorded them.
"""

from array import array
from collections import Counter
from collections.abc import Collection, Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import NamedTuple

import numpy as np

from seal_friction_ros.core.estimation.configuration import Snapshot, snapshot_text
from seal_friction_ros.core.foundation.stamps import StampRepair
from seal_friction_ros.core.identification.admission import MALFORMED, NO_VELOCITY, NOT_STARTED, Account
from seal_friction_ros.core.machine.gauge_or_absolute import Lowest, pressure_remarks
from seal_friction_ros.core.machine.machine import Machine, MachineActuator, MachineState
from seal_friction_ros.core.messages.coder import encode, encode_text, type_of
from seal_friction_ros.core.messages.layouts import CONFIGURATION_TYPE, FORCE_TYPE, PRESSURE_TYPE, VELOCITY_TYPE
from seal_friction_ros.core.messages.records import Input, Position, Pressure, ServoReference
from seal_friction_ros.core.servo.tracking import tracking_rms
from seal_friction_ros.offline.bags import bag as rosbag
from seal_friction_ros.offline.bags.actuator_bag import no_velocity, sources_of
from seal_friction_ros.offline.bags.mapped_bag import LAST_PART, MappingFile, Translation, lacking, machine_in
from seal_friction_ros.offline.work.progress import counted, progress


class ActuatorImport(NamedTuple):
    """What one actuator got out of a bag."""

    bag: Path
    messages: dict[str, int]  # topic of this project -> number of messages
    tracking_rms: float | None  # [m] of reference minus position; None without one of them
    remarks: tuple[str, ...]  # what was missing or looks wrong
    samples: Account  # messages on the topic of its velocity


def convert_bag(bag: Path, out: Path, mapping: MappingFile, also: Collection[str] = ()) -> dict[str, ActuatorImport]:
    """Convert a rosbag2 bag with standard messages to the bag ``out``, or to a folder with a bag for each actuator.

    Topics in ``also`` are copied as they are, for example the command of a controller. ValueError: the mapping does not
    fit the bag; one line that names file, actuator or topic, and nothing is written; BagError: the bag cannot be read,
    or ``out`` exists or cannot be made.
    """
    machine, state = machine_in(bag, mapping)
    topics = rosbag.bag_topics(bag)
    if absent := [topic for topic in also if topic not in topics]:
        raise ValueError(f'{bag}: {absent[0]} is not in it; it has {", ".join(sorted(topics))}')
    several = len(machine.actuators) > 1
    folders = {one.name: out / one.name if several else out for one in machine.actuators}
    if several and out.exists():
        raise rosbag.BagError(f'{out} exists already: not overwriting')
    try:
        with ExitStack() as stack:
            writers = [stack.enter_context(rosbag.BagWriter(folder)) for folder in folders.values()]
            present = {topic: info.message_count for topic, info in topics.items() if info.message_count}
            counts, missing, lowest, tracks, accounts = _write(machine, state, bag, writers, present, also)
            for one, samples in zip(machine.actuators, accounts, strict=True):
                if not samples.used:
                    raise ValueError(no_velocity(bag, one.name, missing))
                samples.check()
    except BaseException:
        if several and out.is_dir() and not any(out.iterdir()):
            out.rmdir()
        raise
    absent = [f'{topic} is not in the bag' for topic in machine.plans if topic not in topics]
    found = {}
    for one, count, low, track, samples in zip(machine.actuators, counts, lowest, tracks, accounts, strict=True):
        pressures = (f'{one.name}: {text}' for text in pressure_remarks(mapping.file, one.mapping, low))
        remarks = (*absent, *missing, *pressures, *samples.warnings)
        found[one.name] = ActuatorImport(folders[one.name], dict(count), track.rms, remarks, samples)
    return found


class _Track:
    """Wanted and measured position of an actuator."""

    def __init__(self) -> None:
        self._wanted = array('d')  # stamp [ns] and position [m] in turn: tuples take seven times the memory
        self._measured = array('d')

    def take(self, record: Input) -> None:
        """Keep the position of a reference or of the rod."""
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
        known = np.isfinite(measured[:, 1] - at)
        return tracking_rms(at[known], measured[known, 1]) if known.any() else None


def _write(
    machine: Machine,
    state: MachineState,
    bag: Path,
    writers: list[rosbag.BagWriter],
    present: Mapping[str, int],
    also: Collection[str],
) -> tuple[list[Counter[str]], list[str], list[Lowest], list[_Track], list[Account]]:
    """Write what each actuator gets, its velocity from the first pressure and force sum on.

    A recorder hears its topics one after the other, so the first messages of some are missing. Returns the number of
    messages by topic, what messages lacked, and of each actuator its lowest pressures, its tracking and its samples.
    """
    lowest = [Lowest() for _ in machine.actuators]
    tracks = [_Track() for _ in machine.actuators]
    awaited = [_awaited(one, present) for one in machine.actuators]
    counts: list[Counter[str]] = [Counter() for _ in machine.actuators]
    missing, read, early = Counter[str](), Counter[str](), Counter[int]()
    repairs: dict[tuple[int, str], StampRepair] = {}
    translation = Translation(machine, state)
    with progress(f'import {bag.name}', sum(present.values())) as advance:
        used = {*machine.plans, *also}
        for message in (one for one in counted(rosbag.read_messages(bag), advance) if one.topic in used):
            if not writers[0].message_count:
                _write_configurations(machine, state, writers, message.log_time)
            for writer in writers if message.topic in also else ():
                writer.write(*message)
            if message.topic not in machine.plans:
                continue
            read[message.topic] += 1
            with rosbag.named(bag, message):
                for number, record, frame_id in translation.records(message._replace(publish_time=None), missing):
                    kind = type_of(record)
                    stamp = repairs.setdefault((number, kind), StampRepair()).next(record.stamp, message.log_time)
                    record = record._replace(stamp=stamp)  # noqa: PLW2901  the repaired one in its place
                    awaited[number].discard(kind)
                    if kind == VELOCITY_TYPE and awaited[number]:
                        early[number] += 1
                        continue
                    topic = f'/{LAST_PART[kind]}'
                    writers[number].write(topic, kind, message.log_time, encode(record, frame_id))
                    counts[number][topic] += 1
                    tracks[number].take(record)
                    if isinstance(record, Pressure):
                        lowest[number] = lowest[number].after(record)
    said = [
        text
        for (number, kind), one in repairs.items()
        for text in one.said(f'{machine.actuators[number].name}: the stamp of {LAST_PART[kind]}')
    ]
    accounts = [
        _account(bag, one, read, translation.malformed, early[number], counts[number][rosbag.VELOCITY_TOPIC])
        for number, one in enumerate(machine.actuators)
    ]
    return counts, [*lacking(missing), *said], lowest, tracks, accounts


def _account(
    bag: Path, actuator: MachineActuator, read: Counter[str], malformed: Counter[str], early: int, used: int
) -> Account:
    """Messages on the topic of the velocity of an actuator, by the numbers ``read`` and ``malformed`` on each topic."""
    (topic,) = sources_of(actuator)['velocity']
    nothing = read[topic] - malformed[topic] - early - used
    left_out = {MALFORMED: malformed[topic], NO_VELOCITY: nothing, NOT_STARTED: early}
    return Account(f'{bag}: {actuator.name}', used, {reason: count for reason, count in left_out.items() if count})


def _awaited(actuator: MachineActuator, present: Collection[str]) -> set[str]:
    """Types of messages without which a velocity makes no good estimate, if the bag has all that they are made of."""
    sources = sources_of(actuator)
    kinds = {'pressure': PRESSURE_TYPE, 'force': FORCE_TYPE}
    return {kind for name, kind in kinds.items() if name in sources and {*sources[name]} <= {*present}}


def _write_configurations(
    machine: Machine, state: MachineState, writers: list[rosbag.BagWriter], log_time: int
) -> None:
    for actuator, known, writer in zip(machine.actuators, state.actuators, writers, strict=True):
        text = encode_text(snapshot_text(Snapshot(actuator.configuration, known.pipeline)))
        writer.write(rosbag.CONFIGURATION_TOPIC, CONFIGURATION_TYPE, log_time, text)
