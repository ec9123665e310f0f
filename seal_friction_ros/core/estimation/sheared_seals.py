r"""Friction of seals that still shear: the elastic state that the estimate follows from sample to sample.

``state = NOT_FOLLOWED``, then `slide_on` for every sample of a rod that moves, and `shear_on` for all others.

- **The rod moves**: its seals shear by its way, :math:`\Delta x = \tfrac12 (v_0 + v)\,\Delta t`, as in
  `presliding.shear`, with the velocities as measured: those of an encoder add up to its positions. While the seals
  slide, a way back is kept until the direction turns: it may be noise.
- **The rod rests**: after `REST` nothing accelerates any more, so the friction is the force sum, up to breakaway. That
  tells more than any way: the elements shear until they bear it. Before that, as in a reversal, the way still counts;
  with a known inertia the seals bear the force sum at once, but the softer ones, below, still follow the way.
- **Uncertainty**: the same way also shears seals that are softer, by two standard deviations of the stiffness and by
  what one set of elements may miss of seals under unlike pressures. Half the difference of the two forces is the
  standard deviation that elasticity adds. The rod counts as sliding when both have come within 5 % of their sliding
  friction.
- **Unknown shear**: at the start, after a gap, and after a rest without a force sum the seals may be sheared in any
  way. So they may after a rest without a known inertia, since part of the force sum accelerates a rod that is about to
  start, and after one that began while they sheared: the force sum does not tell which element bears it. The force is
  then a guess: sliding friction at the start, the force sum after a rest, that of before after a gap. The softer seals
  begin fully sheared against the motion, with all of their stiction. A way keeps the order of the forces of an element,
  so when these slide, any seals do.

Source: the elements are those of `presliding`; all else is our choice.
"""

import math
from typing import NamedTuple

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
from seal_friction_ros.core.messages.records import NEVER

REST = 100_000_000  # [ns] after which a rod at rest does not accelerate
SHORT_GAP = 0.01  # [s] over which the way is that of the velocities at both ends,
PERIODS = 3.0  # or so many times the last sample period, if that is longer,
LONGEST_GAP = 0.1  # [s] but no longer gap
SETTLED = 0.95  # [-] of the sliding friction, from which on the rod counts as sliding
BAND = 2.0  # [-] standard deviations by which the softer seals are softer
LEAST_STD = 0.15  # [-] of the stiffness: elements of one power law miss a seal of another structure by as much
LEAST_SOFTNESS = 0.1  # [-] stiffness of the softer seals over that of the file, at least
NOISE = 0.01  # [-] of the friction, to which the seals of a rod at rest bear the force sum
EQUAL = 1e-3  # [-] of the friction, to which seals and softer seals are the same


class FollowedElasticity(NamedTuple):
    """Elasticity of all seals of an actuator, and of softer ones."""

    seals: PreslidingNumbers
    softer: PreslidingNumbers
    yield_compliance: float  # [m/N] way in which every element takes up one more newton of sliding friction


class FollowedShear(NamedTuple):
    """What one sample leaves for the next."""

    stamp: int  # [ns] of the last sample; `NEVER` before the first
    velocity: float  # [m/s] of the last sample, as measured
    elapsed: float  # [s] between the last two samples
    seals: Shear
    softer: Shear
    is_known: bool  # whether no other shear is possible
    direction: int  # -1 or 1 of the last motion; 0: none since the shear was not known, or since a rest
    rest_since: int  # [ns] stamp; `NEVER` while the rod moves
    fully_sheared: float  # [N] with sign: sliding friction that all elements bear, which are 0 here; 0.0: not all yield
    way_back: float  # [m] of seals that slide, against their direction
    rests_alike: bool = False  # whether seals and softer seals were sheared alike when the rest began


NOT_FOLLOWED = FollowedShear(NEVER, 0.0, 0.0, NOT_SHEARED, NOT_SHEARED, False, 0, NEVER, 0.0, 0.0, False)
"""State before the first sample."""


