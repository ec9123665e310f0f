"""What ``~/health`` says of starts and loads is what the machine did."""

import math
from dataclasses import replace
from statistics import fmean, median

import pytest
from harness.learnt import learnt_state
from harness.simulated_day import Day, samples
from paths import ROOT

from seal_friction_ros.core.estimation import estimator
from seal_friction_ros.core.estimation.adaptation import NO_STROKE, NOT_ADAPTED, AdaptationSettings, Stroke, Strokes
from seal_friction_ros.core.estimation.disagreement import Reversal
from seal_friction_ros.core.estimation.estimator import EstimatorParameters, EstimatorSettings, EstimatorState, step
from seal_friction_ros.core.estimation.friction_change import FrictionChange, watch
from seal_friction_ros.core.estimation.friction_filter import NOT_BEGUN, FrictionFilter, Terms
from seal_friction_ros.core.estimation.seal_health import (
    SealHealth,
    Starts,
    findings,
    followed,
    health_values,
    with_sample,
)
from seal_friction_ros.core.friction.actuator import MountedSeal, actuator_friction
from seal_friction_ros.core.friction.seal_file import parse_seal
from seal_friction_ros.core.friction.states import BREAKAWAY, SLIDING, STUCK, UNKNOWN
from seal_friction_ros.core.messages.records import NEVER, NO_ESTIMATE, Pressure, Status
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
        health = followed(health, before, state)
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
    assert state.adaptation.strokes.reversals == 0
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
    assert SealHealth() == (0, (), FrictionChange(), 0.0)


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

RATIOS = [1.0 + 0.01 * ((7 * number) % 11) + 0.001 * number for number in range(70)]


def stroke(number: int, offset: float = 5.0, is_identified: bool = True) -> Stroke:
    """Even strokes extend, odd ones retract."""
    direction = -1 if number % 2 else 1
    return Stroke(direction, number, direction * 40.0 * RATIOS[number] + offset, 40.0, 9, is_identified)


def state_after(number: int, reversals: int | None = None, ratio: float = 1.0) -> EstimatorState:
    """State in the first sample of a stroke, after `reversals` that were learnt from."""
    strokes = Strokes(
        present=stroke(number)._replace(samples=1),
        before=stroke(number - 1) if number else NO_STROKE,
        ratio=ratio,
        reversals=number if reversals is None else reversals,
    )
    adaptation = NOT_ADAPTED._replace(strokes=strokes)
    return replace(estimator.init(PARAMETERS), adaptation=adaptation, pressure=Pressure(6, 3e6, 2e6))


def followed_reversals(numbers, known=SealHealth()):  # noqa: B008  immutable
    """Health after each of the reversals with these numbers, from 1 on."""
    found = []
    for number in numbers:
        known = followed(known, state_after(number - 1), state_after(number, ratio=RATIOS[number - 1]))
        found.append(known)
    return found


def test_the_ratios_and_the_mean_of_the_first_20_are_followed():
    found, change = followed_reversals(range(1, 70)), FrictionChange()
    for number, ratio in enumerate(RATIOS[:69], start=1):
        change = watch(change, number - 1, ratio)
        health = found[number - 1]
        assert (health.learnt, health.change) == (number, change)
        assert health.first == pytest.approx(fmean(RATIOS[: min(number, 20)]))


def test_the_last_60_reversals_are_kept_with_friction_offset_and_pressures():
    for number, health in enumerate(followed_reversals(range(1, 70)), start=1):
        assert len(health.reversals) == min(number - 1, 60)  # the first one has no stroke before
    newest = health.reversals[-1]
    assert newest.ratio == pytest.approx(fmean(RATIOS[67:69]))
    assert (newest.stamp, newest.friction, newest.pressure_a, newest.pressure_b) == (68, 40.0, 3e6, 2e6)
    assert newest.offset == pytest.approx(5.0, abs=40.0 * 0.06)


def test_where_reversals_were_missed_there_is_no_mean_of_the_first():
    assert math.isnan(followed_reversals([5])[-1].first)
    assert math.isnan(followed_reversals([1, 2, 4])[-1].first)
    assert math.isnan(followed_reversals([1, 2, 4, *range(5, 30)])[-1].first)


def test_between_reversals_nothing_changes_and_after_a_reset_nothing_is_known():
    *_, known = followed_reversals([1, 2, 3])
    assert followed(known, state_after(3), state_after(3)) is known
    assert followed(known, state_after(3), estimator.init(PARAMETERS)) == SealHealth()
    assert followed(known, state_after(3), state_after(4, reversals=1)) == SealHealth(1)


def test_a_reversal_that_is_not_learnt_from_is_kept_and_neither_counted_nor_watched():
    *_, known = followed_reversals([1, 2, 3])
    after = followed(known, state_after(3), state_after(4, reversals=3))
    assert after == known._replace(reversals=after.reversals)
    assert len(after.reversals) == len(known.reversals) + 1


# --- in words ---


def values(known=NOT_BEGUN, health=SealHealth(), starts=Starts(), **state):  # noqa: B008  immutable
    return health_values(PARAMETERS, learnt_state(NOT_ADAPTED, filter=known, **state), health, starts)


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


def test_health_values_are_shown_in_their_units():
    known: FrictionFilter = NOT_BEGUN._replace(
        stamp=3_000 * MS,
        terms=Terms(1.0, 8.0, 40.0, 0.0, -5.0, 2.0, 0.7, 0.0),
        friction=40.0,
        friction_std=2.0,
        speed=0.05,
        unexplained=NOT_BEGUN.unexplained._replace(square=9.0),
    )
    health = SealHealth(change=FrictionChange(changes=2, changed_at=123), first=0.5)
    starts = Starts(number=2, mean=1.5, squares=0.08)
    told = values(known, health, starts, stamp=4_500 * MS, strokes=Strokes(reversals=20))
    assert told == {
        'adaptation mode': 'observe',
        'adaptation scale': '1.2500',
        'adaptation scale std': '0.0500',
        'adaptation offset [N]': '-5',
        'adaptation residual std [N]': '3',
        'friction of this stroke [N]': '50',
        'offset over friction': '-0.100',
        'residual std over friction': '0.060',
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
    found = values(health=SealHealth(first=first), strokes=Strokes(reversals=reversals))
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
