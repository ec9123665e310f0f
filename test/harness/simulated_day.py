"""A rod on another day: force sums of a machine that is not the simulator of the package.

The friction has a Stribeck dip and presliding that the law does not have, the encoder counts, the force sensor is
noisy, and load, offset and friction may change over time.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from seal_friction_ros.core.estimation.records import RodSample
from seal_friction_ros.core.messages.coder import encode, type_of
from seal_friction_ros.core.messages.layouts import INPUTS
from seal_friction_ros.core.messages.records import Force, Pressure, Velocity
from seal_friction_ros.offline.bags.bag import BagWriter

SECOND = 1_000_000_000  # [ns]
START = 1_700_000_000 * SECOND  # [ns]
TOPICS = {type_name: f'/{topic}' for topic, type_name in INPUTS.items()}


def unchanged(time: float) -> float:
    """The friction of the law."""
    del time
    return 1.0


def nothing(time: float) -> float:
    """No load."""
    del time
    return 0.0


@dataclass(frozen=True)
class Day:
    """What the machine does, by ``time`` [s] since its start."""

    friction: float  # [N] of the law at the pressure
    scale: Callable[[float], float] = unchanged  # [-] of the friction
    load: Callable[[float], float] = nothing  # [N] in the force sum, not known to the estimator
    speed: float = 0.02  # [m/s] of even sliding
    stroke_time: float = 1.0  # [s]
    period: float = 0.01  # [s] between samples
    mass: float = 5.0  # [kg]
    noise: float = 0.02  # [-] of the force sensor, a share of the friction
    count: float = 1e-6  # [m] of the encoder
    presliding: float = 1e-4  # [m]
    dip: float = 0.1  # [-] by which fast sliding has less friction than slow sliding
    pressure: tuple[float, float] = (3e6, 3e6)  # [Pa, gauge]
    one_direction: bool = False


def samples(day: Day, seconds: float, seed: int, start: int = START) -> Iterator[RodSample]:
    """The samples of a day: trapezoids of velocity with ramps of a tenth of the stroke."""
    rng = np.random.default_rng(seed)
    count = round(seconds / day.period)
    noise = day.noise * day.friction * rng.standard_normal(count)
    noise = noise.tolist()
    ramp = 0.1 * day.stroke_time
    position, counted, since_turn, before, direction = 0.0, 0.0, 1.0, 0.0, 0.0
    for i in range(count):
        time = i * day.period
        into = time % day.stroke_time
        share = min(into / ramp, (day.stroke_time - into) / ramp, 1.0)
        side = 1.0 if day.one_direction or int(time / day.stroke_time) % 2 == 0 else -1.0
        velocity = side * share * day.speed
        if velocity * direction < 0.0:
            since_turn = 0.0
        direction = side
        position += velocity * day.period
        since_turn += abs(velocity) * day.period
        measured = round(position / day.count) * day.count
        friction = (
            day.friction
            * day.scale(time)
            * (1.0 + day.dip * (math.exp(-abs(velocity) / 2e-3) - math.exp(-day.speed / 2e-3)))
        )
        friction *= 1.0 - 2.0 * math.exp(-since_turn / day.presliding) * (since_turn < 1.0) if day.presliding else 1.0
        inertia = day.mass * (velocity - before) / day.period
        force = side * friction + inertia + day.load(time) + noise[i]
        stamp = start + round(time * SECOND)
        yield RodSample(stamp, (measured - counted) / day.period, Pressure(stamp, *day.pressure), Force(stamp, force))
        before, counted = velocity, measured


def write_day(path: Path, day: Day, seconds: float, seed: int = 0, start: int = START) -> Path:
    """A bag with the inputs of a day."""
    with BagWriter(path) as writer:
        for sample in samples(day, seconds, seed, start):
            velocity = Velocity(sample.stamp, sample.velocity, b'rod')
            for number, record in enumerate((sample.pressure, sample.force, velocity)):
                type_name = type_of(record)
                writer.write(TOPICS[type_name], type_name, sample.stamp + 1000 * number, encode(record, b'rod'))
    return path
