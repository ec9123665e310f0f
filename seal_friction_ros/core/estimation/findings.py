"""What a run shows, and one verdict on it: the same on the page of a bag, of a fleet, and in the live view.

``seen = seen_in(run)`` of the columns of a bag, or a `Follower` of a stream; ``findings_of(seen)``, the deciding one
first, and ``verdict_of(findings)``. Every limit here is our choice.
"""

import math
from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from seal_friction_ros.core.estimation.strokes import (
    MAX_GAP,
    Events,
    PressureLevel,
    Samples,
    events_of,
    friction_by_pressure,
    motions_of,
)
from seal_friction_ros.core.foundation.arrays import FloatArray, IntArray
from seal_friction_ros.core.foundation.normal_distribution import BAND_95
from seal_friction_ros.core.friction.states import FrictionState
from seal_friction_ros.core.messages.records import EXTRAPOLATED, Status

GOOD, LOOK, BAD = 'good', 'look', 'bad'
MOST_IN_BAND, FEWEST_IN_BAND = 0.9, 0.5  # [-] of the strokes or readings in the 95 % band: GOOD from, BAD below
MOST_FLAGGED, FAR_TOO_MANY_FLAGGED = 0.01, 0.1  # [-] of the estimates or the time without good inputs, likewise
DISAGREEING = 0.05  # [-] of the sliding estimates whose friction is not that of the model: LOOK above
SMALL_CHANGE = 0.1  # [-] of the friction, against its file or within the run: LOOK above, if the strokes tell it
FEWEST_STROKES = 4  # fewer are too few for a verdict
FEWEST_OF_DRIFT = 8  # strokes that tell a drift

STATUS_WORDS = {
    Status.PRESSURE_MISSING: 'no valid pressure yet: all forces are 0',
    Status.FORCE_MISSING: 'no valid force sum yet: friction at rest is not known',
    Status.PRESSURE_STALE: 'the pressure is old',
    Status.FORCE_STALE: 'the force sum is old',
    Status.PRESSURE_NOT_FINITE: 'the pressure is not a finite number',
    Status.FORCE_NOT_FINITE: 'the force sum is not a finite number',
    Status.VELOCITY_NOT_FINITE: 'the velocity is not a finite number',
    Status.PRESSURE_OUT_OF_RANGE: 'the pressure is outside pressure_min to pressure_max',
    Status.FORCE_OUT_OF_RANGE: 'the force sum is beyond force_max',
    Status.VELOCITY_OUT_OF_RANGE: 'the velocity is beyond velocity_max',
    Status.OUTSIDE_IDENTIFIED_RANGE: 'a pressure is outside the identified range: the law is extrapolated',
    Status.STAMP_NOT_INCREASING: 'stamps of the velocity do not increase',
    Status.PRESSURE_LEAP: 'the pressure jumps',
    Status.FORCE_LEAP: 'the force sum jumps',
    Status.VELOCITY_LEAP: 'the velocity jumps',
    Status.INPUT_REFUSED: 'an input has a second publisher: rejected',
    Status.STAMP_AGE: 'stamp and receipt of the velocity are too far apart: is a clock wrong?',
    Status.MOTION_UNCERTAIN: 'the velocity does not tell rest from motion',
    Status.FASTER_THAN_IDENTIFIED: 'faster than the seals were identified: extrapolated',
    Status.SLOWER_THAN_IDENTIFIED: 'slower than the seals were identified: extrapolated',
    Status.DIRECTION_NOT_IDENTIFIED: 'a direction in which a seal was not identified: extrapolated',
    Status.FORCE_CONTAINS_LOAD: 'the force sum holds an unknown load: friction at rest is not known',
    Status.MODEL_DISAGREES: 'the force sum shows another friction than the seal files',
    Status.TEMPERATURE_MISSING: 'no valid temperature of the seals',
    Status.OUTSIDE_IDENTIFIED_TEMPERATURE: 'outside the identified temperatures: extrapolated',
    Status.PRESLIDING: 'the seals may still shear: the friction follows their elasticity',
    Status.LATE_INPUT: 'the velocity comes late, or simulated time stands still',
}
"""Bit of the status -> what it means for a person; FrictionEstimate.msg has the definition."""

