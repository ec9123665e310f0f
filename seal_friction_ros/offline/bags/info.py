"""Contents of a bag: topics, counts, rates, friction states, status bits, seals."""

from collections import Counter
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from textwrap import fill
from typing import Any

from seal_friction_ros.core.foundation.stamps import StampRepair
from seal_friction_ros.core.friction.states import FrictionState
from seal_friction_ros.core.machine.machine_snapshot import parse_machine_text
from seal_friction_ros.core.messages.coder import decode, decode_text
from seal_friction_ros.core.messages.definitions import short_name
from seal_friction_ros.core.messages.fields import Reader
from seal_friction_ros.core.messages.layouts import CONFIGURATION_TYPE, ESTIMATE_TYPE, MACHINE_TYPE
from seal_friction_ros.core.messages.records import FrictionEstimate, Status
from seal_friction_ros.core.messages.together import decode_together
from seal_friction_ros.offline.bags.bag import BagError, BagMessage, bag_topics, named, read_definitions
from seal_friction_ros.offline.bags.mapped_bag import MappingFile, machine_messages

_WIDTH = 80  # characters of a line
_WHOLE_NAMES: dict[str, Any] = {'subsequent_indent': '    ', 'break_long_words': False, 'break_on_hyphens': False}


@dataclass(frozen=True)
class BagInfo:
    """Summary of a bag."""

    bag: str
    start_ns: int  # log time of the first message [ns]
    duration_s: float
    messages: int
    topics: dict[str, dict[str, float | str]]  # topic -> type, count and rate [Hz]
    states: dict[str, int]  # estimates in each friction state
    status: dict[str, int]  # estimates with each status bit set; ``all good``: those without any
    stamps: dict[str, dict[str, int]]  # topic -> jumps of its stamps, stamps after a jump, messages not of its type
    seals: list[str]  # each seal with its chamber, from the newest configuration in the bag

    def summary(self) -> str:
        """The same for a person."""
        lines = [f'{self.bag}: {self.messages} messages in {self.duration_s:.3f} s']
        lines += [f'  {topic}: {t["count"]} x {t["type"]}, {t["rate_Hz"]} Hz' for topic, t in self.topics.items()]
        texts = {'seals': self.seals}
        for title, counts in (('states', self.states), ('status', self.status)):
            texts[title] = [f'{name} {count}' for name, count in counts.items()]
        lines += [
            f'  {topic}: {", ".join(f"{count} {what}" for what, count in found.items() if count)}'
            for topic, found in self.stamps.items()
        ]
        lines += [f'  {title}: {", ".join(values)}' for title, values in texts.items() if values]
        return '\n'.join(fill(line, _WIDTH, **_WHOLE_NAMES) for line in lines)


def bag_info(bag: Path, mapping: MappingFile | None = None) -> BagInfo:
    """Read a bag and summarise it.

    With the ``mapping`` of its machine, if the bag does not hold it, the estimates are made here. Raises BagError if
    the bag cannot be read or holds no message, ValueError if the mapping does not fit it.
    """
    known = bag_topics(bag)
    times: list[int] = []
    states: Counter[str] = Counter()
    status: Counter[str] = Counter()
    seals: list[str] = []
    stamps = _Stamps(bag)
    count = 0
    for message in machine_messages(bag, mapping):
        count += message.topic in known
        stamps.add(message)
        times = [times[0] if times else message.log_time, message.log_time]
        with named(bag, message):
            for estimate in _estimates(message):
                states[FrictionState(estimate.state).name] += 1
                status.update([str(bit.name) for bit in Status if estimate.status & bit] or ['all good'])
            if message.type_name == CONFIGURATION_TYPE:
                seals = _seals(decode_text(message.data))
    if not count:
        raise BagError(f'{bag}: no message in it')
    duration = (times[-1] - times[0]) * 1e-9
    topics: dict[str, dict[str, float | str]] = {
        topic: {
            'type': info.type_name,
            'count': info.message_count,
            'rate_Hz': round((info.message_count - 1) / duration, 3) if duration and info.message_count > 1 else 0.0,
        }
        for topic, info in sorted(known.items())
    }
    return BagInfo(str(bag), times[0], duration, count, topics, dict(states), dict(status), stamps.found(), seals)


class _Stamps:
    """Stamps that jump, and messages that are not of their type, by topic; the bag has the definitions of the types."""

    def __init__(self, bag: Path) -> None:
        self._bag = bag
        self._readers: dict[str, Reader | None] = {}
        self._repairs: dict[str, StampRepair] = {}
        self._malformed: Counter[str] = Counter()

    def add(self, message: BagMessage) -> None:
        """Take one message; of a type without a definition nothing is counted."""
        topic, kind = message.topic, short_name(message.type_name)
        if topic not in self._readers:
            self._readers[topic], self._repairs[topic] = None, StampRepair()
            with suppress(ValueError):  # of a type without a definition
                self._readers[topic] = Reader(read_definitions(self._bag, [kind])[kind], kind, [])
        reader = self._readers[topic]
        if reader is None:
            return
        try:
            if (stamp := reader.read(message.data).stamp) is not None:
                self._repairs[topic].next(stamp, message.log_time)
        except ValueError:
            self._malformed[topic] += 1

    def found(self) -> dict[str, dict[str, int]]:
        """Counts of each topic on which something is wrong."""
        return {
            topic: {
                'jumps of the stamp': repair.jumps,
                'stamps off by a jump': repair.repaired,
                'messages not of their type': self._malformed[topic],
            }
            for topic, repair in sorted(self._repairs.items())
            if repair.jumps or self._malformed[topic]
        }


def _estimates(message: BagMessage) -> list[FrictionEstimate]:
    """Estimates in a message; ValueError if it does not match its type."""
    if message.type_name == ESTIMATE_TYPE:
        return [decode(ESTIMATE_TYPE, message.data)]
    if message.type_name != MACHINE_TYPE:
        return []
    return [answer.record for answer in decode_together(message.data) if isinstance(answer.record, FrictionEstimate)]


def _seals(text: str) -> list[str]:
    return [
        f'{name}: {seal} on chamber {chamber}'.removeprefix(': ')
        for name, one in parse_machine_text(text).configurations.items()
        for seal, chamber in zip(one.selection.seals, one.selection.seal_chambers, strict=True)
    ]
