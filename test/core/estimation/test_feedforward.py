"""The feed-forward: one gain, never against the wanted motion, and 0 N when anything is missing."""

import dataclasses
import math
from itertools import pairwise

import numpy as np
import pytest
from harness.compensation import COMPENSATING
from hypothesis import given
from hypothesis import strategies as st

from seal_friction_ros.core.estimation.feedforward import (
    FADED_IN,
    FADED_OUT,
    FeedForwardSettings,
    compensation,
    elastic_compensation,
    elastic_step,
    led_velocity,
    step,
    usable,
    wanted_velocity,
)
from seal_friction_ros.core.friction.presliding import (
    NO_ELEMENTS,
    Elements,
    Presliding,
    presliding_numbers,
)
from seal_friction_ros.core.friction.states import FrictionState
from seal_friction_ros.core.messages.records import NEVER, FrictionEstimate, Limited, Status
from test.harness.masing import initial_loading

MS = 1_000_000  # [ns]
NONE = -1.0  # no usable friction
SHARP = dataclasses.replace(COMPENSATING, slew_limit=1e9, lead_time=0.0)


def run(settings, n, friction=42.0, velocity=0.1, *, state=None, start=0, step_time=MS):
    """Take n steps of ``step_time`` [ns], by default faded in; the state and all outputs."""
    state, rows = state or FADED_IN, []
    for i in range(start, start + n):
        state, out = step(settings, state, i * step_time, i * step_time, friction, velocity)
        rows.append(out)
    return state, rows


def test_without_a_scale_there_is_no_force():
    _, rows = run(FeedForwardSettings(), 10)
    assert [row.force for row in rows] == [0.0] * 10


def test_the_force_is_a_share_of_the_friction_in_the_direction_of_the_wanted_velocity():
    for velocity in (0.1, -0.1):
        _, rows = run(SHARP, 3, velocity=velocity)
        assert rows[-1].force == pytest.approx(math.copysign(0.9 * 42.0, velocity))
        assert (rows[-1].limited, rows[-1].scale) == (0, 0.9)


@given(st.floats(0.0, 2.0), st.floats(-1e6, 1e6), st.floats(-100.0, 100.0), st.floats(1e-6, 1.0))
def test_one_gain_scales_everything_and_the_force_never_acts_against_the_velocity(scale, friction, velocity, width):
    settings = dataclasses.replace(SHARP, scale=scale, smoothing_velocity=width)
    force = compensation(settings, friction, velocity)
    assert force * velocity >= 0.0
    assert compensation(settings, friction, -velocity) == -force
    assert force == pytest.approx(scale * compensation(dataclasses.replace(settings, scale=1.0), friction, velocity))
    assert abs(force) <= scale * max(friction, 0.0)


def test_scale_0_is_0_newton_at_once():
    state, rows = run(SHARP, 10)
    assert rows[-1].force > 30.0
    _, rows = run(dataclasses.replace(SHARP, scale=0.0, slew_limit=1.0), 3, state=state, start=10)
    assert [row.force for row in rows] == [0.0] * 3
    assert all(math.copysign(1.0, row.force) == 1.0 for row in rows)


@given(st.floats(-1.0, 1.0))
def test_the_force_passes_zero_smoothly(velocity):
    steepest = 0.9 * 42.0 / SHARP.smoothing_velocity
    change = compensation(SHARP, 42.0, velocity + 1e-6) - compensation(SHARP, 42.0, velocity)
    assert abs(change) <= 1.001e-6 * steepest


def test_the_lead_takes_the_force_away_before_a_reversal_but_does_not_reverse_it():
    settings = dataclasses.replace(SHARP, lead_time=0.01)
    assert wanted_velocity(settings, 0.005, -0.3) == pytest.approx(0.002)
    assert wanted_velocity(settings, 0.005, -1.0) == 0.0
    assert wanted_velocity(settings, 0.005, 1.0) == pytest.approx(0.015)
    assert wanted_velocity(settings, 0.0, -1.0) == pytest.approx(-0.01)  # from rest


