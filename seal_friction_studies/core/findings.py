"""Numbers of a run that the spool-valve paper discusses, and their discretisation errors."""

import dataclasses
import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from seal_friction_ros.core.foundation.arrays import BoolArray, FloatArray
from seal_friction_studies.core.study_case import StudyCase
from seal_friction_studies.core.transient import TransientResult, last_cycle

REFERENCE_HALF_WIDTH = 0.5e-3
"""[m] about the middle: range of the mean friction of the paper (chapter 6)"""
SLOW_SHARE = 0.2
"""of the highest speed: at this speed the friction near the ends is read (our choice)"""


class Findings(NamedTuple):
    """Numbers of the last cycle of a run; None where they do not apply."""

    friction: float  # [N] mean magnitude within 0.5 mm of the middle
    solid_share: float  # of solid and fluid friction there
    solid_slow: float | None  # [N] solid friction while slowing down, at 0.2 of the highest speed; mean of both strokes
    solid_fast: float  # [N] solid friction at the highest speed, where it is steadiest (smallest)
    fluid_slow: float | None  # [N] like the solid one
    fluid_fast: float  # [N] like the solid one
    rise_on_deceleration: float | None
    """friction at 0.2 of the highest speed, slowing down, over the last at the highest, less 1; mean of strokes"""
    assisted_length: float | None
    """[m] travel of the spool after a reversal over which friction assists the motion, mean of the last cycle"""
    elastic_length: float | None
    """[m] the same from elasticity alone: friction at the reversal over the stiffness of the groove"""
    second_lobe: float | None
    """[m] position at which friction begins to fall while the seal still sticks; None with one seat"""
    edge_peak: float | None  # largest friction at the control edge over the mean in the seat after it
    edge_assist: float | None  # [N] largest force of the chamfer along the motion, on leaving the seat
    friction_on_leaving: float | None
    """[N] lowest friction while that force is above half of its maximum; negative: it assists the motion; None: no such
    force"""
    after_edge: float | None  # [N] mean friction well inside the seat, after the control edge


def findings(result: TransientResult) -> Findings:
    """Findings of the last cycle.

    Raises:
        ValueError: The motion never passes the middle at speed.
    """
    case = result.case
    last = last_cycle(result)
    middle = last & (np.abs(result.position - case.motion.centre) <= REFERENCE_HALF_WIDTH)
    sliding = middle & (result.sliding_velocity != 0.0)
    if not sliding.any():
        raise ValueError(f'case {case.name}: the seal does not slide within {REFERENCE_HALF_WIDTH} m of the middle')
    solid, fluid = np.abs(result.solid), np.abs(result.fluid)
    strokes = [s for s in (last & (result.velocity > 0.0), last & (result.velocity < 0.0)) if s.any()]
    slow = [_slowing(result, stroke) for stroke in strokes]
    slowing = [i for i, _ in slow]
    assisted, elastic = _assisted(result, last)
    edge = case.control_edge
    pushed = np.where(last & (result.velocity > 0.0), result.edge, 0.0)
    leaving = (pushed < 0.0) & (pushed <= 0.5 * pushed.min())
    return Findings(
        friction=float(np.abs(result.friction[middle]).mean()),
        solid_share=float(solid[sliding].sum() / (solid[sliding] + fluid[sliding]).sum()),
        solid_slow=_mean(solid[slowing]) if edge is None else None,
        solid_fast=float(solid[_fast(result, last)].min()),
        fluid_slow=_mean(fluid[slowing]) if edge is None else None,
        fluid_fast=float(fluid[_fast(result, last)].max()),
        rise_on_deceleration=_mean(np.array([abs(result.friction[i] / result.friction[j]) - 1.0 for i, j in slow]))
        if edge is None
        else None,
        assisted_length=assisted,
        elastic_length=elastic,
        second_lobe=_second_lobe(result, last),
        edge_peak=_edge_peak(result, last) if edge else None,
        edge_assist=max(0.0, -float(pushed.min())) if edge else None,
        friction_on_leaving=float(result.friction[leaving].min()) if leaving.any() else None,
        after_edge=_after_edge(result, last) if edge else None,
    )


COARSEST = 4.0
"""factor of the longest step, from which errors are estimated"""


def check_time_step(case: StudyCase) -> None:
    """Refuse a step over which the seal passes the rounded control edge on the coarsest level: such levels may agree.

    Raises:
        ValueError: The step is too long.
    """
    edge = case.control_edge
    if edge is None:
        return
    longest = edge.rounding / (COARSEST * case.motion.speed)
    if case.numerics.time_step > longest:
        raise ValueError(
            f'case {case.name}: numerics.time_step is {case.numerics.time_step:g} s, too long to see '
            f'the rounding of the control edge: at most {longest:.2g} s'
        )


