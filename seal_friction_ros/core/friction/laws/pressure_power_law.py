"""Coulomb friction that rises as a power of the pressure."""

import math
from dataclasses import dataclass

from seal_friction_ros.core.foundation.parameters import parameter
from seal_friction_ros.core.foundation.units import BAR
from seal_friction_ros.core.friction.laws.law import FrictionLaw, TypicalReading

ELASTIC_EXPONENT = 2.0 / 3.0  # of the normal force: friction of an elastic contact [Schallamach1958]_


def pressure_power_law(
    friction_at_no_pressure: float, friction_at_one_bar: float, pressure_exponent: float, pressure: float, _speed: float
) -> float:
    """f_c = f_0 + k (P / 1 bar)^m [N]."""
    return friction_at_no_pressure + friction_at_one_bar * math.pow(pressure / BAR, pressure_exponent)


def _friction_at_one_bar(typical: TypicalReading) -> float:
    return float(0.7 * typical.friction / max(typical.pressure / BAR, 1e-6) ** ELASTIC_EXPONENT)


@dataclass(frozen=True)
class PressurePowerLaw(FrictionLaw):
    """Coulomb friction that rises as a power of the pressure: f_c = f_0 + k (P / 1 bar)^m. It needs no geometry.

    With m = 2/3 this is an elastic contact [Schallamach1958]_ whose normal force is proportional to the pressure. The
    form of the law is our choice.
    """

    NAME = 'pressure_power_law'
    FORMULA = 'f_0 + k P^m'
    function = staticmethod(pressure_power_law)

    friction_at_no_pressure: float = parameter(
        unit='N', lower=0.0, upper=1e6, description='f_0.', symbol='f_0', start=lambda typical: 0.5 * typical.friction
    )
    friction_at_one_bar: float = parameter(
        unit='N',
        lower=0.0,
        upper=1e6,
        description='k, what a pressure of 1 bar adds.',
        symbol='k',
        start=_friction_at_one_bar,
    )
    pressure_exponent: float = parameter(
        unit='1', lower=0.05, upper=2.0, description='m.', symbol='m', start=lambda _: ELASTIC_EXPONENT
    )
