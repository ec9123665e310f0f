"""Figures of a closed servo loop: position against reference, and friction against feed-forward."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes

from seal_friction_ros.core.foundation.arrays import BoolArray, FloatArray
from seal_friction_ros.core.foundation.units import MM, UM
from seal_friction_ros.core.friction.states import FrictionState
from seal_friction_ros.offline.reports.bag_evaluation import RecordedRun
from seal_friction_ros.offline.reports.figures import (
    BLUE,
    GREY,
    LIGHT_GREY,
    ORANGE,
    VERMILLION,
    Plot,
    force_unit,
    legend_above,
    line,
    new_figure,
)
from seal_friction_ros.offline.reports.tracking_evaluation import TrackingEvaluation, TrackingStretch, periodicity

PERIODS = 3  # that are shown
SHOWN_TIME = 1.0  # [s] of a reference that does not repeat itself


def tracking_plots(run: RecordedRun, evaluation: TrackingEvaluation) -> list[Plot]:
    """Every figure of the tracking that the bag has the data for."""
    shown = [stretch for stretch in (evaluation.without, evaluation.compensated) if stretch is not None]
    if not shown:
        return []
    plots = [tracking_figure(run, evaluation, shown)]
    if np.isfinite(run.feedforward_force).any():
        plots.append(compensation_figure(run, shown))
    return plots


def tracking_verdict(evaluation: TrackingEvaluation) -> str:
    """What the comparison found, in one line."""
    without, compensated = evaluation.without, evaluation.compensated
    if compensated is None or without is None or compensated.rms_change is None:
        alone = compensated or without
        if alone is None:
            return 'No stretch is long enough to say how the servo tracked'
        kind = 'with' if alone.has_feedforward else 'without'
        return f'Tracking error {length(alone.rms)} RMS {kind} feed-forward'
    verb = 'cuts' if compensated.rms_change < 0.0 else 'raises'
    return f'Feed-forward {verb} the tracking error from {length(without.rms)} to {length(compensated.rms)} RMS'


def length(value: float) -> str:
    """Length [m] for a reader."""
    return f'{value / UM:.3g} µm' if abs(value) < 0.9995 * MM else f'{value / MM:.3g} mm'


def stretch_name(stretch: TrackingStretch) -> str:
    """What a stretch is called in figures."""
    if not stretch.has_feedforward:
        return 'without feed-forward'
    if stretch.settings is None:
        return 'with feed-forward'
    return f'with feed-forward, Coulomb scale {stretch.settings.coulomb_scale:.3g}'


def shade(ax: Axes, time: FloatArray, where: BoolArray, label: str) -> None:
    """Shade the times at which something holds; a sample counts until the next."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], where[:-1], [False]))))
    spans = [(float(time[a]), float(time[b] - time[a])) for a, b in edges.reshape(-1, 2)]
    if spans:
        ax.broken_barh(
            spans,
            (0.0, 1.0),
            transform=ax.get_xaxis_transform(),
            color=LIGHT_GREY,
            alpha=0.7,
            lw=0,
            zorder=0.5,
            label=label,
        )


def shown_part(run: RecordedRun, stretch: TrackingStretch) -> slice:
    """Indices of a few whole periods from the middle of a stretch, or of what surrounds its largest error."""
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


