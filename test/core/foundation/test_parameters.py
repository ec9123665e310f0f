"""Parameters are checked at construction; errors name field, value and bound."""

import math
from dataclasses import asdict, dataclass, field

import pytest
from hypothesis import given
from hypothesis import strategies as st

from seal_friction_ros.core.estimation.configuration import SealSelection
from seal_friction_ros.core.estimation.estimator import EstimatorSettings
from seal_friction_ros.core.foundation.parameters import (
    CheckedParameters,
    Meaning,
    ParameterGroup,
    check,
    from_mapping,
    meanings,
    meant,
    name_and_source,
    parameter,
    printable,
    similar_names,
)
from seal_friction_ros.core.foundation.units import unit_size
from seal_friction_ros.core.friction.actuator import Seal, Uncertainty
from seal_friction_ros.core.friction.geometry import SealGeometry
from seal_friction_ros.core.friction.laws.friction_coefficient import CoefficientTable, PowerLaw
from seal_friction_ros.core.friction.laws.normal_force import AreaDeformationGain, NormalForceTable
from seal_friction_ros.core.friction.laws.prior_art_chart import PriorArtChart

RECORDS = [
    SealSelection, PriorArtChart, Seal, Uncertainty, EstimatorSettings, CoefficientTable, PowerLaw,
    AreaDeformationGain, NormalForceTable, SealGeometry,
]  # fmt: skip


@dataclass(frozen=True)
class Spring:
    stiffness: float = parameter(unit='N/m', lower=1.0, upper=1e6, description='Force per length.')
    coils: int = parameter(5, unit='1', lower=1, upper=100, description='Number of coils.')
    wound: bool = parameter(True, unit='', description='Whether it is wound.')
    material: str = parameter('steel', unit='', description='What it is of.')
    lengths: tuple[float, ...] = parameter((1.0,), unit='m', description='Lengths.')
    names: tuple[str, ...] = parameter((), unit='', description='Names.')
    made: float = field(init=False, default=0.0)

    def __post_init__(self) -> None:
        check(self)


def make(**values) -> Spring:
    return from_mapping(Spring, {'stiffness': 10.0, **values}, 'spring')


@given(st.floats())
def test_a_number_is_accepted_exactly_inside_its_bounds(value):
    try:
        spring = Spring(value)
    except ValueError:
        assert not 1.0 <= value <= 1e6
    else:
        assert spring.stiffness == value
        assert 1.0 <= value <= 1e6


@pytest.mark.parametrize(
    ('value', 'complaint'),
    [
        (0.5, 'Spring.stiffness = 0.5 N/m is below its lower bound 1.0 N/m'),
        (2e6, 'Spring.stiffness = 2000000.0 N/m is above its upper bound 1000000.0 N/m'),
        (math.nan, 'Spring.stiffness = nan N/m is not finite'),
        (-math.inf, 'Spring.stiffness = -inf N/m is not finite'),
    ],
)
def test_the_error_names_field_value_unit_and_bound(value, complaint):
    with pytest.raises(ValueError, match='^' + complaint.replace('.', r'\.') + '$'):
        Spring(value)


def test_a_record_of_checked_parameters_is_checked_at_construction_and_bounds_are_of_numbers_alone():
    @dataclass(frozen=True)
    class Valve(CheckedParameters):
        lift: float = parameter(unit='mm', lower=1.0, upper=2.0, description='Lift.')
        is_open: bool = parameter(True, unit='', lower=2.0, description='Whether it is open.')
        maker: str = parameter('', unit='', lower=2.0, description='Who made it.')

    assert Valve(1.0) == Valve(1.0, True, '')
    with pytest.raises(ValueError, match=r'^Valve\.lift = 2\.5 mm is above its upper bound 2\.0 mm$'):
        Valve(2.5)


