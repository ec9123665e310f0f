"""A seal with the quantities that stay constant while it slides, the film at rest, and the friction of a film."""

import math
from dataclasses import dataclass

import numpy as np
from scipy.special import erf

from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.foundation.compiled import compiled
from seal_friction_ros.core.lubrication.contact import (
    THINNEST,
    ContactState,
    LubricatedContact,
    dry_contact,
)
from seal_friction_ros.core.lubrication.flow_factors import shear_stress_factors
from seal_friction_ros.core.lubrication.grease import apparent_viscosity
from seal_friction_ros.core.lubrication.lubrication_case import LubricationCase
from seal_friction_ros.core.lubrication.reynolds import FilmEnds


@dataclass(frozen=True, eq=False)
class LubricationModel:
    """A seal under pressure on a plain wall; `profile_model` or `oring_film` makes it."""

    case: LubricationCase
    contact: LubricatedContact
    place: FloatArray  # cells along the seal from its crown [m], shape (n,)
    ambient: FloatArray  # pressure of what is beside the seal, along it [Pa], shape (n,)
    profile: FloatArray
    """gap to a plain wall without film and asperities, less the deflection by what is beside it [m], shape (n,)"""
    circumference: float  # [m]
    pressure_left: float  # [Pa, gauge]
    pressure_right: float  # [Pa, gauge]

    @property
    def film_width(self) -> float:
        """Length of the film region [m]."""
        return self.contact.body.cells * self.contact.body.cell_width

    def ends(self, left: float = 1.0, right: float = 1.0) -> FilmEnds:
        """Pressure beyond both ends of the film, and saturation of the inflow."""
        return FilmEnds(self.pressure_left, self.pressure_right, left, right)


def profile_model(case: LubricationCase, pressure_left: float, pressure_right: float) -> LubricationModel:
    """Model of a seal that is no O-ring, under pressures on both sides [Pa, gauge].

    The fluid acts on the seal from all sides, and rubber transmits its pressure like a fluid: only the pressure above
    it deflects the seal. It falls linearly over the middle half of the film (our choice). ValueError: the grid does not
    fit the seal.
    """
    numerics = case.numerics
    width = numerics.film_width / numerics.cells
    body = case.elastic_body()
    place: FloatArray = np.asarray((np.arange(numerics.cells) + 0.5) * width - 0.5 * numerics.film_width)
    passed = np.clip(0.5 + 2.0 * place / numerics.film_width, 0.0, 1.0)
    ambient = pressure_left + passed * (pressure_right - pressure_left)
    interference = case.seal.interference + case.air.pressure_interference * abs(pressure_left - pressure_right)
    profile = case.seal.fall(place) - interference - body.deflection(ambient)
    contact = LubricatedContact(body, case.topography, case.grease)
    circumference = math.pi * case.seal.sealing_diameter
    return LubricationModel(case, contact, place, ambient, profile, circumference, pressure_left, pressure_right)


def film_at_rest(model: LubricationModel) -> ContactState:
    """Film of a flooded seal at rest: dry contact, the gap filled; NotConvergedError: the dry contact was not found."""
    gap = dry_contact(model.contact, model.profile + model.contact.body.deflection(model.ambient))
    return ContactState(gap, np.array(model.ambient), np.ones(len(gap)))


def fluid_force(model: LubricationModel, state: ContactState, velocity: float) -> float:
    """Fluid friction [N] at a sliding ``velocity`` [m/s]."""
    numbers, width = model.case.grease.numbers, model.contact.body.cell_width
    roughness = model.contact.stress_roughness
    return -model.circumference * float(fluid_shear(*state, -velocity, numbers, width, model.ends(), roughness))


def solid_limit(model: LubricationModel, state: ContactState) -> float:
    """Magnitude of the solid friction [N] of a sliding contact."""
    return model.circumference * solid_shear(model.contact, state.gap, model.case.seal.solid_shear_stress)


def real_area_share(contact: LubricatedContact, gap: FloatArray) -> FloatArray:
    """Local share A_real of the surface that touches, shape (n,), at a ``gap`` [m]; see `Topography`."""
    pressure, _ = contact.asperity_pressure(gap)
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
