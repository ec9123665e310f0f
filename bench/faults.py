"""The fault campaign: ``python bench/faults.py [--times 20] [--only WORDS] [--seed 1] [--json]``.

Every fault is tried so many times on the live node, and a table says what was required and what happened. The signal
faults are the rows of ``fault_rows.py``; the others, of graph, process and disk, are here.
"""

import argparse
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from fault_rows import AFTER, MS, SIGNAL_ROWS, UNKNOWN, good
from fault_stage import SETTINGS, Driver, Outputs, Stage, complaints_at_any_time, stage, try_row
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rclpy.context import Context
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data
from rich.console import Console
from rich.progress import track
from rich.table import Table
from rosgraph_msgs.msg import Clock
from seal_friction_msgs.msg import CylinderPressure, FrictionEstimate, RodVelocity
from spun import Spun
from stalled_disk import StallingDisk
from std_msgs.msg import Float64

from seal_friction_ros.core.estimation import records
from seal_friction_ros.core.estimation.feedforward import FeedForward
from seal_friction_ros.core.estimation.messages import encode
from seal_friction_ros.core.estimation.records import Status
from seal_friction_ros.nodes import qos
from seal_friction_ros.nodes.discovery import set_up_discovery
from seal_friction_ros.nodes.friction_estimator import FrictionEstimator
from seal_friction_ros.nodes.processes import free_domain, running
from seal_friction_ros.offline.bags import mcap_writer
from seal_friction_ros.offline.bags.bag import read_messages
from seal_friction_ros.offline.bags.recover import recover
from seal_friction_ros.offline.replay.replay import replay

PATIENCE = 20.0  # [s]
REQUIRED = ('estimate', 'feed-forward', 'status and diagnostics', 'recording')
OWN_MOUNTS = ('unshare', '--map-root-user', '--mount')


@dataclass(frozen=True)
class Trial:
    """A fault of graph, process or disk."""

    fault: str
    estimate: str
    feedforward: str
    said: str
    """status bits, and what diagnostics say"""
    recording: str
    """``-`` where nothing is recorded"""
    attempt: Callable[[random.Random, Path], list[str]]
    """one try, with a folder of its own; what was not as required"""

    @property
    def required(self) -> tuple[str, ...]:
        """What is required, column by column."""
        return self.estimate, self.feedforward, self.said, self.recording


def statuses(outputs: Outputs) -> set[int]:
    """Status of every estimate."""
    return {output.status for output in outputs if isinstance(output, records.FrictionEstimate)}


def unless(holds: object, words: str) -> list[str]:
    """The complaint, unless it holds."""
    return [] if holds else [words]


def recovered(place: Stage) -> list[str]:
    """Good samples for a while; what is not as if nothing had been, and what must never be, since the start."""
    place.run(AFTER)
    outputs = place.run(AFTER)
    forces = [output for output in outputs if isinstance(output, FeedForward)]
    wrong = unless(statuses(outputs) == {0}, f'after it: statuses {statuses(outputs)}')
    wrong += unless(forces and not forces[-1].limited, f'after it: feed-forward {forces[-1:]}')
    return wrong + complaints_at_any_time(place.driver.outputs)


def message(place: Stage) -> str:
    """Message of the newest diagnostics of the estimate."""
    return str(place.estimator.diagnostics()['estimate'].message)


def best_effort(place: Stage) -> str | None:
    """Who offers the velocity as best effort only, as the diagnostics have it."""
    values = {value.key: value.value for value in place.estimator.diagnostics()['estimate'].values}
    return values.get('rod_velocity best effort only, from')


# --- graph ---


def topic_comes_late(chance: random.Random, folder: Path) -> list[str]:
    """The pressure has no publisher at first."""
    del chance, folder
    with stage() as place:
        place.restart()
        place.driver.destroy_publisher(place.driver.inputs.pop('cylinder_pressure'))
        early = place.run(30, lambda tick, _: {name: tick[name] for name in tick if name != 'cylinder_pressure'})
        place.driver.inputs['cylinder_pressure'] = place.driver.create_publisher(
            CylinderPressure, 'cylinder_pressure', QoSProfile(depth=100)
        )
        place.connect()
        wrong = unless(statuses(early) == {Status.PRESSURE_MISSING}, f'before: {statuses(early)}')
        estimates = [o for o in early if isinstance(o, records.FrictionEstimate)]
        wrong += unless({e.state for e in estimates} == set(UNKNOWN), 'before: a state without pressure')
        forces = {o.force for o in early if isinstance(o, FeedForward)}
        wrong += unless(forces == {0.0}, f'before: feed-forward {forces}')
        return wrong + recovered(place)


