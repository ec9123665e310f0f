"""Numbers by the names of fields, against the serialisers of rclpy and of rosbags."""

import importlib
import math
import struct

import numpy as np
import pytest
from harness.foreign_messages import CONTROL_MSGS, foreign_store
from hypothesis import given, settings
from hypothesis import strategies as st
from rclpy.serialization import serialize_message

from seal_friction_ros.core.machine.message_fields import (
    LARGEST_MESSAGE,
    Reader,
    definition_of_class,
    number_paths,
    parse_definition,
)
from seal_friction_ros.offline.bags.bag import message_definition

INSTALLED = (
    'seal_friction_msgs/msg/RodVelocity',
    'seal_friction_msgs/msg/FrictionEstimate',
    'sensor_msgs/msg/JointState',
    'sensor_msgs/msg/FluidPressure',
    'sensor_msgs/msg/Imu',
    'sensor_msgs/msg/MultiDOFJointState',
    'geometry_msgs/msg/WrenchStamped',
    'std_msgs/msg/Float64',
    'std_msgs/msg/Float32',
    'std_msgs/msg/Float64MultiArray',
    'std_msgs/msg/UInt8MultiArray',
    'std_msgs/msg/Empty',
    'trajectory_msgs/msg/JointTrajectoryPoint',
    'trajectory_msgs/msg/JointTrajectory',
    'diagnostic_msgs/msg/DiagnosticArray',
)
JOINT_STATE = 'sensor_msgs/msg/JointState'
NAMES = st.text('abcdefgh_', min_size=1, max_size=9)
FLOATS = st.floats(allow_nan=False)


def message_class(type_name: str):
    package, _, name = type_name.replace('/msg/', '/').partition('/')
    return getattr(importlib.import_module(f'{package}.msg'), name)


def of_class(type_name: str):
    return definition_of_class(type_name, lambda kind: message_class(kind).get_fields_and_field_types())


def reader_of(type_name: str, *paths: str) -> Reader:
    return Reader(of_class(type_name), type_name, paths)


def random_message(draw, type_name: str):
    """A message with random numbers, texts and lengths."""
    message = message_class(type_name)()
    for name, field in message.get_fields_and_field_types().items():
        if field.startswith('sequence<'):
            kind = field.removeprefix('sequence<').rstrip('>').partition(',')[0]
            setattr(message, name, [random_value(draw, kind) for _ in range(draw(st.integers(0, 4)))])
        elif field.endswith(']'):
            kind, _, count = field[:-1].partition('[')
            setattr(message, name, np.array([random_value(draw, kind) for _ in range(int(count))]))
        else:
            setattr(message, name, random_value(draw, field))
    return message


def random_value(draw, kind: str):
    if '/' in kind:
        return random_message(draw, kind)
    if kind == 'string':
        return draw(st.text(max_size=9).filter(lambda text: '\0' not in text))
    if kind == 'boolean':
        return draw(st.booleans())
    if kind in ('float', 'double'):
        return draw(st.floats(allow_nan=False, width=32 if kind == 'float' else 64))
    if kind == 'octet':
        return bytes([draw(st.integers(0, 255))])
    bits, signed = int(kind.strip('uint')), not kind.startswith('u')
    if bits == 32 and not signed:
        return draw(st.integers(0, 999_999_999))  # nanoseconds of a stamp, too
    return draw(st.integers(-(2 ** (bits - 1)), 2 ** (bits - 1) - 1) if signed else st.integers(0, 2**bits - 1))


def numbers_of(message, above: str = ''):
    """Path and value of every number of a message."""
    for name, field in message.get_fields_and_field_types().items():
        value, path = getattr(message, name), above + name
        if field == 'std_msgs/Header' and not above:
            continue
        elements = [(path, value)]
        if field.startswith('sequence<') or field.endswith(']'):
            elements = [(f'{path}[{i}]', element) for i, element in enumerate(value)]
        for place, element in elements:
            if hasattr(element, 'get_fields_and_field_types'):
                yield from numbers_of(element, f'{place}.')
            elif not isinstance(element, str):
                yield place, element[0] if isinstance(element, bytes) else element


@pytest.mark.parametrize('type_name', INSTALLED)
@settings(max_examples=20)
@given(st.data())
def test_every_number_of_every_type_is_the_one_that_rclpy_wrote(type_name, data):
    definition = of_class(type_name)
    reader = None
    for _ in range(3):  # the places of the first message are not those of the next
        message = random_message(data.draw, type_name)
        expected = dict(numbers_of(message))
        reader = Reader(definition, type_name, list(expected)) if reader is None else reader
        read = reader.read(serialize_message(message))
        for path, number in zip([p.text for p in reader._paths], read.numbers, strict=True):
            assert number == expected.get(path)
        if hasattr(message, 'header'):
            stamp = message.header.stamp
            assert (read.stamp or 0) == stamp.sec * 1_000_000_000 + stamp.nanosec
            assert read.frame_id == message.header.frame_id.encode()


