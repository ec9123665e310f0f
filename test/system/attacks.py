"""Status 0 under attack: a rod on strokes and rests with exact rigid friction, and what sensors and loads do to it.

``python test/system/attacks.py [--mass 0 | --random 100 [--first 400]]``. Wrong is a sample with status 0 whose
friction force is outside the 95 % band; the first 2 s do not count. Exit code 1 if more than 0.5 % of the samples with
status 0 of an attack are wrong, or fewer than 80 % of the samples of a clean machine have status 0.

``--random`` instead draws so many machines, each by its number: mass, known or not, strokes or sines, and one to three
attacks at once (of two that change the velocity the later one counts). Exit code 1 if more than 0.5 % of all samples
with status 0 are wrong.
"""

import sys
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))
from harness.campaign import parser_of, tell
from paths import ROOT

from seal_friction_ros.core.estimation.adaptation import AdaptationSettings
from seal_friction_ros.core.estimation.estimator import EstimatorParameters, EstimatorSettings, init, step
from seal_friction_ros.core.estimation.records import RodSample
from seal_friction_ros.core.foundation.normal_distribution import BAND_95
from seal_friction_ros.core.friction.actuator import MountedSeal, actuator_friction
from seal_friction_ros.core.friction.seal_file import parse_seal
from seal_friction_ros.core.messages.records import Force, Pressure
from seal_friction_ros.files import read_yaml

SEAL = parse_seal(read_yaml(ROOT / 'config' / 'seals' / 'ms28775_114.yaml'))
SEALS = (MountedSeal(SEAL, 'a'), MountedSeal(SEAL, 'b'))
PRESSURE = 3e6  # [Pa]
COULOMB = actuator_friction(SEALS, PRESSURE, PRESSURE).coulomb_friction  # [N]
MASS = 5.0  # [kg]
MOST_AT_ONCE = 3  # attacks on a random machine
MOST_WRONG = 0.005  # [-]
PERIOD = 1e-3  # [s]
SKIPPED = 2.0  # [s]


@dataclass(frozen=True)
class Rod:
    """Signals of shape (n,)."""

    position: np.ndarray  # [m]
    velocity: np.ndarray  # [m/s] as measured
    force_sum: np.ndarray  # [N] as measured
    friction: np.ndarray  # [N] true

    @property
    def time(self) -> np.ndarray:
        """Time [s]."""
        return PERIOD * np.arange(len(self.position))


def strokes(seconds: float, seed: int = 5, slowest: float = 0.01, fastest: float = 0.15) -> Rod:
    """Smooth strokes of 2 to 60 mm, half of them after a rest under a force that the seals hold."""
    rng, position, friction, place, before = np.random.default_rng(seed), [0.0], [0.0], 0.0, 0.0
    while len(position) * PERIOD < seconds:
        way = float(rng.choice([-1.0, 1.0]) * rng.uniform(2e-3, 0.06))
        way = -way if abs(place + way) > 0.09 else way
        rest = int(rng.choice([0, 300, 1000]))
        moment = np.arange(rest)
        held = float(rng.uniform(-0.8, 0.8)) * COULOMB
        held = 0.9 * before * np.exp(-moment / 60.0) + held * (1.0 - np.exp(-moment / 60.0))
        start = np.clip((moment - rest + 50) / 50.0, 0.0, 1.0)
        position += [place] * rest
        friction += list((1.0 - start) * held + start * 0.95 * COULOMB * np.sign(way))
        speed = 10.0 ** float(rng.uniform(np.log10(slowest), np.log10(fastest)))
        share = np.linspace(0.0, 1.0, int(max(1.5 * abs(way) / speed, 0.05) / PERIOD) + 1)[1:]
        position += list(place + way * (3.0 * share**2 - 2.0 * share**3))
        before = float(np.copysign(COULOMB, way))
        friction += [before] * len(share)
        place += way
    count = round(seconds / PERIOD)
    x, force = np.array(position[:count]), np.array(friction[:count])
    velocity = np.gradient(x, PERIOD)
    return Rod(x, velocity, force + MASS * np.gradient(velocity, PERIOD), force)


