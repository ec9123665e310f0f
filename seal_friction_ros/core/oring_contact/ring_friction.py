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
from seal_friction_ros.core.friction.laws.contact_shear import ContactShear, ShearLaw
from seal_friction_ros.core.friction.laws.friction_coefficient import FrictionCoefficientLaw
from seal_friction_ros.core.friction.laws.law import FrictionLaw
from seal_friction_ros.core.friction.laws.normal_force import NormalForceTable
from seal_friction_ros.core.friction.laws.physics_based import PhysicsBased
from seal_friction_ros.core.oring_contact.results import WallContact

ONE_READING_STD = 0.15  # [-] scatter of readings: the same ring mounted anew differs by 0.10 to 0.15
READINGS_OF_SCATTER = 4.0  # readings that `ONE_READING_STD` counts as, beside the scatter that is found (our choice)
EXPONENT_STD = 0.1  # [-] of the exponent about that of the prior law (our choice)
NO_READING_STD = 2.0  # [-] a factor of 3: the law of one ring is that far off on one of other rubber, wall, lubricant
DISCRETISATION = 0.03  # [-] of the friction: what counts as an error of mesh and grid (our choice)
BEYOND = 1.1  # share of the last computed pressure up to which a reading may lie

RingLaw = FrictionCoefficientLaw | ShearLaw


@dataclass(frozen=True)
class SealFriction:
    """Friction data of a seal file besides geometry and contact."""

    law: RingLaw
    uncertainty: Uncertainty
    stiction: float = 0.0  # [N]
    stiction_ratio: float = 0.0  # [-]


PRIOR_LAW = ShearLaw(shear_stress=0.25e6, exponent=1.0 / 3.0)
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
        return law.shear_stress * contact.sheared_area(law.exponent)
    return law.coefficient_of_friction(contact.force) * contact.force


def friction_law(
    law: RingLaw, geometry: SealGeometry, pressures: Sequence[float], contacts: Sequence[WallContact]
) -> FrictionLaw:
    """Friction of a ring over pressure, for a seal file, by its contacts on the sliding wall at pressures [Pa, gauge].

    ValueError: fewer than two pressures, or a friction that falls with pressure.
    """
    at = tuple(pressures)
    if isinstance(law, ShearLaw):
        return ContactShear(law.shear_stress, law.exponent, at, sheared_areas(at, contacts, law.exponent))
    return PhysicsBased(geometry, NormalForceTable(at, tuple(contact.force for contact in contacts)), law)


def sheared_areas(pressures: Sequence[float], contacts: Sequence[WallContact], exponent: float) -> tuple[float, ...]:
    """`WallContact.sheared_area` over the pressure [Pa, gauge] without falls of `DISCRETISATION` or less [m^2].

    Rubber under more pressure does not rub less. ValueError: it falls by more.
    """
    areas = np.array([contact.sheared_area(exponent) for contact in contacts])
    highest = np.maximum.accumulate(areas)
    share = areas / np.maximum(highest, np.finfo(float).tiny)
    least = int(share.argmin())
    if share[least] < 1.0 - DISCRETISATION:
        raise ValueError(
            f'friction falls with pressure, at {pressures[least]:.6g} Pa by {100.0 * (1.0 - share[least]):.2g} %: the '
            'fluid passes a lip there, or its flank lifts off; a law needs pressures on one side of it'
        )
    return tuple(highest.tolist())


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
    shear = ShearLaw(seal.friction_scale * law.shear_stress, law.exponent)
    return SealFriction(shear, Uncertainty(NO_READING_STD), stiction_ratio=ratio)


def fit_shear_law(
    prior: ShearLaw, pressures: Sequence[float], contacts: Sequence[WallContact], readings: Sequence[Reading]
) -> FittedShear:
    r"""Shear law of a ring from readings of its friction F_i at the pressures P_i.

    c is the geometric mean of :math:`F_i / A_n(P_i)`, by the contacts on the sliding wall at the computed pressures
    [Pa, gauge]. The exponent minimises

    .. math::
        \sum_i \frac{(\ln F_i - \ln c A_n(P_i))^2}{s_0^2} + \frac{(n - n_0)^2}{s_n^2}

    with s_0 = `ONE_READING_STD`, s_n = `EXPONENT_STD` and n_0 of the prior, so that it moves only where readings tell.
    The deviation that is left counts s_0 as `READINGS_OF_SCATTER` readings:

    .. math::
        s^2 = \frac{k s_0^2 + \sum_i (\ln F_i - \ln c A_n(P_i))^2}{k + N - 1}

    so one reading leaves s_0. The speed is not in the law. All this is our choice. ValueError: a reading is at a
    pressure that was not computed, or its friction is not positive.
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

    def shear_stresses(exponent: float) -> FloatArray:
        """Logarithm of friction over A_n of each reading."""
        of_area = ContactShear(1.0, exponent, tuple(pressures), sheared_areas(pressures, contacts, exponent))
        return np.log(friction / [of_area.coulomb_friction(p) for p in at.tolist()])

    def cost(exponent: float) -> float:
        scatter = np.var(shear_stresses(exponent)) * len(readings)
        return float(scatter / ONE_READING_STD**2 + ((exponent - prior.exponent) / EXPONENT_STD) ** 2)

    n = round(float(minimize_scalar(cost, bounds=(0.0, 1.0), method='bounded').x), 4)
    stresses = shear_stresses(n)
    c = math.exp(stresses.mean())
    left = float(((stresses - math.log(c)) ** 2).sum())
    variance = (READINGS_OF_SCATTER * ONE_READING_STD**2 + left) / (READINGS_OF_SCATTER + len(readings) - 1.0)
    return FittedShear(ShearLaw(c, n), math.sqrt(variance), c / np.exp(stresses) - 1.0)
