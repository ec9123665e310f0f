"""The answers of all actuators in one message have the bytes that any reader of ROS 2 takes."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rclpy.serialization import deserialize_message
from seal_friction_msgs.msg import MachineFriction

from seal_friction_ros.core.messages.layouts import LAYOUTS, SECOND
from seal_friction_ros.core.messages.records import FeedForward, FrictionEstimate
from seal_friction_ros.core.messages.together import NamedAnswer, decode_together, encode_together

NUMBERS = {
    'd': st.floats(allow_nan=False),
    'I': st.integers(0, 2**32 - 1),
    'B': st.integers(0, 255),
    'b': st.integers(-1, 1),
}
STAMPS = st.integers(0, 2**31 * SECOND - 1)
NAMES = st.text('abcdefghijk_', min_size=1, max_size=9)
FRAMES = st.binary(max_size=7).filter(lambda frame: 0 not in frame and frame.isascii())


def records(record):
    codes = next(layout.codes for layout in LAYOUTS if layout.record is record)
    return st.builds(record, STAMPS, *(NUMBERS[code] for code in codes))


ANSWERS = st.lists(
    st.builds(NamedAnswer, NAMES, records(FrictionEstimate) | records(FeedForward), FRAMES), min_size=1, max_size=8
)


def stamp_of(message):
    return message.header.stamp.sec * SECOND + message.header.stamp.nanosec


@given(ANSWERS)
def test_rclpy_reads_every_number_back(answers):
    found = deserialize_message(encode_together(answers), MachineFriction)
    for record, names, messages in (
        (FrictionEstimate, found.estimated, found.estimates),
        (FeedForward, found.fed_forward, found.feedforwards),
    ):
        wanted = [answer for answer in answers if type(answer.record) is record]
        assert list(names) == [answer.actuator for answer in wanted]
        for answer, message in zip(wanted, messages, strict=True):
            assert stamp_of(message) == answer.record.stamp
            assert message.header.frame_id.encode() == answer.frame_id
            fields = tuple(answer.record._fields)[1:]
            assert [getattr(message, field) for field in fields] == list(answer.record[1:])


@given(ANSWERS)
def test_decoding_gives_the_answers_back(answers):
    of_one_kind = sorted(answers, key=lambda answer: type(answer.record) is FeedForward)
    assert decode_together(encode_together(answers)) == of_one_kind


@given(ANSWERS, st.data())
def test_bytes_that_are_cut_or_changed_are_a_value_error_or_other_answers(answers, data):
    whole = encode_together(answers)
    with pytest.raises(ValueError, match=r'bytes|encapsulation|answers'):
        decode_together(whole[: data.draw(st.integers(0, len(whole) - 1))])
    place = data.draw(st.integers(0, len(whole) - 1))
    changed = whole[:place] + bytes([whole[place] ^ data.draw(st.integers(1, 255))]) + whole[place + 1 :]
    try:
        decode_together(changed)
    except ValueError as error:
        assert '\n' not in str(error)  # noqa: PT017  its text is what counts


@given(ANSWERS)
def test_the_message_has_the_stamp_of_its_first_answer_and_no_frame_name(answers):
    data = encode_together(answers)
    of_one_kind = sorted(answers, key=lambda answer: type(answer.record) is FeedForward)
    assert stamp_of(deserialize_message(data, MachineFriction)) == of_one_kind[0].record.stamp
    assert data[12:17] == b'\x01\x00\x00\x00\x00'  # the length of an empty text is that of its end


@pytest.mark.parametrize('head', [b'\x00\x00\x00\x00', b'\x01\x01\x00\x00', b'\x00\x03\x00\x00', b''])
def test_another_encapsulation_is_refused(head):
    with pytest.raises(ValueError, match=f'encapsulation {head.hex()} is not little-endian CDR'):
        decode_together(head + bytes(40) if head else b'')
