"""The page kit: a page from a template, with its figures inside and beside it.

Every page begins with a verdict, what to do next, and where its numbers are from. A page is self-contained: it loads
neither style nor figures from elsewhere, and its policy forbids it to. The template engine escapes every value; a
missing value is an error. A page does not say when and on which machine it was made, so the same command on the same
input gives the same bytes.
"""

from base64 import b64encode
from collections.abc import Callable, Iterable, Sequence
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from jinja2 import Environment, FileSystemLoader, StrictUndefined, Template
from markupsafe import Markup

from seal_friction_ros.core.foundation.errors import named_errors
from seal_friction_ros.core.foundation.normal_distribution import BAND_95
from seal_friction_ros.core.foundation.parameters import meanings
from seal_friction_ros.core.foundation.units import BAR, MM, MPA, MS, PSI, UM
from seal_friction_ros.files import package_version
from seal_friction_ros.offline.monitor.page import FOLDER as UPLOT
from seal_friction_ros.offline.reports.figure_style import Plot, render
from seal_friction_ros.offline.reports.formatting import length_text, number, pressure_range, pressure_text, thousands
from seal_friction_ros.offline.reports.plot_data import plot_data
from seal_friction_ros.offline.work.atomic_file import write_whole
from seal_friction_ros.offline.work.status import command_line, show_status

TEMPLATES = Path(__file__).with_name('templates')
MOST_OPEN = 3  # remarks that are not folded
PARAMETER_HEADS = ('parameter', 'value', 'unit', 'meaning')
Columns = Sequence[tuple[str, Callable[[Any], Any]]]
"""head of each column, and the function that gives its cell of a record"""


class Table(NamedTuple):
    """A table of a page; a cell is shown as ``str`` of its value."""

    heads: Sequence[str]
    rows: Sequence[Sequence[Any]]
    text_columns: Sequence[int] = ()  # columns that hold text, which is aligned left; the others hold numbers


class Head(NamedTuple):
    """Where the numbers of a page are from."""

    command: str  # as typed, or what gives the same page
    facts: tuple[str, ...] = ()  # date of the data, seals


def head_of(command: str, *facts: str) -> Head:
    """Head with the command as it was typed, or ``command`` if the page is not made by one."""
    return Head(command_line() or f'seal_friction {command}', tuple(fact for fact in facts if fact))


def seals_text(names: Sequence[str]) -> str:
    """Names of seals with their number; at most three kinds are named."""
    counts = {name: list(names).count(name) for name in names}
    texts = [f'{count} \N{MULTIPLICATION SIGN} {name}' for name, count in counts.items()]
    return ', '.join([*texts[:3], *(['more'] if texts[3:] else [])])


def table_of(records: Iterable[Any], columns: Columns, text_columns: Sequence[int] = ()) -> Table:
    """Table with a row for each record."""
    heads, cells = zip(*columns, strict=True)
    return Table(heads, [[cell(record) for cell in cells] for record in records], text_columns)


class ReportSummary(NamedTuple):
    """Files of a report, and its numbers."""

    page: Path
    figures: tuple[Path, ...]
    numbers: dict[str, Any]  # plain types for JSON; None for a missing number

    @property
    def flat(self) -> dict[str, Any]:
        """All in one object for JSON."""
        return {'page': self.page, 'figures': self.figures, **self.numbers}


def parameter_rows(record: Any, prefix: str = '') -> list[tuple[Any, ...]]:
    """Name, value, unit and meaning of each described field of a record, for a `Table` with `PARAMETER_HEADS`."""
    values = {name: getattr(record, name) for name in meanings(record)}
    shown = {name: _shown(value) for name, value in values.items()}
    return [(prefix + name, shown[name], known.unit, known.description) for name, known in meanings(record).items()]


def _shown(value: Any) -> Any:
    if isinstance(value, float):
        return f'{value:.10g}'
    if isinstance(value, tuple) and len(value) > 3 and all(isinstance(number, float) for number in value):
        return f'{len(value)} values, {min(value):g} to {max(value):g}'
    return value


@cache
def environment() -> Environment:
    """Template engine of the reports."""
    white: dict[str, Any] = dict.fromkeys(('trim_blocks', 'lstrip_blocks', 'keep_trailing_newline'), True)
    made = Environment(loader=FileSystemLoader(TEMPLATES), autoescape=True, undefined=StrictUndefined, **white)
    made.globals |= {'BAND_95': f'{BAND_95:.2f}', 'BAR': BAR, 'MM': MM, 'MPA': MPA, 'MS': MS, 'PSI': PSI, 'UM': UM}
    made.globals |= {f.__name__: f for f in (length_text, number, pressure_range, pressure_text, thousands)}
    return made


def template_of(template: str | Path) -> Template:
    """Template: a name in ``templates/``, or a path of another folder, which may extend those; both without suffix."""
    if isinstance(template, str):
        return environment().get_template(f'{template}.html')
    folders = FileSystemLoader([template.parent, TEMPLATES])
    return environment().overlay(loader=folders).get_template(f'{template.name}.html')


def render_page(template: str | Path, pictures: dict[str, bytes], plots: dict[str, Any], **values: Any) -> str:
    """HTML of a page; arguments as of `template_of` and `write_page`.

    ``pictures`` are SVG by name of the figure, which the template leaves out if it is missing; ``plots`` their
    `plot_data`. jinja2.UndefinedError: the template names a value that is not in ``values``.
    """
    encoded = {name: b64encode(svg).decode() for name, svg in pictures.items()}
    shared = {'script': script, 'version': package_version(), 'MOST_OPEN': MOST_OPEN}
    return template_of(template).render(pictures=encoded, plots=plots, **shared, **values)


@cache
def script(name: str) -> Markup:
    """A script or style of ``templates/``, or uPlot, which the live view has too; by file name."""
    folder = UPLOT if name.startswith('uPlot') else TEMPLATES
    return Markup((folder / name).read_text(encoding='utf-8'))  # noqa: S704  without a value in it


def write_page(
    out: Path, template: str | Path, plots: Iterable[Plot], *, warnings: Sequence[str] = (), **values: Any
) -> tuple[Path, ...]:
    """Write a page, and each figure as PNG and SVG in ``<stem>_figures`` beside it; existing files are replaced.

    Args:
        out: HTML file.
        template: As of `template_of`.
        plots: The figures.
        warnings: Remarks below the verdict, the most important first; those after `MOST_OPEN` are folded.
        values: What the template shows; ``verdict`` and ``head`` among them, unless it is a form.

    Returns the paths of the figures. ValueError: a file cannot be written.
    """
    show_status('figures ...')
    rendered, data = {}, {}
    for name, figure in plots:
        rendered[name], data[name] = render(figure), plot_data(figure)  # in this order: rendering fixes the layout
    pictures = {name: kinds['svg'] for name, kinds in rendered.items()}
    page = render_page(template, pictures, data, warnings=list(warnings), **values)
    folder = out.parent / f'{out.stem}_figures'
    files = {folder / f'{name}.{kind}': data for name, kinds in rendered.items() for kind, data in kinds.items()}
    with named_errors(f'{out}: cannot write the page or its figures', OSError):
        for path, content in {**files, out: page.encode('utf-8', 'replace')}.items():
            write_whole(path, content)
    return tuple(files)
