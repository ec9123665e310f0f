"""Coulomb friction as a shear stress over the contact of a ring: a power of the local contact stress."""

from dataclasses import dataclass
from functools import cached_property

from seal_friction_ros.core.foundation.compiled import Bound, evaluate
from seal_friction_ros.core.foundation.monotone_table import MonotoneTable
from seal_friction_ros.core.foundation.parameters import CheckedParameters, parameter
from seal_friction_ros.core.friction.laws.law import FrictionLaw

REFERENCE_STRESS = 1e6  # [Pa] contact stress at which the shear stress is c


@dataclass(frozen=True)
class ShearLaw(CheckedParameters):
    r"""Shear stress of a sliding contact from its local contact stress.

    .. math:: \tau = c\,(\sigma / 1\,\mathrm{MPa})^n

    It belongs to rubber, wall and lubricant, and holds for a ring of any size. n = 1 is a constant coefficient of
    friction; n = 0 is the limit of a constant shear stress over the real contact, where that is all of the contact. The
    form is our choice.

    ValueError: a value is out of bounds.
    """

    shear_stress: float = parameter(
        unit='Pa', lower=1.0, upper=1e9, description='c, shear stress at a contact stress of 1 MPa.'
    )
    exponent: float = parameter(
        unit='1', lower=0.0, upper=1.0, description='n; 0: constant shear stress, 1: constant coefficient of friction.'
    )


def contact_shear(shear_stress: float, table: Bound, pressure: float, _speed: float) -> float:
    """f_c = c A_n(P) [N]."""
    return shear_stress * evaluate(table, pressure, 0.0)


@dataclass(frozen=True)
class ContactShear(ShearLaw, FrictionLaw):
    r"""Coulomb friction as the integral of a shear stress over the contact.

    .. math::
        f_c = \int \tau(\sigma)\,dA = c\,A_n(P), \quad
        A_n = \int (\sigma / 1\,\mathrm{MPa})^n\,dA

    `seal_friction oring` computes A_n at each pressure by finite elements. Above the last pressure A_n rises with the
    slope that it has there (our choice).

    ValueError: fewer than two pressures, pressures that do not increase, or an
    area that is not positive or falls.
    """

    NAME = 'contact_shear'
    FORMULA = 'c A_n(P)'
    function = staticmethod(contact_shear)

    pressures: tuple[float, ...] = parameter(
        unit='Pa', lower=0.0, upper=1e9, description='Gauge pressures, increasing.'
    )
    areas: tuple[float, ...] = parameter(
        unit='m2', lower=1e-12, upper=1e6, description='A_n at each pressure, not decreasing.'
    )

    def check_together(self) -> None:
        """Check that the friction does not fall with pressure."""
        self.check_rises('areas')

    @cached_property
    def table(self) -> MonotoneTable:
        """A_n over pressure."""
        return MonotoneTable(self.pressures, self.areas, 'ContactShear', rises=True)
