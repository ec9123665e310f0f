"""Definitions of message types outside of bags: of an installed package, else those of ROS 2 in ``rosbags``."""

import json
from collections.abc import Iterable, Mapping
from contextlib import suppress
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from seal_friction_ros.core.messages.definitions import Definition, full_name, parse_definition
from seal_friction_ros.core.messages.layouts import PACKAGE
from seal_friction_ros.files import share_directory
from seal_friction_ros.packages import needed

_LINE = '=' * 80 + '\n'
_HINT = 'run make setup, or source the colcon workspace'


@cache
def message_definition(type_name: str) -> tuple[str, str]:
    """Full text of the definition of an installed message type, and its RIHS01 hash; ValueError if it is not installed.

    The text of a message of this project has its comments, with the units. Without the package of the type, ``rosbags``
    knows the types of ROS 2, and this project its own, to the same bytes.
    """
    if find_spec(type_name.partition('/')[0]) is None:
        return _without_ros(type_name)
    try:
        description = json.loads(_definition_file(type_name, '.json').read_text())
        hashes = {entry['type_name']: entry['hash_string'] for entry in description['type_hashes']}
        described = description['type_description_msg']
        fields = {part['type_name']: part['fields'] for part in described['referenced_type_descriptions']}
        used: list[str] = []
        _collect(described['type_description']['fields'], fields, used)
        parts = [_definition_text(type_name)]
        for name in used:
            package, _, stem = name.split('/')
            parts.append(f'MSG: {package}/{stem}\n{_definition_text(name)}')
    except (OSError, ValueError, LookupError) as error:
        raise ValueError(f'{type_name} is not installed: {_HINT}: {error}') from None
    return _LINE.join(parts), hashes[type_name]


def _without_ros(type_name: str) -> tuple[str, str]:
    """As `message_definition`, without the package of the type."""
    typesys = needed('rosbags.typesys')
    try:
        generated, _ = _typestore().generate_msgdef(type_name, ros_version=2)
    except typesys.TypesysError:
        raise ValueError(f'{type_name} is neither installed nor a type of ROS 2') from None
    main, *used = generated.split(_LINE)
    parts = [_commented(type_name, main)]
    for head, _, text in (part.partition('\n') for part in used):
        parts.append(f'{head}\n{_commented(head.removeprefix("MSG: "), text)}')
    return _LINE.join(parts), str(_typestore().hash_rihs01(type_name))


def _own_folder() -> Path:
    return share_directory('seal_friction_ros', __file__) / 'msg_defs' / 'msg'


def _commented(type_name: str, text: str) -> str:
    """Text of a type, of this project as in its file."""
    own = _own_folder() / f'{type_name.rpartition("/")[2]}.msg'
    return own.read_text() if type_name.startswith(PACKAGE) else text


@cache
def _typestore() -> Any:
    """Types of ROS 2 in ``rosbags``, and those of this project."""
    typesys = needed('rosbags.typesys')
    store = typesys.get_typestore(typesys.Stores.LATEST)
    for path in _own_folder().glob('*.msg'):
        store.register(typesys.get_types_from_msg(path.read_text(), f'{PACKAGE}/msg/{path.stem}'))
    return store


def _collect(fields: Any, known: Mapping[str, Any], used: list[str]) -> None:
    """Append the types of fields, and those of their fields, in order."""
    for name in (field['type']['nested_type_name'] for field in fields):
        if name and name not in used:
            used.append(name)
            _collect(known[name], known, used)


def _definition_text(type_name: str) -> str:
    text = _definition_file(type_name, '.msg').read_text()
    if type_name.startswith(PACKAGE):
        return text
    lines = (line.partition('#')[0].rstrip() for line in text.splitlines())
    return ''.join(f'{line}\n' for line in lines if line)


def _definition_file(type_name: str, suffix: str) -> Path:
    package, _, name = type_name.split('/')
    spec = find_spec(package)
    if spec is None or spec.origin is None:
        raise ValueError(f'no package {package}')
    return share_directory(package, spec.origin) / 'msg' / f'{name}{suffix}'


def installed_definitions(types: Iterable[str]) -> dict[str, Definition]:
    """Definition of each of some installed types, ``package/Name``; raises as `message_definition`."""
    return {kind: parse_definition(kind, message_definition(full_name(kind))[0]) for kind in types}


def known_definition(type_name: str) -> str:
    """Definition of an installed type, or of one of ROS 2, which old SQLite bags lack; ValueError if it is neither."""
    with suppress(ValueError):
        return message_definition(type_name)[0]
    return _without_ros(type_name)[0]
