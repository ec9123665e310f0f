"""A rod that vibrates is no rod at rest, and ripple of an encoder is no motion."""

import math
from collections.abc import Iterator

import numpy as np
import pytest

from seal_friction_ros.core.estimation.estimator import EstimatorParameters, EstimatorSettings, init, step
from seal_friction_ros.core.estimation.hidden_motion import (
    DOUBT,
    LEAST_SHARE,
    NO_HIDDEN_MOTION,
    Apparent,
    HiddenMotion,
    with_sample,
)
from seal_friction_ros.core.estimation.records import RodSample
from seal_friction_ros.core.friction.states import SLIDING
from seal_friction_ros.core.messages.records import Force, FrictionEstimate, Pressure, Status
from seal_friction_ros.files import default_configuration

START = 10**12  # [ns]
SEALS = default_configuration().parameters().estimator.seals
PARAMETERS = EstimatorParameters(EstimatorSettings(), SEALS)
PRESSURE = 2e6  # [Pa]
TAUGHT = 10.0  # [s]
FRICTION = 34.0  # [N] of the machine; by the law at that pressure as well


def estimates(positions: np.ndarray, forces: np.ndarray, rate: float, count: float) -> list[FrictionEstimate]:
    """Estimates of a rod whose encoder counts ``count`` [m]; its velocity is the difference of two samples."""
    counted = np.round(positions / count) * count
    state, found = init(PARAMETERS), []
    for i, (velocity, force) in enumerate(zip(np.diff(counted) * rate, forces[1:], strict=True)):
        stamp = START + round(i * 1e9 / rate)
        sample = RodSample(stamp, float(velocity), Pressure(stamp, PRESSURE, PRESSURE), Force(stamp, float(force)))
        state, estimate = step(PARAMETERS, state, sample)
        found.append(estimate)
    return found


def after_strokes(positions: np.ndarray, forces: np.ndarray, rate: float) -> tuple[np.ndarray, np.ndarray]:
    """The same after ten even strokes of a second, from which the estimator knows friction and offset."""
    time = np.arange(0.0, TAUGHT, 1.0 / rate)
    side = np.where(time.astype(int) % 2 == 0, 1.0, -1.0)
    return np.append(0.02 * np.cumsum(side) / rate, positions), np.append(FRICTION * side, forces)


def uncertain(found: list[FrictionEstimate], rate: float, seconds: float = 1.0) -> float:
    """Share of samples marked as uncertain after a time [s]."""
    return float(np.mean([bool(e.status & Status.MOTION_UNCERTAIN) for e in found[round(seconds * rate) :]]))


def test_the_machine_has_the_friction_of_the_law():
    found = estimates(1e-4 * np.arange(100.0), np.full(100, FRICTION), 100.0, 1e-6)[-1]
    assert found.state == SLIDING
    assert found.coulomb_friction == pytest.approx(FRICTION, rel=0.05)


VIBRATIONS = [(2e-3, 30.0, 100.0), (1e-5, 300.0, 1000.0), (5e-4, 23.0, 100.0)]  # [m], [Hz], samples [Hz]


def vibration(amplitude, frequency, rate, mass, load) -> tuple[list[FrictionEstimate], np.ndarray]:
    """Estimates of a rod that vibrates for 6 s, and its friction [N]."""
    time = np.arange(0.0, 6.0, 1.0 / rate)
    turn = 2.0 * math.pi * frequency
    position = amplitude * np.sin(turn * time + 0.3)
    friction = FRICTION * np.sign(np.cos(turn * time + 0.3))
    force = friction - mass * turn * turn * position + load * FRICTION
    return estimates(*after_strokes(position, force, rate), rate, 1e-7)[-time.size :], friction


@pytest.mark.parametrize('load', [0.0, 0.4])  # [-] of the friction
@pytest.mark.parametrize('mass', [0.0, 20.0])  # [kg]
@pytest.mark.parametrize(('amplitude', 'frequency', 'rate'), VIBRATIONS)
def test_a_rod_that_vibrates_above_the_band_of_rest_is_not_known_to_rest(amplitude, frequency, rate, mass, load):
    found, _ = vibration(amplitude, frequency, rate, mass, load)
    assert uncertain(found, rate) > 0.95


