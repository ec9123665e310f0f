"""``seal_friction replay``: replay bags through the estimator."""

import argparse
from typing import Any

from seal_friction_ros.offline.commands import command_line as cli
from seal_friction_ros.offline.work.targets import BAG


def add_parser(commands: Any) -> None:
    """Add the command."""
    parser = cli.add_command(
        commands, 'replay', run, 'replay bags through the estimator, faster than real time',
        'replay bags/pull_test --verify',
        'replay bags/pull_test --seal my_seal.yaml --out with_my_seal',
    )  # fmt: skip
    parser.add_argument('bags', type=cli.place, nargs='+', metavar='BAG', help='path, or URL of fsspec')
    cli.add_workers(parser, 'bags, or stretches of one bag,')
    cli.add_work(parser)
    cli.add_configuration(parser)
    cli.add_target(parser, '--out', BAG, metavar='BAG', help='write inputs and new estimates to this bag')
    cli.add_namespace(parser)
    parser.add_argument('--verify', action='store_true', help='compare with the recorded estimates byte for byte')


def run(arguments: argparse.Namespace) -> int:
    """Replay one bag, or several in parallel."""
    from seal_friction_ros.offline.replay.parallel_replay import verify, verify_shared
    from seal_friction_ros.offline.replay.replay import chosen_configuration, replay
    from seal_friction_ros.offline.work.places import as_path

    override = chosen_configuration(arguments.params, arguments.seal)
    if len(arguments.bags) > 1 or arguments.scheduler or arguments.work:
        return _run_many(arguments, override)
    namespace = arguments.namespace
    with as_path(arguments.bags[0]) as bag:
        if arguments.out:
            result = replay(bag, override, arguments.out, namespace)
        else:
            shared = verify_shared(bag, namespace, cli.workers_of(arguments)) if override is None else None
            result = shared or verify(bag, override, namespace)
    code = cli.DIFFERENT if arguments.verify and not result.identical else cli.SUCCESS
    return cli.print_result(arguments, result.numbers(), result.summary(verified=arguments.verify), code)


def _run_many(arguments: argparse.Namespace, override: Any) -> int:
    """Several bags: one line for each, and the exit code of the worst."""
    from seal_friction_ros.offline.replay.parallel_replay import replay_many

    if arguments.out:
        raise ValueError('--out is for one bag on this machine: replay several bags one by one, without --work')
    workers, kept = cli.workers_of(arguments), cli.kept_in(arguments)
    outcomes = replay_many(arguments.bags, override, arguments.namespace, workers, kept)
    bags, lines = [], []
    for bag, (result, error) in zip(arguments.bags, outcomes, strict=True):
        bags.append({'bag': bag, **(result.numbers() if result else {'error': error})})
        lines += [f'{bag}: {result.summary(verified=arguments.verify)}'] if result else []
    errors = [outcome.error for outcome in outcomes if outcome.error]
    identical = all(outcome.result is not None and outcome.result.identical for outcome in outcomes)
    code = cli.UNUSABLE if errors else cli.DIFFERENT if arguments.verify and not identical else cli.SUCCESS
    return cli.print_result(arguments, {'bags': bags, 'identical': identical}, '\n'.join(lines), code, errors)
