"""What the finite-element O-ring costs and how it converges: ``python bench/oring.py [--json] [--lines 17 25 33]``.

The case of the first tables is the thesis's ring, calibrated, at its five pressures; each changes one number of
`Numerics` and keeps the others. The last table is what the blind case would give with another section, modulus, ring or
friction. Normal forces are in N. Times are of one core, of this process only.
"""

import argparse
import dataclasses
import json
import sys
import time

from rich.console import Console
from rich.table import Table
from rich.text import Text

from seal_friction_ros.core.oring_contact.case import Numerics, OringCase
from seal_friction_ros.core.oring_contact.case_file import parse_case
from seal_friction_ros.core.oring_contact.loading import model_of
from seal_friction_ros.core.oring_contact.results import contact_results
from seal_friction_ros.core.units import INCH, LBF, PSI
from seal_friction_ros.files import config_path, read_yaml

LINES = (13, 17, 25, 33, 41, 49)
PENALTIES = (200.0, 500.0, 1000.0, 2000.0, 4000.0, 8000.0)
TRANSITIONS = (0.01, 0.02, 0.05, 0.1)
APPENDIX_B = {0: 4.07, 500: 44.48, 1000: 91.1}  # [psi] -> [lbf], sums over the cells


def measure(numerics: Numerics) -> dict[str, float]:
    """Normal force and peak stress at each pressure, what off pressure times area is, and what it cost."""
    file = parse_case(read_yaml(config_path('oring', 'ms28775_114')))
    case = dataclasses.replace(file.case, numerics=numerics)
    begin = time.process_time()
    results = list(contact_results(case, file.pressures))
    figures = {'time [s]': time.process_time() - begin}
    model = model_of(case)
    figures['unknowns'] = float(model.mesh.nodes.size)
    figures['Newton steps'] = float(sum(result.newton_steps for result in results))
    for result in results:
        figures[f'F_n at {result.pressure / PSI:.0f} psi [N]'] = result.rod.force
    last = results[-1]
    figures['peak at the last [MPa]'] = last.rod.peak_stress / 1e6
    figures['width at the last [mm]'] = last.rod.width / 1e-3
    return figures


def sensitivities() -> list[dict[str, float | str]]:
    """Normal force of the blind case and of its variants [N] at 0, 500 and 1000 psi, and over Appendix B [%]."""
    case = parse_case(read_yaml(config_path('oring', 'ms28775_114_blind'))).case
    geometry = case.geometry
    nominal = dataclasses.replace(geometry, section_diameter=0.103 * INCH)
    variants = {
        'blind': case,
        'section 0.105 in instead of 0.106': _with(case, section_diameter=0.105 * INCH),
        'section 0.103 in, nominal': _with(case, section_diameter=0.103 * INCH),
        'E 7.0 MPa instead of 5.5': dataclasses.replace(
            case, rubber=dataclasses.replace(case.rubber, elastic_modulus=7e6)
        ),
        'ring inner diameter 0.607 in instead of 0.612': _with(case, ring_inner_diameter=0.607 * INCH),
        'ring not stretched (0.625 in)': _with(case, ring_inner_diameter=0.625 * INCH),
        'wall friction 0.03': dataclasses.replace(case, wall_friction=0.03),
        'section 0.103 in and E 7.0 MPa (calibrated)': dataclasses.replace(
            case, geometry=nominal, rubber=dataclasses.replace(case.rubber, elastic_modulus=7e6)
        ),
        'calibrated, wall friction 0.05': dataclasses.replace(
            case,
            geometry=nominal,
            rubber=dataclasses.replace(case.rubber, elastic_modulus=7e6),
            wall_friction=0.05,
        ),
    }
    rows: list[dict[str, float | str]] = []
    for name, variant in variants.items():
        row: dict[str, float | str] = {'variant': name}
        for result in contact_results(variant, tuple(psi * PSI for psi in APPENDIX_B)):
            psi = round(result.pressure / PSI)
            row[f'F_n at {psi} psi [N]'] = result.rod.force
            row[f'off at {psi} psi [%]'] = 100.0 * (result.rod.force / (APPENDIX_B[psi] * LBF) - 1.0)
        rows.append(row)
    return rows


def _with(case: OringCase, **changes: float) -> OringCase:
    return dataclasses.replace(case, geometry=dataclasses.replace(case.geometry, **changes))


def main() -> int:
    """Measure every table and print it, or all of them as JSON."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n', maxsplit=1)[0])
    parser.add_argument('--json', action='store_true')
    parser.add_argument('--lines', type=int, nargs='+', default=LINES, help='meshes of the first table')
    arguments = parser.parse_args()
    measure(Numerics(lines=9))  # first calls, not counted
    series = {
        'lines': [Numerics(lines=lines) for lines in arguments.lines],
        'penalty': [Numerics(penalty=penalty) for penalty in PENALTIES],
        'transition': [Numerics(transition=transition) for transition in TRANSITIONS],
    }
    tables: dict[str, list[dict[str, float | str]]] = {
        name: [{name: float(getattr(numerics, name)), **measure(numerics)} for numerics in choices]
        for name, choices in series.items()
    }
    tables['variants of the blind case'] = sensitivities()
    if arguments.json:
        print(json.dumps(tables))
        return 0
    for name, rows in tables.items():
        table = Table(title=f'ms28775_114 over {name}')
        for heading in rows[0]:
            table.add_column(Text(heading), justify='right')
        for row in rows:
            table.add_row(*(_text(value) for value in row.values()))
        Console(width=180).print(table)
    return 0


def _text(value: float | str) -> str:
    if isinstance(value, str):
        return value
    return f'{value:.6g}' if value >= 1e3 else f'{value:.4g}'


if __name__ == '__main__':
    sys.exit(main())
