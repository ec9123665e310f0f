"""Picture of the live view of a simulated axis, for the README: ``python tools/monitor_picture.py OUT.png``."""

import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / 'test'))
from harness.browser import browser, chromium
from harness.monitor_process import monitor
from harness.processes import free_domain, node_process
from paths import ROOT

SIZE = (1400, 765)  # [px] the first four plots
PATIENCE = 120.0  # [s] until the simulator runs: it may compile first
SEALS = {'seals': ['ms28775_114@a', 'ms28775_114@b']}
UNDISTURBED = (
    'columns.status.slice(-500).every((bits) => (bits & ~0xa0000) === 0)'
    ' && now.verdict === "good" && /^sliding/.test(byId("state").textContent)'
)
"""The rod slides, and for 5 s there was no bit but those of every reversal: the machine is not busy otherwise."""
MOTION = {'sine.amplitude': 0.004, 'sine.frequency': 1.0}  # [m], [Hz]


def draw_monitor(path: Path) -> None:
    """Draw it, with nodes, monitor and browser as processes of their own.

    Raises:
        RuntimeError: Chromium is not installed, or the simulator does not run.
    """
    if not chromium():
        raise RuntimeError('chromium is not installed: apt-get install chromium')
    domain, simulator = free_domain(), ROOT / 'config' / 'servo_simulator.yaml'
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        log = folder / 'log'
        with (
            node_process('servo_simulator', domain, {**SEALS, **MOTION}, log, parameter_file=simulator),
            node_process(
                'friction_estimator', domain, {**SEALS, 'adaptation.mode': 'observe', 'feedforward.scale': 0.9}, log
            ),
            monitor(domain, '--allow-changes') as watching,
            browser(folder) as page,
        ):
            end = time.monotonic() + PATIENCE
            while 'simulating' not in log.read_text():
                if time.monotonic() > end:
                    raise RuntimeError(log.read_text())
                time.sleep(0.1)
            page.size(*SIZE)
            page.call('Emulation.setScrollbarsHidden', hidden=True)
            page.open(watching.url)
            page.wait_for('columns.error && columns.error.filter((value) => value !== null).length > 1500')
            page.wait_for(UNDISTURBED)
            page.screenshot(path)


if __name__ == '__main__':
    draw_monitor(Path(sys.argv[1]))