@given(st.floats(), st.floats())
def test_a_velocity_that_is_not_finite_is_not_known_and_others_are_bounded(velocity, acceleration):
    wanted = wanted_velocity(FeedForwardSettings(), velocity, acceleration)
    assert abs(wanted) <= 100.0 if math.isfinite(velocity) else math.isnan(wanted)


def test_slew_limits_the_rate_and_says_so():
    settings = dataclasses.replace(SHARP, slew_limit=1000.0)
    _, rows = run(settings, 60)
    forces = [0.0] + [r.force for r in rows]
    assert max(abs(b - a) for a, b in pairwise(forces)) <= 1.0 + 1e-9
    assert rows[10].limited == Limited.SLEW
    assert rows[-1].force == pytest.approx(37.8)
    assert rows[-1].limited == 0


def test_clamp_cuts_and_says_so():
    settings = dataclasses.replace(SHARP, force_limit=20.0)
    _, rows = run(settings, 3)
    assert rows[-1].force == 20.0
    assert rows[-1].limited == Limited.CLAMP


@pytest.mark.parametrize(('friction', 'velocity'), [(NONE, 0.1), (42.0, math.nan), (NONE, math.nan)])
def test_fades_out_without_a_usable_input_and_back_in(friction, velocity):
    state, _ = run(SHARP, 10)
    state, rows = run(SHARP, 300, friction, velocity, state=state, start=10)
    assert rows[0].limited == Limited.FADE
    assert rows[99].force == pytest.approx(37.8 * 0.5, rel=0.02)
    assert all(b.force <= a.force for a, b in pairwise(rows))
    assert (rows[-1].force, rows[-1].scale, rows[-1].limited) == (0.0, 0.0, Limited.FADE)
    _, rows = run(SHARP, 300, state=state, start=310)
    assert rows[0].force < 1.0
    assert rows[-1].force == pytest.approx(37.8)
    assert rows[-1].limited == 0


def test_the_fade_beats_the_slew_limit():
    """A slew limit of 20 N/s made a fade of 0.2 s take 1.9 s."""
    state, _ = run(SHARP, 10)
    _, rows = run(dataclasses.replace(SHARP, slew_limit=20.0), 201, NONE, state=state, start=10)
    assert rows[-1].force == 0.0


def test_a_gap_counts_whole_for_the_fade_and_little_for_the_slew():
    settings = dataclasses.replace(SHARP, slew_limit=100.0)
    state, _ = run(SHARP, 10)
    _, out = step(settings, state, 5000 * MS, 5000 * MS, NONE, 0.1)
    assert out.force == 0.0
    _, out = step(settings, state, 5000 * MS, 5000 * MS, 42.0, -0.1)
    assert out.force == pytest.approx(37.8 - 100.0 * 0.02)


def test_while_the_force_fades_it_follows_the_wanted_direction():
    state, _ = run(SHARP, 10)
    _, rows = run(SHARP, 100, NONE, -0.1, state=state, start=10)
    assert all(row.force < 0.0 for row in rows)


def test_the_first_force_fades_in():
    _, rows = run(SHARP, 400, state=FADED_OUT)
    assert rows[0].force == 0.0
    assert rows[100].force == pytest.approx(37.8 / 2, rel=0.02)
    assert rows[-1].force == pytest.approx(37.8)


def test_the_fade_begins_with_the_first_sample_and_is_done_after_its_time():
    """The first usable estimate must not come late, not by one sample."""
    _, rows = run(SHARP, 202, state=FADED_OUT)
    assert [row.scale for row in rows[:200]] == pytest.approx([0.9 * i / 200 for i in range(200)])
    assert [row.force for row in rows[:200]] == pytest.approx([37.8 * i / 200 for i in range(200)])
    assert [row.limited for row in rows[1:199]] == [Limited.FADE] * 198
    assert rows[201].limited == 0
    _, out = step(SHARP, FADED_OUT, 0, 5, 42.0, 0.1)  # a clock that does not begin at 0
    assert out.force == 0.0


def test_a_clock_of_receipt_that_goes_back_makes_no_step():
    state, _ = run(SHARP, 10)
    _, out = step(dataclasses.replace(SHARP, slew_limit=1.0), state, 0, -5000 * MS, 42.0, -0.1)
    assert out.force == pytest.approx(37.8)


