"""Measured against estimated friction of a run: its strokes at even speed, its starts, and both at each pressure.

In steady sliding nothing accelerates (and in the middle of a sine stroke the inertia averages out), so the force sum
is the friction. At rest, the largest force sum before the rod moves is the breakaway force. The definitions of steady,
of a start and of one pressure are our choice; see the constants below.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import chain, groupby, pairwise
from operator import itemgetter
from statistics import fmean
from typing import NamedTuple

import numpy as np

from seal_friction_ros.core.foundation.arrays import BoolArray, FloatArray, IntArray
from seal_friction_ros.core.foundation.normal_distribution import BAND_95
from seal_friction_ros.core.friction.states import FrictionState
from seal_friction_ros.core.messages.records import EXTRAPOLATED, Status

MAX_GAP = 0.5  # [s] samples further apart do not belong to one stretch of a recording (our choice)
LARGEST_INPUT = 1e15  # [SI] above any real pressure, force or speed; the comparison also drops NaN and infinity
TRIMMED_SHARE = 0.2  # of the samples of a stroke, dropped at each end: starting and stopping
SPEED_TOLERANCE = 0.2  # of the median speed of the rest: within it the rod slides steadily
STEADY_SHARE = 0.5  # of the rest must slide steadily; a stroke that only accelerates reaches 0.33, a sine 0.82
MIN_STEADY_SAMPLES = 10
MIN_REST = 0.1  # [s] a shorter stop, as at a reversal, is no rest before a breakaway
LEAST_SHARE = 0.1  # of the estimate: a smaller reading gives no percentage (our choice)
LEAST_FRICTION = 0.02  # of the largest friction of the bag: a smaller reading is near zero, likewise (our choice)
LEAST_BREAKAWAY = 0.5  # of the measured sliding friction: a smaller force at a start was no breakaway (our choice)
LEAST_OWN = 0.1  # of an offset must be its own, not explained by friction: a variance inflation of 10 (our choice)
LARGEST_REMAINDER = 0.1  # of the friction, up to which it is in proportion to the estimate (our choice)
LEVEL_GAP = 0.05  # of the pressure: a larger step between sorted pressures separates two levels; a pressure regulator
#                   holds a few per cent more in one direction than in the other, and both are one level
LEVEL_GAP_MIN = 1e4  # [Pa] so that sensor noise near zero pressure makes no levels
LEVEL_WIDTH = 0.1  # of the highest pressure: a wider level is a ramp, and is cut into equal parts


class Samples(NamedTuple):
    """Columns of a run, shape (n,), one entry per estimate; NaN where an input is missing."""

    time: FloatArray  # [s] of the estimate
    velocity: FloatArray  # [m/s]
    pressure: FloatArray  # [Pa, gauge] mean over the seals
    force_sum: FloatArray  # [N] corrected as by the estimator
    coulomb_friction: FloatArray  # [N] estimate, as are the next three
    coulomb_friction_std: FloatArray  # [N]
    breakaway_force: FloatArray  # [N]
    friction_force: FloatArray  # [N]
    adaptation_scale: FloatArray  # [-] friction over that of the seal file, as learnt
    state: IntArray
    direction: IntArray  # -1, 0 or 1
    status: IntArray


class Event(NamedTuple):
    """One steady stroke, or one start from rest."""

    direction: int  # -1 or 1
    pressure: float  # [Pa, gauge]
    force_sum: float  # [N] signed: mean of a stroke, peak of a start
    estimated: float  # [N] Coulomb friction of a stroke, breakaway force of a start
    std: float  # [N] one standard deviation of the Coulomb friction
    speed: float  # [m/s] mean of a stroke, about 0 at a start
    samples: int
    first: int  # index of the first estimate
    last: int  # index of the last estimate
    time: float = 0.0  # [s] of the first estimate
    scale: float = 1.0  # [-] learnt then


@dataclass(frozen=True)
class PressureLevel:
    """Measured against estimated friction at one pressure: sliding or breakaway."""

    pressure: float  # [Pa, gauge] mean
    measured: float  # [N]
    measured_spread: float | None  # [N] standard deviation between events, offset removed; None with too few events
    offset: float | None
    """[N] removed offset: mean force sum of the two directions; with one direction that of the bag, None if unknown"""
    estimated: float  # [N]
    estimated_std: float  # [N]
    deviation: float  # [N] estimated minus measured
    deviation_percent: float | None  # [%] of the measured friction; None where this makes no sense
    why_no_percent: str  # reason; empty if there is a percentage
    in_band: int  # events with their own reading in the 95 % band of the estimate
    samples: int
    events: tuple[Event, ...]

    @property
    def both_directions(self) -> bool:
        """Whether events in both directions give the offset of the force sum at this pressure."""
        return len({event.direction for event in self.events}) == 2

    @property
    def has_bag_offset(self) -> bool:
        """Whether the offset of the bag was removed, since this pressure has one direction only."""
        return self.offset is not None and not self.both_directions

    def reading(self, event: Event) -> float:
        """Friction of one event [N], offset removed."""
        return event.direction * (event.force_sum - (self.offset or 0.0))


@dataclass(frozen=True)
class FrictionByPressure:
    """Comparison at every pressure level."""

    offset: float | None  # [N] constant offset of the force sum by `offset_of_strokes`; None if not determined
    sliding: tuple[PressureLevel, ...]
    breakaway: tuple[PressureLevel, ...]


class Events(NamedTuple):
    """What of a run is read."""

    strokes: tuple[Event, ...] = ()
    starts: tuple[Event, ...] = ()


def usable_samples(run: Samples) -> BoolArray:
    """Estimates whose inputs are good."""
    columns = (run.velocity, run.pressure, run.force_sum, run.coulomb_friction, run.coulomb_friction_std)
    usable: BoolArray = run.status & ~int(EXTRAPOLATED | Status.MODEL_DISAGREES) == 0
    for column in (*columns, run.breakaway_force):
        usable &= np.abs(column) < LARGEST_INPUT
    return usable


def events_of(run: Samples) -> Events:
    """Steady strokes and starts of a run.

    A stroke is a run of estimates that slide one way (samples of unknown state left out). Its first and last
    `TRIMMED_SHARE` are dropped; the samples of the rest within `SPEED_TOLERANCE` of the median speed are steady. The
    stroke counts with at least `MIN_STEADY_SAMPLES` steady samples that are at least `STEADY_SHARE` of the rest. A
    start is a rest of `MIN_REST` with a stroke after it; its force is the largest in the direction of this stroke.
    """
    usable, motions = usable_samples(run), motions_of(run)
    return Events(
        tuple(event for motion in motions if (event := _steady_stroke(run, usable, *motion))),
        tuple(event for rest, motion in pairwise(motions) if (event := _start(run, usable, rest, motion))),
    )


def friction_by_pressure(events: Events) -> FrictionByPressure:
    """Measured against estimated friction at every pressure level, sliding and at breakaway.

    The measured friction of a level is half the difference of the mean force sums of the two directions, each stroke
    with the same weight, so a constant offset of the force sum cancels. A level with one direction, as in a swept log,
    has the offset of `offset_of_strokes` removed.
    """
    offset = offset_of_strokes(events.strokes)
    sliding, breakaway = _levels(events.strokes, offset), _levels(events.starts, offset)
    breakaway = tuple(_checked_breakaway(level, sliding) for level in breakaway)
    largest = max((level.measured for level in chain(sliding, breakaway)), default=0.0)
    sliding, breakaway = (tuple(_checked_size(one, largest) for one in levels) for levels in (sliding, breakaway))
    return FrictionByPressure(offset, sliding, breakaway)


def offset_of_strokes(strokes: Sequence[Event]) -> float | None:
    r"""Constant offset of the force sum [N]: least squares over all strokes, in both directions.

    .. math:: F_i = o + d_i\,(f_0 + k\,p_i + c\,v_i) \quad \text{or} \quad F_i = o + s\,d_i\,\hat F_i

    where F is the force sum [N], d the direction, p the pressure [Pa], v the speed [m/s] and o the offset [N]. The
    second form, friction in proportion to the estimate, is for strokes whose directions differ in pressure and speed;
    it counts if it leaves less than `LARGEST_REMAINDER` of the friction. Both forms are our choice. None if the strokes
    do not determine the offset: a single direction, too few strokes, or an offset that friction explains as well.
    """
    if len({stroke.direction for stroke in strokes}) < 2:
        return None
    rows = [(s.direction, s.pressure, s.speed, s.direction * s.estimated, s.force_sum) for s in strokes]
    direction, pressure, speed, estimated, force = np.array(rows).T
    found = _offset_beside(np.column_stack([direction, direction * pressure, direction * speed]), force)
    if found is not None:
        return found[0]
    found = _offset_beside(estimated[:, np.newaxis], force)
    return found[0] if found is not None and found[1] <= LARGEST_REMAINDER else None


def _offset_beside(friction: FloatArray, force: FloatArray) -> tuple[float, float] | None:
    """Offset [N] of ``force`` [N], shape (n,), beside the columns of ``friction``, shape (n, columns).

    The second value is the RMS of what remains over the RMS of the friction [-]. None if it is not determined: less
    than `LEAST_OWN` of a constant is not explained by the friction.
    """
    design = friction / np.maximum(np.linalg.norm(friction, axis=0), 1e-12)
    if len(force) < int(np.linalg.matrix_rank(design, tol=1e-3)) + 2:
        return None
    parts = np.column_stack((np.ones_like(force), force))
    own, left = (parts - design @ np.linalg.lstsq(design, parts, rcond=1e-3)[0]).T
    if float(own @ own) < LEAST_OWN * len(force):
        return None
    offset = float(own @ left / (own @ own))
    remainder, size = float(np.linalg.norm(left - offset * own)), float(np.linalg.norm(force - offset))
    return offset, remainder / size if size else math.inf


def motions_of(run: Samples) -> list[tuple[int, IntArray]]:
    """Direction (0 at rest) and indices of each run of estimates in one direction or at rest, in order."""
    index = np.flatnonzero(run.state != FrictionState.UNKNOWN)
    if not len(index):
        return []
    direction = np.where(run.state == FrictionState.SLIDING, run.direction, 0)[index]
    steps = np.diff(run.time[index])
    longest = max(MAX_GAP, 20.0 * float(np.median(steps))) if len(steps) else MAX_GAP
    ends = np.flatnonzero((np.diff(direction) != 0) | (steps > longest) | (steps < 0.0)) + 1
    return [(int(direction[part[0]]), index[part]) for part in np.split(np.arange(len(index)), ends)]


def _steady_stroke(run: Samples, usable: BoolArray, direction: int, index: IntArray) -> Event | None:
    trimmed = round(TRIMMED_SHARE * len(index))
    middle = index[trimmed : len(index) - trimmed]
    middle = middle[usable[middle]]
    if direction == 0 or len(middle) < MIN_STEADY_SAMPLES:
        return None
    speed = np.abs(run.velocity[middle])
    median = float(np.median(speed))
    steady = middle[np.abs(speed - median) <= SPEED_TOLERANCE * median]
    if len(steady) < max(MIN_STEADY_SAMPLES, STEADY_SHARE * len(middle)):
        return None
    estimated = direction * run.friction_force[steady]  # Coulomb friction and velocity friction
    return _event(run, direction, steady, estimated, len(steady), index)


def _start(run: Samples, usable: BoolArray, rest: tuple[int, IntArray], motion: tuple[int, IntArray]) -> Event | None:
    direction, index = motion[0], rest[1]
    gap, duration = run.time[motion[1][0]] - run.time[index[-1]], run.time[index[-1]] - run.time[index[0]]
    is_start = rest[0] == 0 and direction != 0 and gap <= MAX_GAP and duration >= MIN_REST
    index = index[usable[index]]
    if not is_start or len(motion[1]) < MIN_STEADY_SAMPLES or not len(index):
        return None
    peak = index[[np.argmax(direction * run.force_sum[index])]]
    if direction * run.force_sum[peak[0]] <= 0.0:  # a force outside the force sum moved the rod, or the sign is wrong
        return None
    return _event(run, direction, peak, run.breakaway_force[peak], len(index), rest[1])


def _event(run: Samples, direction: int, read: IntArray, estimated: FloatArray, samples: int, index: IntArray) -> Event:
    """Event over ``index`` from the means at the indices ``read``."""
    pressure, force, std = (
        float(column[read].mean()) for column in (run.pressure, run.force_sum, run.coulomb_friction_std)
    )
    speed = float(np.abs(run.velocity[read]).mean())
    span = int(index[0]), int(index[-1])
    now = float(run.time[span[0]]), float(run.adaptation_scale[span[1]])
    return Event(direction, pressure, force, float(estimated.mean()), std, speed, samples, *span, *now)


def _levels(events: Sequence[Event], offset: float | None) -> tuple[PressureLevel, ...]:
    if not events:
        return ()
    ordered = sorted(events, key=lambda event: event.pressure)
    labels = pressure_labels(np.array([event.pressure for event in ordered])).tolist()
    levels = groupby(zip(labels, ordered, strict=True), key=itemgetter(0))
    return tuple(_level([event for _, event in members], offset) for _, members in levels)


def pressure_labels(pressures: FloatArray) -> IntArray:
    """Number of the pressure level that each of some increasing pressures [Pa] belongs to.

    A new level begins at every step above `LEVEL_GAP` of the pressure (at least `LEVEL_GAP_MIN`). A level wider than
    `LEVEL_WIDTH` of the highest pressure is a ramp, and is cut into equal parts that are not wider.
    """
    highest = float(np.abs(pressures).max())
    gap = np.maximum(LEVEL_GAP * np.abs(pressures[1:]), LEVEL_GAP_MIN)
    width = max(LEVEL_WIDTH * highest, 2.0 * LEVEL_GAP_MIN)
    labels, used = [], 0
    for inside in np.split(pressures, np.flatnonzero(np.diff(pressures) > gap) + 1):
        span = float(inside[-1] - inside[0])
        parts = max(math.ceil(span / width), 1)
        labels.append(used + np.minimum((inside - inside[0]) / (span or 1.0) * parts, parts - 1).astype(np.int64))
        used += parts
    return np.concatenate(labels)


def _level(events: Sequence[Event], bag_offset: float | None) -> PressureLevel:
    forces = {side: [event.force_sum for event in events if event.direction == side] for side in (1, -1)}
    means = [fmean(values) for values in forces.values() if values]
    both = len(means) == 2
    offset = fmean(means) if both else bag_offset
    readings = np.array([event.direction * (event.force_sum - (offset or 0.0)) for event in events])
    measured = (means[0] - means[1]) / 2.0 if both else fmean(float(r) for r in readings)
    freedom = len(events) - len(means)  # degrees of freedom
    spread = math.sqrt(float(np.sum((readings - measured) ** 2)) / freedom) if freedom > 0 else None
    pressure, estimated, std = (fmean(getattr(e, name) for e in events) for name in ('pressure', 'estimated', 'std'))
    deviation = estimated - measured
    why_not = ''
    if measured <= 0.0:
        why_not = 'the measured force is against the motion'
    elif measured < LEAST_SHARE * abs(estimated):
        why_not = f'the measured force is below {100.0 * LEAST_SHARE:.0f} % of the estimate'
    in_band = sum(abs(e.estimated - r) <= BAND_95 * e.std for e, r in zip(events, readings, strict=True))
    return PressureLevel(
        pressure,
        measured,
        spread,
        offset,
        estimated,
        std,
        deviation,
        None if why_not else 100.0 * deviation / measured,
        why_not,
        int(in_band),
        sum(event.samples for event in events),
        tuple(events),
    )


def _checked_breakaway(level: PressureLevel, sliding: Sequence[PressureLevel]) -> PressureLevel:
    """The level without a percentage where the rod left with less than `LEAST_BREAKAWAY` of the sliding friction.

    Static friction is not below dynamic friction: then friction did not hold the rod. The sliding friction is that of
    the nearest pressure within `LEVEL_WIDTH`.
    """
    near = min(sliding, key=lambda other: abs(other.pressure - level.pressure), default=None)
    if near is None or level.measured <= 0.0:
        return level
    is_near = abs(near.pressure - level.pressure) <= max(LEVEL_WIDTH * abs(level.pressure), 2.0 * LEVEL_GAP_MIN)
    if not is_near or level.measured >= LEAST_BREAKAWAY * near.measured:
        return level
    share = f'{100.0 * LEAST_BREAKAWAY:.0f} % of the sliding friction'
    return replace(level, deviation_percent=None, why_no_percent=f'no start from rest: the force is below {share}')


def _checked_size(level: PressureLevel, largest: float) -> PressureLevel:
    """The level without a percentage where its friction is near zero, below `LEAST_FRICTION` of the ``largest`` [N]."""
    if level.why_no_percent or level.measured >= LEAST_FRICTION * largest:
        return level
    return replace(level, deviation_percent=None, why_no_percent='the measured friction is near zero')
