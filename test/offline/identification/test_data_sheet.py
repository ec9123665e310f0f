"""The data sheet of the thesis's test plan: printed, filled with its readings, checked, identified."""

import csv
import json

import pytest
from paths import ROOT

from seal_friction_ros.core.foundation.units import INCH
from seal_friction_ros.core.friction.geometry import SealGeometry
from seal_friction_ros.offline.commands.main import main
from seal_friction_ros.offline.identification.data_sheet import (
    DIMENSIONS,
    FrictionTestPlan,
    columns,
    read_data_sheet,
    sheet_text,
)
from seal_friction_ros.offline.reports.page import write_page

THESIS = ROOT / 'data' / 'thesis' / 'friction_tests.csv'
RING = SealGeometry(0.106 * INCH, 0.612 * INCH, 0.625 * INCH, 0.821 * INCH)
UNITS = {'pressure_unit': 'psi', 'force_unit': 'lbf', 'length_unit': 'in'}


def plan(tests=3, geometry=RING):
    return FrictionTestPlan('ring_114', 0.0, 1000.0, 10, tests=tests, seals=2, geometry=geometry, **UNITS)


def readings() -> dict[tuple[float, str], str]:
    """Readings of Tables A-1 to A-3 by pressure [psi] and head of their column."""
    with THESIS.open() as file:
        return {
            (float(r['pressure_psig']), f'test {r["test"]} {r["kind"]} {r["direction"]}'): r['friction_lbf']
            for r in csv.DictReader(file)
        }


def filled(changes=(), rows=None) -> str:
    """The sheet as the thesis's author would have filled it in; then each (pressure, head) of ``changes`` changed."""
    cells = readings() | dict(changes)
    lines = sheet_text(plan()).splitlines()
    start = next(i for i, line in enumerate(lines) if line.startswith('pressure'))
    heads = [column.title for column in columns(3)]
    pressures = [float(line.split(',')[0]) for line in lines[start + 1 :]] if rows is None else rows
    table = [','.join([f'{p:g}', *(cells[p, head] for head in heads)]) for p in pressures]
    return '\n'.join([*lines[: start + 1], *table]) + '\n'


def identified(tmp_path, capsys, text: str):
    sheet, out = tmp_path / 'sheet.csv', tmp_path / 'seal.yaml'
    sheet.write_text(text)
    capsys.readouterr()
    code = main(['identify', str(sheet), '--out', str(out), '--json'])
    said = capsys.readouterr()
    assert out.exists() == (code == 0)
    return code, json.loads(said.out) if code == 0 else said.err


def test_the_sheet_has_the_132_cells_of_the_thesis():
    lines = sheet_text(plan()).splitlines()
    rows = [line for line in lines if line[:1].isdigit()]
    assert len(rows) * rows[0].count(',') == 132
    assert [row.split(',')[0] for row in rows] == [str(100 * i) for i in range(11)]


def test_the_printed_page_has_the_same_cells_and_the_thirty_seconds(tmp_path):
    write_page(tmp_path / 'sheet.html', 'data_sheet', (), plan=plan(), dimensions=DIMENSIONS, command='sheet')
    assert [path.name for path in tmp_path.iterdir()] == ['sheet.html']
    page = (tmp_path / 'sheet.html').read_text()
    assert page.count('<td') - page.count('<td>0</td>') >= 132
    assert 'Wait 30 s' in page
    assert '0.821' in page  # the known geometry is filled in
    assert 'http' not in page  # stands alone


def test_the_filled_sheet_gives_the_law_of_the_tables(tmp_path, capsys):
    code, sheet = identified(tmp_path, capsys, filled())
    assert code == 0, sheet
    main(['identify', str(THESIS), '--seal-chambers', 'a,b', '--out', str(tmp_path / 't.yaml'), '--json'])
    table = json.loads(capsys.readouterr().out)
    assert sheet['seal_chambers'] == ['a', 'b']
    assert sheet['measured_N'] == table['measured_N']
    assert sheet['parameters'] == table['parameters']
    assert any(rung['law'] == 'physics_based' for rung in sheet['ladder'])  # the dimensions are on the sheet


@pytest.mark.long  # an identification more
def test_a_dash_is_a_reading_that_was_not_to_be_had(tmp_path, capsys):
    changes = {(300.0, 'test 2 dynamic extend'): '-', (300.0, 'test 2 static extend'): '-'}
    code, figures = identified(tmp_path, capsys, filled(changes.items()))
    assert code == 0, figures
    assert any('2 readings are marked' in remark for remark in figures['remarks'])
    assert sum(figures['samples_used'].values()) == 65


