"""Normal force -> coefficient of friction of rubber on a lubricated metal wall."""

import math
from dataclasses import dataclass
from functools import cached_property

from seal_friction_ros.core.foundation.monotone_table import MonotoneTable
from seal_friction_ros.core.foundation.parameters import parameter
from seal_friction_ros.core.friction.laws.law import Law


@dataclass(frozen=True)
class FrictionCoefficientLaw(Law):
    """Coefficient of dynamic friction [-] from normal force [N, > 0]."""

    def coefficient_of_friction(self, normal_force: float) -> float:
        """Coefficient of dynamic friction [-] at ``normal_force`` [N, > 0]."""
        return self.bound(normal_force, 0.0)


def falling_coefficient(coefficient: float, exponent: float, normal_force: float, _unused: float) -> float:
    """Mu = c (F_n / 1 N)^-n [-]."""
    return coefficient * math.pow(normal_force, -exponent)


@dataclass(frozen=True)
class PowerLaw(FrictionCoefficientLaw):
    """Coefficient of friction falling as a power of the normal force: mu = c (F_n / 1 N)^-n.

    An elastic contact whose real area grows as F_n^(2/3) gives n = 1/3 [Schallamach1958]_; n < 1 keeps the friction
    itself rising with normal force.
    """

    function = staticmethod(falling_coefficient)

    coefficient: float = parameter(
        unit='1',
        lower=1e-6,
        upper=100.0,
        description='c, coefficient of friction at 1 N.',
        symbol='c',
        start=lambda typical: typical.friction / typical.normal_force**0.6,
    )
    exponent: float = parameter(
        unit='1', lower=0.0, upper=0.99, description='n; 0 is a constant coefficient.', symbol='n', start=lambda _: 0.4
    )


@dataclass(frozen=True)
class CoefficientTable(FrictionCoefficientLaw):
    """Coefficient of friction by monotone interpolation over normal force, constant beyond both ends.

    ValueError: fewer than two points, forces that do not increase, or a coefficient that is not positive.

    Source: thesis, chapter 7 (mu is "Defined at multiple F_n values") and Figure 18.
    """

    normal_forces: tuple[float, ...] = parameter(
        unit='N', lower=0.0, upper=1e9, description='Normal forces, increasing.'
    )
    coefficients: tuple[float, ...] = parameter(
        unit='1', lower=1e-6, upper=100.0, description='Coefficient of friction at each of them.'
    )

    @cached_property
    def table(self) -> MonotoneTable:
        """Coefficient over normal force."""
        return MonotoneTable(self.normal_forces, self.coefficients, 'CoefficientTable')


FRICTION_COEFFICIENT_LAWS: dict[str, type[FrictionCoefficientLaw]] = {
    'power_law': PowerLaw,
    'monotone_table': CoefficientTable,
}
"""Name in a seal file -> law."""
