"""Friction map of an O-ring from its drawing beside its readings.

``python test/system/oring_map.py [--influence] [--figure FILE.png]``.

The readings are those in the O-ring case file (``measured``); nothing of the map was chosen for them. The exponent is
that of friction over the normal force of the dry ring, from a straight line through the logarithms, less 1: of the
coefficient of friction. With ``--influence`` each number that the drawing does not give is varied by itself.
"""

import argparse
import dataclasses
import json
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure

from seal_friction_ros.core.foundation.units import BAR
from seal_friction_ros.core.lubrication.friction_map import steady_friction
from seal_friction_ros.core.lubrication.lubrication_case import LubricationCase, MapGrid
from seal_friction_ros.core.oring_contact.oring_case_file import MeasuredFriction, parse_oring_case
from seal_friction_ros.core.oring_contact.results import oring_results
from seal_friction_ros.files import config_path, read_yaml
from seal_friction_ros.offline.contact.lubrication_runs import load_case
from seal_friction_ros.offline.reports import figure_style as style
from seal_friction_ros.offline.work.executor import available_cores, run_all

CASES = ('oring_ms28775_114', 'oring_delft')
TITLES = {'oring_ms28775_114': 'ring of the thesis', 'oring_delft': 'O-ring of Delft'}
UNKNOWN = {  # part, field, and two factors: half and double, as far as a slope can belong to a height and a length
    'tau_c': ('seal', 'solid_shear_stress', (0.5, 2.0)),
    'rms height': ('topography', 'rms_height', (0.5, 1.19)),
    'rms slope': ('topography', 'rms_slope', (0.84, 2.0)),
    'roll-off length': ('topography', 'roll_off_length', (0.84, 2.0)),
    'viscosity': ('grease', 'base_viscosity', (0.5, 2.0)),
    'speed': ('motion', 'speed', (0.5, 2.0)),
}


class Beside(NamedTuple):
    """Computed and measured friction at the pressures of the readings."""

    pressures: list[float]  # [Pa]
    measured: list[float]  # [N] of one seal
    computed: list[float]  # [N] at the reference speed of the case
    normal_forces: list[float]  # [N] of the dry ring

    @property
    def errors(self) -> np.ndarray:
        """Computed over measured, less 1."""
        return np.divide(self.computed, self.measured) - 1.0

    def exponent(self, friction: Sequence[float]) -> float:
        """Exponent of the coefficient of friction over the normal force."""
        if len(friction) < 2:
            return float('nan')
        return float(np.polyfit(np.log(self.normal_forces), np.log(friction), 1)[0]) - 1.0

    @property
    def factor(self) -> float:
        """The factor on the computed friction that suits the readings best: a calibration."""
        return float(np.exp(-np.log(self.errors + 1.0).mean()))

    def calibrated(self) -> float:
        """Largest error that is left when one factor on the friction is chosen for the readings."""
        return float(np.abs((self.errors + 1.0) * self.factor - 1.0).max())


def measured_of(case: LubricationCase) -> MeasuredFriction:
    """Readings in the case file of the ring of a case."""
    path = config_path('oring', case.oring.name if case.oring.name != 'delft_o_ring_fem' else 'delft_o_ring')
    return parse_oring_case(read_yaml(path)).measured


def beside(case: LubricationCase, pressures: Sequence[float], workers: int) -> Beside:
    """The case at its reference speed beside the readings nearest to ``pressures`` [Pa]."""
    readings = measured_of(case)
    chosen = sorted({int(np.abs(np.subtract(readings.pressures, p)).argmin()) for p in pressures})
    taken = [readings.pressures[i] for i in chosen]
    speed = case.motion.speed
    at_speed = dataclasses.replace(case, map=MapGrid(velocity_min=0.1 * speed, velocity_max=speed, velocities=4))
    calls = [partial(steady_friction, at_speed, pressure) for pressure in taken]
    computed = [float(row.friction[-1]) for row in run_all(case.name, calls, workers)]
    rod = case.oring.geometry.sliding_wall == 'rod'
    forces = [(r.rod if rod else r.gland).force for r in oring_results(case.oring, tuple(taken))]
    return Beside(taken, [readings.frictions[i] / readings.seals for i in chosen], computed, forces)


