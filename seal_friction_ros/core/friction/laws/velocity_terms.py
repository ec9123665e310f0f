"""What the velocity adds to a law that does not depend on the speed: viscous and Stribeck friction, asymmetry."""

import math
from dataclasses import dataclass

from seal_friction_ros.core.foundation.compiled import compilable
from seal_friction_ros.core.foundation.parameters import CheckedParameters, parameter


@dataclass(frozen=True)
class VelocityTerms(CheckedParameters):
    r"""Sliding friction of a seal beyond its Coulomb friction.

    .. math:: F = [f_c + \sigma |v|\,(1 + q\,\mathrm{sgn}(v)) + (f_S + r f_c)\,e^{-|v|/v_S}]\,(1 + a\,\mathrm{sgn}(v))

    Mixed friction is a share r of the Coulomb friction, so that it rises with the pressure, too; that of a film is not.

    Source: [Armstrong1994]_ eq. (5) with an exponent of 1, which is our choice, as are both asymmetries.
    """

    viscous_friction: float = parameter(
        0.0,
        unit='N s/m',
        lower=0.0,
        upper=1e7,
        description='sigma, viscous friction.',
        symbol='sigma',
        start=lambda typical: 0.2 * typical.friction / max(typical.speed, 1e-6),
    )
    stribeck_friction: float = parameter(
        0.0,
        unit='N',
        lower=0.0,
        upper=1e6,
        description='f_S, friction of the slowest motion above Coulomb friction.',
        symbol='f_S',
        start=lambda typical: 0.2 * typical.friction,
    )
    stribeck_velocity: float = parameter(
        0.01,
        unit='m/s',
        lower=1e-6,
        upper=10.0,
        description='v_S, speed at which Stribeck friction has fallen to 37 %.',
        symbol='v_S',
        start=lambda typical: min(0.1 * max(typical.speed, 1e-6), 1.0),
        fit_bounds=(1e-4, 1.0),
    )
    asymmetry: float = parameter(
        0.0,
        unit='1',
        lower=-0.9,
        upper=0.9,
        description='a, share by which friction is larger on extension and smaller on retraction.',
        symbol='a',
        start=lambda _: 0.0,
    )
    stribeck_ratio: float = parameter(
        0.0,
        unit='1',
        lower=0.0,
        upper=10.0,
        description='r, likewise, as a share of f_c.',
        symbol='r',
        start=lambda _: 0.1,
    )
    viscous_asymmetry: float = parameter(
        0.0,
        unit='1',
        lower=-0.9,
        upper=0.9,
        description='q, that of viscous friction alone.',
        symbol='q',
        start=lambda _: 0.0,
    )


NO_VELOCITY_TERMS = VelocityTerms()


@compilable
def with_velocity_terms(terms: VelocityTerms, coulomb_friction: float, speed: float, direction: int) -> float:
    """Sliding friction [N]: the equation of `VelocityTerms`."""
    viscous = terms.viscous_friction * speed
    if terms.viscous_asymmetry != 0.0:
        viscous *= 1.0 + terms.viscous_asymmetry if direction > 0 else 1.0 - terms.viscous_asymmetry
    sliding = coulomb_friction + viscous
    if terms.stribeck_friction > 0.0 or terms.stribeck_ratio > 0.0:
        stribeck = terms.stribeck_friction + terms.stribeck_ratio * coulomb_friction
        sliding += stribeck * math.exp(-speed / terms.stribeck_velocity)
    return sliding * (1.0 + terms.asymmetry if direction > 0 else 1.0 - terms.asymmetry)
