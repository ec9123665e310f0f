"""Case of a seal: what follows from its numbers, what it refuses, and what its file may say."""

import dataclasses
import math

import numpy as np
import pytest
import yaml
from paths import ROOT

from seal_friction_ros.core.friction.laws.friction_map import FrictionMap
from seal_friction_ros.core.lubrication.friction_map import SteadyFriction, friction_map, map_pressures, map_speeds
from seal_friction_ros.core.lubrication.groove import GrooveSpring
from seal_friction_ros.core.lubrication.lubrication_case import (
    AirPressure,
    LubricationCase,
    LubricationNumerics,
    MapGrid,
    SealBody,
    ShearStressStudy,
    Spool,
    SpoolSeal,
    Viscoelasticity,
    parse_lubrication_case,
    varied_case,
)
from seal_friction_ros.core.lubrication.topography import Topography
from seal_friction_ros.core.lubrication.transient import initial_state, lubrication_model
from seal_friction_ros.core.lubrication.wall import ControlEdge, FilmSupply
from seal_friction_ros.core.oring_contact.material import elastic_modulus_of_hardness
from seal_friction_ros.core.oring_contact.oring_case_file import OringCaseFile, parse_oring_case

RING = yaml.safe_load((ROOT / 'config' / 'oring' / 'ms28775_114_blind.yaml').read_text())


def load(name: str) -> OringCaseFile:
    assert name == 'blind'
    return parse_oring_case(RING)


def test_profile_falls_by_a_parabola_of_its_own_radius_on_each_side():
    seal = SealBody(crown_radius_left=1e-3, crown_radius_right=2e-3)
    assert seal.fall(np.array([-0.2e-3, 0.0, 0.2e-3])) == pytest.approx([20e-6, 0.0, 10e-6])


def test_modulus_in_plane_strain_is_eight_times_the_sum_of_the_mooney_constants():
    assert SealBody(mooney_c10=1e6, mooney_c01=0.5e6).modulus == pytest.approx(12e6)
    assert SealBody(mooney_c10=1e6, mooney_c01=0.0).modulus == pytest.approx(8e6)


@pytest.mark.parametrize('sides', [(6e5, 1e5), (1e5, 6e5)])
def test_pressure_difference_presses_the_seal_on_whichever_side_it_is(sides):
    """36 um and 60 um/MPa of 0.5 MPa."""
    case = LubricationCase(name='x', air=AirPressure(*sides), groove=GrooveSpring(half_clearance=1e-4))
    assert case.air.difference == pytest.approx(5e5)
    assert case.interference == pytest.approx(66e-6)
    assert case.seated_groove == GrooveSpring(half_clearance=0.0)


def test_even_pressure_neither_presses_the_seal_nor_seats_it():
    case = LubricationCase(name='x', air=AirPressure(2e5, 2e5), groove=GrooveSpring(half_clearance=1e-4))
    assert (case.interference, case.seated_groove) == (36e-6, case.groove)


def test_creep_has_the_part_of_the_compliance_that_is_not_there_at_once():
    assert Viscoelasticity(stiffening=1.0, relaxation_time=0.3).creep == ((0.5, 0.3),)
    parts = Viscoelasticity(stiffening=4.0, relaxation_time=0.02, decades=1).creep
    assert np.array(parts) == pytest.approx(np.array([(0.4, 0.02), (0.4, 0.2)]))


SECTION = {'body': 'finite_elements', 'section_width': 0.8e-3, 'crown_radius_left': 0.1e-3, 'crown_radius_right': 1.0}


def test_section_has_to_keep_a_fifth_of_its_height_at_its_lower_flank():
    """0.4 mm from a crown of 0.1 mm it falls by 0.8 mm: of 1 mm a fifth is left. In powers of 2 the bound is exact."""
    height = 5.0 * 2.0**-12
    even = {'crown_radius_left': 2.0**-11, 'crown_radius_right': 2.0**-11, 'section_width': 2.0**-9}
    assert SealBody(**SECTION | even | {'section_height': height}).section_height == height
    assert SealBody(**SECTION | {'section_height': 1.0001e-3}).section_height == 1.0001e-3
    with pytest.raises(ValueError, match=r'section_width = 0.0008 m leaves 0.0002 m of section_height = 0.0009995 m'):
        SealBody(**SECTION | {'section_height': 0.9995e-3})
    mirrored = SECTION | {'crown_radius_left': 1.0, 'crown_radius_right': 0.1e-3, 'section_height': 0.9e-3}
    with pytest.raises(ValueError, match=r'leaves 0.0001\d* m'):
        SealBody(**mirrored)


