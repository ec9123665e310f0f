"""The view of a bag: the same rows and words as live, at any moment of the recording that has been read."""

import math
import time
from array import array
from collections.abc import Iterable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from seal_friction_ros.core.estimation.findings import BAD, STATUS_WORDS, USUAL, Finding
from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.messages.coder import DECODERS
from seal_friction_ros.core.messages.layouts import CONFIGURATION_TYPE, ESTIMATE_TYPE, MACHINE_TYPE
from seal_friction_ros.offline.bags import bag as bags
from seal_friction_ros.offline.bags.actuator_bag import RECORDED
from seal_friction_ros.offline.bags.bag import BagError, BagMessage
from seal_friction_ros.offline.bags.mapped_bag import MACHINE_CONFIGURATION, MappingFile, machine_messages
from seal_friction_ros.offline.monitor import actuator_view
from seal_friction_ros.offline.monitor.actuator_view import COLUMNS, RECENT, TOO_OLD, Held, Known, Row
from seal_friction_ros.offline.monitor.live_view import RATE
from seal_friction_ros.offline.monitor.node_view import NodeView

MOST_ROWS = 120_000  # of an actuator, 20 minutes at full pace; a longer bag has rows further apart (our choice)
_ROWS_A_MOMENT = 10  # rows from one moment whose words are kept to the next
_MOST_ROWS_AT_ONCE = 12_000  # in one answer to the page
_MOST_MARKS = 200  # on the slider
_PARTS = 800  # of the overview
_SLICE = 0.005  # [s] of reading, after which the page may ask (our choice)
_CONFIGURATION = '/configuration'
_SERIOUS = sum(map(int, STATUS_WORDS)) & ~int(USUAL)


