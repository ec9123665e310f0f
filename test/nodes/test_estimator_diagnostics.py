"""Counts of the running estimator."""

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus

from seal_friction_ros.core.estimation.estimator import init
from seal_friction_ros.core.estimation.swings import NO_SWING
from seal_friction_ros.core.messages.layouts import CLOCK_TOPIC, INPUTS
from seal_friction_ros.core.messages.records import NO_ESTIMATE, FeedForward, Limited, Status
from seal_friction_ros.files import default_configuration
from seal_friction_ros.nodes.estimator_diagnostics import EstimatorDiagnostics, MissingSamples
from seal_friction_ros.nodes.graph_watch import GraphFindings

PERIOD = 1_000_000  # [ns]


@pytest.mark.parametrize('seed', range(20))
@pytest.mark.parametrize('loss', [0.0, 0.2, 0.5])
def test_samples_lost_in_bursts_are_counted_from_the_first_samples_on(loss, seed):
    chance, missing, lost = np.random.default_rng(seed), MissingSamples(), 0
    number = last = 1
    missing.on_stamps([number * PERIOD])
    for _ in range(500):
        burst = int(chance.exponential(4.0)) if chance.random() < loss / 4.0 else 0
        number += 1 + burst
        missing.on_stamps([number * PERIOD + int(chance.uniform(-0.01, 0.01) * PERIOD)])
        lost += number - last - 1
        last = number
    assert missing.count == lost


def level_of(bit: Status, share: float) -> tuple[bytes, str]:
    """Level and message of a second in which this share of the estimates had the bit."""
    diagnostics = EstimatorDiagnostics()
    for i in range(100):
        diagnostics.on_estimates([(NO_ESTIMATE._replace(status=int(bit) if i < 100 * share else 0), 1000)])
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
        diagnostics.on_estimates([(NO_ESTIMATE._replace(status=int(Status.MOTION_UNCERTAIN) if i < 50 else 0), 1000)])
    known = init(default_configuration().parameters().estimator)
    known.swing = NO_SWING._replace(doubted=64e-6)
    report = diagnostics.report(True, False, watched, known=known)
    assert report.message.endswith('swings by 64 um, the force sum does not show it: hum, or a wrong force sum')
    assert {value.key: value.value for value in report.values}['swing without force [um]'] == '64.0'
    assert 'swings' not in diagnostics.report(True, False, watched).message


@pytest.mark.parametrize('bit', [Status.FASTER_THAN_IDENTIFIED, Status.DIRECTION_NOT_IDENTIFIED])
def test_one_estimate_beyond_the_identified_motion_is_a_warning(bit):
    assert level_of(bit, 0.01) == (DiagnosticStatus.WARN, f'{bit.name} 1%')


def test_each_bit_has_its_share_and_none_hides_what_limits_the_force():
    diagnostics = EstimatorDiagnostics()
    for number in range(100):
        status = Status.FORCE_STALE * (number < 3) | Status.PRESSURE_OUT_OF_RANGE
        diagnostics.on_estimates([(NO_ESTIMATE._replace(status=int(status)), 1000)])
        limited = Limited.CLAMP * (number < 98) | Limited.FADE * (number < 76)
        diagnostics.on_feedforwards([(FeedForward(number, 1.0, 0.9, int(limited)), 0)])
    diagnostics.on_malformed('force_sum')
    message = diagnostics.report(True, False, GOOD).message
    for words in (
        'FORCE_STALE 3%',
        'PRESSURE_OUT_OF_RANGE;',
        'malformed messages on force_sum',
        '98% cut',
        '76% faded',
    ):
        assert words in message, message


