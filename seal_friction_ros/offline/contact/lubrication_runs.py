"""Friction maps of lubricated-contact cases from files, in parallel and resumable.

The same case gives the same numbers, however many processes compute it.
"""

import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from statistics import fmean
from typing import Any, NamedTuple, TypeVar

import numpy as np

from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.foundation.errors import NotConvergedError, named_errors
from seal_friction_ros.core.foundation.parameters import within_bounds
from seal_friction_ros.core.foundation.units import BAR
from seal_friction_ros.core.friction.laws.friction_map import FrictionMap
from seal_friction_ros.core.friction.presliding import presliding_of_map
from seal_friction_ros.core.lubrication.friction_map import (
    PERCOLATION,
    THINNEST_OF_CLOSURES,
    MemoryLength,
    SteadyFriction,
    carries_film,
    directions,
    friction_map,
    live_map,
    memory_length,
    pressure_asymmetry,
    steady_friction,
    steady_table,
)
from seal_friction_ros.core.lubrication.lubrication_case import LubricationCase, parse_lubrication_case, varied_case
from seal_friction_ros.core.oring_contact.oring_case_file import OringCaseFile
from seal_friction_ros.core.oring_contact.ring_friction import DISCRETISATION
from seal_friction_ros.files import config_path, read_yaml
from seal_friction_ros.offline.contact.mesh_levels import COARSER, FINER, MOST_MESH_ERROR, change_of, other_lines
from seal_friction_ros.offline.contact.oring_runs import read_oring_case
from seal_friction_ros.offline.contact.section_files import with_files
from seal_friction_ros.offline.contact.uncertainty import Uncertainty
from seal_friction_ros.offline.work.executor import Workers
from seal_friction_ros.offline.work.finished_parts import Kept, Part, Values, part_key, try_parts
from seal_friction_ros.offline.work.outcome import Outcome
from seal_friction_ros.offline.work.seal_writer import rounded

Parsed = TypeVar('Parsed')
LEAST_ASYMMETRY = 0.01  # [-] that a seal file has: less is an error of the mesh (our choice)
STICTION_OF_A_RING = 0.13
"""[-] breakaway over sliding friction, less 1, of a map without speeds: mean of the thesis (our choice)"""


def load_case(name: str) -> LubricationCase:
    """Case from a path, or the name of one in config/ehl; errors as `read_case`."""
    return read_case(name, parse_lubrication_case)


def read_case(name: str, parse: Callable[[Any, Callable[[str], OringCaseFile]], Parsed]) -> Parsed:
    """What ``parse`` makes of a case file and of the loader of its O-ring.

    ValueError: the file cannot be read or a value is invalid; one line that names the file.
    """
    path = config_path('ehl', name)
    document = read_yaml(path)
    with named_errors(path):
        return parse(with_files(document, path.parent), lambda oring: load_oring(oring, path.parent))


def load_oring(name: str, beside: Path) -> OringCaseFile:
    """O-ring case file in the folder ``beside``, from a path, or of a name in config/oring; as `read_oring_case`."""
    local = beside / f'{name}.yaml'
    return read_oring_case(local if local.is_file() else config_path('oring', name))


def compile_for_map(case: LubricationCase) -> None:
    """Compile the code of a friction map in this process, so that worker processes inherit it."""
    numerics = replace(case.numerics, cells=within_bounds(case.numerics, 'cells', 0))  # the fewest
    with suppress(NotConvergedError):
        steady_friction(replace(case, oring=None, numerics=numerics, map=replace(case.map, velocities=2)), 0.0)


