"""Coulomb friction of a seal and of an actuator."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from seal_friction_ros.core.friction.actuator import (
    NO_SEALS,
    ActuatorFriction,
    MountedSeal,
    Seal,
    Uncertainty,
    actuator_friction,
    friction_of_seals,
    numbers_of_law,
    numbers_of_seals,
    sliding_friction,
    sliding_friction_of_seals,
)
from seal_friction_ros.core.friction.geometry import SealGeometry, contact_length, projected_area
from seal_friction_ros.core.friction.laws.constant_coulomb import ConstantCoulomb
from seal_friction_ros.core.friction.laws.friction_coefficient import CoefficientTable, PowerLaw
from seal_friction_ros.core.friction.laws.law import FrictionLaw
from seal_friction_ros.core.friction.laws.normal_force import AreaDeformationGain
from seal_friction_ros.core.friction.laws.physics_based import PhysicsBased
from seal_friction_ros.core.friction.laws.pressure_power_law import PressurePowerLaw
from seal_friction_ros.core.friction.laws.prior_art_chart import PriorArtChart
from seal_friction_ros.core.friction.mounting import CHAMBERS, pressures_at_seals

GEOMETRY = SealGeometry(section_diameter=2e-3, ring_inner_diameter=9.8e-3, rod_diameter=10e-3, gland_diameter=13.6e-3)
LAW = PhysicsBased(GEOMETRY, AreaDeformationGain(0.4, 10.0), PowerLaw(2.0, 0.5))


class Proportional(FrictionLaw):
    """Friction of 1 N per bar on top of 5 N."""

    function = staticmethod(lambda pressure, _: 5.0 + pressure / 1e5)


class Falling(FrictionLaw):
    function = staticmethod(lambda pressure, _: 50.0 - pressure / 1e5)


class NotFinite(FrictionLaw):
    function = staticmethod(lambda pressure, _: 1.0 if pressure < 1e6 else math.nan)


def seal(law=None, pressure_min=0.0, pressure_max=1e7) -> Seal:
    return Seal(
        name='test',
        coulomb_law=law or Proportional(),
        uncertainty=Uncertainty(relative_std=0.1),
        stiction=2.0,
        pressure_min=pressure_min,
        pressure_max=pressure_max,
    )


def on(chamber: str, **kwargs) -> MountedSeal:
    return MountedSeal(seal(**kwargs), chamber)


# --- what a seal sees ---

pressures = st.floats(0.0, 9e6)


@given(pressures, pressures)
def test_a_piston_seal_has_the_same_friction_whichever_chamber_has_the_higher_pressure(a, b):
    piston = (on('difference'),)
    assert actuator_friction(piston, a, b) == actuator_friction(piston, b, a)
    assert actuator_friction(piston, a, b) == actuator_friction((on('a'),), abs(a - b), 0.0)


@given(pressures, pressures)
def test_a_wiper_has_the_friction_of_no_pressure_at_any_pressure(a, b):
    assert actuator_friction((on('ambient'),), a, b) == actuator_friction((on('a'),), 0.0, 0.0)


@given(pressures, pressures)
def test_the_frictions_of_rod_seals_piston_seal_and_wiper_add_up(a, b):
    seals = [on(chamber) for chamber in CHAMBERS]
    together = actuator_friction(tuple(seals), a, b)
    each = [actuator_friction((seal,), a, b) for seal in seals]
    assert together.coulomb_friction == pytest.approx(sum(one.coulomb_friction for one in each))
    assert sliding_friction_of_seals(numbers_of_seals(tuple(seals)), a, b, 0.1, 1) == together.coulomb_friction


def test_a_piston_seal_is_outside_its_range_by_the_difference_and_not_by_the_pressures():
    piston = (on('difference', pressure_max=1e6),)
    assert actuator_friction(piston, 8e6, 7.5e6).in_identified_range
    assert not actuator_friction(piston, 8e6, 6e6).in_identified_range


def test_pressures_at_seals_are_those_that_each_seal_sees_also_where_the_other_chamber_is_not_measured():
    a, b = np.array([3e6, 1e6, 2e6]), np.array([1e6, 3e6, math.nan])
    seen = pressures_at_seals(CHAMBERS, a, b)
    np.testing.assert_array_equal(seen[:2], [[3e6, 1e6, 2e6, 0.0], [1e6, 3e6, 2e6, 0.0]])
    assert seen[2, [0, 3]].tolist() == [2e6, 0.0]


# --- one seal ---


def test_physics_based_friction_is_coefficient_times_normal_force():
    normal_force = 0.4 * 2e6 * projected_area(GEOMETRY) + 10.0
    assert LAW.coulomb_friction(2e6) == pytest.approx(2.0 * normal_force**-0.5 * normal_force)


def test_prior_art_adds_a_squeeze_part_per_length_and_a_pressure_part_per_area():
    chart = PriorArtChart(GEOMETRY, 100.0, (0.0, 1e6, 2e6), (1e5, 2e5, 4e5))
    expected = 100.0 * contact_length(GEOMETRY) + 2e5 * projected_area(GEOMETRY)
    assert chart.coulomb_friction(1e6) == pytest.approx(expected)
    assert chart.coulomb_friction(9e6) == chart.coulomb_friction(2e6)


@pytest.mark.parametrize(
    ('frictions', 'complaint'),
    [
        ((2e5, 1e5), 'falls with pressure'),
        ((-1.0, 1e5), '(is below 0 Pa|lower bound 0.0 Pa)'),
        ((1e5,), 'as many ordinates'),
    ],
)
def test_an_invalid_chart_is_refused(frictions, complaint):
    with pytest.raises(ValueError, match=f'^PriorArtChart.*{complaint}'):
        PriorArtChart(GEOMETRY, 100.0, (0.0, 1e6), frictions)


@given(st.floats(-1e9, 0.0))
def test_negative_gauge_pressure_counts_as_none(pressure):
    seals = (on('a', law=LAW),)
    assert actuator_friction(seals, pressure, 0.0).coulomb_friction == LAW.coulomb_friction(0.0)


@given(st.floats(0.0, 1e8), st.floats(0.0, 1e8))
def test_friction_never_falls_with_pressure(a, b):
    low, high = sorted((a, b))
    assert LAW.coulomb_friction(low) <= LAW.coulomb_friction(high) * (1.0 + 1e-12)


def test_a_hundred_thousandth_of_a_bar_is_a_pressure_and_vacuum_is_none():
    law = PressurePowerLaw(3.0, 0.4, 0.05)  # rises most steeply just above 0 Pa
    numbers = numbers_of_seals((on('a', law=law),))
    for pressure, expected in ((-2.0, 3.0), (0.0, 3.0), (0.5, 3.0 + 0.4 * 5e-6**0.05)):
        assert friction_of_seals(numbers, pressure, 0.0, 0.0).coulomb_friction == pytest.approx(expected, rel=1e-12)
        assert sliding_friction_of_seals(numbers, pressure, 0.0, 0.1, 1) == pytest.approx(expected, rel=1e-12)


def test_a_law_alone_has_no_stiction_no_spread_and_no_range_and_is_in_chamber_a():
    numbers = (numbers_of_law(Proportional()),)
    for pressure in (1e6, 1e12):
        assert friction_of_seals(numbers, pressure, 5e6, 0.2) == ActuatorFriction(5.0 + pressure / 1e5, 0, 0, True, 0)
    assert friction_of_seals(numbers, -1e12, 5e6, 0.2) == ActuatorFriction(5.0, 0.0, 0.0, True, 0.0)
    assert sliding_friction(numbers[0], 7.0, 1e6, 0.3, 1) == sliding_friction(numbers[0], 7.0, 1e6, 0.3, -1) == 7.0


def test_without_seals_there_is_no_friction():
    assert friction_of_seals(NO_SEALS, 1e6, 2e6, 0.1) == (0.0, 0.0, 0.0, True, 0.0, 0.0)
    assert sliding_friction_of_seals(NO_SEALS, 1e6, 2e6, 0.1, 1) == 0.0


def test_the_scale_of_a_seal_and_of_its_place_multiply():
    one = Seal(
        name='x', coulomb_law=ConstantCoulomb(7.0), uncertainty=Uncertainty(0.1), friction_scale=1.5, pressure_max=1e7
    )
    assert actuator_friction((MountedSeal(one, 'a', 2.0),), 1e6, 0.0).coulomb_friction == pytest.approx(3.0 * 7.0)


def test_a_mounted_seal_is_the_same_as_another_of_the_same_seal_and_shows_what_it_is_made_of():
    one = seal(law=ConstantCoulomb(7.0))
    assert MountedSeal(one, 'a') == MountedSeal(seal(law=ConstantCoulomb(7.0)), 'a')
    assert repr(MountedSeal(one, 'a')) == f"MountedSeal(seal={one!r}, chamber='a', friction_scale=1.0)"
    assert repr(one.coulomb_law) == 'ConstantCoulomb(coulomb_friction_at_any_pressure=7.0)'


class Dropping(FrictionLaw):
    """Friction that drops at 2.005 MPa."""

    function = staticmethod(lambda pressure, _: 5.0 if pressure < 2.005e6 else 1.0)


def test_friction_may_fall_beyond_twice_the_identified_range_and_the_first_fall_is_named():
    assert seal(law=Dropping(), pressure_max=1e6).coulomb_law.coulomb_friction(3e6) == 1.0
    with pytest.raises(ValueError, match=r'falls from 5 N to 1 N at 2.0075e\+06 Pa'):
        seal(law=Dropping(), pressure_max=1.00375e6)
    with pytest.raises(ValueError, match=r'falls from 50 N to 49 N at 100000 Pa'):
        seal(law=Falling(), pressure_max=1e7)


@pytest.mark.parametrize(
    ('name', 'lowest', 'highest', 'unit'),
    [
        ('stiction', 0.0, 1e6, 'N'),
        ('stiction_ratio', 0.0, 10.0, '1'),
        ('friction_scale', 0.01, 100.0, '1'),
        ('pressure_min', 0.0, None, 'Pa'),
        ('pressure_max', 1.0, 1e9, 'Pa'),
    ],
)
def test_a_seal_takes_what_is_at_a_bound_and_nothing_beyond(name, lowest, highest, unit):
    given_ = {'name': 'x', 'coulomb_law': ConstantCoulomb(7.0), 'uncertainty': Uncertainty(0.1), 'pressure_max': 1e7}
    assert getattr(Seal(**given_ | {name: lowest}), name) == lowest
    with pytest.raises(ValueError, match=rf'Seal.{name} = .* {unit} is below its lower bound {lowest} {unit}'):
        Seal(**given_ | {name: math.nextafter(lowest, -math.inf)})
    if highest is not None:
        assert getattr(Seal(**given_ | {name: highest}), name) == highest
        with pytest.raises(ValueError, match=rf'Seal.{name} = .* {unit} is above its upper bound {highest} {unit}'):
            Seal(**given_ | {name: math.nextafter(highest, math.inf)})


def test_a_seal_is_identified_from_no_pressure_on_unless_its_file_says_otherwise():
    given_ = {'name': 'x', 'coulomb_law': ConstantCoulomb(7.0), 'uncertainty': Uncertainty(0.1), 'pressure_max': 50.0}
    assert actuator_friction((MountedSeal(Seal(**given_), 'a'),), 0.0, 0.0).in_identified_range
    with pytest.raises(ValueError, match=r'pressure_min = 1000000000.1 Pa is above its upper bound 1000000000.0 Pa'):
        Seal(**given_ | {'pressure_min': 1e9 + 0.1})


@pytest.mark.parametrize('law', [Falling(), NotFinite()])
def test_a_seal_whose_friction_falls_with_pressure_or_is_not_finite_cannot_be_made(law):
    with pytest.raises(ValueError, match=r'^Seal test: Coulomb friction falls from .* N to .* N at .* Pa'):
        seal(law=law)


def test_a_fall_above_the_identified_range_is_found_too():
    dropping = CoefficientTable((10.0, 400.0, 500.0), (0.3, 0.3, 0.1))
    law = PhysicsBased(GEOMETRY, AreaDeformationGain(0.4, 10.0), dropping)
    top = (400.0 - 10.0) / 0.4 / projected_area(GEOMETRY)
    with pytest.raises(ValueError, match='Coulomb friction falls'):
        seal(law=law, pressure_max=top)


def test_an_identified_range_that_is_none_is_refused():
    with pytest.raises(ValueError, match=r'Seal.pressure_max = 1000.0 Pa is not above pressure_min = 1000.0 Pa'):
        seal(pressure_min=1000.0, pressure_max=1000.0)


# --- uncertainty ---


def test_uncertainty_adds_share_and_resolution_in_quadrature():
    assert Uncertainty(0.03, 4.0).std(100.0) == pytest.approx(5.0)


@given(st.floats(0.0, 10.0), st.floats(0.0, 100.0), st.floats(0.0, 1e6))
def test_std_is_at_least_each_of_its_parts(relative, absolute, friction):
    std = Uncertainty(relative, absolute).std(friction)
    assert max(relative * friction, absolute) <= std * (1.0 + 1e-12) + 1e-150
    assert std <= (relative * friction + absolute) * (1.0 + 1e-12)


def test_an_uncertainty_below_nothing_is_refused():
    with pytest.raises(ValueError, match=r'^Uncertainty.relative_std = -0.1 1 is below its lower bound 0.0 1'):
        Uncertainty(-0.1)


# --- actuator ---


def test_each_seal_sees_the_pressure_of_its_own_chamber():
    seals = (on('a'), on('b'))
    assert actuator_friction(seals, 1e6, 3e6).coulomb_friction == pytest.approx((5.0 + 10.0) + (5.0 + 30.0))
    assert actuator_friction((on('a'),), 1e6, 3e6).coulomb_friction == pytest.approx(15.0)
    assert actuator_friction((on('b'),), 1e6, 3e6).coulomb_friction == pytest.approx(35.0)


def test_swapping_chambers_and_pressures_changes_nothing():
    one, other = (on('a', law=LAW), on('b')), (on('b', law=LAW), on('a'))
    assert actuator_friction(one, 1e6, 3e6) == actuator_friction(other, 3e6, 1e6)


@pytest.mark.parametrize('count', [1, 2, 3, 8])
def test_friction_std_and_stiction_add_up_over_any_number_of_seals(count):
    one = actuator_friction((on('a'),), 2e6, 0.0)
    many = actuator_friction((on('a'),) * count, 2e6, 0.0)
    assert many.coulomb_friction == pytest.approx(count * one.coulomb_friction)
    assert many.coulomb_friction_std == pytest.approx(count * one.coulomb_friction_std)
    assert many.stiction == pytest.approx(count * one.stiction)


def test_a_chamber_below_ambient_pressure_gives_the_friction_at_none():
    below, none = (actuator_friction((on('a'), on('b')), p, 2e6).coulomb_friction for p in (-5e4, 0.0))
    assert below == none


@pytest.mark.parametrize(
    ('pressure', 'inside'),
    [(1e6, True), (9e6, True), (0.92e6, True), (9.08e6, True), (0.91e6, False), (9.09e6, False), (-1e5, False)],
)
def test_the_identified_range_ends_one_percent_of_itself_beyond_its_ends(pressure, inside):
    mounted = (on('a', pressure_min=1e6, pressure_max=9e6),)
    assert actuator_friction(mounted, pressure, 5e6).in_identified_range is inside


@pytest.mark.parametrize(('a', 'b', 'inside'), [(5e6, 5e6, True), (2e7, 5e6, False), (5e6, 2e7, False)])
def test_one_seal_outside_its_range_is_enough(a, b, inside):
    assert actuator_friction((on('a'), on('b')), a, b).in_identified_range is inside


def test_a_chamber_without_a_seal_does_not_limit_the_range():
    assert actuator_friction((on('a'),), 5e6, 9e9).in_identified_range


@pytest.mark.parametrize('chamber', ['A', 'c', '', 'ab'])
def test_a_seal_on_no_chamber_is_refused(chamber):
    with pytest.raises(ValueError, match=f'^chamber = {chamber!r} of seal test is not a, b, difference or ambient'):
        on(chamber)
