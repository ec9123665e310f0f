"""Report of a bag: figures and numbers of the estimate, and of the tracking of a servo if the bag has a reference."""

import json
from collections.abc import Callable, Iterator, Sequence
from datetime import UTC, datetime
from pathlib import Path

from seal_friction_ros.core.estimation import findings, strokes
from seal_friction_ros.core.estimation.estimator import EstimatorSettings
from seal_friction_ros.core.estimation.findings import GOOD, PLACEHOLDER, verdict_of
from seal_friction_ros.core.estimation.strokes import PressureLevel
from seal_friction_ros.core.foundation.documents import parse_json
from seal_friction_ros.core.foundation.parameters import Meaning, meanings
from seal_friction_ros.core.foundation.units import BAR, MM, MS, UM
from seal_friction_ros.offline.bags.mapped_bag import MappingFile
from seal_friction_ros.offline.bags.recorded_run import RecordedRun, read_run
from seal_friction_ros.offline.replay import tracking_evaluation
from seal_friction_ros.offline.replay.run_findings import run_findings
from seal_friction_ros.offline.replay.tracking_evaluation import TrackingStretch
from seal_friction_ros.offline.reports import bag_evaluation
from seal_friction_ros.offline.reports.bag_evaluation import BagEvaluation
from seal_friction_ros.offline.reports.bag_figures import run_figures
from seal_friction_ros.offline.reports.figure_style import house_style
from seal_friction_ros.offline.reports.formatting import FIRST_DATE, date_text, force_unit, length_text, number
from seal_friction_ros.offline.reports.page import (
    PARAMETER_HEADS,
    Columns,
    ReportSummary,
    Table,
    head_of,
    seals_text,
    table_of,
    write_page,
)
from seal_friction_ros.offline.reports.tracking_figures import stretch_name, tracking_plots, tracking_summary

_SHOWN_CONFIGURATIONS = 2  # so many of the first and of the last, in a bag with more


