"""Closed loop, performance, and search for the feed-forward of a simulated axis."""

import dataclasses
import itertools
import math
from functools import cache

import numpy as np
import pytest
import yaml
from harness.compensation import COMPENSATING
from paths import ROOT

from seal_friction_ros.core.estimation.estimator import EstimatorParameters, EstimatorSettings
from seal_friction_ros.core.estimation.feedforward import FeedForwardSettings
from seal_friction_ros.core.estimation.pipeline import PipelineParameters
from seal_friction_ros.core.friction.actuator import MountedSeal, actuator_friction
from seal_friction_ros.core.friction.seal_file import parse_seal
from seal_friction_ros.core.servo.closed_loop import (
    Axis,
    AxisRun,
    Performance,
    StoppedWave,
    dwell,
    run_closed_loop,
    with_wrong_friction,
    without_feedforward,
)
from seal_friction_ros.core.servo.motions import Setpoint, Sine
from seal_friction_ros.core.servo.position_servo import ServoParameters, init, simulate
from seal_friction_ros.core.tuning import simulated_axis
from seal_friction_ros.core.tuning.settings import RobustnessCase, TuningSettings
from seal_friction_ros.core.tuning.simulated_axis import (
    MOST_CANDIDATES,
    NEARLY_AS_GOOD,
    SearchPoint,
    TuningProblem,
    bounded,
    force_limit,
    merit,
    nearest_preferred,
    preferred,
    tune,
)

SEAL = parse_seal(yaml.safe_load((ROOT / 'config/seals/ms28775_114.yaml').read_text()))
SEALS = (MountedSeal(SEAL, 'a'), MountedSeal(SEAL, 'b'))
PERIOD = 1e-3  # [s]
SERVO = ServoParameters(seals=SEALS, control_period=PERIOD, inner_step=1e-4)
PIPELINE = PipelineParameters(EstimatorParameters(EstimatorSettings(), SEALS), COMPENSATING)
AXIS = Axis(SERVO, PIPELINE)
DEFAULT = TuningProblem(AXIS, TuningSettings(hold_time=0.2))
SLOW_PERIOD = 2e-3  # [s]
# Small and fast: a whole search takes seconds. Without feed-forward the rod does not move.
SLOW_AXIS = AXIS._replace(servo=dataclasses.replace(SERVO, control_period=SLOW_PERIOD))
QUICK = TuningProblem(SLOW_AXIS, TuningSettings(amplitude=5e-4, frequency=10.0, delay_error=0.0, hold_time=0.1))


@cache
def case(friction_error=0.0, delay_error=0.0):
    """The axis with the default feed-forward on the wave of Figure 25."""
    return DEFAULT.case(PIPELINE.feedforward, friction_error, delay_error, 0.2).outcome


@cache
def without():
    return DEFAULT.without()


@cache
def found():
    return tune(QUICK)


# -- the loop ---------------------------------------------------------------------------------------------------------


def test_loop_without_feedforward_is_the_servo_alone():
    none = PIPELINE._replace(feedforward=without_feedforward(PIPELINE.feedforward))
    run = run_closed_loop(Axis(SERVO, none), Sine(), 300, 1e-3)
    _, alone = simulate(SERVO, init(SERVO), [Sine().at(i * PERIOD) for i in range(300)])
    np.testing.assert_array_equal(run.position, alone.position)
    np.testing.assert_array_equal(run.velocity, alone.velocity)
    assert not run.feedforward.any()


def test_run_is_stamped_at_the_end_of_each_sample():
    run = run_closed_loop(AXIS, Sine(), 20, 1e-3)
    np.testing.assert_allclose(run.time, np.arange(1, 21) * PERIOD)
    np.testing.assert_allclose(run.reference, [Sine().at(time).position for time in run.time])


@pytest.mark.parametrize(('delay', 'weights'), [(0.002, (0, 0, 1)), (0.0025, (0, 0, 0.5, 0.5)), (0.0007, (0.3, 0.7))])
def test_force_arrives_a_delay_later(delay, weights):
    now = run_closed_loop(AXIS, Sine(), 200, 0.0).feedforward
    late = run_closed_loop(AXIS, Sine(), 200, delay).feedforward
    expected = sum(weight * np.concatenate((np.zeros(i), now))[:200] for i, weight in enumerate(weights))
    np.testing.assert_allclose(late, expected, atol=0.2)  # [N]: the pressure, and so the friction, is a little other
    assert np.abs(now).max() > 35.0


