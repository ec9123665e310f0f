"""Nodes of this package as processes of their own, for the demo, the tests and the benchmarks."""

import itertools
import json
import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from seal_friction_ros.nodes.discovery import set_up_discovery

_domains = itertools.count(os.getpid())
_PATIENCE = 15.0  # [s] for a node to stop in order before it is killed


def free_domain() -> int:
    """A ROS domain on which nobody on this machine is: 1 to 100, below the ports that Linux gives out by itself.

    The first participant of a domain holds a port of its own (DDS-RTPS 2.5, section 9.6.1.1), so the domain is free if
    that port is. Each call gives another domain.
    """
    for _ in range(100):
        domain = 1 + next(_domains) % 100
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            try:
                probe.bind(('127.0.0.1', 7410 + 250 * domain))
            except OSError:
                continue
            return domain
    raise RuntimeError('all ROS domains from 1 to 100 are in use on this machine')


def graph_environment(domain: int) -> dict[str, str]:
    """Environment of a graph that nobody else is on: own domain, nothing leaves this machine."""
    set_up_discovery()
    return {**os.environ, 'ROS_DOMAIN_ID': str(domain), 'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST'}


@contextmanager
def running(
    module: str,
    domain: int,
    parameters: Mapping[str, object],
    log: Path,
    remap: tuple[str, ...] = (),
    parameter_file: Path | None = None,
    prefix: tuple[str, ...] = (),
) -> Iterator[subprocess.Popen[bytes]]:
    """Run a node while the block runs, then stop it by SIGINT and wait.

    Args:
        module: Its module below ``seal_friction_ros.nodes``.
        domain: ROS domain.
        parameters: ROS parameters by name; text, numbers, truth values and lists of them.
        log: File for what it prints.
        remap: Remapping rules, ``FROM:=TO``.
        parameter_file: ROS parameter file; ``parameters`` come after it.
        prefix: Command to run it by, which prepares its file system, say; has to exec it.
    """
    command = [*prefix, sys.executable, '-m', f'seal_friction_ros.nodes.{module}', '--ros-args']
    if parameter_file is not None:
        command += ['--params-file', str(parameter_file)]
    for name, value in parameters.items():
        command += ['-p', f'{name}:={_yaml(value)}']
    for rule in remap:
        command += ['-r', rule]
    with log.open('ab') as output:
        process = subprocess.Popen(command, env=graph_environment(domain), stdout=output, stderr=subprocess.STDOUT)
        try:
            yield process
        finally:
            process.send_signal(signal.SIGCONT)  # else one that was stopped would not hear of its end
            process.send_signal(signal.SIGINT)
            try:
                process.wait(_PATIENCE)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


def play_live(
    bag: Path, out: Path, domain: int, rate: float, parameters: Mapping[str, object] | None = None
) -> dict[str, str]:
    """Play the inputs of a bag into a live estimator, in separate processes, which records to ``out``.

    Args:
        bag: Bag with the inputs.
        out: Bag to record; must not exist.
        domain: ROS domain.
        rate: Times the pace of the bag; 0 for as fast as the estimator answers.
        parameters: ROS parameters of the estimator besides those of the recording.

    Returns:
        Number of velocity samples, all answered, and percentiles of the round trip to the estimate.

    Raises:
        RuntimeError: A sample was not answered, or there is no recording; with what the processes said.
    """
    out.parent.mkdir(parents=True, exist_ok=True)
    log = out.with_suffix('.log')
    recording = {'record': True, 'record_directory': str(out.parent), 'record_name': out.name}
    with running('friction_estimator', domain, {**(parameters or {}), **recording}, log):
        player = [sys.executable, '-m', 'seal_friction_ros.nodes.bag_player', str(bag), '--rate', str(rate)]
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
