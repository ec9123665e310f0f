"""Files from strangers: a result or one line, in bounded time and memory, and nothing outside the bag is opened."""

import json
import os
import sqlite3
import struct
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path

import pytest
import yaml
from harness.commands import run_json
from harness.example_bags import write_inputs
from hypothesis import given, settings
from hypothesis import strategies as st
from paths import ROOT
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as RosbagsWriter
from rosbags.typesys import Stores, get_typestore

from seal_friction_ros.core.estimation.configuration import parse_snapshot
from seal_friction_ros.core.friction.seal_file import parse_seal
from seal_friction_ros.files import load_parameter_file, read_yaml
from seal_friction_ros.offline.bags.bag import BagWriter, bag_topics, read_messages
from seal_friction_ros.offline.bags.import_log import read_samples
from seal_friction_ros.offline.bags.mcap_reader import MAGIC
from seal_friction_ros.offline.bags.recover import recover
from seal_friction_ros.offline.bags.rig_file import read_rig

CORPUS = ROOT / 'test' / 'corpus'


@pytest.fixture(scope='module')
def folder(tmp_path_factory) -> Iterator[Path]:
    return tmp_path_factory.mktemp('strangers')


def complaint(function, *arguments: object) -> str:
    with pytest.raises(ValueError) as error:
        list(function(*arguments))
    assert len(str(error.value).splitlines()) == 1
    return str(error.value)


def outcome(function: Callable, *arguments: object) -> tuple[object, str]:
    """What a reader gives, or the one line with which it refuses."""
    try:
        return function(*arguments), ''
    except ValueError as error:
        return None, str(error)


@pytest.mark.parametrize('cases', [100, pytest.param(1000, marks=pytest.mark.long)])
def test_mutations_of_the_corpus_crash_no_reader(cases):
    readers = run_json('test/system/fuzz.py', 'all', '--cases', str(cases))['readers']
    assert len(readers) == 11
    for reader in readers:
        assert reader['cases'] == cases
        assert (reader['crashes'], reader['kept']) == (0, [])
        assert reader['slowest'] < 1.0
        with_compiler = reader['reader'] in ('bag_bulk', 'parameters')
        assert reader['memory'] < (320.0 if with_compiler else 200.0)  # the compiler takes 120
        assert reader['taken'] >= cases // 200  # else nothing behind the first check is ever reached


# --- MCAP ---


@pytest.mark.parametrize(
    ('name', 'reason'),
    [
        ('claims_1_tb_record', 'truncated'),
        ('claims_1_tb_chunk', 'at most 32 MiB'),
        ('claims_1_tb_unpacked', 'at most 32 MiB'),
        ('zstd_bomb', 'at most 32 MiB'),
        ('zstd_bomb_that_lies', 'at most 32 MiB'),
        ('statistics_claim_much', 'shorter than what it claims'),
        ('name_of_4_gb', 'shorter than what it claims'),
        ('message_in_message', None),
        ('unfinished', 'seal_friction recover'),
    ],
)
def test_the_size_that_a_file_claims_is_not_trusted(name: str, reason: str | None):
    if reason is None:
        assert len(list(read_messages(CORPUS / 'mcap' / name))) == 1
    else:
        assert reason in complaint(read_messages, CORPUS / 'mcap' / name)


@pytest.mark.parametrize('name', ['plain', 'no_checksums', 'zstd', 'lz4', 'no_chunks', 'no_summary'])
def test_every_kind_of_good_file_gives_the_same_messages(name: str):
    assert list(read_messages(CORPUS / 'mcap' / name)) == list(read_messages(CORPUS / 'mcap' / 'plain'))
    assert bag_topics(CORPUS / 'mcap' / name) == bag_topics(CORPUS / 'mcap' / 'plain')
    assert sum(info.message_count for info in bag_topics(CORPUS / 'mcap' / name).values()) == 9


RECORDS = st.builds(
    lambda opcode, content, lie: struct.pack('<BQ', opcode, max(len(content) + lie, 0)) + content,
    st.sampled_from([1, 2, 3, 4, 5, 5, 6, 6, 7, 8, 11, 15, 99]),
    st.one_of(
        st.binary(max_size=80),
        st.builds(
            lambda *parts: struct.pack('<QQQII', *parts[:5]) + parts[5],
            *[st.integers(0, 2**64 - 1)] * 2,
            st.integers(0, 2**64 - 1) | st.integers(0, 80),
            st.just(0),
            st.integers(0, 8),
            st.binary(max_size=60),
        ),
        st.builds(lambda *parts: struct.pack('<HIQQ', *parts), st.integers(0, 3), st.just(0), *[st.integers(0, 9)] * 2),
    ),
    st.sampled_from([0, 0, 0, 0, -1, 1, 2**40]),
)


