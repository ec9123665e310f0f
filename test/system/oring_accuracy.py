"""Accuracy of the finite-element O-ring: ``python test/system/oring_accuracy.py [TABLE ...] [--lines N ...] [--json]``.

Tables, all of them by default:

- ``hertz``: force and peak of a cylinder between two plates over those of Hertz [%], peak over that of its own force;
- ``squeeze``: force on a cylinder between two plates over E d by the finite elements, by Ritz's method, by Hertz and by
  Lindley [Lindley1967]_, for rings free to grow;
- ``lines``, ``penalty``, ``transition``: the thesis's ring, calibrated, at its five pressures, with one number of
  `OringNumerics` changed; normal forces in N;
- ``thesis``: calibrated and blind case against Appendix B [%], also cell by cell, axial force over pressure times area,
  volume lost;
- ``variants``: the blind case with another section, modulus, ring or friction;
- ``friction``: friction of one seal from geometry alone against the measured one, thesis's seals and Delft O-ring;
- ``transfer``: friction of one ring from another one, or from one reading, beside a constant and mu N [%].
"""

import dataclasses
import math
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))
from harness.campaign import parser_of, tell_tables
from harness.hertz import cylinder_between_plates
from harness.ring_transfer import transfer_rows
from harness.squeezed_cylinder import force_per_length

from seal_friction_ros.core.foundation.units import BAR, INCH, LBF, PSI
from seal_friction_ros.core.friction.geometry import SealGeometry, projected_area
from seal_friction_ros.core.oring_contact.loading import oring_model, squeeze_ring
from seal_friction_ros.core.oring_contact.material import Rubber
from seal_friction_ros.core.oring_contact.oring_case import Groove, OringCase, OringNumerics
from seal_friction_ros.core.oring_contact.oring_case_file import parse_oring_case
from seal_friction_ros.core.oring_contact.results import WallContact, evaluate_contact, oring_results
from seal_friction_ros.files import config_path, read_yaml
from seal_friction_ros.offline.contact.oring_runs import compute_case
from seal_friction_ros.offline.reports.oring_report import appendix_b, friction_deviation, thesis_case
from seal_friction_ros.offline.reports.thesis_data import ThesisContact

Rows = list[dict[str, float | str]]
SQUEEZES = (0.02, 0.04, 0.06, 0.08)
HERTZ_LINES = (33, 65)
LARGER_SQUEEZES = (0.15, 0.25)
RITZ_DEGREES = (22, 28)
LARGEST_OF_RITZ = 0.15  # squeeze; Newton's method of degree 28 does not reach 0.25
LINES = (13, 17, 25, 33, 41, 49)
PENALTIES = (200.0, 500.0, 1000.0, 2000.0, 4000.0, 8000.0)
TRANSITIONS = (0.01, 0.02, 0.05, 0.1)


def contact(numerics: OringNumerics) -> dict[str, float]:
    """Normal force of the calibrated case at each pressure; peak stress and width at the last one."""
    file = parse_oring_case(read_yaml(config_path('oring', 'ms28775_114')))
    case = dataclasses.replace(file.case, numerics=numerics)
    results = list(oring_results(case, file.pressures))
    figures = {f'F_n at {result.pressure / PSI:.0f} psi [N]': result.rod.force for result in results}
    last = results[-1]
    figures['peak at the last [MPa]'] = last.rod.peak_stress / 1e6
    figures['width at the last [mm]'] = last.rod.width / 1e-3
    return figures


DIAMETER, PLATE_RADIUS, MODULUS = 2e-3, 1.0, 5e6  # [m], [m], [Pa]


def plates(share: float) -> SealGeometry:
    """A ring of so large a radius that rod and gland are plates, squeezed by a ``share`` of its section."""
    inner, depth = 2.0 * PLATE_RADIUS, share * DIAMETER
    return SealGeometry(DIAMETER, inner, inner + depth, inner + 2.0 * DIAMETER - depth, elastic_modulus=MODULUS)


