"""The loop of ``make demo`` in core: the feed-forward cuts the tracking error, also with a rounded reference."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest
from harness.compensation import compensating
from paths import ROOT

from seal_friction_ros.core.estimation import pipeline
from seal_friction_ros.core.estimation.adaptation import AdaptationSettings
from seal_friction_ros.core.friction.force_sum_correction import ForceSumCorrection
from seal_friction_ros.core.messages.records import FeedForward, Force, Pressure, ServoReference, Velocity
from seal_friction_ros.core.servo import closed_loop
from seal_friction_ros.core.servo.closed_loop import (
    EVALUATED_PERIODS,
    SETTLING_PERIODS,
    Axis,
    AxisRun,
    AxisSensors,
    EvaluationMotions,
    Performance,
    StoppedWave,
    performance_of,
    run_closed_loop,
    with_wrong_friction,
    without_feedforward,
)
from seal_friction_ros.core.servo.controller import Measurement
from seal_friction_ros.core.servo.cylinder import pressure_force
from seal_friction_ros.core.servo.motions import RoundedWave, Setpoint, Sine, Step, Trapezoid
from seal_friction_ros.core.servo.position_servo import ServoParameters, init, outputs, step
from seal_friction_ros.core.servo.sensors import SensorSettings
from seal_friction_ros.core.servo.tracking import reversals, tracking_rms
from seal_friction_ros.files import read_yaml

SIMULATOR = read_yaml(ROOT / 'config/servo_simulator.yaml')['/**']['ros__parameters']
SENSORS = SensorSettings(**SIMULATOR['sensors'])
PIPELINE = compensating().parameters()
PERIOD = 1e-3  # [s]
SERVO = ServoParameters(seals=PIPELINE.estimator.seals, control_period=PERIOD, inner_step=1e-4)
DELAY = 1e-3  # [s] from a velocity sample to its feed-forward in the controller
SLOW_TIME = 1.0  # [s]
SETTLING_TIME, EVALUATED_TIME = 0.4, 0.8  # [s] whole periods


class SlowAtFirst(NamedTuple):
    """A wave after a slow one, at which the conditioned velocity learns the ripple of a rounded reference."""

    wave: Sine

    def at(self, time):
        return Sine(1e-4, 1.0).at(time) if time < SLOW_TIME else self.wave.at(time - SLOW_TIME)


WAVE = SlowAtFirst(Sine(**SIMULATOR['sine']))


def evaluated(wave, feedforward):
    """The last periods of the loop, with the noise of the sensors of the demo."""
    noise = np.array([SENSORS.pressure_noise] * 2 + [SENSORS.force_noise, SENSORS.velocity_noise])
    axis = Axis(SERVO, PIPELINE._replace(feedforward=feedforward))
    samples = round((SLOW_TIME + SETTLING_TIME + EVALUATED_TIME) / PERIOD)
    errors = noise * np.random.default_rng(SENSORS.seed).standard_normal((samples, 4))
    run = run_closed_loop(axis, wave, samples, DELAY, errors)
    return type(run)(*(values[-round(EVALUATED_TIME / PERIOD) :] for values in run))


@pytest.mark.parametrize('resolution', [0.0, 1e-6, 5e-6])
def test_feedforward_cuts_the_tracking_error_by_80_percent_with_a_rounded_reference_too(resolution):
    wave = RoundedWave(WAVE, resolution, PERIOD) if resolution else WAVE
    settings = PIPELINE.feedforward
    without, compensated = (evaluated(wave, given) for given in (without_feedforward(settings), settings))
    exact = np.array([WAVE.at(time).position for time in without.time])
    error, remaining = (tracking_rms(exact, run.position) for run in (without, compensated))
    assert error > 300e-6  # the friction is worth compensating
    assert remaining < 0.2 * error
    assert reversals(compensated.feedforward) == 2 * round(WAVE.wave.frequency * EVALUATED_TIME)


ADAPTATION = AdaptationSettings('on', moving_mass=SERVO.load.mass)


def adapted_error(friction, adaptation, scale=None, law=1.0, seconds=12.0):
    """Tracking error [m] over two periods: seals of ``friction``, a seal file of ``law`` times the friction."""
    seals = tuple(replace(mounted, friction_scale=friction) for mounted in PIPELINE.estimator.seals)
    servo = ServoParameters(seals=seals, control_period=PERIOD, inner_step=1e-4)
    feedforward = PIPELINE.feedforward if scale is None else replace(PIPELINE.feedforward, scale=scale)
    filed = tuple(replace(mounted, friction_scale=law) for mounted in PIPELINE.estimator.seals)
    estimator = replace(PIPELINE.estimator, seals=filed, adaptation=adaptation)
    known = PIPELINE._replace(estimator=estimator, feedforward=feedforward)
    wave = Trapezoid(distance=0.02, speed=0.04, frequency=0.8, acceleration=1.0, cycles=100)
    noise = np.array([SENSORS.pressure_noise] * 2 + [SENSORS.force_noise, SENSORS.velocity_noise])
    samples = round(seconds / PERIOD)
    errors = noise * np.random.default_rng(1).standard_normal((samples, 4))
    run = run_closed_loop(Axis(servo, known), wave, samples, DELAY, errors)
    last = run.time > seconds - 2.5
    return tracking_rms(run.reference[last], run.position[last])


@pytest.mark.long
def test_with_adaptation_a_seal_of_40_percent_more_friction_tracks_as_with_its_own_file():
    stronger = 1.4
    off = AdaptationSettings()
    right_file = adapted_error(stronger, off, law=stronger)
    without = adapted_error(stronger, off, scale=0.0)
    adapted = adapted_error(stronger, ADAPTATION)
    fixed = adapted_error(stronger, off)
    assert adapted < fixed < without
    assert adapted < 1.2 * right_file


def test_a_stopped_wave_stands_still_from_its_stop_on():
    wave = StoppedWave(Sine(1e-3, 5.0), 0.33)
    assert wave.at(0.329) == wave.wave.at(0.329)
    assert wave.at(0.33) == wave.at(10.0) == Setpoint(wave.wave.at(0.33).position)


MOTIONS = EvaluationMotions(Sine(0.01, 2.0, 0.05), 0.5)


def test_the_sine_stops_at_a_trough_and_the_move_begins_there_and_reaches_its_speed_and_acceleration():
    sine, move = MOTIONS.sine, MOTIONS.move
    assert MOTIONS.stop_time == pytest.approx(6.75 / 2.0)
    assert sine.at(MOTIONS.stop_time)[:2] == pytest.approx((0.04, 0.0), abs=1e-12)
    assert move.at(0.0) == Setpoint(0.04, 0.0, move.acceleration)
    steps = [move.at(i * 1e-3) for i in range(round(move.duration * 1000))]
    one = [sine.at(i * 1e-3) for i in range(500)]
    for field in Setpoint._fields:
        assert max(getattr(s, field) for s in steps) == pytest.approx(max(getattr(s, field) for s in one), rel=1e-3)
    assert move.duration == pytest.approx(1.0)  # half the frequency, once


BEST = Performance(1.0, 5.0, 1.0, 0.0, 3, 0.0, 0.0)


@pytest.mark.parametrize(
    ('change', 'better'),
    [
        ({'tracking_rms': 0.9}, True),
        ({}, False),
        ({'tracking_rms': 0.9, 'dwell': 1.1}, False),
        ({'tracking_rms': 0.9, 'dwell': 0.9}, True),
        ({'tracking_rms': 0.9, 'limit_cycle_reversals': 4}, False),
        ({'tracking_rms': 0.9, 'limit_cycle_reversals': 2, 'tracking_peak': 9.0}, True),
        ({'tracking_rms': 1.1, 'dwell': 0.0, 'limit_cycle_reversals': 0}, False),
    ],
)
def test_better_is_a_smaller_error_without_more_rest_or_more_reversals_at_rest(change, better):
    assert BEST._replace(**change).better_than(BEST) is better


def made_run(seconds, position, velocity=0.0, feedforward=0.0):
    time = PERIOD * np.arange(1, round(seconds / PERIOD) + 1)
    parts = [np.broadcast_to(values, time.shape) for values in (position(time), velocity, 0.0, feedforward)]
    return AxisRun(time, np.full_like(time, 0.05), *parts)


def test_performance_is_error_rest_overshoot_limit_cycle_and_force():
    flicker = np.where(np.arange(1000) % 2, 1e-3, -1e-3)
    sine = made_run(4.0, lambda t: 0.05 + 2e-3 * np.where(t > 1.0, 1.0, 7.0))  # the settling does not count
    sine = sine._replace(velocity=np.where(sine.time <= 1.2, 0.0, 1.0), feedforward=np.full(4000, -7.0))
    move = made_run(1.0, lambda t: 0.05 - 0.013 * t)._replace(velocity=flicker)
    force = np.concatenate([np.zeros(500), np.full(500, 5.0)])
    step = made_run(1.0, lambda t: 0.05 + 0.0 * t)._replace(feedforward=force)
    found = performance_of(PERIOD, MOTIONS, (sine, move, step))
    assert (found.tracking_rms, found.tracking_peak) == pytest.approx((2e-3, 2e-3))
    assert found.dwell == pytest.approx(0.2 / 8)  # of two seconds evaluated, with eight reversals
    assert found.overshoot == pytest.approx(0.003)
    assert found.limit_cycle_reversals == 499  # in the half second of the hold
    assert (found.largest_force, found.largest_force_rate) == pytest.approx((7.0, 7.0 / PERIOD))
    small = move._replace(position=np.full(1000, 0.055))
    assert performance_of(PERIOD, MOTIONS, (sine, small, step)).overshoot == 0.0


def test_the_evaluated_part_is_whole_periods_of_the_sine():
    time = PERIOD * np.arange(1, 20_001)
    part = EvaluationMotions(Sine(1e-3, 2.0), 1.0).evaluated_part(AxisRun(*(time,) * len(AxisRun._fields)))
    assert len(part.time) == round(EVALUATED_PERIODS / 2.0 / PERIOD)
    assert part.time[0] == pytest.approx(SETTLING_PERIODS / 2.0 + PERIOD)


# --- messages, sensors and delay of the loop ---

NOISE = np.array([[1e3, 2e3, 0.5, 1e-3], [-1e3, 3e3, -0.25, 0.0], [0.0, 0.0, 0.0, -2e-3]])  # [Pa], [Pa], [N], [m/s]


@pytest.fixture
def sent(monkeypatch):
    """Messages to the estimator, which answers the velocity of sample i = 0, 1, ... with a force of 10 (i + 1) N."""
    messages = []

    def receive(_parameters, state, message, stamp, emit):
        assert message.stamp == stamp
        messages.append(message)
        if isinstance(message, Velocity):
            emit(FeedForward(stamp, 10.0 * (stamp // 1_000_000 + 1), 1.0, 0), b'')
        else:
            emit(message, b'')  # another output of the estimator
        return state

    monkeypatch.setattr(pipeline, 'receive', receive)
    return messages


def of_type(kind, messages):
    return [message for message in messages if isinstance(message, kind)]


@pytest.mark.parametrize(
    ('delay', 'forces'),
    [
        (0.0, [10.0, 20.0, 30.0, 40.0, 50.0]),
        (1e-3, [0.0, 10.0, 20.0, 30.0, 40.0]),
        (1.25e-3, [0.0, 7.5, 17.5, 27.5, 37.5]),
        (3e-3, [0.0, 0.0, 0.0, 10.0, 20.0]),
    ],
)
def test_the_force_is_in_the_controller_after_its_delay_and_between_samples_in_proportion(sent, delay, forces):
    run = run_closed_loop(Axis(SERVO, PIPELINE), Sine(), 5, delay)
    assert run.feedforward == pytest.approx(forces, abs=1e-6)
    state, reference = init(SERVO), []
    for i, force in enumerate(forces):
        state, out = step(SERVO, state, Sine().at(i * PERIOD), force)
        reference.append(out.position)
    assert run.position == pytest.approx(reference, rel=1e-6)
    assert len(sent) == 5 * 4


def test_the_estimator_has_every_signal_of_a_sample_with_its_noise_and_the_controller_has_none(sent):
    still = Step(size=0.0, offset=0.002)
    run = run_closed_loop(Axis(SERVO, PIPELINE), still, 5, 0.1, NOISE)
    assert not run.velocity.any()
    np.testing.assert_array_equal(run.position, 0.002)
    out = outputs(SERVO, init(SERVO, 0.002).plant)
    errors = [NOISE[i % 3] for i in range(5)]  # three rows, repeated
    for i, (pressure, force, reference, velocity) in enumerate(zip(*[iter(sent)] * 4, strict=True)):
        a, b, f, v = errors[i]
        assert pressure == pytest.approx((i * 1_000_000, out.pressure_a + a, out.pressure_b + b), rel=1e-9)
        assert force == pytest.approx((i * 1_000_000, out.force_sum + f), abs=1e-6)
        assert reference == ServoReference(i * 1_000_000, 0.002, 0.0, 0.0)
        assert velocity == Velocity(i * 1_000_000, v)
    assert list(run.time) == pytest.approx([1e-3, 2e-3, 3e-3, 4e-3, 5e-3])
    np.testing.assert_array_equal(run.reference, 0.002)


def test_noise_beyond_the_last_sample_is_not_used(sent):
    run_closed_loop(Axis(SERVO, PIPELINE), Step(), 2, 0.0, NOISE)
    assert [velocity.velocity for velocity in of_type(Velocity, sent)] == [1e-3, 0.0]


def test_a_machine_that_measures_too_little_sends_the_force_sum_without_what_is_lacking(sent):
    lacking = ForceSumCorrection(area_a=1e-5, area_b=-2e-5, offset=3.0)
    seals = tuple(replace(m, seal=replace(m.seal, force_sum_correction=lacking)) for m in PIPELINE.estimator.seals)
    estimator = replace(PIPELINE.estimator, seals=seals)
    run_closed_loop(Axis(SERVO, PIPELINE._replace(estimator=estimator)), Step(size=0.0), 1, 0.0)
    out = outputs(SERVO, init(SERVO).plant)
    expected = out.force_sum - 1e-5 * out.pressure_a + 2e-5 * out.pressure_b - 3.0
    assert sent[0] == Pressure(0, out.pressure_a, out.pressure_b)  # no noise on anything
    assert sent[1].force == pytest.approx(expected)
    assert sent[3] == Velocity(0, 0.0)


def test_without_a_force_sensor_the_force_sum_is_that_of_the_measured_pressures(sent):
    axis = Axis(SERVO, PIPELINE, AxisSensors(force_sensor=False))
    run_closed_loop(axis, Step(size=0.0), 3, 0.0, NOISE)
    for pressure, force in zip(of_type(Pressure, sent), of_type(Force, sent), strict=True):
        pushed = pressure_force(SERVO.cylinder, pressure.chamber_a, pressure.chamber_b)
        assert force.force == pytest.approx(pushed, rel=1e-12)
        assert force.force != 0.0


@pytest.mark.parametrize(('count', 'seals'), [(5e-6, PIPELINE.estimator.seals), (1e-8, ())])
def test_an_encoder_counts_its_steps_and_its_velocity_is_their_difference_over_ten_samples(sent, count, seals):
    machine = replace(SERVO, seals=seals)
    wave, noise = Sine(1e-3, 5.0), np.array([[1e3, 2e3, 0.5, 9.0]])  # the noise of a velocity sensor is not there
    run = run_closed_loop(Axis(machine, PIPELINE, AxisSensors(encoder_step=count)), wave, 40, 0.0, noise)
    state = init(machine)
    out = outputs(machine, state.plant)
    counts = []
    for i, velocity in enumerate(of_type(Velocity, sent)):
        counts.append(count * round(out.position / count))
        ten = counts[-11:]
        expected = (ten[-1] - ten[0]) / (PERIOD * (len(ten) - 1)) if i else 0.0
        assert velocity.velocity == pytest.approx(expected, abs=1e-12)
        measured = Measurement(counts[-1], expected, out.pressure_a + 1e3, out.pressure_b + 2e3)
        state, out = step(machine, state, wave.at(i * PERIOD), 10.0 * (i + 1), measured=measured)
        assert (run.position[i], run.velocity[i]) == pytest.approx((out.position, out.velocity), rel=1e-6, abs=1e-12)
        assert run.friction_force[i] == pytest.approx(out.friction_force, rel=1e-6)
    assert len(set(counts)) > 5
    assert seals or counts[1] != counts[0]  # without friction it moves in the first sample
    assert AxisSensors() == (True, 0.0)


def test_the_loop_begins_at_the_start_of_the_wave_without_a_force(monkeypatch):
    monkeypatch.setattr(pipeline, 'receive', lambda _parameters, state, *_: state)  # an estimator that says nothing
    run = run_closed_loop(Axis(SERVO, PIPELINE), Step(size=0.001, start_time=0.5, offset=0.002), 3, 0.0)
    np.testing.assert_array_equal(run.position, 0.002)
    assert not run.feedforward.any()


def test_a_wrong_model_scales_the_friction_of_every_seal():
    half = with_wrong_friction(with_wrong_friction(PIPELINE, -0.5), 0.2)
    assert [m.friction_scale for m in half.estimator.seals] == pytest.approx([0.6] * len(PIPELINE.estimator.seals))
    assert half.feedforward == PIPELINE.feedforward
    assert without_feedforward(PIPELINE.feedforward).scale == 0.0


def test_evaluation_is_a_sine_a_move_and_a_step_each_with_a_tenth_of_a_second_and_the_hold(monkeypatch):
    asked = []
    monkeypatch.setattr(closed_loop, 'run_closed_loop', lambda *arguments: asked.append(arguments) or len(asked))
    axis = Axis(SERVO, PIPELINE)
    assert MOTIONS.runs(axis, 0.003, NOISE) == (1, 2, 3)
    waves, samples = [a[1] for a in asked], [a[2] for a in asked]
    assert waves == [StoppedWave(MOTIONS.sine, 3.375), MOTIONS.move, Step(0.01, 0.02, 0.05)]
    assert samples == [3375 + 600, 1000 + 600, 20 + 600]  # at 1 kHz
    assert {(a[0], a[3], id(a[4])) for a in asked} == {(axis, 0.003, id(NOISE))}
