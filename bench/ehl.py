"""What the lubricated contact costs, what it finds, and what each choice that is ours does to it.

    python bench/ehl.py [--json]              times, one core
    python bench/ehl.py --findings [--json]   the findings of the paper, with errors of step and grid
    python bench/ehl.py --influence [--json]  each parameter of ours 20 % up and down

Processor seconds, so a busy machine changes little; the first run of each process compiles and is not counted.
"""

import argparse
import dataclasses
import json
import math
import timeit
from collections.abc import Callable
from functools import partial

from one_core import processor_time

from seal_friction_ros.core.estimation.estimator import EstimatorParameters, init, step
from seal_friction_ros.core.estimation.records import Force, Pressure, RodSample
from seal_friction_ros.core.friction.actuator import MountedSeal, Seal, Uncertainty
from seal_friction_ros.core.friction.laws.friction_map import FrictionMap
from seal_friction_ros.core.lubrication.case import Case
from seal_friction_ros.core.lubrication.findings import Findings, findings
from seal_friction_ros.core.lubrication.friction_map import friction_map, map_pressures, memory_length, steady_friction
from seal_friction_ros.core.lubrication.transient import run
from seal_friction_ros.files import default_configuration
from seal_friction_ros.offline.contact.lubrication_runs import run_case, run_study, single_case

