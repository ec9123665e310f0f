"""The section of the seal by finite elements: rigid motion, patch, reciprocity, and the known bodies as limits."""

import dataclasses

import numpy as np
import pytest
from harness.section_stiffness import axial_stiffness
from scipy.sparse import coo_array
from seal_bodies import contact_forces

from seal_friction_ros.core.lubrication.elasticity import half_plane
from seal_friction_ros.core.lubrication.lubrication_case import parse_lubrication_case
from seal_friction_ros.core.lubrication.seal_section import (
    LubricationNumerics,
    SealBody,
    SealSection,
    face_compliance,
    seal_body,
    seal_section,
    section_rubber,
)
from seal_friction_ros.core.oring_contact.elements import deformation_gradient, element_forces
from seal_friction_studies.core.bonded_layer import bonded_layer
from seal_friction_studies.core.study_case import StudyCase, StudyNumerics, StudySeal

SEAL = SealBody(body='finite_elements')
FILM = 0.6e-3  # [m]
FAR = SealBody(body='finite_elements', sealing_diameter=10.0, mooney_c01=1785.0)
"""so far from its axis that it is plane; so soft that its bulk modulus makes it incompressible"""


def stiffness(section: SealSection) -> np.ndarray:
    """Dense stiffness of the unloaded section, nothing held [N/m]."""
    elements, size = section.model.elements, section.model.mesh.nodes.size
    still = deformation_gradient(elements, np.zeros(size))
    blocks = element_forces(elements, section.model.rubber, still).stiffness
    rows, columns = np.repeat(elements.freedoms, 8, axis=1).ravel(), np.tile(elements.freedoms, (1, 8)).ravel()
    return coo_array((blocks.ravel(), (rows, columns)), shape=(size, size)).toarray()


def test_the_mesh_is_the_section_and_its_face_lies_under_the_film():
    section = seal_section(SEAL, FILM, 24)
    mesh = section.model.mesh
    assert section.model.elements.weights.min() > 0.0
    assert mesh.nodes[section.face, 1] == pytest.approx(section.place)
    assert mesh.nodes[section.face, 0] == pytest.approx(3e-3 - section.place**2 / 2e-3)
    assert (np.ptp(mesh.nodes[:, 1]), mesh.nodes[:, 0].min()) == pytest.approx((1.5e-3, 2e-3))
    r, z = mesh.nodes[mesh.surface].T  # counterclockwise: the area is positive
    assert 0.5 * (r * np.roll(z, -1) - z * np.roll(r, -1)).sum() == pytest.approx(1.5e-6 - 1.5e-3**3 / 24e-3, rel=1e-3)


def test_elements_grow_evenly_away_from_the_film_and_begin_at_its_width():
    """Of 25 um under a film of 24 elements, each a third larger than the last."""
    nodes = seal_section(SEAL, FILM, 24).model.mesh.nodes
    along = np.unique(np.round(nodes[:, 1], 9))
    beside = np.diff(along[along > 0.5 * FILM - 1e-9])
    down = np.diff(np.sort(3e-3 - nodes[np.abs(nodes[:, 1]) < 1e-9, 0]))
    for steps in (beside, down):
        assert steps[1:] / steps[:-1] == pytest.approx(4.0 / 3.0, rel=1e-3)
        assert 25e-6 / 1.2 < steps[0] < 25e-6 * 1.2


def test_rigid_motion_costs_nothing():
    """Along the axis on any radius; off it and about a corner where the section is plane."""
    for seal, moves in ((SEAL, ('along',)), (FAR, ('along', 'off', 'turn'))):
        section = seal_section(seal, FILM, 8)
        matrix, (r, z) = stiffness(section), section.model.mesh.nodes.T
        none, even = np.zeros_like(r), np.ones_like(r)
        motion = {'along': (none, even), 'off': (even, none), 'turn': (-z / z.max(), (r - r.min()) / z.max())}
        for name in moves:
            force = matrix @ np.stack(motion[name], axis=1).ravel()
            assert np.abs(force).max() < (1e-13 if seal is SEAL else 2e-5) * np.abs(matrix).max(), name


