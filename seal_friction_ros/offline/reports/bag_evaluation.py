"""Numbers from a bag: the inputs held at each estimate, and measured against estimated friction.

In steady sliding nothing accelerates (and in the middle of a sine stroke the inertia averages out), so the force sum
is the friction; at rest, the largest force sum before the rod moves is the breakaway force. What counts as steady, as
a start and as one pressure is our choice and stands with the constants below.
"""

import json
import math
from array import array
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from itertools import chain, pairwise
from pathlib import Path
from statistics import fmean
from typing import Any, NamedTuple

import numpy as np

from seal_friction_ros.core.estimation.configuration import parse_snapshot
from seal_friction_ros.core.estimation.messages import DECODERS
from seal_friction_ros.core.estimation.records import FrictionEstimate, Status, Velocity
from seal_friction_ros.core.foundation.arrays import BoolArray, FloatArray, IntArray
from seal_friction_ros.core.friction.states import FrictionState
from seal_friction_ros.offline.bags.bag import BagError, BagMessage, bag_topics, read_messages
from seal_friction_ros.offline.bags.topics import Topics, find_topics
from seal_friction_ros.offline.work.progress import progress

TRIMMED_SHARE = 0.2  # of the samples of a stroke, at each end: starting and stopping
SPEED_TOLERANCE = 0.2  # of the median speed of what is left: within it the rod slides steadily
STEADY_SHARE = 0.5  # of what is left must slide steadily; a stroke that only accelerates reaches 0.33, a sine 0.82
MIN_STEADY_SAMPLES = 10
MIN_REST = 0.1  # [s] a shorter stop, as at a reversal, is no rest to break away from
MAX_GAP = 0.5  # [s] a longer gap in time (or of 20 sample periods) ends a stroke or a rest
LEVEL_GAP = 0.05  # of the pressure: a larger step between sorted pressures separates two levels; a pressure regulator
#                   holds a few per cent more in one direction than in the other, and both belong together
LEVEL_GAP_MIN = 1e4  # [Pa] sensor noise near zero pressure makes no levels
LEVEL_WIDTH = 0.1  # of the highest pressure: a wider level is a ramp, and is cut into equal parts
BAND_95 = 1.96  # standard deviations on each side that hold 95 % of a normal distribution

_MAX_PENDING = 10_000  # velocity samples that may wait for their estimate; more were never answered
_ABSURD = 1e15  # [SI] no pressure, force or speed is as large; a comparison with it drops NaN and infinity too
_INPUTS = ('velocity', 'pressure_a', 'pressure_b', 'force_sum', 'position', 'reference')
_COLUMNS = (*_INPUTS, *FrictionEstimate._fields[1:], 'feedforward_force')
_INTEGERS = {'state', 'direction', 'status'}
_HARMLESS = int(Status.OUTSIDE_IDENTIFIED_RANGE)  # the inputs are good, only the law is stretched


@dataclass(frozen=True, eq=False)
class RecordedRun:
    """A bag as arrays, one entry per estimate; an input that was missing is NaN."""

    name: str
    topics: dict[str, tuple[str, int]]
    """topic -> its type and number of messages"""
    frames: tuple[str, ...]
    """frame names of the velocity samples"""
    configurations: tuple[tuple[float, str], ...]
    """time [s] and JSON text of each change of configuration"""
    configuration_rows: tuple[int, ...]
    """estimates before each of them, in the order of the bag"""
    chambers: tuple[str, ...]
    """chamber of each seal"""
    start: int
    """[ns] stamp of the first estimate"""
    time: FloatArray
    """[s] since the first estimate"""
    velocity: FloatArray
    """[m/s]"""
    pressure_a: FloatArray
    """[Pa, gauge]"""
    pressure_b: FloatArray
    """[Pa, gauge]"""
    force_sum: FloatArray
    """[N]"""
    position: FloatArray
    """[m]"""
    reference: FloatArray
    """[m] position asked for"""
    coulomb_friction: FloatArray
    """[N]"""
    coulomb_friction_std: FloatArray
    """[N]"""
    breakaway_force: FloatArray
    """[N]"""
    friction_force: FloatArray
    """[N]"""
    state: IntArray
    direction: IntArray
    status: IntArray
    input_age: FloatArray
    """[s]"""
    feedforward_force: FloatArray
    """[N] that went out with the estimate; NaN where none did"""

    @cached_property
    def pressure(self) -> FloatArray:
        """Mean of the pressures that the seals see [Pa, gauge]."""
        share_a = self.chambers.count('a') / len(self.chambers)
        if share_a in (0.0, 1.0):  # 0 * NaN is NaN: a chamber without a seal must not count
            return self.pressure_a if share_a else self.pressure_b
        return share_a * self.pressure_a + (1.0 - share_a) * self.pressure_b


