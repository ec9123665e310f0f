"""``seal_friction report``: write a page about a bag."""

import argparse
from pathlib import Path
from typing import Any

from seal_friction_ros.offline.commands import command_line as cli


def add_parser(commands: Any) -> None:
    """Add the command."""
    parser = cli.add_command(
        commands, 'report', run, 'write a page with the figures and numbers of a bag',
        'report bags/pull_test --out pull_test.html',
        'report RUN --mapping robot.yaml --namespace boom --out boom.html',
    )  # fmt: skip
    parser.add_argument('bag', type=Path)
    cli.add_namespace(parser)
    cli.add_mapping(parser)
    cli.add_page(parser)


def run(arguments: argparse.Namespace) -> int:
    """Write the page."""
    from seal_friction_ros.core.estimation.configuration import PLACEHOLDER_WARNING
    from seal_friction_ros.offline.reports.bag_report import write_report

    summary = write_report(arguments.bag, arguments.out, arguments.namespace, cli.mapping_of(arguments))
    warning = f'warning: {PLACEHOLDER_WARNING}' if summary.numbers['placeholder_seals'] else ''
    return cli.print_result(arguments, summary, warning)
