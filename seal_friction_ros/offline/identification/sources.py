"""Sources of friction readings: bags, logs of a rig, tables of noted readings, filled data sheets.

The kind of a source is found from the file itself, so a command takes any of them in any number.
"""

import csv
import hashlib
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from seal_friction_ros.core.estimation.configuration import parse_snapshot
from seal_friction_ros.core.estimation.messages import FORCE_TYPE, PRESSURE_TYPE, VELOCITY_TYPE, decode, decode_text
from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.foundation.parameters import from_mapping
from seal_friction_ros.core.foundation.units import UNITS
from seal_friction_ros.core.identification.readings import (
    Measurement,
    Noted,
    Prepared,
    check_clipping,
    prepare_noted,
    prepare_signals,
)
from seal_friction_ros.core.identification.signal_preparation import Signals, Sliding
from seal_friction_ros.files import config_path, share_directory
from seal_friction_ros.offline.bags.bag import BagMessage, bag_topics, read_messages
from seal_friction_ros.offline.bags.import_log import Rig, read_rig, read_samples
from seal_friction_ros.offline.bags.topics import Topics, find_topics
from seal_friction_ros.offline.identification.data_sheet import is_data_sheet, read_data_sheet
from seal_friction_ros.offline.work.progress import progress

DIRECTIONS = {'extend': 1, 'ext': 1, '1': 1, '+1': 1, 'retract': -1, 'ret': -1, '-1': -1}
KINDS = ('dynamic', 'static')
PRESSURE_UNITS = {'psig': 'psi', 'psi': 'psi', 'bar': 'bar', 'kpa': 'kPa', 'mpa': 'MPa', 'pa': 'Pa'}
FRICTION_UNITS = {'lbf': 'lbf', 'n': 'N', 'kn': 'kN'}
VELOCITY_UNITS = {'m_per_s': 'm/s', 'mm_per_s': 'mm/s', 'in_per_s': 'in/s'}


@dataclass(frozen=True, kw_only=True)
class SourceOptions:
    """Options on the sources; None leaves a value to the sources themselves."""

    rig: str | None = None
    """rig file of the logs: a path, or the name of one in config/rigs"""
    chambers: tuple[str, ...] | None = None
    """chamber that each seal sees"""
    namespace: str = ''
    """of a bag: use only topics below it"""
    slowest: float | None = None
    """[m/s] see `Sliding`"""
    largest_acceleration: float | None = None
    """[m/s^2] see `Sliding`"""


class DataFile(NamedTuple):
    """Name and digest of a source, for the seal file."""

    name: str
    sha256: str


@dataclass(frozen=True, eq=False)
class Sources:
    """Contents of all sources."""

    files: tuple[DataFile, ...]
    chambers: tuple[str, ...]
    """chamber that each seal sees"""
    measurements: tuple[Measurement, ...] = ()
    dynamic: tuple[Noted, ...] = ()
    static: tuple[Noted, ...] = ()
    seal_document: Mapping[str, Any] | None = None
    """seal file that a bag or a data sheet carries"""
    remarks: tuple[str, ...] = ()
    """assumptions that no source or option states"""

    def prepare(self, index: Sequence[int] | None = None) -> Prepared:
        """Readings of all sources, or of those numbered in ``index``.

        Raises:
            ValueError: They are unfit for identification.
        """
        chosen = range(len(self.files)) if index is None else index
        if self.measurements:
            return prepare_signals([self.measurements[i] for i in chosen], self.chambers)
        static = [self.static[i] for i in chosen if len(self.static[i].friction)]
        return prepare_noted([self.dynamic[i] for i in chosen], static, len(self.chambers))


@dataclass(frozen=True, eq=False)
class _Source:
    """Contents of one source."""

    file: DataFile
    chambers: tuple[str, ...] | None
    measurement: Measurement | None = None
    dynamic: Noted | None = None
    static: Noted | None = None
    seal_document: Mapping[str, Any] | None = None
    remarks: tuple[str, ...] = field(default=())


