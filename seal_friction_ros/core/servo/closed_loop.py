r"""Servo, sensors, estimator and feed-forward in one loop, as on a real axis, and how well that tracks.

At every sample the servo is measured, the measurements go through `pipeline.receive` message by message, and the
feed-forward force that comes out is in the controller a delay later. A delay of n + r samples (0 <= r < 1) is

.. math:: F(t) = (1 - r) F_{i-n} + r F_{i-n-1}

which is the mean over the phase between the clocks of feed-forward and controller, since that is not known. This, and
what the test motions are, is our choice.
"""

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from seal_friction_ros.core.estimation import pipeline
from seal_friction_ros.core.estimation.feedforward import FeedForward, FeedForwardSettings
from seal_friction_ros.core.estimation.messages import Input, Output
from seal_friction_ros.core.estimation.pipeline import PipelineParameters
from seal_friction_ros.core.estimation.records import Force, Pressure, ServoReference, Velocity
from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.servo import position_servo as servo
from seal_friction_ros.core.servo.motions import Reference, Sine, Step, Trapezoid, Wave
from seal_friction_ros.core.servo.position_servo import ServoParameters
from seal_friction_ros.core.servo.tracking import reversals, tracking_peak, tracking_rms

SETTLED_PERIODS, JUDGED_PERIODS = 2, 4  # of the sine: first the start is forgotten, then what follows is judged
SETTLING_TIME = 0.1  # [s] of rest after a motion before reversals count as a limit cycle
STEP_START = 0.02  # [s]


class Axis(NamedTuple):
    """A servo and what runs beside it."""

    servo: ServoParameters
    pipeline: PipelineParameters


class Run(NamedTuple):
    """What a loop did; every array of shape (n,), one entry per sample, at its end."""

    time: FloatArray
    """[s]"""
    reference: FloatArray
    """[m]"""
    position: FloatArray
    """[m]"""
    velocity: FloatArray
    """[m/s]"""
    friction_force: FloatArray
    """[N] that the seals really had"""
    feedforward: FloatArray
    """[N] that the controller added"""


@dataclass(frozen=True)
class Stopped:
    """A wave that stands still from a moment on."""

    wave: Wave
    stop_time: float
    """[s]"""

    def at(self, time: float) -> Reference:
        """Reference at ``time`` [s]."""
        return self.wave.at(time) if time < self.stop_time else Reference(self.wave.at(self.stop_time).position)


def with_wrong_friction(parameters: PipelineParameters, error: float) -> PipelineParameters:
    """Parameters whose model of the seals gives ``1 + error`` times the friction, breakaway included.

    Args:
        parameters: The right ones.
        error: Share [-] above -1.
    """
    seals = tuple(replace(m, friction_scale=(1.0 + error) * m.friction_scale) for m in parameters.estimator.seals)
    return parameters._replace(estimator=replace(parameters.estimator, seals=seals))


def without_feedforward(settings: FeedForwardSettings) -> FeedForwardSettings:
    """Settings whose feed-forward is 0 N."""
    return replace(settings, coulomb_scale=0.0, stribeck_scale=0.0, viscous_scale=0.0)


def whole_delay(parameters: ServoParameters, delay: float) -> float:
    r"""Time [s] from a velocity sample until its feed-forward has become force.

    .. math:: T = T_d + 1 / \omega_F + \tau

    with the way to the controller, the force loop and spool and sampling (see `servo_controller`).

    Args:
        parameters: The servo.
        delay: T_d [s].
    """
    return delay + 1.0 / parameters.controller.force_bandwidth + parameters.gains.valve_delay


def closed_loop(axis: Axis, wave: Wave, samples: int, delay: float, noise: FloatArray | None = None) -> Run:
    """Run the loop from rest at the start of the wave.

    The sensors are there a sample before the first reference, so that the feed-forward has no need to fade in.

    Args:
        axis: Servo, estimator and feed-forward.
        wave: Reference.
        samples: How many.
        delay: Time from a velocity sample until its feed-forward is in the controller [s], >= 0.
        noise: What the sensors of the estimator read too much, shape (k, 4) with columns chamber a [Pa], chamber b
            [Pa], force sum [N], velocity [m/s], over and over again; None: they read what is.
    """
    plant, parameters = axis
    period = plant.control_period
    whole, part = divmod(delay / period + 1e-9, 1.0)
    back = int(whole)
    errors = [(0.0, 0.0, 0.0, 0.0)] if noise is None else noise.tolist()
    forces = [0.0] * (back + 1)
    seen = pipeline.init(parameters)
    state = servo.init(plant, wave.at(0.0).position)
    out = servo.outputs(plant, state.plant)
    newest = FeedForward(0, 0.0, 0.0, 0)

    def take(record: Output, _: bytes) -> None:
        nonlocal newest
        newest = record if isinstance(record, FeedForward) else newest

    rows = []
    for i in range(samples):
        stamp = round(i * period * 1e9)
        reference = wave.at(i * period)
        a, b, f, v = errors[i % len(errors)]
        messages: list[Input] = [
            Pressure(stamp, out.pressure_a + a, out.pressure_b + b),
            Force(stamp, out.force_sum + f),
        ]
        messages += [ServoReference(stamp, *reference)] if i else []
        messages.append(Velocity(stamp, out.velocity + v))
        for message in messages:
            seen = pipeline.receive(parameters, seen, message, take)
        forces.append(newest.force)
        force = (1.0 - part) * forces[-1 - back] + part * forces[-2 - back]
        state, out = servo.step(plant, state, reference, force)
        wanted = wave.at((i + 1) * period).position
        rows.append(((i + 1) * period, wanted, out.position, out.velocity, out.friction_force, force))
    return Run(*np.array(rows).T)


