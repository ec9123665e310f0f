"""The body under the film and its groove: ``python test/studies/seal_bodies.py [TABLE ...] [--json]``.

Tables, all of them by default:

- ``bodies``: friction, solid share and rise on slowing down of ``inner_seal`` on each body, three meshes of finite
  elements, what the groove holds, and other widths of the section;
- ``edge``: peak and forces at the control edge on each body, with the time step of ``inner_seal_control_edge``;
- ``valve``: the whole valve, ``spool``, all its seals with each body;
- ``strain``: contact force of the section on a smooth wall by small displacements and by finite strain;
- ``groove``: ``inner_seal_groove`` with friction of the seal in its groove;
- ``air``: air under 6 bar through the gap that opens at the edge of ``inner_seal_control_edge``.
"""

import argparse
import dataclasses
import json
import math
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table
from scipy.optimize import nnls

sys.path.insert(0, str(Path(__file__).parents[1]))
from harness.blow_by import blow_by
from harness.section_stiffness import axial_stiffness

from seal_friction_ros.core.lubrication.contact import dry_contact
from seal_friction_ros.core.lubrication.grease import apparent_viscosity
from seal_friction_ros.core.lubrication.seal_section import SealSection, face_compliance, nothing_around, seal_section
from seal_friction_ros.core.oring_contact.equilibrium import make_assembly, outline, solve_equilibrium, unstressed_state
from seal_friction_ros.core.oring_contact.surroundings import node_areas, surface_pressure
from seal_friction_studies.core.findings import findings
from seal_friction_studies.core.study_case import Spool, StudyNumerics, StudySeal
from seal_friction_studies.core.transient import last_cycle, run_transient, transient_model
from seal_friction_studies.offline.study_runs import cases_of_spool, load_case, run_spool, single_case

Rows = list[dict[str, float | str]]
EDGE_BODIES = ('half_plane', 'finite_elements', 'bonded_layer')
MESHES = (24, 48, 96)
WIDTHS = (1.0e-3, 2.0e-3)  # [m]
COEFFICIENTS = (0.0, 0.02, 0.03, 0.04, 0.05, 0.15)  # the last is that of the paper
SQUEEZES = (4e-6, 12e-6, 36e-6)  # [m]
PENALTIES = (200.0, 500.0, 1000.0, 2000.0)  # over E / height; the last two give the force on a rigid wall
BEYOND = (0.18e-3, 0.21e-3, 0.24e-3, 0.26e-3, 0.27e-3, 0.30e-3, 0.36e-3, 0.45e-3)  # [m]
PRESSURE = 6e5  # [Pa] gauge
STEP = 4e-6  # [m] of squeeze


def bodies(numerics: StudyNumerics) -> Rows:
    """Findings of ``inner_seal`` with each body."""
    case = dataclasses.replace(single_case('inner_seal', 'finding'), numerics=numerics)
    elements = {'body': 'finite_elements'}
    variants: dict[str, tuple[dict[str, float | str], int]] = {
        'half_plane': ({}, 48),
        'bonded_layer': ({'body': 'bonded_layer'}, 48),
        **{f'finite_elements, {mesh} under the film': (elements, mesh) for mesh in MESHES},
        **{f'section_hold: {hold}': (elements | {'section_hold': hold}, 48) for hold in HELD},
        **{f'section_width: {1e3 * width:g} mm': (elements | {'section_width': width}, 48) for width in WIDTHS},
    }
    rows: Rows = []
    for name, (changes, mesh) in variants.items():
        seal = dataclasses.replace(case.seal, **changes)
        meshed = dataclasses.replace(numerics, section_elements=mesh)
        found = findings(run_transient(dataclasses.replace(case, seal=seal, numerics=meshed)))
        pulled = '-'
        if changes.get('body') == 'finite_elements':
            pulled = axial_stiffness(seal_section(seal, numerics.film_width, mesh))
        rows.append(
            {
                'body': name,
                'friction [N]': found.friction,
                'solid share [%]': 100.0 * found.solid_share,
                'rise on slowing down [%]': 100.0 * (found.rise_on_deceleration or 0.0),
                'axial stiffness [N/m]': pulled,
            }
        )
    return rows


