"""The velocity samples of a bag as rows of numbers, each with what came newest of the other inputs before it."""

import math
from array import array
from collections.abc import Callable
from itertools import chain
from typing import NamedTuple

import numpy as np

from seal_friction_ros.core.estimation.configuration import Configuration, parse_snapshot
from seal_friction_ros.core.estimation.messages import LAYOUTS, decode, decode_text
from seal_friction_ros.core.foundation.arrays import FloatArray, IntArray
from seal_friction_ros.core.foundation.compiled import has_compiler
from seal_friction_ros.offline.bags.actuator_bag import ActuatorBag
from seal_friction_ros.offline.bags.topics import TYPES
from seal_friction_ros.offline.work.progress import progress

BULK_FROM = 300_000
"""Bags of at least so many messages are read in bulk: loading the compiler takes as long as reading them one by one."""

INPUTS = ('velocity', 'pressure', 'force', 'position', 'temperature')
"""Fields of `Topics`, in the order of the columns."""
COLUMNS = {name: len(layout.codes) for name in INPUTS for layout in LAYOUTS if layout[0] == getattr(TYPES, name)}
"""How many columns each has."""


class VelocityRows(NamedTuple):
    """n velocity samples in the order of the bag."""

    stamps: IntArray  # [ns] shape (n,)
    columns: FloatArray
    """shape (7, n), in the units of the messages: velocity, both pressures, force sum, position, temperature and its
    variance; NaN before the first message"""
    configuration: Configuration | None  # the last one


def read_velocity_rows(source: ActuatorBag, *, bulk_from: int = BULK_FROM) -> VelocityRows:
    """Read a bag; one of at least ``bulk_from`` messages in bulk, with the same result.

    Raises:
        BagError: The bag cannot be read.
        ValueError: A message is not of its type; names its topic and time.
    """
    if source.total >= bulk_from and has_compiler():
        from seal_friction_ros.offline.bags.bulk_velocity_rows import (  # noqa: PLC0415  loads the compiler
            rows_in_bulk,
        )

        rows = rows_in_bulk(source)
        if rows is not None:
            return rows
    with progress(f'read {source.path.name}', source.total) as advance:
        return _one_by_one(source, advance)


def _one_by_one(source: ActuatorBag, advance: Callable[[int], None]) -> VelocityRows:
    topics = source.topics
    rows, stamps = array('d'), array('q')  # numbers side by side: an hour at 1 kHz is 202 MB
    newest = {getattr(topics, name) or f'no {name}': (math.nan,) * count for name, count in COLUMNS.items()}
    configuration = None
    for count, message in enumerate(source.messages(), start=1):
        try:
            if message.topic in newest:
                stamp, *numbers = decode(message.type_name, message.data)
                newest[message.topic] = tuple(numbers[: len(newest[message.topic])])  # a frame name may follow
                if message.topic == topics.velocity:
                    stamps.append(stamp)
                    rows.extend(chain.from_iterable(newest.values()))
            elif message.topic == topics.configuration:
                configuration = parse_snapshot(decode_text(message.data)).configuration
        except ValueError as error:
            raise ValueError(f'{source.path}: message on {message.topic} at {message.log_time} ns: {error}') from None
        if count % 1000 == 0:
            advance(1000)
    columns = np.frombuffer(rows, dtype=np.float64).reshape(-1, sum(COLUMNS.values())).T.copy()
    return VelocityRows(np.frombuffer(stamps, dtype=np.int64), columns, configuration)
