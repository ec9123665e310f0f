"""Samples of what is not known, and the friction of each: independent calls on the executor.

The values are a Latin hypercube: with N samples each unknown has one value in each Nth part of its distribution, and
the unknowns are independent of each other. The same seed gives the same values, and the result does not depend on the
number of workers.

Source: M. D. McKay, R. J. Beckman, W. J. Conover: A comparison of three methods for selecting values of input variables
in the analysis of output from a computer code, Technometrics 21, 1979.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.stats.qmc import LatinHypercube

from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.foundation.unknowns import Unknown
from seal_friction_ros.core.lubrication.friction_map import map_pressures, map_speeds
from seal_friction_ros.core.lubrication.lubrication_case import LubricationCase, varied_case
from seal_friction_ros.core.oring_contact.oring_case import OringCase, check_pressures
from seal_friction_ros.core.oring_contact.oring_case_file import FRICTION_COEFFICIENT, varied_ring
from seal_friction_ros.core.oring_contact.results import oring_results
from seal_friction_ros.core.oring_contact.ring_friction import RingLaw, friction_of_contact
from seal_friction_ros.offline.contact.lubrication_runs import compile_for_map, table_part
from seal_friction_ros.offline.contact.mesh_levels import COARSER, other_lines
from seal_friction_ros.offline.contact.oring_runs import Computed, sliding_contact
from seal_friction_ros.offline.contact.uncertainty import Uncertainty, check_unknown
from seal_friction_ros.offline.work.executor import Workers, nothing
from seal_friction_ros.offline.work.finished_parts import Kept, Part, content_of, part_key, try_parts

_EDGE = 1e-12  # share that is left out at both ends of a distribution, where a log-normal one has no value
MOST_SPEEDS, MOST_PRESSURES = 4, 3  # of a sample; docs/ehl.md says what it costs


def latin_hypercube(unknowns: Sequence[Unknown], samples: int, seed: int) -> FloatArray:
    """Values of the unknowns, shape (samples, unknowns)."""
    shares = LatinHypercube(len(unknowns), seed=seed).random(samples).clip(_EDGE, 1.0 - _EDGE)
    return np.stack([unknown.at(share) for unknown, share in zip(unknowns, shares.T, strict=True)], axis=1)


def uncertain_map(
    case: LubricationCase, samples: int, seed: int, workers: Workers, work: Path | None = None
) -> Uncertainty:
    """Friction over speed and pressure of samples of a case, on a coarser grid; ``work`` as of `run_map`.

    ValueError: nothing is unknown, the case itself cannot be computed on this grid, or all samples but one failed.
    """
    names, drawn = _drawn(case.name, case.unknown, samples, seed)
    coarse = coarse_case(case)

    def parts_of(values: Mapping[str, float]) -> list[Part]:
        return [table_part(varied_case(coarse, values))]

    outcome = sampled(f'{case.name}: samples', names, drawn, parts_of, workers, work, partial(compile_for_map, coarse))
    tables = np.array([table['friction'] for (table,) in outcome.computed])
    pressures, speeds = tuple(map_pressures(coarse.map).tolist()), tuple(map_speeds(coarse.map).tolist())
    return Uncertainty(seed, names, drawn, outcome.failed, pressures, speeds, tables[0], tables[1:])


def coarse_case(case: LubricationCase) -> LubricationCase:
    """The case on the grid of its samples: fewer speeds and pressures over the same ranges, on the same mesh."""
    grid = case.map
    grid = replace(grid, velocities=min(grid.velocities, MOST_SPEEDS), pressures=min(grid.pressures, MOST_PRESSURES))
    return replace(case, map=grid)


def coarse_ring(case: OringCase) -> OringCase:
    """A ring on the next coarser mesh."""
    return replace(case, numerics=replace(case.numerics, lines=other_lines(case.numerics.lines, COARSER)))


class RingUncertainty(NamedTuple):
    """Uncertainty of the forces of a dry ring."""

    normal_force: Uncertainty
    friction: Uncertainty | None  # None without a law of the friction

    def numbers(self) -> dict[str, Any]:
        """Numbers for JSON."""
        numbers = self.normal_force.numbers('normal_force_N')
        return numbers if self.friction is None else numbers | self.friction.numbers()

    def summary(self) -> str:
        """Lines for a person."""
        return (self.friction or self.normal_force).summary()


def uncertain_ring(
    computed: Computed, samples: int, seed: int, workers: Workers, work: Path | None = None
) -> RingUncertainty:
    """Forces of samples of an O-ring at the pressures that were computed; as `uncertain_map`.

    Samples are computed on the next coarser mesh; the force of the case on that mesh is their unit.
    """
    file, pressures = computed.file, computed.summary.pressure_Pa
    case, law = coarse_ring(file.case), file.friction.law if file.friction else None
    names, drawn = _drawn(case.name, file.unknown, samples, seed)

    def parts_of(values: Mapping[str, float]) -> list[Part]:
        """The ring with these values of what is unknown."""
        varied = varied_ring(case, values)
        check_pressures(varied, pressures)
        key = part_key('ring', content_of([varied, pressures, law]))
        return [Part(key, ('normal_force', 'friction'), partial(ring_forces, varied, pressures, law))]

    outcome = sampled(f'{case.name}: samples', names, drawn, parts_of, workers, work)
    forces = np.array([ring['normal_force'] for (ring,) in outcome.computed])
    forces *= np.array(computed.summary.normal_force_N) / forces[0]
    factors = np.ones(len(forces))
    if FRICTION_COEFFICIENT in names:
        kept = np.delete(drawn, sorted(outcome.failed), axis=0)
        factors[1:] = kept[:, names.index(FRICTION_COEFFICIENT)]
    made = partial(Uncertainty, seed, names, drawn, outcome.failed, pressures, ())
    if law is None:
        return RingUncertainty(made(forces[0], forces[1:]), None)
    friction = factors[:, None] * np.array([ring['friction'] for (ring,) in outcome.computed])
    friction *= np.array(computed.summary.friction_N) / friction[0]
    return RingUncertainty(made(forces[0], forces[1:]), made(friction[0], friction[1:]))


def ring_forces(case: OringCase, pressures: tuple[float, ...], law: RingLaw | None) -> dict[str, FloatArray]:
    """Normal force and friction [N] of a dry ring on its sliding wall at increasing pressures [Pa, gauge].

    Without a law the friction is NaN.
    """
    contacts = [sliding_contact(case, result) for result in oring_results(case, pressures)]
    friction = [math.nan if law is None else friction_of_contact(law, contact) for contact in contacts]
    return {'normal_force': np.array([contact.force for contact in contacts]), 'friction': np.array(friction)}


class Sampled(NamedTuple):
    """What became of samples."""

    computed: list[list[Mapping[str, Any]]]  # results of the parts of the case itself, then of each sample not failed
    failed: dict[int, str]  # reason by number of the sample


def _drawn(name: str, unknowns: Sequence[Unknown], samples: int, seed: int) -> tuple[tuple[str, ...], FloatArray]:
    """Names of the unknowns, and their values."""
    check_unknown(name, unknowns)
    return tuple(unknown.name for unknown in unknowns), latin_hypercube(unknowns, samples, seed)


def sampled(
    label: str,
    names: Sequence[str],
    drawn: FloatArray,
    parts_of: Callable[[Mapping[str, float]], list[Part]],
    workers: Workers,
    work: Path | None,
    prepare: Callable[[], None] = nothing,
) -> Sampled:
    """Compute the parts of a case, and of each sample; one that fails does not stop the others.

    ``drawn`` has the values of the unknowns, shape (samples, unknowns). ``parts_of`` makes the parts of the case with
    other values; ValueError if there is no such case. Other arguments as of `run_parts`. ValueError: the case itself
    failed, or the folder or the cluster cannot be used.
    """
    groups, failed = {-1: parts_of({})}, dict[int, str]()
    for number, row in enumerate(drawn.tolist()):
        try:
            groups[number] = parts_of(dict(zip(names, row, strict=True)))
        except ValueError as error:
            failed[number] = str(error)
    done = iter(try_parts(label, [part for group in groups.values() for part in group], workers, Kept(work), prepare))
    computed = []
    for number, group in groups.items():
        outcomes = [next(done) for _ in group]
        reason = next((outcome.error for outcome in outcomes if outcome.error), '')
        if reason and number < 0:
            raise ValueError(reason)
        if reason:
            failed[number] = reason
        else:
            computed.append([outcome.result or {} for outcome in outcomes])
    return Sampled(computed, dict(sorted(failed.items())))
