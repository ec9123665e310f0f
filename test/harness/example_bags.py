"""Small bags for tests, made by the code under test's own writer."""

import math
from collections.abc import Callable
from pathlib import Path

from seal_friction_ros.core.estimation.configuration import Configuration, SealSelection, first_snapshot, snapshot_text
from seal_friction_ros.core.estimation.estimator import EstimatorSettings
from seal_friction_ros.core.estimation.messages import (
    CONFIGURATION_TYPE,
    FORCE_TYPE,
    POSITION_TYPE,
    PRESSURE_TYPE,
    REFERENCE_TYPE,
    VELOCITY_TYPE,
    encode,
    encode_text,
)
from seal_friction_ros.core.estimation.records import Force, Position, Pressure, ServoReference, Velocity
from seal_friction_ros.files import load_configuration
from seal_friction_ros.offline.bags import bag as b
from seal_friction_ros.offline.replay.replay import replay

STEP = 10_000_000  # [ns]


def write_inputs(path: Path, samples: int = 300, configuration: Configuration | None = None) -> Path:
    """A rod that goes to and fro at changing pressure, with rests, and a few inputs that are missing or not finite."""
    with b.BagWriter(path) as writer:
        if configuration is not None:
            data = encode_text(snapshot_text(first_snapshot(configuration)))
            writer.write(b.CONFIGURATION_TOPIC, CONFIGURATION_TYPE, 0, data)
        for i in range(samples):
            stamp = 1_000_000_000 + i * STEP
            velocity = max(abs(math.sin(i / 20)) - 0.3, 0.0) * math.copysign(0.05, math.sin(i / 20))
            if i % 50 != 7:
                pressure = Pressure(stamp, 2e6 + 1e6 * math.sin(i / 70), math.nan if i % 61 == 5 else 5e5)
                writer.write(b.PRESSURE_TOPIC, PRESSURE_TYPE, stamp, encode(pressure, b'rod'))
            force = Force(stamp, 60.0 * math.sin(i / 20 + 0.3))
            writer.write(b.FORCE_TOPIC, FORCE_TYPE, stamp, encode(force, b'rod'))
            if 100 <= i < 200:
                reference = ServoReference(stamp, 0.001 * i, velocity, 0.0, b'rod')
                writer.write(b.REFERENCE_TOPIC, REFERENCE_TYPE, stamp, encode(reference))
            position = encode(Position(stamp, 0.001 * i), b'rod')
            writer.write(b.POSITION_TOPIC, POSITION_TYPE, stamp, position)
            data = encode(Velocity(stamp, velocity, b'rod'))
            writer.write(b.VELOCITY_TOPIC, VELOCITY_TYPE, stamp, data)
    return path


def write_recorded(folder: Path, configuration: Configuration | None = None) -> Path:
    """The same with the answers to it, as a replay gives them."""
    replay(write_inputs(folder / 'inputs', configuration=configuration), out=folder / 'recorded')
    return folder / 'recorded'


def rewrite(source: Path, out: Path, change: Callable[[int, b.BagMessage], b.BagMessage | None]) -> Path:
    """Copy a bag, message by message; None leaves one out."""
    with b.BagWriter(out) as writer:
        for number, message in enumerate(b.read_messages(source)):
            changed = change(number, message)
            if changed is not None:
                writer.write(*changed)
    return out


def default_configuration(**settings: float) -> Configuration:
    return load_configuration(SealSelection(), EstimatorSettings(**settings))
