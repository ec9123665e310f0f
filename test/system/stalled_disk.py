"""Latency while the disk stalls: ``python test/system/stalled_disk.py [--seconds 12] [--stall 5] [--json]``.

Estimates at 1 kHz and records all seven topics, alternately on a normal disk and on one that blocks one write for
``--stall`` seconds. The latency of a sample runs from its due time until estimate and feed-forward are recorded; the
wake-up by the operating system is part of it. The result is the p99 of each stalled run over the mean of the quiet runs
before and after it; exit code 1 if the median of this ratio over ``--times`` runs is above 1.10.
"""

import argparse
import gc
import json
import os
import sys
import tempfile
import time
from itertools import pairwise
from pathlib import Path
from statistics import median

from kill_recorder import PERIOD, inputs
from rich.console import Console
from rich.table import Table
from rich.text import Text

from seal_friction_ros.core.estimation.pipeline import answered, init
from seal_friction_ros.files import default_configuration
from seal_friction_ros.nodes.estimator_node import SWITCH_INTERVAL
from seal_friction_ros.offline.bags import mcap_writer
from seal_friction_ros.offline.bags.actuator_bag import ANSWER_TOPICS
from seal_friction_ros.offline.bags.recorder import Recorder

P99 = 'p99 [ms]'
LARGEST_RATIO = 1.10


class StallingDisk:
    """Stands in for ``os`` in `mcap_writer`: blocks once for ``stall`` [s], ``after`` [s] from now."""

    def __init__(self, stall: float, after: float) -> None:
        self.stalls = 0
        self._stall, self._moment = stall, time.monotonic() + after

    def __getattr__(self, name: str) -> object:
        return getattr(os, name)

    def pwrite(self, handle: int, data: bytes, offset: int) -> int:
        """Write, after the stall if it is due."""
        if self._stall and not self.stalls and time.monotonic() > self._moment:
            self.stalls += 1
            time.sleep(self._stall)
        return os.pwrite(handle, data, offset)


def latencies(bag: Path, seconds: float, disk: StallingDisk) -> tuple[list[float], Recorder]:
    """Latency of each estimate [s], and the recorder, closed."""
    mcap_writer.os = disk
    parameters = default_configuration().parameters()
    state = init(parameters)
    recorder = Recorder(bag)
    found = []
    start, first = time.perf_counter_ns() + PERIOD, time.time_ns()
    for number in range(round(seconds * 1e9 / PERIOD)):
        due = start + number * PERIOD
        time.sleep(max(due - time.perf_counter_ns(), 0) * 1e-9)
        for topic, type_name, message, data in inputs(first + number * PERIOD, number):
            received = time.time_ns()
            recorder.record(topic, type_name, received, data)
            state, answers = answered(parameters, state, message, received)
            for answer_type, answer_data in answers:
                recorder.record(ANSWER_TOPICS[answer_type], answer_type, time.time_ns(), answer_data)
        found.append((time.perf_counter_ns() - due) * 1e-9)
        recorder.flush_if_idle()
    recorder.close()
    return found, recorder


def figures(found: list[float], recorder: Recorder, stalls: int) -> dict[str, float]:
    """Percentiles [ms] and counts."""
    ordered = sorted(found)
    shares = {'p50 [ms]': 0.5, P99: 0.99, 'p99.9 [ms]': 0.999}
    return {
        **{name: ordered[int(share * len(ordered))] * 1e3 for name, share in shares.items()},
        'largest [ms]': ordered[-1] * 1e3,
        'stalls': stalls,
        'written': recorder.written,
        'dropped': recorder.dropped,
    }


def measure(seconds: float, stall: float, times: int) -> tuple[list[dict[str, float]], list[dict[str, float]]]:
    """Figures of the quiet runs and of the stalled runs between them."""
    quiet, stalled = [], []
    for number in range(2 * times + 1):
        with tempfile.TemporaryDirectory() as folder:
            disk = StallingDisk(stall * (number % 2), after=seconds / 12.0)
            found, recorder = latencies(Path(folder) / 'bag', seconds, disk)
            (stalled if number % 2 else quiet).append(figures(found, recorder, disk.stalls))
    return quiet, stalled


def main() -> int:
    """Measure both alternately; print a table, or JSON."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n', maxsplit=1)[0])
    parser.add_argument('--seconds', type=float, default=12.0)
    parser.add_argument('--stall', type=float, default=5.0, help='[s]')
    parser.add_argument('--times', type=int, default=5)
    parser.add_argument('--json', action='store_true')
    arguments = parser.parse_args()
    gc.freeze()
    sys.setswitchinterval(SWITCH_INTERVAL)
    quiet, stalled = measure(arguments.seconds, arguments.stall, arguments.times)
    around = [(before[P99] + after[P99]) / 2.0 for before, after in pairwise(quiet)]
    ratios = [run[P99] / calm for run, calm in zip(stalled, around, strict=True)]
    ratio = median(ratios)
    if arguments.json:
        print(json.dumps({'quiet': quiet, 'stalled': stalled, 'p99 ratios': ratios, 'p99 ratio': ratio}))
        return int(ratio > LARGEST_RATIO)
    table = Table(title=f'{arguments.seconds:g} s at 1 kHz, a stall of {arguments.stall:g} s: medians of the runs')
    for heading in ('', f'{len(quiet)} quiet', f'{len(stalled)} stalled'):
        table.add_column(Text(heading), justify='right' if heading else 'left')
    for figure in quiet[0]:
        values = [median(run[figure] for run in runs) for runs in (quiet, stalled)]
        table.add_row(Text(figure), *(f'{value:.3f}' if 'ms' in figure else f'{value:g}' for value in values))
    Console().print(table)
    print('p99 stalled / quiet:', *(f'{one:.2f}' for one in sorted(ratios)), f'median {ratio:.2f}')
    return int(ratio > LARGEST_RATIO)


if __name__ == '__main__':
    sys.exit(main())
