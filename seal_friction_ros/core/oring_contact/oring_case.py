"""What is to be computed: ring, gland, rubber, and how finely."""

import math
from dataclasses import dataclass
from itertools import pairwise

from seal_friction_ros.core.foundation.parameters import check, parameter
from seal_friction_ros.core.friction.geometry import SealGeometry, stretch
from seal_friction_ros.core.oring_contact.extrusion import extrusion_pressure
from seal_friction_ros.core.oring_contact.material import Rubber


@dataclass(frozen=True)
class Groove:
    """What of the gland is not in its diameters.

    Raises:
        ValueError: A dimension is out of bounds.
    """

    width: float = parameter(unit='m', lower=1e-4, upper=1.0, description='Axial width between the two walls.')
    diametral_clearance: float = parameter(
        0.0, unit='m', lower=0.0, upper=0.01, description='Difference of the diameters behind the downstream wall.'
    )

    def __post_init__(self) -> None:
        check(self)


@dataclass(frozen=True)
class OringNumerics:
    """How finely it is computed. Defaults of ``lines`` and ``penalty`` converge the normal force to 1 %.

    ``transition`` is a choice: a sharp one (0.01) makes 3.0 to 3.6 % more normal force under pressure: docs/oring.md.

    Raises:
        ValueError: A number is out of bounds.
    """

    lines: int = parameter(
        33, unit='', lower=9, upper=129, description='Grid lines that end on the quarter of the section facing the rod.'
    )
    penalty: float = parameter(
        2000.0, unit='1', lower=50.0, upper=1e5, description='Contact stress over depth inside a wall, times d / E.'
    )
    transition: float = parameter(
        0.05, unit='1', lower=0.002, upper=0.2, description='Width of the transition from fluid to contact over E.'
    )
    guide: float = parameter(
        0.05, unit='1', lower=0.0, upper=10.0, description='Guide against rolling over 2 pi R E; 0 is none.'
    )

    def __post_init__(self) -> None:
        check(self)


@dataclass(frozen=True, kw_only=True)
class OringCase:
    """A ring in its gland.

    ``wall_friction`` holds the ring back, at rod and gland alike, as where rising pressure has pushed it towards the
    wall; without pressure there is none. The known cases have none at all: it is there to show what it would change.

    Raises:
        ValueError: A number is out of bounds, the ring is not squeezed, or its rubber does not fit in the gland.
    """

    name: str
    geometry: SealGeometry
    groove: Groove
    rubber: Rubber
    numerics: OringNumerics = OringNumerics()
    wall_friction: float = parameter(
        0.0, unit='1', lower=0.0, upper=0.1, description='Traction of rod and gland on the ring over contact stress.'
    )

    def __post_init__(self) -> None:
        check(self)
        gap = (self.geometry.gland_diameter - self.geometry.rod_diameter) / 2.0
        section = stretched_section_diameter(self.geometry)
        if section <= gap:
            raise ValueError(
                f'OringCase.geometry: no squeeze: stretched over the rod, section_diameter = '
                f'{self.geometry.section_diameter} m becomes {section:.6g} m and the gap between rod and gland is '
                f'{gap:.6g} m'
            )
        fill = gland_fill(self.geometry, self.groove)
        if fill >= 1.0:
            raise ValueError(
                f'OringCase.groove: overfilled gland: the rubber has {100.0 * fill:.1f} % of its volume; widen '
                f'groove.width = {self.groove.width} m'
            )


def stretched_section_diameter(geometry: SealGeometry) -> float:
    """Section diameter of the ring once it is on the rod [m]: its volume stays, so d sqrt((d_i + d) / (D + d')).

    A ring that is loose on the rod keeps its own. Source: volume; that the section stays round is an estimate of ours,
    used only to refuse what cannot be squeezed.
    """
    if stretch(geometry) <= 0.0:
        return geometry.section_diameter
    section = geometry.section_diameter
    volume = section**2 * (geometry.ring_inner_diameter + section)
    for _ in range(20):  # converges by a factor of some 20 each time
        section = math.sqrt(volume / (geometry.rod_diameter + section))
    return section


def gland_fill(geometry: SealGeometry, groove: Groove) -> float:
    """Volume of the ring over that of its gland [-]."""
    d = geometry.section_diameter
    ring = math.pi**2 / 4.0 * d**2 * (geometry.ring_inner_diameter + d)
    gland = math.pi / 4.0 * (geometry.gland_diameter**2 - geometry.rod_diameter**2) * groove.width
    return ring / gland


def check_pressures(case: OringCase, pressures: tuple[float, ...]) -> None:
    """Check that pressures [Pa, gauge] can be computed one after the other.

    Raises:
        ValueError: There are none, they are not finite or negative, do not increase, or extrude the ring.
    """
    if not pressures:
        raise ValueError(f'case {case.name}: no pressures to compute')
    for pressure in pressures:
        if not (math.isfinite(pressure) and pressure >= 0.0):
            raise ValueError(f'case {case.name}: pressure {pressure} Pa is not a gauge pressure of 0 or more')
    if any(high <= low for low, high in pairwise(pressures)):
        raise ValueError(f'case {case.name}: pressures {list(pressures)} Pa do not increase')
    limit = extrusion_pressure(case.groove.diametral_clearance, case.rubber.elastic_modulus)
    if pressures[-1] > limit:
        raise ValueError(
            f'case {case.name}: a pressure of {pressures[-1]:.6g} Pa extrudes the ring through a diametral clearance '
            f'of {case.groove.diametral_clearance} m: up to {limit:.3g} Pa without a back-up ring'
        )
