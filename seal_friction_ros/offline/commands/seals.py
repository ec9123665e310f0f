"""``seal_friction seals``: list the seals that there are."""

import argparse
from pathlib import Path
from typing import Any

from seal_friction_ros.offline.commands import command_line as cli


def add_parser(commands: Any) -> None:
    """Add the command."""
    parser = cli.add_command(
        commands, 'seals', run, 'list the seal files with law, range and source',
        'seals',
        'seals my_seals --full',
    )  # fmt: skip
    parser.add_argument('folders', type=Path, nargs='*', metavar='FOLDER', help='default: config/seals')
    parser.add_argument('--full', action='store_true', help='print the whole source of each seal')


def run(arguments: argparse.Namespace) -> int:
    """Print a line or two for each seal file; exit code 1 if one of them cannot be used."""
    from seal_friction_ros.offline.work.seal_list import listed_seals, seal_text

    listed = listed_seals(arguments.folders)
    text = '\n'.join(seal_text(seal, full=arguments.full) for seal in listed)
    unusable = any(seal.error for seal in listed)
    return cli.print_result(arguments, {'seals': listed}, text, cli.DIFFERENT if unusable else cli.SUCCESS)
