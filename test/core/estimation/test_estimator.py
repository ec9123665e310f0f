"""The estimator: what holds for every input, and what each status bit says."""

import math
from dataclasses import replace

import pytest
from harness.learnt import learnt_state
from hypothesis import example, given, settings
from hypothesis import strategies as st
from paths import ROOT

from seal_friction_ros.core.estimation import estimator
from seal_friction_ros.core.estimation.adaptation import AdaptationSettings
from seal_friction_ros.core.estimation.conditioned_velocity import NOT_CONDITIONED, SETTLING
from seal_friction_ros.core.estimation.estimator import EstimatorParameters, EstimatorSettings, EstimatorState, step
from seal_friction_ros.core.estimation.friction_filter import NOT_BEGUN
from seal_friction_ros.core.estimation.records import RodSample
from seal_friction_ros.core.estimation.swings import LONGEST_SWING
from seal_friction_ros.core.friction.actuator import MountedSeal, actuator_friction
from seal_friction_ros.core.friction.force_sum_correction import ForceSumCorrection
from seal_friction_ros.core.friction.identified_motion import ANY_MOTION, IdentifiedMotion
from seal_friction_ros.core.friction.laws.velocity_terms import VelocityTerms
from seal_friction_ros.core.friction.mounting import CHAMBERS
from seal_friction_ros.core.friction.seal_file import parse_seal
from seal_friction_ros.core.friction.states import FrictionState
from seal_friction_ros.core.messages.coder import decode, encode
from seal_friction_ros.core.messages.layouts import ESTIMATE_TYPE
from seal_friction_ros.core.messages.records import NO_FORCE, NO_PRESSURE, Force, FrictionEstimate, Pressure, Status
from seal_friction_ros.files import read_yaml

SEALS = {
    name: parse_seal(read_yaml(ROOT / 'config' / 'seals' / f'{name}.yaml'))
    for name in ('ms28775_114', 'ms28775_114_table', 'ms28775_114_prior_art')
}
BOTH = (MountedSeal(SEALS['ms28775_114'], 'a'), MountedSeal(SEALS['ms28775_114'], 'b'))
PARAMETERS = EstimatorParameters(EstimatorSettings(), BOTH)
START = 1_700_000_000_000_000_000  # [ns]
MS = 1_000_000  # [ns]


def sample(stamp=START, velocity=0.01, pressure=3e6, force=30.0, *, pressure_age=0, force_age=0) -> RodSample:
    """A good sample but for what is given; ages in [ms]; a pressure may be one for both chambers, a pair, or None."""
    a, b = pressure if isinstance(pressure, tuple) else (pressure, pressure)
    return RodSample(
        stamp,
        velocity,
        NO_PRESSURE if pressure is None else Pressure(stamp - pressure_age * MS, a, b),
        NO_FORCE if force is None else Force(stamp - force_age * MS, force),
    )


def init(parameters=PARAMETERS) -> EstimatorState:
    """Before the first sample, but with a velocity whose ripple is known: there is none."""
    return replace(estimator.init(parameters), motion=NOT_CONDITIONED._replace(samples=SETTLING))


def run(samples, parameters=PARAMETERS) -> list[FrictionEstimate]:
    state, estimates = init(parameters), []
    for one in samples:
        state, estimate = step(parameters, state, one)
        estimates.append(estimate)
    return estimates


def only(one: RodSample, parameters=PARAMETERS) -> FrictionEstimate:
    return run([one], parameters)[0]


def last(*samples: RodSample, parameters=PARAMETERS) -> FrictionEstimate:
    return run(samples, parameters)[-1]


# --- any input ---

anything = st.floats() | st.sampled_from([5e-324, -5e-324, 2.2e-308, 1e300, -1.7976931348623157e308, -0.0])
plausible = st.floats(-2e5, 5e7)
any_stamp = st.integers(-(2**31) * 10**9, 2**31 * 10**9 - 1)
near_stamp = st.integers(-200 * MS, 200 * MS).map(lambda offset: START + offset)
stamps = any_stamp | near_stamp
pressures = st.just(NO_PRESSURE) | st.builds(Pressure, stamps, anything | plausible, anything | plausible)
forces = st.just(NO_FORCE) | st.builds(Force, stamps, anything | st.floats(-1e3, 1e3))
any_sample = st.builds(RodSample, stamps, anything | st.floats(-0.01, 0.01), pressures, forces, st.booleans())

mounted = st.builds(MountedSeal, st.sampled_from(sorted(SEALS)).map(SEALS.__getitem__), st.sampled_from('ab'))
all_settings = st.builds(
    lambda speeds, **others: EstimatorSettings(stick_velocity=min(speeds), slip_velocity=max(speeds), **others),
    st.tuples(*[st.sampled_from([0.0, 1e-3, 2e-3]) | st.floats(0.0, 1.0)] * 2),
    use_stiction=st.booleans(),
    pressure_timeout=st.floats(1e-3, 1.0),
    force_timeout=st.floats(1e-3, 1.0),
    pressure_min=st.floats(-1.2e5, 0.0),
    pressure_max=st.floats(1e4, 1e9),
    velocity_max=st.floats(1e-3, 100.0),
    force_max=st.floats(1.0, 1e9),
    pressure_rate_max=st.floats(1.0, 1e15),
    force_rate_max=st.floats(1e-3, 1e15),
    acceleration_max=st.floats(1e-3, 1e9),
)
all_parameters = st.builds(EstimatorParameters, all_settings, st.lists(mounted, min_size=1, max_size=3).map(tuple))

corrections = st.sampled_from([None, ForceSumCorrection(1.0, -1.0, 1e6, contains_load=True)])
motions = st.sampled_from([ANY_MOTION, IdentifiedMotion(1e-3, 0.005, (1,)), IdentifiedMotion(directions=(-1,))])
told_seals = st.builds(
    lambda name, correction, motion: replace(SEALS[name], force_sum_correction=correction, identified_motion=motion),
    st.sampled_from(sorted(SEALS)),
    corrections,
    motions,
)
any_mounted = st.builds(MountedSeal, told_seals, st.sampled_from(CHAMBERS))
any_parameters = st.builds(EstimatorParameters, all_settings, st.lists(any_mounted, min_size=1, max_size=3).map(tuple))


