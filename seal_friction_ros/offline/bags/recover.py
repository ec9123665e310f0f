"""Recovery of the readable part of a damaged or unfinished bag into a valid bag."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from functools import partial
from pathlib import Path

from seal_friction_ros.core.messages.cdr import ENCODING
from seal_friction_ros.files import parse_yaml
from seal_friction_ros.offline.bags import mcap_reader
from seal_friction_ros.offline.bags.bag import BagError, BagWriter
from seal_friction_ros.offline.bags.mcap_reader import Block, Channel
from seal_friction_ros.offline.bags.mcap_writer import Description

_MOST_NAMED = 20  # faults of a kind
_QOS, _HASH = 'offered_qos_profiles', 'topic_type_hash'


@dataclass
class Recovery:
    """Result of a recovery."""

    bag: str
    out: str
    messages: int = 0  # number saved
    topics: dict[str, int] = field(default_factory=dict)  # topic -> messages saved
    first_ns: int = -1  # log time of the first message [ns]
    last_ns: int = -1  # log time of the last message [ns]
    lost_bytes: int = 0  # at the ends of files, after the last complete record
    lost_messages: int = 0  # whole messages whose log time is none
    lost_chunks: int = 0  # complete chunks with invalid contents
    damage: list[str] = field(default_factory=list)  # one line for each fault; empty for a finished and undamaged bag

    def say(self, number: int, text: str) -> None:
        """Name the fault of a kind with this number, of the first ones."""
        if number <= _MOST_NAMED:
            self.damage.append(text)

    def summary(self) -> str:
        """The same for a person."""
        until = datetime.fromtimestamp(self.last_ns * 1e-9, UTC)
        saved = f'{self.out}: {self.messages} messages saved, up to log time {self.last_ns} ns ({until:%F %T} UTC)'
        if not self.damage:
            return f'{saved}; the bag is not damaged'
        lost = f'lost: {self.lost_bytes} bytes at the ends of files, {self.lost_chunks} chunks'
        lost += f', {self.lost_messages} messages without a valid log time' if self.lost_messages else ''
        return '\n'.join([f'{saved}; {lost}, and messages that the recorder had not written', *self.damage])


def recover(bag: Path, out: Path | None = None) -> Recovery:
    """Copy every readable message, in order, from an MCAP file or a folder, with any or no metadata, to a new bag.

    It is ``out``, by default beside ``bag`` with ``_recovered`` after its name. BagError: nothing can be read, or
    ``out`` exists already; then nothing is left at ``out``.
    """
    files = _files(bag)
    out = out or bag.resolve().with_name(f'{bag.resolve().stem if bag.is_file() else bag.resolve().name}_recovered')
    found = Recovery(str(bag), str(out))
    with BagWriter(out) as writer:
        for file in files:
            _copy(file, writer, found)
        if not found.messages:
            reason = '; '.join(found.damage) or 'no message in it'
            raise BagError(f'{bag}: nothing to recover: {reason}')
    found.topics = dict(sorted(found.topics.items()))
    return found


def _files(bag: Path) -> list[Path]:
    """MCAP files of a bag in the order of recording, without links."""
    if bag.is_file():
        return [bag]
    if not bag.is_dir():
        raise BagError(f'{bag}: no such file or folder')
    files = [path for path in bag.glob('*.mcap') if path.is_file() and not path.is_symlink()]
    if not files:
        raise BagError(f'{bag}: no MCAP file in it, nothing to recover')
    return sorted(files, key=lambda path: _parts(path.name))


def _parts(name: str) -> list[str | int]:
    """Texts and numbers in turn, text first, to sort ``bag_10.mcap`` after ``bag_9.mcap``."""
    return [int(part) if place % 2 else part for place, part in enumerate(re.split(r'([0-9]+)', name))]


def _copy(path: Path, writer: BagWriter, found: Recovery) -> None:
    descriptions: dict[tuple[str, str], Description] = {}

    def on_fault(block: Block, reason: str) -> None:
        found.lost_chunks += 1
        found.say(found.lost_chunks, f'{path.name}: chunk at byte {block.offset}: {reason}')

    def on_wrong_time(time: int) -> None:
        found.lost_messages += 1
        found.say(found.lost_messages, f'{path.name}: a message with a log time of {time} ns, which is none')

    locate = partial(mcap_reader.located, on_wrong_time=on_wrong_time)
    try:
        with path.open('rb') as file:
            layout = mcap_reader.scan(file)
            if layout.damage:
                found.lost_bytes += path.stat().st_size - layout.sound_size
                found.damage.append(f'{path.name}: {layout.damage}')
            for channel, log_time, publish_time, data in mcap_reader.messages(file, layout, on_fault, locate):
                topic, encoding, description = channel
                if encoding != ENCODING:
                    raise BagError(f'{path}: {topic} is encoded as {encoding[:40]!r}, not as {ENCODING}')
                if (topic, description.type_name) not in descriptions:
                    descriptions[topic, description.type_name] = _described(channel)
                known = descriptions[topic, description.type_name]
                found.last_ns = writer.write(topic, known.type_name, log_time, data, publish_time, known)
                found.first_ns = found.last_ns if found.first_ns < 0 else found.first_ns
                found.messages += 1
                found.topics[topic] = found.topics.get(topic, 0) + 1
    except BagError:
        raise
    except ValueError as error:
        found.damage.append(f'{path.name}: {error}')


def _described(channel: Channel) -> Description:
    """Description in the damaged bag, without a QoS that is not in the format of rosbag2."""
    metadata = channel.description.metadata
    text = metadata.get(_QOS, '')
    try:
        profiles = parse_yaml(text.encode(), channel.topic)
    except ValueError:
        profiles = None
    known = isinstance(profiles, list) and all(
        isinstance(p, Mapping) and isinstance(p.get('history'), str) for p in profiles
    )
    return channel.description._replace(metadata={_QOS: text if known else '[]', _HASH: metadata.get(_HASH, '')})
