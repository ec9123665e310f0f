"""The mapping file: what it says, and that every mistake is named with its place."""

import math

import pytest
import yaml
from harness.machines import BENCH, EXCAVATOR, parsed

from seal_friction_ros.core.estimation.estimator import EstimatorSettings
from seal_friction_ros.core.machine import machine_file
from seal_friction_ros.core.machine.differentiator import chosen_differentiator
from seal_friction_ros.core.machine.machine_file import (
    ForceSum,
    LoadTable,
    Output,
    Signal,
    Spring,
    Weight,
    parse_machine,
)


def test_units_and_short_forms_are_si_and_full_forms():
    actuator = parsed(BENCH).actuators[0]
    assert actuator.area_a == pytest.approx(math.pi * 0.02**2)
    assert actuator.area_a - actuator.area_b == pytest.approx(math.pi * 0.011**2)
    assert actuator.inputs['velocity'] == Signal('/joint_states', 'velocity[axis]')
    assert actuator.inputs['pressure_a'] == Signal('/p_a', 'fluid_pressure', absolute=True)
    assert parsed(EXCAVATOR).actuators[1].inputs['pressure_b'] == Signal('/b', 'data[1]', 1e5)
    assert parsed(EXCAVATOR).actuators[0].feedforward.scale == 0.8


INPUTS = yaml.safe_load(BENCH)['actuators']['axis']['inputs']
MISTAKES = {
    'sealss': ({'sealss': ['a']}, 'did you mean seals'),
    'input': ({'inputs': INPUTS | {'velocty': 1.0}}, 'did you mean velocity'),
    'no pressure b': ({'inputs': {k: v for k, v in INPUTS.items() if k != 'pressure_b'}}, 'write pressure_b: 0.0'),
    'topic': ({'inputs': INPUTS | {'velocity': '/joint_state velocity[axis]'}}, 'is not among topics: /joint_states'),
    'no field': ({'inputs': INPUTS | {'velocity': '/joint_states'}}, 'name the field'),
    'unit': ({'inputs': INPUTS | {'pressure_a': {'topic': '/p_a', 'unit': 'N'}}}, 'is not for a pressure: Pa, kPa'),
    'gain': ({'inputs': INPUTS | {'pressure_a': {'topic': '/p_a', 'gain': 0.0}}}, 'gain = 0'),
    'rod': ({'rod': '41 mm'}, 'is not below bore'),
    'no rod': ({'rod': None}, 'lacks rod'),
    'no areas': ({'rod': None, 'bore': None}, 'needs the areas'),
    'length': ({'bore': '40 bar'}, "unit 'bar' is not for a length"),
    'nan': ({'bore': math.nan}, 'not a finite number'),
    'seals': ({'seals': ['ms28775_114@c']}, 'is not a, b, difference or ambient'),
    'velocity from position': ({'inputs': {k: v for k, v in INPUTS.items() if k != 'velocity'}}, 'step: 5 um'),
    'empty force sum': ({'force_sum': {'pressures': False}}, 'is empty'),
    'loads': ({'force_sum': {'load_force': '/load wrench.force.z', 'load': 'none'}}, 'contradict'),
    'table': (
        {'force_sum': {'load_over_position': {'positions': [0.0, 0.0], 'forces': [1.0, 2.0]}}},
        'do not increase',
    ),
    'parameter': ({'parameters': {'feedforward': {'scal': 1.0}}}, 'did you mean feedforward.scale'),
    'bound': ({'parameters': {'feedforward.scale': 99.0}}, 'above its upper bound'),
    'output type': ({'output': {'topic': '/x', 'type': 'std_msgs/msg/String'}}, 'is not one of'),
    'output joint': ({'output': {'topic': '/x', 'type': 'sensor_msgs/msg/JointState'}}, 'name the joint'),
    'not a mapping': ({'inputs': [1]}, 'is not a mapping'),
}


@pytest.mark.parametrize('name', MISTAKES)
def test_a_mistake_is_one_line_with_file_actuator_and_remedy(name):
    changes, expected = MISTAKES[name]
    with pytest.raises(ValueError, match=r'^[^\n]*$') as raised:
        parsed(BENCH, **changes)
    text = str(raised.value)
    assert text.startswith('robot.yaml: axis')
    assert expected in text


