"""Tracking of a servo, from a bag with reference and position of the rod.

A change of the configuration starts a new stretch, so a feed-forward that is switched on live is compared with the same
servo without it. The definitions of settled, of periodic and of the same reference are our choice, see the constants.
"""

import math
from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from seal_friction_ros.core.estimation.configuration import Snapshot, parse_snapshot
from seal_friction_ros.core.estimation.estimator import EstimatorSettings
from seal_friction_ros.core.estimation.feedforward import FeedForwardSettings
from seal_friction_ros.core.estimation.strokes import MAX_GAP
from seal_friction_ros.core.foundation.arrays import FloatArray, IntArray
from seal_friction_ros.core.foundation.normal_distribution import BAND_95
from seal_friction_ros.core.friction.states import FrictionState
from seal_friction_ros.core.servo.tracking import dwell_per_reversal, reversals, tracking_peak, tracking_rms
from seal_friction_ros.offline.bags.recorded_run import RecordedRun

SETTLING_TIME = 0.5  # [s] left out after a change, in addition to fade_time: the simulated servo settles in 0.1 s
MIN_SAMPLES = 50  # a shorter stretch is not evaluated
MIN_PERIODS = 2  # of a periodic reference
HYSTERESIS = 0.1  # of the amplitude: a reference must pass the middle by this much to cross it
SAME = 0.05  # periods, amplitudes and shapes that differ by a smaller share are the same
PARTS = 10  # of a stretch whose reference has no period, between which the error scatters

_REPLAYED = (
    'The estimates and the feed-forward in this bag are replayed: the replayed feed-forward did not act. The tracking '
    'is that of the recording, with the feed-forward that acted then.'
)


class Periodicity(NamedTuple):
    """Period of a reference."""

    period: float  # [s]
    crossings: FloatArray  # [s] since the first sample: upward crossings of a level slightly above the middle


@dataclass(frozen=True, kw_only=True)
class TrackingStretch:
    """Tracking over a stretch of unchanged configuration, without the settling time."""

    first: int  # index of the first evaluated estimate
    last: int  # index of the last evaluated estimate
    start: float  # [s] time of the first, since the first estimate of the bag
    end: float  # [s] time of the last
    settling: float  # [s] left out before
    settings: FeedForwardSettings | None  # that acted; None if they are not in the bag
    standstill: float  # [m/s] speed at and below which the rod rests: ``stick_velocity`` of the estimator
    samples: int  # evaluated estimates: those with reference and position
    amplitude: float  # [m] of the reference, half peak to peak
    period: float | None  # [s] of the reference; None if it is not periodic
    rms: float  # [m] root mean square of the tracking error
    rms_error: float  # [-] its relative standard error, by its scatter from period to period, or between `PARTS`
    peak: float  # [m] largest tracking error
    reversals: int  # changes of direction of the rod
    dwell: float | None  # [s] mean rest per reversal of the rod; None if it does not reverse
    reference_dwell: float | None  # [s] the same of the reference, which also passes through standstill
    not_sliding: float | None  # [-] share of the estimates of known state that do not slide
    feedforward_peak: float | None  # [N] largest feed-forward that acted; 0.0 without; None if it is not known
    rms_change: float | None = None  # [%] against the first stretch without feed-forward; None if the reference differs
    rms_noise: float | None = None  # [%] change that 95 % of repetitions stay below
    dwell_change: float | None = None  # [%] as rms_change, of the dwell

    @property
    def has_feedforward(self) -> bool | None:
        """Whether the feed-forward that acted was ever above 0 N; None if it is not known."""
        return None if self.feedforward_peak is None else self.feedforward_peak > 0.0


@dataclass(frozen=True)
class TrackingEvaluation:
    """Tracking in every stretch of a bag."""

    stretches: tuple[TrackingStretch, ...]
    notes: tuple[str, ...]  # notes for the reader

    @property
    def without(self) -> TrackingStretch | None:
        """First stretch without feed-forward: the base of the comparison."""
        return next((stretch for stretch in self.stretches if stretch.has_feedforward is False), None)

    @property
    def unknown(self) -> TrackingStretch | None:
        """First stretch of which it is not known whether a feed-forward acted: a replay of a bag without one."""
        return next((stretch for stretch in self.stretches if stretch.has_feedforward is None), None)

    @property
    def compensated(self) -> TrackingStretch | None:
        """Last stretch with feed-forward, preferably with the reference of the one without."""
        active = [stretch for stretch in self.stretches if stretch.has_feedforward]
        comparable = [stretch for stretch in active if stretch.rms_change is not None]
        return next(reversed(comparable or active), None)


