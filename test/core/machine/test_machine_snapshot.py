"""A machine taken up from its text goes on as if never stopped."""

import json

import pytest
import yaml
from harness.machines import EXCAVATOR, installed, made, message

from seal_friction_ros.core.machine import machine as m
from seal_friction_ros.core.machine.machine_snapshot import (
    is_machine_text,
    machine_of_text,
    machine_text,
    parse_machine_text,
)

MS = 1_000_000  # [ns]
DOCUMENT = yaml.safe_load(EXCAVATOR)
MACHINE = made(EXCAVATOR)
DEFINITIONS = {kind: installed(kind) for kind in MACHINE.file.topics.values()}
NAMES = ['boom', 'arm', 'bucket']


def taken(machine, state, first, last):
    """State and answers after some milliseconds."""
    answers = []
    for i in range(first, last):
        for topic in ('/a', '/b'):
            data = message('std_msgs/Float64MultiArray', data=[20.0, 30.0, 40.0])
            state = m.receive(machine, state, topic, data, i * MS, lambda *answer: answers.append(answer))
        for topic in ('/set', '/joint_states'):
            data = message('sensor_msgs/JointState', i * MS, name=NAMES, velocity=[0.1, 0.0, -0.1])
            state = m.receive(machine, state, topic, data, i * MS, lambda *answer: answers.append(answer))
    return state, answers


def test_what_comes_back_answers_to_the_bit_what_the_machine_would_have():
    state, _ = taken(MACHINE, m.init(MACHINE), 1, 150)
    text = machine_text(DOCUMENT, MACHINE, state)
    again, restored = parse_machine_text(text, DEFINITIONS)
    assert again.file == MACHINE.file == machine_of_text(text)
    assert [one.force for one in restored.actuators] == [one.force for one in state.actuators]
    assert restored.actuators[0].force > 1.0
    (further, answers), (as_was, expected) = taken(again, restored, 150, 160), taken(MACHINE, state, 150, 160)
    assert answers == expected != []
    assert machine_text(DOCUMENT, again, further) == machine_text(DOCUMENT, MACHINE, as_was)
    assert machine_text(DOCUMENT, again, restored) == text


@pytest.mark.parametrize(
    ('text', 'is_one'),
    [('{"machine": {}}', True), ('{"version": 2}', False), ('["machine"]', False), ('{', False), ('', False)],
)
def test_the_text_of_a_machine_is_told_from_others(text, is_one):
    assert is_machine_text(text) is is_one


def damaged(change) -> str:
    document = json.loads(machine_text(DOCUMENT, MACHINE, m.init(MACHINE)))
    change(document)
    return json.dumps(document)


@pytest.mark.parametrize(
    ('change', 'complaint'),
    [
        (lambda d: d.pop('machine'), 'no machine and actuators in it'),
        (lambda d: d.pop('actuators'), 'no machine and actuators in it'),
        (lambda d: d['machine'].pop('topics'), 'configuration: machine lacks topics'),
        (lambda d: d['actuators'].pop('arm'), "not the JSON of a snapshot: KeyError: 'arm'"),
        (lambda d: d['actuators']['arm'].pop('snapshot'), "KeyError: 'snapshot'"),
        (lambda d: d['actuators']['arm'].pop('memory'), "KeyError: 'memory'"),
        (lambda d: d['actuators']['arm'].pop('force'), "KeyError: 'force'"),
        (lambda d: d['actuators']['arm'].update(force=5.0), 'not the JSON of a snapshot: TypeError'),
        (lambda d: d.update(actuators=[]), 'not the JSON of a snapshot: AttributeError'),
    ],
)
def test_a_damaged_text_is_refused_with_what_is_wrong(change, complaint):
    with pytest.raises(ValueError, match=complaint):
        parse_machine_text(damaged(change), DEFINITIONS)


@pytest.mark.parametrize('text', ['', '[]', '5', '{}'])
def test_what_is_no_text_of_a_machine_is_refused(text):
    with pytest.raises(ValueError):
        machine_of_text(text)
