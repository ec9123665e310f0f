"""``seal_friction sheet``: make an empty data sheet of the friction test plan."""

import argparse
from typing import Any

from seal_friction_ros.offline.commands import command_line as cli
from seal_friction_ros.offline.work.targets import DATA_SHEET


def add_parser(commands: Any) -> None:
    """Add the command."""
    parser = cli.add_command(
        commands, 'sheet', run, 'make an empty data sheet of the friction test plan: CSV, and a page to print',
        'sheet rod_seal --seal ms28775_114 --out sheet.csv',
    )  # fmt: skip
    parser.add_argument('name', help='name of the seal')
    cli.add_target(
        parser, '--out', DATA_SHEET, required=True, metavar='SHEET.csv', help='sheet to write; a page goes beside it'
    )
    parser.add_argument(
        '--pressures', type=_pressures, default=(0.0, 70.0, 10), metavar='LOW:HIGH:STEPS', help='default 0:70:10'
    )
    parser.add_argument('--tests', type=int, default=3, help='default 3')
    parser.add_argument('--seals', type=int, default=2, help='seals that share the pressure, default 2')
    cli.add_file(parser, '--seal', 'seals', 'seal file whose geometry is filled in')
    parser.add_argument('--pressure-unit', choices=('bar', 'MPa', 'kPa', 'psi'), default='bar', help='default bar')
    parser.add_argument('--force-unit', choices=('N', 'kN', 'lbf'), default='N', help='default N')
    parser.add_argument('--length-unit', choices=('mm', 'in'), default='mm', help='default mm')


def _pressures(text: str) -> tuple[float, float, int]:
    try:
        low, high, steps = text.split(':')
        return float(low), float(high), int(steps)
    except ValueError:
        raise argparse.ArgumentTypeError(f'{text} is not LOW:HIGH:STEPS, for example 0:70:10') from None


def run(arguments: argparse.Namespace) -> int:
    """Write the sheet."""
    from seal_friction_ros.offline.identification.data_sheet import (
        FrictionTestPlan,
        geometry_of_seal_file,
        write_sheet,
    )
    from seal_friction_ros.offline.reports.data_sheet_page import write_data_sheet_page

    low, high, steps = arguments.pressures
    plan = FrictionTestPlan(
        arguments.name,
        low,
        high,
        steps,
        tests=arguments.tests,
        seals=arguments.seals,
        pressure_unit=arguments.pressure_unit,
        force_unit=arguments.force_unit,
        length_unit=arguments.length_unit,
        geometry=geometry_of_seal_file(arguments.seal)[0] if arguments.seal else None,
    )
    sheet, page = arguments.out, arguments.out.with_suffix('.html')
    write_sheet(plan, sheet)
    write_data_sheet_page(plan, page)
    return cli.print_result(arguments, {'sheet': sheet, 'page': page}, '')
