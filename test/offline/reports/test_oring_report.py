"""The page of a computed O-ring, on a coarse mesh."""

import numpy as np
import pytest
import yaml
from harness.report_page import checked_page
from paths import ROOT

from seal_friction_ros.offline.commands.main import main
from seal_friction_ros.offline.contact.mesh_levels import MeshLevels
from seal_friction_ros.offline.contact.oring_runs import compute_case
from seal_friction_ros.offline.contact.uncertainty import Uncertainty
from seal_friction_ros.offline.reports.formatting import number
from seal_friction_ros.offline.reports.oring_report import friction_deviation, write_oring_report

COARSE = {'numerics': {'lines': 13}}


def case_file(folder, **changes):
    made = yaml.safe_load((ROOT / 'config' / 'oring' / 'ms28775_114.yaml').read_text()) | COARSE | changes
    path = folder / 'case.yaml'
    path.write_text(yaml.safe_dump({key: value for key, value in made.items() if value is not None}))
    return path


@pytest.fixture(scope='module')
def computed(tmp_path_factory):
    return compute_case(case_file(tmp_path_factory.mktemp('case'), pressures=[0.0, 1.7236893e6]))


def test_the_page_stands_alone_and_shows_the_numbers_and_the_thesis(computed, tmp_path):
    write_oring_report(computed, tmp_path / 'page.html')
    page = checked_page(tmp_path / 'page.html')
    assert page.texts['h1'] == ['O-ring ms28775_114_fem']
    assert page.figures == [
        'deformed_shape', 'contact_stress_profiles', 'contact_stress_walls', 'normal_over_axial_force', 'friction',
    ]  # fmt: skip
    normal = [number(force) for force in computed.summary.normal_force_N]
    numbers = next(table for table in page.tables if 'Newton steps' in table[0])
    assert [row[2] for row in numbers[1:]] == normal
    assert page.tiles['area deformation gain'] == f'{computed.summary.area_deformation_gain:.4g}'
    assert 'Against Appendix B of the thesis' in page.texts['h2']
    assert [row['pressure [psi]'] for row in page.table('pressure [psi]')] == ['0', '250']
    off = friction_deviation(computed, computed.file.measured)
    measured = next(table for table in page.tables if table[0][-1] == 'off [%]' and 'measured [N]' in table[0])
    assert [row[3] for row in measured[1:]] == [number(percent, 1, signed=True) for percent in off]
    first = (tmp_path / 'page.html').read_bytes()
    write_oring_report(computed, tmp_path / 'page.html')
    assert (tmp_path / 'page.html').read_bytes() == first


def test_the_page_marks_what_a_finer_mesh_changes_by_more_than_3_percent(computed, tmp_path):
    levels = MeshLevels((9, 13, 18), {'normal_force_N': (0.01, 0.034), 'gain': (0.2,)}, computed.summary.pressure_Pa)
    write_oring_report(computed._replace(mesh=levels), tmp_path / 'page.html')
    page = checked_page(tmp_path / 'page.html')
    (table,) = (table for table in page.tables if 'normal force [%]' in table[0])
    assert [row[1] for row in table[1:]] == ['1.00', '3.40 *']
    assert any('normal_force_N by 3.4 % at 17.2 bar, gain by 20 %' in text for text in page.texts['p'])


def test_a_case_of_one_pressure_without_friction_still_makes_a_page_and_its_name_is_escaped(tmp_path):
    gone = dict.fromkeys(('friction', 'measured', 'unknown'))
    path = case_file(tmp_path, name='<script>x', source='<b>', pressures=[0.0], **gone)
    assert main(['oring', str(path), '--report', str(tmp_path / 'page.html')]) == 0
    page = checked_page(tmp_path / 'page.html')
    assert page.texts['h1'] == ['O-ring <script>x']
    assert page.texts['dd'][0] == '<b>'
    assert page.figures == ['deformed_shape', 'contact_stress_profiles', 'contact_stress_walls']
    assert 'Against Appendix B of the thesis' not in page.texts['h2']


def test_a_case_with_samples_shows_the_quantiles_of_its_friction(computed, tmp_path):
    friction = np.array(computed.summary.friction_N)
    names = tuple(unknown.name for unknown in computed.file.unknown)
    drawn = np.array([[unknown.value] * 2 for unknown in computed.file.unknown]).T
    forces = np.array([friction, 2.0 * friction])
    samples = Uncertainty(0, names, drawn, {}, computed.summary.pressure_Pa, (), friction, forces)
    write_oring_report(computed, tmp_path / 'page.html', samples)
    page = checked_page(tmp_path / 'page.html')
    assert [row['unknown'] for row in page.table('unknown')] == list(names)
    (table,) = (table for table in page.tables if '95 % [N]' in table[0])
    assert [row[1] for row in table[1:]] == [number(force, 3) for force in friction]
    assert [row[3] for row in table[1:]] == [number(1.5 * force, 3) for force in friction]
