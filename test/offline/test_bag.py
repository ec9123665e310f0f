"""Bags: what we write opens elsewhere, what is damaged is said in one line."""

import shutil
from pathlib import Path

import pytest
import yaml
from example_bags import write_inputs
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader

from seal_friction_ros.core import wire
from seal_friction_ros.offline.bag import (
    BagError,
    BagWriter,
    bag_topics,
    message_definition,
    read_messages,
)
from seal_friction_ros.offline.replay import replay

MESSAGES = Path(__file__).parents[2] / 'msg_defs' / 'msg'


@pytest.fixture
def recorded(tmp_path: Path) -> Path:
    replay(write_inputs(tmp_path / 'inputs'), out=tmp_path / 'recorded')
    return tmp_path / 'recorded'


def test_rosbags_decodes_every_message_with_nothing_but_the_bag(recorded: Path):
    ours = list(read_messages(recorded))
    with AnyReader([recorded]) as reader:
        theirs = [(c, reader.deserialize(data, c.msgtype)) for c, _, data in reader.messages()]
    assert len(ours) == len(theirs) > 1000
    for message, (connection, decoded) in zip(ours, theirs, strict=True):
        assert message.topic == connection.topic
        record = wire.DECODERS[message.type_name](message.data)
        if message.type_name == wire.CONFIGURATION_TYPE:
            assert decoded.json == record
            continue
        stamp = decoded.header.stamp.sec * 10**9 + decoded.header.stamp.nanosec
        assert record.stamp == stamp
        numbers = {name: value for name, value in record._asdict().items() if name not in ('stamp', 'frame_id')}
        assert {name: repr(float(getattr(decoded, name))) for name in numbers} == {
            name: repr(float(value)) for name, value in numbers.items()
        }


def test_the_mcap_reader_decodes_every_message_with_nothing_but_the_file(recorded: Path):
    with next(recorded.glob('*.mcap')).open('rb') as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        assert reader.get_header().profile == 'ros2'
        decoded = [(channel.topic, message) for _, channel, _, message in reader.iter_decoded_messages()]
        summary = reader.get_summary()
    assert len(decoded) == len(list(read_messages(recorded)))
    assert {schema.encoding for schema in summary.schemas.values()} == {'ros2msg'}
    for channel in summary.channels.values():
        assert 'reliability: reliable' in channel.metadata['offered_qos_profiles']
    estimates = [message for topic, message in decoded if topic == '/friction_estimate']
    assert {estimate.header.frame_id for estimate in estimates} == {'rod'}


def test_metadata_names_the_file_topics_types_and_counts(recorded: Path):
    information = yaml.safe_load((recorded / 'metadata.yaml').read_text())['rosbag2_bagfile_information']
    assert information['storage_identifier'] == 'mcap'
    assert information['relative_file_paths'] == ['recorded_0.mcap']
    counts = {
        topic['topic_metadata']['name']: topic['message_count'] for topic in information['topics_with_message_count']
    }
    assert counts == {topic: info.message_count for topic, info in bag_topics(recorded).items()}
    assert information['message_count'] == sum(counts.values())


@pytest.mark.parametrize('path', sorted(MESSAGES.glob('*.msg')), ids=lambda path: path.stem)
def test_message_definitions_keep_the_comments_with_the_units(path: Path):
    text, type_hash = message_definition(f'seal_friction_msgs/msg/{path.stem}')
    assert text.startswith(path.read_text())
    assert type_hash.startswith('RIHS01_')


def test_messages_come_back_in_the_order_written_even_at_equal_times(tmp_path: Path):
    with BagWriter(tmp_path / 'bag') as writer:
        for topic in ('/z', '/a', '/m', '/z'):
            writer.write(topic, wire.CONFIGURATION_TYPE, 5, wire.encode_text(topic))
    messages = list(read_messages(tmp_path / 'bag'))
    assert [m.topic for m in messages] == ['/z', '/a', '/m', '/z']
    assert [m.log_time for m in messages] == [5, 6, 7, 8]


def test_a_bag_is_never_overwritten(tmp_path: Path):
    write_inputs(tmp_path / 'bag', 3)
    before = {p.name: p.read_bytes() for p in (tmp_path / 'bag').iterdir()}
    with pytest.raises(BagError, match='exists already: not overwriting'):
        BagWriter(tmp_path / 'bag')
    assert {p.name: p.read_bytes() for p in (tmp_path / 'bag').iterdir()} == before


def test_a_failure_while_writing_leaves_nothing_behind(tmp_path: Path):
    with pytest.raises(RuntimeError), BagWriter(tmp_path / 'bag'):
        raise RuntimeError
    assert list(tmp_path.iterdir()) == []


def test_a_bare_file_reads_like_its_bag(recorded: Path, tmp_path: Path):
    file = shutil.copy(next(recorded.glob('*.mcap')), tmp_path / 'bare.mcap')
    assert list(read_messages(Path(file))) == list(read_messages(recorded))
    assert bag_topics(Path(file)) == bag_topics(recorded)


@pytest.mark.parametrize('share', [0.0, 0.001, 0.1, 0.5, 0.9, 0.999])
@pytest.mark.parametrize('bare', [False, True])
def test_a_truncated_bag_is_said_in_one_line(recorded: Path, share: float, bare: bool):
    file = next(recorded.glob('*.mcap'))
    file.write_bytes(file.read_bytes()[: int(file.stat().st_size * share)])
    with pytest.raises(BagError) as error:
        list(read_messages(file if bare else recorded))
    assert '\n' not in str(error.value)
    assert str(recorded) in str(error.value)


@pytest.mark.parametrize('content', [b'', b'\x00' * 100, b'rosbag2_bagfile_information: {version: 9}', b'[1, 2'])
def test_bad_metadata_is_said_in_one_line(recorded: Path, content: bytes):
    (recorded / 'metadata.yaml').write_bytes(content)
    with pytest.raises(BagError) as error:
        list(read_messages(recorded))
    assert '\n' not in str(error.value)


def test_what_is_no_bag_is_said_in_one_line(tmp_path: Path):
    (tmp_path / 'text').write_text('no bag')
    for path in (tmp_path, tmp_path / 'text', tmp_path / 'absent'):
        with pytest.raises(BagError) as error:
            list(read_messages(path))
        assert '\n' not in str(error.value)
        assert str(path) in str(error.value)
