"""The conditioned velocity: a clean signal passes, a ripple makes no motion, and a motion is not lost in it."""

import math
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from seal_friction_ros.core.estimation.conditioned_velocity import (
    NOT_CONDITIONED,
    ConditionedVelocity,
    condition_velocity,
    confirmed_velocity,
)
from seal_friction_ros.core.messages.records import NEVER

# Numbers of the module docstring and of docs, repeated here so that a change is noticed.
LONGEST_STEP = 0.02  # [s]
LONGEST_SMOOTHING = 0.02  # [s]
LONGEST_WAIT = 0.2  # [s]
MEMORY = 60.0  # [s]
SLOW_RIPPLE = 4.0  # [-]
SETTLING = 100  # samples, or [ms]
SHORT_WAY = 8.0  # [-]
WIDEST = 4.0  # [-]
MS = 1_000_000  # [ns]
COUNT = 1e-6  # [m] of the encoder
RATE = 1000.0  # [Hz]
ONE = COUNT * RATE  # [m/s] one count in one sample


def run(velocities, state=NOT_CONDITIONED, resolution=0.0, step=MS) -> list[ConditionedVelocity]:
    """States after each velocity, one every ``step`` [ns] after the stamp of ``state``, or from 0."""
    start = 0 if state is NOT_CONDITIONED else state.stamp + step
    states = []
    for number, velocity in enumerate(velocities):
        state = condition_velocity(state, start + number * step, velocity, resolution)
        states.append(state)
    return states


def encoder(speed, samples, count=COUNT):
    """Differences of the rounded position of a rod of steady speed [m/s]."""
    places = [math.floor(speed * i / RATE / count) * count for i in range(samples + 1)]
    return [(b - a) * RATE for a, b in pairwise(places)]


RIPPLE = [0.0, ONE, 0.0, -ONE] * 2
KNOWN = run(RIPPLE)[-1]._replace(velocity=0.0, last_velocity=0.0, last_change=0.0, slack=0.0, way=0.0)
"""A rod at rest whose ripple of one count is learnt."""


# --- clean signals ---


def test_before_the_first_sample_nothing_is_known_and_a_clean_one_leaves_itself_and_its_change():
    assert NOT_CONDITIONED == (NEVER, 0.0, 0.0, 0.0, 0.0, False, 0.0, 0.0, 0.0, 0.0, NEVER, 0.0, 0)
    first, second = run([0.125, 0.25])
    assert first == (0, 0.125, 0.0, 0.0, 0.0, False, 0.125, 0.0, 0.0, 0.0, 0, 0.0, 1)
    assert second == (MS, 0.25, 0.0, 0.0, 0.0, False, 0.25, 0.125, 0.0, 0.0, MS, 0.0, 2)


@given(st.lists(st.floats(-1.0, 1.0), min_size=1, max_size=20).map(sorted))
def test_a_velocity_that_never_turns_back_comes_out_as_it_went_in(velocities):
    for given_, state in zip(velocities, run(velocities), strict=True):
        assert (state.velocity, state.half_width, state.ripple) == (given_, 0.0, 0.0)
        assert not state.is_waiting


def test_a_peak_of_a_motion_that_is_fast_for_it_is_no_ripple():
    size = 1e-3  # [m/s] of the peak
    for base, learnt in ((1.01 * SLOW_RIPPLE * size, False), (0.9 * (SLOW_RIPPLE - 1.0) * size, True)):
        states = run([base, base + size, base] * 3)
        assert bool(states[-1].half_width) is learnt


# --- learning ---


@pytest.mark.parametrize(('peak', 'is_ripple'), [(SLOW_RIPPLE + 0.5, False), (SLOW_RIPPLE - 0.5, True)])
def test_a_turn_is_compared_with_the_faster_of_its_two_samples(peak, is_ripple):
    state = run([0.0, peak * ONE, (peak - 1.0) * ONE])[-1]
    assert (state.last_ripple > 0.0) is is_ripple


def test_a_ripple_counts_once_it_came_twice_and_the_smaller_one_counts():
    states = run([0.0, 2 * ONE, 0.0, ONE, ONE])
    assert [s.half_width for s in states[:3]] == [0.0] * 3
    assert states[3].half_width == pytest.approx(COUNT, rel=1e-4)


