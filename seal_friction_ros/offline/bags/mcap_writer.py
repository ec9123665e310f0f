"""One MCAP file (profile ``ros2``) that is whole up to its newest chunk at any moment, whatever stops the writing.

The records are those of the ``mcap`` library and the file is, byte for byte, what its writer makes; but messages and
their index are packed here, in less than half the time, since the estimator waits while Python packs.
"""

import errno
import os
import struct
import zlib
from collections import deque
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Channel,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)
from mcap.writer import MCAP0_MAGIC

CHUNK_SIZE = 64 * 1024  # [bytes] small chunks keep the writing thread short; the file is no larger for it
_MESSAGE_OVERHEAD = 47  # [bytes] head of a message and its entry in the index
_MARKS = 4  # chunks that can be given back to make room for the end of the file
# Heads of records (https://mcap.dev/spec), each from the opcode and the length of what follows that.
_MESSAGE = struct.Struct('<BQHIQQ')  # channel, sequence number, log time, publish time
_CHUNK = struct.Struct('<BQQQQIIQ')  # first and last time, size and checksum of its data, no compression, size
_MESSAGE_INDEX = struct.Struct('<BQHI')  # channel, size of what follows: log time and offset of each message
_FOOTER = struct.Struct('<BQQQ')  # where the summary and its offsets begin; the checksum covers it up to there
_OPCODE_AND_LENGTH = 9  # [bytes]
_MESSAGE_OPCODE = int(Opcode.MESSAGE)  # a number is packed faster than a member of an enumeration


class Description(NamedTuple):
    """What a bag says of a topic besides its name."""

    type_name: str
    definition_encoding: str
    definition: bytes
    metadata: dict[str, str]
    """of the channel: hash of the type and QoS, as rosbag2 has them"""


class Span(NamedTuple):
    """What is in a file."""

    first_time: int = 0
    """log time of its first message [ns]"""
    last_time: int = 0
    """log time of its last message [ns]"""
    messages: int = 0


class _Mark(NamedTuple):
    """The end of a whole chunk."""

    size: int
    """[bytes] of the file"""
    span: Span
    counts: dict[tuple[str, str], int]


class _Chunk:
    """Messages that go into the file together."""

    def __init__(self) -> None:
        self.data = bytearray()
        self.index: dict[int, list[int]] = {}
        """channel -> log time and offset of each of its messages"""
        self.first_time = self.last_time = -1
        """log times of the first and the last message [ns]"""

    def add(self, channel: int, log_time: int, data: bytes) -> None:
        """Append one message."""
        self.index.setdefault(channel, []).extend((log_time, len(self.data)))
        length = _MESSAGE.size - _OPCODE_AND_LENGTH + len(data)
        self.data += _MESSAGE.pack(_MESSAGE_OPCODE, length, channel, 0, log_time, log_time)
        self.data += data
        if self.first_time < 0:
            self.first_time = log_time
        self.last_time = log_time

    def records(self, start: int) -> tuple[bytes, ChunkIndex]:
        """Return what is written, and its entry in the summary if it is written at ``start``."""
        size, first, last = len(self.data), self.first_time, self.last_time
        length = _CHUNK.size - _OPCODE_AND_LENGTH + size
        chunk = _CHUNK.pack(Opcode.CHUNK, length, first, last, size, zlib.crc32(self.data), 0, size) + self.data
        offsets, indices = {}, b''
        for channel, entries in self.index.items():
            offsets[channel] = start + len(chunk) + len(indices)
            packed = struct.pack(f'<{len(entries)}Q', *entries)
            indices += _MESSAGE_INDEX.pack(Opcode.MESSAGE_INDEX, 6 + len(packed), channel, len(packed)) + packed
        return chunk + indices, ChunkIndex(len(chunk), start, '', size, last, len(indices), offsets, first, size)


