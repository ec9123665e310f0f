"""What ``seal_friction topics`` does: lists topics, measures rates, prints messages, sets parameters, calls services.

For ``seal_friction new robot`` it records the topics of some types for a while.

ros2cli is not on the package registry, and its Python packages need a sourced distribution: hence these few functions.
"""

import json
import sys
import time
from collections.abc import Callable, Collection, Iterable, Mapping
from functools import partial
from importlib import import_module
from itertools import pairwise
from pathlib import Path
from typing import Any

import rclpy
import yaml
from rclpy.node import Node, NodeNameNonExistentError
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.parameter_client import AsyncParameterClient
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from seal_friction_ros.core.foundation.parameters import meant
from seal_friction_ros.nodes import qos
from seal_friction_ros.nodes.executor import run_tool
from seal_friction_ros.nodes.graph_watch import full_name
from seal_friction_ros.nodes.managed_node import message_class

SUCCESS, REFUSED = 0, 1
_NAME = 'seal_friction_topics'
_LONGEST_ARRAY = 20  # numbers of a field that a person reads; JSON has all
_NO_INPUTS = ('/rosout', '/parameter_events', '/transition_event', '/diagnostics')
"""Ends of the topics that say nothing of a machine, as of a node that still compiles."""


class NotThereError(ValueError):
    """A name is not on the graph; one line that says which, and what there is."""


