"""Admission of recorded samples: each is used, or left out with a reason that is counted.

Stamps that jump (a looped playback, a clock that was set, one stamp of the future) are set by the time of receipt, and
samples go by their stamps. A few samples without a value in a row are bridged by a straight line.
"""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from seal_friction_ros.core.foundation.arrays import BoolArray, FloatArray, IntArray
from seal_friction_ros.core.foundation.stamps import repaired_stamps

BRIDGED = 3  # samples without a value in a row, at most, that a straight line bridges (our choice)
WORTH_A_WARNING = 0.01  # [-] of the samples, dropped as faulty (our choice)
MOST_DROPPED = 0.5  # [-] of the samples; more are refused (our choice)
SAME_STAMP, OLD_STAMP, MALFORMED = 'same stamp', 'stamp not after the one before', 'malformed'
NOT_FINITE, BAD_INPUT = 'not finite', 'input old, out of range or jumping'
FAULTS = (SAME_STAMP, OLD_STAMP, MALFORMED, NOT_FINITE, BAD_INPUT)
"""Reasons that are faults of the recording."""
BEYOND_LOAD = 'where no load is known'
NO_VELOCITY, NOT_STARTED = 'no velocity from it', 'before the first pressure and force sum'
NO_REFERENCE = 'before the first reference'
AT_REST, ACCELERATED = 'at rest', 'accelerated'


class Account(NamedTuple):
    """Samples of a source, each of which is used or left out."""

    name: str  # of the source; empty if the error of `check` names it anyway
    used: int
    left_out: Mapping[str, int]  # reason -> number of samples, none of them 0

    @property
    def total(self) -> int:
        """Number of samples."""
        return self.used + sum(self.left_out.values())

    @property
    def numbers(self) -> dict[str, Any]:
        """Counts for JSON."""
        return {'samples_total': self.total, 'samples_used': self.used, 'samples_left_out': dict(self.left_out)}

    @property
    def text(self) -> str:
        """Counts in words."""
        share = 100.0 / max(self.total, 1)
        why = ', '.join(f'{reason} {share * count:.0f} %' for reason, count in self.left_out.items())
        return f'{self.used} of {self.total} samples used ({share * self.used:.0f} %)' + (why and f'; not used: {why}')

    @property
    def warnings(self) -> Iterator[str]:
        """Faults of more than `WORTH_A_WARNING` of the samples, one line each."""
        for reason, count in self._faults.items():
            if count > WORTH_A_WARNING * self.total:
                yield f'{count} of {self.total} samples ({100.0 * count / self.total:.0f} %) are dropped: {reason}'

    @property
    def _faults(self) -> dict[str, int]:
        return {reason: self.left_out[reason] for reason in FAULTS if self.left_out.get(reason)}

    def check(self) -> None:
        """Check that few samples are faulty. ValueError: more than `MOST_DROPPED` are; with the reasons."""
        faulty = sum(self._faults.values())
        if faulty > MOST_DROPPED * self.total:
            why = ', '.join(f'{reason} {count}' for reason, count in self._faults.items())
            raise ValueError(
                f'{self.name and f"{self.name}: "}{faulty} of {self.total} samples cannot be used ({why}), '
                f'{100.0 * MOST_DROPPED:.0f} % at most may be: repair the stamps or the sensor and record again'
            )


def account(name: str, reasons: Mapping[str, BoolArray], earlier: Mapping[str, int] | None = None) -> Account:
    """Account of n samples: the first of the ``reasons``, shape (n,) each, counts; ``earlier`` counts are added."""
    counts = Counter(earlier or {})
    left = np.ones(len(next(iter(reasons.values()))), dtype=bool)
    for reason, holds in reasons.items():
        counts[reason] += int(np.count_nonzero(left & holds))
        left &= ~holds
    return Account(name, int(np.count_nonzero(left)), {reason: count for reason, count in counts.items() if count})


def together(accounts: Iterable[Account]) -> Account:
    """Account of all samples of several sources."""
    used, left_out, names = 0, Counter[str](), []
    for one in accounts:
        used += one.used
        left_out.update(one.left_out)
        names.append(one.name)
    return Account(', '.join(names), used, dict(left_out))


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
