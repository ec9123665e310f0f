"""What one step of a control loop costs in C: ``python bench/loop.py [--steps 1000000] [--json]``.

A rod that slides to and fro at 1 kHz with noise, adaptation on; the C library times each of its own steps. The worst
is that of the machine, too; undisturbed is the worst step when each counts with the least time of five equal runs. The
ratio is to `Estimator.step` of Python in the same run.
"""

import dataclasses
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from statistics import median

sys.path.insert(0, str(Path(__file__).parents[1] / 'test'))
from harness.campaign import parser_of, tell
from harness.compensation import compensating

from seal_friction_ros import Estimator
from seal_friction_ros.offline.export.c_library import export_c

PYTHON_STEPS = 3000
TIMER = """
#define _POSIX_C_SOURCE 199309L
#include "seal_friction.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>
static double now(void) { struct timespec t; clock_gettime(CLOCK_MONOTONIC, &t); return 1e9 * t.tv_sec + t.tv_nsec; }
static int above(const void *a, const void *b) { return (*(double *)a > *(double *)b) - (*(double *)a < *(double *)b); }
static seal_friction_pipeline_state state;
static double timed(long i)
{
    static unsigned noise = 1;
    if (i == 0) { noise = 1; seal_friction_init(&state); }
    noise = noise * 1664525u + 1013904223u;
    double side = i / 1000 % 2 ? -1.0 : 1.0, ripple = noise / 4294967296.0 - 0.5;
    seal_friction_loop_sample sample = {1000000 * (int64_t)(i + 1), side * (0.05 + 1e-3 * ripple), 3e6, 1e6,
                                        side * 40.0 + ripple, side * 0.05, 0.0, NAN};
    seal_friction_answers answers;
    double before = now();
    seal_friction_step(&state, &sample, &answers);
    return now() - before;
}
int main(int argc, char **argv)
{
    long steps = argc > 1 ? atol(argv[1]) : 1000;
    double *first = malloc(steps * sizeof *first), *least = malloc(steps * sizeof *least);
    for (long i = 0; i < steps; i++) first[i] = least[i] = timed(i);
    for (int round = 0; round < 4; round++)
        for (long i = 0; i < steps; i++) { double t = timed(i); if (t < least[i]) least[i] = t; }
    qsort(first, steps, sizeof *first, above);
    qsort(least, steps, sizeof *least, above);
    printf("{\\"median\\": %g, \\"p99\\": %g, \\"worst\\": %g, \\"worst, undisturbed\\": %g}\\n", first[steps / 2],
           first[steps * 99 / 100], first[steps - 1], least[steps - 1]);
    return 0;
}
"""


def in_c(folder: Path, steps: int) -> dict[str, float]:
    """Times of a step of the library [us]."""
    configuration = compensating(presliding=True)
    adaptation = dataclasses.replace(configuration.adaptation, mode='on', moving_mass=20.0)
    export_c(dataclasses.replace(configuration, adaptation=adaptation), folder)
    (folder / 'timer.c').write_text(TIMER)
    build = ['cc', '-std=c11', '-O2', '-o', 'timer', 'timer.c', 'libseal_friction.a', '-lm']
    subprocess.run(build, cwd=folder, check=True)
    run = subprocess.run(['./timer', str(steps)], cwd=folder, check=True, capture_output=True, text=True)
    return {name: value / 1e3 for name, value in json.loads(run.stdout).items()}


def in_python() -> float:
    """Median time of a step of Python [us]."""
    configuration = compensating(presliding=True)
    adaptation = dataclasses.replace(configuration.adaptation, mode='on', moving_mass=20.0)
    estimator = Estimator(configuration=dataclasses.replace(configuration, adaptation=adaptation))
    times = []
    for i in range(PYTHON_STEPS):
        side = -1.0 if i // 1000 % 2 else 1.0
        before = time.perf_counter()
        estimator.step((i + 1) * 1e-3, side * 0.05, 3e6, 1e6, side * 40.0, reference_velocity=side * 0.05)
        times.append(time.perf_counter() - before)
    return 1e6 * median(times)


def main() -> None:
    """Time both and print."""
    arguments = parser_of(__doc__ or '', steps=(1_000_000, 'steps in C')).parse_args()
    with tempfile.TemporaryDirectory() as folder:
        found = in_c(Path(folder), arguments.steps)
    python = in_python()
    figures = {f'C, {name} [us]': value for name, value in found.items()}
    rows = {'step': {**figures, 'Python, median [us]': python, 'ratio': python / found['median']}}
    tell(rows, as_json=arguments.json, title='One step of a loop')


if __name__ == '__main__':
    main()
