"""Style of all figures, and parts that several figures share.

Figures are made without pyplot, so there is no global state, and the same numbers give the same bytes. The colours are
those of Okabe and Ito, which are distinct for all types of colour vision. A long recording is drawn through the lowest
and the highest value in each column of pixels, so the size of a figure does not grow with the recording.
"""

import io
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any, NamedTuple

import matplotlib.style
import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from seal_friction_ros.core.foundation.arrays import BoolArray, FloatArray, IntArray

BLACK, GREY, LIGHT_GREY = '#1a1a1a', '#7f7f7f', '#d9d9d9'
BLUE, SKY, ORANGE, VERMILLION, GREEN, PURPLE = '#0072b2', '#56b4e9', '#e69f00', '#d55e00', '#009e73', '#cc79a7'
WIDTH = 8.6  # [inch]
_LEGEND_HEIGHT = 0.3  # [inch]
_PANELS = 3  # in a row
COLUMNS = 1200  # of pixels across a figure
DETAIL = 4000  # the same for the figure of a page, which is zoomed
_LONGEST_STEP = 10.0  # usual steps between two values that a line joins (our choice)
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
    """One figure of a page."""

    name: str  # file name without suffix, and id on the page
    figure: Figure


@contextmanager
def house_style() -> Iterator[None]:
    """The common style, independent of the user's matplotlibrc; make and render figures inside this context."""
    with matplotlib.style.context(['default', _STYLE], after_reset=True):
        yield


def render(figure: Figure) -> dict[str, bytes]:
    """A figure as ``svg`` and ``png``; equal figures give equal bytes."""
    _fix_layout(figure)
    rendered = {}
    for kind, metadata in (('svg', {'Date': None, 'Creator': None}), ('png', {'Software': None})):
        buffer = io.BytesIO()
        figure.savefig(buffer, format=kind, metadata=metadata)
        rendered[kind] = buffer.getvalue()
    return rendered


def _fix_layout(figure: Figure) -> None:
    """Lay the figure out once, with rounded positions.

    The layout solver orders its constraints by memory address, so the last bits of the positions, and with them the
    names of the clip paths in an SVG, differ from run to run. Rounding removes the difference.
    """
    figure.draw_without_rendering()
    figure.set_layout_engine('none')
    for ax in figure.axes:
        left, bottom, width, height = (round(value, 5) for value in ax.get_position(original=True).bounds)
        ax.set_position((left, bottom, width, height))


def new_figure(title: str, height: float, **layout: Any) -> tuple[Figure, Any]:
    """Figure of a height [inch] with its title at the left, and its axes as `Figure.subplots` returns them."""
    figure = Figure(figsize=(WIDTH, height), layout='constrained')
    figure.suptitle(title, x=0.012, ha='left')
    return figure, figure.subplots(**layout)


