"""Write the tables of docs/ that follow from the code: ``python tools/make_docs.py``; a test compares them.

Each stands between ``<!-- table: NAME -->`` and ``<!-- end -->``.

The tables of docs/measured.md follow from benches and campaigns, whose command, commit and date stand above each:
``python tools/make_docs.py --measure bench/step.py`` runs the commands of that script again, with ``--json``, and
writes table, commit and date. ``<!-- measured: NAME, NAME -->`` names the columns, or figures, to show.
"""

import argparse
import dataclasses
import inspect
import json
import re
import shlex
import subprocess
import sys
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import takewhile
from pathlib import Path
from typing import Any

from seal_friction_ros.core.estimation.node_options import FRICTION_ESTIMATOR_PARAMETERS
from seal_friction_ros.core.foundation.parameters import Meaning, ParameterGroup, meanings
from seal_friction_ros.core.foundation.units import QUANTITIES
from seal_friction_ros.core.friction.actuator import Uncertainty
from seal_friction_ros.core.friction.force_sum_correction import ForceSumCorrection
from seal_friction_ros.core.friction.geometry import SealGeometry
from seal_friction_ros.core.friction.laws import FRICTION_LAWS
from seal_friction_ros.core.friction.laws.contact_shear import ShearLaw
from seal_friction_ros.core.friction.laws.friction_coefficient import CoefficientTable, PowerLaw
from seal_friction_ros.core.friction.laws.normal_force import AreaDeformationGain, NormalForceTable
from seal_friction_ros.core.friction.laws.velocity_terms import VelocityTerms
from seal_friction_ros.core.friction.mounting import Mounting
from seal_friction_ros.core.friction.presliding import Presliding
from seal_friction_ros.core.friction.pressure_asymmetry import PressureAsymmetry
from seal_friction_ros.core.lubrication.grease import Grease
from seal_friction_ros.core.lubrication.lubrication_case import MapGrid
from seal_friction_ros.core.lubrication.topography import Topography
from seal_friction_ros.core.machine.machine_file import INPUTS
from seal_friction_ros.core.oring_contact.material import Rubber
from seal_friction_ros.core.oring_contact.oring_case import Groove, OringCase, OringNumerics
from seal_friction_ros.core.oring_contact.oring_case_file import MeasuredFriction
from seal_friction_ros.core.servo.simulator_options import SERVO_SIMULATOR_PARAMETERS
from seal_friction_ros.offline.commands.main import make_parser
from seal_friction_studies.core.groove import GrooveSpring
from seal_friction_studies.core.kinematics import ConstantAcceleration
from seal_friction_studies.core.study_case import (
    AirPressure,
    ShearStressStudy,
    SpoolSeal,
    StudyNumerics,
    StudySeal,
    Viscoelasticity,
)
from seal_friction_studies.core.wall import ControlEdge, FilmSupply

sys.path.insert(0, str(Path(__file__).parents[1] / 'test' / 'system'))
from fault_rows import SIGNAL_ROWS, Row
from faults import REQUIRED, TRIALS

from seal_friction_ros.core.friction.seal_file import keys_of_law
from seal_friction_ros.core.friction.temperature import TemperatureScale
from seal_friction_ros.core.friction.term_covariance import TermCovariance

DOCS = Path(__file__).parents[1] / 'docs'
MEASURED_PAGE = DOCS / 'measured.md'
SIMULATOR_FILE = DOCS.parent / 'config' / 'servo_simulator.yaml'
SEAL_PARTS = (
    SealGeometry,
    AreaDeformationGain,
    NormalForceTable,
    PowerLaw,
    CoefficientTable,
    VelocityTerms,
    Presliding,
    Mounting,
    ForceSumCorrection,
    TemperatureScale,
    TermCovariance,
    PressureAsymmetry,
    Uncertainty,
)
"""Parts of a seal file. No table has bounds: a number out of bounds is an error that names the bound."""


LUBRICATION_PARTS = {
    'seal': StudySeal,
    'topography': Topography,
    'grease': Grease,
    'groove': GrooveSpring,
    'air': AirPressure,
    'motion': ConstantAcceleration,
    'numerics': StudyNumerics,
    'control_edge': ControlEdge,
    'film_supply': FilmSupply,
    'viscoelasticity': Viscoelasticity,
    'study': ShearStressStudy,
    'map': MapGrid,
    'seals[]': SpoolSeal,
}
ORING_PARTS = {
    'groove': Groove,
    'rubber': Rubber,
    '': OringCase,
    'friction.contact_shear': ShearLaw,
    'measured': MeasuredFriction,
    'numerics': OringNumerics,
}


