"""Import of a measured log: log and rig file -> bag with the pressure, force sum and rod velocity of each row.

`rig_file` describes the columns, `log_table` reads the text.
"""

from bisect import bisect_right
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.foundation.errors import named_errors
from seal_friction_ros.core.foundation.units import ZEROS, unit_size
from seal_friction_ros.core.identification.signal_preparation import slope
from seal_friction_ros.core.machine.gauge_or_absolute import HIGHEST_AMBIENT, LOWEST_ABSOLUTE
from seal_friction_ros.core.messages.coder import encode, type_of
from seal_friction_ros.core.messages.records import Force, Position, Pressure, ServoReference, Temperature, Velocity
from seal_friction_ros.offline.bags import bag
from seal_friction_ros.offline.bags.log_table import Dropped, Expected, read_table
from seal_friction_ros.offline.bags.rig_file import PARTS, REFERENCES, Combination, Rig, Term
from seal_friction_ros.offline.work.progress import counted, progress

_LAST_STAMP = (1 << 31) * 1_000_000_000  # [ns] first one beyond the int32 seconds of a ROS stamp
_BLOCK = 10_000  # rows that are numbers of Python at a time
_WARNED = 0.01  # of the rows: more that are left out or not finite are warned of; our choice


class ImportSummary(NamedTuple):
    """Contents of an imported bag."""

    rows: int  # one pressure, one force sum and one velocity message each
    not_finite: int  # rows with a NaN or infinite pressure, force sum or velocity; the estimator flags them
    first_stamp: int  # [ns]
    last_stamp: int  # [ns]
    dropped: Mapping[str, int] = {}  # reason -> rows of the log that are not in the bag
    remarks: tuple[str, ...] = ()  # what looks wrong


class Samples(NamedTuple):
    """Samples for a bag; arrays of shape (n,)."""

    stamp: NDArray[np.int64]  # [ns]
    chamber_a: FloatArray  # [Pa, gauge]
    chamber_b: FloatArray  # [Pa, gauge]
    force_sum: FloatArray  # [N]
    velocity: FloatArray  # [m/s]


class Track(NamedTuple):
    """Position, wanted motion and temperature of a log for a bag; arrays of shape (n,); None: not in the log."""

    position: FloatArray | None = None  # [m]
    reference: tuple[FloatArray, FloatArray, FloatArray] | None = None  # [m, m/s, m/s^2]
    temperature: FloatArray | None = None  # [K]


NO_TRACK = Track()


def convert_log(log: Path, out: Path, rig: Rig) -> ImportSummary:
    """Convert a measured log to the bag ``out``: one row per line, cells separated by commas, semicolons or blanks.

    ValueError: the log cannot be read or is invalid; one line that names file and line, and nothing is written;
    BagError: ``out`` exists already or cannot be made.
    """
    read = read_samples(log, rig)
    summary = write_samples(out, read.samples, rig.frame_id, read.track)
    empty = _share_text('have a value that is empty or not finite', summary.not_finite, summary.rows)
    return summary._replace(dropped=dict(read.dropped), remarks=(*read.remarks, *empty))


class ReadLog(NamedTuple):
    """A log in SI units, and its columns."""

    samples: Samples
    columns: dict[Term, FloatArray]  # values in the log, in the units of the terms
    position: FloatArray | None = None  # [m] shape (n,); None if the rig file has none
    track: Track = NO_TRACK  # what the bag gets
    dropped: Mapping[str, int] = {}  # reason -> rows that are left out
    remarks: tuple[str, ...] = ()  # what looks wrong


def read_samples(log: Path, rig: Rig) -> ReadLog:
    """Read a log; ValueError, which names file and field or line, if it cannot be read or is invalid."""
    cells = _read_cells(log, rig)
    position = rig.known_position
    with np.errstate(invalid='ignore', over='ignore'):
        places = None if position is None else _combined(position, cells, rig)
        term = rig.temperature
        warm = None if term is None else ZEROS[term.unit] + term.size * cells.columns[term]
    samples = _samples(log, rig, cells)
    track = Track(None if rig.position is None else places, _reference(rig, cells, samples), warm)
    count = cells.dropped.counts.total()
    lost = [f'{text}: {cells.dropped.first}' for text in _share_text('left out', count, count + len(cells.stamps))]
    remarks = (*lost, *_pressure_remarks(rig, samples))
    return ReadLog(samples, cells.columns, places, track, cells.dropped.counts, remarks)


