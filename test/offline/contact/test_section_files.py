"""Drawings of sections, CSV and DXF, and tension tests."""

import zipfile
from pathlib import Path

import ezdxf
import numpy as np
import pytest

from seal_friction_ros.core.lubrication.lubrication_case import parse_lubrication_case
from seal_friction_ros.core.oring_contact.section import SHAPES, placed, signed_area
from seal_friction_ros.offline.contact.section_files import read_heights, read_outline, read_tension, with_files

SQUARE = ((10.0, 0.0), (12.0, 0.0), (12.0, 3.0), (10.0, 3.0))  # r, z


def csv(path: Path, head: str, rows: tuple[tuple[float, ...], ...] = SQUARE) -> Path:
    path.write_text('\n'.join([head, *(','.join(map(str, row)) for row in rows)]) + '\n')
    return path


@pytest.mark.parametrize(
    ('head', 'size'), [('r [mm], z [mm]', 1e-3), ('R_in,Z_in', 25.4e-3), ('r (m), z (m)', 1.0), ('r [cm],z [mm]', None)]
)
def test_a_csv_outline_is_in_the_units_of_its_head(tmp_path: Path, head: str, size: float | None):
    found = read_outline(csv(tmp_path / 'seal.csv', head))
    expected = 1e-2 * 2.0 * 3.0 * 1e-3 if size is None else 6.0 * size**2
    assert signed_area(found) == pytest.approx(expected)


def test_columns_may_stand_in_any_order(tmp_path: Path):
    rows = tuple((z, r) for r, z in SQUARE)
    found = read_outline(csv(tmp_path / 'seal.csv', 'z [mm],r [mm]', rows))
    assert found[:, 0].min() == pytest.approx(10e-3)


@pytest.mark.parametrize(
    ('head', 'rows', 'reason'),
    [
        ('r,z', SQUARE, 'name columns and units there, for example "r \\[mm\\], z \\[mm\\]"'),
        ('10.0,0.0', SQUARE, 'name columns and units there'),
        ('r [mm],z [bar]', SQUARE, "unit 'bar' is not for a length: m, mm"),
        ('r [mm],z [mm]', (*SQUARE, (1.0, 2.0, 3.0)), 'is not 2 numbers, separated by commas'),
        ('r [mm],z [mm]', (SQUARE[0], SQUARE[2], SQUARE[1], SQUARE[3]), 'crosses or touches itself'),
    ],
)
def test_a_csv_that_is_no_outline_is_refused_in_one_line(tmp_path: Path, head, rows, reason: str):
    path = csv(tmp_path / 'seal.csv', head, rows)
    with pytest.raises(ValueError, match=reason) as caught:
        read_outline(path)
    assert str(path) in str(caught.value)
    assert '\n' not in str(caught.value)


def drawing(path: Path, unit: int, draw) -> Path:
    document = ezdxf.new(setup=False)
    document.header['$INSUNITS'] = unit
    draw(document.modelspace())
    document.saveas(path)
    return path


def test_a_dxf_polyline_has_x_along_the_axis(tmp_path: Path):
    points = [(z, r) for r, z in SQUARE]
    found = read_outline(drawing(tmp_path / 'seal.dxf', 4, lambda space: space.add_lwpolyline(points, close=True)))
    assert found[:, 0].min() == pytest.approx(10e-3)
    assert found[:, 1].max() == pytest.approx(3e-3)


def test_a_dxf_in_inches_is_converted(tmp_path: Path):
    found = read_outline(drawing(tmp_path / 'seal.dxf', 1, lambda space: space.add_circle((0.0, 0.5), 0.05)))
    assert np.ptp(found, axis=0) == pytest.approx([2.54e-3, 2.54e-3], rel=1e-3)
    assert signed_area(found) == pytest.approx(np.pi / 4.0 * 2.54e-3**2, rel=5e-3)


def test_lines_arcs_and_splines_are_joined_in_any_order(tmp_path: Path):
    def draw(space) -> None:
        space.add_line((0.0, 10.0), (3.0, 10.0))
        space.add_line((0.0, 12.0), (0.0, 10.0))
        space.add_arc((3.0, 11.0), 1.0, -90.0, 90.0)
        space.add_spline(fit_points=[(3.0, 12.0), (1.5, 12.0), (0.0, 12.0)])

    found = read_outline(drawing(tmp_path / 'seal.dxf', 4, draw))
    assert signed_area(found) == pytest.approx((6.0 + np.pi / 2.0) * 1e-6, rel=5e-3)


@pytest.mark.parametrize(
    ('unit', 'draw', 'reason'),
    [
        (0, lambda space: space.add_circle((0, 5), 1), 'states no unit of length'),
        (4, lambda space: space.add_text('seal'), 'has no line, polyline, arc'),
        (4, lambda space: space.add_line((0, 10), (3, 10)), 'not closed: nothing goes on from x = 3, y = 10'),
        (4, lambda space: [space.add_circle((0, 5), r) for r in (1, 2)], '1 lines beside the first closed outline'),
    ],
)
def test_a_dxf_that_is_no_outline_is_refused(tmp_path: Path, unit: int, draw, reason: str):
    with pytest.raises(ValueError, match=reason):
        read_outline(drawing(tmp_path / 'seal.dxf', unit, draw))


