"""``seal_friction export fmu``: the estimator, or the friction of the seals, for simulation tools (FMI 2.0 and 3.0).

- ``estimator``: co-simulation; one step is one sample of `LoopSample`, at the time at which the step begins.
- ``friction``: co-simulation and model exchange, without states: `friction_on_rod`.

The binary is for this machine; the sources in the FMU are for other Linux machines.
"""

import platform
import shutil
import tempfile
from pathlib import Path
from typing import Any, NamedTuple
from xml.sax.saxutils import quoteattr
from zipfile import ZIP_DEFLATED, ZipFile

from seal_friction_ros.core.estimation.configuration import Configuration, first_snapshot, snapshot_text
from seal_friction_ros.core.estimation.loop import LoopSample, RodLoad
from seal_friction_ros.core.friction.states import StateFriction
from seal_friction_ros.core.messages.records import FeedForward, FrictionEstimate
from seal_friction_ros.offline.export.c_library import build, digest, filled, sources
from seal_friction_ros.offline.export.c_types import fields_of, meanings_of, number

PLATFORMS = {('2', 'x86_64'): 'linux64', ('3', 'x86_64'): 'x86_64-linux', ('3', 'aarch64'): 'aarch64-linux'}
"""FMI version and machine -> folder of the binary; no binary for others."""

_TAGS = {'2': {float: 'Real', int: 'Integer'}, '3': {float: 'Float64', int: 'Int64'}}
"""FMI version -> its name of the kind of a variable."""


class Variable(NamedTuple):
    """One variable of the FMU."""

    name: str
    place: str  # in C, of the instance
    kind: Any  # float or int
    causality: str  # input, output, or independent: time
    start: float = 0.0
    meaning: str = ''


def variables(model: str) -> list[Variable]:
    """Time, inputs and outputs of a model; a value reference is a place in this list."""
    time = Variable('time', 'time', float, 'independent', meaning='[s]')
    if model == 'friction':
        return [time, *_members(RodLoad, 'load', 'input'), *_members(StateFriction, 'friction', 'output')]
    made = _members(FrictionEstimate, 'answers.friction_estimate', 'output')
    force = _members(FeedForward, 'answers.feed_forward', 'output', 'feedforward_')
    return [time, *_members(LoopSample, 'sample', 'input'), *made, *force]


def _members(kind: Any, place: str, causality: str, prefix: str = '') -> list[Variable]:
    starts, meanings = kind._field_defaults, meanings_of(kind)
    return [
        Variable(prefix + name, f'{place}.{name}', each, causality, starts.get(name, 0.0), meanings.get(name, ''))
        for name, each in fields_of(kind).items()
        if name != 'stamp'
    ]


class Export(NamedTuple):
    """What was made."""

    fmu: Path
    model: str
    fmi: str  # version
    has_binary: bool

    def summary(self) -> str:
        """One line."""
        return f'{self.fmu}: {self.model}, FMI {self.fmi}.0, {"binary and " if self.has_binary else ""}sources'


def export_fmu(configuration: Configuration, fmu: Path, model: str = 'estimator', fmi: str = '3') -> Export:
    """Write an FMU.

    Args:
        configuration: Seal files and settings.
        fmu: File to write.
        model: ``estimator`` or ``friction``.
        fmi: Version, ``2`` or ``3``.

    Raises:
        ValueError: A law of the configuration cannot be translated, or the compiler fails.
    """
    document, name = snapshot_text(first_snapshot(configuration)), f'seal_{model}'
    library = sources(configuration.parameters(), document, name)
    files = {file: library[file] for file in (f'{name}.c', f'{name}.h')} | {'fmu.c': _source(model, fmi, name)}
    folder = PLATFORMS.get((fmi, platform.machine()))
    binary = _built(files) if folder and platform.system() == 'Linux' and shutil.which('cc') else b''
    with ZipFile(fmu, 'w', ZIP_DEFLATED) as file:
        file.writestr('modelDescription.xml', _description(model, fmi, name, digest(document)))
        file.writestr('resources/configuration.json', document)
        for each, text in files.items():
            file.writestr(f'sources/{each}', text)
        if fmi == '3':
            file.writestr('sources/buildDescription.xml', _BUILD.format(name=name))
        if binary:
            file.writestr(f'binaries/{folder}/{name}.so', binary)
    return Export(fmu, model, fmi, bool(binary))


