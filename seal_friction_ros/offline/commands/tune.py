"""``seal_friction tune``: tune the friction feed-forward."""

import argparse
from pathlib import Path
from typing import Any

from seal_friction_ros.core.foundation.parameters import Meaning, meanings
from seal_friction_ros.core.tuning.settings import RecordedAxisSettings, TuningSettings
from seal_friction_ros.offline.commands import command_line as cli
from seal_friction_ros.offline.work.targets import PARAMETER_FILE


def add_parser(commands: Any) -> None:
    """Add the command."""
    parser = cli.add_command(
        commands, 'tune', run, 'tune the friction feed-forward on a simulated servo or on a recorded axis',
        'tune --out feedforward.yaml',
        'tune --bag BAG --out feedforward.yaml',
        needs=('numba',),
    )  # fmt: skip
    parser.add_argument('--bag', type=Path, help='tune on this bag of a real axis instead of the simulated servo')
    help_text = 'parameter file to write; a report goes beside it'
    cli.add_target(parser, '--out', PARAMETER_FILE, required=True, metavar='FILE.yaml', help=help_text)
    cli.add_configuration(parser)
    cli.add_namespace(parser, 'with --bag: ')
    for name, meaning in _settings().items():
        condition = '' if name in meanings(TuningSettings) else 'with --bag: '
        unit = f' [{meaning.unit}]' if meaning.unit else ''
        text = f'{condition}{meaning.description}{unit}'.replace('%', '%%')
        number = int if name == 'seed' else float
        parser.add_argument(f'--{name.replace("_", "-")}', type=number, metavar='X', help=text)


def _settings() -> dict[str, Meaning]:
    """Settings of both kinds of tuning by name."""
    return meanings(TuningSettings) | meanings(RecordedAxisSettings)


def run(arguments: argparse.Namespace) -> int:
    """Tune on the simulated servo or on a bag."""
    from seal_friction_ros.offline.replay.replay import chosen_configuration
    from seal_friction_ros.offline.reports.tune_report import write_tuning_page
    from seal_friction_ros.offline.tuning.tune import page_of, tune_bag, tune_simulator, write_parameters

    given = _given(arguments)
    configuration = chosen_configuration(arguments.params, arguments.seal)
    if arguments.bag:
        tuning: Any = tune_bag(arguments.bag, RecordedAxisSettings(**given), configuration, arguments.namespace)
    else:
        tuning = tune_simulator(TuningSettings(**given), configuration)
    page = page_of(arguments.out)
    numbers = {**tuning.numbers, 'file': arguments.out, 'page': page, 'figures': write_tuning_page(tuning, page)}
    write_parameters(arguments.out, tuning)
    code = cli.SUCCESS if tuning.found.better_in_every_case else cli.DIFFERENT
    return cli.print_result(arguments, numbers, f'{tuning.summary}\n{arguments.out} and {page}: written', code)


def _given(arguments: argparse.Namespace) -> dict[str, Any]:
    """Settings that were given.

    Raises:
        ValueError: One of them belongs to the other kind of tuning.
    """
    kind, other = (RecordedAxisSettings, TuningSettings) if arguments.bag else (TuningSettings, RecordedAxisSettings)
    given = {name: value for name in _settings() if (value := getattr(arguments, name)) is not None}
    foreign = [name for name in given if name in meanings(other) and name not in meanings(kind)]
    if foreign or (arguments.namespace and not arguments.bag):
        name = (foreign or ['namespace'])[0].replace('_', '-')
        raise ValueError(f'--{name} is {"not for" if arguments.bag else "only for"} a --bag')
    return given
