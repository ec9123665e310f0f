"""A bag as one page: figures, numbers, and how each number was made.

The page stands alone (style and figures are inside, nothing is fetched), and each figure lies beside it as PNG and SVG.
Everything that comes from a bag is escaped. Nothing in it depends on when or where it was made, so the same bag gives
the same bytes.
"""

import base64
import json
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from html import escape
from pathlib import Path
from typing import Any

from seal_friction_ros.core.estimation.estimator import EstimatorSettings
from seal_friction_ros.core.foundation.parameters import meanings
from seal_friction_ros.core.foundation.units import BAR
from seal_friction_ros.offline.reports.bag_evaluation import (
    BAND_95,
    LEVEL_GAP,
    LEVEL_WIDTH,
    MAX_GAP,
    MIN_REST,
    MIN_STEADY_SAMPLES,
    SPEED_TOLERANCE,
    TRIMMED_SHARE,
    BagEvaluation,
    PressureLevel,
    RecordedRun,
    as_figures,
    evaluate,
    read_run,
)
from seal_friction_ros.offline.reports.figures import Plot, force_unit, house_style, render, run_figures, verdict
from seal_friction_ros.offline.reports.tracking_evaluation import (
    SAME,
    SETTLING_TIME,
    TrackingEvaluation,
    TrackingStretch,
    evaluate_tracking,
    tracking_numbers,
)
from seal_friction_ros.offline.reports.tracking_figures import length, stretch_name, tracking_plots, tracking_verdict
from seal_friction_ros.offline.work.atomic_file import write_whole

_MINUS = '\N{MINUS SIGN}'
_MAX_CONFIGURATIONS = 5  # shown in full; a bag with more says how many
_CSS = """
:root { color-scheme: light; }
body { font: 16px/1.55 system-ui, 'DejaVu Sans', sans-serif; color: #1a1a1a; background: #fff;
       max-width: 62rem; margin: 2.5rem auto 5rem; padding: 0 1.5rem; }
h1 { font-size: 1.75rem; line-height: 1.25; margin: 0 0 .3rem; }
h2 { font-size: 1.25rem; margin: 3rem 0 .8rem; padding-top: .8rem; border-top: 1px solid #d9d9d9; }
.lead { font-size: 1.1rem; color: #444; margin: 0 0 1.5rem; }
.tiles { display: grid; grid-template-columns: repeat(auto-fit, minmax(11rem, 1fr)); gap: .8rem; margin: 1.5rem 0; }
.tile { background: #f4f7fa; border-radius: 6px; padding: .8rem 1rem; }
.tile b { display: block; font-size: 1.35rem; line-height: 1.3; font-variant-numeric: tabular-nums; }
.tile span { font-size: .85rem; color: #555; }
.note { background: #fff6e5; border-left: 4px solid #e69f00; padding: .6rem 1rem; margin: .7rem 0; }
figure { margin: 1.8rem 0 2.2rem; }
figure img { width: 100%; height: auto; }
figcaption { font-size: .9rem; color: #555; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; font-size: .9rem; font-variant-numeric: tabular-nums; margin: .8rem 0; }
th, td { padding: .3rem .8rem; text-align: right; border-bottom: 1px solid #e6e6e6; white-space: nowrap; }
th { font-weight: 600; vertical-align: bottom; border-bottom: 2px solid #1a1a1a; white-space: normal; }
th:first-child, td:first-child { padding-left: 0; }
td.text, th.text { text-align: left; white-space: normal; overflow-wrap: anywhere; }
dt { font-weight: 600; } dd { margin: 0 0 .7rem; }
pre { background: #f6f6f6; border-radius: 6px; padding: .9rem 1rem; font-size: .82rem; line-height: 1.45;
      white-space: pre-wrap; overflow-wrap: anywhere; }
summary { cursor: pointer; margin: .6rem 0; }
@media print { h2 { break-after: avoid; } figure, tr { break-inside: avoid; } }
"""

