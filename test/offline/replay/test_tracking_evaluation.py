"""Tracking from a bag: runs of known error and known rest, gaps, changes of configuration, and a simulated loop."""

import dataclasses
import json
import math

import numpy as np
import pytest
from harness.closed_loop_bags import write_closed_loop
from harness.compensation import compensating
from harness.example_bags import rewrite

from seal_friction_ros.core.estimation.configuration import first_snapshot, snapshot_text
from seal_friction_ros.core.estimation.estimator import EstimatorSettings
from seal_friction_ros.core.friction.states import FrictionState
from seal_friction_ros.core.messages.layouts import CONFIGURATION_TYPE, FEEDFORWARD_TYPE
from seal_friction_ros.core.servo.motions import Chirp, Sine
from seal_friction_ros.offline.bags.recorded_run import RecordedRun, read_run
from seal_friction_ros.offline.replay.replay import replay
from seal_friction_ros.offline.replay.run_findings import raised
from seal_friction_ros.offline.replay.tracking_evaluation import (
    MIN_SAMPLES,
    SETTLING_TIME,
    configuration_stretches,
    evaluate_tracking,
    periodicity,
    tracking_numbers,
)
from seal_friction_ros.offline.reports.figure_style import house_style
from seal_friction_ros.offline.reports.tracking_figures import shown_part, tracking_plots, tracking_summary

RATE = 1000  # [Hz]
PERIOD = 0.2  # [s]
AMPLITUDE = 0.001  # [m]
SETTLED = 0.2 + SETTLING_TIME  # [s] with the default fade_time
TEXTS = {scale: snapshot_text(first_snapshot(compensating(scale=scale))) for scale in (0.0, 0.5, 0.9)}


def recorded_run(seconds=2.0, scales=(), **columns) -> RecordedRun:
    """A run on a sine that is tracked without error, in sliding, but for what ``columns`` say."""
    time = np.arange(round(seconds * RATE)) / RATE
    n = len(time)
    reference = AMPLITUDE * np.sin(2.0 * math.pi * time / PERIOD)
    rows = tuple(round(i * n / max(len(scales), 1)) for i in range(len(scales)))
    values = {
        'time': time,
        'velocity': 2.0 * math.pi * AMPLITUDE / PERIOD * np.cos(2.0 * math.pi * time / PERIOD),
        'reference': reference,
        'position': reference,
        'state': np.full(n, int(FrictionState.SLIDING)),
        'feedforward_force': np.full(n, math.nan),
        'replayed_force': None,
        **columns,
    }
    others = {f.name: np.zeros(n) for f in dataclasses.fields(RecordedRun) if f.name not in values}
    known = {
        'name': 'run',
        'topics': {},
        'frames': (),
        'chambers': ('a', 'b'),
        'start': 0,
        'configurations': tuple((row / RATE, TEXTS.get(scale, scale)) for row, scale in zip(rows, scales, strict=True)),
        'configuration_rows': rows,
    }
    return RecordedRun(**{**others, **values, **known})


def resting_velocity(n, rest):
    """Half a period one way, half the other, each with ``rest`` samples at rest before it turns round."""
    half = round(PERIOD * RATE) // 2
    stroke = np.concatenate((np.ones(half - rest), np.zeros(rest)))
    return np.resize(0.02 * np.concatenate((stroke, -stroke)), n)


def test_known_error_and_rest_are_found():
    run = recorded_run()
    error = 20e-6 * np.sign(np.sin(2.0 * math.pi * run.time / PERIOD + 0.1))
    state = np.where(np.arange(2000) % 100 < 25, int(FrictionState.STUCK), int(FrictionState.SLIDING))
    velocity = resting_velocity(2000, 30)
    (stretch,) = evaluate_tracking(
        recorded_run(position=run.reference - error, velocity=velocity, state=state)
    ).stretches
    assert stretch.rms == pytest.approx(20e-6)
    assert stretch.peak == pytest.approx(20e-6)
    assert stretch.dwell == pytest.approx(0.030)
    assert stretch.reversals == 12 - 1
    assert stretch.amplitude == pytest.approx(AMPLITUDE)
    assert stretch.period == pytest.approx(PERIOD, rel=1e-6)
    assert stretch.not_sliding == pytest.approx(0.25)
    assert stretch.samples == pytest.approx(6 * PERIOD * RATE)  # 1.3 s are left, in which there are six whole periods
    # The reference is at most at the stick velocity for so long around each turning point.
    slow = math.asin(stretch.standstill * PERIOD / (2.0 * math.pi * AMPLITUDE)) * PERIOD / math.pi
    assert stretch.reference_dwell == pytest.approx(slow, abs=1.0 / RATE)


