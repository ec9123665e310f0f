"""Sections of any shape: outlines, meshes, and the contact that they have."""

import dataclasses
import math

import numpy as np
import pytest

from seal_friction_ros.core.friction.geometry import SealGeometry, projected_area
from seal_friction_ros.core.oring_contact.elements import make_elements
from seal_friction_ros.core.oring_contact.loading import _check_unfolded, _holding, loaded_states, oring_model
from seal_friction_ros.core.oring_contact.material import Rubber
from seal_friction_ros.core.oring_contact.oring_case import Groove, OringCase, OringNumerics
from seal_friction_ros.core.oring_contact.results import OringResult, evaluate_contact, oring_results
from seal_friction_ros.core.oring_contact.sealing_film import edge_strengths, seal_film
from seal_friction_ros.core.oring_contact.section import (
    SHAPES,
    Section,
    checked_outline,
    first_crossing,
    mirrored,
    placed,
    rounded,
    section_of_shape,
    signed_area,
)
from seal_friction_ros.core.oring_contact.section_mesh import inside, section_mesh

RING = SealGeometry(
    section_diameter=3.53e-3,
    ring_inner_diameter=18.64e-3,
    rod_diameter=19.346e-3,
    gland_diameter=25.7e-3,
    sliding_wall='bore',
)
PTFE = Rubber(elastic_modulus=500e6, bulk_modulus=1e10)
SQUARE = np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)])


def seal(shape: str | None, lines: int = 17, transition: float = 0.01) -> OringCase:
    section = None if shape is None else SHAPES[shape]()
    if shape == 'capped_ring':
        section = mirrored(SHAPES[shape]())
    return OringCase(
        name='mine',
        geometry=RING,
        groove=Groove(width=7e-3),
        rubber=Rubber(elastic_modulus=5.5e6),
        numerics=OringNumerics(lines=lines, transition=transition),
        section=section,
        cap=PTFE if shape == 'capped_ring' else None,
    )


def at(case: OringCase, pressure: float) -> OringResult:
    (result,) = oring_results(case, (pressure,))
    return result


# -- outlines ---------------------------------------------------------------------------------------------------------


def test_an_outline_becomes_counterclockwise_and_loses_doubled_points():
    found = checked_outline(np.array([(0.0, 0.0), (0.0, 1.0), (1.0, 1.0), (1.0, 1.0), (1.0, 0.0), (0.0, 0.0)]), 'mine')
    assert len(found) == 4
    assert signed_area(found) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ('points', 'reason'),
    [
        ([(0, 0), (1, 1), (1, 0), (0, 1)], 'mine: the outline crosses or touches itself near r = 0.5, z = 0.5'),
        ([(0, 0), (2, 0), (2, 1), (1, 0), (0, 1)], 'crosses or touches itself near r = 1, z = 0'),
        ([(0, 0), (1, 0), (0, 0)], 'has 2 different corners, not three or more'),
        ([(0, 0, 0), (1, 0, 0)], 'not a list of finite pairs'),
        ([(0, 0), (1, 0), (float('nan'), 1)], 'not a list of finite pairs'),
    ],
)
def test_an_outline_that_is_no_section_is_refused(points: list[tuple[float, ...]], reason: str):
    with pytest.raises(ValueError, match=reason):
        checked_outline(np.array(points, dtype=float), 'mine')


def test_the_volume_is_that_of_the_solid_of_revolution():
    ring = placed(Section(SQUARE), inner_diameter=4.0, height=1.0)
    assert ring.volume == pytest.approx(np.pi * (3.0**2 - 2.0**2) * 1.0)


@pytest.mark.parametrize('shape', SHAPES)
def test_a_shape_has_height_one_and_a_simple_outline(shape: str):
    section = SHAPES[shape]()
    assert section.height == pytest.approx(1.0, abs=2e-3)
    assert signed_area(section.outline) > 0.0
    assert first_crossing(section.outline) is None


def test_an_unknown_shape_or_proportion_is_refused():
    with pytest.raises(ValueError, match="shape 'v_ring' is none of circle, x_ring"):
        section_of_shape('v_ring', {})
    with pytest.raises(ValueError, match='x_ring has no lip = 1; it has lobe_radius, groove_depth'):
        section_of_shape('x_ring', {'lip': 1})
    with pytest.raises(ValueError, match=r'no groove of depth 0\.12 touches lobes of radius 0\.35'):
        section_of_shape('x_ring', {'lobe_radius': 0.35})


