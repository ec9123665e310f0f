"""Import of a measured log: log and rig file -> bag with the pressure, force sum and rod velocity of each row.

The rig file describes the columns of the log, their units, signs and areas. The files in ``config/rigs`` are examples::

    name: my_rig
    source: origin of the log, and reason for the signs
    frame_id: rod               # frame of the messages
    header: comment             # none; row: the first line; comment: the last '#' line before the first row
    skip_rows: 15               # rows ignored at the beginning
    start: 1.0                  # [s] added to the time of each row
    time: {column: 0, unit: ms} # columns are numbered from 0 ...
    chamber_a: {terms: [{column_name: P(psig), unit: psi}]} # ... or named as in the header
    chamber_b: {constant: 0.0}  # [Pa]
    force_sum:                  # sum of gain * column, plus a constant [N]
      terms: [{column: 6, unit: N}, {column: 5, unit: bar, gain: -518.7, gain_unit: mm2}]
    velocity:
      terms: [{column: 4, unit: mm, gain: -1.0}]
      savitzky_golay: {window: 0.2, order: 2, largest_gap: 0.05} # absent: the terms are a velocity
    sliding: {slowest: 3.0e-3, largest_acceleration: 0.05} # for identification; absent: these values
    position: {terms: [{column: 4, unit: mm, gain: -1.0}]} # absent: that of the velocity, if it is made from position
    temperature: {column: 7, unit: degC} # of the seals; K or degC; absent: not known
    load: position              # for identification; the force sum holds a load that follows position; absent: auto
    reference_position: {terms: [{column: 7, unit: mm}]} # for tune; absent: the bag has no reference
    reference_velocity: {terms: [{column: 8, unit: mm/s}]} # absent: the slope of the position
    reference_acceleration: {terms: [{column: 9, unit: m/s2}]} # absent: 0
"""

from array import array
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain, repeat
from pathlib import Path
from typing import Any, NamedTuple, TextIO

import numpy as np
from numpy.typing import NDArray

from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.foundation.parameters import CheckedParameters, from_mapping, parameter
from seal_friction_ros.core.foundation.units import QUANTITIES, ZEROS, unit_size
from seal_friction_ros.core.identification.signal_preparation import SavitzkyGolay, Sliding, slope
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
from seal_friction_ros.files import read_yaml
from seal_friction_ros.offline.bags.bag import (
    FORCE_TOPIC,
    POSITION_TOPIC,
    PRESSURE_TOPIC,
    REFERENCE_TOPIC,
    TEMPERATURE_TOPIC,
    VELOCITY_TOPIC,
    BagWriter,
)
from seal_friction_ros.offline.work.progress import progress

_LAST_STAMP = (1 << 31) * 1_000_000_000  # [ns] first one beyond the int32 seconds of a ROS stamp
_LONGEST_LINE = 1 << 18  # characters
_BLOCK = 10_000  # rows that are numbers of Python at a time
_SHOWN = 40  # characters of an invalid cell in an error message
_PARTS = ('time', 'chamber_a', 'chamber_b', 'force_sum', 'velocity')
_REFERENCES = {
    'reference_position': 'length',
    'reference_velocity': 'velocity',
    'reference_acceleration': 'acceleration',
}
"""Optional columns of the wanted motion -> their quantity."""
_LOADS = ('auto', 'none', 'position')
_HEADERS = ('none', 'row', 'comment')
_QUANTITY_OF = {unit: quantity for quantity, units in QUANTITIES.items() for unit in units}


