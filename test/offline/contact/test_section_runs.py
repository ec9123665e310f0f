"""The command `section`: from a drawing to a seal file."""

import json
from pathlib import Path

import numpy as np
import pytest
import yaml
from harness.report_page import checked_page
from paths import ROOT

from seal_friction_ros.core.friction.seal_file import parse_seal
from seal_friction_ros.core.oring_contact.section import SHAPES, placed
from seal_friction_ros.files import read_yaml
from seal_friction_ros.offline.commands.main import main
from seal_friction_ros.offline.contact.section_runs import Gland, section_document

GLAND = Gland(rod=36e-3, gland=46e-3)
WALLS = ['--rod', '19.346mm', '--gland', '25.7mm', '--sliding', 'bore']
RUBBER = {'hardness': 70.0}


def write(path: Path, points: np.ndarray, unit: str = 'mm') -> Path:
    rows = '\n'.join(f'{r},{z}' for r, z in points.tolist())
    path.write_text(f'r [{unit}],z [{unit}]\n{rows}\n')
    return path


def test_a_drawing_becomes_a_seal_file_that_meets_its_reading(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    drawing = write(tmp_path / 'ring.csv', placed(SHAPES['x_ring'](), 18.64, 3.53).outline)
    out = tmp_path / 'ring.yaml'
    command = ['section', str(drawing), *WALLS, '--pressure', '3bar', '6bar', '--reading', '3bar,10mm/s,6.5N']
    page = tmp_path / 'ring.html'
    files = ['--out', str(out), '--report', str(page)]
    assert main([*command, '--lines', '29', '--film', '0.1,100mm/s', *files, '--json']) == 0
    numbers = json.loads(capsys.readouterr().out)
    seal = parse_seal(read_yaml(out))
    assert seal.coulomb_law.coulomb_friction(3e5) == pytest.approx(6.5, rel=1e-6)
    assert read_yaml(out)['geometry']['ring_inner_diameter'] == pytest.approx(18.64e-3)
    assert numbers['mesh']['lines'] == [20, 29, 41]
    assert 0.0 < max(numbers['mesh']['change']['friction_N']) < 0.1  # a coarse mesh, for speed
    assert numbers['pressure_Pa'] == [0.0, 3e5, 6e5]
    assert all(0.1e-6 < film < 2e-6 for film in numbers['film_out_m'] + numbers['film_back_m'])
    differences = np.subtract(numbers['film_out_m'], numbers['film_back_m'])
    assert numbers['leakage_m3_per_m'] == pytest.approx(0.5 * differences * np.pi * 25.7e-3, rel=1e-3)
    assert 0.0 < max(numbers['mesh']['change']['film_out_m']) < 0.2
    shown = checked_page(page)
    assert 'content="made by seal_friction section"' in page.read_text()
    assert shown.texts['h1'] == ['Seal ring']
    assert any('Mesh: 29 lines' in text for text in shown.texts['p'])
    rows = next(table for table in shown.tables if 'film out [um]' in table[0])[1:]
    table = np.char.replace(rows, '\N{MINUS SIGN}', '-').astype(float)
    in_page = np.array([numbers['film_out_m'], numbers['film_back_m'], numbers['leakage_m3_per_m']]) * [
        [1e6],
        [1e6],
        [1e9],
    ]
    assert table[:, 1:] == pytest.approx(in_page.T, abs=6e-3)


def test_a_seal_that_ends_at_a_corner_says_so_instead_of_a_film(capsys: pytest.CaptureFixture[str]):
    walls = ['--height', '5.7mm', '--rod', '36mm', '--gland', '46mm', '--hardness', '93', '--lines', '13']
    walls += ['--corner-radius', '0']
    assert main(['section', 'u_cup', *walls, '--pressure', '50bar', '--film', '0.03,0.1']) == 0
    assert 'film of a smooth seal: unknown, a lip ends at a corner' in capsys.readouterr().out


def test_a_film_without_viscosity_is_refused(capsys: pytest.CaptureFixture[str]):
    assert main(['section', 'x_ring', '--height', '3.53mm', *WALLS, '--pressure', '3bar', '--film', '0,0.1']) == 2
    assert 'a film needs a viscosity and a speed above 0' in capsys.readouterr().err


def test_a_shape_lies_in_the_middle_of_the_gap_and_a_drawing_where_it_is_drawn(tmp_path: Path):
    shape = section_document('u_cup', GLAND._replace(height=6e-3), rubber=RUBBER)
    assert shape['geometry']['ring_inner_diameter'] == pytest.approx(41e-3 - 6e-3)
    assert shape['groove']['width'] == pytest.approx(1.25 * 1.3 * 6e-3)
    around = write(tmp_path / 'around.csv', placed(SHAPES['u_cup'](), 34.5, 6.0).outline)
    assert section_document(str(around), GLAND, rubber=RUBBER)['geometry']['ring_inner_diameter'] == pytest.approx(
        34.5e-3
    )
    alone = write(tmp_path / 'alone.csv', placed(SHAPES['u_cup'](), 0.0, 6.0).outline)
    assert section_document(str(alone), GLAND, rubber=RUBBER)['geometry']['ring_inner_diameter'] == pytest.approx(35e-3)


@pytest.mark.parametrize(
    ('gland', 'reason'),
    [
        (GLAND, 'give the free height of the section, --height'),
        (GLAND._replace(height=4e-3), '4 mm high, the gap between rod and gland 5 mm'),
        (GLAND._replace(height=6e-3 * 25.4), 'is the unit right'),
        (GLAND._replace(height=6e-3, gland=30e-3), 'the rod is not smaller than the gland'),
        (GLAND._replace(height=6e-3, groove=7e-3), '7.8 mm long, its groove 7 mm'),
    ],
)
def test_a_seal_that_does_not_fit_its_gland_is_refused_before_anything_is_computed(gland: Gland, reason: str):
    with pytest.raises(ValueError, match=reason):
        section_document('u_cup', gland, rubber=RUBBER)


def test_what_is_neither_shape_nor_file_is_refused(capsys: pytest.CaptureFixture[str]):
    assert main(['section', 'v_ring', *WALLS, '--pressure', '1bar']) == 2
    assert "'v_ring' is neither a file (.csv, .dxf) nor one of circle, x_ring" in capsys.readouterr().err


def test_a_wiper_has_one_friction_and_holds_no_pressure(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    command = ['section', 'wiper', '--height', '5.5mm', '--rod', '36mm', '--gland', '46mm', '--lines', '13']
    assert main([*command, '--pressure', '5bar']) == 2
    assert 'a wiper holds no pressure: give a pressure of 0 alone' in capsys.readouterr().err
    out = tmp_path / 'wiper.yaml'
    assert main([*command, '--pressure', '0', '--out', str(out), '--json']) == 0
    numbers = json.loads(capsys.readouterr().out)
    law = parse_seal(read_yaml(out)).coulomb_law
    assert law.coulomb_friction(0.0) == law.coulomb_friction(1e5) == pytest.approx(numbers['friction_N'][0], rel=1e-6)
    assert numbers['normal_force_N'][0] > 0.0
    assert {'normal_force_N', 'peak_contact_stress_Pa', 'contact_width_m'} <= {*numbers['mesh']['change']}


@pytest.mark.parametrize('radius', ['1mm', '1um'])
def test_a_corner_radius_that_is_not_computed_is_refused(radius: str, capsys: pytest.CaptureFixture[str]):
    walls = ['--height', '5.7mm', '--rod', '36mm', '--gland', '46mm', f'--corner-radius={radius}']
    assert main(['section', 'u_cup', *walls, '--pressure', '50bar']) == 2
    assert 'of the height of the section: 0, or 0.005 to 0.04, can be computed' in capsys.readouterr().err


def test_a_section_may_have_unknowns_and_its_samples_are_kept_by_its_outline(tmp_path: Path):
    document = yaml.safe_load((ROOT / 'config' / 'oring' / 'delft_x_ring.yaml').read_text())
    document |= {'unknown': {'rubber.hardness': {'tolerance': 5.0}}, 'numerics': {'lines': 13}, 'pressures': [0.0, 3e5]}
    keys = []
    for radius in (0.2, 0.22):
        document['section'] = {'shape': 'x_ring', 'lobe_radius': radius}
        path = tmp_path / f'{radius}.yaml'
        path.write_text(yaml.safe_dump(document))
        assert main(['oring', str(path), '--uncertain', '2', '--workers', '1', '--work', str(tmp_path / 'work')]) == 0
        keys.append(len(list((tmp_path / 'work').rglob('*.json'))))
    assert keys[1] > keys[0]
