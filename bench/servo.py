"""Real-time factor of the servo with seal friction by inner step: simulated time per computing time, without ROS.

    python bench/servo.py [--seconds 5] [--json]

``step``: one call per sample, as in node and tuning. ``simulate``: many samples in one call, as in the servo charts.
"""

import argparse
import json
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / 'test'))
from harness.campaign import show

from seal_friction_ros.core.servo.motions import Sine
from seal_friction_ros.core.servo.position_servo import ServoParameters, init, simulate, step
from seal_friction_ros.files import default_configuration

INNER_STEPS = (2e-4, 1e-4, 5e-5, 2.5e-5)  # [s]
PERIOD = 1e-3  # [s]


def factors(servo: ServoParameters, seconds: float) -> tuple[float, float]:
    """Real-time factors of `step` and of `simulate`; the best of three."""
    count = round(seconds / servo.control_period)
    references = [Sine().at(i * servo.control_period) for i in range(count)]
    simulate(servo, init(servo), references[:10])
    step(servo, init(servo), references[0])
    by_step = by_simulate = 0.0
    for _ in range(3):
        state, start = init(servo), time.perf_counter()
        for reference in references:
            state, _out = step(servo, state, reference)
        by_step = max(by_step, seconds / (time.perf_counter() - start))
        start = time.perf_counter()
        simulate(servo, init(servo), references)
        by_simulate = max(by_simulate, seconds / (time.perf_counter() - start))
    return by_step, by_simulate


def main() -> None:
    """Print the table, or JSON."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n', maxsplit=1)[0])
    parser.add_argument('--json', action='store_true', help='print JSON')
    parser.add_argument('--seconds', type=float, default=5.0, help='simulated time [s]')
    arguments = parser.parse_args()
    seals = default_configuration().parameters().estimator.seals
    rows = []
    for inner_step in INNER_STEPS:
        servo = ServoParameters(seals=seals, inner_step=inner_step, control_period=PERIOD)
        by_step, by_simulate = factors(servo, arguments.seconds)
        rows.append({'inner_step': inner_step, 'step': by_step, 'simulate': by_simulate})
    if arguments.json:
        print(json.dumps({'control_period': PERIOD, 'rows': rows}))
        return
    show(
        [
            {'inner step [us]': f'{1e6 * row["inner_step"]:.0f}', 'step': row['step'], 'simulate': row['simulate']}
            for row in rows
        ],
        f'Sample {PERIOD * 1e3:g} ms; times real time',
    )


if __name__ == '__main__':
    main()
