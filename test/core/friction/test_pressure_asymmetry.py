"""Friction towards the pressure that a seal holds back, and away from it."""

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from seal_friction_ros.core.estimation.estimator import EstimatorParameters, EstimatorSettings, init, step
from seal_friction_ros.core.estimation.records import RodSample
from seal_friction_ros.core.friction.actuator import (
    actuator_friction,
    breakaway_in,
    numbers_of_seals,
    sliding_friction_of_seals,
)
from seal_friction_ros.core.friction.seal_file import mount_seals
from seal_friction_ros.core.friction.states import BREAKAWAY, STUCK
from seal_friction_ros.core.messages.records import Force, Pressure

DOCUMENT = {
    'name': 'uneven',
    'coulomb_law': 'constant_coulomb',
    'constant_coulomb': {'coulomb_friction_at_any_pressure': 10.0},
    'pressure_asymmetry': {'asymmetry': -0.4, 'full_pressure': 4e6},
    'stiction': 2.0,
    'uncertainty': {'relative_std': 0.1},
    'identified_pressure': [0.0, 5e6],
}
EVEN = {key: value for key, value in DOCUMENT.items() if key != 'pressure_asymmetry'}
TOWARDS, AWAY = 6.0, 14.0  # [N] at the full pressure


def seals(*chambers: str, document=DOCUMENT):
    return mount_seals((document,) * len(chambers), chambers)


def sliding(mounted, pressure_a: float, pressure_b: float, velocity: float) -> float:
    friction = actuator_friction(mounted, pressure_a, pressure_b, velocity)
    total = friction.coulomb_friction + friction.velocity_friction
    numbers, direction = numbers_of_seals(mounted), 1 if velocity > 0.0 else -1
    assert sliding_friction_of_seals(numbers, pressure_a, pressure_b, abs(velocity), direction) == pytest.approx(total)
    return total


@pytest.mark.parametrize(
    ('chamber', 'pressure_a', 'pressure_b', 'extending', 'retracting'),
    [
        ('a', 5e6, 0.0, AWAY, TOWARDS),  # the pressure of a drives the rod out: out is away from it
        ('b', 0.0, 5e6, TOWARDS, AWAY),  # the rod comes out of chamber b: its seal moves towards the pressure
        ('difference', 5e6, 0.0, AWAY, TOWARDS),
        ('difference', 0.0, 5e6, TOWARDS, AWAY),
        ('difference', 5e6, 5e6, 10.0, 10.0),
        ('a', 1e6, 0.0, 11.0, 9.0),  # a quarter of the full pressure
        ('a', 0.0, 5e6, 10.0, 10.0),
        ('ambient', 5e6, 5e6, 10.0, 10.0),
    ],
)
def test_a_seal_rubs_by_its_direction_relative_to_its_pressure(chamber, pressure_a, pressure_b, extending, retracting):
    mounted = seals(chamber)
    assert sliding(mounted, pressure_a, pressure_b, 0.02) == pytest.approx(extending)
    assert sliding(mounted, pressure_a, pressure_b, -0.02) == pytest.approx(retracting)
    assert actuator_friction(mounted, pressure_a, pressure_b).coulomb_friction == 10.0


@given(st.floats(0.0, 6e6), st.sampled_from([-0.1, -1e-3, 1e-3, 0.1]))
def test_a_balanced_cylinder_has_the_mean_of_both_directions(pressure, velocity):
    uneven, even = (seals('a', 'b', document=document) for document in (DOCUMENT, EVEN))
    assert sliding(uneven, pressure, pressure, velocity) == pytest.approx(20.0)
    assert actuator_friction(uneven, pressure, pressure).breakaway_asymmetry == pytest.approx(0.0)
    assert actuator_friction(even, pressure, pressure, velocity).velocity_friction == 0.0


@given(st.floats(-6e6, 6e6))
def test_friction_of_a_piston_seal_has_no_jump_where_the_pressure_difference_changes_its_sign(difference):
    mounted = seals('difference')
    near = [sliding(mounted, 7e6 + difference + more, 7e6, 0.02) for more in (0.0, 1.0)]
    assert abs(near[1] - near[0]) < 1e-5


@pytest.mark.parametrize(('force', 'held'), [(15.0, True), (17.0, False), (-7.0, True), (-7.3, False)])
def test_a_rod_breaks_away_by_its_direction_too(force, held):
    """12 N in the mean: 16.8 N away from the pressure, on extension, and 7.2 N towards it."""
    mounted = seals('a')
    friction = actuator_friction(mounted, 5e6, 0.0)
    assert [breakaway_in(friction, d, with_stiction=True) for d in (1, 0, -1)] == pytest.approx([16.8, 12.0, 7.2])
    parameters = EstimatorParameters(EstimatorSettings(), mounted)
    _, estimate = step(parameters, init(parameters), RodSample(1, 0.0, Pressure(1, 5e6, 0.0), Force(1, force)))
    assert estimate.state == (STUCK if held else BREAKAWAY)
    assert estimate.breakaway_force == pytest.approx(16.8 if force > 0.0 else 7.2)
    assert abs(estimate.friction_force) == pytest.approx(min(abs(force), estimate.breakaway_force))


def test_without_stiction_breakaway_has_the_same_share():
    parameters = EstimatorParameters(replace(EstimatorSettings(), use_stiction=False), seals('a'))
    _, estimate = step(parameters, init(parameters), RodSample(1, 0.0, Pressure(1, 5e6, 0.0), Force(1, 3.0)))
    assert estimate.breakaway_force == pytest.approx(AWAY)


@pytest.mark.parametrize(
    ('part', 'words'),
    [
        ({'asymmetry': 1.0, 'full_pressure': 1e6}, 'asymmetry = 1.0 1 is above its upper bound 0.9'),
        ({'asymmetry': 0.1}, 'lacks full_pressure'),
        ({'asymmetry': 0.1, 'full_pressure': 0.0}, 'full_pressure = 0.0 Pa is below its lower bound 1.0 Pa'),
    ],
)
def test_a_share_that_cannot_be_is_one_line(part, words):
    with pytest.raises(ValueError, match=f'^seal uneven: pressure_asymmetry.*{words}'):
        mount_seals((DOCUMENT | {'pressure_asymmetry': part},), ('a',))
