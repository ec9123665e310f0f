r"""Closed loop of servo, sensors, estimator and feed-forward, and its tracking quality.

At every sample the sensors measure the servo, `pipeline.receive` takes the measurements message by message, and the
feed-forward force reaches the controller after a delay. With a delay of n + r samples (0 <= r < 1)

.. math:: F(t) = (1 - r) F_{i-n} + r F_{i-n-1}

which is the mean over the unknown phase between the clocks of feed-forward and controller. This and the evaluation
motions are our choice.
"""

import math
from collections import deque
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from seal_friction_ros.core.estimation import pipeline
from seal_friction_ros.core.estimation.feedforward import FeedForwardSettings
from seal_friction_ros.core.estimation.pipeline import PipelineParameters
from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.friction.force_sum_correction import measured_force_sum
from seal_friction_ros.core.messages import records
from seal_friction_ros.core.servo import position_servo as servo
from seal_friction_ros.core.servo.controller import Measurement
from seal_friction_ros.core.servo.cylinder import pressure_force
from seal_friction_ros.core.servo.motions import Setpoint, Sine, Step, Trapezoid, Wave
from seal_friction_ros.core.servo.position_servo import ServoParameters
from seal_friction_ros.core.servo.tracking import reversals, tracking_peak, tracking_rms

SETTLING_PERIODS, EVALUATED_PERIODS = 2, 4  # of the sine
SETTLING_TIME = 0.1  # [s] of rest after a motion before reversals count as a limit cycle
STEP_START = 0.02  # [s]
ENCODER_WINDOW = 10  # samples of the difference quotient that is the velocity of an encoder (our choice)


class AxisSensors(NamedTuple):
    """What an axis measures."""

    force_sensor: bool = True  # False: the force sum is A_a p_a - A_b p_b from the measured pressures
    encoder_step: float = 0.0  # [m] counts of an encoder are position and velocity; 0: sensors of both, without steps


IDEAL_SENSORS = AxisSensors()


class Axis(NamedTuple):
    """A servo with its estimator and feed-forward."""

    servo: ServoParameters
    pipeline: PipelineParameters
    sensors: AxisSensors = IDEAL_SENSORS


class AxisRun(NamedTuple):
    """Simulated motion of an axis; arrays of shape (n,), values at the end of each sample."""

    time: FloatArray  # [s]
    reference: FloatArray  # [m]
    position: FloatArray  # [m]
    velocity: FloatArray  # [m/s]
    friction_force: FloatArray  # [N] true friction of the seals
    feedforward: FloatArray  # [N] in the controller


@dataclass(frozen=True)
class StoppedWave:
    """A wave that holds its position from ``stop_time`` [s] on."""

    wave: Wave
    stop_time: float

    def at(self, time: float) -> Setpoint:
        """Setpoint at ``time`` [s]."""
        return self.wave.at(time) if time < self.stop_time else Setpoint(self.wave.at(self.stop_time).position)


def with_wrong_friction(parameters: PipelineParameters, error: float) -> PipelineParameters:
    """Parameters with a seal model of ``1 + error`` times the friction, breakaway included; ``error`` [-] above -1."""
    seals = tuple(replace(m, friction_scale=(1.0 + error) * m.friction_scale) for m in parameters.estimator.seals)
    return parameters._replace(estimator=replace(parameters.estimator, seals=seals))


def without_feedforward(settings: FeedForwardSettings) -> FeedForwardSettings:
    """Settings with a feed-forward of 0 N."""
    return replace(settings, scale=0.0)


def run_closed_loop(axis: Axis, wave: Wave, samples: int, delay: float, noise: FloatArray | None = None) -> AxisRun:
    """Run the loop from rest at the start of the wave.

    The feed-forward does not fade in. With an encoder, position and velocity of the controller and velocity of the
    estimator are those of its counts, the velocity over `ENCODER_WINDOW` samples, and the controller has the measured
    pressures; otherwise the controller measures without error. The ``delay`` [s, >= 0] is from a velocity sample until
    its feed-forward is in the controller. The ``noise`` of the sensors of the estimator repeats after its last row;
    shape (k, 4), columns chamber a [Pa], chamber b [Pa], force sum [N], velocity [m/s].
    """
    plant, parameters, sensors = axis
    counts: deque[float] = deque(maxlen=ENCODER_WINDOW + 1)
    lacking = parameters.estimator.force_sum_correction
    period = plant.control_period
    whole, part = divmod(delay / period + 1e-9, 1.0)
    back = int(whole)
    errors = [(0.0, 0.0, 0.0, 0.0)] if noise is None else noise[:samples].tolist()
    forces = [0.0] * (back + 1)
    estimation = pipeline.init_running(parameters)
    state = servo.init(plant, wave.at(0.0).position)
    out = servo.outputs(plant, state.plant)
    newest = records.FeedForward(0, 0.0, 0.0, 0)

    def emit(record: records.Output, _: bytes) -> None:
        nonlocal newest
        newest = record if isinstance(record, records.FeedForward) else newest

    measured, rows = None, []
    for i in range(samples):
        stamp = round(i * period * 1e9)
        setpoint = wave.at(i * period)
        a, b, f, v = errors[i % len(errors)]
        pressures = out.pressure_a + a, out.pressure_b + b
        force_sum, velocity = out.force_sum, out.velocity + v
        if not sensors.force_sensor:
            force_sum, f = pressure_force(plant.cylinder, *pressures), 0.0
        if sensors.encoder_step:
            counts.append(sensors.encoder_step * round(out.position / sensors.encoder_step))
            velocity = (counts[-1] - counts[0]) / (max(len(counts) - 1, 1) * period)
        force_sum = measured_force_sum(lacking, force_sum, out.pressure_a, out.pressure_b) + f
        inputs = records.Pressure(stamp, *pressures), records.Force(stamp, force_sum)
        motion = records.ServoReference(stamp, *setpoint), records.Velocity(stamp, velocity)
        for message in (*inputs, *motion):
            pipeline.receive(parameters, estimation, message, stamp, emit)
        forces.append(newest.force)
        force = (1.0 - part) * forces[-1 - back] + part * forces[-2 - back]
        if sensors.encoder_step:
            measured = Measurement(counts[-1], velocity, *pressures)
        state, out = servo.step(plant, state, setpoint, force, measured=measured)
        end = (i + 1) * period
        rows.append((end, wave.at(end).position, out.position, out.velocity, out.friction_force, force))
    return AxisRun(*np.array(rows).T)


