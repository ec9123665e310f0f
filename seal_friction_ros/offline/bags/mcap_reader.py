"""One MCAP file, read as a stranger's: memory is bounded whatever the file claims, and damage is found and placed.

The libraries take a file at its word (a chunk of 1 TB, a kilobyte that unfolds to gigabytes), so the walk over records
is our own; what stands in the record of a schema, a channel or a statistic is left to the library.

Layout: https://mcap.dev/spec.
"""

import heapq
import os
import struct
import zlib
from array import array
from collections.abc import Callable, Iterator, Sequence
from io import BytesIO
from typing import BinaryIO, NamedTuple

import lz4.frame
import zstandard
from mcap import records
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode

MAGIC = b'\x89MCAP0\r\n'
LARGEST_CHUNK = 1 << 25  # [bytes] packed or not, and of any other record that is read; rosbag2 makes chunks of 0.8 MB
MOST_AT_ONCE = 2 * LARGEST_CHUNK  # [bytes] of chunks that overlap in time
_MOST_BLOCKS = 500_000  # 30 GB of our own chunks
_BLOCK_SIZE = 1 << 20  # [bytes] messages outside of chunks are read in such portions
_LONGEST_NAME = 1024  # characters of a topic or a type; ROS has 255
LAST_TIME = 1 << 62  # [ns] in the year 2116
NO_TIME = (1 << 64) - 1  # [ns] first log time of a block without messages

RECORD = struct.Struct('<BQ')  # opcode, length
_CHUNK = struct.Struct('<QQQII')  # first and last log time, unpacked size, checksum, length of the compression's name
_MESSAGE = struct.Struct('<BQHIQQ')  # opcode, length, channel, sequence, log time, publish time
_SIZE = struct.Struct('<Q')
_SHORT = 'a record is shorter than what it claims to hold'  # the library says nothing
ERRORS = (ValueError, McapError, struct.error, EOFError, RuntimeError, zstandard.ZstdError)  # RuntimeError: of lz4


class Channel(NamedTuple):
    """A topic as the file describes it."""

    topic: str
    type_name: str
    encoding: str
    """of its messages; ``cdr`` for ROS 2"""
    definition_encoding: str
    definition: bytes
    metadata: dict[str, str]


class Message(NamedTuple):
    """One message, still serialised."""

    channel: Channel
    log_time: int
    """[ns]"""
    data: bytes


class Block(NamedTuple):
    """A stretch of the file with records of messages: what is in a chunk, or neighbours outside of chunks."""

    offset: int
    """[bytes] where it begins in the file"""
    size: int
    """[bytes] as stored"""
    first: int
    """smallest log time in it [ns]"""
    last: int
    """largest log time in it [ns]"""
    unpacked_size: int
    """[bytes]"""
    checksum: int = 0
    """CRC-32 of what is unpacked; 0 if not known"""
    compression: str = ''
    fault: str = ''
    """why it cannot be read; empty if nothing is known against it"""


class Layout(NamedTuple):
    """Where things are in a file."""

    blocks: tuple[Block, ...]
    channels: dict[int, Channel]
    """those repeated at the end of the file"""
    counts: dict[int, int]
    """messages of each channel, as the end of the file claims; empty if it does not"""
    damage: str
    """what is wrong with the file from `sound_size` on; empty if it is finished"""
    sound_size: int
    """[bytes] of whole records"""


def scan(file: BinaryIO) -> Layout:
    """Walk over the records of a file, passing over what is in them; of a damaged file, as far as it goes."""
    walk = _Walk(file)
    damage = ''
    try:
        walk.to_the_end()
    except ERRORS as error:
        damage = str(error) or _SHORT
    walk.finish_bare()
    return Layout(tuple(walk.blocks), walk.names.channels, walk.counts, damage, walk.position)


def scan_finished(file: BinaryIO) -> Layout:
    """Walk over the records of a file that has to be whole.

    Raises:
        ValueError: It is not; says what to do.
    """
    layout = scan(file)
    if layout.damage:
        raise ValueError(f'{layout.damage}: seal_friction recover makes a bag of what is sound')
    return layout


