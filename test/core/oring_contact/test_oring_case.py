"""Ring, gland and case file of the O-ring: hand-calculated numbers, bounds, and what a file may say."""

import copy
import dataclasses
import math

import pytest

from seal_friction_ros.core.foundation.units import INCH, PSI
from seal_friction_ros.core.friction.geometry import SealGeometry
from seal_friction_ros.core.friction.laws.contact_shear import ShearLaw
from seal_friction_ros.core.friction.laws.friction_coefficient import PowerLaw
from seal_friction_ros.core.oring_contact.material import (
    Rubber,
    elastic_modulus_of_hardness,
    hardness_of_elastic_modulus,
)
from seal_friction_ros.core.oring_contact.oring_case import (
    Groove,
    OringCase,
    check_pressures,
    extrusion_pressure,
    gland_fill,
    stretched_section_diameter,
)
from seal_friction_ros.core.oring_contact.oring_case_file import MeasuredFriction, parse_oring_case, varied_ring

# Limits of diametral clearance against fluid pressure, at the upper end of each band
PRESSURES = (500.0, 1000.0, 1500.0, 2000.0, 3000.0)  # [psi]
CLEARANCES = {70.0: (16.0, 10.0, 6.0, 4.0, 2.0), 90.0: (28.0, 24.0, 20.0, 16.0, 10.0)}  # [0.001 in] by Shore A


def limit(clearance: float, hardness: float) -> float:
    """Extrusion pressure [psi] at a clearance [0.001 in] and a hardness [Shore A]."""
    return extrusion_pressure(1e-3 * clearance * INCH, elastic_modulus_of_hardness(hardness)) / PSI


@pytest.mark.parametrize('hardness', [70.0, 90.0])
def test_extrusion_pressure_passes_through_every_point_of_the_published_table(hardness):
    found = [limit(clearance, hardness) for clearance in CLEARANCES[hardness]]
    assert found == pytest.approx(PRESSURES, rel=1e-6)


@pytest.mark.parametrize(
    ('clearance', 'hardness', 'factors'),
    [
        (13.0, 70.0, (500.0, 1000.0)),  # halfway between two points: their geometric mean
        (8.0, 70.0, (1000.0, 1500.0)),
        (3.0, 70.0, (2000.0, 3000.0)),
        (18.0, 90.0, (1500.0, 2000.0)),
        (10.0, 80.0, (1000.0, 3000.0)),  # halfway between both hardnesses
        (16.0, 80.0, (500.0, 2000.0)),
    ],
)
def test_extrusion_pressure_between_the_points_of_the_table_is_their_geometric_mean(clearance, hardness, factors):
    assert limit(clearance, hardness) == pytest.approx(math.sqrt(factors[0] * factors[1]), rel=1e-6)


def test_extrusion_pressure_goes_on_beyond_the_table_as_between_its_end_points():
    assert limit(0.0, 70.0) == pytest.approx(3000.0**2 / 2000.0, rel=1e-6)
    assert limit(22.0, 70.0) == pytest.approx(500.0**2 / 1000.0, rel=1e-6)
    assert limit(32.0, 90.0) == pytest.approx(500.0**2 / 1000.0, rel=1e-6)


def test_rubber_softer_than_70_is_extruded_in_proportion_to_its_modulus_and_harder_than_90_like_90():
    half = 0.5 * elastic_modulus_of_hardness(70.0)
    assert extrusion_pressure(0.006 * INCH, half) == pytest.approx(750.0 * PSI, rel=1e-6)
    assert limit(10.0, 94.0) == pytest.approx(3000.0, rel=1e-6)


def test_modulus_of_a_hardness_is_that_of_gent():
    """0.0981 MPa (56 + 7.62336 S) / (0.137505 (254 - 2.54 S)), by hand."""
    by_hand = {20.0: 0.731922e6, 50.0: 2.455812e6, 70.0: 5.520507e6, 95.0: 43.82919e6}
    assert {s: elastic_modulus_of_hardness(s) for s in by_hand} == pytest.approx(by_hand, rel=2e-6)
    assert [hardness_of_elastic_modulus(e) for e in by_hand.values()] == pytest.approx(list(by_hand), rel=2e-6)


