"""Comparison of one topic of two bags: first, largest and root mean square difference."""

import math
from collections.abc import Iterator
from dataclasses import asdict, astuple, dataclass, replace
from itertools import zip_longest
from pathlib import Path
from typing import Any

from seal_friction_ros.core.estimation.messages import DECODERS, ESTIMATE_TYPE
from seal_friction_ros.offline.bags.bag import BagError, BagMessage, bag_topics, read_messages


@dataclass(frozen=True)
class FieldDifference:
    """Difference of one field over all messages, second bag minus first."""

    largest: float  # largest magnitude, in the unit of the field; infinite if only one of the two is a number
    rms: float
    outside: int  # number of messages with a difference outside the tolerance


_NO_DIFFERENCE = FieldDifference(0.0, 0.0, 0)


@dataclass(frozen=True)
class BagComparison:
    """Result of the comparison of two bags."""

    topic: str
    messages_a: int
    messages_b: int
    identical_bytes: bool
    first_difference: str  # for a person; empty if no difference is outside the tolerance
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
    messages_a, messages_b, identical, first = 0, 0, True, ''
    totals: dict[str, FieldDifference] = {}  # with the sum of squares instead of the RMS
    for number, (a, b) in enumerate(zip_longest(_decoded(bag_a, topic_a), _decoded(bag_b, topic_b)), start=1):
        messages_a, messages_b = messages_a + (a is not None), messages_b + (b is not None)
        if a is None or b is None:
            identical, first = False, first or f'message {number}: only one bag has it'
            continue
        identical = identical and a[0] == b[0]
        for name, value in a[1].items():
            other = b[1].get(name)
            difference, within = _difference(value, other, atol, rtol)
            largest, squares, outside = astuple(totals.get(name, _NO_DIFFERENCE))
            totals[name] = FieldDifference(max(largest, difference), squares + difference**2, outside + (not within))
            if not within and not first:
                first = f'message {number} at {a[1].get("stamp")} ns: {name} {value!r} -> {other!r}'
    pairs = min(messages_a, messages_b)
    if not pairs:
        raise BagError(f'{bag_b if messages_a else bag_a}: no message on {topic_a}')
    fields = {name: replace(total, rms=math.sqrt(total.rms / pairs)) for name, total in totals.items()}
    topics = topic_a if topic_a == topic_b else f'{topic_a} and {topic_b}'
    return BagComparison(topics, messages_a, messages_b, identical, first, fields)


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
