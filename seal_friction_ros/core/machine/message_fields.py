"""Numbers out of the bytes (CDR, little endian) of any ROS message, by the names of its fields.

``reader = Reader(definition, type_name, ['position[boom]', 'velocity[boom]'])``, then ``reader.read(data)`` for every
message: the stamp of its header, the frame name, and one number for each path. The definition comes from the text that
a bag holds (`parse_definition`) or from an installed message class (`definition_of_class`), so any type can be read,
installed or not.

A path names fields from the message downwards, with dots between them. Brackets choose an element: by number
(``data[3]``), or by a name that a list of names beside it, or further up, holds (``position[boom]`` of a JointState by
``name``, ``feedback.positions[boom]`` by ``joint_names``, ``interface_values[boom].values[velocity]`` by
``joint_names`` and ``interface_names``), or by the field ``name`` of the element (``dof_states[boom].feedback``).

Where a number stands depends on the lengths of the strings and sequences before it. They seldom change between two
messages of a topic, so the first message is walked field by field, and the places found are used again for every
message with the same lengths and the same names.

Source: OMG DDS-RTPS 2.5, section 10 (CDR); https://design.ros2.org/articles/legacy_interface_definition.html.
"""

import difflib
import re
import struct
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from seal_friction_ros.core.estimation.messages import LONGEST_FRAME, SECOND
from seal_friction_ros.core.foundation.documents import DEEPEST
from seal_friction_ros.core.foundation.parameters import printable

LARGEST_MESSAGE = 1 << 18  # [bytes] our choice; a JointState of 100 joints has 5000
MOST_LAYOUTS = 16  # lengths of messages of one topic that are kept; our choice
_ORIGIN = 4  # [bytes] of the encapsulation header; alignment counts from its end
_SHOWN = 20  # names in an error message

PRIMITIVES = {
    'bool': '?', 'int8': 'b', 'uint8': 'B', 'int16': 'h', 'uint16': 'H', 'int32': 'i', 'uint32': 'I', 'int64': 'q',
    'uint64': 'Q', 'float32': 'f', 'float64': 'd',
}  # fmt: skip
"""Kind of a number -> its type as of `struct`."""
_SYNONYMS = {
    'boolean': 'bool', 'byte': 'uint8', 'octet': 'uint8', 'char': 'uint8', 'float': 'float32', 'double': 'float64',
    'Header': 'std_msgs/Header', 'time': 'builtin_interfaces/Time', 'duration': 'builtin_interfaces/Duration',
}  # fmt: skip
STRING, WIDE_STRING = 'string', 'wstring'
NAME_LISTS = ('name', 'names', 'joint_names', 'interface_names')
"""Lists of names that count before others at the same level."""
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


# -- definitions ------------------------------------------------------------------------------------------------------