def _share_text(what: str, count: int, rows: int) -> list[str]:
    """Warning of a share of the rows, if it is worth one."""
    return [f'{count} of {rows} rows ({count / rows:.1%}) {what}'] if count > _WARNED * rows else []


def _pressure_remarks(rig: Rig, samples: Samples) -> Iterator[str]:
    """Chambers whose pressure is taken for gauge but likely absolute, by the name of its column or by its values."""
    lows = {name: np.nanmin(getattr(samples, name), initial=np.inf) for name in ('chamber_a', 'chamber_b')}
    is_vented = any(low <= LOWEST_ABSOLUTE for name, low in lows.items() if getattr(rig, name).terms)
    for name, low in lows.items():
        terms = getattr(rig, name).terms
        columns = [term.column_name for term in terms]
        named = [column for column in columns if column.rstrip(')] ').lower().endswith(('abs', 'psia', 'bara'))]
        if any(term.absolute for term in terms) or not terms:
            continue
        if named or (not is_vented and low <= HIGHEST_AMBIENT):
            why = f'its column is called {named[0]}' if named else f'it is never below {low:.3g} Pa'
            yield f'{name} is taken as gauge, but {why}: if it is absolute, write absolute: true in the rig file'


def _reference(rig: Rig, cells: '_Cells', samples: Samples) -> tuple[FloatArray, FloatArray, FloatArray] | None:
    """Wanted position, velocity and acceleration; without a column of the velocity, the slope of the position."""
    count = len(samples.stamp)
    parts = [getattr(rig, name) for name in REFERENCES]
    if not any(parts):
        return None
    with np.errstate(invalid='ignore', over='ignore'):
        position, velocity, acceleration = (None if part is None else _combined(part, cells, rig) for part in parts)
        if position is None:
            position = np.full(count, np.nan)
        if velocity is None:
            seconds = (samples.stamp - samples.stamp[0]) * 1e-9
            velocity = np.gradient(position, seconds) if count > 1 else np.zeros(count)
    return position, velocity, np.zeros(count) if acceleration is None else acceleration


class _Cells(NamedTuple):
    """Columns of a log that the rig file names, n rows."""

    stamps: NDArray[np.int64]  # [ns]
    columns: dict[Term, FloatArray]
    dropped: Dropped


def _read_cells(log: Path, rig: Rig) -> _Cells:
    terms = dict(rig.terms())
    wanted = [(where, term.column, term.column_name) for where, term in terms.items()]
    expected = Expected(rig.header, rig.separator, rig.decimal, rig.skip_rows)
    table = read_table(log, wanted, expected)
    columns = dict(zip(terms.values(), table.columns, strict=True))
    stamps, kept = _stamps(log, rig, table.line_numbers, columns, table.dropped)
    return _Cells(stamps[kept], {term: column[kept] for term, column in columns.items()}, table.dropped)


def _samples(log: Path, rig: Rig, cells: _Cells) -> Samples:
    stamps = cells.stamps
    with np.errstate(invalid='ignore', over='ignore'):  # NaN and infinite cells stay
        signals = {part: _combined(getattr(rig, part), cells, rig) for part in PARTS[1:]}
    if rig.savitzky_golay is not None:
        seconds = (stamps - stamps[0]) * 1e-9
        with named_errors(log):
            signals['velocity'] = slope(seconds, signals['velocity'], rig.savitzky_golay)
    return Samples(stamps, **signals)


def _combined(combination: Combination, cells: _Cells, rig: Rig) -> FloatArray:
    total = np.full(len(cells.stamps), combination.constant)
    for term in combination.terms:
        total += term.size * cells.columns[term]
        if term.absolute:
            total -= term.gain * unit_size(term.gain_unit) * rig.ambient_pressure
    return total


