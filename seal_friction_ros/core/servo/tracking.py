"""Tracking quality of a servo: error, dwell at reversal, limit cycle."""

import math

import numpy as np

from seal_friction_ros.core.foundation.arrays import FloatArray


def tracking_rms(reference: FloatArray, position: FloatArray) -> float:
    """Root mean square of the tracking error [m]; both of shape (n,) [m]."""
    return math.sqrt(float(np.mean((reference - position) ** 2)))


def reversal_rms(reference: FloatArray, position: FloatArray) -> float:
    """Root mean square error near the reversals [m]: where the reference is in the outer tenths of its range.

    Unlike the dwell it holds for a rod on elastic seals, which never rests. The tenths are our choice. Both are of
    shape (n,) [m], the reference is that of a periodic motion.
    """
    middle, half = 0.5 * (reference.max() + reference.min()), 0.5 * np.ptp(reference)
    outer = np.abs(reference - middle) >= 0.8 * half
    return tracking_rms(reference[outer], position[outer])


def error_area(reference: FloatArray, position: FloatArray, period: float, turns: int) -> float:
    """Integral of the magnitude of the error over time, per reversal [m s]; both of shape (n,) [m], ``period`` [s]."""
    return float(np.abs(reference - position).sum()) * period / turns


def tracking_peak(reference: FloatArray, position: FloatArray) -> float:
    """Largest tracking error [m]; both of shape (n,) [m]."""
    return float(np.abs(reference - position).max())


def dwell_per_reversal(velocity: FloatArray, period: float, standstill: float = 0.0) -> float:
    """Mean rest per reversal of direction [s]; 0.0 without a reversal.

    A rest between motions in opposite directions is a reversal; so is a change of sign without a sample at rest, with a
    dwell of zero. A rest between motions in one direction and a rest at either end of the record do not count. The
    velocity is of shape (n,) [m/s], the ``period`` the sample time [s]. At and below the speed ``standstill`` [m/s] the
    rod rests; 0.0 for a simulated rod, whose rest is exact.
    """
    direction = np.where(np.abs(velocity) > standstill, np.sign(velocity), 0.0)
    moving = np.flatnonzero(direction)
    turns = direction[moving[1:]] != direction[moving[:-1]]
    if not turns.any():
        return 0.0
    resting = np.diff(moving)[turns] - 1
    return float(resting.mean()) * period


def reversals(velocity: FloatArray, standstill: float = 0.0) -> int:
    """Number of changes of direction; at a constant reference each of them is part of a limit cycle."""
    direction = np.sign(velocity[np.abs(velocity) > standstill])
    return int(np.count_nonzero(direction[1:] != direction[:-1]))