def varied(case: LubricationCase, part: str, field: str, factor: float) -> LubricationCase:
    """The case with one number times ``factor``."""
    record = getattr(case, part)
    return dataclasses.replace(case, **{part: dataclasses.replace(record, **{field: factor * getattr(record, field)})})


def draw(every: Mapping[str, Beside], path: Path) -> None:
    """Picture of computed and measured friction over the pressure, a ring each."""
    with style.house_style():
        figure = Figure(figsize=(4.4, 2.3 * len(every)), layout='constrained')
        for ax, (name, found) in zip(figure.subplots(len(every), squeeze=False)[:, 0], every.items(), strict=True):
            bar = np.divide(found.pressures, BAR)
            ax.plot(bar, found.computed, '-s', color=style.VERMILLION, label='from the drawing, nothing chosen')
            scaled = np.multiply(found.computed, found.factor)
            ax.plot(bar, scaled, ':', color=style.VERMILLION, label=f'the same times {found.factor:.2f}, chosen')
            ax.plot(bar, found.measured, 'o', color=style.BLACK, label='measured')
            ax.set(
                title=TITLES.get(name, name), ylabel='friction of one seal [N]', ylim=(0.0, 1.5 * max(found.computed))
            )
            ax.legend(loc='upper left')
        ax.set_xlabel('pressure [bar]')
        figure.savefig(path, dpi=220, metadata={'Software': None})


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.partition('\n')[0])
    parser.add_argument('cases', nargs='*', default=CASES, metavar='CASE')
    parser.add_argument('--readings', type=int, default=6, help='pressures of the readings that are computed')
    parser.add_argument('--influence', action='store_true', help='vary what the drawing does not give')
    parser.add_argument('--cells', type=int, help='cells of the film in the place of those of the case')
    parser.add_argument('--figure', type=Path, help='PNG of computed and measured friction over the pressure')
    parser.add_argument('--json', action='store_true')
    wanted = parser.parse_args()
    said: dict[str, Any] = {}
    every: dict[str, Beside] = {}
    for name in wanted.cases:
        case = load_case(name)
        if wanted.cells:
            case = dataclasses.replace(case, numerics=dataclasses.replace(case.numerics, cells=wanted.cells))
        readings = measured_of(case).pressures
        pressures = np.linspace(readings[0], readings[-1], wanted.readings)
        found = every[name] = beside(case, pressures, available_cores())
        rows: dict[str, Any] = {'as it is': _numbers(found)}
        if wanted.influence:
            few = (pressures[0], pressures[len(pressures) // 2], pressures[-1])
            rows['as it is, three pressures'] = _numbers(beside(case, few, available_cores()))
            for label, (part, field, factors) in UNKNOWN.items():
                for factor in factors:
                    other = beside(varied(case, part, field, factor), few, available_cores())
                    rows[f'{label} x {factor:g}'] = _numbers(other)
        said[name] = {'readings': found._asdict(), 'rows': rows}
        if not wanted.json:
            _print(name, found, rows)
    if wanted.figure:
        draw(every, wanted.figure)
    if wanted.json:
        print(json.dumps(said))


def _numbers(found: Beside) -> dict[str, float]:
    return {
        'mean error': float(found.errors.mean()),
        'largest error with one factor chosen': found.calibrated(),
        'exponent': found.exponent(found.computed),
        'exponent measured': found.exponent(found.measured),
    }


def _print(name: str, found: Beside, rows: dict[str, Any]) -> None:
    print(f'{name}\n\n  pressure [MPa]   measured [N]   computed [N]   error [%]   normal force [N]')
    for pressure, measured, computed, error, force in zip(
        found.pressures, found.measured, found.computed, found.errors, found.normal_forces, strict=True
    ):
        print(f'{pressure / 1e6:14.3f} {measured:14.2f} {computed:14.2f} {100.0 * error:11.0f} {force:18.1f}')
    print('\n                            mean error [%]   with one factor chosen [%]   exponent   measured')
    for label, row in rows.items():
        error, left, exponent, measured = row.values()
        print(f'{label:26s} {100.0 * error:15.0f} {100.0 * left:28.0f} {exponent:10.3f} {measured:10.3f}')
    print()


if __name__ == '__main__':
    main()