class Moment(NamedTuple):
    """One sample with usable velocity and pressure."""

    stamp: int  # [ns]
    velocity: float  # [m/s] as measured
    direction: int  # -1 or 1 of the motion; 0: the rod rests
    force_sum: float  # [N] without what is known not to be friction
    knows_force_sum: bool
    knows_inertia: bool  # whether the force sum is without inertia, so that it is the friction also in a reversal
    coulomb_friction: float  # [N]
    velocity_friction: float  # [N] that sliding adds to it
    stiction: float  # [N] that breakaway adds to it


class ShearedFriction(NamedTuple):
    """Friction of the seals of a rod that moves, or that moved just now."""

    is_followed: bool  # False: the rod rests, and the force sum tells the friction
    force: float  # [N] with its sign
    std: float  # [N] of the force, from the stiffness
    slides: bool  # whether the seals slide, all but 5 %, also softer ones


AT_REST = ShearedFriction(False, 0.0, 0.0, False)


def followed_elasticity(seals: PreslidingNumbers, relative_std: float, unlike: float = 1.0) -> FollowedElasticity:
    """Elasticity to follow.

    Args:
        seals: Of all seals together.
        relative_std: Relative standard deviation of their stiffness.
        unlike: How much later than all together one of the seals may slide [-], as its pressure is unlike the others'.
    """
    softness = max((1.0 - BAND * max(relative_std, LEAST_STD)) / unlike, LEAST_SOFTNESS)
    softer = seals._replace(
        stiffness=softness * seals.stiffness, stiffnesses=Elements(*(softness * k for k in seals.stiffnesses))
    )
    each = zip(softer.shares, softer.stiffnesses, strict=True)
    return FollowedElasticity(seals, softer, max(share / stiffness for share, stiffness in each if stiffness > 0.0))


@compilable
def shear_on(
    elasticity: FollowedElasticity, state: FollowedShear, moment: Moment
) -> tuple[FollowedShear, ShearedFriction]:
    """Friction at one sample where the rod rests, or where `slide_on` found that the seals do not just slide on.

    Args:
        elasticity: Of the seals.
        state: `NOT_FOLLOWED` or the state before.
        moment: The sample.
    """
    stamp, coulomb = moment.stamp, moment.coulomb_friction
    seals, softer, full = state.seals, state.softer, state.fully_sheared
    is_known, last_direction = state.is_known, state.direction
    elapsed = (stamp - state.stamp) * 1e-9 if state.stamp != NEVER else 0.0
    way = 0.5 * (state.velocity + moment.velocity) * elapsed + state.way_back
    if state.stamp == NEVER:
        full = moment.direction * between(0.0, coulomb + moment.velocity_friction, math.inf)
        seals = Shear(NO_ELEMENTS, moment.velocity_friction)
    elif not 0.0 <= elapsed <= _longest_gap(state.elapsed):
        is_known, last_direction, way = False, 0, 0.0
    elapsed = between(0.0, elapsed, LONGEST_GAP)
    rest_since, direction = _rest(stamp, moment.direction, state.rest_since, last_direction)
    bears = rest_since != NEVER and moment.knows_inertia and moment.knows_force_sum
    if rest_since != NEVER and not bears:
        slides_on, further = slide_on(
            elasticity, state, stamp, moment.velocity, direction, rest_since, coulomb, moment.velocity_friction
        )
        if slides_on:
            return further, ShearedFriction(is_followed=True, force=further.fully_sheared, std=0.0, slides=True)
    seals, softer = _with_elements(elasticity, seals, softer, full)
    alike = state.rests_alike
    if rest_since == stamp:
        alike = _are_alike(seals, softer, EQUAL * coulomb)
    full, sheared = 0.0, AT_REST
    if direction == 0:
        seals = _held(elasticity.seals, seals, moment, elapsed)
        softer = _held(elasticity.softer, softer, moment, elapsed)
        is_known = is_known and moment.knows_force_sum and moment.knows_inertia and alike
    else:
        if not is_known and direction != last_direction:
            softer = _sheared_against(elasticity.softer, moment, direction)
        slide = Slide(way, elapsed, coulomb, moment.velocity_friction, moment.stiction)
        seals, softer, sheared = _moved(elasticity, seals, softer, slide, direction)
        if bears:
            seals = _held(elasticity.seals, seals, moment, 0.0)
            sheared = _bearing(seals, softer)
        is_known = is_known or sheared.slides
        is_exact = abs(sheared.force) == coulomb + seals.excess and sheared.std <= EQUAL * abs(sheared.force)
        if sheared.slides and is_exact:
            full, seals = sheared.force, Shear(NO_ELEMENTS, seals.excess)
            softer = seals
    state = FollowedShear(
        stamp=stamp, velocity=moment.velocity, elapsed=elapsed, seals=seals, softer=softer, is_known=is_known,
        direction=direction, rest_since=rest_since, fully_sheared=full, way_back=0.0, rests_alike=alike,
    )  # fmt: skip
    return state, sheared


