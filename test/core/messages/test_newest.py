"""The newest messages of several topics as one: the middleware reads them alike, and damage is a `ValueError`."""

from contextlib import suppress

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rclpy.serialization import deserialize_message, serialize_message
from std_msgs.msg import UInt8MultiArray

from seal_friction_ros.core.messages.together import TopicMessage, decode_newest, encode_newest

NAMES = st.text('abc_/é', min_size=0, max_size=12)
MESSAGES = st.lists(st.builds(TopicMessage, NAMES, NAMES, st.binary(max_size=40)), max_size=6)


@given(MESSAGES)
def test_what_goes_in_comes_out_and_the_middleware_reads_the_same(messages):
    data = encode_newest(messages)
    assert decode_newest(data) == messages
    read = deserialize_message(data, UInt8MultiArray)
    assert [one.label for one in read.layout.dim] == [f'{topic} {kind}' for topic, kind, _ in messages]
    assert [one.size for one in read.layout.dim] == [len(message.data) for message in messages]
    assert bytes(read.data) == b''.join(message.data for message in messages)


@given(MESSAGES, st.data())
def test_damaged_bytes_give_messages_or_a_value_error(messages, draw):
    data = bytearray(encode_newest(messages))
    del data[draw.draw(st.integers(0, len(data))) :]
    for place in draw.draw(st.lists(st.integers(0, max(len(data) - 1, 0)), max_size=3)):
        if data:
            data[place] ^= 0x55
    with suppress(ValueError):
        decode_newest(bytes(data))


def test_an_array_of_somebody_else_is_refused():
    with pytest.raises(ValueError, match=r'are no std_msgs/msg/UInt8MultiArray of'):
        decode_newest(serialize_message(UInt8MultiArray(data=b'12')))