@settings(max_examples=400)
@given(any_parameters, st.lists(any_sample, min_size=1, max_size=6))
@example(PARAMETERS, [RodSample(START, math.nan, Pressure(START, math.nan, math.inf), Force(START, -math.inf))])
def test_whatever_comes_in_what_goes_out_is_finite_consistent_and_can_be_sent(parameters, samples):
    for one, estimate in zip(samples, run(samples, parameters), strict=True):
        assert all(math.isfinite(value) for value in estimate)
        assert estimate.stamp == one.stamp
        assert 0.0 <= estimate.coulomb_friction <= estimate.breakaway_force
        assert estimate.coulomb_friction_std >= 0.0
        assert abs(estimate.friction_force) <= estimate.breakaway_force
        assert estimate.direction in (-1, 0, 1)
        assert estimate.friction_force * estimate.direction >= 0.0
        assert 0 <= estimate.status < 2 * max(Status)
        if estimate.state == FrictionState.UNKNOWN:
            assert (estimate.direction, estimate.friction_force) == (0, 0.0)
            assert estimate.status
        assert decode(ESTIMATE_TYPE, encode(estimate)) == estimate


@given(all_parameters, st.lists(any_sample, min_size=1, max_size=6))
def test_the_same_samples_give_the_same_bytes(parameters, samples):
    once, again = ([encode(e) for e in run(samples, parameters)] for _ in range(2))
    assert once == again


@given(all_parameters, st.lists(any_sample, min_size=2, max_size=6), st.integers(1, 5))
def test_a_state_carries_all_that_matters_from_the_past(parameters, samples, cut):
    state = init(parameters)
    for one in samples[:cut]:
        state, _ = step(parameters, state, one)
    kept = state.copy()
    rest = []
    for one in samples[cut:]:
        kept, estimate = step(parameters, kept, one)
        rest.append(estimate)
    assert rest == run(samples, parameters)[cut:]


@given(all_parameters, any_sample, any_sample)
def test_a_step_leaves_the_state_it_was_given_as_it_was(parameters, first, second):
    state, _ = step(parameters, init(parameters), first)
    before = repr(state)
    step(parameters, state, second)
    assert repr(state) == before


# --- physics, on usable inputs ---

good = st.builds(
    sample,
    velocity=st.sampled_from([0.0, 1e-3, -1.5e-3]) | st.floats(-0.5, 0.5),
    pressure=st.tuples(st.floats(-1e5, 9e6), st.floats(-1e5, 9e6)),
    force=st.sampled_from([0.0, 30.0, -30.0]) | st.floats(-200.0, 200.0),
)
seals_and_settings = st.builds(
    EstimatorParameters,
    st.builds(EstimatorSettings, use_stiction=st.booleans()),
    st.lists(mounted, min_size=1, max_size=3).map(tuple),
)


@given(seals_and_settings, st.lists(good, min_size=1, max_size=5))
def test_sliding_friction_takes_power_from_the_rod(parameters, samples):
    for one, estimate in zip(samples, run(samples, parameters), strict=True):
        if estimate.state == FrictionState.SLIDING:
            assert estimate.friction_force * one.velocity > 0.0
            assert abs(estimate.friction_force) == estimate.coulomb_friction


@given(seals_and_settings, st.lists(good, min_size=1, max_size=5))
def test_friction_at_rest_never_pushes_the_rod_along(parameters, samples):
    for one, estimate in zip(samples, run(samples, parameters), strict=True):
        if estimate.state in (FrictionState.STUCK, FrictionState.BREAKAWAY):
            net = one.force.force - estimate.friction_force
            assert net * one.force.force >= 0.0


@given(seals_and_settings, st.lists(good, min_size=1, max_size=5))
def test_a_stuck_rod_feels_exactly_the_force_sum(parameters, samples):
    for one, estimate in zip(samples, run(samples, parameters), strict=True):
        if estimate.state == FrictionState.STUCK:
            assert estimate.friction_force == one.force.force
            assert abs(one.force.force) < estimate.breakaway_force


@given(seals_and_settings, st.lists(any_sample | good, min_size=1, max_size=6))
def test_left_and_right_are_alike(parameters, samples):
    mirrored = [
        one._replace(velocity=-one.velocity, force=one.force._replace(force=-one.force.force)) for one in samples
    ]
    for here, there in zip(run(samples, parameters), run(mirrored, parameters), strict=True):
        turned = {
            name: -getattr(here, name) for name in ('friction_force', 'direction', 'adaptation_offset', 'residual')
        }
        assert there == here._replace(**turned)


@given(seals_and_settings, good, st.floats(0.0, 2e7), st.floats(0.0, 2e7))
def test_more_pressure_in_either_chamber_is_never_less_friction(parameters, one, more_a, more_b):
    a, b = one.pressure.chamber_a, one.pressure.chamber_b
    higher = one._replace(pressure=Pressure(START, a + more_a, b + more_b))
    low, high = only(one, parameters), only(higher, parameters)
    for name in ('coulomb_friction', 'coulomb_friction_std', 'breakaway_force'):
        assert getattr(low, name) <= getattr(high, name) * (1.0 + 1e-12)
    assert abs(low.friction_force) <= abs(high.friction_force) * (1.0 + 1e-12)


@given(good)
def test_coulomb_friction_and_its_std_are_those_of_the_actuator(one):
    expected = actuator_friction(BOTH, one.pressure.chamber_a, one.pressure.chamber_b)
    estimate = only(one, replace(PARAMETERS, adaptation=AdaptationSettings('off')))
    assert estimate.coulomb_friction == expected.coulomb_friction
    assert estimate.coulomb_friction_std == expected.coulomb_friction_std
    assert estimate.breakaway_force == expected.coulomb_friction + expected.stiction