def tracking_figure(run: RecordedRun, evaluation: TrackingEvaluation, shown: Sequence[TrackingStretch]) -> Plot:
    """Reference, position and error over the same few periods without and with feed-forward."""
    figure, axes = new_figure(
        tracking_verdict(evaluation),
        5.0,
        nrows=2,
        ncols=len(shown),
        sharex='col',
        sharey='row',
        squeeze=False,
        gridspec_kw={'height_ratios': [3.0, 2.0]},
    )
    parts = [shown_part(run, stretch) for stretch in shown]
    largest = max(stretch.peak for stretch in shown) or UM
    unit, size = ('mm', MM) if largest >= MM else ('µm', UM)
    for stretch, part, (above, below) in zip(shown, parts, axes.T, strict=True):
        time = run.time[part] - run.time[part][0]
        for ax in (above, below):
            shade(ax, time, _at_rest(run, part), 'not sliding')
        line(above, time, run.reference[part] / MM, color=GREY, lw=1.2, ls='--', label='reference')
        line(above, time, run.position[part] / MM, color=BLUE, lw=1.7, label='position')
        line(below, time, (run.reference[part] - run.position[part]) / size, color=VERMILLION, label='error')
        below.axhline(0.0, color=GREY, lw=0.6, zorder=1.0)
        _name(above, stretch, len(shown))
        below.set_title(_numbers(stretch), fontsize=9.0, pad=4.0)
        below.set_xlabel(f'time [s], from {run.time[part][0]:.2f} s of the bag')
        below.set_xlim(0.0, time[-1] or 1.0)
    axes[1, 0].set_ylim(-1.12 * largest / size, 1.12 * largest / size)
    axes[0, 0].set_ylabel('position [mm]')
    axes[1, 0].set_ylabel(f'reference less\nposition [{unit}]')
    legend_above(axes[0, 0])
    return Plot(
        'tracking',
        figure,
        'Reference and position of the rod over the same few periods of each stretch, and the tracking error below on '
        'one scale. Shaded: the rod does not slide; while the reference turns round it stands still, and the peaks are '
        'flat.',
    )


def _name(ax: Axes, stretch: TrackingStretch, panels: int) -> None:
    """Title of a panel; above the legend where the panel is too narrow for both in one line."""
    name = stretch_name(stretch)
    ax.set_title(name[0].upper() + name[1:], pad=8.0 if panels == 1 else 22.0)


def _at_rest(run: RecordedRun, part: slice) -> BoolArray:
    state = run.state[part]
    return np.asarray((state == FrictionState.STUCK) | (state == FrictionState.BREAKAWAY))


def _numbers(stretch: TrackingStretch) -> str:
    text = f'{length(stretch.rms)} RMS, peak {length(stretch.peak)}'
    return text if stretch.dwell is None else f'{text}; dwell {1e3 * stretch.dwell:.3g} ms per reversal'


def compensation_figure(run: RecordedRun, shown: Sequence[TrackingStretch]) -> Plot:
    """Estimated friction force and feed-forward over the same periods as in `tracking_figure`."""
    parts = [shown_part(run, stretch) for stretch in shown]
    last = shown[-1]
    peak = max(float(np.abs(run.friction_force[part]).max()) for part in parts)
    unit, size = force_unit(peak)
    title = (
        f'The feed-forward gives up to {last.feedforward_peak / size:.3g} {unit} against friction of up to '
        f'{peak / size:.3g} {unit}'
        if last.has_feedforward
        else f'Friction of up to {peak / size:.3g} {unit}, and no feed-forward against it'
    )
    figure, axes = new_figure(title, 3.4, ncols=len(shown), sharey='row', squeeze=False)
    for stretch, part, ax in zip(shown, parts, axes[0], strict=True):
        time = run.time[part] - run.time[part][0]
        shade(ax, time, _at_rest(run, part), 'not sliding')
        friction, force = run.friction_force[part] / size, run.feedforward_force[part] / size
        line(ax, time, friction, color=BLUE, lw=1.5, label='estimated friction force')
        line(ax, time, force, color=ORANGE, lw=1.5, label='feed-forward')
        ax.axhline(0.0, color=GREY, lw=0.6, zorder=1.0)
        _name(ax, stretch, len(shown))
        ax.set_xlabel(f'time [s], from {run.time[part][0]:.2f} s of the bag')
        ax.set_xlim(0.0, time[-1] or 1.0)
    axes[0, 0].set_ylabel(f'force [{unit}]')
    legend_above(axes[0, 0])
    return Plot(
        'friction_and_feedforward',
        figure,
        'Estimated friction force and feed-forward over the same periods. The feed-forward turns with the reference, '
        'ahead of it by the lead time, the friction with the rod: what lies between them is left to the controller.',
    )
