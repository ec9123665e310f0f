"""The page kit: a page from a template, with its figures inside and beside it.

A page is self-contained: it loads neither style nor figures from elsewhere. The template engine escapes every value; a
missing value is an error. A page contains neither time nor place, so the same input gives the same bytes.
"""

from base64 import b64encode
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from seal_friction_ros.core.foundation.normal_distribution import BAND_95
from seal_friction_ros.core.foundation.parameters import meanings
from seal_friction_ros.core.foundation.units import BAR, MM, MPA, MS, PSI, UM
from seal_friction_ros.offline.reports.figure_style import Plot, render
from seal_friction_ros.offline.reports.formatting import length_text, number, pressure_range, pressure_text, thousands
from seal_friction_ros.offline.work.atomic_file import write_whole

TEMPLATES = Path(__file__).with_name('templates')
PARAMETER_HEADS = ('parameter', 'value', 'unit', 'meaning')
Columns = Sequence[tuple[str, Callable[[Any], Any]]]
"""head of each column, and the function that gives its cell of a record"""


class Table(NamedTuple):
    """A table of a page; a cell is shown as ``str`` of its value."""

    heads: Sequence[str]
    rows: Sequence[Sequence[Any]]
    text_columns: Sequence[int] = ()  # columns that hold text, which is aligned left; the others hold numbers


def table_of(records: Iterable[Any], columns: Columns, text_columns: Sequence[int] = ()) -> Table:
    """Table with a row for each record."""
    heads, cells = zip(*columns, strict=True)
    return Table(heads, [[cell(record) for cell in cells] for record in records], text_columns)


@dataclass(frozen=True)
class ReportSummary:
    """Files of a report, and its numbers."""

    page: Path
    figures: tuple[Path, ...]
    numbers: dict[str, Any]  # plain types for JSON; None for a missing number


def parameter_rows(record: Any, prefix: str = '') -> list[tuple[Any, ...]]:
    """Name, value, unit and meaning of each described field of a record, for a `Table` with `PARAMETER_HEADS`."""
    values = {name: getattr(record, name) for name in meanings(record)}
    shown = {name: f'{value:.10g}' if isinstance(value, float) else value for name, value in values.items()}
    return [(prefix + name, shown[name], known.unit, known.description) for name, known in meanings(record).items()]


@cache
def environment() -> Environment:
    """Template engine of the reports."""
    made = Environment(
        loader=FileSystemLoader(TEMPLATES),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    made.globals |= {'BAND_95': BAND_95, 'BAR': BAR, 'MM': MM, 'MPA': MPA, 'MS': MS, 'PSI': PSI, 'UM': UM}
    made.globals |= {f.__name__: f for f in (length_text, number, pressure_range, pressure_text, thousands)}
    return made


def render_page(template: str, pictures: dict[str, bytes], **values: Any) -> str:
    """HTML of a page.

    Args:
        template: Name of a file in ``templates/``, without suffix.
        pictures: Name of a figure -> SVG; a figure that is named in the template but missing here is left out.
        values: What the template shows.

    Raises:
        jinja2.UndefinedError: The template names a value that is not in ``values``.
    """
    encoded = {name: b64encode(svg).decode() for name, svg in pictures.items()}
    return environment().get_template(f'{template}.html').render(pictures=encoded, **values)


def write_page(out: Path, template: str, plots: Iterable[Plot], **values: Any) -> tuple[Path, ...]:
    """Write a page, and each figure as PNG and SVG in ``<stem>_figures`` beside it; existing files are replaced.

    Args:
        out: HTML file.
        template: As of `render_page`.
        plots: The figures.
        values: As of `render_page`.

    Returns:
        Paths of the figures.

    Raises:
        ValueError: A file cannot be written.
    """
    rendered = {plot.name: render(plot.figure) for plot in plots}
    page = render_page(template, {name: kinds['svg'] for name, kinds in rendered.items()}, **values)
    folder = out.parent / f'{out.stem}_figures'
    files = {folder / f'{name}.{kind}': data for name, kinds in rendered.items() for kind, data in kinds.items()}
    try:
        (folder if files else out.parent).mkdir(parents=True, exist_ok=True)
        for path, content in {**files, out: page.encode('utf-8', 'replace')}.items():
            write_whole(path, content)
    except OSError as error:
        raise ValueError(f'{out}: cannot write the page or its figures: {error.strerror or error}') from None
    return tuple(files)