USUAL = Status.MOTION_UNCERTAIN | Status.SLOWER_THAN_IDENTIFIED | Status.PRESLIDING
"""Bits that every reversal has."""
_FAULTS = sum(map(int, STATUS_WORDS)) & ~int(USUAL | EXTRAPOLATED | Status.MODEL_DISAGREES)  # inputs that are not good
_EXTRAPOLATED = int(EXTRAPOLATED & ~USUAL)
_DISAGREES = int(Status.MODEL_DISAGREES)
_BITS = np.array([int(bit) for bit in Status])


class Verdict(NamedTuple):
    """Result in one line."""

    level: str  # GOOD: use it; LOOK: read on first; BAD: do not use it as it is
    text: str  # with the reason
    next: str = ''  # what to do


class Finding(NamedTuple):
    """One thing that a run shows."""

    level: str  # GOOD, LOOK or BAD
    what: str  # with how much, no full stop
    next: str  # what to do, likewise
    amount: float | None = None  # [-] as a share
    noise: float | None = None  # [-] that 95 % of repetitions stay below
    since: float | None = None  # [s] since the first estimate
    name: str = ''  # of the run that it is of, where there are several

    @property
    def text(self) -> str:
        """In words, with name and beginning."""
        began = '' if self.since is None else f', first at {self.since:.1f} s'
        return (f'{self.name}: ' if self.name else '') + self.what + began


class Limits(NamedTuple):
    """Alarm limits."""

    scale_low: float = 0.6  # [-] friction over that of the seal file
    scale_high: float = 1.5
    breakaway: float = 2.5  # [-] friction of a start over Coulomb friction
    noise: float = 0.3  # [-] residual over Coulomb friction


USUAL_LIMITS = Limits()


class Seen(NamedTuple):
    """What a run, or a part of it, shows."""

    begin: float = math.nan  # [s] first and last estimate
    end: float = math.nan
    estimates: int = 0
    sliding: int = 0  # estimates
    faulty: int = 0  # estimates with inputs that are not good
    extrapolated: int = 0  # estimates
    disagreeing: int = 0  # sliding estimates whose friction is not that of the model
    counts: IntArray = np.zeros(len(Status), np.int64)  # estimates with each bit of the status, in their order
    since: FloatArray = np.full(len(Status), math.inf)  # [s] first estimate with each
    silences: tuple[tuple[float, float], ...] = ()  # [s] begin and length of each stretch without estimates
    events: Events = Events()


def seen_in(run: Samples) -> Seen:
    """What a run shows, from its columns."""
    if not len(run.time):
        return Seen()
    held, slides = (run.status & _BITS[:, np.newaxis]) != 0, run.state == FrictionState.SLIDING
    wide = np.flatnonzero(np.diff(run.time) > MAX_GAP)
    return Seen(
        float(run.time[0]),
        float(run.time[-1]),
        len(run.time),
        int(np.count_nonzero(slides)),
        int(np.count_nonzero(run.status & _FAULTS)),
        int(np.count_nonzero(run.status & _EXTRAPOLATED)),
        int(np.count_nonzero(run.status[slides] & _DISAGREES)),
        held.sum(axis=1),
        np.where(held.any(axis=1), run.time[held.argmax(axis=1)], math.inf),
        tuple(zip(run.time[wide].tolist(), np.diff(run.time)[wide].tolist(), strict=True)),
        events_of(run),
    )


