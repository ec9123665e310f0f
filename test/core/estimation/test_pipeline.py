"""The path of every message: who triggers what, and that the feed-forward dies away when any of its inputs does."""

import math
from dataclasses import astuple, replace
from itertools import pairwise

import pytest
from harness.answers import NOTHING, receive_one
from harness.compensation import COMPENSATING, compensating
from harness.learnt import learnt_state
from hypothesis import given, settings
from hypothesis import strategies as st

from seal_friction_ros.core.estimation import adaptation, estimator
from seal_friction_ros.core.estimation.adaptation import AdaptationSettings
from seal_friction_ros.core.estimation.conditioned_velocity import NOT_CONDITIONED, SETTLING
from seal_friction_ros.core.estimation.feedforward import FeedForwardSettings
from seal_friction_ros.core.estimation.friction_filter import NOT_BEGUN, Reading, begun
from seal_friction_ros.core.estimation.pipeline import (
    NO_REFERENCE,
    TICK_INTERVAL,
    PipelineParameters,
    ReceiptTimes,
    Reference,
    answered,
    condition_reference,
    init,
    init_running,
    is_tick_due,
    receive,
)
from seal_friction_ros.core.estimation.records import NO_TEMPERATURE
from seal_friction_ros.core.friction.actuator import MountedSeal, actuator_friction
from seal_friction_ros.core.friction.laws.constant_coulomb import ConstantCoulomb
from seal_friction_ros.core.friction.laws.friction_map import FrictionMap
from seal_friction_ros.core.friction.laws.velocity_terms import VelocityTerms
from seal_friction_ros.core.messages.coder import encode, type_of
from seal_friction_ros.core.messages.layouts import ESTIMATE_TYPE, FEEDFORWARD_TYPE
from seal_friction_ros.core.messages.records import (
    NEVER,
    NO_FORCE,
    NO_PRESSURE,
    Clock,
    Force,
    Limited,
    Position,
    Pressure,
    ServoReference,
    Status,
    Velocity,
    WatchdogTick,
)

PARAMETERS = compensating().parameters()
MS = 1_000_000  # [ns]


def mounted(**changes):
    """The default actuator with seals that are changed."""
    seals = tuple(MountedSeal(replace(m.seal, **changes), m.chamber) for m in PARAMETERS.estimator.seals)
    return replace(PARAMETERS.estimator, seals=seals)


SINGLE = PARAMETERS.estimator
TERMS = mounted(velocity_terms=VelocityTerms(viscous_friction=200.0, stribeck_friction=9.0, asymmetry=-0.5))
MAP = mounted(
    coulomb_law=FrictionMap(
        speeds=(1e-3, 1e-2, 1e-1),
        pressures=(0.0, 5e6),
        frictions=(9.0, 7.0, 1.0, 22.0, 18.0, 2.0),
        reference_speed=0.001,
    )
)
FADED = 1e-9  # [N]


def run(messages, parameters=PARAMETERS, times=None):
    """Answers to a run of messages that are not empty, in order; ``times`` [ns] of receipt, by default the stamps."""
    state, answers = init(parameters), []
    for message, received in zip(messages, times or [m.stamp for m in messages], strict=True):
        state, answer = receive_one(parameters, state, message, received)
        if answer is not NOTHING:
            answers.append(answer)
    return answers


def test_an_estimate_is_published_before_its_sample_is_learnt_from(monkeypatch):
    """The estimate goes out before anything is learnt from its sample, which takes nearly as long as the estimate."""
    order = []

    def adapt(*arguments):
        order.append('learnt')
        return adaptation.adapt(*arguments)

    monkeypatch.setattr(estimator, 'adapt', adapt)
    state = init_running(PARAMETERS)
    for message in (Pressure(MS, 3e6, 1e6), Force(MS, 20.0), ServoReference(MS, 0.0, 0.1, 0.0), Velocity(MS, 0.1, b'')):
        receive(PARAMETERS, state, message, MS, lambda answer, _frame: order.append(type(answer).__name__))
    assert order == ['FrictionEstimate', 'learnt', 'FeedForward']


def run_state(messages, parameters=PARAMETERS):
    """State after messages."""
    state = init(parameters)
    for message in messages:
        state, _ = receive_one(parameters, state, message)
    return state


