"""rosbag2 bags: a folder with ``metadata.yaml`` and an MCAP file (profile ``ros2``), written and read.

What is written opens in ``ros2 bag``, Foxglove, PlotJuggler, ``rosbags`` and the ``mcap`` reader, message definitions
inside. What is read may be any rosbag2 bag (MCAP or SQLite) or a bare MCAP file.
"""

import shutil
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO, NamedTuple, Self

import yaml
from mcap.exceptions import McapError
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer
from rosbags.rosbag2 import Reader, ReaderError
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from seal_friction_ros.core import wire
from seal_friction_ros.files import share_directory

CHUNK_SIZE = 64 * 1024  # [bytes] small chunks keep the writing thread short; the file is no larger for it
PRESSURE_TOPIC = '/cylinder_pressure'
VELOCITY_TOPIC = '/rod_velocity'
POSITION_TOPIC = '/rod_position'
FORCE_TOPIC = '/force_sum'
REFERENCE_TOPIC = '/servo_reference'
ESTIMATE_TOPIC = '/friction_estimate'
FEEDFORWARD_TOPIC = '/friction_feedforward'
CONFIGURATION_TOPIC = '/friction_estimator/configuration'
_FOREVER = {'sec': 9223372036, 'nsec': 854775807}


class BagError(ValueError):
    """A bag that cannot be read or written; one line that says which and why."""


class BagMessage(NamedTuple):
    """One message of a bag, still serialised."""

    topic: str
    type_name: str
    log_time: int
    """[ns]"""
    data: bytes


@cache
def message_definition(type_name: str) -> tuple[str, str]:
    """Full text of a message definition (comments included) and its RIHS01 hash."""
    store = get_typestore(Stores.ROS2_JAZZY)
    package, _, name = type_name.split('/')
    if package != wire.PACKAGE:
        return store.generate_msgdef(type_name, ros_version=2)[0], store.hash_rihs01(type_name)
    text = (_message_share() / 'msg' / f'{name}.msg').read_text()
    store.register(get_types_from_msg(text, type_name))
    generated, _ = store.generate_msgdef(type_name, ros_version=2)
    separator = '=' * 80 + '\n'
    dependencies = generated.split(separator)[1:]
    return separator.join([text, *dependencies]), store.hash_rihs01(type_name)


def _message_share() -> Path:
    spec = find_spec(wire.PACKAGE)
    if spec is None or spec.origin is None:
        raise BagError(f'{wire.PACKAGE} is not installed: run make setup, or source the colcon workspace')
    return share_directory(wire.PACKAGE, spec.origin)


