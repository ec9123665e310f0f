"""Bulk reading of a bag: blocks of messages in file order, with the position of each message.

The checks and the order of messages are those of `mcap_reader`. Unusual bags (damage, a topic described twice, chunks
that overlap by much) are refused with `UnsuitedError`; the general reader reads them or reports the fault.
"""

import heapq
import os
from collections.abc import Iterable, Iterator, Sequence
from functools import lru_cache
from pathlib import Path
from typing import BinaryIO, NamedTuple

import numpy as np
import numpy.typing as npt

from seal_friction_ros.core.estimation.message_blocks import (
    MOST_MESSAGES,
    Bytes,
    Integers,
    Messages,
    UnsuitedError,
)
from seal_friction_ros.core.foundation.compiled import compiled
from seal_friction_ros.offline.bags import mcap_reader
from seal_friction_ros.offline.bags.bag import read_messages, storage
from seal_friction_ros.offline.bags.gathered import KindOf, gathered
from seal_friction_ros.offline.bags.mcap_reader import Block, Layout
from seal_friction_ros.offline.bags.mcap_records import Opcode


class Stretch(NamedTuple):
    """Part of a bag: the messages from one place to before another; a place is the number of a file and a log time."""

    file: int
    first: int  # [ns] in that file
    last_file: int
    end: int  # [ns] in the last file

    def in_file(self, number: int) -> tuple[int, int] | None:
        """First log time [ns] in a file and that which is not in it any more; None if nothing of the file is."""
        if not self.file <= number <= self.last_file:
            return None
        return self.first if number == self.file else 0, self.end if number == self.last_file else _LAST_TIME + 1


_AT_ONCE = 1 << 21  # [bytes] read at a time: about 20 000 messages
_UNKNOWN = 255  # instead of a `Kind`: channel without description
_SMALLEST = 31  # [bytes] of the record of an empty message
_MESSAGE, _SCHEMA, _CHANNEL = int(Opcode.MESSAGE), int(Opcode.SCHEMA), int(Opcode.CHANNEL)
_LAST_TIME = mcap_reader.LAST_TIME


def read_in_bulk(path: Path, kind_of: KindOf, stretch: Stretch | None = None) -> Iterator[Messages]:
    """Messages of a bag, or of a part of it, in the order of `bag.read_messages`, at most `MOST_MESSAGES` at a time.

    Of a part only the chunks with such messages are read.

    Raises:
        UnsuitedError: The bag is unusual.
        BagError: It cannot be read.
    """
    files = storage(path)
    if not files.is_plain_mcap:
        yield from gathered(read_messages(path), kind_of)
        return
    for number, file_path in enumerate(files.files):
        span = (0, _LAST_TIME + 1) if stretch is None else stretch.in_file(number)
        if span is None:
            continue
        with file_path.open('rb') as file:
            for messages in _of_file(file, _layout(file), kind_of, span):
                for first in range(0, len(messages.kinds), MOST_MESSAGES):
                    yield messages.taken(first, first + MOST_MESSAGES)


def times_of(path: Path, topic: str) -> list[tuple[int, int]]:
    """Number of the file and log time [ns] of each message of a topic, in order, without reading the messages.

    Empty for a bag whose chunks have no index, and for one that `read_in_bulk` reads by the general reader.

    Raises:
        BagError: The bag cannot be read.
        ValueError: A file is damaged or unfinished.
    """
    files = storage(path)
    times: list[tuple[int, int]] = []
    for number, file_path in enumerate(files.files if files.is_plain_mcap else ()):
        with file_path.open('rb') as file:
            channels = _layout(file).channels
            wanted = [key for key, channel in channels.items() if channel.topic == topic]
            times += [(number, time) for time in mcap_reader.indexed_times(file, wanted)] if wanted else []
    return times


def _layout(file: BinaryIO) -> Layout:
    """Layout of a finished file. It is kept for a while: to walk over an hour of records takes half a second."""
    found = os.fstat(file.fileno())
    return _kept_layout(file.name, found.st_dev, found.st_ino, found.st_size, found.st_mtime_ns)


