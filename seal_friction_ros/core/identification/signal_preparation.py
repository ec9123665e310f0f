"""Measured signals -> what a friction law can be fitted to.

A log holds velocity (or position), chamber pressures and the force sum. Where the rod slides evenly nothing
accelerates, so the force sum is the friction, up to an offset of the load cell or of the areas that the pressure acts
on. Friction turns its sign with the direction and an offset does not: half the difference of the two directions is the
friction, half their sum is the offset.
"""

from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.signal import savgol_filter

from seal_friction_ros.core.foundation.arrays import BoolArray, FloatArray, IntArray
from seal_friction_ros.core.foundation.parameters import check, parameter

LONGEST_GAP = 0.5  # [s] no stroke reaches across a longer pause in the log (our choice)
FEWEST_SAMPLES = 10  # of a stroke, to take its median from (our choice)
SPEED_TOLERANCE = 0.25  # of the median speed of a stroke: within it the speed is held (our choice)
PRESSURE_TOLERANCE = 0.1  # of the highest pressure of a stroke: a seal that sees a smaller change sees a held pressure
PRESSURE_NOISE = 2e4  # [Pa] a smaller change is noise at any pressure (our choice)
HELD_SHARE = 0.5  # of a stroke at its median speed and at one pressure make it a reading (our choice)
LEVEL_GAP = 0.05  # of the pressure: a larger step between sorted pressures separates two levels (our choice)
LEVEL_GAP_MIN = 1e4  # [Pa] nor does a pressure regulator's difference between the directions near zero pressure
LEVEL_WIDTH = 0.1  # of the highest pressure: a wider level is a ramp, and is cut into equal parts


@dataclass(frozen=True, kw_only=True)
class SavitzkyGolay:
    """How a slope is made from samples: that of a polynomial fitted to the samples around each one.

    Raises:
        ValueError: A value is out of bounds.
    """

    window: float = parameter(unit='s', lower=1e-6, upper=3600.0, description='Width of the fit, centred.')
    order: int = parameter(2, unit='', lower=1, upper=6, description='Order of the polynomial.')
    largest_gap: float = parameter(
        unit='s', lower=1e-6, upper=3600.0, description='No fit reaches across a longer pause.'
    )

    def __post_init__(self) -> None:
        check(self)


@dataclass(frozen=True, kw_only=True)
class Sliding:
    """Which samples of a log count as even sliding.

    Raises:
        ValueError: A value is out of bounds.
    """

    slowest: float = parameter(
        3e-3, unit='m/s', lower=0.0, upper=10.0, description='A rod that is slower counts as at rest.'
    )
    largest_acceleration: float = parameter(
        0.05, unit='m/s2', lower=1e-6, upper=1e4, description='Beyond it inertia counts, and the sample does not.'
    )

    def __post_init__(self) -> None:
        check(self)


class Signals(NamedTuple):
    """A log, row by row; arrays of shape (n,), NaN where there is no measurement."""

    time: FloatArray
    """[s] increasing"""
    velocity: FloatArray
    """[m/s] positive on extension"""
    pressure_a: FloatArray
    """[Pa, gauge]"""
    pressure_b: FloatArray
    """[Pa, gauge]"""
    force_sum: FloatArray
    """[N] positive on extension"""

    def taken(self, index: IntArray | BoolArray) -> 'Signals':
        """The rows that ``index`` names."""
        return Signals(*(column[index] for column in self))


class Stroke(NamedTuple):
    """One motion in one direction, at a held speed and pressure."""

    direction: int
    """-1 or 1"""
    samples: IntArray
    """indices of its even samples"""
    time: float
    """[s] of its middle"""
    velocity: float
    """[m/s] median"""
    pressure_a: float
    """[Pa, gauge] median"""
    pressure_b: float
    """[Pa, gauge] median"""
    force_sum: float
    """[N] median"""


class Breakaway(NamedTuple):
    """One start from rest."""

    direction: int
    """-1 or 1"""
    time: float
    """[s]"""
    pressure_a: float
    """[Pa, gauge]"""
    pressure_b: float
    """[Pa, gauge]"""
    force_sum: float
    """[N] the largest one in the direction of the motion, from rest until the rod slides"""


