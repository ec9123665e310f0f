"""Make the small bags under ``bags/`` anew: ``python tools/make_bags.py``.

They are reference runs: the tests replay each and require the recorded estimates byte for byte. Make them anew only
when an estimate is meant to change, and note the change in CHANGELOG.rst.
"""

import hashlib
import math
import shutil
import sys
import tempfile
from collections.abc import Iterable
from pathlib import Path

import yaml

sys.path.insert(0, str(Path(__file__).parents[1] / 'test'))
from harness.processes import free_domain, play_live

from seal_friction_ros.core.messages.coder import encode
from seal_friction_ros.core.messages.layouts import (
    FORCE_TYPE,
    POSITION_TYPE,
    PRESSURE_TYPE,
    REFERENCE_TYPE,
    VELOCITY_TYPE,
)
from seal_friction_ros.core.messages.records import Force, Position, Pressure, ServoReference, Velocity
from seal_friction_ros.offline.bags.bag import (
    FORCE_TOPIC,
    POSITION_TOPIC,
    PRESSURE_TOPIC,
    REFERENCE_TOPIC,
    VELOCITY_TOPIC,
    BagMessage,
    BagWriter,
    read_messages,
)
from seal_friction_ros.offline.bags.import_thesis import import_thesis

TIGHT = {'pressure_rate_max': 1e8, 'force_rate_max': 1e4, 'acceleration_max': 10.0}  # so that leaps show at 100 Hz
BAGS = Path(__file__).parents[1] / 'bags'
SECOND = 1_000_000_000  # [ns]
STEP = 10_000_000  # [ns]


def pull_test(folder: Path) -> Iterable[BagMessage]:
    """The first test of the thesis at 0, 100 and 200 psi, both directions: the first 9 s of the whole."""
    import_thesis(folder / 'whole')
    start = None
    for message in read_messages(folder / 'whole'):
        start = message.log_time if start is None else start
        if message.log_time < start + 9 * SECOND:
            yield message


def faults(folder: Path) -> Iterable[BagMessage]:
    """A rod that goes to and fro while every fault with a bit, of estimate or feed-forward, comes and goes."""
    del folder
    for i in range(600):
        stamp = SECOND + i * STEP
        pressure = 3e6 + 2e6 * math.sin(i / 40)
        pressures = {100: math.nan, 110: math.inf, 120: 1e12, 130: -9e5, 140: 2e7, 141: 2e7}
        forces = {160: math.nan, 170: -math.inf, 180: 1e9, 190: 400.0}
        velocity = max(abs(math.sin(i / 30)) - 0.4, 0.0) * math.copysign(0.05, math.sin(i / 30))
        velocities = {200: math.nan, 210: -math.inf, 220: 99.0, 225: 0.5}
        if i >= 5 and not 300 <= i < 330:
            sample = Pressure(stamp, pressures.get(i, pressure), pressure / 2)
            yield BagMessage(PRESSURE_TOPIC, PRESSURE_TYPE, stamp, encode(sample, b'rod'))
        if i >= 8 and not 400 <= i < 430:
            force = Force(stamp, forces.get(i, 60.0 * math.sin(i / 30 + 0.3)))
            yield BagMessage(FORCE_TOPIC, FORCE_TYPE, stamp, encode(force, b'rod'))
        if i >= 20 and not 450 <= i < 480:
            wanted = {230: math.nan, 240: math.inf}.get(i, velocity)
            reference = ServoReference(stamp, 0.01 * math.sin(i / 30), wanted, 0.0, b'rod')
            yield BagMessage(REFERENCE_TOPIC, REFERENCE_TYPE, stamp, encode(reference))
        position = encode(Position(stamp, 0.01 * math.sin(i / 30 - 0.01)), b'rod')
        yield BagMessage(POSITION_TOPIC, POSITION_TYPE, stamp, position)
        if not 530 <= i < 560:
            late = stamp - 5 * STEP if i == 500 else stamp
            data = encode(Velocity(late, velocities.get(i, velocity), b'rod'))
            yield BagMessage(VELOCITY_TOPIC, VELOCITY_TYPE, stamp, data)


def main() -> int:
    """Play each set of inputs through the live node and keep what it recorded."""
    sources = {
        'pull_test': (
            pull_test,
            'Thesis, Table A-1: readings played as signals (import thesis).',
            {'seals': ['ms28775_114', 'ms28775_114']},
        ),
        'faults': (faults, 'Made up: sine waves with one fault after another.', TIGHT),
    }
    for name, (make, origin, parameters) in sources.items():
        with tempfile.TemporaryDirectory() as folder:
            with BagWriter(Path(folder) / 'inputs') as writer:
                for message in make(Path(folder)):
                    writer.write(*message)
            play_live(Path(folder) / 'inputs', Path(folder) / name, free_domain(), 1.0, parameters)
            shutil.rmtree(BAGS / name, ignore_errors=True)
            shutil.copytree(Path(folder) / name, BAGS / name)
        digest = hashlib.sha256((BAGS / name / f'{name}_0.mcap').read_bytes()).hexdigest()
        provenance = {
            'origin': origin,
            'made_by': 'python tools/make_bags.py: played through the live node, which recorded it',
            'licence': 'Apache-2.0',
            'sha256': {f'{name}_0.mcap': digest},
        }
        (BAGS / name / 'provenance.yaml').write_text(yaml.safe_dump(provenance, sort_keys=False))
        print(f'{BAGS / name}: made')
    return 0


if __name__ == '__main__':
    sys.exit(main())