@settings(max_examples=400)
@given(records=st.lists(RECORDS, max_size=8), ended=st.booleans())
def test_any_sequence_of_records_gives_messages_or_one_line(folder: Path, records: list[bytes], ended: bool):
    ending = struct.pack('<BQI', 15, 4, 0) + struct.pack('<BQQQI', 2, 20, 0, 0, 0) + MAGIC
    path = folder / 'any.mcap'
    path.write_bytes(MAGIC + b''.join(records) + (ending if ended else b''))
    read, refusal = outcome(lambda: list(read_messages(path)))
    assert len(refusal.splitlines()) == (read is None)
    assert ended or refusal


# --- the folder of a bag ---


@pytest.fixture
def bag(tmp_path: Path) -> Path:
    write_inputs(tmp_path / 'bag', 20)
    (tmp_path / 'secret_0.mcap').write_bytes((tmp_path / 'bag' / 'bag_0.mcap').read_bytes())
    return tmp_path / 'bag'


def rewrite(bag: Path, **changes: object) -> None:
    document = yaml.safe_load((bag / 'metadata.yaml').read_text())
    document['rosbag2_bagfile_information'] |= changes
    (bag / 'metadata.yaml').write_text(yaml.safe_dump(document))


@pytest.mark.parametrize(
    'name', ['../secret_0.mcap', '/etc/passwd', '/dev/zero', 'a/../../secret_0.mcap', '..', '.', '', 'x\x00y', 'link']
)
def test_a_name_in_metadata_does_not_lead_out_of_the_bag(bag: Path, name: str):
    (bag / 'link').symlink_to(bag.parent / 'secret_0.mcap')
    rewrite(bag, relative_file_paths=[name])
    assert complaint(read_messages, bag).startswith(f'{bag}: ')
    assert complaint(bag_topics, bag).startswith(f'{bag}: ')


def test_metadata_that_is_a_link_elsewhere_is_not_read(bag: Path):
    (bag / 'metadata.yaml').rename(bag.parent / 'metadata.yaml')
    (bag / 'metadata.yaml').symlink_to(bag.parent / 'metadata.yaml')
    assert 'leads out of the folder' in complaint(read_messages, bag)


def test_a_pipe_or_a_device_is_no_bag_and_is_not_waited_for(tmp_path: Path):
    os.mkfifo(tmp_path / 'pipe')
    for path in (tmp_path / 'pipe', Path('/dev/zero')):
        for function in (read_messages, bag_topics):
            assert 'neither a file nor a folder' in complaint(function, path)
        rig = read_rig(CORPUS / 'rig' / 'velocity')
        assert 'not a file' in complaint(lambda: read_samples(path, rig))  # noqa: B023  called at once
        assert 'not a file' in complaint(lambda: read_yaml(path))  # noqa: B023  called at once


def test_a_name_that_would_act_on_a_terminal_is_refused(tmp_path: Path):
    with BagWriter(tmp_path / 'bag') as writer:
        writer.write('/a\x1b[2J', 'std_msgs/msg/String', 1, b'')
    assert 'not a valid name of a channel' in complaint(read_messages, tmp_path / 'bag')


# --- SQLite ---


