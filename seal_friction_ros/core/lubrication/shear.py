"""Friction of a contact: shear of the film, and of the asperities that touch."""

import numpy as np
from scipy.special import erf

from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.foundation.compiled import compiled
from seal_friction_ros.core.lubrication.contact import THINNEST, LubricatedContact, asperity_pressure
from seal_friction_ros.core.lubrication.flow_factors import shear_stress_factors
from seal_friction_ros.core.lubrication.grease import apparent_viscosity
from seal_friction_ros.core.lubrication.reynolds import FilmEnds


def real_area_share(contact: LubricatedContact, gap: FloatArray) -> FloatArray:
    """Local share A_real of the surface that touches, shape (n,), at a ``gap`` [m]; see `Topography`."""
    pressure, _ = asperity_pressure(gap, contact.asperities)
    return np.asarray(erf(pressure / contact.topography.real_area_pressure(contact.body.modulus)))


def solid_shear(contact: LubricatedContact, gap: FloatArray, solid_shear_stress: float) -> float:
    """Solid shear force [N/m]: integral of tau_c A_real over the seal.

    Source: spool-valve paper, equation (2).
    """
    return solid_shear_stress * float(real_area_share(contact, gap).sum()) * contact.body.cell_width


@compiled
def fluid_shear(
    gap: FloatArray,
    pressure: FloatArray,
    saturation: FloatArray,
    wall_velocity: float,
    grease: tuple[float, float, float, float, float],
    width: float,
    ends: FilmEnds,
    roughness: tuple[float, tuple[float, ...]],
) -> float:
    """Shear force of the film on the seal [N/m], in the direction of the moving wall if positive with its velocity.

    tau = eta(gamma) gamma with the rate at the seal surface, gamma = U / h - h p' / (2 eta(U / h)); streamers of a
    cavitated film shear with their share (our choice). Arguments as in `ContactState` and `reynolds.reynolds_rows`;
    ``roughness`` as in `LubricatedContact.stress_roughness`: with it both parts of the rate have the factors of
    `shear_stress_factors` (of an apparent viscosity: our choice).

    Source: spool-valve paper, equation (1).
    """
    n = gap.shape[0]
    rms, coefficients = roughness
    total = 0.0
    for i in range(n):
        left = pressure[i - 1] if i > 0 else 2.0 * ends[0] - pressure[0]
        right = pressure[i + 1] if i < n - 1 else 2.0 * ends[1] - pressure[n - 1]
        couette = wall_velocity / gap[i]
        poiseuille = gap[i] * (right - left) / (4.0 * width * apparent_viscosity(grease, couette))
        if rms > 0.0:
            by_sliding, by_pressure = shear_stress_factors(coefficients, max(gap[i], THINNEST) / rms)
            couette, poiseuille = by_sliding * couette, by_pressure * poiseuille
        rate = couette - poiseuille
        total += saturation[i] * apparent_viscosity(grease, rate) * rate
    return total * width