@house_style()
def write_report(bag: Path, out: Path, namespace: str = '', mapping: MappingFile | None = None) -> ReportSummary:
    """Write the report of a bag of inputs and estimates; arguments and errors as of `read_run` and `write_page`.

    The numbers are `evaluation_numbers`, the verdict with all findings, ``placeholder_seals`` and ``tracking``, a list
    of `TrackingStretch`.
    """
    run = read_run(bag, namespace, mapping)
    evaluation, tracking = bag_evaluation.evaluate_run(run), tracking_evaluation.evaluate_tracking(run)
    stretches = tracking.stretches if tracking else ()
    found = run_findings(run, evaluation.seen, tracking)
    verdict = verdict_of(found)
    # The first is the verdict; a page says the others as remarks.
    others = [_sentence(one.text) for one in found if one.level != GOOD and _sentence(one.text) != verdict.text]
    figures = write_page(
        out,
        'bag',
        run_figures(run, evaluation) + (tracking_plots(run, tracking) if tracking else []),
        verdict=verdict._replace(next=verdict.next.replace('BAG', str(bag))),
        head=head_of(f'report {bag}', run.name, data_date(evaluation.start), seals_text(mounted_seals(run))),
        warnings=[*others, *evaluation.notes, *(tracking.notes if tracking else ())],
        run=run,
        evaluation=evaluation,
        limits=strokes,
        verdict_limits=findings,
        start=datetime.fromtimestamp(evaluation.start // 1_000_000_000, UTC),
        sliding_table=_level_table(evaluation.friction.sliding, 'strokes'),
        breakaway_table=_level_table(evaluation.friction.breakaway, 'starts'),
        **_run_tables(run, evaluation),
        configurations=list(_shown_configurations(run)),
        tracking=tracking,
        tracking_limits=tracking_evaluation,
        tracking_summary=tracking_summary(tracking) if tracking else '',
        tracking_table=table_of(stretches, _TRACKING_COLUMNS, (0,)),
        feedforward_table=table_of(stretches, _FEEDFORWARD_COLUMNS),
    )
    numbers = bag_evaluation.evaluation_numbers(evaluation) | {'placeholder_seals': PLACEHOLDER in found}
    numbers |= {'level': verdict.level, 'verdict': verdict.text, 'findings': [one._asdict() for one in found]}
    return ReportSummary(out, figures, numbers | {'tracking': tracking_evaluation.tracking_numbers(tracking)})


def data_date(stamp: int) -> str:
    """Date of a stamp [ns] as text; a stamp near 0 is that of a clock which began there."""
    time = stamp * 1e-9
    return 'data without a date' if time < FIRST_DATE else f'data of {date_text(time)} UTC'


def mounted_seals(run: RecordedRun) -> list[str]:
    """Names of the seals of the first configuration; none if it is unknown."""
    for _, text in run.configurations[:1]:
        try:
            return [Path(str(name)).stem for name in parse_json(text, 'configuration')['selection']['seals']]
        except (ValueError, LookupError, TypeError):
            return []
    return []


def _sentence(text: str) -> str:
    return f'{text[0].upper()}{text[1:]}.'


def _mark(level: PressureLevel) -> str:
    """Mark of a level with one direction: with the offset of the bag removed, or with the offset in the value."""
    return ' \N{DAGGER}' if level.has_bag_offset else '' if level.both_directions else ' *'


def _level_table(levels: Sequence[PressureLevel], events: str) -> Table:
    unit, size = force_unit(max((abs(level.estimated) for level in levels), default=0.0))
    columns: Columns = (
        ('pressure [bar]', lambda level: number(level.pressure, unit=BAR)),
        (f'measured [{unit}]', lambda level: number(level.measured, unit=size) + _mark(level)),
        (f'spread [{unit}]', lambda level: number(level.measured_spread, unit=size)),
        (f'estimated [{unit}]', lambda level: number(level.estimated, unit=size)),
        (f'std [{unit}]', lambda level: number(level.estimated_std, unit=size)),
        (f'deviation [{unit}]', lambda level: number(level.deviation, unit=size, signed=True)),
        ('deviation [%]', lambda level: number(level.deviation_percent, 1, signed=True)),
        ('in 95 % band', lambda level: f'{level.in_band} of {len(level.events)} {events}'),
        ('samples', lambda level: level.samples),
        (f'force offset [{unit}]', lambda level: number(level.offset, unit=size, signed=True)),
    )
    return table_of(levels, columns)


def _time_span(stretch: TrackingStretch) -> str:
    return f'{stretch.start:.1f} to {stretch.end:.1f}'


_TRACKING_COLUMNS: Columns = (
    ('stretch', stretch_name),
    ('time [s]', _time_span),
    ('RMS error [µm]', lambda s: number(s.rms, 1, unit=UM)),
    ('change [%]', lambda s: number(s.rms_change, 1, signed=True)),
    ('peak error [µm]', lambda s: number(s.peak, 1, unit=UM)),
    ('dwell [ms]', lambda s: 'no reversal' if s.dwell is None else number(s.dwell, 1, unit=MS)),
    ('change [%]', lambda s: number(s.dwell_change, 1, signed=True)),
    ('reference dwell [ms]', lambda s: number(s.reference_dwell, 1, unit=MS)),
    ('not sliding [%]', lambda s: number(s.not_sliding, 1, unit=0.01)),
)


def _setting(name: str, unit: float = 1.0) -> Callable[[TrackingStretch], str]:
    """Cell with a setting of the feed-forward; a dash where the settings are unknown."""
    return lambda stretch: number(getattr(stretch.settings, name, None), unit=unit)


_FEEDFORWARD_COLUMNS: Columns = (
    ('time [s]', _time_span),
    ('left out before [s]', lambda s: number(s.settling)),
    ('samples', lambda s: s.samples),
    ('reference', lambda s: f'± {length_text(s.amplitude)}' + (f', {1.0 / s.period:.3g} Hz' if s.period else '')),
    ('largest feed-forward [N]', lambda s: number(s.feedforward_peak)),
    ('scale', _setting('scale')),
    ('smoothing velocity [mm/s]', _setting('smoothing_velocity', MM)),
    ('lead time [ms]', _setting('lead_time', MS)),
)


def _run_tables(run: RecordedRun, evaluation: BagEvaluation) -> dict[str, Table]:
    """Tables of topics, states, status bits and ages of the inputs."""
    rates, estimates = evaluation.rates, evaluation.estimates
    topics = [(topic, kind, count, number(rates.get(topic), 1)) for topic, (kind, count) in sorted(run.topics.items())]
    states = [(state.lower(), number(100.0 * share, 1)) for state, share in evaluation.state_shares.items()]
    counts = {name.lower().replace('_', ' '): count for name, count in evaluation.status_counts.items() if count}
    bits = [(name, count, number(100.0 * count / estimates)) for name, count in counts.items()]
    ages = [(name, number(age, 3, unit=MS)) for name, age in evaluation.input_age.items()]
    return {
        'topic_table': Table(('topic', 'type', 'messages', 'rate [1/s]'), topics, (0, 1)),
        'state_table': Table(('state', 'share of the time [%]'), states, (0,)),
        'status_table': Table(('status bit', 'estimates', 'share [%]'), bits, (0,)),
        'age_table': Table(('age of the older input', '[ms]'), ages, (0,)),
    }


def _shown_configurations(run: RecordedRun) -> Iterator[tuple[float, Sequence[Table], Sequence[str]]]:
    """The first and the last configurations: time [s], tables of seals and settings, JSON of each different seal.

    One that cannot be parsed is shown as its text.
    """
    shown, known = run.configurations, meanings(EstimatorSettings)
    if len(shown) > 2 * _SHOWN_CONFIGURATIONS + 1:
        shown = (*shown[:_SHOWN_CONFIGURATIONS], *shown[-_SHOWN_CONFIGURATIONS:])
    for time, text in shown:
        try:
            document = parse_json(text, 'configuration')
            settings, selection = dict(document['settings']), dict(document['selection'])
            mounted = list(zip(selection['seals'], selection['seal_chambers'], strict=True))
            seals = [json.dumps(seal, indent=2, ensure_ascii=False) for seal in document['seal_documents']]
        except (ValueError, LookupError, TypeError):
            yield time, (), (text,)
            continue
        described = [(name, value, known.get(name, Meaning('', ''))) for name, value in sorted(settings.items())]
        rows = [(name, value, meaning.unit, meaning.description) for name, value, meaning in described]
        setting_table = Table(('setting', *PARAMETER_HEADS[1:]), rows, (0, 2, 3))
        yield time, (Table(('seal', 'chamber'), mounted, (0, 1)), setting_table), list(dict.fromkeys(seals))
