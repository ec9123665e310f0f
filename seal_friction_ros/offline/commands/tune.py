"""``seal_friction tune``: tune the friction feed-forward; ``seal_friction servo``: a simulated servo."""

import argparse
from pathlib import Path
from typing import Any

from seal_friction_ros.core.foundation.parameters import Meaning, meanings
from seal_friction_ros.core.tuning.settings import RecordedAxisSettings, TuningSettings
from seal_friction_ros.offline.commands import command_line as cli
from seal_friction_ros.offline.work.targets import PARAMETER_FILE


def add_parser(commands: Any) -> None:
    """Add the commands."""
    parser = cli.add_command(
        commands, 'tune', run, 'tune the friction feed-forward on a simulated servo or on a recorded axis',
        'tune --out feedforward.yaml',
        'tune --bag BAG --out feedforward.yaml',
        needs=('numba',),
    )  # fmt: skip
    simulated = parser.add_argument_group('on the simulated servo, without --bag')
    recorded = parser.add_argument_group('on a recorded axis')
    both = (TuningSettings, RecordedAxisSettings)
    groups: Any = {(TuningSettings,): simulated, (RecordedAxisSettings,): recorded, both: parser}
    recorded.add_argument('--bag', type=Path, help='tune on this bag of a real axis instead of the simulated servo')
    help_text = 'tune on this simulated machine: parameter file of servo_simulator'
    simulated.add_argument('--machine', type=Path, metavar='FILE.yaml', help=help_text)
    help_text = 'topic of the command that the controller took; prints the gain from force to this command'
    recorded.add_argument('--command-topic', metavar='TOPIC', help=help_text)
    help_text = 'parameter file to write; a report goes beside it'
    cli.add_target(parser, '--out', PARAMETER_FILE, required=True, metavar='FILE.yaml', help=help_text)
    cli.add_configuration(parser)
    cli.add_actuator(recorded)
    help_text = 'write the parameters of this actuator of machine_estimator; default: that of the bag, if it has any'
    parser.add_argument('--actuator', default='', metavar='NAME', help=help_text)
    for name, meaning in _settings().items():
        kinds = tuple(kind for kind in both if name in meanings(kind))
        default = f'{getattr(kinds[0], name):g} {meaning.unit.removeprefix("1")}'.strip()
        text = f'{meaning.description} Default: {default}.'.replace('%', '%%')
        number = int if name == 'seed' else float
        groups[kinds].add_argument(f'--{name.replace("_", "-")}', type=number, metavar='X', help=text)
    description = 'write a page on a simulated servo with and without friction'
    cli.add_page(cli.add_command(commands, 'servo', run_servo, description, 'servo --out servo.html', needs=('numba',)))


def _settings() -> dict[str, Meaning]:
    """Settings of both kinds of tuning by name."""
    return meanings(TuningSettings) | meanings(RecordedAxisSettings)


def run(arguments: argparse.Namespace) -> int:
    """Tune on the simulated servo or on a bag."""
    from seal_friction_ros import api
    from seal_friction_ros.offline.bags.actuator_bag import open_actuator
    from seal_friction_ros.offline.reports.tune_report import write_tuning_page
    from seal_friction_ros.offline.tuning import tune

    settings, gain = (RecordedAxisSettings if arguments.bag else TuningSettings)(**_given(arguments)), None
    if isinstance(settings, RecordedAxisSettings) and arguments.command_topic:
        axis = open_actuator(arguments.bag, arguments.namespace, cli.mapping_of(arguments))
        gain = tune.read_output_gain(axis, arguments.command_topic, settings)
    tuning = api.tune(
        arguments.bag, settings=settings, seals=arguments.seal or (), params=arguments.params,
        namespace=arguments.namespace, mapping=arguments.mapping, machine=arguments.machine,
    )  # fmt: skip
    page = arguments.out.with_suffix('.html')
    numbers = {**tuning.numbers, 'file': arguments.out, 'page': page, 'figures': write_tuning_page(tuning, page)}
    tune.write_parameters(arguments.out, tuning, arguments.actuator or tuning.actuator)
    text = tune.told(tuning)
    if gain is not None:
        numbers['output_gain'], numbers['output_gain_standard_error'] = gain.gain, gain.standard_error
        text += (
            f'\noutput_gain: {gain.gain:.4g} +- {gain.standard_error:.2g} in units of {arguments.command_topic} per N. '
            f'In the mapping file, under output:\ngain: {gain.gain:.4g}'
        )
    code = cli.SUCCESS if tuning.found.better_in_every_case else cli.DIFFERENT
    return cli.print_result(arguments, numbers, text, code)


def _given(arguments: argparse.Namespace) -> dict[str, Any]:
    """Settings that were given; ValueError if one of them belongs to the other kind of tuning."""
    kind, other = (RecordedAxisSettings, TuningSettings) if arguments.bag else (TuningSettings, RecordedAxisSettings)
    given = {name: value for name in _settings() if (value := getattr(arguments, name)) is not None}
    foreign = [name for name in given if name in meanings(other) and name not in meanings(kind)]
    others = ('machine',) if arguments.bag else ('namespace', 'mapping', 'command_topic')
    foreign += [name for name in others if getattr(arguments, name)]
    if foreign:
        name = foreign[0].replace('_', '-')
        raise ValueError(f'--{name} is {"not for" if arguments.bag else "only for"} a --bag')
    return given


def run_servo(arguments: argparse.Namespace) -> int:
    """Simulate and write the page."""
    from seal_friction_ros.offline.reports.servo_charts import write_servo_charts

    return cli.print_result(arguments, write_servo_charts(arguments.out).flat, '')
