"""Encoders and rounded references: no reversal that the motion has not, no wrong friction with status 0.

Each case runs for 60 s through the pipeline of the node (compiled, the same bytes). The plant is none of ours: a rod
that is held, or moves as a given function of time, with friction opposing the motion.
"""

import math
from typing import NamedTuple

import numpy as np
import pytest

from seal_friction_ros.core.estimation.compiled_pipeline import MOST_MESSAGES, Kind, Messages, receive_all
from seal_friction_ros.core.estimation.messages import ESTIMATE_TYPE, FEEDFORWARD_TYPE, decode, encode
from seal_friction_ros.core.estimation.pipeline import PipelineParameters, init
from seal_friction_ros.core.estimation.records import Force, Pressure, ServoReference, Velocity
from seal_friction_ros.files import default_configuration

SECONDS = 60
START = 1_700_000_000_000_000_000  # [ns]
PRESSURE = 2e6  # [Pa]
COULOMB = default_configuration().parameters()
CYCLE = 2.0 * math.pi  # [rad]


class Encoder(NamedTuple):
    """Sensor or set point of positions that are rounded and noisy."""

    count: float
    """[m]"""
    noise: float
    """[m] RMS"""
    rate: float
    """[Hz]"""


ENCODERS = (Encoder(1e-6, 1e-6, 1000.0), Encoder(5e-6, 1.25e-6, 1000.0), Encoder(1e-6, 0.3e-6, 5000.0))
SET_POINTS = (Encoder(1e-6, 0.0, 1000.0), Encoder(1e-6, 0.3e-6, 1000.0))


def sampled(encoder: Encoder, position: np.ndarray) -> np.ndarray:
    noise = np.random.default_rng(5).normal(0.0, 1.0, len(position)) * encoder.noise
    return np.round((position + noise) / encoder.count) * encoder.count


def differences(values: np.ndarray, rate: float) -> np.ndarray:
    return np.diff(values, prepend=values[0]) * rate


class Run(NamedTuple):
    """Answers, one per velocity sample."""

    status: np.ndarray
    friction: np.ndarray
    force: np.ndarray
    coulomb: np.ndarray


def run(parameters: PipelineParameters, rate: float, velocity, force_sum, reference=None, acceleration=None) -> Run:
    """Take the samples as the node does; the message times are those of receipt."""
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
        sizes = np.array([len(piece) for piece in pieces])
        data = np.frombuffer(b''.join(pieces), np.uint8)
        messages = Messages(data, np.array(kinds, np.uint8), np.cumsum(sizes) - sizes, sizes, np.array(times))
        state, answers = receive_all(parameters, state, messages)
        for i in np.flatnonzero(answers.estimate_sizes):
            at, size = answers.estimate_offsets[i], answers.estimate_sizes[i]
            estimate = decode(ESTIMATE_TYPE, answers.data[at : at + size].tobytes())
            at, size = answers.feedforward_offsets[i], answers.feedforward_sizes[i]
            force = decode(FEEDFORWARD_TYPE, answers.data[at : at + size].tobytes()).force if size else 0.0
            rows.append((estimate.status, estimate.friction_force, force, estimate.coulomb_friction))
    return Run(*np.array(rows).T)


def reversals(values: np.ndarray) -> int:
    signs = np.sign(values[values != 0.0])
    return int(np.count_nonzero(np.diff(signs)))


def wrong_share(found: Run, truth: np.ndarray) -> float:
    """Share of samples with status 0 whose friction is off by more than a tenth of the Coulomb friction [-]."""
    wrong = np.abs(found.friction - truth) > 0.1 * found.coulomb
    return float(np.mean(wrong & (found.status == 0)))


def name(encoder: Encoder) -> str:
    return f'{encoder.count * 1e6:g}um_{encoder.noise * 1e6:g}um_{encoder.rate:g}Hz'


@pytest.mark.parametrize('encoder', ENCODERS, ids=name)
def test_a_rod_that_is_held_is_stuck(encoder):
    time = np.arange(0.0, SECONDS, 1.0 / encoder.rate)
    velocity = differences(sampled(encoder, np.zeros_like(time)), encoder.rate)
    held = np.full_like(time, 20.0)
    found = run(default_configuration().parameters(), encoder.rate, velocity, held)
    assert wrong_share(found, held) <= 1e-3
    assert np.mean(found.status == 0) > 0.99


