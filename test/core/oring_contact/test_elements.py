"""Mesh, elements and surroundings of the finite-element O-ring: patch test, derivatives, work, balance."""

import numpy as np
import pytest
from scipy.sparse import csc_array

from seal_friction_ros.core.oring_contact.elements import (
    deformation_gradient,
    element_forces,
    is_inside_out,
    make_elements,
    volume_ratios,
)
from seal_friction_ros.core.oring_contact.equilibrium import (
    OringState,
    force_balance,
    make_assembly,
    make_model,
    stiffness_matrix,
    unstressed_state,
)
from seal_friction_ros.core.oring_contact.loading import LoadedRing, _stretched_with_walls, wetted_nodes
from seal_friction_ros.core.oring_contact.material import Rubber, shear_response
from seal_friction_ros.core.oring_contact.mesh import Mesh, o_grid
from seal_friction_ros.core.oring_contact.results import _axial_force, _upstream
from seal_friction_ros.core.oring_contact.surroundings import (
    SurfacePressure,
    Surroundings,
    node_areas,
    outline_freedoms,
    surface_forces,
    surface_pressure,
    wall_stresses,
)

SECTION, RADIUS = 2.6e-3, 9e-3  # [m]
RUBBER = Rubber(elastic_modulus=5.5e6)
MESH = o_grid(SECTION, RADIUS, 9)
ELEMENTS = make_elements(MESH)
OUTLINE = MESH.nodes[MESH.surface]


def strain_energy(gradient: np.ndarray) -> float:
    """Energy of the whole ring [J]."""
    shear = (ELEMENTS.weights * shear_response(RUBBER, gradient).energy).sum()
    volumes = ELEMENTS.weights.sum(axis=1)
    return float(shear + 0.5 * RUBBER.bulk_modulus * (volume_ratios(ELEMENTS, gradient) - 1.0) ** 2 @ volumes)


def shaken(scale: float = 1e-5) -> np.ndarray:
    """Displacements without any order in them [m], the same every time."""
    return scale * np.random.default_rng(7).normal(size=MESH.nodes.size)


def around(**changes) -> Surroundings:
    """Walls that press on parts of the section, fluid on its upstream half."""
    values = {
        'rod_radius': RADIUS - 0.48 * SECTION,
        'gland_radius': RADIUS + 0.47 * SECTION,
        'wall_position': 0.48 * SECTION,
        'pressure': 2e6,
        'wetted': OUTLINE[:, 1] < 0.0,
        'penalty': 1e11,
        'transition': 1e5,
    }
    return Surroundings(**(values | changes))


def assembled(elements_force: np.ndarray) -> np.ndarray:
    return np.bincount(ELEMENTS.freedoms.ravel(), elements_force.ravel(), MESH.nodes.size)


# -- mesh


@pytest.mark.parametrize('lines', [5, 8, 17, 33])
def test_the_mesh_fills_the_section_and_no_element_is_folded(lines: int):
    mesh = o_grid(SECTION, RADIUS, lines)
    weights = make_elements(mesh).weights
    assert weights.min() > 0.0
    corners = len(mesh.surface)  # a circle of so many chords, the longest of them twice the even one at most
    exact = 2.0 * np.pi * RADIUS * np.pi / 4.0 * SECTION**2
    assert weights.sum() == pytest.approx(exact, rel=2.0 / 3.0 * (2.0 * np.pi / corners) ** 2)
    assert weights.sum() < exact


@pytest.mark.parametrize('lines', [8, 17])
def test_the_outline_runs_counterclockwise_on_the_circle_from_the_rod(lines: int):
    mesh = o_grid(SECTION, RADIUS, lines)
    outline = mesh.nodes[mesh.surface]
    assert np.linalg.norm(outline - [RADIUS, 0.0], axis=1) == pytest.approx(SECTION / 2.0)
    assert outline[0, 0] == outline[:, 0].min()
    angle = np.unwrap(np.arctan2(outline[:, 1], outline[:, 0] - RADIUS))
    assert (np.diff(angle) > 0.0).all()


def test_too_few_lines_are_refused():
    with pytest.raises(ValueError, match='lines = 4 is below 5'):
        o_grid(SECTION, RADIUS, 4)


