"""Geometry of the ring and its gland."""

import math
from dataclasses import replace

import pytest
from harness.hertz import cylinder_between_plates
from hypothesis import given
from hypothesis import strategies as st

from seal_friction_ros.core.foundation.units import INCH, LBF
from seal_friction_ros.core.friction.geometry import (
    SealGeometry,
    contact_length,
    hoop_force,
    projected_area,
    squeeze,
    squeeze_force,
    stretch,
    stretch_force,
)

# A ring of 2 mm section, squeezed 10 % between 10.0 mm and 13.6 mm, stretched 25 % over the rod.
RING = SealGeometry(
    section_diameter=2e-3,
    ring_inner_diameter=8e-3,
    rod_diameter=10e-3,
    gland_diameter=13.6e-3,
    elastic_modulus=4e6,
)


def test_squeeze_is_the_share_of_the_section_that_the_gap_takes_away():
    assert squeeze(RING) == pytest.approx(0.1)


def test_projected_area_is_the_ring_between_the_walls():
    assert projected_area(RING) == pytest.approx(math.pi * (6.8e-3**2 - 5e-3**2))


def test_a_rod_seal_touches_along_the_rod_and_a_piston_seal_along_the_bore():
    assert contact_length(RING) == pytest.approx(math.pi * 10e-3)
    assert contact_length(replace(RING, sliding_wall='bore')) == pytest.approx(math.pi * 13.6e-3)


def test_stretch_is_the_growth_of_the_inner_diameter():
    assert stretch(RING) == pytest.approx(0.25)


def test_hoop_force_is_modulus_times_strain_times_section():
    assert hoop_force(RING) == pytest.approx(4e6 * 0.25 * math.pi * 1e-3**2)


def test_radial_force_of_a_hoop_is_two_pi_times_its_tension():
    assert stretch_force(RING) == pytest.approx(2.0 * math.pi * hoop_force(RING))


def test_a_thin_hoop_under_the_equivalent_pressure_carries_the_same_tension():
    # Figure 13: pressure p on the inner wall of a hoop of width w and radius r gives T = p r w.
    radius, width = 5e-3, 2e-3
    pressure = stretch_force(RING) / (2.0 * math.pi * radius * width)
    assert pressure * radius * width == pytest.approx(hoop_force(RING))


def test_the_stretched_ring_of_the_thesis_presses_with_a_quarter_to_a_half_of_its_normal_force_without_pressure():
    """0.94 lbf of the 4.1 lbf of its finite elements, and of the 2.1 lbf of its line."""
    ring = SealGeometry(0.106 * INCH, 0.612 * INCH, 0.625 * INCH, 0.821 * INCH)
    assert stretch_force(ring) / LBF == pytest.approx(0.94, abs=0.005)


@pytest.mark.parametrize('share', [0.02, 0.08, 0.25])
def test_squeeze_force_is_that_of_a_cylinder_between_plates_by_hertz(share):
    """A ring of plane strain: its hoop cannot grow between two walls."""
    section = 2e-3  # [m]
    ring = SealGeometry(section, 0.9, 1.0, 1.0 + 2.0 * section * (1.0 - share), elastic_modulus=4e6)
    around = math.pi * 0.5 * (ring.rod_diameter + ring.gland_diameter)
    expected = cylinder_between_plates(share, section, 4e6 / 0.75).force_per_length
    assert squeeze_force(ring) == pytest.approx(expected * around, rel=1e-9)


def test_a_ring_loose_on_the_rod_has_negative_stretch_and_no_tension():
    loose = replace(RING, ring_inner_diameter=10.5e-3)
    assert stretch(loose) < 0.0
    assert hoop_force(loose) == 0.0
    assert stretch_force(loose) == 0.0


@given(st.floats(0.5, 20.0))
def test_geometry_scales(factor):
    lengths = ('section_diameter', 'ring_inner_diameter', 'rod_diameter', 'gland_diameter')
    scaled = replace(RING, **{name: factor * getattr(RING, name) for name in lengths})
    assert squeeze(scaled) == pytest.approx(squeeze(RING))
    assert stretch(scaled) == pytest.approx(stretch(RING))
    assert contact_length(scaled) == pytest.approx(factor * contact_length(RING))
    assert projected_area(scaled) == pytest.approx(factor**2 * projected_area(RING))
    assert stretch_force(scaled) == pytest.approx(factor**2 * stretch_force(RING))


def test_a_squeeze_of_nothing_and_of_one_half_are_both_refused():
    """In binary fractions of a metre, so that the squeeze is exact."""
    sizes = {'section_diameter': 0.0625, 'ring_inner_diameter': 0.9, 'rod_diameter': 1.0}
    for gland, share in ((1.125, '0.000'), (1.0625, '0.500')):
        with pytest.raises(ValueError, match=f'squeeze of {share}; bounds 0 to 0.5'):
            SealGeometry(**sizes, gland_diameter=gland)
    assert squeeze(SealGeometry(**sizes, gland_diameter=1.09375)) == 0.25


def test_rubber_has_5_5_megapascal_unless_told():
    """The O-ring of the thesis: 70 Shore A."""
    sizes = {'section_diameter': 2e-3, 'ring_inner_diameter': 8e-3, 'rod_diameter': 10e-3, 'gland_diameter': 13.6e-3}
    ring = SealGeometry(**sizes)
    assert squeeze_force(ring) == pytest.approx(squeeze_force(RING) * 5.5 / 4.0)


@pytest.mark.parametrize(
    ('change', 'complaint'),
    [
        ({'gland_diameter': 10e-3}, r'gland_diameter = 0.01 m is not above rod_diameter = 0.01 m'),
        ({'gland_diameter': 9e-3}, r'gland_diameter = 0.009 m is not above rod_diameter = 0.01 m'),
        ({'section_diameter': 1.79e-3}, r'section_diameter = 0.00179 m gives a squeeze of -0.006; bounds 0 to 0.5'),
        ({'section_diameter': 1.7e-3}, r'section_diameter = 0.0017 m gives a squeeze of -0.059'),
        ({'section_diameter': 4e-3}, r'section_diameter = 0.004 m gives a squeeze of 0.550'),
        ({'sliding_wall': 'shaft'}, r"sliding_wall = 'shaft' is none of rod, bore"),
        ({'rod_diameter': -1.0}, r'rod_diameter = -1.0 m is below its lower bound 0.0001 m'),
        ({'elastic_modulus': 1e12}, r'elastic_modulus = 1000000000000.0 Pa is above its upper bound 10000000000.0 Pa'),
        ({'ring_inner_diameter': math.nan}, r'ring_inner_diameter = nan m is not finite'),
    ],
)
def test_a_ring_that_cannot_be_is_refused_with_field_value_and_bound(change, complaint):
    with pytest.raises(ValueError, match=f'^SealGeometry.{complaint}'):
        replace(RING, **change)