def discretisation_errors(
    case: StudyCase, fine: Findings, run: Callable[[StudyCase], TransientResult]
) -> tuple[dict[str, float], dict[str, float]]:
    """Error of each finding by time step and by grid, each from three levels: field -> error.

    The step is doubled twice, the number of cells halved twice (32 at least). Fields that are None in any run are left
    out.

    Raises:
        ValueError: As `check_time_step`.
    """
    check_time_step(case)
    numerics = case.numerics
    longer = [dataclasses.replace(numerics, time_step=factor * numerics.time_step) for factor in (2.0, COARSEST)]
    coarser = [dataclasses.replace(numerics, cells=max(32, numerics.cells // factor)) for factor in (2, 4)]
    by_step, by_grid = (
        [findings(run(dataclasses.replace(case, numerics=level))) for level in levels] for levels in (longer, coarser)
    )
    return _errors(fine, *by_step), _errors(fine, *by_grid)


def _errors(fine: Findings, middle: Findings, coarse: Findings) -> dict[str, float]:
    rows = zip(fine._fields, fine, middle, coarse, strict=True)
    return {n: error_of_levels(a, b, c) for n, a, b, c in rows if a is not None and b is not None and c is not None}


def error_of_levels(fine: float, middle: float, coarse: float) -> float:
    """Error of ``fine`` from three levels, each with half the step or cells of the next.

    Changes that shrink by a factor q sum up to d / (q - 1) beyond the finest level, d the last change
    ([Roache1994]_, Richardson's extrapolation). q - 1 counts as 0.5 to 3: convergence that looks slower is none, and no
    scheme here is of more than second order. Changes of different sign have no order: then both count (our choices).
    """
    last, first = middle - fine, coarse - middle
    if last * first <= 0.0:
        return abs(last) + abs(first)
    return abs(last) / min(max(first / last - 1.0, 0.5), 3.0)


def _mean(values: FloatArray) -> float | None:
    return float(np.mean(values)) if len(values) else None


def _fast(result: TransientResult, last: BoolArray) -> BoolArray:
    """Steps of the last cycle at the highest speed, in the seat."""
    speed = np.abs(result.velocity)
    fast = last & (speed >= 0.99 * speed[last].max())
    edge = result.case.control_edge
    inside = fast if edge is None else fast & (result.position + _half_width(result) < edge.position)
    return np.asarray(inside if inside.any() else fast)


def _half_width(result: TransientResult) -> float:
    return 0.5 * result.case.numerics.film_width


def _slowing(result: TransientResult, stroke: BoolArray) -> tuple[int, int]:
    """Step at which the stroke has slowed to 0.2 of its highest speed, and the last at the highest."""
    steps = np.flatnonzero(stroke)
    speed = np.abs(result.velocity[steps])
    fastest = int(np.flatnonzero(speed >= 0.99 * speed.max())[-1])
    slow = fastest + int(np.flatnonzero(speed[fastest:] >= SLOW_SHARE * speed.max())[-1])
    return int(steps[slow]), int(steps[fastest])


def _assisted(result: TransientResult, last: BoolArray) -> tuple[float | None, float | None]:
    """Mean travel after the reversals of the last cycle until friction changes sign: computed, and from elasticity."""
    reversals = [
        int(i)
        for i in np.flatnonzero(np.diff(np.sign(result.velocity)) != 0)
        if last[i] and abs(result.friction[i]) > 0
    ]
    ways, estimates = [], []
    for i in reversals:
        before = result.friction[i]
        after = np.flatnonzero(result.friction[i + 1 :] * before <= 0.0)
        if abs(before) < 0.05 * np.abs(result.friction[last]).max() or not len(after):
            continue
        j = i + 1 + int(after[0])
        share = result.friction[j - 1] / (result.friction[j - 1] - result.friction[j])
        place = result.position[j - 1] + share * (result.position[j] - result.position[j - 1])
        turn = _turning_point(result, i)
        ways.append(abs(place - turn))
        estimates.append(abs(before) / result.case.groove.stiffness)
    return (_mean(np.array(ways)), _mean(np.array(estimates))) if ways else (None, None)


def _turning_point(result: TransientResult, i: int) -> float:
    """End of the stroke nearest to the position of step ``i`` [m]."""
    motion = result.case.motion
    ends = motion.centre - 0.5 * motion.distance, motion.centre + 0.5 * motion.distance
    return min(ends, key=lambda end: abs(end - result.position[i]))


def _second_lobe(result: TransientResult, last: BoolArray) -> float | None:
    """Position of the first maximum of friction on the stroke to the right, the vertex of a parabola [m].

    None if the seal has begun to slide by then: it stays on one seat, since friction in the groove holds it there.
    """
    if result.case.seated_groove.half_clearance == 0.0:
        return None
    steps = np.flatnonzero(last & (result.velocity > 0.0))
    friction = result.friction[steps]
    for i in range(1, len(steps) - 1):
        if friction[i] > 0.0 and friction[i] >= friction[i - 1] and friction[i] > friction[i + 1]:
            if result.sliding_velocity[steps[i]] != 0.0:
                return None
            bend = friction[i - 1] - 2.0 * friction[i] + friction[i + 1]
            ahead = 0.5 * (friction[i - 1] - friction[i + 1]) / bend  # in steps
            return float(np.interp(i + ahead, np.arange(len(steps)), result.position[steps]))
    return None


def _edge_peak(result: TransientResult, last: BoolArray) -> float | None:
    after = _after_edge(result, last)
    coming = last & (result.velocity < 0.0)
    return float(np.abs(result.friction[coming]).max() / after) if coming.any() and after else None


def _after_edge(result: TransientResult, last: BoolArray) -> float | None:
    """Mean friction on the stroke into the seat while the film region is in it and the speed above half the highest."""
    edge = result.case.control_edge
    speed = np.abs(result.velocity)
    begins = -math.inf if edge is None else edge.position - 2.0 * _half_width(result)
    inside = last & (result.velocity < 0.0) & (result.position < begins) & (speed > 0.5 * speed.max())
    return _mean(np.abs(result.friction[inside]))