@pytest.mark.parametrize('type_name', INSTALLED)
def test_the_text_in_a_bag_and_the_installed_class_define_the_same_message(type_name):
    text, _ = message_definition(type_name)
    assert dict(parse_definition(type_name, text)) == dict(of_class(type_name))


@given(st.lists(NAMES, min_size=1, max_size=6, unique=True), st.data())
def test_a_joint_is_found_by_its_name_in_whatever_order_the_joints_come(names, data):
    positions = {name: data.draw(FLOATS) for name in names}
    reader = reader_of(JOINT_STATE, *(f'position[{name}]' for name in names))
    for _ in range(3):
        order = data.draw(st.permutations(names))
        message = message_class(JOINT_STATE)(name=order, position=[positions[name] for name in order])
        assert reader.read(serialize_message(message)).numbers == tuple(positions.values())


def test_two_joints_with_names_of_one_length_may_change_places():
    reader = reader_of(JOINT_STATE, 'position[joint_1]')
    make = message_class(JOINT_STATE)
    for names, expected in ((['joint_1', 'joint_2'], 1.0), (['joint_2', 'joint_1'], 2.0)):
        data = serialize_message(make(name=names, position=[1.0, 2.0]))
        assert reader.read(data).numbers == (expected,)


def test_what_a_message_lacks_is_none_and_is_said():
    reader = reader_of(JOINT_STATE, 'position[bom]', 'effort[boom]', 'position[arm]')
    message = message_class(JOINT_STATE)(name=['boom', 'arm'], position=[1.0, math.nan])
    read = reader.read(serialize_message(message))
    assert read.numbers[:2] == (None, None)
    assert math.isnan(read.numbers[2])  # a number that is not one is something else than no number
    assert read.missing == (
        "no 'bom' in name: it has boom, arm; did you mean boom?",
        'effort[boom]: effort has 0 elements',
    )


def test_a_stamp_that_nobody_filled_in_is_none():
    reader = reader_of('geometry_msgs/msg/WrenchStamped', 'wrench.force.z')
    message = message_class('geometry_msgs/msg/WrenchStamped')()
    message.wrench.force.z = -3.5
    assert reader.read(serialize_message(message))[:3] == (None, b'', (-3.5,))


@pytest.mark.parametrize(
    ('type_name', 'path', 'error'),
    [
        (JOINT_STATE, 'posiition[boom]', 'it has header, name, position, velocity, effort; did you mean position?'),
        (JOINT_STATE, 'position', 'position is a list'),
        (JOINT_STATE, 'name[0]', 'is a text and no number'),
        (JOINT_STATE, 'header', 'is no number: it has stamp, frame_id'),
        (JOINT_STATE, 'position[boom', 'is not a path of fields'),
        (JOINT_STATE, '', 'is not a path of fields'),
        ('geometry_msgs/msg/WrenchStamped', 'wrench.force', 'is no number: it has x, y, z'),
        ('geometry_msgs/msg/WrenchStamped', 'wrench.force.z[0]', 'is no list'),
        ('std_msgs/msg/Float64MultiArray', 'data[boom]', 'choose it by number, as [0]'),
        ('sensor_msgs/msg/Imu', 'orientation_covariance[9]', 'has 9 elements, numbered from 0'),
    ],
)
def test_a_wrong_path_is_an_error_that_lists_what_there_is(type_name, path, error):
    with pytest.raises(ValueError, match=r'^[^\n]*$') as raised:
        reader_of(type_name, path)
    assert error in str(raised.value)


@given(st.binary(max_size=200))
def test_any_bytes_are_read_or_refused_in_one_line(data):
    reader = reader_of(JOINT_STATE, 'position[boom]')
    for prefix in (b'', b'\x00\x01\x00\x00'):
        try:
            reader.read(prefix + data)
        except ValueError as error:
            assert '\n' not in str(error)  # noqa: PT017  both outcomes are right


def test_no_message_that_was_cut_or_grew_is_read():
    store, kind = foreign_store(), 'std_msgs/msg/Header'
    header = store.types[kind](store.types['builtin_interfaces/msg/Time'](1, 2), 'base')
    numbers = (np.array([float(i), 2.0]) for i in range(3))
    whole = bytes(store.serialize_cdr(store.types[JOINT_STATE](header, ['boom', 'arm'], *numbers), JOINT_STATE))
    reader = reader_of(JOINT_STATE, 'position[boom]')
    assert reader.read(whole).numbers == (0.0,)
    for wrong in (*(whole[:length] for length in range(len(whole))), whole + bytes(8)):
        with pytest.raises(ValueError):
            reader.read(wrong)


