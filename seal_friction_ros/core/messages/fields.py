"""Numbers out of the bytes of any ROS message, by the names of its fields.

``reader = Reader(definition, type_name, ['position[boom]', 'velocity[boom]'])``, then ``reader.read(data)`` for every
message: the stamp of its header, the frame name, and one number for each path.

A path names fields from the message downwards, with dots between them. Brackets choose an element: by number
(``data[3]``), or by a name that a list of names beside it, or further up, holds (``position[boom]`` of a JointState by
``name``, ``feedback.positions[boom]`` by ``joint_names``, ``interface_values[boom].values[velocity]`` by
``joint_names`` and ``interface_names``), or by the field ``name`` of the element (``dof_states[boom].feedback``).

Where a number stands depends on the lengths of the strings and sequences before it. They seldom change between two
messages of a topic, so the first message is walked field by field, and the places found are used again for every
message with the same lengths and the same names.
"""

import difflib
import re
import struct
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from seal_friction_ros.core.foundation.errors import named_errors
from seal_friction_ros.core.foundation.parameters import printable
from seal_friction_ros.core.messages.cdr import LITTLE_ENDIAN, Place, Walk, struct_at, walked
from seal_friction_ros.core.messages.definitions import STRING, Definition, Field, short_name
from seal_friction_ros.core.messages.layouts import LONGEST_FRAME, SECOND

LARGEST_MESSAGE = 1 << 18  # [bytes] our choice; a JointState of 100 joints has 5000
MOST_LAYOUTS = 16  # lengths of messages of one topic that are kept; our choice
NAME_LISTS = ('name', 'names', 'joint_names', 'interface_names')
"""Lists of names that count before others at the same level."""
_SHOWN = 20  # names in an error message


class _Step(NamedTuple):
    """One field of a path, and how its element is chosen."""

    name: str
    number: int | None = None  # by number
    key: str | None = None  # by name ...
    scope: int = -1  # ... in a list of names of the message at this depth of the path; -1: by ``name`` of the element
    names: str = ''  # the list of names


class _Path(NamedTuple):
    text: str
    steps: tuple[_Step, ...]


_PART = re.compile(r'([A-Za-z]\w*)(?:\[([^\[\]]+)\])?(?:\.(?=.)|$)')


def _resolved(definition: Definition, type_name: str, text: str) -> _Path:
    """Path whose fields exist and that ends in a number; ValueError, with what the message has, if it is none."""
    kind, position = short_name(type_name), 0
    steps: list[_Step] = []
    scopes = [kind]
    what = f'{short_name(type_name)}: {printable(text)!r}'
    while position < len(text) or not steps:
        matched = _PART.match(text, position)
        if not matched:
            raise ValueError(f'{what} is not a path of fields: write it as position[boom], wrench.force.z or data[0]')
        position = matched.end()
        name, selector = matched.groups()
        field = next((f for f in definition.get(kind, ()) if f.name == name), None)
        if field is None:
            meant = _meant([field.name for field in definition.get(kind, ())], name)
            raise ValueError(f'{what}: {kind} has no {name}: it has {_fields_text(definition, kind)}{meant}')
        if bool(field.form) != (selector is not None):
            hint = 'a list: choose an element, as [0] or [boom]' if field.form else 'no list: leave out the brackets'
            raise ValueError(f'{what}: {name} is {hint}')
        steps.append(_step(definition, field, selector, scopes, what))
        kind = field.kind
        if '/' in kind:
            scopes.append(kind)
    if '/' in kind:
        raise ValueError(f'{what} is no number: it has {_fields_text(definition, kind)}')
    if kind == STRING:
        raise ValueError(f'{what} is a text and no number')
    return _Path(text, tuple(steps))


def _step(definition: Definition, field: Field, selector: str | None, scopes: Sequence[str], what: str) -> _Step:
    if selector is None:
        return _Step(field.name)
    if selector.isdecimal():
        if field.form == 'array' and int(selector) >= field.size:
            raise ValueError(f'{what}: {field.name} has {field.size} elements, numbered from 0')
        return _Step(field.name, number=int(selector))
    if any(f.name == 'name' and f.kind == STRING and not f.form for f in definition.get(field.kind, ())):
        return _Step(field.name, key=selector)
    for depth in reversed(range(len(scopes))):
        lists = [f.name for f in definition[scopes[depth]] if f.kind == STRING and f.form]
        chosen = next((name for name in NAME_LISTS if name in lists), lists[0] if len(lists) == 1 else None)
        if chosen is not None:
            return _Step(field.name, key=selector, scope=depth, names=chosen)
    raise ValueError(f'{what}: no list of names tells which element {selector!r} is: choose it by number, as [0]')


def _fields_text(definition: Definition, kind: str) -> str:
    return ', '.join(field.name for field in definition.get(kind, ()))


def _meant(known: Sequence[str], name: str) -> str:
    close = difflib.get_close_matches(name, known, n=1)
    return f'; did you mean {printable(close[0])}?' if close else ''


# -- messages ---------------------------------------------------------------------------------------------------------


class _Layout(NamedTuple):
    """Where the numbers of a message stand, and what has to be the same for that to be true."""

    guard: struct.Struct
    expected: tuple[Any, ...]
    head: struct.Struct | None  # stamp and frame name; None: the message has no header
    numbers: struct.Struct
    order: tuple[int, ...]  # place of each number among those of ``numbers``; -1: the message does not have it
    as_they_come: bool  # whether the numbers are in that order
    missing: tuple[str, ...]  # why it does not have it, one text for each that is missing


