"""The page of a fleet: which rig drifts, which recording is damaged; a row and a curve a rig, a row a bag; a table."""

import math
import os
from collections.abc import Iterator, Mapping, Sequence
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import quote

import numpy as np

from seal_friction_ros.core.estimation.findings import BAD, GOOD, LOOK, SMALL_CHANGE, Verdict, worst
from seal_friction_ros.core.foundation.errors import named_errors
from seal_friction_ros.core.foundation.normal_distribution import BAND_95
from seal_friction_ros.offline.replay.bag_summary import DIFFERENT, LEVEL_COLUMNS, BagSummary
from seal_friction_ros.offline.replay.health_indicators import NOT_TOLD, UNKNOWN_DAY, Day, Value, trend
from seal_friction_ros.offline.reports import figure_style as style
from seal_friction_ros.offline.reports.figure_style import Plot, finished, house_style
from seal_friction_ros.offline.reports.formatting import FIRST_DATE, date_text
from seal_friction_ros.offline.reports.page import ReportSummary, head_of, write_page
from seal_friction_ros.offline.work.atomic_file import write_whole
from seal_friction_ros.offline.work.outcome import Outcome
from seal_friction_ros.offline.work.places import Place
from seal_friction_ros.packages import needed

HOURS_A_DAY = 24.0
_COLOURS = (style.VERMILLION, style.BLUE, style.GREEN, style.ORANGE, style.PURPLE, style.SKY)
_MOST_NAMED = 3  # rigs in the verdict
FEWEST_BAGS = 4  # with a date, that tell a change of a rig (our choice)


class FleetBag(NamedTuple):
    """A bag of a fleet, and what to think of it."""

    path: Place
    level: str  # GOOD, LOOK or BAD
    why: str
    summary: BagSummary | None  # None if the recording is damaged


class Rig(NamedTuple):
    """The bags of one folder, which count as those of one rig (our choice); NaN where they do not tell."""

    name: str
    level: str  # of its worst bag, or of its change
    why: str
    change: float  # [-] of the friction from the bags before ``since`` to those after; NaN: not told
    since: float  # [s]
    bags: int
    damaged: int
    scale: float  # [-] median over its bags
    trend: Value  # [1/day] of the scale, over its bags with a date; not told with a deviation above itself
    disagreeing: float  # [-] mean over its bags


def judged(path: Place, outcome: Outcome[BagSummary]) -> FleetBag:
    """A bag with its level and the reason for it."""
    found = outcome.result
    if found is None:
        return FleetBag(path, BAD, f'damaged: {outcome.error.removeprefix(f"{path}: ")}', None)
    if found.replay == DIFFERENT and found.level != BAD:
        return FleetBag(path, BAD, f'replay differs: {found.difference}', found)
    if found.health and found.level == GOOD:
        return FleetBag(path, LOOK, f'health not told: {found.health.removeprefix(f"{path}: ")}', found)
    return FleetBag(path, found.level, found.why, found)


def rigs_of(bags: Sequence[FleetBag]) -> list[Rig]:
    """The folders of the bags: those whose friction has changed most first, then the worst, then by name."""
    folders: dict[str, list[FleetBag]] = {}
    for bag in bags:
        folders.setdefault(_folder(bag), []).append(bag)
    rigs = [_rig(name, of_rig) for name, of_rig in sorted(folders.items())]
    return sorted(rigs, key=lambda rig: (-abs(np.nan_to_num(rig.change)), -_ORDER.index(rig.level)))


_ORDER = (GOOD, LOOK, BAD)


def _folder(bag: FleetBag) -> str:
    return str(bag.path.parent) if isinstance(bag.path, Path) else bag.path.rpartition('/')[0]


def _days(bags: Sequence[FleetBag]) -> list[Day]:
    """Time and scale of each bag that has one and a date, in order of time."""
    seen = [bag.summary for bag in bags if bag.summary is not None and math.isfinite(bag.summary.scale)]
    days = [
        UNKNOWN_DAY._replace(time=one.start + 0.5 * one.duration, scale=Value(one.scale, one.scale_std)) for one in seen
    ]
    return sorted((day for day in days if day.time > FIRST_DATE), key=lambda day: (day.time, day.scale))


