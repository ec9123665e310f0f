"""Records of an MCAP file but for messages and chunks, packed and parsed. Layout: https://mcap.dev/spec.

With these and `mcap_reader`, recording and replay need no package beyond those of a ROS distribution.
"""

import struct
from collections.abc import Iterable, Mapping
from enum import IntEnum
from typing import NamedTuple

MAGIC = b'\x89MCAP0\r\n'
"""Beginning and end of a file."""
TOO_SHORT = 'a record is shorter than what it claims to hold'


class Opcode(IntEnum):
    """Kind of a record."""

    HEADER = 0x01
    FOOTER = 0x02
    SCHEMA = 0x03
    CHANNEL = 0x04
    MESSAGE = 0x05
    CHUNK = 0x06
    MESSAGE_INDEX = 0x07
    CHUNK_INDEX = 0x08
    ATTACHMENT_INDEX = 0x0A
    STATISTICS = 0x0B
    METADATA = 0x0C
    METADATA_INDEX = 0x0D
    SUMMARY_OFFSET = 0x0E
    DATA_END = 0x0F


class Schema(NamedTuple):
    """Description of a message type."""

    number: int
    name: str
    encoding: str
    data: bytes


class Channel(NamedTuple):
    """Description of a topic."""

    number: int
    schema: int
    topic: str
    encoding: str  # of its messages
    metadata: Mapping[str, str]


class ChunkIndex(NamedTuple):
    """Entry of a chunk that is not compressed."""

    first_time: int  # log time of its first message [ns]
    last_time: int
    offset: int  # [bytes] in the file, likewise all that follow
    length: int  # of the record
    message_indices: Mapping[int, int]  # channel -> offset
    index_length: int
    size: int  # of its data


# -- packing ----------------------------------------------------------------------------------------------------------


def record(opcode: Opcode, content: bytes) -> bytes:
    """A record with its opcode and length."""
    return struct.pack('<BQ', opcode, len(content)) + content


def header(profile: str, library: str) -> bytes:
    """First record of a file."""
    return record(Opcode.HEADER, _text(profile) + _text(library))


def schema(of: Schema) -> bytes:
    """Description of a message type."""
    data = struct.pack('<I', len(of.data)) + of.data
    return record(Opcode.SCHEMA, struct.pack('<H', of.number) + _text(of.name) + _text(of.encoding) + data)


def channel(of: Channel) -> bytes:
    """Description of a topic."""
    numbers = struct.pack('<HH', of.number, of.schema)
    return record(Opcode.CHANNEL, numbers + _text(of.topic) + _text(of.encoding) + _texts(of.metadata))


def metadata(name: str, values: Mapping[str, str]) -> bytes:
    """Texts by name."""
    return record(Opcode.METADATA, _text(name) + _texts(values))


def metadata_index(offset: int, length: int, name: str) -> bytes:
    """Place of a record of `metadata` [bytes]."""
    return record(Opcode.METADATA_INDEX, struct.pack('<QQ', offset, length) + _text(name))


def chunk_index(of: ChunkIndex) -> bytes:
    """Place of a chunk."""
    places = _numbers(of.message_indices)
    numbers = struct.pack('<QQQQ', of.first_time, of.last_time, of.offset, of.length)
    sizes = struct.pack('<QIQQ', of.index_length, 0, of.size, of.size)  # between them: no name of a compression
    return record(Opcode.CHUNK_INDEX, numbers + places + sizes)


def statistics(
    first_time: int, last_time: int, schemas: int, chunks: int, metadata_records: int, counts: Mapping[int, int]
) -> bytes:
    """Numbers of records.

    Args:
        first_time: Log time of the first message [ns].
        last_time: Log time of the last message [ns].
        schemas: Number of schemas.
        chunks: Number of chunks.
        metadata_records: Number of records of `metadata`.
        counts: Channel -> number of messages.
    """
    numbers = (sum(counts.values()), schemas, len(counts), 0, metadata_records, chunks, first_time, last_time)
    return record(Opcode.STATISTICS, struct.pack('<QHIIIIQQ', *numbers) + _numbers(counts))


def summary_offset(opcode: Opcode, offset: int, length: int) -> bytes:
    """Place of all records of one kind in the summary [bytes]."""
    return record(Opcode.SUMMARY_OFFSET, struct.pack('<BQQ', opcode, offset, length))


def data_end() -> bytes:
    """End of the messages, without a checksum."""
    return record(Opcode.DATA_END, bytes(4))


def footer(summary: int, offsets: int, checksum: int) -> bytes:
    """Last record of a file: where the summary and its offsets begin [bytes], and their checksum."""
    return record(Opcode.FOOTER, struct.pack('<QQI', summary, offsets, checksum))


def _text(value: str) -> bytes:
    data = value.encode()
    return struct.pack('<I', len(data)) + data


def _texts(values: Mapping[str, str]) -> bytes:
    data = b''.join(_text(name) + _text(value) for name, value in values.items())
    return struct.pack('<I', len(data)) + data


def _numbers(values: Mapping[int, int]) -> bytes:
    return struct.pack('<I', 10 * len(values)) + b''.join(struct.pack('<HQ', *item) for item in values.items())


# -- parsing ----------------------------------------------------------------------------------------------------------


def parse_schema(content: bytes) -> Schema:
    """Schema from the content of its record.

    Raises:
        ValueError: The record is shorter than it claims, or a text is not UTF-8.
    """
    fields = _Fields(content)
    number, name, encoding = fields.number('<H'), fields.text(), fields.text()
    return Schema(number, name, encoding, fields.take(fields.number('<I')))


def parse_channel(content: bytes) -> Channel:
    """Channel from the content of its record.

    Raises:
        ValueError: As `parse_schema`.
    """
    fields = _Fields(content)
    number, of_schema = fields.number('<H'), fields.number('<H')
    topic, encoding = fields.text(), fields.text()
    end = fields.number('<I') + fields.position
    values = {}
    while fields.position < end:
        name = fields.text()
        values[name] = fields.text()
    return Channel(number, of_schema, topic, encoding, values)


def parse_message_counts(content: bytes) -> dict[int, int]:
    """Number of messages of each channel, from the content of the record of `statistics`.

    Raises:
        ValueError: As `parse_schema`.
    """
    fields = _Fields(content)
    fields.take(struct.calcsize('<QHIIIIQQ'))
    counts = _Fields(fields.take(fields.number('<I')))
    return dict(counts.pairs())


class _Fields:
    """Fields of a record, one after the other."""

    def __init__(self, content: bytes) -> None:
        self._content = content
        self.position = 0

    def take(self, size: int) -> bytes:
        """The next bytes."""
        end = self.position + size
        if end > len(self._content):
            raise ValueError(TOO_SHORT)
        data = self._content[self.position : end]
        self.position = end
        return data

    def number(self, code: str) -> int:
        """A whole number; ``code`` as in `struct`."""
        return int(struct.unpack(code, self.take(struct.calcsize(code)))[0])

    def text(self) -> str:
        """A text."""
        return self.take(self.number('<I')).decode()

    def pairs(self) -> Iterable[tuple[int, int]]:
        """Pairs of whole numbers up to the end."""
        while self.position < len(self._content):
            yield self.number('<H'), self.number('<Q')
