"""Tuned settings on plants that they were not tuned on: rigid seals, elastic seals, and seals of another structure.

The search of `simulated_axis` has one plant, on which its result grades itself. What the result is worth on a plant of
another structure is told here, by measures that hold for elastic seals too.
"""

from dataclasses import replace
from typing import NamedTuple

from seal_friction_ros.core.estimation.feedforward import FeedForwardSettings
from seal_friction_ros.core.servo.closed_loop import EVALUATED_PERIODS, without_feedforward
from seal_friction_ros.core.servo.elastic_plant import ELASTICITIES, MOST_GROUPS, seals_of_plant
from seal_friction_ros.core.servo.tracking import error_area, reversal_rms, tracking_rms
from seal_friction_ros.core.tuning.simulated_axis import SEARCH_HOLD, TuningProblem


class ReversalQuality(NamedTuple):
    """Tracking over the evaluated part of the sine."""

    tracking_rms: float  # [m]
    reversal_rms: float  # [m] near the reversals
    error_area: float  # [m s] per reversal


class PlantOutcome(NamedTuple):
    """One plant without and with the feed-forward."""

    plant: str  # of `ELASTICITIES`
    without: ReversalQuality
    tuned: ReversalQuality


def on_plants(problem: TuningProblem, feedforward: FeedForwardSettings) -> tuple[PlantOutcome, ...]:
    """The settings on each of `ELASTICITIES`; empty for three seals, or if a seal file has no presliding."""
    servo = problem.axis.servo
    if not 0 < len(servo.seals) <= MOST_GROUPS or not all(mounted.seal.presliding for mounted in servo.seals):
        return ()
    outcomes = []
    for plant in ELASTICITIES:
        elastic = seals_of_plant(plant, servo.seals, servo.load.mass)
        other = replace(problem, axis=problem.axis._replace(servo=replace(servo, elastic=elastic)))
        found = (_quality(other, settings) for settings in (without_feedforward(feedforward), feedforward))
        outcomes.append(PlantOutcome(plant, *found))
    return tuple(outcomes)


def _quality(problem: TuningProblem, settings: FeedForwardSettings) -> ReversalQuality:
    motions = problem.motions(SEARCH_HOLD)
    part = motions.evaluated_part(problem.runs(settings)[0])
    pair = part.reference, part.position
    area = error_area(*pair, problem.axis.servo.control_period, 2 * EVALUATED_PERIODS)
    return ReversalQuality(tracking_rms(*pair), reversal_rms(*pair), area)
