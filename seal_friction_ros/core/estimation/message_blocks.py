"""Many serialised messages at once, as they lie in memory: for bulk readers and for the compiled pipeline."""

from enum import IntEnum
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

Bytes = npt.NDArray[np.uint8]
Integers = npt.NDArray[np.int64]

MOST_MESSAGES = 1 << 16  # in one call: enough to be fast, and memory is bounded


class Kind(IntEnum):
    """What a message is to the estimator."""

    OTHER = 0
    FORCE = 1
    PRESSURE = 2
    REFERENCE = 3
    TEMPERATURE = 4
    TICK = 5
    VELOCITY = 6
    ESTIMATE = 7
    FEEDFORWARD = 8
    CONFIGURATION = 9
    OTHER_ESTIMATE = 10
    """of another estimator"""
    POSITION = 11


class UnsuitedError(Exception):
    """Messages that compiled code cannot process: malformed, or with numbers beyond what it holds."""


class Messages(NamedTuple):
    """Serialised messages in order of receipt, n of them."""

    data: Bytes  # all their bytes, and others between them
    kinds: Bytes  # `Kind` of each, shape (n,)
    offsets: Integers  # where each begins in ``data``, shape (n,)
    sizes: Integers  # [bytes] shape (n,)
    received: Integers  # [ns] log time of each, shape (n,)
    sent: Integers  # [ns] publish time of each, shape (n,)

    def taken(self, first: int, end: int) -> 'Messages':
        """The messages from number ``first`` to before number ``end``."""
        part = slice(first, end)
        return self.in_order(part)

    def in_order(self, order: slice | Integers) -> 'Messages':
        """Some of the messages, or all in another order."""
        data, kinds, *columns = self
        return Messages(data, kinds[order], *(column[order] for column in columns))

    def message(self, number: int) -> bytes:
        """Bytes of one message."""
        offset = self.offsets[number]
        return self.data[offset : offset + self.sizes[number]].tobytes()