def test_noise_reaches_the_estimator_and_not_the_servo():
    pressure = np.tile([1e6, 1e6, 0.0, 0.0], (7, 1))
    sure, unsure = run_closed_loop(AXIS, Sine(), 100, 1e-3), run_closed_loop(AXIS, Sine(), 100, 1e-3, pressure)
    assert unsure.feedforward.max() > 1.05 * sure.feedforward.max()
    none = Axis(SERVO, PIPELINE._replace(feedforward=without_feedforward(PIPELINE.feedforward)))
    sure, unsure = run_closed_loop(none, Sine(), 100, 1e-3), run_closed_loop(none, Sine(), 100, 1e-3, pressure)
    np.testing.assert_array_equal(sure.position, unsure.position)


def test_wrong_friction_is_wrong_in_the_model_alone():
    wrong = with_wrong_friction(PIPELINE, 0.3)
    right, scaled = (actuator_friction(p.estimator.seals, 2e6, 3e6) for p in (PIPELINE, wrong))
    assert scaled.coulomb_friction == pytest.approx(1.3 * right.coulomb_friction)
    assert scaled.stiction == pytest.approx(1.3 * right.stiction)
    run = run_closed_loop(Axis(SERVO, wrong), Sine(), 60, 1e-3)
    assert np.abs(run.friction_force).max() < 1.15 * right.coulomb_friction * 1.1
    assert run.feedforward.max() == pytest.approx(
        1.3 * run_closed_loop(AXIS, Sine(), 60, 1e-3).feedforward.max(), rel=0.01
    )


def test_stopped_wave_stands_where_it_was():
    wave = StoppedWave(Sine(), 0.15)
    assert wave.at(0.1) == Sine().at(0.1)
    assert wave.at(7.0) == Setpoint(Sine().at(0.15).position)
    assert Sine().at(0.15).velocity == pytest.approx(0.0, abs=1e-9)


def test_dwell_counts_all_rest_and_a_rod_that_never_moves_in_full():
    assert dwell(np.zeros(100), 0.01, 4) == pytest.approx(0.25)
    assert dwell(np.array([1.0, 0.0, 0.0, 1.0, 0.0, -1.0]), 0.1, 1) == pytest.approx(0.3)
    assert dwell(np.array([1.0, -1.0, 1.0]), 0.1, 2) == 0.0


def test_whole_delay_adds_force_loop_and_valve():
    assert DEFAULT.whole_delay == pytest.approx(0.001 + 1.0 / 500.0 + 2.0 * 0.8 / 1257.0 + 0.5 * PERIOD)


# -- the default feed-forward ----------------------------------------------------------------------------------------


def test_figure_25_dwell_is_above_5_percent_of_the_period_with_friction_and_none_without():
    assert without().dwell > 0.05 * 0.2
    free = TuningProblem(
        Axis(ServoParameters(seals=(), control_period=PERIOD), PIPELINE), TuningSettings(hold_time=0.2)
    )
    assert free.without().dwell == 0.0
    assert free.without().tracking_rms < 0.1 * without().tracking_rms


def test_default_feedforward_cuts_tracking_rms_by_60_and_dwell_by_80_percent():
    assert case().tracking_rms <= 0.4 * without().tracking_rms
    assert case().dwell <= 0.2 * without().dwell


@pytest.mark.parametrize('friction_error', [-0.3, 0.3])
@pytest.mark.parametrize('delay_error', [-0.2, 0.0, 0.2])
def test_default_feedforward_with_a_wrong_model_is_better_than_none_and_does_not_limit_cycle(
    friction_error, delay_error
):
    wrong = case(friction_error, delay_error)
    assert wrong.tracking_rms < 0.5 * without().tracking_rms
    assert wrong.dwell < 0.6 * without().dwell
    assert wrong.limit_cycle_reversals == 0


def test_limit_cycle_is_seen():
    """From the rod's own velocity, too large a force closes a loop that never comes to rest."""
    looped = dataclasses.replace(PIPELINE.feedforward, use_measured_velocity=True, scale=2.0)
    cycling = DEFAULT.case(looped, 0.3, 0.0, 0.2)
    assert cycling.outcome.limit_cycle_reversals > 5
    nominal = RobustnessCase(0.0, 0.0, case())
    assert merit(DEFAULT, without(), [nominal, cycling]) == math.inf


