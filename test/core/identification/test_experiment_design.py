"""The next readings: what they break, how much they help, and that a simulation of them agrees."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import t as student_t

from seal_friction_ros.core.foundation.units import BAR
from seal_friction_ros.core.identification.candidate_laws import OperatingConditions, Variation, candidate_laws
from seal_friction_ros.core.identification.experiment_design import RUN_TO_RUN, design_experiment, repeated_run
from seal_friction_ros.core.identification.fitting import fit
from seal_friction_ros.core.identification.readings import FrictionReadings
from seal_friction_ros.core.identification.runs import BetweenRuns, between_runs
from seal_friction_ros.core.identification.selection import score_laws, with_velocity_terms
from seal_friction_ros.core.identification.validation import cross_validate, jackknife_errors

BASE = next(law for law in candidate_laws(Variation()) if law.name == 'pressure_power_law_2_3')
VISCOUS = with_velocity_terms(BASE, Variation())[0]
TRUE = {'friction_at_no_pressure': 5.0, 'friction_at_one_bar': 1.0, 'pressure_exponent': 2.0 / 3.0,
        'viscous_friction': 120.0}  # fmt: skip
SCATTER = 0.03
PAIR = {'friction_at_one_bar', 'viscous_friction'}
NO_RUNS = BetweenRuns(0.0, float('nan'), 0)


def measured(pressure, speed, rng, source=0, offset=1.5, scatter=SCATTER) -> FrictionReadings:
    """Readings of two seals at each pressure and speed in both directions, one by one left out by tenths."""
    pressure, speed = np.repeat(pressure, 2), np.repeat(speed, 2)
    direction = np.tile([-1.0, 1.0], len(pressure) // 2)
    at = OperatingConditions(np.repeat(pressure[:, None], 2, axis=1), None, direction * speed, direction)
    friction = VISCOUS.friction(at, TRUE) * (1.0 + scatter * rng.normal(size=len(pressure)))
    index = np.arange(len(pressure))
    return FrictionReadings(
        at, direction * friction + offset, np.full(len(index), source), index // 2 % 10,
        np.unique(pressure, return_inverse=True)[1], tuple('ab'[: source + 1]), 'block', False,
    )  # fmt: skip


def collinear(rng, repeats=4) -> FrictionReadings:
    """Speed follows pressure, within 8 %."""
    pressure = np.tile(np.linspace(5.0, 70.0, 10) * BAR, repeats)
    speed = pressure / (70.0 * BAR) * 0.1 * (1.0 + 0.08 * rng.normal(size=len(pressure)))
    return measured(pressure, speed, rng)


def joined(one: FrictionReadings, other: FrictionReadings) -> FrictionReadings:
    at = OperatingConditions(
        np.concatenate((one.at.pressure, other.at.pressure)), None,
        np.concatenate((one.at.velocity, other.at.velocity)), np.concatenate((one.at.direction, other.at.direction)),
    )  # fmt: skip
    columns = {n: np.concatenate((getattr(one, n), getattr(other, n))) for n in ('force', 'source', 'group')}
    level = np.unique(at.pressure[:, 0], return_inverse=True)[1]
    return replace(one, at=at, **columns, level=level, names=('a', 'b'))


def jackknife_over_range(readings: FrictionReadings, pressures, speeds) -> float:
    """Relative standard error of the law over the range, root mean square, by refits without each group."""
    found = fit(VISCOUS, readings, TRUE)
    parameters = cross_validate(VISCOUS, readings, found.values).parameters
    grid = [(p, v) for p in np.linspace(*pressures, 5) for v in np.linspace(*speeds, 5)]
    pressure, speed = np.array(grid).T
    at = OperatingConditions(np.repeat(pressure[:, None], 2, axis=1), None, speed, np.ones(len(grid)))
    each = np.array([VISCOUS.friction(at, VISCOUS.named(vector)) for vector in parameters])
    return float(np.sqrt(np.mean((jackknife_errors(each) / VISCOUS.friction(at, found.values)) ** 2)))


def correlation(readings: FrictionReadings) -> float:
    names = [p.name for p in VISCOUS.parameters]
    i, j = (names.index(name) for name in sorted(PAIR))
    return float(fit(VISCOUS, readings, TRUE).correlation[i, j])


@pytest.fixture(scope='module')
def designed():
    readings = collinear(np.random.default_rng(0))
    return readings, design_experiment(score_laws([VISCOUS], readings), readings, NO_RUNS, 0.0)


def test_where_speed_follows_pressure_the_readings_leave_the_line(designed):
    readings, design = designed
    shares = [(r.pressure / (70.0 * BAR), r.speed / float(np.abs(readings.at.velocity).max())) for r in design.readings]
    assert max(abs(p - v) for p, v in shares) > 0.7
    assert sum(abs(p - v) > 0.3 for p, v in shares) >= len(shares) // 2
    assert all(0.0 <= p <= 1.0 and 0.0 < v <= 1.0 for p, v in shares)
    assert {design.correlation_before.one, design.correlation_before.other} == PAIR
    assert abs(design.correlation_before.correlation) > 0.9 > abs(design.correlation_after.correlation)
    assert design.condition_after < design.condition_before
    assert design.limit == 'law'


def test_the_predicted_effect_is_that_of_simulated_readings():
    """Over ten simulations, since the jackknife over ten groups is itself uncertain by a quarter."""
    predicted, found = [], []
    for seed in range(10):
        rng = np.random.default_rng(seed)
        readings = collinear(rng)
        design = design_experiment(score_laws([VISCOUS], readings), readings, NO_RUNS, 0.0)
        pressure, speed = np.array([(r.pressure, r.speed) for r in design.readings]).T
        more = joined(readings, measured(pressure, speed, rng, source=1, offset=-0.7))
        ends = design.pressures, design.speeds
        predicted.append(design.shrink)
        found.append(jackknife_over_range(more, *ends) / jackknife_over_range(readings, *ends))
        assert abs(correlation(readings)) > 0.9 > abs(correlation(more))
        assert abs(correlation(more)) == pytest.approx(abs(design.correlation_after.correlation), abs=0.3)
    assert max(predicted) < 0.6
    ratios = np.array(found) / predicted
    assert np.all((ratios > 0.5) & (ratios < 2.0)), ratios
    assert 0.8 < np.median(ratios) < 1.25


def test_each_reading_helps_and_the_same_readings_give_the_same_design(designed):
    readings, design = designed
    shrinks = [1.0, *(r.shrink for r in design.readings)]
    assert np.all(np.diff(shrinks) < 0.0)
    assert shrinks[-1] == pytest.approx(design.shrink)
    again = design_experiment(score_laws([VISCOUS], readings), readings, NO_RUNS, 0.0)
    assert again.readings == design.readings


def held(pressures=(20.0, 40.0, 60.0), speed=0.02) -> FrictionReadings:
    """One run of one speed, six strokes each way at each pressure."""
    pressure = np.repeat(np.array(pressures) * BAR, 6)
    return measured(pressure, np.full(len(pressure), speed), np.random.default_rng(1))


def test_of_one_run_at_three_pressures_the_spread_between_runs_limits_the_band():
    readings = held()
    scores = score_laws([BASE], readings)
    between = between_runs(readings, scores[0].fit.friction(readings.at), scores[0].fit.offsets)
    design = design_experiment(scores, readings, between, between.of_band)
    assert design.limit == RUN_TO_RUN
    repeated = [r for r in design.readings if r.is_repeated]
    assert [r.pressure / BAR for r in repeated] == pytest.approx([20.0, 40.0, 60.0])
    assert design.repeated.freedom == 3
    assert design.repeated.shrink == pytest.approx(student_t.ppf(0.975, 11) / student_t.ppf(0.975, 8))
    assert design.repeated.shrink == pytest.approx(replace_freedom(between, 3).of_band / between.of_band)


def replace_freedom(between: BetweenRuns, more: int) -> BetweenRuns:
    return between._replace(freedom=between.freedom + more)


def test_runs_that_agree_shrink_the_spread_as_predicted_at_best():
    """`between_runs` of two runs without any scatter."""
    pressure = np.repeat(np.array([20.0, 40.0, 60.0]) * BAR, 6)
    speed = np.full(len(pressure), 0.02)
    one = measured(pressure, speed, np.random.default_rng(1), scatter=0.0)
    two = joined(one, measured(pressure, speed, np.random.default_rng(1), source=1, scatter=0.0))
    alone, both = (between_runs(r, VISCOUS.friction(r.at, TRUE), np.array([1.5, 1.5])) for r in (one, two))
    expected = repeated_run(alone, 3).shrink_at_best
    assert both.of_band / alone.of_band == pytest.approx(expected, rel=1e-6)


def test_a_speed_that_follows_the_direction_is_not_varied():
    readings = held()
    at = readings.at._replace(velocity=np.where(readings.at.direction > 0.0, 0.03, -0.01))
    readings = replace(readings, at=at)
    design = design_experiment(score_laws([BASE], readings), readings, NO_RUNS, 0.15)
    assert not design.speed_is_varied
    assert design.limit == RUN_TO_RUN


@pytest.mark.parametrize('speed', [0.02, float('nan')])
def test_where_speed_was_not_varied_others_are_proposed(speed):
    readings = held(speed=speed)
    design = design_experiment(score_laws([BASE], readings), readings, NO_RUNS, 0.0)
    used = 0.01 if np.isnan(speed) else speed
    factors = {round(r.speed / used, 3) for r in design.readings}
    assert factors <= {0.2, 0.5, 1.0, 2.0, 5.0}
    assert {0.2, 5.0} <= factors
    assert design.law.velocity_terms == ('viscous_friction',)
    assert design.speed_is_measured == np.isfinite(speed)
    assert not design.speed_is_varied
    assert design.shrink < 0.5
