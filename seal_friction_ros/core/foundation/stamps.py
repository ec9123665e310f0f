"""Stamps that jump: a looped playback, a clock that was set, one stamp in the future.

The times of receipt tell a jump from a pause: in a pause both go on, in a jump the stamps alone.
"""

import numpy as np

from seal_friction_ros.core.foundation.arrays import IntArray

SMALLEST_JUMP = 1_000_000_000  # [ns] late and early messages of one clock differ by less; our choice


class StampRepair:
    """Continues the stamps of one signal by the times of receipt wherever they jump.

    A stamp jumps if it goes back by more than `SMALLEST_JUMP`, or ahead by more than the time of receipt does. From
    there on all stamps are shifted, so that the time between the two is that between their receipts.
    """

    def __init__(self) -> None:
        self.jumps = 0  # Number of jumps.
        self.repaired = 0  # Number of stamps that were changed.
        self._stamp = self._received = self._shift = 0
        self._is_begun = False

    def next(self, stamp: int, received: int) -> int:
        """Repaired stamp [ns] of the next sample, from its stamp and its time of receipt [ns]."""
        step, passed = stamp - self._stamp, received - self._received
        if self._is_begun and (step < -SMALLEST_JUMP or step - passed > SMALLEST_JUMP):
            self.jumps += 1
            self._shift += max(passed, 0) - step
            if abs(self._shift) < SMALLEST_JUMP // 2:  # back on the clock as it was
                self._shift = 0
        self._stamp, self._received, self._is_begun = stamp, received, True
        self.repaired += self._shift != 0
        return stamp + self._shift

    def said(self, what: str) -> list[str]:
        """What was repaired, in words; empty without a jump."""
        return [f'{what} jumps {self.jumps} times: {self.repaired} stamps set by the log time'] if self.jumps else []


def repaired_stamps(stamps: IntArray, received: IntArray) -> tuple[IntArray, StampRepair]:
    """Repaired stamps [ns], and what was repaired, of stamps and times of receipt [ns], shape (n,) each."""
    repair = StampRepair()
    steps = np.diff(stamps)
    if not ((steps < -SMALLEST_JUMP) | (steps - np.diff(received) > SMALLEST_JUMP)).any():
        return stamps, repair
    pairs = zip(stamps.tolist(), received.tolist(), strict=True)
    return np.array([repair.next(stamp, time) for stamp, time in pairs], dtype=np.int64), repair
