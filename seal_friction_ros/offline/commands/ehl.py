"""``seal_friction ehl``: compute the lubricated contact of a seal."""

import argparse
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from seal_friction_ros.offline.commands import command_line as cli
from seal_friction_ros.offline.work.targets import SEAL_FILE, mark


def add_parser(commands: Any) -> None:
    """Add the command."""
    description = 'compute the lubricated contact of a seal'
    examples = ('ehl run inner_seal --out inner_seal.html', 'ehl map inner_seal --seal-file mapped.yaml')
    steps = cli.add_group(commands, 'ehl', 'COMMAND', description, *examples)
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
    chart = cli.add_command(
        steps, 'map', run_map, 'compute a friction map: steady friction over speed and pressure',
        'ehl map inner_seal --seal-file mapped.yaml',
        'ehl map inner_seal --uncertain 100 --seal-file mapped.yaml --work build/map',
        needs=('numba',),
    )  # fmt: skip
    cli.add_target(chart, '--seal-file', SEAL_FILE, metavar='FILE.yaml', help='seal file to write')
    cli.add_uncertainty(chart)
    for step in (run, study, chart):
        cli.add_file(step, 'case', 'ehl', 'case file', metavar='CASE')
        cli.add_workers(step, 'runs')
        cli.add_page(step, required=False)
    for step in (study, chart):
        cli.add_work(step, has_failures=False)


def run_case(arguments: argparse.Namespace) -> int:
    """Run a case or a spool, or a case on the motion of a bag."""
    from seal_friction_ros.core.lubrication.lubrication_case import Spool
    from seal_friction_ros.offline.contact import lubrication_runs as runs
    from seal_friction_ros.offline.reports import lubrication_report as report

    if arguments.bag is None:
        for option in ('window', 'average'):
            if getattr(arguments, option) is not None:
                raise ValueError(f'--{option} is only for a --bag')
    case = runs.load_case(arguments.case)
    if isinstance(case, Spool):
        if arguments.bag is not None:
            raise ValueError(f'{arguments.case}: a spool cannot be compared with a bag: take the case of one seal')
        spool = runs.run_spool(case, runs.cases_of_spool(case, arguments.case), cli.workers_of(arguments))
        return _finish(
            arguments, spool, lambda page: report.write_spool_page(case.name, spool.result, spool.labels, page)
        )
    if arguments.bag is not None:
        return _compare_with_bag(arguments, case)
    run = runs.run_case(case)
    return _finish(arguments, run, lambda page: report.write_run_page(run, page))


def _compare_with_bag(arguments: argparse.Namespace, case: Any) -> int:
    from seal_friction_ros.core.identification.spool_evaluation import SpoolEvaluation
    from seal_friction_ros.offline.contact.lubrication_comparison import compare_with_bag
    from seal_friction_ros.offline.reports.lubrication_report import write_comparison_page

    window = None if arguments.window is None else (arguments.window[0], arguments.window[1])
    law = SpoolEvaluation() if arguments.average is None else SpoolEvaluation(moving_average=arguments.average)
    comparison = compare_with_bag(case, arguments.bag, window, law)
    return _finish(arguments, comparison, lambda page: write_comparison_page(comparison, page))


def run_study(arguments: argparse.Namespace) -> int:
    """Run a case with each solid shear stress of its study."""
    from seal_friction_ros.offline.contact import lubrication_runs as runs
    from seal_friction_ros.offline.reports.lubrication_report import write_study_page

    case = runs.single_case(arguments.case, 'study')
    study = runs.run_study(case, cli.workers_of(arguments), arguments.work)
    return _finish(arguments, study, lambda page: write_study_page(case, study, page))


def run_map(arguments: argparse.Namespace) -> int:
    """Compute the friction map of a case."""
    from seal_friction_ros.offline.contact import lubrication_runs as runs
    from seal_friction_ros.offline.reports.lubrication_report import write_map_page
    from seal_friction_ros.offline.work.seal_writer import write_seal

    samples, workers = cli.samples_of(arguments), cli.workers_of(arguments)
    case = runs.single_case(arguments.case, 'friction map')
    uncertainty = None
    if samples:
        from seal_friction_ros.offline.contact.sampling import uncertain_map

        uncertainty = uncertain_map(case, *samples, workers, arguments.work)
    computed = runs.run_map(case, workers, arguments.work)._replace(uncertainty=uncertainty)
    numbers, summary = _with_page(arguments, computed, lambda page: write_map_page(computed, page))
    if arguments.seal_file is not None:
        document = runs.seal_document(computed, arguments.seal_file.stem)
        write_seal(document, arguments.seal_file, f'Seal file, {mark("ehl")} map.')
    return cli.print_result(arguments, numbers, summary)


def _finish(arguments: argparse.Namespace, result: Any, write_page: Callable[[Path], Iterable[Path]]) -> int:
    """Write the page, if one is asked for, and print the result."""
    return cli.print_result(arguments, *_with_page(arguments, result, write_page))


def _with_page(
    arguments: argparse.Namespace, result: Any, write_page: Callable[[Path], Iterable[Path]]
) -> tuple[dict[str, Any], str]:
    """Numbers and summary of a result, with the page, if one is asked for."""
    numbers, summary = result.numbers(), result.summary()
    if arguments.out is None:
        return numbers, summary
    figures = tuple(write_page(arguments.out))
    return {**numbers, 'page': arguments.out, 'figures': figures}, summary
