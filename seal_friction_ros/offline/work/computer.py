"""What this computer has and lacks for nodes and commands, looked up without a graph: ``seal_friction doctor``."""

import os
import platform
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator, Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

from seal_friction_ros.offline.work.versions import version_of
from seal_friction_ros.packages import OPTIONAL, how_to_install

PROFILES = ('FASTDDS_DEFAULT_PROFILES_FILE', 'FASTRTPS_DEFAULT_PROFILES_FILE')
_FIRST_PORT, _PORTS_OF_A_DOMAIN = 7410, 250  # UDP port of participant 0 of domain 0; RTPS 2.5, 9.6.2
_MOST_PARTICIPANTS = 120  # of a domain on one computer: so many ports it has
_ANNOUNCED_TO = {'rclpy': 32, 'profile': 100}  # participants that a new one announces itself to
SMALLEST_SHARED_MEMORY = 64 << 20  # [bytes] of /dev/shm for a few nodes (our choice)
SHARED_MEMORY = Path('/dev/shm')  # noqa: S108  looked at, never written


OK, NOTE, FAULT = 'ok', 'note', 'fault'
"""levels; note: something works less well, or some command does not; fault: a node cannot run, or is not found"""


class Finding(NamedTuple):
    """One line about this computer."""

    level: str
    subject: str
    text: str


def findings(environment: Mapping[str, str] = os.environ, udp: Path = Path('/proc/net/udp')) -> list[Finding]:
    """Everything that is known, in order; from environment variables and a table of UDP sockets."""
    return [
        *_versions(),
        *_ros(environment),
        *_middleware(environment),
        _participants(environment, udp),
        _shared_memory(environment),
        _priority(),
    ]


def _versions() -> Iterator[Finding]:
    own = version_of('seal_friction_ros', 'not installed: run make setup, or source the colcon workspace')
    yield Finding(OK, 'versions', f'seal_friction_ros {own}, Python {platform.python_version()}')
    for module in OPTIONAL:
        if find_spec(module):
            yield Finding(OK, module, version_of(module, 'version unknown'))
        else:
            yield Finding(NOTE, module, how_to_install(module))


def _ros(environment: Mapping[str, str]) -> Iterator[Finding]:
    distribution = environment.get('ROS_DISTRO', '')
    for module, hint in (
        ('rclpy', 'run make setup, or source a ROS 2 distribution'),
        ('seal_friction_msgs', 'run make setup, or build msg_defs with colcon and source the workspace'),
    ):
        found = find_spec(module) is not None
        text = f'from {distribution or "wheels"}' if found else f'not installed: no node can run: {hint}'
        yield Finding(OK if found else FAULT, module, text)


def _middleware(environment: Mapping[str, str]) -> Iterator[Finding]:
    given = [(name, environment[name]) for name in PROFILES if environment.get(name)]
    for name, path in given:
        there = Path(path).is_file()
        text = f'{path} ({name})' + ('' if there else ': no such file, so the defaults of Fast DDS act')
        yield Finding(OK if there else FAULT, 'profile', text)
    if not given:
        own = 'config/fastdds.xml, set by the nodes'
        without = f'none: nodes may find each other 3 s late; export {PROFILES[0]}=.../config/fastdds.xml'
        is_own = _has_own_profile(environment)
        yield Finding(OK if is_own else NOTE, 'profile', own if is_own else without)
    default = 'SUBNET' if 'ROS_DISTRO' in environment else 'LOCALHOST'
    reach = environment.get('ROS_AUTOMATIC_DISCOVERY_RANGE', default)
    where = {'LOCALHOST': 'nodes of this computer', 'OFF': 'no other node', 'SUBNET': 'every computer of the network'}
    text = f'{reach}: {where.get(reach, "not a range: use SUBNET, LOCALHOST, OFF or SYSTEM_DEFAULT")}'
    level = OK if reach in (*where, 'SYSTEM_DEFAULT') else FAULT
    yield Finding(level, 'discovery range', f'{text}; domain {_domain(environment)}')


def _has_own_profile(environment: Mapping[str, str]) -> bool:
    """Whether the nodes set the profile of this package: from wheels, for this computer, if there is no other one."""
    is_local = environment.get('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST') == 'LOCALHOST'
    return is_local and 'ROS_DISTRO' not in environment and not any(map(environment.get, PROFILES))


def _domain(environment: Mapping[str, str]) -> int:
    text = environment.get('ROS_DOMAIN_ID', '')
    return int(text) if text.isdecimal() else 0


def _participants(environment: Mapping[str, str], udp: Path) -> Finding:
    """Processes of the domain, by their ports: those beyond the reach of the announcements stay unknown to new ones."""
    first = _FIRST_PORT + _PORTS_OF_A_DOMAIN * _domain(environment)
    ports = range(first, first + 2 * _MOST_PARTICIPANTS, 2)
    try:
        used = {int(port, 16) for port in re.findall(r'^ *\d+: [0-9A-F]+:([0-9A-F]{4})', udp.read_text(), re.MULTILINE)}
    except OSError as error:
        return Finding(NOTE, 'participants', f'not known: {error.strerror}')
    numbers = [number for number, port in enumerate(ports) if port in used]
    most = _ANNOUNCED_TO['profile' if _has_own_profile(environment) else 'rclpy']
    if max(numbers, default=0) >= most:
        text = f'{len(numbers)}, the highest has number {max(numbers)}: nodes from number {most} on are not discovered'
        return Finding(FAULT, 'participants', f'{text}: stop some, or use another ROS_DOMAIN_ID')
    return Finding(OK, 'participants', f'{len(numbers)} of at most {most}')


def _shared_memory(environment: Mapping[str, str]) -> Finding:
    if _has_own_profile(environment):
        return Finding(OK, 'shared memory', 'not used: config/fastdds.xml has UDP alone')
    if not os.access(SHARED_MEMORY, os.W_OK):
        return Finding(NOTE, 'shared memory', f'{SHARED_MEMORY} cannot be written: Fast DDS falls back to UDP')
    free = shutil.disk_usage(SHARED_MEMORY).free
    names = ('fastrtps_*', 'fastdds_*')  # Jazzy, Kilted
    files = sum(len(list(SHARED_MEMORY.glob(name))) for name in names)
    text = f'{free >> 20} MiB free, {files} files of Fast DDS'
    if free < SMALLEST_SHARED_MEMORY:
        return Finding(NOTE, 'shared memory', f'{text}: with no node running, remove {" and ".join(names)} there')
    return Finding(OK, 'shared memory', text)


def realtime_granted() -> bool:
    """Whether the system grants this user a real-time priority; another process tries it, this one keeps its own."""
    attempt = 'import os; os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))'
    return subprocess.run([sys.executable, '-S', '-c', attempt], capture_output=True, check=False).returncode == 0


def _priority() -> Finding:
    if realtime_granted():
        return Finding(OK, 'real-time priority', 'granted')
    hint = 'give the user an rtprio limit (/etc/security/limits.conf) or the process CAP_SYS_NICE'
    return Finding(NOTE, 'real-time priority', f'not granted: {hint}, or leave realtime_priority at 0')