def test_cases_on_the_bounds_of_what_fits_are_possible():
    numerics = LubricationNumerics(film_width=1e-3)
    assert LubricationCase(name='x', numerics=numerics).seal.section_height == 1e-3  # as high as the film is wide
    held = SealBody(body='finite_elements', section_hold='bottom_and_flanks')
    assert LubricationCase(name='x', seal=held).groove.half_clearance == 0.0
    loose = GrooveSpring(half_clearance=1e-4)
    assert (
        LubricationCase(name='x', seal=dataclasses.replace(held, section_hold='bottom'), groove=loose).groove == loose
    )
    assert LubricationCase(name='x', seal=dataclasses.replace(held, body='half_plane'), groove=loose).groove == loose


def test_study_and_map_without_extent_are_refused():
    with pytest.raises(ValueError, match='solid_shear_stresses is empty'):
        ShearStressStudy(())
    with pytest.raises(ValueError, match=r'velocity_max = 0.01 m/s is not above velocity_min = 0.01 m/s'):
        MapGrid(velocity_min=0.01, velocity_max=0.01)


# -- surfaces and unknowns


@pytest.mark.parametrize(
    ('values', 'slope'),
    [
        ({'rms_height': 4e-6}, 1.6),  # twice as high: twice as steep
        ({'roll_off_length': 50e-6}, 0.4),  # twice as long: half as steep
        ({'rms_height': 3e-6, 'roll_off_length': 12.5e-6}, 2.4),
        ({'rms_height': 4e-6, 'rms_slope': 0.6}, 1.2),
        ({'wall_share': 0.4}, 0.8),
    ],
)
def test_surface_with_another_height_or_length_is_stretched(values, slope):
    case = LubricationCase(name='x', topography=Topography(rms_height=2e-6, rms_slope=0.8, roll_off_length=25e-6))
    surface = varied_case(case, {f'topography.{name}': value for name, value in values.items()}).topography
    assert surface.rms_slope == pytest.approx(slope)
    assert all(getattr(surface, name) == value for name, value in values.items() if name != 'rms_slope')


def test_case_with_other_values_is_the_same_but_for_them_and_has_nothing_unknown():
    case = parse_lubrication_case({'name': 'x', 'unknown': {'seal.interference': {'factor': 1.5}}})
    (one,) = case.unknown
    assert (one.name, one.value, one.amounts) == ('seal.interference', 36e-6, (1.5,))
    varied = varied_case(case, {'seal.interference': 40e-6, 'groove.stiffness': 1e4})
    assert (varied.seal.interference, varied.groove.stiffness, varied.unknown) == (40e-6, 1e4, ())
    assert varied_case(case, {}) == dataclasses.replace(case, unknown=())


def test_ring_brings_its_own_unknowns_but_that_of_a_coefficient_of_friction():
    spread = {'topography.rms_height': {'factor': 2.0}}
    case = parse_lubrication_case({'name': 'x', 'oring': 'blind', 'unknown': spread}, load)
    names = [one.name for one in case.unknown]
    ring = [f'oring.{name}' for name in RING['unknown'] if name != 'friction_coefficient']
    assert names == ['topography.rms_height', *ring]
    harder = varied_case(case, {'oring.rubber.hardness': 80.0})
    assert harder.oring.rubber.elastic_modulus == elastic_modulus_of_hardness(80.0)
    assert varied_case(case, {'seal.solid_shear_stress': 1e6}).oring == case.oring


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
def test_ring_or_spool_without_sense_is_refused_in_one_line(document, words):
    with pytest.raises(ValueError, match=words) as caught:
        parse_lubrication_case({'name': 'x'} | document, load)
    assert '\n' not in str(caught.value)


def test_ring_takes_the_shear_stress_of_the_case_and_is_refused_where_there_are_none():
    document = {'name': 'x', 'oring': 'blind', 'seal': {'solid_shear_stress': 2e6}}
    case = parse_lubrication_case(document, load)
    assert (case.oring, case.seal.solid_shear_stress) == (load('blind').case, 2e6)
    assert parse_lubrication_case(document | {'seal': None}, load).seal == SealBody()
    with pytest.raises(ValueError, match="oring = 'blind': there are no O-ring cases here"):
        parse_lubrication_case(document)


