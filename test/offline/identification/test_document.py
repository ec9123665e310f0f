"""The seal file of an identification, and the JSON numbers: the node computes what was fitted."""

import math
import shutil

import numpy as np
import pytest
from harness.identify_run import BARS, KEYS, THESIS, THESIS_RIG, Run, data, delft, estimates_of, few_of_the_thesis
from paths import ROOT

from seal_friction_ros.core.estimation.adaptation import NEW_RUN
from seal_friction_ros.core.estimation.estimator import EstimatorParameters, EstimatorSettings
from seal_friction_ros.core.foundation.units import LBF
from seal_friction_ros.core.friction.actuator import MountedSeal, actuator_friction
from seal_friction_ros.core.friction.seal_file import parse_seal
from seal_friction_ros.core.friction.states import FrictionState
from seal_friction_ros.core.messages.records import Status
from seal_friction_ros.files import default_configuration
from seal_friction_ros.offline.commands.main import main
from seal_friction_ros.offline.replay.replay import replay

# --- the file works in the node ---


@pytest.mark.parametrize(
    'law',
    ['constant_coulomb']
    + [
        pytest.param(law, marks=pytest.mark.long)
        for law in ('pressure_power_law_2_3', 'physics_based', 'physics_based_asymmetric')
    ],
)
def test_the_node_says_what_was_fitted(law, run_of):
    run = run_of(str(THESIS), *THESIS_RIG, '--law', law)
    for pressure, fitted, std in zip(*(run.figures[k] for k in ('pressure_Pa', 'fitted_N', 'std_N')), strict=True):
        estimate = estimates_of(run, pressure, 0.01)
        assert estimate.coulomb_friction == pytest.approx(fitted, rel=1e-5)
        assert estimate.coulomb_friction_std == pytest.approx(math.hypot(NEW_RUN * fitted, std), rel=0.06)
        assert estimate.status == 0
        assert estimate.state == FrictionState.SLIDING
        assert estimate.breakaway_force > estimate.coulomb_friction
    asymmetry = run.figures['parameters'].get('asymmetry', 0.0)
    both = [abs(estimates_of(run, 2e6, side * 0.01).friction_force) for side in (1.0, -1.0)]
    assert both[0] / both[1] == pytest.approx((1.0 + asymmetry) / (1.0 - asymmetry))


def test_the_seal_file_has_the_covariance_of_the_parameters(run_of):
    run = run_of(str(THESIS), *THESIS_RIG, '--law', 'constant_coulomb')
    covariance = parse_seal(run.document).covariance
    errors = run.figures['standard_errors']
    assert covariance.terms == tuple(errors)
    assert covariance.std == pytest.approx(list(errors.values()))


def test_beyond_the_pressures_that_were_measured_the_node_says_so(run_of):
    run = run_of(str(THESIS), *THESIS_RIG)
    assert estimates_of(run, 8e6, 0.01).status == Status.OUTSIDE_IDENTIFIED_RANGE


def test_a_bag_of_the_node_identifies_and_its_seal_file_replays(tmp_path):
    run = Run(tmp_path, str(ROOT / 'bags' / 'pull_test'))
    assert run.code == 0, run.errors
    assert run.figures['seal_chambers'] == ['a', 'b']  # from the configuration in the bag, as is the geometry
    assert run.ladder('physics_based')['error'] < 0.1
    assert run.figures['measured_N'] == pytest.approx([x * LBF for x in (2.75, 5.0, 6.0)], rel=1e-5)
    breakaway = run.figures['breakaway']
    assert breakaway['fitted_N'][0] > run.figures['fitted_N'][0] + 1.0  # [N] static readings are above dynamic ones
    replayed = tmp_path / 'replayed'
    arguments = ['replay', str(ROOT / 'bags' / 'pull_test'), '--seal', str(run.out), '--out', str(replayed)]
    assert main(arguments) == 0
    assert main(['replay', str(replayed), '--verify']) == 0
    again = Run(tmp_path, str(replayed), name='again')
    assert again.figures['parameters'] == run.figures['parameters']