def table(parts: Mapping[str, type]) -> str:
    """Markdown table of every key of a case file, as PART.KEY, without bounds."""
    rows = ['| key [unit] | meaning |', '|---|---|']
    for part, record in parts.items():
        for name, meaning in meanings(record).items():
            default = _default(record, name)
            text = f'{meaning.description} Default {default}.' if default else meaning.description
            unit = f' [{meaning.unit}]' if meaning.unit.removeprefix('1') else ''
            rows.append(f'| `{part and f"{part}."}{name}`{unit} | {text} |')
    return '\n'.join(rows)


def node_parameters(groups: Iterable[ParameterGroup]) -> str:
    """Markdown table of the parameters of a node; a dagger: fixed while the node is configured."""
    rows = ['| parameter | default, range | meaning |', '|---|---|---|']
    for name, default, meaning, is_fixed in _parameters(groups):
        words = [f'{default:g}' if isinstance(default, float) else _yaml(default), *_unit_and_range(meaning, '{}')]
        rows.append(f'| `{name}`{"†" if is_fixed else ""} | {" ".join(words)} | {meaning.description} |')
    return '\n'.join(rows)


def parameter_comments(groups: Iterable[ParameterGroup]) -> str:
    """Lines of comment for a parameter file: each parameter with default, unit, range and meaning."""
    lines = []
    for name, default, meaning, is_fixed in _parameters(groups):
        words = [*_unit_and_range(meaning, '[{}]'), *['fixed.'] * is_fixed, meaning.description]
        lines.append(f'# {name}: {_yaml(default)}  # {" ".join(words)}\n')
    return ''.join(lines)


def _parameters(groups: Iterable[ParameterGroup]) -> Iterator[tuple[str, object, Meaning, bool]]:
    """Name, default and meaning of each parameter, and whether it is fixed while the node is configured."""
    for group in groups:
        described, fixed = meanings(group.record_type), group.fixed()
        for name, field in group.names().items():
            default = group.record_type.__dataclass_fields__[field].default
            yield name, default, described[field], name in fixed


def _unit_and_range(meaning: Meaning, form: str) -> list[str]:
    unit = '' if meaning.unit in ('', '1') else form.format(meaning.unit)
    within = '' if meaning.lower is None else f'({meaning.lower:g}…{meaning.upper:g})'
    return [word for word in (unit, within) if word]


PAGES_OF_COMMANDS = {
    'adapt': 'estimation.md#commands',
    'bag': 'machines.md',
    'compare': 'recording.md#replay-in-ci',
    'doctor': 'installation.md',
    'export': 'loop.md',
    'ehl': 'ehl.md',
    'fleet': 'scale.md#a-page-over-many-bags',
    'health': 'estimation.md#commands',
    'identify': 'identification.md',
    'log': 'rig_files.md',
    'monitor': 'monitor.md',
    'oring': 'oring.md',
    'section': 'seal_from_drawing.md',
    'policy': 'security.md',
    'recover': 'recording.md#recover',
    'replay': 'performance.md#replay',
    'report': '#pages',
    'rig': 'rig_files.md',
    'robot': 'first_hour.md#2-write-the-mapping-file',
    'sheet': 'identification.md#what-to-measure',
    'tune': 'tuning.md',
}
"""Page that says more about a command or a kind of it."""


def commands() -> str:
    """Markdown table of every command, with its kinds, as ``--help`` says it."""
    rows = ['| command | does |', '|---|---|']
    for name, parser in _subparsers(make_parser()).items():
        kinds = ', '.join(map(_linked, _subparsers(parser)))
        rows.append(f'| {_linked(name)} | {parser.description}{kinds and f" ({kinds})"} |')
    return '\n'.join(rows)


def _linked(name: str) -> str:
    page = PAGES_OF_COMMANDS.get(name)
    return f'[`{name}`]({page})' if page else f'`{name}`'


def _subparsers(parser: argparse.ArgumentParser) -> dict[str, argparse.ArgumentParser]:
    actions = (action for action in parser._actions if isinstance(action, argparse._SubParsersAction))
    return {name: kind for action in actions for name, kind in action.choices.items()}


