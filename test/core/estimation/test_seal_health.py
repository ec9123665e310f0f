"""What ``~/health`` says of starts and loads is what the machine did."""

import math
from dataclasses import replace
from statistics import fmean, median

import pytest
from harness.simulated_day import Day, samples
from paths import ROOT

from seal_friction_ros.core.estimation import estimator
from seal_friction_ros.core.estimation.adaptation import (
    NO_LEVEL,
    NOT_ADAPTED,
    NOTHING_LEARNT,
    AdaptationSettings,
    Learnt,
)
from seal_friction_ros.core.estimation.disagreement import Reversal, Stroke
from seal_friction_ros.core.estimation.estimator import (
    EstimatorParameters,
    EstimatorSettings,
    EstimatorState,
    Speed,
    step,
)
from seal_friction_ros.core.estimation.friction_change import FrictionChange, watch
from seal_friction_ros.core.estimation.records import (
    NEVER,
    NO_ESTIMATE,
    NO_TEMPERATURE,
    Pressure,
    SealTemperature,
    Status,
)
from seal_friction_ros.core.estimation.seal_health import (
    SealHealth,
    Starts,
    findings,
    followed,
    health_values,
    with_sample,
)
from seal_friction_ros.core.friction.actuator import MountedSeal, actuator_friction
from seal_friction_ros.core.friction.laws.velocity_terms import VelocityTerms
from seal_friction_ros.core.friction.seal_file import parse_seal
from seal_friction_ros.core.friction.states import BREAKAWAY, SLIDING, STUCK, UNKNOWN
from seal_friction_ros.core.friction.temperature import TemperatureScale, scale_at
from seal_friction_ros.files import read_yaml

SEAL = parse_seal(read_yaml(ROOT / 'config' / 'seals' / 'ms28775_114.yaml'))
SEALS = (MountedSeal(SEAL, 'a'), MountedSeal(SEAL, 'b'))
FRICTION = actuator_friction(SEALS, 3e6, 3e6).coulomb_friction  # [N]
PARAMETERS = EstimatorParameters(EstimatorSettings(), SEALS, AdaptationSettings('observe'))
MS = 1_000_000  # [ns]


