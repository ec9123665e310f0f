"""A measurement of several cycles as the spool-valve paper evaluates it: a page, and the numbers."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from seal_friction_ros.core.identification.spool_evaluation import SpoolEvaluation, SpoolFriction, evaluate_cycles
from seal_friction_ros.offline.identification.sources import column_in_si, table_rows
from seal_friction_ros.offline.reports.bag_report import tiles, write_page
from seal_friction_ros.offline.reports.figures import (
    BLUE,
    GREY,
    ORANGE,
    SKY,
    Plot,
    house_style,
    legend_above,
    new_figure,
)

TIME_UNITS = {'s': 's', 'ms': 'ms'}
LENGTH_UNITS = {'m': 'm', 'mm': 'mm', 'um': 'um'}
FORCE_UNITS = {'n': 'N', 'kn': 'kN', 'lbf': 'lbf'}


@dataclass(frozen=True)
class SpoolSummary:
    """What was written, and the numbers in it."""

    page: Path
    figures: tuple[Path, ...]
    numbers: dict[str, Any]


def write_spool_report(table: Path, out: Path, law: SpoolEvaluation, reference: float | None = None) -> SpoolSummary:
    """Evaluate a table of several cycles and write a page, its figures in ``<stem>_figures`` beside it.

    Args:
        table: Comma-separated columns ``time_s`` (or ``_ms``), ``displacement_mm`` (``_m``, ``_um``) and ``force_N``
            (``_kN``, ``_lbf``), even in time.
        out: HTML file; replaced if it is there.
        law: How it is evaluated.
        reference: Reference force [N] of another measurement; None: this one's own.

    Raises:
        ValueError: The table cannot be read or is not fit to evaluate, or the page cannot be written.
    """
    rows = table_rows(table)
    names = list(rows[0]) if rows else []
    if len(rows) < 100:
        raise ValueError(f'{table}: {len(rows)} rows are too few for {law.cycles} cycles')
    time = column_in_si(table, rows, names, 'time', TIME_UNITS)
    displacement = column_in_si(table, rows, names, 'displacement', LENGTH_UNITS)
    force = column_in_si(table, rows, names, 'force', FORCE_UNITS)
    steps = np.diff(time)
    if not (np.isfinite(steps).all() and steps.min() > 0.5 * np.median(steps) and steps.max() < 1.5 * np.median(steps)):
        raise ValueError(f'{table}: time does not go in even steps: the resonance cannot be filtered: record evenly')
    try:
        found = evaluate_cycles(time, displacement, force, law, reference)
    except ValueError as error:
        raise ValueError(f'{table}: {error}') from None
    numbers = spool_figures(found)
    with house_style():
        plot = spool_figure(found, law)
        written = write_page(
            out, f'Spool friction: {table.name}', lambda figure: _sections(table.name, numbers, figure), [plot]
        )
    return SpoolSummary(out, written, numbers)


def spool_figures(found: SpoolFriction) -> dict[str, Any]:
    """The numbers for JSON."""
    up = found.velocity > 0.0
    return {
        'reference_force_N': found.reference_force,
        'resonance_Hz': found.resonance,
        'stroke_m': float(np.ptp(found.displacement)),
        'fastest_m_per_s': float(np.abs(found.velocity).max()),
        'highest_normalised': float(found.normalised[up].max()) if up.any() else None,
        'lowest_normalised': float(found.normalised[~up].min()) if (~up).any() else None,
    }


def spool_figure(found: SpoolFriction, law: SpoolEvaluation) -> Plot:
    """Normalised friction and speed over displacement (as Figures 10 to 13 of the paper)."""
    title = 'Friction over displacement'
    if found.resonance is not None:
        title += f': the measuring chain rings at {found.resonance:.0f} Hz, filtered'
    figure, (top, bottom) = new_figure(title, 5.2, nrows=2, sharex=True, height_ratios=(3, 1))
    x = 1e3 * found.displacement
    top.plot(x, found.force / found.reference_force, color=SKY, lw=0.8, label='as measured')
    top.plot(x, found.normalised, color=BLUE, lw=1.8, label='filtered and averaged')
    half = 1e3 * law.reference_half_width
    top.axvspan(-half, half, color=GREY, alpha=0.12, lw=0, label='where the reference force is from')
    top.axhline(0.0, color=GREY, lw=0.6)
    top.set_ylabel('normalised friction [-]')
    legend_above(top)
    bottom.plot(x, 1e3 * found.velocity, color=ORANGE)
    bottom.set_ylabel('speed [mm/s]')
    bottom.set_xlabel('displacement from the middle of the stroke [mm]')
    return Plot(
        'friction_over_displacement',
        figure,
        f'Cycle {law.evaluated_cycle} of {law.cycles}, moving average of {law.moving_average} samples, over the mean '
        f'magnitude between -{half:g} and {half:g} mm ({found.reference_force:.4g} N).',
    )


def _sections(name: str, numbers: dict[str, Any], figure: Callable[[str], str]) -> Iterable[str]:
    resonance = numbers['resonance_Hz']
    yield f'<h1>Friction over displacement: {escape(name)}</h1>'
    yield '<p class="lead">As the spool-valve paper evaluates its measurements (chapters 4, 6 and 7.3).</p>'
    yield tiles(
        [
            ('reference force', f'{numbers["reference_force_N"]:.4g} N'),
            ('resonance of the measuring chain', 'none' if resonance is None else f'{resonance:.0f} Hz'),
            ('stroke', f'{1e3 * numbers["stroke_m"]:.3g} mm'),
            ('fastest', f'{1e3 * numbers["fastest_m_per_s"]:.3g} mm/s'),
        ]
    )
    yield figure('friction_over_displacement')
