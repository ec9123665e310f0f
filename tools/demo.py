"""``make demo``: real friction readings through the live node on a real graph, recorded, replayed, reported.

Plays the thesis's pull test and, where they are, the runs of the O-ring rig into the estimator, in separate processes;
then closes the loop with the simulated servo, without feed-forward and with it, and with a machine that has standard
messages only; verifies each recording byte for byte; writes a report for each; ends with measured against estimated
friction and with how servo and machine tracked.
"""

import os
import shutil
import sys
import time
from collections.abc import Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path

from rich.console import Console
from rich.table import Table
from rich.text import Text

sys.path.insert(0, str(Path(__file__).parents[1] / 'test'))
from harness import compiled_code  # noqa: F401  before anything is compiled: each process would compile the plant anew
from harness.live_closed_loop import record_closed_loop
from harness.live_machine import record_machine
from harness.processes import free_domain, play_live

from seal_friction_ros.core.foundation.units import BAR
from seal_friction_ros.files import config_path
from seal_friction_ros.offline.bags.import_bag import convert_bag
from seal_friction_ros.offline.bags.import_log import convert_log
from seal_friction_ros.offline.bags.import_thesis import import_thesis
from seal_friction_ros.offline.bags.mapped_bag import read_mapping
from seal_friction_ros.offline.bags.rig_file import read_rig
from seal_friction_ros.offline.replay.replay import replay
from seal_friction_ros.offline.reports.bag_report import write_report
from seal_friction_ros.offline.reports.page import ReportSummary
from seal_friction_ros.offline.reports.servo_charts import write_servo_charts
from seal_friction_ros.offline.work.computer import realtime_granted

ROOT = Path(__file__).parents[1]
OUT = ROOT / 'build' / 'demo'
LOOP_BAG = OUT / 'closed_loop'
SERVO_PAGE = OUT / 'servo.html'
RIG_LOGS = ROOT.parent / 'shared' / 'data' / 'delft'
PULL_TEST_RATE = 10.0  # [times the pace of the data] 100 Hz of readings become the 1 kHz of a servo controller
LOOP_TIME = 10.0  # [s] without feed-forward, and as long with it
MACHINE, MACHINE_TIME = 'simulated_bench', 5.0  # mapping file; [s] without feed-forward, and as long with it
SIMULATED_MACHINE = ROOT / 'config' / 'simulated_machines' / 'single_rod_cylinder.yaml'
REALTIME_PRIORITY = 50  # where the system grants it
RIG_RATE = 30.0  # [times the pace of the data] the runs last minutes
MOST_LOAD = 0.5  # [-] of the cores, by others before the demo (our choice)
MOST_MISSED = 0.01  # [-] of the ticks of the simulator (our choice)


@dataclass(frozen=True)
class Run:
    """One bag recorded live."""

    bag: Path
    figures: dict[str, str]
    """what was measured meanwhile"""
    identical: bool
    """whether its replay gave the same bytes"""
    report: ReportSummary


def inputs(folder: Path) -> Iterator[tuple[Path, float, dict[str, object]]]:
    """Bags to play, made from measurements, with the rate and the parameters of the estimator for each."""
    import_thesis(folder / 'pull_test')
    yield folder / 'pull_test', PULL_TEST_RATE, {'seals': ['ms28775_114', 'ms28775_114']}
    rig = {'seals': [f'{config_path("seals", "delft_o_ring")}@a']}
    for log in sorted(RIG_LOGS.glob('O-ring*.csv')):
        convert_log(log, folder / log.stem, read_rig(config_path('rigs', 'delft')))
        yield folder / log.stem, RIG_RATE, rig


def priority() -> int:
    """Real-time priority of the nodes: none where the system does not grant it."""
    return REALTIME_PRIORITY if realtime_granted() else 0


def identical(bag: Path) -> bool:
    """Whether the replay of a recording gives the same bytes."""
    return replay(bag).identical


def play_all(console: Console) -> Iterator[tuple[Path, dict[str, str]]]:
    """Play every bag live, one after the other; what was recorded, and what was measured meanwhile."""
    for inputs_bag, rate, parameters in inputs(OUT / 'inputs'):
        console.print(f'playing {inputs_bag.name} ...')
        bag = OUT / inputs_bag.name
        yield bag, play_live(inputs_bag, bag, free_domain(), rate, parameters)


def friction_table(runs: list[Run]) -> Table:
    """Measured and estimated Coulomb friction at every pressure of every run."""
    table = Table(title='Coulomb friction, measured and estimated live')
    for heading in ('run', 'pressure [bar]', 'measured [N]', 'estimated [N]', 'std [N]', 'deviation [%]'):
        is_name = heading == 'run'
        table.add_column(Text(heading), justify='left' if is_name else 'right', no_wrap=is_name)
    for run in runs:
        for level in run.report.numbers['friction']['sliding']:
            deviation = 'none' if level['deviation_percent'] is None else f'{level["deviation_percent"]:+.1f}'
            numbers = (level['pressure'] / BAR, level['measured'], level['estimated'], level['estimated_std'])
            table.add_row(run.bag.name, *(f'{number:.2f}' for number in numbers), deviation)
    return table


def run_table(runs: list[Run]) -> Table:
    """How long an estimate took, and whether the replay gave the same bytes."""
    table = Table(title='Live runs: velocity sample out, estimate back')
    for heading in ('run', 'samples', 'p50 [us]', 'p99 [us]', 'replay'):
        table.add_column(Text(heading), justify='right' if heading.startswith(('p', 's')) else 'left')
    for run in runs:
        f = run.figures
        verdict = 'identical' if run.identical else 'DIFFERENT'
        figures = (f.get(name, '') for name in ('velocity samples', 'round trip p50 [us]', 'round trip p99 [us]'))
        table.add_row(run.bag.name, *figures, verdict)
    return table


