"""The command ``oring``: a case file to numbers, a seal file and a page; what is wrong is said in one line."""

import json
import re
from pathlib import Path

import numpy as np
import oring_accuracy
import pytest
import yaml
from paths import ROOT

from seal_friction_ros.core.friction.geometry import projected_area
from seal_friction_ros.core.friction.seal_file import parse_seal
from seal_friction_ros.core.oring_contact.oring_case_file import parse_oring_case
from seal_friction_ros.core.oring_contact.results import WallContact
from seal_friction_ros.core.oring_contact.ring_friction import PRIOR_LAW
from seal_friction_ros.files import read_yaml
from seal_friction_ros.offline.commands.main import main
from seal_friction_ros.offline.contact.oring_runs import compute_case
from seal_friction_ros.offline.reports.thesis_data import ThesisContact, appendix_b, dynamic_readings

CASES = ROOT / 'config' / 'oring'
KEYS = {'pressure_Pa', 'normal_force_N', 'axial_force_N', 'peak_contact_stress_Pa', 'contact_width_m'}


def document(**changes) -> dict:
    """The calibrated case of the thesis on a coarse mesh."""
    made = yaml.safe_load((CASES / 'ms28775_114.yaml').read_text())
    made |= {'numerics': {'lines': 13}, 'pressures': [0.0, 1.7e6]} | changes
    return {key: value for key, value in made.items() if value is not None}


def written(folder: Path, made: object) -> Path:
    path = folder / 'case.yaml'
    path.write_text(yaml.safe_dump(made))
    return path


@pytest.fixture(scope='module')
def computed(tmp_path_factory):
    """Numbers, seal file and page of one run of the command."""
    folder = tmp_path_factory.mktemp('oring')
    case = written(folder, document())
    arguments = [
        'oring',
        str(case),
        '--out',
        str(folder / 'seal.yaml'),
        '--json',
    ]
    assert main(arguments) == 0
    return folder


