"""Watches the ROS graph of the estimator: duplicate publishers, and endpoints that cannot exchange messages."""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription
from rclpy.topic_endpoint_info import TopicEndpointInfo

from seal_friction_ros.nodes import qos


class GraphFindings(NamedTuple):
    """State of the graph; the texts name topic, node and reason."""

    publisher_counts: dict[str, int]  # input -> number of its publishers
    duplicates: list[str]  # topics with several publishers
    unheard: list[str]  # publishers and subscribers that cannot exchange messages with this node
    best_effort: dict[str, str]  # input received with best effort -> node that publishes it


class GraphWatch:
    """Watches the topics of the estimator, and subscribes to an input again where its publisher requires it.

    Args:
        node: Node that has the endpoints.
        inputs: Subscription of each input; always the present one.
        input_types: Message type of each input.
        outputs: Publishers.
        output_types: Message type of each publisher whose topic is the node's alone, by its key in ``outputs``.
        subscribe: Subscribes to an input with a QoS profile, in place of the present subscription.
    """

    def __init__(
        self,
        node: Node,
        inputs: Mapping[str, Subscription],
        input_types: Mapping[str, str],
        outputs: Mapping[Any, Publisher],
        output_types: Mapping[Any, str],
        subscribe: Callable[[str, QoSProfile], None],
    ) -> None:
        self._node = node
        self._inputs = inputs
        self._input_types = input_types
        self._outputs = outputs
        self._output_types = output_types
        self._subscribe = subscribe
        self._best_effort: dict[str, str] = {}
        self._without_node_name: set[str] = set()
        self._incompatible_outputs: set[Any] = set()
        self._connections: list[int] = []
        self._endpoint_counts: list[int] = []
        self._other_definitions: list[str] = []

    def findings(self, silent_inputs: list[str], *, retry: bool) -> GraphFindings:
        """State of the graph, with the inputs without recent messages.

        ``retry``: subscribe again to those whose publishers offer best effort only.
        """
        counts = {name: self._publisher_count(name) for name in self._input_types}
        duplicates = self.duplicate_publishers()
        unheard = self._retry_silent_inputs(silent_inputs) if retry else []
        unheard += self._incompatible_subscribers() + self._nodes_with_other_definitions()
        return GraphFindings(counts, duplicates, unheard, self._best_effort.copy())

    def has_changed(self) -> bool:
        """Whether a publisher of an input has appeared or disappeared since the last call."""
        before, self._connections = self._connections, [self._publisher_count(name) for name in self._input_types]
        return self._connections != before

    def duplicate_publishers(self) -> list[str]:
        """Topics with several publishers, and the nodes that publish them.

        Output topics count too: another estimator may publish them.
        """
        topics = [self._inputs[name].topic_name for name in self._input_types if self._publisher_count(name) > 1]
        answers = [self._outputs[key].topic_name for key in self._output_types]
        topics += [topic for topic in answers if self._node.count_publishers(topic) > 1]
        return [f'{topic} has several publishers: {", ".join(map(full_name, self._find(topic)))}' for topic in topics]

    def on_incompatible_subscriber(self, key: Any, _event: Any) -> None:
        """Note an output with an incompatible subscriber; discovery reports the name of the node later."""
        self._incompatible_outputs.add(key)

    def _incompatible_subscribers(self) -> list[str]:
        """Nodes that request a QoS which an output does not offer."""
        texts = []
        for key in sorted(self._incompatible_outputs):
            output = self._outputs[key]
            for subscriber in self._node.get_subscriptions_info_by_topic(output.topic_name):
                reason = incompatibility(output.qos_profile, subscriber.qos_profile)
                if reason:
                    who = full_name(subscriber)
                    texts.append(f'{output.topic_name}: {who} wants incompatible quality of service ({reason})')
        return texts

    def _nodes_with_other_definitions(self) -> list[str]:
        """Nodes with another definition of a message; looked up only after a change of the graph, as it takes 1 ms."""
        types = {self._inputs[name].topic_name: type_name for name, type_name in self._input_types.items()}
        types |= {self._outputs[key].topic_name: type_name for key, type_name in self._output_types.items()}
        both = self._node.count_publishers, self._node.count_subscribers
        counts = [count(topic) for topic in types for count in both]
        if counts != self._endpoint_counts:
            subscribers = self._node.get_subscriptions_info_by_topic
            endpoints = {topic: [*self._find(topic), *subscribers(topic)] for topic in types}
            me = self._node.get_fully_qualified_name()
            found = [other_definitions(topic, types[topic], endpoints[topic], me) for topic in types]
            self._other_definitions = [text for texts in found for text in texts]
            if all(is_named(endpoint) for topic in types for endpoint in endpoints[topic]):
                self._endpoint_counts = counts
        return self._other_definitions

    def _retry_silent_inputs(self, silent_inputs: list[str]) -> list[str]:
        """Adapt the reliability of subscriptions to their publishers; the reasons why other inputs are not heard."""
        for name in list(self._best_effort):
            if not any(map(offers_best_effort_only, self._find(self._inputs[name].topic_name))):
                del self._best_effort[name]
                self._subscribe(name, qos.STREAM)
        return [reason for name in silent_inputs for reason in self._retry(name)]

    def _retry(self, name: str) -> list[str]:
        """Why an input is not heard; subscribe with best effort if its publisher offers nothing better."""
        topic, requested = self._inputs[name].topic_name, self._inputs[name].qos_profile
        reasons = []
        for publisher in self._find(topic):
            if offers_best_effort_only(publisher) and requested.reliability == ReliabilityPolicy.RELIABLE:
                if is_named(publisher) or name in self._without_node_name:
                    self._best_effort[name] = who = full_name(publisher)
                    self._node.get_logger().warning(f'{topic}: {who} offers best effort only: accepted')
                    self._subscribe(name, qos.best_effort(qos.STREAM))
                else:
                    self._without_node_name.add(name)  # the name may be known at the next call
                break
            reason = why_unheard(publisher, self._input_types[name], requested)
            if reason:
                reasons.append(f'{topic}: {reason}')
        return reasons

    def publishers_text(self, name: str) -> str:
        """Words on the publishers of an input."""
        found = [full_name(publisher) for publisher in self._find(self._inputs[name].topic_name)]
        topic = self._inputs[name].topic_name
        return f'{", ".join(found)} publishes {topic}' if found else f'nobody publishes {topic}'

    def _find(self, topic: str) -> list[TopicEndpointInfo]:
        """Discovered publishers of a topic, in order of their names."""
        return sorted(self._node.get_publishers_info_by_topic(topic), key=full_name)

    def _publisher_count(self, name: str) -> int:
        """Connected publishers of an input; ROS 2 Jazzy counts the discovered ones."""
        subscription = self._inputs[name]
        count = getattr(subscription, 'get_publisher_count', None)
        return int(count()) if count is not None else self._node.count_publishers(subscription.topic_name)


