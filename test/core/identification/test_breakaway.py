"""Breakaway that grows with the time at rest: told where the dwell was varied, and only there."""

from dataclasses import replace

import numpy as np
import pytest

from seal_friction_ros.core.identification.breakaway import LAWS, dwell_growth, dwell_varies, fit_breakaway
from seal_friction_ros.core.identification.candidate_laws import OperatingConditions
from seal_friction_ros.core.identification.readings import FrictionReadings
from seal_friction_ros.core.identification.signal_preparation import Signals, Sliding, breakaways

BARS = np.array([5.0, 20.0, 40.0, 60.0])
RESTS = np.array([1.0, 10.0, 100.0, 1000.0])  # [s]


def coulomb(bar):
    return 10.0 + 0.5 * bar


def starts(stiction, dwell=None, scatter=0.02, seed=0, tests=3):
    """Starts from rest at each pressure: breakaway is the Coulomb friction plus ``stiction(friction, dwell)``."""
    rng = np.random.default_rng(seed)
    bar, rest, _, direction = (
        grid.ravel() for grid in np.meshgrid(BARS, RESTS, np.arange(tests), [1.0, -1.0], indexing='ij')
    )
    rest = rest if dwell is None else dwell(bar, rest)
    force = (coulomb(bar) + stiction(coulomb(bar), rest)) * (1.0 + scatter * rng.normal(size=len(bar)))
    level = np.searchsorted(BARS, bar)
    at = OperatingConditions(1e5 * np.column_stack((bar, bar)), 0.0 * direction, direction)
    readings = FrictionReadings(
        at, direction * force, np.zeros(len(bar), dtype=int), level, level, ('made',), 'pressure', False, dwell=rest
    )
    return readings, fit_breakaway(readings, coulomb(bar), np.zeros(1))


@pytest.mark.parametrize(
    'growth',
    [lambda t: 0.1 * np.log10(1.0 + t), lambda t: 0.1 * t**0.2, lambda t: 0.35 * (1.0 - np.exp(-((t / 40.0) ** 0.5)))],
    ids=['logarithm', 'power of Rabinowicz', 'saturation of Kato'],
)
def test_growth_with_the_time_at_rest_is_found_and_predicts_each_rest(growth):
    readings, found = starts(lambda friction, t: friction * (0.1 + growth(t)))
    assert found.law.endswith('_dwell')
    decades = np.log10(1.0 + readings.dwell) - np.log10(1.0 + found.dwell)
    friction = readings.at.pressure.mean(axis=1) / 1e5 * 0.5 + 10.0
    ratio = found.ratio + found.ratio_per_decade * decades
    stiction = 2.0 * (found.stiction + found.stiction_per_decade * decades)
    predicted, true = friction * (1.0 + ratio) + stiction, friction * (1.1 + growth(readings.dwell))
    assert np.abs(predicted / true - 1.0).max() < 0.08
    assert found.dwells == (1.0, 1000.0)


def test_growth_that_does_not_follow_the_load_is_constant():
    _, found = starts(lambda _, t: 4.0 + 3.0 * np.log10(1.0 + t), scatter=0.01)
    assert found.law == 'constant_dwell'
    assert found.stiction_per_decade == pytest.approx(1.5, rel=0.1)  # [N] of one of two seals


def test_stiction_that_does_not_grow_gets_no_dwell():
    """Also where some growth fits the scatter a little better, in 19 of 20 draws at least."""
    found = [starts(lambda friction, _: 0.2 * friction, seed=seed)[1] for seed in range(60)]
    assert np.mean([fit.dwell is None for fit in found]) >= 0.95
    assert {*found[0].cross_validation_rms} == {*LAWS}


@pytest.mark.parametrize(
    'dwell',
    [lambda bar, _: np.full(len(bar), 30.0), lambda bar, _: 30.0 * bar, lambda bar, t: np.full(len(bar), np.nan) * t],
    ids=['one dwell', 'dwell follows the pressure', 'dwell unknown'],
)
def test_where_the_dwell_was_not_varied_there_is_no_rung_with_it(dwell):
    _, found = starts(lambda friction, _: 0.2 * friction, dwell)
    assert {*found.cross_validation_rms} == {'constant', 'load_dependent', 'both'}
    assert found.dwell is None