@pytest.mark.parametrize('encoder', ENCODERS, ids=name)
def test_a_rod_that_moves_to_and_fro_slides(encoder):
    time = np.arange(0.0, SECONDS, 1.0 / encoder.rate)
    velocity = differences(sampled(encoder, 2e-3 * np.sin(CYCLE * time)), encoder.rate)
    true_velocity = 2e-3 * CYCLE * np.cos(CYCLE * time)
    parameters = default_configuration().parameters()
    coulomb = run(parameters, encoder.rate, np.full(2, 0.1), np.zeros(2)).coulomb[-1]
    friction = coulomb * np.sign(true_velocity)
    found = run(parameters, encoder.rate, velocity, friction)
    assert wrong_share(found, friction) <= 1e-3
    assert np.mean(found.status == 0) > 0.5


@pytest.mark.parametrize('encoder', ENCODERS, ids=name)
def test_by_the_measured_velocity_a_rod_at_rest_gets_no_reversal(encoder):
    time = np.arange(0.0, SECONDS, 1.0 / encoder.rate)
    velocity = differences(sampled(encoder, np.zeros_like(time)), encoder.rate)
    settings = default_configuration().feedforward
    parameters = default_configuration().parameters()._replace(feedforward=type(settings)(use_measured_velocity=True))
    found = run(parameters, encoder.rate, velocity, np.full_like(time, 20.0))
    assert reversals(found.force) == 0


@pytest.mark.parametrize('set_point', SET_POINTS, ids=name)
@pytest.mark.parametrize('speed', [0.0, 5e-5, 5e-4, 9e-4, 1.5e-3, 5e-3])
def test_a_rounded_set_point_at_a_held_speed_makes_no_reversal(set_point, speed):
    time = np.arange(0.0, SECONDS, 1.0 / set_point.rate)
    reference = differences(sampled(set_point, speed * time), set_point.rate)
    acceleration = differences(reference, set_point.rate)
    found = run(
        default_configuration().parameters(),
        set_point.rate,
        np.zeros_like(time),
        np.zeros_like(time),
        reference,
        acceleration,
    )
    assert reversals(found.force) == 0
    settled = found.force[time > 2.0]
    assert np.abs(np.diff(settled)).max() < 8.0  # [N] 50 N a millisecond before
    if speed > 0.0:
        expected = 0.9 * found.coulomb[-1] * math.tanh(speed / 1e-3)
        assert settled.mean() == pytest.approx(expected, abs=0.05 * 0.9 * found.coulomb[-1])


@pytest.mark.parametrize('set_point', SET_POINTS, ids=name)
@pytest.mark.parametrize('amplitude', [2e-5, 1e-4, 2e-3])
def test_a_rounded_sine_has_the_reversals_of_the_sine(set_point, amplitude):
    time = np.arange(0.0, SECONDS, 1.0 / set_point.rate)
    reference = differences(sampled(set_point, amplitude * np.sin(CYCLE * time)), set_point.rate)
    acceleration = differences(reference, set_point.rate)
    found = run(
        default_configuration().parameters(),
        set_point.rate,
        np.zeros_like(time),
        np.zeros_like(time),
        reference,
        acceleration,
    )
    assert reversals(found.force) <= 2 * SECONDS
    assert reversals(found.force) >= 2 * SECONDS - 2


@pytest.mark.parametrize('amplitude', [2e-3, 5e-2])
def test_a_clean_sine_is_passed_on_unchanged(amplitude):
    time = np.arange(0.0, 10.0, 1e-3)
    reference = amplitude * CYCLE * np.cos(CYCLE * time)
    acceleration = -amplitude * CYCLE**2 * np.sin(CYCLE * time)
    parameters = default_configuration().parameters()
    found = run(parameters, 1000.0, np.zeros_like(time), np.zeros_like(time), reference, acceleration)
    led = reference + parameters.feedforward.lead_time * acceleration
    expected = 0.9 * found.coulomb * np.tanh(led / 1e-3)
    settled = time > 0.5
    steepest = np.abs(np.diff(expected)).max()
    assert np.abs(found.force - expected)[settled].max() < 2.0 * steepest + 1e-6  # a delay of at most 2 samples