@pytest.mark.parametrize(('lines', 'wall', 'layers'), [(5, 2, 2), (9, 5, 4), (33, 19, 16)])
def test_as_many_lines_end_on_rod_and_gland_and_fewer_on_the_wall(lines: int, wall: int, layers: int):
    """The wall has 0.6 of the edges of the rod, the layers around the core are half as many."""
    mesh = o_grid(SECTION, RADIUS, lines)
    edges = lines - 1
    assert len(mesh.surface) == 2 * (edges + wall)
    assert len(mesh.elements) == edges * wall + layers * len(mesh.surface)
    assert len(mesh.nodes) == (edges + 1) * (wall + 1) + layers * len(mesh.surface)
    angle = np.arctan2(*(mesh.nodes[mesh.surface] - [RADIUS, 0.0]).T[::-1])
    assert (np.abs(angle) < 0.25 * np.pi - 1e-9).sum() == edges - 1  # between the corners on the gland
    assert (np.abs(angle - 0.5 * np.pi) < 0.25 * np.pi - 1e-9).sum() == wall - 1


def test_the_mesh_is_even_about_both_middles_of_the_section():
    places = {tuple(np.round(place / 1e-9).astype(int)) for place in MESH.nodes - [RADIUS, 0.0]}
    assert {(-r, z) for r, z in places} == {(r, -z) for r, z in places} == places


def test_layers_are_thinner_outside_and_edges_shorter_in_the_middle_of_the_rod():
    """On the line through the middle: outermost layer half the innermost; edges there 0.6 of even ones."""
    mesh = o_grid(SECTION, 0.0, 33)
    inward = np.sort(-mesh.nodes[np.abs(mesh.nodes[:, 1]) < 1e-9, 0])
    layers = np.diff(inward)[-16:]
    assert layers[-1] / layers[0] == pytest.approx(0.5, rel=1e-6)
    assert layers[1:] / layers[:-1] == pytest.approx(0.5 ** (1.0 / 15.0), rel=1e-6)
    turns = np.diff(np.unwrap(np.arctan2(*mesh.nodes[mesh.surface].T[::-1])))
    assert turns[0] == pytest.approx(0.6 * 0.5 * np.pi / 32.0, rel=5e-3)


# -- elements


def test_patch_an_even_strain_is_reproduced_on_any_mesh_with_no_force_inside():
    inside = np.setdiff1d(np.arange(len(MESH.nodes)), MESH.surface)
    moved = MESH.nodes.copy()
    moved[inside] += 2e-5 * np.random.default_rng(3).normal(size=(len(inside), 2))  # elements of every shape
    elements = make_elements(Mesh(moved, MESH.elements, MESH.surface))
    stretched = moved * [1.07, 0.91]
    gradient = deformation_gradient(elements, (stretched - moved).ravel())
    assert gradient == pytest.approx(np.broadcast_to([1.07, 0.0, 0.0, 0.91, 1.07], gradient.shape), abs=1e-12)
    assert volume_ratios(elements, gradient) == pytest.approx(1.07**2 * 0.91, rel=1e-12)
    force = np.bincount(elements.freedoms.ravel(), element_forces(elements, RUBBER, gradient).force.ravel())
    forces = force.reshape(-1, 2)
    assert np.abs(forces[inside]).max() < 1e-12 * np.abs(forces[MESH.surface]).max()


def test_moving_along_the_axis_costs_nothing_but_widening_the_ring_does():
    along = np.tile([0.0, 1e-3], len(MESH.nodes))
    outward = np.tile([1e-4, 0.0], len(MESH.nodes))
    forces = [element_forces(ELEMENTS, RUBBER, deformation_gradient(ELEMENTS, u)).force for u in (along, outward)]
    assert np.abs(assembled(forces[0])).max() < 1e-9 * np.abs(assembled(forces[1])).max()


def test_forces_are_the_derivative_of_the_energy():
    displacement, step = shaken(), 1e-9
    force = assembled(element_forces(ELEMENTS, RUBBER, deformation_gradient(ELEMENTS, displacement)).force)
    for direction in np.eye(MESH.nodes.size)[[0, 33, 140]]:
        energies = [
            strain_energy(deformation_gradient(ELEMENTS, displacement + side * step * direction))
            for side in (-1.0, 1.0)
        ]
        assert (energies[1] - energies[0]) / (2.0 * step) == pytest.approx(force @ direction, rel=1e-5)


def test_an_element_is_inside_out_where_any_point_of_it_is():
    whole = np.tile([1.0, 0.2, -0.2, 1.0, 1.0], (2, 4, 1))
    assert not is_inside_out(whole)
    for change in ([-1.0, 0.0, 0.0, 1.0, 1.0], [1.0, 1.0, 1.0, 1.0, 1.0], [1.0, 0.0, 0.0, 1.0, 0.0]):
        bad = whole.copy()
        bad[1, 2] = change
        assert is_inside_out(bad)


# -- surroundings


