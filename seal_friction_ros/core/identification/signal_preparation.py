"""Preparation of measured signals: velocity, even sliding, strokes, breakaway peaks, friction and offset.

A log holds velocity (or position), chamber pressures and the force sum. During even sliding the acceleration is zero,
so the force sum is the friction plus an offset of the load cell or of the pressure areas. Friction changes sign with
the direction, the offset does not: half the difference of the directions is the friction, half their sum the offset.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from seal_friction_ros.core.foundation.arrays import BoolArray, FloatArray, IntArray
from seal_friction_ros.core.foundation.parameters import CheckedParameters, parameter

LONGEST_GAP = 0.5  # [s] a longer pause in the log ends a stroke (our choice)
SHORTEST_REST = 0.1  # [s] a shorter stop is no rest before a breakaway (our choice)
FEWEST_SAMPLES = 10  # of a stroke, for its median (our choice)
SPEED_TOLERANCE = 0.25  # of the median speed of a stroke: within it the speed is held (our choice)
PRESSURE_TOLERANCE = 0.1  # of the highest pressure of a stroke in either chamber: within it both are held
HELD_SHARE = 0.5  # of the samples of a stroke that must be at held speed (our choice)
LEVEL_GAP = 0.05  # of the pressure: a larger step between sorted pressures separates two levels (our choice)
LEVEL_GAP_MIN = 1e4  # [Pa] smallest such step: near zero a regulator differs between the directions
SAME_LEVEL = 0.2  # of the pressure: two directions of one log that differ less are one level (our choice)
HELD_COUNTS = 5.0  # steps of the sensor: a signal that ranges no further is held, by whatever dithers (our choice)
LEVEL_WIDTH = 0.1  # of the highest pressure: a wider level is a ramp and is divided into equal parts


@dataclass(frozen=True, kw_only=True)
class SavitzkyGolay(CheckedParameters):
    """Savitzky-Golay differentiation: slope of a polynomial fitted to the samples around each sample."""

    window: float = parameter(unit='s', lower=1e-6, upper=3600.0, description='Width of the fit, centred.')
    order: int = parameter(2, unit='', lower=1, upper=6, description='Order of the polynomial.')
    largest_gap: float = parameter(
        unit='s', lower=1e-6, upper=3600.0, description='No fit reaches across a longer pause.'
    )


@dataclass(frozen=True, kw_only=True)
class Sliding(CheckedParameters):
    """Definition of even sliding."""

    slowest: float = parameter(
        3e-3, unit='m/s', lower=0.0, upper=10.0, description='A rod that is slower counts as at rest.'
    )
    largest_acceleration: float = parameter(
        0.05, unit='m/s2', lower=1e-6, upper=1e4, description='Beyond it inertia counts, and the sample does not.'
    )


class Signals(NamedTuple):
    """Signals of a log; arrays of shape (n,), NaN for a missing value."""

    time: FloatArray  # [s] increasing
    velocity: FloatArray  # [m/s] positive on extension
    pressure_a: FloatArray  # [Pa, gauge]
    pressure_b: FloatArray  # [Pa, gauge]
    force_sum: FloatArray  # [N] positive on extension

    def taken(self, index: IntArray | BoolArray) -> 'Signals':
        """The rows in ``index``."""
        return Signals(*(column[index] for column in self))


class SignalReading(NamedTuple):
    """One reading from a log: a stroke at held speed and pressure (medians), or the peak of a breakaway."""

    direction: int  # -1 or 1
    samples: IntArray  # indices of the samples behind the reading
    velocity: float  # [m/s]; 0 for a breakaway
    pressure_a: float  # [Pa, gauge]
    pressure_b: float  # [Pa, gauge]
    force_sum: float  # [N]
    dwell: float = 0.0  # [s] time at rest before a breakaway; 0 for a stroke


class HalfRange(NamedTuple):
    """Friction and offset of a force measured in both directions."""

    friction: float  # [N]
    offset: float  # [N]


class OffsetLine(NamedTuple):
    """Offset of the force sum over pressure: constant + area_error * pressure."""

    constant: float  # [N] of the load cell
    area_error: float  # [m^2] error of the area in the pressure force
    rms: float  # [N] of the residuals


def slope(time: FloatArray, values: FloatArray, law: SavitzkyGolay) -> FloatArray:
    """Time derivative of a signal by a Savitzky-Golay filter, at the times of the samples.

    The slope at a sample is that of the least-squares polynomial through the window centred there, which has no delay;
    in the first and last half window of a segment, that of the first or last window. The filter needs a uniform grid:
    each segment (samples without a pause longer than ``largest_gap``) is interpolated to as many equidistant times as
    it has samples, filtered, and interpolated back.

    Samples of ``values`` that are not finite are left out. The slope, in units of ``values`` per second, shape (n,), is
    NaN there and in segments shorter than the window. ValueError: no segment is as long as the window, or the window
    holds too few samples for the order.

    Source: [SavitzkyGolay1964]_; grid, gaps and edges are our choice.
    """
    from scipy.signal import savgol_filter  # noqa: PLC0415  half a second, for logs and bags only

    result = np.full(len(time), np.nan)
    for segment in _unbroken(time, np.flatnonzero(np.isfinite(values)), law.largest_gap):
        rows, at = len(segment), time[segment]
        if rows <= law.order + 1:
            continue
        interval = (at[-1] - at[0]) / (rows - 1)
        points = 2 * round(law.window / interval / 2.0) + 1
        if points <= law.order:
            raise ValueError(
                f'SavitzkyGolay.window = {law.window} s holds {points} samples, {interval:.3g} s apart: '
                f'order {law.order} needs {law.order + 1}'
            )
        if points <= rows:
            grid = np.linspace(at[0], at[-1], rows)
            even = np.interp(grid, at, values[segment])
            result[segment] = np.interp(at, grid, savgol_filter(even, points, law.order, deriv=1, delta=interval))
    if np.isnan(result).all():
        raise ValueError(
            f'no stretch of rows without a pause above {law.largest_gap} s is long enough for '
            f'a Savitzky-Golay window of {law.window} s'
        )
    return result


def _unbroken(time: FloatArray, index: IntArray, longest_gap: float) -> list[IntArray]:
    """Indices, divided where the time between two of them exceeds ``longest_gap`` [s]."""
    return np.split(index, np.flatnonzero(np.diff(time[index]) > longest_gap) + 1)


def even_sliding(signals: Signals, sliding: Sliding) -> BoolArray:
    """Which samples are even sliding: fast enough, small acceleration, every signal finite; shape (n,).

    The acceleration is the central difference of the velocity; it is not smoothed further.
    """
    finite = np.logical_and.reduce([np.isfinite(column) for column in signals])
    with np.errstate(invalid='ignore'):
        moving = np.abs(signals.velocity) > sliding.slowest
        even = np.abs(np.gradient(signals.velocity, signals.time)) < sliding.largest_acceleration
    return np.asarray(finite & moving & even)


def motions(signals: Signals, sliding: Sliding) -> list[tuple[int, IntArray]]:
    """Direction (0 at rest) and sample indices of each motion and each rest, in order of time.

    A change of direction, a stop, and a pause in the log longer than `LONGEST_GAP` end a motion. Samples without a
    velocity are left out.
    """
    index = np.flatnonzero(np.isfinite(signals.velocity))
    runs: list[tuple[int, IntArray]] = []
    for part in _unbroken(signals.time, index, LONGEST_GAP):
        velocity = signals.velocity[part]
        direction = np.where(np.abs(velocity) > sliding.slowest, np.sign(velocity), 0.0)
        parts = np.split(np.arange(len(part)), np.flatnonzero(np.diff(direction)) + 1)
        runs += [(int(direction[run[0]]), part[run]) for run in parts if len(run)]
    return runs


def strokes(signals: Signals, sliding: Sliding) -> list[SignalReading]:
    """Every motion at held speed and pressure, each with the medians of its even samples.

    Medians are insensitive to the transitions at both ends of a stroke. A stroke counts if it
    has `FEWEST_SAMPLES` even samples, of which `HELD_SHARE` are within `SPEED_TOLERANCE` of the median speed, and
    pressures within `PRESSURE_TOLERANCE`.
    """
    even = even_sliding(signals, sliding)
    moved = [(direction, run[even[run]]) for direction, run in motions(signals, sliding) if direction != 0]
    return [
        SignalReading(direction, samples, *(float(np.median(column[samples])) for column in signals[1:]))
        for direction, samples in moved
        if len(samples) >= FEWEST_SAMPLES and _is_held(signals, samples)
    ]


def _is_held(signals: Signals, samples: IntArray) -> bool:
    speed = np.abs(signals.velocity[samples])
    median = float(np.median(speed))
    if np.mean(np.abs(speed - median) <= SPEED_TOLERANCE * median) < HELD_SHARE:
        return False
    ends = [np.quantile(column[samples], (0.05, 0.95)) for column in (signals.pressure_a, signals.pressure_b)]
    return bool(np.ptp(ends, axis=1).max() <= PRESSURE_TOLERANCE * np.abs(ends).max())


def breakaways(signals: Signals, sliding: Sliding) -> list[SignalReading]:
    """The breakaway peak of each start from a rest of at least `SHORTEST_REST`.

    The peak is the largest force sum in the direction of the motion, from the preceding rest to the first even sample,
    because the velocity filter of a log delays the visible start. A reversal without a rest has no breakaway. Noise
    that looks like motion for less than `SHORTEST_REST` does not end a rest.
    """
    even = even_sliding(signals, sliding)
    found = []
    rest = np.empty(0, dtype=np.int64)
    for direction, run in motions(signals, sliding):
        is_noise = direction != 0 and len(rest) > 0 and signals.time[run[-1]] - signals.time[run[0]] < SHORTEST_REST
        rested = signals.time[rest[-1]] - signals.time[rest[0]] if len(rest) else 0.0
        follows = len(rest) > 0 and signals.time[run[0]] - signals.time[rest[-1]] <= LONGEST_GAP
        if direction == 0 or is_noise:
            rest = np.concatenate((rest, run)) if follows else run
            continue
        before, rest = rest, np.empty(0, dtype=np.int64)
        if not follows or rested < SHORTEST_REST or not even[run].any():
            continue
        candidates = np.concatenate((before, run[: int(np.argmax(even[run]))]))
        candidates = candidates[np.isfinite(signals.force_sum[candidates])]
        if len(candidates):
            peak = candidates[[np.argmax(direction * signals.force_sum[candidates])]]
            _, _, *values = (float(column[0]) for column in signals.taken(peak))
            if np.isfinite(values).all():
                found.append(SignalReading(direction, peak, 0.0, *values)._replace(dwell=float(rested)))
    return found


def half_range(force: FloatArray, direction: IntArray, *, of_medians: bool = True) -> HalfRange:
    """Friction and offset of a force that was measured in both directions.

    friction = (F_extend - F_retract) / 2, offset = (F_extend + F_retract) / 2 of the force [N], shape (n,), with the
    median of each direction (-1 or 1) for samples that include transitions, or the mean for single readings.
    ValueError: one direction is missing.
    """
    both = [force[direction == side] for side in (1, -1)]
    if not all(len(side) for side in both):
        raise ValueError('the rod moved in one direction only: friction and offset of the force cannot be separated')
    extend, retract = (float(np.median(side) if of_medians else np.mean(side)) for side in both)
    return HalfRange((extend - retract) / 2.0, (extend + retract) / 2.0)


def offset_line(pressures: FloatArray, offsets: FloatArray) -> OffsetLine:
    """Least-squares line through offsets [N] over pressures [Pa, gauge], shape (n,) each, n >= 2, not all the same."""
    area_error, constant = np.polyfit(pressures, offsets, 1)
    residuals = offsets - (constant + area_error * pressures)
    return OffsetLine(float(constant), float(area_error), float(np.sqrt(np.mean(residuals**2))))


def pressure_levels(pressures: FloatArray) -> IntArray:
    """Number of the pressure level of each pressure [Pa], from 0 for the lowest; shape (n,).

    A step between sorted pressures above `LEVEL_GAP` of the pressure (at least `LEVEL_GAP_MIN`) begins a new level. A
    level wider than `LEVEL_WIDTH` of the highest pressure is a ramp and is divided into equal parts.
    """
    order = np.argsort(pressures, kind='stable')
    ordered = pressures[order]
    gap = np.maximum(LEVEL_GAP * np.abs(ordered[1:]), LEVEL_GAP_MIN)
    width = max(LEVEL_WIDTH * float(np.abs(ordered).max()), 2.0 * LEVEL_GAP_MIN)
    result = np.zeros(len(ordered), dtype=np.int64)
    used = 0
    for cluster in np.split(np.arange(len(ordered)), np.flatnonzero(np.diff(ordered) > gap) + 1):
        inside = ordered[cluster]
        span = float(inside[-1] - inside[0])
        parts = max(int(np.ceil(span / width)), 1)
        part = np.minimum((inside - inside[0]) / (span or 1.0) * parts, parts - 1).astype(np.int64)
        part = np.unique(part, return_inverse=True)[1]
        result[order[cluster]] = used + part
        used += int(part[-1]) + 1
    return result


def held_pressures(pressures: FloatArray, direction: FloatArray) -> FloatArray:
    """Pressure [Pa] at which each stroke of one log counts as held, shape (n,): the mean of both directions.

    A regulator under a moving piston holds one pressure on extension and another on retraction: 0.95 and 1.06 bar on
    the Delft rig. If both directions have equally many levels, and each level of one is near that of the other
    (`SAME_LEVEL`, or twice `LEVEL_GAP_MIN`), the two are one level. Otherwise each stroke has its own pressure.
    """
    sides = [np.flatnonzero(direction == side) for side in (-1.0, 1.0)]
    if not all(len(side) for side in sides):
        return pressures
    levels = [pressure_levels(pressures[side]) for side in sides]
    means = [
        np.array([pressures[side][level == i].mean() for i in np.unique(level)])
        for side, level in zip(sides, levels, strict=True)
    ]
    if len(means[0]) != len(means[1]):
        return pressures
    middle = (means[0] + means[1]) / 2.0
    if (np.abs(means[1] - means[0]) > np.maximum(SAME_LEVEL * np.abs(middle), 2.0 * LEVEL_GAP_MIN)).any():
        return pressures
    result = pressures.copy()
    for side, level in zip(sides, levels, strict=True):
        result[side] = middle[level]
    return result


def longest_stretch(wrong: BoolArray) -> tuple[int, int]:
    """First index and length of the longest run of true; length 0 if there is none."""
    edges = np.flatnonzero(np.diff(wrong.astype(np.int8), prepend=0, append=0))
    if not len(edges):
        return 0, 0
    first, last = edges[::2], edges[1::2]
    longest = int(np.argmax(last - first))
    return int(first[longest]), int(last[longest] - first[longest])


def clipped_share(values: FloatArray, *, low_is_real: bool = False) -> float:
    """Share of the samples at which the sensor is saturated (clipped); 0.0 if it is not.

    A sensor is saturated if its signal changes with nearly every sample but stays for five or more samples at its
    highest or lowest value. Signals that also stay constant elsewhere (coarse or held signals) are not assessed, nor
    are signals within `HELD_COUNTS` of their smallest step, which are held or vented, and less than 1 % of the samples
    is ignored (our choice). With ``low_is_real`` only the highest value is looked at.
    """
    finite = values[np.isfinite(values)]
    if len(finite) < 100 or np.ptp(finite) <= HELD_COUNTS * np.diff(np.unique(finite)).min(initial=np.inf):
        return 0.0
    still = np.diff(finite, prepend=np.nan) == 0.0
    share = 0.0
    for extreme in (finite.max(),) if low_is_real else (finite.max(), finite.min()):
        at_end = finite == extreme
        if longest_stretch(at_end)[1] >= 5 and np.mean(still[~at_end]) < 0.5:
            share += float(np.mean(at_end))
    return share if share >= 0.01 else 0.0
