"""Lubricated-contact cases from files: runs, studies and friction maps, in parallel and resumable.

The same case gives the same numbers, however many processes compute it.
"""

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from statistics import fmean
from typing import Any, NamedTuple

import numpy as np

from seal_friction_ros.core.foundation.errors import NotConvergedError
from seal_friction_ros.core.friction.laws.friction_map import FrictionMap
from seal_friction_ros.core.friction.presliding import presliding_of_map
from seal_friction_ros.core.lubrication.findings import Findings, check_time_step, discretisation_errors, findings
from seal_friction_ros.core.lubrication.friction_map import (
    MemoryLength,
    SteadyFriction,
    friction_map,
    map_pressures,
    memory_length,
    steady_friction,
)
from seal_friction_ros.core.lubrication.kinematics import SpoolMotion
from seal_friction_ros.core.lubrication.lubrication_case import (
    LubricationCase,
    Spool,
    SpoolSeal,
    parse_lubrication_case,
    varied_case,
)
from seal_friction_ros.core.lubrication.spool import SpoolResult, SpoolSealMotion, stroke_friction, superposed
from seal_friction_ros.core.lubrication.study import StudyTable, study_table
from seal_friction_ros.core.lubrication.transient import (
    TransientResult,
    initial_state,
    lubrication_model,
    run_transient,
    transient_step,
    with_solid_shear_stress,
)
from seal_friction_ros.core.oring_contact.oring_case_file import OringCaseFile, parse_oring_case
from seal_friction_ros.files import config_path, read_yaml
from seal_friction_ros.offline.contact.uncertainty import Uncertainty
from seal_friction_ros.offline.work.executor import Workers, run_all
from seal_friction_ros.offline.work.finished_parts import Part, part_key, run_parts
from seal_friction_ros.offline.work.progress import progress
from seal_friction_ros.offline.work.seal_writer import rounded

_FEWEST_CELLS = 32  # that a case may have
_PROFILES = ('gap', 'film_pressure', 'contact_pressure', 'saturation')
_CURVES = tuple(name for name in TransientResult._fields if name not in (*_PROFILES, 'case'))


def load_case(name: str) -> LubricationCase | Spool:
    """Case or spool from a path, or the name of one in config/ehl.

    Raises:
        ValueError: The file cannot be read or a value is invalid; one line that names the file.
    """
    path = config_path('ehl', name)
    document = read_yaml(path)
    try:
        return parse_lubrication_case(document, lambda oring: load_oring(oring, path.parent))
    except ValueError as error:
        raise ValueError(f'{path}: {error}') from None


def load_oring(name: str, beside: Path) -> OringCaseFile:
    """O-ring case file in the folder ``beside``, from a path, or of a name in config/oring.

    Raises:
        ValueError: The file cannot be read or a value is invalid; one line that names the file.
    """
    local = beside / f'{name}.yaml'
    path = local if local.is_file() else config_path('oring', name)
    try:
        return parse_oring_case(read_yaml(path))
    except ValueError as error:
        text = str(error)
        raise ValueError(text if text.startswith(str(path)) else f'{path}: {text}') from None


def single_case(name: str, purpose: str) -> LubricationCase:
    """Case from a path or name; not a spool, which has no ``purpose`` (for the error message).

    Raises:
        ValueError: As `load_case`, or it is a spool.
    """
    case = load_case(name)
    if isinstance(case, Spool):
        raise ValueError(f'{name}: a spool has no {purpose}: take the case of one of its seals')
    return case


def compile_for(case: LubricationCase) -> None:
    """Compile the code of a run in this process, so that worker processes inherit it."""
    case = replace(case, oring=None)
    model = lubrication_model(case)
    time = case.numerics.time_step
    with suppress(NotConvergedError):
        transient_step(model, initial_state(model, case.motion.position(0.0)), time, case.motion.position(time))


def compile_for_map(case: LubricationCase) -> None:
    """Compile the code of a friction map in this process, so that worker processes inherit it."""
    numerics, grid = replace(case.numerics, cells=_FEWEST_CELLS), replace(case.map, velocities=2)
    with suppress(NotConvergedError):
        steady_friction(replace(case, oring=None, numerics=numerics, map=grid), 0.0)


def run_with_progress(case: LubricationCase, motion: SpoolMotion) -> TransientResult:
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


def run_case(case: LubricationCase) -> CaseRun:
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


def cases_of_spool(spool: Spool, case_file: str) -> dict[SpoolSeal, LubricationCase]:
    """Case of every distinct seal of a spool, from beside ``case_file``, the path or name of its file, else config/ehl.

    Raises:
        ValueError: A case cannot be read.
    """
    beside, cases = config_path('ehl', case_file).parent, {}
    for member in spool.members:
        local = beside / f'{member.case}.yaml'
        cases[member] = single_case(str(local) if local.is_file() else member.case, 'spool in it')
    return cases