def between_plates(share: float, lines: int) -> tuple[WallContact, float]:
    """Contact of the ring with the rod, and its force per length [N/m]."""
    geometry, rubber, numerics = plates(share), Rubber(MODULUS), OringNumerics(lines=lines)
    case = OringCase(name='plates', geometry=geometry, groove=Groove(5e-3), rubber=rubber, numerics=numerics)
    model = oring_model(case)
    rod = evaluate_contact(model, squeeze_ring(case, model)).rod
    return rod, rod.force / (math.pi * geometry.rod_diameter)


def squeezed() -> Rows:
    """Force per length over E d."""
    scale = MODULUS * DIAMETER
    rows: Rows = []
    for share in (*SQUEEZES, *LARGER_SQUEEZES):
        of_hertz = cylinder_between_plates(share, DIAMETER, MODULUS / 0.75)
        rows.append(
            {
                'squeeze [%]': 100.0 * share,
                **{f'elements, {lines} lines': between_plates(share, lines)[1] / scale for lines in HERTZ_LINES},
                **{
                    f'Ritz, degree {degree}': force_per_length(share, degree) if share <= LARGEST_OF_RITZ else '-'
                    for degree in RITZ_DEGREES
                },
                'Hertz': of_hertz.force_per_length / scale,
                'Lindley': 1.25 * share**1.5 + 50.0 * share**6,
            }
        )
    return rows


def hertz() -> Rows:
    """Contact of the ring with one of the plates."""
    rows: Rows = []
    for lines in HERTZ_LINES:
        for share in SQUEEZES:
            rod, force = between_plates(share, lines)
            expected = cylinder_between_plates(share, DIAMETER, MODULUS / 0.75)
            peak_of_force = expected.peak_stress * math.sqrt(force / expected.force_per_length)
            rows.append(
                {
                    'lines': lines,
                    'squeeze [%]': 100.0 * share,
                    'force off [%]': 100.0 * (force / expected.force_per_length - 1.0),
                    'peak off [%]': 100.0 * (rod.peak_stress / expected.peak_stress - 1.0),
                    'peak off that of the force [%]': 100.0 * (rod.peak_stress / peak_of_force - 1.0),
                }
            )
    return rows


def thesis() -> Rows:
    """Both cases of the thesis's ring against Appendix B."""
    rows: Rows = []
    for name in ('ms28775_114', 'ms28775_114_blind'):
        computed = compute_case(config_path('oring', name))
        area = projected_area(computed.file.case.geometry)
        for result in computed.results:
            its = thesis_case(computed, result)
            if its is None:
                raise ValueError(f'{name}: Appendix B has no {result.pressure / PSI:.0f} psi')
            push = result.pressure * area
            rms, worst = profile_deviation(its, result.rod)
            rows.append(
                {
                    'case': name,
                    'psi': round(result.pressure / PSI),
                    'F_n [lbf]': result.rod.force / LBF,
                    'its [lbf]': its.normal_force / LBF,
                    'F_n off [%]': 100.0 * (result.rod.force / its.normal_force - 1.0),
                    'peak off [%]': 100.0 * (result.rod.peak_stress / its.peak_stress - 1.0),
                    'width off [%]': 100.0 * (result.rod.width / its.width - 1.0),
                    'profile rms [% of peak]': 100.0 * rms,
                    'worst cell [% of peak]': 100.0 * worst,
                    'axial off [%]': 100.0 * (result.axial_force / push - 1.0) if push else '-',
                    'volume lost [%]': 100.0 * (1.0 - result.volume_ratio),
                    'slope': computed.summary.area_deformation_gain or '-',
                }
            )
    return rows


def profile_deviation(its: ThesisContact, rod: WallContact) -> tuple[float, float]:
    """RMS and largest difference of the stress in the cells of the thesis, over its peak, at the best shift along z."""
    shifts = np.linspace(rod.position[0] - its.position[-1], rod.position[-1] - its.position[0], 2001)
    found = [np.interp(its.position + shift, rod.position, rod.stress, 0.0, 0.0) - its.stress for shift in shifts]
    rms = np.sqrt(np.mean(np.square(found), axis=1))
    best = int(rms.argmin())
    return float(rms[best]) / its.peak_stress, float(np.abs(found[best]).max()) / its.peak_stress


