"""Input of the computation: ring, gland, rubber and discretisation; the pressure at which the ring extrudes."""

import math
from dataclasses import dataclass, field
from itertools import pairwise

from seal_friction_ros.core.foundation.parameters import CheckedParameters, parameter
from seal_friction_ros.core.foundation.units import INCH, PSI
from seal_friction_ros.core.friction.geometry import SealGeometry, stretch
from seal_friction_ros.core.oring_contact.material import (
    Rubber,
    elastic_modulus_of_hardness,
    hardness_of_elastic_modulus,
)
from seal_friction_ros.core.oring_contact.section import Section, placed


@dataclass(frozen=True)
class Groove(CheckedParameters):
    """Dimensions of the gland besides its diameters; ValueError: a dimension is out of bounds."""

    width: float = parameter(unit='m', lower=1e-4, upper=1.0, description='Axial distance between the two side walls.')
    diametral_clearance: float = parameter(
        0.0, unit='m', lower=0.0, upper=0.01, description='Diametral clearance behind the downstream wall.'
    )


@dataclass(frozen=True)
class OringNumerics(CheckedParameters):
    """Discretisation. The default ``lines`` and ``penalty`` converge the normal force to 1 %.

    ``transition`` is our choice; a sharp one (0.01) raises the normal force under pressure by 3.0 to 3.6 %:
    docs/oring.md.
    """

    lines: int = parameter(
        33,
        unit='',
        lower=9,
        upper=129,
        description='Grid lines that end on the quarter of the outline that faces the rod.',
    )
    penalty: float = parameter(
        2000.0,
        unit='1',
        lower=50.0,
        upper=1e5,
        description='Penalty stiffness: contact stress per penetration depth, times d / E.',
    )
    transition: float = parameter(
        0.05, unit='1', lower=0.002, upper=0.2, description='Width of the transition from fluid to contact, over E.'
    )
    guide: float = parameter(
        0.05,
        unit='1',
        lower=0.0,
        upper=10.0,
        description='Stiffness of the guide against rolling, over 2 pi R E; 0: no guide.',
    )


@dataclass(frozen=True, kw_only=True)
class OringCase(CheckedParameters):
    """A ring in its gland.

    ``wall_friction`` opposes the motion of the ring towards the downstream wall, on rod and gland alike; it acts only
    under pressure. All case files in config/oring leave it at 0; it serves sensitivity studies. ValueError: a value is
    out of bounds, the ring is not squeezed, or the gland is overfilled.
    """

    name: str
    geometry: SealGeometry
    groove: Groove
    rubber: Rubber
    numerics: OringNumerics = OringNumerics()
    wall_friction: float = parameter(
        0.0,
        unit='1',
        lower=0.0,
        upper=0.1,
        description='Axial traction of rod and gland on the ring, over contact stress.',
    )
    section: Section | None = field(default=None, compare=False)  # None: round; scaled to the height of the geometry
    cap: Rubber | None = None  # material of the cap of the section

    def __post_init__(self) -> None:
        super().__post_init__()
        gap = (self.geometry.gland_diameter - self.geometry.rod_diameter) / 2.0
        section = stretched_section_diameter(self.geometry)
        if self.section is None and section <= gap:
            raise ValueError(
                f'OringCase.geometry: no squeeze: stretched over the rod, section_diameter = '
                f'{self.geometry.section_diameter} m becomes {section:.6g} m and the gap between rod and gland is '
                f'{gap:.6g} m'
            )
        fill = gland_fill(self.geometry, self.groove, self.section)
        if fill >= 1.0:
            raise ValueError(
                f'OringCase.groove: overfilled gland: the rubber has {100.0 * fill:.1f} % of its volume; widen '
                f'groove.width = {self.groove.width} m'
            )


def stretched_section_diameter(geometry: SealGeometry) -> float:
    """Section diameter of the ring on the rod [m]: d' = d sqrt((d_i + d) / (D + d')), at constant volume.

    A ring that is loose on the rod keeps d. The section is taken as round (our choice): this estimate serves only to
    reject rings that cannot be squeezed.
    """
    if stretch(geometry) <= 0.0:
        return geometry.section_diameter
    section = geometry.section_diameter
    volume = section**2 * (geometry.ring_inner_diameter + section)
    for _ in range(20):  # the error falls by a factor of about 20 per iteration
        section = math.sqrt(volume / (geometry.rod_diameter + section))
    return section


def gland_fill(geometry: SealGeometry, groove: Groove, section: Section | None = None) -> float:
    """Volume of the ring, round or of a ``section``, over volume of the gland [-]."""
    d = geometry.section_diameter
    if section is None:
        ring = math.pi**2 / 4.0 * d**2 * (geometry.ring_inner_diameter + d)
    else:
        ring = placed(section, geometry.ring_inner_diameter, d).volume
    gland = math.pi / 4.0 * (geometry.gland_diameter**2 - geometry.rod_diameter**2) * groove.width
    return ring / gland


def check_pressures(case: OringCase, pressures: tuple[float, ...]) -> None:
    """Check pressures [Pa, gauge] for a computation in increasing order.

    ValueError: the pressures are empty, not finite, negative or not increasing, or extrude the ring.
    """
    if not pressures:
        raise ValueError(f'case {case.name}: no pressures to compute')
    for pressure in pressures:
        if not (math.isfinite(pressure) and pressure >= 0.0):
            raise ValueError(f'case {case.name}: pressure {pressure} Pa is not a gauge pressure, finite and 0 or more')
    if any(high <= low for low, high in pairwise(pressures)):
        raise ValueError(f'case {case.name}: pressures {list(pressures)} Pa do not increase')
    limit = extrusion_pressure(case.groove.diametral_clearance, case.rubber.modulus)
    if pressures[-1] > limit:
        raise ValueError(
            f'case {case.name}: a pressure of {pressures[-1]:.6g} Pa extrudes the ring through a diametral clearance '
            f'of {case.groove.diametral_clearance} m: the limit without a back-up ring is {limit:.3g} Pa'
        )


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
