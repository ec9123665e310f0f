"""The friction follows the temperature of the seals: of a day whose truth is another law, and of what a sensor does."""

import math
from dataclasses import replace

import numpy as np
import pytest
from harness.compensation import COMPENSATING
from harness.simulated_day import SECOND, START, Day, samples
from hypothesis import given
from hypothesis import strategies as st
from paths import ROOT

from seal_friction_ros.core.estimation import pipeline
from seal_friction_ros.core.estimation.adaptation import AdaptationSettings
from seal_friction_ros.core.estimation.estimator import EstimatorParameters, EstimatorSettings, init, step
from seal_friction_ros.core.estimation.pipeline import PipelineParameters
from seal_friction_ros.core.estimation.records import NO_TEMPERATURE, RodSample, SealTemperature
from seal_friction_ros.core.friction.actuator import MountedSeal, actuator_friction
from seal_friction_ros.core.friction.laws.velocity_terms import VelocityTerms
from seal_friction_ros.core.friction.seal_file import parse_seal
from seal_friction_ros.core.friction.temperature import TemperatureScale, scale_at, std_of_unknown
from seal_friction_ros.core.messages.records import (
    NEVER,
    FeedForward,
    Force,
    FrictionEstimate,
    Pressure,
    ServoReference,
    Status,
    Temperature,
    Velocity,
)
from seal_friction_ros.files import read_yaml

MS = 1_000_000  # [ns]
PLAIN = parse_seal(read_yaml(ROOT / 'config' / 'seals' / 'ms28775_114.yaml'))
REFERENCE = 303.15  # [K]
ACTIVATION = 1200.0  # [K] of Arrhenius' law


def arrhenius(kelvin):
    """Friction over that at the reference [-]."""
    return np.exp(ACTIVATION * (1.0 / kelvin - 1.0 / REFERENCE))


def identified_scale() -> TemperatureScale:
    """The line through readings of that seal in a climate chamber, 3 % from run to run."""
    kelvin = np.linspace(283.15, 333.15, 16)
    noise = 0.03 * np.random.default_rng(7).standard_normal(len(kelvin))
    (slope, _), covariance = np.polyfit(kelvin - REFERENCE, np.log(arrhenius(kelvin)) + noise, 1, cov=True)
    error = math.sqrt(covariance[0, 0])
    return TemperatureScale(
        reference=REFERENCE, coefficient=-slope, coefficient_std=error, lowest=283.15, highest=333.15
    )


SCALE = identified_scale()
WARM = replace(PLAIN, temperature=SCALE)
DAY_PRESSURE = (3e6, 3e6)  # [Pa]
FRICTION = actuator_friction((MountedSeal(PLAIN, 'a'), MountedSeal(PLAIN, 'b')), *DAY_PRESSURE).coulomb_friction


def parameters(seal=WARM, mode='off', **settings) -> EstimatorParameters:
    mounted = (MountedSeal(seal, 'a'), MountedSeal(seal, 'b'))
    return EstimatorParameters(EstimatorSettings(**settings), mounted, AdaptationSettings(mode=mode, moving_mass=5.0))


def warming(time: float) -> float:
    """Temperature of the seals [K]: from 15 to 55 degC, half of it in two minutes."""
    return 328.15 - 40.0 * math.exp(-time / 170.0)


def a_day(known: EstimatorParameters, *, with_sensor: bool):
    """Estimates of 400 s, and the true Coulomb friction [N] at each; the sensor shows 0.5 K steps at 1 Hz."""
    day = Day(FRICTION, lambda time: float(arrhenius(warming(time))), pressure=DAY_PRESSURE)
    rng = np.random.default_rng(3)
    state, newest, found, true = init(known), NO_TEMPERATURE, [], []
    for number, sample in enumerate(samples(day, 400.0, seed=5)):
        time = (sample.stamp - START) / SECOND
        if with_sensor and number % 100 == 0:
            newest = SealTemperature(sample.stamp, round(2.0 * (warming(time) + 0.3 * rng.standard_normal())) / 2.0)
        state, estimate = step(known, state, sample._replace(temperature=newest))
        found.append(estimate)
        true.append(FRICTION * float(arrhenius(warming(time))))
    return found, np.array(true)


@pytest.fixture(scope='module')
def day_with_sensor():
    return a_day(parameters(), with_sensor=True)


def test_the_friction_of_a_day_that_warms_up_is_within_five_percent(day_with_sensor):
    found, true = day_with_sensor
    error = np.array([estimate.coulomb_friction for estimate in found]) / true - 1.0
    assert np.abs(error).max() < 0.05
    assert {estimate.status for estimate in found} <= {0, int(Status.MOTION_UNCERTAIN)}


