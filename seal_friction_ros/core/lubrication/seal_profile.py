"""A seal that is no O-ring: its profile, what it is made of, and the grid along it."""

from dataclasses import dataclass

import numpy as np

from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.foundation.parameters import CheckedParameters, parameter

BODIES = ('half_plane', 'finite_elements')


@dataclass(frozen=True)
class SealBody(CheckedParameters):
    """Shape and material of the seal. Shape: our choice (the paper's is confidential); material: Table 1.

    ValueError: a value is out of bounds, or the material has no stiffness.
    """

    sealing_diameter: float = parameter(
        6e-3, unit='m', lower=1e-4, upper=10.0, description='Of the seat (paper: 6 mm).'
    )
    crown_radius_left: float = parameter(
        1e-3, unit='m', lower=1e-5, upper=1.0, description='Radius of the profile left of its crown.'
    )
    crown_radius_right: float = parameter(
        1e-3, unit='m', lower=1e-5, upper=1.0, description='Radius of the profile right of its crown.'
    )
    interference: float = parameter(
        36e-6, unit='m', lower=0.0, upper=1e-2, description='How far the undeformed crown overlaps the wall.'
    )
    section_height: float = parameter(
        1e-3, unit='m', lower=1e-5, upper=0.1, description='Depth at which the seal is held.'
    )
    body: str = parameter(
        'half_plane',
        unit='',
        choices=BODIES,
        description='half_plane: the kernel of a half-plane, zero at the section height. finite_elements: a crowned '
        'section of that height.',
    )
    section_width: float = parameter(
        1.5e-3, unit='m', lower=1e-5, upper=1.0, description='Between the flanks of the section; for finite_elements.'
    )
    section_hold: str = parameter(
        'bottom',
        unit='',
        choices=('bottom', 'bottom_and_flanks', 'sliding_bottom'),
        description='What the groove holds, for finite_elements. bottom: it sticks. bottom_and_flanks: the flanks do '
        'not move along the axis either. sliding_bottom: the bottom slides freely.',
    )
    mooney_c10: float = parameter(0.0, unit='Pa', lower=0.0, upper=1e9, description='C_10.')
    mooney_c01: float = parameter(1.785e6, unit='Pa', lower=0.0, upper=1e9, description='C_01.')
    solid_shear_stress: float = parameter(
        1.5e6, unit='Pa', lower=0.0, upper=1e9, description='tau_c on the real area of contact.'
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.body == 'finite_elements':
            self._check_section()
        if self.modulus <= 0.0:
            raise ValueError('SealBody.mooney_c10 and mooney_c01 are both 0 Pa: give the seal a stiffness')

    @property
    def modulus(self) -> float:
        """Plane-strain modulus at small strain E* = E / (1 - 1/4) with E = 6 (C_10 + C_01) [Pa]."""
        return 8.0 * (self.mooney_c10 + self.mooney_c01)

    def fall(self, place: FloatArray) -> FloatArray:
        """Depth of the profile below its crown [m] at a ``place`` from it [m]: a parabola on each side."""
        radius = np.where(place < 0.0, self.crown_radius_left, self.crown_radius_right)
        return np.asarray(place**2 / (2.0 * radius))

    def _check_section(self) -> None:
        if self.section_height >= 0.5 * self.sealing_diameter:
            raise ValueError(
                f'SealBody.section_height = {self.section_height} m reaches the axis: sealing_diameter = '
                f'{self.sealing_diameter} m'
            )
        lowest = self.section_height - float(self.fall(np.array([-0.5, 0.5]) * self.section_width).max())
        if lowest < 0.2 * self.section_height:
            raise ValueError(
                f'SealBody.section_width = {self.section_width} m leaves {lowest:.3g} m of section_height = '
                f'{self.section_height} m at the flanks: make it narrower, or the crown radii larger'
            )


@dataclass(frozen=True)
class LubricationNumerics(CheckedParameters):
    """Grid along the seal."""

    cells: int = parameter(226, unit='1', lower=32, upper=4000, description='Cells of the film (paper: 226 nodes).')
    film_width: float = parameter(0.6e-3, unit='m', lower=1e-5, upper=0.1, description='Length of the film region.')
    section_elements: int = parameter(
        48, unit='1', lower=8, upper=256, description='Finite elements along the film, if seal.body is finite_elements.'
    )
