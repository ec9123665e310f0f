"""Lubricated-contact studies from files: runs, spools and studies of tau_c, in parallel and resumable.

The same case gives the same numbers, however many processes compute it.
"""

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from seal_friction_ros.core.foundation.errors import NotConvergedError
from seal_friction_ros.files import config_path
from seal_friction_ros.offline.contact.lubrication_runs import read_case
from seal_friction_ros.offline.work.executor import Workers, run_all
from seal_friction_ros.offline.work.finished_parts import Part, part_key, run_parts
from seal_friction_ros.offline.work.progress import progress
from seal_friction_studies.core.findings import Findings, check_time_step, discretisation_errors, findings
from seal_friction_studies.core.kinematics import SpoolMotion
from seal_friction_studies.core.spool import SpoolResult, SpoolSealMotion, stroke_friction, superposed
from seal_friction_studies.core.study import StudyTable, study_table
from seal_friction_studies.core.study_case import Spool, SpoolSeal, StudyCase, parse_study_case
from seal_friction_studies.core.transient import (
    TransientResult,
    initial_state,
    run_transient,
    transient_model,
    transient_step,
    with_solid_shear_stress,
)

_PROFILES = ('gap', 'film_pressure', 'contact_pressure', 'saturation')
_CURVES = tuple(name for name in TransientResult._fields if name not in (*_PROFILES, 'case'))


def load_case(name: str) -> StudyCase | Spool:
    """Case or spool from a path, or the name of one in config/ehl; errors as `read_case`."""
    return read_case(name, parse_study_case)


def single_case(name: str, purpose: str) -> StudyCase:
    """Case from a path or name; not a spool, which has no ``purpose`` (for the error message).

    Raises:
        ValueError: As `load_case`, or it is a spool.
    """
    case = load_case(name)
    if isinstance(case, Spool):
        raise ValueError(f'{name}: a spool has no {purpose}: take the case of one of its seals')
    return case


def compile_for(case: StudyCase) -> None:
    """Compile the code of a run in this process, so that worker processes inherit it."""
    case = replace(case, oring=None)
    model = transient_model(case)
    time = case.numerics.time_step
    with suppress(NotConvergedError):
        transient_step(model, initial_state(model, case.motion.position(0.0)), time, case.motion.position(time))


def run_with_progress(case: StudyCase, motion: SpoolMotion) -> TransientResult:
    """Run a case through a motion, with a progress bar; errors as `run`."""
    with progress(case.name, round(motion.duration / case.numerics.time_step)) as on_step:
        return run_transient(case, motion, on_step)


# -- one run ----------------------------------------------------------------------------------------------------------

_LENGTHS = {'assisted_length', 'elastic_length', 'second_lobe'}
_FORCES = {
    'friction', 'solid_slow', 'solid_fast', 'fluid_slow', 'fluid_fast', 'edge_assist', 'friction_on_leaving',
    'after_edge',
}  # fmt: skip
_UNITS = dict.fromkeys(_LENGTHS, 'm') | dict.fromkeys(_FORCES, 'N')


def _with_units(found: dict[str, Any]) -> dict[str, Any]:
    """Findings with their unit at the end of the name."""
    return {f'{name}_{_UNITS[name]}' if name in _UNITS else name: value for name, value in found.items()}


@dataclass(frozen=True, eq=False)
class CaseRun:
    """A run, its findings, and their discretisation errors."""

    result: TransientResult
    found: Findings
    step_errors: dict[str, float]
    grid_errors: dict[str, float]

    def numbers(self) -> dict[str, Any]:
        """Numbers for JSON."""
        return {
            'case': self.result.case.name,
            **_with_units(self.found._asdict()),
            'step_errors': _with_units(self.step_errors),
            'grid_errors': _with_units(self.grid_errors),
            'steps': len(self.result.time),
            'retried_steps': self.result.retried_steps,
            'newton_iterations': self.result.newton_iterations,
            'mass_defect': self.result.mass_defect,
        }

    def summary(self) -> str:
        """One line for a person."""
        return (
            f'{self.result.case.name}: friction {self.found.friction:.3g} N, solid share '
            f'{100.0 * self.found.solid_share:.1f} %; {len(self.result.time)} steps, '
            f'{self.result.retried_steps} retried'
        )


