"""The face of a loaded ring on the rod, condensed for the film: reciprocal, stable, and the known bodies as limits."""

import dataclasses
import math

import numpy as np
import pytest
import yaml
from paths import ROOT
from scipy.sparse import coo_array
from scipy.sparse.linalg import splu

from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.lubrication.elasticity import condensed_body, half_plane
from seal_friction_ros.core.oring_contact.compliance import SlidingFace, sliding_face
from seal_friction_ros.core.oring_contact.elements import deformation_gradient, element_forces, make_elements
from seal_friction_ros.core.oring_contact.loading import loaded_states, oring_model
from seal_friction_ros.core.oring_contact.material import Rubber
from seal_friction_ros.core.oring_contact.mesh import Mesh
from seal_friction_ros.core.oring_contact.oring_case import OringCase, OringNumerics
from seal_friction_ros.core.oring_contact.oring_case_file import parse_oring_case
from seal_friction_ros.core.oring_contact.results import OringResult, evaluate_contact
from seal_friction_ros.core.oring_contact.surroundings import GLAND, ROD
from seal_friction_studies.core.bonded_layer import bonded_layer

PRESSURES = (0.0, 3.4e6, 6.9e6)  # [Pa]
HEIGHT = 1e-3  # [m] of the block
RADIUS = 10.0  # [m] so large that the block is plane
MODULUS = 6e6  # [Pa] Young's


def ring(lines: int) -> OringCase:
    text = (ROOT / 'config' / 'oring' / 'ms28775_114_blind.yaml').read_text()
    return dataclasses.replace(parse_oring_case(yaml.safe_load(text)).case, numerics=OringNumerics(lines=lines))


@pytest.fixture(scope='module')
def faces() -> list[tuple[SlidingFace, OringResult]]:
    case = ring(17)
    model = oring_model(case)
    return [
        (sliding_face(model, state, ROD), evaluate_contact(model, state))
        for state in loaded_states(case, model, PRESSURES)
    ]


def test_a_face_without_fluid_is_reciprocal_and_gives_way_to_every_pressure(faces):
    """But for the contact stress on the gland, which follows the surface."""
    compliance = faces[0][0].compliance
    assert np.abs(compliance - compliance.T).max() < 1e-5 * np.abs(compliance).max()
    assert np.linalg.eigvalsh(compliance).min() > 0.0


@pytest.mark.parametrize('k', [1, 2])
def test_fluid_that_follows_the_surface_makes_the_face_hardly_unsymmetric(faces, k):
    compliance = faces[k][0].compliance
    assert np.abs(compliance - compliance.T).max() < 0.02 * np.abs(compliance).max()
    assert np.linalg.eigvalsh(0.5 * (compliance + compliance.T)).min() > 0.0


def test_the_pressure_of_the_face_is_the_force_on_the_rod(faces):
    for face, result in faces:
        inside = (face.place >= result.rod.edges[0]) & (face.place <= result.rod.edges[1])
        assert face.pressure[inside].max() == pytest.approx(result.rod.peak_stress, rel=0.02)
        assert np.abs(face.gap[inside]).max() < 5e-6  # [m] the penetration that the penalty allows


def test_the_wall_of_the_groove_does_not_push_on_the_face(faces):
    """At 6.9 MPa the last node lies on that wall, which has a pressure there; the film has none."""
    face, result = faces[-1]
    assert face.gap[-1] > 50e-6
    assert result.wall.peak_stress > 6.9e6
    assert face.pressure[-1] < 1.0


def test_a_ring_held_by_its_wall_is_stiffer_along_the_rod_than_one_that_rolls(faces):
    rolling, held, harder = (face.axial_stiffness for face, _ in faces)
    assert 0.0 < 5.0 * rolling < min(held, harder)


def test_the_face_on_the_bore_is_like_that_on_the_rod_of_a_ring_of_large_radius():
    """Turned inside out: with its axis far away a ring has two equal faces."""
    case = ring(13)
    far = 1.0  # [m]
    g = case.geometry
    geometry = dataclasses.replace(
        g,
        ring_inner_diameter=far,
        rod_diameter=far + (g.rod_diameter - g.ring_inner_diameter),
        gland_diameter=far + (g.gland_diameter - g.ring_inner_diameter),
    )
    case = dataclasses.replace(case, geometry=geometry)
    model = oring_model(case)
    state = next(loaded_states(case, model, (0.0,)))
    rod, bore = (sliding_face(model, state, wall) for wall in (ROD, GLAND))
    assert bore.compliance == pytest.approx(rod.compliance, rel=0.02, abs=0.01 * rod.compliance.max())
    assert bore.pressure.max() == pytest.approx(rod.pressure.max(), rel=0.02)


