"""Roughness of seal and wall: contact pressure and real area of contact."""

import math
from dataclasses import dataclass

import numpy as np

from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.foundation.parameters import CheckedParameters, parameter
from seal_friction_ros.core.lubrication.flow_factors import flow_factor_coefficients

_LEAST_SHARE = 0.02  # of the separation length
_FURTHEST = 700.0  # [-] separation over decay length from which on the asperities bear nothing: 1 / e^700


@dataclass(frozen=True)
class Topography(CheckedParameters):
    r"""Combined roughness of seal and wall; all values are our choice (that of the paper is not public).

    Contact pressure falls exponentially with the mean separation of the surfaces, and the real area of contact follows
    from the contact pressure alone:

    .. math:: p_c = 0.375\,q_0 h_{rms} E^* e^{-h / (0.486\,h_{rms})},\quad
        A_{real} = \mathrm{erf}\big(\sqrt 2\,p_c / (E^* h'_{rms})\big)

    with q_0 = 2 pi / ``roll_off_length`` and h'_rms the ``rms_slope``. The exponential is that of partial contact: its
    pressure at h = 0 is finite. With ``filling`` it is :math:`e^{h / l} - 1` in the place of :math:`e^{h / l}`, which
    is the same for small pressures and keeps the gap open at any pressure (our choice).

    Below zero separation (with ``filling``, below 2 % of l) the law goes on as its tangent (our choice: a converged
    result is never there, but a Newton iteration may be). ValueError: a value is out of bounds, there are no flow
    factors for the Peklenik number, or the slope is less than roughness of that height can have.

    Source: B. N. J. Persson 2001 (area), 2007 (separation); the two numbers hold for a self-affine surface of Hurst
    exponent 0.8.
    """

    rms_height: float = parameter(
        2e-6, unit='m', lower=1e-9, upper=1e-4, description='Combined rms roughness of both surfaces, h_rms.'
    )
    rms_slope: float = parameter(0.8, unit='1', lower=1e-3, upper=5.0, description='Combined rms slope.')
    roll_off_length: float = parameter(
        25e-6, unit='m', lower=1e-7, upper=1e-2, description='Longest wavelength of the roughness, 2 pi / q_0.'
    )
    wall_share: float = parameter(
        0.5,
        unit='1',
        lower=0.0,
        upper=1.0,
        description='Share of the wall in the square of the rms roughness; 0.5 cancels the shear flow.',
    )
    peklenik_number: float = parameter(
        1.0, unit='1', lower=1.0, upper=9.0, description='Length of the roughness along over across the motion.'
    )
    filling: bool = parameter(
        False,
        unit='',
        description='Whether the seal fills the roughness: the contact pressure grows without bound as the gap closes. '
        'For a soft seal under high pressure.',
    )
    shear_stress_factors: bool = parameter(
        False,
        unit='1',
        description='Whether roughness raises the shear of the film; the equation (1) of the paper is without.',
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        flow_factor_coefficients(self.peklenik_number)
        least = 2.0 * math.pi * self.rms_height / self.roll_off_length
        if self.rms_slope < least:
            raise ValueError(
                f'Topography.rms_slope = {self.rms_slope} is below {least:.4g}, that of one wave of rms_height and '
                'roll_off_length: raise it, or make the roughness lower or longer'
            )

    @property
    def separation_length(self) -> float:
        """Separation over which the contact pressure falls by a factor e [m]."""
        return 0.486 * self.rms_height

    def contact_stiffness(self, modulus: float) -> float:
        """Contact pressure at no separation [Pa] for a plane-strain ``modulus`` E* [Pa]."""
        return 0.375 * 2.0 * math.pi / self.roll_off_length * self.rms_height * modulus

    def real_area_pressure(self, modulus: float) -> float:
        """Contact pressure [Pa] at which the argument of the error function in A_real is 1."""
        return modulus * self.rms_slope / math.sqrt(2.0)


def contact_pressure(
    stiffness: float, length: float, filling: bool, separation: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Pressure p_c [Pa] of the asperities and its derivative [Pa/m] at a mean ``separation`` [m]; see `Topography`."""
    least, less = (_LEAST_SHARE, 1.0) if filling else (0.0, 0.0)
    ratio = np.clip(separation / length, least, _FURTHEST)
    share = np.where(ratio < _FURTHEST, 1.0 / (np.exp(ratio) - less), 0.0)
    slope = -stiffness * share * (1.0 + less * share) / length
    return stiffness * share + slope * np.minimum(separation - least * length, 0.0), slope
