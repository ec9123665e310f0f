"""Pressure -> normal force."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from seal_friction_ros.core.friction.laws.normal_force import (
    AreaDeformationGain,
    NormalForceTable,
)

AREA = 1e-4  # [m^2]
LINE = AreaDeformationGain(area_deformation_gain=0.4, radial_force=10.0)
TABLE = NormalForceTable((0.0, 1e6, 3e6), (20.0, 60.0, 150.0))
pressures = st.floats(0.0, 1e9)


def test_the_line_adds_a_share_of_the_axial_force_to_the_radial_force():
    assert LINE.normal_force(0.0, AREA) == 10.0
    assert LINE.normal_force(1e6, AREA) == pytest.approx(0.4 * 1e6 * AREA + 10.0)


def test_the_table_goes_through_its_points_whatever_the_area():
    assert [TABLE.normal_force(p, AREA) for p in TABLE.pressures] == pytest.approx(TABLE.normal_forces)
    assert TABLE.normal_force(5e5, AREA) == TABLE.normal_force(5e5, 2.0 * AREA)


def test_the_table_goes_on_straight_above_its_last_pressure():
    one, two = (TABLE.normal_force(3e6 + step, AREA) - 150.0 for step in (1e5, 2e5))
    assert one > 0.0
    assert two == pytest.approx(2.0 * one)
    just_below = 150.0 - TABLE.normal_force(3e6 - 1.0, AREA)
    assert one / 1e5 == pytest.approx(just_below, rel=1e-4)


@pytest.mark.parametrize('law', [LINE, TABLE])
@given(a=pressures, b=pressures)
def test_normal_force_never_falls_with_pressure(law, a, b):
    low, high = sorted((a, b))
    assert law.normal_force(low, AREA) <= law.normal_force(high, AREA) * (1.0 + 1e-12)


@pytest.mark.parametrize(
    ('pressures_', 'forces', 'complaint'),
    [
        ((0.0, 1.0), (2.0, 1.0), 'falls with pressure'),
        ((0.0, 1.0), (0.0, 1.0), '(is not above 0 N everywhere|lower bound)'),
        ((0.0, 1.0), (-1.0, 1.0), '(is not above 0 N everywhere|lower bound)'),
        ((1.0, 0.0), (1.0, 2.0), 'do not increase'),
        ((0.0,), (1.0,), 'at least two points'),
        ((0.0, 1.0), (1.0, 2.0, 3.0), 'as many ordinates'),
    ],
)
def test_an_invalid_table_is_refused(pressures_, forces, complaint):
    with pytest.raises(ValueError, match=f'^NormalForceTable.*{complaint}'):
        NormalForceTable(pressures_, forces)


def test_a_seal_that_does_not_press_is_refused():
    with pytest.raises(ValueError, match=r'radial_force = 0.0 N is below its lower bound 1e-06 N'):
        AreaDeformationGain(0.4, 0.0)
