"""``seal_friction health``: how the seals are doing, over bags in order of time."""

import argparse
import math
from typing import Any

from seal_friction_ros.offline.commands import command_line as cli


def add_parser(commands: Any) -> None:
    """Add the command."""
    parser = cli.add_command(
        commands, 'health', run, 'show how friction, offset and starts of the seals change over bags',
        'health monday tuesday wednesday --out health.html',
    )  # fmt: skip
    parser.add_argument('bags', type=cli.place, nargs='+', metavar='BAG', help='path, or URL of fsspec')
    cli.add_configuration(parser)
    cli.add_namespace(parser)
    cli.add_mapping(parser)
    cli.add_page(parser, required=False)
    cli.add_workers(parser, 'bags')
    cli.add_work(parser)
    parser.add_argument('--scale-low', type=cli.non_negative, default=0.6, help='alarm below this scale (0.6)')
    parser.add_argument('--scale-high', type=cli.non_negative, default=1.5, help='alarm above this scale (1.5)')
    parser.add_argument('--breakaway', type=cli.non_negative, default=2.5, help='alarm above this start (2.5)')
    parser.add_argument('--noise', type=cli.non_negative, default=0.3, help='alarm above this share of residual (0.3)')


def run(arguments: argparse.Namespace) -> int:
    """Follow the bags in order of time."""
    from seal_friction_ros.offline.replay.bag_health import health_of_bags
    from seal_friction_ros.offline.replay.health_indicators import Limits
    from seal_friction_ros.offline.replay.replay import chosen_configuration
    from seal_friction_ros.offline.reports.health_report import write_health_report

    override = chosen_configuration(arguments.params, arguments.seal)
    workers, kept = cli.workers_of(arguments), cli.kept_in(arguments)
    outcomes = health_of_bags(arguments.bags, arguments.namespace, override, workers, kept, cli.mapping_of(arguments))
    errors = [outcome.error for outcome in outcomes if outcome.error]
    seen = [(outcome.result, bag) for outcome, bag in zip(outcomes, arguments.bags, strict=True) if outcome.result]
    seen.sort(key=lambda pair: pair[0].time[0] if len(pair[0].time) else 0.0)
    limits = Limits(arguments.scale_low, arguments.scale_high, arguments.breakaway, arguments.noise)
    if not seen:
        return cli.print_result(arguments, {'bags': [], 'errors': errors}, '', cli.UNUSABLE, errors)
    names = [str(bag) for _, bag in seen]
    summary = write_health_report(names, [one for one, _ in seen], arguments.out, limits)
    lines = []
    for day in summary.numbers['bags']:
        lines.append(
            f'{day["bag"]}: no reversal to learn from'
            if not day['reversals']
            else f'{day["bag"]}: scale {day["scale"]:.3f} +- {day["scale_std"]:.3f}, {_offset_text(day["offset"])}, '
            f'{day["reversals"]} reversals'
        )
        lines += [f'  alarm: {alarm}' for alarm in day['alarms']]
    lines += [
        f'change: from {change["scale_before"]:.3f} to {change["scale_then"]:.3f} at {change["time_s"]:.3f} s'
        for change in summary.numbers['changes']
    ]
    code = cli.UNUSABLE if errors else cli.SUCCESS
    return cli.print_result(arguments, {**summary.numbers, 'errors': errors}, '\n'.join(lines), code, errors)


def _offset_text(offset: float) -> str:
    """Offset of the force sum [N]; without a force sum there is none."""
    return f'offset {offset:.4g} N' if math.isfinite(offset) else 'offset not told'
