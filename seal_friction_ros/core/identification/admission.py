"""Admission of recorded samples: each is used, or dropped with a reason that is counted.

Stamps that step back (a looped playback, a clock that was set, one stamp of the future) begin a new segment; the time
of the samples goes on after a pause. A few samples without a value in a row are bridged by a straight line.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from seal_friction_ros.core.foundation.arrays import BoolArray, FloatArray, IntArray

PAUSE = 1.0  # [s] between two segments: longer than the longest gap in a stroke (our choice)
SHUFFLED = 0.01  # [-] of the stamps step back: messages came out of order, and are sorted (our choice)
BRIDGED = 3  # samples without a value in a row, at most, that a straight line bridges (our choice)
WORTH_A_WARNING = 0.01  # [-] of the samples, dropped as faulty (our choice)
MOST_DROPPED = 0.5  # [-] of the samples; more are refused (our choice)
SAME_STAMP, NOT_FINITE, BEYOND_LOAD = 'same stamp', 'not finite', 'averaged, or where no load is known'
FAULTS = (SAME_STAMP, NOT_FINITE)
"""Reasons that are faults of the recording."""


class Order(NamedTuple):
    """Samples in the order of time."""

    rows: IntArray  # indices of the samples that are kept, in order
    seconds: FloatArray  # [s] of each, from 0
    same_stamp: int  # samples that were dropped
    segments: int
    is_sorted: bool  # whether the messages came out of order


def in_order(stamps: IntArray) -> Order:
    """Order and time of samples by their stamps [ns], shape (n,), as they came."""
    back = np.diff(stamps) < 0
    is_sorted = bool(len(back)) and float(back.mean()) > SHUFFLED
    order = np.argsort(stamps, kind='stable') if is_sorted else np.arange(len(stamps))
    steps = np.diff(stamps[order], prepend=stamps[order][:1] - 1)
    index = order[steps != 0]
    steps = np.diff(stamps[index], prepend=stamps[index][:1])
    seconds = np.cumsum(np.where(steps < 0, PAUSE, steps * 1e-9))
    return Order(index, seconds, len(stamps) - len(index), 1 + int((steps < 0).sum()), is_sorted)


def bridged(values: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Values, shape (n,), with up to `BRIDGED` missing ones in a row on a straight line, and which they are."""
    missing = ~np.isfinite(values)
    edges = np.flatnonzero(np.diff(missing.astype(np.int8), prepend=0, append=0))
    short = np.zeros(len(values), dtype=bool)
    for first, end in zip(edges[::2], edges[1::2], strict=True):
        short[first:end] = end - first <= BRIDGED and first > 0 and end < len(values)
    result, places = values.copy(), np.arange(len(values))
    if short.any():
        result[short] = np.interp(places[short], places[~missing], values[~missing])
    return result, short


def check_admitted(name: str, total: int, dropped: Mapping[str, int]) -> None:
    """Check that few samples of the source ``name`` are faulty.

    Raises:
        ValueError: More than `MOST_DROPPED` of ``total`` are; with the reasons.
    """
    faulty = {reason: dropped[reason] for reason in FAULTS if dropped.get(reason)}
    if sum(faulty.values()) > MOST_DROPPED * total:
        why = ', '.join(f'{reason} {count}' for reason, count in faulty.items())
        raise ValueError(
            f'{name}: {sum(faulty.values())} of {total} samples cannot be used ({why}), '
            f'{100.0 * MOST_DROPPED:.0f} % at most may be: repair the stamps or the sensor and record again'
        )