class HalfRange(NamedTuple):
    """Friction and offset from a force measured in both directions."""

    friction: float
    """[N]"""
    offset: float
    """[N]"""


class OffsetLine(NamedTuple):
    """Offset of the force sum over pressure: constant + area_error * pressure."""

    constant: float
    """[N] of the load cell"""
    area_error: float
    """[m^2] that the area of the pressure term is off by"""
    rms: float
    """[N] what the line leaves"""


# -- velocity and acceleration ----------------------------------------------------------------------------------------


def slope(time: FloatArray, values: FloatArray, law: SavitzkyGolay) -> FloatArray:
    """Slope over time by a Savitzky-Golay filter, at the times of the samples: velocity of a position, and so on.

    At each sample, the slope of the polynomial of least squares through the samples within the window around it; over
    the first and last half window of a segment, the slope of the polynomial of that segment's first and last window.
    The window is centred, so the slope has no delay: good for a log, not to be had live.

    A log's stamps jitter and the filter wants a uniform grid, so each segment (samples without a pause longer than
    ``largest_gap``) is interpolated to as many equidistant times as it has samples, filtered and interpolated back.

    Args:
        time: Time of the samples [s], increasing, shape (n,).
        values: What is to be differentiated, shape (n,); samples that are not finite are left out.
        law: Window, order and largest gap.

    Returns:
        Slope in units of ``values`` per second, shape (n,); NaN where the value is not finite or the segment is shorter
        than the window.

    Raises:
        ValueError: No segment is as long as the window, or the window holds too few samples for the order.

    Source: [SavitzkyGolay1964]_; grid, gaps and edges are our choice.
    """
    result = np.full(len(time), np.nan)
    usable = np.flatnonzero(np.isfinite(values))
    for segment in _unbroken(time, usable, law.largest_gap):
        if len(segment) > law.order + 1:
            result[segment] = _segment_slope(time[segment], values[segment], law)
    if np.isnan(result).all():
        raise ValueError(
            f'no stretch of rows without a pause above {law.largest_gap} s is long enough for '
            f'a Savitzky-Golay window of {law.window} s'
        )
    return result


def _unbroken(time: FloatArray, index: IntArray, longest_gap: float) -> list[IntArray]:
    """Indices, cut wherever the time between two of them exceeds ``longest_gap`` [s]."""
    return np.split(index, np.flatnonzero(np.diff(time[index]) > longest_gap) + 1)


def _segment_slope(time: FloatArray, values: FloatArray, law: SavitzkyGolay) -> FloatArray:
    rows = len(time)
    interval = (time[-1] - time[0]) / (rows - 1)
    points = 2 * round(law.window / interval / 2.0) + 1
    if points <= law.order:
        raise ValueError(
            f'SavitzkyGolay.window = {law.window} s holds {points} samples, {interval:.3g} s apart: '
            f'order {law.order} needs {law.order + 1}'
        )
    if points > rows:
        return np.full(rows, np.nan)
    grid = np.linspace(time[0], time[-1], rows)
    slopes = savgol_filter(np.interp(grid, time, values), points, law.order, deriv=1, delta=interval, mode='interp')
    result: FloatArray = np.interp(time, grid, slopes)
    return result


def acceleration(time: FloatArray, velocity: FloatArray) -> FloatArray:
    """Acceleration [m/s^2] by central differences of the velocity, shape (n,).

    It only has to tell even sliding from starting and stopping, so it is not smoothed beyond what the velocity is.

    Args:
        time: Time of the samples [s], increasing, shape (n,), n >= 2.
        velocity: [m/s], shape (n,); NaN makes NaN around it.
    """
    result: FloatArray = np.gradient(velocity, time)
    return result


# -- even sliding, strokes, starts ------------------------------------------------------------------------------------


def even_sliding(signals: Signals, sliding: Sliding) -> BoolArray:
    """Which samples belong to even sliding: fast enough, hardly accelerated, every signal finite; shape (n,)."""
    finite = np.logical_and.reduce([np.isfinite(column) for column in signals])
    with np.errstate(invalid='ignore'):
        moving = np.abs(signals.velocity) > sliding.slowest
        even = np.abs(acceleration(signals.time, signals.velocity)) < sliding.largest_acceleration
    return np.asarray(finite & moving & even)