class _Axis(NamedTuple):
    """What the tracking is evaluated from, as of `RecordedRun`."""

    time: FloatArray
    velocity: FloatArray
    position: FloatArray
    reference: FloatArray
    state: IntArray
    feedforward_force: FloatArray
    is_replay: bool  # then the forces are those of the recording


def evaluate_tracking(run: RecordedRun) -> TrackingEvaluation | None:
    """Tracking in each stretch between two changes of configuration; None without reference or position.

    The longest part of a stretch without a gap in either above `MAX_GAP` is evaluated. Its first ``fade_time`` +
    `SETTLING_TIME` are left out; of a periodic reference, whole periods are evaluated.
    """
    columns = {name: getattr(run, name) for name in _Axis._fields if name != 'is_replay'}
    return _tracking_of(_Axis(**columns, is_replay=run.replayed_force is not None), configuration_stretches(run))


class TrackingFollower:
    """Tracking of a stream, by a sample each `PERIOD`.

    Args:
        kept: So long a sample counts [s].
        has_recorded: Whether the forces of a replay are those of the recording; else it is not known what acted.
    """

    PERIOD = 0.01  # [s] 20 samples of a period at 5 Hz (our choice)

    def __init__(self, kept: float, *, has_recorded: bool = False) -> None:
        self._kept, self._has_recorded = kept, has_recorded
        self._rows: deque[tuple[float, ...]] = deque()
        self._changes: list[tuple[float, Snapshot]] = []

    def configure(self, snapshot: Snapshot) -> None:
        """Take a configuration."""
        begin = self._rows[-1][0] if self._rows else -math.inf
        if not self._changes or snapshot[:1] + snapshot[3:] != self._changes[-1][1][:1] + self._changes[-1][1][3:]:
            self._changes.append((begin, snapshot))

    def add(self, row: tuple[float, ...]) -> None:
        """Take one estimate: time [s], velocity, position, reference, state and feed-forward force."""
        if self._rows and 0.0 <= row[0] - self._rows[-1][0] < 0.99 * self.PERIOD:
            return
        if self._rows and row[0] < self._rows[-1][0]:  # the clock was set back
            self._rows.clear()
        self._rows.append(row)
        while self._rows[0][0] < row[0] - self._kept:
            self._rows.popleft()

    @property
    def acting(self) -> FeedForwardSettings | None:
        """Newest settings of the feed-forward; None if they are not known."""
        return _acting(self._changes[-1][1]) if self._changes else None

    def evaluation(self) -> TrackingEvaluation | None:
        """As of `evaluate_tracking`."""
        if not self._rows:
            return None
        time, velocity, position, reference, state, force = np.array(self._rows).T
        rows = [int(np.searchsorted(time, begin, side='right')) for begin, _ in self._changes]
        changes = zip([0, *rows], [None, *(snapshot for _, snapshot in self._changes)], strict=True)
        is_replay = any(snapshot.recorded is not None for _, snapshot in self._changes)
        if is_replay and not self._has_recorded:
            force = np.full(len(time), math.nan)
        axis = _Axis(time, velocity, position, reference, state.astype(np.int64), force, is_replay)
        return _tracking_of(axis, _stretches(list(changes), len(time)))


def _tracking_of(run: _Axis, stretches: Iterable[tuple[int, int, Snapshot | None]]) -> TrackingEvaluation | None:
    if not np.isfinite(run.reference - run.position).any():
        return None
    evaluated = [_evaluate(run, *stretch) for stretch in stretches]
    found = tuple(stretch for stretch in evaluated if stretch is not None)
    base = TrackingEvaluation(found, ()).without
    compared = tuple(_compared(stretch, base) for stretch in found)
    notes = [_REPLAYED] if run.is_replay else []
    return TrackingEvaluation(compared, (*notes, *_notes(compared, base, len(evaluated) - len(found))))