def test_constants_of_mooney_and_rivlin_share_the_shear_modulus_in_their_ratio():
    """E = 6 MPa: 2 (C10 + C01) = 2 MPa."""
    assert Rubber(6e6, mooney_ratio=0.25).terms == pytest.approx({2.0: 0.8e6, -2.0: 0.2e6})
    assert Rubber(6e6, mooney_ratio=0.0).terms == {2.0: 1e6, -2.0: 0.0}


def test_rubber_is_nearly_incompressible_from_20_times_its_modulus_on():
    assert Rubber(1e8, bulk_modulus=2e9).bulk_modulus == 2e9
    with pytest.raises(ValueError, match=r'bulk_modulus = 1900000000.0 Pa is below 20 times elastic_modulus'):
        Rubber(1e8, bulk_modulus=1.9e9)


LOOSE = SealGeometry(section_diameter=2e-3, ring_inner_diameter=10e-3, rod_diameter=10e-3, gland_diameter=13.6e-3)
"""A ring of 2 mm that just touches its rod; the gap is 1.8 mm."""


def test_gland_fill_is_the_ring_over_the_space_between_rod_and_gland():
    """Pi^2 / 4 d^2 (d_i + d) = 118.4 mm^3 in pi / 4 (13.6^2 - 10^2) 3 = 200.2 mm^3."""
    assert gland_fill(LOOSE, Groove(3e-3)) == pytest.approx(118.4353 / 200.1827, rel=1e-5)
    assert gland_fill(LOOSE, Groove(6e-3)) == pytest.approx(0.5 * 118.4353 / 200.1827, rel=1e-5)


def test_ring_that_no_rod_stretches_keeps_its_section():
    assert stretched_section_diameter(LOOSE) == 2e-3
    assert stretched_section_diameter(dataclasses.replace(LOOSE, ring_inner_diameter=10.2e-3)) == 2e-3


def test_ring_stretched_onto_a_rod_keeps_its_volume():
    """4 mm^2 (8 + 2) mm = d'^2 (10 + d'): 1.8328 mm."""
    tight = dataclasses.replace(LOOSE, ring_inner_diameter=8e-3, gland_diameter=13.4e-3)
    section = stretched_section_diameter(tight)
    assert section**2 * (10e-3 + section) == pytest.approx(4e-8, rel=1e-12)
    assert section < 2e-3


def ring(geometry: SealGeometry = LOOSE, width: float = 3e-3, **numbers: float) -> OringCase:
    return OringCase(name='mine', geometry=geometry, groove=Groove(width), rubber=Rubber(7e6), **numbers)


def test_ring_that_fills_its_gland_is_refused():
    width = gland_fill(LOOSE, Groove(1e-3)) * 1e-3
    assert ring(width=1.001 * width).groove.width == pytest.approx(1.7767e-3, rel=1e-4)
    with pytest.raises(ValueError, match=r'overfilled gland: the rubber has 100.1 % of its volume; widen groove.width'):
        ring(width=0.999 * width)


def test_pressures_up_to_the_limit_of_extrusion_are_computed():
    case = ring()
    highest = extrusion_pressure(0.0, 7e6)
    check_pressures(case, (0.0,))
    check_pressures(case, (1.0, highest))
    with pytest.raises(ValueError, match='extrudes the ring through a diametral clearance'):
        check_pressures(case, (1.0, 1.001 * highest))


# -- case file


DOCUMENT = {
    'name': 'mine',
    'source': 'a drawing',
    'geometry': {
        'section_diameter': 2e-3,
        'ring_inner_diameter': 10e-3,
        'rod_diameter': 10e-3,
        'gland_diameter': 13.6e-3,
    },
    'groove': {'width': 3e-3},
    'rubber': {'hardness': 70.0},
    'pressures': [0.0, 1e6],
}
FRICTION = {
    'friction_coefficient': {'law': 'power_law', 'coefficient': 2.1, 'exponent': 0.56},
    'stiction': 2.5,
    'uncertainty': {'relative_std': 0.2},
}
SHEAR = {
    'contact_shear': {'shear_stress': '0.1 MPa', 'knee_stress': '0.3 MPa'},
    'stiction_ratio': 0.1,
    'uncertainty': {'relative_std': 0.2},
}
MEASURED = {'seals': 2, 'pressures': [0.0, 1e6], 'frictions': [10.0, 20.0]}


def document(**changes: object) -> dict:
    return copy.deepcopy(DOCUMENT) | changes