@dataclass(frozen=True, kw_only=True)
class Term(CheckedParameters):
    """One column of the log with its unit, times a gain with a unit (for example an area, or a sensor scale).

    Raises:
        ValueError: The column is named twice or not at all, or there is no such unit.
    """

    column: int = parameter(-1, unit='', lower=-1, upper=9999, description='Number of the column, counted from 0.')
    column_name: str = parameter('', unit='', description='Name of the column in the header, instead of its number.')
    unit: str = parameter(unit='', description='Unit of the column.')
    gain: float = parameter(1.0, unit='', description='Factor; -1 inverts the sign.')
    gain_unit: str = parameter('1', unit='', description='Unit of the gain.')

    def __post_init__(self) -> None:
        super().__post_init__()
        if (self.column < 0) == (not self.column_name):
            raise ValueError(
                f'Term.column = {self.column}, Term.column_name = {self.column_name!r}: '
                'give one of them, the number (0 or more) or the name'
            )
        for name in ('unit', 'gain_unit'):
            if getattr(self, name) not in _QUANTITY_OF:
                raise ValueError(f'Term.{name} = {getattr(self, name)!r} is not one of {", ".join(_QUANTITY_OF)}')

    @property
    def size(self) -> float:
        """SI value of a 1 in the column."""
        return self.gain * unit_size(self.gain_unit) * unit_size(self.unit)

    def is_a(self, quantity: str) -> bool:
        """Whether column times gain is a ``quantity`` (a key of the table of quantities above)."""
        factors = {_QUANTITY_OF[self.unit], _QUANTITY_OF[self.gain_unit]}
        return factors == {quantity, 'number'} or (quantity == 'force' and factors == {'pressure', 'area'})


@dataclass(frozen=True, kw_only=True)
class Combination(CheckedParameters):
    """Linear combination of columns: constant + sum of gain times column, in SI.

    Raises:
        ValueError: The constant is not finite.
    """

    terms: tuple[Term, ...] = ()
    constant: float = parameter(0.0, unit='SI', description='Constant part.')


@dataclass(frozen=True, kw_only=True)
class Rig(CheckedParameters):
    """Format of the logs of one rig.

    Raises:
        ValueError: A value is out of bounds, or the unit of a column does not fit its quantity.
    """

    name: str
    source: str = ''
    frame_id: str = 'rod'
    header: str = 'none'
    skip_rows: int = parameter(0, unit='rows', lower=0, upper=10**9, description='Rows ignored at the beginning.')
    start: float = parameter(0.0, unit='s', lower=0.0, upper=2.0e9, description='Added to the time of each row.')
    time: Term
    chamber_a: Combination
    chamber_b: Combination
    force_sum: Combination
    velocity: Combination
    savitzky_golay: SavitzkyGolay | None
    sliding: Sliding
    position: Combination | None = None
    temperature: Term | None = None
    load: str = 'auto'
    reference_position: Combination | None = None
    reference_velocity: Combination | None = None
    reference_acceleration: Combination | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.header not in _HEADERS:
            raise ValueError(f'Rig.header = {self.header!r} is not one of {", ".join(_HEADERS)}')
        if not self.frame_id.isprintable() or len(self.frame_id) > 255:
            raise ValueError(f'Rig.frame_id = {self.frame_id[:_SHOWN]!r} is not up to 255 printable characters')
        wanted = {'time': 'time', 'chamber_a': 'pressure', 'chamber_b': 'pressure', 'force_sum': 'force'}
        if self.load not in _LOADS:
            raise ValueError(f'Rig.load = {self.load!r} is not one of {", ".join(_LOADS)}')
        if self.load == 'position' and self.position is None and self.savitzky_golay is None:
            raise ValueError('Rig.load = position but the rig file has no position: add the column of the position')
        wanted['velocity'] = 'velocity' if self.savitzky_golay is None else 'length'
        wanted |= {'position': 'length', 'temperature': 'temperature'} | _REFERENCES
        given = [name for name in _REFERENCES if getattr(self, name) is not None]
        if given and self.reference_position is None and self.reference_velocity is None:
            raise ValueError(f'Rig.{given[0]} without reference_position or reference_velocity')
        for where, term in self.terms():
            quantity = wanted[where.split('.')[0]]
            if not term.is_a(quantity):
                raise ValueError(
                    f'{where}.unit = {term.unit!r} with gain_unit = {term.gain_unit!r} is not a {quantity}: '
                    f'use one of {", ".join(QUANTITIES[quantity])}'
                )
            if self.header == 'none' and term.column_name:
                raise ValueError(f'{where}.column_name = {term.column_name!r} but header = none: the log has no names')

    def terms(self) -> Iterator[tuple[str, Term]]:
        """Every term with its place in the rig file."""
        yield 'time', self.time
        for part in _PARTS[1:]:
            for number, term in enumerate(getattr(self, part).terms):
                yield f'{part}.terms[{number}]', term
        if self.temperature is not None:
            yield 'temperature', self.temperature
        for part in ('position', *_REFERENCES):
            combination = getattr(self, part)
            for number, term in enumerate(() if combination is None else combination.terms):
                yield f'{part}.terms[{number}]', term

    @property
    def known_position(self) -> Combination | None:
        """Position of the rod: that of the rig file, or the one that the velocity is made from; None without either."""
        return self.velocity if self.position is None and self.savitzky_golay is not None else self.position


