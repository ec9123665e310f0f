"""Time to 0 N: ``python test/system/time_to_zero.py [--times 20] [--only TEXT ...] [--json]``.

Stops, freezes, leaps and kills each input, the reference and simulated time of a live node, reverses the reference
meanwhile, asks for what no rod can do, holds the node up (SIGSTOP, a share of the processor) while the machine goes on
or stops, deactivates, interrupts and terminates it, and starts it wrongly. The node runs with real seals, a scale of
0.9 and else its default parameters, each publisher in a process of its own, and this process receives the feed-forward.
The time counts from the last usable input, taken by its publisher just before it publishes, or from just before the
request or signal, until 0 N is received for good; at most `LONGEST`. Run it at real-time priority on a busy machine:
``chrt -f 50``.

The middleware may deliver late what the node has sent in time (docs/degradation.md). So the time is also that of a
controller which takes no message older than `OLDEST`, as docs/controllers.md asks.

Time counts from SIGCONT where a node was stopped: until then nobody can act. If the machine goes on meanwhile, it
counts until the last force from an input that is older than `OLDEST`; a force in time may go on. A force against the
wanted velocity, a node that starts where it must not, and a force from placeholder seals count as infinite.

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
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from http.client import HTTPConnection
from pathlib import Path
from typing import IO, Any, NamedTuple
from urllib.parse import urlsplit

import rclpy
from rclpy.node import Node
from rich.console import Console
from rich.progress import track
from rich.table import Table

sys.path.insert(0, str(Path(__file__).parents[1]))
from fault_rows import MS, good
from harness.monitor_process import monitor
from harness.processes import free_domain, graph_environment, node_process
from harness.spin_nodes import TIMEOUT, SpunNodes, ros_context
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rclpy.context import Context

from seal_friction_ros.core.estimation.feedforward import FeedForwardSettings
from seal_friction_ros.core.messages.coder import DECODERS, encode, encode_text
from seal_friction_ros.core.messages.layouts import (
    CLOCK_TOPIC,
    CLOCK_TYPE,
    CONFIGURATION_TYPE,
    FEEDFORWARD_TYPE,
    INPUTS,
)
from seal_friction_ros.core.messages.records import Clock, ServoReference
from seal_friction_ros.files import share_directory
from seal_friction_ros.nodes import qos
from seal_friction_ros.nodes.discovery import PROFILES, set_up_discovery
from seal_friction_ros.nodes.managed_node import message_class

TOPICS = ('rod_velocity', 'cylinder_pressure', 'force_sum', 'servo_reference')
NODE = {'seals': ['ms28775_114', 'ms28775_114'], 'feedforward.scale': 0.9}
"""Parameters of the node in all cases"""
STOPS = (0.2, 1.0, 5.0)  # [s] for which a node is stopped
SHARE = (0.002, 0.018)  # [s] for which a node with a tenth of the processor runs and is stopped
BOMB = '[' * 100_000
"""Text of a configuration that a parser without bounds does not survive"""
ABSURD = 1e300  # [-] reference that no rod can follow over the usual one
PERIOD = 4 * MS  # [ns] between two messages of each publisher
LONGEST = FeedForwardSettings().fade_time + 0.05  # [s]
QUIET = 0.3  # [s] 0 N for good
LONGEST_WAIT = 5.0  # [s] for it
OLDEST = 50 * MS  # [ns] message that a controller takes
HANDSHAKE = 0.3  # [s] until a request to a new service is heard at once
SLOW_SLEW = 500.0  # [N/s] where stamps alternate
JITTER = 0.01  # [s] of the receipt
NEVER_ZERO = float('inf')  # [s]
REVERSAL_TICKS = 10  # feed-forwards until one has heard of a reversal
LEASE, SHORT_LEASE = '<sec>20</sec>', '<sec>2</sec>'  # until a killed publisher is gone from the graph, and here
ANNOUNCED = '<sec>0</sec><nanosec>500000000</nanosec>'  # between two announcements, which have to be within the lease


# --- a publisher in a process of its own ---


def send(topic: str, shared: Path) -> None:
    """Publish one topic as told by the newest line of stdin: run, stop, freeze, alternate, leap, absurd or reverse.

    Args:
        topic: Its name.
        shared: File of 8 bytes with the time of the last usable message [ns of the monotonic clock].
    """
    set_up_discovery()
    rclpy.init()
    is_clock = topic == CLOCK_TOPIC
    kind = CLOCK_TYPE if is_clock else INPUTS[topic]
    made = Clock if is_clock else lambda time_ns: good(time_ns)[topic][0]
    publisher = Node(f'{topic.strip("/")}_driver').create_publisher(message_class(kind), topic, qos.STREAM)
    with shared.open('r+b') as file, mmap.mmap(file.fileno(), 8) as last_usable:
        command, sign, last, number = 'run', 1.0, made(time.time_ns()), 0
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
                last = directed(made(time.time_ns() + ahead), ABSURD if command == 'absurd' else sign)
                if command != 'absurd':
                    last_usable[:] = struct.pack('q', time.monotonic_ns())
            publisher.publish(clock_bytes(last) if is_clock else encode(last))
            if command == 'leap':
                command = 'stop'


def directed(record: Any, factor: float) -> Any:
    """A reference with its velocity times ``factor``; another record as it is."""
    return record._replace(velocity=factor * record.velocity) if isinstance(record, ServoReference) else record


def clock_bytes(clock: Clock) -> bytes:
    """Bytes of simulated time."""
    return struct.pack('<4siI', b'\x00\x01\x00\x00', *divmod(clock.stamp, 10**9))


class Sender:
    """Handle of a publisher process."""

    def __init__(self, topic: str, environment: dict[str, str], folder: Path) -> None:
        self._shared = folder / topic.strip('/')
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

    def __init__(
        self, context: Context, folder: Path, domain: int, parameters: dict[str, Any], topics: tuple[str, ...]
    ) -> None:
        self.listener = Node('listener', context=context)
        super().__init__(context, self.listener)
        self.folder, self.domain, self._parameters = folder, domain, {**NODE, **parameters}
        self._environment = graph_environment(domain)
        self.received: list[Received] = []
        self.deaf = 0  # starts after which nothing was heard
        kind = message_class(FEEDFORWARD_TYPE)
        self.listener.create_subscription(kind, 'friction_feedforward', self._on_feedforward, 1000, raw=True)
        self._change = self.listener.create_client(ChangeState, 'friction_estimator/change_state')
        self.senders = {topic: self._sender(topic) for topic in topics}
        self._stack = ExitStack()
        self.node = self._start_node()

    def _on_feedforward(self, data: bytes) -> None:
        received, since = time.monotonic_ns(), time.time_ns() - time.monotonic_ns()
        answer = DECODERS[FEEDFORWARD_TYPE](data)
        self.received.append(Received(received, answer.force, answer.limited, answer.stamp - since))

    def _sender(self, topic: str) -> Sender:
        return Sender(topic, self._environment, self.folder)

    def _start_node(self) -> subprocess.Popen[bytes]:
        log = self.folder / 'log'
        return self._stack.enter_context(node_process('friction_estimator', self.domain, self._parameters, log))

    def kill_node(self) -> None:
        """Kill the node; `restore` starts another one."""
        self.node.kill()
        self.node.wait()

    def close(self) -> None:
        """End all processes."""
        for sender in self.senders.values():
            sender.kill()
        self._stack.close()
        self.listener.destroy_node()

    def restore(self) -> None:
        """All publishers run, the force is there.

        A node that is started after a kill may hear nothing (docs/degradation.md): then all start anew, and it counts.

        Raises:
            RuntimeError: It does not come.
        """
        if not self._come_back():
            self.deaf += 1
            self.kill_node()
            for sender in self.senders.values():
                sender.kill()
            if not self._come_back():
                raise RuntimeError(f'no force: {self.received[-1:]}; {(self.folder / "log").read_text()[-2000:]}')
        self.spin(random.uniform(0.0, 0.05))  # noqa: S311  no secret

    def _come_back(self) -> bool:
        """Start what does not run; whether the force comes."""
        self.node.send_signal(signal.SIGCONT)
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

        return self.spin_until(is_steady)

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
            return TimeToZero(NEVER_ZERO, NEVER_ZERO)
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
def axis(
    parameters: dict[str, Any] | None = None, topics: tuple[str, ...] = TOPICS, lease: str = SHORT_LEASE
) -> Iterator[Axis]:
    """Node and publishers, on a ROS domain of their own; a killed publisher leaves the graph after the lease."""
    domain = free_domain()
    with tempfile.TemporaryDirectory() as name, ExitStack() as stack:
        folder, profile = Path(name), share_directory('seal_friction_ros', __file__) / 'config' / 'fastdds.xml'
        text = profile.read_text().replace('<sec>2</sec>', ANNOUNCED).replace(LEASE, lease)
        (folder / 'fastdds.xml').write_text(text)
        set_up_discovery()
        stack.callback(os.environ.update, {PROFILES[0]: os.environ[PROFILES[0]]})
        os.environ[PROFILES[0]] = str(folder / 'fastdds.xml')
        made = Axis(stack.enter_context(ros_context(domain)), folder, domain, parameters or {}, topics)
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
        return found if code == 0 else TimeToZero(NEVER_ZERO, NEVER_ZERO)

    return attempt


def deactivated(place: Axis) -> TimeToZero:
    """The node is deactivated; it hears the first request to a service only a heartbeat after it is there."""
    place.spin(HANDSHAKE)
    start = time.monotonic_ns()
    place.change_state(Transition.TRANSITION_DEACTIVATE)
    found = place.time_to_zero(lambda: start)
    place.change_state(Transition.TRANSITION_ACTIVATE)
    return found


def together(command: str, *topics: str) -> Callable[[Axis], TimeToZero]:
    """Some publishers do the same at the same time."""

    def attempt(place: Axis) -> TimeToZero:
        for topic in topics or place.senders:
            place.senders[topic].tell(command)
        return place.time_to_zero(lambda: min(place.senders[topic].last_usable() for topic in topics or place.senders))

    return attempt


def clock_stops_before_a_reversal(place: Axis) -> TimeToZero:
    """Simulated time stops, then the wanted velocity reverses: the force never acts against it."""
    clock, reference = place.senders[CLOCK_TOPIC], place.senders['servo_reference']
    clock.tell('stop')
    place.spin(0.05)
    before = len(place.received)
    reference.tell('reverse')
    found = place.time_to_zero(clock.last_usable)
    reference.tell('reverse')
    opposed = [one for one in place.received[before + REVERSAL_TICKS :] if one.force > 0.0]
    return TimeToZero(NEVER_ZERO, NEVER_ZERO) if opposed else found


def stopped(seconds: float, *, goes_on: bool) -> Callable[[Axis], TimeToZero]:
    """The node is stopped for a while, the machine goes on or is switched off meanwhile."""

    def attempt(place: Axis) -> TimeToZero:
        place.node.send_signal(signal.SIGSTOP)
        place.spin(seconds / 2.0)
        if not goes_on:
            for sender in place.senders.values():
                sender.tell('stop')
        place.spin(seconds / 2.0)
        place.received.clear()
        start = time.monotonic_ns()
        place.node.send_signal(signal.SIGCONT)
        if not goes_on:
            return place.time_to_zero(lambda: start)
        end = start + round((LONGEST + QUIET) * 1e9)
        place.spin_until(lambda: place.received and place.received[-1].time > end, LONGEST_WAIT)
        late = [one.time for one in place.received if one.force != 0.0 and one.time - one.stamp > OLDEST]
        found = (max(late, default=start) - start) * 1e-9 if place.received else NEVER_ZERO
        return TimeToZero(found, found)

    return attempt


@contextmanager
def slowed(process: subprocess.Popen[bytes]) -> Iterator[None]:
    """The node gets `SHARE` of the processor."""
    ended = threading.Event()

    def hold_up() -> None:
        """Stop it and let it go on, until the end."""
        while not ended.is_set():
            process.send_signal(signal.SIGSTOP)
            time.sleep(SHARE[1])
            process.send_signal(signal.SIGCONT)
            time.sleep(SHARE[0])

    thread = threading.Thread(target=hold_up)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()


def backlog(place: Axis) -> TimeToZero:
    """All inputs stop while a node with a tenth of the processor is behind."""
    with slowed(place.node):
        place.spin(1.0)
        return together('stop')(place)


def switch_off(url: str) -> None:
    """Press OFF in the live view at ``url``."""
    parts = urlsplit(url)
    connection = HTTPConnection(parts.netloc, timeout=LONGEST_WAIT)
    connection.request('POST', f'/off?{parts.query}', b'{}', {'Content-Type': 'application/json'})
    connection.getresponse().read()


def bombed(place: Axis) -> TimeToZero:
    """OFF in the live view after a configuration that is made to break parsers."""
    publisher = place.listener.create_publisher(message_class(CONFIGURATION_TYPE), '/x/configuration', qos.LATCHED)
    with monitor(place.domain, '--allow-changes') as watching:
        publisher.publish(encode_text(BOMB))
        place.spin(1.0)
        start = time.monotonic_ns()
        thread = threading.Thread(target=switch_off, args=(watching.url,))
        thread.start()
        found = place.time_to_zero(lambda: start)
        thread.join()
    place.listener.destroy_publisher(publisher)
    place.kill_node()
    return found


def started(values: dict[str, Any], *, runs: bool) -> Callable[[Axis], TimeToZero]:
    """A node that is started with these parameters makes no force; it runs, or ends with one line."""

    def attempt(place: Axis) -> TimeToZero:
        place.kill_node()
        place.spin(QUIET)  # until its last forces have come
        place.received.clear()
        log = place.folder / 'wrong'
        with node_process('friction_estimator', place.domain, {**NODE, **values}, log) as process:
            place.spin_until(lambda: process.poll() is not None or len(place.received) > 100)
            has_force = any(one.force != 0.0 for one in place.received)
            is_right = not has_force and (
                process.poll() is None and len(place.received) > 100 if runs else process.poll() == 2
            )
        return TimeToZero(0.0, 0.0) if is_right else TimeToZero(NEVER_ZERO, NEVER_ZERO)

    return attempt


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
    'servo_reference asks for 1e300 m/s': told('servo_reference', 'absurd'),
    'all inputs stop while the node has a tenth of the processor': backlog,
    'OFF in the live view after a configuration bomb': bombed,
    'mistyped feedforward.scale': started({'feedfoward.scale': 0.0}, runs=False),
    'placeholder seals': started({'seals': ['placeholder', 'placeholder']}, runs=True),
    'deactivate': deactivated,
    'SIGINT': signalled(signal.SIGINT),
    'SIGTERM': signalled(signal.SIGTERM),
}
"""Case -> time to 0 N."""
HELD_UP: dict[str, Callable[[Axis], TimeToZero]] = {
    f'node stopped for {seconds:g} s, the machine {word}': stopped(seconds, goes_on=goes_on)
    for seconds in STOPS
    for goes_on, word in ((True, 'goes on'), (False, 'is switched off'))
}
"""The same with the leases of config/fastdds.xml, so that others do not take the stopped node for dead."""
SIMULATED: dict[str, Callable[[Axis], TimeToZero]] = {
    '/clock stops': told(CLOCK_TOPIC, 'stop'),
    '/clock repeats its last message': told(CLOCK_TOPIC, 'freeze'),
    '/clock stops, then the reference reverses': clock_stops_before_a_reversal,
    '/clock and all inputs stop': together('stop'),
}
"""The same with simulated time."""
REVERSALS = {f'stamps of {topic} alternate by 5 ms': alternating_reversal(topic) for topic in TOPICS}
"""Case -> time of a reversal beyond the one that the slew limit asks for [s]."""


def tried(
    cases: dict[str, Callable[[Axis], Any]],
    times: int,
    parameters: dict[str, Any] | None = None,
    topics: tuple[str, ...] = TOPICS,
    lease: str = SHORT_LEASE,
) -> dict[str, list[Any]]:
    """Results of each case."""
    found: dict[str, list[Any]] = {name: [] for name in cases}
    if cases:
        with axis(parameters, topics, lease) as place:
            for _ in track(range(times), console=Console(stderr=True)):
                for name, case in cases.items():
                    place.restore()
                    found[name].append(case(place))
            if place.deaf:
                print(f'{place.deaf} started nodes heard nothing until all publishers were restarted', file=sys.stderr)
    return found


def main() -> int:
    """Try every case; print the table, or JSON; 1 if a requirement does not hold."""
    if sys.argv[1:2] == ['--send']:
        send(sys.argv[2], Path(sys.argv[3]))
        return 0
    parser = argparse.ArgumentParser(description=__doc__.split('\n', maxsplit=1)[0])
    parser.add_argument('--times', type=int, default=20, help='tries of each case')
    parser.add_argument('--only', action='append', help='only cases with this text in their name; again for more')
    parser.add_argument('--json', action='store_true')
    arguments = parser.parse_args()
    timed, held_up, simulated, reversals = (
        {name: case for name, case in cases.items() if any(text in name for text in arguments.only or [''])}
        for cases in (TIMED, HELD_UP, SIMULATED, REVERSALS)
    )
    # This process keeps the lease of its first participant, which must be longer than a node is held up.
    times = tried(held_up, arguments.times, lease=LEASE) | tried(timed, arguments.times)
    times |= tried(simulated, arguments.times, {'use_sim_time': True}, (*TOPICS, CLOCK_TOPIC))
    beyond = tried(reversals, arguments.times, {'feedforward.slew_limit': SLOW_SLEW})
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