def starts_of(peaks, rest, late=30):
    """Starts with these peaks [-], ``late`` [ms] after a rest [ms], then 500 ms of sliding at the Coulomb friction."""
    known, stamp = Starts(), 0
    for peak in peaks:
        for kind, milliseconds in ((STUCK, rest), (SLIDING, 500)):
            for i in range(milliseconds // 10):
                stamp += 10 * MS
                friction = peak if kind == SLIDING and i == late // 10 else 1.0
                estimate = NO_ESTIMATE._replace(stamp=stamp, state=kind, coulomb_friction=40.0, friction_force=-40.0)
                known = with_sample(known, estimate._replace(residual=-40.0 * (friction - 1.0)))
    return known


def test_the_friction_of_a_start_is_its_peak_with_its_standard_deviation():
    starts = starts_of([1.5, 1.7, 1.6], rest=1000)
    assert starts.number == 3
    assert starts.mean == pytest.approx(1.6)
    assert starts.std == pytest.approx(0.1 / math.sqrt(3.0))


def test_a_reversal_is_no_start():
    assert starts_of([1.5] * 4, rest=100).number == 0


def test_one_start_has_no_standard_deviation():
    assert math.isnan(starts_of([1.5], rest=1000).std)


def health_after(day, seconds, parameters=PARAMETERS):
    state, health = estimator.init(parameters), SealHealth()
    for sample in samples(day, seconds, 0):
        before = state
        state, _ = step(parameters, state, sample)
        health = followed(health, parameters, before, state)
    return state, health


def values_after(day, seconds):
    state, health = health_after(day, seconds)
    return health_values(PARAMETERS, state.adaptation, health, Starts())


@pytest.mark.parametrize('share', [0.0, 0.5])
def test_the_offset_is_given_as_a_share_of_the_friction(share):
    told = values_after(replace(Day(FRICTION), load=lambda _: share * FRICTION), 20.6)
    assert float(told['offset over friction']) == pytest.approx(share, abs=0.08)


def test_a_friction_that_rises_after_the_first_reversals_is_told_as_a_ratio_to_them():
    told = values_after(replace(Day(FRICTION), scale=lambda time: 1.0 + 0.1 * (time > 25.0)), 35.0)
    assert float(told['scale over that of the first reversals']) == pytest.approx(1.1, abs=0.03)


def test_beyond_the_identified_pressures_nothing_is_learnt_but_reversals_are_seen():
    beyond = tuple(replace(mounted, seal=replace(mounted.seal, pressure_max=1e6)) for mounted in SEALS)
    state, health = health_after(replace(Day(FRICTION), scale=lambda _: 1.3), 12.0, replace(PARAMETERS, seals=beyond))
    assert state.adaptation.learnt.reversals == 0
    assert len(health.reversals) > 5
    assert median(reversal.ratio for reversal in health.reversals) == pytest.approx(1.3, rel=0.05)


# --- starts ---


@pytest.mark.parametrize(('rest', 'number'), [(490, 0), (500, 2)])
def test_a_start_is_a_breakaway_after_a_rest_of_half_a_second(rest, number):
    assert starts_of([1.5, 1.5], rest).number == number


@pytest.mark.parametrize(('late', 'peak'), [(0, 1.5), (100, 1.5), (110, 1.0)])
def test_the_friction_of_a_start_is_the_largest_of_its_first_100_ms(late, peak):
    assert starts_of([1.5], 1000, late).mean == pytest.approx(peak)


def taken(known: Starts, stamp: int, state: int, force: float = 0.0, coulomb: float = 40.0) -> Starts:
    """Starts after an estimate at ``stamp`` [ms]."""
    return with_sample(
        known, NO_ESTIMATE._replace(stamp=stamp * MS, state=state, coulomb_friction=coulomb, friction_force=force)
    )


def test_before_the_first_sample_nothing_is_known():
    assert Starts() == (NEVER, NEVER, 0.0, 0, 0.0, 0.0)
    assert SealHealth() == (0, (), FrictionChange(), 0.0, None)


@pytest.mark.parametrize('state', [STUCK, BREAKAWAY, UNKNOWN])
def test_a_rest_lasts_from_its_first_sample_that_does_not_slide(state):
    known = taken(Starts(number=2, mean=1.5, squares=0.25), 7, state)
    assert known == Starts(7 * MS, NEVER, 0.0, 2, 1.5, 0.25)
    assert taken(known, 900, STUCK) == known


def test_a_rod_that_slid_before_it_was_seen_to_rest_does_not_start():
    assert taken(Starts(), 5, SLIDING, 60.0) == Starts()


def test_the_friction_just_before_the_rod_moves_counts():
    resting = taken(taken(Starts(), 0, STUCK, 80.0), 600, STUCK, 60.0)
    assert taken(resting, 610, SLIDING, 40.0) == Starts(NEVER, 610 * MS, 1.5, 0, 0.0, 0.0)


def test_a_start_that_stops_at_once_is_none_and_its_rest_begins_anew():
    begun = taken(taken(Starts(), 0, STUCK), 600, SLIDING, 60.0)
    assert begun == Starts(NEVER, 600 * MS, 1.5, 0, 0.0, 0.0)
    assert taken(begun, 650, STUCK) == Starts(650 * MS, NEVER, 0.0, 0, 0.0, 0.0)
    done = taken(begun, 700 + 1e-6, SLIDING, 80.0)  # a nanosecond after its first 100 ms
    assert done == Starts(NEVER, NEVER, 0.0, 1, 1.5, 0.0)
    assert taken(taken(done, 800, STUCK), 900, SLIDING, 60.0) == Starts(NEVER, NEVER, 0.0, 1, 1.5, 0.0)  # too short


def test_a_start_without_coulomb_friction_has_no_ratio():
    assert taken(taken(Starts(), 0, STUCK), 600, SLIDING, 60.0, 0.0).largest == 0.0
    assert taken(taken(Starts(), 0, STUCK), 600, SLIDING, 0.6, 0.5).largest == pytest.approx(1.2)


# --- reversals that are followed ---


def state_with(learnt: Learnt, **changes) -> EstimatorState:
    adaptation = NOT_ADAPTED._replace(learnt=learnt)
    return estimator.init(PARAMETERS)._replace(adaptation=adaptation, **changes)


def after_reversal(number: int, ratio: float) -> EstimatorState:
    """State after one more reversal was learnt from."""
    stroke = NO_LEVEL._replace(direction=1, stamp=number, reading=40.0 * ratio, friction=40.0)
    ratios = NOTHING_LEARNT.ratios._replace(first=ratio)
    return state_with(NOTHING_LEARNT._replace(direction=(-1) ** number, before=stroke, ratios=ratios, reversals=number))


RATIOS = [1.0 + 0.01 * ((7 * number) % 11) + 0.001 * number for number in range(70)]


def followed_reversals(numbers, known=SealHealth()):  # noqa: B008  immutable
    """Health after each of the reversals with these numbers, from 1 on."""
    found = []
    for number in numbers:
        known = followed(known, PARAMETERS, after_reversal(number - 1, 1.0), after_reversal(number, RATIOS[number - 1]))
        found.append(known)
    return found


def test_the_last_60_reversals_are_kept_and_the_mean_of_the_first_20():
    found, change = followed_reversals(range(1, 71)), FrictionChange()
    for number, ratio in enumerate(RATIOS, start=1):
        change = watch(change, number, ratio)
        health = found[number - 1]
        assert (health.learnt, health.change) == (number, change)
        assert health.first == pytest.approx(fmean(RATIOS[: min(number, 20)]))
        assert [reversal.ratio for reversal in health.reversals] == RATIOS[max(number - 60, 0) : number]


def test_where_reversals_were_missed_there_is_no_mean_of_the_first():
    assert math.isnan(followed_reversals([5])[-1].first)
    assert math.isnan(followed_reversals([1, 2, 4])[-1].first)
    assert math.isnan(followed_reversals([1, 2, 4, *range(5, 30)])[-1].first)


def test_between_reversals_nothing_changes_and_after_a_reset_nothing_is_known():
    *_, known = followed_reversals([1, 2, 3])
    assert followed(known, PARAMETERS, after_reversal(3, 1.0), after_reversal(3, 1.0)) is known
    reset = state_with(NOTHING_LEARNT)
    assert followed(known, PARAMETERS, after_reversal(3, 1.0), reset) == SealHealth()
    turned = state_with(NOTHING_LEARNT._replace(direction=-1, reversals=1))
    assert followed(known, PARAMETERS, after_reversal(3, 1.0), turned) == SealHealth(1)


# --- strokes that the scale is not learnt from ---

VISCOUS = replace(
    PARAMETERS,
    seals=tuple(replace(m, seal=replace(m.seal, velocity_terms=VelocityTerms(300.0))) for m in SEALS),
)
WARM_SCALE = TemperatureScale(reference=300.0, coefficient=0.01, coefficient_std=0.0, lowest=250.0, highest=350.0)
WARM = replace(VISCOUS, seals=tuple(replace(m, seal=replace(m.seal, temperature=WARM_SCALE)) for m in VISCOUS.seals))


def stroke_of(direction=1, known=None, parameters=VISCOUS, temperature=NO_TEMPERATURE, **learnt) -> SealHealth:
    """Health after a stroke at 3 and 2 MPa with 0.05 m/s, outside the identified range."""
    values = {'scale': 1.2, 'offset': 5.0, 'samples': 4} | learnt
    end = NOTHING_LEARNT._replace(direction=direction, **values)
    before = state_with(end, stamp=7, pressure=Pressure(6, 3e6, 2e6), velocity=Speed(7, 0.05 * direction))
    turned = state_with(end._replace(direction=-direction if direction else 1))
    return followed(known or SealHealth(), parameters, before, turned, temperature)


def test_a_stroke_that_is_not_learnt_from_has_the_friction_of_the_law_at_its_end():
    law = actuator_friction(VISCOUS.seals, 3e6, 2e6, 0.05)
    friction = law.coulomb_friction + law.velocity_friction
    assert law.velocity_friction == pytest.approx(2 * 300.0 * 0.05)
    out = stroke_of().stroke
    assert out == Stroke(7, 1, pytest.approx(1.2 * friction + 5.0), pytest.approx(friction), 3e6, 2e6)
    assert stroke_of(-1).stroke.reading == pytest.approx(-1.2 * friction + 5.0)
    hot = stroke_of(parameters=WARM, temperature=SealTemperature(7, 320.0)).stroke
    assert hot.friction == pytest.approx(scale_at(WARM_SCALE, 320.0) * friction)


def test_a_stroke_of_three_samples_or_one_that_is_learnt_from_or_none_is_no_stroke():
    known = stroke_of()
    for changes in ({'samples': 3}, {'level': NO_LEVEL._replace(samples=1)}, {'direction': 0}):
        assert stroke_of(known=known, **changes).stroke is None


def test_two_strokes_that_are_not_learnt_from_make_a_reversal_of_which_60_are_kept():
    known = stroke_of()
    assert known.reversals == ()
    assert stroke_of(known=known).reversals == ()  # the same direction again
    for number in range(1, 70):
        known = stroke_of(direction=(-1) ** number, known=known)
        assert len(known.reversals) == min(number, 60)
    assert known.reversals[-1].ratio == pytest.approx(1.2)
    assert known.reversals[-1].offset == pytest.approx(5.0)
    assert (known.learnt, known.change) == (0, FrictionChange())


# --- in words ---


def values(learnt=NOTHING_LEARNT, health=SealHealth(), starts=Starts(), **state):  # noqa: B008  immutable
    return health_values(PARAMETERS, NOT_ADAPTED._replace(learnt=learnt, **state), health, starts)


def test_what_is_not_known_is_said_to_be_unknown():
    told = values()
    assert told['adaptation scale std'] == told['adaptation residual std [N]'] == 'not learnt'
    assert told['last learnt [s ago]'] == 'never'
    none = {name for name, value in told.items() if value == 'none'}
    assert none == {
        'friction of this stroke [N]', 'offset over friction', 'residual std over friction',
        'scale over that of the first reversals', 'start over Coulomb friction', 'start over Coulomb friction std',
        'last change began [ns]',
    }  # fmt: skip
    assert (told['starts after a rest'], told['reversals learnt from'], told['changes of the friction']) == ('0',) * 3


def test_what_is_known_is_told_in_its_unit():
    learnt = NOTHING_LEARNT._replace(
        scale=1.25,
        scale_std=0.0,
        noise=0.0,
        offset=-5.0,
        reversals=20,
        level=NO_LEVEL._replace(samples=1, friction=40.0),
    )
    health = SealHealth(change=FrictionChange(changes=2, changed_at=123), first=0.5)
    told = values(learnt, health, Starts(number=2, mean=1.5, squares=0.08), stamp=4_500 * MS, learnt_stamp=3_000 * MS)
    assert told == {
        'adaptation mode': 'observe',
        'adaptation scale': '1.2500',
        'adaptation scale std': '0.0000',
        'adaptation offset [N]': '-5',
        'adaptation residual std [N]': '0',
        'friction of this stroke [N]': '50',
        'offset over friction': '-0.100',
        'residual std over friction': '0.000',
        'scale over that of the first reversals': '2.5000',
        'starts after a rest': '2',
        'start over Coulomb friction': '1.500',
        'start over Coulomb friction std': '0.200',
        'reversals learnt from': '20',
        'last learnt [s ago]': '1.5',
        'changes of the friction': '2',
        'last change began [ns]': '123',
    }


@pytest.mark.parametrize(
    ('reversals', 'first', 'told'), [(19, 1.0, 'none'), (20, 1.0, '1.0000'), (20, math.nan, 'none'), (20, -0.5, 'none')]
)
def test_the_first_twenty_reversals_are_compared_with_once_they_are_known(reversals, first, told):
    found = values(NOTHING_LEARNT._replace(reversals=reversals), SealHealth(first=first))
    assert found['scale over that of the first reversals'] == told


def test_one_start_has_a_mean_and_no_deviation():
    told = values(starts=Starts(number=1, mean=1.5))
    assert (told['start over Coulomb friction'], told['start over Coulomb friction std']) == ('1.500', 'none')


DRIVES = SealHealth(reversals=tuple(Reversal(i, -1.0, 40.0, 0.0, 3e6, 0.0) for i in range(4)))
OTHER = SealHealth(reversals=tuple(Reversal(i, 1.6, 40.0, 0.0, 3e6, 0.0) for i in range(4)))


@pytest.mark.parametrize(
    ('health', 'status', 'clause'),
    [
        (OTHER, Status.MODEL_DISAGREES, '1.60 times the friction of the seal file'),
        (OTHER, Status.MODEL_DISAGREES | Status.OUTSIDE_IDENTIFIED_RANGE, '1.60 times'),
        (OTHER, Status.OUTSIDE_IDENTIFIED_RANGE, ''),  # there the law says little
        (DRIVES, Status.OUTSIDE_IDENTIFIED_RANGE, 'the friction drives'),
        (DRIVES, Status.FORCE_STALE, ''),
        (SealHealth(), Status.MODEL_DISAGREES, ''),
    ],
)
def test_a_reason_is_given_where_the_status_asks_for_one(health, status, clause):
    found = findings(PARAMETERS, health, int(status))
    assert len(found) == bool(clause)
    assert clause in ''.join(found)


@pytest.mark.parametrize(('changes', 'reversals', 'told'), [(0, 5, False), (1, 4, False), (1, 5, True)])
def test_a_change_is_told_with_the_mean_of_five_reversals_after_it(changes, reversals, told):
    change = FrictionChange(changes=changes, reversals=reversals, before=1.0, reference=1.254)
    found = findings(PARAMETERS, SealHealth(change=change), 0)
    assert found == ['the friction has changed from 1.00 to 1.25 times that of the file'] * told
