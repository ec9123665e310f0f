"""Nodes of this package as processes of their own."""

import itertools
import json
import os
import signal
import socket
import subprocess
import sys
from collections import deque
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from seal_friction_ros.nodes.discovery import set_up_discovery

STOP_TIMEOUT = 60.0  # [s] until a node that does not stop is killed
MOST_CLAIMS = 8  # domains claimed by a process: more than it hands out before a node takes the first one
_domains = itertools.count(os.getpid())
_claims: deque[socket.socket] = deque()


def free_domain() -> int:
    """A ROS domain that no process on this machine uses: 1 to 100, whose ports are below those that Linux assigns.

    Each participant of a domain binds a port of its own (DDS-RTPS 2.5, section 9.6.1.1), Fast DDS not always the first
    one: the domain is free if all of them are. Between this call and the first participant an abstract Unix socket
    claims the domain, so that parallel test processes never get the same one. A process holds its last claims.

    Raises:
        RuntimeError: All domains from 1 to 100 are in use.
    """
    for _ in range(100):
        domain = 1 + next(_domains) % 100
        claim = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        try:
            claim.bind(f'\0seal_friction_domain_{domain}')
            for port in range(7410 + 250 * domain, 7650 + 250 * domain, 2):
                with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
                    probe.bind(('127.0.0.1', port))
        except OSError:
            claim.close()
            continue
        _claims.append(claim)
        if len(_claims) > MOST_CLAIMS:
            _claims.popleft().close()
        return domain
    raise RuntimeError('all ROS domains from 1 to 100 are in use on this machine')


def graph_environment(domain: int) -> dict[str, str]:
    """Environment variables of a process on ``domain``; its messages stay on this machine."""
    set_up_discovery()
    return {**os.environ, 'ROS_DOMAIN_ID': str(domain)}


@contextmanager
def node_process(
    module: str,
    domain: int,
    parameters: Mapping[str, object],
    log: Path,
    parameter_file: Path | None = None,
    prefix: tuple[str, ...] = (),
    interpreter: str = sys.executable,
) -> Iterator[subprocess.Popen[bytes]]:
    """Run a node during a ``with`` block, then stop it by SIGINT and wait for its end.

    Args:
        module: Module of the node below ``seal_friction_ros.nodes``.
        domain: ROS domain.
        parameters: ROS parameters by name: strings, numbers, booleans and lists of them.
        log: File to which stdout and stderr are appended.
        parameter_file: ROS parameter file; ``parameters`` override its values.
        prefix: Command that prepares the environment of the node, a mount for example, and then executes it.
        interpreter: Python that runs the node.

    Yields:
        The process.
    """
    command = [*prefix, interpreter, '-m', f'seal_friction_ros.nodes.{module}', '--ros-args']
    if parameter_file is not None:
        command += ['--params-file', str(parameter_file)]
    for name, value in parameters.items():
        command += ['-p', f'{name}:={_yaml(value)}']
    with log.open('ab') as output:
        process = subprocess.Popen(command, env=graph_environment(domain), stdout=output, stderr=subprocess.STDOUT)
        try:
            yield process
        finally:
            process.send_signal(signal.SIGCONT)  # a process stopped by SIGSTOP does not react to SIGINT
            process.send_signal(signal.SIGINT)
            try:
                process.wait(STOP_TIMEOUT)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


def play_live(
    bag: Path, out: Path, domain: int, rate: float, parameters: Mapping[str, object] | None = None
) -> dict[str, str]:
    """Play the inputs of a bag into a live estimator, both in processes of their own, and record to ``out``.

    Args:
        bag: Bag with the inputs.
        out: Bag to record; must not exist.
        domain: ROS domain.
        rate: Pace as a multiple of the pace of the bag; 0: as fast as the estimator answers.
        parameters: ROS parameters of the estimator besides those of the recording.

    Returns:
        Number of velocity samples, all of them answered, and percentiles of the round trip to the estimate.

    Raises:
        RuntimeError: A sample was not answered or there is no recording; with the output of the processes.
    """
    out.parent.mkdir(parents=True, exist_ok=True)
    log = out.with_suffix('.log')
    recording = {'record': True, 'record_directory': str(out.parent), 'record_name': out.name}
    with node_process('friction_estimator', domain, {'stamp_age_max': 0.0, **(parameters or {}), **recording}, log):
        player = [sys.executable, '-m', 'seal_friction_ros.nodes.bag_player', str(bag), '--rate', str(rate)]
        player += ['--wait', '60']
        played = subprocess.run(player, env=graph_environment(domain), capture_output=True, text=True, check=False)
    if played.returncode or not (out / 'metadata.yaml').is_file():
        raise RuntimeError(f'{played.stderr.strip()}; {log}: {log.read_text().strip()}')
    return dict(json.loads(played.stdout))


def _yaml(value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, list | tuple):
        return f'[{", ".join(_yaml(item) for item in value)}]'
    return str(value)