class MapRuns(NamedTuple):
    """The friction map of a case, and the table that it is from."""

    case: LubricationCase
    law: FrictionMap
    table: SteadyFriction  # over the pressures
    retried_steps: int  # steps that did not converge and were repeated in halves
    mesh_error: FloatArray | None = None
    """[-] change of each friction as of `change_of`, shape (pressures, speeds); None: not computed"""
    uncertainty: Uncertainty | None = None  # None: no samples

    @property
    def limits(self) -> str:
        """Where the film is out of its range, as a sentence; empty where it is not."""
        touching, thinnest = self.table.real_contact.max(), self.table.thinnest.min()
        if not carries_film(self.table):
            return (
                f'At rest {touching:.2g} of the seal touches; above {PERCOLATION:g} no lubricant gets under it. So the '
                'change with speed is not in the seal file: the friction is that at '
                f'{1e3 * self.law.reference_speed:g} mm/s at every speed.'
            )
        if thinnest < THINNEST_OF_CLOSURES:
            return (
                f'At rest the gap is {thinnest:.2g} of the roughness; the flow factors hold from '
                f'{THINNEST_OF_CLOSURES:g}.'
            )
        return ''

    @property
    def mesh(self) -> str:
        """What the mesh changes, as a sentence; empty if that is not known."""
        if self.mesh_error is None:
            return ''
        worst, marked = self.mesh_error, self.mesh_error > DISCRETISATION
        i, j = np.unravel_index(int(worst.argmax()), worst.shape)
        where = f'at {1e3 * self.law.speeds[j]:.3g} mm/s and {self.law.pressures[i] / BAR:.3g} bar'
        if math.isinf(worst[i, j]):
            return f'Mesh: neither the finer nor the coarser one can be computed {where}: this number has no error.'
        warning = ''
        if marked.any():
            at = 1e3 * np.array(self.law.speeds)[marked.any(axis=0)]
            warning = f'; {marked.sum()} of {marked.size} by MORE THAN 3 %, at {at[0]:.3g} to {at[-1]:.3g} mm/s'
        if worst[i, j] > MOST_MESH_ERROR:
            warning += '; above 5 % a number is not converged'
        share = self.mesh_error_at_reference
        return (
            f'Mesh: the next one changes the friction by {100.0 * worst[i, j]:.2g} % at most, {where}, and by '
            f'{100.0 * share:.2g} % at most at {1e3 * self.law.reference_speed:g} mm/s{warning}.'
        )

    @property
    def mesh_error_at_reference(self) -> float:
        """Largest change of a friction at the reference speed on the next mesh [-]."""
        if self.mesh_error is None:
            return 0.0
        speed, speeds = math.log(self.law.reference_speed), np.log(self.law.speeds)
        return max(float(np.interp(speed, speeds, row)) for row in self.mesh_error)

    def numbers(self) -> dict[str, Any]:
        """Numbers for JSON."""
        table, (towards, away) = self.table, directions(self.law, self.table).tolist()
        return {
            'case': self.case.name,
            'speed_m_s': self.law.speeds,
            'pressure_Pa': self.law.pressures,
            'friction_N': table.friction.tolist(),
            'towards_pressure_N': towards,
            'away_from_pressure_N': away,
            'pressure_asymmetry': pressure_asymmetry(self.law, table),
            'solid_share': (table.solid / table.friction).tolist(),
            'memory_length_m': self.law.memory_length,
            'presliding_length_m': self.law.presliding_length,
            'real_contact_at_rest': table.real_contact.tolist(),
            'gap_over_roughness_at_rest': table.thinnest.tolist(),
            'speeds_in_seal_file': carries_film(table),
            'retried_steps': self.retried_steps,
            'mesh_error': None if self.mesh_error is None else self.mesh_error.tolist(),
            'mesh_marked': None if self.mesh_error is None else (self.mesh_error > DISCRETISATION).tolist(),
            **({} if self.uncertainty is None else {'uncertainty': self.uncertainty.numbers()}),
        }

    def summary(self) -> str:
        """One line for a person, more with samples."""
        low, high = min(self.law.frictions), max(self.law.frictions)
        size = f'{len(self.law.speeds)} speeds x {len(self.law.pressures)} pressures'
        sampled = '' if self.uncertainty is None else f'\n{self.uncertainty.summary()}'
        notes = ''.join(f'\n{text}' for text in (self.limits, self.mesh) if text)
        return f'{self.case.name}: {size}, {low:.3g} to {high:.3g} N{notes}{sampled}'


