"""What the lubricated contact costs, and what each choice that is ours does to it.

    python bench/ehl.py [--json]              times, one core
    python bench/ehl.py --influence [--json]  each parameter of ours 20 % up and down

Processor seconds, so a busy machine changes little; the first run of each process compiles and is not counted.
"""

import argparse
import dataclasses
import json
import math
import time
import timeit

from seal_friction_ros.core.ehl.case import Case
from seal_friction_ros.core.ehl.findings import Findings, findings
from seal_friction_ros.core.ehl.friction_law import FrictionMap
from seal_friction_ros.core.ehl.friction_map import friction_map, map_pressures, memory_length, steady_friction
from seal_friction_ros.core.ehl.transient import run
from seal_friction_ros.offline.ehl import load_case

CELLS = (226, 452, 904)
STEPS = (1e-3, 5e-4, 2.5e-4)  # [s]
OURS = (  # part, field: what the paper does not give
    ('seal', 'crown_radius'),
    ('seal', 'interference'),
    ('seal', 'section_height'),
    ('topography', 'rms_height'),
    ('topography', 'rms_slope'),
    ('topography', 'roll_off_length'),
    ('topography', 'wall_share'),
    ('groove', 'stiffness'),
    ('grease', 'shear_rate_floor'),
    ('numerics', 'film_width'),
)
CHANGE = 0.2


def one_cycle(case: Case, cells: int = 226, time_step: float = 5e-4) -> float:
    """Processor time of one cycle of 1.8 mm [s]; the better of two."""
    numerics = dataclasses.replace(case.numerics, cells=cells, time_step=time_step)
    once = dataclasses.replace(case, numerics=numerics, motion=dataclasses.replace(case.motion, cycles=1))
    times = []
    for _ in range(2):
        start = time.process_time()
        run(once)
        times.append(time.process_time() - start)
    return min(times)


def times(case: Case) -> dict[str, float]:
    """All times [s], and exponents of the cost in cells and steps."""
    one_cycle(case, 64, 5e-3)  # compiles
    by_cells = [one_cycle(case, cells) for cells in CELLS]
    by_steps = [one_cycle(case, time_step=step) for step in STEPS]
    start = time.process_time()
    rows = [steady_friction(case, float(pressure)) for pressure in map_pressures(case.map)]
    law = friction_map(case, rows, memory_length(case))
    map_time = time.process_time() - start
    return {
        **{f'cycle, {cells} cells [s]': value for cells, value in zip(CELLS, by_cells, strict=True)},
        'exponent in cells': math.log(by_cells[-1] / by_cells[0]) / math.log(CELLS[-1] / CELLS[0]),
        **{f'cycle, step {step} s [s]': value for step, value in zip(STEPS, by_steps, strict=True)},
        'exponent in steps': math.log(by_steps[-1] / by_steps[0]) / math.log(STEPS[0] / STEPS[-1]),
        f'map, {len(law.speeds)} x {len(law.pressures)} [s]': map_time,
        'look-up of the map [us]': 1e6 * look_up(law),
    }


def look_up(law: FrictionMap) -> float:
    """Time of one look-up [s]."""
    return min(timeit.repeat(lambda: law.sliding_friction(3e4, 0.034), number=10_000, repeat=9)) / 10_000


def influence(case: Case) -> dict[str, list[float]]:
    """Relative change of friction, and changes of solid share and of the rise on deceleration, down and up."""
    base = findings(run(case))
    rows = {}
    for part, name in OURS:
        changes = [
            _changed(base, findings(run(_with(case, part, name, factor)))) for factor in (1 - CHANGE, 1 + CHANGE)
        ]
        rows[f'{part}.{name}'] = [value for pair in zip(*changes, strict=True) for value in pair]
    return rows


def _with(case: Case, part: str, name: str, factor: float) -> Case:
    record = getattr(case, part)
    names = [f'{name}_left', f'{name}_right'] if name == 'crown_radius' else [name]
    values = {n: getattr(record, n) * factor for n in names}
    if part == 'seal' and name == 'section_height' and factor < 1.0:
        values[name] = max(values[name], case.numerics.film_width)
    return dataclasses.replace(case, **{part: dataclasses.replace(record, **values)})


def _changed(base: Findings, other: Findings) -> tuple[float, float, float]:
    rise, base_rise = other.rise_on_deceleration or 0.0, base.rise_on_deceleration or 0.0
    return other.friction / base.friction - 1.0, other.solid_share - base.solid_share, rise - base_rise


def main() -> None:
    """Print the figures, or JSON."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n', maxsplit=1)[0])
    parser.add_argument('--json', action='store_true', help='print JSON')
    parser.add_argument('--influence', action='store_true', help='influence of our choices instead of times')
    arguments = parser.parse_args()
    case = load_case('inner_seal')
    assert isinstance(case, Case)  # noqa: S101
    if not arguments.influence:
        figures = times(case)
        if arguments.json:
            print(json.dumps(figures))
            return
        for name, value in figures.items():
            print(f'{name:28} {value:8.3f}')
        return
    rows = influence(case)
    if arguments.json:
        print(json.dumps(rows))
        return
    print('changes in % for -20 % and +20 % of        friction      solid share   rise on deceleration')
    for name, values in rows.items():
        print(f'{name:36}' + ''.join(f'{100.0 * value:+9.2f}' for value in values))


if __name__ == '__main__':
    main()
