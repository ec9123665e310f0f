"""Commands for controllers, read back by rclpy."""

import pytest
from harness.machines import EXCAVATOR, message_class, parsed
from rclpy.serialization import deserialize_message

from seal_friction_ros.core.machine.outputs import check_outputs, commands

STAMP = 1_700_000_000_123_456_789


def read(command):
    return deserialize_message(command.data, message_class(command.type_name))


def test_all_actuators_of_a_topic_share_one_array():
    (command,) = commands(parsed(EXCAVATOR), {'boom': 1.5, 'bucket': -2.5, 'arm': float('nan')}, STAMP)
    assert command.topic == '/effort'
    assert list(read(command).data) == [1.5, 0.0, -2.5]


@pytest.mark.parametrize('joint', ['b', 'boom', 'boom_joint'])
def test_the_effort_of_a_joint(joint):
    output = {'topic': '/command', 'type': 'sensor_msgs/msg/JointState', 'joint': joint, 'gain': -2.0}
    state = read(commands(parsed(EXCAVATOR, output=output), {'boom': 3.0}, STAMP)[0])
    assert (list(state.name), list(state.effort), list(state.position)) == ([joint], [-6.0], [])
    assert state.header.stamp.sec * 10**9 + state.header.stamp.nanosec == STAMP


def test_a_number_in_units_of_the_command():
    output = {'topic': '/valve', 'type': 'std_msgs/msg/Float64', 'gain': 1e-3}
    assert read(commands(parsed(EXCAVATOR, output=output), {'boom': 3.0}, STAMP)[0]).data == pytest.approx(3e-3)


def test_two_actuators_never_write_the_same_place():
    output = {'topic': '/effort', 'type': 'std_msgs/msg/Float64MultiArray', 'index': 1}
    with pytest.raises(ValueError, match='arm and boom have the same place'):
        check_outputs(parsed(EXCAVATOR, output=output))
    with pytest.raises(ValueError, match='another type'):
        check_outputs(parsed(EXCAVATOR, output={'topic': '/effort', 'type': 'std_msgs/msg/Float64'}))
