"""Time to 0 N: ``python test/system/time_to_zero.py [--times 20] [--only TEXT] [--json]``.

Stops, freezes, leaps and kills each input and the reference of a live node, and deactivates, interrupts and terminates
the node. The node runs with its default parameters, each publisher in a process of its own, and this process receives
the feed-forward. The time counts from the last usable input, taken by its publisher just before it publishes, or from
just before the request or signal, until 0 N is received for good; at most `LONGEST`. Run it at real-time priority on a
busy machine: ``chrt -f 50``.

The middleware may deliver late what the node has sent in time (docs/degradation.md). So the time is also that of a
controller which takes no message older than `OLDEST`, as docs/controllers.md asks.

Alternating stamps stay usable. There the requirement is that a reversal is not faster than the slew limit.
"""

import argparse
import json
import mmap
import os
import random
import select
import signal
import struct
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import IO, Any, NamedTuple

import rclpy
from rclpy.node import Node
from rich.console import Console
from rich.progress import track
from rich.table import Table

sys.path.insert(0, str(Path(__file__).parents[1]))
from fault_rows import MS, good
from harness.processes import free_domain, graph_environment, node_process
from harness.spin_nodes import TIMEOUT, SpunNodes, ros_context
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rclpy.context import Context

from seal_friction_ros.core.estimation.feedforward import FeedForwardSettings
from seal_friction_ros.core.estimation.messages import DECODERS, FEEDFORWARD_TYPE, INPUTS, encode
from seal_friction_ros.files import share_directory
from seal_friction_ros.nodes import qos
from seal_friction_ros.nodes.discovery import PROFILES, set_up_discovery
from seal_friction_ros.nodes.managed_node import message_class

TOPICS = ('rod_velocity', 'cylinder_pressure', 'force_sum', 'servo_reference')
PERIOD = 4 * MS  # [ns] between two messages of each publisher
LONGEST = FeedForwardSettings().fade_time + 0.05  # [s]
QUIET = 0.3  # [s] 0 N for good
LONGEST_WAIT = 5.0  # [s] for it
OLDEST = 50 * MS  # [ns] message that a controller takes
SLOW_SLEW = 500.0  # [N/s] where stamps alternate
JITTER = 0.01  # [s] of the receipt
SHORT_LEASE = '<sec>2</sec>'  # until a killed publisher is gone from the graph, here
ANNOUNCED = '<sec>0</sec><nanosec>500000000</nanosec>'  # between two announcements, which have to be within the lease


# --- a publisher in a process of its own ---


def send(topic: str, shared: Path) -> None:
    """Publish one topic as told by the newest line of stdin: run, stop, freeze, alternate, leap or reverse.

    Args:
        topic: Its name.
        shared: File of 8 bytes with the time of the last usable message [ns of the monotonic clock].
    """
    set_up_discovery()
    rclpy.init()
    publisher = Node(f'{topic}_driver').create_publisher(message_class(INPUTS[topic]), topic, qos.STREAM)
    with shared.open('r+b') as file, mmap.mmap(file.fileno(), 8) as last_usable:
        command, sign, last, number = 'run', 1.0, good(time.time_ns())[topic][0], 0
        due = time.monotonic_ns()
        while True:
            due += PERIOD
            readable, _, _ = select.select([sys.stdin], [], [], max((due - time.monotonic_ns()) * 1e-9, 0.0))
            if readable:
                line = sys.stdin.readline().strip()
                if not line:
                    return
                if line == 'reverse':
                    sign = -sign
                else:
                    command = line
                time.sleep(max((due - time.monotonic_ns()) * 1e-9, 0.0))
            if command == 'stop':
                due = time.monotonic_ns()
                continue
            if command != 'freeze':
                number += 1
                ahead = {'alternate': 5 * MS * (number % 2), 'leap': 20 * MS}.get(command, 0)
                last = good(time.time_ns() + ahead)[topic][0]
                if topic == 'servo_reference':
                    last = last._replace(velocity=sign * last.velocity)
                last_usable[:] = struct.pack('q', time.monotonic_ns())
            publisher.publish(encode(last))
            if command == 'leap':
                command = 'stop'


