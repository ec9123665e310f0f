"""One source for Python and for compiled code: numeric functions on floats, named tuples and arrays.

- ``@compiled``: the function always runs compiled (simulation, lubricated contact): twenty times faster.
- ``@compilable``: the function runs as plain Python in the live node, which does not load the compiler, and compiled
  where `compiled` code calls it (replay of long bags, servo plant): the same source, the same bytes.

What a friction law needs beyond numbers is here too: `bound` binds the parameters of a law to its function, `evaluate`
calls it, `unrolled` loops over records of different types, `chosen_by_type` is a table of functions by the type of a
record, `for_compiler` converts records for compiled code, and `opened` makes them mutable there.

numba and numpy are imported where they are used: numba takes half a second, and the live node may do without.

With ``NUMBA_DISABLE_JIT=1`` in the environment, or without numba, everything runs as plain Python and gives the same
numbers.
"""

import dataclasses
import gc
import inspect
from bisect import bisect_right
from collections import namedtuple
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, nullcontext
from functools import cache, partial
from pkgutil import resolve_name
from types import FunctionType
from typing import Any, NamedTuple, TypeVar, cast, get_type_hints

Function = TypeVar('Function', bound=Callable[..., Any])
Record = TypeVar('Record')

INNER: Any = {'error_model': 'numpy', 'no_cpython_wrapper': True, 'no_cfunc_wrapper': True}
"""How a function is compiled that compiled code alone calls: without the ways in for Python and C, a fifth faster."""

NEW_RECORDS = 20_000
"""Records [-] made between two collections while a function is compiled; more: less time, more memory.

The 700 of Python take a tenth more time; no collection at all takes 140 MB more.
"""


class CompilerHooks(NamedTuple):
    """What else happens when code is compiled, set by those who know files: see `seal_friction_ros.compiled_code`."""

    before_loading: Callable[[], None]  # called before the compiler is loaded
    alone_with: Callable[[str], AbstractContextManager[None]]
    """gives the context in which the function of a name is compiled, and written to disk"""


_hooks = [CompilerHooks(lambda: None, lambda _: nullcontext())]  # the one in use


def set_hooks(hooks: CompilerHooks) -> None:
    """Use ``hooks`` from now on."""
    _hooks[:] = [hooks]


_waiting: list[Callable[..., Any]] = []  # compilable functions that the compiler does not know yet


@cache
def has_compiler() -> bool:
    """Whether numba is installed; loads it."""
    _hooks[0].before_loading()
    try:
        resolve_name('numba')
    except ModuleNotFoundError:
        return False
    return True


def compilable(function: Function) -> Function:
    """Decorator: ``function`` uses numbers and named tuples of numbers only, so it can be compiled as it stands.

    Where the order of two values decides, compare them by ``if``: ``min`` and ``max`` of the compiler may choose
    another one of two zeros, or of a number and NaN, than Python does.
    """
    _waiting.append(function)
    return function


def compiled(function: Function) -> Function:
    """Decorator: ``function`` compiled at its first call.

    No fast-math: sums keep their order, so both ways round alike. The compiled code is kept on disk only if
    ``NUMBA_CACHE_DIR`` names a folder for it, see `seal_friction_ros.compiled_code`.
    """
    if not has_compiler():
        return function
    import numba

    make_known()
    config: Any = numba.config
    made: Any = numba.njit(error_model='numpy', cache=bool(config.CACHE_DIR))(_with_unrolled_loops(function))
    if config.CACHE_DIR and not config.DISABLE_JIT:
        made.compile = partial(_compile_alone, made, made.compile, f'{function.__module__}.{function.__qualname__}')
    return cast(Function, made)


def _compile_alone(made: Any, compile_function: Callable[[Any], Any], name: str, signature: Any) -> Any:
    """Compile, or load from disk, while no other process does. Without the disk if anything is wrong there."""
    try:
        with _hooks[0].alone_with(name), _seldom_collected():
            return compile_function(signature)
    except Exception:  # noqa: BLE001  of damaged files and full disks; what the compiler has to say comes again
        from numba.core.caching import NullCache

        made._cache = NullCache()
        return compile_function(signature)