@pytest.mark.parametrize('document', [None, 3, [], {'name': 'x'}, {'name': 'x', 'topics': {'a': 'b'}, 'actuators': {}}])
def test_anything_else_is_refused_in_one_line(document):
    with pytest.raises(ValueError, match=r'\Arobot.yaml[^\n]*\Z'):
        parse_machine(document, 'robot.yaml')


def test_a_load_that_no_term_tells_is_marked():
    force = {'pressures': True}
    for terms, unknown in (
        ({}, True),
        ({'load': 'none'}, False),
        ({'weight': {'mass': 80.0, 'angle': '90 deg'}}, False),
    ):
        assert parsed(BENCH, force_sum=force | terms).actuators[0].force_sum.holds_unknown_load == unknown


# --- what is accepted, and the bounds ---


def example():
    """The example of the module."""
    lines = machine_file.__doc__.splitlines()
    first = next(i for i, line in enumerate(lines) if line.endswith('::'))
    last = next(i for i, line in enumerate(lines) if line.startswith('A value is in SI'))
    return yaml.safe_load('\n'.join(lines[first + 1 : last]))


def test_the_example_in_the_documentation_means_what_it_says():
    file = parse_machine(example(), 'crane.yaml')
    assert (file.name, file.together) == ('crane', False)
    assert file.ambient_pressure == pytest.approx(1.013e5)
    assert file.topics['/load_cell'] == 'geometry_msgs/WrenchStamped'
    (boom,) = file.actuators
    assert (boom.name, boom.selection.seals, boom.selection.seal_chambers) == ('boom', ('ms28775_114',) * 2, ('a', 'b'))
    assert boom.inputs == {
        'velocity': Signal('/joint_states', 'velocity[boom]'),
        'position': Signal('/joint_states', 'position[boom]'),
        'pressure_a': Signal('/pressures', 'data[0]', 1e5, 0.0, absolute=True),
        'pressure_b': Signal('/pressures', 'data[1]', 1e5, 0.0, absolute=True),
        'reference_velocity': Signal('/boom/reference', 'velocities[0]'),
        'temperature': Signal('/oil_temperature', 'temperature', 1.0, 273.15),
    }
    assert boom.force_sum == ForceSum(
        pressures=True,
        load_force=Signal('/load_cell', 'wrench.force.z', -1.0),
        weight=Weight(80.0, pytest.approx(math.pi / 2.0)),
        spring=Spring(200.0, 0.1),
        load_over_position=LoadTable((0.0, 0.5), (900.0, 1200.0)),
        holds_unknown_load=False,
    )
    assert boom.output == Output('/boom/effort', 'sensor_msgs/JointState', 1.0, 0, 'boom')
    assert (boom.feedforward.scale, boom.settings, boom.differentiator) == (0.8, EstimatorSettings(), None)


def with_parts(**parts):
    return parse_machine(yaml.safe_load(BENCH) | parts, 'robot.yaml')


def test_a_key_that_is_not_given_has_its_default():
    file = parsed(BENCH)
    assert (file.ambient_pressure, file.together) == (101_325.0, False)
    assert with_parts(answers='together').together
    assert not with_parts(answers='each').together
    output = parsed(BENCH, output={'topic': '/x', 'type': 'std_msgs/msg/Float64'}).actuators[0].output
    assert output == Output('/x', 'std_msgs/Float64', 1.0, 0, '')
    bare = parsed(BENCH, force_sum=None, bore=None, rod=None).actuators[0]
    assert (bare.force_sum, bare.output, bare.area_a, bare.area_b) == (None, None, 0.0, 0.0)


