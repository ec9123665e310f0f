"""``seal_friction export``: the estimator inside another program."""

import argparse
from pathlib import Path
from typing import Any

from seal_friction_ros.offline.commands import command_line as cli
from seal_friction_ros.offline.work.targets import C_LIBRARY, FMU


def add_parser(commands: Any) -> None:
    """Add the command."""
    description = 'write the estimator as a C library for a control loop, or as an FMU for a simulation'
    kinds = cli.add_group(commands, 'export', 'KIND', description, 'export c rod@a piston@difference --out friction_c')
    library = cli.add_command(
        kinds, 'c', run_c, 'write C sources, libraries, a Makefile and examples into a folder',
        'export c ms28775_114@a ms28775_114@b --out friction_c',
        'export c --params config/friction_estimator.yaml --bag bags/pull_test --out friction_c',
    )  # fmt: skip
    _add_configuration(library)
    text = 'of the library, and before each name in it'
    library.add_argument('--name', default='seal_friction', metavar='NAME', help=text)
    library.add_argument('--bag', type=Path, metavar='BAG', help='its inputs become the samples of the examples')
    cli.add_target(library, '--out', C_LIBRARY, required=True, metavar='FOLDER', help='folder to write')

    fmu = cli.add_command(
        kinds, 'fmu', run_fmu, 'write an FMU: the estimator with feed-forward, or the friction of the seals of a plant',
        'export fmu ms28775_114@a ms28775_114@b --model friction --out friction.fmu',
        'export fmu --params config/friction_estimator.yaml --fmi 2 --out estimator.fmu',
    )  # fmt: skip
    _add_configuration(fmu)
    text = 'estimator (default), or friction: velocity and pressures to force'
    fmu.add_argument('--model', choices=('estimator', 'friction'), default='estimator', help=text)
    fmu.add_argument('--fmi', choices=('2', '3'), default='3', help='version of FMI, default: 3')
    cli.add_target(fmu, '--out', FMU, required=True, metavar='FILE.fmu', help='FMU to write')


def _add_configuration(parser: argparse.ArgumentParser) -> None:
    text = 'seal file of every seal: NAME, or NAME@CHAMBER for each'
    parser.add_argument('seals', nargs='*', metavar='SEAL', help=text)
    parser.add_argument('--params', type=Path, metavar='FILE', help='ROS parameter file of the estimator')


def _configuration(arguments: argparse.Namespace) -> Any:
    from seal_friction_ros.offline.replay.replay import chosen_configuration

    chosen = chosen_configuration(arguments.params, arguments.seals)
    if chosen is None:
        raise ValueError('export: no seals: name their seal files, or a parameter file with the parameter seals')
    return chosen.without_placeholder_force()


def run_c(arguments: argparse.Namespace) -> int:
    """Write the library."""
    from seal_friction_ros.offline.export.c_library import export_c, samples_of

    samples = samples_of(arguments.bag) if arguments.bag else ''
    made = export_c(_configuration(arguments), arguments.out, arguments.name, samples)
    return cli.print_result(arguments, made, made.summary())


def run_fmu(arguments: argparse.Namespace) -> int:
    """Write the FMU."""
    from seal_friction_ros.offline.export.fmu import export_fmu

    made = export_fmu(_configuration(arguments), arguments.out, arguments.model, arguments.fmi)
    return cli.print_result(arguments, made, made.summary())
