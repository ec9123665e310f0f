"""Sources of friction readings: bags, logs of a rig, tables of manual readings, filled data sheets.

The kind of a source follows from the file itself, so a command accepts any of them in any number.
"""

import csv
import hashlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from seal_friction_ros.core.foundation.arrays import FloatArray, IntArray
from seal_friction_ros.core.foundation.units import UNITS, ZEROS
from seal_friction_ros.core.identification import admission, load_over_position
from seal_friction_ros.core.identification.force_correction import ForceCorrection
from seal_friction_ros.core.identification.prepare_readings import prepare_logs, prepare_manual_readings
from seal_friction_ros.core.identification.readings import ManualReadings, PreparedReadings, RecordedLog, check_clipping
from seal_friction_ros.core.identification.signal_preparation import Signals, Sliding
from seal_friction_ros.files import config_path, share_directory
from seal_friction_ros.offline.bags.actuator_bag import open_actuator
from seal_friction_ros.offline.bags.columns import read_velocity_rows
from seal_friction_ros.offline.bags.import_log import read_samples
from seal_friction_ros.offline.bags.mapped_bag import MappingFile
from seal_friction_ros.offline.bags.rig_file import Rig, read_rig
from seal_friction_ros.offline.identification.data_sheet import TITLE, parse_number, read_data_sheet, read_text
from seal_friction_ros.offline.work.executor import Workers, run_all
from seal_friction_ros.offline.work.places import Place, as_path

LARGEST_ACCELERATION = 1.0  # [m/s2] limit with known inertia (our choice)
DIRECTIONS = {'extend': 1, 'ext': 1, '1': 1, '+1': 1, 'retract': -1, 'ret': -1, '-1': -1}
KINDS = {'dynamic': 0, 'static': 1}
PRESSURE_UNITS = {'psig': 'psi', 'psi': 'psi', 'bar': 'bar', 'kpa': 'kPa', 'mpa': 'MPa', 'pa': 'Pa'}
FRICTION_UNITS = {'lbf': 'lbf', 'n': 'N', 'kn': 'kN'}
VELOCITY_UNITS = {'m_per_s': 'm/s', 'mm_per_s': 'mm/s', 'in_per_s': 'in/s'}


@dataclass(frozen=True, kw_only=True)
class SourceOptions:
    """Options on the sources; None leaves a value to the sources."""

    rig: str | None = None  # rig file of the logs: a path, or the name of one in config/rigs
    chambers: tuple[str, ...] | None = None  # chamber of each seal
    namespace: str = ''  # of a bag: use only topics below it; of a machine the name of the actuator
    mapping: MappingFile | None = None  # of the machine, for bags without configuration
    slowest: float | None = None  # [m/s] see `Sliding`
    largest_acceleration: float | None = None  # [m/s^2] see `Sliding`


class DataFile(NamedTuple):
    """Name and digest of a source, for the seal file."""

    name: str
    sha256: str


class Source(NamedTuple):
    """Contents of one source: either a log, or manual readings."""

    file: DataFile
    chambers: tuple[str, ...] | None  # chamber of each seal; None if unknown
    log: RecordedLog | None = None
    manual: tuple[ManualReadings, ManualReadings] | None = None  # running and breakaway friction
    seal_document: Mapping[str, Any] | None = None  # seal file inside a bag or a data sheet
    has_placeholder: bool = False  # a bag that was recorded with the placeholder seals, whose chambers are assumed
    pressure_area: float | None = None  # by which the rig file turns pressure into force [m^2]; None if unknown
    remarks: tuple[str, ...] = ()  # assumptions that neither the source nor an option states
    load_position: FloatArray | None = None  # [m] of each sample, if the force sum holds a load that follows it
    load: load_over_position.LoadOverPosition | None = None  # the load that was taken out of the force sum of the log


