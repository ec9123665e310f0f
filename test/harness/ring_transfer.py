"""Friction of one ring from another ring or from one reading: the shear law beside a constant and mu N."""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from paths import ROOT
from scipy.optimize import minimize_scalar
from scipy.signal import savgol_filter

from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.foundation.units import BAR
from seal_friction_ros.core.friction.geometry import SealGeometry
from seal_friction_ros.core.friction.laws.contact_shear import ShearLaw
from seal_friction_ros.core.oring_contact.oring_case_file import parse_oring_case
from seal_friction_ros.core.oring_contact.results import WallContact, oring_results
from seal_friction_ros.core.oring_contact.ring_friction import (
    PRIOR_LAW,
    Reading,
    RingLaw,
    fit_shear_law,
    friction_law,
)
from seal_friction_ros.files import config_path, read_yaml
from seal_friction_ros.offline.contact.oring_runs import sliding_contact
from seal_friction_ros.offline.reports.thesis_data import dynamic_readings

DELFT = ROOT.parent / 'shared' / 'data' / 'delft'
LOGS = [f'O-ring257_{run}{bar}bar.csv' for run in ('', 'run2_') for bar in (1, 3, 5, 7)]


class Ring(NamedTuple):
    """A computed ring and readings of its friction."""

    geometry: SealGeometry
    pressures: tuple[float, ...]  # [Pa] computed
    contacts: list[WallContact]
    readings: list[Reading]

    @property
    def frictions(self) -> FloatArray:
        """Friction of each reading [N]."""
        return np.array([reading.friction for reading in self.readings])

    def predicted(self, law: RingLaw) -> FloatArray:
        """Friction by a law at the pressure of each reading [N]."""
        over_pressure = friction_law(law, self.geometry, self.pressures, self.contacts)
        return np.array([over_pressure.coulomb_friction(reading.pressure) for reading in self.readings])

    def normal_forces(self) -> FloatArray:
        """Normal force at the pressure of each reading [N]."""
        forces = [contact.force for contact in self.contacts]
        return np.interp([reading.pressure for reading in self.readings], self.pressures, forces)


def ring_of(case: str, lines: int = 33) -> Ring:
    """A case of the package with its own readings, on a mesh of ``lines``."""
    return computed_ring(read_yaml(config_path('oring', case)), lines)


def computed_ring(document: Mapping[str, Any], lines: int = 33) -> Ring:
    """A case by its document, with its own readings, on a mesh of ``lines``."""
    file = parse_oring_case(document)
    coarse = dataclasses.replace(file.case, numerics=dataclasses.replace(file.case.numerics, lines=lines))
    results = list(oring_results(coarse, file.pressures))
    measured = file.measured
    assert measured is not None
    readings = [
        Reading(pressure, 0.01, friction / measured.seals)
        for pressure, friction in zip(measured.pressures, measured.frictions, strict=True)
    ]
    return Ring(file.case.geometry, file.pressures, [sliding_contact(coarse, result) for result in results], readings)


def fitted(ring: Ring, readings: Sequence[Reading], prior: RingLaw = PRIOR_LAW) -> RingLaw:
    """Shear law of some readings of a ring."""
    return fit_shear_law(prior, ring.pressures, ring.contacts, readings).law


def own_law(ring: Ring) -> ShearLaw:
    """Shear law of the readings of a ring alone, without a prior: what another ring can be predicted from."""

    def stresses(log_knee: float) -> FloatArray:
        return np.log(ring.frictions / ring.predicted(ShearLaw(1.0, math.exp(log_knee))))

    bounds = (math.log(0.01e6), math.log(50e6))
    found = float(minimize_scalar(lambda x: float(stresses(x).std()), bounds=bounds, method='bounded').x)
    return ShearLaw(math.exp(stresses(found).mean()), math.exp(found))


def off(predicted: FloatArray, ring: Ring) -> FloatArray:
    """Deviation from the readings [%]."""
    return 100.0 * (predicted / ring.frictions - 1.0)


def without_reading(source: Ring, target: Ring) -> dict[str, FloatArray]:
    """Deviation [%] of the friction of a ring by what readings of another one tell, by model."""
    coefficient = float(np.mean(source.frictions / source.normal_forces()))
    return {
        'shear law': off(target.predicted(own_law(source)), target),
        'mu N': off(coefficient * target.normal_forces(), target),
        'constant': off(np.full(len(target.readings), source.frictions.mean()), target),
    }


def with_one_reading(target: Ring, prior: RingLaw = PRIOR_LAW) -> dict[str, FloatArray]:
    """The same after each reading alone, by model: row i has the deviations [%] after reading i."""
    normal, friction = target.normal_forces(), target.frictions
    return {
        'shear law': np.array([off(target.predicted(fitted(target, [r], prior)), target) for r in target.readings]),
        'mu N': np.array([off(f / n * normal, target) for f, n in zip(friction, normal, strict=True)]),
        'constant': np.array([off(np.full(len(friction), f), target) for f in friction]),
    }


def of_others(deviations: FloatArray) -> FloatArray:
    """Magnitudes without those of the reading itself, shape (n, n - 1)."""
    n = len(deviations)
    return np.abs(deviations)[~np.eye(n, dtype=bool)].reshape(n, n - 1)


