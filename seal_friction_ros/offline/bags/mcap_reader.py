"""Reader of one untrusted MCAP file: the records of the ``mcap`` library, read within bounds.

Ours is what the library does not do:

- It reads and unpacks as much as a file claims. Here the heads of the records (opcode and length) are checked first.
- It copies each message into an object, and sorts a file without an index in memory. Here messages stay in the bytes of
  their block, where `block_reader` decodes them in bulk, and only those wait that a later block may precede.

Layout: https://mcap.dev/spec.
"""

import os
import shutil
import struct
import zlib
from array import array
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import contextmanager
from io import BytesIO
from itertools import accumulate
from pathlib import Path
from tempfile import NamedTemporaryFile
from typing import IO, Any, BinaryIO, NamedTuple, cast

import numpy as np
import numpy.typing as npt
from mcap import records
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.stream_reader import StreamReader
from mcap.writer import MCAP0_MAGIC as MAGIC

from seal_friction_ros.offline.bags.mcap_writer import Description
from seal_friction_ros.packages import needed

FREE_SPACE = 1 << 30  # [bytes] that stay free on the disk where a file is unpacked (our choice)
_UNPACKED_AT_ONCE = 1 << 22  # [bytes]
LARGEST_CHUNK = 1 << 25  # [bytes] packed or unpacked, and of any other record; rosbag2 writes chunks of 0.8 MB
_MOST_BLOCKS = 500_000  # 30 GB in chunks of `mcap_writer`
_BLOCK_SIZE = 1 << 20  # [bytes] read at a time of messages outside of chunks
_LONGEST_NAME = 1024  # characters of a topic or a type; ROS has 255
LAST_TIME = 1 << 62  # [ns] in the year 2116
_NO_TIME = (1 << 64) - 1  # [ns] first log time of a block without messages

_RECORD = struct.Struct('<BQ')  # opcode, length
_MESSAGE = struct.Struct('<BQHIQQ')  # opcode, length, channel, sequence, log time, publish time
_CHUNK = struct.Struct('<BQQQQ')  # opcode, length, first and last log time, unpacked size
HEAD, MESSAGE_HEAD = _RECORD.size, _MESSAGE.size  # [bytes]
_TOO_SHORT = 'a record is shorter than what it claims to hold'
ERRORS = (ValueError, struct.error, McapError)

Integers = npt.NDArray[np.int64]


class Channel(NamedTuple):
    """Description of a topic in a file."""

    topic: str
    encoding: str  # of its messages; `ENCODING` for ROS 2
    description: Description


class BagMessage(NamedTuple):
    """One serialised message of a bag."""

    topic: str
    type_name: str
    log_time: int  # [ns]
    data: bytes
    publish_time: int | None = None  # [ns] on any clock; None: not known


class Block(NamedTuple):
    """Part of the file with records of messages: a chunk, or consecutive records outside of chunks."""

    offset: int  # [bytes] of its beginning in the file
    size: int  # [bytes] as stored
    first: int  # smallest log time in it [ns]
    last: int  # largest log time in it [ns]
    unpacked_size: int  # [bytes] as the file claims
    is_chunk: bool


class Layout(NamedTuple):
    """Structure of a file."""

    blocks: tuple[Block, ...]
    channels: dict[int, Channel]  # those repeated at the end of the file
    counts: dict[int, int] | None  # messages of each channel, by the statistics of the file if it has some
    damage: str  # fault of the file from `sound_size` on; empty if it is finished
    sound_size: int  # [bytes] of complete records


# -- records ----------------------------------------------------------------------------------------------------------


class _Record:
    """One record of a stream. A field that claims more than the record holds is an error; the library takes less."""

    def __init__(self, stream: BinaryIO, size: int) -> None:
        self._stream, self._left = stream, size

    def read(self, size: int) -> bytes:
        """Exactly so many bytes."""
        self._left -= size
        data = self._stream.read(size) if self._left >= 0 else b''
        if len(data) != size:
            raise ValueError(_TOO_SHORT)
        return data


