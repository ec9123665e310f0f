"""Comparison of one topic of two bags: first, largest and root mean square difference."""

import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from itertools import zip_longest
from pathlib import Path
from typing import Any

from seal_friction_ros.core.estimation.messages import DECODERS, ESTIMATE_TYPE
from seal_friction_ros.offline.bags.bag import BagError, BagMessage, bag_topics, read_messages


@dataclass(frozen=True)
class FieldDifference:
    """Difference of one field over all messages, second bag minus first."""

    largest: float
    """largest magnitude, in the unit of the field; infinite if only one of the two is a number"""
    rms: float
    outside: int
    """number of messages with a difference outside the tolerance"""


@dataclass(frozen=True)
class BagComparison:
    """Result of the comparison of two bags."""

    topic: str
    messages_a: int
    messages_b: int
    identical_bytes: bool
    first_difference: str
    """for a person; empty if no difference is outside the tolerance"""
    fields: dict[str, FieldDifference]

    @property
    def agree(self) -> bool:
        """Whether both bags have the same number of messages and every field is within tolerance."""
        return not self.first_difference

    def numbers(self) -> dict[str, Any]:
        """Numbers for JSON."""
        return {**asdict(self), 'agree': self.agree}

    def summary(self) -> str:
        """One line for the topic and one for each field that differs, for a person."""
        result = 'agree' if self.agree else f'differ: {self.first_difference}'
        differing = {name: field for name, field in self.fields.items() if field.largest > 0.0}
        return '\n'.join(
            [
                f'{self.messages_a} and {self.messages_b} messages on {self.topic}: {result}',
                *(f'{name}: largest {f.largest:.6g}, RMS {f.rms:.6g}' for name, f in differing.items()),
            ]
        )


def compare(bag_a: Path, bag_b: Path, topic: str = '', atol: float = 0.0, rtol: float = 0.0) -> BagComparison:
    """Compare a topic of two bags, message by message in order.

    Two numbers agree if ``|b - a| <= atol + rtol |a|`` or if both are NaN, other values if they are equal.

    Args:
        bag_a: First bag, the reference.
        bag_b: Second bag.
        topic: Topic; by default that of the friction estimates, which may have another name in each bag.
        atol: Absolute tolerance, in the unit of each field.
        rtol: Relative tolerance [-].

    Raises:
        BagError: A bag cannot be read or has no such topic, or a message on it is of an unknown type.
    """
    topic_a, topic_b = (topic or _estimate_topic(bag) for bag in (bag_a, bag_b))
    tally = _Tally(atol, rtol)
    for a, b in zip_longest(_decoded(bag_a, topic_a), _decoded(bag_b, topic_b)):
        tally.add(a, b)
    if not tally.messages_a or not tally.messages_b:
        raise BagError(f'{bag_a if not tally.messages_a else bag_b}: no message on {topic_a}')
    return tally.comparison(topic_a if topic_a == topic_b else f'{topic_a} and {topic_b}')


def _estimate_topic(bag: Path) -> str:
    found = [topic for topic, info in bag_topics(bag).items() if info.type_name == ESTIMATE_TYPE]
    if len(found) != 1:
        raise BagError(f'{bag}: {len(found)} topics of {ESTIMATE_TYPE}: choose one with --topic')
    return found[0]


def _decoded(bag: Path, topic: str) -> Iterator[tuple[bytes, dict[str, Any]]]:
    for message in read_messages(bag):
        if message.topic == topic:
            yield message.data, _fields(bag, message)


def _fields(bag: Path, message: BagMessage) -> dict[str, Any]:
    if message.type_name not in DECODERS:
        raise BagError(f'{bag}: {message.topic} is {message.type_name}, not a message type of this project')
    try:
        record = DECODERS[message.type_name](message.data)
    except ValueError as error:
        raise BagError(f'{bag}: message on {message.topic} at {message.log_time} ns: {error}') from None
    return record._asdict() if hasattr(record, '_asdict') else {'text': record}


class _Tally:
    """Running differences."""

    def __init__(self, atol: float, rtol: float) -> None:
        self.messages_a = self.messages_b = 0
        self._atol, self._rtol = atol, rtol
        self._identical = True
        self._first = ''
        self._largest: dict[str, float] = {}
        self._squares: dict[str, float] = {}
        self._outside: dict[str, int] = {}

    def add(self, a: tuple[bytes, dict[str, Any]] | None, b: tuple[bytes, dict[str, Any]] | None) -> None:
        """Add one pair of messages; None where one bag has ended."""
        self.messages_a += a is not None
        self.messages_b += b is not None
        if a is None or b is None:
            self._identical = False
            self._first = self._first or f'message {max(self.messages_a, self.messages_b)}: only one bag has it'
            return
        self._identical = self._identical and a[0] == b[0]
        for name, value in a[1].items():
            self._add_field(name, value, b[1].get(name), a[1].get('stamp'))

    def _add_field(self, name: str, a: Any, b: Any, stamp: int | None) -> None:
        difference, within = _difference(a, b, self._atol, self._rtol)
        self._largest[name] = max(self._largest.get(name, 0.0), difference)
        self._squares[name] = self._squares.get(name, 0.0) + difference**2
        self._outside[name] = self._outside.get(name, 0) + (not within)
        if not within and not self._first:
            self._first = f'message {self.messages_a} at {stamp} ns: {name} {a!r} -> {b!r}'

    def comparison(self, topic: str) -> BagComparison:
        """Result over all pairs."""
        pairs = max(min(self.messages_a, self.messages_b), 1)
        fields = {
            name: FieldDifference(self._largest[name], math.sqrt(self._squares[name] / pairs), self._outside[name])
            for name in self._largest
        }
        return BagComparison(topic, self.messages_a, self.messages_b, self._identical, self._first, fields)


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
