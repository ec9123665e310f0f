"""What a person sees of an actuator: rows for the curves, and the situation in words."""

import dataclasses
import math

import pytest

from seal_friction_ros.core.estimation.adaptation import MODES, AdaptationSettings
from seal_friction_ros.core.foundation.normal_distribution import BAND_95
from seal_friction_ros.core.friction.states import SLIDING, STUCK, FrictionState
from seal_friction_ros.core.messages.records import (
    FeedForward,
    Force,
    FrictionEstimate,
    Limited,
    Position,
    Pressure,
    ServoReference,
    Status,
    Velocity,
)
from seal_friction_ros.files import default_configuration
from seal_friction_ros.offline.monitor.actuator_view import (
    COLUMNS,
    NOTHING_HELD,
    NOTHING_SAID,
    OFF,
    STATUS_WORDS,
    TOO_OLD,
    Bits,
    Known,
    Presence,
    Said,
    known_of,
    next_interval,
    recent_bits,
    row,
    situation,
    take,
)

PLACEHOLDER = known_of(dataclasses.replace(default_configuration(), adaptation=AdaptationSettings('off')))
KNOWN = PLACEHOLDER._replace(has_placeholder=False)
SECOND = 10**9
NO_BITS = Bits()
ESTIMATE = FrictionEstimate(SECOND, 40.0, 3.0, 45.0, -40.0, SLIDING, -1, 0, 0.001)
RECORDS = (
    Pressure(SECOND, 2e6, 1e6),
    Force(SECOND, -37.0),
    Velocity(SECOND, -0.01, b'rod'),
    Position(SECOND, 0.010),
    ServoReference(SECOND, 0.012, 0.0, 0.0),
    ESTIMATE,
    FeedForward(SECOND, -36.0, 0.9, int(Limited.SLEW)),
)


def held_of(*records, received: int = SECOND):
    held = NOTHING_HELD
    for record in records:
        held = take(held, record, received)
    return held


def as_mapping(values) -> dict:
    return dict(zip(COLUMNS, values, strict=True))


def words(held, *, bits: Bits = NO_BITS, now: int = SECOND, said: Said = NOTHING_SAID, known: Known = KNOWN) -> dict:
    return situation(known, held, bits, now, said)


def test_a_row_has_the_newest_numbers_in_the_units_of_the_page():
    shown = as_mapping(row(KNOWN, held_of(*RECORDS), 12.3456))
    assert shown['time'] == 12.346
    assert (shown['measured'], shown['estimate']) == (-37.0, -40.0)
    assert shown['low'] == pytest.approx(-40.0 - BAND_95 * 3.0)
    assert shown['high'] == pytest.approx(-40.0 + BAND_95 * 3.0)
    assert (shown['feedforward'], shown['limit'], shown['below']) == (-36.0, 150.0, -150.0)
    assert shown['error'] == pytest.approx(2000.0)  # [um]
    assert (shown['pressure_a'], shown['pressure_b']) == (20.0, 10.0)  # [bar]
    assert shown['scale'] is shown['residual'] is None  # nothing is learnt
    assert shown['limited'] == Limited.SLEW


def test_an_input_that_never_came_is_a_gap_and_no_zero():
    shown = as_mapping(row(KNOWN, NOTHING_HELD, 0.0))
    assert {name for name, value in shown.items() if value is not None} == {'time', 'status', 'limited'}


@pytest.mark.parametrize('value', [math.nan, math.inf, -math.inf])
def test_no_number_of_a_row_or_of_the_words_is_other_than_finite(value: float):
    held = held_of(Pressure(1, value, value), Force(1, value), Position(1, value), ServoReference(1, value, 0.0, 0.0))
    given = (*row(KNOWN, held, 1.0), *words(held).values())
    assert all(math.isfinite(number) for number in given if isinstance(number, float))