class Event(NamedTuple):
    """One steady stroke, or one start from rest."""

    direction: int
    """-1 or 1"""
    pressure: float
    """[Pa, gauge]"""
    force_sum: float
    """[N] signed: mean of a stroke, peak of a start"""
    estimated: float
    """[N] Coulomb friction of a stroke, breakaway force of a start"""
    std: float
    """[N] one standard deviation of the Coulomb friction"""
    samples: int
    first: int
    """index of the first estimate"""
    last: int
    """index of the last estimate"""


@dataclass(frozen=True)
class PressureLevel:
    """Measured against estimated friction at one pressure: sliding or breakaway."""

    pressure: float
    """[Pa, gauge] mean"""
    measured: float
    """[N]"""
    measured_spread: float | None
    """[N] standard deviation between events, offset removed; None while there are too few"""
    offset: float | None
    """[N] what was removed: mean force sum of the two directions; None with one direction"""
    estimated: float
    """[N]"""
    estimated_std: float
    """[N]"""
    deviation: float
    """[N] estimated minus measured"""
    deviation_percent: float | None
    """[%] of the measured; None where that is not above 0 N"""
    in_band: int
    """events whose own reading lies in the 95 % band of the estimate"""
    samples: int
    events: tuple[Event, ...]

    @property
    def both_directions(self) -> bool:
        """Whether the offset of the force sum could be removed."""
        return self.offset is not None

    def reading(self, event: Event) -> float:
        """Friction that one event shows by itself [N], offset removed."""
        return event.direction * (event.force_sum - (self.offset or 0.0))


@dataclass(frozen=True)
class FrictionByPressure:
    """Comparison at every pressure level, and what has to be said about it."""

    sliding: tuple[PressureLevel, ...]
    breakaway: tuple[PressureLevel, ...]
    notes: tuple[str, ...]


@dataclass(frozen=True)
class BagEvaluation:
    """Numbers of a bag."""

    friction: FrictionByPressure
    estimates: int
    start: int
    """[ns]"""
    duration: float
    """[s] from the first stamp to the last"""
    rates: dict[str, float]
    """topic -> messages per second of that duration"""
    state_shares: dict[str, float]
    """state -> share of the time"""
    status_counts: dict[str, int]
    """bit -> estimates that have it"""
    flagged: int
    """estimates with any status bit"""
    input_age: dict[str, float]
    """quantiles [s] of the age of the inputs; empty if an input never came"""


# -- reading ----------------------------------------------------------------------------------------------------------


def read_run(bag: Path, namespace: str = '') -> RecordedRun:
    """Read a bag of inputs and estimates.

    The inputs of an estimate are what was held when the velocity sample of the same stamp came.

    Args:
        bag: The bag.
        namespace: Only topics below it count; for bags of several actuators.

    Raises:
        BagError: The bag cannot be read, or holds no estimates.
    """
    topics = find_topics(bag, namespace)
    if not topics.estimate:
        raise BagError(f'{bag}: no estimates in it: make a bag that has them with seal_friction replay {bag} --out BAG')
    collector = _Collector(topics)
    infos = bag_topics(bag)
    with progress(f'read {bag.name}', sum(info.message_count for info in infos.values())) as advance:
        for count, message in enumerate(read_messages(bag), start=1):
            if message.topic in topics:
                collector.take(message)
            if count % 1000 == 0:
                advance(1000)
    if not collector.stamps:
        raise BagError(f'{bag}: its index tells of estimates but there are none')
    counts = {topic: (info.type_name, info.message_count) for topic, info in infos.items()}
    return collector.run(bag.resolve().name, counts)


