"""Friction of a ring from its computed contact, and the shear law that readings of it leave."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize_scalar

from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.friction.actuator import Seal, Uncertainty
from seal_friction_ros.core.friction.geometry import SealGeometry
from seal_friction_ros.core.friction.laws.constant_coulomb import ConstantCoulomb
from seal_friction_ros.core.friction.laws.contact_shear import HIGHEST_KNEE, LOWEST_KNEE, ContactShear, ShearLaw
from seal_friction_ros.core.friction.laws.friction_coefficient import FrictionCoefficientLaw
from seal_friction_ros.core.friction.laws.law import FrictionLaw
from seal_friction_ros.core.friction.laws.normal_force import NormalForceTable
from seal_friction_ros.core.friction.laws.physics_based import PhysicsBased
from seal_friction_ros.core.oring_contact.results import WallContact

ONE_READING_STD = 0.15  # [-] scatter of readings: the same ring mounted anew differs by 0.10 to 0.15
READINGS_OF_SCATTER = 4.0  # readings that `ONE_READING_STD` counts as, beside the scatter that is found (our choice)
KNEE_STD = 0.7  # [-] of the logarithm of the knee about that of the prior law: a factor of 2 (our choice)
NO_READING_STD = 2.0  # [-] rings of other rubber, wall and lubricant differ by a factor of 3 to 4
DISCRETISATION = 0.03  # [-] of the friction: what counts as an error of mesh and grid (our choice)
_MOST_CHANGE = 4.0 * KNEE_STD  # [-] largest change of the logarithm of the knee in a fit: a factor of 16 (our choice)
BEYOND = 1.1  # share of the last computed pressure up to which a reading may lie

RingLaw = FrictionCoefficientLaw | ShearLaw


@dataclass(frozen=True)
class SealFriction:
    """Friction data of a seal file besides geometry and contact."""

    law: RingLaw
    uncertainty: Uncertainty
    stiction: float = 0.0  # [N]
    stiction_ratio: float = 0.0  # [-]


PRIOR_LAW = ShearLaw(shear_stress=0.1e6, knee_stress=0.26e6)
"""Shear stress of the ring of the thesis; knee: geometric mean of that of its readings and of eight logs of Delft."""
PRIOR = SealFriction(PRIOR_LAW, Uncertainty(NO_READING_STD), stiction_ratio=0.13)
"""Friction of a ring without any reading: shear law and breakaway ratio of the ring of the thesis."""


class Reading(NamedTuple):
    """A measured sliding friction of one seal."""

    pressure: float  # [Pa, gauge]
    speed: float  # [m/s]
    friction: float  # [N]


class FittedShear(NamedTuple):
    """The shear law of some readings."""

    law: ShearLaw
    relative_std: float  # [-] of a new reading
    deviations: FloatArray  # law over reading, less one, shape (readings,)


def friction_of_contact(law: RingLaw, contact: WallContact) -> float:
    """Sliding friction of a contact [N]: the integral of the shear stress, or mu(F_n) F_n."""
    if isinstance(law, ShearLaw):
        return law.shear_stress * contact.sheared_area(law.knee_stress)
    return law.coefficient_of_friction(contact.force) * contact.force


def friction_law(
    law: RingLaw, geometry: SealGeometry, pressures: Sequence[float], contacts: Sequence[WallContact]
) -> FrictionLaw:
    """Friction of a ring over pressure, for a seal file, by its contacts on the sliding wall at pressures [Pa, gauge].

    A seal that was computed without pressure alone, a wiper, has one friction. ValueError: one other pressure, or a
    friction that falls with pressure.
    """
    at = tuple(pressures)
    if at == (0.0,):
        return ConstantCoulomb(friction_of_contact(law, contacts[0]))
    if isinstance(law, ShearLaw):
        return ContactShear(law.shear_stress, law.knee_stress, at, sheared_areas(at, contacts, law.knee_stress))
    return PhysicsBased(geometry, NormalForceTable(at, tuple(contact.force for contact in contacts)), law)


def sheared_areas(pressures: Sequence[float], contacts: Sequence[WallContact], knee_stress: float) -> tuple[float, ...]:
    """`WallContact.sheared_area` over the pressure [Pa, gauge], not falling [m^2].

    Falls of `DISCRETISATION` or less count as errors of the mesh: the area before stays. ValueError: a larger fall.
    """
    areas, share = _levelled(contacts, knee_stress)
    least = int(share.argmin())
    if share[least] < 1.0 - DISCRETISATION:
        raise ValueError(
            f'friction falls with pressure, at {pressures[least]:.6g} Pa by {100.0 * (1.0 - share[least]):.2g} %: the '
            'fluid passes a lip there, or its flank lifts off; give pressures all below or all above that'
        )
    return tuple(areas.tolist())


def _levelled(contacts: Sequence[WallContact], knee_stress: float) -> tuple[FloatArray, FloatArray]:
    """Largest `WallContact.sheared_area` up to each contact [m^2], and the area of the contact as a share of it."""
    areas = np.array([contact.sheared_area(knee_stress) for contact in contacts])
    highest = np.maximum.accumulate(areas)
    return highest, areas / np.maximum(highest, np.finfo(float).tiny)


def friction_after(seal: Seal) -> SealFriction:
    """Friction of another ring of the same rubber, wall and lubricant as ``seal``, without a reading of it.

    Breakaway stays the same share of the sliding friction, in the mean over the pressures of the seal. ValueError: the
    seal has another law than `ContactShear`.
    """
    law = seal.coulomb_law
    if not isinstance(law, ContactShear):
        raise ValueError(
            f'seal {seal.name}: its {law.NAME} is for its own size: take a seal file with contact_shear, which '
            'seal_friction oring CASE --reading makes'
        )
    mean = float(np.mean([law.coulomb_friction(pressure) for pressure in law.pressures]))
    ratio = seal.stiction_ratio + seal.stiction / mean
    shear = ShearLaw(seal.friction_scale * law.shear_stress, law.knee_stress)
    return SealFriction(shear, Uncertainty(NO_READING_STD), stiction_ratio=ratio)


def fit_shear_law(
    prior: ShearLaw, pressures: Sequence[float], contacts: Sequence[WallContact], readings: Sequence[Reading]
) -> FittedShear:
    r"""Shear law of a ring from readings of its friction F_i at the pressures P_i.

    tau_0 is the geometric mean of :math:`F_i / A(P_i)`, by the contacts on the sliding wall at the computed
    pressures [Pa, gauge]. The knee minimises

    .. math::
        \sum_i \frac{(\ln F_i - \ln \tau_0 A(P_i))^2}{s_0^2} + \frac{(\ln \sigma_0 / \sigma_p)^2}{s_k^2}

    with s_0 = `ONE_READING_STD`, s_k = `KNEE_STD` and sigma_p of the prior, so that it moves only where readings tell.
    The deviation that is left counts s_0 as `READINGS_OF_SCATTER` readings:

    .. math::
        s^2 = \frac{k s_0^2 + \sum_i (\ln F_i - \ln \tau_0 A(P_i))^2}{k + N - 1}

    so one reading leaves s_0. The speed is not in the law. All this is our choice. ValueError: a reading is at a
    pressure that was not computed, its friction is not positive, or `sheared_areas` falls at the knee that is found.
    """
    at = np.array([reading.pressure for reading in readings])
    friction = np.array([reading.friction for reading in readings])
    if not friction.min() > 0.0:
        raise ValueError(f'a reading of {friction.min():g} N is not above 0 N')
    if at.min() < pressures[0] or at.max() > BEYOND * pressures[-1]:
        raise ValueError(
            f'readings at {at.min():g} to {at.max():g} Pa are outside the computed {pressures[0]:g} to '
            f'{pressures[-1]:g} Pa: give --pressures'
        )

    def stresses(knee_stress: float) -> FloatArray:
        """Logarithm of friction over A of each reading."""
        areas, _ = _levelled(contacts, knee_stress)
        of_area = ContactShear(1.0, knee_stress, tuple(pressures), tuple(areas.tolist()))
        return np.log(friction / [of_area.coulomb_friction(p) for p in at.tolist()])

    def knee(change: float) -> float:
        """Of a change of its logarithm, within the bounds of the law."""
        return min(max(prior.knee_stress * math.exp(change), LOWEST_KNEE), HIGHEST_KNEE)

    def cost(change: float) -> float:
        """Of a change of the logarithm of the knee."""
        scatter = np.var(stresses(knee(change))) * len(readings)
        return float(scatter / ONE_READING_STD**2 + (change / KNEE_STD) ** 2)

    change = float(minimize_scalar(cost, bounds=(-_MOST_CHANGE, _MOST_CHANGE), method='bounded').x)
    knee_stress = knee(round(change, 4))
    sheared_areas(pressures, contacts, knee_stress)
    found = stresses(knee_stress)
    shear_stress = math.exp(found.mean())
    left = float(((found - math.log(shear_stress)) ** 2).sum())
    variance = (READINGS_OF_SCATTER * ONE_READING_STD**2 + left) / (READINGS_OF_SCATTER + len(readings) - 1.0)
    return FittedShear(ShearLaw(shear_stress, knee_stress), math.sqrt(variance), shear_stress / np.exp(found) - 1.0)
