"""Data sheet of the friction test plan of the thesis, Appendix A: make, check and read it.

A sheet is a CSV file of two tables: the dimensions, and the readings with one row per pressure and one column per test,
kind of friction and direction. A dash in a cell is a reading that could not be taken.
"""

import csv
import math
from collections.abc import Iterator, Mapping, Sequence
from html import escape
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from seal_friction_ros.core.foundation.parameters import from_mapping
from seal_friction_ros.core.foundation.units import UNITS, unit_size
from seal_friction_ros.core.friction.geometry import SealGeometry
from seal_friction_ros.core.identification.readings import FEWEST_PRESSURES, Noted
from seal_friction_ros.files import config_path, read_yaml

TITLE = 'seal friction data sheet'
PRESSURE_UNITS = ('psi', 'bar', 'MPa', 'kPa')
FORCE_UNITS = ('lbf', 'N', 'kN')
LENGTH_UNITS = ('in', 'mm')
KINDS = ('static', 'dynamic')
DIRECTIONS = {'retract': -1, 'extend': 1}
DIMENSIONS = ('gland_diameter', 'rod_diameter', 'ring_inner_diameter', 'section_diameter')
NOT_TAKEN = '-'
IMPLAUSIBLE_FACTOR = 2.0  # a reading beyond this factor above or below the others at its pressure (our choice)
MOST_SEALS = 20
_SHOWN = 4  # cells listed in an error

PROCEDURE = (
    'Measure rod, groove and ring, and write down the dimensions above.',
    'Ground one end; fasten the load cell, spring scale or weighted pulley to the other. Both ports share one line.',
    'Raise the pressure once, so that the seals seat; bleed the air; set the pressure of the first row.',
    'Wait 30 s.',
    'Retract slowly. Write down the force when it begins to move (static) and the force while it slides (dynamic).',
    'Wait 30 s. Extend slowly, and write down both forces.',
    'Raise the pressure to the next row and repeat, up to the last row.',
    'Repeat everything for each further test: this shows how well a reading repeats.',
)


class Plan(NamedTuple):
    """Readings to be taken."""

    seal_name: str
    pressures: tuple[float, ...]
    """in ``pressure_unit``, increasing"""
    tests: int
    seals: int
    """number of seals that share the pressure and whose friction is measured together"""
    pressure_unit: str = 'psi'
    force_unit: str = 'lbf'
    length_unit: str = 'in'
    geometry: SealGeometry | None = None
    """filled in, if known"""


class Sheet(NamedTuple):
    """A filled data sheet."""

    dynamic: Noted
    static: Noted
    chambers: tuple[str, ...]
    """one for each seal; they alternate, since both chambers have the same pressure"""
    seal_document: Mapping[str, Any]
    """name and geometry"""
    remarks: tuple[str, ...]


class Column(NamedTuple):
    """One column of readings."""

    test: int
    kind: str
    direction: str

    @property
    def title(self) -> str:
        """Its heading in the sheet."""
        return f'test {self.test} {self.kind} {self.direction}'


def columns(tests: int) -> list[Column]:
    """Columns of a sheet, in the order of the thesis."""
    return [Column(test, kind, side) for test in range(1, tests + 1) for kind in KINDS for side in DIRECTIONS]


