"""``seal_friction adapt``: save what the adaptation learns from bags as a seal file."""

import argparse
from pathlib import Path
from typing import Any

from seal_friction_ros.offline.commands import command_line as cli
from seal_friction_ros.offline.work.targets import SEAL_FILE


def add_parser(commands: Any) -> None:
    """Add the command."""
    parser = cli.add_command(
        commands, 'adapt', run, 'learn the friction of today from bags and save it as a seal file',
        'adapt today --seal my_seal.yaml --out my_seal_today.yaml',
    )  # fmt: skip
    parser.add_argument('bags', type=Path, nargs='+', metavar='BAG')
    cli.add_file(parser, '--seal', 'seals', 'seal file to begin with', required=True, metavar='SEAL')
    cli.add_namespace(parser)
    cli.add_target(parser, '--out', SEAL_FILE, metavar='FILE', required=True, help='seal file to write')


def run(arguments: argparse.Namespace) -> int:
    """Learn from the bags in the order given."""
    from seal_friction_ros.offline.replay.adapted_seal import write_adapted_seal

    numbers = write_adapted_seal(arguments.bags, arguments.seal, arguments.out, arguments.namespace)
    summary = (
        f'scale {numbers["scale"]:.4f} +- {numbers["scale_std"]:.4f} after {numbers["reversals"]} reversals; '
        f'friction_scale {numbers["friction_scale"]:.4f}'
    )
    return cli.print_result(arguments, numbers, summary)