def test_overshoot_grows_with_a_feedforward_that_is_too_large():
    assert case().overshoot == 0.0
    assert case(0.3).overshoot > 30e-6


# -- the search -------------------------------------------------------------------------------------------------------


def test_merit_is_1_without_and_falls_with_error_and_dwell():
    was = Performance(4e-4, 5e-4, 0.04, 0.0, 0, 0.0, 0.0)
    assert merit(DEFAULT, was, [RobustnessCase(0.0, 0.0, was)]) == 1.0
    half = was._replace(tracking_rms=2e-4)
    assert merit(DEFAULT, was, [RobustnessCase(0.0, 0.0, half)]) == 0.75
    assert merit(DEFAULT, was, [RobustnessCase(0.0, 0.0, half), RobustnessCase(0.3, 0.0, was)]) == 0.875


@pytest.mark.parametrize('flaw', [{'overshoot': 1.01e-4}, {'limit_cycle_reversals': 1}])
def test_overshoot_beyond_the_limit_and_limit_cycles_are_out(flaw):
    was = Performance(4e-4, 5e-4, 0.04, 0.0, 0, 0.0, 0.0)
    good = RobustnessCase(0.0, 0.0, was._replace(tracking_rms=1e-6, dwell=0.0, overshoot=0.99e-4))
    assert merit(DEFAULT, was, [good]) < 0.01
    assert merit(DEFAULT, was, [good, RobustnessCase(0.3, 0.0, was._replace(**flaw))]) == math.inf


def test_axis_that_never_dwells_has_a_merit():
    was = Performance(4e-4, 5e-4, 0.0, 0.0, 0, 0.0, 0.0)
    assert merit(DEFAULT, was, [RobustnessCase(0.0, 0.0, was)]) == 0.5


def test_rod_that_does_not_move_without_feedforward_dwells_for_the_half_period():
    assert found().without.dwell == pytest.approx(0.05)
    assert found().without.tracking_rms == pytest.approx(5e-4 / math.sqrt(2.0), rel=1e-2)


def test_the_result_is_better_than_none_and_than_the_default_in_the_worst_case():
    assert found().better_in_every_case
    default = [QUICK.case(PIPELINE.feedforward, *errors, 0.1) for errors in QUICK.errors()]
    assert found().merit < NEARLY_AS_GOOD * merit(QUICK, found().without, default)
    assert found().nominal.tracking_rms <= 0.4 * found().without.tracking_rms
    assert found().nominal.dwell <= 0.2 * found().without.dwell
    assert found().candidates <= MOST_CANDIDATES


def test_the_result_keeps_the_overshoot_and_does_not_limit_cycle():
    worst = max(c.outcome.overshoot for c in found().cases)
    assert worst <= 0.05 * 2.0 * 5e-4
    assert all(c.outcome.limit_cycle_reversals == 0 for c in found().cases)


def test_a_search_in_which_every_point_is_rejected_ends(monkeypatch):
    monkeypatch.setattr(simulated_axis, 'merit', lambda *_: math.inf)
    monkeypatch.setattr(simulated_axis, 'MOST_CANDIDATES', 2)
    counted = []
    result = tune(QUICK, counted.append)
    assert result.merit == math.inf
    assert counted == [1, 1]
    assert result.candidates == 2


OUTCOME = Performance(1.0, 1.0, 1.0, 0.0, 0, 0.0, 0.0)


def friction_of(*forces):
    """Runs with these frictions [N]."""
    return tuple(AxisRun(*(np.array(values),) * 6) for values in forces)


def searched(monkeypatch, value):
    """Result of a search whose J is ``value`` of the settings, and the settings that were tried, in order."""
    tried = []

    def case(_, feedforward, friction_error, delay_error, __):
        tried.append(feedforward)
        return RobustnessCase(friction_error, delay_error, None)

    monkeypatch.setattr(TuningProblem, 'case', case)
    monkeypatch.setattr(TuningProblem, 'without', lambda _: OUTCOME)
    monkeypatch.setattr(TuningProblem, 'runs', lambda *_: friction_of([100.0]))  # a limit of 150 N, as it was
    monkeypatch.setattr(simulated_axis, 'merit', lambda *_: value(tried[-1], tried[0]))
    return tune(DEFAULT).feedforward, list(dict.fromkeys(tried))