class _Collector:
    """Follows the messages of a bag and keeps one row per estimate."""

    def __init__(self, topics: Topics) -> None:
        self.stamps = array('q')
        self._topics = topics
        self._rows = array('d')
        self._held = dict.fromkeys(_INPUTS, math.nan)
        self._pending: dict[int, tuple[float, ...]] = {}
        self._frames: dict[bytes, None] = {}
        self._configurations: list[tuple[int, int, str]] = []

    def take(self, message: BagMessage) -> None:
        """Take one message in; a damaged one is an error that names it."""
        try:
            self._take(message)
        except ValueError as error:
            raise BagError(f'message on {message.topic} at {message.log_time} ns: {error}') from None

    def _take(self, message: BagMessage) -> None:
        topic, topics, held = message.topic, self._topics, self._held
        record = DECODERS[message.type_name](message.data)
        if topic == topics.velocity:
            self._take_velocity(record)
        elif topic == topics.pressure:
            held['pressure_a'], held['pressure_b'] = record.chamber_a, record.chamber_b
        elif topic == topics.force:
            held['force_sum'] = record.force
        elif topic == topics.position:
            held['position'] = record.position
        elif topic == topics.reference:
            held['reference'] = record.position
        elif topic == topics.estimate:
            self.stamps.append(record.stamp)
            self._rows.extend(self._pending.pop(record.stamp, (math.nan,) * len(_INPUTS)))
            self._rows.extend((*record[1:], math.nan))
        elif topic == topics.feedforward:
            if self.stamps and self.stamps[-1] == record.stamp:
                self._rows[-1] = record.force
        else:
            self._configurations.append((message.log_time, len(self.stamps), record))

    def _take_velocity(self, sample: Velocity) -> None:
        self._held['velocity'] = sample.velocity
        self._pending[sample.stamp] = tuple(self._held.values())
        if len(self._pending) > _MAX_PENDING:
            del self._pending[next(iter(self._pending))]
        if len(self._frames) < 10:
            self._frames[sample.frame_id] = None

    def run(self, name: str, counts: dict[str, tuple[str, int]]) -> RecordedRun:
        """Arrays of all that was taken in; what cannot be a measurement is NaN."""
        stamps = np.frombuffer(self.stamps, dtype=np.int64)
        columns = np.frombuffer(self._rows, dtype=np.float64).reshape(len(stamps), len(_COLUMNS)).T.copy()
        values: dict[str, Any] = dict(zip(_COLUMNS, columns, strict=True))
        values.update({name: values[name].astype(np.int64) for name in _INTEGERS})
        for column in _INPUTS:
            values[column][~(np.abs(values[column]) < _ABSURD)] = math.nan  # a fault: nothing to evaluate or to draw
        refused = (values['status'] & int(Status.VELOCITY_OUT_OF_RANGE)) != 0
        values['velocity'][refused] = math.nan
        start = int(stamps[0])
        # A configuration has no stamp of its own: it counts from when it was recorded.
        changes = tuple((round((t - start) * 1e-9, 6), text) for t, _, text in self._configurations)
        return RecordedRun(
            name=name,
            topics=counts,
            frames=tuple(frame.decode(errors='replace') for frame in self._frames),
            configurations=changes,
            configuration_rows=tuple(row for _, row, _ in self._configurations),
            chambers=_chambers(changes),
            start=start,
            time=np.asarray((stamps - start) * 1e-9, dtype=np.float64),
            **values,
        )