_EXPLANATIONS = f"""<dl>
<dt>Measured sliding friction</dt>
<dd>In steady sliding nothing accelerates, so the force sum is the friction. A stroke is a run of estimates that slide
one way; its first and last {100 * TRIMMED_SHARE:.0f} % are dropped, and of the rest what is within
{100 * SPEED_TOLERANCE:.0f} % of the median speed counts, if it is half of it and {MIN_STEADY_SAMPLES} samples at least.
At each pressure the friction is half the difference of the mean force sums of the two directions, each stroke counting
alike: what the force sum is off by a constant drops out, and is shown as its offset. Where only one direction was
driven it is the mean magnitude, and the offset is in it. The state comes from the recorded estimates.</dd>
<dt>Measured breakaway force</dt>
<dd>The largest force sum, in the direction of the stroke that follows, during a rest of {MIN_REST} s at least with no
gap in time above {MAX_GAP} s. Means and offset are made as above. What pushes the rod between the last sample at rest
and the first of motion is not seen, nor is a peak that the sensor smooths.</dd>
<dt>Spread</dt>
<dd>Standard deviation of single strokes (or starts) about the measured friction, offset removed.</dd>
<dt>Estimated</dt>
<dd>Mean of the recorded Coulomb friction over the same samples, or of the recorded breakaway force at the peaks. The
standard deviation is the one that the estimates themselves state, for a new reading of the sliding friction; the 95 %
band is ± {BAND_95} of it. The breakaway force states none of its own, so the same is used for it.</dd>
<dt>Pressures</dt>
<dd>Mean of the pressures that the seals see, gauge. Sorted pressures are split into levels where they step by more than
{100 * LEVEL_GAP:.0f} %; a level wider than {100 * LEVEL_WIDTH:.0f} % of the highest pressure is a ramp and is cut into
equal parts.</dd>
<dt>What is left out</dt>
<dd>Estimates whose inputs are missing, stale, not finite or out of range. Estimates beyond the pressure range in which
the seal was identified do count: the measurement is good there, and the deviation shows what the law is worth.</dd>
<dt>Inputs</dt>
<dd>Those that were held when the velocity sample of the same stamp was recorded: what the estimator saw, if it recorded
the bag itself.</dd>
</dl>"""

_TRACKING_EXPLANATIONS = f"""<dl>
<dt>Tracking</dt>
<dd>A stretch is what lies between two changes of configuration. Of each, the fade time of the feed-forward and another
{SETTLING_TIME} s are left out, in which it fades in and the servo settles; of a reference that repeats itself, whole
periods count. The error is the reference less the position, both as they were held at the estimate: how old a sample of
either is adds to it. Changes are against the first stretch without any feed-forward force, if the reference had the
same amplitude and period within {100 * SAME:.0f} %.</dd>
<dt>Dwell</dt>
<dd>Mean time for which the speed of the rod stays at or below the stick velocity of the estimator while its direction
changes. A rod that follows its reference is as slow around the turning points: that time stands beside it. Noise of
the velocity above the stick velocity cuts a dwell in pieces.</dd>
</dl>"""


@dataclass(frozen=True)
class ReportSummary:
    """What was written, and the numbers in it."""

    page: Path
    figures: tuple[Path, ...]
    numbers: dict[str, Any]
    """see `bag_evaluation.as_figures`, and ``tracking``, a list of `TrackingStretch`; None where there is no number"""


def write_report(bag: Path, out: Path, namespace: str = '') -> ReportSummary:
    """Write the report of a bag of inputs and estimates: a page, and each figure as PNG and SVG in a folder beside it.

    A report that is there already is replaced, each file at once.

    Args:
        bag: The bag.
        out: HTML file; the figures go to ``<stem>_figures`` beside it.
        namespace: Only topics below it count; for bags of several actuators.

    Raises:
        BagError: The bag cannot be read, or holds no estimates.
        ValueError: The report cannot be written.
    """
    run = read_run(bag, namespace)
    evaluation, tracking = evaluate(run), evaluate_tracking(run)
    with house_style():
        plots = run_figures(run, evaluation) + (tracking_plots(run, tracking) if tracking else [])
        written = write_page(
            out,
            f'Seal friction: {run.name}',
            lambda figure: _sections(run, evaluation, tracking, figure),
            plots,
        )
    return ReportSummary(out, written, {**as_figures(evaluation), 'tracking': tracking_numbers(tracking)})


# -- any page ---------------------------------------------------------------------------------------------------------


