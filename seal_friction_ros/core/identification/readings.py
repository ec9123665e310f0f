"""Measured signals, or noted readings -> the readings that a law is fitted to; and what is wrong with them.

Where speed and pressure are held, each stroke is one reading. Where they are swept, each sample of even sliding is, and
the log is cut into contiguous blocks, since neighbouring samples know of each other.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from seal_friction_ros.core.foundation.arrays import BoolArray, FloatArray, IntArray
from seal_friction_ros.core.foundation.units import BAR
from seal_friction_ros.core.identification.ladder import Conditions
from seal_friction_ros.core.identification.signal_preparation import (
    LONGEST_GAP,
    HalfRange,
    Signals,
    Sliding,
    Stroke,
    breakaways,
    clipped_share,
    even_sliding,
    half_range,
    longest_stretch,
    pressure_levels,
    strokes,
)

BLOCKS = 10  # contiguous parts of a swept log, each predicted from the others
FEWEST_PRESSURES = 3  # two points hold any line: a third one tests it
HELD_LOG = 0.8  # of the even samples in strokes at held speed and pressure: each stroke is a reading (our choice)
FEWEST_SWEPT = 200  # samples of even sliding, so that a block has 20 (our choice)
LONGEST_NAN = 0.5  # [s] a longer stretch without a measurement is a broken sensor (our choice)
LARGEST_NAN_SHARE = 0.01  # of the samples (our choice)
NARROWEST_PRESSURES = 5e4  # [Pa] from the lowest to the highest; less is one pressure (our choice)
PRESSURE_BOUNDS = (-1.2e5, 4.5e7)  # [Pa] as the estimator's default: beyond them a sensor or a unit is wrong
LARGEST_SPEED = 10.0  # [m/s] the same
LARGEST_FORCE = 1e6  # [N] the same
LARGEST_SEAL_AREA = 2e-3  # [m^2] friction over pressure: a seal with more would be a metre wide (our choice)
SMALLEST_SEAL_AREA = 6e-8  # [m^2] friction over pressure: a seal with less would be a hair (our choice)
LARGEST_AREA_ERROR = 5.0  # of the friction: what an offset may grow by over the pressures (our choice)


@dataclass(frozen=True, eq=False)
class Readings:
    """Friction readings of one rig, n of them, from one or several sources."""

    at: Conditions
    force: FloatArray
    """[N] force sum, signed, shape (n,)"""
    source: IntArray
    """index into ``names``, shape (n,)"""
    group: IntArray
    """what is left out together in cross-validation, shape (n,)"""
    level: IntArray
    """pressure level, from the lowest, shape (n,)"""
    names: tuple[str, ...]
    left_out_by: str
    """test, pressure, file or block: what ``group`` is"""
    are_samples: bool
    """samples of a swept log, and not strokes or noted readings at held pressures"""
    samples: tuple[FloatArray, ...] = ()
    """[N] force sums behind each reading; empty where the reading is all there is"""

    @property
    def count(self) -> int:
        """Number of readings."""
        return len(self.force)

    @property
    def seal_pressure(self) -> FloatArray:
        """Mean pressure of the seals [Pa, gauge, >= 0], shape (n,)."""
        return np.asarray(self.at.pressure.mean(axis=1))

    def taken(self, index: BoolArray | IntArray) -> 'Readings':
        """The readings that ``index`` names."""
        where = np.arange(self.count)[index]
        return replace(
            self,
            at=self.at.taken(where),
            force=self.force[where],
            source=self.source[where],
            group=self.group[where],
            level=self.level[where],
            samples=tuple(self.samples[i] for i in where) if self.samples else (),
        )

    @cached_property
    def scale(self) -> FloatArray:
        """What a deviation counts relative to [N], shape (n,).

        Samples of a swept log count alike. Readings count by the mean friction at their pressure, since there the
        scatter is a share of the friction: relative deviations count alike at every pressure.
        """
        if self.are_samples:
            return np.full(self.count, max(float(np.abs(self.force).mean()), 1e-12))
        result = np.empty(self.count)
        for level in np.unique(self.level):
            inside = self.level == level
            result[inside] = max(abs(level_friction(self, inside).friction), 1e-12)
        return result

    @cached_property
    def two_sided(self) -> tuple[IntArray, ...]:
        """For each source, the indices of its readings; empty where they are in one direction only."""
        found = []
        for source in range(len(self.names)):
            index = np.flatnonzero(self.source == source)
            found.append(index if len(np.unique(self.at.direction[index])) == 2 else index[:0])
        return tuple(found)


def level_friction(readings: Readings, inside: BoolArray) -> HalfRange:
    """Friction and offset of the readings ``inside``: half difference and half sum of the directions, [N].

    Of each source by itself, then the mean. Where a source has one direction only, its mean magnitude counts.
    """
    found: list[HalfRange] = []
    weights = []
    for source in np.unique(readings.source[inside]):
        index = np.flatnonzero(inside & (readings.source == source))
        direction = readings.at.direction[index].astype(np.int64)
        force = readings.force[index]
        if len(np.unique(direction)) < 2:
            found.append(HalfRange(float(np.mean(direction * force)), 0.0))
        elif readings.samples:
            parts = [readings.samples[i] for i in index]
            sides = np.repeat(direction, [len(part) for part in parts])
            found.append(half_range(np.concatenate(parts), sides))
        else:
            found.append(half_range(force, direction, of_medians=False))
        weights.append(len(index))
    friction, offset = np.average(np.array(found), axis=0, weights=weights)
    return HalfRange(float(friction), float(offset))


class Measurement(NamedTuple):
    """A log of one source."""

    name: str
    signals: Signals
    sliding: Sliding


class Noted(NamedTuple):
    """Readings that a person noted; arrays of shape (n,)."""

    name: str
    test: IntArray
    pressure: FloatArray
    """[Pa, gauge]"""
    direction: IntArray
    """-1 or 1"""
    friction: FloatArray
    """[N] magnitude, of all seals"""
    velocity: FloatArray
    """[m/s] magnitude; NaN where it was not noted"""


class Prepared(NamedTuple):
    """Readings, and what was made of the sources."""

    readings: Readings
    chamber_pressures: FloatArray
    """[Pa] of chambers a and b at each reading, shape (n, 2)"""
    breakaway: Readings | None
    """None where nothing started from rest"""
    used: dict[str, int]
    """source -> samples behind the readings"""
    total: dict[str, int]
    """source -> samples in it"""
    left_out: dict[str, int]
    """why a sample was not used -> how many"""


# -- signals to readings ----------------------------------------------------------------------------------------------


def prepare_signals(measurements: Sequence[Measurement], chambers: Sequence[str]) -> Prepared:
    """Readings from logs.

    Args:
        measurements: One for each source.
        chambers: Chamber that each seal sees, a or b, for each seal.

    Raises:
        ValueError: A log is not fit to identify from; one line that says what is wrong and what to measure instead.
    """
    for measurement in measurements:
        check_signals(measurement)
    found = [strokes(m.signals, m.sliding) for m in measurements]
    even = [even_sliding(m.signals, m.sliding) for m in measurements]
    held = sum(len(stroke.samples) for of_source in found for stroke in of_source)
    are_samples = held < HELD_LOG * sum(int(part.sum()) for part in even)
    names = tuple(m.name for m in measurements)
    if are_samples:
        readings, both = _swept(measurements, even, chambers)
    else:
        readings, both = _held(measurements, found, chambers)
    check_readings(readings)
    used = _used(measurements, found, even, are_samples=are_samples)
    return Prepared(
        readings,
        both,
        None if are_samples else _breakaway(measurements, chambers, readings),
        used,
        {name: len(m.signals.time) for name, m in zip(names, measurements, strict=True)},
        _left_out(measurements, even, sum(used.values())),
    )


def _seal_pressures(pressure_a: FloatArray, pressure_b: FloatArray, chambers: Sequence[str]) -> FloatArray:
    """Pressure that each seal sees [Pa, gauge, >= 0], shape (n, k); negative gauge pressure counts as zero."""
    both = {'a': pressure_a, 'b': pressure_b}
    return np.maximum(np.column_stack([both[chamber] for chamber in chambers]), 0.0)


def _conditions(pressure: FloatArray, velocity: FloatArray, direction: FloatArray) -> Conditions:
    return Conditions(pressure, None, velocity, direction)


def _held(
    measurements: Sequence[Measurement], found: Sequence[Sequence[Stroke]], chambers: Sequence[str]
) -> tuple[Readings, FloatArray]:
    rows = [(number, stroke) for number, of_source in enumerate(found) for stroke in of_source]
    column = {name: np.array([getattr(s, name) for _, s in rows]) for name in Stroke._fields if name != 'samples'}
    pressure = _seal_pressures(column['pressure_a'], column['pressure_b'], chambers)
    source = np.array([number for number, _ in rows])
    level = pressure_levels(pressure.mean(axis=1))
    group, by = _held_groups(level, source)
    readings = Readings(
        at=_conditions(pressure, column['velocity'], column['direction'].astype(np.float64)),
        force=column['force_sum'],
        source=source,
        group=group,
        level=level,
        names=tuple(m.name for m in measurements),
        left_out_by=by,
        are_samples=False,
        samples=tuple(measurements[number].signals.force_sum[stroke.samples] for number, stroke in rows),
    )
    return readings, np.column_stack((column['pressure_a'], column['pressure_b']))


def _held_groups(level: IntArray, part: IntArray, kind: str = 'file') -> tuple[IntArray, str]:
    """What is left out together: whole tests or files if each has most of the pressures, else pressures."""
    levels = len(np.unique(level))
    parts = np.unique(part)
    most = all(len(np.unique(level[part == p])) > 0.5 * levels for p in parts)
    return (part, kind) if len(parts) >= 2 and most else (level, 'pressure')


def _swept(
    measurements: Sequence[Measurement], even: Sequence[BoolArray], chambers: Sequence[str]
) -> tuple[Readings, FloatArray]:
    parts = [m.signals.taken(index) for m, index in zip(measurements, even, strict=True)]
    for measurement, part in zip(measurements, parts, strict=True):
        if len(part.time) < FEWEST_SWEPT:
            raise ValueError(
                f'{measurement.name}: {len(part.time)} samples of even sliding, where {FEWEST_SWEPT} are needed: '
                'drive longer strokes at even speed, in both directions'
            )
    joined = Signals(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))
    source = np.repeat(np.arange(len(parts)), [len(part.time) for part in parts])
    blocks = [np.arange(len(part.time)) * BLOCKS // len(part.time) for part in parts]
    pressure = _seal_pressures(joined.pressure_a, joined.pressure_b, chambers)
    mean = pressure.mean(axis=1)
    edges = np.quantile(mean, np.linspace(0.0, 1.0, BLOCKS + 1)[1:-1])
    readings = Readings(
        at=_conditions(pressure, joined.velocity, np.sign(joined.velocity)),
        force=joined.force_sum,
        source=source,
        group=np.concatenate([number * BLOCKS + block for number, block in enumerate(blocks)]),
        level=np.unique(np.searchsorted(edges, mean), return_inverse=True)[1],
        names=tuple(m.name for m in measurements),
        left_out_by='block',
        are_samples=True,
    )
    return readings, np.column_stack((joined.pressure_a, joined.pressure_b))


def _breakaway(measurements: Sequence[Measurement], chambers: Sequence[str], dynamic: Readings) -> Readings | None:
    rows = [(number, start) for number, m in enumerate(measurements) for start in breakaways(m.signals, m.sliding)]
    if not rows:
        return None
    column = {name: np.array([getattr(s, name) for _, s in rows]) for name in rows[0][1]._fields}
    pressure = _seal_pressures(column['pressure_a'], column['pressure_b'], chambers)
    level = _nearest_level(pressure.mean(axis=1), dynamic)
    source = np.array([number for number, _ in rows])
    return Readings(
        at=_conditions(pressure, np.zeros(len(rows)), column['direction'].astype(np.float64)),
        force=column['force_sum'],
        source=source,
        group=source if dynamic.left_out_by == 'file' else level,
        level=level,
        names=dynamic.names,
        left_out_by=dynamic.left_out_by,
        are_samples=False,
    )


def _nearest_level(pressure: FloatArray, dynamic: Readings) -> IntArray:
    """Level of the sliding readings that is nearest to each pressure [Pa], shape (n,)."""
    levels = np.unique(dynamic.level)
    means = np.array([dynamic.seal_pressure[dynamic.level == level].mean() for level in levels])
    return np.asarray(levels[np.argmin(np.abs(pressure[:, np.newaxis] - means), axis=1)])


def _used(
    measurements: Sequence[Measurement],
    found: Sequence[Sequence[Stroke]],
    even: Sequence[BoolArray],
    *,
    are_samples: bool,
) -> dict[str, int]:
    return {
        m.name: int(index.sum()) if are_samples else sum(len(stroke.samples) for stroke in of_source)
        for m, of_source, index in zip(measurements, found, even, strict=True)
    }


def _left_out(measurements: Sequence[Measurement], even: Sequence[BoolArray], used: int) -> dict[str, int]:
    missing = slow = accelerated = 0
    for m, index in zip(measurements, even, strict=True):
        finite = np.logical_and.reduce([np.isfinite(column) for column in m.signals])
        with np.errstate(invalid='ignore'):
            moving = np.abs(m.signals.velocity) > m.sliding.slowest
        missing += int((~finite).sum())
        slow += int((finite & ~moving).sum())
        accelerated += int((finite & moving & ~index).sum())
    in_no_stroke = sum(int(index.sum()) for index in even) - used
    counts = {'not finite': missing, 'at rest': slow, 'accelerated': accelerated, 'in no even stroke': in_no_stroke}
    return {why: count for why, count in counts.items() if count}


# -- noted readings ---------------------------------------------------------------------------------------------------


def prepare_noted(dynamic: Sequence[Noted], static: Sequence[Noted], seals: int) -> Prepared:
    """Readings from what a person noted.

    Args:
        dynamic: Running friction, one for each source.
        static: Breakout friction, one for each source; may be empty.
        seals: Seals that share the pressure.

    Raises:
        ValueError: The readings are not fit to identify from; one line that says what is wrong and what to do.
    """
    for noted in (*dynamic, *static):
        _check_noted(noted)
    readings = _noted_readings(dynamic, seals)
    check_readings(readings)
    breakaway = _noted_readings(static, seals) if static and len(static[0].friction) else None
    if breakaway is not None:
        breakaway = replace(breakaway, level=_nearest_level(breakaway.seal_pressure, readings))
        if readings.left_out_by == 'pressure':
            breakaway = replace(breakaway, group=breakaway.level, left_out_by='pressure')
    counts = {noted.name: len(noted.friction) for noted in dynamic}
    return Prepared(readings, np.repeat(readings.at.pressure[:, :1], 2, axis=1), breakaway, counts, counts, {})


def _noted_readings(noted: Sequence[Noted], seals: int) -> Readings:
    joined = {name: np.concatenate([getattr(n, name) for n in noted]) for name in Noted._fields if name != 'name'}
    pressure = np.repeat(np.maximum(joined['pressure'], 0.0)[:, np.newaxis], seals, axis=1)
    source = np.repeat(np.arange(len(noted)), [len(n.friction) for n in noted])
    level = pressure_levels(pressure[:, 0])
    tests = np.unique(np.column_stack((source, joined['test'])), axis=0, return_inverse=True)[1].reshape(-1)
    group, by = _held_groups(level, tests, 'test')
    direction = joined['direction'].astype(np.float64)
    return Readings(
        at=_conditions(pressure, direction * joined['velocity'], direction),
        force=direction * joined['friction'],
        source=source,
        group=group,
        level=level,
        names=tuple(n.name for n in noted),
        left_out_by=by,
        are_samples=False,
    )


def _check_noted(noted: Noted) -> None:
    for name, column in (('pressure', noted.pressure), ('friction', noted.friction)):
        wrong = int(np.count_nonzero(~np.isfinite(column)))
        if wrong:
            raise ValueError(f'{noted.name}: {wrong} readings have no {name}: measure them, or take their rows out')
    if len(noted.friction) < 4:
        raise ValueError(
            f'{noted.name}: {len(noted.friction)} readings are too few: at {FEWEST_PRESSURES} pressures at least, note '
            'the friction in both directions'
        )
    if (noted.friction < 0.0).any():
        raise ValueError(
            f'{noted.name}: friction of {float(noted.friction.min()):.6g} N is negative: note its magnitude, and the '
            'direction beside it'
        )
    _check_bounds(noted.name, noted.pressure, noted.pressure, np.abs(noted.velocity), noted.friction)


# -- what is wrong ----------------------------------------------------------------------------------------------------


def check_signals(measurement: Measurement) -> None:
    """Refuse a log that no law can come from.

    Raises:
        ValueError: Too few samples, stretches that are not numbers, values that no rod, seal or pressure has, no
            motion, one direction, or a sensor at the end of its range; one line with what to do.
    """
    name, signals, sliding = measurement
    if len(signals.time) < 20:
        raise ValueError(
            f'{name}: {len(signals.time)} samples are too few: record several strokes in both directions, at '
            f'{FEWEST_PRESSURES} pressures at least'
        )
    step = float(np.median(np.diff(signals.time)))
    if step > LONGEST_GAP:
        raise ValueError(
            f'{name}: samples are {step:.4g} s apart, so starts and stops are not seen: record at 20 Hz at least (or '
            'is the time in a wrong unit?)'
        )
    for what, column in zip(Signals._fields[1:], signals[1:], strict=True):
        _check_finite(name, what.replace('_', ' '), signals.time, column)
    _check_bounds(name, signals.pressure_a, signals.pressure_b, np.abs(signals.velocity), signals.force_sum)
    fastest = float(np.nanquantile(np.abs(signals.velocity), 0.99))
    if not fastest > sliding.slowest:
        raise ValueError(
            f'{name}: the rod does not move: 99 % of the speeds are below {1e3 * fastest:.3g} mm/s, and sliding begins '
            f'at {1e3 * sliding.slowest:.3g} mm/s: drive strokes in both directions (or is the velocity in m/s?)'
        )
    even = even_sliding(signals, sliding)
    sides = [int(np.count_nonzero(even & (side * signals.velocity > 0.0))) for side in (1, -1)]
    if not sum(sides):
        raise ValueError(
            f'{name}: the rod is always accelerated, by more than {sliding.largest_acceleration:.3g} m/s2: its inertia '
            'is in the force: drive strokes at even speed'
        )
    if min(sides) < 0.01 * sum(sides):
        velocity = signals.velocity[even]
        spread = f'{1e3 * float(velocity.min()):.4g} to {1e3 * float(velocity.max()):.4g} mm/s'
        raise ValueError(
            f'{name}: the rod goes one way only ({spread}, {min(sides)} of {sum(sides)} samples the other way): '
            'friction cannot be told from an offset of the force: drive strokes in both directions, at several speeds'
        )
    moving = np.abs(signals.velocity) > sliding.slowest
    for what, column in (('force sum', signals.force_sum), ('pressure of chamber a', signals.pressure_a),
                         ('pressure of chamber b', signals.pressure_b)):  # fmt: skip
        check_clipping(name, what, column[moving])


def check_clipping(name: str, what: str, column: FloatArray) -> None:
    """Refuse a signal that stands at the end of its sensor's range.

    Args:
        name: Of the source, for the error message.
        what: Of the signal, for the error message.
        column: Samples taken while the rod moves, shape (n,): at rest everything may stand still.

    Raises:
        ValueError: It does.
    """
    share = clipped_share(column)
    if share:
        ends = f'{float(np.nanmin(column)):.6g} or {float(np.nanmax(column)):.6g}'
        raise ValueError(
            f'{name}: the {what} stands still at its extreme ({ends}) in {100.0 * share:.2g} % of the samples: the '
            'sensor is clipped: use one with a larger range'
        )


def _check_finite(name: str, what: str, time: FloatArray, column: FloatArray) -> None:
    wrong = ~np.isfinite(column)
    if wrong.all():
        raise ValueError(f'{name}: no {what} is a number: record it')
    first, length = longest_stretch(wrong)
    lasts = float(time[first + length - 1] - time[first]) if length else 0.0
    if lasts > LONGEST_NAN or float(wrong.mean()) > LARGEST_NAN_SHARE:
        raise ValueError(
            f'{name}: {int(wrong.sum())} of {len(wrong)} samples have no {what}, {lasts:.3g} s in a row from '
            f'{float(time[first]):.6g} s on: repair the sensor or the log, and measure again, or cut that part out'
        )


def _check_bounds(
    name: str, pressure_a: FloatArray, pressure_b: FloatArray, speed: FloatArray, force: FloatArray
) -> None:
    low, high = PRESSURE_BOUNDS
    for pressure in (pressure_a, pressure_b):
        lowest, highest = float(np.nanmin(pressure)), float(np.nanmax(pressure))
        if lowest < low or highest > high:
            wrong = lowest if lowest < low else highest
            raise ValueError(
                f'{name}: a pressure of {wrong / BAR:.6g} bar (gauge) is not between {low / BAR:.3g} and '
                f'{high / BAR:.3g} bar: look at its sign and unit, or at the sensor'
            )
    fastest = float(np.nanmax(speed, initial=0.0))
    if fastest >= LARGEST_SPEED * (1.0 - 1e-6):
        raise ValueError(
            f'{name}: a speed of {fastest:.6g} m/s is not below {LARGEST_SPEED:.3g} m/s: look at the unit of velocity '
            'or position, and of the time'
        )
    strongest = float(np.nanmax(np.abs(force)))
    if strongest >= LARGEST_FORCE:
        raise ValueError(
            f'{name}: a force of {strongest:.6g} N is not below {LARGEST_FORCE:.3g} N: look at the unit of the force'
        )


def check_readings(readings: Readings) -> None:
    """Refuse readings that no law of the pressure can come from.

    Raises:
        ValueError: One direction, hardly any pressures, friction that drives the rod, or forces and pressures that do
            not belong together; one line with what to do.
    """
    where = ', '.join(readings.names)
    pressures = readings.seal_pressure
    levels = np.unique(readings.level)
    spanned = float(np.ptp(pressures))
    if spanned < max(NARROWEST_PRESSURES, 0.1 * float(pressures.max())):
        raise ValueError(
            f'{where}: everything was measured at one pressure, {float(np.median(pressures)) / BAR:.4g} bar (within '
            f'{spanned / BAR:.2g} bar): how friction follows pressure is not in it: measure at {FEWEST_PRESSURES} '
            'pressures at least (or is the pressure in Pa?)'
        )
    if not readings.are_samples and len(levels) < FEWEST_PRESSURES:
        at = ', '.join(f'{float(pressures[readings.level == level].mean()) / BAR:.4g}' for level in levels)
        raise ValueError(
            f'{where}: measured at {len(levels)} pressures ({at} bar): any law fits those: measure at '
            f'{FEWEST_PRESSURES} at least, better at five'
        )
    _check_signs(where, readings, levels)
    _check_sizes(where, readings, levels)


def _check_signs(where: str, readings: Readings, levels: IntArray) -> None:
    frictions = {int(level): level_friction(readings, readings.level == level).friction for level in levels}
    negative = [level for level, friction in frictions.items() if friction <= 0.0]
    if len(negative) > 0.2 * len(levels):
        level = negative[-1]
        pressure = float(readings.seal_pressure[readings.level == level].mean())
        raise ValueError(
            f'{where}: friction comes out as {frictions[level]:.4g} N at {pressure / BAR:.4g} bar, and would drive the '
            'rod: the sign of force sum or velocity is turned (both are positive on extension), or a unit in the '
            'force sum is wrong'
        )


def _check_sizes(where: str, readings: Readings, levels: IntArray) -> None:
    """Whether friction, offset and pressure can belong to one seal."""
    found = [level_friction(readings, readings.level == level) for level in levels]
    friction = np.array([f.friction for f in found])
    offsets = np.array([f.offset for f in found])
    pressure = np.array([readings.seal_pressure[readings.level == level].mean() for level in levels])
    spanned = float(np.ptp(pressure))
    area_error = float(np.polyfit(pressure, offsets, 1)[0])
    if not readings.are_samples and abs(area_error) * spanned > LARGEST_AREA_ERROR * float(friction.mean()):
        raise ValueError(
            f'{where}: the offset of the force sum grows by {area_error * spanned:.4g} N over the pressures, and the '
            f'friction is {float(friction.mean()):.4g} N: the pressure times area in the force sum has a wrong sign, '
            f'area or unit (off by {1e6 * area_error:.4g} mm2)'
        )
    area = float(friction[-1] - friction[0]) / spanned
    if abs(area) > LARGEST_SEAL_AREA:
        raise ValueError(
            f'{where}: friction changes by {area * BAR:.4g} N per bar, as if it pushed on {1e4 * area:.3g} cm2 of '
            'seal: force or pressure is in a wrong unit (kN for N, kPa for Pa)'
        )
    area = float(friction.max() / pressure.max())
    if area < SMALLEST_SEAL_AREA:
        raise ValueError(
            f'{where}: friction of {float(friction.max()):.4g} N at {float(pressure.max()) / BAR:.4g} bar is that of a '
            f'seal of {1e6 * area:.2g} mm2: force or pressure is in a wrong unit (N for kN, Pa for kPa)'
        )
    highest = friction >= (1.0 - 1e-9) * friction.max()
    if not readings.are_samples and not readings.samples and 3 <= np.count_nonzero(highest) < len(levels):
        raise ValueError(
            f'{where}: the friction is exactly {float(friction.max()):.6g} N at {np.count_nonzero(highest)} pressures, '
            'and below it at the others: the scale or sensor has come to its end: use one with a larger range'
        )
