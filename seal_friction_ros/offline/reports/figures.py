"""Figures of a bag, and the look that all figures of this project share.

Figures are made without pyplot, so nothing is kept between calls, and the same numbers give the same bytes. Colours
are those of Okabe and Ito, which people with any colour vision can tell apart. Long bags are drawn by the lowest and
highest value in each column of pixels, so a figure of an hour is no larger than one of a minute.
"""

import io
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import chain, pairwise
from typing import Any, NamedTuple

import matplotlib.style
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from seal_friction_ros.core.estimation.records import Status
from seal_friction_ros.core.foundation.arrays import BoolArray, FloatArray, IntArray
from seal_friction_ros.core.foundation.units import BAR
from seal_friction_ros.core.friction.states import FrictionState
from seal_friction_ros.offline.reports.bag_evaluation import (
    BAND_95,
    BagEvaluation,
    Event,
    PressureLevel,
    RecordedRun,
    worst,
)

BLACK, GREY, LIGHT_GREY = '#1a1a1a', '#7f7f7f', '#d9d9d9'
BLUE, SKY, ORANGE, VERMILLION, GREEN, PURPLE = '#0072b2', '#56b4e9', '#e69f00', '#d55e00', '#009e73', '#cc79a7'
STATE_COLOURS = {
    FrictionState.UNKNOWN: PURPLE,
    FrictionState.SLIDING: SKY,
    FrictionState.BREAKAWAY: ORANGE,
    FrictionState.STUCK: LIGHT_GREY,
}
WIDTH = 8.6  # [inch]
_COLUMNS = 1200  # of pixels across a figure
_DOTS = 12_000  # in a scatter
_STYLE = {
    'axes.axisbelow': True,
    'axes.grid': True,
    'axes.labelsize': 9.5,
    'axes.linewidth': 0.8,
    'axes.spines.right': False,
    'axes.spines.top': False,
    'axes.titlelocation': 'left',
    'axes.titlepad': 8.0,
    'axes.titlesize': 10.0,
    'figure.titlesize': 12.0,
    'figure.titleweight': 'bold',
    'font.family': ['DejaVu Sans'],
    'font.size': 9.5,
    'grid.color': '#e6e6e6',
    'grid.linewidth': 0.7,
    'legend.fontsize': 9.0,
    'legend.frameon': False,
    'lines.linewidth': 1.4,
    'lines.solid_capstyle': 'round',
    'path.simplify_threshold': 0.2,
    'savefig.dpi': 150,
    'svg.hashsalt': 'seal_friction_ros',
    'text.parse_math': False,
}


class Plot(NamedTuple):
    """One figure."""

    name: str
    """file name without its end"""
    figure: Figure
    caption: str


@contextmanager
def house_style() -> Iterator[None]:
    """The project's look, whatever the user's matplotlibrc says; figures are made and rendered inside."""
    with matplotlib.style.context(['default', _STYLE], after_reset=True):
        yield


def render(figure: Figure) -> dict[str, bytes]:
    """A figure as ``svg`` and ``png``; equal figures give equal bytes."""
    _settle(figure)
    rendered = {}
    for kind, metadata in (('svg', {'Date': None, 'Creator': None}), ('png', {'Software': None})):
        buffer = io.BytesIO()
        figure.savefig(buffer, format=kind, metadata=metadata)
        rendered[kind] = buffer.getvalue()
    return rendered


def _settle(figure: Figure) -> None:
    """Lay the figure out once and for all.

    The solver behind the layout takes its constraints in the order of their addresses in memory, so the last bits of
    the positions differ from run to run, and with them the names of the clip paths in an SVG: rounding removes that.
    """
    figure.draw_without_rendering()
    figure.set_layout_engine('none')
    for ax in figure.axes:
        left, bottom, width, height = (round(value, 5) for value in ax.get_position(original=True).bounds)
        ax.set_position((left, bottom, width, height))


def new_figure(title: str, height: float, **layout: Any) -> tuple[Figure, Any]:
    """Figure with its title at the left and its axes as `Figure.subplots` gives them."""
    figure = Figure(figsize=(WIDTH, height), layout='constrained')
    figure.suptitle(title, x=0.012, ha='left')
    return figure, figure.subplots(**layout)


