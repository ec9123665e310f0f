"""Comparison of one topic of two bags, paired by stamp: first, largest and root mean square difference."""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, astuple, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from seal_friction_ros.core.messages.coder import DECODERS
from seal_friction_ros.core.messages.layouts import ESTIMATE_TYPE
from seal_friction_ros.offline.bags.actuator_bag import find_topic, open_actuator, recorded_machine
from seal_friction_ros.offline.bags.bag import BagError, BagMessage, bag_topics, named, read_messages
from seal_friction_ros.offline.bags.mapped_bag import MappingFile, is_for


@dataclass(frozen=True)
class FieldDifference:
    """Difference of one field over all pairs, second bag minus first."""

    largest: float  # largest magnitude, in the unit of the field; infinite if only one of the two is a number
    rms: float
    outside: int  # number of pairs with a difference outside the tolerance
    differing: int = 0  # number of pairs with any difference


_Numbers = npt.NDArray[np.int64]
_Decoded = tuple[bytes, dict[str, Any]]  # bytes and fields of a message


class _Topic(NamedTuple):
    bag: Path
    name: str
    read: Callable[[], Iterator[BagMessage]]

    def messages(self) -> Iterator[BagMessage]:
        return (message for message in self.read() if message.topic == self.name)


_NO_DIFFERENCE = FieldDifference(0.0, 0.0, 0)
FRICTION_FIELDS = ('state', 'direction', 'coulomb_friction', 'breakaway_force', 'friction_force')
"""Fields of an estimate that decide by default: not what was learnt, its deviations, and the age of the inputs."""
COUNTED = ('state', 'direction', 'status', 'limited')  # Fields that are no quantities: their differences are counted.


@dataclass(frozen=True)
class BagComparison:
    """Result of the comparison of two bags."""

    topic: str
    messages_a: int
    messages_b: int
    pairs: int  # messages of equal stamp; all differences are about these
    identical_bytes: bool
    first_difference: str  # for a person; empty if no difference is outside the tolerance
    fields: dict[str, FieldDifference]
    decide: tuple[str, ...]  # fields of which each has to be within its tolerance

    @property
    def agree(self) -> bool:
        """Whether every message has a partner in the other bag, and every field that decides is within tolerance."""
        return not self.first_difference

    def numbers(self) -> dict[str, Any]:
        """Numbers for JSON."""
        lonely = {'without_partner_a': self.messages_a - self.pairs, 'without_partner_b': self.messages_b - self.pairs}
        return {**asdict(self), **lonely, 'agree': self.agree}

    def summary(self) -> str:
        """One line for the topic and one for each field that differs, for a person."""
        result = 'agree' if self.agree else f'differ: {self.first_difference}'
        differing = {name: field for name, field in self.fields.items() if field.largest > 0.0}
        others = [name for name in differing if name not in self.decide]
        a, b = self.messages_a - self.pairs, self.messages_b - self.pairs
        lonely = f', {a} of the first and {b} of the second without a partner of the same stamp' if a or b else ''
        fields = [self._told(name, f) for name, f in differing.items() if name in self.decide]
        fields += [f'not compared, and different: {", ".join(others)} (--fields)'] if others else []
        counts = f'{self.messages_a} and {self.messages_b} messages on {self.topic}{lonely}: {result}'
        return '\n'.join([counts, *fields])

    def _told(self, name: str, field: FieldDifference) -> str:
        if name in COUNTED:
            return f'{name}: {field.differing} of {self.pairs} differ'
        return f'{name}: largest {field.largest:.6g}, RMS {field.rms:.6g}'


def compare(
    bag_a: Path,
    bag_b: Path,
    topic: str = '',
    atol: float = 0.0,
    rtol: float = 0.0,
    *,
    tolerances: Mapping[str, float | None] | None = None,
    namespace: str = '',
    mapping: MappingFile | None = None,
) -> BagComparison:
    """Compare a topic of two bags, each message with the one of the same stamp.

    Messages of equal stamp in one bag are paired in order, the last with the last, since recordings of one run mostly
    begin at different times (our choice). Messages without a stamp (configurations) are paired in the same way. Two
    numbers agree if ``|b - a| <= atol + rtol |a|`` or if both are NaN, other values if they are equal. BagError: a bag
    cannot be read or has no such topic, a message on it is of an unknown type, or no stamp is in both bags.

    The topic is by default that of the friction estimates, which may have another name in each bag. ``tolerances``:
    field that decides -> its absolute tolerance, None: ``atol``; by default `FRICTION_FIELDS` decide on estimates, and
    all fields on other messages. ``namespace`` and ``mapping`` as of `open_actuator`; with a mapping the estimates are
    made here.
    """
    a, b = (_topic_of(bag, topic, namespace, mapping) for bag in (bag_a, bag_b))
    stamps_a, stamps_b = _stamps(a), _stamps(b)
    numbers_a, numbers_b = _pairs(stamps_a, stamps_b)
    topics = a.name if a.name == b.name else f'{a.name} and {b.name}'
    if not len(numbers_a):
        raise BagError(f'{bag_a} and {bag_b}: no stamp on {topics} is in both')
    identical, first = True, ''
    totals: dict[str, FieldDifference] = {}  # with the sum of squares instead of the RMS
    own: dict[str, float | None] = dict(tolerances or {})
    for number, one, other in _decoded_pairs((a, numbers_a), (b, numbers_b)):
        identical = identical and one[0] == other[0]
        own = own or dict.fromkeys(FRICTION_FIELDS if {*FRICTION_FIELDS} <= one[1].keys() else one[1])
        for name, value in one[1].items():
            then, absolute = other[1].get(name), own.get(name)
            difference, within = _difference(value, then, atol if absolute is None else absolute, rtol)
            within = within if name not in COUNTED else value == then
            largest, squares, outside, differing = astuple(totals.get(name, _NO_DIFFERENCE))
            sums = (squares + difference**2, outside + (not within), differing + (difference > 0.0))
            totals[name] = FieldDifference(max(largest, difference), *sums)
            if not within and not first and name in own:
                first = f'message {number} at {one[1].get("stamp")} ns: {name} {value!r} -> {then!r}'
    pairs, counts = len(numbers_a), (len(stamps_a), len(stamps_b))
    fields = {name: replace(total, rms=math.sqrt(total.rms / pairs)) for name, total in totals.items()}
    if max(counts) > pairs:
        identical, first = False, first or _first_without_partner(stamps_a, stamps_b, numbers_a, numbers_b)
    if unknown := [name for name in own if name not in fields]:
        raise BagError(f'{topics}: no field {unknown[0]!r} to compare: there are {", ".join(fields)}')
    return BagComparison(topics, *counts, pairs, identical, first, fields, tuple(own))


