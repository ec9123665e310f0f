"""The settings of Fast DDS: how many participants of one machine discover each other, when lost messages come."""

import signal
import socket
import subprocess
import sys
import time
from contextlib import ExitStack
from pathlib import Path

import pytest
from harness.processes import free_domain, graph_environment
from harness.spin_nodes import SpunNodes, ros_context
from rclpy.node import Node
from std_msgs.msg import Float64

from seal_friction_ros.nodes.discovery import PROFILES, RANGE

SUBSCRIBER = """
import rclpy
from rclpy.node import Node
from std_msgs.msg import Float64

rclpy.init()
node = Node('subscriber')
node.create_subscription(Float64, 'topic', lambda message: print(message.data, flush=True), 100)
rclpy.spin(node)
"""
MORE_THAN_FIT = 1000  # messages; more than wait in the socket of a subscriber
OTHERS = 90  # participants whose ports are taken: the next ones get numbers beyond


def test_a_hundred_participants_of_a_machine_discover_each_other():
    domain = free_domain()
    with ExitStack() as stack:
        for number in range(OTHERS):
            for port in (7410 + 250 * domain + 2 * number, 7411 + 250 * domain + 2 * number):
                taken = stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
                taken.bind(('0.0.0.0', port))  # noqa: S104  as a participant does
        contexts = [stack.enter_context(ros_context(domain)) for _ in range(2)]
        sender, receiver = (Node(f'node_{number}', context=context) for number, context in enumerate(contexts))
        publisher = sender.create_publisher(Float64, 'topic', 10)
        received: list[Float64] = []
        receiver.create_subscription(Float64, 'topic', received.append, 10)

        def is_received() -> bool:
            publisher.publish(Float64())
            return bool(received)

        assert SpunNodes(contexts[1], receiver).spin_until(is_received)
        sender.destroy_node()
        receiver.destroy_node()


def test_a_subscriber_that_was_stopped_hears_the_last_message_though_none_follows():
    """By its own settings Fast DDS tells it after up to 3 s that it has missed something."""
    domain, numbers = free_domain(), iter(range(10 * MORE_THAN_FIT))
    with ExitStack() as stack:
        context = stack.enter_context(ros_context(domain))
        node = Node('publisher', context=context)
        publisher = node.create_publisher(Float64, 'topic', 100)
        command, environment = [sys.executable, '-c', SUBSCRIBER], graph_environment(domain)
        process = stack.enter_context(subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True))
        stack.callback(process.kill)
        assert SpunNodes(context, node).spin_until(lambda: publisher.get_subscription_count() > 0)
        delays = []
        for _ in range(3):
            process.send_signal(signal.SIGSTOP)
            for _ in range(MORE_THAN_FIT):
                last = float(next(numbers))
                publisher.publish(Float64(data=last))
            time.sleep(0.5)
            process.send_signal(signal.SIGCONT)
            began = time.monotonic()
            while float(process.stdout.readline()) != last:
                pass
            delays.append(time.monotonic() - began)
        node.destroy_node()
    assert max(delays) < 1.0  # 0.1 s, and what a busy machine adds; with 3 s it is more in two of three tries


LISTENER = """
import rclpy
from rclpy.node import Node
from std_msgs.msg import Float64

rclpy.init()
node, received = Node('listener'), []
node.create_subscription(Float64, 'topic', received.append, 10)
publisher = node.create_publisher(Float64, 'answer', 10)
while not received:
    rclpy.spin_once(node)
while True:
    publisher.publish(received[0])
    rclpy.spin_once(node, timeout_sec=0.05)
"""


@pytest.mark.parametrize('reach', ['LOCALHOST', 'SUBNET'])
def test_a_node_with_the_profile_and_one_with_the_settings_of_rclpy_hear_each_other(reach):
    domain = free_domain()
    plain = {name: value for name, value in graph_environment(domain).items() if name not in PROFILES}
    with ExitStack() as stack:
        context = stack.enter_context(ros_context(domain))
        node, heard = Node('publisher', context=context), []
        publisher = node.create_publisher(Float64, 'topic', 10)
        node.create_subscription(Float64, 'answer', heard.append, 10)
        process = stack.enter_context(subprocess.Popen([sys.executable, '-c', LISTENER], env={**plain, RANGE: reach}))
        stack.callback(process.kill)

        def is_answered() -> bool:
            publisher.publish(Float64(data=7.0))
            return bool(heard)

        assert SpunNodes(context, node).spin_until(is_answered)
        assert heard[0].data == 7.0
        node.destroy_node()


def test_a_node_listens_on_the_loopback_interface_alone_and_uses_no_shared_memory():
    script = 'import rclpy; rclpy.init(); node = rclpy.create_node("x"); print("up", flush=True); input()'
    command, environment = [sys.executable, '-c', script], graph_environment(free_domain())
    with subprocess.Popen(
        command, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout.readline() == 'up\n'
        folder = Path('/proc') / str(process.pid)
        assert 'fastdds' not in '\n'.join(line.split('/', 1)[-1] for line in shared(folder))
        inodes = {str(link.readlink()).removeprefix('socket:[').rstrip(']') for link in (folder / 'fd').iterdir()}
        bound = [row.split() for row in (folder / 'net' / 'udp').read_text().splitlines()[1:]]
        addresses = {row[1].split(':')[0] for row in bound if row[9] in inodes}
        process.communicate('\n')
    assert addresses == {'0100007F'}  # 127.0.0.1


def shared(folder: Path) -> list[str]:
    """Lines of shared memory among the maps of a process."""
    return [line for line in (folder / 'maps').read_text().splitlines() if '/dev/shm/' in line]  # noqa: S108