def test_standstill_is_the_stick_velocity_of_the_configuration():
    configuration = dataclasses.replace(compensating(scale=0.0), settings=EstimatorSettings(stick_velocity=0.0005))
    velocity = np.where(resting_velocity(2000, 30) == 0.0, 0.0007, resting_velocity(2000, 30))
    (still,) = evaluate_tracking(recorded_run(velocity=velocity)).stretches
    text = snapshot_text(first_snapshot(configuration))
    (creeping,) = evaluate_tracking(recorded_run(velocity=velocity, scales=(text,))).stretches
    assert still.dwell == pytest.approx(0.030)
    assert (creeping.standstill, creeping.dwell) == (0.0005, 0.0)


def test_the_start_is_left_out():
    position = recorded_run().reference.copy()
    position[: round(SETTLED * RATE)] += 1.0
    (stretch,) = evaluate_tracking(recorded_run(position=position)).stretches
    assert stretch.peak == 0.0
    assert stretch.start == pytest.approx(SETTLED)
    position[round(SETTLED * RATE)] += 1.0
    (stretch,) = evaluate_tracking(recorded_run(position=position)).stretches
    assert stretch.peak == pytest.approx(1.0)


def test_stretches_are_compared_with_the_first_one_without_feedforward():
    n = 6000
    error = np.repeat([100e-6, 40e-6, 150e-6], n // 3)
    force = np.repeat([0.0, 30.0, 60.0], n // 3)
    velocity = np.concatenate([resting_velocity(n // 3, rest) for rest in (40, 10, 0)])
    run = recorded_run(6.0, (0.0, 0.5, 0.9), feedforward_force=force, velocity=velocity)
    found = evaluate_tracking(dataclasses.replace(run, position=run.reference - error))
    first, second, third = found.stretches
    assert [s.settings.scale for s in found.stretches] == [0.0, 0.5, 0.9]
    assert (first.rms_change, first.dwell_change) == (None, None)
    assert second.rms_change == pytest.approx(-60.0)
    assert second.dwell_change == pytest.approx(-75.0)
    assert third.rms_change == pytest.approx(50.0)
    assert third.dwell_change == pytest.approx(-100.0)
    assert found.without is first
    assert found.compensated is third
    assert [s.feedforward_peak for s in found.stretches] == [0.0, 30.0, 60.0]
    assert [s.start for s in found.stretches] == pytest.approx([SETTLED, 2.0 + SETTLED, 4.0 + SETTLED])
    assert found.notes == ()


@pytest.mark.parametrize(('change', 'scatter', 'is_told'), [(5.0, 0.0, 0), (20.0, 0.0, 1), (20.0, 0.6, 0)])
def test_a_rise_of_the_error_is_told_above_10_percent_and_its_noise(change: float, scatter: float, is_told: int):
    """Of a feed-forward with errors of known mean, which scatter from period to period; with other settings never."""
    periods = np.repeat(1.0 + scatter * np.random.default_rng(1).uniform(-1.0, 1.0, 20), round(PERIOD * RATE))
    error = 1e-4 * periods * np.repeat([1.0, 1.0 + 0.01 * change], 2000)
    run = recorded_run(4.0, (0.0, 0.9), feedforward_force=np.repeat([0.0, 30.0], 2000))
    found = evaluate_tracking(dataclasses.replace(run, position=run.reference - error))
    assert len(list(raised(found))) == len(list(raised(found, found.compensated.settings))) == is_told
    assert not list(raised(found, found.without.settings))


def test_another_reference_is_not_compared_and_said():
    run = recorded_run(4.0, (0.0, 0.9), feedforward_force=np.repeat([0.0, 30.0], 2000))
    reference = np.concatenate((run.reference[:2000], 2.0 * run.reference[2000:]))
    found = evaluate_tracking(dataclasses.replace(run, reference=reference, position=reference - 1e-5))
    assert [s.rms_change for s in found.stretches] == [None, None]
    assert 'differs from the reference' in found.notes[0]


def test_an_equal_configuration_published_again_makes_no_stretch():
    run = recorded_run(4.0, (0.0, 0.0, 0.9, 0.9))
    assert [(first, end) for first, end, _ in configuration_stretches(run)] == [(0, 2000), (2000, 4000)]


def test_a_configuration_that_is_not_understood_leaves_the_settings_open():
    found = evaluate_tracking(recorded_run(4.0, ('{"version": 99}', 0.9)))
    assert [s.settings is None for s in found.stretches] == [True, False]
    assert found.stretches[0].standstill == EstimatorSettings().stick_velocity


def test_a_rod_that_does_not_turn_round_has_no_dwell():
    n = 2000
    ramp = np.linspace(0.0, 0.01, n)
    (stretch,) = evaluate_tracking(
        recorded_run(reference=ramp, position=ramp - 1e-5, velocity=np.full(n, 0.005))
    ).stretches
    assert (stretch.reversals, stretch.dwell, stretch.reference_dwell, stretch.period) == (0, None, None, None)
    assert stretch.rms == pytest.approx(1e-5)


@pytest.mark.parametrize('column', ['reference', 'position'])
def test_without_reference_or_position_there_is_no_tracking(column):
    run = recorded_run(**{column: np.full(2000, math.nan)})
    assert evaluate_tracking(run) is None
    assert tracking_numbers(None) == []


def test_what_is_missing_or_lost_does_not_count():
    run = recorded_run(4.0)
    position, velocity = run.position - 1e-5, resting_velocity(4000, 30)
    position[3000:] = math.nan
    velocity[::7] = math.nan
    lost = np.arange(4000) % 10 != 3
    columns = {'reference': run.reference, 'position': position, 'velocity': velocity, 'time': run.time}
    run = recorded_run(4.0, **columns)
    kept = {
        f.name: getattr(run, f.name)[lost]
        for f in dataclasses.fields(run)
        if isinstance(getattr(run, f.name), np.ndarray)
    }
    (stretch,) = evaluate_tracking(dataclasses.replace(run, **kept)).stretches
    assert stretch.rms == pytest.approx(1e-5)
    assert stretch.end < 3.0
    assert stretch.dwell == pytest.approx(0.030, abs=0.002)
    json.dumps(tracking_numbers(evaluate_tracking(run)), allow_nan=False)


def test_the_longest_part_between_gaps_counts():
    run = recorded_run(4.0)
    time = run.time.copy()
    time[1500:] += 10.0  # [s] nothing was recorded
    (stretch,) = evaluate_tracking(dataclasses.replace(run, time=time)).stretches
    assert stretch.start == pytest.approx(11.5 + SETTLED)


@pytest.mark.parametrize('samples', [1, 2, round(SETTLED * RATE) + MIN_SAMPLES - 1])
def test_a_stretch_that_is_too_short_is_said(samples):
    found = evaluate_tracking(recorded_run(samples / RATE))
    assert found.stretches == ()
    assert 'too short' in found.notes[0]
    assert found.without is None
    assert found.compensated is None


def test_stamps_that_stand_still_or_go_back_are_survived():
    run = recorded_run()
    assert evaluate_tracking(dataclasses.replace(run, time=np.zeros(2000))).stretches == ()
    back = np.concatenate((run.time[:1000], run.time[:1000]))
    (stretch,) = evaluate_tracking(dataclasses.replace(run, time=back)).stretches
    assert 0 < stretch.samples < 1000


@pytest.mark.renders
@pytest.mark.parametrize('scales', [(), (0.0,), (0.0, 0.9)])
@pytest.mark.parametrize('still', [False, True])
def test_every_run_with_tracking_can_be_drawn(scales, still):
    run = recorded_run(4.0, scales, feedforward_force=np.repeat([0.0, 30.0], 2000))
    if still:
        nothing = np.zeros(4000)
        state = np.full(4000, int(FrictionState.STUCK))
        run = dataclasses.replace(run, reference=nothing, position=nothing, velocity=nothing, state=state)
    found = evaluate_tracking(run)
    with house_style():
        plots = tracking_plots(run, found)
        for plot in plots:
            plot.figure.draw_without_rendering()
    assert [plot.name for plot in plots] == ['tracking', 'friction_and_feedforward']
    for plot in plots:
        assert len({ax.get_title('left') for ax in plot.figure.axes} & {'Without feed-forward'}) == (len(scales) == 2)
        assert all('[' in ax.get_ylabel() for ax in plot.figure.axes[:: len(found.stretches)])


def test_the_same_periods_are_shown_from_the_same_phase():
    run = recorded_run(6.05, (0.0, 0.9), feedforward_force=np.repeat([0.0, 30.0], 3025))
    parts = [shown_part(run, stretch) for stretch in evaluate_tracking(run).stretches]
    assert [part.stop - part.start for part in parts] == pytest.approx([601, 601], abs=1)
    one, other = (run.reference[part][:600] for part in parts)
    assert np.abs(one - other).max() < 0.05 * AMPLITUDE


@pytest.mark.parametrize('frequency', [0.7, 5.0, 37.0])
def test_the_period_of_a_sine_is_found(frequency):
    time = np.arange(8000) / RATE
    found = periodicity(time, 0.3 + AMPLITUDE * np.sin(2.0 * math.pi * frequency * time + 1.0))
    assert found.period == pytest.approx(1.0 / frequency, rel=1e-3)


@pytest.mark.parametrize(
    'values',
    [
        [Chirp(duration=4.0).at(i / RATE).position for i in range(4000)],
        np.zeros(4000),
        np.linspace(0.0, 1.0, 4000),
        np.random.default_rng(1).normal(size=4000),
        np.sin(np.arange(4000) / 400.0),
    ],
    ids=['chirp', 'constant', 'ramp', 'noise', 'one and a half periods'],
)
def test_a_signal_that_does_not_repeat_has_no_period(values):
    assert periodicity(np.arange(4000) / RATE, np.asarray(values)) is None


@pytest.fixture(scope='module')
def closed_loop(tmp_path_factory):
    return evaluate_tracking(read_run(write_closed_loop(tmp_path_factory.mktemp('bag') / 'closed_loop')))


def test_the_simulated_servo_rests_at_each_reversal_without_feedforward(closed_loop):
    without = closed_loop.without
    assert without.dwell > 0.05 / Sine().frequency
    assert without.period == pytest.approx(1.0 / Sine().frequency, rel=1e-6)
    assert without.reference_dwell < 0.02 / Sine().frequency
    assert without.settings.scale == 0.0


def test_feedforward_cuts_its_error_by_60_and_its_dwell_by_80_percent(closed_loop):
    compensated = closed_loop.compensated
    assert compensated.rms_change < -60.0
    assert compensated.dwell_change < -80.0
    assert compensated.feedforward_peak == pytest.approx(38.5, abs=0.5)


# -- a replay ---------------------------------------------------------------------------------------------------------


def replayed_run(tmp_path, configuration, scales=(0.0, 0.9), **kept) -> RecordedRun:
    """Run of a replayed bag of a closed loop; ``kept`` says which topics of the recording it is made from."""
    bag = write_closed_loop(tmp_path / 'recorded', scales)
    if kept:
        keep = kept['keep']
        bag = rewrite(bag, tmp_path / 'partly', lambda _, message: message if keep(message) else None)
    replay(bag, configuration, tmp_path / 'replayed')
    return read_run(tmp_path / 'replayed')


def test_what_acted_is_what_was_recorded(tmp_path):
    run = replayed_run(tmp_path, compensating(scale=0.9), scales=(0.0,))
    assert np.nanmax(np.abs(run.replayed_force)) > 30.0
    found = evaluate_tracking(run)
    (stretch,) = found.stretches
    assert (stretch.has_feedforward, stretch.feedforward_peak, stretch.settings.scale) == (False, 0.0, 0.0)
    assert tracking_summary(found).endswith('RMS, without feed-forward')
    assert 'did not act' in found.notes[0]
    recorded = evaluate_tracking(read_run(tmp_path / 'recorded'))
    assert (stretch.rms, stretch.dwell) == (recorded.stretches[0].rms, recorded.stretches[0].dwell)


@pytest.mark.long
def test_a_replay_without_feedforward_keeps_that_of_the_recording_also_when_replayed_again(tmp_path):
    one = evaluate_tracking(replayed_run(tmp_path, compensating(scale=0.0)))
    recorded = evaluate_tracking(read_run(tmp_path / 'recorded'))
    assert one.stretches == recorded.stretches
    assert [stretch.settings.scale for stretch in one.stretches] == [0.0, 0.9]
    replay(tmp_path / 'replayed', compensating(scale=0.5), tmp_path / 'again')
    again = read_run(tmp_path / 'again')
    assert evaluate_tracking(again).stretches == recorded.stretches
    assert np.nanmax(np.abs(again.replayed_force)) > 10.0


@pytest.mark.parametrize(
    ('missing', 'scales', 'acted'),
    [
        ((FEEDFORWARD_TYPE,), (0.9,), None),
        ((FEEDFORWARD_TYPE,), (0.0,), False),
        ((FEEDFORWARD_TYPE, CONFIGURATION_TYPE), (0.0,), None),
        ((CONFIGURATION_TYPE,), (0.9,), True),
    ],
)
def test_a_feedforward_that_was_not_recorded_is_not_known(tmp_path, missing, scales, acted):
    run = replayed_run(tmp_path, compensating(scale=0.9), scales, keep=lambda message: message.type_name not in missing)
    found = evaluate_tracking(run)
    (stretch,) = found.stretches
    assert stretch.has_feedforward is acted
    assert ('feed-forward that acted: not known' in tracking_summary(found)) is (acted is None)
    json.dumps(tracking_numbers(found), allow_nan=False)
    replay(
        tmp_path / 'replayed', compensating(scale=0.5), tmp_path / 'again'
    )  # a replayed one never becomes one that acted
    assert evaluate_tracking(read_run(tmp_path / 'again')).stretches == found.stretches
    with house_style():
        figures = {plot.name: plot.figure for plot in tracking_plots(run, found)}
    labels = [line.get_label() for axes in figures['friction_and_feedforward'].axes for line in axes.lines]
    assert 'replayed, did not act' in labels