def together(parts: Sequence[Seen]) -> Seen:
    """What the parts of a run show, in order; a gap between two of them is silence."""
    parts = [part for part in parts if part.estimates]
    if not parts:
        return Seen()
    between = [(one.end, then.begin - one.end) for one, then in pairwise(parts) if then.begin - one.end > MAX_GAP]
    names = ('estimates', 'sliding', 'faulty', 'extrapolated', 'disagreeing')
    return Seen(
        begin=parts[0].begin,
        end=parts[-1].end,
        **{name: sum(getattr(part, name) for part in parts) for name in names},
        counts=np.sum([part.counts for part in parts], axis=0),
        since=np.min([part.since for part in parts], axis=0),
        silences=tuple(sorted([*between, *(one for part in parts for one in part.silences)])),
        events=Events(*(tuple(one for part in parts for one in part.events[kind]) for kind in (0, 1))),
    )


# -- stream -----------------------------------------------------------------------------------------------------------


class Follower:
    """What a stream shows: estimates in, the motion that goes on is kept until it ends.

    Args:
        kept: So long a part counts after its end [s].
    """

    def __init__(self, kept: float = math.inf) -> None:
        self._kept = kept
        self._start = math.nan  # [s]
        self._rows: list[tuple[float, ...]] = []
        self._parts: deque[Seen] = deque()

    def add(self, row: tuple[float, ...]) -> None:
        """Take one estimate: values in the order of `Samples`, its time on any clock [s]."""
        if not self._parts and not self._rows:
            self._start = row[0]
        self._rows.append((row[0] - self._start, *row[1:]))
        if len(self._rows) % _CHUNK == 0:
            self._end_motions()

    def _end_motions(self) -> None:
        run = _samples(self._rows)
        motions = motions_of(run)
        if len(motions) > 1 and len(self._rows) < _MOST_ROWS:
            last = 2 if motions[-2][0] == 0 else 1  # a start needs the rest before it
            end = int(motions[-last][1][0])
        else:
            end = len(self._rows) if len(self._rows) >= _MOST_ROWS else 0
        if end:
            self._parts.append(seen_in(_samples(self._rows[:end])))
            del self._rows[:end]
        while self._parts and self._parts[0].end < run.time[-1] - self._kept:
            self._parts.popleft()

    def seen(self, until: float = math.inf) -> Seen:
        """What the stream shows up to a time [s] on the clock of the estimates."""
        end = until - self._start
        rows = [row for row in self._rows if row[0] <= end]
        return together([*(part for part in self._parts if part.end <= end), seen_in(_samples(rows))])


_CHUNK = 500  # estimates between two looks for motions that have ended
_MOST_ROWS = 50_000  # estimates of a motion that goes on


def _samples(rows: Sequence[tuple[float, ...]]) -> Samples:
    columns = np.array(rows, float).reshape(-1, len(Samples._fields)).T
    integers = columns[-3:].astype(np.int64)
    return Samples(*columns[:-3], *integers)


# -- findings ---------------------------------------------------------------------------------------------------------


def percent(share: float) -> str:
    """A share as text."""
    return f'{100.0 * share:.3g} %'


def between(value: float, good: float, bad: float) -> str:
    """Level of a number that should be small."""
    return GOOD if value <= good else BAD if value > bad or not math.isfinite(value) else LOOK


def in_band(share: float) -> str:
    """Level of a share of readings in the 95 % band."""
    return GOOD if share >= MOST_IN_BAND else BAD if share < FEWEST_IN_BAND else LOOK


NAME_SEALS = 'name the seal files of your machine (parameter seals); seal_friction seals lists those that there are'
PLACEHOLDER = Finding(BAD, 'the estimate used the placeholder seal: its friction is that of another seal', NAME_SEALS)
_FIT = 'fit the friction of this machine: seal_friction identify BAG --out my_seal.yaml --report my_seal.html'
_CHANGED = 'find out what changed: seals, oil, temperature, load; fit again if it stays'