def tick(stamp, speed=0.05, *, reference=True, velocity=True, pressure=3e6):
    """The messages of one moment, in the order a servo sends them."""
    yield Pressure(stamp, pressure, pressure)
    yield Force(stamp, math.copysign(40.0, speed))
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
    last = run(ticks(0, 500))[-1]
    assert last.feedforward.stamp == last.estimate.stamp == 499 * MS
    assert last.feedforward.force == pytest.approx(0.9 * last.estimate.coulomb_friction, rel=1e-6)
    assert last.feedforward.limited == 0
    assert run(ticks(0, 500, speed=-0.05))[-1].feedforward.force == pytest.approx(-last.feedforward.force, rel=1e-6)


def test_the_first_velocity_with_pressure_and_force_sum_makes_a_usable_estimate():
    """The first usable estimate must not come late; until the ripple of the velocity is known, it says so."""
    answers = run(ticks(0, 120))
    assert [a.estimate.status for a in answers[:99]] == [Status.MOTION_UNCERTAIN] * 99
    assert {a.estimate.status for a in answers[99:]} == {0}
    assert {a.estimate.friction_force for a in answers} == {answers[-1].estimate.coulomb_friction}
    assert [a.feedforward.scale for a in answers] == pytest.approx([0.9 * i / 200 for i in range(120)])
    assert [a.feedforward.force > 0.0 for a in answers] == [False] * 99 + [True] * 21


def test_the_estimate_is_emitted_before_the_feed_forward():
    emitted, state = [], init(PARAMETERS)
    for message in ticks(0, 1):
        receive(PARAMETERS, state, message, 0, lambda record, frame: emitted.append((type_of(record), frame)))
    assert emitted[-2:] == [(ESTIMATE_TYPE, b'rod'), (FEEDFORWARD_TYPE, b'rod')]


def watchdog(first, last):
    """Ticks of the watchdog."""
    return [WatchdogTick(ms * MS, 0.01) for ms in range(first, last, 10)]


def time_to_zero(answers, last_usable):
    """Time [s] from the last usable input [ms] to the first feed-forward of 0 N."""
    after = [a.feedforward for a in answers if a.feedforward and a.feedforward.stamp > last_usable * MS]
    return next(f.stamp for f in after if f.force == 0.0) * 1e-9 - last_usable * 1e-3


SETTINGS = PARAMETERS.feedforward
LONGEST = SETTINGS.fade_time + 0.05  # [s] from the last usable input to 0 N


def test_when_velocities_stop_the_watchdog_fades_the_force_out():
    answers = run(ticks(0, 400) + watchdog(400, 800))
    assert answers[-1].feedforward.limited & Limited.FADE
    assert time_to_zero(answers, 399) <= LONGEST


@pytest.mark.parametrize('kind', [Pressure, Force, ServoReference])
def test_when_an_input_stops_the_force_fades_out(kind):
    rest = [message for message in ticks(400, 800) if not isinstance(message, kind)]
    assert time_to_zero(run(ticks(0, 400) + rest), 399) <= LONGEST


@pytest.mark.parametrize('kind', [Velocity, Pressure, Force, ServoReference])
def test_a_stamp_that_repeats_is_no_new_sample(kind):
    """Velocity stamps that repeat held 36.1 N for as long as they came."""
    messages = ticks(0, 400)
    times = [message.stamp for message in messages]
    for message in ticks(400, 800):
        times.append(message.stamp)
        messages.append(message._replace(stamp=399 * MS) if isinstance(message, kind) else message)
    answers = run(messages, times=times)
    force = [a.feedforward.force for a in answers if a.feedforward]
    assert force[399] > 10.0
    assert force[399 + round(LONGEST * 1e3)] == 0.0