def _default(record_type: type, name: str) -> str:
    default = {field.name: field.default for field in dataclasses.fields(record_type)}[name]
    return '' if default is dataclasses.MISSING else f'`{_yaml(default)}`'


def _yaml(value: object) -> str:
    if isinstance(value, tuple):
        return f'[{", ".join(_yaml(item) for item in value)}]'
    if isinstance(value, bool):
        return str(value).lower()
    return repr(value) if value == '' else str(value)


def friction_laws() -> str:
    """A section for each law of the registry: name in a seal file, docstring, other keys it takes, parameters."""
    sections = []
    for law in FRICTION_LAWS:
        about = re.split(r'\n\n(?:Raises|ValueError):', inspect.cleandoc(law.__doc__ or ''))[0]
        others = ', '.join(f'`{key}`' for key in sorted(keys_of_law(law) - {law.PART or law.NAME}))
        text = f'### `coulomb_law: {law.NAME}`\n\n{_markdown(about)}'
        text += f' It takes {others}.' if others else ''
        keys = table({'': law})
        text += f'\n\nUnder `{law.PART or law.NAME}`:\n\n{keys}' if meanings(law) else ''
        sections.append(text)
    return '\n\n'.join(sections)


def _markdown(docstring: str) -> str:
    """Equations and citations of a docstring as Markdown has them."""
    text = re.sub(r'\.\. math::\s*((?:.+\n?)+)', lambda found: f'$${" ".join(found[1].split())}$$\n', docstring)
    return text.replace(']_', ']')


_FEEDFORWARD = {
    'fades': 'fades to 0',
    'dips': 'fades for that sample',
}


def signal_faults() -> str:
    """Markdown table of the faults of a signal."""
    columns = ('fault', 'estimate', 'feed-forward', 'status')
    return _faults(columns, (_signal_row(row) for row in SIGNAL_ROWS))


def _signal_row(row: Row) -> tuple[str, ...]:
    bits = ', '.join(f'`{bit}`' for bit in row.status.split()) if row.status != 'any' else 'one for each'
    return row.fault, row.estimate, _FEEDFORWARD.get(row.feedforward, row.feedforward), bits


def other_faults() -> str:
    """Markdown table of the faults of graph, process and disk."""
    return _faults(('fault', *REQUIRED), ((trial.fault, *trial.required) for trial in TRIALS))