def run_spool(spool: Spool, cases: Mapping[SpoolSeal, LubricationCase], workers: Workers) -> SpoolRun:
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


def run_study(case: LubricationCase, workers: Workers, work: Path | None = None) -> StudyRuns:
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


def _curves(case: LubricationCase) -> Mapping[str, Any]:
    result = run_with_progress(case, case.motion)
    return {name: getattr(result, name) for name in _CURVES}


# -- friction map -----------------------------------------------------------------------------------------------------


class MapRuns(NamedTuple):
    """The friction map of a case, and its rows."""

    case: LubricationCase
    law: FrictionMap
    rows: list[SteadyFriction]
    retried_steps: int  # steps that did not converge and were repeated in halves
    uncertainty: Uncertainty | None = None  # None: no samples

    def numbers(self) -> dict[str, Any]:
        """Numbers for JSON."""
        return {
            'case': self.case.name,
            'speed_m_s': self.law.speeds,
            'pressure_Pa': self.law.pressures,
            'friction_N': [row.friction.tolist() for row in self.rows],
            'solid_share': [(row.solid / row.friction).tolist() for row in self.rows],
            'memory_length_m': self.law.memory_length,
            'presliding_length_m': self.law.presliding_length,
            'retried_steps': self.retried_steps,
            **({} if self.uncertainty is None else {'uncertainty': self.uncertainty.numbers()}),
        }

    def summary(self) -> str:
        """One line for a person, more with samples."""
        low, high = min(self.law.frictions), max(self.law.frictions)
        size = f'{len(self.law.speeds)} speeds x {len(self.law.pressures)} pressures'
        sampled = '' if self.uncertainty is None else f'\n{self.uncertainty.summary()}'
        return f'{self.case.name}: {size}, {low:.3g} to {high:.3g} N{sampled}'


def run_map(case: LubricationCase, workers: Workers, work: Path | None = None) -> MapRuns:
    """Compute the friction map of a case; arguments and errors as `run_study`."""
    known = varied_case(case, {})
    memory_part = Part(part_key('memory', asdict(known)), MemoryLength._fields, partial(memory_length, known))
    parts = [*row_parts(known), memory_part]
    *found, kept_memory = run_parts(f'{case.name}: map', parts, workers, work, partial(compile_for_map, known))
    rows, memory = [SteadyFriction(**row) for row in found], MemoryLength(**kept_memory)
    retried = memory.retried_steps + sum(row.retried_steps for row in rows)
    return MapRuns(case, friction_map(case, rows, memory.length), rows, retried)


def row_parts(case: LubricationCase) -> list[Part]:
    """Part for each pressure of the grid of a case; its result is the `SteadyFriction`."""
    settings, fields = asdict(case), SteadyFriction._fields
    pressures = map_pressures(case.map).tolist()
    return [Part(part_key(f'map {p!r}', settings), fields, partial(steady_friction, case, p)) for p in pressures]


def seal_document(computed: MapRuns, name: str) -> dict[str, Any]:
    """Seal file called ``name`` of a friction map.

    The uncertainty is that of the samples. Without samples it is our choice, since nothing is measured here: one tenth
    of the friction; of an O-ring from its drawing 0.7, the error that was found against readings (docs/ehl.md). The
    breakaway friction is the friction at the
    lowest speed of the map over that at its reference speed, mean over the pressures.
    """
    law, case = computed.law, computed.case
    if computed.uncertainty is None:
        relative_std = 0.7 if case.oring else 0.1
    else:
        relative_std = rounded(computed.uncertainty.relative_std, 3)
    creeping = fmean(law.sliding_friction(p, law.speeds[0]) / law.coulomb_friction(p) for p in law.pressures)
    pressures = [rounded(value, 7) for value in law.pressures]
    elastic = presliding_of_map(law)
    document: dict[str, Any] = {
        'name': name,
        'source': f'computed by seal_friction ehl map from the case {case.name}; '
        'steady sliding, mean of both directions',
        'coulomb_law': 'friction_map',
        'friction_map': {
            'speeds': [rounded(value, 13) for value in law.speeds],  # their ratios have to be equal
            'pressures': pressures,
            'frictions': [rounded(value, 7) for value in law.frictions],
            'reference_speed': rounded(law.reference_speed, 7),
            'memory_length': rounded(law.memory_length, 7),
            'presliding_length': rounded(law.presliding_length, 7),
        },
        'stiction_ratio': rounded(max(0.0, creeping - 1.0), 3),
        'uncertainty': {'relative_std': relative_std},
        'identified_pressure': [pressures[0], pressures[-1]],
    }
    if elastic is not None:
        numbers = asdict(elastic)
        document['presliding'] = {key: n if key == 'elements' else rounded(n, 7) for key, n in numbers.items()}
    return document