def test_the_pressure_is_never_below_the_largest_and_the_shares_add_up_to_one():
    surroundings = around()
    total, shares, contact = surface_pressure(surroundings, OUTLINE)
    fluid = np.where(surroundings.wetted, surroundings.pressure, 0.0)
    largest = np.maximum(wall_stresses(surroundings, OUTLINE).max(axis=1), fluid)
    assert (total >= largest).all()
    assert (total <= largest + surroundings.transition * np.log(4.0)).all()
    assert shares.sum(axis=1) == pytest.approx(1.0)
    assert contact == pytest.approx(total - shares[:, 0] * fluid)


def test_far_from_every_wall_there_is_the_fluid_alone_on_its_side_and_nothing_on_the_other():
    free = around(rod_radius=1e-3, gland_radius=1.0, wall_position=np.inf)
    total, shares, contact = surface_pressure(free, OUTLINE)
    assert total == pytest.approx(np.where(free.wetted, 2e6, 0.0), abs=1e-6)
    assert contact == pytest.approx(0.0, abs=1e-6)
    assert shares[free.wetted, 0] == pytest.approx(1.0)


def test_fluid_all_around_pushes_neither_up_nor_down():
    drowned = around(rod_radius=1e-3, gland_radius=1.0, wall_position=np.inf, wetted=np.ones(len(OUTLINE), dtype=bool))
    axial = surface_forces(drowned, OUTLINE).force[:, 1]
    assert axial.sum() == pytest.approx(0.0, abs=1e-12 * np.abs(axial).sum())


def test_fluid_on_one_side_pushes_with_pressure_times_area():
    half = around(rod_radius=1e-3, gland_radius=1.0, wall_position=np.inf)
    axial = -(surface_forces(half, OUTLINE).force[:, 1]).sum()
    ends = np.flatnonzero(np.diff(half.wetted.astype(int), append=half.wetted[0]))
    radii = [np.sqrt(OUTLINE[i, 0] * OUTLINE[(i + 1) % len(OUTLINE), 0]) for i in ends]
    assert axial == pytest.approx(2e6 * np.pi * abs(radii[0] ** 2 - radii[1] ** 2), rel=1e-12)


def test_surface_areas_close():
    areas = node_areas(OUTLINE)
    assert areas[:, 1].sum() == pytest.approx(0.0, abs=1e-12 * np.abs(areas).sum())
    assert np.linalg.norm(areas, axis=1).sum() == pytest.approx(2 * np.pi * RADIUS * np.pi * SECTION, rel=0.02)


def test_smooth_maximum_of_two_equal_stresses_is_ln_2_transitions_above_them_and_each_has_half():
    at_rod = np.array([[RADIUS - 0.5e-3, 0.0]])
    pressed = around(rod_radius=RADIUS - 0.48e-3, gland_radius=1.0, wall_position=np.inf, wetted=np.array([True]))
    total, shares, contact = surface_pressure(pressed, at_rod)
    assert total == pytest.approx(2e6 + 1e5 * np.log(2.0), rel=1e-9)
    assert shares[0] == pytest.approx([0.5, 0.5, 0.0, 0.0], abs=1e-9)
    assert contact == pytest.approx(1e6 + 1e5 * np.log(2.0), rel=1e-9)


def test_fluid_wets_the_outline_from_the_rod_round_the_upstream_side_to_the_gland():
    """Of a ring that touches rod and gland in its middle: every node with z <= 0, in the order of the outline."""
    wetted = wetted_nodes(around(), OUTLINE)
    assert wetted.tolist() == (OUTLINE[:, 1] < 1e-12).tolist()


def test_walls_that_close_take_the_ring_with_them_at_constant_volume():
    """From a gap of 2.6 to 2.4 mm about 9 mm: nearest to the rod stays at the rod, farthest at the gland."""
    model = make_model(MESH, RUBBER, SECTION, 0.05)
    before = around(rod_radius=RADIUS - 1.3e-3, gland_radius=RADIUS + 1.3e-3)
    after = around(rod_radius=RADIUS - 1.0e-3, gland_radius=RADIUS + 1.4e-3)
    moved = _stretched_with_walls(model, unstressed_state(model), before, after).displacement.reshape(-1, 2)
    place = MESH.nodes + moved
    assert (place[:, 0].min(), place[:, 0].max()) == pytest.approx((RADIUS - 1.0e-3, RADIUS + 1.4e-3))
    weights = make_elements(Mesh(place, MESH.elements, MESH.surface)).weights
    assert weights.sum() == pytest.approx(ELEMENTS.weights.sum(), rel=2e-4)


# -- results


@pytest.mark.parametrize(('pressure', 'upstream'), [(0.0, [True, False, False]), (1.0, [True, True, False])])
def test_the_upstream_side_is_that_of_the_fluid_and_half_of_the_ring_without(pressure: float, upstream: list[bool]):
    wet = around(wetted=np.array([True, True, False]))
    position = np.array([[1.0, -1e-3], [1.0, 0.0], [1.0, 0.5]])
    assert _upstream(LoadedRing(pressure, wet, None, 0), position).tolist() == upstream


