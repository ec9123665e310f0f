"""Friction and load of a simulated boom from pressures, position and velocity alone, and what is refused."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from harness import boom
from harness.boom import Boom

from seal_friction_ros.core.identification.load_over_position import (
    FrictionTerms,
    LoadOverPosition,
    averaging_window,
    fit_load,
    follows_position,
    inertia_at,
    known_acceleration,
    load_at,
    without_load,
)
from seal_friction_ros.core.identification.signal_preparation import Signals, Sliding

BAR = boom.BAR
LIGHT = Boom(moment=21.0e3, tilt=2.35, inertia=4.0e3, exponent=1.0, gain=40.0, coulomb=2.5e3)
STICKY = Boom(stribeck=700.0, stribeck_velocity=0.02, viscous=1500.0, gain=20.0, exponent=1.0, coulomb=2.1e3)
FLAT = Boom(gain=0.0, coulomb=2.9e3, stribeck=0.0, viscous=0.0)
SLIDING = Sliding()


def signals_of(log) -> Signals:
    return Signals(log.time, log.velocity, log.p_a, log.p_b, log.force_sum)


def fitted(log) -> LoadOverPosition:
    return fit_load(signals_of(log), log.position, ('a', 'b'), SLIDING)


def part(log, where):
    return boom.BoomLog(*(column[where] for column in log))


# --- what is measured ---


def errors(run, machine, log):
    """Error of the friction at the mean [-], and of the load: RMS over its mean, and largest at any position [-]."""
    load = fitted(log)
    left = without_load(signals_of(log), log.position, load, SLIDING)
    moving = np.abs(left.velocity) > 5e-3
    friction = float(np.mean(np.sign(left.velocity[moving]) * left.force_sum[moving]))
    true = float(np.mean(np.abs(run.friction[np.abs(run.velocity) > 5e-3])))
    x = np.linspace(load.knots[0], load.knots[-1], 100)
    wrong, truth = load_at(load, x) - machine.load(x), machine.load(x)
    return friction / true - 1.0, float(np.sqrt(np.mean(wrong**2)) / truth.mean()), float(np.max(np.abs(wrong / truth)))


@pytest.mark.parametrize(
    ('machine', 'motion', 'noise', 'seeds'),
    [
        (Boom(), 'both', {}, (0, 1, 2)),
        (Boom(), 'both', {'of_range': 0.0, 'of_reading': 0.003}, (3,)),
        pytest.param(Boom(), 'both', {'full_scale': 250 * BAR}, (4, 5), marks=pytest.mark.long),
        (Boom(), 'trapezoids', {}, (6, 7)),
        pytest.param(Boom(), 'sines', {}, (8, 9), marks=pytest.mark.long),
        pytest.param(LIGHT, 'both', {}, (10,), marks=pytest.mark.long),
        pytest.param(STICKY, 'both', {}, (11,), marks=pytest.mark.long),
        (FLAT, 'both', {}, (12,)),
        (Boom(), 'both', {'step': 1e-3}, (13,)),
    ],
)
def test_friction_is_within_5_percent_and_load_within_2_percent(machine, motion, noise, seeds):
    run = boom.simulate(machine, motion)
    for seed in seeds:
        friction, rms, largest = errors(run, machine, boom.measured(run, seed, **noise))
        assert abs(friction) < 0.05
        assert rms < 0.02
        assert largest < 0.05  # at the lowest load, where 2 % are 110 N


def test_friction_follows_the_pressure_within_5_percent():
    machine = Boom(gain=200.0, coulomb=1.6e3)
    run = boom.simulate(machine, 'both')
    log = boom.measured(run, 0)
    left = without_load(signals_of(log), log.position, fitted(log), SLIDING)
    chambers = left.pressure_a, left.pressure_b
    speed = np.abs(left.velocity)
    even = speed > 0.03
    pressure = 0.5 * (left.pressure_a + left.pressure_b)[even]
    friction = (np.sign(left.velocity) * left.force_sum)[even]
    true = np.array([machine.friction(v, a, b) for v, a, b in zip(speed, *chambers, strict=True)])
    edges = np.quantile(pressure, np.linspace(0.0, 1.0, 7))
    for low, high in pairwise(edges):
        inside = (pressure >= low) & (pressure <= high)
        assert friction[inside].mean() == pytest.approx(true[even][inside].mean(), rel=0.05)


def test_the_mass_of_the_boom_is_found_with_its_change_over_position():
    run = boom.simulate(Boom(), 'both')
    load = fitted(boom.measured(run, 0))
    assert load.mass == pytest.approx(Boom().mass(load.middle), rel=0.05)
    assert load.mass_change[0] > 0.0
    assert 0.0 < load.mass_std < 0.1 * load.mass
    assert known_acceleration(load) > 0.05
    assert load.strokes == 14
    assert load.condition_number < 30.0


def test_more_noise_makes_a_longer_mean():
    run = boom.simulate(Boom(), 'both')
    little, much = (fitted(boom.measured(run, 0, full_scale=full * BAR)) for full in (50, 250))
    assert averaging_window(little) < averaging_window(much) <= 1.0
    assert little.noise < much.noise


def test_one_sine_gives_the_friction_and_warns_that_inertia_counts_as_load():
    run = boom.simulate(Boom(), 'one_sine')
    log = boom.measured(run, 0)
    load = fitted(log)
    assert any('inertia cannot be told apart' in warning and 'two speeds' in warning for warning in load.warnings)
    assert abs(errors(run, Boom(), log)[0]) < 0.05


# --- whether there is a load ---


def held_load(times, friction=20.0, sides=(1.0, -1.0)):
    """Even strokes over 0.4 m whose load changes by so many times the friction beyond the middle."""
    place, velocity = [], []
    for side in sides:
        way = np.linspace(0.0, 0.4, 401)
        place.append(way if side > 0.0 else way[::-1])
        velocity.append(np.full(401, 0.1 * side))
    x, v = np.concatenate(place), np.concatenate(velocity)
    pressure = np.full(len(x), 1e6)
    force = np.sign(v) * friction + times * friction * (x > 0.2) + 7.0
    return Signals(np.arange(len(x)) * 0.01, v, pressure, pressure, force), x


@pytest.mark.parametrize(('times', 'follows'), [(1.9, False), (2.1, True), (-1.9, False), (-2.1, True), (0.0, False)])
def test_a_load_shows_where_the_middle_changes_by_twice_the_friction(times, follows):
    signals, x = held_load(times)
    loose = Sliding(largest_acceleration=100.0)
    assert follows_position(signals, x, loose) is follows
    lost = np.where(np.arange(len(x)) % 7 == 0, np.nan, x)  # a position that is missing now and then
    assert follows_position(signals, lost, loose) is follows
    assert not follows_position(signals, np.full(len(x), np.nan), loose)
    assert not follows_position(signals, np.full(len(x), 0.3), loose)
    one_way, there = held_load(times, sides=(1.0,))
    assert not follows_position(one_way, there, loose)
    assert not follows_position(signals, x, Sliding(slowest=0.2, largest_acceleration=100.0))


def told(noise=30.0, friction=40.0, mass_std=2.0):
    terms = FrictionTerms(('constant',), np.array([friction]), friction, 1.0)
    return LoadOverPosition(
        np.linspace(0.0, 1.0, 4), np.zeros(4), np.zeros(4), 10.0, (0.0, 0.0), mass_std, terms, noise, 1.0, 4
    )


@pytest.mark.parametrize(
    ('noise', 'window'), [(1.0, 0.2), (2.0, 0.2), (3.0, 0.45), (4.0, 0.8), (4.5, 1.0), (400.0, 1.0)]
)
def test_a_mean_is_as_long_as_its_noise_is_a_twentieth_of_the_friction_within_0_2_to_1_s(noise, window):
    assert averaging_window(told(noise)) == pytest.approx(window)


def test_inertia_is_known_to_a_fiftieth_of_the_friction_up_to_some_acceleration():
    assert known_acceleration(told()) == pytest.approx(0.02 * 40.0 / 2.0)
    assert known_acceleration(told(mass_std=0.0)) == 0.0


def test_where_there_is_no_load_the_means_of_a_motion_are_left_and_a_rest_as_it_was():
    """Means over 0.2 s, one sample kept in 50 ms; a mean of a straight line is the line."""
    time = np.arange(400) * 0.01
    velocity = np.where(time < 1.0, 0.0, 0.1)
    ramp = 5.0 * time
    signals = Signals(time, velocity, 1e5 * ramp, 2e5 * ramp, np.where(time < 1.0, 3.0, ramp))
    noise = np.where(np.arange(400) % 2 == 0, 1.0, -1.0) * (time >= 1.5)
    position = np.full(400, 0.5)
    load = replace(told(0.1), mass=0.0)
    left = without_load(signals._replace(force_sum=signals.force_sum + noise), position, load, SLIDING)
    resting, moving = left.time < 0.995, left.time >= 0.995
    assert np.count_nonzero(resting) == 100
    assert (left.force_sum[resting] == 3.0).all()
    assert np.diff(left.time[moving]) == pytest.approx(np.full(np.count_nonzero(moving) - 1, 0.05))
    assert left.pressure_a[moving] == pytest.approx(1e5 * 5.0 * left.time[moving])
    inside = (left.time > 1.7) & (left.time < 3.8)
    assert np.abs(left.force_sum - 5.0 * left.time)[inside].max() <= 1.0 / 21.0 + 1e-9  # of 21 samples


# --- records ---


def test_a_spline_through_the_knots_gives_the_load_and_nothing_beyond_them():
    x = np.array([0.0, 0.1, 0.2, 0.4])
    load = LoadOverPosition(x, 1e3 + 2e3 * x**3, np.zeros(4), 10.0, (5.0, 2.0), 0.0, fitted_friction(), 1.0, 1.0, 4)
    assert load_at(load, np.array([0.0, 0.3, 0.4])) == pytest.approx([1000.0, 1054.0, 1128.0])
    assert np.isnan(load_at(load, np.array([-0.01, 0.41, np.nan]))).all()
    force = inertia_at(load, np.array([0.3]), np.array([2.0]), np.array([3.0]))  # m = 10.52, m' = 5.4 in 0.1 m
    assert force == pytest.approx([10.52 * 3.0 + 0.5 * 5.4 * 4.0])


def fitted_friction():
    return fitted(boom.measured(boom.simulate(Boom(), 'both'), 0)).friction


def test_samples_at_positions_of_one_direction_are_left_out():
    run = boom.simulate(Boom(), 'trapezoids')
    log = boom.measured(run, 0)
    kept = (log.velocity < 1e-3) | (log.position < 0.7)
    log = part(log, kept)
    load = fitted(log)
    assert load.knots[-1] == pytest.approx(0.7, abs=0.05)
    left = without_load(signals_of(log), log.position, load, SLIDING)
    assert np.isfinite(left).all()
    assert len(left.time) < len(log.time)


# --- what is refused ---


def test_a_load_that_changes_between_strokes_is_refused():
    run = boom.simulate(Boom(), 'trapezoids', ((34.0, 1.12),))
    with pytest.raises(ValueError, match=r'load changes between strokes.*drive all strokes with one load'):
        fitted(boom.measured(run, 0))


def test_directions_at_different_positions_are_refused():
    log = boom.measured(boom.simulate(Boom(), 'trapezoids'), 0)
    out, back = log.velocity > 3e-3, log.velocity < -3e-3
    log = part(log, (out & (log.position < 0.4)) | (back & (log.position > 0.4)))
    with pytest.raises(ValueError, match=r'share [0-9] % of the positions.*drive the same way out and back'):
        fitted(log)


def test_one_stroke_out_and_back_is_refused():
    with pytest.raises(ValueError, match=r'1 strokes out and 1 back are too few.*three times'):
        fitted(boom.measured(boom.simulate(Boom(), 'single'), 0))


def test_a_log_without_position_is_refused():
    log = boom.measured(boom.simulate(Boom(), 'single'), 0)
    with pytest.raises(ValueError, match=r'have no position.*record the position'):
        fit_load(signals_of(log), np.full(len(log.time), np.nan), ('a',), SLIDING)
    with pytest.raises(ValueError, match='position does not change'):
        fit_load(signals_of(log), np.zeros(len(log.time)), ('a',), SLIDING)


def test_a_wrong_sign_is_refused():
    log = boom.measured(boom.simulate(Boom(), 'both'), 0)
    signals = signals_of(log)
    with pytest.raises(ValueError, match='friction would drive the rod'):
        fit_load(signals._replace(force_sum=-signals.force_sum), log.position, ('a', 'b'), SLIDING)


def test_friction_below_the_noise_is_refused():
    log = boom.measured(boom.simulate(Boom(), 'both'), 0)
    random = np.random.default_rng(0)
    signals = signals_of(log)
    lost = signals.force_sum + 1e3 * random.standard_normal(len(log.time)).cumsum()
    with pytest.raises(ValueError, match='drive'):
        fit_load(signals._replace(force_sum=lost), log.position, ('a', 'b'), SLIDING)
