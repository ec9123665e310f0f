"""A figure as plain data, which the script of the page draws again: to zoom, to pan, to read values, at any width.

Text stays readable on a narrow page, since panels are stacked there and nothing is scaled down. Numbers are 32-bit
floats (relative resolution 6e-8), which is finer than a pixel at any sensible zoom; our choice.
"""

from base64 import b64encode
from collections.abc import Iterator
from typing import Any

import numpy as np
from matplotlib import cbook
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import Collection, LineCollection, PathCollection, PolyCollection
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.text import Annotation
from matplotlib.ticker import FixedLocator, NullLocator

from seal_friction_ros.core.foundation.arrays import FloatArray

_PIXELS = 96.0  # [1/inch] of a browser
_POINTS = 72.0  # [1/inch] of matplotlib
_SHADES = 24  # colours of a scale; finer steps are not seen
_COLORBAR = '<colorbar>'  # label that matplotlib gives the axes of one
_DASHES = {'--': '6 3', ':': '2 3', '-.': '6 3 2 3'}


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


def plot_data(figure: Figure) -> dict[str, Any]:
    """Everything that the script needs to draw a figure, as plain types for JSON; the figure has been rendered.

    Raises:
        TypeError: The figure has an artist of a kind that the script cannot draw.
    """
    arrays = _Arrays()
    shown = [ax for ax in figure.axes if ax.get_visible() and ax.get_label() != _COLORBAR]
    named = _legend_colours(figure)
    panels = [_panel(ax, shown, arrays, named) for ax in shown]
    title = figure.get_suptitle() if hasattr(figure, 'get_suptitle') else getattr(figure._suptitle, '_text', '')  # type: ignore[attr-defined]
    spec = shown[0].get_subplotspec() if shown else None
    return {
        'title': title,
        'columns': 1 if spec is None else spec.get_gridspec().ncols,
        'panels': panels,
        'legend': _legend(shown, named),
        'scale': _colour_scale(figure),
        'arrays': arrays.stored,
    }


# -- panels -----------------------------------------------------------------------------------------------------------


def _panel(ax: Axes, shown: list[Axes], arrays: _Arrays, named: dict[str, str]) -> dict[str, Any]:
    spec: Any = ax.get_subplotspec()
    height = ax.get_position().height * float(ax.get_figure().get_figheight()) * _PIXELS  # type: ignore[union-attr]
    items = sorted(_items(ax, arrays, named), key=lambda pair: pair[0])
    return {
        'row': spec.rowspan.start,
        'column': spec.colspan.start,
        'span': len(spec.colspan),
        'height': round(height),
        'equal': ax.get_aspect() == 1.0,
        'title': ax.get_title('left') or ax.get_title(),
        'x': _axis(ax, 'x', shown),
        'y': _axis(ax, 'y', shown),
        'second': _second_axis(ax),
        'items': [item for _, item in items],
    }


def _axis(ax: Axes, name: str, shown: list[Axes]) -> dict[str, Any]:
    """Limits, label, fixed ticks, and what it is linked with."""
    axis: Any = getattr(ax, f'{name}axis')
    siblings = [one for one in shown if one in getattr(ax, f'get_shared_{name}_axes')().get_siblings(ax)]
    own = axis.get_label_text()
    label = own or next((text for one in siblings if (text := getattr(one, f'{name}axis').get_label_text())), '')
    quantity = next((text for one in siblings if (text := getattr(one, f'{name}_quantity', ''))), label)
    low, high = (float(f'{limit:.7g}') for limit in getattr(ax, f'get_{name}lim')())
    locator, ticks = axis.get_major_locator(), None
    if isinstance(locator, FixedLocator | NullLocator):
        places = [float(place) for place in getattr(locator, 'locs', ())]
        ticks = list(zip(places, axis.get_major_formatter().format_ticks(places), strict=True))
    return {
        'limits': [low, high],
        'log': getattr(ax, f'get_{name}scale')() == 'log',
        'label': own,
        'quantity': quantity,
        'ticks': ticks,
        'labelled': axis.get_major_ticks(1)[0].label1.get_visible() and ticks != [],
        'group': shown.index(siblings[0]),
    }


