"""The page of a seal file: Figures 22 and 23 of the thesis as numbers, and the page itself."""

import dataclasses
import shutil
from pathlib import Path

import numpy as np
import pytest
import yaml
from harness.report_page import checked_page

from seal_friction_ros.core.foundation.units import INCH, LBF, PSI
from seal_friction_ros.core.friction.actuator import MountedSeal
from seal_friction_ros.core.friction.laws.velocity_terms import VelocityTerms
from seal_friction_ros.core.friction.seal_file import parse_seal
from seal_friction_ros.files import config_path, read_yaml
from seal_friction_ros.offline.reports.formatting import number
from seal_friction_ros.offline.reports.seal_charts import (
    STATE_PRESSURE,
    charted_seal,
    friction_over_force_sum,
    friction_over_velocity,
    write_seal_charts,
)
from seal_friction_ros.offline.reports.thesis_data import dynamic_readings

SEAL_FILE = config_path('seals', 'ms28775_114')
SHOWN = charted_seal(parse_seal(read_yaml(SEAL_FILE)))
COULOMB = SHOWN.friction(500.0 * PSI).coulomb_friction


def test_figure_22_friction_is_coulomb_friction_with_the_sign_of_the_velocity():
    velocity = np.linspace(-5.0, 5.0, 1001) * INCH
    friction = friction_over_velocity(SHOWN, STATE_PRESSURE, velocity)
    assert pytest.approx(500.0 * PSI) == STATE_PRESSURE
    assert np.array_equal(friction, COULOMB * np.sign(velocity))
    assert friction[500] == 0.0  # V = 0, and no force sum


def test_figure_22_is_within_the_scatter_of_the_tests_at_500_psi():
    pressure, readings = dynamic_readings()
    at_500 = readings[np.isclose(pressure, 500.0 * PSI)]
    assert len(at_500) == 6
    assert at_500.min() <= COULOMB <= at_500.max()
    assert pytest.approx(at_500.mean(), rel=0.04) == COULOMB
    assert at_500.mean() / LBF == pytest.approx(9.50, abs=0.005)


def test_figure_23_at_rest_friction_is_the_force_sum_between_the_thresholds_and_the_threshold_beyond():
    force_sum = np.linspace(-2.0 * COULOMB, 2.0 * COULOMB, 4001)
    friction = friction_over_force_sum(SHOWN, STATE_PRESSURE, force_sum)
    inside = np.abs(force_sum) < COULOMB
    assert inside.any()
    assert not inside.all()
    assert np.array_equal(friction[inside], force_sum[inside])
    assert np.array_equal(friction[~inside], COULOMB * np.sign(force_sum[~inside]))


def test_figure_22_follows_the_velocity_where_the_friction_does():
    terms = VelocityTerms(viscous_friction=100.0, asymmetry=0.1)
    seal = dataclasses.replace(SHOWN.seal, velocity_terms=terms)
    shown = dataclasses.replace(SHOWN, seal=seal, mounted=(MountedSeal(seal, 'a'),))
    coulomb = shown.friction(STATE_PRESSURE).coulomb_friction
    friction = friction_over_velocity(shown, STATE_PRESSURE, np.array([-0.1, 0.0, 0.05]))
    assert friction == pytest.approx([-0.9 * (coulomb + 10.0), 0.0, 1.1 * (coulomb + 5.0)])


def test_figure_23_with_stiction_has_its_thresholds_further_out():
    breakaway = COULOMB + SHOWN.friction(STATE_PRESSURE).stiction
    friction = friction_over_force_sum(
        SHOWN, STATE_PRESSURE, np.array([1.01 * COULOMB, 3.0 * COULOMB]), use_stiction=True
    )
    assert friction == pytest.approx([1.01 * COULOMB, breakaway])


@pytest.mark.parametrize('name', ['ms28775_114', 'ms28775_114_table', 'ms28775_114_prior_art'])
def test_each_seal_file_of_the_project_makes_a_page(tmp_path, name):
    summary = write_seal_charts(config_path('seals', name), tmp_path / 'charts.html')
    page = checked_page(summary.page)
    figures = set(page.figures)
    assert {path.stem for path in summary.figures} == figures
    assert {'fig12_prior_art', 'fig17_prior_art_and_tests', 'fig24_model_over_pressure'} <= figures
    assert {'fig22_state_1', 'fig23_states_2_and_3'} <= figures
    assert ('fig18_coefficient_of_friction' in figures) == (name != 'ms28775_114_prior_art')
    assert 'http' not in page.prose
    rows = page.table('pressure [bar]')
    assert [row['mean of the tests [N]'] for row in rows] == [number(force) for force in summary.numbers['measured']]
    frictions = [number(force) for force in summary.numbers['coulomb_friction']]
    assert [row['Coulomb friction, two seals [N]'] for row in rows] == frictions
    found = summary.numbers
    assert (found['seal'], found['seal_count'], len(found['measured'])) == (name, 2, 11)


@pytest.mark.renders
@pytest.mark.long
def test_the_same_seal_gives_the_same_bytes(tmp_path):
    one = write_seal_charts(SEAL_FILE, tmp_path / 'a' / 'charts.html')
    other = write_seal_charts(SEAL_FILE, tmp_path / 'b' / 'charts.html')
    for a, b in zip((one.page, *one.figures), (other.page, *other.figures), strict=True):
        assert a.read_bytes() == b.read_bytes()


def seal_file(folder: Path, **changes) -> Path:
    document = {**read_yaml(SEAL_FILE), **changes}
    path = folder / 'seal.yaml'
    path.write_text(yaml.safe_dump(document))
    return path


def test_another_seal_is_drawn_alone_without_the_data_of_the_thesis(tmp_path):
    path = seal_file(tmp_path, name='<i>mine</i> $x_{1}$', identified_pressure=[0.0, 1e6])
    summary = write_seal_charts(path, tmp_path / 'charts.html')
    page = checked_page(summary.page)
    assert summary.numbers['seal_count'] == 1
    assert summary.numbers['measured'] == ()
    assert not any('prior_art' in figure.stem for figure in summary.figures)
    assert page.texts['h1'] == ['Seal <i>mine</i> $x_{1}$']
    assert page.texts['p.note'][0].startswith('500 psi is outside the identified range')


def test_an_invalid_seal_file_is_one_line_that_names_it_and_nothing_is_written(tmp_path):
    path = seal_file(tmp_path, stiction=-1.0)
    with pytest.raises(ValueError, match=r'seal\.yaml.*stiction = -1\.0') as error:
        write_seal_charts(path, tmp_path / 'out' / 'charts.html')
    assert '\n' not in str(error.value)
    assert not (tmp_path / 'out').exists()
    shutil.rmtree(tmp_path / 'none', ignore_errors=True)
    with pytest.raises(ValueError, match='No such file'):
        write_seal_charts(tmp_path / 'none' / 'seal.yaml', tmp_path / 'out.html')
