"""How often ``identify`` finds the right kind of law: seals whose law is known, at few pressures, with noise.

``python test/system/identification_power.py --draws 200``. Noise is of each reading, five in each direction at each
pressure, or of a whole pressure, as if it was held on another day. Exit code 1 if a flat law is recommended where the
friction of the draw rises by more than four standard errors of that noise.
"""

import itertools
import math
import sys
from collections import Counter
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))
from harness.campaign import parser_of, tell

from seal_friction_ros.core.foundation.units import BAR
from seal_friction_ros.core.identification import diagnostics
from seal_friction_ros.core.identification.candidate_laws import candidate_laws
from seal_friction_ros.core.identification.prepare_readings import prepare_manual_readings
from seal_friction_ros.core.identification.readings import FrictionReadings, ManualReadings
from seal_friction_ros.core.identification.selection import (
    recommended,
    rises_over_pressures,
    score_ladder,
    variation_of,
)
from seal_friction_ros.offline.work.executor import available_cores, run_all

SEALS: dict[str, Callable[[float], float]] = {
    '1.9 + 0.65 P': lambda p: 1.9 + 0.65 * p,
    '2 + 0.1 P^1.5': lambda p: 2.0 + 0.1 * p**1.5,
    '3': lambda _: 3.0,
}
"""Friction [N] over pressure [bar]."""
PRESSURES = {3: (1.0, 3.0, 5.0), 4: (1.0, 3.0, 5.0, 7.0), 5: (1.0, 2.0, 3.0, 5.0, 7.0)}  # [bar]
NOISES = (0.01, 0.03, 0.1)
REPEATED = 5  # readings in each direction at each pressure
EVIDENT = 4.0  # [-] standard errors
REPEATS_WITHIN = 0.01  # scatter of the readings where a whole pressure is off


def readings_of(
    seal: str, pressures: tuple[float, ...], noise: float, of_pressure: bool, seed: int
) -> FrictionReadings:
    """One draw: readings in both directions, with a relative noise of each reading or of each pressure."""
    rng = np.random.default_rng(seed)
    rows = []
    for pressure in pressures:
        level = 1.0 + (noise * rng.normal() if of_pressure else 0.0)
        for direction in (1, -1) * REPEATED:
            scatter = 1.0 + (REPEATS_WITHIN if of_pressure else noise) * rng.normal()
            rows.append((pressure * BAR, direction, SEALS[seal](pressure) * level * scatter))
    pressure, direction, friction = np.array(rows).T
    test, unknown = np.zeros(len(rows), dtype=np.int64), np.full(len(rows), np.nan)
    manual = ManualReadings('draw', test, pressure, direction.astype(np.int64), friction, unknown)
    return prepare_manual_readings([manual], [], 1).readings


def rise(readings: FrictionReadings, error: float) -> float:
    """Rise of the friction over the pressures in standard errors; ``error`` is that of the friction of a pressure [-].

    Of the slope of a line: its standard error is that of the friction over the norm of the pressures about their mean.
    """
    pressure, friction = readings.level_pressures, readings.half_ranges[0]
    centred = pressure - pressure.mean()
    return float(centred @ friction / (error * friction.mean() * np.linalg.norm(centred)))


def law_of(readings: FrictionReadings, error: float) -> tuple[str, float, bool]:
    """Recommended law, `rise` of what it was chosen from, and whether a pressure was taken for an outlier."""
    laws = candidate_laws(variation_of(readings))
    outlier = diagnostics.outlying_level([law for law in laws if law.fixed], readings)
    if outlier is not None:
        readings = readings.without(readings.level == outlier.level)
    variation = variation_of(readings)
    scores = score_ladder(candidate_laws(variation), readings, variation)
    chosen = recommended(scores, rises=rises_over_pressures(readings))
    return chosen.law.name, rise(readings, error), outlier is not None


def case(draws: int, seal: str, count: int, noise: float, of_pressure: bool) -> tuple[list[str], int]:
    """Texts of a row, and how often a flat law was recommended against `EVIDENT` standard errors of the noise."""
    error = noise if of_pressure else noise / math.sqrt(2.0 * REPEATED)
    found = [law_of(readings_of(seal, PRESSURES[count], noise, of_pressure, seed), error) for seed in range(draws)]
    flat = sum(name == 'constant_coulomb' for name, _, _ in found)
    wrong = sum(name == 'constant_coulomb' and risen > EVIDENT for name, risen, _ in found)
    right = flat if seal == '3' else draws - flat
    names = Counter(name.removeprefix('pressure_power_law_') for name, _, _ in found)
    texts = [
        'pressure' if of_pressure else 'reading', seal, str(count), f'{100.0 * noise:g}',
        f'{100.0 * right / draws:.1f}', f'{100.0 * np.mean([out for _, _, out in found]):.1f}', str(wrong),
        ', '.join(f'{name} {n}' for name, n in names.most_common()),
    ]  # fmt: skip
    return texts, wrong


def campaign(draws: int, workers: int) -> list[tuple[list[str], int]]:
    """One row a case."""
    cases = list(itertools.product(SEALS, PRESSURES, NOISES))
    calls = [partial(case, draws, *each, of_pressure) for of_pressure in (False, True) for each in cases]
    return run_all('known seals', calls, workers)


def main() -> int:
    """Print the table."""
    parser = parser_of(__doc__, draws=(200, 'of each case'), workers=(available_cores(), 'cases at a time'))
    options = parser.parse_args()
    heads = ('noise of each', 'friction [N]', 'pressures', 'noise [%]', 'right kind [%]', 'outlier [%]', 'flat', 'laws')
    found = list(campaign(options.draws, options.workers))
    tell([dict(zip(heads, texts, strict=True)) for texts, _ in found], as_json=options.json)
    return 1 if any(bad for _, bad in found) else 0


if __name__ == '__main__':
    sys.exit(main())