def widths(settings):
    """Smoothing and slew limit as numbers of steps."""
    return nearest_preferred(settings.smoothing_velocity), nearest_preferred(settings.slew_limit)


def test_the_search_starts_from_none_and_from_a_third_to_more_than_all_of_the_friction_up_to_twice_the_delay_ahead(
    monkeypatch,
):
    _, tried = searched(monkeypatch, lambda *_: 1.0)
    settings = tried[:13]
    assert [s.lead_time for s in settings if s.scale == 0.0] == [0.0]
    for scale in (0.3, 0.6, 0.9, 1.2):
        leads = [s.lead_time for s in settings if s.scale == scale]
        assert leads == pytest.approx([0.0, DEFAULT.whole_delay, 2.0 * DEFAULT.whole_delay], abs=DEFAULT.lead_step)
    assert abs(math.log10(20.0 * DEFAULT.lead_step / DEFAULT.whole_delay)) <= 0.05  # twenty steps to the delay
    change = (10.0 * math.pi) ** 2 * 1e-3 * PERIOD  # of the speed of the sine in one sample
    assert {abs(math.log10(s.smoothing_velocity / (0.5 * change))) <= 0.05 for s in settings} == {True}
    jump = 2.0 * PIPELINE.feedforward.force_limit / PERIOD
    assert {abs(math.log10(s.slew_limit / jump)) <= 0.05 for s in settings} == {True}


def test_a_point_of_the_search_counts_hundredths_of_the_scale_steps_of_lead_and_preferred_numbers():
    settings = DEFAULT.feedforward(SearchPoint(93, 2, -30, 50))
    assert settings.scale == 0.93
    assert settings.lead_time == pytest.approx(2.0 * DEFAULT.lead_step)
    assert (settings.smoothing_velocity, settings.slew_limit) == (1e-3, 1e5)
    assert settings.force_limit == PIPELINE.feedforward.force_limit


@pytest.mark.parametrize('best', [(93, 27), (1, 2), (-7, 31), (47, -3)])
def test_the_search_ends_at_the_best_scale_and_lead_that_are_not_negative(monkeypatch, best):
    def value(s, first):
        scale, lead = 100.0 * s.scale, s.lead_time / DEFAULT.lead_step
        return 1.0 + (scale - best[0]) ** 2 + 2.0 * (lead - best[1]) ** 2 + 1e6 * (widths(s) != widths(first))

    found, tried = searched(monkeypatch, value)
    assert found.scale == pytest.approx(max(best[0], 0) / 100.0)
    assert found.lead_time == pytest.approx(max(best[1], 0) * DEFAULT.lead_step)
    assert widths(found) == widths(tried[0])
    assert min(s.scale for s in tried) >= 0.0
    assert min(s.lead_time for s in tried) >= 0.0


@pytest.mark.parametrize(('of_width', 'wider', 'slower'), [(0.0, 5, 0), (9.0, 0, 2)])
def test_the_gentlest_settings_are_the_widest_and_slowest_that_lose_a_twentieth(monkeypatch, of_width, wider, slower):
    """A step of smoothing costs 0.98 %: five are 4.9 %, and one of the slew limit costs more than is left."""
    lead = round(DEFAULT.whole_delay / DEFAULT.lead_step) * DEFAULT.lead_step

    def value(s, first):
        (smoothing, slew), (sharpest, fastest) = widths(s), widths(first)
        losses = 0.0098 * max(smoothing - sharpest, 0) + 0.02 * max(fastest - slew, 0)
        elsewhere = abs(s.scale - 0.9) + 1e3 * abs(s.lead_time - lead)
        return 2.0 * (1.0 + losses) + of_width * (smoothing != sharpest) + 100.0 * elsewhere

    found, tried = searched(monkeypatch, value)
    assert (found.scale, found.lead_time) == pytest.approx((0.9, lead))
    smoothing, slew = widths(tried[0])
    assert widths(found) == (smoothing + wider, slew - slower)


