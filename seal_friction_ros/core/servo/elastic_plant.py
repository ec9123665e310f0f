r"""Plant of the servo with elastic seals: the rod of `plant`, held by seals that shear before they slide.

The friction is a force over the displacement of the rod, so the rod is never held as a rigid seal holds it: it
swings on the springs of its seals, and a velocity of exactly 0 is rare. Between two inner steps the friction follows
`presliding.shear` of the displacement since the start of the step, at every stage of the Runge-Kutta step.

.. math:: m \dot v = \Sigma F - F_f(x - x_0)

Two groups of elements share the friction, for seals that are unlike each other; with ``bristle_damping`` the law is
LuGre instead, for a plant that is not the model of the feed-forward. End stops are as in `plant`, at the end of an
inner step (our choice); a cavity begins and ends within one.
"""

import math
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

from seal_friction_ros.core.foundation.compiled import compilable, for_compiler
from seal_friction_ros.core.foundation.parameters import CheckedParameters, parameter
from seal_friction_ros.core.friction.actuator import NO_SEALS, MountedSeal, friction_of_seals, sliding_friction_of_seals
from seal_friction_ros.core.friction.presliding import (
    NOT_SHEARED,
    LuGreNumbers,
    Presliding,
    PreslidingNumbers,
    Shear,
    Slide,
    lugre,
    presliding_numbers,
    shear,
    stored_energy,
)
from seal_friction_ros.core.servo.plant import Constants, PlantState, along, chamber_pressures, rates

MOST_GROUPS = 2


@dataclass(frozen=True)
class ElasticSeals(CheckedParameters):
    """Elasticity of the seals of a simulated servo."""

    first: Presliding
    second: Presliding | None = None  # of the rest of the friction; None: the first group has all of it
    first_share: float = parameter(
        1.0, unit='1', lower=0.0, upper=1.0, description='Share of the first group in the friction; 1 without second.'
    )
    bristle_damping: float = parameter(
        -1.0,
        unit='N s/m',
        lower=-1.0,
        upper=1e6,
        description='sigma_1 of LuGre with the stiffness of the first group; negative: elements.',
    )

    @property
    def stiffness(self) -> float:
        """Total stiffness before sliding [N/m]."""
        return self.first.stiffness + (self.second.stiffness if self.second else 0.0)

    @property
    def numbers(self) -> 'ElasticNumbers':
        """The parameters as numbers."""
        second = presliding_numbers([self.second or self.first])
        bristles = LuGreNumbers(self.first.stiffness, max(self.bristle_damping, 0.0))
        share = self.first_share if self.second else 1.0
        return ElasticNumbers(presliding_numbers([self.first]), second, share, self.bristle_damping >= 0.0, bristles)


def elastic_seals(seals: tuple[MountedSeal, ...]) -> ElasticSeals | None:
    """Elasticity by the seal files of an actuator: one group for each of two seals; None if no file has one.

    ValueError: only some files have one, or there are more than two seals.
    """
    found = [mounted.seal.presliding for mounted in seals if mounted.seal.presliding]
    if not found:
        return None
    if len(found) != len(seals) or len(found) > MOST_GROUPS:
        taken = 'the simulated servo takes one or two seals, each with presliding'
        raise ValueError(f'{len(found)} of {len(seals)} seal files have presliding: {taken}')
    return ElasticSeals(found[0], found[1] if len(found) > 1 else None, 1.0 / len(found))


RIGID, ELEMENTS, LUGRE = 'rigid', 'elements', 'lugre'
ELASTICITIES = (RIGID, ELEMENTS, LUGRE)
"""Seals of a simulated servo: rigid, those of the seal files, or LuGre as stiff as those: another structure."""


def seals_of_plant(elasticity: str, seals: tuple[MountedSeal, ...], mass: float) -> ElasticSeals | None:
    r"""Elasticity by its name in `ELASTICITIES`; None for rigid seals.

    The bristles of LuGre damp the mass [kg] on them to half of critical, :math:`\sigma_1 = \sqrt{K m}` (our choice).
    ValueError: the seal files do not tell the elasticity.
    """
    if elasticity == RIGID:
        return None
    found = elastic_seals(seals)
    if found is None:
        hint = f'identify it (seal_friction identify --presliding), or take {RIGID} seals'
        raise ValueError(f'seals {elasticity}: no seal file has presliding: {hint}')
    if elasticity == ELEMENTS:
        return found
    whole = replace(found.first, stiffness=found.stiffness)
    return ElasticSeals(whole, bristle_damping=math.sqrt(found.stiffness * mass))


class ElasticNumbers(NamedTuple):
    """`ElasticSeals` as numbers."""

    first: PreslidingNumbers
    second: PreslidingNumbers
    first_share: float
    is_lugre: bool
    lugre: LuGreNumbers


class SealShear(NamedTuple):
    """State of elastic seals."""

    first: Shear
    second: Shear
    deflection: float  # [m] of the bristles of LuGre
    friction: float  # [N] that acts on the rod


