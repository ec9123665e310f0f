"""Report of a bag: figures and numbers of the estimate, and of the tracking of a servo if the bag has a reference."""

import json
from collections.abc import Iterator, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple

from seal_friction_ros.core.estimation.estimator import EstimatorSettings
from seal_friction_ros.core.foundation.parameters import meanings
from seal_friction_ros.core.foundation.units import BAR, MM, MS, UM
from seal_friction_ros.offline.bags.recorded_run import RecordedRun, read_run
from seal_friction_ros.offline.reports import bag_evaluation, tracking_evaluation
from seal_friction_ros.offline.reports.bag_evaluation import BagEvaluation, PressureLevel
from seal_friction_ros.offline.reports.bag_figures import friction_summary, run_figures
from seal_friction_ros.offline.reports.figure_style import house_style
from seal_friction_ros.offline.reports.formatting import force_unit, length_text, number
from seal_friction_ros.offline.reports.page import PARAMETER_HEADS, ReportSummary, Table, write_page
from seal_friction_ros.offline.reports.tracking_evaluation import TrackingStretch
from seal_friction_ros.offline.reports.tracking_figures import stretch_name, tracking_plots, tracking_summary

_SHOWN_CONFIGURATIONS = 2  # so many of the first and of the last, in a bag with more


