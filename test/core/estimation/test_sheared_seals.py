"""The estimate on seals that shear before they slide."""

import dataclasses
import json
import math

import numpy as np
import pytest
from harness.learnt import learnt_state
from hypothesis import assume, example, given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from paths import ROOT

from seal_friction_ros.core.estimation.adaptation import AdaptationSettings
from seal_friction_ros.core.estimation.configuration import SealSelection, first_snapshot, parse_snapshot, snapshot_text
from seal_friction_ros.core.estimation.estimator import EstimatorParameters, EstimatorSettings, init, step
from seal_friction_ros.core.estimation.records import RodSample
from seal_friction_ros.core.estimation.sheared_seals import (
    AT_REST,
    LEAST_STD,
    NOT_FOLLOWED,
    FollowedElasticity,
    FollowedShear,
    Moment,
    ShearedFriction,
    _are_alike,
    _bearing,
    _held,
    _longest_gap,
    _moved,
    _rest,
    _sheared_against,
    _stiffness,
    _with_elements,
    followed_elasticity,
    shear_on,
    slide_on,
)
from seal_friction_ros.core.friction.actuator import MountedSeal, actuator_friction
from seal_friction_ros.core.friction.laws.constant_coulomb import ConstantCoulomb
from seal_friction_ros.core.friction.laws.velocity_terms import VelocityTerms
from seal_friction_ros.core.friction.presliding import (
    NO_ELEMENTS,
    NOT_SHEARED,
    Elements,
    Presliding,
    Shear,
    Slide,
    element_forces,
    presliding_numbers,
    shear,
)
from seal_friction_ros.core.friction.seal_file import parse_seal
from seal_friction_ros.core.friction.states import FrictionState
from seal_friction_ros.core.messages.records import NEVER, Force, FrictionEstimate, Pressure, Status
from seal_friction_ros.files import load_configuration, read_yaml
from test.harness.masing import initial_loading

START, MS = 10**12, 10**6  # [ns]
PRESSURE = 2e6  # [Pa]
SEAL = parse_seal(read_yaml(ROOT / 'config' / 'seals' / 'ms28775_114.yaml'))
SOFT = Presliding(stiffness=5e4, relative_std=0.0)  # each of two


def follow(elasticity, state, moment):
    """State and friction of one sample, as the estimator takes them."""
    if moment.direction != 0:
        rubbing = moment.coulomb_friction, moment.velocity_friction
        slides_on, further = slide_on(
            elasticity, state, moment.stamp, moment.velocity, moment.direction, NEVER, *rubbing
        )
        if slides_on:
            return further, ShearedFriction(True, further.fully_sheared, 0.0, True)
    return shear_on(elasticity, state, moment)


def parameters(
    presliding: Presliding | None = SOFT, use_presliding: bool = True, mode: str = 'observe', **limits
) -> EstimatorParameters:
    seal = dataclasses.replace(SEAL, presliding=presliding, **limits)
    return EstimatorParameters(
        EstimatorSettings(use_presliding=use_presliding),
        tuple(MountedSeal(seal, chamber) for chamber in 'ab'),
        AdaptationSettings(mode),
    )


def estimates(p: EstimatorParameters, velocities, force_sums, step_ns: int = MS) -> list[FrictionEstimate]:
    """Estimates at 1 kHz."""
    state, found = init(p), []
    for i, (velocity, force) in enumerate(zip(velocities, force_sums, strict=True)):
        stamp = START + i * step_ns
        sample = RodSample(stamp, float(velocity), Pressure(stamp, PRESSURE, PRESSURE), Force(stamp, float(force)))
        state, estimate = step(p, state, sample)
        found.append(estimate)
    return found


def there_and_back(speed: float, seconds: float = 0.4) -> np.ndarray:
    """A stroke out, then one back, without a rest."""
    stroke = np.full(round(seconds * 1000), speed)
    return np.concatenate([stroke, -stroke])


def test_after_a_reversal_the_force_is_the_branch_of_masing():
    velocities = there_and_back(0.01)
    found = estimates(parameters(stiction=0.0, stiction_ratio=0.0), velocities, 0.0 * velocities)
    turn = len(velocities) // 2
    sliding = found[turn - 1].friction_force
    numbers = presliding_numbers([SOFT, SOFT])
    for i in range(1, 350):
        branch = sliding - 2.0 * initial_loading(numbers, 0.5 * i * 0.01 * 1e-3, sliding)  # mean velocity 0 at the turn
        assert found[turn + i].friction_force == pytest.approx(branch, abs=1e-9)


def test_the_status_tells_where_the_seals_may_still_shear_and_the_state_is_that_of_the_rod():
    velocities = there_and_back(0.01)
    found = estimates(parameters(), velocities, 0.0 * velocities)
    turn = len(velocities) // 2
    before, after = found[turn - 1], found[turn + 60]
    assert not before.status & Status.PRESLIDING
    assert before.friction_force == pytest.approx(before.coulomb_friction)
    assert after.status & Status.PRESLIDING
    assert after.friction_force > -0.9 * after.coulomb_friction
    assert (after.state, after.direction) == (FrictionState.SLIDING, -1)
    assert after.coulomb_friction_std > before.coulomb_friction_std
    assert not found[-1].status & Status.PRESLIDING


def test_while_all_seals_slide_the_friction_follows_the_speed_over_the_memory_length():
    remembers = dataclasses.replace(SOFT, memory_length=0.002)
    slippery = parameters(remembers, velocity_terms=VelocityTerms(viscous_friction=500.0))
    found = estimates(slippery, np.repeat([0.02, 0.05], 1000), np.zeros(2000))
    slow, fast = 2.0 * 500.0 * 0.02, 2.0 * 500.0 * 0.05  # [N] of two seals
    for i in (1, 20, 40, 1000):
        way = 0.05 * i * 1e-3 - 0.5 * (0.05 - 0.02) * 1e-3  # [m] the velocity changes over the first sample
        added = fast + (slow - fast) * math.exp(-way / 0.002)
        assert found[999 + i].friction_force == pytest.approx(found[999 + i].coulomb_friction + added, rel=1e-4)
        assert not found[999 + i].status & Status.PRESLIDING


def test_stiff_seals_are_rigid_ones_after_a_micrometre():
    velocities = there_and_back(0.05)
    rigid = estimates(parameters(None), velocities, 0.0 * velocities)
    stiff = estimates(parameters(Presliding(stiffness=1e9)), velocities, 0.0 * velocities)
    off = estimates(parameters(SOFT, use_presliding=False), velocities, 0.0 * velocities)
    assert off == rigid
    turn = len(velocities) // 2
    for i in (*range(5, turn), *range(turn + 5, len(rigid))):
        bands = {name: getattr(stiff[i], name) for name in ('coulomb_friction_std', 'friction_force_std')}
        assert stiff[i] == rigid[i]._replace(**bands)
        assert stiff[i].friction_force_std <= rigid[i].friction_force_std  # of which nobody knows when they slide


