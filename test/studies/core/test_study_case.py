"""Case of a study: what follows from its numbers, what it refuses, and what its file may say."""

import dataclasses
import math

import numpy as np
import pytest
import yaml
from paths import ROOT

from seal_friction_ros.core.lubrication.lubrication_case import MapGrid
from seal_friction_ros.core.oring_contact.oring_case_file import OringCaseFile, parse_oring_case
from seal_friction_studies.core.groove import GrooveSpring
from seal_friction_studies.core.study_case import (
    AirPressure,
    ShearStressStudy,
    Spool,
    SpoolSeal,
    StudyCase,
    StudyNumerics,
    StudySeal,
    Viscoelasticity,
    parse_study_case,
)
from seal_friction_studies.core.transient import initial_state, transient_model
from seal_friction_studies.core.wall import ControlEdge, FilmSupply

RING = yaml.safe_load((ROOT / 'config' / 'oring' / 'ms28775_114_blind.yaml').read_text())


def load(name: str) -> OringCaseFile:
    assert name == 'blind'
    return parse_oring_case(RING)


@pytest.mark.parametrize('sides', [(6e5, 1e5), (1e5, 6e5)])
def test_pressure_difference_presses_the_seal_on_whichever_side_it_is(sides):
    """36 um and 60 um/MPa of 0.5 MPa."""
    case = StudyCase(
        name='x',
        air=AirPressure(pressure_left=sides[0], pressure_right=sides[1]),
        groove=GrooveSpring(half_clearance=1e-4),
    )
    assert case.air.difference == pytest.approx(5e5)
    assert case.interference == pytest.approx(66e-6)
    assert case.seated_groove == GrooveSpring(half_clearance=0.0)


def test_even_pressure_neither_presses_the_seal_nor_seats_it():
    air = AirPressure(pressure_left=2e5, pressure_right=2e5)
    case = StudyCase(name='x', air=air, groove=GrooveSpring(half_clearance=1e-4))
    assert (case.interference, case.seated_groove) == (36e-6, case.groove)


def test_creep_has_the_part_of_the_compliance_that_is_not_there_at_once():
    assert Viscoelasticity(stiffening=1.0, relaxation_time=0.3).creep == ((0.5, 0.3),)
    parts = Viscoelasticity(stiffening=4.0, relaxation_time=0.02, decades=1).creep
    assert np.array(parts) == pytest.approx(np.array([(0.4, 0.02), (0.4, 0.2)]))


def test_cases_on_the_bounds_of_what_fits_are_possible():
    numerics = StudyNumerics(film_width=1e-3)
    assert StudyCase(name='x', numerics=numerics).seal.section_height == 1e-3  # as high as the film is wide
    held = StudySeal(body='finite_elements', section_hold='bottom_and_flanks')
    assert StudyCase(name='x', seal=held).groove.half_clearance == 0.0
    loose = GrooveSpring(half_clearance=1e-4)
    assert StudyCase(name='x', seal=dataclasses.replace(held, section_hold='bottom'), groove=loose).groove == loose
    assert StudyCase(name='x', seal=dataclasses.replace(held, body='half_plane'), groove=loose).groove == loose


def test_study_and_map_without_extent_are_refused():
    with pytest.raises(ValueError, match='solid_shear_stresses is empty'):
        ShearStressStudy(())
    with pytest.raises(ValueError, match=r'velocity_max = 0.01 m/s is not above velocity_min = 0.01 m/s'):
        MapGrid(velocity_min=0.01, velocity_max=0.01)


# -- surfaces and unknowns


@pytest.mark.parametrize(
    ('document', 'words'),
    [
        ({'oring': 3}, 'case x: oring = 3 is not the name or path of an O-ring case'),
        ({'oring': 'blind', 'groove': {}}, 'case x: groove has no meaning for an O-ring: leave it out'),
        ({'oring': 'blind', 'air': {}, 'control_edge': {}}, 'air, control_edge has no meaning for an O-ring'),
        ({'oring': 'blind', 'film_supply': {}}, 'film_supply has no meaning'),
        ({'oring': 'blind', 'viscoelasticity': None}, 'viscoelasticity has no meaning'),
        ({'oring': 'blind', 'seal': {'interference': 1e-5}}, 'seal.interference has no meaning'),
        ({'oring': 'blind', 'unknown': {'groove.stiffness': {'factor': 2.0}}}, 'unknown has no groove.stiffness'),
        ({'oring': 'blind', 'unknown': {'seal.interference': {'factor': 2.0}}}, 'unknown has no seal.interference'),
        ({'unknown': {'motion.speed': {'factor': 2.0}}}, 'unknown has no motion.speed'),
        ({'unknown': {'seal.body': {'factor': 2.0}}}, 'unknown has no seal.body'),
        ({'seals': {}}, 'spool x: seals = {} is not a list'),
        ({'seals': [{'case': 'y'}], 'seal': {}}, 'case x has no seal: it has motion, name, seals, source'),
        ({'seals': [{'case': 'y', 'shift': 2.0}]}, r'spool x: seals\[0\]: SpoolSeal.shift = 2.0 m is above'),
    ],
)
def test_an_invalid_ring_or_spool_is_refused_in_one_line(document, words):
    with pytest.raises(ValueError, match=words) as caught:
        parse_study_case({'name': 'x'} | document, load)
    assert '\n' not in str(caught.value)