def test_stamps_that_alternate_do_not_speed_the_slew_up():
    """Stamps that alternate by 5 ms reversed the force in 45 ms, where the slew limit says 132 ms."""
    parameters = PipelineParameters(PARAMETERS.estimator, replace(SETTINGS, slew_limit=500.0))
    messages = ticks(0, 400) + ticks(400, 800, speed=-0.05)
    times = [message.stamp for message in messages]
    alternating = [m._replace(stamp=m.stamp - 5 * MS) if m.stamp // MS % 2 else m for m in messages]
    forces = [a.feedforward.force for a in run(alternating, parameters, times=times) if a.feedforward][350:]  # faded in
    assert max(abs(a - b) for a, b in pairwise(forces)) <= 500.0 * 1e-3 + 1e-9


def test_one_stamp_ahead_makes_no_step():
    parameters = PipelineParameters(PARAMETERS.estimator, replace(SETTINGS, slew_limit=500.0))
    messages = ticks(0, 400) + ticks(400, 800, speed=-0.05)
    times = [message.stamp for message in messages]
    ahead = [m._replace(stamp=m.stamp + 20 * MS) if m.stamp == 420 * MS else m for m in messages]
    forces = [a.feedforward.force for a in run(ahead, parameters, times=times) if a.feedforward][350:]  # faded in
    assert max(abs(a - b) for a, b in pairwise(forces)) <= 500.0 * 1e-3 + 1e-9


# --- the acceleration of the reference ---


def condition(*references, state=NO_REFERENCE):
    """Conditioned reference after (velocity, acceleration) of one millisecond each."""
    for number, (velocity, acceleration) in enumerate(references):
        stamp = MS * number if state.velocity.stamp == NEVER else state.velocity.stamp + MS
        state = condition_reference(state, ServoReference(stamp, 0.0, velocity, acceleration, b''))
    return state


def test_an_acceleration_counts_where_two_references_agree_with_the_smaller_magnitude():
    for accelerations, agreed in (
        ((2.0,), 0.0),
        ((2.0, 3.0), 2.0),
        ((-3.0, -2.0), -2.0),
        ((2.0, -3.0), 0.0),
        ((2.0, 0.0), 0.0),
        ((2.0, math.nan), 0.0),
        ((math.nan, 2.0), 0.0),
        ((2.0, math.nan, 3.0, 3.0), 3.0),
    ):
        assert condition(*((0.1, a) for a in accelerations)).acceleration == agreed


def test_a_clean_reference_is_kept_as_it_is():
    assert condition((0.1, 0.0), (0.3, 0.0)).velocity.velocity == 0.3


def test_the_acceleration_of_a_reference_with_a_ripple_is_smoothed_over_4_times_its_smoothing():
    state = condition(*((v, 0.0) for v in (0.1, 0.101, 0.1, 0.101, 0.1) * 20))
    state = condition(*[(0.0, 0.0), (1e-3, 0.0)] * 3)
    assert state.velocity.half_width > 0.0
    before = state._replace(acceleration=1.0, last_acceleration=5.0)
    after = condition((1e-3, 5.0), state=before)
    share = 1e-3 / (1e-3 + 4.0 * after.velocity.smoothing)
    assert after.acceleration == pytest.approx(1.0 + share * 4.0, rel=1e-12)
    assert after.last_acceleration == 5.0


def test_the_lead_begins_once_the_reference_has_settled():
    """Acceleration counts from the sample on with which the velocity does."""
    leading = PARAMETERS._replace(feedforward=replace(SETTINGS, lead_time=0.01, smoothing_velocity=1.0))
    plain = PARAMETERS._replace(feedforward=replace(SETTINGS, lead_time=0.0, smoothing_velocity=1.0))
    moments = [message for ms in range(110) for message in tick(ms * MS)]
    messages = [m._replace(acceleration=2.0) if isinstance(m, ServoReference) else m for m in moments]
    with_lead, without = ([a.feedforward.force for a in run(messages, p)] for p in (leading, plain))
    assert with_lead[:99] == without[:99] == [0.0] * 99
    assert with_lead[99] / without[99] == pytest.approx(math.tanh(0.07) / math.tanh(0.05))


def test_a_simulation_begins_settled_and_faded_in():
    state = init_running(PARAMETERS)
    for message in ticks(0, 3):
        state, answer = receive_one(PARAMETERS, state, message)
    assert answer.estimate.status == 0
    assert answer.feedforward.scale == 0.9
    assert answer.feedforward.force > 10.0


def test_the_smallest_friction_is_compensated_too():
    weak = mounted(coulomb_law=ConstantCoulomb(0.3), velocity_terms=VelocityTerms(asymmetry=-0.5))
    for speed in (0.05, -0.05):
        last = run(ticks(0, 400, speed=speed), PARAMETERS._replace(estimator=weak))[-1]
        both = actuator_friction(weak.seals, 3e6, 3e6, speed)
        sliding = both.coulomb_friction + both.velocity_friction
        assert last.feedforward.force == pytest.approx(math.copysign(0.9 * sliding, speed), rel=1e-6)
        assert 0.2 < sliding < 1.0


def test_refused_inputs_fade_the_force_out():
    state = replace(run_state(ticks(0, 400)), refused=True)
    for message in ticks(400, 400 + round(LONGEST * 1e3)):
        state, answer = receive_one(PARAMETERS, state, message)
    assert answer.feedforward.force == 0.0


def test_a_tick_is_due_while_there_is_a_force_that_nothing_renews():
    state = run_state(ticks(0, 400))
    assert not is_tick_due(state, 399 * MS + TICK_INTERVAL - 1)
    assert is_tick_due(state, 399 * MS + TICK_INTERVAL)
    for message in watchdog(410, 800):
        state, _ = receive_one(PARAMETERS, state, message)
    assert not is_tick_due(state, 10**12)
    assert not is_tick_due(init(PARAMETERS), 10**12)
    nothing = replace(state, feedforward=state.feedforward._replace(fade=0.5, force=0.0))
    assert not is_tick_due(nothing, 10**12)


@pytest.mark.parametrize(('velocity', 'wanted'), [(0.0, 0.0), (0.05, 0.04)])
def test_a_reference_with_a_ripple_leads_in_motion_and_not_at_rest(velocity, wanted):
    leading = PARAMETERS._replace(feedforward=replace(PARAMETERS.feedforward, lead_time=0.01))
    given_ = NOT_CONDITIONED._replace(stamp=MS, velocity=velocity, half_width=1e-6, samples=SETTLING)
    state = replace(init(leading), reference=Reference(given_, -1.0, 0.0), receipt=ReceiptTimes(reference=MS))
    state, _ = receive_one(leading, state, Velocity(2 * MS, 0.0))
    assert state.feedforward.velocity == pytest.approx(wanted)


@pytest.mark.parametrize('kind', [Pressure, Force, ServoReference])
def test_an_input_that_is_slower_than_the_velocity_counts_for_its_timeout(kind):
    """The timeouts are 30 ms: at 50 Hz the force stays, at 25 Hz it begins to fade."""
    for period, stays in ((20, True), (40, False)):
        slow = [m for m in ticks(0, 1000) if not isinstance(m, kind) or m.stamp // MS % period == 0]
        scales = [answer.feedforward.scale for answer in run(slow)[900:]]
        assert (min(scales) == 0.9) is stays


@pytest.mark.parametrize('kind', [Pressure, Force, ServoReference])
def test_the_fade_begins_at_the_timeout(kind):
    rest = [message for message in ticks(400, 500) if not isinstance(message, kind)]
    scales = [answer.feedforward.scale for answer in run(ticks(0, 400) + rest)]
    assert scales[399 + 29] == 0.9
    assert scales[399 + 41] - scales[399 + 31] == pytest.approx(-0.9 * 0.01 / 0.2)
    assert 0.88 < scales[399 + 31] < 0.9


def test_when_references_stop_velocities_fade_the_force_out():
    answers = run(ticks(0, 400) + ticks(400, 800, reference=False))
    last = answers[-1]
    assert last.estimate.status == 0
    assert last.feedforward.limited == Limited.FADE
    assert abs(last.feedforward.force) < FADED


def test_when_the_pressure_fails_the_force_fades_out_and_comes_back_with_it():
    bad = ticks(400, 800, pressure=math.nan)
    answers = run(ticks(0, 400) + bad + ticks(800, 1200))
    before, faded, after = answers[399], answers[799], answers[-1]
    assert faded.estimate.status & Status.PRESSURE_NOT_FINITE
    assert abs(faded.feedforward.force) < FADED
    assert after.feedforward.force == pytest.approx(before.feedforward.force, rel=1e-9)


def test_by_the_measured_velocity_no_reference_is_needed():
    parameters = PipelineParameters(PARAMETERS.estimator, replace(COMPENSATING, use_measured_velocity=True))
    assert run(ticks(0, 300, reference=False), parameters)[-1].feedforward.force > 10.0


@given(
    st.sampled_from([SINGLE, TERMS, MAP]),
    st.floats(0.0, 2.0),
    st.floats(1e-4, 0.5),
    st.floats(0.2, 5.0),
    st.floats(-1.0, 1.0),
)
@settings(max_examples=60)
def test_the_force_has_the_sign_of_the_wanted_velocity(estimator, scale, speed, frequency, share):
    """Any law, gain and clean reference: slew and fade are the only exceptions, and they are off here."""
    feedforward = FeedForwardSettings(scale=scale, slew_limit=1e9, force_limit=1e6, lead_time=0.0)
    parameters, state = PipelineParameters(estimator, feedforward), init(PARAMETERS)
    state.feedforward = state.feedforward._replace(fade=1.0)
    for ms in range(400):
        wanted = speed * (math.sin(6.28 * frequency * ms * 1e-3) + share)
        for message in tick(ms * MS, speed=wanted):
            state, answer = receive_one(parameters, state, message)
        assert answer.feedforward.force * wanted >= 0.0
        if scale == 0.0:
            assert answer.feedforward.force == 0.0


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
        last = run(ticks(0, 500, speed=speed), parameters)[-1]
        both = actuator_friction(seals, 3e6, 3e6, speed)
        expected = 0.9 * (both.coulomb_friction + both.velocity_friction)
        assert last.feedforward.force == pytest.approx(math.copysign(expected, speed), rel=1e-6)
        assert both.velocity_friction > 5.0


# --- what is kept of each message ---


def test_before_the_first_message_nothing_is_known():
    state = init(PARAMETERS)
    assert (state.friction, state.refused, state.clock_offset) == (-1.0, False, 0)
    assert (state.pressure, state.force, state.temperature) == (NO_PRESSURE, NO_FORCE, NO_TEMPERATURE)
    assert state.reference == (NOT_CONDITIONED, 0.0, 0.0)
    assert state.receipt == ReceiptTimes(*[NEVER] * 5)
    assert state.clock == NEVER


def receipts(message, state=None, received=7):
    """Times of receipt after a message, of velocity, pressure, force, reference and clock."""
    return astuple(receive_one(PARAMETERS, state or init(PARAMETERS), message, received)[0].receipt)


@pytest.mark.parametrize(
    ('message', 'counts'),
    [
        (Velocity(5, 0.1), True),
        (Velocity(5, math.nan), False),
        (Velocity(5, 11.0), False),
        (Pressure(5, 1e6, 1e6), True),
        (Pressure(5, math.nan, 1e6), True),  # the estimate tells whether it is usable
        (Force(5, 1e6), True),
        (Force(5, -1e6), True),
        (Force(5, 1.1e6), False),
        (Force(5, -1.1e6), False),
        (Force(5, math.nan), False),
        (ServoReference(5, 0.0, 0.1, 0.0), True),
        (ServoReference(5, 0.0, math.nan, 0.0), False),
        (ServoReference(5, 0.0, math.inf, 0.0), False),
        (ServoReference(5, 0.0, 10.0, -1e3), True),  # the most that a rod may do
        (ServoReference(5, 0.0, 10.1, 0.0), False),
        (ServoReference(5, 0.0, -10.1, 0.0), False),
        (ServoReference(5, 0.0, 0.1, 1.1e3), False),
        (ServoReference(5, 0.0, 0.1, -1.1e3), False),
        (ServoReference(5, 0.0, 0.1, math.inf), False),
        (ServoReference(5, 0.0, 0.1, math.nan), True),  # not known
        (Clock(5), True),
        (Position(5, 0.1), False),
    ],
)
def test_an_input_is_renewed_by_a_sample_that_is_new_and_usable(message, counts):
    kinds = (Velocity, Pressure, Force, ServoReference, Clock)
    expected = tuple(7 if counts and isinstance(message, kind) else NEVER for kind in kinds)
    assert receipts(message) == expected
    state, _ = receive_one(PARAMETERS, init(PARAMETERS), message, 7)
    assert receipts(message, state, 9) == expected  # the same stamp again


@pytest.mark.parametrize(
    ('late', 'is_flagged'), [(0.0, False), (0.99, False), (1.01, True), (-0.99, False), (-1.01, True)]
)
def test_the_age_of_a_stamp_is_taken_on_the_clock_of_the_stamps(late, is_flagged):
    state = replace(init(PARAMETERS), clock_offset=500 * 10**9)
    stamp = 507 * 10**9 - round(late * 1e9)
    _, answer = receive_one(PARAMETERS, state, Velocity(stamp, 0.1), 7 * 10**9)
    assert bool(answer.estimate.status & Status.STAMP_AGE) is is_flagged


def test_answers_are_told_by_type_and_bytes():
    state = run_state(ticks(0, 10))
    velocity = Velocity(10 * MS, 0.05, b'rod')
    _, expected = receive_one(PARAMETERS, state, velocity)
    after, found = answered(PARAMETERS, state, velocity, 10 * MS)
    assert found == [
        (ESTIMATE_TYPE, encode(expected.estimate, b'rod')),
        (FEEDFORWARD_TYPE, encode(expected.feedforward, b'rod')),
    ]
    assert after.estimator.stamp == 10 * MS


def test_the_watchdog_acts_after_9_ms():
    state = run_state(ticks(0, 400))
    assert not is_tick_due(state, 408 * MS - 1)
    assert is_tick_due(state, 408 * MS)
    weak = replace(state, feedforward=state.feedforward._replace(fade=1.0, force=0.5))
    assert is_tick_due(weak, 408 * MS)


def test_without_any_force_sum_the_force_helps_the_motion_and_without_any_pressure_there_is_none():
    without_force = [m for m in ticks(0, 400) if not isinstance(m, Force)]
    assert run(without_force)[-1].feedforward.force > 10.0
    without_pressure = [m for m in ticks(0, 400) if not isinstance(m, Pressure)]
    assert {a.feedforward.force for a in run(without_pressure)} == {0.0}


@pytest.mark.parametrize(('mode', 'scale'), [('on', 1.5), ('observe', 1.0), ('off', 1.0)])
def test_the_feed_forward_has_the_scale_that_is_learnt_on_all_of_its_friction(mode, scale):
    viscous = mounted(velocity_terms=VelocityTerms(viscous_friction=200.0))
    known = PARAMETERS._replace(estimator=replace(viscous, adaptation=AdaptationSettings(mode)))
    state = init_running(known)
    learnt = begun(Reading(0, 60.0, 1, 0.05, 0.0, 40.0, 3.0))
    learnt = learnt._replace(terms=learnt.terms._replace(scale=1.5), covariance=NOT_BEGUN.covariance)
    learnt = learnt._replace(innovation_std=4.0, friction=40.0, friction_std=4.0)
    state.estimator.adaptation = learnt_state(state.estimator.adaptation, filter=learnt)
    for message in ticks(0, 5):
        state, answer = receive_one(known, state, message)
    both = actuator_friction(viscous.seals, 3e6, 3e6, 0.05)
    assert both.velocity_friction > 10.0
    assert answer.feedforward.force == pytest.approx(
        0.9 * scale * (both.coulomb_friction + both.velocity_friction), rel=1e-3
    )


@pytest.mark.parametrize('mode', ['observe', 'on'])
@pytest.mark.parametrize('actuator', [SINGLE, TERMS, MAP])  # MAP falls with speed
def test_before_anything_is_learnt_the_feed_forward_is_that_of_the_law_in_any_mode(actuator, mode):
    forces = []
    for each in ('off', mode):
        known = PARAMETERS._replace(estimator=replace(actuator, adaptation=AdaptationSettings(each)))
        state = init_running(known)
        for message in ticks(0, 3):  # the first reading is of 4 ms
            state, answer = receive_one(known, state, message)
        forces.append(answer.feedforward.force)
    assert forces[1] == pytest.approx(forces[0])


def test_a_law_without_friction_leaves_no_force():
    none = mounted(coulomb_law=ConstantCoulomb(0.0), velocity_terms=VelocityTerms())
    assert {answer.feedforward.force for answer in run(ticks(0, 400), PARAMETERS._replace(estimator=none))} == {0.0}


def test_velocity_terms_are_not_added_to_a_friction_that_is_not_usable():
    bad = ticks(400, 410, pressure=math.nan)
    faded = run(ticks(0, 400) + bad, PARAMETERS._replace(estimator=TERMS))
    scales = [answer.feedforward.scale for answer in faded[400:]]
    assert scales == pytest.approx([0.9 * (1.0 - i / 200.0) for i in range(1, 11)])


def test_the_first_reference_with_a_ripple_has_no_acceleration_to_smooth():
    known = NOT_CONDITIONED._replace(half_width=1e-6, samples=SETTLING)
    first = condition_reference(Reference(known, 7.0, 3.0), ServoReference(5 * MS, 0.0, 0.1, 2.0))
    assert (first.acceleration, first.last_acceleration) == (2.0, 2.0)
