r"""Friction of seals that still shear: the elastic state that the estimate follows from sample to sample.

``state = NOT_FOLLOWED``, then ``state, friction = follow(elasticity, state, moment)`` for every sample.

- **The rod moves**: its seals shear by its way, :math:`\Delta x = \tfrac12 (v_0 + v)\,\Delta t`, as in
  `presliding.shear`, with the velocities as measured: those of an encoder add up to its positions.
- **The rod rests**: nothing accelerates, so the friction is the force sum, up to breakaway. That tells more than any
  way, which noise and a bias make: the elements shear until they bear it.
- **Uncertainty**: the same way also shears seals that are softer by two standard deviations of the stiffness. Half the
  difference of the two forces is the standard deviation that elasticity adds. The rod counts as sliding when both have
  come within 5 % of the sliding friction.
- **Unknown shear**: at the start, after a gap, and after a rest without a force sum the seals may be sheared in any
  way. The force is then a guess: sliding friction at the start, that of before after a gap. The softer ones begin
  fully sheared against the motion. A displacement keeps the order of the forces of an
  element, so when these slide, any seals of their stiffness do.

Source: the elements are those of `presliding`; all else is our choice.
"""

import math
from typing import NamedTuple

from seal_friction_ros.core.estimation.records import NEVER
from seal_friction_ros.core.foundation.compiled import compilable
from seal_friction_ros.core.foundation.limits import between
from seal_friction_ros.core.friction.presliding import (
    NO_ELEMENTS,
    NOT_SHEARED,
    SLOTS,
    Elements,
    PreslidingNumbers,
    Shear,
    Slide,
    element_forces,
    shear,
)

LONGEST_STEP = 0.05  # [s] after a longer gap nobody knows how far the rod went
SETTLED = 0.95  # [-] of the sliding friction, from which on the rod counts as sliding
BAND = 2.0  # [-] standard deviations by which the softer seals are softer
LEAST_STD = 0.15  # [-] of the stiffness: elements of one power law miss a seal of another structure by as much
TOLERANCE = 1e-9  # [-] of the friction, to which the seals of a rod at rest bear the force sum
LEAST_SOFTNESS = 0.2  # [-] stiffness of the softer seals over that of the file, at least


class FollowedElasticity(NamedTuple):
    """Elasticity of all seals of an actuator, and of softer ones."""

    seals: PreslidingNumbers
    softer: PreslidingNumbers


class FollowedShear(NamedTuple):
    """What one sample leaves for the next."""

    stamp: int  # [ns] of the last sample; `NEVER` before the first
    velocity: float  # [m/s] of the last sample, as measured
    shear: Shear  # of the seals
    softer: Elements  # [N] of softer ones
    is_known: bool  # whether no other shear is possible
    direction: int  # -1 or 1: of the motion since the shear was not known; 0: no motion since then


NOT_FOLLOWED = FollowedShear(NEVER, 0.0, NOT_SHEARED, NO_ELEMENTS, False, 0)
"""State before the first sample."""


class Moment(NamedTuple):
    """One sample with usable velocity and pressure."""

    stamp: int  # [ns]
    velocity: float  # [m/s] as measured
    direction: int  # -1 or 1 of the motion; 0: the rod rests
    force_sum: float  # [N]
    knows_force_sum: bool
    coulomb_friction: float  # [N]
    velocity_friction: float  # [N] that sliding adds to it
    stiction: float  # [N] that breakaway adds to it


class ShearedFriction(NamedTuple):
    """Friction of the seals while the rod moves."""

    force: float  # [N] with its sign
    std: float  # [N] of the force, from the stiffness
    slides: bool  # whether the seals slide, all but 5 %, also softer ones


NO_FRICTION = ShearedFriction(0.0, 0.0, False)


def followed_elasticity(seals: PreslidingNumbers, relative_std: float) -> FollowedElasticity:
    """Elasticity to follow.

    Args:
        seals: Of all seals together.
        relative_std: Relative standard deviation of their stiffness.
    """
    softness = max(1.0 - BAND * max(relative_std, LEAST_STD), LEAST_SOFTNESS)
    softer = seals._replace(
        stiffness=softness * seals.stiffness, stiffnesses=Elements(*(softness * k for k in seals.stiffnesses))
    )
    return FollowedElasticity(seals, softer)