def parse_definition(type_name: str, text: str) -> Definition:
    """Definition of a message from its text (``ros2msg``), as MCAP and SQLite bags hold it.

    Args:
        type_name: Type of the message.
        text: Its fields, then those of each message in it after a line of ``=`` and ``MSG: package/Name``.

    Raises:
        ValueError: The text is not such a definition, a message in it is not defined, or there are too many levels.
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
    kind = _kind(kind)
    if kind not in PRIMITIVES and kind not in (STRING, WIDE_STRING) and '/' not in kind:
        kind = f'{owner.partition("/")[0]}/{kind}'
    if brackets is None:
        return Field(name, kind)
    size = brackets[1:-1]
    return Field(name, kind, 'array', int(size)) if size.isdigit() else Field(name, kind, 'sequence')


def definition_of_class(type_name: str, fields_of: Callable[[str], Mapping[str, str]]) -> Definition:
    """Definition of a message from its installed class.

    Args:
        type_name: Type of the message.
        fields_of: Type of a message -> ``get_fields_and_field_types()`` of its class.

    Raises:
        ValueError: A field has a type that is not known.
    """
    found: dict[str, tuple[Field, ...]] = {}
    waiting = [short_name(type_name)]
    while waiting:
        kind = waiting.pop()
        if kind not in found:
            found[kind] = tuple(_field_of_class(name, text) for name, text in fields_of(kind).items())
            waiting += [field.kind for field in found[kind] if '/' in field.kind]
    return _checked(found, short_name(type_name))


_CLASS_FIELD = re.compile(r'(?:sequence<)?([A-Za-z][\w/]*)(?:<\d+>)?(?:, *\d+)?>?(?:\[(\d+)\])?')


def _field_of_class(name: str, text: str) -> Field:
    matched = _CLASS_FIELD.fullmatch(text)
    if not matched:
        raise ValueError(f'field {name} has the unknown type {printable(text)}')
    kind, count = matched.groups()
    if text.startswith('sequence<'):
        return Field(name, _kind(kind), 'sequence')
    return Field(name, _kind(kind), 'array', int(count)) if count else Field(name, _kind(kind))


def _kind(name: str) -> str:
    """The one name of a type that has several."""
    return _SYNONYMS.get(name, short_name(name))


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


# -- paths ------------------------------------------------------------------------------------------------------------


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
    """Path whose fields exist and that ends in a number.

    Raises:
        ValueError: It is not such a path; lists what the message has.
    """
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
            known = f'{_fields_text(definition, kind)}{_meant(definition, kind, name)}'
            raise ValueError(f'{what}: {kind} has no {name}: it has {known}')
        if bool(field.form) != (selector is not None):
            hint = (
                'is a list: choose an element, as [0] or [boom]' if field.form else 'is no list: leave out the brackets'
            )
            raise ValueError(f'{what}: {name} {hint}')
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


def _meant(definition: Definition, kind: str, name: str) -> str:
    close = difflib.get_close_matches(name, [field.name for field in definition.get(kind, ())], n=1)
    return f'; did you mean {close[0]}?' if close else ''


# -- places of the fields of one message ------------------------------------------------------------------------------


class _Number(NamedTuple):
    offset: int
    code: str


class _Numbers(NamedTuple):
    offset: int  # of the first one
    amount: int
    code: str


class _Text(NamedTuple):
    offset: int
    length: int  # with its end


class _Walk:
    """Walks over the bytes of one message and notes where its fields are."""

    def __init__(self, definition: Definition, data: bytes) -> None:
        self.definition, self.data = definition, data
        self.offset = _ORIGIN
        self.slack = 3  # [bytes] that may follow: some writers pad to a multiple of 4, rclpy to the size it estimated
        self.lengths: list[int] = []  # offset of each length, which the places behind it depend on

    def message(self, kind: str) -> dict[str, Any]:
        """Places of the fields of a message."""
        return {field.name: self.field(field) for field in self.definition[kind]}

    def field(self, field: Field) -> Any:
        """Place of one field."""
        if not field.form:
            return self.one(field.kind)
        count = self.length() if field.form == 'sequence' else field.size
        code = PRIMITIVES.get(field.kind)
        if code is None:
            if count > len(self.data) - self.offset:  # each one has a byte or more
                raise ValueError(f'{field.name} of {count} elements in {len(self.data)} bytes')
            self.slack += 7 * count if '/' in field.kind else 0
            return [self.one(field.kind) for _ in range(count)]
        if count:
            self.align(struct.calcsize(code))
        else:
            self.slack += 7
        place = _Numbers(self.offset, count, code)
        self.advance(count * struct.calcsize(code))
        return place

    def one(self, kind: str) -> Any:
        """Place of a number, a text or a message."""
        if kind == STRING:
            length = self.length()
            place = _Text(self.offset, length)
            self.advance(length)
            return place
        code = PRIMITIVES.get(kind)
        if code is None:
            return self.message(kind)
        self.align(struct.calcsize(code))
        number = _Number(self.offset, code)
        self.advance(struct.calcsize(code))
        return number

    def length(self) -> int:
        """Length that stands here."""
        self.align(4)
        at = self.offset
        self.advance(4)
        self.lengths.append(at)
        return int(struct.unpack_from('<I', self.data, at)[0])

    def align(self, size: int) -> None:
        """Go on to the next multiple of ``size``."""
        self.offset += -(self.offset - _ORIGIN) % size

    def advance(self, size: int) -> None:
        """Go on by ``size`` bytes.

        Raises:
            ValueError: The message ends before.
        """
        self.offset += size
        if self.offset > len(self.data):
            raise ValueError(f'{len(self.data)} bytes are too few for the message')

    def text(self, place: _Text) -> str:
        """A text of the message, without its end."""
        return self.data[place.offset : place.offset + max(place.length - 1, 0)].decode(errors='replace')


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

    Args:
        definition: Of the type.
        type_name: The type.
        paths: Of the numbers.

    Raises:
        ValueError: A path names no number of the message; lists what the message has.
    """

    def __init__(self, definition: Definition, type_name: str, paths: Sequence[str]) -> None:
        self.type_name = short_name(type_name)
        self._definition = definition
        self._paths = tuple(_resolved(definition, type_name, path) for path in paths)
        fields = {field.name: field.kind for field in definition[self.type_name] if not field.form}
        self._has_header = fields.get('header') == 'std_msgs/Header'
        self._layouts: dict[int, _Layout] = {}

    def read(self, data: bytes) -> Reading:
        """Read one message.

        Raises:
            ValueError: The bytes are not a message of the type; one line.
        """
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
        if data[:2] != b'\x00\x01':
            raise ValueError(f'{self.type_name}: encapsulation {data[:4].hex()} is not little-endian CDR')
        if len(data) > LARGEST_MESSAGE:
            raise ValueError(f'{self.type_name}: {len(data)} bytes, more than {LARGEST_MESSAGE}')
        walk = _Walk(self._definition, data)
        try:
            root = walk.message(self.type_name)
            if not walk.offset <= len(data) <= walk.offset + walk.slack:
                raise ValueError(f'{len(data)} bytes where the message has {walk.offset}')
            found = [_Found(walk, root, path) for path in self._paths]
            return self._layout(walk, root, found)
        except ValueError as error:
            raise ValueError(f'{self.type_name}: {error}') from None

    def _layout(self, walk: _Walk, root: Mapping[str, Any], found: 'Sequence[_Found]') -> _Layout:
        texts = {text for one in found for text in one.used}
        guards = sorted([(0, '2s'), *((at, 'I') for at in walk.lengths), *((t.offset, f'{t.length}s') for t in texts)])
        guard = _struct_at([(at, code) for at, code in guards if code != '0s'])
        head = None
        if self._has_header:
            stamp, frame = root['header']['stamp'], root['header']['frame_id']
            if frame.length > LONGEST_FRAME:
                raise ValueError(f'a frame name of {frame.length} bytes is not valid')
            head = _struct_at([stamp['sec'], stamp['nanosec'], (frame.offset, f'{max(frame.length - 1, 0)}s')])
        places = sorted({one.place for one in found if one.place is not None})
        order = tuple(places.index(one.place) if one.place is not None else -1 for one in found)
        return _Layout(
            guard,
            guard.unpack_from(walk.data),
            head,
            _struct_at(places),
            order,
            order == tuple(range(len(places))),
            tuple(one.missing for one in found if one.missing),
        )