@house_style()
def write_report(bag: Path, out: Path, namespace: str = '') -> ReportSummary:
    """Write the report of a bag of inputs and estimates; see `write_page`.

    Args:
        bag: The bag.
        out: HTML file.
        namespace: Only topics below it count; for bags of several actuators.

    Returns:
        Files, and as numbers `evaluation_numbers` and ``tracking``, a list of `TrackingStretch`.

    Raises:
        BagError: The bag cannot be read, or holds no estimates.
        ValueError: The report cannot be written.
    """
    run = read_run(bag, namespace)
    evaluation, tracking = bag_evaluation.evaluate_run(run), tracking_evaluation.evaluate_tracking(run)
    stretches = tracking.stretches if tracking else ()
    figures = write_page(
        out,
        'bag',
        run_figures(run, evaluation) + (tracking_plots(run, tracking) if tracking else []),
        run=run,
        evaluation=evaluation,
        limits=bag_evaluation,
        summary=friction_summary(evaluation.friction.sliding),
        start=datetime.fromtimestamp(evaluation.start // 1_000_000_000, UTC),
        sliding_table=_level_table(evaluation.friction.sliding, 'strokes'),
        breakaway_table=_level_table(evaluation.friction.breakaway, 'starts'),
        topic_table=_topic_table(run, evaluation),
        state_table=_state_table(evaluation),
        status_table=_status_table(evaluation),
        age_table=_age_table(evaluation),
        configurations=list(_shown_configurations(run)),
        tracking=tracking,
        tracking_limits=tracking_evaluation,
        tracking_summary=tracking_summary(tracking) if tracking else '',
        tracking_table=_tracking_table(stretches),
        feedforward_table=_feedforward_table(stretches),
    )
    numbers = bag_evaluation.evaluation_numbers(evaluation)
    return ReportSummary(out, figures, numbers | {'tracking': tracking_evaluation.tracking_numbers(tracking)})


def _level_table(levels: Sequence[PressureLevel], events: str) -> Table:
    unit, size = force_unit(max((abs(level.estimated) for level in levels), default=0.0))
    heads = (
        'pressure [bar]', f'measured [{unit}]', f'spread [{unit}]', f'estimated [{unit}]', f'std [{unit}]',
        f'deviation [{unit}]', 'deviation [%]', 'in 95 % band', 'samples', f'offset of the force sum [{unit}]',
    )  # fmt: skip
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
    return Table(heads, rows)


def _tracking_table(stretches: Sequence[TrackingStretch]) -> Table:
    heads = (
        'stretch', 'time [s]', 'RMS error [µm]', 'change [%]', 'peak error [µm]', 'dwell per reversal [ms]',
        'change [%]', 'dwell of the reference [ms]', 'not sliding [%]',
    )  # fmt: skip
    rows = [
        (
            stretch_name(s),
            f'{s.start:.1f} to {s.end:.1f}',
            number(s.rms / UM, 1),
            number(s.rms_change, 1, signed=True),
            number(s.peak / UM, 1),
            'no reversal' if s.dwell is None else number(s.dwell / MS, 1),
            number(s.dwell_change, 1, signed=True),
            number(None if s.reference_dwell is None else s.reference_dwell / MS, 1),
            number(None if s.not_sliding is None else 100.0 * s.not_sliding, 1),
        )
        for s in stretches
    ]
    return Table(heads, rows, (0,))


def _feedforward_table(stretches: Sequence[TrackingStretch]) -> Table:
    heads = (
        'time [s]', 'left out before [s]', 'samples', 'reference', 'largest feed-forward [N]', 'scale',
        'smoothing velocity [mm/s]', 'lead time [ms]',
    )  # fmt: skip
    rows = []
    for stretch in stretches:
        known = stretch.settings
        settings = known and (
            known.scale,
            known.smoothing_velocity / MM,
            known.lead_time / MS,
        )
        repeats = f', {1.0 / stretch.period:.3g} Hz' if stretch.period else ''
        rows.append(
            (
                f'{stretch.start:.1f} to {stretch.end:.1f}',
                number(stretch.settling),
                stretch.samples,
                f'± {length_text(stretch.amplitude)}{repeats}',
                number(stretch.feedforward_peak),
                *(number(value) for value in settings or (None,) * 5),
            )
        )
    return Table(heads, rows)


def _topic_table(run: RecordedRun, evaluation: BagEvaluation) -> Table:
    topics = sorted(run.topics.items())
    rows = [(topic, kind, count, number(evaluation.rates.get(topic), 1)) for topic, (kind, count) in topics]
    return Table(('topic', 'type', 'messages', 'rate [1/s]'), rows, (0, 1))


def _state_table(evaluation: BagEvaluation) -> Table:
    rows = [(state.lower(), number(100.0 * share, 1)) for state, share in evaluation.state_shares.items()]
    return Table(('state', 'share of the time [%]'), rows, (0,))


def _status_table(evaluation: BagEvaluation) -> Table:
    rows = [
        (name.lower().replace('_', ' '), count, number(100.0 * count / evaluation.estimates))
        for name, count in evaluation.status_counts.items()
        if count
    ]
    return Table(('status bit', 'estimates', 'share [%]'), rows, (0,))


def _age_table(evaluation: BagEvaluation) -> Table:
    rows = [(name, number(age / MS, 3)) for name, age in evaluation.input_age.items()]
    return Table(('age of the older input', '[ms]'), rows, (0,))


class _ShownConfiguration(NamedTuple):
    """One configuration of the bag; only ``text`` if it cannot be parsed."""

    time: float
    """[s] since the first estimate"""
    text: str
    seal_table: Table | None = None
    setting_table: Table | None = None
    seals: Sequence[str] = ()
    """JSON of each different seal"""


def _shown_configurations(run: RecordedRun) -> Iterator[_ShownConfiguration]:
    """The first and the last configurations: settings with units and meanings, and the seals."""
    shown = run.configurations
    if len(shown) > 2 * _SHOWN_CONFIGURATIONS + 1:
        shown = (*shown[:_SHOWN_CONFIGURATIONS], *shown[-_SHOWN_CONFIGURATIONS:])
    known = meanings(EstimatorSettings)
    for time, text in shown:
        try:
            document = json.loads(text)
            settings, selection = dict(document['settings']), dict(document['selection'])
            mounted = list(zip(selection['seals'], selection['seal_chambers'], strict=True))
            seals = [json.dumps(seal, indent=2, ensure_ascii=False) for seal in document['seal_documents']]
        except (ValueError, LookupError, TypeError):
            yield _ShownConfiguration(time, text)
            continue
        rows = [
            (name, value, known[name].unit, known[name].description) if name in known else (name, value, '', '')
            for name, value in sorted(settings.items())
        ]
        yield _ShownConfiguration(
            time,
            text,
            Table(('seal', 'chamber'), mounted, (0, 1)),
            Table(('setting', *PARAMETER_HEADS[1:]), rows, (0, 2, 3)),
            list(dict.fromkeys(seals)),
        )