def _pairs(stamps_a: _Numbers, stamps_b: _Numbers) -> tuple[_Numbers, _Numbers]:
    """Numbers of the messages in either bag that belong together, in the order of the first bag."""
    stamps = np.concatenate([stamps_a, stamps_b])
    _, groups = np.unique(stamps, return_inverse=True)
    key_a, key_b = (_from_the_end(part) * len(stamps) + part for part in np.split(groups.reshape(-1), [len(stamps_a)]))
    _, in_a, in_b = np.intersect1d(key_a, key_b, assume_unique=True, return_indices=True)
    order = np.argsort(in_a)
    return np.asarray(in_a[order], np.int64), np.asarray(in_b[order], np.int64)


def _from_the_end(groups: _Numbers) -> _Numbers:
    """Number of later messages of the same group, for each message."""
    order = np.argsort(groups, kind='stable')
    _, counts = np.unique(groups, return_counts=True)
    later = np.empty(len(groups), np.int64)
    later[order] = np.repeat(np.cumsum(counts), counts) - 1 - np.arange(len(groups))
    return later


def _first_without_partner(stamps_a: _Numbers, stamps_b: _Numbers, numbers_a: _Numbers, numbers_b: _Numbers) -> str:
    for stamps, numbers, which in ((stamps_a, numbers_a, 'second'), (stamps_b, numbers_b, 'first')):
        missing = np.setdiff1d(np.arange(len(stamps)), numbers)
        if len(missing):
            return f'the {which} bag has no message at {stamps[missing[0]]} ns'
    return ''


def _decoded_pairs(
    first: tuple[_Topic, _Numbers], second: tuple[_Topic, _Numbers]
) -> Iterator[tuple[int, _Decoded, _Decoded]]:
    """Number in the first bag, and both messages, of each pair; memory is that of messages in another order."""
    messages_a, messages_b = _chosen(*first), _chosen(*second)
    waiting: dict[int, _Decoded] = {}
    for number_a, number_b in zip(first[1].tolist(), second[1].tolist(), strict=True):
        _, a = next(messages_a)
        while number_b not in waiting:
            found, waiting[found] = next(messages_b)
        yield number_a + 1, a, waiting.pop(number_b)


def _chosen(topic: _Topic, numbers: _Numbers) -> Iterator[tuple[int, _Decoded]]:
    """The messages on a topic with these numbers."""
    wanted = np.sort(numbers).tolist()
    place = 0
    for number, message in enumerate(topic.messages()):
        if place < len(wanted) and number == wanted[place]:
            place += 1
            yield number, (message.data, _fields(topic.bag, message))


def _stamps(topic: _Topic) -> _Numbers:
    """Stamp of each message on a topic [ns]; 0 if its type has none."""
    found = np.fromiter((_fields(topic.bag, message).get('stamp', 0) for message in topic.messages()), np.int64)
    if not len(found):
        raise BagError(f'{topic.bag}: no message on {topic.name}')
    return found


def _topic_of(bag: Path, name: str, namespace: str, mapping: MappingFile | None) -> _Topic:
    """Topic to compare: ``name``, else that of the estimates; of a machine one of those of an actuator."""
    known = bag_topics(bag)
    is_mapped = recorded_machine(bag, known) is not None if mapping is None else is_for(mapping, known)
    if name not in known and is_mapped:
        actuator = open_actuator(bag, namespace, mapping)
        return _Topic(bag, name or actuator.topics.estimate, partial(actuator.messages, with_answers=True))
    found = [topic for topic, info in known.items() if info.type_name == ESTIMATE_TYPE]
    topic = name or (found[0] if len(found) == 1 else find_topic(bag, ESTIMATE_TYPE, namespace, known))
    if not topic:
        raise BagError(f'{bag}: no {ESTIMATE_TYPE} in it: choose a topic with --topic')
    return _Topic(bag, topic, partial(read_messages, bag))


def _fields(bag: Path, message: BagMessage) -> dict[str, Any]:
    if message.type_name not in DECODERS:
        raise BagError(f'{bag}: {message.topic} is {message.type_name}, not a message type of this project')
    with named(bag, message):
        record = DECODERS[message.type_name](message.data)
    return record._asdict() if hasattr(record, '_asdict') else {'text': record}


def _difference(a: Any, b: Any, atol: float, rtol: float) -> tuple[float, bool]:
    """Magnitude of b - a (1 for unequal values that are not numbers), and whether it is within tolerance."""
    if not isinstance(a, int | float) or not isinstance(b, int | float):
        return (0.0, True) if a == b else (1.0, False)
    if a == b or (math.isnan(a) and math.isnan(b)):
        return 0.0, True
    difference = abs(b - a)
    if not math.isfinite(difference):
        return math.inf, False
    return float(difference), difference <= atol + rtol * abs(a)
