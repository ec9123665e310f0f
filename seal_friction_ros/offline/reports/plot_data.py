"""A figure as plain data, which uPlot draws on the page: curves, bands, dots, boxes and lines across, over ascending x.

Any other figure (a loop, a shape, bars with numbers) is shown as its picture. Numbers are 32-bit floats (relative
resolution 6e-8), which is finer than a pixel at any sensible zoom; our choice.
"""

from base64 import b64encode
from collections.abc import Iterator
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import Collection, PolyCollection
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator, NullLocator

_PIXELS = 96.0  # [1/inch] of a browser
_POINTS = 72.0  # [1/inch] of matplotlib
_DASHES = {'--': [6, 3], ':': [2, 3], '-.': [6, 3, 2, 3]}
_NONE = ('None', '', ' ', None)


class _PictureError(Exception):
    """The figure can only be shown as its picture."""


class _Arrays:
    """Arrays of a figure, each stored once."""

    def __init__(self) -> None:
        self.stored: list[str] = []
        self._index: dict[bytes, int] = {}

    def index(self, values: Any) -> int:
        """Index of an array; stores a new one."""
        data = np.asarray(values, dtype='<f4').tobytes()
        if data not in self._index:
            self._index[data] = len(self.stored)
            self.stored.append(b64encode(data).decode())
        return self._index[data]


def plot_data(figure: Figure) -> dict[str, Any] | None:
    """What the script needs to draw a figure, as plain types for JSON; None if only its picture shows it.

    The figure has been rendered.
    """
    arrays, shown = _Arrays(), [ax for ax in figure.axes if ax.get_visible()]
    try:
        panels = [_panel(ax, shown, arrays) for ax in shown]
    except _PictureError:
        return None
    by_column = any(panel['row'] > 1 and not panel['title'] for panel in panels)  # it belongs to the one above it
    panels.sort(key=lambda panel: (panel['column'], panel['row']) if by_column else (panel['row'], panel['column']))
    title: Any = getattr(figure, '_suptitle', None)
    return {'title': title.get_text() if title else '', 'panels': panels, 'arrays': arrays.stored}


def _panel(ax: Axes, shown: list[Axes], arrays: _Arrays) -> dict[str, Any]:
    spec: Any = ax.get_subplotspec()
    if spec is None or ax.child_axes or ax.get_aspect() == 1.0:
        raise _PictureError
    height = ax.get_position().height * float(ax.get_figure().get_figheight()) * _PIXELS  # type: ignore[union-attr]
    artists = sorted((*ax.lines, *ax.collections, *ax.patches, *ax.images, *ax.texts), key=Artist.get_zorder)
    items = [item for artist in artists if artist.get_visible() for item in _items(artist, ax, arrays)]
    return {
        'row': spec.rowspan.start + 1,
        'column': spec.colspan.start + 1,
        'span': len(spec.colspan),
        'height': round(height),
        'title': ax.get_title('left') or ax.get_title(),
        'resolution': max((getattr(line, 'resolution', 0.0) for line in ax.lines), default=0.0),
        'x': _axis(ax, 'x', shown),
        'y': _axis(ax, 'y', shown),
        'items': items,
    }


def _axis(ax: Axes, name: str, shown: list[Axes]) -> dict[str, Any]:
    """Limits, label, fixed ticks, and the quantity, by which the x axes of panels are linked."""
    axis: Any = getattr(ax, f'{name}axis')
    siblings = [one for one in shown if one in getattr(ax, f'get_shared_{name}_axes')().get_siblings(ax)]
    labels = [getattr(one, f'{name}axis').get_label_text() for one in (ax, *siblings)]
    low, high = (float(f'{limit:.7g}') for limit in getattr(ax, f'get_{name}lim')())
    locator, ticks = axis.get_major_locator(), None
    if isinstance(locator, FixedLocator | NullLocator):
        places = [float(place) for place in getattr(locator, 'locs', ())]
        ticks = list(zip(places, axis.get_major_formatter().format_ticks(places), strict=True))
    return {
        'limits': [low, high],
        'log': getattr(ax, f'get_{name}scale')() == 'log',
        'label': labels[0],
        'quantity': next(filter(None, labels), ''),
        'ticks': ticks,
        'labelled': axis.get_major_ticks(1)[0].label1.get_visible() and ticks != [],
    }


