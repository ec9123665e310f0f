"""One bag in a row of numbers: what is in it, whether it replays, how its seals are, and friction at each pressure."""

import math
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from seal_friction_ros.core.estimation.compiled_pipeline import Answers
from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.friction.states import SLIDING
from seal_friction_ros.core.messages.blocks import Kind, Messages, numbers_of
from seal_friction_ros.core.messages.layouts import PRESSURE_TYPE
from seal_friction_ros.core.messages.records import Status
from seal_friction_ros.offline.bags.bag import BagError, bag_topics
from seal_friction_ros.offline.replay.bag_health import bag_health
from seal_friction_ros.offline.replay.bag_parts import AS_RECORDED, Chosen, try_bags
from seal_friction_ros.offline.replay.compiled_replay import compile_first
from seal_friction_ros.offline.replay.health_indicators import UNKNOWN_DAY, alarms_of, day_of
from seal_friction_ros.offline.replay.parallel_replay import verify
from seal_friction_ros.offline.replay.run_findings import verdict_in_words
from seal_friction_ros.offline.work.executor import Workers
from seal_friction_ros.offline.work.finished_parts import Kept
from seal_friction_ros.offline.work.outcome import Outcome
from seal_friction_ros.offline.work.places import Place

LEVEL = 1e6  # [Pa] width of a pressure level (our choice)
_LARGEST_PRESSURE = 1e9  # [Pa] our choice: a larger one is no pressure
IDENTICAL, DIFFERENT, NOTHING_RECORDED = 'identical', 'different', 'no estimates recorded'
LEVEL_COLUMNS = ('pressure', 'samples', 'friction', 'coulomb_friction', 'residual', 'residual_rms', 'disagreeing')
"""columns of the levels: middle [Pa] of the larger chamber pressure; sliding samples; means [N] of friction, of Coulomb
friction and of the residual in the direction of motion; root mean square [N] of the residual; share of the samples with
`Status.MODEL_DISAGREES`"""


class BagSummary(NamedTuple):
    """A bag; NaN where it does not tell."""

    start: float  # [s] log time of the first message used
    duration: float  # [s]
    messages: int
    replay: str  # `IDENTICAL`, `DIFFERENT` or `NOTHING_RECORDED`
    difference: str  # the first one
    reversals: int
    scale: float  # [-] friction over that of the seal file
    scale_std: float  # [-]
    drift: float  # [-] scale of the last quarter of the bag over that of the first, less 1
    drift_std: float  # [-]
    offset: float  # [N] of the force sum
    residual: float  # [-] root mean square of the residual while sliding, over the Coulomb friction
    disagreeing: float  # [-] share of the sliding samples with `Status.MODEL_DISAGREES`
    level: str  # GOOD, LOOK or BAD
    why: str  # the finding that decides
    next: str  # what to do
    health: str  # why the health cannot be told; empty if it is
    levels: FloatArray  # shape (n, len(LEVEL_COLUMNS)): a row a pressure level


def bag_summary(bag: Path, chosen: Chosen = AS_RECORDED) -> BagSummary:
    """Replay a bag and follow its seals; BagError if it cannot be read."""
    replayed, difference = _replayed(bag, chosen)
    levels, why = _Levels(), ''
    try:
        seen = bag_health(bag, chosen.namespace, chosen.override, on_block=levels.add, mapping=chosen.mapping)
    except BagError as error:
        seen, why = None, str(error)
    day = UNKNOWN_DAY if seen is None else day_of(str(bag), seen)
    drift, table = day.break_in, levels.table()
    verdict = verdict_in_words(bag, chosen, [] if seen is None else alarms_of(day, chosen.limits))
    return BagSummary(
        start=levels.first * 1e-9,
        duration=(levels.last - levels.first) * 1e-9,
        messages=sum(topic.message_count for topic in bag_topics(bag).values()),
        replay=replayed,
        difference=difference,
        reversals=day.reversals,
        scale=day.scale.value,
        scale_std=day.scale.std,
        drift=1.0 / (1.0 + drift.value) - 1.0,
        drift_std=drift.std / (1.0 + drift.value) ** 2,
        offset=day.offset.value,
        residual=_relative_residual(table),
        disagreeing=_mean(table, 'disagreeing'),
        level=verdict.level,
        why=verdict.text,
        next=verdict.next,
        health=why,
        levels=table,
    )


