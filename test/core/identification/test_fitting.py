"""Identification on readings whose law is known: what it finds, what it does not claim, and how sure it is."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import optimize, stats

from seal_friction_ros.core.foundation.normal_distribution import BAND_95
from seal_friction_ros.core.identification.breakaway import fit_breakaway
from seal_friction_ros.core.identification.candidate_laws import (
    OperatingConditions,
    Variation,
    candidate_laws,
    with_velocity_terms,
)
from seal_friction_ros.core.identification.diagnostics import (
    collinear_regressors,
    outlying_level,
    repeatability,
    shared_levels,
    traded_off,
)
from seal_friction_ros.core.identification.fitting import fit
from seal_friction_ros.core.identification.readings import FrictionReadings
from seal_friction_ros.core.identification.runs import PRIOR_STD, between_runs
from seal_friction_ros.core.identification.selection import (
    choose_anew,
    is_beaten,
    recommended,
    rises_over_pressures,
    score_ladder,
    score_laws,
)
from seal_friction_ros.core.identification.validation import (
    band_coverage,
    cross_validate,
    jackknife_errors,
    plain_mean,
    prediction_uncertainty,
)

POWER = {'friction_at_no_pressure': 5.0, 'friction_at_one_bar': 0.9, 'pressure_exponent': 0.65}
CONSTANT = 'coulomb_friction_at_any_pressure'
LAWS = {law.name: law for law in candidate_laws(Variation())}
BASES = tuple(LAWS.values())
ELASTIC, LAW = LAWS['pressure_power_law_2_3'], LAWS['pressure_power_law']
LAWS |= {law.name: law for law in with_velocity_terms(LAW, Variation())}


def noted(scatter=0.0, seed=0, law=LAW, values=POWER, offset=0.0, pressures=11, count=3, seals=2, test_scatter=0.0):
    """Noted readings of ``count`` tests at even pressures to 70 bar, in both directions; scatter is relative."""
    rng = np.random.default_rng(seed)
    pressure = np.repeat(np.tile(np.linspace(0.0, 7e6, pressures), count), 2)
    test = np.repeat(np.arange(count), 2 * pressures)
    n = len(pressure)
    direction = np.tile([1.0, -1.0], n // 2)
    at = OperatingConditions(np.repeat(pressure[:, np.newaxis], seals, axis=1), 0.01 * direction, direction)
    shares = 1.0 + scatter * rng.normal(size=n) + test_scatter * rng.normal(size=count)[test]
    return FrictionReadings(
        at=at,
        force=offset + direction * law.friction(at, values) * shares,
        source=np.zeros(n, dtype=int),
        group=test,
        level=np.tile(np.repeat(np.arange(pressures), 2), count),
        names=('made',),
        left_out_by='test',
        are_samples=False,
    )


def swept(values, law, scatter=20.0, seed=0, n=3000, tied=False, offset=200.0, name='log', least=0.01):
    """Samples of a swept log of two seals; ``tied``: the pressure follows the speed."""
    rng = np.random.default_rng(seed)
    time = np.arange(n) / 50.0
    velocity = (least + 0.4 * np.abs(np.sin(0.13 * time))) * np.where(np.sin(0.7 * time) >= 0.0, 1.0, -1.0)
    free = 5e6 * (1.0 + np.sin(0.05 * time))
    pressure = 1e6 + 2e7 * np.abs(velocity) + 1e5 * rng.normal(size=n) if tied else free
    both = np.column_stack((pressure, 0.5 * pressure))
    at = OperatingConditions(both, velocity, np.sign(velocity))
    return FrictionReadings(
        at=at,
        force=offset + np.sign(velocity) * law.friction(at, values) + scatter * rng.normal(size=n),
        source=np.zeros(n, dtype=int),
        group=np.arange(n) * 10 // n,
        level=np.zeros(n, dtype=int),
        names=(name,),
        left_out_by='block',
        are_samples=True,
    )


# --- fits ---


@pytest.mark.parametrize('name', ['constant_coulomb', 'coulomb_viscous', 'coulomb_stribeck', 'coulomb_asymmetric',
                                  'pressure_power_law', 'pressure_power_law_viscous', 'pressure_power_law_stribeck',
                                  'pressure_power_law_asymmetric'])  # fmt: skip
def test_a_law_is_found_again_from_what_it_made_with_its_offset(name):
    truth = POWER | {CONSTANT: 90.0, 'viscous_friction': 800.0, 'stribeck_friction': 60.0,
                     'stribeck_velocity': 0.03, 'asymmetry': 0.15}  # fmt: skip
    law = LAWS[name]
    found = fit(law, swept(truth, law, scatter=0.0))
    assert found.offsets == pytest.approx([200.0], abs=0.01)
    assert {p: found.values[p] for p in found.values} == pytest.approx({p: truth[p] for p in found.values}, rel=1e-3)


def test_a_linear_law_and_the_offset_are_the_joint_least_squares_solution():
    """With the directions unbalanced over the pressures, so that the weights of the readings decide."""
    law, readings = LAWS['pressure_power_law_1'], noted(scatter=0.1, offset=20.0)
    readings = readings.taken((readings.at.direction > 0.0) | (readings.level % 3 > 0))
    names = [parameter.name for parameter in law.parameters]
    terms = [law.friction(readings.at, law.named(unit)) for unit in np.eye(len(names))]
    columns = np.column_stack([*terms, readings.at.direction]) / readings.scale[:, None]
    measured = readings.at.direction * readings.force / readings.scale
    *values, offset = np.linalg.lstsq(columns, measured, rcond=None)[0]
    found = fit(law, readings)
    assert [found.values[name] for name in names] == pytest.approx(values, rel=1e-9)
    assert found.offsets == pytest.approx([offset], rel=1e-9)


def test_a_term_that_is_not_there_is_exactly_nothing():
    falling = {
        CONSTANT: 200.0,
        'stribeck_friction': 100.0,
        'stribeck_velocity': 0.3,
        'viscous_friction': 0.0,
    }
    found = fit(LAWS['coulomb_viscous'], swept(falling, LAWS['coulomb_stribeck']))
    assert found.values['viscous_friction'] == 0.0  # friction falls with speed: a negative viscous term is no friction


@pytest.mark.long
def test_standard_errors_are_those_of_repeating_it_all():
    estimates, errors = [], []
    for seed in range(60):
        readings = noted(scatter=0.08, seed=seed, count=6)
        found = fit(LAW, readings)
        estimates.append(found.values['friction_at_no_pressure'])
        each = cross_validate(LAW, readings, found.values).values
        errors.append(jackknife_errors(np.array([[one['friction_at_no_pressure']] for one in each]))[0])
    assert np.sqrt(np.mean(np.square(errors))) == pytest.approx(np.std(estimates), rel=0.35)


def test_standard_errors_know_that_the_readings_of_a_test_are_off_together():
    """Readings that share a scatter of 10 % tell the level no better than the number of tests allows."""
    constant = LAWS['constant_coulomb']
    errors = []
    for seed in range(40):
        readings = noted(scatter=0.01, test_scatter=0.1, seed=seed, law=constant, values={CONSTANT: 20.0})
        found = fit(constant, readings)
        each = cross_validate(constant, readings, found.values).values
        errors.append(jackknife_errors(np.array([[one[CONSTANT]] for one in each]))[0] / 20.0)
    assert np.sqrt(np.mean(np.square(errors))) == pytest.approx(0.1 / np.sqrt(3.0), rel=0.25)


# --- which law ---


def laws(*names):
    return [LAWS[name] for name in names]


def test_constant_friction_gets_a_constant():
    readings = noted(scatter=0.08, law=LAWS['constant_coulomb'], values={CONSTANT: 20.0})
    scores = score_laws(laws('constant_coulomb', 'pressure_power_law', 'pressure_power_law_asymmetric'), readings)
    assert recommended(scores).law.name == 'constant_coulomb'


@pytest.mark.parametrize('seed', range(5))
def test_friction_that_follows_pressure_gets_that_and_no_asymmetry(seed):
    scores = score_laws(laws('constant_coulomb', 'pressure_power_law', 'pressure_power_law_asymmetric'),
                   noted(scatter=0.08, seed=seed))  # fmt: skip
    assert recommended(scores).law.name == 'pressure_power_law'


def test_a_stribeck_term_pays_where_it_is_there_and_nowhere_else():
    values = {CONSTANT: 100.0, 'viscous_friction': 500.0, 'stribeck_friction': 200.0,
              'stribeck_velocity': 0.05}  # fmt: skip
    names = ('constant_coulomb', 'coulomb_viscous', 'coulomb_stribeck')
    there = score_laws(laws(*names), swept(values, LAWS['coulomb_stribeck']))
    absent = score_laws(laws(*names), swept(values, LAWS['coulomb_viscous']))
    assert recommended(there).law.name == 'coulomb_stribeck'
    assert recommended(absent).law.name == 'coulomb_viscous'


def test_a_law_needs_more_pressures_than_parameters():
    readings = noted(pressures=2)
    (score,) = score_laws([LAW], readings)
    assert '3 parameters need 3 pressures, there are 2' in score.why_not
    with pytest.raises(ValueError, match='no law could be fitted'):
        recommended([score])


def test_beaten_is_only_what_is_worse_beyond_the_noise_and_by_enough():
    best = np.array([1.0, 1.1, 0.9, 1.0])
    assert is_beaten(best + 0.5, best)
    assert not is_beaten(best + 0.1, best)
    assert not is_beaten(best + np.array([2.0, -1.5, 1.0, -0.5]), best)
    assert not is_beaten(best, best)


@pytest.mark.parametrize('groups', [2, 4, 7])
def test_beaten_beyond_the_noise_is_a_one_sided_paired_t_test_at_95_percent(groups: int):
    best = np.linspace(0.9, 1.1, groups)
    scatter = np.random.default_rng(groups).normal(size=groups)
    scatter -= scatter.mean()
    for share, beaten in ((0.99, False), (1.01, True)):
        # The mean that this p-value belongs to, by the test of SciPy.
        mean = optimize.brentq(
            lambda m: stats.ttest_1samp(scatter + m, 0.0, alternative='greater').pvalue - 0.05, 0.01, 99
        )
        assert is_beaten(best + scatter + share * mean, best) is beaten


def test_beaten_by_enough_is_half_the_loss_over_the_number_of_groups():
    best = np.array([1.0, 1.1, 0.9, 1.0])
    for more, beaten in ((0.142, False), (0.144, True)):  # of four groups an eighth: 1 / 0.875 - 1 = 0.143
        assert is_beaten(best + more, best) is beaten


def test_leaving_out_predicts_what_was_not_seen():
    """One wild test is badly predicted by the others, however many readings it has."""
    readings = noted(scatter=0.02)
    wild = readings.group == 1
    force = np.where(wild, 1.5 * readings.force, readings.force)
    readings = FrictionReadings(**{**vars(noted(scatter=0.02)), 'force': force})
    found = fit(LAW, readings)
    validation = cross_validate(LAW, readings, found.values)
    assert np.argmax(validation.losses) == 1
    assert validation.losses[1] > 0.25
    assert validation.predicted[wild] + validation.deviation[wild] == pytest.approx(
        (readings.at.direction * (readings.force - found.offsets[0]))[wild], rel=0.05
    )


def test_plain_mean_is_the_mean_of_the_other_tests():
    readings = noted(scatter=0.05)
    reference = plain_mean(readings)
    out = (readings.group == 2) & (readings.level == 4)
    others = (readings.group != 2) & (readings.level == 4)
    assert reference.predicted[out] == pytest.approx(np.full(2, np.abs(readings.force[others]).mean()), rel=0.01)


# --- how sure ---


@pytest.mark.parametrize('scatter', [0.03, 0.08, 0.15])
def test_the_band_holds_for_new_readings(scatter):
    """The claim of `coulomb_friction_std`, over many identifications and fresh readings of each."""
    inside = total = 0
    for seed in range(25):
        readings = noted(scatter=scatter, seed=seed)
        found = fit(LAW, readings)
        validation = cross_validate(LAW, readings, found.values)
        spread = prediction_uncertainty(validation.predicted, validation.deviation, 3)
        new = noted(scatter=scatter, seed=1000 + seed)
        friction = found.friction(new.at)
        inside += np.count_nonzero(np.abs(np.abs(new.force) - friction) <= BAND_95 * spread.std(friction))
        total += new.count
    assert 0.93 <= inside / total <= 0.99


def test_band_coverage_is_that_of_readings_that_neither_law_nor_band_had_seen():
    shares = []
    for seed in range(10):
        readings = noted(scatter=0.08, seed=seed)
        shares.append(band_coverage(LAW, readings, fit(LAW, readings).values))
    assert 0.92 <= np.mean(shares) <= 0.99


def test_a_spread_that_does_not_scale_is_absolute_and_one_that_does_is_relative():
    rng = np.random.default_rng(5)
    friction = np.linspace(5.0, 100.0, 4000)
    absolute = prediction_uncertainty(friction, 3.0 * rng.normal(size=4000), 10**6)
    relative = prediction_uncertainty(friction, 0.1 * friction * rng.normal(size=4000), 10**6)
    somewhere = np.array([20.0, 50.0, 90.0])
    assert absolute.std(somewhere) == pytest.approx(np.full(3, 3.0), rel=0.1)
    assert relative.std(somewhere) == pytest.approx(0.1 * somewhere, rel=0.1)


@pytest.mark.parametrize(('readings', 'rank'), [(100, 96), (40, 39), (39, 38), (38, 38), (20, 20), (19, 19), (5, 5)])
def test_the_band_reaches_to_the_95th_percentile_counted_for_one_more_reading(readings, rank):
    """Rank and factor of the band: the smallest k with k / (n + 1) >= 95 %, and the scatter of a new group."""
    deviation = np.random.default_rng(3).permutation(
        np.arange(1, readings + 1) * np.tile([0.1, -0.1], readings)[:readings]
    )
    for groups in (1, 3, 8):
        band = prediction_uncertainty(np.full(readings, 10.0), deviation, groups)
        half = BAND_95 * band.std(np.array([10.0]))[0]
        assert half == pytest.approx(0.1 * rank * np.sqrt(1.0 + 1.0 / groups))


def test_unobserved_deviations_are_added_in_square():
    friction, deviation = np.full(100, 10.0), np.tile([0.3, -0.3], 50)
    alone, more = prediction_uncertainty(friction, deviation, 3), prediction_uncertainty(friction, deviation, 3, 0.12)
    assert more.std(friction)[0] == pytest.approx(np.hypot(alone.std(friction)[0], 1.2))


def test_repeatability_is_the_scatter_at_one_pressure():
    readings = noted(scatter=0.08, seed=3)
    assert repeatability(readings, np.zeros(1)) == pytest.approx(0.08, rel=0.2)


def test_repeatability_of_a_swept_log_is_the_scatter_within_a_cell():
    readings = swept({CONSTANT: 400.0}, LAWS['constant_coulomb'], scatter=20.0)
    assert repeatability(readings, np.array([200.0])) == pytest.approx(20.0 / 800.0, rel=0.1)


def test_runs_that_were_never_repeated_differ_by_the_prior_and_many_by_what_they_show():
    one = noted(scatter=0.01)
    alone = between_runs(one, LAW.friction(one.at, POWER), np.zeros(1))
    assert (alone.std, alone.freedom) == (PRIOR_STD, 0)
    assert np.isnan(alone.measured)
    many = noted(scatter=0.0, test_scatter=0.05, count=40, pressures=3)
    of_runs = replace(many, source=many.group, names=tuple(map(str, range(40))))
    found = between_runs(of_runs, LAW.friction(many.at, POWER), np.zeros(40))
    assert found.measured == pytest.approx(0.05, rel=0.2)
    assert found.std == pytest.approx(0.06, abs=0.015)
    assert found.of_band < alone.of_band


def test_the_deviation_between_runs_is_the_posterior_of_prior_and_runs():
    """Two runs at two pressures: friction 10 % above and below their mean at one, 20 % at the other."""
    frictions = [9.0, 18.0 / 0.9 * 0.8, 11.0, 18.0 / 0.9 * 1.2]  # run 0 at both pressures, then run 1
    direction = np.tile([1.0, -1.0], 4)
    at = OperatingConditions(np.tile(np.repeat([1e6, 2e6], 2), 2)[:, np.newaxis], direction, direction)
    source, level = np.repeat([0, 1], 4), np.tile([0, 0, 1, 1], 2)
    made = FrictionReadings(at, direction * np.repeat(frictions, 2), source, source, level, ('a', 'b'), 'file', False)
    found = between_runs(made, np.ones(8), np.zeros(2))
    squares = 2 * 0.1**2 + 2 * 0.2**2
    assert found.freedom == 2
    assert found.measured == pytest.approx(np.sqrt(squares / 2.0))
    assert found.std == pytest.approx(np.sqrt((8.0 * 0.15**2 + squares) / 10.0))
    assert found.of_band == pytest.approx(found.std * stats.t.ppf(0.975, 10) / BAND_95)
    swept_ = between_runs(replace(made, are_samples=True), np.repeat([10.0, 20.0, 10.0, 20.0], 2), np.zeros(2))
    shares = np.array([(9.0 * 10.0 + 16.0 * 20.0) / 500.0, (11.0 * 10.0 + 24.0 * 20.0) / 500.0])
    assert swept_.freedom == 1
    assert swept_.measured == pytest.approx(np.sqrt(np.sum((shares / shares.mean() - 1.0) ** 2)))


def test_jackknife_of_means_is_the_standard_error_of_the_mean():
    values = np.array([3.0, 5.0, 9.0, 1.0])
    without = np.array([[np.delete(values, i).mean()] for i in range(4)])
    assert jackknife_errors(without) == pytest.approx([values.std(ddof=1) / 2.0])


def test_plain_mean_needs_another_group_at_every_pressure_and_held_pressures():
    readings = noted(scatter=0.05)
    assert plain_mean(readings.taken((readings.group == 0) | (readings.level > 0))) is None
    assert plain_mean(replace(readings, are_samples=True)) is None
    assert plain_mean(replace(readings, left_out_by='pressure')) is None
    found = plain_mean(readings)
    assert found.predicted + found.deviation == pytest.approx(np.abs(readings.force), rel=0.05)
    assert found.rms == pytest.approx(np.sqrt(np.mean(found.deviation**2)))
    assert found.mean_deviation == pytest.approx(np.abs(found.deviation).mean())
    assert found.error == pytest.approx(np.abs(found.deviation).sum() / np.abs(readings.force).sum(), rel=0.01)


# --- whether friction rises ---


def repeated(truth, pressures, noise, seed, count=5):
    """Readings at held pressures [bar], repeated within one source, left out by pressure."""
    rng = np.random.default_rng(seed)
    pressure = np.repeat(np.array(pressures, dtype=float), 2 * count) * 1e5
    n = len(pressure)
    direction = np.tile([1.0, -1.0], n // 2)
    at = OperatingConditions(pressure[:, np.newaxis], 0.01 * direction, direction)
    level = np.repeat(np.arange(len(pressures)), 2 * count)
    force = direction * truth(pressure / 1e5) * (1.0 + noise * rng.normal(size=n))
    return FrictionReadings(at, force, np.zeros(n, dtype=int), level, level, ('made',), 'pressure', are_samples=False)


HELD = Variation(speeds=False, asymmetry=False, exponent=False)


@pytest.mark.parametrize('pressures', [(1, 3, 5), (1, 3, 5, 7)])
@pytest.mark.parametrize('noise', [0.01, 0.1])
@pytest.mark.parametrize(('truth', 'rises'), [(lambda p: 1.9 + 0.65 * p, True), (lambda p: 2.0 + 0.1 * p**1.5, True),
                                              (lambda p: 3.0 + 0.0 * p, False)])  # fmt: skip
def test_a_law_rises_where_the_friction_rises(truth, rises, noise, pressures):
    right = 0
    for seed in range(10):
        readings = repeated(truth, pressures, noise, seed)
        scores = score_ladder(candidate_laws(HELD), readings, HELD)
        found = recommended(scores, rises=rises_over_pressures(readings))
        right += found.law.depends_on_pressure is rises
    assert right >= 9


def test_with_little_noise_the_exponent_is_that_of_the_friction():
    for exponent, name in ((1.0, '1'), (1.5, '3_2'), (2.0, '2')):
        readings = repeated(lambda p, m=exponent: 2.0 + 0.1 * p**m, (1, 3, 5, 7), 0.01, 0)
        scores = score_ladder(candidate_laws(HELD), readings, HELD)
        found = recommended(scores, rises=rises_over_pressures(readings))
        assert found.law.name == f'pressure_power_law_{name}'


def test_a_law_at_a_bound_or_ill_conditioned_is_not_recommended_while_a_sound_one_is_near():
    values = POWER | {'viscous_friction': 500.0, 'pressure_exponent': 2.0 / 3.0}
    law = with_velocity_terms(ELASTIC, Variation())[0]
    tied = swept(values, law, scatter=20.0, tied=True)
    scores = score_ladder(BASES, tied, Variation())
    chosen = recommended(scores)
    assert not chosen.fit.why_unsound
    assert any(score.fit is not None and score.fit.why_unsound for score in scores)


# --- what the data cannot tell ---


def test_speed_that_goes_with_pressure_is_said_to_be_collinear():
    values = {CONSTANT: 100.0, 'viscous_friction': 500.0}
    law = LAWS['coulomb_viscous']
    tied, free = swept(values, law, tied=True), swept(values, law)
    still = np.zeros((tied.count, 2))
    (found,) = collinear_regressors(replace(tied, chamber_pressures=still))
    assert (found.one, found.other) == ('speed', 'pressure of the seals')
    assert found.correlation > 0.99
    assert not collinear_regressors(replace(free, chamber_pressures=still))
    opposed = np.column_stack((1e7 * free.at.velocity, np.zeros(free.count)))
    assert [c.one for c in collinear_regressors(replace(free, chamber_pressures=opposed))] == ['velocity']


def test_a_fit_to_collinear_data_is_ill_conditioned_and_trades_its_parameters():
    values = POWER | {'viscous_friction': 50.0, 'pressure_exponent': 2.0 / 3.0}
    law = with_velocity_terms(ELASTIC, Variation())[0]
    tied, free = (fit(law, swept(values, law, scatter=1.0, tied=tied)) for tied in (True, False))
    assert tied.condition_number > 4.0 * free.condition_number
    assert {pair[:2] for pair in traded_off(tied)} >= {('friction_at_one_bar', 'viscous_friction')}
    assert not any('viscous_friction' in pair[:2] for pair in traded_off(free))
    assert np.diag(tied.correlation) == pytest.approx(np.ones(3))


@pytest.mark.parametrize(('level', 'factor'), [(0, 2.5), (2, 1.7), (3, 1.7)])  # below all others it is an extrapolation
def test_the_one_pressure_that_disagrees_is_the_outlier(level, factor):
    laws = [law for law in BASES if law.name.startswith('pressure_power_law_')]
    readings = noted(scatter=0.03, pressures=5, law=ELASTIC, values=POWER | {'pressure_exponent': 2.0 / 3.0})
    force = np.where(readings.level == level, factor * readings.force, readings.force)
    spoiled = FrictionReadings(**{**vars(noted(pressures=5)), 'force': force})
    assert outlying_level(laws, spoiled).level == level
    assert outlying_level(laws, readings) is None


def test_three_pressures_have_no_outlier():
    assert outlying_level([ELASTIC], noted(pressures=3)) is None


def test_sources_that_disagree_at_a_pressure_are_named():
    one = noted(pressures=3, count=2)
    part = one.group
    force = np.where((part == 1) & (one.level == 2), 1.5 * one.force, one.force)
    both = FrictionReadings(
        **{**vars(noted(pressures=3, count=2)), 'force': force, 'source': part, 'names': ('a', 'b')}
    )
    changes = shared_levels(both)
    assert [round(1e-5 * change.pressure) for change in changes] == [round(1e-5 * p) for p in both.level_pressures]
    (change,) = (change for change in changes if change.is_changed)
    assert (change.name, change.other_name) == ('a', 'b')
    assert change.ratio == change.other_friction / change.friction == pytest.approx(1.5)
    assert not shared_levels(one)


def test_a_law_chosen_anew_for_a_group_has_not_seen_it():
    readings = noted(scatter=0.02, pressures=5)
    laws = [LAWS['constant_coulomb'], ELASTIC]

    def choose(left):
        return recommended(score_laws(laws, left))

    found = choose_anew(readings, choose)
    assert found.laws == ('pressure_power_law_2_3',) * 3
    first = readings.group == 0
    wild = FrictionReadings(**{**vars(noted(scatter=0.02, pressures=5)), 'force': readings.force * (1.0 + 9.0 * first)})
    again = choose_anew(wild, choose)
    assert again.predicted[first] == pytest.approx(found.predicted[first], rel=1e-12)
    assert again.predicted[~first].mean() > 2.0 * found.predicted[~first].mean()


# --- breakaway ---


@pytest.mark.parametrize(('law', 'stiction', 'ratio'), [('constant', 1.5, 0.0), ('load_dependent', 0.0, 0.15),
                                                        ('both', 1.5, 0.15)])  # fmt: skip
def test_breakaway_is_constant_or_follows_the_load_or_both(law, stiction, ratio):
    readings = noted(scatter=0.01)
    friction = LAW.friction(readings.at, POWER)
    more = 2.0 * stiction + ratio * friction
    static = FrictionReadings(**{**vars(noted()), 'force': readings.force + readings.at.direction * more})
    found = fit_breakaway(static, friction, np.zeros(1))
    assert found.law == law
    assert (found.stiction, found.ratio) == pytest.approx((stiction, ratio), rel=0.1)


# --- one fit ---


def test_a_source_in_one_direction_has_no_offset_and_its_force_is_friction():
    readings = noted(law=LAWS['constant_coulomb'], values={CONSTANT: 20.0}, offset=6.0, seals=1)
    assert fit(LAWS['constant_coulomb'], readings).offsets == pytest.approx([6.0])
    forward = readings.taken(readings.at.direction > 0.0)
    found = fit(LAWS['constant_coulomb'], forward)
    assert (found.offsets.tolist(), found.values[CONSTANT]) == ([0.0], pytest.approx(26.0))


@pytest.mark.parametrize('name', ['coulomb_stribeck', 'pressure_power_law'])
def test_the_jacobian_holds_how_each_deviation_follows_each_parameter_with_the_offset_fitted_anew(name):
    values = POWER | {CONSTANT: 90.0, 'viscous_friction': 300.0, 'stribeck_friction': 60.0, 'stribeck_velocity': 0.03}
    law, readings = LAWS[name], swept(values, LAWS[name], scatter=5.0, n=300)
    readings = readings.taken((readings.at.direction > 0.0) | (np.arange(300) % 3 > 0))
    found = fit(law, readings)

    def deviations(values):
        friction = law.friction(readings.at, values)
        offset = np.mean(readings.force - readings.at.direction * friction)
        return (readings.at.direction * (readings.force - offset) - friction) / readings.scale

    for column, parameter in zip(found.jacobian.T, law.parameters, strict=True):
        step = 1e-5 * found.values[parameter.name]
        moved = {**found.values, parameter.name: found.values[parameter.name] + step}
        expected = (deviations(moved) - deviations(found.values)) / step
        assert column == pytest.approx(expected, rel=1e-3, abs=1e-4 * np.abs(expected).max())


@pytest.mark.parametrize('factor', [0.2, 1.05, 4.0])  # of the Stribeck velocity, which the fit is not linear in
@pytest.mark.parametrize('seed', range(3))
def test_a_fit_does_not_depend_on_its_start(factor, seed):
    rng = np.random.default_rng(seed)
    values = {CONSTANT: 90.0, 'viscous_friction': 300.0, 'stribeck_friction': 60.0}
    values['stribeck_velocity'] = float(rng.uniform(0.01, 0.06))
    law = LAWS['coulomb_stribeck']
    readings = swept(values, law, scatter=2.0, n=600)
    found = fit(law, readings)
    other = {name: value * (factor if name == 'stribeck_velocity' else 1.05) for name, value in found.values.items()}
    assert fit(law, readings, other).values == pytest.approx(found.values, rel=1e-3)
    assert fit(law, readings, {'something else': 3.0}).values == pytest.approx(found.values, rel=1e-6)


def test_a_law_whose_friction_no_reading_shows_has_none_of_it():
    readings = noted(law=LAWS['constant_coulomb'], values={CONSTANT: 20.0}, pressures=4)
    flat = replace(readings, at=readings.at._replace(pressure=0.0 * readings.at.pressure))
    found = fit(LAWS['pressure_power_law_1'], flat)
    assert (found.values['friction_at_no_pressure'], found.values['friction_at_one_bar']) == (pytest.approx(20.0), 0.0)
    assert found.condition_number == np.inf
