"""``seal_friction recover``: make a valid bag from a damaged one."""

import argparse
from pathlib import Path
from typing import Any

from seal_friction_ros.offline.commands import command_line as cli
from seal_friction_ros.offline.work.targets import BAG


def add_parser(commands: Any) -> None:
    """Add the command."""
    description = 'make a valid bag from the readable part of a damaged or unfinished bag'
    parser = cli.add_command(commands, 'recover', run, description, 'recover build/bags/friction_20260302_101500')
    parser.add_argument('bag', type=Path)
    cli.add_target(parser, '--out', BAG, metavar='BAG', help='bag to make; default: BAG_recovered')


def run(arguments: argparse.Namespace) -> int:
    """Recover."""
    from seal_friction_ros.offline.bags.recover import recover

    found = recover(arguments.bag, arguments.out)
    return cli.print_result(arguments, found, found.summary())
