"""Data sheet of the friction test plan of the thesis, Appendix A: make an empty one, read and check a filled one.

A sheet is a CSV file of two tables: the dimensions, and the readings with one row per pressure and one column per test,
kind of friction and direction. A dash in a cell marks a reading that could not be taken. If speeds are planned, the
second column is the speed, and there is one row per pressure and speed.
"""

import csv
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from seal_friction_ros.core.foundation.parameters import from_mapping
from seal_friction_ros.core.foundation.units import UNITS, unit_size
from seal_friction_ros.core.friction.geometry import SealGeometry
from seal_friction_ros.core.identification.readings import FEWEST_PRESSURES, ManualReadings
from seal_friction_ros.files import config_path, read_yaml

TITLE = 'seal friction data sheet'
PRESSURE_UNITS = ('bar', 'MPa', 'kPa', 'psi')
FORCE_UNITS = ('N', 'kN', 'lbf')
SPEED_UNITS = ('mm/s', 'm/s', 'in/s')
KINDS = ('static', 'dynamic')
DIRECTIONS = {'retract': -1, 'extend': 1}
DIMENSIONS = {
    'gland_diameter': 'gland seal groove inner diameter',
    'rod_diameter': 'piston rod outer diameter',
    'ring_inner_diameter': 'seal inner diameter',
    'section_diameter': 'seal thickness',
}
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


@dataclass(frozen=True)
class FrictionTestPlan:
    """Readings to be taken, at evenly spaced pressures or at given pressures and speeds.

    ValueError: a value is invalid.
    """

    seal_name: str
    lowest: float  # pressure in ``pressure_unit``
    highest: float  # pressure in ``pressure_unit``
    steps: int  # between the pressures
    tests: int
    seals: int  # number of seals that share the pressure and whose friction is measured together
    pressure_unit: str = 'bar'
    force_unit: str = 'N'
    length_unit: str = 'mm'
    geometry: SealGeometry | None = None  # filled in, if known
    points: tuple[tuple[float, float], ...] = ()
    """pressure and speed of each row, in place of evenly spaced pressures at any speed; increasing"""
    speed_unit: str = 'mm/s'
    notes: tuple[str, ...] = ()  # lines above the procedure

    def __post_init__(self) -> None:
        low, high, name = self.lowest, self.highest, self.seal_name
        if not self.points and not 0.0 <= low < high < math.inf:
            raise ValueError(f'pressures from {low:g} to {high:g}: give a lowest one of at least 0 and a higher one')
        if list(self.points) != sorted(set(self.points)) or any(p < 0.0 or not v > 0.0 for p, v in self.points):
            raise ValueError(
                'rows of pressure and speed: sort them, each once, pressures of at least 0, speeds above 0'
            )
        steps = {} if self.points else {'pressure steps': (self.steps, FEWEST_PRESSURES - 1, 100)}
        counts = {**steps, 'tests': (self.tests, 1, 20)}
        for what, (count, least, most) in {**counts, 'seals': (self.seals, 1, MOST_SEALS)}.items():
            if not least <= count <= most:
                raise ValueError(f'{count} {what}: give {least} to {most}')
        if not name or not name.isprintable() or ',' in name:
            raise ValueError(f'seal name {name!r} is not one line of text without a comma')

    @classmethod
    def at_points(cls, seal_name: str, points: Sequence[tuple[float, float]], **others: Any) -> 'FrictionTestPlan':
        """Plan of rows of pressure and speed, in any order; ``others`` are fields of the plan."""
        rows = tuple(sorted(set(points)))
        ends = (rows[0][0], rows[-1][0]) if rows else (0.0, 0.0)
        return cls(seal_name, *ends, max(len(rows) - 1, 0), points=rows, **others)

    @property
    def rows(self) -> list[tuple[float, ...]]:
        """First cells of each row: pressure in ``pressure_unit``, and speed in ``speed_unit`` if it is planned."""
        if self.points:
            return [*self.points]
        return [(round(float(p), 9),) for p in np.linspace(self.lowest, self.highest, self.steps + 1)]

    @property
    def row_heads(self) -> list[str]:
        """Headings of the first cells of a row."""
        return [f'pressure [{self.pressure_unit}]', *([f'speed [{self.speed_unit}]'] if self.points else [])]

    @property
    def procedure(self) -> list[str]:
        """Steps of the test."""
        return [step.replace(' slowly', ' at the speed of the row') if self.points else step for step in PROCEDURE]

    def dimension(self, name: str) -> str:
        """Dimension in ``length_unit`` as text; empty if the geometry is unknown."""
        return '' if self.geometry is None else f'{getattr(self.geometry, name) / unit_size(self.length_unit):.6g}'


