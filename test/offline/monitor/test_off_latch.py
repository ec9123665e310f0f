"""OFF stays off: a scale above 0 is set to 0 again, and the page says what, who and when, until a person lifts OFF."""

import math

import pytest

from seal_friction_ros.offline.monitor.off_latch import ANSWER_TIMEOUT, Answer, OffLatch, Scale

SECOND = 10**9  # [ns]
TICK = SECOND // 100
NOW = 1_000 * SECOND
AXIS = Scale('/axis', '/axis', 'feedforward.scale', 0.9)
BOOM, ARM = (
    Scale('/machine', f'{name} (/machine)', f'{name}.feedforward.scale', 0.8, 1, False) for name in ('boom', 'arm')
)
YES = Answer(True, 'OFF: confirmed')
NO = Answer(False, 'REJECTED by /machine: no')


def off(*scales: Scale) -> tuple[Scale, ...]:
    return tuple(one._replace(value=0.0) for one in scales)


def latched(*scales: Scale, starts: int = 1) -> OffLatch:
    """A latch that every node has confirmed."""
    latch = OffLatch()
    latch.press(list(dict.fromkeys(one.node for one in scales)), NOW)
    for one in scales:
        latch.answered(one.node, YES, starts, NOW)
    return latch


def lines(latch: OffLatch, *scales: Scale, now: int = NOW + SECOND) -> list[tuple[str, str]]:
    return latch.document(scales, {}, now)['lines']


def test_without_off_nothing_is_set_and_nothing_said():
    latch = OffLatch()
    assert latch.wanted([AXIS], NOW) == {}
    assert latch.document([AXIS], {}, NOW) is None


def test_what_is_confirmed_and_stays_at_0_is_left_alone():
    latch = latched(AXIS)
    assert latch.wanted(off(AXIS), NOW + SECOND) == {}
    ((kind, text),) = lines(latch, *off(AXIS))
    assert kind == 'yes'
    assert text.startswith('OFF: confirmed by /axis at ')
    assert text.endswith('feedforward.scale = 0')


def test_a_scale_that_somebody_sets_is_set_to_0_in_the_same_tick_and_said():
    latch, now = latched(AXIS), NOW + SECOND
    assert latch.wanted([AXIS._replace(value=0.5)], now) == {'/axis': {'feedforward.scale': 0.0}}
    assert latch.wanted([AXIS._replace(value=0.5)], now + TICK) == {}  # it is asked already
    state = latch.document([AXIS._replace(value=0.5)], {}, now + TICK)
    assert state['kind'] != 'yes'
    (event,) = state['events']
    assert 'somebody set feedforward.scale of /axis to 0.5: being set to 0' in event
    latch.answered('/axis', YES, 1, now + 3 * TICK)
    state = latch.document(off(AXIS), {}, now + 4 * TICK)
    assert state['kind'] == 'yes'
    (event,) = state['events']
    assert event.endswith('somebody set feedforward.scale of /axis to 0.5: set to 0 again after 0.03 s')


def test_a_node_that_comes_back_with_a_scale_is_told_from_one_that_somebody_set():
    latch, now = latched(AXIS), NOW + SECOND
    assert latch.wanted([AXIS._replace(starts=2)], now) == {'/axis': {'feedforward.scale': 0.0}}
    latch.answered('/axis', YES, 2, now)
    assert latch.wanted([AXIS._replace(starts=2, value=0.3)], now + SECOND)
    second, first = latch.document([AXIS], {}, now)['events']
    assert '/axis came back with feedforward.scale = 0.9' in first
    assert 'somebody set feedforward.scale of /axis to 0.3' in second


def test_a_node_that_comes_only_after_off_is_off_too():
    latch = latched(AXIS)
    assert latch.wanted([*off(AXIS), BOOM], NOW + SECOND) == {'/machine': {'boom.feedforward.scale': 0.0}}
    (event,) = latch.document([BOOM], {}, NOW + SECOND)['events']
    assert 'boom (/machine) came with boom.feedforward.scale = 0.8' in event


def test_a_node_that_comes_back_with_0_says_so_and_is_not_asked():
    latch, back = latched(AXIS), AXIS._replace(value=0.0, starts=2)
    assert latch.wanted([back], NOW + SECOND) == {}
    assert lines(latch, back) == [('yes', 'OFF: /axis came back with feedforward.scale = 0')]


