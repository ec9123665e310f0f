"""Hertzian line contact: the limit of the finite-element ring for large ring radius and small squeeze."""

import math
from typing import NamedTuple

from scipy.optimize import brentq


class LineContact(NamedTuple):
    """Contact of a cylinder with a plate."""

    force_per_length: float
    """[N/m]"""
    peak_stress: float
    """[Pa]"""
    width: float
    """[m]"""


def cylinder_between_plates(squeeze: float, diameter: float, plane_modulus: float) -> LineContact:
    r"""Contact of a cylinder with each of two rigid plates.

    .. math:: s\,d = 2 \frac{F}{\pi E^*} \left(2 \ln\frac{2 d}{a} - 1\right), \quad a^2 = \frac{2 F d}{\pi E^*}, \quad
        p_0 = \frac{2 F}{\pi a}

    Args:
        squeeze: Approach of the plates over the cylinder diameter, s [-].
        diameter: d [m].
        plane_modulus: E* = E / (1 - nu^2) [Pa], 4/3 E for rubber.

    Source: [Johnson1985]_ equations (4.43), (4.45), and (5.57) applied to both contacts.
    """

    def half_width(force: float) -> float:
        return math.sqrt(2.0 * force * diameter / (math.pi * plane_modulus))

    def excess_approach(force: float) -> float:
        approach = 2.0 * force / (math.pi * plane_modulus) * (2.0 * math.log(2.0 * diameter / half_width(force)) - 1.0)
        return approach - squeeze * diameter

    scale = plane_modulus * diameter  # [N/m]
    force = float(brentq(excess_approach, 1e-9 * scale, 0.2 * scale, xtol=1e-12 * scale))
    return LineContact(force, 2.0 * force / (math.pi * half_width(force)), 2.0 * half_width(force))
