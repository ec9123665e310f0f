"""Recorded answers against new ones: how many differ, and what the first difference is."""

from collections import Counter, deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import islice

from seal_friction_ros.core.estimation.messages import DECODERS, ESTIMATE_TYPE, FEEDFORWARD_TYPE

MOST_WAITING = 100_000  # answers that a recording may be late by; it bounds memory where none are recorded any more


@dataclass(frozen=True)
class Verdict:
    """What a replay found."""

    velocity_samples: int
    recorded_estimates: int
    recorded_feedforwards: int
    differing: int
    """estimates and feed-forwards whose bytes differ from the recorded ones, missing and surplus ones included"""
    first_difference: str
    """in words; empty if there is none"""

    @property
    def identical(self) -> bool:
        """Whether all that was recorded was reproduced to the byte, and there was an estimate."""
        return self.recorded_estimates > 0 and not self.differing


class Stream:
    """Recorded messages of one type against the new ones that wait for them.

    Args:
        type_name: Their type.
    """

    def __init__(self, type_name: str) -> None:
        self.type_name = type_name
        self.pending: deque[bytes] = deque()
        self.recorded = self.differing = 0
        self.first = ''
        self._given_up = 0

    def wait(self, data: bytes) -> None:
        """Have a new message wait; one that `MOST_WAITING` others came after waits no longer."""
        self.pending.append(data)
        if len(self.pending) > MOST_WAITING:
            self.pending.popleft()
            self._given_up += 1

    def take(self, data: bytes) -> None:
        """Compare one recorded message."""
        self.recorded += 1
        pending, name = self.pending, f'{_kind(self.type_name)} {self.recorded}'
        if self._given_up:
            self._differs(lambda: f'{name}: the ones before it were not recorded', self._given_up)
            self._given_up = 0
        while data in islice(pending, 1, None) and data != pending[0]:  # some were not recorded
            pending.popleft()
            self._differs(lambda: f'{name}: the ones before it were not recorded')
        expected = pending.popleft() if pending else b''
        if expected != data:
            self._differs(lambda: _difference(self.type_name, name, data, expected))

    def finish(self, may_lack: int) -> None:
        """Count what was never recorded, if it is more than what may be missing."""
        lacking = len(self.pending) + self._given_up
        if lacking > may_lack:
            words = f'{lacking} at the end have no recorded {_kind(self.type_name)}'
            self._differs(lambda: f'velocity samples: {words}', lacking)

    def _differs(self, words: Callable[[], str], count: int = 1) -> None:
        self.differing += count
        self.first = self.first or words()


def verdict_of(velocities: int, streams: Mapping[str, Stream], *, is_cut: bool) -> Verdict:
    """Verdict at the end of a bag; ``is_cut``: an answer to its last message may be missing."""
    for stream in streams.values():
        stream.finish(may_lack=int(is_cut))
    recorded = Counter({type_name: stream.recorded for type_name, stream in streams.items()})
    return Verdict(
        velocities,
        recorded[ESTIMATE_TYPE],
        recorded[FEEDFORWARD_TYPE],
        sum(stream.differing for stream in streams.values()),
        next((stream.first for stream in streams.values() if stream.first), ''),
    )


def _kind(type_name: str) -> str:
    return {ESTIMATE_TYPE: 'estimate', FEEDFORWARD_TYPE: 'feed-forward'}[type_name]


def _difference(type_name: str, name: str, recorded: bytes, expected: bytes) -> str:
    if not expected:
        return f'{name}: recorded, but no velocity sample before it'
    decode = DECODERS[type_name]
    try:
        was, now = decode(recorded), decode(expected)
    except ValueError as error:
        return f'{name}: {error}'
    fields = [f'{field} {a!r} -> {b!r}' for field, a, b in zip(was._fields, was, now, strict=True) if a != b]
    return f'{name} at {was.stamp} ns: recorded -> replayed: {", ".join(fields) or "frame or padding"}'
