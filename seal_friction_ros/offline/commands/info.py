"""``seal_friction info``: show the contents of a bag."""

import argparse
from pathlib import Path
from typing import Any

from seal_friction_ros.offline.commands import command_line as cli


def add_parser(commands: Any) -> None:
    """Add the command."""
    parser = cli.add_command(commands, 'info', run, 'show the contents of a bag', 'info bags/pull_test')
    parser.add_argument('bag', type=Path)
    cli.add_mapping(parser)


def run(arguments: argparse.Namespace) -> int:
    """Show topics, friction states, status bits and seals."""
    from seal_friction_ros.offline.bags.info import bag_info

    info = bag_info(arguments.bag, cli.mapping_of(arguments))
    return cli.print_result(arguments, info, info.summary())
