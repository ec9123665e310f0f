"""C from the functions of the estimator: the subset of Python that the compiler of replay takes, too.

`Translation.function` translates a function for given arguments, and every function that it calls. What is known by
then (the parameters: settings, seals, laws) is no argument in C: Python evaluates each expression of known values, the
branches that they rule out are left out, the laws are called by their functions. What is not known is a number or a
record of numbers.

The C computes what Python computes, operation by operation: IEEE double precision in the same order; whole numbers of
64 bits, which wrap around as in compiled replay.
"""

import ast
import inspect
import math
import textwrap
from bisect import bisect_right
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import Any, cast, get_type_hints

from seal_friction_ros.core.estimation.pipeline import send
from seal_friction_ros.core.foundation.compiled import evaluate, replace
from seal_friction_ros.core.messages.records import field_names
from seal_friction_ros.offline.export.c_types import (
    SCALARS,
    Runtime,
    Static,
    Types,
    UntranslatableError,
    Value,
    fields_of,
    first_line,
    initialiser,
    is_kind,
    is_mutable,
    kind_of,
    number,
    snake,
    unified,
)

_WHOLE = {ast.Add: 'add', ast.Sub: 'subtract', ast.Mult: 'multiply'}
_BITS = {ast.BitAnd: '&', ast.BitOr: '|', ast.BitXor: '^'}
_REAL = {ast.Add: '+', ast.Sub: '-', ast.Mult: '*', ast.Div: '/'}
_COMPARED = {ast.Lt: '<', ast.LtE: '<=', ast.Gt: '>', ast.GtE: '>=', ast.Eq: '==', ast.NotEq: '!='}
_ALIKE = (
    'acos', 'asin', 'atan', 'atan2', 'copysign', 'cos', 'cosh', 'exp', 'expm1', 'fabs', 'log', 'log10', 'log1p', 'log2',
    'sin', 'sinh', 'sqrt', 'tan', 'tanh',
)  # fmt: skip
_OF_MATH = {math.pow: 'power', **{getattr(math, name): name for name in _ALIKE}}
_TESTS = {math.isnan: 'isnan', math.isinf: 'isinf', math.isfinite: 'isfinite'}
_RESERVED = {
    'auto', 'break', 'case', 'char', 'const', 'default', 'do', 'double', 'enum', 'extern', 'float', 'goto', 'inline',
    'int', 'long', 'register', 'restrict', 'short', 'signed', 'sizeof', 'static', 'struct', 'switch', 'typedef',
    'union', 'unsigned', 'void', 'volatile', 'bool', 'true', 'false', *_OF_MATH.values(), *_TESTS.values(),
    *_WHOLE.values(), 'absolute', 'smaller', 'larger', 'smaller_integer', 'larger_integer', 'last_place',
}  # fmt: skip


class Translation:
    """The functions and constants of one C file, each once."""

    def __init__(self, types: Types) -> None:
        self.types = types
        self._functions: dict[str, str] = {}  # name in C -> text
        self._known: dict[Any, tuple[str, Any]] = {}  # function and its arguments -> name in C, kind of its value
        self._constants: dict[str, str] = {}  # declaration without name -> name
        self._kept: list[Any] = []  # static arguments: their addresses are keys

    @property
    def text(self) -> str:
        """Everything, in the order that C wants."""
        constants = [f'static const {text.replace("@", name)};' for text, name in self._constants.items()]
        return '\n'.join([*constants, '', *self._functions.values()])

    def constant(self, value: Any) -> str:
        """Name of a constant of a record, or of a table of numbers."""
        is_table = type(value) is tuple
        kind = 'double' if is_table else self.types.name(type(value))
        text = f'{kind} @{"[]" if is_table else ""} = {initialiser(value)}'
        return self._constants.setdefault(text, f'constant_{len(self._constants)}')

    def function(self, function: Callable[..., Any], arguments: Sequence[Value]) -> tuple[str, Any]:
        """Name in C of a function for these arguments, and the kind of its value."""
        key = (function, *(id(a.value) if isinstance(a, Static) else a.kind for a in arguments))
        if key not in self._known:
            self._kept += [a.value for a in arguments if isinstance(a, Static)]
            body = _Body(self, function, arguments)
            module = function.__module__.rpartition('.')[2].capitalize()  # no --name begins with a capital
            name, lines = f'{module}_{function.__name__.strip("_")}', body.lines()
            name += f'_V{len(self._functions)}' if name in self._functions else ''  # no function has a capital
            self._functions[name] = '\n'.join([f'/* {first_line(function)} */', body.head(name), '{', *lines, '}', ''])
            self._known[key] = name, body.returned
        return self._known[key]


