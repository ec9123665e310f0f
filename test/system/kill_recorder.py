"""Recordings killed, recovered and replayed: ``python test/system/kill_recorder.py --times 200 [--json]``.

Each time a process estimates at 1 kHz and records all seven topics until SIGKILL at a random moment. It notes each
message in shared memory before it passes it to the recorder, so the messages lost are known exactly.
"""

import argparse
import mmap
import random
import signal
import struct
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from itertools import count
from math import sin
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))
from harness.campaign import parser_of, tell

from seal_friction_ros.core.estimation.configuration import first_snapshot, snapshot_text
from seal_friction_ros.core.estimation.pipeline import answered, init
from seal_friction_ros.core.messages.coder import encode, encode_text
from seal_friction_ros.core.messages.layouts import CONFIGURATION_TYPE, INPUTS
from seal_friction_ros.core.messages.records import Force, Input, Position, Pressure, ServoReference, Velocity
from seal_friction_ros.files import default_configuration
from seal_friction_ros.offline.bags import bag as b
from seal_friction_ros.offline.bags.actuator_bag import ANSWER_TOPICS
from seal_friction_ros.offline.bags.recorder import Recorder
from seal_friction_ros.offline.bags.recover import recover
from seal_friction_ros.offline.replay.replay import replay

PERIOD = 1_000_000  # [ns]
LARGEST_LOSS = 7000  # [messages] 1 s of seven topics at 1 kHz
_OFFERED = struct.Struct('<q')  # log time [ns] of one message
_MOST_OFFERED = 1_000_000  # messages of one run


def inputs(stamp: int, number: int) -> Iterator[tuple[str, str, Input, bytes]]:
    """Topic, type, record and bytes of the five inputs of one moment."""
    velocity = 0.05 * sin(number / 200)
    records: dict[str, Input] = {
        'cylinder_pressure': Pressure(stamp, 2e6 + 1e6 * sin(number / 700), 5e5),
        'force_sum': Force(stamp, 60.0 * sin(number / 200 + 0.3)),
        'servo_reference': ServoReference(stamp, 0.001 * number, velocity, 0.0, b'rod'),
        'rod_position': Position(stamp, 0.001 * number),
        'rod_velocity': Velocity(stamp, velocity, b'rod'),
    }
    for topic, record in records.items():
        yield f'/{topic}', INPUTS[topic], record, encode(record, b'rod')


def record_until_killed(bag: Path, offered_file: Path, split_size: int) -> None:
    """Estimate and record at 1 kHz; note each message in ``offered_file`` before the recorder receives it."""
    with offered_file.open('r+b') as file:
        offered = mmap.mmap(file.fileno(), 0)
    configuration = default_configuration()
    parameters = configuration.parameters()
    state = init(parameters)
    recorder = Recorder(bag, split_size=split_size)
    places = count()

    def record(topic: str, type_name: str, data: bytes) -> int:
        log_time = time.time_ns()
        _OFFERED.pack_into(offered, next(places) * _OFFERED.size, log_time)
        recorder.record(topic, type_name, log_time, data)
        return log_time

    text = snapshot_text(first_snapshot(configuration))
    record(b.CONFIGURATION_TOPIC, CONFIGURATION_TYPE, encode_text(text))
    print('recording', flush=True)
    start = time.perf_counter_ns()
    for number in count():
        time.sleep(max(start + number * PERIOD - time.perf_counter_ns(), 0) * 1e-9)
        for topic, type_name, message, data in inputs(time.time_ns(), number):
            received = record(topic, type_name, data)
            state, answers = answered(parameters, state, message, received)
            for answer_type, answer_data in answers:
                record(ANSWER_TOPICS[answer_type], answer_type, answer_data)


@dataclass(frozen=True)
class Outcome:
    """Outcome of one recording."""

    offered: int
    """messages passed to the recorder"""
    recovered: int
    in_order: bool
    """whether the recovered messages are the first ones offered, none missing in between"""
    oldest_lost: float
    """[s] from the offer of the oldest lost message to the kill"""
    verified: bool
    """whether the replay of the recovered bag is identical"""
    files: int
    lost_bytes: int
    """of an incomplete chunk"""
    failure: str
    """why nothing could be recovered; empty if recovered"""

    @property
    def good(self) -> bool:
        """Whether the requirements are met."""
        return self.in_order and self.offered - self.recovered <= LARGEST_LOSS and self.verified


