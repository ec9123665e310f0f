"""Bags: what we write opens elsewhere, what is damaged is said in one line."""

import os
import shutil
import stat
from io import BytesIO
from pathlib import Path
from typing import Any

import pytest
import yaml
from harness.example_bags import write_inputs, write_recorded
from mcap.reader import make_reader
from mcap.records import Channel, Chunk, Header, McapRecord, Message, Metadata, Schema
from mcap.stream_reader import StreamReader, breakup_chunk
from mcap.writer import CompressionType, Writer
from mcap_ros2.decoder import DecoderFactory
from paths import ROOT
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from seal_friction_ros.core.messages.coder import DECODERS, decode_text, encode_text
from seal_friction_ros.core.messages.layouts import CONFIGURATION_TYPE
from seal_friction_ros.offline.bags import definitions
from seal_friction_ros.offline.bags.bag import (
    BagError,
    BagWriter,
    bag_topics,
    read_messages,
)
from seal_friction_ros.offline.bags.definitions import message_definition
from seal_friction_ros.offline.bags.recover import recover
from seal_friction_ros.offline.replay.replay import replay

MESSAGES = ROOT / 'msg_defs' / 'msg'


@pytest.fixture
def recorded(tmp_path: Path) -> Path:
    return write_recorded(tmp_path)


def test_rosbags_decodes_every_message_with_nothing_but_the_bag(recorded: Path):
    ours = list(read_messages(recorded))
    with AnyReader([recorded]) as reader:
        theirs = [(c, reader.deserialize(data, c.msgtype)) for c, _, data in reader.messages()]
    assert len(ours) == len(theirs) > 1000
    for message, (connection, decoded) in zip(ours, theirs, strict=True):
        assert message.topic == connection.topic
        record = DECODERS[message.type_name](message.data)
        if message.type_name == CONFIGURATION_TYPE:
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
        (about,) = reader.iter_metadata()
    assert len(decoded) == len(list(read_messages(recorded)))
    counts = {
        channel.topic: summary.statistics.channel_message_counts[channel.id] for channel in summary.channels.values()
    }
    assert counts == {topic: info.message_count for topic, info in bag_topics(recorded).items()}
    assert all(index.message_index_offsets for index in summary.chunk_indexes)
    information = yaml.safe_load((recorded / 'metadata.yaml').read_text())['rosbag2_bagfile_information']
    assert (about.name, yaml.safe_load(about.metadata['serialized_metadata'])) == ('rosbag2', information)
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
    store = get_typestore(Stores.ROS2_JAZZY)
    for each in MESSAGES.glob('*.msg'):  # one may hold others
        store.register(get_types_from_msg(each.read_text(), f'seal_friction_msgs/msg/{each.stem}'))
    assert type_hash == store.hash_rihs01(f'seal_friction_msgs/msg/{path.stem}')
    separator = '=' * 80 + '\n'
    generated, _ = store.generate_msgdef(f'seal_friction_msgs/msg/{path.stem}', ros_version=2)
    ours = {part.split('\n')[0]: part for part in text.split(separator)[1:]}
    others = {part.split('\n')[0]: part for part in generated.split(separator)[1:]}
    assert ours.keys() == others.keys()
    foreign = [name for name in ours if 'seal_friction_msgs' not in name]  # those of this project have comments
    assert [ours[name] for name in foreign] == [others[name] for name in foreign]


def test_without_ros_the_definitions_of_our_messages_are_the_same_to_the_byte(monkeypatch):
    kinds = [*DECODERS, *(f'seal_friction_msgs/msg/{path.stem}' for path in MESSAGES.glob('*.msg'))]
    installed = {kind: message_definition(kind) for kind in kinds}
    monkeypatch.setattr(definitions, 'find_spec', lambda _: None)
    message_definition.cache_clear()
    assert {kind: message_definition(kind) for kind in kinds} == installed
    with pytest.raises(ValueError, match='a_msgs/msg/B is neither installed nor a type of ROS 2'):
        message_definition('a_msgs/msg/B')
    message_definition.cache_clear()


def test_a_file_is_byte_for_byte_that_of_the_writer_of_mcap(tmp_path: Path):
    with BagWriter(tmp_path / 'bag', custom_data={'by': 'us'}) as writer:
        for number in range(5000):
            name = 'ab'[number % 3 == 0]
            writer.write(f'/{name}', CONFIGURATION_TYPE, 7 + number, encode_text(name * (number % 50)), number)
    ours = (tmp_path / 'bag' / 'bag_0.mcap').read_bytes()
    assert ours == written_by_mcap(ours)


