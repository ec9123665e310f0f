"""Coulomb friction that does not depend on pressure."""

from dataclasses import dataclass

from seal_friction_ros.core.foundation.parameters import parameter
from seal_friction_ros.core.friction.laws.law import FrictionLaw


def constant_coulomb(coulomb_friction_at_any_pressure: float, _pressure: float, _speed: float) -> float:
    """f_c = f_0 [N]."""
    return coulomb_friction_at_any_pressure


@dataclass(frozen=True)
class ConstantCoulomb(FrictionLaw):
    """Coulomb friction that does not depend on pressure: the usual assumption.

    Source: thesis, chapter 1 ("the friction force is usually approximated as a constant value").
    """

    NAME = 'constant_coulomb'
    FORMULA = 'f_0'
    function = staticmethod(constant_coulomb)

    coulomb_friction_at_any_pressure: float = parameter(
        unit='N',
        lower=0.0,
        upper=1e6,
        description='Sliding friction of the seal.',
        symbol='f_0',
        start=lambda typical: typical.friction,
    )
