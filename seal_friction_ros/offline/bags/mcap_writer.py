"""Writer of one MCAP file (profile ``ros2``) that is valid up to its newest chunk at any time, however writing ends.

The file is byte for byte that of the writer of the ``mcap`` library, in less than half the time: the estimator waits
while Python packs.
"""

import errno
import os
import struct
import zlib
from collections import deque
from pathlib import Path
from typing import NamedTuple

from seal_friction_ros.offline.bags import mcap_records as records
from seal_friction_ros.offline.bags.mcap_records import MAGIC, Opcode

CHUNK_SIZE = 64 * 1024  # [bytes] small, so that the writing thread blocks briefly; the file does not get larger
FILE_MODE = 0o640  # of the files of a bag, less what the umask of the process forbids
_MESSAGE_OVERHEAD = 47  # [bytes] head of a message and its entry in the index
_MARKS = 4  # chunks that can be dropped to make room for the end of the file
# Heads of records (https://mcap.dev/spec), each beginning with the opcode and the length of the rest.
_MESSAGE = struct.Struct('<BQHIQQ')  # channel, sequence number, log time, publish time
_CHUNK = struct.Struct('<BQQQQIIQ')  # first and last time, size and checksum of its data, no compression, size
_MESSAGE_INDEX = struct.Struct('<BQHI')  # channel, size of what follows: log time and offset of each message
_FOOTER = struct.Struct('<BQQQ')  # beginning of summary and of its offsets; the checksum covers it up to there
_OPCODE_AND_LENGTH = 9  # [bytes]
_MESSAGE_OPCODE = int(Opcode.MESSAGE)  # a number is packed faster than a member of an enumeration


class Description(NamedTuple):
    """Description of a topic in a bag, without its name."""

    type_name: str
    definition_encoding: str
    definition: bytes
    metadata: dict[str, str]  # of the channel: type hash and QoS in the format of rosbag2


class Span(NamedTuple):
    """Range of the messages of a file."""

    first_time: int = 0  # log time of its first message [ns]
    last_time: int = 0  # log time of its last message [ns]
    messages: int = 0


class _Mark(NamedTuple):
    """End of a complete chunk."""

    size: int  # [bytes] of the file
    span: Span
    counts: dict[tuple[str, str], int]


class _Chunk:
    """Messages that are written together."""

    def __init__(self) -> None:
        self.data = bytearray()
        self.index: dict[int, list[int]] = {}
        """channel -> log time and offset of each of its messages"""
        self.first_time = self.last_time = -1
        """log times of the first and the last message [ns]"""

    def add(self, channel: int, log_time: int, publish_time: int, data: bytes) -> None:
        """Append one message."""
        self.index.setdefault(channel, []).extend((log_time, len(self.data)))
        length = _MESSAGE.size - _OPCODE_AND_LENGTH + len(data)
        self.data += _MESSAGE.pack(_MESSAGE_OPCODE, length, channel, 0, log_time, publish_time)
        self.data += data
        if self.first_time < 0:
            self.first_time = log_time
        self.last_time = log_time

    def packed(self, start: int) -> tuple[bytes, bytes]:
        """Bytes of the chunk written at offset ``start``, and its entry in the summary."""
        size, first, last = len(self.data), self.first_time, self.last_time
        length = _CHUNK.size - _OPCODE_AND_LENGTH + size
        chunk = _CHUNK.pack(Opcode.CHUNK, length, first, last, size, zlib.crc32(self.data), 0, size) + self.data
        offsets, indices = {}, b''
        for channel, entries in self.index.items():
            offsets[channel] = start + len(chunk) + len(indices)
            packed = struct.pack(f'<{len(entries)}Q', *entries)
            indices += _MESSAGE_INDEX.pack(Opcode.MESSAGE_INDEX, 6 + len(packed), channel, len(packed)) + packed
        entry = records.ChunkIndex(first, last, start, len(chunk), offsets, len(indices), size)
        return chunk + indices, records.chunk_index(entry)