@pytest.mark.parametrize(
    ('parts', 'complaint'),
    [
        ({'ambient_pressure': 2.99e4}, 'is not between 3e4 and 1.2e5 Pa'),
        ({'ambient_pressure': 1.21e5}, 'is not between 3e4 and 1.2e5 Pa'),
        ({'ambient_pressure': 3e4}, None),
        ({'ambient_pressure': '1.2 bar'}, None),
        ({'answers': 'both'}, "answers = 'both': one of each, together"),
        ({'name': ''}, "name = '' is not one line of text"),
        ({'name': 5}, 'name = 5 is not one line of text'),
        ({'name': 'a\nb'}, 'is not one line of text'),
        ({'actuators': {}}, 'actuators has 0 entries: give 1 to 64'),
        ({'actuators': {'1st': {}}}, "'1st' is not a name of letters, digits and _"),
        ({'actuators': {5: {}}}, "'5' is not a name of letters, digits and _"),
        ({'actuators': {'axis': 5}}, 'robot.yaml: axis is not a mapping'),
        ({'topics': {'joint_states': 'a/B'}}, "'joint_states' is not a topic: write it as /pressures"),
        ({'topics': {5: 'a/B'}}, "'5' is not a topic"),
        ({'topics': {'/a': 'JointState'}}, "'JointState' is not a type"),
        ({'topics': {'/a': 5}}, "'5' is not a type"),
        ({'color': 'red'}, 'robot.yaml has no color'),
    ],
)
def test_a_file_is_refused_beyond_its_bounds(parts, complaint):
    if complaint is None:
        assert with_parts(**parts)
    else:
        with pytest.raises(ValueError) as raised:
            with_parts(**parts)
        assert complaint in str(raised.value)


def test_a_machine_has_64_actuators_at_most():
    axis = yaml.safe_load(BENCH)['actuators']['axis']
    assert len(with_parts(actuators={f'axis{i}': axis for i in range(64)}).actuators) == 64
    with pytest.raises(ValueError, match='actuators has 65 entries: give 1 to 64'):
        with_parts(actuators={f'axis{i}': axis for i in range(65)})


def bore_of(value) -> float:
    return math.sqrt(4.0 / math.pi * parsed(BENCH, bore=value, rod='1 um').actuators[0].area_a)


@pytest.mark.parametrize(
    ('value', 'metres'),
    [
        (0.04, 0.04),
        (1, 1.0),
        ('40 mm', 0.04),
        ('1.5e1mm', 0.015),
        ('+2 in', 0.0508),
        ('4.0E-2 m', 0.04),
        ('20e-3', 0.02),
    ],
)
def test_a_length_is_in_metres_or_has_its_unit(value, metres):
    assert bore_of(value) == pytest.approx(metres)


@pytest.mark.parametrize(
    ('value', 'complaint'),
    [
        (0.0, 'is not above 0'),
        ('-40 mm', 'is not above 0'),
        (True, 'is not a number [m] or text such as 1.0 in'),
        (63, 'bore = 63 m is above 3 m; if it is in mm, write 63 mm'),
        ('40', "'40' is not a number [m]"),
        ('40mm wide', "unit 'mm wide' is not for a length"),
        ([1.0], 'is not a number [m]'),
        (math.inf, 'is not a finite number below 1e15'),
        (1e15, 'is not a finite number below 1e15'),
        ('1e18 mm', 'is not a finite number below 1e15'),
        ('1.2.3 mm', "bore = '1.2.3 mm'"),
        ('40 kg', "unit 'kg' is not for a length: m, mm, cm, um, in"),
    ],
)
def test_what_is_no_length_is_refused(value, complaint):
    with pytest.raises(ValueError) as raised:
        bore_of(value)
    assert 'axis: bore' in str(raised.value)
    assert complaint in str(raised.value)


def test_areas_are_given_or_follow_from_bore_and_rod():
    areas = {'bore': None, 'rod': None, 'area_a': '1200 mm2', 'area_b': 8e-4}
    actuator = parsed(BENCH, **areas).actuators[0]
    assert (actuator.area_a, actuator.area_b) == (pytest.approx(1.2e-3), 8e-4)
    with pytest.raises(ValueError, match='give bore and rod, or area_a and area_b'):
        parsed(BENCH, area_b=8e-4)
    with pytest.raises(ValueError, match='axis lacks bore'):
        parsed(BENCH, bore=None)
    with pytest.raises(ValueError, match='is not below bore'):
        parsed(BENCH, rod='40 mm')
    for one in ('area_a', 'area_b'):
        with pytest.raises(ValueError, match=r'force_sum\.pressures needs the areas'):
            parsed(BENCH, **areas | {one: None})


FLOAT = 'std_msgs/msg/Float64'


def source(value, kind='std_msgs/msg/Float64MultiArray', name='pressure_a'):
    topics = yaml.safe_load(BENCH)['topics'] | {'/x': kind}
    axis = yaml.safe_load(BENCH)['actuators']['axis']
    axis['inputs'] |= {name: value}
    return with_parts(topics=topics, actuators={'axis': axis}).actuators[0].inputs[name]


