"""``seal_friction identify --next``: the sheet of the next readings, filled in, read and identified."""

import csv
import json

import numpy as np
import pytest
from harness.identify_run import THESIS, Run

from seal_friction_ros.offline.commands.main import main
from seal_friction_ros.offline.identification.data_sheet import read_data_sheet


def friction(bar: float, speed: float) -> float:
    """Of two seals [N], at a speed [mm/s]."""
    return 2.0 * (5.0 + bar ** (2.0 / 3.0) + 0.12 * speed)


def write_table(path, tests=3):
    """A table whose speed follows the pressure."""
    rng = np.random.default_rng(0)
    lines = ['test,pressure_bar,velocity_mm_per_s,direction,friction_N']
    for test in range(tests):
        for bar in range(7, 71, 7):
            speed = 1.4 * bar * (1.0 + 0.08 * rng.normal())
            for side in ('extend', 'retract'):
                force = friction(bar, speed) * (1.0 + 0.02 * rng.normal())
                lines.append(f'{test},{bar},{speed:.4g},{side},{force:.5g}')
    path.write_text('\n'.join(lines) + '\n')
    return path


def filled(text: str) -> str:
    """The sheet as a person fills it in, with the true law."""
    lines = text.splitlines()
    start = next(i for i, line in enumerate(lines) if line.startswith('pressure'))
    sizes = {'gland_diameter': 20.9, 'rod_diameter': 15.9, 'ring_inner_diameter': 15.5, 'section_diameter': 2.7}
    for i, line in enumerate(lines[:start]):
        name, *_ = line.split(',')
        lines[i] = f'{name},{sizes[name]},mm' if name in sizes else line
    for i, line in enumerate(lines[start + 1 :], start=start + 1):
        bar, speed = (float(cell) for cell in line.split(',')[:2])
        force = friction(bar, speed)
        lines[i] = f'{bar:g},{speed:g},{1.2 * force:.5g},{1.2 * force:.5g},{force:.5g},{force:.5g}'
    return '\n'.join(lines) + '\n'


@pytest.fixture(scope='module')
def proposed(tmp_path_factory):
    folder = tmp_path_factory.mktemp('next')
    table, sheet = write_table(folder / 'table.csv'), folder / 'next.csv'
    return table, sheet, Run(folder, str(table), '--seal-chambers', 'a,b', '--next', str(sheet))


def test_the_sheet_has_the_readings_of_the_numbers(proposed):
    _, sheet, run = proposed
    assert run.code == 0, run.errors
    rows = [row for row in csv.reader(sheet.read_text().splitlines()) if row[:1] and row[0][:1].isdigit()]
    expected = sorted((r['pressure_Pa'] / 1e5, 1e3 * r['speed_m_per_s']) for r in run.figures['next'])
    assert np.array([[float(cell) for cell in row[:2]] for row in rows]) == pytest.approx(np.array(expected))
    assert all(r['directions'] == [-1, 1] and r['shrink'] < 1.0 for r in run.figures['next'])
    effect = run.figures['next_effect']
    assert abs(effect['correlation']['after']) < 0.5 * abs(effect['correlation']['before'])
    assert effect['correlation']['before'] < -0.7
    page = sheet.with_suffix('.html').read_text()
    assert 'made by seal_friction identify' in page
    assert page.count('at the speed of the row') == 2
    assert run.figures['sheet'] == str(sheet)


def test_the_filled_sheet_is_read_with_its_speeds(proposed, tmp_path):
    _, sheet, run = proposed
    (tmp_path / 'filled.csv').write_text(filled(sheet.read_text()))
    found = read_data_sheet(tmp_path / 'filled.csv')
    count = 2 * len(run.figures['next'])
    assert len(found.dynamic.friction) == len(found.static.friction) == count
    expected = sorted((r['pressure_Pa'], r['speed_m_per_s']) for r in run.figures['next'] for _ in range(2))
    assert np.column_stack((found.dynamic.pressure, found.dynamic.velocity)) == pytest.approx(np.array(expected))


@pytest.mark.long  # two identifications
def test_the_table_and_the_filled_sheet_give_the_viscous_friction(proposed, tmp_path):
    table, sheet, _ = proposed
    (tmp_path / 'filled.csv').write_text(filled(sheet.read_text()))
    both = Run(tmp_path, str(table), str(tmp_path / 'filled.csv'))
    assert both.code == 0, both.errors
    assert both.document['identified_speed'][1] > 0.09


@pytest.mark.parametrize(
    ('old', 'new', 'words'),
    [
        ('speed [mm/s]', 'speed [knots]', 'needs one of [mm/s]'),
        ('seals,2,', 'seals,two,', "seals is 'two'"),
    ],
)
def test_a_wrong_speed_is_named(old, new, words, proposed, tmp_path):
    text = filled(proposed[1].read_text())
    assert old in text
    (tmp_path / 'filled.csv').write_text(text.replace(old, new))
    with pytest.raises(ValueError, match=r'filled\.csv') as error:
        read_data_sheet(tmp_path / 'filled.csv')
    assert words in str(error.value)


def test_a_row_that_is_there_twice_or_has_no_speed_is_named(proposed, tmp_path):
    text = filled(proposed[1].read_text())
    *others, last = text.splitlines()
    pressure, _, *cells = last.split(',')
    path = tmp_path / 'filled.csv'
    for row, words in ((last, 'once more'), (','.join([pressure, '-3', *cells]), 'above 0'),
                       (','.join([pressure, '', *cells]), 'speed is')):  # fmt: skip
        path.write_text('\n'.join([*others, last, row]) + '\n')
        with pytest.raises(ValueError, match=words):
            read_data_sheet(path)


def test_one_run_of_held_strokes_is_to_be_repeated_on_another_day(tmp_path, capsys):
    table, sheet = tmp_path / 'table.csv', tmp_path / 'next.csv'
    rows = [
        f'{bar},20,{side},{friction(bar, 20.0) * (1.0 + 0.01 * (-1) ** i):.5g}'
        for bar in (20, 40, 60)
        for i in range(4)
        for side in ('extend', 'retract')
    ]
    table.write_text('\n'.join(['pressure_bar,velocity_mm_per_s,direction,friction_N', *rows]) + '\n')
    arguments = [
        'identify',
        str(table),
        '--seal-chambers',
        'a,b',
        '--out',
        str(tmp_path / 's.yaml'),
        '--next',
        str(sheet),
    ]
    assert main([*arguments, '--json']) == 0
    said = capsys.readouterr()
    assert 'repeat the run on another day' in said.err
    assert 'repeat the run on another day' in sheet.read_text()
    numbers = json.loads(said.out)
    assert numbers['next_effect']['limit'] == 'run to run'
    assert numbers['next_effect']['another_run']['shrink'] == pytest.approx(0.9545, abs=1e-3)
    assert [r['pressure_Pa'] for r in numbers['next'] if r['is_repeated']] == pytest.approx([20e5, 40e5, 60e5])


def test_the_page_of_the_sheet_is_not_the_report(tmp_path, capsys):
    names = ['--report', str(tmp_path / 'x.html'), '--next', str(tmp_path / 'x.csv'), '--out', str(tmp_path / 's.yaml')]
    assert main(['identify', str(THESIS), *names]) == 2
    assert 'choose another name' in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