def test_an_estimate_is_usable_with_a_good_pressure_and_by_measured_velocity_with_a_known_state():
    good = FrictionEstimate(0, 42.0, 3.0, 47.0, 42.0, FrictionState.SLIDING, 1, 0, 0.0)
    measured = dataclasses.replace(SHARP, use_measured_velocity=True)
    assert usable(SHARP, good)
    for bad in (Status.PRESSURE_STALE, Status.INPUT_REFUSED, Status.PRESSURE_LEAP, Status.PRESSURE_MISSING):
        assert not usable(SHARP, good._replace(status=int(bad)))
    unknown = good._replace(state=FrictionState.UNKNOWN, status=int(Status.FORCE_STALE))
    assert usable(SHARP, unknown)
    other_time = good._replace(status=int(Status.STAMP_AGE))
    assert not usable(SHARP, other_time)
    assert usable(dataclasses.replace(SHARP, lateness_max=0.0), other_time)  # bags of before
    assert not usable(measured, unknown)


@given(
    st.lists(
        st.tuples(
            st.integers(-2 * MS, 20 * MS),
            st.just(NONE) | st.floats(0.0, 1e3),
            st.floats(-100.0, 100.0) | st.just(math.nan),
        ),
        max_size=40,
    )
)
def test_finite_bounded_and_slow_whatever_comes(events):
    settings = COMPENSATING
    state, received, last = FADED_OUT, 0, 0.0
    for change, friction, velocity in events:
        received += change
        state, out = step(settings, state, 0, received, friction, velocity)
        assert math.isfinite(out.force)
        assert abs(out.force) <= settings.force_limit
        elapsed = max(change, 0) * 1e-9
        most = settings.slew_limit * elapsed + settings.force_limit * elapsed / settings.fade_time
        assert abs(out.force - last) <= most + 1e-9
        assert 0.0 <= out.scale <= settings.scale
        last = out.force


def test_a_setting_out_of_bounds_is_refused():
    with pytest.raises(ValueError, match=r'fade_time = 0\.0 s is below'):
        FeedForwardSettings(fade_time=0.0)
    with pytest.raises(ValueError, match=r'estimate_timeout = 60\.0 s is above'):
        FeedForwardSettings(estimate_timeout=60.0)
    with pytest.raises(ValueError, match='take the stiffness of the seals out of a closed loop'):
        FeedForwardSettings(presliding_against_motion=True, use_measured_velocity=True)


SPRINGS = presliding_numbers([Presliding(stiffness=1e5, yield_exponent=1.0)])
ELASTIC = dataclasses.replace(SHARP, presliding=True, scale=1.0, smoothing_velocity=1e-6)


def run_elastic(settings, elasticity, velocities, step_time=MS):
    """Force at each wanted velocity, without lead, at a friction of 42 N [N]."""
    state, forces = FADED_IN, []
    for i, v in enumerate(velocities):
        state, out = elastic_step(settings, elasticity, state, i * step_time, i * step_time, 42.0, v, v, v)
        forces.append(out.force)
    return np.array(forces)


@given(st.lists(st.floats(-0.2, 0.2), max_size=40), st.floats(0.0, 2.0), st.floats(1e3, 1e7), st.floats(1e-6, 1.0))
def test_with_elastic_seals_the_force_never_acts_against_the_wanted_velocity(velocities, scale, stiffness, width):
    settings = dataclasses.replace(ELASTIC, scale=scale, smoothing_velocity=width)
    forces = run_elastic(settings, presliding_numbers([Presliding(stiffness=stiffness)]), velocities)
    assert all(force * velocity >= 0.0 for force, velocity in zip(forces.tolist(), velocities, strict=True))
    assert all(np.abs(forces) <= scale * 42.0 * (1.0 + 1e-12))