def run_case(case: StudyCase) -> CaseRun:
    """Run a case once, and four times more with longer steps and coarser grids for the discretisation errors.

    Raises:
        NotConvergedError: A step did not converge at the smallest step size.
        ValueError: The time step is too long for an error of the findings.
    """
    check_time_step(case)
    motion = case.motion
    steps = round(motion.duration / case.numerics.time_step)
    with progress(f'{case.name}: 5 runs', steps + steps // 2 + steps // 4 + 2 * steps) as on_step:
        result = run_transient(case, on_step=on_step)
        found = findings(result)
        by_step, by_grid = discretisation_errors(case, found, partial(run_transient, on_step=on_step))
    return CaseRun(result, found, by_step, by_grid)


# -- a spool ----------------------------------------------------------------------------------------------------------


class SpoolRun(NamedTuple):
    """A spool and the sum of its seals."""

    spool: Spool
    result: SpoolResult

    @property
    def labels(self) -> list[str]:
        """Label of each seal."""
        return [f'{member.case}{", mirrored" if member.mirrored else ""}' for member in self.spool.members]

    def numbers(self) -> dict[str, Any]:
        """Numbers for JSON: of both directions, the peak over the level of the stroke beside both."""
        largest = float(np.abs(self.result.friction[self.result.last_cycle]).max())
        numbers = {'spool': self.spool.name, 'seals': self.labels, 'largest_friction_N': largest}
        for name, direction in (('positive', 1.0), ('negative', -1.0)):
            stroke = stroke_friction(self.result, direction)
            numbers[f'{name}_peak_N'] = stroke.peak
            numbers[f'{name}_level_N'] = stroke.level
            numbers[f'{name}_peak_over_level'] = stroke.peak / stroke.level
            numbers[f'{name}_peak_position_m'] = stroke.peak_position
        return numbers

    def summary(self) -> str:
        """One line for a person."""
        numbers = self.numbers()
        return (
            f'{self.spool.name}: {len(self.labels)} seals, largest friction {numbers["largest_friction_N"]:.3g} N, '
            f'{numbers["positive_peak_over_level"]:.3g} and {numbers["negative_peak_over_level"]:.3g} times that '
            'around it in the positive and the negative direction'
        )


def cases_of_spool(spool: Spool, case_file: str) -> dict[SpoolSeal, StudyCase]:
    """Case of every distinct seal of a spool, from beside ``case_file``, the path or name of its file, else config/ehl.

    Raises:
        ValueError: A case cannot be read.
    """
    beside, cases = config_path('ehl', case_file).parent, {}
    for member in spool.members:
        local = beside / f'{member.case}.yaml'
        cases[member] = single_case(str(local) if local.is_file() else member.case, 'spool in it')
    return cases


def run_spool(spool: Spool, cases: Mapping[SpoolSeal, StudyCase], workers: Workers) -> SpoolRun:
    """Run every distinct seal of a spool once and add the forces of all seals, all in the shortest of their time steps.

    Args:
        spool: The spool.
        cases: From `cases_of_spool`.
        workers: Seals at a time, or a cluster.

    Raises:
        ValueError: A step did not converge.
    """
    shortest = min(case.numerics.time_step for case in cases.values())
    calls = []
    for member, case in cases.items():
        numerics, motion = replace(case.numerics, time_step=shortest), replace(spool.motion, centre=member.shift)
        moved = replace(case, motion=motion, numerics=numerics)
        calls.append(partial(run_with_progress, moved, SpoolSealMotion(spool.motion, member)))
    found = run_all(spool.name, calls, workers, prepare=partial(compile_for, calls[0].args[0]))
    results = dict(zip(cases, found, strict=True))
    return SpoolRun(spool, superposed(spool.members, [results[member] for member in spool.members]))


# -- study of the solid shear stress ----------------------------------------------------------------------------------


class StudyRuns(NamedTuple):
    """A study of the solid shear stress and its runs, without profiles along the seal."""

    table: StudyTable
    runs: list[TransientResult]

    def numbers(self) -> dict[str, Any]:
        """Numbers for JSON."""
        return {
            'case': self.runs[0].case.name,
            'solid_shear_stress_Pa': self.table.solid_shear_stress,
            'friction_N': self.table.friction,
            'solid_share': self.table.solid_share,
            'deviation': self.table.deviation,
            'curve_deviation': self.table.curve_deviation,
            'retried_steps': [run_transient.retried_steps for run_transient in self.runs],
        }

    def summary(self) -> str:
        """One line per stress for a person."""
        return '\n'.join(
            f'{stress / 1e6:5.2f} MPa: {friction:.4g} N, solid share {100.0 * share:.1f} %, '
            f'friction over stress {100.0 * deviation:+.1f} % off the mean'
            for stress, friction, share, deviation, _ in zip(*self.table, strict=True)
        )


def run_study(case: StudyCase, workers: Workers, work: Path | None = None) -> StudyRuns:
    """Run a case with each solid shear stress of its study.

    Args:
        case: The case.
        workers: Runs at a time, or a cluster.
        work: Folder that keeps finished runs, so that an interrupted study resumes; None keeps none.

    Raises:
        ValueError: A run did not converge, or the folder cannot be used.
    """
    cases = [with_solid_shear_stress(case, stress) for stress in case.study.solid_shear_stresses]
    parts = [Part(part_key('study', asdict(c)), _CURVES, partial(_curves, c)) for c in cases]
    found = run_parts(f'{case.name}: tau_c', parts, workers, work, partial(compile_for, case))
    no_profiles: dict[str, Any] = {name: np.empty((0, 0)) for name in _PROFILES}
    runs = [TransientResult(case=c, **no_profiles, **curves) for c, curves in zip(cases, found, strict=True)]
    return StudyRuns(study_table(runs), runs)


def _curves(case: StudyCase) -> Mapping[str, Any]:
    result = run_with_progress(case, case.motion)
    return {name: getattr(result, name) for name in _CURVES}
