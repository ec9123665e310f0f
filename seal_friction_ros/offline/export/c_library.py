"""``seal_friction export c``: the estimator as C, with one header, for a control loop without Python.

The folder has the sources, ``configuration.json`` (seal files and settings), a Makefile, two examples and their
samples. Messages and state are structs of the records of Python.
"""

import hashlib
import re
import shutil
import subprocess
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import make_dataclass
from pathlib import Path
from string import Template
from typing import Any, NamedTuple, get_args

from seal_friction_ros.core.estimation import pipeline
from seal_friction_ros.core.estimation.configuration import (
    ALGORITHM_VERSION,
    Configuration,
    first_snapshot,
    snapshot_text,
)
from seal_friction_ros.core.estimation.loop import LoopSample, RodLoad, friction_on_rod, receive_sample
from seal_friction_ros.core.friction.states import FrictionState, StateFriction
from seal_friction_ros.core.messages.records import Input, Limited, Output, Position, Status
from seal_friction_ros.files import package_version
from seal_friction_ros.offline.bags.recorded_run import read_run
from seal_friction_ros.offline.export.c_translation import Translation
from seal_friction_ros.offline.export.c_types import (
    SCALARS,
    Runtime,
    Static,
    Types,
    UntranslatableError,
    fields_of,
    initialiser,
    snake,
)
from seal_friction_ros.offline.work.targets import mark

TEMPLATES = Path(__file__).parent / 'templates'
MESSAGES = tuple(kind for kind in get_args(Input) if kind is not Position)
ANSWERS: Any = make_dataclass(
    'Answers',
    [one for kind in get_args(Output) for one in ((f'has_{snake(kind.__name__)}', bool), (snake(kind.__name__), kind))],
    namespace={'__doc__': 'What one message or sample makes; an answer counts if its has_ is true.'},
)


class Export(NamedTuple):
    """What was made."""

    folder: Path
    hash: str  # SHA-256 of ``configuration.json``
    is_built: bool

    def summary(self) -> str:
        """One line."""
        built = 'libraries and examples are built' if self.is_built else 'not built, since there is no make or cc'
        return f'{self.folder}: C library of configuration {self.hash[:12]}, {built}'


def export_c(configuration: Configuration, folder: Path, name: str = 'seal_friction', samples: str = '') -> Export:
    """Write the library into ``folder`` and build it, if there are make and a C compiler.

    Args:
        configuration: Seal files and settings.
        folder: Is made, or its files are overwritten.
        name: Of the library, and before each of its names.
        samples: CSV of the examples; default: a second of a rod that goes to and fro.

    Raises:
        ValueError: The name is no identifier of C, a law cannot be translated, or the compiler fails.
    """
    document = snapshot_text(first_snapshot(configuration))
    made = sources(configuration.parameters(), document, name) | {'example.csv': samples or example_samples()}
    folder.mkdir(parents=True, exist_ok=True)
    for file_name, text in made.items():
        (folder / file_name).write_text(text, encoding='utf-8')
    can_build = all(map(shutil.which, ('make', 'cc')))
    if can_build:
        build(['make', '-s', 'build'], folder)
    return Export(folder, digest(document), can_build)


def build(command: Sequence[str], folder: Path) -> None:
    """Run a compiler in a folder. ValueError: it fails, with the error that it tells first."""
    ran = subprocess.run(command, cwd=folder, check=False, capture_output=True, text=True, errors='replace')
    said = ran.stderr.strip().splitlines() or [f'exit status {ran.returncode}']
    if ran.returncode:
        raise ValueError(f'{command[0]} fails: {next((x for x in said if "error" in x), said[0])}')


def digest(document: str) -> str:
    """SHA-256 of seal files and settings."""
    return hashlib.sha256(document.encode()).hexdigest()


def example_samples() -> str:
    """CSV of a second at 1 kHz, in which the rod goes to and fro once."""
    speeds = [0.05] * 500 + [-0.05] * 500  # [m/s]
    return _csv(f'{i}000000,{v},3e6,1e6,{800.0 * v},{v},0.0,' for i, v in enumerate(speeds))


def samples_of(bag: Path) -> str:
    """CSV of the inputs of a bag, a row for each estimate; stamps count from the first one."""
    run = read_run(bag)
    columns = run.time, run.velocity, run.pressure_a, run.pressure_b, run.force_sum
    rows = zip(*(column.tolist() for column in columns), strict=True)
    return _csv(f'{round(time * 1e9)},{",".join(map(repr, values))},,,' for time, *values in rows)


