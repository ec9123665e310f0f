"""A bag as columns, once: the numbers of its messages as arrays, block by block, and what was newest at each sample.

Every reader of a bag that wants numbers and not messages takes them from here: no Python object for each message, and
memory for what is kept alone. Long bags of this project are read in bulk, others message by message: the same blocks.
"""

import math
from array import array
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from functools import partial
from typing import NamedTuple, Protocol, TypeVar

import numpy as np

from seal_friction_ros.core.estimation.configuration import Configuration, parse_snapshot
from seal_friction_ros.core.foundation.arrays import BoolArray, FloatArray, IntArray
from seal_friction_ros.core.foundation.compiled import has_compiler
from seal_friction_ros.core.foundation.errors import named_errors
from seal_friction_ros.core.identification.admission import MALFORMED, NO_VELOCITY
from seal_friction_ros.core.messages.blocks import Messages, Numbers, UnsuitedError, numbers_of
from seal_friction_ros.core.messages.coder import decode_text
from seal_friction_ros.offline.bags.actuator_bag import TYPES, ActuatorBag
from seal_friction_ros.offline.bags.bag import BagError, BagMessage, gathered
from seal_friction_ros.offline.bags.mcap_reader import ERRORS
from seal_friction_ros.offline.work.progress import progress

BULK_FROM = 300_000
"""Bags of at least so many messages are read in bulk: loading the compiler takes as long as reading them one by one."""
_Decoded = TypeVar('_Decoded')


class Wanted(NamedTuple):
    """A topic whose messages are wanted; an empty name: the bag has none."""

    topic: str
    type_name: str


class Block:
    """Messages of a bag in a block, by name; the kind of each is the place of its name in ``wanted``, from 1 on."""

    def __init__(self, messages: Messages, wanted: Mapping[str, Wanted]) -> None:
        self.messages = messages
        self._kinds = {name: kind for kind, name in enumerate(wanted, start=1)}
        self._wanted = wanted

    def of(self, name: str) -> Numbers:
        """Numbers of the messages of a name; ValueError, with topic and time, if one is malformed."""
        topic, type_name = self._wanted[name]
        return numbers_of(self.messages, self._kinds[name], type_name, topic)

    def decoded(self, name: str, decode: Callable[[bytes], _Decoded]) -> Iterator[tuple[int, int, _Decoded]]:
        """Place, log time [ns] and contents of each message of a name; raises as `of`."""
        for place in np.flatnonzero(self.messages.kinds == self._kinds[name]).tolist():
            time = int(self.messages.received[place])
            with named_errors(f'message on {self._wanted[name].topic} at {time} ns'):
                contents = decode(self.messages.message(place))
            yield place, time, contents


class Collector(Protocol):
    """Takes the blocks of a bag in order."""

    def add(self, block: Block) -> None:
        """Take one block."""


_Collector = TypeVar('_Collector', bound=Collector)


def collected(
    bag: ActuatorBag,
    wanted: Mapping[str, Wanted],
    make: Callable[[], _Collector],
    *,
    messages: Iterable[BagMessage] | None = None,
    bulk_from: int = BULK_FROM,
) -> _Collector:
    """A new collector with all blocks of a bag, or of the ``messages`` given.

    ``wanted`` gives topic and type of what the collector takes, by name. ``make`` makes an empty collector; an unusual
    bag takes a second one. From ``bulk_from`` messages on, the bag is read in bulk. BagError: the bag cannot be read,
    or a message is not of its type; names its topic and time.
    """
    kinds = {one.topic: (kind, one.type_name) for kind, one in enumerate(wanted.values(), start=1) if one.topic}

    def kind_of(topic: str, type_name: str) -> int:
        """Number of what a topic holds, 0 for what nobody wants; UnsuitedError for two types on one topic."""
        kind, known = kinds.get(topic, (0, type_name))
        if type_name != known:
            raise UnsuitedError(f'{topic} has messages of {known} and of {type_name}')
        return kind

    def fill(blocks: Iterable[Messages]) -> _Collector:
        """Collector of all blocks."""
        collector = make()
        with progress(f'read {bag.path.name}', bag.total) as advance:
            for block in blocks:
                collector.add(Block(block, wanted))
                advance(len(block.kinds))
        return collector

    if messages is None and not bag.actuator and bag.total >= bulk_from and has_compiler():
        with suppress(UnsuitedError, OSError, *ERRORS):  # the general reader reads it, or says what is wrong
            return fill(bag.blocks(kind_of))
    with named_errors(bag.path, UnsuitedError, BagError), named_errors(bag.path, raised=BagError):
        return fill(gathered(bag.messages() if messages is None else messages, kind_of))


class Held:
    """The newest numbers of some inputs, across blocks; of each as many as ``counts`` tells, from the first on."""

    def __init__(self, counts: Mapping[str, int]) -> None:
        self._newest = {name: np.full((count, 1), math.nan) for name, count in counts.items()}

    def at(self, places: IntArray, found: Mapping[str, Numbers]) -> FloatArray:
        """Numbers at some places of the next block, those there included; NaN before the first; shape (numbers, n)."""
        parts = []
        for name, newest in self._newest.items():
            known = np.concatenate([newest, found[name].numbers[: len(newest)]], axis=1)
            parts.append(known[:, np.searchsorted(found[name].places, places, side='right')])
            self._newest[name] = known[:, -1:].copy()
        return np.concatenate(parts)


