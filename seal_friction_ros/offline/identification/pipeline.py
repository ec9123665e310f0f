"""Identification pipeline: sources -> readings -> fitted laws -> selected law -> seal file.

A fit that fails or predicts nothing is an error and gives no file. The computation uses no random numbers, and every
number is rounded to six digits before another number is computed from it: the same sources give the same bytes.
"""

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.foundation.parameters import from_mapping
from seal_friction_ros.core.foundation.units import BAR
from seal_friction_ros.core.friction.actuator import MountedSeal, actuator_friction
from seal_friction_ros.core.friction.geometry import SealGeometry
from seal_friction_ros.core.friction.laws.normal_force import NormalForceLaw, squeeze_force
from seal_friction_ros.core.friction.seal_file import parse_part, parse_seal
from seal_friction_ros.core.identification import diagnostics, fitting
from seal_friction_ros.core.identification.candidate_laws import CandidateLaw, candidate_laws, normal_forces
from seal_friction_ros.core.identification.readings import FrictionReadings, PreparedReadings
from seal_friction_ros.core.identification.signal_preparation import offset_line
from seal_friction_ros.files import config_path, read_yaml
from seal_friction_ros.offline.identification.data_sheet import geometry_of_seal_file
from seal_friction_ros.offline.identification.results import (
    FEWEST_PRESSURES_FOR_EXPONENT,
    Identification,
    IdentificationData,
    LawQuality,
    LawSelection,
    PressureLevel,
    Ring,
    identification_section,
    rounded_value,
    seal_document,
)
from seal_friction_ros.offline.identification.sources import SourceOptions, Sources, read_sources
from seal_friction_ros.offline.identification.wording import remarks_on, warnings_of
from seal_friction_ros.offline.work.progress import progress

SPEEDS_DIFFER = 1.5  # fastest over slowest reading above which velocity terms are tried (our choice)
LARGEST_ERROR = 0.5  # out-of-sample error above which a law is not saved (our choice)
REFERENCE_SEAL = 'ms28775_114'  # its area deformation gain (finite elements) is used if no other is known


@dataclass(frozen=True, kw_only=True)
class IdentifyOptions:
    """Options of an identification."""

    sources: SourceOptions = field(default_factory=SourceOptions)
    seal: str | None = None
    """seal file with the geometry of the ring and its normal force: a path, or the name of one in config/seals"""
    squeeze_force: bool = False  # compute the normal force from the geometry, even if the seal file has one
    law: str | None = None  # law to save instead of the recommended one
    run_to_run: float | None = None  # [-] relative standard deviation between runs, if known from elsewhere
    name: str = ''  # of the seal; empty: the name of the seal file


def identify(paths: Sequence[Path], options: IdentifyOptions, name: str) -> Identification:
    """Read bags, logs, tables or data sheets, fit every law, select one and assess it.

    ``name`` is that of the seal, unless the options name it.

    Raises:
        ValueError: The data are unfit for identification, or no law predicts them; one line with the reason and what to
            measure instead.
    """
    data = gather(paths, options)
    selection = select_law(data, options.law)
    quality = assess(data, selection, options.run_to_run)
    document = seal_document(data, selection, quality, options.name or name)
    levels = _levels(data, selection, quality, document)
    warnings = tuple(warnings_of(data, selection, quality, levels))
    remarks = (*data.sources.remarks, *remarks_on(data, selection))
    document['identification'] = identification_section(data, selection, quality, levels, warnings)
    return Identification(data, selection, quality, levels, document, warnings, remarks)


def gather(paths: Sequence[Path], options: IdentifyOptions) -> IdentificationData:
    """Read the sources and exclude readings that do not belong to one state of one seal.

    Raises:
        ValueError: The data are unfit for identification.
    """
    sources = read_sources(paths, options.sources)
    ring = _ring(sources, options)
    prepared, changes, kept = _one_state(sources)
    readings = _with_normal_force(prepared.readings, ring)
    outlier, used = None, readings
    if not readings.are_samples and len(readings.levels) >= 4:
        law = next(law for law in _candidates(readings) if law.name == 'pressure_power_law')
        found = fitting.fit(law, readings)
        floor = diagnostics.repeatability(readings, found.offsets)
        outlier = diagnostics.outlying_level(law, readings, found.values, floor if math.isfinite(floor) else 0.0)
    if outlier is not None:  # number the levels, and the groups that are levels, without a gap
        used = readings.taken(readings.level != outlier.level)
        level = np.unique(used.level, return_inverse=True)[1]
        group = level if used.left_out_by == 'pressure' else used.group
        used = replace(used, level=level, group=group)
    return IdentificationData(sources, prepared._replace(readings=readings), used, ring, outlier, changes, kept)


