"""Measured against estimated friction of a recorded run, with notes for the reader, and the other numbers of a bag."""

import json
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from itertools import chain
from typing import Any

import numpy as np

from seal_friction_ros.core.estimation.findings import Seen, seen_in
from seal_friction_ros.core.estimation.strokes import (
    MIN_STEADY_SAMPLES,
    FrictionByPressure,
    PressureLevel,
    friction_by_pressure,
    usable_samples,
)
from seal_friction_ros.core.foundation.arrays import IntArray
from seal_friction_ros.core.foundation.units import BAR
from seal_friction_ros.core.friction.states import FrictionState
from seal_friction_ros.core.messages.coder import DECODERS
from seal_friction_ros.core.messages.records import Status
from seal_friction_ros.offline.bags.recorded_run import RecordedRun


@dataclass(frozen=True)
class BagEvaluation:
    """Numbers of a bag."""

    friction: FrictionByPressure
    notes: tuple[str, ...]
    seen: Seen
    estimates: int
    start: int  # [ns]
    duration: float  # [s] from the first stamp to the last
    rates: dict[str, float]  # topic -> messages per second of this duration
    state_shares: dict[str, float]  # state -> share of the time
    status_counts: dict[str, int]  # bit -> number of estimates with it
    flagged: int  # number of estimates with any status bit
    input_age: dict[str, float]  # quantiles [s] of the age of the inputs; empty if an input is missing throughout


# -- evaluation -------------------------------------------------------------------------------------------------------


def evaluate_run(run: RecordedRun) -> BagEvaluation:
    """All numbers of a bag."""
    seen = seen_in(run.samples)
    friction = friction_by_pressure(seen.events)
    duration = float(run.time.max() - run.time.min())
    known = run.input_age[np.isfinite(run.input_age) & (run.input_age != -1.0)]
    quantiles = {'p50': 0.5, 'p99': 0.99, 'max': 1.0} if len(known) else {}
    counts = {topic: count for topic, (kind, count) in run.topics.items() if kind in DECODERS}
    return BagEvaluation(
        friction=friction,
        notes=_notes(run, friction),
        seen=seen,
        estimates=len(run.time),
        start=run.start,
        duration=duration,
        rates={topic: count / duration if duration else 0.0 for topic, count in counts.items()},
        state_shares=_state_shares(run),
        status_counts=_status_counts(run.status),
        flagged=int(np.count_nonzero(run.status)),
        input_age={name: float(np.quantile(known, share)) for name, share in quantiles.items()},
    )


def _state_shares(run: RecordedRun) -> dict[str, float]:
    """Share of the time in each state; an estimate lasts until the next one, but at most ten median periods."""
    periods = np.diff(run.time, append=run.time[-1])
    median = float(np.median(periods[:-1])) if len(periods) > 1 else 0.0
    periods[-1] = median
    periods = np.clip(periods, 0.0, 10.0 * median) if median > 0.0 else np.ones_like(periods)
    total = float(periods.sum())
    return {state.name: float(periods[run.state == state].sum()) / total for state in FrictionState}


def _status_counts(status: IntArray) -> dict[str, int]:
    counts = {bit.name or '': int(np.count_nonzero(status & int(bit))) for bit in Status}
    unknown = int(np.count_nonzero(status & ~sum(int(bit) for bit in Status)))
    return {**counts, 'UNKNOWN_BITS': unknown} if unknown else counts


def _notes(run: RecordedRun, friction: FrictionByPressure) -> tuple[str, ...]:
    offset, sliding, breakaway = friction.offset, friction.sliding, friction.breakaway
    notes = []
    if not sliding:
        moving = np.count_nonzero(run.state == FrictionState.SLIDING)
        notes.append(
            f'No steady sliding in this bag ({moving} of {len(run.time)} estimates slide), so no measured friction: a '
            f'stroke needs {MIN_STEADY_SAMPLES} usable samples at nearly constant speed.'
        )
    for name, levels in (('sliding', sliding), ('breakaway', breakaway)):
        if offset is not None and (taken := sum(level.has_bag_offset for level in levels)):
            notes.append(
                f'At {taken} of {len(levels)} pressures the {name} friction was measured in one direction only: the '
                f'offset of the force sum over all strokes of both directions, {offset:.4g} N by least squares, is '
                'removed there.'
            )
        if one_sided := _pressures_text(level for level in levels if level.offset is None):
            notes.append(
                f'At {one_sided} the {name} friction was measured in one direction only: the measured value is the '
                'mean magnitude, and an offset of the force sum remains in it.'
            )
        if against := _pressures_text(level for level in levels if level.measured <= 0.0):
            text = 'is against the motion: check the signs of force sum and velocity.'
            notes.append(f'At {against} the force sum of {name} {text}')
        reasons: dict[str, list[PressureLevel]] = {}
        for level in levels:
            if level.why_no_percent and level.measured > 0.0:
                reasons.setdefault(level.why_no_percent, []).append(level)
        notes += [
            f'At {_pressures_text(those)} there is no percentage of the {name} friction: {reason}.'
            for reason, those in reasons.items()
        ]
    usable = usable_samples(run.samples)
    if left_out := np.count_nonzero(~usable):
        bits = _status_counts(run.status[~usable])
        most = max(bits, key=lambda name: bits[name]).lower().replace('_', ' ')
        notes.append(f'{left_out} of {len(usable)} estimates (most: {most}) are left out of the measured friction.')
    same_pressures = np.allclose(run.pressure_a, run.pressure_b, rtol=0.02, atol=5e3, equal_nan=True)
    chambers = {*run.chambers}
    if len(chambers) > 1 and not (same_pressures and chambers == {'a', 'b'}):
        notes.append('The seals see different pressures: the pressure of a level is the mean over the seals.')
    return tuple(notes)


def _pressures_text(levels: Iterable[PressureLevel]) -> str:
    return ', '.join(f'{level.pressure / BAR:.2f} bar' for level in levels)


def evaluation_numbers(evaluation: BagEvaluation) -> dict[str, Any]:
    """The numbers for JSON: plain types, every number finite or null, the events of a level as their count."""
    document = asdict(evaluation)
    del document['seen']
    for level in chain(document['friction']['sliding'], document['friction']['breakaway']):
        level['events'] = len(level['events'])
    result: dict[str, Any] = json.loads(json.dumps(document, allow_nan=False))
    return result


def worst_level(levels: Iterable[PressureLevel]) -> PressureLevel | None:
    """Level with the largest relative deviation; None if no level has one."""
    comparable = [level for level in levels if level.deviation_percent is not None]
    return max(comparable, key=lambda level: abs(level.deviation_percent or 0.0), default=None)
