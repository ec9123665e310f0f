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
    relaxed,
    shear,
)

LONGEST_STEP = 0.05  # [s] after a longer gap nobody knows how far the rod went
SETTLED = 0.95  # [-] of the sliding friction, from which on the rod counts as sliding
BAND = 2.0  # [-] standard deviations by which the softer seals are softer
LEAST_STD = 0.15  # [-] of the stiffness: elements of one power law miss a seal of another structure by as much
NOISE = 0.01  # [-] of the friction, to which the seals of a rod at rest bear the force sum
LEAST_SOFTNESS = 0.2  # [-] stiffness of the softer seals over that of the file, at least


class FollowedElasticity(NamedTuple):
    """Elasticity of all seals of an actuator, and of softer ones."""

    seals: PreslidingNumbers
    softer: PreslidingNumbers
    yield_compliance: float  # [m/N] way in which every element takes up one more newton of sliding friction


class FollowedShear(NamedTuple):
    """What one sample leaves for the next."""

    stamp: int  # [ns] of the last sample; `NEVER` before the first
    velocity: float  # [m/s] of the last sample, as measured
    shear: Shear  # of the seals
    softer: Elements  # [N] of softer ones
    is_known: bool  # whether no other shear is possible
    direction: int  # -1 or 1: of the motion since the shear was not known; 0: no motion since then
    fully_sheared: float  # [N] with sign: sliding friction that all elements bear, which are 0 here; 0.0: not all yield


NOT_FOLLOWED = FollowedShear(NEVER, 0.0, NOT_SHEARED, NO_ELEMENTS, False, 0, 0.0)
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
    each = zip(softer.shares, softer.stiffnesses, strict=True)
    return FollowedElasticity(seals, softer, max(share / stiffness for share, stiffness in each if stiffness > 0.0))


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
    last_stamp, last_velocity, sheared, softer, is_known, last_direction, full = state
    stamp, velocity, direction, _, knows_force_sum, coulomb, velocity_friction, stiction = moment
    elapsed = (stamp - last_stamp) * 1e-9 if last_stamp != NEVER else 0.0
    if last_stamp == NEVER:
        full, sheared = direction * (coulomb + velocity_friction), Shear(NO_ELEMENTS, velocity_friction)
    elif not 0.0 <= elapsed <= LONGEST_STEP:
        is_known, last_direction, elapsed = False, 0, 0.0
    displacement = 0.5 * (last_velocity + velocity) * elapsed
    if is_known and full * direction > 0.0 and displacement * direction > 0.0:  # most samples: three times as fast
        excess = sheared.excess
        stretch = (coulomb + excess - abs(full)) * elasticity.seals.shares.last / elasticity.seals.stiffnesses.last
        length = between(0.0, abs(displacement) - stretch, abs(displacement))  # as `presliding.gross_sliding`
        excess = relaxed(excess, velocity_friction, length, elasticity.seals.memory_length)
        sliding = between(0.0, coulomb + excess, math.inf)
        if (sliding - abs(full)) * elasticity.yield_compliance <= abs(displacement):
            full = direction * sliding
            state = FollowedShear(stamp, velocity, Shear(NO_ELEMENTS, excess), NO_ELEMENTS, True, direction, full)
            return state, ShearedFriction(full, 0.0, True)
    if full != 0.0:
        sheared = Shear(_fully_sheared(elasticity.seals, full), sheared.excess)
        softer = _fully_sheared(elasticity.softer, full)
    if direction == 0:
        sheared, softer = _held(elasticity, sheared, softer, moment, elapsed)
        return FollowedShear(stamp, velocity, sheared, softer, is_known and knows_force_sum, 0, 0.0), NO_FRICTION
    slide = Slide(displacement, elapsed, coulomb, velocity_friction, stiction)
    sheared, force = shear(elasticity.seals, sheared, slide)
    sliding = between(0.0, coulomb + sheared.excess, math.inf)
    if not is_known and direction != last_direction:
        softer = _fully_sheared(elasticity.softer, -direction * sliding)
    softer, softer_force = element_forces(elasticity.softer, softer, displacement, sliding)
    slides = force * direction >= SETTLED * sliding and softer_force * direction >= SETTLED * sliding
    is_known = is_known or slides
    full = 0.0
    if is_known and force == softer_force and abs(force) == sliding:
        full, sheared, softer = force, Shear(NO_ELEMENTS, sheared.excess), NO_ELEMENTS
    state = FollowedShear(stamp, velocity, sheared, softer, is_known, direction, full)
    return state, ShearedFriction(force, 0.5 * abs(force - softer_force), slides)


@compilable
def _held(
    elasticity: FollowedElasticity, sheared: Shear, softer: Elements, moment: Moment, elapsed: float
) -> tuple[Shear, Elements]:
    """Seals of a rod at rest, ``elapsed`` [s] after the sample before, sheared until they bear the force sum.

    They stay as they are while the force sum is within `NOISE` of what they bear. Each pass shears them as far as the
    elements that do not yield need, so one more may yield in each.
    """
    forces, excess = sheared
    excess = relaxed(excess, moment.stiction, elapsed, elasticity.seals.dwell_time)
    f1, f2, f3, f4, f5, f6 = forces
    breakaway = moment.coulomb_friction + moment.stiction
    further = between(-breakaway, moment.force_sum, breakaway) - (f1 + f2 + f3 + f4 + f5 + f6)
    if not moment.knows_force_sum or abs(further) <= NOISE * breakaway:
        return Shear(forces, excess), softer
    sliding, wanted = moment.coulomb_friction + excess, f1 + f2 + f3 + f4 + f5 + f6 + further
    share = elasticity.seals.stiffness / elasticity.softer.stiffness  # the same force
    for _ in range(SLOTS):
        stiffness = _stiffness(elasticity.seals, forces, further, sliding)
        if stiffness == 0.0 or abs(further) <= 1e-9 * breakaway:
            break
        forces, force = element_forces(elasticity.seals, forces, further / stiffness, sliding)
        softer, _ = element_forces(elasticity.softer, softer, share * further / stiffness, sliding)
        further = wanted - force
    return Shear(forces, excess), softer


@compilable
def _stiffness(elasticity: PreslidingNumbers, forces: Elements, direction: float, friction: float) -> float:
    """Stiffness [N/m] of the elements that do not yield in a direction, at a sliding friction [N]."""
    stiffness = 0.0
    for i in range(SLOTS):
        force = forces[i] if direction > 0.0 else -forces[i]
        if force < (1.0 - 1e-9) * elasticity.shares[i] * friction:
            stiffness += elasticity.stiffnesses[i]
    return stiffness


@compilable
def _fully_sheared(elasticity: PreslidingNumbers, friction: float) -> Elements:
    """Forces of elements that all yield [N], with their sum."""
    w1, w2, w3, w4, w5, w6 = elasticity.shares
    return Elements(w1 * friction, w2 * friction, w3 * friction, w4 * friction, w5 * friction, w6 * friction)
