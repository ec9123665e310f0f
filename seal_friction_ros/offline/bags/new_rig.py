"""A first rig file from a log: separator, header, units and columns as its head shows them; the rest as comments.

All guesses are our choice: by the names and units in the header, and by the values.
"""

import json
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.foundation.units import QUANTITY_OF, unit_named, unit_size
from seal_friction_ros.core.machine.gauge_or_absolute import HIGHEST_AMBIENT, LOWEST_ABSOLUTE
from seal_friction_ros.offline.bags import log_table
from seal_friction_ros.offline.bags.log_table import Expected, Layout, split
from seal_friction_ros.offline.work.targets import mark

_NAMES = {
    'time': r't|time.*|zeit.*|timestamp.*',
    'pressure': r'p[ab12]?|p[ _.].*|.*press.*|.*druck.*',
    'force': r'f|f[ _.].*|.*force.*|.*load.*|.*kraft.*',
    'velocity': r'v|v[ _.].*|.*vel.*|.*speed.*|spd.*',
    'length': r'x|s|x[ _.].*|.*pos.*|.*stroke.*|.*weg.*',
    'temperature': r'temp.*|t_oil.*|.*temperatur.*',
}
"""Quantity -> names of its columns, in lower case and without unit."""
_USUAL = {
    'time': ('s', np.inf, ''),
    'pressure': ('bar', 1000.0, 'Pa'),
    'force': ('N', np.inf, ''),
    'velocity': ('m/s', 5.0, 'mm/s'),
    'length': ('m', 5.0, 'mm'),
    'temperature': ('degC', 200.0, 'K'),
}
"""Quantity -> its unit where the log names none, the largest number in it, and the unit of larger ones."""
_CHAMBER_B = re.compile(r'(b|2|rod|rod_side|annulus|retract|lower)$', re.IGNORECASE)
_REFERENCE = re.compile(r'(set|ref|desired|command|cmd|target|soll)', re.IGNORECASE)
_STEPS = 20  # samples in the window of a velocity from position


class _Column(NamedTuple):
    """What the head shows of one column."""

    number: int
    name: str
    quantity: str  # empty: not known
    unit: str
    is_guess: bool
    low: float
    high: float

    def term(self, **more: object) -> str:
        named = {'column_name': self.name} if self.name else {'column': self.number}
        fields = {**named, 'unit': self.unit, **more}
        return '{' + ', '.join(f'{key}: {json.dumps(value)}' for key, value in fields.items()) + '}'

    @property
    def said(self) -> str:
        """Range, and whether something is a guess."""
        return f'  # {self.low:.4g} to {self.high:.4g}' + ('; guess: the unit' if self.is_guess else '')


def new_rig(log: Path) -> str:
    """Text of a rig file for a log; ValueError if the log cannot be read, or its head has no rows of numbers."""
    head = log_table.head_of(log)
    rows = [text for _, text in head if not text.startswith('#')]
    first = next((number for number, text in enumerate(rows) if log_table.best(text)[0] > 0.5), None)
    if first is None:
        raise ValueError(f'{log}: no row of numbers in its first {len(head)} lines')
    kind = 'row' if first else 'comment' if head[0][1].startswith('#') else 'none'
    layout = log_table.find_layout(head, Expected(kind))
    values = log_table.numbers_in(head, layout, kind)
    units = _units_below(rows[:first], layout)
    columns = [_column(number, layout, units, column) for number, column in enumerate(values.T)]
    return '\n'.join(_lines(log, kind, columns, values)) + '\n'


def _units_below(above: Sequence[str], layout: Layout) -> list[str]:
    """Units in a line of their own, between the names and the first row; empty texts without."""
    cells = split(above[-1], layout.separator) if above else []
    units = [unit_named(f'x ({cell.strip("[]()")})') for cell in cells]
    return units if sum(map(bool, units)) * 2 > len(units) else []


def _column(number: int, layout: Layout, units: Sequence[str], values: FloatArray) -> _Column:
    given = layout.header[number] if number < len(layout.header) else ''
    name = given if layout.header.count(given) == 1 else ''
    finite = values[np.isfinite(values)]
    low, high = (float(finite.min()), float(finite.max())) if len(finite) else (np.nan, np.nan)
    unit = unit_named(name) or (units[number] if number < len(units) else '')
    bare = re.split(r'[\[({]', name)[0].strip().lower()
    named = (quantity for quantity, pattern in _NAMES.items() if bare and re.fullmatch(pattern, bare))
    quantity = QUANTITY_OF[unit] if unit else next(named, '')
    is_guess = bool(quantity) and not unit
    if is_guess:
        small, largest, large = _USUAL[quantity]
        unit = large if max(high, -low) > largest else small
    return _Column(number, name, quantity, unit, is_guess, low, high)


