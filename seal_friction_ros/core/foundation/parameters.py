"""Parameters declared once: frozen dataclasses whose fields carry default, unit, bounds and meaning.

The check at construction, the check of a YAML file, the ROS parameter declaration (``nodes/managed_node.py``) and the
tables in the docs follow from these fields.
"""

import dataclasses
import difflib
import math
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from typing import Any, NamedTuple, TypeVar, cast

from seal_friction_ros.core.foundation.errors import named_errors
from seal_friction_ros.core.foundation.units import in_si, unit_meant

Record = TypeVar('Record')


@dataclasses.dataclass(frozen=True)
class Meaning:
    """Unit, description and bounds (both included) of a field, and whether it may change while the node is active."""

    unit: str
    description: str
    lower: float | None = None
    upper: float | None = None
    choices: Collection[str] = ()  # values of a text; empty: any
    live: bool = True
    symbol: str = ''  # in an equation
    start: Callable[[Any], float] | None = None  # first guess of a fit, from a `TypicalReading`; None: never fitted
    fit_bounds: tuple[float, float] | None = None  # bounds of a fit, where they are narrower


def parameter(default: Any = dataclasses.MISSING, **meaning: Any) -> Any:
    """Dataclass field with its `Meaning`, whose fields are the keyword arguments; both bounds are included."""
    return dataclasses.field(default=default, metadata={'meaning': Meaning(**meaning)})


def meanings(record: Any) -> dict[str, Meaning]:
    """Meaning of each described field of a dataclass or an instance, in order of declaration."""
    return {f.name: f.metadata['meaning'] for f in dataclasses.fields(record) if 'meaning' in f.metadata}


def within_bounds(record: Any, name: str, value: Any) -> Any:
    """A number clamped to the bounds of the field of a dataclass or an instance."""
    meaning = meanings(record)[name]
    lower, upper = meaning.lower, meaning.upper
    return min(max(value, value if lower is None else lower), value if upper is None else upper)


class ParameterGroup(NamedTuple):
    """Parameters of a node that one dataclass declares."""

    record_type: type
    prefix: str = ''  # start of each parameter name, with its dot
    live: bool = True  # False: no parameter of the group can change while the node is configured
    defaults: Any = None  # record with other defaults than those of its fields

    def names(self) -> dict[str, str]:
        """Name of each parameter -> field of the dataclass."""
        return {self.prefix + name: name for name in meanings(self.record_type)}

    def fixed(self) -> set[str]:
        """Parameters that cannot change while the node is configured."""
        described = meanings(self.record_type).items()
        return {self.prefix + name for name, meaning in described if not (self.live and meaning.live)}


def check(record: Any) -> None:
    """Check the described fields of a dataclass instance against their bounds and choices.

    ValueError: a number is not finite or out of bounds, or a text is none of its choices; the message names field,
    value, unit and bound, or the choices.
    """
    for name, meaning in meanings(record).items():
        value = getattr(record, name)
        where = f'{type(record).__name__}.{name}'
        if meaning.choices and value not in meaning.choices:
            raise ValueError(f'{where} = {value!r} is none of {", ".join(meaning.choices)}')
        if isinstance(value, tuple):
            for i, item in enumerate(value):
                _check_number(f'{where}[{i}]', item, meaning)
        else:
            _check_number(where, value, meaning)


class CheckedParameters:
    """Base of a dataclass of `parameter` fields: `check` runs at construction, so an invalid record never exists.

    ValueError: a number is not finite or out of bounds, or a text is none of its choices.
    """

    def __post_init__(self) -> None:
        check(self)

    def check_order(self, larger: str, smaller: str, *, may_be_equal: bool = False) -> None:
        """Check that a field is above another one of its unit; ValueError, with both, if it is not."""
        high, low, unit = getattr(self, larger), getattr(self, smaller), meanings(self)[larger].unit
        if high < low or (high == low and not may_be_equal):
            where = 'below' if may_be_equal else 'not above'
            raise ValueError(f'{type(self).__name__}.{larger} = {high} {unit} is {where} {smaller} = {low} {unit}')


def _check_number(where: str, value: Any, meaning: Meaning) -> None:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return
    what = f'{where} = {value} {meaning.unit}'
    if isinstance(value, float) and not math.isfinite(value):
        raise ValueError(f'{what} is not finite')
    if meaning.lower is not None and value < meaning.lower:
        raise ValueError(f'{what} is below its lower bound {meaning.lower} {meaning.unit}')
    if meaning.upper is not None and value > meaning.upper:
        hint = unit_meant(value, meaning.unit, meaning.upper)
        raise ValueError(f'{what} is above its upper bound {meaning.upper} {meaning.unit}{hint}')


