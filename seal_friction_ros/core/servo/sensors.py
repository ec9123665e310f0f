"""What the sensors of a simulated servo say: noise, resolution, drop-outs; seeded, so that a run can be had again."""

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from seal_friction_ros.core.foundation.parameters import check, parameter

_BLOCK = 64  # samples whose random numbers are drawn at once: long enough to be cheap, short enough for a tick


@dataclass(frozen=True)
class SensorSettings:
    """What is wrong with the sensors; nothing by default.

    Raises:
        ValueError: A value is out of bounds.
    """

    pressure_noise: float = parameter(
        0.0, unit='Pa', lower=0.0, upper=1e7, description='Standard deviation of the noise of each pressure.'
    )
    velocity_noise: float = parameter(0.0, unit='m/s', lower=0.0, upper=1.0, description='Likewise.')
    force_noise: float = parameter(0.0, unit='N', lower=0.0, upper=1e5, description='Likewise.')
    position_noise: float = parameter(0.0, unit='m', lower=0.0, upper=0.1, description='Likewise.')
    pressure_resolution: float = parameter(
        0.0, unit='Pa', lower=0.0, upper=1e7, description='Pressure comes in steps of this size; 0: any value.'
    )
    velocity_resolution: float = parameter(0.0, unit='m/s', lower=0.0, upper=1.0, description='Likewise.')
    force_resolution: float = parameter(0.0, unit='N', lower=0.0, upper=1e5, description='Likewise.')
    position_resolution: float = parameter(0.0, unit='m', lower=0.0, upper=0.1, description='Likewise.')
    delay: float = parameter(
        0.0, unit='s', lower=0.0, upper=1.0, description='A sample is sent so long after it was measured.'
    )
    drop_out: float = parameter(
        0.0, unit='1', lower=0.0, upper=1.0, description='Share of the samples of each sensor that are never sent.'
    )
    seed: int = parameter(0, unit='', lower=0, upper=2**31 - 1, description='Of the random numbers.')

    def __post_init__(self) -> None:
        check(self)


class Readings(NamedTuple):
    """One sample of each sensor; None for one that is never sent."""

    pressure: tuple[float, float] | None
    """[Pa, gauge] chamber a and b"""
    velocity: float | None
    """[m/s]"""
    force_sum: float | None
    """[N]"""
    position: float | None
    """[m]"""


def read(settings: SensorSettings, index: int, truth: Readings) -> Readings:
    r"""What the sensors say of sample ``index``: the same for the same settings, index and truth.

    .. math:: y = r \, \mathrm{round}((x + \sigma n) / r)

    with n from a standard normal distribution. White noise and a drop-out of each sensor by itself are our choice.
    """
    row, drops = _random(settings.seed, index // _BLOCK)
    n, lost = row[index % _BLOCK], drops[index % _BLOCK]
    pressure, velocity, force_sum, position = truth
    share = settings.drop_out
    sigma, step = settings.pressure_noise, settings.pressure_resolution
    return Readings(
        None
        if pressure is None or lost[0] < share
        else (_rounded(pressure[0] + sigma * n[0], step), _rounded(pressure[1] + sigma * n[1], step)),
        None
        if velocity is None or lost[1] < share
        else _rounded(velocity + settings.velocity_noise * n[2], settings.velocity_resolution),
        None
        if force_sum is None or lost[2] < share
        else _rounded(force_sum + settings.force_noise * n[3], settings.force_resolution),
        None
        if position is None or lost[3] < share
        else _rounded(position + settings.position_noise * n[4], settings.position_resolution),
    )


def _rounded(value: float, step: float) -> float:
    return step * round(value / step) if step else value


@lru_cache(maxsize=4)
def _random(seed: int, block: int) -> tuple[list[list[float]], list[list[float]]]:
    """Noise and drop-outs of the samples of a block, as lists: ten times faster to read one by one than arrays."""
    generator = np.random.default_rng([seed, block])
    return generator.standard_normal((_BLOCK, 5)).tolist(), generator.random((_BLOCK, 4)).tolist()
