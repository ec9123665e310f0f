"""What a case file may say about numbers that are not known, and what it may not."""

import math
from functools import partial

import numpy as np
import pytest
import yaml
from paths import ROOT

from seal_friction_ros.core.foundation.unknowns import Unknown, parse_unknowns
from seal_friction_ros.core.lubrication.lubrication_case import parse_lubrication_case, varied_case
from seal_friction_ros.core.oring_contact.material import elastic_modulus_of_hardness
from seal_friction_ros.core.oring_contact.oring_case_file import parse_oring_case, varied_ring

KNOWN = {'seal.solid_shear_stress': 1.5e6, 'wall_friction': 0.0, 'rubber.hardness': 70.0}
RING = yaml.safe_load((ROOT / 'config' / 'oring' / 'ms28775_114_blind.yaml').read_text())


def parsed(given, vary=lambda _: None):
    return parse_unknowns(given, KNOWN, vary, 'unknown')


def at(share: float, kind: str, *amounts: float) -> float:
    return float(Unknown('x', 10.0, kind, amounts).at(np.array(share)))


def test_each_kind_has_its_distribution():
    assert at(0.5, 'factor', 2.0) == at(0.5, 'relative_std', 0.3) == at(0.5, 'tolerance', 3.0) == 10.0
    assert at(0.75, 'tolerance', 3.0) == 11.5
    assert at(0.25, 'range', 2.0, 4.0) == 2.5
    assert at(0.75, 'factor', 4.0) == pytest.approx(20.0)
    shares = (np.arange(100_000) + 0.5) / 100_000
    drawn = Unknown('x', 10.0, 'relative_std', (0.3,)).at(shares)
    assert drawn.std() / drawn.mean() == pytest.approx(0.3, rel=1e-2)
    assert np.median(drawn) == pytest.approx(10.0)
    assert at(0.9, 'relative_std', 0.3) == pytest.approx(10.0 * math.exp(1.2816 * math.sqrt(math.log(1.09))), rel=1e-4)
    assert drawn.min() > 0.0


def test_the_largest_spreads_are_taken():
    given = {
        'seal.solid_shear_stress': {'factor': 1000.0},
        'rubber.hardness': {'relative_std': 10},
        'wall_friction': {'range': [-1e15, 1e15]},
    }
    assert [(unknown.name, unknown.value, unknown.kind, unknown.amounts) for unknown in parsed(given)] == [
        ('seal.solid_shear_stress', 1.5e6, 'factor', (1000.0,)),
        ('rubber.hardness', 70.0, 'relative_std', (10.0,)),
        ('wall_friction', 0.0, 'range', (-1e15, 1e15)),
    ]


def test_the_case_is_made_at_both_ends_beyond_which_half_a_percent_lies():
    made = []
    parsed({'rubber.hardness': {'tolerance': 5.0}, 'wall_friction': {'range': [0.0, 0.1]}}, made.append)
    wanted = [
        ('rubber.hardness', 65.05),
        ('rubber.hardness', 74.95),
        ('wall_friction', 0.0005),
        ('wall_friction', 0.0995),
    ]
    assert [next(iter(values.items())) for values in made] == [(name, pytest.approx(end)) for name, end in wanted]
    assert Unknown('x', 10.0, 'tolerance', (2.0,)).ends == (pytest.approx(8.02), pytest.approx(11.98))


