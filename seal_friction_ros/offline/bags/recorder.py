"""Recorder of the inputs and outputs of the estimator; it never blocks the estimator.

Messages enter a bounded queue; a separate thread writes them to the bag and passes them to the operating system within
`FLUSH_PERIOD`, so that they outlive the process. If the disk is too slow, messages are dropped and counted. If it
fails, recording stops with an error and leaves a valid bag of the messages written. The estimator continues in both.
"""

import threading
import time
from collections import deque
from pathlib import Path

from seal_friction_ros.offline.bags.bag import BagWriter

QUEUE_LENGTH = 100_000  # [messages] fourteen seconds of seven topics at 1 kHz
FLUSH_PERIOD = 0.3  # [s]
_IDLE_PERIOD = 0.05  # [s] between checks of the queue without `flush_if_idle`; more wake-ups slow the estimator
_BACKLOG_PERIOD = 0.002  # [s] the same while there is a backlog
_WAKE_LENGTH = 20  # [messages] shortest queue for which `flush_if_idle` wakes the thread
_BATCH = 50  # messages written before the thread yields the processor, so that a backlog does not delay the estimator


class Recorder:
    """Recording of one bag, from construction to `close`.

    Args:
        path: Folder of the bag; must not exist.
        queue_length: Largest number of queued messages.
        split_size: As of `BagWriter` [bytes].
        split_duration: As of `BagWriter` [s].

    Raises:
        BagError: The bag cannot be made.
    """

    def __init__(
        self, path: Path, *, queue_length: int = QUEUE_LENGTH, split_size: int = 0, split_duration: float = 0.0
    ) -> None:
        self.path = path
        self.error = ''
        self._offered = self._refused = 0
        self._queue_length = queue_length
        self._queue: deque[tuple[str, str, int, bytes]] = deque()  # plain tuples: the garbage collector untracks them
        self._writer = BagWriter(path, split_size=split_size, split_duration=split_duration)
        self._stop = threading.Event()
        self._wake = threading.Event()
        self._thread = threading.Thread(target=self._run, name='recorder', daemon=True)
        self._thread.start()

    def record(self, topic: str, type_name: str, log_time: int, data: bytes) -> None:
        """Queue one serialised message, or drop and count it; never blocks."""
        self._offered += 1
        if self.error or len(self._queue) >= self._queue_length:
            self._refused += 1
        else:
            self._queue.append((topic, type_name, log_time, data))

    def flush_if_idle(self) -> None:
        """Write the queue now if it is long enough; the estimator calls this right after an answer.

        Python runs one thread at a time, so writing while a sample arrives would delay its estimate.
        """
        if len(self._queue) >= _WAKE_LENGTH:
            self._wake.set()

    @property
    def written(self) -> int:
        """Number of messages written so far."""
        return self._writer.message_count

    @property
    def dropped(self) -> int:
        """Number of messages that are not in the bag because the queue was full or the recording failed."""
        return self._offered - self.written if self.error else self._refused

    @property
    def waiting(self) -> int:
        """Number of messages in the queue."""
        return len(self._queue)

    @property
    def is_finished(self) -> bool:
        """Whether the thread has ended: some time after `stop`, or after an error."""
        return not self._thread.is_alive()

    def stop(self) -> None:
        """Write the queue and finish the bag, without waiting for it."""
        self._stop.set()
        self._wake.set()

    def close(self) -> None:
        """Write the queue and finish the bag; its metadata hold the number of dropped messages."""
        self.stop()
        self._thread.join()

    def _run(self) -> None:
        try:
            self._write_until_stopped()
            self._writer.close({'dropped_messages': str(self.dropped)})
        except Exception as error:  # noqa: BLE001  the thread must not end silently
            self._rescue(error)

    def _write_until_stopped(self) -> None:
        flushed = time.monotonic()
        while self._queue or not self._stop.is_set():
            for _ in range(min(len(self._queue), _BATCH)):
                self._writer.write(*self._queue.popleft())
            if time.monotonic() - flushed >= FLUSH_PERIOD:
                self._writer.flush()
                flushed = time.monotonic()
            if self._wake.wait(_BACKLOG_PERIOD if self._queue else _IDLE_PERIOD):
                self._wake.clear()

    def _rescue(self, failure: Exception) -> None:
        """Leave a valid bag of the messages written, and record the error."""
        text = f'{self.path}: recording stopped: {failure}'
        try:
            self._writer.rescue(str(failure), self._offered)
        except Exception as error:  # noqa: BLE001  as above
            text += f'; and the bag could not be finished ({error}): use seal_friction recover'
        self.error = text
        self._queue.clear()
