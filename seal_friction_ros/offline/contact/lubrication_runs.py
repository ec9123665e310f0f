"""Lubricated-contact cases from files: run them, in parallel, restartable, and put what comes out into files.

Nothing here draws chance: the same case gives the same numbers, however many processes share the work.
"""

import hashlib
import json
import multiprocessing
from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass, replace
from functools import cache, partial
from importlib.metadata import version
from pathlib import Path
from statistics import fmean
from typing import Any, NamedTuple

import numpy as np

from seal_friction_ros import core
from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.friction.laws.friction_map import FrictionMap
from seal_friction_ros.core.identification.spool_evaluation import (
    SpoolEvaluation,
    moving_average,
    resonance_frequency,
    without_resonance,
)
from seal_friction_ros.core.lubrication.case import Case, Spool, parse_case
from seal_friction_ros.core.lubrication.findings import Findings, discretisation_errors, findings
from seal_friction_ros.core.lubrication.friction_map import (
    Memory,
    SteadyFriction,
    friction_map,
    map_pressures,
    memory_length,
    steady_friction,
)
from seal_friction_ros.core.lubrication.kinematics import MeasuredMotion
from seal_friction_ros.core.lubrication.measuring_chain import MeasuringChain, transducer_force
from seal_friction_ros.core.lubrication.spool import MemberMotion, SpoolResult, superposed
from seal_friction_ros.core.lubrication.study import StudyTable, study_table
from seal_friction_ros.core.lubrication.transient import RunResult, run, with_solid_shear_stress
from seal_friction_ros.files import config_path, read_yaml
from seal_friction_ros.offline.bags.recorded_run import read_run
from seal_friction_ros.offline.work.atomic_file import write_whole
from seal_friction_ros.offline.work.progress import progress
from seal_friction_ros.offline.work.seal_writer import rounded

_PROFILES = ('gap', 'film_pressure', 'contact_pressure', 'saturation')
_CURVES = tuple(name for name in RunResult._fields if name not in (*_PROFILES, 'case'))
_SHORTEST_RECORD = 10  # samples


def load_case(name: str) -> Case | Spool:
    """Case or spool from a path, or the name of one in config/ehl.

    Raises:
        ValueError: The file cannot be read or makes no sense; one line that names it.
    """
    path = config_path('ehl', name)
    document = read_yaml(path)
    try:
        return parse_case(document)
    except ValueError as error:
        raise ValueError(f'{path}: {error}') from None


def single_case(name: str, what: str) -> Case:
    """Case from a path or name; a spool has no ``what``.

    Raises:
        ValueError: As `load_case`, or it is a spool.
    """
    case = load_case(name)
    if isinstance(case, Spool):
        raise ValueError(f'{name}: a spool has no {what}: take the case of one of its seals')
    return case


_UNITS = {
    **dict.fromkeys(('assisted_length', 'elastic_length', 'second_lobe'), 'm'),
    **dict.fromkeys(
        (
            'friction',
            'solid_slow',
            'solid_fast',
            'fluid_slow',
            'fluid_fast',
            'edge_assist',
            'friction_on_leaving',
            'after_edge',
        ),
        'N',
    ),
}


def _with_units(found: dict[str, Any]) -> dict[str, Any]:
    """Findings with their unit at the end of the name."""
    return {f'{name}_{_UNITS[name]}' if name in _UNITS else name: value for name, value in found.items()}


# -- one run ----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class CaseRun:
    """A run, what it shows, and how far step and grid blur that."""

    result: RunResult
    found: Findings
    step_errors: dict[str, float]
    grid_errors: dict[str, float]

    def figures(self) -> dict[str, Any]:
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


