"""Tables of the uncertainty of what is computed."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from seal_friction_ros.core.foundation.units import BAR, MM
from seal_friction_ros.core.foundation.unknowns import Unknown
from seal_friction_ros.offline.contact.uncertainty import QUANTILES, Uncertainty
from seal_friction_ros.offline.reports.formatting import number
from seal_friction_ros.offline.reports.page import Columns, Table, table_of


def uncertainty_values(uncertainty: Uncertainty | None, unknowns: Sequence[Unknown]) -> dict[str, Any]:
    """Values of the template ``uncertainty.html``."""
    if uncertainty is None:
        return {'uncertainty': None}
    return {
        'uncertainty': uncertainty,
        'quantile_table': _quantile_table(uncertainty),
        'unknown_table': _unknown_table(uncertainty, unknowns),
        'failed_table': Table(('sample', 'reason'), [(i + 1, why) for i, why in uncertainty.failed.items()], (1,)),
    }


def _quantile_table(uncertainty: Uncertainty) -> Table:
    heads = [
        'pressure [bar]',
        *(['speed [mm/s]'] if uncertainty.speeds else []),
        'the case [N]',
        *(f'{100.0 * share:g} % [N]' for share in QUANTILES),
        'relative standard deviation [%]',
    ]
    columns = [uncertainty.nominal, *uncertainty.quantiles]
    rows = []
    for place in np.ndindex(*uncertainty.nominal.shape):
        axes = [number(uncertainty.pressures[place[0]] / BAR)]
        axes += [number(uncertainty.speeds[place[1]] / MM)] if uncertainty.speeds else []
        forces = [number(float(column[place]), 3) for column in columns]
        rows.append((*axes, *forces, number(float(uncertainty.relative_stds[place]), 0, unit=0.01)))
    return Table(heads, rows)


def _unknown_table(uncertainty: Uncertainty, unknowns: Sequence[Unknown]) -> Table:
    correlations, by_name = uncertainty.rank_correlations, {unknown.name: unknown for unknown in unknowns}
    columns: Columns = (
        ('unknown', lambda one: one.name),
        ('in the case', lambda one: f'{one.value:.6g}'),
        ('spread', lambda one: f'{one.kind} ' + ' to '.join(f'{amount:.6g}' for amount in one.amounts)),
        ('rank correlation with the force', lambda one: number(correlations[one.name], 2, signed=True)),
    )
    return table_of([by_name[name] for name in correlations], columns, (0, 2))
