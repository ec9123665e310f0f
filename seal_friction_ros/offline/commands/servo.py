"""``seal_friction servo``: write a page on a simulated servo with and without friction."""

import argparse
from typing import Any

from seal_friction_ros.offline.commands import command_line as cli


def add_parser(commands: Any) -> None:
    """Add the command."""
    description = 'write a page on a simulated servo with and without friction'
    cli.add_page(cli.add_command(commands, 'servo', run, description, 'servo --out servo.html', needs=('numba',)))


def run(arguments: argparse.Namespace) -> int:
    """Simulate and write the page."""
    from seal_friction_ros.offline.reports.servo_charts import write_servo_charts

    return cli.print_result(arguments, write_servo_charts(arguments.out), '')