def test_without_the_sensor_it_is_far_off_and_every_estimate_says_that_the_temperature_is_missing():
    found, true = a_day(parameters(), with_sensor=False)
    error = np.array([estimate.coulomb_friction for estimate in found]) / true - 1.0
    assert np.abs(error).max() > 0.2
    assert all(estimate.status & Status.TEMPERATURE_MISSING for estimate in found)
    std = np.array([estimate.coulomb_friction_std for estimate in found])
    assert (np.abs(error * true) < 2.0 * std).all()


@pytest.mark.long
def test_adaptation_works_on_what_is_left():
    found, _ = a_day(parameters(mode='on'), with_sensor=True)
    scales = np.array([estimate.adaptation_scale for estimate in found])
    assert np.abs(scales - 1.0).max() < 0.06
    unknown, true = a_day(parameters(PLAIN, 'on'), with_sensor=False)
    scales = np.array([estimate.adaptation_scale for estimate in unknown])
    assert np.abs(scales - true / FRICTION)[-5000:].max() < 0.06  # it learns the temperature instead
    assert abs(scales[-1] - 1.0) > 0.2


def test_adaptation_learns_nothing_while_the_temperature_is_missing():
    found, _ = a_day(parameters(mode='on'), with_sensor=False)
    assert {estimate.adaptation_scale for estimate in found} == {1.0}


# --- one sample ---


def estimate_at(temperature: SealTemperature, stamp: int = START, **settings) -> FrictionEstimate:
    sample = RodSample(stamp, 0.02, Pressure(stamp, *DAY_PRESSURE), Force(stamp, 40.0), temperature=temperature)
    known = parameters(**settings)
    return step(known, init(known), sample)[1]


def test_every_force_is_that_of_the_reference_times_the_scale():
    at_reference = estimate_at(SealTemperature(START, SCALE.reference))
    hot, scale = estimate_at(SealTemperature(START, 323.15)), scale_at(SCALE, 323.15)
    assert scale < 0.85
    for name in ('coulomb_friction', 'breakaway_force', 'friction_force'):
        assert getattr(hot, name) == pytest.approx(scale * getattr(at_reference, name))
    assert not hot.status & Status.TEMPERATURE_MISSING


@pytest.mark.parametrize(
    ('temperature', 'used', 'status'),
    [
        (NO_TEMPERATURE, SCALE.reference, Status.TEMPERATURE_MISSING),
        (SealTemperature(START - 10 * SECOND, 320.0), 320.0, Status(0)),
        (SealTemperature(START - 10 * SECOND - MS, 320.0), 320.0, Status.TEMPERATURE_MISSING),
        (SealTemperature(START + 10 * SECOND + MS, 320.0), 320.0, Status.TEMPERATURE_MISSING),
        (SealTemperature(START, 334.0), 333.15, Status(0)),
        (SealTemperature(START, 334.2), 333.15, Status.OUTSIDE_IDENTIFIED_TEMPERATURE),
        (SealTemperature(START, 282.1), 283.15, Status.OUTSIDE_IDENTIFIED_TEMPERATURE),
    ],
)
def test_a_temperature_that_is_missing_old_or_outside_is_flagged_and_makes_the_friction_less_sure(
    temperature, used, status
):
    found = estimate_at(temperature)
    plain = estimate_at(SealTemperature(START, SCALE.reference))
    bits = Status.TEMPERATURE_MISSING | Status.OUTSIDE_IDENTIFIED_TEMPERATURE
    assert Status(found.status) & bits == status
    scale = scale_at(SCALE, used)
    assert found.coulomb_friction == pytest.approx(scale * plain.coulomb_friction)
    kelvin = used if temperature == NO_TEMPERATURE else temperature.kelvin
    known = scale * math.hypot(
        plain.coulomb_friction_std, plain.coulomb_friction * SCALE.coefficient_std * (kelvin - SCALE.reference)
    )
    unknown = std_of_unknown(SCALE) * found.coulomb_friction if status else 0.0
    assert found.coulomb_friction_std == pytest.approx(math.hypot(known, unknown))


def test_the_timeout_is_a_setting():
    old = SealTemperature(START - 2 * SECOND, 320.0)
    assert estimate_at(old, temperature_timeout=1.0).status & Status.TEMPERATURE_MISSING
    assert not estimate_at(old, temperature_timeout=3.0).status & Status.TEMPERATURE_MISSING


def test_seal_files_without_the_part_ignore_the_temperature_to_the_bit():
    known = parameters(PLAIN)
    sample = RodSample(START, 0.02, Pressure(START, *DAY_PRESSURE), Force(START, 40.0))
    assert step(known, init(known), sample) == step(
        known, init(known), sample._replace(temperature=SealTemperature(START, 500.0))
    )


