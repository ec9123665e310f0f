"""A boom lifted by a single-rod cylinder, simulated apart from the package: own mechanics, oil, valve and friction.

The cylinder (bore 150 mm, rod 100 mm) pushes a hinged boom, as on a crane. Load and equivalent mass follow from the
triangle of hinge, cylinder foot and cylinder eye. There is no load cell: a log holds pressures, position and velocity.
"""

import math
from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

import numpy as np

AREA_A = math.pi / 4 * 0.150**2  # [m2]
AREA_B = math.pi / 4 * (0.150**2 - 0.100**2)  # [m2]
BAR = 1e5
STROKE = 0.9  # [m]
RATE = 100  # [Hz]
STEP = 1e-3  # [s]
BULK = 1.2e9  # [Pa]
DEAD_VOLUME = 4e-3  # [m3] at each end
DAMPING = 4e-10  # [m3/(s Pa)] of the pressure feedback above 0.3 Hz
TANK, FEED = 3 * BAR, 12 * BAR
SHORTEST = 1.2  # [m] cylinder between its eyes, rod in


@dataclass(frozen=True)
class Boom:
    """Parameters of one machine."""

    foot: float = 1.40  # [m] hinge to cylinder foot
    eye: float = 0.95  # [m] hinge to cylinder eye
    moment: float = 23.5e3  # [N m] weight times arm, horizontal
    inertia: float = 8.0e3  # [kg m2]
    tilt: float = 2.40  # [rad] from the direction of the cylinder foot to the horizontal
    coulomb: float = 2.2e3  # [N]
    gain: float = 110.0  # [N] at 1 bar, mean of both chambers
    exponent: float = 2.0 / 3.0
    stribeck: float = 300.0  # [N]
    stribeck_velocity: float = 0.01  # [m/s]
    viscous: float = 500.0  # [N s/m]

    def triangle(self, x):
        """Boom angle from the foot [rad], lever arm of the cylinder [m]."""
        length = SHORTEST + x
        cosine = (self.foot**2 + self.eye**2 - length**2) / (2 * self.foot * self.eye)
        return np.arccos(cosine), self.foot * self.eye * np.sqrt(1.0 - cosine**2) / length

    def load(self, x):
        """Load along the cylinder [N] at extension ``x`` [m]."""
        angle, arm = self.triangle(x)
        return self.moment * np.cos(angle - self.tilt) / arm

    def mass(self, x):
        """Equivalent mass at the cylinder [kg]."""
        return self.inertia / self.triangle(x)[1] ** 2

    def friction(self, v, p_a, p_b):
        """Friction [N], signed."""
        pressure = 0.5 * (max(p_a, 0.0) ** self.exponent + max(p_b, 0.0) ** self.exponent) / BAR**self.exponent
        size = self.coulomb + self.gain * pressure
        size += self.stribeck * math.exp(-((v / self.stribeck_velocity) ** 2))
        return math.tanh(v / 5e-4) * size + self.viscous * v


class BoomRun(NamedTuple):
    """What happens, at 100 Hz."""

    time: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    p_a: np.ndarray
    p_b: np.ndarray
    load: np.ndarray  # [N] at the position
    friction: np.ndarray  # [N] signed


def trapezoids(speeds, low=0.05, high=0.85, ramp=0.5, rest=0.6):
    """Position over time [m], 1 kHz: to and fro at each speed."""
    start = np.full(int(rest / STEP), low)
    parts = [start]
    for speed in speeds:
        span = high - low
        held = span / speed - ramp
        up = np.linspace(0, speed, int(ramp / STEP))
        v = np.concatenate([up, np.full(int(held / STEP), speed), up[::-1], np.zeros(int(rest / STEP))])
        way = np.cumsum(v) * STEP
        way *= span / way[-1]
        parts += [low + way, high - way]
    return np.concatenate(parts)


