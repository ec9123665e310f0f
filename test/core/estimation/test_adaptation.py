"""Scale and offset are learnt from a machine that the law does not describe, and from nothing else."""

import math
from dataclasses import replace
from itertools import pairwise
from statistics import fmean, pstdev

import numpy as np
import pytest
from harness.simulated_day import SECOND, START, Day, samples
from hypothesis import given
from hypothesis import strategies as st
from paths import ROOT

from seal_friction_ros.core.estimation import estimator
from seal_friction_ros.core.estimation.adaptation import (
    NO_LEVEL,
    NOT_ADAPTED,
    NOTHING_LEARNT,
    AdaptationSettings,
    Lagging,
    Ratios,
    Reading,
    Slide,
    _averaged,
    _can_be_compared,
    _is_even,
    _is_spike,
    _learn,
    _learnt_scale,
    _median,
    _ratio,
    _share,
    adapt,
    disagrees,
    is_due,
    residual,
    with_scale,
)
from seal_friction_ros.core.estimation.disagreement import Reversal, last_reversal, likely_reason
from seal_friction_ros.core.estimation.estimator import EstimatorParameters, EstimatorSettings, step
from seal_friction_ros.core.estimation.friction_change import FrictionChange, watch
from seal_friction_ros.core.estimation.records import NEVER, Force, Pressure, RodSample, Status
from seal_friction_ros.core.friction.actuator import ActuatorFriction, MountedSeal, actuator_friction
from seal_friction_ros.core.friction.laws.constant_coulomb import ConstantCoulomb
from seal_friction_ros.core.friction.seal_file import parse_seal
from seal_friction_ros.core.friction.states import FrictionState
from seal_friction_ros.files import read_yaml

SEAL = parse_seal(read_yaml(ROOT / 'config' / 'seals' / 'ms28775_114.yaml'))
SEALS = (MountedSeal(SEAL, 'a'), MountedSeal(SEAL, 'b'))
FRICTION = actuator_friction(SEALS, 3e6, 3e6).coulomb_friction  # [N]
DAY = Day(FRICTION)


def parameters(mode='on', **settings):
    return EstimatorParameters(EstimatorSettings(), SEALS, AdaptationSettings(mode, **settings))


def run(day, seconds, seed=0, known=None, changed=lambda sample: sample):
    """Estimates of a day, and the reversals that were learnt from."""
    known = known or parameters()
    state, estimates, reversals = estimator.init(known), [], []
    for sample in samples(day, seconds, seed):
        count = state.adaptation.learnt.reversals
        state, estimate = step(known, state, changed(sample))
        estimates.append(estimate)
        if state.adaptation.learnt.reversals > count:
            reversals.append(last_reversal(state.adaptation.learnt))
    return estimates, reversals


def last_scale(day, seconds, **options):
    return run(day, seconds, **options)[0][-1].adaptation_scale


# --- what is learnt ---


@pytest.mark.parametrize('factor', [0.4, 0.6, 1.0, 1.5, 2.5])
def test_twenty_reversals_teach_the_friction_of_another_day_within_5_percent(factor):
    day = replace(DAY, scale=lambda _: factor)
    estimates, _ = run(day, 21.0)
    assert estimates[-1].adaptation_scale == pytest.approx(factor, rel=0.05)
    assert estimates[-1].coulomb_friction == pytest.approx(factor * FRICTION, rel=0.05)


def test_the_factor_of_the_law_cancels():
    scales = []
    for factor in (0.6, 1.0, 1.5):
        seals = tuple(replace(mounted, friction_scale=factor) for mounted in SEALS)
        known = EstimatorParameters(EstimatorSettings(), seals, AdaptationSettings('on'))
        scales.append(factor * last_scale(DAY, 21.0, known=known))
    assert max(scales) / min(scales) < 1.005


def test_the_offset_is_that_of_the_force_sum():
    estimates, _ = run(replace(DAY, load=lambda _: 40.0), 20.0)
    assert fmean(e.adaptation_offset for e in estimates[-200:]) == pytest.approx(40.0, abs=0.05 * FRICTION)


def test_observe_publishes_the_scale_and_leaves_the_friction_as_it_is():
    day = replace(DAY, scale=lambda _: 1.2)
    off, observed = run(day, 20.0, known=parameters('off'))[0], run(day, 20.0, known=parameters('observe'))[0]
    assert observed[-1].adaptation_scale == pytest.approx(1.2, rel=0.05)
    changed = {
        'coulomb_friction_std',
        'status',
        'adaptation_scale',
        'adaptation_scale_std',
        'adaptation_offset',
        'residual',
    }
    for before, after in zip(off, observed, strict=True):
        a, b = before._asdict(), after._asdict()
        assert {name for name in a if a[name] != b[name]} <= changed


def test_off_every_number_is_as_before_and_nothing_is_learnt():
    known = parameters('off')
    state = estimator.init(known)
    for sample in samples(replace(DAY, scale=lambda _: 1.5), 10.0, 0):
        state, estimate = step(known, state, sample)
        assert estimate[-4:] == (1.0, 0.0, 0.0, 0.0)
    assert state.adaptation == NOT_ADAPTED


# --- what is not learnt ---


def test_one_direction_alone_moves_no_scale():
    day = replace(DAY, one_direction=True, scale=lambda time: 1.0 + 0.05 * time)
    assert last_scale(day, 20.0) == 1.0


@pytest.mark.parametrize(('stroke_time', 'speed'), [(0.055, 0.04), (0.1, 0.04), (0.055, 0.02)])
def test_inertia_known_and_twice_the_friction_moves_the_scale_of_short_strokes_by_less_than_5_percent(
    stroke_time, speed
):
    day = replace(DAY, period=1e-3, stroke_time=stroke_time, speed=speed, presliding=0.0, count=1e-8, dip=0.0)
    estimates, reversals = run(day, 8.0, known=parameters('observe', moving_mass=day.mass))
    assert estimates[-1].adaptation_scale == pytest.approx(1.0, abs=0.05)
    assert len(reversals) > 20
    assert not any(estimate.status & Status.MODEL_DISAGREES for estimate in estimates)


