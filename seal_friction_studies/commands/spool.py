"""``seal_friction spool``: evaluate a reciprocating rig after the spool-valve paper."""

import argparse
from pathlib import Path
from typing import Any

from seal_friction_ros.offline.commands import command_line as cli


def add_parser(commands: Any) -> None:
    """Add the command."""
    parser = cli.add_command(
        commands, 'spool', run, 'evaluate a reciprocating rig after the spool-valve paper',
        'spool ten_cycles.csv --out outer_ring.html', 'spool ten_cycles_bag --out outer_ring.html',
    )  # fmt: skip
    parser.add_argument('table', type=Path, help='table with time_s, displacement_mm, force_N, or a bag')
    cli.add_page(parser)
    parser.add_argument('--cycles', type=int, default=10, help='cycles of a measurement, default 10')
    parser.add_argument('--cycle', type=int, default=9, help='cycle to evaluate, default 9')
    parser.add_argument('--average', type=int, default=50, metavar='SAMPLES', help='moving average, default 50')
    parser.add_argument('--reference', type=float, metavar='N', help='reference force of another measurement')


def run(arguments: argparse.Namespace) -> int:
    """Evaluate and write the page."""
    from seal_friction_studies.core.spool_evaluation import SpoolEvaluation
    from seal_friction_studies.offline.spool_report import write_spool_report

    law = SpoolEvaluation(cycles=arguments.cycles, evaluated_cycle=arguments.cycle, moving_average=arguments.average)
    numbers = write_spool_report(arguments.table, arguments.out, law, arguments.reference)
    return cli.print_result(arguments, numbers, '')
