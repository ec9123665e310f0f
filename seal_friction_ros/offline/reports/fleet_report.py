"""The page of a fleet: a row per bag, a row per rig, and which of them a person should look at."""

import math
import os
from collections.abc import Iterator, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import quote

import numpy as np

from seal_friction_ros.core.foundation.normal_distribution import BAND_95
from seal_friction_ros.offline.replay.bag_summary import DIFFERENT, BagSummary
from seal_friction_ros.offline.replay.health_indicators import NOT_TOLD, Value, trend
from seal_friction_ros.offline.reports import figure_style as style
from seal_friction_ros.offline.reports import verdicts
from seal_friction_ros.offline.reports.figure_style import Plot, finished, house_style
from seal_friction_ros.offline.reports.page import BAD, GOOD, LOOK, ReportSummary, head_of, script, write_page
from seal_friction_ros.offline.work.outcome import Outcome
from seal_friction_ros.offline.work.places import Place

DRIFT = 0.1  # [-] change of the scale within a bag: LOOK above, if it is beyond its 95 % band (our choice)
DISAGREEING = 0.05  # [-] share of the sliding samples whose friction disagrees with the model: LOOK above (our choice)
HOURS_A_DAY = 24.0


class FleetBag(NamedTuple):
    """A bag of a fleet, and what to think of it."""

    path: Place
    level: str  # GOOD, LOOK or BAD
    why: str  # empty if GOOD
    summary: BagSummary | None  # None if the recording is damaged


class Rig(NamedTuple):
    """The bags of one folder, which count as those of one rig (our choice)."""

    name: str
    bags: int
    damaged: int
    scale: float  # [-] median over its bags
    trend: Value  # [1/day] of the scale, over its bags
    disagreeing: float  # [-] mean over its bags


def judged(path: Place, outcome: Outcome[BagSummary]) -> FleetBag:
    """A bag with its level and the reasons for it."""
    found = outcome.result
    if found is None:
        return FleetBag(path, BAD, f'damaged: {outcome.error.removeprefix(f"{path}: ")}', None)
    bad = [f'replay differs: {found.difference}'] * (found.replay == DIFFERENT) + [found.alarms] * bool(found.alarms)
    look = [f'health not told: {found.health.removeprefix(f"{path}: ")}'] * bool(found.health)
    if abs(found.drift) > max(DRIFT, BAND_95 * found.drift_std):
        look.append(f'drifts: friction {found.drift:+.0%} within the bag')
    if found.disagreeing > DISAGREEING:
        look.append(f'disagrees with the model in {found.disagreeing:.0%} of the sliding samples')
    return FleetBag(path, BAD if bad else LOOK if look else GOOD, '; '.join([*bad, *look]), found)


class _Point(NamedTuple):
    """Scale of a bag at its time, for `trend`."""

    time: float  # [s]
    scale: Value


def rigs_of(bags: Sequence[FleetBag]) -> list[Rig]:
    """The folders of the bags, sorted by name."""
    folders: dict[str, list[FleetBag]] = {}
    for bag in bags:
        path = bag.path
        folder = str(path.parent) if isinstance(path, Path) else path.rpartition('/')[0]
        folders.setdefault(folder, []).append(bag)
    return [_rig(name, of_rig) for name, of_rig in sorted(folders.items())]


def _rig(name: str, bags: Sequence[FleetBag]) -> Rig:
    seen = [bag.summary for bag in bags if bag.summary is not None]
    points = [_Point(one.start + 0.5 * one.duration, Value(one.scale, one.scale_std)) for one in seen]
    slope = trend(points, 'scale') if any(point.scale.std > 0.0 for point in points) else NOT_TOLD
    scales = [one.scale for one in seen if math.isfinite(one.scale)]
    shares = [one.disagreeing for one in seen if math.isfinite(one.disagreeing)]
    return Rig(
        name,
        len(bags),
        len(bags) - len(seen),
        float(np.median(scales)) if scales else math.nan,
        Value(slope.value * HOURS_A_DAY, slope.std * HOURS_A_DAY),
        float(np.mean(shares)) if shares else math.nan,
    )


def fleet_numbers(bags: Sequence[FleetBag]) -> dict[str, Any]:
    """Numbers for JSON, without the pressure levels."""
    counts = {level: sum(bag.level == level for bag in bags) for level in (GOOD, LOOK, BAD)}
    return {
        'bags': [{'bag': bag.path, 'level': bag.level, 'why': bag.why, **_plain(bag.summary)} for bag in bags],
        'rigs': [
            {**rig._asdict(), 'trend': rig.trend.value, 'trend_std': rig.trend.std, 'name': rig.name}
            for rig in rigs_of(bags)
        ],
        'counts': counts,
        'damaged': sum(bag.summary is None for bag in bags),
    }


