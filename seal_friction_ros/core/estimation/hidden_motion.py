r"""Whether what passes for ripple of the velocity at rest is a motion: the force sum of a rod that moves goes with it.

Where the conditioned velocity denies the direction of the measured one, as at rest, the measured one is ripple of an
encoder, or the rod vibrates. Ripple has nothing to do with the force sum. A rod that vibrates turns work into heat, and
its inertia shows, too: so over `MEMORY` the covariance of the force sum F with the velocity u that is denied,

.. math:: \left|\overline{(F - \bar F)(u - \bar u)}\right| > \lambda f_c\,\overline{|u|}

tells that the rod moves.

Source: energy balance; all numbers are our choice.
"""

from typing import NamedTuple

from seal_friction_ros.core.foundation.compiled import compilable

MEMORY = 0.2  # [s]
LEAST_SHARE = 0.25  # [-] lambda
DOUBT = 0.5  # [s] for which a motion is believed once it is found, as the inertia hides it at times
LEAST_PART = 0.2  # [-] of the measured speed that must be denied: the play of the velocity takes some at each reversal
LEAST_SPEED = 0.1  # [-] of the slip velocity, below which the mean speed is none
LONGEST_STEP = 0.02  # [s] a longer time between two samples counts as this one


class HiddenMotion(NamedTuple):
    """Means over `MEMORY`."""

    force_sum: float = 0.0  # [N]
    velocity: float = 0.0  # [m/s] of what is denied
    work: float = 0.0  # [W] covariance of both
    speed: float = 0.0  # [m/s] mean magnitude of what is denied
    total: float = 0.0  # [m/s] mean magnitude of the measured velocity
    doubt: float = 0.0  # [s] for which a motion that was found is believed yet


NO_HIDDEN_MOTION = HiddenMotion()


class Apparent(NamedTuple):
    """One sample."""

    elapsed: float  # [s] since the sample before
    measured: float  # [m/s]
    conditioned: float  # [m/s] the velocity that counts; 0.0 at rest
    force_sum: float  # [N]
    friction: float  # [N] Coulomb friction


@compilable
def with_sample(known: HiddenMotion, newest: Apparent, slip_velocity: float) -> HiddenMotion:
    """Means after one sample; a velocity of no more than ``slip_velocity`` [m/s] is none."""
    is_denied = newest.measured * newest.conditioned <= 0.0 and abs(newest.measured) > slip_velocity
    denied = newest.measured if is_denied else 0.0
    step = newest.elapsed if 0.0 < newest.elapsed < LONGEST_STEP else LONGEST_STEP
    share = step / (step + MEMORY)
    force = known.force_sum + share * (newest.force_sum - known.force_sum)
    velocity = known.velocity + share * (denied - known.velocity)
    work = known.work + share * ((newest.force_sum - force) * (denied - velocity) - known.work)
    speed = known.speed + share * (abs(denied) - known.speed)
    total = known.total + share * (abs(newest.measured) - known.total)
    doubt = known.doubt - step if known.doubt > step else 0.0
    # While the rod slides, what is denied is against the motion, and so by itself against the friction.
    shown = work if newest.conditioned != 0.0 else abs(work)
    is_much = speed > LEAST_SPEED * slip_velocity and speed > LEAST_PART * total
    if is_much and shown > LEAST_SHARE * newest.friction * speed:
        doubt = DOUBT
    return HiddenMotion(force, velocity, work, speed, total, doubt)