class Sender:
    """Handle of a publisher process."""

    def __init__(self, topic: str, environment: dict[str, str], folder: Path) -> None:
        self._shared = folder / topic
        self._shared.write_bytes(bytes(8))
        command = [sys.executable, __file__, '--send', topic, str(self._shared)]
        self.process = subprocess.Popen(command, env=environment, stdin=subprocess.PIPE, text=True)

    def tell(self, command: str) -> None:
        """Send a command."""
        stdin: IO[str] = self.process.stdin  # type: ignore[assignment]
        stdin.write(f'{command}\n')
        stdin.flush()

    def last_usable(self) -> int:
        """Time of the last usable message [ns of the monotonic clock]."""
        return int(struct.unpack('q', self._shared.read_bytes())[0])

    def kill(self) -> None:
        """Kill it, wait for its end."""
        self.process.kill()
        self.process.wait()


# --- node, publishers, and the measurement ---


class TimeToZero(NamedTuple):
    """How long a force lasts [s]; infinite without 0 N."""

    received: float  # until 0 N is received
    acting: float  # until it acts no more, by a controller that takes no message older than `OLDEST`


class Received(NamedTuple):
    """A feed-forward that was received."""

    time: int  # [ns of the monotonic clock]
    force: float  # [N]
    limited: int  # bits
    stamp: int  # [ns of the monotonic clock]


class Axis(SpunNodes):
    """Node and publishers in processes of their own, and the measurement in this one."""

    def __init__(self, context: Context, folder: Path, domain: int, parameters: dict[str, Any]) -> None:
        self._listener = Node('listener', context=context)
        super().__init__(context, self._listener)
        self._folder, self._domain, self._parameters = folder, domain, parameters
        self._environment = graph_environment(domain)
        self.received: list[Received] = []
        kind = message_class(FEEDFORWARD_TYPE)
        self._listener.create_subscription(kind, 'friction_feedforward', self._on_feedforward, 1000, raw=True)
        self._change = self._listener.create_client(ChangeState, 'friction_estimator/change_state')
        self.senders = {topic: self._sender(topic) for topic in TOPICS}
        self._stack = ExitStack()
        self.node = self._start_node()

    def _on_feedforward(self, data: bytes) -> None:
        received, since = time.monotonic_ns(), time.time_ns() - time.monotonic_ns()
        answer = DECODERS[FEEDFORWARD_TYPE](data)
        self.received.append(Received(received, answer.force, answer.limited, answer.stamp - since))

    def _sender(self, topic: str) -> Sender:
        return Sender(topic, self._environment, self._folder)

    def _start_node(self) -> subprocess.Popen[bytes]:
        log = self._folder / 'log'
        return self._stack.enter_context(node_process('friction_estimator', self._domain, self._parameters, log))

    def close(self) -> None:
        """End all processes."""
        for sender in self.senders.values():
            sender.kill()
        self._stack.close()
        self._listener.destroy_node()

    def restore(self) -> None:
        """All publishers run, the force is there.

        Raises:
            RuntimeError: It does not come.
        """
        if self.node.poll() is not None:
            self._stack.close()
            self.node = self._start_node()
        for topic, sender in self.senders.items():
            if sender.process.poll() is not None:
                self.senders[topic] = self._sender(topic)
            else:
                sender.tell('run')
        self.received.clear()

        def is_steady() -> bool:
            newest = self.received[-20:]
            return len(newest) == 20 and all(one.force > 0.0 and not one.limited for one in newest)

        if not self.spin_until(is_steady):
            raise RuntimeError(f'no force: {self.received[-1:]}; {(self._folder / "log").read_text()[-2000:]}')
        self.spin(random.uniform(0.0, 0.05))  # noqa: S311

    def time_to_zero(self, since: Callable[[], int]) -> TimeToZero:
        """Time from ``since()`` [ns] until 0 N, and no other force for `QUIET`."""
        start = time.monotonic_ns()

        def zero() -> int:
            """Index of the first message after the last force that is not 0 N."""
            return 1 + max((i for i, one in enumerate(self.received) if one.force != 0.0), default=-1)

        def is_quiet() -> bool:
            last = max(self.received[zero() - 1].time, start) if zero() else start
            return zero() < len(self.received) and time.monotonic_ns() - last > QUIET * 1e9

        if not self.spin_until(is_quiet, LONGEST_WAIT):
            return TimeToZero(float('inf'), float('inf'))
        taken = [one for one in self.received if one.time - one.stamp <= OLDEST]
        forces = [i for i, one in enumerate(taken) if one.force != 0.0]
        end = start
        if forces:
            end = taken[forces[-1]].stamp + OLDEST
            end = min([end, *(one.time for one in taken[forces[-1] + 1 : forces[-1] + 2])])
        return TimeToZero((self.received[zero()].time - since()) * 1e-9, (end - since()) * 1e-9)

    def change_state(self, transition: int) -> None:
        """Request a transition of the node, and wait for the answer."""
        self.spin_until(self._change.service_is_ready)
        future = self._change.call_async(ChangeState.Request(transition=Transition(id=transition)))
        self.spin_until(future.done)


