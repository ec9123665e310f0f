"""Adaptation on simulated days of a machine that is not the simulator of the package, over many seeds.

``python test/system/adaptation_campaign.py --seeds 1000 --hours 10``. Prints a table; exit code 1 if a bar is missed:

- drift: friction that rises by 20 % over 200 reversals is followed within 5 % and found within 50 reversals;
- disturbed: load steps, inertia, sensor noise and a drifting offset move the scale by at most 5 %;
- undisturbed: fewer than one change is found in the hours given.
"""

import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))
from harness.campaign import parser_of, tell
from harness.simulated_day import Day, samples
from paths import ROOT

from seal_friction_ros.core.estimation import estimator
from seal_friction_ros.core.estimation.adaptation import AdaptationSettings, learnt
from seal_friction_ros.core.estimation.estimator import EstimatorParameters, EstimatorSettings, step
from seal_friction_ros.core.estimation.seal_health import SealHealth, followed
from seal_friction_ros.core.friction.actuator import MountedSeal, actuator_friction
from seal_friction_ros.core.friction.seal_file import parse_seal
from seal_friction_ros.files import read_yaml

SEAL = parse_seal(read_yaml(ROOT / 'config' / 'seals' / 'ms28775_114.yaml'))
SEALS = (MountedSeal(SEAL, 'a'), MountedSeal(SEAL, 'b'))
FRICTION = actuator_friction(SEALS, 3e6, 3e6).coulomb_friction  # [N]
PARAMETERS = EstimatorParameters(EstimatorSettings(), SEALS, AdaptationSettings('on'))
BEGIN = 12.0  # [s] after which the scale is judged
ONE_PART = 600.0  # [s] of the undisturbed hours that one process simulates


def day_of(kind: str, seed: int) -> Day:
    """A machine of random speed, stroke and noise, with one kind of disturbance."""
    rng = np.random.default_rng([seed, 1])
    day = Day(
        FRICTION,
        speed=float(rng.uniform(0.01, 0.05)),
        noise=float(rng.uniform(0.01, 0.1)),
        dip=float(rng.uniform(0.0, 0.15)),
        count=float(10.0 ** rng.uniform(-7, -5.5)),
        mass=float(rng.uniform(1.0, 30.0)),
    )
    size, gap = float(rng.uniform(0.2, 2.0)) * FRICTION, float(rng.uniform(6.0, 15.0))
    return {
        'drift': replace(day, scale=lambda time: 1.0 + 0.001 * time / day.stroke_time),
        'load steps': replace(day, load=lambda time: size * (int(time / gap) % 2)),
        'inertia': replace(day, mass=20.0 * day.mass),
        'noise': replace(day, noise=0.3),
        'offset drift': replace(day, load=lambda time: size * time / 40.0),
        'undisturbed': day,
    }[kind]


def scales(day: Day, seconds: float, seed: int) -> tuple[np.ndarray, list[int]]:
    """Scale after each sample from `BEGIN` on, and the reversals after which a change was found."""
    state, health, found, shown = estimator.init(PARAMETERS), SealHealth(), [], []
    for sample in samples(day, seconds, seed):
        before = state
        state, _ = step(PARAMETERS, state, sample)
        known = health.change.changes
        health = followed(health, before, state)
        if health.change.changes > known:
            found.append(health.learnt)
        shown.append(learnt(state.adaptation).scale)
    return np.array(shown[round(BEGIN / day.period) :]), found


def simulated(kind: str, seconds: float, seed: int) -> dict[str, Any]:
    """Largest error of the scale, and the reversals after which a change was found.

    The error is against the truth of a drift, else against the mean scale of the same machine without the disturbance.
    """
    day = day_of(kind, seed)
    shown, found = scales(day, seconds, seed)
    if kind == 'drift':
        times = BEGIN + day.period * np.arange(len(shown))
        reference = np.array([day.scale(time) for time in times])
    elif kind == 'undisturbed':
        reference = shown.mean()
    else:
        reference = scales(day_of('undisturbed', seed), seconds, seed)[0].mean()
    return {'worst': float(np.abs(shown / reference - 1.0).max()), 'found': found}


def campaign(seeds: int, hours: float, workers: int) -> dict[str, Any]:
    """Numbers of every kind."""
    result: dict[str, Any] = {}
    with ProcessPoolExecutor(workers) as pool:
        for kind in ('drift', 'load steps', 'inertia', 'noise', 'offset drift'):
            seconds = 201.0 if kind == 'drift' else 45.0
            runs = list(pool.map(partial(simulated, kind, seconds), range(seeds), chunksize=4))
            worst = np.array([run['worst'] for run in runs])
            result[kind] = {'within_5_percent': float(np.mean(worst <= 0.05)), 'worst': float(worst.max())}
            if kind == 'drift':
                first = np.array([run['found'][0] if run['found'] else 10**6 for run in runs])
                result[kind] |= {
                    'found_within_50': float(np.mean(first <= 50)),
                    'median_found': float(np.median(first)),
                }
        parts = round(hours * 3600.0 / ONE_PART)
        runs = list(pool.map(partial(simulated, 'undisturbed', ONE_PART), range(10_000, 10_000 + parts)))
        result['undisturbed'] = {
            'hours': parts * ONE_PART / 3600.0,
            'changes_found': sum(len(r['found']) for r in runs),
        }
    return result


def main() -> int:
    """Run and judge."""
    parser = parser_of(__doc__, seeds=(20, 'days of each kind'), hours=(1.0, 'of a day'), workers=(2, 'processes'))
    arguments = parser.parse_args()
    result = campaign(arguments.seeds, arguments.hours, arguments.workers)
    tell(result, as_json=arguments.json)
    held = all(numbers.get('within_5_percent', 1.0) == 1.0 for numbers in result.values())
    held = held and result['drift']['found_within_50'] == 1.0 and result['undisturbed']['changes_found'] == 0
    return 0 if held else 1


if __name__ == '__main__':
    sys.exit(main())
