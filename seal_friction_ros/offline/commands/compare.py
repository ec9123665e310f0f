"""``seal_friction compare``: compare a topic of two bags."""

import argparse
from pathlib import Path
from typing import Any

from seal_friction_ros.offline.commands import command_line as cli


def add_parser(commands: Any) -> None:
    """Add the command."""
    parser = cli.add_command(
        commands, 'compare', run, 'compare a topic of two bags: first, largest and RMS difference',
        'compare recorded replayed --rtol 0.05',
    )  # fmt: skip
    parser.add_argument('a', type=Path, metavar='A', help='first bag, the reference')
    parser.add_argument('b', type=Path, metavar='B', help='second bag')
    parser.add_argument('--topic', default='', help='default: the friction estimates of each bag')
    parser.add_argument('--atol', type=cli.non_negative, default=0.0, help='absolute tolerance, default 0')
    parser.add_argument('--rtol', type=cli.non_negative, default=0.0, help='relative tolerance, default 0')


def run(arguments: argparse.Namespace) -> int:
    """Compare."""
    from seal_friction_ros.offline.replay.compare import compare

    found = compare(arguments.a, arguments.b, arguments.topic, arguments.atol, arguments.rtol)
    return cli.print_result(arguments, found.numbers(), found.summary(), cli.SUCCESS if found.agree else cli.DIFFERENT)
