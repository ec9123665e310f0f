"""Messages of packages that are not installed, written by rosbags from their definitions.

``message_definitions`` holds definitions of control_msgs as they are
(github.com/ros-controls/control_msgs, BSD-3-Clause).
"""

from functools import cache
from pathlib import Path

from rosbags.typesys import Stores, get_types_from_msg, get_typestore

FILES = Path(__file__).parent / 'message_definitions'


@cache
def foreign_store():
    """Type store of rosbags with the types of a ROS 2 distribution and those of control_msgs."""
    store = get_typestore(Stores.ROS2_JAZZY)
    types = {}
    for file in sorted(FILES.glob('*.msg')):
        types |= get_types_from_msg(file.read_text(), f'control_msgs/msg/{file.stem}')
    store.register(types)
    return store


class _Definitions(dict):
    def __missing__(self, type_name: str) -> str:
        text = foreign_store().generate_msgdef(type_name, ros_version=2)[0]
        self[type_name] = text
        return text


CONTROL_MSGS = _Definitions()
"""Type -> full text of its definition, as a bag holds it."""
