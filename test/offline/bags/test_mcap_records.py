"""Records of MCAP files against the ``mcap`` library."""

from contextlib import suppress

import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap import records as library
from mcap.data_stream import RecordBuilder

from seal_friction_ros.offline.bags import mcap_records as ours
from seal_friction_ros.offline.bags.mcap_records import Opcode

HEAD = 9  # [bytes] opcode and length
names = st.text(max_size=20)
numbers = st.integers(0, 2**16 - 1)
sizes = st.integers(0, 2**64 - 1)


def packed(record: library.McapRecord) -> bytes:
    builder = RecordBuilder()
    record.write(builder)
    return builder.end()


@given(numbers, names, names, st.binary(max_size=50))
def test_a_schema_is_that_of_the_library_and_comes_back(number, name, encoding, data):
    schema = ours.Schema(number, name, encoding, data)
    assert ours.schema(schema) == packed(library.Schema(id=number, name=name, encoding=encoding, data=data))
    assert ours.parse_schema(ours.schema(schema)[HEAD:]) == schema


@given(numbers, numbers, names, names, st.dictionaries(names, names, max_size=3))
def test_a_channel_is_that_of_the_library_and_comes_back(number, schema, topic, encoding, metadata):
    channel = ours.Channel(number, schema, topic, encoding, metadata)
    assert ours.channel(channel) == packed(library.Channel(number, topic, encoding, metadata, schema))
    assert ours.parse_channel(ours.channel(channel)[HEAD:]) == channel


@given(st.dictionaries(numbers, st.integers(0, 2**60), max_size=4), numbers, numbers, sizes, sizes)
def test_statistics_are_those_of_the_library_and_come_back(counts, schemas, chunks, first, last):
    record = ours.statistics(first, last, schemas, chunks, 1, counts)
    assert record == packed(
        library.Statistics(0, len(counts), counts, chunks, sum(counts.values()), last, first, 1, schemas)
    )
    assert ours.parse_message_counts(record[HEAD:]) == counts


@given(st.tuples(sizes, sizes, sizes, sizes, sizes, sizes), st.dictionaries(numbers, sizes, max_size=4))
def test_the_index_of_a_chunk_is_that_of_the_library(values, indices):
    first, last, offset, length, index_length, size = values
    entry = ours.ChunkIndex(first, last, offset, length, indices, index_length, size)
    expected = library.ChunkIndex(length, offset, '', size, last, index_length, indices, first, size)
    assert ours.chunk_index(entry) == packed(expected)


def test_the_other_records_are_those_of_the_library():
    assert ours.header('ros2', 'ä') == packed(library.Header('ros2', 'ä'))
    assert ours.metadata('a', {'b': 'c'}) == packed(library.Metadata('a', {'b': 'c'}))
    assert ours.metadata_index(1, 2, 'a') == packed(library.MetadataIndex(1, 2, 'a'))
    assert ours.summary_offset(Opcode.CHANNEL, 1, 2) == packed(library.SummaryOffset(Opcode.CHANNEL, 1, 2))
    assert ours.data_end() == packed(library.DataEnd(0))
    assert ours.footer(1, 2, 3) == packed(library.Footer(1, 2, 3))


@pytest.mark.parametrize('parse', [ours.parse_schema, ours.parse_channel, ours.parse_message_counts])
@given(data=st.data())
def test_a_record_that_is_cut_or_made_up_is_refused_in_one_way(parse, data):
    whole = {
        ours.parse_schema: ours.schema(ours.Schema(1, 'name', 'ros2msg', b'data')),
        ours.parse_channel: ours.channel(ours.Channel(1, 1, '/topic', 'cdr', {'a': 'b'})),
        ours.parse_message_counts: ours.statistics(0, 1, 1, 1, 1, {1: 5}),
    }[parse][HEAD:]
    with pytest.raises(ValueError, match=ours.TOO_SHORT):
        parse(whole[: data.draw(st.integers(0, len(whole) - 1))])
    with suppress(ValueError):
        parse(data.draw(st.binary(max_size=60)))
