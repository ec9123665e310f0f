"""The estimate on seals that shear before they slide."""

import dataclasses
import json
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from paths import ROOT

from seal_friction_ros.core.estimation.configuration import SealSelection, first_snapshot, parse_snapshot, snapshot_text
from seal_friction_ros.core.estimation.estimator import EstimatorParameters, EstimatorSettings, init, step
from seal_friction_ros.core.estimation.records import Force, FrictionEstimate, Pressure, RodSample, Status
from seal_friction_ros.core.estimation.sheared_seals import (
    LEAST_STD,
    NOT_FOLLOWED,
    SETTLED,
    FollowedElasticity,
    FollowedShear,
    Moment,
    follow,
    followed_elasticity,
)
from seal_friction_ros.core.friction.actuator import MountedSeal
from seal_friction_ros.core.friction.presliding import (
    NO_ELEMENTS,
    NOT_SHEARED,
    Elements,
    Presliding,
    Shear,
    Slide,
    element_forces,
    initial_loading,
    presliding_numbers,
    shear,
)
from seal_friction_ros.core.friction.seal_file import parse_seal
from seal_friction_ros.core.friction.states import FrictionState
from seal_friction_ros.files import load_configuration, read_yaml

START, MS = 10**12, 10**6  # [ns]
PRESSURE = 2e6  # [Pa]
SEAL = parse_seal(read_yaml(ROOT / 'config' / 'seals' / 'ms28775_114.yaml'))
SOFT = Presliding(stiffness=5e4, relative_std=0.0)  # each of two