def _second_axis(ax: Axes) -> dict[str, Any] | None:
    """Label of a second x axis above, and what it shows at both ends."""
    for other in ax.child_axes:
        return {'label': other.get_xlabel(), 'limits': [float(limit) for limit in other.get_xlim()]}
    return None


def _colour_scale(figure: Figure) -> dict[str, Any] | None:
    """Label, ends and colours of the colour bar."""
    for ax in figure.axes:
        if ax.get_label() == _COLORBAR:
            bar: Any = ax._colorbar  # type: ignore[attr-defined]
            colours = [to_hex(bar.cmap(share)) for share in np.linspace(0.0, 1.0, _SHADES)]
            low, high = float(bar.norm.vmin), float(bar.norm.vmax)
            return {'label': ax.get_ylabel(), 'limits': [low, high], 'colours': colours}
    return None


# -- legend -----------------------------------------------------------------------------------------------------------


def _legend_colours(figure: Figure) -> dict[str, str]:
    """Names of colours that a legend explains by a patch of its own, for artists without a name."""
    legends = [legend for ax in figure.axes if (legend := ax.get_legend())]
    found = {}
    for legend in (*legends, *figure.legends):
        for handle, text in _entries(legend):
            if isinstance(handle, Patch):
                found[to_hex(handle.get_facecolor())] = text
    return found


def _entries(legend: Legend) -> Iterator[tuple[Artist, str]]:
    name = 'legend_handles' if hasattr(legend, 'legend_handles') else 'legendHandles'  # before matplotlib 3.7
    handles: Any = getattr(legend, name)
    yield from zip(handles, (text.get_text() for text in legend.get_texts()), strict=True)


def _legend(shown: list[Axes], named: dict[str, str]) -> list[dict[str, Any]]:
    """Name, colour and kind of each entry, once."""
    entries: dict[str, dict[str, Any]] = {}
    for ax in shown:
        for handle, label in zip(*ax.get_legend_handles_labels(), strict=True):
            entries.setdefault(label, {'name': label, **_swatch(handle)})
    for colour, label in named.items():
        entries.setdefault(label, {'name': label, 'colour': colour, 'kind': 'area', 'dash': '', 'opacity': 1.0})
    return list(entries.values())


def _swatch(handle: Any) -> dict[str, Any]:
    """How an entry is drawn."""
    if not isinstance(handle, Artist):  # a container of bars or error bars
        handle = handle.patches[0] if hasattr(handle, 'patches') else handle.lines[0] or handle.lines[2][0]
    if isinstance(handle, Line2D):
        is_line = handle.get_linestyle() not in ('None', '', ' ')
        look = {'kind': 'line' if is_line else 'dots', 'dash': _DASHES.get(str(handle.get_linestyle()), '')}
        return {
            'colour': to_hex(handle.get_color()),
            'opacity': _opacity(handle) if look['kind'] == 'dots' else 1.0,
            **look,
        }
    colour = handle.get_facecolor() if isinstance(handle, Patch) else _first_colour(handle)
    kind = 'dots' if isinstance(handle, PathCollection) else 'area'
    return {'colour': to_hex(colour), 'kind': kind, 'dash': '', 'opacity': _opacity(handle)}


def _first_colour(handle: Collection) -> Any:
    colours: Any = handle.get_facecolor()
    edges: Any = handle.get_edgecolor()
    return colours[0] if len(colours) else edges[0]


# -- artists ----------------------------------------------------------------------------------------------------------


def _items(ax: Axes, arrays: _Arrays, named: dict[str, str]) -> Iterator[tuple[float, dict[str, Any]]]:
    """Every artist with its z order."""
    for artist in (*ax.lines, *ax.collections, *ax.patches, *ax.images, *ax.texts):
        if not artist.get_visible():
            continue
        for item in _drawn(artist, ax, arrays, named):
            label = str(artist.get_label())
            name = '' if label.startswith('_') else label
            yield artist.get_zorder(), {'name': name, **item}