HELD = ('bottom_and_flanks', 'sliding_bottom')


def edge(numerics: StudyNumerics) -> Rows:
    """Findings of ``inner_seal_control_edge`` with each body."""
    case = single_case('inner_seal_control_edge', 'finding')
    numerics = dataclasses.replace(case.numerics, cells=numerics.cells)
    rows: Rows = []
    for body in EDGE_BODIES:
        seal = dataclasses.replace(case.seal, body=body)
        found = findings(run_transient(dataclasses.replace(case, seal=seal, numerics=numerics)))
        rows.append(
            {
                'body': body,
                'peak over friction after it': found.edge_peak or 0.0,
                'friction after it [N]': found.after_edge or 0.0,
                'push of the chamfer [N]': found.edge_assist or 0.0,
                'friction on leaving [N]': found.friction_on_leaving or 0.0,
            }
        )
    return rows


def valve(numerics: StudyNumerics) -> Rows:
    """Peaks of the whole valve over the friction around them, all its seals with each body."""
    spool = load_case('spool')
    assert isinstance(spool, Spool)
    rows: Rows = []
    for body in EDGE_BODIES:
        cases = {
            member: dataclasses.replace(
                case,
                seal=dataclasses.replace(case.seal, body=body),
                numerics=dataclasses.replace(case.numerics, cells=numerics.cells),
            )
            for member, case in cases_of_spool(spool, 'spool').items()
        }
        numbers = run_spool(spool, cases, 2).numbers()
        rows.append({'body': body, **{name: numbers[name] for name in VALVE_NUMBERS}})
    return rows


VALVE_NUMBERS = (
    'positive_level_N',
    'positive_peak_over_level',
    'negative_level_N',
    'negative_peak_over_level',
)


def strain(_: StudyNumerics) -> Rows:
    """Contact force on a smooth wall."""
    seal = StudySeal(body='finite_elements')
    rows: Rows = []
    for mesh in (24, 48):
        for squeeze in SQUEEZES:
            small, finite = contact_forces(seal, mesh, squeeze)
            rows.append(
                {
                    'elements': mesh,
                    'squeeze [um]': 1e6 * squeeze,
                    'small displacements [N]': small,
                    'finite strain [N]': finite,
                    'more [%]': 100.0 * (finite / small - 1.0),
                }
            )
    return rows


def groove(numerics: StudyNumerics) -> Rows:
    """Figure 14 of the paper with friction in the groove."""
    case = dataclasses.replace(single_case('inner_seal_groove', 'finding'), numerics=numerics)
    rows: Rows = []
    for coefficient in COEFFICIENTS:
        changed = dataclasses.replace(case.groove, friction_coefficient=coefficient)
        result = run_transient(dataclasses.replace(case, groove=changed))
        found, last = findings(result), last_cycle(result)
        forth = result.friction[last & (result.velocity > 0.0)]
        load = (result.film_pressure + result.contact_pressure)[last].sum(axis=1) * numerics.film_width / numerics.cells
        rows.append(
            {
                'coefficient': coefficient,
                'normal force [N]': float(load.mean()) * math.pi * case.seal.sealing_diameter,
                'largest friction [N]': float(np.abs(result.friction[last]).max()),
                'along the motion after a reversal [um]': 1e6 * (found.assisted_length or 0.0),
                'falls again at [mm]': '-' if found.second_lobe is None else 1e3 * found.second_lobe,
                'changes of sign': float(np.count_nonzero(np.diff(np.sign(forth[forth != 0.0])))),
                'seats': float(len(set(np.sign(result.lag[last])))),
            }
        )
    return rows


