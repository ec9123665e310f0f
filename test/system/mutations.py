"""Mutants of core: ``python test/system/mutations.py --count 200 --seed 1 --under core/estimation [--json]``.

One small change in a copy of the tree at a time; the tests of the room of the changed module have to fail. A mutant
that no test notices survives. The sample is systematic: every n-th mutant of the sorted list, from a random start, so
every file has its share. Equivalent mutants, which no test can kill, count as survivors.

Mutants are in code only: not in docstrings, texts, annotations, decorators, ``raise`` (removed as a whole) and
``__all__``. Constants, tuning constants too, are doubled, integers increased by one.

Tests run as plain Python, the fastest first; slow ones compiled, and only if no other fails. Own code, as mutmut puts
its switch into every function, which the compiler refuses, and cosmic-ray changes the working tree and knows one test
command for all mutants.
"""

import argparse
import ast
import json
import multiprocessing
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import traceback
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import NamedTuple

os.environ |= {'OPENBLAS_NUM_THREADS': '1', 'OMP_NUM_THREADS': '1'}  # before numpy: processes fork from this one

import hypothesis
import numpy  # noqa: F401  loaded once, before processes fork
import pytest
import scipy.optimize
import scipy.sparse.linalg  # noqa: F401  likewise
from rich.console import Console
from rich.table import Table
from rich.text import Text

TREE = Path(__file__).resolve().parents[2]
PACKAGE = 'seal_friction_ros'
REQUIRED = 0.9  # [-] share of killed mutants
COMPILER = {
    'core/estimation/compiled_pipeline.py': ('test_compiled_pipeline.py',),
    'core/foundation/compiled.py': ('test_compiled.py',),
}
"""Modules whose tests run compiled, and these tests: minutes for each mutant."""
NEEDS_COMPILER = (
    'estimation/test_compiled_pipeline.py',
    'foundation/test_compiled.py',
    'servo/test_compiled.py',
)
"""Tests that run only there."""
TABLES = 'test/test_docs.py::test_tables_are_those_of_the_code'
"""Test for every room: the tables of parameters in docs."""
SLOW = 10.0  # [s] of processor time: tests that take longer as plain Python run compiled, if no other test fails


class Mutant(NamedTuple):
    """One change of one file."""

    file: str
    """path in the package"""
    line: int
    start: int
    end: int
    """bytes of the file that are replaced"""
    before: str
    after: str

    def __str__(self) -> str:
        before, after = (' '.join(text.split()) for text in (self.before, self.after))
        return f'{self.file}:{self.line}: {before[:90]}  ->  {after[:90]}'


# --- mutations ---

ORDERS: dict[type, tuple[type, ...]] = {
    ast.Lt: (ast.LtE, ast.GtE),
    ast.LtE: (ast.Lt, ast.Gt),
    ast.Gt: (ast.GtE, ast.LtE),
    ast.GtE: (ast.Gt, ast.Lt),
    ast.Eq: (ast.NotEq,),
    ast.NotEq: (ast.Eq,),
    ast.Is: (ast.IsNot,),
    ast.IsNot: (ast.Is,),
    ast.In: (ast.NotIn,),
    ast.NotIn: (ast.In,),
}
ARITHMETIC: dict[type, type] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.Pow: ast.Mult,
    ast.FloorDiv: ast.Mult,
    ast.Mod: ast.Mult,
    ast.BitOr: ast.BitAnd,
    ast.BitAnd: ast.BitOr,
}
NAMES = {'min': 'max', 'max': 'min', 'minimum': 'maximum', 'maximum': 'minimum', 'any': 'all', 'all': 'any'}


def expressions(node: ast.AST) -> Iterator[ast.AST]:  # noqa: C901, PLR0912  a table
    """Expressions to put in the place of one."""
    match node:
        case ast.Compare(left=left, ops=ops, comparators=values):
            for place, order in enumerate(ops):
                for other in ORDERS[type(order)]:
                    yield ast.Compare(left, [*ops[:place], other(), *ops[place + 1 :]], values)
        case ast.BinOp(op=op, left=left, right=right) if type(op) in ARITHMETIC and not any(
            map(is_type_or_text, (left, right))
        ):
            yield ast.BinOp(left, ARITHMETIC[type(op)](), right)
        case ast.UnaryOp(op=ast.USub() | ast.Not(), operand=operand):
            yield operand
        case ast.BoolOp(op=op, values=values):
            yield ast.BoolOp(ast.Or() if isinstance(op, ast.And) else ast.And(), values)
        case ast.IfExp(test=test, body=body, orelse=orelse) if not isinstance(test, ast.Compare):
            yield ast.IfExp(test, orelse, body)
        case ast.Constant(value=bool(value)):
            yield ast.Constant(not value)
        case ast.Constant(value=int(value)):
            yield ast.Constant(value + 1)
        case ast.Constant(value=float(value)):
            yield ast.Constant(2.0 * value if value else 1.0)
        case ast.Call(func=ast.Name(id='abs'), args=[argument]):
            yield argument
        case ast.Call(func=ast.Name(id=name), args=arguments, keywords=keywords) if name in NAMES:
            yield ast.Call(ast.Name(NAMES[name]), arguments, keywords)
        case ast.Call(func=ast.Attribute(attr=name, value=value), args=arguments, keywords=keywords) if name in NAMES:
            yield ast.Call(ast.Attribute(value, NAMES[name]), arguments, keywords)


