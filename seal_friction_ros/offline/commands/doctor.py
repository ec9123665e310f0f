"""``seal_friction doctor``: what this computer lacks for nodes and commands."""

import argparse
from typing import Any

from seal_friction_ros.offline.commands import command_line as cli


def add_parser(commands: Any) -> None:
    """Add the command."""
    cli.add_command(commands, 'doctor', run, 'say what this computer lacks for nodes and commands', 'doctor')


def run(arguments: argparse.Namespace) -> int:
    """Look and print; exit code 1 if a node cannot run or would not be discovered."""
    from seal_friction_ros.offline.work.computer import FAULT, findings

    found = findings()
    lines = [f'{level:<5} {subject}: {text}' for level, subject, text in found]
    code = cli.DIFFERENT if any(one.level == FAULT for one in found) else cli.SUCCESS
    return cli.print_result(arguments, {'findings': found}, '\n'.join(lines), code)
