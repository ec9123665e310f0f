"""The rig file: what the columns of a measured log are, with units, signs and areas.

The files in ``config/rigs`` are examples::

    name: my_rig
    source: origin of the log, and reason for the signs
    frame_id: rod               # frame of the messages
    header: comment             # none; row: the line with the names; comment: the last '#' line before the first row
    separator: auto             # semicolon, tab, comma, space
    decimal: auto               # point, comma
    skip_rows: 15               # rows ignored at the beginning, after the header
    start: 1.0                  # [s] added to the time of each row
    time: {column: 0, unit: ms} # columns are numbered from 0 ...; without a time: {rate: 500 Hz}
    chamber_a: {terms: [{column_name: P(psig), unit: psi}]} # ... or named as in the header
    chamber_b: {constant: 0.0}  # [Pa]
    ambient_pressure: 1.013 bar # taken off the columns with absolute: true; absent: at sea level
    force_sum:                  # sum of gain * column, plus a constant [N]
      terms: [{column: 6, unit: N}, {column: 5, unit: bar, gain: -518.7 mm2, absolute: true}]
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

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from seal_friction_ros.core.foundation.parameters import CheckedParameters, from_mapping, parameter
from seal_friction_ros.core.foundation.units import QUANTITIES, QUANTITY_OF, in_si, number_and_unit, unit_size
from seal_friction_ros.core.identification.signal_preparation import SavitzkyGolay, Sliding
from seal_friction_ros.core.machine.machine_file import STANDARD_ATMOSPHERE
from seal_friction_ros.files import read_yaml

_SHOWN = 40  # characters of an invalid value in an error message
PARTS = ('time', 'chamber_a', 'chamber_b', 'force_sum', 'velocity')
REFERENCES = ('reference_position', 'reference_velocity', 'reference_acceleration')
"""Optional columns of the wanted motion."""
_QUANTITIES = {
    'chamber_a': 'pressure', 'chamber_b': 'pressure', 'force_sum': 'force', 'velocity': 'velocity',
    'position': 'length', 'reference_position': 'length', 'reference_velocity': 'velocity',
    'reference_acceleration': 'acceleration',
}  # fmt: skip
"""Combination of columns -> its quantity; that of a velocity made from position is a length."""
SEPARATORS = {'semicolon': ';', 'tab': '\t', 'comma': ',', 'space': None}
"""Name of a separator of cells -> as `str.split` takes it."""
_CHOICES = {
    'header': ('none', 'row', 'comment'),
    'separator': ('auto', *SEPARATORS),
    'decimal': ('auto', 'point', 'comma'),
    'load': ('auto', 'none', 'position'),
}
"""Field of `Rig` -> its values."""


@dataclass(frozen=True, kw_only=True)
class Term(CheckedParameters):
    """One column of the log with its unit, times a gain with a unit (for example an area, or a sensor scale).

    ValueError: the column is named twice or not at all, or there is no such unit.
    """

    column: int = parameter(-1, unit='', lower=-1, upper=9999, description='Number of the column, counted from 0.')
    column_name: str = parameter('', unit='', description='Name of the column in the header, instead of its number.')
    unit: str = parameter(unit='', description='Unit of the column.')
    gain: float = parameter(1.0, unit='', description='Factor; -1 inverts the sign.')
    gain_unit: str = parameter('1', unit='', description='Unit of the gain.')
    absolute: bool = parameter(False, unit='', description='A pressure from which the ambient pressure is taken off.')

    def __post_init__(self) -> None:
        super().__post_init__()
        if (self.column < 0) == (not self.column_name):
            given = f'Term.column = {self.column}, Term.column_name = {self.column_name!r}'
            raise ValueError(f'{given}: give one of them, the number (0 or more) or the name')
        for name in ('unit', 'gain_unit'):
            if getattr(self, name) not in QUANTITY_OF:
                raise ValueError(f'Term.{name} = {getattr(self, name)!r} is not one of {", ".join(QUANTITY_OF)}')
        if self.absolute and QUANTITY_OF[self.unit] != 'pressure':
            raise ValueError(f'Term.absolute = true: only a pressure is absolute, and the unit is {self.unit!r}')

    @property
    def size(self) -> float:
        """SI value of a 1 in the column."""
        return self.gain * unit_size(self.gain_unit) * unit_size(self.unit)

    def is_a(self, quantity: str) -> bool:
        """Whether column times gain is a ``quantity`` (a key of the table of quantities above)."""
        factors = {QUANTITY_OF[self.unit], QUANTITY_OF[self.gain_unit]}
        return factors == {quantity, 'number'} or (quantity == 'force' and factors == {'pressure', 'area'})


@dataclass(frozen=True, kw_only=True)
class Combination(CheckedParameters):
    """Linear combination of columns: constant + sum of gain times column, in SI; ValueError if it is not finite."""

    terms: tuple[Term, ...] = ()
    constant: float = parameter(0.0, unit='SI', description='Constant part.')


@dataclass(frozen=True, kw_only=True)
class Rig(CheckedParameters):
    """Format of the logs of one rig.

    ValueError: a value is out of bounds, or the unit of a column does not fit its quantity.
    """

    name: str
    source: str = ''
    frame_id: str = 'rod'
    header: str = 'none'
    separator: str = 'auto'
    decimal: str = 'auto'
    skip_rows: int = parameter(0, unit='rows', lower=0, upper=10**9, description='Rows ignored at the beginning.')
    start: float = parameter(0.0, unit='s', lower=0.0, upper=2.0e9, description='Added to the time of each row.')
    rate: float = parameter(0.0, unit='Hz', lower=0.0, upper=1e6, description='Of the rows; 0: they have a time.')
    ambient_pressure: float = parameter(
        STANDARD_ATMOSPHERE, unit='Pa', lower=3e4, upper=1.2e5, description='Taken off absolute pressures.'
    )
    time: Term | None
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
        for name, choices in _CHOICES.items():
            if getattr(self, name) not in choices:
                raise ValueError(f'Rig.{name} = {getattr(self, name)!r} is not one of {", ".join(choices)}')
        if (self.time is None) == (not self.rate):
            raise ValueError('Rig.time: give the column of the time, or the rate of the rows, {rate: 500 Hz}')
        if not self.frame_id.isprintable() or len(self.frame_id) > 255:
            raise ValueError(f'Rig.frame_id = {self.frame_id[:_SHOWN]!r} is not up to 255 printable characters')
        if self.load == 'position' and self.position is None and self.savitzky_golay is None:
            raise ValueError('Rig.load = position but the rig file has no position: add the column of the position')
        wanted = _QUANTITIES | {'time': 'time', 'temperature': 'temperature'}
        wanted['velocity'] = 'velocity' if self.savitzky_golay is None else 'length'
        given = [name for name in REFERENCES if getattr(self, name) is not None]
        if given and self.reference_position is None and self.reference_velocity is None:
            raise ValueError(f'Rig.{given[0]} without reference_position or reference_velocity')
        for where, term in self.terms():
            quantity = wanted[where.split('.')[0]]
            if not term.is_a(quantity):
                units = f'{where}.unit = {term.unit!r} with gain_unit = {term.gain_unit!r}'
                raise ValueError(f'{units} is not a {quantity}: use one of {", ".join(QUANTITIES[quantity])}')
            if self.header == 'none' and term.column_name:
                raise ValueError(f'{where}.column_name = {term.column_name!r} but header = none: the log has no names')

    def terms(self) -> Iterator[tuple[str, Term]]:
        """Every term with its place in the rig file."""
        for part in (*PARTS, 'temperature', 'position', *REFERENCES):
            value = getattr(self, part)
            if isinstance(value, Term):
                yield part, value
            for number, term in enumerate(value.terms if isinstance(value, Combination) else ()):
                yield f'{part}.terms[{number}]', term

    @property
    def known_position(self) -> Combination | None:
        """Position of the rod: that of the rig file, or the one that the velocity is made from; None without either."""
        return self.velocity if self.position is None and self.savitzky_golay is not None else self.position


def read_rig(path: Path) -> Rig:
    """Rig from its file; ValueError, with file, field, value and bound, if it cannot be read or a value is invalid."""
    document = read_yaml(path)
    if not isinstance(document, Mapping):
        raise ValueError(f'{path}: a rig file is a mapping of names to values, not {type(document).__name__}')
    missing = [part for part in PARTS if part not in document]
    if missing:
        raise ValueError(f'{path}: rig file lacks {", ".join(missing)}')
    velocity, filter_values = _taken_out(document['velocity'], 'savitzky_golay')
    quantities = _QUANTITIES | {'velocity': 'velocity' if filter_values is None else 'length'}
    parts: dict[str, Any] = {
        part: _combination(velocity if part == 'velocity' else document[part], quantity, f'{path}: {part}')
        for part, quantity in quantities.items()
        if part in document
    }
    if 'temperature' in document:
        parts['temperature'] = _term(document['temperature'], f'{path}: temperature')
    rest = {key: value for key, value in document.items() if key not in ('time', 'sliding', *parts)}
    time, rate = _taken_out(document['time'], 'rate')
    parts['rate'] = 0.0 if rate is None else in_si(rate, 'Hz', f'{path}: time.rate')
    parts['time'] = None if rate is not None and not time else _term(time, f'{path}: time')
    parts['savitzky_golay'] = None
    if filter_values is not None:
        parts['savitzky_golay'] = from_mapping(SavitzkyGolay, filter_values, f'{path}: velocity.savitzky_golay')
    parts['sliding'] = from_mapping(Sliding, document.get('sliding', {}), f'{path}: sliding')
    return from_mapping(Rig, rest, str(path), **parts)


def _taken_out(values: Any, key: str) -> tuple[Any, Any]:
    """A mapping without ``key``, and the value there; anything else unchanged, for `from_mapping` to refuse."""
    if not isinstance(values, Mapping):
        return values, None
    return {k: v for k, v in values.items() if k != key}, values.get(key)


def _combination(document: Any, quantity: str, where: str) -> Combination:
    values, terms = _taken_out(document, 'terms')
    if terms is not None and not isinstance(terms, list):
        raise ValueError(f'{where}.terms = {terms!r} is not a list')
    if isinstance(values, Mapping) and not terms and 'constant' not in values:
        raise ValueError(f'{where} has neither terms nor a constant')
    made = tuple(_term(term, f'{where}.terms[{i}]') for i, term in enumerate(terms or ()))
    if isinstance(values, Mapping) and 'constant' in values:
        values = {**values, 'constant': in_si(values['constant'], QUANTITIES[quantity][0], f'{where}.constant')}
    return from_mapping(Combination, values, where, terms=made)


def _term(document: Any, where: str) -> Term:
    """Term of a document, whose gain may be a text with its unit."""
    if isinstance(document, Mapping) and isinstance(document.get('gain'), str) and 'gain_unit' not in document:
        number, unit = number_and_unit(document['gain']) or (document['gain'], '')
        document = {**document, 'gain': number, 'gain_unit': unit or '1'}
    return from_mapping(Term, document, where)