def test_inside_follows_the_outline_of_a_hollow_shape():
    cup = SHAPES['u_cup']().outline
    assert inside(np.array([(0.0, 0.3), (0.0, -0.3), (0.45, -0.3)]), cup).tolist() == [True, False, True]


def test_corners_that_face_the_wall_become_arcs_and_no_others():
    inside_out = rounded(Section(SQUARE), 0.1, outside=False)
    assert signed_area(inside_out.outline) == pytest.approx(1.0 - 2.0 * (1.0 - np.pi / 4.0) * 0.1**2, rel=1e-4)
    assert (inside_out.outline[:, 0] == 1.0).sum() == 2
    outside = rounded(Section(SQUARE), 0.1, outside=True).outline
    assert (outside[:, 0] == 0.0).sum() == 2
    short = rounded(Section(SQUARE), 5.0, outside=False)  # no arc is larger than its edges
    assert first_crossing(short.outline) is None
    assert signed_area(short.outline) == pytest.approx(1.0 - 2.0 * (1.0 - np.pi / 4.0) * 0.45**2, rel=1e-3)


# -- meshes -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize('shape', SHAPES)
def test_a_mesh_fills_its_section_with_sound_elements(shape: str):
    section = placed(SHAPES[shape](), 18.64e-3, 3.53e-3)
    mesh = section_mesh(section, 0.1e-3)
    weights = make_elements(mesh).weights
    assert weights.sum() == pytest.approx(section.volume, rel=2e-3)
    assert (weights.min(axis=1) / weights.max(axis=1)).min() > 0.3  # no element is bent or flat
    assert sorted(np.unique(mesh.elements)) == list(range(len(mesh.nodes)))
    assert signed_area(mesh.nodes[mesh.surface]) > 0.0


def test_outlines_drawn_at_random_are_meshed():
    random = np.random.default_rng(1)
    for corners in range(4, 16):
        angle = 2.0 * np.pi * (np.arange(corners) + random.uniform(0.0, 0.7, corners)) / corners
        radius = random.uniform(0.35, 1.0, corners)
        outline = np.stack((radius * np.cos(angle), radius * np.sin(angle)), axis=1)
        section = placed(Section(checked_outline(outline, 'random')), 20e-3, 4e-3)
        weights = make_elements(section_mesh(section, 0.15e-3)).weights
        assert weights.sum() == pytest.approx(section.volume, rel=1e-3)
        assert (weights.min(axis=1) / weights.max(axis=1)).min() > 0.2


def test_half_the_edge_has_two_to_four_times_the_elements():
    section = placed(SHAPES['x_ring'](), 18.64e-3, 3.53e-3)
    coarse, fine = (len(section_mesh(section, edge).elements) for edge in (0.1e-3, 0.05e-3))
    assert 2.0 < fine / coarse < 4.0


def test_the_cap_is_made_of_whole_elements():
    model = oring_model(seal('capped_ring'))
    moduli = np.ravel(model.rubber.modulus)
    assert set(moduli) == {5.5e6, 500e6}
    volume = model.elements.weights.sum(axis=1)[moduli == 500e6].sum()
    section = placed(mirrored(SHAPES['capped_ring']()), RING.ring_inner_diameter, RING.section_diameter)
    assert section.cap is not None
    assert volume == pytest.approx(Section(section.cap).volume, rel=1e-3)


# -- contact ----------------------------------------------------------------------------------------------------------


def test_a_circle_drawn_as_a_polygon_has_the_contact_of_the_o_ring():
    round_ring, drawn = (at(seal(shape, transition=0.05), 7e5) for shape in (None, 'circle'))
    assert drawn.gland.force == pytest.approx(round_ring.gland.force, rel=0.015)
    assert drawn.rod.force == pytest.approx(round_ring.rod.force, rel=0.015)
    assert drawn.gland.peak_stress == pytest.approx(round_ring.gland.peak_stress, rel=0.03)


@pytest.mark.parametrize('shape', [shape for shape in SHAPES if shape != 'wiper'])  # which holds no pressure
def test_axial_force_is_pressure_times_area_and_forces_balance(shape: str):
    case = seal(shape)
    result = at(case, 7e5)
    assert result.axial_force == pytest.approx(7e5 * projected_area(RING), rel=0.015)
    assert result.volume_ratio == pytest.approx(result.expected_volume_ratio, abs=1e-6)


def test_an_x_ring_seals_with_two_lips_on_each_wall():
    loaded = list(loaded_states(case := seal('x_ring'), oring_model(case), (0.0, 5e5)))
    for state in loaded:
        contact = evaluate_contact(oring_model(case), state).gland
        assert contact.between_lips > 1.0e-3
        assert 0.6e-3 < contact.width < 1.8e-3
        touching = contact.sheared_area(1e-3) - contact.sheared_area(1e-3 * math.e)  # of the logarithm of all stress
        assert touching == pytest.approx(contact.width * contact.circumference, rel=1e-3)


