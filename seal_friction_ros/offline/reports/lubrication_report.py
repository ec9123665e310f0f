"""Report of a friction map."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.ticker import FuncFormatter

from seal_friction_ros.core.estimation.findings import LOOK, Verdict, percent
from seal_friction_ros.core.foundation.arrays import BoolArray
from seal_friction_ros.core.foundation.units import BAR, MM
from seal_friction_ros.core.lubrication.friction_map import directions
from seal_friction_ros.core.lubrication.lubrication_case import LubricationCase
from seal_friction_ros.core.oring_contact.ring_friction import DISCRETISATION
from seal_friction_ros.offline.contact.lubrication_runs import MapRuns
from seal_friction_ros.offline.contact.uncertainty import Uncertainty
from seal_friction_ros.offline.reports import figure_style as style
from seal_friction_ros.offline.reports.figure_style import Plot, house_style
from seal_friction_ros.offline.reports.formatting import number
from seal_friction_ros.offline.reports.page import PARAMETER_HEADS, Table, head_of, parameter_rows, write_page
from seal_friction_ros.offline.reports.uncertainty_tables import uncertainty_values
from seal_friction_ros.offline.work.status import command_line


@house_style()
def write_map_page(computed: MapRuns, out: Path) -> tuple[Path, ...]:
    """Write the page of a friction map; see `write_page`."""
    frictions = computed.table.friction
    errors = np.zeros_like(frictions) if computed.mesh_error is None else computed.mesh_error
    plots, spread = [map_figure(computed)], ''
    if computed.uncertainty is not None:
        plots.append(quantiles_figure(computed.uncertainty))
        spread = f', with a relative standard deviation of {percent(computed.uncertainty.relative_std)} by samples'
    text = f'Friction {frictions.min():.3g} to {frictions.max():.3g} N over the map{spread}; computed, not measured.'
    after = 'write a seal file for the node: --seal-file.'
    if '--seal-file' in command_line():
        after = 'use the seal file; its band is not from measurements.'
    return write_case_page(
        out,
        'lubrication_map',
        plots,
        computed.case,
        verdict=Verdict(LOOK, text, after),
        law=computed.law,
        map_table=_map_table(computed, errors > DISCRETISATION),
        map_notes=(computed.limits, computed.mesh),
        is_marked=bool((errors > DISCRETISATION).any()),
        **uncertainty_values(computed.uncertainty, computed.case.unknown),
    )


def _map_table(computed: MapRuns, marked: BoolArray) -> Table:
    """Row for each speed and, at the reference speed, direction; ``marked`` where the mesh changes the friction."""
    frictions = computed.table.friction.T.tolist()
    rows = [
        (
            number(speed / MM),
            *(number(one, 3) + (' *' if mark else '') for one, mark in zip(of_speed, marks, strict=True)),
        )
        for speed, of_speed, marks in zip(computed.law.speeds, frictions, marked.T.tolist(), strict=True)
    ]
    reference = number(computed.law.reference_speed / MM)
    ways = directions(computed.law, computed.table).tolist()
    for way, text in zip(ways, ('towards the pressure', 'away from it'), strict=True):
        rows.append((f'{reference}, {text}', *(number(friction, 3) for friction in way)))
    return Table(('speed [mm/s]', *(f'{pressure / BAR:.3g} bar' for pressure in computed.law.pressures)), rows)


def write_case_page(
    out: Path, template: str | Path, plots: Sequence[Plot], case: LubricationCase, **values: Any
) -> tuple[Path, ...]:
    """Write a page with the parameters of a case."""
    table = Table(PARAMETER_HEADS, _parameter_rows(case), (0, 2, 3))
    head = head_of(f'ehl run {case.name}', 'computed, no measured data')
    return write_page(out, template, plots, head=head, case=case, parameter_table=table, **values)


_NOT_OF_A_RING = ('groove.', 'air.', 'numerics.film_width', 'numerics.time_step', 'study.')


def _parameter_rows(case: LubricationCase) -> list[tuple[Any, ...]]:
    """Rows of all parameters that act in a case; of a ring, its drawing in the place of a profile."""
    parts = [(part.name, getattr(case, part.name)) for part in dataclasses.fields(case)]
    rows = [row for name, part in parts if dataclasses.is_dataclass(part) for row in parameter_rows(part, f'{name}.')]
    if case.oring is None:
        return rows
    acting = [row for row in rows if not row[0].startswith(_NOT_OF_A_RING)]
    acting = [row for row in acting if not row[0].startswith('seal.') or row[0] == 'seal.solid_shear_stress']
    drawn = ('geometry', 'groove', 'rubber', 'numerics')
    return acting + [row for name in drawn for row in parameter_rows(getattr(case.oring, name), f'oring.{name}.')]


def map_figure(computed: MapRuns) -> Plot:
    """Steady friction over speed, for each pressure."""
    figure, (left, right) = style.new_figure('Steady friction falls as the film lifts the seal', 4.4, ncols=2)
    speeds = np.array(computed.law.speeds) / MM
    looks = style.shades([f'{pressure / BAR:g} bar' for pressure in computed.law.pressures])
    for friction, solid, look in zip(computed.table.friction, computed.table.solid, looks, strict=True):
        left.semilogx(speeds, friction, **look)
        right.semilogx(speeds, solid / friction, **look)
    left.set(ylabel='friction of the seal [N]', ylim=(0.0, None))
    right.set_ylabel('solid share [-]')
    for ax in (left, right):
        ax.set_xlabel('speed [mm/s]')
        ax.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f'{value:g}'))
    style.legend_below(figure, left, len(looks))
    return Plot('friction_map', figure)


def quantiles_figure(uncertainty: Uncertainty) -> Plot:
    """Median of the samples over speed, and the band that holds nine tenths of them, at each pressure."""
    low, median, high = uncertainty.quantiles
    count = len(uncertainty.pressures)
    figure, axes = style.new_figure('Friction of 90 % of the samples', 4.0, ncols=count, sharey=True)
    speeds = np.array(uncertainty.speeds) / MM
    for i, (ax, pressure) in enumerate(zip(axes, uncertainty.pressures, strict=True)):
        ax.fill_between(speeds, low[i], high[i], color=style.SKY, alpha=0.4, lw=0, label='5 to 95 %')
        ax.semilogx(speeds, median[i], color=style.BLUE, label='median')
        ax.semilogx(speeds, uncertainty.nominal[i], color=style.BLACK, lw=1.0, label='the case')
        ax.set(title=f'{pressure / BAR:.3g} bar', xlabel='speed [mm/s]')
        ax.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f'{value:g}'))
    axes[0].set(ylabel='friction of the seal [N]', ylim=(0.0, None))
    style.legend_above(axes[-1])
    return Plot('friction_quantiles', figure)