@given(good)
def test_without_stiction_the_rod_breaks_away_at_the_coulomb_friction(one):
    estimate = only(one, replace(PARAMETERS, settings=EstimatorSettings(use_stiction=False)))
    assert estimate.breakaway_force == estimate.coulomb_friction


def test_a_rod_that_rests_is_pushed_and_slides_goes_through_the_three_states():
    pushes = [(0.0, 0.0), (0.0, 20.0), (0.0, 60.0), (1.5e-3, 60.0), (0.05, 60.0), (1.5e-3, 60.0), (5e-4, 10.0)]
    states = [
        FrictionState(e.state).name for e in run([sample(START + i * MS, v, 3e6, f) for i, (v, f) in enumerate(pushes)])
    ]
    assert states == ['STUCK', 'STUCK', 'BREAKAWAY', 'BREAKAWAY', 'SLIDING', 'SLIDING', 'STUCK']


# --- status bits: provoked, and gone with the next good sample ---

GOOD = sample(START)
SLOWER = Status.SLOWER_THAN_IDENTIFIED  # a rod in the band of rest that slides
PROVOKED = {
    # name: (samples before, sample that provokes it, all bits then set)
    'PRESSURE_MISSING': ([], sample(START + MS, pressure=None), Status.PRESSURE_MISSING),
    'FORCE_MISSING': ([], sample(START + MS, force=None), Status.FORCE_MISSING),
    'PRESSURE_STALE': ([GOOD], sample(START + MS, pressure_age=101), Status.PRESSURE_STALE),
    'FORCE_STALE': ([GOOD], sample(START + MS, force_age=101), Status.FORCE_STALE),
    'PRESSURE_NOT_FINITE': ([GOOD], sample(START + MS, pressure=(3e6, math.nan)), Status.PRESSURE_NOT_FINITE),
    'FORCE_NOT_FINITE': ([GOOD], sample(START + MS, force=math.inf), Status.FORCE_NOT_FINITE),
    'VELOCITY_NOT_FINITE': ([GOOD], sample(START + MS, velocity=math.nan), Status.VELOCITY_NOT_FINITE),
    'PRESSURE_OUT_OF_RANGE': ([GOOD], sample(START + MS, pressure=(4.6e7, 3e6)), Status.PRESSURE_OUT_OF_RANGE),
    'FORCE_OUT_OF_RANGE': ([GOOD], sample(START + MS, force=-1.1e6), Status.FORCE_OUT_OF_RANGE),
    'VELOCITY_OUT_OF_RANGE': ([GOOD], sample(START + MS, velocity=-10.1), Status.VELOCITY_OUT_OF_RANGE),
    'OUTSIDE_IDENTIFIED_RANGE': ([GOOD], sample(START + MS, pressure=(3e6, 7.1e6)), Status.OUTSIDE_IDENTIFIED_RANGE),
    'STAMP_NOT_INCREASING': ([GOOD], GOOD, Status.STAMP_NOT_INCREASING),
    'PRESSURE_LEAP': ([GOOD], sample(START + MS, pressure=(3e6, 1.4e7)), Status.PRESSURE_LEAP),
    'FORCE_LEAP': ([GOOD], sample(START + MS, force=-1.1e5), Status.FORCE_LEAP),
    'VELOCITY_LEAP': ([GOOD], sample(START + MS, velocity=-1.1), Status.VELOCITY_LEAP),
    'INPUT_REFUSED': ([GOOD], sample(START + MS)._replace(refused=True), Status.INPUT_REFUSED),
    'STAMP_AGE': ([GOOD], sample(START + MS)._replace(stamp_age=-1.01), Status.STAMP_AGE),
    'LATE_INPUT': ([GOOD], sample(START + MS)._replace(is_late=True), Status.LATE_INPUT),
    'MOTION_UNCERTAIN': ([GOOD], sample(START + MS, velocity=9e-4, force=-30.0), Status.MOTION_UNCERTAIN | SLOWER),
    'FASTER_THAN_IDENTIFIED': ([GOOD], sample(START + MS, velocity=0.06), Status.FASTER_THAN_IDENTIFIED),
    'SLOWER_THAN_IDENTIFIED': ([GOOD], sample(START + MS, velocity=3e-3), Status.SLOWER_THAN_IDENTIFIED),
}
IDENTIFIED = tuple(replace(m, seal=replace(m.seal, identified_motion=IdentifiedMotion(0.005, 0.05))) for m in BOTH)


def test_every_status_bit_is_provoked_here():
    # a new direction sets MOTION_UNCERTAIN, too; a load is in the force sum of a machine or it is not; test_adaptation
    # the temperature: test_seal_temperature
    below = {'DIRECTION_NOT_IDENTIFIED', 'FORCE_CONTAINS_LOAD', 'MODEL_DISAGREES'}
    below |= {'TEMPERATURE_MISSING', 'OUTSIDE_IDENTIFIED_TEMPERATURE', 'PRESLIDING'}  # test_sheared_seals the last
    assert {*PROVOKED} == {bit.name for bit in Status} - below


@pytest.mark.parametrize('name', PROVOKED)
def test_a_status_bit_is_set_by_its_cause_alone_and_gone_with_the_next_good_sample(name):
    before, provoking, expected = PROVOKED[name]
    after = sample(START + 2 * MS)
    estimates = run([*before, provoking, after], replace(PARAMETERS, seals=IDENTIFIED))
    assert [Status(e.status) for e in estimates] == [Status(0)] * len(before) + [expected, Status(0)]
    assert estimates[-1] == only(after)