def test_every_number_of_a_tuple_is_checked_and_named():
    for place, lengths in enumerate([(math.nan, 1.0), (1.0, math.inf)]):
        with pytest.raises(ValueError, match=rf'^Spring\.lengths\[{place}\] = (nan|inf) m is not finite$'):
            Spring(10.0, lengths=lengths)


def test_fields_with_a_default_are_optional():
    assert make() == Spring(10.0)


def test_integers_convert_to_floats_and_lists_to_tuples():
    spring = make(stiffness=10, lengths=[1, 2.5], names=['a', 'b'])
    assert spring == Spring(10.0, lengths=(1.0, 2.5), names=('a', 'b'))
    assert type(spring.stiffness) is float
    assert type(spring.lengths) is tuple
    assert [type(length) for length in spring.lengths] == [float, float]


@pytest.mark.parametrize(
    ('values', 'complaint'),
    [
        ({'stiffness': '10'}, "spring.stiffness = '10' is not a number"),
        ({'stiffness': True}, 'spring.stiffness = True is not a number'),
        ({'stiffness': None}, 'spring.stiffness = None is not a number'),
        ({'stiffness': [1.0]}, r'spring.stiffness = \[1.0\] is not a number'),
        ({'coils': 5.0}, 'spring.coils = 5.0 is not a whole number'),
        ({'coils': True}, 'spring.coils = True is not a whole number'),
        ({'wound': 1}, 'spring.wound = 1 is not true or false'),
        ({'wound': 'yes'}, "spring.wound = 'yes' is not true or false"),
        ({'material': 3}, 'spring.material = 3 is not a text'),
        ({'lengths': 1.0}, 'spring.lengths = 1.0 is not a list'),
        ({'lengths': 'ab'}, "spring.lengths = 'ab' is not a list"),
        ({'lengths': [1.0, 'x']}, r"spring.lengths\[1\] = 'x' is not a number"),
        ({'names': ['a', 1]}, r'spring.names\[1\] = 1 is not a text'),
        ({'coils': 0}, 'spring: Spring.coils = 0 1 is below its lower bound 1 1'),
        ({'colour': 'red', 'age': 1}, 'spring has no age, colour: it has stiffness, coils'),
        ({'made': 1.0}, 'spring has no made: it has'),
        ({3: 4}, 'spring has no 3: it has'),
        ({'stifness': 1.0}, 'spring has no stifness: it has .*, names; did you mean stiffness?'),
        (
            {'Coil': 1, 'matrial': 'x', 'zzz': 1},
            r'spring has no Coil, matrial, zzz: .*; did you mean coils, material\?$',
        ),
        ({'zzz': 1}, 'spring has no zzz: it has [a-z, ]*$'),
        ({'two\nlines': 1}, r"spring has no 'two\\nlines': it has"),
    ],
)
def test_an_invalid_mapping_is_rejected_in_one_line_that_names_the_field(values, complaint):
    with pytest.raises(ValueError, match=f'^{complaint}') as refusal:
        make(**{str(k): v for k, v in values.items()}) if 3 not in values else from_mapping(Spring, values, 'spring')
    assert '\n' not in str(refusal.value)


@pytest.mark.parametrize(
    ('name', 'expected'),
    [
        ('coils', 'spring.coils'),
        ('damper.coils', 'spring.coils'),
        ('coil', 'spring.coils'),
        ('spring_coils', 'spring.coils'),
        ('damper.leng', 'damper.length'),
        ('spring.leng', 'spring.length'),
        ('mas', 'mass'),
        ('x', None),
    ],
)
def test_a_similar_name_has_few_other_letters_or_another_prefix(name, expected):
    known = ['coil_spacing', 'spring.coils', 'spring.length', 'damper.length', 'mass']
    assert similar_names([name], known).get(name) == expected


def test_the_first_ten_unknown_names_are_compared_with_the_known_ones():
    strange = [f'q{number}' for number in range(9)]
    assert similar_names([*strange, 'coil'], ['coils']) == {'coil': 'coils'}
    assert similar_names([*strange, 'q9', 'coil'], ['coils']) == {}


