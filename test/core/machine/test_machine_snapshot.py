"""A machine taken up from its text goes on as if never stopped."""

import json

import pytest
from harness.machines import EXCAVATOR, installed, made, message

from seal_friction_ros.core.estimation.configuration import first_snapshot, snapshot_text
from seal_friction_ros.core.machine import machine as m
from seal_friction_ros.core.machine.machine_snapshot import (
    machine_of,
    machine_text,
    parse_machine_text,
    snapshot_of,
)
from seal_friction_ros.core.messages.coder import encode
from seal_friction_ros.core.messages.layouts import INPUTS
from seal_friction_ros.core.messages.records import Pressure, Velocity
from seal_friction_ros.files import default_configuration

MS = 1_000_000  # [ns]
MACHINE = made(EXCAVATOR)
DEFINITIONS = {kind: installed(kind) for kind in MACHINE.file.topics.values()}
NAMES = ['boom', 'arm', 'bucket']


def take(machine, state, topic, data, received, answers):
    """Take one message."""
    plan, emits = machine.plans[topic], m.named_emits(machine, lambda *answer: answers.append(answer))
    m.receive(machine, state, plan, plan.read(data), received, emits)


def answers_of(machine, state, first, last):
    """Answers of some milliseconds."""
    answers = []
    for i in range(first, last):
        for topic in ('/a', '/b'):
            data = message('std_msgs/Float64MultiArray', data=[20.0, 30.0, 40.0])
            take(machine, state, topic, data, i * MS, answers)
        for topic in ('/set', '/joint_states'):
            data = message('sensor_msgs/JointState', i * MS, name=NAMES, velocity=[0.1, 0.0, -0.1])
            take(machine, state, topic, data, i * MS, answers)
    return answers


def test_a_restored_machine_gives_the_same_answers_to_the_bit():
    state = m.init(MACHINE)
    answers_of(MACHINE, state, 1, 150)
    text = machine_text(snapshot_of(MACHINE, state))
    again, restored = machine_of(parse_machine_text(text), DEFINITIONS)
    assert again.file == MACHINE.file
    assert [one.force for one in restored.actuators] == [one.force for one in state.actuators]
    assert restored.actuators[0].force > 1.0
    assert machine_text(snapshot_of(again, restored)) == text
    assert answers_of(again, restored, 150, 160) == answers_of(MACHINE, state, 150, 160) != []
    assert machine_text(snapshot_of(again, restored)) == machine_text(snapshot_of(MACHINE, state)) != text


def test_the_snapshot_of_one_actuator_is_a_machine_of_one():
    """As bags have it from before there were machines: the messages of this project are taken as they are."""
    text = snapshot_text(first_snapshot(default_configuration()))
    machine, state = machine_of(parse_machine_text(text), {})
    assert [actuator.name for actuator in machine.actuators] == ['']
    assert set(machine.plans) == set(INPUTS)
    assert machine_text(snapshot_of(machine, state)) == text
    answers = []
    take(machine, state, 'cylinder_pressure', encode(Pressure(1, 2e6, 1e6)), 1, answers)
    take(machine, state, 'rod_velocity', encode(Velocity(2, 0.1, b'rod')), 2, answers)
    assert [(name, record.stamp, frame_id) for name, record, frame_id in answers] == [('', 2, b'rod')]
    assert (
        parse_machine_text(machine_text(snapshot_of(machine, state))).actuators[''].snapshot.state.pressure.stamp == 1
    )


def damaged(change) -> str:
    document = json.loads(machine_text(snapshot_of(MACHINE, m.init(MACHINE))))
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
        (lambda d: d.update(actuators=[]), 'not the JSON of a snapshot: TypeError'),
    ],
)
def test_a_damaged_text_is_refused_with_what_is_wrong(change, complaint):
    with pytest.raises(ValueError, match=complaint):
        parse_machine_text(damaged(change))


@pytest.mark.parametrize('text', ['', '[]', '5', '{}'])
def test_what_is_no_text_of_a_machine_is_refused(text):
    with pytest.raises(ValueError):
        parse_machine_text(text)