class Reading(NamedTuple):
    """What a message holds."""

    stamp: int | None  # [ns] of its header; None if it has none, or 0, which is what nobody filled in
    frame_id: bytes  # of its header; empty if it has none
    numbers: tuple[float | None, ...]  # one for each path; None where this message does not hold it
    missing: tuple[str, ...]  # why, one text for each of them


class Reader:
    """Reads the numbers that some paths name out of the messages of one type.

    Without paths: encapsulation, numbers, lengths and texts (with their ends), in their order. ValueError, which lists
    what the message has: a path names no number of it.
    """

    def __init__(self, definition: Definition, type_name: str, paths: Sequence[str] | None = None) -> None:
        self.type_name = short_name(type_name)
        self._definition, self._reads_all = definition, paths is None
        self._paths = tuple(_resolved(definition, type_name, path) for path in paths or ())
        fields = {field.name: field.kind for field in definition[self.type_name] if not field.form}
        self._has_header = fields.get('header') == 'std_msgs/Header'
        self._layouts: dict[int, _Layout] = {}

    def read(self, data: bytes) -> Reading:
        """Read one message; ValueError if the bytes are not a message of the type."""
        layout = self._layouts.get(len(data))
        if layout is None or layout.guard.unpack_from(data) != layout.expected:
            layout = self._walked(data)
            if len(self._layouts) >= MOST_LAYOUTS:
                self._layouts.clear()
            self._layouts[len(data)] = layout
        numbers = layout.numbers.unpack_from(data)
        stamp, frame_id = None, b''
        if layout.head is not None:
            seconds, nanoseconds, frame_id = layout.head.unpack_from(data)
            if nanoseconds >= SECOND:
                raise ValueError(f'{self.type_name}: a stamp with {nanoseconds} ns is not valid')
            stamp = seconds * SECOND + nanoseconds or None
        if layout.as_they_come:
            return Reading(stamp, frame_id, numbers, layout.missing)
        ordered = tuple([numbers[place] if place >= 0 else None for place in layout.order])
        return Reading(stamp, frame_id, ordered, layout.missing)

    def _walked(self, data: bytes) -> _Layout:
        with named_errors(self.type_name):
            if len(data) > LARGEST_MESSAGE and not self._reads_all:
                raise ValueError(f'{len(data)} bytes, more than {LARGEST_MESSAGE}')
            walk, root = walked(self._definition, self.type_name, data)
            return self._layout(walk, root, data)

    def _layout(self, walk: Walk, root: Mapping[str, Any], data: bytes) -> _Layout:
        found = [_Found(data, root, path) for path in self._paths]
        texts = {text for one in found for text in one.used}
        guard = struct_at(sorted([Place(0, 's', len(LITTLE_ENDIAN)), *walk.lengths, *texts]))
        head = None
        if self._has_header:
            stamp, frame = root['header']['stamp'], root['header']['frame_id']
            if frame.amount > LONGEST_FRAME:
                raise ValueError(f'a frame name of {frame.amount} bytes is not valid')
            name = frame._replace(amount=max(frame.amount - 1, 0))
            head = struct_at([stamp['sec'], stamp['nanosec'], name])
        places = walk.places if self._reads_all else sorted({one.place for one in found if one.place is not None})
        order = tuple(places.index(one.place) if one.place is not None else -1 for one in found)
        return _Layout(
            guard,
            guard.unpack_from(data),
            head,
            struct_at(places),
            order,
            self._reads_all or order == tuple(range(len(places))),
            tuple(one.missing for one in found if one.missing),
        )


def names_in(definition: Definition, type_name: str, data: bytes) -> list[str]:
    """Names that the elements of a message have, by the first list of `NAME_LISTS` that it has; empty without one.

    ValueError: the bytes are not a message of the type.
    """
    _, root = walked(definition, type_name, data)
    texts: list[Any] = next((root[name] for name in NAME_LISTS if isinstance(root.get(name), list)), [])
    return [_text(data, text) for text in texts if isinstance(text, Place)]


def _text(data: bytes, place: Place) -> str:
    """A text of a message, without its end."""
    return data[place.offset : place.offset + max(place.amount - 1, 0)].decode(errors='replace')


class _Found:
    """A number of a message: its place, or why the message does not have it; and the texts that this depends on."""

    def __init__(self, data: bytes, root: Mapping[str, Any], path: _Path) -> None:
        self.used: list[Place] = []
        self.missing = ''
        self.place: Place | None = None
        node: Any = root
        scopes = [root]
        for step in path.steps:
            node = node[step.name]
            index = step.number
            if step.key is not None:
                index = self._named(data, node, scopes, step)
            if index is not None:
                count = node.amount if isinstance(node, Place) else len(node)
                if index < 0 or index >= count:
                    self.missing = self.missing or f'{path.text}: {step.name} has {count} elements'
                    return
                node = node.element(index) if isinstance(node, Place) else node[index]
            if isinstance(node, dict):
                scopes.append(node)
        self.place = node

    def _named(self, data: bytes, node: Any, scopes: Sequence[Mapping[str, Any]], step: _Step) -> int:
        """Index of the element that a name stands for; -1 if the message does not have the name once."""
        texts = scopes[step.scope][step.names] if step.scope >= 0 else [element['name'] for element in node]
        self.used += texts
        names = [_text(data, text) for text in texts]
        given = names.count(str(step.key))
        if given == 1:
            return names.index(str(step.key))
        if given:
            self.missing = f'{step.key!r} stands {given} times in {step.names or "name"}: ambiguous, none is taken'
            return -1
        # Sorted: publishers that change the order of the names are told once.
        shown = ', '.join(printable(name) for name in sorted(names)[:_SHOWN]) or 'none'
        self.missing = f'no {step.key!r} in {step.names or "name"}: it has {shown}{_meant(names, str(step.key))}'
        return -1
