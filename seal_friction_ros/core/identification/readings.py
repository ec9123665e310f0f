"""Friction readings of one rig, to which a law is fitted, the records that they are made from, and checks of both.

Each error of a check is one line: source, fault, and what to do.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from seal_friction_ros.core.foundation.arrays import BoolArray, FloatArray, IntArray
from seal_friction_ros.core.foundation.units import BAR
from seal_friction_ros.core.identification.admission import Account
from seal_friction_ros.core.identification.candidate_laws import OperatingConditions, SealKind
from seal_friction_ros.core.identification.signal_preparation import (
    LONGEST_GAP,
    HalfRange,
    Signals,
    Sliding,
    clipped_share,
    even_sliding,
    half_range,
    longest_stretch,
)
from seal_friction_ros.core.identification.what_a_log_tells import FreeRod

FEWEST_PRESSURES = 3  # any line fits two points; a third one tests it: with fewer a prior takes the place of the third
LONGEST_NAN = 0.5  # [s] a longer stretch without a value is a sensor fault (our choice)
LARGEST_NAN_SHARE = 0.01  # of the samples (our choice)
NARROWEST_PRESSURES = 5e4  # [Pa] from the lowest to the highest; less is one pressure (our choice)
PRESSURE_BOUNDS = (-1.2e5, 4.5e7)  # [Pa] default of the estimator; beyond them a sensor or a unit is wrong
LARGEST_SPEED = 10.0  # [m/s] likewise
LARGEST_FORCE = 1e6  # [N] likewise
LARGEST_SEAL_AREA = 2e-3  # [m^2] friction over pressure: no seal is larger (our choice)
SMALLEST_SEAL_AREA = 6e-8  # [m^2] friction over pressure: no seal is smaller (our choice)
LARGEST_SCATTER = 0.3  # of the friction at one pressure, where only one was measured (our choice)
OUTER = 0.1  # of the samples of a stroke at either end of their order: left out of its mean (our choice)
OF_MIDDLE = 1.06  # variance of the mean of the others, if they are normal, over that of the mean of all
LARGEST_AREA_ERROR = 5.0  # of the friction: largest change of the offset over the pressures (our choice)


class RecordedLog(NamedTuple):
    """Signals of one source."""

    name: str
    signals: Signals
    sliding: Sliding
    temperature: FloatArray | None = None  # [K] of each sample; None if not recorded
    position: FloatArray | None = None  # [m] likewise
    dropped: Mapping[str, int] = {}  # reason -> number of samples that are not in the signals


class ManualReadings(NamedTuple):
    """Readings of one source that a person wrote down; arrays of shape (n,)."""

    name: str
    test: IntArray
    pressure: FloatArray  # [Pa, gauge]
    direction: IntArray  # -1 or 1
    friction: FloatArray  # [N] magnitude, of all seals
    velocity: FloatArray  # [m/s] magnitude; NaN if not measured
    dwell: FloatArray | None = None  # [s] time at rest before; None if not noted


_COLUMNS = ('force', 'source', 'group', 'level', 'travel', 'dwell', 'temperature', 'chamber_pressures')


def _unknown() -> FloatArray:
    return np.empty(0)


@dataclass(frozen=True, eq=False)
class FrictionReadings:
    """n friction readings of one rig, from one or several sources."""

    at: OperatingConditions
    force: FloatArray  # [N] force sum, signed, shape (n,)
    source: IntArray  # index into ``names``, shape (n,)
    group: IntArray  # readings of one group are left out together in cross-validation, shape (n,)
    level: IntArray  # pressure level, 0 for the lowest, shape (n,)
    names: tuple[str, ...]  # of the sources
    left_out_by: str  # meaning of ``group``: test, pressure, file or block
    are_samples: bool  # samples of a swept log; otherwise strokes or manual readings at held pressures
    samples: tuple[FloatArray, ...] = ()  # [N] force sums behind each reading; empty if there is only the reading
    travel: FloatArray = field(default_factory=_unknown)  # [m] of the rod since the start of its source, shape (n,)
    dwell: FloatArray = field(default_factory=_unknown)  # [s] time at rest before each breakaway, shape (n,)
    temperature: FloatArray = field(default_factory=_unknown)  # [K] shape (n,)
    chamber_pressures: FloatArray = field(default_factory=_unknown)  # [Pa] of chambers a and b, shape (n, 2)
    kinds: tuple[SealKind, ...] = ()  # of the seals, in the order of the pressures; empty: one kind
    free_rod: FreeRod | None = None  # if the pressures are the effect of the friction, and tell nothing of it

    @property
    def count(self) -> int:
        """Number of readings."""
        return len(self.force)

    @property
    def seal_pressure(self) -> FloatArray:
        """Mean pressure of the seals [Pa, gauge, >= 0], shape (n,)."""
        return np.asarray(self.at.pressure.mean(axis=1))

    @cached_property
    def levels(self) -> dict[int, BoolArray]:
        """Pressure level -> mask of its readings, in increasing order of pressure."""
        return {int(level): self.level == level for level in np.unique(self.level)}

    @property
    def level_pressures(self) -> FloatArray:
        """Mean pressure of each level [Pa, gauge], shape (levels,)."""
        return self.level_means(self.seal_pressure)

    def level_means(self, values: FloatArray) -> FloatArray:
        """Mean of ``values``, shape (n, ...), at each level, shape (levels, ...)."""
        return np.array([values[inside].mean(axis=0) for inside in self.levels.values()])

    @cached_property
    def half_ranges(self) -> tuple[FloatArray, FloatArray]:
        """Friction and offset of each level [N], shape (levels,) each."""
        friction, offset = np.array([self.half_range(inside) for inside in self.levels.values()]).reshape(-1, 2).T
        return friction, offset

    @cached_property
    def groups(self) -> list[BoolArray]:
        """Mask of the readings of each group."""
        return [self.group == group for group in np.unique(self.group)]

    def taken(self, index: BoolArray | IntArray) -> 'FrictionReadings':
        """The readings in ``index``."""
        where = np.arange(self.count)[index]
        columns = {name: getattr(self, name) for name in _COLUMNS}
        chosen: dict[str, Any] = {name: column[where] for name, column in columns.items() if len(column)}
        samples = tuple(self.samples[i] for i in where) if self.samples else ()
        return replace(self, at=self.at.taken(where), samples=samples, **chosen)

    @cached_property
    def splits(self) -> list[tuple['FrictionReadings', 'FrictionReadings']]:
        """Of each group: the readings of all other groups, and its own. Every law is fitted to the same ones."""
        return [(self.taken(~out), self.taken(out)) for out in self.groups]

    def without(self, out: BoolArray) -> 'FrictionReadings':
        """The readings that are not ``out``; levels, and groups that are levels, are numbered without a gap."""
        left = self.taken(~out)
        level = np.unique(left.level, return_inverse=True)[1]
        return replace(left, level=level, group=level if left.left_out_by == 'pressure' else left.group)

    def magnitudes(self, offsets: FloatArray) -> FloatArray:
        """Measured friction [N], shape (n,): force sum without the offset of its source [N], along the direction."""
        return np.asarray(self.at.direction * (self.force - offsets[self.source]))

    def half_range(self, inside: BoolArray) -> HalfRange:
        """Friction and offset of the readings ``inside``: weighted mean over the sources, [N].

        For a source in one direction only, the friction is its mean magnitude and the offset is 0.
        """
        found, weights = [], []
        for source in np.unique(self.source[inside]):
            index = np.flatnonzero(inside & (self.source == source))
            direction, force = self.at.direction[index].astype(np.int64), self.force[index]
            if len(np.unique(direction)) < 2:
                found.append(HalfRange(float(np.mean(direction * force)), 0.0))
            elif self.samples:
                parts = [self.samples[i] for i in index]
                found.append(half_range(np.concatenate(parts), np.repeat(direction, [len(part) for part in parts])))
            else:
                found.append(half_range(force, direction, of_medians=False))
            weights.append(len(index))
        friction, offset = np.average(np.array(found), axis=0, weights=weights)
        return HalfRange(float(friction), float(offset))

    @cached_property
    def offsets(self) -> FloatArray:
        """Offset of the force sum of each source [N], in which friction cancels: mean over its pressures."""
        found = np.zeros(len(self.names))
        for source in np.unique(self.source):
            parts = [inside & (self.source == source) for inside in self.levels.values()]
            found[source] = np.mean([self.half_range(part).offset for part in parts if part.any()])
        return found

    def offsets_with_own(self, offsets: FloatArray, rest: FloatArray, known: IntArray) -> FloatArray:
        """Offsets [N], shape (sources,), those of sources that are not ``known`` from the readings themselves.

        ``rest`` is the force without friction [N], shape (n,); a source in one direction only has none.
        """
        found = offsets.copy()
        for source in set(self.source.tolist()) - set(known.tolist()):
            index = self.two_sided[source]
            side = self.at.direction[index].astype(np.int64)
            found[source] = half_range(rest[index], side, of_medians=False).offset if len(index) else 0.0
        return found

    def scaled(self, share: FloatArray, offsets: FloatArray) -> 'FrictionReadings':
        """The readings with ``share`` [-], shape (n,), of their friction; ``offsets`` of the sources [N] stay."""
        zero = offsets[self.source]
        rows = zip(self.samples, zero.tolist(), share.tolist(), strict=True) if self.samples else ()
        samples = tuple(offset + one * (part - offset) for part, offset, one in rows)
        return replace(self, force=zero + share * (self.force - zero), samples=samples)

    def frictions_of_sources(self, inside: BoolArray) -> dict[int, float]:
        """Source -> friction of its readings ``inside`` [N]."""
        sources = np.unique(self.source[inside])
        return {int(source): self.half_range(inside & (self.source == source)).friction for source in sources}

    @cached_property
    def scale(self) -> FloatArray:
        """Divisor of each deviation in the fit [N], shape (n,).

        It is the mean force for samples of a swept log, and the friction at the pressure for readings at held
        pressures, whose scatter is proportional to the friction.
        """
        if self.are_samples:
            return np.full(self.count, max(float(np.abs(self.force).mean()), 1e-12))
        of_levels = np.maximum(np.abs(self.half_ranges[0]), 1e-12)
        return np.asarray(of_levels[np.searchsorted(list(self.levels), self.level)])

    @cached_property
    def as_means(self) -> 'FrictionReadings':
        """The readings by the mean of the samples behind each, without `OUTER` of them: less noise than by medians."""
        if self.are_samples or not self.samples:
            return self
        out = [int(OUTER * len(one)) for one in self.samples]
        middles = [np.sort(one)[k : len(one) - k].mean() for one, k in zip(self.samples, out, strict=True)]
        return replace(self, force=np.array(middles))

    def noise(self, rest: FloatArray) -> FloatArray:
        r"""Standard deviation by the noise of the sensors [N] of each reading, shape (n,); 0 where it is not known.

        Noise differs from sample to sample, friction does not: :math:`s^2 = \overline{(x_{i+1} - x_i)^2} / 2` of
        samples [vonNeumann1941]_, and :math:`1.06 s^2 / n` of the mean (`as_means`) of n. ``rest`` is the force
        without friction [N], shape (n,).
        """
        if self.are_samples:
            one_motion = (np.diff(self.at.direction) == 0.0) & (np.diff(self.source) == 0)
            square = float(np.mean(np.diff(rest)[one_motion] ** 2)) if one_motion.any() else 0.0
            return np.full(self.count, math.sqrt(0.5 * square))
        if not self.samples:
            return np.zeros(self.count)
        return np.array(
            [math.sqrt(0.5 * OF_MIDDLE * float(np.mean(np.diff(one) ** 2)) / len(one)) for one in self.samples]
        )

    @cached_property
    def two_sided(self) -> tuple[IntArray, ...]:
        """Indices of the readings of each source; empty for a source in one direction only."""
        of_source = [np.flatnonzero(self.source == source) for source in range(len(self.names))]
        return tuple(index if len(np.unique(self.at.direction[index])) == 2 else index[:0] for index in of_source)

    @cached_property
    def shares(self) -> tuple[FloatArray, ...]:
        """Shares of the readings of `two_sided` in the mean force of their source; their sum is 1."""
        weights = [1.0 / self.scale[index] ** 2 for index in self.two_sided]
        return tuple(each / max(each.sum(), 1e-300) for each in weights)


def numbered(*columns: IntArray) -> IntArray:
    """Number of each distinct row of the columns, shape (n,) each."""
    return np.asarray(np.unique(np.column_stack(columns), axis=0, return_inverse=True)[1].reshape(-1))


def contiguous_parts(count: int, *columns: IntArray) -> IntArray:
    """Number of one of ``count`` contiguous parts, within the rows that are alike in all columns, shape (n,)."""
    part, alike = np.zeros(len(columns[0]), dtype=np.int64), numbered(*columns)
    for number in np.unique(alike):
        inside = np.flatnonzero(alike == number)
        part[inside] = np.arange(len(inside)) * count // len(inside)
    return part


class PreparedReadings(NamedTuple):
    """Readings of all sources."""

    readings: FrictionReadings
    breakaway: FrictionReadings | None  # None if no motion starts from rest
    accounts: tuple[Account, ...]  # samples of each source


def check_log(log: RecordedLog) -> None:
    """Check a log.

    ValueError: too few samples, missing or impossible values, no motion, motion in one direction only, or a clipped
    sensor.
    """
    name, signals, sliding, *_ = log
    if len(signals.time) < 20:
        raise ValueError(
            f'{name}: {len(signals.time)} samples are too few: record several strokes in both directions, at '
            f'{FEWEST_PRESSURES} pressures at least'
        )
    step = float(np.median(np.diff(signals.time)))
    if step > LONGEST_GAP:
        raise ValueError(
            f'{name}: samples are {step:.4g} s apart, too far to see starts and stops: record at 20 Hz at least (or is '
            'the unit of the time wrong?)'
        )
    for what, column in signals._asdict().items():
        wrong = ~np.isfinite(column)
        if wrong.all():
            raise ValueError(f'{name}: no {what.replace("_", " ")} is a number: record it')
        first, length = longest_stretch(wrong)
        missing = float(signals.time[first + length - 1] - signals.time[first]) if length else 0.0  # [s]
        if missing > LONGEST_NAN or float(wrong.mean()) > LARGEST_NAN_SHARE:
            raise ValueError(
                f'{name}: {int(wrong.sum())} of {len(wrong)} samples have no {what.replace("_", " ")}, {missing:.3g} s '
                f'in a row from {float(signals.time[first]):.6g} s on: repair the sensor or the log and measure again, '
                'or cut that part out'
            )
    pressures = np.concatenate((signals.pressure_a, signals.pressure_b))
    _check_bounds(name, pressures, np.abs(signals.velocity), signals.force_sum)
    fastest = float(np.nanquantile(np.abs(signals.velocity), 0.99))
    if not fastest > sliding.slowest:
        raise ValueError(
            f'{name}: the rod does not move: 99 % of the speeds are below {1e3 * fastest:.3g} mm/s, and sliding begins '
            f'at {1e3 * sliding.slowest:.3g} mm/s: drive strokes in both directions (or is the velocity not in m/s?)'
        )
    velocity = signals.velocity[even_sliding(signals, sliding)]
    sides = [int(np.count_nonzero(side * velocity > 0.0)) for side in (1, -1)]
    if not sum(sides):
        raise ValueError(
            f'{name}: the rod always accelerates by more than {sliding.largest_acceleration:.3g} m/s2, so the force '
            'contains its inertia: drive strokes at even speed'
        )
    if min(sides) < 0.01 * sum(sides):
        spread = f'{1e3 * float(velocity.min()):.4g} to {1e3 * float(velocity.max()):.4g} mm/s'
        raise ValueError(
            f'{name}: the rod moves one way only ({spread}, {min(sides)} of {sum(sides)} samples the other way), so '
            'friction and offset cannot be separated: drive strokes in both directions, at several speeds'
        )
    moving = np.abs(signals.velocity) > sliding.slowest
    check_clipping(name, 'force sum', signals.force_sum[moving])
    check_clipping(name, 'pressure of chamber a', signals.pressure_a[moving], is_pressure=True)
    check_clipping(name, 'pressure of chamber b', signals.pressure_b[moving], is_pressure=True)


def check_clipping(name: str, what: str, column: FloatArray, *, is_pressure: bool = False) -> None:
    """Check the signal ``what`` of the source ``name``: samples while the rod moves, shape (n,); a pressure in Pa.

    A pressure may stand at its lowest, as in a vented chamber. ValueError: the sensor is clipped.
    """
    share = clipped_share(column, low_is_real=is_pressure)
    if share:
        ends = f'{float(np.nanmin(column)):.6g} or {float(np.nanmax(column)):.6g}'
        raise ValueError(
            f'{name}: the {what} stays at its extreme ({ends}) in {100.0 * share:.2g} % of the samples: the sensor is '
            'clipped: use one with a larger range'
        )


def check_manual_readings(manual: ManualReadings) -> None:
    """Check manual readings. ValueError: missing values, too few readings, negative friction, or impossible values."""
    for what, column in (('pressure', manual.pressure), ('friction', manual.friction)):
        wrong = int(np.count_nonzero(~np.isfinite(column)))
        if wrong:
            raise ValueError(f'{manual.name}: {wrong} readings have no {what}: measure them, or delete their rows')
    if len(manual.friction) < 4:
        raise ValueError(
            f'{manual.name}: {len(manual.friction)} readings are too few: measure the friction in both directions, at '
            f'{FEWEST_PRESSURES} pressures at least'
        )
    if (manual.friction < 0.0).any():
        raise ValueError(
            f'{manual.name}: friction of {float(manual.friction.min()):.6g} N is negative: give its magnitude, and the '
            'direction in a column of its own'
        )
    _check_bounds(manual.name, manual.pressure, np.abs(manual.velocity), manual.friction)


def _check_bounds(name: str, pressure: FloatArray, speed: FloatArray, force: FloatArray) -> None:
    for what, values, (low, high), unit, size, advice in (
        ('pressure', pressure, PRESSURE_BOUNDS, 'bar (gauge)', BAR, 'sign and unit of the pressure, and the sensor'),
        ('speed', speed, (0.0, LARGEST_SPEED * (1.0 - 1e-6)), 'm/s', 1.0, 'units of velocity or position, and time'),
        ('force', np.abs(force), (0.0, LARGEST_FORCE), 'N', 1.0, 'unit of the force'),
    ):
        lowest, highest = float(np.nanmin(values, initial=high)), float(np.nanmax(values, initial=low))
        if lowest < low or highest > high:
            raise ValueError(
                f'{name}: a {what} of {(lowest if lowest < low else highest) / size:.6g} {unit} is not between '
                f'{low / size:.3g} and {high / size:.3g} {unit}: check the {advice}'
            )


def has_pressures(readings: FrictionReadings) -> bool:
    """Whether the readings show how friction depends on pressure: enough pressures, far enough apart."""
    if readings.free_rod is not None:
        return False
    enough = readings.are_samples or len(readings.levels) >= FEWEST_PRESSURES
    return enough and are_far_apart(readings.seal_pressure)


def are_far_apart(pressures: FloatArray) -> bool:
    """Whether pressures [Pa], shape (n,), differ by more than a regulator and its sensor do (our choice)."""
    return float(np.ptp(pressures)) >= max(NARROWEST_PRESSURES, 0.1 * float(np.max(pressures)))


def _check_pressures(where: str, readings: FrictionReadings) -> None:
    if has_pressures(readings) or readings.free_rod is not None:
        return
    pressures = readings.seal_pressure
    if float(pressures.max()) < NARROWEST_PRESSURES:
        raise ValueError(
            f'{where}: everything was measured at {float(pressures.min()) / BAR:.2g} to '
            f'{float(pressures.max()) / BAR:.2g} bar, as without pressure: drive under pressure (or is the pressure '
            'not in Pa?)'
        )
    if readings.are_samples:
        return
    for inside in readings.levels.values():
        force = readings.at.direction[inside] * (readings.force[inside] - readings.half_range(inside).offset)
        scatter = float(force.std() / abs(force.mean())) if force.mean() else math.inf
        if scatter > LARGEST_SCATTER:
            raise ValueError(
                f'{where}: at {float(pressures[inside].mean()) / BAR:.4g} bar readings scatter by '
                f'{100.0 * scatter:.0f} %, so the friction depends on something else than was recorded: record the '
                'pressure of each reading'
            )


def check_readings(readings: FrictionReadings) -> None:
    """Check that a law can be fitted to readings.

    ValueError: negative friction, or forces and pressures that do not belong to one seal.
    """
    where = ', '.join(readings.names)
    _check_pressures(where, readings)
    friction, offsets = readings.half_ranges
    pressure = readings.level_pressures
    negative = np.flatnonzero(friction <= 0.0)
    if len(negative) > 0.2 * len(friction):
        raise ValueError(
            f'{where}: the friction is {friction[negative[-1]]:.4g} N at {pressure[negative[-1]] / BAR:.4g} bar, so it '
            'would drive the rod: the sign of force sum or velocity is wrong (both are positive on extension), or a '
            'unit in the force sum'
        )
    spanned, strongest = float(np.ptp(pressure)), float(friction.max())
    area_error = float(np.polyfit(pressure, offsets, 1)[0]) if has_pressures(readings) else 0.0
    if not readings.are_samples and abs(area_error) * spanned > LARGEST_AREA_ERROR * float(friction.mean()):
        raise ValueError(
            f'{where}: the offset of the force sum changes by {area_error * spanned:.4g} N over the pressures, and the '
            f'friction is {float(friction.mean()):.4g} N: sign, area or unit of the pressure force in the force sum is '
            f'wrong (error {1e6 * area_error:.4g} mm2)'
        )
    area = float(friction[-1] - friction[0]) / max(spanned, NARROWEST_PRESSURES)
    if abs(area) > LARGEST_SEAL_AREA:
        raise ValueError(
            f'{where}: friction changes by {area * BAR:.4g} N per bar, as for a seal of {1e4 * area:.3g} cm2: force or '
            'pressure is in a wrong unit (kN for N, kPa for Pa)'
        )
    area = strongest / float(pressure.max())
    if area < SMALLEST_SEAL_AREA:
        raise ValueError(
            f'{where}: friction of {strongest:.4g} N at {float(pressure.max()) / BAR:.4g} bar, as for a seal of '
            f'{1e6 * area:.2g} mm2: force or pressure is in a wrong unit (N for kN, Pa for kPa)'
        )
    highest = np.count_nonzero(friction >= (1.0 - 1e-9) * strongest)
    if not readings.are_samples and not readings.samples and 3 <= highest < len(friction):
        raise ValueError(
            f'{where}: the friction is exactly {strongest:.6g} N at {highest} pressures and lower at the others: the '
            'scale or sensor is clipped: use one with a larger range'
        )
