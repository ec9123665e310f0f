"""rosbag2 bags: a folder with ``metadata.yaml`` and MCAP files (profile ``ros2``), written and read.

A written bag contains its message definitions and opens in ``ros2 bag``, Foxglove, PlotJuggler, ``rosbags`` and the
``mcap`` reader. Any rosbag2 bag (MCAP or SQLite) or bare MCAP or SQLite file can be read, from an untrusted source too:
memory is bounded, and no file outside the bag is opened.
"""

import errno
import os
import re
import shutil
import sqlite3
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, nullcontext
from datetime import UTC, datetime
from functools import cache
from itertools import islice
from pathlib import Path, PurePosixPath
from types import TracebackType
from typing import Any, NamedTuple, Self

import numpy as np
import yaml

from seal_friction_ros.core.foundation.errors import named_errors
from seal_friction_ros.core.messages.blocks import MOST_MESSAGES, Messages
from seal_friction_ros.core.messages.cdr import ENCODING
from seal_friction_ros.core.messages.coder import DECODERS
from seal_friction_ros.core.messages.definitions import Definition, full_name, parse_definition, short_name
from seal_friction_ros.core.messages.layouts import CONFIGURATION_TYPE
from seal_friction_ros.files import parse_yaml, read_yaml
from seal_friction_ros.offline.bags import mcap_reader, sqlite_reader
from seal_friction_ros.offline.bags.definitions import known_definition, message_definition
from seal_friction_ros.offline.bags.mcap_reader import Channel
from seal_friction_ros.offline.bags.mcap_writer import FILE_MODE, Contents, Description, McapOutput

PRESSURE_TOPIC = '/cylinder_pressure'
VELOCITY_TOPIC = '/rod_velocity'
POSITION_TOPIC = '/rod_position'
TEMPERATURE_TOPIC = '/seal_temperature'
FORCE_TOPIC = '/force_sum'
REFERENCE_TOPIC = '/servo_reference'
ESTIMATE_TOPIC = '/friction_estimate'
FEEDFORWARD_TOPIC = '/friction_feedforward'
CONFIGURATION_TOPIC = '/friction_estimator/configuration'
STATE_NAME = 'state'  # last part of the name of the topic of states, beside ``configuration``: snapshots amid a bag
STATE_TYPE = 'std_msgs/msg/String'  # laid out as a configuration, and not taken for one
STATE_PERIOD = 60.0  # [s] of log time between two of them in a bag that is written here

START_IN_NAME = re.compile(r'_[0-9]{8}_[0-9]{6}_[0-9]{6}\Z')  # Time of the start at the end of the name of a bag.

LARGEST_METADATA = 1 << 20  # [bytes] of metadata.yaml, with some 5000 files or 1000 topics
_FOLDER_MODE = 0o750  # of a bag, less what the umask of the process forbids
_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
_FOREVER = {'sec': 9223372036, 'nsec': 854775807}


BagMessage = mcap_reader.BagMessage


class BagError(ValueError):
    """A bag that cannot be read or written; one line that says which and why."""


class DamagedError(BagError):
    """A bag whose files are not whole; ``seal_friction recover`` makes a bag of what can be read."""


def named(bag: Path, message: BagMessage) -> AbstractContextManager[None]:
    """Convert the error of a message to one that names it."""
    return named_errors(f'{bag}: message on {message.topic} at {message.log_time} ns', raised=BagError)


def timed_name(name: str) -> str:
    """``name`` with the present time (UTC) at its end, in the place of another time there."""
    return f'{START_IN_NAME.sub("", name)}_{datetime.now(UTC):%Y%m%d_%H%M%S_%f}'


@cache
def describe(type_name: str) -> Description:
    """Description of a topic whose type is installed; BagError if it is not."""
    try:
        definition, type_hash = message_definition(type_name)
    except ValueError as error:
        raise BagError(str(error)) from None
    metadata = {'offered_qos_profiles': _yaml_text([_qos(type_name)]), 'topic_type_hash': type_hash}
    return Description(type_name, 'ros2msg', definition.encode(), metadata)


