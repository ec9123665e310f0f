"""``seal_friction import``: make a bag from measurements."""

import argparse
from pathlib import Path
from typing import Any

from seal_friction_ros.core.foundation.units import MM
from seal_friction_ros.offline.commands import command_line as cli
from seal_friction_ros.offline.work.targets import BAG


def add_parser(commands: Any) -> None:
    """Add the command."""
    description = 'make a bag from measurements'
    examples = ('import log ram.csv --rig my_rig.yaml --out ram', 'import bag RUN --mapping robot.yaml --out run')
    sources = cli.add_group(commands, 'import', 'SOURCE', description, *examples)
    log = cli.add_command(
        sources, 'log', run_log, 'make a bag from a measured log, CSV or white space',
        'import log ram.csv --rig my_rig.yaml --out ram',
    )  # fmt: skip
    log.add_argument('log', type=Path, help='log file')
    cli.add_file(log, '--rig', 'rigs', 'rig file', required=True)
    bag = cli.add_command(
        sources, 'bag', run_bag, 'make a bag of each actuator from any rosbag with standard messages',
        'import bag RUN --mapping robot.yaml --out run',
    )  # fmt: skip
    bag.add_argument('bag', type=Path, help='rosbag2 bag, MCAP or SQLite')
    cli.add_file(bag, '--mapping', 'machines', 'mapping file', required=True)
    help_text = 'topic to copy as it is, for example the command of a controller; repeat it for more'
    bag.add_argument('--also', action='append', default=[], metavar='TOPIC', help=help_text)
    thesis = cli.add_command(
        sources, 'thesis', run_thesis, 'make a bag from the pull test of the thesis, Tables A-1 to A-3',
        'import thesis --out pull_test',
    )  # fmt: skip
    for source in (log, bag, thesis):
        cli.add_target(source, '--out', BAG, required=True, metavar='BAG', help='bag to make')


def run_log(arguments: argparse.Namespace) -> int:
    """Import a log."""
    from seal_friction_ros.files import config_path
    from seal_friction_ros.offline.bags.import_log import import_log

    summary = import_log(arguments.log, config_path('rigs', arguments.rig), arguments.out)
    return cli.print_result(arguments, summary, f'{summary.rows} rows')


def run_bag(arguments: argparse.Namespace) -> int:
    """Import a bag with standard messages."""
    from seal_friction_ros.offline.bags.import_bag import import_bag

    found = import_bag(arguments.bag, arguments.mapping, arguments.out, arguments.also)
    lines = []
    for name, one in found.items():
        counts = ', '.join(f'{count} {topic.lstrip("/")}' for topic, count in sorted(one.messages.items()))
        lines += [f'{one.bag}: {name}: {counts}']
        lines += [] if one.tracking_rms is None else [f'  tracking error {one.tracking_rms / MM:.3g} mm RMS']
        lines += [f'  {remark}' for remark in one.remarks]
    return cli.print_result(arguments, {name: one._asdict() for name, one in found.items()}, '\n'.join(lines))


def run_thesis(arguments: argparse.Namespace) -> int:
    """Import the pull test of the thesis."""
    from seal_friction_ros.offline.bags.import_thesis import import_thesis

    summary = import_thesis(arguments.out)
    return cli.print_result(arguments, summary, f'{summary.rows} rows')