def _plain(summary: BagSummary | None) -> dict[str, Any]:
    if summary is None:
        return {}
    return {name: value for name, value in summary._asdict().items() if name != 'levels'}


@house_style()
def write_fleet_report(bags: Sequence[FleetBag], where: Path, out: Path) -> ReportSummary:
    """Write the page.

    Args:
        bags: The bags.
        where: Folder or list that they are from.
        out: HTML file.
    """
    numbers = fleet_numbers(bags)
    rigs = rigs_of(bags)
    figures = write_page(
        out,
        'fleet',
        [_figure(bags)],
        verdict=verdicts.of_fleet(numbers['counts'], numbers['damaged'], *_worst_names(bags)),
        head=head_of('fleet', f'{len(bags)} bags', f'{len(rigs)} folders', str(where)),
        heads=[name for name, *_ in _COLUMNS],
        count=len(bags),
        rows=_rows(bags, out),
        rigs=rigs,
        text=_text,
        sorting=script('sorting.js'),
    )
    return ReportSummary(out, figures, numbers)


def _worst_names(bags: Sequence[FleetBag]) -> tuple[str, str]:
    """Name and reason of the first bad bag, else of the first to look at, else nothing."""
    for level in (BAD, LOOK):
        for bag in bags:
            if bag.level == level:
                return Path(bag.path).name, bag.why
    return '', ''


def _date(start: float) -> str:
    try:
        return f'{datetime.fromtimestamp(start, UTC):%Y-%m-%d %H:%M}'
    except (ValueError, OverflowError, OSError):
        return 'not told'


def _text(value: float, form: str = '.3g') -> str:
    return f'{value:{form}}' if math.isfinite(value) else 'not told'


_COLUMNS = (
    ('start (UTC)', 'start', _date),
    ('duration [s]', 'duration', lambda value: _text(value, '.1f')),
    ('messages', 'messages', str),
    ('replay', 'replay', str),
    ('friction / file', 'scale', _text),
    ('drift', 'drift', lambda value: _text(value, '+.1%')),
    ('disagrees', 'disagreeing', lambda value: _text(value, '.1%')),
    ('residual / friction', 'residual', lambda value: _text(value, '.1%')),
    ('offset [N]', 'offset', _text),
    ('reversals', 'reversals', str),
)


def _rows(bags: Sequence[FleetBag], out: Path) -> Iterator[Mapping[str, Any]]:
    """What the template shows of each bag: the worst first, then by path."""
    order = (BAD, LOOK, GOOD)
    for bag in sorted(bags, key=lambda bag: (order.index(bag.level), str(bag.path))):
        values = bag.summary
        cells = [('', '') if values is None else _cell(getattr(values, name), show) for _, name, show in _COLUMNS]
        page = _page_of(bag.path, out)
        yield {'name': str(bag.path), 'page': page, 'level': bag.level, 'why': bag.why, 'cells': cells}


def _cell(value: Any, show: Any) -> tuple[str, Any]:
    """Text of a cell, and what it is sorted by; empty for what is not told."""
    key = '' if isinstance(value, float) and not math.isfinite(value) else value
    return show(value), key


def _page_of(bag: Place, out: Path) -> str:
    """Link to the page of a bag, relative to ``out``; empty if there is none beside the bag or beside ``out``."""
    name = f'{Path(bag).name}.html'
    beside = [bag.parent / name] if isinstance(bag, Path) else []
    for page in (*beside, out.parent / name):
        if page.is_file() and page.resolve() != out.resolve():
            return quote(os.path.relpath(page.resolve(), out.parent.resolve()), errors='surrogateescape')
    return ''


def _figure(bags: Sequence[FleetBag]) -> Plot:
    """Friction over that of the seal file, bag by bag in order of time."""
    figure, axes = style.new_figure('Friction over that of the seal file, bag by bag in order of time', 3.4)
    seen = [(bag, bag.summary) for bag in bags if bag.summary is not None and math.isfinite(bag.summary.scale)]
    seen.sort(key=lambda pair: (pair[1].start, str(pair[0].path)))
    for level, colour in ((GOOD, style.GREEN), (LOOK, style.ORANGE), (BAD, style.VERMILLION)):
        points = [(i, one.scale) for i, (bag, one) in enumerate(seen) if bag.level == level]
        if points:
            axes.plot(*zip(*points, strict=True), 'o', color=colour, ms=4.0, label=level)
    axes.axhline(1.0, color=style.GREY, lw=0.8)
    axes.set_xlabel('bag, in order of time')
    return finished('scale', figure, axes, ylabel='friction / seal file [-]')