def _items(artist: Any, ax: Axes, arrays: _Arrays) -> Iterator[dict[str, Any]]:
    """An artist as items: curves with dots, bands, boxes, lines across."""
    label = str(artist.get_label())
    look = {
        'name': '' if label.startswith('_') else label,
        'opacity': 1.0 if artist.get_alpha() is None else artist.get_alpha(),
    }
    if isinstance(artist, Line2D):
        yield look | _line(artist, ax, arrays)
    elif isinstance(artist, PolyCollection) and artist.get_array() is None:
        outlines = [outline for path in artist.get_paths() if len(outline := np.asarray(path.vertices))]
        look['colour'] = to_hex(_first_colour(artist))
        if all(len(outline) == 5 for outline in outlines):
            yield look | _boxes(outlines, artist, ax, arrays)
        else:
            yield from (look | _band(outline, arrays) for outline in outlines)
    elif hasattr(artist, 'get_xy') and hasattr(artist, 'get_width'):
        (x, y), width, height = artist.get_xy(), artist.get_width(), artist.get_height()
        corners = np.array([(x, y), (x + width, y + height)])
        yield look | {'colour': to_hex(artist.get_facecolor())} | _boxes([corners], artist, ax, arrays)
    else:
        raise _PictureError


def _line(line: Line2D, ax: Axes, arrays: _Arrays) -> dict[str, Any]:
    style, marker, empty = str(line.get_linestyle()), line.get_marker(), str(line.get_markerfacecolor()) == 'none'
    look = {
        'colour': to_hex(line.get_color()),
        'width': 0.0 if style in _NONE else _px(line.get_linewidth()),
        'dash': _DASHES.get(style, []),
        'dot': 0.0 if marker in _NONE else _px(float(line.get_markersize())),
        'empty': empty or marker == 'x',
    }
    x, y = (np.asarray(values, dtype=float) for values in getattr(line, 'detail', None) or line.get_data(orig=False))
    by_x, by_y = line.get_transform().contains_branch_seperately(ax.transData)
    if not (by_x and by_y):
        return look | {'kind': 'across', 'axis': 'y' if by_y else 'x', 'at': float((y if by_y else x)[0])}
    if line.get_drawstyle() != 'default':
        raise _PictureError
    if style in _NONE:
        order = np.argsort(x, kind='stable')
        order = order[np.isfinite(x[order]) & np.isfinite(y[order])]
        x, y = x[order], y[order]
    if np.isnan(x).any() or (np.diff(x) < 0.0).any():
        raise _PictureError
    return look | {'kind': 'curve', 'xs': arrays.index(x), 'ys': arrays.index(y)}


def _band(outline: Any, arrays: _Arrays) -> dict[str, Any]:
    """Band of ``fill_between``, whose outline runs along one side and back along the other."""
    count = (len(outline) - 3) // 2
    one, other = outline[1 : count + 1], outline[count + 2 : 2 * count + 2][::-1]
    if len(one) != len(other) or not np.array_equal(one[:, 0], other[:, 0]) or (np.diff(one[:, 0]) < 0.0).any():
        raise _PictureError
    sides = {'low': arrays.index(one[:, 1]), 'high': arrays.index(other[:, 1])}
    return {'kind': 'band', 'xs': arrays.index(one[:, 0]), **sides}


def _boxes(outlines: list[Any], artist: Any, ax: Axes, arrays: _Arrays) -> dict[str, Any]:
    """Boxes by their lowest and highest x and y; those of full height have no y."""
    corners = np.array([(*outline.min(axis=0), *outline.max(axis=0)) for outline in outlines]).reshape(-1, 4)
    transform = artist.get_data_transform() if hasattr(artist, 'get_data_transform') else artist.get_transform()
    by_x, by_y = transform.contains_branch_seperately(ax.transData)
    if not by_x:
        raise _PictureError
    sides = {'left': corners[:, 0], 'right': corners[:, 2]} | (
        {'low': corners[:, 1], 'high': corners[:, 3]} if by_y else {}
    )
    return {'kind': 'boxes'} | {name: arrays.index(values) for name, values in sides.items()}


def _first_colour(areas: Collection) -> Any:
    colours: Any = areas.get_facecolor()
    return colours[0]


def _px(points: float) -> float:
    return round(points * _PIXELS / _POINTS, 2)