@contextmanager
def _seldom_collected() -> Iterator[None]:
    """Garbage is collected a thirtieth as often: the compiler makes many records that stay."""
    before = gc.get_threshold()
    if not 0 < before[0] < NEW_RECORDS:  # off, or another thread compiles and will restore it
        yield
        return
    gc.set_threshold(NEW_RECORDS, *before[1:])
    try:
        yield
    finally:
        gc.set_threshold(*before)


@contextmanager
def before_compiling(tell: Callable[[], object]) -> Iterator[None]:
    """Call ``tell`` once, if the block compiles anything; compiled code that is loaded from disk does not count."""
    if not has_compiler():
        yield
        return
    from numba.core import event

    class Once(event.Listener):
        """Tells at the beginning of the first function."""

        told = False

        def on_start(self, _event: Any) -> None:
            """Numba begins to compile a function."""
            if not self.told:
                self.told = True
                tell()

        def on_end(self, _event: Any) -> None:
            """Numba has compiled it."""

    with event.install_listener('numba:compile', Once()):
        yield


def make_known() -> None:
    """Let compiled code call every function that was marked `compilable` up to now."""
    _teach_the_compiler()
    while _waiting:
        function = _waiting.pop()
        _stand_in(function, _with_unrolled_loops(function))


def unrolled(records: Any) -> Any:
    """Loop over ``records``, each of a type of its own: compiled code repeats the body of the loop for each of them."""
    return records


def replace(record: Record, **changes: Any) -> Record:
    """A named tuple with other values in some of its fields."""
    return cast(Record, cast(Any, record)._replace(**changes))


def opened(record: Record) -> Record:
    """A copy that compiled code changes in place, of a mutable dataclass, or of what `for_compiler` made of it."""
    return cast(Record, cast(Any, record).copy())


def closed(record: Record) -> Record:
    """What `for_compiler` makes of an `opened` record."""
    return record


def from_compiler(kind: type[Record], record: Any) -> Record:
    """The dataclass of a record of `for_compiler`, and those within it."""
    if isinstance(record, kind):
        return record
    hints = get_type_hints(kind)
    return kind(
        **{
            name: from_compiler(hints[name], value) if dataclasses.is_dataclass(hints[name]) else value
            for name, value in record._asdict().items()
        }
    )


# -- functions with bound parameters ----------------------------------------------------------------------------------

Bound = partial[float]  # A scalar function whose parameters are bound, so that only its two arguments are left.


def bound(function: Callable[..., float], record: Any) -> Bound:
    """``function`` with every parameter but its last two bound to the attribute of ``record`` of that name.

    An attribute is a number, a tuple of numbers (a table), or a record with a ``bound`` function of its own.
    """
    values = (getattr(record, name) for name in _parameter_names(function))
    return partial(function, *(getattr(value, 'bound', value) for value in values))


@cache
def _parameter_names(function: Callable[..., float]) -> tuple[str, ...]:
    return tuple(inspect.signature(function).parameters)[:-2]


def evaluate(function: Bound, first: float, second: float) -> float:
    """Value of a bound function. Compiled code calls it through this name."""
    return function(first, second)


def chosen_by_type(functions: Mapping[type, Callable[..., Any]]) -> Callable[..., Any]:
    """One function of a record and more arguments: the function in the table for the type of the record.

    Compiled code chooses when it is compiled. The functions are `compiled` or `compilable`; the record may also be what
    `for_compiler` made of it.
    """
    by_name = {kind.__name__: getattr(function, 'py_func', function) for kind, function in functions.items()}
    as_given = {kind.__name__: function for kind, function in functions.items()}

    def chosen(record: Any, *arguments: Any) -> Any:
        return as_given[type(record).__name__](record, *arguments)

    if has_compiler():
        from numba.extending import overload

        @overload(chosen, strict=False, jit_options=INNER)
        def _implementation(record: Any, *_: Any) -> Callable[..., Any]:
            return by_name[record.instance_class.__name__]

    return chosen


def for_compiler(value: Any) -> Any:
    """A record as compiled code takes it.

    Tuples of numbers become arrays, a bound function becomes a record of its parameters, a dataclass a named tuple of
    its fields and properties that are numbers or made of numbers; records within records likewise.
    """
    if runs_as_python():
        return value
    make_known()
    return _converted(value)


