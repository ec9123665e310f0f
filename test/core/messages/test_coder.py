"""Bytes of the messages: the same as rosbags writes and rclpy reads, for every frame name; nothing else is taken."""

import re
import struct

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from paths import ROOT
from rclpy.serialization import deserialize_message, serialize_message
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosgraph_msgs.msg import Clock as ClockMessage
from seal_friction_msgs import msg as messages

from seal_friction_ros.core.friction.states import FrictionState
from seal_friction_ros.core.messages import coder, layouts
from seal_friction_ros.core.messages.records import (
    Clock,
    FeedForward,
    Force,
    FrictionEstimate,
    Limited,
    Position,
    Pressure,
    ServoReference,
    Status,
    Temperature,
    Velocity,
    WatchdogTick,
)
from seal_friction_ros.nodes.managed_node import message_class

DEFINITIONS = ROOT / 'msg_defs' / 'msg'
STAMP = 1_700_000_000_123_456_789  # [ns]
ESTIMATE = FrictionEstimate(STAMP, 40.5, 3.25, 45.75, -40.5, FrictionState.SLIDING, -1, 1028, 0.125)
# Type -> values, and how to encode them.
SAMPLES = {
    layouts.PRESSURE_TYPE: ({'chamber_a': 3.5e6, 'chamber_b': -1e4}, Pressure(STAMP, 3.5e6, -1e4), coder.encode),
    layouts.FORCE_TYPE: ({'force': -12.5}, Force(STAMP, -12.5), coder.encode),
    layouts.VELOCITY_TYPE: (
        {'velocity': 0.0625},
        Velocity(STAMP, 0.0625, b''),
        lambda record, frame: coder.encode(record._replace(frame_id=frame)),
    ),
    layouts.POSITION_TYPE: ({'position': -0.0125}, Position(STAMP, -0.0125), coder.encode),
    layouts.REFERENCE_TYPE: (
        {'position': 0.01, 'velocity': -0.02, 'acceleration': 0.3},
        ServoReference(STAMP, 0.01, -0.02, 0.3),
        lambda record, frame: coder.encode(record._replace(frame_id=frame)),
    ),
    layouts.TEMPERATURE_TYPE: (
        {'temperature': 41.5, 'variance': 0.25},
        Temperature(STAMP, 41.5, 0.25),
        coder.encode,
    ),
    layouts.TICK_TYPE: (
        {'idle_time': 0.25},
        WatchdogTick(STAMP, 0.25),
        lambda record, frame: coder.encode(record._replace(frame_id=frame)),
    ),
    layouts.FEEDFORWARD_TYPE: (
        {'force': -33.5, 'scale': 0.75, 'limited': 5},
        FeedForward(STAMP, -33.5, 0.75, 5),
        coder.encode,
    ),
    layouts.ESTIMATE_TYPE: (
        {
            name: int(value) if name == 'state' else value
            for name, value in ESTIMATE._asdict().items()
            if name != 'stamp'
        },
        ESTIMATE,
        coder.encode,
    ),
}
STAMPED = pytest.mark.parametrize('type_name', SAMPLES)
FRAMES = [b'abcdefghijklmnopqrstuvwxyz0123456789_/-.'[:length] for length in range(41)]


def clock(nanoseconds: int) -> bytes:
    """A message of simulated time as rclpy writes it."""
    message = ClockMessage()
    message.clock.sec, message.clock.nanosec = divmod(nanoseconds, 10**9)
    return serialize_message(message)


UNSTAMPED = {layouts.CONFIGURATION_TYPE: (str, coder.encode_text('text')), layouts.CLOCK_TYPE: (Clock, clock(STAMP))}
"""Type without a header -> what its decoder makes, and a message."""


def make_store():
    store = get_typestore(Stores.ROS2_JAZZY)
    for path in sorted(DEFINITIONS.glob('*.msg')):
        store.register(get_types_from_msg(path.read_text(), f'{layouts.PACKAGE}/msg/{path.stem}'))
    return store


STORE = make_store()


def as_rosbags(type_name: str, frame: bytes):
    time = STORE.types['builtin_interfaces/msg/Time'](*divmod(STAMP, 10**9))
    header = STORE.types['std_msgs/msg/Header'](time, frame.decode())
    return STORE.types[type_name](header=header, **SAMPLES[type_name][0])


def as_rclpy(type_name: str, frame: bytes):
    message = message_class(type_name)(**SAMPLES[type_name][0])
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(STAMP, 10**9)
    message.header.frame_id = frame.decode()
    return message