class _Track:
    """What is kept of an actuator of a node, from row ``start`` on: it may appear in the middle of a bag."""

    def __init__(self, start: int, view: NodeView, actuator: str) -> None:
        self._view, self._actuator = view, actuator
        self._start = start
        self.rows = array('d')  # flat, NaN for None
        self.moments: list[tuple[Known, Held]] = []
        self.first = math.inf  # [s] of the first estimate

    def add(self, known: Known, held: Held, time: float, since: int) -> None:
        """Add a row, and after some of them a moment; arguments as of `row`."""
        if len(self.rows) // len(COLUMNS) % _ROWS_A_MOMENT == 0:
            self.moments.append((known, held))
        numbers = actuator_view.row(known, held, time, since)
        if self.first == math.inf and numbers[COLUMNS.index('estimate')] is not None:
            self.first = time
        self.rows.extend(math.nan if value is None else value for value in numbers)

    def slice(self, first: int, last: int) -> list[Row]:
        """Rows ``first`` to ``last``."""
        width = len(COLUMNS)
        flat = self.rows[max(first - self._start, 0) * width : max(last + 1 - self._start, 0) * width]
        return [_as_row(flat[i : i + width]) for i in range(0, len(flat), width)]

    def _columns(self, *names: str) -> list[FloatArray]:
        rows = np.array(self.rows).reshape(-1, len(COLUMNS))
        return [rows[:, COLUMNS.index(name)] for name in names]

    def overview(self) -> dict[str, Any]:
        """Time [s], lowest and highest friction [N] of each part of the bag; times of the reversals [s]."""
        time, friction, low = self._columns('time', 'estimate', 'low')
        starts = np.unique(np.linspace(0, len(time), min(_PARTS, len(time)), endpoint=False).astype(int))
        curve = zip(time[starts], np.fmin.reduceat(friction, starts), np.fmax.reduceat(friction, starts), strict=True)
        slides = np.flatnonzero(np.isfinite(low))  # there is a band while the rod slides
        turns = slides[1:][np.diff(np.sign(friction[slides])) != 0]
        return {
            'curve': [[actuator_view.finite(float(value)) for value in point] for point in curve],
            'reversals': [time[place] for place in turns[:: len(turns) // _PARTS + 1]],
        }

    def faults(self, gap: float) -> list[tuple[float, float, str]]:
        """Begin and end [s] of each stretch with a fault or without estimates, and its words; ``gap`` [s] ends one."""
        time, estimate, status = self._columns('time', 'estimate', 'status')
        newest = np.maximum.accumulate(np.where(np.isnan(estimate), -math.inf, time))
        silent = np.isfinite(newest) & (time - newest > TOO_OLD)
        bits = np.where(silent, 0, status.astype(np.int64) & _SERIOUS)
        wrong = np.flatnonzero(silent | (bits != 0))
        found = []
        for places in np.split(wrong, np.flatnonzero(np.diff(time[wrong]) > gap) + 1) if len(wrong) else ():
            words = ['no estimate'] * bool(silent[places].any())
            words += actuator_view.serious_words(int(np.bitwise_or.reduce(bits[places])))
            found.append((float(time[places[0]]), float(time[places[-1]]), '; '.join(words)))
        return found

    def findings(self, held: Held, *, is_end: bool) -> list[Finding]:
        """Findings on the run up to a moment."""
        return self._view.findings(self._actuator, None if is_end else held.estimate.stamp)

    def moment(self, number: int) -> tuple[int, Known, Held]:
        """The last moment that is kept up to a row: number of its row, configuration, records."""
        place = min(max(number - self._start, 0) // _ROWS_A_MOMENT, len(self.moments) - 1)
        return (self._start + place * _ROWS_A_MOMENT, *self.moments[place])


def _as_row(values: 'array[float]') -> Row:
    *numbers, status, limited = values
    return (*(None if math.isnan(value) else value for value in numbers), int(status), int(limited))


class RecordedView:
    """A bag, sampled at the pace of the live view: to its first estimate at once, the rest by `read`.

    With a ``mapping`` the estimates are made here. BagError: the bag cannot be read, or has no estimates; ValueError:
    the mapping does not fit the bag.
    """

    def __init__(self, bag: Path, mapping: MappingFile | None = None) -> None:
        self._bag = bag
        known = bags.bag_topics(bag)
        types = {topic: info.type_name for topic, info in known.items() if info.message_count}
        answers = (ESTIMATE_TYPE, MACHINE_TYPE)
        if not types:
            raise BagError(f'{bag}: no message in it, so nothing to estimate from')
        if mapping is not None:
            types = {topic: kind for topic, kind in types.items() if topic in mapping.file.topics}
            types[MACHINE_CONFIGURATION] = CONFIGURATION_TYPE
        elif not any(kind in answers for kind in types.values()):
            raise BagError(f'{bag}: no estimates in it: add them with seal_friction replay {bag} --out BAG')
        self._acted = {topic for topic in known if topic.endswith(RECORDED)}
        self._nodes = _nodes(bag, types, has_recorded=bool(self._acted))
        self._tracks: dict[str, _Track] = {}
        self._first = next((message.log_time for message in bags.read_messages(bag) if message.log_time), 0)
        self._duration = max((bags.bag_end(bag) - self._first) * 1e-9, 0.0)
        self._period = max(1.0 / RATE, self._duration / MOST_ROWS)
        self._read_until, self._is_read = 0.0, False
        self._failure: list[Finding] = []
        self._rows = self._sampled(machine_messages(bag, mapping))
        while not self._is_read and not any(track.first < math.inf for track in self._tracks.values()):
            self._read_row()
        if not self._tracks:
            reason = next((view.refused for view, _ in self._nodes if view.refused), 'there is none')
            raise BagError(f'{bag}: the configuration of the estimator in it cannot be read: {reason}')

    def read(self) -> Iterator[None]:
        """Read the rest, slice by slice: between two the page may ask. An error ends it, and the page says so."""
        try:
            while not self._is_read:
                end = time.monotonic() + _SLICE
                while not self._is_read and time.monotonic() < end:
                    self._read_row()
                yield
        except Exception as error:  # noqa: BLE001  of any kind: else the page would wait for the rest for ever
            self._failure, self._is_read = [self._not_read(error)], True

    def _not_read(self, error: Exception) -> Finding:
        reason = ' '.join(str(error).split()) or type(error).__name__
        after = 'mend what it names: what comes after it is not shown'
        if isinstance(error, bags.DamagedError):
            after = f'save the rest: seal_friction recover {self._bag}'
        return Finding(BAD, f'not read to its end: {reason}', after)

    def _read_row(self) -> None:
        until = next(self._rows, None)
        self._is_read = until is None
        self._read_until = self._read_until if until is None else until

    def _sampled(self, messages: Iterable[BagMessage]) -> Iterator[float]:
        """Take the messages; the time of each row that is made of them [s]."""
        step = round(self._period * 1e9)
        due = self._first + step
        for message in messages:
            while message.log_time > due:
                yield self._sample(due)
                due += step
            self._take(message)
        yield self._sample(due)

    def _take(self, message: BagMessage) -> None:
        """Take a message of a node; the feed-forward that acted counts, not that of a replay."""
        topic = message.topic.removesuffix(RECORDED)
        if topic + RECORDED in self._acted and topic == message.topic:
            return
        for view, topics in self._nodes:
            if not topics or topic in topics:
                view.take(topic, message.type_name, message.data, message.log_time)

    def _sample(self, now: int) -> float:
        time = (now - self._first) * 1e-9
        number = round(time / self._period) - 1
        for view, _ in self._nodes:
            for actuator, known in view.known.items():
                track = self._tracks.setdefault(view.label(actuator), _Track(number, view, actuator))
                track.add(known, view.held[actuator], time, now - round(self._period * 1e9))
                view.held[actuator] = actuator_view.next_interval(view.held[actuator])
        return time

    # --- for the page ---

    def describe(self) -> dict[str, Any]:
        """What does not change, and what has been read; ``loaded`` [s] is the duration once all is."""
        gap = max(RECENT, 2.0 * self._period, self._duration / _MOST_MARKS)
        return {
            'mode': 'bag',
            'name': self._bag.resolve().name,
            'columns': COLUMNS,
            'can_change': False,
            'start': str(self._first),
            'duration': round(self._duration, 3),
            'period': self._period,
            'loaded': round(self._duration if self._is_read else self._end, 3),
            'first': min(*(track.first for track in self._tracks.values()), self._duration),
            'faults': {label: track.faults(gap) for label, track in self._tracks.items()},
            'overview': {label: track.overview() for label, track in self._tracks.items()},
        }

    @property
    def _end(self) -> float:
        return min(self._read_until, self._duration)

    def view(self, label: str, since: float, until: float | None = None) -> dict[str, Any]:
        """Rows of an actuator in ``since`` to ``until`` [s], and the situation of all at ``until``."""
        label = label if label in self._tracks else next(iter(self._tracks))
        end = self._end if until is None else min(max(until, 0.0), self._end)
        last = round(end / self._period) - 1
        first = max(math.floor(since / self._period), last - _MOST_ROWS_AT_ONCE)
        every = {name: self._situation(track, last) for name, track in self._tracks.items()}
        rows = self._tracks[label].slice(first, max(last, 0))
        return actuator_view.frame(label, end, rows, every, node=self._bag.resolve().name, diagnostics=[])

    def _situation(self, track: _Track, last: int) -> dict[str, Any]:
        """Words of the moment at a row or up to `_ROWS_A_MOMENT` rows before."""
        place, known, held = track.moment(last)
        rows = track.slice(place - 100, place)
        time = rows[-1][0]
        is_end = self._is_read and last >= round(self._end / self._period) - 1
        found = [*self._failure, *track.findings(held, is_end=is_end)]
        now = self._first + round(time * 1e9)
        bits = actuator_view.recent_bits(reversed(rows), time)
        return actuator_view.situation(known, held, bits, now, findings=found)


def _nodes(bag: Path, types: dict[str, str], *, has_recorded: bool) -> list[tuple[NodeView, set[str]]]:
    """Estimators of a bag, and the topics of each; no topics: all of them.

    An estimator is known by its configuration; without one every topic of estimates is one. Topics belong to the
    estimator in whose namespace they are; if there is only one, to that.
    """
    configured = [topic.removesuffix(_CONFIGURATION) for topic, kind in types.items() if kind == CONFIGURATION_TYPE]
    names = configured or [topic for topic, kind in types.items() if kind == ESTIMATE_TYPE]
    definitions = partial(bags.read_definitions, bag)
    views = [NodeView(name, definitions, math.inf, has_recorded=has_recorded) for name in names]
    if not configured:
        for view in views:
            view.without_configuration()
    if len(views) == 1:
        return [(views[0], set())]
    return [(view, _below(view.node.rpartition('/')[0], types)) for view in views]


def _below(namespace: str, types: dict[str, str]) -> set[str]:
    """Topics of this package in a namespace, the configuration of its node among them."""
    return {topic for topic, kind in types.items() if topic.startswith(f'{namespace}/') and kind in DECODERS}