def _parsed(stream: BinaryIO, size: int) -> Any:
    """The record that begins here and has so many bytes, as the library gives it; a chunk as it is packed."""
    if size > LARGEST_CHUNK:
        raise ValueError(_too_large(size))
    record = cast(IO[bytes], _Record(stream, size))
    return next(StreamReader(record, skip_magic=True, emit_chunks=True, record_size_limit=LARGEST_CHUNK).records)


def _too_large(size: int) -> str:
    return f'{size} bytes, at most {LARGEST_CHUNK >> 20} MiB are allowed: write the file again with smaller chunks'


def _reason(error: Exception) -> str:
    return _TOO_SHORT if isinstance(error, struct.error) else str(error)


class Names:
    """Channels by number."""

    def __init__(self, channels: dict[int, Channel] | None = None) -> None:
        self._schemas = {0: records.Schema(id=0, name='', encoding='', data=b'')}
        self._size = 0
        self.channels = dict(channels or {})

    def learn(self, stream: BinaryIO, size: int) -> None:
        """Add the record of a schema or a channel that begins here and has so many bytes.

        ValueError: it is invalid, a name in it is too long or not printable, or its number is that of another one.
        """
        record = _parsed(stream, size)
        if isinstance(record, records.Schema):
            self._add(self._schemas, record.id, record.name, record, size)
            return
        schema = self._schemas.get(record.schema_id)
        if schema is None:
            raise ValueError(f'{record.topic[:40]!r} has a type without description in the file')
        description = Description(schema.name, schema.encoding, schema.data, record.metadata)
        found = Channel(record.topic, record.message_encoding, description)
        self._add(self.channels, record.id, record.topic, found, size)

    def _add(self, known: dict[int, Any], number: int, name: str, found: Any, size: int) -> None:
        if not name.isprintable() or len(name) > _LONGEST_NAME:
            raise ValueError(f'{name[:40]!r} is not a valid name of a {type(found).__name__.lower()}')
        self._size += 0 if number in known else size
        if self._size > LARGEST_CHUNK:
            raise ValueError(f'descriptions of types and topics: {_too_large(self._size)}')
        if known.setdefault(number, found) != found:
            raise ValueError(f'{name} has the number of another one, {number}')


# -- layout -----------------------------------------------------------------------------------------------------------


def _heads(file: BinaryIO) -> Iterator[tuple[int, int, int, bytes]]:
    """Offset, opcode, size and first bytes of each record; ValueError if the file is unfinished or no MCAP."""
    file_size = os.fstat(file.fileno()).st_size
    file.seek(0)
    if file.read(len(MAGIC)) != MAGIC:
        raise ValueError('it does not begin like an MCAP file')
    offset, opcode = len(MAGIC), 0
    while opcode != Opcode.FOOTER:
        file.seek(offset)
        head = file.read(_CHUNK.size)
        opcode, size = (head[0], HEAD + int.from_bytes(head[1:HEAD], 'little')) if head else (0, HEAD)
        if offset + size > file_size:
            raise ValueError(f'it was not finished, or truncated: no complete record at byte {offset}')
        yield offset, opcode, size, head
        offset += size
    file.seek(offset)
    if file.read(len(MAGIC) + 1) != MAGIC:
        raise ValueError(f'no end of an MCAP file at byte {offset}')


