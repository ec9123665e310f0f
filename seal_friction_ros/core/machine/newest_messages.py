"""The newest message of several topics as one message, for who looks on: ``std_msgs/UInt8MultiArray``.

One message of an estimator instead of a second reader at each of its drivers: a driver that sends to two readers takes
longer from one message to the next, and the estimator then wakes for each of them alone: 3 to 8 % more processor time
(docs/performance.md, live view). Dimension i of the layout names topic and type, with the number of bytes; the data are
the messages one after another, each as it is on the graph. CDR, little endian, padding zero.
"""

import struct
from collections.abc import Iterable
from typing import NamedTuple

NEWEST_TYPE = 'std_msgs/msg/UInt8MultiArray'
_ENCAPSULATION = b'\x00\x01\x00\x00'  # CDR, little endian, no options


class TopicMessage(NamedTuple):
    """A message as it is on the graph."""

    topic: str
    type_name: str
    data: bytes


def encode_newest(messages: Iterable[TopicMessage]) -> bytes:
    """The messages as one, in the order given."""
    dimensions, parts = [], []
    for topic, type_name, data in messages:
        label = f'{topic} {type_name}'.encode() + b'\0'
        padded = label.ljust(-len(label) % 4 + len(label), b'\0')
        dimensions.append(struct.pack(f'<I{len(padded)}sII', len(label), padded, len(data), 1))
        parts.append(data)
    together = b''.join(parts)
    head = _ENCAPSULATION + struct.pack('<I', len(dimensions))
    return b''.join((head, *dimensions, struct.pack('<II', 0, len(together)), together))


def decode_newest(data: bytes) -> list[TopicMessage]:
    """The messages in one: inverse of `encode_newest`.

    Raises:
        ValueError: The bytes are not such a message.
    """
    if data[:4] != _ENCAPSULATION:
        raise ValueError(f'encapsulation {data[:4].hex()} is not little-endian CDR')
    found, labels = [], []
    try:
        (count,) = struct.unpack_from('<I', data, 4)
        place = 8
        for _ in range(count):
            (length,) = struct.unpack_from('<I', data, place)
            topic, _, type_name = data[place + 4 : place + 3 + length].decode().partition(' ')
            place += 4 + length + -length % 4
            (size,) = struct.unpack_from('<I', data, place)
            place += 8
            labels.append((topic, type_name, size))
        place += 8
        for topic, type_name, size in labels:
            found.append(TopicMessage(topic, type_name, data[place : place + size]))
            place += size
    except (struct.error, UnicodeDecodeError) as error:
        raise ValueError(f'{len(data)} bytes are no {NEWEST_TYPE}: {error}') from None
    if place != len(data):
        raise ValueError(f'{len(data)} bytes are no {NEWEST_TYPE} of {place} bytes')
    return found