def friction() -> Rows:
    """Friction of one seal from geometry alone against the measured one."""
    rows: Rows = []
    for name in ('ms28775_114', 'ms28775_114_blind', 'delft_o_ring'):
        computed = compute_case(config_path('oring', name))
        measured = computed.file.measured
        if measured is None:
            raise ValueError(f'{name}: nothing measured')
        off = friction_deviation(computed, measured)
        for pressure, force, percent in zip(measured.pressures, measured.frictions, off, strict=True):
            each = force / measured.seals
            rows.append(
                {
                    'case': name,
                    'bar': pressure / BAR,
                    'psi': round(pressure / PSI),
                    'measured [N]': each,
                    'from geometry [N]': each * (1.0 + percent / 100.0),
                    'measured [lbf]': each / LBF,
                    'from geometry [lbf]': each * (1.0 + percent / 100.0) / LBF,
                    'off [%]': float(percent),
                }
            )
    return rows


def variants() -> Rows:
    """Normal force of the blind case and its variants [N] at 0, 500 and 1000 psi, and deviation from Appendix B [%]."""
    case = parse_oring_case(read_yaml(config_path('oring', 'ms28775_114_blind'))).case
    geometry = case.geometry
    nominal = dataclasses.replace(geometry, section_diameter=0.103 * INCH)
    cases = {
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
    compared = {psi: case.normal_force for psi, case in appendix_b().items() if psi in (0.0, 500.0, 1000.0)}
    rows: Rows = []
    for name, variant in cases.items():
        row: dict[str, float | str] = {'variant': name}
        for psi, result in zip(compared, oring_results(variant, tuple(p * PSI for p in compared)), strict=True):
            row[f'F_n at {psi:.0f} psi [N]'] = result.rod.force
            row[f'off at {psi:.0f} psi [%]'] = 100.0 * (result.rod.force / compared[psi] - 1.0)
        rows.append(row)
    return rows


def _with(case: OringCase, **changes: float) -> OringCase:
    return dataclasses.replace(case, geometry=dataclasses.replace(case.geometry, **changes))


def converging(name: str, choices: Sequence[float]) -> Rows:
    """Figures of `contact` for several values of one number of `OringNumerics`."""
    return [{name: choice, **contact(dataclasses.replace(OringNumerics(), **{name: choice}))} for choice in choices]


TABLES: dict[str, Callable[[Sequence[int]], Rows]] = {
    'hertz': lambda _: hertz(),
    'squeeze': lambda _: squeezed(),
    'lines': lambda lines: converging('lines', lines),
    'penalty': lambda _: converging('penalty', PENALTIES),
    'transition': lambda _: converging('transition', TRANSITIONS),
    'thesis': lambda _: thesis(),
    'variants': lambda _: variants(),
    'friction': lambda _: friction(),
    'transfer': lambda _: list(transfer_rows()),
}
"""Name -> its rows, given the meshes of the table ``lines``."""


def main() -> int:
    """Compute the requested tables; print each, or all of them as one JSON object."""
    parser = parser_of(__doc__)
    parser.add_argument('tables', nargs='*', metavar='TABLE', help=', '.join(TABLES))
    parser.add_argument('--lines', type=int, nargs='+', default=LINES, help='meshes of the table ``lines``')
    arguments = parser.parse_args()
    unknown = [name for name in arguments.tables if name not in TABLES]
    if unknown:
        parser.error(f'there is no table {unknown[0]}: there are {", ".join(TABLES)}')
    tell_tables({name: TABLES[name](arguments.lines) for name in arguments.tables or TABLES}, as_json=arguments.json)
    return 0


if __name__ == '__main__':
    sys.exit(main())
