"""Seal files: every mistake is one line that names what is wrong."""

import copy
import math
from datetime import date

import pytest
from hypothesis import given
from hypothesis import strategies as st
from paths import ROOT

from seal_friction_ros.core.friction.actuator import MountedSeal, actuator_friction
from seal_friction_ros.core.friction.force_sum_correction import ForceSumCorrection
from seal_friction_ros.core.friction.identified_motion import ANY_MOTION, IdentifiedMotion
from seal_friction_ros.core.friction.laws.friction_coefficient import CoefficientTable, PowerLaw
from seal_friction_ros.core.friction.laws.normal_force import AreaDeformationGain, NormalForceTable
from seal_friction_ros.core.friction.laws.physics_based import PhysicsBased
from seal_friction_ros.core.friction.laws.prior_art_chart import PriorArtChart
from seal_friction_ros.core.friction.mounting import Mounting
from seal_friction_ros.core.friction.seal_file import law_document, mount_seals, mounting_of, parse_seal
from seal_friction_ros.files import read_yaml

CONFIG = ROOT / 'config' / 'seals'
POWER, TABLE, CHART = (
    read_yaml(CONFIG / f'{name}.yaml') for name in ('ms28775_114', 'ms28775_114_table', 'ms28775_114_prior_art')
)
REMOVED = object()


def changed(document, path: str, value):
    """Copy of a document with another value (or none) at a dotted path."""
    result = copy.deepcopy(document)
    *parents, key = path.split('.')
    part = result
    for parent in parents:
        part = part[parent]
    if value is REMOVED:
        del part[key]
    else:
        part[key] = value
    return result


def complaint(document) -> str:
    with pytest.raises(ValueError) as refusal:
        parse_seal(document)
    text = str(refusal.value)
    assert '\n' not in text
    return text


def leaves(document, where=''):
    """Path of each number in mappings of a document."""
    for key, value in document.items():
        if isinstance(value, dict):
            yield from leaves(value, f'{where}{key}.')
        elif isinstance(value, int | float):
            yield f'{where}{key}'


def lists(document, where=''):
    for key, value in document.items():
        if isinstance(value, dict):
            yield from lists(value, f'{where}{key}.')
        elif isinstance(value, list):
            yield f'{where}{key}'


NUMBERS = [(d, path) for d in (POWER, TABLE, CHART) for path in leaves(d)]
LISTS = [(d, path) for d in (POWER, TABLE, CHART) for path in lists(d)]


def ids(value):
    return value['name'] if isinstance(value, dict) else None


# --- what is good ---


@pytest.mark.parametrize('path', sorted(CONFIG.glob('*.yaml')), ids=lambda path: path.stem)
def test_every_shipped_seal_file_makes_a_seal_of_its_own_name(path):
    seal = parse_seal(read_yaml(path))
    assert seal.name == path.stem
    assert seal.coulomb_law.coulomb_friction(0.0) > 0.0


def test_laws_are_chosen_by_name():
    power, table, chart = map(parse_seal, (POWER, TABLE, CHART))
    assert type(power.coulomb_law) is type(table.coulomb_law) is PhysicsBased
    assert type(chart.coulomb_law) is PriorArtChart
    assert type(power.coulomb_law.normal_force_law) is AreaDeformationGain
    assert type(power.coulomb_law.friction_coefficient_law) is PowerLaw
    assert type(table.coulomb_law.normal_force_law) is NormalForceTable
    assert type(table.coulomb_law.friction_coefficient_law) is CoefficientTable


@pytest.mark.parametrize('document', [POWER, TABLE, CHART], ids=['power', 'table', 'chart'])
def test_a_law_comes_back_from_the_part_of_a_seal_file_that_it_is_written_as(document):
    law = parse_seal(document).coulomb_law
    written = law_document(law)
    assert parse_seal({**document, **written}).coulomb_law == law
    assert written.keys() <= document.keys()


