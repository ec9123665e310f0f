"""Friction maps, velocity terms, and the laws that need no geometry, against their formulas."""

import math
from contextlib import nullcontext

import pytest
from hypothesis import given
from hypothesis import strategies as st

from seal_friction_ros.core.foundation.parameters import meanings
from seal_friction_ros.core.friction.actuator import (
    MountedSeal,
    Seal,
    Uncertainty,
    actuator_friction,
    numbers_of_law,
    sliding_friction_of_seals,
)
from seal_friction_ros.core.friction.laws.constant_coulomb import ConstantCoulomb
from seal_friction_ros.core.friction.laws.friction_coefficient import CoefficientTable, PowerLaw
from seal_friction_ros.core.friction.laws.friction_map import FrictionMap
from seal_friction_ros.core.friction.laws.law import TypicalReading
from seal_friction_ros.core.friction.laws.pressure_power_law import PressurePowerLaw
from seal_friction_ros.core.friction.laws.velocity_terms import VelocityTerms

SPEEDS, PRESSURES = (1e-3, 1e-2, 1e-1), (1e6, 3e6, 5e6)  # [m/s], [Pa]
FRICTIONS = (9.0, 7.0, 6.0, 22.0, 18.0, 15.0, 30.0, 20.0, 40.0)  # [N]


def friction_map(**changes) -> FrictionMap:
    return FrictionMap(
        **({'speeds': SPEEDS, 'pressures': PRESSURES, 'frictions': FRICTIONS, 'reference_speed': 0.01} | changes)
    )


def seal_of(law, **changes) -> Seal:
    return Seal(name='made', coulomb_law=law, uncertainty=Uncertainty(relative_std=0.1), pressure_max=5e6, **changes)


# --- friction map ---


@pytest.mark.parametrize('row', range(3))
@pytest.mark.parametrize('column', range(3))
def test_a_map_has_its_points_and_is_constant_beyond_its_ends(row: int, column: int):
    law, point = friction_map(), FRICTIONS[3 * row + column]
    assert law.sliding_friction(PRESSURES[row], SPEEDS[column]) == pytest.approx(point)
    speed = {0: 1e-9, 1: SPEEDS[1], 2: 50.0}[column]
    pressure = {0: 0.0, 1: PRESSURES[1], 2: 1e9}[row]
    assert law.sliding_friction(pressure, speed) == pytest.approx(point)


@given(st.floats(0.0, 1.0), st.floats(0.0, 1.0), st.integers(0, 1), st.integers(0, 1))
def test_a_map_is_linear_in_pressure_and_in_the_logarithm_of_the_speed(along, across, column, row):
    pressure = PRESSURES[row] + across * 2e6
    speed = SPEEDS[column] * 10.0**along
    corner = 3 * row + column
    low = FRICTIONS[corner] + along * (FRICTIONS[corner + 1] - FRICTIONS[corner])
    high = FRICTIONS[corner + 3] + along * (FRICTIONS[corner + 4] - FRICTIONS[corner + 3])
    assert friction_map().sliding_friction(pressure, speed) == pytest.approx(low + across * (high - low))


@pytest.mark.parametrize(
    ('changes', 'complaint'),
    [
        ({'frictions': FRICTIONS[:-1]}, 'has 8 values for 3 speeds and 3 pressures'),
        ({'speeds': (1e-3,), 'frictions': (1.0, 2.0)}, 'has 2 values for 1 speeds and 3 pressures'),
        ({'speeds': (), 'frictions': ()}, 'has 0 values for 0 speeds and 3 pressures'),
        ({'pressures': (1e6,), 'frictions': (1.0, 2.0, 3.0)}, 'has 3 values for 3 speeds and 1 pressures'),
        ({'speeds': (1e-3, 1e-3, 1e-1)}, 'speeds = .* does not increase'),
        ({'pressures': (1e6, 3e6, 3e6)}, 'pressures = .* does not increase'),
        ({'speeds': (1e-3, 1.01e-2, 1e-1)}, 'speeds are not in equal ratios'),
    ],
)
def test_a_map_that_is_no_table_is_refused(changes, complaint):
    with pytest.raises(ValueError, match=f'^FrictionMap.*{complaint}'):
        friction_map(**changes)


