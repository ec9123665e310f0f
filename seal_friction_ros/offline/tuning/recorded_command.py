"""Command of a controller in a bag, and the gain from force to command (`core.tuning.output_gain`)."""

import numpy as np

from seal_friction_ros.core.foundation.errors import named_errors
from seal_friction_ros.core.messages.fields import Reader
from seal_friction_ros.core.messages.layouts import NUMBER_TYPE, NUMBERS_TYPE
from seal_friction_ros.core.tuning.output_gain import CommandRecord, OutputGain, output_gain
from seal_friction_ros.core.tuning.settings import RecordedAxisSettings
from seal_friction_ros.offline.bags.actuator_bag import ActuatorBag
from seal_friction_ros.offline.bags.bag import BagError, read_definitions
from seal_friction_ros.offline.bags.columns import Wanted, read_velocity_rows

_FIELDS = {NUMBER_TYPE: 'data', NUMBERS_TYPE: 'data[0]'}


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

    def number_of(data: bytes) -> float:
        """The command of a message; ValueError if it is malformed or empty."""
        (number,) = reader.read(data).numbers
        if number is None:
            raise ValueError('the array is empty')
        return number

    rows = read_velocity_rows(source, also={'command': (Wanted(topic, kind), number_of)})
    are_told = np.isfinite(rows.columns[[1, 2, -1]]).all(axis=0)
    velocity, a, b, _, position, *_, command = rows.columns[:, are_told]
    time = np.asarray(rows.stamps[are_told] * 1e-9, np.float64)
    with named_errors(f'{bag}: {topic}', raised=BagError):
        return output_gain(CommandRecord(time, command, known.area_a * a - known.area_b * b, position, velocity))
