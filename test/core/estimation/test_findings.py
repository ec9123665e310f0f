"""Findings of a run: the same of its columns and of its stream, and each limit from both sides."""

from typing import Any

import numpy as np
import pytest

from seal_friction_ros.core.estimation.findings import (
    BAD,
    GOOD,
    LOOK,
    Finding,
    Follower,
    Limits,
    findings_of,
    seen_in,
    together,
    verdict_of,
)
from seal_friction_ros.core.estimation.strokes import Samples
from seal_friction_ros.core.friction.states import FrictionState
from seal_friction_ros.core.messages.records import Status

RATE = 100.0  # [Hz]
FRICTION, STD = 40.0, 3.0  # [N]


def run(strokes: int = 12, scale: Any = None, offset: float = 2.0, **columns: Any) -> Samples:
    """Strokes of a second to and fro with rests of half a second before them, at 2 MPa.

    Args:
        strokes: Their number.
        scale: True friction over the estimated one, of the time [s].
        offset: Of the force sum [N].
        columns: Instead of those made here.
    """
    moment = np.arange(round(1.5 * RATE)) / RATE
    slides = np.tile(moment >= 0.5, strokes)
    time = np.arange(len(slides)) / RATE
    side = np.repeat(np.where(np.arange(strokes) % 2, -1, 1), len(moment))
    true = FRICTION * (np.ones(len(time)) if scale is None else scale(time))
    push = np.where(slides, 1.0, np.tile(np.minimum(moment / 0.5, 1.0), strokes))
    made: dict[str, Any] = {
        'time': time,
        'velocity': 0.02 * side * slides,
        'pressure': np.full(len(time), 2e6),
        'force_sum': side * true * push + offset,
        'coulomb_friction': np.full(len(time), FRICTION),
        'coulomb_friction_std': np.full(len(time), STD),
        'breakaway_force': np.full(len(time), FRICTION),
        'friction_force': FRICTION * side * slides,
        'adaptation_scale': np.ones(len(time)),
        'state': np.where(slides, int(FrictionState.SLIDING), int(FrictionState.STUCK)),
        'direction': side * slides,
        'status': np.zeros(len(time), np.int64),
    }
    return Samples(**(made | columns))


def verdict(samples: Samples, **known: Any):
    return verdict_of(findings_of(seen_in(samples), **known))


def with_gap(samples: Samples, begin: float, length: float) -> Samples:
    """Without the estimates of a time."""
    kept = (samples.time < begin) | (samples.time >= begin + length)
    return Samples(*(column[kept] for column in samples))


def flagged(share: float, bit: Status) -> Samples:
    """With a bit in a share of the estimates, the first of them in the middle of the rests."""
    plain = run()
    chosen = np.arange(len(plain.time)) % 1000 < 1000 * share
    return run(status=np.where(chosen, int(bit), 0))


@pytest.mark.parametrize('end', [4.0, 11.0, 17.9])
def test_a_stream_shows_what_its_columns_show(end):
    samples = with_gap(run(scale=lambda time: 1.0 + 0.01 * time), 7.0, 1.2)
    part, stream = seen_in(Samples(*(column[samples.time <= end] for column in samples))), Follower()
    for row in zip(*samples, strict=True):
        if row[0] <= end:
            stream.add((1e9 + row[0], *row[1:]))
    seen = stream.seen()
    assert seen[2:7] == part[2:7]
    np.testing.assert_array_equal(seen.counts, part.counts)
    assert [length for _, length in seen.silences] == pytest.approx([length for _, length in part.silences])
    for mine, theirs in zip(seen.events, part.events, strict=True):
        assert [one.direction for one in mine] == [one.direction for one in theirs]
        assert [one.force_sum for one in mine] == pytest.approx([one.force_sum for one in theirs])


def test_a_stream_forgets_what_was_longer_ago_than_it_keeps():
    samples, stream = run(strokes=40), Follower(kept=15.0)
    for row in zip(*samples, strict=True):
        stream.add(row)
    seen = stream.seen()
    assert 8 <= len(seen.events.strokes) <= 16
    assert seen.end - seen.begin < 25.0
    assert together([]).estimates == 0


def test_a_good_run_is_good_and_says_how_many_strokes_agree():
    found = verdict(run())
    assert found.level == GOOD
    assert found.text == '12 of 12 measured strokes lie in the 95 % band of the estimate.'