def _chambers(configurations: Sequence[tuple[float, str]]) -> tuple[str, ...]:
    """Chamber of each seal after the last configuration; one seal on each chamber while there is none."""
    if configurations:
        try:
            return parse_snapshot(configurations[-1][1]).configuration.selection.seal_chambers
        except (ValueError, LookupError, TypeError):
            pass  # shown in the report as it is; a bag of another version is still worth a look
    return ('a', 'b')


# -- evaluation -------------------------------------------------------------------------------------------------------


def evaluate(run: RecordedRun) -> BagEvaluation:
    """All numbers of a bag."""
    duration = float(run.time.max() - run.time.min())
    known = run.input_age[np.isfinite(run.input_age) & (run.input_age != -1.0)]
    ages = {}
    if len(known):
        quantiles = np.quantile(known, (0.5, 0.99, 1.0))
        ages = dict(zip(('p50', 'p99', 'max'), (float(q) for q in quantiles), strict=True))
    return BagEvaluation(
        friction_by_pressure(run),
        len(run.time),
        run.start,
        duration,
        {
            topic: count / duration if duration else 0.0
            for topic, (kind, count) in run.topics.items()
            if kind in DECODERS
        },
        _state_shares(run),
        _status_counts(run.status),
        int(np.count_nonzero(run.status)),
        ages,
    )


def _state_shares(run: RecordedRun) -> dict[str, float]:
    """Share of the time in each state; an estimate counts until the next, but for ten usual periods at most."""
    periods = np.diff(run.time, append=run.time[-1])
    usual = float(np.median(periods[:-1])) if len(periods) > 1 else 0.0
    periods[-1] = usual
    periods = np.clip(periods, 0.0, 10.0 * usual) if usual > 0.0 else np.ones_like(periods)
    total = float(periods.sum())
    return {state.name: float(periods[run.state == state].sum()) / total for state in FrictionState}


def _status_counts(status: IntArray) -> dict[str, int]:
    counts = {bit.name or '': int(np.count_nonzero(status & int(bit))) for bit in Status}
    unknown = int(np.count_nonzero(status & ~sum(int(bit) for bit in Status)))
    return {**counts, 'UNKNOWN_BITS': unknown} if unknown else counts


def friction_by_pressure(run: RecordedRun) -> FrictionByPressure:
    """Measured against estimated friction at every pressure level, sliding and at breakaway.

    A stroke is a run of estimates that slide one way (samples of unknown state left out). Its first and last
    `TRIMMED_SHARE` are dropped; of the rest, what is within `SPEED_TOLERANCE` of the median speed is steady. It counts
    with at least `MIN_STEADY_SAMPLES` of them, if they are at least `STEADY_SHARE` of the rest. A start is a rest of
    `MIN_REST` with a stroke after it; its force is the largest in the direction of that stroke.

    The measured friction of a level is half the difference of the mean force sums of the two directions, each stroke
    counting alike, so a constant offset of the force sum drops out.
    """
    columns = (run.velocity, run.pressure, run.force_sum, run.coulomb_friction, run.coulomb_friction_std)
    usable = run.status & ~_HARMLESS == 0
    for column in (*columns, run.breakaway_force):
        usable &= np.abs(column) < _ABSURD
    runs = _runs(run)
    strokes = [event for first_last in runs if (event := _steady_stroke(run, usable, *first_last))]
    starts = [event for rest, motion in pairwise(runs) if (event := _start(run, usable, rest, motion))]
    sliding, breakaway = _levels(strokes), _levels(starts)
    return FrictionByPressure(sliding, breakaway, _notes(run, usable, sliding, breakaway))