def test_the_normal_force_of_an_x_ring_converges_on_three_meshes():
    coarse, middle, fine = (at(seal('x_ring', lines), 7e5).gland.force for lines in (13, 17, 25))
    assert coarse == pytest.approx(fine, rel=0.08)
    assert middle == pytest.approx(fine, rel=0.03)


def test_pressure_opens_the_lips_of_a_u_cup():
    free, loaded = oring_results(seal('u_cup'), (0.0, 2e6))
    assert loaded.gland.force > 5.0 * free.gland.force
    upstream = free.gland.position.mean()
    assert upstream < -0.5e-3  # the lips alone seal without pressure


def test_a_cap_carries_more_contact_stress_the_stiffer_its_energiser():
    soft, hard = (
        at(dataclasses.replace(seal('capped_ring'), rubber=Rubber(elastic_modulus=e)), 0.0) for e in (4e6, 8e6)
    )
    assert 1.5 < hard.gland.force / soft.gland.force < 2.1


def test_a_mounted_seal_presses_less_as_its_rubber_relaxes_and_the_fluid_presses_on():
    case = seal('x_ring')
    relaxed = dataclasses.replace(case.rubber, prony_shares=(0.5,), prony_times=(60.0,), time_since_mounting=86400.0)
    fresh, old = (tuple(oring_results(dataclasses.replace(case, rubber=r), (0.0, 2e6))) for r in (case.rubber, relaxed))
    assert old[0].gland.force == pytest.approx(0.5 * fresh[0].gland.force, rel=2e-3)  # the squeeze alone
    assert old[0].gland.peak_stress == pytest.approx(0.5 * fresh[0].gland.peak_stress, rel=2e-3)
    assert old[1].gland.force > 0.8 * fresh[1].gland.force  # the pressure


def test_fluid_passes_a_lip_whose_stress_is_below_its_pressure():
    stress = np.array([-1.0, 2.0, 3.0, 2.0, -1.0, -1.0, 4.0, 6.0, 4.0, -1.0])
    assert _holding(stress, 1.0, 0, 1) == 2
    assert _holding(stress, 5.0, 0, 1) == 7
    assert _holding(stress, 9.0, 0, 1) == 7  # none holds: the highest one
    assert _holding(stress, 1.0, 9, -1) == 7


def test_a_lip_that_all_but_holds_the_next_one_too_keeps_the_fluid_before_it():
    stress = np.array([-1.0, 9.3, 8.3, 8.4, 12.0, -1.0])
    assert _holding(stress, 8.9, 0, 1) == 1
    assert _holding(stress, 10.0, 0, 1) == 4


def test_a_section_that_folds_onto_itself_is_refused():
    case = seal('u_cup')
    model = oring_model(case)
    free = next(loaded_states(case, model, (0.0,)))
    across = free.state.displacement.copy()
    node = model.mesh.surface[np.argmin(model.mesh.nodes[model.mesh.surface, 1])]  # the tip of a lip
    across[2 * node] += RING.section_diameter
    with pytest.raises(ValueError, match='mine: at 0 Pa the section folds onto itself at r = '):
        _check_unfolded(case, model, free._replace(state=free.state._replace(displacement=across)))


def test_a_lip_that_touches_with_its_edge_alone_has_friction():
    contact = at(dataclasses.replace(seal('u_cup'), rubber=Rubber(elastic_modulus=20e6)), 0.0).gland
    assert 0.0 < contact.width < 0.3e-3
    assert 1e12 * contact.sheared_area(1e12) == pytest.approx(contact.force)
    assert contact.sheared_area(1e5) > 0.0


# -- exact solution: a block between smooth walls, squeezed by a tenth, in plane strain ------------------------------


def block(cap: np.ndarray | None = None) -> OringCase:
    """Ring of rectangular section, 2 mm high and 3 mm long, so large that its hoop hardly strains."""
    corners = np.array([(0.0, 1.5), (0.0, -1.5), (0.9, -1.5), (2.0, -1.5), (2.0, 1.5), (0.9, 1.5)])
    inner, height = 0.4, 2e-3
    return OringCase(
        name='block',
        geometry=SealGeometry(
            section_diameter=height,
            ring_inner_diameter=inner - 0.1 * height,
            rod_diameter=inner,
            gland_diameter=inner + 1.8 * height,
        ),
        groove=Groove(width=4e-3),
        rubber=Rubber(elastic_modulus=6e6),
        numerics=OringNumerics(lines=13, transition=0.01, penalty=1e4),
        section=Section(checked_outline(corners, 'block'), cap),
        cap=None if cap is None else Rubber(elastic_modulus=60e6),
    )