class Tool:
    """A node that looks at the graph; it waits [s] for all names there, at most for one name or an answer."""

    def __init__(self, node: Node, wait: float) -> None:
        self.node, self._wait = node, wait

    def spin(self, seconds: float, until: Callable[[], bool] = lambda: False) -> bool:
        """Spin for some seconds [s], or until a condition holds; whether it does."""
        end = time.monotonic() + seconds
        while time.monotonic() < end and not until():
            rclpy.spin_once(self.node, timeout_sec=min(0.05, max(end - time.monotonic(), 0.0)))
        return until()

    def found(self, name: str, known: Callable[[], Iterable[str]], what: str) -> str:
        """Full name of a topic, service or node, which may take a while to appear; NotThereError if it does not."""
        full = name if name.startswith('/') else f'/{name}'
        if self.spin(self._wait, lambda: full in known()):
            return full
        names = [one for one in known() if _NAME not in one]
        raise NotThereError(f'no {what} {full} within {self._wait:g} s: {meant(full, names)}; check ROS_DOMAIN_ID')

    # -- topics --

    def topics(self) -> dict[str, str]:
        """Type of each topic."""
        return {topic: kinds[0] for topic, kinds in self.node.get_topic_names_and_types()}

    def endpoints(self) -> dict[str, dict[str, Any]]:
        """Type, publishers and subscribers of each topic."""
        self.spin(self._wait)
        publishers, subscribers = self.node.get_publishers_info_by_topic, self.node.get_subscriptions_info_by_topic
        return {
            topic: {
                'type': kind,
                'publishers': sorted(full_name(end) for end in publishers(topic) if end.node_name != _NAME),
                'subscribers': sorted(full_name(end) for end in subscribers(topic) if end.node_name != _NAME),
            }
            for topic, kind in sorted(self.topics().items())
        }

    def listen(self, name: str, take: Callable[[Any], None], *, raw: bool = False) -> str:
        """Subscribe to a topic as its publishers offer it; returns its full name."""
        topic = self.found(name, self.topics, 'topic')
        self.spin(self._wait, lambda: bool(self.node.get_publishers_info_by_topic(topic)))
        offers = [end.qos_profile for end in self.node.get_publishers_info_by_topic(topic)]
        best_effort = any(offer.reliability == ReliabilityPolicy.BEST_EFFORT for offer in offers)
        latched = bool(offers) and all(offer.durability == DurabilityPolicy.TRANSIENT_LOCAL for offer in offers)
        reliability = ReliabilityPolicy.BEST_EFFORT if best_effort else ReliabilityPolicy.RELIABLE
        durability = DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE
        profile = QoSProfile(depth=1000, reliability=reliability, durability=durability)
        self.node.create_subscription(message_class(self.topics()[topic]), topic, take, profile, raw=raw)
        return topic

    def rate(self, name: str, seconds: float) -> dict[str, Any]:
        """Messages of a topic in so many seconds from the first one on: rate, and gaps between them."""
        times: list[float] = []
        size = 0

        def take(data: bytes) -> None:
            nonlocal size
            times.append(time.perf_counter())
            size += len(data)

        topic = self.listen(name, take, raw=True)
        self.spin(self._wait, lambda: bool(times))
        self.spin(seconds)
        gaps = [after - before for before, after in pairwise(times)]
        span = times[-1] - times[0] if gaps else 0.0
        return {
            'topic': topic,
            'messages': len(times),
            'rate_Hz': len(gaps) / span if span else None,
            'mean_gap_s': span / len(gaps) if gaps else None,
            'shortest_gap_s': min(gaps, default=None),
            'longest_gap_s': max(gaps, default=None),
            'bytes_per_s': size / span if span else None,
        }

    def echo(self, name: str, show: Callable[[Any], None], count: int | None, seconds: float | None) -> int:
        """Show the messages of a topic as they come; returns how many came."""
        shown = 0

        def take(message: Any) -> None:
            """Show a message, unless enough were shown."""
            nonlocal shown
            if count is None or shown < count:
                shown += 1
                show(plain(message))

        self.listen(name, take)
        self.spin(seconds or float('inf'), lambda: count is not None and shown >= count)
        return shown

    # -- recording --

    def record(self, types: Collection[str], seconds: float, out: Path) -> list[str]:
        """Record every topic of some types (``package/msg/Name``) with best effort to a bag; the `silent` ones.

        It ends ``seconds`` [s] after the first message. BagError: there is none, or the bag cannot be written.
        """
        from seal_friction_ros.offline.bags.bag import BagError, BagWriter  # noqa: PLC0415  no other action needs bags

        messages: list[tuple[str, str, int, bytes]] = []
        topics: set[str] = set()

        def take(topic: str, kind: str, data: bytes) -> None:
            messages.append((topic, kind, time.time_ns(), data))

        def has_heard() -> bool:
            """Subscribe to the topics that have appeared; whether there is a message."""
            for topic, kind in self.topics().items():
                if kind in types and topic not in topics:
                    topics.add(topic)
                    profile, taking = qos.best_effort(qos.STREAM), partial(take, topic, kind)
                    self.node.create_subscription(message_class(kind), topic, taking, profile, raw=True)
            return bool(messages)

        if not self.spin(self._wait, has_heard):
            heard = ', '.join(f'{topic} ({", ".join(kinds)})' for topic, kinds in self.node.get_topic_names_and_types())
            hint = 'start the drivers, check ROS_DOMAIN_ID'
            there = f'topics: {heard or "none"}; silent: {"; ".join(self.silent(topics)) or "none"}'
            raise BagError(f'no message of a type that can be an input within {self._wait:g} s: {hint}; {there}')
        self.spin(seconds, lambda: not has_heard())
        with BagWriter(out) as writer:
            for message in messages:
                writer.write(*message)
        return self.silent(topics - {topic for topic, *_ in messages})

    def silent(self, topics: Collection[str]) -> list[str]:
        """Those of the topics without a message that have a publisher, and nodes that publish nothing."""
        found = []
        for topic in sorted(topics):
            publishers = sorted(full_name(end) for end in self.node.get_publishers_info_by_topic(topic))
            found += [f'{topic} of {", ".join(publishers)}'] if publishers else []
        for name, space in sorted(self.node.get_node_names_and_namespaces()):
            if name != _NAME and not self._published(name, space):
                found.append(f'node {space}/{name}'.replace('//', '/'))
        return found

    def _published(self, name: str, space: str) -> list[str]:
        """Topics of a node that may be inputs."""
        try:
            topics = [topic for topic, _ in self.node.get_publisher_names_and_types_by_node(name, space)]
        except NodeNameNonExistentError:  # it has just gone
            return []
        return [topic for topic in topics if not topic.endswith(_NO_INPUTS)]

    # -- parameters and services --

    def parameters(self, name: str) -> AsyncParameterClient:
        """Client for the parameters of a node."""
        client = AsyncParameterClient(self.node, self.found(name, self._node_names, 'node'))
        if not self.spin(self._wait, client.services_are_ready):
            raise NotThereError(f'{name} has no parameter services')
        return client

    def _node_names(self) -> list[str]:
        found = self.node.get_node_names_and_namespaces()
        return [f'{space}/{node}'.replace('//', '/') for node, space in found]

    def answer(self, future: Any, who: str) -> Any:
        """Result of a call; NotThereError if there is none."""
        if not self.spin(self._wait, future.done):
            raise NotThereError(f'{who} gives no answer within {self._wait:g} s')
        return future.result()

    def values(self, client: AsyncParameterClient, who: str, names: list[str]) -> dict[str, Any]:
        """Parameters by name."""
        values = self.answer(client.get_parameters(names), who).values
        return {name: parameter_value_to_python(value) for name, value in zip(names, values, strict=True)}

    def known_parameters(self, client: AsyncParameterClient, who: str) -> list[str]:
        """Names of all parameters of a node."""
        return sorted(self.answer(client.list_parameters(), who).result.names)

    def live_parameters(self, client: AsyncParameterClient, who: str) -> list[dict[str, Any]]:
        """Name, value and meaning of each parameter of a node that changes while it runs, but ``use_sim_time``."""
        known = self.known_parameters(client, who)
        described = self.answer(client.describe_parameters(known), who).descriptors
        meanings = {
            one.name: one.description
            for one in described
            if not one.read_only and not one.additional_constraints and one.name != 'use_sim_time'
        }
        values = self.values(client, who, list(meanings))
        return [{'name': name, 'value': values[name], 'meaning': meaning} for name, meaning in meanings.items()]

    def _services(self) -> dict[str, list[str]]:
        return dict(self.node.get_service_names_and_types())

    def call(self, name: str, request: Mapping[str, Any]) -> Any:
        """Response of a service."""
        service = self.found(name, self._services, 'service')
        package, _, kind = self._services()[service][0].partition('/srv/')
        service_class = getattr(import_module(f'{package}.srv'), kind)
        client = self.node.create_client(service_class, service)
        if not self.spin(self._wait, client.service_is_ready):
            raise NotThereError(f'{service}: its server does not answer')
        return self.answer(client.call_async(filled(service_class.Request(), request)), service)


