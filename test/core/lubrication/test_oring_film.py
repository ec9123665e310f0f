"""The film under a ring: as long as its contact and a half more, on the wall it seals, in balance with the dry ring."""

import dataclasses
import math
from typing import NamedTuple

import numpy as np
import pytest
import yaml
from paths import ROOT
from scipy.integrate import trapezoid

from seal_friction_ros.core.lubrication import oring_film as module
from seal_friction_ros.core.lubrication.friction_map import steady_state
from seal_friction_ros.core.lubrication.lubrication_case import LubricationCase
from seal_friction_ros.core.lubrication.model import fluid_force, solid_limit
from seal_friction_ros.core.lubrication.oring_film import FILM_CROWDING, OringFilm, flat_part, oring_film
from seal_friction_ros.core.lubrication.seal_section import LubricationNumerics
from seal_friction_ros.core.lubrication.topography import Topography
from seal_friction_ros.core.oring_contact.compliance import SlidingFace, sliding_face
from seal_friction_ros.core.oring_contact.loading import loaded_states, oring_model
from seal_friction_ros.core.oring_contact.oring_case import OringCase, OringNumerics
from seal_friction_ros.core.oring_contact.oring_case_file import parse_oring_case
from seal_friction_ros.core.oring_contact.results import WallContact, evaluate_contact
from seal_friction_ros.core.oring_contact.surroundings import GLAND, ROD

PRESSURE = 3e5  # [Pa]


def ring_on(wall: str) -> OringCase:
    """A ring of 13 lines of elements that seals a rod of 15.875 mm or a bore of 20.8534 mm."""
    ring = parse_oring_case(yaml.safe_load((ROOT / 'config' / 'oring' / 'ms28775_114_blind.yaml').read_text())).case
    geometry = dataclasses.replace(ring.geometry, sliding_wall=wall)
    return dataclasses.replace(ring, geometry=geometry, numerics=OringNumerics(lines=13))


def case_of(ring: OringCase) -> LubricationCase:
    surface = Topography(rms_height=1e-6, rms_slope=0.3, filling=True)
    return LubricationCase(name='ring', numerics=LubricationNumerics(cells=64), topography=surface, oring=ring)


class Sealed(NamedTuple):
    """A ring under pressure: with its film, and dry."""

    ring: OringCase
    film: OringFilm
    face: SlidingFace
    dry: WallContact


@pytest.fixture(scope='module', params=['rod', 'bore'])
def sealed(request) -> Sealed:
    ring = ring_on(request.param)
    elements = oring_model(ring, FILM_CROWDING)
    loaded = next(loaded_states(ring, elements, (PRESSURE,)))
    face = sliding_face(elements, loaded, ROD if request.param == 'rod' else GLAND)
    found = evaluate_contact(elements, loaded)
    return Sealed(
        ring, oring_film(case_of(ring), ring, PRESSURE), face, found.rod if request.param == 'rod' else found.gland
    )


def test_film_reaches_a_quarter_of_the_contact_beyond_both_its_edges(sealed):
    model, (left, right) = sealed.film.model, sealed.dry.edges
    length = 1.5 * (right - left)
    assert model.film_width == pytest.approx(length)
    assert model.contact.body.cell_width == pytest.approx(length / 64)
    assert model.place == pytest.approx(left - (right - left) / 4 + (np.arange(64) + 0.5) * length / 64)


def test_film_reaches_no_farther_than_the_face_of_the_ring(sealed, monkeypatch):
    monkeypatch.setattr(module, '_MARGIN', 5.0)
    model = oring_film(case_of(sealed.ring), sealed.ring, PRESSURE).model
    half = 0.5 * model.contact.body.cell_width
    flat = flat_part(sealed.face)
    assert (model.place[0] - half, model.place[-1] + half) == pytest.approx(tuple(flat.place[[0, -1]]))
    assert np.abs(np.diff(flat.gap) / np.diff(flat.place)).max() <= 1.0  # 45 degrees


@pytest.mark.parametrize('lines', [17, pytest.param(65, marks=pytest.mark.long)])
def test_under_a_high_pressure_the_film_ends_outside_the_contact_where_the_face_turns_to_the_groove(lines):
    """At 69 bar the wall of the groove is next to the contact; the gap opens there by 100 um within 60 um."""
    ring = dataclasses.replace(ring_on('rod'), numerics=OringNumerics(lines=lines))
    film = oring_film(case_of(ring), ring, 6.9e6)
    solid, _ = film.model.contact.asperity_pressure(film.start.gap)
    assert film.start.gap.min() > 0.0
    assert film.start.gap[-1] > 3e-6
    assert solid[-1] < 1e-3 * solid.max()


def test_friction_at_high_speed_is_the_same_on_another_mesh_within_2_percent():
    """The film begins in the inlet, where a gap between the nodes decides."""

    def friction(lines: int) -> float:
        ring = dataclasses.replace(ring_on('rod'), numerics=OringNumerics(lines=lines))
        case = dataclasses.replace(case_of(ring), numerics=LubricationNumerics(cells=226))
        model, start, _ = oring_film(case, ring, 0.0)
        state, _ = steady_state(model, start, 0.1)
        return solid_limit(model, state) + fluid_force(model, state, 0.1)

    assert friction(17) == pytest.approx(friction(25), rel=0.02)


def test_film_goes_round_the_wall_that_slides_and_has_the_rubber_in_plane_strain(sealed):
    model = sealed.film.model
    diameter = {'rod': 15.875e-3, 'bore': 20.8534e-3}[sealed.ring.geometry.sliding_wall]
    assert model.circumference == pytest.approx(math.pi * diameter)
    assert model.contact.body.modulus == pytest.approx(sealed.ring.rubber.elastic_modulus / (1.0 - 0.5**2))
    assert sealed.film.axial_stiffness == pytest.approx(sealed.face.axial_stiffness, rel=1e-9)


def test_fluid_stands_up_to_the_peak_of_the_contact_and_nothing_beyond_it(sealed):
    model, start = sealed.film.model, sealed.film.start
    under = start.pressure == PRESSURE
    peak = sealed.face.place[sealed.face.pressure.argmax()]
    assert np.abs(model.place[under][-1] - peak) < 1.1 * model.contact.body.cell_width
    assert under[: under.sum()].all()
    assert (start.pressure[~under] == 0.0).all()
    assert model.ambient.tolist() == start.pressure.tolist()
    assert start.saturation.tolist() == [1.0] * 64
    assert (model.pressure_left, model.pressure_right) == (PRESSURE, 0.0)


def test_ring_at_rest_is_in_balance_with_fluid_and_asperities(sealed):
    """It is h = g + K (p + p_c); both carry what the dry ring carried; beside the contact the gap is still its own."""
    model, (gap, fluid, _) = sealed.film.model, sealed.film.start
    solid, _ = model.contact.asperity_pressure(gap)
    assert gap == pytest.approx(model.profile + model.contact.body.deflection(fluid + solid), abs=1e-12)
    place, face = model.place, sealed.face
    within = np.linspace(place[0], place[-1], 2001)
    carried = trapezoid(np.interp(within, face.place, face.pressure), within)
    assert (fluid + solid).sum() * model.contact.body.cell_width == pytest.approx(carried, rel=0.05)
    dry_gap = np.interp(place[[0, -1]], face.place, face.gap)
    assert gap[[0, -1]] == pytest.approx(dry_gap, rel=0.1)