def _csv(rows: Iterable[str]) -> str:
    return '\n'.join([','.join(LoopSample._fields), *rows, ''])


def sources(parameters: pipeline.PipelineParameters, document: str, name: str) -> dict[str, str]:
    """Text of each file but the samples; ``document`` is what ``configuration.json`` holds. ValueError as above."""
    if name == 'example' or not re.fullmatch(r'[a-z][a-z0-9_]{0,40}', name):
        raise ValueError(f'--name {name}: give small letters, digits and underscores, a letter first; not example')
    try:
        values = {
            'name': name, 'NAME': name.upper(), 'mark': mark('export'), 'hash': digest(document),
            'version': f'{package_version()}, algorithm {ALGORITHM_VERSION}', **_parts(parameters, document, name),
        }  # fmt: skip
    except UntranslatableError as error:
        raise ValueError(f'no C for this configuration: {error}') from None
    files = {f'{name}.h': 'library.h', f'{name}.c': 'library.c'} | {
        x: x for x in ('Makefile', 'example.c', 'example.cpp')
    }
    made = {file: filled(template, values) for file, template in files.items()}
    return made | {'configuration.json': document}


def filled(template: str, values: dict[str, str]) -> str:
    """Text of a file in ``templates``."""
    return Template((TEMPLATES / template).read_text(encoding='utf-8')).substitute(values)


def _parts(parameters: pipeline.PipelineParameters, document: str, name: str) -> dict[str, str]:
    """What the templates leave open: structs and functions."""
    types = Types(name)
    for kind in (pipeline.PipelineState, LoopSample, ANSWERS, RodLoad, StateFriction, *MESSAGES):
        types.name(kind)
    structs, types.declarations = '\n'.join(types.declarations), []
    translation, known, time = Translation(types), Static(parameters), Runtime('', int)
    state, answers = Runtime('', pipeline.PipelineState), Runtime('', ANSWERS)
    step, _ = translation.function(receive_sample, [known, state, Runtime('', LoopSample), answers])
    friction, _ = translation.function(friction_on_rod, [Static(parameters.estimator), Runtime('', RodLoad)])
    due, _ = translation.function(pipeline.is_tick_due, [state, time])
    heads, bodies = [], []
    for kind in MESSAGES:
        receive, _ = translation.function(pipeline.receive, [known, state, Runtime('', kind), time, answers, time])
        given = f'{name}_pipeline_state *state, {types.name(kind)} message'
        times = f'int64_t received, int64_t sent, {name}_answers *answers'
        head = f'bool {name}_receive_{snake(kind.__name__)}({given}, {times})'
        heads.append(f'{head};')
        bodies.append(f'{head}\n{{\n    RECEIVE({receive})\n}}\n')
    places = list(_places(pipeline.PipelineState, 'state->'))
    return {
        'structs': structs,
        'enums': '\n'.join(_enum(kind, name) for kind in (Status, FrictionState, Limited)),
        'state_size': str(len(places)),
        'layout': digest(f'{document} {places}')[:16],
        'receivers': '\n'.join(heads),
        'bodies': '\n'.join(bodies),
        'types': '\n'.join(types.declarations),
        'functions': translation.text,
        'first': initialiser(pipeline.init(parameters)),
        'clear': ' '.join(f'answers->{each} = false;' for each in fields_of(ANSWERS) if each.startswith('has_')),
        'step': step,
        'friction': friction,
        'due': due,
        'save': '\n'.join(f'    at = put(at, bits_of_{SCALARS[kind]}({place}));' for place, kind in places),
        'load': '\n'.join(f'    {place} = {SCALARS[kind]}_of(take(&at));' for place, kind in places),
        'latest': f'INT64_C({pipeline.LATEST})',
    }


def _enum(kind: Any, name: str) -> str:
    stem = f'{name}_{snake(kind.__name__)}'
    bits = ',\n'.join(f'    {stem}_{bit.name}'.upper() + f' = {int(bit)}' for bit in kind)
    return f'enum {stem}_bit {{\n{bits}\n}};'


def _places(kind: Any, before: str) -> Iterator[tuple[str, Any]]:
    """Every number of a record in order, as `numbers_in` has them: its place in C, and its kind."""
    for member, each in fields_of(kind).items():
        if each in SCALARS:
            yield f'{before}{member}', each
        else:
            yield from _places(each, f'{before}{member}.')