class ImportSummary(NamedTuple):
    """Contents of an imported bag."""

    rows: int  # one pressure, one force sum and one velocity message each
    not_finite: int  # rows with a NaN or infinite pressure, force sum or velocity; the estimator flags them
    first_stamp: int  # [ns]
    last_stamp: int  # [ns]


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
    return write_samples(out, read.samples, rig.frame_id, read.track)


class ReadLog(NamedTuple):
    """A log in SI units, and its columns."""

    samples: Samples
    columns: dict[Term, FloatArray]  # values in the log, in the units of the terms
    position: FloatArray | None = None  # [m] shape (n,); None if the rig file has none
    temperature: FloatArray | None = None  # [K] likewise
    track: Track = NO_TRACK  # what the bag gets


def read_samples(log: Path, rig: Rig) -> ReadLog:
    """Read a log.

    Raises:
        ValueError: The log cannot be read or is invalid; one line that names file and field or line.
    """
    cells = _read_cells(log, rig)
    position = rig.known_position
    with np.errstate(invalid='ignore', over='ignore'):
        places = None if position is None else _combined(position, cells.columns, len(cells.line_numbers))
        term = rig.temperature
        warm = None if term is None else ZEROS[term.unit] + term.size * cells.columns[term]
    samples = _samples(log, rig, cells)
    track = Track(None if rig.position is None else places, _reference(rig, cells, samples), warm)
    return ReadLog(samples, cells.columns, places, warm, track)


def _reference(rig: Rig, cells: '_Cells', samples: Samples) -> tuple[FloatArray, FloatArray, FloatArray] | None:
    """Wanted position, velocity and acceleration; without a column of the velocity, the slope of the position."""
    count = len(samples.stamp)
    parts = [getattr(rig, name) for name in _REFERENCES]
    if not any(parts):
        return None
    with np.errstate(invalid='ignore', over='ignore'):
        position, velocity, acceleration = (
            None if part is None else _combined(part, cells.columns, count) for part in parts
        )
        if position is None:
            position = np.full(count, np.nan)
        if velocity is None:
            seconds = (samples.stamp - samples.stamp[0]) * 1e-9
            velocity = np.gradient(position, seconds) if count > 1 else np.zeros(count)
    return position, velocity, np.zeros(count) if acceleration is None else acceleration


