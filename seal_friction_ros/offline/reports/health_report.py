"""The page of the health of the seals over bags in order of time."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from seal_friction_ros.core.estimation.findings import LOOK, Finding, Limits, Verdict, verdict_of
from seal_friction_ros.core.foundation.normal_distribution import BAND_95
from seal_friction_ros.core.identification.admission import Account
from seal_friction_ros.offline.replay.bag_health import BagHealth
from seal_friction_ros.offline.replay.health_indicators import Day, Value, alarms_of, changes_of, day_of, trend
from seal_friction_ros.offline.reports import figure_style as style
from seal_friction_ros.offline.reports.figure_style import Plot, finished, house_style
from seal_friction_ros.offline.reports.formatting import FIRST_DATE, date_text
from seal_friction_ros.offline.reports.page import ReportSummary, Table, head_of, write_page

INDICATORS = {
    'scale': ('friction / file', '-'),
    'offset': ('offset of force', 'N'),
    'breakaway': ('start / Coulomb', '-'),
    'asymmetry': ('asymmetry', '-'),
    'break_in': ('run-in', '-'),
    'noise': ('residual', 'N'),
}


@house_style()
def write_health_report(
    names: Sequence[str], seen: Sequence[BagHealth], out: Path | None, limits: Limits
) -> ReportSummary:
    """Numbers and, with ``out``, the page of what each bag shows, in order of time; ``limits`` are for alarms."""
    days = [day_of(name, one) for name, one in zip(names, seen, strict=True)]
    trends, changes = {name: trend(days, name) for name in INDICATORS}, changes_of(seen)
    alarms = [alarms_of(day, limits) for day in days]
    verdict = _verdict(days, seen, alarms, len(changes))
    numbers: dict[str, Any] = {
        'bags': [
            {
                'bag': day.name,
                'time_s': day.time,
                'reversals': day.reversals,
                'friction_N': day.friction * day.scale.value,
                **{key: getattr(day, name)[i] for name in INDICATORS for i, key in enumerate((name, f'{name}_std'))},
                'alarms': [alarm.what for alarm in beyond],
                'level': one.level,
                'why': one.why,
            }
            for day, one, beyond in zip(days, seen, alarms, strict=True)
        ],
        'level': verdict.level,
        'verdict': verdict.text,
        'trends_per_hour': {name: one._asdict() for name, one in trends.items()},
        'changes': changes,
    }
    if out is None:
        return ReportSummary(Path(), (), numbers)
    rows = [
        [day.name, one.level, one.why, samples, day.reversals, *(_text(getattr(day, name)) for name in INDICATORS)]
        for day, one in zip(days, seen, strict=True)
        for samples in [Account(day.name, one.used, one.left_out).text]
    ]
    units = (f'{text} [{unit}]' for text, unit in INDICATORS.values())
    heads = ('bag', 'verdict', 'why', 'samples', 'reversals', *units)
    table = Table(heads, rows, (0, 1, 2, 3))
    trend_rows = [[text, _text(trends[name]), f'{unit}/h'] for name, (text, unit) in INDICATORS.items()]
    figures = write_page(
        out,
        'health',
        [_figure(seen, changes)],
        verdict=verdict,
        head=head_of('health', *([f'{len(days)} bags'] if len(days) > 1 else [days[0].name]), *_dates(days)),
        days=days,
        table=table,
        trends=Table(('indicator', 'change an hour', 'unit'), trend_rows, (0, 2)),
    )
    return ReportSummary(out, figures, numbers)


def _verdict(
    days: Sequence[Day], seen: Sequence[BagHealth], alarms: Sequence[Sequence[Finding]], changes: int
) -> Verdict:
    """Verdict by the worst bag, with its name if there are several; a change between the bags is a finding, too."""
    found = []
    for day, one, beyond in zip(days, seen, alarms, strict=True):
        own = Finding(one.level, one.why.rstrip('.'), one.next.rstrip('.'))
        found += [each._replace(name=day.name if len(days) > 1 else '') for each in (own, *beyond)]
    if changes:
        times = 'once' if changes == 1 else f'{changes} times'
        after = 'find out what was done then; see the dashed lines'
        changed = Finding(LOOK, f'the friction has changed {times}', after)
        found = [*found, changed] if len(days) == 1 else [changed, *found]  # of one bag its own verdict decides
    return verdict_of(found)


def _dates(days: Sequence[Day]) -> tuple[str, ...]:
    known = [date_text(day.time)[:10] for day in days if day.time > FIRST_DATE]
    return (f'data of {" to ".join(dict.fromkeys((known[0], known[-1])))}',) if known else ('data without a date',)


def _text(one: Value) -> str:
    return 'not told' if not math.isfinite(one.value) else f'{one.value:.4g} ± {one.std:.2g}'


def _figure(seen: Sequence[BagHealth], changes: Sequence[dict[str, float]]) -> Plot:
    figure, axes = style.new_figure('Friction over that of the seal file, reversal by reversal', 3.6)
    first = 0
    for number, one in enumerate(seen):
        x = np.arange(first, first + len(one.scale), dtype=float)
        colour = style.BLUE if number % 2 == 0 else style.VERMILLION
        style.fill_band(axes, x, one.scale, BAND_95 * one.scale_std, color=colour, alpha=0.2)
        axes.plot(x, one.scale, color=colour, lw=1.2)
        for change in changes:
            if len(one.time) and one.time[0] <= change['time_s'] <= one.time[-1]:
                place = first + int(np.searchsorted(one.time, change['time_s']))
                axes.axvline(place, color=style.BLACK, ls='--', lw=1.0)
        first += len(one.scale)
    axes.axhline(1.0, color=style.GREY, lw=0.8)
    axes.set_xlabel('reversal, all bags one after the other; dashed: a change')
    return finished('scale', figure, axes, ylabel='friction / seal file [-]')
