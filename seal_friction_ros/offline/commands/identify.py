"""``seal_friction identify``: identify a seal file from measurements."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from seal_friction_ros.offline.commands import command_line as cli
from seal_friction_ros.offline.work.targets import DATA_SHEET, SEAL_FILE, mark

if TYPE_CHECKING:
    from seal_friction_ros.offline.identification.results import Identification


def add_parser(commands: Any) -> None:
    """Add the command."""
    parser = cli.add_command(
        commands, 'identify', run, 'identify a seal file from bags, logs, tables or filled data sheets',
        'identify bags/pull_test --out my_seal.yaml --report my_seal.html',
        'identify O-ring257_*bar.csv --rig delft --out o_ring.yaml',
        'identify bags/pull_test --out my_seal.yaml --next next.csv',
        'identify bags/cylinder --seal-kind rod=a --seal-kind piston=difference --out cylinder.yaml',
    )  # fmt: skip
    text = 'bag, log, table or data sheet; path, or URL of fsspec'
    parser.add_argument('sources', type=cli.place, nargs='+', metavar='SOURCE', help=text)
    cli.add_target(parser, '--out', SEAL_FILE, required=True, metavar='SEAL.yaml', help='seal file to write')
    cli.add_page(parser, '--report', required=False)
    cli.add_target(
        parser, '--next', DATA_SHEET, metavar='SHEET.csv',
        help='data sheet of the pressures and speeds that would make the law certain; a page goes beside it',
    )  # fmt: skip
    cli.add_file(parser, '--rig', 'rigs', 'rig file of the logs')
    cli.add_file(parser, '--seal', 'seals', 'seal file with the geometry of the ring')
    cli.add_options(parser, _WHAT_IS_KNOWN)
    cli.add_actuator(parser)
    cli.add_workers(parser, 'sources, and groups of readings that are left out,')
    cli.add_shared(parser, '--work')


def _chambers(text: str) -> tuple[str, ...]:
    from seal_friction_ros.core.friction.mounting import CHAMBERS, CHAMBERS_TEXT

    chambers = tuple(text.split(','))
    if not {*chambers} <= {*CHAMBERS}:
        raise argparse.ArgumentTypeError(f'{text} is not a list like a,b; a seal sees {CHAMBERS_TEXT}')
    return chambers


def _kind(text: str) -> tuple[str, tuple[str, ...]]:
    name, _, chambers = text.partition('=')
    if not name or not name.replace('_', '').replace('-', '').isalnum():
        raise argparse.ArgumentTypeError(f'{text} is not a name and chambers like rod=a,b')
    return name, _chambers(chambers)


_FLAG = {'action': 'store_true'}
_SHARE = {'type': cli.non_negative, 'metavar': 'SHARE'}
_ONE_KIND = 'one of several kinds of seals in the cylinder and what each of its seals sees; one file a kind'
_KIND_ERROR = 'largest standard error of the friction of a kind that is accepted, a share of that friction (0.1)'
_CHANGED = 'refuse sources whose friction differs by more than 15 %% instead of fitting them together'
_WHAT_IS_KNOWN: dict[str, tuple[str, cli.Settings]] = {
    '--squeeze-force': ('normal force from the geometry, even if --seal has one', _FLAG),
    '--seal-chambers': (
        'what each seal sees: a, b, difference or ambient', {'dest': 'chambers', 'type': _chambers, 'metavar': 'a,b'}
    ),
    '--seal-kind': (_ONE_KIND, {'dest': 'kinds', 'type': _kind, 'action': 'append', 'metavar': 'NAME=a,b'}),
    '--largest-kind-error': (_KIND_ERROR, _SHARE),
    '--law': ('law to save instead of the recommended one', {}),
    '--run-to-run': ('relative standard deviation between runs, if known', _SHARE),
    '--presliding': ('identify the elasticity of the seals from the reversals of logs or bags, too', _FLAG),
    '--refuse-changed': (_CHANGED, _FLAG),
    '--name': ('name of the seal; default: that of the file', {'default': ''}),
    '--slowest': ('a slower rod counts as at rest', {'type': cli.non_negative, 'metavar': 'M/S'}),
    '--largest-acceleration': ('samples beyond it are not used', {'type': cli.non_negative, 'metavar': 'M/S2'}),
}  # fmt: skip
"""what is known of the seals, and how they are fitted"""

NOT_FOR_KINDS = {'seal': 'seal', 'squeeze_force': 'squeeze-force', 'chambers': 'seal-chambers'}
"""Options of one kind of seals: field and name."""


def _kinds(arguments: argparse.Namespace) -> dict[str, Any]:
    """Options of several kinds of seals.

    ValueError: there is one, two have the same name, or an option is of one kind.
    """
    from seal_friction_ros.core.identification.candidate_laws import SealKind

    error, names = arguments.largest_kind_error, [name for name, _ in arguments.kinds or ()]
    if not names:
        cli.check_only_for(arguments, ['largest_kind_error'], 'several kinds of seals: give them with --seal-kind')
        return {'kinds': ()}
    given = [option for field, option in NOT_FOR_KINDS.items() if getattr(arguments, field)]
    if given:
        raise ValueError(f'--{given[0]} is for one kind of seals: leave it out, or leave out --seal-kind')
    if len(names) < 2 or len({*names}) < len(names):
        raise ValueError(f'--seal-kind {", ".join(names)}: give two kinds at least, with different names')
    kinds = tuple(SealKind(*kind) for kind in arguments.kinds)
    return {'kinds': kinds} | ({} if error is None else {'largest_kind_error': error})


def _seal_files(arguments: argparse.Namespace) -> dict[str, Path]:
    """Kind -> its seal file: the name of one of several kinds is added to that of ``--out``."""
    out, names = arguments.out, [name for name, _ in arguments.kinds or ()]
    return {name: out.with_name(f'{out.stem}_{name}{out.suffix}') for name in names} or {'': out}


def run(arguments: argparse.Namespace) -> int:
    """Identify, and write seal files, page and data sheet."""
    from seal_friction_ros.offline.identification.pipeline import IdentifyOptions, identify
    from seal_friction_ros.offline.identification.results import identification_numbers
    from seal_friction_ros.offline.identification.sources import SourceOptions
    from seal_friction_ros.offline.identification.wording import summary
    from seal_friction_ros.offline.work.seal_writer import write_seal
    from seal_friction_ros.offline.work.targets import checked_targets

    kinds, files = _kinds(arguments), _seal_files(arguments)
    if arguments.next and arguments.report and arguments.next.with_suffix('.html') == arguments.report:
        raise ValueError(f'{arguments.report}: --next writes its page there: choose another name for one of them')
    others = {name: value for name, value in cli.options_from(arguments, IdentifyOptions).items() if 'kind' not in name}
    of_sources = {**cli.options_from(arguments, SourceOptions), 'mapping': cli.mapping_of(arguments)}
    options = IdentifyOptions(**{**others, **kinds, 'sources': SourceOptions(**of_sources)})
    paths = [one for one in arguments.sources if isinstance(one, Path)]
    targets = [(path, SEAL_FILE) for path in files.values()]
    with checked_targets('identify', targets, paths, force=arguments.force):
        workers = cli.workers_of(arguments)
        found = identify(arguments.sources, options, arguments.out.stem, workers, arguments.work)
        written: dict[str, Any] = {'seal_file': arguments.out}
        if kinds['kinds']:
            written = {'seal_files': {kind: str(path) for kind, path in files.items()}}
        if arguments.report:
            from seal_friction_ros.offline.reports.identification_report import write_identification_report

            figures = write_identification_report(found, arguments.report, files)
            written |= {'report': arguments.report, 'figures': figures}
        for kind, path in files.items():
            write_seal(found.documents[kind], path, f'Seal file, {mark("identify")}.')
        sheet, more, texts = _next(arguments, found)
    if kinds['kinds']:
        texts = [*texts, f'{", ".join(map(str, files.values()))}: written']
    numbers = identification_numbers(found) | more | written | sheet
    return cli.print_result(arguments, numbers, '\n'.join([summary(found), *texts]))


def _next(arguments: argparse.Namespace, found: 'Identification') -> tuple[dict[str, Any], dict[str, Any], list[str]]:
    """Write the sheet of ``--next``: its paths and numbers for JSON, and lines for a person."""
    from seal_friction_ros.offline.identification import next_readings
    from seal_friction_ros.offline.identification.data_sheet import DIMENSIONS, write_new_csv, write_sheet
    from seal_friction_ros.offline.reports.page import write_page

    if not arguments.next:
        return {}, {}, []
    if found.data.used.kinds:
        write_new_csv(next_readings.kinds_sheet(found), arguments.next)
        return {'sheet': arguments.next}, {}, []
    design = next_readings.design_for(found)
    plan, page = next_readings.plan_of(found, design), arguments.next.with_suffix('.html')
    write_sheet(plan, arguments.next)
    write_page(page, 'data_sheet', (), plan=plan, dimensions=DIMENSIONS, command='identify')
    texts = [f'next: {line}' for line in next_readings.texts_of(found, design)]
    return {'sheet': arguments.next, 'sheet_page': page}, next_readings.numbers_of(design), texts
