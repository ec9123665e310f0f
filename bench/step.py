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
from seal_friction_ros.core.estimator import step
from seal_friction_ros.core.pipeline import Reference, encoded, init, receive
from seal_friction_ros.core.records import Force, Pressure, RodSample
from seal_friction_ros.core.wire import Velocity
from seal_friction_ros.files import default_configuration

CALLS = 2000
BATCHES = 15


def stages() -> dict[str, Callable[[], object]]:
    """Each stage of the live path but ROS's own, as a function without arguments."""
    parameters = default_configuration().parameters()
    pressure, force, velocity = Pressure(1, 3e6, 1e6), Force(1, 20.0), Velocity(1, 0.1, b'rod')
    sample = RodSample(1, 0.1, pressure, force)
    alone = init(parameters)._replace(pressure=pressure, force=force)
    guided = alone._replace(reference=Reference(1, 0.1, 0.0))
    _, answer = receive(parameters, alone, velocity)
    _, both = receive(parameters, guided, velocity)
    velocity_bytes, pressure_bytes = wire.encode_velocity(velocity), wire.encode_pressure(pressure, b'rod')
    return {
        'bare call': lambda: None,
        'decode pressure': lambda: wire.decode_pressure(pressure_bytes),
        'decode velocity': lambda: wire.decode_velocity(velocity_bytes),
        'receive pressure': lambda: receive(parameters, alone, pressure),
        'estimator step': lambda: step(parameters.estimator, alone.estimator, sample),
        'receive velocity': lambda: receive(parameters, alone, velocity),
        'receive velocity, with feed-forward': lambda: receive(parameters, guided, velocity),
        'encode estimate': lambda: [*encoded(answer)],
        'encode estimate and feed-forward': lambda: [*encoded(both)],
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