def test_case_file_has_its_parts_and_the_others_by_default():
    document = {'name': 'x', 'source': 'here', 'control_edge': {'slope': 0.5}, 'grease': None, 'film_supply': None}
    case = parse_study_case(document)
    expected = StudyCase(name='x', source='here', control_edge=ControlEdge(slope=0.5), film_supply=FilmSupply())
    assert case == expected


def test_spool_file_has_its_seals_in_order():
    seals = [{'case': 'a'}, {'case': 'b', 'mirrored': True, 'shift': 1e-3}]
    spool = parse_study_case({'name': 'x', 'seals': seals, 'motion': {'cycles': 3}})
    assert isinstance(spool, Spool)
    assert spool.members == (SpoolSeal('a'), SpoolSeal('b', mirrored=True, shift=1e-3))
    assert (spool.motion.cycles, spool.motion.distance) == (3, 1.8e-3)


# -- friction map


# -- a seal at rest


def test_air_falls_over_the_middle_half_of_the_film_and_deflects_nothing_by_itself():
    numerics = StudyNumerics(cells=32, film_width=0.32e-3)
    case = StudyCase(name='x', air=AirPressure(pressure_left=4e5, pressure_right=0.0), numerics=numerics)
    model = transient_model(case)
    assert model.place == pytest.approx(1e-5 * (np.arange(32) - 15.5))
    assert model.ambient[[0, 7, 8, 15, 16, 23, 24, 31]] == pytest.approx(
        [4e5, 4e5, 3.875e5, 2.125e5, 1.875e5, 0.125e5, 0.0, 0.0]
    )
    gap = model.profile + model.contact.body.deflection(model.ambient)
    assert gap == pytest.approx(model.place**2 / 2e-3 - 60e-6)
    assert model.circumference == pytest.approx(math.pi * 6e-3)
    ends = model.ends(left=0.5)
    assert (ends.pressure_left, ends.pressure_right, ends.saturation_left, ends.saturation_right) == (4e5, 0.0, 0.5, 1)


def test_starved_seal_begins_on_twice_the_film_of_the_wall_which_reaches_beyond_all_its_ways():
    """Way 1.8 mm and two films of 0.6 mm on either side: 6 mm of wall."""
    case = StudyCase(name='x', numerics=StudyNumerics(cells=60), film_supply=FilmSupply(0.5e-6))
    start = initial_state(transient_model(case), -0.9e-3)
    gap, _, saturation = start.state
    assert saturation == pytest.approx(np.minimum(1.0, 1e-6 / gap))
    assert saturation.min() < 1.0
    wall = start.wall_film
    assert wall.start == pytest.approx(-0.9e-3 - 3e-3)
    assert len(wall.volume) * wall.width == pytest.approx(6e-3, abs=wall.width)
    assert wall.volume == pytest.approx(0.5e-6 * wall.width)
    endless = dataclasses.replace(case, motion=dataclasses.replace(case.motion, distance=9.0))
    with pytest.raises(ValueError, match=r'the film on the wall has \d{7} cells: make motion.distance shorter'):
        initial_state(transient_model(endless), 0.0)


def test_seal_with_clearance_begins_on_its_left_seat_and_has_crept_under_its_load():
    numerics = StudyNumerics(cells=60)
    groove, creeping = GrooveSpring(half_clearance=1e-4), Viscoelasticity(stiffening=3.0, decades=1)
    case = StudyCase(name='x', numerics=numerics, groove=groove, viscoelasticity=creeping)
    model = transient_model(case)
    start = initial_state(model, 2e-4)
    assert (start.lag, start.seat, start.contact_place) == (-1e-4, -1e-4, pytest.approx(3e-4))
    deflected = start.state.gap - model.profile
    assert start.creep == pytest.approx(np.stack((0.375 * deflected,) * 2), abs=1e-12)
