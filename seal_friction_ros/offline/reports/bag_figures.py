"""Figures of a bag: the live estimate over time, and measured against estimated friction."""

from collections.abc import Sequence
from itertools import chain, pairwise, repeat
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from seal_friction_ros.core.estimation.strokes import PressureLevel
from seal_friction_ros.core.foundation.arrays import BoolArray, FloatArray, IntArray
from seal_friction_ros.core.foundation.normal_distribution import BAND_95
from seal_friction_ros.core.foundation.units import BAR
from seal_friction_ros.core.friction.states import FrictionState
from seal_friction_ros.core.messages.records import Status
from seal_friction_ros.offline.bags.recorded_run import RecordedRun
from seal_friction_ros.offline.reports import figure_style as style
from seal_friction_ros.offline.reports.bag_evaluation import BagEvaluation, worst_level
from seal_friction_ros.offline.reports.figure_style import Plot, finished
from seal_friction_ros.offline.reports.formatting import force_unit, speed_unit

STATE_COLOURS = {
    FrictionState.UNKNOWN: style.PURPLE,
    FrictionState.SLIDING: style.SKY,
    FrictionState.BREAKAWAY: style.ORANGE,
    FrictionState.STUCK: style.LIGHT_GREY,
}
TIME_LABEL = 'time since the first estimate [s]'
PRESSURE_LABEL = 'pressure at the seals [bar, gauge]'
_FAULTS = sum(bit for bit in Status if bit.name and bit.name.endswith(('_OUT_OF_RANGE', '_LEAP')))
"""Status bits of inputs that say nothing about the range of an axis."""
_COLOURS = (style.BLUE, style.ORANGE, style.GREEN, style.PURPLE, style.VERMILLION)  # of pressures
_DOTS = 12_000  # in the scatter over velocity
_MARKS = 3000  # of single strokes over pressure


def run_figures(run: RecordedRun, evaluation: BagEvaluation) -> list[Plot]:
    """Every figure that the bag has the data for."""
    sliding, breakaway = evaluation.friction.sliding, evaluation.friction.breakaway
    return [
        live_figure(run, sliding),
        *([pressure_figure(sliding, breakaway)] if sliding or breakaway else []),
        *([deviation_figure(sliding)] if sliding else []),
        sliding_velocity_figure(run, sliding),
        inputs_figure(run),
        *([status_figure(run)] if run.status.any() else []),
    ]


def friction_summary(levels: Sequence[PressureLevel]) -> str:
    """Result of the comparison, in one line."""
    level = worst_level(levels)
    if level is None:
        return 'No steady sliding to compare the estimate with'
    size = f'{abs(level.deviation_percent or 0.0):.1f} %'
    where = f'at {level.pressure / BAR:.1f} bar'
    if len(levels) == 1:
        side = 'above' if level.deviation > 0.0 else 'below'
        return f'Estimated sliding friction is {size} {side} the measured friction {where}'
    return f'Estimated sliding friction is within {size} of the measurement (worst {where})'


# -- over time --------------------------------------------------------------------------------------------------------


def live_figure(run: RecordedRun, levels: Sequence[PressureLevel]) -> Plot:
    """Live estimate against measured friction: the whole bag, and a part with strokes."""
    part, level = detail_window(run, levels)
    heights = {'height_ratios': [5.0, 0.35, 6.0, 0.35], 'hspace': 0.02}
    figure, axes = style.new_figure(friction_summary(levels), 6.6, nrows=4, gridspec_kw=heights)
    for above, strip, shown, of_level in (
        (axes[0], axes[1], slice(0, len(run.time)), None),
        (axes[2], axes[3], part, level),
    ):
        strip.sharex(above)
        _draw_friction(above, run, shown, of_level)
        _draw_states(strip, run, shown)
        strip.set_xlabel(TIME_LABEL, loc='left')
    axes[0].axvspan(*run.time[[part.start, part.stop - 1]], color=style.BLACK, alpha=0.08, lw=0)
    axes[2].set_title('Shaded part' if level is None else f'Shaded part, at {level.pressure / BAR:.1f} bar')
    spacing: dict[str, Any] = {'ncols': 4, 'borderaxespad': 0.0, 'handlelength': 1.0}
    axes[3].legend(loc='upper right', bbox_to_anchor=(1.0, -1.4), **spacing)
    if level is not None and _offset_matters(level):
        style.legend_above(axes[2], slice(1, 3))  # the legend of the first panel names the others
    return finished('live_estimate', figure, axes[0], title='Whole bag')