def test_patch_an_even_strain_leaves_no_force_inside():
    section = seal_section(dataclasses.replace(SEAL, crown_radius_right=2e-3), FILM, 8)
    model = section.model
    moved = (model.mesh.nodes * [0.03, -0.05]).ravel()
    forces = element_forces(model.elements, model.rubber, deformation_gradient(model.elements, moved)).force
    whole = np.bincount(model.elements.freedoms.ravel(), forces.ravel()).reshape(-1, 2)
    inside = np.setdiff1d(np.arange(len(model.mesh.nodes)), model.mesh.surface)
    assert np.abs(whole[inside]).max() < 1e-12 * np.abs(whole[model.mesh.surface]).max()


@pytest.mark.parametrize('hold', ['bottom', 'bottom_and_flanks', 'sliding_bottom'])
def test_the_face_is_reciprocal_and_gives_way_to_every_pressure(hold):
    compliance = face_compliance(seal_section(dataclasses.replace(SEAL, section_hold=hold), FILM, 24))
    assert np.abs(compliance - compliance.T).max() < 1e-10 * np.abs(compliance).max()
    assert np.linalg.eigvalsh(0.5 * (compliance + compliance.T)).min() > 0.0


def test_the_more_the_groove_holds_the_stiffer_is_the_section():
    sections = [
        seal_section(dataclasses.replace(SEAL, section_hold=hold), FILM, 16)
        for hold in ('sliding_bottom', 'bottom', 'bottom_and_flanks')
    ]
    assert (np.diff([face_compliance(section).sum() for section in sections]) < 0.0).all()
    assert (np.diff([axial_stiffness(section) for section in sections]) > 0.0).all()


@pytest.mark.parametrize(('c10', 'c01', 'ratio'), [(1e6, 0.5e6, 0.5), (0.1e6, 0.9e6, 9.0), (0.0, 2e6, 10.0)])
def test_rubber_of_the_section_is_as_stiff_in_shear_as_that_of_the_seal(c10, c01, ratio):
    """G = 2 (C_10 + C_01) = E / 3; beyond a ratio of 10, which small displacements do not feel, it stays at 10."""
    rubber = section_rubber(SealBody(mooney_c10=c10, mooney_c01=c01))
    assert rubber.elastic_modulus == pytest.approx(6.0 * (c10 + c01))
    assert rubber.mooney_ratio == pytest.approx(ratio)


@pytest.mark.parametrize(('body', 'kind'), [('half_plane', half_plane), ('bonded_layer', bonded_layer)])
def test_body_of_a_seal_that_has_no_elements_is_the_known_one_of_its_height(body, kind):
    numerics = StudyNumerics(cells=40, film_width=0.4e-3)
    found = StudyCase(name='x', seal=StudySeal(body=body, section_height=2e-3), numerics=numerics).elastic_body()
    assert found.matrix == pytest.approx(kind(40, 1e-5, 8.0 * 1.785e6, 2e-3).matrix)


