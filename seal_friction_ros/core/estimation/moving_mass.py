r"""The moving mass by what accelerations show, and how far a force sum without inertia may be trusted.

Over a part of a stroke that ends as fast as it began the acceleration is orthogonal to every friction that is a
function g of the speed, :math:`\int a\,g(v)\,dt = \int g\,dv = 0`, and to a constant load. So it tells the mass from
both, however large they are. With r the force sum less the friction of the law, the mass m and the root mean square
:math:`\sigma` of what it leaves per acceleration are those of least squares, with a constant of its own for each part:

.. math:: m = \frac{\sum \overline{a r}}{\sum \overline{a^2}}, \quad
          \sigma^2 = \frac{\sum \overline{(r - m a)^2}}{\sum \overline{a^2}}

where the bar is the integral over the time of a part, of deviations from its means; the sum fades from part to part,
and weighs each by its mean square acceleration: what a slow stroke leaves says little of the inertia of a fast one.
:math:`\sigma |a|` is not the error of a mean, which falls with the number of strokes: what a delay, elastic seals or
friction of the position leave is the same in each of them. On real logs it decides whether a sample of an accelerated
rod is a reading at all. A load over the position counts as a mass where strokes are alike: both are no friction.
Nothing of the filter comes in, so its errors cannot feed themselves.

Source: least squares by parts of strokes; the orthogonality is the integral above. Model and numbers are our choice.
"""

import math
from typing import NamedTuple

from seal_friction_ros.core.foundation.compiled import compilable

MEMORY = 0.8  # [-] of the sums that is left after one more part (0.5: twice as many samples of machines are wrong)
SHORTEST = 0.05  # [s] of a part of a stroke that tells: fewer samples fit any mass (0: twice as many wrong ones)
UNSURE = 0.3  # [-] of the friction: most that the inertia of a reading may be off by (0.4: 93 % of a log are good)
BEYOND = 3.0  # [-] acceleration over the root mean square of those of the strokes, up to which they show it


class Accelerations(NamedTuple):
    """Sums over the time of a part of a stroke that ends as fast as it begins."""

    speed: float = 0.0  # [m/s] of its first sample
    time: float = 0.0  # [s]
    acceleration: float = 0.0  # [m/s]
    square: float = 0.0  # [m^2/s^3] of the acceleration
    force: float = 0.0  # [N s] that the law does not explain
    inertia: float = 0.0  # [N m/s] of that force times the acceleration
    force_square: float = 0.0  # [N^2 s]


NO_ACCELERATIONS = Accelerations()


class MovingMass(NamedTuple):
    """Integrals of deviations from the means of the parts of strokes, faded, each times its weight [m^2/s^4]."""

    time: float = 0.0  # [m^2/s^3]
    square: float = 0.0  # [m^4/s^7]
    inertia: float = 0.0  # [N m^3/s^5]
    force_square: float = 0.0  # [N^2 m^2/s^3]


NO_MASS = MovingMass()


class Inertia(NamedTuple):
    """Force per acceleration."""

    mass: float  # [kg]
    std: float  # [kg] root mean square of what it leaves
    shown: float  # [m/s^2] acceleration up to which the strokes show it


@compilable
def inertia_of(given: float, known: MovingMass) -> Inertia:
    """Inertia of a ``given`` mass [kg], which is taken as exact, or of the learnt one where that is 0.0."""
    if given > 0.0:
        return Inertia(given, 0.0, math.inf)
    if known.square <= 0.0:
        return Inertia(0.0, 0.0, -1.0)
    mass = known.inertia / known.square
    mass = mass if mass > 0.0 else 0.0  # a negative one is a delay or elastic seals, and stands in the deviation
    variance = (known.force_square - 2.0 * mass * known.inertia) / known.square + mass * mass
    std = math.sqrt(variance) if variance > 0.0 else 0.0
    return Inertia(mass, std, BEYOND * math.sqrt(known.square / known.time))


@compilable
def is_inertia_known(inertia: Inertia, acceleration: float, friction: float) -> bool:
    """Whether the inertia at an ``acceleration`` [m/s^2] is known well enough beside the ``friction`` [N]."""
    return abs(acceleration) <= inertia.shown and inertia.std * abs(acceleration) <= UNSURE * friction


@compilable
def accelerated(sums: Accelerations, speed: float, acceleration: float, force: float, elapsed: float) -> Accelerations:
    """Sums after one more sample; one that is slower than the first begins anew.

    Args:
        sums: Of the part of the stroke so far.
        speed: [m/s]
        acceleration: [m/s^2]
        force: Force sum less the friction of the law [N].
        elapsed: [s] that the sample stands for.
    """
    if sums.time == 0.0 or speed < sums.speed:
        sums = Accelerations(speed, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    return Accelerations(
        sums.speed, sums.time + elapsed, sums.acceleration + elapsed * acceleration,
        sums.square + elapsed * acceleration * acceleration, sums.force + elapsed * force,
        sums.inertia + elapsed * acceleration * force, sums.force_square + elapsed * force * force,
    )  # fmt: skip


@compilable
def mass_after(known: MovingMass, sums: Accelerations, speed: float) -> MovingMass:
    """What is known of the mass once the rod is slower than at the beginning of that part of its stroke."""
    if speed >= sums.speed or sums.time < SHORTEST:
        return known
    mean, force = sums.acceleration / sums.time, sums.force / sums.time
    square = sums.square - mean * sums.acceleration
    weight = square / sums.time
    if weight <= 0.0:  # an even motion shows no mass, and forgets none
        return known
    return MovingMass(
        MEMORY * known.time + weight * sums.time,
        MEMORY * known.square + weight * square,
        MEMORY * known.inertia + weight * (sums.inertia - mean * sums.force),
        MEMORY * known.force_square + weight * (sums.force_square - force * sums.force),
    )


@compilable
def followed(
    known: MovingMass, sums: Accelerations, speed: float, acceleration: float, force: float, elapsed: float
) -> tuple[MovingMass, Accelerations]:
    """What is known of the mass, and the part of the stroke, after one more sample of a sliding rod (`accelerated`)."""
    return mass_after(known, sums, speed), accelerated(sums, speed, acceleration, force, elapsed)