def test_the_configuration_may_come_a_moment_after_the_answer():
    latch = latched(AXIS)
    assert latch.wanted([AXIS], NOW + 5 * TICK) == {}
    assert latch.document([AXIS], {}, NOW + 5 * TICK)['events'] == []


def test_a_node_that_does_not_answer_is_asked_again_and_told_and_a_late_answer_replaces_that():
    latch = OffLatch()
    latch.press(['/axis'], NOW)
    assert lines(latch, AXIS, now=NOW + SECOND) == [('waiting', '/axis: sent, no answer yet')]
    asked = [at for at in range(0, 320, 1) if latch.wanted([AXIS], NOW + at * TICK)]
    assert 2 <= len(asked) <= 8
    ((kind, text),) = lines(latch, AXIS, now=NOW + round((ANSWER_TIMEOUT + 0.1) * SECOND))
    assert kind == 'no'
    assert text == 'NOT CONFIRMED by /axis: no answer within 3 s'
    latch.answered('/axis', Answer(False, 'NOT CONFIRMED: no answer from /axis within 3 s'), 1, NOW + 4 * SECOND)
    assert lines(latch, AXIS, now=NOW + 4 * SECOND)[0][0] == 'no'
    latch.answered('/axis', YES, 1, NOW + 5 * SECOND)
    assert lines(latch, *off(AXIS), now=NOW + 5 * SECOND)[0][0] == 'yes'
    assert latch.document(off(AXIS), {}, NOW + 5 * SECOND)['events'] == []  # nobody set it: it was late


def test_what_was_not_confirmed_is_asked_again_also_if_its_scale_was_0():
    latch = OffLatch()
    latch.press(['/machine'], NOW)
    latch.answered('/machine', NO, 1, NOW)
    assert latch.wanted(off(BOOM, ARM), NOW + SECOND) == {
        '/machine': {'boom.feedforward.scale': 0.0, 'arm.feedforward.scale': 0.0}
    }


def test_one_line_an_actuator_failures_first():
    latch = OffLatch()
    latch.press(['/axis', '/machine'], NOW)
    latch.answered('/axis', YES, 1, NOW)
    latch.answered('/machine', NO, 1, NOW)
    found = latch.document([*off(AXIS), BOOM, ARM], {'/later': 'made by version 3'}, NOW)
    assert [kind for kind, _ in found['lines']] == ['no', 'no', 'no', 'yes']
    texts = [text for _, text in found['lines']]
    assert texts[0] == 'NOT OFF: /later: made by version 3'
    assert texts[1:3] == [f'{name} (/machine): REJECTED by /machine: no' for name in ('boom', 'arm')]
    assert found['kind'] == 'no'


def test_a_node_that_is_gone_is_not_called_off():
    ((kind, text),) = lines(latched(AXIS), AXIS._replace(value=0.0, is_gone=True))
    assert kind == 'gone'
    assert 'if it comes back' in text


@pytest.mark.parametrize('value', [0.5, math.nan])
def test_a_scale_that_is_above_0_or_not_known_is_never_called_off(value: float):
    assert lines(latched(AXIS), AXIS._replace(value=value))[0][0] == 'no'


def test_lifting_sets_nothing_and_ends_the_watch():
    latch = latched(AXIS)
    latch.wanted([AXIS], NOW + SECOND)
    latch.lift()
    assert latch.wanted([AXIS], NOW + 2 * SECOND) == {}
    assert latch.document([AXIS], {}, NOW + 2 * SECOND) is None
    latch.answered('/axis', YES, 1, NOW + 2 * SECOND)  # late
    latch.press(['/axis'], NOW + 3 * SECOND)
    state = latch.document([AXIS], {}, NOW + 3 * SECOND)
    assert state['events'] == []
    assert state['kind'] == 'waiting'


def test_a_storm_of_sets_does_not_grow_without_end():
    latch = latched(AXIS)
    for number in range(1, 1000):
        latch.wanted([AXIS], NOW + number * SECOND)
        latch.answered('/axis', YES, 1, NOW + number * SECOND)
    assert 1 <= len(latch.document([AXIS], {}, NOW)['events']) <= 20