def test_axial_force_is_that_on_the_downstream_side_and_on_tilted_facets_of_rod_and_gland():
    shares = np.array([[1.0, 0.0, 0.0, 0.0], [0.5, 0.2, 0.0, 0.3], [0.0, 0.0, 0.4, 0.6], [0.0, 0.3, 0.3, 0.4]])
    pressure = SurfacePressure(np.array([1.0, 2.0, 3.0, 4.0]), shares, np.zeros(4))
    areas, upstream = np.array([-5.0, 1.0, -1.0, 2.0]), np.array([True, True, True, False])
    assert _axial_force(pressure, areas, upstream) == pytest.approx(8.0 + 0.2 * 2.0 - 0.4 * 3.0)


# -- both together


def test_the_guide_is_a_couple_on_the_nodes_halfway_to_rod_and_gland():
    """Of 0.05 times 2 pi R E; forces are small below 2 pi R E d."""
    model = make_model(MESH, RUBBER, SECTION, 0.05)
    inner, outer = MESH.nodes[list(model.guide)]
    assert inner == pytest.approx([RADIUS - 0.25 * SECTION, 0.0], abs=0.1 * SECTION)
    assert outer == pytest.approx([RADIUS + 0.25 * SECTION, 0.0], abs=0.1 * SECTION)
    assert model.guide_stiffness == pytest.approx(0.05 * 2.0 * np.pi * RADIUS * 5.5e6, rel=1e-6)
    assert model.force_scale == pytest.approx(2.0 * np.pi * RADIUS * 5.5e6 * SECTION, rel=1e-6)
    free, state = around(rod_radius=1e-3, gland_radius=1.0, wall_position=np.inf, pressure=0.0), shaken()
    residuals = [
        force_balance(make_model(MESH, RUBBER, SECTION, guide), free, OringState(state, None)).residual
        for guide in (0.05, 0.0)
    ]
    couple = residuals[0] - residuals[1]
    low, high = (2 * node + 1 for node in model.guide)
    pull = model.guide_stiffness * (state[high] - state[low])
    assert couple[[low, high]] == pytest.approx([-pull, pull], rel=1e-6)
    assert np.delete(couple, [low, high]) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize('faces_walls', [False, True])
@pytest.mark.parametrize('friction', [0.0, 0.1])
def test_the_stiffness_is_the_derivative_of_the_forces_to_1e_8(friction: float, faces_walls: bool):
    model = make_model(MESH, RUBBER, SECTION, 0.05)
    assembly = make_assembly(model)
    surroundings = around(friction=friction, faces_walls=faces_walls)
    state, step = OringState(shaken(), None), 1e-9
    at = force_balance(model, surroundings, state)
    matrix = stiffness_matrix(assembly, at.entries).toarray()
    numeric = np.empty_like(matrix)
    for i in range(len(state.displacement)):
        sides = []
        for side in (-1.0, 1.0):
            moved = state.displacement.copy()
            moved[i] += side * step
            sides.append(force_balance(model, surroundings, OringState(moved, None)).residual)
        numeric[:, i] = (sides[1] - sides[0]) / (2.0 * step)
    assert np.abs(numeric - matrix).max() < 1e-8 * np.abs(matrix).max()


def test_held_displacements_are_left_out_of_the_stiffness_and_nothing_else():
    model = make_model(MESH, RUBBER, SECTION, 0.05)
    at = force_balance(model, around(), unstressed_state(model)._replace(displacement=shaken()))
    whole = stiffness_matrix(make_assembly(model), at.entries).toarray()
    held = (3, 40)
    part = stiffness_matrix(make_assembly(model, held), at.entries)
    assert isinstance(part, csc_array)
    kept = np.setdiff1d(np.arange(len(whole)), held)
    assert part.toarray() == pytest.approx(whole[np.ix_(kept, kept)], rel=1e-12)


def test_folded_elements_have_no_balance():
    model = make_model(MESH, RUBBER, SECTION, 0.05)
    assert force_balance(model, around(), unstressed_state(model)._replace(displacement=shaken(1e-3))) is None


def test_each_node_of_the_outline_feels_itself_and_its_two_neighbours():
    freedoms = outline_freedoms(MESH.surface)
    assert freedoms.shape == (len(MESH.surface), 6)
    assert (freedoms[:, 2] == 2 * MESH.surface).all()
    assert (freedoms[1:, 0] == 2 * MESH.surface[:-1]).all()