def test_case_file_makes_a_ring_whose_geometry_knows_its_modulus():
    file = parse_oring_case(document())
    assert (file.case.name, file.source, file.pressures) == ('mine', 'a drawing', (0.0, 1e6))
    assert file.case.geometry == dataclasses.replace(LOOSE, elastic_modulus=elastic_modulus_of_hardness(70.0))
    assert file.case.rubber == Rubber(elastic_modulus_of_hardness(70.0))
    assert (file.friction, file.measured, file.unknown, file.case.wall_friction) == (None, None, (), 0.0)
    given = parse_oring_case(document(rubber={'elastic_modulus': 6e6, 'mooney_ratio': 0.1}, wall_friction=0.02))
    assert given.case.rubber == Rubber(6e6, mooney_ratio=0.1)
    assert (given.case.geometry.elastic_modulus, given.case.wall_friction) == (6e6, 0.02)
    assert parse_oring_case(document(numerics={'lines': 17})).case.numerics.lines == 17


def test_constants_of_ogden_give_the_modulus_and_a_hardness_beside_them_scales_them():
    ogden = {'ogden_moduli': ['0.63 MPa', '1.2 kPa', '-0.01 MPa'], 'ogden_exponents': [1.3, 5.0, -2.0]}
    alone = parse_oring_case(document(rubber=ogden)).case
    assert alone.rubber.modulus == pytest.approx(1.5 * (0.63e6 * 1.3 + 1.2e3 * 5.0 + 0.01e6 * 2.0))
    assert alone.geometry.elastic_modulus == alone.rubber.modulus
    scaled = parse_oring_case(document(rubber={**ogden, 'hardness': 70.0})).case.rubber
    assert scaled.modulus == pytest.approx(elastic_modulus_of_hardness(70.0))
    shares = [scaled.terms[alpha] / alone.rubber.terms[alpha] for alpha in (1.3, 5.0, -2.0)]
    assert shares == pytest.approx([scaled.modulus / alone.rubber.modulus] * 3)
    with pytest.raises(ValueError, match='give one of hardness'):
        parse_oring_case(document(rubber={'mooney_ratio': 0.1}))


def test_a_relaxed_ring_relaxes_whatever_its_hardness_is_found_to_be():
    rubber = {'hardness': 70.0, 'prony_shares': [0.4], 'prony_times': ['1 min'], 'time_since_mounting': '1 h'}
    case = parse_oring_case(document(rubber=rubber)).case
    assert case.geometry.elastic_modulus == pytest.approx(0.6 * elastic_modulus_of_hardness(70.0))
    harder = varied_ring(case, {'rubber.hardness': 80.0})
    assert harder.geometry.elastic_modulus == pytest.approx(0.6 * elastic_modulus_of_hardness(80.0))


def test_case_file_has_the_friction_of_a_seal_file_and_what_was_measured():
    file = parse_oring_case(document(friction=FRICTION, measured=MEASURED))
    assert file.friction.law == PowerLaw(2.1, 0.56)
    assert (file.friction.stiction, file.friction.uncertainty.relative_std) == (2.5, 0.2)
    assert file.measured == MeasuredFriction(2, (0.0, 1e6), (10.0, 20.0))
    without = {key: value for key, value in FRICTION.items() if key != 'stiction'}
    assert parse_oring_case(document(friction=without)).friction.stiction == 0.0


def test_case_file_may_have_a_shear_law_in_the_place_of_a_coefficient():
    friction = parse_oring_case(document(friction=SHEAR)).friction
    assert friction.law == ShearLaw(1e5, 3e5)
    assert (friction.stiction, friction.stiction_ratio) == (0.0, 0.1)


