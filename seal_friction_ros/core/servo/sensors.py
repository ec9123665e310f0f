"""Sensors of the simulated servo: noise, resolution, drop-outs. Seeded, so a run is reproducible."""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from seal_friction_ros.core.foundation.parameters import CheckedParameters, parameter

_BLOCK = 64  # samples whose random numbers are drawn at once: the cost of a block fits into one tick of the node


@dataclass(frozen=True)
class SensorSettings(CheckedParameters):
    """Errors of the sensors; the default is none."""

    pressure_noise: float = parameter(
        0.0, unit='Pa', lower=0.0, upper=1e7, description='Standard deviation of each pressure.'
    )
    velocity_noise: float = parameter(0.0, unit='m/s', lower=0.0, upper=1.0, description='Standard deviation.')
    force_noise: float = parameter(0.0, unit='N', lower=0.0, upper=1e5, description='Standard deviation.')
    position_noise: float = parameter(0.0, unit='m', lower=0.0, upper=0.1, description='Standard deviation.')
    pressure_resolution: float = parameter(0.0, unit='Pa', lower=0.0, upper=1e7, description='Step; 0: continuous.')
    velocity_resolution: float = parameter(0.0, unit='m/s', lower=0.0, upper=1.0, description='Step; 0: continuous.')
    force_resolution: float = parameter(0.0, unit='N', lower=0.0, upper=1e5, description='Step; 0: continuous.')
    position_resolution: float = parameter(0.0, unit='m', lower=0.0, upper=0.1, description='Step; 0: continuous.')
    delay: float = parameter(0.0, unit='s', lower=0.0, upper=1.0, description='Time from measurement to publication.')
    drop_out: float = parameter(0.0, unit='1', lower=0.0, upper=1.0, description='Share of lost samples, each sensor.')
    seed: int = parameter(0, unit='', lower=0, upper=2**31 - 1, description='Seed of the random numbers.')

    def reading(self, quantity: str, true: float, random: float) -> float:
        """Value of a sensor for a true value and a standard normal random number."""
        value = true + float(getattr(self, f'{quantity}_noise')) * random
        step = float(getattr(self, f'{quantity}_resolution'))
        return step * round(value / step) if step else value


class Readings(NamedTuple):
    """One sample of each sensor; None for a lost sample."""

    pressure: tuple[float, float] | None  # [Pa, gauge] chamber a and b
    velocity: float | None  # [m/s]
    force_sum: float | None  # [N]
    position: float | None  # [m]


def read(settings: SensorSettings, index: int, truth: Readings) -> Readings:
    r"""Readings of sample ``index``: the same for the same settings, index and truth.

    .. math:: y = r \, \mathrm{round}((x + \sigma n) / r)

    with n from a standard normal distribution. White noise and independent drop-outs are our choice.
    """
    normal, uniform = _random(settings.seed, index // _BLOCK)
    n, drops = normal[index % _BLOCK], uniform[index % _BLOCK]
    kept: Any = [None if drop < settings.drop_out else value for drop, value in zip(drops, truth, strict=True)]
    pressure, velocity, force_sum, position = kept
    reading = settings.reading
    return Readings(
        pressure and (reading('pressure', pressure[0], n[0]), reading('pressure', pressure[1], n[1])),
        None if velocity is None else reading('velocity', velocity, n[2]),
        None if force_sum is None else reading('force', force_sum, n[3]),
        None if position is None else reading('position', position, n[4]),
    )


@lru_cache(maxsize=4)
def _random(seed: int, block: int) -> tuple[list[list[float]], list[list[float]]]:
    """Normal and uniform random numbers of a block, as lists: ten times faster to read one by one than arrays."""
    generator = np.random.default_rng([seed, block])
    return generator.standard_normal((_BLOCK, 5)).tolist(), generator.random((_BLOCK, 4)).tolist()
