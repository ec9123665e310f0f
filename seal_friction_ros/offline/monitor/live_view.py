"""The view of running estimators: what their nodes say now, and the last half minute of every actuator."""

import threading
from collections import deque
from collections.abc import Callable, Iterable
from typing import Any

from seal_friction_ros.core.estimation.findings import BAD, Finding
from seal_friction_ros.offline.monitor import actuator_view
from seal_friction_ros.offline.monitor.actuator_view import COLUMNS, Row, next_interval, recent_bits
from seal_friction_ros.offline.monitor.node_view import NodeView
from seal_friction_ros.offline.monitor.off_latch import Answer, OffLatch, Scale

RATE = 100.0  # [Hz] of the rows: 20 points of a motion at 5 Hz, 5 new ones a frame (our choice)
KEPT = 30.0  # [s] of rows that are kept
CHANGEABLE = ('scale', 'lead_time', 'force_limit')
"""parameters of the feed-forward that the page may change"""

Wanted = dict[str, dict[str, float]]
"""Name of a node -> values by ROS name of the parameter."""
Change = Callable[[Wanted], list[Answer]]
"""Sets parameters, of each node all or none, of all nodes at once; one answer a node."""


def no_changes(wanted: Iterable[str]) -> list[Answer]:
    """`Change` of a view that only reads."""
    return [Answer(False, f'{node}: read only: start the monitor with --allow-changes') for node in wanted]


class LiveView:
    """All estimators of a graph. The node that listens writes, the threads of the page read.

    The time axis begins at ``start`` [ns] on the clock of receipt. Without ``change``, which sets parameters, it is
    read only.
    """

    def __init__(self, start: int, change: Change | None = None) -> None:
        self._start, self._now = start, start
        self._change = change
        self._nodes: dict[str, NodeView] = {}
        self._rows: dict[tuple[str, str], deque[Row]] = {}
        self._latch = OffLatch()
        self._lock = threading.Lock()

    @property
    def lock(self) -> threading.Lock:
        """To hold while a `NodeView` is written."""
        return self._lock

    def add(self, view: NodeView) -> None:
        """Show another estimator."""
        with self._lock:
            self._nodes[view.node] = view

    def sample(self, now: int) -> None:
        """Add a row of every actuator at ``now`` [ns]."""
        with self._lock:
            before, self._now = self._now, now
            time = (now - self._start) * 1e-9
            for view in self._nodes.values():
                for actuator, known in view.known.items():
                    rows = self._rows.setdefault((view.node, actuator), deque(maxlen=round(KEPT * RATE)))
                    rows.append(actuator_view.row(known, view.held[actuator], time, before))
                    view.held[actuator] = next_interval(view.held[actuator])

    # --- OFF ---

    def still_on(self) -> Wanted:
        """Scales that have to be set to 0 now, while OFF is latched; they count as asked for."""
        with self._lock:
            return self._latch.wanted(self._scales(), self._now)

    def answered(self, node: str, answer: Answer) -> None:
        """Take what came of setting the scales of a node to 0, in time or late."""
        with self._lock:
            starts = self._nodes[node].starts if node in self._nodes else 0
            self._latch.answered(node, answer, starts, self._now)

    def _scales(self) -> list[Scale]:
        return [one for view in self._nodes.values() for one in view.scales(self._now)]

    def _actuators(self) -> dict[str, tuple[NodeView, str]]:
        return {view.label(name): (view, name) for view in self._nodes.values() for name in view.known}

    def _unread(self) -> dict[str, str]:
        """Nodes whose configuration is not known, and why."""
        return {name: view.refused for name, view in self._nodes.items() if not view.known}

    def _off_document(self) -> dict[str, Any] | None:
        return self._latch.document(self._scales(), self._unread(), self._now)

    # --- for the page ---

    def describe(self) -> dict[str, Any]:
        """What does not change from frame to frame; ``start`` tells one monitor from another."""
        about = {'mode': 'live', 'name': '', 'columns': COLUMNS, 'can_change': self._change is not None}
        return {**about, 'start': str(self._start), 'period': 1.0 / RATE}

    def view(self, label: str, since: float, until: float | None = None) -> dict[str, Any]:
        """Rows of an actuator, or of the first one if there is no such, after ``since`` [s], and the situation of all.

        A live view ends now, and not at ``until``.
        """
        del until
        with self._lock:
            found = self._actuators()
            off, unread = self._off_document(), self._unread()
            if not found:
                return {'label': '', 'rows': [], 'actuators': [], 'diagnostics': [], 'nodes': unread, 'off': off}
            label = label if label in found else next(iter(found))
            shown, actuator = found[label]
            every = {name: self._situation(view, key) for name, (view, key) in found.items()}
            rows = [one for one in self._rows.get((shown.node, actuator), ()) if one[0] > since]
            diagnostics = [{'part': part, **status} for part, status in shown.diagnostics.items()]
        time, more = (self._now - self._start) * 1e-9, {'nodes': unread, 'off': off, 'diagnostics': diagnostics}
        return actuator_view.frame(label, time, rows, every, node=shown.node, **more)

    def _situation(self, view: NodeView, actuator: str) -> dict[str, Any]:
        rows, time = self._rows.get((view.node, actuator), ()), (self._now - self._start) * 1e-9
        bits = recent_bits(reversed(rows), time)
        known, held = view.known[actuator], view.held[actuator]
        lost = [text for kind, text in (self._off_document() or {'lines': []})['lines'] if kind == 'no']
        found = [Finding(BAD, text, 'press OFF again, or stop the node') for text in lost] + view.findings(actuator)
        said, presence = view.said(actuator), view.presence
        return actuator_view.situation(known, held, bits, self._now, said, presence, found)

    def change(self, label: str, parameter: str, value: float) -> list[Answer]:
        """Set a parameter of the feed-forward of one actuator; ValueError: there is no such actuator or parameter."""
        if parameter not in CHANGEABLE:
            raise ValueError(f'parameter {parameter!r}: one of {", ".join(CHANGEABLE)}')
        with self._lock:
            found = self._actuators()
        if label not in found:
            raise ValueError(f'no actuator {label!r}')
        view, actuator = found[label]
        if self._latch.since is not None and parameter == 'scale' and value > 0.0:
            return [Answer(False, f'REJECTED: {label} is OFF: lift OFF first')]
        return (self._change or no_changes)({view.node: {view.parameter(actuator, parameter): value}})

    def off(self) -> list[Answer]:
        """Latch OFF and set the scale of every feed-forward to 0; one answer an actuator, failures first."""
        with self._lock:
            nodes = [view for view in self._nodes.values() if view.known]
            wanted: Wanted = {view.node: {view.parameter(name, 'scale'): 0.0 for name in view.known} for view in nodes}
            if self._change is not None:
                self._latch.press(list(wanted), self._now)
        if self._change is None:
            return no_changes(wanted) or [Answer(False, 'NOT OFF: no estimator is known')]
        for node, answer in zip(wanted, self._change(wanted), strict=True):
            self.answered(node, answer)
        with self._lock:
            state = self._off_document()
        return [Answer(kind == 'yes', text) for kind, text in (state or {'lines': []})['lines']]

    def lift(self) -> list[Answer]:
        """End OFF: scales may be set again, none is."""
        if self._change is None:
            return no_changes(self._nodes)
        with self._lock:
            self._latch.lift()
        return [Answer(True, 'OFF is lifted: every scale stays as it is until somebody sets it')]