def names_in(definition: Definition, type_name: str, data: bytes) -> list[str]:
    """Names that the elements of a message have, by the first list of `NAME_LISTS` that it has; empty without one.

    Raises:
        ValueError: The bytes are not a message of the type.
    """
    walk = _Walk(definition, data)
    root = walk.message(short_name(type_name))
    texts: list[Any] = next((root[name] for name in NAME_LISTS if isinstance(root.get(name), list)), [])
    return [walk.text(text) for text in texts if isinstance(text, _Text)]


def _struct_at(places: Sequence[tuple[int, str]]) -> struct.Struct:
    """Format of numbers at these offsets, which increase."""
    text, end = '<', 0
    for offset, code in places:
        text += f'{offset - end}x{code}'
        end = offset + struct.calcsize(f'<{code}')
    return struct.Struct(text)


class _Found:
    """A number of a message: its place, or why the message does not have it; and the texts that this depends on."""

    def __init__(self, walk: _Walk, root: dict[str, Any], path: _Path) -> None:
        self.used: list[_Text] = []
        self.missing = ''
        self.place: tuple[int, str] | None = None
        node: Any = root
        scopes = [root]
        for step in path.steps:
            node = node[step.name]
            index = step.number
            if step.key is not None:
                index = self._named(walk, node, scopes, step)
            if index is not None:
                count = node.amount if isinstance(node, _Numbers) else len(node)
                if index < 0 or index >= count:
                    self.missing = self.missing or f'{path.text}: {step.name} has {count} elements'
                    return
                node = _element(node, index)
            if isinstance(node, dict):
                scopes.append(node)
        self.place = (node.offset, node.code)

    def _named(self, walk: _Walk, node: Any, scopes: Sequence[dict[str, Any]], step: _Step) -> int:
        """Index of the element that a name stands for; -1 if the message does not have the name once."""
        texts = scopes[step.scope][step.names] if step.scope >= 0 else [element['name'] for element in node]
        self.used += texts
        names = [walk.text(text) for text in texts]
        given = names.count(str(step.key))
        if given == 1:
            return names.index(str(step.key))
        if given:
            self.missing = f'{step.key!r} stands {given} times in {step.names or "name"}: ambiguous, none is taken'
            return -1
        close = difflib.get_close_matches(str(step.key), names, n=1)
        hint = f'; did you mean {printable(close[0])}?' if close else ''
        shown = ', '.join(printable(name) for name in names[:_SHOWN]) or 'none'
        self.missing = f'no {step.key!r} in {step.names or "name"}: it has {shown}{hint}'
        return -1


def _element(node: Any, index: int) -> Any:
    if isinstance(node, _Numbers):
        return _Number(node.offset + index * struct.calcsize(node.code), node.code)
    return node[index]