@contextmanager
def axis(parameters: dict[str, Any] | None = None) -> Iterator[Axis]:
    """Node and publishers, on a ROS domain of their own; a killed publisher leaves the graph after `SHORT_LEASE`."""
    domain = free_domain()
    with tempfile.TemporaryDirectory() as name, ExitStack() as stack:
        folder, profile = Path(name), share_directory('seal_friction_ros', __file__) / 'config' / 'fastdds.xml'
        text = profile.read_text().replace('<sec>2</sec>', ANNOUNCED).replace('<sec>20</sec>', SHORT_LEASE)
        (folder / 'fastdds.xml').write_text(text)
        os.environ[PROFILES[0]] = str(folder / 'fastdds.xml')
        stack.callback(os.environ.pop, PROFILES[0])
        made = Axis(stack.enter_context(ros_context(domain)), folder, domain, parameters or {})
        stack.callback(made.close)
        yield made


# --- cases ---


def told(topic: str, command: str) -> Callable[[Axis], TimeToZero]:
    """A publisher stops, freezes or leaps."""

    def attempt(place: Axis) -> TimeToZero:
        sender = place.senders[topic]
        sender.tell(command)
        return place.time_to_zero(sender.last_usable)

    return attempt


def killed(topic: str) -> Callable[[Axis], TimeToZero]:
    """A publisher is killed."""

    def attempt(place: Axis) -> TimeToZero:
        sender = place.senders[topic]
        sender.kill()
        return place.time_to_zero(sender.last_usable)

    return attempt


def signalled(number: signal.Signals) -> Callable[[Axis], TimeToZero]:
    """The node gets a signal."""

    def attempt(place: Axis) -> TimeToZero:
        start = time.monotonic_ns()
        place.node.send_signal(number)
        found = place.time_to_zero(lambda: start)
        code = place.node.wait(TIMEOUT)
        return found if code == 0 else TimeToZero(float('inf'), float('inf'))

    return attempt


def deactivated(place: Axis) -> TimeToZero:
    """The node is deactivated."""
    start = time.monotonic_ns()
    place.change_state(Transition.TRANSITION_DEACTIVATE)
    found = place.time_to_zero(lambda: start)
    place.change_state(Transition.TRANSITION_ACTIVATE)
    return found


