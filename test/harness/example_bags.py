"""Small bags for tests, made by the code under test's own writer."""

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from seal_friction_ros.core.estimation.configuration import Configuration, first_snapshot, parse_snapshot, snapshot_text
from seal_friction_ros.core.messages.coder import decode_text, encode, encode_text, type_of
from seal_friction_ros.core.messages.layouts import CONFIGURATION_TYPE, INPUTS
from seal_friction_ros.core.messages.records import Force, Position, Pressure, ServoReference, Velocity
from seal_friction_ros.offline.bags import bag as b
from seal_friction_ros.offline.monitor.recorded_view import RecordedView
from seal_friction_ros.offline.replay.replay import replay

STEP = 10_000_000  # [ns]
TOPICS = {type_name: f'/{topic}' for topic, type_name in INPUTS.items()}


def write_inputs(
    path: Path, samples: int = 300, configuration: Configuration | None = None, frames: Sequence[bytes] = (b'rod',)
) -> Path:
    """A rod that goes to and fro at changing pressure, with rests, and a few inputs that are missing or not finite.

    The frame names take turns.
    """
    with b.BagWriter(path) as writer:
        if configuration is not None:
            data = encode_text(snapshot_text(first_snapshot(configuration)))
            writer.write(b.CONFIGURATION_TOPIC, CONFIGURATION_TYPE, 0, data)
        for i in range(samples):
            stamp = 1_000_000_000 + i * STEP
            velocity = max(abs(math.sin(i / 20)) - 0.3, 0.0) * math.copysign(0.05, math.sin(i / 20))
            inputs: list[Any] = []
            frame = frames[i % len(frames)]
            if i % 50 != 7:
                inputs.append(Pressure(stamp, 2e6 + 1e6 * math.sin(i / 70), math.nan if i % 61 == 5 else 5e5))
            inputs.append(Force(stamp, 60.0 * math.sin(i / 20 + 0.3)))
            if 100 <= i < 200:
                inputs.append(ServoReference(stamp, 0.001 * i, velocity, 0.0, frame))
            inputs += [Position(stamp, 0.001 * i), Velocity(stamp, velocity, frame)]
            for number, record in enumerate(inputs):  # received 1 us apart, so there is time between them for others
                type_name = type_of(record)
                writer.write(TOPICS[type_name], type_name, stamp + 1000 * number, encode(record, frame))
    return path


def write_recorded(
    folder: Path, configuration: Configuration | None = None, frames: Sequence[bytes] = (b'rod',)
) -> Path:
    """The same with the answers to it, as a live node records them: a replay without its mark."""
    replay(write_inputs(folder / 'inputs', configuration=configuration, frames=frames), out=folder / 'replayed')
    return rewrite(folder / 'replayed', folder / 'recorded', lambda _, message: as_recorded(message))


def as_recorded(message: b.BagMessage) -> b.BagMessage:
    """A message of a replay without the mark of the replay."""
    if message.type_name != CONFIGURATION_TYPE:
        return message
    snapshot = parse_snapshot(decode_text(message.data))._replace(recorded=None)
    return message._replace(data=encode_text(snapshot_text(snapshot)))


def rewrite(source: Path, out: Path, change: Callable[[int, b.BagMessage], b.BagMessage | None]) -> Path:
    """Copy a bag, message by message; None leaves one out."""
    with b.BagWriter(out) as writer:
        for number, message in enumerate(b.read_messages(source)):
            changed = change(number, message)
            if changed is not None:
                writer.write(*changed)
    return out


def read_whole(view: RecordedView) -> RecordedView:
    """A view that has read its bag to the end."""
    for _ in view.read():
        pass
    return view