def block(height: float, length: float, sides: int) -> tuple[FloatArray, FloatArray]:
    """Places of the nodes on the free face of a block bonded to its base, and their compliance [m/N] all round."""
    across = np.linspace(0.0, 1.0, sides // 2 + 1) ** 1.5 * height  # finer at the face
    along = np.linspace(-0.5 * length, 0.5 * length, sides * 4 + 1)
    r, z = np.meshgrid(RADIUS + across, along, indexing='ij')
    nodes = np.stack((r.ravel(), z.ravel()), axis=1)
    index = np.arange(r.size).reshape(r.shape)
    corners = (index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:])
    mesh = Mesh(nodes, np.stack([corner.ravel() for corner in corners], axis=1), index[0])
    elements = make_elements(mesh)
    still = np.zeros(nodes.size)
    rubber = Rubber(elastic_modulus=MODULUS, mooney_ratio=0.0, bulk_modulus=3e3 * MODULUS)
    stiffness = element_forces(elements, rubber, deformation_gradient(elements, still)).stiffness
    rows, columns = np.repeat(elements.freedoms, 8, axis=1).ravel(), np.tile(elements.freedoms, (1, 8)).ravel()
    matrix = coo_array((stiffness.ravel(), (rows, columns)), shape=(nodes.size,) * 2).tocsc()
    base = np.concatenate((2 * index[-1], 2 * index[-1] + 1))
    free = np.setdiff1d(np.arange(nodes.size), base)
    loads = np.zeros((nodes.size, len(along)))
    loads[2 * index[0], np.arange(len(along))] = 1.0
    moved = np.zeros_like(loads)
    moved[free] = splu(matrix[free][:, free]).solve(loads[free])
    return along, moved[2 * index[0]]


def bump(x: FloatArray, width: float) -> FloatArray:
    return np.sqrt(np.maximum(1.0 - (x / width) ** 2, 0.0)) * 1e6


def test_a_block_of_finite_elements_is_the_bonded_layer():
    """Pressure over a third of the height: largest deflection 2 % from the closed kernel, profile 3 %."""
    nodes, compliance = block(HEIGHT, 8.0 * HEIGHT, 48)
    assert np.abs(compliance - compliance.T).max() < 1e-10 * np.abs(compliance).max()
    cells, width = 128, 0.9 * HEIGHT / 128
    places = (np.arange(cells) - 0.5 * (cells - 1)) * width
    plane_strain = 4.0 / 3.0 * MODULUS
    body = condensed_body(places, nodes, compliance, plane_strain, 2.0 * math.pi * RADIUS)
    layer = bonded_layer(cells, width, plane_strain, HEIGHT)
    pressure = bump(places, 0.15 * HEIGHT)
    known = layer.deflection(pressure)
    assert np.abs(body.deflection(pressure) - known).max() < 0.03 * known.max()


@pytest.mark.parametrize('nodes', [9, 23, 60])
def test_the_half_plane_is_recovered_whatever_the_mesh(nodes):
    """Compliance of a half-plane of depth 5 mm between nodes: the condensed body is that half-plane within 1 %."""
    cells, width, depth = 128, 5e-6, 5e-3
    places = (np.arange(cells) - 0.5 * (cells - 1)) * width
    at = np.linspace(places[0], places[-1], nodes)
    hats = np.stack([np.interp(places, at, unit) for unit in np.eye(nodes)], axis=1)
    spread = np.linalg.pinv(hats)
    deep = half_plane(cells, width, MODULUS, depth)
    seen = spread @ deep.matrix @ spread.T / width  # what the nodes see of it, per unit force
    body = condensed_body(places, at, seen, MODULUS, 1.0)
    for pressure in (bump(places, 1e-4), bump(places - 1e-4, 3e-5), np.ones(cells)):
        known = deep.deflection(pressure)
        assert np.abs(body.deflection(pressure) - known).max() < 0.01 * known.max()


def test_a_condensed_body_is_symmetric_and_positive(faces):
    for face, result in faces:
        places = np.linspace(result.rod.edges[0], result.rod.edges[1], 100)
        body = condensed_body(places, face.place, face.compliance, 7e6, 0.05)
        assert np.abs(body.matrix - body.matrix.T).max() <= 1e-10 * body.matrix.max()
        assert np.linalg.eigvalsh(body.matrix).min() > 0.0