@pytest.mark.parametrize('load', [0.0, 0.4])
@pytest.mark.parametrize('mass', [0.0, 1.0, 20.0])  # of 1 kg at 300 Hz the inertia hides the friction
@pytest.mark.parametrize(('amplitude', 'frequency', 'rate'), VIBRATIONS)
def test_a_rod_that_vibrates_has_no_wrong_friction_with_status_0(amplitude, frequency, rate, mass, load):
    found, friction = vibration(amplitude, frequency, rate, mass, load)
    wrong = [
        e.status == 0 and abs(e.friction_force - f) > 1.96 * e.friction_force_std
        for e, f in zip(found, friction, strict=True)
    ]
    assert np.mean(wrong[round(2.0 * rate) :]) <= 0.005


def test_a_vibration_that_is_over_is_no_ripple_of_the_slow_motion_after_it():
    rate, speed, amplitude, frequency, mass = 1000.0, 3e-3, 5e-5, 300.0, 20.0  # [Hz], [m/s], [m], [Hz], [kg]
    time = np.arange(0.0, 8.0, 1.0 / rate)
    sine = amplitude * np.sin(2.0 * np.pi * frequency * time) * (time < 3.0)
    velocity = np.gradient(speed * time + sine, time)
    force = FRICTION * np.sign(velocity) - mass * (2.0 * np.pi * frequency) ** 2 * sine
    found = estimates(speed * time + sine, force, rate, 1e-9)
    assert uncertain(found[: round(3.0 * rate)], rate) == 1.0
    assert uncertain(found, rate, 4.0) == 0.0


@pytest.mark.parametrize('rate', [100.0, 1000.0])
@pytest.mark.parametrize('count', [1e-6, 1e-5])  # [m]
@pytest.mark.parametrize('push', [0.0, 0.5])  # [-] of the friction: a slow swing that the seals hold
def test_ripple_of_an_encoder_at_rest_is_no_motion(rate, count, push):
    chance = np.random.default_rng(5)
    time = np.arange(0.0, 6.0, 1.0 / rate)
    force = 0.02 * FRICTION * chance.normal(size=time.size) + push * FRICTION * np.sin(math.pi * time)
    position = (0.5 + 0.3 * chance.normal(size=time.size)) * count
    found = estimates(*after_strokes(position, force, rate), rate, count)
    assert uncertain(found[-time.size :], rate) < 0.05


# --- one sample at a time ---

SLIP = 2e-3  # [m/s]


def taken(samples: Iterator[Apparent], known: HiddenMotion = NO_HIDDEN_MOTION) -> HiddenMotion:
    for sample in samples:
        known = with_sample(known, sample, SLIP)
    return known


def vibrating(force_share: float, speed: float = 0.05, seconds: float = 1.0, load: float = 0.0) -> Iterator[Apparent]:
    """A velocity at rest that alternates, and a force sum with a share of the friction in phase."""
    for i in range(round(seconds / 1e-3)):
        side = 1.0 if i // 5 % 2 else -1.0
        yield Apparent(1e-3, side * speed, 0.0, load + side * force_share * FRICTION, FRICTION)


@pytest.mark.parametrize('load', [0.0, 500.0])  # [N]
@pytest.mark.parametrize(('beyond', 'is_found'), [(-0.05, False), (0.05, True)])
def test_a_motion_shows_in_the_covariance_of_force_sum_and_velocity(beyond, is_found, load):
    known = taken(vibrating(LEAST_SHARE + beyond, seconds=3.0, load=load))
    assert (known.doubt > 0.0) is is_found
    opposed = taken(vibrating(-LEAST_SHARE - beyond, seconds=3.0, load=load))
    assert (opposed.doubt > 0.0) is is_found


def test_a_velocity_within_the_slip_velocity_and_one_that_is_not_denied_are_no_hidden_motion():
    assert taken(vibrating(1.0, speed=SLIP)).doubt == 0.0
    assert taken(sample._replace(conditioned=sample.measured) for sample in vibrating(1.0)).doubt == 0.0


def test_the_doubt_lasts_for_its_time_after_the_last_sign_of_a_motion():
    known = taken(vibrating(1.0))
    assert known.doubt == DOUBT
    still = Apparent(1e-3, 0.0, 0.0, 0.0, FRICTION)
    seconds = 0.0
    while known.doubt > 0.0:
        known = with_sample(known, still, SLIP)
        seconds += 1e-3
    assert DOUBT <= seconds < DOUBT + 1.5
    assert taken(iter([still] * 2000), known).doubt == 0.0
