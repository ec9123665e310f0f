r"""What logs can tell, before any law is fitted: whether pressure was a cause of the friction, or its effect.

Where nothing but friction loads a rod, the force sum is that of the pressures alone, and Newton makes it the friction:

.. math:: p_a A_a - p_b A_b = F + F_0

So a friction that rises with such a pressure rises by a piston area, whatever the friction depends on. Pressure then
tells nothing of the friction unless something else moves it: a load, a supply or a return line at other pressures. The
chamber that the rod empties shows that, since friction is paid by the other one.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from seal_friction_ros.core.foundation.arrays import BoolArray, FloatArray
from seal_friction_ros.core.identification.signal_preparation import Signals

ALONE = 0.05  # [-] of the friction: RMS of a force sum beside a linear function of the pressures (our choice)
MIDDLE = (0.05, 0.95)  # quantiles between which a pressure is said to move (our choice)


class FreeRod(NamedTuple):
    """A rod that only friction loads, so that its pressures are the effect of the friction."""

    areas: tuple[float, float]  # [m^2] slope of the force sum over the pressures of chambers a and b
    friction: float  # [N] half the difference of the directions
    moved: float  # [Pa] by how much the emptied chamber moved independently of the speed
    paid: float  # [Pa] pressure that the friction takes


def free_rod(logs: Sequence[Signals], even: Sequence[BoolArray]) -> FreeRod | None:
    """Whether friction alone loads the rod of some logs; None if pressures were moved by something else.

    The force sum of all logs is compared with one linear function of the pressures. If that leaves less than `ALONE` of
    the friction, the pressures contain it. They still tell its dependence on pressure, if the emptied chamber moved
    beyond what its speed explains by more than the pressure that the friction takes. Samples ``even`` are those of even
    sliding, shape (n,) of each log, in both directions.
    """
    parts = [log.taken(inside) for log, inside in zip(logs, even, strict=True)]
    velocity, a, b, force = (np.concatenate(columns) for columns in zip(*(part[1:] for part in parts), strict=True))
    out = velocity > 0.0
    if not out.any() or out.all():
        return None
    friction = float(np.median(force[out]) - np.median(force[~out])) / 2.0
    pressures = np.column_stack((a, b, np.ones(len(a))))
    slopes = np.linalg.lstsq(pressures, force, rcond=None)[0]
    rest = float(np.sqrt(np.mean((force - pressures @ slopes) ** 2)))
    area = float(np.abs(slopes[:2]).max())
    if not friction > 0.0 or rest > ALONE * friction or area <= 0.0:
        return None
    moved = max(_moved(np.where(side, emptied, np.nan), np.abs(velocity)) for side, emptied in ((out, b), (~out, a)))
    paid = friction / area
    return FreeRod((float(slopes[0]), float(slopes[1])), friction, moved, paid) if moved < paid else None


def _moved(pressure: FloatArray, speed: FloatArray) -> float:
    """Way of a pressure [Pa] beyond a line through it over the speed; NaN marks samples that do not count."""
    inside = np.isfinite(pressure)
    line = np.column_stack((np.ones(int(inside.sum())), speed[inside]))
    rest = pressure[inside] - line @ np.linalg.lstsq(line, pressure[inside], rcond=None)[0]
    low, high = np.quantile(rest, MIDDLE)
    return float(high - low)
