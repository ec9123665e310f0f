"""``seal_friction compare``: compare a topic of two bags."""

import argparse
from pathlib import Path
from typing import Any

from seal_friction_ros.offline.commands import command_line as cli


def add_parser(commands: Any) -> None:
    """Add the command."""
    parser = cli.add_command(
        commands, 'compare', run, 'compare a topic of two bags, or two runs or seals on a page',
        'compare recorded replayed --rtol 0.05',
        'compare before after --out change.html',
        'compare ms28775_114 my_seal.yaml --out seals.html',
    )  # fmt: skip
    parser.add_argument('a', type=Path, metavar='A', help='first bag, the reference; with --out also a seal')
    parser.add_argument('b', type=Path, metavar='B', help='second bag or seal')
    parser.add_argument('--topic', default='', help='default: the friction estimates of each bag')
    parser.add_argument('--atol', type=cli.non_negative, default=0.0, help='absolute tolerance, default 0')
    parser.add_argument('--rtol', type=cli.non_negative, default=0.0, help='relative tolerance, default 0')
    cli.add_namespace(parser)
    cli.add_mapping(parser)
    cli.add_page(parser, required=False)


def run(arguments: argparse.Namespace) -> int:
    """Compare messages of equal stamp, or with a page the friction of two runs or seals."""
    mapping = cli.mapping_of(arguments)
    if arguments.out:
        from seal_friction_ros.offline.reports.comparison_report import write_comparison

        for option in ('topic', 'atol', 'rtol'):
            if getattr(arguments, option):
                raise ValueError(f'--{option} is for messages of equal stamp: leave it out, or leave out --out')
        report = write_comparison(arguments.a, arguments.b, arguments.out, arguments.namespace, mapping)
        return cli.print_result(arguments, report, report.numbers['verdict'])
    from seal_friction_ros.offline.replay.compare import compare

    found = compare(
        arguments.a, arguments.b, arguments.topic, arguments.atol, arguments.rtol,
        namespace=arguments.namespace, mapping=mapping,
    )  # fmt: skip
    return cli.print_result(arguments, found.numbers(), found.summary(), cli.SUCCESS if found.agree else cli.DIFFERENT)