def test_json_has_one_number_for_every_pressure(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    assert main(['oring', str(written(tmp_path, document())), '--pressures', '0', '5e5', '--json']) == 0
    figures = json.loads(capsys.readouterr().out)
    assert set(figures) >= KEYS
    assert all(len(figures[key]) == 2 for key in KEYS)
    assert figures['pressure_Pa'] == [0.0, 5e5]
    for result, wall in ((0, 'rod'), (0, 'gland'), (1, 'rod'), (1, 'gland'), (1, 'wall')):
        profile = figures[f'{wall}_profile'][result]
        assert profile['position_m'] == sorted(profile['position_m'])
        assert len(profile['stress_Pa']) == len(profile['position_m']) > 3
    assert max(figures['rod_profile'][1]['stress_Pa']) == figures['peak_contact_stress_Pa'][1]
    assert figures['wall_profile'][0] == {'position_m': [], 'stress_Pa': []}
    assert figures['normal_force_N'] == sorted(figures['normal_force_N'])
    area = projected_area(parse_oring_case(document()).case.geometry)
    assert figures['axial_force_N'][1] == pytest.approx(5e5 * area, rel=0.01)
    assert figures['mesh']['lines'] == [9, 13, 18]
    assert all(0.0 < change < 0.1 for change in figures['mesh']['change']['friction_N'])
    assert any('wall_force_N by' in marked for marked in figures['mesh']['marked'])  # 13 lines are few


def test_the_seal_file_made_is_a_seal_with_the_computed_normal_force(computed: Path):
    text = (computed / 'seal.yaml').read_text()
    seal = parse_seal(yaml.safe_load(text))
    assert 'Mesh: 13 lines; 9 or 18 change by MORE THAN 3 %' in yaml.safe_load(text)['source']
    table = yaml.safe_load(text)['normal_force']
    assert table['law'] == 'monotone_table'
    force = table['normal_forces'][0]
    coefficient = seal.coulomb_law.friction_coefficient_law.coefficient_of_friction(force)
    assert seal.coulomb_law.coulomb_friction(0.0) == pytest.approx(coefficient * force)
    assert seal.pressure_max == 1.7e6


def test_the_seal_that_comes_with_the_package_was_made_by_the_command_from_its_case():
    seal, case = read_yaml(ROOT / 'config' / 'seals' / 'ms28775_114_fem.yaml'), read_yaml(CASES / 'ms28775_114.yaml')
    assert seal['name'] == case['name']
    assert seal['normal_force']['pressures'] == pytest.approx(case['pressures'])
    assert {key: seal['geometry'][key] for key in case['geometry']} == case['geometry']
    assert seal['friction_coefficient'] == case['friction']['friction_coefficient']
    force = [case.normal_force for case in appendix_b().values()]
    assert seal['normal_force']['normal_forces'] == pytest.approx(force, rel=0.05)


def test_its_friction_from_geometry_is_within_5_percent_of_the_mean_of_the_tests():
    seal = parse_seal(read_yaml(ROOT / 'config' / 'seals' / 'ms28775_114_fem.yaml'))
    pressures, friction = dynamic_readings()
    for pressure in set(pressures):
        mean = friction[pressures == pressure].mean()
        assert 2.0 * seal.coulomb_law.coulomb_friction(pressure) == pytest.approx(mean, rel=0.05)


@pytest.mark.parametrize('name', ['ms28775_114', 'ms28775_114_blind'])
def test_measured_friction_in_the_case_files_is_that_of_the_tables(name: str):
    measured = parse_oring_case(read_yaml(CASES / f'{name}.yaml')).measured
    pressures, friction = dynamic_readings()
    means = [friction[abs(pressures - p) < 1.0].mean() for p in measured.pressures]
    assert measured.frictions == pytest.approx(means, rel=1e-3)


@pytest.mark.parametrize('path', sorted(CASES.glob('*.yaml')), ids=lambda path: path.stem)
def test_every_case_that_comes_with_the_package_is_one_and_says_where_it_is_from(path: Path):
    file = parse_oring_case(read_yaml(path))
    assert len(file.source) > 80
    assert file.friction is not None
    assert file.measured is not None


def test_progress_is_one_step_a_pressure(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    shares = []
    monkeypatch.setattr('seal_friction_ros.offline.work.progress._report_share', shares.append)
    compute_case(written(tmp_path, document()))
    assert shares == [0.5, 0.5]


@pytest.mark.parametrize(
    ('changes', 'message'),
    [
        ({'name': 7}, 'case file: name = 7 is not one line of text'),
        ({'colour': 'black'}, 'case ms28775_114_fem has no colour: it has name, source'),
        ({'rubber': {'hardness': 70.0, 'elastic_modulus': 5e6}}, 'give one of hardness [Shore A] and elastic_modulus'),
        ({'rubber': {'hardness': 7.0}}, 'rubber: hardness = 7.0 Shore A is outside 20 to 95'),
        ({'rubber': None}, 'rubber: give one of hardness'),
        ({'groove': None}, 'groove is not a mapping'),
        ({'groove': {'width': 1.5e-3}}, 'case ms28775_114_fem: OringCase.groove: overfilled gland: the rubber has'),
        (
            {'geometry': {'section_diameter': 2.6e-3}},
            'geometry lacks ring_inner_diameter, rod_diameter, gland_diameter',
        ),
        ({'numerics': {'lines': 3}}, 'numerics: OringNumerics.lines = 3  is below its lower bound 9'),
        ({'pressures': [0.0, 1e8]}, 'extrudes the ring'),
        ({'pressures': 'all'}, "pressures = 'all' is not a list"),
        ({'friction': {'stiction': 1.0}}, 'give one of contact_shear and friction_coefficient; got stiction'),
        ({'measured': {'seals': 1, 'pressures': [1.0], 'frictions': []}}, '0 frictions at 1 pressures'),
    ],
)
def test_an_unusable_case_is_exit_code_2_and_one_line(
    changes: dict, message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    path = written(tmp_path, document(**changes))
    assert main(['oring', str(path)]) == 2
    said = capsys.readouterr().err
    assert message in said
    assert str(path) in said
    assert len(said.splitlines()) == 1


def test_commands_and_case_file_of_the_docs_work(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    page = (ROOT / 'docs' / 'oring.md').read_text()
    with_package, *own = re.findall(r'^\.venv/bin/seal_friction (oring .*?) +#', page, re.MULTILINE)
    assert f'seal_friction {with_package}\n' in (ROOT / 'README.md').read_text()  # where all commands are run
    assert len(own) == 5
    monkeypatch.chdir(tmp_path)
    (case,) = re.findall(r'```yaml\n(.*?)```', page, re.DOTALL)
    Path('my_case.yaml').write_text(f'{case}numerics: {{lines: 9}}\n')
    Path('build').mkdir()
    assert [main(command.replace('--uncertain 100', '--uncertain 2').split()) for command in own] == [0] * 5
    assert parse_seal(read_yaml(Path('build/my_seal.yaml'))).name == 'my_ring'


def test_the_tables_of_the_docs_are_those_of_the_script():
    page = (ROOT / 'docs' / 'oring.md').read_text()
    named = {name for names in re.findall(r'oring_accuracy\.py ([a-z ]+)`', page) for name in names.split()}
    assert named == set(oring_accuracy.TABLES)
    (row,) = oring_accuracy.converging('lines', (9,))
    assert row['F_n at 1000 psi [N]'] == pytest.approx(419.2, rel=0.1)


def test_a_profile_that_is_only_shifted_does_not_deviate():
    place = np.linspace(0.0, 1.8e-3, 37)
    stress = 1e6 * (place / 1.8e-3) * (1.0 - place / 1.8e-3)
    its = ThesisContact(0.0, float(stress.max()), 1.8e-3, place, stress)
    rod = WallContact(place - 0.7e-3, stress, 0.0, 0.0, float(stress.max()), (-0.7e-3, 1.1e-3))
    assert max(oring_accuracy.profile_deviation(its, rod)) < 0.01
    rms, worst = oring_accuracy.profile_deviation(its, rod._replace(stress=1.1 * stress))
    assert worst == pytest.approx(0.1, abs=0.02)
    assert rms < worst


def test_lindley_is_beside_hertz_and_the_finite_elements(monkeypatch: pytest.MonkeyPatch):
    for name, values in (
        ('SQUEEZES', (0.08,)),
        ('LARGER_SQUEEZES', ()),
        ('HERTZ_LINES', (17,)),
        ('RITZ_DEGREES', (16,)),
    ):
        monkeypatch.setattr(oring_accuracy, name, values)
    (row,) = oring_accuracy.squeezed()
    assert row['elements, 17 lines'] == pytest.approx(row['Ritz, degree 16'], rel=0.02)
    assert row['elements, 17 lines'] == pytest.approx(row['Hertz'], rel=0.05)
    assert row['Lindley'] == pytest.approx(0.72 * row['elements, 17 lines'], rel=0.03)


def test_what_stops_a_computation_names_the_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    path = written(tmp_path, document(groove={'width': 2.62e-3}))  # the section fits, the squeezed one does not
    assert main(['oring', str(path)]) == 2
    assert f'{path}: case ms28775_114_fem: overfilled gland: the squeezed ring is' in capsys.readouterr().err


def test_a_seal_file_that_is_there_is_not_overwritten_and_nothing_is_computed_first(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    out = tmp_path / 'seal.yaml'
    out.write_text('mine')
    assert main(['oring', 'ms28775_114', '--out', str(out)]) == 2
    assert 'exists already: not overwriting it' in capsys.readouterr().err
    assert out.read_text() == 'mine'


PRESSURE, SPEED, FRICTION = 1.7e6, 0.01, 8.0  # [Pa], [m/s], [N]


def read(path: Path):
    return parse_seal(read_yaml(path))


def test_one_reading_makes_a_seal_file_with_that_friction_and_15_percent(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    path, out = written(tmp_path, document(friction=None, unknown=None)), tmp_path / 'seal.yaml'
    assert main(['oring', str(path), '--reading', '17 bar, 10mm/s,8N', '--out', str(out), '--json']) == 0
    found = json.loads(capsys.readouterr().out)
    assert found['friction_N'][1] == pytest.approx(FRICTION)
    assert found['reading_deviations'] == pytest.approx([0.0], abs=1e-9)
    seal = read(out)
    assert seal.coulomb_law.coulomb_friction(PRESSURE) == pytest.approx(FRICTION, rel=1e-5)
    assert seal.coulomb_law.shear_stress == pytest.approx(found['shear_stress_Pa'])
    assert seal.uncertainty.relative_std == 0.15
    assert (seal.identified_motion.slowest, seal.identified_motion.fastest) == (SPEED, SPEED)


def test_without_friction_or_reading_the_seal_file_is_a_prior_with_a_factor_of_three(tmp_path: Path):
    path, out = written(tmp_path, document(friction=None, unknown=None)), tmp_path / 'seal.yaml'
    assert main(['oring', str(path), '--out', str(out)]) == 0
    seal = read(out)
    assert seal.uncertainty.relative_std == 2.0
    assert seal.stiction_ratio > 0.0
    law = seal.coulomb_law
    assert (law.shear_stress, law.knee_stress) == (PRIOR_LAW.shear_stress, PRIOR_LAW.knee_stress)


def test_the_law_of_a_seal_makes_the_seal_of_another_size(tmp_path: Path):
    first, second = tmp_path / 'seal.yaml', tmp_path / 'large.yaml'
    assert main(['oring', str(written(tmp_path, document())), '--reading', '1.7e6,0.01,8', '--out', str(first)]) == 0
    geometry = dict(document()['geometry'])
    gap = geometry['gland_diameter'] - geometry['rod_diameter']
    geometry |= {key: 2.0 * geometry[key] for key in ('rod_diameter', 'ring_inner_diameter')}
    large = written(tmp_path, document(geometry=geometry | {'gland_diameter': geometry['rod_diameter'] + gap}))
    assert main(['oring', str(large), '--law-from', str(first), '--out', str(second)]) == 0
    seal = read(second)
    assert seal.coulomb_law.coulomb_friction(PRESSURE) == pytest.approx(2.0 * FRICTION, rel=0.03)
    assert seal.uncertainty.relative_std == 2.0


@pytest.mark.parametrize(
    ('more', 'message'),
    [
        (['--reading', '1e6,0.01'], '1e6,0.01 is not 3 values, separated by commas'),
        (['--reading', '1e6,10 kg,5'], "unit 'kg' is not for a velocity"),
        (['--reading=-1,0.01,5'], '-1 is not a finite number of at least 0'),
        (['--reading', '5e6,0.01,5'], 'are outside the computed 0 to 1.7e+06 Pa: give --pressures'),
        (['--reading', '1e6,0.01,5', '--uncertain', '2'], '--uncertain is for a ring without a --reading'),
        (['--law-from', 'ms28775_114'], 'its physics_based is for its own size'),
    ],
)
def test_a_reading_or_law_that_cannot_be_used_is_said_in_one_line(
    more: list[str], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    try:
        code = main(['oring', str(written(tmp_path, document())), *more])
    except SystemExit as end:
        code = end.code
    assert code == 2
    assert message in capsys.readouterr().err


def test_a_seal_file_needs_two_pressures(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    path = written(tmp_path, document(pressures=[0.0]))
    assert main(['oring', str(path), '--out', str(tmp_path / 'seal.yaml')]) == 2
    assert 'needs two pressures at least' in capsys.readouterr().err
    assert not (tmp_path / 'seal.yaml').exists()
