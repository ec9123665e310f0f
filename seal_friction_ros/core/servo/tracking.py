"""How well a servo tracks: error, dwell at reversal, limit cycle."""

import math

import numpy as np

from seal_friction_ros.core.foundation.arrays import FloatArray


def tracking_rms(reference: FloatArray, position: FloatArray) -> float:
    """Root mean square of the tracking error [m]; both of shape (n,) [m]."""
    return math.sqrt(float(np.mean((reference - position) ** 2)))


def tracking_peak(reference: FloatArray, position: FloatArray) -> float:
    """Largest tracking error [m]; both of shape (n,) [m]."""
    return float(np.abs(reference - position).max())


def dwell_per_reversal(velocity: FloatArray, period: float, standstill: float = 0.0) -> float:
    """Mean time at rest per reversal of direction [s].

    A stretch at rest between motion one way and the other is a reversal; so is a change of sign without a sample at
    rest, with a dwell of zero. Rest within a motion one way, and at both ends of the record, is left out.

    Args:
        velocity: Rod velocity [m/s], shape (n,).
        period: Time between two samples [s].
        standstill: Speed at and below which the rod rests [m/s]; 0.0 for a simulated rod, which rests exactly.

    Returns:
        0.0 if there is no reversal.
    """
    direction = np.where(np.abs(velocity) > standstill, np.sign(velocity), 0.0)
    moving = np.flatnonzero(direction)
    turns = direction[moving[1:]] != direction[moving[:-1]]
    if not turns.any():
        return 0.0
    resting = np.diff(moving)[turns] - 1
    return float(resting.mean()) * period


def reversals(velocity: FloatArray, standstill: float = 0.0) -> int:
    """How often the direction of motion changes; at a constant reference every one is part of a limit cycle."""
    direction = np.sign(velocity[np.abs(velocity) > standstill])
    return int(np.count_nonzero(direction[1:] != direction[:-1]))