def test_after_a_reversal_the_force_is_0_until_the_seal_resists_and_then_follows_the_spring():
    velocities = np.array([0.01] * 400 + [-0.01] * 400)
    forces = run_elastic(ELASTIC, SPRINGS, velocities.tolist())
    assert forces[399] == 42.0
    way = (np.arange(401, 801) - 401) * 1e-5  # [m] since the reversal, in the middle between two velocities
    spring = np.array([42.0 - 2.0 * initial_loading(SPRINGS, s / 2.0, 42.0) for s in way])
    np.testing.assert_allclose(forces[400:], np.minimum(spring, 0.0), atol=1e-9)
    assert np.count_nonzero(forces[400:] == 0.0) > 20
    assert forces[-1] == -42.0


def test_against_the_motion_the_force_holds_the_push_of_the_sheared_seal_and_nothing_else():
    allowed = dataclasses.replace(ELASTIC, presliding_against_motion=True)
    velocities = [0.01] * 400 + [-0.01] * 400 + [0.0] * 5
    forces, cautious = run_elastic(allowed, SPRINGS, velocities), run_elastic(ELASTIC, SPRINGS, velocities)
    way = (np.arange(401, 801) - 401) * 1e-5  # [m] since the reversal, in the middle between two velocities
    spring = np.array([42.0 - 2.0 * initial_loading(SPRINGS, s / 2.0, 42.0) for s in way])
    np.testing.assert_allclose(forces[400:800], spring, atol=1e-9)
    same = forces * velocities >= 0.0
    assert forces[same].tolist() == cautious[same].tolist()  # differs only where it acts against the motion
    assert np.count_nonzero(~same) > 20
    assert not forces[800:].any()  # 0 N at rest


@given(st.lists(st.floats(-0.2, 0.2), max_size=40), st.floats(0.0, 2.0), st.floats(1e3, 1e7))
def test_against_the_motion_the_force_is_never_more_than_the_friction(velocities, scale, stiffness):
    settings = dataclasses.replace(ELASTIC, scale=scale, presliding_against_motion=True)
    forces = run_elastic(settings, presliding_numbers([Presliding(stiffness=stiffness)]), velocities)
    assert all(np.abs(forces) <= scale * 42.0 * (1.0 + 1e-12))
    off = dataclasses.replace(settings, presliding=False)
    rigid = run_elastic(off, SPRINGS, velocities)
    assert all(force * velocity >= 0.0 for force, velocity in zip(rigid.tolist(), velocities, strict=True))


@given(st.lists(st.floats(-0.2, 0.2), max_size=20))
def test_rigid_seals_and_presliding_off_are_one_force_to_the_bit(velocities):
    off = dataclasses.replace(ELASTIC, presliding=False)
    plain = [row.force for row in [step_of(off, v) for v in velocities]]
    assert run_elastic(ELASTIC, None, velocities[:1]).tolist() == plain[:1]
    today = run_elastic(off, SPRINGS, velocities).tolist()
    assert today == run_elastic(ELASTIC, None, velocities).tolist()


def step_of(settings, velocity):
    """Feed-forward of the first step."""
    return step(settings, FADED_IN, 0, 0, 42.0, velocity)[1]


# --- what is not known yet, or not any more ---


def test_before_the_first_estimate_no_friction_is_known():
    assert FADED_OUT == (NEVER, 0.0, 0.0, -1.0, 0.0, NO_ELEMENTS, 0.0)
    assert FADED_OUT._replace(fade=1.0) == FADED_IN


def test_before_the_first_friction_or_velocity_there_is_no_force_though_nothing_is_faded_out():
    for friction, velocity in ((NONE, 0.1), (42.0, math.nan)):
        _, rows = run(SHARP, 3, friction, velocity)
        assert [row.force for row in rows] == [0.0] * 3


def test_a_friction_of_zero_is_usable_and_takes_the_force_away_at_once():
    state, _ = run(SHARP, 10)
    state, rows = run(SHARP, 3, 0.0, state=state, start=10)
    assert [(row.force, row.limited, row.scale) for row in rows] == [(0.0, 0, 0.9)] * 3
    assert state.friction == 0.0


def test_an_input_that_is_lost_is_said_at_once():
    state, _ = run(SHARP, 10)
    _, out = step(SHARP, state, 9 * MS, 9 * MS, NONE, 0.1)  # at the time of the last step
    assert (out.limited, out.scale, out.force) == (Limited.FADE, 0.9, pytest.approx(37.8))


