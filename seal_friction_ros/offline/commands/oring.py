"""``seal_friction oring``: compute contact stress, normal force and friction of an O-ring by finite elements."""

import argparse
from typing import Any

from seal_friction_ros.offline.commands import command_line as cli
from seal_friction_ros.offline.work.targets import SEAL_FILE


def add_parser(commands: Any) -> None:
    """Add the command."""
    parser = cli.add_command(
        commands, 'oring', run, 'compute contact stress, normal force and friction of an O-ring by finite elements',
        'oring ms28775_114 --out my_seal.yaml --report oring.html',
        'oring my_ring.yaml --reading 35bar,10mm/s,21N --out my_seal.yaml',
        'oring other_size.yaml --law-from my_seal.yaml --out other_seal.yaml',
        'oring ms28775_114 --uncertain 100 --out my_seal.yaml --work build/oring',
    )  # fmt: skip
    cli.add_file(parser, 'case', 'oring', 'case file', metavar='CASE')
    help_text = 'gauge pressures, instead of those in the file'
    parser.add_argument('--pressures', type=float, nargs='+', default=(), metavar='PA', help=help_text)
    cli.add_shared(parser, '--reading')
    help_text = 'seal file of another ring of the same rubber, wall and lubricant, for its shear law'
    cli.add_file(parser, '--law-from', 'seals', help_text, metavar='SEAL')
    cli.add_shared(parser, '--film')
    cli.add_target(parser, '--out', SEAL_FILE, metavar='SEAL.yaml', help='seal file to write')
    cli.add_page(parser, '--report', required=False)
    cli.add_shared(parser, '--uncertain', '--seed')
    cli.add_workers(parser, 'samples')
    cli.add_shared(parser, '--work')


def run(arguments: argparse.Namespace) -> int:
    """Compute, and write seal file and page."""
    from seal_friction_ros.core.oring_contact.ring_friction import Reading
    from seal_friction_ros.files import config_path
    from seal_friction_ros.offline.contact.oring_runs import Task, compute_case, seal_comment, seal_document
    from seal_friction_ros.offline.reports.oring_report import numbers_text, write_oring_report
    from seal_friction_ros.offline.work.seal_writer import write_seal

    samples, workers = cli.samples_of(arguments), cli.workers_of(arguments)
    if not samples:
        cli.check_only_for(arguments, ('workers', 'scheduler', 'work'), '--uncertain N')
    elif arguments.reading:
        raise ValueError('--uncertain is for a ring without a --reading, which leaves its own deviation')
    task = Task(
        arguments.pressures,
        readings=[Reading(*reading) for reading in arguments.reading],
        law_from=config_path('seals', arguments.law_from) if arguments.law_from else None,
        for_seal_file=arguments.out is not None,
        for_samples=bool(samples),
        fluid=arguments.film,
        meshes=True,
    )
    computed = compute_case(config_path('oring', arguments.case), task)
    numbers, text, uncertainty = cli.json_value(computed.numbers()), numbers_text(computed), None
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
