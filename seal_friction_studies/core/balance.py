"""Velocity at which the spring of the groove and the friction of the wall balance."""

import math
from collections.abc import Callable

from scipy.optimize import brentq

LARGEST_RATIO = 1e6  # [-] of a sliding velocity to the speed of the motion: beyond, nothing holds the seal (our choice)


def sliding_velocity(
    drive: float, solid: float, fluid_at: Callable[[float], float], spring_at: Callable[[float], float], fastest: float
) -> float:
    """Velocity at which spring and friction balance, if the seal does not stick.

    solid sign(v) + fluid(v) = spring(v), the film held. The left side rises with v and the right side falls, so there
    is one solution between 0 and whatever the spring could drive.

    Args:
        drive: Force of the spring if the seal stuck [N], of a magnitude above ``solid``.
        solid: Magnitude of the solid friction [N].
        fluid_at: Fluid friction [N] against a sliding velocity [m/s].
        spring_at: Force of the spring [N] after a step at a sliding velocity [m/s].
        fastest: A speed to begin the search with [m/s].

    Raises:
        ValueError: There is no balance below `LARGEST_RATIO` times ``fastest``.
    """
    direction = math.copysign(1.0, drive)

    def surplus(speed: float) -> float:
        return direction * (spring_at(direction * speed) - fluid_at(direction * speed)) - solid

    high = fastest
    while surplus(high) > 0.0:
        if high >= LARGEST_RATIO * fastest:
            raise ValueError(
                f'no sliding velocity below {high:.3g} m/s balances {drive:.4g} N: is the seal held at all?'
            )
        high = min(2.0 * high, LARGEST_RATIO * fastest)
    return direction * float(brentq(surplus, 0.0, high, xtol=1e-9 * fastest))
