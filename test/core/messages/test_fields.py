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

from seal_friction_ros.core.foundation.documents import DEEPEST
from seal_friction_ros.core.messages.definitions import Field, full_name, number_paths, parse_definition, short_name
from seal_friction_ros.core.messages.fields import LARGEST_MESSAGE, Reader, names_in
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


def installed(type_name: str):
    return parse_definition(type_name, message_definition(type_name)[0])


def reader_of(type_name: str, *paths: str) -> Reader:
    return Reader(installed(type_name), type_name, paths)


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
    definition = installed(type_name)
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
        "no 'bom' in name: it has arm, boom; did you mean boom?",
        'effort[boom]: effort has 0 elements',
    )


@pytest.mark.parametrize('names', [['boom', 'arm', 'boom'], ['boom', 'boom', 'arm']])
def test_a_joint_that_is_named_twice_is_ambiguous_and_no_number_is_guessed(names: list[str]):
    reader = reader_of(JOINT_STATE, 'position[boom]', 'position[arm]')
    message = message_class(JOINT_STATE)(name=names, position=[1.0, 2.0, 3.0])
    read = reader.read(serialize_message(message))
    assert read.numbers == (None, message.position[names.index('arm')])
    assert read.missing == ("'boom' stands 2 times in name: ambiguous, none is taken",)


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


def nested(levels: int, fields: int) -> str:
    """Text of a definition with so many levels, each with so many fields of the next one."""
    parts = [''.join(f'a/L{level + 1} f{field}\n' for field in range(fields)) for level in range(1, levels)]
    return ''.join(f'{part}{"=" * 80}\nMSG: a/L{level}\n' for level, part in enumerate(parts, 2)) + 'float64 x\n'


@pytest.mark.parametrize('fields', [1, 2])
def test_a_definition_of_too_many_levels_is_refused_at_once(fields: int):
    """A bag may hold any; walking through each of 2 to the 40 paths would take days, and 3000 levels end Python."""
    assert len(parse_definition('a/msg/A', nested(DEEPEST, fields))) == DEEPEST
    for levels in (DEEPEST + 1, 3000):
        with pytest.raises(ValueError, match=f'^a/A: more than {DEEPEST} levels deep$'):
            parse_definition('a/msg/A', nested(levels, fields))


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
        installed('geometry_msgs/msg/WrenchStamped'), 'geometry_msgs/msg/WrenchStamped'
    )
    assert 'velocity[]' in number_paths(installed(JOINT_STATE), JOINT_STATE)


# -- definitions and paths, by hand -----------------------------------------------------------------------------------

