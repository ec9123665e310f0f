"""`velocity_rows` in bulk: messages in place, columns of numbers at once."""

import math
from typing import NamedTuple

import numpy as np

from seal_friction_ros.core.estimation.configuration import parse_snapshot
from seal_friction_ros.core.estimation.message_blocks import Kind, Messages, UnsuitedError
from seal_friction_ros.core.estimation.messages import (
    CONFIGURATION_TYPE,
    LAYOUTS,
    LONGEST_FRAME,
    SECOND,
    Layout,
    decode_text,
)
from seal_friction_ros.core.foundation.arrays import FloatArray, IntArray
from seal_friction_ros.offline.bags.actuator_bag import ActuatorBag
from seal_friction_ros.offline.bags.mcap_reader import ERRORS
from seal_friction_ros.offline.bags.topics import TYPES
from seal_friction_ros.offline.bags.velocity_rows import COLUMNS, INPUTS, VelocityRows

_KINDS = {name: Kind[name.upper()] for name in INPUTS}
_HEAD = 16  # [bytes] encapsulation, stamp, length of the frame name


def rows_in_bulk(source: ActuatorBag) -> VelocityRows | None:
    """Rows of a bag; None if it is malformed, unreadable or unusual, so that only the general reader can handle it."""
    try:
        return _rows(source)
    except (UnsuitedError, OSError, *ERRORS):
        return None


def _rows(source: ActuatorBag) -> VelocityRows:
    topics = source.topics
    kinds = {getattr(topics, name): (kind, getattr(TYPES, name)) for name, kind in _KINDS.items()}
    kinds[topics.configuration] = Kind.CONFIGURATION, CONFIGURATION_TYPE
    kinds.pop('', None)

    def kind_of(topic: str, type_name: str) -> Kind:
        """Kind of the messages on a topic."""
        kind, wanted = kinds.get(topic, (Kind.OTHER, type_name))
        if type_name != wanted:
            raise UnsuitedError(f'{topic} has messages of {wanted} and of {type_name}')
        return kind

    layouts = {layout.message_type: layout for layout in LAYOUTS}
    configuration = None
    newest = {name: np.full((count, 1), math.nan) for name, count in COLUMNS.items()}
    stamps: list[IntArray] = [np.zeros(0, np.int64)]
    columns: list[FloatArray] = [np.zeros((sum(COLUMNS.values()), 0))]
    for block in source.blocks(kind_of):
        for number in np.flatnonzero(block.kinds == Kind.CONFIGURATION).tolist():
            configuration = parse_snapshot(decode_text(block.message(number))).configuration
        found = {name: numbers_of(block, kind, layouts[getattr(TYPES, name)]) for name, kind in _KINDS.items()}
        velocities = found['velocity'].places
        stamps.append(found['velocity'].stamps)
        parts = []
        for name, (places, _, numbers) in found.items():
            known = np.concatenate([newest[name], numbers], axis=1)
            parts.append(known[:, np.searchsorted(places, velocities, side='right')])
            newest[name] = known[:, -1:]
        columns.append(np.concatenate(parts))
    return VelocityRows(np.concatenate(stamps), np.concatenate(columns, axis=1), configuration)


class NumbersOf(NamedTuple):
    """Messages of one kind in a block."""

    places: IntArray  # numbers in the block
    stamps: IntArray  # [ns]
    numbers: FloatArray  # shape (fields, n)


def numbers_of(block: Messages, kind: Kind, layout: Layout) -> NumbersOf:
    """All messages of a kind, whose numbers are float64.

    Raises:
        UnsuitedError: One of them is not of the layout.
    """
    places = np.flatnonzero(block.kinds == kind)
    offsets, sizes = block.offsets[places], block.sizes[places]
    if (sizes < _HEAD).any():
        raise UnsuitedError(f'a message of less than {_HEAD} bytes')
    head = block.data[offsets[:, None] + np.arange(_HEAD)]
    words = head.view('<u4').astype(np.int64)
    seconds, nanoseconds, length = head.view('<i4')[:, 1].astype(np.int64), words[:, 2], words[:, 3]
    begin = 4 + (12 + length + 7) // 8 * 8  # as `messages.head_size`
    spare = sizes - begin - layout.size
    good = (words[:, 0] & 0xFFFF == 0x0100) & (nanoseconds < SECOND) & (length <= LONGEST_FRAME)
    if not (good & (spare >= 0) & (spare <= 3)).all():
        raise UnsuitedError(f'a message that is no {layout.message_type}')
    starts = offsets + begin
    numbers = [block.data[(starts + at)[:, None] + np.arange(8)].view('<f8')[:, 0] for at in layout.offsets]
    return NumbersOf(
        places, seconds * SECOND + nanoseconds, np.array(numbers, np.float64).reshape(len(layout.offsets), len(places))
    )