class _Body:
    """Translation of one function for the kinds of its arguments."""

    def __init__(self, translation: Translation, function: Callable[..., Any], arguments: Sequence[Value]) -> None:
        self._all, self._function, self._tree = translation, function, _tree_of(function)
        self._given = dict(zip(inspect.signature(function).parameters, arguments, strict=True))
        stored = [n.id for n in ast.walk(self._tree) if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store)]
        self._stores = Counter([*self._given, *stored])
        self._kinds = {name: each.kind for name, each in self._given.items() if isinstance(each, Runtime)}
        self._arguments = tuple(self._kinds)
        self.returned: Any = None

    def head(self, name: str) -> str:
        """Beginning of the function in C."""
        given = ', '.join(map(self._declared, self._arguments))
        return f'static {self._all.types.name(self.returned)} {name}({given or "void"})'

    def lines(self) -> list[str]:
        """Its lines: variables first. Passes repeat until the kind of each variable is known."""
        before = None
        while before != (self._kinds, self.returned):
            before = dict(self._kinds), self.returned
            lines = self._passed()
        variables = [name for name in self._kinds if name not in self._arguments]
        declared = [f'    {self._declared(name)} = {_zero(self._kinds[name])};' for name in variables]
        return [*declared, *lines]

    def _passed(self) -> list[str]:
        self._lines, self._depth, self._temporaries = list[str](), 1, 0
        self._static = {name: each.value for name, each in self._given.items() if isinstance(each, Static)}
        for name in [n for n in self._static if self._stores[n] > 1 and kind_of(self._static[n])]:
            self._set_name(name, Static(self._static[name]))
        self._block(self._tree.body)
        return self._lines

    def _declared(self, name: str) -> str:
        kind = self._kinds[name]
        return f'{self._all.types.name(kind)} {"*" if is_mutable(kind) else ""}{_c_name(name)}'

    def _refuse(self, node: ast.AST) -> Any:
        raise UntranslatableError(f'no C for {type(node).__name__}')

    # -- statements ---------------------------------------------------------------------------------------------------

    def _emit(self, line: str) -> None:
        self._lines.append('    ' * self._depth + line)

    def _block(self, statements: Sequence[ast.stmt]) -> bool:
        """Translate statements; whether the last one leaves the block, so that none is reached after it."""
        for statement in statements:
            try:
                if getattr(self, f'_do_{type(statement).__name__.lower()}', self._refuse)(statement):
                    return True
            except UntranslatableError as error:
                at = f'{self._function.__module__}.{self._function.__name__}: {ast.unparse(statement).splitlines()[0]}'
                raise error if ' in ' in str(error) else UntranslatableError(f'{error} in {at}') from None
        return False

    def _do_expr(self, node: ast.Expr) -> None:
        called = self._value(node.value)
        if isinstance(called, Runtime):
            self._emit(f'{called.code};')

    def _do_return(self, node: ast.Return) -> bool:
        value = Static(None) if node.value is None else self._value(node.value)
        if value == Static(None):
            self._emit('return;')
            return True
        made = self._runtime(value)
        self.returned = made.kind if self.returned is None else unified(self.returned, made.kind)
        self._emit(f'return {self._as(made, self.returned)};')
        return True

    def _do_if(self, node: ast.If) -> bool:
        condition = self._test(node.test)
        if isinstance(condition, Static):
            return self._block(node.body if condition.value else node.orelse)
        is_bracketed = condition.code[0] + condition.code[-1] == '()'
        self._emit(f'if {condition.code} {{' if is_bracketed else f'if ({condition.code}) {{')
        ends = self._indented(node.body)
        if node.orelse:
            self._emit('} else {')
            ends = self._indented(node.orelse) and ends
        self._emit('}')
        return ends and bool(node.orelse)

    def _indented(self, statements: Sequence[ast.stmt]) -> bool:
        self._depth += 1
        ends = self._block(statements)
        self._depth -= 1
        return ends

    def _do_break(self, _: ast.Break) -> bool:
        self._emit('break;')
        return True

    def _do_for(self, node: ast.For) -> None:
        """Its body for each seal, or each number: a break leaves the block of all of them."""
        over = self._value(node.iter)
        if not isinstance(over, Static) or node.orelse:
            raise UntranslatableError('a loop over what is not known, or with "else"')
        self._emit('do {')
        for each in over.value:
            self._static[cast(ast.Name, node.target).id] = each
            self._indented(node.body)
        self._emit('} while (0);')

    def _do_assign(self, node: ast.Assign) -> None:
        first, *others = node.targets
        if isinstance(first, ast.Tuple):
            elements = node.value.elts if isinstance(node.value, ast.Tuple) else []
            values = [self._value(each) for each in elements] or self._members(self._value(node.value))
            copies = [self._temporary(each) if isinstance(each, Runtime) else each for each in values]
            for target, copy in zip(first.elts, copies, strict=True):  # no target changes what another one is set to
                if ast.unparse(target) != '_':
                    self._set(target, copy)
        else:
            self._set(first, self._value(node.value))
        for other in others:
            self._set(other, self._value(_as_read(first)))

    def _do_augassign(self, node: ast.AugAssign) -> None:
        self._set(node.target, self._value(ast.BinOp(_as_read(node.target), node.op, node.value)))

    def _do_annassign(self, node: ast.AnnAssign) -> None:
        self._set(node.target, self._value(cast(ast.expr, node.value)))

    def _members(self, value: Value) -> list[Value]:
        """Members of a record or tuple, which is computed once."""
        if isinstance(value, Static):
            return [Static(each) for each in value.value]
        held = self._temporary(value) if '(' in value.code else value
        return [self._attribute(held, name) for name in field_names(held.kind) or fields_of(held.kind)]

    def _set(self, target: ast.expr, value: Value) -> None:
        if isinstance(target, ast.Name):
            self._set_name(target.id, value)
            return
        place = self._value(_as_read(target))
        if not isinstance(place, Runtime):
            raise UntranslatableError('an assignment to a parameter')
        self._emit(f'{place.code} = {self._as(self._runtime(value), place.kind)};')

    def _set_name(self, name: str, value: Value) -> None:
        if isinstance(value, Static) and (self._stores[name] < 2 or kind_of(value.value) is None):
            if self._stores[name] > 1 and self._static.setdefault(name, value.value) is not value.value:
                raise UntranslatableError(f'{name} is one or the other, and no number')
            self._static[name] = value.value
            return
        self._static.pop(name, None)
        made = self._runtime(value)
        self._kinds[name] = unified(self._kinds.get(name, made.kind), made.kind)
        self._emit(f'{_c_name(name)} = {self._as(made, self._kinds[name])};')

    def _temporary(self, value: Runtime) -> Runtime:
        self._temporaries += 1
        name, star = f'held_{self._temporaries}', '*' if is_mutable(value.kind) else ''
        self._emit(f'{self._all.types.name(value.kind)} {star}{name} = {value.code};')
        return Runtime(name, value.kind)

    # -- expressions --------------------------------------------------------------------------------------------------

    def _value(self, node: ast.expr) -> Value:
        """Value of an expression: Python evaluates it, if it has no variable of C."""
        if all(name in self._static or name not in self._kinds for name in _names_in(node)):
            known = getattr(self._function, '__globals__', {})
            return Static(eval(_code_of(node), known, self._static))  # noqa: S307  it is the source of this package
        translate: Any = getattr(self, f'_of_{type(node).__name__.lower()}', self._refuse)
        return cast(Value, translate(node))

    def _runtime(self, value: Value) -> Runtime:
        """A value as C computes it: numbers as literals, records as constants."""
        if isinstance(value, Runtime):
            return value
        kind = kind_of(value.value)
        if kind is None:
            raise UntranslatableError(f'{value.value!r} is no number and no record of numbers')
        if kind in SCALARS:
            return Runtime(number(value.value), kind)
        if isinstance(kind, tuple):
            return Runtime(f'({self._all.types.name(kind)}){initialiser(value.value)}', kind)
        return Runtime(self._all.constant(value.value), kind)

    def _as(self, value: Runtime, kind: Any) -> str:
        """Code of a value where another kind stands."""
        if unified(value.kind, kind) != kind or (value.kind != kind and kind not in SCALARS):
            raise UntranslatableError(f'{value.kind} where {kind} stands')
        return value.code

    def _made(self, kind: Any, members: Sequence[Value]) -> str:
        fields = fields_of(kind)
        parts = [f'.{n} = {self._as(self._runtime(v), fields[n])}' for n, v in zip(fields, members, strict=True)]
        return f'({self._all.types.name(kind)}){{{", ".join(parts)}}}'

    def _of_name(self, node: ast.Name) -> Value:
        return Runtime(_c_name(node.id), self._kinds[node.id])

    def _of_attribute(self, node: ast.Attribute) -> Value:
        return self._attribute(self._value(node.value), node.attr)

    def _attribute(self, value: Value, name: str) -> Value:
        if isinstance(value, Static):
            return Static(getattr(value.value, name))
        if name not in fields_of(value.kind):
            return Static(None)  # what may be anything, as the name of a frame
        kind, base = fields_of(value.kind)[name], value.code
        path = f'{base}->{name}' if is_mutable(value.kind) and base[0] != '&' else f'{base.lstrip("&")}.{name}'
        return Runtime(f'&{path}' if is_mutable(kind) else path, kind)

    def _of_subscript(self, node: ast.Subscript) -> Value:
        record, index = self._value(node.value), self._value(node.slice)
        if isinstance(index, Static):
            if isinstance(record, Static):
                return Static(record.value[index.value])
            return self._members(record)[cast(int, index.value)]
        if isinstance(record, Static):
            return Runtime(f'{self._all.constant(record.value)}[{index.code}]', float)
        raise UntranslatableError('a place in a record that is not known')

    def _of_tuple(self, node: ast.Tuple) -> Value:
        values = [self._runtime(self._value(each)) for each in node.elts]
        kinds = tuple(each.kind for each in values)
        return Runtime(self._made(kinds, values), kinds)

    def _of_unaryop(self, node: ast.UnaryOp) -> Value:
        if isinstance(node.op, ast.Not):
            return _negated(self._test(node.operand))
        value = self._runtime(self._value(node.operand))
        if isinstance(node.op, ast.Invert):
            return Runtime(f'(~{value.code})', int)
        return Runtime(f'(-{value.code})', float) if value.kind is float else Runtime(f'subtract(0, {value.code})', int)

    def _of_binop(self, node: ast.BinOp) -> Value:
        a, b, kind = self._runtime(self._value(node.left)), self._runtime(self._value(node.right)), type(node.op)
        is_real = float in (a.kind, b.kind)
        if a.kind not in SCALARS or b.kind not in SCALARS or kind not in (_REAL if is_real else {**_REAL, **_BITS}):
            raise UntranslatableError('an operator on what it is not for')
        if is_real or kind is ast.Div:
            return Runtime(f'({_real(a)} {_REAL[kind]} {_real(b)})', float)
        if kind in _BITS:
            return Runtime(f'({a.code} {_BITS[kind]} {b.code})', int)
        return Runtime(f'{_WHOLE[kind]}({a.code}, {b.code})', int)

    def _of_compare(self, node: ast.Compare) -> Value:
        values = [self._value(each) for each in (node.left, *node.comparators)]
        links = [self._compared(op, a, b) for op, a, b in zip(node.ops, values, values[1:], strict=False)]
        return _joined(links, '&&', decisive=False)

    def _compared(self, kind: ast.cmpop, a: Value, b: Value) -> Value:
        if isinstance(kind, ast.In | ast.NotIn):
            found = _joined([self._compared(ast.Eq(), a, each) for each in self._members(b)], '||', decisive=True)
            return found if isinstance(kind, ast.In) else _negated(found)
        if isinstance(kind, ast.Is | ast.IsNot):
            return Static(isinstance(kind, ast.IsNot))  # a number is not None
        return Runtime(f'({self._runtime(a).code} {_COMPARED[type(kind)]} {self._runtime(b).code})', bool)

    def _of_boolop(self, node: ast.BoolOp) -> Value:
        return self._test(node, is_value=True)

    def _test(self, node: ast.expr, *, is_value: bool = False) -> Value:
        """Truth of a value; as a value itself, `and` and `or` are those of truths alone."""
        if isinstance(node, ast.BoolOp):
            is_or, tests = isinstance(node.op, ast.Or), [self._test(each, is_value=is_value) for each in node.values]
            return _joined(tests, '||' if is_or else '&&', decisive=is_or)
        value = self._value(node)
        if isinstance(value, Static):
            return Static(bool(value.value))
        if is_value and value.kind is not bool:
            raise UntranslatableError('"and" or "or" for a number')
        return value if value.kind is bool else Runtime(f'({value.code} != 0)', bool)

    def _of_ifexp(self, node: ast.IfExp) -> Value:
        test = self._test(node.test)
        if isinstance(test, Static):
            return self._value(node.body if test.value else node.orelse)
        body, otherwise = self._runtime(self._value(node.body)), self._runtime(self._value(node.orelse))
        kind = unified(body.kind, otherwise.kind)
        return Runtime(f'({test.code} ? {self._as(body, kind)} : {self._as(otherwise, kind)})', kind)

    # -- calls --------------------------------------------------------------------------------------------------------

    def _of_call(self, node: ast.Call) -> Value:
        called = self._value(node.func)
        if not isinstance(called, Static):
            raise UntranslatableError('a call of what is not known')
        values = [self._value(each) for each in node.args]
        return self._called(called.value, values, {str(each.arg): self._value(each.value) for each in node.keywords})

    def _called(self, function: Any, values: list[Value], named: Mapping[str, Value]) -> Value:
        if function is send:
            return self._sent(*map(self._runtime, values[:2]))
        if function is replace:
            return self._replaced(self._runtime(values[0]), named)
        if function is evaluate:
            law = cast(Static, values[0]).value
            return self._called(law.func, [*map(Static, law.args), *values[1:]], {})
        if function is bisect_right:
            knots = cast(Static, values[0]).value
            return Runtime(
                f'last_place({self._all.constant(knots)}, {len(knots)}, {self._runtime(values[1]).code})', int
            )
        if function is type:
            return Static(cast(Runtime, values[0]).kind)
        if not (inspect.isfunction(function) or is_kind(function)) or function in SCALARS:
            return self._of_builtin(function, [self._runtime(value) for value in values])
        signature = inspect.signature(function)
        arguments: dict[str, Value] = {name: Static(each.default) for name, each in signature.parameters.items()}
        arguments |= signature.bind(*values, **named).arguments
        if is_kind(function):
            return Runtime(self._made(function, [arguments[name] for name in fields_of(function)]), function)
        return self._of_function(function, arguments)

    def _of_function(self, function: Any, arguments: dict[str, Value]) -> Runtime:
        """Call of a function with a source. Static numbers are arguments, so that it is translated once."""
        for name, value in arguments.items():
            is_number = isinstance(value, Runtime) or type(value.value) in SCALARS
            made = self._runtime(value) if is_number else value
            is_float = isinstance(made, Runtime) and _hints_of(function).get(name) is float
            arguments[name] = Runtime(cast(Runtime, made).code, float) if is_float else made
        name, kind = self._all.function(function, list(arguments.values()))
        codes = [each.code for each in arguments.values() if isinstance(each, Runtime)]
        return Runtime(f'{name}({", ".join(codes)})', kind)

    def _replaced(self, record: Runtime, changes: Mapping[str, Value]) -> Value:
        held, fields = self._temporary(record), fields_of(record.kind)
        for name, value in changes.items():
            self._emit(f'{held.code}.{name} = {self._as(self._runtime(value), fields[name])};')
        return held

    def _sent(self, answers: Runtime, record: Runtime) -> Value:
        place = snake(record.kind.__name__)
        self._emit(f'{answers.code}->{place} = {record.code};')
        self._emit(f'{answers.code}->has_{place} = true;')
        return Static(None)

    def _of_builtin(self, function: Any, each: Sequence[Runtime]) -> Value:
        codes, kind = ', '.join(one.code for one in each), unified(each[0].kind, each[-1].kind)
        if function in _TESTS:
            return Runtime(f'({_TESTS[function]}({codes}) != 0)', bool)
        if function in _OF_MATH:
            return Runtime(f'{_OF_MATH[function]}({codes})', float)
        if function in (float, int):
            return Runtime(f'({SCALARS[function]}){each[0].code}', function)
        if function is abs:
            return Runtime(f'{"fabs" if kind is float else "absolute"}({codes})', kind)
        if function in (max, min) and len(each) == 2:
            name = 'larger' if function is max else 'smaller'
            return Runtime(f'{name}{"" if kind is float else "_integer"}({codes})', kind)
        raise UntranslatableError(f'no C for {function!r}')


