"""Encoders and rounded set points: no reversal that the motion has not, no wrong friction with status 0.

Every case goes through the pipeline of the node, compiled, with the same bytes. The rod is no plant of this project:
it is held, or moves as a given function of time, and friction opposes the motion. Exit code 1 if a claim fails.
"""

import math
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))
from harness import compiled_code  # noqa: F401  before anything is compiled
from harness.campaign import parser_of, tell
from harness.compensation import compensating

from seal_friction_ros.core.estimation.compiled_pipeline import receive_all
from seal_friction_ros.core.estimation.pipeline import PipelineParameters, init
from seal_friction_ros.core.messages.blocks import MOST_MESSAGES, Kind, Messages
from seal_friction_ros.core.messages.coder import decode, encode
from seal_friction_ros.core.messages.layouts import ESTIMATE_TYPE, FEEDFORWARD_TYPE
from seal_friction_ros.core.messages.records import Force, Pressure, ServoReference, Velocity

START = 1_700_000_000_000_000_000  # [ns]
PRESSURE = 2e6  # [Pa]
ANGULAR_RATE = 2.0 * math.pi  # [rad/s] of every sine
HOLDING_FORCE = 20.0  # [N]
CONFIGURATION = compensating()
PARAMETERS = CONFIGURATION.parameters()
BY_MEASURED_VELOCITY = PARAMETERS._replace(feedforward=replace(CONFIGURATION.feedforward, use_measured_velocity=True))
SCALE, SMOOTHING = CONFIGURATION.feedforward.scale, CONFIGURATION.feedforward.smoothing_velocity
LARGEST_WRONG = 1e-3  # [-] share of samples with status 0 and a wrong friction
LARGEST_STEP = 8.0  # [N] of the feed-forward in one sample while the reference keeps its speed


class Encoder(NamedTuple):
    """Sensor or set point of positions that are rounded and noisy."""

    count: float  # [m]
    noise: float  # [m] RMS
    rate: float  # [Hz]

    def __str__(self) -> str:
        return f'{self.count * 1e6:g} um, {self.noise * 1e6:g} um RMS, {self.rate / 1e3:g} kHz'


ENCODERS = (Encoder(1e-6, 1e-6, 1000.0), Encoder(5e-6, 1.25e-6, 1000.0), Encoder(1e-6, 0.3e-6, 5000.0))
HUMS = ((20.0, 0.005), (50.0, 0.01), (50.0, 0.1), (100.0, 0.05))  # [Hz], [m/s] of an analogue velocity
SET_POINTS = (Encoder(1e-6, 0.0, 1000.0), Encoder(1e-6, 0.3e-6, 1000.0))


class Answers(NamedTuple):
    """Arrays with one entry per velocity sample."""

    status: np.ndarray
    friction: np.ndarray
    force: np.ndarray
    coulomb: np.ndarray


class Found(NamedTuple):
    """One case and its figures; None: of no interest in it."""

    case: str
    seconds: float
    reversals: int  # of the force, or of the friction with status 0
    allowed_reversals: int
    wrong: float | None = None  # [-] share of samples with status 0 whose friction is wrong
    good: float | None = None  # [-] share of samples with status 0
    least_good: float = 0.0
    largest_step: float | None = None  # [N] of the force in one sample
    mean_error: float | None = None  # [-] of the force, of the force for the clean velocity

    @property
    def holds(self) -> bool:
        """Whether every claim holds."""
        return (
            self.reversals <= self.allowed_reversals
            and (self.wrong or 0.0) <= LARGEST_WRONG
            and (self.good is None or self.good > self.least_good)
            and (self.largest_step or 0.0) < LARGEST_STEP
            and abs(self.mean_error or 0.0) <= 0.05
        )


def sampled_velocity(encoder: Encoder, position: np.ndarray) -> np.ndarray:
    """Difference of the rounded and noisy position [m/s]."""
    noise = np.random.default_rng(5).normal(0.0, 1.0, len(position)) * encoder.noise
    return differences(np.round((position + noise) / encoder.count) * encoder.count, encoder.rate)


def differences(values: np.ndarray, rate: float) -> np.ndarray:
    return np.diff(values, prepend=values[0]) * rate