def _drawn(artist: Any, ax: Axes, arrays: _Arrays, named: dict[str, str]) -> Iterator[dict[str, Any]]:
    """An artist as items: lines, areas, dots or texts."""
    if isinstance(artist, Line2D):
        yield _line(artist, ax, arrays)
    elif isinstance(artist, PathCollection):
        yield from _dots(artist, arrays)
    elif isinstance(artist, LineCollection):
        joined = _joined([np.asarray(segment) for segment in artist.get_segments()])
        colours: Any = artist.get_color()
        look = {'colour': to_hex(colours[0]), 'width': _px(float(artist.get_linewidth()[0]))}  # type: ignore[index]
        yield {'kind': 'line', **_places(joined, arrays), 'opacity': _opacity(artist), 'dash': '', **look}
    elif isinstance(artist, PolyCollection):
        yield from _areas(artist, ax, arrays)
    elif isinstance(artist, Patch):
        corners = artist.get_patch_transform().transform(artist.get_path().vertices)
        fractions = _fractions(artist.get_data_transform(), ax)
        line: Any = artist.get_edgecolor()
        edge = {'edge': to_hex(line)} if artist.get_linewidth() > 0.0 and line[3] > 0.0 else {}
        area = _places(_joined([corners[:4] if len(corners) == 5 else corners]), arrays)
        colour = to_hex(artist.get_facecolor())
        yield {'kind': 'area', **area, 'colour': colour, 'opacity': _opacity(artist), **fractions, **edge}
    elif hasattr(artist, 'get_extent'):
        yield from _strip(artist, arrays, named)
    elif hasattr(artist, 'get_text'):
        yield _text(artist)
    else:
        raise TypeError(f'{type(artist).__name__} in a figure: the page has no way to draw it')


def _line(line: Line2D, ax: Axes, arrays: _Arrays) -> dict[str, Any]:
    x, y = getattr(line, 'detail', None) or (line.get_xdata(orig=False), line.get_ydata(orig=False))
    x, y = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
    style = str(line.get_drawstyle())
    if style.startswith('steps'):
        x, y = cbook.STEP_LOOKUP_MAP[style](x, y)
    dashes, marker = str(line.get_linestyle()), line.get_marker()
    item = {
        'kind': 'line',
        **_places(np.column_stack((x, y)), arrays),
        'colour': to_hex(line.get_color()),
        'opacity': _opacity(line),
        'width': 0.0 if dashes in ('None', '', ' ') else _px(line.get_linewidth()),
        'dash': _DASHES.get(dashes, ''),
        **_fractions(line.get_transform(), ax),
    }
    if marker not in ('None', '', None):
        empty = str(line.get_markerfacecolor()) == 'none'
        item |= {'marker': str(marker), 'size': _px(line.get_markersize()), 'empty': empty}
    return item


def _dots(dots: PathCollection, arrays: _Arrays) -> Iterator[dict[str, Any]]:
    """Dots, those of a colour scale by shades."""
    places: FloatArray = np.ma.filled(np.ma.asarray(dots.get_offsets(), dtype=float), np.nan)
    size = float(np.sqrt(dots.get_sizes()[0])) * _PIXELS / _POINTS
    look = {'kind': 'line', 'width': 0.0, 'dash': '', 'marker': 'o', 'size': round(size, 2), 'empty': False}
    values = dots.get_array()
    if values is None:
        yield {**look, **_places(places, arrays), 'colour': to_hex(_first_colour(dots)), 'opacity': _opacity(dots)}
        return
    shade = np.round(np.ma.filled(dots.norm(values), 0.0) * (_SHADES - 1)).astype(int)
    for number in np.unique(shade)[::-1].tolist():
        colour = to_hex(dots.get_cmap()(number / (_SHADES - 1)))
        yield {**look, **_places(places[shade == number], arrays), 'colour': colour, 'opacity': _opacity(dots)}