def scan(file: BinaryIO) -> Layout:
    """Walk over the records of a file without reading the messages; in a damaged file, up to the damage."""
    names, blocks, counts = Names(), list[Block](), None
    damage, sound_size, in_data = '', 0, True
    try:
        for offset, opcode, size, head in _heads(file):
            file.seek(offset)
            if opcode == Opcode.CHUNK:
                first, last, unpacked_size = _CHUNK.unpack_from(head)[2:]
                blocks.append(Block(offset, size, first, last, unpacked_size, is_chunk=True))
            elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE) and in_data:
                _add_bare(blocks, offset, size, _MESSAGE.unpack_from(head)[4] if opcode == Opcode.MESSAGE else None)
            elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                names.learn(file, size)
            elif opcode == Opcode.STATISTICS:
                counts = _parsed(file, size).channel_message_counts
            in_data = in_data and opcode != Opcode.DATA_END
            sound_size = offset + size
            if len(blocks) > _MOST_BLOCKS:
                raise ValueError(f'more than {_MOST_BLOCKS} chunks: split the file')
    except ERRORS as error:
        damage = _reason(error)
    return Layout(tuple(blocks), names.channels, counts, damage, sound_size)


def _add_bare(blocks: list[Block], offset: int, size: int, time: int | None) -> None:
    """Add a record outside of chunks, to the block that ends where it begins if there is one."""
    block = blocks.pop() if blocks else None
    if block is None or block.is_chunk or block.offset + block.size != offset or block.size > _BLOCK_SIZE:
        blocks += [block] if block else []
        block = Block(offset, 0, _NO_TIME, 0, 0, is_chunk=False)
    times = (block.first, block.last) if time is None else (min(block.first, time), max(block.last, time))
    blocks.append(Block(block.offset, block.size + size, *times, block.size + size, is_chunk=False))


def scan_finished(file: BinaryIO) -> Layout:
    """Walk over the records of a finished file; ValueError, which says what to do, if it is damaged or unfinished."""
    layout = scan(file)
    if layout.damage:
        raise ValueError(f'{layout.damage}: use seal_friction recover')
    return layout


def indexed_times(file: BinaryIO, channels: Collection[int]) -> list[int]:
    """Log times [ns] of the messages of some channels of a finished file, in order, by the index of its chunks.

    Nothing of the messages is read, so the index is believed. Without an index there are none.
    """
    times: list[int] = []
    for offset, opcode, size, head in _heads(file):
        if opcode == Opcode.MESSAGE_INDEX and int.from_bytes(head[HEAD : HEAD + 2], 'little') in channels:
            file.seek(offset)
            times += [time for time, _ in _parsed(file, size).records]
    return sorted(times)


# -- messages ---------------------------------------------------------------------------------------------------------


class Located(NamedTuple):
    """Messages in the bytes of their blocks, n of them."""

    data: bytes
    rows: Integers
    """channel, offset in ``data`` [bytes], size [bytes], log time [ns], publish time [ns]; shape (5, n). A publish time
    from 2^63 on is negative."""


Locate = Callable[[bytes, Block, Names], Integers]  # `located`, or the same compiled.


def located(data: bytes, block: Block, names: Names, on_wrong_time: Callable[[int], None] | None = None) -> Integers:
    """Rows of `Located` of the messages of a block. The channels described in it become known to ``names``.

    Raises one of `ERRORS` if a record is invalid. ``on_wrong_time`` is called with each log time outside the block or
    beyond `LAST_TIME`, whose message is left out; without it, such a time is an error.
    """
    found = array('Q')
    first, last, size, offset = block.first, min(block.last, LAST_TIME), len(data), 0
    while offset < size:
        opcode, length = _RECORD.unpack_from(data, offset)
        end = offset + HEAD + length
        if end > size:
            raise ValueError(f'a record of {length} bytes reaches beyond its end')
        if opcode == Opcode.MESSAGE:
            _, _, channel, _, time, sent = _MESSAGE.unpack_from(data, offset)
            begin = offset + MESSAGE_HEAD
            is_in_time = first <= time <= last
            if begin > end or channel not in names.channels or not (is_in_time or on_wrong_time):
                raise ValueError(f'a message of {length} bytes on channel {channel} at {time} ns is invalid')
            if is_in_time:
                found.extend((channel, begin, end - begin, time, sent))
            elif on_wrong_time:
                on_wrong_time(time)
        elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            names.learn(BytesIO(data[offset:end]), end - offset)
        offset = end
    return np.frombuffer(found, np.int64).reshape(-1, 5).T


