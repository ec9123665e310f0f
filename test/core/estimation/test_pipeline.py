"""The path of every message: who triggers what, and that the feed-forward dies away when any of its inputs does."""

import math
from dataclasses import replace

import pytest
from harness.answers import NOTHING, receive_one

from seal_friction_ros.core.estimation.feedforward import FeedForwardSettings, Limited
from seal_friction_ros.core.estimation.messages import ESTIMATE_TYPE, FEEDFORWARD_TYPE, type_of
from seal_friction_ros.core.estimation.pipeline import PipelineParameters, init, receive
from seal_friction_ros.core.estimation.records import Force, Position, Pressure, ServoReference, Status, Velocity
from seal_friction_ros.core.friction.actuator import MountedSeal, actuator_friction
from seal_friction_ros.core.friction.laws.velocity_terms import VelocityTerms
from seal_friction_ros.files import default_configuration

PARAMETERS = default_configuration().parameters()
MS = 1_000_000  # [ns]
FADED = 1e-9  # [N]


def run(messages, parameters=PARAMETERS):
    """Answers to a run of messages that are not empty, in order."""
    state, answers = init(parameters), []
    for message in messages:
        state, answer = receive_one(parameters, state, message)
        if answer is not NOTHING:
            answers.append(answer)
    return answers


def tick(stamp, speed=0.05, *, reference=True, velocity=True, pressure=3e6):
    """The messages of one moment, in the order a servo sends them."""
    yield Pressure(stamp, pressure, pressure)
    yield Force(stamp, 100.0)
    if reference:
        yield ServoReference(stamp, 0.0, speed, 0.0, b'reference')
    yield Position(stamp, 0.0)
    if velocity:
        yield Velocity(stamp, speed, b'rod')


def ticks(first, last, **kinds):
    """One moment a millisecond."""
    return [message for ms in range(first, last) for message in tick(ms * MS, **kinds)]


def test_a_velocity_makes_an_estimate_and_without_a_reference_no_feed_forward():
    answers = run(ticks(0, 3, reference=False))
    assert [(a.estimate.stamp, a.feedforward, a.frame_id) for a in answers] == [
        (0, None, b'rod'),
        (MS, None, b'rod'),
        (2 * MS, None, b'rod'),
    ]


def test_with_a_reference_each_velocity_makes_both_and_the_force_helps_the_motion():
    last = run(ticks(0, 300))[-1]
    assert last.feedforward.stamp == last.estimate.stamp == 299 * MS
    assert last.feedforward.force == pytest.approx(0.9 * last.estimate.coulomb_friction, rel=1e-6)
    assert last.feedforward.limited == 0
    assert run(ticks(0, 300, speed=-0.05))[-1].feedforward.force == pytest.approx(-last.feedforward.force, rel=1e-6)


def test_the_estimate_is_emitted_before_the_feed_forward():
    emitted, state = [], init(PARAMETERS)
    for message in ticks(0, 1):
        state = receive(PARAMETERS, state, message, lambda record, frame: emitted.append((type_of(record), frame)))
    assert emitted[-2:] == [(ESTIMATE_TYPE, b'rod'), (FEEDFORWARD_TYPE, b'rod')]


def test_when_velocities_stop_references_fade_the_force_out():
    answers = run(ticks(0, 300) + ticks(300, 800, velocity=False))
    alone = [a for a in answers[2:] if a.estimate is None]
    settings = PARAMETERS.feedforward
    assert alone[0].feedforward.stamp == pytest.approx((299 + settings.estimate_timeout * 1e3 + 1) * MS, abs=MS)
    assert alone[0].frame_id == b'reference'
    assert all(a.feedforward.limited & Limited.FADE for a in alone)
    assert abs(alone[-1].feedforward.force) < FADED
    gone = next(a.feedforward.stamp for a in alone if abs(a.feedforward.force) < FADED)
    assert (gone - alone[0].feedforward.stamp) * 1e-9 <= settings.fade_time + 0.01


def test_when_references_stop_velocities_fade_the_force_out():
    answers = run(ticks(0, 300) + ticks(300, 700, reference=False))
    last = answers[-1]
    assert last.estimate.status == 0
    assert last.feedforward.limited == Limited.FADE
    assert abs(last.feedforward.force) < FADED


def test_when_the_pressure_fails_the_force_fades_out_and_comes_back_with_it():
    bad = ticks(300, 700, pressure=math.nan)
    answers = run(ticks(0, 300) + bad + ticks(700, 1100))
    before, faded, after = answers[300], answers[700], answers[-1]
    assert faded.estimate.status & Status.PRESSURE_NOT_FINITE
    assert abs(faded.feedforward.force) < FADED
    assert after.feedforward.force == pytest.approx(before.feedforward.force, rel=1e-9)


def test_by_the_measured_velocity_no_reference_is_needed():
    parameters = PipelineParameters(PARAMETERS.estimator, FeedForwardSettings(use_measured_velocity=True))
    assert run(ticks(0, 300, reference=False), parameters)[-1].feedforward.force > 10.0


@pytest.mark.parametrize('leap', [10**18, -(10**18)])
def test_a_stamp_that_leaps_makes_no_leap_of_the_force(leap):
    good, wild = ticks(0, 300), [*tick(299 * MS + leap, speed=-0.05)]
    forces = [a.feedforward.force for a in run(good + wild + ticks(300, 400)) if a.feedforward]
    most = PARAMETERS.feedforward.slew_limit * 0.02
    assert max(abs(a - b) for a, b in zip(forces[1:], forces, strict=False)) <= most
    gentle = PipelineParameters(PARAMETERS.estimator, FeedForwardSettings(slew_limit=100.0))
    forces = [a.feedforward.force for a in run(good + wild + ticks(300, 400), gentle) if a.feedforward]
    assert max(abs(a - b) for a, b in zip(forces[1:], forces, strict=False)) <= 100.0 * 0.02 + 1e-9


@pytest.mark.parametrize('bad', [math.nan, math.inf, -math.inf, 1e300])
def test_whatever_comes_in_what_goes_out_is_finite_and_within_the_limit(bad):
    messages = ticks(0, 100)
    for ms in range(100, 200):
        messages += [Pressure(ms * MS, bad, bad), Force(ms * MS, bad), ServoReference(ms * MS, bad, bad, bad)]
        messages += [Velocity(ms * MS, bad, b'')]
    for answer in run(messages)[1:]:  # the first reference comes before the first velocity
        assert math.isfinite(answer.feedforward.force)
        assert abs(answer.feedforward.force) <= PARAMETERS.feedforward.force_limit
        assert all(math.isfinite(value) for value in answer.estimate[1:])


def test_velocity_terms_of_the_seals_are_compensated_at_the_velocity_of_the_reference():
    terms = VelocityTerms(viscous_friction=200.0, stribeck_friction=3.0, stribeck_velocity=0.02, asymmetry=0.1)
    seals = tuple(
        MountedSeal(replace(mounted.seal, velocity_terms=terms), mounted.chamber)
        for mounted in PARAMETERS.estimator.seals
    )
    parameters = PARAMETERS._replace(estimator=replace(PARAMETERS.estimator, seals=seals))
    for speed in (0.05, -0.05):
        last = run(ticks(0, 300, speed=speed), parameters)[-1]
        both = actuator_friction(seals, 3e6, 3e6, speed)
        scale = PARAMETERS.feedforward.viscous_scale
        expected = 0.9 * both.coulomb_friction + scale * both.velocity_friction
        assert last.feedforward.force == pytest.approx(math.copysign(expected, speed), rel=1e-6)
        assert both.velocity_friction > 5.0