def test_a_map_of_two_by_two_and_of_nearly_equal_ratios_is_taken():
    law = friction_map(speeds=(1e-3, 1.0002e-2, 1e-1))
    assert law.columns_per_log_speed == pytest.approx(1.0 / math.log(10.0))
    small = friction_map(speeds=(1e-3, 1e-1), pressures=(0.0, 5e6), frictions=(1.0, 2.0, 3.0, 4.0))
    assert small.sliding_friction(2.5e6, 1e-2) == pytest.approx(2.5)


@given(st.floats(0.0, 10.0), st.floats(0.0, 1.0))
def test_a_map_of_one_speed_holds_at_every_speed(speed, across):
    law = friction_map(speeds=(1e-2,), frictions=(7.0, 18.0, 40.0))
    assert not law.depends_on_speed
    assert law.sliding_friction(3e6 + across * 2e6, speed) == pytest.approx(18.0 + across * 22.0)
    assert [law.sliding_friction(p, speed) for p in (0.0, 9e6)] == [7.0, 40.0]
    assert law.coulomb_friction(3e6) == 18.0


def test_the_coulomb_friction_of_a_map_is_that_at_its_reference_speed():
    law = friction_map(reference_speed=0.1)
    assert (law.depends_on_speed, law.coulomb_speed, law.coulomb_friction(3e6)) == (True, 0.1, 15.0)
    constant = ConstantCoulomb(7.0)
    assert (constant.depends_on_speed, constant.coulomb_speed, constant.coulomb_friction(3e6)) == (False, 0.0, 7.0)


# --- velocity terms ---


@given(st.sampled_from([-0.05, -0.003, 0.003, 0.05]), st.floats(0.5, 2.0))
def test_viscous_stribeck_and_asymmetry_add_up_on_top_of_coulomb_friction(velocity, scale):
    terms = VelocityTerms(viscous_friction=120.0, stribeck_friction=4.0, stribeck_velocity=0.02, asymmetry=0.25)
    seals = (MountedSeal(seal_of(ConstantCoulomb(7.0), velocity_terms=terms), 'a', scale),)
    speed = abs(velocity)
    sliding = 7.0 + 120.0 * speed + 4.0 * math.exp(-speed / 0.02)
    sliding *= scale * (1.25 if velocity > 0.0 else 0.75)
    found = actuator_friction(seals, 1e6, 0.0, velocity)
    assert found.coulomb_friction + found.velocity_friction == pytest.approx(sliding)
    assert found.coulomb_friction == pytest.approx(7.0 * scale)
    assert found.coulomb_friction_std == pytest.approx(0.1 * sliding)
    direction = 1 if velocity > 0.0 else -1
    numbers = tuple(mounted.numbers for mounted in seals)
    assert sliding_friction_of_seals(numbers, 1e6, 0.0, speed, direction) == pytest.approx(sliding)


@pytest.mark.parametrize('velocity', [-0.03, 0.03])
def test_mixed_friction_follows_the_pressure_and_a_film_has_an_asymmetry_of_its_own(velocity):
    terms = VelocityTerms(
        viscous_friction=120.0, stribeck_velocity=0.02, asymmetry=0.25, stribeck_ratio=0.4, viscous_asymmetry=-0.2
    )
    law = PressurePowerLaw(2.0, 1.5, 1.0)
    seals = (MountedSeal(seal_of(law, velocity_terms=terms), 'a'),)
    side = math.copysign(1.0, velocity)
    for bar in (0.0, 10.0, 40.0):
        coulomb = 2.0 + 1.5 * bar
        sliding = coulomb * (1.0 + 0.4 * math.exp(-1.5)) + 120.0 * 0.03 * (1.0 - 0.2 * side)
        found = actuator_friction(seals, bar * 1e5, 0.0, velocity)
        assert found.coulomb_friction == pytest.approx(coulomb)
        assert found.coulomb_friction + found.velocity_friction == pytest.approx(sliding * (1.0 + 0.25 * side))


