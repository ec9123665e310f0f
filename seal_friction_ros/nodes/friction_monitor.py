"""Listens to every estimator of the graph for the web page of ``seal_friction monitor``; it publishes nothing.

It is a process of its own and listens with best effort to one topic of each estimator, which has the newest inputs,
too: no estimator waits for it, and no driver has one more reader. The middleware keeps the last messages and this node
takes them at the pace of the view: it does not wake for every message. It takes the configurations likewise: such a
message comes once, and rmw_fastrtps does not announce one that comes just when an events executor begins to listen.
"""

import argparse
import os
import queue
import sys
import time
from collections.abc import Mapping
from concurrent.futures import Future
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import GetParameters, SetParametersAtomically
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.utilities import remove_ros_args

from seal_friction_ros.core.messages.layouts import CONFIGURATION_TYPE, NEWEST_TYPE
from seal_friction_ros.nodes import qos
from seal_friction_ros.nodes.executor import run
from seal_friction_ros.nodes.managed_node import message_class
from seal_friction_ros.nodes.subscription import taken
from seal_friction_ros.offline.bags.definitions import installed_definitions
from seal_friction_ros.offline.monitor.live_view import RATE, LiveView, Wanted
from seal_friction_ros.offline.monitor.node_view import NodeView
from seal_friction_ros.offline.monitor.off_latch import ANSWER_TIMEOUT, Answer
from seal_friction_ros.offline.monitor.server import MonitorServer
from seal_friction_ros.offline.monitor.token_file import kept_token

NICENESS = 10  # where processors are short, an estimator has nine times the share of the monitor (our choice)
_SEARCH_PERIOD = 1.0  # [s] between two looks for new estimators
_CONFIGURATION, _NEWEST = '/configuration', '/monitor'  # ends of topics of a node
_FEW = qos.best_effort(QoSProfile(depth=8))  # the bits of every answer are shown, so that few are enough


class _Asked(NamedTuple):
    """A change of parameters that somebody waits for."""

    node: str
    values: dict[str, float]
    deadline: float  # [s] of `time.monotonic`
    answer: 'Future[Answer]'

    def outcome(self) -> Answer:
        """The answer, or that there was none in time."""
        try:
            return self.answer.result(max(self.deadline - time.monotonic(), 0.0))
        except TimeoutError:
            return Answer(False, f'NOT CONFIRMED: no answer from {self.node} within {ANSWER_TIMEOUT:g} s')