@pytest.mark.parametrize(
    ('change', 'level', 'words'),
    [
        (0.09, GOOD, '12 of 12'),
        (0.11, LOOK, '1.11 times that of the seal file (+11 %)'),
        (-0.11, LOOK, '0.89 times'),
        (0.6, BAD, '1.60 times'),
    ],
)
def test_a_change_against_the_seal_file_is_told_from_a_tenth_on(change, level, words):
    samples = run(scale=lambda time: 1.0 + change + 0.0 * time, coulomb_friction_std=np.full(1800, 15.0))
    found = verdict(samples)
    assert (found.level, words in found.text) == (level, True)
    if level == BAD:
        assert verdict(samples, limits=Limits(scale_high=2.0)).level == LOOK


def test_a_scale_that_was_learnt_is_a_change_against_the_seal_file():
    learnt = run(scale=lambda time: 0.8 + 0.0 * time, adaptation_scale=np.full(1800, 0.8))
    samples = learnt._replace(friction_force=0.8 * learnt.friction_force, breakaway_force=0.8 * learnt.breakaway_force)
    assert verdict(samples).level == GOOD  # as if the file had this friction
    assert '(-20 %)' in verdict(samples, uses_scale=True).text


@pytest.mark.parametrize(('drift', 'level'), [(0.08, GOOD), (0.14, LOOK), (-0.14, LOOK)])
def test_a_drift_whose_means_cancel_is_told(drift, level):
    span = 40 * 1.5
    found = verdict(run(40, scale=lambda time: 1.0 + drift * (time / span - 0.5)))
    assert found.level == level
    assert (f'drifts by {100.0 * drift:+.0f} %' in found.text) == (level == LOOK)


def test_another_law_at_another_pressure_is_no_drift():
    """Twelve strokes at one pressure, then twelve at another with 30 % more friction than estimated."""
    later = lambda time: np.where(time < 18.0, 1.0, 1.3)  # noqa: E731
    samples = run(24, scale=later, pressure=np.repeat([2e6, 4e6], 1800))
    assert not any('drifts' in one.what for one in findings_of(seen_in(samples)))
    assert any('drifts' in one.what for one in findings_of(seen_in(run(24, scale=later))))


@pytest.mark.parametrize(('length', 'level'), [(0.4, GOOD), (1.0, LOOK), (4.0, BAD)])
def test_a_time_without_estimates_is_told_with_its_beginning(length, level):
    found = verdict(with_gap(run(), 3.0, length))
    assert found.level == level
    if level != GOOD:
        assert f'o estimate for {length:.1f} s' in found.text
        assert 'first at 3.0 s' in found.text


@pytest.mark.parametrize(
    ('share', 'bit', 'level', 'words'),
    [
        (0.005, Status.PRESSURE_STALE, GOOD, '12 of 12'),
        (0.05, Status.PRESSURE_STALE, LOOK, 'the pressure is old'),
        (0.2, Status.PRESSURE_STALE, BAD, 'the pressure is old'),
        (0.2, Status.OUTSIDE_IDENTIFIED_RANGE, LOOK, 'extrapolated'),
        (0.2, Status.MODEL_DISAGREES, LOOK, 'of the sliding estimates disagree'),
        (0.2, Status.MOTION_UNCERTAIN, GOOD, '10 of 10'),  # every reversal has it
        (0.2, Status(2 * int(max(Status))), GOOD, '10 of 10'),  # of a newer version
    ],
)
def test_status_bits_count_by_what_they_mean(share, bit, level, words):
    found = verdict(flagged(share, bit))
    assert (found.level, words in found.text) == (level, True), found.text


def test_no_estimates_and_few_strokes_and_the_wrong_sign_are_told():
    assert verdict(run(0)).text == 'No estimates.'
    assert verdict(run(1, state=np.zeros(150, np.int64))).level == LOOK
    assert 'nly 3 measured strokes' in verdict(run(3)).text
    plain = run()
    against = verdict(plain._replace(force_sum=-plain.force_sum))
    assert (against.level, 'check the signs' in against.next) == (BAD, True)


def test_starts_have_their_own_finding():
    plain = run()
    hard = np.where(plain.state == int(FrictionState.SLIDING), plain.force_sum, 1.5 * plain.force_sum)
    assert '0 of 12 measured starts' in verdict(plain._replace(force_sum=hard)).text
    harder = np.where(plain.state == int(FrictionState.SLIDING), plain.force_sum, 3.0 * plain.force_sum)
    found = findings_of(seen_in(plain._replace(force_sum=harder)))
    assert found[0].level == BAD
    assert 'times the Coulomb friction' in found[0].what


def test_the_first_of_the_worst_decides():
    found = [Finding(LOOK, 'a', 'x'), Finding(BAD, 'b', 'y', 0.5, since=2.0), Finding(BAD, 'c', 'z')]
    assert verdict_of(found) == (BAD, 'B, first at 2.0 s.', 'y.')
    assert verdict_of([found[0]._replace(name='rig')]).text == 'rig: a.'