def legend_above(ax: Axes, **choice: Any) -> None:
    """Legend in a row above the axes, out of the way of the data."""
    ax.legend(
        loc='lower right',
        bbox_to_anchor=(1.0, 1.0),
        ncols=6,
        borderaxespad=0.2,
        columnspacing=1.2,
        handlelength=1.6,
        handletextpad=0.5,
        **choice,
    )


def thinned(values: FloatArray, columns: int = _COLUMNS) -> IntArray:
    """Indices that keep the lowest and the highest value in each of ``columns`` stretches of equal length.

    A line through them looks like the line through all of them. A stretch of NaN keeps its first.
    """
    n = len(values)
    if n <= 4 * columns:
        return np.arange(n)
    length = -(-n // columns)
    padded = np.full(length * columns, np.nan)
    padded[:n] = values
    rows = padded.reshape(columns, length)
    gone = np.isnan(rows)
    low = np.where(gone, np.inf, rows).argmin(axis=1)
    high = np.where(gone, -np.inf, rows).argmax(axis=1)
    first = np.arange(columns) * length
    kept = np.unique(np.concatenate((first + low, first + high, [0, n - 1])))
    return kept[kept < n]


def line(ax: Axes, time: FloatArray, values: FloatArray, **look: Any) -> None:
    """Line over time [s], `thinned`."""
    kept = thinned(values)
    ax.plot(time[kept], values[kept], **look)


def force_unit(largest: float) -> tuple[str, float]:
    """Unit to label forces up to ``largest`` [N] with, and its size in N."""
    return ('kN', 1e3) if largest >= 2e3 else ('N', 1.0)


def _largest(*columns: FloatArray) -> float:
    """Magnitude that all but the wildest values stay below; 1 if there is none."""
    finite = [column[np.isfinite(column)] for column in columns]
    return max((float(np.quantile(np.abs(column), 0.999)) for column in finite if len(column)), default=0.0) or 1.0


def run_figures(run: RecordedRun, evaluation: BagEvaluation) -> list[Plot]:
    """Every figure that the bag has the data for."""
    friction = evaluation.friction
    plots = [live_figure(run, friction.sliding)]
    if friction.sliding or friction.breakaway:
        plots.append(pressure_figure(friction.sliding, friction.breakaway))
    if friction.sliding:
        plots.append(deviation_figure(friction.sliding))
    plots += [velocity_figure(run, friction.sliding), inputs_figure(run)]
    if run.status.any():
        plots.append(status_figure(run))
    return plots


def verdict(levels: Sequence[PressureLevel]) -> str:
    """What the comparison found, in one line."""
    level = worst(levels)
    if level is None:
        return 'No steady sliding to compare the estimate with'
    size = f'{abs(level.deviation_percent or 0.0):.1f} %'
    where = f'at {level.pressure / BAR:.1f} bar'
    if len(levels) == 1:
        side = 'above' if level.deviation > 0.0 else 'below'
        return f'Estimated sliding friction is {size} {side} the measured one {where}'
    return f'Estimated sliding friction is at most {size} off the measured one ({where})'


# -- over time --------------------------------------------------------------------------------------------------------


def live_figure(run: RecordedRun, levels: Sequence[PressureLevel]) -> Plot:
    """Live estimate against measured friction: the whole bag, and a window in which something happens."""
    first, last, level = window(run, levels)
    figure, axes = new_figure(
        verdict(levels), 6.6, nrows=4, gridspec_kw={'height_ratios': [5.0, 0.35, 6.0, 0.35], 'hspace': 0.02}
    )
    everything = slice(0, len(run.time))
    _friction_over_time(axes[0], run, everything, None)
    _state_strip(axes[1], run, everything)
    axes[0].axvspan(run.time[first], run.time[last], color=BLACK, alpha=0.08, lw=0)
    axes[0].set_title('Whole bag')
    legend_above(axes[0])
    part = slice(first, last + 1)
    _friction_over_time(axes[2], run, part, level)
    _state_strip(axes[3], run, part)
    axes[2].set_title('Shaded part' if level is None else f'Shaded part, at {level.pressure / BAR:.1f} bar')
    _state_legend(axes[3], run)
    axes[3].set_xlabel('time since the first estimate [s]', loc='left')
    if level is not None and _offset_matters(level):
        handles, labels = axes[2].get_legend_handles_labels()
        legend_above(axes[2], handles=handles[1:3], labels=labels[1:3])  # the others stand above the first plot
    return Plot(
        'live_estimate',
        figure,
        'Force sum (measured) and estimated friction force over time. In steady sliding the force sum is the friction; '
        'while the rod starts, stops or reverses it also accelerates the mass. The band is the Coulomb friction '
        f'± {BAND_95} standard deviations, in both directions. The strip below each plot shows the state.',
    )


def window(run: RecordedRun, levels: Sequence[PressureLevel]) -> tuple[int, int, PressureLevel | None]:
    """First and last index of a part worth a closer look, and its pressure level.

    Two neighbouring strokes in opposite directions, if there are, of the middle pressure level, with the rest before
    them; else the hundredth of the bag around the largest friction force.
    """
    if levels:
        level = levels[len(levels) // 2]
        events = sorted(level.events, key=lambda event: event.first)
        pairs = [(a, b) for a, b in pairwise(events) if a.direction != b.direction]
        one, other = _nearest(pairs) if pairs else (events[0], events[0])
        at_rest = run.state != FrictionState.SLIDING
        first = one.first
        while first > 0 and at_rest[first - 1]:
            first -= 1
        margin = (other.last - first) // 20 + 1
        return max(first - margin, 0), min(other.last + margin, len(run.time) - 1), level
    half = max(len(run.time) // 200, 100)
    middle = int(np.argmax(np.abs(run.friction_force)))
    return max(middle - half, 0), min(middle + half, len(run.time) - 1), None


def _nearest(pairs: Sequence[tuple[Event, Event]]) -> tuple[Event, Event]:
    """Pair with the least between its strokes; of equal ones the middle one, as the first may still be running in."""
    gaps = [b.first - a.last for a, b in pairs]
    near = [pair for pair, gap in zip(pairs, gaps, strict=True) if gap <= 2 * min(gaps) + 1]
    return near[len(near) // 2]


def _offset_matters(level: PressureLevel) -> bool:
    return level.offset is not None and abs(level.offset) > 0.1 * abs(level.measured)


def _friction_over_time(ax: Axes, run: RecordedRun, part: slice, level: PressureLevel | None) -> None:
    time, coulomb, std = run.time[part], run.coulomb_friction[part], run.coulomb_friction_std[part]
    largest = max(_largest(run.breakaway_force[part]), _largest(run.force_sum[part]))
    unit, size = force_unit(largest)
    kept = thinned(coulomb)
    low, high = (coulomb - BAND_95 * std)[kept] / size, (coulomb + BAND_95 * std)[kept] / size
    for side, label in ((1.0, 'Coulomb friction, 95 % band'), (-1.0, None)):
        ax.fill_between(time[kept], side * low, side * high, color=SKY, alpha=0.35, lw=0, label=label)
    if level is not None and _offset_matters(level):
        offset = level.offset or 0.0
        line(ax, time, run.force_sum[part] / size, color=GREY, lw=0.8, ls=':', label='force sum')
        name = f'force sum less its offset of {offset / size:.3g} {unit}'
        line(ax, time, (run.force_sum[part] - offset) / size, color=BLACK, lw=1.0, label=name)
    else:
        line(ax, time, run.force_sum[part] / size, color=BLACK, lw=1.0, label='force sum (measured)')
    line(ax, time, run.friction_force[part] / size, color=BLUE, lw=1.6, alpha=0.9, label='estimated friction force')
    ax.axhline(0.0, color=GREY, lw=0.6)
    ax.set_ylim(-1.15 * largest / size, 1.15 * largest / size)
    ax.set_xlim(time[0], time[-1] if time[-1] > time[0] else time[0] + 1.0)
    ax.set_ylabel(f'force [{unit}]')
    ax.tick_params(labelbottom=False)


def _columns(run: RecordedRun, part: slice) -> tuple[IntArray, float, float]:
    """Index of the estimate that holds at each column of pixels, and the times of the first and last column [s]."""
    time = np.maximum.accumulate(run.time[part])
    grid = np.linspace(time[0], time[-1], min(_COLUMNS, 4 * len(time)))
    held = np.searchsorted(time, grid, side='right') - 1
    return np.clip(held, 0, len(time) - 1) + (part.start or 0), float(time[0]), float(time[-1])


def _state_strip(ax: Axes, run: RecordedRun, part: slice) -> None:
    index, first, last = _columns(run, part)
    last = last if last > first else first + 1.0
    colours = ListedColormap([STATE_COLOURS[state] for state in FrictionState])
    ax.imshow(
        run.state[index][np.newaxis],
        aspect='auto',
        cmap=colours,
        extent=(first, last, 0.0, 1.0),
        interpolation='nearest',
        vmin=-0.5,
        vmax=len(FrictionState) - 0.5,
    )
    ax.set_yticks([])
    ax.grid(visible=False)
    ax.set_ylabel('state', rotation=0, ha='right', va='center')


def _state_legend(ax: Axes, run: RecordedRun) -> None:
    present = [state for state in FrictionState if (run.state == state).any()]
    patches = [Patch(color=STATE_COLOURS[state], label=state.name.lower()) for state in present]
    ax.legend(
        handles=patches, loc='upper right', bbox_to_anchor=(1.0, -1.4), ncols=4, borderaxespad=0.0, handlelength=1.0
    )


def inputs_figure(run: RecordedRun) -> Plot:
    """What the estimator was given, over time."""
    low, high = _pressure_range(run)
    title = f'Inputs: {low:.1f} to {high:.1f} bar, {run.time.max() - run.time.min():.0f} s'
    figure, axes = new_figure(title, 5.4, nrows=3, sharex=True)
    same = np.array_equal(run.pressure_a, run.pressure_b, equal_nan=True)
    name = 'chambers a and b' if same else 'chamber a'
    line(axes[0], run.time, run.pressure_a / BAR, color=BLUE, lw=1.1, label=name)
    if not same:
        line(axes[0], run.time, run.pressure_b / BAR, color=ORANGE, lw=1.1, label='chamber b')
    legend_above(axes[0])
    axes[0].set_ylabel('pressure\n[bar, gauge]')
    name, size = ('m/s', 1.0) if _largest(run.velocity) >= 1.0 else ('mm/s', 1e-3)
    line(axes[1], run.time, run.velocity / size, color=GREEN, lw=1.0)
    axes[1].set_ylabel(f'rod velocity\n[{name}]')
    name, size = force_unit(_largest(run.force_sum))
    line(axes[2], run.time, run.force_sum / size, color=BLACK, lw=1.0)
    axes[2].set_ylabel(f'force sum\n[{name}]')
    axes[2].set_xlabel('time since the first estimate [s]')
    axes[2].set_xlim(run.time.min(), max(run.time.max(), run.time.min() + 1e-3))
    return Plot(
        'inputs',
        figure,
        'Pressure, rod velocity and force sum as they were held at each estimate. Positive is extension. Where there '
        'are more samples than pixels, the line spans the lowest and the highest value of each column.',
    )


def _pressure_range(run: RecordedRun) -> tuple[float, float]:
    finite = run.pressure[np.isfinite(run.pressure)]
    return (float(finite.min()) / BAR, float(finite.max()) / BAR) if len(finite) else (0.0, 0.0)


def status_figure(run: RecordedRun) -> Plot:
    """When each status bit was set."""
    bits = [bit for bit in Status if (run.status & int(bit)).any()]
    share = 100.0 * np.count_nonzero(run.status) / len(run.status)
    figure, ax = new_figure(f'{share:.3g} % of the estimates carry a status bit', 1.6 + 0.34 * len(bits))
    grid = np.linspace(run.time.min(), max(run.time.max(), run.time.min() + 1e-3), _COLUMNS + 1)
    column = np.clip(np.searchsorted(grid, run.time, side='right') - 1, 0, _COLUMNS - 1)
    for row, bit in enumerate(bits):
        hit = np.zeros(_COLUMNS, dtype=np.bool_)
        hit[column[run.status & int(bit) != 0]] = True
        ax.broken_barh(_spans(hit, grid), (row - 0.32, 0.64), color=VERMILLION, lw=0)
    ax.set_yticks(range(len(bits)), [str(bit.name).lower().replace('_', ' ') for bit in bits])
    ax.set_ylim(len(bits) - 0.5, -0.5)
    ax.set_xlim(grid[0], grid[-1])
    ax.set_xlabel('time since the first estimate [s]')
    ax.grid(visible=False, axis='y')
    return Plot(
        'status',
        figure,
        'Status bits over time; a bar is at least one column of pixels wide, so that a single estimate is seen.',
    )


def _spans(hit: BoolArray, grid: FloatArray) -> list[tuple[float, float]]:
    """Start and width of each run of hit columns."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], hit, [False]))))
    return [(float(grid[a]), float(grid[b] - grid[a])) for a, b in edges.reshape(-1, 2)]


# -- over pressure and velocity ---------------------------------------------------------------------------------------


def pressure_figure(sliding: Sequence[PressureLevel], breakaway: Sequence[PressureLevel]) -> Plot:
    """Measured and estimated friction over pressure, sliding and at breakaway."""
    figure, ax = new_figure(_pressure_title(sliding), 4.6)
    unit, size = force_unit(max(level.estimated for level in chain(sliding, breakaway)))
    kinds = (
        (sliding, 'sliding', BLUE, '-', 'o', BLACK),
        (breakaway, 'breakaway', ORANGE, '--', 's', VERMILLION),
    )
    for levels, name, colour, dashes, marker, dot in kinds:
        if not levels:
            continue
        pressure = np.array([level.pressure for level in levels]) / BAR
        estimated = np.array([level.estimated for level in levels]) / size
        if name == 'sliding':
            half = BAND_95 * np.array([level.estimated_std for level in levels]) / size
            _band(ax, pressure, estimated - half, estimated + half)
        style = {'marker': '_', 'ms': 14, 'mew': 2.0} if len(levels) == 1 else {}
        ax.plot(pressure, estimated, color=colour, ls=dashes, lw=1.8, label=f'{name}, estimated', **style)
        _readings(ax, levels, size, marker, dot)
        measured = [level.measured / size for level in levels]
        ax.plot(pressure, measured, ls='', marker=marker, ms=6.5, color=dot, mec='white', label=f'{name}, measured')
    ax.set_ylim(bottom=0.0)
    highest = max(level.pressure for level in chain(sliding, breakaway)) / BAR
    ax.set_xlim(-0.03 * highest, 1.05 * highest if highest > 0.0 else 1.0)
    ax.set_xlabel('pressure at the seals [bar, gauge]')
    ax.set_ylabel(f'friction of all seals [{unit}]')
    ax.legend(loc='upper left')
    return Plot(
        'friction_over_pressure',
        figure,
        'Measured and estimated friction at each pressure. Large marks are the mean of a pressure, small ones single '
        'strokes (starts for breakaway), offset of the force sum removed. The band is where 95 % of new readings of '
        'the sliding friction are expected.',
    )


def _pressure_title(sliding: Sequence[PressureLevel]) -> str:
    events = sum(len(level.events) for level in sliding)
    if not events:
        return 'Breakaway force over pressure'
    inside = sum(level.in_band for level in sliding)
    return f'{inside} of {events} measured strokes lie in the 95 % band of the estimate'


def _band(ax: Axes, pressure: FloatArray, low: FloatArray, high: FloatArray) -> None:
    if len(pressure) == 1:
        ax.errorbar(
            pressure,
            (low + high) / 2.0,
            (high - low) / 2.0,
            color=SKY,
            lw=10.0,
            alpha=0.45,
            ls='',
            label='sliding, 95 % band',
        )
    else:
        ax.fill_between(pressure, low, high, color=SKY, alpha=0.3, lw=0, label='sliding, 95 % band')


def _readings(ax: Axes, levels: Sequence[PressureLevel], size: float, marker: str, colour: str) -> None:
    events = [(event, level) for level in levels for event in level.events]
    events = events[:: len(events) // 3000 + 1]
    x = [event.pressure / BAR for event, _ in events]
    y = [level.reading(event) / size for event, level in events]
    ax.plot(x, y, ls='', marker=marker, ms=3.5, color=colour, alpha=0.35, mew=0.0)


def deviation_figure(levels: Sequence[PressureLevel]) -> Plot:
    """Deviation of the estimate at each pressure level."""
    figure, ax = new_figure(verdict(levels), 3.4)
    shown = [level for level in levels if level.deviation_percent is not None]
    place = np.arange(len(shown))
    band = np.array([100.0 * BAND_95 * level.estimated_std / level.measured for level in shown])
    deviation = np.round([level.deviation_percent or 0.0 for level in shown], 1)
    ax.bar(place, 2.0 * band, 0.86, bottom=-band, color=SKY, alpha=0.3, lw=0, label='95 % band of one reading')
    ax.bar(place, deviation, 0.5, color=BLUE, label='estimated less measured')
    for x, value in zip(place, deviation, strict=True):
        ax.annotate(
            f'{value + 0.0:+.1f}'.replace('-', '\N{MINUS SIGN}'),
            (x, value),
            (0, 3 if value >= 0.0 else -3),
            textcoords='offset points',
            ha='center',
            va='bottom' if value >= 0.0 else 'top',
            fontsize=9.0,
        )
    ax.axhline(0.0, color=BLACK, lw=0.8)
    ax.set_xticks(place, [f'{level.pressure / BAR:.1f}' for level in shown])
    ax.set_xlim(-0.7, max(len(shown), 4) - 0.3)
    ax.grid(visible=False, axis='x')
    ax.set_xlabel('pressure at the seals [bar, gauge]')
    ax.set_ylabel('deviation [%]')
    largest = 1.2 * max(float(np.abs(deviation).max()), float(band.max()), 1.0) if shown else 1.0
    ax.set_ylim(-largest, largest)
    legend_above(ax)
    return Plot(
        'deviation',
        figure,
        'Deviation of the mean estimated from the mean measured sliding friction, as a share of the measured one.',
    )


def _velocity_title(levels: Sequence[PressureLevel]) -> str:
    if len(levels) >= 2 and levels[-1].measured > levels[0].measured > 0.0:
        low, high = levels[0], levels[-1]
        unit, size = force_unit(high.measured)
        return (
            f'Sliding friction grows from {low.measured / size:.3g} {unit} at {low.pressure / BAR:.1f} bar '
            f'to {high.measured / size:.3g} {unit} at {high.pressure / BAR:.1f} bar'
        )
    if levels and all(level.both_directions and level.measured > 0.0 for level in levels):
        return 'Friction changes its sign with the motion'
    return 'Friction over velocity, measured and estimated'


def velocity_figure(run: RecordedRun, levels: Sequence[PressureLevel]) -> Plot:
    """Friction over velocity, measured and estimated, coloured by pressure."""
    size_v, unit_v = (1.0, 'm/s') if _largest(run.velocity) >= 1.0 else (1e-3, 'mm/s')
    limit_f = max(_largest(run.force_sum), _largest(run.friction_force))
    unit, size = force_unit(limit_f)
    figure, axes = new_figure(_velocity_title(levels), 4.2, ncols=2, sharex=True, sharey=True)
    good = np.flatnonzero(np.isfinite(run.velocity) & np.isfinite(run.force_sum) & np.isfinite(run.pressure))
    good = good[:: len(good) // _DOTS + 1]
    good = good[np.argsort(-run.pressure[good], kind='stable')]  # low pressures, which reach less far, on top
    for ax, values, name in (
        (axes[0], run.force_sum, 'measured: force sum'),
        (axes[1], run.friction_force, 'estimated'),
    ):
        ax.scatter(
            run.velocity[good] / size_v,
            values[good] / size,
            c=run.pressure[good] / BAR,
            s=5.0,
            lw=0,
            cmap='viridis',
            rasterized=True,
        )
        ax.set_title(name)
        ax.set_xlabel(f'rod velocity [{unit_v}]')
        ax.axhline(0.0, color=GREY, lw=0.6, zorder=0)
        ax.axvline(0.0, color=GREY, lw=0.6, zorder=0)
    limit_v = 1.15 * _largest(run.velocity) / size_v
    axes[0].set_xlim(-limit_v, limit_v)
    axes[0].set_ylim(-1.15 * limit_f / size, 1.15 * limit_f / size)
    axes[0].set_ylabel(f'force [{unit}]')
    figure.colorbar(axes[1].collections[0], ax=axes, label='pressure at the seals [bar, gauge]', pad=0.015)
    return Plot(
        'friction_over_velocity',
        figure,
        'The hysteresis picture. Left: force sum over velocity, offset and inertia included; right: the estimate. '
        'Vertical lines at zero velocity are the rod at rest, where friction is what the force sum is.',
    )