def _replayed(bag: Path, chosen: Chosen) -> tuple[str, str]:
    """Whether the bag replays, and the first difference; a bag with a mapping file holds no estimates."""
    if chosen.mapping is not None:
        return NOTHING_RECORDED, ''
    result = verify(bag, chosen.override, chosen.namespace, bulk_from=0)  # the health takes the compiled estimator, too
    if result.identical:
        return IDENTICAL, ''
    return (DIFFERENT, result.first_difference) if result.recorded_estimates else (NOTHING_RECORDED, '')


def _column(table: FloatArray, name: str) -> FloatArray:
    column: FloatArray = table[:, LEVEL_COLUMNS.index(name)]
    return column


def _mean(table: FloatArray, name: str) -> float:
    """Mean of a column over all samples; NaN if there is none."""
    return float(np.average(_column(table, name), weights=_column(table, 'samples'))) if len(table) else math.nan


def _relative_residual(table: FloatArray) -> float:
    if not len(table):
        return math.nan
    square = np.average(_column(table, 'residual_rms') ** 2, weights=_column(table, 'samples'))
    friction = _mean(table, 'coulomb_friction')
    return math.sqrt(float(square)) / friction if friction > 0.0 else math.nan


class _Levels:
    """Sums over the sliding samples of each pressure level, block by block, and the times of the messages."""

    def __init__(self) -> None:
        self.first = self.last = math.nan  # [ns]
        self._sums: dict[int, FloatArray] = {}
        self._pressure = math.nan  # [Pa] larger chamber pressure of the newest message before the block

    def add(self, messages: Messages, answers: Answers, estimates: Any) -> None:
        """Take a block; arguments as of ``on_block`` of `bag_health`."""
        if len(messages.received):
            self.first = int(messages.received[0]) if math.isnan(self.first) else self.first
            self.last = int(messages.received[-1])
        places, _, chambers = numbers_of(messages, Kind.PRESSURE, PRESSURE_TYPE)
        known = np.append(self._pressure, np.maximum(*chambers))
        self._pressure = float(known[-1])
        before = np.searchsorted(places, np.flatnonzero(answers.estimate_sizes))
        pressure = known[before]
        usable = (np.abs(pressure) < _LARGEST_PRESSURE) & (estimates['state'] == SLIDING)
        if not usable.any():
            return
        chosen, level = estimates[usable], np.floor(pressure[usable] / LEVEL).astype(np.int64)
        residual = chosen['residual'] * chosen['direction']
        disagrees = (chosen['status'] & int(Status.MODEL_DISAGREES)) != 0
        friction, coulomb = np.abs(chosen['friction_force']), chosen['coulomb_friction']
        columns = np.array([np.ones(len(chosen)), friction, coulomb, residual, residual**2, disagrees])
        for one in np.unique(level).tolist():
            self._sums[one] = self._sums.get(one, np.zeros(len(columns))) + columns[:, level == one].sum(axis=1)

    def table(self) -> FloatArray:
        """A row for each level, with `LEVEL_COLUMNS`."""
        rows = []
        for level, (count, *sums) in sorted(self._sums.items()):
            friction, coulomb, residual, square, disagreeing = (total / count for total in sums)
            middle = (level + 0.5) * LEVEL
            rows.append([middle, count, friction, coulomb, residual, math.sqrt(square), disagreeing])
        return np.array(rows, float).reshape(-1, len(LEVEL_COLUMNS))


_COMPILED_BAGS = 20  # bags whose laws are compiled before the work (our choice); another law compiles with its bag


def summaries(bags: Sequence[Place], chosen: Chosen, workers: Workers, kept: Kept) -> list[Outcome[BagSummary]]:
    """`bag_summary` of each bag, in their order; arguments and errors as of `try_bags`."""
    prepare = partial(compile_first, bags[:_COMPILED_BAGS], chosen)
    outcomes = try_bags('fleet', bags, BagSummary, bag_summary, chosen, workers, kept, prepare)
    return [one._replace(result=one.result and _with_rows(one.result)) for one in outcomes]


def _with_rows(kept: BagSummary) -> BagSummary:
    """An empty table has no columns in JSON."""
    return kept._replace(levels=np.reshape(kept.levels, (-1, len(LEVEL_COLUMNS))))