def written_by_mcap(data: bytes) -> bytes:
    """The same records by the writer of the ``mcap`` library, with a chunk where there was one."""
    theirs = BytesIO()
    writer = Writer(theirs, chunk_size=1 << 40, compression=CompressionType.NONE)
    for record in StreamReader(BytesIO(data), emit_chunks=True).records:
        if isinstance(record, Header):
            writer.start(record.profile, record.library)
        elif isinstance(record, Metadata):
            writer.add_metadata(record.name, record.metadata)
        elif isinstance(record, Chunk):
            for part in breakup_chunk(record):
                repeat(writer, part)
            writer.flush()
    writer.finish()
    return theirs.getvalue()


def repeat(writer: Writer, record: McapRecord) -> None:
    if isinstance(record, Schema):
        writer.register_schema(record.name, record.encoding, record.data)
    elif isinstance(record, Channel):
        writer.register_channel(record.topic, record.message_encoding, record.schema_id, record.metadata)
    elif isinstance(record, Message):
        writer.add_message(record.channel_id, record.log_time, record.data, record.publish_time)


def test_messages_come_back_in_the_order_written_even_at_equal_times(tmp_path: Path):
    with BagWriter(tmp_path / 'bag') as writer:
        for topic in ('/z', '/a', '/m', '/z'):
            writer.write(topic, CONFIGURATION_TYPE, 5, encode_text(topic))
    messages = list(read_messages(tmp_path / 'bag'))
    assert [m.topic for m in messages] == ['/z', '/a', '/m', '/z']
    assert [m.log_time for m in messages] == [5, 6, 7, 8]


def write_split(path: Path, source: Path, **split: float) -> dict[str, Any]:
    """Copy a bag into one that is split; its metadata."""
    with BagWriter(path, **split) as writer:
        for message in read_messages(source):
            writer.write(*message)
    return yaml.safe_load((path / 'metadata.yaml').read_text())['rosbag2_bagfile_information']


@pytest.mark.parametrize('split', [{'split_size': 50_000}, {'split_duration': 0.7}])
def test_a_split_bag_is_one_bag_to_every_reader(recorded: Path, tmp_path: Path, split: dict[str, float]):
    information = write_split(tmp_path / 'split', recorded, **split)
    names = [f'split_{i}.mcap' for i in range(len(information['files']))]
    assert len(names) > 3
    assert information['relative_file_paths'] == names == [file['path'] for file in information['files']]
    assert {path.name for path in (tmp_path / 'split').iterdir()} == {*names, 'metadata.yaml'}
    assert list(read_messages(tmp_path / 'split')) == list(read_messages(recorded))
    assert bag_topics(tmp_path / 'split') == bag_topics(recorded)
    assert replay(tmp_path / 'split').identical
    with AnyReader([tmp_path / 'split']) as reader:
        theirs = [(c.topic, log_time, bytes(data)) for c, log_time, data in reader.messages()]
    assert theirs == [(m.topic, m.log_time, m.data) for m in read_messages(recorded)]


def test_each_file_of_a_split_bag_stands_alone_and_metadata_is_true_of_it(recorded: Path, tmp_path: Path):
    information = write_split(tmp_path / 'split', recorded, split_size=50_000)
    for file in information['files']:
        path = tmp_path / 'split' / file['path']
        messages = list(read_messages(path))
        assert file['message_count'] == len(messages) == sum(info.message_count for info in bag_topics(path).values())
        assert file['starting_time']['nanoseconds_since_epoch'] == messages[0].log_time
        assert file['duration']['nanoseconds'] == messages[-1].log_time - messages[0].log_time
        assert path.stat().st_size < 50_000 + 40_000  # definitions and index come on top
        with path.open('rb') as stream:
            assert len(list(make_reader(stream, decoder_factories=[DecoderFactory()]).iter_decoded_messages())) > 50
    assert information['message_count'] == sum(file['message_count'] for file in information['files'])


def test_a_file_lasts_no_longer_than_the_split_duration(recorded: Path, tmp_path: Path):
    information = write_split(tmp_path / 'split', recorded, split_duration=0.5)
    assert all(file['duration']['nanoseconds'] <= 500_000_000 for file in information['files'])


