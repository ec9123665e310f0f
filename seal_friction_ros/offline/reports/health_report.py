"""Health of the seals over bags in order of time: indicators with their uncertainty, trends, changes and alarms."""

import math
from collections.abc import Iterable, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from seal_friction_ros.core.estimation.friction_change import FrictionChange, watch
from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.foundation.normal_distribution import BAND_95
from seal_friction_ros.offline.replay.bag_health import BagHealth
from seal_friction_ros.offline.reports import figure_style as style
from seal_friction_ros.offline.reports import verdicts
from seal_friction_ros.offline.reports.figure_style import Plot, finished, house_style
from seal_friction_ros.offline.reports.page import ReportSummary, Table, head_of, write_page

INDEPENDENT = 8  # reversals between two scales that share no ratio: the median is over six, and the scale lags
HOUR = 3600.0  # [s]
_FIRST_DATE = 365.0 * 24.0 * HOUR  # [s] a stamp before 1971 is no date (our choice)
SPREAD_OF_FRICTION = 0.2  # [-] least spread of the friction by the law that tells asymmetry from load


class Value(NamedTuple):
    """A number and its standard deviation; NaN where the data do not tell."""

    value: float
    std: float


NOT_TOLD = Value(math.nan, math.nan)


class Limits(NamedTuple):
    """Alarm limits (our choice)."""

    scale_low: float = 0.6
    scale_high: float = 1.5
    breakaway: float = 2.5  # [-] over Coulomb friction
    noise: float = 0.3  # [-] over Coulomb friction


class Day(NamedTuple):
    """Indicators of one bag."""

    name: str
    time: float  # [s] stamp of its middle
    reversals: int
    scale: Value  # [-] friction over that of the seal file, at the pressures and speeds of both
    offset: Value  # [N]
    breakaway: Value  # [-] largest friction of a start after a rest, over Coulomb friction
    asymmetry: Value  # [-] part of the friction that has another size in the two directions
    break_in: Value  # [-] friction of the first quarter of the bag over that of the last, less 1
    noise: Value  # [N]
    friction: float  # [N] by the seal file, median over the reversals