def make_plan(
    seal_name: str,
    lowest: float,
    highest: float,
    steps: int,
    *,
    tests: int,
    seals: int,
    pressure_unit: str,
    force_unit: str,
    length_unit: str,
    geometry: SealGeometry | None,
) -> Plan:
    """Make a plan of evenly spaced pressures.

    Raises:
        ValueError: A value is invalid.
    """
    if not (math.isfinite(lowest) and math.isfinite(highest) and 0.0 <= lowest < highest):
        raise ValueError(f'pressures from {lowest:g} to {highest:g}: give a lowest one of at least 0 and a higher one')
    if not FEWEST_PRESSURES - 1 <= steps <= 100:
        raise ValueError(f'{steps} pressure steps: take {FEWEST_PRESSURES - 1} to 100')
    if not 1 <= tests <= 20:
        raise ValueError(f'{tests} tests: take 1 to 20, better three')
    if not 1 <= seals <= MOST_SEALS:
        raise ValueError(f'{seals} seals: take 1 to {MOST_SEALS}')
    if not seal_name or not seal_name.isprintable() or ',' in seal_name:
        raise ValueError(f'seal name {seal_name!r} is not one line of text without a comma')
    pressures = tuple(round(float(p), 9) for p in np.linspace(lowest, highest, steps + 1))
    return Plan(seal_name, pressures, tests, seals, pressure_unit, force_unit, length_unit, geometry)


def geometry_of_seal_file(seal: str) -> SealGeometry:
    """Geometry of a seal file: a path, or the name of one in config/seals.

    Raises:
        ValueError: The file cannot be read or has no valid geometry; names it.
    """
    path = config_path('seals', seal)
    document = read_yaml(path)
    if not isinstance(document, Mapping):
        raise ValueError(f'{path}: a seal file is a mapping of names to values')
    geometry: SealGeometry = from_mapping(SealGeometry, document.get('geometry'), f'{path}: geometry')
    return geometry


# -- the empty sheet --------------------------------------------------------------------------------------------------


def sheet_text(plan: Plan) -> str:
    """CSV of an empty sheet."""
    lines = [f'# {TITLE}', '# Fill in every empty cell; write a dash (-) for a reading that could not be taken.']
    lines += [f'# {number}. {step}' for number, step in enumerate(PROCEDURE, start=1)]
    lines += ['quantity,value,unit', f'seal,{plan.seal_name},', f'seals,{plan.seals},']
    lines += [f'{name},{_dimension(plan, name)},{plan.length_unit}' for name in DIMENSIONS]
    lines += [f'sliding_wall,{plan.geometry.sliding_wall if plan.geometry else "rod"},']
    modulus = f'{plan.geometry.elastic_modulus / 1e6:.6g}' if plan.geometry else ''
    lines += [f'elastic_modulus,{modulus},MPa', '']
    heads = [f'pressure [{plan.pressure_unit}]', *(f'{c.title} [{plan.force_unit}]' for c in columns(plan.tests))]
    lines += [','.join(heads)]
    empty = ',' * (len(heads) - 1)
    lines += [f'{pressure:.6g}{empty}' for pressure in plan.pressures]
    return '\n'.join(lines) + '\n'


def _dimension(plan: Plan, name: str) -> str:
    if plan.geometry is None:
        return ''
    return f'{getattr(plan.geometry, name) / unit_size(plan.length_unit):.6g}'


_CSS = """
@page { size: A4 landscape; margin: 12mm; }
body { font: 10pt/1.35 system-ui, 'DejaVu Sans', sans-serif; color: #000; max-width: 270mm; margin: 0 auto; }
h1 { font-size: 15pt; margin: 0 0 3mm; }
.top { display: flex; gap: 10mm; align-items: flex-start; }
.top > * { flex: 1; }
ol { margin: 0; padding-left: 5mm; }
table { border-collapse: collapse; width: 100%; margin: 4mm 0 0; }
.top table { margin: 0; }
th, td { border: 0.3mm solid #000; padding: 1mm 1.5mm; height: 5mm; font-size: 9pt; }
th { background: #eee; font-weight: 600; }
td:first-child { text-align: right; white-space: nowrap; }
.top td:first-child { text-align: left; }
.next { border-left-width: 0.8mm; }
"""