@compilable
def follow(
    elasticity: FollowedElasticity, state: FollowedShear, moment: Moment
) -> tuple[FollowedShear, ShearedFriction]:
    """Friction at one sample; `NO_FRICTION` at rest, where the force sum tells it.

    Args:
        elasticity: Of the seals.
        state: `NOT_FOLLOWED` or the state before.
        moment: The sample.
    """
    last_stamp, last_velocity, sheared, softer, is_known, last_direction = state
    elapsed = (moment.stamp - last_stamp) * 1e-9 if last_stamp != NEVER else 0.0
    if last_stamp == NEVER:
        sliding = moment.direction * (moment.coulomb_friction + moment.velocity_friction)
        sheared = Shear(_fully_sheared(elasticity.seals, sliding), moment.velocity_friction)
    elif not 0.0 <= elapsed <= LONGEST_STEP:
        is_known, last_direction, elapsed = False, 0, 0.0
    if moment.direction == 0:
        sheared, softer = _held(elasticity, sheared, softer, moment, elapsed)
        is_known = is_known and moment.knows_force_sum
        return FollowedShear(moment.stamp, moment.velocity, sheared, softer, is_known, 0), NO_FRICTION
    displacement = 0.5 * (last_velocity + moment.velocity) * elapsed
    slide = Slide(displacement, elapsed, moment.coulomb_friction, moment.velocity_friction, moment.stiction)
    sheared, force = shear(elasticity.seals, sheared, slide)
    sliding = between(0.0, moment.coulomb_friction + sheared.excess, math.inf)
    if not is_known and moment.direction != last_direction:
        softer = _fully_sheared(elasticity.softer, -moment.direction * sliding)
    softer, softer_force = element_forces(elasticity.softer, softer, displacement, sliding)
    enough = SETTLED * sliding
    slides = force * moment.direction >= enough and softer_force * moment.direction >= enough
    state = FollowedShear(moment.stamp, moment.velocity, sheared, softer, is_known or slides, moment.direction)
    return state, ShearedFriction(force, 0.5 * abs(force - softer_force), slides)


@compilable
def _held(
    elasticity: FollowedElasticity, sheared: Shear, softer: Elements, moment: Moment, elapsed: float
) -> tuple[Shear, Elements]:
    """Seals of a rod at rest, ``elapsed`` [s] after the sample before, sheared until they bear the force sum.

    Each pass shears them as far as the elements that do not yield need, so one more may yield in each.
    """
    sheared, force = shear(
        elasticity.seals, sheared, Slide(0.0, elapsed, moment.coulomb_friction, 0.0, moment.stiction)
    )
    breakaway = moment.coulomb_friction + moment.stiction
    held = between(-breakaway, moment.force_sum, breakaway)
    for _ in range(SLOTS):
        further = held - force
        sliding = moment.coulomb_friction + sheared.excess
        stiffness = _stiffness(elasticity.seals, sheared.forces, further, sliding)
        if not moment.knows_force_sum or abs(further) <= TOLERANCE * breakaway or stiffness == 0.0:
            break
        slide = Slide(further / stiffness, 0.0, moment.coulomb_friction, 0.0, moment.stiction)
        sheared, force = shear(elasticity.seals, sheared, slide)
        share = elasticity.seals.stiffness / elasticity.softer.stiffness  # the same force
        softer, _ = element_forces(elasticity.softer, softer, share * slide.displacement, sliding)
    return sheared, softer


@compilable
def _stiffness(elasticity: PreslidingNumbers, forces: Elements, direction: float, friction: float) -> float:
    """Stiffness [N/m] of the elements that do not yield in a direction, at a sliding friction [N]."""
    stiffness = 0.0
    for i in range(SLOTS):
        force = forces[i] if direction > 0.0 else -forces[i]
        if force < (1.0 - TOLERANCE) * elasticity.shares[i] * friction:
            stiffness += elasticity.stiffnesses[i]
    return stiffness


@compilable
def _fully_sheared(elasticity: PreslidingNumbers, friction: float) -> Elements:
    """Forces of elements that all yield [N], with their sum."""
    w1, w2, w3, w4, w5, w6 = elasticity.shares
    return Elements(w1 * friction, w2 * friction, w3 * friction, w4 * friction, w5 * friction, w6 * friction)