BARE = {'name': 'x', 'uncertainty': {'relative_std': 0.1}, 'identified_pressure': [0.0, 5e6]}
CONSTANT = {**BARE, 'coulomb_law': 'constant_coulomb', 'constant_coulomb': {'coulomb_friction_at_any_pressure': 12.0}}
BY_PRESSURE = {
    **BARE,
    'coulomb_law': 'pressure_power_law',
    'pressure_power_law': {'friction_at_no_pressure': 5.0, 'friction_at_one_bar': 0.8, 'pressure_exponent': 0.7},
}


def test_laws_that_need_no_geometry_do_without_it():
    assert parse_seal(CONSTANT).coulomb_law.coulomb_friction(4e6) == 12.0
    assert parse_seal(BY_PRESSURE).coulomb_law.coulomb_friction(1e5) == pytest.approx(5.8)
    assert actuator_friction((MountedSeal(parse_seal(BY_PRESSURE), 'a'),), -5e4, 0.0).coulomb_friction == 5.0
    assert parse_seal(changed(BY_PRESSURE, 'geometry', POWER['geometry'])).name == 'x'
    assert 'squeeze' in complaint(changed(BY_PRESSURE, 'geometry', {**POWER['geometry'], 'section_diameter': 1e-3}))


def test_velocity_terms_are_added_to_coulomb_friction():
    terms = {'viscous_friction': 100.0, 'stribeck_friction': 3.0, 'stribeck_velocity': 0.02, 'asymmetry': 0.1}
    seal = parse_seal({**CONSTANT, 'velocity_terms': terms})
    out, back = (actuator_friction((MountedSeal(seal, 'a'),), 1e6, 0.0, v).velocity_friction for v in (0.02, -0.02))
    symmetric = 12.0 + 2.0 + 3.0 / math.e
    assert (12.0 + out, 12.0 + back) == pytest.approx((1.1 * symmetric, 0.9 * symmetric))
    at_rest = actuator_friction((MountedSeal(seal, 'a'),), 1e6, 0.0)
    assert (at_rest.coulomb_friction, at_rest.velocity_friction) == (12.0, 0.0)


def test_breakaway_may_follow_the_load():
    seal = parse_seal({**BY_PRESSURE, 'stiction': 1.0, 'stiction_ratio': 0.2})
    low, high = (actuator_friction((MountedSeal(seal, 'a'),), p, 0.0) for p in (0.0, 4e6))
    assert low.stiction == pytest.approx(1.0 + 0.2 * low.coulomb_friction)
    assert high.stiction == pytest.approx(1.0 + 0.2 * high.coulomb_friction)


@pytest.mark.parametrize(
    ('document', 'words'),
    [
        (changed(BY_PRESSURE, 'pressure_power_law.pressure_exponent', 9.0), 'pressure_exponent = 9.0'),
        (changed(BY_PRESSURE, 'pressure_power_law', REMOVED), 'pressure_power_law is not a mapping'),
        (changed(CONSTANT, 'constant_coulomb.coulomb_friction_at_any_pressure', -1.0), 'is below its lower bound'),
        ({**CONSTANT, 'velocity_terms': {'asymmetry': 2.0}}, 'asymmetry = 2.0'),
        ({**CONSTANT, 'velocity_terms': 3}, 'velocity_terms is not a mapping'),
        ({**CONSTANT, 'stiction_ratio': -0.1}, 'stiction_ratio = -0.1'),
        ({**CONSTANT, 'chart': {}}, 'constant_coulomb has no chart'),
        ({**CONSTANT, 'identification': 'mine'}, 'identification is not a mapping'),
        ({**CONSTANT, 'identification': {'rms': math.nan}}, 'identification is not a mapping'),
        ({**CONSTANT, 'identification': {'day': date(2022, 1, 28)}}, 'identification is not a mapping'),
        ({**CONSTANT, 'identification': {'n': 3, 'rms': math.nan}}, 'identification is not a mapping'),
        ({**CONSTANT, 'identification': {'rms': [1.0, math.nan]}}, 'identification is not a mapping'),
        ({**CONSTANT, 'identification': {1: 2.0}}, 'identification is not a mapping'),
        ({**CONSTANT, 'mounting': {'chambers': []}}, 'Mounting.chambers is empty'),
        ({**CONSTANT, 'mounting': {'chambers': ['a', 'c']}}, "'c' is not a, b, difference or ambient"),
    ],
)
def test_a_spoiled_part_of_an_identified_seal_is_named(document, words):
    assert words in complaint(document)