def sheet_page(plan: Plan) -> str:
    """The empty sheet as a page to print."""
    dimensions = ''.join(
        f'<tr><td>{escape(_spoken(name))} [{plan.length_unit}]</td><td>{_dimension(plan, name)}</td></tr>'
        for name in DIMENSIONS
    )
    extra = ''.join(f'<tr><td>{what}</td><td></td></tr>' for what in ('fluid, temperature', 'date, who'))
    steps = ''.join(f'<li>{escape(step)}</li>' for step in PROCEDURE)
    tests = ''.join(f'<th class="next" colspan="4">test {test}</th>' for test in range(1, plan.tests + 1))
    kinds = f'<th class="next" colspan="2">static [{plan.force_unit}]</th><th colspan="2">dynamic</th>' * plan.tests
    sides = '<th class="next">retract</th><th>extend</th><th>retract</th><th>extend</th>' * plan.tests
    cells = '<td class="next"></td><td></td><td></td><td></td>' * plan.tests
    rows = ''.join(f'<tr><td>{pressure:g}</td>{cells}</tr>' for pressure in plan.pressures)
    title = f'Seal friction data sheet: {plan.seal_name}'
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        f'<title>{escape(title)}</title><style>{_CSS}</style></head>\n<body>\n'
        f'<h1>{escape(title)}, {plan.seals} seal{"s" if plan.seals > 1 else ""}</h1>\n'
        f'<div class="top"><table>{dimensions}{extra}</table>\n<ol>{steps}</ol></div>\n'
        f'<table><thead><tr><th rowspan="3">pressure [{plan.pressure_unit}]</th>{tests}</tr><tr>{kinds}</tr>'
        f'<tr>{sides}</tr></thead><tbody>{rows}</tbody></table>\n</body></html>\n'
    )


def _spoken(name: str) -> str:
    return {
        'gland_diameter': 'gland seal groove inner diameter',
        'rod_diameter': 'piston rod outer diameter',
        'ring_inner_diameter': 'seal inner diameter',
        'section_diameter': 'seal thickness',
    }[name]


def write_sheet(plan: Plan, out: Path) -> tuple[Path, Path]:
    """Write an empty sheet as CSV and, beside it, as a page to print; returns both paths.

    Raises:
        ValueError: ``out`` exists already and may be filled in, or it cannot be written.
    """
    page = out.with_suffix('.html')
    if out.suffix != '.csv':
        raise ValueError(f'{out}: name it .csv; the page to print goes beside it as .html')
    try:
        with out.open('x', encoding='utf-8') as file:
            file.write(sheet_text(plan))
        page.write_text(sheet_page(plan), encoding='utf-8')
    except FileExistsError:
        raise ValueError(f'{out} exists already and may be filled in: not overwriting') from None
    except OSError as error:
        raise ValueError(f'{out}: cannot write it: {error.strerror}') from None
    return out, page


# -- the filled sheet -------------------------------------------------------------------------------------------------


def is_data_sheet(head: Sequence[str]) -> bool:
    """Whether a file that begins with these lines is a data sheet."""
    return bool(head) and TITLE in head[0].lower()


class _Row(NamedTuple):
    """One row of readings as written."""

    number: int
    """line number"""
    pressure: float
    """[Pa]"""
    cells: tuple[str, ...]


def read_data_sheet(path: Path) -> Sheet:
    """Read and check a filled sheet.

    Raises:
        ValueError: A dimension or reading is missing, out of order or implausible; one line that names it and says
            what to do.
    """
    try:
        text = path.read_text(encoding='utf-8-sig')
    except (OSError, UnicodeDecodeError) as error:
        raise ValueError(f'{path}: cannot be read as text: {error}') from None
    lines = list(_lines(text))
    start = next((i for i, (_, cells) in enumerate(lines) if cells[0].startswith('pressure')), None)
    if start is None:
        raise ValueError(f'{path}: not a data sheet: no row begins with pressure [unit]')
    quantities = {cells[0]: [*cells[1:], '', ''][:2] for _, cells in lines[:start]}
    chambers, document = _seal(path, quantities)
    order, pressure_unit, force_unit = _heads(path, lines[start][1])
    rows = [_row(path, number, cells, len(order), pressure_unit) for number, cells in lines[start + 1 :]]
    _check_pressures(path, rows, pressure_unit)
    readings = _readings(path, rows, order, force_unit, pressure_unit)
    _check_plausible(path, readings, force_unit, pressure_unit)
    skipped = sum(cell == NOT_TAKEN for row in rows for cell in row.cells)
    remarks = (f'{skipped} readings are marked as not taken',) if skipped else ()
    dynamic, static = (_noted(path, readings, kind) for kind in ('dynamic', 'static'))
    return Sheet(dynamic, static, chambers, document, remarks)