@dataclass(frozen=True)
class EvaluationMotions:
    """Motions to evaluate an axis: a sine, a move, a step, each followed by a rest.

    The move goes out and back between the ends of the sine, at the top speed and acceleration of the sine and half its
    frequency. The step is as large as the amplitude.
    """

    sine: Sine
    hold_time: float  # [s] of rest after each motion in which reversals count

    @property
    def stop_time(self) -> float:
        """Time at which the sine stops, at a trough, where its speed is 0 [s]."""
        return (SETTLING_PERIODS + EVALUATED_PERIODS + 0.75) / self.sine.frequency

    @property
    def move(self) -> Trapezoid:
        """The move."""
        rate, amplitude = 2.0 * math.pi * self.sine.frequency, self.sine.amplitude
        return Trapezoid(
            distance=2.0 * amplitude,
            speed=rate * amplitude,
            frequency=self.sine.frequency / 2.0,
            acceleration=rate**2 * amplitude,
            cycles=1,
            offset=self.sine.offset - amplitude,
        )

    def runs(self, axis: Axis, delay: float, noise: FloatArray | None = None) -> tuple[AxisRun, AxisRun, AxisRun]:
        """Sine, move and step; arguments as of `run_closed_loop`."""
        period, rest = axis.servo.control_period, SETTLING_TIME + self.hold_time

        def run(wave: Wave, time: float) -> AxisRun:
            return run_closed_loop(axis, wave, round((time + rest) / period), delay, noise)

        step = Step(self.sine.amplitude, STEP_START, self.sine.offset)
        stopped = StoppedWave(self.sine, self.stop_time)
        return run(stopped, self.stop_time), run(self.move, self.move.duration), run(step, STEP_START)

    def evaluated_part(self, run: AxisRun) -> AxisRun:
        """Evaluated part of the sine: whole periods, between passages through the middle."""
        first = SETTLING_PERIODS / self.sine.frequency
        last = first + EVALUATED_PERIODS / self.sine.frequency
        inside = (run.time > first + 1e-9) & (run.time <= last + 1e-9)
        return AxisRun(*(values[inside] for values in run))


class Performance(NamedTuple):
    """Tracking quality of an axis over the evaluation motions."""

    tracking_rms: float  # [m] root mean square error over the evaluated part of the sine
    tracking_peak: float  # [m] largest error over this part
    dwell: float  # [s] time at rest per reversal over this part, see `dwell`
    overshoot: float  # [m] of the move past its ends
    limit_cycle_reversals: int  # reversals of direction while the reference rests, sum of the three motions
    largest_force: float  # [N] of the feed-forward
    largest_force_rate: float  # [N/s] of the feed-forward

    def better_than(self, other: 'Performance') -> bool:
        """Whether error and dwell are smaller, and the axis does not reverse more often at rest."""
        return (
            self.tracking_rms < other.tracking_rms
            and self.dwell <= other.dwell
            and self.limit_cycle_reversals <= other.limit_cycle_reversals
        )


def dwell(velocity: FloatArray, period: float, turns: int) -> float:
    """Time at rest per reversal of the reference [s]; of the reference there are so many ``turns``.

    Every rest counts, also a second one within a stroke, and one without a reversal of the rod: a rod that never moves
    dwells for the whole time between two reversals. The velocity [m/s], shape (n,), is that of a simulated rod, exactly
    0 at rest, with the sample time ``period`` [s].
    """
    return float(np.count_nonzero(velocity == 0.0)) * period / turns


def performance_of(period: float, motions: EvaluationMotions, runs: tuple[AxisRun, AxisRun, AxisRun]) -> Performance:
    """Performance over the three runs of `EvaluationMotions.runs`, with the sample time ``period`` [s]."""
    sine, move, _ = runs
    part = motions.evaluated_part(sine)
    held = round(motions.hold_time / period)
    forces = [run.feedforward for run in runs]
    return Performance(
        tracking_rms(part.reference, part.position),
        tracking_peak(part.reference, part.position),
        dwell(part.velocity, period, 2 * EVALUATED_PERIODS),
        max(float(np.abs(move.position - motions.sine.offset).max()) - motions.sine.amplitude, 0.0),
        sum(reversals(run.velocity[len(run.velocity) - held :]) for run in runs),
        max(float(np.abs(force).max()) for force in forces),
        max(float(np.abs(np.diff(force, prepend=0.0)).max()) for force in forces) / period,
    )
