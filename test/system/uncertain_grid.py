"""Samples of ``--uncertain`` on their coarser grid and on that of the case: ``python test/system/uncertain_grid.py``.

The force of each sample over that of the case is compared: the spread is to be that of the unknowns, whatever the grid.
"""

import argparse
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial

import numpy as np

from seal_friction_ros.core.lubrication.friction_map import map_pressures, steady_friction
from seal_friction_ros.core.lubrication.lubrication_case import LubricationCase, varied_case
from seal_friction_ros.core.oring_contact.oring_case import OringCase
from seal_friction_ros.core.oring_contact.oring_case_file import parse_oring_case, varied_ring
from seal_friction_ros.core.oring_contact.ring_friction import PRIOR, RingLaw
from seal_friction_ros.files import config_path, read_yaml
from seal_friction_ros.offline.contact.lubrication_runs import compile_for_map
from seal_friction_ros.offline.contact.sampling import coarse_case, coarse_ring, latin_hypercube, ring_forces
from seal_friction_ros.offline.work.executor import available_cores, try_all
from seal_friction_studies.offline.study_runs import single_case

Values = Mapping[str, float]


def map_forces(case: LubricationCase, values: Values) -> np.ndarray:
    """Friction over the pressures and speeds of a case with other values [N]."""
    varied = varied_case(case, values)
    return np.array([steady_friction(varied, pressure).friction for pressure in map_pressures(case.map)]).ravel()


def dry_forces(case: OringCase, pressures: tuple[float, ...], law: RingLaw, values: Values) -> np.ndarray:
    """Normal force and friction of a dry ring with other values at its pressures [N]."""
    return np.concatenate(ring_forces(varied_ring(case, values), pressures, law))


def compared(name: str, samples: int) -> np.ndarray:
    """Force of each sample over that of the case, on the coarse and on the full grid, shape (2, samples, points)."""
    kind, _, short = name.partition('/')
    grids: tuple[Callable[[Values], np.ndarray], ...]
    if kind == 'ehl':
        case = single_case(short, 'friction map')
        coarse, unknowns = coarse_case(case), case.unknown
        compile_for_map(coarse)
        grids = partial(map_forces, coarse), partial(map_forces, replace(case, map=coarse.map))
    else:
        file = parse_oring_case(read_yaml(config_path('oring', short)))
        unknowns = file.unknown
        law = (file.friction or PRIOR).law
        grids = tuple(partial(dry_forces, ring, file.pressures, law) for ring in (coarse_ring(file.case), file.case))
    names = [unknown.name for unknown in unknowns]
    drawn = [dict(zip(names, row, strict=True)) for row in latin_hypercube(unknowns, samples, 0).tolist()]
    found = try_all(name, [partial(grid, values) for grid in grids for values in ({}, *drawn)], available_cores())
    halves = found[: samples + 1], found[samples + 1 :]
    both = [(a.result, b.result) for a, b in zip(*halves, strict=True) if not (a.error or b.error)]
    forces = np.array(both).swapaxes(0, 1)
    return forces[:, 1:] / forces[:, :1]


def main() -> None:
    """Print a line for each case."""
    parser = argparse.ArgumentParser(description=__doc__.partition('\n')[0])
    parser.add_argument(
        'cases', nargs='*', default=['oring/ms28775_114', 'ehl/inner_seal', 'ehl/oring_ms28775_114'], metavar='CASE'
    )
    parser.add_argument('--samples', type=int, default=8)
    wanted = parser.parse_args()
    for name in wanted.cases:
        coarse, fine = compared(name, wanted.samples)
        off = np.abs(coarse / fine - 1.0)
        print(
            f'{name}: {len(fine)} samples at {fine.shape[1]} points: force over that of the case off by '
            f'{100.0 * np.median(off):.2g} % (median), {100.0 * off.max():.2g} % (largest); standard deviation, mean '
            f'over the points: {coarse.std(axis=0).mean():.3f} coarse, {fine.std(axis=0).mean():.3f} full',
            flush=True,
        )


if __name__ == '__main__':
    main()