def swinging(seconds: float, amplitude: float, frequency: float) -> Rod:
    """A sine from a turn on."""
    phase = 2.0 * np.pi * frequency * PERIOD * np.arange(round(seconds / PERIOD))
    x, velocity = -amplitude * np.cos(phase), 2.0 * np.pi * frequency * amplitude * np.sin(phase)
    friction = COULOMB * np.sign(velocity)
    return Rod(x, velocity, friction + MASS * np.gradient(velocity, PERIOD), friction)


def with_load(rod: Rod, load: np.ndarray | float) -> Rod:
    """A load in the force sum that nobody takes off."""
    return replace(rod, force_sum=rod.force_sum + load)


def with_unmeasured_force(rod: Rod, force: np.ndarray) -> Rod:
    """A force on the rod that is not in the force sum: at rest the seals hold it, as far as they can."""
    most = 0.95 * COULOMB
    friction = np.where(rod.velocity == 0.0, np.clip(rod.friction + force, -most, most), rod.friction)
    return with_load(with_friction(rod, friction), -force)


def with_friction(rod: Rod, friction: np.ndarray) -> Rod:
    """Another friction."""
    return replace(rod, force_sum=rod.force_sum - rod.friction + friction, friction=friction)


def late(signal: np.ndarray, milliseconds: int) -> np.ndarray:
    """A signal that comes late."""
    return np.concatenate([np.full(milliseconds, signal[0]), signal[:-milliseconds]])


def counted(rod: Rod, count: float) -> Rod:
    """The velocity of an encoder with this count [m]."""
    return replace(rod, velocity=np.diff(np.round(rod.position / count) * count, prepend=0.0) / PERIOD)


def noisy(rod: Rod, share: float, seed: int = 1) -> Rod:
    """White noise in the force sum, as a share of the friction."""
    return with_load(rod, share * COULOMB * np.random.default_rng(seed).standard_normal(len(rod.position)))


def held(
    velocity: Callable[[np.ndarray], np.ndarray], force: Callable[[np.ndarray], np.ndarray]
) -> Callable[[Rod], Rod]:
    """A rod that is held, with a velocity that is not its own."""

    def made(rod: Rod) -> Rod:
        friction = force(rod.time)
        return Rod(np.zeros_like(rod.time), velocity(rod.time), friction, friction)

    return made


def vibrating(frequency: float, amplitude: float) -> Callable[[Rod], Rod]:
    """A rod of 20 kg that vibrates with ``amplitude`` [m]."""

    def made(rod: Rod) -> Rod:
        rate = 2.0 * np.pi * frequency
        velocity = amplitude * rate * np.cos(rate * rod.time + 0.3)
        friction = COULOMB * np.sign(velocity)
        inertia = -20.0 * amplitude * rate**2 * np.sin(rate * rod.time + 0.3)
        return Rod(rod.position, velocity, friction + inertia, friction)

    return made


def _slides(rod: Rod) -> np.ndarray:
    return (rod.velocity != 0.0).astype(float)