def parameters(presliding: Presliding | None = SOFT, use_presliding: bool = True, **limits) -> EstimatorParameters:
    seal = dataclasses.replace(SEAL, presliding=presliding, **limits)
    return EstimatorParameters(
        EstimatorSettings(use_presliding=use_presliding), tuple(MountedSeal(seal, chamber) for chamber in 'ab')
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


def test_stiff_seals_are_rigid_ones_after_a_micrometre():
    velocities = there_and_back(0.05)
    rigid = estimates(parameters(None), velocities, 0.0 * velocities)
    stiff = estimates(parameters(Presliding(stiffness=1e9)), velocities, 0.0 * velocities)
    off = estimates(parameters(SOFT, use_presliding=False), velocities, 0.0 * velocities)
    assert off == rigid
    turn = len(velocities) // 2
    settled = [*range(5, turn), *range(turn + 5, len(rigid))]
    assert [stiff[i] for i in settled] == [rigid[i] for i in settled]


def test_at_rest_the_friction_is_the_force_sum_and_the_motion_begins_from_it():
    velocities = np.concatenate([np.full(400, 0.01), np.zeros(300), np.full(400, 0.01)])
    force = np.concatenate([np.full(400, 30.0), np.full(300, -5.0), np.full(400, 30.0)])
    found = estimates(parameters(), velocities, force)
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


@pytest.mark.parametrize('gap', [51 * MS, -5 * MS, 10**9])
def test_after_a_gap_the_shear_is_not_known_and_the_force_a_guess(gap):
    elasticity = followed_elasticity(presliding_numbers([SOFT, SOFT]), 0.1)
    state = NOT_FOLLOWED
    moment = Moment(START, 0.01, 1, 0.0, True, 40.0, 0.0, 0.0)
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
    state, moving = NOT_FOLLOWED, Moment(START, 0.01, 1, 0.0, True, 40.0, 0.0, 2.0)
    for i in range(50):
        state, _ = follow(elasticity, state, moving._replace(stamp=START + 10 * i * MS))
    for force_sum in (-10.0, 38.0, -42.0, 42.0, 0.0):
        at_rest = Moment(state.stamp + 10 * MS, 0.0, 0, force_sum, True, 40.0, 0.0, 2.0)
        state, _ = follow(elasticity, state, at_rest)
        assert sum(state.shear.forces) == pytest.approx(force_sum, abs=1e-6)


@given(
    velocities=st.lists(st.tuples(st.floats(-0.05, 0.05), st.integers(1, 60)), min_size=1, max_size=12),
    memory_length=st.sampled_from([0.0, 1e-4]),
    dwell_time=st.sampled_from([0.0, 0.01]),
)
def test_the_force_is_that_of_the_law_of_elastic_seals_but_for_rounding(velocities, memory_length, dwell_time):
    numbers = presliding_numbers([Presliding(stiffness=1e5, memory_length=memory_length, dwell_time=dwell_time)])
    elasticity = followed_elasticity(numbers, 0.1)
    state, stamp, last = NOT_FOLLOWED, START, 0.0
    sheared, first = NOT_SHEARED, True
    for velocity, samples in velocities:
        for i in range(samples):
            direction = (velocity >= 0.0) - (velocity < 0.0)
            coulomb = 40.0 + 0.3 * ((7 * i) % 5)  # pressures have ripple
            moment = Moment(stamp, velocity, direction, 0.0, True, coulomb, 100.0 * abs(velocity), 3.0)
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


def test_a_rest_without_a_force_sum_leaves_the_shear_unknown():
    elasticity = followed_elasticity(presliding_numbers([SOFT, SOFT]), 0.1)
    state = NOT_FOLLOWED
    moment = Moment(START, 0.01, 1, 0.0, True, 40.0, 0.0, 0.0)
    for i in range(500):
        state, _ = follow(elasticity, state, moment._replace(stamp=START + i * MS))
    at_rest = moment._replace(velocity=0.0, direction=0, stamp=state.stamp + MS)
    known, _ = follow(elasticity, state, at_rest)
    unknown, _ = follow(elasticity, state, at_rest._replace(knows_force_sum=False))
    assert known.is_known
    assert not unknown.is_known


STIFFNESS, SLIDING_FRICTION = 1e5, 40.0  # [N/m], [N]


@given(
    start=st.lists(st.floats(-1.0, 1.0), min_size=6, max_size=6),
    softness=st.floats(1.0 - 2.0 * LEAST_STD, 1.0 + 2.0 * LEAST_STD),
    turns=st.lists(st.integers(1, 300), min_size=1, max_size=8),
    speed=st.floats(2e-3, 0.05),
    exponent=st.sampled_from([0.0, 1.0, 3.0]),
)
def test_without_the_bit_the_seals_slide_however_they_were_sheared_and_within_two_deviations_of_the_stiffness(
    start, softness, turns, speed, exponent
):
    numbers = presliding_numbers([Presliding(stiffness=STIFFNESS, yield_exponent=exponent)])
    elasticity = followed_elasticity(numbers, LEAST_STD)
    real = numbers._replace(stiffnesses=Elements(*(softness * k for k in numbers.stiffnesses)))
    forces = Elements(*(s * w * SLIDING_FRICTION for s, w in zip(start, numbers.shares, strict=True)))
    state, stamp, direction, last = NOT_FOLLOWED, START, 1, 0.0
    for samples in turns:
        for _ in range(samples):
            velocity = direction * speed
            displacement = 0.5 * (last + velocity) * 1e-3 if state != NOT_FOLLOWED else 0.0
            forces, force = element_forces(real, forces, displacement, SLIDING_FRICTION)
            moment = Moment(stamp, velocity, direction, 0.0, True, SLIDING_FRICTION, 0.0, 0.0)
            state, sheared = follow(elasticity, state, moment)
            if sheared.slides:
                assert direction * force >= (SETTLED - 0.01) * SLIDING_FRICTION
            last, stamp = velocity, stamp + MS
        direction = -direction


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
    assert abs(rigid[-1].adaptation_offset) > 0.5 * rigid[-1].coulomb_friction


def test_a_snapshot_of_an_older_bag_has_rigid_seals():
    text = snapshot_text(first_snapshot(load_configuration(SealSelection(), EstimatorSettings())))
    document = json.loads(text)
    del document['settings']['use_presliding'], document['state']['estimator']['shear']
    older = parse_snapshot(json.dumps(document))
    assert older.state.estimator.shear == NOT_FOLLOWED
    assert not older.configuration.settings.use_presliding
    assert parse_snapshot(text).configuration.settings.use_presliding


def test_the_softer_seals_are_two_deviations_softer_but_never_limp():
    numbers = presliding_numbers([SOFT])
    assert followed_elasticity(numbers, 0.3).softer.stiffness == pytest.approx(0.4 * SOFT.stiffness)
    assert followed_elasticity(numbers, 0.0).softer.stiffness == pytest.approx(0.7 * SOFT.stiffness)
    assert followed_elasticity(numbers, 9.0).softer.stiffness == pytest.approx(0.2 * SOFT.stiffness)
    assert isinstance(followed_elasticity(numbers, 0.3), FollowedElasticity)
    assert isinstance(NOT_FOLLOWED, FollowedShear)