def test_at_rest_the_friction_is_the_force_sum_and_the_motion_begins_from_it():
    velocities = np.concatenate([np.full(400, 0.01), np.zeros(300), np.full(400, 0.01)])
    force = np.concatenate([np.full(400, 30.0), np.full(300, -5.0), np.full(400, 30.0)])
    found = estimates(parameters(mode='off'), velocities, force)
    assert found[699].friction_force == -5.0
    assert found[699].status == 0
    assert found[705].friction_force == pytest.approx(-5.0 + 5.5e-5 * 1e5)  # sheared by 5.5 samples at 10 um a sample
    assert found[705].status & Status.PRESLIDING
    assert found[-1].friction_force == pytest.approx(found[-1].coulomb_friction)
    assert not found[-1].status & Status.PRESLIDING


def test_one_velocity_that_is_not_usable_costs_no_more_than_its_sample():
    velocities = there_and_back(0.01)
    spoiled = velocities.copy()
    spoiled[430] = math.nan
    good, one_lost = (estimates(parameters(), series, 0.0 * velocities) for series in (velocities, spoiled))
    assert one_lost[430].status & Status.VELOCITY_NOT_FINITE
    for i in range(431, len(good)):
        assert one_lost[i].friction_force == pytest.approx(good[i].friction_force, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize('gap', [101 * MS, -5 * MS, 10**9])
def test_after_a_gap_the_shear_is_not_known_and_the_force_a_guess(gap):
    elasticity = followed_elasticity(presliding_numbers([SOFT, SOFT]), 0.1)
    state = NOT_FOLLOWED
    moment = Moment(START, 0.01, 1, 0.0, True, False, 40.0, 0.0, 0.0)
    for i in range(500):
        state, sheared = follow(elasticity, state, moment._replace(stamp=START + i * MS))
    assert state.is_known
    assert sheared.slides
    state, sheared = follow(elasticity, state, moment._replace(stamp=state.stamp + gap))
    assert not state.is_known
    assert not sheared.slides
    assert sheared.force == 40.0
    assert sheared.std == 40.0  # of seals that are sheared the other way: half the difference


def test_at_100_hertz_one_sample_at_rest_is_enough_to_bear_the_force_sum():
    elasticity = followed_elasticity(presliding_numbers([SOFT, SOFT]), 0.1)
    state, moving = NOT_FOLLOWED, Moment(START, 0.01, 1, 0.0, True, False, 40.0, 0.0, 2.0)
    for i in range(50):
        state, _ = follow(elasticity, state, moving._replace(stamp=START + 10 * i * MS))
    at_rest = Moment(0, 0.0, 0, 0.0, True, False, 40.0, 0.0, 2.0)
    for _ in range(12):
        state, _ = follow(elasticity, state, at_rest._replace(stamp=state.stamp + 10 * MS))
    for force_sum in (-10.0, 38.0, -42.0, 42.0, 0.0):
        state, _ = follow(elasticity, state, at_rest._replace(stamp=state.stamp + 10 * MS, force_sum=force_sum))
        assert sum(state.seals.forces) == pytest.approx(force_sum, abs=1e-6)


@given(
    velocities=st.lists(
        st.tuples(st.floats(1e-3, 0.05) | st.floats(-0.05, -1e-3), st.integers(1, 60)), min_size=1, max_size=12
    ),
    memory_length=st.sampled_from([0.0, 1e-4]),
    dwell_time=st.sampled_from([0.0, 0.01]),
)
def test_the_force_is_that_of_the_law_of_elastic_seals_but_for_rounding(velocities, memory_length, dwell_time):
    numbers = presliding_numbers([Presliding(stiffness=1e5, memory_length=memory_length, dwell_time=dwell_time)])
    elasticity = followed_elasticity(numbers, 0.1)
    state, stamp, last = NOT_FOLLOWED, START, velocities[0][0]
    sheared, first = NOT_SHEARED, True
    for velocity, samples in velocities:
        for i in range(samples):
            assume(abs(last + velocity) > 1e-6)  # a way of 0 is no motion
            direction = 1 if last + velocity >= 0.0 else -1  # of the way: one against the direction is kept as noise
            coulomb = 40.0 + 0.3 * ((7 * i) % 5)  # pressures have ripple
            moment = Moment(stamp, velocity, direction, 0.0, True, False, coulomb, 100.0 * abs(velocity), 3.0)
            if first:
                share = direction * (coulomb + 100.0 * abs(velocity))
                forces = Elements(*(w * share for w in numbers.shares))
                sheared, last, first = Shear(forces, 100.0 * abs(velocity)), -velocity, False
            slide = Slide(0.5 * (last + velocity) * 1e-3, 1e-3, coulomb, 100.0 * abs(velocity), 3.0)
            if stamp == START:
                slide = slide._replace(displacement=0.0, elapsed=0.0)
            sheared, force = shear(numbers, sheared, slide)
            state, found = follow(elasticity, state, moment)
            assert found.force == pytest.approx(force, rel=1e-9, abs=1e-9)
            last, stamp = velocity, stamp + MS


def test_after_a_rest_the_shear_is_known_by_a_force_sum_without_inertia_alone():
    elasticity = followed_elasticity(presliding_numbers([SOFT, SOFT]), 0.1)
    state = NOT_FOLLOWED
    moment = Moment(START, 0.01, 1, 0.0, True, False, 40.0, 0.0, 0.0)
    for i in range(500):
        state, _ = follow(elasticity, state, moment._replace(stamp=START + i * MS))
    for knows_force_sum, knows_inertia in ((True, True), (True, False), (False, True)):
        after = state
        for i in range(1, 102):
            assert after.is_known
            at_rest = Moment(state.stamp + i * MS, 0.0, 0, 0.0, knows_force_sum, knows_inertia, 40.0, 0.0, 0.0)
            after, _ = follow(elasticity, after, at_rest)
        assert after.is_known == (knows_force_sum and knows_inertia)


STIFFNESS, COULOMB = 1e5, 40.0  # [N/m], [N]


@hypothesis_settings(max_examples=300)
@example([0.0] * 6, 0.15, 0.0, [(-1, 286), (0, 106), (1, 2)], 0.0039, 0.0, 0.0, 100.0, False)  # a heavy rod starts
@example([0.0] * 6, 0.3, -1.5, [(1, 177), (-1, 113)], 0.0496, 3.0, 15.0, 0.0, False)  # stiction that is not broken yet
@example(  # a rest while the seals shear
    [0.0] * 6, 0.15, -2.0, [(-1, 212), (0, 112), (-1, 23), (0, 148), (-1, 25)], 0.0137, 1.0, 15.0, 0.0, True
)
@given(
    start=st.lists(st.floats(-1.0, 1.0), min_size=6, max_size=6),
    stiffness_std=st.sampled_from([LEAST_STD, 0.3]),
    softness=st.floats(-2.0, 2.0),
    pieces=st.lists(st.tuples(st.sampled_from([-1, 0, 1]), st.integers(1, 300)), min_size=1, max_size=8),
    speed=st.floats(2e-3, 0.05),
    exponent=st.sampled_from([0.0, 1.0, 3.0]),
    stiction=st.sampled_from([0.0, 15.0]),
    mass=st.sampled_from([0.0, 100.0]),
    knows_inertia=st.booleans(),
)
def test_without_the_bit_seals_of_any_shear_slide_within_two_deviations_of_the_stiffness(
    start, stiffness_std, softness, pieces, speed, exponent, stiction, mass, knows_inertia
):
    numbers = presliding_numbers([Presliding(stiffness=STIFFNESS, yield_exponent=exponent)])
    elasticity = followed_elasticity(numbers, stiffness_std)
    factor = 1.0 + softness * stiffness_std
    real = numbers._replace(
        stiffness=factor * STIFFNESS, stiffnesses=Elements(*(factor * k for k in numbers.stiffnesses))
    )
    sheared = Shear(Elements(*(s * w * COULOMB for s, w in zip(start, numbers.shares, strict=True))), 0.0)
    state, stamp, last = NOT_FOLLOWED, START, 0.0
    for direction, samples in pieces:
        for _ in range(samples):
            velocity = last + 0.2 * (direction * speed - last)
            way = 0.5 * (last + velocity) * 1e-3 if state != NOT_FOLLOWED else 0.0
            sheared, force = shear(real, sheared, Slide(way, 1e-3, COULOMB, 0.0, stiction))
            force_sum = force + (0.0 if knows_inertia else mass * (velocity - last) / 1e-3)
            moves = (velocity > 1e-3) - (velocity < -1e-3)
            state, found = follow(
                elasticity,
                state,
                Moment(stamp, velocity, moves, force_sum, True, knows_inertia, COULOMB, 0.0, stiction),
            )
            if found.slides and moves:  # at rest the estimate has the bit anyway
                assert abs(found.force - force) <= 0.06 * COULOMB + 1.96 * found.std
            last, stamp = velocity, stamp + MS


@pytest.mark.parametrize('factor', [0.7, 1.0, 1.3])
def test_a_rod_that_was_held_near_breakaway_does_not_count_as_sliding_before_it_breaks_away(factor):
    numbers = presliding_numbers([Presliding(stiffness=STIFFNESS)])
    elasticity = followed_elasticity(numbers, LEAST_STD)
    real = numbers._replace(
        stiffness=factor * STIFFNESS, stiffnesses=Elements(*(factor * k for k in numbers.stiffnesses))
    )
    state, sheared, last = NOT_FOLLOWED, NOT_SHEARED, 0.01
    for i in range(1200):
        velocity = 0.01 if i < 600 or i >= 900 else 0.0
        if 600 <= i < 900:  # held by 50 N: more than it slides with, 40 N, less than breakaway
            sheared, force = Shear(Elements(*(50.0 * w for w in numbers.shares)), 15.0), 50.0
        else:
            way = 0.5 * (last + velocity) * 1e-3 if i else 0.0
            sheared, force = shear(real, sheared, Slide(way, 1e-3, COULOMB, 0.0, 15.0))
        moment = Moment(START + i * MS, velocity, int(velocity > 0.0), force, True, False, COULOMB, 0.0, 15.0)
        state, found = follow(elasticity, state, moment)
        if found.slides and i >= 900:
            assert found.force == pytest.approx(force, abs=0.06 * COULOMB + 1.96 * found.std)
        last = velocity
    assert found.slides


@pytest.mark.parametrize(
    ('mode', 'mass', 'bears'), [('observe', 1.0, True), ('observe', 0.0, False), ('off', 1.0, False)]
)
def test_with_the_moving_mass_the_force_sum_counts_as_soon_as_the_rod_stops(mode, mass, bears):
    """Only adaptation knows the acceleration; else it may be inertia, and the way counts for 0.1 s."""
    known = parameters(mode=mode)
    known = dataclasses.replace(known, adaptation=dataclasses.replace(known.adaptation, moving_mass=mass))
    force = np.concatenate([np.full(400, 30.0), np.full(50, -5.0)])
    *_, sliding, _ = estimates(known, np.full(401, 0.01), force[:401])
    stopped = estimates(known, np.concatenate([np.full(400, 0.01), np.zeros(50)]), force)[-1]
    assert stopped.status == Status.PRESLIDING
    expected = -5.0 - stopped.adaptation_offset if bears else sliding.friction_force
    assert stopped.friction_force == pytest.approx(expected, abs=1.0)


def test_a_heavy_rod_that_reverses_does_not_shear_its_seals_by_its_inertia():
    elasticity = followed_elasticity(presliding_numbers([SOFT, SOFT]), LEAST_STD)
    velocities = [*[0.02] * 700, *(0.02 - 1e-3 * i for i in range(41)), *[-0.02] * 300]
    state, sheared, last = NOT_FOLLOWED, NOT_SHEARED, velocities[0]
    for i, velocity in enumerate(velocities):
        way = 0.5 * (last + velocity) * 1e-3 if i else 0.0
        sheared, force = shear(elasticity.seals, sheared, Slide(way, 1e-3, 40.0, 0.0, 0.0))
        moves = (velocity > 1e-3) - (velocity < -1e-3)
        force_sum = force + 90.0 * (velocity - last) / 1e-3
        state, found = follow(
            elasticity, state, Moment(START + i * MS, velocity, moves, force_sum, True, False, 40.0, 0.0, 0.0)
        )
        last = velocity
        if i > 600:
            assert found.is_followed  # a reversal is no rest
            assert found.force == pytest.approx(force, abs=1e-6)


def test_a_noisy_velocity_of_a_rod_that_slides_on_neither_shears_the_seals_nor_brings_stiction_back():
    elasticity = followed_elasticity(presliding_numbers([SOFT, SOFT]), LEAST_STD)
    state, moment = NOT_FOLLOWED, Moment(START, 0.003, 1, 0.0, True, False, 40.0, 0.0, 6.0)
    noise = np.random.default_rng(1).normal(scale=0.005, size=2000).tolist()
    for i in range(3000):
        velocity = 0.003 + (noise[i - 1000] if i >= 1000 else 0.0)
        state, found = follow(elasticity, state, moment._replace(stamp=START + i * MS, velocity=velocity))
        if i >= 1000:
            assert found == ShearedFriction(True, 40.0, 0.0, True)


@pytest.mark.parametrize(('lost', 'is_known'), [(9, True), (12, False)])
def test_over_more_than_10_ms_the_way_is_not_known_at_1_khz(lost, is_known):
    elasticity = followed_elasticity(presliding_numbers([SOFT, SOFT]), LEAST_STD)
    state, moment = NOT_FOLLOWED, Moment(START, 0.01, 1, 0.0, True, False, 40.0, 0.0, 0.0)
    for i in range(600):
        state, _ = follow(elasticity, state, moment._replace(stamp=START + i * MS))
    state, _ = follow(elasticity, state, moment._replace(stamp=state.stamp + lost * MS))
    assert state.is_known == is_known


def test_at_20_hertz_the_seals_are_followed():
    elasticity = followed_elasticity(presliding_numbers([SOFT, SOFT]), LEAST_STD)
    state, moment = NOT_FOLLOWED, Moment(START, 0.01, 1, 0.0, True, False, 40.0, 0.0, 0.0)
    for i in range(30):
        state, found = follow(elasticity, state, moment._replace(stamp=START + 50 * i * MS))
    assert found.slides


def test_seals_in_two_chambers_count_as_softer_since_one_may_slide_later():
    one, two = (
        EstimatorParameters(
            EstimatorSettings(), tuple(MountedSeal(dataclasses.replace(SEAL, presliding=SOFT), c) for c in chambers)
        )
        for chambers in ('aa', 'ab')
    )
    assert one.followed_elasticity.softer.stiffness == pytest.approx(0.7 * 2.0 * SOFT.stiffness)
    assert two.followed_elasticity.softer.stiffness < 0.8 * one.followed_elasticity.softer.stiffness


def test_nothing_is_learnt_while_the_seals_shear():
    numbers = presliding_numbers([SOFT, SOFT])
    velocities = np.concatenate([there_and_back(0.004, 0.05)] * 40)  # 0.2 mm to and fro: never slides
    forces, sums = NO_ELEMENTS, []
    for velocity in velocities:
        forces, force = element_forces(numbers, forces, velocity * 1e-3, 43.0)
        sums.append(force)
    elastic = estimates(parameters(), velocities, sums)
    rigid = estimates(parameters(None), velocities, sums)
    assert elastic[-1].adaptation_scale == 1.0
    assert elastic[-1].adaptation_offset == 0.0
    # Seals that count as rigid would shear, too: the force sum does not show their friction.
    assert rigid[-1].adaptation_offset == 0.0
    assert not [e for e in rigid[1000:] if e.status == 0 and e.state == FrictionState.SLIDING]


def test_a_configuration_of_an_older_bag_has_rigid_seals():
    text = snapshot_text(first_snapshot(load_configuration(SealSelection(), EstimatorSettings())))
    document = json.loads(text) | {'version': 2}
    del document['settings']['use_presliding']
    assert not parse_snapshot(json.dumps(document)).configuration.settings.use_presliding
    assert parse_snapshot(text).configuration.settings.use_presliding


def test_the_softer_seals_are_two_deviations_softer_but_never_limp():
    numbers = presliding_numbers([SOFT])
    assert followed_elasticity(numbers, 0.3).softer.stiffness == pytest.approx(0.4 * SOFT.stiffness)
    assert followed_elasticity(numbers, 0.0).softer.stiffness == pytest.approx(0.7 * SOFT.stiffness)
    assert followed_elasticity(numbers, 9.0).softer.stiffness == pytest.approx(0.1 * SOFT.stiffness)
    assert followed_elasticity(numbers, 0.0, 1.4).softer.stiffness == pytest.approx(0.5 * SOFT.stiffness)
    assert isinstance(followed_elasticity(numbers, 0.3), FollowedElasticity)
    assert isinstance(NOT_FOLLOWED, FollowedShear)


# --- one step, by hand ---

ALIKE = presliding_numbers([Presliding(stiffness=6e4, yield_exponent=0.0)])  # six elements of 10 N/mm, a sixth each
HALF = followed_elasticity(ALIKE, 0.25)  # softer seals of half the stiffness
LASTING = {'memory_length': 1e9, 'dwell_time': 1e9}
SLOW_MEMORY = HALF._replace(seals=ALIKE._replace(**LASTING), softer=HALF.softer._replace(**LASTING))


def even(force, excess=0.0) -> Shear:
    """Elements that bear a sixth of a force [N] each."""
    return Shear(Elements(*[force / 6.0] * 6), excess)


def moment_of(force_sum=0.0, coulomb=60.0, stiction=0.0, **changes) -> Moment:
    return Moment(START, 0.0, 0, force_sum, True, True, coulomb, 0.0, stiction)._replace(**changes)


def test_the_element_that_yields_last_takes_up_a_newton_over_the_longest_way():
    assert HALF.softer.stiffnesses == pytest.approx(Elements(*[5e3] * 6))
    assert HALF.yield_compliance == pytest.approx(1.0 / 6.0 / 5e3)
    one = presliding_numbers([Presliding(stiffness=6e4, elements=1, yield_exponent=0.0)])
    assert followed_elasticity(one, 0.25).yield_compliance == pytest.approx(1.0 / 3e4)
    unlike = presliding_numbers([Presliding(stiffness=6e4, elements=2, yield_exponent=1.0)])  # a quarter and the rest
    assert followed_elasticity(unlike, 0.25).yield_compliance == pytest.approx(0.75 / 1.5e4)


def test_before_the_first_sample_nothing_is_known_of_the_shear():
    assert NOT_FOLLOWED == (NEVER, 0.0, 0.0, NOT_SHEARED, NOT_SHEARED, False, 0, NEVER, 0.0, 0.0, False)
    assert AT_REST == (False, 0.0, 0.0, False)


@pytest.mark.parametrize(
    ('period', 'longest'),
    [(0.0, 0.01), (1e-3, 0.01), (3e-3, 0.01), (4e-3, 0.012), (0.02, 0.06), (0.033, 0.099), (0.034, 0.1), (5.0, 0.1)],
)
def test_the_longest_gap_is_10_ms_or_three_periods_but_not_above_100_ms(period, longest):
    assert _longest_gap(period) == pytest.approx(longest)


@pytest.mark.parametrize(
    ('milliseconds', 'direction', 'since', 'found'),
    [
        (0, 1, 0, (NEVER, 1)),
        (0, -1, NEVER, (NEVER, -1)),
        (7, 0, NEVER, (7 * MS, 9)),
        (0, 0, 0, (0, 9)),
        (100 - 1e-6, 0, 0, (0, 9)),
        (100, 0, 0, (0, 0)),
        (-1, 0, 0, (0, 0)),
    ],
)
def test_a_rest_keeps_the_direction_of_the_motion_before_for_100_ms(milliseconds, direction, since, found):
    assert _rest(round(milliseconds * MS), direction, since, 9) == found


@pytest.mark.parametrize('side', [1.0, -1.0])
def test_the_stiffness_is_that_of_the_elements_that_do_not_yield_in_the_direction(side):
    forces = Elements(10.0, -10.0, 9.9, 0.0, -3.0, 10.0)
    turned = Elements(*(side * force for force in forces))
    assert _stiffness(ALIKE, turned, side, 60.0) == pytest.approx(4e4)
    assert _stiffness(ALIKE, turned, -side, 60.0) == pytest.approx(5e4)
    assert _stiffness(ALIKE, even(side * 60.0).forces, side, 60.0) == 0.0
    assert _stiffness(ALIKE, even(side * 0.3).forces, side * 0.1, 0.6) == pytest.approx(6e4)


HELD = {  # forces of the elements before, force sum, forces after
    'unsheared': (NO_ELEMENTS, 30.0, even(30.0).forces),
    'unevenly sheared': (
        Elements(4.0, -2.0, 0.0, 1.0, 3.0, 0.0), 12.0, Elements(5.0, -1.0, 1.0, 2.0, 4.0, 1.0),
    ),
    'one that yields': (
        Elements(12.0, 0.0, 0.0, 0.0, 0.0, 0.0), 32.0, Elements(12.0, 4.0, 4.0, 4.0, 4.0, 4.0),
    ),
    'more than breakaway': (NO_ELEMENTS, 500.0, even(72.0).forces),
    'within 1 % of breakaway': (even(30.0).forces, 30.7, even(30.0).forces),
    'beyond 1 % of breakaway': (even(30.0).forces, 30.9, even(30.9).forces),
}  # fmt: skip


@pytest.mark.parametrize('side', [1.0, -1.0])
@pytest.mark.parametrize('scale', [1.0, 1e-2])
@pytest.mark.parametrize('case', HELD)
def test_a_rod_at_rest_shears_its_seals_until_they_bear_the_force_sum(case, scale, side):
    """At a Coulomb friction of 60 N and 12 N of stiction, or a hundredth of that."""
    before, force_sum, after = HELD[case]
    factor = side * scale
    held = moment_of(factor * force_sum, 60.0 * scale, 12.0 * scale)
    found = _held(ALIKE, Shear(Elements(*(factor * f for f in before)), 0.0), held, 1e-3)
    assert found.forces == pytest.approx(Elements(*(factor * f for f in after)), rel=1e-9, abs=1e-12)
    assert found.excess == 12.0 * scale


def test_without_a_force_sum_seals_at_rest_stay_as_they_are():
    assert _held(ALIKE, even(30.0), moment_of(-30.0, knows_force_sum=False), 1e-3) == even(30.0)


def test_stiction_comes_back_with_the_dwell_time_and_in_no_time_not_at_all():
    slow = ALIKE._replace(dwell_time=0.1)
    held = moment_of(30.0, 60.0, 12.0)
    assert _held(slow, even(30.0), held, 0.1).excess == pytest.approx(12.0 * (1.0 - math.exp(-1.0)))
    assert _held(slow, even(30.0, 2.0), held, 0.0).excess == 2.0
    assert _held(ALIKE, even(30.0, 2.0), held, 0.0).excess == 2.0
    # Until it is there the elements bear no more than they slide with.
    assert sum(_held(ALIKE, even(30.0, 2.0), moment_of(70.0, 60.0, 12.0), 0.0).forces) == pytest.approx(62.0)


def test_where_seals_and_softer_seals_bear_unlike_forces_half_of_the_difference_is_the_deviation():
    assert _bearing(even(30.0), even(-6.0)) == ShearedFriction(True, pytest.approx(30.0), pytest.approx(18.0), False)
    assert _bearing(even(-6.0), even(30.0)) == ShearedFriction(True, pytest.approx(-6.0), pytest.approx(18.0), False)


@pytest.mark.parametrize('place', range(6))
def test_seals_are_alike_if_every_element_bears_the_same(place):
    other = Elements(*(5.0 + (0.25 if i == place else 0.0) for i in range(6)))
    for one, two in ((even(30.0), Shear(other, 0.0)), (Shear(other, 0.0), even(30.0))):
        assert _are_alike(one, two, 0.25)
        assert not _are_alike(one, two, 0.24)
    assert _are_alike(even(30.0), even(30.0), 0.0)


@pytest.mark.parametrize('direction', [1, -1])
@pytest.mark.parametrize('coulomb', [60.0, 0.3])
def test_seals_of_an_unknown_shear_begin_against_the_motion_with_all_of_their_stiction(direction, coulomb):
    numbers = presliding_numbers([Presliding(stiffness=6e4, yield_exponent=1.0)])
    found = _sheared_against(numbers, moment_of(coulomb=coulomb, stiction=0.2 * coulomb), direction)
    expected = [-direction * 1.2 * coulomb * (2 * i + 1) / 36.0 for i in range(6)]
    assert found.forces == pytest.approx(Elements(*expected))
    assert found.excess == 0.2 * coulomb


def test_elements_that_all_bear_the_friction_are_kept_as_one_number():
    assert _with_elements(HALF, even(30.0, 2.0), even(20.0, 3.0), 0.0) == (even(30.0, 2.0), even(20.0, 3.0))
    for full in (0.5, -60.0):
        seals, softer = _with_elements(HALF, Shear(NO_ELEMENTS, 2.0), Shear(NO_ELEMENTS, 2.0), full)
        assert seals == softer == Shear(pytest.approx(even(full).forces), 2.0)


def moved(way, direction=1, seals=NOT_SHEARED, softer=NOT_SHEARED, elasticity=HALF, **slide):
    """Friction after a way [m] at a Coulomb friction of 60 N."""
    given_ = Slide(way, 1e-3, 60.0, 0.0, 0.0)._replace(**slide)
    return _moved(elasticity, seals, softer, given_, direction)[2]


@pytest.mark.parametrize('side', [1, -1])
def test_the_rod_slides_once_softer_seals_bear_95_percent_too_and_half_of_the_difference_is_the_deviation(side):
    """Softer seals shear by 30 N/mm, so they bear 57 N after 1.9 mm."""
    for way, slides in ((0.5e-3, False), (1.89e-3, False), (1.91e-3, True), (5e-3, True)):
        force, softer = min(6e4 * way, 60.0), min(3e4 * way, 60.0)
        found = moved(side * way, side)
        assert found == ShearedFriction(
            True, pytest.approx(side * force), pytest.approx(0.5 * (force - softer)), slides
        )
        assert not moved(side * way, -side).slides


def test_seals_of_which_the_softer_alone_have_come_near_do_not_slide():
    assert not moved(1e-6, seals=even(56.0), softer=even(60.0), elasticity=SLOW_MEMORY).slides
    assert not moved(1e-6, seals=even(60.0), softer=even(56.0), elasticity=SLOW_MEMORY).slides
    assert moved(1e-6, seals=even(58.0), softer=even(58.0), elasticity=SLOW_MEMORY).slides


@pytest.mark.parametrize(('excess', 'slides'), [(-2.9, True), (-3.1, False), (2.9, True), (3.1, False)])
def test_seals_that_slide_at_unlike_frictions_agree_to_5_percent(excess, slides):
    softer = even(60.0 + excess, excess)
    assert moved(1e-5, seals=even(60.0), softer=softer, elasticity=SLOW_MEMORY).slides is slides


@pytest.mark.parametrize(
    ('excess', 'sliding_excess', 'slides'),
    [(12.0, 0.0, False), (3.0, 0.0, True), (3.4, 0.0, False), (12.0, 10.0, True), (12.0, 8.0, False)],
)
def test_while_more_than_5_percent_of_stiction_may_still_break_the_rod_does_not_slide(excess, sliding_excess, slides):
    near = even(0.97 * (60.0 + excess), excess)
    slide = {'sliding_excess': sliding_excess, 'stiction': excess}
    assert moved(1e-9, seals=near, softer=near, elasticity=SLOW_MEMORY, **slide).slides is slides


def test_seals_whose_friction_has_fallen_to_nothing_slide():
    assert moved(5e-3, sliding_excess=-70.0) == ShearedFriction(True, 0.0, 0.0, True)


# --- seals that slide on ---


def slid(direction=1, **changes) -> FollowedShear:
    """State of seals that slide at 60 N and 10 mm/s, sampled at 1 kHz."""
    sheared = Shear(NO_ELEMENTS, 0.0)
    state = FollowedShear(
        START, direction * 0.01, 1e-3, sheared, sheared, True, direction, NEVER, direction * 60.0, 0.0, True
    )
    return state._replace(**changes)


def slid_on(state, velocity=0.01, coulomb=60.0, velocity_friction=0.0, elapsed=1e-3, direction=None, elasticity=HALF):
    stamp = START + round(elapsed * 1e9)
    towards = state.direction if direction is None else direction
    return slide_on(elasticity, state, stamp, velocity, towards, NEVER, coulomb, velocity_friction)


@pytest.mark.parametrize('side', [1, -1])
@pytest.mark.parametrize(
    ('speed', 'coulomb', 'slides'),
    [
        (0.01, 60.0, True),
        (0.01, 20.0, True),
        (0.05, 61.0, False),  # it takes the softer seals 33 um to take up a newton
        (0.057, 61.0, True),
    ],
)
def test_seals_slide_on_as_long_as_they_take_up_the_friction_that_grows(side, speed, coulomb, slides):
    found, state = slid_on(slid(side), side * speed, coulomb)
    assert found is slides
    following = slid(side, stamp=START + MS, velocity=side * speed, fully_sheared=side * coulomb)
    assert state == (following if slides else slid(side))


@pytest.mark.parametrize(
    ('changes', 'direction'), [({'is_known': False}, 1), ({'fully_sheared': 0.0}, 1), ({}, -1), ({}, 0)]
)
def test_seals_that_did_not_slide_that_way_do_not_slide_on(changes, direction):
    assert slid_on(slid(**changes), direction=direction) == (False, slid(**changes))


def test_seals_of_less_than_a_newton_slide_on_too():
    assert slid_on(slid(fully_sheared=0.3), coulomb=0.3)[0]
    assert slid_on(slid(-1, fully_sheared=-0.3), -0.01, coulomb=0.3)[0]


@pytest.mark.parametrize(
    ('period', 'elapsed', 'slides'),
    [
        (1e-3, 0.0, True),
        (1e-3, 0.01, True),
        (1e-3, 0.011, False),
        (1e-3, -1e-3, False),
        (5e-3, 0.0149, True),
        (5e-3, 0.0151, False),
        (0.05, 0.0999, True),
        (0.05, 0.101, False),
    ],
)
def test_seals_slide_on_over_a_gap_of_10_ms_or_three_periods(period, elapsed, slides):
    assert slid_on(slid(elapsed=period), elapsed=elapsed)[0] is slides


@pytest.mark.parametrize('side', [1, -1])
def test_a_way_back_is_kept_until_it_is_made_up_for(side):
    _, back = slid_on(slid(side, velocity=-side * 0.01), -side * 0.03)
    assert back.way_back == pytest.approx(-side * 2e-5)
    _, less = slid_on(back._replace(stamp=START, velocity=side * 0.01), side * 0.01)
    assert less.way_back == pytest.approx(-side * 1e-5)
    _, none = slid_on(less._replace(stamp=START, velocity=side * 0.02), side * 0.02)
    assert none.way_back == 0.0
    assert slid_on(slid(side, velocity=-side * 0.01), -side * 0.01, velocity_friction=5.0)[1].seals.excess == 0.0


def test_the_friction_of_seals_that_slide_on_has_the_part_that_depends_on_velocity():
    found, state = slid_on(slid(velocity=0.5), 0.5, 60.0, 5.0)
    assert (found, state.fully_sheared, state.seals, state.softer) == (True, 65.0, *[Shear(NO_ELEMENTS, 5.0)] * 2)
    found, state = slid_on(slid(-1), -0.01, 60.0, -70.0)
    assert (found, state.fully_sheared) == (True, 0.0)


# --- the first sample, a gap, a rest ---


@pytest.mark.parametrize('direction', [1, -1])
@pytest.mark.parametrize(('velocity_friction', 'force'), [(5.0, 65.0), (-59.7, 0.3), (-70.0, 0.0)])
def test_the_first_force_is_the_sliding_friction_and_a_guess(direction, velocity_friction, force):
    first = moment_of(stiction=10.0, velocity=0.01 * direction, direction=direction)
    first = first._replace(velocity_friction=velocity_friction)
    state, sheared = shear_on(HALF, NOT_FOLLOWED, first)
    assert sheared.force == pytest.approx(direction * force)
    assert (state.stamp, state.velocity, state.elapsed, state.direction) == (START, 0.01 * direction, 0.0, direction)
    assert not sheared.slides or force == 0.0


def test_a_rest_that_begins_while_the_seals_slide_has_alike_seals_and_one_that_begins_while_they_shear_has_not():
    sliding = slid()
    stopped, at_rest = shear_on(HALF, sliding, moment_of(60.0, stamp=START + MS, velocity=0.0))
    assert stopped.rests_alike
    assert (stopped.rest_since, stopped.direction) == (START + MS, 1)
    assert at_rest.is_followed
    sheared = sliding._replace(fully_sheared=0.0, seals=even(30.0), softer=even(20.0))
    assert not shear_on(HALF, sheared, moment_of(30.0, stamp=START + MS))[0].rests_alike
    nearly = sliding._replace(fully_sheared=0.0, seals=even(30.0), softer=even(30.3), velocity=0.0)
    assert shear_on(HALF, nearly, moment_of(30.0, stamp=START + MS))[0].rests_alike  # to 0.1 % of 60 N each
    unlike = nearly._replace(softer=even(30.5))
    assert not shear_on(HALF, unlike, moment_of(30.0, stamp=START + MS))[0].rests_alike


def test_after_100_ms_of_rest_the_seals_bear_the_force_sum_and_no_way_is_left():
    resting = slid(rest_since=START - 100 * MS, velocity=0.0, way_back=-1e-5)
    state, found = shear_on(HALF, resting, moment_of(24.0, stamp=START + MS))
    assert found == AT_REST
    assert state.seals.forces == state.softer.forces == pytest.approx(even(24.0).forces)
    assert (state.direction, state.way_back, state.fully_sheared, state.is_known) == (0, 0.0, 0.0, True)
    for unknown in ({'knows_force_sum': False}, {'knows_inertia': False}):
        assert not shear_on(HALF, resting, moment_of(24.0, stamp=START + MS, **unknown))[0].is_known
    for before in ({'is_known': False}, {'rests_alike': False}):
        assert not shear_on(HALF, resting._replace(**before), moment_of(24.0, stamp=START + MS))[0].is_known


def test_a_way_back_counts_once_the_direction_turns():
    back = slid(velocity=-0.01, way_back=-2e-5)
    state, sheared = shear_on(HALF, back, moment_of(stamp=START + MS, velocity=-0.01, direction=-1))
    assert sheared.force == pytest.approx(60.0 - 6e4 * 3e-5)
    assert sheared.std == pytest.approx(0.5 * 3e4 * 3e-5)
    assert (state.way_back, state.direction, state.is_known) == (0.0, -1, True)


def test_a_repeated_stamp_shears_nothing():
    sheared = slid(fully_sheared=0.0, seals=even(30.0), softer=even(20.0))
    state, found = shear_on(HALF, sheared, moment_of(velocity=0.01, direction=1))
    assert (state.is_known, found.force) == (True, pytest.approx(30.0))
    found, state = slid_on(slid(), velocity_friction=5.0, elapsed=0.0)
    assert (found, state.fully_sheared, state.seals.excess) == (True, 60.0, 0.0)


@pytest.mark.parametrize('side', [1, -1])
def test_a_rod_that_stops_holds_the_friction_it_slid_with_while_its_inertia_is_not_known(side):
    stopped = moment_of(0.0, stamp=START + MS, knows_inertia=False)
    state, found = shear_on(HALF, slid(side), stopped)
    assert found == ShearedFriction(True, side * 60.0, 0.0, True)
    assert (state.rest_since, state.direction, state.is_known) == (START + MS, side, True)
    assert state.fully_sheared == side * 60.0


def test_in_a_reversal_stiction_comes_back_with_time_alone():
    slow = HALF._replace(seals=ALIKE._replace(dwell_time=0.1), softer=HALF.softer._replace(dwell_time=0.1))
    state, found = shear_on(slow, slid(velocity=0.0), moment_of(24.0, stiction=12.0, stamp=START + MS))
    assert found.force == pytest.approx(24.0)
    assert state.seals.excess == pytest.approx(12.0 * (1.0 - math.exp(-0.01)))


@pytest.mark.parametrize('side', [1, -1])
@pytest.mark.parametrize(('apart', 'is_one'), [(0.0, True), (0.119, True), (0.121, False)])
def test_seals_that_all_slide_alike_are_kept_as_one_number(apart, is_one, side):
    """Their deviation is half of what they are apart: a thousandth of 60 N."""
    seals, softer = even(side * 60.0), even(side * (60.0 - apart), -apart)
    sheared = slid(side, fully_sheared=0.0, seals=seals, softer=softer)
    moving = moment_of(stamp=START + MS, velocity=side * 0.01, direction=side)
    state, found = shear_on(SLOW_MEMORY, sheared, moving)
    assert found.slides
    assert state.fully_sheared == (side * 60.0 if is_one else 0.0)
    assert state.seals.forces == (NO_ELEMENTS if is_one else pytest.approx(seals.forces))


@pytest.mark.parametrize('side', [1, -1])
def test_the_one_number_has_what_depends_on_velocity(side):
    moving = moment_of(stamp=START + MS, velocity=side * 5.0, direction=side, velocity_friction=5.0)
    state, found = shear_on(
        HALF, slid(side, fully_sheared=0.0, seals=even(side * 60.0), softer=even(side * 60.0)), moving
    )
    assert found == ShearedFriction(True, side * 65.0, 0.0, True)
    assert (state.fully_sheared, state.seals, state.softer) == (side * 65.0, *[Shear(NO_ELEMENTS, 5.0)] * 2)


def test_the_softest_seals_are_followed_too():
    limp = presliding_numbers([Presliding(stiffness=1.0, yield_exponent=0.0)])
    assert followed_elasticity(limp, 0.25).yield_compliance == pytest.approx(2.0)


# --- seals under unlike pressures ---


def softness(*seals, pressure_max=4.5e7) -> float:
    """Stiffness of the softer seals over that of the seals; a seal is its chamber, and what is changed of it."""
    mounted = tuple(MountedSeal(dataclasses.replace(SEAL, **{'presliding': SOFT} | change), c) for c, change in seals)
    followed = EstimatorParameters(EstimatorSettings(pressure_max=pressure_max), mounted).followed_elasticity
    return followed.softer.stiffness / followed.seals.stiffness


def coulomb_at(pressure: float) -> float:
    return actuator_friction((MountedSeal(SEAL, 'a'),), pressure, 0.0).coulomb_friction


@pytest.mark.parametrize('chambers', ['a', 'bb', 'aaa'])
def test_seals_of_one_chamber_are_under_one_pressure(chambers):
    assert softness(*((chamber, {}) for chamber in chambers)) == pytest.approx(0.7)


@pytest.mark.parametrize(('pressure_max', 'highest'), [(4.5e7, SEAL.pressure_max), (2e6, 2e6)])
def test_a_seal_under_the_highest_pressure_slides_later_than_all_with_the_others_at_none(pressure_max, highest):
    """It yields at f / k, and all of them together at the sum of f over the sum of k."""
    most, least = coulomb_at(highest), coulomb_at(0.0)
    two = softness(('a', {}), ('b', {}), pressure_max=pressure_max)
    assert two == pytest.approx(0.7 / (most / ((most + least) / 2.0)))
    three = softness(('a', {}), ('b', {}), ('a', {}), pressure_max=pressure_max)
    assert three == pytest.approx(0.7 / (most / ((most + 2.0 * least) / 3.0)))


def test_a_stiff_seal_yields_early_and_the_others_late():
    stiff = {'presliding': dataclasses.replace(SOFT, stiffness=4.0 * SOFT.stiffness)}
    most, least = coulomb_at(SEAL.pressure_max), coulomb_at(0.0)
    assert softness(('a', stiff), ('b', {})) == pytest.approx(0.7 / (most / ((most + least) / 5.0)))


def test_seals_without_friction_never_yield_late():
    none = {'coulomb_law': ConstantCoulomb(0.0)}
    assert softness(('a', none), ('b', none)) == pytest.approx(0.7)


def test_the_stiffness_of_all_seals_is_as_uncertain_as_that_of_each_by_its_share():
    seals = (('a', {'presliding': dataclasses.replace(SOFT, stiffness=3e5, relative_std=0.2)}),
             ('a', {'presliding': dataclasses.replace(SOFT, stiffness=1e5, relative_std=0.4)}))  # fmt: skip
    assert softness(*seals) == pytest.approx(1.0 - 2.0 * 0.25)


def test_one_rigid_seal_makes_the_actuator_rigid():
    mounted = tuple(MountedSeal(dataclasses.replace(SEAL, presliding=p), 'a') for p in (SOFT, None))
    found = EstimatorParameters(EstimatorSettings(), mounted)
    assert (found.elasticity, found.followed_elasticity) == (None, None)
    unused = parameters(use_presliding=False)
    assert unused.followed_elasticity is None
    assert unused.elasticity == presliding_numbers([SOFT, SOFT])  # for the feed-forward


# --- what the estimate says of sheared seals ---


@pytest.mark.parametrize('mass', [0.0, 20.0])
def test_while_seals_shear_the_residual_is_what_friction_offset_and_inertia_leave(mass):
    known = dataclasses.replace(parameters(), adaptation=AdaptationSettings('observe', moving_mass=mass))
    state, seen = init(known), 0
    for i in range(900):
        stamp = START + i * MS
        velocity = 0.01 if i % 300 < 150 else -0.01
        force = 50.0 if velocity > 0.0 else -30.0
        acceleration = state.adaptation.motion.acceleration
        sample = RodSample(stamp, velocity, Pressure(stamp, PRESSURE, PRESSURE), Force(stamp, force))
        state, estimate = step(known, state, sample)
        if estimate.status & Status.PRESLIDING and estimate.residual != 0.0:
            left = force - mass * acceleration - estimate.adaptation_offset - estimate.friction_force
            assert estimate.residual == pytest.approx(left, abs=1e-9)
            seen += abs(estimate.friction_force) < 0.9 * estimate.coulomb_friction
    assert seen > 50


def test_the_deviation_of_an_estimate_has_that_of_the_elasticity():
    velocities = there_and_back(0.01)
    after = len(velocities) // 2 + 40
    without_stiction = {'mode': 'off', 'stiction': 0.0, 'stiction_ratio': 0.0}
    elastic, rigid = (
        estimates(parameters(elasticity, **without_stiction), velocities, 0.0 * velocities)[after]
        for elasticity in (SOFT, None)
    )
    followed = parameters().followed_elasticity
    sliding, way = rigid.coulomb_friction, 40 * 1e-5  # [m] since the turn, where the mean velocity is 0
    forces = [sliding - 2.0 * initial_loading(n, 0.5 * way, sliding) for n in (followed.seals, followed.softer)]
    assert elastic.coulomb_friction_std > rigid.coulomb_friction_std
    added = math.sqrt(elastic.coulomb_friction_std**2 - rigid.coulomb_friction_std**2)
    assert added == pytest.approx(0.5 * abs(forces[0] - forces[1]), rel=1e-6)


@pytest.mark.parametrize(('inertia', 'bears'), [(0.49, True), (-0.49, True), (0.51, False), (-0.51, False)])
def test_the_force_sum_of_a_rod_that_stopped_counts_if_its_inertia_is_at_most_half_of_the_friction(inertia, bears):
    mass = 20.0
    known = dataclasses.replace(parameters(), adaptation=AdaptationSettings('observe', moving_mass=mass))
    state = init(known)
    for i in range(401):
        stamp = START + i * MS
        sample = RodSample(stamp, 0.01, Pressure(stamp, PRESSURE, PRESSURE), Force(stamp, 30.0))
        state, estimate = step(known, state, sample)
    acceleration = inertia * estimate.coulomb_friction / mass
    known_filter = state.adaptation.filter
    learnt = known_filter._replace(terms=known_filter.terms._replace(offset=3.0, remainder=0.0))
    state.adaptation = learnt_state(
        state.adaptation,
        known.adaptation,
        motion=state.adaptation.motion._replace(acceleration=acceleration),
        filter=learnt,
    )
    at = stamp + MS
    _, stopped = step(known, state, RodSample(at, 0.0, Pressure(at, PRESSURE, PRESSURE), Force(at, -5.0)))
    expected = -5.0 - 3.0 - mass * acceleration
    assert (stopped.friction_force == pytest.approx(expected, abs=1e-6)) is bears
    assert stopped.direction == (1 if stopped.friction_force > 0.0 else -1)
    assert stopped.status == Status.PRESLIDING