def killed(folder: Path, seconds: float, split_size: int) -> Outcome:
    """Record for ``seconds`` [s], kill, recover, replay."""
    bag, offered_file = folder / 'bag', folder / 'offered'
    with offered_file.open('wb') as file:
        file.truncate(_MOST_OFFERED * _OFFERED.size)
    command = [sys.executable, __file__, '--record', str(bag), str(offered_file), str(split_size)]
    with subprocess.Popen(command, stdout=subprocess.PIPE) as process:
        if process.stdout is None or process.stdout.readline() != b'recording\n':
            raise RuntimeError(f'the recording did not start: {" ".join(command)}')
        time.sleep(seconds)
        kill_time = time.time_ns()
        process.send_signal(signal.SIGKILL)
    offered = [time for (time,) in _OFFERED.iter_unpack(offered_file.read_bytes()) if time and time <= kill_time]
    try:
        found = recover(bag)
    except ValueError as error:
        return Outcome(len(offered), 0, False, seconds, False, 0, 0, str(error))
    times = [message.log_time for message in b.read_messages(Path(found.out))]
    lost = offered[len(times) :]
    # The bag makes equal times strictly increasing, so a recovered time may be some ns after the offered one.
    in_order = all(0 <= ours - theirs < 1000 for ours, theirs in zip(times, offered, strict=False))
    age = (kill_time - lost[0]) * 1e-9 if lost else 0.0
    verdict = replay(Path(found.out))
    return Outcome(
        len(offered),
        found.messages,
        in_order and len(times) == found.messages,
        age,
        verdict.identical and verdict.recorded_feedforwards > 0,
        len(list(bag.glob('*.mcap'))),
        found.lost_bytes,
        '',
    )


def campaign(times: int, longest: float, parallel: int, split_size: int, seed: int) -> list[Outcome]:
    """Kill recordings after random times up to ``longest`` [s]."""
    chance = random.Random(seed)  # noqa: S311  no secret depends on it
    moments = [chance.uniform(0.3, longest) for _ in range(times)]

    def run(seconds: float) -> Outcome:
        with tempfile.TemporaryDirectory() as folder:
            return killed(Path(folder), seconds, split_size)

    with ThreadPoolExecutor(parallel) as pool:
        return list(pool.map(run, moments))


def main() -> int:
    """Kill, recover, verify; print a table, or JSON."""
    parser = parser_of(
        __doc__,
        times=(20, 'recordings'),
        longest=(3.0, 'longest recording [s]'),
        parallel=(1, 'recordings at a time'),
        split_size=(500_000, 'of the files of the bag [bytes]'),
        seed=(1, 'of the moments'),
    )
    parser.add_argument('--record', nargs=3, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.record:
        bag, offered, split_size = arguments.record
        record_until_killed(Path(bag), Path(offered), int(split_size))
    outcomes = campaign(arguments.times, arguments.longest, arguments.parallel, arguments.split_size, arguments.seed)
    figures = {
        'killed': len(outcomes),
        'recovered': sum(outcome.recovered > 0 for outcome in outcomes),
        'first messages, none missing in between': sum(outcome.in_order for outcome in outcomes),
        'verified byte for byte': sum(outcome.verified for outcome in outcomes),
        'oldest lost message, before the kill [s]': max(outcome.oldest_lost for outcome in outcomes),
        'messages offered': sum(outcome.offered for outcome in outcomes),
        'messages recovered': sum(outcome.recovered for outcome in outcomes),
        'with an incomplete chunk': sum(outcome.lost_bytes > 0 for outcome in outcomes),
        'most files of a bag': max(outcome.files for outcome in outcomes),
    }
    good = all(outcome.good for outcome in outcomes)
    bad = [asdict(outcome) for outcome in outcomes if not outcome.good]
    tell({**figures, 'good': good, 'bad': bad}, as_json=arguments.json)
    return 0 if good else 1


if __name__ == '__main__':
    sys.exit(main())