class DataSheet(NamedTuple):
    """A filled data sheet."""

    dynamic: ManualReadings
    static: ManualReadings
    chambers: tuple[str, ...]  # of each seal; they alternate, since both chambers have the same pressure
    seal_document: Mapping[str, Any]  # name and geometry
    remarks: tuple[str, ...]


class SheetColumn(NamedTuple):
    """One column of readings."""

    test: int
    kind: str
    direction: str

    @property
    def title(self) -> str:
        """Its heading in the sheet."""
        return f'test {self.test} {self.kind} {self.direction}'


def columns(tests: int) -> list[SheetColumn]:
    """Columns of a sheet, in the order of the thesis."""
    return [SheetColumn(test, kind, side) for test in range(1, tests + 1) for kind in KINDS for side in DIRECTIONS]


def geometry_of_seal_file(seal: str) -> tuple[SealGeometry, Mapping[str, Any]]:
    """Geometry in a seal file (a path, or the name of one in config/seals), and its whole document.

    ValueError: the file cannot be read or has no valid geometry; names it.
    """
    path = config_path('seals', seal)
    document = read_yaml(path)
    if not isinstance(document, Mapping) or 'geometry' not in document:
        raise ValueError(f'{path}: no geometry: measure ring and groove and add them to the file')
    return from_mapping(SealGeometry, document['geometry'], f'{path}: geometry'), document


def sheet_text(plan: FrictionTestPlan) -> str:
    """CSV of an empty sheet."""
    geometry = plan.geometry
    readings = [f'{c.title} [{plan.force_unit}]' for c in columns(plan.tests)]
    lines = [
        f'# {TITLE}',
        '# Fill in every empty cell; write a dash (-) for a reading that could not be taken.',
        *(f'# {note}' for note in plan.notes),
        *(f'# {number}. {step}' for number, step in enumerate(plan.procedure, start=1)),
        'quantity,value,unit',
        f'seal,{plan.seal_name},',
        f'seals,{plan.seals},',
        *(f'{name},{plan.dimension(name)},{plan.length_unit}' for name in DIMENSIONS),
        f'sliding_wall,{geometry.sliding_wall if geometry else "rod"},',
        f'elastic_modulus,{f"{geometry.elastic_modulus / 1e6:.6g}" if geometry else ""},MPa',
        '',
        ','.join([*plan.row_heads, *readings]),
        *(','.join(f'{value:.6g}' for value in row) + ',' * len(readings) for row in plan.rows),
    ]
    return '\n'.join(lines) + '\n'


def write_sheet(plan: FrictionTestPlan, out: Path) -> None:
    """Write an empty sheet as CSV; raises what `write_new_csv` raises."""
    write_new_csv(sheet_text(plan), out, 'the page to print goes beside it as .html')


def write_new_csv(text: str, out: Path, hint: str = '') -> None:
    """Write a CSV file that a person works on; the error about another suffix adds the ``hint``.

    ValueError: ``out`` exists already and may be filled in, or it cannot be written.
    """
    if out.suffix != '.csv':
        raise ValueError(f'{out}: name it .csv{hint and f"; {hint}"}')
    try:
        with out.open('x', encoding='utf-8') as file:
            file.write(text)
    except FileExistsError:
        raise ValueError(f'{out} exists already and may be filled in: not overwriting') from None
    except OSError as error:
        raise ValueError(f'{out}: cannot write it: {error.strerror}') from None


class _Reading(NamedTuple):
    """One filled cell; pressure, speed and force in the units of the sheet."""

    place: str  # file and line
    pressure: float
    column: SheetColumn
    force: float
    speed: float  # NaN if the sheet has no speeds


