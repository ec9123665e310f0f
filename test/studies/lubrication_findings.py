"""Findings of the paper as numbers: ``python test/studies/lubrication_findings.py [--influence] [--json]``.

With their errors of time step and grid; with ``--influence`` the change of the findings with each parameter that the
paper does not give, 20 % down and up.
"""

import dataclasses
import sys
from collections.abc import Sequence
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))
from harness.campaign import parser_of, tell

from seal_friction_studies.core.findings import Findings, error_of_levels, findings
from seal_friction_studies.core.study_case import StudyCase
from seal_friction_studies.core.transient import run_transient
from seal_friction_studies.offline.study_runs import run_case, run_study, single_case

OUR_CHOICES = {  # case: parameters that the paper does not give and that act in this case
    'inner_seal': (
        'seal.crown_radius',
        'seal.interference',
        'seal.section_height',
        'topography.rms_height',
        'topography.rms_slope',
        'topography.roll_off_length',
        'topography.wall_share',
        'groove.stiffness',
        'grease.shear_rate_floor',
        'numerics.film_width',
    ),
    'inner_seal_groove': ('groove.half_clearance',),
    'inner_seal_pressure': ('air.pressure_interference',),
    'inner_seal_control_edge': (
        'control_edge.position',
        'control_edge.slope',
        'control_edge.depth',
        'control_edge.rounding',
    ),
    'inner_seal_viscoelastic': ('viscoelasticity.stiffening', 'viscoelasticity.relaxation_time'),
    'inner_seal_starved': ('film_supply.initial_film',),
}
COMPARED = ('friction', 'solid_share', 'rise_on_deceleration', 'edge_peak', 'after_edge')
CHANGE = 0.2
SINGLE = (
    'inner_seal', 'inner_seal_groove', 'inner_seal_control_edge', 'inner_seal_viscoelastic', 'inner_seal_starved',
    'inner_seal_pressure', 'outer_seal', 'outer_seal_pressure',
)  # fmt: skip


@dataclasses.dataclass(frozen=True)
class Row:
    """A number, and its errors by time step and by grid, each from three levels; None: not computed."""

    case: str
    name: str
    value: float
    by_step: float | None = None
    by_grid: float | None = None


def all_findings(names: Sequence[str]) -> list[Row]:
    """The findings of every case, and those of the study of the first case."""
    rows = []
    cases = [single_case(name, 'finding') for name in names]
    first = cases[0]
    for name, body in (('layer', 'bonded_layer'), ('section', 'finite_elements')):
        seal = dataclasses.replace(first.seal, body=body)
        cases.append(dataclasses.replace(first, name=f'{first.name}, {name}', seal=seal))
    for case in cases:
        name, found = case.name, run_case(case)
        values = found.found._asdict()
        rows += [
            Row(name, key, values[key], found.step_errors[key], found.grid_errors[key]) for key in found.step_errors
        ]
        rows.append(Row(name, 'mass_defect', found.result.mass_defect))
        rows.append(Row(name, 'retried_steps', found.result.retried_steps))
    return rows + study_rows(cases[0])


def study_rows(case: StudyCase) -> list[Row]:
    """Deviation of friction over tau_c from its mean, with the errors of step and grid."""
    n = case.numerics
    levels = [n]
    levels += [dataclasses.replace(n, time_step=factor * n.time_step) for factor in (2.0, 4.0)]
    levels += [dataclasses.replace(n, cells=max(32, n.cells // factor)) for factor in (2, 4)]
    tables = [run_study(dataclasses.replace(case, numerics=level), 1).table for level in levels]
    rows = []
    for i, stress in enumerate(tables[0].solid_shear_stress):
        for name in ('friction', 'solid_share', 'deviation', 'curve_deviation'):
            fine, *others = (getattr(table, name)[i] for table in tables)
            by_step, by_grid = error_of_levels(fine, *others[:2]), error_of_levels(fine, *others[2:])
            rows.append(Row(f'tau_c = {stress / 1e6:g} MPa', name, fine, by_step, by_grid))
    return rows


def influence(names: Sequence[str]) -> dict[str, dict[str, list[float]]]:
    """Changes of the findings with each of our choices 20 % down and up: relative; differences for share and rise."""
    rows = {}
    for name in names:
        case = single_case(name, 'influence')
        if case.name not in OUR_CHOICES:
            continue
        base = findings(run_transient(case))
        for parameter in OUR_CHOICES[case.name]:
            down, up = (
                _changes(base, findings(run_transient(_with(case, parameter, f)))) for f in (1 - CHANGE, 1 + CHANGE)
            )
            rows[parameter] = {finding: [down[finding], up[finding]] for finding in down}
    return rows


def _with(case: StudyCase, parameter: str, factor: float) -> StudyCase:
    part, name = parameter.split('.')
    record = getattr(case, part)
    names = [f'{name}_left', f'{name}_right'] if name == 'crown_radius' else [name]
    changed = dataclasses.replace(record, **{n: getattr(record, n) * factor for n in names})
    return dataclasses.replace(case, **{part: changed})


def _changes(base: Findings, other: Findings) -> dict[str, float]:
    was, now = base._asdict(), other._asdict()
    return {
        name: now[name] - was[name] if name in ('solid_share', 'rise_on_deceleration') else now[name] / was[name] - 1.0
        for name in COMPARED
        if was[name] is not None
    }


def main() -> None:
    """Compute; print the table, or JSON."""
    parser = parser_of(__doc__)
    parser.add_argument('--influence', action='store_true', help='influence of our own choices instead of the findings')
    parser.add_argument('--cases', nargs='+', default=SINGLE, help='names or paths of the case files')
    arguments = parser.parse_args()
    if arguments.influence:
        tell(influence(arguments.cases), as_json=arguments.json, title='relative changes for -20 %, +20 % of')
    else:
        tell([dataclasses.asdict(row) for row in all_findings(arguments.cases)], as_json=arguments.json)


if __name__ == '__main__':
    main()