def _rig(name: str, bags: Sequence[FleetBag]) -> Rig:
    seen, points = [bag.summary for bag in bags if bag.summary is not None], _days(bags)
    slope = trend(points, 'scale') if any(point.scale.std > 0.0 for point in points) else NOT_TOLD
    slope = slope if abs(slope.value) > slope.std else NOT_TOLD
    change, since = _change(points)
    level = worst([bag.level for bag in bags] + ([] if math.isnan(change) else [LOOK]))
    worst_bags = [bag.why for bag in bags if bag.level == level and level != GOOD]
    why = [] if math.isnan(change) else [f'friction {change:+.0%} since {date_text(since)[:10]}']
    why += [f'{len(worst_bags)} of {len(bags)} bags {level}: {worst_bags[-1]}'] if worst_bags else []
    scales = [one.scale for one in seen if math.isfinite(one.scale)]
    shares = [one.disagreeing for one in seen if math.isfinite(one.disagreeing)]
    return Rig(
        name=name,
        level=level,
        why='; '.join(why),
        change=change,
        since=since,
        bags=len(bags),
        damaged=len(bags) - len(seen),
        scale=float(np.median(scales)) if scales else math.nan,
        trend=Value(slope.value * HOURS_A_DAY, slope.std * HOURS_A_DAY),
        disagreeing=float(np.mean(shares)) if shares else math.nan,
    )


def _change(points: Sequence[Day]) -> tuple[float, float]:
    """Relative change of the friction, and the time of the first bag with it; NaN if the bags do not tell one.

    The bags are split where the sum of the deviations from their mean is largest.
    """
    if len(points) < FEWEST_BAGS:
        return math.nan, math.nan
    scale, std = np.array([one.scale for one in points]).T
    first = int(np.argmax(np.abs(np.cumsum(scale - scale.mean()))[:-1])) + 1
    before, then = scale[:first], scale[first:]
    own = [float(np.hypot(part.std(), np.median(std))) / math.sqrt(len(part)) for part in (before, then)]
    change = float(then.mean() / before.mean()) - 1.0
    is_told = abs(change) > max(SMALL_CHANGE, BAND_95 * math.hypot(*own) / float(before.mean()))
    return (change, points[first].time) if is_told else (math.nan, math.nan)


@house_style()
def write_fleet_report(bags: Sequence[FleetBag], where: Path, out: Path) -> ReportSummary:
    """Write the page of bags of a folder or list; the numbers are without the pressure levels."""
    rigs = rigs_of(bags)
    verdict = _verdict(bags, rigs)
    numbers: dict[str, Any] = {
        'level': verdict.level,
        'verdict': verdict.text,
        'bags': [{**_plain(bag.summary), 'bag': bag.path, 'level': bag.level, 'why': bag.why} for bag in bags],
        'rigs': [rig._asdict() | {'trend': rig.trend.value, 'trend_std': rig.trend.std} for rig in rigs],
        'counts': {level: sum(bag.level == level for bag in bags) for level in _ORDER},
        'damaged': sum(bag.summary is None for bag in bags),
    }
    figures = write_page(
        out,
        'fleet',
        [_figure(bags, rigs)],
        verdict=verdict,
        head=head_of('fleet', f'{len(bags)} bags', f'{len(rigs)} folders', str(where)),
        heads=[name for name, *_ in _COLUMNS],
        count=len(bags),
        rows=_rows(bags, out),
        rigs=rigs,
        text=_text,
    )
    return ReportSummary(out, figures, numbers)


def _plain(summary: BagSummary | None) -> dict[str, Any]:
    return {} if summary is None else {name: v for name, v in summary._asdict().items() if name != 'levels'}


def _verdict(bags: Sequence[FleetBag], rigs: Sequence[Rig]) -> Verdict:
    """Verdict on a fleet: by the rig whose friction has changed, else by the worst; damaged bags are counted."""
    total, level = len(bags), worst(rig.level for rig in rigs)
    if level == GOOD:
        said = 'The bag is good.' if total == 1 else f'All {total} bags are good.'
        return Verdict(GOOD, said, 'nothing; look again after the next recordings.')
    bad, look = (sum(bag.level == one for bag in bags) for one in (BAD, LOOK))
    damaged = sum(bag.summary is None for bag in bags)
    counted = f'{bad} of {total} bag{"" if total == 1 else "s"} {"is" if bad == 1 else "are"} bad, {damaged} damaged'
    first = [rig for rig in rigs if not math.isnan(rig.change)][:_MOST_NAMED] or rigs[:1]
    named = '; '.join(f'{Path(rig.name).name}: {rig.why.rstrip(".")}' for rig in first)
    text = f'{counted}; {look} to look at. {named}.'
    return Verdict(level, text, 'seal_friction report BAG --out PAGE.html shows a bag in full.')