def test_what_identification_says_of_itself_is_passed_over():
    plain, told = CONSTANT, {**CONSTANT, 'identification': {'law': 'x', 'measured_N': [1.0, None], 'data': [{'n': 1}]}}
    assert parse_seal(plain) == parse_seal(told)


def test_a_seal_file_tells_how_its_seals_are_mounted_or_not():
    assert mounting_of({**CONSTANT, 'mounting': {'chambers': ['a', 'ambient']}}) == Mounting(('a', 'ambient'))
    assert mounting_of(CONSTANT) is None
    assert mounting_of('no document') is None


def test_the_scale_that_adapt_writes_acts_on_all_friction():
    adapted = parse_seal({**CONSTANT, 'friction_scale': 1.25, 'stiction': 2.0})
    found = actuator_friction((MountedSeal(adapted, 'a'),), 1e6, 0.0)
    assert (found.coulomb_friction, found.stiction) == pytest.approx((15.0, 2.5))


def test_laws_of_different_kinds_go_together():
    mixed = changed(POWER, 'friction_coefficient', TABLE['friction_coefficient'])
    expected = parse_seal(TABLE).coulomb_law.coulomb_friction(3e6)
    assert parse_seal(mixed).coulomb_law.coulomb_friction(3e6) == pytest.approx(expected, rel=0.05)


def test_stiction_and_source_may_be_left_out():
    without = changed(changed(POWER, 'stiction', REMOVED), 'source', REMOVED)
    assert parse_seal(without).stiction == 0.0


# --- what is not ---


@pytest.mark.parametrize(('document', 'path'), NUMBERS, ids=ids)
@pytest.mark.parametrize('value', [math.nan, math.inf, -1e30, '1', None, True, [1.0], {'a': 1.0}], ids=repr)
def test_a_wrong_number_is_refused_in_one_line_with_seal_and_field(document, path, value):
    text = complaint(changed(document, path, value))
    assert document['name'] in text
    assert path.split('.')[-1] in text


@pytest.mark.parametrize(('document', 'path'), NUMBERS, ids=ids)
def test_a_missing_number_is_refused_by_name_unless_it_has_a_default(document, path):
    without = changed(document, path, REMOVED)
    if path in ('stiction', 'stiction_ratio', 'uncertainty.absolute_std', 'geometry.elastic_modulus'):
        parse_seal(without)
    else:
        assert f'lacks {path.split(".")[-1]}' in complaint(without)


@pytest.mark.parametrize(('document', 'path'), LISTS, ids=ids)
@pytest.mark.parametrize('value', [5.0, 'ab', None, [], [1.0], ['a', 'b'], [2.0, 1.0], [math.nan, 1.0]], ids=repr)
def test_a_wrong_list_is_refused_in_one_line(document, path, value):
    text = complaint(changed(document, path, value))
    assert document['name'] in text


@pytest.mark.parametrize(
    ('document', 'part'),
    [
        *[(POWER, part) for part in ('geometry', 'uncertainty', 'normal_force', 'friction_coefficient')],
        *[(CHART, part) for part in ('geometry', 'uncertainty', 'chart')],
    ],
    ids=ids,
)
@pytest.mark.parametrize('value', [REMOVED, None, 5, 'text', [], {}], ids=['removed', 'None', '5', 'text', '[]', '{}'])
def test_a_missing_or_empty_part_is_refused_by_name(document, part, value):
    text = complaint(changed(document, part, value))
    assert part in text
    assert document['name'] in text


@pytest.mark.parametrize('part', ['', 'geometry.', 'uncertainty.', 'normal_force.', 'friction_coefficient.'])
def test_an_unknown_field_is_refused_by_name(part):
    assert 'has no stickyness' in complaint(changed(POWER, f'{part}stickyness', 1.0))


