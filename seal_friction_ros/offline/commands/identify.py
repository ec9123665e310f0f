"""``seal_friction identify``: identify a seal file from measurements."""

import argparse
from pathlib import Path
from typing import Any

from seal_friction_ros.offline.commands import command_line as cli
from seal_friction_ros.offline.work.targets import DATA_SHEET, SEAL_FILE, mark


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
    text = 'data sheet of the pressures and speeds that would make the law certain; a page goes beside it'
    cli.add_target(parser, '--next', DATA_SHEET, metavar='SHEET.csv', help=text)
    cli.add_file(parser, '--rig', 'rigs', 'rig file of the logs')
    cli.add_file(parser, '--seal', 'seals', 'seal file with the geometry of the ring')
    cli.add_options(parser, _WHAT_IS_KNOWN)
    cli.add_actuator(parser)
    cli.add_workers(parser, 'sources, and groups of readings that are left out,')
    cli.add_work(parser, has_failures=False)


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
_KIND_ERROR = 'standard error of a kind up to which it is told from the others, a share of its friction (0.1)'
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

NOT_FOR_KINDS = (
    'seal', 'squeeze_force', 'chambers', 'law', 'refuse_changed', 'presliding', 'workers',
    'scheduler', 'work',
)  # fmt: skip
"""options that several kinds of seals do not take"""


def _run_kinds(arguments: argparse.Namespace) -> int:
    """Identify several kinds of seals together, and write a seal file for each."""
    from seal_friction_ros.core.identification.several_kinds import LARGEST_KIND_ERROR, SealKind
    from seal_friction_ros.offline.identification import kinds
    from seal_friction_ros.offline.identification.data_sheet import write_new_csv
    from seal_friction_ros.offline.work.seal_writer import write_seal
    from seal_friction_ros.offline.work.targets import checked_targets

    given = [option for option in NOT_FOR_KINDS if getattr(arguments, option)]
    if given:
        option = {'chambers': 'seal_chambers'}.get(given[0], given[0]).replace('_', '-')
        raise ValueError(f'--{option} is for one kind of seals: leave it out, or leave out --seal-kind')
    names = [name for name, _ in arguments.kinds]
    if len(names) < 2 or len({*names}) < len(names):
        raise ValueError(f'--seal-kind {", ".join(names)}: give two kinds at least, with different names')
    files = kinds.seal_files(arguments.out, names)
    targets = [(path, SEAL_FILE) for path in files.values()]
    paths = [one for one in arguments.sources if isinstance(one, Path)]
    with checked_targets('identify', targets, paths, force=arguments.force):
        each = [SealKind(*kind) for kind in arguments.kinds]
        name, error = arguments.name or arguments.out.stem, arguments.largest_kind_error
        accepted = LARGEST_KIND_ERROR if error is None else error
        options = _source_options(arguments)
        result = kinds.identify_kinds(arguments.sources, options, each, name, arguments.run_to_run, accepted)
        for kind, path in files.items():
            write_seal(result.documents[kind], path, f'Seal file, {mark("identify")}.')
        written: dict[str, Any] = {}
        if arguments.report:
            from seal_friction_ros.offline.reports.kinds_report import write_kinds_report

            figures = write_kinds_report(result, files, arguments.report)
            written = {'report': arguments.report, 'figures': figures}
        if arguments.next:
            write_new_csv(kinds.next_runs_text(result), arguments.next)
            written |= {'sheet': arguments.next}
    numbers = kinds.kinds_numbers(result) | {'seal_files': {kind: str(path) for kind, path in files.items()}} | written
    names_written = ', '.join(map(str, files.values()))
    return cli.print_result(arguments, numbers, f'{kinds.kinds_summary(result)}\n{names_written}: written')


def _source_options(arguments: argparse.Namespace) -> Any:
    from seal_friction_ros.offline.identification.sources import SourceOptions

    return SourceOptions(**{**cli.options_from(arguments, SourceOptions), 'mapping': cli.mapping_of(arguments)})


def run(arguments: argparse.Namespace) -> int:
    """Identify, and write seal file, page and data sheet."""
    if arguments.kinds:
        return _run_kinds(arguments)
    if arguments.largest_kind_error is not None:
        raise ValueError('--largest-kind-error is for several kinds of seals: give them with --seal-kind')
    from seal_friction_ros.offline.identification import next_readings
    from seal_friction_ros.offline.identification.pipeline import IdentifyOptions, identify
    from seal_friction_ros.offline.identification.results import identification_numbers
    from seal_friction_ros.offline.identification.wording import summary
    from seal_friction_ros.offline.work.seal_writer import write_seal

    if arguments.next and arguments.report and arguments.next.with_suffix('.html') == arguments.report:
        raise ValueError(f'{arguments.report}: --next writes its page there: choose another name for one of them')
    known = cli.options_from(arguments, IdentifyOptions)
    options = IdentifyOptions(**{**known, 'sources': _source_options(arguments)})
    workers = cli.workers_of(arguments)
    found = identify(arguments.sources, options, arguments.out.stem, workers, arguments.work)
    design = next_readings.design_for(found) if arguments.next else None
    written: dict[str, Any] = {'seal_file': arguments.out}
    if arguments.report:
        from seal_friction_ros.offline.reports.identification_report import write_identification_report

        figures = write_identification_report(found, arguments.report)
        written |= {'report': arguments.report, 'figures': figures}
    write_seal(found.document, arguments.out, f'Seal file, {mark("identify")}.')
    numbers, text = identification_numbers(found), summary(found)
    if design is not None:
        from seal_friction_ros.offline.identification.data_sheet import write_sheet
        from seal_friction_ros.offline.reports.data_sheet_page import write_data_sheet_page

        plan, page = next_readings.plan_of(found, design), arguments.next.with_suffix('.html')
        write_sheet(plan, arguments.next)
        write_data_sheet_page(plan, page, 'identify')
        written |= {'sheet': arguments.next, 'sheet_page': page}
        numbers |= next_readings.numbers_of(design)
        text = '\n'.join([text, *(f'next: {line}' for line in next_readings.texts_of(found, design))])
    return cli.print_result(arguments, numbers | written, text)