@dataclass(frozen=True, eq=False)
class Sources:
    """Contents of all sources."""

    each: tuple[Source, ...]
    chambers: tuple[str, ...]  # chamber of each seal
    remarks: tuple[str, ...]

    @property
    def files(self) -> tuple[DataFile, ...]:
        """Name and digest of each source."""
        return tuple(source.file for source in self.each)

    @property
    def has_fitted_load(self) -> bool:
        """Whether a load over position was fitted to a log; friction larger in one direction counts as load there."""
        return any(source.load is not None for source in self.each)

    def prepare(self) -> PreparedReadings:
        """Readings of all sources. ValueError: they are unfit for identification."""
        logs = [source.log for source in self.each if source.log is not None]
        if logs:
            return prepare_logs(logs, self.chambers)
        dynamic, static = zip(*(source.manual for source in self.each if source.manual is not None), strict=True)
        with_static = [readings for readings in static if len(readings.friction)]
        return prepare_manual_readings(dynamic, with_static, len(self.chambers))

    @property
    def pressure_area(self) -> float | None:
        """Area by which the rig file turns the pressure into force [m^2]; None if the sources have no rig file."""
        return next((source.pressure_area for source in self.each if source.pressure_area is not None), None)

    def corrected(self, correction: ForceCorrection) -> 'Sources':
        """The sources with areas of the force sum corrected in every log."""
        each = tuple(
            s if s.log is None else s._replace(log=s.log._replace(signals=correction.corrected(s.log.signals)))
            for s in self.each
        )
        return replace(self, each=each)


def read_sources(paths: Sequence[Place], options: SourceOptions, workers: Workers = 1) -> Sources:
    """Read every source, by path or URL, as many ``workers`` at a time: bags and logs, or tables and data sheets.

    ValueError: a source cannot be read, is of no known kind, or does not fit the others; one line that names it. Or the
    cluster cannot be used.
    """
    if not paths:
        raise ValueError('no source: give a bag, a log or a table')
    twice = sorted({str(path) for path in paths if list(paths).count(path) > 1})
    if twice:
        raise ValueError(f'{twice[0]} is named twice')
    calls = [partial(_read_place, path, options) for path in paths]
    is_here = workers == 1 or (len(paths) == 1 and isinstance(workers, int))
    each = tuple(call() for call in calls) if is_here else tuple(run_all('read', calls, workers))
    digests = [source.file.sha256 for source in each]
    same = next(((i, digests.index(d)) for i, d in enumerate(digests) if digests.index(d) < i), None)
    if same is not None:
        raise ValueError(f'{paths[same[0]]} and {paths[same[1]]} are the same bytes: name it once')
    if len({source.log is None for source in each}) > 1:
        raise ValueError('manual readings and recorded signals cannot be fitted together: identify each separately')
    chambers, remark = _chambers(each, options)
    each = tuple(without_load_of(source, chambers, options) for source in each)
    remarks = [*(r for source in each for r in source.remarks), *_placeholder_remarks(each), *remark]
    return Sources(each, chambers, tuple(dict.fromkeys(remarks)))


def _chambers(each: Sequence[Source], options: SourceOptions) -> tuple[tuple[str, ...], list[str]]:
    """Chamber of each seal: from the options, else from the sources, else one seal for each chamber under pressure."""
    if options.chambers is not None:
        return options.chambers, []
    stated = {source.chambers for source in each if source.chambers is not None}
    if len(stated) > 1:
        texts = ' and '.join(sorted(','.join(chambers) for chambers in stated))
        raise ValueError(f'the sources have seals on different chambers ({texts}): give them with --seal-chambers')
    if stated:
        return stated.pop(), []
    logs = [source.log.signals for source in each if source.log is not None]
    pressures = [(name, getattr(signals, f'pressure_{name}')) for name in 'ab' for signals in logs]
    under_pressure = dict.fromkeys(name for name, p in pressures if np.nanmax(np.abs(p), initial=0.0) > 0.0)
    found = tuple(under_pressure) or ('a',)
    assumed = 'one seal for each chamber under pressure' if logs else 'one seal with all friction'
    return found, [f'{assumed} is assumed: {",".join(found)}; give others with --seal-chambers']


def _read_place(place: Place, options: SourceOptions) -> Source:
    with as_path(place) as path:
        return _read(path, options)


def _read(path: Path, options: SourceOptions) -> Source:
    if path.is_dir() or path.suffix in ('.mcap', '.db3'):
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
    if TITLE in head[0].lower():
        dynamic, static, chambers, document, remarks = read_data_sheet(path)
        texts = tuple(f'{path.name}: {remark}' for remark in remarks)
        return Source(_data_file(path), chambers, None, (dynamic, static), document, remarks=texts)
    names = next((line for line in head if not line.startswith('#')), '').lower().split(',')
    if all(any(name.strip().startswith(quantity) for name in names) for quantity in ('pressure', 'friction')):
        return Source(_data_file(path), None, manual=read_table(path))
    return _read_log(path, options)


