"""``seal_friction doctor`` names what is missing."""

import json
import os
import socket
from pathlib import Path

import pytest

from seal_friction_ros.offline.commands.main import main
from seal_friction_ros.offline.work import computer
from seal_friction_ros.offline.work.computer import FAULT, NOTE, OK, findings
from seal_friction_ros.packages import OPTIONAL

PROFILE = 'FASTDDS_DEFAULT_PROFILES_FILE'


def about(subject: str, environment: dict[str, str], udp: Path = Path('/proc/net/udp')) -> tuple[str, str]:
    (found,) = (one for one in findings(environment, udp) if one.subject == subject)
    return found.level, found.text


def test_a_missing_package_is_named_with_the_command_that_installs_it(monkeypatch):
    monkeypatch.setattr(computer, 'find_spec', lambda _: None)
    for module, package in OPTIONAL.items():
        level, text = about(module, {})
        assert level == NOTE
        assert text.startswith('not installed: ')
        assert text.endswith(f'pip install {module}')
        assert package in text
    for module in ('rclpy', 'seal_friction_msgs'):
        level, text = about(module, {})
        assert level == FAULT
        assert 'not installed: no node can run' in text


def test_the_profile_is_looked_for(tmp_path: Path):
    (tmp_path / 'profile.xml').touch()
    assert about('profile', {PROFILE: str(tmp_path / 'profile.xml')})[0] == OK
    level, text = about('profile', {PROFILE: str(tmp_path / 'gone.xml')})
    assert level == FAULT
    assert 'gone.xml' in text
    assert about('profile', {})[0] == OK
    assert about('profile', {'ROS_DISTRO': 'jazzy'})[0] == NOTE
    assert about('profile', {'ROS_AUTOMATIC_DISCOVERY_RANGE': 'SUBNET'})[0] == NOTE


@pytest.mark.parametrize(
    ('environment', 'level', 'text'),
    [
        ({}, OK, 'LOCALHOST: nodes of this computer; domain 0'),
        ({'ROS_DISTRO': 'jazzy'}, OK, 'SUBNET: every computer of the network; domain 0'),
        ({'ROS_AUTOMATIC_DISCOVERY_RANGE': 'OFF', 'ROS_DOMAIN_ID': '7'}, OK, 'OFF: no other node; domain 7'),
        ({'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCAL'}, FAULT, 'not a range'),
    ],
)
def test_the_range_of_discovery_is_that_of_the_environment(environment, level, text):
    found = about('discovery range', environment)
    assert found[0] is level
    assert text in found[1]


def test_participants_are_counted_by_their_ports_in_the_domain():
    """With LOCALHOST rclpy announces a node to 32 participants: the 33rd is not discovered."""
    domain = {'ROS_DOMAIN_ID': '231', PROFILE: __file__}
    before = about('participants', domain)[1].split()[0]
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as participant:
        participant.bind(('127.0.0.1', 7410 + 250 * 231 + 2 * 31))
        assert about('participants', domain) == (OK, f'{int(before) + 1} of at most 32')
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as another:
            another.bind(('127.0.0.1', 7410 + 250 * 231 + 2 * 32))
            level, text = about('participants', domain)
            assert level == FAULT
            assert f'{int(before) + 2}, the highest has number 32' in text
            assert about('participants', {'ROS_DOMAIN_ID': '231'})[0] == OK  # 100 with the profile of the nodes


def test_a_small_shared_memory_is_noted(monkeypatch, tmp_path: Path):
    monkeypatch.setattr(computer, 'SHARED_MEMORY', tmp_path)
    (tmp_path / 'fastrtps_1').touch()
    (tmp_path / 'fastdds_1').touch()
    level, text = about('shared memory', {'ROS_DISTRO': 'jazzy'})
    assert level == OK
    assert text.endswith(' MiB free, 2 files of Fast DDS')
    monkeypatch.setattr(computer, 'SMALLEST_SHARED_MEMORY', 1 << 62)
    assert about('shared memory', {'ROS_DISTRO': 'jazzy'})[0] == NOTE
    assert 'not used' in about('shared memory', {})[1]
    assert 'not used' not in about('shared memory', {'ROS_AUTOMATIC_DISCOVERY_RANGE': 'SUBNET'})[1]


def test_the_priority_is_what_a_process_gets(monkeypatch):
    process = os.fork()
    if process == 0:
        try:
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
        except OSError:
            os._exit(1)
        os._exit(0)
    granted = os.waitpid(process, 0)[1] == 0
    assert about('real-time priority', {})[0] == (OK if granted else NOTE)
    monkeypatch.setattr(computer.sys, 'executable', '/bin/false')
    assert about('real-time priority', {})[0] == NOTE


def test_the_command_ends_with_1_where_a_node_cannot_run(monkeypatch, capsys):
    pytest.importorskip('rclpy', reason='without it no node can run at all')
    monkeypatch.delenv(PROFILE, raising=False)
    monkeypatch.setenv('ROS_DOMAIN_ID', '230')
    assert main(['doctor', '--json']) == 0
    assert {one['subject'] for one in json.loads(capsys.readouterr().out)['findings']} >= {'rclpy', 'participants'}
    monkeypatch.setenv(PROFILE, '/nowhere.xml')
    assert main(['doctor']) == 1
    assert 'fault profile: /nowhere.xml' in capsys.readouterr().out
