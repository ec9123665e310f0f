r"""A seal that is no O-ring: its profile, its grid, and its body, a half-plane or the section by finite elements.

The section of the paper is confidential, so this profile is ours: a crown of two radii, flanks square to the axis and a
flat bottom in the groove of the spool, about which it is a body of revolution. The elements are those of the O-ring
(`oring_contact`). Displacements are small, about the unloaded section (our choice; docs/ehl.md has the contact force
beside that of finite strain): the seal leaves its seat at a control edge, so no loaded state is nearer to all others.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from seal_friction_ros.core.foundation.arrays import FloatArray, IntArray
from seal_friction_ros.core.foundation.parameters import CheckedParameters, parameter
from seal_friction_ros.core.lubrication.elasticity import ElasticBody, condensed_body, half_plane
from seal_friction_ros.core.oring_contact.compliance import small_displacements
from seal_friction_ros.core.oring_contact.equilibrium import OringModel, make_model, unstressed_state
from seal_friction_ros.core.oring_contact.material import Rubber
from seal_friction_ros.core.oring_contact.mesh import Mesh, outline_of, quadrilaterals_of
from seal_friction_ros.core.oring_contact.surroundings import Surroundings

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


_GROWTH = 8.0  # elements away from the film grow by this over their number under it, each over the last (our choice)
_STEEPEST_MOONEY_RATIO = 10.0  # of `Rubber`; small displacements do not depend on it


class SealSection(NamedTuple):
    """Meshed section with its nodes by place; r points from the spool to the wall, z along the wall."""

    model: OringModel
    face: IntArray  # nodes under the film, in order of z, shape (m,)
    place: FloatArray  # z of them from the crown [m], shape (m,)
    held: tuple[int, ...]  # displacements that the groove holds (2 node for r, 2 node + 1 for z)


def seal_section(seal: SealBody, film_width: float, elements: int) -> SealSection:
    """Mesh of the section of a seal: ``elements`` of one width under the film, larger ones elsewhere."""
    first, growth = film_width / elements, 1.0 + _GROWTH / elements
    beside = _graded(0.5 * (seal.section_width - film_width), first, growth)
    under = np.linspace(-0.5 * film_width, 0.5 * film_width, elements + 1)
    along = np.concatenate((-0.5 * film_width - beside[:0:-1], under, 0.5 * film_width + beside[1:]))
    depth = _graded(seal.section_height, first, growth)[::-1]
    crown = 0.5 * seal.sealing_diameter - seal.fall(along)
    bottom = 0.5 * seal.sealing_diameter - seal.section_height
    r = bottom + (crown - bottom) * (1.0 - depth / seal.section_height)[:, None]
    nodes = np.stack((r, np.broadcast_to(along, r.shape)), axis=-1).reshape(-1, 2)
    index = np.arange(r.size).reshape(r.shape)
    mesh = Mesh(nodes, quadrilaterals_of(index), outline_of(index))
    model = make_model(mesh, section_rubber(seal), seal.section_height, 0.0)
    face = index[-1, len(beside) - 1 : len(beside) + elements]
    return SealSection(model, face, under, _held(seal.section_hold, index))


def section_rubber(seal: SealBody) -> Rubber:
    """Rubber with the shear modulus of the seal, 2 (C_10 + C_01), and the bulk modulus of `Rubber`."""
    ratio = seal.mooney_c01 / seal.mooney_c10 if seal.mooney_c10 > 0.0 else math.inf
    return Rubber(elastic_modulus=0.75 * seal.modulus, mooney_ratio=min(ratio, _STEEPEST_MOONEY_RATIO))


def face_compliance(section: SealSection) -> FloatArray:
    """Displacement of the face off the wall by a force off it on a node, all round [m/N], shape (m, m).

    The section is unloaded, held at its groove. NotConvergedError: the stiffness is singular.
    """
    model, face = section.model, section.face
    loads = np.zeros((model.mesh.nodes.size, len(face)))
    loads[2 * face, np.arange(len(face))] = 1.0
    moved = small_displacements(model, nothing_around(model), unstressed_state(model), loads, held=section.held)
    return moved[2 * face]


def nothing_around(model: OringModel) -> Surroundings:
    """No wall and no fluid."""
    dry = np.zeros(len(model.mesh.surface), dtype=bool)
    return Surroundings(-math.inf, math.inf, math.inf, 0.0, dry, penalty=1.0, transition=1.0)


def seal_body(seal: SealBody, numerics: LubricationNumerics) -> ElasticBody:
    """Body of a seal on the cells of its film.

    ValueError: the grid does not fit the body; NotConvergedError: the stiffness of the finite elements is singular.
    """
    cells, width = numerics.cells, numerics.film_width / numerics.cells
    if seal.body != 'finite_elements':
        return half_plane(cells, width, seal.modulus, seal.section_height)
    section = seal_section(seal, numerics.film_width, numerics.section_elements)
    places: FloatArray = np.asarray((np.arange(cells) + 0.5) * width - 0.5 * numerics.film_width)
    circumference = math.pi * seal.sealing_diameter
    return condensed_body(places, section.place, face_compliance(section), seal.modulus, circumference)


def _graded(length: float, first: float, growth: float) -> FloatArray:
    """Places from 0 to ``length`` [m], the first step about ``first`` [m] and each ``growth`` times the last."""
    steps = max(1, round(math.log1p(length / first * (growth - 1.0)) / math.log(growth)))
    places: FloatArray = np.concatenate((np.zeros(1), np.cumsum(growth ** np.arange(steps))))
    return np.asarray(places * (length / places[-1]))


def _held(hold: str, index: IntArray) -> tuple[int, ...]:
    """Displacements held by the groove, with the nodes at ``index``, from bottom to face and along the axis."""
    bottom, flanks = index[0], np.concatenate((index[:, 0], index[:, -1]))
    along = {
        'bottom': bottom,
        'bottom_and_flanks': np.concatenate((bottom, flanks)),
        'sliding_bottom': bottom[len(bottom) // 2 : len(bottom) // 2 + 1],
    }[hold]
    return tuple(np.unique(np.concatenate((2 * bottom, 2 * along + 1))).tolist())
