"""Records the topics of some types for some seconds: a look at a running machine, without ``ros2 bag record``."""

import argparse
import sys
import time
from collections.abc import Collection
from functools import partial
from pathlib import Path

import rclpy
from rclpy.node import Node, NodeNameNonExistentError
from rclpy.utilities import remove_ros_args

from seal_friction_ros.nodes import qos
from seal_friction_ros.nodes.executor import run_tool
from seal_friction_ros.nodes.graph_watch import full_name
from seal_friction_ros.nodes.managed_node import message_class
from seal_friction_ros.offline.bags.bag import BagError, BagWriter

_NO_INPUTS = ('/rosout', '/parameter_events', '/transition_event', '/diagnostics')
"""Ends of the topics that say nothing of a machine, as of a node that still compiles."""


class TopicRecorder(Node):
    """Subscribes, with best effort, to every topic of some types (``package/msg/Name``), and keeps its messages."""

    def __init__(self, types: Collection[str]) -> None:
        super().__init__('topic_recorder')
        self.messages: list[tuple[str, str, int, bytes]] = []
        """topic, type, time of receipt [ns] and bytes of each message"""
        self._types = types
        self._topics: set[str] = set()

    def subscribe_to_new_topics(self) -> None:
        """Subscribe to the topics that have appeared since the last call."""
        for topic, (kind, *_) in self.get_topic_names_and_types():
            if kind in self._types and topic not in self._topics:
                self._topics.add(topic)
                take, profile = partial(self._take, topic, kind), qos.best_effort(qos.STREAM)
                self.create_subscription(message_class(kind), topic, take, profile, raw=True)

    def silent(self) -> list[str]:
        """Topics of the types that have a publisher and no message, and nodes that publish nothing."""
        heard, found = {topic for topic, *_ in self.messages}, []
        for topic in sorted(self._topics - heard):
            publishers = sorted(full_name(end) for end in self.get_publishers_info_by_topic(topic))
            found += [f'{topic} of {", ".join(publishers)}'] if publishers else []
        for name, space in sorted(self.get_node_names_and_namespaces()):
            if name != self.get_name() and not self._published(name, space):
                found.append(f'node {space}/{name}'.replace('//', '/'))
        return found

    def _published(self, name: str, space: str) -> list[str]:
        """Topics of a node that may be inputs."""
        try:
            topics = [topic for topic, _ in self.get_publisher_names_and_types_by_node(name, space)]
        except NodeNameNonExistentError:  # it has just gone
            return []
        return [topic for topic in topics if not topic.endswith(_NO_INPUTS)]

    def _take(self, topic: str, kind: str, data: bytes) -> None:
        self.messages.append((topic, kind, time.time_ns(), data))


def record(node: TopicRecorder, seconds: float, wait: float, out: Path) -> int:
    """Record for ``seconds`` [s], from the first message on, for which it waits ``wait`` [s] at most; exit code 0.

    Prints a line for each silent topic and node.

    BagError: no topic of the types has a message, or the bag cannot be written.
    """
    end = time.monotonic() + wait
    is_begun = False
    while time.monotonic() < end:
        node.subscribe_to_new_topics()
        rclpy.spin_once(node, timeout_sec=0.05)
        if node.messages and not is_begun:
            is_begun, end = True, time.monotonic() + seconds
    if not node.messages:
        heard = ', '.join(f'{topic} ({", ".join(kinds)})' for topic, kinds in node.get_topic_names_and_types())
        hint = 'start the drivers, check ROS_DOMAIN_ID'
        there = f'topics: {heard or "none"}; silent: {"; ".join(node.silent()) or "none"}'
        raise BagError(f'no message of a type that can be an input within {wait:g} s: {hint}; {there}')
    with BagWriter(out) as writer:
        for message in node.messages:
            writer.write(*message)
    print(*node.silent(), sep='\n')
    return 0


def main() -> int:
    """Run ``topic_recorder --seconds S --out BAG TYPE ...``."""
    parser = argparse.ArgumentParser(prog='topic_recorder', description=__doc__)
    parser.add_argument('types', nargs='+', metavar='TYPE', help='message type, package/msg/Name')
    parser.add_argument('--seconds', type=float, default=5.0, help='duration from the first message on [s]')
    parser.add_argument('--wait', type=float, required=True, help='for the first message [s]')
    parser.add_argument('--out', type=Path, required=True, help='bag to write')
    arguments = parser.parse_args(remove_ros_args(sys.argv)[1:])
    seconds, wait, out = arguments.seconds, arguments.wait, arguments.out
    make = partial(TopicRecorder, arguments.types)
    return run_tool(make, lambda node: record(node, seconds, wait, out), 'topic_recorder')


if __name__ == '__main__':
    sys.exit(main())
