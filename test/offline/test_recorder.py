"""The recorder: everything in order, and never in the way."""

import time
from pathlib import Path

import pytest

from seal_friction_ros.core import wire
from seal_friction_ros.offline import recorder as recorder_module
from seal_friction_ros.offline.bag import BagError, BagWriter, read_messages
from seal_friction_ros.offline.recorder import Recorder


def test_messages_are_written_in_the_order_recorded(tmp_path: Path):
    recorder = Recorder(tmp_path / 'bag')
    for i in range(5000):
        recorder.record(f'/t{i % 3}', wire.CONFIGURATION_TYPE, 0, wire.encode_text(str(i)))
    recorder.close()
    texts = [wire.decode_text(message.data) for message in read_messages(tmp_path / 'bag')]
    assert texts == [str(i) for i in range(5000)]
    assert (recorder.written, recorder.dropped, recorder.error) == (5000, 0, '')


def test_a_disk_that_stalls_delays_nothing_and_what_is_dropped_is_counted(tmp_path: Path, monkeypatch):
    def stalled_write(self, *message):
        time.sleep(0.5)
        return write(self, *message)

    write = BagWriter.write
    monkeypatch.setattr(BagWriter, 'write', stalled_write)
    recorder = Recorder(tmp_path / 'bag', queue_length=3)
    slowest = 0.0
    for i in range(100):
        started = time.perf_counter()
        recorder.record('/t', wire.CONFIGURATION_TYPE, i, wire.encode_text(str(i)))
        slowest = max(slowest, time.perf_counter() - started)
        time.sleep(0.001)
    recorder.close()
    assert slowest < 0.1
    assert recorder.dropped > 90
    assert recorder.written + recorder.dropped == 100
    assert f"dropped_messages: '{recorder.dropped}'" in (tmp_path / 'bag' / 'metadata.yaml').read_text()


def test_a_disk_that_fails_stops_the_recording_and_says_why(tmp_path: Path, monkeypatch):
    def full(self, *message):
        raise OSError(28, 'No space left on device')

    monkeypatch.setattr(BagWriter, 'write', full)
    recorder = Recorder(tmp_path / 'bag')
    recorder.record('/t', wire.CONFIGURATION_TYPE, 0, b'')
    recorder.close()
    recorder.record('/t', wire.CONFIGURATION_TYPE, 0, b'')
    assert 'No space left on device' in recorder.error
    assert recorder.dropped >= 1


def test_nothing_is_overwritten(tmp_path: Path):
    with pytest.raises(BagError, match='not overwriting'):
        Recorder(tmp_path)


def test_the_queue_holds_ten_seconds_of_five_topics_at_one_kilohertz():
    assert recorder_module.QUEUE_LENGTH >= 10 * 5 * 1000