def _faults(columns: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> str:
    """Markdown table; faults with the same consequences are in one row."""
    alike: dict[tuple[str, ...], list[str]] = {}
    for fault, *consequences in rows:
        alike.setdefault(tuple(consequences), []).append(fault)
    lines = [f'| {_named(faults)} | {" | ".join(consequences)} |' for consequences, faults in alike.items()]
    return '\n'.join([f'| {" | ".join(columns)} |', '|---' * len(columns) + '|', *lines])


def _named(faults: list[str]) -> str:
    """Names of faults; the words with which all begin are said once."""
    alike = takewhile(lambda words: len(set(words)) == 1, zip(*(fault.split() for fault in faults), strict=False))
    start = ' '.join(words[0] for words in alike)
    return '; '.join([faults[0], *(fault.removeprefix(start).strip() for fault in faults[1:])])


def machine_inputs() -> str:
    """Markdown table of the inputs of a mapping file, with the units that each takes; the first is SI."""
    rows = ['| input | units |', '|---|---|']
    rows += [f'| `{name}` | {", ".join(QUANTITIES[quantity])} |' for name, quantity in INPUTS.items()]
    return '\n'.join(rows)


def filled(text: str) -> str:
    """Text of a page with every table in it made anew."""
    tables = {record_type.__name__: table({'': record_type}) for record_type in SEAL_PARTS}
    tables['friction_laws'] = friction_laws()
    tables |= {'lubrication_case': table(LUBRICATION_PARTS), 'oring_case': table(ORING_PARTS)}
    tables['machine_inputs'] = machine_inputs()
    tables['commands'] = commands()
    tables['friction_estimator'] = node_parameters(FRICTION_ESTIMATOR_PARAMETERS)
    tables |= {'signal_faults': signal_faults(), 'other_faults': other_faults()}
    return re.sub(
        r'<!-- table: (\w+) -->\n.*?<!-- end -->',
        lambda found: f'<!-- table: {found[1]} -->\n{tables[found[1]]}\n<!-- end -->',
        text,
        flags=re.DOTALL,
    )


def filled_parameter_file(text: str) -> str:
    """Text of the parameter file of ``servo_simulator`` with its list of all parameters made anew."""
    mark = '# Every parameter'
    before, _, after = text.partition(mark)
    return before + mark + after.partition('\n')[0] + '\n' + parameter_comments(SERVO_SIMULATOR_PARAMETERS)


COMMAND = re.compile(
    r'`(?P<command>[^`\n]*python (?P<script>(?:-m )?[^` ]+)[^`\n]*)` \((?P<commit>[0-9a-f]{7,}), (?P<date>[\d-]+)\)'
)
"""Line above a table of measured.md: the command, and commit and date of the run."""
MEASURED = re.compile(COMMAND.pattern + r'\n\n<!-- measured(?:: (?P<columns>[^\n]*))? -->\n.*?<!-- end -->', re.DOTALL)


def measured_again(text: str, script: str, commit: str) -> str:
    """Text of measured.md with what the commands of a script give now; ValueError if none of its tables is of it."""
    if not any(found['script'] == script for found in MEASURED.finditer(text)):
        raise ValueError(f'{script}: no table of {MEASURED_PAGE.name} is of it')
    return MEASURED.sub(lambda found: _measured(found, commit) if found['script'] == script else found[0], text)


def _measured(found: re.Match[str], commit: str) -> str:
    words = [sys.executable if word == 'python' else word for word in shlex.split(found['command'])]
    run = subprocess.run([*words, '--json'], cwd=DOCS.parent, stdout=subprocess.PIPE, text=True, check=True)
    names = found['columns'] or ''
    shown = figures_table(json.loads(run.stdout.splitlines()[-1]), [name for name in names.split(', ') if name])
    head = f'`{found["command"]}` ({commit}, {time.strftime("%Y-%m-%d")})'
    return f'{head}\n\n<!-- measured{names and ": "}{names} -->\n{shown}\n<!-- end -->'


def figures_table(found: Any, names: Sequence[str] = ()) -> str:
    """Markdown table of what a bench or campaign prints as JSON: rows, rows by name, or figures by name.

    ``names`` are the columns, or the figures, to show; empty: all.
    """
    if isinstance(found, list):
        rows = [_figures(row) for row in found]
    elif all(isinstance(row, dict) for row in found.values()):
        rows = [{'': name, **_figures(row)} for name, row in found.items()]
    else:
        figures = {name: value for name, value in _figures(found).items() if not names or name in names}
        rows, names = [{'figure': name, 'value': value} for name, value in figures.items()], ()
    first, *others = dict.fromkeys(head for row in rows for head in row)
    heads = [first, *(head for head in others if not names or head in names)]
    lines = [' | '.join(_cell(row.get(head, '')) for head in heads) for row in rows]
    return '\n'.join([f'| {" | ".join(heads)} |', f'|{"---|" * len(heads)}', *(f'| {line} |' for line in lines)])


def _figures(row: Mapping[str, Any], above: str = '') -> dict[str, Any]:
    """Figures of a row by name, those of a part as PART: NAME."""
    figures: dict[str, Any] = {}
    for name, value in row.items():
        figures |= _figures(value, f'{above}{name}: ') if isinstance(value, dict) else {f'{above}{name}': value}
    return figures


def _cell(value: Any) -> str:
    if isinstance(value, list):
        return ', '.join(map(_cell, value))
    if value is None:
        return ''
    return f'{value:.3g}' if isinstance(value, float) else str(value)


def main() -> int:
    """Write every page, and the parameter file; or measure again."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--measure', metavar='SCRIPT', help='run its commands in docs/measured.md again')
    if script := parser.parse_args().measure:
        commit = subprocess.run(
            ['git', 'rev-parse', '--short=8', 'HEAD'], stdout=subprocess.PIPE, text=True, check=True
        )
        MEASURED_PAGE.write_text(measured_again(MEASURED_PAGE.read_text(), script, commit.stdout.strip()))
        return 0
    for page in sorted(DOCS.glob('*.md')):
        page.write_text(filled(page.read_text()))
    SIMULATOR_FILE.write_text(filled_parameter_file(SIMULATOR_FILE.read_text()))
    return 0


if __name__ == '__main__':
    sys.exit(main())