def _lines(text: str) -> Iterator[tuple[int, list[str]]]:
    for number, line in enumerate(text.splitlines(), start=1):
        if line.strip(' ,;\t') and not line.startswith('#'):
            separator = ';' if ';' in line and ',' not in line else ','
            yield number, [cell.strip() for cell in next(csv.reader([line], delimiter=separator))]


def _seal(path: Path, quantities: Mapping[str, list[str]]) -> tuple[tuple[str, ...], dict[str, Any]]:
    missing = [name for name in ('seal', 'seals', *DIMENSIONS) if not quantities.get(name, [''])[0]]
    if missing:
        raise ValueError(f'{path}: {", ".join(missing)} missing: fill in the dimensions')
    geometry: dict[str, Any] = {name: _dimension_in_si(path, name, *quantities[name]) for name in DIMENSIONS}
    wall = quantities.get('sliding_wall', [''])[0]
    geometry |= {'sliding_wall': wall} if wall else {}
    modulus = quantities.get('elastic_modulus', ['', ''])
    geometry |= {'elastic_modulus': _dimension_in_si(path, 'elastic_modulus', *modulus)} if modulus[0] else {}
    from_mapping(SealGeometry, geometry, f'{path}')
    count = quantities['seals'][0]
    if not count.isdigit() or not 1 <= int(count) <= MOST_SEALS:
        raise ValueError(f'{path}: seals is {count!r}, not a number from 1 to {MOST_SEALS}')
    chambers = tuple('ab'[i % 2] for i in range(int(count)))
    return chambers, {'name': quantities['seal'][0], 'geometry': geometry}


def _dimension_in_si(path: Path, name: str, value: str, unit: str) -> float:
    sizes = UNITS if name != 'elastic_modulus' else {key: UNITS[key] for key in ('Pa', 'kPa', 'MPa', 'psi')}
    if unit not in sizes:
        raise ValueError(f'{path}: {name} has the unit {unit!r}: use one of {", ".join(sizes)}')
    try:
        return round(float(value) * sizes[unit], 12)
    except ValueError:
        raise ValueError(f'{path}: {name} is {value[:40]!r}, not a number') from None


def _heads(path: Path, heads: Sequence[str]) -> tuple[list[Column], str, str]:
    units = [head.partition('[')[2].rstrip('] ') for head in heads]
    if units[0] not in PRESSURE_UNITS or any(unit not in FORCE_UNITS for unit in units[1:]) or len(set(units[1:])) != 1:
        raise ValueError(
            f'{path}: headings {", ".join(heads)[:200]}: the first needs one of [{"] [".join(PRESSURE_UNITS)}], the '
            f'others the same one of [{"] [".join(FORCE_UNITS)}]'
        )
    order = []
    for head in heads[1:]:
        words = head.partition('[')[0].split()
        good = len(words) == 4 and words[0] == 'test' and words[1].isdigit() and words[2] in KINDS
        if not good or words[3] not in DIRECTIONS:
            raise ValueError(f'{path}: column {head[:60]!r} is not test NUMBER static|dynamic retract|extend [unit]')
        order.append(Column(int(words[1]), words[2], words[3]))
    if len(set(order)) != len(order):
        raise ValueError(f'{path}: two columns have the same heading')
    return order, units[0], units[1]


