"""``seal_friction replay``: replay bags through the estimator."""

import argparse
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from seal_friction_ros.offline.commands.command_line import (
    DIFFERENT,
    SUCCESS,
    UNUSABLE,
    add_command,
    add_configuration,
    add_namespace,
    add_workers,
    number_of_workers,
    print_error,
    print_result,
)

if TYPE_CHECKING:
    from seal_friction_ros.core.estimation.configuration import Configuration
    from seal_friction_ros.offline.replay.answer_comparison import ReplayResult


def add_parser(commands: Any) -> None:
    """Add the command."""
    parser = add_command(
        commands, 'replay', run, 'replay bags through the estimator, faster than real time',
        'replay bags/pull_test --verify',
        'replay bags/pull_test --seal my_seal.yaml --out with_my_seal',
    )  # fmt: skip
    parser.add_argument('bags', type=Path, nargs='+', metavar='BAG')
    add_workers(parser, 'bags')
    add_configuration(parser)
    parser.add_argument('--out', type=Path, metavar='BAG', help='write inputs and new estimates to this bag')
    add_namespace(parser)
    parser.add_argument('--verify', action='store_true', help='compare with the recorded estimates byte for byte')


def run(arguments: argparse.Namespace) -> int:
    """Replay one bag, or several in parallel."""
    from seal_friction_ros.offline.replay.replay import chosen_configuration, replay

    override = chosen_configuration(arguments.params, arguments.seal)
    if len(arguments.bags) > 1:
        return _run_many(arguments, override)
    result = replay(arguments.bags[0], override, arguments.out, arguments.namespace)
    print_result(arguments, _numbers(result), result.summary(verified=arguments.verify))
    return DIFFERENT if arguments.verify and not result.identical else SUCCESS


def _run_many(arguments: argparse.Namespace, override: 'Configuration | None') -> int:
    """Several bags: one line for each, and the exit code of the worst."""
    from seal_friction_ros.offline.replay.parallel_replay import replay_many

    if arguments.out:
        raise ValueError('--out is for one bag: replay several bags one by one')
    outcomes = replay_many(arguments.bags, override, arguments.namespace, number_of_workers(arguments))
    bags, lines = [], []
    for bag, (result, error) in zip(arguments.bags, outcomes, strict=True):
        bags.append({'bag': bag, **(_numbers(result) if result else {'error': error})})
        lines += [f'{bag}: {result.summary(verified=arguments.verify)}'] if result else []
    errors = [outcome.error for outcome in outcomes if outcome.error]
    identical = all(outcome.result is not None and outcome.result.identical for outcome in outcomes)
    print_result(arguments, {'bags': bags, 'identical': identical}, '\n'.join(lines))
    for error in errors:
        print_error(error)
    return UNUSABLE if errors else DIFFERENT if arguments.verify and not identical else SUCCESS


def _numbers(result: 'ReplayResult') -> dict[str, Any]:
    return {**asdict(result), 'identical': result.identical}
