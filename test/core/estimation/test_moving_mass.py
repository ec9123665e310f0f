"""The moving mass by accelerations: what least squares by strokes must and must not show."""

import math

import pytest

from seal_friction_ros.core.estimation.moving_mass import (
    BEYOND,
    NO_ACCELERATIONS,
    NO_MASS,
    Accelerations,
    accelerated,
    inertia_of,
    is_inertia_known,
    mass_after,
)

RATE = 2.0 * math.pi * 2.0  # [1/s]
STEPS = 1000  # of a stroke of a sine from turn to turn


def stroke(force, side=1.0, after=0.1) -> Accelerations:
    """A stroke of a sine from 0.1 of its way on; ``force`` [N] by velocity [m/s] and acceleration [m/s^2]."""
    sums, period = NO_ACCELERATIONS, math.pi / RATE / STEPS
    for i in range(round(after * STEPS), round((1.0 - after) * STEPS)):
        phase = math.pi * (i + 0.5) / STEPS
        velocity, acceleration = side * 0.1 * math.sin(phase), side * 0.1 * RATE * math.cos(phase)
        sums = accelerated(sums, abs(velocity), acceleration, force(velocity, acceleration), period)
    return sums


def after_stroke(known, sums):
    """The mass once the rod is slower than in the part of the stroke."""
    return mass_after(known, sums, 0.0)


@pytest.mark.parametrize('mass', [0.0, 5.0, 80.0])
@pytest.mark.parametrize(
    'friction',
    [
        lambda v: math.copysign(40.0, v),
        lambda v: 300.0 * v,
        lambda v: math.copysign(40.0 + 30.0 * math.exp(-((v / 0.01) ** 2)), v),
        lambda _: 500.0,
    ],
    ids=['Coulomb', 'viscous', 'Stribeck', 'a constant load'],
)
def test_over_a_stroke_friction_that_is_a_function_of_the_speed_shows_no_mass(friction, mass):
    known = NO_MASS
    for side in (1.0, -1.0):
        known = after_stroke(known, stroke(lambda v, a: friction(v) + mass * a, side))
    assert inertia_of(0.0, known).mass == pytest.approx(mass, abs=1e-6)


def test_an_inertia_without_anything_else_leaves_nothing():
    inertia = inertia_of(0.0, after_stroke(NO_MASS, stroke(lambda _, a: 20.0 * a, after=0.0)))
    assert inertia.mass == pytest.approx(20.0)
    assert inertia.std == pytest.approx(0.0, abs=1e-6)
    assert inertia.shown == pytest.approx(BEYOND * 0.1 * RATE / math.sqrt(2.0), rel=1e-3)


def test_a_negative_mass_is_a_fault_of_the_signals_and_stands_in_the_deviation():
    inertia = inertia_of(0.0, after_stroke(NO_MASS, stroke(lambda _, a: -200.0 * a)))
    assert inertia.mass == 0.0
    assert inertia.std == pytest.approx(200.0)
    assert not is_inertia_known(inertia, 0.5, 40.0)


def test_the_deviation_is_no_error_of_a_mean_and_does_not_fall_with_the_number_of_strokes():
    """What a delay or elastic seals leave is the same in each stroke."""
    known, found = NO_MASS, []
    for _ in range(20):
        known = after_stroke(known, stroke(lambda v, a: 5.0 * a + math.copysign(10.0, a) * math.copysign(1.0, v) * v))
        found.append(inertia_of(0.0, known).std)
    assert found[-1] == pytest.approx(found[0])
    assert found[0] > 0.0


def test_another_payload_is_learnt_within_a_few_strokes():
    known = after_stroke(NO_MASS, stroke(lambda _, a: 5.0 * a))
    for _ in range(12):
        known = after_stroke(known, stroke(lambda _, a: 50.0 * a))
    assert inertia_of(0.0, known).mass == pytest.approx(50.0, rel=0.1)


def test_a_given_mass_is_exact_at_any_acceleration():
    wrong = after_stroke(NO_MASS, stroke(lambda _, a: 5.0 * a))
    inertia = inertia_of(20.0, wrong)
    assert inertia.mass == 20.0
    assert is_inertia_known(inertia, 1e6, 40.0)


def test_before_a_stroke_and_beyond_the_accelerations_of_the_strokes_nothing_is_known():
    assert not is_inertia_known(inertia_of(0.0, NO_MASS), 0.0, 40.0)
    assert after_stroke(NO_MASS, NO_ACCELERATIONS) == NO_MASS
    inertia = inertia_of(0.0, after_stroke(NO_MASS, stroke(lambda _, a: 0.0 * a)))
    assert is_inertia_known(inertia, inertia.shown, 40.0)
    assert not is_inertia_known(inertia, 1.01 * inertia.shown, 40.0)


def test_a_part_that_began_at_a_speed_tells_nothing_until_the_rod_is_slower_again():
    """After a gap, or where a stroke is cut."""
    sums = stroke(lambda v, a: 300.0 * v + 5.0 * a, after=0.3)
    assert mass_after(NO_MASS, sums, 0.1) == NO_MASS
    assert inertia_of(0.0, after_stroke(NO_MASS, sums)).mass == pytest.approx(5.0, abs=1e-6)


def test_a_slower_sample_begins_anew():
    sums = accelerated(stroke(lambda v, a: 300.0 * v + 5.0 * a, after=0.3), 0.01, -0.5, 9.0, 0.001)
    assert sums == accelerated(NO_ACCELERATIONS, 0.01, -0.5, 9.0, 0.001)


def test_a_few_samples_fit_any_mass_and_tell_nothing():
    sums = NO_ACCELERATIONS
    for acceleration, force in ((0.1, 5.0), (-0.1, -5.0)):
        sums = accelerated(sums, 0.1, acceleration, force, 0.01)
    assert after_stroke(NO_MASS, sums) == NO_MASS


def test_a_slow_stroke_says_little_of_the_inertia_of_a_fast_one():
    """It weighs as the fourth power of its acceleration: so friction that drifts over it leaves the mass alone."""
    fast, slow = stroke(lambda _, a: 20.0 * a), NO_ACCELERATIONS
    for i in range(1000):
        slow = accelerated(slow, 0.01, 0.02 * math.cos(math.pi * (i + 0.5) / 1000), 0.01 * (500 - i), 0.001)
    inertia = inertia_of(0.0, after_stroke(after_stroke(NO_MASS, fast), slow))
    assert inertia.mass == pytest.approx(20.0, rel=0.01)
    assert inertia.std < 2.0
