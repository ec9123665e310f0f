"""A velocity that swings without a force is hum; a rod that swings is one, whatever else is in the force sum."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from seal_friction_ros.core.estimation.adaptation import AdaptationSettings
from seal_friction_ros.core.estimation.estimator import EstimatorParameters, EstimatorSettings, init, step
from seal_friction_ros.core.estimation.records import RodSample
from seal_friction_ros.core.estimation.swings import LONGEST_SWING, NO_SWING, Swing, swing_on
from seal_friction_ros.core.messages.records import Force, FrictionEstimate, Pressure, Status
from seal_friction_ros.files import default_configuration

START, RATE = 10**12, 1000.0  # [ns], [Hz]
SEALS = default_configuration().parameters().estimator.seals
PARAMETERS = EstimatorParameters(EstimatorSettings(), SEALS)
TIME = np.arange(0.0, 4.0, 1.0 / RATE)
FRICTION = 40.0  # [N]


def estimates(velocities, force_sums, parameters=PARAMETERS, rate: float = RATE) -> list[FrictionEstimate]:
    state, found = init(parameters), []
    for i, (velocity, force) in enumerate(zip(velocities, force_sums, strict=True)):
        stamp = START + round(i * 1e9 / rate)
        sample = RodSample(stamp, float(velocity), Pressure(stamp, 2e6, 2e6), Force(stamp, float(force)))
        state, estimate = step(parameters, state, sample)
        found.append(estimate)
    return found


def swung(velocities, force_sums, frictions=None, swing: Swing = NO_SWING) -> list[Swing]:
    """All states; the friction of the estimate is `FRICTION`."""
    frictions = FRICTION * np.sign(velocities) if frictions is None else frictions
    found = []
    for velocity, force, friction in zip(velocities, force_sums, frictions, strict=True):
        swing = swing_on(swing, 1.0 / RATE, float(velocity), float(force), float(friction))
        found.append(swing)
    return found


def hum(rate: float, amplitude: float, phase: float = 0.1) -> np.ndarray:
    return amplitude * np.sin(2.0 * math.pi * rate * TIME + phase)


def wrong_and_good(found: list[FrictionEstimate], truth: np.ndarray) -> np.ndarray:
    """Samples with status 0 whose friction is off by more than a fifth of the Coulomb friction."""
    return np.array(
        [
            e.status == 0 and abs(e.friction_force - f) > 0.2 * e.coulomb_friction
            for e, f in zip(found, truth, strict=True)
        ]
    )


@pytest.mark.parametrize('noise', [0.0, 3e-4])  # [m/s]
@pytest.mark.parametrize(('rate', 'amplitude'), [(5.0, 0.02), (17.0, 0.003), (50.0, 0.005), (50.0, 0.1), (100.0, 0.02)])
def test_a_rod_at_rest_whose_velocity_hums_has_no_wrong_friction_with_status_0(rate, amplitude, noise):
    chance = np.random.default_rng(3)
    velocity = np.round((hum(rate, amplitude) + noise * chance.normal(size=len(TIME))) / 1e-4) * 1e-4
    force = 10.0 + chance.normal(size=len(TIME))
    found = estimates(velocity, force)
    wrong = wrong_and_good(found, force)
    two_strokes = 1.5 / rate + 0.01
    assert not wrong[two_strokes < TIME].any()
    assert np.mean([Status.MOTION_UNCERTAIN in Status(e.status) for e in found]) > 0.5


def test_noise_of_a_slow_sensor_is_found_too():
    chance = np.random.default_rng(4)
    smoothed = np.convolve(chance.normal(size=len(TIME) + 29), np.ones(30), 'valid')
    velocity = 5e-3 * smoothed / smoothed.std()
    force = np.full_like(TIME, 10.0)
    assert np.mean(wrong_and_good(estimates(velocity, force), force)) < 0.01


def test_a_rod_that_slides_on_while_its_velocity_hums_is_uncertain():
    found = estimates(3e-3 + hum(50.0, 0.02), np.full_like(TIME, 34.0))
    assert np.mean([e.status == 0 and e.friction_force < 0.0 for e in found]) < 0.01


def test_a_hum_is_not_learnt_from():
    parameters = EstimatorParameters(EstimatorSettings(), SEALS, AdaptationSettings('on'))
    last = estimates(hum(20.0, 0.02), np.full_like(TIME, 10.0), parameters)[-1]
    assert (last.adaptation_scale, last.adaptation_offset) == (1.0, 0.0)


@given(
    st.sampled_from([2.0, 5.0, 10.0, 20.0, 30.0]),
    st.floats(1e-5, 1e-3),
    st.floats(0.0, 100.0),
    st.floats(-1000.0, 1000.0),
    st.floats(0.6, 3.0),
    st.floats(0.0, 6.0),
)
def test_a_rod_that_swings_is_never_in_doubt_whatever_its_mass_and_load(rate, amplitude, mass, load, scale, phase):
    angle = 2.0 * math.pi * rate * TIME[:1000] + phase
    velocity = 2.0 * math.pi * rate * amplitude * np.cos(angle)
    acceleration = -amplitude * (2.0 * math.pi * rate) ** 2 * np.sin(angle)
    force = load + mass * acceleration + scale * FRICTION * np.sign(velocity)
    # Over a stroke of a few samples the mean of load and inertia is that of sums, not of the integrals.
    per_stroke = RATE / rate / 2.0
    left_over = (abs(load) + mass * np.abs(acceleration).max()) * 10.0 / per_stroke**2
    if left_over < 0.1 * FRICTION:
        known = round(3.0 * per_stroke) + 1  # the first stroke may begin with speed, and two follow it
        assert {swing.doubted for swing in swung(velocity, force)[known:]} == {0.0}


def test_doubt_needs_less_than_half_of_the_friction():
    velocity = hum(20.0, 0.01)
    for share, is_doubted in ((0.45, True), (0.55, False)):
        force = 300.0 + share * FRICTION * np.sign(velocity)
        assert (swung(velocity, force)[-1].doubted > 0.0) == is_doubted


def test_two_strokes_are_needed_and_two_that_agree_end_the_doubt():
    stroke = np.concatenate([np.full(10, side * 0.01) for side in (1.0, -1.0) * 4])
    shown = FRICTION * np.sign(stroke)
    found = swung(stroke, np.where(np.arange(80) < 40, 0.0, shown))
    doubted = [swing.doubted > 0.0 for swing in found]
    assert doubted == [False] * 20 + [True] * 30 + [False] * 30
    assert found[49].doubted == pytest.approx(1e-4)  # a stroke of 10 samples


def test_a_stroke_that_is_much_longer_ends_the_doubt():
    stroke = np.concatenate([np.full(10, side * 0.01) for side in (1.0, -1.0) * 2])
    doubted = swung(stroke, np.zeros(40))[-1]
    start = swung(np.full(60, 0.01001), np.zeros(60), swing=doubted)
    assert [swing.doubted > 0.0 for swing in start] == [True] * 39 + [False] * 21


def test_the_longest_stroke_in_doubt_counts():
    velocities = np.concatenate(
        [np.full(n, side * 0.01) for n, side in zip((30, 30, 10, 10, 10, 60), (1, -1) * 3, strict=True)]
    )
    found = swung(velocities, np.zeros(150))
    assert found[90].doubted == pytest.approx(3e-4)
    assert found[-1].doubted == pytest.approx(3e-4)  # 0.6 mm are less than four times that


def test_long_strokes_are_not_judged():
    velocities = np.concatenate([np.full(300, side * 0.01) for side in (1.0, -1.0) * 2])  # 3 mm
    assert {swing.doubted for swing in swung(velocities, np.zeros(1200))} == {0.0}
    assert abs(velocities[0]) * 0.3 > LONGEST_SWING
    after_long = swung(np.concatenate([velocities[:600], np.full(10, 0.01), [-0.01]]), np.zeros(611))[-1]
    assert after_long.doubted == 0.0  # a short stroke after a long one has no partner


def test_a_gap_counts_as_20_ms_as_does_a_stamp_further_back_and_a_repeated_one_as_nothing():
    for elapsed in (0.02, 3.0, -1.0):
        assert swing_on(NO_SWING, elapsed, 0.01, 0.0, 0.0).way == pytest.approx(2e-4)
    assert swing_on(NO_SWING, 0.005, 0.01, 0.0, 0.0).way == pytest.approx(5e-5)
    begun = swing_on(NO_SWING, 0.005, 0.01, 0.0, 0.0)
    assert swing_on(begun, 0.0, -0.01, 30.0, -40.0) == begun


def test_before_the_first_sample_there_is_no_way_and_no_doubt():
    assert NO_SWING == (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def test_work_is_along_the_way():
    swing = swing_on(swing_on(NO_SWING, 1e-3, -0.01, -30.0, -40.0), 1e-3, -0.03, -10.0, -40.0)
    assert swing == pytest.approx(Swing(-4e-5, 6e-4, 1.6e-3, 0.0, 0.0, 0.0))


@given(
    st.lists(st.tuples(st.floats(-100.0, 100.0), st.floats(-1e9, 1e9)).filter(lambda pair: pair[0] != 0.0), max_size=30)
)
def test_every_number_is_finite(samples):
    found = swung([v for v, _ in samples], [f for _, f in samples])
    assert all(math.isfinite(number) for swing in found for number in swing)
