"""How many participants of one machine discover each other."""

import socket
from contextlib import ExitStack

from harness.processes import free_domain
from harness.spin_nodes import SpunNodes, ros_context
from rclpy.node import Node
from std_msgs.msg import Float64

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