def read_rig(path: Path) -> Rig:
    """Rig from its file.

    Raises:
        ValueError: The file cannot be read, or a value in it is invalid; names file, field, value and bound.
    """
    document = read_yaml(path)
    if not isinstance(document, Mapping):
        raise ValueError(f'{path}: a rig file is a mapping of names to values, not {type(document).__name__}')
    missing = [part for part in _PARTS if part not in document]
    if missing:
        raise ValueError(f'{path}: rig file lacks {", ".join(missing)}')
    velocity, filter_values = _taken_out(document['velocity'], 'savitzky_golay')
    parts: dict[str, Any] = {part: _combination(document[part], f'{path}: {part}') for part in _PARTS[1:-1]}
    parts['velocity'] = _combination(velocity, f'{path}: velocity')
    if 'temperature' in document:
        parts['temperature'] = from_mapping(Term, document['temperature'], f'{path}: temperature')
    optional = [part for part in ('position', *_REFERENCES) if part in document]
    parts |= {part: _combination(document[part], f'{path}: {part}') for part in optional}
    return from_mapping(
        Rig,
        {key: value for key, value in document.items() if key not in (*_PARTS, 'sliding', 'temperature', *optional)},
        str(path),
        time=from_mapping(Term, document['time'], f'{path}: time'),
        savitzky_golay=None
        if filter_values is None
        else from_mapping(SavitzkyGolay, filter_values, f'{path}: velocity.savitzky_golay'),
        sliding=from_mapping(Sliding, document.get('sliding', {}), f'{path}: sliding'),
        **parts,
    )


def _taken_out(values: Any, key: str) -> tuple[Any, Any]:
    """A mapping without ``key``, and the value there; anything else unchanged, for `from_mapping` to refuse."""
    if not isinstance(values, Mapping):
        return values, None
    return {k: v for k, v in values.items() if k != key}, values.get(key)


def _combination(document: Any, where: str) -> Combination:
    values, terms = _taken_out(document, 'terms')
    if terms is not None and not isinstance(terms, list):
        raise ValueError(f'{where}.terms = {terms!r} is not a list')
    if isinstance(values, Mapping) and not terms and 'constant' not in values:
        raise ValueError(f'{where} has neither terms nor a constant')
    made = tuple(from_mapping(Term, term, f'{where}.terms[{i}]') for i, term in enumerate(terms or ()))
    return from_mapping(Combination, values, where, terms=made)


class _Cells(NamedTuple):
    """Columns of a log that the rig file names."""

    line_numbers: Sequence[int]
    columns: dict[Term, FloatArray]


def _read_cells(log: Path, rig: Rig) -> _Cells:
    if log.exists() and not (log.is_file() or log.is_dir()):  # a pipe or a device never ends
        raise ValueError(f'{log}: not a file')
    terms = list(dict(rig.terms()).values())
    line_numbers, numbers = array('q'), array('d')
    try:
        with log.open(encoding='utf-8-sig') as file:
            header, lines = _parted(enumerate(_lines(file, log), start=1), rig.header)
            width = len(header)
            positions: list[int] = []
            for count, (number, cells) in enumerate(lines):
                width = width or len(cells)
                if not positions:
                    positions = [_position(term, where, header, width, log) for where, term in rig.terms()]
                if count >= rig.skip_rows:
                    numbers.extend(_numbers(cells, positions, width, f'{log}: line {number}'))
                    line_numbers.append(number)
    except OSError as error:
        raise ValueError(f'{log}: {error.strerror}') from None
    except UnicodeDecodeError:
        raise ValueError(f'{log}: not a text file') from None
    if not line_numbers:
        raise ValueError(f'{log}: no row of numbers in it after the {rig.skip_rows} rows that the rig file skips')
    columns = np.frombuffer(numbers, dtype=np.float64).reshape(len(line_numbers), len(terms)).T
    return _Cells(line_numbers, dict(zip(terms, columns, strict=True)))


def _lines(file: TextIO, log: Path) -> Iterator[str]:
    while line := file.readline(_LONGEST_LINE):
        if len(line) == _LONGEST_LINE:
            raise ValueError(f'{log}: not a log: a line of more than {_LONGEST_LINE} characters')
        yield line


