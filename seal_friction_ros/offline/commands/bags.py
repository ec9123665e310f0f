"""Commands on bags: ``seal_friction`` ``info``, ``replay``, ``compare``, ``recover``, ``report``."""

import argparse
from pathlib import Path
from typing import Any

from seal_friction_ros.offline.commands import command_line as cli
from seal_friction_ros.offline.work.targets import BAG


def add_parser(commands: Any) -> None:
    """Add the commands."""
    info = cli.add_command(commands, 'info', run_info, 'show the contents of a bag', 'info bags/pull_test')
    replay = cli.add_command(
        commands, 'replay', run_replay, 'replay bags through the estimator, faster than real time',
        'replay bags/pull_test --verify',
        'replay bags/pull_test --seal my_seal.yaml --out with_my_seal',
    )  # fmt: skip
    compare = cli.add_command(
        commands, 'compare', run_compare, 'compare a topic of two bags, or two runs or seals on a page',
        'compare recorded replayed --rtol 0.05 --fields coulomb_friction friction_force=0.5 state',
        'compare before after --out change.html',
        'compare ms28775_114 my_seal.yaml --out seals.html',
    )  # fmt: skip
    description = 'make a valid bag from the readable part of a damaged or unfinished bag'
    example = 'recover build/bags/friction_20260302_101500'
    recover = cli.add_command(commands, 'recover', run_recover, description, example)
    report = cli.add_command(
        commands, 'report', run_report, 'write a page with the figures and numbers of a bag',
        'report bags/pull_test --out pull_test.html',
        'report RUN --mapping robot.yaml --namespace boom --out boom.html',
    )  # fmt: skip
    for parser in (info, recover, report):
        parser.add_argument('bag', type=Path)
    cli.add_mapping(info)
    cli.add_shared(replay, 'bags')
    cli.add_workers(replay, 'bags, or stretches of one bag,')
    cli.add_shared(replay, '--work', '--retry-failed')
    cli.add_configuration(replay)
    cli.add_target(replay, '--out', BAG, metavar='BAG', help='write inputs and new estimates to this bag')
    cli.add_shared(replay, '--namespace')
    replay.add_argument('--verify', action='store_true', help='compare with the recorded estimates byte for byte')
    cli.add_options(compare, _OF_COMPARE)
    cli.add_actuator(compare)
    cli.add_page(compare, required=False)
    cli.add_target(recover, '--out', BAG, metavar='BAG', help='bag to make; default: BAG_recovered')
    cli.add_actuator(report)
    cli.add_page(report)


_OF_COMPARE: dict[str, tuple[str, cli.Settings]] = {
    'a': ('first bag, the reference; with --out also a seal', {'type': Path, 'metavar': 'A'}),
    'b': ('second bag or seal', {'type': Path, 'metavar': 'B'}),
    '--topic': ('default: the friction estimates of each bag', {'default': ''}),
    '--atol': ('absolute tolerance, default 0', {'type': cli.non_negative, 'default': 0.0}),
    '--rtol': ('relative tolerance, default 0', {'type': cli.non_negative, 'default': 0.0}),
    '--fields': (
        'fields that decide, each with its absolute tolerance if it has one of its own; default: the friction',
        {'nargs': '+', 'metavar': 'FIELD[=TOLERANCE]', 'default': []},
    ),
}


def run_info(arguments: argparse.Namespace) -> int:
    """Show topics, friction states, status bits and seals."""
    from seal_friction_ros.offline.bags.info import bag_info

    info = bag_info(arguments.bag, cli.mapping_of(arguments))
    return cli.print_result(arguments, info, info.summary())


def run_replay(arguments: argparse.Namespace) -> int:
    """Replay one bag, or several in parallel."""
    from seal_friction_ros.api import replay
    from seal_friction_ros.offline.work.places import as_path

    if len(arguments.bags) > 1 or arguments.scheduler or arguments.work:
        return _run_many(arguments)
    with as_path(arguments.bags[0]) as bag:
        result = replay(
            bag, seals=arguments.seal or (), params=arguments.params, out=arguments.out,
            namespace=arguments.namespace, workers=cli.workers_of(arguments),
        )  # fmt: skip
    code = cli.DIFFERENT if arguments.verify and not result.identical else cli.SUCCESS
    return cli.print_result(arguments, result.numbers(), result.summary(verified=arguments.verify), code)


def _run_many(arguments: argparse.Namespace) -> int:
    from seal_friction_ros.offline.replay.parallel_replay import replay_many
    from seal_friction_ros.offline.replay.replay import chosen_configuration

    override = chosen_configuration(arguments.params, arguments.seal)
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


def run_compare(arguments: argparse.Namespace) -> int:
    """Compare messages of equal stamp, or with a page the friction of two runs or seals."""
    if arguments.out:
        from seal_friction_ros.offline.reports.comparison_report import write_comparison

        options = ('topic', 'atol', 'rtol', 'fields')
        cli.check_only_for(arguments, options, 'messages of equal stamp: leave it out, or leave out --out')
        mapping = cli.mapping_of(arguments)
        report = write_comparison(arguments.a, arguments.b, arguments.out, arguments.namespace, mapping)
        return cli.print_result(arguments, report, f'{report.numbers["level"]}: {report.numbers["verdict"]}')
    from seal_friction_ros.api import compare

    found = compare(
        arguments.a, arguments.b, topic=arguments.topic, atol=arguments.atol, rtol=arguments.rtol,
        namespace=arguments.namespace, mapping=arguments.mapping,
        tolerances=dict(_tolerance(text) for text in arguments.fields),
    )  # fmt: skip
    return cli.print_result(arguments, found.numbers(), found.summary(), cli.SUCCESS if found.agree else cli.DIFFERENT)


def _tolerance(text: str) -> tuple[str, float | None]:
    """Field and absolute tolerance of ``FIELD[=TOLERANCE]``."""
    name, has_tolerance, value = text.partition('=')
    try:
        return name, cli.non_negative(value) if has_tolerance else None
    except (ValueError, argparse.ArgumentTypeError) as error:
        raise ValueError(f'--fields {text}: {error}; give FIELD or FIELD=TOLERANCE') from None


def run_recover(arguments: argparse.Namespace) -> int:
    """Recover."""
    from seal_friction_ros.offline.bags.recover import recover

    found = recover(arguments.bag, arguments.out)
    return cli.print_result(arguments, found, found.summary())


def run_report(arguments: argparse.Namespace) -> int:
    """Write the page."""
    from seal_friction_ros.offline.reports.bag_report import write_report

    summary = write_report(arguments.bag, arguments.out, arguments.namespace, cli.mapping_of(arguments))
    return cli.print_result(arguments, summary, f'{summary.numbers["level"]}: {summary.numbers["verdict"]}')
