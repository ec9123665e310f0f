"""Study of the solid shear stress: friction and its solid share over tau_c (paper, section 7.2)."""

from typing import NamedTuple

import numpy as np

from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_studies.core.findings import REFERENCE_HALF_WIDTH, findings
from seal_friction_studies.core.transient import TransientResult, last_cycle


class StudyTable(NamedTuple):
    """One entry per run, in order of tau_c."""

    solid_shear_stress: tuple[float, ...]  # [Pa]
    friction: tuple[float, ...]  # [N] mean magnitude within 0.5 mm of the middle
    solid_share: tuple[float, ...]  # solid over solid and fluid friction there
    deviation: tuple[float, ...]  # friction over tau_c, relative to the mean of all runs, less 1
    curve_deviation: tuple[float, ...]  # largest of the same, position by position within 0.5 mm of the middle


def study_table(runs: list[TransientResult]) -> StudyTable:
    """Table of runs that differ in tau_c alone.

    Raises:
        ValueError: There is no run.
    """
    if not runs:
        raise ValueError('study_table: there is no run')
    ordered = sorted(runs, key=lambda run: run.case.seal.solid_shear_stress)
    stresses = np.array([run.case.seal.solid_shear_stress for run in ordered])
    found = [findings(run) for run in ordered]
    quotient = np.array([f.friction for f in found]) / stresses
    curves = np.array([_middle(run) for run in ordered]) / stresses[:, None]
    curve_deviation = np.abs(curves / curves.mean(axis=0) - 1.0).max(axis=1)
    return StudyTable(
        tuple(stresses.tolist()),
        tuple(f.friction for f in found),
        tuple(f.solid_share for f in found),
        tuple((quotient / quotient.mean() - 1.0).tolist()),
        tuple(curve_deviation.tolist()),
    )


def _middle(run: TransientResult) -> FloatArray:
    """Friction of the steps within 0.5 mm of the middle in the last cycle [N]."""
    middle = np.abs(run.position - run.case.motion.centre) <= REFERENCE_HALF_WIDTH
    return np.asarray(run.friction[last_cycle(run) & middle])