def without_load_of(source: Source, chambers: Sequence[str], options: SourceOptions) -> Source:
    """The source with load and inertia taken out of its force sum, if that holds a load which follows position.

    With known inertia, samples at higher accelerations are used too, unless the options limit them. ValueError: the
    load cannot be told from friction; names the log.
    """
    if source.log is None or source.load_position is None:
        return source
    name, signals, sliding, temperature, position, dropped = source.log
    try:
        load = load_over_position.fit_load(signals, source.load_position, chambers, sliding)
    except ValueError as error:
        raise ValueError(f'{name}: {error}') from None
    cleaned = load_over_position.without_load(signals, source.load_position, load, sliding)
    told = (
        f'a load of {float(load.forces.min()):.4g} to {float(load.forces.max()):.4g} N over {load.knots[0]:.4g} to '
        f'{load.knots[-1]:.4g} m (standard deviation {float(load.std.mean()):.2g} N) and the inertia of '
        f'{load.mass:.4g} kg were fitted and taken out of the force sum; samples at other positions are not used'
    )
    texts = tuple(f'{name}: {text}' for text in (told, *load.warnings))
    dropped = {**dropped, admission.BEYOND_LOAD: len(signals.time) - len(cleaned.time)}
    if options.largest_acceleration is None:
        known = max(sliding.largest_acceleration, load_over_position.known_acceleration(load))
        sliding = replace(sliding, largest_acceleration=min(known, LARGEST_ACCELERATION))
    return source._replace(
        log=RecordedLog(name, cleaned, sliding, temperature, position, dropped),
        load=load,
        remarks=(*source.remarks, *texts),
    )


def _data_file(path: Path) -> DataFile:
    """Name and digest of a file, or of the data files of a bag in order of name."""
    digest = hashlib.sha256()
    parts = sorted(p for p in path.iterdir() if p.suffix in ('.mcap', '.db3')) if path.is_dir() else [path]
    for part in parts:
        with part.open('rb') as file:
            hashlib.file_digest(file, lambda: digest)
    return DataFile(path.resolve().name, digest.hexdigest())


def _sliding(base: Sliding, options: SourceOptions) -> Sliding:
    given = {'slowest': options.slowest, 'largest_acceleration': options.largest_acceleration}
    return replace(base, **{name: value for name, value in given.items() if value is not None})


def _read_log(path: Path, options: SourceOptions) -> Source:
    rig, remarks = _recognised(path) if options.rig is None else (read_rig(config_path('rigs', options.rig)), ())
    log = read_samples(path, rig)
    samples, sliding = log.samples, _sliding(rig.sliding, options)
    moving = np.abs(samples.velocity) > sliding.slowest
    for term, column in log.columns.items():
        if term.is_a('pressure') or term.is_a('force'):  # a position at an end stop stands still by right
            where, is_pressure = f'signal in column {term.column_name or term.column}', term.is_a('pressure')
            check_clipping(path.name, where, column[moving] * UNITS[term.unit], is_pressure=is_pressure)
    seconds = (samples.stamp - samples.stamp[0]) * 1e-9
    signals = Signals(seconds, samples.velocity, samples.chamber_a, samples.chamber_b, samples.force_sum)
    recorded = RecordedLog(path.name, signals, sliding, log.track.temperature, log.position, dict(log.dropped))
    recorded, texts = _admitted(recorded)
    remarks = (*remarks, *texts, *(f'{path.name}: {text}' for text in log.remarks))
    source = Source(_data_file(path), None, recorded, pressure_area=_pressure_area(rig), remarks=remarks)
    if log.position is None or rig.load == 'none':
        return source
    holds = rig.load == 'position' or load_over_position.follows_position(signals, log.position, sliding)
    return source._replace(load_position=log.position) if holds else source


def _pressure_area(rig: Rig) -> float | None:
    """Area of the one chamber under pressure in the force sum [m^2]; None if there is none, or several."""
    columns = {(t.column, t.column_name) for c in (rig.chamber_a, rig.chamber_b) for t in c.terms}
    areas = [abs(t.gain) * UNITS[t.gain_unit] for t in rig.force_sum.terms if (t.column, t.column_name) in columns]
    return areas[0] if len(areas) == 1 else None