class BagWriter:
    """Writes one bag, message by message, in the order given.

    Log times are made strictly increasing, since readers sort by them: they return the messages in the order written.
    ``metadata.yaml`` exists from the start. It is updated after each finished file, for each new topic, and at the end.

    As a context manager it removes the bag if the block fails, so that a failed command leaves no files. BagError:
    there is something at ``path`` already, or it cannot be made.

    Args:
        path: Folder of the bag; must not exist.
        split_size: Largest size of a file, after which the next one begins [bytes]; 0: no limit.
        split_duration: Longest duration of a file, after which the next one begins [s]; 0: no limit.
        custom_data: For ``metadata.yaml``.
    """

    def __init__(
        self,
        path: Path,
        *,
        split_size: int = 0,
        split_duration: float = 0.0,
        custom_data: Mapping[str, str] | None = None,
    ) -> None:
        self.path = path
        for type_name in DECODERS:
            describe(type_name)  # raises here and not at the first message
        self._split_size, self._split_time = split_size, round(split_duration * 1e9)
        self._is_split = bool(self._split_size or self._split_time)
        self._descriptions: dict[tuple[str, str], Description] = {}
        self._listed = 0
        self._last_time = -1
        self._custom_data = dict(custom_data or {})
        self._finished: list[tuple[str, Contents]] = []
        self._finished_size = 0
        try:
            path.mkdir(_FOLDER_MODE, parents=True)
        except FileExistsError:
            raise BagError(f'{path} exists already: not overwriting') from None
        except OSError as error:
            raise BagError(f'{path}: cannot make a bag there: {error.strerror}') from None
        try:
            self._output = self._file(0)
            try:
                self._write_metadata()
            except OSError:
                self._output.close()
                raise
        except OSError as error:
            shutil.rmtree(path, ignore_errors=True)  # made above
            raise BagError(f'{path}: cannot make a bag there: {error.strerror}') from None

    def write(
        self,
        topic: str,
        type_name: str,
        log_time: int,
        data: bytes,
        publish_time: int | None = None,
        description: Description | None = None,
    ) -> int:
        """Append one serialised message with a ``log_time`` [ns]; OSError if writing fails.

        The ``publish_time`` [ns] is on any clock, by default the recorded log time. A topic whose type is installed
        needs no ``description``. Returns the recorded log time [ns]: the one given, or 1 ns after the last one if that
        is later.
        """
        key = (topic, type_name)
        if key not in self._descriptions:
            self._descriptions[key] = description or describe(type_name)
        if log_time <= self._last_time:
            log_time = self._last_time + 1
        if self._is_split and self._is_full(log_time, len(data)):
            self._split()
        self._last_time = log_time
        self._output.write(key, self._descriptions[key], log_time, data, publish_time)
        return log_time

    def flush(self) -> None:
        """Pass all messages to the operating system, so that they outlive this process; OSError if writing fails."""
        self._output.flush()
        if len(self._descriptions) > self._listed:
            self._write_metadata()

    @property
    def message_count(self) -> int:
        """Number of messages written so far."""
        return sum(contents.messages for _, contents in self._files())

    @property
    def size(self) -> int:
        """Of all files with pending messages [bytes]."""
        return self._finished_size + self._output.size

    def close(self, custom_data: Mapping[str, str] | None = None) -> None:
        """Write pending messages, index and final ``metadata.yaml``, with ``custom_data``; OSError if writing fails."""
        self._custom_data |= custom_data or {}
        self._output.finish(_yaml_text(self._information()))
        self._write_metadata()
        self._output.close()

    def rescue(self, failure: str, offered: int) -> None:
        """After a failure, leave a valid bag of all complete chunks; on a full disk, drop chunks to make room.

        ``metadata.yaml`` tells the ``failure``, and how many of the ``offered`` messages are not in the bag. Raises
        OSError if the bag could not be completed: use ``seal_friction recover``.
        """
        try:
            while True:
                try:
                    self._output.finish_early()
                    dropped = str(offered - self.message_count)
                    self._custom_data |= {'dropped_messages': dropped, 'failure': failure}
                    self._write_metadata()
                    return
                except OSError as error:
                    if error.errno not in _FULL:
                        raise
                    if not self._output.give_back():
                        break
            if self._finished:
                self._output.path.unlink(missing_ok=True)  # new, without a chunk
            (self.path / 'metadata.yaml').unlink(missing_ok=True)  # frees the last space
            self._write_metadata()
        finally:
            self._output.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            if kind is None:
                self.close()
                return
        except OSError:
            self.remove()
            raise
        self.remove()

    def remove(self) -> None:
        """Remove the bag."""
        self._output.close()
        shutil.rmtree(self.path, ignore_errors=True)

    def _is_full(self, log_time: int, size: int) -> bool:
        too_large = self._split_size and self._output.size + size > self._split_size
        too_long = self._split_time and log_time - self._output.first_time > self._split_time
        return bool(self._output.counts and (too_large or too_long))

    def _file(self, number: int) -> McapOutput:
        return McapOutput(self.path / f'{self.path.name}_{number}.mcap')

    def _files(self) -> list[tuple[str, Contents]]:
        return [*self._finished, (self._output.path.name, self._output.contents)]

    def _split(self) -> None:
        finished = self._output
        finished.finish(_yaml_text(self._information()))
        following = self._file(len(self._finished) + 1)
        finished.close()
        self._finished.append((finished.path.name, finished.contents))
        self._finished_size += finished.size
        self._output = following
        self._write_metadata()

    def _information(self) -> dict[str, Any]:
        files = [file for file in self._files() if file[1].messages] or self._files()[:1]
        spans = [contents for _, contents in files]
        counts: Counter[tuple[str, str]] = Counter()
        for contents in spans:
            counts.update(contents.counts)
        return {
            'version': 9,
            'storage_identifier': 'mcap',
            'relative_file_paths': [name for name, _ in files],
            **_span_information(spans[0].first_time, spans[-1].last_time, self.message_count),
            'topics_with_message_count': [
                {'topic_metadata': _topic_metadata(topic, description), 'message_count': counts[topic, type_name]}
                for (topic, type_name), description in self._descriptions.items()
                if (topic, type_name) in counts
            ],
            'compression_format': '',
            'compression_mode': '',
            'files': [
                {'path': name, **_span_information(*contents[1:3], contents.messages)} for name, contents in files
            ],
            'custom_data': self._custom_data or None,
            'ros_distro': os.environ.get('ROS_DISTRO', 'unknown'),
        }

    def _write_metadata(self) -> None:
        text = _yaml_text({'rosbag2_bagfile_information': self._information()})
        partial = self.path / 'metadata.yaml.partial'
        try:
            partial.touch(FILE_MODE)
            partial.write_text(text)
            partial.replace(self.path / 'metadata.yaml')
        except OSError:
            partial.unlink(missing_ok=True)
            raise
        self._listed = len(self._descriptions)


