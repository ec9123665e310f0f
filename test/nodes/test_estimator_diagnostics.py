"""Counts of the running estimator."""

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus

from seal_friction_ros.core.estimation.estimator import init
from seal_friction_ros.core.estimation.feedforward import FeedForward, Limited
from seal_friction_ros.core.estimation.messages import INPUTS
from seal_friction_ros.core.estimation.records import NO_ESTIMATE, Status
from seal_friction_ros.core.estimation.swings import NO_SWING
from seal_friction_ros.files import default_configuration
from seal_friction_ros.nodes.estimator_diagnostics import EstimatorDiagnostics, Lateness, MissingSamples
from seal_friction_ros.nodes.graph_watch import GraphFindings

PERIOD = 1_000_000  # [ns]


@pytest.mark.parametrize('seed', range(20))
@pytest.mark.parametrize('loss', [0.0, 0.2, 0.5])
def test_samples_lost_in_bursts_are_counted_from_the_first_samples_on(loss, seed):
    chance, missing, lost = np.random.default_rng(seed), MissingSamples(), 0
    number = last = 1
    missing.on_stamp(number * PERIOD)
    for _ in range(500):
        burst = int(chance.exponential(4.0)) if chance.random() < loss / 4.0 else 0
        number += 1 + burst
        missing.on_stamp(number * PERIOD + int(chance.uniform(-0.01, 0.01) * PERIOD))
        lost += number - last - 1
        last = number
    assert missing.count == lost


def level_of(bit: Status, share: float) -> tuple[bytes, str]:
    """Level and message of a second in which this share of the estimates had the bit."""
    diagnostics = EstimatorDiagnostics()
    for i in range(100):
        diagnostics.on_estimate(NO_ESTIMATE._replace(status=int(bit) if i < 100 * share else 0), 1000, 0)
    report = diagnostics.report(True, False, GraphFindings(dict.fromkeys(INPUTS, 1), [], [], {}))
    return report.level, report.message


@pytest.mark.parametrize('bit', [Status.MOTION_UNCERTAIN, Status.SLOWER_THAN_IDENTIFIED])
def test_slow_motion_as_each_reversal_has_it_is_no_warning_and_a_quarter_of_a_second_is(bit):
    assert level_of(bit, 0.2) == (DiagnosticStatus.OK, 'estimating')
    level, message = level_of(bit, 0.3)
    assert level == DiagnosticStatus.WARN
    assert message.startswith('30% of rod_velocity')


def test_a_velocity_that_hums_is_named():
    diagnostics, watched = EstimatorDiagnostics(), GraphFindings(dict.fromkeys(INPUTS, 1), [], [], {})
    for i in range(100):
        diagnostics.on_estimate(NO_ESTIMATE._replace(status=int(Status.MOTION_UNCERTAIN) if i < 50 else 0), 1000, 0)
    known = init(default_configuration().parameters().estimator)._replace(swing=NO_SWING._replace(doubted=64e-6))
    report = diagnostics.report(True, False, watched, known=known)
    assert report.message.endswith('swings by 64 um, the force sum does not show it: hum, or a wrong force sum')
    assert {value.key: value.value for value in report.values}['swing without force [um]'] == '64.0'
    assert 'swings' not in diagnostics.report(True, False, watched).message


@pytest.mark.parametrize('bit', [Status.FASTER_THAN_IDENTIFIED, Status.DIRECTION_NOT_IDENTIFIED])
def test_one_estimate_beyond_the_identified_motion_is_a_warning(bit):
    assert level_of(bit, 0.01) == (DiagnosticStatus.WARN, bit.name)


def test_who_looks_on_gets_the_newest_answers_with_the_bits_of_all_since_the_last_look():
    statistics = EstimatorDiagnostics()
    assert statistics.take_newest('boom') == []
    for number, (status, limited) in enumerate([(0, 0), (int(Status.FORCE_STALE), int(Limited.CLAMP)), (0, 0)]):
        statistics.on_estimate(NO_ESTIMATE._replace(stamp=number, status=status), 1, number)
        statistics.on_feedforward(FeedForward(number, float(number), 0.9, limited))
    estimate, feedforward = statistics.take_newest('boom')
    assert (estimate.actuator, estimate.record.stamp, estimate.record.status) == ('boom', 2, Status.FORCE_STALE)
    assert (feedforward.record.force, feedforward.record.limited) == (2.0, Limited.CLAMP)
    assert statistics.take_newest('boom') == []
    statistics.on_estimate(NO_ESTIMATE, 1, 0)
    assert [answer.record.status for answer in statistics.take_newest('boom')] == [0]


def message_of(ages: list[int]) -> tuple[bytes, str]:
    """Level and message of a second whose velocities were received so long [ns] after their stamps."""
    diagnostics = EstimatorDiagnostics()
    for number, age in enumerate(ages):
        diagnostics.on_estimate(NO_ESTIMATE._replace(stamp=number * PERIOD), 1000, number * PERIOD + age)
    report = diagnostics.report(True, False, GraphFindings(dict.fromkeys(INPUTS, 1), [], [], {}))
    return report.level, report.message


@pytest.mark.parametrize('clock', [-(10**12), 0, 10**12])
def test_velocities_that_waited_are_a_warning_whatever_their_clock_shows(clock):
    assert message_of([clock + i % 40 * PERIOD for i in range(100)]) == (DiagnosticStatus.OK, 'estimating')
    level, message = message_of([clock + i * PERIOD for i in range(100)])
    assert level == DiagnosticStatus.WARN
    assert message.startswith('rod_velocity comes up to 99 ms late')


def lateness_of(intervals: list[list[int]]) -> list[int]:
    """Lateness [ms] of each interval of velocities that came so long [ms] after their stamps."""
    late, found = Lateness(), []
    for ages in intervals:
        late.start_interval()
        for age in ages:
            late.on_velocity(age * PERIOD)
        found.append(late.largest // PERIOD)
    return found


def test_late_is_later_than_usual_in_the_last_minute():
    slow = lateness_of([[5, 6]] * 20 + [[40, 70]] * 100)
    assert slow[:20] == [1] * 20
    assert slow[20:39] == [65] * 19  # as long as most of the last minute was quicker
    assert slow[39:] == [30] * 81


def test_wrong_stamps_for_a_moment_do_not_make_the_others_late():
    assert lateness_of([[0, 1], [-500, 0, 1], [0, 1], [0, 1]]) == [1, 1, 1, 1]


def test_a_clock_that_was_set_is_not_late():
    assert lateness_of([[0, 1], [0, 5000, 5001], [5000, 5020], [5000, 5001]]) == [1, 0, 20, 1]
    assert lateness_of([[0, 1], [0, -5000], [-5000, -4980], [-5000, -4999]])[-1] == 1
