"""The view of a bag: the same rows and words as live, at any moment of the recording."""

import math
from array import array
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from seal_friction_ros.core.estimation.findings import Finding
from seal_friction_ros.core.messages.coder import DECODERS
from seal_friction_ros.core.messages.layouts import CONFIGURATION_TYPE, ESTIMATE_TYPE, MACHINE_TYPE
from seal_friction_ros.offline.bags.actuator_bag import RECORDED
from seal_friction_ros.offline.bags.bag import (
    BagError,
    BagMessage,
    TopicInfo,
    bag_topics,
    read_definitions,
    read_messages,
)
from seal_friction_ros.offline.bags.mapped_bag import MACHINE_CONFIGURATION, MappingFile, machine_messages
from seal_friction_ros.offline.monitor.actuator_view import (
    COLUMNS,
    RECENT,
    TOO_OLD,
    Held,
    Known,
    Row,
    next_interval,
    recent_bits,
    row,
    serious_words,
    situation,
)
from seal_friction_ros.offline.monitor.live_view import CHANGEABLE, RATE
from seal_friction_ros.offline.monitor.node_view import NodeView
from seal_friction_ros.offline.monitor.off_latch import Answer
from seal_friction_ros.offline.work.progress import progress

MOST_ROWS = 120_000  # of an actuator, 20 minutes at full pace; a longer bag has rows further apart (our choice)
_ROWS_A_MOMENT = 10  # rows from one moment whose words are kept to the next
_MOST_ROWS_AT_ONCE = 12_000  # in one answer to the page
_MOST_MARKS = 200  # on the slider
_CONFIGURATION = '/configuration'


