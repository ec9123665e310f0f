"""Definitions of messages: the fields of any ROS type, from the text that a bag holds or a package installs.

Source: https://design.ros2.org/articles/legacy_interface_definition.html.
"""

import re
from collections.abc import Mapping
from typing import NamedTuple

from seal_friction_ros.core.foundation.documents import DEEPEST
from seal_friction_ros.core.foundation.parameters import printable

PRIMITIVES = {
    'bool': '?', 'int8': 'b', 'uint8': 'B', 'int16': 'h', 'uint16': 'H', 'int32': 'i', 'uint32': 'I', 'int64': 'q',
    'uint64': 'Q', 'float32': 'f', 'float64': 'd',
}  # fmt: skip
"""Kind of a number -> its type as of `struct`."""
_SYNONYMS = {
    'byte': 'uint8', 'char': 'uint8', 'Header': 'std_msgs/Header', 'time': 'builtin_interfaces/Time',
    'duration': 'builtin_interfaces/Duration',
}  # fmt: skip
STRING, WIDE_STRING = 'string', 'wstring'
_EMPTY = ('structure_needs_at_least_one_member', 'uint8')  # what the generators put into a message without fields


class Field(NamedTuple):
    """One field of a message."""

    name: str
    kind: str  # a number, ``string``, ``wstring``, or the type of a message: ``package/Name``
    form: str = ''  # '': one; 'array': ``size`` of them; 'sequence': any number of them
    size: int = 0


Definition = Mapping[str, tuple[Field, ...]]
"""Type of a message (``package/Name``) -> its fields, for a message and for all messages in it."""


def short_name(type_name: str) -> str:
    """``package/Name`` of ``package/msg/Name`` or of ``package/Name``."""
    return type_name.replace('/msg/', '/')


def full_name(type_name: str) -> str:
    """``package/msg/Name`` of either."""
    return short_name(type_name).replace('/', '/msg/')


def parse_definition(type_name: str, text: str) -> Definition:
    """Definition of a message from its text (``ros2msg``), as MCAP and SQLite bags hold it.

    The text has its fields, then those of each message in it after a line of ``=`` and ``MSG: package/Name``.
    ValueError: the text is not such a definition, a message in it is not defined, or there are too many levels.
    """
    found: dict[str, list[Field]] = {}
    name = short_name(type_name)
    fields = found.setdefault(name, [])
    for raw in text.splitlines():
        line = raw.partition('#')[0].strip()
        if raw.startswith('====') or not line:
            continue
        if line.startswith('MSG:'):
            name = short_name(line[4:].strip())
            fields = found.setdefault(name, [])
            continue
        field = _parsed_field(line, name, type_name)
        if field is not None:
            fields.append(field)
    return _checked({kind: tuple(fields) for kind, fields in found.items()}, short_name(type_name))


_FIELD = re.compile(r'([A-Za-z][\w/]*)(?:<=\d+)?(\[(?:<=)?\d*\])?\s+([A-Za-z]\w*)\s*(.*)')


def _parsed_field(line: str, owner: str, type_name: str) -> Field | None:
    """Field in one line of a definition; None for a constant."""
    matched = _FIELD.fullmatch(line)
    if not matched:
        raise ValueError(f'{printable(type_name)}: {printable(line[:60])!r} is not a line of a message definition')
    kind, brackets, name, rest = matched.groups()
    if rest.startswith('='):
        return None
    kind = _SYNONYMS.get(kind, short_name(kind))
    if kind not in PRIMITIVES and kind not in (STRING, WIDE_STRING) and '/' not in kind:
        kind = f'{owner.partition("/")[0]}/{kind}'
    if brackets is None:
        return Field(name, kind)
    size = brackets[1:-1]
    return Field(name, kind, 'array', int(size)) if size.isdigit() else Field(name, kind, 'sequence')


def _checked(found: Mapping[str, tuple[Field, ...]], type_name: str) -> Definition:
    """The definition with every message in it known, none inside itself, and a byte for a message without fields."""
    complete = {kind: fields or (Field(*_EMPTY),) for kind, fields in found.items()}
    levels: dict[str, int] = {}  # of each message that was checked

    def visit(kind: str, above: tuple[str, ...]) -> int:
        """Check a message, which is a field of those ``above``, and all messages in it; the number of its levels."""
        if kind in above:
            raise ValueError(f'{type_name}: {printable(kind)} contains itself')
        if kind not in complete:
            raise ValueError(f'{type_name}: the definition lacks {printable(kind)}')
        if len(above) + levels.get(kind, 1) > DEEPEST:
            raise ValueError(f'{type_name}: more than {DEEPEST} levels deep')
        if kind in levels:
            return levels[kind]
        levels[kind] = 1
        for field in complete[kind]:
            if field.kind == WIDE_STRING:
                raise ValueError(f'{type_name}: {field.name} of {kind} is a wstring, which cannot be read')
            if '/' in field.kind:
                levels[kind] = max(levels[kind], 1 + visit(field.kind, (*above, kind)))
            elif field.kind not in PRIMITIVES and field.kind != STRING:
                raise ValueError(f'{type_name}: {field.name} of {kind} has the unknown type {printable(field.kind)}')
        return levels[kind]

    visit(type_name, ())
    return complete


def number_paths(definition: Definition, type_name: str) -> list[str]:
    """Path of every number of a message, ``[]`` after each list; for error messages and for the search of inputs."""
    paths: list[str] = []

    def collect(kind: str, above: str) -> None:
        """Add the paths of the numbers of a message whose own path is ``above``."""
        for field in definition[kind]:
            path = above + field.name + ('[]' if field.form else '')
            if '/' in field.kind:
                collect(field.kind, f'{path}.')
            elif field.kind != STRING:
                paths.append(path)

    collect(short_name(type_name), '')
    return paths
