"""Reader of one untrusted MCAP file: memory is bounded whatever sizes the file claims, and damage is located.

The libraries trust the sizes in a file (a chunk of 1 TB, a kilobyte that unpacks to gigabytes), so this module walks
over the records itself.

Layout: https://mcap.dev/spec.
"""

import heapq
import os
import shutil
import struct
import zlib
from array import array
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import NamedTemporaryFile
from typing import BinaryIO, NamedTuple

from seal_friction_ros.offline.bags import mcap_records
from seal_friction_ros.offline.bags.mcap_records import MAGIC, TOO_SHORT, Opcode
from seal_friction_ros.packages import needed

FREE_SPACE = 1 << 30  # [bytes] that stay free on the disk where a file is unpacked (our choice)
_UNPACKED_AT_ONCE = 1 << 22  # [bytes]
LARGEST_CHUNK = 1 << 25  # [bytes] packed or unpacked, and of any other record; rosbag2 writes chunks of 0.8 MB
MOST_AT_ONCE = 2 * LARGEST_CHUNK  # [bytes] of chunks that overlap in time
_MOST_BLOCKS = 500_000  # 30 GB in chunks of `mcap_writer`
_BLOCK_SIZE = 1 << 20  # [bytes] read at a time of messages outside of chunks
_LONGEST_NAME = 1024  # characters of a topic or a type; ROS has 255
LAST_TIME = 1 << 62  # [ns] in the year 2116
NO_TIME = (1 << 64) - 1  # [ns] first log time of a block without messages

RECORD = struct.Struct('<BQ')  # opcode, length
_CHUNK = struct.Struct('<QQQII')  # first and last log time, unpacked size, checksum, length of the compression's name
_MESSAGE = struct.Struct('<BQHIQQ')  # opcode, length, channel, sequence, log time, publish time
_SIZE = struct.Struct('<Q')
_INDEX = struct.Struct('<HI')  # channel, size of what follows: the entries
_INDEX_ENTRY = struct.Struct('<QQ')  # log time, offset in the chunk
ERRORS = (ValueError, struct.error)


class Channel(NamedTuple):
    """Description of a topic in the file."""

    topic: str
    type_name: str
    encoding: str  # of its messages; ``cdr`` for ROS 2
    definition_encoding: str
    definition: bytes
    metadata: dict[str, str]


class Message(NamedTuple):
    """One serialised message."""

    channel: Channel
    log_time: int  # [ns]
    publish_time: int  # [ns]
    data: bytes


class Block(NamedTuple):
    """Part of the file with records of messages: a chunk, or consecutive records outside of chunks."""

    offset: int  # [bytes] of its beginning in the file
    size: int  # [bytes] as stored
    first: int  # smallest log time in it [ns]
    last: int  # largest log time in it [ns]
    unpacked_size: int  # [bytes]
    checksum: int = 0  # CRC-32 of the unpacked data; 0 if unknown
    compression: str = ''
    fault: str = ''  # reason why it cannot be read; empty if none is known


class Layout(NamedTuple):
    """Structure of a file."""

    blocks: tuple[Block, ...]
    channels: dict[int, Channel]  # those repeated at the end of the file
    counts: dict[int, int]  # messages of each channel, by the statistics of the file; empty if it has none
    damage: str  # fault of the file from `sound_size` on; empty if it is finished
    sound_size: int  # [bytes] of complete records


def scan(file: BinaryIO) -> Layout:
    """Walk over the records of a file without reading their contents; in a damaged file, up to the damage."""
    walk = _Walk(file)
    damage = ''
    try:
        walk.to_the_end()
    except ERRORS as error:
        damage = TOO_SHORT if isinstance(error, struct.error) else str(error)
    walk.finish_bare()
    return Layout(tuple(walk.blocks), walk.names.channels, walk.counts, damage, walk.position)


def scan_finished(file: BinaryIO) -> Layout:
    """Walk over the records of a finished file.

    Raises:
        ValueError: It is damaged or unfinished; says what to do.
    """
    layout = scan(file)
    if layout.damage:
        raise ValueError(f'{layout.damage}: use seal_friction recover')
    return layout


def indexed_times(file: BinaryIO, channels: Collection[int]) -> list[int]:
    """Log times [ns] of the messages of some channels of a finished file, in order, by the index of its chunks.

    Nothing of the messages is read, so the index is believed. Without an index there are none.
    """
    times: list[int] = []
    position, opcode = len(MAGIC), 0
    while opcode != Opcode.DATA_END:
        file.seek(position)
        head = file.read(RECORD.size + _INDEX.size)
        if len(head) < RECORD.size:
            break
        opcode, length = RECORD.unpack_from(head)
        position += RECORD.size + length
        if opcode == Opcode.MESSAGE_INDEX and len(head) == RECORD.size + _INDEX.size:
            channel, size = _INDEX.unpack_from(head, RECORD.size)
            if channel in channels and size == length - _INDEX.size <= LARGEST_CHUNK:
                times += [time for time, _ in _INDEX_ENTRY.iter_unpack(file.read(size - size % _INDEX_ENTRY.size))]
    return sorted(times)