def is_type_or_text(operand: ast.expr) -> bool:
    """Whether an operand is of an operator that joins types or texts, as in ``int | None``."""
    return isinstance(operand, ast.JoinedStr) or (
        isinstance(operand, ast.Constant) and isinstance(operand.value, str | None)
    )


def statements(node: ast.AST) -> Iterator[str]:
    """Statements to put in the place of one."""
    match node:
        case ast.Expr(value=ast.Call()) | ast.AugAssign() | ast.Raise() | ast.Continue() | ast.Break():
            yield 'pass'
        case ast.Assign(targets=[ast.Attribute() | ast.Subscript()]):
            yield 'pass'
        case ast.Return(value=ast.expr() as value) if not (isinstance(value, ast.Constant) and value.value is None):
            yield 'return None'


def children(node: ast.AST) -> Iterator[ast.AST]:
    """Nodes below ``node`` whose changes count."""
    match node:
        case ast.Raise() | ast.JoinedStr():
            return
        case ast.Assign(targets=[ast.Name(id='__all__')]) | ast.If(test=ast.Name(id='TYPE_CHECKING')):
            return
        case ast.FunctionDef():
            yield from (*node.args.defaults, *filter(None, node.args.kw_defaults), *node.body)
        case ast.Lambda():
            yield node.body
        case ast.ClassDef():
            yield from node.body
        case ast.AnnAssign():
            yield from () if node.value is None else (node.value,)
        case _:
            yield from ast.iter_child_nodes(node)


def mutants_of(file: Path) -> list[Mutant]:
    """All mutants of a file."""
    source = file.read_bytes()
    starts = [0]
    for line in source.splitlines(keepends=True):
        starts.append(starts[-1] + len(line))
    found: list[Mutant] = []

    def add(node: ast.AST, after: str) -> None:
        start, end = starts[node.lineno - 1] + node.col_offset, starts[node.end_lineno - 1] + node.end_col_offset
        name = file.relative_to(TREE / PACKAGE).as_posix()
        found.append(Mutant(name, node.lineno, start, end, source[start:end].decode(), after))

    nodes: list[ast.AST] = [ast.parse(source)]
    while nodes:
        node = nodes.pop()
        nodes += children(node)
        for statement in statements(node):
            add(node, statement)
        for expression in expressions(node):
            add(node, f'({ast.unparse(expression)})')
        if isinstance(node, (ast.If, ast.While)) and not isinstance(node.test, (ast.Compare, ast.UnaryOp)):
            add(node.test, f'(not ({ast.unparse(node.test)}))')
    return sorted(found, key=lambda mutant: (mutant.start, mutant.end, mutant.after))


def all_mutants(under: list[str]) -> list[Mutant]:
    """Mutants of the files below the folders ``under``, or of ``file:line``."""
    found = []
    for place in under:
        path, _, line = place.partition(':')
        root = TREE / PACKAGE / path
        for file in sorted(root.rglob('*.py')) if root.is_dir() else [root]:
            found += [mutant for mutant in mutants_of(file) if not line or mutant.line == int(line)]
    return found


def sample(mutants: list[Mutant], count: int, seed: int) -> list[Mutant]:
    """``count`` mutants at equal distances in the list, from a random start."""
    if count >= len(mutants):
        return mutants
    step = len(mutants) / count
    start = random.Random(seed).random() * step  # noqa: S311  no secret
    return [mutants[int(start + number * step)] for number in range(count)]


# --- tests ---


def room_of(file: str) -> str:
    """Folder of a module in core: ``core/estimation``."""
    return '/'.join(file.split('/')[:2])


def tests_of(tree: Path, file: str) -> list[str]:
    """Test files of the room of a module; first the mirrored one, then those that name the module."""
    module = Path(file).stem
    files = sorted((tree / 'test' / room_of(file)).glob('test_*.py'))
    if file in COMPILER:
        files = [path for path in files if path.name in COMPILER[file]]
    else:
        files = [path for path in files if not path.as_posix().endswith(NEEDS_COMPILER)]
    files.sort(key=lambda path: (path.name != f'test_{module}.py', module not in path.read_text()))
    return [*(str(path.relative_to(tree)) for path in files), TABLES]


