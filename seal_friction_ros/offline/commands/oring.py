"""``seal_friction oring``: compute contact stress and normal force of an O-ring by finite elements."""

import argparse
from typing import Any

from seal_friction_ros.offline.commands import command_line as cli
from seal_friction_ros.offline.work.targets import SEAL_FILE


def add_parser(commands: Any) -> None:
    """Add the command."""
    parser = cli.add_command(
        commands, 'oring', run, 'compute contact stress and normal force of an O-ring by finite elements',
        'oring ms28775_114 --out my_seal.yaml --report oring.html',
        'oring ms28775_114 --uncertain 100 --out my_seal.yaml --work build/oring',
    )  # fmt: skip
    cli.add_file(parser, 'case', 'oring', 'case file', metavar='CASE')
    help_text = 'gauge pressures, instead of those in the file'
    parser.add_argument('--pressures', type=float, nargs='+', default=(), metavar='PA', help=help_text)
    cli.add_target(parser, '--out', SEAL_FILE, metavar='SEAL.yaml', help='seal file to write')
    cli.add_page(parser, '--report', required=False)
    cli.add_uncertainty(parser)
    cli.add_workers(parser, 'samples')
    cli.add_work(parser, has_failures=False)


def run(arguments: argparse.Namespace) -> int:
    """Compute, and write seal file and page."""
    from seal_friction_ros.files import config_path
    from seal_friction_ros.offline.contact.oring_runs import compute_case, seal_comment, seal_document
    from seal_friction_ros.offline.reports.oring_report import numbers_text, write_oring_report
    from seal_friction_ros.offline.work.seal_writer import write_seal

    samples, workers = cli.samples_of(arguments), cli.workers_of(arguments)
    if not samples:
        cli.check_only_for(arguments, ('workers', 'scheduler', 'work'), '--uncertain N')
    path, for_seal_file = config_path('oring', arguments.case), arguments.out is not None
    computed = compute_case(path, arguments.pressures, for_seal_file=for_seal_file, for_samples=bool(samples))
    numbers, text, uncertainty = cli.json_value(computed.summary), numbers_text(computed), None
    if samples:
        from seal_friction_ros.offline.contact.sampling import uncertain_ring

        found = uncertain_ring(computed, *samples, workers, arguments.work)
        numbers['uncertainty'], text = found.numbers(), f'{text}\n{found.summary()}'
        uncertainty = found.friction or found.normal_force
    if arguments.report:
        write_oring_report(computed, arguments.report, uncertainty)
    if arguments.out:
        write_seal(seal_document(computed, uncertainty), arguments.out, seal_comment(computed))
    return cli.print_result(arguments, numbers, text)
