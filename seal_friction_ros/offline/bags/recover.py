"""Recovery of the readable part of a damaged or unfinished bag into a valid bag."""

import re
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from seal_friction_ros.files import parse_yaml
from seal_friction_ros.offline.bags import mcap_reader
from seal_friction_ros.offline.bags.bag import BagError, BagWriter
from seal_friction_ros.offline.bags.mcap_reader import Block, Channel
from seal_friction_ros.offline.bags.mcap_writer import Description

_CHUNKS_NAMED = 20
_QOS, _HASH = 'offered_qos_profiles', 'topic_type_hash'


@dataclass(frozen=True)
class Recovery:
    """Result of a recovery."""

    bag: str
    out: str
    messages: int
    """number saved"""
    topics: dict[str, int]
    """topic -> messages saved"""
    first_ns: int
    """log time of the first message [ns]"""
    last_ns: int
    """log time of the last message [ns]"""
    lost_bytes: int
    """at the ends of files, after the last complete record"""
    lost_chunks: int
    """complete chunks with invalid contents"""
    damage: list[str]
    """one line for each fault; empty for a finished and undamaged bag"""

    def summary(self) -> str:
        """The same for a person."""
        until = datetime.fromtimestamp(self.last_ns * 1e-9, UTC)
        saved = f'{self.out}: {self.messages} messages saved, up to log time {self.last_ns} ns ({until:%F %T} UTC)'
        if not self.damage:
            return f'{saved}; the bag is not damaged'
        lost = f'lost: {self.lost_bytes} bytes at the ends of files, {self.lost_chunks} chunks'
        return '\n'.join([f'{saved}; {lost}, and messages that the recorder had not written', *self.damage])


def recover(bag: Path, out: Path | None = None) -> Recovery:
    """Copy every readable message, in order, to a new bag.

    Args:
        bag: Folder of a bag, with any or no ``metadata.yaml``, or an MCAP file.
        out: Bag to make; must not exist. Default: beside ``bag``, with ``_recovered`` after its name.

    Raises:
        BagError: Nothing can be read, or ``out`` exists already; then nothing is left at ``out``.
    """
    files = _files(bag)
    out = out or bag.resolve().with_name(f'{bag.resolve().stem if bag.is_file() else bag.resolve().name}_recovered')
    copy = _Copy()
    with BagWriter(out) as writer:
        for file in files:
            copy.take(file, writer)
        if not copy.counts:
            reason = '; '.join(copy.damage) or 'no message in it'
            raise BagError(f'{bag}: nothing to recover: {reason}')
    counts = copy.counts
    return Recovery(
        str(bag),
        str(out),
        counts.total(),
        dict(sorted(counts.items())),
        copy.first,
        copy.last,
        copy.lost_bytes,
        copy.lost_chunks,
        copy.damage,
    )


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
    parts = re.split(r'([0-9]+)', name)
    return [int(part) if place % 2 else part for place, part in enumerate(parts)]


class _Copy:
    """State of `recover`."""

    def __init__(self) -> None:
        self.counts: Counter[str] = Counter()
        self.first, self.last = -1, -1
        self.lost_bytes = self.lost_chunks = 0
        self.damage: list[str] = []
        self._descriptions: dict[tuple[str, str], Description] = {}

    def take(self, path: Path, writer: BagWriter) -> None:
        """Copy the readable messages of one file."""

        def on_fault(block: Block, reason: str) -> None:
            self.lost_chunks += 1
            if self.lost_chunks <= _CHUNKS_NAMED:
                self.damage.append(f'{path.name}: chunk at byte {block.offset}: {reason}')

        try:
            with path.open('rb') as file:
                layout = mcap_reader.scan(file)
                if layout.damage:
                    self.lost_bytes += path.stat().st_size - layout.sound_size
                    self.damage.append(f'{path.name}: {layout.damage}')
                for channel, log_time, data in mcap_reader.messages(file, layout, on_fault):
                    description = self._description(channel, path)
                    self.last = writer.write(channel.topic, channel.type_name, log_time, data, description)
                    self.first = self.last if self.first < 0 else self.first
                    self.counts[channel.topic] += 1
        except BagError:
            raise
        except ValueError as error:
            self.damage.append(f'{path.name}: {error}')

    def _description(self, channel: Channel, path: Path) -> Description:
        key = (channel.topic, channel.type_name)
        if key not in self._descriptions:
            if channel.encoding != 'cdr':
                raise BagError(f'{path}: {channel.topic} is encoded as {channel.encoding[:40]!r}, not as CDR')
            self._descriptions[key] = _described(channel)
        return self._descriptions[key]


def _described(channel: Channel) -> Description:
    """Description in the damaged bag, without a QoS that is not in the format of rosbag2."""
    text = channel.metadata.get(_QOS, '')
    try:
        profiles = parse_yaml(text.encode(), channel.topic)
    except ValueError:
        profiles = None
    known = isinstance(profiles, list) and all(
        isinstance(p, Mapping) and isinstance(p.get('history'), str) for p in profiles
    )
    metadata = {_QOS: text if known else '[]', _HASH: channel.metadata.get(_HASH, '')}
    return Description(channel.type_name, channel.definition_encoding, channel.definition, metadata)
