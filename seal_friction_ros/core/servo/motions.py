"""Reference motions: waves of position over time, and the friction tests of the thesis and of the spool-valve paper.

A wave is a frozen dataclass. Its pure function ``at(time)`` returns position, velocity and acceleration; before time 0
the wave holds its start position.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple, Protocol

from seal_friction_ros.core.foundation.parameters import CheckedParameters, parameter
from seal_friction_ros.core.foundation.units import PSI


class Setpoint(NamedTuple):
    """Reference of the position controller at one moment."""

    position: float  # [m]
    velocity: float = 0.0  # [m/s]
    acceleration: float = 0.0  # [m/s^2]


class Wave(Protocol):
    """A wave of position over time."""

    def at(self, time: float) -> Setpoint:
        """Setpoint at ``time`` [s]."""


@dataclass(frozen=True)
class Sine(CheckedParameters):
    """x = x_0 + X sin(2 pi f t)."""

    amplitude: float = parameter(0.001, unit='m', lower=0.0, upper=10.0, description='X, half of peak to peak.')
    frequency: float = parameter(5.0, unit='Hz', lower=1e-4, upper=1e3, description='f.')
    offset: float = parameter(0.0, unit='m', lower=-10.0, upper=10.0, description='x_0.')

    def at(self, time: float) -> Setpoint:
        """Setpoint at ``time`` [s]."""
        if time < 0.0:
            return Setpoint(self.offset)
        rate = 2.0 * math.pi * self.frequency
        sine, cosine = math.sin(rate * time), math.cos(rate * time)
        away = self.amplitude * sine
        return Setpoint(self.offset + away, self.amplitude * rate * cosine, -rate * rate * away)


@dataclass(frozen=True)
class Step(CheckedParameters):
    """Jump from one position to another; velocity and acceleration of the reference stay 0."""

    size: float = parameter(0.001, unit='m', lower=-10.0, upper=10.0, description='Height of the step, with its sign.')
    start_time: float = parameter(0.0, unit='s', lower=0.0, upper=1e6, description='Time of the step.')
    offset: float = parameter(0.0, unit='m', lower=-10.0, upper=10.0, description='Position before the step.')

    def at(self, time: float) -> Setpoint:
        """Setpoint at ``time`` [s]."""
        return Setpoint(self.offset + (self.size if time >= self.start_time else 0.0))


@dataclass(frozen=True)
class Trapezoid(CheckedParameters):
    """Strokes out and back with a rest at both ends, ``cycles`` times: a trapezoid of position with rounded corners.

    A cycle is: move by ``distance``, rest, move back, rest; the two equal rests fill the period. A move runs at
    ``speed`` between ramps of ``acceleration`` and takes distance / speed + speed / acceleration. ValueError if the
    speed is not reached, or the moves do not fit into the period.
    """

    distance: float = parameter(0.0018, unit='m', lower=1e-6, upper=10.0, description='Stroke from end to end.')
    speed: float = parameter(0.034, unit='m/s', lower=1e-6, upper=10.0, description='Speed between the ends.')
    frequency: float = parameter(3.0, unit='Hz', lower=1e-4, upper=1e3, description='Cycles per second.')
    acceleration: float = parameter(5.0, unit='m/s2', lower=1e-3, upper=1e4, description='Acceleration at the corners.')
    cycles: int = parameter(0, unit='1', lower=0, upper=1000000, description='Number of cycles; 0: without end.')
    offset: float = parameter(0.0, unit='m', lower=-10.0, upper=10.0, description='Position of the first end.')

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.speed**2 / self.acceleration > self.distance:
            way = f'distance = {self.distance} m at acceleration = {self.acceleration} m/s2'
            raise ValueError(f'Trapezoid.speed = {self.speed} m/s is not reached within {way}')
        if 2.0 * self.move_time > 1.0 / self.frequency:
            left = f'{0.5 / self.frequency:.4g} s for a move that takes {self.move_time:.4g} s'
            raise ValueError(f'Trapezoid.frequency = {self.frequency} Hz leaves {left}')

    @property
    def move_time(self) -> float:
        """Time of one move from end to end [s]."""
        return self.distance / self.speed + self.speed / self.acceleration

    @property
    def duration(self) -> float:
        """Time of all cycles [s]; infinite without a number of cycles."""
        return self.cycles / self.frequency if self.cycles else math.inf

    def at(self, time: float) -> Setpoint:
        """Setpoint at ``time`` [s]."""
        if time < 0.0 or time >= self.duration:
            return Setpoint(self.offset)
        phase, half = math.fmod(time, 1.0 / self.frequency), 0.5 / self.frequency
        if phase < half:
            move = self._move(phase)
            return move._replace(position=self.offset + move.position)
        move = self._move(phase - half)
        return Setpoint(self.offset + self.distance - move.position, -move.velocity, -move.acceleration)

    def _move(self, time: float) -> Setpoint:
        """One move from 0 to ``distance`` that starts at time 0."""
        speed_up = self.speed / self.acceleration
        left = self.move_time - time
        if left <= 0.0:
            return Setpoint(self.distance)
        if time < speed_up:
            return Setpoint(0.5 * self.acceleration * time * time, self.acceleration * time, self.acceleration)
        if left < speed_up:
            short = 0.5 * self.acceleration * left * left
            return Setpoint(self.distance - short, self.acceleration * left, -self.acceleration)
        return Setpoint(self.speed * (time - 0.5 * speed_up), self.speed, 0.0)


@dataclass(frozen=True)
class Chirp(CheckedParameters):
    """Sine with a linear frequency sweep over ``duration``, then constant: x = x_0 + X sin(phi), phi' = 2 pi f(t)."""

    amplitude: float = parameter(0.001, unit='m', lower=0.0, upper=10.0, description='X, half of peak to peak.')
    start_frequency: float = parameter(0.5, unit='Hz', lower=1e-4, upper=1e3, description='Frequency at time 0.')
    end_frequency: float = parameter(10.0, unit='Hz', lower=1e-4, upper=1e3, description='Frequency at the end.')
    duration: float = parameter(10.0, unit='s', lower=1e-3, upper=1e5, description='Time of the sweep.')
    offset: float = parameter(0.0, unit='m', lower=-10.0, upper=10.0, description='x_0, middle position.')

    def at(self, time: float) -> Setpoint:
        """Setpoint at ``time`` [s]."""
        if time < 0.0:
            return Setpoint(self.offset)
        start, end, duration = self.start_frequency, self.end_frequency, self.duration
        if time < duration:
            sweep = (end - start) / duration
            frequency = start + sweep * time
            turns = (start + frequency) / 2.0 * time
        else:
            sweep, frequency = 0.0, end
            turns = 0.5 * (start + end) * duration + end * (time - duration)
        rate = 2.0 * math.pi * frequency
        sine, cosine = math.sin(2.0 * math.pi * turns), math.cos(2.0 * math.pi * turns)
        bend = 2.0 * math.pi * sweep * cosine - rate * rate * sine
        return Setpoint(self.offset + self.amplitude * sine, self.amplitude * rate * cosine, self.amplitude * bend)