def test_the_tracking_error_of_a_fast_rod_is_that_of_one_moment():
    """1 m/s, the reference 3 ms older than the position: it has moved by 3 mm since."""
    position, reference = Position(SECOND, 0.5), ServoReference(SECOND - 3_000_000, 0.4971, 1.0, 0.0)
    shown = as_mapping(row(KNOWN, held_of(position, reference), 0.0))
    assert shown['error'] == pytest.approx(100.0)  # [um]
    old = as_mapping(row(KNOWN, held_of(position, reference._replace(stamp=SECOND // 2)), 0.0))
    assert old['error'] is None


def test_at_rest_there_is_no_band():
    shown = as_mapping(row(KNOWN, held_of(ESTIMATE._replace(state=STUCK)), 0.0))
    assert shown['low'] is shown['high'] is None


def test_with_adaptation_what_is_measured_is_estimate_plus_residual_while_the_rod_slides():
    """A rod of 100 kg that brakes: the force sum is far from the friction, the residual knows the inertia."""
    configuration = default_configuration()
    adapting = dataclasses.replace(
        configuration, adaptation=dataclasses.replace(configuration.adaptation, mode='observe')
    )
    estimate = ESTIMATE._replace(residual=-2.0, adaptation_scale=1.05, adaptation_scale_std=0.01)
    shown = as_mapping(row(known_of(adapting), held_of(Force(SECOND, 400.0), estimate), 0.0))
    assert shown['measured'] == -42.0
    assert (shown['scale'], shown['residual']) == (1.05, -2.0)
    assert shown['scale_high'] - shown['scale_low'] == pytest.approx(2 * BAND_95 * 0.01, abs=1e-4)
    nothing_learnt = estimate._replace(adaptation_scale=1.0)  # its offset would hide what the law misses
    raw = as_mapping(row(known_of(adapting), held_of(Force(SECOND, 400.0), nothing_learnt), 0.0))
    assert raw['measured'] == 400.0
    at_rest = as_mapping(row(known_of(adapting), held_of(Force(SECOND, 20.0), estimate._replace(state=STUCK)), 0.0))
    assert at_rest['measured'] == 20.0


def test_a_bit_that_one_answer_had_is_seen_whatever_comes_after_it():
    clamped, free = (FeedForward(SECOND, 1.0, 0.9, bits) for bits in (int(Limited.CLAMP), 0))
    held = held_of(clamped, *[free] * 9)
    assert as_mapping(row(KNOWN, held, 0.0))['limited'] == Limited.CLAMP
    assert as_mapping(row(KNOWN, next_interval(held), 0.0))['limited'] == 0


def test_a_lamp_is_lit_for_half_a_second():
    held = held_of(FeedForward(SECOND, 1.0, 0.9, int(Limited.CLAMP)))
    rows = [row(KNOWN, held, 0.0), *(row(KNOWN, NOTHING_HELD, 0.1 * i) for i in range(1, 10))]
    assert recent_bits(reversed(rows[:5]), 0.4).limited == Limited.CLAMP
    assert recent_bits(reversed(rows), 0.9).limited == 0


def test_every_bit_of_the_status_has_words():
    assert set(STATUS_WORDS) == set(Status)
    assert len(set(STATUS_WORDS.values())) == len(Status)


@pytest.mark.parametrize('bit', Status)
def test_the_words_name_the_fault_and_only_that(bit: Status):
    (named,) = words(held_of(*RECORDS), bits=Bits(int(bit), 0))['faults']
    assert named.startswith(STATUS_WORDS[bit])


@pytest.mark.parametrize('state', FrictionState)
@pytest.mark.parametrize('direction', [-1, 0, 1])
def test_every_state_has_words(state: FrictionState, direction: int):
    said = words(held_of(ESTIMATE._replace(state=int(state), direction=direction)))['state']
    assert (said == 'unknown') == (state == FrictionState.UNKNOWN or (state, direction) == (FrictionState.BREAKAWAY, 0))


def test_the_verdict_is_good_only_if_nothing_is_wrong():
    held = held_of(*RECORDS)
    late = SECOND + round((TOO_OLD + 0.1) * SECOND)
    assert words(held)['verdict'] == 'good'
    assert words(NOTHING_HELD)['verdict'] == 'bad'
    assert words(held, now=late)['verdict'] == 'bad'
    assert words(held, said=Said(2, 'broken'))['verdict'] == 'bad'
    assert words(held, said=Said(1, 'tired'))['verdict'] == 'look'
    assert 'tired' in words(held, said=Said(1, 'tired'))['reason']
    assert words(held, bits=Bits(int(Status.OUTSIDE_IDENTIFIED_RANGE), 0))['verdict'] == 'look'
    assert words(held, bits=Bits(int(Status.MOTION_UNCERTAIN), 0))['verdict'] == 'good'  # each reversal has it
    without_reference = take(held_of(*RECORDS), ESTIMATE, late)
    assert words(without_reference, now=late)['verdict'] == 'look'


def test_a_number_is_in_one_row_and_what_did_not_come_again_is_a_gap():
    """Else a curve goes on, flat, for as long as one looks, when its data have stopped."""
    held = held_of(*RECORDS)
    again = take(held, Pressure(2 * SECOND, 3e6, 1e6), 2 * SECOND)
    shown = as_mapping(row(KNOWN, again, 2.0, SECOND))
    assert shown['pressure_a'] == 30.0
    gone = ('measured', 'estimate', 'low', 'high', 'feedforward', 'limit', 'below', 'error')
    assert [shown[name] for name in gone] == [None] * len(gone)
    assert shown['status'] == as_mapping(row(KNOWN, held, 1.0))['status']


def test_the_measured_friction_ends_with_the_force_sum_unless_the_estimate_has_it():
    fresh = take(held_of(*RECORDS), ESTIMATE, 2 * SECOND)
    assert as_mapping(row(KNOWN, fresh, 2.0, SECOND))['measured'] is None
    adapting = KNOWN._replace(adaptation='on')
    learnt = take(fresh, ESTIMATE._replace(residual=-2.0, adaptation_scale=1.05), 2 * SECOND)
    assert as_mapping(row(adapting, learnt, 2.0, SECOND))['measured'] == -42.0


def test_estimator_dead_inputs_dead_and_one_input_dead_are_told_apart():
    """7 s after the last estimate; all inputs come by the node."""
    held, now = held_of(*RECORDS), 8 * SECOND

    def said(presence: Presence, held=held, now: int = now, said: Said = NOTHING_SAID) -> tuple[str, str]:
        shown = situation(KNOWN, held, NO_BITS, now, said, presence)
        assert shown['verdict'] == 'bad'
        assert shown['faults'] == [shown['reason']]
        return shown['cause'], shown['reason']

    cause, reason = said(Presence(SECOND))
    assert cause == 'node'
    assert 'nothing from it for 7.0 s' in reason
    cause, reason = said(Presence(now, has_left=True))
    assert cause == 'node'
    assert 'left the graph' in reason
    cause, reason = said(Presence(now))
    assert cause == 'inputs'
    assert 'no estimate for 7.0 s: no velocity, no pressures, no force sum, no reference, no position' in reason
    assert 'the node is there' in reason
    late = take(held, Pressure(now, 1e6, 1e6), now)
    assert 'no velocity, no force sum' in said(Presence(now), late)[1]
    assert said(Presence(now), said=Said(0, 'inactive')) == ('estimate', 'no estimate for 7.0 s: the node is inactive')
    soon = SECOND + round(0.8 * SECOND)  # nothing came since: the node or its inputs, nobody knows yet
    assert said(Presence(SECOND), now=soon)[0] == 'estimate'


def test_each_tile_has_an_age():
    shown = words(held_of(*RECORDS), now=8 * SECOND)
    assert shown['answer_age'] == shown['feedforward_age'] == shown['error_age'] == 7.0
    assert words(NOTHING_HELD)['feedforward_age'] is None


def test_placeholder_seals_are_never_good():
    shown = words(held_of(*RECORDS), known=PLACEHOLDER)
    assert shown['verdict'] == 'bad'
    assert 'placeholder' in shown['reason']


def test_no_estimate_says_which_input_never_came():
    assert 'pressures' in words(held_of(Velocity(SECOND, 0.1)))['reason']


def test_off_is_a_mode_of_the_adaptation():
    assert OFF in MODES
    assert KNOWN.adaptation == OFF


def test_the_range_is_that_which_every_seal_was_identified_in():
    low, high = words(held_of(*RECORDS))['range']
    (seal, *_) = default_configuration().parameters().estimator.seals
    assert (low, high) == (seal.seal.pressure_min / 1e5, pytest.approx(seal.seal.pressure_max / 1e5, rel=1e-5))