@pytest.mark.parametrize(
    ('change', 'status'),
    [
        ({'pressure': math.inf}, Status.PRESSURE_NOT_FINITE | Status.PRESSURE_MISSING),
        ({'pressure': (math.nan, 9e9)}, Status.PRESSURE_NOT_FINITE | Status.PRESSURE_MISSING),
        ({'pressure': (3e6, 9e9)}, Status.PRESSURE_OUT_OF_RANGE | Status.PRESSURE_MISSING),
        ({'pressure': (-1.3e5, 3e6)}, Status.PRESSURE_OUT_OF_RANGE | Status.PRESSURE_MISSING),
        ({'force': math.nan}, Status.FORCE_NOT_FINITE | Status.FORCE_MISSING),
        ({'force': 2e6}, Status.FORCE_OUT_OF_RANGE | Status.FORCE_MISSING),
        ({'velocity': -math.inf}, Status.VELOCITY_NOT_FINITE),
        ({'velocity': 11.0}, Status.VELOCITY_OUT_OF_RANGE),
        ({'pressure': None, 'force': None}, Status.PRESSURE_MISSING | Status.FORCE_MISSING),
        ({'pressure_age': 500, 'force_age': -500}, Status.PRESSURE_STALE | Status.FORCE_STALE),
    ],
)
def test_what_was_never_usable_is_missing_too(change, status):
    assert Status(only(sample(**change)).status) == status


@pytest.mark.parametrize(('age', 'stale'), [(100, False), (101, True), (-100, False), (-101, True), (0, False)])
def test_an_input_is_stale_further_than_its_timeout_from_the_velocity_before_or_after(age, stale):
    assert bool(only(sample(pressure_age=age)).status & Status.PRESSURE_STALE) is stale
    assert bool(only(sample(force_age=age)).status & Status.FORCE_STALE) is stale


@pytest.mark.parametrize(('stamp', 'bit'), [(START - 1, True), (START, True), (START + 1, False)])
def test_a_stamp_must_be_after_the_one_before(stamp, bit):
    assert bool(last(sample(START), sample(stamp)).status & Status.STAMP_NOT_INCREASING) is bit


def test_time_that_jumps_back_is_flagged_once_and_then_goes_on_from_there():
    stamps_ = [START, START + MS, START - 1000 * MS, START - 999 * MS]
    statuses = [e.status for e in run([sample(stamp) for stamp in stamps_])]
    assert statuses == [0, 0, Status.STAMP_NOT_INCREASING, 0]


# --- the last usable value ---


@pytest.mark.parametrize('bad', [math.nan, math.inf, -math.inf, 4.6e7, -1.3e5, 1e308])
@pytest.mark.parametrize('chamber', [0, 1])
def test_an_unusable_pressure_never_replaces_the_last_usable_one(bad, chamber):
    pair = (bad, 5e6) if chamber == 0 else (5e6, bad)
    estimates = run([sample(START), sample(START + MS, pressure=pair), sample(START + 2 * MS, pressure=pair)])
    assert {e.coulomb_friction for e in estimates} == {estimates[0].coulomb_friction}
    assert [e.state for e in estimates] == [FrictionState.SLIDING] * 3


@pytest.mark.parametrize('bad', [math.nan, math.inf, -math.inf, 1.1e6, -1e308])
def test_an_unusable_force_sum_never_replaces_the_last_usable_one(bad):
    at_rest = [sample(START, 0.0, force=12.5), sample(START + MS, 0.0, force=bad), sample(START + 2 * MS, 0.0)]
    assert [e.friction_force for e in run(at_rest)] == [12.5, 12.5, 30.0]


def test_the_last_usable_pressure_grows_old_and_is_then_stale():
    bad = [sample(START + i * 10 * MS, pressure=math.nan) for i in range(1, 21)]
    estimates = run([sample(START), *bad])
    stale = [bool(e.status & Status.PRESSURE_STALE) for e in estimates]
    assert stale == [False] * 11 + [True] * 10
    assert estimates[-1].input_age == pytest.approx(0.2)


def test_a_stale_pressure_keeps_state_and_friction_but_says_so():
    fresh, stale = only(sample()), only(sample(pressure_age=5000))
    assert stale[:8] == (*fresh[:7], Status.PRESSURE_STALE)


# --- leaps ---

LEAPS = {  # name: (a value far away, bit)
    'pressure': (4e7, Status.PRESSURE_LEAP),
    'force': (5e5, Status.FORCE_LEAP),
    'velocity': (-5.0, Status.VELOCITY_LEAP),
}


@pytest.mark.parametrize('name', LEAPS)
def test_a_spike_costs_one_sample_and_the_value_before_it_stays_in_use(name):
    far, bit = LEAPS[name]
    estimates = run([sample(), sample(START + MS, **{name: far}), sample(START + 2 * MS)])
    assert [e.status for e in estimates] == [0, bit, 0]
    assert estimates[1].coulomb_friction == estimates[0].coulomb_friction
    assert estimates[1].input_age == pytest.approx(0.0 if name == 'velocity' else 1e-3)


@pytest.mark.parametrize('name', LEAPS)
def test_a_step_that_is_real_costs_one_sample_too(name):
    far, bit = LEAPS[name]
    stepped = [sample(START + i * MS, **{name: far}) for i in range(1, 4)]
    extrapolated = Status.OUTSIDE_IDENTIFIED_RANGE if name == 'pressure' else 0
    first = Status.MOTION_UNCERTAIN if name == 'velocity' else extrapolated  # the other direction needs two samples
    assert [e.status for e in run([sample(), *stepped])] == [0, bit, first, extrapolated]


@pytest.mark.parametrize('name', LEAPS)
def test_the_same_message_again_confirms_nothing(name):
    far, bit = LEAPS[name]
    leap = sample(START + MS, **{name: far})
    if name == 'velocity':
        again = leap  # the very stamp: a duplicate
        assert Status(last(sample(), leap, again).status) == bit | Status.STAMP_NOT_INCREASING
    else:  # held, since no newer one came
        assert last(sample(), leap, leap._replace(stamp=START + 2 * MS)).status == bit