def test_of_several_similar_names_the_most_similar_one_counts():
    assert similar_names(['coil'], ['boil', 'coils', 'cool']) == {'coil': 'coils'}


@pytest.mark.parametrize(
    ('word', 'known', 'said'),
    [
        ('bom', ['boom', 'arm'], 'did you mean boom? there are arm, boom'),
        ('coil', ['boil', 'coils'], 'did you mean coils? there are boil, coils'),
        ('x', ['boom'], 'there is boom'),
        ('x', [], 'there are none'),
    ],
)
def test_what_a_word_was_meant_to_be_is_said_with_all_known_ones(word, known, said):
    assert meant(word, known) == said


@pytest.mark.parametrize(
    ('document', 'complaint'),
    [
        (None, 'a case file is a mapping of names to values, not NoneType'),
        (['name'], 'a case file is a mapping of names to values, not list'),
        ({}, 'case file: name = None is not one line of text'),
        ({'name': ''}, "case file: name = '' is not one line of text"),
        ({'name': 5}, 'case file: name = 5 is not one line of text'),
        ({'name': 'a\nb'}, r"case file: name = 'a\\nb' is not one line of text"),
        ({'name': 'x', 'source': None}, 'case x: source = None is not a text'),
    ],
)
def test_a_document_without_name_or_with_a_source_that_is_no_text_is_refused(document, complaint):
    with pytest.raises(ValueError, match=f'^{complaint}$'):
        name_and_source(document, 'case')


def test_name_and_source_of_a_document_are_told():
    assert name_and_source({'name': 'x', 'source': 'Table 3\nand 4'}, 'case') == ('x', 'Table 3\nand 4')
    assert name_and_source({'name': 'x'}, 'case') == ('x', '')


def test_a_name_is_one_line_in_a_message():
    assert (printable('bore'), printable(5), printable('a\nb')) == ('bore', '5', r"'a\nb'")


@pytest.mark.parametrize(('text', 'newtons'), [('15e2', 1.5e3), ('1.0e5', 1e5), ('2 N/mm', 2e3), ('3.5kN/m', 3.5e3)])
def test_a_number_may_be_a_text_with_a_unit_or_one_that_yaml_reads_as_text(text, newtons):
    assert make(stiffness=text).stiffness == pytest.approx(newtons)
    assert make(lengths=['2.5 mm', 1, '20e-3']).lengths == pytest.approx((2.5e-3, 1.0, 0.02))
    with pytest.raises(ValueError, match=r'is not a whole number$'):
        make(coils=text)


@pytest.mark.parametrize('text', ['10', 'e5', '', 'N/m', '1,5 N/m', '1.2.3 N/m'])
def test_another_text_is_no_number(text):
    with pytest.raises(ValueError, match=r'is not a number \[N/m\] or text such as 1\.0 kN/m$'):
        make(stiffness=text)


def test_a_unit_of_another_quantity_is_refused_and_a_length_that_fits_in_millimetres_gets_a_hint():
    with pytest.raises(ValueError, match=r"^spring\.stiffness: unit 'N' is not for a stiffness: N/m, N/mm, kN/m$"):
        make(stiffness='1e5 N')
    geometry = {'section_diameter': 2.6e-3, 'ring_inner_diameter': 0.06, 'rod_diameter': 0.06}
    with pytest.raises(ValueError, match=r'gland_diameter = 63\.0 m is above .* 10\.0 m; if it is in mm, write 63 mm$'):
        from_mapping(SealGeometry, {**geometry, 'gland_diameter': 63}, 'seal')


def test_an_integer_that_no_float_holds_is_refused_as_one():
    with pytest.raises(ValueError, match=r'^spring\.stiffness is too large for a floating-point number$'):
        make(stiffness=10**400)


