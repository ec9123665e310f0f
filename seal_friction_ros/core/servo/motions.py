"""Reference programs: waves of position over time, and the friction tests of the thesis and of the spool-valve paper.

A wave is a frozen dataclass, ``at(time)`` its position, velocity and acceleration: a pure function, so that any sample
can be asked for in any order. Before time 0 a wave stands where it starts.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple, Protocol

from seal_friction_ros.core.foundation.parameters import check, parameter
from seal_friction_ros.core.foundation.units import PSI


class Reference(NamedTuple):
    """Where the rod shall be, and how it shall move there."""

    position: float
    """[m]"""
    velocity: float = 0.0
    """[m/s]"""
    acceleration: float = 0.0
    """[m/s^2]"""


class Wave(Protocol):
    """A wave of position over time."""

    def at(self, time: float) -> Reference:
        """Reference at ``time`` [s]."""
        ...


@dataclass(frozen=True)
class Sine:
    """x = x_0 + X sin(2 pi f t).

    Raises:
        ValueError: A value is out of bounds.
    """

    amplitude: float = parameter(0.001, unit='m', lower=0.0, upper=10.0, description='X, half the way peak to peak.')
    frequency: float = parameter(5.0, unit='Hz', lower=1e-4, upper=1e3, description='f.')
    offset: float = parameter(0.0, unit='m', lower=-10.0, upper=10.0, description='x_0.')

    def __post_init__(self) -> None:
        check(self)

    def at(self, time: float) -> Reference:
        """Reference at ``time`` [s]."""
        if time < 0.0:
            return Reference(self.offset)
        rate = 2.0 * math.pi * self.frequency
        sine, cosine = math.sin(rate * time), math.cos(rate * time)
        away = self.amplitude * sine
        return Reference(self.offset + away, self.amplitude * rate * cosine, -rate * rate * away)


@dataclass(frozen=True)
class Step:
    """From one position to another at one moment: velocity and acceleration stay 0.

    Raises:
        ValueError: A value is out of bounds.
    """

    size: float = parameter(0.001, unit='m', lower=-10.0, upper=10.0, description='Way of the step, with its sign.')
    start_time: float = parameter(0.0, unit='s', lower=0.0, upper=1e6, description='Moment of the step.')
    offset: float = parameter(0.0, unit='m', lower=-10.0, upper=10.0, description='Position before the step.')

    def __post_init__(self) -> None:
        check(self)

    def at(self, time: float) -> Reference:
        """Reference at ``time`` [s]."""
        return Reference(self.offset + (self.size if time >= self.start_time else 0.0))


@dataclass(frozen=True)
class Trapezoid:
    """There and back with a rest at both ends, ``cycles`` times: a trapezoid of position with rounded corners.

    A cycle is: move by ``distance``, rest, move back, rest; both rests fill the period. A move runs at ``speed``,
    reached and left with ``acceleration``; it takes distance / speed + speed / acceleration.

    Raises:
        ValueError: A value is out of bounds, the speed is not reached, or the moves do not fit into the period.
    """

    distance: float = parameter(0.0018, unit='m', lower=1e-6, upper=10.0, description='Way from end to end.')
    speed: float = parameter(0.034, unit='m/s', lower=1e-6, upper=10.0, description='Speed between the ends.')
    frequency: float = parameter(3.0, unit='Hz', lower=1e-4, upper=1e3, description='Cycles per second.')
    acceleration: float = parameter(
        5.0,
        unit='m/s2',
        lower=1e-3,
        upper=1e4,
        description='Acceleration at the corners (sharp as it goes to infinity).',
    )
    cycles: int = parameter(0, unit='1', lower=0, upper=1000000, description='Number of cycles; 0 is without end.')
    offset: float = parameter(0.0, unit='m', lower=-10.0, upper=10.0, description='Position of the first end.')

    def __post_init__(self) -> None:
        check(self)
        if self.speed**2 / self.acceleration > self.distance:
            raise ValueError(
                f'Trapezoid.speed = {self.speed} m/s is not reached within distance = {self.distance} m '
                f'at acceleration = {self.acceleration} m/s2'
            )
        if 2.0 * self.move_time > 1.0 / self.frequency:
            raise ValueError(
                f'Trapezoid.frequency = {self.frequency} Hz leaves {0.5 / self.frequency:.4g} s for a move that takes '
                f'{self.move_time:.4g} s'
            )

    @property
    def move_time(self) -> float:
        """Time of one move from end to end [s]."""
        return self.distance / self.speed + self.speed / self.acceleration

    @property
    def duration(self) -> float:
        """Time of all cycles [s]; infinite if they have no end."""
        return self.cycles / self.frequency if self.cycles else math.inf

    def at(self, time: float) -> Reference:
        """Reference at ``time`` [s]."""
        if time < 0.0 or time >= self.duration:
            return Reference(self.offset)
        phase = math.fmod(time, 1.0 / self.frequency)
        half = 0.5 / self.frequency
        if phase < half:
            there = self._move(phase)
            return Reference(self.offset + there.position, there.velocity, there.acceleration)
        back = self._move(phase - half)
        return Reference(self.offset + self.distance - back.position, -back.velocity, -back.acceleration)

    def _move(self, time: float) -> Reference:
        """One move from 0 to ``distance``, started at time 0."""
        speed_up = self.speed / self.acceleration
        left = self.move_time - time
        if left <= 0.0:
            return Reference(self.distance)
        if time < speed_up:
            return Reference(0.5 * self.acceleration * time * time, self.acceleration * time, self.acceleration)
        if left < speed_up:
            short = 0.5 * self.acceleration * left * left
            return Reference(self.distance - short, self.acceleration * left, -self.acceleration)
        return Reference(self.speed * (time - 0.5 * speed_up), self.speed, 0.0)


@dataclass(frozen=True)
class Chirp:
    """Sine whose frequency rises (or falls) linearly over ``duration`` and then stays.

    x = x_0 + X sin(phi), phi' = 2 pi f(t).

    Raises:
        ValueError: A value is out of bounds.
    """

    amplitude: float = parameter(0.001, unit='m', lower=0.0, upper=10.0, description='Half the way peak to peak.')
    start_frequency: float = parameter(0.5, unit='Hz', lower=1e-4, upper=1e3, description='Frequency at time 0.')
    end_frequency: float = parameter(10.0, unit='Hz', lower=1e-4, upper=1e3, description='Frequency at the end.')
    duration: float = parameter(10.0, unit='s', lower=1e-3, upper=1e5, description='Time of the sweep.')
    offset: float = parameter(0.0, unit='m', lower=-10.0, upper=10.0, description='Middle position.')

    def __post_init__(self) -> None:
        check(self)

    def at(self, time: float) -> Reference:
        """Reference at ``time`` [s]."""
        if time < 0.0:
            return Reference(self.offset)
        sweep = (self.end_frequency - self.start_frequency) / self.duration if time < self.duration else 0.0
        inside = min(time, self.duration)
        mean = 0.5 * (self.start_frequency + self.end_frequency)
        full = mean * self.duration if time >= self.duration else 0.0
        frequency = self.end_frequency if time >= self.duration else self.start_frequency + sweep * inside
        turns = (
            full + self.end_frequency * (time - inside) if full else (self.start_frequency + frequency) / 2.0 * inside
        )
        rate = 2.0 * math.pi * frequency
        sine, cosine = math.sin(2.0 * math.pi * turns), math.cos(2.0 * math.pi * turns)
        bend = 2.0 * math.pi * sweep * cosine - rate * rate * sine
        return Reference(self.offset + self.amplitude * sine, self.amplitude * rate * cosine, self.amplitude * bend)


def spool_cycles(distance: float) -> Trapezoid:
    """Cycles of the spool-valve paper: 3 Hz, 10 cycles, 34 mm/s; of the ten the 9th is evaluated.

    Args:
        distance: 1.8e-3 for a single ring, 2.7e-3 for a ring across the control edge and for the whole spool [m].

    Source: spool-valve paper, chapter 4 and Figure 7. Corners rounded at 5 m/s^2 are our choice: the paper gives none.
    """
    return Trapezoid(distance=distance, speed=0.034, frequency=3.0, acceleration=5.0, cycles=10)


class PullCommand(NamedTuple):
    """What the pull-test rig does at one moment."""

    pressure: float
    """[Pa, gauge] on both ports"""
    carriage: float
    """[m] position of the far end of the spring scale"""
    test: int
    """which pressure of which repetition, counted from 0; as many as there are readings of each kind"""
    direction: int
    """1: extending, -1: retracting, 0: resting"""


@dataclass(frozen=True)
class PullTest:
    """The thesis's friction test: rest, push until it moves and on, pull back likewise; pressure by pressure, repeated.

    The spring scale is drawn by a carriage at constant speed, so its force rises until the rod breaks away (static
    reading) and then stays, in the mean, at the running friction (dynamic reading). Plan: 0 to 1000 psi in steps of
    100 psi, 30 s rest, three times over.

    Raises:
        ValueError: A value is out of bounds.

    Source: thesis, Appendix A. There the cylinder moves and a hand pulls; carriage, its speed and the stiffness
    of the scale are our choice.
    """

    pressure_max: float = parameter(1000.0 * PSI, unit='Pa', lower=0.0, upper=1e8, description='Last pressure.')
    intervals: int = parameter(10, unit='1', lower=1, upper=1000, description='Pressure steps from 0 to the last.')
    repetitions: int = parameter(3, unit='1', lower=1, upper=100, description='How often the plan is run.')
    rest_time: float = parameter(30.0, unit='s', lower=0.0, upper=1e5, description='Rest before each push.')
    pull_time: float = parameter(5.0, unit='s', lower=1e-3, upper=1e4, description='Time of one push or pull.')
    carriage_speed: float = parameter(0.004, unit='m/s', lower=1e-6, upper=1.0, description='Speed of the carriage.')
    scale_stiffness: float = parameter(
        1e4, unit='N/m', lower=1.0, upper=1e9, description='Spring scale: 50 lbf over some 20 mm.'
    )

    def __post_init__(self) -> None:
        check(self)

    @property
    def duration(self) -> float:
        """Time of the whole plan [s]."""
        return (self.rest_time + 2.0 * self.pull_time) * (self.intervals + 1) * self.repetitions

    def at(self, time: float) -> PullCommand:
        """Rig command at ``time`` [s]: rest, extend, retract for each pressure."""
        block = self.rest_time + 2.0 * self.pull_time
        last = (self.intervals + 1) * self.repetitions - 1
        test = min(max(int(time / block), 0), last)
        pressure = self.pressure_max * (test % (self.intervals + 1)) / self.intervals
        inside = min(max(time - test * block, 0.0), block) - self.rest_time
        if inside <= 0.0:
            return PullCommand(pressure, 0.0, test, 0)
        way = self.carriage_speed * self.pull_time
        if inside < self.pull_time:
            return PullCommand(pressure, self.carriage_speed * inside, test, 1)
        back = way - self.carriage_speed * (inside - self.pull_time)
        return PullCommand(pressure, back, test, -1 if inside < 2.0 * self.pull_time else 0)

    def force(self, command: PullCommand, position: float) -> float:
        """Force of the spring scale on the rod [N] at a rod position [m] that was 0 when the test was set up."""
        return self.scale_stiffness * (command.carriage - position)