def findings_of(
    seen: Seen, *, has_placeholder: bool = False, uses_scale: bool = False, limits: Limits = USUAL_LIMITS
) -> list[Finding]:
    """Findings, the worst first; the last one says how far the estimate agrees with the measurement.

    Args:
        seen: What the run shows.
        has_placeholder: Whether a seal is the placeholder.
        uses_scale: Whether the estimates hold the scale that was learnt (``adaptation.mode`` on).
        limits: Of alarms.
    """
    found = [PLACEHOLDER] if has_placeholder else []
    friction = friction_by_pressure(seen.events)
    found += _data(seen)
    found += _agreement(seen, friction.sliding)
    found += _change(friction.sliding, uses_scale, limits)
    found += _starts(friction.sliding, friction.breakaway, limits)
    return sorted(found, key=lambda one: -_ORDER.index(one.level))


_ORDER = (GOOD, LOOK, BAD)


def worst(levels: Iterable[str]) -> str:
    """Worst of some levels; GOOD of none."""
    return max(levels, key=_ORDER.index, default=GOOD)


def deciding(findings: Sequence[Finding]) -> Finding:
    """The first of the worst findings."""
    level = worst(one.level for one in findings)
    return next((one for one in findings if one.level == level), Finding(GOOD, 'nothing was found', 'nothing'))


def verdict_of(findings: Sequence[Finding]) -> Verdict:
    """Verdict by the finding that decides."""
    decides = deciding(findings)
    text = decides.text if decides.name else f'{decides.text[0].upper()}{decides.text[1:]}'
    return Verdict(decides.level, f'{text}.', f'{decides.next}.')


def _data(seen: Seen) -> Iterator[Finding]:
    """Estimates that are missing, and those on inputs that are not good or beyond what was identified."""
    if not seen.estimates:
        yield Finding(BAD, 'no estimates', 'record the topics of the estimator, or replay the bag with --out')
        return
    lost = sum(length for _, length in seen.silences)
    silent = lost / (seen.end - seen.begin) if lost else 0.0
    if (level := between(silent, MOST_FLAGGED, FAR_TOO_MANY_FLAGGED)) != GOOD:
        what = f'no estimate for {lost:.1f} s, {percent(silent)} of the time'
        after = 'find out what stopped: node, network or recorder'
        yield Finding(level, what, after, silent, since=seen.silences[0][0])
    for share, limit, bits, most, words in (
        (seen.faulty / seen.estimates, MOST_FLAGGED, _FAULTS, BAD, 'estimates have inputs that are not good'),
        (seen.extrapolated / seen.estimates, MOST_FLAGGED, _EXTRAPOLATED, LOOK, 'estimates are not identified'),
        (seen.disagreeing / max(seen.sliding, 1), DISAGREEING, _DISAGREES, LOOK, 'sliding estimates disagree'),
    ):
        level = min(between(share, limit, FAR_TOO_MANY_FLAGGED), most, key=_ORDER.index)
        if level != GOOD:
            held = (_BITS & bits) != 0
            often = Status(int(_BITS[np.argmax(np.where(held, seen.counts, -1))]))
            what = f'{percent(share)} of the {words}: {STATUS_WORDS[often]}'
            after = 'look at the status bits; docs/degradation.md says what each one means'
            yield Finding(level, what, after, share, since=float(seen.since[held].min()))


def _agreement(seen: Seen, sliding: Sequence[PressureLevel]) -> Iterator[Finding]:
    """Strokes against the band of the estimate."""
    strokes, steady = len(seen.events.strokes), 'record strokes at even speed in both directions'
    if not strokes:
        yield Finding(LOOK, 'no steady sliding, so the estimate cannot be compared with a measurement', steady)
        return
    against = sum(len(level.events) for level in sliding if level.measured <= 0.0)
    if against > strokes / 2:
        what = f'the force sum is against the motion in {against} of {strokes} strokes'
        yield Finding(BAD, what, 'check the signs of force sum and velocity', against / strokes)
    if strokes < FEWEST_STROKES:
        yield Finding(LOOK, f'only {strokes} measured strokes: a verdict takes {FEWEST_STROKES}', steady)
    inside = sum(level.in_band for level in sliding) / strokes
    what = f'{round(inside * strokes)} of {strokes} measured strokes lie in the 95 % band of the estimate'
    after = 'nothing: the estimate agrees with the measurement' if in_band(inside) == GOOD else _FIT
    yield Finding(in_band(inside), what, after, inside)


