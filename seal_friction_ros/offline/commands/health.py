"""Commands on the seals over many bags: ``seal_friction`` ``health``, ``fleet``, ``adapt``."""

import argparse
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from seal_friction_ros.offline.commands import command_line as cli
from seal_friction_ros.offline.work.targets import SEAL_FILE, TABLE

if TYPE_CHECKING:
    from seal_friction_ros.offline.replay.bag_parts import Chosen


def add_parser(commands: Any) -> None:
    """Add the commands."""
    description = 'show how friction, offset and starts of the seals change over bags'
    example = 'health monday tuesday wednesday --out health.html'
    health = cli.add_command(commands, 'health', run_health, description, example)
    description = 'show over many bags which seal drifts, which rig disagrees and which recording is damaged'
    example = 'fleet bags.txt --out fleet.html --parquet fleet.parquet --work build/fleet --scheduler tcp://HOST:8786'
    fleet = cli.add_command(commands, 'fleet', run_fleet, description, 'fleet bags --out fleet.html', example)
    description = 'learn the friction of today from bags and save it as a seal file'
    example = 'adapt today --seal my_seal.yaml --out my_seal_today.yaml'
    adapt = cli.add_command(commands, 'adapt', run_adapt, description, example)
    cli.add_shared(health, 'bags')
    help_text = 'folder with bags below it, or text file with the path or URL of a bag in each line'
    fleet.add_argument('where', type=Path, metavar='DIR|LIST', help=help_text)
    help_text = 'table with a row for each bag and pressure level'
    cli.add_target(fleet, '--parquet', TABLE, metavar='FILE.parquet', help=help_text)
    for parser in (health, fleet):
        cli.add_configuration(parser)
        cli.add_actuator(parser)
        cli.add_page(parser, required=parser is fleet)
        cli.add_workers(parser, 'bags')
        cli.add_shared(parser, '--work', '--retry-failed')
    cli.add_options(health, _LIMITS)
    adapt.add_argument('bags', type=Path, nargs='+', metavar='BAG')
    cli.add_file(adapt, '--seal', 'seals', 'seal file to begin with', required=True, metavar='SEAL')
    cli.add_shared(adapt, '--namespace')
    cli.add_target(adapt, '--out', SEAL_FILE, metavar='FILE', required=True, help='seal file to write')


_LIMITS: dict[str, tuple[str, cli.Settings]] = {
    '--scale-low': ('alarm below this scale (0.6)', {'type': cli.non_negative, 'default': 0.6}),
    '--scale-high': ('alarm above this scale (1.5)', {'type': cli.non_negative, 'default': 1.5}),
    '--breakaway': ('alarm above this start over the friction (2.5)', {'type': cli.non_negative, 'default': 2.5}),
    '--noise': ('alarm above this residual over the friction (0.3)', {'type': cli.non_negative, 'default': 0.3}),
}


def _chosen(arguments: argparse.Namespace, **more: Any) -> 'Chosen':
    from seal_friction_ros.offline.replay.bag_parts import Chosen
    from seal_friction_ros.offline.replay.replay import chosen_configuration

    override = chosen_configuration(arguments.params, arguments.seal)
    return Chosen(arguments.namespace, cli.mapping_of(arguments), override, **more)