def run_case(case: Case) -> CaseRun:
    """Run a case, and twice more, coarser, for the errors.

    Raises:
        NotConvergedError: A step failed however small.
    """
    motion = case.motion
    steps = round(motion.duration / case.numerics.time_step)
    with progress(f'{case.name}: 3 runs', steps + steps // 2 + steps) as advance:
        result = run(case, on_step=advance)
        found = findings(result)
        by_step, by_grid = discretisation_errors(case, found, partial(run, on_step=advance))
    return CaseRun(result, found, by_step, by_grid)


def run_spool(spool: Spool, case_file: str, jobs: int) -> SpoolResult:
    """Run every seal of a spool, alike ones once, and add them up.

    Args:
        spool: The spool.
        case_file: Where it is from: its cases are looked for beside it, then in config/ehl.
        jobs: Processes to share the work.

    Raises:
        ValueError: A case cannot be read; or a step failed however small.
    """
    beside = config_path('ehl', case_file).parent
    distinct = list(dict.fromkeys(spool.members))
    work: list[tuple[str, Callable[[], RunResult]]] = []
    for member in distinct:
        local = beside / f'{member.case}.yaml'
        case = single_case(str(local) if local.is_file() else member.case, 'spool in it')
        moved = replace(case, motion=replace(spool.motion, centre=member.shift))
        work.append((f'{member}', partial(_run_member, moved, MemberMotion(spool.motion, member))))
    done = _in_parallel(spool.name, work, jobs)
    by_member = {member: done[str(member)] for member in distinct}
    return superposed(spool.members, [by_member[member] for member in spool.members])


def _run_member(case: Case, motion: MemberMotion) -> RunResult:
    return run(case, motion)


# -- the study of tau_c -----------------------------------------------------------------------------------------------


class StudyRuns(NamedTuple):
    """The study with its runs (without profiles)."""

    table: StudyTable
    runs: list[RunResult]


def run_study(case: Case, jobs: int, work: Path | None = None) -> StudyRuns:
    """Run a case with each solid shear stress of its study.

    Args:
        case: The case.
        jobs: Processes to share the work.
        work: Folder that keeps finished runs, so that a study that was interrupted goes on; None keeps none.

    Raises:
        ValueError: A run did not converge, or the folder cannot be used.
    """
    cases = [with_solid_shear_stress(case, stress) for stress in case.study.solid_shear_stresses]
    store = _Store(work)
    runs = {c: _restored(c, kept) for c in cases if (kept := store.get(_key('study', c), _CURVES)) is not None}
    missing: list[tuple[str, Callable[[], Any]]] = [
        (str(i), partial(_curves, c)) for i, c in enumerate(cases) if c not in runs
    ]

    def keep(name: str, result: RunResult) -> None:
        runs[cases[int(name)]] = result
        store.put(_key('study', cases[int(name)]), _as_lists(result))

    _in_parallel(f'{case.name}: tau_c', missing, jobs, keep)
    ordered = [runs[c] for c in cases]
    return StudyRuns(study_table(ordered), ordered)


def _curves(case: Case) -> RunResult:
    fields = run(case)._asdict()
    return RunResult(**{**fields, **{name: np.empty((0, 0)) for name in _PROFILES}})


def _as_lists(result: RunResult) -> dict[str, Any]:
    fields = result._asdict()
    return {k: fields[k].tolist() if isinstance(fields[k], np.ndarray) else fields[k] for k in _CURVES}


def _restored(case: Case, kept: dict[str, Any]) -> RunResult:
    fields: dict[str, Any] = {k: np.array(v) if isinstance(v, list) else v for k, v in kept.items()}
    return RunResult(**{**fields, **{name: np.empty((0, 0)) for name in _PROFILES}, 'case': case})


# -- the friction map -------------------------------------------------------------------------------------------------


class MapRuns(NamedTuple):
    """The friction map of a case, with the rows it was made from."""

    case: Case
    law: FrictionMap
    rows: list[SteadyFriction]
    retried_steps: int
    """steps that failed and were taken again in halves"""


def run_map(case: Case, jobs: int, work: Path | None = None) -> MapRuns:
    """Compute the friction map of a case; arguments and errors as `run_study`."""
    pressures = map_pressures(case.map).tolist()
    store = _Store(work)
    rows: dict[str, SteadyFriction] = {}
    memory: list[Memory] = []
    jobs_left: list[tuple[str, Callable[[], Any]]] = []
    for pressure in pressures:
        kept = store.get(_key(f'map {pressure!r}', case), SteadyFriction._fields)
        if kept is None:
            jobs_left.append((repr(pressure), partial(steady_friction, case, pressure)))
        else:
            arrays: dict[str, Any] = {k: np.array(v) if isinstance(v, list) else v for k, v in kept.items()}
            rows[repr(pressure)] = SteadyFriction(**arrays)
    kept_memory = store.get(_key('memory', case), Memory._fields)
    if kept_memory is None:
        jobs_left.append(('memory', partial(memory_length, case)))
    else:
        memory.append(Memory(**kept_memory))

    def keep(name: str, result: Any) -> None:
        """Take a finished part, and put it into the store."""
        if name == 'memory':
            memory.append(result)
            store.put(_key('memory', case), result._asdict())
            return
        rows[name] = result
        lists = {k: v.tolist() if isinstance(v, np.ndarray) else v for k, v in result._asdict().items()}
        store.put(_key(f'map {name}', case), lists)

    _in_parallel(f'{case.name}: map', jobs_left, jobs, keep)
    ordered = [rows[repr(pressure)] for pressure in pressures]
    retried = memory[0].retried_steps + sum(row.retried_steps for row in ordered)
    return MapRuns(case, friction_map(case, ordered, memory[0].length), ordered, retried)


def seal_document(computed: MapRuns, name: str) -> dict[str, Any]:
    """Seal file called ``name`` of a friction map.

    The uncertainty is ours: one tenth of the friction, as nothing here was measured. Breakaway is the friction at the
    lowest speed of the map, as a share of that at its reference speed: the mean over the pressures.
    """
    law, case = computed.law, computed.case
    creeping = fmean(law.sliding_friction(p, law.speeds[0]) / law.coulomb_friction(p) for p in law.pressures)
    pressures = [rounded(value, 7) for value in law.pressures]
    return {
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
        'uncertainty': {'relative_std': 0.1},
        'identified_pressure': [pressures[0], pressures[-1]],
    }


# -- simulation against measurement -----------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Comparison:
    """A measured motion, the friction measured on it, and the friction computed for it."""

    bag: str
    chain: MeasuringChain
    result: RunResult
    time: FloatArray
    """of the measurement [s]"""
    position: FloatArray
    """measured [m]"""
    measured: FloatArray
    """force sum less the offset of the transducer [N]"""
    filtered: FloatArray
    """the same, resonance notched out, moving average [N]"""
    computed: FloatArray
    """friction of ``result`` at the times of the measurement, treated alike [N]"""
    averaged_samples: int
    resonance: float | None
    """[Hz] of the measuring chain, recognised in the force; None if none stands out"""
    shown: FloatArray
    """what the measuring chain would show of the computed friction [N], at the times of ``result``"""

    def figures(self) -> dict[str, Any]:
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


def compare_with_bag(
    case: Case, bag: Path, window: tuple[float, float] | None, evaluation: SpoolEvaluation | None = None
) -> Comparison:
    """Run a case through the position that a bag recorded and set its force against the computed friction.

    A resonance of the measuring chain is recognised in the force and taken out of it, and the rest averaged; the
    computed friction goes the same way, so that the figures compare like with like. It is also shown as a chain of
    that frequency would show it; without a resonance, or if the samples are uneven in time, that of the paper.

    Args:
        case: The case; its own motion is not used. The middle of the measured way is put at its centre.
        bag: The bag, with estimates; needs a force sum, and a position or else the velocity is summed up.
        window: Begin and end of the part to take [s]; None takes all.
        evaluation: How a resonance is recognised, and the samples of the moving average.

    Raises:
        ValueError: The bag cannot be read, or has no position and force in the window; or a step failed however small.
    """
    law = SpoolEvaluation() if evaluation is None else evaluation
    recorded = read_run(bag)
    begin, end = window or (0.0, float('inf'))
    good = (recorded.time >= begin) & (recorded.time <= end)
    course = recorded.position
    if not np.isfinite(course).any():
        steps_of_way = 0.5 * (recorded.velocity[1:] + recorded.velocity[:-1]) * np.diff(recorded.time)
        course = np.concatenate(([0.0], np.cumsum(steps_of_way)))
    good &= np.isfinite(course) & np.isfinite(recorded.force_sum)
    if good.sum() < _SHORTEST_RECORD:
        raise ValueError(
            f'{bag}: {good.sum()} samples with position and force in {begin} to {end} s: take another window'
        )
    time, position, force = recorded.time[good], course[good], recorded.force_sum[good]
    time = time - time[0]
    position = position - 0.5 * (position.max() + position.min()) + case.motion.centre
    try:
        motion = MeasuredMotion(time.tolist(), position.tolist())
    except ValueError as error:
        raise ValueError(f'{bag}: {error}: take another window') from None
    steps = round(motion.duration / case.numerics.time_step)
    moved = replace(
        case, motion=replace(case.motion, distance=max(float(np.ptp(position)), case.motion.distance), cycles=1)
    )
    with progress(f'{case.name} on {bag.name}', steps) as advance:
        result = run(moved, motion, advance)
    measured = force - _offset(position, force)
    resonance = resonance_frequency(time, measured, law) if _even(time) else None
    chain = MeasuringChain() if resonance is None else MeasuringChain(natural_frequency=resonance)

    def treated(force: FloatArray) -> FloatArray:
        quiet = force if resonance is None else without_resonance(time, force, resonance, law)
        return moving_average(quiet, law.moving_average)

    computed = treated(np.interp(time, result.time, result.friction))
    shown = transducer_force(chain, result.time, result.friction)
    return Comparison(
        bag=bag.name,
        chain=chain,
        result=result,
        time=time,
        position=position,
        measured=measured,
        filtered=treated(measured),
        computed=computed,
        averaged_samples=law.moving_average,
        resonance=resonance,
        shown=shown,
    )


def _offset(position: FloatArray, force: FloatArray) -> float:
    """Offset of the transducer [N]: the middle between the mean forces of both directions; 0 if there is one only."""
    way = np.gradient(position)
    means = [float(force[side].mean()) for side in (way > 0.0, way < 0.0) if side.any()]
    return 0.5 * sum(means) if len(means) == 2 else 0.0


def _even(time: FloatArray) -> bool:
    """Whether the samples are even enough in time for a filter."""
    steps = np.diff(time)
    typical = float(np.median(steps))
    return bool(steps.min() > 0.5 * typical and steps.max() < 1.5 * typical)


# -- work in parallel, kept on disk -----------------------------------------------------------------------------------


def _in_parallel(
    label: str,
    work: list[tuple[str, Callable[[], Any]]],
    jobs: int,
    keep: Callable[[str, Any], None] | None = None,
) -> dict[str, Any]:
    """Results of ``work`` by name; each is handed to ``keep`` as soon as it is there."""
    results: dict[str, Any] = {}
    with progress(label, len(work)) as advance:
        for name, result in _results(work, min(jobs, len(work))):
            results[name] = result
            if keep:
                keep(name, result)
            advance(1)
    return results


def _results(work: list[tuple[str, Callable[[], Any]]], jobs: int) -> Iterable[tuple[str, Any]]:
    if jobs <= 1:
        yield from ((name, function()) for name, function in work)
        return
    # Fresh processes that compile for themselves: a fork could inherit a lock that the thread of the progress holds.
    context = multiprocessing.get_context('spawn')
    with ProcessPoolExecutor(jobs, mp_context=context) as pool:
        names = {pool.submit(function): name for name, function in work}
        try:
            for future in as_completed(names):
                yield names[future], future.result()
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise


class _Store:
    """Finished results as JSON files in a folder, by key; each file is there whole or not at all."""

    def __init__(self, folder: Path | None) -> None:
        self._folder = folder
        if folder is not None:
            try:
                folder.mkdir(parents=True, exist_ok=True)
            except OSError as error:
                raise ValueError(f'{folder}: {error.strerror}') from None

    def get(self, key: str, fields: Iterable[str]) -> dict[str, Any] | None:
        """Result of a key; None if there is none, or none that can be read and has these fields."""
        if self._folder is None:
            return None
        try:
            kept = json.loads((self._folder / f'{key}.json').read_text(encoding='utf-8'))
        except (OSError, ValueError):
            return None
        return kept if isinstance(kept, dict) and kept.keys() == set(fields) else None

    def put(self, key: str, result: dict[str, Any]) -> None:
        """Keep a result."""
        if self._folder is None:
            return
        write_whole(self._folder / f'{key}.json', json.dumps(result).encode())


def _key(what: str, case: Case) -> str:
    """Name of a result: it changes with the case and with the code that computes it."""
    return hashlib.sha256(f'{what} {json.dumps(asdict(case), sort_keys=True)} {_code()}'.encode()).hexdigest()[:32]


@cache
def _code() -> str:
    """Digest of the whole core, and of the versions of what it computes with."""
    digest = hashlib.sha256(' '.join(map(version, ('numpy', 'scipy', 'numba'))).encode())
    for source in sorted(Path(str(core.__file__)).parent.rglob('*.py')):
        digest.update(source.read_bytes())
    return digest.hexdigest()
