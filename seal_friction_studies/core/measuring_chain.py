"""Reading of a force transducer on a flexible rod for a friction force."""

import math
from dataclasses import dataclass

import numpy as np
from scipy.signal import lsim

from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.foundation.parameters import CheckedParameters, parameter


@dataclass(frozen=True)
class MeasuringChain(CheckedParameters):
    """Transducer, joint and rod as one oscillator: F'' + 2 D w F' + w^2 F = w^2 F_friction.

    Source: spool-valve paper, section 6.2 (157 Hz); the damping is our choice.
    """

    natural_frequency: float = parameter(157.0, unit='Hz', lower=0.1, upper=1e6, description='w / 2 pi.')
    damping_ratio: float = parameter(0.05, unit='1', lower=0.0, upper=0.99, description='D.')


def transducer_force(chain: MeasuringChain, time: FloatArray, friction: FloatArray) -> FloatArray:
    """Reading of the transducer [N] for a friction force that is linear between its samples.

    Exact for that force, whatever the step. The chain starts at rest under the first value.

    Args:
        chain: The chain.
        time: Increasing by equal steps [s], shape (n,).
        friction: [N], shape (n,).
    """
    omega = 2.0 * math.pi * chain.natural_frequency
    oscillator = ([omega**2], [1.0, 2.0 * chain.damping_ratio * omega, omega**2])
    _, shown, _ = lsim(oscillator, friction - friction[0], time - time[0])
    return np.atleast_1d(friction[0] + shown)