@pytest.mark.parametrize('version', ['old', 'new'])
def test_no_geometry_is_taken_from_the_placeholder_seals_of_a_bag(tmp_path, version):
    bag = ROOT / 'test' / 'corpus' / 'version_1' / 'pull_test'  # recorded with the default configuration
    if version == 'new':
        bag = tmp_path / 'bag'
        replay(ROOT / 'bags' / 'pull_test', default_configuration(), bag)
    run = Run(tmp_path, str(bag))
    assert run.code == 0, run.errors
    assert 'physics_based' not in {rung['law'] for rung in run.figures['ladder']}
    assert 'geometry' not in run.document
    assert f'{bag.name} was recorded with the placeholder seals of the default configuration' in run.errors
    assert '--seal' in run.errors


def test_one_note_names_all_bags_with_placeholder_seals(tmp_path):
    bags = [ROOT / 'test' / 'corpus' / 'version_1' / 'pull_test', tmp_path / 'new']
    replay(ROOT / 'bags' / 'pull_test', default_configuration(), bags[1])
    run = Run(tmp_path, *map(str, bags))
    assert run.code == 0, run.errors
    assert run.errors.count('recorded with the placeholder seals') == 1
    assert 'pull_test, new were recorded with the placeholder seals of the default configuration' in run.errors


@pytest.mark.long  # two identifications
def test_a_log_and_the_bag_imported_from_it_give_the_same_law(tmp_path, run_of):
    bags = []
    for bar in BARS:
        log = data(f'delft/O-ring257_{bar}bar.csv')
        bags.append(str(tmp_path / f'O{bar}'))
        assert main(['import', 'log', str(log), '--rig', 'delft', '--out', bags[-1]]) == 0
    of_bags = Run(tmp_path, *bags, name='bags')
    of_logs = run_of(*delft('O-ring257'))
    assert of_bags.figures['parameters'] == of_logs.figures['parameters']


# --- the file itself ---


def test_json_has_the_documented_keys_and_the_file_names_its_source(run_of):
    run = run_of(str(THESIS), *THESIS_RIG)
    assert set(KEYS) <= set(run.figures)
    part = run.document['identification']
    assert {'law', 'parameters', 'standard_errors', 'residual_N', 'data', 'left_out_by', 'warnings'} <= set(part)
    (source,) = part['data']
    assert source['name'] == 'friction_tests.csv'
    assert len(source['sha256']) == 64
    assert run.figures['standard_errors'].keys() == run.figures['parameters'].keys()
    assert np.array(part['measured_N']) - np.array(part['fitted_N']) == pytest.approx(part['residual_N'], abs=1e-4)


@pytest.mark.long
def test_the_same_sources_give_the_same_bytes(tmp_path):
    few = str(few_of_the_thesis(tmp_path))
    one, two = (Run(tmp_path, few, *THESIS_RIG, '--name', 'x', name=n) for n in ('one', 'two'))
    assert one.out.read_bytes() == two.out.read_bytes()
    moved = shutil.copytree(ROOT / 'bags' / 'pull_test', tmp_path / 'elsewhere' / 'pull_test')
    here = Run(tmp_path, str(ROOT / 'bags' / 'pull_test'), '--name', 'x', name='here')
    there = Run(tmp_path, str(moved), '--name', 'x', name='there')
    assert here.out.read_bytes() == there.out.read_bytes()


def test_the_uncertainty_of_the_seals_adds_up_to_that_of_the_rig(run_of):
    run = run_of(str(THESIS), *THESIS_RIG)
    seal = parse_seal(run.document)
    both = actuator_friction((MountedSeal(seal, 'a'), MountedSeal(seal, 'b')), 2e6, 2e6)
    expected = np.hypot(run.figures['relative_std'] * both.coulomb_friction, run.figures['absolute_std_N'])
    assert both.coulomb_friction_std == pytest.approx(expected, rel=1e-4)


def test_a_law_by_name_is_saved_and_the_recommended_one_still_told(tmp_path, run_of):
    few = str(few_of_the_thesis(tmp_path))
    run = run_of(few, '--law', 'constant_coulomb')
    assert (run.figures['law'], run.figures['recommended_law']) == ('constant_coulomb', 'pressure_power_law_2_3')
    assert Run(tmp_path, few, '--law', 'magic').code == 2


def test_estimator_needs_no_more_than_the_file(run_of):
    run = run_of(str(THESIS), *THESIS_RIG)
    seal = parse_seal(run.document)
    assert EstimatorParameters(EstimatorSettings(), (MountedSeal(seal, 'a'),))