@pytest.mark.parametrize('hold', ['bottom', 'bottom_and_flanks', 'sliding_bottom'])
def test_groove_holds_the_bottom_off_the_wall_and_along_it_what_it_says(hold):
    """Off the wall it holds the bottom alone; a sliding bottom is held along the wall at its middle, or it would go."""
    section = seal_section(dataclasses.replace(SEAL, section_hold=hold), FILM, 8)
    nodes, held = section.model.mesh.nodes, np.array(section.held)
    bottom = np.isclose(nodes[:, 0], nodes[:, 0].min())
    flanks = np.isclose(np.abs(nodes[:, 1]), nodes[:, 1].max())
    along = {'bottom': bottom, 'bottom_and_flanks': bottom | flanks, 'sliding_bottom': bottom & (nodes[:, 1] == 0.0)}
    assert (held[held % 2 == 0] // 2).tolist() == np.flatnonzero(bottom).tolist()
    assert (held[held % 2 == 1] // 2).tolist() == np.flatnonzero(along[hold]).tolist()
    assert len(held) > bottom.sum()


def test_section_hardly_wider_than_its_film_has_one_element_beside_it():
    section = seal_section(dataclasses.replace(SEAL, section_width=0.6002e-3), FILM, 8)
    assert len(np.unique(section.model.mesh.nodes[:, 1])) == 9 + 2
    assert mesh_width(section) == pytest.approx(0.6002e-3)


def mesh_width(section: SealSection) -> float:
    """Width of the mesh along the wall [m]."""
    return float(np.ptp(section.model.mesh.nodes[:, 1]))


def test_even_section_gives_way_alike_on_both_sides_of_its_crown():
    body = seal_body(SEAL, LubricationNumerics(cells=32, section_elements=8))
    matrix = body.matrix
    assert matrix[::-1, ::-1] == pytest.approx(matrix, rel=1e-9)


def test_wide_flat_section_is_sheared_along_the_axis_by_half_of_its_face():
    """It is G A / h under the pulled half of the film; the rubber beside it adds less than a fifth."""
    height = 1e-3
    seal = dataclasses.replace(
        FAR, section_height=height, section_width=24.0 * height, crown_radius_left=1.0, crown_radius_right=1.0
    )
    found = axial_stiffness(seal_section(seal, 20.0 * height, 64))
    even = seal.modulus / 4.0 * 10.0 * height * np.pi * seal.sealing_diameter / height
    assert even < found < 1.2 * even


def flat(height: float, width: float, film: float, elements: int, cells: int):
    """A wide flat section, plane, and its cells."""
    seal = dataclasses.replace(
        FAR, section_height=height, section_width=width, crown_radius_left=1.0, crown_radius_right=1.0
    )
    numerics = LubricationNumerics(cells=cells, film_width=film, section_elements=elements)
    return seal, seal_body(seal, numerics), film / cells


def hertz(places: np.ndarray, half_width: float) -> np.ndarray:
    return 1e6 * np.sqrt(np.maximum(1.0 - (places / half_width) ** 2, 0.0))


def test_under_a_narrow_film_a_deep_section_is_a_half_plane_within_1_percent():
    """Of 0.377 of its height, as a bonded layer is; 20 times as high as the film is wide."""
    height, film = 6e-3, 0.3e-3
    seal, body, width = flat(height, 8.0 * height, film, 48, 128)
    plane = half_plane(128, width, seal.modulus, 0.377 * height)
    places = (np.arange(128) - 63.5) * width
    for pressure in (hertz(places, 0.1e-3), hertz(places - 0.05e-3, 0.05e-3), np.full(128, 1e6)):
        known = plane.deflection(pressure)
        assert np.abs(body.deflection(pressure) - known).max() < 0.01 * known.max()


@pytest.mark.parametrize('share', [0.15, 0.3])
def test_a_wide_flat_section_is_a_bonded_layer_within_half_a_percent(share):
    height = 1e-3
    seal, body, width = flat(height, 12.0 * height, 0.9 * height, 64, 128)
    pressure = hertz((np.arange(128) - 63.5) * width, share * height)
    known = bonded_layer(128, width, seal.modulus, height).deflection(pressure)
    assert np.abs(body.deflection(pressure) - known).max() < 0.005 * known.max()


def test_contact_force_of_a_small_squeeze_is_that_of_finite_strain():
    """At 0.4 % of the height; at 3.6 %, the interference of the cases, finite strain adds 1.5 %."""
    small, finite = contact_forces(SEAL, 24, 4e-6)
    assert small == pytest.approx(finite, rel=0.005)
    small, finite = contact_forces(SEAL, 24, SEAL.interference)
    assert finite / small == pytest.approx(1.015, abs=0.003)


@pytest.mark.parametrize(
    ('seal', 'words'),
    [
        ({'body': 'foam'}, "body = 'foam' is none of half_plane, finite_elements"),
        ({'section_hold': 'glue'}, "section_hold = 'glue' is none of bottom, bottom_and_flanks, sliding_bottom"),
        ({'body': 'finite_elements', 'section_height': 3e-3}, 'section_height = 0.003 m reaches the axis'),
        ({'body': 'finite_elements', 'section_width': 2.6e-3}, 'section_width = 0.0026 m leaves 0.000155 m'),
        ({'body': 'finite_elements', 'section_width': 0.6e-3}, 'section_width = 0.0006 m is not above'),
    ],
)
def test_a_section_that_cannot_be_is_refused(seal, words):
    with pytest.raises(ValueError, match=words):
        parse_lubrication_case({'name': 'x', 'seal': seal})