# -- one row a velocity sample ----------------------------------------------------------------------------------------

INPUTS = {'velocity': 1, 'pressure': 2, 'force': 1, 'position': 1, 'temperature': 2}
"""Input, as a field of `Topics`, -> how many columns it has."""


class VelocityRows(NamedTuple):
    """n velocity samples in the order of the bag."""

    stamps: IntArray  # [ns] shape (n,)
    received: IntArray  # [ns] log times, shape (n,)
    columns: FloatArray
    """shape (7, n), in the units of the messages: velocity, both pressures, force sum, position, temperature and its
    variance, then what was wanted ``also``; NaN before the first message"""
    configuration: Configuration | None  # the last one
    left_out: Mapping[str, int] = {}  # reason -> messages on the topic of the velocity that made none


def wanted_of(bag: ActuatorBag, names: Iterable[str]) -> dict[str, Wanted]:
    """Topic and type of some fields of `Topics`."""
    return {name: Wanted(getattr(bag.topics, name), getattr(TYPES, name)) for name in names}


Also = Mapping[str, tuple[Wanted, Callable[[bytes], float]]]
"""Name -> a topic of messages that are no inputs, and the number in one of them."""
_NOTHING: Also = {}


def read_velocity_rows(bag: ActuatorBag, *, also: Also = _NOTHING, bulk_from: int = BULK_FROM) -> VelocityRows:
    """Each velocity sample with what came newest of the other inputs before it; raises as `collected`."""
    wanted, malformed = wanted_of(bag, (*INPUTS, 'configuration')), Counter[str]()
    wanted |= {name: one for name, (one, _) in also.items()}
    given = bag.messages(malformed=malformed) if bag.velocity_source else None
    rows = collected(bag, wanted, partial(_VelocityCollector, also), messages=given, bulk_from=bulk_from).rows()
    if given is None:
        return rows
    count, unread = bag.infos[bag.velocity_source].message_count, malformed[bag.velocity_source]
    left_out = {MALFORMED: unread, NO_VELOCITY: count - unread - len(rows.stamps)}
    return rows._replace(left_out={reason: number for reason, number in left_out.items() if number})


class _VelocityCollector:
    """Rows of the blocks so far."""

    def __init__(self, also: Also) -> None:
        self._also = also
        self._held = Held({**INPUTS, **dict.fromkeys(also, 1)})
        self._stamps, self._received = array('q'), array('q')
        self._columns = growing(sum(INPUTS.values()) + len(also))
        self._configuration: Configuration | None = None

    def add(self, block: Block) -> None:
        """Take the configurations, and a row for each velocity with what holds then."""
        for _, _, text in block.decoded('configuration', decode_text):
            self._configuration = parse_snapshot(text).configuration
        found = {name: block.of(name) for name in INPUTS}
        for name, (_, number_of) in self._also.items():
            numbers = np.array([(place, number) for place, _, number in block.decoded(name, number_of)]).reshape(-1, 2)
            places = numbers[:, 0].astype(np.int64)
            found[name] = Numbers(places, places, numbers[:, 1:].T)
        self._stamps.frombytes(found['velocity'].stamps.tobytes())
        self._received.frombytes(block.messages.received[found['velocity'].places].astype(np.int64).tobytes())
        extend(self._columns, self._held.at(found['velocity'].places, found))

    def rows(self) -> VelocityRows:
        columns = np.array([np.frombuffer(column) for column in self._columns])
        stamps, received = (np.frombuffer(times, np.int64) for times in (self._stamps, self._received))
        return VelocityRows(stamps, received, columns, self._configuration)


def growing(count: int) -> list['array[float]']:
    """Empty columns that grow in place: their memory is that of the numbers."""
    return [array('d') for _ in range(count)]


def extend(columns: list['array[float]'], rows: FloatArray) -> None:
    """Append numbers, shape (columns, n)."""
    for column, values in zip(columns, rows, strict=True):
        column.frombytes(np.ascontiguousarray(values).tobytes())


def in_turn(stamps: IntArray, places: IntArray, is_answer: BoolArray) -> tuple[IntArray, IntArray, IntArray]:
    """Pairs of samples and answers of one stamp: each answer, if no other is between, with the newest sample.

    Stamps [ns] and places in the bag are those of samples and answers, shape (n,). Returns the numbers of the answers
    that have a sample, of these samples, and of the samples that still wait for an answer.
    """
    order = np.lexsort((places, stamps))
    same = np.diff(stamps[order]) == 0
    first, second = order[:-1], order[1:]
    has_both = same & ~is_answer[first] & is_answer[second]
    is_last = np.append(~same, True)[: len(order)]
    return second[has_both], first[has_both], np.sort(order[is_last & ~is_answer[order]])