@pytest.mark.parametrize(
    ('path', 'value', 'expected'),
    [
        ('coulomb_law', 'magic', "coulomb_law = 'magic' is not one of constant_coulomb, pressure_power_law"),
        ('coulomb_law', REMOVED, 'coulomb_law = None is not one of'),
        ('coulomb_law', ['physics_based'], "coulomb_law = ['physics_based'] is not one of"),
        (
            'normal_force.law',
            'cubic',
            "normal_force: law = 'cubic' is not one of area_deformation_gain, monotone_table",
        ),
        ('normal_force.law', 'power_law', "normal_force: law = 'power_law' is not one of area_deformation_gain"),
        (
            'friction_coefficient.law',
            REMOVED,
            'friction_coefficient: law = None is not one of power_law, monotone_table',
        ),
    ],
)
def test_an_unknown_law_is_refused_with_what_there_is(path, value, expected):
    assert expected in complaint(changed(POWER, path, value))


def test_a_part_of_another_law_is_refused():
    assert 'physics_based has no chart: it has' in complaint(changed(POWER, 'chart', CHART['chart']))
    assert 'prior_art_chart has no normal_force' in complaint(changed(CHART, 'normal_force', POWER['normal_force']))


@pytest.mark.parametrize('document', [None, 5, 'name', [], [POWER], True])
def test_what_is_no_mapping_is_refused(document):
    assert complaint(document) == f'a seal file is a mapping of names to values, not {type(document).__name__}'


@pytest.mark.parametrize('name', [None, 5, '', [], {}])
def test_a_seal_needs_a_name(name):
    assert complaint(changed(POWER, 'name', name)) == f'seal file: name = {name!r} is not one line of text'


@pytest.mark.parametrize('value', [[0.0], [0.0, 1e6, 2e6], 'ab', {'a': 1, 'b': 2}, 5.0])
def test_the_identified_range_is_two_pressures(value):
    assert 'is not a list of two pressures [Pa]' in complaint(changed(POWER, 'identified_pressure', value))


@pytest.mark.parametrize(
    ('value', 'expected'),
    [
        ([1e6, 1e6], 'pressure_max = 1000000.0 Pa is not above pressure_min = 1000000.0 Pa'),
        ([-1.0, 1e6], 'pressure_min = -1.0 Pa is below its lower bound 0.0 Pa'),
        ([0.0, 1e12], 'pressure_max = 1000000000000.0 Pa is above its upper bound 1000000000.0 Pa'),
        (['0', 1e6], "pressure_min = '0' is not a number"),
    ],
)
def test_an_invalid_identified_range_is_refused(value, expected):
    assert expected in complaint(changed(POWER, 'identified_pressure', value))


def test_a_law_that_falls_with_pressure_is_refused():
    steep = changed(TABLE, 'friction_coefficient.coefficients', [0.3, 0.15, 0.05, 0.03, 0.02])
    assert 'Coulomb friction falls from' in complaint(steep)


def test_a_table_of_normal_forces_that_falls_is_refused():
    falling = changed(TABLE, 'normal_force.normal_forces', [18.0, 99.0, 197.0, 150.0, 400.0])
    assert 'NormalForceTable.normal_forces = [18.0, 99.0, 197.0, 150.0, 400.0] N falls with pressure' in complaint(
        falling
    )


def test_a_shear_law_with_an_exponent_is_refused_with_what_to_do():
    law = {'shear_stress': 1e5, 'exponent': 0.4, 'pressures': [0.0, 1e6], 'areas': [1e-5, 2e-5]}
    older = {'name': 'mine', 'coulomb_law': 'contact_shear', 'contact_shear': law, 'uncertainty': {'relative_std': 0.1}}
    what_to_do = 'compute the seal again with seal_friction oring or section'
    assert complaint(older) == f'seal mine: contact_shear: exponent is of an older law: {what_to_do}'


def test_a_ring_that_is_not_squeezed_is_refused():
    loose = changed(POWER, 'geometry.section_diameter', 2e-3)
    assert 'SealGeometry.section_diameter = 0.002 m gives a squeeze of' in complaint(loose)