@pytest.fixture
def sqlite_bag(tmp_path: Path) -> Path:
    store = get_typestore(Stores.ROS2_JAZZY)
    with RosbagsWriter(tmp_path / 'sqlite', version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
        connection = writer.add_connection('/number', 'std_msgs/msg/Int64', typestore=store)
        for i in range(10):
            writer.write(connection, 10 - i, struct.pack('<4sq', b'\x00\x01\x00\x00', i))
    return tmp_path / 'sqlite'


def test_a_bag_of_sqlite_is_read_in_order_of_time_and_nothing_is_written_beside_it(sqlite_bag: Path):
    before = sorted(sqlite_bag.iterdir())
    messages = list(read_messages(sqlite_bag))
    assert [message.log_time for message in messages] == list(range(1, 11))
    assert [struct.unpack('<q', message.data[4:])[0] for message in messages] == list(range(9, -1, -1))
    assert bag_topics(sqlite_bag) == {'/number': ('std_msgs/msg/Int64', 10)}
    assert sorted(sqlite_bag.iterdir()) == before


@pytest.mark.parametrize('name', ['view_without_end', 'computed_column'])
def test_a_database_that_computes_is_refused(name: str, tmp_path: Path):
    path = tmp_path / 'evil.db3'
    path.write_bytes((CORPUS / 'sqlite' / name).read_bytes())
    assert 'no plain table of messages' in complaint(read_messages, path)


def test_values_of_a_database_that_are_of_the_wrong_kind_are_refused(sqlite_bag: Path):
    (file,) = sqlite_bag.glob('*.db3')
    with closing(sqlite3.connect(file)) as database:
        database.execute("UPDATE messages SET data = 'text' WHERE timestamp = 3")
        database.commit()
    assert 'is invalid' in complaint(read_messages, sqlite_bag)


# --- YAML, logs, JSON ---

YAML = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda inner: (
        st.lists(inner, max_size=4)
        | st.dictionaries(
            st.sampled_from(['name', 'geometry', 'coulomb_law', 'law', 'terms', 'time', 'column', 'unit', 'x'])
            | st.text(max_size=4),
            inner,
            max_size=5,
        )
    ),
    max_leaves=12,
)


def grafted(document: object, path: list[int], twig: object) -> object:
    """A document with one of its parts replaced."""
    if not path or not isinstance(document, dict | list) or not document:
        return twig
    keys = list(document) if isinstance(document, dict) else list(range(len(document)))
    key = keys[path[0] % len(keys)]
    copy = dict(document) if isinstance(document, dict) else list(document)
    copy[key] = grafted(copy[key], path[1:], twig)
    return copy


def configured(text: str) -> object:
    return parse_snapshot(text).configuration.parameters()


@settings(max_examples=60)
@given(path=st.lists(st.integers(0, 9), min_size=1, max_size=4), twig=YAML)
def test_any_part_of_a_good_document_may_be_anything(folder: Path, path: list[int], twig: object):
    readers = {
        'seal/tables': lambda file: parse_seal(read_yaml(file)),
        'seal/power_law': lambda file: parse_seal(read_yaml(file)),
        'rig/position': read_rig,
        'parameters/nested': load_parameter_file,
        'metadata/good': lambda file: bag_topics(file.parent),
    }
    for name, read in readers.items():
        document = yaml.safe_load((CORPUS / name).read_text())
        file = folder / 'metadata.yaml'
        file.write_text(yaml.safe_dump(grafted(document, path, twig), allow_unicode=True))
        _, refusal = outcome(read, file)
        assert len(refusal.splitlines()) <= 1
    for name in ('snapshot/start', 'snapshot/running'):
        document = json.loads((CORPUS / name).read_text())
        _, refusal = outcome(configured, json.dumps(grafted(document, path, twig), default=str))
        assert len(refusal.splitlines()) <= 1


def test_a_line_without_end_is_refused_before_it_is_read(tmp_path: Path):
    (tmp_path / 'log').write_bytes(b'1,' * 3_000_000)
    rig = read_rig(CORPUS / 'rig' / 'velocity')
    assert 'a line of more than' in complaint(lambda: read_samples(tmp_path / 'log', rig))


@pytest.mark.parametrize('name', ['deep', 'aliases', 'sexagesimal', 'object'])
def test_yaml_that_costs_more_than_it_weighs_is_refused(name: str, tmp_path: Path):
    content = (CORPUS / 'metadata' / name).read_text()
    if name == 'sexagesimal':
        content = content.replace('59:' * 100, '59:' * 1000)
    (tmp_path / 'file.yaml').write_text(content)
    assert 'not plain YAML' in complaint(lambda: read_yaml(tmp_path / 'file.yaml'))


def test_what_is_recovered_of_the_corpus_can_be_read(tmp_path: Path):
    for path in sorted((CORPUS / 'mcap').iterdir()):
        found, refusal = outcome(recover, path, tmp_path / path.name)
        assert len(refusal.splitlines()) == (found is None)
        if found is not None:
            assert len(list(read_messages(tmp_path / path.name))) == found.messages
