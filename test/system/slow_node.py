"""A node that is too slow, on an axis of its own physics: ``python test/system/slow_node.py [--shares 0.33] [--json]``.

The axis (``harness/hydraulic_axis.py``) moves in real time at 500 Hz; the node `machine_estimator` sends it the
feed-forward while SIGSTOP and SIGCONT leave it a share of a processor, then all of it. Required: tracking with the
feed-forward is at most `WORST` times that without, at any share, and good again within `RECOVERY` after the load.
"""

import json
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import NamedTuple

sys.path.insert(0, str(Path(__file__).parents[1]))
from harness import hydraulic_axis
from harness.campaign import parser_of, tell
from harness.processes import free_domain, graph_environment, node_process

SHARES = (1.0, 0.5, 0.33, 0.2, 0.1)
PERIOD = 0.012  # [s] of a share
SETTLING, SLOW, AFTER = 6.0, 12.0, 6.0  # [s]
WORST = 1.05  # [-] tracking error over that without feed-forward
RECOVERY = 1.0  # [s]
WITHIN = 1.5  # [-] of the largest error of a quarter of a second before is good again


class Line(NamedTuple):
    """A quarter of a second of the axis."""

    time: float  # [s] of the monotonic clock
    rms: float  # [m] tracking error
    force: float  # [N] newest command


class Found(NamedTuple):
    """Tracking errors of one run [m], and the time until it was good again after the load [s]."""

    before: float
    slow: float
    recovery: float


@contextmanager
def axis(domain: int) -> Iterator[list[Line]]:
    """The axis in a process of its own, and the lines that it has said."""
    lines: list[Line] = []
    command = [sys.executable, hydraulic_axis.__file__]
    process = subprocess.Popen(command, env=graph_environment(domain), stdout=subprocess.PIPE, text=True)

    def read() -> None:
        """Keep each line when it comes."""
        lines.extend(Line(**json.loads(text)) for text in process.stdout or ())

    thread = threading.Thread(target=read, daemon=True)
    thread.start()
    try:
        yield lines
    finally:
        process.send_signal(signal.SIGINT)
        process.wait()


def hold_up(process: subprocess.Popen[bytes], share: float, seconds: float) -> None:
    """Leave a process a share of a processor for a while."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if share < 1.0:
            process.send_signal(signal.SIGSTOP)
            time.sleep(PERIOD * (1.0 - share))
            process.send_signal(signal.SIGCONT)
        time.sleep(PERIOD * share)


def rms(lines: list[Line], first: float, last: float) -> float:
    """Tracking error [m] from a time to another, without the first second."""
    found = [line.rms**2 for line in lines if first + 1.0 < line.time <= last]
    return (sum(found) / len(found)) ** 0.5


def run(share: float, scale: float) -> Found:
    """Tracking of the axis with a gain of the feed-forward, before, while and after the node is slow."""
    domain = free_domain()
    with tempfile.TemporaryDirectory() as name, ExitStack() as stack:
        folder = Path(name)
        values = {'machine': str(hydraulic_axis.write_machine(folder)), 'boom.feedforward.scale': scale}
        process = stack.enter_context(node_process('machine_estimator', domain, values, folder / 'log'))
        lines = stack.enter_context(axis(domain))
        while not lines or (scale and not any(line.force for line in lines)):
            time.sleep(0.1)
        time.sleep(SETTLING)
        begin = time.monotonic()
        hold_up(process, share, SLOW)
        end = time.monotonic()
        time.sleep(AFTER)
        good = WITHIN * max(line.rms for line in lines if begin - SETTLING + 1.0 < line.time <= begin)
        slow = [line.time for line in lines if line.time > end and line.rms > good]
        return Found(rms(lines, begin - SETTLING, begin), rms(lines, begin, end), max(slow, default=end) - end)


def main() -> int:
    """Run all shares; print the table, or JSON; 1 if a requirement does not hold."""
    parser = parser_of(__doc__)
    parser.add_argument('--shares', type=float, nargs='+', default=SHARES)
    arguments = parser.parse_args()
    without = run(1.0, 0.0).slow
    found = {share: run(share, 0.9) for share in arguments.shares}
    rows = {
        f'{share:g}': {
            'with feed-forward [mm]': one.slow * 1e3,
            'without [mm]': without * 1e3,
            'before [mm]': one.before * 1e3,
            'good again after [s]': one.recovery,
        }
        for share, one in found.items()
    }
    tell(rows, as_json=arguments.json, title='shares of a processor')
    return int(any(one.slow > WORST * without or one.recovery > RECOVERY for one in found.values()))


if __name__ == '__main__':
    sys.exit(main())
