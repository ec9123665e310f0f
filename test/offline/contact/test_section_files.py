"""Drawings of sections, CSV and DXF, and tension tests."""

from pathlib import Path

import ezdxf
import numpy as np
import pytest

from seal_friction_ros.core.oring_contact.section import SHAPES, placed, signed_area
from seal_friction_ros.offline.contact.section_files import read_outline, read_tension, with_files

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