def _areas(areas: PolyCollection, ax: Axes, arrays: _Arrays) -> Iterator[dict[str, Any]]:
    """Areas, those of one colour together."""
    polygons = [vertices for path in areas.get_paths() if len(vertices := np.asarray(path.vertices))]
    areas.update_scalarmappable()
    colours: Any = areas.get_facecolor()
    each = [to_hex(colours[number % len(colours)]) for number in range(len(polygons))]
    fractions = _fractions(areas.get_transform(), ax)
    for colour in dict.fromkeys(each):
        joined = _joined([polygon for polygon, one in zip(polygons, each, strict=True) if one == colour])
        seamless = {'edge': colour, 'seamless': True} if areas.get_array() is not None else {}
        look = {'colour': colour, 'opacity': _opacity(areas), **seamless, **fractions}
        yield {'kind': 'area', **_places(joined, arrays), **look}


def _strip(image: Any, arrays: _Arrays, named: dict[str, str]) -> Iterator[dict[str, Any]]:
    """An image of one row, as areas of equal colour."""
    row = np.asarray(image.get_array())[0]
    left, right, bottom, top = image.get_extent()
    edges = np.flatnonzero(np.diff(row, prepend=np.nan, append=np.nan) != 0)
    places = left + (right - left) * edges / len(row)
    for value in np.unique(row).tolist():
        runs = [(a, b) for a, b, first in zip(places, places[1:], edges, strict=False) if row[first] == value]
        boxes = [np.array([(a, bottom), (b, bottom), (b, top), (a, top)]) for a, b in runs]
        colour = to_hex(image.cmap(image.norm(value)))
        area = _places(_joined(boxes), arrays)
        yield {'kind': 'area', **area, 'colour': colour, 'opacity': 1.0, 'name': named.get(colour, '')}


def _text(text: Any) -> dict[str, Any]:
    """A text, or an arrow without one."""
    if isinstance(text, Annotation) and text.arrow_patch is not None:
        (x, y), (from_x, from_y) = text.xy, text.get_position()
        ends = [float(value) for value in (from_x, from_y, x, y)]
        return {'kind': 'arrow', 'ends': ends, 'colour': to_hex(text.arrow_patch.get_edgecolor())}
    place, offset = (text.xy, text.get_position()) if isinstance(text, Annotation) else (text.get_position(), (0, 0))
    return {
        'kind': 'text',
        'text': text.get_text(),
        'at': [float(value) for value in place],
        'offset': [_px(float(offset[0])), -_px(float(offset[1]))],
        'anchor': {'left': 'start', 'right': 'end'}.get(text.get_ha(), 'middle'),
        'baseline': {'bottom': 'auto', 'top': 'hanging'}.get(text.get_va(), 'middle'),
        'colour': to_hex(text.get_color()),
    }


def _px(points: float) -> float:
    return round(points * _PIXELS / _POINTS, 2)


def _opacity(artist: Artist) -> float:
    alpha: Any = artist.get_alpha()
    return 1.0 if alpha is None else round(float(alpha), 3)


def _fractions(transform: Any, ax: Axes) -> dict[str, bool]:
    """Whether x or y are fractions of the axes, as of a line across them."""
    x, y = transform.contains_branch_seperately(ax.transData)
    return {**({} if x else {'across': True}), **({} if y else {'upright': True})}


def _joined(parts: list[Any]) -> FloatArray:
    """Polygons or segments one after the other, NaN between them."""
    gap = np.full((1, 2), np.nan)
    pieces = [piece for part in parts for piece in (np.asarray(part, dtype=float), gap)]
    return np.concatenate(pieces) if pieces else gap


def _places(points: FloatArray, arrays: _Arrays) -> dict[str, int]:
    return {'xs': arrays.index(points[:, 0]), 'ys': arrays.index(points[:, 1])}
