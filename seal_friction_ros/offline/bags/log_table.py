"""The table in a text file of a logger: lines before the header, any usual separator, decimal point or comma.

Nothing is lost in silence: a row that cannot be used is counted by its reason.
"""

import csv
import re
from array import array
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import chain, islice
from pathlib import Path
from typing import NamedTuple, TextIO

import numpy as np

from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.foundation.errors import named_errors
from seal_friction_ros.offline.bags.rig_file import SEPARATORS

LARGEST_DROPPED = 0.02  # of the rows: with more the log is refused; our choice
_LONGEST_LINE = 1 << 18  # characters
_HEAD = 1000  # lines in which header and first row are looked for
_SHOWN = 40  # characters of an invalid cell in an error message
_COMMA = re.compile(r'[-+]?\d*,\d+(?:[eE][-+]?\d+)?')

Lines = Iterator[tuple[int, str]]  # Number and text of each line, without empty ones.


class Expected(NamedTuple):
    """What a rig file says of the table."""

    header: str  # none, row, comment
    separator: str = 'auto'
    decimal: str = 'auto'
    skip_rows: int = 0


class Layout(NamedTuple):
    """How a table is written."""

    header: list[str]  # names of the columns; empty without a header
    separator: str | None  # of the cells, as `str.split` takes it
    has_decimal_comma: bool
    before: int = 0  # lines before the header


@dataclass
class Dropped:
    """Rows that cannot be used."""

    counts: Counter[str] = field(default_factory=Counter)  # reason -> number of rows
    first: str = ''  # what is wrong with the first of them

    def add(self, reason: str, text: str, count: int = 1) -> None:
        """Count rows; ``text`` names the place in the first one."""
        self.counts[reason] += count
        self.first = self.first or text

    def check(self, rows: int) -> None:
        """Check the share of all rows that cannot be used; ValueError if it is above `LARGEST_DROPPED`."""
        count = self.counts.total()
        if count > LARGEST_DROPPED * rows:
            share = f'{count} of {rows} rows cannot be used, at most {LARGEST_DROPPED:.0%} may be left out'
            raise ValueError(self.first if count == 1 else f'{self.first}; {share}')


class Table(NamedTuple):
    """The chosen columns of a table, n rows."""

    line_numbers: Sequence[int]
    columns: FloatArray  # shape (number of columns, n); NaN for an empty cell
    dropped: Dropped


def read_table(log: Path, columns: Sequence[tuple[str, int, str]], rig: Expected) -> Table:
    """Read columns of a log: place in the rig file, number and name of each; a name counts where it is not empty.

    ValueError: the log cannot be read or lacks a column; one line that names file and field or line.
    """
    with _opened(log) as lines:
        return _read(log, lines, columns, rig)


@contextmanager
def _opened(log: Path) -> Iterator[Lines]:
    """Lines of a log; ValueError, which names it, if it cannot be read as text."""
    if log.exists() and not (log.is_file() or log.is_dir()):  # a pipe or a device never ends
        raise ValueError(f'{log}: not a file')
    try:
        with named_errors(log, OSError), log.open(encoding='utf-8-sig') as file:
            yield _lines(file, log)
    except UnicodeDecodeError:
        raise ValueError(f'{log}: not a text file') from None


def head_of(log: Path) -> list[tuple[int, str]]:
    """Number and text of the first lines of a log, without empty ones; ValueError if it cannot be read as text."""
    with _opened(log) as lines:
        return list(islice(lines, _HEAD))


def numbers_in(head: Sequence[tuple[int, str]], layout: Layout, header: str) -> FloatArray:
    """Numbers of the rows in the first lines of a log, shape (n, columns); NaN for what is no number."""
    rows = [split(text, layout.separator) for _, text in _rows(head[layout.before :], layout, Expected(header))]
    width = len(layout.header) or len(rows[0])
    cells = [[cell.replace(',', '.') if layout.has_decimal_comma else cell for cell in row[:width]] for row in rows]
    whole = [[float(cell) if is_number(cell) else np.nan for cell in row] for row in cells if len(row) == width]
    return np.array(whole, dtype=np.float64).reshape(-1, width)


def _read(log: Path, lines: Lines, columns: Sequence[tuple[str, int, str]], rig: Expected) -> Table:
    head = list(islice(lines, _HEAD))
    names = [name for _, _, name in columns if name]
    known = find_layout(head, rig, names)
    rows = _rows(chain(head[known.before :], lines), known, rig)
    line_numbers, numbers, dropped = array('q'), array('d'), Dropped()
    width, positions = len(known.header), list[int]()
    for count, (number, text) in enumerate(rows):
        cells = split(text, known.separator)
        width = width or len(cells)
        if not positions:
            positions = [_position(log, column, known.header, width) for column in columns]
        if count < rig.skip_rows:
            continue
        try:
            numbers.extend(_numbers(cells, positions, width, known))
            line_numbers.append(number)
        except ValueError as error:
            reason = 'wrong number of cells' if 'columns instead' in str(error) else 'not a number'
            dropped.add(reason, f'{log}: line {number}: {error}')
    dropped.check(len(line_numbers) + dropped.counts.total())
    if not line_numbers:
        raise ValueError(f'{log}: no row of numbers in it after the {rig.skip_rows} rows that the rig file skips')
    table = np.frombuffer(numbers, dtype=np.float64).reshape(len(line_numbers), len(columns)).T
    return Table(line_numbers, table, dropped)


def _lines(file: TextIO, log: Path) -> Lines:
    number = 0
    while line := file.readline(_LONGEST_LINE):
        number += 1
        if len(line) == _LONGEST_LINE:
            raise ValueError(f'{log}: not a log: a line of more than {_LONGEST_LINE} characters')
        if line.strip():
            yield number, line.strip('\r\n ')