@contextmanager
def intruder(place: Stage, name: str = 'intruder') -> Iterator[Node]:
    """A node of another process, as far as the middleware can tell."""
    context = Context()
    rclpy.init(context=context, domain_id=place.context.get_domain_id())
    node = Node(name, context=context)
    try:
        yield node
    finally:
        node.destroy_node()
        rclpy.try_shutdown(context=context)


def second_publisher(chance: random.Random, folder: Path, *, refuse: bool = False) -> list[str]:
    """Another node publishes an input."""
    del folder
    topic, kind = chance.choice([('rod_velocity', RodVelocity), ('cylinder_pressure', CylinderPressure)])
    words = f'/{topic} has several publishers: /driver, /intruder'
    with stage({'refuse_second_publisher': refuse}) as place:
        wrong = []
        place.run(60)
        with intruder(place) as other:
            other.create_publisher(kind, topic, 10)
            wrong += unless(place.spin_until(lambda: words in message(place)), f'not named: {message(place)}')
            for _ in range(2):
                place.level()
                during = place.run(60)
                level = place.level()
                forces = [output for output in during if isinstance(output, FeedForward)]
                if refuse:
                    wrong += unless(statuses(during) == {Status.INPUT_REFUSED}, f'{statuses(during)} while refused')
                    wrong += unless(forces[-1].force == 0.0, f'still {forces[-1].force} N')
                    wrong += unless(level == 'ERROR', level)
                else:
                    wrong += unless(statuses(during) == {0}, f'{statuses(during)}') + unless(level == 'WARN', level)
                wrong += complaints_at_any_time(place.driver.outputs)
                place.restart()  # and once more: what was refused stays so
        wrong += unless(place.spin_until(lambda: 'several' not in message(place)), 'still there when it is gone')
        return wrong + recovered(place)


def second_publisher_refused(chance: random.Random, folder: Path) -> list[str]:
    """The same, with ``refuse_second_publisher``."""
    return second_publisher(chance, folder, refuse=True)


def is_answered(place: Stage) -> bool:
    """Send one good moment; whether an estimate comes soon."""
    place.now += MS
    before = place.driver.estimates
    for topic, messages in good(place.now).items():
        if topic in place.driver.inputs:
            place.driver.inputs[topic].publish(encode(messages[0]))
    return place.spin_until(lambda: place.driver.estimates > before, 0.2)


def incompatible_quality(chance: random.Random, folder: Path) -> list[str]:
    """A publisher that offers best effort only, a subscriber that wants what was never kept, another type."""
    del chance, folder
    with stage(autostart=False) as place:
        place.driver.destroy_publisher(place.driver.inputs['rod_velocity'])
        place.driver.inputs['rod_velocity'] = place.driver.create_publisher(
            RodVelocity, 'rod_velocity', qos_profile_sensor_data
        )
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        if not place.estimator.autostart():
            return ['does not start']
        with intruder(place, 'logger') as other, intruder(place, 'odd_driver') as odd:
            other.create_subscription(FrictionEstimate, 'friction_estimate', lambda _: None, latched)
            odd.create_publisher(Float64, 'rod_position', 10)
            place.driver.destroy_publisher(place.driver.inputs.pop('rod_position'))
            wrong = []
            for words in (
                '/logger wants incompatible quality of service (volatile where transient local is wanted)',
                '/odd_driver publishes std_msgs/msg/Float64, not seal_friction_msgs/msg/RodPosition',
            ):
                said = place.spin_until(lambda words=words: words in message(place), 30.0)  # names may come late
                wrong += unless(said, f'not said: {words}, but: {message(place)}')
            wrong += unless(best_effort(place) == '/driver', f'best effort taken from {best_effort(place)}')
        place.connect()
        wrong += recovered(place)
        for quality, taken in ((qos.STREAM, None), (qos_profile_sensor_data, '/driver')):  # it comes back otherwise
            place.driver.destroy_publisher(place.driver.inputs['rod_velocity'])
            place.driver.inputs['rod_velocity'] = place.driver.create_publisher(RodVelocity, 'rod_velocity', quality)
            said = place.spin_until(lambda taken=taken: best_effort(place) == taken)
            wrong += unless(said, f'best effort from {best_effort(place)}, not {taken}')
            place.connect()
            # Without reliability, what is sent before both ends know of each other is lost.
            wrong += unless(place.spin_until(lambda: is_answered(place)), 'no sample is answered')
            wrong += recovered(place)
        return wrong


