"""Coulomb friction as a shear stress over the contact of a ring: linear under a low contact stress."""

from dataclasses import dataclass
from functools import cached_property

from seal_friction_ros.core.foundation.compiled import Bound, evaluate
from seal_friction_ros.core.foundation.monotone_table import MonotoneTable
from seal_friction_ros.core.foundation.parameters import CheckedParameters, parameter
from seal_friction_ros.core.friction.laws.law import FrictionLaw

LOWEST_KNEE, HIGHEST_KNEE = 1.0, 1e12  # [Pa] bounds of the knee; at the highest a constant coefficient


@dataclass(frozen=True)
class ShearLaw(CheckedParameters):
    r"""Shear stress of a sliding contact from its local contact stress.

    .. math:: \tau = \tau_0 \operatorname{arsinh}\frac{\sigma}{\sigma_0}

    Far below the knee sigma_0 the coefficient of friction is tau_0 / sigma_0. Far above it the shear stress grows with
    the logarithm of the contact stress only, by 0.69 tau_0 when that doubles. The law belongs to rubber, wall and
    lubricant, and holds for a ring of any size. The form is our choice: docs/oring.md compares it
    with mu N and a constant.

    ValueError: a value is out of bounds.
    """

    shear_stress: float = parameter(
        unit='Pa', lower=1.0, upper=1e12, description='tau_0, shear stress at 1.18 times the knee.'
    )
    knee_stress: float = parameter(
        unit='Pa',
        lower=LOWEST_KNEE,
        upper=HIGHEST_KNEE,
        description='sigma_0, contact stress up to which the shear stress is proportional to it.',
    )


def contact_shear(shear_stress: float, table: Bound, pressure: float, _speed: float) -> float:
    """f_c = tau_0 A(P) [N]."""
    return shear_stress * evaluate(table, pressure, 0.0)


@dataclass(frozen=True)
class ContactShear(ShearLaw, FrictionLaw):
    r"""Coulomb friction as the integral of a shear stress over the contact.

    .. math::
        f_c = \int \tau(\sigma)\,dA = \tau_0\,A(P), \quad
        A = \int \operatorname{arsinh}(\sigma / \sigma_0)\,dA

    `seal_friction oring` computes A at each pressure by finite elements. Above the last pressure A rises with the
    slope that it has there (our choice).

    ValueError: fewer than two pressures, pressures that do not increase, or an
    area that is not positive or falls.
    """

    NAME = 'contact_shear'
    FORMULA = 'tau_0 A(P)'
    function = staticmethod(contact_shear)

    pressures: tuple[float, ...] = parameter(
        unit='Pa', lower=0.0, upper=1e9, description='Gauge pressures, increasing.'
    )
    areas: tuple[float, ...] = parameter(
        unit='m2', lower=1e-12, upper=1e6, description='A, area that tau_0 acts on at each pressure, not decreasing.'
    )

    def check_together(self) -> None:
        """Check that the friction does not fall with pressure."""
        self.check_rises('areas')

    @cached_property
    def table(self) -> MonotoneTable:
        """A over pressure."""
        return MonotoneTable(self.pressures, self.areas, 'ContactShear', rises=True)
