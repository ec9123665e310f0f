"""Recording of the node: at most one bag at a time, started and stopped while the node estimates."""

from pathlib import Path

from diagnostic_msgs.msg import DiagnosticStatus

from seal_friction_ros.core.estimation.node_options import RecordingOptions
from seal_friction_ros.nodes.managed_node import status_of
from seal_friction_ros.offline.bags.bag import BagError, timed_name
from seal_friction_ros.offline.bags.recorder import Recorder


class Recording:
    """The present bag of the node ``owner``, if any, and the bags that are being finished."""

    def __init__(self, owner: str = '') -> None:
        self._owner = owner
        self.recorder: Recorder | None = None
        self._finishing: list[Recorder] = []
        self._state_period = 0.0  # [s] 0.0: no states amid the bag
        self._next_state = 0.0  # [s] of the steady clock; 0.0: not known
        self.failure = ''
        """Why the last bag could not be created or finished; empty without an error."""

    def start(self, options: RecordingOptions) -> Path:
        """Start a bag named ``record_name``, or after the present time if that is empty; return its folder.

        BagError: the bag cannot be created, or another bag is being recorded, or the disk has no room: then the
        recording begins once there is room.
        """
        if self.recorder is not None and not self.recorder.error:
            raise BagError(f'recording to {self.recorder.path} already: stop that first')
        self.stop()
        self._state_period, self._next_state = options.record_state_period, 0.0
        directory, name = options.record_directory, options.record_name
        try:
            folder = Path(directory).expanduser()
            self.recorder = Recorder(
                folder / (name or timed_name('friction')),
                split_size=options.record_split_size,
                split_duration=options.record_split_duration,
                free_space=options.record_free_space,
                keep_size=options.record_keep_size,
                owner=self._owner,
            )
        except (ValueError, RuntimeError) as error:
            self.failure = f'record_directory = {directory!r}, record_name = {name!r}: {error}'
            raise BagError(self.failure) from None
        self.failure = ''
        if self.recorder.error:
            raise BagError(self.recorder.error)
        return self.recorder.path

    def continue_in_next_bag(self) -> Path | None:
        """Begin the next bag if it is due; its folder. The caller has to record a snapshot first."""
        if self.recorder is None or not self.recorder.is_next_due:
            return None
        return self.recorder.begin_next()

    def is_state_due(self, now: float) -> bool:
        """Whether to record a state ``now`` [s of the steady clock]; once for each period since the bag began."""
        if self.recorder is None or self.recorder.error or not self._state_period:
            return False
        is_due = 0.0 < self._next_state <= now
        if is_due or not self._next_state:
            self._next_state = now + self._state_period
        return is_due

    def record(self, topic: str, type_name: str, log_time: int, data: bytes, publish_time: int | None = None) -> None:
        """Record one message, if a bag is being recorded."""
        if self.recorder is not None:
            self.recorder.record(topic, type_name, log_time, data, publish_time)

    def stop(self) -> str:
        """Finish the bag in the background, so that the disk does not delay the estimate.

        Path and message counts, or the error; empty if no bag was being recorded.
        """
        recorder, self.recorder = self.recorder, None
        self.failure = ''
        if recorder is None:
            return ''
        recorder.stop()
        self.failure = recorder.error
        if not recorder.error:
            self._finishing.append(recorder)
        counts = f'{recorder.written} messages, {recorder.waiting} more to be written, {recorder.dropped} dropped'
        return recorder.error or f'{recorder.path}: {counts}'

    def close(self) -> str:
        """Finish the bag and wait for the disk; path and message counts or the error, empty if there was no bag."""
        recorder = self.recorder
        self.stop()
        for finishing in self._finishing:
            finishing.close()
        self._forget_finished()
        if recorder is None:
            return self.failure
        return recorder.error or f'{recorder.path}: {recorder.written} messages, {recorder.dropped} dropped'

    def _forget_finished(self) -> None:
        """Drop the finished bags; keep the last error."""
        for recorder in self._finishing:
            self.failure = recorder.error or self.failure
        self._finishing = [recorder for recorder in self._finishing if not recorder.is_finished]

    def report(self) -> DiagnosticStatus:
        """Status of the recorder."""
        self._forget_finished()
        level, message, values, failure = DiagnosticStatus.OK, 'not recording', {}, self.failure
        recorder = self.recorder or next(iter(self._finishing), None)
        if recorder is not None:
            message = 'recording' if recorder is self.recorder else 'writing the end of a bag'
            failure = recorder.error or failure
            names = ('written', 'waiting', 'dropped')
            values = {'bag': recorder.path, **{name: getattr(recorder, name) for name in names}}
            if recorder.dropped:
                level, message = DiagnosticStatus.WARN, f'{recorder.dropped} messages dropped'
        if failure:
            level, message = DiagnosticStatus.ERROR, failure
        return status_of(level, message, values)