class BagWriter:
    """Writes one bag, message by message, in the order given.

    Log times are made strictly increasing, so that every reader, which sorts by them, gives the messages back in the
    order in which they were written.

    As a context manager it removes what it wrote if the block fails, so that a failed command leaves nothing behind.

    Args:
        path: Folder of the bag; must not exist.

    Raises:
        BagError: There is something at ``path`` already, or it cannot be made.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        for type_name in wire.DECODERS:
            message_definition(type_name)  # now, where it can be said, and not when the first message comes
        self._channels: dict[str, int] = {}
        self._types: dict[str, str] = {}
        self._counts: dict[str, int] = {}
        self._first_time = 0
        self._last_time = -1
        self._custom_data: dict[str, str] = {}
        try:
            path.mkdir(parents=True)
        except FileExistsError:
            raise BagError(f'{path} exists already: not overwriting') from None
        except OSError as error:
            raise BagError(f'{path}: cannot make a bag there: {error.strerror}') from None
        try:
            self._file: BinaryIO = (path / f'{path.name}_0.mcap').open('xb')
            self._writer = Writer(self._file, chunk_size=CHUNK_SIZE, compression=CompressionType.NONE)
            self._writer.start(profile='ros2', library='seal_friction_ros')
            self._write_metadata()
        except OSError as error:
            shutil.rmtree(path, ignore_errors=True)  # made just now, by us
            raise BagError(f'{path}: cannot make a bag there: {error.strerror}') from None

    def write(self, topic: str, type_name: str, log_time: int, data: bytes) -> int:
        """Append one serialised message; returns the log time [ns] it got: the one given, or 1 ns after the last."""
        if topic not in self._channels:
            self._add_channel(topic, type_name)
        log_time = max(log_time, self._last_time + 1)
        if self._last_time < 0:
            self._first_time = log_time
        self._last_time = log_time
        self._writer.add_message(self._channels[topic], log_time, data, publish_time=log_time)
        self._counts[topic] += 1
        return log_time

    @property
    def message_count(self) -> int:
        """Messages written so far."""
        return sum(self._counts.values())

    def close(self, custom_data: dict[str, str] | None = None) -> None:
        """Write what is pending, the summary and the final ``metadata.yaml``; ``custom_data`` goes into the latter."""
        self._custom_data = custom_data or {}
        self._writer.add_metadata('rosbag2', {'serialized_metadata': _yaml_text(self._information())})
        self._writer.finish()
        self._file.close()
        self._write_metadata()

    def abandon(self) -> None:
        """Let go of the file as it is, after a failure."""
        self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is None:
            self.close()
        else:
            self.abandon()
            shutil.rmtree(self.path)

    def _add_channel(self, topic: str, type_name: str) -> None:
        definition, type_hash = message_definition(type_name)
        schema = self._writer.register_schema(type_name, 'ros2msg', definition.encode())
        metadata = {'offered_qos_profiles': _yaml_text([_qos(type_name)]), 'topic_type_hash': type_hash}
        self._channels[topic] = self._writer.register_channel(topic, 'cdr', schema, metadata)
        self._types[topic] = type_name
        self._counts[topic] = 0

    def _information(self) -> dict[str, Any]:
        span = {
            'duration': {'nanoseconds': max(self._last_time - self._first_time, 0)},
            'starting_time': {'nanoseconds_since_epoch': self._first_time},
            'message_count': self.message_count,
        }
        file_name = f'{self.path.name}_0.mcap'
        topics = [
            {
                'topic_metadata': {
                    'name': topic,
                    'type': type_name,
                    'serialization_format': 'cdr',
                    'offered_qos_profiles': [_qos(type_name)],
                    'type_description_hash': message_definition(type_name)[1],
                },
                'message_count': self._counts[topic],
            }
            for topic, type_name in self._types.items()
        ]
        return {
            'version': 9,
            'storage_identifier': 'mcap',
            'relative_file_paths': [file_name],
            **span,
            'topics_with_message_count': topics,
            'compression_format': '',
            'compression_mode': '',
            'files': [{'path': file_name, **span}],
            'custom_data': self._custom_data or None,
            'ros_distro': 'rosbags',
        }

    def _write_metadata(self) -> None:
        text = _yaml_text({'rosbag2_bagfile_information': self._information()})
        partial = self.path / 'metadata.yaml.partial'
        partial.write_text(text)
        partial.replace(self.path / 'metadata.yaml')


class _PlainDumper(yaml.SafeDumper):
    """Writes no aliases: not every reader of bags knows them."""

    def ignore_aliases(self, data: Any) -> bool:
        del data
        return True


def _yaml_text(document: Any) -> str:
    return yaml.dump(document, Dumper=_PlainDumper, sort_keys=False)


def _qos(type_name: str) -> dict[str, Any]:
    latched = type_name == wire.CONFIGURATION_TYPE
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
    """Messages of a bag in order of log time.

    Args:
        path: Bag folder, or a bare MCAP file.

    Raises:
        BagError: There is no bag, or it is damaged (found out when the damage is reached).
    """
    with _as_bag_errors(path):
        yield from _read_folder(path) if path.is_dir() else _read_file(path)


@contextmanager
def _as_bag_errors(path: Path) -> Iterator[None]:
    """Turn whatever a reader says of a damaged bag into one line."""
    try:
        yield
    except BagError:
        raise
    except (ReaderError, McapError, OSError, ValueError, LookupError, EOFError, struct.error, AssertionError) as error:
        reason = ' '.join(str(error).split()) or type(error).__name__
        raise BagError(f'{path}: not a readable bag (truncated, not finished, or no bag): {reason}') from None


def _open_folder(path: Path) -> Reader:
    if not (path / 'metadata.yaml').is_file():
        raise BagError(f'{path}: no metadata.yaml in it, so not a rosbag2 bag')
    return Reader(path)


def _read_folder(path: Path) -> Iterator[BagMessage]:
    with _open_folder(path) as reader:
        for connection, log_time, data in reader.messages():
            yield BagMessage(connection.topic, connection.msgtype, log_time, bytes(data))


def _read_file(path: Path) -> Iterator[BagMessage]:
    with path.open('rb') as file:
        for schema, channel, message in make_reader(file).iter_messages(log_time_order=True):
            name = schema.name if schema else ''
            yield BagMessage(channel.topic, name, message.log_time, message.data)


class TopicInfo(NamedTuple):
    """What a bag says of one of its topics."""

    type_name: str
    message_count: int


def bag_topics(path: Path) -> dict[str, TopicInfo]:
    """Topics of a bag with their type and number of messages, from its index.

    Raises:
        BagError: There is no bag, or it is damaged.
    """
    with _as_bag_errors(path):
        if path.is_dir():
            with _open_folder(path) as reader:
                return {c.topic: TopicInfo(c.msgtype, c.msgcount) for c in reader.connections}
        with path.open('rb') as file:
            summary = make_reader(file).get_summary()
        if summary is None or summary.statistics is None:
            raise BagError(f'{path}: no summary at its end: truncated')
        counts = summary.statistics.channel_message_counts
        return {
            channel.topic: TopicInfo(summary.schemas[channel.schema_id].name, counts.get(number, 0))
            for number, channel in summary.channels.items()
        }