def run_map(case: LubricationCase, workers: Workers, work: Path | None = None) -> MapRuns:
    """Compute the friction map of a case; ValueError: a film did not converge, or the folder cannot be used.

    The folder ``work`` keeps finished parts, so that an interrupted map resumes; None keeps none.
    """
    known = varied_case(case, {})
    tables = [table_part(each) for each in (other_mesh(known, FINER), known, other_mesh(known, COARSER))]
    memory = Part(part_key('memory', asdict(known)), MemoryLength._fields, partial(memory_length, known))
    prepare = partial(compile_for_map, known)
    finer, here, coarser, lag = try_parts(f'{case.name}: map', [*tables, memory], workers, Kept(work), prepare)
    table, lags = SteadyFriction(**needed(here)), MemoryLength(**needed(lag))
    retried = lags.retried_steps + int(table.retried_steps.sum())
    missing = {'friction': np.full_like(table.friction, np.nan)}  # of a mesh that failed
    others = [np.asarray((mesh.result or missing)['friction']) for mesh in (coarser, finer)]
    law = friction_map(case, table, lags.length)
    return MapRuns(case, law, table, retried, change_of(others[0], table.friction, others[1]))


def needed(outcome: Outcome[Values]) -> Values:
    """Result of a part; ValueError: it failed."""
    if outcome.result is None:
        raise ValueError(outcome.error)
    return outcome.result


def other_mesh(case: LubricationCase, factor: float) -> LubricationCase:
    """The case with ``factor`` times as many cells, and lines of the elements of a ring."""
    cells = within_bounds(case.numerics, 'cells', round(factor * case.numerics.cells))
    case = replace(case, numerics=replace(case.numerics, cells=cells))
    if case.oring is None:
        return case
    numerics = case.oring.numerics
    lines = replace(numerics, lines=other_lines(numerics.lines, factor))
    return replace(case, oring=replace(case.oring, numerics=lines))


def table_part(case: LubricationCase) -> Part:
    """The table of a case."""
    return Part(part_key('table', asdict(case)), SteadyFriction._fields, partial(steady_table, case))


def seal_document(computed: MapRuns, name: str) -> dict[str, Any]:
    """Seal file called ``name`` of a friction map.

    The uncertainty is that of the samples. Without samples it is our choice, since nothing is measured here: one tenth
    of the friction; of an O-ring from its drawing 0.7, the error that was found against readings (docs/ehl.md). The
    breakaway friction is the friction at the lowest speed of the map over that at its reference speed, mean over the
    pressures; of a map without speeds `STICTION_OF_A_RING`.
    """
    case, law = computed.case, live_map(computed.law, computed.table)
    if computed.uncertainty is None:
        relative_std = 0.7 if case.oring else 0.1
    else:
        relative_std = rounded(computed.uncertainty.relative_std, 3)
    creeping = fmean(law.sliding_friction(p, law.speeds[0]) / law.coulomb_friction(p) for p in law.pressures)
    stiction = max(0.0, creeping - 1.0) if law.depends_on_speed else STICTION_OF_A_RING
    pressures = [rounded(value, 7) for value in law.pressures]
    elastic = presliding_of_map(law)
    document: dict[str, Any] = {
        'name': name,
        'source': f'computed by seal_friction ehl map from the case {case.name}; '
        f'steady sliding, mean of both directions. {computed.limits} {computed.mesh}'.strip(),
        'coulomb_law': 'friction_map',
        'friction_map': {
            'speeds': [rounded(value, 13) for value in law.speeds],  # their ratios have to be equal
            'pressures': pressures,
            'frictions': [rounded(value, 7) for value in law.frictions],
            'reference_speed': rounded(law.reference_speed, 7),
            'memory_length': rounded(law.memory_length, 7),
            'presliding_length': rounded(law.presliding_length, 7),
        },
        'stiction_ratio': rounded(stiction, 3),
        'uncertainty': {'relative_std': relative_std},
        'identified_pressure': [pressures[0], pressures[-1]],
    }
    asymmetry = rounded(pressure_asymmetry(computed.law, computed.table), 3)
    if abs(asymmetry) >= LEAST_ASYMMETRY:
        document['pressure_asymmetry'] = {'asymmetry': asymmetry, 'full_pressure': pressures[-1]}
    if elastic is not None:
        numbers = asdict(elastic)
        document['presliding'] = {key: n if key == 'elements' else rounded(n, 7) for key, n in numbers.items()}
    return document
