"""OFF stays off: until a person lifts it, a scale above 0 is set to 0 again, whoever set it or came back with it.

``latch.press(nodes, now)``, then at the pace of the view ``latch.wanted(scales, now)`` for what has to be set, and
``latch.answered(node, answer, now)`` for what came of it. ``latch.document(scales, now)`` is what the page shows.
Times are of the clock of receipt [ns].
"""

import time
from collections import deque
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

ANSWER_TIMEOUT = 3.0  # [s] our choice: until a node that does not answer counts as one that did not change
_AGAIN = 0.5  # [s] our choice: a node that just begins may not get the first question
_SETTLING = 0.1  # [s] our choice: a configuration may come this long after the answer that belongs to it
_MOST_EVENTS = 20
_SECOND = 10**9  # [ns]
_ORDER = ('no', 'waiting', 'gone', 'yes')
"""Kinds of lines, failures first."""


class Answer(NamedTuple):
    """What came of a change of parameters."""

    confirmed: bool  # whether the node said yes and reads back what was asked for
    text: str  # for a person


class Scale(NamedTuple):
    """What the view knows of the scale of an actuator."""

    node: str
    label: str
    parameter: str  # its ROS name
    value: float  # [-] of the newest configuration
    starts: int = 1  # of the node
    is_gone: bool = False


class _Attempt(NamedTuple):
    """An attempt to set the scales of a node to 0."""

    begun: int  # [ns] first question
    asked: int  # [ns] newest question
    answered: int = 0  # [ns]; 0: the newest question has no answer
    answer: Answer | None = None  # the newest
    starts: int = 0  # of the node at that time

    @property
    def is_confirmed(self) -> bool:
        return self.answer is not None and self.answer.confirmed

    def is_over(self, now: int) -> bool:
        """Whether the scale of the configuration counts, and the node may be asked again."""
        return now - self.answered > _SETTLING * _SECOND if self.answered else now - self.asked > _AGAIN * _SECOND


class _Event(NamedTuple):
    """A scale that was above 0 while OFF was latched."""

    node: str
    time: int  # [ns]
    text: str
    outcome: str = 'being set to 0'


class OffLatch:
    """State of OFF for all actuators of a view."""

    def __init__(self) -> None:
        self.since: int | None = None  # [ns]; None: not latched
        self._presses = 0
        self._attempts: dict[str, _Attempt] = {}
        self._events: deque[_Event] = deque(maxlen=_MOST_EVENTS)

    def press(self, nodes: Sequence[str], now: int) -> None:
        """Latch; the nodes are being asked."""
        self.since = now if self.since is None else self.since
        self._presses += 1
        self._attempts |= {node: _Attempt(now, now) for node in nodes}

    def lift(self) -> None:
        """Let scales be set again; none is."""
        self.since = None
        self._attempts.clear()
        self._events.clear()

    def answered(self, node: str, answer: Answer, starts: int, now: int) -> None:
        """Take what came of an attempt, in time or late; what is confirmed stays so."""
        attempt = self._attempts.get(node)
        if attempt is None or (attempt.is_confirmed and not answer.confirmed):
            return
        self._attempts[node] = attempt._replace(answered=now, answer=answer, starts=starts)
        if answer.confirmed:
            self._events = deque((_ended(one, now) if one.node == node else one for one in self._events), _MOST_EVENTS)

    def wanted(self, scales: Sequence[Scale], now: int) -> dict[str, dict[str, float]]:
        """Scales that have to be set to 0 now, by node and parameter; they count as asked for."""
        if self.since is None:
            return {}
        nodes = dict.fromkeys(one.node for one in scales)
        return {
            node: {one.parameter: 0.0 for one in scales if one.node == node}
            for node in nodes
            if self._begins(node, [one for one in scales if one.node == node and one.value > 0.0], now)
        }

    def _begins(self, node: str, above: Sequence[Scale], now: int) -> bool:
        """Begin an attempt, or ask again, if scales of a node are above 0 or it has not confirmed; whether it does."""
        attempt = self._attempts.get(node)
        has_failed = attempt is not None and not attempt.is_confirmed
        if (attempt is not None and not attempt.is_over(now)) or not (above or has_failed):
            return False
        if attempt is not None and has_failed:
            self._attempts[node] = attempt._replace(asked=now, answered=0)
            return True
        for one in above:
            self._events.append(_Event(node, now, _told(one, attempt)))
        self._attempts[node] = _Attempt(now, now)
        return True

    def document(self, scales: Sequence[Scale], unread: Mapping[str, str], now: int) -> dict[str, Any] | None:
        """The state for the page: a line an actuator, failures first, and what OFF had to undo; None: not latched.

        ``unread`` are the nodes whose configuration is not known, and why.
        """
        if self.since is None:
            return None
        lines = [('no', f'NOT OFF: {node}: {why or "no configuration came"}') for node, why in unread.items()]
        lines += sorted((self._line(one, now) for one in scales), key=lambda line: _ORDER.index(line[0]))
        return {
            'since': _clock(self.since),
            'presses': self._presses,
            'kind': lines[0][0] if lines else 'no',
            'lines': lines or [('no', 'NOT OFF: no estimator is known; one that comes is set to 0')],
            'events': [f'{_clock(one.time)} {one.text}: {one.outcome}' for one in reversed(self._events)],
        }

    def _line(self, one: Scale, now: int) -> tuple[str, str]:
        """Kind and text of an actuator."""
        attempt = self._attempts.get(one.node)
        if attempt is not None and attempt.answer is None:
            if now - attempt.begun > ANSWER_TIMEOUT * _SECOND:
                return 'no', f'NOT CONFIRMED by {one.label}: no answer within {ANSWER_TIMEOUT:g} s'
            return 'waiting', f'{one.label}: sent, no answer yet'
        if attempt is not None and attempt.answer is not None and not attempt.answer.confirmed:
            return 'no', ('' if one.label == one.node else f'{one.label}: ') + attempt.answer.text
        if not one.value <= 0.0 and (attempt is None or attempt.is_over(now)):
            return 'no', f'NOT OFF: {one.label} has {one.parameter} = {one.value:g}'
        if one.is_gone:
            return 'gone', f'{one.label} is gone: its scale was 0; if it comes back with another one, it is set to 0'
        if attempt is None or attempt.starts != one.starts:
            return 'yes', f'OFF: {_told(one, attempt)}'
        return 'yes', f'OFF: confirmed by {one.label} at {_clock(attempt.answered)}: {one.parameter} = 0'


def _told(one: Scale, attempt: _Attempt | None) -> str:
    """How an actuator came to its scale since the newest attempt."""
    if attempt is not None and attempt.starts == one.starts:
        return f'somebody set {one.parameter} of {one.label} to {one.value:g}'
    return f'{one.label} came{"" if attempt is None else " back"} with {one.parameter} = {one.value:g}'


def _ended(event: _Event, now: int) -> _Event:
    if event.outcome != _Event._field_defaults['outcome']:
        return event
    return event._replace(outcome=f'set to 0 again after {(now - event.time) / _SECOND:.2f} s')


def _clock(moment: int) -> str:
    return time.strftime('%H:%M:%S', time.localtime(moment / _SECOND))
