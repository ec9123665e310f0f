"""Calibration of the band of an identified law: share of readings inside against nominal share.

Every reading is predicted by a law and a band that were made without it, once from the same run (scatter of one
mounting) and once from other runs (scatter between mountings). A band is calibrated where both shares are equal
[Gneiting2007]_.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.special import ndtri

from seal_friction_ros.core.foundation.arrays import BoolArray, FloatArray, IntArray
from seal_friction_ros.core.identification import runs
from seal_friction_ros.core.identification.candidate_laws import (
    CandidateLaw,
    ParameterValues,
    Variation,
    candidate_laws,
)
from seal_friction_ros.core.identification.fitting import fit, offsets_of
from seal_friction_ros.core.identification.readings import FrictionReadings, contiguous_parts, has_pressures
from seal_friction_ros.core.identification.validation import deviations_in_std, deviations_of_left_out

NOMINAL = np.round(np.arange(0.10, 0.995, 0.01), 2)  # [-] nominal shares (our choice)
PARTS = 4  # contiguous parts of the readings of a run at one pressure, each predicted from the others (our choice)


class Calibration(NamedTuple):
    """Share of readings inside a band that was made without them, at each nominal share."""

    nominal: FloatArray  # [-] shape (shares,)
    within_runs: FloatArray  # [-] predicted from the same run, shape (shares,); NaN if no run can be divided
    between_runs: FloatArray  # [-] predicted from other runs, shape (shares,); NaN if no run was repeated
    groups: int  # left out within runs
    runs: int  # left out between runs


def calibration(
    law: CandidateLaw, readings: FrictionReadings, near: ParameterValues, run_to_run: float | None = None
) -> Calibration:
    """Calibration within and between runs of the law whose parameters are ``near``.

    ``run_to_run`` is the relative standard deviation between runs, if it was stated; otherwise the other runs and the
    prior of `runs.between_runs` give it.
    """
    each = runs_of(readings)
    inside = [within_run(law, run, near) for run in each]
    ratios = [one for one, _ in inside if len(one)]
    between = [
        between_runs(law, readings.taken(others), readings.taken(left_out), near, run_to_run)
        for others, left_out in repeated_runs(readings)
    ]
    return Calibration(
        NOMINAL,
        shares_inside(np.concatenate(ratios) if ratios else np.empty(0)),
        shares_inside(np.concatenate(between) if between else np.empty(0)),
        sum(groups for _, groups in inside),
        len(between),
    )


def shares_inside(ratios: FloatArray) -> FloatArray:
    r"""Share of the deviations inside the band at each nominal share of `NOMINAL` [-]; NaN without a deviation.

    .. math:: c(p) = \frac{1}{n} \sum_i \left[\,|d_i| / s_i \le \Phi^{-1}\!\left(\tfrac{1 + p}{2}\right)\right]

    The ``ratios`` are abs(d) / s [-], shape (n,).

    Source: [Gneiting2007]_; a central band of a normal distribution is our choice.
    """
    if not len(ratios):
        return np.full(len(NOMINAL), np.nan)
    quantiles = ndtri(0.5 * (1.0 + NOMINAL))
    return np.asarray(np.mean(ratios <= quantiles[:, np.newaxis], axis=1))


def run_numbers(readings: FrictionReadings) -> IntArray:
    """Number of the run of each reading, shape (n,): its test or file if those are left out, otherwise its source."""
    return readings.group if readings.left_out_by in ('test', 'file') else readings.source


def runs_of(readings: FrictionReadings) -> list[FrictionReadings]:
    """Readings of each run."""
    number = run_numbers(readings)
    return [readings.taken(number == run) for run in np.unique(number)]


def repeated_runs(readings: FrictionReadings) -> list[tuple[BoolArray, BoolArray]]:
    """Mask of the other runs and mask of the readings to predict, for each run that repeats a pressure of another.

    At a pressure that no other run has, a deviation is also that of the law. Swept logs count as repeated.
    """
    number, found = run_numbers(readings), []
    for run in np.unique(number):
        others = number != run
        repeated = ~others if readings.are_samples else ~others & np.isin(readings.level, readings.level[others])
        if others.any() and repeated.any():
            found.append((others, repeated))
    return found


def within_run(law: CandidateLaw, run: FrictionReadings, near: ParameterValues) -> tuple[FloatArray, int]:
    """Deviations in standard deviations [-] inside one run, shape (n,), and the number of groups left out.

    A run of swept samples is divided into its blocks, a run at several pressures into its pressures. A run at fewer
    pressures is divided into `PARTS` contiguous parts at each pressure, predicted by their constant friction: at one
    pressure the scatter of a run needs no law. The band has no part between runs.
    """
    if not run.are_samples and not has_pressures(run):
        (constant, *_) = candidate_laws(Variation(speeds=False))
        (name,) = (parameter.name for parameter in constant.parameters)
        found, groups = [np.empty(0)], 0
        for inside in run.levels.values():
            of_level = run.taken(inside)
            sides = contiguous_parts(PARTS, of_level.at.direction.astype(np.int64))
            level = replace(of_level, group=sides, left_out_by='block')
            if level.count < 2 * PARTS:
                continue
            typical = float(np.abs(level.force).mean()) / level.at.pressure.shape[1]
            found.append(deviations_of_left_out(constant, level, {name: typical}))
            groups += len(level.groups)
        return np.concatenate(found), groups
    divided = run if run.are_samples else replace(run, group=run.level, left_out_by='pressure')
    if len(divided.groups) < 2:
        return np.empty(0), 0
    return deviations_of_left_out(law, divided, near), len(divided.groups)


def between_runs(
    law: CandidateLaw,
    others: FrictionReadings,
    left_out: FrictionReadings,
    near: ParameterValues,
    run_to_run: float | None = None,
) -> FloatArray:
    """Deviations of one run in standard deviations [-], shape (n,): law and band are from the ``others``.

    If the others are several tests or files, leaving each of them out shows the scatter between runs. Otherwise
    `runs.between_runs` adds it, with its prior; ``run_to_run`` takes its place if it is stated.
    """
    if others.left_out_by in ('test', 'file'):
        if len(others.groups) < 2:
            others = replace(others, group=others.level, left_out_by='pressure')
        elif run_to_run is None:
            return deviations_in_std(law, others, left_out, near)
    in_addition = run_to_run
    if in_addition is None:
        friction = fit(law, others, near).friction(others.at)
        in_addition = runs.between_runs(others, friction, offsets_of(others, friction)).of_band
    return deviations_in_std(law, others, left_out, near, in_addition)
