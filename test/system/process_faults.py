"""Faults of process and file system, tried on an estimator in a process of its own; see ``faults.py``.

Each function is one try: it takes random numbers and an empty folder and returns the differences from the requirements.
"""

import random
import shutil
import signal
import subprocess
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from diagnostic_msgs.msg import DiagnosticArray
from fault_rows import MS, good
from fault_stage import SETTINGS, Driver, broken_invariants, unless, verified
from harness.processes import free_domain, node_process
from harness.spin_nodes import TIMEOUT, SpunNodes, ros_context
from rclpy.context import Context

from seal_friction_ros.core.messages import records
from seal_friction_ros.core.messages.coder import decode
from seal_friction_ros.core.messages.layouts import ESTIMATE_TYPE, INPUTS
from seal_friction_ros.offline.bags.bag import BagError, read_messages
from seal_friction_ros.offline.bags.recover import recover

LIVE_SLEW_LIMIT = 100.0  # [N/s] two thirds of the force cannot come back within one step
LIVE_SETTINGS = {**SETTINGS, 'feedforward.slew_limit': LIVE_SLEW_LIMIT, 'stamp_age_max': 0.0}  # stamps follow no clock
OWN_MOUNTS = ('unshare', '--map-root-user', '--mount')
LARGEST_LOSS = 1000  # [samples] of 1 kHz that a killed recording may lose: 1 s
UNDER_WAY = 20  # samples without answer: well below the depth of the queues
AT_THE_END = 20  # estimates in a row that must be good at the end


class EstimatorProcess(SpunNodes):
    """The estimator in a process of its own, and a driver in this one."""

    def __init__(self, process: subprocess.Popen[bytes], log: Path, context: Context) -> None:
        self.process, self.log, self.driver = process, log, Driver(context=context)
        super().__init__(context, self.driver)
        self.recorder_messages: list[str] = []
        self.values: dict[str, str] = {}
        self.driver.create_subscription(DiagnosticArray, '/diagnostics', self._on_diagnostics, 10)
        self.now = time.time_ns()
        self.sent = self.sent_before = 0

    def _on_diagnostics(self, array: DiagnosticArray) -> None:
        for status in array.status:
            if status.name.endswith(': recorder'):
                self.recorder_messages.append(status.message)
            else:
                self.values = {value.key: value.value for value in status.values}

    def connect(self) -> None:
        """Spin until the estimator receives all topics of the driver and the driver receives the answers.

        Raises:
            RuntimeError: They do not.
        """

        def is_connected() -> bool:
            subscribed = all(publisher.get_subscription_count() for publisher in self.driver.inputs.values())
            return subscribed and all(int(self.values.get(f'{name} publishers', '0')) for name in INPUTS)

        if not self.spin_until(is_connected) or not self.spin_until(lambda: self.status_of_one() is not None):
            raise RuntimeError(f'no estimator: {self.log.read_text()}')
        self.driver.outputs.clear()
        self.sent, self.sent_before = 0, self.sent

    def publish(self, period: int = MS) -> None:
        """Publish the next moment, ``period`` [ns] after the one before."""
        self.now += period
        self.driver.publish(good(self.now))
        self.sent += 1

    def status_of_one(self) -> int | None:
        """Send one sample; the status of its estimate, None if there is none within 1 s."""
        self.publish()

        def answer() -> list[int]:
            newest = [o for o in self.driver.outputs[-3:] if isinstance(o, records.FrictionEstimate)]
            return [estimate.status for estimate in newest if estimate.stamp == self.now]

        return answer()[0] if self.spin_until(answer, 1.0) else None

    def run(self, samples: int, rate: float = 1000.0) -> None:
        """Send samples at ``rate`` [Hz], or more slowly if the estimator does not keep up.

        Raises:
            RuntimeError: The estimator stops answering.
        """
        answered = self.driver.estimates
        for number in range(samples):
            self.publish()
            self.spin(1.0 / rate)
            wanted = answered + number + 1 - UNDER_WAY
            if not self.spin_until(lambda wanted=wanted: self.driver.estimates >= wanted):
                raise RuntimeError(f'{self.driver.estimates - answered} answers to {number + 1} samples')

    def flood(self, samples: int, rate: float = 1000.0) -> None:
        """Send samples at ``rate`` [Hz], answered or not."""
        start = time.monotonic()
        for number in range(samples):
            self.spin(start + number / rate - time.monotonic())
            self.publish(round(1e9 / rate))

    def unrecovered(self) -> list[str]:
        """Send good samples until the last estimates are all good; differences from normal operation.

        Lost messages may take the middleware some seconds to repair.
        """
        latest: deque[int | None] = deque(maxlen=AT_THE_END)
        end = time.monotonic() + TIMEOUT
        while list(latest) != [0] * AT_THE_END and time.monotonic() < end:
            latest.append(self.status_of_one())
        wrong = unless(list(latest) == [0] * AT_THE_END, f'at the end: {set(latest)}')
        return wrong + broken_invariants(self.driver.outputs, LIVE_SLEW_LIMIT) + self.tracebacks()

    def unaccounted(self, *, exactly: bool = True) -> list[str]:
        """Velocity samples neither answered nor reported as missing.

        Args:
            exactly: Whether the reported number must be exact, as it is at a constant rate.
        """

        def counts() -> tuple[int, int]:
            received = int(self.values['rod_velocity received']) - self.sent_before
            return received, int(self.values['rod_velocity missing'])

        def is_complete() -> bool:
            received, missing = counts()
            return received + missing == self.sent if exactly else bool(missing) or received == self.sent

        complete = self.spin_until(is_complete)
        received, missing = counts()
        answered = sum(isinstance(output, records.FrictionEstimate) for output in self.driver.outputs)
        wrong = unless(complete, f'{received} received, {missing} missing of {self.sent}')
        return wrong + unless(not exactly or answered == received, f'{answered} answers to {received}')

    def tracebacks(self) -> list[str]:
        """The end of the log if an exception was not handled."""
        log = self.log.read_text()
        return unless('Traceback' not in log, log[-300:])


