"""Import of any rosbag with standard messages: bag and mapping file -> one bag of this project for each actuator.

The records are those that the live node makes of the same messages (`core.machine.machine`), with their log times, so
``identify``, ``tune``, ``health`` and ``replay`` take the bags as if this package had recorded them.
"""

from array import array
from collections import Counter
from collections.abc import Collection, Iterator, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from seal_friction_ros.core.estimation.configuration import Snapshot, snapshot_text
from seal_friction_ros.core.foundation.stamps import StampRepair
from seal_friction_ros.core.identification.admission import MALFORMED, NO_VELOCITY, NOT_STARTED, Account
from seal_friction_ros.core.machine.gauge_or_absolute import Lowest, pressure_remarks
from seal_friction_ros.core.machine.machine import Machine, MachineActuator, MachineState
from seal_friction_ros.core.messages.coder import encode, encode_text, type_of
from seal_friction_ros.core.messages.layouts import CONFIGURATION_TYPE, FORCE_TYPE, PRESSURE_TYPE, VELOCITY_TYPE
from seal_friction_ros.core.messages.records import Position, Pressure, ServoReference
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
    if unknown := [topic for topic in also if topic not in topics]:
        raise ValueError(f'{bag}: {unknown[0]} is not in it; it has {", ".join(sorted(topics))}')
    several = len(machine.actuators) > 1
    if several and out.exists():
        raise rosbag.BagError(f'{out} exists already: not overwriting')
    present = {topic: info.message_count for topic, info in topics.items() if info.message_count}
    try:
        with ExitStack() as stack:
            writers = (rosbag.BagWriter(out / one.name if several else out) for one in machine.actuators)
            parts = [
                _Part(one, stack.enter_context(writer), _awaited(one, present))
                for one, writer in zip(machine.actuators, writers, strict=True)
            ]
            lacked, samples = _write(machine, state, bag, parts, present, also)
    except BaseException:
        if several and out.is_dir() and not any(out.iterdir()):
            out.rmdir()
        raise
    absent = [f'{topic} is not in the bag' for topic in machine.plans if topic not in topics]
    found = {}
    for part, account in zip(parts, samples, strict=True):
        name = part.actuator.name
        pressures = (f'{name}: {text}' for text in pressure_remarks(mapping.file, part.actuator.mapping, part.lowest))
        remarks = (*absent, *lacked, *pressures, *account.warnings)
        found[name] = ActuatorImport(part.writer.path, dict(part.counts), part.tracking_rms(), remarks, account)
    return found


@dataclass
class _Part:
    """What one actuator gets, while the bag is read."""

    actuator: MachineActuator
    writer: rosbag.BagWriter
    awaited: set[str]  # types of messages before which a velocity is left out
    early: int = 0  # velocities that were
    counts: Counter[str] = field(default_factory=Counter)  # topic -> messages
    lowest: Lowest = field(default_factory=Lowest)  # pressures
    repairs: dict[str, StampRepair] = field(default_factory=dict)  # message type -> its stamps
    # Stamp [ns] and position [m] in turn: tuples take seven times the memory.
    wanted: 'array[float]' = field(default_factory=lambda: array('d'))
    measured: 'array[float]' = field(default_factory=lambda: array('d'))

    def take(self, record: Any, frame_id: bytes, log_time: int) -> None:
        """Write a record with a repaired stamp, its velocity from the first pressure and force sum on.

        A recorder hears its topics one after the other, so the first messages of some are missing.
        """
        kind = type_of(record)
        record = record._replace(stamp=self.repairs.setdefault(kind, StampRepair()).next(record.stamp, log_time))
        self.awaited.discard(kind)
        if kind == VELOCITY_TYPE and self.awaited:
            self.early += 1
            return
        topic = f'/{LAST_PART[kind]}'
        self.writer.write(topic, kind, log_time, encode(record, frame_id))
        self.counts[topic] += 1
        if isinstance(record, Pressure):
            self.lowest = self.lowest.after(record)
        elif isinstance(record, ServoReference | Position):
            (self.measured if isinstance(record, Position) else self.wanted).extend((record.stamp, record.position))

    def stamp_remarks(self) -> Iterator[str]:
        """What was wrong with the stamps."""
        for kind, repair in self.repairs.items():
            yield from repair.said(f'{self.actuator.name}: the stamp of {LAST_PART[kind]}')

    def tracking_rms(self) -> float | None:
        """Root of the mean square of measured minus wanted position at the same time [m]; None without both."""
        wanted, measured = (np.array(part).reshape(-1, 2) for part in (self.wanted, self.measured))
        if len(wanted) < 2:
            return None
        at = np.interp(measured[:, 0], wanted[:, 0], wanted[:, 1], left=np.nan, right=np.nan)
        known = np.isfinite(measured[:, 1] - at)
        return tracking_rms(at[known], measured[known, 1]) if known.any() else None


def _write(
    machine: Machine,
    state: MachineState,
    bag: Path,
    parts: list[_Part],
    present: Mapping[str, int],
    also: Collection[str],
) -> tuple[list[str], list[Account]]:
    """Write what each actuator gets; what was wrong with messages, and the samples of each. ValueError: too few."""
    missing, read, is_begun = Counter[str](), Counter[str](), False
    translation = Translation(machine, state)
    with progress(f'import {bag.name}', sum(present.values())) as advance:
        used = {*machine.plans, *also}
        for message in (one for one in counted(rosbag.read_messages(bag), advance) if one.topic in used):
            if not is_begun:
                is_begun = True
                for part, known in zip(parts, state.actuators, strict=True):
                    text = encode_text(snapshot_text(Snapshot(part.actuator.configuration, known.pipeline)))
                    part.writer.write(rosbag.CONFIGURATION_TOPIC, CONFIGURATION_TYPE, message.log_time, text)
            for part in parts if message.topic in also else ():
                part.writer.write(*message)
            if message.topic in machine.plans:
                read[message.topic] += 1
                with rosbag.named(bag, message):
                    made = translation.records(message._replace(publish_time=None), missing)
                    for number, record, frame_id in made:
                        parts[number].take(record, frame_id, message.log_time)
    remarks = [*lacking(missing), *(text for part in parts for text in part.stamp_remarks())]
    samples = [_account(bag, part, read, translation.malformed) for part in parts]
    for part, account in zip(parts, samples, strict=True):
        if not account.used:
            raise ValueError(no_velocity(bag, part.actuator.name, remarks))
        account.check()
    return remarks, samples


def _account(bag: Path, part: _Part, read: Counter[str], malformed: Counter[str]) -> Account:
    """Messages on the topic of the velocity of an actuator, by the numbers ``read`` and ``malformed`` on each topic."""
    (topic,) = sources_of(part.actuator)['velocity']
    used = part.counts[rosbag.VELOCITY_TOPIC]
    nothing = read[topic] - malformed[topic] - part.early - used
    left_out = {MALFORMED: malformed[topic], NO_VELOCITY: nothing, NOT_STARTED: part.early}
    return Account(f'{bag}: {part.actuator.name}', used, {reason: count for reason, count in left_out.items() if count})


def _awaited(actuator: MachineActuator, present: Collection[str]) -> set[str]:
    """Types of messages without which a velocity makes no good estimate, if the bag has all that they are made of."""
    sources = sources_of(actuator)
    kinds = {'pressure': PRESSURE_TYPE, 'force': FORCE_TYPE}
    return {kind for name, kind in kinds.items() if name in sources and {*sources[name]} <= {*present}}
