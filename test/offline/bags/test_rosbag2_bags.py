"""Bags as ``ros2 bag record`` makes them: both formats, compressed not at all, by message, by file or by chunk."""

import tempfile
from pathlib import Path

import pytest
import zstandard
from harness.compensation import compensating
from harness.example_bags import write_recorded
from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from seal_friction_ros.offline.bags import bag as b
from seal_friction_ros.offline.bags import mcap_reader
from seal_friction_ros.offline.bags.definitions import message_definition
from seal_friction_ros.offline.commands.main import main
from seal_friction_ros.offline.replay.replay import replay

MODES = {'none': CompressionMode.NONE, 'message': CompressionMode.MESSAGE, 'file': CompressionMode.FILE}
FORMATS = {'mcap': StoragePlugin.MCAP, 'sqlite3': StoragePlugin.SQLITE3}


@pytest.fixture(scope='module')
def recorded(tmp_path_factory) -> Path:
    return write_recorded(tmp_path_factory.mktemp('recorded'), compensating())


def in_the_format(recorded: Path, out: Path, form: str, mode: str) -> Path:
    writer = Writer(out, version=9, storage_plugin=FORMATS[form])
    if mode != 'none':
        writer.set_compression(MODES[mode], CompressionFormat.ZSTD)
    with writer:
        connections = {
            topic: writer.add_connection(
                topic, info.type_name, msgdef=(definition := message_definition(info.type_name))[0],
                rihs01=definition[1], typestore=get_typestore(Stores.EMPTY),
            )
            for topic, info in b.bag_topics(recorded).items()
        }  # fmt: skip
        for message in b.read_messages(recorded):
            writer.write(connections[message.topic], message.log_time, message.data)
    return out


@pytest.mark.parametrize('form', FORMATS)
@pytest.mark.parametrize('mode', MODES)
def test_a_bag_of_either_format_and_any_compression_replays_and_verifies(recorded, form, mode, tmp_path: Path, capsys):
    bag = in_the_format(recorded, tmp_path / 'bag', form, mode)
    assert any(path.suffix == '.zstd' for path in bag.iterdir()) == (mode == 'file')
    before = sorted((path.name, path.stat().st_size) for path in bag.iterdir())
    sent = {} if form == 'mcap' else {'publish_time': None}  # SQLite has no time of sending
    assert list(b.read_messages(bag)) == [message._replace(**sent) for message in b.read_messages(recorded)]
    assert b.bag_topics(bag) == b.bag_topics(recorded)
    assert main(['replay', str(bag), '--verify']) == 0
    assert 'identical to the byte' in capsys.readouterr().out
    assert sorted((path.name, path.stat().st_size) for path in bag.iterdir()) == before


@pytest.mark.parametrize('compression', CompressionType, ids=lambda compression: compression.value or 'none')
def test_a_bag_with_chunks_of_any_compression_replays_and_verifies(recorded, compression, tmp_path: Path):
    with (tmp_path / 'bag.mcap').open('wb') as file:
        writer = McapWriter(file, chunk_size=20_000, compression=compression)
        writer.start('ros2')
        channels = {}
        for topic, info in b.bag_topics(recorded).items():
            schema = writer.register_schema(info.type_name, 'ros2msg', message_definition(info.type_name)[0].encode())
            channels[topic] = writer.register_channel(topic, 'cdr', schema)
        for message in b.read_messages(recorded):
            writer.add_message(channels[message.topic], message.log_time, message.data, message.log_time)
        writer.finish()
    assert replay(tmp_path / 'bag.mcap').identical


def test_a_single_packed_file_is_read_and_leaves_nothing_behind(recorded, tmp_path: Path, monkeypatch):
    monkeypatch.setattr(tempfile, 'tempdir', str(tmp_path / 'temporary'))
    (tmp_path / 'temporary').mkdir()
    for form in FORMATS:
        bag = in_the_format(recorded, tmp_path / form, form, 'file')
        (file,) = (path for path in bag.iterdir() if path.suffix == '.zstd')
        assert replay(file).identical
    assert not list((tmp_path / 'temporary').iterdir())


def test_a_packed_file_that_would_fill_the_disk_is_refused(recorded, tmp_path: Path, monkeypatch):
    bag = in_the_format(recorded, tmp_path / 'bag', 'mcap', 'file')
    (file,) = (path for path in bag.iterdir() if path.suffix == '.zstd')
    file.write_bytes(zstandard.compress(bytes(1 << 28)))  # some 20 KB
    monkeypatch.setattr(mcap_reader, 'FREE_SPACE', 1 << 62)
    with pytest.raises(b.BagError, match=r'no room to unpack it in .*: set TMPDIR to another folder'):
        list(b.read_messages(bag))


@pytest.mark.parametrize(
    ('change', 'expected'),
    [
        (lambda data: b'nonsense' + data, 'not a readable bag'),
        (lambda data: data[: len(data) // 2], 'not a readable bag'),
    ],
)
def test_a_damaged_packed_file_is_refused(recorded, change, expected, tmp_path: Path):
    bag = in_the_format(recorded, tmp_path / 'bag', 'mcap', 'file')
    (file,) = (path for path in bag.iterdir() if path.suffix == '.zstd')
    file.write_bytes(change(file.read_bytes()))
    with pytest.raises(b.BagError, match=expected):
        list(b.read_messages(bag))


def test_another_compression_is_refused_with_its_name(recorded, tmp_path: Path):
    bag = in_the_format(recorded, tmp_path / 'bag', 'mcap', 'file')
    metadata = bag / 'metadata.yaml'
    metadata.write_text(metadata.read_text().replace('compression_format: zstd', 'compression_format: lz4'))
    with pytest.raises(b.BagError, match="compression_mode = 'file' by 'lz4'"):
        b.bag_topics(bag)


@pytest.mark.parametrize(('set_to', 'written'), [('jazzy', 'jazzy'), (None, 'unknown')])
def test_a_bag_names_the_distribution_that_recorded_it(set_to, written, tmp_path: Path, monkeypatch):
    monkeypatch.delenv('ROS_DISTRO', raising=False)
    if set_to:
        monkeypatch.setenv('ROS_DISTRO', set_to)
    with b.BagWriter(tmp_path / 'bag'):
        pass
    assert f'ros_distro: {written}\n' in (tmp_path / 'bag' / 'metadata.yaml').read_text()
