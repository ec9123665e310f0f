"""``seal_friction import``: make a bag from measurements."""

import argparse
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from seal_friction_ros.core.foundation.units import MM
from seal_friction_ros.offline.commands import command_line as cli
from seal_friction_ros.offline.work.targets import BAG

if TYPE_CHECKING:
    from seal_friction_ros.offline.bags.import_bag import ActuatorImport
    from seal_friction_ros.offline.bags.import_log import ImportSummary
    from seal_friction_ros.offline.work.places import Place


def add_parser(commands: Any) -> None:
    """Add the command."""
    description = 'make a bag from measurements'
    examples = ('import log ram.csv --rig my_rig.yaml --out ram', 'import bag RUN --mapping robot.yaml --out run')
    sources = cli.add_group(commands, 'import', 'SOURCE', description, *examples)
    log = cli.add_command(
        sources, 'log', run_log, 'make a bag from a measured log, CSV or white space',
        'import log ram.csv --rig my_rig.yaml --out ram',
        'import log monday.csv tuesday.csv --rig my_rig.yaml --out bags --work build/import',
    )  # fmt: skip
    log.add_argument('logs', type=cli.place, nargs='+', metavar='LOG', help='log file, or URL of fsspec')
    cli.add_file(log, '--rig', 'rigs', 'rig file', required=True)
    description = 'make a bag of each actuator from any rosbag with standard messages'
    bag = cli.add_command(sources, 'bag', run_bag, description, examples[1])
    help_text = 'rosbag2 bag, MCAP or SQLite, or URL of fsspec'
    bag.add_argument('bags', type=cli.place, nargs='+', metavar='RUN', help=help_text)
    cli.add_file(bag, '--mapping', 'machines', 'mapping file', required=True)
    help_text = 'topic to copy as it is, for example the command of a controller; repeat it for more'
    bag.add_argument('--also', action='append', default=[], metavar='TOPIC', help=help_text)
    description = 'make a bag from the pull test of the thesis, Tables A-1 to A-3'
    thesis = cli.add_command(sources, 'thesis', run_thesis, description, 'import thesis --out pull_test')
    cli.add_target(thesis, '--out', BAG, required=True, metavar='BAG', help='bag to make')
    for source, what in ((log, 'logs'), (bag, 'bags')):
        help_text = f'bag to make; for several {what} the folder of the bags, one named after each'
        cli.add_target(source, '--out', BAG, required=True, metavar='BAG', help=help_text)
        cli.add_workers(source, what)
        cli.add_shared(source, '--work', '--retry-failed')


def run_log(arguments: argparse.Namespace) -> int:
    """Import a log, or several in parallel."""
    from seal_friction_ros.files import config_path
    from seal_friction_ros.offline.bags.import_log import convert_log
    from seal_friction_ros.offline.bags.rig_file import read_rig

    rig = read_rig(config_path('rigs', arguments.rig))
    return _run(arguments, arguments.logs, partial(convert_log, rig=rig), _of_log, [rig])


def run_bag(arguments: argparse.Namespace) -> int:
    """Import a bag with standard messages, or several in parallel."""
    from seal_friction_ros.offline.bags.import_bag import convert_bag
    from seal_friction_ros.offline.bags.mapped_bag import read_mapping

    mapping = read_mapping(arguments.mapping)
    convert = partial(convert_bag, mapping=mapping, also=arguments.also)
    return _run(arguments, arguments.bags, convert, _of_bag, [mapping, arguments.also])


def _of_log(summary: 'ImportSummary', _: Path) -> tuple[dict[str, Any], str]:
    dropped = [f'{count} rows left out: {reason}' for reason, count in summary.dropped.items()]
    return summary._asdict(), '\n  '.join([f'{summary.rows} rows', *dropped, *summary.remarks])


def _of_bag(found: 'dict[str, ActuatorImport]', out: Path) -> tuple[dict[str, Any], str]:
    """Numbers and text for a bag that was imported to ``out``."""
    numbers, lines = {}, []
    for name, one in found.items():
        bag = out / name if len(found) > 1 else out
        *fields, samples = one._replace(bag=bag)
        numbers[name] = dict(zip(one._fields, fields, strict=False)) | samples.numbers
        counts = ', '.join(f'{count} {topic.lstrip("/")}' for topic, count in sorted(one.messages.items()))
        lines += [f'{bag}: {name}: {counts}', f'  {one.samples.text}']
        lines += [] if one.tracking_rms is None else [f'  tracking error {one.tracking_rms / MM:.3g} mm RMS']
        lines += [f'  {remark}' for remark in one.remarks]
    return numbers, '\n'.join(lines)


def _run(
    arguments: argparse.Namespace,
    sources: 'list[Place]',
    convert: Callable[[Path, Path], Any],
    told: Callable[[Any, Path], tuple[dict[str, Any], str]],
    settings: list[Any],
) -> int:
    """Import one source, or several: a bag for each, and one line for each that cannot be imported."""
    from seal_friction_ros.offline.bags.import_many import bag_names, import_many
    from seal_friction_ros.offline.work.places import as_path

    out, kept = arguments.out, cli.kept_in(arguments)
    if len(sources) == 1 and not arguments.scheduler and not arguments.work:
        with as_path(sources[0]) as path:
            return cli.print_result(arguments, *told(convert(path, out), out))
    targets = [out / name for name in bag_names(sources)] if len(sources) > 1 else [out]
    shown = {target.name: target for target in targets}

    def convert_and_tell(source: Path, bag: Path) -> tuple[dict[str, Any], str]:
        """Convert a source; what is said names the bag as it will be called."""
        return told(convert(source, bag), shown[bag.name])

    outcomes = import_many(convert_and_tell, sources, out, cli.workers_of(arguments), kept, [*settings, str(out)])
    found: list[dict[str, Any]] = []
    lines, errors = [], []
    for source, target, (result, error) in zip(sources, targets, outcomes, strict=True):
        if error or result is None:
            found.append({'source': source, 'error': error})
            errors.append(error)
        else:
            found.append({'source': source, 'out': target, 'imported': result['numbers']})
            lines.append(f'{source}: {result["text"]}')
    code = cli.UNUSABLE if errors else cli.SUCCESS
    return cli.print_result(arguments, {'sources': found}, '\n'.join(lines), code, errors)


def run_thesis(arguments: argparse.Namespace) -> int:
    """Import the pull test of the thesis."""
    from seal_friction_ros.offline.bags.import_thesis import import_thesis

    summary = import_thesis(arguments.out)
    return cli.print_result(arguments, summary, f'{summary.rows} rows')
