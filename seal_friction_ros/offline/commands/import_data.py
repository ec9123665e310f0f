"""``seal_friction import``: make a bag from measurements."""

import argparse
from pathlib import Path
from typing import Any

from seal_friction_ros.offline.commands import command_line as cli
from seal_friction_ros.offline.work.targets import BAG


def add_parser(commands: Any) -> None:
    """Add the command."""
    description = 'make a bag from measurements'
    parser = commands.add_parser('import', help=description, description=description)
    sources = parser.add_subparsers(title='sources', required=True, metavar='SOURCE')
    log = cli.add_command(
        sources, 'log', run_log, 'make a bag from a measured log, CSV or white space',
        'import log ram.csv --rig my_rig.yaml --out ram',
    )  # fmt: skip
    log.add_argument('log', type=Path, help='log file')
    log.add_argument('--rig', required=True, help='rig file: a path, or the name of one in config/rigs')
    thesis = cli.add_command(
        sources, 'thesis', run_thesis, 'make a bag from the pull test of the thesis, Tables A-1 to A-3',
        'import thesis --out pull_test',
    )  # fmt: skip
    for source in (log, thesis):
        cli.add_target(source, '--out', BAG, required=True, metavar='BAG', help='bag to make')


def run_log(arguments: argparse.Namespace) -> int:
    """Import a log."""
    from seal_friction_ros.files import config_path
    from seal_friction_ros.offline.bags.import_log import import_log

    summary = import_log(arguments.log, config_path('rigs', arguments.rig), arguments.out)
    return cli.print_result(arguments, summary, f'{arguments.out}: {summary.rows} rows written')


def run_thesis(arguments: argparse.Namespace) -> int:
    """Import the pull test of the thesis."""
    from seal_friction_ros.offline.bags.import_thesis import import_thesis

    summary = import_thesis(arguments.out)
    return cli.print_result(arguments, summary, f'{arguments.out}: {summary.rows} rows written')
