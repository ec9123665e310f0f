"""What the campaigns of ``test/system`` share: their arguments, and how they, and the benches, say what they found."""

import argparse
import json
import sys
from collections.abc import Mapping, Sequence
from contextlib import redirect_stdout
from typing import Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from seal_friction_ros.offline.commands.main import main

_ANY = 10_000  # columns, more than any table has
Rows = Sequence[Mapping[str, Any]] | Mapping[str, Any]
"""Rows, rows by name, or figures by name"""


def parser_of(description: str, **numbers: tuple[float, str]) -> argparse.ArgumentParser:
    """Parser with ``--json`` and an option for each of ``numbers``: its default, whose type it has, and its meaning."""
    parser = argparse.ArgumentParser(description=description.split('\n', maxsplit=1)[0])
    for name, (default, meaning) in numbers.items():
        text = f'{meaning}; default {default:g}'
        parser.add_argument(f'--{name.replace("_", "-")}', type=type(default), default=default, help=text)
    parser.add_argument('--json', action='store_true', help='print JSON')
    return parser


def run_command(*words: object) -> None:
    """Run a command that must succeed; what it prints goes to standard error, beside the table or JSON."""
    with redirect_stdout(sys.stderr):
        code = main([str(word) for word in words])
    if code != 0:
        raise SystemExit(f'seal_friction {words[0]} failed')


def tell(found: Rows, *, as_json: bool, title: str = '') -> None:
    """Print one table, or JSON."""
    if as_json:
        print(json.dumps(found))
    else:
        show(found, title)


def show(found: Rows, title: str = '') -> None:
    """Print a table; where the terminal (a pipe: 80 columns) is too narrow for it, a list of figures for each row."""
    rows = found if not isinstance(found, Mapping) else [{'': name, **_row(row)} for name, row in found.items()]
    headings = list(dict.fromkeys(heading for row in rows for heading in row))
    table, console = Table(title=Text(title)), Console()
    for place, heading in enumerate(headings):
        table.add_column(Text(heading), justify='right' if place else 'left')
    for row in rows:
        table.add_row(*(Text(_text(row.get(heading, ''))) for heading in headings))
    if console.measure(table, options=console.options.update(width=_ANY)).maximum <= console.width:
        console.print(table)
        return
    console.print(Text(title, 'italic'))
    for row in rows:
        (_, name), *figures = row.items()
        console.print(Text(_text(name), 'bold'))
        block = Table.grid(padding=(0, 2))
        for heading, value in figures:
            block.add_row('', Text(heading), Text(_text(value)))
        console.print(block)


def tell_tables(tables: Mapping[str, Rows], *, as_json: bool) -> None:
    """Print several tables by title, or all of them as one JSON object."""
    if as_json:
        print(json.dumps(tables))
        return
    for title, rows in tables.items():
        tell(rows, as_json=False, title=title)


def _row(row: Any) -> Mapping[str, Any]:
    return row if isinstance(row, Mapping) else {'value': row}


def _text(value: Any) -> str:
    if isinstance(value, float):
        return f'{value:.6g}' if abs(value) >= 1e3 else f'{value:.4g}'
    return '\n'.join(map(_text, value)) if isinstance(value, list | tuple) else str(value)