def encode(type_name: str, frame: bytes = b'') -> bytes:
    _, record, encoder = SAMPLES[type_name]
    return encoder(record, frame)


def decoded(type_name: str, frame: bytes):
    record = SAMPLES[type_name][1]
    with_frame = (layouts.VELOCITY_TYPE, layouts.REFERENCE_TYPE, layouts.TICK_TYPE)
    return record._replace(frame_id=frame) if type_name in with_frame else record


# --- the same bytes as others ---


@STAMPED
def test_bytes_are_those_of_rosbags_for_every_frame_name_length(type_name):
    for frame in FRAMES:
        assert encode(type_name, frame) == bytes(STORE.serialize_cdr(as_rosbags(type_name, frame), type_name))


@STAMPED
def test_rclpy_reads_what_is_written_for_every_frame_name_length(type_name):
    for frame in FRAMES:
        expected = as_rclpy(type_name, frame)
        assert deserialize_message(encode(type_name, frame), type(expected)) == expected


@STAMPED
def test_what_rclpy_writes_is_read_for_every_frame_name_length(type_name):
    for frame in FRAMES:
        data = serialize_message(as_rclpy(type_name, frame))
        assert coder.DECODERS[type_name](data) == decoded(type_name, frame)


@STAMPED
def test_decoding_undoes_encoding_for_every_frame_name_length(type_name):
    for frame in FRAMES:
        assert coder.DECODERS[type_name](encode(type_name, frame)) == decoded(type_name, frame)