def write_page(
    out: Path, title: str, body: Callable[[Callable[[str], str]], Iterable[str]], plots: Sequence[Plot]
) -> tuple[Path, ...]:
    """Write a page and its figures; returns the paths of the figures.

    Args:
        out: HTML file.
        title: Its title, not yet escaped.
        body: Makes the parts of the page in HTML, given what makes the HTML of a figure from its name ('' if there is
            no such figure).
        plots: The figures.

    Raises:
        ValueError: A file cannot be written.
    """
    rendered = {plot.name: render(plot.figure) for plot in plots}
    captions = {plot.name: plot.caption for plot in plots}

    def figure(name: str) -> str:
        """Figure element with the picture inside; empty if there is no such figure."""
        if name not in rendered:
            return ''
        data = base64.b64encode(rendered[name]['svg']).decode()
        caption = escape(captions[name])
        image = f'<img alt="{caption}" src="data:image/svg+xml;base64,{data}">'
        return f'<figure id="{escape(name)}">{image}<figcaption>{caption}</figcaption></figure>'

    parts = '\n'.join(body(figure))
    page = (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f'<title>{escape(title)}</title><style>{_CSS}</style></head>\n<body>\n{parts}\n</body></html>\n'
    )
    folder = out.parent / f'{out.stem}_figures'
    files = {folder / f'{name}.{kind}': data for name, kinds in rendered.items() for kind, data in kinds.items()}
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for path, content in {**files, out: page.encode('utf-8', 'replace')}.items():
            write_whole(path, content)
    except OSError as error:
        raise ValueError(f'{out}: cannot write the page or its figures: {error.strerror or error}') from None
    return tuple(files)


def table(heads: Sequence[str], rows: Iterable[Sequence[Any]], text_columns: Iterable[int] = (0,)) -> str:
    """Table in HTML; every cell is escaped."""
    left = set(text_columns)

    def row(cells: Sequence[Any], tag: str) -> str:
        kinds = (' class="text"' if i in left else '' for i in range(len(cells)))
        inside = (f'<{tag}{kind}>{escape(str(cell))}</{tag}>' for kind, cell in zip(kinds, cells, strict=True))
        return f'<tr>{"".join(inside)}</tr>'

    lines = ''.join(row(cells, 'td') for cells in rows)
    return f'<div class="scroll"><table><thead>{row(heads, "th")}</thead><tbody>{lines}</tbody></table></div>'


def tiles(values: Iterable[tuple[str, str]]) -> str:
    """Row of large numbers with what they are."""
    inside = (f'<div class="tile"><b>{escape(value)}</b><span>{escape(name)}</span></div>' for name, value in values)
    return f'<div class="tiles">{"".join(inside)}</div>'


def number(value: float | None, digits: int = 2, *, signed: bool = False) -> str:
    """Number for a reader; a dash where there is none."""
    if value is None:
        return '\N{EN DASH}'
    rounded = round(value, digits) + 0.0  # no minus zero
    return f'{rounded:{"+" if signed and rounded else ""}.{digits}f}'.replace('-', _MINUS)


# -- the page of a bag ------------------------------------------------------------------------------------------------