def answers_of(
    parameters: PipelineParameters,
    rate: float,
    velocity: np.ndarray,
    force_sum: np.ndarray,
    reference: np.ndarray | None = None,
    acceleration: np.ndarray | None = None,
) -> Answers:
    """Take the samples in the order of the node, each message received 0.1 ms after its stamp."""
    reference = np.zeros_like(velocity) if reference is None else reference
    acceleration = np.zeros_like(velocity) if acceleration is None else acceleration
    state, rows = init(parameters), []
    step = round(1e9 / rate)
    for first in range(0, len(velocity), MOST_MESSAGES // 4):
        pieces, kinds, times = [], [], []
        for i in range(first, min(first + MOST_MESSAGES // 4, len(velocity))):
            stamp = START + i * step
            for kind, record in (
                (Kind.PRESSURE, Pressure(stamp, PRESSURE, PRESSURE)),
                (Kind.FORCE, Force(stamp, force_sum[i])),
                (Kind.REFERENCE, ServoReference(stamp, 0.0, reference[i], acceleration[i])),
                (Kind.VELOCITY, Velocity(stamp, velocity[i])),
            ):
                pieces.append(encode(record))
                kinds.append(kind)
                times.append(stamp + 100_000)
        sizes, received = np.array([len(piece) for piece in pieces]), np.array(times)
        data = np.frombuffer(b''.join(pieces), np.uint8)
        messages = Messages(data, np.array(kinds, np.uint8), np.cumsum(sizes) - sizes, sizes, received, received)
        state, answers = receive_all(parameters, state, messages)
        for i in np.flatnonzero(answers.estimate_sizes):
            at, size = answers.estimate_offsets[i], answers.estimate_sizes[i]
            estimate = decode(ESTIMATE_TYPE, answers.data[at : at + size].tobytes())
            at, size = answers.feedforward_offsets[i], answers.feedforward_sizes[i]
            force = decode(FEEDFORWARD_TYPE, answers.data[at : at + size].tobytes()).force if size else 0.0
            rows.append((estimate.status, estimate.friction_force, force, estimate.coulomb_friction))
    return Answers(*np.array(rows).T)


def reversals(values: np.ndarray) -> int:
    signs = np.sign(values[values != 0.0])
    return int(np.count_nonzero(np.diff(signs)))


def quality(answers: Answers, truth: np.ndarray) -> dict[str, float]:
    """Shares of samples with status 0, and of those off by more than a tenth of the Coulomb friction."""
    is_good = answers.status == 0
    wrong = np.abs(answers.friction - truth) > 0.1 * answers.coulomb
    return {'wrong': float(np.mean(wrong & is_good)), 'good': float(np.mean(is_good))}


def held_rod(encoder: Encoder, seconds: float) -> Found:
    """A rod that is held by a force is stuck."""
    time = np.arange(0.0, seconds, 1.0 / encoder.rate)
    held = np.full_like(time, HOLDING_FORCE)
    answers = answers_of(PARAMETERS, encoder.rate, sampled_velocity(encoder, np.zeros_like(time)), held)
    turns = reversals(answers.friction[answers.status == 0])
    return Found(f'held rod; {encoder}', seconds, turns, 0, **quality(answers, held), least_good=1.0 - 1.0 / seconds)


def moving_rod(encoder: Encoder, seconds: float) -> Found:
    """A rod that moves 2 mm to and fro slides, with friction against the motion."""
    time = np.arange(0.0, seconds, 1.0 / encoder.rate)
    coulomb = answers_of(PARAMETERS, encoder.rate, np.full(2, 0.1), np.zeros(2)).coulomb[-1]
    friction = coulomb * np.sign(np.cos(ANGULAR_RATE * time))
    velocity = sampled_velocity(encoder, 2e-3 * np.sin(ANGULAR_RATE * time))
    answers = answers_of(PARAMETERS, encoder.rate, velocity, friction)
    turns = reversals(answers.friction[answers.status == 0])
    return Found(
        f'rod to and fro; {encoder}', seconds, turns, round(2 * seconds), **quality(answers, friction), least_good=0.5
    )


def held_rod_with_hum(rate: float, amplitude: float, seconds: float) -> Found:
    """A held rod is stuck, though its analogue velocity hums, with noise and steps of 0.1 mm/s."""
    time = np.arange(0.0, seconds, 1e-3)
    noise = np.random.default_rng(7).normal(0.0, 1.0, (2, len(time)))
    velocity = np.round((amplitude * np.sin(2.0 * math.pi * rate * time) + 3e-4 * noise[0]) / 1e-4) * 1e-4
    held = HOLDING_FORCE + noise[1]
    answers = answers_of(PARAMETERS, 1000.0, velocity, held)
    turns = reversals(answers.friction[answers.status == 0])
    case = f'held rod; hum of {amplitude * 1e3:g} mm/s at {rate:g} Hz'
    return Found(case, seconds, turns, 0, **quality(answers, held))


def measured_velocity_at_rest(encoder: Encoder, seconds: float) -> Found:
    """With ``use_measured_velocity`` a rod at rest gets no reversal."""
    time = np.arange(0.0, seconds, 1.0 / encoder.rate)
    velocity = sampled_velocity(encoder, np.zeros_like(time))
    answers = answers_of(BY_MEASURED_VELOCITY, encoder.rate, velocity, np.full_like(time, HOLDING_FORCE))
    return Found(f'use_measured_velocity, rod at rest; {encoder}', seconds, reversals(answers.force), 0)


def held_speed(set_point: Encoder, seconds: float, speed: float) -> Found:
    """A set point that is rounded and keeps its speed [m/s] makes no reversal, and on average the clean force."""
    time = np.arange(0.0, seconds, 1.0 / set_point.rate)
    reference = sampled_velocity(set_point, speed * time)
    nothing = np.zeros_like(time)
    acceleration = differences(reference, set_point.rate)
    answers = answers_of(PARAMETERS, set_point.rate, nothing, nothing, reference, acceleration)
    settled = answers.force[time > min(2.0, 0.5 * seconds)]
    largest = SCALE * answers.coulomb[-1]
    return Found(
        f'set point at {speed * 1e3:g} mm/s; {set_point}',
        seconds,
        reversals(answers.force),
        0,
        largest_step=float(np.abs(np.diff(settled)).max()),
        mean_error=float(settled.mean() / largest - math.tanh(speed / SMOOTHING)),
    )


def set_point_sine(set_point: Encoder, seconds: float, amplitude: float) -> Found:
    """A sine that is rounded, with ``amplitude`` [m], makes the reversals of the sine."""
    time = np.arange(0.0, seconds, 1.0 / set_point.rate)
    reference = sampled_velocity(set_point, amplitude * np.sin(ANGULAR_RATE * time))
    nothing = np.zeros_like(time)
    acceleration = differences(reference, set_point.rate)
    answers = answers_of(PARAMETERS, set_point.rate, nothing, nothing, reference, acceleration)
    turns = reversals(answers.force)
    case = f'set point sine of {amplitude * 1e3:g} mm at 1 Hz; {set_point}'
    return Found(case, seconds, turns, round(2 * seconds) if turns >= round(2 * seconds) - 2 else -1)


def all_cases(seconds: float) -> Iterator[Callable[[], Found]]:
    """Every case, to be called."""
    for encoder in ENCODERS:
        for case in (held_rod, moving_rod, measured_velocity_at_rest):
            yield lambda case=case, encoder=encoder: case(encoder, seconds)
    for rate, amplitude in HUMS:
        yield lambda r=rate, a=amplitude: held_rod_with_hum(r, a, seconds)
    for set_point in SET_POINTS:
        for speed in (0.0, 5e-5, 5e-4, 9e-4, 1.5e-3, 5e-3):
            yield lambda s=set_point, v=speed: held_speed(s, seconds, v)
        for amplitude in (2e-5, 1e-4, 2e-3):
            yield lambda s=set_point, a=amplitude: set_point_sine(s, seconds, a)


def main() -> int:
    """Run all cases; print the table."""
    arguments = parser_of(__doc__, seconds=(60.0, 'length of each case [s]')).parse_args()
    results = [case() for case in all_cases(arguments.seconds)]
    tell([{**found._asdict(), 'holds': found.holds} for found in results], as_json=arguments.json)
    return 0 if all(found.holds for found in results) else 1


if __name__ == '__main__':
    sys.exit(main())