def test_at_rest_velocity_adds_nothing_and_slow_sliding_has_the_whole_stribeck_friction():
    terms = VelocityTerms(stribeck_friction=4.0, stribeck_velocity=0.02)
    seals = (MountedSeal(seal_of(ConstantCoulomb(7.0), velocity_terms=terms), 'a'),)
    assert actuator_friction(seals, 1e6, 0.0, 0.0).velocity_friction == 0.0
    assert sliding_friction_of_seals((seals[0].numbers,), 1e6, 0.0, 0.0, 1) == pytest.approx(11.0)


def test_a_map_slides_with_the_friction_of_its_speed_in_either_direction():
    seals = (MountedSeal(seal_of(friction_map()), 'a', 2.0),)
    for velocity in (0.1, -0.1):
        found = actuator_friction(seals, 3e6, 0.0, velocity)
        assert (found.coulomb_friction, found.velocity_friction) == (36.0, pytest.approx(-6.0))


def test_a_map_has_no_velocity_terms():
    with pytest.raises(ValueError, match='leave out velocity_terms'):
        seal_of(friction_map(), velocity_terms=VelocityTerms())
    assert seal_of(friction_map()).depends_on_velocity
    assert seal_of(ConstantCoulomb(7.0), velocity_terms=VelocityTerms()).depends_on_velocity
    assert not seal_of(ConstantCoulomb(7.0)).depends_on_velocity


# --- an actuator ---


def test_each_seal_sees_its_chamber_and_all_that_it_adds_is_scaled():
    law = PressurePowerLaw(3.0, 0.4, 1.0)
    seal = Seal(
        name='made',
        coulomb_law=law,
        uncertainty=Uncertainty(relative_std=0.1, absolute_std=0.5),
        stiction=2.0,
        stiction_ratio=0.5,
        pressure_max=5e6,
    )
    seals = (MountedSeal(seal, 'a', 2.0), MountedSeal(seal, 'b'))
    found = actuator_friction(seals, 1e6, 2e6)
    a, b = 2.0 * (3.0 + 0.4 * 10.0), 3.0 + 0.4 * 20.0
    assert found.coulomb_friction == pytest.approx(a + b)
    assert found.coulomb_friction_std == pytest.approx(math.hypot(0.1 * a, 0.5) + math.hypot(0.1 * b, 0.5))
    assert found.stiction == pytest.approx(2.0 * 2.0 + 2.0 + 0.5 * (a + b))
    numbers = tuple(mounted.numbers for mounted in seals)
    assert sliding_friction_of_seals(numbers, 1e6, -2e6, 0.01, 1) == pytest.approx(a + 3.0)


@pytest.mark.parametrize(('pressure', 'inside'), [(0.959e6, False), (0.961e6, True), (5.039e6, True), (5.041e6, False)])
def test_the_identified_range_has_a_margin_of_1_percent_of_it(pressure, inside):
    seal = Seal(
        name='made',
        coulomb_law=ConstantCoulomb(7.0),
        uncertainty=Uncertainty(relative_std=0.1),
        pressure_min=1e6,
        pressure_max=5e6,
    )
    assert actuator_friction((MountedSeal(seal, 'b'),), 0.0, pressure).in_identified_range is inside
    both = (MountedSeal(seal, 'a'), MountedSeal(seal, 'b'))
    assert actuator_friction(both, 3e6, pressure).in_identified_range is inside
    assert actuator_friction(both, pressure, 3e6).in_identified_range is inside


def test_a_law_alone_is_a_seal_without_anything_else():
    numbers = numbers_of_law(ConstantCoulomb(7.0))
    assert (numbers.scale, numbers.stiction, numbers.depends_on_velocity) == (1.0, 0.0, False)
    assert sliding_friction_of_seals((numbers,), 1e9, 0.0, 1.0, -1) == 7.0


# --- laws that need no geometry ---


def test_the_power_law_takes_the_pressure_in_bar():
    assert PressurePowerLaw(3.0, 0.4, 0.5).coulomb_friction(4e5) == pytest.approx(3.8)
    assert PressurePowerLaw(3.0, 0.4, 0.5).coulomb_friction(0.0) == 3.0


