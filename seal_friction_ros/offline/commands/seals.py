"""Commands on seal files and data sheets: ``seal_friction`` ``sheet``, ``seals``, ``charts``, ``force``."""

import argparse
from pathlib import Path
from typing import Any

from seal_friction_ros.offline.commands import command_line as cli
from seal_friction_ros.offline.work.targets import DATA_SHEET


def add_parser(commands: Any) -> None:
    """Add the commands."""
    text = 'make an empty data sheet of the friction test plan: CSV, and a page to print'
    example = 'sheet rod_seal --seal ms28775_114 --out sheet.csv'
    sheet = cli.add_command(commands, 'sheet', run_sheet, text, example)
    text = 'list the seal files with law, range and source'
    seals = cli.add_command(commands, 'seals', run_seals, text, *_SEALS)
    text, example = 'write a page with the curves of a seal file', 'charts ms28775_114 --out ms28775_114.html'
    charts = cli.add_command(commands, 'charts', run_charts, text, example)
    text = 'friction and breakaway of a seal file, or of an O-ring from its geometry'
    examples = (
        'force ms28775_114 --pressure 35bar 69bar --seals 2',
        'force ./my_ring.yaml --pressure 3.5e6 --speed 10mm/s',
    )
    force = cli.add_command(commands, 'force', run_force, text, *examples)
    cli.add_file(force, 'seal', 'seals', 'seal file, or case of an O-ring', metavar='SEAL')
    cli.add_options(force, _OF_FORCE)
    text = 'sheet to write; a page goes beside it'
    cli.add_target(sheet, '--out', DATA_SHEET, required=True, metavar='SHEET.csv', help=text)
    cli.add_file(sheet, '--seal', 'seals', 'seal file whose geometry is filled in')
    cli.add_options(sheet, _OF_SHEET)
    seals.add_argument('--kind', choices=('rod', 'piston'), help='with --diameter: seals for a cylinder, catalogue too')
    text = 'of the rod, or of the bore of a piston seal, in m or with a unit'
    seals.add_argument('--diameter', type=cli.quantity('m'), metavar='D', help=text)
    seals.add_argument('folders', type=Path, nargs='*', metavar='FOLDER', help='default: config/seals')
    seals.add_argument('--full', action='store_true', help='print the whole source of each seal')
    cli.add_file(charts, 'seal', 'seals', 'seal file', metavar='SEAL')
    cli.add_page(charts)


def _pressures(text: str) -> tuple[float, float, int]:
    try:
        low, high, steps = text.split(':')
        return float(low), float(high), int(steps)
    except ValueError:
        raise argparse.ArgumentTypeError(f'{text} is not LOW:HIGH:STEPS, for example 0:70:10') from None


_PRESSURES = {'type': _pressures, 'default': (0.0, 70.0, 10), 'metavar': 'LOW:HIGH:STEPS'}
_OF_SHEET: dict[str, tuple[str, cli.Settings]] = {
    'name': ('name of the seal', {}),
    '--pressures': ('default 0:70:10', _PRESSURES),
    '--tests': ('default 3', {'type': int, 'default': 3}),
    '--seals': ('seals that share the pressure, default 2', {'type': int, 'default': 2}),
    '--pressure-unit': ('default bar', {'choices': ('bar', 'MPa', 'kPa', 'psi'), 'default': 'bar'}),
    '--force-unit': ('default N', {'choices': ('N', 'kN', 'lbf'), 'default': 'N'}),
    '--length-unit': ('default mm', {'choices': ('mm', 'in'), 'default': 'mm'}),
}
_SEALS = ('seals', 'seals my_seals --full', 'seals --kind rod --diameter 36mm')
_OF_PLAN = ('tests', 'seals', 'pressure_unit', 'force_unit', 'length_unit')


_OF_FORCE: dict[str, tuple[str, cli.Settings]] = {
    '--pressure': cli.PRESSURE,
    '--speed': ('in m/s or with a unit; default: Coulomb friction', {'type': cli.quantity('m/s'), 'default': 0.0}),
    '--seals': ('seals at that pressure, default 1', {'type': cli.at_least(1), 'default': 1, 'metavar': 'N'}),
}


def run_force(arguments: argparse.Namespace) -> int:
    """Print friction, band and breakaway at each pressure."""
    from seal_friction_ros.files import config_path
    from seal_friction_ros.offline.contact.seal_force import seal_forces

    path = config_path('seals', arguments.seal)
    found = seal_forces(path, arguments.pressure, arguments.speed, arguments.seals)
    return cli.print_result(arguments, found, found.text())


def run_sheet(arguments: argparse.Namespace) -> int:
    """Write the sheet."""
    from seal_friction_ros.offline.identification import data_sheet
    from seal_friction_ros.offline.reports.page import write_page

    geometry = data_sheet.geometry_of_seal_file(arguments.seal)[0] if arguments.seal else None
    low, high, steps = arguments.pressures
    given = {name: getattr(arguments, name) for name in _OF_PLAN}
    plan = data_sheet.FrictionTestPlan(arguments.name, low, high, steps, geometry=geometry, **given)
    sheet, page = arguments.out, arguments.out.with_suffix('.html')
    data_sheet.write_sheet(plan, sheet)
    write_page(page, 'data_sheet', (), plan=plan, dimensions=data_sheet.DIMENSIONS, command='sheet')
    return cli.print_result(arguments, {'sheet': sheet, 'page': page}, '')


def run_seals(arguments: argparse.Namespace) -> int:
    """Print a line or two for each seal file; exit code 1 if one of them cannot be used."""
    from seal_friction_ros.offline.work.seal_list import fitting_seals, listed_seals, seal_text

    if (arguments.kind is None) != (arguments.diameter is None):
        raise ValueError('--kind and --diameter go together: rod or piston, and the diameter that slides')
    if arguments.kind:
        listed = fitting_seals(arguments.folders, arguments.kind, arguments.diameter)
    else:
        listed = listed_seals(arguments.folders)
    text = '\n'.join(seal_text(seal, full=arguments.full) for seal in listed)
    unusable = any(seal.error for seal in listed)
    return cli.print_result(arguments, {'seals': listed}, text, cli.DIFFERENT if unusable else cli.SUCCESS)


def run_charts(arguments: argparse.Namespace) -> int:
    """Write the page."""
    from seal_friction_ros.files import config_path
    from seal_friction_ros.offline.reports.seal_charts import write_seal_charts

    summary = write_seal_charts(config_path('seals', arguments.seal), arguments.out)
    return cli.print_result(arguments, summary.flat, '')