class _Order:
    """Plugin: fastest tests first, without those that are slow as plain Python; no shrinking of failing examples.

    Args:
        known: Processor time of each test as plain Python [s]; empty: all run, in the order of their files.
        measures: Whether this run measures these times. A slow test ends early.
    """

    def __init__(self, known: dict[str, float], measures: bool) -> None:
        self.known, self.measures = known, measures
        self.seconds: dict[str, float] = {}

    def pytest_sessionstart(self) -> None:
        phases = [hypothesis.Phase.explicit, hypothesis.Phase.generate]
        profile = hypothesis.settings(hypothesis.settings.get_profile('reproducible'), phases=phases)
        hypothesis.settings.register_profile('quick', profile)
        hypothesis.settings.load_profile('quick')

    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        if self.known:
            items[:] = sorted(
                (item for item in items if self.known.get(item.nodeid, 0.0) < SLOW),
                key=lambda item: self.known.get(item.nodeid, 0.0),
            )

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_call(self, item: pytest.Item) -> Iterator[None]:
        def skip(*_: object) -> None:
            pytest.skip('slow')

        started = time.process_time()
        if self.measures:
            signal.signal(signal.SIGPROF, skip)
            signal.setitimer(signal.ITIMER_PROF, SLOW + 0.1)
        try:
            return (yield)
        finally:
            signal.setitimer(signal.ITIMER_PROF, 0.0)
            self.seconds[item.nodeid] = time.process_time() - started


class Run(NamedTuple):
    """Result of one run of tests."""

    passed: bool
    timed_out: bool
    seconds: float
    """processor time"""
    output: str


class Baseline(NamedTuple):
    """Tests of a room without a mutant."""

    tests: list[str]
    compiled: bool
    limit: int
    """[s] of processor time"""
    seconds: dict[str, float]
    """[s] of each test as plain Python"""

    @property
    def slow(self) -> 'Baseline | None':
        """The slow tests, compiled."""
        slow = [name for name, seconds in self.seconds.items() if seconds >= SLOW]
        return Baseline(slow, True, 1000, {}) if slow and not self.compiled else None


def run_tests(tree: Path, baseline: Baseline, *, measures: bool = False) -> Run:
    """Run tests in a copy of the tree, in a process that ends after the limit of processor time."""
    log = tree / 'build' / 'mutant.log'
    log.parent.mkdir(exist_ok=True)
    process = os.fork()
    if not process:
        code = 1
        try:
            os.setsid()
            os.chdir(tree)
            output = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
            os.dup2(output, 1)
            os.dup2(output, 2)
            resource.setrlimit(resource.RLIMIT_CPU, (baseline.limit, baseline.limit + 5))
            signal.alarm(10 * baseline.limit)  # waits for something that does not come
            own = str(tree)
            os.environ |= {'PYTHONPATH': own} | ({} if baseline.compiled else {'NUMBA_DISABLE_JIT': '1'})
            sys.path[:1] = [own]
            order = _Order(baseline.seconds, measures)
            quiet = ['-q', '--tb=line', '-pno:cacheprovider', '-Wignore::pytest.PytestAssertRewriteWarning']
            code = int(pytest.main([*quiet, *([] if measures else ['-x']), *baseline.tests], [order]))
            if measures:
                (tree / 'build' / 'seconds.json').write_text(json.dumps(order.seconds))
        except BaseException:  # noqa: BLE001  the process must not go on as a worker
            traceback.print_exc()
        sys.stdout.flush()
        os._exit(code)
    _, status, usage = os.wait4(process, 0)
    with suppress(ProcessLookupError):
        os.killpg(process, signal.SIGKILL)
    output = log.read_text(errors='replace')[-2000:]
    # Otherwise tests failed, or they or their conftest could not be imported.
    if os.waitstatus_to_exitcode(status) in (pytest.ExitCode.INTERNAL_ERROR, pytest.ExitCode.NO_TESTS_COLLECTED):
        raise RuntimeError(f'the tests did not run:\n{output}')
    killed = os.WIFSIGNALED(status) and os.WTERMSIG(status) in (signal.SIGXCPU, signal.SIGALRM, signal.SIGKILL)
    return Run(status == 0, killed, usage.ru_utime + usage.ru_stime, output)


_tree = Path()


