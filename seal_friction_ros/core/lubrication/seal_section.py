r"""The body under the film: half-plane, or the section of the seal by finite elements.

The section of the paper is confidential, so this profile is ours: a crown of two radii, flanks square to the axis and a
flat bottom in the groove of the spool, about which it is a body of revolution. The elements are those of the O-ring
(`oring_contact`). Displacements are small, about the unloaded section (our choice; docs/ehl.md has the contact force
beside that of finite strain): the seal leaves its seat at a control edge, so no loaded state is nearer to all others.
"""

import math
from typing import NamedTuple

import numpy as np

from seal_friction_ros.core.foundation.arrays import FloatArray, IntArray
from seal_friction_ros.core.lubrication.elasticity import ElasticBody, condensed_body, half_plane
from seal_friction_ros.core.lubrication.seal_profile import LubricationNumerics, SealBody
from seal_friction_ros.core.oring_contact.compliance import small_displacements
from seal_friction_ros.core.oring_contact.equilibrium import OringModel, make_model, unstressed_state
from seal_friction_ros.core.oring_contact.material import Rubber
from seal_friction_ros.core.oring_contact.mesh import Mesh, outline_of, quadrilaterals_of
from seal_friction_ros.core.oring_contact.surroundings import Surroundings

_GROWTH = 8.0  # elements away from the film grow by this over their number under it, each over the last (our choice)
_STEEPEST_MOONEY_RATIO = 10.0  # of `Rubber`; small displacements do not depend on it


class SealSection(NamedTuple):
    """Meshed section with its nodes by place; r points from the spool to the wall, z along the wall."""

    model: OringModel
    face: IntArray  # nodes under the film, in order of z, shape (m,)
    place: FloatArray  # z of them from the crown [m], shape (m,)
    held: tuple[int, ...]  # displacements that the groove holds (2 node for r, 2 node + 1 for z)


class FaceCompliance(NamedTuple):
    """How the face of the section gives way to small loads."""

    off_wall: FloatArray  # displacement off the wall by a force off it on a node, all round [m/N], shape (m, m)
    axial_stiffness: float  # axial force spread over the middle half of the face, over its mean displacement [N/m]


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


def face_compliance(section: SealSection) -> FaceCompliance:
    """Compliance of the face of the unloaded section, held at its groove.

    NotConvergedError: the stiffness is singular.
    """
    model, face = section.model, section.face
    middle = np.abs(section.place) <= 0.25 * np.ptp(section.place)
    loads = np.zeros((model.mesh.nodes.size, len(face) + 1))
    loads[2 * face, np.arange(len(face))] = 1.0
    loads[2 * face + 1, -1] = middle / middle.sum()
    moved = small_displacements(model, nothing_around(model), unstressed_state(model), loads, held=section.held)
    return FaceCompliance(moved[2 * face, :-1], 1.0 / float(loads[2 * face + 1, -1] @ moved[2 * face + 1, -1]))


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
    return condensed_body(places, section.place, face_compliance(section).off_wall, seal.modulus, circumference)


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
