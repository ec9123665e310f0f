"""``seal_friction ehl``: lubricated contact of a seal; `seal_friction_studies` adds ``run`` and ``study``."""

import argparse
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from seal_friction_ros.offline.commands import command_line as cli
from seal_friction_ros.offline.commands.studies import of_studies
from seal_friction_ros.offline.work.targets import SEAL_FILE, mark

if TYPE_CHECKING:
    from seal_friction_ros.core.lubrication.lubrication_case import LubricationCase


def add_parser(commands: Any) -> None:
    """Add the command."""
    description = 'compute the lubricated contact of a seal'
    examples = ('ehl run inner_seal --out inner_seal.html', 'ehl map inner_seal --seal-file mapped.yaml')
    steps = cli.add_group(commands, 'ehl', 'COMMAND', description, *examples)
    for studies in of_studies('commands.ehl'):
        studies.add_commands(steps)
    chart = cli.add_command(
        steps, 'map', run_map, 'compute a friction map: steady friction over speed and pressure',
        'ehl map inner_seal --seal-file mapped.yaml',
        'ehl map inner_seal --uncertain 100 --seal-file mapped.yaml --work build/map',
        needs=('numba',),
    )  # fmt: skip
    cli.add_target(chart, '--seal-file', SEAL_FILE, metavar='FILE.yaml', help='seal file to write')
    cli.add_shared(chart, '--uncertain', '--seed')
    add_case(chart)
    cli.add_shared(chart, '--work')


def add_case(step: argparse.ArgumentParser) -> None:
    """Add the case file, who computes, and the page."""
    cli.add_file(step, 'case', 'ehl', 'case file', metavar='CASE')
    cli.add_workers(step, 'runs')
    cli.add_page(step, required=False)


def run_map(arguments: argparse.Namespace) -> int:
    """Compute the friction map of a case."""
    from seal_friction_ros.offline.contact import lubrication_runs as runs
    from seal_friction_ros.offline.reports.lubrication_report import write_map_page
    from seal_friction_ros.offline.work.seal_writer import write_seal

    samples, workers = cli.samples_of(arguments), cli.workers_of(arguments)
    case = _case(arguments.case)
    uncertainty = None
    if samples:
        from seal_friction_ros.offline.contact.sampling import uncertain_map

        uncertainty = uncertain_map(case, *samples, workers, arguments.work)
    computed = runs.run_map(case, workers, arguments.work)._replace(uncertainty=uncertainty)
    if arguments.seal_file is not None:
        document = runs.seal_document(computed, arguments.seal_file.stem)
        write_seal(document, arguments.seal_file, f'Seal file, {mark("ehl")} map.')
    return print_with_page(arguments, computed, lambda page: write_map_page(computed, page))


def _case(name: str) -> 'LubricationCase':
    """Case of a file, which may have parts that only the studies know: a map is of steady sliding on a plain wall."""
    from seal_friction_ros.offline.contact.lubrication_runs import load_case

    for studies in of_studies('offline.study_runs'):
        case: LubricationCase = studies.single_case(name, 'friction map')
        return case
    return load_case(name)


def print_with_page(arguments: argparse.Namespace, result: Any, write_page: Callable[[Path], Iterable[Path]]) -> int:
    """Write the page, if one is asked for, and print the result."""
    numbers = result.numbers()
    if arguments.out is not None:
        numbers |= {'page': arguments.out, 'figures': tuple(write_page(arguments.out))}
    return cli.print_result(arguments, numbers, result.summary())