@lru_cache(maxsize=4)
def _kept_layout(name: str, *_changes: int) -> Layout:
    with Path(name).open('rb') as file:
        return mcap_reader.scan_finished(file)


def compile_now() -> None:
    """Compile in this process, so that worker processes inherit the compiled code."""
    _walk(*_room_for(bytes(1), 0), 0, 0, 0, 0, 0, np.zeros(1, np.uint8))


def _room_for(data: bytes, count: int) -> Messages:
    """Space for ``count`` messages in ``data``."""
    columns: Integers = np.empty((4, count), np.int64)
    return Messages(np.frombuffer(data, np.uint8), np.empty(count, np.uint8), *columns)


_NONE = _room_for(b'', 0)


def _of_file(file: BinaryIO, layout: Layout, kind_of: KindOf, span: tuple[int, int]) -> Iterator[Messages]:
    """Messages in order of log time; equal times in the order of the file.

    Those before ``span`` [ns] and from its end on are not among them.
    """
    if span != (0, _LAST_TIME + 1):
        inside = tuple(block for block in layout.blocks if block.first < span[1] and block.last >= span[0])
        for messages in _of_file(file, layout._replace(blocks=inside), kind_of, (0, _LAST_TIME + 1)):
            first, end = np.searchsorted(messages.received, span)
            yield messages.taken(int(first), int(end))
        return
    channels = _Channels(layout, kind_of)
    blocks = sorted(layout.blocks, key=lambda block: block.first) if layout.channels else layout.blocks
    earliest = mcap_reader.earliest_times(blocks)
    _check_overlap(blocks, earliest)
    kept = _NONE
    begin = size = 0
    for end, block in enumerate(blocks, start=1):
        size += block.unpacked_size
        if size < _AT_ONCE and end < len(blocks):
            continue
        messages = _sorted(_read(file, blocks[begin:end], channels, kept))
        begin, size = end, 0
        sure = len(messages.received)
        if end < len(blocks):
            sure = int(np.searchsorted(messages.received, min(earliest[end], _LAST_TIME), side='right'))
        yield messages.taken(0, sure)
        kept = _copied(messages, sure)


def _check_overlap(blocks: Sequence[Block], earliest: Sequence[int]) -> None:
    """Refuse chunks that overlap in time by so much that `mcap_reader` may refuse them.

    Raises:
        UnsuitedError: They overlap by too much.
    """
    open_blocks: list[tuple[int, int]] = []  # end in time [ns] and size
    at_once = 0
    for block, begin in zip(blocks, earliest, strict=True):
        while open_blocks and open_blocks[0][0] < begin:
            at_once -= heapq.heappop(open_blocks)[1]
        heapq.heappush(open_blocks, (block.last, block.unpacked_size))
        at_once += block.unpacked_size
        if at_once > mcap_reader.MOST_AT_ONCE:
            raise UnsuitedError('chunks overlap by much')


def _sorted(messages: Messages) -> Messages:
    times = messages.received
    if (times[:-1] <= times[1:]).all():
        return messages
    order = np.argsort(times, kind='stable')
    return messages.in_order(order)


def _copied(messages: Messages, first: int) -> Messages:
    """Messages from number ``first`` on: they wait, since a following chunk begins before them."""
    count = len(messages.received)
    if first == count:
        return _NONE
    data = b''.join(messages.message(number) for number in range(first, count))
    sizes = messages.sizes[first:]
    offsets = np.cumsum(sizes) - sizes
    left = messages.taken(first, count)
    return left._replace(data=np.frombuffer(data, np.uint8), offsets=offsets)


