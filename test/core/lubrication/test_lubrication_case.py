"""Case of a seal: what follows from its numbers, what it refuses, and what its file may say."""

import dataclasses

import numpy as np
import pytest
import yaml
from paths import ROOT

from seal_friction_ros.core.friction.laws.friction_map import FrictionMap
from seal_friction_ros.core.lubrication.friction_map import (
    SteadyFriction,
    friction_map,
    map_pressures,
    map_speeds,
    stacked,
)
from seal_friction_ros.core.lubrication.lubrication_case import (
    LubricationCase,
    MapGrid,
    parse_lubrication_case,
    varied_case,
)
from seal_friction_ros.core.lubrication.seal_section import SealBody
from seal_friction_ros.core.lubrication.topography import Topography
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


def test_ring_takes_the_shear_stress_of_the_case_and_is_refused_where_there_are_none():
    document = {'name': 'x', 'oring': 'blind', 'seal': {'solid_shear_stress': 2e6}}
    case = parse_lubrication_case(document, load)
    assert (case.oring, case.seal.solid_shear_stress) == (load('blind').case, 2e6)
    assert parse_lubrication_case(document | {'seal': None}, load).seal == SealBody()
    with pytest.raises(ValueError, match="oring = 'blind': there are no O-ring cases here"):
        parse_lubrication_case(document)


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
    law = friction_map(case, stacked(rows), 7e-4)
    assert law == FrictionMap(
        speeds=tuple(map_speeds(GRID).tolist()),
        pressures=(0.0, 2e5, 4e5),
        frictions=tuple(force * share for force in (2.0, 3.0, 4.0) for share in (1.0, 0.9, 0.8)),
        reference_speed=34e-3,
        memory_length=7e-4,
        presliding_length=length,
    )
    with pytest.raises(ValueError, match='the rows are not those of the pressures of the grid'):
        friction_map(case, stacked([*rows[:2], row(1e5, 3.0, 4e4)]), 7e-4)


# -- a seal at rest


def test_a_section_that_is_not_round_has_no_film():
    drawn = parse_oring_case({**RING, 'section': {'shape': 'x_ring'}})
    with pytest.raises(ValueError, match='the film is computed for round rings: ms28775_114_blind'):
        parse_lubrication_case({'name': 'x', 'oring': 'blind'}, lambda _: drawn)