@pytest.mark.parametrize(
    ('given', 'message'),
    [
        (None, 'unknown is not a mapping of names to spreads but None'),
        ([], 'unknown is not a mapping'),
        ({}, 'unknown is not a mapping'),
        ({'seal.solid_sheer_stress': {'factor': 2.0}}, 'did you mean seal.solid_shear_stress?'),
        ({5: {'factor': 2.0}}, 'unknown has no 5'),
        ({'a\nb': 1}, 'unknown has no'),
        ({'rubber.hardness': 5.0}, 'rubber.hardness = 5.0 is none of {relative_std: ...}, {factor: ...}'),
        ({'rubber.hardness': {'std': 5.0}}, 'is none of'),
        ({'rubber.hardness': {'tolerance': 5.0, 'factor': 2.0}}, 'is none of'),
        ({'rubber.hardness': {'tolerance': 'x\ny'}}, 'is not one number'),
        ({'rubber.hardness': {'tolerance': True}}, 'is not one number'),
        ({'rubber.hardness': {'tolerance': [1.0, 2.0]}}, 'is not one number'),
        ({'rubber.hardness': {'range': [1.0]}}, 'is not a list of two numbers'),
        ({'rubber.hardness': {'range': [60.0, 'x']}}, 'is not a list of two numbers'),
        ({'rubber.hardness': {'range': [80.0, 60.0]}}, 'does not go from a lower to a higher value'),
        ({'rubber.hardness': {'range': [math.nan, 60.0]}}, 'range is not finite'),
        ({'rubber.hardness': {'tolerance': math.inf}}, 'tolerance is not finite'),
        ({'rubber.hardness': {'tolerance': 10**400}}, 'tolerance is not finite'),
        ({'rubber.hardness': {'tolerance': -1.0}}, 'tolerance = -1 is not above 0'),
        ({'rubber.hardness': {'factor': 1.0}}, 'factor = 1 is not above 1'),
        ({'rubber.hardness': {'relative_std': 20.0}}, 'relative_std = 20 is above 10'),
        ({'rubber.hardness': {'factor': 1001.0}}, 'factor = 1001 is above 1000'),
        ({'rubber.hardness': {'relative_std': 0.0}}, 'relative_std = 0 is not above 0'),
        ({'rubber.hardness': {'tolerance': 0}}, 'tolerance = 0 is not above 0'),
        ({'rubber.hardness': {'tolerance': 1.1e15}}, 'tolerance is not finite, or above 1e+15'),
        ({'rubber.hardness': {'range': [-1.1e15, 0.0]}}, 'range is not finite, or above 1e+15'),
        ({'rubber.hardness': {'range': [60.0, 60.0]}}, 'does not go from a lower to a higher value'),
        ({'wall_friction': {'relative_std': 0.5}}, 'wall_friction is 0 in the case: give it a range'),
        ({'wall_friction': {'factor': 2.0}}, 'wall_friction is 0 in the case: give it a range'),
    ],
)
def test_garbage_is_one_clear_line(given, message):
    with pytest.raises(ValueError) as error:
        parse_unknowns(given, KNOWN, lambda _: None, 'unknown')
    assert message in str(error.value)
    assert len(str(error.value).splitlines()) == 1


@pytest.mark.parametrize(
    ('given', 'message'),
    [
        ({'rubber.hardness': {'tolerance': 30.0}}, 'unknown: rubber.hardness = 99.7: hardness = 99.7 Shore A is out'),
        ({'rubber.elastic_modulus': {'factor': 2.0}}, 'did you mean'),
        ({'geometry.elastic_modulus': {'factor': 2.0}}, 'unknown has no geometry.elastic_modulus'),
        ({'geometry.section_diameter': {'tolerance': 0.2e-3}}, 'no squeeze'),
        ({'numerics.penalty': {'factor': 2.0}}, 'unknown has no numerics.penalty'),
    ],
)
def test_what_no_ring_can_be_is_refused_with_its_file(given, message):
    with pytest.raises(ValueError, match='case ms28775_114_blind: unknown') as error:
        parse_oring_case(RING | {'unknown': given})
    assert message in str(error.value)


def test_a_hardness_changes_the_modulus_of_rubber_and_geometry_and_a_coefficient_nothing():
    case = parse_oring_case(RING).case
    varied = varied_ring(case, {'rubber.hardness': 75.0, 'friction_coefficient': 1.2, 'wall_friction': 0.03})
    assert varied.rubber.elastic_modulus == varied.geometry.elastic_modulus == elastic_modulus_of_hardness(75.0)
    assert varied.wall_friction == 0.03
    assert varied_ring(case, {'friction_coefficient': 1.2}) == case


def ring_map(**parts) -> dict:
    return {'name': 'map', 'oring': 'ring', **parts}


def test_a_map_of_a_ring_has_the_unknowns_of_the_ring_but_for_its_coefficient_of_friction():
    given = {'unknown': {'seal.solid_shear_stress': {'factor': 2.0}}}
    case = parse_lubrication_case(ring_map(**given), lambda _: parse_oring_case(RING))
    names = [unknown.name for unknown in case.unknown]
    assert names[:2] == ['seal.solid_shear_stress', 'oring.geometry.section_diameter']
    assert 'oring.rubber.hardness' in names
    assert 'oring.friction_coefficient' not in names
    varied = varied_case(case, {'oring.rubber.hardness': 60.0, 'seal.solid_shear_stress': 1e6})
    assert varied.oring.rubber.elastic_modulus == elastic_modulus_of_hardness(60.0)
    assert varied.seal.solid_shear_stress == 1e6
    assert varied.unknown == ()
    with pytest.raises(ValueError, match=r'unknown has no seal\.interference'):
        parse_lubrication_case(
            ring_map(unknown={'seal.interference': {'factor': 2.0}}), lambda _: parse_oring_case(RING)
        )


def test_a_higher_or_shorter_surface_is_the_same_one_stretched():
    case = parse_lubrication_case({'name': 'x'})
    varied = partial(varied_case, case)
    assert varied({'topography.rms_height': 4e-6}).topography.rms_slope == pytest.approx(1.6)
    assert varied({'topography.roll_off_length': 50e-6}).topography.rms_slope == pytest.approx(0.4)
    both = varied({'topography.rms_height': 4e-6, 'topography.rms_slope': 0.6}).topography
    assert (both.rms_height, both.rms_slope) == (4e-6, pytest.approx(1.2))
    assert varied({'grease.base_viscosity': 0.1}).topography == case.topography
