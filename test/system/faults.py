"""The fault campaign: ``python test/system/faults.py [--times 20] [--only TEXT] [--seed 1] [--json]``.

Tries each fault several times on the live node and prints a table of what is required and what happened. The faults of
a signal are in ``fault_rows.py``, the others in ``graph_faults.py`` and ``process_faults.py``.
"""

import argparse
import json
import random
import sys
import tempfile
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console
from rich.progress import track
from rich.table import Table

sys.path.insert(0, str(Path(__file__).parents[1]))
import graph_faults as graph
import process_faults as process
from fault_rows import SIGNAL_ROWS
from fault_stage import stage, try_row

REQUIRED = ('estimate', 'feed-forward', 'status and diagnostics', 'recording')


@dataclass(frozen=True)
class Trial:
    """A fault of graph, process or disk, and the requirements."""

    fault: str
    estimate: str
    feedforward: str
    diagnostics: str
    """status bits and diagnostics"""
    recording: str
    """``-`` where nothing is recorded"""
    attempt: Callable[[random.Random, Path], list[str]]
    """one try with an empty folder; differences from the requirements"""

    @property
    def required(self) -> tuple[str, ...]:
        """The requirements, column by column of ``REQUIRED``."""
        return self.estimate, self.feedforward, self.diagnostics, self.recording


TRIALS = (
    Trial(
        'an input has no publisher at first',
        'UNKNOWN until it has',
        '0 until it has',
        '`PRESSURE_MISSING` until it has',
        '-',
        graph.topic_comes_late,
    ),
    Trial(
        'an input has a second publisher',
        'UNKNOWN',
        'fades to 0',
        '`INPUT_REFUSED`; ERROR: both named',
        '-',
        graph.second_publisher,
    ),
    Trial(
        'an input has a second publisher, `refuse_second_publisher: false`',
        'as usual',
        'as usual',
        'WARN: both named',
        '-',
        graph.second_publisher_allowed,
    ),
    Trial(
        'incompatible quality of service or type',
        'as usual, with best effort',
        'as usual',
        'WARN: node named',
        '-',
        graph.incompatible_quality,
    ),
    Trial(
        'a second estimator of the same name',
        'UNKNOWN',
        'fades to 0',
        '`INPUT_REFUSED`; ERROR: both named',
        '-',
        graph.second_estimator,
    ),
    Trial(
        'parameters change in motion',
        'as usual',
        'no jump',
        'invalid values are rejected',
        'verifies',
        graph.parameters_change,
    ),
    Trial(
        'lifecycle transitions in any order',
        'as usual when active again',
        'no jump while active',
        'legal ones succeed, others are rejected',
        '-',
        graph.lifecycle_in_any_order,
    ),
    Trial(
        'simulated time is reset',
        'as usual, the first one marked',
        'as usual',
        '`STAMP_NOT_INCREASING` once',
        'verifies',
        graph.simulated_time_is_reset,
    ),
    Trial(
        'simulated time stands still',
        'as usual, marked',
        'fades to 0',
        '`LATE_INPUT`; ERROR: `/clock` named',
        'verifies',
        graph.simulated_time_stands_still,
    ),
    Trial(
        '50 more topics on the graph',
        'every sample answered',
        'as usual',
        'as usual',
        '-',
        graph.fifty_more_topics,
    ),
    Trial(
        '10 kHz on a node made for 1 kHz',
        'one per sample taken',
        'no jump',
        'missing samples are counted',
        'verifies',
        process.burst,
    ),
    Trial('SIGINT', 'ends', 'fades to 0, then ends', 'exit code 0', 'finished, verifies', process.interrupted),
    Trial('SIGTERM', 'ends', 'fades to 0, then ends', 'exit code 0', 'finished, verifies', process.terminated),
    Trial('SIGKILL', 'ends', 'ends', 'none', 'recovered up to 1 s before, verifies', process.killed),
    Trial(
        'SIGSTOP and SIGCONT',
        'goes on',
        'goes on without a jump',
        'each sample answered or counted missing',
        'verifies',
        process.stopped_and_continued,
    ),
    Trial('disk full', 'as usual', 'as usual', 'recorder: the error of the disk', 'valid; verifies', process.disk_full),
    Trial(
        'disk nearly full, later with room again',
        'as usual',
        'as usual',
        'recorder: ERROR until there is room',
        'two bags, both verify',
        process.disk_nearly_full,
    ),
    Trial('disk read-only', 'as usual', 'as usual', 'recorder: the error of the disk', 'none', process.read_only),
    Trial(
        'folder of the bag removed',
        'as usual',
        'as usual',
        'recorder: ERROR, recording stopped',
        'gone',
        graph.directory_removed,
    ),
    Trial(
        'a disk that stalls', 'as usual, none waits', 'as usual', 'as usual', 'complete, verifies', graph.disk_stalls
    ),
)


def attempt(trial: Trial, seed: int) -> list[str]:
    """One try; an exception is a difference from the requirements, too."""
    with tempfile.TemporaryDirectory() as folder:
        try:
            return trial.attempt(random.Random(seed), Path(folder))  # noqa: S311  no secret depends on it
        except Exception:  # noqa: BLE001  every exception counts
            return [traceback.format_exc(limit=-3)]


def main() -> int:
    """Try every fault; print the table, or JSON."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n', maxsplit=1)[0])
    parser.add_argument('--times', type=int, default=20, help='tries of each fault')
    parser.add_argument('--only', default='', help='only faults with this text in their name')
    parser.add_argument('--seed', type=int, default=1)
    parser.add_argument('--json', action='store_true')
    arguments = parser.parse_args()
    results, progress = {}, Console(stderr=True)
    with stage() as place:
        for row in track([r for r in SIGNAL_ROWS if arguments.only in r.fault], 'signals', console=progress):
            happened = [try_row(place, row) for _ in range(arguments.times)]
            diagnostics = f'{row.status or "no bit"}; {row.level}'
            results[row.fault] = ((row.estimate, row.feedforward, diagnostics, '-'), happened)
    for trial in track([t for t in TRIALS if arguments.only in t.fault], 'graph, process, disk', console=progress):
        happened = [attempt(trial, arguments.seed + number) for number in range(arguments.times)]
        results[trial.fault] = (trial.required, happened)
    if arguments.json:
        print(json.dumps({fault: happened for fault, (_, happened) in results.items()}))
    else:
        Console(width=200).print(_table(results))
    return int(any(wrong for _, happened in results.values() for wrong in happened))


def _table(results: dict[str, tuple[tuple[str, ...], list[list[str]]]]) -> Table:
    table = Table('fault', *REQUIRED, 'tries', 'result', title='Fault campaign')
    for fault, (required, happened) in results.items():
        bad = [difference for wrong in happened for difference in wrong[:1]]
        result = 'as required' if not bad else f'{len(bad)} not: {bad[0]}'
        table.add_row(fault, *required, str(len(happened)), result)
    return table


if __name__ == '__main__':
    sys.exit(main())
