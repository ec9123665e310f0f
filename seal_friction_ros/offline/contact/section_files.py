"""Files that a case names: drawing of a section -> polygon in metres; tension test -> rubber; surface -> roughness."""

import re
import zipfile
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.foundation.errors import named_errors
from seal_friction_ros.core.foundation.units import QUANTITIES, QUANTITY_OF, unit_size
from seal_friction_ros.core.lubrication.measured_topography import Roughness, measured_roughness, topography_of
from seal_friction_ros.core.oring_contact.material import Rubber, rubber_of_tension
from seal_friction_ros.core.oring_contact.section import checked_outline
from seal_friction_ros.packages import needed

SUFFIXES = ('.csv', '.dxf')
_SAG = 1e-3  # between curve and chord, over the size of the drawing (our choice)
_GAP = 1e-4  # between the ends of two lines that meet, over the size of the drawing (our choice)
_HEAD = re.compile(r'\s*([a-z]+)\s*[\[(_]\s*(\w+?)\s*[\])]?\s*', re.IGNORECASE)
_EXAMPLES = {'length': 'mm', 'number': '1', 'pressure': 'MPa'}
_X3P_TYPES = {'I': '<i2', 'L': '<i4', 'F': '<f4', 'D': '<f8'}
_MOST_XML = 1_000_000  # bytes
_DXF_UNITS = {1: 'in', 4: 'mm', 5: 'cm', 6: 'm', 13: 'um'}


def read_outline(path: Path) -> FloatArray:
    """Outline (r, z) of the section in a file [m], shape (n, 2), counterclockwise.

    A CSV file has two columns with names and units, ``r [mm], z [mm]``; in a DXF drawing x is along the axis, y away
    from it, and the units are those of its head. The pressure is at low z. ValueError: the file has no unit, or not one
    closed outline that does not cross itself.
    """
    readers = {'.csv': _csv_outline, '.dxf': _dxf_outline}
    if path.suffix.lower() not in readers:
        raise ValueError(f'{path}: not one of the drawings that can be read, {", ".join(SUFFIXES)}')
    with named_errors(path), named_errors('cannot be read', OSError):
        return checked_outline(readers[path.suffix.lower()](path), 'section')


def read_tension(path: Path, model: str) -> Rubber:
    """Rubber of the tension test in a CSV file with the columns ``strain [1], stress [MPa]``, both nominal.

    ValueError: the file is not such a curve.
    """
    with named_errors(path), named_errors('cannot be read', OSError):
        strain, stress = _columns(path, {'strain': 'number', 'stress': 'pressure'}).T
        return rubber_of_tension(1.0 + strain, stress, model)


def with_files(document: Any, folder: Path) -> Any:
    """Document of a case with the content of files that it names, paths from ``folder``.

    These are the ``file`` of its section, a drawing; the ``test`` of its rubber with a ``model``, a tension test; and
    ``wall`` and ``seal`` of its topography, measured surfaces.
    """
    document = dict(document) if isinstance(document, Mapping) else document
    section = _part(document, 'section', 'file')
    if section:
        outline = read_outline(folder / section.pop('file'))
        document['section'] = {**section, 'outline': outline.tolist()}
    rubber = _part(document, 'rubber', 'test')
    if rubber:
        found = read_tension(folder / rubber.pop('test'), rubber.pop('model', 'yeoh'))
        document['rubber'] = {**asdict(found), **rubber}
    surfaces = {of: _part(document, 'topography', of) for of in ('wall', 'seal')}
    if any(surfaces.values()):
        rough = {of: _read_roughness(folder / part[of]) if part else None for of, part in surfaces.items()}
        others = {key: value for key, value in document['topography'].items() if key not in rough or rough[key] is None}
        document['topography'] = {**topography_of(rough['wall'], rough['seal']), **others}
    return document


def _read_roughness(path: Path) -> Roughness:
    with named_errors(path), named_errors('cannot be read', OSError):
        return measured_roughness(*read_heights(path))


def read_heights(path: Path) -> tuple[FloatArray, tuple[float, float]]:
    """Heights of a surface [m], shape (m, n), and their steps across and along the motion [m].

    A CSV file is a profile, ``x [mm], z [um]`` at even steps; an X3P file (ISO 25178-72) has a profile or a map, its x
    along the motion. ValueError: the file is neither.
    """
    if path.suffix.lower() == '.csv':
        x, z = _columns(path, {'x': 'length', 'z': 'length'}).T
        steps = np.diff(x)
        if len(x) < 2 or not steps.min() > 0.98 * steps.max() > 0.0:
            raise ValueError('the steps of x are not even and rising')
        return z[None], (1.0, float(steps.mean()))
    if path.suffix.lower() != '.x3p':
        raise ValueError('not one of the surfaces that can be read, .csv, .x3p')
    try:
        with zipfile.ZipFile(path) as archive:
            return _x3p_heights(archive)
    except (zipfile.BadZipFile, KeyError) as error:
        raise ValueError(f'not an X3P archive: {error}') from None


