"""Time of the finite-element O-ring by mesh: ``python bench/oring.py [--lines 13 17 25 33 41 49] [--json]``.

The thesis's ring, calibrated, at its five pressures. Processor times of one core, of this process only.
"""

import argparse
import dataclasses
import sys
from pathlib import Path

from one_core import processor_time

sys.path.insert(0, str(Path(__file__).parents[1] / 'test'))
from harness.campaign import tell

from seal_friction_ros.core.oring_contact.loading import oring_model
from seal_friction_ros.core.oring_contact.oring_case import OringNumerics
from seal_friction_ros.core.oring_contact.oring_case_file import parse_oring_case
from seal_friction_ros.core.oring_contact.results import oring_results
from seal_friction_ros.files import config_path, read_yaml

LINES = (13, 17, 25, 33, 41, 49)


def measure(lines: int) -> dict[str, float]:
    """Size of the problem, Newton steps and time of all pressures."""
    file = parse_oring_case(read_yaml(config_path('oring', 'ms28775_114')))
    case = dataclasses.replace(file.case, numerics=OringNumerics(lines=lines))
    begin = processor_time()
    results = list(oring_results(case, file.pressures))
    return {
        'lines': lines,
        'unknowns': oring_model(case).mesh.nodes.size,
        'Newton steps': sum(result.newton_steps for result in results),
        'time [s]': processor_time() - begin,
    }


def main() -> int:
    """Measure; print the table, or JSON."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n', maxsplit=1)[0])
    parser.add_argument('--json', action='store_true')
    parser.add_argument('--lines', type=int, nargs='+', default=LINES, help='meshes')
    arguments = parser.parse_args()
    measure(9)  # the first run loads libraries and is not counted
    rows = [measure(lines) for lines in arguments.lines]
    tell(rows, as_json=arguments.json, title='Meshes')
    return 0


if __name__ == '__main__':
    sys.exit(main())