OnFault = Callable[[Block, str], None]  # Called with each unreadable block and the reason.


def messages(
    file: BinaryIO, layout: Layout, on_fault: OnFault | None = None, locate: Locate = located
) -> Iterator[tuple[Channel, int, int, bytes]]:
    """Channel, log time [ns], publish time [ns] and bytes of each message; arguments and errors as of `in_order`."""
    names = Names(layout.channels)
    for data, rows in in_order(file, layout.blocks, names, locate, on_fault=on_fault):
        for channel, offset, size, time, sent in rows.view(np.uint64).T.tolist():
            yield names.channels[channel], time, sent, data[offset : offset + size]


def in_order(
    file: BinaryIO,
    blocks: Sequence[Block],
    names: Names,
    locate: Locate = located,
    at_once: int = 1,
    on_fault: OnFault | None = None,
) -> Iterator[Located]:
    """Messages of blocks in order of log time; equal times in the order of the file.

    Blocks are read together until they have ``at_once`` [bytes]. ``locate`` finds the messages of a block. Without
    ``on_fault``, an unreadable block is an error. ValueError: a block cannot be read, or too many overlap in time.
    """
    if names.channels:  # else blocks stay in file order: channels are described before their messages
        blocks = sorted(blocks, key=lambda block: block.first)
    following = list(accumulate([LAST_TIME, *(block.first for block in reversed(blocks))], min))[-2::-1]
    waiting = _joined([])
    begin = size = 0
    for end, (block, until) in enumerate(zip(blocks, following, strict=True), start=1):
        size += block.unpacked_size
        if size < max(at_once, len(waiting.data)) and end < len(blocks):
            continue
        data, rows = _joined([waiting, *_read(file, blocks[begin:end], names, locate, on_fault)])
        begin, size = end, 0
        if (rows[3, :-1] > rows[3, 1:]).any():
            rows = rows[:, np.argsort(rows[3], kind='stable')]
        ready = int(np.searchsorted(rows[3], until, side='right'))
        yield Located(data, rows[:, :ready])
        waiting = _alone(data, rows[:, ready:])
        if len(waiting.data) > LARGEST_CHUNK:
            raise ValueError(f'more than {LARGEST_CHUNK >> 20} MiB of messages overlap in time: sort the file first')


def _read(
    file: BinaryIO, blocks: Sequence[Block], names: Names, locate: Locate, on_fault: OnFault | None
) -> Iterator[Located]:
    for block in blocks:
        try:
            data = _unpacked(file, block)
            yield Located(data, locate(data, block, names))
        except ERRORS as error:
            if on_fault is None:
                raise ValueError(f'chunk at byte {block.offset}: {_reason(error)}') from None
            on_fault(block, _reason(error))


def _alone(data: bytes, rows: Integers) -> Located:
    """The same messages without the bytes between them."""
    parts = [data[offset : offset + size] for _, offset, size, _, _ in rows.T.tolist()]
    return Located(b''.join(parts), np.array([rows[0], np.cumsum(rows[2]) - rows[2], *rows[2:]]))


def _joined(parts: Sequence[Located]) -> Located:
    starts = accumulate((len(part.data) for part in parts), initial=0)
    rows = [np.add(part.rows, [[0], [start], [0], [0], [0]]) for part, start in zip(parts, starts, strict=False)]
    return Located(b''.join(part.data for part in parts), np.concatenate([np.empty((5, 0), np.int64), *rows], axis=1))


# -- the file of a bag ------------------------------------------------------------------------------------------------


def file_messages(path: Path) -> Iterator[BagMessage]:
    """Messages of a file, in order of log time; ValueError if it is not finished, or a block cannot be read."""
    with path.open('rb') as file:
        for channel, log_time, publish_time, data in messages(file, scan_finished(file)):
            yield BagMessage(channel.topic, channel.description.type_name, log_time, data, publish_time)