CELLS = (226, 452, 1000)
STEPS = (1e-3, 5e-4, 2.5e-4)  # [s]
OURS = {  # case: what the paper does not give, where it acts
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
CALLS = 5_000
SINGLE = (
    'inner_seal', 'inner_seal_groove', 'inner_seal_control_edge', 'inner_seal_viscoelastic', 'inner_seal_starved',
    'inner_seal_pressure', 'outer_seal', 'outer_seal_pressure',
)  # fmt: skip


def one_cycle(case: Case, cells: int = 226, time_step: float = 5e-4) -> float:
    """Processor time of one cycle of 1.8 mm [s]; the better of two."""
    numerics = dataclasses.replace(case.numerics, cells=cells, time_step=time_step)
    once = dataclasses.replace(case, numerics=numerics, motion=dataclasses.replace(case.motion, cycles=1))
    times = []
    for _ in range(2):
        start = processor_time()
        run(once)
        times.append(processor_time() - start)
    return min(times)


def times(case: Case) -> dict[str, float]:
    """All times [s], and exponents of the cost in cells and steps."""
    one_cycle(case, 64, 5e-3)  # compiles
    by_cells = [one_cycle(case, cells) for cells in CELLS]
    by_steps = [one_cycle(case, time_step=step) for step in STEPS]
    start = processor_time()
    rows = [steady_friction(case, float(pressure)) for pressure in map_pressures(case.map)]
    law = friction_map(case, rows, memory_length(case).length)
    map_time = processor_time() - start
    return {
        **{f'cycle, {cells} cells [s]': value for cells, value in zip(CELLS, by_cells, strict=True)},
        'exponent in cells': math.log(by_cells[-1] / by_cells[0]) / math.log(CELLS[-1] / CELLS[0]),
        **{f'cycle, step {step} s [s]': value for step, value in zip(STEPS, by_steps, strict=True)},
        'exponent in steps': math.log(by_steps[-1] / by_steps[0]) / math.log(STEPS[0] / STEPS[-1]),
        f'map, {len(law.speeds)} x {len(law.pressures)} [s]': map_time,
        'look-up of the map [us]': 1e6 * _fastest(lambda: law.sliding_friction(3e4, 0.034)),
        **{f'estimator step, {name} [us]': value for name, value in estimator_steps(law).items()},
    }


def estimator_steps(law: FrictionMap) -> dict[str, float]:
    """Time of one step of the estimator with two seals [us]: without and with a friction map."""
    thesis = default_configuration().parameters().estimator
    limit = law.pressures[-1]
    mapped = MountedSeal(Seal(name='mapped', coulomb_law=law, uncertainty=Uncertainty(0.1), pressure_max=limit), 'a')
    laws = {'physics_based': thesis, 'friction_map': EstimatorParameters(thesis.settings, (mapped, mapped))}
    sample = RodSample(1, 0.034, Pressure(1, 0.5 * limit, 0.0), Force(1, 2.0))
    times: dict[str, list[float]] = {name: [] for name in laws}
    for _ in range(9):  # in turn, so that a slow moment of the machine hits both
        for name, parameters in laws.items():
            times[name].append(_fastest(partial(step, parameters, init(parameters), sample), 3))
    return {name: 1e6 * min(values) for name, values in times.items()}


def _fastest(function: Callable[[], object], repeat: int = 9) -> float:
    """Time of one call [s]."""
    return min(timeit.repeat(function, number=CALLS, repeat=repeat)) / CALLS


@dataclasses.dataclass(frozen=True)
class Row:
    """A number, and how far it moves when the step is doubled and when the grid is halved; None where neither is."""

    case: str
    name: str
    value: float
    by_step: float | None = None
    by_grid: float | None = None


def all_findings() -> list[Row]:
    """The findings of every single case, and those of the study."""
    rows = []
    for name in SINGLE:
        found = run_case(single_case(name, 'finding'))
        values = found.found._asdict()
        rows += [
            Row(name, key, values[key], found.step_errors[key], found.grid_errors[key]) for key in found.step_errors
        ]
        rows.append(Row(name, 'mass_defect', found.result.mass_defect))
        rows.append(Row(name, 'retried_steps', found.result.retried_steps))
    return rows + study_rows(single_case('inner_seal', 'study'))


def study_rows(case: Case) -> list[Row]:
    """Deviation of friction over tau_c from its mean, with its errors."""
    n = case.numerics
    longer = dataclasses.replace(n, time_step=2.0 * n.time_step)
    coarser = dataclasses.replace(n, cells=max(32, n.cells // 2))
    fine, step_, grid = (run_study(dataclasses.replace(case, numerics=g), 1).table for g in (n, longer, coarser))
    return [
        Row(
            f'tau_c = {stress / 1e6:g} MPa',
            name,
            getattr(fine, name)[i],
            abs(getattr(step_, name)[i] - getattr(fine, name)[i]),
            abs(getattr(grid, name)[i] - getattr(fine, name)[i]),
        )
        for i, stress in enumerate(fine.solid_shear_stress)
        for name in ('friction', 'solid_share', 'deviation', 'curve_deviation')
    ]


def influence() -> dict[str, dict[str, list[float]]]:
    """Relative changes of the findings with each parameter of ours 20 % down and up; shares and rise: differences."""
    rows = {}
    for name, parameters in OURS.items():
        case = single_case(name, 'influence')
        base = findings(run(case))
        for parameter in parameters:
            down, up = (_changes(base, findings(run(_with(case, parameter, f)))) for f in (1 - CHANGE, 1 + CHANGE))
            rows[parameter] = {finding: [down[finding], up[finding]] for finding in down}
    return rows


def _with(case: Case, parameter: str, factor: float) -> Case:
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
    """Print the figures, or JSON."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n', maxsplit=1)[0])
    parser.add_argument('--json', action='store_true', help='print JSON')
    parser.add_argument('--findings', action='store_true', help='findings and their errors instead of times')
    parser.add_argument('--influence', action='store_true', help='influence of our choices instead of times')
    arguments = parser.parse_args()
    case = single_case('inner_seal', 'bench')
    if arguments.findings:
        found = all_findings()
        if arguments.json:
            print(json.dumps([dataclasses.asdict(row) for row in found]))
            return
        print(f'{"case":26}{"finding":22}{"value":>12}{"step":>12}{"grid":>12}')
        for row in found:
            errors = ''.join(f'{"" if e is None else f"{e:.2g}":>12}' for e in (row.by_step, row.by_grid))
            print(f'{row.case:26}{row.name:22}{row.value:12.4g}{errors}')
        return
    if not arguments.influence:
        figures = times(case)
        if arguments.json:
            print(json.dumps(figures))
            return
        for name, value in figures.items():
            print(f'{name:36} {value:8.3f}')
        return
    rows = influence()
    if arguments.json:
        print(json.dumps(rows))
        return
    print(f'{"changes in % for -20 %, +20 % of":34}' + ''.join(f'{name:>22}' for name in COMPARED))
    for name, found in rows.items():
        cells = (', '.join(f'{100.0 * c:+.2f}' for c in found.get(finding, ())) for finding in COMPARED)
        print(f'{name:34}' + ''.join(f'{cell:>22}' for cell in cells))


if __name__ == '__main__':
    main()
