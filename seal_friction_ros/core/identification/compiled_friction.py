"""Compiled friction of many readings."""

from typing import Any

import numpy as np

from seal_friction_ros.core.foundation.arrays import FloatArray, IntArray
from seal_friction_ros.core.foundation.compiled import compiled
from seal_friction_ros.core.friction.actuator import sliding_friction_of_seals


@compiled
def sum_over_seals(seal: Any, pressure: FloatArray, speed: FloatArray, direction: IntArray) -> FloatArray:
    """Friction [N] of k seals of one kind, shape (n,).

    Args:
        seal: The seal, as compiled code takes it.
        pressure: [Pa, gauge] of each seal, shape (n, k).
        speed: [m/s, >= 0] shape (n,).
        direction: -1 or 1, shape (n,).
    """
    total = np.zeros(len(speed))
    for i in range(pressure.shape[0]):
        for k in range(pressure.shape[1]):
            p = pressure[i, k]
            total[i] += sliding_friction_of_seals(seal, p, p, speed[i], direction[i])
    return total