def tests_of_the_thesis() -> FloatArray:
    """Friction of both seals in each of the three tests, mean of both directions [N], shape (3, 11)."""
    _, forces = dynamic_readings()
    return forces.reshape(3, 11, 2).mean(axis=2)


def other_tests_as_law() -> list[FloatArray]:
    """Magnitudes [%] as of `of_others` for each test of the thesis, its law being the mean of the other two tests."""
    friction = tests_of_the_thesis()
    laws = [np.delete(friction, test, axis=0).mean(axis=0) for test in range(3)]
    return [of_others(100.0 * (np.outer(one / law, law / one) - 1.0)) for one, law in zip(friction, laws, strict=True)]


def law_of_single_tests(thesis: Ring) -> list[FloatArray]:
    """The same by the shear law after one reading of the test."""
    found = []
    for test in tests_of_the_thesis():
        of_one = [reading._replace(friction=f / 2.0) for reading, f in zip(thesis.readings, test.tolist(), strict=True)]
        found.append(of_others(with_one_reading(thesis._replace(readings=of_one))['shear law']))
    return found


def delft_log(path: Path, bore: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Samples of a log, its velocity [m/s] and force sum [N] with the area of a ``bore`` [m]."""
    table = np.loadtxt(path)[15:]
    step = float(np.median(np.diff(table[:, 0]))) * 1e-3  # [s]
    velocity = savgol_filter(table[:, 4] * 1e-3, round(0.2 / step) | 1, 2, deriv=1, delta=step)
    return table, velocity, table[:, 5] * BAR * math.pi / 4.0 * bore**2 - table[:, 6]


def delft_reading(path: Path, bore: float = 0.0257) -> Reading:
    """Reading of a log: half the difference of both directions, sliding faster than 3 mm/s."""
    table, velocity, force = delft_log(path, bore)
    extends, retracts = velocity < -3e-3, velocity > 3e-3
    slides = extends | retracts
    friction = 0.5 * float(force[extends].mean() - force[retracts].mean())
    return Reading(float(np.median(table[slides, 5])) * BAR, float(np.median(np.abs(velocity[slides]))), friction)


def frictions_of_cycles(path: Path, low: float, high: float) -> FloatArray:
    """Friction of each cycle of a log [N] where the position is ``low`` to ``high`` [mm], as in `delft_reading`."""
    table, velocity, force = delft_log(path, 0.0257)
    direction = np.where(np.abs(velocity) > 3e-3, np.sign(velocity), 0.0)
    moving = np.flatnonzero(direction)
    strokes = np.split(moving, np.flatnonzero(np.diff(direction[moving])) + 1)
    there = (table[:, 4] >= low) & (table[:, 4] < high)
    means = np.array([force[stroke[there[stroke]]].mean() for stroke in strokes if there[stroke].sum() > 5])
    pairs = means[: len(means) // 2 * 2].reshape(-1, 2)
    return 0.5 * np.abs(pairs[:, 0] - pairs[:, 1])


def summary(deviations: FloatArray) -> dict[str, float]:
    """Mean and largest magnitude [%]."""
    return {'mean [%]': float(np.abs(deviations).mean()), 'worst [%]': float(np.abs(deviations).max())}


def transfer_rows(lines: int = 33) -> list[dict[str, float | str]]:
    """The transfer tests of docs/oring.md, model by model."""
    thesis, delft = ring_of('ms28775_114_blind', lines), ring_of('delft_o_ring', lines)
    logs = delft._replace(readings=[delft_reading(DELFT / log) for log in LOGS]) if DELFT.exists() else delft
    rows: list[dict[str, float | str]] = []
    for name, source, target in (('thesis to Delft', thesis, delft), ('Delft to thesis', logs, thesis)):
        rows += [
            {'test': f'{name}, no reading', 'model': model, **summary(found)}
            for model, found in without_reading(source, target).items()
        ]
        for model, found in with_one_reading(target, own_law(source)).items():
            rows.append({'test': f'{name}, one reading', 'model': model, **summary(of_others(found))})
            means = of_others(found)[1:].mean(axis=1)
            rows.append({'test': f'{name}, means after each reading but the first', 'model': model, **summary(means)})
    for ring, name in ((thesis, 'thesis'), (delft, 'Delft'), (logs, 'eight logs of Delft')):
        law = own_law(ring)
        found = summary(off(ring.predicted(law), ring))
        rows.append({'test': f'{name}, all readings, {law.knee_stress / 1e6:.2f} MPa', 'model': 'shear law', **found})
    for model, found in with_one_reading(thesis).items():
        for psi, others in zip(range(0, 1001, 100), of_others(found), strict=True):
            rows.append({'test': f'thesis, reading at {psi} psi', 'model': model, **summary(others)})
    for model, tests in (
        ('mean of the other two tests', other_tests_as_law()),
        ('shear law', law_of_single_tests(thesis)),
    ):
        for test, others in enumerate(tests, 1):
            name = f'test {test} of the thesis, reading at 100 psi or more'
            rows.append({'test': name, 'model': model, **summary(others[1:])})
    if logs is not delft:
        for model, found in with_one_reading(logs).items():
            others = of_others(found)
            worst = {'mean [%]': float(others.mean(axis=1).max()), 'worst [%]': float(others.max())}
            rows.append({'test': 'one Delft log, the other seven', 'model': model, **worst})
    return rows