@dataclass(frozen=True)
class TestMotions:
    """The motions that an axis is judged by, all made from one sine: its sine, a move, a step, each with rest after it.

    The move goes out and back between the ends of the sine, at the sine's top speed and acceleration and half its
    frequency; the step is as large as the amplitude.
    """

    __test__ = False  # not for pytest

    sine: Sine
    hold_time: float
    """[s] of rest after each motion in which reversals count"""

    @property
    def stop_time(self) -> float:
        """Moment at which the sine stops, at a trough, where it stands still anyway [s]."""
        return (SETTLED_PERIODS + JUDGED_PERIODS + 0.75) / self.sine.frequency

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

    def runs(self, axis: Axis, delay: float, noise: FloatArray | None = None) -> tuple[Run, Run, Run]:
        """Sine, move and step; arguments as `closed_loop`."""
        period, rest = axis.servo.control_period, SETTLING_TIME + self.hold_time
        motions: tuple[tuple[Wave, float], ...] = (
            (Stopped(self.sine, self.stop_time), self.stop_time),
            (self.move, self.move.duration),
            (Step(self.sine.amplitude, STEP_START, self.sine.offset), STEP_START),
        )
        sine, move, step = (
            closed_loop(axis, wave, round((time + rest) / period), delay, noise) for wave, time in motions
        )
        return sine, move, step

    def judged(self, run: Run) -> Run:
        """The part of the sine that is judged: whole periods, from one middle position to another."""
        first = SETTLED_PERIODS / self.sine.frequency
        last = first + JUDGED_PERIODS / self.sine.frequency
        inside = (run.time > first + 1e-9) & (run.time <= last + 1e-9)
        return Run(*(values[inside] for values in run))


class Performance(NamedTuple):
    """How well an axis does the test motions."""

    tracking_rms: float
    """[m] root mean square error over the judged part of the sine"""
    tracking_peak: float
    """[m] largest error there"""
    dwell: float
    """[s] time at rest per reversal there, see `dwell`"""
    overshoot: float
    """[m] how far the move goes beyond its ends"""
    limit_cycle_reversals: int
    """reversals of direction while the reference rests, after all three motions"""
    largest_force: float
    """[N] of the feed-forward"""
    largest_force_rate: float
    """[N/s] likewise"""


def dwell(velocity: FloatArray, period: float, turns: int) -> float:
    """Time at rest per reversal that was asked for [s].

    Rest anywhere counts, also where the rod stops a second time on its way, and where it does not reverse at all: a rod
    that never moves dwells for the whole time between two reversals.

    Args:
        velocity: Of a simulated rod, exactly 0 at rest [m/s], shape (n,).
        period: Time between two samples [s].
        turns: Reversals that the reference makes in these samples.
    """
    return float(np.count_nonzero(velocity == 0.0)) * period / turns


def judge(period: float, motions: TestMotions, sine: Run, move: Run, step: Run) -> Performance:
    """Figures of the three runs of `TestMotions.runs`, with the sample ``period`` [s]."""
    part = motions.judged(sine)
    held = round(motions.hold_time / period)
    amplitude, middle = motions.sine.amplitude, motions.sine.offset
    forces = [run.feedforward for run in (sine, move, step)]
    return Performance(
        tracking_rms(part.reference, part.position),
        tracking_peak(part.reference, part.position),
        dwell(part.velocity, period, 2 * JUDGED_PERIODS),
        max(float(np.abs(move.position - middle).max()) - amplitude, 0.0),
        sum(reversals(run.velocity[len(run.velocity) - held :]) for run in (sine, move, step)),
        max(float(np.abs(force).max()) for force in forces),
        max(float(np.abs(np.diff(force, prepend=0.0)).max()) for force in forces) / period,
    )
