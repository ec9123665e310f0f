"""The live view of three actuators at 1 kHz, for long: ``python test/system/monitor_soak.py [--minutes 10] [--json]``.

Drivers, estimator and monitor run in processes of their own; a reader takes every frame of the page, as a browser does.
Memory, file handles and threads of the monitor are read every ``--look`` seconds. Exit code 1 if memory grows by more
than 5 MB after the first minute (or the first third of a shorter run), if a handle or a thread is left over, or if the
page gets fewer than 18 frames a second or no new rows.
"""

import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import Progress
from soak import SETTLED, Look, look

sys.path.insert(0, str(Path(__file__).parents[1]))
from harness.campaign import parser_of, tell
from harness.monitor_process import Reader, monitor
from harness.moving_machine import machine
from harness.processes import free_domain

LARGEST_GROWTH = 5.0  # [MB]
FEWEST_FRAMES = 18.0  # [1/s] of 20


def soak(minutes: float, look_every: float, folder: Path) -> dict[str, Any]:
    """Run, and look at the monitor every ``look_every`` [s]."""
    domain, looks = free_domain(), list[Look]()
    with (
        machine(folder, domain),
        monitor(domain) as watching,
        Progress(console=Console(stderr=True)) as progress,
    ):
        reader = Reader(watching.url)
        end = time.monotonic() + 60.0
        while not reader.rows:
            if time.monotonic() > end:
                raise RuntimeError(f'no rows: {(folder / "log").read_text()}')
            time.sleep(0.1)
        start, task = time.monotonic(), progress.add_task('soak', total=60.0 * minutes)
        frames, rows = reader.frames, reader.rows
        while time.monotonic() < start + 60.0 * minutes:
            time.sleep(look_every)
            looks.append(look(watching.process.pid, start))
            progress.update(task, completed=time.monotonic() - start)
        seconds = time.monotonic() - start
        found = {
            'frames [1/s]': round((reader.frames - frames) / seconds, 1),
            'rows [1/s]': round((reader.rows - rows) / seconds, 1),
            'seconds': round(seconds, 1),
        }
    settled = [one for one in looks if one.time >= min(SETTLED, looks[-1].time / 3.0)]
    return {
        'monitor memory at first [MB]': round(settled[0].memory, 1),
        'monitor memory at last [MB]': round(settled[-1].memory, 1),
        'monitor memory growth [MB]': round(max(one.memory for one in settled) - settled[0].memory, 2),
        'monitor handles more': settled[-1].handles - settled[0].handles,
        'monitor threads more': settled[-1].threads - settled[0].threads,
        **found,
    }


def violations(found: dict[str, Any]) -> list[str]:
    """Limits that are exceeded."""
    wrong = [f'{key} = {value}' for key, value in found.items() if key.endswith(' more') and value > 0]
    if found['monitor memory growth [MB]'] > LARGEST_GROWTH:
        wrong.append(f'monitor memory growth [MB] = {found["monitor memory growth [MB]"]}')
    if found['frames [1/s]'] < FEWEST_FRAMES or not found['rows [1/s]']:
        wrong.append(f'{found["frames [1/s]"]} frames and {found["rows [1/s]"]} rows a second')
    return wrong


def main() -> int:
    """Run; print the figures and the limits exceeded."""
    parser = parser_of(__doc__, minutes=(10.0, 'of the run'), look=(2.0, 'time between two looks [s]'))
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        found = soak(arguments.minutes, arguments.look, Path(folder))
    wrong = violations(found)
    tell(
        {**found, 'violations': wrong},
        as_json=arguments.json,
        title=f'{arguments.minutes:g} minutes, three actuators at 1 kHz',
    )
    return int(bool(wrong))


if __name__ == '__main__':
    sys.exit(main())
