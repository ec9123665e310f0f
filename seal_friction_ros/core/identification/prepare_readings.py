"""Preparation of friction readings from recorded logs or from manual readings.

With held speed and pressure, each stroke is one reading. With swept speed or pressure, each sample of even sliding is
one reading, and the log is divided into contiguous blocks, because neighbouring samples are correlated.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from seal_friction_ros.core.foundation.arrays import BoolArray, FloatArray, IntArray
from seal_friction_ros.core.friction.mounting import pressures_at_seals
from seal_friction_ros.core.identification import signal_preparation
from seal_friction_ros.core.identification.admission import ACCELERATED, AT_REST, NOT_FINITE, Account, account
from seal_friction_ros.core.identification.candidate_laws import OperatingConditions
from seal_friction_ros.core.identification.readings import (
    FrictionReadings,
    ManualReadings,
    PreparedReadings,
    RecordedLog,
    check_log,
    check_manual_readings,
    check_readings,
    contiguous_parts,
    has_pressures,
    numbered,
)
from seal_friction_ros.core.identification.what_a_log_tells import free_rod

BLOCKS = 10  # contiguous parts of a swept log, each predicted from the others
HELD_LOG = 0.8  # of the even samples in strokes at held speed and pressure: each stroke is a reading (our choice)
PARTS = 4  # contiguous parts of the strokes at one pressure, each predicted from the others (our choice)
MOST_SWEPT = 4000  # samples of all swept logs, evenly taken: neighbours at tens of hertz tell the same (our choice)
FEWEST_SWEPT = 200  # samples of even sliding, so that a block has 20 (our choice)

_Rows = Sequence[tuple[int, signal_preparation.SignalReading]]
"""number of the log and reading, each"""


def prepare_logs(logs: Sequence[RecordedLog], chambers: Sequence[str]) -> PreparedReadings:
    """Readings from logs, one for each source; ``chambers`` (of `CHAMBERS`) are those of the seals.

    ValueError: a log is unfit for identification; one line with the reason and what to measure instead.
    """
    for log in logs:
        check_log(log)
    of_strokes = [
        (i, stroke) for i, log in enumerate(logs) for stroke in signal_preparation.strokes(log.signals, log.sliding)
    ]
    even = [signal_preparation.even_sliding(log.signals, log.sliding) for log in logs]
    used = [np.zeros(len(part), dtype=bool) for part in even]
    for i, stroke in of_strokes:
        used[i][stroke.samples] = True
    if sum(part.sum() for part in used) < HELD_LOG * sum(part.sum() for part in even):
        readings = _swept(logs, even, chambers)
        breakaway, used = None, even
    else:
        readings = _held(logs, of_strokes, chambers)
        breakaway = _breakaway(logs, chambers, readings)
    free = free_rod([log.signals for log in logs], even)
    if free is not None:
        one_level = replace(readings, free_rod=free, level=np.zeros_like(readings.level))
        readings = with_predictable_groups(one_level)
        breakaway = breakaway and replace(breakaway, free_rod=free, level=np.zeros_like(breakaway.level))
    check_readings(readings)
    accounts = tuple(_account(log, *masks) for log, *masks in zip(logs, even, used, strict=True))
    return PreparedReadings(readings, breakaway, accounts)


def _seal_pressures(chamber_pressures: FloatArray, chambers: Sequence[str]) -> FloatArray:
    """Pressure of each seal [Pa, gauge, >= 0], shape (n, k); negative gauge pressure counts as zero."""
    return np.maximum(pressures_at_seals(chambers, *chamber_pressures.T), 0.0)


def _columns(rows: _Rows, chambers: Sequence[str]) -> tuple[OperatingConditions, FloatArray, FloatArray, IntArray]:
    """Operating conditions, chamber pressures [Pa], shape (n, 2), force sum [N], number of the log; of each reading."""
    source = np.array([number for number, _ in rows])
    columns = [(r.velocity, r.direction, r.force_sum, r.pressure_a, r.pressure_b) for _, r in rows]
    velocity, direction, force, *both = np.array(columns, dtype=np.float64).T
    pressures = np.column_stack(both)
    at = OperatingConditions(_seal_pressures(pressures, chambers), velocity, direction)
    return at, pressures, force, source


def _held(logs: Sequence[RecordedLog], rows: _Rows, chambers: Sequence[str]) -> FrictionReadings:
    at, pressures, force, source = _columns(rows, chambers)
    held = at.pressure.mean(axis=1)
    for number in np.unique(source):
        inside = source == number
        held[inside] = signal_preparation.held_pressures(held[inside], at.direction[inside])
    level = signal_preparation.pressure_levels(held)
    group, by = _groups(level, source, 'file')
    names = tuple(log.name for log in logs)
    samples = tuple(logs[number].signals.force_sum[r.samples] for number, r in rows)
    ways = [_travel(log.signals) for log in logs]
    travel = np.array([ways[number][r.samples].mean() for number, r in rows])
    readings = FrictionReadings(at, force, source, group, level, names, by, False, samples, travel)
    readings = replace(readings, temperature=_temperatures(logs, rows), chamber_pressures=pressures)
    return with_predictable_groups(readings)


def _travel(signals: signal_preparation.Signals) -> FloatArray:
    """Way of the rod since the start [m], shape (n,); a missing velocity counts as rest."""
    steps = np.diff(signals.time, prepend=signals.time[:1])
    steps = np.minimum(steps, signal_preparation.LONGEST_GAP)
    return np.asarray(np.cumsum(np.nan_to_num(np.abs(signals.velocity)) * steps))


def _temperatures(logs: Sequence[RecordedLog], rows: _Rows) -> FloatArray:
    """Mean temperature of each reading [K]; empty if a log has none."""
    columns = [log.temperature for log in logs]
    measured = [column for column in columns if column is not None]
    if len(measured) < len(columns):
        return np.empty(0)
    return np.array([measured[number][reading.samples].mean() for number, reading in rows])


def with_predictable_groups(readings: FrictionReadings) -> FrictionReadings:
    """The readings with pressures as groups where one group is left, or parts of strokes where these are too few."""
    if len(readings.groups) < 2:
        readings = replace(readings, group=readings.level, left_out_by='pressure')
    if readings.left_out_by != 'pressure' or has_pressures(readings):
        return readings
    parts = contiguous_parts(PARTS, readings.source, readings.level)
    return replace(readings, group=parts, left_out_by='block')


def _breakaway(
    logs: Sequence[RecordedLog], chambers: Sequence[str], dynamic: FrictionReadings
) -> FrictionReadings | None:
    rows = [(i, peak) for i, log in enumerate(logs) for peak in signal_preparation.breakaways(log.signals, log.sliding)]
    if not rows:
        return None
    at, pressures, force, source = _columns(rows, chambers)
    level = _nearest_level(at.pressure.mean(axis=1), dynamic)
    parts = source if len(np.unique(source)) > 1 else contiguous_parts(PARTS, source, level)
    group = level if dynamic.left_out_by == 'pressure' else parts
    return replace(
        dynamic,
        at=at,
        force=force,
        source=source,
        group=group,
        level=level,
        samples=(),
        travel=np.empty(0),
        dwell=np.array([peak.dwell for _, peak in rows]),
        temperature=_temperatures(logs, rows),
        chamber_pressures=pressures,
    )


def _groups(level: IntArray, part: IntArray, kind: str) -> tuple[IntArray, str]:
    """Groups and their kind: whole tests or files if each has most of the pressures, otherwise pressures."""
    levels = len(np.unique(level))
    parts = np.unique(part)
    most = all(len(np.unique(level[part == p])) > 0.5 * levels for p in parts)
    return (part, kind) if len(parts) >= 2 and most else (level, 'pressure')


def _nearest_level(pressure: FloatArray, dynamic: FrictionReadings) -> IntArray:
    """Level of the sliding readings nearest to each pressure [Pa], shape (n,)."""
    nearest = np.argmin(np.abs(pressure[:, np.newaxis] - dynamic.level_pressures), axis=1)
    return np.asarray(np.array(list(dynamic.levels))[nearest])


def _swept(logs: Sequence[RecordedLog], even: Sequence[BoolArray], chambers: Sequence[str]) -> FrictionReadings:
    counts = [int(index.sum()) for index in even]
    if min(counts) < FEWEST_SWEPT:
        raise ValueError(
            f'{logs[int(np.argmin(counts))].name}: {min(counts)} samples of even sliding, {FEWEST_SWEPT} are needed: '
            'drive longer strokes at even speed, in both directions'
        )
    every = -(-sum(counts) // MOST_SWEPT)
    taken = [
        np.flatnonzero(index)[:: min(every, count // FEWEST_SWEPT)] for index, count in zip(even, counts, strict=True)
    ]
    parts = [log.signals.taken(index) for log, index in zip(logs, taken, strict=True)]
    warm = [log.temperature[index] for log, index in zip(logs, taken, strict=True) if log.temperature is not None]
    counts = [len(part.time) for part in parts]
    joined = signal_preparation.Signals(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))
    both = np.column_stack((joined.pressure_a, joined.pressure_b))
    pressure = _seal_pressures(both, chambers)
    mean = pressure.mean(axis=1)
    edges = np.quantile(mean, np.linspace(0.0, 1.0, BLOCKS + 1)[1:-1])
    return FrictionReadings(
        at=OperatingConditions(pressure, joined.velocity, np.sign(joined.velocity)),
        force=joined.force_sum,
        source=np.repeat(np.arange(len(parts)), counts),
        group=np.concatenate([i * BLOCKS + np.arange(n) * BLOCKS // n for i, n in enumerate(counts)]),
        level=np.unique(np.searchsorted(edges, mean), return_inverse=True)[1],
        names=tuple(log.name for log in logs),
        left_out_by='block',
        are_samples=True,
        temperature=np.concatenate(warm) if len(warm) == len(logs) else np.empty(0),
        chamber_pressures=both,
    )


def _account(log: RecordedLog, even: BoolArray, used: BoolArray) -> Account:
    """Samples of a log that are used, and why the others are not."""
    is_finite = np.logical_and.reduce([np.isfinite(column) for column in log.signals])
    with np.errstate(invalid='ignore'):
        moves = np.abs(log.signals.velocity) > log.sliding.slowest
    reasons = {NOT_FINITE: ~is_finite, AT_REST: ~moves, ACCELERATED: ~even, 'in no even stroke': ~used}
    return account(log.name, reasons, log.dropped)


def prepare_manual_readings(
    dynamic: Sequence[ManualReadings], static: Sequence[ManualReadings], seals: int
) -> PreparedReadings:
    """Readings from manual readings of seals that share the pressure: running friction, and breakaway friction if any.

    ValueError: the readings are unfit for identification; one line with the reason and what to do.
    """
    for manual in (*dynamic, *static):
        check_manual_readings(manual)
    readings = _joined(dynamic, seals)
    check_readings(readings)
    breakaway = _joined(static, seals) if static and len(static[0].friction) else None
    if breakaway is not None:
        breakaway = replace(breakaway, level=_nearest_level(breakaway.seal_pressure, readings))
        several = len(np.unique(breakaway.level)) > 1
        if several and (readings.left_out_by == 'pressure' or breakaway.left_out_by != 'test'):
            breakaway = replace(breakaway, group=breakaway.level, left_out_by='pressure')
    accounts = tuple(Account(manual.name, len(manual.friction), {}) for manual in dynamic)
    return PreparedReadings(readings, breakaway, accounts)


def _joined(sources: Sequence[ManualReadings], seals: int) -> FrictionReadings:
    names, *columns, dwells = zip(*sources, strict=True)
    test, pressure, direction, friction, velocity = (np.concatenate(column) for column in columns)
    of_seals = np.repeat(np.maximum(pressure, 0.0)[:, np.newaxis], seals, axis=1)
    source = np.repeat(np.arange(len(sources)), [len(manual.friction) for manual in sources])
    level = signal_preparation.pressure_levels(of_seals[:, 0])
    group, by = _groups(level, numbered(source, test), 'test')
    at = OperatingConditions(of_seals, direction * velocity, direction.astype(np.float64))
    readings = FrictionReadings(at, direction * friction, source, group, level, names, by, are_samples=False)
    readings = replace(readings, chamber_pressures=np.repeat(of_seals[:, :1], 2, axis=1))
    if all(dwell is not None for dwell in dwells):
        readings = replace(readings, dwell=np.concatenate(dwells))
    return with_predictable_groups(readings)