def _text(value: float, form: str = '.3g') -> str:
    return f'{value:{form}}' if math.isfinite(value) else 'not told'


_COLUMNS = (
    ('friction / file', 'scale', _text),
    ('drift', 'drift', lambda value: _text(value, '+.1%')),
    ('disagrees', 'disagreeing', lambda value: _text(value, '.1%')),
    ('residual / friction', 'residual', lambda value: _text(value, '.1%')),
    ('start (UTC)', 'start', date_text),
    ('duration [s]', 'duration', lambda value: _text(value, '.1f')),
    ('replay', 'replay', str),
    ('offset [N]', 'offset', _text),
    ('reversals', 'reversals', str),
    ('messages', 'messages', str),
)


def _rows(bags: Sequence[FleetBag], out: Path) -> Iterator[Mapping[str, Any]]:
    """What the template shows of each bag: the worst first, then by path."""
    for bag in sorted(bags, key=lambda bag: (-_ORDER.index(bag.level), str(bag.path))):
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


def _figure(bags: Sequence[FleetBag], rigs: Sequence[Rig]) -> Plot:
    """Friction over that of the seal file, a curve a rig over its dates."""
    figure, axes = style.new_figure('Friction over that of the seal file, each rig over its dates', 3.4)
    known = {rig.name: _days([bag for bag in bags if _folder(bag) == rig.name]) for rig in rigs}
    begin = min((points[0].time for points in known.values() if points), default=0.0)
    for number, (name, points) in enumerate(known.items()):
        if points:
            days, scales = [(one.time - begin) / 86400.0 for one in points], [one.scale.value for one in points]
            named = number < len(_COLOURS)
            look = {'color': _COLOURS[number], 'label': Path(name).name} if named else {}
            axes.plot(days, scales, 'o-', ms=3.0, lw=1.2, zorder=3.0 - 0.01 * number, **({'color': style.GREY} | look))
    axes.axhline(1.0, color=style.GREY, lw=0.8)
    axes.set_xlabel(f'days since {date_text(begin)[:10]}' if begin else 'no bag has a date')
    return finished('scale', figure, axes, ylabel='friction / seal file [-]')


# -- Parquet table -----------------------------------------------------------------------------------------------------

_TEXTS, _COUNTS = ('replay', 'difference', 'next', 'health'), ('messages', 'reversals')
_OF_BAG = [name for name in BagSummary._fields if name not in ('levels', 'level', 'why')]
_OF_LEVEL = [f'level_{name}' for name in LEVEL_COLUMNS]


def write_fleet_table(bags: Sequence[FleetBag], out: Path) -> None:
    """Write the table; SI units, null where a bag does not tell. A bag without a pressure level has one row.

    An existing file is replaced. MissingPackageError: pyarrow is not installed; ValueError: the file cannot be written.
    """
    arrow, parquet = needed('pyarrow'), needed('pyarrow.parquet')
    kinds = dict.fromkeys(('bag', 'level', 'why', *_TEXTS), arrow.string()) | dict.fromkeys(_COUNTS, arrow.int64())
    names = ('bag', 'level', 'why', *_OF_BAG, *_OF_LEVEL)
    schema = arrow.schema([(name, kinds.get(name, arrow.float64())) for name in names])
    buffer = BytesIO()
    table = arrow.Table.from_pylist([row for bag in bags for row in _table_rows(bag)], schema)
    parquet.write_table(table, buffer, compression='zstd')
    with named_errors(f'{out}: cannot write the table', OSError):
        write_whole(out, buffer.getvalue())


def _table_rows(bag: FleetBag) -> Iterator[dict[str, Any]]:
    of_bag: dict[str, Any] = {'bag': str(bag.path), 'level': bag.level, 'why': bag.why}
    of_bag |= {name: getattr(bag.summary, name, None) for name in _OF_BAG}
    levels = bag.summary.levels.tolist() if bag.summary is not None else []
    for level in levels or [()]:
        row = of_bag | dict(zip(_OF_LEVEL, level, strict=False))
        yield {name: _storable(value) for name, value in row.items()}


def _storable(value: Any) -> Any:
    """A value as the table holds it: no NaN, and text without what UTF-8 cannot hold."""
    if isinstance(value, str):
        return value.encode(errors='replace').decode()
    return None if value != value else value  # noqa: PLR0124  NaN
