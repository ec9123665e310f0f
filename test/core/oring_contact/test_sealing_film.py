"""Inverse theory: a film of known pressure, the edge of Hertz, lips in a row, and the full film under an O-ring."""

import dataclasses
import math

import numpy as np
import pytest
from paths import ROOT
from scipy.integrate import cumulative_trapezoid

from seal_friction_ros.core.lubrication.contact import ContactState, contact_step
from seal_friction_ros.core.lubrication.friction_map import steady_state
from seal_friction_ros.core.lubrication.grease import Grease
from seal_friction_ros.core.lubrication.lubrication_case import LubricationCase
from seal_friction_ros.core.lubrication.oring_film import oring_film
from seal_friction_ros.core.lubrication.seal_section import LubricationNumerics
from seal_friction_ros.core.lubrication.topography import Topography
from seal_friction_ros.core.oring_contact.oring_case import OringCase
from seal_friction_ros.core.oring_contact.oring_case_file import parse_oring_case
from seal_friction_ros.core.oring_contact.results import WallContact, oring_results
from seal_friction_ros.core.oring_contact.sealing_film import edge_strengths, inlet_rise, inverse_film, seal_film
from seal_friction_ros.files import read_yaml

VISCOSITY, SPEED = 0.1, 0.3  # [Pa s], [m/s]
MODULUS, TRANSITION = 8e6, 0.05e6  # [Pa]
PRESSURE = 3e5  # [Pa]


def case_of(name: str, lines: int) -> OringCase:
    case = parse_oring_case(read_yaml(ROOT / 'config' / 'oring' / f'{name}.yaml')).case
    return dataclasses.replace(case, numerics=dataclasses.replace(case.numerics, lines=lines))


def lips(*shapes: tuple[float, float], before: float = 0.0, nodes: int = 12) -> WallContact:
    """Lips of Hertz, each of a peak [Pa] and a half width [m], 5 mm apart; ``before`` the first one stands a fluid."""
    places, stresses, edges = [], [], []
    for i, (peak, half) in enumerate(shapes):
        z = np.linspace(-half, half, nodes + 2)[1:-1]
        under = before * (0.5 - 0.5 * z / half) if i == 0 else 0.0
        places += [5e-3 * i + z]
        stresses += [peak * np.sqrt(1.0 - (z / half) ** 2) + under]
        edges += [5e-3 * i - half, 5e-3 * i + half]
    for i in range(1, len(shapes)):
        places.insert(2 * i - 1, np.array(edges[2 * i - 1 : 2 * i + 1]))
        stresses.insert(2 * i - 1, np.zeros(2))
    ends = (edges[0], edges[-1])
    return WallContact(np.concatenate(places), np.concatenate(stresses), 1.0, 1.0, 1.0, ends, circumference=0.08)


def test_inverse_theory_finds_the_flow_of_a_wedge_from_its_pressure():
    flow = 0.7e-6  # [m]
    place = np.linspace(0.0, 1e-3, 20001)
    gap = 4e-6 - 3.4e-6 * place / 1e-3
    pressure = cumulative_trapezoid(6.0 * VISCOSITY * SPEED * (gap - flow) / gap**3, place, initial=0.0)
    steepest = np.diff(pressure).max() / (place[1] - place[0])
    assert inverse_film(steepest, VISCOSITY, SPEED) == pytest.approx(flow, rel=1e-6)


@pytest.mark.parametrize('before', [0.0, 1e6])
def test_the_edge_of_hertz_has_its_closed_form_with_and_without_fluid_before_it(before: float):
    found = edge_strengths(lips((1e6, 0.4e-3)), 0.0, TRANSITION)
    assert found == pytest.approx(np.full((1, 2), 1e6 * math.sqrt(2.0 / 0.4e-3)), rel=1e-2)
    under_fluid = edge_strengths(lips((3e6, 0.4e-3), before=before), before, TRANSITION)
    assert under_fluid[0, 0] == pytest.approx(3e6 * math.sqrt(2.0 / 0.4e-3), rel=0.15)


def test_the_strongest_edge_on_the_way_in_decides_and_the_difference_of_the_directions_leaks():
    weak, strong = (1e6, 0.8e-3), (2e6, 0.4e-3)
    one, both = (
        seal_film(lips(*which), 0.0, (MODULUS, TRANSITION), (VISCOSITY, SPEED)) for which in ((strong,), (weak, strong))
    )
    assert both.out == pytest.approx(one.out)
    pressed = seal_film(lips(strong, before=1e6), 1e6, (MODULUS, TRANSITION), (VISCOSITY, SPEED))
    assert pressed.out > pressed.back
    assert pressed.leakage == pytest.approx(0.5 * (pressed.out - pressed.back) * 0.08)


def test_a_lip_that_ends_at_a_corner_has_no_film():
    level = lips((1e6, 0.4e-3))._replace(stress=np.full(12, 1e6))
    assert seal_film(level, 0.0, (MODULUS, TRANSITION), (VISCOSITY, SPEED)) is None


def test_film_grows_with_the_power_three_fifths_of_viscosity_and_speed():
    films = [
        inverse_film(inlet_rise(1e8, MODULUS, viscosity, speed), viscosity, speed)
        for viscosity, speed in ((0.1, 0.1), (0.2, 0.1), (0.1, 0.2))
    ]
    assert films[1:] == pytest.approx([2.0**0.6 * films[0]] * 2)


def test_film_of_an_x_ring_is_that_of_a_finer_mesh():
    films = []
    for lines in (33, 49):
        case = case_of('delft_x_ring', lines)
        (result,) = oring_results(case, (PRESSURE,))
        transition = case.numerics.transition * case.rubber.elastic_modulus
        films.append(seal_film(result.gland, PRESSURE, (MODULUS, transition), (VISCOSITY, SPEED))[:2])
    assert films[0] == pytest.approx(films[1], rel=0.08)


@pytest.fixture(scope='module')
def ring() -> OringCase:
    return case_of('delft_o_ring', 25)


@pytest.mark.parametrize('direction', [pytest.param(1.0, marks=pytest.mark.long), -1.0])
def test_film_under_an_o_ring_is_that_of_the_full_lubricated_contact_on_a_smooth_wall(
    ring: OringCase, direction: float
):
    (result,) = oring_results(ring, (PRESSURE,))
    modulus = ring.rubber.elastic_modulus
    film = seal_film(
        result.gland, PRESSURE, (4.0 / 3.0 * modulus, ring.numerics.transition * modulus), (VISCOSITY, SPEED)
    )
    oil = Grease(yield_stress=0.0, consistency_index=0.0, base_viscosity=VISCOSITY)
    smooth = Topography(rms_height=0.05e-6, rms_slope=0.05)
    case = LubricationCase(
        name='smooth', numerics=LubricationNumerics(cells=150), topography=smooth, grease=oil, oring=ring
    )
    model, start, _ = oring_film(case, ring, PRESSURE)
    state, _ = steady_state(model, ContactState(start.gap + 2e-6, start.pressure, start.saturation), -direction * SPEED)
    wall, full = direction * SPEED, state.gap * state.saturation
    step = contact_step(model.contact, state, model.profile, wall, model.ends(), full, math.inf)
    height = 2.0 * step.flow[75] / wall
    assert (film.out if direction > 0.0 else film.back) == pytest.approx(height, rel=0.1)
