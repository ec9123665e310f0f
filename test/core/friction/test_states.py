"""Sliding, breakaway, stuck: the thesis's equation, its Figures 22 and 23, and the hysteresis of rest."""

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st
from paths import ROOT

from seal_friction_ros.core.foundation.units import INCH, LBF, PSI
from seal_friction_ros.core.friction.actuator import MountedSeal, actuator_friction
from seal_friction_ros.core.friction.seal_file import parse_seal
from seal_friction_ros.core.friction.states import FrictionState, is_at_rest, sign, state_friction
from seal_friction_ros.files import read_yaml

SEAL = parse_seal(read_yaml(ROOT / 'config' / 'seals' / 'ms28775_114.yaml'))
AT_500_PSI = actuator_friction((MountedSeal(SEAL, 'a'), MountedSeal(SEAL, 'b')), 500.0 * PSI, 500.0 * PSI)

# Rest, thresholds and the smallest numbers are drawn on purpose: there the equation changes.
velocities = st.sampled_from([0.0, -0.0, 5e-324, -5e-324, 1e-3, -1e-3]) | st.floats(-10.0, 10.0)
force_sums = st.sampled_from([0.0, -0.0, 20.0, -20.0, 5e-324]) | st.floats(-1e3, 1e3)
coulomb_frictions = st.sampled_from([0.0, 20.0]) | st.floats(0.0, 1e3)


def thesis(velocity: float, force_sum: float, coulomb_friction: float) -> float:
    """F_f of chapter 7, letter by letter."""

    def sgn(x: float) -> float:
        if x > 0.0:
            return 1.0
        if x < 0.0:
            return -1.0
        return 0.0

    if abs(velocity) > 0.0:
        return coulomb_friction * sgn(velocity)
    if abs(velocity) == 0.0 and abs(force_sum) >= coulomb_friction:
        return coulomb_friction * sgn(force_sum)
    assert velocity == 0.0
    assert abs(force_sum) < coulomb_friction
    return force_sum


def with_zero_band(velocity: float, force_sum: float, coulomb_friction: float, was_at_rest: bool = False):
    at_rest = is_at_rest(velocity, was_at_rest, 0.0, 0.0)
    return state_friction(velocity, force_sum, at_rest, coulomb_friction, coulomb_friction)


@given(velocities, force_sums, coulomb_frictions, st.booleans())
def test_a_zero_band_without_stiction_is_the_equation_of_the_thesis_exactly(velocity, force_sum, friction, was):
    assert with_zero_band(velocity, force_sum, friction, was).friction_force == thesis(velocity, force_sum, friction)


@given(st.floats(-1e3, 1e3), st.booleans())
def test_at_the_threshold_itself_the_rod_breaks_away(force_sum, was):
    result = with_zero_band(0.0, force_sum, abs(force_sum), was)
    assert result.state == FrictionState.BREAKAWAY
    assert result.friction_force == force_sum


@pytest.mark.parametrize(
    ('velocity', 'force_sum', 'state', 'direction', 'friction'),
    [
        (0.01, -500.0, FrictionState.SLIDING, 1, 20.0),
        (-0.01, 500.0, FrictionState.SLIDING, -1, -20.0),
        (0.0, 25.0, FrictionState.BREAKAWAY, 1, 23.0),
        (0.0, -25.0, FrictionState.BREAKAWAY, -1, -23.0),
        (0.0, 22.0, FrictionState.STUCK, 1, 22.0),
        (0.0, -22.0, FrictionState.STUCK, -1, -22.0),
        (0.0, 0.0, FrictionState.STUCK, 0, 0.0),
    ],
)
def test_the_six_states_and_their_directions_with_stiction(velocity, force_sum, state, direction, friction):
    result = state_friction(velocity, force_sum, velocity == 0.0, 20.0, 23.0)
    assert result == (state, direction, friction)


def test_a_rod_without_velocity_that_does_not_rest_has_no_friction_and_neither_has_one_without_a_seal():
    assert state_friction(0.0, 7.0, False, 20.0, 23.0) == (FrictionState.SLIDING, 0, 0.0)
    assert state_friction(0.0, 0.0, True, 0.0, 0.0) == (FrictionState.BREAKAWAY, 0, 0.0)


def test_states_have_the_numbers_of_the_message():
    text = (ROOT / 'msg_defs' / 'msg' / 'FrictionEstimate.msg').read_text()
    for state in FrictionState:
        assert re.search(rf'^uint8 {state.name} = {int(state)}\b', text, re.MULTILINE)