def _span_information(first_time: int, last_time: int, messages: int) -> dict[str, Any]:
    return {
        'duration': {'nanoseconds': last_time - first_time},
        'starting_time': {'nanoseconds_since_epoch': first_time},
        'message_count': messages,
    }


def _topic_metadata(topic: str, description: Description) -> dict[str, Any]:
    return {
        'name': topic,
        'type': description.type_name,
        'serialization_format': ENCODING,
        'offered_qos_profiles': _parsed(description.metadata['offered_qos_profiles']),
        'type_description_hash': description.metadata['topic_type_hash'],
    }


_parsed = cache(lambda text: parse_yaml(text.encode(), 'QoS'))


class _PlainDumper(yaml.SafeDumper):
    """Writes no aliases, since some bag readers do not support them."""

    def ignore_aliases(self, data: Any) -> bool:
        del data
        return True


def _yaml_text(document: Any) -> str:
    return yaml.dump(document, Dumper=_PlainDumper, sort_keys=False)


def _qos(type_name: str) -> dict[str, Any]:
    latched = type_name == CONFIGURATION_TYPE
    return {
        'history': 'keep_last',
        'depth': 1 if latched else 100,
        'reliability': 'reliable',
        'durability': 'transient_local' if latched else 'volatile',
        'deadline': _FOREVER,
        'lifespan': _FOREVER,
        'liveliness': 'automatic',
        'liveliness_lease_duration': _FOREVER,
        'avoid_ros_namespace_conventions': False,
    }


