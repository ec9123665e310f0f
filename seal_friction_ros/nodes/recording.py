"""Recording as the node sees it: at most one bag at a time, started and stopped while estimates go on."""

from datetime import UTC, datetime
from pathlib import Path

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue

from seal_friction_ros.nodes.parameters import RecordingOptions
from seal_friction_ros.offline.bags.bag import BagError
from seal_friction_ros.offline.bags.recorder import Recorder


class Recording:
    """The bag being recorded, if any, and what became of the last one."""

    def __init__(self) -> None:
        self._recorder: Recorder | None = None
        self._finishing: list[Recorder] = []
        self.failure = ''
        """Why the last bag could not be made or finished; empty if it could."""

    def start(self, options: RecordingOptions) -> Path:
        """Start a bag called ``record_name``, or after the time if that is empty; return its folder.

        Raises:
            BagError: It cannot be made, or another one is being recorded.
        """
        if self._recorder is not None and not self._recorder.error:
            raise BagError(f'recording to {self._recorder.path} already: stop that first')
        self.stop()
        directory, name = options.record_directory, options.record_name
        try:
            folder = Path(directory).expanduser()
            self._recorder = Recorder(
                folder / (name or f'friction_{datetime.now(UTC):%Y%m%d_%H%M%S_%f}'),
                split_size=options.record_split_size,
                split_duration=options.record_split_duration,
            )
        except (ValueError, RuntimeError) as error:
            self.failure = str(error)
            raise BagError(f'record_directory = {directory!r}, record_name = {name!r}: {error}') from None
        return self._recorder.path

    def record(self, topic: str, type_name: str, log_time: int, data: bytes) -> None:
        """Record one message, if a bag is being recorded."""
        if self._recorder is not None:
            self._recorder.record(topic, type_name, log_time, data)

    def now_is_a_good_time(self) -> None:
        """To write: nobody waits for an answer right now."""
        if self._recorder is not None:
            self._recorder.now_is_a_good_time()

    def stop(self) -> str:
        """Have the bag finished, without making the estimate wait for the disk.

        Returns:
            What becomes of it in words; empty if none was being recorded.
        """
        recorder, self._recorder = self._recorder, None
        self.failure = ''
        if recorder is None:
            return ''
        recorder.stop()
        self._finishing.append(recorder)
        self.failure = recorder.error
        words = f'{recorder.path}: {recorder.written} messages, {recorder.waiting} more to be written, '
        return recorder.error or f'{words}{recorder.dropped} dropped'

    def close(self) -> str:
        """Have the bag finished and wait for it; what became of it in words, empty if none was being recorded."""
        recorder = self._recorder
        self.stop()
        for finishing in self._finishing:
            finishing.close()
        self._look_after_finishing()
        if recorder is None:
            return self.failure
        return recorder.error or f'{recorder.path}: {recorder.written} messages, {recorder.dropped} dropped'

    def _look_after_finishing(self) -> None:
        """Keep what went wrong with a bag after it was stopped."""
        for recorder in self._finishing:
            self.failure = recorder.error or self.failure
        self._finishing = [recorder for recorder in self._finishing if not recorder.is_finished]

    def report(self) -> DiagnosticStatus:
        """State of the recorder."""
        self._look_after_finishing()
        status = DiagnosticStatus(level=DiagnosticStatus.OK, message='not recording')
        values = {}
        recorder = self._recorder or next(iter(self._finishing), None)
        if recorder is not None:
            status.message = 'recording' if recorder is self._recorder else 'writing the end of a bag'
            values = {
                'bag': str(recorder.path),
                'written': str(recorder.written),
                'waiting': str(recorder.waiting),
                'dropped': str(recorder.dropped),
            }
            if recorder.dropped:
                status.level, status.message = DiagnosticStatus.WARN, f'{recorder.dropped} messages dropped'
        failure = recorder.error if recorder is not None and recorder.error else self.failure
        if failure:
            status.level, status.message = DiagnosticStatus.ERROR, failure
        status.values = [KeyValue(key=key, value=value) for key, value in values.items()]
        return status
