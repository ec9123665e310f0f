"""A bag of inputs and estimates as arrays, one entry per estimate."""

import math
from array import array
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from seal_friction_ros.core.estimation.configuration import parse_snapshot
from seal_friction_ros.core.estimation.messages import DECODERS
from seal_friction_ros.core.estimation.records import FrictionEstimate, Status, Velocity
from seal_friction_ros.core.foundation.arrays import FloatArray, IntArray
from seal_friction_ros.core.foundation.documents import NotJsonError, parse_json
from seal_friction_ros.core.friction.actuator import MountedSeal
from seal_friction_ros.core.friction.force_sum_correction import corrected_force_sum, one_correction
from seal_friction_ros.core.friction.mounting import pressures_at_seals
from seal_friction_ros.offline.bags.actuator_bag import MappingFile, open_actuator
from seal_friction_ros.offline.bags.bag import BagError, BagMessage
from seal_friction_ros.offline.bags.topics import RECORDED, Topics
from seal_friction_ros.offline.work.progress import progress

MAX_GAP = 0.5  # [s] samples further apart do not belong to one stretch of a recording (our choice)
LARGEST_INPUT = 1e15  # [SI] above any real pressure, force or speed; the comparison also drops NaN and infinity

_MAX_PENDING = 10_000  # velocity samples that may wait for their estimate; older ones never got one
_MAX_FRAMES = 10  # frame names that are kept
_INPUTS = ('velocity', 'pressure_a', 'pressure_b', 'force_sum', 'position', 'reference')
_COLUMNS = (*_INPUTS, *FrictionEstimate._fields[1:], 'replayed_force', 'feedforward_force')
_INTEGERS = {'state', 'direction', 'status'}


@dataclass(frozen=True, eq=False)
class RecordedRun:
    """A bag as arrays of shape (n,), one entry per estimate; a missing input is NaN."""

    name: str
    topics: dict[str, tuple[str, int]]  # topic -> its type and number of messages
    frames: tuple[str, ...]  # frame names of the velocity samples, the first ten
    configurations: tuple[tuple[float, str], ...]  # time [s] and JSON text of each change of configuration
    configuration_rows: tuple[int, ...]  # number of estimates before each change, in the order of the bag
    chambers: tuple[str, ...]  # chamber of each seal in the last configuration; a and b without one
    start: int  # [ns] stamp of the first estimate
    time: FloatArray  # [s] since the first estimate
    velocity: FloatArray  # [m/s]
    pressure_a: FloatArray  # [Pa, gauge]
    pressure_b: FloatArray  # [Pa, gauge]
    force_sum: FloatArray  # [N] corrected as by the estimator
    position: FloatArray  # [m]
    reference: FloatArray  # [m] reference position
    coulomb_friction: FloatArray  # [N]
    coulomb_friction_std: FloatArray  # [N]
    breakaway_force: FloatArray  # [N]
    friction_force: FloatArray  # [N]
    state: IntArray
    direction: IntArray
    status: IntArray
    input_age: FloatArray  # [s]
    adaptation_scale: FloatArray  # [-]
    adaptation_scale_std: FloatArray  # [-]
    adaptation_offset: FloatArray  # [N]
    residual: FloatArray  # [N]
    feedforward_force: FloatArray  # [N] that acted, published with the estimate; NaN where there is none
    replayed_force: FloatArray | None  # [N] feed-forward of a replay, which did not act; None: the bag is no replay

    @cached_property
    def pressure(self) -> FloatArray:
        """Mean of the pressures at the seals [Pa, gauge]."""
        mean: FloatArray = pressures_at_seals(self.chambers, self.pressure_a, self.pressure_b).mean(axis=1)
        return mean


def read_run(bag: Path, namespace: str = '', mapping: MappingFile | None = None) -> RecordedRun:
    """Read a bag of inputs and estimates.

    The inputs of an estimate are those held when the velocity sample of the same stamp arrived.

    Args:
        bag: The bag.
        namespace: As of `open_actuator`.
        mapping: Likewise; then the estimates are made here.

    Raises:
        BagError: The bag cannot be read, or holds no estimates.
    """
    source = open_actuator(bag, namespace, mapping)
    topics = source.topics
    if not topics.estimate:
        raise BagError(f'{bag}: no estimates in it: add them with seal_friction replay {bag} --out BAG')
    collector = _RunCollector(topics)
    with progress(f'read {bag.name}', source.total) as advance:
        for count, message in enumerate(source.messages(with_answers=True), start=1):
            if message.topic in topics or message.topic == collector.acted:
                collector.take(message)
            if count % 1000 == 0:
                advance(1000)
    if not collector.stamps:
        raise BagError(f'{bag}: the index lists estimates, but the bag holds none')
    counts = {topic: (info.type_name, info.message_count) for topic, info in source.infos.items()}
    return collector.run(source.name, counts)


