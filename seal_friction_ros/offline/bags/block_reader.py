"""Bulk reading of a bag: `mcap_reader` with a compiled search for the messages in each block.

The library makes an object of each message, which takes a hundred times as long.
"""

import os
from collections.abc import Iterator
from functools import lru_cache
from io import BytesIO
from pathlib import Path
from typing import BinaryIO, NamedTuple

import numpy as np
from mcap.opcode import Opcode

from seal_friction_ros.core.foundation.compiled import compiled
from seal_friction_ros.core.messages.blocks import MOST_MESSAGES, Bytes, Integers, Messages
from seal_friction_ros.core.messages.compiled_coder import integer_at
from seal_friction_ros.offline.bags import mcap_reader
from seal_friction_ros.offline.bags.bag import KindOf, gathered, read_messages, storage
from seal_friction_ros.offline.bags.mcap_reader import HEAD, LAST_TIME, MESSAGE_HEAD, Block, Layout, Names


class Stretch(NamedTuple):
    """Part of a bag: the messages from one place to before another; a place is the number of a file and a log time."""

    file: int
    first: int  # [ns] in that file
    last_file: int
    end: int  # [ns] in the last file

    def in_file(self, number: int) -> tuple[int, int]:
        """First log time [ns] in a file and that which is not in it any more."""
        if not self.file <= number <= self.last_file:
            return 0, 0
        return self.first if number == self.file else 0, self.end if number == self.last_file else LAST_TIME + 1


_WHOLE = Stretch(0, 0, 1 << 30, 0)
_AT_ONCE = 1 << 21  # [bytes] read at a time: about 20 000 messages
_SCHEMA, _CHANNEL, _MESSAGE = int(Opcode.SCHEMA), int(Opcode.CHANNEL), int(Opcode.MESSAGE)


def read_in_bulk(path: Path, kind_of: KindOf, stretch: Stretch | None = None) -> Iterator[Messages]:
    """Messages of a bag, or of a part of it, in the order of `bag.read_messages`, at most `MOST_MESSAGES` at a time.

    Of a part only the chunks with such messages are read. Raises BagError, or one of `mcap_reader.ERRORS`, if the bag
    cannot be read.
    """
    files = storage(path)
    if not files.is_plain_mcap:
        yield from gathered(read_messages(path), kind_of)
        return
    for number, file_path in enumerate(files.files):
        begin, end = (stretch or _WHOLE).in_file(number)
        if begin == end:
            continue
        with file_path.open('rb') as file:
            layout = _layout(file)
            # A block without messages, whose first time is after its last, has channels.
            blocks = [b for b in layout.blocks if b.first > b.last or (b.first < end and b.last >= begin)]
            for messages in _of_blocks(file, blocks, Names(layout.channels), kind_of):
                first, last = (int(place) for place in np.searchsorted(messages.received, (begin, end)))
                for start in range(first, last, MOST_MESSAGES):
                    yield messages.taken(start, min(start + MOST_MESSAGES, last))


def _of_blocks(file: BinaryIO, blocks: list[Block], names: Names, kind_of: KindOf) -> Iterator[Messages]:
    kinds: Bytes = np.zeros(1 << 16, np.uint8)  # by channel
    for data, rows in mcap_reader.in_order(file, blocks, names, _located, _AT_ONCE):
        for number, channel in names.channels.items():
            kinds[number] = kind_of(channel.topic, channel.description.type_name)
        yield Messages(np.frombuffer(data, np.uint8), kinds[rows[0]], *rows[1:])


def times_of(path: Path, topic: str) -> list[tuple[int, int]]:
    """Number of the file and log time [ns] of each message of a topic, in order, without reading the messages.

    Empty for a bag whose chunks have no index, and for one that `read_in_bulk` reads by the general reader. Raises
    BagError if the bag cannot be read, ValueError if a file is damaged or unfinished.
    """
    files = storage(path)
    times: list[tuple[int, int]] = []
    for number, file_path in enumerate(files.files if files.is_plain_mcap else ()):
        with file_path.open('rb') as file:
            wanted = [key for key, channel in _layout(file).channels.items() if channel.topic == topic]
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
    _located(bytes(HEAD), Block(0, HEAD, 0, 0, HEAD, is_chunk=False), Names())


def _located(data: bytes, block: Block, names: Names) -> Integers:
    """`mcap_reader.located`, compiled."""
    rows: Integers = np.empty((5, len(data) // MESSAGE_HEAD), np.int64)
    first, last = min(block.first, LAST_TIME + 1), min(block.last, LAST_TIME)
    offset = count = 0
    while offset < len(data):
        known = np.zeros(1 << 16, np.uint8)
        known[list(names.channels)] = 1
        offset, count, opcode = _walk(np.frombuffer(data, np.uint8), rows, count, offset, first, last, known)
        if opcode < 0:
            raise ValueError(f'the record {offset} bytes after its beginning is invalid')
        if opcode:
            end = offset + HEAD + int.from_bytes(data[offset + 1 : offset + HEAD], 'little')
            names.learn(BytesIO(data[offset:end]), end - offset)
            offset = end
    return rows[:, :count]


@compiled
def _walk(
    data: Bytes, rows: Integers, count: int, offset: int, first: int, last: int, known: Bytes
) -> tuple[int, int, int]:
    """Locate messages from an offset on, up to the end, the next schema, the next channel or an invalid record.

    Returns the offset reached, the number of messages, and the opcode of the record there: 0 at the end, -1: it is
    invalid.
    """
    while offset + HEAD <= len(data):
        opcode, end = data[offset], offset + HEAD + integer_at(data, offset + 1, 8)
        if not offset + HEAD <= end <= len(data):
            break
        if _SCHEMA <= opcode <= _CHANNEL:
            return offset, count, opcode
        if opcode == _MESSAGE:
            begin = offset + MESSAGE_HEAD
            channel = data[offset + 9] | np.int64(data[offset + 10]) << 8
            if begin > end or not known[channel] or not first <= integer_at(data, offset + 15, 8) <= last:
                break
            rows[0, count], rows[1, count], rows[2, count] = channel, begin, end - begin
            rows[3, count], rows[4, count] = integer_at(data, offset + 15, 8), integer_at(data, offset + 23, 8)
            count += 1
        offset = end
    return offset, count, 0 if offset == len(data) else -1
