import dataclasses
import math
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from seal_friction_ros.core.estimation.feedforward import (
    FeedForwardSettings,
    Limited,
    Motion,
    compensation,
    init,
    step,
)
from seal_friction_ros.core.estimation.records import NO_ESTIMATE, FrictionEstimate, Status
from seal_friction_ros.core.friction.states import FrictionState

MS = 1_000_000
GOOD = FrictionEstimate(0, 42.0, 3.0, 47.0, 42.0, FrictionState.SLIDING, 1, 0, 0.0)
FORWARD = Motion(0.1)
SHARP = FeedForwardSettings(slew_limit=1e9, lead_time=0.0)


def run(settings, n, estimate=GOOD, motion=FORWARD, *, state=None, start=0):
    """Take n steps of 1 ms with estimates that are always fresh (or none); all outputs."""
    state, rows = state or init(settings), []
    for i in range(start, start + n):
        now = estimate if estimate is NO_ESTIMATE else estimate._replace(stamp=i * MS)
        state, out = step(settings, state, i * MS, now, motion)
        rows.append(out)
    return state, rows


def test_share_of_the_coulomb_friction_in_the_direction_of_the_reference():
    for velocity in (0.1, -0.1):
        _, rows = run(SHARP, 3, motion=Motion(velocity))
        assert rows[-1].force == pytest.approx(math.copysign(0.9 * 42.0, velocity))
        assert rows[-1].limited == 0
        assert rows[-1].scale == 0.9


def test_default_scales_are_below_1_and_terms_the_seal_lacks_are_0():
    settings = FeedForwardSettings()
    assert settings.coulomb_scale < 1.0
    assert settings.viscous_scale < 1.0
    assert settings.viscous_friction == settings.stribeck_scale == 0.0


def test_viscous_and_stribeck_terms():
    settings = dataclasses.replace(SHARP, viscous_friction=100.0, viscous_scale=0.5, stribeck_scale=0.8)
    velocity = 0.005
    expected = math.tanh(5.0) * (0.9 * 42.0 + 0.8 * 5.0 * math.exp(-1.0)) + 0.5 * 100.0 * velocity
    assert compensation(settings, GOOD, velocity) == pytest.approx(expected)


@given(st.floats(-1.0, 1.0))
def test_odd_bounded_and_smooth_through_zero(velocity):
    force = compensation(SHARP, GOOD, velocity)
    assert compensation(SHARP, GOOD, -velocity) == -force
    assert abs(force) <= 0.9 * 42.0
    steepest = 0.9 * 42.0 / SHARP.smoothing_velocity
    assert abs(compensation(SHARP, GOOD, velocity + 1e-6) - force) <= 1.001e-6 * steepest


def test_lead_sees_the_reversal_before_it_comes():
    settings = dataclasses.replace(SHARP, lead_time=0.01)
    _, rows = run(settings, 3, motion=Motion(0.005, -1.0))
    assert rows[-1].force < 0.0


def test_measured_velocity_is_an_option():
    settings = dataclasses.replace(SHARP, use_measured_velocity=True)
    _, rows = run(settings, 3, motion=Motion(0.1, 0.0, -0.1))
    assert rows[-1].force < 0.0


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


@pytest.mark.parametrize(
    'bad',
    [GOOD._replace(status=int(Status.PRESSURE_STALE)), GOOD._replace(status=int(Status.INPUT_REFUSED)), NO_ESTIMATE],
)
def test_fades_out_without_a_usable_estimate_and_back_in(bad):
    state, _ = run(SHARP, 10)
    state, rows = run(SHARP, 300, bad, state=state, start=10)
    assert rows[0].limited == Limited.FADE
    assert rows[99].force == pytest.approx(37.8 * 0.5, rel=0.02)
    assert all(b.force <= a.force for a, b in pairwise(rows))
    assert (rows[-1].force, rows[-1].scale, rows[-1].limited) == (0.0, 0.0, Limited.FADE)
    _, rows = run(SHARP, 300, state=state, start=310)
    assert rows[0].force < 1.0
    assert rows[-1].force == pytest.approx(37.8)
    assert rows[-1].limited == 0


def test_estimate_that_is_too_old_fades_out():
    state, _ = run(SHARP, 10)
    for i in range(10, 500):
        state, out = step(SHARP, state, i * MS, GOOD._replace(stamp=9 * MS), Motion(0.1))
        assert out.limited == (Limited.FADE if i > 109 else 0)
    assert out.force == 0.0


def test_bad_force_leaves_the_coulomb_friction_usable():
    _, rows = run(SHARP, 3, GOOD._replace(status=int(Status.FORCE_STALE), state=FrictionState.UNKNOWN))
    assert rows[-1].force == pytest.approx(37.8)
    measured = dataclasses.replace(SHARP, use_measured_velocity=True)
    _, rows = run(measured, 3, GOOD._replace(state=FrictionState.UNKNOWN), Motion(0.1, 0.0, 0.1))
    assert rows[-1].force == 0.0


def test_nothing_before_the_first_estimate():
    _, rows = run(SHARP, 5, NO_ESTIMATE)
    assert [r.force for r in rows] == [0.0] * 5
    assert rows[0].limited == Limited.FADE


@given(
    st.lists(
        st.tuples(
            st.integers(-2 * MS, 20 * MS),
            st.one_of(st.none(), st.tuples(st.floats(0.0, 1e3), st.integers(0, 2**16 - 1))),
            st.floats(),
            st.floats(),
        ),
        max_size=40,
    )
)
def test_finite_bounded_and_slow_whatever_comes(events):
    settings = FeedForwardSettings(viscous_friction=50.0)
    state, stamp, last = init(settings), 0, 0.0
    for change, seen, velocity, acceleration in events:
        stamp += change
        estimate = NO_ESTIMATE
        if seen is not None:
            estimate = GOOD._replace(
                stamp=stamp, coulomb_friction=seen[0], breakaway_force=seen[0] + 5.0, status=seen[1]
            )
        state, out = step(settings, state, stamp, estimate, Motion(velocity, acceleration))
        assert math.isfinite(out.force)
        assert abs(out.force) <= settings.force_limit
        assert abs(out.force - last) <= settings.slew_limit * max(change, 0) * 1e-9 + 1e-9
        assert 0.0 <= out.scale <= settings.coulomb_scale
        last = out.force


def test_setting_that_makes_no_sense_is_refused():
    with pytest.raises(ValueError, match=r'fade_time = 0\.0 s is below'):
        FeedForwardSettings(fade_time=0.0)