def run_health(arguments: argparse.Namespace) -> int:
    """Follow the bags in order of time."""
    from seal_friction_ros.core.estimation.findings import Limits
    from seal_friction_ros.core.identification.admission import Account
    from seal_friction_ros.offline.replay.bag_health import health_of_bags
    from seal_friction_ros.offline.reports.health_report import write_health_report

    limits = Limits(arguments.scale_low, arguments.scale_high, arguments.breakaway, arguments.noise)
    chosen = _chosen(arguments, limits=limits)
    outcomes = health_of_bags(arguments.bags, chosen, cli.workers_of(arguments), cli.kept_in(arguments))
    errors = [outcome.error for outcome in outcomes if outcome.error]
    seen = [(outcome.result, bag) for outcome, bag in zip(outcomes, arguments.bags, strict=True) if outcome.result]
    seen.sort(key=lambda pair: pair[0].time[0] if len(pair[0].time) else 0.0)
    if not seen:
        return cli.print_result(arguments, {'bags': [], 'errors': errors}, '', cli.UNUSABLE, errors)
    names = [str(bag) for _, bag in seen]
    summary = write_health_report(names, [one for one, _ in seen], arguments.out, limits)
    lines = [f'{summary.numbers["level"]}: {summary.numbers["verdict"]}']
    for day, (one, _) in zip(summary.numbers['bags'], seen, strict=True):
        samples = Account(day['bag'], one.used, one.left_out)
        day.update(samples.numbers)
        lines.append(f'{day["bag"]}: {_learnt_text(day) if day["reversals"] else "no reversal to learn from"}')
        lines += [f'  {day["level"]}: {day["why"]}', *(f'  alarm: {alarm}' for alarm in day['alarms'])]
        lines += [f'  {samples.text}', *(f'  warning: {text}' for text in samples.warnings)]
    lines += [
        f'change: from {change["scale_before"]:.3f} to {change["scale_then"]:.3f} at {change["time_s"]:.3f} s'
        for change in summary.numbers['changes']
    ]
    code = cli.UNUSABLE if errors else cli.SUCCESS
    return cli.print_result(arguments, {**summary.numbers, 'errors': errors}, '\n'.join(lines), code, errors)


def _learnt_text(day: dict[str, Any]) -> str:
    """What was learnt from a bag; without a force sum there is no offset."""
    offset = f'offset {day["offset"]:.4g} N' if math.isfinite(day['offset']) else 'offset not told'
    return f'scale {day["scale"]:.3f} +- {day["scale_std"]:.3f}, {offset}, {day["reversals"]} reversals'


def run_fleet(arguments: argparse.Namespace) -> int:
    """Summarise every bag; write page and table."""
    from seal_friction_ros.core.estimation.findings import GOOD
    from seal_friction_ros.offline.replay.bag_summary import DIFFERENT, summaries
    from seal_friction_ros.offline.reports.fleet_report import judged, rigs_of, write_fleet_report, write_fleet_table
    from seal_friction_ros.offline.work.places import find_bags
    from seal_friction_ros.packages import needed

    if arguments.parquet:
        needed('pyarrow')
    chosen, paths = _chosen(arguments), find_bags(arguments.where)
    outcomes = summaries(paths, chosen, cli.workers_of(arguments), cli.kept_in(arguments))
    bags = [judged(path, outcome) for path, outcome in zip(paths, outcomes, strict=True)]
    report = write_fleet_report(bags, arguments.where, arguments.out)
    if arguments.parquet:
        write_fleet_table(bags, arguments.parquet)
    counts = report.numbers['counts']
    lines = [f'{len(bags)} bags: {", ".join(f"{count} {level}" for level, count in counts.items())}']
    lines += [f'{rig.name}: {rig.level}: {rig.why}' for rig in rigs_of(bags) if rig.level != GOOD]
    lines += [f'{bag.path}: {bag.level}: {bag.why}' for bag in bags if bag.summary is not None and bag.level != GOOD]
    damaged = [outcome.error for outcome in outcomes if outcome.error]
    is_different = any(bag.summary is not None and bag.summary.replay == DIFFERENT for bag in bags)
    code = cli.UNUSABLE if damaged else cli.DIFFERENT if is_different else cli.SUCCESS
    return cli.print_result(arguments, report.numbers, '\n'.join(lines), code, damaged)


def run_adapt(arguments: argparse.Namespace) -> int:
    """Learn from the bags in the order given."""
    from seal_friction_ros.offline.replay.bag_health import write_adapted_seal

    numbers = write_adapted_seal(arguments.bags, arguments.seal, arguments.out, arguments.namespace)
    summary = (
        f'scale {numbers["scale"]:.4f} +- {numbers["scale_std"]:.4f} after {numbers["reversals"]} reversals; '
        f'friction_scale {numbers["friction_scale"]:.4f}'
    )
    return cli.print_result(arguments, numbers, summary)
