"""One model with a prior on every term: what data tell is found, and what they do not tell stays in the covariance."""

from dataclasses import replace

import numpy as np
import pytest

from seal_friction_ros.core.identification.candidate_laws import OperatingConditions
from seal_friction_ros.core.identification.friction_model import Told, fit_model, left_out
from seal_friction_ros.core.identification.readings import FrictionReadings
from seal_friction_ros.core.identification.validation import model_uncertainty

BAR = 1e5  # [Pa]
ALL = Told(viscous=True, stribeck=True, asymmetry=True, areas=False)


def readings(friction, bars=(5, 10, 20, 40, 60, 80), speeds=(0.01, 0.02, 0.05, 0.1), noise=0.002, offset=5.0):
    """Each speed in both directions at each pressure; ``friction`` [N] over pressure [bar], speed and direction."""
    rng = np.random.default_rng(1)
    rows = [(i, p, v, side) for i, p in enumerate(bars) for v in speeds for side in (1.0, -1.0) for _ in range(2)]
    level, pressure, speed, side = np.array(rows).T
    force = side * friction(pressure, speed, side) * (1.0 + noise * rng.normal(size=len(side))) + offset
    at = OperatingConditions(pressure[:, np.newaxis] * BAR, side * speed, side)
    level = level.astype(int)
    return FrictionReadings(at, force, np.zeros_like(level), level, level, ('log',), 'pressure', are_samples=False)


def test_every_term_is_found():
    made = readings(lambda p, v, s: (20.0 + 3.0 * p**0.8 + 100.0 * v + 15.0 * np.exp(-v / 0.02)) * (1.0 + 0.1 * s))
    found = fit_model(made, [(0,)], ALL)
    assert found.exponents == pytest.approx((0.8,), abs=0.02)
    assert found.asymmetry == pytest.approx(0.1, abs=0.02)
    assert found.viscous == pytest.approx(100.0, rel=0.2)
    assert found.stribeck[0] == pytest.approx(15.0, rel=0.2)
    truth = made.magnitudes(np.array([5.0]))
    assert found.friction(made.at) == pytest.approx(truth, rel=0.04)


def test_terms_that_are_less_probable_than_none_are_none():
    found = fit_model(readings(lambda p, v, _: 20.0 + 0.5 * p + 100.0 * v), [(0,)], ALL)
    assert found.asymmetry == pytest.approx(0.0, abs=1e-4)
    assert found.stribeck[0] < 1e-3 * found.size
    assert found.viscous == pytest.approx(100.0, rel=0.05)


def test_a_friction_without_pressure_needs_no_kind():
    found = fit_model(readings(lambda p, v, _: 30.0 + 200.0 * v + 0.0 * p), [], ALL)
    assert (found.constant, found.viscous) == pytest.approx((30.0, 200.0), rel=0.03)


def test_what_the_pressures_do_not_tell_stays_at_its_prior():
    found = fit_model(readings(lambda p, v, _: 20.0 + 0.5 * p + 0.0 * v, bars=(30, 30.1)), [(0,)], ALL)
    far = OperatingConditions(np.array([[90.0 * BAR]]), np.array([0.03]), np.array([1.0]))
    near = OperatingConditions(np.array([[30.0 * BAR]]), np.array([0.03]), np.array([1.0]))
    assert found.friction(near)[0] == pytest.approx(35.0, rel=0.02)
    assert found.std(near)[0] < 0.05 * 35.0
    assert found.std(far)[0] > 0.3 * found.friction(far)[0]


def test_a_group_left_out_is_predicted_as_by_a_fit_to_the_others():
    made = readings(lambda p, v, _: 20.0 + 3.0 * p**0.8 + 100.0 * v, noise=0.02)
    found = fit_model(made, [(0,)], ALL)
    predicted, deviation, _ = left_out(found, made)
    for out in made.groups[1:-1]:
        others = fit_model(made.taken(~out), [(0,)], ALL)
        assert predicted[out] == pytest.approx(others.friction(made.taken(out).at), rel=0.02)
    assert np.abs(deviation).mean() == pytest.approx(0.02 * found.size, rel=0.6)