def test_other_files_are_refused(tmp_path: Path):
    broken = tmp_path / 'seal.dxf'
    broken.write_text('not a drawing')
    with pytest.raises(ValueError, match='is not a DXF file'):
        read_outline(broken)
    with pytest.raises(ValueError, match=r'seal\.csv: cannot be read: No such file'):
        read_outline(tmp_path / 'seal.csv')
    with pytest.raises(ValueError, match=r'seal\.step: not one of the drawings that can be read, \.csv, \.dxf'):
        read_outline(tmp_path / 'seal.step')


def test_a_case_names_its_drawing_and_test(tmp_path: Path):
    outline = placed(SHAPES['x_ring'](), 18.64, 3.53).outline
    csv(tmp_path / 'x.csv', 'r [mm],z [mm]', tuple(map(tuple, outline.tolist())))
    stretch = np.linspace(1.05, 1.6, 12)
    stress = 2.0 * (stretch - stretch**-2.0)  # C10 = 1 MPa
    csv(tmp_path / 't.csv', 'strain [1],stress [MPa]', tuple(zip(stretch - 1.0, stress, strict=True)))
    document = {'section': {'file': 'x.csv'}, 'rubber': {'test': 't.csv', 'model': 'mooney', 'bulk_modulus': 1e9}}
    found = with_files(document, tmp_path)
    assert len(found['section']['outline']) == len(outline)
    assert found['rubber']['elastic_modulus'] == pytest.approx(6e6, rel=1e-6)
    assert found['rubber']['bulk_modulus'] == 1e9
    assert document['section'] == {'file': 'x.csv'}
    assert read_tension(tmp_path / 't.csv', 'mooney').mooney_ratio == pytest.approx(0.0, abs=1e-6)


# -- measured surfaces ------------------------------------------------------------------------------------------------


def x3p(path: Path, heights: np.ndarray, kind: str = 'F', increment: float = 1.0) -> Path:
    """Map at steps of 2 um along and 3 um across, as ISO 25178-72 has it."""
    rows, columns = heights.shape
    axes = ''.join(
        f'<{name}><AxisType>I</AxisType><DataType>{of}</DataType><Increment>{step}</Increment></{name}>'
        for name, of, step in (('CX', 'D', 2e-6), ('CY', 'D', 3e-6), ('CZ', kind, increment))
    )
    size = f'<SizeX>{columns}</SizeX><SizeY>{rows}</SizeY><SizeZ>1</SizeZ>'
    link = '<DataLink><PointDataLink>bindata/data.bin</PointDataLink></DataLink>'
    with zipfile.ZipFile(path, 'w') as archive:
        archive.writestr('main.xml', f'<p:ISO5436_2 xmlns:p="x"><Record1>{axes}</Record1>{size}{link}</p:ISO5436_2>')
        archive.writestr('bindata/data.bin', heights.astype({'F': '<f4', 'I': '<i2', 'V': '<f8'}[kind]).tobytes())
    return path


def test_heights_of_an_x3p_are_metres_whether_stored_as_numbers_or_counts(tmp_path: Path):
    heights = 1e-6 * np.arange(12.0).reshape(3, 4)
    for kind, size in (('F', 1.0), ('I', 1e-6)):
        found, steps = read_heights(x3p(tmp_path / f'{kind}.x3p', heights / size, kind, size))
        assert found == pytest.approx(heights)
        assert steps == (3e-6, 2e-6)


def test_a_case_takes_the_roughness_of_its_measured_surfaces(tmp_path: Path):
    random = np.random.default_rng(3)
    rod = np.convolve(random.normal(size=4000), np.ones(5) / 5.0, 'same')
    csv(tmp_path / 'rod.csv', 'x [mm], z [um]', tuple((2e-3 * i, 0.4 * z) for i, z in enumerate(rod)))
    x3p(tmp_path / 'seal.x3p', 2e-6 * random.normal(size=(80, 200)))
    case = {'name': 'mine', 'topography': {'wall': 'rod.csv', 'seal': 'seal.x3p', 'filling': True}}
    found = parse_lubrication_case(with_files(case, tmp_path)).topography
    assert found.rms_height == pytest.approx(np.hypot(0.4e-6 * rod.std(), 2e-6), rel=0.03)
    assert found.wall_share == pytest.approx(0.4**2 / 5.0 / (0.4**2 / 5.0 + 4.0), rel=0.1)
    assert found.filling


@pytest.mark.parametrize(
    ('name', 'content', 'reason'),
    [
        ('a.x3p', b'no archive', 'not an X3P archive'),
        ('a.csv', b'x [mm],z [um]\n0,1\n1,2\n5,3\n', 'steps of x are not even'),
        ('a.csv', b'x [mm],z [bar]\n0,1\n', 'is not for a length'),
        ('a.sur', b'', 'not one of the surfaces that can be read, .csv, .x3p'),
    ],
)
def test_a_file_that_is_no_surface_is_refused_in_one_line(tmp_path: Path, name: str, content: bytes, reason: str):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(ValueError, match=reason) as caught:
        with_files({'topography': {'wall': name}}, tmp_path)
    assert str(tmp_path / name) in str(caught.value)


def test_an_x3p_whose_data_do_not_fit_its_head_is_refused(tmp_path: Path):
    with pytest.raises(ValueError, match='are not 4 x 3 heights of type V'):
        read_heights(x3p(tmp_path / 'v.x3p', np.zeros((3, 4)), 'V'))