def test_a_length_of_gigabytes_costs_nothing():
    names = struct.pack('<4siIIB3xI', b'\x00\x01\x00\x00', 0, 0, 1, 0, 0xFFFFFFFF)
    with pytest.raises(ValueError, match='elements'):
        reader_of(JOINT_STATE, 'position[boom]').read(names + bytes(100))
    with pytest.raises(ValueError, match='more than'):
        reader_of(JOINT_STATE, 'position[boom]').read(b'\x00\x01\x00\x00' + bytes(LARGEST_MESSAGE))


@pytest.mark.parametrize(
    ('text', 'error'),
    [
        ('float64 x\nOther y\n', 'lacks a/Other'),
        ('a/A again\n', 'contains itself'),
        ('wstring text\n', 'wstring'),
        ('?!\n', 'not a line'),
    ],
)
def test_a_definition_that_cannot_be_read_is_refused(text, error):
    with pytest.raises(ValueError, match=error):
        parse_definition('a/msg/A', text)


# -- what ros2_control publishes: its package is not installed, its definitions are enough ----------------------------


def test_the_state_of_a_trajectory_controller_is_read_by_joint():
    store = foreign_store()
    point = store.types['trajectory_msgs/msg/JointTrajectoryPoint']
    duration = store.types['builtin_interfaces/msg/Duration'](0, 0)

    def a_point(*velocities: float):
        empty = np.array([])
        return point(empty, np.array(velocities), empty, empty, duration)

    multi = store.types['trajectory_msgs/msg/MultiDOFJointTrajectoryPoint']([], [], [], duration)
    kind = 'control_msgs/msg/JointTrajectoryControllerState'
    message = store.types[kind](
        header=store.types['std_msgs/msg/Header'](store.types['builtin_interfaces/msg/Time'](7, 8), 'base'),
        joint_names=['boom', 'arm'], reference=a_point(0.1, 0.2), feedback=a_point(0.3, 0.4), error=a_point(),
        output=a_point(5.0), multi_dof_joint_names=['wheel'], multi_dof_reference=multi, multi_dof_feedback=multi,
        multi_dof_error=multi, multi_dof_output=multi, speed_scaling_factor=0.5,
    )  # fmt: skip
    paths = ['reference.velocities[arm]', 'feedback.velocities[boom]', 'output.velocities[arm]', 'speed_scaling_factor']
    reader = Reader(parse_definition(kind, CONTROL_MSGS[kind]), kind, paths)
    read = reader.read(bytes(store.serialize_cdr(message, kind)))
    assert read.numbers == (0.2, 0.3, None, 0.5)
    assert read.stamp == 7_000_000_008


def test_the_interfaces_of_a_joint_state_broadcaster_are_read_by_joint_and_interface():
    store = foreign_store()
    value = store.types['control_msgs/msg/InterfaceValue']
    kind = 'control_msgs/msg/DynamicJointState'
    message = store.types[kind](
        header=store.types['std_msgs/msg/Header'](store.types['builtin_interfaces/msg/Time'](7, 8), ''),
        joint_names=['boom', 'arm'],
        interface_values=[
            value(['position', 'velocity'], np.array([1.0, 2.0])),
            value(['velocity', 'pressure_a'], np.array([3.0, 4.0])),
        ],
    )
    paths = ['interface_values[arm].values[pressure_a]', 'interface_values[boom].values[velocity]']
    reader = Reader(parse_definition(kind, CONTROL_MSGS[kind]), kind, paths)
    assert reader.read(bytes(store.serialize_cdr(message, kind))).numbers == (4.0, 2.0)


def test_a_chained_controller_is_read_by_the_name_of_its_joint():
    store = foreign_store()
    kind = 'control_msgs/msg/MultiDOFStateStamped'
    state = store.types['control_msgs/msg/SingleDOFState']
    message = store.types[kind](
        header=store.types['std_msgs/msg/Header'](store.types['builtin_interfaces/msg/Time'](7, 8), ''),
        dof_states=[state(name, *(float(i + k) for k in range(7))) for i, name in enumerate(('boom', 'arm'))],
    )
    reader = Reader(parse_definition(kind, CONTROL_MSGS[kind]), kind, ['dof_states[arm].feedback_dot'])
    assert reader.read(bytes(store.serialize_cdr(message, kind))).numbers == (3.0,)


def test_the_paths_of_all_numbers_are_listed():
    assert 'wrench.force.z' in number_paths(
        of_class('geometry_msgs/msg/WrenchStamped'), 'geometry_msgs/msg/WrenchStamped'
    )
    assert 'velocity[]' in number_paths(of_class(JOINT_STATE), JOINT_STATE)