def _runs(run: RecordedRun) -> list[tuple[int, IntArray]]:
    """Direction (0 at rest) and indices of each run of estimates in one direction or at rest, in order."""
    index = np.flatnonzero(run.state != FrictionState.UNKNOWN)
    if not len(index):
        return []
    direction = np.where(run.state == FrictionState.SLIDING, run.direction, 0)[index]
    steps = np.diff(run.time[index])
    longest = max(MAX_GAP, 20.0 * float(np.median(steps))) if len(steps) else MAX_GAP
    ends = np.flatnonzero((np.diff(direction) != 0) | (steps > longest) | (steps < 0.0)) + 1
    return [(int(direction[part[0]]), index[part]) for part in np.split(np.arange(len(index)), ends)]


def _steady_stroke(run: RecordedRun, usable: BoolArray, direction: int, index: IntArray) -> Event | None:
    if direction == 0 or len(index) < MIN_STEADY_SAMPLES:
        return None
    trimmed = round(TRIMMED_SHARE * len(index))
    middle = index[trimmed : len(index) - trimmed]
    middle = middle[usable[middle]]
    if len(middle) < MIN_STEADY_SAMPLES:
        return None
    speed = np.abs(run.velocity[middle])
    median = float(np.median(speed))
    steady = middle[np.abs(speed - median) <= SPEED_TOLERANCE * median]
    if len(steady) < max(MIN_STEADY_SAMPLES, STEADY_SHARE * len(middle)):
        return None
    return Event(
        direction,
        pressure=float(run.pressure[steady].mean()),
        force_sum=float(run.force_sum[steady].mean()),
        estimated=float((direction * run.friction_force[steady]).mean()),  # Coulomb, and what the velocity adds
        std=float(run.coulomb_friction_std[steady].mean()),
        samples=len(steady),
        first=int(index[0]),
        last=int(index[-1]),
    )


def _start(
    run: RecordedRun, usable: BoolArray, rest: tuple[int, IntArray], motion: tuple[int, IntArray]
) -> Event | None:
    direction, index = motion[0], rest[1]
    follows = run.time[motion[1][0]] - run.time[index[-1]] <= MAX_GAP
    if rest[0] != 0 or direction == 0 or len(motion[1]) < MIN_STEADY_SAMPLES or not follows:
        return None
    if run.time[index[-1]] - run.time[index[0]] < MIN_REST:
        return None
    index = index[usable[index]]
    if not len(index):
        return None
    peak = int(index[np.argmax(direction * run.force_sum[index])])
    force = float(run.force_sum[peak])
    if direction * force <= 0.0:  # the rod was moved by what is not in the force sum, or the sign is wrong
        return None
    return Event(
        direction,
        pressure=float(run.pressure[peak]),
        force_sum=force,
        estimated=float(run.breakaway_force[peak]),
        std=float(run.coulomb_friction_std[peak]),
        samples=len(index),
        first=int(rest[1][0]),
        last=int(rest[1][-1]),
    )


def _levels(events: Sequence[Event]) -> tuple[PressureLevel, ...]:
    if not events:
        return ()
    ordered = sorted(events, key=lambda event: event.pressure)
    labels = pressure_labels(np.array([event.pressure for event in ordered]))
    ends = np.flatnonzero(np.diff(labels)) + 1
    bounds = [0, *(int(end) for end in ends), len(ordered)]
    return tuple(_level(ordered[first:last]) for first, last in pairwise(bounds))


def pressure_labels(pressures: FloatArray) -> IntArray:
    """Number of the pressure level that each of some increasing pressures [Pa] belongs to.

    A new level begins at every step above `LEVEL_GAP` of the pressure (`LEVEL_GAP_MIN` at least). A level wider than
    `LEVEL_WIDTH` of the highest pressure is a ramp, and is cut into equal parts that are not.
    """
    highest = float(np.abs(pressures).max())
    gap, width = (
        np.maximum(LEVEL_GAP * np.abs(pressures[1:]), LEVEL_GAP_MIN),
        max(LEVEL_WIDTH * highest, 2.0 * LEVEL_GAP_MIN),
    )
    labels = np.zeros(len(pressures), dtype=np.int64)
    clusters = np.split(np.arange(len(pressures)), np.flatnonzero(np.diff(pressures) > gap) + 1)
    used = 0
    for cluster in clusters:
        inside = pressures[cluster]
        span = float(inside[-1] - inside[0])
        parts = max(math.ceil(span / width), 1)
        part = np.minimum((inside - inside[0]) / (span or 1.0) * parts, parts - 1).astype(np.int64)
        labels[cluster] = used + part
        used += parts
    return labels


