"""Parameters that cannot exist wrong: frozen dataclasses whose fields carry unit, bounds and meaning.

From this one place follow the check at construction, the check of a YAML file, the ROS parameter declaration
(``nodes/parameters.py``) and the tables in the docs.
"""

import dataclasses
import math
import re
from collections.abc import Callable, Collection, Mapping
from typing import Any, TypeVar

Record = TypeVar('Record')


@dataclasses.dataclass(frozen=True)
class Meaning:
    """What a field is: unit, bounds (both included), meaning, and whether it may change while the node is active."""

    unit: str
    description: str
    lower: float | None = None
    upper: float | None = None
    live: bool = True
    symbol: str = ''
    """in an equation"""
    start: Callable[[Any], float] | None = None
    """first guess of a fit, from a `TypicalReading`; None: never fitted"""

    def bounds_text(self) -> str:
        """Bounds for a reader, for example ``0.0 to 1.0``; empty if there are none."""
        return '' if self.lower is None and self.upper is None else f'{self.lower} to {self.upper}'


def parameter(
    default: Any = dataclasses.MISSING,
    *,
    unit: str,
    description: str,
    lower: float | None = None,
    upper: float | None = None,
    live: bool = True,
    symbol: str = '',
    start: Callable[[Any], float] | None = None,
) -> Any:
    """Dataclass field with its `Meaning`; both bounds are included."""
    meaning = Meaning(unit, description, lower, upper, live, symbol, start)
    return dataclasses.field(default=default, metadata={'meaning': meaning})


def meanings(record: Any) -> dict[str, Meaning]:
    """Meaning of each described field of a dataclass or of an instance of it, in order of declaration."""
    return {f.name: f.metadata['meaning'] for f in dataclasses.fields(record) if 'meaning' in f.metadata}


def check(record: Any) -> None:
    """Check the described fields of a dataclass instance against their bounds.

    Raises:
        ValueError: A number is not finite or out of bounds; the message names field, value, unit and bound.
    """
    for name, meaning in meanings(record).items():
        value = getattr(record, name)
        where = f'{type(record).__name__}.{name}'
        if isinstance(value, tuple):
            for i, item in enumerate(value):
                _check_number(f'{where}[{i}]', item, meaning)
        else:
            _check_number(where, value, meaning)


def _check_number(where: str, value: Any, meaning: Meaning) -> None:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return
    what = f'{where} = {value} {meaning.unit}'
    if isinstance(value, float) and not math.isfinite(value):
        raise ValueError(f'{what} is not finite')
    if meaning.lower is not None and value < meaning.lower:
        raise ValueError(f'{what} is below its lower bound {meaning.lower} {meaning.unit}')
    if meaning.upper is not None and value > meaning.upper:
        raise ValueError(f'{what} is above its upper bound {meaning.upper} {meaning.unit}')


def from_mapping(record_type: type[Record], values: Any, where: str, **made: Any) -> Record:
    """Make a dataclass from a mapping that came from outside.

    Integers are taken for floats, lists for tuples; nothing else is converted.

    Args:
        record_type: Dataclass whose fields are bool, int, float, str or tuples of str or float.
        values: Field name to value; fields with a default may be left out.
        where: What the mapping is, for the error message.
        made: Fields that were made already, and that the mapping may not give.

    Raises:
        ValueError: A field is unknown, missing, of the wrong type or out of bounds.
    """
    if not isinstance(values, Mapping):
        raise ValueError(f'{where} is not a mapping of names to values but {values!r}')
    fields = {f.name: f for f in _fields(record_type) if f.init and f.name not in made}
    check_names(values, fields, where)
    missing = [n for n, f in fields.items() if n not in values and f.default is dataclasses.MISSING]
    if missing:
        raise ValueError(f'{where} lacks {", ".join(missing)}')
    converted = {name: _as_declared(value, fields[name].type, f'{where}.{name}') for name, value in values.items()}
    try:
        return record_type(**made, **converted)
    except ValueError as error:
        raise ValueError(f'{where}: {error}') from None


def check_names(values: Mapping[Any, Any], known: Collection[str], where: str) -> None:
    """Check that a mapping has no names but ``known`` ones; ``where`` says what it is.

    Raises:
        ValueError: It has.
    """
    unknown = sorted(plain(name) for name in values if name not in known)
    if unknown:
        raise ValueError(f'{where} has no {", ".join(unknown)}: it has {", ".join(known)}')


def name_and_source(document: Any, kind: str) -> tuple[str, str]:
    """Name of what a document is of, and where it is from, '' if it does not say.

    Args:
        document: What came from outside.
        kind: What it should be of, for example ``case``.

    Raises:
        ValueError: It is no mapping, has no name of one line, or its source is no text.
    """
    if not isinstance(document, Mapping):
        raise ValueError(f'a {kind} file is a mapping of names to values, not {type(document).__name__}')
    name, source = document.get('name'), document.get('source', '')
    if not isinstance(name, str) or not name or not name.isprintable():
        raise ValueError(f'{kind} file: name = {name!r} is not one line of text')
    if not isinstance(source, str):
        raise ValueError(f'{kind} {name}: source = {source!r} is not a text')
    return name, source


def plain(name: Any) -> str:
    """A name that came from outside, fit for one line of an error message."""
    text = str(name)
    return text if text.isprintable() else repr(text)


def _fields(record_type: Any) -> tuple[dataclasses.Field[Any], ...]:
    return dataclasses.fields(record_type)


_WORDS = {float: 'a number', int: 'a whole number', bool: 'true or false', str: 'a text'}


def _hint(value: Any, declared: Any) -> str:
    """YAML 1.1 takes a number with an exponent but without point or sign, such as 15e-3 or 1.0e5, for a text."""
    if declared is float and isinstance(value, str) and re.fullmatch(r'[-+]?[\d.]+[eE][-+]?\d+', value):
        return ': write it with a point and a signed exponent, as in 1.0e+5'
    return ''


def _as_declared(value: Any, declared: Any, where: str) -> Any:
    if declared in (float, int, bool, str):
        if declared is float and type(value) is int:
            try:
                return float(value)
            except OverflowError:
                raise ValueError(f'{where} is a whole number too large to be a number in use') from None
        if type(value) is not declared:
            raise ValueError(f'{where} = {value!r} is not {_WORDS[declared]}{_hint(value, declared)}')
        return value
    if not isinstance(value, list | tuple):
        raise ValueError(f'{where} = {value!r} is not a list')
    item = declared.__args__[0]
    return tuple(_as_declared(v, item, f'{where}[{i}]') for i, v in enumerate(value))
