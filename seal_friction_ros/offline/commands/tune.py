"""``seal_friction tune``: tune the friction feed-forward."""

import argparse
from pathlib import Path
from typing import Any

from seal_friction_ros.core.foundation.parameters import Meaning, meanings
from seal_friction_ros.core.tuning.settings import MatchSettings, TuningSettings
from seal_friction_ros.offline.commands import command_line as cli


def add_parser(commands: Any) -> None:
    """Add the command."""
    parser = cli.add_command(
        commands, 'tune', run, 'tune the friction feed-forward on a simulated servo or on a recorded axis',
        'tune --out feedforward.yaml',
        'tune --bag BAG --out feedforward.yaml',
    )  # fmt: skip
    parser.add_argument('--bag', type=Path, help='tune on this bag of a real axis instead of the simulated servo')
    help_text = 'parameter file to write; a report goes beside it'
    parser.add_argument('--out', type=Path, required=True, metavar='FILE', help=help_text)
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
    return meanings(TuningSettings) | meanings(MatchSettings)


def run(arguments: argparse.Namespace) -> int:
    """Tune on the simulated servo or on a bag."""
    from seal_friction_ros.offline.replay.replay import chosen_configuration
    from seal_friction_ros.offline.tuning.tune import tune_bag, tune_simulator

    given = _given(arguments)
    configuration = chosen_configuration(arguments.params, arguments.seal)
    if arguments.bag:
        known = MatchSettings(**given)
        result = tune_bag(arguments.bag, arguments.out, known, configuration, arguments.namespace)
    else:
        result = tune_simulator(arguments.out, TuningSettings(**given), configuration)
    numbers = {**result.numbers, 'file': result.file, 'page': result.page, 'figures': result.figures}
    code = cli.SUCCESS if result.better_in_every_case else cli.DIFFERENT
    return cli.print_result(arguments, numbers, f'{result.verdict}\n{result.file} and {result.page}: written', code)


def _given(arguments: argparse.Namespace) -> dict[str, Any]:
    """Settings that were given.

    Raises:
        ValueError: One of them belongs to the other kind of tuning.
    """
    kind, other = (MatchSettings, TuningSettings) if arguments.bag else (TuningSettings, MatchSettings)
    given = {name: value for name in _settings() if (value := getattr(arguments, name)) is not None}
    foreign = [name for name in given if name in meanings(other) and name not in meanings(kind)]
    if foreign or (arguments.namespace and not arguments.bag):
        name = (foreign or ['namespace'])[0].replace('_', '-')
        raise ValueError(f'--{name} is {"not for" if arguments.bag else "only for"} a --bag')
    return given
