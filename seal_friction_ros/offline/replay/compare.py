"""Comparison of one topic of two bags, paired by stamp: first, largest and root mean square difference."""

import math
from collections.abc import Iterator
from dataclasses import asdict, astuple, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from seal_friction_ros.core.estimation.messages import DECODERS, ESTIMATE_TYPE
from seal_friction_ros.offline.bags.bag import BagError, BagMessage, bag_topics, read_messages


@dataclass(frozen=True)
class FieldDifference:
    """Difference of one field over all pairs, second bag minus first."""

    largest: float  # largest magnitude, in the unit of the field; infinite if only one of the two is a number
    rms: float
    outside: int  # number of pairs with a difference outside the tolerance


_Numbers = npt.NDArray[np.int64]
_Decoded = tuple[bytes, dict[str, Any]]  # bytes and fields of a message
_NO_DIFFERENCE = FieldDifference(0.0, 0.0, 0)


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

    @property
    def agree(self) -> bool:
        """Whether every message has a partner in the other bag, and every field is within tolerance."""
        return not self.first_difference

    def numbers(self) -> dict[str, Any]:
        """Numbers for JSON."""
        lonely = {'without_partner_a': self.messages_a - self.pairs, 'without_partner_b': self.messages_b - self.pairs}
        return {**asdict(self), **lonely, 'agree': self.agree}

    def summary(self) -> str:
        """One line for the topic and one for each field that differs, for a person."""
        result = 'agree' if self.agree else f'differ: {self.first_difference}'
        differing = {name: field for name, field in self.fields.items() if field.largest > 0.0}
        a, b = self.messages_a - self.pairs, self.messages_b - self.pairs
        lonely = f', {a} of the first and {b} of the second without a partner of the same stamp' if a or b else ''
        return '\n'.join(
            [
                f'{self.messages_a} and {self.messages_b} messages on {self.topic}{lonely}: {result}',
                *(f'{name}: largest {f.largest:.6g}, RMS {f.rms:.6g}' for name, f in differing.items()),
            ]
        )


def compare(bag_a: Path, bag_b: Path, topic: str = '', atol: float = 0.0, rtol: float = 0.0) -> BagComparison:
    """Compare a topic of two bags, each message with the one of the same stamp.

    Messages of equal stamp in one bag are paired in order, the last with the last, since recordings of one run mostly
    begin at different times (our choice). Messages without a stamp (configurations) are paired in the same way.
    Two numbers agree if ``|b - a| <= atol + rtol |a|`` or if both are NaN, other values if they are equal.

    Args:
        bag_a: First bag, the reference.
        bag_b: Second bag.
        topic: Topic; by default that of the friction estimates, which may have another name in each bag.
        atol: Absolute tolerance, in the unit of each field.
        rtol: Relative tolerance [-].

    Raises:
        BagError: A bag cannot be read or has no such topic, a message on it is of an unknown type, or no stamp is in
            both bags.
    """
    topic_a, topic_b = (topic or _estimate_topic(bag) for bag in (bag_a, bag_b))
    stamps_a, stamps_b = _stamps(bag_a, topic_a), _stamps(bag_b, topic_b)
    numbers_a, numbers_b = _pairs(stamps_a, stamps_b)
    topics = topic_a if topic_a == topic_b else f'{topic_a} and {topic_b}'
    if not len(numbers_a):
        raise BagError(f'{bag_a} and {bag_b}: no stamp on {topics} is in both')
    identical, first = True, ''
    totals: dict[str, FieldDifference] = {}  # with the sum of squares instead of the RMS
    for number, a, b in _decoded_pairs((bag_a, topic_a, numbers_a), (bag_b, topic_b, numbers_b)):
        identical = identical and a[0] == b[0]
        for name, value in a[1].items():
            other = b[1].get(name)
            difference, within = _difference(value, other, atol, rtol)
            largest, squares, outside = astuple(totals.get(name, _NO_DIFFERENCE))
            totals[name] = FieldDifference(max(largest, difference), squares + difference**2, outside + (not within))
            if not within and not first:
                first = f'message {number} at {a[1].get("stamp")} ns: {name} {value!r} -> {other!r}'
    pairs, counts = len(numbers_a), (len(stamps_a), len(stamps_b))
    fields = {name: replace(total, rms=math.sqrt(total.rms / pairs)) for name, total in totals.items()}
    if max(counts) > pairs:
        identical, first = False, first or _first_without_partner(stamps_a, stamps_b, numbers_a, numbers_b)
    return BagComparison(topics, *counts, pairs, identical, first, fields)


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
    first: tuple[Path, str, _Numbers], second: tuple[Path, str, _Numbers]
) -> Iterator[tuple[int, _Decoded, _Decoded]]:
    """Number in the first bag, and both messages, of each pair; memory is that of messages in another order."""
    messages_a, messages_b = _chosen(*first), _chosen(*second)
    waiting: dict[int, _Decoded] = {}
    for number_a, number_b in zip(first[2].tolist(), second[2].tolist(), strict=True):
        _, a = next(messages_a)
        while number_b not in waiting:
            found, waiting[found] = next(messages_b)
        yield number_a + 1, a, waiting.pop(number_b)


def _chosen(bag: Path, topic: str, numbers: _Numbers) -> Iterator[tuple[int, _Decoded]]:
    """The messages on a topic with these numbers."""
    wanted = np.sort(numbers).tolist()
    place = 0
    for number, message in enumerate(_of_topic(bag, topic)):
        if place < len(wanted) and number == wanted[place]:
            place += 1
            yield number, (message.data, _fields(bag, message))


def _stamps(bag: Path, topic: str) -> _Numbers:
    """Stamp of each message on a topic [ns]; 0 if its type has none."""
    found = np.fromiter((_fields(bag, message).get('stamp', 0) for message in _of_topic(bag, topic)), np.int64)
    if not len(found):
        raise BagError(f'{bag}: no message on {topic}')
    return found


def _of_topic(bag: Path, topic: str) -> Iterator[BagMessage]:
    return (message for message in read_messages(bag) if message.topic == topic)


def _estimate_topic(bag: Path) -> str:
    found = [topic for topic, info in bag_topics(bag).items() if info.type_name == ESTIMATE_TYPE]
    if len(found) != 1:
        raise BagError(f'{bag}: {len(found)} topics of {ESTIMATE_TYPE}: choose one with --topic')
    return found[0]


def _fields(bag: Path, message: BagMessage) -> dict[str, Any]:
    if message.type_name not in DECODERS:
        raise BagError(f'{bag}: {message.topic} is {message.type_name}, not a message type of this project')
    try:
        record = DECODERS[message.type_name](message.data)
    except ValueError as error:
        raise BagError(f'{bag}: message on {message.topic} at {message.log_time} ns: {error}') from None
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