def second_estimator(chance: random.Random, folder: Path) -> list[str]:
    """Another estimator with the same name."""
    del chance, folder
    with stage() as place:
        context = Context()
        rclpy.init(context=context, domain_id=place.context.get_domain_id())
        twin = FrictionEstimator(context=context, parameter_overrides=[Parameter('autostart', value=True)])
        words = '/friction_estimate has several publishers: /friction_estimator, /friction_estimator'
        try:
            wrong = unless(twin.autostart(), 'the second one does not start')
            wrong += unless(place.spin_until(lambda: words in message(place)), f'not named: {message(place)}')
            during = place.run(30)
        finally:
            twin.finish()
            twin.destroy_node()
            rclpy.try_shutdown(context=context)
        wrong += unless(statuses(during) == {0}, f'{statuses(during)}')
        gone = place.spin_until(lambda: 'several' not in message(place), 25.0)
        return wrong + unless(gone, 'still there when it is gone') + recovered(place)


def parameters_change(chance: random.Random, folder: Path) -> list[str]:
    """Settings change every few samples, some to nonsense."""
    recording = {'record': True, 'record_directory': str(folder), 'record_name': 'bag'}
    with stage(recording) as place:
        outputs = place.run(60)
        wrong = []
        for _ in range(25):
            name, value, sense = chance.choice(
                [
                    ('feedforward.coulomb_scale', chance.uniform(0.0, 1.5), True),
                    ('feedforward.smoothing_velocity', chance.uniform(1e-4, 0.5), True),
                    ('feedforward.force_limit', chance.uniform(0.0, 60.0), True),
                    ('feedforward.lead_time', chance.uniform(0.0, 0.1), True),
                    ('slip_velocity', chance.uniform(2e-3, 0.2), True),
                    ('use_stiction', chance.random() < 0.5, True),
                    ('feedforward.coulomb_scale', float('nan'), False),
                    ('stick_velocity', 5.0, False),
                    ('seals', ['nothing'], False),
                    ('pressure_timeout', 'long', False),
                ]
            )
            (result,) = place.estimator.set_parameters([Parameter(name, value=value)])
            wrong += unless(result.successful == sense, f'{name} = {value}: {result}')
            outputs += place.run(chance.randrange(1, 8))
        wrong += complaints_at_any_time(outputs) + unless(statuses(outputs) == {0}, f'{statuses(outputs)}')
        place.estimator.finish()
    return wrong + verified(folder / 'bag')


LEGAL = {
    ('unconfigured', Transition.TRANSITION_CONFIGURE): 'inactive',
    ('inactive', Transition.TRANSITION_CLEANUP): 'unconfigured',
    ('inactive', Transition.TRANSITION_ACTIVATE): 'active',
    ('active', Transition.TRANSITION_DEACTIVATE): 'inactive',
}


def lifecycle_in_any_order(chance: random.Random, folder: Path) -> list[str]:
    """Transitions by service, legal or not, repeated, while inputs come."""
    del folder
    with stage() as place:
        client = place.driver.create_client(ChangeState, 'friction_estimator/change_state')
        place.spin_until(client.service_is_ready)
        state, wrong = 'active', []

        def change(number: int) -> bool:
            """Ask for a transition while inputs come; whether it succeeded."""
            for _ in range(chance.randrange(4)):
                place.now += MS
                place.driver.publish(good(place.now))
            future = client.call_async(ChangeState.Request(transition=Transition(id=number)))
            return place.spin_until(future.done) and future.result().success

        for _ in range(20):
            number = chance.choice([number for _, number in LEGAL])
            succeeded = change(number)
            place.spin(0.01)
            wrong += complaints_at_any_time(place.driver.outputs)
            if succeeded:
                place.driver.outputs.clear()  # what is active again begins anew
            wrong += unless(succeeded == ((state, number) in LEGAL), f'transition {number} while {state}: {succeeded}')
            state = LEGAL.get((state, number), state)
        for at, number in (
            ('unconfigured', Transition.TRANSITION_CONFIGURE),
            ('inactive', Transition.TRANSITION_ACTIVATE),
        ):
            if state == at:
                wrong += unless(change(number), f'transition {number} at the end')
                state = LEGAL[at, number]
        place.connect()
        return wrong + recovered(place)