def motions(signals: Signals, sliding: Sliding) -> list[tuple[int, IntArray]]:
    """Direction (0 at rest) and indices of each run of samples in one direction or at rest, in order of time.

    A run ends where the direction changes, the rod stops, or the log has a pause longer than `LONGEST_GAP`.
    Samples without a velocity are left out.
    """
    index = np.flatnonzero(np.isfinite(signals.velocity))
    runs: list[tuple[int, IntArray]] = []
    for part in _unbroken(signals.time, index, LONGEST_GAP):
        if not len(part):
            continue
        velocity = signals.velocity[part]
        direction = np.where(np.abs(velocity) > sliding.slowest, np.sign(velocity), 0.0)
        parts = np.split(np.arange(len(part)), np.flatnonzero(np.diff(direction)) + 1)
        runs += [(int(direction[run[0]]), part[run]) for run in parts]
    return runs


def strokes(signals: Signals, sliding: Sliding) -> list[Stroke]:
    """Every motion at a held speed and pressure, each with the median of its even samples.

    Medians, since a stroke begins and ends with a transition whose length is not known: half of the samples may be part
    of one and the median still is not. A stroke counts with at least `FEWEST_SAMPLES` even samples, of which
    `HELD_SHARE` are within `SPEED_TOLERANCE` of the median speed, at pressures within `PRESSURE_TOLERANCE`.
    """
    even = even_sliding(signals, sliding)
    found = []
    for direction, run in motions(signals, sliding):
        samples = run[even[run]]
        if direction == 0 or len(samples) < FEWEST_SAMPLES or not _held(signals, samples):
            continue
        medians = [float(np.median(column[samples])) for column in signals[1:]]
        found.append(Stroke(direction, samples, float(signals.time[samples].mean()), *medians))
    return found


def _held(signals: Signals, samples: IntArray) -> bool:
    speed = np.abs(signals.velocity[samples])
    median = float(np.median(speed))
    if np.mean(np.abs(speed - median) <= SPEED_TOLERANCE * median) < HELD_SHARE:
        return False
    for column in (signals.pressure_a[samples], signals.pressure_b[samples]):
        low, high = np.quantile(column, (0.05, 0.95))
        if high - low > max(PRESSURE_TOLERANCE * abs(high), PRESSURE_NOISE):
            return False
    return True


def breakaways(signals: Signals, sliding: Sliding, shortest_rest: float = 0.1) -> list[Breakaway]:
    """The breakaway peak of each start from rest.

    The largest force sum in the direction of the motion, from the rest before it until its first even sample (which the
    velocity filter of a log shows late). A reversal without a rest is no start: what was stuck never was.

    Args:
        signals: The log.
        sliding: What counts as rest, and as even sliding.
        shortest_rest: A shorter stop is no rest to break away from [s]; our choice.
    """
    even = even_sliding(signals, sliding)
    runs = motions(signals, sliding)
    found = []
    for (direction_before, rest), (direction, run) in pairwise(runs):
        rested = signals.time[rest[-1]] - signals.time[rest[0]]
        starts = signals.time[run[0]] - signals.time[rest[-1]] <= LONGEST_GAP
        if direction_before != 0 or direction == 0 or not starts or rested < shortest_rest or not even[run].any():
            continue
        until = run[: int(np.argmax(even[run]))]
        candidates = np.concatenate((rest, until))
        candidates = candidates[np.isfinite(signals.force_sum[candidates])]
        if not len(candidates):
            continue
        peak = int(candidates[np.argmax(direction * signals.force_sum[candidates])])
        pressures = float(signals.pressure_a[peak]), float(signals.pressure_b[peak])
        if np.isfinite(pressures).all():
            found.append(Breakaway(direction, float(signals.time[peak]), *pressures, float(signals.force_sum[peak])))
    return found


# -- friction and offset ----------------------------------------------------------------------------------------------