def test_the_edge_at_a_rounded_corner_is_as_strong_as_that_of_a_quarter_plane_with_a_notch():
    r"""A quarter plane under a pressure q, its corner of a radius R, is by symmetry a half plane with a notch.

    The open notch has the stress intensity 1.1215 q (pi R)^0.5. It closes from its tip on over a length d on which the
    gap is a parabola: d^1.5 = 1.5 (pi R / E*) 1.1215 q (R / 2)^0.5, and the edge has k = 2 E* d^0.5 / (pi R).
    """
    height, radius, squeeze = 2e-3, 0.08e-3, 0.02
    case, corners = block(), np.array([(0.0, 1.5), (0.0, -1.5), (2.0, -1.5), (2.0, 1.5)])
    inner = case.geometry.rod_diameter
    gap = {'ring_inner_diameter': inner - squeeze * height, 'gland_diameter': inner + 2.0 * (1.0 - squeeze) * height}
    case = dataclasses.replace(
        case,
        section=rounded(Section(checked_outline(corners, 'block')), 2.0 * radius / height, outside=False),
        geometry=dataclasses.replace(case.geometry, **gap),
        numerics=OringNumerics(lines=17, transition=0.002, penalty=2e4),
    )
    result = at(case, 0.0)
    q, modulus = middle_stress(result), 8e6
    closed = (1.5 * math.pi * radius / modulus * 1.1215 * q * math.sqrt(radius / 2.0)) ** (2.0 / 3.0)
    expected = 2.0 * modulus * math.sqrt(closed) / (math.pi * radius)
    strengths = edge_strengths(result.rod, 0.0, 0.002 * 6e6)
    assert strengths is not None
    assert strengths[0] == pytest.approx([expected, expected], rel=0.05)


def middle_stress(result: OringResult) -> float:
    """Contact stress in the middle half of the contact on the rod [Pa]."""
    place, stress = result.rod.position, result.rod.stress
    center = 0.5 * (place[0] + place[-1])
    return float(stress[np.abs(place - center) < 0.25 * np.ptp(place)].mean())


@pytest.mark.parametrize('pressure', [0.0, 4e6])
def test_a_rectangular_ring_has_the_exact_stress_of_plane_strain(pressure: float):
    squeezed = 6e6 / 3.0 * (1.0 / 0.9**2 - 0.9**2)  # G (lambda_z^2 - lambda_r^2) without pressure, p more with it
    assert middle_stress(at(block(), pressure)) == pytest.approx(squeezed + pressure, rel=0.01)


def test_a_cap_and_its_energiser_share_the_squeeze_as_two_springs():
    cap = np.array([(0.9, 1.5), (0.0, 1.5), (0.0, -1.5), (0.9, -1.5)])

    def stress(modulus: float, stretch: float) -> float:
        return modulus / 3.0 * (stretch**-2 - stretch**2)

    def squeezed(rubber: float) -> float:
        """Height of both layers, with the stretch of the rubber and the same stress in the cap."""
        caps = np.linspace(0.5, 1.0, 5001)
        return 1.1 * rubber + 0.9 * float(np.interp(-stress(6e6, rubber), -stress(60e6, caps), caps))

    # smooth walls, but bonded layers: far from the ends both have one axial stretch only if they are equally stiff, so
    # the stress lies between that of free layers in series and that of layers which stretch together
    stretches = np.linspace(0.7, 1.0, 301)
    series = stress(6e6, float(np.interp(1.8, [squeezed(s) for s in stretches], stretches)))
    together = stress(0.55 * 6e6 + 0.45 * 60e6, 0.9)
    assert series < middle_stress(at(block(cap), 0.0)) < together


def test_a_cap_with_rounded_corners_has_a_film_of_each_direction_on_any_mesh():
    films = []
    for lines in (17, 25):
        case = seal('capped_ring', lines, transition=0.005)
        assert case.section is not None
        case = dataclasses.replace(case, section=rounded(case.section, 0.02, outside=True))
        result = at(case, 5e6)
        film = seal_film(result.gland, 5e6, (4.0 / 3.0 * 500e6, 0.005 * 5.5e6), (0.03, 0.1))
        assert film is not None
        films.append(film[:2])
    assert films[0] == pytest.approx(films[1], rel=0.1)