def _converted(value: Any) -> Any:
    if dataclasses.is_dataclass(value):
        given = {name: getattr(value, name) for name in _names_of(cast(Any, type(value)))}
        numeric = {name: each for name, each in given.items() if _is_numeric(each) or dataclasses.is_dataclass(each)}
        return _record_type(type(value).__name__, tuple(numeric))(*map(_converted, numeric.values()))
    if isinstance(value, partial):
        return _bound_type(value.func)(tuple(map(_converted, value.args)))
    if isinstance(value, tuple):
        if hasattr(value, '_fields'):
            return type(value)(*map(_converted, value))
        if value and isinstance(value[0], float):
            import numpy as np

            return np.array(value)
        return tuple(map(_converted, value))
    return value


@cache
def _names_of(kind: type) -> tuple[str, ...]:
    """Fields of a dataclass, and its properties that are numbers."""
    properties = inspect.getmembers(kind, lambda member: isinstance(member, property))
    numbers = [name for name, member in properties if get_type_hints(member.fget).get('return') in (float, int, bool)]
    return (*(field.name for field in dataclasses.fields(kind)), *numbers)


def _is_numeric(value: Any) -> bool:
    """Whether compiled code has a place for it: a number, a function with bound parameters, none, or tuples of such.

    A named tuple may hold dataclasses.
    """
    if isinstance(value, tuple):
        is_record = hasattr(value, '_fields')
        return all(_is_numeric(each) or (is_record and dataclasses.is_dataclass(each)) for each in value)
    return value is None or isinstance(value, int | float | partial) or hasattr(value, 'dtype')


class Kept(NamedTuple):
    """What `keep` gives where everything runs as Python."""

    value: Any


def keep(value: Any) -> Any:
    """A record with ``value``, as `for_compiler` gives it, for its only attribute, ``value``.

    Compiled code gets the record as one pointer, so a call from Python costs the same however large the value is.
    """
    return Kept(value) if runs_as_python() else _maker_of_kept()(value)


@cache
def _mutable_type(name: str, fields: tuple[str, ...]) -> Any:
    """Type of a mutable record in compiled code, and of what Python holds of it: one pointer."""
    import numba
    from numba.experimental import structref as untyped

    structref: Any = untyped
    unliteral: Any = numba.types.unliteral

    class MutableStruct(numba.types.StructRef):
        closed = name, fields

        def preprocess_fields(self, fields: Any) -> Any:
            return tuple((name, unliteral(kind)) for name, kind in fields)

    class MutableProxy(untyped.StructRefProxy):
        """What Python holds of it."""

    structref.register(_named(MutableStruct, 'struct', name, *fields))
    structref.define_proxy(_named(MutableProxy, 'proxy', name, *fields), MutableStruct, list(fields))
    return MutableProxy


@cache
def _maker_of_kept() -> Callable[[Any], Any]:
    """Function of a value that makes its record. numba's own function is compiled anew in each process."""
    kind = _mutable_type('Kept', ('value',))

    def make(value: Any) -> Any:
        return kind(value)

    return compiled(make)


@cache
def _record_type(name: str, fields: tuple[str, ...]) -> Any:
    return _named(namedtuple(name, fields), 'record', name, *fields)


@cache
def _bound_type(function: Callable[..., float]) -> Any:
    """Type of the parameters of ``function``, by which compiled code knows the function."""
    members = {'__slots__': (), 'function': staticmethod(function)}
    made = type(function.__name__, (namedtuple('bound', ['parameters']),), members)
    return _named(made, 'bound', function.__module__, function.__qualname__)


def _named(made: Any, *parts: str) -> Any:
    """Give a type the name by which `__getattr__` makes it in another process: compiled code on disk refers to it."""
    made.__module__, made.__qualname__ = __name__, ':'.join(parts).replace('.', '/')  # a name has no dots
    globals()[made.__qualname__] = made
    return made


def __getattr__(name: str) -> Any:
    kind, *parts = name.replace('/', '.').split(':')
    if kind == 'record':
        return _record_type(parts[0], tuple(parts[1:]))
    if kind == 'bound':
        try:
            return _bound_type(resolve_name(':'.join(parts)))
        except (ImportError, AttributeError):  # a function that is gone, which an index of compiled code still names
            return _named(type('gone', (namedtuple('bound', ['parameters']),), {'__slots__': ()}), kind, *parts)
    if kind in ('struct', 'proxy'):
        _mutable_type(parts[0], tuple(parts[1:]))
        return globals()[name]
    raise AttributeError(f'module {__name__!r} has no attribute {name!r}')