NO_SHEAR = SealShear(NOT_SHEARED, NOT_SHEARED, 0.0, 0.0)


@compilable
def sheared(elastic: Any, state: SealShear, slide: Slide, velocity: float) -> SealShear:
    """State after a displacement of the rod, which has ``velocity`` [m/s] at its end."""
    displacement, elapsed, coulomb, excess, stiction = slide
    if elastic.is_lugre:
        deflection, friction = lugre(elastic.lugre, state.deflection, displacement, velocity, coulomb + excess)
        return SealShear(state.first, state.second, deflection, friction)
    share, rest = elastic.first_share, 1.0 - elastic.first_share
    slide = Slide(displacement, elapsed, share * coulomb, share * excess, share * stiction)
    first, force = shear(elastic.first, state.first, slide)
    slide = Slide(displacement, elapsed, rest * coulomb, rest * excess, rest * stiction)
    second, force_of_rest = shear(elastic.second, state.second, slide)
    return SealShear(first, second, 0.0, force + force_of_rest)


@compilable
def energy_of_seals(elastic: Any, state: SealShear) -> float:
    """Energy in the sheared seals [J]."""
    if elastic.is_lugre:
        stiffness: float = elastic.lugre.bristle_stiffness
        return 0.5 * stiffness * state.deflection * state.deflection
    energy: float = stored_energy(elastic.first, state.first) + stored_energy(elastic.second, state.second)
    return energy


@compilable
def _stage(c: Constants, elastic: Any, state: SealShear, y: Any, start: float, elapsed: float) -> SealShear:
    """Seals at a stage of a step that began at the position ``start`` [m]."""
    a, b = chamber_pressures(c.cylinder, y)
    velocity = y[1]
    at_rest = friction_of_seals(c.seals, a, b, 0.0)
    ahead = 1 if velocity > 0.0 else -1
    sliding = sliding_friction_of_seals(c.seals, a, b, abs(velocity), ahead)
    coulomb = at_rest.coulomb_friction
    stiction = at_rest.stiction + ahead * at_rest.breakaway_asymmetry
    return sheared(elastic, state, Slide(y[0] - start, elapsed, coulomb, sliding - coulomb, stiction), velocity)


def for_elastic_step(elastic: ElasticSeals | None, c: Constants) -> Any:
    """What `elastic_step` needs besides the parameters of the plant; None for rigid seals."""
    if elastic is None:
        return None
    return for_compiler(elastic.numbers), c._replace(seals=for_compiler(NO_SEALS))


@compilable
def elastic_step(
    c: Constants, seal_less: Any, plant: PlantState, seals: SealShear, command: float, load_force: float, h: float
) -> tuple[PlantState, SealShear]:
    """Valve, chambers, rod and seals after ``h`` [s]; Runge-Kutta of fourth order.

    ``seal_less`` is from `for_elastic_step`; the command is of the spool [-1 to 1], the load force [N] from outside.
    """
    elastic, bare = seal_less
    y = plant[:10]
    start, stored = y[0], energy_of_seals(elastic, seals)
    f1 = _stage(c, elastic, seals, y, start, 0.0).friction
    k1 = rates(bare, y, 1, command, load_force - f1)
    y2 = along(y, k1, 0.5 * h)
    f2 = _stage(c, elastic, seals, y2, start, 0.5 * h).friction
    k2 = rates(bare, y2, 1, command, load_force - f2)
    y3 = along(y, k2, 0.5 * h)
    f3 = _stage(c, elastic, seals, y3, start, 0.5 * h).friction
    k3 = rates(bare, y3, 1, command, load_force - f3)
    y4 = along(y, k3, h)
    f4 = _stage(c, elastic, seals, y4, start, h).friction
    k4 = rates(bare, y4, 1, command, load_force - f4)
    y = along(along(along(along(y, k1, h / 6.0), k2, h / 3.0), k3, h / 3.0), k4, h / 6.0)
    work = h / 6.0 * (f1 * k1[0] + 2.0 * f2 * k2[0] + 2.0 * f3 * k3[0] + f4 * k4[0])

    position, velocity, spool, spool_rate, lost = y[0], y[1], y[4], y[5], 0.0
    if abs(position) >= c.cylinder.limit and position * velocity > 0.0:
        lost = 0.5 * c.load.mass * velocity * velocity
        position, velocity = math.copysign(c.cylinder.limit, position), 0.0
    if abs(spool) > 1.0:
        spool, spool_rate = math.copysign(1.0, spool), 0.0
    y = (position, velocity, y[2], y[3], spool, spool_rate, y[6] + work, y[7] + work + lost, y[8], y[9])
    seals = _stage(c, elastic, seals, y, start, h)
    released = stored - energy_of_seals(elastic, seals)
    y = (y[0], y[1], y[2], y[3], y[4], y[5], y[6], y[7] + released, y[8], y[9])
    moves = 1 if velocity > 0.0 else (-1 if velocity < 0.0 else 0)
    transitions = plant.transitions + (1 if (moves == 0) != (plant.direction == 0) else 0)
    return PlantState(*y, moves, transitions), seals
