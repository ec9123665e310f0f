"""The next readings: what they break, how much they help, and that a simulation of them agrees."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import t as student_t

from seal_friction_ros.core.foundation.units import BAR
from seal_friction_ros.core.identification.candidate_laws import OperatingConditions, Variation, candidate_laws
from seal_friction_ros.core.identification.experiment_design import RUN_TO_RUN, design_experiment, repeated_run
from seal_friction_ros.core.identification.friction_model import ModelFit, Told, fit_model
from seal_friction_ros.core.identification.readings import FrictionReadings
from seal_friction_ros.core.identification.runs import BetweenRuns, between_runs
from seal_friction_ros.core.identification.selection import with_velocity_terms

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
    at = OperatingConditions(np.repeat(pressure[:, None], 2, axis=1), direction * speed, direction)
    friction = VISCOUS.friction(at, TRUE) * (1.0 + scatter * rng.normal(size=len(pressure)))
    index = np.arange(len(pressure))
    return FrictionReadings(
        at, direction * friction + offset, np.full(len(index), source), index // 2 % 10,
        np.unique(pressure, return_inverse=True)[1], tuple('ab'[: source + 1]), 'block', False,
    )  # fmt: skip


def collinear(rng, repeats=4) -> FrictionReadings:
    """Speed follows pressure, within 6 %."""
    pressure = np.tile(np.linspace(5.0, 70.0, 10) * BAR, repeats)
    speed = pressure / (70.0 * BAR) * 0.1 * (1.0 + 0.06 * rng.normal(size=len(pressure)))
    return measured(pressure, speed, rng)


def joined(one: FrictionReadings, other: FrictionReadings) -> FrictionReadings:
    at = OperatingConditions(
        np.concatenate((one.at.pressure, other.at.pressure)),
        np.concatenate((one.at.velocity, other.at.velocity)), np.concatenate((one.at.direction, other.at.direction)),
    )  # fmt: skip
    columns = {n: np.concatenate((getattr(one, n), getattr(other, n))) for n in ('force', 'source', 'group')}
    level = np.unique(at.pressure[:, 0], return_inverse=True)[1]
    return replace(one, at=at, **columns, level=level, names=('a', 'b'))


def conditions(points) -> OperatingConditions:
    pressure, speed = np.repeat(np.array(points), 2, axis=0).T
    direction = np.tile([-1.0, 1.0], len(points))
    return OperatingConditions(np.repeat(pressure[:, None], 2, axis=1), direction * speed, direction)


def over_range(design) -> OperatingConditions:
    pressures, speeds = (np.linspace(*ends, 5) for ends in (design.pressures, design.speeds))
    return conditions([(p, v) for p in pressures for v in speeds])


def model_of(readings: FrictionReadings) -> ModelFit:
    return fit_model(
        readings, [slice(None)], Told(viscous=True, stribeck=True, asymmetry=True, areas=False), is_open=True
    )


@pytest.fixture(scope='module')
def designed():
    readings = collinear(np.random.default_rng(0))
    return readings, design_experiment(readings, NO_RUNS, 0.0)


def test_where_speed_follows_pressure_the_readings_leave_the_line(designed):
    readings, design = designed
    shares = [(r.pressure / (70.0 * BAR), r.speed / float(np.abs(readings.at.velocity).max())) for r in design.readings]
    assert max(abs(p - v) for p, v in shares) > 0.7
    assert sum(abs(p - v) > 0.3 for p, v in shares) >= len(shares) // 2
    assert all(0.0 <= p <= 1.0 and 0.0 < v <= 1.0 for p, v in shares)
    assert {*design.correlation.parameters} == PAIR
    assert abs(design.correlation.before) > 0.9 > 2.0 * abs(design.correlation.after)
    assert design.limit == 'law'


def test_the_predicted_effect_is_that_of_simulated_readings_on_the_error_of_the_friction():
    """Root mean square over forty simulations of what the friction is truly off by, before and after."""
    predicted, found = [], []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        readings = collinear(rng)
        design = design_experiment(readings, NO_RUNS, 0.0)
        pressure, speed = np.array([(r.pressure, r.speed) for r in design.readings]).T
        more = joined(readings, measured(pressure, speed, rng, source=1, offset=-0.7))
        at = over_range(design)
        true = VISCOUS.friction(at, TRUE)
        predicted.append((design.error_before, design.error_after))
        found.append([np.sqrt(np.mean((model_of(one).friction(at) / true - 1.0) ** 2)) for one in (readings, more)])
    predicted, found = (np.sqrt(np.mean(np.square(each), axis=0)) for each in (predicted, found))
    assert found == pytest.approx(predicted, rel=0.2)
    assert found[1] / found[0] == pytest.approx(predicted[1] / predicted[0], rel=0.2)
    assert predicted[1] < 0.2 * predicted[0]


def test_each_reading_helps_and_the_same_readings_give_the_same_design(designed):
    readings, design = designed
    shrinks = [1.0, *(r.shrink for r in design.readings)]
    assert np.all(np.diff(shrinks) < 0.0)
    assert shrinks[-1] == pytest.approx(design.shrink)
    again = design_experiment(readings, NO_RUNS, 0.0)
    assert again.readings == design.readings


def held(pressures=(20.0, 40.0, 60.0), speed=0.02) -> FrictionReadings:
    """One run of one speed, six strokes each way at each pressure."""
    pressure = np.repeat(np.array(pressures) * BAR, 6)
    return measured(pressure, np.full(len(pressure), speed), np.random.default_rng(1))


def test_of_one_run_at_three_pressures_the_spread_between_runs_limits_the_band():
    readings = held()
    model = model_of(readings)
    between = between_runs(readings, model.friction(readings.at), model.offsets)
    design = design_experiment(readings, between, between.of_band)
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
    design = design_experiment(readings, NO_RUNS, 0.15)
    assert not design.speed_is_varied
    assert design.limit == RUN_TO_RUN


@pytest.mark.parametrize('speed', [0.02, float('nan')])
def test_where_speed_was_not_varied_others_are_proposed(speed):
    readings = held(speed=speed)
    design = design_experiment(readings, NO_RUNS, 0.0)
    used = 0.01 if np.isnan(speed) else speed
    factors = {round(r.speed / used, 3) for r in design.readings}
    assert factors <= {0.2, 0.5, 1.0, 2.0, 5.0}
    assert {0.2, 5.0} <= factors
    assert design.speed_is_measured == np.isfinite(speed)
    assert not design.speed_is_varied
    assert design.shrink < 0.5


# --- readings to choose from ---


def every_reading(readings, of_band=0.0):
    """A design that proposes the whole grid."""
    return design_experiment(readings, NO_RUNS, of_band, 99)


@pytest.mark.parametrize(
    ('used', 'grid'),
    [
        ((0.01, 0.1601), (0.01, 0.02, 0.04, 0.08, 0.16)),
        ((0.0, 0.5), (5e-4, 2.81e-3, 0.0158, 0.0889, 0.5)),  # a thousandth of the fastest
        ((0.0, 0.05), (1e-4, 4.72e-4, 2.23e-3, 0.0105, 0.05)),  # no speed is slower than 0.1 mm/s
        ((0.0123456,), (2.46e-3, 6.17e-3, 0.0123, 0.0246, 0.0617)),  # three digits, not above
        ((0.02,), (0.004, 0.01, 0.02, 0.04, 0.1)),
        ((0.5,), (0.1, 0.25, 0.5, 1.0)),  # nor faster than 1 m/s
        ((2e-4,), (1e-4, 2e-4, 4e-4, 1e-3)),
        ((2.0,), (0.4, 1.0, 2.0)),  # but the one that was used
        ((5e-5,), (5e-5, 1e-4, 2.5e-4)),
    ],
)
def test_speeds_to_choose_from_go_from_slowest_to_fastest_or_are_multiples_of_the_only_one(used, grid):
    speed = np.resize(used, 36)
    found = every_reading(measured(np.repeat([20.0, 40.0, 60.0], 12) * BAR, speed, np.random.default_rng(1)))
    assert sorted({reading.speed for reading in found.readings}) == pytest.approx(grid, rel=0.01)
    pressures = sorted({reading.pressure / BAR for reading in found.readings})
    assert pressures == pytest.approx([0.0, 12.0, 24.0, 36.0, 48.0, 60.0])
    assert len(found.readings) == 6 * len(grid)
    assert found.speed_is_varied is (len(used) > 1)


@pytest.mark.parametrize(('fast', 'varied'), [(0.0149, False), (0.0151, True)])
def test_speed_is_varied_where_the_fastest_is_half_as_fast_again_in_one_direction(fast, varied):
    made = measured(np.repeat([20.0, 60.0], 20) * BAR, np.tile([0.01, fast], 20), np.random.default_rng(1))
    few = np.where(np.arange(80) < 3, 0.1, 0.01) * made.at.direction  # single strokes do not count
    one_way = np.where(made.at.direction > 0.0, made.at.velocity, -0.01)
    for velocity, expected in ((made.at.velocity, varied), (one_way, varied), (few, False)):
        found = every_reading(replace(made, at=made.at._replace(velocity=velocity)))
        assert found.speed_is_varied is expected


def test_a_repeated_run_takes_ten_of_the_pressures_each_at_its_middle_speed():
    levels = np.arange(12.0) * 3.0456 * BAR
    speed = np.tile([0.01, 0.02, 0.0901], 12)
    readings = measured(np.repeat(levels, 3), speed, np.random.default_rng(0))
    repeated = [reading for reading in every_reading(readings, 0.9).readings if reading.is_repeated]
    expected = [0.0, 3.04, 6.09, 12.1, 15.2, 18.2, 21.3, 27.4, 30.4, 33.5]  # bar, evenly, three digits, not above
    assert [reading.pressure / BAR for reading in repeated] == pytest.approx(expected)
    assert {reading.speed for reading in repeated} == {0.02}


# --- the criterion, as the documentation of `design_experiment` states it ---


def one_way(readings: FrictionReadings) -> FrictionReadings:
    """The second log in one direction only: it has no offset."""
    return readings.taken((readings.source == 0) | (readings.at.direction > 0.0))


def two_logs() -> FrictionReadings:
    rng = np.random.default_rng(3)
    return joined(collinear(rng), measured(np.linspace(5.0, 60.0, 10) * BAR, np.full(10, 0.02), rng, 1, -0.7))


def relative_error(model: ModelFit, design, points=()) -> float:
    """Standard error over the range by dense matrices, the offset of the new readings as a parameter."""
    told = np.flatnonzero(model.told)
    count, at = len(told), over_range(design)
    known = np.zeros((count + 1, count + 1))
    known[:-1, :-1] = np.linalg.inv(model.chosen.covariance[np.ix_(told, told)])
    if points:
        new = conditions(points)
        size = np.full(2 * len(points), model.size) if model.problem.readings.are_samples else model.friction(new)
        rows = np.column_stack((new.direction[:, None] * model.slopes(new)[:, told], np.ones(len(new.direction))))
        rows /= (size * model.scatter)[:, None]
        known += rows.T @ rows
    known[-1, -1] += 1e-12
    slopes = model.slopes(at)[:, told] / model.friction(at)[:, None]
    covariance = np.linalg.inv(known)[:-1, :-1]
    return float(np.sqrt(np.mean(np.einsum('ni,ij,nj->n', slopes, covariance, slopes))))


@pytest.mark.parametrize(
    'readings',
    [collinear(np.random.default_rng(2)), two_logs(), one_way(two_logs()), replace(two_logs(), are_samples=True)],
    ids=['one log', 'two logs', 'one of them one way', 'samples'],
)
def test_each_proposed_reading_is_that_which_reduces_the_error_most(readings):
    design = design_experiment(readings, NO_RUNS, 0.0, 3)
    asymmetry = len(np.unique(readings.source)) == 1 or (readings.source == 1).sum() != 10
    told = Told(viscous=True, stribeck=True, asymmetry=asymmetry, areas=False)
    model = fit_model(readings, [slice(None)], told, is_open=True)
    grid = [(r.pressure, r.speed) for r in design_experiment(readings, NO_RUNS, 0.0, 99).readings]
    chosen = [(r.pressure, r.speed) for r in design.readings]
    before = relative_error(model, design)
    assert design.error_before == pytest.approx(before, rel=1e-4)
    assert design.parts['scatter'] == model.scatter
    for count, reading in enumerate(design.readings):
        others = [point for point in grid if point not in chosen[:count]]
        errors = {point: relative_error(model, design, [*chosen[:count], point]) for point in others}
        assert errors[chosen[count]] == pytest.approx(min(errors.values()), rel=1e-5)
        assert reading.shrink == pytest.approx(errors[chosen[count]] / before, rel=1e-4)


def test_a_design_says_what_it_is_for(designed):
    readings, design = designed
    speed = np.abs(readings.at.velocity)
    assert design.pressures == (5.0 * BAR, 70.0 * BAR)
    assert design.speeds == pytest.approx((np.quantile(speed, 0.05), np.quantile(speed, 0.95)), rel=0.01)
    assert len(design.readings) == 8
    assert all(reading.directions == (-1, 1) for reading in design.readings)
    assert not any(reading.is_repeated for reading in design.readings)
    assert (design.speed_is_varied, design.speed_is_measured) == (True, True)
    assert design.parts['run to run'] == 0.0
    assert design.parts['scatter'] == pytest.approx(SCATTER, rel=0.2)
    assert design.limit == 'law'
    assert design.parts['law'] == pytest.approx(design.error_before, rel=0.01)  # where it is identified is the range
    assert design.error_after == pytest.approx(design.shrink * design.error_before)
    assert abs(design.correlation.after) < abs(design.correlation.before)
    assert design.repeated.freedom == len(readings.levels)
    stated = design_experiment(readings, None, 0.5, 3)
    assert stated.repeated is None
    assert stated.limit == 'run to run'
    assert all(reading.is_repeated for reading in stated.readings)  # speed was varied: nothing else is asked
    assert len(stated.readings) == 10
    none = design_experiment(replace(readings, are_samples=True), NO_RUNS, 0.0, 0)
    assert none.readings == ()
    assert none.error_after == none.error_before
    assert none.repeated.freedom == 1


def test_of_one_pressure_the_range_goes_down_to_none():
    readings = held((59.0, 60.0))
    low = design_experiment(readings, NO_RUNS, 0.0, 1)
    assert low.pressures == (0.0, 60.0 * BAR)
    assert design_experiment(held(), NO_RUNS, 0.0, 1).pressures == (20.0 * BAR, 60.0 * BAR)