def read_sources(paths: Sequence[Path], options: SourceOptions) -> Sources:
    """Read every source.

    Args:
        paths: Bags, logs, tables or data sheets; logs and bags may be mixed, and tables and sheets.
        options: Options on them.

    Raises:
        ValueError: A source cannot be read, is of no known kind, or does not fit the others; one line that names it.
    """
    if not paths:
        raise ValueError('no source: give a bag, a log or a table')
    twice = sorted({str(path) for path in paths if list(paths).count(path) > 1})
    if twice:
        raise ValueError(f'{twice[0]} is named twice')
    read = [_read(path, options) for path in paths]
    signals = [source.measurement for source in read if source.measurement is not None]
    if signals and len(signals) < len(read):
        raise ValueError('noted readings and recorded signals cannot be fitted together: identify each separately')
    chambers, remark = _chambers(read, options)
    documents = [source.seal_document for source in read if source.seal_document is not None]
    return Sources(
        tuple(source.file for source in read),
        chambers,
        tuple(signals),
        tuple(source.dynamic for source in read if source.dynamic is not None),
        tuple(source.static for source in read if source.static is not None),
        documents[0] if documents else None,
        tuple(dict.fromkeys([*(r for source in read for r in source.remarks), *remark])),
    )


def _chambers(read: Sequence[_Source], options: SourceOptions) -> tuple[tuple[str, ...], list[str]]:
    """Chamber of each seal: from the options, else from the sources, else one seal for each chamber under pressure."""
    if options.chambers is not None:
        return options.chambers, []
    stated = {source.chambers for source in read if source.chambers is not None}
    if len(stated) > 1:
        texts = ' and '.join(sorted(','.join(chambers) for chambers in stated))
        raise ValueError(f'the sources have seals on different chambers ({texts}): give them with --seal-chambers')
    if stated:
        return stated.pop(), []
    parts = [source.measurement.signals for source in read if source.measurement is not None]
    found = tuple(
        name
        for name, column in (('a', 'pressure_a'), ('b', 'pressure_b'))
        if any(np.nanmax(np.abs(getattr(signals, column)), initial=0.0) > 0.0 for signals in parts)
    ) or ('a',)
    assumed = 'one seal for each chamber under pressure' if parts else 'one seal with all friction'
    return found, [f'{assumed} is assumed: {",".join(found)}; give others with --seal-chambers']


def _read(path: Path, options: SourceOptions) -> _Source:
    if path.is_dir() or path.suffix == '.mcap':
        return _read_bag(path, options)
    try:
        with path.open(encoding='utf-8-sig') as file:
            head = [line for line in (file.readline() for _ in range(50)) if line.strip()]
    except OSError as error:
        raise ValueError(f'{path}: {error.strerror}') from None
    except UnicodeDecodeError:
        raise ValueError(f'{path}: neither a bag (a folder) nor a text file') from None
    if not head:
        raise ValueError(f'{path}: empty')
    if is_data_sheet(head):
        sheet = read_data_sheet(path)
        remarks = tuple(f'{path.name}: {remark}' for remark in sheet.remarks)
        return _Source(
            _data_file(path), sheet.chambers, dynamic=sheet.dynamic, static=sheet.static,
            seal_document=sheet.seal_document, remarks=remarks,
        )  # fmt: skip
    if _is_table(head):
        dynamic, static = read_table(path)
        return _Source(_data_file(path), None, dynamic=dynamic, static=static)
    return _read_log(path, options)


def _data_file(path: Path) -> DataFile:
    """Name and digest of a file, or of the data files of a bag in order of name."""
    digest = hashlib.sha256()
    parts = sorted(p for p in path.iterdir() if p.suffix in ('.mcap', '.db3')) if path.is_dir() else [path]
    for part in parts:
        with part.open('rb') as file:
            while block := file.read(1 << 20):
                digest.update(block)
    return DataFile(path.resolve().name, digest.hexdigest())


def _sliding(base: Sliding, options: SourceOptions) -> Sliding:
    chosen = {'slowest': options.slowest, 'largest_acceleration': options.largest_acceleration}
    values = {'slowest': base.slowest, 'largest_acceleration': base.largest_acceleration}
    values |= {name: value for name, value in chosen.items() if value is not None}
    return from_mapping(Sliding, values, 'sliding')


# -- logs -------------------------------------------------------------------------------------------------------------


def _read_log(path: Path, options: SourceOptions) -> _Source:
    rig, remarks = _recognised(path) if options.rig is None else (read_rig(config_path('rigs', options.rig)), ())
    log = read_samples(path, rig)
    samples, sliding = log.samples, _sliding(rig.sliding, options)
    moving = np.abs(samples.velocity) > sliding.slowest
    for term, column in log.columns.items():
        if term is not rig.time:
            check_clipping(path.name, f'signal in column {term.column_name or term.column}', column[moving])
    seconds = (samples.stamp - samples.stamp[0]) * 1e-9
    signals = Signals(seconds, samples.velocity, samples.chamber_a, samples.chamber_b, samples.force_sum)
    return _Source(_data_file(path), None, Measurement(path.name, signals, sliding), remarks=remarks)


