"""Definitions of message types: from the bag itself, else an installed package, else those of ROS 2 in ``rosbags``."""

from collections.abc import Iterable
from pathlib import Path

from seal_friction_ros.core.messages.definitions import Definition, full_name, parse_definition, short_name
from seal_friction_ros.offline.bags.bag import BagError, bag_channels, message_definition
from seal_friction_ros.packages import needed

ROS2MSG = 'ros2msg'


def read_definitions(bag: Path, types: Iterable[str]) -> dict[str, Definition]:
    """Definition of each type (``package/Name``).

    A bag holds them as MCAP schemas or in the table ``message_definitions`` of SQLite, which rosbag2 writes since Iron.

    Args:
        bag: Bag folder, or a bare MCAP or SQLite file.
        types: The types that are needed.

    Raises:
        BagError: The bag cannot be read, or a type is neither defined in it nor installed, nor one of ROS 2.
    """
    wanted = dict.fromkeys(short_name(name) for name in types)
    texts: dict[str, str] = {}
    for channel, _ in bag_channels(bag):
        type_name, encoding, definition, _ = channel.description
        if encoding == ROS2MSG and definition:
            texts.setdefault(short_name(type_name), definition.decode(errors='replace'))
        if wanted.keys() <= texts.keys():
            break
    found = {}
    for name in wanted:
        try:
            found[name] = parse_definition(name, texts[name] if name in texts else _known_text(full_name(name)))
        except ValueError as error:
            raise BagError(f'{bag}: definition of {name}: {error}') from None
    return found


def _known_text(type_name: str) -> str:
    """Definition of an installed type, or of one that is installed elsewhere: an older bag of SQLite has none."""
    try:
        return message_definition(type_name)[0]
    except BagError:
        typesys = needed('rosbags.typesys')
        try:
            return str(typesys.get_typestore(typesys.Stores.LATEST).generate_msgdef(type_name, ros_version=2)[0])
        except typesys.TypesysError:
            raise ValueError('neither in the bag, nor installed, nor a type of ROS 2') from None
