"""Every recorded sample is used, or dropped with a reason that is counted."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from seal_friction_ros.core.identification.admission import (
    NOT_FINITE,
    SAME_STAMP,
    Account,
    account,
    bridged,
    in_order,
)
from seal_friction_ros.core.identification.prepare_readings import prepare_logs
from seal_friction_ros.core.identification.readings import RecordedLog
from seal_friction_ros.core.identification.signal_preparation import Signals, Sliding

STEP = 10_000_000  # [ns]
HOUR = 3600 * 10**9  # [ns]


def stamps(count=1000):
    return np.arange(count, dtype=np.int64) * STEP


def test_a_stamp_of_the_future_costs_no_sample():
    ahead = stamps()
    ahead[300] += HOUR
    order = in_order(ahead, stamps())
    assert order.rows.tolist() == list(range(1000))
    assert order.same_stamp == 0
    assert order.seconds == pytest.approx(1e-9 * stamps(), abs=0.011)
    assert order.texts == ('the stamp of the velocity jumps 2 times: 1 stamps set by the log time',)


def test_a_looped_playback_goes_on_where_it_was_received():
    order = in_order(stamps() % (250 * STEP), stamps())
    assert order.rows.tolist() == list(range(1000))
    assert order.seconds == pytest.approx(1e-9 * stamps())
    assert 'jumps 3 times' in order.texts[0]


def test_messages_out_of_order_are_sorted():
    mixed = stamps() + np.random.default_rng(1).integers(-9, 9, 1000) * STEP
    order = in_order(mixed, stamps())
    assert mixed[order.rows].tolist() == np.unique(mixed).tolist()
    assert order.same_stamp == 1000 - len(np.unique(mixed))
    assert 'came out of order' in order.texts[0]


@given(
    st.lists(st.sampled_from([STEP, STEP, STEP, 0, -5 * STEP, 400 * STEP, -HOUR, HOUR]), min_size=1, max_size=300),
)
def test_every_sample_is_kept_or_has_a_stamp_of_another(steps):
    order = in_order(np.cumsum(np.array(steps, dtype=np.int64)), stamps(len(steps)))
    assert len(order.rows) + order.same_stamp == len(steps)
    assert (np.diff(order.seconds) > 0.0).all()


def test_up_to_three_missing_values_are_on_a_straight_line():
    values = np.arange(20.0)
    values[[0, 4, 5, 6, 10, 11, 12, 13]] = np.nan
    found, short = bridged(values)
    assert np.flatnonzero(short).tolist() == [4, 5, 6]
    assert found[4:7].tolist() == [4.0, 5.0, 6.0]
    assert np.flatnonzero(np.isnan(found)).tolist() == [0, 10, 11, 12, 13]


def test_more_faulty_samples_than_half_are_refused_with_the_reasons():
    Account('log', 0, {SAME_STAMP: 30, NOT_FINITE: 20, 'at rest': 50}).check()
    with pytest.raises(ValueError, match=r'^log: 51 of 100 samples cannot be used .same stamp 30, not finite 21.'):
        Account('log', 49, {SAME_STAMP: 30, NOT_FINITE: 21}).check()


def test_a_fault_of_more_than_one_sample_in_a_hundred_is_a_warning():
    assert list(Account('log', 990, {NOT_FINITE: 10}).warnings) == []
    (warning,) = Account('log', 979, {NOT_FINITE: 11, 'at rest': 10}).warnings
    assert warning == '11 of 1000 samples (1 %) are dropped: not finite'


@given(st.lists(st.sets(st.sampled_from('abc')), min_size=1), st.dictionaries(st.sampled_from('ad'), st.integers(1, 9)))
def test_the_first_reason_that_holds_counts(held, earlier):
    reasons = {reason: np.array([reason in each for each in held]) for reason in 'abc'}
    found = account('log', reasons, earlier)
    first = [min(each, default='') for each in held]
    wanted = {reason: first.count(reason) + earlier.get(reason, 0) for reason in 'abcd'}
    assert found.left_out == {reason: count for reason, count in wanted.items() if count}
    assert (found.used, found.total) == (first.count(''), len(held) + sum(earlier.values()))


@given(st.integers(0, 50), st.lists(st.integers(0, 3999), max_size=30), st.integers(1, 9))
def test_used_and_dropped_samples_are_all_samples(dropped, missing, pressures):
    side = np.sign(np.sin(np.arange(4000) / 100.0))
    pressure = 1e5 * (1.0 + np.arange(4000) * pressures // 4000)
    force = side * (10.0 + 1e-5 * pressure)
    force[missing] = np.nan
    signals = Signals(np.arange(4000) * 0.01, 0.02 * side, pressure, 0.0 * pressure, force)
    log = RecordedLog('log', signals, Sliding(), dropped={SAME_STAMP: dropped} if dropped else {})
    prepared = prepare_logs([log], ['a'])
    (samples,) = prepared.accounts
    assert (samples.name, samples.total) == ('log', 4000 + dropped)
    assert samples.left_out.get(SAME_STAMP, 0) == dropped