class _Track:
    """What is kept of one actuator.

    Args:
        start: Number of its first row: the actuator may appear in the middle of a bag.
        view: Its node.
        actuator: Its name there.
    """

    def __init__(self, start: int, view: NodeView, actuator: str) -> None:
        self._view, self._actuator = view, actuator
        self._start = start
        self.rows = array('d')  # flat, NaN for None
        self.moments: list[tuple[Known, Held]] = []

    def add(self, known: Known, held: Held, time: float, since: int) -> None:
        """Add a row, and after some of them a moment; arguments as of `row`."""
        if len(self.rows) // len(COLUMNS) % _ROWS_A_MOMENT == 0:
            self.moments.append((known, held))
        self.rows.extend(math.nan if value is None else value for value in row(known, held, time, since))

    def slice(self, first: int, last: int) -> list[Row]:
        """Rows ``first`` to ``last``."""
        width = len(COLUMNS)
        flat = self.rows[max(first - self._start, 0) * width : max(last + 1 - self._start, 0) * width]
        return [_as_row(flat[i : i + width]) for i in range(0, len(flat), width)]

    @property
    def first(self) -> float:
        """Time of the first estimate [s]; infinite without one."""
        width, estimate = len(COLUMNS), COLUMNS.index('estimate')
        places = (i for i in range(0, len(self.rows), width) if not math.isnan(self.rows[i + estimate]))
        return next((self.rows[i] for i in places), math.inf)

    def faults(self, gap: float) -> list[tuple[float, float, str]]:
        """Begin and end [s] of each stretch with a fault or without estimates, and its words.

        Args:
            gap: Longest time from one fault to the next in a stretch [s].
        """
        found: list[tuple[float, float, dict[str, None]]] = []
        width, estimate, status = len(COLUMNS), COLUMNS.index('estimate'), COLUMNS.index('status')
        newest = math.nan
        for i in range(0, len(self.rows), width):
            time = self.rows[i]
            newest = newest if math.isnan(self.rows[i + estimate]) else time
            words = ['no estimate'] if time - newest > TOO_OLD else serious_words(int(self.rows[i + status]))
            if not words:
                continue
            is_next = bool(found) and time - found[-1][1] <= gap
            begin, said = (found[-1][0], found.pop()[2]) if is_next else (time, {})
            found.append((begin, time, said | dict.fromkeys(words)))
        return [(begin, end, '; '.join(said)) for begin, end, said in found]

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
    """A bag, sampled at the pace of the live view.

    Args:
        bag: The bag.
        mapping: Of its machine, if the bag does not hold it; then the estimates are made here.

    Raises:
        BagError: The bag cannot be read, or has no estimates.
        ValueError: The mapping does not fit the bag.
    """

    def __init__(self, bag: Path, mapping: MappingFile | None = None) -> None:
        self._name = bag.resolve().name
        known = bag_topics(bag)
        types = {topic: info.type_name for topic, info in known.items() if info.message_count}
        answers = (ESTIMATE_TYPE, MACHINE_TYPE)
        if mapping is not None:
            types = {topic: kind for topic, kind in types.items() if topic in mapping.file.topics}
            types[MACHINE_CONFIGURATION] = CONFIGURATION_TYPE
        elif not any(kind in answers for kind in types.values()):
            raise BagError(f'{bag}: no estimates in it: add them with seal_friction replay {bag} --out BAG')
        self._nodes = _nodes(bag, types)
        self._tracks: dict[str, _Track] = {}
        total = sum(info.message_count for info in known.values())
        first, last = _span(bag)
        messages = machine_messages(bag, mapping)
        self._first, self._duration = first, max((last - first) * 1e-9, 0.0)
        self._period = max(1.0 / RATE, self._duration / MOST_ROWS)
        self._fill(messages, known, total)
        if not self._tracks:
            reason = next((view.refused for view, _ in self._nodes if view.refused), 'there is none')
            raise BagError(f'{bag}: the configuration of the estimator in it cannot be read: {reason}')

    def _fill(self, messages: Iterable[BagMessage], known: dict[str, TopicInfo], total: int) -> None:
        step = round(self._period * 1e9)
        due, acted = self._first + step, {topic for topic in known if topic.endswith(RECORDED)}
        with progress(f'read {self._name}', total) as advance:
            for count, message in enumerate(messages, start=1):
                while message.log_time > due:
                    self._sample(due)
                    due += step
                self._take(message, acted)
                if count % 1000 == 0:
                    advance(1000)
        self._sample(due)

    def _take(self, message: BagMessage, acted: set[str]) -> None:
        """Take a message of a node; the feed-forward that acted counts, not that of a replay."""
        topic = message.topic.removesuffix(RECORDED)
        if topic + RECORDED in acted and topic == message.topic:
            return
        for view, topics in self._nodes:
            if not topics or topic in topics:
                view.take(topic, message.type_name, message.data, message.log_time)

    def _sample(self, now: int) -> None:
        time = (now - self._first) * 1e-9
        number = round(time / self._period) - 1
        for view, _ in self._nodes:
            for actuator, known in view.known.items():
                track = self._tracks.setdefault(view.label(actuator), _Track(number, view, actuator))
                track.add(known, view.held[actuator], time, now - round(self._period * 1e9))
                view.held[actuator] = next_interval(view.held[actuator])

    # --- for the page ---

    def describe(self) -> dict[str, Any]:
        """What does not change."""
        about = {'mode': 'bag', 'name': self._name, 'columns': COLUMNS, 'can_change': False, 'start': str(self._first)}
        gap = max(RECENT, 2.0 * self._period, self._duration / _MOST_MARKS)
        return {
            **about,
            'duration': round(self._duration, 3),
            'period': self._period,
            'first': min(*(track.first for track in self._tracks.values()), self._duration),
            'faults': {label: track.faults(gap) for label, track in self._tracks.items()},
        }

    def view(self, label: str, since: float, until: float | None = None) -> dict[str, Any]:
        """Rows of an actuator in ``since`` to ``until`` [s], and the situation of all at ``until``."""
        label = label if label in self._tracks else next(iter(self._tracks))
        end = self._duration if until is None else min(max(until, 0.0), self._duration)
        last = round(end / self._period) - 1
        first = max(math.floor(since / self._period), last - _MOST_ROWS_AT_ONCE)
        every = {name: self._situation(track, last) for name, track in self._tracks.items()}
        return {
            'label': label,
            'time': round(end, 3),
            'rows': self._tracks[label].slice(first, max(last, 0)),
            'now': every[label],
            'node': self._name,
            'actuators': [
                {'label': name, 'verdict': one['verdict'], 'feedforward': one['feedforward']}
                for name, one in every.items()
            ],
            'diagnostics': [],
        }

    def _situation(self, track: _Track, last: int) -> dict[str, Any]:
        """Words of the moment at a row or up to `_ROWS_A_MOMENT` rows before."""
        place, known, held = track.moment(last)
        rows = track.slice(place - 100, place)
        time = rows[-1][0]
        found = track.findings(held, is_end=last >= round(self._duration / self._period) - 1)
        now = self._first + round(time * 1e9)
        return situation(known, held, recent_bits(reversed(rows), time), now, findings=found)

    def change(self, _label: str, parameter: str, _value: float) -> list[Answer]:
        """A bag cannot be changed.

        Raises:
            ValueError: There is no such parameter.
        """
        if parameter not in CHANGEABLE:
            raise ValueError(f'parameter {parameter!r}: one of {", ".join(CHANGEABLE)}')
        return [Answer(False, 'this is a recording: nothing is changed')]

    def off(self) -> list[Answer]:
        """Nothing in a bag can be switched off."""
        return [Answer(False, 'this is a recording: nothing is switched off')]

    def lift(self) -> list[Answer]:
        """Nothing in a bag is switched off."""
        return self.off()


def _span(bag: Path) -> tuple[int, int]:
    """Time of the first and the last message that has one [ns]."""
    first = last = 0
    for message in read_messages(bag):
        first = first or message.log_time
        last = max(last, message.log_time)
    return first, last


def _nodes(bag: Path, types: dict[str, str]) -> list[tuple[NodeView, set[str]]]:
    """Estimators of a bag, and the topics of each; no topics: all of them.

    An estimator is known by its configuration; without one every topic of estimates is one. Topics belong to the
    estimator in whose namespace they are; if there is only one, to that.
    """

    def definitions(kinds: Iterable[str]) -> Any:
        return read_definitions(bag, kinds)

    configured = [topic for topic, kind in types.items() if kind == CONFIGURATION_TYPE]
    names = {topic.removesuffix(_CONFIGURATION): topic.removesuffix(_CONFIGURATION) for topic in configured}
    if not names:
        names = {topic: topic for topic, kind in types.items() if kind == ESTIMATE_TYPE}
    views = [NodeView(name, definitions, math.inf) for name in names]
    if not configured:
        for view in views:
            view.without_configuration()
    if len(views) == 1:
        return [(views[0], set())]
    return [(view, _below(view.node.rpartition('/')[0], types)) for view in views]


def _below(namespace: str, types: dict[str, str]) -> set[str]:
    """Topics of this package in a namespace, the configuration of its node among them."""
    return {topic for topic, kind in types.items() if topic.startswith(f'{namespace}/') and kind in DECODERS}
