r"""Elastic seal: before a rod slides, its seals shear.

Elements in parallel, each a spring in series with a slider (Prandtl-Iwan; with a sliding force that depends on speed,
the generalized Maxwell-slip model). ``state = NOT_SHEARED``, then ``state, friction = shear(numbers, state, slide)``
for every displacement of the rod.

.. math::
    f_i &\leftarrow \mathrm{clip}(f_i + k_i\,\Delta x,\ \pm w_i Y), \qquad F_f = \sum_i f_i, \quad
        \sum k_i = K, \quad \sum w_i = 1 \\
    Y &= f_c + e, \qquad
        e \leftarrow \begin{cases}
            e_v + (e - e_v)\,\mathrm{e}^{-g/L} & \text{the last element slides over } g > 0 \\
            e_s + (e - e_s)\,\mathrm{e}^{-\Delta t/\tau} & \text{no gross sliding: dwell}
        \end{cases}

with the Coulomb friction f_c, the excess e_v of sliding friction at the present speed (viscous and Stribeck friction)
and the excess e_s of breakaway (stiction). L is the sliding that friction needs to follow a change of speed, tau the
dwell after which stiction is there. With L = tau = 0 sliding friction follows the speed and stiction is there at once,
as in `states.state_friction`; with an infinite stiffness `shear` is that law.

Shear depends on displacement alone, not on time: under a constant load below breakaway the rod does not drift, unlike
with LuGre [Dupont2002]_. A clip only takes energy out of a spring, so a closed loop never gives energy.

Source: elements [Iwan1966]_; sliding force of an element that depends on speed [AlBender2005]_. The power law of the
yield forces, one excess for all elements, the exponential lags and rank by rank addition of seals are our choice.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

from seal_friction_ros.core.foundation.compiled import compilable
from seal_friction_ros.core.foundation.limits import between
from seal_friction_ros.core.foundation.parameters import CheckedParameters, parameter
from seal_friction_ros.core.friction.laws.friction_map import FrictionMap

SLOTS = 6  # Largest number of elements: records of fixed size compile, and go into a snapshot.


class Elements(NamedTuple):
    """One number for each element, the element that slides last at the end; unused ones are 0 and come first."""

    first: float
    second: float
    third: float
    fourth: float
    fifth: float
    last: float


NO_ELEMENTS = Elements(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Presliding(CheckedParameters):
    r"""Elasticity of one seal.

    All elements have the stiffness K / N. Their yield forces grow by a power law,
    :math:`w_i \propto ((i - 1/2) / N)^p`, i = 1 to N: with p = 0 all yield at once, with p = 1 the stiffness falls
    linearly with displacement, above that the rod approaches sliding over a long way.
    """

    stiffness: float = parameter(
        unit='N/m', lower=1.0, upper=1e9, description='K, friction over displacement just after a reversal.'
    )
    elements: int = parameter(SLOTS, unit='', lower=1, upper=SLOTS, description='N, number of elements.')
    yield_exponent: float = parameter(
        1.0, unit='1', lower=0.0, upper=10.0, description='p, how gradually the elements yield; 0: all at once.'
    )
    memory_length: float = parameter(
        0.0, unit='m', lower=0.0, upper=10.0, description='L, sliding over which friction follows a change of speed.'
    )
    dwell_time: float = parameter(
        0.0, unit='s', lower=0.0, upper=1e6, description='tau, dwell after which 63 % of the stiction is there.'
    )
    relative_std: float = parameter(
        0.3, unit='1', lower=0.0, upper=10.0, description='Relative standard deviation of the stiffness.'
    )


def presliding_of_map(law: FrictionMap) -> Presliding | None:
    """Elasticity that a friction map tells: one spring, and the memory length; None for a map without lengths.

    The stiffness is the friction without pressure at the lowest speed over the presliding length. Its standard
    deviation, a tenth, is our choice, since nothing is measured.
    """
    if not law.presliding_length > 0.0:
        return None
    stiffness = law.frictions[0] / law.presliding_length
    return Presliding(
        stiffness=stiffness, elements=1, yield_exponent=0.0, memory_length=law.memory_length, relative_std=0.1
    )


class PreslidingNumbers(NamedTuple):
    """Elasticity of all seals of an actuator as numbers."""

    stiffness: float  # [N/m] K; infinite: rigid
    stiffnesses: Elements  # [N/m] of each element
    shares: Elements  # [-] of each element in the friction
    memory_length: float  # [m]
    dwell_time: float  # [s]


RIGID = PreslidingNumbers(math.inf, NO_ELEMENTS._replace(last=math.inf), NO_ELEMENTS._replace(last=1.0), 0.0, 0.0)
"""Seals that do not shear: the friction states of the thesis."""


class Shear(NamedTuple):
    """What one displacement leaves for the next."""

    forces: Elements  # [N] of each element
    excess: float  # [N] e


NOT_SHEARED = Shear(NO_ELEMENTS, 0.0)


class Slide(NamedTuple):
    """One displacement of the rod, and the friction at its end."""

    displacement: float  # [m]
    elapsed: float  # [s] >= 0
    coulomb_friction: float  # [N] f_c
    sliding_excess: float  # [N] e_v
    stiction: float  # [N] e_s


def presliding_numbers(seals: Iterable[Presliding]) -> PreslidingNumbers:
    """Elasticity of all seals of an actuator together; without seals `RIGID`.

    Elements of the same rank act as one: stiffnesses add up; shares, lengths and times are means that are weighted with
    the stiffness. Total stiffness and total friction are exact; two seals that yield at unlike displacements yield
    together at a displacement between (our choice, which keeps one set of elements for any number of seals).
    """
    each = tuple(seals)
    if not each:
        return RIGID
    total = math.fsum(seal.stiffness for seal in each)
    stiffnesses, shares = [0.0] * SLOTS, [0.0] * SLOTS
    for seal in each:
        n = seal.elements
        yields = [((i + 0.5) / n) ** seal.yield_exponent for i in range(n)]
        for i, yield_force in enumerate(yields, start=SLOTS - n):
            stiffnesses[i] += seal.stiffness / n
            shares[i] += seal.stiffness / total * yield_force / math.fsum(yields)
    return PreslidingNumbers(
        total,
        Elements(*stiffnesses),
        Elements(*shares),
        math.fsum(seal.stiffness * seal.memory_length for seal in each) / total,
        math.fsum(seal.stiffness * seal.dwell_time for seal in each) / total,
    )


@compilable
def element_force(force: float, stiffness: float, displacement: float, yield_force: float) -> float:
    """Force of one element after a displacement [N]."""
    if displacement != 0.0:  # a rigid element at rest: infinity times 0
        force += stiffness * displacement
    if force > yield_force:  # as `between`: a call would take as long as the rest
        return yield_force
    return -yield_force if force < -yield_force else force


@compilable
def element_forces(
    numbers: PreslidingNumbers, forces: Elements, displacement: float, friction: float
) -> tuple[Elements, float]:
    """Forces of all elements [N] after a displacement [m] at a sliding friction Y [N], and their sum.

    The sum is exactly Y or -Y where every element yields.
    """
    _, stiffnesses, shares, _, _ = numbers
    k1, k2, k3, k4, k5, k6 = stiffnesses
    w1, w2, w3, w4, w5, w6 = shares
    f1, f2, f3, f4, f5, f6 = forces
    f1 = element_force(f1, k1, displacement, w1 * friction)
    f2 = element_force(f2, k2, displacement, w2 * friction)
    f3 = element_force(f3, k3, displacement, w3 * friction)
    f4 = element_force(f4, k4, displacement, w4 * friction)
    f5 = element_force(f5, k5, displacement, w5 * friction)
    f6 = element_force(f6, k6, displacement, w6 * friction)
    total = f1 + f2 + f3 + f4 + f5 + f6
    size = abs(f1) + abs(f2) + abs(f3) + abs(f4) + abs(f5) + abs(f6)
    if abs(total) == size and abs(f6) == w6 * friction and size >= (1.0 - 1e-14) * friction:
        total = friction if total > 0.0 else -friction
    return Elements(f1, f2, f3, f4, f5, f6), total


@compilable
def gross_sliding(numbers: PreslidingNumbers, forces: Elements, displacement: float, friction: float) -> float:
    """Length over which the element that yields last slides [m]: the whole contact slides over it."""
    stiffness = numbers.stiffnesses.last
    if math.isinf(stiffness):
        return abs(displacement)
    if displacement == 0.0:
        return 0.0
    length = (abs(forces.last + stiffness * displacement) - numbers.shares.last * friction) / stiffness
    return between(0.0, length, abs(displacement))


@compilable
def shear(numbers: PreslidingNumbers, state: Shear, slide: Slide) -> tuple[Shear, float]:
    """Friction force [N] after a displacement on which the rod does not reverse; the equations at the top."""
    displacement, elapsed, coulomb, sliding_excess, stiction = slide
    forces, excess = state
    before = coulomb + excess
    length = gross_sliding(numbers, forces, displacement, before if before > 0.0 else 0.0)
    if length > 0.0:
        excess = relaxed(excess, sliding_excess, length, numbers.memory_length)
    else:
        excess = relaxed(excess, stiction, elapsed, numbers.dwell_time)
    friction = coulomb + excess
    friction = friction if friction > 0.0 else 0.0
    forces, force = element_forces(numbers, forces, displacement, friction)
    return Shear(forces, excess), force


@compilable
def relaxed(value: float, towards: float, passed: float, scale: float) -> float:
    """Value that relaxes exponentially towards another one; at once with a scale of 0."""
    if scale > 0.0:
        return towards + (value - towards) * math.exp(-passed / scale)
    return towards


@compilable
def stored_energy(numbers: PreslidingNumbers, state: Shear) -> float:
    """Energy in the springs [J]: sum of f_i^2 / (2 k_i); 0 for rigid seals."""
    energy = 0.0
    for i in range(SLOTS):
        stiffness, force = numbers.stiffnesses[i], state.forces[i]
        if 0.0 < stiffness < math.inf:
            energy += 0.5 * force * force / stiffness
    return energy


class LuGreNumbers(NamedTuple):
    """Parameters of `lugre`."""

    bristle_stiffness: float  # [N/m] sigma_0
    bristle_damping: float  # [N s/m] sigma_1


@compilable
def lugre(
    numbers: LuGreNumbers, deflection: float, displacement: float, velocity: float, friction: float
) -> tuple[float, float]:
    r"""LuGre: mean deflection of the bristles [m] after a displacement of the rod, and the friction force [N].

    .. math:: \dot z = v - \frac{\sigma_0 |v|}{g} z, \qquad F_f = \sigma_0 z + \sigma_1 \dot z

    integrated exactly at a constant g, the sliding ``friction`` [N] at this speed, over the displacement [m], at whose
    end the rod has ``velocity`` [m/s]. A rung for comparison and a plant that is not the model of the feed-forward: it
    drifts under a load that vibrates below breakaway [Dupont2002]_, and its minor loops are not closed.

    Source: [CanudasDeWit1995]_; viscous friction is part of g here.
    """
    stiffness, damping = numbers
    if friction <= 0.0:
        return 0.0, 0.0
    if displacement != 0.0:
        steady = math.copysign(friction / stiffness, displacement)
        deflection = steady + (deflection - steady) * math.exp(-stiffness * abs(displacement) / friction)
    rate = velocity - stiffness * abs(velocity) / friction * deflection
    return deflection, stiffness * deflection + damping * rate
