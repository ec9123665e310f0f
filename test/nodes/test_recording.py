"""Recording of the node: failures are reported, and the estimate continues."""

from pathlib import Path

import pytest
from harness.blocked_disk import BlockedDisk
from harness.live_graph import graph
from rcl_interfaces.msg import Parameter, ParameterValue
from rcl_interfaces.srv import SetParametersAtomically
from seal_friction_msgs.msg import FrictionEstimate
from std_srvs.srv import Trigger

from seal_friction_ros.core.estimation.node_options import RecordingOptions
from seal_friction_ros.core.messages.layouts import CONFIGURATION_TYPE
from seal_friction_ros.nodes.recording import Recording
from seal_friction_ros.offline.bags import mcap_writer, recorder
from seal_friction_ros.offline.bags.bag import BagError, BagWriter, read_messages
from seal_friction_ros.offline.replay.replay import replay

START = 'friction_estimator/start_recording'
STOP = 'friction_estimator/stop_recording'


@pytest.mark.parametrize(
    ('directory', 'name'),
    [('~no_such_user_here', ''), ('/proc/no/such/place', ''), ('.', 'n' * 250), ('/dev/null', 'bag')],
)
def test_an_impossible_folder_is_rejected_with_its_name_and_leaves_nothing(
    directory: str, name: str, tmp_path: Path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    recording = Recording()
    with pytest.raises(BagError, match='record_directory'):
        recording.start(RecordingOptions(record_directory=directory, record_name=name))
    assert recording.failure
    assert list(tmp_path.iterdir()) == []


def test_a_failed_start_request_is_answered_and_the_estimate_continues():
    with graph({'record_directory': '~no_such_user_here'}) as g:
        g.connect()
        answer = g.call(Trigger, START, Trigger.Request())
        assert not answer.success
        assert 'no_such_user_here' in answer.message
        assert g.estimate(10**9, 0.1).state == FrictionEstimate.SLIDING


def test_a_disk_failure_is_logged_and_a_new_recording_can_start(tmp_path: Path, monkeypatch, capfd):
    def full(self, *message, **options):
        raise OSError(5, 'Input/output error')

    with graph({'record_directory': str(tmp_path)}) as g:
        g.connect()
        with monkeypatch.context() as broken:
            broken.setattr(BagWriter, 'write', full)
            assert g.call(Trigger, START, Trigger.Request()).success
            assert g.spin_until(lambda: 'Input/output error' in g.probe.values('recorder').get('message', ''))
        assert capfd.readouterr().err.count('Input/output error') == 1
        assert g.estimate(10**9, 0.1).state == FrictionEstimate.SLIDING
        assert g.call(Trigger, START, Trigger.Request()).success
        assert g.spin_until(lambda: g.probe.values('recorder').get('level') == '0')
        assert g.call(Trigger, STOP, Trigger.Request()).success


def test_a_stop_request_is_answered_while_the_disk_stalls_and_the_bag_is_finished_later(tmp_path, monkeypatch):
    disk = BlockedDisk()
    with graph({'record_directory': str(tmp_path), 'record_name': 'bag'}) as g:
        g.connect()
        assert g.call(Trigger, START, Trigger.Request()).success
        with monkeypatch.context() as stalled:
            stalled.setattr(mcap_writer, 'os', disk)
            assert g.call(Trigger, STOP, Trigger.Request()).success
            assert g.estimate(10**9, 0.1).state == FrictionEstimate.SLIDING
            assert g.spin_until(lambda: g.probe.values('recorder').get('message', '') == 'writing the end of a bag')
            disk.release()
        assert g.spin_until(lambda: g.probe.values('recorder').get('message', '') == 'not recording')
    assert len(list(read_messages(tmp_path / 'bag'))) == 1


class Disk:
    """Stands for ``shutil`` where the recorder asks for the free space."""

    free = 10**12

    def disk_usage(self, path: Path) -> 'Disk':
        assert path.is_dir()
        return self


@pytest.fixture
def disk(monkeypatch) -> Disk:
    monkeypatch.setattr(recorder, 'RESUME_PERIOD', 0.01)
    stand_in = Disk()
    monkeypatch.setattr(recorder, 'shutil', stand_in)
    return stand_in


def test_recording_stops_before_the_disk_is_full_and_continues_in_a_bag_that_replays_alone(
    tmp_path: Path, disk: Disk, capfd
):
    def bags() -> list[Path]:
        return sorted(tmp_path.iterdir())

    with graph({'record': True, 'record_directory': str(tmp_path), 'record_free_space': 10**9}) as g:
        g.connect()
        for number in range(1, 50):
            g.estimate(number * 10**6, 0.1, force=30.0)
        assert g.spin_until(lambda: not g.estimator.recording.recorder.waiting)
        disk.free = 10**9 - 1
        assert g.spin_until(lambda: 'recording stopped' in g.probe.values('recorder').get('message', ''))
        assert g.probe.values('recorder')['level'] == '2'
        for number in range(50, 100):
            assert g.estimate(number * 10**6, 0.1, force=30.0).state == FrictionEstimate.SLIDING
        disk.free = 2 * 10**9
        assert g.spin_until(lambda: g.probe.values('recorder').get('message', '') == 'recording')
        for number in range(100, 150):
            g.estimate(number * 10**6, 0.1, force=30.0)
    assert capfd.readouterr().err.count('less than 1000000000 bytes left free') == 1
    assert len(bags()) == 2
    for bag in bags():
        result = replay(bag)
        assert result.identical, result
        assert result.recorded_estimates in (49, 50)
        assert next(iter(read_messages(bag))).type_name == CONFIGURATION_TYPE


def test_a_recording_without_room_is_refused_and_begins_once_there_is_room(tmp_path: Path, disk: Disk, capfd):
    disk.free = 10**9 - 1
    with graph({'record_directory': str(tmp_path)}) as g:
        g.connect()
        answer = g.call(Trigger, START, Trigger.Request())
        assert not answer.success
        assert 'record_free_space' in answer.message
        assert g.spin_until(lambda: g.probe.values('recorder').get('level') == '2')
        assert g.call(Trigger, STOP, Trigger.Request()).success is False
        assert not g.call(Trigger, START, Trigger.Request()).success
        disk.free = 10**12
        assert g.spin_until(lambda: g.probe.values('recorder').get('message', '') == 'recording')
        assert g.call(Trigger, STOP, Trigger.Request()).success
        assert g.spin_until(lambda: g.probe.values('recorder').get('message', '') == 'not recording')
    assert len(list(tmp_path.iterdir())) == 1


def test_a_long_recording_keeps_its_newest_bags_and_each_replays_alone(tmp_path: Path):
    parameters = {'record': True, 'record_directory': str(tmp_path), 'record_keep_size': 10_000_000}
    begun = set()
    with graph(parameters) as g:
        g.connect()
        recorder = g.estimator.recording.recorder
        for number in range(15):
            for moment in range(10):
                g.estimate((10 * number + moment + 1) * 10**6, 0.1, force=30.0)
            present = recorder.path
            begun.add(present)
            for _ in range(100):
                recorder.record('/t', 'std_msgs/msg/String', g.estimator.now(), bytes(10_000))
            assert g.spin_until(lambda present=present: recorder.path != present)
        g.estimate(10**9, 0.1, force=30.0)
    left = sorted(tmp_path.iterdir())
    assert 8 <= len(left) <= 10
    assert left[:-1] == sorted(begun)[-len(left) + 1 :]
    assert sum(file.stat().st_size for bag in left for file in bag.iterdir()) < 11_000_000
    for bag in left:
        result = replay(bag)
        assert result.identical, result
        assert result.recorded_estimates == (10 if bag != left[-1] else 1)


def test_a_recording_is_split_as_the_parameters_say(tmp_path: Path):
    with graph(
        {'record': True, 'record_directory': str(tmp_path), 'record_name': 'bag', 'record_split_size': 1_000_000}
    ) as g:
        g.connect()
        recording = g.estimator.recording
        for number in range(9000):
            recording.record('/t', 'std_msgs/msg/String', number, bytes(400))
    assert len(list((tmp_path / 'bag').glob('*.mcap'))) == 5
    assert len(list(read_messages(tmp_path / 'bag'))) == 9001


@pytest.mark.parametrize('name', ['../escaped', '/absolute', '..', 'two\nlines'])
def test_a_bag_name_outside_the_folder_is_rejected(name: str):
    with graph() as g:
        value = ParameterValue(type=4, string_value=name)
        request = SetParametersAtomically.Request(parameters=[Parameter(name='record_name', value=value)])
        result = g.call(SetParametersAtomically, 'friction_estimator/set_parameters_atomically', request).result
        assert not result.successful
        assert 'record_name' in result.reason


@pytest.mark.parametrize('parameters', [{'qos_overrides./friction_estimate.publisher.reliability': 'garbage'}])
def test_a_failed_configuration_logs_the_reason(parameters: dict[str, object], capfd):
    with graph(parameters, autostart=False) as g:
        assert not g.estimator.autostart()
        assert 'garbage' in capfd.readouterr().err
        assert not g.estimator.autostart()
