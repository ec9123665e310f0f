"""Replay in bulk: every bag is read in the same order and gets the same verdict as message by message."""

import dataclasses
import random
import shutil
import sqlite3
from pathlib import Path

import pytest
import yaml
import zstandard
from harness.closed_loop_bags import write_closed_loop
from harness.compensation import compensating
from harness.example_bags import rewrite, write_recorded
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from mcap.data_stream import RecordBuilder
from mcap.records import Channel, DataEnd, Footer, Header, Message, Schema
from mcap.writer import CompressionType, Writer
from paths import ROOT

from seal_friction_ros.core.estimation.configuration import Configuration
from seal_friction_ros.core.estimation.estimator import EstimatorSettings
from seal_friction_ros.core.messages.blocks import Kind, UnsuitedError
from seal_friction_ros.core.messages.layouts import CONFIGURATION_TYPE, ESTIMATE_TYPE, FORCE_TYPE, GROWN, VELOCITY_TYPE
from seal_friction_ros.files import load_configuration
from seal_friction_ros.offline.bags.actuator_bag import find_topics
from seal_friction_ros.offline.bags.bag import (
    ESTIMATE_TOPIC,
    FEEDFORWARD_TOPIC,
    BagError,
    BagMessage,
    BagWriter,
    bag_topics,
    read_messages,
)
from seal_friction_ros.offline.bags.block_reader import read_in_bulk
from seal_friction_ros.offline.bags.definitions import message_definition
from seal_friction_ros.offline.bags.mcap_reader import MAGIC
from seal_friction_ros.offline.replay import compiled_replay
from seal_friction_ros.offline.replay.answer_comparison import ReplayResult
from seal_friction_ros.offline.replay.parallel_replay import BULK_FROM, verify
from seal_friction_ros.offline.replay.replay import replay

CORPUS = ROOT / 'test' / 'corpus'


def chances(seed: int) -> random.Random:
    return random.Random(seed)  # noqa: S311  no secret depends on it


def in_bulk(bag: Path, override: Configuration | None = None) -> ReplayResult | None:
    return compiled_replay.replay_in_bulk(bag, find_topics(bag), override, lambda _: None)


def assert_same_verdict(bag: Path, override: Configuration | None = None) -> ReplayResult:
    expected = verify(bag, override, bulk_from=BULK_FROM)
    assert in_bulk(bag, override) == expected
    return expected


Read = list[tuple[str, bytes, int, int]]
"""Topic, bytes, log time and time of sending of each message."""


def read_back(path: Path) -> Read:
    """A bag read in bulk."""
    numbers = {topic: number for number, topic in enumerate(bag_topics(path))}
    names = list(numbers)
    return [
        (names[kind], messages.message(number), int(messages.received[number]), int(messages.sent[number]))
        for messages in read_in_bulk(path, lambda topic, _: numbers[topic])
        for number, kind in enumerate(messages.kinds.tolist())
    ]


def one_by_one(path: Path) -> Read:
    """A bag read message by message; one whose time of sending is not known was sent at its log time."""
    return [
        (m.topic, m.data, m.log_time, m.log_time if m.publish_time is None else m.publish_time)
        for m in read_messages(path)
    ]


def assert_same_messages(path: Path) -> None:
    expected = one_by_one(path)
    assert expected
    assert read_back(path) == expected