def filled(message: Any, values: Mapping[str, Any]) -> Any:
    """A message with some fields set; ValueError if there is no such field, or a value has another type."""
    fields = message.get_fields_and_field_types()
    for name, value in values.items():
        if name not in fields:
            raise ValueError(f'{type(message).__name__} has no field {name}: {meant(name, fields)}')
        old = getattr(message, name)
        if isinstance(value, Mapping):
            filled(old, value)
            continue
        stands_for_real = isinstance(old, float) and type(value) is int  # ROS wants 1.0 where a person writes 1
        new = float(value) if stands_for_real else value
        if isinstance(old, bool | int | float | str) and type(new) is not type(old):
            raise ValueError(f'{name}: {new!r} is no {fields[name]}')
        setattr(message, name, new)
    return message


def plain(value: Any) -> Any:
    """A message as plain values."""
    if hasattr(value, 'get_fields_and_field_types'):
        return {name: plain(getattr(value, name)) for name in value.get_fields_and_field_types()}
    if isinstance(value, str | bool | int | float):
        return value
    return [plain(item) for item in value]


def for_reading(value: Any) -> Any:
    """Plain values for a person: of a long array its beginning."""
    if isinstance(value, dict):
        return {name: for_reading(item) for name, item in value.items()}
    if not isinstance(value, list):
        return value
    shown = [for_reading(item) for item in value[:_LONGEST_ARRAY]]
    return [*shown, f'... {len(value) - _LONGEST_ARRAY} more'] if len(value) > _LONGEST_ARRAY else shown


def _yaml(value: Any) -> str:
    text: str = yaml.safe_dump(for_reading(value), sort_keys=False, allow_unicode=True, default_flow_style=None)
    return text.removesuffix('...\n').rstrip()