# --- figures ---


def test_figure_22_friction_at_500_psi_is_a_step_with_the_sign_of_the_velocity():
    friction = AT_500_PSI.coulomb_friction
    assert friction == pytest.approx(9.5 * LBF, rel=0.04)
    for tenths in range(-50, 51):
        velocity = tenths / 10.0 * INCH
        result = with_zero_band(velocity, 0.0, friction)
        assert result.friction_force == friction * ((tenths > 0) - (tenths < 0))
        assert result.direction == (tenths > 0) - (tenths < 0)


def test_figure_23_friction_at_rest_follows_the_force_sum_between_both_thresholds_and_is_level_beyond():
    friction = AT_500_PSI.coulomb_friction
    seen = []
    for percent in range(-200, 201):
        force_sum = percent / 100.0 * friction
        result = with_zero_band(0.0, force_sum, friction, was_at_rest=True)
        assert result.friction_force == max(-friction, min(force_sum, friction))
        if not seen or seen[-1] != (result.state, result.direction):
            seen.append((result.state, result.direction))
    assert seen == [
        (FrictionState.BREAKAWAY, -1),
        (FrictionState.STUCK, -1),
        (FrictionState.STUCK, 0),
        (FrictionState.STUCK, 1),
        (FrictionState.BREAKAWAY, 1),
    ]


def test_figure_23_with_stiction_has_its_thresholds_where_the_tests_broke_away():
    breakaway = AT_500_PSI.coulomb_friction + AT_500_PSI.stiction
    assert breakaway == pytest.approx(10.33 * LBF, rel=0.04)  # mean of the six static readings at 500 psi
    friction = AT_500_PSI.coulomb_friction
    held = state_friction(0.0, 0.999 * breakaway, True, friction, breakaway)
    gone = state_friction(0.0, 1.001 * breakaway, True, friction, breakaway)
    assert (held.state, gone.state) == (FrictionState.STUCK, FrictionState.BREAKAWAY)
    assert gone.friction_force == breakaway


# --- rest ---


@given(st.floats(allow_nan=False), st.booleans())
def test_without_a_band_only_zero_is_rest(velocity, was):
    assert is_at_rest(velocity, was, 0.0, 0.0) == (velocity == 0.0)


def follow(speeds: list[float], at_rest: bool = False) -> list[bool]:
    """Rest after each speed [mm/s], with a band of 1 and 2 mm/s."""
    answers = []
    for speed in speeds:
        at_rest = is_at_rest(speed * 1e-3, at_rest, 1e-3, 2e-3)
        answers.append(at_rest)
    return answers


def test_a_sliding_rod_comes_to_rest_below_the_lower_speed_only():
    assert follow([5.0, 1.5, 1.01, 1.0]) == [False, False, False, True]


def test_a_rod_at_rest_leaves_it_above_the_upper_speed_only():
    assert follow([0.5, 1.5, 2.0, 2.01], at_rest=True) == [True, True, True, False]


def test_noise_between_the_two_speeds_does_not_flicker():
    noise = [1.1, 1.9, -1.2, 1.7, -1.9, 1.3]
    assert follow([0.0, *noise]) == [True] * 7
    assert follow([3.0, *noise]) == [False] * 7


@given(st.floats(-10.0, 10.0), st.booleans(), st.floats(0.0, 1.0), st.floats(0.0, 1.0))
def test_rest_does_not_know_left_from_right(velocity, was, a, b):
    stick, slip = sorted((a, b))
    assert is_at_rest(velocity, was, stick, slip) == is_at_rest(-velocity, was, stick, slip)


@given(st.floats(-10.0, 10.0), st.floats(0.0, 1.0), st.floats(0.0, 1.0))
def test_a_rod_at_rest_stays_at_rest_at_any_speed_at_which_a_sliding_rod_would_rest(velocity, a, b):
    stick, slip = sorted((a, b))
    assert is_at_rest(velocity, True, stick, slip) >= is_at_rest(velocity, False, stick, slip)


@pytest.mark.parametrize(('x', 'expected'), [(3.0, 1), (-3.0, -1), (0.0, 0), (-0.0, 0), (5e-324, 1), (-5e-324, -1)])
def test_sign_is_minus_one_zero_or_one(x, expected):
    assert sign(x) == expected