def _source(model: str, fmi: str, name: str) -> str:
    places, inputs = {float: '', int: ''}, [each for each in variables(model) if each.causality == 'input']
    for reference, each in enumerate(variables(model)):
        places[each.kind] += f'    case {reference}: return &self->{each.place};\n'
    return filled('fmu.c', {
        'name': name, 'fmi': fmi, 'is_estimator': str(int(model == 'estimator')), 'inputs': str(len(inputs)),
        'real': _TAGS[fmi][float], 'integer': _TAGS[fmi][int], 'reals': places[float], 'integers': places[int],
        'starts': ' '.join(f'self->{each.place} = {number(each.start)};' for each in inputs),
        'flag': 'int' if fmi == '2' else 'bool', 'integer_type': 'int' if fmi == '2' else 'int64_t',
    })  # fmt: skip


def _built(files: dict[str, str]) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        for name, text in files.items():
            (Path(folder) / name).write_text(text, encoding='utf-8')
        flags = '-std=c11 -O2 -fPIC -shared -Wl,-Bsymbolic'
        command = ['cc', *flags.split(), '-o', 'fmu.so', *(name for name in files if name.endswith('.c')), '-lm']
        build(command, Path(folder))
        return (Path(folder) / 'fmu.so').read_bytes()


# -- modelDescription.xml ---------------------------------------------------------------------------------------------

_BUILD = """<?xml version="1.0" encoding="UTF-8"?>
<fmiBuildDescription fmiVersion="3.0">
  <BuildConfiguration modelIdentifier="{name}">
    <SourceFileSet language="C11"><SourceFile name="fmu.c"/><SourceFile name="{name}.c"/></SourceFileSet>
  </BuildConfiguration>
</fmiBuildDescription>
"""


def _description(model: str, fmi: str, name: str, token: str) -> str:
    files = f'<SourceFiles><File name="fmu.c"/><File name="{name}.c"/></SourceFiles>' if fmi == '2' else ''
    steps = (
        f'<CoSimulation modelIdentifier="{name}" canHandleVariableCommunicationStepSize="true">{files}</CoSimulation>'
    )
    exchange = f'<ModelExchange modelIdentifier="{name}">{files}</ModelExchange>'
    head = {'2': f'guid="{token}" numberOfEventIndicators="0"', '3': f'instantiationToken="{token}"'}[fmi]
    known = variables(model)
    outputs = [i for i, each in enumerate(known) if each.causality == 'output']
    if fmi == '2':
        unknowns = ''.join(f'<Unknown index="{i + 1}"/>' for i in outputs)
        lists = [f'<{group}>{unknowns}</{group}>' for group in ('Outputs', 'InitialUnknowns')]
    else:
        lists = [f'<{each} valueReference="{i}"/>' for each in ('Output', 'InitialUnknown') for i in outputs]
    return '\n'.join([
        '<?xml version="1.0" encoding="UTF-8"?>',
        f'<fmiModelDescription fmiVersion="{fmi}.0" modelName="{name}" {head} generationTool="seal_friction export">',
        *([exchange] if model == 'friction' else []), steps,
        '<ModelVariables>', *(_variable(fmi, i, each) for i, each in enumerate(known)), '</ModelVariables>',
        '<ModelStructure>', *lists, '</ModelStructure>', '</fmiModelDescription>', '',
    ])  # fmt: skip


def _variable(fmi: str, reference: int, each: Variable) -> str:
    variability, tag = 'continuous' if each.kind is float else 'discrete', _TAGS[fmi][each.kind]
    start = f' start="{str(each.start).replace("nan", "NaN")}"' if each.causality == 'input' else ''
    given = f'name="{each.name}" valueReference="{reference}" causality="{each.causality}" variability="{variability}"'
    given += f' description={quoteattr(each.meaning)}' if each.meaning else ''
    return f'<ScalarVariable {given}><{tag}{start}/></ScalarVariable>' if fmi == '2' else f'<{tag} {given}{start}/>'
