"""A seal rubs otherwise towards the pressure that it holds back than away from it."""

from dataclasses import dataclass

from seal_friction_ros.core.foundation.parameters import CheckedParameters, parameter


@dataclass(frozen=True)
class PressureAsymmetry(CheckedParameters):
    r"""Friction of one seal by the direction of its motion relative to its pressure P.

    .. math:: F = F_{mean}\,\big(1 \pm b \min(P / P_{full}, 1)\big)

    with + where the seal moves over its wall towards the pressure: a rod seal where the rod comes out of its chamber, a
    piston seal where the piston moves against the higher pressure. Sliding friction and breakaway have the same share,
    and it grows linearly from no pressure on, so that the friction of a piston seal does not jump where the pressure
    difference changes its sign (our choice).
    """

    asymmetry: float = parameter(
        unit='1',
        lower=-0.9,
        upper=0.9,
        description='b, share by which friction is larger towards the pressure and smaller away from it.',
    )
    full_pressure: float = parameter(
        unit='Pa', lower=1.0, upper=1e9, description='P_full, pressure from which the share is whole.'
    )