def simulated_time_is_reset(chance: random.Random, folder: Path) -> list[str]:
    """``/clock`` goes back to 0 and on from there."""
    del chance
    recording = {'record': True, 'record_directory': str(folder), 'record_name': 'bag', 'use_sim_time': True}
    with stage(recording) as place:
        clock = place.driver.create_publisher(Clock, '/clock', 10)

        def tick(ticks: int) -> Outputs:
            """Move the clock and send, so many times."""
            outputs: Outputs = []
            for _ in range(ticks):
                now = Clock()
                now.clock.sec, now.clock.nanosec = divmod(place.now + MS, 10**9)
                clock.publish(now)
                outputs += place.run(1)
            return outputs

        tick(60)
        place.now = 0
        after = tick(60)
        marked = [o.status for o in after if isinstance(o, records.FrictionEstimate)]
        wrong = unless(marked == [Status.STAMP_NOT_INCREASING] + [0] * 59, f'{marked[:5]}')
        wrong += recovered(place)
        place.estimator.finish()
    return wrong + verified(folder / 'bag')


def fifty_more_topics(chance: random.Random, folder: Path) -> list[str]:
    """Fifty publishers of others, all of them busy."""
    del chance, folder
    with stage() as place, intruder(place, 'crowd') as other:
        publishers = [other.create_publisher(Float64, f'other_{number}', 10) for number in range(50)]
        place.spin(0.3)

        def busy(tick: dict[str, Any], number: int) -> dict[str, Any]:
            for publisher in publishers[number % 5 :: 5]:
                publisher.publish(Float64())
            return tick

        outputs = place.run(200, busy)
        answered = sum(isinstance(output, records.FrictionEstimate) for output in outputs)
        wrong = unless(answered == 200, f'{answered} of 200') + unless(statuses(outputs) == {0}, f'{statuses(outputs)}')
        return wrong + recovered(place)


# --- disk ---


def slow_disk(chance: random.Random, folder: Path) -> list[str]:
    """One write of the recorder blocks for a second; what is recorded meanwhile waits for it."""
    recording = {'record': True, 'record_directory': str(folder), 'record_name': 'bag'}
    mcap_writer.os = disk = StallingDisk(1.0, chance.uniform(0.0, 0.5))
    try:
        with stage(recording) as place:
            outputs, slowest = [], 0.0
            while not disk.stalls or slowest == 0.0:
                started = time.monotonic()
                outputs += place.run(10)
                slowest = max(slowest, time.monotonic() - started) if disk.stalls else 0.0
            outputs += place.run(100)
            wrong = unless(statuses(outputs) <= {0}, f'{statuses(outputs)}')
            wrong += unless(slowest < 0.7, f'ten estimates took {slowest:.2f} s')  # they would wait for 1 s
            wrong += complaints_at_any_time(place.driver.outputs)
            place.estimator.finish()
    finally:
        mcap_writer.os = os
    return wrong + verified(folder / 'bag')


def directory_removed(chance: random.Random, folder: Path) -> list[str]:
    """The folder of the bag is removed while it is written."""
    recording = {'record': True, 'record_directory': str(folder), 'record_name': 'bag'}
    with stage(recording) as place:
        place.run(chance.randrange(20, 60))
        place.spin(0.05)
        shutil.rmtree(folder / 'bag')
        said = place.estimator.diagnostics
        for _ in range(1000):
            if said()['recorder'].level == b'\x02':
                break
            place.run(10)
        words = said()['recorder'].message
        return unless('recording stopped' in words, f'recorder: {words}') + recovered(place)