class _Walk:
    """State of a `scan`."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self._size = os.fstat(file.fileno()).st_size
        self._bare: Block | None = None
        self._in_summary = False
        self.blocks: list[Block] = []
        self.names = Names()
        self.counts: dict[int, int] = {}
        self.position = 0

    def to_the_end(self) -> None:
        """Walk until the end of a finished file.

        Raises:
            ValueError: It is not finished, or no MCAP file; `position` is where that was found.
        """
        if self._read(0, len(MAGIC)) != MAGIC:
            raise ValueError('it does not begin as an MCAP file does')
        self.position, opcode = len(MAGIC), 0
        while opcode != Opcode.FOOTER:
            head = self._read(self.position, RECORD.size)
            opcode, length = RECORD.unpack(head) if len(head) == RECORD.size else (0, self._size)
            end = self.position + RECORD.size + length
            if end > self._size:
                raise ValueError(f'it was not finished, or truncated: no whole record at byte {self.position}')
            self._take(opcode, length)
            self.position = end
        if self._read(self.position, len(MAGIC) + 1) != MAGIC:
            raise ValueError(f'what stands at byte {self.position} is no end of an MCAP file')

    def finish_bare(self) -> None:
        """Close the block of neighbours outside of chunks."""
        if self._bare is not None:
            size = self._bare.unpacked_size
            fault = _too_large(size) if size > LARGEST_CHUNK else ''
            self.blocks.append(self._bare._replace(size=size, fault=fault))
            self._bare = None

    def _take(self, opcode: int, length: int) -> None:
        content = self.position + RECORD.size
        if opcode in OF_MESSAGES and not self._in_summary:
            self._extend_bare(opcode, length)
            return
        self.finish_bare()
        if opcode == Opcode.CHUNK:
            self._chunk(content, length)
        elif opcode == Opcode.DATA_END:
            self._in_summary = True
        elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            self.names.learn(opcode, self._whole(content, length))
        elif opcode == Opcode.STATISTICS:
            statistics = records.Statistics.read(_stream(self._whole(content, length)))
            self.counts = dict(statistics.channel_message_counts)
        if len(self.blocks) > _MOST_BLOCKS:
            raise ValueError(f'more than {_MOST_BLOCKS} chunks: split the file')

    def _extend_bare(self, opcode: int, length: int) -> None:
        if self._bare is None or self._bare.unpacked_size > _BLOCK_SIZE:
            self.finish_bare()
            self._bare = Block(self.position, 0, NO_TIME, 0, 0)
        bare = self._bare
        time_range = (bare.first, bare.last)
        if opcode == Opcode.MESSAGE:
            head = self._read(self.position, _MESSAGE.size)
            time = _MESSAGE.unpack(head)[4]
            time_range = (min(bare.first, time), max(bare.last, time))
        size = bare.unpacked_size + RECORD.size + length
        self._bare = bare._replace(first=time_range[0], last=time_range[1], unpacked_size=size)

    def _chunk(self, offset: int, length: int) -> None:
        head = self._read(offset, min(length, _CHUNK.size + 16 + _SIZE.size))
        first, last, unpacked_size, checksum, name_length = _CHUNK.unpack_from(head)
        start = _CHUNK.size + name_length
        if start + _SIZE.size > len(head):
            self.blocks.append(Block(offset, length, first, last, 0, fault='its compression has no sensible name'))
            return
        compression = head[_CHUNK.size : start].decode('ascii', 'replace')
        (size,) = _SIZE.unpack_from(head, start)
        start += _SIZE.size
        fault = ''
        if size != length - start:
            fault = f'it claims {size} bytes in a record of {length}'
        elif compression not in _UNPACKERS:
            fault = f'compressed by {compression!r}, not by zstd or lz4'
        elif max(size, unpacked_size) > LARGEST_CHUNK:
            fault = _too_large(max(size, unpacked_size))
        if unpacked_size or fault:
            self.blocks.append(
                Block(offset + start, length - start, first, last, unpacked_size, checksum, compression, fault)
            )

    def _whole(self, offset: int, length: int) -> bytes:
        if length > LARGEST_CHUNK:
            raise ValueError(f'record at byte {offset}: {_too_large(length)}')
        return self._read(offset, length)

    def _read(self, offset: int, size: int) -> bytes:
        self._file.seek(offset)
        return self._file.read(size)


OF_MESSAGES = (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE)


def _too_large(size: int) -> str:
    return f'{size} bytes, and at most {LARGEST_CHUNK >> 20} MiB are taken: write it anew with smaller chunks'


def _stream(data: bytes) -> ReadDataStream:
    return ReadDataStream(BytesIO(data))


class Names:
    """What is known of schemas and channels."""

    def __init__(self, channels: dict[int, Channel] | None = None) -> None:
        self._schemas: dict[int, records.Schema] = {0: records.Schema(id=0, data=b'', encoding='', name='')}
        self._sizes: dict[tuple[int, int], int] = {}
        self._size = 0
        self.channels = dict(channels or {})

    def learn(self, opcode: int, data: bytes) -> None:
        """Take the record of a schema or a channel.

        Raises:
            ValueError: It makes no sense, or a name in it is not one line of sensible length.
        """
        if opcode == Opcode.SCHEMA:
            schema = records.Schema.read(_stream(data))
            _check_name('type', schema.name)
            self._count(opcode, schema.id, len(data))
            self._schemas[schema.id] = schema
            return
        channel = records.Channel.read(_stream(data))
        _check_name('topic', channel.topic)
        self._count(opcode, channel.id, len(data))
        schema = self._schemas.get(channel.schema_id)
        if schema is None:
            raise ValueError(f'{channel.topic} is of a type that the file does not describe')
        self.channels[channel.id] = Channel(
            channel.topic, schema.name, channel.message_encoding, schema.encoding, schema.data, channel.metadata
        )

    def _count(self, opcode: int, number: int, size: int) -> None:
        self._size += size - self._sizes.get((opcode, number), 0)
        self._sizes[opcode, number] = size
        if self._size > LARGEST_CHUNK:
            raise ValueError(f'descriptions of types and topics: {_too_large(self._size)}')


def _check_name(kind: str, name: str) -> None:
    if not name.isprintable() or len(name) > _LONGEST_NAME:
        raise ValueError(f'{name[:40]!r} is no name of a {kind}')


def messages(file: BinaryIO, layout: Layout, on_fault: Callable[[Block, str], None] | None = None) -> Iterator[Message]:
    """Messages of a file in order of log time; equal times in the order of the file.

    Args:
        file: The file.
        layout: From `scan`.
        on_fault: Called with each block that cannot be read, and the reason; if None, that is an error.

    Raises:
        ValueError: A block cannot be read, or too many overlap in time.
    """
    names = Names(layout.channels)
    blocks: Sequence[Block] = layout.blocks
    if names.channels:  # else each channel has to be met before its messages
        blocks = sorted(blocks, key=lambda block: block.first)
    earliest = earliest_times(blocks)
    heap: list[tuple[int, int, int, _Contents, Iterator[int]]] = []
    at_once = upcoming = 0
    while heap or upcoming < len(blocks):
        if upcoming < len(blocks) and (not heap or earliest[upcoming] <= heap[0][0]):
            contents = _contents(file, blocks[upcoming], names, on_fault)
            numbers = iter(contents.by_time())
            number = next(numbers, None)
            if number is not None:
                heapq.heappush(heap, (contents.times[number], upcoming, number, contents, numbers))
                at_once += len(contents.data)
            if at_once > MOST_AT_ONCE:
                raise ValueError(f'chunks of more than {MOST_AT_ONCE >> 20} MiB overlap in time: sort it first')
            upcoming += 1
            continue
        _, place, number, contents, numbers = heap[0]
        yield contents.message(number, names.channels)
        following = next(numbers, None)
        if following is None:
            heapq.heappop(heap)
            at_once -= len(contents.data)
        else:
            heapq.heapreplace(heap, (contents.times[following], place, following, contents, numbers))


def earliest_times(blocks: Sequence[Block]) -> 'array[int]':
    """Smallest log time [ns] in each block and all that follow it."""
    earliest = array('Q', [block.first for block in blocks])
    for place in reversed(range(len(earliest) - 1)):
        earliest[place] = min(earliest[place], earliest[place + 1])
    return earliest


class _Contents(NamedTuple):
    """What is in a block, and where its messages are."""

    data: bytes
    times: 'array[int]'
    """log time of each message [ns]"""
    offsets: 'array[int]'

    def by_time(self) -> Sequence[int]:
        """Numbers of the messages in order of log time."""
        numbers, times = range(len(self.times)), self.times
        if all(times[number - 1] <= times[number] for number in numbers[1:]):
            return numbers
        return sorted(numbers, key=times.__getitem__)

    def message(self, number: int, channels: dict[int, Channel]) -> Message:
        """One message."""
        offset = self.offsets[number]
        _, length, channel, _, log_time, _ = _MESSAGE.unpack_from(self.data, offset)
        return Message(channels[channel], log_time, self.data[offset + _MESSAGE.size : offset + RECORD.size + length])


_NOTHING = _Contents(b'', array('Q'), array('Q'))


def _contents(file: BinaryIO, block: Block, names: Names, on_fault: Callable[[Block, str], None] | None) -> _Contents:
    try:
        return _indexed(unpacked(file, block), block, names)
    except ERRORS as error:
        reason = str(error) or _SHORT
        if on_fault is None:
            raise ValueError(f'chunk at byte {block.offset}: {reason}') from None
        on_fault(block, reason)
        return _NOTHING


def unpacked(file: BinaryIO, block: Block) -> bytes:
    """Records of a block, as large as it claims and with the right checksum.

    Raises:
        ValueError: It cannot be read (or another of `ERRORS`).
    """
    if block.fault:
        raise ValueError(block.fault)
    file.seek(block.offset)
    data = _UNPACKERS[block.compression](file.read(block.size), block.unpacked_size)
    if len(data) != block.unpacked_size:
        raise ValueError(f'it does not unfold to the {block.unpacked_size} bytes that it claims')
    if block.checksum and zlib.crc32(data) != block.checksum:
        raise ValueError('its checksum is wrong')
    return data


def _indexed(data: bytes, block: Block, names: Names) -> _Contents:
    times, offsets = array('Q'), array('Q')
    offset = 0
    while offset < len(data):
        opcode, length = RECORD.unpack_from(data, offset)
        end = offset + RECORD.size + length
        if end > len(data):
            raise ValueError(f'a record of {length} bytes reaches beyond its end')
        if opcode == Opcode.MESSAGE:
            _, length, channel, _, log_time, _ = _MESSAGE.unpack_from(data, offset)
            if length < _MESSAGE.size - RECORD.size or channel not in names.channels:
                raise ValueError(f'a message of {length} bytes on channel {channel} makes no sense')
            if not block.first <= log_time <= block.last or log_time > LAST_TIME:
                raise ValueError(f'a message at {log_time} ns is not within the times that it claims')
            times.append(log_time)
            offsets.append(offset)
        elif opcode in OF_MESSAGES:
            names.learn(opcode, data[offset + RECORD.size : end])
        offset = end
    return _Contents(data, times, offsets)


def unpack_zstd(data: bytes, size: int) -> bytes:
    """Unpack at most ``size + 1`` bytes.

    Raises:
        zstandard.ZstdError: The data are no zstd frame, or one of a window above `LARGEST_CHUNK`.
    """
    parts, wanted = [], size + 1
    with zstandard.ZstdDecompressor(max_window_size=LARGEST_CHUNK).stream_reader(data) as reader:
        while wanted > 0 and (part := reader.read(wanted)):
            parts.append(part)
            wanted -= len(part)
    return b''.join(parts)


def _unpack_lz4(data: bytes, size: int) -> bytes:
    unpacked: bytes = lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=size + 1)
    return unpacked


_UNPACKERS: dict[str, Callable[[bytes, int], bytes]] = {
    '': lambda data, size: data[: size + 1],
    'zstd': unpack_zstd,
    'lz4': _unpack_lz4,
}
