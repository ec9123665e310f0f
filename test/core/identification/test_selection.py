"""Which law is taken: what was varied, whether friction rises, which laws are beaten, and which compete at all."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from seal_friction_ros.core.identification.candidate_laws import (
    OperatingConditions,
    Variation,
    candidate_laws,
    with_velocity_terms,
)
from seal_friction_ros.core.identification.fitting import LawFit
from seal_friction_ros.core.identification.readings import FrictionReadings
from seal_friction_ros.core.identification.selection import (
    LawScore,
    NotScored,
    choose_anew,
    choose_without,
    collinear_spread,
    recommended,
    regroupings,
    rises_over_pressures,
    score_ladder,
    score_laws,
    variation_of,
)

BAR = 1e5  # [Pa]
LAWS = {law.name: law for law in candidate_laws(Variation())}
LAWS |= {law.name: law for law in with_velocity_terms(LAWS['pressure_power_law'], Variation())}


def readings(bars, speeds=(0.02,), force=None, sources=1, samples=False, count=1):
    """Each speed in both directions at each pressure, of each source."""
    rows = [
        (s, i, side * v)
        for s in range(sources)
        for i in range(len(bars))
        for v in speeds
        for side in (1.0, -1.0)
        for _ in range(count)
    ]
    source, level, velocity = np.array(rows).T
    source, level, direction = source.astype(int), level.astype(int), np.sign(velocity)
    at = OperatingConditions(np.asarray(bars, float)[level][:, np.newaxis] * BAR, velocity, direction)
    magnitude = np.full(len(rows), 10.0) if force is None else np.asarray(force, float)
    names = tuple(map(str, range(sources)))
    return FrictionReadings(at, direction * magnitude, source, level, level, names, 'pressure', samples)


# --- what was varied ---


@pytest.mark.parametrize(('fast', 'varied'), [(0.0299, False), (0.0301, True)])
def test_a_speed_is_varied_where_it_is_half_as_fast_again_at_one_pressure(fast, varied):
    made = readings([0, 10, 20, 30], (0.02, fast))
    assert variation_of(made).speeds is varied
    half = np.where(made.level < 2, 0.02, np.abs(made.at.velocity)) * made.at.direction
    assert not variation_of(replace(made, at=made.at._replace(velocity=half))).speeds  # at most of the pressures
    unknown = np.where(made.level < 1, np.nan, made.at.velocity)
    assert not variation_of(replace(made, at=made.at._replace(velocity=unknown))).speeds


@pytest.mark.parametrize('side', [1.0, -1.0])
def test_speeds_of_one_direction_tell_something_whatever_the_other_does(side):
    made = readings([0, 10, 20, 30], (0.02, 0.06))
    velocity = np.where(made.at.direction != side, 0.02 * made.at.direction, made.at.velocity)
    assert variation_of(replace(made, at=made.at._replace(velocity=velocity))).speeds


def test_speeds_count_where_no_pressure_is_repeated():
    """Each stroke has a pressure of its own, as against a load that changes."""
    made = readings([0, 10, 20, 30, 40, 50, 60, 70], (0.02, 0.05))
    alone = made.taken((made.level % 2 == 0) == (np.abs(made.at.velocity) < 0.03))
    assert variation_of(alone).speeds


def test_pressures_that_are_one_level_are_one_pressure():
    made = readings([20, 30])
    assert variation_of(replace(made, level=np.zeros(made.count, int))).pressures == 1


def test_a_speed_that_follows_pressure_or_direction_is_not_varied():
    made = readings([0, 10, 20, 30])
    for speed in (0.01 * (1.0 + made.level), np.where(made.at.direction > 0.0, 0.02, 0.09)):
        followed = replace(made, at=made.at._replace(velocity=made.at.direction * speed))
        assert not variation_of(followed).speeds


@pytest.mark.parametrize(
    ('bars', 'pressures', 'exponent'),
    [
        ([20], 1, False),
        ([20, 30], 2, False),
        ([20, 20.4], 1, False),
        ([0, 20, 40], 3, False),
        ([0, 10, 20, 30, 40], 3, False),
        ([0, 10, 20, 30, 40, 50], 3, True),
    ],
)
def test_as_many_pressures_as_there_are_up_to_three_and_an_exponent_from_six_on(bars, pressures, exponent):
    found = variation_of(readings(bars))
    assert (found.pressures, found.exponent) == (pressures, exponent)
    assert variation_of(readings(bars, samples=True)).exponent


def test_asymmetry_takes_both_directions_and_several_pressures_of_one_source():
    made = readings([0, 20, 40])
    assert variation_of(made).asymmetry
    assert not variation_of(made.taken(made.at.direction > 0.0)).asymmetry
    each = replace(made, source=made.level, names=('a', 'b', 'c'))  # one pressure a source: its offset
    assert not variation_of(each).asymmetry
    assert variation_of(replace(made, source=np.minimum(made.level, 1), names=('a', 'b'))).asymmetry


# --- whether friction rises ---


@pytest.mark.parametrize(('errors', 'rises'), [(1.99, False), (2.01, True), (-9.0, False)])
def test_friction_rises_from_two_standard_errors_of_8_percent_a_pressure_on(errors, rises):
    bars = np.array([10.0, 15.0, 30.0, 45.0])
    slope = errors * 0.08 * 10.0 / np.linalg.norm(bars - bars.mean())
    made = readings(bars, force=np.repeat(10.0 + slope * (bars - bars.mean()), 2))
    assert rises_over_pressures(made) is rises
    assert not rises_over_pressures(replace(made, are_samples=True))
    assert not rises_over_pressures(made.taken(made.level < 2))  # two pressures are a line in any case
    for share in (-1.0, 0.0):  # friction at each pressure, or nothing is said
        assert not rises_over_pressures(replace(made, force=np.where(made.level == 1, share * made.force, made.force)))


# --- which laws are beaten, and which compete ---


def score(name, losses, *, sound=True):
    fit = SimpleNamespace(why_unsound='' if sound else 'at its bound')
    return LawScore(LAWS[name], fit, None, np.asarray(losses, float))


EVEN = np.ones(4)
CONSTANT, ONE, FREE = 'constant_coulomb', 'pressure_power_law_1', 'pressure_power_law'


@pytest.mark.parametrize(
    ('scores', 'rises', 'name'),
    [
        ([score(CONSTANT, 1.05 * EVEN), score(FREE, EVEN)], False, CONSTANT),  # 5 % are not worth two parameters
        ([score(CONSTANT, 1.05 * EVEN), score(FREE, EVEN)], True, FREE),
        ([score(CONSTANT, 1.05 * EVEN), score('coulomb_viscous', EVEN)], True, 'coulomb_viscous'),
        ([score(CONSTANT, EVEN)], True, CONSTANT),  # there is no other
        ([score(CONSTANT, 1.2 * EVEN), score(FREE, EVEN)], False, FREE),
        ([score(ONE, 1.9 * EVEN), score(FREE, EVEN, sound=False)], False, ONE),
        ([score(ONE, 2.1 * EVEN), score(FREE, EVEN, sound=False)], False, FREE),
        ([score(ONE, 0.19 * EVEN), score(FREE, 0.1 * EVEN, sound=False)], False, ONE),
        ([score(ONE, 0.21 * EVEN), score(FREE, 0.1 * EVEN, sound=False)], False, FREE),
        (
            [score('pressure_power_law_2', 5.0 * EVEN), score(ONE, 1.9 * EVEN), score(FREE, EVEN, sound=False)],
            False,
            ONE,
        ),
        ([score('pressure_power_law_2', 1.04 * EVEN), score(ONE, 1.02 * EVEN), score(FREE, EVEN)], False, ONE),
        ([NotScored(LAWS[CONSTANT], 'too few'), score(FREE, EVEN)], False, FREE),
    ],
)
def test_the_simplest_law_that_is_not_beaten_is_recommended(scores, rises, name):
    assert recommended(scores, rises=rises).law.name == name


def test_without_any_fit_there_is_no_recommendation_but_the_reasons():
    with pytest.raises(ValueError, match='no law could be fitted: constant_coulomb: too few; pressure_power_law: bad'):
        recommended([NotScored(LAWS[CONSTANT], 'too few'), NotScored(LAWS[FREE], 'bad')])


def test_a_group_for_which_no_law_can_be_chosen_has_no_prediction():
    def none(_):
        raise ValueError('no law')

    made = readings([10, 20, 40])
    found = choose_without(made, made.level == 1, none)
    assert found.law == ''
    assert np.isnan(found.predicted).tolist() == [True, True]


def test_a_swept_log_is_left_out_by_thirds_of_speed_and_pressure_and_by_files():
    made = readings(np.linspace(0.0, 90.0, 30), np.linspace(0.01, 0.1, 30), sources=2, samples=True)
    cells, files = regroupings(made)
    assert files.group.tolist() == made.source.tolist()
    thirds = [
        np.searchsorted(np.quantile(values, [1 / 3, 2 / 3]), values)
        for values in (np.abs(made.at.velocity), made.seal_pressure)
    ]
    assert len(cells.groups) == 9
    for one in cells.groups:
        assert {*zip(*(third[one] for third in thirds), strict=True)} == {(thirds[0][one][0], thirds[1][one][0])}
    assert len(regroupings(made.taken(made.source == 0))) == 2  # the names tell that there were two files
    assert regroupings(replace(made, are_samples=False)) == []
    same = readings([20.0], (0.02,), samples=True)
    assert regroupings(same) == []


# --- soundness ---


def fitted(condition=2.0, **values):
    """A fit of the pressure power law whose scaled Jacobian has this condition number in its first two columns."""
    angle = 2.0 * np.arctan(1.0 / condition)  # between two unit columns: condition = cot(angle / 2)
    jacobian = np.zeros((4, 3))
    jacobian[0, :2], jacobian[1, 1], jacobian[2, 2] = (5.0, 7.0 * np.cos(angle)), 7.0 * np.sin(angle), 0.1
    plain = {'friction_at_no_pressure': 5.0, 'friction_at_one_bar': 0.9, 'pressure_exponent': 0.7}
    return LawFit(LAWS[FREE], plain | values, np.zeros(1), jacobian)


@pytest.mark.parametrize(
    ('values', 'reason'),
    [
        ({}, ''),
        ({'friction_at_no_pressure': 0.0}, ''),  # a term that the data do not show
        ({'pressure_exponent': 2.0}, 'pressure_exponent is at its bound of 2'),
        ({'pressure_exponent': 0.05}, 'pressure_exponent is at its bound of 0.05'),
        ({'pressure_exponent': 1.99}, ''),
        ({'pressure_exponent': 0.0501}, ''),
    ],
)
def test_parameters_at_a_bound_are_unsound_unless_the_bound_is_zero(values, reason):
    assert fitted(**values).why_unsound == reason


@pytest.mark.parametrize(('condition', 'sound'), [(29.0, True), (31.0, False)])
def test_a_fit_is_ill_conditioned_from_30_on(condition, sound):
    found = fitted(condition)
    assert found.condition_number == pytest.approx(condition)
    assert (found.why_unsound == '') is sound
    angle = 2.0 * np.arctan(1.0 / condition)
    assert found.correlation[0, 1] == pytest.approx(-np.cos(angle))
    assert np.diag(found.correlation) == pytest.approx(np.ones(3))


def test_a_parameter_without_effect_is_not_identifiable():
    found = replace(fitted(), jacobian=fitted().jacobian * [1.0, 1.0, 0.0])
    assert found.condition_number == np.inf
    assert 'ill-conditioned' in found.why_unsound
    assert np.isnan(found.correlation).all()


# --- the ladder ---


def test_the_best_sound_law_that_depends_on_pressure_is_tried_again_with_speeds():
    rng = np.random.default_rng(3)
    bars, speeds = [5.0, 10.0, 20.0, 30.0, 40.0, 50.0], (0.01, 0.04)
    plain = readings(bars, speeds, count=2)
    law = LAWS['pressure_power_law_1']
    values = {'friction_at_no_pressure': 3.0, 'friction_at_one_bar': 0.5}
    friction = law.friction(plain.at, values) * (1.0 + 0.01 * rng.normal(size=plain.count))
    made = replace(plain, force=plain.at.direction * friction)
    ticks = []
    chosen = [LAWS[name] for name in ('constant_coulomb', 'pressure_power_law_1', 'pressure_power_law_2')]
    scores = score_ladder(chosen, made, Variation(), ticks.append)
    names = [each.law.name for each in scores]
    more = [f'pressure_power_law_1_{terms}' for terms in ('viscous', 'stribeck', 'asymmetric')]
    assert names == ['constant_coulomb', 'pressure_power_law_1', 'pressure_power_law_2', *more, 'all_terms']
    assert ticks == [1] * 7
    assert all(len(each.losses) == 6 for each in scores)
    # Friction that rises with P^2.5 is best met by a free exponent, which stays at its bound of 2: it is not sound.
    steep = replace(made, force=made.at.direction * (3.0 + 0.01 * (made.seal_pressure / BAR) ** 2.5))
    bound = score_ladder([LAWS['pressure_power_law_2_3'], LAWS['pressure_power_law']], steep, Variation())
    assert bound[1].losses.mean() < bound[0].losses.mean()
    assert bound[2].law.name == 'pressure_power_law_2_3_viscous'
    only = score_ladder(chosen[:1], made, Variation())
    assert [each.law.name for each in only] == ['constant_coulomb']
    two = made.taken(made.level < 2)
    (too_few,) = score_laws([chosen[1]], two)
    assert too_few.why_not == '2 parameters need 3 pressures, there are 2'
    assert isinstance(too_few, NotScored)
    by_test = replace(made.taken(made.level < 2), group=np.arange(16) % 2, left_out_by='test')
    assert isinstance(score_laws([chosen[1]], by_test)[0], LawScore)  # each test has both pressures
    (broken,) = score_laws([chosen[0]], replace(made, force=np.full(made.count, np.nan)))
    assert broken.why_not


def test_groups_may_be_computed_by_another_and_stay_in_order():
    made = readings([10, 20, 40], count=2, force=np.repeat([10.0, 20.0, 30.0], 4))
    calls = []

    def run(tasks):
        calls.append(len(tasks))
        return [task() for task in tasks]

    def choose(left):
        return recommended(score_laws([LAWS[CONSTANT]], left))

    found = choose_anew(made, choose, run)
    assert calls == [3]
    assert found.laws == (CONSTANT,) * 3
    # The friction of the others, each weighted with 1 / friction^2: sum of 1/f over sum of 1/f^2.
    others = [(20.0, 30.0), (10.0, 30.0), (10.0, 20.0)]
    expected = [sum(1.0 / f for f in pair) / sum(1.0 / f**2 for f in pair) for pair in others]
    assert found.predicted == pytest.approx(np.repeat(expected, 4))


# --- what speed and pressure cannot tell ---


def near(slope, power, times=1.0):
    """A score of a law of 20 N that also follows speed and pressure."""
    friction = SimpleNamespace(
        why_unsound='', friction=lambda at: 20.0 + slope * np.abs(at.velocity) + power * at.pressure.mean(axis=1) / BAR
    )
    return LawScore(LAWS[CONSTANT], friction, None, times * EVEN)


def test_laws_that_fit_nearly_as_well_spread_where_speed_and_pressure_part():
    bars = np.linspace(0.0, 80.0, 41)
    made = readings(bars, np.linspace(0.01, 0.09, 41), samples=True)
    chosen = near(0.0, 0.0).fit
    speeds = np.quantile(np.abs(made.at.velocity), (0.125, 0.375, 0.625, 0.875))
    assert collinear_spread([near(0.0, 0.0)], chosen, made) == 0.0
    of_speed = collinear_spread([near(100.0, 0.0)], chosen, made)
    assert of_speed == pytest.approx(np.sqrt(np.mean((100.0 * speeds / 20.0) ** 2)))
    pressures = np.array([10.0, 30.0, 50.0, 70.0])  # [bar] quartiles
    of_pressure = collinear_spread([near(0.0, 0.1)], chosen, made)
    assert of_pressure == pytest.approx(np.sqrt(np.mean((0.1 * pressures / 20.0) ** 2)), rel=0.02)
    every_pair = (100.0 * speeds[:, np.newaxis] - 0.1 * pressures) / 20.0  # also fast at low pressure
    assert collinear_spread([near(100.0, -0.1)], chosen, made) == pytest.approx(
        np.sqrt(np.mean(every_pair**2)), rel=0.02
    )
    mean = collinear_spread([near(100.0, 0.0), near(0.0, 0.0)], chosen, made)
    assert mean == pytest.approx(of_speed / np.sqrt(2.0))
    best = near(0.0, 0.0, 1.0)
    assert collinear_spread([best, near(100.0, 0.0, 1.9)], chosen, made) == pytest.approx(mean)
    assert collinear_spread([best, near(100.0, 0.0, 2.1)], chosen, made) == 0.0
    assert collinear_spread([near(0.0, 0.0, 0.1), near(100.0, 0.0, 0.21)], chosen, made) == 0.0
    assert collinear_spread([best, NotScored(LAWS[CONSTANT], 'too few')], chosen, made) == 0.0
    unsound = near(100.0, 0.0)
    unsound.fit.why_unsound = 'asymmetry is at its bound of -0.9'
    assert collinear_spread([best, unsound], chosen, made) == 0.0
    assert collinear_spread([near(100.0, 0.0)], chosen, replace(made, are_samples=False)) == 0.0
    uneven = SimpleNamespace(
        why_unsound='', friction=lambda at: np.where(at.direction > 0.0, 24.0, 20.0) + 0.0 * at.velocity
    )
    one = LawScore(LAWS[CONSTANT], uneven, None, EVEN)
    assert collinear_spread([one], chosen, made) == pytest.approx(np.sqrt(np.mean([0.2**2, 0.0])))  # both directions
    signed = SimpleNamespace(why_unsound='', friction=lambda at: 20.0 + 1e3 * (at.direction != np.sign(at.velocity)))
    assert collinear_spread([LawScore(LAWS[CONSTANT], signed, None, EVEN)], chosen, made) == 0.0