@pytest.mark.parametrize('name', LEAPS)
def test_after_a_pause_the_same_change_is_no_leap(name):
    far, bit = LEAPS[name]
    assert not last(sample(), sample(START + 100 * MS, **{name: far})).status & bit


@given(st.lists(good, min_size=2, max_size=6))
def test_a_rate_that_nothing_reaches_flags_nothing(samples):
    slow = replace(PARAMETERS, settings=EstimatorSettings(pressure_rate_max=1e15, force_rate_max=1e15))
    bits = Status.PRESSURE_LEAP | Status.FORCE_LEAP
    assert not any(e.status & bits for e in run(samples, slow))


def test_refused_inputs_leave_no_state_and_no_friction_force():
    estimate = only(sample()._replace(refused=True))
    assert (estimate.state, estimate.friction_force, estimate.direction) == (FrictionState.UNKNOWN, 0.0, 0)
    assert estimate.coulomb_friction == only(sample()).coulomb_friction


@pytest.mark.parametrize('name', LEAPS)
def test_a_change_is_compared_with_the_largest_rate_over_its_time(name):
    """100 samples later the change may be 100 times as large, and not more."""
    start, rate = {'pressure': (0.0, 1e10), 'force': (30.0, 1e8), 'velocity': (0.01, 1e3)}[name]
    slow = replace(
        PARAMETERS, settings=EstimatorSettings(pressure_rate_max=1e8, force_rate_max=1e6, acceleration_max=10.0)
    )
    for elapsed in (2, 50):
        for share, leaps in ((0.99, False), (1.01, True)):
            far = start + share * rate * 1e-2 * elapsed * 1e-3
            after = last(sample(**{name: start}), sample(START + elapsed * MS, **{name: far}), parameters=slow)
            assert bool(after.status & LEAPS[name][1]) is leaps


# --- unknown ---

REST = {'velocity': 0.0}


@pytest.mark.parametrize(
    'change',
    [
        {'velocity': math.nan},
        {'velocity': math.inf},
        {'velocity': 10.5},
        {'pressure': None},
        {'pressure': math.nan},
        {'pressure': None, **REST},
        {'force': None, **REST},
        {'force': math.nan, **REST},
        {'force_age': 200, **REST},
        {'force_age': -200, **REST},
    ],
)
def test_state_is_unknown_and_friction_force_zero_where_the_inputs_do_not_tell(change):
    estimate = only(sample(**change))
    assert estimate[4:7] == (0.0, FrictionState.UNKNOWN, 0)


@pytest.mark.parametrize('change', [{'force': None}, {'force': math.nan}, {'force_age': 200}])
def test_a_sliding_rod_needs_no_force_sum(change):
    estimate = only(sample(**change))
    assert estimate.state == FrictionState.SLIDING
    assert estimate.friction_force == estimate.coulomb_friction > 0.0


def test_with_an_unknown_state_the_coulomb_friction_is_still_told():
    unknown, known = only(sample(velocity=math.nan)), only(sample())
    assert unknown.coulomb_friction == known.coulomb_friction
    assert unknown.breakaway_force == known.breakaway_force