def _listed(found: Mapping[str, Mapping[str, Any]]) -> str:
    lines = []
    for topic, one in found.items():
        named = {'from': one['publishers'], 'to': one['subscribers']}
        ends = [f'{what} {", ".join(names)}' for what, names in named.items() if names]
        lines.append(f'{topic}  {one["type"]}\n    {"; ".join(ends) or "no endpoint"}')
    return '\n'.join(lines) or 'no topic'


def _rate_text(found: Mapping[str, Any]) -> str:
    if found['rate_Hz'] is None:
        return f'{found["topic"]}: {found["messages"]} messages: too few for a rate'
    gaps = f'gaps {1e3 * found["shortest_gap_s"]:.2f} to {1e3 * found["longest_gap_s"]:.2f} ms'
    counts = f'{found["topic"]}: {found["rate_Hz"]:.1f} Hz, {found["messages"]} messages'
    return f'{counts}, {gaps}, {found["bytes_per_s"] / 1e3:.1f} kB/s'


def run_task(tool: Tool, task: Mapping[str, Any]) -> int:
    """Run a task, ``action`` (list, hz, echo, param, call, record) and arguments; print its result; the exit code.

    ValueError: a name is not there, or a value is not valid.
    """
    as_json = bool(task.get('json'))

    def show(value: Any, text: str | None = None) -> None:
        print(json.dumps(value) if as_json else _yaml(value) if text is None else text, flush=True)

    action = task['action']
    if action == 'list':
        found = tool.endpoints()
        show(found, _listed(found))
        return SUCCESS
    if action == 'hz':
        rate = tool.rate(task['topic'], task['seconds'])
        show(rate, _rate_text(rate))
        return SUCCESS if rate['rate_Hz'] is not None else REFUSED
    if action == 'echo':
        each = show if as_json else lambda value: show(value, f'{_yaml(value)}\n---')
        return SUCCESS if tool.echo(task['topic'], each, task.get('count'), task.get('seconds')) else REFUSED
    if action == 'record':
        print(*tool.record(task['types'], task['seconds'], Path(task['out'])), sep='\n')
        return SUCCESS
    if action == 'call':
        response = plain(tool.call(task['service'], _mapping(task['request'])))
        show(response)
        return REFUSED if response.get('success') is False else SUCCESS
    return _param(tool, task, show)


def _loaded(text: str) -> Any:
    try:
        return yaml.safe_load(text)
    except yaml.YAMLError as error:
        raise ValueError(str(error)) from None


def _mapping(text: str) -> Mapping[str, Any]:
    value = _loaded(text)
    if not isinstance(value, Mapping):
        raise ValueError(f'{text}: give the fields as in YAML, for example "{{data: true}}"')
    return value


def _param(tool: Tool, task: Mapping[str, Any], show: Callable[..., None]) -> int:
    who, name = task['node'], task.get('name')
    client = tool.parameters(who)
    known = tool.known_parameters(client, who)
    if 'save' in task:
        show({'node': f'/{who.lstrip("/")}', 'parameters': tool.live_parameters(client, who)})
        return SUCCESS
    if name is None:
        show(tool.values(client, who, known))
        return SUCCESS
    if name not in known:
        raise NotThereError(f'{who} has no parameter {name}: {meant(name, known)}')
    if 'value' not in task:
        show(tool.values(client, who, [name]))
        return SUCCESS
    (old,) = tool.values(client, who, [name]).values()
    value = _loaded(task['value'])
    if isinstance(old, float) and isinstance(value, int) and not isinstance(value, bool):
        value = float(value)
    (result,) = tool.answer(client.set_parameters([Parameter(name, value=value)]), who).results
    now = tool.values(client, who, [name])
    reason = '' if result.successful else f'refused: {result.reason}'
    show({**now, 'successful': result.successful, 'reason': result.reason}, f'{_yaml(now)}{reason and f"  {reason}"}')
    return SUCCESS if result.successful else REFUSED


def main() -> int:
    """Run ``python -m seal_friction_ros.nodes.topic_tool TASK``, a task of `run_task` as JSON."""
    task = json.loads(sys.argv[1])
    make = partial(Node, _NAME, start_parameter_services=False, enable_rosout=False)
    return run_tool(make, lambda node: run_task(Tool(node, task['wait']), task), 'seal_friction topics')


if __name__ == '__main__':
    sys.exit(main())