class _Channels:
    """Kinds of messages by channel, as a table for compiled code."""

    def __init__(self, layout: Layout, kind_of: KindOf) -> None:
        self._names = mcap_reader.Names(layout.channels)
        self._kind_of = kind_of
        self._known = dict(layout.channels)
        self.kinds: Bytes = np.full(1 << 16, _UNKNOWN, np.uint8)
        for number, channel in layout.channels.items():
            self.kinds[number] = kind_of(channel.topic, channel.type_name)

    def learn(self, opcode: int, data: bytes) -> None:
        """Add the record of a schema or a channel."""
        self._names.learn(opcode, data)
        for number, channel in self._names.channels.items():
            if self._known.setdefault(number, channel) != channel:
                raise UnsuitedError(f'{channel.topic} is described twice')
            self.kinds[number] = self._kind_of(channel.topic, channel.type_name)


def _read(file: BinaryIO, blocks: Iterable[Block], channels: _Channels, kept: Messages) -> Messages:
    """The kept messages, then those of the blocks.

    Raises:
        UnsuitedError: A block cannot be read.
    """
    parts, ends = [kept.data.tobytes()], []
    size = len(parts[0])
    try:
        for block in blocks:
            parts.append(mcap_reader.unpacked(file, block))
            size += len(parts[-1])
            ends.append((block, size))
        data = b''.join(parts)
        start = len(parts[0])
        del parts
        count = len(kept.received)
        most = count + (size - start) // _SMALLEST
        messages = _room_for(data, most)
        messages.kinds[:count], messages.offsets[:count] = kept.kinds, kept.offsets
        messages.sizes[:count], messages.received[:count] = kept.sizes, kept.received
        messages.sent[:count] = kept.sent
        for block, end in ends:
            count = _index(messages, count, start, end, block, channels)
            start = end
    except mcap_reader.ERRORS as error:
        raise UnsuitedError(str(error)) from None
    return messages.taken(0, count)


def _index(messages: Messages, count: int, start: int, end: int, block: Block, channels: _Channels) -> int:
    """Index the messages of a block; return the number of all messages so far."""
    data = messages.data
    first, last = min(block.first, _LAST_TIME + 1), min(block.last, _LAST_TIME)
    while start < end:
        start, count, opcode = _walk(*messages, count, start, end, first, last, channels.kinds)
        if opcode < 0:
            raise UnsuitedError(f'a record at byte {start}')
        if opcode in (_SCHEMA, _CHANNEL):
            following = start + 9 + int.from_bytes(data[start + 1 : start + 9].tobytes(), 'little')
            channels.learn(opcode, data[start + 9 : following].tobytes())
            start = following
    return count


@compiled
def _whole_number(data: Bytes, offset: int) -> int:
    """Eight bytes, little endian; negative from 2^63 on."""
    value = np.int64(0)
    for i in range(8):
        value |= np.int64(data[offset + i]) << np.int64(8 * i)
    return int(value)


@compiled
def _walk(
    data: Bytes,
    kinds: Bytes,
    offsets: Integers,
    sizes: Integers,
    times: Integers,
    sent: Integers,
    count: int,
    start: int,
    end: int,
    first: int,
    last: int,
    kind_of_channel: npt.NDArray[np.uint8],
) -> tuple[int, int, int]:
    """Index records of a block up to its end, or up to the next schema or channel.

    Returns:
        Offset reached, number of all messages, and opcode of the record there: 0 at the end of the block, -1 for an
        invalid record.
    """
    while start < end:
        if end - start < 9:
            return start, count, -1
        opcode, length = data[start], _whole_number(data, start + 1)
        if length < 0 or length > end - start - 9:
            return start, count, -1
        if _SCHEMA <= opcode <= _CHANNEL:
            return start, count, opcode
        if opcode == _MESSAGE:
            if length < 22:
                return start, count, -1
            kind = kind_of_channel[data[start + 9] | np.int64(data[start + 10]) << 8]
            time = _whole_number(data, start + 15)
            if kind == _UNKNOWN or not first <= time <= last:
                return start, count, -1
            kinds[count], offsets[count], sizes[count], times[count] = kind, start + 31, length - 22, time
            sent[count] = _whole_number(data, start + 23)
            count += 1
        start += 9 + length
    return start, count, 0