def _x3p_heights(archive: zipfile.ZipFile) -> tuple[FloatArray, tuple[float, float]]:
    """Heights of an archive: its main.xml says what its binary data are, all in metres."""
    with archive.open('main.xml') as stream:
        text = stream.read(_MOST_XML).decode('utf-8', 'replace')

    def entry(tag: str, of: str = text) -> str:
        """Text within a tag of main.xml. ValueError: it has none."""
        found = re.search(rf'<(?:\w+:)?{tag}\b[^>]*>(.*?)</(?:\w+:)?{tag}>', of, re.DOTALL)
        if found is None:
            raise ValueError(f'its main.xml has no {tag}')
        return found[1].strip()

    axis = {name: entry(name) for name in ('CX', 'CY', 'CZ')}
    kind = entry('DataType', axis['CZ'])
    columns, rows = int(entry('SizeX')), int(entry('SizeY'))
    data, dtype = archive.getinfo(entry('PointDataLink').lstrip('/')), np.dtype(_X3P_TYPES.get(kind, 'V1'))
    if kind not in _X3P_TYPES or data.file_size != rows * columns * dtype.itemsize:
        raise ValueError(f'its data are not {columns} x {rows} heights of type {kind}: one layer of I, L, F or D')
    heights = np.frombuffer(archive.read(data), dtype).reshape(rows, columns).astype(float)
    if kind in 'IL':
        heights *= float(entry('Increment', axis['CZ']))
    x, y = (
        float(entry('Increment', axis[name])) if size > 1 else 1.0 for name, size in (('CX', columns), ('CY', rows))
    )
    return heights, (y, x)


def _part(document: Any, part: str, key: str) -> dict[str, Any]:
    """Copy of a part of a document that names a file; empty otherwise."""
    values = document.get(part) if isinstance(document, Mapping) else None
    return dict(values) if isinstance(values, Mapping) and isinstance(values.get(key), str) else {}


def _csv_outline(path: Path) -> FloatArray:
    return _columns(path, {'r': 'length', 'z': 'length'})


def _columns(path: Path, wanted: Mapping[str, str]) -> FloatArray:
    """Columns of a CSV file in SI, in the order of their ``wanted`` names and quantities, shape (rows, columns)."""
    head, *rows = [line for line in path.read_text(encoding='utf-8-sig').splitlines() if line.strip()] or ['']
    columns = [_HEAD.fullmatch(name) for name in head.split(',')]
    names = [column[1].lower() if column else '' for column in columns]
    if sorted(names) != sorted(wanted):
        example = ', '.join(f'{name} [{_EXAMPLES[quantity]}]' for name, quantity in wanted.items())
        raise ValueError(f'the first line is {head[:60]!r}: name columns and units there, for example "{example}"')
    sizes = [_size(column[2], wanted[column[1].lower()]) for column in columns if column]
    try:
        table = np.array([[float(value) for value in row.split(',')] for row in rows]).reshape(-1, len(wanted))
    except ValueError:
        raise ValueError(f'a line after the first is not {len(wanted)} numbers, separated by commas') from None
    return (table * sizes)[:, [names.index(name) for name in wanted]]


def _size(unit: str, quantity: str) -> float:
    """Size in SI of a unit of a quantity."""
    if QUANTITY_OF.get(unit) != quantity:
        raise ValueError(f'unit {unit!r} is not for a {quantity}: {", ".join(QUANTITIES[quantity])}')
    return unit_size(unit)


def _dxf_outline(path: Path) -> FloatArray:
    ezdxf, paths = needed('ezdxf'), needed('ezdxf.path')
    try:
        drawing = ezdxf.readfile(path)
    except ezdxf.DXFError as error:
        raise ValueError(f'not a DXF drawing: {error}') from None
    unit = _DXF_UNITS.get(drawing.header.get('$INSUNITS', 0))
    if unit is None:
        raise ValueError('the drawing states no unit of length ($INSUNITS): save it in mm, or write a CSV')
    curves = [paths.make_path(entity) for entity in drawing.modelspace() if _is_curve(entity.dxftype())]
    if not curves:
        raise ValueError('the drawing has no line, polyline, arc, circle, ellipse or spline')
    ends = np.array([[point.x, point.y] for curve in curves for point in curve.control_vertices()])
    size = float(np.ptp(ends, axis=0).max())
    lines = [np.array([[p.x, p.y] for p in curve.flattening(_SAG * size)]) for curve in curves]
    return _size(unit, 'length') * _chained(lines, _GAP * size)[:, ::-1]


def _is_curve(kind: str) -> bool:
    return kind in ('LINE', 'LWPOLYLINE', 'POLYLINE', 'ARC', 'CIRCLE', 'ELLIPSE', 'SPLINE')


def _chained(lines: list[FloatArray], gap: float) -> FloatArray:
    """One closed outline of lines that meet at their ends, in any order and direction."""
    chain, *left = lines
    while np.linalg.norm(chain[-1] - chain[0]) > gap:
        near = [
            (i, line[::step])
            for i, line in enumerate(left)
            for step in (1, -1)
            if np.linalg.norm(line[::step][0] - chain[-1]) <= gap
        ]
        if not near:
            x, y = chain[-1]
            raise ValueError(f'the outline is not closed: nothing goes on from x = {x:.6g}, y = {y:.6g} of the drawing')
        index, found = near[0]
        del left[index]
        chain = np.concatenate((chain, found[1:]))
    if left:
        raise ValueError(f'{len(left)} lines beside the first closed outline: draw one section, nothing else')
    return chain