def test_noise_of_the_samples_is_no_difference_between_strokes():
    """Forty strokes of a swept log without any: the scatter of one more is that of the noise of its mean."""
    rng = np.random.default_rng(2)
    side = np.repeat(np.tile([1.0, -1.0], 20), 50)
    pressure, speed = rng.uniform(5.0, 80.0, size=2000), rng.uniform(0.01, 0.1, size=2000)
    force = side * (20.0 + 0.5 * pressure + 100.0 * speed) + 8.0 * rng.normal(size=2000)
    at = OperatingConditions(pressure[:, np.newaxis] * BAR, side * speed, side)
    group = np.arange(2000) // 200
    made = FrictionReadings(at, force, np.zeros_like(group), group, group, ('log',), 'block', are_samples=True)
    found = fit_model(made, [(0,)], ALL)
    assert found.scatter < 1.2 * 8.0 / np.sqrt(50.0) / np.abs(force).mean()
    # Nor is it any of the friction: the band is that of the law, with the spread between runs.
    assert made.noise(force - side * found.friction(at)) == pytest.approx(np.full(2000, 8.0), rel=0.1)
    friction = np.array([found.size])
    assert 0.0 < model_uncertainty(found, made, 0.0).std(friction)[0] < 0.25 * 8.0
    assert model_uncertainty(found, made, 0.3).std(friction)[0] == pytest.approx(0.3 * found.size, rel=0.02)


def test_what_the_model_misses_is_in_the_band():
    """Friction over the logarithm of the speed; without noise, the readings show what no term has."""
    made = readings(lambda p, v, _: (20.0 + 0.5 * p) * (1.0 - 0.2 * np.log(v / 0.02)), noise=0.0)
    found = fit_model(made, [(0,)], ALL)
    off = np.abs(made.magnitudes(found.offsets) - found.friction(made.at))
    std = model_uncertainty(found, made, 0.0).std(found.friction(made.at))
    assert 0.9 <= np.mean(off < 1.96 * std) <= 1.0
    assert std.mean() < 2.0 * np.sqrt(np.mean(off**2)) + found.std(made.at).mean()


def test_noise_of_a_stroke_is_that_of_the_mean_of_its_middle():
    rng = np.random.default_rng(3)
    samples = tuple(5.0 + 2.0 * rng.normal(size=(8, 400)))
    made = readings(lambda p, *_: 20.0 + 0.0 * p, bars=(5,), speeds=(0.01, 0.02))
    assert (made.noise(made.force) == 0.0).all()  # readings of a table
    middle = np.sort(rng.normal(size=(4000, 400)), axis=1)[:, 40:360].mean(axis=1)
    of_middles = 2.0 * middle.std()
    assert replace(made, samples=samples).noise(made.force) == pytest.approx(np.full(8, of_middles), rel=0.1)


def test_mixed_friction_that_follows_the_pressure_is_told_from_a_film():
    """At two speeds only: with the pressure the share that falls over the speed grows, a film does not."""
    made = readings(lambda p, v, _: (20.0 + 2.0 * p) * (1.0 + 0.5 * np.exp(-v / 0.02)) + 300.0 * v, speeds=(0.02, 0.08))
    found = fit_model(made, [(0,)], ALL)
    other = readings(lambda p, v, _: (20.0 + 2.0 * p) * (1.0 + 0.5 * np.exp(-v / 0.02)) + 300.0 * v, speeds=(0.03, 0.1))
    off = np.abs(other.magnitudes(np.array([5.0])) - found.friction(other.at))
    assert off.max() < 0.06 * found.size
    assert np.mean(off <= 1.96 * model_uncertainty(found, made, 0.0).std(found.friction(other.at))) > 0.9
    assert found.stribeck_ratio == pytest.approx(0.42, abs=0.1)
    assert found.stribeck[0] == 0.0


def test_an_asymmetry_of_the_contact_alone_is_none_of_the_film():
    made = readings(lambda p, v, s: (20.0 + 2.0 * p) * (1.0 + 0.15 * s) + 900.0 * v)
    found = fit_model(made, [(0,)], ALL)
    assert found.asymmetry == pytest.approx(0.15, abs=0.02)
    assert found.viscous_asymmetry == pytest.approx(-0.15, abs=0.05)


def test_a_constant_friction_has_no_band_of_terms_that_it_does_not_show():
    """An asymmetry would be an offset: it is left out; what is known is the scatter of the readings."""
    found = fit_model(made := readings(lambda p, *_: 100.0 + 0.0 * p), [(0,)], ALL)
    assert found.std(made.at).max() < 0.01 * found.size


@pytest.mark.parametrize('lost', [0.2, 0.0])
def test_a_drift_over_the_way_is_told_from_the_pressures(lost):
    """Pressures rise with the way, speeds and directions do not: the law is that at the end."""

    def friction(p, v, _):
        return 20.0 + 2.0 * p + 300.0 * v

    made = readings(friction)
    way = np.linspace(0.0, 1.0, made.count)
    force = 5.0 + (made.force - 5.0) * (1.0 + lost * (1.0 - way))
    found = fit_model(replace(made, force=force, travel=way), [(0,)], ALL._replace(drift=True))
    assert found.drift[0] == pytest.approx(lost, abs=0.02)
    truth = friction(made.at.pressure[:, 0] / BAR, np.abs(made.at.velocity), 0.0)
    assert found.friction(made.at) == pytest.approx(truth, rel=0.02)