def _ring(sources: Sources, options: IdentifyOptions) -> Ring | None:
    """Geometry and normal force of the ring: from the seal of the options, else from a bag or data sheet."""
    found = (source.seal_document for source in sources.each if source.seal_document is not None)
    document = next(found, None)
    if options.seal is not None:
        geometry, document = geometry_of_seal_file(options.seal)
    elif document is not None and 'geometry' in document:
        geometry = from_mapping(SealGeometry, document['geometry'], 'seal of the source: geometry')
    else:
        return None
    normal_force = document.get('normal_force')
    if not isinstance(normal_force, Mapping) or options.squeeze_force:
        gain = read_yaml(config_path('seals', REFERENCE_SEAL))['normal_force']['area_deformation_gain']
        force = rounded_value(squeeze_force(geometry))
        normal_force = {'law': 'area_deformation_gain', 'area_deformation_gain': gain, 'radial_force': force}
    return Ring(geometry, parse_part(NormalForceLaw, {'normal_force': normal_force}, 'seal'))


def _with_normal_force(readings: FrictionReadings, ring: Ring | None) -> FrictionReadings:
    if ring is None:
        return readings
    forces = normal_forces(readings.at.pressure, *ring)
    return replace(readings, at=readings.at._replace(normal_force=forces))


def _one_state(sources: Sources) -> tuple[PreparedReadings, tuple[diagnostics.FrictionChange, ...], tuple[int, ...]]:
    """Readings of the sources that agree, comparison of each further swept log with the first, and the sources kept.

    Sources with readings at held pressures form one law together, so a disagreement between them is an error. A swept
    log determines a law by itself: the first one is fitted, each other one is compared with its law and is excluded if
    its friction has changed.
    """
    numbers = tuple(range(len(sources.files)))
    first = None
    if len(numbers) > 1:
        with suppress(ValueError):  # one source by itself may have too few pressures
            first = sources.prepare([0])
    if first is None or not first.readings.are_samples:
        together = sources.prepare()
        _check_unchanged(together.readings)
        return together, (), numbers
    laws = {law.name: law for law in _candidates(first.readings)}
    found = fitting.fit(laws.get('pressure_power_law_viscous', laws['pressure_power_law']), first.readings)
    others = (sources.prepare([i]).readings for i in numbers[1:])
    changes = tuple(diagnostics.compare_with_law(found, first.readings, other) for other in others)
    kept = (0, *(i for i, change in zip(numbers[1:], changes, strict=True) if not change.is_change))
    return (sources.prepare(kept) if len(kept) > 1 else first), changes, kept


def _check_unchanged(readings: FrictionReadings) -> None:
    changes = [(c.other_friction / c.friction - 1.0, c) for c in diagnostics.changed_levels(readings)]
    if changes:
        change, worst = max(changes, key=lambda pair: abs(pair[0]))
        raise ValueError(
            f'the friction has changed: {worst.friction:.4g} N in {worst.name} and {worst.other_friction:.4g} N in '
            f'{worst.other_name}, {100.0 * change:+.0f} %, both at {worst.pressure / BAR:.3g} bar; runs of one seal '
            f'repeat within {100.0 * diagnostics.CHANGED:.0f} %, so these are two seals or two states of one seal: '
            'identify each separately'
        )


def _candidates(readings: FrictionReadings, ring: Ring | None = None) -> tuple[CandidateLaw, ...]:
    speed = np.abs(readings.at.velocity)
    return candidate_laws(
        **(ring._asdict() if ring else {}),
        with_speeds=bool(np.isfinite(speed).all()) and float(speed.max()) > SPEEDS_DIFFER * float(speed.min()),
        with_exponent=readings.are_samples or len(readings.levels) >= FEWEST_PRESSURES_FOR_EXPONENT,
    )


def select_law(data: IdentificationData, name: str | None) -> LawSelection:
    """Fit and score every candidate law; select the recommended one, or the one called ``name``.

    Raises:
        ValueError: No law could be fitted, the selected one predicts nothing, or there is no law of that name.
    """
    laws = _candidates(data.used, data.ring)
    if data.sources.has_fitted_load:  # asymmetry is not identifiable: the fitted load holds it
        laws = tuple(law for law in laws if 'asymmetry' not in law.velocity_terms)
    with progress('fit and leave out', len(laws) * (len(data.used.groups) + 1)) as advance:
        scores = fitting.score_laws(laws, data.used, advance)
    best = fitting.recommended(scores)
    by_name = {None: best} | {score.law.name: score for score in scores}
    if name not in by_name:
        raise ValueError(f'law {name!r} is not one of {", ".join(score.law.name for score in scores)}')
    selected = by_name[name]
    if selected.fit is None or selected.validation is None:
        raise ValueError(f'law {name} was not fitted: {selected.why_not}')
    if not selected.validation.error <= LARGEST_ERROR:
        raise ValueError(
            f'{", ".join(data.used.names)}: no law predicts these readings: {selected.law.name} is off by '
            f'{100.0 * selected.validation.error:.0f} % on left-out readings: measure more strokes at each pressure, '
            'in both directions, with a settled seal'
        )
    return LawSelection(scores, best, selected.fit, selected.validation, fitting.plain_mean(data.used))