def _sections(
    run: RecordedRun, evaluation: BagEvaluation, tracking: TrackingEvaluation | None, figure: Callable[[str], str]
) -> Iterable[str]:
    friction = evaluation.friction
    start = datetime.fromtimestamp(evaluation.start // 1_000_000_000, UTC)
    yield f'<h1>{escape(run.name)}</h1>'
    yield f'<p class="lead">{escape(verdict(friction.sliding))}.</p>'
    yield _tiles(evaluation)
    yield from (f'<p class="note">{escape(note)}</p>' for note in friction.notes)
    yield '<h2>Live estimate</h2>'
    yield figure('live_estimate')
    if tracking:
        yield from _tracking(tracking, figure)
    yield '<h2>Friction by pressure</h2>'
    yield from _friction_tables(evaluation)
    yield figure('friction_over_pressure')
    yield figure('deviation')
    yield '<h2>Friction over velocity</h2>'
    yield figure('friction_over_velocity')
    yield '<h2>Inputs</h2>'
    yield f'<p>First stamp {start:%Y-%m-%d %H:%M:%S} UTC ({evaluation.start} ns), {evaluation.duration:.3f} s long.</p>'
    yield _topics_table(run, evaluation)
    frames = ', '.join(frame or '(empty)' for frame in run.frames)
    yield f'<p>Frame of the velocity samples: {escape(frames)}</p>'
    yield figure('inputs')
    yield '<h2>State and validity</h2>'
    yield from _validity(evaluation)
    yield figure('status')
    yield '<h2>Configuration</h2>'
    yield from _configurations(run)
    yield '<h2>How the numbers are made</h2>'
    yield _EXPLANATIONS
    if tracking:
        yield _TRACKING_EXPLANATIONS


def _tiles(evaluation: BagEvaluation) -> str:
    levels = evaluation.friction.sliding
    strokes = sum(len(level.events) for level in levels)
    values = [('estimates', f'{evaluation.estimates:,}'.replace(',', '\N{THIN SPACE}'))]
    values.append(('length', f'{evaluation.duration:.1f} s'))
    if strokes:
        percents = [abs(level.deviation_percent) for level in levels if level.deviation_percent is not None]
        if percents:
            values.append(('mean absolute deviation over the pressures', f'{sum(percents) / len(percents):.1f} %'))
        inside = sum(level.in_band for level in levels)
        values.append(('measured strokes in the 95 % band', f'{inside} of {strokes}'))
    values.append(('estimates with a status bit', f'{100.0 * evaluation.flagged / evaluation.estimates:.3g} %'))
    if evaluation.input_age:
        values.append(('input age, 99 % below', f'{1e3 * evaluation.input_age["p99"]:.3g} ms'))
    return tiles(values)


def _friction_tables(evaluation: BagEvaluation) -> Iterable[str]:
    friction = evaluation.friction
    if friction.sliding:
        yield '<h3>Sliding</h3>' + _level_table(friction.sliding, 'strokes')
    else:
        yield '<p>No steady sliding, so no measured sliding friction.</p>'
    if friction.breakaway:
        yield '<h3>Breakaway</h3>' + _level_table(friction.breakaway, 'starts')
    else:
        yield '<p>No start from rest, so no measured breakaway force.</p>'


def _tracking(tracking: TrackingEvaluation, figure: Callable[[str], str]) -> Iterable[str]:
    yield '<h2>Tracking</h2>'
    yield f'<p>{escape(tracking_verdict(tracking))}.</p>'
    yield from (f'<p class="note">{escape(note)}</p>' for note in tracking.notes)
    if not tracking.stretches:
        return
    yield figure('tracking')
    yield figure('friction_and_feedforward')
    numbers = (
        'stretch',
        'time [s]',
        'RMS error [µm]',
        'change [%]',
        'peak error [µm]',
        'dwell per reversal [ms]',
        'change [%]',
        'of the reference [ms]',
        'not sliding [%]',
    )
    yield table(numbers, [_tracking_row(stretch) for stretch in tracking.stretches])
    conditions = (
        'time [s]',
        'left out before [s]',
        'samples',
        'reference',
        'largest feed-forward [N]',
        'Coulomb scale',
        'Stribeck scale',
        'viscous friction [N s/m]',
        'smoothing velocity [mm/s]',
        'lead time [ms]',
    )
    yield table(conditions, [_settings_row(stretch) for stretch in tracking.stretches], ())


def _span(stretch: TrackingStretch) -> str:
    return f'{stretch.start:.1f} to {stretch.end:.1f}'


def _tracking_row(stretch: TrackingStretch) -> Sequence[str]:
    still = stretch.not_sliding
    return (
        stretch_name(stretch),
        _span(stretch),
        number(stretch.rms * 1e6, 1),
        number(stretch.rms_change, 1, signed=True),
        number(stretch.peak * 1e6, 1),
        'no reversal' if stretch.dwell is None else number(stretch.dwell * 1e3, 1),
        number(stretch.dwell_change, 1, signed=True),
        number(None if stretch.reference_dwell is None else stretch.reference_dwell * 1e3, 1),
        number(None if still is None else 100.0 * still, 1),
    )


def _settings_row(stretch: TrackingStretch) -> Sequence[str]:
    repeats = f', {1.0 / stretch.period:.3g} Hz' if stretch.period else ''
    settings = stretch.settings
    known = (
        (
            settings.coulomb_scale,
            settings.stribeck_scale,
            settings.viscous_scale * settings.viscous_friction,
            settings.smoothing_velocity * 1e3,
            settings.lead_time * 1e3,
        )
        if settings
        else (None,) * 5
    )
    return (
        _span(stretch),
        number(stretch.settling),
        str(stretch.samples),
        f'± {length(stretch.amplitude)}{repeats}',
        number(stretch.feedforward_peak),
        *(number(value) for value in known),
    )


def _level_table(levels: Sequence[PressureLevel], events: str) -> str:
    unit, size = force_unit(max(abs(level.estimated) for level in levels))
    heads = (
        'pressure [bar]',
        f'measured [{unit}]',
        f'spread [{unit}]',
        f'estimated [{unit}]',
        f'std [{unit}]',
        f'deviation [{unit}]',
        'deviation [%]',
        'in 95 % band',
        'samples',
        f'offset of the force sum [{unit}]',
    )
    rows = [
        (
            number(level.pressure / BAR),
            number(level.measured / size) + ('' if level.both_directions else ' *'),
            number(None if level.measured_spread is None else level.measured_spread / size),
            number(level.estimated / size),
            number(level.estimated_std / size),
            number(level.deviation / size, signed=True),
            number(level.deviation_percent, 1, signed=True),
            f'{level.in_band} of {len(level.events)} {events}',
            level.samples,
            number(None if level.offset is None else level.offset / size, signed=True),
        )
        for level in levels
    ]
    starred = any(not level.both_directions for level in levels)
    return table(heads, rows, ()) + ('<p>* one direction only: an offset is in it.</p>' if starred else '')


def _topics_table(run: RecordedRun, evaluation: BagEvaluation) -> str:
    rows = [
        (topic, kind, count, number(evaluation.rates[topic], 1) if topic in evaluation.rates else number(None))
        for topic, (kind, count) in sorted(run.topics.items())
    ]
    return table(('topic', 'type', 'messages', 'rate [1/s]'), rows, (0, 1))


def _validity(evaluation: BagEvaluation) -> Iterable[str]:
    shares = [(state.lower(), number(100.0 * share, 1)) for state, share in evaluation.state_shares.items()]
    yield table(('state', 'share of the time [%]'), shares)
    counts = [
        (name.lower().replace('_', ' '), count, number(100.0 * count / evaluation.estimates, 2))
        for name, count in evaluation.status_counts.items()
        if count
    ]
    if counts:
        yield table(('status bit', 'estimates', 'share [%]'), counts)
    else:
        yield '<p>No status bit was set in this bag.</p>'
    ages = [(name, number(1e3 * age, 3)) for name, age in evaluation.input_age.items()]
    if ages:
        yield table(('age of the older input', '[ms]'), ages)


def _configurations(run: RecordedRun) -> Iterable[str]:
    if not run.configurations:
        yield '<p>The bag holds no configuration: what made these estimates is not known.</p>'
        return
    if len(run.configurations) > 1:
        yield f'<p>The configuration was published {len(run.configurations)} times; first and last ones below.</p>'
    half = _MAX_CONFIGURATIONS // 2
    shown = run.configurations
    if len(shown) > _MAX_CONFIGURATIONS:
        shown = (*shown[:half], *shown[-half:])
    for time, text in shown:
        yield f'<details{" open" if len(shown) == 1 else ""}><summary>At {number(time, 3)} s</summary>'
        yield from _configuration(text)
        yield '</details>'


def _configuration(text: str) -> Iterable[str]:
    """Settings with their units and meanings, and the rest as it stands; all of it as text if it is something else."""
    try:
        document = json.loads(text)
        settings, selection = dict(document['settings']), dict(document['selection'])
        seals = list(zip(selection['seals'], selection['seal_chambers'], strict=True))
        documents = [json.dumps(seal, indent=2, ensure_ascii=False) for seal in document['seal_documents']]
    except (ValueError, LookupError, TypeError):
        yield f'<pre>{escape(text)}</pre>'
        return
    yield table(('seal', 'chamber'), seals, (0, 1))
    known = meanings(EstimatorSettings)
    rows = [
        (name, value, known[name].unit if name in known else '', known[name].description if name in known else '')
        for name, value in sorted(settings.items())
    ]
    yield table(('setting', 'value', 'unit', 'meaning'), rows, (0, 2, 3))
    for seal in dict.fromkeys(documents):
        yield f'<pre>{escape(seal)}</pre>'