def _recognised(path: Path) -> tuple[Rig, tuple[str, ...]]:
    """The one rig of config/rigs that can read a log, and a remark on that assumption.

    A rig whose columns are found by name is preferred to one whose columns are found by number.
    """
    folder = share_directory('seal_friction_ros', __file__) / 'config' / 'rigs'
    found: dict[str, Rig] = {}
    reasons = []
    for rig_file in sorted(folder.glob('*.yaml')):
        rig = read_rig(rig_file)
        try:
            read_samples(path, rig)
            found[rig_file.stem] = rig
        except ValueError as error:
            reasons.append(f'{rig_file.stem}: {str(error).removeprefix(f"{path}: ")}')
    found = {name: rig for name, rig in found.items() if rig.header != 'none'} or found
    if len(found) > 1:
        raise ValueError(f'{path}: rigs {" and ".join(found)} can both read it: name one with --rig')
    for name, rig in found.items():
        return rig, (f'{path.name} was read as a log of rig {name}; if it is of another, name that with --rig',)
    raise ValueError(
        f'{path}: not a table with a pressure and a friction column, and no log of a known rig ({"; ".join(reasons)}): '
        'write a rig file (docs/rig_files.md) and give it with --rig'
    )


def _read_bag(path: Path, options: SourceOptions) -> Source:
    """Signals of a bag: one row for each velocity message, with what came newest before it."""
    bag = open_actuator(path, options.namespace, options.mapping)
    topics = bag.topics
    missing = [name for name in ('pressure', 'force') if not getattr(topics, name)]
    if missing:
        raise ValueError(f'{path}: no {" and no ".join(missing)} messages: they are needed to identify friction')
    stamp, received, columns, configuration, unread = read_velocity_rows(bag)
    chambers, document, holds_load, has_placeholder = None, None, False, False
    if configuration is not None:
        holds_load = configuration.parameters().estimator.force_sum_correction.contains_load
        has_placeholder, chambers = configuration.has_placeholder, configuration.selection.seal_chambers
        document = None if has_placeholder else configuration.seal_documents[0]
    order = admission.in_order(stamp, received)
    columns[~(np.abs(columns) < 1e15)] = np.nan  # [SI] no measurement is as large
    columns = columns[:, order.rows]
    early = int(np.argmax(np.isfinite(columns[1:4]).all(axis=0)))  # rows before the first pressures and force sum
    columns, seconds = columns[:, early:], order.seconds[early:]
    temperature = _from_the_first(columns[5] + ZEROS['degC']) if topics.temperature else None
    position = columns[4] if topics.position else None
    dropped = {**unread, admission.SAME_STAMP: order.same_stamp, admission.NOT_STARTED: early}
    dropped = {reason: count for reason, count in dropped.items() if count}
    signals, sliding = Signals(seconds, *columns[:4]), _sliding(Sliding(), options)
    log, texts = _admitted(RecordedLog(bag.name, signals, sliding, temperature, position, dropped))
    return Source(
        _data_file(path),
        chambers,
        log,
        seal_document=document,
        has_placeholder=has_placeholder,
        load_position=position if holds_load else None,
        remarks=(*(f'{bag.name}: {text}' for text in order.texts), *texts),
    )


def _admitted(log: RecordedLog) -> tuple[RecordedLog, tuple[str, ...]]:
    """The log with single missing values bridged, and remarks on it."""
    columns, masks = zip(*(admission.bridged(column) for column in log.signals[1:]), strict=True)
    count = int(np.logical_or.reduce(masks).sum())
    signals = Signals(log.signals.time, *columns)
    missing = int((~np.isfinite(np.array(columns)).all(axis=0)).sum())
    used, left_out = len(signals.time) - missing, {**log.dropped, admission.NOT_FINITE: missing}
    admission.Account(log.name, used, left_out).check()
    texts = (f'{log.name}: {count} samples had no value, and are on a straight line between their neighbours',)
    return log._replace(signals=signals), texts * (count > 0)


def _from_the_first(temperature: FloatArray) -> FloatArray:
    """A temperature that holds before its first message, too: a sensor of 1 Hz comes after the first samples."""
    known = np.isfinite(temperature)
    if not known.any():
        return temperature
    first = int(np.argmax(known))
    return np.concatenate((np.full(first, temperature[first]), temperature[first:]))


