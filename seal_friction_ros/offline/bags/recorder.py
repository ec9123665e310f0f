"""Recorder of the inputs and outputs of the estimator; it never blocks the estimator.

Messages enter a bounded queue; a separate thread writes them to the bag and passes them to the operating system within
`FLUSH_PERIOD`, so that they outlive the process. If the disk is too slow, messages are dropped and counted. If it
fails, recording stops with an error and leaves a valid bag of the messages written. The estimator continues in both.

Recording also stops before the disk has less than ``free_space``. Once there is room again, the next bag is due; with
``keep_size`` it is also due when the present one is large enough, so that old bags can be deleted. The estimator begins
a due bag with `Recorder.begin_next` and a snapshot, so that each bag replays alone.
"""

import errno
import re
import shutil
import threading
import time
from collections import deque
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import NamedTuple

from seal_friction_ros.files import read_yaml
from seal_friction_ros.offline.bags.bag import LARGEST_METADATA, START_IN_NAME, BagError, BagWriter, timed_name

QUEUE_LENGTH = 100_000  # [messages] fourteen seconds of seven topics at 1 kHz
FLUSH_PERIOD = 0.3  # [s]
BAGS_KEPT = 10  # as many bags fit into ``keep_size`` (our choice)
RESUME_PERIOD = 5.0  # [s] between two looks for room on the disk
_RESUME_ROOM = 1 << 20  # [bytes] that have to be free in addition, and a tenth of ``free_space`` (our choice)
_END_SIZE = 1 << 18  # [bytes] reserved for the last chunk, the end of the file and metadata.yaml
_LOOK_SIZE, LOOK_PERIOD = 1 << 16, 0.1  # [bytes] of messages, [s]: the more often of both; a look takes 4 us
_INDEX_SHARE = 200  # a file is at least as many times larger than its index
_IDLE_PERIOD = 0.05  # [s] between checks of the queue without `flush_if_idle`; more wake-ups slow the estimator
_BACKLOG_PERIOD = 0.002  # [s] the same while there is a backlog
_WAKE_LENGTH = 20  # [messages] shortest queue for which `flush_if_idle` wakes the thread; more delay more estimates
_BATCH = 50  # messages written before the thread yields the processor, so that a backlog does not delay the estimator


class _NextBag(NamedTuple):
    """In the queue, where the next bag begins."""

    path: Path
    offered: int  # messages of the bag before
    refused: int


class _LowSpaceError(Exception):
    """The disk has no more room for the recording."""