def test_strokes_before_and_after_a_gap_are_not_compared():
    def shifted(sample):
        stamp, velocity, pressure, force, *rest = sample
        stamp += SECOND * (stamp - START > 10.35 * SECOND)
        return RodSample(stamp, velocity, pressure._replace(stamp=stamp), force._replace(stamp=stamp), *rest)

    gap, whole = run(DAY, 12.9, changed=shifted)[1], run(DAY, 12.9)[1]
    assert len(gap) == len(whole) - 1


def test_no_residual_at_all_leaves_a_deviation_of_1_percent():
    learnt = NOTHING_LEARNT._replace(scale_std=0.0, noise=0.0, before=NO_LEVEL._replace(stamp=5))
    adapted = with_scale(ActuatorFriction(10.0, 1.0, 2.0, True, 0.0), learnt, 5, True)
    assert adapted.coulomb_friction_std == pytest.approx(0.1)


def test_a_rod_that_stamps_twice_or_goes_back_in_time_learns_on():
    state = NOT_ADAPTED._replace(stamp=START)
    assert not is_due(state, START)
    assert not is_due(state, START + 3_000_000)
    assert is_due(state, START + 4_000_000)
    assert is_due(state, START - SECOND)


def test_at_rest_no_scale_moves():
    known = parameters()
    state = estimator.init(known)
    for sample in samples(replace(DAY, scale=lambda _: 1.3), 20.0, 0):
        state, _ = step(known, state, sample)
    learnt = state.adaptation.learnt
    for i in range(2000):
        stamp = state.stamp + 10_000_000
        resting = sample._replace(
            stamp=stamp, velocity=0.0, pressure=Pressure(stamp, 3e6, 3e6), force=Force(stamp, 500.0 * math.sin(i))
        )
        state, _ = step(known, state, resting)
    assert state.adaptation.learnt == learnt


@pytest.mark.parametrize('seed', range(3))
@pytest.mark.parametrize(
    'name', ['load steps', 'a load step at a reversal', 'offset drift', 'gravity', 'inertia', 'noise']
)
def test_what_is_not_friction_moves_the_scale_by_less_than_5_percent(name, seed):
    day = {
        'load steps': replace(DAY, load=lambda time: 2.0 * FRICTION * (int(time / 7.3) % 2)),
        'a load step at a reversal': replace(DAY, load=lambda time: 3.0 * FRICTION * (time > 15.0)),
        'offset drift': replace(DAY, load=lambda time: 0.05 * FRICTION * time),
        'gravity': replace(DAY, load=lambda time: 5.0 * FRICTION * abs((time % 2.0) - 1.0)),
        'inertia': replace(DAY, mass=500.0),
        'noise': replace(DAY, noise=0.3),
    }[name]
    undisturbed = last_scale(DAY, 12.0)
    scales = [estimate.adaptation_scale for estimate in run(day, 40.0, seed=seed)[0][1200:]]
    assert max(abs(scale / undisturbed - 1.0) for scale in scales) < 0.05


def test_a_frozen_force_sum_does_not_take_the_friction_away():
    def frozen(sample):
        late = sample.stamp - start > 20 * 10**9
        return sample._replace(force=Force(sample.stamp, 30.0)) if late else sample

    start = next(samples(DAY, 1.0, 0)).stamp
    estimates, _ = run(DAY, 60.0, changed=frozen)
    assert min(estimate.adaptation_scale for estimate in estimates) > 0.7
    assert estimates[-1].status & Status.MODEL_DISAGREES


def test_a_spike_moves_the_offset_by_no_more_than_four_deviations():
    known = parameters()

    def offset(spike: float) -> float:
        """Offset [N] after a stroke with one spike near its end."""
        state = estimator.init(known)
        for sample in samples(DAY, 20.0, 0):
            extra = spike if sample.stamp == START + 19_400_000_000 else 0.0
            force = sample.force._replace(force=sample.force.force + extra)
            state, _ = step(known, state, sample._replace(force=force))
            if sample.stamp == START + 19_420_000_000:
                return state.adaptation.learnt.offset
        raise AssertionError

    clean, noise = offset(0.0), run(DAY, 19.0)[0][-1].coulomb_friction_std
    up, down = offset(1e3 * noise) - clean, offset(-1e3 * noise) - clean
    assert 0.0 < up <= 4.0 * noise  # as a spike of that size, not one of a thousand deviations
    assert down == pytest.approx(-up, rel=0.4)


def test_a_stroke_knows_the_mean_pressures_it_was_made_at():
    known, state = parameters(), estimator.init(parameters())
    for sample in samples(DAY, 3.0, 0):
        far = 1e5 * math.sin(1e-9 * sample.stamp)
        pressure = sample.pressure._replace(chamber_a=2e6 + far, chamber_b=5e5 - far)
        state, _ = step(known, state, sample._replace(pressure=pressure))
    level = state.adaptation.learnt.before
    assert level.pressure_a == pytest.approx(2e6, abs=1e5)
    assert level.pressure_b == pytest.approx(5e5, abs=1e5)
    assert level.pressure_a + level.pressure_b == pytest.approx(2.5e6)


def test_spikes_are_not_learnt():
    def spiked(sample):
        return sample._replace(force=Force(sample.stamp, 900.0)) if sample.stamp % 370_000_000 == 0 else sample

    assert last_scale(DAY, 30.0, changed=spiked) == pytest.approx(last_scale(DAY, 30.0), rel=0.02)


