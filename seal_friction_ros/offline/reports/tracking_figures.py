"""Figures of a closed servo loop: position against reference, and friction against feed-forward."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes

from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.foundation.units import MM, UM
from seal_friction_ros.core.friction.states import FrictionState
from seal_friction_ros.offline.bags.recorded_run import RecordedRun
from seal_friction_ros.offline.replay.tracking_evaluation import TrackingEvaluation, TrackingStretch, periodicity
from seal_friction_ros.offline.reports import figure_style as style
from seal_friction_ros.offline.reports.figure_style import Plot, finished
from seal_friction_ros.offline.reports.formatting import force_unit, length_text, length_unit

PERIODS = 3  # that are shown
SHOWN_TIME = 1.0  # [s] of a reference that is not periodic


def tracking_plots(run: RecordedRun, evaluation: TrackingEvaluation) -> list[Plot]:
    """Every figure of the tracking that the bag has the data for."""
    known = [stretch for stretch in (evaluation.without, evaluation.compensated) if stretch is not None]
    shown = known or [stretch for stretch in (evaluation.unknown,) if stretch is not None]
    if not shown:
        return []
    forces = [run.feedforward_force] if run.replayed_force is None else [run.feedforward_force, run.replayed_force]
    compensation = [compensation_figure(run, shown)] if any(np.isfinite(force).any() for force in forces) else []
    return [stretches_figure(run, evaluation, shown), *compensation]


def tracking_summary(evaluation: TrackingEvaluation) -> str:
    """Result of the comparison, in one line."""
    without, compensated = evaluation.without, evaluation.compensated
    if compensated is None or without is None or compensated.rms_change is None:
        alone = compensated or without or evaluation.unknown
        if alone is None:
            return 'No stretch is long enough to evaluate the tracking'
        return f'Tracking error {length_text(alone.rms)} RMS, {stretch_name(alone)}'
    verb, before, after = 'cuts' if compensated.rms_change < 0.0 else 'raises', without.rms, compensated.rms
    return f'Feed-forward {verb} the tracking error from {length_text(before)} to {length_text(after)} RMS'


def stretch_name(stretch: TrackingStretch) -> str:
    """Name of a stretch in figures and tables."""
    if stretch.has_feedforward is None:
        return 'feed-forward that acted: not known'
    if not stretch.has_feedforward:
        return 'without feed-forward'
    if stretch.settings is None:
        return 'with feed-forward'
    return f'with feed-forward, Coulomb scale {stretch.settings.scale:.3g}'


def shown_part(run: RecordedRun, stretch: TrackingStretch) -> slice:
    """Indices of a few whole periods from the middle of a stretch, or of `SHOWN_TIME` around its largest error."""
    time = run.time[stretch.first : stretch.last + 1]
    repeats = periodicity(time, run.reference[stretch.first : stretch.last + 1])
    if repeats is None:
        error = np.abs(run.reference - run.position)[stretch.first : stretch.last + 1]
        middle = time[int(np.argmax(np.nan_to_num(error)))]
        start = max(min(middle - SHOWN_TIME / 2.0, time[-1] - SHOWN_TIME), time[0])
        span = SHOWN_TIME
    else:
        span = min(PERIODS, len(repeats.crossings) - 1) * repeats.period
        fitting = repeats.crossings[repeats.crossings <= time[-1] - time[0] - span + 1e-9]
        start = time[0] + (fitting[len(fitting) // 2] if len(fitting) else 0.0)
    first, end = np.searchsorted(time, [start - 1e-9, start + span + 1e-9])
    return slice(stretch.first + int(first), stretch.first + int(end))


def stretches_figure(run: RecordedRun, evaluation: TrackingEvaluation, shown: Sequence[TrackingStretch]) -> Plot:
    """Reference, position and error over the same few periods without and with feed-forward."""
    layout = {'nrows': 2, 'ncols': len(shown), 'sharex': 'col', 'sharey': 'row', 'squeeze': False}
    heights = {'height_ratios': [3.0, 2.0]}
    figure, axes = style.new_figure(tracking_summary(evaluation), 5.0, **layout, gridspec_kw=heights)
    largest = max(stretch.peak for stretch in shown) or UM
    unit, size = length_unit(largest)
    for stretch, (above, below) in zip(shown, axes.T, strict=True):
        part = shown_part(run, stretch)
        time = _prepare_panel(above, run, stretch, part, len(shown))
        _prepare_panel(below, run, stretch, part, len(shown))
        style.thin_line(above, time, run.reference[part] / MM, color=style.GREY, lw=1.2, ls='--', label='reference')
        style.thin_line(above, time, run.position[part] / MM, color=style.BLUE, lw=1.7, label='position')
        style.thin_line(below, time, (run.reference[part] - run.position[part]) / size, color=style.VERMILLION)
        style.zero_lines(below)
        dwell = '' if stretch.dwell is None else f'; dwell {1e3 * stretch.dwell:.3g} ms per reversal'
        text = f'{length_text(stretch.rms)} RMS, peak {length_text(stretch.peak)}{dwell}'
        below.set_title(text, fontsize=9.0, pad=4.0)
        above.set_xlabel('')
    axes[1, 0].set(ylim=(-1.12 * largest / size, 1.12 * largest / size), ylabel=f'reference less\nposition [{unit}]')
    return finished('tracking', figure, axes[0, 0], ylabel='position [mm]')


def _prepare_panel(ax: Axes, run: RecordedRun, stretch: TrackingStretch, part: slice, count: int) -> FloatArray:
    """Title, time axis and shading of one of ``count`` panels in a row; returns the times in it [s]."""
    time: FloatArray = run.time[part] - run.time[part][0]
    name = stretch_name(stretch)
    ax.set_title(name[0].upper() + name[1:], pad=8.0 if count == 1 else 22.0)  # above the legend in a narrow panel
    ax.set(xlabel=f'time [s], from {run.time[part][0]:.2f} s of the bag', xlim=(0.0, time[-1] or 1.0))
    at_rest = np.isin(run.state[part], (FrictionState.STUCK, FrictionState.BREAKAWAY))
    style.shade(ax, time, at_rest, 'not sliding')
    return time


def compensation_figure(run: RecordedRun, shown: Sequence[TrackingStretch]) -> Plot:
    """Estimated friction force and feed-forward over the periods of `stretches_figure`."""
    parts = [shown_part(run, stretch) for stretch in shown]
    last = shown[-1]
    peak = max(float(np.abs(run.friction_force[part]).max()) for part in parts)
    unit, size = force_unit(peak)
    title = f'Friction up to {peak / size:.3g} {unit}, ' + (
        'no feed-forward' if last.has_feedforward is False else 'feed-forward that acted: not known'
    )
    if last.feedforward_peak:
        largest = f'{last.feedforward_peak / size:.3g} {unit}'
        title = f'Feed-forward up to {largest} against friction up to {peak / size:.3g} {unit}'
    figure, axes = style.new_figure(title, 3.4, ncols=len(shown), sharey='row', squeeze=False)
    for stretch, part, ax in zip(shown, parts, axes[0], strict=True):
        time = _prepare_panel(ax, run, stretch, part, len(shown))
        friction, force = run.friction_force[part] / size, run.feedforward_force[part] / size
        style.thin_line(ax, time, friction, color=style.BLUE, lw=1.5, label='estimated friction force')
        style.thin_line(ax, time, force, color=style.ORANGE, lw=1.5, label='feed-forward')
        if run.replayed_force is not None:
            replayed = run.replayed_force[part] / size
            style.thin_line(ax, time, replayed, color=style.GREY, lw=1.2, ls='--', label='replayed, did not act')
        style.zero_lines(ax)
    return finished('friction_and_feedforward', figure, axes[0, 0], ylabel=f'force [{unit}]')