def test_a_group_prefixes_its_names_and_knows_the_fixed_ones():
    @dataclass(frozen=True)
    class Clock:
        period: float = parameter(1.0, unit='s', description='Period.')
        name: str = parameter('', unit='', live=False, description='Name.')

    assert ParameterGroup(Clock, 'clock.').names() == {'clock.period': 'period', 'clock.name': 'name'}
    assert ParameterGroup(Clock, 'clock.').fixed() == {'clock.name'}
    assert ParameterGroup(Clock, live=False).fixed() == {'period', 'name'}


def test_an_integer_too_large_for_a_float_violates_its_bound():
    with pytest.raises(ValueError, match='above its upper bound 100'):
        make(coils=10**400)


def test_a_missing_field_is_named():
    with pytest.raises(ValueError, match=r'^spring lacks stiffness$'):
        from_mapping(Spring, {}, 'spring')


@pytest.mark.parametrize('values', [None, 5, 'stiffness', ['stiffness'], [('stiffness', 10.0)]])
def test_a_value_that_is_not_a_mapping_is_rejected(values):
    with pytest.raises(ValueError, match=r'^spring is not a mapping of names to values but '):
        from_mapping(Spring, values, 'spring')


def test_a_field_that_the_caller_sets_is_rejected_in_the_mapping():
    assert from_mapping(Spring, {'coils': 7}, 'spring', stiffness=10.0) == Spring(10.0, 7)
    with pytest.raises(ValueError, match=r'^spring has no stiffness'):
        from_mapping(Spring, {'stiffness': 1.0}, 'spring', stiffness=10.0)


json_values = st.recursive(
    st.none() | st.booleans() | st.floats() | st.integers(-(2**63), 2**63) | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=5,
)


@given(st.dictionaries(st.sampled_from(['stiffness', 'coils', 'wound', 'material', 'lengths', 'x']), json_values))
def test_any_mapping_makes_a_valid_record_or_a_value_error(values):
    try:
        spring = from_mapping(Spring, values, 'spring')
    except ValueError:
        return
    check(spring)
    assert type(spring.stiffness) is float
    assert type(spring.coils) is int


def test_a_record_cannot_be_changed():
    with pytest.raises(AttributeError):
        Spring(10.0).stiffness = 20.0


def test_meanings_come_in_order_of_declaration_of_class_and_instance_alike():
    names = ['stiffness', 'coils', 'wound', 'material', 'lengths', 'names']
    assert list(meanings(Spring)) == list(meanings(Spring(10.0))) == names
    assert meanings(Spring)['stiffness'] == Meaning('N/m', 'Force per length.', 1.0, 1e6, live=True)


@pytest.mark.parametrize('record', RECORDS, ids=lambda record: record.__name__)
def test_every_parameter_has_a_description_and_ordered_bounds(record):
    assert meanings(record)
    for name, meaning in meanings(record).items():
        assert meaning.description.endswith('.'), name
        if meaning.lower is not None and meaning.upper is not None:
            assert meaning.lower < meaning.upper, name


@pytest.mark.parametrize('record', [EstimatorSettings, SealSelection], ids=lambda record: record.__name__)
def test_defaults_lie_inside_their_bounds_and_make_a_valid_record(record):
    made = record()
    check(made)
    assert from_mapping(record, asdict(made), 'defaults') == made
    for name, meaning in meanings(record).items():
        default = getattr(made, name)
        if meaning.lower is not None:
            assert meaning.lower <= default <= meaning.upper, name


@pytest.mark.parametrize(
    ('unit', 'size'),
    [
        ('psi', 6894.757293168361),
        ('lbf', 4.4482216152605),
        ('in', 0.0254),
        ('bar', 1e5),
        ('in2', 6.4516e-4),
        ('N', 1.0),
    ],
)
def test_units_have_their_size_in_si(unit, size):
    assert unit_size(unit) == pytest.approx(size, rel=1e-15)


def test_an_unknown_unit_is_rejected_with_the_known_ones():
    with pytest.raises(ValueError, match=r"^unknown unit 'furlong': use one of 1, s, ms"):
        unit_size('furlong')