def half_range(force: FloatArray, direction: IntArray, *, of_medians: bool = True) -> HalfRange:
    """Friction and offset of a force that was measured in both directions.

    friction = (F_extend - F_retract) / 2, offset = (F_extend + F_retract) / 2, with the median (or mean) of each
    direction.

    Args:
        force: Force sums [N], shape (n,).
        direction: -1 or 1, shape (n,).
        of_medians: Medians, for samples with transitions among them; else means, for single readings.

    Raises:
        ValueError: One direction is missing.
    """
    of = np.median if of_medians else np.mean
    both = [force[direction == side] for side in (1, -1)]
    if not all(len(side) for side in both):
        raise ValueError('the rod moved in one direction only: friction and offset of the force cannot be told apart')
    extend, retract = (float(of(side)) for side in both)
    return HalfRange((extend - retract) / 2.0, (extend + retract) / 2.0)


def offset_line(pressures: FloatArray, offsets: FloatArray) -> OffsetLine:
    """Line of least squares through offsets of the force sum over pressure.

    An offset that does not depend on pressure is the load cell's; one that is proportional to it comes from an area
    that is not what was put in.

    Args:
        pressures: [Pa, gauge], shape (n,), n >= 2, not all the same.
        offsets: [N], shape (n,).
    """
    area_error, constant = np.polyfit(pressures, offsets, 1)
    left = offsets - (constant + area_error * pressures)
    return OffsetLine(float(constant), float(area_error), float(np.sqrt(np.mean(left**2))))


def pressure_levels(pressures: FloatArray) -> IntArray:
    """Number of the pressure level that each pressure [Pa] belongs to, counted from the lowest; shape (n,).

    A new level begins at every step between sorted pressures above `LEVEL_GAP` of the pressure (`LEVEL_GAP_MIN` at
    least). A level wider than `LEVEL_WIDTH` of the highest pressure is a ramp, and is cut into equal parts.
    """
    order = np.argsort(pressures, kind='stable')
    ordered = pressures[order]
    gap = np.maximum(LEVEL_GAP * np.abs(ordered[1:]), LEVEL_GAP_MIN)
    width = max(LEVEL_WIDTH * float(np.abs(ordered).max()), 2.0 * LEVEL_GAP_MIN)
    labels = np.zeros(len(ordered), dtype=np.int64)
    used = 0
    for cluster in np.split(np.arange(len(ordered)), np.flatnonzero(np.diff(ordered) > gap) + 1):
        inside = ordered[cluster]
        span = float(inside[-1] - inside[0])
        parts = max(int(np.ceil(span / width)), 1)
        part = np.minimum((inside - inside[0]) / (span or 1.0) * parts, parts - 1).astype(np.int64)
        part = np.unique(part, return_inverse=True)[1]
        labels[cluster] = used + part
        used += int(part[-1]) + 1
    result = np.empty_like(labels)
    result[order] = labels
    return result


# -- what is wrong with a signal --------------------------------------------------------------------------------------


def longest_stretch(wrong: BoolArray) -> tuple[int, int]:
    """First index and length of the longest run of true; length 0 if there is none."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], wrong, [False])).astype(np.int8)))
    if not len(edges):
        return 0, 0
    first, last = edges[::2], edges[1::2]
    longest = int(np.argmax(last - first))
    return int(first[longest]), int(last[longest] - first[longest])


def clipped_share(values: FloatArray) -> float:
    """Share of the samples at which a sensor stands at the end of its range; 0.0 if it does not.

    A sensor that moves with nearly every sample, and stands still for five samples and more at nothing but its highest
    or lowest value, has come to its end there. Signals that stand still elsewhere too (coarse or held ones) are not
    judged, nor is less than 1 % of the samples (our choice).
    """
    finite = values[np.isfinite(values)]
    if len(finite) < 100 or np.ptp(finite) == 0.0:
        return 0.0
    still = np.concatenate(([False], np.diff(finite) == 0.0))
    share = 0.0
    for extreme in (finite.max(), finite.min()):
        at_end = finite == extreme
        if longest_stretch(at_end)[1] >= 5 and np.mean(still[~at_end]) < 0.5:
            share += float(np.mean(at_end))
    return share if share >= 0.01 else 0.0