def test_the_half_width_is_the_ripple_times_the_sample_period():
    for step in (MS // 5, MS, 5 * MS):
        state = run(RIPPLE, step=step)[-1]
        assert state.half_width == pytest.approx(ONE * step * 1e-9, rel=1e-3)
        assert state.ripple == pytest.approx(ONE, rel=1e-3)


def test_a_resolution_that_is_given_needs_no_learning():
    state = run([0.0, 0.0], resolution=ONE)[-1]
    assert (state.half_width, state.ripple) == (pytest.approx(COUNT), pytest.approx(ONE))


def test_the_play_begins_in_its_middle():
    before = run([0.0, 0.0])[-1]
    after = run([0.4 * ONE], before, resolution=ONE)[-1]
    assert (after.velocity, after.slack, after.way) == (0.0, pytest.approx(0.4 * COUNT), 0.0)
    assert after.last_push == before.stamp


def test_the_way_since_the_last_reversal_lasts_while_nothing_pushes():
    (state,) = run([0.0], KNOWN._replace(way=5.0 * COUNT))
    assert state.way == 5.0 * COUNT


def test_a_ripple_is_forgotten_with_its_time_constant():
    samples = round(MEMORY / LONGEST_STEP)
    state = run([0.0] * samples, KNOWN, step=20 * MS)[-1]
    assert state.half_width == pytest.approx(KNOWN.half_width / math.e, rel=1e-3)
    assert state.last_ripple == pytest.approx(KNOWN.last_ripple / math.e, rel=1e-3)


@pytest.mark.parametrize('side', [1.0, -1.0])
@pytest.mark.parametrize(('ways', 'factor'), [(0.9, 1.5), (1.1, 1.0)])
def test_a_reversal_after_a_short_way_widens_the_play(ways, factor, side):
    state = KNOWN._replace(way=side * ways * SHORT_WAY * KNOWN.half_width, velocity=side * 1e-4)
    after = run([-side * 10.0 * ONE], state)[-1]
    assert after.half_width == pytest.approx(factor * KNOWN.half_width, rel=1e-3)
    same_way = run([side * 10.0 * ONE], state)[-1]
    assert same_way.half_width == pytest.approx(KNOWN.half_width, rel=1e-3)


# --- at rest ---


@given(st.lists(st.sampled_from([-1, 0, 1]), min_size=1, max_size=60))
def test_a_position_that_jumps_between_neighbouring_counts_does_not_move(places):
    velocities = [(b - a) * ONE for a, b in pairwise([0, *places])]
    state = NOT_CONDITIONED._replace(stamp=0, half_width=1.01 * COUNT, last_push=-MS)
    assert {s.velocity for s in run(velocities, state)} == {0.0}


def test_a_push_of_more_than_the_play_counts():
    state = KNOWN._replace(slack=0.0, last_push=KNOWN.stamp)
    after = run([3.0 * ONE], state)[-1]
    assert after.slack == pytest.approx(KNOWN.half_width, rel=1e-3)
    assert after.way == pytest.approx(2.0 * COUNT, rel=1e-3)
    assert after.last_push == after.stamp
    assert not after.is_waiting
    still = run([0.9 * ONE], state)[-1]
    assert (still.way, still.last_push, still.velocity) == (state.way, state.last_push, 0.0)
    assert still.slack == pytest.approx(0.9 * COUNT)


# --- in motion ---


@pytest.mark.parametrize('speed', [3e-4, 2e-3, 0.05, -2e-3])
def test_a_steady_rod_keeps_its_direction_and_its_speed_is_found(speed):
    states = run(encoder(speed, 3000), KNOWN)[1000:]
    assert all(s.velocity * speed > 0.0 for s in states)
    assert sum(s.velocity for s in states) / len(states) == pytest.approx(speed, rel=0.06)


def test_the_speed_of_a_push_is_its_way_over_the_time_since_the_last_one_smoothed():
    state = KNOWN._replace(slack=KNOWN.half_width, last_push=KNOWN.stamp - 3 * MS, way=100 * COUNT, velocity=1e-4)
    after = run([ONE], state)[-1]
    speed, pause, smoothing = COUNT / 4e-3, 4e-3, LONGEST_SMOOTHING
    assert after.smoothing == smoothing
    assert after.velocity == pytest.approx(1e-4 + (speed - 1e-4) * pause / (pause + smoothing), rel=1e-3)


def test_a_long_way_counts_over_its_own_sample_and_a_fast_rod_is_smoothed_less():
    state = KNOWN._replace(slack=KNOWN.half_width, last_push=KNOWN.stamp - 3 * MS, way=100 * COUNT, velocity=0.01)
    after = run([0.02], state)[-1]
    smoothing = 10.0 * COUNT / 0.01
    assert after.smoothing == pytest.approx(smoothing, rel=1e-3)
    assert after.velocity == pytest.approx(0.01 + 0.01 * 1e-3 / (1e-3 + smoothing), rel=1e-3)


def test_a_reversal_begins_at_the_speed_of_its_own_push():
    state = KNOWN._replace(slack=-KNOWN.half_width, last_push=KNOWN.stamp, way=100 * COUNT, velocity=0.01)
    after = run([-0.02], state)[-1]
    pause, smoothing = 1e-3, 10.0 * COUNT / 0.01
    assert after.velocity == pytest.approx(-0.02 * pause / (pause + smoothing), rel=1e-3)
    assert after.way == pytest.approx(-20.0 * COUNT, rel=1e-3)


@pytest.mark.parametrize('side', [1.0, -1.0])
def test_a_rod_that_stops_is_at_most_as_fast_as_the_play_allows_and_then_at_rest(side):
    state = KNOWN._replace(last_push=KNOWN.stamp, velocity=side * 0.01, way=side * 100 * COUNT)
    states = run([0.0] * 250, state)
    for number, after in enumerate(states[: round(LONGEST_WAIT * RATE) - 1], start=1):
        assert after.velocity == pytest.approx(side * 2.0 * COUNT / (number * 1e-3), rel=0.01)
        assert after.is_waiting
    assert states[round(LONGEST_WAIT * RATE)].velocity == 0.0


def test_a_speed_that_would_take_too_long_for_one_play_is_rest():
    slow = COUNT / LONGEST_WAIT  # [m/s]
    for speed, moves in ((0.9 * slow, False), (1.2 * slow, True)):
        state = KNOWN._replace(slack=KNOWN.half_width, last_push=KNOWN.stamp, way=100 * COUNT, velocity=speed)
        assert bool(run([speed], state)[-1].velocity) is moves


def test_a_rod_that_swings_is_no_ripple_and_a_motion_after_it_is_seen():
    """A heavy load on the springs of seals and oil swings out to and fro, again and again."""
    time = [i / RATE for i in range(20_000)]
    swing = [3e-4 * math.exp(-(t % 1.0) / 0.15) * math.sin(50.0 * t) for t in time]
    moving = [swing[-1] + 0.02 * i / RATE for i in range(200)]
    counts = [round(x / COUNT) for x in swing + moving]
    states = run([ONE * (after - before) for before, after in pairwise(counts)])
    assert max(s.half_width for s in states) <= 1.5 * WIDEST * 2.0 * COUNT  # a ripple is one count or two
    assert all(s.velocity == pytest.approx(0.02, rel=0.1) for s in states[-100:])


# --- stamps ---


def test_a_repeated_stamp_is_no_new_sample_of_a_signal_with_a_ripple():
    assert condition_velocity(KNOWN, KNOWN.stamp, 0.5, 0.0) is KNOWN


def test_a_repeated_stamp_of_a_clean_signal_passes_and_does_not_count():
    state = run([0.1, 0.2])[-1]
    again = condition_velocity(state, state.stamp, 0.3, 0.0)
    assert (again.velocity, again.samples, again.last_change) == (0.3, state.samples, state.last_change)


@pytest.mark.parametrize('change', [10**9, -(10**9), round(LONGEST_STEP * 1e9) + 1])
def test_a_gap_or_a_clock_that_was_set_back_counts_as_the_longest_step(change):
    state = KNOWN._replace(slack=0.0)
    after = condition_velocity(state, state.stamp + change, 2.0 * ONE, 0.0)
    moved = after.way - state.way + after.slack
    assert moved == pytest.approx(2.0 * ONE * LONGEST_STEP, rel=1e-3)


@given(st.lists(st.integers(-3, 9), min_size=30, max_size=120))
def test_there_and_back_are_alike_with_a_ripple_too(counts):
    velocities = [number * ONE for number in counts]
    there, back = run(velocities, KNOWN), run([-velocity for velocity in velocities], KNOWN)
    assert [state.velocity for state in there] == [-state.velocity for state in back]
    assert [state.smoothing for state in there] == [state.smoothing for state in back]


# --- settling ---


def test_the_signal_has_settled_after_100_samples_or_100_ms():
    slow, fast = run([0.1] * 30, step=5 * MS), run([0.1] * 120, step=MS // 10)
    assert [s.samples for s in slow[:3]] == [1, 6, 11]
    assert [s.samples for s in fast[:3]] == [1, 2, 3]
    for states, first in ((slow, 20), (fast, SETTLING - 1)):
        known = [confirmed_velocity(s) for s in states]
        assert known[: first - 1] == [0.0] * (first - 1)
        assert set(known[first:]) == {0.1}


def test_a_direction_counts_once_two_samples_agree_on_it():
    settled = NOT_CONDITIONED._replace(samples=SETTLING)
    for velocities, confirmed in (
        ([0.1, 0.2, -0.1, -0.2], [0.1, 0.2, 0.0, -0.2]),
        ([0.0, 0.1, 0.2], [0.0, 0.0, 0.2]),
        ([-0.1, 0.0], [-0.1, 0.0]),
    ):
        states = run(velocities, settled._replace(stamp=-MS, last_velocity=velocities[0]))
        assert [confirmed_velocity(s) for s in states] == confirmed


def test_with_a_known_ripple_the_play_decides_and_not_the_last_two_samples():
    state = KNOWN._replace(samples=SETTLING, velocity=0.01, last_velocity=-0.01, last_change=0.0)
    assert confirmed_velocity(state) == 0.01
