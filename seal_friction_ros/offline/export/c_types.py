"""Types and values of Python in C: records become structs, whole numbers ``int64_t``, constants initialisers."""

import inspect
import re
from functools import cache
from typing import Any, NamedTuple, get_type_hints

from seal_friction_ros.core.messages.records import field_names

SCALARS: dict[Any, str] = {float: 'double', int: 'int64_t', bool: 'bool'}


class UntranslatableError(TypeError):
    """The translator has no C for a piece of Python; one line that says where and what."""


class Static(NamedTuple):
    """A value that is known when the C is made: parameters, functions, numbers in the source."""

    value: Any


class Runtime(NamedTuple):
    """A value that the C computes."""

    code: str  # expression of C
    kind: Any  # float, int, bool, a record type, a tuple of kinds, or None: no value


Value = Static | Runtime


def is_mutable(kind: Any) -> bool:
    """Whether a record is changed in place, so that C passes its address."""
    return hasattr(kind, '__dataclass_fields__')


@cache
def fields_of(kind: Any) -> dict[str, Any]:
    """Kind of each member of a record or of a tuple of kinds; what may be anything has no place in C."""
    if isinstance(kind, tuple):
        return {f'value_{i}': each for i, each in enumerate(kind)}
    hints = get_type_hints(kind)
    return {name: hints[name] for name in field_names(kind) if hints[name] is not Any}


@cache
def meanings_of(kind: Any) -> dict[str, str]:
    """Comment of each field in the source of a record."""
    try:
        source = inspect.getsource(kind)
    except (OSError, TypeError):  # a tuple, or a record that no source declares
        return {}
    found = re.findall(r'^    (\w+): .*?  # (.*)$', source, re.MULTILINE)
    return {name: _comment(text) for name, text in found}


def is_kind(kind: Any) -> bool:
    """Whether C has this type: a number, or a record of such."""
    if kind in SCALARS:
        return True
    try:
        return bool(field_names(kind)) and all(map(is_kind, fields_of(kind).values()))
    except (TypeError, NameError):
        return False


def kind_of(value: Any) -> Any:
    """Kind of a static value; None: C has no place for it."""
    if type(value) is tuple:
        kinds = tuple(map(kind_of, value))
        return kinds if kinds and None not in kinds else None
    return type(value) if is_kind(type(value)) else None


def unified(first: Any, second: Any) -> Any:
    """Kind that holds the values of both."""
    if first == second:
        return first
    numbers = [bool, int, float]
    if first in numbers and second in numbers:
        return numbers[max(numbers.index(first), numbers.index(second))]
    raise UntranslatableError(f'{first} and {second} in one place')


def number(value: Any) -> str:
    """Literal of C for a number, to the last bit."""
    if isinstance(value, bool):
        return 'true' if value else 'false'
    text = str(value).replace('inf', 'INFINITY').replace('nan', 'NAN')
    if isinstance(value, int) and abs(value) >= 2**31:
        text = 'INT64_MIN' if value == -(2**63) else f'{text}LL'
    return f'({text})' if text[0] == '-' else text


def initialiser(value: Any) -> str:
    """Initialiser of C for a number or a record."""
    kind: Any = type(value)
    if kind in SCALARS:
        return number(value)
    members = [getattr(value, name) for name in fields_of(kind)] if field_names(value) else value
    return '{' + ', '.join(initialiser(member) for member in members) + '}'


def snake(name: str) -> str:
    """Name in C of a type."""
    return re.sub(r'(?<=[a-z0-9])(?=[A-Z])', '_', name).lower()


class Types:
    """Structs, declared when they are first used."""

    def __init__(self, prefix: str) -> None:
        self._prefix, self._names = prefix, dict[Any, str]()
        self.declarations: list[str] = []

    def name(self, kind: Any) -> str:
        """Type of C for a kind; declares it at its first use."""
        if kind is None or kind in SCALARS:
            return SCALARS.get(kind, 'void')
        if kind not in self._names:
            members = '\n'.join(self._member(kind, name, each) for name, each in fields_of(kind).items())
            self._names[kind] = self._new_name(kind)
            about = '' if isinstance(kind, tuple) else f'/* {first_line(kind)} */\n'
            self.declarations.append(f'{about}typedef struct {{\n{members}\n}} {self._names[kind]};\n')
        return self._names[kind]

    def _member(self, kind: Any, name: str, each: Any) -> str:
        meaning = meanings_of(kind).get(name)
        return f'    {self.name(each)} {name};' + (f' /* {meaning} */' if meaning else '')

    def _new_name(self, kind: Any) -> str:
        if isinstance(kind, tuple):
            return f'{self._prefix}_values_{len(self._names)}'
        name = f'{self._prefix}_{snake(kind.__name__)}'
        is_taken = name in self._names.values()
        return f'{name}_of_{kind.__module__.rpartition(".")[2]}' if is_taken else name


def first_line(documented: Any) -> str:
    """First line of a docstring, as a comment of C can hold it."""
    return _comment((inspect.getdoc(documented) or '').partition('\n')[0])


def _comment(text: str) -> str:
    return text.replace('*/', '* /').replace('`', '')