def _rows(lines: Iterable[tuple[int, str]], layout: Layout, rig: Expected) -> Lines:
    """Rows after the header; units in the line below the names are passed over."""
    rows = ((number, text) for number, text in lines if not text.startswith('#'))
    is_begun = rig.header != 'row' or rig.skip_rows > 0
    for number, text in rows:
        is_begun = is_begun or _share_of_numbers(split(text, layout.separator)) > 0.5
        if is_begun:
            yield number, text


def find_layout(head: Sequence[tuple[int, str]], rig: Expected, names: Sequence[str] = ()) -> Layout:
    """Header, separator and decimal mark of a table from its first lines; ``names`` are those of the wanted columns.

    The separator is the one that makes most of the cells of the first row numbers, that of the header first. The header
    has all of the ``names``.
    """
    plain = [place for place, (_, text) in enumerate(head) if not text.startswith('#')]
    first = next((place for place in plain if best(head[place][1])[0] > 0.5), plain[0] if plain else len(head))
    before, header = _header(head, first, rig, names)
    later = [head[place][1] for place in plain if place >= max(first, before)]
    separator = SEPARATORS.get(rig.separator)
    if rig.separator == 'auto' and later:
        marks = [mark for mark in SEPARATORS.values() if mark and mark in header and mark in later[0]]
        same = [m for m in marks if len(split(header, m)) == len(split(later[0], m))]
        separator = same[0] if same else best(later[0])[1]
    cells = [cell for text in later for cell in split(text, separator)] if separator != ',' or '"' in later[0] else []
    has_comma = any(map(_COMMA.fullmatch, cells)) and not any('.' in cell and is_number(cell) for cell in cells)
    if rig.decimal != 'auto':
        has_comma = rig.decimal == 'comma'
    found = [] if not header else split(header, _separator_of(header, separator))
    while found and not found[-1]:  # a line that ends with a separator
        found.pop()
    return Layout(found, separator, has_comma, before)


def _header(head: Sequence[tuple[int, str]], first: int, rig: Expected, names: Sequence[str]) -> tuple[int, str]:
    """Number of lines up to the end of the header, and its text."""
    if rig.header == 'none' or not head:
        return 0, ''
    if rig.header == 'comment':
        comments = [text.lstrip('#').strip() for _, text in head[:first] if text.startswith('#')]
        return 0, comments[-1] if comments else ''
    rows = [place for place, (_, text) in enumerate(head) if not text.startswith('#')]
    with_names = (
        place for place in rows if names and {*names} <= {*split(head[place][1], _separator_of(head[place][1]))}
    )
    above = [place for place in rows if place < first]
    place = next(with_names, above[-1] if above else rows[0] if rows else 0)
    return place + 1, head[place][1]


def _separator_of(header: str, of_rows: str | None = None) -> str | None:
    """Separator of the names: that of the rows, else the first usual one."""
    marks = ([of_rows] if of_rows else []) + [';', '\t', ',']
    return next((mark for mark in marks if mark in header), None)


def best(text: str) -> tuple[float, str | None]:
    """Largest share of numbers in a line, and the separator of cells that gives it."""
    found = [(split(text, mark), mark) for mark in SEPARATORS.values() if mark is None or mark in text]
    cells, mark = max(found, key=lambda one: (_share_of_numbers(one[0]), -len(one[0])))
    return _share_of_numbers(cells), mark


def split(text: str, separator: str | None) -> list[str]:
    """Cells of a line; quotes around a cell are taken off."""
    if separator is not None and '"' in text:
        return [cell.strip() for cell in next(csv.reader([text], delimiter=separator, skipinitialspace=True))]
    return [cell.strip().strip('"\'') for cell in text.split(separator)]


def is_number(cell: str) -> bool:
    """Whether a cell is a number, with a decimal point or comma."""
    try:
        float(cell)
    except ValueError:
        return _COMMA.fullmatch(cell) is not None
    return True


def _share_of_numbers(cells: Sequence[str]) -> float:
    """Share of the cells with a content that are numbers."""
    filled = [cell for cell in cells if cell]
    return sum(map(is_number, filled)) / max(len(filled), 1)


def _position(log: Path, column: tuple[str, int, str], header: list[str], width: int) -> int:
    """Number of a column; ValueError if there is no such column, or several."""
    where, number, name = column
    if not name:
        if number >= width:
            raise ValueError(f'{log}: rig file names {where}.column = {number}, but the log has 0 to {width - 1}')
        return number
    found = [i for i, one in enumerate(header) if one == name]
    if len(found) != 1:
        times = f'found {len(found)} times in the header: {", ".join(header)[:1000]}'
        raise ValueError(f'{log}: rig file names {where}.column_name = {name!r}, {times}')
    return found[0]


def _numbers(cells: list[str], positions: Sequence[int], width: int, layout: Layout) -> list[float]:
    if len(cells) > width and not any(cells[width:]):  # a row that ends with a separator
        cells = cells[:width]
    if len(cells) != width:
        hint = 'set header, separator or decimal in the rig file if that is wrong'
        raise ValueError(f'{len(cells)} columns instead of {width}: separator {layout.separator or "space"!r}; {hint}')
    numbers = []
    for position in positions:
        cell = cells[position].replace(',', '.') if layout.has_decimal_comma else cells[position]
        try:
            numbers.append(float(cell or 'nan'))
        except ValueError:
            name = f' ({layout.header[position]})' if layout.header else ''
            hint = 'set header, skip_rows or decimal in the rig file'
            shown = repr(cells[position][:_SHOWN])
            raise ValueError(f'column {position}{name} is {shown}, not a number: {hint}') from None
    return numbers