def configuration_stretches(run: RecordedRun) -> Iterator[tuple[int, int, Snapshot | None]]:
    """First index, index behind the last, and first snapshot of each stretch of unchanged configuration.

    The snapshot is None before the first one in the bag, and where it cannot be parsed. In a replay the settings that
    acted count too.
    """
    changes: list[tuple[int, Snapshot | None]] = [(0, None)]
    for row, (_, text) in zip(run.configuration_rows, run.configurations, strict=True):
        try:
            snapshot = parse_snapshot(text)
        except (ValueError, LookupError, TypeError):
            snapshot = None  # the report shows the text
        last = changes[-1][1]
        if snapshot is None or last is None or snapshot[:1] + snapshot[3:] != last[:1] + last[3:]:
            changes.append((row, snapshot))
    return _stretches(changes, len(run.time))


def _stretches(
    changes: Sequence[tuple[int, Snapshot | None]], count: int
) -> Iterator[tuple[int, int, Snapshot | None]]:
    for (first, snapshot), (end, _) in pairwise([*changes, (count, None)]):
        if end > first:
            yield first, end, snapshot


def _evaluate(run: _Axis, first: int, end: int, snapshot: Snapshot | None) -> TrackingStretch | None:
    """Numbers of one stretch; None if it is too short."""
    settings = _acting(snapshot) if snapshot else None
    estimator_settings = snapshot.configuration.settings if snapshot else EstimatorSettings()
    settling = (settings or FeedForwardSettings()).fade_time + SETTLING_TIME
    part = _longest_part(run, first, end)
    part = part[run.time[part] >= run.time[part[0]] + settling] if len(part) else part
    if len(part) < MIN_SAMPLES or run.time[part[-1]] <= run.time[part[0]]:
        return None
    repeats, whole = periodicity(run.time[part], run.reference[part]), PARTS
    if repeats is not None:
        step = float(np.median(np.diff(run.time[part])))
        whole = math.floor(float(run.time[part[-1]] - run.time[part[0]] + step) / repeats.period + 1e-6)
        part = part[run.time[part] < run.time[part[0]] + (whole * repeats.period - step / 2.0)]
    time, reference, position = run.time[part], run.reference[part], run.position[part]
    standstill = estimator_settings.stick_velocity
    turns, dwell = _dwell(time, run.velocity[part], standstill)
    _, reference_dwell = _dwell(time[1:], np.diff(reference) / np.diff(time), standstill)
    known = run.state[part][run.state[part] != FrictionState.UNKNOWN]
    force = run.feedforward_force[part]
    force = force[np.isfinite(force)]
    is_known = not run.is_replay or len(force) > 0 or (settings is not None and settings.scale == 0.0)
    return TrackingStretch(
        first=int(part[0]),
        last=int(part[-1]),
        start=float(time[0]),
        end=float(time[-1]),
        settling=settling,
        settings=settings,
        standstill=standstill,
        samples=len(part),
        amplitude=float(np.ptp(reference)) / 2.0,
        period=repeats.period if repeats else None,
        rms=tracking_rms(reference, position),
        rms_error=_rms_error(reference - position, whole),
        peak=tracking_peak(reference, position),
        reversals=turns,
        dwell=dwell,
        reference_dwell=reference_dwell,
        not_sliding=1.0 - float(np.mean(known == FrictionState.SLIDING)) if len(known) else None,
        feedforward_peak=float(np.abs(force).max(initial=0.0)) if is_known else None,
    )


def _acting(snapshot: Snapshot) -> FeedForwardSettings | None:
    """Settings of the feed-forward that acted; None if they are not known."""
    return (snapshot.recorded or snapshot.configuration).feedforward


def _rms_error(error: FloatArray, parts: int) -> float:
    r"""Relative standard error of a root mean square [-], by the scatter of the mean squares :math:`q_i` of its parts.

    .. math:: \frac{s_{rms}}{rms} = \frac{1}{2} \frac{s_q}{\bar q \sqrt{n}}
    """
    squares = np.array([float(np.mean(part**2)) for part in np.array_split(error, parts)])
    mean = float(squares.mean())
    return 0.5 * float(squares.std(ddof=1)) / math.sqrt(parts) / mean if mean else 0.0