def _recognised(path: Path) -> tuple[Rig, tuple[str, ...]]:
    """The one rig of config/rigs that can read a log, and a remark on that assumption.

    A rig whose columns are found by name is preferred to one whose columns are found by number.

    Raises:
        ValueError: No rig can read it, or several can.
    """
    folder = share_directory('seal_friction_ros', __file__) / 'config' / 'rigs'
    found, reasons = [], []
    for rig_file in sorted(folder.glob('*.yaml')):
        rig = read_rig(rig_file)
        try:
            read_samples(path, rig)
        except ValueError as error:
            reasons.append(f'{rig_file.stem}: {str(error).removeprefix(f"{path}: ")}')
        else:
            found.append((rig, rig_file.stem))
    found = [(rig, name) for rig, name in found if rig.header != 'none'] or found
    if len(found) == 1:
        rig, name = found[0]
        return rig, (f'{path.name} was read as a log of rig {name}; if it is of another, name that with --rig',)
    if found:
        raise ValueError(
            f'{path}: rigs {" and ".join(name for _, name in found)} can both read it: name one with --rig'
        )
    raise ValueError(
        f'{path}: not a table with a pressure and a friction column, and no log of a known rig ({"; ".join(reasons)}): '
        'write a rig file (docs/rig_files.md) and give it with --rig'
    )


# -- bags -------------------------------------------------------------------------------------------------------------


def _read_bag(path: Path, options: SourceOptions) -> _Source:
    topics = find_topics(path, options.namespace)
    missing = [name for name in ('pressure', 'force') if not getattr(topics, name)]
    if missing:
        raise ValueError(f'{path}: no {" and no ".join(missing)} messages in it: friction cannot be identified without')
    total = sum(info.message_count for info in bag_topics(path).values())
    reader = _BagReader(topics)
    with progress(f'read {path.name}', total) as advance:
        for count, message in enumerate(read_messages(path), start=1):
            reader.take(path, message)
            if count % 1000 == 0:
                advance(1000)
    name = path.resolve().name
    measurement = Measurement(name, reader.signals(), _sliding(Sliding(), options))
    return _Source(_data_file(path), reader.chambers, measurement, seal_document=reader.seal_document)


class _BagReader:
    """Collects the messages of a bag: one row for each velocity, with the newest pressure and force before it."""

    def __init__(self, topics: Topics) -> None:
        self.chambers: tuple[str, ...] | None = None
        self.seal_document: Mapping[str, Any] | None = None
        self._topics = topics
        self._pressure = (math.nan, math.nan)
        self._force = math.nan
        self._rows: list[tuple[int, float, float, float, float]] = []

    def take(self, path: Path, message: BagMessage) -> None:
        """Add one message.

        Raises:
            ValueError: It is damaged; names it.
        """
        try:
            self._take(message)
        except ValueError as error:
            raise ValueError(f'{path}: message on {message.topic} at {message.log_time} ns: {error}') from None

    def _take(self, message: BagMessage) -> None:
        topic, topics = message.topic, self._topics
        if topic == topics.velocity:
            sample = decode(VELOCITY_TYPE, message.data)
            self._rows.append((sample.stamp, sample.velocity, *self._pressure, self._force))
        elif topic == topics.pressure:
            pressure = decode(PRESSURE_TYPE, message.data)
            self._pressure = pressure.chamber_a, pressure.chamber_b
        elif topic == topics.force:
            self._force = decode(FORCE_TYPE, message.data).force
        elif topic == topics.configuration:
            configuration = parse_snapshot(decode_text(message.data)).configuration
            self.chambers = configuration.selection.seal_chambers
            self.seal_document = configuration.seal_documents[0]

    def signals(self) -> Signals:
        """Signals of the rows with increasing stamps."""
        stamps = np.array([row[0] for row in self._rows], dtype=np.int64)
        newest = np.maximum.accumulate(stamps)
        kept = np.concatenate(([True], stamps[1:] > newest[:-1])) if len(stamps) else np.array([], dtype=bool)
        columns = np.array([row[1:] for row in self._rows], dtype=np.float64).reshape(len(stamps), 4).T
        columns = np.where(
            np.abs(columns) < 1e15, columns, np.nan
        )  # [SI] no measurement is as large; the comparison drops NaN too
        return Signals((stamps - stamps[:1].sum()) * 1e-9, *columns).taken(kept)


# -- tables -----------------------------------------------------------------------------------------------------------