@compilable
def slide_on(
    elasticity: FollowedElasticity,
    state: FollowedShear,
    stamp: int,
    velocity: float,
    direction: int,
    rest_since: int,
    coulomb: float,
    velocity_friction: float,
) -> tuple[bool, FollowedShear]:
    """Whether seals that all slid still slide in their direction, and then the next state: most samples, for a third.

    Args:
        elasticity: Of the seals.
        state: Before this sample.
        stamp: [ns]
        velocity: [m/s] as measured.
        direction: -1 or 1 of the motion; 0: the rod rests.
        rest_since: [ns] stamp; `NEVER` while the rod moves.
        coulomb: Coulomb friction [N].
        velocity_friction: What sliding adds to it [N].
    """
    seals, full = state.seals, state.fully_sheared
    if not state.is_known or full * direction <= 0.0:
        return False, state
    elapsed = (stamp - state.stamp) * 1e-9
    if not (0.0 <= elapsed <= SHORT_GAP or SHORT_GAP < elapsed <= _longest_gap(state.elapsed)):
        return False, state
    way = (0.5 * (state.velocity + velocity) * elapsed + state.way_back) * direction
    excess, way_left = seals.excess, way
    if way > 0.0:
        way_left, memory_length = 0.0, elasticity.seals.memory_length
        if memory_length > 0.0:
            stretch = (coulomb + excess - abs(full)) * elasticity.seals.shares.last
            length = between(0.0, way - stretch / elasticity.seals.stiffnesses.last, way)  # `presliding.gross_sliding`
            excess = relaxed(excess, velocity_friction, length, memory_length)
        else:
            excess = velocity_friction
    sliding = coulomb + excess if coulomb + excess > 0.0 else 0.0
    if not (sliding - abs(full)) * elasticity.yield_compliance <= abs(way):
        return False, state
    if excess != seals.excess:
        seals = Shear(NO_ELEMENTS, excess)
    full, way_back = direction * sliding, direction * way_left
    return True, FollowedShear(
        stamp, velocity, elapsed, seals, seals, True, direction, rest_since, full, way_back, True
    )


@compilable
def _rest(stamp: int, direction: int, since: int, last_direction: int) -> tuple[int, int]:
    """Stamp [ns] since which the rod rests, `NEVER` if it moves, and the direction: the last one for `REST`."""
    if direction != 0:
        return NEVER, direction
    if since == NEVER:
        since = stamp
    return since, last_direction if 0 <= stamp - since < REST else 0


@compilable
def _moved(
    elasticity: FollowedElasticity, seals: Shear, softer: Shear, slide: Slide, direction: int
) -> tuple[Shear, Shear, ShearedFriction]:
    """Seals and softer seals after a way of the rod, and their friction.

    They slide if each has come within 5 % of its own sliding friction, they agree, and no stiction is left to break:
    stiffer seals may have lost it already.
    """
    seals, force = shear(elasticity.seals, seals, slide)
    softer, softer_force = shear(elasticity.softer, softer, slide)
    sliding, of_softer = slide.coulomb_friction + seals.excess, slide.coulomb_friction + softer.excess
    sliding, of_softer = sliding if sliding > 0.0 else 0.0, of_softer if of_softer > 0.0 else 0.0
    apart = abs(force - softer_force)
    slides = force * direction >= SETTLED * sliding and softer_force * direction >= SETTLED * of_softer
    slides = slides and apart <= (1.0 - SETTLED) * sliding
    if abs(force) < sliding and seals.excess - slide.sliding_excess > (1.0 - SETTLED) * sliding:
        slides = False
    return seals, softer, ShearedFriction(is_followed=True, force=force, std=0.5 * apart, slides=slides)