@STAMPED
def test_padding_is_zero(type_name):
    # With a 1 in every byte of name and numbers, zeros are left only where nothing is.
    ones = struct.unpack('<d', b'\x01' * 8)[0]
    stamp = 0x01010101 * 10**9 + 0x01010101
    records = {
        layouts.PRESSURE_TYPE: Pressure(stamp, ones, ones),
        layouts.FORCE_TYPE: Force(stamp, ones),
        layouts.VELOCITY_TYPE: Velocity(stamp, ones, b''),
        layouts.POSITION_TYPE: Position(stamp, ones),
        layouts.REFERENCE_TYPE: ServoReference(stamp, ones, ones, ones),
        layouts.TEMPERATURE_TYPE: Temperature(stamp, ones, ones),
        layouts.TICK_TYPE: WatchdogTick(stamp, ones),
        layouts.FEEDFORWARD_TYPE: FeedForward(stamp, ones, ones, 0x01010101),
        layouts.ESTIMATE_TYPE: FrictionEstimate(stamp, *[ones] * 4, FrictionState.SLIDING, 1, 0x01010101, *[ones] * 6),
    }
    for length in range(41):
        data = SAMPLES[type_name][2](records[type_name], b'\x01' * length)
        end_of_name = 16 + length
        # Counted from the end of the encapsulation, the first number stands at a multiple of 8.
        body = 4 + -(-(end_of_name + 1 - 4) // 8) * 8
        assert data[16:end_of_name] == b'\x01' * length
        assert data[end_of_name:body] == bytes(body - end_of_name)
        holes = 2 if type_name == layouts.ESTIMATE_TYPE else 0
        assert data[body:].count(0) == holes


@STAMPED
@given(value=st.floats(), stamp=st.integers(-(2**31) * 10**9, 2**31 * 10**9 - 1), frame=st.binary(max_size=60))
def test_every_number_survives_nan_and_infinity_included(type_name, value, stamp, frame):
    _, record, encoder = SAMPLES[type_name]
    name = record._fields[1]
    back = coder.DECODERS[type_name](encoder(record._replace(stamp=stamp, **{name: value}), frame))
    assert back.stamp == stamp
    assert struct.pack('<d', getattr(back, name)) == struct.pack('<d', value)


@given(st.text(st.characters(exclude_categories=['Cs']), max_size=200))
@example('')
@example('{"source": "μ = c Fₙ⁻ⁿ"}')
def test_a_text_survives_and_is_what_rosbags_writes(text):
    data = coder.encode_text(text)
    assert coder.decode_text(data) == text
    message = STORE.types[layouts.CONFIGURATION_TYPE](text)
    assert data == bytes(STORE.serialize_cdr(message, layouts.CONFIGURATION_TYPE))


@pytest.mark.parametrize('text', ['', 'a', 'ab', 'abc', 'abcd', 'μ'])
def test_rclpy_and_we_read_each_others_texts(text):
    message = messages.EstimatorConfiguration(json=text)
    assert deserialize_message(coder.encode_text(text), messages.EstimatorConfiguration) == message
    assert coder.decode_text(serialize_message(message)) == text


@given(st.integers(-(2**31) * 10**9, 2**31 * 10**9 - 1))
@example(0)
@example(-1)
def test_simulated_time_is_what_rclpy_and_rosbags_write(nanoseconds):
    data = clock(nanoseconds)
    assert coder.decode_clock(data) == Clock(nanoseconds)
    time = STORE.types['builtin_interfaces/msg/Time'](*divmod(nanoseconds, 10**9))
    assert data == bytes(STORE.serialize_cdr(STORE.types[layouts.CLOCK_TYPE](time), layouts.CLOCK_TYPE))


# --- nothing else is taken ---


def decode_or_refuse(type_name: str, data: bytes):
    try:
        return coder.DECODERS[type_name](data)
    except ValueError:  # and nothing but a ValueError
        return None


@pytest.mark.parametrize('type_name', coder.DECODERS)
@given(data=st.binary(max_size=150))
def test_garbage_is_refused_with_a_value_error_or_is_the_record_of_its_type(type_name, data):
    if not data.startswith(b'\x00\x01'):
        assert decode_or_refuse(type_name, data) is None
    found = decode_or_refuse(type_name, b'\x00\x01\x00\x00' + data)
    record_type = type(SAMPLES[type_name][1]) if type_name in SAMPLES else UNSTAMPED[type_name][0]
    assert found is None or type(found) is record_type


@STAMPED
@given(position=st.integers(0, 10_000), byte=st.integers(0, 255), cut=st.integers(0, 100))
def test_a_damaged_message_is_refused_with_a_value_error_or_has_the_size_of_one(type_name, position, byte, cut):
    data = bytearray(encode(type_name, b'rod'))
    data[position % len(data)] = byte
    decode_or_refuse(type_name, bytes(data))
    shortened = bytes(data[: len(data) - cut])
    if decode_or_refuse(type_name, shortened) is not None:
        # A damaged name length may move the end within the padding, no further: of the message, or as it was.
        assert any(grown - 10 <= cut <= grown + 7 for grown in (0, *layouts.GROWN[type_name]))


@STAMPED
def test_every_truncation_is_refused(type_name):
    data = encode(type_name, b'rod')
    as_it_was = {len(data) - grown + padding for grown in layouts.GROWN[type_name] for padding in range(4)}
    for length in set(range(len(data))).difference(as_it_was):
        with pytest.raises(ValueError, match='bytes'):
            coder.DECODERS[type_name](data[:length])


START = 1_700_000_000_000_000_000  # [ns]


def test_an_estimate_from_before_the_adaptation_is_read_with_nothing_learnt():
    learnt = (1.2, 0.01, 5.0, -1.0, 3.0)
    estimate = FrictionEstimate(START, 40.0, 4.0, 45.0, 40.0, FrictionState.SLIDING, 1, 0, 0.001, *learnt)
    data = coder.encode(estimate, b'rod')
    assert coder.decode(layouts.ESTIMATE_TYPE, data[:-40]) == (*estimate[:9], 1.0, 0.0, 0.0, 0.0, -1.0)
    assert coder.decode(layouts.ESTIMATE_TYPE, data[:-8]) == (*estimate[:13], -1.0)


@STAMPED
@pytest.mark.parametrize(('surplus', 'taken'), [(0, True), (1, True), (3, True), (4, False), (100, False)])
def test_padding_to_a_multiple_of_four_is_taken_more_is_not(type_name, surplus, taken):
    data = encode(type_name, b'rod') + bytes(surplus)
    assert (decode_or_refuse(type_name, data) is not None) is taken


@STAMPED
def test_messages_of_other_types_are_refused(type_name):
    sizes = {name: len(encode(name)) for name in SAMPLES}
    for other in SAMPLES:
        if sizes[other] != sizes[type_name]:
            with pytest.raises(ValueError, match='bytes where the message has'):
                coder.DECODERS[type_name](encode(other))


@pytest.mark.parametrize('encapsulation', [b'\x00\x00', b'\x00\x03', b'\x00\x07', b'\x01\x00', b'\xff\xff'])
@pytest.mark.parametrize('type_name', coder.DECODERS)
def test_another_encapsulation_is_refused(type_name, encapsulation):
    data = encode(type_name) if type_name in SAMPLES else UNSTAMPED[type_name][1]
    with pytest.raises(ValueError, match='little-endian CDR'):
        coder.DECODERS[type_name](encapsulation + data[2:])


def test_a_time_that_is_none_is_refused():
    data = clock(STAMP)
    for length in range(len(data)):
        with pytest.raises(ValueError, match=f'^{length} bytes are not a time'):
            coder.decode_clock(data[:length])
    for surplus, taken in ((1, True), (3, True), (4, False), (100, False)):
        assert (decode_or_refuse(layouts.CLOCK_TYPE, data + bytes(surplus)) is not None) is taken
    with pytest.raises(ValueError, match='1000000000 ns is not valid'):
        coder.decode_clock(data[:8] + (10**9).to_bytes(4, 'little'))


@pytest.mark.parametrize('state', [4, 5, 255])
def test_a_friction_state_that_is_none_is_refused(state):
    data = bytearray(coder.encode(ESTIMATE))
    place = data.index(bytes([FrictionState.SLIDING, 255]))
    data[place] = state
    with pytest.raises(ValueError, match=f'{state} is not a valid FrictionState'):
        coder.decode(layouts.ESTIMATE_TYPE, bytes(data))


@pytest.mark.parametrize(('nanoseconds', 'length'), [(10**9, 1), (0, 1025), (0, 2**32 - 1)])
def test_an_invalid_header_is_refused(nanoseconds, length):
    data = struct.pack('<4siII', b'\x00\x01\x00\x00', 0, nanoseconds, length) + bytes(12)
    with pytest.raises(ValueError, match='is not valid'):
        coder.decode(layouts.FORCE_TYPE, data)


@pytest.mark.parametrize(
    'data',
    [
        b'',
        b'\x00\x01\x00\x00',
        b'\x00\x01\x00\x00\x00\x00\x00\x00\x00',  # no end of the text
        b'\x00\x01\x00\x00\x09\x00\x00\x00abc\x00',  # longer than the message
        b'\x00\x01\x00\x00\x03\x00\x00\x00\xff\xfe\x00',  # not UTF-8
    ],
)
def test_a_text_that_is_none_is_refused(data):
    with pytest.raises(ValueError):
        coder.decode_text(data)


# --- the message definition ---


def constants(kind: str, message: str = 'FrictionEstimate') -> dict[str, int]:
    text = (DEFINITIONS / f'{message}.msg').read_text()
    return {name: int(value) for name, value in re.findall(rf'^{kind}\s+([A-Z_]+)\s*=\s*(\d+)', text, re.MULTILINE)}


def test_states_in_the_message_definition_are_those_of_the_code():
    assert constants('uint8') == {state.name: state.value for state in FrictionState}


def test_status_bits_in_the_message_definition_are_those_of_the_code():
    assert constants('uint32') == {bit.name: bit.value for bit in Status}
    assert constants('uint32', 'FrictionFeedForward') == {bit.name: bit.value for bit in Limited}


def test_status_bits_are_different_powers_of_two():
    assert [bit.value for bit in Status] == [2**i for i in range(27)]


def test_the_generated_message_has_the_constants_of_the_code():
    for member in (*FrictionState, *Status):
        assert getattr(messages.FrictionEstimate, member.name) == member.value
    for bit in Limited:
        assert getattr(messages.FrictionFeedForward, bit.name) == bit.value


CODES = {'double': 'd', 'uint8': 'B', 'int8': 'b', 'uint32': 'I'}


@pytest.mark.parametrize('layout', layouts.LAYOUTS, ids=lambda layout: layout.record.__name__)
def test_the_table_of_layouts_is_that_of_the_generated_messages(layout):
    generated = message_class(layout.message_type).get_fields_and_field_types()
    kinds = dict(zip(layout.fields, layout.codes, strict=True))
    assert list(generated) == ['header', *layout.fields]
    assert {name: CODES[kind] for name, kind in generated.items() if name != 'header'} == kinds


def test_an_empty_frame_name_without_its_end_is_understood():
    data = struct.pack('<4siII4xd', b'\x00\x01\x00\x00', 3, 4, 0, 0.5)
    assert coder.decode(layouts.VELOCITY_TYPE, data) == Velocity(3_000_000_004, 0.5, b'')


@pytest.mark.parametrize('layout', layouts.LAYOUTS, ids=lambda layout: layout.message_type)
def test_every_number_of_a_message_is_aligned_to_its_size(layout):
    assert layout.offsets[0] == 0
    assert all(offset % struct.calcsize(code) == 0 for offset, code in zip(layout.offsets, layout.codes, strict=True))
