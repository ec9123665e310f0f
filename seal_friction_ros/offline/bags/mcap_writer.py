"""Writer of one MCAP file (profile ``ros2``) from the records of the ``mcap`` library.

Ours is what its ``Writer`` does not do:

- A written chunk is with the operating system at once, so that it outlives the process. After a failure, also on a full
  disk, the file ends after a complete chunk.
- A message is packed in one step: field by field, as there, recording takes 1.7 times the processor time. The bytes are
  the same.
"""

import errno
import os
import struct
from collections import deque
from pathlib import Path
from typing import Any, NamedTuple, cast
from zlib import crc32

from mcap import records
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.writer import MCAP0_MAGIC

from seal_friction_ros.core.messages.cdr import ENCODING

CHUNK_SIZE = 64 * 1024  # [bytes] small, so that the writing thread blocks briefly; the file does not get larger
FILE_MODE = 0o640  # of the files of a bag, less what the umask of the process forbids
_MESSAGE = struct.Struct('<BQHIQQ')  # opcode, length of the rest, channel, sequence number, log time, publish time
_MESSAGE_OPCODE, _MESSAGE_FIELDS = int(Opcode.MESSAGE), _MESSAGE.size - 9  # [bytes] without opcode and length
_MESSAGE_OVERHEAD = _MESSAGE.size + 16  # [bytes] with the entry in the index of its chunk
_MARKS = 4  # chunks that can be dropped to make room for the end of the file


class Description(NamedTuple):
    """Description of a topic in a bag, without its name."""

    type_name: str
    definition_encoding: str
    definition: bytes
    metadata: dict[str, str]  # of the channel: type hash and QoS in the format of rosbag2


class Contents(NamedTuple):
    """What a file holds."""

    size: int  # [bytes] of the file
    first_time: int  # log time of the first message [ns]; 0 without messages, like the next
    last_time: int  # log time of the last message [ns]
    counts: dict[tuple[str, str], int]  # topic and type -> messages

    @property
    def messages(self) -> int:
        """Number of all messages."""
        return sum(self.counts.values())


class _Chunk:
    """Messages that are written together."""

    def __init__(self) -> None:
        self.data = bytearray()
        self.first_time = self.last_time = 0  # log times of the first and the last message [ns]
        self._index: dict[int, list[tuple[int, int]]] = {}  # channel -> log time and offset of each of its messages

    def add(self, channel: int, log_time: int, publish_time: int, data: bytes) -> None:
        """Add a message; both times [ns]."""
        if not self._index:
            self.first_time = log_time
        self.last_time = log_time
        self._index.setdefault(channel, []).append((log_time, len(self.data)))
        length = _MESSAGE_FIELDS + len(data)
        self.data += _MESSAGE.pack(_MESSAGE_OPCODE, length, channel, 0, log_time, publish_time)
        self.data += data

    def packed(self, start: int) -> tuple[bytes, bytes]:
        """Bytes of the chunk written at offset ``start``, and its entry in the summary."""
        times = {'message_start_time': self.first_time, 'message_end_time': self.last_time}
        data, size = bytes(self.data), len(self.data)
        chunk = _packed(
            records.Chunk(**times, compression='', data=data, uncompressed_size=size, uncompressed_crc=crc32(data))
        )
        offsets = {}
        indices: Any = RecordBuilder()
        for channel, messages in self._index.items():
            offsets[channel] = start + len(chunk) + indices.count
            records.MessageIndex(channel_id=channel, records=messages).write(indices)
        entry = records.ChunkIndex(
            **times,
            chunk_start_offset=start,
            chunk_length=len(chunk),
            compression='',
            compressed_size=size,
            uncompressed_size=size,
            message_index_offsets=offsets,
            message_index_length=indices.count,
        )
        return chunk + indices.end(), _packed(entry)


def _packed(record: records.McapRecord) -> bytes:
    builder: Any = RecordBuilder()
    record.write(builder)
    return cast(bytes, builder.end())