class FrictionMonitor(Node):
    """Feeds a `LiveView`, whose page may change parameters of the feed-forward if it is told so."""

    def __init__(self, allow_changes: bool = False, **kwargs: Any) -> None:
        quiet = {'enable_rosout': False, 'start_parameter_services': False}
        super().__init__('friction_monitor', **quiet, **kwargs)
        self._listener = Node('friction_monitor_listener', **quiet, **kwargs)  # never spun: its messages are taken
        self._clock_offset = time.time_ns() - time.monotonic_ns()
        self.view = LiveView(self._received(), self._change if allow_changes else None)
        self._nodes: dict[str, NodeView] = {}
        self._configurations: dict[str, Any] = {}
        self._senders: dict[str, Any] = {}
        self._newest: dict[str, Any] = {}
        self._asked: queue.SimpleQueue[_Asked] = queue.SimpleQueue()
        self._waiting: list[_Asked] = []
        self._clients_by_node: dict[str, tuple[Any, Any]] = {}
        self._allow_changes = allow_changes
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(1.0 / RATE, self._on_timer, clock=steady)
        self.create_timer(_SEARCH_PERIOD, self._search, clock=steady)
        self.create_subscription(DiagnosticArray, '/diagnostics', self._on_diagnostics, 10)
        self._search()

    def destroy_node(self) -> None:
        """Destroy both nodes."""
        self._listener.destroy_node()
        super().destroy_node()

    def _received(self) -> int:
        """Time of receipt [ns]: the clock as it was at the start, which no setting of the clock changes."""
        return time.monotonic_ns() + self._clock_offset

    # --- what is there ---

    def _search(self) -> None:
        """Listen to estimators that have appeared, by their configurations; know those that have left."""
        for node, view in self._nodes.items():
            if not self.count_publishers(node + _CONFIGURATION):
                with self.view.lock:
                    view.presence = view.presence._replace(has_left=True)
        for topic, types in self.get_topic_names_and_types():
            node = topic.removesuffix(_CONFIGURATION)
            if types == [CONFIGURATION_TYPE] and node != topic and node not in self._nodes:
                self._nodes[node] = NodeView(node, installed_definitions)
                self._nodes[node].hear(self._received())
                self.view.add(self._nodes[node])
                self._configurations[node] = self._listened(CONFIGURATION_TYPE, topic, qos.LATCHED)
                self._newest[node] = self._listened(NEWEST_TYPE, node + _NEWEST, _FEW)
                if self._allow_changes:
                    self._clients_of(node)  # so that they are found before somebody presses OFF

    def _listened(self, type_name: str, topic: str, profile: QoSProfile) -> Any:
        """Subscription whose messages are taken."""
        return self._listener.create_subscription(message_class(type_name), topic, lambda _: None, profile, raw=True)

    def _on_diagnostics(self, array: DiagnosticArray) -> None:
        with self.view.lock:
            for status in array.status:
                node, _, part = status.name.rpartition(': ')
                if node in self._nodes:
                    self._nodes[node].hear(self._received())
                    self._nodes[node].diagnostics[part] = {
                        'level': ord(status.level),
                        'message': status.message,
                        'values': {value.key: value.value for value in status.values},
                    }

    # --- at the pace of the view ---

    def _on_timer(self) -> None:
        """Take the messages that have come, and add a row; send what the page asks for."""
        now = self._received()
        with self.view.lock:
            for node, subscription in self._configurations.items():
                for data, about in taken(subscription):
                    self._note_start(node, about.get('publisher_gid'))
                    self._nodes[node].hear(now)
                    self._nodes[node].take(node + _CONFIGURATION, CONFIGURATION_TYPE, data, now)
            for node, subscription in self._newest.items():
                for data, _ in taken(subscription):
                    self._nodes[node].take_newest(data, now)
        self.view.sample(now)
        for node, values in self.view.still_on().items():
            self._ask(node, values, time.monotonic() + ANSWER_TIMEOUT)
        self._send_changes()

    def _note_start(self, node: str, publisher: Any) -> None:
        """Know that a node has begun again: another publisher sends its configuration."""
        if self._senders.setdefault(node, publisher) != publisher:
            self._senders[node] = publisher
            self._nodes[node].starts += 1

    # --- changes ---

    def _change(self, wanted: Wanted) -> list[Answer]:
        """Set parameters of nodes and read them back; called by a thread of the server."""
        deadline = time.monotonic() + ANSWER_TIMEOUT
        asked = [self._ask(node, values, deadline) for node, values in wanted.items()]
        return [one.outcome() for one in asked]

    def _ask(self, node: str, values: dict[str, float], deadline: float) -> _Asked:
        """Ask a node for values; what it answers to OFF is told to the view, also if it is late."""
        asked = _Asked(node, values, deadline, Future())
        if _is_off(values):
            asked.answer.add_done_callback(lambda done: self.view.answered(node, done.result()))
        self._asked.put(asked)
        return asked

    def _send_changes(self) -> None:
        """Send what the page has asked for to the nodes that are there; what waits too long is not sent any more."""
        while not self._asked.empty():
            self._waiting.append(self._asked.get())
        self._waiting = [one for one in self._waiting if time.monotonic() < one.deadline and not self._is_sent(one)]

    def _is_sent(self, asked: _Asked) -> bool:
        setter, reader = self._clients_of(asked.node)
        if not (setter.service_is_ready() and reader.service_is_ready()):
            return False
        parameters = [
            Parameter(name=name, value=ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=value))
            for name, value in asked.values.items()
        ]
        request = SetParametersAtomically.Request(parameters=parameters)
        setter.call_async(request).add_done_callback(partial(self._on_set, asked))
        return True

    def _clients_of(self, node: str) -> tuple[Any, Any]:
        if node not in self._clients_by_node:
            setter = self.create_client(SetParametersAtomically, f'{node}/set_parameters_atomically')
            self._clients_by_node[node] = setter, self.create_client(GetParameters, f'{node}/get_parameters')
        return self._clients_by_node[node]

    def _on_set(self, asked: _Asked, future: Any) -> None:
        result = future.result().result
        if not result.successful:
            asked.answer.set_result(Answer(False, f'REJECTED by {asked.node}: {result.reason}'))
            return
        _, reader = self._clients_of(asked.node)
        request = GetParameters.Request(names=list(asked.values))
        reader.call_async(request).add_done_callback(partial(self._on_read, asked))

    def _on_read(self, asked: _Asked, future: Any) -> None:
        values = dict(zip(asked.values, (value.double_value for value in future.result().values), strict=False))
        shown = ', '.join(f'{name} = {value:g}' for name, value in values.items())
        at = time.strftime('%H:%M:%S')
        word = 'OFF' if _is_off(values) else 'changed'
        answer = Answer(True, f'{word}: confirmed by {asked.node} at {at}: {shown}')
        if values != asked.values:
            answer = Answer(False, f'NOT CONFIRMED by {asked.node}: it has {shown or "no such parameter"}')
        asked.answer.set_result(answer)


def _is_off(values: Mapping[str, float]) -> bool:
    return all(name.endswith('scale') and value == 0.0 for name, value in values.items())


def main() -> int:
    """Run ``friction_monitor [--allow-changes] [--port N] [--token-file FILE]``; prints the address of the page."""
    parser = argparse.ArgumentParser(prog='friction_monitor', description=__doc__.split('\n', maxsplit=1)[0])
    parser.add_argument('--allow-changes', action='store_true', help='let the page change the feed-forward')
    parser.add_argument('--port', type=int, default=0, help='port on 127.0.0.1; 0: any free one')
    parser.add_argument('--token-file', type=Path, help='file that keeps the token of the address')
    parser.add_argument('--json', action='store_true', help='print the address as JSON')
    arguments = parser.parse_args(remove_ros_args(sys.argv)[1:])
    os.nice(NICENESS)
    servers: list[MonitorServer] = []

    def start(node: FrictionMonitor) -> bool:
        """Serve the page; False, with one line, if the port is taken or the token is no secret."""
        try:
            token = kept_token(arguments.token_file) if arguments.token_file else ''
            server = MonitorServer(node.view, arguments.port, token)
        except ValueError as error:
            print(f'friction_monitor: {error}', file=sys.stderr)
            return False
        servers.append(server)
        server.start()
        print(server.told(as_json=arguments.json), flush=True)
        return True

    def stop(_node: FrictionMonitor) -> None:
        for server in servers:
            server.stop()

    return run(lambda: FrictionMonitor(arguments.allow_changes), start, stop)


if __name__ == '__main__':
    sys.exit(main())
