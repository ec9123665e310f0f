"""A bag of inputs and estimates as arrays, one entry per estimate."""

import math
from array import array
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from seal_friction_ros.core.estimation.configuration import parse_snapshot
from seal_friction_ros.core.estimation.strokes import LARGEST_INPUT, Samples
from seal_friction_ros.core.foundation.arrays import FloatArray, IntArray
from seal_friction_ros.core.foundation.documents import NotJsonError, parse_json
from seal_friction_ros.core.friction.actuator import MountedSeal
from seal_friction_ros.core.friction.force_sum_correction import corrected_force_sum, one_correction
from seal_friction_ros.core.friction.mounting import pressures_at_seals
from seal_friction_ros.core.messages.blocks import Numbers, frame_names
from seal_friction_ros.core.messages.coder import decode_text
from seal_friction_ros.core.messages.layouts import FEEDFORWARD_TYPE
from seal_friction_ros.core.messages.records import FrictionEstimate, Status
from seal_friction_ros.offline.bags.actuator_bag import RECORDED, ActuatorBag, open_actuator
from seal_friction_ros.offline.bags.bag import BagError
from seal_friction_ros.offline.bags.columns import Block, Held, Wanted, collected, extend, growing, in_turn, wanted_of
from seal_friction_ros.offline.bags.mapped_bag import MappingFile

_MAX_PENDING = 10_000  # velocity samples that may wait for their estimate; older ones never got one
_MAX_FRAMES = 10  # frame names that are kept
_INPUTS = {'velocity': 1, 'pressure': 2, 'force': 1, 'position': 1, 'reference': 1}
_INPUT_COLUMNS = ('velocity', 'pressure_a', 'pressure_b', 'force_sum', 'position', 'reference')
_COLUMNS = (*_INPUT_COLUMNS, *FrictionEstimate._fields[1:], 'replayed_force', 'feedforward_force')
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
    friction_force_std: FloatArray  # [N] -1.0: not known, as in a bag from before the message had it
    feedforward_force: FloatArray  # [N] that acted, published with the estimate; NaN where there is none
    replayed_force: FloatArray | None  # [N] feed-forward of a replay, which did not act; None: the bag is no replay

    @cached_property
    def pressure(self) -> FloatArray:
        """Mean of the pressures at the seals [Pa, gauge]."""
        mean: FloatArray = pressures_at_seals(self.chambers, self.pressure_a, self.pressure_b).mean(axis=1)
        return mean

    @property
    def samples(self) -> Samples:
        """What findings and strokes are read from."""
        return Samples(*(getattr(self, name) for name in Samples._fields))


def read_run(bag: Path, namespace: str = '', mapping: MappingFile | None = None) -> RecordedRun:
    """Read a bag of inputs and estimates; arguments as of `open_actuator`, with a mapping the estimates are made here.

    The inputs of an estimate are those held when the velocity sample of the same stamp arrived. BagError: the bag
    cannot be read, or holds no estimates.
    """
    source = open_actuator(bag, namespace, mapping)
    if not source.topics.estimate:
        raise BagError(f'{bag}: no estimates in it: add them with seal_friction replay {bag} --out BAG')
    messages = source.messages(with_answers=True) if source.mapping is not None else None
    return collected(source, wanted_of_run(source), RunCollector, messages=messages).run(source)


def wanted_of_run(source: ActuatorBag) -> dict[str, Wanted]:
    """Topics and types of what a `RunCollector` takes."""
    wanted = wanted_of(source, (*_INPUTS, 'estimate', 'feedforward', 'configuration'))
    return {**wanted, 'acted': Wanted(source.topics.feedforward + RECORDED, FEEDFORWARD_TYPE)}


class RunCollector:
    """Keeps one row per estimate."""

    def __init__(self) -> None:
        self.stamps = array('q')
        self._columns = growing(len(_COLUMNS))  # an hour at 1 kHz is 0.6 GB
        self._held = Held(_INPUTS)
        # Samples that wait for their estimate.
        self._pending = np.zeros(0, np.int64), np.zeros((sum(_INPUTS.values()), 0))
        self._frames: dict[bytes, None] = {}
        self._configurations: list[tuple[int, int, str]] = []

    def add(self, block: Block) -> None:
        """Take one block."""
        found = {name: block.of(name) for name in _INPUTS}
        estimates = block.of('estimate')
        for place, log_time, text in block.decoded('configuration', decode_text):
            with suppress(NotJsonError):  # such a text is shown as it is
                parse_json(text, 'configuration')
            before = len(self.stamps) + int(np.searchsorted(estimates.places, place))
            self._configurations.append((log_time, before, text))
        for frame in frame_names(block.messages, found['velocity'].places):
            if len(self._frames) >= _MAX_FRAMES:
                break
            self._frames[frame] = None
        inputs = self._inputs_of(estimates, found)
        forces = np.full((2, len(estimates.places)), math.nan)
        for row, name in enumerate(('feedforward', 'acted'), start=-2):
            self._add_forces(block.of(name), estimates, forces[row], self._columns[row])
        self.stamps.frombytes(estimates.stamps.tobytes())
        extend(self._columns, np.concatenate([inputs, estimates.numbers, forces]))

    def _inputs_of(self, estimates: Numbers, found: Mapping[str, Numbers]) -> FloatArray:
        """Inputs of each estimate, shape (6, n); NaN where its sample is not in the bag."""
        velocities = found['velocity']
        earlier, columns = self._pending
        samples = np.concatenate([earlier, velocities.stamps])
        columns = np.concatenate([columns, self._held.at(velocities.places, found)], axis=1)
        count = len(samples)
        answers, used, waiting = in_turn(
            np.concatenate([samples, estimates.stamps]),
            np.concatenate([np.arange(-len(earlier), 0), velocities.places, estimates.places]),
            np.arange(count + len(estimates.stamps)) >= count,
        )
        inputs = np.full((len(columns), len(estimates.stamps)), math.nan)
        inputs[:, answers - count] = columns[:, used]
        waiting = waiting[-_MAX_PENDING:]
        self._pending = samples[waiting], columns[:, waiting]
        return inputs

    def _add_forces(
        self, feedforwards: Numbers, estimates: Numbers, forces: FloatArray, earlier: 'array[float]'
    ) -> None:
        """Set the force that was published with each estimate; ``earlier`` has those of the blocks before."""
        before = np.searchsorted(estimates.places, feedforwards.places) - 1
        for number in np.flatnonzero(before < 0).tolist():
            if self.stamps and self.stamps[-1] == feedforwards.stamps[number]:
                earlier[-1] = float(feedforwards.numbers[0, number])
        places = before[before >= 0]
        same = estimates.stamps[places] == feedforwards.stamps[before >= 0]
        forces[places[same]] = feedforwards.numbers[0, before >= 0][same]

    def run(self, source: ActuatorBag) -> RecordedRun:
        """Arrays of all messages so far; an input that cannot be a measurement becomes NaN. BagError: no estimate."""
        if not self.stamps:
            raise BagError(f'{source.path}: no estimates: none of those in its index, or no velocity')
        stamps = np.frombuffer(self.stamps, dtype=np.int64)
        columns = [np.frombuffer(column, dtype=np.float64) for column in self._columns]
        values: dict[str, Any] = dict(zip(_COLUMNS, columns, strict=True))
        values.update({name: values[name].astype(np.int64) for name in _INTEGERS})
        for column in _INPUT_COLUMNS:
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
            name=source.name,
            topics={topic: (info.type_name, info.message_count) for topic, info in source.infos.items()},
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