@pytest.mark.parametrize('error', [0.2, -0.1, -1.0])
def test_an_error_of_the_delay_is_one_of_the_whole_delay_and_comes_in_before_the_controller(error, monkeypatch):
    asked = {}

    def runs(motions, axis, delay, noise):
        asked.update(hold=motions.hold_time, axis=axis, delay=delay, noise=noise)

    monkeypatch.setattr(simulated_axis.EvaluationMotions, 'runs', runs)
    DEFAULT.runs(PIPELINE.feedforward, 0.3, error, 0.7)
    assert asked['delay'] == pytest.approx(max(0.001 + error * DEFAULT.whole_delay, 0.0))
    assert (asked['hold'], asked['noise']) == (0.7, None)
    assert {mounted.friction_scale for mounted in asked['axis'].pipeline.estimator.seals} == {1.3}
    assert asked['axis'].servo is SERVO


def test_a_task_at_the_limit_of_the_servo_is_one_that_it_follows():
    reach = SERVO.gains.reach
    TuningProblem(AXIS, TuningSettings(amplitude=reach, frequency=0.1))
    with pytest.raises(ValueError, match='way'):
        TuningProblem(AXIS, TuningSettings(amplitude=1.001 * reach, frequency=0.1))
    rate = 2.0 * math.pi * 45.0
    for amplitude, frequency, name in (
        (0.01, 0.2 / (2.0 * math.pi * 0.01), 'speed'),
        (50.0 / rate**2, 45.0, 'acceler'),
    ):
        TuningProblem(AXIS, TuningSettings(amplitude=0.999 * amplitude, frequency=frequency))
        with pytest.raises(ValueError, match=name):
            TuningProblem(AXIS, TuningSettings(amplitude=1.001 * amplitude, frequency=frequency))


def test_an_axis_may_overshoot_as_far_as_it_does_without_feed_forward():
    was = Performance(4e-4, 5e-4, 0.04, 3e-4, 2, 0.0, 0.0)
    assert merit(DEFAULT, was, [RobustnessCase(0.0, 0.0, was)]) == 1.0
    for worse in (was._replace(overshoot=3.01e-4), was._replace(limit_cycle_reversals=3)):
        assert merit(DEFAULT, was, [RobustnessCase(0.0, 0.0, worse)]) == math.inf
    straight = was._replace(overshoot=0.0)
    limit = 2.0 * DEFAULT.settings.amplitude * DEFAULT.settings.overshoot_limit
    assert merit(DEFAULT, straight, [RobustnessCase(0.0, 0.0, straight._replace(overshoot=limit))]) == 1.0


def test_a_case_is_nominal_without_any_error_and_a_result_is_better_in_every_case_or_not():
    assert [RobustnessCase(f, d, None).is_nominal for f in (0.0, 0.3) for d in (0.0, 0.2)] == [
        True,
        False,
        False,
        False,
    ]
    was = Performance(4e-4, 5e-4, 0.04, 0.0, 0, 0.0, 0.0)
    good = RobustnessCase(0.0, 0.0, was._replace(tracking_rms=1e-4))
    for others, better in (((), True), ((RobustnessCase(0.3, 0.0, was),), False)):
        result = simulated_axis.Tuning(PIPELINE.feedforward, was, (*others, good), 40.0, 0.5, 1)
        assert result.better_in_every_case is better
        assert result.nominal is good.outcome


def test_cases_are_all_combinations_in_order():
    errors = [case[:2] for case in found().cases]
    assert errors == [(-0.3, 0.0), (0.0, 0.0), (0.3, 0.0)]
    assert set(DEFAULT.errors()) == set(itertools.product((-0.3, 0.0, 0.3), (-0.2, 0.0, 0.2)))
    assert len(DEFAULT.errors()) == 9
    assert DEFAULT.errors()[0] == (0.0, 0.0)


def test_force_is_no_sharper_than_it_must_be():
    sharpest = 0.5 * (2.0 * math.pi * 10.0) ** 2 * 5e-4 * SLOW_PERIOD
    assert found().feedforward.smoothing_velocity > sharpest
    assert found().feedforward.slew_limit < 2.0 * found().feedforward.force_limit / SLOW_PERIOD


def test_other_settings_are_unchanged():
    tuned = {'scale', 'lead_time', 'smoothing_velocity', 'slew_limit', 'force_limit'}
    for field in dataclasses.fields(FeedForwardSettings):
        if field.name not in tuned:
            assert getattr(found().feedforward, field.name) == getattr(PIPELINE.feedforward, field.name)