def file_channels(path: Path) -> Iterator[tuple[Channel, int]]:
    """Channels of a finished file and their numbers of messages, from its index if it has one; one may come often."""
    with path.open('rb') as file:
        layout = scan_finished(file)
        if layout.channels and layout.counts is not None:
            yield from ((channel, layout.counts.get(number, 0)) for number, channel in layout.channels.items())
        else:
            yield from ((channel, 1) for channel, *_ in messages(file, layout))


def file_ends(path: Path) -> list[int]:
    """Last log time of a finished file [ns], by the heads of its chunks; nothing of the messages is read."""
    with path.open('rb') as file:
        return [max((block.last for block in scan_finished(file).blocks), default=0)]


# -- compression ------------------------------------------------------------------------------------------------------


def _unpacked(file: BinaryIO, block: Block) -> bytes:
    """Records of a block, of the claimed size and checksum."""
    if block.unpacked_size > LARGEST_CHUNK:
        raise ValueError(_too_large(block.unpacked_size))
    file.seek(block.offset)
    if not block.is_chunk:
        return file.read(block.size)
    chunk = _parsed(file, block.size)
    if chunk.compression not in _UNPACKERS:
        raise ValueError(f'compressed by {chunk.compression[:20]!r}, not by zstd or lz4')
    data = _UNPACKERS[chunk.compression](chunk.data)
    if len(data) != block.unpacked_size:
        raise ValueError(f'it does not unpack to the claimed {block.unpacked_size} bytes')
    if chunk.uncompressed_crc and zlib.crc32(data) != chunk.uncompressed_crc:
        raise ValueError('its checksum is wrong')
    return data


def unpack_zstd(data: bytes) -> bytes:
    """Unpack one zstd frame. The package allocates what the frame claims, so the claim is checked first.

    ValueError: it is no such frame, claims or has more than `LARGEST_CHUNK`, or the package is not installed.
    """
    zstandard = needed('zstandard')
    with _value_errors(zstandard.ZstdError):
        if (size := zstandard.frame_content_size(data)) > LARGEST_CHUNK:
            raise ValueError(_too_large(size))
        unpacker = zstandard.ZstdDecompressor(max_window_size=LARGEST_CHUNK)
        return cast(bytes, unpacker.decompress(data, max_output_size=LARGEST_CHUNK))


def _unpack_lz4(data: bytes) -> bytes:
    with _value_errors(RuntimeError):
        unpacker = needed('lz4.frame').LZ4FrameDecompressor()
        return cast(bytes, unpacker.decompress(data, max_length=LARGEST_CHUNK + 1))


@contextmanager
def _value_errors(kind: type[Exception]) -> Iterator[None]:
    try:
        yield
    except kind as error:
        raise ValueError(str(error)) from None


_UNPACKERS: dict[str, Callable[[bytes], bytes]] = {'': bytes, 'zstd': unpack_zstd, 'lz4': _unpack_lz4}


@contextmanager
def unpacked_file(path: Path) -> Iterator[Path]:
    """A zstd file unpacked to a temporary file (in the folder TMPDIR), which is removed at the end.

    ValueError: it is not a zstd file, its window is above `LARGEST_CHUNK`, zstandard is not installed, or unpacking it
    would leave less than `FREE_SPACE` on the disk.
    """
    zstandard = needed('zstandard')
    with path.open('rb') as packed, NamedTemporaryFile(prefix='seal_friction_', suffix=path.stem) as file:
        with _value_errors(zstandard.ZstdError):
            reader = zstandard.ZstdDecompressor(max_window_size=LARGEST_CHUNK).stream_reader(packed)
            while part := reader.read(_UNPACKED_AT_ONCE):
                if shutil.disk_usage(file.name).free < FREE_SPACE + len(part):
                    raise ValueError(f'no room to unpack it in {Path(file.name).parent}: set TMPDIR to another folder')
                file.write(part)
        file.flush()
        yield Path(file.name)