@contextmanager
def estimator_process(
    folder: Path, directory: str = '', prefix: tuple[str, ...] = (), free_space: int = 0
) -> Iterator[EstimatorProcess]:
    """Run the estimator, recording to ``bag`` in a folder, by a command that prepares its file system."""
    domain, log = free_domain(), folder / 'log'
    recording = {'record': True, 'record_directory': directory or str(folder), 'record_name': 'bag'}
    recording['record_free_space'] = free_space
    with (
        node_process(
            'friction_estimator',
            domain,
            {**LIVE_SETTINGS, **recording},
            log,
            prefix=prefix,
        ) as process,
        ros_context(domain) as context,
    ):
        place = EstimatorProcess(process, log, context)
        try:
            place.connect()
            yield place
        finally:
            place.driver.destroy_node()


def ends_by(number: signal.Signals, chance: random.Random, folder: Path) -> list[str]:
    """A signal requests the end while inputs come."""
    with estimator_process(folder) as place:
        place.run(chance.randrange(100, 600))
        place.process.send_signal(number)
        place.flood(100)
        code = place.process.wait(TIMEOUT)
        wrong = (
            unless(code == 0, f'exit code {code}')
            + place.tracebacks()
            + broken_invariants(place.driver.outputs, LIVE_SLEW_LIMIT)
        )
    return wrong + verified(folder / 'bag')


def interrupted(chance: random.Random, folder: Path) -> list[str]:
    """SIGINT."""
    return ends_by(signal.SIGINT, chance, folder)


def terminated(chance: random.Random, folder: Path) -> list[str]:
    """SIGTERM."""
    return ends_by(signal.SIGTERM, chance, folder)


def killed(chance: random.Random, folder: Path) -> list[str]:
    """SIGKILL."""
    with estimator_process(folder) as place:
        place.run(chance.randrange(1200, 2000))
        place.process.kill()
        place.process.wait()
        wrong = broken_invariants(place.driver.outputs, LIVE_SLEW_LIMIT)
        answered = [o.stamp for o in place.driver.outputs if isinstance(o, records.FrictionEstimate)]
    found = recover(folder / 'bag')
    recovered = [
        decode(ESTIMATE_TYPE, message.data).stamp
        for message in read_messages(Path(found.out))
        if message.type_name == ESTIMATE_TYPE
    ]
    lost = (answered[-1] - recovered[-1]) // MS
    return wrong + unless(lost <= LARGEST_LOSS, f'{lost} samples lost') + verified(Path(found.out))


def stopped_and_continued(chance: random.Random, folder: Path) -> list[str]:
    """SIGSTOP, SIGCONT, while inputs come."""
    with estimator_process(folder) as place:
        place.run(100)
        place.process.send_signal(signal.SIGSTOP)
        place.flood(chance.randrange(300, 1000))
        place.process.send_signal(signal.SIGCONT)
        wrong = place.unrecovered() + place.unaccounted()
    return wrong + verified(folder / 'bag')


