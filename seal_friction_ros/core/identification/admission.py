"""Admission of recorded samples: each is used, or dropped with a reason that is counted.

Stamps that jump (a looped playback, a clock that was set, one stamp of the future) are set by the time of receipt, and
samples go by their stamps. A few samples without a value in a row are bridged by a straight line.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from seal_friction_ros.core.foundation.arrays import BoolArray, FloatArray, IntArray
from seal_friction_ros.core.foundation.stamps import repaired_stamps

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
    texts: tuple[str, ...]  # what was done about stamps that were out of order


def in_order(stamps: IntArray, received: IntArray) -> Order:
    """Order and time of samples by their stamps [ns], as they came, and by the times of receipt [ns]; shape (n,) each.

    Stamps that jump are set by the time of receipt (`repaired_stamps`); those of one clock are sorted.
    """
    repaired, repair = repaired_stamps(stamps, received)
    rows = np.argsort(repaired, kind='stable')
    is_new = np.diff(repaired[rows], prepend=repaired[rows][:1] - 1) > 0
    back = int((np.diff(repaired) < 0).sum())
    texts = repair.said('the stamp of the velocity')
    texts += [f'{back} messages came out of order, and were sorted by their stamps'] * (back > 0)
    index = rows[is_new]
    seconds = np.asarray((repaired[index] - repaired[index][:1]) * 1e-9, dtype=np.float64)
    return Order(index, seconds, len(stamps) - len(index), tuple(texts))


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