@pytest.mark.parametrize(
    ('settings', 'text'),
    [
        ({'amplitude': 0.05, 'frequency': 0.1}, 'way 0.05 m'),
        ({'amplitude': 0.02, 'frequency': 5.0}, 'speed'),
        ({'amplitude': 1e-3, 'frequency': 50.0}, 'speed|acceleration'),
    ],
)
def test_motion_that_the_servo_does_not_follow_is_rejected(settings, text):
    with pytest.raises(ValueError, match=text):
        TuningProblem(AXIS, TuningSettings(**settings))


@pytest.mark.parametrize('name', ['amplitude', 'frequency', 'delay', 'friction_error', 'hold_time'])
@pytest.mark.parametrize('value', [-1.0, math.nan, 1e9])
def test_settings_out_of_bounds_are_rejected_by_name(name, value):
    with pytest.raises(ValueError, match=name):
        TuningSettings(**{name: value})


def test_preferred_numbers_are_found_again():
    for index in range(-60, 61):
        assert nearest_preferred(preferred(index)) == index
        assert preferred(index + 10) == pytest.approx(10.0 * preferred(index))


def test_bounds_of_the_settings_are_kept():
    assert bounded('scale', 7.0) == 2.0
    assert bounded('slew_limit', 0.0) == 1e-3
    assert bounded('lead_time', 0.1) == 0.1


@pytest.mark.parametrize(
    ('friction', 'limit'), [(330.0, 500.0), (100.0, 150.0), (1.0, 1.5), (38.5, 58.0), (0.0, 0.001), (1e9, 1e6)]
)
def test_force_limit_is_the_margin_over_the_friction_rounded_up_to_two_digits(friction, limit):
    assert force_limit(friction) == limit


def test_force_limit_of_the_search_is_above_the_force_that_it_found():
    assert found().feedforward.force_limit == force_limit(found().largest_friction)
    assert 38.0 < found().largest_friction < 50.0
    assert found().nominal.largest_force < found().feedforward.force_limit


def test_the_compass_halves_its_stride_down_to_one_step():
    strides = simulated_axis.STRIDES
    assert all(stride == 2 * shorter for stride, shorter in itertools.pairwise(strides))
    assert strides[-1] == 1


def test_a_candidate_that_cannot_be_the_best_is_not_tried_in_every_case(monkeypatch):
    """More cases cannot lower J: a point is known to be worse from the first one that is 5 % above the best so far."""
    cases = []

    def case(self, feedforward, friction_error, delay_error, hold_time):
        cases.append((round(feedforward.scale, 2), friction_error, delay_error, hold_time, feedforward.force_limit))
        return RobustnessCase(friction_error, delay_error, None)

    def merit(problem, without, outcomes):
        scale = cases[-1][0]
        return abs(scale - 0.6) + 0.5 + (0.02 if len(outcomes) > 1 else 0.0)

    asked = []

    def runs(_, settings):
        """Largest friction of six motions, whatever its direction; no limit hides it from the force."""
        asked.append((settings.scale, settings.force_limit))
        return friction_of(*([[3.0, -50.0], [20.0], [1.0]] if settings.scale == 0.0 else [[-7.0], [40.0, 2.0], [0.0]]))

    monkeypatch.setattr(TuningProblem, 'case', case)
    monkeypatch.setattr(TuningProblem, 'runs', runs)
    monkeypatch.setattr(TuningProblem, 'without', lambda _: OUTCOME)
    monkeypatch.setattr(simulated_axis, 'merit', merit)
    counted = []
    result = tune(DEFAULT, counted.append)
    assert result.feedforward.scale == 0.6
    assert result.merit == pytest.approx(0.52)
    assert result.candidates == sum(counted) == len(counted)
    assert result.largest_friction == 50.0
    assert asked == [(0.0, 150.0), (1.0, 1e6)]
    assert {c[4] for c in cases} == {75.0}  # half as large again
    last = cases[-9:]
    assert [c[1:3] for c in last] == list(itertools.product((-0.3, 0.0, 0.3), (-0.2, 0.0, 0.2)))
    assert {c[3] for c in last} == {DEFAULT.settings.hold_time}
    assert {c[3] for c in cases[:-9]} == {0.2}
    tried = [c[0] for c in cases[:-9]]
    assert tried.count(0.0) == 9  # the first is compared with nothing
    assert tried.count(0.3) == 3 * 9  # 0.82 is better than 1.12
    assert tried.count(1.2) == 3  # 1.1 is worse than 0.52 with the first case