def _longest_part(run: _Axis, first: int, end: int) -> IntArray:
    """Indices of the longest part, in time, without a gap in reference and position above `MAX_GAP`."""
    known = first + np.flatnonzero(np.isfinite(run.reference[first:end] - run.position[first:end]))
    if not len(known):
        return known
    steps = np.diff(run.time[known])
    parts = np.split(known, np.flatnonzero((steps > MAX_GAP) | (steps <= 0.0)) + 1)
    return max(parts, key=lambda part: float(run.time[part[-1]] - run.time[part[0]]))


def _even(time: FloatArray, values: FloatArray) -> tuple[float, FloatArray]:
    """Sample time [s], and the values at evenly spaced times; missing values are interpolated."""
    known = np.isfinite(values)
    time, values = time[known], values[known]
    if len(time) < 2:
        return 0.0, values
    step = float(np.median(np.diff(time)))
    count = round((time[-1] - time[0]) / step) + 1
    return step, np.interp(time[0] + step * np.arange(count), time, values)


def _dwell(time: FloatArray, velocity: FloatArray, standstill: float) -> tuple[int, float | None]:
    """Number of changes of direction, and the mean rest [s] at each; None without a change."""
    step, even = _even(time, velocity)
    turns = reversals(even, standstill)
    return turns, dwell_per_reversal(even, step, standstill) if turns else None


def periodicity(time: FloatArray, reference: FloatArray) -> Periodicity | None:
    """Period of a reference [m] over increasing times [s]; None if it does not repeat `MIN_PERIODS` times.

    A period is the time between two upward crossings of the middle. The periods must agree within `SAME`, and 95 % of
    the samples must repeat one period later within `SAME` of the amplitude.
    """
    step, even = _even(time, reference)
    middle, amplitude = (even.max() + even.min()) / 2.0, float(np.ptp(even)) / 2.0
    level = middle + HYSTERESIS * amplitude
    above = even > level
    outside = np.flatnonzero(above | (even < middle - HYSTERESIS * amplitude))
    up = outside[1:][above[outside[1:]] & ~above[outside[:-1]]]
    if len(up) <= MIN_PERIODS:
        return None
    crossings = step * (up - (even[up] - level) / (even[up] - even[up - 1]))
    intervals = np.diff(crossings)
    period = float(intervals.mean())
    if np.ptp(intervals) > SAME * period + 2.0 * step:
        return None
    samples = step * np.arange(len(even))
    early = samples <= samples[-1] - period
    later = np.interp(samples[early] + period, samples, even)
    if np.quantile(np.abs(later - even[early]), 0.95) > SAME * amplitude:
        return None
    return Periodicity(period, crossings)


# -- comparison -------------------------------------------------------------------------------------------------------


def _same_reference(one: TrackingStretch, other: TrackingStretch) -> bool:
    pairs = ((one.amplitude, other.amplitude), (one.period, other.period))
    return all(a is b if a is None or b is None else math.isclose(a, b, rel_tol=SAME) for a, b in pairs)


def _compared(stretch: TrackingStretch, base: TrackingStretch | None) -> TrackingStretch:
    if base is None or stretch is base or not _same_reference(stretch, base):
        return stretch
    return replace(
        stretch,
        rms_change=_change(stretch.rms, base.rms),
        rms_noise=100.0 * BAND_95 * math.hypot(stretch.rms_error, base.rms_error),
        dwell_change=_change(stretch.dwell, base.dwell),
    )


def _change(value: float | None, base: float | None) -> float | None:
    """Change in percent; None without a base."""
    return None if value is None or not base else 100.0 * (value / base - 1.0)


def _notes(stretches: Sequence[TrackingStretch], base: TrackingStretch | None, short: int) -> Iterator[str]:
    if short:
        yield (
            f'{short} stretches of unchanged configuration are too short to evaluate the tracking: fewer than '
            f'{MIN_SAMPLES} samples with reference and position remain after settling.'
        )
    if base is None and any(stretch.has_feedforward for stretch in stretches):
        yield 'There is no stretch without feed-forward to compare with.'
    for stretch in stretches:
        if base is not None and not _same_reference(stretch, base):
            yield (
                f'The reference from {stretch.start:.1f} s on differs from the reference without feed-forward, from '
                f'{base.start:.1f} s on: the two stretches are not compared.'
            )


def tracking_numbers(evaluation: TrackingEvaluation | None) -> list[dict[str, Any]]:
    """The numbers for JSON, one object per stretch: plain types, every number finite or null."""
    return [asdict(stretch) for stretch in evaluation.stretches] if evaluation is not None else []