@cache
def _tree_of(function: Any) -> ast.FunctionDef:
    return cast(ast.FunctionDef, ast.parse(textwrap.dedent(inspect.getsource(function))).body[0])


_hints_of = cache(get_type_hints)


@cache
def _names_in(node: ast.expr) -> frozenset[str]:
    return frozenset(each.id for each in ast.walk(node) if isinstance(each, ast.Name))


@cache
def _code_of(node: ast.expr) -> Any:
    return compile(ast.unparse(node), '<static>', 'eval')


def _as_read(node: ast.expr) -> ast.expr:
    return ast.parse(ast.unparse(node), mode='eval').body


def _c_name(name: str) -> str:
    return f'{name}_' if name in _RESERVED else name


def _zero(kind: Any) -> str:
    return '0' if kind in SCALARS or is_mutable(kind) else '{0}'


def _real(value: Runtime) -> str:
    return value.code if value.kind is float else f'(double){value.code}'


def _negated(value: Value) -> Value:
    return Static(not value.value) if isinstance(value, Static) else Runtime(f'!{value.code}', bool)


def _joined(links: Sequence[Value], sign: str, *, decisive: bool) -> Value:
    """Links of a condition; static ones are left out, or decide."""
    if any(isinstance(each, Static) and bool(each.value) == decisive for each in links):
        return Static(decisive)
    codes = [each.code for each in links if isinstance(each, Runtime)]
    if not codes:
        return Static(not decisive)
    return Runtime(codes[0] if len(codes) == 1 else f'({f" {sign} ".join(codes)})', bool)
