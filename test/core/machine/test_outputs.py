"""Commands for controllers, read back by rclpy."""

import pytest
import yaml
from harness.machines import EXCAVATOR, made, message_class, parsed
from rclpy.serialization import deserialize_message

from seal_friction_ros.core.machine.machine import init
from seal_friction_ros.core.machine.machine_file import parse_machine
from seal_friction_ros.core.machine.outputs import check_outputs, commands, due_commands

NAMES = ('boom', 'arm', 'bucket')
STAMP = 1_700_000_000_123_456_789


def read(command):
    return deserialize_message(command.data, message_class(command.type_name))


def test_all_actuators_of_a_topic_share_one_array():
    (command,) = commands(parsed(EXCAVATOR), {'boom': 1.5, 'bucket': -2.5, 'arm': float('nan')}, STAMP)
    assert command.topic == '/effort'
    assert list(read(command).data) == [1.5, 0.0, -2.5]


@pytest.mark.parametrize('joint', ['b', 'boom', 'boom_joint'])
def test_an_output_is_the_effort_of_its_joint(joint):
    output = {'topic': '/command', 'type': 'sensor_msgs/msg/JointState', 'joint': joint, 'gain': -2.0}
    state = read(commands(parsed(EXCAVATOR, output=output), {'boom': 3.0}, STAMP)[0])
    assert (list(state.name), list(state.effort), list(state.position)) == ([joint], [-6.0], [])
    assert state.header.stamp.sec * 10**9 + state.header.stamp.nanosec == STAMP


@pytest.mark.parametrize('frame', ['rod', 'boom_link', 'seven77'])
def test_the_force_along_x_of_a_frame_has_the_stamp_that_tells_its_age(frame):
    output = {'topic': '/wrench', 'type': 'geometry_msgs/msg/WrenchStamped', 'frame': frame, 'gain': -2.0}
    found = read(commands(parsed(EXCAVATOR, output=output), {'boom': 3.0}, STAMP)[0])
    assert (found.wrench.force.x, found.wrench.force.y, found.wrench.torque.z) == (-6.0, 0.0, 0.0)
    assert (found.header.frame_id, found.header.stamp.sec * 10**9 + found.header.stamp.nanosec) == (frame, STAMP)


def test_a_number_in_units_of_the_command():
    output = {'topic': '/valve', 'type': 'std_msgs/msg/Float64', 'gain': 1e-3}
    assert read(commands(parsed(EXCAVATOR, output=output), {'boom': 3.0}, STAMP)[0]).data == pytest.approx(3e-3)


def test_two_actuators_never_write_the_same_place():
    output = {'topic': '/effort', 'type': 'std_msgs/msg/Float64MultiArray', 'index': 1}
    with pytest.raises(ValueError, match='arm and boom have the same place'):
        check_outputs(parsed(EXCAVATOR, output=output))
    with pytest.raises(ValueError, match='another type'):
        check_outputs(parsed(EXCAVATOR, output={'topic': '/effort', 'type': 'std_msgs/msg/Float64'}))


def test_a_command_is_0_where_the_force_is_not_known_or_not_finite_and_has_its_place():
    output = {'topic': '/effort', 'type': 'std_msgs/msg/Float64MultiArray', 'index': 4, 'gain': 2.0}
    file = parsed(EXCAVATOR, output=output)
    (command,) = commands(file, {'boom': 1.5, 'arm': float('inf')}, STAMP)
    assert (command.topic, command.type_name) == ('/effort', 'std_msgs/Float64MultiArray')
    assert list(read(command).data) == [0.0, 0.0, 0.0, 0.0, 3.0]
    overflow = parsed(EXCAVATOR, output=output | {'gain': 1e14})
    assert list(read(commands(overflow, {'boom': 1e300}, STAMP)[0]).data) == [0.0] * 5


def joints(*names):
    """Mapping file of the excavator whose first actuators write the effort of joints of one topic."""
    document = yaml.safe_load(EXCAVATOR)
    for actuator, name in zip(document['actuators'].values(), names, strict=False):
        actuator['output'] = {'topic': '/command', 'type': 'sensor_msgs/msg/JointState', 'joint': name}
    return parse_machine(document, 'robot.yaml')


@pytest.mark.parametrize('names', [('b', 'a_longer_name'), ('four', 'five5'), ('abc', 'x', 'yz')])
def test_the_joints_of_a_topic_share_one_message(names):
    forces = {'boom': 1.0, 'arm': -2.0, 'bucket': 3.0}
    found = {command.topic: read(command) for command in commands(joints(*names), forces, STAMP)}
    state = found['/command']
    assert list(state.name) == list(names)
    assert list(state.effort) == [1.0, -2.0, 3.0][: len(names)]
    assert (list(state.position), list(state.velocity), state.header.frame_id) == ([], [], '')
    assert ('/effort' in found) is (len(names) < 3)


def test_actuators_with_places_of_their_own_are_accepted():
    check_outputs(parsed(EXCAVATOR))
    check_outputs(parsed(EXCAVATOR, output=None))
    check_outputs(parsed(EXCAVATOR, output={'topic': '/other', 'type': 'std_msgs/msg/Float64'}))
    check_outputs(joints('one', 'two', 'three'))
    document = yaml.safe_load(EXCAVATOR)
    for name, actuator in document['actuators'].items():
        actuator['output'] = {'topic': '/wrench', 'type': 'geometry_msgs/msg/WrenchStamped', 'frame': name}
    with pytest.raises(ValueError, match='arm and boom have the same place in /wrench'):
        check_outputs(parse_machine(document, 'robot.yaml'))
    with pytest.raises(ValueError, match='arm and boom have the same place in /command'):
        check_outputs(joints('one', 'one'))
    with pytest.raises(ValueError, match='bucket and arm have the same place'):
        check_outputs(joints('one', 'two', 'two'))


def test_commands_are_due_after_a_feed_forward_or_a_fault_on_the_clock_of_the_stamps():
    machine = made(EXCAVATOR)
    state = init(machine)
    for one in state.actuators:
        one.pipeline.clock_offset, one.force = 500, 2.0
    assert due_commands(machine, state, False, STAMP) == []
    assert due_commands(machine, state, True, STAMP) == commands(machine.file, dict.fromkeys(NAMES, 2.0), STAMP + 500)
    state.actuators[2].fault, state.actuators[2].force = 'too large', 0.0
    (command,) = due_commands(machine, state, False, STAMP)
    assert list(read(command).data) == [2.0, 2.0, 0.0]
    with_header = parsed(EXCAVATOR, output={'topic': '/command', 'type': 'sensor_msgs/msg/JointState', 'joint': 'b'})
    (first, _) = commands(with_header, {}, STAMP + 500)
    assert read(first).header.stamp.nanosec == (STAMP + 500) % 10**9