def _make_copy(folder: str) -> None:
    """Copy the tree for this worker process."""
    global _tree  # noqa: PLW0603  of a worker process
    _tree = Path(folder) / str(os.getpid())
    listed = subprocess.run(
        ['git', 'ls-files', '-co', '--exclude-standard', '-z'], cwd=TREE, capture_output=True, check=True
    )
    for name in filter(None, listed.stdout.decode().split('\0')):
        if (TREE / name).is_file():
            (_tree / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(TREE / name, _tree / name)


def _baseline(file: str) -> tuple[str, Baseline]:
    """Run the tests of a module without a mutant."""
    compiled = file in COMPILER
    baseline = Baseline(tests_of(_tree, file), compiled, 3600, {})
    run = run_tests(_tree, baseline, measures=not compiled)
    if not run.passed:
        raise RuntimeError(f'the tests of {file} fail without a mutant:\n{run.output}')
    seconds = {} if compiled else json.loads((_tree / 'build' / 'seconds.json').read_text())
    fast = sum(value for value in seconds.values() if value < SLOW) if seconds else run.seconds
    return file, baseline._replace(seconds=seconds, limit=int(3.0 * fast) + 40)


def _try(task: tuple[Mutant, Baseline]) -> tuple[Mutant, Run]:
    """Run the tests of a mutant, in the copy of this worker."""
    mutant, baseline = task
    path = _tree / PACKAGE / mutant.file
    source = path.read_bytes()
    for stale in (path.parent / '__pycache__').glob(f'{path.stem}.*'):
        stale.unlink()
    sys.dont_write_bytecode = True
    path.write_bytes(source[: mutant.start] + mutant.after.encode() + source[mutant.end :])
    try:
        run = run_tests(_tree, baseline)
        if run.passed and baseline.slow:
            run = run_tests(_tree, baseline.slow)
        return mutant, run
    finally:
        path.write_bytes(source)


# --- the run ---


@dataclass
class Score:
    """Outcome of the mutants of one room."""

    room: str
    mutants: int = 0
    killed: int = 0
    timed_out: int = 0

    @property
    def share(self) -> float:
        """Share of the mutants that were noticed; one that does not end is."""
        return (self.killed + self.timed_out) / self.mutants


def main() -> int:
    """Try mutants; print a table, or JSON."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n', maxsplit=1)[0])
    parser.add_argument('--count', type=int, default=200, help='number of mutants')
    parser.add_argument('--seed', type=int, default=1)
    parser.add_argument('--under', nargs='+', default=['core'], help='folders or files of the package, or file:line')
    parser.add_argument('--workers', type=int, default=1)
    parser.add_argument('--json', action='store_true')
    arguments = parser.parse_args()
    mutants = sample(all_mutants(arguments.under), arguments.count, arguments.seed)
    scores: dict[str, Score] = {}
    survivors = []
    with (
        tempfile.TemporaryDirectory() as folder,
        multiprocessing.get_context('fork').Pool(arguments.workers, _make_copy, (folder,)) as pool,
    ):
        # One module of each room stands for its room, but modules that run compiled for themselves.
        kind = {m.file: m.file if m.file in COMPILER else room_of(m.file) for m in mutants}
        files = {room: file for file, room in kind.items()}.values()
        baselines = {kind[file]: baseline for file, baseline in pool.imap_unordered(_baseline, files)}
        tasks = [(mutant, baselines[kind[mutant.file]]) for mutant in mutants]
        for mutant, run in pool.imap_unordered(_try, tasks):
            score = scores.setdefault(room_of(mutant.file), Score(room_of(mutant.file)))
            score.mutants += 1
            score.timed_out += run.timed_out
            score.killed += not run.passed and not run.timed_out
            if run.passed:
                survivors.append(mutant)
            print(
                f'{"SURVIVED" if run.passed else "killed"} {run.seconds:.0f} s  {mutant}', file=sys.stderr, flush=True
            )
    total = Score(
        'total', *(sum(getattr(s, name) for s in scores.values()) for name in ('mutants', 'killed', 'timed_out'))
    )
    if arguments.json:
        rooms = [asdict(score) for score in (*scores.values(), total)]
        print(json.dumps({'share': total.share, 'rooms': rooms, 'survivors': [m._asdict() for m in survivors]}))
    else:
        table = Table(title=f'seed {arguments.seed}')
        for heading in ('room', 'mutants', 'killed', 'timed out', 'score [%]'):
            table.add_column(Text(heading), justify='left' if heading == 'room' else 'right')
        for s in (*sorted(scores.values(), key=lambda s: s.room), total):
            table.add_row(s.room, str(s.mutants), str(s.killed), str(s.timed_out), f'{100.0 * s.share:.0f}')
        Console().print(table)
        print(*sorted(map(str, survivors)), sep='\n')
    return 0 if total.share >= REQUIRED else 1


if __name__ == '__main__':
    sys.exit(main())
