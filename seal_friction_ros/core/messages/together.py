"""Messages that hold several others: the answers of all actuators, and the newest messages of several topics.

``seal_friction_msgs/MachineFriction`` has the answers of all actuators to one message. One message instead of two for
each actuator: most of what an answer costs is the middleware's.

``std_msgs/UInt8MultiArray`` has the newest message of each topic for who looks on. One message of an estimator instead
of a second reader at each of its drivers: a driver that sends to two readers takes longer from one message to the next,
and the estimator then wakes for each of them alone: 3 to 8 % more processor time (docs/performance.md, live view).
Dimension i of the layout names topic and type, with the number of bytes; the data are the messages one after another,
each as it is on the graph.
"""

import struct
from collections.abc import Iterable, Iterator, Sequence
from functools import lru_cache
from itertools import chain, islice
from typing import Any, NamedTuple

from seal_friction_ros.core.messages.cdr import ENCAPSULATION
from seal_friction_ros.core.messages.fields import Reader
from seal_friction_ros.core.messages.layouts import DEFINITIONS, LAYOUTS, MACHINE_TYPE, NEWEST_TYPE, SECOND, struct_of
from seal_friction_ros.core.messages.records import FeedForward, FrictionEstimate, Output

_COUNTS = {layout.record: len(layout.codes) for layout in LAYOUTS if layout.record in (FrictionEstimate, FeedForward)}
"""Record of an answer -> how many numbers it has, in the order of the message."""
_MACHINE, _NEWEST = Reader(DEFINITIONS, MACHINE_TYPE), Reader(DEFINITIONS, NEWEST_TYPE)


class NamedAnswer(NamedTuple):
    """An answer of one actuator."""

    actuator: str
    record: Output
    frame_id: bytes


def encode_together(answers: Sequence[NamedAnswer]) -> bytes:
    """The answers to one message, at least one, in the order in which they were made."""
    parts: dict[type, list[tuple[str, int]]] = {record: [] for record in _COUNTS}
    values: dict[type, list[Any]] = {record: [] for record in _COUNTS}
    for actuator, record, frame_id in answers:
        kind, length = type(record), len(frame_id) + 1
        seconds, nanoseconds = divmod(record.stamp, SECOND)
        parts[kind].append((actuator, length))
        values[kind] += (seconds, nanoseconds, length, frame_id, *record[1:])
    layout, (estimated, fed_forward) = _together(*map(tuple, parts.values()))
    estimates, feedforwards = values.values()
    stamp = (estimates or feedforwards)[:2]
    return layout.pack(ENCAPSULATION, *stamp, 1, b'', *estimated, *estimates, *fed_forward, *feedforwards)


@lru_cache(maxsize=256)
def _together(*parts: tuple[tuple[str, int], ...]) -> tuple[struct.Struct, list[list[Any]]]:
    """Format of a message, and what stands before the answers of each kind: counts and names.

    Each kind has a part: name of each actuator, and length of its frame name with its end.
    """
    lengths, heads = [1], []
    for part in parts:
        names = [name.encode() for name, _ in part]
        texts = [len(name) + 1 for name in names]
        lengths += (len(part), *texts, len(part), *(length for _, length in part))
        heads.append([len(part), *chain(*zip(texts, names, strict=True)), len(part)])
    return struct_of(MACHINE_TYPE, *lengths), heads


def decode_together(data: bytes) -> list[NamedAnswer]:
    """The answers in a message, estimates first: inverse of `encode_together`; ValueError if there are none."""
    values: Iterator[Any] = islice(_MACHINE.read(data).numbers, 5, None)  # behind the header
    answers: list[NamedAnswer] = []
    for record, numbers in _COUNTS.items():
        names = [_text(values) for _ in range(next(values))]
        count = next(values)
        if count != len(names):
            raise ValueError(f'{count} answers of {len(names)} actuators')
        for name in names:
            seconds, nanoseconds, _, frame_id = islice(values, 4)
            made = record(seconds * SECOND + nanoseconds, *islice(values, numbers))
            answers.append(NamedAnswer(name, made, frame_id[:-1]))
    return answers


class TopicMessage(NamedTuple):
    """A message as it is on the graph."""

    topic: str
    type_name: str
    data: bytes


def encode_newest(messages: Iterable[TopicMessage]) -> bytes:
    """The messages as one, in the order given."""
    messages = list(messages)
    labels = [f'{topic} {type_name}'.encode() for topic, type_name, _ in messages]
    together = b''.join(message.data for message in messages)
    values: list[Any] = []
    for label, message in zip(labels, messages, strict=True):
        values += (len(label) + 1, label, len(message.data), 1)
    lengths = (len(labels), *(len(label) + 1 for label in labels), len(together))
    return struct_of(NEWEST_TYPE, *lengths).pack(ENCAPSULATION, len(labels), *values, 0, len(together), together)


def decode_newest(data: bytes) -> list[TopicMessage]:
    """The messages in one: inverse of `encode_newest`; ValueError if it is not such a message."""
    values: Iterator[Any] = iter(_NEWEST.read(data).numbers[1:])
    labels = [(_text(values), *islice(values, 2)) for _ in range(next(values))]
    _, total, together = values
    told = sum(size for _, size, _ in labels)
    if total != told:
        raise ValueError(f'{total} bytes are no {NEWEST_TYPE} of {told} bytes')
    found, begin = [], 0
    for label, size, _ in labels:
        topic, _, type_name = label.partition(' ')
        found.append(TopicMessage(topic, type_name, together[begin : begin + size]))
        begin += size
    return found


def _text(values: Iterator[Any]) -> str:
    """The next text, which stands behind its length."""
    _, text = islice(values, 2)
    return str(text[:-1], 'utf-8')
