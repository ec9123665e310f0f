"""Cylinder: two chambers, and a rod through both ends (balanced) or through one (single rod)."""

import math
from dataclasses import dataclass

from seal_friction_ros.core.foundation.parameters import CheckedParameters, parameter
from seal_friction_ros.core.foundation.units import INCH

AMBIENT = 101325.0  # [Pa, absolute] zero of gauge pressure
BALANCED, SINGLE_ROD = 'balanced', 'single_rod'
"""Values of `Cylinder.type`. Balanced: the rod goes through both ends, so both chambers have the annular area."""


@dataclass(frozen=True)
class Cylinder(CheckedParameters):
    """Cylinder, hydraulic or pneumatic.

    The stroke runs from -stroke/2 to +stroke/2; chamber a extends the rod (positive). The rod of a single-rod cylinder
    goes through chamber b.

    ValueError: a value is out of bounds, the type is unknown, the bore is not wider than the rod, or the dead volume is
    too small.
    """

    type: str = parameter(
        BALANCED, unit='', choices=(BALANCED, SINGLE_ROD), description='balanced (two equal areas) or single_rod.'
    )
    rod_diameter: float = parameter(0.625 * INCH, unit='m', lower=1e-4, upper=1.0, description='Rod diameter.')
    bore_diameter: float = parameter(0.75 * INCH, unit='m', lower=1e-4, upper=2.0, description='Bore diameter.')
    stroke: float = parameter(0.05, unit='m', lower=1e-4, upper=10.0, description='Distance between the stops.')
    dead_volume: float = parameter(
        2e-6, unit='m3', lower=1e-9, upper=1.0, description='Volume of each chamber, with its line, at its stop.'
    )
    internal_leakage: float = parameter(
        1e-14, unit='m3/(s Pa)', lower=0.0, upper=1e-8, description='Oil: laminar leakage past the piston.'
    )
    external_leakage: float = parameter(
        0.0, unit='m3/(s Pa)', lower=0.0, upper=1e-8, description='Oil: laminar leakage of each chamber to ambient.'
    )
    bulk_modulus: float = parameter(7e8, unit='Pa', lower=1e7, upper=5e9, description='Effective: oil, lines, walls.')
    vapour_pressure: float = parameter(1e3, unit='Pa', lower=1.0, upper=1e5, description='Of the oil, absolute.')

    def __post_init__(self) -> None:
        super().__post_init__()
        self.check_order('bore_diameter', 'rod_diameter')
        swept = self.area_a * self.stroke
        if self.dead_volume < 0.01 * swept:
            what = f'{self.dead_volume} m3 is below 1 % of the swept volume {swept:.3g} m3'
            raise ValueError(f'Cylinder.dead_volume = {what}: a chamber without volume is infinitely stiff')

    @property
    def area_a(self) -> float:
        """Piston area of chamber a [m^2]: pi/4 D_bore^2, of a balanced cylinder as `area_b`."""
        return math.pi / 4.0 * self.bore_diameter**2 if self.type == SINGLE_ROD else self.area_b

    @property
    def area_b(self) -> float:
        """Piston area of chamber b [m^2]: pi/4 (D_bore^2 - D_rod^2)."""
        return math.pi / 4.0 * (self.bore_diameter**2 - self.rod_diameter**2)

    @property
    def rod_area(self) -> float:
        """A_a - A_b [m^2]: 0 of a balanced cylinder."""
        return self.area_a - self.area_b

    @property
    def area_ratio(self) -> float:
        """A_b / A_a [-]: 1 of a balanced cylinder."""
        return self.area_b / self.area_a

    @property
    def mid_volume_a(self) -> float:
        """Volume of chamber a at position 0 [m^3]: A_a stroke / 2 + V_dead."""
        return (self.area_a * self.stroke + 2.0 * self.dead_volume) / 2.0

    @property
    def mid_volume_b(self) -> float:
        """Volume of chamber b at position 0 [m^3]: A_b stroke / 2 + V_dead."""
        return (self.area_b * self.stroke + 2.0 * self.dead_volume) / 2.0

    @property
    def limit(self) -> float:
        """Position of the stops [m]."""
        return self.stroke / 2.0

    @property
    def vapour(self) -> float:
        """Vapour pressure [Pa, gauge]."""
        return self.vapour_pressure - AMBIENT


def pressure_force(cylinder: Cylinder, pressure_a: float, pressure_b: float) -> float:
    """Force of the pressures on the rod [N], A_a p_a - A_b p_b, from pressures [Pa, gauge], positive on extension."""
    return cylinder.area_b * (pressure_a - pressure_b) + cylinder.rod_area * pressure_a