def panels(title: str, count: int, height: float) -> tuple[Figure, list[Axes]]:
    """Figure of ``count`` panels of a height [inch] in rows, all on the same axes."""
    rows = -(-count // _PANELS)
    layout: dict[str, Any] = {
        'nrows': rows,
        'ncols': min(count, _PANELS),
        'squeeze': False,
        'sharex': True,
        'sharey': True,
    }
    figure, axes = new_figure(title, 0.6 + height * rows, **layout)
    flat = list(axes.ravel())
    for ax in flat[count:]:
        ax.set_visible(False)
    return figure, flat[:count]


def label_panels(axes: Sequence[Axes], xlabel: str, ylabel: str) -> None:
    """Label the lowest panel of each column and the first panel of each row."""
    for ax in axes[-_PANELS:]:
        ax.set_xlabel(xlabel)
        ax.tick_params(labelbottom=True)
    for ax in axes[::_PANELS]:
        ax.set_ylabel(ylabel)


def shades(labels: Sequence[str]) -> list[dict[str, Any]]:
    """Look of the curve of each value: a colour of its own, from dark to light, and its label."""
    colours = colormaps['viridis'](np.linspace(0.0, 0.85, len(labels)))
    return [{'color': colour, 'label': label} for colour, label in zip(colours, labels, strict=True)]


def legend_below(figure: Figure, ax: Axes, columns: int, **look: Any) -> None:
    """Legend of the artists of ``ax`` in one row below all axes of a figure of `new_figure`."""
    share = _LEGEND_HEIGHT / figure.get_figheight()
    engine: Any = figure.get_layout_engine()
    if engine is not None:
        engine.set(rect=(0.0, share, 1.0, 1.0 - share))
    figure.legend(*ax.get_legend_handles_labels(), loc='lower right', ncols=columns, **look)


def legend_above(ax: Axes, chosen: slice = slice(None)) -> None:
    """Legend in a row above the axes, with opaque dots; only the ``chosen`` of the labelled artists."""
    handles, labels = ax.get_legend_handles_labels()
    place: dict[str, Any] = {'loc': 'lower right', 'bbox_to_anchor': (1.0, 1.0), 'borderaxespad': 0.2}
    spacing: dict[str, Any] = {'ncols': 6, 'columnspacing': 1.2, 'handlelength': 1.6, 'handletextpad': 0.5}
    legend = ax.legend(handles[chosen], labels[chosen], **place, **spacing)
    for handle in legend.get_lines():
        if handle.get_linestyle() == 'None':
            handle.set_alpha(1.0)


def finished(name: str, figure: Figure, ax: Axes, *others: Axes, **settings: Any) -> Plot:
    """The figure, with ``settings`` of an axis (as `Axes.set`), and the legends above it and ``others``."""
    ax.set(**settings)
    for one in (ax, *others):
        legend_above(one)
    return Plot(name, figure)


def figure_18(figure: Figure, ax: Axes, unit: str) -> Plot:
    """Coefficient of friction over normal force, with the axes of Figure 18 of the thesis."""
    labels = {'xlabel': f'normal force of one seal [{unit}]', 'ylabel': 'coefficient of dynamic friction [-]'}
    return finished('fig18_coefficient_of_friction', figure, ax, xlim=(0.0, None), ylim=(0.0, None), **labels)


def figure_19(figure: Figure, ax: Axes, unit: str) -> Plot:
    """Normal over axial force, with the axes of Figure 19 of the thesis."""
    xlabel = f'axial force of one seal, pressure times projected area [{unit}]'
    labels = {'xlabel': xlabel, 'ylabel': f'normal force of one seal [{unit}]'}
    return finished('fig19_normal_force', figure, ax, ylim=(0.0, None), **labels)


def zero_lines(ax: Axes, *, vertical: bool = False) -> None:
    """Thin line at zero of the y axis, and with ``vertical`` at zero of the x axis too."""
    ax.axhline(0.0, color=GREY, lw=0.6, zorder=1.0)
    if vertical:
        ax.axvline(0.0, color=GREY, lw=0.6, zorder=1.0)


def fill_band(ax: Axes, x: FloatArray, middle: FloatArray, half: FloatArray, **look: Any) -> None:
    """Band of ``half`` on both sides of ``middle``."""
    ax.fill_between(x, middle - half, middle + half, **{'color': SKY, 'alpha': 0.3, 'lw': 0, **look})


def thinned(values: FloatArray, columns: int = COLUMNS) -> IntArray:
    """Indices that keep the lowest and the highest value in each of ``columns`` parts of equal length.

    A line through these values looks like the line through all values. A part of NaN keeps its first value.
    """
    n = len(values)
    if n <= 4 * columns:
        return np.arange(n)
    length = -(-n // columns)
    padded = np.full(length * columns, np.nan)
    padded[:n] = values
    rows = padded.reshape(columns, length)
    missing = np.isnan(rows)
    low = np.where(missing, np.inf, rows).argmin(axis=1)
    high = np.where(missing, -np.inf, rows).argmax(axis=1)
    first = np.arange(columns) * length
    kept = np.unique(np.concatenate((first + low, first + high, [0, n - 1])))
    return kept[kept < n]


def thin_line(ax: Axes, x: FloatArray, values: FloatArray, **look: Any) -> None:
    """Line over ``x``, `thinned`; in the figure of the page less so, since one zooms in there.

    The line has a gap where no value is for longer than `_LONGEST_STEP` usual steps of ``x``.
    """
    order = np.argsort(x, kind='stable')
    order = order[np.isfinite(values[order])]
    x, values = x[order], values[order]
    step = np.diff(x)
    gaps = np.cumsum(step > _LONGEST_STEP * np.median(step)) if len(step) else np.zeros(0)
    number = np.concatenate(([0], gaps))[: len(x)]  # of gaps before each value
    coarse, fine = (_with_gaps(x, values, number, thinned(values, columns)) for columns in (COLUMNS, DETAIL))
    line: Any = ax.plot(*coarse, **look)[0]
    line.detail = fine
    line.resolution = float(x[-1] - x[0]) / DETAIL if len(x) > 4 * DETAIL else 0.0


def _with_gaps(x: FloatArray, values: FloatArray, number: FloatArray, kept: IntArray) -> tuple[FloatArray, FloatArray]:
    """Kept values, and NaN between two with a gap between them."""
    places = np.flatnonzero(np.diff(number[kept])) + 1
    return np.insert(x[kept], places, x[kept][places - 1]), np.insert(values[kept], places, np.nan)


def usable_range(usable: BoolArray, *curves: FloatArray) -> tuple[float, float]:
    """Lowest and highest finite value of some curves where they are usable; anywhere, if they never are."""
    for where in (usable, np.ones_like(usable)):
        values = np.concatenate([curve[where & np.isfinite(curve)] for curve in curves])
        if len(values):
            return float(values.min()), float(values.max())
    return 0.0, 1.0


def fit_axis(ax: Axes, x: FloatArray, usable: BoolArray, *curves: FloatArray) -> None:
    """Limit the y axis to the `usable_range` of its curves, and `mark_beyond` it."""
    low, high = usable_range(usable, *curves)
    pad = 0.06 * (high - low) or 0.01 * abs(high) or 1.0
    ax.set_ylim(low - pad, high + pad)
    mark_beyond(ax, x, *curves)


def mark_beyond(ax: Axes, x: FloatArray, *curves: FloatArray) -> None:
    """Mark values beyond the y axis at its edges, with their count."""
    low, high = ax.get_ylim()
    for edge, marker, sign in ((high, '^', 1.0), (low, 'v', -1.0)):
        outside = [sign * np.nan_to_num(curve, nan=0.5 * (low + high)) > sign * edge for curve in curves]
        if count := sum(int(where.sum()) for where in outside):
            places = x[np.any(outside, axis=0)]
            places = places[:: len(places) // COLUMNS + 1]
            example = next(curve[where][0] for curve, where in zip(curves, outside, strict=True) if where.any())
            look: dict[str, Any] = {'color': VERMILLION, 'ms': 6.0, 'clip_on': False, 'marker': marker, 'ls': ''}
            ax.plot(places, np.full(len(places), edge), **look, label=f'{count} beyond, such as {example:.3g}')
    ax.set_ylim(low, high)


def true_spans(time: FloatArray, where: BoolArray) -> list[tuple[float, float]]:
    """Start and length of each span of time in which ``where`` holds; a sample lasts until the next time."""
    edges = np.flatnonzero(np.diff(where[: len(time) - 1], prepend=False, append=False))
    return [(float(time[a]), float(time[b] - time[a])) for a, b in edges.reshape(-1, 2)]


def shade(ax: Axes, time: FloatArray, where: BoolArray, label: str | None = None) -> None:
    """Shade the times at which ``where`` holds."""
    if spans := true_spans(time, where):
        look: dict[str, Any] = {'color': LIGHT_GREY, 'alpha': 0.7, 'lw': 0, 'zorder': 0.5, 'label': label}
        ax.broken_barh(spans, (0.0, 1.0), transform=ax.get_xaxis_transform(), **look)