class McapOutput:
    """A file being written.

    Args:
        path: Its path; must not exist.

    Raises:
        OSError: It cannot be made. Every method raises it if writing fails.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.span = Span()
        self.counts: dict[tuple[str, str], int] = {}
        """topic and type -> messages"""
        self._stream = _Stream(path)
        try:
            self._stream.write(MAGIC + records.header('ros2', 'seal_friction_ros'))
        except OSError:
            self._stream.close()
            path.unlink(missing_ok=True)
            raise
        self._numbers: dict[tuple[str, str], int] = {}  # topic and type -> channel
        self._schemas: list[bytes] = []
        self._channels: list[bytes] = []
        self._chunk = _Chunk()
        self._chunks: list[bytes] = []  # their entries in the summary
        self._pending = 0
        self._marks = deque([_Mark(self._stream.tell(), self.span, {})], maxlen=_MARKS)

    @property
    def size(self) -> int:
        """Of the file with pending messages [bytes]."""
        return self._stream.tell() + self._pending

    def write(
        self, topic: str, description: Description, log_time: int, data: bytes, publish_time: int | None = None
    ) -> None:
        """Append one message.

        Args:
            topic: Its topic.
            description: Of the topic.
            log_time: [ns] not before that of the last message.
            data: CDR.
            publish_time: [ns] on any clock; default: ``log_time``.
        """
        key = (topic, description.type_name)
        if key not in self._numbers:
            self._add_channel(key, description)
        publish_time = log_time if publish_time is None else publish_time
        self._chunk.add(self._numbers[key], log_time, publish_time, data)
        self.counts[key] += 1
        first, _, before = self.span
        self.span = Span(first if before else log_time, log_time, before + 1)
        self._pending += len(data) + _MESSAGE_OVERHEAD
        if self._pending > CHUNK_SIZE:
            self.flush()

    def _add_channel(self, key: tuple[str, str], description: Description) -> None:
        type_name, encoding, definition, metadata = description
        number = self._numbers[key] = len(self._numbers) + 1
        self._schemas.append(records.schema(records.Schema(number, type_name, encoding, definition)))
        self._channels.append(records.channel(records.Channel(number, number, key[0], 'cdr', metadata)))
        self._chunk.data += self._schemas[-1] + self._channels[-1]
        self.counts[key] = 0

    def flush(self) -> None:
        """Pass pending messages to the operating system, so that they outlive this process."""
        if self._pending:
            chunk, entry = self._chunk.packed(self._stream.tell())
            self._stream.write(chunk)
            self._stream.check()
            self._chunks.append(entry)
            self._chunk = _Chunk()
            self._pending = 0
            self._marks.append(_Mark(self._stream.tell(), self.span, dict(self.counts)))

    def finish(self, metadata: str) -> None:
        """Write pending messages, ``metadata`` for rosbag2, the index and the end of the file."""
        self.flush()
        record = records.metadata('rosbag2', {'serialized_metadata': metadata})
        entry = records.metadata_index(self._stream.tell(), len(record), 'rosbag2')
        self._stream.write(record + records.data_end())
        self._stream.write(self._summary(self._stream.tell(), entry))

    def _summary(self, start: int, metadata: bytes) -> bytes:
        """Bytes from ``start`` to the end of the file."""
        counts = {self._numbers[key]: count for key, count in self.counts.items()}
        first, last, _ = self.span
        groups = (
            (Opcode.SCHEMA, b''.join(self._schemas)),
            (Opcode.CHANNEL, b''.join(self._channels)),
            (Opcode.STATISTICS, records.statistics(first, last, len(self._schemas), len(self._chunks), 1, counts)),
            (Opcode.CHUNK_INDEX, b''.join(self._chunks)),
            (Opcode.ATTACHMENT_INDEX, b''),
            (Opcode.METADATA_INDEX, metadata),
        )
        summary, offsets = b'', b''
        for opcode, group in groups:
            offsets += records.summary_offset(opcode, start + len(summary), len(group))
            summary += group
        offsets_start = start + len(summary)
        summary += offsets
        checksum = zlib.crc32(_FOOTER.pack(Opcode.FOOTER, 20, start, offsets_start), zlib.crc32(summary))
        return summary + records.footer(start, offsets_start, checksum) + MAGIC

    def finish_early(self) -> None:
        """After a failure, cut off incomplete records and write an end of the file without index.

        If there is no room for it, call `give_back` and this method again.
        """
        size, self.span, counts = self._marks[-1]
        self.counts = dict(counts)
        self._pending = 0
        self._stream.cut(size)
        self._stream.write(records.data_end() + records.footer(0, 0, 0) + MAGIC)

    def give_back(self) -> bool:
        """Drop the newest chunk to make room; False if there is none."""
        if len(self._marks) < 2:
            return False
        self._marks.pop()
        return True

    def close(self) -> None:
        """Close the file as it is."""
        self._stream.close()


class _Stream:
    """Unbuffered file; each write is complete or raises."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._size = 0
        self._handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, FILE_MODE)

    def write(self, data: bytes) -> None:
        """Write all data."""
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
        if not os.fstat(self._handle).st_nlink:  # writes to a removed file are lost without an error
            raise FileNotFoundError(errno.ENOENT, 'removed while it was written', str(self._path))

    def cut(self, size: int) -> None:
        os.ftruncate(self._handle, size)
        self._size = size

    def close(self) -> None:
        if self._handle >= 0:
            os.close(self._handle)
            self._handle = -1