@compilable
def _longest_gap(period: float) -> float:
    """Longest time [s] over which the way is known, after samples ``period`` [s] apart."""
    longest = PERIODS * period if PERIODS * period > SHORT_GAP else SHORT_GAP
    return longest if longest < LONGEST_GAP else LONGEST_GAP


@compilable
def _held(elasticity: PreslidingNumbers, sheared: Shear, moment: Moment, elapsed: float) -> Shear:
    """Seals of a rod at rest, for ``elapsed`` [s] since the sample before, sheared until they bear the force sum.

    They stay as they are while the force sum is within `NOISE` of what they bear. Each pass shears them as far as the
    elements that do not yield need, so one more may yield in each.
    """
    forces, excess = sheared
    if elapsed > 0.0:
        excess = relaxed(excess, moment.stiction, elapsed, elasticity.dwell_time)
    breakaway = between(0.0, moment.coulomb_friction + moment.stiction, math.inf)
    wanted = between(-breakaway, moment.force_sum, breakaway)
    further = wanted - _total(forces)
    if not moment.knows_force_sum or abs(further) <= NOISE * breakaway:
        return Shear(forces, excess)
    sliding = between(0.0, moment.coulomb_friction + excess, math.inf)
    for _ in range(SLOTS):
        stiffness = _stiffness(elasticity, forces, further, sliding)
        if stiffness == 0.0 or abs(further) <= 1e-9 * breakaway:
            break
        forces, force = element_forces(elasticity, forces, further / stiffness, sliding)
        further = wanted - force
    return Shear(forces, excess)


@compilable
def _bearing(seals: Shear, softer: Shear) -> ShearedFriction:
    """Friction of seals that bear the force sum in a reversal, while softer ones follow the way."""
    force = _total(seals.forces)
    return ShearedFriction(is_followed=True, force=force, std=0.5 * abs(force - _total(softer.forces)), slides=False)


@compilable
def _total(forces: Elements) -> float:
    """Force of all elements [N]."""
    total = 0.0
    for i in range(SLOTS):
        total += forces[i]
    return total


@compilable
def _with_elements(elasticity: FollowedElasticity, seals: Shear, softer: Shear, full: float) -> tuple[Shear, Shear]:
    """Seals and softer seals with the forces of their elements, which are not kept where all bear ``full`` [N]."""
    if full == 0.0:
        return seals, softer
    excess = seals.excess
    return Shear(_fully_sheared(elasticity.seals, full), excess), Shear(_fully_sheared(elasticity.softer, full), excess)


@compilable
def _are_alike(seals: Shear, softer: Shear, most: float) -> bool:
    """Whether each element of seals and softer seals bears the same force, to ``most`` [N]."""
    apart = 0.0
    for i in range(SLOTS):
        apart = max(apart, abs(seals.forces[i] - softer.forces[i]))
    return apart <= most


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
def _sheared_against(elasticity: PreslidingNumbers, moment: Moment, direction: int) -> Shear:
    """Seals that are fully sheared against a motion, with all of their stiction: none slide later."""
    most = between(0.0, moment.coulomb_friction + moment.stiction, math.inf)
    return Shear(_fully_sheared(elasticity, -direction * most), moment.stiction)


@compilable
def _fully_sheared(elasticity: PreslidingNumbers, friction: float) -> Elements:
    """Forces of elements that all yield [N], with their sum."""
    shares = elasticity.shares
    return Elements(
        first=shares.first * friction, second=shares.second * friction, third=shares.third * friction,
        fourth=shares.fourth * friction, fifth=shares.fifth * friction, last=shares.last * friction,
    )  # fmt: skip