def test_all_forces_are_zero_while_there_was_no_pressure():
    assert only(sample(pressure=None))[1:5] == (0.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize('bad', [math.nan, 11.0])
def test_one_unusable_velocity_does_not_make_a_resting_rod_slide(bad):
    speeds = [0.0, 1.5e-3, bad, 1.5e-3]
    estimates = run([sample(START + i * MS, v, force=10.0) for i, v in enumerate(speeds)])
    states = [FrictionState(e.state).name for e in estimates]
    assert states == ['STUCK', 'STUCK', 'UNKNOWN', 'STUCK']


def test_the_first_step_of_a_motion_from_rest_may_be_a_ripple():
    rest = [sample(START + i * MS, 0.0) for i in range(3)]
    moving = [sample(START + i * MS, 0.01) for i in range(3, 5)]
    assert [e.status for e in run([*rest, *moving])] == [0, 0, 0, Status.MOTION_UNCERTAIN, 0]


# --- age ---


@pytest.mark.parametrize(('pressure_age', 'force_age', 'expected'), [(3, 7, 0.007), (7, 3, 0.007), (-2, -5, -0.002)])
def test_input_age_is_that_of_the_older_input(pressure_age, force_age, expected):
    estimate = only(sample(pressure_age=pressure_age, force_age=force_age))
    assert estimate.input_age == pytest.approx(expected)


@pytest.mark.parametrize('change', [{'pressure': None}, {'force': None}, {'pressure': math.nan}, {'force': math.inf}])
def test_input_age_is_minus_one_while_an_input_is_missing(change):
    assert only(sample(**change)).input_age == -1.0


def test_input_age_is_that_of_the_value_in_use_not_of_the_unusable_newest():
    estimate = last(sample(START), sample(START + 40 * MS, force=math.nan))
    assert estimate.input_age == pytest.approx(0.040)


# --- parameters ---


@pytest.mark.parametrize(
    ('change', 'complaint'),
    [
        ({'stick_velocity': 3e-3}, 'slip_velocity = 0.002 m/s is below stick_velocity = 0.003 m/s'),
        ({'stick_velocity': -1e-3}, 'stick_velocity = -0.001 m/s is below its lower bound 0.0 m/s'),
        ({'pressure_timeout': 0.0}, 'pressure_timeout = 0.0 s is below its lower bound 0.001 s'),
        ({'force_timeout': 61.0}, 'force_timeout = 61.0 s is above its upper bound 1.0 s'),
        ({'pressure_max': 0.0}, 'pressure_max = 0.0 Pa is below its lower bound 10000.0 Pa'),
        ({'pressure_min': 1.0}, 'pressure_min = 1.0 Pa is above its upper bound 0.0 Pa'),
        ({'velocity_max': math.nan}, 'velocity_max = nan m/s is not finite'),
        ({'force_max': 0.5}, 'force_max = 0.5 N is below its lower bound 1.0 N'),
    ],
)
def test_invalid_settings_are_refused_with_field_value_and_bound(change, complaint):
    with pytest.raises(ValueError, match=f'^EstimatorSettings.{complaint}'):
        EstimatorSettings(**change)


def test_an_actuator_without_seals_is_refused():
    with pytest.raises(ValueError, match=r'^EstimatorParameters.seals is empty'):
        EstimatorParameters(EstimatorSettings(), ())


# --- correction of the force sum ---

LACKING = ForceSumCorrection(area_a=2e-4, area_b=-1e-4, offset=15.0)  # of what the rig measures


def with_seals(*changes) -> EstimatorParameters:
    """One seal of the thesis for each of the changes, on chambers a, b, ..."""
    one = SEALS['ms28775_114']
    return EstimatorParameters(
        EstimatorSettings(), tuple(MountedSeal(replace(one, **change), 'ab'[i % 2]) for i, change in enumerate(changes))
    )


def measured(true_force: float, a: float, b: float) -> float:
    """Force sum [N] of a rig with the areas of `LACKING` wrong."""
    return true_force - (2e-4 * a - 1e-4 * b + 15.0)


CORRECTED = with_seals({'force_sum_correction': LACKING}, {'force_sum_correction': LACKING})


@given(st.floats(-10.0, 10.0), st.floats(0.0, 6e6), st.floats(0.0, 6e6))
def test_a_rod_that_the_seals_hold_is_stuck_whatever_the_pressures_though_the_areas_are_wrong(force, a, b):
    held = sample(velocity=0.0, pressure=(a, b), force=measured(force, a, b))
    estimate = only(held, CORRECTED)
    assert estimate.state == FrictionState.STUCK
    assert estimate.friction_force == pytest.approx(force, abs=1e-9)


def test_without_the_correction_the_same_rod_seems_to_break_away():
    held = sample(velocity=0.0, pressure=(5e6, 0.0), force=measured(5.0, 5e6, 0.0))
    assert only(held).state == FrictionState.BREAKAWAY
    assert only(held, CORRECTED).state == FrictionState.STUCK


def test_a_correction_applies_once_however_many_seal_files_have_it():
    once = with_seals({'force_sum_correction': LACKING}, {})
    held = sample(velocity=0.0, pressure=(3e6, 1e6), force=measured(8.0, 3e6, 1e6))
    assert only(held, once) == only(held, CORRECTED)


def test_two_different_corrections_are_refused():
    with pytest.raises(ValueError, match=r'two seals have different force_sum_correction, .*offset=15.0.*offset=0.0'):
        with_seals({'force_sum_correction': LACKING}, {'force_sum_correction': ForceSumCorrection()})


def test_a_force_sum_that_never_came_is_not_made_of_the_correction():
    estimate = only(sample(velocity=0.0, force=None), CORRECTED)
    assert estimate.state == FrictionState.UNKNOWN
    assert estimate.status & Status.FORCE_MISSING


def test_without_a_correction_a_force_sum_keeps_every_bit():
    assert math.copysign(1.0, only(sample(velocity=0.0, force=-0.0)).friction_force) == -1.0


# --- a force sum that contains a load ---

LOADED = with_seals({'force_sum_correction': ForceSumCorrection(contains_load=True)}, {})
UNLOADED = with_seals({}, {})


@given(st.floats(-1e5, 1e5))
def test_at_rest_a_force_sum_with_a_load_in_it_tells_no_state(force):
    estimate = only(sample(velocity=0.0, force=force), LOADED)
    assert (estimate.state, estimate.friction_force) == (FrictionState.UNKNOWN, 0.0)
    assert Status(estimate.status) == Status.FORCE_CONTAINS_LOAD
    without = only(sample(velocity=0.0, force=force), UNLOADED)
    assert estimate[1:4] == without[1:4]  # friction of the seals follows from the pressures


@given(st.floats(-1e5, 1e5))
def test_sliding_friction_needs_no_force_sum(force):
    slides = sample(velocity=-0.05, force=force)
    assert only(slides, LOADED) == only(slides, UNLOADED)
    assert only(slides, LOADED).status == 0


def test_a_slow_rod_that_moves_against_its_load_is_not_taken_to_slide():
    creeping = [sample(START + i * MS, velocity, force=-30e3) for i, velocity in enumerate([0.0, 9e-4, 9e-4])]
    assert (
        run(creeping, UNLOADED)[-1].state == FrictionState.SLIDING
    )  # friction never drives, if that is the force on the rod
    last = run(creeping, LOADED)[-1]
    assert last.state == FrictionState.UNKNOWN
    assert Status(last.status) == Status.FORCE_CONTAINS_LOAD


# --- motions that were not identified ---


def statuses(velocities, *motions) -> list[Status]:
    parameters = with_seals(*({'identified_motion': motion} for motion in motions))
    return [Status(only(sample(velocity=v), parameters).status) for v in velocities]


def test_a_rod_slides_faster_or_slower_than_the_seal_was_identified():
    motion = IdentifiedMotion(slowest=0.01, fastest=0.1)
    slow, fast = Status.SLOWER_THAN_IDENTIFIED, Status.FASTER_THAN_IDENTIFIED
    speeds = [0.0, 0.005, 0.0089, 0.0091, 0.05, 0.109, 0.111, 1.0]
    for sign in (1.0, -1.0):
        assert statuses([sign * v for v in speeds], motion) == [0, slow, slow, 0, 0, 0, fast, fast]


def test_a_direction_in_which_a_seal_was_never_measured_is_marked_while_the_rod_slides():
    for direction in (1, -1):
        motion = IdentifiedMotion(directions=(direction,))
        marked = statuses([direction * 0.05, 0.0, -direction * 0.05], motion)
        assert marked == [0, 0, Status.DIRECTION_NOT_IDENTIFIED]


def test_a_motion_that_one_seal_was_not_measured_in_is_marked_for_the_actuator():
    marks = statuses([0.05], IdentifiedMotion(0.1, 0.2), IdentifiedMotion(0.01, 0.02, (-1,)))
    assert marks == [Status.SLOWER_THAN_IDENTIFIED | Status.FASTER_THAN_IDENTIFIED | Status.DIRECTION_NOT_IDENTIFIED]


def test_nothing_but_the_status_depends_on_the_identified_motion():
    told = with_seals({'identified_motion': IdentifiedMotion(0.1, 0.2, (-1,))}, {})
    assert only(sample(velocity=0.05), told)._replace(status=0) == only(sample(velocity=0.05))


@pytest.mark.parametrize('side', [1.0, -1.0])
@pytest.mark.parametrize(('share', 'uncertain'), [(0.99, True), (1.01, False)])
def test_motion_with_a_ripple_is_uncertain_up_to_slip_velocity_and_half_width_over_10_ms(share, uncertain, side):
    settings, half_width = EstimatorSettings(), 1e-5
    speed = share * (settings.slip_velocity + half_width / 0.01)
    motion = NOT_CONDITIONED._replace(samples=SETTLING, half_width=half_width, velocity=side * speed)
    assert estimator._is_uncertain(settings, motion) is uncertain


def test_parameters_are_compared_and_shown_by_what_was_given():
    again = EstimatorParameters(EstimatorSettings(), BOTH)
    assert again == PARAMETERS
    assert (
        repr(again)
        == f'EstimatorParameters(settings={PARAMETERS.settings!r}, seals={BOTH!r}, adaptation={AdaptationSettings()!r})'
    )


# --- exactly at a limit ---

AT_LIMIT = {  # setting: (name, value, bit)
    'pressure_max': ('pressure', (4.5e7, 3e6), Status.PRESSURE_OUT_OF_RANGE),
    'pressure_max b': ('pressure', (3e6, 4.5e7), Status.PRESSURE_OUT_OF_RANGE),
    'pressure_min': ('pressure', (-1.2e5, 3e6), Status.PRESSURE_OUT_OF_RANGE),
    'pressure_min b': ('pressure', (3e6, -1.2e5), Status.PRESSURE_OUT_OF_RANGE),
    'force_max': ('force', 1e6, Status.FORCE_OUT_OF_RANGE),
    'force_max -': ('force', -1e6, Status.FORCE_OUT_OF_RANGE),
    'velocity_max': ('velocity', 10.0, Status.VELOCITY_OUT_OF_RANGE),
    'velocity_max -': ('velocity', -10.0, Status.VELOCITY_OUT_OF_RANGE),
}


@pytest.mark.parametrize('case', AT_LIMIT)
def test_a_value_at_its_limit_is_usable_and_the_next_one_beyond_is_not(case):
    name, value, bit = AT_LIMIT[case]
    pair = value if isinstance(value, tuple) else (value,)
    beyond = tuple(math.nextafter(v, math.copysign(math.inf, v)) if v != 3e6 else v for v in pair)
    assert not only(sample(**{name: value})).status & bit
    assert only(sample(**{name: beyond if len(pair) > 1 else beyond[0]})).status & bit


CHANGES = {  # name: (a value [SI], the largest change over a millisecond)
    'pressure a': (2e7, 1e6),
    'pressure b': (2e7, 1e6),
    'force': (0.0, 1e5),
    'velocity': (3.0, 1.0),
}


SLOW = replace(PARAMETERS, settings=EstimatorSettings(pressure_rate_max=1e9))


def changed(name: str, value: float, stamp: int) -> RodSample:
    kind, _, chamber = name.partition(' ')
    return sample(stamp, **{kind: {'a': (value, 3e6), 'b': (3e6, value), '': value}[chamber]})


@pytest.mark.parametrize('name', CHANGES)
@pytest.mark.parametrize('side', [1.0, -1.0])
@pytest.mark.parametrize(
    ('milliseconds', 'share', 'leaps'),
    [
        (1.0, 1.0, False),  # exactly as much as the rate allows
        (1.0, 1.01, True),
        (0.1, 0.99, False),  # over less than a millisecond as much as over one
        (0.1, 1.01, True),
        (1.5, 1.49, False),
        (1.5, 1.51, True),
        (-1.5, 1.49, False),  # a clock that was set back
        (-1.5, 1.51, True),
    ],
)
def test_a_change_leaps_beyond_the_largest_rate_over_its_time_up_and_down(name, side, milliseconds, share, leaps):
    value, most = CHANGES[name]
    first, second = (
        changed(name, value, START),
        changed(name, value + side * share * most, START + int(milliseconds * MS)),
    )
    bits = Status.PRESSURE_LEAP | Status.FORCE_LEAP | Status.VELOCITY_LEAP
    assert bool(last(first, second, parameters=SLOW).status & bits) is leaps


@pytest.mark.parametrize('name', CHANGES)
@pytest.mark.parametrize('side', [1.0, -1.0])
@pytest.mark.parametrize(('share', 'confirms'), [(0.99, True), (-0.99, True), (1.01, False), (-1.01, False)])
def test_a_leap_is_confirmed_by_a_value_as_near_to_it_as_the_rate_allows(name, side, share, confirms):
    value, most = CHANGES[name]
    far = value + side * 3.5 * most  # so no third value agrees with the first one
    third = far + share * most
    samples_ = [changed(name, v, START + i * MS) for i, v in enumerate((value, far, third))]
    bits = Status.PRESSURE_LEAP | Status.FORCE_LEAP | Status.VELOCITY_LEAP
    assert [bool(e.status & bits) for e in run(samples_, SLOW)] == [False, True, not confirms]


# --- at rest, or not ---


def test_before_the_first_sample_the_rod_counts_as_moving():
    band = sample(velocity=1.5e-3)  # a rod at rest would be at rest, one that slid slides on
    assert only(band).state == FrictionState.SLIDING


@pytest.mark.parametrize('side', [1.0, -1.0])
@pytest.mark.parametrize(('speed', 'force', 'state', 'uncertain'), [
    (0.9e-4, -30.0, FrictionState.STUCK, False),  # as slow as that is at rest, whatever the force sum
    (1.1e-4, -30.0, FrictionState.SLIDING, True),  # friction never drives
    (9e-4, -30.0, FrictionState.SLIDING, True),
    (9e-4, 30.0, FrictionState.STUCK, False),  # a rod that creeps under a force that the seals hold
    (9e-4, 0.0, FrictionState.STUCK, False),
])  # fmt: skip
def test_a_rod_in_the_band_of_rest_slides_if_it_moves_against_its_force_sum(speed, force, state, uncertain, side):
    creeping = [sample(START + i * MS, side * v, force=side * force) for i, v in enumerate([0.0, speed, speed])]
    found = run(creeping)[-1]
    assert (found.state, bool(found.status & Status.MOTION_UNCERTAIN)) == (state, uncertain)


@pytest.mark.parametrize(('age', 'largest', 'said'), [
    (1.0, 1.0, False), (1.01, 1.0, True), (-1.0, 1.0, False), (-1.01, 1.0, True), (1e6, 0.0, False), (0.6, 0.5, True),
])  # fmt: skip
def test_a_stamp_is_too_old_beyond_its_largest_age_either_way_or_never_with_0(age, largest, said):
    settings_ = replace(PARAMETERS, settings=EstimatorSettings(stamp_age_max=largest))
    assert bool(only(sample()._replace(stamp_age=age), settings_).status & Status.STAMP_AGE) is said


# --- what adaptation takes of a sample ---


def adapted_step(one: RodSample, mode='observe', before=None):
    """State and estimate after a sample of an adapting estimator."""
    known = replace(PARAMETERS, adaptation=AdaptationSettings(mode))
    return step(known, before or init(known), one)


def slid(count=20, pressure=3e6):
    """State after even sliding at 100 Hz."""
    state = None
    for i in range(count):
        state, _ = adapted_step(sample(START + 10 * i * MS, pressure=pressure), before=state)
    return state


def test_before_anything_is_learnt_the_deviation_of_the_scale_is_that_of_the_seal_file():
    off = replace(PARAMETERS, adaptation=AdaptationSettings('off'))
    estimate, by_file = adapted_step(sample())[1], step(off, estimator.init(off), sample())[1]
    assert estimate.adaptation_scale_std == by_file.coulomb_friction_std / by_file.coulomb_friction
    assert adapted_step(sample(pressure=None))[1].adaptation_scale_std == 0.0  # no friction to compare with


def test_a_sample_is_learnt_from_every_10_ms_and_no_more_often():
    before = slid()
    for milliseconds, learns in ((1, False), (9, False), (10, True)):
        after, _ = adapted_step(sample(before.adaptation.stamp + milliseconds * MS), before=before)
        assert (after.adaptation != before.adaptation) is learns


def test_a_law_that_disagrees_is_learnt_from_on():
    before = slid()
    learnt = before.adaptation.filter
    learnt = learnt._replace(terms=learnt.terms._replace(scale=2.5), friction_std=1.0)
    before.adaptation = learnt_state(before.adaptation, filter=learnt)
    after, estimate = adapted_step(sample(before.stamp + 10 * MS), before=before)
    assert estimate.status == Status.MODEL_DISAGREES
    assert after.adaptation.filter.stamp == after.stamp
    assert after.adaptation.strokes.present.samples == before.adaptation.strokes.present.samples + 1


def test_outside_the_identified_range_strokes_are_followed_and_with_a_bad_input_nothing_is_learnt():
    outside = slid(count=40, pressure=8e6).adaptation
    assert outside.strokes.present.samples > 10
    assert outside.filter == NOT_BEGUN
    before = slid()
    assert before.adaptation.filter != NOT_BEGUN
    stale, _ = adapted_step(sample(before.stamp + 10 * MS, force_age=101), before=before)
    assert stale.adaptation.filter == before.adaptation.filter
    assert stale.adaptation.strokes.present == before.adaptation.strokes.present


# --- swings ---


@pytest.mark.parametrize('mode', ['off', 'observe'])
@pytest.mark.parametrize('side', [1.0, -1.0])
def test_the_way_of_a_stroke_is_counted_up_to_the_longest_swing(mode, side):
    known, state, ways = replace(PARAMETERS, adaptation=AdaptationSettings(mode)), init(), []
    for i in range(400):
        state, _ = step(known, state, sample(START + i * MS, side * 0.01, force=side * 30.0))
        ways.append(side * state.swing.way)
    assert ways[1] - ways[0] == pytest.approx(1e-5)
    assert ways[100] - ways[0] == pytest.approx(1e-3)
    assert max(ways) == ways[-1] == pytest.approx(LONGEST_SWING, rel=0.01)
    state, _ = step(known, state, sample(START + 400 * MS, -side * 0.01, force=side * 30.0))
    assert side * state.swing.way == pytest.approx(-1e-5)


def test_without_a_usable_force_sum_no_swing_is_judged():
    state, _ = step(PARAMETERS, init(), sample())
    assert step(PARAMETERS, state, sample(START + MS, force_age=200))[0].swing == state.swing
    assert step(PARAMETERS, state, sample(START + MS))[0].swing != state.swing


def test_the_actuator_depends_on_what_any_of_its_seals_depends_on():
    plain = with_seals({}, {})
    assert (plain.depends_on_velocity, plain.limits_motion, plain.corrects_force_sum) == (False, False, False)
    assert with_seals({'velocity_terms': VelocityTerms(100.0)}, {}).depends_on_velocity
    motion = with_seals({}, {'identified_motion': IdentifiedMotion(0.1, 0.2)})
    assert motion.limits_motion
    assert Status(only(sample(velocity=0.05), motion).status) == Status.SLOWER_THAN_IDENTIFIED