TEXT = """
# a comment
uint8 OPEN=1            # a constant is no field
string GREETING = "hi"
std_msgs/Header header
float64[3] fixed
float32[<=4] bounded
string<=9[] names       # bounded texts
Part[] parts
float64 speed 1.5       # a default value
byte flag
================================================================================
MSG: a/Part
string name
int16 size
================================================================================
MSG: std_msgs/Header
time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""


def test_a_definition_has_fields_of_every_form_and_no_constants():
    definition = parse_definition('a/msg/A', TEXT)
    assert definition['a/A'] == (
        Field('header', 'std_msgs/Header'),
        Field('fixed', 'float64', 'array', 3),
        Field('bounded', 'float32', 'sequence'),
        Field('names', 'string', 'sequence'),
        Field('parts', 'a/Part', 'sequence'),
        Field('speed', 'float64'),
        Field('flag', 'uint8'),
    )
    assert definition['a/Part'] == (Field('name', 'string'), Field('size', 'int16'))
    assert definition['std_msgs/Header'] == (Field('stamp', 'builtin_interfaces/Time'), Field('frame_id', 'string'))


def test_the_number_paths_of_a_definition_have_brackets_after_lists():
    assert number_paths(parse_definition('a/msg/A', TEXT), 'a/msg/A') == [
        'header.stamp.sec', 'header.stamp.nanosec', 'fixed[]', 'bounded[]', 'parts[].size', 'speed', 'flag',
    ]  # fmt: skip


def test_a_message_without_fields_is_one_byte():
    assert parse_definition('a/msg/Empty', '\n# nothing\n') == {
        'a/Empty': (Field('structure_needs_at_least_one_member', 'uint8'),)
    }


def test_a_type_has_a_short_and_a_full_name():
    assert short_name('a/msg/B') == short_name('a/B') == 'a/B'
    assert full_name('a/msg/B') == full_name('a/B') == 'a/msg/B'


LISTS = 'string[] others\nstring[] joint_names\nstring[] name\nfloat64[] values\nfloat64[2] pair\n'


def test_of_several_lists_of_names_the_usual_one_counts_and_of_one_that_one():
    with_both = parse_definition('a/A', LISTS)
    assert Reader(with_both, 'a/A', ['values[x]'])._paths[0].steps[0].names == 'name'
    without = parse_definition('a/A', LISTS.replace('string[] name\n', ''))
    assert Reader(without, 'a/A', ['values[x]'])._paths[0].steps[0].names == 'joint_names'
    one = parse_definition('a/A', 'string[] others\nfloat64[] values\n')
    assert Reader(one, 'a/A', ['values[x]'])._paths[0].steps[0].names == 'others'
    two = parse_definition('a/A', 'string[] others\nstring[] more\nfloat64[] values\n')
    with pytest.raises(ValueError, match=r"no list of names tells which element 'x' is: choose it by number, as \[0\]"):
        Reader(two, 'a/A', ['values[x]'])


@pytest.mark.parametrize('number', [0, 1])
def test_an_array_has_its_elements_and_no_more(number):
    definition = parse_definition('a/A', LISTS)
    assert Reader(definition, 'a/A', [f'pair[{number}]'])
    with pytest.raises(ValueError, match='pair has 2 elements, numbered from 0'):
        Reader(definition, 'a/A', [f'pair[{number + 2}]'])


@pytest.mark.parametrize('path', ['values[0].', '.values[0]', 'values[0]x', 'values[]', 'values[0][1]', 'values[0] '])
def test_a_path_is_names_with_dots_between_them(path):
    with pytest.raises(ValueError, match='is not a path of fields'):
        Reader(parse_definition('a/A', LISTS), 'a/A', [path])


# -- limits -----------------------------------------------------------------------------------------------------------


def wrench(frame: str, nanoseconds: int = 5) -> bytes:
    message = message_class('geometry_msgs/msg/WrenchStamped')()
    message.header.frame_id, message.header.stamp.nanosec = frame, nanoseconds
    return serialize_message(message)


def test_a_frame_name_has_1023_letters_and_its_end_at_most():
    reader = reader_of('geometry_msgs/msg/WrenchStamped', 'wrench.force.z')
    assert reader.read(wrench('x' * 1023)).frame_id == b'x' * 1023
    with pytest.raises(ValueError, match='geometry_msgs/WrenchStamped: a frame name of 1025 bytes is not valid'):
        reader.read(wrench('x' * 1024))


def test_a_stamp_has_less_than_a_second_of_nanoseconds():
    reader = reader_of('geometry_msgs/msg/WrenchStamped', 'wrench.force.z')
    assert reader.read(wrench('', 999_999_999)).stamp == 999_999_999
    with pytest.raises(ValueError, match='a stamp with 1000000000 ns is not valid'):
        reader.read(wrench('', 10**9))


def test_a_message_has_256_kibibytes_at_most():
    reader = reader_of('std_msgs/msg/UInt8MultiArray', 'data[0]')
    make = message_class('std_msgs/msg/UInt8MultiArray')
    head = len(serialize_message(make()))
    whole = serialize_message(make(data=bytes(range(1, 9)) * ((LARGEST_MESSAGE - head) // 8)))
    assert 2**18 - 16 < len(whole) <= 2**18 == LARGEST_MESSAGE
    assert reader.read(whole).numbers == (1,)
    with pytest.raises(ValueError, match=f'{len(whole) + 17} bytes, more than 262144'):
        reader.read(whole + bytes(17))


def test_lengths_that_change_all_the_time_take_no_more_memory():
    reader, make = reader_of(JOINT_STATE, 'position[b]'), message_class(JOINT_STATE)
    for count in range(1, 60):
        names = ['b', *(f'a{i}' for i in range(count))]
        assert reader.read(serialize_message(make(name=names, position=[float(count)] * len(names)))).numbers == (
            count,
        )
        assert len(reader._layouts) <= 16


def test_twenty_names_are_shown_of_a_message_that_has_not_the_one_that_is_wanted():
    make = message_class(JOINT_STATE)
    for count, shown in (
        (0, 'none'),
        (20, ', '.join(f'j{i:02}' for i in range(20))),
        (21, ', '.join(f'j{i:02}' for i in range(20))),
    ):
        names = [f'j{i:02}' for i in reversed(range(count))]  # shown sorted: any order of them is one text
        read = reader_of(JOINT_STATE, 'position[zzzz]').read(
            serialize_message(make(name=names, position=[0.0] * count))
        )
        assert read.missing == (f"no 'zzzz' in name: it has {shown}",)


def test_numbers_that_are_missing_leave_the_others_in_their_places():
    reader = reader_of(JOINT_STATE, 'velocity[b]', 'position[x]', 'position[a]', 'effort[a]')
    data = serialize_message(message_class(JOINT_STATE)(name=['a', 'b'], position=[1.0, 2.0], velocity=[3.0, 4.0]))
    assert reader.read(data).numbers == (4.0, None, 1.0, None)
    assert len(reader.read(data).missing) == 2


def test_the_names_of_the_elements_of_a_message_are_found():
    joints = serialize_message(message_class(JOINT_STATE)(name=['a', 'boom'], position=[1.0, 2.0]))
    assert names_in(installed(JOINT_STATE), JOINT_STATE, joints) == ['a', 'boom']
    kind = 'std_msgs/msg/Float64MultiArray'
    assert names_in(installed(kind), kind, serialize_message(message_class(kind)(data=[1.0]))) == []


@pytest.mark.parametrize(('surplus', 'is_read'), [(0, True), (3, True), (4, False)])
def test_padding_to_a_multiple_of_four_may_follow(surplus, is_read):
    reader = reader_of('std_msgs/msg/Float64', 'data')
    data = struct.pack('<4sd', b'\x00\x01\x00\x00', 2.5) + bytes(surplus)
    if is_read:
        assert reader.read(data) == (None, b'', (2.5,), ())
    else:
        with pytest.raises(ValueError, match='std_msgs/Float64: 16 bytes where the message has 12'):
            reader.read(data)


@pytest.mark.parametrize('head', [b'\x00\x00\x00\x00', b'\x00\x03\x00\x00', b'\x01\x01\x00\x00'])
def test_another_encapsulation_is_refused(head):
    with pytest.raises(ValueError, match=f'encapsulation {head.hex()} is not little-endian CDR'):
        reader_of('std_msgs/msg/Float64', 'data').read(head + bytes(8))
