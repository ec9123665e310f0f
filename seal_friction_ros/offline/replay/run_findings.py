"""Findings of a bag: those of its columns, and of its tracking where it has a reference."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from seal_friction_ros.core.estimation.feedforward import FeedForwardSettings
from seal_friction_ros.core.estimation.findings import (
    BAD,
    GOOD,
    SMALL_CHANGE,
    USUAL_LIMITS,
    Finding,
    Limits,
    Seen,
    Verdict,
    findings_of,
    seen_in,
    verdict_of,
)
from seal_friction_ros.core.foundation.units import UM
from seal_friction_ros.offline.bags.bag import BagError
from seal_friction_ros.offline.bags.recorded_run import RecordedRun
from seal_friction_ros.offline.replay.bag_parts import Chosen
from seal_friction_ros.offline.replay.replay import estimated_run
from seal_friction_ros.offline.replay.tracking_evaluation import (
    TrackingEvaluation,
    configuration_stretches,
    evaluate_tracking,
)

_TUNE = 'tune the feed-forward: seal_friction tune --bag BAG --out feedforward.yaml'


def run_findings(
    run: RecordedRun, seen: Seen, tracking: TrackingEvaluation | None, limits: Limits = USUAL_LIMITS
) -> list[Finding]:
    """Findings of a run, in the order of `findings_of`; what it shows and its tracking are known already."""
    snapshots = [snapshot for _, _, snapshot in configuration_stretches(run) if snapshot is not None]
    known = [snapshot.configuration for snapshot in snapshots]
    found = findings_of(
        seen,
        has_placeholder=any(one.has_placeholder for one in known),
        uses_scale=bool(known) and known[-1].adaptation.mode == 'on',
        limits=limits,
    )
    compensated = tracking.compensated if tracking else None
    if compensated is not None and compensated.rms_change is not None:
        return [*raised(tracking), *found]
    if np.isfinite(run.reference).any():
        return [one._replace(next=_TUNE) if one.level == GOOD else one for one in found]
    return found


def raised(tracking: TrackingEvaluation | None, acting: FeedForwardSettings | None = None) -> Iterator[Finding]:
    """The finding that the feed-forward raises the tracking error, by more than its noise and than `SMALL_CHANGE`.

    With ``acting`` only that of these settings: what has been set to something else does not act any more.
    """
    found = tracking.compensated if tracking else None
    if found is None or acting not in (None, found.settings):
        return
    change, noise = found.rms_change or 0.0, found.rms_noise or 0.0
    if change > max(100.0 * SMALL_CHANGE, noise):
        what = f'the feed-forward raises the tracking error by {change:.1f} % to {found.rms / UM:.0f} µm RMS'
        yield Finding(BAD, what, f'set feedforward.scale to 0, then {_TUNE}', 0.01 * change, 0.01 * noise)


def bag_findings(bag: Path, chosen: Chosen) -> list[Finding]:
    """Findings of a bag; its estimates are made here if it has none, or if another configuration is chosen.

    BagError: the bag cannot be read.
    """
    run = estimated_run(bag, chosen.namespace, chosen.mapping, chosen.override)
    return run_findings(run, seen_in(run.samples), evaluate_tracking(run), chosen.limits)


def verdict_in_words(bag: Path, chosen: Chosen, more: Sequence[Finding] = ()) -> Verdict:
    """Verdict on a bag by its findings and some more; one that has no estimates, and can have none, is BAD."""
    try:
        return verdict_of([*bag_findings(bag, chosen), *more])
    except BagError as error:
        return Verdict(BAD, str(error).removeprefix(f'{bag}: '))