@pytest.mark.parametrize(
    ('changes', 'words'),
    [
        ({'grove': {}}, 'case mine has no grove: it has name, source, geometry'),
        ({'rubber': {}}, r'case mine: rubber: give one of hardness \[Shore A\] and elastic_modulus \[Pa\]; got {}'),
        ({'rubber': 70.0}, 'give one of hardness .* got 70.0'),
        ({'rubber': {'hardness': 70.0, 'elastic_modulus': 5e6}}, 'give one of hardness'),
        ({'rubber': {'hardness': 96.0}}, 'case mine: rubber: hardness = 96.0 Shore A is outside 20 to 95'),
        ({'rubber': {'hardness': '70'}}, 'hardness'),
        ({'pressures': [1e6, 0.0]}, 'do not increase'),
        ({'pressures': None}, 'pressures'),
        ({'friction': 0.2}, 'case mine: friction = 0.2 is not a mapping of contact_shear, friction_coefficient'),
        ({'friction': FRICTION | {'stick': 1.0}}, 'is not a mapping of contact_shear, friction_coefficient, stiction'),
        ({'friction': FRICTION | SHEAR}, 'give one of contact_shear and friction_coefficient; got friction_coeff'),
        ({'friction': SHEAR | {'contact_shear': {'shear_stress': 2e5}}}, 'contact_shear lacks knee_stress'),
        (
            {'friction': SHEAR | {'contact_shear': {'shear_stress': 2e5, 'exponent': 0.4}}},
            'case mine: friction: contact_shear: exponent is of an older law: give shear_stress and knee_stress',
        ),
        (
            {'friction': SHEAR | {'contact_shear': {'shear_stress': 1e5, 'knee_stress': 0.3}}},
            'knee_stress = 0.3 Pa is below its lower bound 1.0 Pa',
        ),
        ({'friction': FRICTION | {'stiction': -1.0}}, 'stiction = -1.0 N is below its lower bound 0.0 N'),
        ({'friction': FRICTION | {'stiction': 1.1e6}}, 'stiction = 1100000.0 N is above its upper bound 1000000.0 N'),
        ({'measured': MEASURED | {'frictions': [10.0]}}, '1 frictions at 2 pressures: give one friction per pressure'),
        ({'measured': MEASURED | {'frictions': [], 'pressures': []}}, '0 frictions at 0 pressures'),
        ({'wall_friction': 0.2}, 'wall_friction = 0.2 1 is above its upper bound 0.1'),
        ({'unknown': {'geometry.elastic_modulus': {'factor': 2.0}}}, 'unknown has no geometry.elastic_modulus'),
        ({'unknown': {'rubber.elastic_modulus': {'factor': 1.1}}}, 'unknown has no rubber.elastic_modulus'),
        ({'unknown': {'friction_coefficient': {'factor': 2.0}}}, 'unknown has no friction_coefficient'),
        ({'unknown': {'numerics.guide': {'factor': 2.0}}}, 'unknown has no numerics.guide'),
        ({'unknown': {'rubber.hardness': {'tolerance': 26.0}}}, 'rubber.hardness = 95.74: hardness = .* outside'),
    ],
)
def test_an_invalid_case_file_is_refused_in_one_line(changes, words):
    with pytest.raises(ValueError, match=words) as caught:
        parse_oring_case(document(**changes))
    assert '\n' not in str(caught.value)


def test_what_is_not_known_of_a_ring_has_the_value_of_its_file():
    spreads = {
        'rubber.hardness': {'tolerance': 5.0},
        'wall_friction': {'range': [0.0, 0.05]},
        'friction_coefficient': {'factor': 1.5},
        'groove.width': {'tolerance': 1e-4},
        'rubber.mooney_ratio': {'factor': 1.5},
    }
    file = parse_oring_case(document(unknown=spreads, friction=FRICTION))
    values = {unknown.name: unknown.value for unknown in file.unknown}
    assert values == {
        'rubber.hardness': 70.0,
        'wall_friction': 0.0,
        'friction_coefficient': 1.0,
        'groove.width': 3e-3,
        'rubber.mooney_ratio': 0.25,
    }
    modulus = {'rubber.elastic_modulus': {'factor': 1.1}}
    (one,) = parse_oring_case(document(rubber={'elastic_modulus': 6e6}, unknown=modulus)).unknown
    assert one.value == 6e6


def test_ring_with_other_values_is_the_same_ring_but_for_them():
    case = ring()
    harder = varied_ring(case, {'rubber.hardness': 80.0, 'rubber.mooney_ratio': 0.5})
    modulus = elastic_modulus_of_hardness(80.0)
    assert harder.rubber == Rubber(modulus, mooney_ratio=0.5)
    assert harder.geometry == dataclasses.replace(LOOSE, elastic_modulus=modulus)
    wider = varied_ring(case, {'groove.width': 4e-3, 'wall_friction': 0.01, 'geometry.section_diameter': 2.1e-3})
    assert (wider.groove.width, wider.wall_friction, wider.geometry.section_diameter) == (4e-3, 0.01, 2.1e-3)
    assert (wider.rubber, wider.geometry.elastic_modulus) == (case.rubber, case.geometry.elastic_modulus)
    assert varied_ring(case, {'friction_coefficient': 2.0}) == case