def _change(sliding: Sequence[PressureLevel], uses_scale: bool, limits: Limits) -> Iterator[Finding]:
    """Friction of the strokes over that of the seal file: its mean, and its change within the run."""
    rows = [
        (number, event.time, level.reading(event) / event.estimated * (event.scale if uses_scale else 1.0))
        for number, level in enumerate(sliding)
        if level.measured > 0.0
        for event in level.events
        if event.estimated > 0.0
    ]
    if len(rows) < FEWEST_STROKES:
        return
    numbers, time, ratio = np.array(sorted(rows, key=lambda row: row[1])).T
    scale, noise = float(ratio.mean()), BAND_95 * float(ratio.std(ddof=1)) / math.sqrt(len(ratio))
    if abs(scale - 1.0) > max(SMALL_CHANGE, noise):
        beyond = scale - noise > limits.scale_high or scale + noise < limits.scale_low
        what = f'the friction is {scale:.2f} times that of the seal file ({100.0 * (scale - 1.0):+.0f} %)'
        yield Finding(BAD if beyond else LOOK, what, _CHANGED, scale - 1.0, noise)
    yield from _drift(numbers, time, ratio)


def _drift(numbers: FloatArray, time: FloatArray, ratio: FloatArray) -> Iterator[Finding]:
    r"""Change of the friction within the run: one slope over time, with a mean of its own at each pressure level.

    .. math:: r_i = \bar r_{l(i)} + g\,(t_i - \bar t_{l(i)}), \qquad \text{drift} = g\,(t_n - t_1)
    """
    levels, places = np.unique(numbers, return_inverse=True)
    freedom = len(ratio) - len(levels) - 1
    if len(ratio) < FEWEST_OF_DRIFT or freedom < 1:
        return
    counts = np.bincount(places)
    own_time, own_ratio = (values - (np.bincount(places, values) / counts)[places] for values in (time, ratio))
    spread, span = float(own_time @ own_time), float(time[-1] - time[0])
    if spread <= 0.0:
        return
    slope = float(own_time @ own_ratio) / spread
    rest = own_ratio - slope * own_time
    noise = BAND_95 * span * math.sqrt(float(rest @ rest) / freedom / spread)
    drift = slope * span / float(ratio.mean())
    if abs(drift) > max(SMALL_CHANGE, noise):
        half = float(time[np.argmax(np.abs(np.cumsum(own_ratio)))])
        what = f'the friction drifts by {100.0 * drift:+.0f} % within {span:.0f} s, half of it before {half:.0f} s'
        yield Finding(LOOK, what, _CHANGED, drift, noise)


def _starts(sliding: Sequence[PressureLevel], breakaway: Sequence[PressureLevel], limits: Limits) -> Iterator[Finding]:
    """Breakaway against its estimate and against the sliding friction."""
    counted = [level for level in breakaway if level.deviation_percent is not None]
    starts = sum(len(level.events) for level in counted)
    if starts < FEWEST_STROKES:
        return
    share = sum(level.in_band for level in counted) / starts
    if share < MOST_IN_BAND:
        what = f'{round(share * starts)} of {starts} measured starts lie in the 95 % band of the breakaway force'
        yield Finding(LOOK, what, 'fit the breakaway force: identify with starts from rest', share)
    coulomb = np.mean([level.measured for level in sliding]) if sliding else math.nan
    size = float(np.mean([level.measured for level in counted]) / coulomb)
    if size > limits.breakaway:
        yield Finding(BAD, f'a start takes {size:.2f} times the Coulomb friction', _CHANGED, size - 1.0)
