"""The next readings: what they break, how much they help, and that a simulation of them agrees."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from scipy.stats import t as student_t

from seal_friction_ros.core.foundation.units import BAR
from seal_friction_ros.core.identification.candidate_laws import OperatingConditions, Variation, candidate_laws
from seal_friction_ros.core.identification.experiment_design import (
    RUN_TO_RUN,
    design_experiment,
    laws_not_beaten,
    repeated_run,
)
from seal_friction_ros.core.identification.fitting import LawFit, fit
from seal_friction_ros.core.identification.readings import FrictionReadings
from seal_friction_ros.core.identification.runs import BetweenRuns, between_runs
from seal_friction_ros.core.identification.selection import LawScore, NotScored, score_laws, with_velocity_terms
from seal_friction_ros.core.identification.validation import CrossValidation, cross_validate, jackknife_errors

BASE = next(law for law in candidate_laws(Variation()) if law.name == 'pressure_power_law_2_3')
VISCOUS, *_, ASYMMETRIC = with_velocity_terms(BASE, Variation())
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


# --- the criterion, as the documentation of `design_experiment` states it ---


def one_way(readings: FrictionReadings) -> FrictionReadings:
    """The second log in one direction only: it has no offset."""
    return readings.taken((readings.source == 0) | (readings.at.direction > 0.0))


def two_logs() -> FrictionReadings:
    rng = np.random.default_rng(3)
    return joined(collinear(rng), measured(np.linspace(5.0, 60.0, 10) * BAR, np.full(10, 0.02), rng, 1, -0.7))


class Criterion:
    """Standard error of a law over its range, by dense matrices with the offsets as parameters."""

    def __init__(self, readings: FrictionReadings, score: LawScore, design) -> None:
        self.law, self.readings = design.law, readings
        self.fit = score.fit
        self.scatter = self._scatter()
        offsets = np.column_stack([readings.at.direction * (readings.source == n) for n in self._with_offset()])
        self.had = without(self.slopes(readings.at) / readings.scale[:, None], offsets / readings.scale[:, None])
        estimates = [self.law.friction(readings.at, self.law.named(v)) for v in score.validation.parameters]
        jackknife = jackknife_errors(np.array(estimates) / readings.scale)
        leverage = np.sum(np.linalg.qr(self.fit.jacobian)[0] ** 2, axis=1)
        self.worth = max(float(np.mean(jackknife**2) / np.mean(self.scatter**2 * leverage)), 1.0)
        self.range = self.conditions([(p, v) for p in np.linspace(*design.pressures, 5)
                                      for v in np.linspace(*design.speeds, 5)])  # fmt: skip
        strongest = np.abs(self.slopes(self.range)).max(axis=0) / self.fit.friction(readings.at).mean()
        self.known = self.had / (self.worth * self.scatter**2) + np.diag(strongest**2)

    def _with_offset(self) -> list[int]:
        readings = self.readings
        return [n for n in np.unique(readings.source) if len(set(readings.at.direction[readings.source == n])) == 2]

    def _scatter(self) -> float:
        r = self.readings
        deviation = (r.magnitudes(self.fit.offsets) - self.fit.friction(r.at)) / r.scale
        return float(np.sqrt(np.sum(deviation**2) / (r.count - len(self.law.parameters) - len(self._with_offset()))))

    def conditions(self, points) -> OperatingConditions:
        pressure, speed = np.repeat(np.array(points), 2, axis=0).T
        direction = np.tile([-1.0, 1.0], len(points))
        return OperatingConditions(np.repeat(pressure[:, None], 2, axis=1), None, direction * speed, direction)

    def slopes(self, at) -> np.ndarray:
        """The law is linear in its parameters."""
        values = self.fit.values
        base = self.law.friction(at, values)
        names = [parameter.name for parameter in self.law.parameters]
        return np.column_stack([2.0 * (self.law.friction(at, values | {n: values[n] + 0.5}) - base) for n in names])

    def information(self, points=()) -> np.ndarray:
        """With proposed readings, which are one log with an offset."""
        if not points:
            return self.known
        at = self.conditions(points)
        friction = self.law.friction(at, self.fit.values).reshape(-1, 2).mean(axis=1)  # of both directions
        weight = np.repeat(friction, 2)
        if self.readings.are_samples:
            weight = np.full(len(weight), self.readings.scale[0])
        weight = weight[:, None] * self.scatter
        return self.known + without(self.slopes(at) / weight, at.direction[:, None] / weight)

    def error(self, points=()) -> float:
        slopes = self.slopes(self.range) / self.law.friction(self.range, self.fit.values)[:, None]
        return float(np.sqrt(np.mean(np.sum(slopes @ np.linalg.inv(self.information(points)) * slopes, axis=1))))

    def correlation(self, one: str, other: str, points=()) -> float:
        names = [parameter.name for parameter in self.law.parameters]
        covariance = np.linalg.inv(self.information(points))
        i, j = names.index(one), names.index(other)
        return float(covariance[i, j] / np.sqrt(covariance[i, i] * covariance[j, j]))


def without(rows, offsets) -> np.ndarray:
    """Information on the parameters where the offsets are unknown: that of the residuals of a regression on them."""
    left = rows - offsets @ np.linalg.lstsq(offsets, rows, rcond=None)[0]
    return left.T @ left


def condition(information) -> float:
    """Condition number of the columns with unit length."""
    size = np.sqrt(np.diag(information))
    return float(np.sqrt(np.linalg.cond(information / np.outer(size, size))))


@pytest.mark.parametrize(
    ('readings', 'law'),
    [
        (collinear(np.random.default_rng(0)), VISCOUS),
        (two_logs(), VISCOUS),
        (two_logs(), ASYMMETRIC),  # only there the offset goes together with a parameter
        (one_way(two_logs()), VISCOUS),
        (replace(two_logs(), are_samples=True), VISCOUS),
    ],
    ids=['one log', 'two logs', 'asymmetric', 'one of them one way', 'samples'],
)
def test_each_proposed_reading_is_that_which_reduces_the_error_most(readings, law):
    scores = score_laws([law], readings)
    design = design_experiment(scores, readings, NO_RUNS, 0.0, 3)
    expected = Criterion(readings, scores[0], design)
    grid = [(r.pressure, r.speed) for r in design_experiment(scores, readings, NO_RUNS, 0.0, 99).readings]
    chosen = [(r.pressure, r.speed) for r in design.readings]
    assert design.error_before == pytest.approx(expected.error(), rel=1e-4)
    assert design.parts['scatter'] == pytest.approx(expected.scatter)
    for count, reading in enumerate(design.readings):
        errors = {point: expected.error([*chosen[:count], point]) for point in grid if point not in chosen[:count]}
        assert errors[chosen[count]] == pytest.approx(min(errors.values()), rel=1e-5)
        assert reading.shrink == pytest.approx(errors[chosen[count]] / expected.error(), rel=1e-4)
    before, after = design.correlation_before, design.correlation_after
    assert before.correlation == pytest.approx(expected.correlation(before.one, before.other), rel=1e-3)
    assert after.correlation == pytest.approx(expected.correlation(before.one, before.other, chosen), rel=1e-3)
    falls = {  # of the variance inflation 1 / (1 - r^2)
        pair: (1.0 - expected.correlation(*pair, chosen) ** 2) / (1.0 - expected.correlation(*pair) ** 2)
        for pair in combinations([parameter.name for parameter in design.law.parameters], 2)
    }
    assert max(falls, key=falls.get) == (before.one, before.other)
    had = expected.had / (expected.worth * expected.scatter**2)
    new = expected.information(chosen) - expected.known
    assert design.condition_before == pytest.approx(condition(had), rel=1e-3)
    assert design.condition_after == pytest.approx(condition(had + new), rel=1e-3)


CONSTANT = next(law for law in candidate_laws(Variation()) if law.name == 'constant_coulomb')
LEVEL = 'coulomb_friction_at_any_pressure'


def left_out_alike(found, losses=(1.0, 1.0, 1.0, 1.0)):
    """Score of a law whose parameters are the same without any group."""
    vector = [found.values[p.name] for p in found.law.parameters]
    alike = CrossValidation(np.zeros(0), np.zeros(0), np.asarray(losses, float), np.tile(vector, (4, 1)))
    return LawScore(found.law, found, alike, alike.losses)


def constant(off, n=8):
    """Readings of 20 N of two seals that are alternately off by this share, with their fit."""
    direction = np.repeat([1.0, -1.0], n // 2)
    at = OperatingConditions(np.full((n, 2), 1e6), None, 0.02 * direction, direction)
    force = direction * 20.0 * (1.0 + off * np.tile([1.0, -1.0], n // 2)) + 3.0
    zeros = np.zeros(n, int)
    readings = FrictionReadings(at, force, zeros, np.arange(n) % 4, zeros, ('log',), 'block', False)
    found = LawFit(CONSTANT, {LEVEL: 10.0}, np.array([3.0]), np.full((n, 1), 0.1))
    return readings, left_out_alike(found)


def test_scatter_is_the_standard_deviation_about_the_law_less_what_is_fitted_and_a_hundredth_at_least():
    for off, expected in ((0.06, 0.06 * np.sqrt(8.0 / 6.0)), (0.001, 0.01)):  # one parameter and one offset
        readings, score = constant(off)
        found = design_experiment([score], readings, NO_RUNS, 0.0, 0)
        assert found.parts['scatter'] == pytest.approx(expected)


def test_a_law_gets_the_viscous_friction_and_the_friction_at_no_pressure_that_were_not_told():
    readings = measured(np.array([30.0, 30.0]) * BAR, np.full(2, 0.02), np.random.default_rng(0), scatter=0.0)
    (prior,) = candidate_laws(Variation(pressures=1))
    values = {'friction_at_one_bar': 1.5, 'pressure_exponent': 2.0 / 3.0, 'friction_at_no_pressure': 0.0}
    score = left_out_alike(LawFit(prior, values, np.zeros(1), np.ones((4, 1))))
    found = design_experiment([score], readings, NO_RUNS, 0.0, 1).law
    assert [p.name for p in found.parameters] == ['friction_at_no_pressure', 'friction_at_one_bar', 'viscous_friction']


def test_laws_disagree_by_their_largest_difference_over_their_mean():
    readings, _ = constant(0.06)
    scores = [
        left_out_alike(LawFit(CONSTANT, {LEVEL: level}, np.zeros(1), np.ones((8, 1)))) for level in (10.0, 11.0, 15.0)
    ]
    found = design_experiment(scores, readings, NO_RUNS, 0.0, 2)
    assert [reading.disagreement for reading in found.readings] == pytest.approx([5.0 / 12.0] * 2)
    alone = design_experiment(scores[:1], readings, NO_RUNS, 0.0, 2)
    assert [reading.disagreement for reading in alone.readings] == [0.0, 0.0]


def scored(law, losses, condition=1.0, **values):
    jacobian = np.eye(max(len(law.parameters), 3))[:, : len(law.parameters)] * condition
    inside = {p.name: 0.5 * (p.lower + p.upper) for p in law.parameters} | values
    return left_out_alike(LawFit(law, inside, np.zeros(1), jacobian), losses)


def designed_for(scores):
    return design_experiment(scores, held(), NO_RUNS, 0.0, 1).law


def test_the_richest_law_that_is_not_beaten_and_not_at_its_bound_is_designed_for():
    even = np.ones(4)
    scores = [scored(CONSTANT, 1.3 * even), scored(BASE, 1.05 * even), scored(VISCOUS, even)]
    near = laws_not_beaten([NotScored(CONSTANT, 'too few'), *scores])
    assert near == scores[1:]
    assert designed_for(near) is VISCOUS
    at_bound = scored(VISCOUS, even, friction_at_one_bar=VISCOUS.parameters[1].upper)
    constant_law = scored(CONSTANT, 1.05 * even)
    assert designed_for([constant_law, at_bound]).name == 'coulomb_viscous'
    assert designed_for([at_bound]) is VISCOUS
    without_effect = scored(VISCOUS, even, condition=0.0)
    assert laws_not_beaten([scores[1], without_effect]) == [scores[1]]
    assert laws_not_beaten([without_effect]) == [without_effect]
    wild = scored(BASE, [9.0, 0.1, 0.1, 0.1])  # twice as far off in the mean, though no test tells it
    assert laws_not_beaten([wild, scores[2]]) == [scores[2]]
    with pytest.raises(ValueError, match='no law could be fitted'):
        laws_not_beaten([NotScored(CONSTANT, 'too few')])


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
