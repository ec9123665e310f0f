"""Definitions of message types outside of bags: of an installed package, else those of ROS 2 in ``rosbags``."""

import json
from collections.abc import Iterable, Mapping
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from seal_friction_ros.core.messages.definitions import Definition, full_name, parse_definition
from seal_friction_ros.core.messages.layouts import PACKAGE
from seal_friction_ros.files import share_directory
from seal_friction_ros.packages import needed


@cache
def message_definition(type_name: str) -> tuple[str, str]:
    """Full text of the definition of an installed message type, and its RIHS01 hash; ValueError if it is not installed.

    The text of a message of this project has its comments, with the units.
    """
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
        hint = 'run make setup, or source the colcon workspace'
        raise ValueError(f'{type_name} is not installed: {hint}: {error}') from None
    return ('=' * 80 + '\n').join(parts), hashes[type_name]


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
    try:
        return message_definition(type_name)[0]
    except ValueError:
        typesys = needed('rosbags.typesys')
        try:
            return str(typesys.get_typestore(typesys.Stores.LATEST).generate_msgdef(type_name, ros_version=2)[0])
        except typesys.TypesysError:
            raise ValueError('neither in the bag, nor installed, nor a type of ROS 2') from None