@pytest.mark.parametrize('side', [1.0, -1.0])
def test_clamp_and_slew_hold_in_both_directions(side):
    _, rows = run(dataclasses.replace(SHARP, force_limit=20.0), 3, velocity=side * 0.1)
    assert (rows[-1].force, rows[-1].limited) == (side * 20.0, Limited.CLAMP)
    _, rows = run(dataclasses.replace(SHARP, slew_limit=1000.0), 3, velocity=side * 0.1)
    assert [row.force for row in rows] == pytest.approx([0.0, side, 2.0 * side])
    assert [row.limited for row in rows] == [Limited.SLEW] * 3
    _, rows = run(dataclasses.replace(SHARP, slew_limit=1000.0, force_limit=20.0), 3, velocity=side * 0.1)
    assert rows[-1].limited == Limited.SLEW | Limited.CLAMP


def test_an_acceleration_that_is_not_finite_leads_nowhere_and_no_rod_is_faster_than_100_metres_per_second():
    settings = FeedForwardSettings(lead_time=0.5)
    for acceleration in (math.nan, math.inf, -math.inf):
        assert led_velocity(settings, 0.005, acceleration) == 0.005
    assert led_velocity(settings, 0.1, 2.0) == pytest.approx(1.1)
    assert led_velocity(settings, 0.1, -2.0) == pytest.approx(-0.9)  # beyond a reversal, too
    assert (led_velocity(settings, 0.0, 1e3), led_velocity(settings, 0.0, -1e3)) == (100.0, -100.0)
    assert math.isnan(led_velocity(settings, math.inf, 0.0))


def test_sheared_seals_that_push_the_rod_along_are_held_only_where_that_is_allowed():
    allowed = dataclasses.replace(ELASTIC, presliding_against_motion=True)
    for friction_force, velocity in ((30.0, 0.1), (-30.0, -0.1)):
        assert elastic_compensation(ELASTIC, friction_force, velocity) == pytest.approx(friction_force)
        assert elastic_compensation(ELASTIC, friction_force, -velocity) == 0.0
        assert elastic_compensation(allowed, friction_force, -velocity) == pytest.approx(friction_force)


def first_elements(*moments, state=FADED_IN):
    """Sum of the forces of the elements [N] after (friction, velocity) each millisecond."""
    for i, (friction, velocity) in enumerate(moments):
        state, _ = elastic_step(ELASTIC, SPRINGS, state, i * MS, i * MS, friction, velocity, velocity, velocity)
    return state.elements


def test_the_seals_are_sheared_by_the_mean_of_two_velocities_and_by_no_step_before_the_first():
    assert first_elements((42.0, 0.01)) == NO_ELEMENTS
    assert sum(first_elements((42.0, 0.01), (42.0, 0.03))) == pytest.approx(1e5 * 0.02e-3)
    assert sum(first_elements((42.0, math.nan), (42.0, 0.01))) == pytest.approx(1e5 * 0.005e-3)
    assert sum(first_elements((42.0, 0.01), (42.0, math.nan))) == pytest.approx(1e5 * 0.01e-3)  # it goes on


def test_a_step_of_more_than_20_ms_shears_the_seals_as_one_of_20_ms():
    state, _ = elastic_step(ELASTIC, SPRINGS, FADED_IN, 0, 0, 42.0, 0.001, 0.001, 0.001)
    for elapsed, way in ((10, 1e-5), (20, 2e-5), (500, 2e-5)):
        after, _ = elastic_step(ELASTIC, SPRINGS, state, 0, elapsed * MS, 42.0, 0.001, 0.001, 0.001)
        assert sum(after.elements) == pytest.approx(1e5 * way)


def test_seals_without_friction_bear_nothing_and_those_of_an_unknown_friction_stay_as_they_are():
    held = FADED_IN._replace(elements=Elements(1.0, 1.0, 1.0, 1.0, 1.0, 1.0))
    assert first_elements((0.0, 0.01), state=held) == NO_ELEMENTS
    assert first_elements((NONE, 0.01), state=held) == held.elements