def burst(chance: random.Random, folder: Path) -> list[str]:
    """10 kHz on all topics for a moment, on a node made for 1 kHz."""
    with estimator_process(folder) as place:
        place.run(100)
        place.flood(chance.randrange(500, 3000), 10_000.0)
        wrong = place.unrecovered() + place.unaccounted(exactly=False)
    return wrong + verified(folder / 'bag')


@contextmanager
def on_small_disk(folder: Path, options: str, free_space: int = 0) -> Iterator[tuple[EstimatorProcess, Path]]:
    """Run the estimator, recording to a disk mounted for this try; the folder leads there.

    Raises:
        RuntimeError: There is no user namespace to mount it in.
    """
    if subprocess.run([*OWN_MOUNTS, 'true'], check=False, capture_output=True).returncode:
        raise RuntimeError('needs a user namespace to mount a small disk in')
    small = folder / 'disk'
    small.mkdir()
    mount = f'mount -t tmpfs -o {options} none "$0" && exec "$@"'
    with estimator_process(folder, str(small), (*OWN_MOUNTS, 'sh', '-c', mount, str(small)), free_space) as place:
        yield place, Path(f'/proc/{place.process.pid}/root{small}')


def on_a_disk(folder: Path, options: str, error: str) -> list[str]:
    """Record to a disk with those mount options; the recorder must report ``error``."""
    with on_small_disk(folder, options) as (place, small):

        def reported() -> bool:
            """Whether the error is reported; sends samples until it is."""
            place.run(50, 1e5)
            return any(error in message for message in place.recorder_messages)

        if not place.spin_until(reported):
            return [f'recorder: {place.recorder_messages[-1:]}']
        last = place.recorder_messages[-1]
        wrong = unless('could not be finished' not in last, last) + place.unrecovered()
        if (small / 'bag').exists():
            shutil.copytree(small / 'bag', folder / 'copy')
    if (folder / 'copy').exists():
        wrong += unless(sum(1 for _ in read_messages(folder / 'copy')), 'nothing in the bag')
        wrong += verified(folder / 'copy')
    return wrong


def disk_full(chance: random.Random, folder: Path) -> list[str]:
    """A disk with little room."""
    return on_a_disk(folder, f'size={chance.randrange(150, 400)}k', 'No space left on device')


def bags_with_estimates(disk: Path, copies: Path) -> list[Path]:
    """Recovered copies of the bags on a disk that hold an estimate, also of one that is being written."""
    shutil.rmtree(copies, ignore_errors=True)
    shutil.copytree(disk, copies)
    found = []
    for bag in sorted(path for path in copies.iterdir() if path.is_dir()):
        with suppress(BagError):  # no message in it yet
            found.append(Path(recover(bag).out))
    return [bag for bag in found if any(message.type_name == ESTIMATE_TYPE for message in read_messages(bag))]


def disk_nearly_full(chance: random.Random, folder: Path) -> list[str]:
    """A disk that something else fills, and that has room again later."""
    with on_small_disk(folder, 'size=8m', free_space=2_000_000) as (place, small):

        def recorded() -> list[Path]:
            return bags_with_estimates(small, folder / 'copies')

        def happens(condition: Callable[[], bool]) -> bool:
            """Send samples until the condition holds; whether it does in time."""

            def holds() -> bool:
                place.run(50, 1e5)
                return condition()

            return place.spin_until(holds)

        place.run(chance.randrange(100, 300))
        wrong = unless(happens(lambda: len(recorded()) == 1), 'nothing recorded')
        (small / 'other').write_bytes(bytes(chance.randrange(6_300_000, 7_000_000)))
        stops = happens(lambda: 'record_free_space' in place.recorder_messages[-1])
        wrong += unless(stops, f'recording goes on: {place.recorder_messages[-1]}')
        (small / 'other').unlink()
        continues = happens(lambda: place.recorder_messages[-1] == 'recording')
        wrong += unless(continues, f'recording does not go on: {place.recorder_messages[-1]}')
        place.run(chance.randrange(100, 300))
        wrong += place.unrecovered()
        wrong += unless(happens(lambda: len(recorded()) == 2), 'not two bags with estimates')
        bags = recorded()
    for bag in bags:
        wrong += verified(bag)
    return wrong


def read_only(chance: random.Random, folder: Path) -> list[str]:
    """A disk that takes nothing."""
    del chance
    return on_a_disk(folder, 'ro', 'Read-only file system')