# --- the promise ---


@pytest.mark.parametrize('mode', ['observe', 'on'])
@pytest.mark.parametrize('factor', [0.7, 1.0, 1.4])
def test_90_to_99_percent_of_good_readings_lie_in_the_band_after_ten_reversals(factor, mode):
    estimates, _ = run(replace(DAY, scale=lambda _: factor, noise=0.05), 60.0, known=parameters(mode))
    good = [e for e in estimates[1000:] if e.status == 0 and e.state == FrictionState.SLIDING]
    if mode == 'on' or factor == 1.0:
        assert len(good) > 2000
    inside = [abs(e.residual) < 1.96 * e.coulomb_friction_std for e in good]
    assert not good or 0.9 <= fmean(inside) <= 0.99


def test_the_model_disagrees_where_the_law_is_off_beyond_what_its_file_states():
    day = replace(DAY, scale=lambda _: 1.5)  # the seal file states 8 % of the friction and more
    assert run(day, 20.0, known=parameters('observe'))[0][-1].status == Status.MODEL_DISAGREES
    assert run(day, 20.0, known=parameters('on'))[0][-1].status == 0


def test_at_rest_an_offset_that_the_seals_could_not_hold_is_said():
    learnt = NOTHING_LEARNT._replace(scale_std=0.01, offset=30.0)
    friction = ActuatorFriction(40.0, 4.0, 10.0, True, 0.0)
    assert disagrees(AdaptationSettings(), learnt, friction, False, True)
    assert not disagrees(AdaptationSettings(), learnt, friction, False, False)
    assert not disagrees(AdaptationSettings(), learnt._replace(offset=24.0), friction, False, True)


def test_nothing_learnt_leaves_friction_and_deviation_as_the_file_has_them():
    friction = ActuatorFriction(40.0, 4.0, 10.0, True, 1.0)
    assert with_scale(friction, NOTHING_LEARNT, 0, True) == friction


@pytest.mark.parametrize('velocity_friction', [-6.0, 0.0, 6.0])
def test_deviation_and_missed_friction_are_shares_of_the_sliding_friction(velocity_friction):
    friction, sliding = ActuatorFriction(40.0, 4.0, 10.0, True, velocity_friction), 40.0 + velocity_friction
    learnt = NOTHING_LEARNT._replace(scale=1.2, scale_std=0.05, noise=0.0, before=NO_LEVEL._replace(stamp=0))
    used, observed = (with_scale(friction, learnt, 0, uses_scale) for uses_scale in (True, False))
    assert used.coulomb_friction_std == pytest.approx(0.05 * sliding)
    assert used.coulomb_friction + used.velocity_friction == pytest.approx(1.2 * sliding)
    # 5 % of the readings are below the friction of the file: 95 % within 1.96 deviations of it.
    assert 1.96 * observed.coulomb_friction_std == pytest.approx(0.2 * sliding + 1.645 * 0.05 * sliding, rel=1e-3)


def test_an_hour_without_a_reversal_brings_the_uncertainty_of_the_seal_file_back():
    friction = ActuatorFriction(40.0, 4.0, 10.0, True, 0.0)
    known = NOTHING_LEARNT._replace(scale=1.2, scale_std=0.01, noise=0.3, before=NO_LEVEL._replace(stamp=0))
    stds = [
        with_scale(friction, known, minutes * 60 * 10**9, True).coulomb_friction_std for minutes in (0, 30, 60, 600)
    ]
    assert stds[0] == pytest.approx(0.4)
    assert stds == sorted(stds)
    assert stds[2] == stds[3] == pytest.approx(math.hypot(0.4, 4.0))