def _row(path: Path, number: int, cells: Sequence[str], width: int, pressure_unit: str) -> _Row:
    if len(cells) > width + 1 and any(cells[width + 1 :]):
        raise ValueError(f'{path}: line {number}: {len(cells)} cells in {width + 1} columns')
    try:
        pressure = float(cells[0]) * unit_size(pressure_unit)
    except ValueError:
        raise ValueError(f'{path}: line {number}: pressure is {cells[0][:40]!r}, not a number') from None
    return _Row(number, pressure, tuple((list(cells[1:]) + [''] * width)[:width]))


def _check_pressures(path: Path, rows: Sequence[_Row], unit: str) -> None:
    for before, row in pairwise(rows):
        if not row.pressure > before.pressure:
            raise ValueError(
                f'{path}: line {row.number}: pressure {row.pressure / unit_size(unit):g} {unit} is not above '
                f'{before.pressure / unit_size(unit):g} {unit} in the previous row: the plan raises the pressure from '
                'row to row; sort the rows, or look for a typing error'
            )


class _Reading(NamedTuple):
    row: _Row
    column: Column
    force: float
    """[N]"""


def _readings(
    path: Path, rows: Sequence[_Row], order: Sequence[Column], force_unit: str, pressure_unit: str
) -> list[_Reading]:
    found, missing = [], []
    for row in rows:
        at = f'{row.pressure / unit_size(pressure_unit):g} {pressure_unit}'
        for column, cell in zip(order, row.cells, strict=True):
            if not cell:
                missing.append(f'{column.title} at {at}')
            elif cell != NOT_TAKEN:
                try:
                    force = float(cell)
                except ValueError:
                    force = math.nan
                if not 0.0 <= force < math.inf:
                    raise ValueError(f'{path}: line {row.number}: {column.title} at {at} is {cell[:40]!r}, not a force')
                found.append(_Reading(row, column, force * unit_size(force_unit)))
    if missing:
        more = f' and {len(missing) - _SHOWN} more' if len(missing) > _SHOWN else ''
        raise ValueError(
            f'{path}: {len(missing)} readings are missing: {"; ".join(missing[:_SHOWN])}{more}: measure them, or write '
            'a dash (-) for a reading that could not be taken'
        )
    return found


def _check_plausible(path: Path, readings: Sequence[_Reading], force_unit: str, pressure_unit: str) -> None:
    """Refuse a reading far from the others at its pressure, or a static force below the dynamic one."""
    by_place = {(r.row.number, r.column): r for r in readings}
    for reading in readings:
        row, column, force = reading
        others = [r.force for r in readings if r.row is row and r.column.kind == column.kind and r is not reading]
        middle = float(np.median(others)) if others else force
        static = by_place.get((row.number, column._replace(kind='static')))
        doubt = ''
        factor = IMPLAUSIBLE_FACTOR
        if len(others) >= 2 and middle > 0.0 and not middle / factor <= force <= factor * middle:
            doubt = (
                f'the other {column.kind} readings there are about {middle / unit_size(force_unit):.3g} {force_unit}'
            )
        elif column.kind == 'dynamic' and static is not None and static.force < force:
            doubt = f'the static one is less, {static.force / unit_size(force_unit):g} {force_unit}'
        if doubt:
            raise ValueError(
                f'{path}: line {row.number}: {column.title} at {row.pressure / unit_size(pressure_unit):g} '
                f'{pressure_unit} is {force / unit_size(force_unit):g} {force_unit}, but {doubt}: measure it again, or '
                'write a dash (-)'
            )


def _noted(path: Path, readings: Sequence[_Reading], kind: str) -> Noted:
    chosen = [r for r in readings if r.column.kind == kind]
    return Noted(
        path.name,
        np.array([r.column.test for r in chosen], dtype=np.int64),
        np.array([r.row.pressure for r in chosen], dtype=np.float64),
        np.array([DIRECTIONS[r.column.direction] for r in chosen], dtype=np.int64),
        np.array([r.force for r in chosen], dtype=np.float64),
        np.full(len(chosen), np.nan),
    )
