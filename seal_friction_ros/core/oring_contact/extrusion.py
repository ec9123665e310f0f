"""Pressure at which an O-ring extrudes through the clearance between rod and gland."""

import math

from seal_friction_ros.core.foundation.units import INCH, PSI
from seal_friction_ros.core.oring_contact.material import elastic_modulus_of_hardness, hardness_of_elastic_modulus

_PRESSURES = (500.0 * PSI, 1000.0 * PSI, 1500.0 * PSI, 2000.0 * PSI, 3000.0 * PSI)  # [Pa]
_CLEARANCES = {
    70.0: (0.016 * INCH, 0.010 * INCH, 0.006 * INCH, 0.004 * INCH, 0.002 * INCH),  # [m]
    90.0: (0.028 * INCH, 0.024 * INCH, 0.020 * INCH, 0.016 * INCH, 0.010 * INCH),
}
"""Shore A -> largest diametral clearance at each of `_PRESSURES`"""


def extrusion_pressure(diametral_clearance: float, elastic_modulus: float) -> float:
    """Highest pressure [Pa, gauge] without a back-up ring, from the clearance behind it [m] and the modulus E [Pa].

    The logarithm of the pressure is interpolated linearly over clearance (and extrapolated beyond the table), then over
    hardness from 70 to 90 Shore A. Below 70 Shore A the limit of 70 is scaled with the modulus; above 90 the limit of
    90 holds.

    Source: [SealDesign]_, Limits of Diametral Clearance Against Fluid Pressure, at the upper end of each band.
    Interpolation and extrapolation are our choice.
    """
    soft = _limit(_CLEARANCES[70.0], diametral_clearance)
    at_70 = elastic_modulus_of_hardness(70.0)
    if elastic_modulus <= at_70:
        return soft * elastic_modulus / at_70
    hard = _limit(_CLEARANCES[90.0], diametral_clearance)
    share = (min(hardness_of_elastic_modulus(elastic_modulus), 90.0) - 70.0) / 20.0
    return math.exp((1.0 - share) * math.log(soft) + share * math.log(hard))


def _limit(clearances: tuple[float, ...], clearance: float) -> float:
    """Pressure limit [Pa] at a clearance [m], from the enclosing interval of the falling clearances or the end one."""
    i = next((i for i in range(1, len(clearances) - 1) if clearance >= clearances[i]), len(clearances) - 1)
    share = (clearance - clearances[i]) / (clearances[i - 1] - clearances[i])
    return math.exp(math.log(_PRESSURES[i]) + share * math.log(_PRESSURES[i - 1] / _PRESSURES[i]))
