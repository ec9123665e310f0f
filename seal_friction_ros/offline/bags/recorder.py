"""Records what the estimator consumed and published without ever making it wait.

Messages go into a bounded queue; a thread of the recorder's own takes them out and writes the bag. What was taken out
is handed to the operating system within `FLUSH_PERIOD`, so that it outlives the process. When the disk cannot keep up,
messages are dropped and counted; when it fails, recording stops, says why and leaves a valid bag of what was written.
The estimate goes on either way.
"""

import threading
import time
from collections import deque
from pathlib import Path

from seal_friction_ros.offline.bags.bag import BagWriter

QUEUE_LENGTH = 100_000  # [messages] fourteen seconds of seven topics at 1 kHz
FLUSH_PERIOD = 0.3  # [s]
_PERIOD = (
    0.05  # [s] between two looks at the queue if nobody says when: waking for each message would slow the estimator
)
_HASTE = 0.002  # [s] the same while a backlog is written, if the estimator does not answer
_ENOUGH = 20  # messages to be woken up for
_AT_A_TIME = 50  # messages written before the estimator has the processor again, so a backlog does not delay it


class Recorder:
    """Recording of one bag, from construction to `close`.

    Args:
        path: Folder of the bag; must not exist.
        queue_length: Messages that may wait for the disk.
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
        self._queue: deque[tuple[str, str, int, bytes]] = deque()  # plain tuples: the garbage collector lets go of them
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
        """Have the queue written now if it is long enough: the estimator says so when it has just answered.

        Python runs one thread at a time, so what is written while a sample comes in makes it wait.
        """
        if len(self._queue) >= _ENOUGH:
            self._wake.set()

    @property
    def written(self) -> int:
        """Messages written so far."""
        return self._writer.message_count

    @property
    def dropped(self) -> int:
        """Messages that are not and will not be in the bag: the queue was full, or the recording failed."""
        return self._offered - self.written if self.error else self._refused

    @property
    def waiting(self) -> int:
        """Messages in the queue."""
        return len(self._queue)

    @property
    def is_finished(self) -> bool:
        """Whether nothing more will be written: after `stop`, in time, or after an error."""
        return not self._thread.is_alive()

    def stop(self) -> None:
        """Have what is queued written and the bag finished, without waiting for that."""
        self._stop.set()
        self._wake.set()

    def close(self) -> None:
        """Write what is queued and finish the bag; how many messages were dropped is kept in its metadata."""
        self.stop()
        self._thread.join()

    def _run(self) -> None:
        try:
            self._write_until_stopped()
            self._writer.close({'dropped_messages': str(self.dropped)})
        except Exception as error:  # noqa: BLE001  whatever it is, the thread must not end without a word
            self._rescue(error)

    def _write_until_stopped(self) -> None:
        flushed = time.monotonic()
        while self._queue or not self._stop.is_set():
            for _ in range(min(len(self._queue), _AT_A_TIME)):
                self._writer.write(*self._queue.popleft())
            if time.monotonic() - flushed >= FLUSH_PERIOD:
                self._writer.flush()
                flushed = time.monotonic()
            if self._wake.wait(_HASTE if self._queue else _PERIOD):
                self._wake.clear()

    def _rescue(self, failure: Exception) -> None:
        """Leave a valid bag of what was written, and say what happened."""
        words = f'{self.path}: recording stopped: {failure}'
        try:
            self._writer.rescue(str(failure), self._offered)
        except Exception as error:  # noqa: BLE001  as above
            words += f'; and the bag could not be finished ({error}): seal_friction recover makes one of it'
        self.error = words
        self._queue.clear()