def _lines(log: Path, kind: str, columns: Sequence[_Column], values: FloatArray) -> list[str]:
    of = _by_quantity(columns)
    lines = [
        f'# Rig file, {mark("new")} rig from {log.name}. "guess": check it. "missing": give it.',
        '# docs/rig_files.md explains every key. Positive: extension.',
        f'name: {re.sub(r"[^A-Za-z0-9_]", "_", log.stem)}',
        f'source: {json.dumps(f"seal_friction new rig {log.name}")}',
        f'header: {kind}',
        'start: 1.0  # [s] a stamp of 0 would mean no stamp',
        _time(columns, of, values),
        *_chambers(of('pressure')),
        *_force_sum(of('force')),
        *_velocity(of('velocity'), of('length'), _step(columns, of, values)),
    ]
    lines += [f'temperature: {one.term()}{one.said}' for one in of('temperature')[:1]]
    used = {one.number for quantity in _NAMES for one in of(quantity)}
    rest = [one for one in columns if one.number not in used]
    unused = [f'{one.number} {one.name}'.strip() + f' ({one.low:.4g} to {one.high:.4g})' for one in rest]
    return lines + ([f'# columns that are not used: {", ".join(unused)}'] if unused else [])


def _by_quantity(columns: Sequence[_Column]) -> Callable[[str], list[_Column]]:
    """Measured columns of a quantity, in order; wanted motion is left out."""
    found: Mapping[str, list[_Column]] = {
        quantity: [one for one in columns if one.quantity == quantity and not _REFERENCE.search(one.name)]
        for quantity in _NAMES
    }
    return lambda quantity: found[quantity]


def _time_column(columns: Sequence[_Column], of: Callable[[str], list[_Column]], values: FloatArray) -> _Column | None:
    """Column of the time: named so, or the first that always increases."""
    rising = [one for one in columns if len(values) > 1 and (np.diff(values[:, one.number]) > 0.0).all()]
    return next((one for one in of('time') if one in rising), rising[0] if rising and not rising[0].quantity else None)


def _time(columns: Sequence[_Column], of: Callable[[str], list[_Column]], values: FloatArray) -> str:
    found = _time_column(columns, of, values)
    if found is None:
        return 'time: {rate: 100 Hz}  # missing: no column increases; the rate of the rows, or {column: 0, unit: s}'
    if not found.quantity:
        unit = 'ms' if float(np.median(np.diff(values[:, found.number]))) >= 1.0 else 's'
        return f'time: {found._replace(unit=unit).term()}  # guess: it increases, and its unit'
    return f'time: {found.term()}{found.said}'


def _step(columns: Sequence[_Column], of: Callable[[str], list[_Column]], values: FloatArray) -> float:
    """Time between two rows [s]."""
    found = _time_column(columns, of, values)
    if found is None:
        return 0.01
    size = unit_size(found.unit) if found.quantity == 'time' else 1.0
    return float(np.median(np.diff(values[:, found.number]))) * size


def _chambers(pressures: Sequence[_Column]) -> list[str]:
    """Both chambers: by the names of their columns, else in order."""
    sides: list[_Column | None] = [None, None]
    for one in pressures[:2]:
        side = int(bool(_CHAMBER_B.search(re.split(r'[\[({]', one.name)[0].strip()))) if len(pressures) > 1 else 0
        sides[side if sides[side] is None else 1 - side] = one
    is_vented = any(one.low * unit_size(one.unit) <= LOWEST_ABSOLUTE for one in pressures)
    lines = []
    for name, found in zip(('chamber_a', 'chamber_b'), sides, strict=True):
        if found is None:
            missing = 'missing: no column of a pressure' if name == 'chamber_a' else 'open to the air, or missing'
            lines.append(f'{name}: {{constant: 0.0}}  # {missing}')
            continue
        is_named = re.search(r'(abs|psia|bara)\W*$', found.name, re.IGNORECASE) is not None
        is_absolute = is_named or (not is_vented and found.low * unit_size(found.unit) <= HIGHEST_AMBIENT)
        why = '' if is_named or not is_absolute else '; guess: absolute, by the lowest'
        term = found.term(absolute=True) if is_absolute else found.term()
        lines.append(f'{name}: {{terms: [{term}]}}{found.said}{why}')
    return lines


def _force_sum(forces: Sequence[_Column]) -> list[str]:
    if not forces:
        return ['force_sum: {constant: 0.0}  # missing: no column of a force; pressure times area, and the load']
    return [
        f'force_sum: {{terms: [{forces[0].term()}]}}{forces[0].said}; guess: the sign, and that nothing is missing',
        '# with a load cell between rod and load add p_a A_a - p_b A_b: {column: 1, unit: bar, gain: 1256.6 mm2}',
    ]


def _velocity(velocities: Sequence[_Column], positions: Sequence[_Column], step: float) -> list[str]:
    if velocities:
        line = f'velocity: {{terms: [{velocities[0].term()}]}}{velocities[0].said}; guess: positive on extension'
        return [line, *(f'position: {{terms: [{one.term()}]}}{one.said}' for one in positions[:1])]
    if not positions:
        return ['velocity: {constant: 0.0}  # missing: no column of a velocity or a position']
    width = f'{{window: {_STEPS * step:.3g}, order: 2, largest_gap: {5.0 * step:.3g}}}'
    return [
        'velocity:',
        f'  terms: [{positions[0].term()}]{positions[0].said}; guess: positive on extension',
        f'  savitzky_golay: {width}  # guess: {_STEPS} samples',
    ]