def day_of(name: str, seen: BagHealth) -> Day:
    """Indicators of a bag."""
    count = len(seen.scale)
    quarter = max(count // 4, 1)
    if not count:
        nothing = NOT_TOLD
        return Day(name, math.nan, 0, nothing, nothing, nothing, nothing, nothing, nothing, math.nan)
    early, late = _mean(seen.scale[:quarter]), _mean(seen.scale[-quarter:])
    change = (
        Value(early.value / late.value - 1.0, math.hypot(early.std, late.std) / late.value)
        if count >= 4 * INDEPENDENT
        else NOT_TOLD
    )
    known = math.sqrt(float(np.mean(seen.scale_std**2)))
    scale = _mean(seen.scale[-max(count // 2, 1) :])
    pairs = 0.5 * (seen.offset[1:] + seen.offset[:-1])  # strokes alternate, so the half of the scale error cancels
    return Day(
        name,
        float(np.median(seen.time)),
        count,
        Value(scale.value, max(scale.std, known)),
        _mean(pairs) if len(pairs) else NOT_TOLD,
        _mean(seen.starts) if len(seen.starts) else NOT_TOLD,
        _asymmetry(seen),
        change,
        Value(seen.noise, seen.noise / math.sqrt(2.0 * count)),
        float(np.median(seen.friction)),
    )


def _mean(values: FloatArray) -> Value:
    """Mean and its standard deviation, with one independent value in `INDEPENDENT`."""
    independent = max(len(values) / INDEPENDENT, 1.0)
    return Value(float(values.mean()), float(values.std(ddof=min(len(values) - 1, 1)) / math.sqrt(independent)))


def _asymmetry(seen: BagHealth) -> Value:
    """Slope of the offset over the friction: a load has none. Only where the friction by the law varies enough."""
    if len(seen.friction) < 2 * INDEPENDENT or np.ptp(seen.friction) < SPREAD_OF_FRICTION * seen.friction.mean():
        return NOT_TOLD
    pairs, friction = 0.5 * (seen.offset[1:] + seen.offset[:-1]), seen.friction[1:]
    fit, covariance = np.polyfit(friction, pairs, 1, cov=True)
    return Value(float(fit[0]), math.sqrt(INDEPENDENT * float(covariance[0, 0])))


def trend(days: Sequence[Day], name: str) -> Value:
    """Change of an indicator [1/h], from a line weighted with the uncertainties; not told by fewer than 3 bags."""
    known = [(day.time, *getattr(day, name)) for day in days if math.isfinite(getattr(day, name).value)]
    if len(known) < 3 or np.ptp([time for time, *_ in known]) == 0.0:
        return NOT_TOLD
    time, value, std = np.array(known).T
    least = max(float(np.median(std)), 1e-12)
    hours = (time - time.mean()) / HOUR
    fit, covariance = np.polyfit(hours, value, 1, w=1.0 / np.maximum(std, least), cov='unscaled')
    misfit = value - np.polyval(fit, hours)
    inflated = max(1.0, float(np.sum((misfit / np.maximum(std, least)) ** 2)) / (len(known) - 2))
    return Value(float(fit[0]), math.sqrt(float(covariance[0, 0]) * inflated))


def changes_of(seen: Iterable[BagHealth]) -> list[dict[str, float]]:
    """When the friction changed, over all bags."""
    known, found = FrictionChange(), []
    for bag in seen:
        for i in range(0, len(bag.scale), INDEPENDENT):
            before = known.changes
            known = watch(known, round(bag.time[i] * 1e9), float(bag.scale[i]))
            if known.changes > before:
                found.append(
                    {'time_s': known.changed_at * 1e-9, 'scale_before': known.before, 'scale_then': float(bag.scale[i])}
                )
    return found


def alarms_of(day: Day, limits: Limits) -> list[str]:
    """What is beyond its limit, in words."""
    found = []
    low, high = day.scale.value - BAND_95 * day.scale.std, day.scale.value + BAND_95 * day.scale.std
    if low > limits.scale_high or high < limits.scale_low:
        found.append(f'friction is {day.scale.value:.2f} times that of the seal file')
    if day.breakaway.value - BAND_95 * day.breakaway.std > limits.breakaway:
        found.append(f'a start takes {day.breakaway.value:.2f} times the Coulomb friction')
    if day.noise.value > limits.noise * day.friction * max(day.scale.value, 1e-9):
        found.append(f'the residual is {day.noise.value / day.friction:.0%} of the friction')
    return found


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
    """Numbers and, with ``out``, the page.

    Args:
        names: Of the bags.
        seen: What each shows, in order of time.
        out: HTML file.
        limits: For alarms.
    """
    days = [day_of(name, one) for name, one in zip(names, seen, strict=True)]
    trends = {name: trend(days, name) for name in INDICATORS}
    changes = changes_of(seen)
    alarms = {day.name: alarms_of(day, limits) for day in days}
    numbers: dict[str, Any] = {
        'bags': [
            {
                'bag': day.name,
                'time_s': day.time,
                'reversals': day.reversals,
                'friction_N': day.friction * day.scale.value,
                **{key: getattr(day, name)[i] for name in INDICATORS for i, key in enumerate((name, f'{name}_std'))},
                'alarms': alarms[day.name],
            }
            for day in days
        ],
        'trends_per_hour': {name: one._asdict() for name, one in trends.items()},
        'changes': changes,
    }
    if out is None:
        return ReportSummary(Path(), (), numbers)
    said = [f'{name}: {", ".join(texts)}' for name, texts in alarms.items() if texts]
    rows = [[day.name, day.reversals, *(_text(getattr(day, name)) for name in INDICATORS)] for day in days]
    table = Table(('bag', 'reversals', *(f'{text} [{unit}]' for text, unit in INDICATORS.values())), rows, (0,))
    trend_rows = [[text, _text(trends[name]), f'{unit}/h'] for name, (text, unit) in INDICATORS.items()]
    figures = write_page(
        out,
        'health',
        [_figure(seen, changes)],
        verdict=verdicts.of_health(said, len(changes), sum(day.reversals for day in days)),
        head=head_of('health', *([f'{len(days)} bags'] if len(days) > 1 else [days[0].name]), *_dates(days)),
        days=days,
        table=table,
        trends=Table(('indicator', 'change an hour', 'unit'), trend_rows, (0, 2)),
    )
    return ReportSummary(out, figures, numbers)


def _dates(days: Sequence[Day]) -> tuple[str, ...]:
    """Dates of the data, first to last."""
    known = [f'{datetime.fromtimestamp(day.time, UTC):%Y-%m-%d}' for day in days if day.time > _FIRST_DATE]
    return (f'data of {" to ".join(dict.fromkeys((known[0], known[-1])))}',) if known else ('data without a date',)


def _text(one: Value) -> str:
    """Value and standard deviation as text."""
    return 'not told' if not math.isfinite(one.value) else f'{one.value:.4g} ± {one.std:.2g}'


def _figure(seen: Sequence[BagHealth], changes: Sequence[dict[str, float]]) -> Plot:
    """Scale over the reversals, bag after bag."""
    figure, axes = style.new_figure('Friction over that of the seal file, reversal by reversal', 3.6)
    first = 0
    for number, one in enumerate(seen):
        x = np.arange(first, first + len(one.scale))
        colour = style.BLUE if number % 2 == 0 else style.VERMILLION
        axes.fill_between(
            x, one.scale - BAND_95 * one.scale_std, one.scale + BAND_95 * one.scale_std, color=colour, alpha=0.2, lw=0
        )
        axes.plot(x, one.scale, color=colour, lw=1.2)
        for change in changes:
            if len(one.time) and one.time[0] <= change['time_s'] <= one.time[-1]:
                axes.axvline(
                    first + int(np.searchsorted(one.time, change['time_s'])), color=style.BLACK, ls='--', lw=1.0
                )
        first += len(one.scale)
    axes.axhline(1.0, color=style.GREY, lw=0.8)
    axes.set_xlabel('reversal, all bags one after the other; dashed: a change')
    return finished('scale', figure, axes, ylabel='friction / seal file [-]')