def test_correction_and_identified_motion_come_from_the_seal_file():
    told = {
        **POWER,
        'force_sum_correction': {'area_a': 1e-5, 'offset': -3},
        'identified_speed': [0, 0.2],
        'identified_directions': [1],
    }
    seal = parse_seal(told)
    assert seal.force_sum_correction == ForceSumCorrection(1e-5, 0.0, -3.0)
    assert seal.identified_motion == IdentifiedMotion(0.0, 0.2, (1,))
    assert parse_seal(POWER).force_sum_correction is None
    assert parse_seal(POWER).identified_motion == ANY_MOTION


@pytest.mark.parametrize(
    ('key', 'value', 'expected'),
    [
        (
            'force_sum_correction',
            {'area': 1.0},
            'force_sum_correction has no area: it has area_a, area_b, offset, contains_load',
        ),
        ('force_sum_correction', {'area_a': 1.5}, 'ForceSumCorrection.area_a = 1.5 m2 is above its upper bound 1.0 m2'),
        ('force_sum_correction', 5.0, 'force_sum_correction is not a mapping of names to values but 5.0'),
        ('identified_speed', 0.1, 'identified_speed = 0.1 is not a list of two speeds [m/s]'),
        ('identified_speed', [0.2, 0.1], 'fastest = 0.1 m/s is below slowest = 0.2 m/s'),
        ('identified_speed', [-0.1, 0.1], 'slowest = -0.1 m/s is below its lower bound 0.0 m/s'),
        ('identified_directions', [], 'directions = [] is not [-1], [1] or [-1, 1]'),
        ('identified_directions', [1, 1], 'directions = [1, 1] is not [-1], [1] or [-1, 1]'),
        ('identified_directions', [0], 'directions = [0] is not [-1], [1] or [-1, 1]'),
        ('identified_directions', 1, 'identified.directions = 1 is not a list'),
    ],
)
def test_a_wrong_correction_or_identified_motion_is_refused(key, value, expected):
    assert expected in complaint({**POWER, key: value})


def test_each_seal_is_mounted_on_its_chamber():
    mounted = mount_seals((POWER, CHART), ('b', 'difference'))
    assert mounted == (MountedSeal(parse_seal(POWER), 'b'), MountedSeal(parse_seal(CHART), 'difference'))
    assert mount_seals((), ()) == ()


def test_as_many_chambers_as_seals():
    with pytest.raises(ValueError, match='seals has 2 entries but seal_chambers has 1'):
        mount_seals((POWER, POWER), ('a',))


values = st.recursive(
    st.none()
    | st.booleans()
    | st.floats()
    | st.integers(-(2**63), 2**63)
    | st.text(st.characters(codec='ascii'), max_size=4),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=4), inner, max_size=3),
    max_leaves=5,
)
places = st.sampled_from([(d, p) for d in (POWER, TABLE, CHART) for p in (*d, *leaves(d), *lists(d)) if p != 'source'])


@given(places, values)
def test_any_value_anywhere_makes_a_seal_or_a_value_error(place, value):
    document, path = place
    try:
        seal = parse_seal(changed(document, path, value))
    except ValueError:
        return
    assert math.isfinite(seal.coulomb_law.coulomb_friction(5e6))


def test_an_integer_too_large_for_a_float_is_refused_by_name():
    assert 'stiction' in complaint(changed(POWER, 'stiction', 10**400))


@pytest.mark.parametrize('source', [2008, 1.5, ['thesis'], {'thesis': 1}])
def test_a_source_that_is_no_text_is_refused(source):
    assert 'source' in complaint(changed(POWER, 'source', source))


@pytest.mark.parametrize('source', [date(2008, 5, 1), math.nan, b'thesis'], ids=repr)
def test_a_source_that_could_not_be_recorded_is_refused(source):
    assert 'source' in complaint(changed(POWER, 'source', source))


def test_a_table_of_absurd_numbers_is_refused():
    said = complaint(changed(TABLE, 'friction_coefficient.coefficients', [1e300] * 5))
    assert 'coefficients[0] = 1e+300' in said


@pytest.mark.parametrize('path', ['name', 'geometry.two\nlines'])
def test_a_line_break_in_a_name_does_not_break_the_line(path):
    assert 'two\\nlines' in complaint(changed(changed(POWER, path, 'two\nlines'), 'stiction', -1.0))
