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
from seal_friction_ros.nodes.recording import Recording
from seal_friction_ros.offline.bags import mcap_writer
from seal_friction_ros.offline.bags.bag import BagError, BagWriter, read_messages

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


def test_a_recording_is_split_as_the_parameters_say(tmp_path: Path):
    with graph(
        {'record': True, 'record_directory': str(tmp_path), 'record_name': 'bag', 'record_split_size': 1_000_000}
    ) as g:
        g.connect()
        recording = g.estimator._recording
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
