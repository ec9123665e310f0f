"""``make demo``: real friction readings through the live node on a real graph, recorded, replayed, reported.

Plays the thesis's pull test and, where they are, the runs of the O-ring rig into the estimator, in separate processes;
then closes the loop with the simulated servo, without feed-forward and with it; verifies each recording byte for byte;
writes a report for each; ends with measured against estimated friction and with how the servo tracked.
"""

import shutil
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console
from rich.table import Table
from rich.text import Text

from seal_friction_ros.core.units import BAR
from seal_friction_ros.files import config_path
from seal_friction_ros.nodes.closed_loop import close_loop_live
from seal_friction_ros.nodes.processes import free_domain, play_live
from seal_friction_ros.offline.bag_evaluation import evaluate, read_run
from seal_friction_ros.offline.import_log import import_log
from seal_friction_ros.offline.import_thesis import import_thesis
from seal_friction_ros.offline.replay import replay
from seal_friction_ros.offline.report import write_report
from seal_friction_ros.offline.servo_charts import write_servo_charts
from seal_friction_ros.offline.tracking_evaluation import TrackingEvaluation, evaluate_tracking

ROOT = Path(__file__).parents[1]
OUT = ROOT / 'build' / 'demo'
RIG_LOGS = ROOT.parent / 'shared' / 'data' / 'delft'
PULL_TEST_RATE = 10.0  # [times the pace of the data] 100 Hz of readings become the 1 kHz of a servo controller
LOOP_TIME = 10.0  # [s] without feed-forward, and as long with it
RIG_RATE = 25.0  # [times the pace of the data] the runs last minutes


@dataclass(frozen=True)
class Run:
    """One bag played live."""

    name: str
    figures: dict[str, str]
    identical: bool
    bag: Path
    report: Path


def inputs(folder: Path) -> Iterator[tuple[Path, float, dict[str, object]]]:
    """Bags to play, made from measurements, with the rate and the parameters of the estimator for each."""
    import_thesis(folder / 'pull_test')
    yield folder / 'pull_test', PULL_TEST_RATE, {}
    rig = {'seals': [str(config_path('seals', 'delft_o_ring'))], 'seal_chambers': ['a']}
    for log in sorted(RIG_LOGS.glob('O-ring*.csv')):
        import_log(log, config_path('rigs', 'delft'), folder / log.stem)
        yield folder / log.stem, RIG_RATE, rig


def run_live(bag: Path, rate: float, parameters: dict[str, object]) -> Run:
    """Play one bag live, verify what was recorded, report it."""
    recorded = OUT / bag.name
    figures = play_live(bag, recorded, free_domain(), rate, parameters)
    identical = replay(recorded).identical
    report = OUT / f'{bag.name}.html'
    write_report(recorded, report)
    return Run(bag.name, figures, identical, recorded, report)


def close_loop() -> tuple[Run, TrackingEvaluation]:
    """Close the loop live, verify what was recorded, report it; the run, and how the servo tracked in each half."""
    bag = OUT / 'closed_loop'
    figures = close_loop_live(bag, free_domain(), LOOP_TIME, ROOT / 'config' / 'servo_simulator.yaml')
    report = OUT / 'closed_loop.html'
    write_report(bag, report)
    evaluation = evaluate_tracking(read_run(bag))
    assert evaluation is not None  # the simulator sends reference and position
    return Run(bag.name, figures, replay(bag).identical, bag, report), evaluation


def friction_table(runs: list[Run]) -> Table:
    """Measured and estimated Coulomb friction at every pressure of every run."""
    table = Table(title='Coulomb friction, measured and estimated live')
    for heading in ('run', 'pressure [bar]', 'measured [N]', 'estimated [N]', 'std [N]', 'deviation [%]'):
        table.add_column(Text(heading), justify='left' if heading == 'run' else 'right')
    for run in runs:
        for level in evaluate(read_run(run.bag)).friction.sliding:
            deviation = 'none' if level.deviation_percent is None else f'{level.deviation_percent:+.1f}'
            numbers = (level.pressure / BAR, level.measured, level.estimated, level.estimated_std)
            table.add_row(run.name, *(f'{number:.2f}' for number in numbers), deviation)
    return table


def run_table(runs: list[Run]) -> Table:
    """How long an estimate took, and whether the replay gave the same bytes."""
    table = Table(title='Live runs: velocity sample out, estimate back')
    for heading in ('run', 'samples', 'p50 [us]', 'p99 [us]', 'replay', 'bag', 'report'):
        table.add_column(Text(heading), justify='right' if heading.startswith(('p', 's')) else 'left', overflow='fold')
    for run in runs:
        f = run.figures
        verdict = 'identical' if run.identical else 'DIFFERENT'
        figures = (f.get(name, '') for name in ('velocity samples', 'round trip p50 [us]', 'round trip p99 [us]'))
        table.add_row(run.name, *figures, verdict, *(str(p.relative_to(ROOT)) for p in (run.bag, run.report)))
    return table


def tracking_table(loop: Run, evaluation: TrackingEvaluation) -> Table:
    """How the servo tracked without and with feed-forward, and what that cost."""
    missed = f'{loop.figures.get("missed ticks")} of {loop.figures.get("ticks")} ticks missed'
    share = f'{loop.figures.get("share of a core [%]")} % of a core'
    title = f'Closed loop at {loop.figures.get("rate [Hz]")} Hz; simulator: {share}, {missed}'
    table = Table(title=title)
    for heading in ('feed-forward', 'RMS [um]', 'peak [um]', 'rest per reversal [ms]', 'RMS [%]', 'rest [%]'):
        table.add_column(Text(heading), justify='left' if heading == 'feed-forward' else 'right')
    for stretch in evaluation.stretches:
        name = f'up to {stretch.feedforward_peak:.0f} N' if stretch.has_feedforward else 'none'
        dwell = 'no reversal' if stretch.dwell is None else f'{stretch.dwell * 1e3:.1f}'
        changes = ('' if c is None else f'{c:+.0f}' for c in (stretch.rms_change, stretch.dwell_change))
        table.add_row(name, f'{stretch.rms * 1e6:.0f}', f'{stretch.peak * 1e6:.0f}', dwell, *changes)
    return table


def main() -> int:
    """Run it all; 0 if every replay gave the recorded bytes."""
    started = time.monotonic()
    console = Console(width=None if sys.stdout.isatty() else 120)
    shutil.rmtree(OUT, ignore_errors=True)
    runs = []
    for bag, rate, parameters in inputs(OUT / 'inputs'):
        console.print(f'playing {bag.name} ...')
        runs.append(run_live(bag, rate, parameters))
    if len(runs) == 1:
        console.print(f'no rig logs at {RIG_LOGS.relative_to(ROOT.parent)}: only the pull test was played')
    console.print(f'closing the loop with the simulated servo for {2 * LOOP_TIME:.0f} s ...')
    loop, tracking = close_loop()
    write_servo_charts(OUT / 'servo.html')
    console.print(friction_table(runs), run_table([*runs, loop]), tracking_table(loop, tracking))
    console.print(f'Figure 25, with and without friction: {(OUT / "servo.html").relative_to(ROOT)}')
    console.print(f'{time.monotonic() - started:.0f} s in all')
    return 0 if all(run.identical for run in (*runs, loop)) else 1


if __name__ == '__main__':
    sys.exit(main())