def read_data_sheet(path: Path) -> DataSheet:
    """Read and check a filled sheet.

    ValueError: a dimension or reading is missing, out of order or implausible; one line that names it and says what to
    do.
    """
    lines = []
    for number, line in enumerate(read_text(path).splitlines(), start=1):
        if line.strip(' ,;\t') and not line.startswith('#'):
            separator = ';' if ';' in line and ',' not in line else ','
            lines.append((number, [cell.strip() for cell in next(csv.reader([line], delimiter=separator))]))
    start = next((i for i, (_, cells) in enumerate(lines) if cells[0].startswith('pressure')), None)
    if start is None:
        raise ValueError(f'{path}: not a data sheet: no row begins with pressure [unit]')
    chambers, document = _seal(path, {cells[0]: [*cells[1:], '', ''][:2] for _, cells in lines[:start]})
    speed_unit, heads = _speed_unit(path, lines[start][1])
    order, pressure_unit, force_unit = _heads(path, heads)
    rows = lines[start + 1 :]
    readings = _readings(path, rows, order, pressure_unit, speed_unit)
    _check_plausible(readings, pressure_unit, force_unit)
    skipped = sum(cell == NOT_TAKEN for _, cells in rows for cell in cells[1 : len(order) + 1 + bool(speed_unit)])
    remarks = (f'{skipped} readings are marked as not taken',) if skipped else ()

    def manual(kind: str) -> ManualReadings:
        """Readings of one kind, in SI units."""
        chosen = [(r.column.test, r.pressure, DIRECTIONS[r.column.direction], r.force, r.speed)
                  for r in readings if r.column.kind == kind]  # fmt: skip
        test, pressure, direction, force, speed = np.array(chosen, dtype=np.float64).reshape(-1, 5).T
        pressure, force = pressure * unit_size(pressure_unit), force * unit_size(force_unit)
        speed = speed * unit_size(speed_unit or '1')
        return ManualReadings(path.name, test.astype(int), pressure, direction.astype(int), force, speed)

    return DataSheet(manual('dynamic'), manual('static'), chambers, document, remarks)


def read_text(path: Path) -> str:
    """Text of a file. ValueError: it cannot be read as text; names it."""
    try:
        return path.read_text(encoding='utf-8-sig')
    except (OSError, UnicodeDecodeError) as error:
        raise ValueError(f'{path}: cannot be read as text: {error}') from None


def parse_number(text: str, what: str) -> float:
    """Number of a cell. ValueError: it is not a number; begins with ``what``."""
    try:
        return float(text)
    except ValueError:
        raise ValueError(f'{what} is {text[:40]!r}, not a number') from None


def _seal(path: Path, quantities: Mapping[str, list[str]]) -> tuple[tuple[str, ...], dict[str, Any]]:
    missing = [name for name in ('seal', 'seals', *DIMENSIONS) if not quantities.get(name, [''])[0]]
    if missing:
        raise ValueError(f'{path}: {", ".join(missing)} missing: fill in the dimensions')
    geometry: dict[str, Any] = {}
    for name in (*DIMENSIONS, 'elastic_modulus'):
        value, unit = quantities.get(name, ('', ''))
        sizes = UNITS if name in DIMENSIONS else {key: UNITS[key] for key in ('Pa', 'kPa', 'MPa', 'psi')}
        if value and unit not in sizes:
            raise ValueError(f'{path}: {name} has the unit {unit!r}: use one of {", ".join(sizes)}')
        if value:
            geometry[name] = round(parse_number(value, f'{path}: {name}') * sizes[unit], 12)
    wall = quantities.get('sliding_wall', [''])[0]
    geometry |= {'sliding_wall': wall} if wall else {}
    from_mapping(SealGeometry, geometry, f'{path}')
    count = quantities['seals'][0]
    if not count.isdigit() or not 1 <= int(count) <= MOST_SEALS:
        raise ValueError(f'{path}: seals is {count!r}, not a number from 1 to {MOST_SEALS}')
    return tuple('ab'[i % 2] for i in range(int(count))), {'name': quantities['seal'][0], 'geometry': geometry}


def _speed_unit(path: Path, heads: Sequence[str]) -> tuple[str, list[str]]:
    """Unit of the speeds, empty if the sheet has none, and the headings without that of the speed."""
    if len(heads) < 2 or not heads[1].startswith('speed'):
        return '', list(heads)
    unit = heads[1].partition('[')[2].rstrip('] ')
    if unit not in SPEED_UNITS:
        raise ValueError(f'{path}: heading {heads[1][:60]!r}: it needs one of [{"] [".join(SPEED_UNITS)}]')
    return unit, [heads[0], *heads[2:]]


def _heads(path: Path, heads: Sequence[str]) -> tuple[list[SheetColumn], str, str]:
    """Columns of the readings, unit of the pressures, unit of the forces."""
    units = [head.partition('[')[2].rstrip('] ') for head in heads]
    if units[0] not in PRESSURE_UNITS or len(set(units[1:])) != 1 or units[1] not in FORCE_UNITS:
        raise ValueError(
            f'{path}: headings {", ".join(heads)[:200]}: the first needs one of [{"] [".join(PRESSURE_UNITS)}], the '
            f'others the same one of [{"] [".join(FORCE_UNITS)}]'
        )
    order = []
    for head in heads[1:]:
        found = re.fullmatch(r'test\s+(\d+)\s+(static|dynamic)\s+(retract|extend)\s*', head.partition('[')[0])
        if not found:
            raise ValueError(f'{path}: column {head[:60]!r} is not test NUMBER static|dynamic retract|extend [unit]')
        order.append(SheetColumn(int(found[1]), found[2], found[3]))
    if len(set(order)) != len(order):
        raise ValueError(f'{path}: two columns have the same heading')
    return order, units[0], units[1]


