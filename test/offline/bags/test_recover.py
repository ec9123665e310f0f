"""Recover: whatever is whole in a damaged bag comes back, in order, and what is gone is said."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from harness.compensation import compensating
from harness.example_bags import write_inputs
from mcap.writer import CompressionType, Writer
from rosbags.highlevel import AnyReader

from seal_friction_ros.core.messages.coder import decode_text, encode_text
from seal_friction_ros.core.messages.layouts import CONFIGURATION_TYPE
from seal_friction_ros.offline.bags.bag import BagError, BagMessage, BagWriter, read_messages
from seal_friction_ros.offline.bags.recover import recover
from seal_friction_ros.offline.commands.main import main
from seal_friction_ros.offline.replay.replay import replay

NUMBER = 'std_msgs/msg/Int64'


@pytest.fixture
def recorded(tmp_path: Path) -> Path:
    """A recording of several files."""
    replay(write_inputs(tmp_path / 'inputs', 1500, compensating()), out=tmp_path / 'replayed')
    with BagWriter(tmp_path / 'bag', split_size=200_000) as writer:
        for message in read_messages(tmp_path / 'replayed'):
            writer.write(*message)
    return tmp_path / 'bag'


def unfinished(bag: Path) -> Path:
    """A recording whose process was killed: no close, no index."""
    written = bag.parent / 'open' / bag.name
    written.parent.mkdir()
    with BagWriter(written) as writer:
        for message in read_messages(bag.parent / 'replayed'):
            writer.write(*message)
        return shutil.copytree(written, bag)


def messages(bag: Path) -> list[BagMessage]:
    return list(read_messages(bag))


def change(path: Path, changed: Callable[[bytes], bytes]) -> None:
    path.write_bytes(changed(path.read_bytes()))


def test_a_sound_bag_is_copied_message_by_message(recorded: Path):
    found = recover(recorded)
    assert found.out == str(recorded.with_name('bag_recovered'))
    assert messages(Path(found.out)) == messages(recorded)
    assert (found.lost_bytes, found.lost_chunks, found.damage) == (0, 0, [])
    assert 'the bag is not damaged' in found.summary()


def test_an_unfinished_bag_is_refused_with_what_to_do_and_recovered_to_its_last_whole_chunk(recorded: Path):
    bag = unfinished(recorded.parent / 'killed')
    with pytest.raises(BagError, match='seal_friction recover'):
        messages(bag)
    found = recover(bag)
    saved = messages(Path(found.out))
    assert saved == messages(recorded)[: len(saved)]
    assert len(saved) == found.messages > 0.8 * len(messages(recorded))
    assert replay(Path(found.out)).identical
    assert found.last_ns == saved[-1].log_time
    assert 'killed_0.mcap: it was not finished' in found.summary()


def test_what_stands_before_the_cut_of_a_truncated_file_is_saved(recorded: Path, tmp_path: Path):
    bag = unfinished(recorded.parent / 'killed')
    (file,) = bag.glob('*.mcap')
    whole, everything = file.read_bytes(), messages(recorded)
    counts = []
    for share in (0.99, 0.7, 0.3):
        size = int(share * len(whole))
        file.write_bytes(whole[:size])
        found = recover(bag, tmp_path / str(size))
        assert messages(tmp_path / str(size)) == everything[: found.messages]
        assert found.lost_bytes < 80_000
        counts.append(found.messages)
    assert counts == sorted(set(counts), reverse=True)
    for size in (0, 5, 40, 50_000):
        file.write_bytes(whole[:size])
        with pytest.raises(BagError, match='nothing to recover'):
            recover(bag, tmp_path / 'out')
        assert not (tmp_path / 'out').exists()


def test_one_damaged_chunk_costs_that_chunk_alone(recorded: Path):
    expected = len(messages(recorded))
    middle = recorded / 'bag_1.mcap'
    change(middle, lambda data: data[:120_000] + bytes([data[120_000] ^ 1]) + data[120_001:])
    with pytest.raises(BagError, match='checksum'):
        messages(recorded)
    found = recover(recorded)
    assert (found.lost_chunks, found.lost_bytes) == (1, 0)
    assert 0 < expected - found.messages < 1500
    assert 'bag_1.mcap: chunk at byte' in found.summary()


def test_metadata_that_is_gone_or_nonsense_does_not_matter(recorded: Path, tmp_path: Path):
    expected = messages(recorded)
    for number, text in enumerate(['', '[1, 2', 'a: &x [*x]']):
        (recorded / 'metadata.yaml').write_text(text)
        recover(recorded, tmp_path / f'out{number}')
        assert messages(tmp_path / f'out{number}') == expected
    (recorded / 'metadata.yaml').unlink()
    assert recover(recorded, tmp_path / 'out').messages == len(expected)


def test_ten_and_more_files_come_in_the_order_they_were_begun(tmp_path: Path):
    with BagWriter(tmp_path / 'bag', split_duration=1e-8) as writer:
        for i in range(40):
            writer.write('/t', CONFIGURATION_TYPE, i, encode_text(str(i)))
    assert len(list((tmp_path / 'bag').glob('*.mcap'))) == 4
    with BagWriter(tmp_path / 'many', split_duration=2e-9) as writer:
        for i in range(40):
            writer.write('/t', CONFIGURATION_TYPE, i, encode_text(str(i)))
    assert len(list((tmp_path / 'many').glob('*.mcap'))) > 10
    found = recover(tmp_path / 'many')
    assert [decode_text(m.data) for m in messages(Path(found.out))] == [str(i) for i in range(40)]


def test_a_bag_of_strangers_keeps_types_and_definitions_that_are_not_installed(tmp_path: Path):
    with (tmp_path / 'foreign.mcap').open('wb') as file:
        writer = Writer(file, compression=CompressionType.ZSTD)
        writer.start(profile='ros2')
        schema = writer.register_schema('their_msgs/msg/Odd', 'ros2msg', b'int64 odd')
        channel = writer.register_channel('/odd', 'cdr', schema, {'offered_qos_profiles': '- history: 1'})
        for i in range(100):
            writer.add_message(channel, 1000 + i // 2, b'\x00\x01\x00\x00' + i.to_bytes(8, 'little'), 0)
        writer.flush()  # and never finished
    found = recover(tmp_path / 'foreign.mcap')
    assert found.out == str(tmp_path / 'foreign_recovered')
    with AnyReader([Path(found.out)]) as reader:
        (connection,) = reader.connections
        assert connection.msgtype == 'their_msgs/msg/Odd'
        decoded = [reader.deserialize(data, connection.msgtype).odd for _, _, data in reader.messages()]
    assert decoded == list(range(100))


def test_a_message_with_an_impossible_log_time_is_left_out_and_counted(tmp_path: Path):
    with (tmp_path / 'odd.mcap').open('wb') as file:
        writer = Writer(file, compression=CompressionType.NONE)
        writer.start(profile='ros2')
        schema = writer.register_schema(NUMBER, 'ros2msg', b'int64 data')
        channel = writer.register_channel('/n', 'cdr', schema, {'offered_qos_profiles': '[]'})
        for i in range(100):
            time = (1 << 63) + 5 if i == 50 else 1000 + i
            writer.add_message(channel, time, b'\x00\x01\x00\x00' + i.to_bytes(8, 'little'), 0)
        writer.finish()
    with pytest.raises(BagError):
        messages(tmp_path / 'odd.mcap')
    found = recover(tmp_path / 'odd.mcap')
    assert (found.messages, found.lost_messages, found.lost_chunks) == (99, 1, 0)
    assert f'a log time of {(1 << 63) + 5} ns' in found.damage[0]
    assert [int.from_bytes(m.data[4:], 'little') for m in messages(Path(found.out))] == [*range(50), *range(51, 100)]


def test_what_was_killed_before_its_first_chunk_holds_nothing_and_that_is_said(tmp_path: Path):
    with BagWriter(tmp_path / 'open'):
        shutil.copytree(tmp_path / 'open', tmp_path / 'bag')
    with pytest.raises(BagError, match='nothing to recover'):
        recover(tmp_path / 'bag')
    assert not (tmp_path / 'bag_recovered').exists()


def test_nothing_is_overwritten_and_links_out_of_the_folder_are_passed_over(recorded: Path, tmp_path: Path):
    (tmp_path / 'out').mkdir()
    with pytest.raises(BagError, match='not overwriting'):
        recover(recorded, tmp_path / 'out')
    expected = len(messages(recorded))
    shutil.copy(recorded / 'bag_0.mcap', tmp_path / 'secret.mcap')
    (recorded / 'bag_99.mcap').symlink_to(tmp_path / 'secret.mcap')
    assert recover(recorded).messages == expected


def test_what_is_no_bag_is_said_in_one_line(tmp_path: Path):
    (tmp_path / 'text').write_text('no bag')
    for path in (tmp_path, tmp_path / 'text', tmp_path / 'absent', Path('/dev/null')):
        with pytest.raises(BagError) as error:
            recover(path, tmp_path / 'out')
        assert len(str(error.value).splitlines()) == 1
        assert str(path) in str(error.value)


def test_the_command_prints_one_object_with_what_was_saved_and_what_is_gone(recorded: Path, tmp_path: Path, capsys):
    change(recorded / 'bag_1.mcap', lambda data: data[:70_000])
    assert main(['recover', str(recorded), '--out', str(tmp_path / 'out'), '--json']) == 0
    figures = json.loads(capsys.readouterr().out)
    assert figures['messages'] == sum(figures['topics'].values()) == len(messages(tmp_path / 'out'))
    assert 0 < figures['lost_bytes'] <= 70_000
    assert len(figures['damage']) == 1
    assert main(['recover', str(recorded), '--out', str(tmp_path / 'out')]) == 2