class _RunCollector:
    """Follows the messages of a bag and keeps one row per estimate."""

    def __init__(self, topics: Topics) -> None:
        self.stamps = array('q')
        self._topics = topics
        self.acted = topics.feedforward + RECORDED
        self._columns = [array('d') for _ in _COLUMNS]  # their memory is that of the run: an hour at 1 kHz is 0.6 GB
        self._held = dict.fromkeys(_INPUTS, math.nan)
        self._pending: dict[int, tuple[float, ...]] = {}
        self._frames: dict[bytes, None] = {}
        self._configurations: list[tuple[int, int, str]] = []

    def take(self, message: BagMessage) -> None:
        """Add one message.

        Raises:
            BagError: The message is damaged; topic and time of the message are in the text.
        """
        try:
            self._take(message)
        except ValueError as error:
            raise BagError(f'message on {message.topic} at {message.log_time} ns: {error}') from None

    def _take(self, message: BagMessage) -> None:
        topic, topics, held = message.topic, self._topics, self._held
        record = DECODERS[message.type_name](message.data)
        if topic == topics.configuration:
            with suppress(NotJsonError):  # such a text is shown as it is
                parse_json(record, 'configuration')
            self._configurations.append((message.log_time, len(self.stamps), record))
        elif topic == topics.velocity:
            self._take_velocity(record)
        elif topic == topics.pressure:
            held['pressure_a'], held['pressure_b'] = record.chamber_a, record.chamber_b
        elif topic == topics.force:
            held['force_sum'] = record.force
        elif topic == topics.position:
            held['position'] = record.position
        elif topic == topics.reference:
            held['reference'] = record.position
        else:
            self._take_answer(topic, record)

    def _take_answer(self, topic: str, record: Any) -> None:
        if topic == self._topics.estimate:
            self.stamps.append(record.stamp)
            inputs = self._pending.pop(record.stamp, (math.nan,) * len(_INPUTS))
            for column, number in zip(self._columns, (*inputs, *record[1:], math.nan, math.nan), strict=True):
                column.append(number)
        elif topic in (self._topics.feedforward, self.acted) and self.stamps and self.stamps[-1] == record.stamp:
            self._columns[-1 if topic == self.acted else -2][-1] = record.force

    def _take_velocity(self, sample: Velocity) -> None:
        self._held['velocity'] = sample.velocity
        self._pending[sample.stamp] = tuple(self._held.values())
        if len(self._pending) > _MAX_PENDING:
            del self._pending[next(iter(self._pending))]
        if len(self._frames) < _MAX_FRAMES:
            self._frames[sample.frame_id] = None

    def run(self, name: str, counts: dict[str, tuple[str, int]]) -> RecordedRun:
        """Arrays of all messages so far; an input that cannot be a measurement becomes NaN."""
        stamps = np.frombuffer(self.stamps, dtype=np.int64)
        columns = [np.frombuffer(column, dtype=np.float64) for column in self._columns]
        values: dict[str, Any] = dict(zip(_COLUMNS, columns, strict=True))
        values.update({name: values[name].astype(np.int64) for name in _INTEGERS})
        for column in _INPUTS:
            values[column][~(np.abs(values[column]) < LARGEST_INPUT)] = math.nan
        values['velocity'][(values['status'] & int(Status.VELOCITY_OUT_OF_RANGE)) != 0] = math.nan
        if not any(_is_replayed(text) for _, _, text in self._configurations[:1]):
            values |= {'feedforward_force': values['replayed_force'], 'replayed_force': None}
        start = int(stamps[0])
        seals = _seals([text for _, _, text in self._configurations])
        correction = one_correction(mounted.seal.force_sum_correction for mounted in seals)
        if correction is not None:
            pressures = values['pressure_a'], values['pressure_b']
            values['force_sum'] = corrected_force_sum(correction, values['force_sum'], *pressures)
        # A configuration has no stamp: the time at which it was recorded counts.
        changes = tuple((round((t - start) * 1e-9, 6), text) for t, _, text in self._configurations)
        return RecordedRun(
            name=name,
            topics=counts,
            frames=tuple(frame.decode(errors='replace') for frame in self._frames),
            configurations=changes,
            configuration_rows=tuple(row for _, row, _ in self._configurations),
            chambers=tuple(mounted.chamber for mounted in seals) or ('a', 'b'),
            start=start,
            time=np.asarray((stamps - start) * 1e-9, dtype=np.float64),
            **values,
        )


def _is_replayed(text: str) -> bool:
    """Whether a configuration is that of a replay; one that cannot be parsed is not."""
    try:
        return parse_snapshot(text).recorded is not None
    except (ValueError, LookupError, TypeError):
        return False


def _seals(configurations: Sequence[str]) -> tuple[MountedSeal, ...]:
    """Seals of the last configuration; empty without one that can be parsed."""
    if configurations:
        with suppress(ValueError, LookupError, TypeError):  # a bag of another version is still worth a report
            return parse_snapshot(configurations[-1]).configuration.parameters().estimator.seals
    return ()
