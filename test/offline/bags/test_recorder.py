"""The recorder: everything in order, never in the way, and nothing lost but what was not written yet."""

import errno
import gc
import os
import time
from pathlib import Path

import pytest
import yaml

from seal_friction_ros.core.estimation.messages import CONFIGURATION_TYPE, decode_text, encode_text
from seal_friction_ros.offline.bags import mcap_writer
from seal_friction_ros.offline.bags import recorder as recorder_module
from seal_friction_ros.offline.bags.bag import BagError, BagWriter, read_messages
from seal_friction_ros.offline.bags.recorder import FLUSH_PERIOD, Recorder
from seal_friction_ros.offline.bags.recover import recover


def record(recorder: Recorder, number: int) -> None:
    recorder.record(f'/t{number % 3}', CONFIGURATION_TYPE, number, encode_text(str(number)))


def texts(bag: Path) -> list[str]:
    return [decode_text(message.data) for message in read_messages(bag)]


def information(bag: Path) -> dict:
    return yaml.safe_load((bag / 'metadata.yaml').read_text())['rosbag2_bagfile_information']


def wait_until(condition) -> None:
    deadline = time.monotonic() + 10.0
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.005)


class Disk:
    """Stands for ``os`` where bags are written; holds ``room`` [bytes], and takes ``delay`` [s] for each write."""

    def __init__(self, room: int = 1 << 40, delay: float = 0.0) -> None:
        self.room, self.delay = room, delay

    def __getattr__(self, name: str) -> object:
        return getattr(os, name)

    def pwrite(self, handle: int, data: bytes, offset: int) -> int:
        time.sleep(self.delay)
        written = os.pwrite(handle, data[: max(self.room - offset, 0)], offset)
        if not written:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return written


def test_messages_are_written_in_the_order_recorded(tmp_path: Path):
    recorder = Recorder(tmp_path / 'bag')
    for number in range(5000):
        record(recorder, number)
    recorder.close()
    assert texts(tmp_path / 'bag') == [str(number) for number in range(5000)]
    assert (recorder.written, recorder.dropped, recorder.error) == (5000, 0, '')


def test_what_was_recorded_is_on_the_disk_within_the_flush_period_however_little_it_is(tmp_path: Path):
    recorder = Recorder(tmp_path / 'bag')
    record(recorder, 0)
    time.sleep(FLUSH_PERIOD + 0.3)
    found = recover(tmp_path / 'bag', tmp_path / 'copy')  # as after a kill: the recorder goes on
    assert found.messages == 1
    recorder.close()


def test_a_disk_that_stalls_delays_nothing_and_what_is_dropped_is_counted(tmp_path: Path, monkeypatch):
    recorder = Recorder(tmp_path / 'bag', queue_length=300)
    monkeypatch.setattr(mcap_writer, 'os', Disk(delay=0.1))
    slowest = 0.0
    for number in range(1500):
        started = time.perf_counter()
        recorder.record('/t', CONFIGURATION_TYPE, number, bytes(1000))
        slowest = max(slowest, time.perf_counter() - started)
        time.sleep(0.0005)
    recorder.close()
    assert slowest < 0.05
    assert recorder.dropped > 300
    assert recorder.written + recorder.dropped == 1500
    assert information(tmp_path / 'bag')['custom_data'] == {'dropped_messages': str(recorder.dropped)}


def test_stopping_does_not_wait_for_the_disk(tmp_path: Path, monkeypatch):
    recorder = Recorder(tmp_path / 'bag')
    monkeypatch.setattr(mcap_writer, 'os', Disk(delay=0.3))
    record(recorder, 0)
    started = time.perf_counter()
    recorder.stop()
    assert time.perf_counter() - started < 0.1
    assert not recorder.is_finished
    recorder.close()
    assert recorder.is_finished
    assert texts(tmp_path / 'bag') == ['0']


def test_what_waits_for_the_disk_is_no_burden_on_the_garbage_collector(tmp_path: Path, monkeypatch):
    recorder = Recorder(tmp_path / 'bag')
    monkeypatch.setattr(mcap_writer, 'os', Disk(delay=1.0))
    gc.collect()
    before = len(gc.get_objects())
    for number in range(20_000):
        record(recorder, number)
    gc.collect()
    assert recorder.waiting > 15_000
    assert len(gc.get_objects()) - before < 1000
    monkeypatch.undo()
    recorder.close()


@pytest.mark.parametrize('room', [20_000, 90_000, 150_003, 400_000])
def test_a_full_disk_stops_the_recording_says_why_and_leaves_a_valid_bag(tmp_path: Path, monkeypatch, room: int):
    monkeypatch.setattr(mcap_writer, 'os', Disk(room=room))
    recorder = Recorder(tmp_path / 'bag')
    for number in range(20_000):
        record(recorder, number)
    recorder.close()
    assert 'No space left on device' in recorder.error
    assert '\n' not in recorder.error
    saved = texts(tmp_path / 'bag')
    assert saved == [str(number) for number in range(len(saved))]
    assert len(saved) * 70 > room - 100_000  # at most the newest chunks are gone
    assert information(tmp_path / 'bag')['message_count'] == len(saved) == recorder.written
    assert 'No space left' in information(tmp_path / 'bag')['custom_data']['failure']
    record(recorder, 0)
    assert recorder.dropped + recorder.written == 20_001


def test_a_folder_that_is_removed_stops_the_recording_and_says_so(tmp_path: Path):
    recorder = Recorder(tmp_path / 'bag')
    record(recorder, 0)
    for path in (tmp_path / 'bag').iterdir():
        path.unlink()
    (tmp_path / 'bag').rmdir()
    wait_until(lambda: record(recorder, 1) or recorder.error)
    assert 'removed' in recorder.error
    assert str(tmp_path / 'bag') in recorder.error
    recorder.close()


def test_metadata_that_cannot_be_written_costs_no_message(tmp_path: Path, monkeypatch):
    recorder = Recorder(tmp_path / 'bag')
    for number in range(5000):
        record(recorder, number)
    wait_until(lambda: not recorder.waiting)
    (tmp_path / 'bag' / 'metadata.yaml.partial').mkdir()  # in the way of the final one
    recorder.close()
    assert 'could not be finished' in recorder.error
    assert 'seal_friction recover' in recorder.error
    assert recover(tmp_path / 'bag', tmp_path / 'copy').messages == 5000


def test_any_failure_stops_the_recording_and_says_why(tmp_path: Path, monkeypatch):
    def broken(self, *message):
        raise RuntimeError('the disk sings')

    monkeypatch.setattr(BagWriter, 'write', broken)
    recorder = Recorder(tmp_path / 'bag')
    record(recorder, 0)
    recorder.close()
    assert 'the disk sings' in recorder.error
    assert texts(tmp_path / 'bag') == []


def test_a_recording_is_split_by_size_and_reads_as_one(tmp_path: Path):
    recorder = Recorder(tmp_path / 'bag', split_size=100_000)
    for number in range(5000):
        record(recorder, number)
    recorder.close()
    assert len(list((tmp_path / 'bag').glob('*.mcap'))) > 3
    assert texts(tmp_path / 'bag') == [str(number) for number in range(5000)]


def test_nothing_is_overwritten(tmp_path: Path):
    with pytest.raises(BagError, match='not overwriting'):
        Recorder(tmp_path)


def test_the_queue_holds_ten_seconds_of_seven_topics_at_one_kilohertz():
    assert recorder_module.QUEUE_LENGTH >= 10 * 7 * 1000