def _parted(
    numbered_lines: Iterator[tuple[int, str]], header_kind: str
) -> tuple[list[str], Iterator[tuple[int, list[str]]]]:
    """Names in the header (empty without header), and the rows after it: line number and cells."""
    header: list[str] = []
    lines = ((number, text) for number, line in numbered_lines if (text := line.strip()))
    rows = ((number, _split(text)) for number, text in lines if not text.startswith('#'))
    for number, text in lines:
        if not text.startswith('#'):
            return (_split(text), rows) if header_kind == 'row' else (header, chain([(number, _split(text))], rows))
        if header_kind == 'comment':
            header = _split(text.lstrip('#'))
    return header, rows


def _split(text: str) -> list[str]:
    """Cells of a line, separated by commas, else by semicolons, else by white space; without quotes."""
    separator = next((mark for mark in ',;' if mark in text), None)
    return [cell.strip().strip('"\'') for cell in text.split(separator)]


def _position(term: Term, where: str, header: list[str], width: int, log: Path) -> int:
    """Number of the column of a term.

    Raises:
        ValueError: There is no such column, or several.
    """
    if not term.column_name:
        if term.column >= width:
            raise ValueError(f'{log}: rig file names {where}.column = {term.column}, but the log has 0 to {width - 1}')
        return term.column
    found = [i for i, name in enumerate(header) if name == term.column_name]
    if len(found) != 1:
        raise ValueError(
            f'{log}: rig file names {where}.column_name = {term.column_name!r}, '
            f'found {len(found)} times in the header: {", ".join(header)[:1000]}'
        )
    return found[0]


def _numbers(cells: list[str], positions: list[int], width: int, where: str) -> list[float]:
    if len(cells) != width:
        raise ValueError(f'{where}: {len(cells)} columns instead of {width}')
    numbers = []
    for position in positions:
        try:
            numbers.append(float(cells[position]))
        except ValueError:
            raise ValueError(f'{where}: column {position} is {cells[position][:_SHOWN]!r}, not a number') from None
    return numbers


def _samples(log: Path, rig: Rig, cells: _Cells) -> Samples:
    stamps = _stamps(log, rig, cells)
    with np.errstate(invalid='ignore', over='ignore'):  # NaN and infinite cells stay
        signals = {part: _combined(getattr(rig, part), cells.columns, len(stamps)) for part in _PARTS[1:]}
    if rig.savitzky_golay is not None:
        seconds = (stamps - stamps[0]) * 1e-9
        try:
            signals['velocity'] = slope(seconds, signals['velocity'], rig.savitzky_golay)
        except ValueError as error:
            raise ValueError(f'{log}: {error}') from None
    return Samples(stamps, signals['chamber_a'], signals['chamber_b'], signals['force_sum'], signals['velocity'])


def _combined(combination: Combination, columns: Mapping[Term, FloatArray], rows: int) -> FloatArray:
    total = np.full(rows, combination.constant)
    for term in combination.terms:
        total += term.size * columns[term]
    return total


def _stamps(log: Path, rig: Rig, cells: _Cells) -> NDArray[np.int64]:
    """Stamps [ns]: start + time column.

    Raises:
        ValueError: A time is not finite, outside the range of a stamp, or not after the previous one.
    """
    with np.errstate(invalid='ignore', over='ignore'):
        nanoseconds = np.rint((rig.start + rig.time.size * cells.columns[rig.time]) * 1e9)
    for number, value in zip(cells.line_numbers, nanoseconds, strict=True):
        if not 0.0 <= value < _LAST_STAMP:
            raise ValueError(f'{log}: line {number}: a stamp of {value * 1e-9:.9g} s is not between 0 s and 2^31 s')
    stamps: NDArray[np.int64] = nanoseconds.astype(np.int64)
    backwards = np.flatnonzero(np.diff(stamps) <= 0)
    if len(backwards):
        row = int(backwards[0]) + 1
        raise ValueError(
            f'{log}: line {cells.line_numbers[row]}: time {stamps[row] * 1e-9:.9g} s is not after '
            f'{stamps[row - 1] * 1e-9:.9g} s in the previous row'
        )
    return stamps


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
