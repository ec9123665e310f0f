"""Stamps that jump are told from pauses by the times of receipt, and go on by them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from seal_friction_ros.core.foundation.stamps import StampRepair, repaired_stamps

SECOND = 1_000_000_000  # [ns]
TIMES = 1_700_000_000 * SECOND + 5_000_000 * np.arange(2000)


def repaired(stamps, received=TIMES):
    found, repair = repaired_stamps(stamps, received)
    step_by_step = StampRepair()
    assert found.tolist() == [step_by_step.next(*pair) for pair in zip(stamps.tolist(), received.tolist(), strict=True)]
    return found, repair.jumps, repair.repaired


@pytest.mark.parametrize('ahead', [3600 * SECOND, -3600 * SECOND])
def test_one_stamp_an_hour_off_is_repaired_alone(ahead):
    wrong = TIMES.copy()
    wrong[700] += ahead
    found, jumps, count = repaired(wrong)
    assert (found == TIMES).all()
    assert (jumps, count) == (2, 1)


@pytest.mark.parametrize(('length', 'jumps'), [(900, 2), (400, 4)])
def test_a_looped_playback_goes_on_by_the_log_time(length, jumps):
    found, *counts = repaired(TIMES[0] + (TIMES - TIMES[0]) % (5_000_000 * length))
    assert (found == TIMES).all()
    assert counts == [jumps, 2000 - length]


def test_a_clock_that_was_set_is_followed_and_a_simulated_one_keeps_its_own_time():
    assert (repaired(TIMES + np.where(np.arange(2000) > 900, 5 * SECOND, 0))[0] == TIMES).all()
    slow = SECOND + (TIMES - TIMES[0]) // 3
    assert (repaired(slow)[0] == slow).all()


def test_a_pause_and_messages_that_come_late_are_no_jumps():
    pause = TIMES + np.where(np.arange(2000) > 900, 60 * SECOND, 0)
    assert repaired(pause, pause)[1:] == (0, 0)
    held_up = np.maximum(TIMES, TIMES[1500])
    assert repaired(TIMES, held_up)[1:] == (0, 0)
    assert repaired(TIMES, pause)[1:] == (0, 0)


@given(st.lists(st.integers(-10, 10).map(lambda s: s * SECOND), min_size=1, max_size=30))
def test_repaired_stamps_never_go_back_by_more_than_jitter(offsets):
    stamps = TIMES[: len(offsets)] + np.cumsum(offsets)
    found, *_ = repaired(stamps, TIMES[: len(offsets)])
    assert (np.diff(found) > -SECOND).all()