def test_metadata_is_there_from_the_start_and_lists_each_finished_file_and_new_topic(tmp_path: Path):
    def information() -> dict[str, Any]:
        return yaml.safe_load((tmp_path / 'bag' / 'metadata.yaml').read_text())['rosbag2_bagfile_information']

    writer = BagWriter(tmp_path / 'bag', split_duration=1e-9)
    assert information()['relative_file_paths'] == ['bag_0.mcap']
    writer.write('/t', CONFIGURATION_TYPE, 1, encode_text('a'))
    writer.flush()
    assert [t['topic_metadata']['name'] for t in information()['topics_with_message_count']] == ['/t']
    for log_time in (5, 9):
        writer.write('/t', CONFIGURATION_TYPE, log_time, encode_text('b'))
    assert information()['relative_file_paths'] == ['bag_0.mcap', 'bag_1.mcap']
    assert information()['message_count'] == 2
    assert len(list(read_messages(tmp_path / 'bag'))) == 2  # the finished files are a valid bag already
    writer.close()
    assert information()['relative_file_paths'] == ['bag_0.mcap', 'bag_1.mcap', 'bag_2.mcap']
    assert information()['message_count'] == 3


def test_what_was_flushed_is_in_the_file_and_whole(tmp_path: Path):
    writer = BagWriter(tmp_path / 'bag')
    for number in range(10):
        writer.write('/t', CONFIGURATION_TYPE, number, encode_text(str(number)))
    with pytest.raises(BagError, match='nothing to recover'):
        recover(tmp_path / 'bag', tmp_path / 'before')
    writer.flush()
    assert recover(tmp_path / 'bag', tmp_path / 'after').lost_bytes == 0
    assert [decode_text(message.data) for message in read_messages(tmp_path / 'after')] == list('0123456789')
    writer.close()


def test_chunks_that_overlap_in_time_come_out_in_order_of_time(tmp_path: Path):
    with (tmp_path / 'mixed.mcap').open('wb') as file:
        writer = Writer(file)
        writer.start()
        channel = writer.register_channel('/t', 'cdr', writer.register_schema('a/msg/B', 'ros2msg', b''))
        for times in ([5, 3, 9], [4, 4, 8], [20, 21, 22], [1, 30, 10]):
            for log_time in times:
                writer.add_message(channel, log_time, bytes([log_time]), 0)
            writer.flush()
        writer.finish()
    messages = list(read_messages(tmp_path / 'mixed.mcap'))
    assert [m.log_time for m in messages] == [1, 3, 4, 4, 5, 8, 9, 10, 20, 21, 22, 30]
    assert [m.data[0] for m in messages] == [m.log_time for m in messages]


def test_what_overlaps_by_more_than_memory_may_hold_is_refused(tmp_path: Path):
    with (tmp_path / 'mixed.mcap').open('wb') as file:
        writer = Writer(file, chunk_size=1 << 30)
        writer.start()
        channel = writer.register_channel('/t', 'cdr', writer.register_schema('a/msg/B', 'ros2msg', b''))
        for log_time in range(80, 0, -1):  # half of each chunk comes after all others
            writer.add_message(channel, log_time, bytes(1 << 20), 0)
            writer.add_message(channel, 1000 + log_time, bytes(1 << 20), 0)
            writer.flush()
        writer.finish()
    with pytest.raises(BagError, match='more than 32 MiB of messages overlap in time'):
        list(read_messages(tmp_path / 'mixed.mcap'))


def test_a_bag_is_never_overwritten(tmp_path: Path):
    write_inputs(tmp_path / 'bag', 3)
    before = {p.name: p.read_bytes() for p in (tmp_path / 'bag').iterdir()}
    with pytest.raises(BagError, match='exists already: not overwriting'):
        BagWriter(tmp_path / 'bag')
    assert {p.name: p.read_bytes() for p in (tmp_path / 'bag').iterdir()} == before


@pytest.mark.parametrize(('umask', 'folder', 'file'), [(0, 0o750, 0o640), (0o022, 0o750, 0o640), (0o077, 0o700, 0o600)])
def test_others_cannot_read_a_bag(tmp_path: Path, umask: int, folder: int, file: int):
    before = os.umask(umask)
    try:
        with BagWriter(tmp_path / 'bag', split_duration=1e-9) as writer:
            for log_time in (1, 5):
                writer.write('/t', CONFIGURATION_TYPE, log_time, encode_text('a'))
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / 'bag').stat().st_mode) == folder
    modes = {path.name: stat.S_IMODE(path.stat().st_mode) for path in (tmp_path / 'bag').iterdir()}
    assert modes == dict.fromkeys(('metadata.yaml', 'bag_0.mcap', 'bag_1.mcap'), file)


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
