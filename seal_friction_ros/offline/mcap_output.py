"""One MCAP file (profile ``ros2``) that is whole up to its newest chunk at any moment, whatever stops the writing."""

import errno
import os
from collections import deque
from pathlib import Path
from typing import IO, Any, NamedTuple, cast

from mcap.data_stream import RecordBuilder
from mcap.records import DataEnd, Footer
from mcap.writer import MCAP0_MAGIC, CompressionType, Writer

CHUNK_SIZE = 64 * 1024  # [bytes] small chunks keep the writing thread short; the file is no larger for it
_MESSAGE_OVERHEAD = 47  # [bytes] head of a message and its entry in the index
_MARKS = 4  # chunks that can be given back to make room for the end of the file
_NEVER = 1 << 62  # [bytes]


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
        self._writer = Writer(cast(IO[Any], self._stream), _NEVER, CompressionType.NONE)  # a chunk ends in `flush` only
        try:
            self._writer.start(profile='ros2', library='seal_friction_ros')
        except OSError:
            self._stream.close()
            path.unlink(missing_ok=True)
            raise
        self._channels: dict[tuple[str, str], int] = {}
        self._pending = 0
        self._marks = deque([_Mark(self._stream.tell(), self.span, {})], maxlen=_MARKS)

    @property
    def size(self) -> int:
        """Of the file, once what is pending is written [bytes]."""
        return self._stream.tell() + self._pending

    def write(self, topic: str, description: Description, log_time: int, data: bytes) -> None:
        """Append one message, ``log_time`` in ns."""
        key = (topic, description.type_name)
        if key not in self._channels:
            self._channels[key] = self._add_channel(topic, description)
            self.counts[key] = 0
        self._writer.add_message(self._channels[key], log_time, data, publish_time=log_time)
        self.counts[key] += 1
        first, _, before = self.span
        self.span = Span(first if before else log_time, log_time, before + 1)
        self._pending += len(data) + _MESSAGE_OVERHEAD
        if self._pending > CHUNK_SIZE:
            self.flush()

    def _add_channel(self, topic: str, description: Description) -> int:
        type_name, encoding, definition, metadata = description
        schema = self._writer.register_schema(type_name, encoding, definition)
        return self._writer.register_channel(topic, 'cdr', schema, metadata)

    def flush(self) -> None:
        """Hand what is pending to the operating system: from then on it outlives this process."""
        if self._pending:
            self._writer.flush()
            self._pending = 0
            self._marks.append(_Mark(self._stream.tell(), self.span, dict(self.counts)))

    def finish(self, metadata: str) -> None:
        """Write what is pending, ``metadata`` for rosbag2, the index and the end."""
        self.flush()
        self._writer.add_metadata('rosbag2', {'serialized_metadata': metadata})
        self._writer.finish()

    def finish_early(self) -> None:
        """After a failure: cut off what is not whole and write an end without index, for which there is always room.

        May be called again, if there was none after all, after `give_back`.
        """
        size, self.span, counts = self._marks[-1]
        self.counts = dict(counts)
        self._pending = 0
        self._stream.cut(size)
        ending = RecordBuilder()
        DataEnd(0).write(ending)
        Footer(0, 0, 0).write(ending)
        self._stream.write(ending.end() + MCAP0_MAGIC)

    def give_back(self) -> bool:
        """Give up the newest chunk, to make room; False if there is none to give."""
        if len(self._marks) < 2:
            return False
        self._marks.pop()
        return True

    def close(self) -> None:
        """Let go of the file as it is."""
        self._stream.close()


class _Stream:
    """What the library writes to: without a buffer of its own, and never less than all without raising."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._size = 0
        self._handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o666)

    def write(self, data: bytes) -> int:
        """Write all of it, as the library expects of a file."""
        view = memoryview(data)
        while view:
            try:
                written = os.pwrite(self._handle, view, self._size)
            except OSError as error:
                raise OSError(error.errno, error.strerror, str(self._path)) from None
            self._size += written
            view = view[written:]
        return len(data)

    def tell(self) -> int:
        return self._size

    def flush(self) -> None:
        if not os.fstat(self._handle).st_nlink:  # what is written to a removed file is lost without a word
            raise FileNotFoundError(errno.ENOENT, 'removed while it was written', str(self._path))

    def cut(self, size: int) -> None:
        os.ftruncate(self._handle, size)
        self._size = size

    def close(self) -> None:
        if self._handle >= 0:
            os.close(self._handle)
            self._handle = -1
