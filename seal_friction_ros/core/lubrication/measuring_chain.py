"""What a force transducer on a flexible rod makes of a friction force."""

import math
from dataclasses import dataclass

import numpy as np

from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.foundation.parameters import check, parameter


@dataclass(frozen=True)
class MeasuringChain:
    """Transducer, joint and rod as one oscillator: F'' + 2 D w F' + w^2 F = w^2 F_friction.

    Raises:
        ValueError: A value is out of bounds.

    Source: spool-valve paper, section 6.2 (157 Hz); the damping is our choice.
    """

    natural_frequency: float = parameter(157.0, unit='Hz', lower=0.1, upper=1e6, description='w / 2 pi.')
    damping_ratio: float = parameter(0.05, unit='1', lower=0.0, upper=0.99, description='D.')

    def __post_init__(self) -> None:
        check(self)


def transducer_force(chain: MeasuringChain, time: FloatArray, friction: FloatArray) -> FloatArray:
    """Force that the transducer shows [N], for a friction force that is straight between its samples.

    Exact for that course, so no step is too long. The chain starts at rest under the first value.

    Args:
        chain: The chain.
        time: Increasing [s], shape (n,).
        friction: [N], shape (n,).
    """
    omega, damping = 2.0 * math.pi * chain.natural_frequency, chain.damping_ratio
    decay, ring = damping * omega, omega * math.sqrt(1.0 - damping**2)
    shown = np.empty(len(friction))
    shown[0] = friction[0]
    speed = 0.0
    for i in range(1, len(friction)):
        step = time[i] - time[i - 1]
        slope = (friction[i] - friction[i - 1]) / step
        lag = 2.0 * damping / omega * slope  # the chain trails a ramp by this
        away = shown[i - 1] - (friction[i - 1] - lag)
        away_speed = speed - slope
        fade, cosine, sine = math.exp(-decay * step), math.cos(ring * step), math.sin(ring * step)
        mixed = (away_speed + decay * away) / ring
        shown[i] = friction[i] - lag + fade * (away * cosine + mixed * sine)
        speed = slope + fade * (away_speed * cosine - (decay * mixed + ring * away) * sine)
    return shown
