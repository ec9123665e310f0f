"""One estimator as a view sees it: its configuration, its actuators, and the newest of every message."""

import math
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from seal_friction_ros.core.estimation.findings import Finding, Follower, findings_of
from seal_friction_ros.core.machine.machine import Machine, init
from seal_friction_ros.core.machine.machine_snapshot import machine_of, parse_machine_text
from seal_friction_ros.core.messages.coder import DECODERS, decode_text
from seal_friction_ros.core.messages.definitions import Definition
from seal_friction_ros.core.messages.layouts import CONFIGURATION_TYPE, MACHINE_TYPE
from seal_friction_ros.core.messages.records import NEVER, FrictionEstimate
from seal_friction_ros.core.messages.together import decode_newest, decode_together
from seal_friction_ros.offline.bags.bag import BagMessage
from seal_friction_ros.offline.bags.mapped_bag import Translation
from seal_friction_ros.offline.monitor import actuator_view
from seal_friction_ros.offline.monitor.actuator_view import (
    NOTHING_HELD,
    UNKNOWN_CONFIGURATION,
    Held,
    Known,
    Presence,
    Said,
)
from seal_friction_ros.offline.monitor.off_latch import Scale
from seal_friction_ros.offline.replay.run_findings import raised
from seal_friction_ros.offline.replay.tracking_evaluation import TrackingFollower

_TRACKED = 600.0  # [s] so long the tracking counts live; our choice: 60 000 samples are evaluated within some 10 ms
DefinitionsOf = Callable[[Iterable[str]], Mapping[str, Definition]]
"""Definition of each message type."""


