"""Command of a controller in a bag, and the gain from force to command (`core.tuning.output_gain`)."""

import math
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from seal_friction_ros.core.messages import coder
from seal_friction_ros.core.messages.fields import Reader
from seal_friction_ros.core.messages.layouts import DEFINITIONS, NUMBER_TYPE, NUMBERS_TYPE
from seal_friction_ros.core.messages.records import Position, Pressure, Velocity
from seal_friction_ros.core.tuning.output_gain import CommandRecord, OutputGain, output_gain
from seal_friction_ros.core.tuning.settings import RecordedAxisSettings
from seal_friction_ros.offline.bags.actuator_bag import MappingFile, open_actuator
from seal_friction_ros.offline.bags.bag import BagError

_FIRST = {NUMBER_TYPE: 'data', NUMBERS_TYPE: 'data[0]'}


@cache
def _reader(type_name: str) -> Reader:
    return Reader(DEFINITIONS, type_name, [_FIRST[type_name]])


def first_number(type_name: str, data: bytes) -> float:
    """Value of a `std_msgs/Float64`, or the first value of a `std_msgs/Float64MultiArray`.

    Raises:
        ValueError: The message is malformed or empty.
    """
    (number,) = _reader(type_name).read(data).numbers
    if number is None:
        raise ValueError('the array is empty')
    return number


def read_output_gain(
    bag: Path,
    topic: str,
    known: RecordedAxisSettings,
    namespace: str = '',
    mapping: MappingFile | None = None,
) -> OutputGain:
    """Gain from force to the command on a topic.

    Each velocity sample takes the newest command, pressures and position.

    Args:
        bag: Command, pressures, velocity and, if measured, position.
        topic: Topic of the command, a `std_msgs/Float64` or `Float64MultiArray`.
        known: Areas of both chambers.
        namespace: As of `open_actuator`.
        mapping: Likewise.

    Raises:
        BagError: The bag lacks something, or cannot tell the gain.
    """
    if not (known.area_a and known.area_b):
        raise BagError(f'{topic}: give --area-a and --area-b [m2]: the gain needs the force of the pressures')
    source = open_actuator(bag, namespace, mapping)
    found = source.infos.get(topic)
    if found is None or found.type_name not in _FIRST:
        what = 'is not in it' if found is None else f'is {found.type_name}'
        raise BagError(f'{bag}: the command {topic} {what}: it has to be {NUMBER_TYPE} or {NUMBERS_TYPE}')
    held: dict[str, Any] = {}
    command, rows = math.nan, []
    for message in source.messages():
        if message.topic == topic:
            try:
                command = first_number(message.type_name, message.data)
            except ValueError as error:
                raise BagError(f'{bag}: {topic}: {error}') from None
        elif message.topic in source.topics:
            sample = coder.DECODERS[message.type_name](message.data)
            held[type(sample).__name__] = sample
            pressure: Pressure | None = held.get('Pressure')
            position: Position | None = held.get('Position')
            if isinstance(sample, Velocity) and pressure is not None and math.isfinite(command):
                force = known.area_a * pressure.chamber_a - known.area_b * pressure.chamber_b
                place = position.position if position is not None else math.nan
                rows.append((sample.stamp * 1e-9, command, force, place, sample.velocity))
    try:
        return output_gain(CommandRecord(*np.array(rows).reshape(-1, 5).T))
    except ValueError as error:
        raise BagError(f'{bag}: {topic}: {error}') from None
