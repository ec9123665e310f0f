"""Recorded answers of the estimator against replayed ones: number of differences, and the first difference."""

from collections import Counter, deque
from collections.abc import Callable, Iterable, Mapping
from itertools import islice
from typing import Any, NamedTuple

from seal_friction_ros.core.estimation.configuration import ALGORITHM_VERSION
from seal_friction_ros.core.messages.coder import DECODERS
from seal_friction_ros.core.messages.layouts import ESTIMATE_TYPE, FEEDFORWARD_TYPE, GROWN, MACHINE_TYPE

LONGEST_QUEUE = 100_000  # replayed answers that may wait for a recorded one; bounds memory if recording has stopped


class ReplayResult(NamedTuple):
    """Result of a replay."""

    velocity_samples: int
    recorded_estimates: int
    recorded_feedforwards: int
    differing: int
    """estimates and feed-forwards whose bytes differ from the recorded ones, including missing and surplus ones"""
    first_difference: str  # for a person; empty if there is none
    recorded_version: int = ALGORITHM_VERSION  # of estimator and feed-forward when the bag was recorded

    @property
    def identical(self) -> bool:
        """Whether the bag holds estimates, and the replay reproduced every recorded answer to the byte."""
        return self.recorded_estimates > 0 and not self.differing

    def numbers(self) -> dict[str, Any]:
        """Numbers for JSON."""
        return {**self._asdict(), 'version': ALGORITHM_VERSION, 'identical': self.identical}

    def summary(self, *, verified: bool) -> str:
        """One line for a person; ``verified``: about the comparison with the recorded answers."""
        if not verified:
            return f'{self.velocity_samples} velocity samples replayed, not compared: --verify compares'
        if self.identical:
            counts = f'{self.recorded_estimates} estimates and {self.recorded_feedforwards} feed-forwards'
            return f'{counts}, identical to the byte'
        if not self.recorded_estimates:
            return 'no estimates in the bag to compare with'
        recorded, reason = self.recorded_estimates + self.recorded_feedforwards, ''
        if self.recorded_version != ALGORITHM_VERSION:
            made = f'version {self.recorded_version} of the algorithm made them'
            reason = f': {made}, this is version {ALGORITHM_VERSION} (see CHANGELOG.rst)'
        return f'{self.differing} of {recorded} recorded messages differ{reason}; {self.first_difference}'


class AnswerStream:
    """Recorded answers of one message type, and the replayed ones that wait for them."""

    def __init__(self, type_name: str) -> None:
        self.type_name = type_name
        self.pending: deque[bytes] = deque()
        self.recorded = self.differing = 0
        self.first = ''
        self._discarded = 0
        self._grown = 0  # [bytes] that the recorded messages have not, if their type has grown since

    def add_replayed(self, data: bytes) -> None:
        """Queue a replayed answer; the oldest one is discarded when the queue is longer than `LONGEST_QUEUE`."""
        self.pending.append(data[: len(data) - self._grown])
        if len(self.pending) > LONGEST_QUEUE:
            self.pending.popleft()
            self._discarded += 1

    def compare_recorded(self, data: bytes) -> None:
        """Compare a recorded answer with the replayed ones that wait.

        A message that was recorded before its type grew has fewer bytes: what it has must be the same.
        """
        self.recorded += 1
        pending, name = self.pending, f'{_kind(self.type_name)} {self.recorded}'
        if self._discarded:
            self._count_difference(lambda: f'{name}: the ones before it were not recorded', self._discarded)
            self._discarded = 0
        grown = len(pending[0]) - len(data) if pending and not self._grown else 0
        if grown in GROWN.get(self.type_name, ()):
            self._grown = grown
            pending = self.pending = deque(answer[: len(answer) - grown] for answer in pending)
        while data in islice(pending, 1, None) and data != pending[0]:  # some were not recorded
            pending.popleft()
            self._count_difference(lambda: f'{name}: the ones before it were not recorded')
        expected = pending.popleft() if pending else b''
        if expected != data:
            self._count_difference(lambda: _difference(self.type_name, name, data, expected))

    def finish(self, may_lack: int) -> None:
        """Count the replayed answers without a recorded one, if there are more than ``may_lack``."""
        lacking = len(self.pending) + self._discarded
        if lacking > may_lack:
            text = f'velocity samples: {lacking} at the end have no recorded {_kind(self.type_name)}'
            self._count_difference(lambda: text, lacking)

    def _count_difference(self, text: Callable[[], str], count: int = 1) -> None:
        self.differing += count
        self.first = self.first or text()


def replay_result(
    velocities: int,
    streams: Mapping[str, AnswerStream],
    versions: Iterable[int],
    *,
    is_cut: bool,
    names_topics: bool = False,
) -> ReplayResult:
    """Result at the end of a bag, of its streams by message type or topic.

    The ``versions`` of the algorithm are those of the recorded configurations. ``is_cut``: the answer to the last
    message may be missing. ``names_topics``: the first difference begins with its topic.
    """
    recorded: Counter[str] = Counter()
    for stream in streams.values():
        stream.finish(may_lack=int(is_cut))
        recorded[stream.type_name] += stream.recorded
    first = next(((topic, stream.first) for topic, stream in streams.items() if stream.first), ('', ''))
    return ReplayResult(
        velocities,
        recorded[ESTIMATE_TYPE] + recorded[MACHINE_TYPE],
        recorded[FEEDFORWARD_TYPE],
        sum(stream.differing for stream in streams.values()),
        ': '.join(first) if names_topics and first[1] else first[1],
        min(versions, default=ALGORITHM_VERSION),
    )


def _kind(type_name: str) -> str:
    return {ESTIMATE_TYPE: 'estimate', FEEDFORWARD_TYPE: 'feed-forward'}.get(type_name, 'command')


def _difference(type_name: str, name: str, recorded: bytes, expected: bytes) -> str:
    if not expected:
        return f'{name}: recorded, but no velocity sample before it'
    if type_name not in DECODERS:
        return f'{name}: other bytes'
    decode = DECODERS[type_name]
    try:
        was, now = decode(recorded), decode(expected)
    except ValueError as error:
        return f'{name}: {error}'
    fields = [f'{field} {a!r} -> {b!r}' for field, a, b in zip(was._fields, was, now, strict=True) if a != b]
    return f'{name} at {was.stamp} ns: recorded -> replayed: {", ".join(fields) or "frame or padding"}'