def verified(bag: Path) -> list[str]:
    """What a replay of a bag finds wrong."""
    verdict = replay(bag)
    return unless(verdict.identical, f'{bag.name}: {verdict.first_difference or "no estimate in it"}')


# --- the process ---


class Outside(Spun):
    """The estimator in a process of its own, and a driver here."""

    def __init__(self, process: subprocess.Popen[bytes], log: Path, domain: int) -> None:
        context = Context()
        rclpy.init(context=context, domain_id=domain)
        self.process, self.log, self.driver = process, log, Driver(context=context)
        super().__init__(context, self.driver)
        self.recorder: list[str] = []
        self.values: dict[str, str] = {}
        self.driver.create_subscription(DiagnosticArray, '/diagnostics', self._on_diagnostics, 10)
        self.now = time.time_ns()
        self.sent = 0

    def _on_diagnostics(self, array: DiagnosticArray) -> None:
        for status in array.status:
            if status.name.endswith(': recorder'):
                self.recorder.append(status.message)
            else:
                self.values = {value.key: value.value for value in status.values}

    def connect(self) -> None:
        """Spin until the estimator hears the driver.

        Raises:
            RuntimeError: It does not.
        """
        if not self.spin_until(lambda: self.values, PATIENCE):
            raise RuntimeError(f'no estimator: {self.log.read_text()}')
        self.connect_to(self.driver.inputs.values())

    def send(self, seconds: float, rate: float = 1000.0) -> None:
        """Send inputs at a rate [Hz], whether they are answered or not."""
        start = time.monotonic()
        for number in range(round(seconds * rate)):
            self.spin(start + number / rate - time.monotonic())
            self.now += round(1e9 / rate)
            self.driver.publish(good(self.now))
            self.sent += 1

    def complaints(self) -> list[str]:
        """Whether it answers well, if need be after some seconds, in which the middleware repairs; what it said."""
        latest: set[int] = set()
        for _ in range(40):
            if latest == {0}:
                break
            before = len(self.driver.outputs)
            self.send(0.5)
            self.spin(0.1)
            seen = [o for o in self.driver.outputs[before:] if isinstance(o, records.FrictionEstimate)]
            latest = statuses(seen[-20:])
        wrong = unless(latest == {0}, f'at the end: {latest}')
        return wrong + complaints_at_any_time(self.driver.outputs) + self.raised()

    def raised(self) -> list[str]:
        """Exceptions that nobody handled."""
        return unless('Traceback' not in self.log.read_text(), self.log.read_text()[-300:])


@contextmanager
def outside(folder: Path, directory: str = '', prefix: tuple[str, ...] = ()) -> Iterator[Outside]:
    """Run the estimator, recording to ``bag`` in a folder, behind a command that prepares its file system."""
    domain, log = free_domain(), folder / 'log'
    set_up_discovery()
    recording = {'record': True, 'record_directory': directory or str(folder), 'record_name': 'bag'}
    with running('friction_estimator', domain, {**recording, **SETTINGS}, log, prefix=prefix) as process:
        made = Outside(process, log, domain)
        try:
            made.connect()
            yield made
        finally:
            made.driver.destroy_node()
            rclpy.try_shutdown(context=made.context)


def ends_by(number: signal.Signals, chance: random.Random, folder: Path) -> list[str]:
    """Told to end while inputs come."""
    with outside(folder) as place:
        place.send(chance.uniform(0.2, 1.2))
        place.process.send_signal(number)
        place.send(0.1)
        code = place.process.wait(PATIENCE)
        wrong = unless(code == 0, f'exit code {code}') + place.raised() + complaints_at_any_time(place.driver.outputs)
    return wrong + verified(folder / 'bag')


def interrupted(chance: random.Random, folder: Path) -> list[str]:
    """SIGINT."""
    return ends_by(signal.SIGINT, chance, folder)


def terminated(chance: random.Random, folder: Path) -> list[str]:
    """SIGTERM."""
    return ends_by(signal.SIGTERM, chance, folder)


def killed(chance: random.Random, folder: Path) -> list[str]:
    """SIGKILL."""
    with outside(folder) as place:
        place.send(chance.uniform(1.2, 2.5))
        place.process.kill()
        at = time.time_ns()
        place.process.wait()
        wrong = complaints_at_any_time(place.driver.outputs)
    found = recover(folder / 'bag')
    lost = (at - found.last_ns) * 1e-9
    return wrong + unless(lost < 1.0, f'{lost:.2f} s lost') + verified(Path(found.out))


