"""Command of a controller in a bag, and the gain from force to command (`core.tuning.output_gain`)."""

from functools import partial

import numpy as np

from seal_friction_ros.core.foundation.errors import named_errors
from seal_friction_ros.core.messages.blocks import Numbers
from seal_friction_ros.core.messages.fields import Reader
from seal_friction_ros.core.messages.layouts import NUMBER_TYPE, NUMBERS_TYPE
from seal_friction_ros.core.tuning.output_gain import CommandRecord, OutputGain, output_gain
from seal_friction_ros.core.tuning.settings import RecordedAxisSettings
from seal_friction_ros.offline.bags.actuator_bag import ActuatorBag
from seal_friction_ros.offline.bags.bag import BagError, read_definitions
from seal_friction_ros.offline.bags.columns import Block, Held, Wanted, collected, extend, growing, wanted_of

_FIELDS = {NUMBER_TYPE: 'data', NUMBERS_TYPE: 'data[0]'}
_HELD = {'command': 1, 'pressure': 2, 'position': 1}


class _CommandCollector:
    """Each velocity sample with the newest command, pressures and position before it."""

    def __init__(self, reader: Reader) -> None:
        self._reader = reader
        self._held = Held(_HELD)
        self.columns = growing(2 + sum(_HELD.values()))

    def add(self, block: Block) -> None:
        """Take a row for each velocity: its stamp [s], itself, and what holds then."""
        commands = [(place, number) for place, _, number in block.decoded('command', self._number)]
        places, numbers = np.array(commands).reshape(-1, 2).T
        found = {name: block.of(name) for name in ('pressure', 'position')}
        found['command'] = Numbers(places.astype(np.int64), places.astype(np.int64), numbers[np.newaxis])
        velocities = block.of('velocity')
        held = self._held.at(velocities.places, found)
        extend(self.columns, np.array([velocities.stamps * 1e-9, velocities.numbers[0], *held]))

    def _number(self, data: bytes) -> float:
        """The command of a message; ValueError if it is malformed or empty."""
        (number,) = self._reader.read(data).numbers
        if number is None:
            raise ValueError('the array is empty')
        return number


def read_output_gain(source: ActuatorBag, topic: str, known: RecordedAxisSettings) -> OutputGain:
    """Gain from force to the command on a topic, a `std_msgs/Float64` or `Float64MultiArray`.

    The bag has the command, pressures, velocity and, if measured, position; the areas of both chambers are ``known``.
    BagError: the bag lacks something, or cannot tell the gain.
    """
    if not (known.area_a and known.area_b):
        raise BagError(f'{topic}: give --area-a and --area-b [m2]: the gain needs the force of the pressures')
    bag = source.path
    kind = source.infos[topic].type_name if topic in source.infos else ''
    if kind not in _FIELDS:
        what = f'is {kind}' if kind else 'is not in it'
        raise BagError(f'{bag}: the command {topic} {what}: it has to be {NUMBER_TYPE} or {NUMBERS_TYPE}')
    (definition,) = read_definitions(bag, [kind]).values()
    reader = Reader(definition, kind, [_FIELDS[kind]])
    wanted = {**wanted_of(source, ('velocity', 'pressure', 'position')), 'command': Wanted(topic, kind)}
    columns = np.array(collected(source, wanted, partial(_CommandCollector, reader)).columns)
    time, velocity, command, a, b, position = columns[:, np.isfinite(columns[2:5]).all(axis=0)]
    with named_errors(f'{bag}: {topic}', raised=BagError):
        return output_gain(CommandRecord(time, command, known.area_a * a - known.area_b * b, position, velocity))
