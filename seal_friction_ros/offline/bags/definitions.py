"""Definitions of the message types in a bag: from the bag itself, else from the installed packages."""

from collections.abc import Iterable
from pathlib import Path

from seal_friction_ros.core.machine.message_fields import Definition, parse_definition, short_name
from seal_friction_ros.offline.bags.bag import BagError, bag_channels, message_definition

ROS2MSG = 'ros2msg'


def read_definitions(bag: Path, types: Iterable[str]) -> dict[str, Definition]:
    """Definition of each type (``package/Name``).

    A bag holds them as MCAP schemas or in the table ``message_definitions`` of SQLite, which rosbag2 writes since Iron.

    Args:
        bag: Bag folder, or a bare MCAP or SQLite file.
        types: The types that are needed.

    Raises:
        BagError: The bag cannot be read, or a type is neither defined in it nor installed.
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
        package, _, last = name.partition('/')
        try:
            text = texts[name] if name in texts else message_definition(f'{package}/msg/{last}')[0]
            found[name] = parse_definition(name, text)
        except BagError:
            raise BagError(f'{bag}: {name} is neither defined in the bag nor installed') from None
        except ValueError as error:
            raise BagError(f'{bag}: definition of {name}: {error}') from None
    return found
