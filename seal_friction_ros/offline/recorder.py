"""Records what the estimator consumed and published without ever making it wait.

Messages go into a bounded queue; a thread of the recorder's own takes them out and writes the bag. When the disk cannot
keep up, messages are dropped and counted; when it fails, recording stops and says why. The estimate goes on either way.
"""

import threading
import time
from collections import deque
from pathlib import Path

from seal_friction_ros.offline.bag import BagMessage, BagWriter

QUEUE_LENGTH = 50_000  # [messages] ten seconds of five topics at 1 kHz
_PERIOD = 0.01  # [s] between two looks at the queue: waking the thread for each message would slow the estimator


class Recorder:
    """Recording of one bag, from construction to `close`.

    Args:
        path: Folder of the bag; must not exist.
        queue_length: Messages that may wait for the disk.

    Raises:
        BagError: The bag cannot be made.
    """

    def __init__(self, path: Path, *, queue_length: int = QUEUE_LENGTH) -> None:
        self.path = path
        self.dropped = 0
        self.error = ''
        self._queue_length = queue_length
        self._queue: deque[BagMessage] = deque()
        self._writer = BagWriter(path)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name='recorder', daemon=True)
        self._thread.start()

    def record(self, topic: str, type_name: str, log_time: int, data: bytes) -> None:
        """Queue one serialised message, or drop and count it; never blocks."""
        if self.error or len(self._queue) >= self._queue_length:
            self.dropped += 1
        else:
            self._queue.append(BagMessage(topic, type_name, log_time, data))

    @property
    def written(self) -> int:
        """Messages written so far."""
        return self._writer.message_count

    @property
    def waiting(self) -> int:
        """Messages in the queue."""
        return len(self._queue)

    def close(self) -> None:
        """Write what is queued and finish the bag; how many messages were dropped is kept in its metadata."""
        self._stop.set()
        self._thread.join()

    def _run(self) -> None:
        try:
            while not self._stop.is_set():
                self._drain()
                time.sleep(_PERIOD)
            self._drain()
            self._writer.close({'dropped_messages': str(self.dropped)})
        except Exception as error:  # noqa: BLE001  whatever it is, the thread must not end without a word
            self.dropped += len(self._queue)
            self._queue.clear()
            self.error = f'{self.path}: recording stopped: {error}'
            self._writer.abandon()

    def _drain(self) -> None:
        while self._queue:
            message = self._queue.popleft()
            self._writer.write(*message)