# --- the path of a message ---


class Run:
    """A pipeline and what it has answered."""

    def __init__(self, seal):
        self.parameters = PipelineParameters(parameters(seal), replace(COMPENSATING, force_limit=1e4, slew_limit=1e9))
        self.state, self.answers = pipeline.init_running(self.parameters), []

    def take(self, record, received):
        pipeline.receive(self.parameters, self.state, record, received, lambda answer, _: self.answers.append(answer))

    def warm(self, celsius):
        """Three readings, the fewest that are believed."""
        for stamp in range(START - 2 * MS, START + 1, MS):
            self.take(Temperature(stamp, celsius), stamp)

    def slide(self, celsius: float | None, velocity: float = 0.1, count: int = 50):
        for stamp in range(START, START + count * MS, MS):
            if celsius is not None:
                self.take(Temperature(stamp, celsius), stamp)
            self.take(Pressure(stamp, *DAY_PRESSURE), stamp)
            self.take(Force(stamp, 40.0), stamp)
            self.take(ServoReference(stamp, 0.0, velocity, 0.0), stamp)
            self.take(Velocity(stamp, velocity), stamp)
        return self

    def last(self, kind):
        return next(answer for answer in reversed(self.answers) if type(answer) is kind)


def test_the_feed_forward_has_the_scale_on_all_of_its_friction():
    viscous = replace(WARM, velocity_terms=VelocityTerms(150.0))
    plain = replace(viscous, temperature=None)
    scale = scale_at(SCALE, 323.15)
    hot, cold = (Run(seal).slide(50.0).last(FeedForward).force for seal in (viscous, plain))
    without_speed = Run(PLAIN).slide(50.0).last(FeedForward).force
    assert cold > 1.2 * without_speed  # the part that depends on velocity matters
    assert hot == pytest.approx(scale * cold)


@pytest.mark.parametrize('celsius', [math.nan, math.inf, -math.inf, -273.15, -200.0, 400.0])
def test_a_temperature_that_no_rubber_has_is_no_sample(celsius):
    run = Run(WARM)
    run.warm(50.0)
    known = run.state.temperature
    run.take(Temperature(START + MS, celsius), START + MS)
    assert run.state.temperature == known
    assert known.kelvin == pytest.approx(323.15)


def test_a_single_wrong_temperature_is_never_used():
    for wrong in range(6):
        run = Run(WARM)
        for number in range(6):
            run.take(Temperature(START + number * SECOND, 60.0 if number == wrong else 20.0), START)
            assert run.state.temperature.kelvin in (0.0, pytest.approx(293.15))
        assert run.state.temperature.stamp == START + 5 * SECOND


def test_a_message_that_comes_three_times_is_one_reading():
    run = Run(WARM)
    for _ in range(3):
        run.take(Temperature(START, 50.0), START)
    assert run.state.temperature.stamp == NEVER


def test_after_a_pause_the_old_readings_do_not_outvote_the_new_ones():
    run = Run(WARM)
    run.warm(50.0)
    later = START + 60 * SECOND
    for number in range(3):
        before = run.state.temperature
        run.take(Temperature(later + number * SECOND, 20.0), later)
    assert before.stamp == START  # two new ones: still the old temperature, and old
    assert run.state.temperature[:2] == (later + 2 * SECOND, pytest.approx(293.15))


def test_after_a_clock_was_set_back_the_old_readings_do_not_outvote_the_new_ones():
    run = Run(WARM)
    run.warm(50.0)
    earlier = START - 60 * SECOND
    for number in range(2):
        run.take(Temperature(earlier + number * SECOND, 20.0), START)
        assert run.state.temperature[:2] == (START, pytest.approx(323.15))
    run.take(Temperature(earlier + 2 * SECOND, 20.0), START)
    assert run.state.temperature[:2] == (earlier + 2 * SECOND, pytest.approx(293.15))


@given(st.lists(st.floats(), max_size=5), st.floats(-0.2, 0.2))
def test_every_number_is_finite_whatever_the_sensor_says(values, velocity):
    run = Run(replace(WARM, velocity_terms=VelocityTerms(150.0)))
    for celsius in values:
        run.take(Temperature(START, celsius), START)
    run.slide(None, velocity, 3)
    assert all(math.isfinite(number) for answer in run.answers for number in answer)


def test_seals_with_different_parts_are_refused():
    mounted = (MountedSeal(WARM, 'a'), MountedSeal(PLAIN, 'b'))
    with pytest.raises(ValueError, match='different temperature parts'):
        EstimatorParameters(EstimatorSettings(), mounted)
