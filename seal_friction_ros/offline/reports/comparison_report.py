"""Page of two runs (before and after) or of two seal files: friction over pressure of both, and what has changed."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from seal_friction_ros.core.estimation.findings import GOOD, SMALL_CHANGE, Finding, Verdict, verdict_of
from seal_friction_ros.core.estimation.strokes import PressureLevel
from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.foundation.normal_distribution import BAND_95
from seal_friction_ros.core.foundation.units import BAR, MM
from seal_friction_ros.core.friction.actuator import MountedSeal, actuator_friction
from seal_friction_ros.core.friction.seal_file import parse_seal
from seal_friction_ros.files import config_path, read_yaml
from seal_friction_ros.offline.bags.mapped_bag import MappingFile
from seal_friction_ros.offline.bags.recorded_run import RecordedRun, read_run
from seal_friction_ros.offline.replay.run_findings import run_findings
from seal_friction_ros.offline.replay.tracking_evaluation import TrackingEvaluation, evaluate_tracking
from seal_friction_ros.offline.reports import figure_style as style
from seal_friction_ros.offline.reports import verdicts
from seal_friction_ros.offline.reports.bag_evaluation import BagEvaluation, evaluate_run
from seal_friction_ros.offline.reports.bag_figures import PRESSURE_LABEL, usable_inputs
from seal_friction_ros.offline.reports.bag_report import data_date, mounted_seals
from seal_friction_ros.offline.reports.figure_style import Plot, finished, house_style
from seal_friction_ros.offline.reports.formatting import force_unit, number
from seal_friction_ros.offline.reports.page import Columns, ReportSummary, head_of, seals_text, table_of, write_page

NOISE = SMALL_CHANGE  # [-] of a change, where too few strokes tell (our choice)
SAME_PRESSURE = 0.05  # [-] of the highest pressure, by which pressures of both runs may differ (our choice)
SEAL_PRESSURES = 11
_COLOURS = ((style.BLUE, 'o'), (style.ORANGE, 's'))
_DOTS = 4000  # of each run over velocity


class Change(NamedTuple):
    """Friction of both at one pressure."""

    pressure: float  # [Pa, gauge]
    before: float  # [N]
    then: float  # [N]
    noise: float  # [-] relative change that 95 % of repetitions stay below

    @property
    def relative(self) -> float:
        """Relative change."""
        return self.then / self.before - 1.0


class _Run(NamedTuple):
    name: str
    run: RecordedRun
    evaluation: BagEvaluation
    tracking: TrackingEvaluation | None

    @property
    def levels(self) -> Sequence[PressureLevel]:
        return self.evaluation.friction.sliding


def is_seal(path: Path) -> bool:
    """Whether a path is a seal file, or the name of one in ``config/seals``, and no bag."""
    return path.suffix in ('.yaml', '.yml') or not (path.exists() or '/' in str(path))


@house_style()
def write_comparison(
    a: Path, b: Path, out: Path, namespace: str = '', mapping: MappingFile | None = None
) -> ReportSummary:
    """Write the page of two bags or of two seal files; changes are relative to the first.

    ``namespace`` and ``mapping`` are of bags, as of `open_actuator`. ValueError: one is a bag and the other a seal
    file, or one of them cannot be read.
    """
    if is_seal(a) != is_seal(b):
        raise ValueError(f'{a}, {b}: one is a bag and the other a seal file: give two of a kind')
    return _compare_seals(a, b, out) if is_seal(a) else _compare_runs(a, b, out, namespace, mapping)


# -- two runs ---------------------------------------------------------------------------------------------------------


def _compare_runs(a: Path, b: Path, out: Path, namespace: str, mapping: MappingFile | None) -> ReportSummary:
    names = (a.name, b.name) if a.name != b.name else (str(a), str(b))
    runs = tuple(_read(path, name, namespace, mapping) for path, name in zip((a, b), names, strict=True))
    changes = common_changes(*(one.levels for one in runs))
    starts = common_changes(*(one.evaluation.friction.breakaway for one in runs))
    told = mean_change('sliding friction', changes), mean_change('breakaway force', starts), _tracking_change(*runs)
    known = [one for one in told if one is not None]
    plots = [_pressure_figure(runs, changes), _velocity_figure(runs)]
    facts = [f'{one.name}: {data_date(one.run.start)}, {seals_text(mounted_seals(one.run))}' for one in runs]
    change = verdicts.of_runs(known, names)
    between = Finding(change.level, change.text.rstrip('.'), change.next.rstrip('.'))
    own = [
        found._replace(name=one.name)
        for one in runs
        for found in run_findings(one.run, one.evaluation.seen, one.tracking)
    ]
    is_small = all(abs(size) <= SMALL_CHANGE for _, size, _ in known)  # then what is wrong with a run decides
    verdict = verdict_of([*(one for one in own if is_small and one.level != GOOD), between, *own])
    found = {'sliding': changes, 'breakaway': starts}
    return _write(out, f'compare {a} {b}', names, facts, plots, known, found, verdict)


def _read(path: Path, name: str, namespace: str, mapping: MappingFile | None) -> _Run:
    run = read_run(path, namespace, mapping)
    return _Run(name, run, evaluate_run(run), evaluate_tracking(run))


def common_changes(before: Sequence[PressureLevel], then: Sequence[PressureLevel]) -> list[Change]:
    """Change of the measured friction at each pressure that both runs have.

    The noise is that of the means of the strokes, by their spread; `NOISE` where too few strokes tell it.
    """
    highest = max((level.pressure for level in (*before, *then)), default=0.0)
    found = []
    for level in then:
        near = min(before, key=lambda one: abs(one.pressure - level.pressure), default=None)
        if near is None or abs(near.pressure - level.pressure) > SAME_PRESSURE * highest or near.measured <= 0.0:
            continue
        noise = BAND_95 * math.hypot(_relative_error(near), _relative_error(level))
        found.append(Change(level.pressure, near.measured, level.measured, noise))
    return found


def _relative_error(level: PressureLevel) -> float:
    """Standard error of the measured friction, relative [-]."""
    if level.measured_spread is None or level.measured <= 0.0:
        return NOISE / (BAND_95 * math.sqrt(2.0))
    return level.measured_spread / math.sqrt(len(level.events)) / level.measured


def mean_change(name: str, changes: Sequence[Change]) -> tuple[str, float, float] | None:
    """Mean relative change over the pressures, and its noise; None without a pressure in common."""
    if not changes:
        return None
    noise = math.sqrt(sum(change.noise**2 for change in changes)) / len(changes)
    return name, float(np.mean([change.relative for change in changes])), noise


def _tracking_change(*runs: _Run) -> tuple[str, float, float] | None:
    """Change of the tracking error, of the last stretch of each."""
    errors = [one.tracking.stretches[-1].rms for one in runs if one.tracking and one.tracking.stretches]
    known = len(errors) == len(runs) and errors[0] > 0.0
    return ('tracking error', errors[1] / errors[0] - 1.0, NOISE) if known else None


def _pressure_figure(runs: Sequence[_Run], changes: Sequence[Change]) -> Plot:
    title = 'Measured sliding friction of both runs'
    if mean := mean_change('', changes):
        title = f'Sliding friction changed by {100.0 * mean[1]:+.1f} % on average'
    figure, ax = style.new_figure(title, 4.6)
    unit, size = force_unit(max((level.measured for one in runs for level in one.levels), default=1.0))
    for one, (colour, marker) in zip(runs, _COLOURS, strict=True):
        events = [(event.pressure / BAR, level.reading(event) / size) for level in one.levels for event in level.events]
        if not events:
            continue
        x, y = np.array(events[:: len(events) // _DOTS + 1]).T
        ax.plot(x, y, ls='', marker=marker, ms=3.5, color=colour, alpha=0.35, mew=0.0)
        means = np.array([(level.pressure / BAR, level.measured / size) for level in one.levels]).T
        ax.plot(*means, marker=marker, ms=6.5, color=colour, mec='white', lw=1.4, label=f'{one.name}, measured')
        estimated = [level.estimated / size for level in one.levels]
        ax.plot(means[0], estimated, color=colour, ls='--', lw=1.2, label=f'{one.name}, estimated')
    labels = {'xlabel': PRESSURE_LABEL, 'ylabel': f'friction of all seals [{unit}]'}
    return finished('friction_over_pressure', figure, ax, ylim=(0.0, None), **labels)


def _velocity_figure(runs: Sequence[_Run]) -> Plot:
    figure, axes = style.new_figure('Force sum over velocity', 4.0, ncols=2, sharex=True, sharey=True)
    usable = [usable_inputs(one.run) & np.isfinite(one.run.velocity) & np.isfinite(one.run.force_sum) for one in runs]
    largest = [np.abs(one.run.force_sum[where]).max(initial=0.0) for one, where in zip(runs, usable, strict=True)]
    unit, size = force_unit(float(max(largest)))
    for one, where, ax, (colour, _) in zip(runs, usable, axes, _COLOURS, strict=True):
        good = np.flatnonzero(where)
        good = good[:: len(good) // _DOTS + 1]
        velocity, force = one.run.velocity[good] / MM, one.run.force_sum[good] / size
        ax.plot(velocity, force, 'o', ms=2.0, color=colour, alpha=0.4, mew=0.0, rasterized=True)
        style.zero_lines(ax, vertical=True)
        ax.set(title=one.name, xlabel='rod velocity [mm/s]')
    axes[0].set_ylabel(f'force sum [{unit}]')
    return Plot('force_over_velocity', figure)


# -- two seals --------------------------------------------------------------------------------------------------------


def _compare_seals(a: Path, b: Path, out: Path) -> ReportSummary:
    seals = [parse_seal(read_yaml(config_path('seals', str(path)))) for path in (a, b)]
    names = (seals[0].name, seals[1].name) if seals[0].name != seals[1].name else (str(a), str(b))
    low, high = max(seal.pressure_min for seal in seals), min(seal.pressure_max for seal in seals)

    def friction(number: int, pressure: float) -> Any:
        return actuator_friction((MountedSeal(seals[number], 'a'),), pressure, pressure, 0.0)

    changes = []
    for pressure in np.linspace(low, high, SEAL_PRESSURES).tolist() if high > low else []:
        one, other = friction(0, pressure), friction(1, pressure)
        noise = BAND_95 * math.hypot(one.coulomb_friction_std, other.coulomb_friction_std) / one.coulomb_friction
        changes.append(Change(pressure, one.coulomb_friction, other.coulomb_friction, noise))
    figure, ax = style.new_figure('Coulomb friction of one seal, with 95 % bands', 4.6)
    highest = max(friction(i, seal.pressure_max).coulomb_friction for i, seal in enumerate(seals))
    unit, size = force_unit(highest)
    for i, (seal, (colour, _)) in enumerate(zip(seals, _COLOURS, strict=True)):
        pressures = np.linspace(seal.pressure_min, seal.pressure_max, 201)
        known = [friction(i, p) for p in pressures.tolist()]
        values: FloatArray = np.array([(one.coulomb_friction, one.coulomb_friction_std) for one in known]).T / size
        style.fill_band(ax, pressures / BAR, values[0], BAND_95 * values[1], color=colour, alpha=0.2)
        ax.plot(pressures / BAR, values[0], color=colour, lw=1.8, label=names[i])
    labels = {'xlabel': 'pressure [bar, gauge]', 'ylabel': f'Coulomb friction of one seal [{unit}]'}
    plot = finished('friction_over_pressure', figure, ax, ylim=(0.0, None), **labels)
    # The bands of a seal file hold at all pressures together, so a mean over them is no better known.
    mean = mean_change('Coulomb friction', changes)
    told = [] if mean is None else [(*mean[:2], max(one.noise for one in changes))]
    found: dict[str, list[Change]] = {'sliding': changes, 'breakaway': []}
    return _write(out, f'compare {a} {b}', names, [], [plot], told, found, verdicts.of_runs(told, names))


# -- page -------------------------------------------------------------------------------------------------------------


def _write(
    out: Path,
    command: str,
    names: tuple[str, str],
    facts: Sequence[str],
    plots: Sequence[Plot],
    told: Sequence[tuple[str, float, float]],
    changes: dict[str, list[Change]],
    verdict: Verdict,
) -> ReportSummary:
    columns: Columns = (
        ('pressure [bar]', lambda one: number(one.pressure, unit=BAR)),
        (f'{names[0]} [N]', lambda one: number(one.before)),
        (f'{names[1]} [N]', lambda one: number(one.then)),
        ('change [%]', lambda one: number(one.relative, 1, unit=0.01, signed=True)),
        ('noise [%]', lambda one: number(one.noise, 1, unit=0.01)),
    )
    tables = {name: table_of(found, columns) for name, found in changes.items()}
    values: dict[str, Any] = {'names': names, 'tables': tables, 'told': told}
    figures = write_page(out, 'comparison', plots, verdict=verdict, head=head_of(command, *facts), **values)
    numbers: dict[str, Any] = {
        name: [one._asdict() | {'change': one.relative} for one in found] for name, found in changes.items()
    }
    numbers |= {'level': verdict.level, 'verdict': verdict.text}
    numbers['changes'] = {name: {'change': change, 'noise': noise} for name, change, noise in told}
    return ReportSummary(out, figures, numbers)