def tracking_table(loop: Run) -> Table:
    """How the servo tracked without and with feed-forward, and what that cost."""
    missed = f'{loop.figures.get("missed ticks")} of {loop.figures.get("ticks")} ticks missed'
    share = f'{loop.figures.get("share of a core [%]")} % of a core'
    kind = 'real-time' if priority() else 'normal'
    title = f'Closed loop at {loop.figures.get("rate [Hz]")} Hz, {kind} priority'
    table = Table(title=title, caption=f'simulator: {share}, {missed}')
    for heading in ('feed-forward', 'RMS [um]', 'peak [um]', 'rest per reversal [ms]', 'RMS [%]', 'rest [%]'):
        table.add_column(Text(heading), justify='left' if heading == 'feed-forward' else 'right')
    for stretch in loop.report.numbers['tracking']:
        name = f'up to {stretch["feedforward_peak"]:.0f} N' if stretch['feedforward_peak'] else 'none'
        dwell = 'no reversal' if stretch['dwell'] is None else f'{stretch["dwell"] * 1e3:.1f}'
        changes = ('' if stretch[c] is None else f'{stretch[c]:+.0f}' for c in ('rms_change', 'dwell_change'))
        table.add_row(name, f'{stretch["rms"] * 1e6:.0f}', f'{stretch["peak"] * 1e6:.0f}', dwell, *changes)
    return table


def busy_text(load: float, cores: int, figures: dict[str, str]) -> str:
    """Why latencies and tracking of this run mean nothing; empty if they mean something.

    Args:
        load: Mean number of processes that wanted to run in the minute before.
        cores: Cores of this computer.
        figures: Diagnostics of the simulator in the closed loop.
    """
    reasons = []
    if load > MOST_LOAD * cores:
        reasons.append(f'{load:.1f} processes ran before the demo began, on {cores} cores')
    missed, ticks = (float(figures.get(name, 'nan')) for name in ('missed ticks', 'ticks'))
    if missed > MOST_MISSED * ticks:
        reasons.append(f'the simulator missed {100.0 * missed / ticks:.1f} % of its ticks')
    if not reasons:
        return ''
    return (
        f'This computer was too busy: {"; ".join(reasons)}. Latencies and tracking above mean nothing; the replay does.'
    )


def machine_table(bags: dict[str, Path]) -> tuple[Table, bool]:
    """How a machine with standard messages tracked, and whether every replay gave the same bytes."""
    table = Table(title='Machine with JointState, FluidPressure and WrenchStamped, 500 Hz')
    for heading in ('feed-forward', 'RMS [um]', 'replay', 'bag'):
        table.add_column(Text(heading), justify='right' if heading.startswith('RMS') else 'left')
    all_same = True
    for name, bag in bags.items():
        (found,) = convert_bag(bag, bag.with_name(f'{bag.name}_imported'), read_mapping(MACHINE)).values()
        error = 'unknown' if found.tracking_rms is None else f'{found.tracking_rms * 1e6:.0f}'
        all_same &= (same := identical(bag))
        table.add_row(name, error, 'identical' if same else 'DIFFERENT', str(bag.relative_to(ROOT)))
    return table, all_same


def main() -> int:
    """Run it all; 0 if every replay gave the recorded bytes."""
    started, load = time.monotonic(), os.getloadavg()[0]
    console = Console()
    shutil.rmtree(OUT, ignore_errors=True)
    recorded = [*play_all(console)]
    with ProcessPoolExecutor(2, get_context('spawn'), os.nice, (19,)) as pool:  # beside the loop, and out of its way

        def examined(bag: Path) -> tuple[Future[bool], Future[ReportSummary]]:
            return pool.submit(identical, bag), pool.submit(write_report, bag, bag.with_name(f'{bag.name}.html'))

        charts = pool.submit(write_servo_charts, SERVO_PAGE)
        findings = [examined(bag) for bag, _ in recorded]
        console.print(f'closing the loop with the simulated servo for {2 * LOOP_TIME:.0f} s ...')
        simulator = ROOT / 'config' / 'servo_simulator.yaml'
        recorded.append((LOOP_BAG, record_closed_loop(LOOP_BAG, free_domain(), LOOP_TIME, simulator, priority())))
        findings.append(examined(LOOP_BAG))
        runs = [
            Run(bag, figures, same.result(), report.result())
            for (bag, figures), (same, report) in zip(recorded, findings, strict=True)
        ]
        charts.result()
    console.print(f'running a machine with standard messages for {2 * MACHINE_TIME:.0f} s ...')
    machine_bags = record_machine(OUT, free_domain(), MACHINE_TIME, SIMULATED_MACHINE, MACHINE)  # nothing beside it
    *played, loop = runs
    if len(played) == 1:
        console.print(f'no rig logs at {RIG_LOGS.relative_to(ROOT.parent)}: only the pull test was played')
    machine, machine_identical = machine_table(machine_bags)
    console.print(friction_table(played), run_table([*played, loop]), tracking_table(loop), machine)
    if busy := busy_text(load, len(os.sched_getaffinity(0)), loop.figures):
        console.print(busy, style='bold yellow')
    console.print(f'each run is a bag, with its report: {OUT.relative_to(ROOT)}/RUN and RUN.html')
    console.print(f'the servo with and without friction: {SERVO_PAGE.relative_to(ROOT)}')
    console.print(f'{time.monotonic() - started:.0f} s in all')
    return 0 if machine_identical and all(run.identical for run in (*played, loop)) else 1


if __name__ == '__main__':
    sys.exit(main())