@pytest.mark.parametrize(
    ('value', 'kind', 'expected'),
    [
        ('/x data[0]', 'std_msgs/msg/Float64MultiArray', Signal('/x', 'data[0]')),
        ({'topic': '/x', 'unit': 'bar', 'gain': 2, 'offset': '1 bar'}, FLOAT, Signal('/x', 'data', 2e5, 1e5)),
        ('/x', FLOAT, Signal('/x', 'data')),
        ('/x', 'std_msgs/msg/Float32', Signal('/x', 'data')),
        ('/x', 'sensor_msgs/msg/FluidPressure', Signal('/x', 'fluid_pressure', absolute=True)),
        ({'topic': '/x', 'absolute': False}, 'sensor_msgs/msg/FluidPressure', Signal('/x', 'fluid_pressure')),
        ('/x variance', 'sensor_msgs/msg/FluidPressure', Signal('/x', 'variance', absolute=True)),
        ('2 bar', FLOAT, 2e5),
    ],
)  # fmt: skip
def test_a_signal_has_gain_offset_and_reference_in_si(value, kind, expected):
    assert source(value, kind) == expected


@pytest.mark.parametrize(
    ('name', 'kind', 'field'),
    [
        ('velocity', 'seal_friction_msgs/msg/RodVelocity', 'velocity'),
        ('position', 'seal_friction_msgs/msg/RodPosition', 'position'),
        ('temperature', 'std_msgs/msg/Float64', 'data'),
        ('reference_position', 'std_msgs/msg/Float64', 'data'),
    ],
)
def test_a_message_with_one_number_needs_no_field(name, kind, field):
    assert source('/x', kind, name) == Signal('/x', field)


@pytest.mark.parametrize(
    ('value', 'complaint'),
    [
        ({'topic': '/x', 'field': 'data[0]', 'absolute': 1}, 'absolute = 1: true or false, for a pressure'),
        ({'topic': '/x', 'field': 5}, 'name the field of std_msgs/Float64MultiArray, as /x FIELD'),
        ({'topic': '/y', 'field': 'data[0]'}, "topic '/y' is not among topics"),
        ({'field': 'data[0]'}, "topic 'None' is not among topics"),
        ({'topic': '/x', 'fields': 'data[0]'}, 'did you mean field?'),
        ({'topic': '/x', 'field': 'data[0]', 'gain': '2 bar'}, "unit 'bar' is not for a number"),
        ({'topic': '/x', 'field': 'data[0]', 'offset': '2 mm'}, "unit 'mm' is not for a pressure"),
    ],
)
def test_what_is_no_signal_is_refused(value, complaint):
    with pytest.raises(ValueError) as raised:
        source(value)
    assert complaint in str(raised.value)


def test_only_a_pressure_is_absolute():
    with pytest.raises(ValueError, match=r'absolute = True: true or false, for a pressure'):
        source({'topic': '/x', 'field': 'data[0]', 'absolute': True}, name='velocity')


FROM_POSITION = {'position': '/joint_states position[axis]', 'pressure_a': '/p_a', 'pressure_b': '/p_b'}


def from_position(**values):
    return parsed(BENCH, inputs=FROM_POSITION, velocity_from_position=values).actuators[0].differentiator


def test_a_velocity_from_position_has_half_a_millimetre_per_second_of_noise():
    assert from_position(step=5e-6, rate=500.0) == from_position(step=5e-6, rate='500 Hz')
    assert from_position(step=5e-6, rate=500.0) == chosen_differentiator(5e-6, 500.0, 5e-4)
    assert from_position(step=5e-6, rate=500.0, noise='10 mm/s') == chosen_differentiator(5e-6, 500.0, 0.01)
    assert from_position(step=0.0, rate=1.0).samples == 2
    assert from_position(step=0.0, rate=1e5).samples == 2