@pytest.mark.parametrize(
    ('changes', 'words'),
    [
        ({(300.0, 'test 2 dynamic extend'): ''}, ['1 readings are missing: test 2 dynamic extend at 300 psi', 'dash']),
        ({(p, 'test 3 static retract'): '' for p in (0.0, 100.0, 200.0, 300.0, 400.0)}, ['5 readings', 'and 1 more']),
        ({(500.0, 'test 1 dynamic extend'): '80'}, ['test 1 dynamic extend at 500 psi is 80 lbf', 'measure it again']),
        ({(500.0, 'test 1 dynamic extend'): '8.5.'}, ['8.5.', 'not a number']),
        ({(500.0, 'test 1 dynamic extend'): '-8'}, ["'-8'", 'not a magnitude of a force']),
        ({(100.0, 'test 1 dynamic extend'): '6.5'}, ['the static one is less, 6 lbf']),
    ],
)
def test_missing_and_implausible_readings_are_named(changes, words, tmp_path, capsys):
    code, errors = identified(tmp_path, capsys, filled(changes.items()))
    assert code == 2
    assert [word for word in words if word not in errors] == []
    assert errors.count('\n') == 1


def test_pressures_out_of_order_are_named(tmp_path, capsys):
    order = [0.0, 100.0, 300.0, 200.0, *(100.0 * i for i in range(4, 11))]
    code, errors = identified(tmp_path, capsys, filled(rows=order))
    assert code == 2
    assert 'pressure 200 psi is not above 300 psi' in errors


@pytest.mark.parametrize(
    ('old', 'new', 'words'),
    [
        ('gland_diameter,0.821,in', 'gland_diameter,,in', 'gland_diameter missing'),
        ('gland_diameter,0.821,in', 'gland_diameter,0.821,mm', 'gland_diameter = 0.000821 m is not above'),
        ('gland_diameter,0.821,in', 'gland_diameter,0.821,furlong', "unit 'furlong'"),
        ('section_diameter,0.106,in', 'section_diameter,0.5,in', 'squeeze'),
        ('seals,2,', 'seals,two,', "seals is 'two'"),
        ('[psi]', '[fathom]', 'the first needs one of'),
        ('test 2 static retract', 'test 2 sticky retract', 'is not test NUMBER'),
        ('test 2 static retract', 'test 1 static retract', 'two columns have the same heading'),
    ],
)
def test_dimensions_and_heads_that_make_no_sense_are_named(old, new, words, tmp_path, capsys):
    assert old in filled()
    code, errors = identified(tmp_path, capsys, filled().replace(old, new))
    assert code == 2
    assert words in errors


def test_other_units_mean_the_same(tmp_path):
    inch, millimetre = tmp_path / 'inch.csv', tmp_path / 'mm.csv'
    inch.write_text(filled())
    text = filled()
    for value in (0.821, 0.625, 0.612, 0.106):
        text = text.replace(f',{value},in', f',{25.4 * value:.6g},mm')
    millimetre.write_text(text)
    one, two = read_data_sheet(inch), read_data_sheet(millimetre)
    for name in ('gland_diameter', 'rod_diameter', 'ring_inner_diameter', 'section_diameter'):
        assert two.seal_document['geometry'][name] == pytest.approx(one.seal_document['geometry'][name])
    assert one.dynamic.friction == pytest.approx(two.dynamic.friction)


def test_the_command_prints_a_sheet_and_never_over_a_filled_one(tmp_path, capsys):
    out = tmp_path / 'sheet.csv'
    arguments = ['sheet', 'ring_114', '--seal', 'ms28775_114', '--pressures', '0:7:7', '--pressure-unit', 'bar']
    assert main([*arguments, '--force-unit', 'N', '--length-unit', 'mm', '--tests', '2', '--out', str(out)]) == 0
    assert (tmp_path / 'sheet.html').read_text().startswith('<!DOCTYPE html>')
    before = out.read_bytes()
    assert b'gland_diameter,20.8534,mm' in before
    assert main([*arguments, '--out', str(out)]) == 2
    assert 'not overwriting it' in capsys.readouterr().err
    assert out.read_bytes() == before


def test_an_empty_sheet_is_told_to_be_filled(tmp_path, capsys):
    code, errors = identified(tmp_path, capsys, sheet_text(plan()))
    assert code == 2
    assert '132 readings are missing' in errors


@pytest.mark.parametrize(('low', 'high', 'steps'), [(0.0, 0.0, 5), (-1.0, 5.0, 5), (0.0, 5.0, 1), (0.0, 5.0, 1000)])
def test_an_invalid_plan_is_refused(low, high, steps):
    with pytest.raises(ValueError, match='pressure'):
        FrictionTestPlan('ring', low, high, steps, tests=3, seals=2, geometry=None, **UNITS)
