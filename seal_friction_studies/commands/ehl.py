"""``seal_friction ehl run`` and ``ehl study``: friction over a motion, of a spool, and at several shear stresses."""

import argparse
from pathlib import Path
from typing import Any

from seal_friction_ros.offline.commands import command_line as cli
from seal_friction_ros.offline.commands.ehl import add_case, print_with_page


def add_commands(steps: Any) -> None:
    """Add the commands to the group ``ehl``."""
    run = cli.add_command(
        steps, 'run', run_case, 'compute friction, film and contact over a motion',
        'ehl run inner_seal --out inner_seal.html',
        needs=('numba',),
    )  # fmt: skip
    help_text = 'run through the recorded position of this bag and compare with its force'
    run.add_argument('--bag', type=Path, help=help_text)
    run.add_argument('--window', type=float, nargs=2, metavar=('FROM', 'TO'), help='with --bag: part to take [s]')
    run.add_argument(
        '--average', type=cli.at_least(1), metavar='SAMPLES', help='with --bag: moving average, default 50'
    )
    study = cli.add_command(
        steps, 'study', run_study, 'compute friction with other solid shear stresses',
        'ehl study inner_seal --work build/study --out study.html',
        needs=('numba',),
    )  # fmt: skip
    for step in (run, study):
        add_case(step)
    cli.add_shared(study, '--work')


def run_case(arguments: argparse.Namespace) -> int:
    """Run a case or a spool, or a case on the motion of a bag."""
    from seal_friction_studies.core.study_case import Spool
    from seal_friction_studies.offline import study_report as report
    from seal_friction_studies.offline import study_runs as runs

    if arguments.bag is None:
        for option in ('window', 'average'):
            if getattr(arguments, option) is not None:
                raise ValueError(f'--{option} is only for a --bag')
    case = runs.load_case(arguments.case)
    if isinstance(case, Spool):
        if arguments.bag is not None:
            raise ValueError(f'{arguments.case}: a spool cannot be compared with a bag: take the case of one seal')
        spool = runs.run_spool(case, runs.cases_of_spool(case, arguments.case), cli.workers_of(arguments))
        return print_with_page(
            arguments, spool, lambda page: report.write_spool_page(case.name, spool.result, spool.labels, page)
        )
    if arguments.bag is not None:
        return _compare_with_bag(arguments, case)
    run = runs.run_case(case)
    return print_with_page(arguments, run, lambda page: report.write_run_page(run, page))


def _compare_with_bag(arguments: argparse.Namespace, case: Any) -> int:
    from seal_friction_studies.core.spool_evaluation import SpoolEvaluation
    from seal_friction_studies.offline.bag_comparison import compare_with_bag
    from seal_friction_studies.offline.study_report import write_comparison_page

    window = None if arguments.window is None else (arguments.window[0], arguments.window[1])
    law = SpoolEvaluation() if arguments.average is None else SpoolEvaluation(moving_average=arguments.average)
    comparison = compare_with_bag(case, arguments.bag, window, law)
    return print_with_page(arguments, comparison, lambda page: write_comparison_page(comparison, page))


def run_study(arguments: argparse.Namespace) -> int:
    """Run a case with each solid shear stress of its study."""
    from seal_friction_studies.offline import study_runs as runs
    from seal_friction_studies.offline.study_report import write_study_page

    case = runs.single_case(arguments.case, 'study')
    study = runs.run_study(case, cli.workers_of(arguments), arguments.work)
    return print_with_page(arguments, study, lambda page: write_study_page(case, study, page))