class McapOutput:
    """A file being written.

    Args:
        path: Where; must not exist.

    Raises:
        OSError: It cannot be made (so each method, if the disk does not take what is written).
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.span = Span()
        self.counts: dict[tuple[str, str], int] = {}
        """topic and type -> messages"""
        self._stream = _Stream(path)
        try:
            self._stream.write(MCAP0_MAGIC + _packed(Header('ros2', 'seal_friction_ros')))
        except OSError:
            self._stream.close()
            path.unlink(missing_ok=True)
            raise
        self._channels: dict[tuple[str, str], Channel] = {}
        self._schemas: list[Schema] = []
        self._chunk = _Chunk()
        self._chunks: list[ChunkIndex] = []
        self._pending = 0
        self._marks = deque([_Mark(self._stream.tell(), self.span, {})], maxlen=_MARKS)

    @property
    def size(self) -> int:
        """Of the file, once what is pending is written [bytes]."""
        return self._stream.tell() + self._pending

    def write(self, topic: str, description: Description, log_time: int, data: bytes) -> None:
        """Append one message, ``log_time`` in ns, no earlier than the one before."""
        key = (topic, description.type_name)
        if key not in self._channels:
            self._add_channel(key, description)
        self._chunk.add(self._channels[key].id, log_time, data)
        self.counts[key] += 1
        first, _, before = self.span
        self.span = Span(first if before else log_time, log_time, before + 1)
        self._pending += len(data) + _MESSAGE_OVERHEAD
        if self._pending > CHUNK_SIZE:
            self.flush()

    def _add_channel(self, key: tuple[str, str], description: Description) -> None:
        type_name, encoding, definition, metadata = description
        schema = Schema(len(self._schemas) + 1, definition, encoding, type_name)
        channel = Channel(len(self._channels) + 1, key[0], 'cdr', metadata, schema.id)
        self._chunk.data += _packed(schema, channel)
        self._schemas.append(schema)
        self._channels[key] = channel
        self.counts[key] = 0

    def flush(self) -> None:
        """Hand what is pending to the operating system: from then on it outlives this process."""
        if self._pending:
            records, entry = self._chunk.records(self._stream.tell())
            self._stream.write(records)
            self._stream.check()
            self._chunks.append(entry)
            self._chunk = _Chunk()
            self._pending = 0
            self._marks.append(_Mark(self._stream.tell(), self.span, dict(self.counts)))

    def finish(self, metadata: str) -> None:
        """Write what is pending, ``metadata`` for rosbag2, the index and the end."""
        self.flush()
        record = _packed(Metadata('rosbag2', {'serialized_metadata': metadata}))
        entry = MetadataIndex(self._stream.tell(), len(record), 'rosbag2')
        self._stream.write(record + _packed(DataEnd(0)))
        self._stream.write(self._summary(self._stream.tell(), entry))

    def _summary(self, start: int, metadata: MetadataIndex) -> bytes:
        """Return all that is written from ``start`` to the end of the file."""
        channels = self._channels.values()
        counts = {self._channels[key].id: count for key, count in self.counts.items()}
        schemas, chunks, (first, last, messages) = len(self._schemas), len(self._chunks), self.span
        statistics = Statistics(0, len(channels), counts, chunks, messages, last, first, 1, schemas)
        groups: tuple[tuple[Opcode, Iterable[McapRecord]], ...] = (
            (Opcode.SCHEMA, self._schemas),
            (Opcode.CHANNEL, channels),
            (Opcode.STATISTICS, [statistics]),
            (Opcode.CHUNK_INDEX, self._chunks),
            (Opcode.ATTACHMENT_INDEX, []),
            (Opcode.METADATA_INDEX, [metadata]),
        )
        summary, offsets = b'', b''
        for opcode, records in groups:
            group = _packed(*records)
            offsets += _packed(SummaryOffset(opcode, start + len(summary), len(group)))
            summary += group
        offsets_start = start + len(summary)
        summary += offsets
        checksum = zlib.crc32(_FOOTER.pack(Opcode.FOOTER, 20, start, offsets_start), zlib.crc32(summary))
        return summary + _packed(Footer(start, offsets_start, checksum)) + MCAP0_MAGIC

    def finish_early(self) -> None:
        """After a failure: cut off what is not whole and write an end without index, for which there is always room.

        May be called again, if there was none after all, after `give_back`.
        """
        size, self.span, counts = self._marks[-1]
        self.counts = dict(counts)
        self._pending = 0
        self._stream.cut(size)
        self._stream.write(_packed(DataEnd(0), Footer(0, 0, 0)) + MCAP0_MAGIC)

    def give_back(self) -> bool:
        """Give up the newest chunk, to make room; False if there is none to give."""
        if len(self._marks) < 2:
            return False
        self._marks.pop()
        return True

    def close(self) -> None:
        """Let go of the file as it is."""
        self._stream.close()


def _packed(*records: McapRecord) -> bytes:
    builder = RecordBuilder()
    for record in records:
        record.write(builder)
    return bytes(builder.end())


class _Stream:
    """A file without a buffer of its own, to which never less than all is written without raising."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._size = 0
        self._handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o666)

    def write(self, data: bytes) -> None:
        """Write all of it."""
        view = memoryview(data)
        while view:
            try:
                written = os.pwrite(self._handle, view, self._size)
            except OSError as error:
                raise OSError(error.errno, error.strerror, str(self._path)) from None
            self._size += written
            view = view[written:]

    def tell(self) -> int:
        return self._size

    def check(self) -> None:
        if not os.fstat(self._handle).st_nlink:  # what is written to a removed file is lost without a word
            raise FileNotFoundError(errno.ENOENT, 'removed while it was written', str(self._path))

    def cut(self, size: int) -> None:
        os.ftruncate(self._handle, size)
        self._size = size

    def close(self) -> None:
        if self._handle >= 0:
            os.close(self._handle)
            self._handle = -1