def test_who_looks_on_gets_the_newest_answers_with_the_bits_of_all_since_the_last_look():
    statistics = EstimatorDiagnostics()
    assert statistics.take_newest() == []
    for number, (status, limited) in enumerate([(0, 0), (int(Status.FORCE_STALE), int(Limited.CLAMP)), (0, 0)]):
        statistics.on_estimates([(NO_ESTIMATE._replace(stamp=number, status=status), 1)])
        statistics.on_feedforwards([(FeedForward(number, float(number), 0.9, limited), 0)])
    estimate, feedforward = statistics.take_newest()
    assert (estimate.stamp, estimate.status) == (2, Status.FORCE_STALE)
    assert (feedforward.force, feedforward.limited) == (2.0, Limited.CLAMP)
    assert statistics.take_newest() == []
    statistics.on_estimates([(NO_ESTIMATE, 1)])
    assert [answer.status for answer in statistics.take_newest()] == [0]


GOOD = GraphFindings(dict.fromkeys(INPUTS, 1), [], [], {})


def reported(lateness: list[int]) -> tuple[DiagnosticStatus, EstimatorDiagnostics]:
    """Report of a second whose velocities came so long [ms] after they were sent."""
    diagnostics = EstimatorDiagnostics()
    for number, late in enumerate(lateness):
        diagnostics.on_inputs('rod_velocity', [(number * PERIOD, late * PERIOD)])
        diagnostics.on_estimates([(NO_ESTIMATE._replace(stamp=number * PERIOD), 1000)])
    return diagnostics.report(True, False, GOOD), diagnostics


@pytest.mark.parametrize(
    ('lateness', 'level', 'begins'),
    [
        ([0, 50, 0], DiagnosticStatus.OK, 'estimating'),
        ([0, 51, 0], DiagnosticStatus.WARN, 'rod_velocity comes up to 51 ms late: this node is too slow'),
        ([9999], DiagnosticStatus.WARN, 'rod_velocity comes up to 9999 ms late'),
        ([0, -49, 0], DiagnosticStatus.OK, 'estimating'),
        ([0, -51, 20], DiagnosticStatus.WARN, 'the clock of the publisher of rod_velocity differs by 0.051 s'),
        ([10001], DiagnosticStatus.WARN, 'the clock of the publisher of rod_velocity differs by -10.001 s'),
    ],
)
def test_an_input_that_comes_late_and_a_clock_that_differs_are_a_warning(lateness, level, begins):
    report, _ = reported(lateness)
    assert (report.level, report.message[: len(begins)]) == (level, begins)


def test_the_latest_of_each_input_is_in_the_values_until_the_next_report():
    report, diagnostics = reported([0, 70, 20])
    values = {value.key: value.value for value in report.values}
    assert values['rod_velocity late [ms]'] == '70.0'
    assert values['force_sum late [ms]'] == '0.0'
    diagnostics.start_interval()
    later = diagnostics.report(True, False, GOOD)
    assert {value.key: value.value for value in later.values}['rod_velocity late [ms]'] == '0.0'


@pytest.mark.parametrize('times', [[], [0], [7, 7, 7]])
def test_simulated_time_that_stands_still_is_an_error_after_a_second_without_news(times, monkeypatch):
    clock = 0.0
    monkeypatch.setattr('time.monotonic', lambda: clock)
    diagnostics = EstimatorDiagnostics([*INPUTS, CLOCK_TOPIC])
    watched = GraphFindings(dict.fromkeys([*INPUTS, CLOCK_TOPIC], 1), [], [], {})
    for stamp in times:
        diagnostics.on_inputs(CLOCK_TOPIC, [(stamp, 0)])
    clock = 1.0
    diagnostics.start_interval()
    diagnostics.on_estimates([(NO_ESTIMATE, 1000)])
    for stamp in times[-1:]:
        diagnostics.on_inputs(CLOCK_TOPIC, [(stamp, 0)])
    clock = 2.0
    report = diagnostics.report(True, False, watched)
    assert report.level == DiagnosticStatus.ERROR
    assert report.message.startswith('simulated time stands still')
    diagnostics.on_inputs(CLOCK_TOPIC, [(8, 0)])
    assert 'stands still' not in diagnostics.report(True, False, watched).message
