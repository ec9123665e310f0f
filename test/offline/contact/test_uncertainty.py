"""``--uncertain N``: samples of what is not known, their quantiles, and what becomes of samples that fail."""

import json
from collections.abc import Mapping
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import yaml
from paths import ROOT

from seal_friction_ros.core.foundation.unknowns import Unknown
from seal_friction_ros.files import read_yaml
from seal_friction_ros.offline.commands.main import main
from seal_friction_ros.offline.contact.sampling import coarse_case, latin_hypercube, sampled
from seal_friction_ros.offline.contact.uncertainty import Uncertainty
from seal_friction_ros.offline.work.finished_parts import Part, part_key
from seal_friction_studies.offline.study_runs import single_case

DRY = """name: dry
numerics: {cells: 32}
grease: {yield_stress: 0.0, consistency_index: 0.0, base_viscosity: 1.0e-6}
map: {velocity_min: 1.0e-3, velocity_max: 1.0e-2, velocities: 2, pressure_max: 1.0e+5, pressures: 2}
unknown: {seal.solid_shear_stress: {factor: 2.0}}
"""


@pytest.fixture
def dry(tmp_path: Path) -> str:
    """A seal without a film, whose friction is proportional to its solid shear stress."""
    path = tmp_path / 'dry.yaml'
    path.write_text(DRY)
    return str(path)


@pytest.fixture
def ring(tmp_path: Path) -> str:
    """A ring that some samples do not squeeze."""
    made = yaml.safe_load((ROOT / 'config' / 'oring' / 'ms28775_114.yaml').read_text())
    made |= {'numerics': {'lines': 9}, 'pressures': [0.0, 1e5]}
    made['unknown'] = {
        'geometry.section_diameter': {'tolerance': 0.08e-3},
        'geometry.gland_diameter': {'tolerance': 0.17e-3},
        'friction_coefficient': {'relative_std': 0.1},
    }
    path = tmp_path / 'ring.yaml'
    path.write_text(yaml.safe_dump(made))
    return str(path)


def answer(capsys, *words: str) -> dict:
    assert main([*words, '--json']) == 0
    return json.loads(capsys.readouterr().out)


UNKNOWNS = (
    Unknown('a', 2.0, 'relative_std', (0.5,)),
    Unknown('b', 3.0, 'factor', (2.0,)),
    Unknown('c', 4.0, 'tolerance', (1.0,)),
    Unknown('d', 0.0, 'range', (0.0, 0.1)),
)


def test_each_unknown_has_one_value_in_each_part_of_its_distribution_and_a_seed_gives_the_same_ones():
    count = 25
    drawn = latin_hypercube(UNKNOWNS, count, 3)
    assert drawn.shape == (count, len(UNKNOWNS))
    edges = np.arange(1, count) / count
    for unknown, values in zip(UNKNOWNS, drawn.T, strict=True):
        assert np.searchsorted(unknown.at(edges), np.sort(values)).tolist() == list(range(count))
    np.testing.assert_array_equal(drawn, latin_hypercube(UNKNOWNS, count, 3))
    assert not np.array_equal(drawn, latin_hypercube(UNKNOWNS, count, 4))