def _readings(
    path: Path, rows: Sequence[tuple[int, Sequence[str]]], order: Sequence[SheetColumn], unit: str, speed_unit: str
) -> list[_Reading]:
    """Readings of ``rows``: line number and cells of each, of which the second is a speed if there is a unit of it."""
    found: list[_Reading] = []
    missing: list[str] = []
    before: tuple[float, set[float]] = -math.inf, set()
    for number, (head, *others) in rows:
        place = f'{path}: line {number}'
        speed_text, cells = (''.join(others[:1]), others[1:]) if speed_unit else ('', others)
        if any(cells[len(order) :]):
            raise ValueError(f'{place}: {len(others) + 1} cells in {len(order) + 1 + bool(speed_unit)} columns')
        pressure = parse_number(head, f'{place}: pressure')
        speed = parse_number(speed_text, f'{place}: speed') if speed_unit else math.nan
        before = _row_in_order(place, (pressure, speed), before, unit, speed_unit)
        for column, cell in zip(order, [*cells, *[''] * len(order)], strict=False):
            where = f'{column.title} at {pressure:g} {unit}{f" and {speed:g} {speed_unit}" if speed_unit else ""}'
            if not cell:
                missing.append(where)
            elif cell != NOT_TAKEN:
                force = parse_number(cell, f'{place}: {where}')
                if not 0.0 <= force < math.inf:
                    raise ValueError(f'{place}: {where} is {cell[:40]!r}, not a magnitude of a force')
                found.append(_Reading(place, pressure, column, force, speed))
    if missing:
        more = f' and {len(missing) - _SHOWN} more' if len(missing) > _SHOWN else ''
        raise ValueError(
            f'{path}: {len(missing)} readings are missing: {"; ".join(missing[:_SHOWN])}{more}: measure them, or write '
            'a dash (-) for a reading that could not be taken'
        )
    return found


def _row_in_order(
    place: str, row: tuple[float, float], before: tuple[float, set[float]], unit: str, speed_unit: str
) -> tuple[float, set[float]]:
    """Pressure of a ``row`` of pressure and speed, and the speeds there so far, as ``before`` the row."""
    (pressure, speed), (pressure_before, speeds) = row, before
    if speed_unit and not 0.0 < speed < math.inf:
        raise ValueError(f'{place}: the speed is {speed:g} {speed_unit}: give its magnitude, above 0')
    if pressure > pressure_before:
        return pressure, {speed}
    if speed_unit and pressure == pressure_before and speed not in speeds:
        return pressure, {*speeds, speed}
    again = f' and {speed:g} {speed_unit} once more' if speed_unit and pressure == pressure_before else ''
    raise ValueError(
        f'{place}: pressure {pressure:g} {unit}{again} is not above {pressure_before:g} {unit} in the previous row: '
        'the plan raises the pressure from row to row; sort the rows, or look for a typing error'
    )


def _check_plausible(readings: Sequence[_Reading], pressure_unit: str, unit: str) -> None:
    """Reject a reading far from the others at its pressure, or a static force below the dynamic one."""
    static = {(r.place, r.column[::2]): r.force for r in readings if r.column.kind == 'static'}
    for reading in readings:
        place, pressure, column, force, _ = reading
        at_pressure = [r for r in readings if r.place == place and r is not reading]  # one row, so one speed
        others = [r.force for r in at_pressure if r.column.kind == column.kind]
        middle = float(np.median(others)) if others else force
        static_force = static.get((place, column[::2]), force)
        doubt = ''
        if len(others) >= 2 and middle > 0.0 and not 1.0 / IMPLAUSIBLE_FACTOR <= force / middle <= IMPLAUSIBLE_FACTOR:
            doubt = f'the other {column.kind} readings there are about {middle:.3g} {unit}'
        elif column.kind == 'dynamic' and static_force < force:
            doubt = f'the static one is less, {static_force:g} {unit}'
        if doubt:
            raise ValueError(
                f'{place}: {column.title} at {pressure:g} {pressure_unit} is {force:g} {unit}, but {doubt}: measure it '
                'again, or write a dash (-)'
            )