def _placeholder_remarks(each: Sequence[Source]) -> Iterator[str]:
    """What is assumed of bags that were recorded with the placeholder seals."""
    names: dict[tuple[str, ...], list[str]] = {}
    for source in each:
        if source.has_placeholder and source.chambers is not None and source.log is not None:
            names.setdefault(source.chambers, []).append(source.log.name)
    for chambers, bags in names.items():
        were = 'was' if len(bags) == 1 else 'were'
        yield (
            f'{", ".join(bags)} {were} recorded with the placeholder seals of the default configuration: their '
            'geometry is not used, give that of your ring with --seal; seals on the chambers '
            f'{",".join(chambers)} are assumed'
        )


def read_table(path: Path) -> tuple[ManualReadings, ManualReadings]:
    """Running and breakaway friction from a table of one reading per row.

    Columns, by the names in its first row: ``pressure_<unit>`` (psig, psi, bar, kPa, MPa, Pa) and ``friction_<unit>``
    (lbf, N, kN), of all seals; optional ``direction`` (extend or retract), ``kind`` (dynamic or static), ``test``,
    ``velocity_<unit>`` (m_per_s, mm_per_s, in_per_s) and ``dwell_s``, the time at rest before a static reading.
    ValueError: the table cannot be read or a cell is invalid; one line that names file, row and column.
    """
    rows = table_rows(path)
    if not rows:
        raise ValueError(f'{path}: no readings')
    pressure = column_in_si(path, rows, 'pressure', PRESSURE_UNITS)
    friction = column_in_si(path, rows, 'friction', FRICTION_UNITS)
    speed = np.full(len(rows), np.nan)
    if any(name.startswith('velocity') for name in rows[0]):
        speed = np.abs(column_in_si(path, rows, 'velocity', VELOCITY_UNITS))
    direction = _codes(path, rows, 'direction', DIRECTIONS, 1)
    kinds = _codes(path, rows, 'kind', KINDS, 0)
    test = np.unique([row.get('test', '') for row in rows], return_inverse=True)[1]
    columns = [test, pressure, direction, friction, speed]
    if any(name.startswith('dwell') for name in rows[0]):
        columns.append(column_in_si(path, rows, 'dwell', {'s': 's'}))
    dynamic, static = (ManualReadings(path.name, *(column[kinds == kind] for column in columns)) for kind in (0, 1))
    return dynamic, static


def table_rows(path: Path) -> list[dict[str, str]]:
    """Rows of a table of comma-separated values as mappings from the names in its first row, in lower case.

    ValueError: it cannot be read, or a row and the first row differ in their number of cells.
    """
    lines = [line for line in read_text(path).splitlines(keepends=True) if line.strip() and not line.startswith('#')]
    rows = []
    for number, row in enumerate(csv.DictReader(lines), start=2):
        if None in row or None in row.values():
            raise ValueError(f'{path}: row {number}: number of cells differs from the first row')
        rows.append({str(name).strip().lower(): str(cell).strip() for name, cell in row.items()})
    return rows


def column_in_si(path: Path, rows: Sequence[Mapping[str, str]], quantity: str, units: Mapping[str, str]) -> FloatArray:
    """A column of the table ``path`` in SI units; its name is that of the quantity, followed by a unit.

    ``rows`` are those of `table_rows`, at least one; ``units`` maps the unit in the name to the unit in `UNITS`.
    ValueError: there is no such column, or several, or a cell is not a number.
    """
    found = [name for name in rows[0] if name.startswith(quantity)]
    unit = found[0].removeprefix(quantity).strip('_ ()[]') if found else ''
    if len(found) != 1 or unit not in units:
        raise ValueError(
            f'{path}: {len(found)} columns called {quantity}_<unit> ({", ".join(found)}): call one '
            f'{" or ".join(f"{quantity}_{name}" for name in units)}'
        )
    values = [parse_number(row[found[0]], f'{path}: row {i}: {found[0]}') for i, row in enumerate(rows, start=2)]
    return np.array(values) * UNITS[units[unit]]


def _codes(
    path: Path, rows: Sequence[Mapping[str, str]], name: str, codes: Mapping[str, int], default: int
) -> IntArray:
    """Code of each cell of a column; ``default`` if the table has no such column."""
    texts = [row[name].lower() for row in rows if name in row]
    for number, text in enumerate(texts, start=2):
        if text not in codes:
            raise ValueError(f'{path}: row {number}: {name} is {text[:40]!r}, not one of {", ".join(codes)}')
    return np.array([codes[text] for text in texts] or [default] * len(rows))