def alternating_reversal(topic: str) -> Callable[[Axis], float]:
    """Stamps alternate by 5 ms while the reference reverses: time of the reversal beyond that of the slew limit [s]."""

    def attempt(place: Axis) -> float:
        largest = place.received[-1].force
        place.senders[topic].tell('alternate')
        place.spin(0.1)
        before = len(place.received)
        place.senders['servo_reference'].tell('reverse')
        if not place.spin_until(lambda: place.received[-1].force <= -0.99 * largest):
            return -float('inf')
        place.senders['servo_reference'].tell('reverse')
        begin = max(one.time for one in place.received if one.force >= 0.99 * largest)
        end = min(one.time for one in place.received[before:] if one.force <= -0.99 * largest)
        highest = max(abs(one.force) for one in place.received)
        slowest = 2 * 0.99 * largest / SLOW_SLEW
        return (end - begin) * 1e-9 - slowest if highest <= 1.01 * largest else -float('inf')

    return attempt


TIMED: dict[str, Callable[[Axis], TimeToZero]] = {
    **{f'{topic} stops': told(topic, 'stop') for topic in TOPICS},
    **{f'{topic} repeats its last message': told(topic, 'freeze') for topic in TOPICS},
    **{f'{topic} leaps 20 ms ahead, then stops': told(topic, 'leap') for topic in TOPICS},
    **{f'publisher of {topic} killed': killed(topic) for topic in TOPICS},
    'deactivate': deactivated,
    'SIGINT': signalled(signal.SIGINT),
    'SIGTERM': signalled(signal.SIGTERM),
}
"""Case -> time to 0 N."""
REVERSALS = {f'stamps of {topic} alternate by 5 ms': alternating_reversal(topic) for topic in TOPICS}
"""Case -> time of a reversal beyond the one that the slew limit asks for [s]."""


def tried(cases: dict[str, Callable[[Axis], Any]], parameters: dict[str, Any], times: int) -> dict[str, list[Any]]:
    """Results of each case."""
    found: dict[str, list[Any]] = {name: [] for name in cases}
    if cases:
        with axis(parameters) as place:
            for _ in track(range(times), console=Console(stderr=True)):
                for name, case in cases.items():
                    place.restore()
                    found[name].append(case(place))
    return found


def main() -> int:
    """Try every case; print the table, or JSON; 1 if a requirement does not hold."""
    if sys.argv[1:2] == ['--send']:
        send(sys.argv[2], Path(sys.argv[3]))
        return 0
    parser = argparse.ArgumentParser(description=__doc__.split('\n', maxsplit=1)[0])
    parser.add_argument('--times', type=int, default=20, help='tries of each case')
    parser.add_argument('--only', default='', help='only cases with this text in their name')
    parser.add_argument('--json', action='store_true')
    arguments = parser.parse_args()
    timed, reversals = ({n: c for n, c in cases.items() if arguments.only in n} for cases in (TIMED, REVERSALS))
    times = tried(timed, {}, arguments.times)
    beyond = tried(reversals, {'feedforward.slew_limit': SLOW_SLEW}, arguments.times)
    acting = {name: [one.acting for one in found] for name, found in times.items()} | beyond
    received = {name: [one.received for one in found] for name, found in times.items()} | beyond
    if arguments.json:
        print(json.dumps({'received': received, 'acting': acting}))
    else:
        table = Table('case', 'median [ms]', 'largest [ms]', 'in time', 'acting: largest [ms]', 'in time')
        for name, found in received.items():
            least, most = (0.0, LONGEST) if name in times else (-JITTER, float('inf'))
            row = [name, f'{sorted(found)[len(found) // 2] * 1e3:.0f}']
            for values in (found, acting[name]):
                held = sum(least <= value <= most for value in values)
                row += [f'{max(values) * 1e3:.0f}', f'{held} of {len(values)}']
            table.add_row(*row)
        Console(width=140).print(table)
    in_time = all(max(one) <= LONGEST for found in times.values() for one in found)
    return int(not in_time or any(t < -JITTER for found in beyond.values() for t in found))


if __name__ == '__main__':
    sys.exit(main())