class Recorder:
    """Recording of one bag, or of several one after the other, from construction to `close`.

    Without room for it, a recording begins stopped, see `error`. Raises BagError if the bag cannot be made.

    Args:
        path: Folder of the first bag; must not exist.
        queue_length: Largest number of queued messages.
        split_size: As of `BagWriter` [bytes].
        split_duration: As of `BagWriter` [s].
        free_space: Space that is left free on the disk [bytes]; 0: none.
        keep_size: Largest size of all bags of ``owner`` beside this one and of this one [bytes]; 0: no limit.
        owner: Name of the recorder in ``metadata.yaml``; empty: none.
    """

    def __init__(
        self,
        path: Path,
        *,
        queue_length: int = QUEUE_LENGTH,
        split_size: int = 0,
        split_duration: float = 0.0,
        free_space: int = 0,
        keep_size: int = 0,
        owner: str = '',
    ) -> None:
        self.path = path  # Folder of the present bag, or of the last one
        self.error = ''  # why the recording has stopped; empty while it goes on
        self._free_space, self._keep_size, self._owner = free_space, keep_size, owner
        self._offered = self._refused = 0  # messages since the newest bag began
        self._saved = 0  # those of them in the bag that failed
        self._newest = 0  # number of the bag that is asked for, the others are those of the thread:
        self._present, self._failed, self._due = 0, -1, -1  # number of its bag, of the failed one, of the one to end
        self._resumes = False
        self._queue_length = queue_length
        # Plain tuples: the garbage collector untracks them.
        self._queue: deque[tuple[str, str, int, bytes, int | None] | _NextBag] = deque()
        self._make = partial(
            BagWriter,
            split_size=split_size,
            split_duration=split_duration,
            custom_data={'recorded_by': owner} if owner else {},
        )
        self._stop = threading.Event()
        self._sleep = threading.Lock()  # held while nothing is to be done; half the work of an Event
        self._sleep.acquire()
        self._writer = self._make(path)
        try:
            self._check_space()
        except (OSError, _LowSpaceError) as error:
            self._fail(error)
        self._thread = threading.Thread(target=self._run, name='recorder', daemon=True)
        self._thread.start()

    def record(self, topic: str, type_name: str, log_time: int, data: bytes, publish_time: int | None = None) -> None:
        """Queue one serialised message, or drop and count it; never blocks."""
        self._offered += 1
        if self._failed == self._newest or len(self._queue) >= self._queue_length:
            self._refused += 1
        else:
            self._queue.append((topic, type_name, log_time, data, publish_time))

    def flush_if_idle(self) -> None:
        """Write the queue now if it is long enough; the estimator calls this right after an answer.

        Python runs one thread at a time, so writing while a sample arrives would delay its estimate.
        """
        if len(self._queue) >= _WAKE_LENGTH:
            self._wake()

    def _wake(self) -> None:
        """Wake the thread; one thread at a time may call this."""
        if self._sleep.locked():
            self._sleep.release()

    @property
    def is_next_due(self) -> bool:
        """Whether `begin_next` should be called: the bag is large enough, or the disk has room again."""
        return self._due == self._newest and len(self._queue) < self._queue_length // 2  # room for its first messages

    def begin_next(self) -> Path:
        """Let the next bag begin with the next message; its folder."""
        path = self.path.with_name(timed_name(self.path.name))
        self._queue.append(_NextBag(path, self._offered, self._refused))
        self._offered = self._refused = 0
        self._newest += 1
        self._wake()
        return path

    @property
    def written(self) -> int:
        """Number of messages written so far to the present bag."""
        return self._writer.message_count

    @property
    def dropped(self) -> int:
        """Number of messages that are not in the bag because the queue was full or the recording failed."""
        return self._offered - self._saved if self.error else self._refused

    @property
    def waiting(self) -> int:
        """Number of messages in the queue."""
        return len(self._queue)

    @property
    def is_finished(self) -> bool:
        """Whether the thread has ended, some time after `stop`."""
        return not self._thread.is_alive()

    def stop(self) -> None:
        """Write the queue and finish the bag, without waiting for it."""
        self._stop.set()
        self._wake()

    def close(self) -> None:
        """Write the queue and finish the bag; its metadata hold the number of dropped messages."""
        self.stop()
        self._thread.join()

    def _run(self) -> None:
        following = self._wait_for_next() if self.error else self._record_bag()
        while following is not None:
            following = self._record_bag() if self._begin(following) else self._wait_for_next()

    def _record_bag(self) -> _NextBag | None:
        """Write one bag; the next one, None after `stop`."""
        try:
            self._delete_oldest()
            following = self._write_until_next()
            refused = self._refused if following is None else following.refused
            self._writer.close({'dropped_messages': str(refused)})
        except Exception as error:  # noqa: BLE001  the thread must not end silently
            return self._fail(error) or self._wait_for_next()
        return following

    def _write_until_next(self) -> _NextBag | None:
        flushed = looked = time.monotonic()
        unlooked = _LOOK_SIZE  # [bytes] written since the last look at the disk
        while self._queue or not self._stop.is_set():
            now = time.monotonic()
            if unlooked >= _LOOK_SIZE or now - looked >= LOOK_PERIOD:
                self._check_space()
                unlooked, looked = 0, now
            for _ in range(min(len(self._queue), _BATCH)):
                item = self._queue.popleft()
                if isinstance(item, _NextBag):
                    return item
                self._writer.write(*item)
                unlooked += len(item[3])
            if time.monotonic() - flushed >= FLUSH_PERIOD - _IDLE_PERIOD:  # the next look would be too late
                self._writer.flush()
                flushed = time.monotonic()
            if self._keep_size and self._writer.size > self._keep_size // BAGS_KEPT:
                self._due = self._present
            self._sleep.acquire(timeout=_BACKLOG_PERIOD if self._queue else _IDLE_PERIOD)
        return None

    def _begin(self, following: _NextBag) -> bool:
        self._present += 1
        try:
            self._writer = self._make(following.path)
        except BagError as error:
            self._failed, self._saved, self._resumes = self._present, 0, True
            self.error = self.error or f'recording stopped: {error}'
            return False
        self.path, self.error = following.path, ''
        return True

    def _fail(self, failure: Exception) -> _NextBag | None:
        """Leave a valid bag of the messages written, and record the error; the next bag, if it was asked for."""
        self._failed, self._due = self._present, -1
        following = self._discard()
        self._resumes = isinstance(failure, _LowSpaceError) or getattr(failure, 'errno', None) == errno.ENOSPC
        text = f'{self.path}: recording stopped: {failure}'
        try:
            self._finish(failure, self._offered if following is None else following.offered)
        except Exception as error:  # noqa: BLE001  as above
            text += f'; and the bag could not be finished ({error}): use seal_friction recover'
        self._saved = self._writer.message_count
        self.error = text + '; a new bag begins once there is room' * self._resumes
        return following

    def _finish(self, failure: Exception, offered: int) -> None:
        if isinstance(failure, _LowSpaceError):
            if not self._writer.message_count:
                self._writer.remove()
                return
            with suppress(OSError):
                dropped = str(offered - self._writer.message_count)
                self._writer.close({'dropped_messages': dropped, 'failure': str(failure)})
                return
        self._writer.rescue(str(failure), offered)

    def _wait_for_next(self) -> _NextBag | None:
        """Drop messages until `begin_next`, which is due once there is room, or until `stop`."""
        while True:
            following = self._discard()
            if following is not None or self._stop.is_set():
                return following
            if self._sleep.acquire(timeout=RESUME_PERIOD):
                continue
            with suppress(OSError):
                if self._resumes and self._room() >= _RESUME_ROOM + self._free_space // 10:
                    self._due = self._present

    def _discard(self) -> _NextBag | None:
        """Drop the queued messages up to the next bag."""
        while self._queue:
            item = self._queue.popleft()
            if isinstance(item, _NextBag):
                return item
        return None

    def _room(self) -> int:
        """Space on the disk for messages [bytes]."""
        return shutil.disk_usage(self.path.parent).free - self._free_space - _END_SIZE

    def _check_space(self) -> None:
        if self._free_space and self._room() < self._writer.size // _INDEX_SHARE:
            raise _LowSpaceError(f'less than {self._free_space} bytes left free on the disk (record_free_space)')

    def _delete_oldest(self) -> None:
        if self._keep_size and self._owner:
            with suppress(OSError):
                delete_oldest(self.path.parent, self._owner, self._keep_size - self._keep_size // BAGS_KEPT)


def delete_oldest(folder: Path, owner: str, largest: int) -> None:
    """Delete the oldest finished bags of a recorder until the remaining ones have at most ``largest`` [bytes].

    A bag counts if its name ends like that of `timed_name`, its ``metadata.yaml`` says that ``owner`` finished it, and
    its folder contains nothing but that file and its MCAP files. Everything else stays: bags with another name,
    unfinished bags, folders with another file in them, and links. Raises OSError if ``folder`` cannot be read.
    """
    total = 0
    bags = [path for path in folder.iterdir() if START_IN_NAME.search(path.name) and _is_finished_by(path, owner)]
    for bag in sorted(bags, key=lambda path: path.name[-22:], reverse=True):
        with suppress(OSError):  # the other bags count as well
            files = list(bag.glob('*.mcap'))
            total += sum(file.stat().st_size for file in files)
            if total > largest:
                for file in (*files, bag / 'metadata.yaml'):
                    file.unlink()
                bag.rmdir()


def _is_finished_by(bag: Path, owner: str) -> bool:
    name = re.compile(rf'{re.escape(bag.name)}_[0-9]+\.mcap')
    try:
        if bag.is_symlink() or not all(
            path.name == 'metadata.yaml' or name.fullmatch(path.name) for path in bag.iterdir()
        ):
            return False
        about = read_yaml(bag / 'metadata.yaml', LARGEST_METADATA)['rosbag2_bagfile_information']['custom_data']
        return bool(about['recorded_by'] == owner and 'dropped_messages' in about)
    except (OSError, ValueError, LookupError, TypeError):
        return False
