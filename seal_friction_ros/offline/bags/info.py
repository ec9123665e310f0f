"""Contents of a bag: topics, counts, rates, friction states, status bits, seals."""

from collections import Counter
from dataclasses import dataclass
from pathlib import Path

from seal_friction_ros.core.estimation.messages import CONFIGURATION_TYPE, ESTIMATE_TYPE, decode, decode_text
from seal_friction_ros.core.estimation.records import Status
from seal_friction_ros.core.friction.states import FrictionState
from seal_friction_ros.core.machine.machine_snapshot import parse_machine_text
from seal_friction_ros.offline.bags.bag import BagError, bag_topics, read_messages


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
    seals: list[str]  # each seal with its chamber, from the newest configuration in the bag

    def summary(self) -> str:
        """The same for a person."""
        lines = [f'{self.bag}: {self.messages} messages in {self.duration_s:.3f} s']
        lines += [f'  {topic}: {t["count"]} x {t["type"]}, {t["rate_Hz"]} Hz' for topic, t in self.topics.items()]
        counts = {'states': self.states, 'status': self.status}
        texts = {'seals': self.seals} | {
            title: [f'{name} {count}' for name, count in of_kind.items()] for title, of_kind in counts.items()
        }
        return '\n'.join([*lines, *(f'  {title}: {", ".join(values)}' for title, values in texts.items() if values)])


def bag_info(bag: Path) -> BagInfo:
    """Read a bag and summarise it.

    Raises:
        BagError: It cannot be read, or holds no message.
    """
    times: list[int] = []
    states: Counter[str] = Counter()
    status: Counter[str] = Counter()
    seals: list[str] = []
    count = 0
    for message in read_messages(bag):
        count += 1
        times = [times[0] if times else message.log_time, message.log_time]
        try:
            if message.type_name == ESTIMATE_TYPE:
                estimate = decode(ESTIMATE_TYPE, message.data)
                states[FrictionState(estimate.state).name] += 1
                status.update([str(bit.name) for bit in Status if estimate.status & bit] or ['all good'])
            elif message.type_name == CONFIGURATION_TYPE:
                seals = _seals(decode_text(message.data))
        except ValueError as error:
            raise BagError(f'{bag}: message on {message.topic} at {message.log_time} ns: {error}') from None
    if not count:
        raise BagError(f'{bag}: no message in it')
    duration = (times[-1] - times[0]) * 1e-9
    topics: dict[str, dict[str, float | str]] = {
        topic: {
            'type': info.type_name,
            'count': info.message_count,
            'rate_Hz': round((info.message_count - 1) / duration, 3) if duration and info.message_count > 1 else 0.0,
        }
        for topic, info in sorted(bag_topics(bag).items())
    }
    return BagInfo(str(bag), times[0], duration, count, topics, dict(states), dict(status), seals)


def _seals(text: str) -> list[str]:
    """Each seal with its chamber in the text of a configuration, of a machine with the name of its actuator.

    Raises:
        ValueError: The text is no configuration.
    """
    return [
        f'{name}: {seal} on chamber {chamber}'.removeprefix(': ')
        for name, one in parse_machine_text(text).configurations.items()
        for seal, chamber in zip(one.selection.seals, one.selection.seal_chambers, strict=True)
    ]
