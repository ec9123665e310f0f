"""Sliding, breakaway or stuck: the friction that acts, from Coulomb friction, velocity and force sum."""

from enum import IntEnum
from typing import NamedTuple

from seal_friction_ros.core.foundation.compiled import compilable


class FrictionState(IntEnum):
    """Friction state of the thesis, chapter 7; with ``direction`` these are its six states, and UNKNOWN."""

    UNKNOWN = 0
    SLIDING = 1
    BREAKAWAY = 2
    STUCK = 3


UNKNOWN, SLIDING, BREAKAWAY, STUCK = (int(state) for state in FrictionState)


class StateFriction(NamedTuple):
    """Friction that acts on the rod, and why."""

    state: int  # a `FrictionState`
    direction: int  # -1, 0 or 1
    friction_force: float  # [N] ``m a = force_sum - friction_force``


@compilable
def sign(x: float) -> int:
    """-1, 0 or 1."""
    return (x > 0.0) - (x < 0.0)


@compilable
def is_at_rest(velocity: float, was_at_rest: bool, stick_velocity: float, slip_velocity: float) -> bool:
    """Whether a measured velocity counts as V = 0, with hysteresis.

    A rod comes to rest at ``|V| <= stick_velocity`` and leaves rest at ``|V| > slip_velocity``, which is not below it,
    both in [m/s]. With both zero this is the thesis's ``V = 0`` exactly.

    Source: thesis, chapter 7, for V = 0; the band with hysteresis, as in [Karnopp1985]_, is our choice.
    """
    return abs(velocity) <= (slip_velocity if was_at_rest else stick_velocity)


@compilable
def state_friction(
    velocity: float, force_sum: float, at_rest: bool, coulomb_friction: float, breakaway_force: float
) -> StateFriction:
    r"""Friction force in its six states (three, in two directions).

    .. math::
        F_f = \begin{cases} f_c\,\mathrm{sgn}(V) & \text{sliding} \\
        f_b\,\mathrm{sgn}(\Sigma F) & \text{at rest, } |\Sigma F| \ge f_b \text{: breakaway} \\
        \Sigma F & \text{at rest, } |\Sigma F| < f_b \text{: stuck} \end{cases}

    with the rod velocity V [m/s], at rest by `is_at_rest`, the sum of the axial forces except seal friction, and both
    frictions [N]. f_b = f_c gives the thesis's equation, f_b = f_c + stiction its measured static friction.

    Source: thesis, chapter 7 and Figure 21; f_b above f_c from the static readings of Tables A-1 to A-3.
    """
    if not at_rest:
        direction = sign(velocity)
        return StateFriction(SLIDING, direction, coulomb_friction * direction)
    direction = sign(force_sum)
    if abs(force_sum) >= breakaway_force:
        return StateFriction(BREAKAWAY, direction, breakaway_force * direction)
    return StateFriction(STUCK, direction, force_sum)
