"""Force times wanted velocity is never negative: random laws, gains and references through the pipeline of the node.

``python test/system/feedforward_sign.py --cases 100000``. Each case is a reference of 30 samples; in every
second case the force follows elastic seals. Slew limit, force
limit and fade are out of the way, since they alone may delay a reversal; the lead is random. Exit code 1 if a force
acts against the reference, or is not exactly 0 N with ``scale`` 0.
"""

import math
import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))
from harness.campaign import parser_of, tell
from paths import ROOT

from seal_friction_ros.core.estimation.estimator import EstimatorParameters, EstimatorSettings
from seal_friction_ros.core.estimation.feedforward import FeedForwardSettings
from seal_friction_ros.core.estimation.pipeline import PipelineParameters, init_running, receive
from seal_friction_ros.core.friction.actuator import MountedSeal, Seal
from seal_friction_ros.core.friction.laws.constant_coulomb import ConstantCoulomb
from seal_friction_ros.core.friction.laws.friction_map import FrictionMap
from seal_friction_ros.core.friction.laws.pressure_power_law import PressurePowerLaw
from seal_friction_ros.core.friction.laws.velocity_terms import VelocityTerms
from seal_friction_ros.core.friction.presliding import Presliding
from seal_friction_ros.core.friction.seal_file import parse_seal
from seal_friction_ros.core.messages.records import FeedForward, Pressure, ServoReference, Velocity
from seal_friction_ros.files import read_yaml

SAMPLES = 30
MS = 1_000_000  # [ns]
LIMITS = EstimatorSettings()


@cache
def seals_of_files() -> tuple[Seal, ...]:
    """Every seal of the package: between them they have all laws with a file."""
    return tuple(parse_seal(read_yaml(path)) for path in sorted((ROOT / 'config' / 'seals').glob('*.yaml')))


def random_seal(rng: np.random.Generator) -> Seal:
    """A seal with any law; with velocity terms, half of those that take them."""
    law: Any
    files = seals_of_files()
    seal = files[rng.integers(len(files))]
    kind = rng.integers(4)
    if kind == 0:
        frictions = (10.0 ** rng.uniform(-2, 3, size=6)).tolist()
        frictions[0], frictions[3] = sorted((frictions[0], frictions[3]))  # Coulomb friction rises with pressure
        speeds = tuple((10.0 ** np.linspace(-4, rng.uniform(-2, 0), 3)).tolist())
        return replace(
            seal,
            coulomb_law=FrictionMap(
                speeds=speeds, pressures=(0.0, 5e6), frictions=tuple(frictions), reference_speed=speeds[0]
            ),
            velocity_terms=None,
        )
    law = seal.coulomb_law
    if kind == 1:
        law = ConstantCoulomb(10.0 ** rng.uniform(-2, 3))
    elif kind == 2:
        law = PressurePowerLaw(10.0 ** rng.uniform(-2, 2), 10.0 ** rng.uniform(-3, 1), rng.uniform(0.3, 2.0))
    terms = None
    if rng.random() < 0.5:
        terms = VelocityTerms(
            viscous_friction=10.0 ** rng.uniform(-1, 4),
            stribeck_friction=10.0 ** rng.uniform(-1, 2),
            stribeck_velocity=10.0 ** rng.uniform(-4, 0),
            asymmetry=rng.uniform(-0.9, 0.9),
        )
    return replace(seal, coulomb_law=law, velocity_terms=terms)


def random_reference(rng: np.random.Generator) -> list[tuple[float, float]]:
    """Velocity [m/s] and acceleration [m/s^2] of each sample: sine, ramp or trapezoid, with rests and reversals."""
    size = 10.0 ** rng.uniform(-5, 0)
    time = np.arange(SAMPLES) * 1e-3
    kind = rng.integers(3)
    if kind == 0:
        rate, phase = 2.0 * math.pi * 10.0 ** rng.uniform(0, 1.8), rng.uniform(0, 6.3)
        return [(size * math.sin(rate * t + phase), size * rate * math.cos(rate * t + phase)) for t in time.tolist()]
    if kind == 1:
        slope, middle = size * 10.0 ** rng.uniform(0, 3), rng.uniform(0.0, 0.03)
        return [(slope * (t - middle), slope) for t in time.tolist()]
    turn, sign = int(rng.integers(5, 25)), -float(rng.integers(2))
    return [(size if i < turn else sign * size, 0.0) for i in range(SAMPLES)]


def violations(seed: int) -> list[str]:
    """What goes wrong in one case."""
    rng = np.random.default_rng([14, seed])
    elastic = np.random.default_rng([19, seed])
    presliding = Presliding(stiffness=10.0 ** elastic.uniform(3, 8), yield_exponent=elastic.uniform(0.0, 5.0))
    seals = tuple(MountedSeal(replace(random_seal(rng), presliding=presliding), chamber) for chamber in 'ab')
    scale = 0.0 if rng.random() < 0.2 else rng.uniform(0.0, 2.0)
    settings = FeedForwardSettings(
        scale=scale,
        presliding=seed % 2 == 1,
        smoothing_velocity=10.0 ** rng.uniform(-5, -1),
        lead_time=0.5 * rng.random() ** 4,
        slew_limit=1e9,
        force_limit=1e6,
    )
    parameters = PipelineParameters(EstimatorParameters(EstimatorSettings(), seals), settings)
    state, forces = init_running(parameters), []

    def take(record: Any, _: bytes) -> None:
        if isinstance(record, FeedForward):
            forces.append(record.force)

    pressures, wrong = rng.uniform(0.0, 2e7, size=2).tolist(), []
    for i, (velocity, acceleration) in enumerate(random_reference(rng)):
        stamp = i * MS
        for message in (
            Pressure(stamp, *pressures),
            ServoReference(stamp, 0.0, velocity, acceleration),
            Velocity(stamp, velocity),
        ):
            receive(parameters, state, message, stamp, take)
        if not forces:
            if abs(velocity) <= LIMITS.velocity_max and abs(acceleration) <= LIMITS.acceleration_max:
                wrong.append(f'case {seed}, sample {i}: no feed-forward')
            continue  # a reference out of range is none
        if forces[-1] * velocity < 0.0 or (scale == 0.0 and forces[-1] != 0.0):
            wrong.append(f'case {seed}, sample {i}: {forces[-1]} N at {velocity} m/s, scale {scale}')
    if forces and scale > 0.1 and settings.lead_time < 1e-4 and not any(forces):
        wrong.append(f'case {seed}: no force at all')
    return wrong


def main() -> int:
    """Run the cases; print what goes wrong."""
    arguments = parser_of(__doc__, cases=(100_000, 'random cases'), workers=(2, 'processes')).parse_args()
    with ProcessPoolExecutor(arguments.workers) as executor:
        found = [line for lines in executor.map(violations, range(arguments.cases), chunksize=500) for line in lines]
    figures = {'cases': arguments.cases, 'violations': len(found), 'first': found[:20]}
    tell(figures, as_json=arguments.json)
    return 1 if found else 0


if __name__ == '__main__':
    sys.exit(main())