def from_mapping(record_type: type[Record], values: Any, where: str, **made: Any) -> Record:
    """Make a dataclass, whose fields are bool, int, float, str or tuples of str or float, from untrusted input.

    Integers convert to floats, lists to tuples, and where a number is declared, texts with a unit to SI. No other type
    is converted. Fields with a default are optional. ``made`` has values of further fields, which ``values`` must not
    contain; ``where`` names the mapping in error messages. ValueError: a field is unknown, missing, of the wrong type
    or out of bounds.
    """
    if not isinstance(values, Mapping):
        raise ValueError(f'{where} is not a mapping of names to values but {values!r}')
    fields = {f.name: f for f in dataclasses.fields(cast(Any, record_type)) if f.init and f.name not in made}
    check_names(values, fields, where)
    missing = [n for n, f in fields.items() if n not in values and f.default is dataclasses.MISSING]
    if missing:
        raise ValueError(f'{where} lacks {", ".join(missing)}')
    units = {name: meaning.unit for name, meaning in meanings(record_type).items()}
    converted = {
        name: _as_declared(value, fields[name].type, f'{where}.{name}', units.get(name, ''))
        for name, value in values.items()
    }
    with named_errors(where):
        return record_type(**made, **converted)


def check_names(values: Mapping[Any, Any], known: Collection[str], where: str) -> None:
    """Check that a mapping has ``known`` names only; ``where`` names the mapping in the error message.

    ValueError: another name is present; the message lists the known names and the most similar ones.
    """
    unknown = sorted(printable(name) for name in values if name not in known)
    if unknown:
        similar = ', '.join(dict.fromkeys(similar_names(unknown, known).values()))
        hint = f'; did you mean {similar}?' if similar else ''
        raise ValueError(f'{where} has no {", ".join(unknown)}: it has {", ".join(known)}{hint}')


def similar_names(unknown: Sequence[str], known: Iterable[str]) -> dict[str, str]:
    """The most similar known name for each of the first ten unknown names, where one is similar.

    Known names are compared with and without their dotted prefix, so that a wrong or missing prefix does not matter.
    """
    full_names: dict[str, list[str]] = {}
    for name in known:
        for key in {name, name.rpartition('.')[2]}:
            full_names.setdefault(key, []).append(name)
    similar = {}
    for name in unknown[:10]:  # comparing every name of a hostile file would take minutes
        for match in difflib.get_close_matches(name.rpartition('.')[2], full_names, n=1):
            similar[name] = difflib.get_close_matches(name, full_names[match], n=1, cutoff=0.0)[0]
    return similar


def meant(word: str, known: Iterable[str]) -> str:
    """What an unknown word was meant to be, if a known one is similar, and every known one."""
    names = sorted(known)
    similar = difflib.get_close_matches(word, names, n=1)
    asked = f'did you mean {similar[0]}? ' if similar else ''
    return f'{asked}there {"is" if len(names) == 1 else "are"} {", ".join(names) or "none"}'


def name_and_source(document: Any, kind: str) -> tuple[str, str]:
    """``name`` and ``source`` of an untrusted document of a ``kind``, for example ``case``; '' if it has no source.

    ValueError: the document is not a mapping, its name is not one line of text, or its source is not text.
    """
    if not isinstance(document, Mapping):
        raise ValueError(f'a {kind} file is a mapping of names to values, not {type(document).__name__}')
    name, source = document.get('name'), document.get('source', '')
    if not isinstance(name, str) or not name or not name.isprintable():
        raise ValueError(f'{kind} file: name = {name!r} is not one line of text')
    if not isinstance(source, str):
        raise ValueError(f'{kind} {name}: source = {source!r} is not a text')
    return name, source


def printable(name: Any) -> str:
    """An untrusted name as text without line breaks and control characters, for a one-line error message."""
    text = str(name)
    return text if text.isprintable() else repr(text)


_TYPE_NAMES = {int: 'a whole number', bool: 'true or false', str: 'a text'}


def _as_declared(value: Any, declared: Any, where: str, unit: str) -> Any:
    if declared is float:
        return in_si(value, unit, where)
    if declared in (int, bool, str):
        if type(value) is not declared:
            raise ValueError(f'{where} = {value!r} is not {_TYPE_NAMES[declared]}')
        return value
    if not isinstance(value, list | tuple):
        raise ValueError(f'{where} = {value!r} is not a list')
    item = declared.__args__[0]
    return tuple(_as_declared(v, item, f'{where}[{i}]', unit) for i, v in enumerate(value))