def test_friction_that_is_proportional_to_an_unknown_has_its_quantiles(dry, tmp_path, capsys):
    """And it does not depend on the number of workers, and goes on where it was."""
    seal_file, work = tmp_path / 'seal.yaml', tmp_path / 'work'
    words = ('ehl', 'map', dry, '--uncertain', '10', '--seed', '7', '--work', str(work))
    found = answer(capsys, *words, '--seal-file', str(seal_file), '--workers', '2')
    spread = found['uncertainty']
    nominal = np.array(spread['friction_N'])
    drawn = latin_hypercube(single_case(dry, 'map').unknown, 10, 7)[:, 0] / 1.5e6
    for percent in (5, 50, 95):
        quantile = np.array(spread[f'friction_N_{percent}_percent']) / nominal
        np.testing.assert_allclose(quantile, np.quantile(drawn, percent / 100.0, method='hazen'), rtol=1e-4)
        np.testing.assert_allclose(
            quantile, 2.0 ** (2.0 * percent / 100.0 - 1.0), rtol=2.0**0.1 - 1.0 + 1e-3
        )  # half a part
    above = 2.0 ** (2.0 * 0.8413 - 1.0) - 1.0
    assert spread['relative_std'] == pytest.approx(above, rel=0.1)
    assert read_yaml(seal_file)['uncertainty']['relative_std'] == pytest.approx(spread['relative_std'], rel=1e-2)
    assert spread['rank_correlation'] == {'seal.solid_shear_stress': pytest.approx(1.0)}
    assert spread['failed'] == []
    times = {path: path.stat().st_mtime_ns for path in work.iterdir()}
    assert answer(capsys, *words, '--workers', '1') == found
    assert {path: path.stat().st_mtime_ns for path in work.iterdir()} == times


def test_samples_of_a_ring_are_kept_by_the_law_of_its_friction(ring, tmp_path, capsys):
    kept = []
    for coefficients in ([0.3, 0.2], [0.4, 0.3], [0.4, 0.3]):
        document = read_yaml(Path(ring)) | {'pressures': [0.0], 'unknown': {'friction_coefficient': {'factor': 1.5}}}
        law = {'law': 'monotone_table', 'normal_forces': [10.0, 100.0], 'coefficients': coefficients}
        document['friction']['friction_coefficient'] = law
        Path(ring).write_text(yaml.safe_dump(document))
        answer(capsys, 'oring', ring, '--uncertain', '2', '--workers', '1', '--work', str(tmp_path / 'work'))
        kept.append(len(list((tmp_path / 'work').iterdir())))
    assert kept == [kept[0], 2 * kept[0], 2 * kept[0]]


@pytest.mark.long
def test_one_and_two_workers_print_the_same_bytes(ring, tmp_path, capsys):
    said = []
    for workers in ('1', '2'):
        seal = tmp_path / f'seal_{workers}.yaml'
        words = ['oring', ring, '--uncertain', '8', '--seed', '5', '--out', str(seal), '--workers', workers, '--json']
        assert main(words) == 0
        told = capsys.readouterr()
        said.append((told.out, seal.read_bytes()))
    assert said[0] == said[1]
    found = json.loads(said[0][0])['uncertainty']
    assert f'samples left out since they cannot be computed: {len(found["failed"])}; the first: ' in told.err
    assert yaml.safe_load(said[0][1])['uncertainty'] == {
        'relative_std': pytest.approx(found['relative_std'], rel=1e-2),
        'absolute_std': 0.32,
    }
    assert found['samples'] == 8
    assert 1 <= len(found['failed']) < 6
    assert 'no squeeze' in found['failed'][0]['reason']
    assert found['failed'][0]['values'].keys() == found['rank_correlation'].keys()
    assert len(found['normal_force_N_5_percent']) == len(found['friction_N_95_percent']) == 2


def double(x: float) -> dict:
    if x > 2.0:
        raise ValueError(f'{x} is too much')
    return {'x': 2.0 * x}


def parts_of(values: Mapping[str, float]) -> list[Part]:
    x = values.get('x', 1.0)
    if x < 0.0:
        raise ValueError(f'there is no case of {x}')
    return [Part(part_key('double', x * k), ('x',), partial(double, x * k)) for k in (0.5, 1.0)]


def test_a_sample_that_cannot_be_made_or_computed_is_kept_with_its_reason_and_the_others_count():
    outcome = sampled('test', ['x'], np.array([[1.5], [-1.0], [3.0], [0.5]]), parts_of, 2, None)
    assert outcome.failed == {1: 'there is no case of -1.0', 2: '3.0 is too much'}
    assert [[part['x'] for part in parts] for parts in outcome.computed] == [[1.0, 2.0], [1.5, 3.0], [0.5, 1.0]]


