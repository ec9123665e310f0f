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
    )  # fmt: skip
    parser.add_argument('sources', type=Path, nargs='+', metavar='SOURCE', help='bag, log, table or data sheet')
    cli.add_target(parser, '--out', SEAL_FILE, required=True, metavar='SEAL.yaml', help='seal file to write')
    cli.add_page(parser, '--report', required=False)
    cli.add_target(
        parser, '--next', DATA_SHEET, metavar='SHEET.csv',
        help='data sheet of the pressures and speeds that would make the law certain; a page goes beside it',
    )  # fmt: skip
    parser.add_argument('--rig', help='rig file of the logs: a path, or the name of one in config/rigs')
    parser.add_argument('--seal', help='seal file with the geometry of the ring: a path, or one in config/seals')
    parser.add_argument(
        '--squeeze-force', action='store_true', help='normal force from the geometry, even if --seal has one'
    )
    parser.add_argument(
        '--seal-chambers',
        dest='chambers',
        type=_chambers,
        metavar='a,b',
        help='what each seal sees: a, b, difference or ambient',
    )
    parser.add_argument('--law', help='law to save instead of the recommended one')
    parser.add_argument(
        '--run-to-run',
        type=cli.non_negative,
        metavar='SHARE',
        help='relative standard deviation between runs, if known',
    )
    parser.add_argument(
        '--refuse-changed',
        action='store_true',
        help='refuse sources whose friction differs by more than 15 %% instead of fitting them together',
    )
    parser.add_argument('--name', default='', help='name of the seal; default: that of the file')
    parser.add_argument('--slowest', type=cli.non_negative, metavar='M/S', help='a slower rod counts as at rest')
    parser.add_argument(
        '--largest-acceleration', type=cli.non_negative, metavar='M/S2', help='samples beyond it are not used'
    )
    cli.add_namespace(parser)


def _chambers(text: str) -> tuple[str, ...]:
    from seal_friction_ros.core.friction.mounting import CHAMBERS, CHAMBERS_TEXT

    chambers = tuple(text.split(','))
    if not {*chambers} <= {*CHAMBERS}:
        raise argparse.ArgumentTypeError(f'{text} is not a list like a,b; a seal sees {CHAMBERS_TEXT}')
    return chambers


def run(arguments: argparse.Namespace) -> int:
    """Identify, and write seal file, page and data sheet."""
    from seal_friction_ros.offline.identification import next_readings
    from seal_friction_ros.offline.identification.pipeline import IdentifyOptions, identify
    from seal_friction_ros.offline.identification.results import identification_numbers
    from seal_friction_ros.offline.identification.sources import SourceOptions
    from seal_friction_ros.offline.identification.wording import summary
    from seal_friction_ros.offline.work.seal_writer import write_seal

    if arguments.next and arguments.report and arguments.next.with_suffix('.html') == arguments.report:
        raise ValueError(f'{arguments.report}: --next writes its page there: choose another name for one of them')
    source_options = SourceOptions(**cli.options_from(arguments, SourceOptions))
    options = IdentifyOptions(**{**cli.options_from(arguments, IdentifyOptions), 'sources': source_options})
    found = identify(arguments.sources, options, arguments.out.stem)
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
    written_text = ', '.join(str(written[key]) for key in ('seal_file', 'sheet', 'sheet_page') if key in written)
    return cli.print_result(arguments, numbers | written, f'{text}\n{written_text}: written')
