"""Plays the inputs of a bag: at the pace of the bag, faster, or as fast as the estimator answers.

In contrast to ``ros2 bag play`` it runs from wheels, waits for the estimator and never overtakes it.
"""

import argparse
import json
import sys
import time
from pathlib import Path

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node
from rclpy.utilities import remove_ros_args
from seal_friction_msgs.msg import FrictionEstimate

from seal_friction_ros.core.messages.layouts import INPUTS, VELOCITY_TYPE
from seal_friction_ros.nodes import qos
from seal_friction_ros.nodes.estimator_diagnostics import latency_values
from seal_friction_ros.nodes.executor import run_tool
from seal_friction_ros.nodes.managed_node import message_class
from seal_friction_ros.offline.bags.bag import BagError, BagMessage, read_messages

_MOST_UNANSWERED = 20  # [samples] velocity samples sent ahead of their estimates, well below the depth of the queues
_ANSWER_TIMEOUT = 5.0  # [s]


class BagPlayer(Node):
    """Publishes messages of a bag unchanged, and measures the time until each estimate arrives."""

    def __init__(self) -> None:
        super().__init__('bag_player')
        self._input_publishers = {
            type_name: self.create_publisher(message_class(type_name), topic, qos.STREAM)
            for topic, type_name in INPUTS.items()
        }
        self._connected = False
        self.sent: list[int] = []
        self.round_trips: list[int] = []
        self.create_subscription(FrictionEstimate, 'friction_estimate', self._on_estimate, qos.STREAM, raw=True)
        self.create_subscription(DiagnosticArray, '/diagnostics', self._on_diagnostics, 10)

    def _on_estimate(self, data: bytes) -> None:
        del data
        if self.answered < len(self.sent):
            self.round_trips.append(time.perf_counter_ns() - self.sent[self.answered])

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            counts = [value.value for value in status.values if value.key.endswith(' publishers')]
            if counts and all(int(count) > 0 for count in counts):
                self._connected = True

    @property
    def answered(self) -> int:
        """Number of velocity samples with an estimate; estimates arrive in order."""
        return len(self.round_trips)

    def publish(self, message: BagMessage) -> None:
        """Publish one message, byte for byte."""
        if message.type_name == VELOCITY_TYPE:
            self.sent.append(time.perf_counter_ns())
        self._input_publishers[message.type_name].publish(message.data)

    def wait_for_estimator(self, timeout: float) -> bool:
        """Wait at most ``timeout`` [s] until the estimator reports a publisher on each input.

        A discovered subscription is not sufficient: until the estimator has discovered every publisher, messages of
        different topics can arrive in another order than in the bag.
        """
        deadline = time.monotonic() + timeout
        while time.monotonic() < deadline:
            subscribed = all(p.get_subscription_count() for p in self._input_publishers.values())
            if subscribed and self._connected:
                return True
            rclpy.spin_once(self, timeout_sec=0.02)
        return False

    def wait_for_answers(self, wanted: int) -> bool:
        """Wait for ``wanted`` estimates; False if no further one arrives within the answer timeout."""
        before, since = self.answered, time.monotonic()
        while self.answered < wanted:
            rclpy.spin_once(self, timeout_sec=0.1)
            if self.answered != before:
                before, since = self.answered, time.monotonic()
            elif time.monotonic() - since > _ANSWER_TIMEOUT:
                return False
        return True


def play(player: BagPlayer, bag: Path, rate: float) -> dict[str, str]:
    """Play a bag; return the number of velocity samples and the round-trip time from sample to estimate.

    The rate is a multiple of the pace of the bag; 0: as fast as the estimator answers.

    BagError: the bag cannot be read, or the estimator stopped answering.
    """
    start = time.monotonic()
    first: int | None = None
    played = set(INPUTS.values())
    for message in read_messages(bag):
        if message.type_name not in played:
            continue
        first = message.log_time if first is None else first
        due = start + (message.log_time - first) * 1e-9 / rate if rate else 0.0
        while (wait := due - time.monotonic()) > 0.0:
            rclpy.spin_once(player, timeout_sec=wait)
        player.publish(message)
        _await(player, bag, _MOST_UNANSWERED)
    _await(player, bag, 0)
    return {'velocity samples': str(len(player.sent)), **latency_values(player.round_trips, 'round trip')}


def _await(player: BagPlayer, bag: Path, unanswered: int) -> None:
    if not player.wait_for_answers(len(player.sent) - unanswered):
        raise BagError(f'{bag}: the estimator answered {player.answered} of {len(player.sent)} velocity samples')


def main() -> int:
    """Run ``bag_player BAG [--rate R] [--wait S]``; prints the result of `play` as JSON."""
    parser = argparse.ArgumentParser(prog='bag_player', description=__doc__.split('\n', maxsplit=1)[0])
    parser.add_argument('bag', type=Path, help='bag; only the inputs of the estimator are played')
    parser.add_argument('--rate', type=float, default=1.0, help='multiple of the pace; 0: as fast as answered')
    parser.add_argument('--wait', type=float, default=10.0, help='longest wait for an estimator [s]')
    arguments = parser.parse_args(remove_ros_args(sys.argv)[1:])
    if not 0.0 <= arguments.rate < float('inf'):
        parser.error(f'--rate {arguments.rate}: must be finite and not negative')

    def act(player: BagPlayer) -> int:
        """Play the bag once there is an estimator."""
        if not player.wait_for_estimator(arguments.wait):
            raise BagError(f'no estimator subscribed to the inputs within {arguments.wait} s')
        print(json.dumps(play(player, arguments.bag, arguments.rate)))
        return 0

    return run_tool(BagPlayer, act, 'bag_player')


if __name__ == '__main__':
    sys.exit(main())
