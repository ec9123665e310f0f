"""Writer of one MCAP file (profile ``ros2``): that of the ``mcap`` library on a stream of our own.

Ours is what the library does not do: a written chunk is with the operating system at once, so that it outlives the
process; and after a failure, also on a full disk, the file ends after a complete chunk.
"""

import errno
import os
from collections import deque
from pathlib import Path
from typing import IO, Any, NamedTuple, cast

from mcap.data_stream import RecordBuilder
from mcap.records import DataEnd, Footer
from mcap.writer import MCAP0_MAGIC, CompressionType, Writer

CHUNK_SIZE = 64 * 1024  # [bytes] small, so that the writing thread blocks briefly; the file does not get larger
FILE_MODE = 0o640  # of the files of a bag, less what the umask of the process forbids
_MESSAGE_OVERHEAD = 47  # [bytes] head of a message and its entry in the index
_MARKS = 4  # chunks that can be dropped to make room for the end of the file
_BY_FLUSH_ALONE = 1 << 62  # [bytes] largest chunk for the library: `McapOutput.flush` ends each one


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


class McapOutput:
    """A file being written.

    Args:
        path: Its path; must not exist.

    Raises:
        OSError: It cannot be made. Every method raises it if writing fails.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._stream = _Stream(path)
        self._writer: Any = Writer(
            cast(IO[bytes], self._stream), chunk_size=_BY_FLUSH_ALONE, compression=CompressionType.NONE
        )
        try:
            self._writer.start('ros2', 'seal_friction_ros')
        except OSError:
            self._stream.close()
            path.unlink(missing_ok=True)
            raise
        self.counts: dict[tuple[str, str], int] = {}
        """topic and type -> messages"""
        self.first_time = self._last_time = self._pending = 0
        self._channels: dict[tuple[str, str], int] = {}  # topic and type -> number
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
        """Append one message.

        Args:
            key: Its topic and type.
            description: Of the topic.
            log_time: [ns] after that of the last message.
            data: CDR.
            publish_time: [ns] on any clock; None: ``log_time``.
        """
        channel = self._channels.get(key) or self._add_channel(key, description, log_time)
        self._writer.add_message(channel, log_time, data, log_time if publish_time is None else publish_time)
        self.counts[key] += 1
        self._last_time = log_time
        self._pending += len(data) + _MESSAGE_OVERHEAD
        if self._pending > CHUNK_SIZE:
            self.flush()

    def _add_channel(self, key: tuple[str, str], description: Description, log_time: int) -> int:
        if not self._channels:
            self.first_time = log_time
        schema = self._writer.register_schema(*description[:3])
        self._channels[key] = self._writer.register_channel(key[0], 'cdr', schema, description.metadata)
        self.counts[key] = 0
        return self._channels[key]

    def flush(self) -> None:
        """Pass pending messages to the operating system, so that they outlive this process."""
        if self._pending:
            self._writer.flush()
            self._pending = 0
            self._marks.append(self.contents)

    def finish(self, metadata: str) -> None:
        """Write pending messages, ``metadata`` for rosbag2, the index and the end of the file."""
        self.flush()
        self._writer.add_metadata('rosbag2', {'serialized_metadata': metadata})
        self._writer.finish()

    def finish_early(self) -> None:
        """After a failure, cut off incomplete records and write an end of the file without index.

        If there is no room for it, call `give_back` and this method again.
        """
        size, self.first_time, self._last_time, counts = self._marks[-1]
        self.counts, self._pending = dict(counts), 0
        end: Any = RecordBuilder()
        DataEnd(data_section_crc=0).write(end)
        Footer(summary_start=0, summary_offset_start=0, summary_crc=0).write(end)
        self._stream.cut(size)
        self._stream.write(end.end() + MCAP0_MAGIC)

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

    def flush(self) -> None:
        if not os.fstat(self._handle).st_nlink:  # writes to a removed file are lost without an error
            raise FileNotFoundError(errno.ENOENT, 'removed while it was written', str(self._path))

    def cut(self, size: int) -> None:
        os.ftruncate(self._handle, size)
        self._size = size

    def close(self) -> None:
        if self._handle >= 0:
            os.close(self._handle)
            self._handle = -1