def read_messages(path: Path) -> Iterator[BagMessage]:
    """Messages of a bag folder, or of a bare MCAP or SQLite file; file by file, each in order of log time.

    BagError: there is no bag, or it is damaged; raised when the damage is reached.
    """
    with _as_bag_errors(path):
        found = storage(path)
        for message in found.read('file_messages'):
            is_packed = found.packed == 'message'
            yield message._replace(data=mcap_reader.unpack_zstd(message.data)) if is_packed else message


KindOf = Callable[[str, str], int]  # Topic and message type -> kind of its messages, for example a `Kind`; below 255.


def gathered(messages: Iterable[BagMessage], kind_of: KindOf) -> Iterator[Messages]:
    """Messages of `read_messages` in blocks."""
    source = iter(messages)
    while block := list(islice(source, MOST_MESSAGES // 4)):
        kinds = np.array([kind_of(message.topic, message.type_name) for message in block], np.uint8)
        sizes = np.array([len(message.data) for message in block], np.int64)
        data = np.frombuffer(b''.join(message.data for message in block), np.uint8)
        times = np.array([message.log_time for message in block], np.int64)
        sent = [message.log_time if message.publish_time is None else message.publish_time for message in block]
        yield Messages(data, kinds, np.cumsum(sizes) - sizes, sizes, times, np.array(sent, np.int64))


class Storage(NamedTuple):
    """Files of a bag and how to read them."""

    files: tuple[Path, ...]
    reader: Any  # `mcap_reader` or `sqlite_reader`: `file_messages` and `file_channels` of a file
    packed: str  # what is compressed by zstd: ``none``, each ``message`` or each ``file``

    @property
    def is_plain_mcap(self) -> bool:
        """Whether the files are MCAP with messages that are not packed."""
        return self.reader is mcap_reader and self.packed == 'none'

    def read(self, function: str) -> Iterator[Any]:
        """What a function of the reader gives for one file after the other."""
        for file in self.files:
            with mcap_reader.unpacked_file(file) if self.packed == 'file' else nullcontext(file) as plain:
                yield from getattr(self.reader, function)(plain)


_READERS = {'mcap': mcap_reader, 'sqlite3': sqlite_reader}  # Storage identifier of rosbag2 -> its reader.


class TopicInfo(NamedTuple):
    """Type and number of messages of a topic."""

    type_name: str
    message_count: int


def bag_channels(path: Path) -> Iterator[tuple[Channel, int]]:
    """Channels of a bag and their numbers of messages, from its index if it has one; one may come often.

    Raises BagError if there is no bag, or it is damaged; `bag_topics` likewise.
    """
    with _as_bag_errors(path):
        yield from storage(path).read('file_channels')


def bag_topics(path: Path) -> dict[str, TopicInfo]:
    """Topics of a bag with their type and number of messages, from its index if it has one."""
    found: dict[str, TopicInfo] = {}
    for (topic, _, (type_name, *_)), count in bag_channels(path):
        before = found.get(topic, TopicInfo(type_name, 0))
        if before.type_name != type_name:
            raise BagError(f'{path}: {topic} has messages of {before.type_name} and of {type_name}')
        found[topic] = TopicInfo(type_name, count + before.message_count)
    return found


def bag_end(path: Path) -> int:
    """Last log time of a bag by its index [ns]; errors as of `bag_channels`."""
    with _as_bag_errors(path):
        return max(storage(path).read('file_ends'), default=0)


def read_definitions(path: Path, types: Iterable[str]) -> dict[str, Definition]:
    """Definition of each of some types (``package/Name``), of the bag if it has one.

    A bag holds them as MCAP schemas or in the table ``message_definitions`` of SQLite, which rosbag2 writes since Iron.
    BagError: the bag cannot be read, or a type is neither defined in it nor installed, nor one of ROS 2.
    """
    wanted = dict.fromkeys(short_name(name) for name in types)
    texts: dict[str, str] = {}
    for channel, _ in bag_channels(path):
        type_name, encoding, definition, _ = channel.description
        if encoding == 'ros2msg' and definition:
            texts.setdefault(short_name(type_name), definition.decode(errors='replace'))
        if wanted.keys() <= texts.keys():
            break
    found = {}
    for name in wanted:
        with named_errors(f'{path}: definition of {name}', raised=BagError):
            found[name] = parse_definition(name, texts.get(name) or known_definition(full_name(name)))
    return found


@contextmanager
def _as_bag_errors(path: Path) -> Iterator[None]:
    """Convert the errors of all readers to a `BagError` of one line."""
    try:
        yield
    except BagError:
        raise
    except (OSError, *mcap_reader.ERRORS, sqlite3.Error) as error:
        reason = ' '.join(str(error).split()) or type(error).__name__
        kind = BagError if isinstance(error, OSError | sqlite3.Error) else DamagedError
        raise kind(f'{path}: not a readable bag: {reason}') from None


def storage(path: Path) -> Storage:
    """Find the files of a bag. Raises BagError if there are none, or they are outside the folder."""
    with _as_bag_errors(path):
        if not path.is_dir():
            if not path.is_file():
                raise ValueError('no such file' if not path.exists() else 'neither a file nor a folder')
            packed = path.suffix == '.zstd'
            is_sqlite = (path.with_suffix('') if packed else path).suffix == '.db3'
            return Storage((path,), _READERS['sqlite3' if is_sqlite else 'mcap'], 'file' if packed else 'none')
        if not (path / 'metadata.yaml').is_file():
            raise BagError(f'{path}: not a rosbag2 bag: no metadata.yaml in it')
        document = read_yaml(_inside(path, 'metadata.yaml'), LARGEST_METADATA)
        information = document.get('rosbag2_bagfile_information') if isinstance(document, Mapping) else None
        if not isinstance(information, Mapping):
            raise ValueError('metadata.yaml is not in the format of rosbag2')
        names, kind = information.get('relative_file_paths'), information.get('storage_identifier')
        if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
            raise ValueError('metadata.yaml: relative_file_paths is not a list of names')
        if kind not in tuple(_READERS):  # it may be anything, also unhashable
            raise ValueError(f'metadata.yaml: storage_identifier = {kind!r} is neither mcap nor sqlite3')
        mode, form = (str(information.get(f'compression_{name}') or 'none').lower() for name in ('mode', 'format'))
        if mode not in ('none', 'message', 'file') or (mode != 'none' and form != 'zstd'):
            known = 'is none of message or file by zstd'
            raise ValueError(f'metadata.yaml: compression_mode = {mode!r} by {form!r} {known}')
        return Storage(tuple(_inside(path, name) for name in names), _READERS[kind], mode)


def _inside(folder: Path, name: str) -> Path:
    """File of a bag; early versions of rosbag2 name its folder, too. ValueError unless it is in the folder."""
    parts = PurePosixPath(name).parts
    file = folder / parts[-1] if parts else folder
    if len(parts) > 2 or not {'/', '..'}.isdisjoint(parts) or file.resolve().parent != folder.resolve():
        raise ValueError(f'{name!r} leads out of the folder of the bag')
    if not file.is_file():
        raise ValueError(f'{name!r}, which metadata.yaml names, does not exist')
    return file
