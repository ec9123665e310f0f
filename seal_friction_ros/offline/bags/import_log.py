"""Import of a measured log: log and rig file -> bag with the pressure, force sum and rod velocity of each row.

`rig_file` describes the columns, `log_table` reads the text.
"""

from bisect import bisect_right
from collections.abc import Iterator, Mapping, Sequence
from itertools import repeat
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.foundation.units import ZEROS, unit_size
from seal_friction_ros.core.identification.signal_preparation import slope
from seal_friction_ros.core.machine.gauge_or_absolute import HIGHEST_AMBIENT, LOWEST_ABSOLUTE
from seal_friction_ros.core.messages.coder import encode
from seal_friction_ros.core.messages.layouts import (
    FORCE_TYPE,
    POSITION_TYPE,
    PRESSURE_TYPE,
    REFERENCE_TYPE,
    TEMPERATURE_TYPE,
    VELOCITY_TYPE,
)
from seal_friction_ros.core.messages.records import Force, Position, Pressure, ServoReference, Temperature, Velocity
from seal_friction_ros.offline.bags.bag import (
    FORCE_TOPIC,
    POSITION_TOPIC,
    PRESSURE_TOPIC,
    REFERENCE_TOPIC,
    TEMPERATURE_TOPIC,
    VELOCITY_TOPIC,
    BagWriter,
)
from seal_friction_ros.offline.bags.log_table import Dropped, Expected, read_table
from seal_friction_ros.offline.bags.rig_file import PARTS, REFERENCES, Combination, Rig, Term, read_rig
from seal_friction_ros.offline.work.progress import progress

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


def import_log(log: Path, rig_file: Path, out: Path) -> ImportSummary:
    """Convert a measured log to a bag.

    Args:
        log: Text with one row per line, cells separated by commas, semicolons or white space; '#' begins a comment.
        rig_file: Description of the columns.
        out: Bag to write; must not exist.

    Raises:
        ValueError: Rig file or log cannot be read or are invalid; one line that names file and field or line. Nothing
            is written.
        BagError: ``out`` exists already or cannot be made.
    """
    return convert_log(log, out, read_rig(rig_file))


def convert_log(log: Path, out: Path, rig: Rig) -> ImportSummary:
    """`import_log` with a rig that is read already.

    Raises:
        ValueError: The log cannot be read or is invalid; one line that names file and line. Nothing is written.
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
    temperature: FloatArray | None = None  # [K] likewise
    track: Track = NO_TRACK  # what the bag gets
    dropped: Mapping[str, int] = {}  # reason -> rows that are left out
    remarks: tuple[str, ...] = ()  # what looks wrong


def read_samples(log: Path, rig: Rig) -> ReadLog:
    """Read a log.

    Raises:
        ValueError: The log cannot be read or is invalid; one line that names file and field or line.
    """
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
    return ReadLog(samples, cells.columns, places, warm, track, cells.dropped.counts, remarks)


def _share_text(what: str, count: int, rows: int) -> list[str]:
    """Warning of a share of the rows, if it is worth one."""
    return [f'{count} of {rows} rows ({count / rows:.1%}) {what}'] if count > _WARNED * rows else []


def _pressure_remarks(rig: Rig, samples: Samples) -> Iterator[str]:
    """Chambers whose pressure is taken for gauge but likely absolute, by the name of its column or by its values."""
    lows = {name: np.nanmin(getattr(samples, name), initial=np.inf) for name in ('chamber_a', 'chamber_b')}
    is_vented = any(low <= LOWEST_ABSOLUTE for name, low in lows.items() if getattr(rig, name).terms)
    for name, low in lows.items():
        terms = getattr(rig, name).terms
        named = [
            term.column_name
            for term in terms
            if term.column_name.rstrip(')] ').lower().endswith(('abs', 'psia', 'bara'))
        ]
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
        try:
            signals['velocity'] = slope(seconds, signals['velocity'], rig.savitzky_golay)
        except ValueError as error:
            raise ValueError(f'{log}: {error}') from None
    return Samples(stamps, signals['chamber_a'], signals['chamber_b'], signals['force_sum'], signals['velocity'])


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

    Raises:
        ValueError: More rows than `LARGEST_DROPPED` have a time that is not finite, outside the range of a stamp, or
            not after the others.
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

    The velocity comes last, since it triggers the estimate.

    Raises:
        BagError: ``out`` exists already or cannot be made.
    """
    frame, rows = frame_id.encode(), len(samples.stamp)
    positions = repeat(None, rows) if track.position is None else _in_blocks(track.position)
    celsius_of_rows = repeat(None, rows) if track.temperature is None else _in_blocks(track.temperature - ZEROS['degC'])
    references: Iterator[Any] = repeat(None, rows)
    if track.reference is not None:
        references = zip(*map(_in_blocks, track.reference), strict=True)
    with BagWriter(out) as writer, progress(f'import {out.name}', rows) as advance:
        for count, (row, position, reference, celsius) in enumerate(
            zip(zip(*map(_in_blocks, samples), strict=True), positions, references, celsius_of_rows, strict=True),
            start=1,
        ):
            stamp, chamber_a, chamber_b, force_sum, velocity = row
            if celsius is not None:
                writer.write(TEMPERATURE_TOPIC, TEMPERATURE_TYPE, stamp, encode(Temperature(stamp, celsius), frame))
            pressure = encode(Pressure(stamp, chamber_a, chamber_b), frame)
            force = encode(Force(stamp, force_sum), frame)
            writer.write(PRESSURE_TOPIC, PRESSURE_TYPE, stamp, pressure)
            writer.write(FORCE_TOPIC, FORCE_TYPE, stamp, force)
            if position is not None:
                writer.write(POSITION_TOPIC, POSITION_TYPE, stamp, encode(Position(stamp, position), frame))
            if reference is not None:
                writer.write(
                    REFERENCE_TOPIC,
                    REFERENCE_TYPE,
                    stamp,
                    encode(ServoReference(stamp, reference[0], reference[1], reference[2], frame)),
                )
            writer.write(VELOCITY_TOPIC, VELOCITY_TYPE, stamp, encode(Velocity(stamp, velocity, frame)))
            if count % 1000 == 0:
                advance(1000)
    finite = np.logical_and.reduce([np.isfinite(array) for array in samples[1:]])
    return ImportSummary(len(finite), int((~finite).sum()), int(samples.stamp[0]), int(samples.stamp[-1]))


def _in_blocks(values: NDArray[Any]) -> Iterator[Any]:
    """Values as Python numbers, some at a time: a list of them takes four times the memory of the array."""
    for first in range(0, len(values), _BLOCK):
        yield from values[first : first + _BLOCK].tolist()
