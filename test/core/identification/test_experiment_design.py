"""The next readings: what they break, how much they help, and that a simulation of them agrees."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import t as student_t

from seal_friction_ros.core.foundation.units import BAR
from seal_friction_ros.core.identification.candidate_laws import OperatingConditions, Variation, candidate_laws
from seal_friction_ros.core.identification.experiment_design import (
    RUN_TO_RUN,
    _broken_pair,
    _condition,
    _correlated_pair,
    _correlation,
    _disagreements,
    _error,
    _greedy,
    _Information,
    _Model,
    _model,
    _prior,
    _range_points,
    _readings_worth_one,
    _relative_slopes,
    _richest,
    _scatter,
    _without_offsets,
    design_experiment,
    laws_not_beaten,
    repeated_run,
)
from seal_friction_ros.core.identification.fitting import LawFit, fit
from seal_friction_ros.core.identification.readings import FrictionReadings
from seal_friction_ros.core.identification.runs import BetweenRuns, between_runs
from seal_friction_ros.core.identification.selection import LawScore, score_laws, with_velocity_terms
from seal_friction_ros.core.identification.validation import CrossValidation, cross_validate, jackknife_errors

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


# --- readings to choose from ---


def every_reading(readings, of_band=0.0):
    """A design that proposes the whole grid."""
    return design_experiment(score_laws([BASE], held()), readings, NO_RUNS, of_band, 99)


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


# --- information ---


def test_information_with_an_unknown_offset_is_the_inverse_of_the_covariance_of_the_parameters():
    rng = np.random.default_rng(3)
    rows, offsets = rng.normal(size=(9, 2)), rng.normal(size=9)
    found = _Information(np.zeros((2, 2)), np.zeros(2), 0.0)
    assert found.matrix.tolist() == np.zeros((2, 2)).tolist()
    found = found.plus(rows[:4], offsets[:4]).plus(rows[4:], offsets[4:])
    everything = np.column_stack((rows, offsets))
    covariance = np.linalg.inv(everything.T @ everything)[:2, :2]
    assert np.linalg.inv(found.matrix) == pytest.approx(covariance)
    without = _Information(np.zeros((2, 2)), np.zeros(2), 0.0).plus(rows, np.zeros(9))
    assert without.matrix == pytest.approx(rows.T @ rows)


def test_the_error_is_the_root_mean_square_of_the_standard_errors():
    slopes = np.array([[1.0, 0.0], [0.0, 3.0]])
    assert _error(slopes, np.diag([4.0, 16.0])) == pytest.approx(np.sqrt((1.0 / 4.0 + 9.0 / 16.0) / 2.0))
    information = np.array([[4.0, 1.0], [1.0, 9.0]])
    expected = [g @ np.linalg.inv(information) @ g for g in slopes]
    assert _error(slopes, information) == pytest.approx(np.sqrt(np.mean(expected)))


def tied(r, other=0.0):
    """Information on three parameters of unlike size; the correlation of the first two is -r, of the last two 0."""
    size = np.diag([1.0, 10.0, 0.1])
    return size @ np.array([[1.0, r, 0.0], [r, 1.0, other], [0.0, other, 1.0]]) @ size


def test_the_pair_is_that_whose_correlation_falls_most():
    assert _correlation(tied(0.9))[0, 1] == pytest.approx(-0.9)
    assert np.diag(_correlation(tied(0.9, 0.1))) == pytest.approx(np.ones(3))
    assert _broken_pair(tied(0.9), tied(0.1)) == (0, 1)
    assert _broken_pair(tied(0.1, 0.9), tied(0.3, 0.1)) == (1, 2)
    assert _broken_pair(tied(0.5, 0.8), tied(0.0, 0.75)) == (0, 1)
    assert _broken_pair(np.eye(1), np.eye(1)) is None
    before, after = _correlated_pair(('a', 'b', 'c'), tied(0.9), tied(0.1))
    assert (before, after) == (('a', 'b', pytest.approx(-0.9)), ('a', 'b', pytest.approx(-0.1)))
    assert _correlated_pair(('a',), np.eye(1), np.eye(1)) == [None, None]


def test_the_condition_number_is_that_of_columns_of_unit_length():
    rng = np.random.default_rng(5)
    jacobian = rng.normal(size=(9, 3)) * [1.0, 1e3, 1e-3]
    unit = jacobian / np.linalg.norm(jacobian, axis=0)
    assert _condition(jacobian.T @ jacobian) == pytest.approx(np.linalg.cond(unit))
    assert _condition(np.diag([1.0, 0.0])) == np.inf
    assert _condition(np.ones((2, 2))) == np.inf
    near = 1.0 - 1e-13
    assert _condition(np.array([[1.0, near], [near, 1.0]])) == pytest.approx(np.sqrt(2e13), rel=0.01)
    nearer = 1.0 - 3e-15
    assert _condition(np.array([[1.0, nearer], [nearer, 1.0]])) == np.inf


# --- the law linearised ---

KNOWN = TRUE | {'pressure_exponent': 2.0 / 3.0}


def linearised(values=KNOWN, held_scale=float('nan'), mean=100.0, law=VISCOUS):
    return _Model(law, values, np.full(len(law.parameters), 1e-4), 2, mean, held_scale)


def test_slopes_of_the_friction_are_those_of_its_formula():
    """Two seals: 2 f_0 + 2 F_1 (P / 1 bar)^(2/3) + 2 sigma v."""
    at = linearised().conditions([(8.0 * BAR, 0.03), (27.0 * BAR, 0.05)])
    assert at.pressure.tolist() == [[8.0 * BAR] * 2] * 2 + [[27.0 * BAR] * 2] * 2
    assert at.direction.tolist() == [-1.0, 1.0] * 2
    assert at.velocity.tolist() == [-0.03, 0.03, -0.05, 0.05]
    names = [parameter.name for parameter in VISCOUS.parameters]
    expected = {
        'friction_at_no_pressure': [2.0] * 4, 'friction_at_one_bar': [8.0, 8.0, 18.0, 18.0],
        'viscous_friction': [0.06, 0.06, 0.1, 0.1],
    }  # fmt: skip
    assert linearised().slopes(at) == pytest.approx(np.column_stack([expected[name] for name in names]), rel=1e-6)
    at_bound = KNOWN | {p.name: p.upper for p in VISCOUS.parameters if p.name == 'friction_at_one_bar'}
    assert linearised(at_bound).slopes(at)[:, names.index('friction_at_one_bar')] == pytest.approx(
        [8.0, 8.0, 18.0, 18.0], rel=1e-3
    )  # from inside
    friction = np.array([10.0 + 8.0 + 7.2] * 2 + [10.0 + 18.0 + 12.0] * 2)
    assert linearised().friction(at) == pytest.approx(friction)
    assert linearised(mean=600.0).friction(at) == pytest.approx([30.0, 30.0, 40.0, 40.0])  # 5 % of the mean at least
    assert linearised().scale(at) == pytest.approx(friction)
    assert linearised(held_scale=70.0).scale(at).tolist() == [70.0] * 4
    uneven = linearised(KNOWN | {'asymmetry': 0.25}, law=ASYMMETRIC)
    out, back = uneven.friction(at)[:2][::-1]
    assert out != pytest.approx(back, rel=0.1)
    assert uneven.scale(at)[:2] == pytest.approx([(out + back) / 2.0] * 2)  # both directions have one divisor
    grid = linearised().conditions(_range_points((8.0 * BAR, 27.0 * BAR), (0.03, 0.05)))
    relative = linearised().slopes(grid) / linearised().friction(grid)[:, np.newaxis]
    assert _relative_slopes(linearised(), (8.0 * BAR, 27.0 * BAR), (0.03, 0.05)) == pytest.approx(relative)


def test_before_any_reading_each_parameter_changes_the_friction_by_all_of_it():
    """Mean friction 100 N; the rise with 27 bar changes it by at most 18 N each unit."""
    names = [parameter.name for parameter in VISCOUS.parameters]
    found = _prior(linearised(), 0.0, 27.0 * BAR, (0.01, 0.05))
    assert found == pytest.approx(np.diag(np.diag(found)))
    strongest = {'friction_at_no_pressure': 2.0, 'friction_at_one_bar': 18.0, 'viscous_friction': 0.1}
    assert np.diag(found) == pytest.approx([(strongest[name] / 100.0) ** 2 for name in names], rel=1e-5)


CONSTANT = next(law for law in candidate_laws(Variation()) if law.name == 'constant_coulomb')
ASYMMETRIC = with_velocity_terms(BASE, Variation())[-1]
LEVEL = 'coulomb_friction_at_any_pressure'


def constant(off, n=8):
    """Readings of 20 N of two seals that are alternately off by this share, with their fit."""
    direction = np.repeat([1.0, -1.0], n // 2)
    at = OperatingConditions(np.full((n, 2), 1e6), None, 0.02 * direction, direction)
    force = direction * 20.0 * (1.0 + off * np.tile([1.0, -1.0], n // 2)) + 3.0
    zeros = np.zeros(n, int)
    readings = FrictionReadings(at, force, zeros, np.arange(n) % 4, zeros, ('log',), 'block', False)
    found = LawFit(CONSTANT, {LEVEL: 10.0}, np.array([3.0]), np.full((n, 1), 0.1))
    return readings, LawScore(CONSTANT, found, losses=np.ones(4))


def test_scatter_is_the_standard_deviation_about_the_law_less_what_is_fitted_and_a_hundredth_at_least():
    readings, score = constant(0.06)
    assert _scatter(score, readings) == pytest.approx(0.06 * np.sqrt(8.0 / 6.0))  # one parameter and one offset
    readings, score = constant(0.001)
    assert _scatter(score, readings) == 0.01


def test_readings_are_worth_as_many_independent_ones_as_the_jackknife_says():
    readings, score = constant(0.06)
    assert _readings_worth_one(score, readings, 0.06) == 1.0  # there is no jackknife
    estimates = np.array([[9.0], [10.0], [11.0], [10.0]])
    validation = CrossValidation(np.zeros(8), np.zeros(8), np.ones(4), estimates)
    # Of two seals 2 N out of 20 N: jackknife variance 3/4 * 2 * 0.1^2; of 8 independent readings 0.06^2 / 8 each.
    expected = 0.75 * 2.0 * 0.1**2 / (0.06**2 / 8.0)
    assert _readings_worth_one(replace(score, validation=validation), readings, 0.06) == pytest.approx(expected)
    same = replace(validation, parameters=np.full((4, 1), 10.0))
    assert _readings_worth_one(replace(score, validation=same), readings, 0.06) == 1.0


def test_without_offsets_the_derivatives_are_those_of_a_fit_with_an_offset():
    rng = np.random.default_rng(2)
    readings = measured(np.linspace(5.0, 60.0, 6) * BAR, np.full(6, 0.02), rng)
    slopes = rng.normal(size=(12, 2))
    rows, column = slopes / readings.scale[:, np.newaxis], readings.at.direction / readings.scale
    expected = rows - np.outer(column, column @ rows) / (column @ column)
    assert _without_offsets(slopes, readings) == pytest.approx(expected)
    one_way = readings.taken(readings.at.direction > 0.0)
    part = slopes[readings.at.direction > 0.0]
    assert _without_offsets(part, one_way) == pytest.approx(part / one_way.scale[:, np.newaxis])


def test_a_law_gets_the_viscous_friction_and_the_friction_at_no_pressure_that_were_not_told():
    readings = measured(np.array([30.0, 30.0]) * BAR, np.full(2, 0.02), np.random.default_rng(0), scatter=0.0)
    (prior,) = candidate_laws(Variation(pressures=1))
    values = {'friction_at_one_bar': 1.5, 'pressure_exponent': 2.0 / 3.0, 'friction_at_no_pressure': 0.0}
    score = LawScore(prior, LawFit(prior, values, np.zeros(1), np.ones((4, 1))))
    found = _model(score, readings, readings.at)
    names = [p.name for p in found.law.parameters]
    assert names == ['friction_at_no_pressure', 'friction_at_one_bar', 'viscous_friction']
    assert [found.values[name] for name in names] == [0.0, 1.5, 0.0]
    friction = 2.0 * 1.5 * 30.0 ** (2.0 / 3.0)
    assert (found.mean, found.seals) == (pytest.approx(friction), 2)
    typical = readings.at.typical(friction / 2.0)
    starts = [p.start(typical) for p in found.law.parameters]
    assert found.steps == pytest.approx([1e-7 * abs(starts[0]), 1.5e-4, 1e-7 * abs(starts[2])])
    assert np.isnan(found.held_scale)
    swept = replace(readings, are_samples=True)
    assert _model(score, swept, swept.at).held_scale == pytest.approx(np.abs(readings.force).mean())
    full = LawScore(VISCOUS, LawFit(VISCOUS, KNOWN, np.zeros(1), np.ones((4, 3))))
    same = _model(full, readings, readings.at)
    assert same.law is VISCOUS
    assert same.values == KNOWN


def test_laws_disagree_by_their_largest_difference_over_their_mean():
    def of(level):
        return LawScore(CONSTANT, LawFit(CONSTANT, {LEVEL: level}, np.zeros(1), np.ones((4, 1))))

    points = [(1e6, 0.02), (2e6, 0.02)]
    assert _disagreements([of(10.0), of(11.0), of(15.0)], linearised(), points) == pytest.approx([5.0 / 12.0] * 2)
    assert _disagreements([of(10.0), of(15.0)], linearised(mean=1000.0), points) == pytest.approx([10.0 / 50.0] * 2)
    uneven = LawScore(ASYMMETRIC, LawFit(ASYMMETRIC, KNOWN | {'asymmetry': 0.25, 'viscous_friction': 0.0},
                                         np.zeros(1), np.ones((4, 1))))  # fmt: skip
    same = LawScore(BASE, LawFit(BASE, KNOWN, np.zeros(1), np.ones((4, 1))))
    (one,) = _disagreements([uneven, same], linearised(), points[:1])
    at = linearised().conditions(points[:1])
    both = np.array([uneven.fit.friction(at), same.fit.friction(at)])
    assert one == pytest.approx((np.ptp(both, axis=0) / both.mean(axis=0)).max())
    assert _disagreements([of(10.0)], linearised(), []) == []


def scored(law, losses, condition=1.0, **values):
    jacobian = np.eye(max(len(law.parameters), 3))[:, : len(law.parameters)] * condition
    inside = {p.name: 0.5 * (p.lower + p.upper) for p in law.parameters} | values
    return LawScore(law, LawFit(law, inside, np.zeros(1), jacobian), losses=np.asarray(losses, float))


def test_the_richest_law_that_is_not_beaten_and_not_at_its_bound_is_designed_for():
    even = np.ones(4)
    scores = [scored(CONSTANT, 1.3 * even), scored(BASE, 1.05 * even), scored(VISCOUS, even)]
    near = laws_not_beaten([LawScore(CONSTANT, why_not='too few'), *scores])
    assert near == scores[1:]
    assert _richest(near) is scores[2]
    at_bound = scored(VISCOUS, even, friction_at_one_bar=VISCOUS.parameters[1].upper)
    assert _richest([scores[1], at_bound]) is scores[1]
    assert _richest([at_bound]) is at_bound
    other = scored(VISCOUS, 0.9 * even)
    assert _richest([scores[2], other]) is other
    without_effect = scored(VISCOUS, even, condition=0.0)
    assert laws_not_beaten([scores[1], without_effect]) == [scores[1]]
    assert laws_not_beaten([without_effect]) == [without_effect]
    wild = scored(BASE, [9.0, 0.1, 0.1, 0.1])  # twice as far off in the mean, though no test tells it
    assert laws_not_beaten([wild, scores[2]]) == [scores[2]]
    with pytest.raises(ValueError, match='no law was fitted'):
        laws_not_beaten([LawScore(CONSTANT, why_not='too few')])


# --- the design ---


def test_the_points_that_come_first_are_taken_in_turn_and_then_the_best_of_the_grid():
    model = linearised()
    slopes = _relative_slopes(model, (0.0, 27.0 * BAR), (0.01, 0.05))
    prior = _prior(model, 0.0, 27.0 * BAR, (0.01, 0.05))
    first, grid = [(8.0 * BAR, 0.02)], [(0.0, 0.01), (27.0 * BAR, 0.05), (27.0 * BAR, 0.01)]
    points, errors, information = _greedy(model, slopes, prior, 0.05, first, grid, 2)
    assert points[0] == first[0]
    assert len(points) == 3
    assert len(set(points)) == 3

    def error(chosen):
        at = model.conditions(chosen)
        weight = 0.05 * model.friction(at)
        rows = np.column_stack((model.slopes(at), at.direction)) / weight[:, np.newaxis]
        full = rows.T @ rows
        matrix = full[:3, :3] - np.outer(full[:3, 3], full[3, :3]) / full[3, 3]
        return _error(slopes, prior + matrix), matrix

    for count in (1, 2, 3):
        assert errors[count - 1] == pytest.approx(error(points[:count])[0])
    second = min(grid, key=lambda point: error([*first, point])[0])
    assert points[1] == second
    third = min((point for point in grid if point != second), key=lambda point: error([*first, second, point])[0])
    assert points[2] == third
    assert information == pytest.approx(error(points)[1])
    assert len(_greedy(model, slopes, prior, 0.05, first, grid, 9)[0]) == 4
    assert _greedy(model, slopes, prior, 0.05, [], [], 9)[:2] == ([], [])


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
    assert design.condition_after < 0.5 * design.condition_before
    found = fit(VISCOUS, readings, TRUE)
    assert design.condition_before == pytest.approx(found.condition_number, rel=0.02)
    assert abs(design.correlation_before.correlation) == pytest.approx(abs(correlation(readings)), abs=0.02)
    assert abs(design.correlation_after.correlation) < abs(design.correlation_before.correlation)
    assert design.repeated.freedom == len(readings.levels)
    stated = design_experiment(score_laws([VISCOUS], readings), readings, None, 0.5, 3)
    assert stated.repeated is None
    assert stated.limit == 'run to run'
    assert all(reading.is_repeated for reading in stated.readings)  # speed was varied: nothing else is asked
    assert len(stated.readings) == 10
    none = design_experiment(score_laws([VISCOUS], readings), replace(readings, are_samples=True), NO_RUNS, 0.0, 0)
    assert none.readings == ()
    assert none.error_after == none.error_before
    assert none.repeated.freedom == 1


def test_of_one_pressure_the_range_goes_down_to_none():
    readings = held((59.0, 60.0))
    low = design_experiment(score_laws([BASE], held()), readings, NO_RUNS, 0.0, 1)
    assert low.pressures == (0.0, 60.0 * BAR)
    assert design_experiment(score_laws([BASE], held()), held(), NO_RUNS, 0.0, 1).pressures == (20.0 * BAR, 60.0 * BAR)