@pytest.mark.parametrize(
    ('values', 'complaint'),
    [
        ({'step': -1e-6, 'rate': 500.0}, 'step = -1e-06 m is not 0 or more'),
        ({'step': 0.0, 'rate': 0.9}, 'rate = 0.9 Hz not within 1 to 1e5'),
        ({'step': 0.0, 'rate': 1.1e5}, 'not within 1 to 1e5'),
        ({'step': 0.0, 'rate': 0.0}, 'rate = 0.0 is not above 0'),
        ({'step': 0.0, 'rate': 500.0, 'noise': 0.0}, 'noise = 0.0 is not above 0'),
        ({'rate': 500.0}, 'step = None is not a number [m]'),
        ({'step': 1e-3, 'rate': 100.0}, 'axis: velocity_from_position: steps of 0.001 m at 100 Hz'),
        ({'step': 0.0, 'rate': 500.0, 'delay': 1.0}, 'velocity_from_position has no delay'),
    ],
)
def test_an_encoder_that_cannot_be_is_refused(values, complaint):
    with pytest.raises(ValueError) as raised:
        from_position(**values)
    assert complaint in str(raised.value)


@pytest.mark.parametrize(
    ('changes', 'complaint'),
    [
        ({'velocity_from_position': {'step': 0.0, 'rate': 500.0}}, 'there is a velocity among the inputs'),
        ({'inputs': FROM_POSITION | {'position': 0.1}}, 'inputs lacks velocity, or position with'),
        ({'inputs': FROM_POSITION}, 'lacks velocity_from_position: {step: 5 um, rate: 500 Hz}'),
        ({'inputs': INPUTS | {'velocity': 0.1}}, 'inputs.velocity is constant'),
        ({'inputs': INPUTS | {'reference_velocity': 0.1}}, 'inputs.reference_velocity is constant'),
        ({'inputs': INPUTS | {'reference_position': 0.1}}, 'inputs.reference_position is constant'),
        ({'inputs': INPUTS | {'reference_acceleration': 0.1}}, 'lacks reference_velocity, but has'),
        ({'inputs': INPUTS | {'pressure_difference': '/p_a'}}, 'has pressure_difference and pressure_a: leave one out'),
        ({'inputs': INPUTS | {'pressure_a': 0.0, 'pressure_b': 0.0}}, 'has no pressure that comes in a message'),
        ({'inputs': {k: v for k, v in INPUTS.items() if k != 'pressure_a'}}, 'write pressure_a: 0.0'),
        ({'inputs': {k: v for k, v in INPUTS.items() if k != 'position'}, 'force_sum': {'load': 'none', 'spring': {
            'stiffness': 1.0, 'rest_position': 0.0}}}, 'lacks position, which spring and load_over_position need'),
        ({'force_sum': {'load': 'none'}}, 'force_sum has no term that comes in a message'),
        ({'force_sum': {'load_force': 5.0}}, 'force_sum has no term that comes in a message'),
        ({'force_sum': {'weight': {'mass': 1.0, 'angle': 0.1}}}, 'force_sum has no term that comes in a message'),
        ({'force_sum': {'pressures': 1}}, 'pressures = 1 is not true or false'),
        ({'force_sum': {'load': 'some'}}, "load = 'some' is not none or unknown"),
        ({'force_sum': {'weight': {'mass': 1.0}}}, 'force_sum.weight lacks angle'),
        ({'force_sum': {'weight': {'mass': 0.0, 'angle': 0.0}}}, 'mass = 0.0 is not above 0'),
        ({'force_sum': {'spring': {'stiffness': 0.0, 'rest_position': 0.0}}}, 'stiffness = 0.0 is not above 0'),
        ({'force_sum': {'spring': {'stiffness': 1.0, 'rest_position': '1 kg'}}}, "unit 'kg' is not for a length"),
        ({'force_sum': {'load_over_position': {'positions': [0.0], 'forces': [1.0]}}}, 'give two or more of both'),
        ({'force_sum': {'load_over_position': {'positions': [0.0, 1.0], 'forces': [1.0]}}}, '2 positions and 1 forces'),
        ({'force_sum': {'load_over_position': {'positions': [0.0, 2.0, 1.0], 'forces': [1.0] * 3}}}, 'do not increase'),
        ({'output': {'topic': 'x', 'type': 'std_msgs/msg/Float64'}}, "topic = 'x' is not a topic"),
        ({'output': {'type': 'std_msgs/msg/Float64'}}, 'topic = None is not one line of text'),
        ({'output': {'topic': '/x', 'type': 'std_msgs/msg/Float64', 'index': 1}}, 'index = 1 is not 0 to 255'),
        ({'output': {'topic': '/x', 'type': 'std_msgs/msg/Float64MultiArray', 'index': 256}}, 'index = 256 is not 0'),
        ({'output': {'topic': '/x', 'type': 'std_msgs/msg/Float64MultiArray', 'index': -1}}, 'index = -1 is not 0'),
        ({'output': {'topic': '/x', 'type': 'std_msgs/msg/Float64MultiArray', 'index': True}}, 'index = True is not 0'),
        ({'output': {'topic': '/x', 'type': 'std_msgs/msg/Float64', 'joint': 'j'}}, 'and of no other type'),
        ({'output': {'topic': '/x', 'type': 'sensor_msgs/msg/JointState', 'joint': 'a\nb'}}, 'name the joint'),
        ({'output': {'topic': '/x', 'type': 'sensor_msgs/msg/JointState', 'joint': 5}}, 'name the joint'),
        ({'output': {'topic': '/x', 'type': 'geometry_msgs/msg/WrenchStamped'}}, 'name the frame of a WrenchStamped'),
        ({'output': {'topic': '/x', 'type': 'std_msgs/msg/Float64', 'frame': 'rod'}}, 'and of no other type'),
        ({'output': {'topic': '/x', 'type': 'std_msgs/msg/Float64', 'gain': '1 N'}}, "unit 'N' is not for a number"),
        ({'parameters': 5}, 'parameters is not a mapping'),
    ],
)  # fmt: skip
def test_parts_that_do_not_fit_each_other_are_refused(changes, complaint):
    with pytest.raises(ValueError) as raised:
        parsed(BENCH, **changes)
    assert complaint in str(raised.value)


