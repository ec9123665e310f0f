"""What one sample costs, stage by stage: ``make bench``, or ``python bench/step.py [--json]``.

Medians over batches, in one run; the ratio to a bare function call is what can be compared between machines.
"""

import argparse
import json
import sys
import timeit
from collections.abc import Callable
from statistics import median

from rich.console import Console
from rich.table import Table
from rich.text import Text

from seal_friction_ros.core import wire
from seal_friction_ros.core.configuration import SealSelection
from seal_friction_ros.core.estimator import EstimatorSettings, init, step
from seal_friction_ros.core.held_inputs import HeldInputs
from seal_friction_ros.core.records import Force, Pressure
from seal_friction_ros.core.wire import Velocity
from seal_friction_ros.files import load_configuration

CALLS = 2000
BATCHES = 15


def stages() -> dict[str, Callable[[], object]]:
    """Each stage of the live path but ROS's own, as a function without arguments."""
    parameters = load_configuration(SealSelection(), EstimatorSettings()).parameters()
    state = init(parameters)
    held = HeldInputs(Pressure(1, 3e6, 1e6), Force(1, 20.0))
    sample = held.rod_sample(1, 0.1)
    _, estimate = step(parameters, state, sample)
    velocity_bytes = wire.encode_velocity(Velocity(1, 0.1, b'rod'))
    pressure_bytes = wire.encode_pressure(Pressure(1, 3e6, 1e6), b'rod')
    return {
        'bare call': lambda: None,
        'decode pressure': lambda: wire.decode_pressure(pressure_bytes),
        'decode velocity': lambda: wire.decode_velocity(velocity_bytes),
        'hold and sample': lambda: held.rod_sample(1, 0.1),
        'step': lambda: step(parameters, state, sample),
        'encode estimate': lambda: wire.encode_estimate(estimate, b'rod'),
    }


def main() -> int:
    """Time every stage and print a table, or JSON."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n', maxsplit=1)[0])
    parser.add_argument('--json', action='store_true')
    as_json = parser.parse_args().json
    batches: dict[str, list[float]] = {name: [] for name in stages()}
    for _ in range(BATCHES):  # in turn, so that a slow moment of the machine hits all of them
        for name, stage in stages().items():
            batches[name].append(timeit.timeit(stage, number=CALLS) / CALLS * 1e6)
    figures = {name: median(times) for name, times in batches.items()}
    if as_json:
        print(json.dumps({f'{name} [us]': time for name, time in figures.items()}))
        return 0
    table = Table(title=f'One sample, median of {BATCHES} batches of {CALLS}')
    for heading in ('stage', 'time [us]', 'bare calls'):
        table.add_column(Text(heading), justify='left' if heading == 'stage' else 'right')
    for name, time in figures.items():
        table.add_row(name, f'{time:.2f}', f'{time / figures["bare call"]:.0f}')
    Console().print(table)
    return 0


if __name__ == '__main__':
    sys.exit(main())
