"""``seal_friction charts``: write a page with the curves of a seal file."""

import argparse
from typing import Any

from seal_friction_ros.offline.commands import command_line as cli


def add_parser(commands: Any) -> None:
    """Add the command."""
    parser = cli.add_command(
        commands, 'charts', run, 'write a page with the curves of a seal file',
        'charts ms28775_114 --out ms28775_114.html',
    )  # fmt: skip
    cli.add_file(parser, 'seal', 'seals', 'seal file', metavar='SEAL')
    cli.add_page(parser)


def run(arguments: argparse.Namespace) -> int:
    """Write the page."""
    from seal_friction_ros.files import config_path
    from seal_friction_ros.offline.reports.seal_charts import write_seal_charts

    numbers = write_seal_charts(config_path('seals', arguments.seal), arguments.out)
    return cli.print_result(arguments, numbers, '')