def _stamps(
    log: Path, rig: Rig, line_numbers: Sequence[int], columns: Mapping[Term, FloatArray], dropped: Dropped
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Stamps [ns], start + time column, and the rows to keep: the most whose stamps increase.

    ValueError: more rows than `LARGEST_DROPPED` have a time that is not finite, outside the range of a stamp, or not
    after the others.
    """
    rows = len(line_numbers)
    if rig.time is None:
        return np.rint((rig.start + np.arange(rows) / rig.rate) * 1e9).astype(np.int64), np.arange(rows)
    with np.errstate(invalid='ignore', over='ignore'):
        nanoseconds = np.rint((rig.start + rig.time.size * columns[rig.time]) * 1e9)
        is_stamp = (nanoseconds >= 0.0) & (nanoseconds < _LAST_STAMP)
    for row in np.flatnonzero(~is_stamp)[:1]:
        text = f'a stamp of {nanoseconds[row] * 1e-9:.9g} s is not between 0 s and 2^31 s'
        dropped.add('no valid time', f'{log}: line {line_numbers[row]}: {text}', int((~is_stamp).sum()))
    stamps: NDArray[np.int64] = np.where(is_stamp, nanoseconds, 0.0).astype(np.int64)
    dated = np.flatnonzero(is_stamp)
    backwards = np.flatnonzero(np.diff(stamps[dated]) <= 0)
    kept = dated[longest_increasing(stamps[dated])] if len(backwards) else dated
    if len(backwards):
        before, row = dated[backwards[0]], dated[backwards[0] + 1]
        text = f'time {stamps[row] * 1e-9:.9g} s is not after {stamps[before] * 1e-9:.9g} s in the previous row'
        dropped.add('time does not increase', f'{log}: line {line_numbers[row]}: {text}', len(dated) - len(kept))
    dropped.check(rows + dropped.counts.total() - (rows - len(kept)))
    return stamps, kept


def longest_increasing(values: NDArray[np.int64]) -> NDArray[np.int64]:
    """Indices of a longest strictly increasing subsequence, shape (k,): a single stamp far ahead is left out alone.

    Source: patience sorting, as in Fredman, Discrete Mathematics 11 (1975) 29.
    """
    tails: list[int] = []  # smallest last value of a subsequence of each length
    places: list[int] = []  # its index
    before = np.full(len(values), -1, dtype=np.int64)
    for place, value in enumerate(values.tolist()):
        length = bisect_right(tails, value - 1)
        before[place] = places[length - 1] if length else -1
        if length < len(tails):
            tails[length], places[length] = value, place
        else:
            tails.append(value)
            places.append(place)
    chosen = np.empty(len(places), dtype=np.int64)
    place = places[-1] if places else -1
    for number in range(len(places) - 1, -1, -1):
        chosen[number], place = place, int(before[place])
    return chosen


def write_samples(out: Path, samples: Samples, frame_id: str, track: Track = NO_TRACK) -> ImportSummary:
    """Write samples as a bag: temperature, pressure, force sum, position, reference, velocity, stamped as their row.

    The velocity comes last, since it triggers the estimate. BagError if ``out`` exists already or cannot be made.
    """
    celsius = None if track.temperature is None else (track.temperature - ZEROS['degC'],)
    columns: dict[tuple[str, Callable[..., Any]], tuple[FloatArray, ...] | None] = {
        (bag.TEMPERATURE_TOPIC, Temperature): celsius,
        (bag.PRESSURE_TOPIC, Pressure): (samples.chamber_a, samples.chamber_b),
        (bag.FORCE_TOPIC, Force): (samples.force_sum,),
        (bag.POSITION_TOPIC, Position): None if track.position is None else (track.position,),
        (bag.REFERENCE_TOPIC, partial(ServoReference, frame_id=frame_id.encode())): track.reference,
        (bag.VELOCITY_TOPIC, partial(Velocity, frame_id=frame_id.encode())): (samples.velocity,),
    }
    given = [(*key, zip(*map(_in_blocks, parts), strict=True)) for key, parts in columns.items() if parts is not None]
    with bag.BagWriter(out) as writer, progress(f'import {out.name}', len(samples.stamp)) as advance:
        for stamp in counted(_in_blocks(samples.stamp), advance):
            for topic, make, numbers in given:
                record = make(stamp, *next(numbers))
                writer.write(topic, type_of(record), stamp, encode(record, frame_id.encode()))
    finite = np.logical_and.reduce([np.isfinite(array) for array in samples[1:]])
    return ImportSummary(len(finite), int((~finite).sum()), int(samples.stamp[0]), int(samples.stamp[-1]))


def _in_blocks(values: NDArray[Any]) -> Iterator[Any]:
    """Values as Python numbers, some at a time: a list of them takes four times the memory of the array."""
    for first in range(0, len(values), _BLOCK):
        yield from values[first : first + _BLOCK].tolist()