def test_a_coefficient_table_goes_through_its_points_and_is_constant_beyond():
    table = CoefficientTable((10.0, 20.0, 40.0), (0.9, 0.5, 0.4))
    for force, coefficient in ((0.0, 0.9), (10.0, 0.9), (20.0, 0.5), (40.0, 0.4), (100.0, 0.4)):
        assert table.bound(force, 0.0) == pytest.approx(coefficient)


def test_first_guesses_of_a_fit_reach_the_friction_of_the_readings():
    """A fit begins within a factor of two of what was measured."""
    typical = TypicalReading(friction=40.0, pressure=70e5, speed=0.1, normal_force=100.0)
    begin = {
        law: {name: meaning.start(typical) for name, meaning in meanings(law).items() if meaning.start is not None}
        for law in (ConstantCoulomb, PressurePowerLaw, PowerLaw, VelocityTerms)
    }
    assert ConstantCoulomb(**begin[ConstantCoulomb]).coulomb_friction(7e6) == 40.0
    power = PressurePowerLaw(**begin[PressurePowerLaw])
    assert power.coulomb_friction(0.0) == pytest.approx(20.0)
    assert power.coulomb_friction(70e5) == pytest.approx(1.2 * 40.0)
    assert PowerLaw(**begin[PowerLaw]).bound(100.0, 0.0) * 100.0 == pytest.approx(40.0)
    terms = begin[VelocityTerms]
    assert terms['viscous_friction'] * typical.speed == pytest.approx(0.2 * 40.0)
    assert terms['stribeck_friction'] == pytest.approx(0.2 * 40.0)
    assert terms['stribeck_velocity'] == pytest.approx(0.01)
    assert terms['asymmetry'] == 0.0


def test_a_pressure_guess_rises_as_an_elastic_contact_does():
    """A sphere on a plane has four times the area of contact at eight times the force: Hertz, Schallamach."""
    typical = TypicalReading(friction=40.0, pressure=80e5, speed=0.1, normal_force=100.0)
    law = PressurePowerLaw(**{name: meaning.start(typical) for name, meaning in meanings(PressurePowerLaw).items()})
    high, low = (law.coulomb_friction(pressure) - law.coulomb_friction(0.0) for pressure in (80e5, 10e5))
    assert high == pytest.approx(4.0 * low)


def test_first_guesses_are_finite_without_speed_and_pressure_and_inside_the_bounds_of_the_fit_on_a_fast_machine():
    slow, fast = (TypicalReading(40.0, pressure, speed, 100.0) for pressure, speed in ((0.0, 0.0), (1e9, 15.0)))
    for law in (ConstantCoulomb, PressurePowerLaw, PowerLaw, VelocityTerms):
        for meaning in meanings(law).values():
            if meaning.start is not None:
                low, high = meaning.fit_bounds or (meaning.lower, meaning.upper)
                assert 0.0 <= meaning.start(slow) < math.inf
                assert low <= meaning.start(fast) <= high


def test_half_a_newton_of_stribeck_friction_counts():
    terms = VelocityTerms(stribeck_friction=0.5, stribeck_velocity=0.02)
    seals = (MountedSeal(seal_of(ConstantCoulomb(7.0), velocity_terms=terms), 'a'),)
    assert actuator_friction(seals, 1e6, 0.0, 0.02).velocity_friction == pytest.approx(0.5 / math.e)


@pytest.mark.parametrize(('middle', 'taken'), [(1.00152e-2, True), (1.00155e-2, False)])
def test_speeds_of_a_map_are_in_equal_ratios_to_a_thousandth_of_a_column(middle, taken):
    """Of three speeds over two decades: ln(100) / 3 / 1000 = 0.001535."""
    with nullcontext() if taken else pytest.raises(ValueError, match='not in equal ratios'):
        friction_map(speeds=(1e-3, middle, 1e-1))


def test_a_seal_without_friction_is_a_seal():
    assert actuator_friction((MountedSeal(seal_of(ConstantCoulomb(0.0)), 'a'),), 1e6, 0.0, 0.1).coulomb_friction == 0.0