def test_case_file_has_its_parts_and_the_others_by_default():
    document = {'name': 'x', 'source': 'here', 'control_edge': {'slope': 0.5}, 'grease': None, 'film_supply': None}
    case = parse_lubrication_case(document)
    expected = LubricationCase(name='x', source='here', control_edge=ControlEdge(slope=0.5), film_supply=FilmSupply())
    assert case == expected


def test_spool_file_has_its_seals_in_order():
    seals = [{'case': 'a'}, {'case': 'b', 'mirrored': True, 'shift': 1e-3}]
    spool = parse_lubrication_case({'name': 'x', 'seals': seals, 'motion': {'cycles': 3}})
    assert isinstance(spool, Spool)
    assert spool.members == (SpoolSeal('a'), SpoolSeal('b', mirrored=True, shift=1e-3))
    assert (spool.motion.cycles, spool.motion.distance) == (3, 1.8e-3)


# -- friction map


GRID = MapGrid(velocity_min=1e-3, velocity_max=0.1, velocities=3, pressure_max=4e5, pressures=3)


def test_map_has_speeds_in_equal_ratios_and_pressures_in_equal_steps():
    assert map_speeds(GRID) == pytest.approx([1e-3, 1e-2, 1e-1])
    assert map_pressures(GRID) == pytest.approx([0.0, 2e5, 4e5])


def row(pressure: float, friction: float, stiffness: float) -> SteadyFriction:
    values = friction * np.array([1.0, 0.9, 0.8])
    return SteadyFriction(pressure, values, values, 0.0 * values, stiffness, 0)


@pytest.mark.parametrize(('oring', 'length'), [(False, 2.0 / 1e4), (True, 3.0 / 4e4)])
def test_law_has_its_rows_in_order_of_pressure_and_its_presliding_from_the_lowest_that_holds(oring, length):
    """A ring that no pressure holds rolls: its length is that of the next pressure."""
    case = LubricationCase(name='x', map=GRID, oring=load('blind').case if oring else None)
    rows = [row(4e5, 4.0, 5e4), row(0.0, 2.0, 1e4), row(2e5, 3.0, 4e4)]
    law = friction_map(case, rows, 7e-4)
    assert law == FrictionMap(
        speeds=tuple(map_speeds(GRID).tolist()),
        pressures=(0.0, 2e5, 4e5),
        frictions=tuple(force * share for force in (2.0, 3.0, 4.0) for share in (1.0, 0.9, 0.8)),
        reference_speed=34e-3,
        memory_length=7e-4,
        presliding_length=length,
    )
    with pytest.raises(ValueError, match='the rows are not those of the pressures of the grid'):
        friction_map(case, [*rows[:2], row(1e5, 3.0, 4e4)], 7e-4)


# -- a seal at rest


def test_air_falls_over_the_middle_half_of_the_film_and_deflects_nothing_by_itself():
    numerics = LubricationNumerics(cells=32, film_width=0.32e-3)
    case = LubricationCase(name='x', air=AirPressure(4e5, 0.0), numerics=numerics)
    model = lubrication_model(case)
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
    case = LubricationCase(name='x', numerics=LubricationNumerics(cells=60), film_supply=FilmSupply(0.5e-6))
    start = initial_state(lubrication_model(case), -0.9e-3)
    gap, _, saturation = start.state
    assert saturation == pytest.approx(np.minimum(1.0, 1e-6 / gap))
    assert saturation.min() < 1.0
    wall = start.wall_film
    assert wall.start == pytest.approx(-0.9e-3 - 3e-3)
    assert len(wall.volume) * wall.width == pytest.approx(6e-3, abs=wall.width)
    assert wall.volume == pytest.approx(0.5e-6 * wall.width)
    endless = dataclasses.replace(case, motion=dataclasses.replace(case.motion, distance=9.0))
    with pytest.raises(ValueError, match=r'the film on the wall has \d{7} cells: make motion.distance shorter'):
        initial_state(lubrication_model(endless), 0.0)


def test_seal_with_clearance_begins_on_its_left_seat_and_has_crept_under_its_load():
    numerics = LubricationNumerics(cells=60)
    groove, creeping = GrooveSpring(half_clearance=1e-4), Viscoelasticity(stiffening=3.0, decades=1)
    case = LubricationCase(name='x', numerics=numerics, groove=groove, viscoelasticity=creeping)
    model = lubrication_model(case)
    start = initial_state(model, 2e-4)
    assert (start.lag, start.seat, start.contact_place) == (-1e-4, -1e-4, pytest.approx(3e-4))
    deflected = start.state.gap - model.profile
    assert start.creep == pytest.approx(np.stack((0.375 * deflected,) * 2), abs=1e-12)
