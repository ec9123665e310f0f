"""Import of the pull test of the thesis: its tables as signals in a bag."""

import csv
from pathlib import Path
from typing import NamedTuple

import numpy as np

from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.foundation.units import LBF, PSI
from seal_friction_ros.files import share_directory
from seal_friction_ros.offline.bags.import_log import ImportSummary, Samples, write_samples

RATE = 100  # [Hz]
RUNNING_VELOCITY = 0.01  # [m/s] slow pull by hand (our choice); the thesis gives no speed
START = 1.0  # [s] stamp of the first sample
DWELL_SAMPLES = 30
RAMP_SAMPLES = 40
RUNNING_SAMPLES = 60
REST_SAMPLES = 20
CYCLE_SAMPLES = DWELL_SAMPLES + RAMP_SAMPLES + RUNNING_SAMPLES + REST_SAMPLES
DIRECTIONS = {'extend': 1, 'retract': -1}


class Pull(NamedTuple):
    """One pull of the test: both readings at one pressure in one direction, sums over both seals."""

    test: int
    pressure: float  # [Pa, gauge]
    direction: int  # 1 extend, -1 retract
    static_friction: float  # [N] magnitude at breakaway
    dynamic_friction: float  # [N] magnitude while the rod slides


def read_pulls() -> list[Pull]:
    """The 66 pulls (132 readings) of Tables A-1 to A-3, in the order of the tables."""
    path = share_directory('seal_friction_ros', __file__) / 'data' / 'thesis' / 'friction_tests.csv'
    readings: dict[tuple[int, int, str], dict[str, float]] = {}
    with path.open(encoding='utf-8', newline='') as file:
        for row in csv.DictReader(file):
            key = int(row['test']), int(row['pressure_psig']), row['direction']
            readings.setdefault(key, {})[row['kind']] = float(row['friction_lbf']) * LBF
    return [
        Pull(test, psi * PSI, DIRECTIONS[direction], of_kind['static'], of_kind['dynamic'])
        for (test, psi, direction), of_kind in readings.items()
    ]


def import_thesis(out: Path) -> ImportSummary:
    """Write the pull test of the thesis as a bag: 3 tests, 11 pressures, retract and extend, 132 readings.

    Each pull is 1.5 s at 100 Hz: at rest without force (0.3 s), at rest under a force that rises linearly to the static
    reading (0.4 s, the last sample is the reading), sliding at 10 mm/s under the dynamic reading (0.6 s), at rest
    without force (0.2 s). Both chambers have the pressure of the test. While the rod slides evenly, the force sum is
    the friction: a spring scale pulls, and nothing accelerates.

    The bag has 9900 rows, 99 s. BagError if ``out`` exists already or cannot be made.

    Source: thesis, section 5.2 and Tables A-1 to A-3 (readings only). Speed and duration of each part are our choice:
    the test itself rests 30 s before each reading, 35 minutes in total.
    """
    pulls = read_pulls()
    count = len(pulls) * CYCLE_SAMPLES
    pressure = np.repeat([pull.pressure for pull in pulls], CYCLE_SAMPLES)
    force = np.concatenate([_force(pull) for pull in pulls])
    velocity = np.concatenate([_velocity(pull) for pull in pulls])
    stamp = np.arange(count, dtype=np.int64) * (1_000_000_000 // RATE) + int(START * 1e9)
    return write_samples(out, Samples(stamp, pressure, pressure, force, velocity), 'rod')


def _force(pull: Pull) -> FloatArray:
    """Force on the rod over one pull [N], positive on extension, shape (CYCLE_SAMPLES,)."""
    ramp = np.linspace(0.0, pull.static_friction, RAMP_SAMPLES)
    running = np.full(RUNNING_SAMPLES, pull.dynamic_friction)
    return pull.direction * np.concatenate((np.zeros(DWELL_SAMPLES), ramp, running, np.zeros(REST_SAMPLES)))


def _velocity(pull: Pull) -> FloatArray:
    """Velocity of the rod over one pull [m/s], positive on extension, shape (CYCLE_SAMPLES,)."""
    parts = (DWELL_SAMPLES + RAMP_SAMPLES, RUNNING_SAMPLES, REST_SAMPLES)
    return np.repeat((0.0, pull.direction * RUNNING_VELOCITY, 0.0), parts)