def stopped_and_continued(chance: random.Random, folder: Path) -> list[str]:
    """SIGSTOP, SIGCONT, while inputs come."""
    with outside(folder) as place:
        place.send(0.3)
        place.process.send_signal(signal.SIGSTOP)
        place.send(chance.uniform(0.3, 1.0))
        place.process.send_signal(signal.SIGCONT)
        wrong = place.complaints() + accounted(place)
        place.process.terminate()
        place.process.wait(PATIENCE)
    return wrong + verified(folder / 'bag')


def accounted(place: Outside, *, exactly: bool = True) -> list[str]:
    """Whether every velocity sample is answered or reported as missing; at a changing rate, whether it is reported."""
    before = place.values
    place.spin_until(lambda: place.values is not before)
    before = place.values
    place.spin_until(lambda: place.values is not before)
    received, missing = (int(place.values[f'rod_velocity {what}']) for what in ('received', 'missing'))
    answered = sum(isinstance(output, records.FrictionEstimate) for output in place.driver.outputs)
    whole = received + missing == place.sent if exactly else missing or received == place.sent
    wrong = unless(whole, f'{received} received, {missing} missing of {place.sent}')
    return wrong + unless(answered == received, f'{answered} answers to {received}')


def burst(chance: random.Random, folder: Path) -> list[str]:
    """10 kHz on all topics for a moment, on a node made for 1 kHz."""
    with outside(folder) as place:
        place.send(0.2)
        place.send(chance.uniform(0.05, 0.3), 10_000.0)
        place.now += MS
        wrong = place.complaints()
        wrong += accounted(place, exactly=False)
        place.process.terminate()
        place.process.wait(PATIENCE)
    return wrong + verified(folder / 'bag')


def on_a_disk(folder: Path, options: str, words: str) -> list[str]:
    """Record to a disk mounted for it; the recorder has to say ``words``."""
    if subprocess.run([*OWN_MOUNTS, 'true'], check=False, capture_output=True).returncode:
        return ['needs a user namespace to mount a small disk in']
    small = folder / 'disk'
    small.mkdir()
    mount = f'mount -t tmpfs -o {options} none "$0" && exec "$@"'
    with outside(folder, str(small), (*OWN_MOUNTS, 'sh', '-c', mount, str(small))) as place:
        for _ in range(200):
            if any(words in said for said in place.recorder):
                break
            place.send(0.1)
        else:
            return [f'recorder: {place.recorder[-1:]}']
        wrong = unless('could not be finished' not in place.recorder[-1], place.recorder[-1])
        wrong += place.complaints()
        bag = Path(f'/proc/{place.process.pid}/root{small}/bag')
        if bag.exists():
            shutil.copytree(bag, folder / 'copy')
    if (folder / 'copy').exists():
        wrong += unless(sum(1 for _ in read_messages(folder / 'copy')), 'nothing in the bag')
        wrong += verified(folder / 'copy')
    return wrong


def disk_full(chance: random.Random, folder: Path) -> list[str]:
    """A disk with little room."""
    return on_a_disk(folder, f'size={chance.randrange(150, 400)}k', 'No space left on device')


def read_only(chance: random.Random, folder: Path) -> list[str]:
    """A disk that takes nothing."""
    del chance
    return on_a_disk(folder, 'ro', 'Read-only file system')


