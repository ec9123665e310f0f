"""A simulated machine with standard messages and its estimator, recorded live without and with feed-forward."""

import time
from pathlib import Path

from harness.compensation import SCALE
from harness.processes import node_process
from seal_friction_ros.files import read_machine

TIMEOUT = 120.0  # [s] until a node is ready: it may compile first


def record_machine(folder: Path, domain: int, seconds: float, simulator: Path, mapping: str) -> dict[str, Path]:
    """Run the simulator, and beside it twice the estimator, each in a process of its own.

    Args:
        folder: Where the bags and the log go.
        domain: ROS domain.
        seconds: Duration of each part [s].
        simulator: ROS parameter file of the simulator.
        mapping: Mapping file.

    Returns:
        Bag of each part: ``none`` and ``on``.

    Raises:
        RuntimeError: A node is not ready in time, or there is no recording; with the output of the processes.
    """
    folder.mkdir(parents=True, exist_ok=True)
    (actuator,) = read_machine(mapping).actuators
    bags = {}
    with node_process('servo_simulator', domain, {}, log := folder / 'machine.log', parameter_file=simulator):
        _wait_for('simulating', log)
        for name, scale in (('none', 0.0), ('on', SCALE)):
            bags[name] = bag = folder / f'machine_{name}'
            recording = {'record': True, 'record_directory': str(folder), 'record_name': bag.name}
            parameters = {'machine': mapping, f'{actuator.name}.feedforward.scale': scale, **recording}
            with node_process('machine_estimator', domain, parameters, own := folder / f'machine_{name}.log'):
                _wait_for('estimating', own)
                time.sleep(seconds)
            if not (bag / 'metadata.yaml').is_file():
                raise RuntimeError(f'nothing recorded; {own}: {own.read_text().strip()}')
    return bags


def _wait_for(word: str, log: Path) -> None:
    end = time.monotonic() + TIMEOUT
    while word not in log.read_text():
        if time.monotonic() > end:
            raise RuntimeError(f'not ready; {log}: {log.read_text().strip()}')
        time.sleep(0.1)