CLEAN: dict[str, Callable[[Rod], Rod]] = {
    'nothing': lambda rod: rod,
    'encoder of 1 um, force noise of 2 %': lambda rod: noisy(counted(rod, 1e-6), 0.02),
}
ATTACKS: dict[str, Callable[[Rod], Rod]] = {
    'offset of 0.2 of the friction': lambda rod: with_load(rod, 0.2 * COULOMB),
    'offset of the friction': lambda rod: with_load(rod, COULOMB),
    'load over the position, 5 times the friction': lambda rod: with_load(
        rod, 5.0 * COULOMB * rod.position / np.ptp(rod.position)
    ),
    'boom: load over the position that bends': lambda rod: with_load(
        rod, 2.0 * COULOMB * np.sin(2.2 * (rod.position - rod.position.min()) / np.ptp(rod.position) + 0.3)
    ),
    'payload of 60 N on and off every 7 s': lambda rod: with_load(rod, 60.0 * (rod.time // 7.0 % 2)),
    'force of 40 N that nobody measures, on and off every 4 s': lambda rod: with_unmeasured_force(
        rod, 40.0 * (rod.time // 4.0 % 2)
    ),
    **{f'friction times {f}': (lambda rod, f=f: with_friction(rod, f * rod.friction)) for f in (0.6, 0.8, 1.25, 1.6)},
    **{
        f'direction: {q:.0%} more, {q:.0%} less': (
            lambda rod, q=q: with_friction(rod, rod.friction + q * np.abs(rod.friction) * _slides(rod))
        )
        for q in (0.05, 0.1, 0.15)
    },
    'viscous friction that the file has not': lambda rod: with_friction(
        rod, rod.friction + 0.5 * COULOMB * rod.velocity / 0.15
    ),
    'Stribeck friction that the file has not': lambda rod: with_friction(
        rod, rod.friction * (1.0 + 0.4 * _slides(rod) * np.exp(-((rod.velocity / 0.02) ** 2)))
    ),
    **{
        f'friction by 30 % over {way * 1e3:.0f} mm': (
            lambda rod, way=way: with_friction(rod, rod.friction * (1.0 + 0.3 * np.sin(2 * np.pi * rod.position / way)))
        )
        for way in (0.05, 0.005)
    },
    'friction halves at 15 s': lambda rod: with_friction(rod, rod.friction * np.where(rod.time > 15.0, 0.5, 1.0)),
    'friction drifts by 30 % in 5 s': lambda rod: with_friction(
        rod, rod.friction * (1.0 + 0.3 * np.sin(0.3 * rod.time))
    ),
    'friction jumps by 30 % every 5 s': lambda rod: with_friction(
        rod, rod.friction * (1.0 + 0.3 * (rod.time // 5.0 % 2))
    ),
    'load swings at 0.7 Hz': lambda rod: with_load(rod, 0.4 * COULOMB * np.sin(2.0 * np.pi * 0.7 * rod.time)),
    'velocity 10 ms late': lambda rod: replace(rod, velocity=late(rod.velocity, 10)),
    'force sum 20 ms late': lambda rod: replace(rod, force_sum=late(rod.force_sum, 20)),
    'encoder of 5 um': lambda rod: counted(rod, 5e-6),
    'encoder of 50 um': lambda rod: counted(rod, 5e-5),
    'force noise of 30 %': lambda rod: noisy(rod, 0.3),
    'hum of 20 mm/s at 3 Hz on a held rod': held(
        lambda t: 0.02 * np.sin(6.0 * np.pi * t), lambda t: np.full_like(t, 0.4 * COULOMB)
    ),
    **{
        f'velocity zero of {zero * 1e3:g} mm/s': (lambda rod, zero=zero: replace(rod, velocity=rod.velocity + zero))
        for zero in (0.0015, 0.003)
    },
    **{
        f'velocity zero of 3 mm/s on a rod held under {share:g} of the friction': held(
            lambda t: np.full_like(t, 3e-3), lambda t, share=share: np.full_like(t, share * COULOMB)
        )
        for share in (-0.5, 0.0)
    },
    'vibration of 50 um at 300 Hz': vibrating(300.0, 5e-5),
    'vibration of 0.2 mm at 205 Hz': vibrating(205.0, 2e-4),
}


ALONE = ('velocity zero', 'hum', 'vibration')
"""Beginnings of the names of attacks that are not combined: they replace the rod, or need its rests."""


class Machine(NamedTuple):
    """A rod and what is known of it."""

    rod: Rod
    mass: float = MASS  # [kg] that the estimator knows; 0.0: unknown
    name: str = ''


def random_machine(number: int, seconds: float) -> Machine:
    """The machine of a number."""
    rng = np.random.default_rng(number)
    mass = float(10.0 ** rng.uniform(0.3, 1.6))
    if rng.random() < 0.5:
        rod, motion = strokes(seconds, number, fastest=float(rng.choice([0.03, 0.15]))), 'strokes'
    else:
        amplitude, frequency = 10.0 ** rng.uniform((-2.3, -0.7), (-1.5, 0.3))
        rod, motion = swinging(seconds, float(amplitude), float(frequency)), f'{frequency:.2g} Hz'
    rod = with_load(rod, (mass - MASS) * np.gradient(rod.velocity, PERIOD))
    some = [name for name in ATTACKS if not name.startswith(ALONE)]
    chosen = sorted(rng.choice(len(some), rng.integers(1, MOST_AT_ONCE, endpoint=True), replace=False))
    for each in chosen:
        rod = ATTACKS[some[each]](rod)
    known = mass if rng.random() < 0.5 else 0.0
    return Machine(
        rod,
        known,
        f'{number}: {mass:.0f} kg, {"known" if known else "unknown"}, {motion}, '
        + ', '.join(some[each] for each in chosen),
    )


class Found(NamedTuple):
    """Shares of samples [-]."""

    good: float  # with status 0
    wrong: float  # of these, outside the band


def attacked(name: str, mode: str, seconds: float, mass: float = MASS) -> Found:
    """Run one attack; the estimator knows a ``mass`` [kg], or none where it is 0.0."""
    return estimated(Machine((CLEAN | ATTACKS)[name](strokes(seconds)), mass), mode)


def estimated(machine: Machine, mode: str) -> Found:
    """Estimate the friction of a machine."""
    rod = machine.rod
    parameters = EstimatorParameters(EstimatorSettings(), SEALS, AdaptationSettings(mode, moving_mass=machine.mass))
    state, rows = init(parameters), []
    for i, (velocity, force) in enumerate(zip(rod.velocity.tolist(), rod.force_sum.tolist(), strict=True)):
        stamp = 10**12 + i * round(PERIOD * 1e9)
        sample = RodSample(stamp, velocity, Pressure(stamp, PRESSURE, PRESSURE), Force(stamp, force))
        state, estimate = step(parameters, state, sample)
        rows.append((estimate.status, estimate.friction_force, estimate.friction_force_std))
    first = round(SKIPPED / PERIOD)
    status, friction, std = np.array(rows)[first:].T
    good = status == 0
    outside = np.abs(friction - rod.friction[first:]) > BAND_95 * std + 1e-9
    return Found(float(good.mean()), float((good & outside).sum() / max(good.sum(), 1)))


def main() -> int:
    """Run all; print the table, or JSON."""
    parser = parser_of(
        __doc__,
        seconds=(40.0, 'of an attack [s]'),
        workers=(2, 'processes'),
        random=(0, 'machines instead'),
        first=(0, 'number of the first of them'),
        mass=(MASS, 'that the estimator knows; 0: unknown [kg]'),
    )
    arguments = parser.parse_args()
    numbers = range(arguments.first, arguments.first + arguments.random)
    cases = [(name, mode) for name in numbers or CLEAN | ATTACKS for mode in ('observe', 'on')]
    with ProcessPoolExecutor(arguments.workers) as pool:
        found = list(pool.map(partial(_attacked, arguments.seconds, arguments.mass), cases))
    rows = [{'case': said, 'mode': mode, **one._asdict()} for (_, mode), (said, one) in zip(cases, found, strict=True)]
    if arguments.random:
        good, wrong = np.mean([(one.good, one.good * one.wrong) for _, one in found], axis=0).tolist()
        whole = Found(good, wrong / max(good, 1e-12))
        rows = [{'case': f'all of {len(numbers)} machines', 'mode': 'both', **whole._asdict()}, *rows]
        tell(rows, as_json=arguments.json, title='shares of samples')
        return int(whole.wrong > MOST_WRONG)
    tell(rows, as_json=arguments.json, title='shares of samples')
    fails = any(one.wrong > MOST_WRONG for _, one in found)
    return int(fails or any(one.good < 0.8 for name, one in found if name in CLEAN))


def _attacked(seconds: float, mass: float, case: tuple[str | int, str]) -> tuple[str, Found]:
    """What was done, and what was found."""
    name, mode = case
    if isinstance(name, str):
        return name, attacked(name, mode, seconds, mass)
    machine = random_machine(name, seconds)
    return machine.name, estimated(machine, mode)


if __name__ == '__main__':
    sys.exit(main())
