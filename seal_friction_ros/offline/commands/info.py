"""``seal_friction info``: show the contents of a bag."""

import argparse
from pathlib import Path
from typing import Any

from seal_friction_ros.offline.commands.command_line import SUCCESS, add_command, print_result


def add_parser(commands: Any) -> None:
    """Add the command."""
    add_command(commands, 'info', run, 'show the contents of a bag', 'info bags/pull_test').add_argument(
        'bag', type=Path
    )


def run(arguments: argparse.Namespace) -> int:
    """Show topics, friction states, status bits and seals."""
    from seal_friction_ros.offline.bags.info import bag_info

    info = bag_info(arguments.bag)
    print_result(arguments, info, info.summary())
    return SUCCESS
