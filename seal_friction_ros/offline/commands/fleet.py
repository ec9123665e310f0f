"""``seal_friction fleet``: one page over many bags."""

import argparse
from pathlib import Path
from typing import Any

from seal_friction_ros.offline.commands import command_line as cli
from seal_friction_ros.offline.work.targets import TABLE


def add_parser(commands: Any) -> None:
    """Add the command."""
    parser = cli.add_command(
        commands, 'fleet', run, 'show which seal drifts, which rig disagrees, which recording is damaged, of many bags',
        'fleet bags --out fleet.html',
        'fleet bags.txt --out fleet.html --parquet fleet.parquet --work build/fleet --scheduler tcp://HOST:8786',
    )  # fmt: skip
    help_text = 'folder with bags below it, or text file with the path or URL of a bag in each line'
    parser.add_argument('where', type=Path, metavar='DIR|LIST', help=help_text)
    cli.add_page(parser)
    help_text = 'table with a row for each bag and pressure level'
    cli.add_target(parser, '--parquet', TABLE, metavar='FILE.parquet', help=help_text)
    cli.add_configuration(parser)
    cli.add_namespace(parser)
    cli.add_mapping(parser)
    cli.add_workers(parser, 'bags')
    cli.add_work(parser)


def run(arguments: argparse.Namespace) -> int:
    """Summarise every bag; write page and table."""
    from seal_friction_ros.offline.bags.find_bags import find_bags
    from seal_friction_ros.offline.replay.bag_parts import Chosen
    from seal_friction_ros.offline.replay.bag_summary import DIFFERENT, summaries
    from seal_friction_ros.offline.replay.replay import chosen_configuration
    from seal_friction_ros.offline.reports.fleet_report import judged, write_fleet_report
    from seal_friction_ros.offline.reports.fleet_table import write_fleet_table
    from seal_friction_ros.packages import needed

    if arguments.parquet:
        needed('pyarrow')
    override = chosen_configuration(arguments.params, arguments.seal)
    chosen = Chosen(arguments.namespace, cli.mapping_of(arguments), override)
    workers, kept = cli.workers_of(arguments), cli.kept_in(arguments)
    paths = find_bags(arguments.where)
    outcomes = summaries(paths, chosen, workers, kept)
    bags = [judged(path, outcome) for path, outcome in zip(paths, outcomes, strict=True)]
    report = write_fleet_report(bags, arguments.where, arguments.out)
    if arguments.parquet:
        write_fleet_table(bags, arguments.parquet)
    counts = report.numbers['counts']
    lines = [f'{len(bags)} bags: {", ".join(f"{count} {level}" for level, count in counts.items())}']
    lines += [f'{bag.path}: {bag.level}: {bag.why}' for bag in bags if bag.summary is not None and bag.why]
    damaged = [outcome.error for outcome in outcomes if outcome.error]
    is_different = any(bag.summary is not None and bag.summary.replay == DIFFERENT for bag in bags)
    code = cli.UNUSABLE if damaged else cli.DIFFERENT if is_different else cli.SUCCESS
    return cli.print_result(arguments, report.numbers, '\n'.join(lines), code, damaged)