def _is_table(head: Sequence[str]) -> bool:
    names = _names(head)
    return any(name.startswith('pressure') for name in names) and any(name.startswith('friction') for name in names)


def _names(head: Sequence[str]) -> list[str]:
    first = next((line for line in head if not line.startswith('#')), '')
    return [name.strip().lower() for name in first.split(',')]


def read_table(path: Path) -> tuple[Noted, Noted]:
    """Running and breakout friction from a table of one reading per row.

    Columns, by the names in its first row: ``pressure_<unit>`` (psig, psi, bar, kPa, MPa, Pa) and ``friction_<unit>``
    (lbf, N, kN), of all seals; optional ``direction`` (extend or retract), ``kind`` (dynamic or static), ``test``
    and ``velocity_<unit>`` (m_per_s, mm_per_s, in_per_s).

    Raises:
        ValueError: The table cannot be read or a cell is invalid; one line that names file, row and column.
    """
    rows = table_rows(path)
    names = list(rows[0]) if rows else []
    if not rows:
        raise ValueError(f'{path}: no reading in it')
    pressure = column_in_si(path, rows, names, 'pressure', PRESSURE_UNITS)
    friction = column_in_si(path, rows, names, 'friction', FRICTION_UNITS)
    speed = np.full(len(rows), np.nan)
    if any(name.startswith('velocity') for name in names):
        speed = np.abs(column_in_si(path, rows, names, 'velocity', VELOCITY_UNITS))
    direction = np.array([_one_of(path, i, row, 'direction', DIRECTIONS, 1) for i, row in enumerate(rows, start=2)])
    is_static = np.array(
        [_one_of(path, i, row, 'kind', {'dynamic': 0, 'static': 1}, 0) for i, row in enumerate(rows, start=2)]
    )
    tests = {text: number for number, text in enumerate(dict.fromkeys(row.get('test', '') for row in rows))}
    test = np.array([tests[row.get('test', '')] for row in rows])

    def taken(kind: int) -> Noted:
        index = np.flatnonzero(is_static == kind)
        columns = (test[index], pressure[index], direction[index], friction[index], speed[index])
        return Noted(path.name, *columns)

    return taken(0), taken(1)


def table_rows(path: Path) -> list[dict[str, str]]:
    """Rows of a table of comma-separated values as mappings from the names in its first row, in lower case.

    Raises:
        ValueError: It cannot be read, or a row and the first row differ in their number of cells.
    """
    try:
        with path.open(encoding='utf-8-sig', newline='') as file:
            lines = [line for line in file if line.strip() and not line.startswith('#')]
    except (OSError, UnicodeDecodeError) as error:
        raise ValueError(f'{path}: cannot be read as text: {error}') from None
    reader = csv.DictReader(lines)
    rows = []
    for number, row in enumerate(reader, start=2):
        if None in row or None in row.values():
            raise ValueError(f'{path}: row {number}: number of cells differs from the first row')
        rows.append({str(name).strip().lower(): str(cell).strip() for name, cell in row.items()})
    return rows


def column_in_si(
    path: Path, rows: Sequence[Mapping[str, str]], names: Iterable[str], quantity: str, units: Mapping[str, str]
) -> FloatArray:
    """A column in SI units; its name is that of the quantity, followed by the unit.

    Args:
        path: Of the table, for the error message.
        rows: Of the table.
        names: Of its columns.
        quantity: Beginning of the name.
        units: Unit in the name -> unit in `UNITS`.

    Raises:
        ValueError: There is no such column, or several, or a cell is not a number.
    """
    found = [name for name in names if name.startswith(quantity)]
    unit = found[0].removeprefix(quantity).strip('_ ()[]') if found else ''
    if len(found) != 1 or unit not in units:
        raise ValueError(
            f'{path}: {len(found)} columns called {quantity}_<unit> ({", ".join(found)}): call one '
            f'{" or ".join(f"{quantity}_{name}" for name in units)}'
        )
    size = UNITS[units[unit]]
    values = []
    for number, row in enumerate(rows, start=2):
        try:
            values.append(float(row[found[0]]) * size)
        except ValueError:
            raise ValueError(f'{path}: row {number}: {found[0]} is {row[found[0]][:40]!r}, not a number') from None
    return np.array(values)


def _one_of(
    path: Path, number: int, row: Mapping[str, str], name: str, choices: Mapping[str, int], default: int
) -> int:
    text = row.get(name, '').lower()
    if name not in row:
        return default
    if text not in choices:
        raise ValueError(f'{path}: row {number}: {name} is {text[:40]!r}, not one of {", ".join(choices)}')
    return choices[text]