class NodeView:
    """Follows the messages of one ``friction_estimator`` or ``machine_estimator``.

    Args:
        node: Its name with its namespace.
        definitions_of: Looks up the definitions of the messages of a machine.
        remembered: So long what was seen counts for the findings [s]; our choice. Infinite: a recorded run.
        has_recorded: As of `TrackingFollower`.
    """

    def __init__(
        self, node: str, definitions_of: DefinitionsOf, remembered: float = 3600.0, *, has_recorded: bool = False
    ) -> None:
        self.node = node
        self.known: dict[str, Known] = {}
        """configuration of each actuator"""
        self.held: dict[str, Held] = {}
        """newest records of each actuator"""
        self.diagnostics: dict[str, dict[str, Any]] = {}
        """newest status of each part: level, message, values"""
        self.malformed = 0
        """messages that could not be read"""
        self.refused = ''
        """why the newest configuration could not be read; empty if it could"""
        self.starts = 1
        """times that the node began, as far as is known"""
        self.presence = Presence()
        self._definitions_of = definitions_of
        self._machine: Machine | None = None
        self._translation: Translation | None = None
        self._remembered, self._has_recorded = remembered, has_recorded
        self._followers: dict[str, Follower] = {}
        self._tracking: dict[str, TrackingFollower] = {}
        self._had_placeholder: set[str] = set()
        self._found: dict[str, tuple[int, list[Finding]]] = {}

    @property
    def machine(self) -> Machine | None:
        """The machine of a ``machine_estimator``."""
        return self._machine

    def label(self, actuator: str) -> str:
        """Name of an actuator on the page: unique as long as node names and actuators are."""
        if self._machine is not None:
            return f'{actuator} ({self.node})'
        return self.node

    def parameter(self, actuator: str, name: str) -> str:
        """ROS name of a parameter of the feed-forward of an actuator."""
        return f'{actuator}.feedforward.{name}' if self._machine is not None else f'feedforward.{name}'

    def part(self, actuator: str) -> str:
        """Part of the diagnostics that tells of an actuator."""
        return actuator if self._machine is not None else 'estimate'

    def said(self, actuator: str) -> Said:
        """Worst of the diagnostics that concern an actuator."""
        parts = (self.part(actuator), 'recorder')
        every = [Said(one['level'], one['message']) for part in parts if (one := self.diagnostics.get(part))]
        return max(every, default=actuator_view.NOTHING_SAID, key=lambda one: one.level)

    def configure(self, text: str) -> None:
        """Take a configuration, the first one or a changed one; ValueError if it is not valid."""
        snapshot = parse_machine_text(text)
        known = {name: actuator_view.known_of(one) for name, one in snapshot.configurations.items()}
        machine, kept = None, _TRACKED if math.isfinite(self._remembered) else math.inf
        if snapshot.file.document is not None:
            machine, _ = machine_of(snapshot, self._definitions_of(snapshot.file.topics.values()))
        for name, one in snapshot.actuators.items():
            follower = TrackingFollower(kept, has_recorded=self._has_recorded)
            self._tracking.setdefault(name, follower).configure(one.snapshot)
        # Nothing of a configuration that is not valid is kept: all that may refuse it stands above.
        if machine is None or self._machine is None or machine.file != self._machine.file:
            self._translation = None if machine is None else Translation(machine, init(machine))
        self._machine, self.known = machine, known
        self.held = {name: self.held.get(name, NOTHING_HELD) for name in known}
        self._had_placeholder |= {name for name, one in known.items() if one.has_placeholder}
        self.refused = ''

    def hear(self, received: int) -> None:
        """Know that the node was there at ``received`` [ns]."""
        self.presence = Presence(received)

    def scales(self, now: int) -> list[Scale]:
        """What is known of the scale of each actuator at ``now`` [ns]."""
        is_gone = self.presence.is_gone(now)
        return [
            Scale(self.node, self.label(name), self.parameter(name, 'scale'), known.scale, self.starts, is_gone)
            for name, known in self.known.items()
        ]

    def without_configuration(self) -> None:
        """Show the answers of an estimator whose configuration is not known."""
        if not self.known:
            self.known, self.held = {'': UNKNOWN_CONFIGURATION}, {'': NOTHING_HELD}

    def take_newest(self, data: bytes, received: int) -> None:
        """Take the newest messages of the estimator, received at ``received`` [ns]."""
        self.hear(received)
        try:
            newest = decode_newest(data)
        except ValueError:
            self.malformed += 1
            return
        for message in newest:
            self.take(*message, received)

    def take(self, topic: str, type_name: str, data: bytes, received: int) -> None:
        """Take one message, received at ``received`` [ns]; one that cannot be read is counted."""
        try:
            self._take(topic, type_name, data, received)
        except (ValueError, LookupError) as error:
            self.malformed += 1
            if type_name == CONFIGURATION_TYPE:
                self.refused = str(error)

    def _take(self, topic: str, type_name: str, data: bytes, received: int) -> None:
        if type_name == CONFIGURATION_TYPE:
            self.configure(decode_text(data))
        elif type_name == MACHINE_TYPE:
            for answer in decode_together(data):
                self._hold(answer.actuator, answer.record, received)
        elif self._machine is not None and self._translation is not None and topic in self._translation.topics:
            message = BagMessage(topic, type_name, received, data)
            for number, record, _ in self._translation.records(message, Counter()):
                self._hold(self._machine.actuators[number].name, record, received)
        elif type_name in DECODERS:
            actuator = topic.split('/')[-2] if self._machine is not None else ''
            self._hold(actuator, DECODERS[type_name](data), received)

    def _hold(self, actuator: str, record: Any, received: int) -> None:
        if actuator in self.held:
            self.held[actuator] = actuator_view.take(self.held[actuator], record, received)
            if isinstance(record, FrictionEstimate) and record.stamp != NEVER:
                follower = self._followers.setdefault(actuator, Follower(self._remembered))
                follower.add(actuator_view.sample_of(self.known[actuator], self.held[actuator]))
                if actuator in self._tracking:
                    self._tracking[actuator].add(actuator_view.tracked_of(self.held[actuator]))

    def findings(self, actuator: str, until: int | None = None) -> list[Finding]:
        """Findings on the run of an actuator up to a stamp [ns], or to the second in which the stream is."""
        follower = self._followers.get(actuator)
        if follower is None:
            return []
        held, known = self.held.get(actuator, NOTHING_HELD), self.known.get(actuator, UNKNOWN_CONFIGURATION)
        key = held.estimate.stamp // 1_000_000_000 if until is None else until
        if self._found.get(actuator, (None,))[0] != key:
            seen = follower.seen(math.inf if until is None else until * 1e-9)
            # A recorded run is judged as a report judges it: placeholder seals at any time make it bad.
            is_recorded = not math.isfinite(self._remembered)
            has_placeholder = known.has_placeholder or (is_recorded and actuator in self._had_placeholder)
            found = findings_of(seen, has_placeholder=has_placeholder, uses_scale=known.adaptation == 'on')
            if until is None and actuator in self._tracking:
                tracking = self._tracking[actuator]
                found = [*raised(tracking.evaluation(), None if is_recorded else tracking.acting), *found]
            self._found[actuator] = key, found
        return self._found[actuator][1]