def assess(data: IdentificationData, selection: LawSelection, run_to_run: float | None) -> LawQuality:
    """Uncertainty of the selected law for new readings."""
    used, found, validation = data.used, selection.fit, selection.validation
    groups = len(used.groups)
    everything = data.prepared.readings
    offsets = fitting.offsets_of(everything, found.friction(everything.at))
    drift = {} if used.are_samples else diagnostics.run_drift(everything, offsets)
    between, is_drift = _run_to_run(data, drift) if run_to_run is None else (run_to_run, False)
    with progress('test the band', groups * (groups - 1)) as advance:
        coverage = fitting.band_coverage(selection.law, used, found.values, between, advance)
    names = [parameter.name for parameter in selection.law.parameters]
    line = None
    if everything.samples:
        level_offsets = np.array([everything.half_range(inside).offset for inside in everything.levels.values()])
        line = offset_line(everything.level_pressures, level_offsets)
    return LawQuality(
        uncertainty=fitting.prediction_uncertainty(validation.predicted, validation.deviation, groups, between),
        run_to_run=between,
        is_drift=is_drift,
        coverage=coverage,
        repeatability=diagnostics.repeatability(used, found.offsets),
        drift=drift,
        breakaway=_breakaway(data, found),
        offset_line=line,
        standard_errors=dict(zip(names, fitting.jackknife_errors(validation.parameters).tolist(), strict=True)),
    )


def _run_to_run(data: IdentificationData, drift: Mapping[int, float]) -> tuple[float, bool]:
    """Relative standard deviation between runs, if each pressure has runs of its own; and whether it is the drift.

    It is measured if pressures were repeated. Otherwise the root mean square drift within the runs is used in its place
    (our choice): a seal that changes during a measurement differs in the next one. Runs of the Delft O-ring drift by 11
    to 18 % and repeat within 10 to 15 %.
    """
    if data.used.left_out_by != 'pressure' or data.used.are_samples or not data.used.samples:
        return 0.0, False
    measured = diagnostics.between_runs(data.used)
    if math.isfinite(measured):
        return measured, False
    kept = [change for level, change in drift.items() if not data.is_outlier(level)]
    return (math.sqrt(sum(change**2 for change in kept) / len(kept)), True) if kept else (0.0, False)


def _breakaway(data: IdentificationData, found: fitting.LawFit) -> fitting.BreakawayFit | None:
    if data.prepared.breakaway is None:
        return None
    readings = _with_normal_force(data.prepared.breakaway, data.ring)
    if data.outlier is not None:
        readings = readings.taken(readings.level != data.outlier.level)
    if len(readings.groups) < 2:
        return None
    return fitting.fit_breakaway(readings, found.law.coulomb_friction(readings.at, found.values), found.offsets)


def _levels(
    data: IdentificationData, selection: LawSelection, quality: LawQuality, document: Mapping[str, Any]
) -> tuple[PressureLevel, ...]:
    """Measured and fitted friction at each pressure level, by the law as the seal file has it."""
    readings = data.prepared.readings
    seal = parse_seal(document)
    mounted = tuple(MountedSeal(seal, chamber) for chamber in data.sources.chambers)
    fitted, std = fitted_readings(mounted, data.prepared.chamber_pressures, readings.at.velocity)
    measured = readings.magnitudes(fitting.offsets_of(readings, fitted))
    predicted = [float(selection.validation.predicted[inside].mean()) for inside in data.used.levels.values()]
    if data.outlier is not None:
        predicted.insert(list(readings.levels).index(data.outlier.level), data.outlier.expected)
    return tuple(
        PressureLevel(
            pressure=float(readings.seal_pressure[inside].mean()),
            speed=float(np.abs(readings.at.velocity[inside]).mean()),
            measured=float(measured[inside].mean()) if readings.are_samples else readings.half_range(inside).friction,
            fitted=float(fitted[inside].mean()),
            std=float(std[inside].mean()),
            left_out=left_out,
            offset=math.nan if readings.are_samples else readings.half_range(inside).offset,
            readings=int(inside.sum()),
            drift=quality.drift.get(level, math.nan),
            is_used=not data.is_outlier(level),
        )
        for (level, inside), left_out in zip(readings.levels.items(), predicted, strict=True)
    )


def fitted_readings(
    mounted: tuple[MountedSeal, ...], chambers: FloatArray, velocity: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Friction and its standard deviation [N] of mounted seals, as the node computes them, shape (n,) each.

    ``chambers`` are the pressures of chambers a and b [Pa], shape (n, 2); a velocity [m/s] of NaN counts as 0.
    """
    rows = np.column_stack((chambers, np.nan_to_num(velocity))).tolist()
    found = [actuator_friction(mounted, *row) for row in rows]
    friction = np.array([f.coulomb_friction + f.velocity_friction for f in found])
    return friction, np.array([f.coulomb_friction_std for f in found])