def _level(events: Sequence[Event]) -> PressureLevel:
    forces = {side: [event.force_sum for event in events if event.direction == side] for side in (1, -1)}
    means = [fmean(values) for values in forces.values() if values]
    offset = fmean(means) if len(means) == 2 else None
    readings = np.array([event.direction * (event.force_sum - (offset or 0.0)) for event in events])
    measured = (means[0] - means[1]) / 2.0 if offset is not None else fmean(float(r) for r in readings)
    # Each mean that was taken from the readings uses up one of them.
    freedom = len(events) - len(means)
    spread = math.sqrt(float(np.sum((readings - measured) ** 2)) / freedom) if freedom > 0 else None
    estimated, std = fmean(event.estimated for event in events), fmean(event.std for event in events)
    deviation = estimated - measured
    in_band = sum(abs(e.estimated - r) <= BAND_95 * e.std for e, r in zip(events, readings, strict=True))
    return PressureLevel(
        fmean(event.pressure for event in events),
        measured,
        spread,
        offset,
        estimated,
        std,
        deviation,
        100.0 * deviation / measured if measured > 0.0 else None,
        int(in_band),
        sum(event.samples for event in events),
        tuple(events),
    )


def _notes(
    run: RecordedRun, usable: BoolArray, sliding: tuple[PressureLevel, ...], breakaway: tuple[PressureLevel, ...]
) -> tuple[str, ...]:
    notes = []
    if not sliding:
        moving = np.count_nonzero(run.state == FrictionState.SLIDING)
        notes.append(
            f'No steady sliding in this bag ({moving} of {len(run.time)} estimates slide), so no measured friction: a '
            f'stroke needs {MIN_STEADY_SAMPLES} usable samples at nearly constant speed.'
        )
    for name, levels in (('sliding', sliding), ('breakaway', breakaway)):
        lonely = [f'{level.pressure / 1e5:.2f} bar' for level in levels if not level.both_directions]
        if lonely:
            notes.append(
                f'At {", ".join(lonely)} the {name} friction was measured in one direction only: the mean magnitude '
                'is used, and an offset of the force sum is in it.'
            )
        reversed_sign = [f'{level.pressure / 1e5:.2f} bar' for level in levels if level.measured <= 0.0]
        if reversed_sign:
            notes.append(
                f'At {", ".join(reversed_sign)} the force sum of {name} is against the motion: look at the signs of '
                'force sum and velocity.'
            )
    left_out = len(usable) - int(np.count_nonzero(usable))
    if left_out:
        notes.append(
            f'{left_out} of {len(usable)} estimates have unusable inputs and are left out of the measured friction.'
        )
    if not np.allclose(run.pressure_a, run.pressure_b, rtol=0.02, atol=5e3, equal_nan=True) and {'a', 'b'} <= {
        *run.chambers
    }:
        notes.append('The seals see different pressures: a level is the mean of the pressures that the seals see.')
    return tuple(notes)


def as_figures(evaluation: BagEvaluation) -> dict[str, Any]:
    """The numbers for JSON: plain types, every one finite or null, single strokes left out."""
    document = asdict(evaluation)
    for level in chain(document['friction']['sliding'], document['friction']['breakaway']):
        level['events'] = len(level['events'])
    result: dict[str, Any] = json.loads(json.dumps(document, allow_nan=False))
    return result


def worst(levels: Iterable[PressureLevel]) -> PressureLevel | None:
    """Level with the largest relative deviation; None if no level has one."""
    comparable = [level for level in levels if level.deviation_percent is not None]
    return max(comparable, key=lambda level: abs(level.deviation_percent or 0.0), default=None)
