"""The loop of ``make demo`` in core: the feed-forward cuts the tracking error, also with a rounded reference."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest
from paths import ROOT

from seal_friction_ros.core.estimation.adaptation import AdaptationSettings
from seal_friction_ros.core.servo.closed_loop import (
    EVALUATED_PERIODS,
    SETTLING_PERIODS,
    Axis,
    AxisRun,
    EvaluationMotions,
    Performance,
    StoppedWave,
    performance_of,
    run_closed_loop,
    without_feedforward,
)
from seal_friction_ros.core.servo.motions import RoundedWave, Setpoint, Sine, Trapezoid
from seal_friction_ros.core.servo.position_servo import ServoParameters
from seal_friction_ros.core.servo.sensors import SensorSettings
from seal_friction_ros.core.servo.tracking import reversals, tracking_rms
from seal_friction_ros.files import default_configuration, read_yaml

SIMULATOR = read_yaml(ROOT / 'config/servo_simulator.yaml')['/**']['ros__parameters']
SENSORS = SensorSettings(**SIMULATOR['sensors'])
PIPELINE = default_configuration().parameters()
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
    assert adapted < 1.3 * right_file


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