@cache
def runs_as_python() -> bool:
    """Whether nothing is compiled: there is no compiler, or it is told to do nothing."""
    if not has_compiler():
        return True
    import numba

    config: Any = numba.config
    return bool(config.DISABLE_JIT)


# -- what the compiler is taught --------------------------------------------------------------------------------------


def _with_unrolled_loops(function: Function) -> Function:
    """``function`` itself, or if it loops over `unrolled` records, a copy whose loops the compiler unrolls."""
    if 'unrolled' not in function.__code__.co_names:
        return function
    from numba import literal_unroll

    known = function.__globals__ | {'unrolled': literal_unroll}
    return cast(Function, FunctionType(function.__code__, known, function.__name__, function.__defaults__))


def _stand_in(function: Callable[..., Any], known: Callable[..., Any]) -> None:
    """Compiled code that calls ``function`` calls ``known``."""
    from numba.extending import overload

    @overload(function, strict=False, jit_options=INNER)
    def _implementation(*_: Any, **__: Any) -> Callable[..., Any]:
        return known


@cache
def _teach_the_compiler() -> None:
    """Once: what `replace`, `opened`, `closed`, `evaluate` and `bisect_right` are in compiled code."""
    import numpy as np
    from numba.extending import overload

    @overload(replace, strict=False, jit_options=INNER)
    def _replace(record: Any, **changes: Any) -> Callable[..., Any]:
        # Every field is an argument: the compiler tells two calls apart by the places and types of their arguments.
        values = [name if name in changes else f'record.{name}' for name in record.fields]
        return _constructor(record.instance_class, values, tuple(record.fields))

    @overload(opened, strict=False, jit_options=INNER)
    def _opened(record: Any) -> Callable[..., Any]:
        parts = zip(record.fields, record.types, strict=True)
        values = [f'opened(record.{name})' if _is_of_dataclass(kind) else f'record.{name}' for name, kind in parts]
        return _constructor(_mutable_type(record.instance_class.__name__, tuple(record.fields)), values)

    @overload(closed, strict=False, jit_options=INNER)
    def _closed(record: Any) -> Callable[..., Any]:
        values = [f'closed(record.{n})' if hasattr(kind, 'closed') else f'record.{n}' for n, kind in record._fields]
        return _constructor(_record_type(*record.closed), values)

    @overload(evaluate, jit_options=INNER)
    def _evaluate(function: Any, first: Any, second: Any) -> Callable[..., Any]:
        del first, second  # `overload` compares the names with those of `evaluate`
        called = _jitted(function.instance_class.function)

        def implementation(function: Any, first: Any, second: Any) -> Any:
            return called(*function.parameters, first, second)

        return implementation

    @overload(bisect_right)
    def _bisect_right(knots: Any, x: Any) -> Callable[..., Any]:
        del knots, x  # `overload` compares the names with those of `bisect_right`

        def implementation(knots: Any, x: Any) -> Any:
            return np.searchsorted(knots, x, side='right')

        return implementation


def _is_of_dataclass(kind: Any) -> bool:
    """Whether a type of the compiler is what `for_compiler` made of a dataclass."""
    return getattr(getattr(kind, 'instance_class', None), '__module__', '') == __name__


def _constructor(kind: Any, values: list[str], given: tuple[str, ...] = ()) -> Callable[..., Any]:
    """Function of a record, and of the ``given`` fields, that makes a ``kind`` of these values.

    It is compiled from text, since the compiler takes no loop over the names of fields.
    """
    arguments = ', '.join(('record', *given))
    code = compile(f'lambda {arguments}: kind({", ".join(values)})', f'<{kind.__name__}>', 'eval').co_consts[0]
    known = {'kind': kind, 'opened': opened, 'closed': closed}
    return FunctionType(code, known, 'constructor', (None,) * len(given))


@cache
def _jitted(function: Callable[..., Any]) -> Callable[..., Any]:
    import numba

    return cast(Callable[..., Any], numba.njit(**INNER)(function))
