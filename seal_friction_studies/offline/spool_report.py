"""Report of a measurement of several cycles, evaluated after the spool-valve paper."""

from pathlib import Path
from typing import Any

import numpy as np

from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.foundation.units import MM
from seal_friction_ros.offline.identification.sources import column_in_si, table_rows
from seal_friction_ros.offline.reports import figure_style as style
from seal_friction_ros.offline.reports.figure_style import Plot, finished, house_style
from seal_friction_ros.offline.reports.page import ReportSummary, head_of, write_page
from seal_friction_studies.core.spool_evaluation import SpoolEvaluation, SpoolFriction, evaluate_cycles
from seal_friction_studies.offline import verdicts
from seal_friction_studies.offline.bag_comparison import recorded_motion

FEWEST_ROWS = 100  # of a table (our choice)
COLUMN_UNITS = {
    'time': {'s': 's', 'ms': 'ms'},
    'displacement': {'m': 'm', 'mm': 'mm', 'um': 'um'},
    'force': {'n': 'N', 'kn': 'kN', 'lbf': 'lbf'},
}


@house_style()
def write_spool_report(
    table: Path, out: Path, settings: SpoolEvaluation, reference: float | None = None
) -> ReportSummary:
    """Evaluate a table of several cycles and write the report; see `write_page`.

    Args:
        table: Comma-separated columns ``time_s`` (or ``_ms``), ``displacement_mm`` (``_m``, ``_um``) and ``force_N``
            (``_kN``, ``_lbf``), with a constant sample time; or a bag with position and force sum.
        out: HTML file.
        settings: Parameters of the evaluation.
        reference: Reference force [N] of another measurement; None for that of this measurement.

    Raises:
        ValueError: The table cannot be read or evaluated, or the page cannot be written.
    """
    time, displacement, force = recorded_motion(table) if _is_bag(table) else _columns(table)
    if len(time) < FEWEST_ROWS:
        raise ValueError(f'{table}: {len(time)} rows are too few for {settings.cycles} cycles')
    steps = np.diff(time)
    if not (np.isfinite(steps).all() and steps.min() > 0.5 * np.median(steps) and steps.max() < 1.5 * np.median(steps)):
        raise ValueError(
            f'{table}: time does not go in even steps, so the resonance cannot be filtered: record at a constant rate'
        )
    try:
        found = evaluate_cycles(time, displacement, force, settings, reference)
    except ValueError as error:
        raise ValueError(f'{table}: {error}') from None
    up = found.velocity > 0.0
    numbers = {
        'reference_force_N': found.reference_force,
        'resonance_Hz': found.resonance,
        'stroke_m': float(np.ptp(found.displacement)),
        'fastest_m_per_s': float(np.abs(found.velocity).max()),
        'highest_normalised': float(found.normalised[up].max()) if up.any() else None,
        'lowest_normalised': float(found.normalised[~up].min()) if (~up).any() else None,
    }
    plots = [displacement_figure(found, settings)]
    verdict = verdicts.of_spool_measurement(found.reference_force, found.resonance)
    head = head_of(f'spool {table}', table.name, 'the data have no date')
    shown: dict[str, Any] = {
        'verdict': verdict,
        'head': head,
        'name': table.name,
        'numbers': numbers,
        'settings': settings,
    }
    figures = write_page(out, Path(__file__).with_name('templates') / 'spool_evaluation', plots, **shown)
    return ReportSummary(out, figures, numbers)


def _is_bag(path: Path) -> bool:
    return path.is_dir() or path.suffix in ('.mcap', '.db3')


def _columns(table: Path) -> tuple[FloatArray, ...]:
    """Time, displacement and force of a table."""
    rows = table_rows(table)
    return tuple(column_in_si(table, rows, *column) if rows else np.zeros(0) for column in COLUMN_UNITS.items())


def displacement_figure(found: SpoolFriction, settings: SpoolEvaluation) -> Plot:
    """Normalised friction and speed over displacement (as Figures 10 to 13 of the paper)."""
    title = 'Friction over displacement'
    if found.resonance is not None:
        title += f', resonance of the measuring chain at {found.resonance:.0f} Hz removed'
    figure, (top, bottom) = style.new_figure(title, 5.2, nrows=2, sharex=True, height_ratios=(3, 1))
    x, half = found.displacement / MM, settings.reference_half_width / MM
    top.plot(x, found.force / found.reference_force, color=style.SKY, lw=0.8, label='as measured')
    top.plot(x, found.normalised, color=style.BLUE, lw=1.8, label='filtered and averaged')
    top.axvspan(-half, half, color=style.GREY, alpha=0.12, lw=0, label='range of the reference force')
    style.zero_lines(top)
    bottom.plot(x, found.velocity / MM, color=style.ORANGE)
    bottom.set(ylabel='speed [mm/s]', xlabel='displacement from the middle of the stroke [mm]')
    return finished('friction_over_displacement', figure, top, ylabel='normalised friction [-]')
