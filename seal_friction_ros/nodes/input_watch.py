"""What a node says on the terminal about its inputs: what it waits for, when one stops, and when it is back."""

from collections.abc import Callable, Collection, Mapping
from typing import NamedTuple

_FIRST_REMINDER = 2.0  # [s] after the start; discovery takes one
_NEXT_REMINDER = 30.0  # [s]
_SHORTEST_SILENCE = 1.0  # [s] after which an input counts as stopped
_NO_PERIOD = 30.0  # [s] of silence after the only message
_PERIODS = 5.0  # of the input, for one that is slower (our choice)


class Remark(NamedTuple):
    """One line for the terminal."""

    text: str
    is_warning: bool


class _Known(NamedTuple):
    """What is known of one input."""

    count: int  # messages
    changed: float  # [s] when the last ones were seen
    absent: float  # [s] when it was last seen to be absent
    stopped: bool

    @property
    def longest_gap(self) -> float:
        """Silence [s] after which it counts as stopped."""
        if self.count < 2:
            return _NO_PERIOD
        return max(_SHORTEST_SILENCE, _PERIODS * (self.changed - self.absent) / self.count)


class InputWatch:
    """Follows the number of messages of each input.

    Args:
        needed: Inputs that the node cannot do without.
        started: Time [s] of the start, on any clock that never jumps.
        publishers: Words on the publishers of an input, for example ``no publisher``.
    """

    def __init__(self, needed: Collection[str], started: float, publishers: Callable[[str], str]) -> None:
        self._needed, self._publishers = needed, publishers
        self._next_reminder = started + _FIRST_REMINDER
        self._known: dict[str, _Known] = {}
        self._waited = False
        self._looked = started

    def look(self, received: Mapping[str, int], now: float) -> list[Remark]:
        """What is new, to be called every half a second or so, ``now`` [s] on the clock of ``started``.

        ``received``: number of messages of each input since the start.
        """
        remarks = [remark for name, count in received.items() for remark in self._look_at(name, count, now)]
        self._looked = now
        missing = [name for name in self._needed if name not in self._known]
        if missing and now >= self._next_reminder:
            self._next_reminder, self._waited = now + _NEXT_REMINDER, True
            waited_for = ', '.join(f'{name} ({self._publishers(name)})' for name in missing)
            remarks.append(Remark(f'waiting for {waited_for}', True))
        elif not missing and self._waited:
            self._waited = False
            remarks.append(Remark('every input that is needed has arrived', False))
        return remarks

    def _look_at(self, name: str, count: int, now: float) -> list[Remark]:
        """What is new of one input."""
        known = self._known.get(name)
        if known is None:
            if count:
                self._known[name] = _Known(count, now, self._looked, False)
            return []
        if count > known.count:
            self._known[name] = known._replace(count=count, changed=now, stopped=False)
            return [Remark(f'{name} is back after {now - known.changed:.1f} s', False)] if known.stopped else []
        if known.stopped or now - known.changed <= known.longest_gap:
            return []
        self._known[name] = known._replace(stopped=True)
        text = f'{name} has stopped: no message for {now - known.changed:.1f} s; {self._publishers(name)}'
        return [Remark(text, True)]
