"""A new friction law: one function and one class in a registry; seal files, estimator and `identify` then know it."""

import math
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from seal_friction_ros import FrictionState, load_seal, read_bag
from seal_friction_ros.core.foundation.parameters import parameter
from seal_friction_ros.core.friction.laws import FRICTION_LAWS
from seal_friction_ros.core.friction.laws.law import FrictionLaw

SEAL = """{name: mine, coulomb_law: saturating, saturating: {f_0: 5.76, f_1: 25.7, p_s: 3.52e+6},
uncertainty: {relative_std: 0.1}, identified_pressure: [0.0, 7.0e+6], mounting: {chambers: [a, b]}}"""


def saturating(f_0: float, f_1: float, p_s: float, pressure: float, _speed: float) -> float:
    """F = f_0 + f_1 (1 - exp(-P / P_s)) [N]."""
    return f_0 + f_1 * (1.0 - math.exp(-pressure / p_s))


@dataclass(frozen=True)
class Saturating(FrictionLaw):
    """Friction that saturates with pressure; docs/extending.md has the rules of a law."""

    NAME, FORMULA, function = 'saturating', 'f_0 + f_1 (1 - exp(-P / P_s))', staticmethod(saturating)
    f_0: float = parameter(unit='N', lower=0.0, upper=1e6, description='At no pressure.', start=lambda t: t.friction)
    f_1: float = parameter(unit='N', lower=0.0, upper=1e6, description='By pressure.', start=lambda t: t.friction)
    p_s: float = parameter(unit='Pa', lower=1e3, upper=1e9, description='Adds 63 %.', start=lambda t: t.pressure)


FRICTION_LAWS.append(Saturating)
with tempfile.TemporaryDirectory() as folder:
    (path := Path(folder) / 'mine.yaml').write_text(SEAL)  # the numbers of identify(table, law='saturating')
    assert load_seal(path).friction(3.52e6, 0.05) == 5.76 + 25.7 * (1.0 - math.exp(-1.0))
    run = read_bag(Path(__file__).parents[1] / 'bags' / 'pull_test', seals=path)  # the estimator with the new law
sliding = run['state'] == FrictionState.SLIDING
error = np.abs(run['force_sum'][sliding]) - np.abs(run['friction_force'][sliding])
print(f'{np.sqrt(np.mean(error**2)):.2f} N left over')
assert np.sqrt(np.mean(error**2)) < 3.0