def air(_: StudyNumerics) -> Rows:
    """The seal at rest and dry on its way out of the seat, without the interference that pressure adds."""
    case = single_case('inner_seal_control_edge', 'finding')
    model, speed = transient_model(case), case.motion.speed
    rows: Rows = []
    for beyond in BEYOND:
        gap = dry_contact(model.contact, model.rigid_gap(case.control_edge.position + beyond))
        throat = float(gap.min())
        viscosity = apparent_viscosity(case.grease.numbers, speed / throat)
        flow = blow_by(gap, model.contact.body.cell_width, PRESSURE, viscosity, speed)
        rows.append(
            {
                'beyond the edge [mm]': 1e3 * beyond,
                'narrowest gap [um]': 1e6 * throat,
                'viscous flow [g/(m s)]': 1e3 * flow.viscous,
                'choked flow [g/(m s)]': 1e3 * flow.choked,
                'Reynolds number': flow.reynolds_number,
                'blow-out': flow.blow_out,
            }
        )
    return rows


def contact_forces(seal: StudySeal, elements: int, squeeze: float) -> tuple[float, float]:
    """Contact force [N] of the section on a smooth wall, by small displacements and by finite strain."""
    section = seal_section(seal, 0.6e-3, elements)
    return _of_small_displacements(seal, section, squeeze), _of_finite_strain(seal, section, squeeze)


def _of_small_displacements(seal: StudySeal, section: SealSection, squeeze: float) -> float:
    """No gap and no force of a node is negative, and one of them is zero: a least-squares problem of forces >= 0."""
    root = np.linalg.cholesky(face_compliance(section))
    gap = seal.fall(section.place) - squeeze
    return float(nnls(root.T, -np.linalg.solve(root, gap))[0].sum())


def _of_finite_strain(seal: StudySeal, section: SealSection, squeeze: float) -> float:
    """The wall closes in steps and then stiffens; the last two penalties are extrapolated to a rigid wall."""
    model, modulus = section.model, section.model.rubber.elastic_modulus
    assembly, state = make_assembly(model, section.held), unstressed_state(model)
    closing = np.linspace(0.0, squeeze, round(squeeze / STEP) + 1)[1:]
    path = [(way, PENALTIES[0]) for way in closing] + [(squeeze, penalty) for penalty in PENALTIES[1:]]
    forces = []
    for way, penalty in path:
        wall = nothing_around(model)._replace(
            gland_radius=0.5 * seal.sealing_diameter - way,
            penalty=penalty * modulus / seal.section_height,
            transition=5e-3 * modulus,
        )
        state, _ = solve_equilibrium(model, assembly, wall, state)
        position = outline(model, state)
        forces.append(float((surface_pressure(wall, position).contact_stress * node_areas(position)[:, 0]).sum()))
    return 2.0 * forces[-1] - forces[-2]


TABLES: dict[str, Callable[[StudyNumerics], Rows]] = {
    'bodies': bodies,
    'edge': edge,
    'valve': valve,
    'strain': strain,
    'groove': groove,
    'air': air,
}


def main() -> int:
    """Compute the requested tables; print each, or all of them as one JSON object."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n', maxsplit=1)[0])
    parser.add_argument('tables', nargs='*', metavar='TABLE', help=', '.join(TABLES))
    parser.add_argument('--json', action='store_true')
    parser.add_argument('--cells', type=int, default=226, help='cells of the film')
    parser.add_argument('--time-step', type=float, default=5e-4, metavar='S', help='of the runs')
    arguments = parser.parse_args()
    unknown = [name for name in arguments.tables if name not in TABLES]
    if unknown:
        parser.error(f'there is no table {unknown[0]}: there are {", ".join(TABLES)}')
    numerics = StudyNumerics(cells=arguments.cells, time_step=arguments.time_step)
    computed = {name: TABLES[name](numerics) for name in arguments.tables or TABLES}
    if arguments.json:
        print(json.dumps(computed))
        return 0
    for name, rows in computed.items():
        table = Table(title=name)
        for heading in rows[0]:
            table.add_column(heading, justify='right')
        for row in rows:
            table.add_row(*(value if isinstance(value, str) else f'{value:.4g}' for value in row.values()))
        Console(width=160).print(table)
    return 0


if __name__ == '__main__':
    sys.exit(main())
