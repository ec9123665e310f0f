"""The fit that made the seal file of the thesis ring: the tests repeat it."""

import math
from collections.abc import Sequence
from statistics import linear_regression

from seal_friction_ros.core.friction.laws.friction_coefficient import PowerLaw


def power_law_from_points(normal_forces: Sequence[float], frictions: Sequence[float]) -> PowerLaw:
    """Power law through measured friction, by least squares of log(friction) over log(normal force).

    log f_c = log c + (1 - n) log F_n: relative deviations count alike at every pressure, as the scatter of the
    readings is a share of the reading.

    Args:
        normal_forces: Normal force of each reading [N], shape (n,), n >= 2.
        frictions: Coulomb friction of each reading [N], shape (n,).

    Raises:
        ValueError: The points make no power law (see `PowerLaw`).
    """
    x = [math.log(force) for force in normal_forces]
    y = [math.log(friction) for friction in frictions]
    slope, intercept = linear_regression(x, y)
    return PowerLaw(math.exp(intercept), 1.0 - slope)