TRIALS = (
    Trial(
        'an input has no publisher at first',
        'UNKNOWN, then as usual',
        '0, then as usual',
        '`PRESSURE_MISSING`, then as usual',
        '-',
        topic_comes_late,
    ),
    Trial('an input has a second publisher', 'as usual', 'as usual', 'both named; WARN', '-', second_publisher),
    Trial(
        'an input has a second publisher, refused',
        'UNKNOWN',
        'fades to 0',
        'both named; `INPUT_REFUSED`, ERROR; as usual once it is gone',
        '-',
        second_publisher_refused,
    ),
    Trial(
        'incompatible quality of service or type',
        'as usual: best effort is taken',
        'as usual',
        'said by name of the node',
        '-',
        incompatible_quality,
    ),
    Trial('a second estimator of the same name', 'as usual', 'as usual', 'both named; WARN', '-', second_estimator),
    Trial('parameters change in motion', 'as usual', 'no leap', 'nonsense is refused', 'verifies', parameters_change),
    Trial(
        'lifecycle transitions in any order',
        'as usual when active again',
        'no leap while active',
        'legal ones succeed, others are refused',
        '-',
        lifecycle_in_any_order,
    ),
    Trial(
        'simulated time is reset',
        'as usual, the first one marked',
        'as usual',
        '`STAMP_NOT_INCREASING` once',
        'verifies',
        simulated_time_is_reset,
    ),
    Trial('50 more topics on the graph', 'every sample answered', 'as usual', 'as usual', '-', fifty_more_topics),
    Trial(
        '10 kHz on a node made for 1 kHz',
        'one for every sample that is taken',
        'no leap',
        'samples missed are counted',
        'verifies',
        burst,
    ),
    Trial('SIGINT', 'ends', 'ends', 'exit code 0', 'finished, verifies', interrupted),
    Trial('SIGTERM', 'ends', 'ends', 'exit code 0', 'finished, verifies', terminated),
    Trial('SIGKILL', 'ends', 'ends', 'nothing: it is gone', 'recovered up to 1 s before, verifies', killed),
    Trial(
        'SIGSTOP and SIGCONT',
        'goes on',
        'goes on without a leap',
        'every sample answered or counted as missing',
        'verifies',
        stopped_and_continued,
    ),
    Trial('disk full', 'as usual', 'as usual', 'recorder: the error of the disk', 'valid; verifies', disk_full),
    Trial('disk read-only', 'as usual', 'as usual', 'recorder: the error of the disk', 'none', read_only),
    Trial(
        'folder of the bag removed',
        'as usual',
        'as usual',
        'recorder: ERROR, recording stopped',
        'gone',
        directory_removed,
    ),
    Trial('a disk that stalls', 'as usual, none waits', 'as usual', 'as usual', 'whole, verifies', slow_disk),
)


def attempt(trial: Trial, seed: int) -> list[str]:
    """One try; an exception is a complaint, too."""
    with tempfile.TemporaryDirectory() as folder:
        try:
            return trial.attempt(random.Random(seed), Path(folder))  # noqa: S311  no secret depends on it
        except Exception:  # noqa: BLE001  whatever it is, it is what happened
            return [traceback.format_exc(limit=-3)]


def main() -> int:
    """Try every fault, print the table."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n', maxsplit=1)[0])
    parser.add_argument('--times', type=int, default=20, help='how often each fault is tried')
    parser.add_argument('--only', default='', help='only faults with these words in their name')
    parser.add_argument('--seed', type=int, default=1)
    parser.add_argument('--json', action='store_true')
    arguments = parser.parse_args()
    results, said = {}, Console(stderr=True)
    with stage() as place:
        for row in track([r for r in SIGNAL_ROWS if arguments.only in r.fault], 'signals', console=said):
            happened = [try_row(place, row) for _ in range(arguments.times)]
            diagnosed = f'{row.status or "no bit"}; {row.level}'
            results[row.fault] = ((row.estimate, row.feedforward, diagnosed, '-'), happened)
    for trial in track([t for t in TRIALS if arguments.only in t.fault], 'graph, process, disk', console=said):
        happened = [attempt(trial, arguments.seed + number) for number in range(arguments.times)]
        results[trial.fault] = (trial.required, happened)
    if arguments.json:
        print(json.dumps({fault: happened for fault, (_, happened) in results.items()}))
    else:
        Console(width=200).print(_table(results))
    return int(any(wrong for _, happened in results.values() for wrong in happened))


def _table(results: dict[str, tuple[tuple[str, ...], list[list[str]]]]) -> Table:
    table = Table('fault', *REQUIRED, 'tried', 'happened', title='Fault campaign')
    for fault, (required, happened) in results.items():
        bad = [words for wrong in happened for words in wrong[:1]]
        said = 'as required' if not bad else f'{len(bad)} not: {bad[0]}'
        table.add_row(fault, *required, str(len(happened)), said)
    return table


if __name__ == '__main__':
    sys.exit(main())