class _Walk:
    """State of `scan`."""

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
            ValueError: It is unfinished or not an MCAP file; `position` is that of the fault.
        """
        if self._read(0, len(MAGIC)) != MAGIC:
            raise ValueError('it does not begin like an MCAP file')
        self.position, opcode = len(MAGIC), 0
        while opcode != Opcode.FOOTER:
            head = self._read(self.position, RECORD.size)
            opcode, length = RECORD.unpack(head) if len(head) == RECORD.size else (0, self._size)
            end = self.position + RECORD.size + length
            if end > self._size:
                raise ValueError(f'it was not finished, or truncated: no complete record at byte {self.position}')
            self._take(opcode, length)
            self.position = end
        if self._read(self.position, len(MAGIC) + 1) != MAGIC:
            raise ValueError(f'no end of an MCAP file at byte {self.position}')

    def finish_bare(self) -> None:
        """Complete the block of records outside of chunks."""
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
            self.counts = mcap_records.parse_message_counts(self._whole(content, length))
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
    return f'{size} bytes, at most {LARGEST_CHUNK >> 20} MiB are allowed: write the file again with smaller chunks'


class Names:
    """Schemas and channels by number."""

    def __init__(self, channels: dict[int, Channel] | None = None) -> None:
        self._schemas = {0: mcap_records.Schema(0, '', '', b'')}
        self._sizes: dict[tuple[int, int], int] = {}
        self._size = 0
        self.channels = dict(channels or {})

    def learn(self, opcode: int, data: bytes) -> None:
        """Add the record of a schema or a channel.

        Raises:
            ValueError: It is invalid, or a name in it is too long or not printable.
        """
        if opcode == Opcode.SCHEMA:
            schema = mcap_records.parse_schema(data)
            _check_name('type', schema.name)
            self._count(opcode, schema.number, len(data))
            self._schemas[schema.number] = schema
            return
        number, of_schema, topic, encoding, metadata = mcap_records.parse_channel(data)
        _check_name('topic', topic)
        self._count(opcode, number, len(data))
        known = self._schemas.get(of_schema)
        if known is None:
            raise ValueError(f'{topic} has a type without description in the file')
        self.channels[number] = Channel(topic, known.name, encoding, known.encoding, known.data, dict(metadata))

    def _count(self, opcode: int, number: int, size: int) -> None:
        self._size += size - self._sizes.get((opcode, number), 0)
        self._sizes[opcode, number] = size
        if self._size > LARGEST_CHUNK:
            raise ValueError(f'descriptions of types and topics: {_too_large(self._size)}')


def _check_name(kind: str, name: str) -> None:
    if not name.isprintable() or len(name) > _LONGEST_NAME:
        raise ValueError(f'{name[:40]!r} is not a valid name of a {kind}')


def file_messages(path: Path) -> Iterator[tuple[str, str, int, bytes, int]]:
    """Topic, message type, log time [ns], bytes and publish time [ns] of each message of a finished file.

    In order of log time.

    Raises:
        ValueError: The file is not finished, or a block cannot be read.
    """
    with path.open('rb') as file:
        for channel, log_time, publish_time, data in messages(file, scan_finished(file)):
            yield channel.topic, channel.type_name, log_time, data, publish_time


def file_topics(path: Path) -> Iterator[tuple[str, str, int]]:
    """Name, message type and number of messages of each topic, from the index of the file if it has one.

    Raises:
        ValueError: As `file_messages`.
    """
    with path.open('rb') as file:
        layout = scan_finished(file)
        if layout.channels and layout.counts:
            for number, channel in layout.channels.items():
                yield channel.topic, channel.type_name, layout.counts.get(number, 0)
        else:
            for message in messages(file, layout):
                yield message.channel.topic, message.channel.type_name, 1


def file_definitions(path: Path) -> Iterator[tuple[str, str, str]]:
    """Message type, encoding and text of each definition of a finished file; a type may come several times.

    Raises:
        ValueError: As `file_messages`.
    """
    with path.open('rb') as file:
        layout = scan_finished(file)
        channels = layout.channels.values() if layout.channels else (m.channel for m in messages(file, layout))
        seen = set()
        for channel in channels:
            if channel.type_name not in seen:
                seen.add(channel.type_name)
                yield channel.type_name, channel.definition_encoding, channel.definition.decode(errors='replace')


def messages(file: BinaryIO, layout: Layout, on_fault: Callable[[Block, str], None] | None = None) -> Iterator[Message]:
    """Messages of a file in order of log time; equal times in the order of the file.

    Args:
        file: The file.
        layout: From `scan`.
        on_fault: Called with each unreadable block and the reason; if None, such a block is an error.

    Raises:
        ValueError: A block cannot be read, or too many overlap in time.
    """
    names = Names(layout.channels)
    blocks: Sequence[Block] = layout.blocks
    if names.channels:  # else blocks stay in file order: channels are described before their messages
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
    """Smallest log time [ns] in each block and all following ones."""
    earliest = array('Q', [block.first for block in blocks])
    for place in reversed(range(len(earliest) - 1)):
        earliest[place] = min(earliest[place], earliest[place + 1])
    return earliest


class _Contents(NamedTuple):
    """Data of a block, and positions of its messages."""

    data: bytes
    times: 'array[int]'  # log time of each message [ns]
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
        _, length, channel, _, log_time, publish_time = _MESSAGE.unpack_from(self.data, offset)
        data = self.data[offset + _MESSAGE.size : offset + RECORD.size + length]
        return Message(channels[channel], log_time, publish_time, data)


_NOTHING = _Contents(b'', array('Q'), array('Q'))


def _contents(file: BinaryIO, block: Block, names: Names, on_fault: Callable[[Block, str], None] | None) -> _Contents:
    try:
        return _indexed(unpacked(file, block), block, names)
    except ERRORS as error:
        reason = TOO_SHORT if isinstance(error, struct.error) else str(error)
        if on_fault is None:
            raise ValueError(f'chunk at byte {block.offset}: {reason}') from None
        on_fault(block, reason)
        return _NOTHING


def unpacked(file: BinaryIO, block: Block) -> bytes:
    """Records of a block, of the claimed size and checksum.

    Raises:
        ValueError: It cannot be read (or another error in `ERRORS`).
    """
    if block.fault:
        raise ValueError(block.fault)
    file.seek(block.offset)
    data = _UNPACKERS[block.compression](file.read(block.size), block.unpacked_size)
    if len(data) != block.unpacked_size:
        raise ValueError(f'it does not unpack to the claimed {block.unpacked_size} bytes')
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
                raise ValueError(f'a message of {length} bytes on channel {channel} is invalid')
            if not block.first <= log_time <= block.last or log_time > LAST_TIME:
                raise ValueError(f'a message at {log_time} ns is outside its claimed range of times')
            times.append(log_time)
            offsets.append(offset)
        elif opcode in OF_MESSAGES:
            names.learn(opcode, data[offset + RECORD.size : end])
        offset = end
    return _Contents(data, times, offsets)


def unpack_zstd(data: bytes, size: int) -> bytes:
    """Unpack at most ``size + 1`` bytes.

    Raises:
        ValueError: The data are no zstd frame, its window is above `LARGEST_CHUNK`, or the package is not installed.
    """
    zstandard = needed('zstandard')
    parts, wanted = [], size + 1
    try:
        with zstandard.ZstdDecompressor(max_window_size=LARGEST_CHUNK).stream_reader(data) as reader:
            while wanted > 0 and (part := reader.read(wanted)):
                parts.append(part)
                wanted -= len(part)
    except zstandard.ZstdError as error:
        raise ValueError(str(error)) from None
    return b''.join(parts)


@contextmanager
def unpacked_file(path: Path) -> Iterator[Path]:
    """A zstd file unpacked to a temporary file (in the folder TMPDIR), which is removed at the end.

    Raises:
        ValueError: It is not a zstd file, its window is above `LARGEST_CHUNK`, zstandard is not installed, or unpacking
            it would leave less than `FREE_SPACE` on the disk.
    """
    zstandard = needed('zstandard')
    with path.open('rb') as packed, NamedTemporaryFile(prefix='seal_friction_', suffix=path.stem) as file:
        try:
            reader = zstandard.ZstdDecompressor(max_window_size=LARGEST_CHUNK).stream_reader(packed)
            while part := reader.read(_UNPACKED_AT_ONCE):
                if shutil.disk_usage(file.name).free < FREE_SPACE + len(part):
                    raise ValueError(f'no room to unpack it in {Path(file.name).parent}: set TMPDIR to another folder')
                file.write(part)
        except zstandard.ZstdError as error:
            raise ValueError(str(error)) from None
        file.flush()
        yield Path(file.name)


def _unpack_lz4(data: bytes, size: int) -> bytes:
    try:
        unpacked: bytes = needed('lz4.frame').LZ4FrameDecompressor().decompress(data, max_length=size + 1)
    except RuntimeError as error:
        raise ValueError(str(error)) from None
    return unpacked


_UNPACKERS: dict[str, Callable[[bytes, int], bytes]] = {
    '': lambda data, size: data[: size + 1],
    'zstd': unpack_zstd,
    'lz4': _unpack_lz4,
}