def full_name(endpoint: TopicEndpointInfo) -> str:
    """Name of the node that has an endpoint, with its namespace."""
    if not is_named(endpoint):
        return 'a node of unknown name'
    return f'{endpoint.node_namespace}/{endpoint.node_name}'.replace('//', '/')


def is_named(endpoint: TopicEndpointInfo) -> bool:
    """Whether the name of the node is known: discovery reports it after the topics."""
    return bool(endpoint.node_name != '_NODE_NAME_UNKNOWN_')


def offers_best_effort_only(publisher: TopicEndpointInfo) -> bool:
    """Whether a publisher does not offer reliable delivery."""
    return bool(publisher.qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT)


def other_definitions(topic: str, type_name: str, endpoints: list[TopicEndpointInfo], me: str) -> list[str]:
    """Nodes whose definition of a message differs from that of the node ``me``, by the hash of its fields."""
    hashes = [str(endpoint.topic_type_hash) for endpoint in endpoints]
    own = next((text for text, endpoint in zip(hashes, endpoints, strict=True) if full_name(endpoint) == me), '')
    return [
        f'{topic}: {full_name(endpoint)} has another definition of {type_name} ({text[:15]}, not {own[:15]}): '
        f'build both from the same messages'
        for text, endpoint in zip(hashes, endpoints, strict=True)
        if own and endpoint.topic_type == type_name and text not in (own, 'INVALID')
    ]


def why_unheard(publisher: TopicEndpointInfo, type_name: str, requested: QoSProfile) -> str:
    """Why a subscription of a message type and QoS receives nothing from a publisher; empty if compatible."""
    if publisher.topic_type != type_name:
        return f'{full_name(publisher)} publishes {publisher.topic_type}, not {type_name}'
    reason = incompatibility(publisher.qos_profile, requested)
    return f'{full_name(publisher)} offers incompatible quality of service ({reason})' if reason else ''


def incompatibility(offered: QoSProfile, requested: QoSProfile) -> str:
    """Why a publisher and a subscription do not match; empty if they do.

    `rclpy.qos.qos_check_compatible` takes the deadlines and leases that discovery reports for requested ones, hence
    this check of reliability and durability.
    """
    reasons = []
    if requested.reliability == ReliabilityPolicy.RELIABLE and offered.reliability == ReliabilityPolicy.BEST_EFFORT:
        reasons.append('best effort where reliable is wanted')
    if requested.durability == DurabilityPolicy.TRANSIENT_LOCAL and offered.durability == DurabilityPolicy.VOLATILE:
        reasons.append('volatile where transient local is wanted')
    return ', '.join(reasons)