def uncertainty(computed: list[float], nominal: float = 1.0, failed: Mapping[int, str] | None = None) -> Uncertainty:
    forces = np.array(computed)[:, None]
    drawn = np.linspace(1.0, 2.0, len(computed) + len(failed or {}))[:, None]
    return Uncertainty(0, ('x',), drawn, failed or {}, (0.0,), (), np.array([nominal]), forces)


def test_the_standard_deviation_reaches_to_the_farther_side_of_the_case():
    normal = 1.0 + 0.1 * np.random.default_rng(1).normal(size=20_000)
    assert uncertainty(list(normal)).relative_std == pytest.approx(0.1, rel=0.03)
    skew = np.exp(0.5 * np.random.default_rng(1).normal(size=20_000))
    assert uncertainty(list(skew)).relative_std == pytest.approx(np.exp(0.5) - 1.0, rel=0.05)
    assert uncertainty(list(normal), nominal=2.0).relative_std == pytest.approx(0.55, rel=0.03)


def test_the_ranks_are_those_of_the_samples_that_could_be_computed():
    assert uncertainty([1.0, 2.0, 3.0], failed={1: 'no'}).rank_correlations == {'x': pytest.approx(1.0)}
    assert uncertainty([3.0, 2.0, 1.0], failed={0: 'no'}).rank_correlations == {'x': pytest.approx(-1.0)}


def test_fewer_than_two_samples_have_no_quantiles():
    with pytest.raises(ValueError, match='1 of 3 samples could be computed: first'):
        uncertainty([1.0], failed={0: 'first', 2: 'third'})


def test_samples_of_a_map_have_its_mesh_and_fewer_speeds_and_pressures_over_the_same_range():
    case = single_case('oring_ms28775_114', 'map')
    coarse = coarse_case(case)
    assert coarse.oring == case.oring
    assert coarse.numerics == case.numerics
    assert coarse.map.velocities * coarse.map.pressures < case.map.velocities * case.map.pressures
    assert (coarse.map.velocity_max, coarse.map.pressure_max) == (case.map.velocity_max, case.map.pressure_max)


@pytest.mark.parametrize(
    ('words', 'message'),
    [
        (['ehl', 'map', 'spool', '--uncertain', '9'], 'a spool has no friction map'),
        (['ehl', 'map', 'inner_seal_groove', '--uncertain', '9'], 'does not say what is unknown'),
        (['ehl', 'map', 'inner_seal', '--uncertain', '1'], '1 is below 2'),
        (['ehl', 'map', 'inner_seal', '--uncertain', '9', '--seed', '-1'], '-1 is below 0'),
        (['ehl', 'map', 'inner_seal', '--seed', '1'], '--seed is only for --uncertain N'),
        (['oring', 'ms28775_114', '--seed', '1'], '--seed is only for --uncertain N'),
        (['oring', 'ms28775_114', '--workers', '1'], '--workers is only for --uncertain N'),
        (['oring', 'ms28775_114', '--work', 'x'], '--work is only for --uncertain N'),
    ],
)
def test_what_cannot_be_done_is_said_in_one_line(words, message, capsys):
    try:
        code = main(words)
    except SystemExit as end:
        code = end.code
    assert code == 2
    said = capsys.readouterr().err
    assert message in said
    assert len(said.splitlines()) == 1


def test_garbage_in_the_case_file_is_one_line_that_names_it(dry, capsys):
    Path(dry).write_text(DRY.replace('solid_shear_stress: {', 'solid_sheer_stress: {'))
    assert main(['ehl', 'map', dry, '--uncertain', '9']) == 2
    said = capsys.readouterr().err
    assert said.startswith(f'seal_friction: {dry}: case dry: unknown has no seal.solid_sheer_stress')
    assert said.rstrip().endswith('did you mean seal.solid_shear_stress?')
    assert said.count('\n') == 1
