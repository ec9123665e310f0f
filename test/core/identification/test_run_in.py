"""Run-in of a seal: what is evident over the strokes of one run, and the friction of the settled seal."""

from dataclasses import replace

import numpy as np
import pytest

from seal_friction_ros.core.identification.candidate_laws import OperatingConditions, Variation, candidate_laws
from seal_friction_ros.core.identification.fitting import fit, offsets_of
from seal_friction_ros.core.identification.readings import FrictionReadings
from seal_friction_ros.core.identification.run_in import (
    as_measured,
    drifts,
    settled_readings,
)
from seal_friction_ros.core.identification.validation import cross_validate

STROKE = 0.04  # [m]
SETTLED = 10.0  # [N]


def run(course, count=20, scatter=0.005, seed=0, pressures=1, offset=0.0, travel=True, follows=0.0):
    """One source per pressure: strokes out and back whose friction times ``course(travel)`` drifts, with noise.

    ``follows``: correlation of the noise of neighbouring strokes.
    """
    rng = np.random.default_rng(seed)
    source = np.repeat(np.arange(pressures), count)
    way = STROKE * np.tile(np.arange(count), pressures)
    noise = rng.normal(size=len(way))
    for i in range(1, len(noise)):
        noise[i] = follows * noise[i - 1] + np.sqrt(1.0 - follows**2) * noise[i]
    friction = SETTLED * (1.0 + source) * course(way) * (1.0 + scatter * noise)
    direction = np.tile([1.0, -1.0], len(way) // 2)
    at = OperatingConditions(1e5 * (1.0 + source[:, np.newaxis]), 0.01 * direction, direction)
    return FrictionReadings(
        at=at,
        force=offset + direction * friction,
        source=source,
        group=source,
        level=source,
        names=tuple(f'{i}' for i in range(pressures)),
        left_out_by='pressure',
        are_samples=False,
        travel=way if travel else np.empty(0),
    )


def approach(share, length):
    return lambda s: 1.0 + share * np.exp(-s / length)


def test_the_friction_of_the_settled_seal_is_the_asymptote_of_its_run_in():
    for share in (-0.3, 0.3):
        made = run(approach(share, 0.1), count=30)
        (drift,) = drifts(made, np.zeros(1))
        assert drift.settled_share * made.magnitudes(np.zeros(1)).mean() == pytest.approx(SETTLED, rel=0.02)
        assert np.sign(drift.change) == -np.sign(share)
        assert drift.is_evident


def test_drift_is_the_change_over_the_run():
    found = drifts(run(lambda s: 1.0 + 0.2 * s / s.max(), pressures=3, scatter=0.0), np.zeros(3))
    assert [drift.level for drift in found] == [0, 1, 2]
    assert [drift.change for drift in found] == pytest.approx([0.2 * 18 / 19 / 1.1] * 3, rel=0.02)


@pytest.mark.parametrize('follows', [pytest.param(0.0, marks=pytest.mark.long), 0.6])
def test_scatter_alone_is_no_evident_drift(follows):
    """Strokes that repeat within 5 %, also where neighbours go together, as on the rig."""
    alarms = [drifts(run(lambda s: 1.0 + 0.0 * s, scatter=0.05, seed=i, follows=follows), np.zeros(1))[0].is_evident
              for i in range(400)]  # fmt: skip
    assert np.mean(alarms) <= 0.03


def test_a_drift_is_evident_where_it_is_several_times_the_scatter():
    found = [drifts(run(approach(-0.12, 0.4), scatter=0.01, seed=i), np.zeros(1))[0].is_evident for i in range(100)]
    assert np.mean(found) >= 0.95


@pytest.mark.parametrize(
    'course',
    [
        *(approach(share, length) for share in (-0.25, 0.25) for length in (0.1, 0.3, 0.8)),
        lambda s: 1.0 - 0.25 / (1.0 + s / 0.15),
        lambda s: 1.0 - 0.2 * np.exp(-np.sqrt(s / 0.1)),
    ],
)
def test_the_settled_friction_is_within_two_of_its_standard_deviations(course):
    """Also where the approach is no exponential: a hyperbola, a stretched exponential."""
    found = [drifts(run(course, seed=i), np.zeros(1))[0] for i in range(50)]
    means = [SETTLED * course(STROKE * np.arange(20)).mean()] * len(found)
    off = [abs(one.settled_share - SETTLED / mean) for one, mean in zip(found, means, strict=True)]
    inside = [o <= 2.0 * one.settled_std for o, one in zip(off, found, strict=True)]
    assert all(one.is_evident for one in found)
    assert np.mean(inside) >= 0.9


WAY = STROKE * np.arange(30)
LENGTHS = WAY.max() * np.geomspace(0.05, 1.0, 15)  # that are tried


@pytest.mark.parametrize('offset', [0.0, -7.0])
@pytest.mark.parametrize(('length', 'share'), [(LENGTHS[3], -0.25), (LENGTHS[10], 0.4), (LENGTHS[14], -0.3)])
def test_an_exact_approach_is_found_with_half_of_what_is_unseen_and_its_form_in_doubt(length, share, offset):
    readings = run(approach(share, length), count=30, scatter=0.0, offset=offset)
    (drift,) = drifts(readings, np.array([offset]))
    mean = SETTLED * approach(share, length)(WAY).mean()
    assert drift.is_evident
    assert drift.settled_share == pytest.approx(SETTLED / mean, rel=1e-6)
    height = SETTLED * share
    unseen = height * np.exp(-WAY.max() / length)
    assert drift.settled_std == pytest.approx(np.hypot(0.5 * unseen, 0.15 * height) / mean, rel=1e-5)
    settled = settled_readings(readings, np.array([offset]))
    course = approach(share, length)(WAY)
    assert settled.share == pytest.approx(np.full(30, SETTLED / mean))
    expected = offset + readings.at.direction * SETTLED / mean * SETTLED * course
    assert settled.readings.force == pytest.approx(expected)
    assert settled.relative_std == pytest.approx(drift.settled_std / drift.settled_share)


@pytest.mark.parametrize(('off', 'evident'), [(0.018, False), (0.022, True)])
def test_a_run_within_2_percent_of_the_settled_seal_needs_no_correction(off, evident):
    seen = approach(1.0, LENGTHS[3])(WAY).mean() - 1.0
    for share in (off / (1.0 - off) / seen, -off / (1.0 + off) / seen):
        (drift,) = drifts(run(approach(share, LENGTHS[3]), count=30, scatter=0.0), np.zeros(1))
        assert drift.is_evident is evident
        assert drift.settled_share == pytest.approx(1.0 - np.sign(share) * off, rel=1e-3) or not evident


@pytest.mark.parametrize(('count', 'found'), [(5, 0), (6, 1)])
def test_a_drift_takes_six_strokes(count, found):
    made = run(approach(-0.3, 0.1), count=6)
    assert len(drifts(made.taken(np.arange(count)), np.zeros(1))) == found


def test_a_rod_that_did_not_travel_and_a_friction_that_is_none_show_no_drift():
    made = run(approach(-0.3, 0.1), count=20)
    for still in (replace(made, travel=np.full(20, 3.0)), replace(made, force=-made.force)):
        (drift,) = drifts(still, np.zeros(1))
        assert (drift.is_evident, drift.settled_share, drift.settled_std) == (False, 1.0, 0.0)


def test_the_extrapolation_is_bounded_by_the_change_that_was_seen():
    for i in range(20):
        straight = run(lambda s: 1.0 + 0.2 * s / s.max(), seed=i)
        (drift,) = drifts(straight, np.zeros(1))
        last = 1.2 * SETTLED
        assert last < drift.settled_share * 1.1 * SETTLED < last + 0.6 * 0.22 * SETTLED
        assert drift.settled_std > 0.02


@pytest.mark.parametrize('share', [-0.95, -0.9, -0.6, 0.6, 3.0, 9.0])
def test_a_run_that_hardly_began_to_settle_is_not_extrapolated(share):
    """A friction that falls steadily to a tenth would end below zero."""
    for seed in range(10):
        (drift,) = drifts(run(lambda s: 1.0 + share * s / s.max(), seed=seed), np.zeros(1))
        assert drift.settled_share > 0.0
        assert drift.settled_std <= 0.3 * drift.settled_share
        assert drift.is_evident == (drift.settled_share != 1.0)
    (fallen,) = drifts(run(lambda s: 1.0 - 0.9 * s / s.max()), np.zeros(1))
    assert not fallen.is_evident


def test_the_deviation_of_the_settled_seal_is_a_share_of_its_own_friction():
    """Friction that falls to a half in the run: what the extrapolation may be off by is a larger share of it."""
    readings = run(approach(1.2, 0.3), pressures=3, count=30)
    settled = settled_readings(readings, np.zeros(3))
    of_runs = drifts(readings, np.zeros(3))
    assert max(drift.settled_share for drift in of_runs) < 0.85
    assert settled.relative_std == pytest.approx(
        np.sqrt(np.mean([(drift.settled_std / drift.settled_share) ** 2 for drift in of_runs]))
    )


def test_readings_without_travel_and_swept_samples_stay_as_they_are():
    noted = run(approach(-0.3, 0.2), pressures=4, travel=False)
    assert not any(drift.is_evident for drift in drifts(noted, np.zeros(4)))
    assert settled_readings(noted, np.zeros(4)) is None


def settled_of(readings, as_run):
    return settled_readings(readings, offsets_of(readings, as_run.friction(readings.at)))


def test_the_law_is_that_of_the_settled_seal_whatever_the_offset_of_the_force():
    """Friction 10 N a bar, settled; the readings of the run-in show less."""
    line = next(law for law in candidate_laws(Variation(speeds=False)) if law.name == 'pressure_power_law_1')
    for offset in (0.0, -7.0):
        readings = run(approach(-0.25, 0.15), pressures=4, count=30, offset=offset)
        as_run = fit(line, readings)
        settled = settled_of(readings, as_run)
        law = fit(line, settled.readings)
        assert as_run.values['friction_at_one_bar'] < 9.8
        assert law.values['friction_at_one_bar'] == pytest.approx(10.0, rel=0.02)
        assert law.offsets == pytest.approx([offset] * 4, abs=0.3)
        assert 0.0 < settled.relative_std < 0.05


def test_a_run_that_ran_in_alone_is_predicted_as_it_was_measured():
    """Its readings are lower than those of the settled seal: the law of the other pressures knows by how much."""
    line = next(law for law in candidate_laws(Variation(speeds=False)) if law.name == 'pressure_power_law_1')
    readings = run(np.ones_like, pressures=4, count=30, scatter=0.002)
    course = np.where(readings.source == 3, approach(-0.4, 0.15)(readings.travel), 1.0)
    one_ran_in = replace(readings, force=readings.force * course)
    settled = settled_of(one_ran_in, fit(line, one_ran_in))
    left_out = as_measured(cross_validate(line, settled.readings, fit(line, settled.readings).values), settled.share)
    for level, inside in one_ran_in.levels.items():
        mean = np.abs(one_ran_in.force[inside]).mean()
        assert left_out.predicted[inside].mean() == pytest.approx(mean, rel=0.02), level
        assert left_out.deviation[inside].mean() == pytest.approx(mean - left_out.predicted[inside].mean(), abs=0.01)
    plain = cross_validate(line, one_ran_in, fit(line, one_ran_in).values)
    assert np.abs(plain.deviation).max() > 3.0 * np.abs(left_out.deviation[one_ran_in.source < 3]).max()


# --- approaches of one length ---


def pairs(count):
    """Scatter that neither direction nor travel explains: two strokes up, two strokes down."""
    return np.tile([1.0, 1.0, -1.0, -1.0], count)[:count]


def strokes(friction, travel):
    """One run of strokes out and back with this friction [N] at this travel [m]."""
    made = run(np.ones_like, count=len(friction) + len(friction) % 2).taken(np.arange(len(friction)))
    return replace(made, force=made.at.direction * friction, travel=travel)


def least_squares(travel, friction, direction, length):
    """Asymptote, height and offset of an approach, their standard errors, and the sum of squares."""
    design = np.column_stack(
        (np.ones_like(travel), np.exp(-(travel - travel.min()) / length), direction - direction.mean())
    )
    values = np.linalg.lstsq(design, friction, rcond=None)[0]
    left = friction - design @ values
    errors = np.sqrt(np.diag(np.linalg.inv(design.T @ design)) * (left @ left) / (len(friction) - 4))
    follows = min(max(left[1:] @ left[:-1] / (left @ left), 0.0), 0.9)
    return values, errors * [1.0, np.sqrt((1.0 + follows) / (1.0 - follows)), 1.0], left @ left


def test_the_settled_friction_is_the_mean_over_the_lengths_by_their_likelihood():
    """Seven strokes out and six back: the friction is that of the mean direction."""
    rng = np.random.default_rng(3)
    travel = 0.5 + STROKE * np.arange(13)
    direction, spanned = np.tile([1.0, -1.0], 7)[:13], 12 * STROKE
    friction = 10.0 + 6.0 * np.exp(-(travel - 0.5) / 0.1) + 0.3 * direction + 0.1 * rng.normal(size=13)
    lengths = spanned * np.geomspace(0.05, 1.0, 15)
    fits = [least_squares(travel, friction, direction, length) for length in lengths]
    values, errors, squares = (np.array(column) for column in zip(*fits, strict=True))
    asymptotes, heights = values[:, 0], values[:, 1]
    weights = squares ** (-13 / 4.0) / np.sum(squares ** (-13 / 4.0))
    settled = weights @ asymptotes
    beyond = weights @ (asymptotes + heights * np.exp(-spanned / lengths)) - settled
    variance = weights @ (errors[:, 0] ** 2 + (asymptotes - settled) ** 2)
    std = np.sqrt(variance + (0.5 * beyond) ** 2 + (0.15 * (weights @ heights)) ** 2)
    (drift,) = drifts(strokes(friction, travel), np.zeros(1))
    assert drift.is_evident
    assert drift.settled_share == pytest.approx(settled / friction.mean())
    assert drift.settled_std == pytest.approx(std / friction.mean())


@pytest.mark.parametrize(('times', 'evident'), [(2.5, False), (6.0, True)])
def test_an_approach_is_evident_from_four_standard_errors_on(times, evident):
    clean = run(approach(0.3, LENGTHS[3]), count=30, scatter=0.0)
    noisy = np.abs(clean.force) + 0.01 * pairs(30)
    error = least_squares(WAY, noisy, clean.at.direction, LENGTHS[3])[1][1]
    friction = np.abs(clean.force) + 0.01 * 3.0 / times / error * pairs(30)
    (drift,) = drifts(strokes(friction, WAY), np.zeros(1))
    assert drift.is_evident is evident


def test_the_change_of_a_source_in_one_direction_is_its_own():
    made = run(lambda s: 1.0 + 0.2 * s / s.max(), count=12, scatter=0.0)
    forward = made.taken(made.at.direction > 0.0)
    (drift,) = drifts(forward, np.zeros(1))
    friction = forward.force
    assert drift.change == pytest.approx((friction[-1] - friction[0]) / friction.mean())
    one_back = made.taken((made.at.direction > 0.0) | (np.arange(12) == 1))
    (same,) = drifts(one_back, np.zeros(1))
    assert same.change == pytest.approx((friction[-1] - friction[0]) / one_back.magnitudes(np.zeros(1)).mean())


def test_the_samples_behind_the_strokes_settle_with_them_about_the_offset():
    readings = run(approach(-0.3, LENGTHS[3]), count=30, scatter=0.0, offset=-7.0)
    readings = replace(readings, samples=tuple(np.array([force - 1.0, force + 2.0]) for force in readings.force))
    settled = settled_readings(readings, np.array([-7.0]))
    share = settled.share[0]
    assert share > 1.02
    for samples, force in zip(settled.readings.samples, readings.force, strict=True):
        assert samples == pytest.approx(-7.0 + share * (force + 7.0 + np.array([-1.0, 2.0])))