@dataclass(frozen=True)
class RoundedWave:
    r"""A wave with the resolution r of a digital set point; velocity and acceleration are its differences.

    .. math:: x_i = r\,\mathrm{round}(x(t_i) / r), \quad v_i = (x_i - x_{i-1}) / T, \quad a_i = (v_i - v_{i-1}) / T

    Differences without a filter are our choice: no controller publishes a coarser velocity.
    """

    wave: Wave
    resolution: float  # [m] r, above 0
    period: float  # [s] T, time from one set point to the next

    def at(self, time: float) -> Setpoint:
        """Set point i with t_i = i T nearest to ``time`` [s]."""
        i = round(time / self.period)
        positions = (self.wave.at((i - back) * self.period).position for back in range(3))
        newest, last, before = (round(position / self.resolution) for position in positions)
        speed = self.resolution / self.period  # of one step a sample
        acceleration = speed / self.period * (newest - 2 * last + before)
        return Setpoint(self.resolution * newest, speed * (newest - last), acceleration)


class PullCommand(NamedTuple):
    """Command of the pull-test rig at one moment."""

    pressure: float  # [Pa, gauge] on both ports
    carriage: float  # [m] position of the far end of the spring scale
    test: int  # index of the test from 0, over all pressures and repetitions; each test gives one reading of each kind
    direction: int  # 1: extending, -1: retracting, 0: resting


@dataclass(frozen=True)
class PullTest(CheckedParameters):
    """Friction test of the thesis: rest, push until the rod moves on, pull back likewise; at each pressure, repeated.

    A carriage draws the spring scale at constant speed. The force rises until the rod breaks away (static reading); its
    mean is then the running friction (dynamic reading). Plan: 0 to 1000 psi in steps of 100 psi, 30 s rest, 3 times.

    Source: thesis, Appendix A, where the cylinder moves and a hand pulls. Carriage, its speed and the stiffness of the
    scale are our choice.
    """

    pressure_max: float = parameter(1000.0 * PSI, unit='Pa', lower=0.0, upper=1e8, description='Last pressure.')
    intervals: int = parameter(10, unit='1', lower=1, upper=1000, description='Pressure steps from 0 to the last.')
    repetitions: int = parameter(3, unit='1', lower=1, upper=100, description='Repetitions of the plan.')
    rest_time: float = parameter(30.0, unit='s', lower=0.0, upper=1e5, description='Rest before each push.')
    pull_time: float = parameter(5.0, unit='s', lower=1e-3, upper=1e4, description='Time of one push or pull.')
    carriage_speed: float = parameter(0.004, unit='m/s', lower=1e-6, upper=1.0, description='Speed of the carriage.')
    scale_stiffness: float = parameter(1e4, unit='N/m', lower=1.0, upper=1e9, description='Scale: 50 lbf over 20 mm.')

    @property
    def _block(self) -> float:
        """Time of one test [s]."""
        return self.rest_time + 2.0 * self.pull_time

    @property
    def duration(self) -> float:
        """Time of the whole plan [s]."""
        return self._block * (self.intervals + 1) * self.repetitions

    def at(self, time: float) -> PullCommand:
        """Rig command at ``time`` [s]: rest, extend, retract for each pressure."""
        last = (self.intervals + 1) * self.repetitions - 1
        test = min(max(int(time / self._block), 0), last)
        pressure = self.pressure_max * (test % (self.intervals + 1)) / self.intervals
        inside = min(max(time - test * self._block, 0.0), self._block) - self.rest_time
        if inside <= 0.0:
            return PullCommand(pressure, 0.0, test, 0)
        if inside < self.pull_time:
            return PullCommand(pressure, self.carriage_speed * inside, test, 1)
        back = self.carriage_speed * self.pull_time - self.carriage_speed * (inside - self.pull_time)
        return PullCommand(pressure, back, test, -1 if inside < 2.0 * self.pull_time else 0)

    def force(self, command: PullCommand, position: float) -> float:
        """Force of the spring scale on the rod [N] at the rod position [m]; the scale is relaxed at 0 m."""
        return self.scale_stiffness * (command.carriage - position)