@pytest.fixture(scope='module')
def folder(tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp('bulk')


@pytest.fixture(scope='module')
def recorded(folder: Path) -> Path:
    return write_recorded(folder, compensating(EstimatorSettings(stick_velocity=2e-3, slip_velocity=5e-3)))


@pytest.fixture(scope='module')
def closed_loop(folder: Path) -> Path:
    """With a feed-forward for each estimate, and the configuration changed amid the run."""
    return write_closed_loop(folder / 'closed_loop', scales=(0.0, 0.9, 0.3), seconds=0.5)


@pytest.mark.parametrize('name', ['pull_test', 'faults'])
def test_the_bags_of_this_project_verify_in_bulk(name: str):
    assert assert_same_verdict(ROOT / 'bags' / name).identical


def test_recorded_runs_verify_in_bulk_and_inputs_alone_do_not(recorded: Path, closed_loop: Path, folder: Path):
    assert assert_same_verdict(recorded).identical
    found = assert_same_verdict(closed_loop)
    assert found.identical
    assert found.recorded_feedforwards > 1400
    assert not assert_same_verdict(folder / 'inputs').identical


def test_frame_names_of_any_length_may_take_turns_also_in_a_bag_from_before_a_message_grew(tmp_path: Path):
    """A driver that starts again may have another frame name."""
    bag = write_recorded(tmp_path, compensating(), frames=(b'', b'rod', b'x' * 300))
    found = assert_same_verdict(bag)
    assert found.identical, found.first_difference
    assert found.recorded_feedforwards >= 100
    assert len(GROWN[ESTIMATE_TYPE]) == 2
    for grown in GROWN[ESTIMATE_TYPE]:

        def older(_: int, message: BagMessage, grown: int = grown) -> BagMessage:
            return message._replace(data=message.data[:-grown]) if message.type_name == ESTIMATE_TYPE else message

        found = assert_same_verdict(rewrite(bag, tmp_path / f'older by {grown}', older))
        assert found.identical, found.first_difference


PAIRS = [
    ('ms28775_114', 'delft_o_ring'),
    ('placeholder', 'placeholder'),
    ('ms28775_114_table', 'ms28775_114_prior_art'),
    ('ms28775_114_fem', 'ms28775_114_stress'),
]
"""Seals of an actuator; pairs of the same laws share their compiled code."""


def test_every_seal_is_in_a_pair():
    files = (ROOT / 'config' / 'seals').glob('*.yaml')
    assert {path.stem for path in files} == {seal for pair in PAIRS for seal in pair}


@pytest.mark.parametrize(
    'pair', [*PAIRS[:2], *(pytest.param(pair, marks=pytest.mark.long) for pair in PAIRS[2:])], ids=map('-'.join, PAIRS)
)
def test_every_seal_gives_the_same_bytes(pair: tuple[str, str], closed_loop: Path, tmp_path: Path):
    known = compensating()
    selection = dataclasses.replace(known.selection, seals=pair)
    override = load_configuration(selection, known.settings, known.feedforward)
    assert assert_same_verdict(closed_loop, override).differing
    replay(closed_loop, override, out=tmp_path / 'out')
    assert assert_same_verdict(tmp_path / 'out').identical


def test_velocity_terms_are_the_same_to_the_byte_in_estimate_and_feed_forward(closed_loop: Path, tmp_path: Path):
    known = compensating()
    terms = {'viscous_friction': 80.0, 'stribeck_friction': 6.0, 'stribeck_velocity': 0.004, 'asymmetry': 0.1}
    documents = tuple({**document, 'velocity_terms': terms} for document in known.seal_documents)
    override = dataclasses.replace(known, seal_documents=documents)
    assert assert_same_verdict(closed_loop, override).differing > 2000
    replay(closed_loop, override, out=tmp_path / 'out')
    assert assert_same_verdict(tmp_path / 'out').identical


@pytest.mark.parametrize('seed', range(12))
def test_whatever_is_lost_doubled_or_flipped_the_difference_found_is_the_same(
    seed: int, closed_loop: Path, tmp_path: Path
):
    chance = chances(seed)
    share = chance.choice([0.01, 0.05, 0.3])
    hit = chance.choice([(ESTIMATE_TOPIC,), (FEEDFORWARD_TOPIC,), (ESTIMATE_TOPIC, FEEDFORWARD_TOPIC), ()])
    held: list[BagMessage] = []

    def spoil(_: int, message: BagMessage) -> BagMessage | None:
        if message.type_name == CONFIGURATION_TYPE or (hit and message.topic not in hit):
            return message
        if chance.random() > share:
            return message
        held.append(message)
        match chance.randrange(4):
            case 0:
                return None
            case 1:
                return chance.choice([other for other in held if other.topic == message.topic])
            case 2 if message.topic in (ESTIMATE_TOPIC, FEEDFORWARD_TOPIC):
                data = bytearray(message.data)
                data[chance.randrange(len(data))] ^= 1 << chance.randrange(8)
                return message._replace(data=bytes(data))
            case _:
                return message._replace(data=message.data + b'\x00')

    assert assert_same_verdict(rewrite(closed_loop, tmp_path / 'spoilt', spoil)).differing


@pytest.mark.parametrize('lag', [1, 2, 7])
def test_estimates_that_another_recorder_saw_late_are_found(lag: int, recorded: Path, tmp_path: Path):
    late: list[BagMessage] = []
    with BagWriter(tmp_path / 'late') as writer:
        for message in read_messages(recorded):
            if message.topic == ESTIMATE_TOPIC:
                late.append(message)
                continue
            writer.write(*message)
            if len(late) > lag:
                writer.write(*late.pop(0))
        for message in late:
            writer.write(*message)
    assert assert_same_verdict(tmp_path / 'late').identical


def test_a_recording_that_was_cut_off_between_a_sample_and_its_answer_is_no_difference(recorded: Path, tmp_path: Path):
    messages = list(read_messages(recorded))
    for count in range(len(messages) - 6, len(messages)):
        assert assert_same_verdict(rewrite(recorded, tmp_path / str(count), lambda n, m, c=count: m if n < c else None))


def test_estimates_that_are_not_recorded_any_more_wait_in_bounded_memory(recorded: Path, tmp_path: Path, monkeypatch):
    monkeypatch.setattr('seal_friction_ros.offline.replay.answer_comparison.LONGEST_QUEUE', 20)
    numbers = [n for n, message in enumerate(read_messages(recorded)) if message.topic == ESTIMATE_TOPIC]
    lost = set(numbers[100:200])
    with_gap = rewrite(recorded, tmp_path / 'gap', lambda n, m: None if n in lost else m)
    assert assert_same_verdict(with_gap).differing == 100
    lost = set(numbers[100:])
    cut = rewrite(recorded, tmp_path / 'cut', lambda n, m: None if n in lost else m)
    assert assert_same_verdict(cut).first_difference == 'velocity samples: 200 at the end have no recorded estimate'


def test_two_actuators_are_told_apart(recorded: Path, tmp_path: Path):
    with BagWriter(tmp_path / 'two') as writer:
        for message in read_messages(recorded):
            for side in ('/left', '/right'):
                writer.write(*message._replace(topic=side + message.topic))
    found = compiled_replay.replay_in_bulk(
        tmp_path / 'two', find_topics(tmp_path / 'two', 'left'), None, lambda _: None
    )
    assert found is not None
    assert found.identical
    assert found == replay(tmp_path / 'two', namespace='left')


def test_a_malformed_message_is_left_to_the_general_way_which_names_it(recorded: Path, tmp_path: Path):
    bag = rewrite(recorded, tmp_path / 'bad', lambda n, m: m._replace(data=m.data[:-3]) if n == 400 else m)
    done: list[int] = []
    assert compiled_replay.replay_in_bulk(bag, find_topics(bag), None, done.append) is None
    assert sum(done) == 0
    errors = []
    for bulk_from in (0, BULK_FROM):
        with pytest.raises(BagError, match='bytes where the message has') as found:
            verify(bag, bulk_from=bulk_from)
        errors.append(str(found.value))
    assert errors[0] == errors[1]


@hypothesis_settings(max_examples=25)
@given(st.integers(0, 2**32), st.integers(10, 120))
def test_any_order_of_messages_and_any_rubbish_gets_the_same_verdict(folder: Path, seed: int, count: int):
    chance = chances(seed)
    messages = list(read_messages(ROOT / 'bags' / 'faults'))
    velocity = next(message for message in messages if message.type_name == VELOCITY_TYPE)
    shutil.rmtree(folder / 'any', ignore_errors=True)
    with BagWriter(folder / 'any') as writer:
        for message in [messages[0], *(chance.choice(messages) for _ in range(count)), velocity]:
            data = message.data if chance.random() < 0.995 else chance.randbytes(len(message.data))
            writer.write(message.topic, message.type_name, message.log_time, data)
    outcomes = []
    for bulk_from in (0, BULK_FROM):
        try:
            outcomes.append(str(verify(folder / 'any', bulk_from=bulk_from)))
        except BagError as error:
            outcomes.append(str(error))
    assert outcomes[0] == outcomes[1]


# --- reading ---


@pytest.mark.parametrize('name', sorted(path.name for path in (CORPUS / 'mcap').iterdir()))
def test_a_file_of_a_stranger_is_read_alike_or_left_to_the_general_reader(name: str):
    path = CORPUS / 'mcap' / name
    try:
        expected = one_by_one(path)
    except BagError:
        with pytest.raises((UnsuitedError, *compiled_replay.ERRORS)):
            list(read_in_bulk(path, lambda *_: Kind.OTHER))
    else:
        assert read_back(path) == expected


def write_mcap(path: Path, chance: random.Random, *, overlap: int, compression: CompressionType) -> None:
    """Chunks of a few messages whose times go back by up to ``overlap``, and chunks that reach into each other."""
    with path.open('wb') as file:
        writer = Writer(file, chunk_size=chance.choice([200, 1000, 5000]), compression=compression)
        writer.start(profile='ros2')
        channels = []
        for topic, type_name in (
            ('/v', VELOCITY_TYPE),
            ('/f', FORCE_TYPE),
            ('/text', CONFIGURATION_TYPE),
        ):
            schema = writer.register_schema(type_name, 'ros2msg', message_definition(type_name)[0].encode())
            channels.append(writer.register_channel(topic, 'cdr', schema))
        for i in range(chance.choice([1, 30, 400])):
            time = max(i // chance.choice([1, 3]) - chance.randint(0, overlap), 0)
            writer.add_message(
                chance.choice(channels), time, chance.randbytes(chance.randint(0, 60)), chance.randint(1, 1 << 62)
            )
        writer.finish()


@pytest.mark.parametrize('compression', CompressionType)
@pytest.mark.parametrize('overlap', [0, 2, 40, 1000])
def test_chunks_in_any_order_of_time_are_read_as_the_general_reader_does(
    overlap: int, compression: CompressionType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    for at_once in (1, 700, 1 << 21):
        monkeypatch.setattr('seal_friction_ros.offline.bags.block_reader._AT_ONCE', at_once)
        for seed in range(4):
            path = tmp_path / f'{at_once}_{seed}.mcap'
            write_mcap(path, chances(seed), overlap=overlap, compression=compression)
            assert_same_messages(path)


def test_a_flipped_bit_is_read_alike_or_left_to_the_general_reader(tmp_path: Path):
    path = tmp_path / 'flipped.mcap'
    write_mcap(path, chances(2), overlap=2, compression=CompressionType.NONE)
    good = path.read_bytes()
    refused = 0
    for bit in range(0, 8 * len(good), 8 * len(good) // 400):
        data = bytearray(good)
        data[bit // 8] ^= 1 << bit % 8
        path.write_bytes(data)
        try:
            expected = one_by_one(path)
            bag_topics(path)
        except BagError:
            expected = None
        try:
            found = read_back(path)
        except (UnsuitedError, *compiled_replay.ERRORS):
            refused += 1
        else:
            assert found == expected
    assert refused > 200


def test_a_split_bag_is_read_file_by_file(recorded: Path, tmp_path: Path):
    with BagWriter(tmp_path / 'split', split_size=50_000) as writer:
        for message in read_messages(recorded):
            writer.write(*message)
    assert_same_messages(tmp_path / 'split')
    assert assert_same_verdict(tmp_path / 'split').identical


def test_messages_packed_one_by_one_and_sqlite_are_read_by_the_general_decoder(recorded: Path, tmp_path: Path):
    packed = tmp_path / 'packed'
    rewrite(recorded, packed, lambda _, m: m._replace(data=zstandard.compress(m.data)))
    document = yaml.safe_load((packed / 'metadata.yaml').read_text())
    document['rosbag2_bagfile_information'] |= {'compression_mode': 'message', 'compression_format': 'zstd'}
    (packed / 'metadata.yaml').write_text(yaml.safe_dump(document))
    database = tmp_path / 'bag.db3'
    topics = {topic: number for number, topic in enumerate(bag_topics(recorded), start=1)}
    with sqlite3.connect(database) as connection:
        connection.execute('CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT)')
        connection.execute(
            'CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB)'
        )
        types = {topic: info.type_name for topic, info in bag_topics(recorded).items()}
        connection.executemany('INSERT INTO topics VALUES(?, ?, ?)', [(n, t, types[t]) for t, n in topics.items()])
        rows = [(topics[m.topic], m.log_time, m.data) for m in read_messages(recorded)]
        connection.executemany('INSERT INTO messages(topic_id, timestamp, data) VALUES(?, ?, ?)', rows)
    connection.close()
    for bag in (packed, database):
        assert_same_messages(bag)
        assert assert_same_verdict(bag).identical


def test_a_channel_that_is_described_in_two_ways_is_refused_by_both_readers(tmp_path: Path):
    builder = RecordBuilder()
    Header('ros2', '').write(builder)
    Schema(id=1, data=b'', encoding='ros2msg', name=VELOCITY_TYPE).write(builder)
    for topic, time in (('/a', 1), ('/b', 2)):
        Channel(id=1, topic=topic, message_encoding='cdr', metadata={}, schema_id=1).write(builder)
        Message(channel_id=1, log_time=time, data=b'something', publish_time=time, sequence=0).write(builder)
    DataEnd(0).write(builder)
    Footer(0, 0, 0).write(builder)
    path = tmp_path / 'twice.mcap'
    path.write_bytes(MAGIC + builder.end() + MAGIC)
    for read in (read_messages, lambda path: read_in_bulk(path, lambda *_: Kind.OTHER)):
        with pytest.raises(ValueError, match='/b has the number of another one, 1'):
            list(read(path))
