"""Friction over temperature: one scale on every force, bounded, and as unsure as its coefficient."""

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from paths import ROOT

from seal_friction_ros.core.friction.actuator import (
    ActuatorFriction,
    MountedSeal,
    actuator_friction,
    at_temperature,
    at_unknown_temperature,
)
from seal_friction_ros.core.friction.seal_file import parse_seal
from seal_friction_ros.core.friction.temperature import (
    TemperatureScale,
    is_identified_at,
    one_temperature_scale,
    scale_at,
    std_of_unknown,
)
from seal_friction_ros.files import read_yaml

LAW = TemperatureScale(reference=300.0, coefficient=0.01, coefficient_std=0.001, lowest=290.0, highest=330.0)
PART = {'reference': 300.0, 'coefficient': 0.01, 'coefficient_std': 0.001, 'lowest': 290.0, 'highest': 330.0}
FRICTION = ActuatorFriction(40.0, 4.0, 10.0, True, 5.0)
DOCUMENT = read_yaml(ROOT / 'config' / 'seals' / 'ms28775_114.yaml')


def test_every_force_has_the_scale():
    warm, scale = at_temperature(FRICTION, LAW, 320.0), math.exp(-0.2)
    assert (warm.coulomb_friction, warm.stiction, warm.velocity_friction) == pytest.approx(
        (40.0 * scale, 10.0 * scale, 5.0 * scale)
    )
    assert warm.coulomb_friction_std == pytest.approx(scale * math.hypot(4.0, 45.0 * 0.001 * 20.0))


def test_at_the_reference_nothing_changes():
    assert at_temperature(FRICTION, LAW, 300.0) == FRICTION


@given(st.floats(1.0, 1000.0), st.floats(1.0, 1000.0))
def test_warmer_never_means_more_friction_and_the_ends_bound_it(one, other):
    low, high = sorted((one, other))
    assert scale_at(LAW, low) >= scale_at(LAW, high)
    assert math.exp(-0.3) <= scale_at(LAW, one) * (1.0 + 1e-12)
    assert scale_at(LAW, one) <= math.exp(0.1) * (1.0 + 1e-12)


@given(st.floats(1.0, 1000.0))
def test_the_relative_deviation_grows_with_the_distance_from_the_reference(temperature):
    found = at_temperature(FRICTION, LAW, temperature)
    assert found.coulomb_friction_std / found.coulomb_friction >= 0.1 * (1.0 - 1e-9)


@pytest.mark.parametrize(('temperature', 'is_known'), [(288.9, False), (289.0, True), (331.0, True), (331.1, False)])
def test_one_kelvin_outside_counts_as_identified_still(temperature, is_known):
    assert is_identified_at(LAW, temperature) == is_known


def test_a_seal_file_holds_it_and_without_it_the_numbers_are_the_same_to_the_bit():
    seal, plain = parse_seal(DOCUMENT | {'temperature': PART}), parse_seal(DOCUMENT)
    assert seal.temperature == LAW
    assert plain.temperature is None
    mounted = actuator_friction((MountedSeal(seal, 'a'),), 3e6, 0.0)
    expected = actuator_friction((MountedSeal(plain, 'a'),), 3e6, 0.0)
    assert mounted.coulomb_friction == expected.coulomb_friction
    unsure = expected.coulomb_friction * 0.01 * 40.0 / math.sqrt(12.0)  # the estimator has no temperature
    assert mounted.coulomb_friction_std == pytest.approx(math.hypot(expected.coulomb_friction_std, unsure))


def test_the_spread_of_an_unknown_temperature_is_a_share_of_all_sliding_friction():
    warm = at_unknown_temperature(FRICTION, LAW)
    assert warm == FRICTION._replace(coulomb_friction_std=warm.coulomb_friction_std)
    assert warm.coulomb_friction_std == pytest.approx(math.hypot(4.0, 45.0 * 0.01 * 40.0 / math.sqrt(12.0)))


@pytest.mark.parametrize(
    ('part', 'words'),
    [
        ({'reference': 25.0}, 'TemperatureScale.reference = 25.0 K is below its lower bound'),
        ({'reference': 340.0}, 'is not between lowest = 290.0 K and highest = 330.0 K'),
        ({'coefficient': math.nan}, 'is not finite'),
        ({'slope': 1.0}, 'has no slope'),
    ],
)
def test_a_wrong_part_is_refused(part, words):
    with pytest.raises(ValueError, match=words):
        parse_seal(DOCUMENT | {'temperature': PART | part})


def test_seals_of_an_actuator_have_one_scale():
    assert one_temperature_scale([LAW, LAW]) == LAW
    assert one_temperature_scale([None, None]) is None
    with pytest.raises(ValueError, match='different temperature parts'):
        one_temperature_scale([LAW, None])


def test_a_temperature_that_is_not_known_may_be_any_of_the_identified_ones():
    assert std_of_unknown(LAW) == pytest.approx(0.01 * 40.0 / math.sqrt(12.0))  # of a uniform distribution
    assert std_of_unknown(replace(LAW, coefficient=-0.01)) == std_of_unknown(LAW)