def detail_window(run: RecordedRun, levels: Sequence[PressureLevel]) -> tuple[slice, PressureLevel | None]:
    """Indices of the part to enlarge, and its pressure level.

    Two neighbouring strokes in opposite directions of the middle pressure level, with the rest before them; one stroke
    if there is no such pair; without a level the hundredth of the bag around the largest friction force.
    """
    if levels:
        level = levels[len(levels) // 2]
        events = sorted(level.events, key=lambda event: event.first)
        pairs = [(a, b) for a, b in pairwise(events) if a.direction != b.direction]
        gaps = [b.first - a.last for a, b in pairs]
        near = [pair for pair, gap in zip(pairs, gaps, strict=True) if gap <= 2 * min(gaps) + 1]
        # The pair with the shortest gap; of equal ones the middle one, since the first may be a run-in.
        one, other = near[len(near) // 2] if near else (events[0], events[0])
        first = one.first
        while first > 0 and run.state[first - 1] != FrictionState.SLIDING:
            first -= 1
        margin = (other.last - first) // 20 + 1
        return slice(max(first - margin, 0), min(other.last + margin + 1, len(run.time))), level
    half = max(len(run.time) // 200, 100)
    middle = int(np.argmax(np.abs(run.friction_force)))
    return slice(max(middle - half, 0), min(middle + half + 1, len(run.time))), None


def usable_inputs(run: RecordedRun) -> BoolArray:
    """Where the inputs have a range that says something about the axes."""
    usable: BoolArray = run.status & _FAULTS == 0
    return usable


def _offset_matters(level: PressureLevel) -> bool:
    return level.offset is not None and abs(level.offset) > 0.1 * abs(level.measured)


def _draw_friction(ax: Axes, run: RecordedRun, part: slice, level: PressureLevel | None) -> None:
    """Force sum and estimate over time; with a level of which the offset matters, the force sum less the offset too."""
    rows = part.start + np.argsort(run.time[part], kind='stable')
    time, coulomb, std = run.time[rows], run.coulomb_friction[rows], run.coulomb_friction_std[rows]
    force_sum, usable = run.force_sum[rows], usable_inputs(run)[rows]
    largest = max(_largest(values[usable]) for values in (run.breakaway_force[rows], force_sum))
    unit, size = force_unit(largest)
    kept = style.thinned(coulomb)
    for side, label in ((1.0, 'Coulomb friction, 95 % band'), (-1.0, None)):
        middle, half = side * coulomb[kept] / size, BAND_95 * std[kept] / size
        style.fill_band(ax, time[kept], middle, half, alpha=0.35, label=label)
    if level is not None and _offset_matters(level):
        offset = level.offset or 0.0
        style.thin_line(ax, time, force_sum / size, color=style.GREY, lw=0.8, ls=':', label='force sum')
        label = f'force sum less its offset of {offset / size:.3g} {unit}'
        style.thin_line(ax, time, (force_sum - offset) / size, color=style.BLACK, lw=1.0, label=label)
    else:
        style.thin_line(ax, time, force_sum / size, color=style.BLACK, lw=1.0, label='force sum (measured)')
    look = {'color': style.BLUE, 'lw': 1.6, 'alpha': 0.9, 'label': 'estimated friction force'}
    style.thin_line(ax, time, run.friction_force[rows] / size, **look)
    style.zero_lines(ax)
    end, limit = time[-1] if time[-1] > time[0] else time[0] + 1.0, 1.15 * largest / size
    ax.set(xlim=(time[0], end), ylim=(-limit, limit), ylabel=f'force [{unit}]')
    style.mark_beyond(ax, time, force_sum / size)
    ax.tick_params(labelbottom=False)


def _largest(values: FloatArray) -> float:
    """Magnitude that 99.9 % of the finite values stay below; 1 if this is 0 or there is no value."""
    finite = values[np.isfinite(values)]
    return float(np.quantile(np.abs(finite), 0.999)) or 1.0 if len(finite) else 1.0


def _draw_states(ax: Axes, run: RecordedRun, part: slice) -> None:
    """Strip with the state at each column of pixels."""
    time = np.maximum.accumulate(run.time[part])
    grid = np.linspace(time[0], max(time[-1], time[0] + 1e-3), min(style.DETAIL, 4 * len(time)) + 1)
    held = run.state[part][np.searchsorted(time, grid, side='right') - 1]
    for state in FrictionState:
        if (held == state).any():
            spans = style.true_spans(grid, held == state)
            ax.broken_barh(spans, (0.0, 1.0), color=STATE_COLOURS[state], lw=0, label=state.name.lower())
    ax.set_yticks([])
    ax.set_ylim(0.0, 1.0)
    ax.grid(visible=False)
    ax.set_ylabel('state', rotation=0, ha='right', va='center')


def inputs_figure(run: RecordedRun) -> Plot:
    """Inputs of the estimator over time."""
    usable = usable_inputs(run)
    low, high = style.usable_range(usable, run.pressure / BAR)
    first, last = float(run.time.min()), float(run.time.max())
    title = f'Inputs: {low:.1f} to {high:.1f} bar, {last - first:.0f} s'
    figure, axes = style.new_figure(title, 5.4, nrows=3, sharex=True)
    same = np.array_equal(run.pressure_a, run.pressure_b, equal_nan=True)
    label = 'chambers a and b' if same else 'chamber a'
    style.thin_line(axes[0], run.time, run.pressure_a / BAR, color=style.BLUE, lw=1.1, label=label)
    if not same:
        style.thin_line(axes[0], run.time, run.pressure_b / BAR, color=style.ORANGE, lw=1.1, label='chamber b')
    unit, speed_size = speed_unit(max(map(abs, style.usable_range(usable, run.velocity))))
    style.thin_line(axes[1], run.time, run.velocity / speed_size, color=style.GREEN, lw=1.0)
    axes[1].set_ylabel(f'rod velocity\n[{unit}]')
    unit, size = force_unit(max(map(abs, style.usable_range(usable, run.force_sum))))
    style.thin_line(axes[2], run.time, run.force_sum / size, color=style.BLACK, lw=1.0)
    style.fit_axis(axes[0], run.time, usable, run.pressure_a / BAR, run.pressure_b / BAR)
    style.fit_axis(axes[1], run.time, usable, run.velocity / speed_size)
    style.fit_axis(axes[2], run.time, usable, run.force_sum / size)
    axes[2].set(ylabel=f'force sum\n[{unit}]', xlabel=TIME_LABEL, xlim=(first, max(last, first + 1e-3)))
    return finished('inputs', figure, *axes, ylabel='pressure\n[bar, gauge]')


def status_figure(run: RecordedRun) -> Plot:
    """Times at which each status bit was set."""
    bits = [bit for bit in Status if (run.status & int(bit)).any()]
    share = 100.0 * np.count_nonzero(run.status) / len(run.status)
    figure, ax = style.new_figure(f'{share:.3g} % of the estimates carry a status bit', 1.6 + 0.34 * len(bits))
    first, last = float(run.time.min()), float(run.time.max())
    grid = np.linspace(first, max(last, first + 1e-3), style.COLUMNS + 1)
    column = np.clip(np.searchsorted(grid, run.time, side='right') - 1, 0, style.COLUMNS - 1)
    for row, bit in enumerate(bits):
        hit = np.zeros(style.COLUMNS, dtype=np.bool_)
        hit[column[run.status & int(bit) != 0]] = True
        ax.broken_barh(style.true_spans(grid, hit), (row - 0.32, 0.64), color=style.VERMILLION, lw=0)
    ax.set_yticks(range(len(bits)), [str(bit.name).lower().replace('_', ' ') for bit in bits])
    ax.set(xlim=(grid[0], grid[-1]), ylim=(len(bits) - 0.5, -0.5), xlabel=TIME_LABEL)
    ax.grid(visible=False, axis='y')
    return Plot('status', figure)


# -- over pressure and velocity ---------------------------------------------------------------------------------------


def pressure_figure(sliding: Sequence[PressureLevel], breakaway: Sequence[PressureLevel]) -> Plot:
    """Measured and estimated friction over pressure, sliding and at breakaway."""
    strokes, inside = sum(len(level.events) for level in sliding), sum(level.in_band for level in sliding)
    title = f'{inside} of {strokes} measured strokes lie in the 95 % band of the estimate'
    figure, ax = style.new_figure(title if strokes else 'Breakaway force over pressure', 4.6)
    unit, size = force_unit(max(level.estimated for level in chain(sliding, breakaway)))
    for levels, name, colour, dashes, marker, dot in (
        (sliding, 'sliding', style.BLUE, '-', 'o', style.BLACK),
        (breakaway, 'breakaway', style.ORANGE, '--', 's', style.VERMILLION),
    ):
        if not levels:
            continue
        pressure = np.array([level.pressure for level in levels]) / BAR
        estimated = np.array([level.estimated for level in levels]) / size
        if name == 'sliding':
            half = BAND_95 * np.array([level.estimated_std for level in levels]) / size
            if len(levels) == 1:
                look = {'color': style.SKY, 'lw': 10.0, 'alpha': 0.45, 'ls': ''}
                ax.errorbar(pressure, estimated, half, label='sliding, 95 % band', **look)
            else:
                style.fill_band(ax, pressure, estimated, half, label='sliding, 95 % band')
        single = {'marker': '_', 'ms': 14, 'mew': 2.0} if len(levels) == 1 else {}
        ax.plot(pressure, estimated, color=colour, ls=dashes, lw=1.8, label=f'{name}, estimated', **single)
        events = [(event.pressure / BAR, level.reading(event) / size) for level in levels for event in level.events]
        x, y = np.array(events[:: len(events) // _MARKS + 1]).T
        ax.plot(x, y, ls='', marker=marker, ms=3.5, color=dot, alpha=0.35, mew=0.0)
        measured = [level.measured / size for level in levels]
        ax.plot(pressure, measured, ls='', marker=marker, ms=6.5, color=dot, mec='white', label=f'{name}, measured')
    highest = max(level.pressure for level in chain(sliding, breakaway)) / BAR
    ax.set(xlim=(-0.03 * highest, 1.05 * highest if highest > 0.0 else 1.0), ylim=(0.0, None))
    ax.set(xlabel=PRESSURE_LABEL, ylabel=f'friction of all seals [{unit}]')
    ax.legend(loc='upper left')
    return Plot('friction_over_pressure', figure)


def deviation_figure(levels: Sequence[PressureLevel]) -> Plot:
    """Deviation of the estimate over time, stroke by stroke, a colour a pressure."""
    figure, ax = style.new_figure(friction_summary(levels), 3.4)
    bands, ends = [], []
    for level, colour in zip(levels, chain(_COLOURS, repeat(style.SKY)), strict=False):
        strokes = sorted((event.time, level.reading(event), event) for event in level.events)
        known = [(time, 100.0 * (one.estimated / reading - 1.0)) for time, reading, one in strokes if reading > 0.0]
        bands += [100.0 * BAND_95 * one.std / reading for _, reading, one in strokes if reading > 0.0]
        ends += [time for time, _ in known]
        if known:
            ax.plot(*zip(*known, strict=True), 'o', ms=4.0, color=colour, label=f'{level.pressure / BAR:.1f} bar')
    if ends:
        half = np.full(2, np.median(bands))
        style.fill_band(ax, np.array([min(ends), max(ends)]), 0.0 * half, half, label='95 % band of one reading')
    style.zero_lines(ax)
    return finished('deviation', figure, ax, xlabel=TIME_LABEL, ylabel='estimated less measured [%]')


def sliding_velocity_figure(run: RecordedRun, levels: Sequence[PressureLevel]) -> Plot:
    """Friction over velocity, measured and estimated, coloured by pressure."""
    title = 'Friction over velocity, measured and estimated'
    if len(levels) >= 2 and levels[-1].measured > levels[0].measured > 0.0:
        unit, size = force_unit(levels[-1].measured)
        low, high = (f'{x.measured / size:.3g} {unit} at {x.pressure / BAR:.1f} bar' for x in (levels[0], levels[-1]))
        title = f'Sliding friction grows from {low} to {high}'
    elif levels and all(level.both_directions and level.measured > 0.0 for level in levels):
        title = 'Friction changes its sign with the direction of motion'
    usable = usable_inputs(run)
    fastest = _largest(run.velocity[usable])
    speed_name, speed_size = speed_unit(fastest)
    largest = max(_largest(run.force_sum[usable]), _largest(run.friction_force[usable]))
    unit, size = force_unit(largest)
    figure, axes = style.new_figure(title, 4.2, ncols=2, sharex=True, sharey=True)
    good: IntArray = np.flatnonzero(
        usable & np.isfinite(run.velocity) & np.isfinite(run.force_sum) & np.isfinite(run.pressure)
    )
    good = good[:: len(good) // _DOTS + 1]
    good = good[np.argsort(-run.pressure[good], kind='stable')]  # low pressures on top: they reach less far
    panels = ((axes[0], run.force_sum, 'measured: force sum'), (axes[1], run.friction_force, 'estimated'))
    for ax, values, name in panels:
        look = {'s': 5.0, 'lw': 0, 'cmap': 'viridis', 'rasterized': True}
        ax.scatter(run.velocity[good] / speed_size, values[good] / size, c=run.pressure[good] / BAR, **look)
        ax.set(title=name, xlabel=f'rod velocity [{speed_name}]')
        style.zero_lines(ax, vertical=True)
    limit = 1.15 * fastest / speed_size
    axes[0].set(xlim=(-limit, limit), ylim=(-1.15 * largest / size, 1.15 * largest / size), ylabel=f'force [{unit}]')
    figure.colorbar(axes[1].collections[0], ax=axes, label=PRESSURE_LABEL, pad=0.015)
    return Plot('friction_over_velocity', figure)