@pytest.mark.parametrize('index', [0, 1, 255])
def test_an_array_has_256_places(index):
    output = {'topic': '/x', 'type': 'std_msgs/msg/Float64MultiArray', 'index': index}
    assert parsed(BENCH, output=output).actuators[0].output.index == index


DIFFERENCE = {'velocity': '/joint_states velocity[axis]', 'pressure_difference': '/p_a'}


def test_a_pressure_difference_tells_the_piston_seal_and_with_equal_areas_the_force():
    seals = {'seals': ['ms28775_114@difference'], 'inputs': DIFFERENCE}
    known = parsed(
        BENCH, **seals, force_sum={'load': 'none', 'pressures': True}, bore=None, rod=None, area_a=1e-3, area_b=1e-3
    )
    assert 'pressure_difference' in known.actuators[0].inputs
    with pytest.raises(ValueError, match='needs equal areas'):
        parsed(BENCH, **seals)
    with pytest.raises(ValueError, match='a seal sees chamber a, which pressure_difference does not tell'):
        parsed(BENCH, inputs=DIFFERENCE)


@pytest.mark.parametrize(
    ('terms', 'unknown'),
    [
        ({'pressures': True}, True),
        ({'pressures': True, 'load': 'unknown'}, True),
        ({'pressures': True, 'spring': {'stiffness': 1.0, 'rest_position': 0.0}}, True),  # a spring is not the load
        ({'pressures': True, 'load_force': '/load wrench.force.z'}, False),
        ({'load_over_position': {'positions': [0.0, 1.0], 'forces': [1.0, 2.0]}}, False),
        ({'spring': {'stiffness': 1.0, 'rest_position': 0.0}}, True),
        ({'pressures': True, 'load': 'none'}, False),
    ],
)
def test_a_load_is_known_by_a_cell_a_weight_a_table_or_by_word(terms, unknown):
    assert parsed(BENCH, force_sum=terms).actuators[0].force_sum.holds_unknown_load is unknown


def test_parameters_may_be_nested_or_dotted():
    for parameters in (
        {'feedforward': {'scale': 0.5}, 'stick_velocity': 5e-4},
        {'feedforward.scale': 0.5, 'stick_velocity': 5e-4},
    ):
        actuator = parsed(BENCH, parameters=parameters | {'adaptation': {'mode': 'on'}}).actuators[0]
        found = actuator.feedforward.scale, actuator.settings.stick_velocity, actuator.adaptation.mode
        assert found == (0.5, 5e-4, 'on')
