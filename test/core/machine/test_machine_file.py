"""The mapping file: what it says, and that every mistake is named with its place."""

import math

import pytest
import yaml
from harness.machines import BENCH, EXCAVATOR, parsed

from seal_friction_ros.core.machine.machine_file import Signal, parse_machine


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
    'unit': ({'inputs': INPUTS | {'pressure_a': {'topic': '/p_a', 'unit': 'N'}}}, 'is none of a pressure: Pa, kPa'),
    'gain': ({'inputs': INPUTS | {'pressure_a': {'topic': '/p_a', 'gain': 0.0}}}, 'gain = 0'),
    'rod': ({'rod': '41 mm'}, 'is not below bore'),
    'no rod': ({'rod': None}, 'lacks rod'),
    'no areas': ({'rod': None, 'bore': None}, 'needs the areas'),
    'length': ({'bore': '40 bar'}, "unit 'bar' is none of a length"),
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