@pytest.mark.parametrize(('longer', 'varied'), [(2.9, False), (3.1, True)])
def test_a_dwell_varies_where_the_upper_fifth_is_three_times_the_lower(longer, varied):
    readings, _ = starts(lambda friction, _: 0.2 * friction, lambda _, t: np.where(t > 50.0, 10.0 * longer, 10.0))
    assert dwell_varies(readings) is varied
    held = np.where(readings.level < 2, 10.0, readings.dwell)
    assert not dwell_varies(replace(readings, dwell=held))  # at half of the pressures is not at most of them
    assert dwell_varies(replace(readings, dwell=np.where(readings.level < 1, 10.0, readings.dwell))) is varied
    assert not dwell_varies(replace(readings, dwell=np.where(readings.dwell == 10.0, 0.0, readings.dwell)))


def test_growth_is_counted_in_decades_from_one_second_on():
    assert dwell_growth(np.array([0.0, 9.0, 99.0])) == pytest.approx([0.0, 1.0, 2.0])


def test_exact_laws_come_back_with_the_stiction_of_one_seal_at_the_mean_dwell():
    _, both = starts(lambda friction, t: 3.0 + 0.2 * friction + 0.05 * friction * np.log10(1.0 + t), scatter=0.0)
    decades = np.log10(1.0 + RESTS).mean()
    assert both.law == 'both_dwell'
    assert (both.stiction, both.ratio) == pytest.approx((1.5, 0.2 + 0.05 * decades))
    assert (both.ratio_per_decade, both.stiction_per_decade) == pytest.approx((0.05, 0.0))
    assert both.dwell == pytest.approx(10.0**decades - 1.0)
    assert both.standard_errors == pytest.approx((0.0, 0.0), abs=1e-9)
    assert both.cross_validation_rms['both_dwell'] == pytest.approx(0.0, abs=1e-9)
    assert both.cross_validation_rms['constant'] > 1.0


def test_standard_errors_of_stiction_are_those_of_the_jackknife_over_the_pressures():
    draws = (starts(lambda *_: 6.0, lambda bar, _: np.full(len(bar), 30.0), seed=seed) for seed in range(20))
    readings, found = next(draw for draw in draws if draw[1].law == 'constant')
    excess = readings.magnitudes(np.zeros(1)) - coulomb(readings.at.pressure.mean(axis=1) / 1e5)
    weight = readings.scale**-2.0
    without = np.array([np.average(excess[~out], weights=weight[~out]) for out in readings.groups])
    error = np.sqrt(3.0 / 4.0 * np.sum((without - without.mean()) ** 2)) / 2.0  # of one of two seals
    assert found.standard_errors == pytest.approx((error, 0.0))
    assert found.stiction == pytest.approx(np.average(excess, weights=weight) / 2.0)


def test_the_dwell_of_a_log_is_the_time_at_rest_before_the_start():
    parts = [(0.0, 2.0), (0.02, 3.0), (0.0, 9.0), (-0.02, 3.0), (0.0, 0.5), (0.02, 3.0)]  # [m/s], [s]
    velocity = np.concatenate([np.full(int(100 * seconds), speed) for speed, seconds in parts])
    time = 0.01 * np.arange(len(velocity))
    force = 10.0 * np.sign(velocity)
    pressure = np.full(len(time), 1e6)
    found = breakaways(Signals(time, velocity, pressure, pressure, force), Sliding(largest_acceleration=5.0))
    assert [peak.dwell for peak in found] == pytest.approx([2.0, 9.0, 0.5], abs=0.02)


def test_of_laws_that_none_beats_one_is_taken_that_is_a_tenth_less_off_where_it_is_worst():
    """A stiction of 1 N and 12 % of the friction: the part that follows the load alone is beaten by no test."""
    chosen = []
    for seed in range(12):
        readings, found = starts(lambda f, _: 1.0 + 0.12 * f, lambda bar, _: np.full(len(bar), 30.0), seed=seed)
        friction = coulomb(readings.at.pressure.mean(axis=1) / 1e5)
        measured = readings.magnitudes(np.zeros(1))
        excess, weight = measured - friction, 1.0 / readings.scale

        def worst(*terms, excess=excess, weight=weight, measured=measured, readings=readings):
            columns = np.column_stack(terms)
            values = np.linalg.lstsq(columns * weight[:, np.newaxis], excess * weight, rcond=None)[0]
            off = excess - columns @ values
            return max(abs(off[inside].sum() / measured[inside].sum()) for inside in readings.levels.values())

        better = worst(np.ones(readings.count), friction) < 0.9 * worst(friction)
        assert found.law == ('both' if better else 'load_dependent'), seed
        chosen.append(found.law)
    assert 'both' in chosen