class McapOutput:
    """A file being written at a path that must not exist. Every method raises OSError if writing fails."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._stream = _Stream(path)
        try:
            self._stream.write(MCAP0_MAGIC + _packed(records.Header('ros2', 'seal_friction_ros')))
        except OSError:
            self._stream.close()
            path.unlink(missing_ok=True)
            raise
        self.counts: dict[tuple[str, str], int] = {}  # topic and type -> messages
        self.first_time = self._last_time = self._pending = 0
        self._channels: dict[tuple[str, str], int] = {}  # topic and type -> number
        self._schema_records, self._channel_records, self._chunk_entries = list[bytes](), list[bytes](), list[bytes]()
        self._chunk = _Chunk()
        self._marks = deque([self.contents], maxlen=_MARKS)  # ends of complete chunks

    @property
    def size(self) -> int:
        """Of the file with pending messages [bytes]."""
        return self._stream.tell() + self._pending

    @property
    def contents(self) -> Contents:
        """What it holds with pending messages."""
        return Contents(self.size, self.first_time, self._last_time, dict(self.counts))

    def write(
        self, key: tuple[str, str], description: Description, log_time: int, data: bytes, publish_time: int | None
    ) -> None:
        """Append one message of a topic and type; both times in [ns], ``publish_time`` None: ``log_time``."""
        channel = self._channels.get(key) or self._add_channel(key, description, log_time)
        self._chunk.add(channel, log_time, log_time if publish_time is None else publish_time, data)
        self.counts[key] += 1
        self._last_time = log_time
        self._pending += len(data) + _MESSAGE_OVERHEAD
        if self._pending > CHUNK_SIZE:
            self.flush()

    def _add_channel(self, key: tuple[str, str], description: Description, log_time: int) -> int:
        if not self._channels:
            self.first_time = log_time
        number = self._channels[key] = len(self._channels) + 1
        type_name, encoding, definition, metadata = description
        schema = records.Schema(id=number, name=type_name, encoding=encoding, data=definition)
        channel = records.Channel(
            id=number, schema_id=number, topic=key[0], message_encoding=ENCODING, metadata=metadata
        )
        self._schema_records.append(_packed(schema))
        self._channel_records.append(_packed(channel))
        self._chunk.data += self._schema_records[-1] + self._channel_records[-1]
        self.counts[key] = 0
        return number

    def flush(self) -> None:
        """Pass pending messages to the operating system, so that they outlive this process."""
        if self._pending:
            chunk, entry = self._chunk.packed(self._stream.tell())
            self._stream.write(chunk)
            self._stream.check()
            self._chunk_entries.append(entry)
            self._chunk, self._pending = _Chunk(), 0
            self._marks.append(self.contents)

    def finish(self, metadata: str) -> None:
        """Write pending messages, ``metadata`` for rosbag2, the index and the end of the file."""
        self.flush()
        record = _packed(records.Metadata('rosbag2', {'serialized_metadata': metadata}))
        place = records.MetadataIndex(offset=self._stream.tell(), length=len(record), name='rosbag2')
        self._stream.write(record + _packed(records.DataEnd(data_section_crc=0)))
        self._stream.write(self._summary(self._stream.tell(), _packed(place)))

    def _summary(self, start: int, metadata: bytes) -> bytes:
        """Bytes from ``start`` to the end of the file."""
        groups = {
            Opcode.SCHEMA: b''.join(self._schema_records),
            Opcode.CHANNEL: b''.join(self._channel_records),
            Opcode.STATISTICS: _packed(self._statistics()),
            Opcode.CHUNK_INDEX: b''.join(self._chunk_entries),
            Opcode.ATTACHMENT_INDEX: b'',
            Opcode.METADATA_INDEX: metadata,
        }
        summary, offsets = b'', b''
        for opcode, group in groups.items():
            place = records.SummaryOffset(
                group_opcode=opcode, group_start=start + len(summary), group_length=len(group)
            )
            offsets += _packed(place)
            summary += group
        footer = records.Footer(summary_start=start, summary_offset_start=start + len(summary), summary_crc=0)
        footer.summary_crc = crc32(_packed(footer)[:-4], crc32(summary + offsets))
        return summary + offsets + _packed(footer) + MCAP0_MAGIC

    def _statistics(self) -> records.Statistics:
        return records.Statistics(
            message_count=sum(self.counts.values()),
            channel_message_counts={self._channels[key]: count for key, count in self.counts.items()},
            message_start_time=self.first_time,
            message_end_time=self._last_time,
            schema_count=len(self._schema_records),
            channel_count=len(self._channel_records),
            chunk_count=len(self._chunk_entries),
            metadata_count=1,
            attachment_count=0,
        )

    def finish_early(self) -> None:
        """After a failure, cut off incomplete records and write an end of the file without index.

        If there is no room for it, call `give_back` and this method again.
        """
        size, self.first_time, self._last_time, counts = self._marks[-1]
        self.counts, self._pending = dict(counts), 0
        self._stream.cut(size)
        footer = records.Footer(summary_start=0, summary_offset_start=0, summary_crc=0)
        self._stream.write(_packed(records.DataEnd(data_section_crc=0)) + _packed(footer) + MCAP0_MAGIC)

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
        """Append bytes; OSError with the path if the disk does not take all of them."""
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