def sines(periods, low=0.05, high=0.85, cycles=2):
    """Position over time [m], 1 kHz."""
    parts = []
    for period in periods:
        t = np.arange(0, cycles * period, STEP)
        parts.append(low + (high - low) * 0.5 * (1 - np.cos(2 * np.pi * t / period)))
    return np.concatenate(parts)


def both():
    return np.concatenate([trapezoids((0.06, 0.12, 0.2)), sines((14.0, 9.0))])


@cache
def simulate(boom=Boom(), motion='both', payload=()):
    """Run a motion; ``payload`` are (time [s], factor on the moment) from which on the load is changed."""
    reference = MOTIONS[motion]()
    grid = np.linspace(-0.05, 1.0, 600)
    loads, masses = boom.load(grid), boom.mass(grid)
    slopes = np.gradient(masses, grid)
    width = grid[1] - grid[0]
    loads, masses, slopes = loads.tolist(), masses.tolist(), slopes.tolist()
    want_v = np.gradient(reference, STEP)
    x, v = float(reference[0]), 0.0
    p_b = 6 * BAR
    p_a = (np.interp(x, grid, loads) + p_b * AREA_B) / AREA_A
    slow = p_a
    every = round(1 / RATE / STEP)
    rows = []
    changes = list(payload)
    factor = 1.0
    for i, (x_ref, v_ref) in enumerate(zip(reference.tolist(), want_v.tolist(), strict=True)):
        if changes and i * STEP >= changes[0][0]:
            factor = changes.pop(0)[1]
        place = (x + 0.05) / width
        k = int(place)
        part = place - k
        load = factor * (loads[k] + part * (loads[k + 1] - loads[k]))
        mass = masses[k] + part * (masses[k + 1] - masses[k])
        friction = boom.friction(v, p_a, p_b)
        if i % every == 0:
            rows.append((i * STEP, x, v, p_a, p_b, load, friction))
        v += STEP * (p_a * AREA_A - p_b * AREA_B - friction - load - 0.5 * slopes[k] * v * v) / mass
        x += STEP * v
        line, valve = (TANK, 5.0e-6) if v_ref >= 0 else (FEED, 8.0e-6)
        slow += STEP / 0.5 * (p_a - slow)
        q_a = AREA_A * (v_ref + 4.0 * (x_ref - x)) - DAMPING * (p_a - slow)
        drop = line - p_b
        q_b = valve * drop / math.sqrt(abs(drop) + 4e6)
        p_a += STEP * BULK / (DEAD_VOLUME + AREA_A * x) * (q_a - AREA_A * v)
        p_b += STEP * BULK / (DEAD_VOLUME + AREA_B * (STROKE - x + 0.05)) * (q_b + AREA_B * v)
    return BoomRun(*np.array(rows).T)


MOTIONS = {
    'both': both,
    'trapezoids': lambda: trapezoids((0.06, 0.12, 0.2, 0.09)),
    'sines': lambda: sines((16.0, 10.0, 7.0)),
    'one_sine': lambda: sines((12.0,), cycles=5),
    'single': lambda: trapezoids((0.1,)),
}


class BoomLog(NamedTuple):
    """What the sensors say."""

    time: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    p_a: np.ndarray
    p_b: np.ndarray

    @property
    def force_sum(self):
        return self.p_a * AREA_A - self.p_b * AREA_B


def measured(run, seed, *, of_range=0.003, of_reading=0.0, full_scale=100 * BAR, step=50e-6):
    """Log of a run: pressure noise as shares of full scale and of the reading, encoder step [m]."""
    random = np.random.default_rng(seed)
    pressures = [
        p + random.standard_normal(len(p)) * (of_range * full_scale + of_reading * np.abs(p))
        for p in (run.p_a, run.p_b)
    ]
    position = np.round(run.position / step) * step
    velocity = np.round(run.velocity / 2e-4) * 2e-4
    return BoomLog(run.time, position, velocity, *pressures)
