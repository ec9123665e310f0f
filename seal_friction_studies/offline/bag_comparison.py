"""Measured force of a bag against the friction that a lubricated-contact case gives on the same motion."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.offline.bags.recorded_run import read_run
from seal_friction_studies.core.kinematics import MeasuredMotion
from seal_friction_studies.core.measuring_chain import MeasuringChain, transducer_force
from seal_friction_studies.core.spool_evaluation import (
    SpoolEvaluation,
    moving_average,
    resonance_frequency,
    without_resonance,
)
from seal_friction_studies.core.study_case import StudyCase
from seal_friction_studies.core.transient import TransientResult
from seal_friction_studies.offline.study_runs import run_with_progress

_FEWEST_SAMPLES = 10


@dataclass(frozen=True, eq=False)
class Comparison:
    """A case run through a measured motion, and the measured force."""

    bag: str
    chain: MeasuringChain  # that ``shown`` is computed for
    result: TransientResult
    time: FloatArray  # [s] of the measured samples
    position: FloatArray  # [m]
    measured: FloatArray  # force without its offset [N]
    filtered: FloatArray  # measured force without the resonance of the measuring chain, averaged [N]
    computed: FloatArray  # computed friction, filtered in the same way, at the measured times [N]
    averaged_samples: int
    resonance: float | None
    """natural frequency of the measuring chain, found in the force [Hz]; None if no resonance stands out"""
    shown: FloatArray  # reading of the measuring chain for the computed friction [N], at the times of ``result``

    def numbers(self) -> dict[str, Any]:
        """Numbers for JSON."""
        return {
            'case': self.result.case.name,
            'bag': self.bag,
            'resonance_Hz': self.resonance,
            'measured_mean_N': float(np.abs(self.filtered).mean()),
            'computed_mean_N': float(np.abs(self.computed).mean()),
            'rms_difference_N': float(np.sqrt(np.mean((self.computed - self.filtered) ** 2))),
            'correlation': float(np.corrcoef(self.computed, self.filtered)[0, 1]),
            'retried_steps': self.result.retried_steps,
            'mass_defect': self.result.mass_defect,
        }

    def summary(self) -> str:
        """One line for a person."""
        numbers = self.numbers()
        return (
            f'{self.result.case.name} on {self.bag}: mean magnitude {numbers["measured_mean_N"]:.3g} N measured, '
            f'{numbers["computed_mean_N"]:.3g} N computed, correlation {numbers["correlation"]:.2f}'
        )


def compare_with_bag(
    case: StudyCase, bag: Path, window: tuple[float, float] | None, evaluation: SpoolEvaluation | None = None
) -> Comparison:
    """Run a case through the recorded position of a bag and compare the recorded force with the computed friction.

    The force is filtered: a resonance of the measuring chain is found and removed, and the rest averaged. The computed
    friction passes the same filter. It is also shown as a measuring chain of that natural frequency would read it;
    without a resonance, or if the samples are unevenly spaced in time, as the chain of the paper would.

    Args:
        case: The case; its own motion is not used. The middle of the measured stroke is placed at its centre.
        bag: Bag with estimates and force sum, and with position; without position, the velocity is integrated.
        window: Begin and end of the part to take [s]; None takes all.
        evaluation: Search of the resonance, and length of the moving average.

    Raises:
        ValueError: The bag cannot be read or has no position and force in the window, or a step did not converge.
    """
    law = SpoolEvaluation() if evaluation is None else evaluation
    time, position, force = recorded_motion(bag, window)
    position = position - 0.5 * (position.max() + position.min()) + case.motion.centre
    result = _run_through(case, bag, time, position)
    measured = force - _offset(position, force)
    resonance = resonance_frequency(time, measured, law) if _is_even(time) else None
    chain = MeasuringChain() if resonance is None else MeasuringChain(natural_frequency=resonance)

    def filtered(force: FloatArray) -> FloatArray:
        quiet = force if resonance is None else without_resonance(time, force, resonance, law)
        return moving_average(quiet, law.moving_average)

    return Comparison(
        bag=bag.name,
        chain=chain,
        result=result,
        time=time,
        position=position,
        measured=measured,
        filtered=filtered(measured),
        computed=filtered(np.interp(time, result.time, result.friction)),
        averaged_samples=law.moving_average,
        resonance=resonance,
        shown=transducer_force(chain, result.time, result.friction),
    )


class RecordedMotion(NamedTuple):
    """Position and force of a bag, without samples that lack one of them."""

    time: FloatArray  # [s] from the first sample
    position: FloatArray  # [m]
    force: FloatArray  # [N]


def recorded_motion(bag: Path, window: tuple[float, float] | None = None) -> RecordedMotion:
    """Position and force sum of a bag; without position, the velocity is integrated.

    Args:
        bag: Bag with estimates.
        window: Begin and end of the part to take [s]; None takes all.

    Raises:
        ValueError: The bag cannot be read, or has too few samples with both in the window.
    """
    recorded = read_run(bag)
    begin, end = window or (0.0, float('inf'))
    position = recorded.position
    if not np.isfinite(position).any():
        increments = 0.5 * (recorded.velocity[1:] + recorded.velocity[:-1]) * np.diff(recorded.time)
        position = np.concatenate(([0.0], np.cumsum(increments)))
    good = (recorded.time >= begin) & (recorded.time <= end) & np.isfinite(position) & np.isfinite(recorded.force_sum)
    if good.sum() < _FEWEST_SAMPLES:
        raise ValueError(
            f'{bag}: {good.sum()} samples with position and force in {begin} to {end} s: choose another window'
        )
    time = recorded.time[good]
    return RecordedMotion(time - time[0], position[good], recorded.force_sum[good])


def _run_through(case: StudyCase, bag: Path, time: FloatArray, position: FloatArray) -> TransientResult:
    try:
        motion = MeasuredMotion(time.tolist(), position.tolist())
    except ValueError as error:
        raise ValueError(f'{bag}: {error}: choose another window') from None
    distance = max(float(np.ptp(position)), case.motion.distance)
    moved = replace(case, motion=replace(case.motion, distance=distance, cycles=1))
    return run_with_progress(moved, motion)


def _offset(position: FloatArray, force: FloatArray) -> float:
    """Offset of the transducer [N]: half the sum of the mean forces of both directions; 0 with one direction only."""
    change = np.gradient(position)
    means = [float(force[side].mean()) for side in (change > 0.0, change < 0.0) if side.any()]
    return 0.5 * sum(means) if len(means) == 2 else 0.0


def _is_even(time: FloatArray) -> bool:
    """Whether the samples are spaced evenly enough in time for a filter."""
    steps = np.diff(time)
    typical = float(np.median(steps))
    return bool(steps.min() > 0.5 * typical and steps.max() < 1.5 * typical)
