"""Time of the lubricated contact: ``python bench/ehl.py [--cells 226 452 1000] [--steps 1e-3 5e-4 2.5e-4] [--json]``.

Processor times of one core, on which a busy machine has little influence. The first run compiles and is not counted.
"""

import argparse
import dataclasses
import math
import sys
import timeit
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from one_core import processor_time

sys.path.insert(0, str(Path(__file__).parents[1] / 'test'))
from harness.campaign import tell

from seal_friction_ros.core.estimation.estimator import EstimatorParameters, init, step
from seal_friction_ros.core.estimation.records import RodSample
from seal_friction_ros.core.friction.actuator import MountedSeal, Seal, Uncertainty
from seal_friction_ros.core.friction.laws.friction_map import FrictionMap
from seal_friction_ros.core.lubrication.friction_map import friction_map, memory_length, steady_table
from seal_friction_ros.core.messages.records import Force, Pressure
from seal_friction_ros.files import default_configuration
from seal_friction_studies.core.study_case import StudyCase
from seal_friction_studies.core.transient import run_transient
from seal_friction_studies.offline.study_runs import single_case

CELLS = (226, 452, 1000)
STEPS = (1e-3, 5e-4, 2.5e-4)  # [s]
CALLS = 5_000  # of a function in one timing


def of_grid(case: StudyCase, cells: int, time_step: float) -> StudyCase:
    """The case with another grid."""
    return dataclasses.replace(case, numerics=dataclasses.replace(case.numerics, cells=cells, time_step=time_step))


def one_cycle(case: StudyCase) -> float:
    """Processor time of one cycle [s]; the better of two."""
    once = dataclasses.replace(case, motion=dataclasses.replace(case.motion, cycles=1))
    times = []
    for _ in range(2):
        start = processor_time()
        run_transient(once)
        times.append(processor_time() - start)
    return min(times)


def times(
    case: StudyCase, cells: Sequence[int], steps: Sequence[float], calls: int, edge: StudyCase
) -> dict[str, float]:
    """All times [s], and the exponents of the time in cells and in steps."""
    one_cycle(of_grid(case, 64, 5e-3))  # compiles
    by_cells = [one_cycle(of_grid(case, count, steps[len(steps) // 2])) for count in cells]
    by_steps = [one_cycle(of_grid(case, cells[0], step)) for step in steps]
    start = processor_time()
    law = friction_map(case, steady_table(case), memory_length(case).length)
    map_time = processor_time() - start
    return {
        **{f'cycle, {count} cells [s]': value for count, value in zip(cells, by_cells, strict=True)},
        'exponent in cells': _exponent(by_cells, cells),
        **{f'cycle, step {step} s [s]': value for step, value in zip(steps, by_steps, strict=True)},
        'exponent in steps': _exponent(by_steps, [1.0 / step for step in steps]),
        f'cycle of {edge.name}, {edge.numerics.cells} cells [s]': one_cycle(edge),
        f'map, {len(law.speeds)} x {len(law.pressures)} [s]': map_time,
        'look-up in the map [us]': 1e6 * _fastest(lambda: law.sliding_friction(3e4, 0.034), calls),
        **{f'estimator step, {name} [us]': value for name, value in estimator_steps(law, calls).items()},
    }


def _exponent(times: Sequence[float], sizes: Sequence[float]) -> float:
    """Slope of log time over log size; NaN of one size."""
    if sizes[0] == sizes[-1]:
        return math.nan
    return math.log(times[-1] / times[0]) / math.log(sizes[-1] / sizes[0])


def estimator_steps(law: FrictionMap, calls: int) -> dict[str, float]:
    """Time of one step of the estimator with two seals [us]: without and with a friction map."""
    thesis = default_configuration().parameters().estimator
    limit = law.pressures[-1]
    mapped = MountedSeal(Seal(name='mapped', coulomb_law=law, uncertainty=Uncertainty(0.1), pressure_max=limit), 'a')
    laws = {'physics_based': thesis, 'friction_map': EstimatorParameters(thesis.settings, (mapped, mapped))}
    sample = RodSample(1, 0.034, Pressure(1, 0.5 * limit, 0.0), Force(1, 2.0))
    times: dict[str, list[float]] = {name: [] for name in laws}
    for _ in range(9):  # alternately, so that a slow moment of the machine affects both
        for name, parameters in laws.items():
            times[name].append(_fastest(partial(step, parameters, init(parameters), sample), calls, 3))
    return {name: 1e6 * min(values) for name, values in times.items()}


def _fastest(function: Callable[[], object], calls: int, repeat: int = 9) -> float:
    """Time of one call [s]."""
    return min(timeit.repeat(function, number=calls, repeat=repeat)) / calls


def main() -> None:
    """Measure; print the figures, or JSON."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n', maxsplit=1)[0])
    parser.add_argument('--json', action='store_true', help='print JSON')
    parser.add_argument('--case', default='inner_seal', help='name or path of the case file')
    parser.add_argument('--edge', default='inner_seal_control_edge', help='a case of whose own grid a cycle is timed')
    parser.add_argument('--cells', type=int, nargs='+', default=CELLS, help='cells of the grids')
    parser.add_argument('--steps', type=float, nargs='+', default=STEPS, help='time steps [s]')
    parser.add_argument('--calls', type=int, default=CALLS, help='of a short function in one timing')
    arguments = parser.parse_args()
    case, edge = (single_case(name, 'bench') for name in (arguments.case, arguments.edge))
    figures = times(case, arguments.cells, arguments.steps, arguments.calls, edge)
    tell(figures, as_json=arguments.json, title='Lubricated contact')


if __name__ == '__main__':
    main()
