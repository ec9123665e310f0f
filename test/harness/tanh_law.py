"""Friction that rises as a tanh of the pressure and falls exponentially with the speed."""

import math
from dataclasses import dataclass

from seal_friction_ros.core.foundation.parameters import parameter
from seal_friction_ros.core.friction.laws.law import FrictionLaw


def tanh_law(
    friction_at_no_pressure: float,
    pressure_friction: float,
    saturation_pressure: float,
    decay_speed: float,
    pressure: float,
    speed: float,
) -> float:
    """F = [f_0 + f_P tanh(P / P_s)] exp(-v / v_d) [N]."""
    at_rest = friction_at_no_pressure + pressure_friction * math.tanh(pressure / saturation_pressure)
    return at_rest * math.exp(-speed / decay_speed)


@dataclass(frozen=True)
class TanhLaw(FrictionLaw):
    r"""Friction that saturates with pressure and decays with speed.

    .. math:: F = [f_0 + f_P \tanh(P / P_s)]\,e^{-v / v_d}

    A toy law; the form is our choice.
    """

    NAME = 'tanh_law'
    FORMULA = '(f_0 + f_P tanh(P / P_s)) exp(-v / v_d)'
    function = staticmethod(tanh_law)

    friction_at_no_pressure: float = parameter(
        unit='N',
        lower=0.0,
        upper=1e6,
        description='f_0, friction without pressure.',
        symbol='f_0',
        start=lambda typical: 0.5 * typical.friction,
    )
    pressure_friction: float = parameter(
        unit='N',
        lower=0.0,
        upper=1e6,
        description='f_P, friction that a high pressure adds.',
        symbol='f_P',
        start=lambda typical: typical.friction,
    )
    saturation_pressure: float = parameter(
        unit='Pa',
        lower=1e3,
        upper=1e9,
        description='P_s, pressure that adds 76 % of f_P.',
        symbol='P_s',
        start=lambda typical: max(typical.pressure, 1e5),
    )
    decay_speed: float = parameter(
        unit='m/s',
        lower=1e-3,
        upper=1e3,
        description='v_d, speed at which friction has fallen to 37 %.',
        symbol='v_d',
        start=lambda typical: max(2.0 * typical.speed, 1e-3),
        fit_bounds=(1e-3, 100.0),
    )
    reference_speed: float = parameter(
        0.0, unit='m/s', lower=0.0, upper=1e3, description='Speed at which the friction counts as Coulomb friction.'
    )