@given(st.lists(st.floats(-5.0, 5.0), min_size=6, max_size=6), st.integers(1, 6))
def test_the_median_is_that_of_sorting(values, known):
    ordered = sorted(values[:known])
    expected = 0.5 * (ordered[(known - 1) // 2] + ordered[known // 2])
    assert _median(Ratios(*values), known) == expected


def test_the_deviation_of_the_scale_is_that_of_a_median_of_six_and_of_what_it_lags_behind():
    chance, medians, variances = np.random.default_rng(5), [], []
    for _ in range(3000):
        scale, std, ratios = 1.0, 0.0, NOTHING_LEARNT.ratios
        for number in range(6):
            ratio = float(chance.normal(1.0, 0.05))
            scale, std, median, ratios = _learnt_scale(AdaptationSettings('on'), scale, std, ratios, number, ratio)
        medians.append(median)
        variances.append(std**2 - (median - scale) ** 2)
    assert math.sqrt(fmean(variances)) == pytest.approx(pstdev(medians), rel=0.15)


def test_a_level_has_the_means_of_its_readings_and_how_they_depend_on_the_travel():
    chance = np.random.default_rng(8)
    travel, reading, friction = chance.normal(0.1, 0.02, 20), chance.normal(40.0, 3.0, 20), chance.normal(38.0, 1.0, 20)
    level, slide = NO_LEVEL, Slide(START, 0.01, 0.0, 0.0, 0.0, 2e6, 1e6, True, True)
    for i in range(20):
        level = _averaged(level, slide, 0.01, Reading(1, reading[i], friction[i], travel[i], 0.0))
    means = (level.travel, level.reading, level.friction, level.pressure_a, level.pressure_b)
    assert means == pytest.approx((travel.mean(), reading.mean(), friction.mean(), 2e6, 1e6))
    assert level.travel_variance == pytest.approx(travel.var())
    assert level.covariance == pytest.approx(np.cov(travel, reading, bias=True)[0, 1])
    assert (level.duration, level.samples) == (pytest.approx(0.2), 20)


@pytest.mark.parametrize(('few', 'compared'), [((4, 4), True), ((3, 9), False), ((9, 3), False)])
def test_both_strokes_that_are_compared_need_four_samples(few, compared):
    before, after = (
        NO_LEVEL._replace(direction=d, stamp=START, duration=1.0, samples=n) for d, n in zip((1, -1), few, strict=True)
    )
    assert _can_be_compared(before, after) == compared


@pytest.mark.parametrize(('pause', 'compared'), [(59, True), (61, False)])
def test_strokes_are_compared_over_a_pause_of_a_minute_however_long_they_are(pause, compared):
    before = NO_LEVEL._replace(direction=1, stamp=START, duration=20.0, samples=9)
    after = before._replace(direction=-1, stamp=START + (pause + 20) * SECOND)
    assert _can_be_compared(before, after) == compared


@pytest.mark.parametrize('mode', ['observe', 'on'])
def test_at_rest_and_without_a_force_sum_there_is_no_residual(mode):
    parameters = EstimatorParameters(EstimatorSettings(), SEALS, AdaptationSettings(mode))
    at_rest = RodSample(START, 0.0, Pressure(START, 2e6, 2e6), Force(START, 7.0))
    without_force = RodSample(START, 0.01, Pressure(START, 2e6, 2e6), Force(START - SECOND, 7.0))
    for sample in (at_rest, without_force):
        assert step(parameters, estimator.init(parameters), sample)[1].residual == 0.0


@pytest.mark.parametrize('mode', ['observe', 'on'])
def test_the_residual_is_what_friction_and_offset_leave_of_the_force_sum(mode):
    parameters = EstimatorParameters(EstimatorSettings(), SEALS, AdaptationSettings(mode))
    state, seen = estimator.init(parameters), 0
    for sample in samples(replace(DAY, friction=1.4 * DAY.friction), 8.0, 1):
        state, estimate = step(parameters, state, sample)
        if estimate.state == FrictionState.SLIDING and abs(estimate.adaptation_scale - 1.0) > 0.2:
            left = sample.force.force - estimate.friction_force - estimate.adaptation_offset
            assert estimate.residual == pytest.approx(left, abs=1e-9)
            seen += 1
    assert seen > 100


def after_one_more(scale: float, ratios: tuple[float, ...], ratio: float) -> float:
    return _learnt_scale(AdaptationSettings('on'), scale, 0.0, Ratios(*ratios), 6, ratio)[0]


def test_the_scale_goes_half_of_the_way_to_a_median_that_is_clearly_elsewhere_and_less_within_noise():
    assert after_one_more(1.0, (1.1,) * 6, 1.1) == pytest.approx(1.05)
    noisy = (1.04, 0.94, 1.06, 0.98, 1.03, 0.99)  # median 1.03 with the next one, known to 0.02
    assert 1.0 < after_one_more(1.0, noisy, 1.03) < 1.0075  # a quarter of the way
    assert after_one_more(1.0, (1.0,) * 6, 1.0) == 1.0
    assert after_one_more(1.0, (2.0,) * 6, 2.0) == pytest.approx(1.1)  # at most a tenth


def test_the_feed_forward_follows_a_drift_of_20_percent_over_200_reversals_within_5():
    estimates, reversals = run(replace(DAY, scale=lambda time: 1.0 + 0.001 * time), 201.0)
    late = estimates[20_000]
    assert late.adaptation_scale == pytest.approx(1.2, rel=0.05)
    watched, found = FrictionChange(), []
    for number, reversal in enumerate(reversals):
        watched = watch(watched, reversal.stamp, reversal.ratio)
        found += [number] * (watched.changes > len(found))
    assert found
    assert found[0] < 50


@pytest.mark.parametrize('seed', range(3))
def test_without_a_change_none_is_found(seed):
    _, reversals = run(replace(DAY, noise=0.1), 300.0, seed=seed)
    watched = FrictionChange()
    for reversal in reversals:
        watched = watch(watched, reversal.stamp, reversal.ratio)
    assert watched.changes == 0


# --- the likely reason ---


def reason(day=DAY, changed=lambda sample: sample, mode='observe'):
    known = parameters(mode)
    estimates, reversals = run(day, 30.0, known=known, changed=changed)
    said = likely_reason(known.seal_numbers, reversals[-12:])
    return said if estimates[-1].status & Status.MODEL_DISAGREES else ''


def in_unit(pascals):
    def changed(sample):
        return sample._replace(pressure=Pressure(sample.stamp, *(p / pascals for p in sample.pressure[1:])))

    return changed


WRONG = {
    'sign of the velocity': (DAY, lambda sample: sample._replace(velocity=-sample.velocity), 'sign'),
    'sign of the force sum': (DAY, lambda s: s._replace(force=Force(s.stamp, -s.force.force)), 'sign'),
    'psi as Pa': (DAY, in_unit(6894.757), 'psi'),
    'bar as Pa': (DAY, in_unit(1e5), 'bar'),
    'kPa as Pa': (DAY, in_unit(1e3), 'kPa'),
    'MPa as Pa': (DAY, in_unit(1e6), 'MPa'),
    'frozen force': (DAY, lambda sample: sample._replace(force=Force(sample.stamp, 12.0)), 'frozen'),
    'halved area': (DAY, lambda s: s._replace(force=Force(s.stamp, 0.5 * s.force.force)), 'area'),
    'another seal': (replace(DAY, scale=lambda _: 1.6), lambda sample: sample, '1.6'),
}


@pytest.mark.parametrize('name', WRONG)
def test_within_30_s_of_motion_the_reason_is_named(name):
    day, changed, word = WRONG[name]
    assert word in reason(day, changed)


def test_on_a_clean_day_no_reason_is_named():
    for mode in ('observe', 'on'):
        assert not reason(mode=mode)


def test_an_area_error_is_told_from_an_offset_that_follows_the_pressure():
    reversals = [
        Reversal(i, 1.0, 40.0, 20e-6 * pressure, pressure, 0.0) for i, pressure in enumerate((1e6, 3e6, 5e6) * 2)
    ]
    assert 'off by 20 mm2' in likely_reason(parameters().seal_numbers, reversals)


def test_below_the_identified_pressures_a_unit_is_named_that_does_not_contradict_the_friction():
    """The friction of this seal is the same at any pressure, so it tells no unit."""
    law = ConstantCoulomb(coulomb_friction_at_any_pressure=40.0)
    seal = replace(SEAL, coulomb_law=law, pressure_min=1e6, pressure_max=7e6)
    reversals = [Reversal(i, 1.0, 40.0, 0.0, 30.0 + i, 0.0) for i in range(8)]  # 30 bar as Pa
    assert 'bar' in likely_reason((MountedSeal(seal, 'a').numbers,), reversals)


# --- one sample at a time, by hand ---

OBSERVE = AdaptationSettings()
EVEN = Slide(START, 0.02, 45.0, 40.0, 4.0, 3e6, 2e6, True, True)
"""Even sliding at 45 N where the law says 40 N."""
BOUNDED = AdaptationSettings(scale_min=0.3, scale_max=3.0)


def test_before_the_first_sample_nothing_is_learnt():
    assert NO_LEVEL == (0, NEVER, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0)
    assert NOTHING_LEARNT == (0, 0.0, 0, 0, -1.0, NO_LEVEL, NO_LEVEL, 1.0, -1.0, 1.0, (1.0,) * 6, 0)
    at_rest = (0.0, 0.0, 0.0, 0.0)
    assert (NEVER, at_rest, at_rest, 0.0, 0.0, NOTHING_LEARNT, NEVER) == NOT_ADAPTED


@pytest.mark.parametrize(
    ('velocity', 'left'), [(0.02, 60.0 - 8.0 - 3.0 - 1.25 * 40.0), (-0.02, 60.0 - 8.0 - 3.0 + 1.25 * 40.0), (0.0, 0.0)]
)
def test_a_residual_is_the_force_sum_less_inertia_offset_and_friction(velocity, left):
    state = NOT_ADAPTED._replace(acceleration=0.4, learnt=NOTHING_LEARNT._replace(scale=1.25, offset=3.0))
    assert residual(AdaptationSettings(moving_mass=20.0), state, velocity, 60.0, 40.0) == pytest.approx(left)


@pytest.mark.parametrize(
    ('mass', 'acceleration', 'newest', 'is_even'),
    [
        (0.0, 0.05, 0.0, True),
        (0.0, 0.051, 0.0, False),
        (0.0, -0.051, 0.0, False),
        (0.0, 0.0, 0.051, False),
        (0.0, 0.01, -0.051, False),
        (0.0, -0.04, 0.05, True),
        (10.0, 2.0, 0.0, True),  # 20 N of inertia are half of 40 N
        (10.0, 2.01, 0.0, False),
        (10.0, 0.0, -2.01, False),
        (10.0, 0.0, 0.0, True),
        (100.0, 0.04, 0.0, True),
        (1000.0, 0.04, 0.0, False),
    ],
)
def test_speed_is_even_at_a_small_acceleration_or_with_a_known_mass_at_an_inertia_of_half_the_friction(
    mass, acceleration, newest, is_even
):
    settings = AdaptationSettings(moving_mass=mass, acceleration_max=0.05)
    assert _is_even(settings, acceleration, newest, 40.0) is is_even


@pytest.mark.parametrize(
    ('changes', 'direction', 'missed', 'is_spike'),
    [
        ({}, 1, 4.01, True),
        ({}, 1, -4.01, True),
        ({}, 1, 4.0, False),
        ({}, 1, -3.9, False),
        ({}, -1, 9.0, False),  # the first sample of another direction
        ({'outliers': 1}, 1, 9.0, False),  # two in a row are a load step
        ({'noise': -1.0}, 1, 9.0, False),  # the noise is not known yet
        ({'noise': 0.0}, 1, 1e-9, True),
    ],
)
def test_a_spike_is_one_residual_of_more_than_four_deviations(changes, direction, missed, is_spike):
    learnt = NOTHING_LEARNT._replace(**{'direction': 1, 'noise': 1.0} | changes)
    assert _is_spike(learnt, direction, missed) is is_spike


@given(st.floats(1e-4, 0.1), st.sampled_from([0.5, 10.0]), st.integers(1, 10**5))
def test_a_mean_is_a_plain_one_until_it_forgets(elapsed, memory, samples):
    assert _share(elapsed, memory, samples) == max(elapsed / (elapsed + memory), 1.0 / samples)


def test_the_ratio_is_the_half_difference_over_the_friction_less_what_depends_on_the_place():
    before = NO_LEVEL._replace(direction=1, reading=60.0, friction=38.0, travel=0.10)
    after = NO_LEVEL._replace(direction=-1, reading=-36.0, friction=42.0, travel=0.12)
    assert _ratio(before, after) == pytest.approx(96.0 / 80.0)
    assert _ratio(after, before) == pytest.approx(96.0 / 80.0)
    # A load of 200 N/m, seen in either stroke: 4 N of the difference are its.
    before = before._replace(travel_variance=1e-4, covariance=1e-2)
    after = after._replace(travel_variance=3e-4, covariance=7e-2)
    assert _ratio(before, after) == pytest.approx((96.0 + 4.0) / 80.0)
    assert _ratio(after, before) == pytest.approx((96.0 + 4.0) / 80.0)


@pytest.mark.parametrize(
    ('durations', 'compared'),
    [((1.0, 5.0), True), ((1.0, 5.1), False), ((5.0, 1.0), True), ((5.1, 1.0), False), ((2.0, 2.0), True)],
)
def test_a_stroke_is_compared_with_one_of_up_to_five_times_its_duration(durations, compared):
    strokes = [
        NO_LEVEL._replace(direction=side, stamp=START, samples=9, duration=duration)
        for side, duration in zip((1, -1), durations, strict=True)
    ]
    assert _can_be_compared(*strokes) is compared


@pytest.mark.parametrize('directions', [(1, 1), (-1, -1), (0, 1), (1, 0)])
def test_strokes_of_one_direction_are_not_compared(directions):
    strokes = [NO_LEVEL._replace(direction=side, stamp=START, samples=9, duration=1.0) for side in directions]
    assert not _can_be_compared(*strokes)


def learnt_after(learnt, missed=0.0, force=45.0, elapsed=0.1, direction=1, slide=EVEN, settings=OBSERVE):
    """What is learnt after one more reading; its friction by the law is 40 N."""
    return _learn(settings, learnt, slide, elapsed, Reading(direction, force, 40.0, 0.1, missed))


SLIDING_ON = NOTHING_LEARNT._replace(direction=1, samples=3, noise=2.0)


@pytest.mark.parametrize(('missed', 'outside'), [(3.9, 0.0), (-3.9, 0.0), (3.93, 1.0), (-3.93, 1.0)])
def test_the_noise_grows_with_a_residual_outside_its_95_percent_band_and_shrinks_with_one_inside(missed, outside):
    """In a second outside by 95 %, in a second inside by 5 %: so 5 % stay outside in the long run."""
    assert learnt_after(SLIDING_ON, missed).noise == pytest.approx(2.0 * (1.0 + 0.1 * (outside - 0.05)))


def test_the_noise_begins_with_the_deviation_of_the_seal_file():
    assert learnt_after(NOTHING_LEARNT).noise == pytest.approx(4.0 * (1.0 - 0.1 * 0.05))
    assert learnt_after(NOTHING_LEARNT._replace(noise=0.0)).noise == 0.0


def test_the_offset_is_the_mean_of_what_the_friction_leaves_and_begins_anew_at_a_reversal():
    known = SLIDING_ON._replace(scale=1.1, offset=7.0)
    for count, share in ((3, 0.25), (50, 0.1 / 0.6)):  # a plain mean, then one over half a second
        after = learnt_after(known._replace(samples=count), force=45.0)
        assert after.offset == pytest.approx(7.0 + share * (45.0 - 1.1 * 40.0 - 7.0))
        assert after.samples == count + 1
    turned = learnt_after(known, force=-45.0, direction=-1)
    assert turned.offset == pytest.approx(-45.0 + 1.1 * 40.0)
    assert (turned.direction, turned.samples, turned.scale) == (-1, 1, 1.1)


def test_two_residuals_of_more_than_four_deviations_are_a_load_step_after_which_the_offset_begins_anew():
    once = learnt_after(SLIDING_ON._replace(offset=1.0), missed=8.1)
    assert (once.outliers, once.samples) == (1, 4)
    assert learnt_after(once, missed=7.0).outliers == 0
    twice = learnt_after(once._replace(noise=2.0), missed=-8.1, force=95.0)
    assert (twice.outliers, twice.samples, twice.offset) == (0, 1, pytest.approx(55.0))
    assert learnt_after(SLIDING_ON, missed=8.0).outliers == 0
    assert learnt_after(once, direction=-1).outliers == 0


def test_a_stroke_holds_readings_within_the_identified_range_alone():
    assert learnt_after(SLIDING_ON).level.samples == 1
    assert learnt_after(SLIDING_ON, slide=EVEN._replace(is_identified=False)).level == NO_LEVEL


def test_at_a_reversal_the_last_two_strokes_make_a_ratio_and_the_offset_keeps_what_the_scale_takes():
    out = NO_LEVEL._replace(direction=1, stamp=START, reading=60.0, friction=40.0, duration=1.0, samples=9)
    back = out._replace(direction=-1, stamp=START + SECOND, reading=-50.0)
    known = NOTHING_LEARNT._replace(
        direction=-1,
        samples=9,
        noise=2.0,
        level=back,
        before=out,
        ratios=Ratios(*[1.375] * 6),
        reversals=6,
        median=1.375,
    )
    after = learnt_after(known, force=55.0)
    assert after.ratios == Ratios(*[1.375] * 6)
    assert (after.median, after.reversals, after.before) == (1.375, 7, back)
    assert after.scale == pytest.approx(1.1)  # a tenth at most
    assert after.offset == pytest.approx(55.0 - 1.1 * 40.0)
    assert after.level.samples == 1
    alike = learnt_after(known._replace(before=out._replace(direction=-1)), force=55.0)
    assert (alike.reversals, alike.scale, alike.before) == (6, 1.0, back)


def by_the_docstring(scale, ratios, bounds=(0.3, 3.0)):
    """Scale and standard deviation after the ratios, the newest first, by the equations at the top of the module."""
    m, k = float(np.median(ratios)), len(ratios)
    of_median = math.sqrt(math.pi / 2.0 / k)
    sigma_m = of_median * 0.8862 * fmean([abs(a - b) for a, b in pairwise(ratios)])
    if bounds[0] <= m <= bounds[1] and m != scale:
        way = (m - scale) ** 2 / ((m - scale) ** 2 + 4.0 * sigma_m**2) * (m - scale) / 2.0
        scale += min(max(way, -0.1 * scale), 0.1 * scale)
    return scale, math.hypot(of_median * 1.2533 * fmean([abs(z - m) for z in ratios]), m - scale)


@given(st.lists(st.floats(0.2, 3.3), min_size=6, max_size=6), st.integers(3, 9), st.floats(0.5, 2.0))
def test_scale_and_deviation_follow_the_equations(ratios, number, scale):
    found, std, median, kept = _learnt_scale(BOUNDED, scale, -1.0, Ratios(*ratios[1:], 9.0), number - 1, ratios[0])
    known = ratios[: min(number, 6)]
    assert kept == Ratios(*ratios)
    assert median == np.median(known)
    assert (found, std) == pytest.approx(by_the_docstring(scale, known), rel=1e-9, abs=1e-12)


@pytest.mark.parametrize(('median', 'moves'), [(0.3, True), (0.299, False), (3.0, True), (3.001, False)])
def test_the_scale_stands_still_while_the_median_is_out_of_its_bounds(median, moves):
    scale, std, *_ = _learnt_scale(BOUNDED, 1.0, -1.0, Ratios(*[median] * 6), 6, median)
    assert (scale != 1.0) is moves
    assert std == pytest.approx(abs(median - scale))


@pytest.mark.parametrize(('reversals', 'believed'), [(0, False), (1, False), (2, True)])
def test_no_scale_is_believed_before_the_third_reversal(reversals, believed):
    scale, std, median, _ = _learnt_scale(BOUNDED, 1.0, -1.0, Ratios(1.4, 1.4, *[1.0] * 4), reversals, 1.4)
    assert (scale != 1.0, std >= 0.0) == (believed, believed)
    assert median == 1.4


@pytest.mark.parametrize(
    ('changes', 'uses_scale', 'is_at_rest', 'said'),
    [
        ({'scale_std': -1.0, 'median': 9.0}, False, False, False),  # nothing is learnt
        ({'scale_std': 0.0, 'median': 9.0}, True, False, True),
        ({'median': 0.3, 'scale': 0.3}, True, False, False),
        ({'median': 0.299, 'scale': 0.3}, True, False, True),
        ({'median': 3.0, 'scale': 3.0}, True, False, False),
        ({'median': 3.001, 'scale': 3.0}, True, False, True),
        ({'median': 1.199}, False, False, False),  # twice 4 N of 40 N
        ({'median': 1.201}, False, False, True),
        ({'median': 0.801}, False, False, False),
        ({'median': 0.799}, False, False, True),
        ({'median': 1.5, 'scale': 1.31}, True, False, False),
        ({'median': 1.5, 'scale': 1.29}, True, False, True),
        ({'median': 1.0, 'scale': 1.5}, False, False, False),
        ({'offset': 24.9}, False, True, False),  # half of 40 N and 10 N of stiction
        ({'offset': 25.1}, False, True, True),
        ({'offset': -25.1}, False, True, True),
        ({'offset': 25.1}, False, False, False),
        ({'offset': 25.1, 'scale': 1.1, 'median': 1.1}, True, True, False),
        ({'offset': 27.6, 'scale': 1.1, 'median': 1.1}, True, True, True),
    ],
)
def test_what_is_learnt_contradicts_the_law_beyond_twice_its_deviation_out_of_bounds_or_by_the_offset_at_rest(
    changes, uses_scale, is_at_rest, said
):
    learnt = NOTHING_LEARNT._replace(**{'scale_std': 0.01} | changes)
    assert disagrees(BOUNDED, learnt, ActuatorFriction(40.0, 4.0, 10.0, True, 0.0), uses_scale, is_at_rest) is said


@pytest.mark.parametrize(
    ('noise', 'scale_std', 'stamp', 'std'),
    [
        (3.0, 0.01, 0, 3.0),  # the noise
        (0.3, 0.05, 0, 2.0),  # the scale
        (0.3, 0.005, 0, 0.4),  # nobody knows a friction to less than 1 %
        (0.0, 0.0, 1800 * SECOND, math.hypot(0.4, 4.0 * math.sqrt(0.5))),
        (0.0, 0.0, -1800 * SECOND, 0.4),  # a clock that was set back
    ],
)
def test_the_deviation_is_the_largest_of_noise_scale_and_1_percent_with_what_an_hour_forgets(
    noise, scale_std, stamp, std
):
    learnt = NOTHING_LEARNT._replace(noise=noise, scale_std=scale_std, before=NO_LEVEL._replace(stamp=0))
    assert with_scale(ActuatorFriction(40.0, 4.0, 10.0, True, 0.0), learnt, stamp, True) == pytest.approx(
        (40.0, std, 10.0, True, 0.0)
    )


def test_without_a_reversal_the_deviation_of_the_seal_file_stays():
    learnt = NOTHING_LEARNT._replace(noise=3.0, scale_std=0.0)
    assert with_scale(ActuatorFriction(40.0, 4.0, 10.0, True, 0.0), learnt, START, True).coulomb_friction_std == 5.0


def test_the_scale_is_on_every_force():
    learnt = NOTHING_LEARNT._replace(scale=1.5, scale_std=0.0, noise=1.0, before=NO_LEVEL._replace(stamp=0))
    friction = ActuatorFriction(40.0, 4.0, 10.0, False, -6.0)
    assert with_scale(friction, learnt, 0, True) == (60.0, 1.0, 15.0, False, -9.0)
    assert with_scale(friction, learnt, 0, False)[::2] == friction[::2]


# --- the two lags ---


def adapted(slides, settings=OBSERVE, state=NOT_ADAPTED):
    for slide in slides:
        state = adapt(settings, state, slide)
    return state


def moving(count, velocity, force, friction=40.0, start=START, step=0.01):
    """Samples every ``step`` [s]; velocity [m/s] and force sum [N] by time [s]."""
    for i in range(count):
        time = i * step
        stamp = start + round(time * SECOND)
        yield Slide(stamp, velocity(time), force(time), friction, 4.0, 3e6, 2e6, True, True)


def test_both_lags_have_a_time_constant_of_5_ms():
    first, second = EVEN._replace(force_sum=0.0, velocity=0.02), EVEN._replace(stamp=START + SECOND // 50)
    state = adapted([first, second._replace(velocity=0.03, force_sum=50.0, friction=60.0)])
    share = 0.02 / 0.025
    once = Lagging(0.02 + share * 0.01, share * 50.0, 40.0 + share * 20.0, share * 0.03 * 0.02)
    assert state.once == pytest.approx(once)
    twice = [before + share * (now - before) for before, now in zip((0.02, 0.0, 40.0, 0.0), once, strict=True)]
    assert state.twice == pytest.approx(twice)
    assert state.acceleration == pytest.approx(share * 0.01 / 0.025)
    assert state.travel == pytest.approx(0.03 * 0.02)


def test_a_steady_acceleration_is_found_and_its_inertia_is_no_friction():
    settings = AdaptationSettings(moving_mass=10.0)
    state = adapted(moving(200, lambda t: 0.02 + 0.5 * t, lambda _: 43.0 + 10.0 * 0.5), settings)
    assert state.acceleration == pytest.approx(0.5)
    assert state.learnt.offset == pytest.approx(3.0, abs=0.1)
    assert state.learnt.level.reading == pytest.approx(43.0, abs=0.1)
    unknown = adapted(moving(200, lambda t: 0.02 + 0.5 * t, lambda _: 48.0))
    assert unknown.learnt == NOTHING_LEARNT  # it may be inertia


@pytest.mark.parametrize(('gap', 'is_known'), [(0.1, True), (0.101, False), (-0.01, False), (0.0, False)])
def test_after_a_gap_of_more_than_100_ms_or_a_step_back_acceleration_and_strokes_begin_anew(gap, is_known):
    state = adapted(moving(100, lambda _: 0.02, lambda _: 45.0))._replace(acceleration=0.01)
    after = adapt(OBSERVE, state, EVEN._replace(stamp=state.stamp + round(gap * SECOND)))
    assert bool(after.learnt.level.samples) is is_known
    if not is_known:
        assert after.once == after.twice == Lagging(0.02, 45.0, 40.0, state.travel)
        assert (after.acceleration, after.travel, after.stamp) == (0.0, state.travel, state.stamp + round(gap * SECOND))
        assert after.learnt == state.learnt._replace(level=NO_LEVEL, before=NO_LEVEL)
        assert after.learnt_stamp == state.learnt_stamp


def test_nothing_is_learnt_until_the_lagging_friction_is_95_percent_of_that_of_the_new_direction():
    """At 4 ms a sample two lags of 5 ms have done so after 7 samples: 1 - 2 (1 + 7 / 1.8) (5 / 9)^7 is 0.84."""
    out = adapted(moving(100, lambda _: 0.02, lambda _: 45.0, step=0.004))
    known, lags, number = out, [1.0, 1.0], 0
    while known.learnt.direction == 1:
        number += 1
        known = adapt(
            AdaptationSettings(acceleration_max=1e3), known,
            EVEN._replace(stamp=out.stamp + number * 4_000_000, velocity=-0.02, force_sum=-35.0),
        )  # fmt: skip
        lags[0] += 4.0 / 9.0 * (-1.0 - lags[0])
        lags[1] += 4.0 / 9.0 * (lags[0] - lags[1])
        assert (known.learnt.direction == -1) == (lags[1] <= -0.95)
    assert 5 < number < 15
    assert known.learnt_stamp == known.stamp


def test_a_law_without_friction_teaches_nothing():
    assert adapted(moving(50, lambda _: 0.02, lambda _: 45.0, friction=0.0)).learnt == NOTHING_LEARNT


def test_a_pause_counts_as_100_ms_at_most_where_something_is_learnt_again():
    out = adapted(moving(100, lambda _: 0.02, lambda _: 45.0))
    assert out.learnt.level.duration == pytest.approx(0.1 + 0.99 - 0.02, abs=0.011)  # the first one counts as 100 ms
    bad = [EVEN._replace(stamp=out.stamp + i * SECOND // 100, is_usable=False) for i in range(1, 51)]
    paused = adapted(bad, state=out)
    assert paused.learnt == out.learnt
    again = adapt(OBSERVE, paused, EVEN._replace(stamp=paused.stamp + SECOND // 100))
    assert again.learnt.level.duration - out.learnt.level.duration == pytest.approx(0.1)


@pytest.mark.parametrize('side', [1.0, -1.0])
def test_a_spike_reaches_the_lags_as_four_deviations(side):
    out = adapted(moving(100, lambda _: 0.02, lambda _: 45.0))
    clean, spoiled = (
        adapt(OBSERVE, out, EVEN._replace(stamp=out.stamp + SECOND // 100, force_sum=force))
        for force in (45.0, 45.0 + side * 900.0)
    )
    share = 0.01 / 0.015
    assert spoiled.once.force_sum - clean.once.force_sum == pytest.approx(side * share * 4.0 * out.learnt.noise)
    assert spoiled.learnt.outliers == 1


def test_the_scale_is_on_the_friction_of_a_spike_and_of_inertia():
    """44 N are 4 N more than the friction: no spike of a noise of 2 N; but 20 N less than with a scale of 1.6."""
    out = adapted(moving(100, lambda _: 0.02, lambda _: 40.0))
    known = out._replace(learnt=out.learnt._replace(noise=2.0, offset=0.0))
    slide = EVEN._replace(stamp=out.stamp + SECOND // 100, force_sum=44.0)
    assert adapt(OBSERVE, known, slide).learnt.outliers == 0
    assert adapt(OBSERVE, known._replace(learnt=known.learnt._replace(scale=1.6)), slide).learnt.outliers == 1
