"""Identification pipeline: sources -> readings -> fitted laws -> selected law -> seal file.

A fit that fails or predicts nothing is an error and gives no file. The computation uses no random numbers, and every
number is rounded to six digits before another number is computed from it: the same sources give the same bytes.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.foundation.parameters import from_mapping
from seal_friction_ros.core.foundation.units import BAR
from seal_friction_ros.core.friction.actuator import MountedSeal, actuator_friction
from seal_friction_ros.core.friction.geometry import SealGeometry, squeeze_force
from seal_friction_ros.core.friction.laws.normal_force import NormalForceLaw
from seal_friction_ros.core.friction.laws.pressure_power_law import PressurePowerLaw
from seal_friction_ros.core.friction.seal_file import parse_part, parse_seal
from seal_friction_ros.core.identification import diagnostics, fitting, run_in, runs, seal_kinds, validation
from seal_friction_ros.core.identification.breakaway import BreakawayFit, fit_breakaway
from seal_friction_ros.core.identification.calibration import calibration
from seal_friction_ros.core.identification.candidate_laws import (
    CandidateLaw,
    SealKind,
    Variation,
    candidate_laws,
    law_of_all_terms,
)
from seal_friction_ros.core.identification.force_correction import ForceCorrection, force_correction
from seal_friction_ros.core.identification.friction_model import Told
from seal_friction_ros.core.identification.prepare_readings import with_predictable_groups
from seal_friction_ros.core.identification.readings import FrictionReadings, PreparedReadings
from seal_friction_ros.core.identification.selection import (
    ChosenAnew,
    LawScore,
    LeftOut,
    NotScored,
    choose_anew,
    collinear_spread,
    recommended,
    rises_over_pressures,
    score_ladder,
    variation_of,
    worthwhile,
)
from seal_friction_ros.core.identification.temperature import at_reference, fit_temperature
from seal_friction_ros.files import config_path, read_yaml
from seal_friction_ros.offline.identification.data_sheet import geometry_of_seal_file
from seal_friction_ros.offline.identification.presliding import identify_presliding
from seal_friction_ros.offline.identification.results import (
    Identification,
    IdentificationData,
    LawQuality,
    LawSelection,
    PressureLevel,
    Ring,
    identification_section,
    kind_section,
    seal_document,
)
from seal_friction_ros.offline.identification.sources import SourceOptions, Sources, read_sources
from seal_friction_ros.offline.identification.wording import kinds_warnings, remarks_on, warnings_of
from seal_friction_ros.offline.work.executor import Workers
from seal_friction_ros.offline.work.finished_parts import Part, content_of, part_key, run_parts
from seal_friction_ros.offline.work.places import Place
from seal_friction_ros.offline.work.progress import progress
from seal_friction_ros.offline.work.seal_writer import rounded_numbers

MOST_EXTENSIONS = 4  # of a law by velocity terms, and the law of all terms
FEWEST_TO_COMPARE = 4  # pressures by which the settled seal is compared with the readings as measured (our choice)
LARGEST_ERROR = 0.5  # out-of-sample error above which a law is not saved (our choice)
REFERENCE_SEAL = 'ms28775_114'  # its area deformation gain (finite elements) is used if no other is known


@dataclass(frozen=True, kw_only=True)
class IdentifyOptions:
    """Options of an identification."""

    sources: SourceOptions = field(default_factory=SourceOptions)
    kinds: tuple[SealKind, ...] = ()  # of the seals, if there are several; their chambers are those of the sources
    largest_kind_error: float = seal_kinds.LARGEST_KIND_ERROR  # [-] of its friction, up to which a kind is told apart
    seal: str | None = None
    """seal file with the geometry of the ring and its normal force: a path, or the name of one in config/seals"""
    squeeze_force: bool = False  # compute the normal force from the geometry, even if the seal file has one
    law: str | None = None  # law to save instead of the recommended one
    run_to_run: float | None = None  # [-] relative standard deviation between runs, if known from elsewhere
    presliding: bool = False  # identify the elasticity of the seals from the reversals of the logs, too
    refuse_changed: bool = False  # refuse sources whose friction differs, instead of fitting them together
    name: str = ''  # of the seal; empty: the name of the seal file


def identify(
    paths: Sequence[Place], options: IdentifyOptions, name: str, workers: Workers = 1, work: Path | None = None
) -> Identification:
    """Read bags, logs, tables or data sheets, fit every law, select one and assess it.

    ValueError: the folder or the cluster cannot be used, the data are unfit for identification, or no law predicts
    them; one line with the reason and what to measure instead.

    Args:
        paths: The sources, by path or URL.
        options: How.
        name: Of the seal, unless the options name it.
        workers: Sources, and groups that are left out, at a time, or a cluster; the result does not depend on it.
        work: Folder that keeps what was found without each group, so that an interrupted run resumes; None keeps none.
    """
    data = gather(paths, options, workers)
    elastic = identify_presliding(data.sources) if options.presliding else None
    selection = select_law(data, options.law, workers, work)
    _check_one_seal(diagnostics.swept_logs_compared(data.used, selection.fit), options.refuse_changed)
    told = _told_apart(data, selection, options.largest_kind_error)
    quality = assess(data, selection, options.run_to_run, told)

    def documents(settled: run_in.SettledLaw | None) -> dict[str, dict[str, Any]]:
        """Seal file of each kind."""
        names = {kind.name: '_'.join(filter(None, (options.name or name, kind.name))) for kind in data.kinds}
        return {
            kind.name: seal_document(data, selection, quality, names[kind.name], number, settled, elastic)
            for number, kind in enumerate(data.kinds)
        }

    as_measured = documents(None)
    levels = _levels(data, selection, quality, mounted_seals(as_measured))
    found = as_measured if selection.settled is None else documents(selection.settled)
    warnings = (*warnings_of(data, selection, quality, levels), *kinds_warnings(data, selection, quality))
    remarks = (*data.sources.remarks, *remarks_on(data, selection))
    for number, document in enumerate(found.values()):
        section = identification_section(data, selection, quality, levels, warnings, elastic)
        document['identification'] = section | kind_section(data, quality, number)
    return Identification(data, selection, quality, levels, found, as_measured, warnings, remarks, elastic)


def gather(paths: Sequence[Place], options: IdentifyOptions, workers: Workers = 1) -> IdentificationData:
    """Read the sources, correct the force sum, take all readings to one temperature, exclude a pressure that is off.

    Arguments are those of `identify`. ValueError: the data are unfit for identification, or do not tell the kinds of
    seals apart.
    """
    of_sources, kinds = options.sources, options.kinds
    if kinds:
        of_sources = replace(of_sources, chambers=tuple(chamber for kind in kinds for chamber in kind.chambers))
    sources = read_sources(paths, of_sources, workers)
    ring = _ring(sources, options)
    prepared = _prepared(sources, kinds)
    _check_one_seal(diagnostics.shared_levels(prepared.readings), options.refuse_changed)
    correction = _correction(prepared.readings, sources.has_fitted_load)
    if correction is not None and correction.is_significant:
        sources = sources.corrected(correction)
        prepared = _prepared(sources, kinds)
    warmth = fit_temperature(prepared.readings)
    if warmth is not None and not warmth.why_not:
        breakaway = prepared.breakaway
        prepared = prepared._replace(
            readings=at_reference(prepared.readings, warmth),
            breakaway=None if breakaway is None else at_reference(breakaway, warmth),
        )
    readings, outlier = prepared.readings, None
    if not readings.are_samples and not kinds:
        laws = [law for law in _candidates(readings) if law.law_type is PressurePowerLaw and law.fixed]
        outlier = diagnostics.outlying_level(laws, readings)
    used = readings if outlier is None else readings.without(readings.level == outlier.level)
    return IdentificationData(sources, prepared, used, ring, outlier, correction, warmth)


def _prepared(sources: Sources, kinds: tuple[SealKind, ...]) -> PreparedReadings:
    """Readings of all sources; of several kinds of seals with those that tell them apart."""
    prepared = sources.prepare()
    if not kinds:
        return prepared
    where = ', '.join(prepared.readings.names)
    if any(source.log is None for source in sources.each):
        raise ValueError(
            f'{where}: a table of readings has one pressure, several kinds of seals need those of both chambers: '
            'give bags or logs'
        )
    if prepared.readings.free_rod is not None:
        raise ValueError(
            f'{where}: nothing but friction loads the rod, so the pressures are the effect of the friction and '
            'tell no kinds apart: load the rod and record the load, or drive with several supply or return pressures'
        )
    readings = seal_kinds.kinds_readings(prepared.readings, kinds)
    seal_kinds.check_kinds(readings)
    return prepared._replace(readings=readings)


def _correction(readings: FrictionReadings, has_fitted_load: bool) -> ForceCorrection | None:
    """Error of the areas; None without a load cell, where the pressures alone are the force."""
    if has_fitted_load:
        return None
    if not readings.kinds:
        return force_correction(readings)
    variation = variation_of(readings)
    return seal_kinds.area_errors(readings, Told(variation.speeds, variation.speeds, variation.asymmetry, areas=True))


def _told_apart(data: IdentificationData, selection: LawSelection, largest_error: float) -> seal_kinds.ToldApart | None:
    """How well the kinds of seals are told apart; None for one kind."""
    model = selection.fit.model
    if not data.used.kinds or model is None:
        return None
    found = seal_kinds.told_apart(model, data.used)
    seal_kinds.check_told_apart(found, model, data.used, largest_error)
    return found


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
        force = rounded_numbers(squeeze_force(geometry))
        normal_force = {'law': 'area_deformation_gain', 'area_deformation_gain': gain, 'radial_force': force}
    return Ring(geometry, parse_part(NormalForceLaw, {'normal_force': normal_force}, 'seal'))


def _check_one_seal(changes: Sequence[diagnostics.RunChange], refuse_changed: bool) -> None:
    """Check that sources may be runs of one seal."""
    if not changes:
        return
    middle = float(np.median([change.ratio for change in changes]))
    worst = max(changes, key=lambda change: change.ratio)
    most = 1.0 + diagnostics.CHANGED if refuse_changed else runs.ANOTHER_SEAL
    if (worst.ratio if refuse_changed else middle) > most:
        where = 'over their speeds and pressures' if worst.pressure is None else f'at {worst.pressure / BAR:.3g} bar'
        raise ValueError(
            f'{worst.name} and {worst.other_name} are two seals or two states of one: friction {worst.friction:.4g} N '
            f'and {worst.other_friction:.4g} N {where}, {100.0 * (worst.ratio - 1.0):.0f} % more, '
            f'where {100.0 * (most - 1.0):.0f} % is the most for runs of one seal: identify each separately'
        )


def _candidates(readings: FrictionReadings, ring: Ring | None = None) -> tuple[CandidateLaw, ...]:
    return candidate_laws(variation_of(readings), *(ring or ()))


def select_law(
    data: IdentificationData, name: str | None, workers: Workers = 1, work: Path | None = None
) -> LawSelection:
    """Fit and score every candidate law; select the recommended one, or the one called ``name``; the rest as above.

    ValueError: no law could be fitted, the selected one predicts nothing, or there is no law of that name.
    """
    with progress('fit and leave out', len(_candidates(data.used, data.ring)) + MOST_EXTENSIONS) as advance:
        scores = _scored(data.used, data.ring, data.sources.has_fitted_load, advance)
    best = recommended(scores, rises=rises_over_pressures(data.used))
    readings, share, is_no_run_in = data.used, np.ones(data.used.count), False
    offsets = fitting.offsets_of(readings, best.fit.friction(readings.at))
    settled = run_in.settled_readings(
        readings, offsets, law_of_all_terms(_variation(readings, data.sources.has_fitted_load), data.used.kinds)
    )
    if settled is not None and len(data.used.levels) >= FEWEST_TO_COMPARE:
        of_settled = _scored(settled.readings, data.ring, data.sources.has_fitted_load)
        best_settled = recommended(of_settled, rises=rises_over_pressures(settled.readings))
        if best_settled.mean_loss <= (1.0 + worthwhile(best.losses)) * best.mean_loss:
            scores, best, (readings, share, _) = of_settled, best_settled, settled
        else:
            settled, is_no_run_in = None, True
    by_name: dict[str | None, LawScore | NotScored] = {score.law.name: score for score in scores}
    by_name[None] = best
    if name not in by_name:
        raise ValueError(f'--law {name!r} is not one of {", ".join(score.law.name for score in scores)}')
    selected = by_name[name]
    if isinstance(selected, NotScored):
        raise ValueError(f'law {name} was not fitted: {selected.why_not}')
    if not selected.validation.error <= LARGEST_ERROR:
        raise ValueError(
            f'{", ".join(data.used.names)}: no law predicts these readings: {selected.law.name} is off by '
            f'{100.0 * selected.validation.error:.0f} % on left-out readings: measure more strokes at each pressure, '
            'in both directions, with a settled seal'
        )
    anew = None
    if name is None and not readings.are_samples:  # a swept log would take minutes
        anew = _choose_anew(data, readings, workers, work)
        anew = anew._replace(predicted=anew.predicted / share)
    fit, settled_law = selected.fit, None
    if settled is not None:
        fit, of_settled_seal = (fitting.fit(fit.law, each, fit.values) for each in (data.used, settled.readings))
        settled_law = run_in.SettledLaw(of_settled_seal, settled.relative_std, settled.readings)
    return LawSelection(
        readings=readings,
        scores=scores,
        best=best,
        fit=fit,
        settled=settled_law,
        is_no_run_in=is_no_run_in,
        validation=run_in.as_measured(selected.validation, share),
        reference=validation.plain_mean(data.used),
        chosen_anew=anew,
    )


def _choose_anew(
    data: IdentificationData, readings: FrictionReadings, workers: Workers, work: Path | None
) -> ChosenAnew:
    """Prediction of each group by a law chosen without it; the groups are parts of the work."""
    ring, has_fitted_load = data.ring, data.sources.has_fitted_load
    known = content_of([readings, ring, has_fitted_load])

    def run(calls: Sequence[Callable[[], LeftOut]]) -> list[LeftOut]:
        """Results of the calls, one for each group, kept in the work folder."""
        parts = [
            Part(part_key('choose without', [known, content_of(out)]), LeftOut._fields, call)
            for out, call in zip(readings.groups, calls, strict=True)
        ]
        return [LeftOut(**found) for found in run_parts('choose without', parts, workers, work)]

    return choose_anew(readings, partial(_recommended, ring=ring, has_fitted_load=has_fitted_load), run)


def _recommended(readings: FrictionReadings, ring: Ring | None, has_fitted_load: bool) -> LawScore:
    """Recommended law for the readings that are left."""
    scores = _scored(with_predictable_groups(readings), ring, has_fitted_load)
    return recommended(scores, rises=rises_over_pressures(readings))


def _scored(
    readings: FrictionReadings, ring: Ring | None, has_fitted_load: bool, tick: validation.Ticks = lambda _: None
) -> tuple[LawScore | NotScored, ...]:
    variation = _variation(readings, has_fitted_load)
    return score_ladder(candidate_laws(variation, *(ring or ())), readings, variation, tick)


def _variation(readings: FrictionReadings, has_fitted_load: bool) -> Variation:
    """What the readings vary; asymmetry is not identifiable beside a fitted load, which holds it."""
    found = variation_of(readings)
    return found._replace(asymmetry=found.asymmetry and not has_fitted_load)


def assess(
    data: IdentificationData,
    selection: LawSelection,
    run_to_run: float | None,
    told: seal_kinds.ToldApart | None = None,
) -> LawQuality:
    """Uncertainty of the selected law for readings of a new run; ``told`` is how well kinds are told apart."""
    used, found, left_out = data.used, selection.fit, selection.validation
    groups = len(used.groups)
    everything = data.prepared.readings
    offsets = fitting.offsets_of(everything, found.friction(everything.at))
    friction = found.friction(used.at)
    between = runs.between_runs(used, friction, fitting.offsets_of(used, friction))
    spread = between.of_band if run_to_run is None else run_to_run  # that a fit to all runs lacks
    if run_to_run is not None:
        between, of_band = between._replace(std=run_to_run), run_to_run
    elif data.used.left_out_by in ('test', 'file'):  # groups that are runs: what they deviate by contains it
        between, of_band = between._replace(std=0.0), 0.0
    else:
        of_band = between.of_band
    unseen = 0.0 if found.model else collinear_spread(selection.scores, found, used)
    settled, of_settled = selection.settled, None
    if found.model is None:
        both = math.hypot(of_band, unseen)
        uncertainty = validation.prediction_uncertainty(left_out.predicted, left_out.deviation, groups, both)
    else:
        uncertainty = validation.model_uncertainty(found.model, used, spread)
    if settled is not None:
        model = settled.fit.model
        of_settled = uncertainty if model is None else validation.model_uncertainty(model, settled.readings, spread)
        of_settled = of_settled._replace(relative=math.hypot(of_settled.relative, settled.relative_std))
    with progress('test the band', groups * (groups - 1)) as advance:
        coverage = validation.band_coverage(selection.law, selection.readings, found.values, advance)
    names = [parameter.name for parameter in selection.law.parameters]
    covariance = validation.covariance_of(
        found, left_out, used.at.pressure.shape[1], lambda each: [each[n] for n in names]
    )
    return LawQuality(
        uncertainty=uncertainty,
        of_settled=of_settled,
        between_runs=between,
        is_stated=run_to_run is not None,
        changes=diagnostics.shared_levels(everything) + diagnostics.swept_logs_compared(used, found),
        told_apart=unseen,
        kinds=told,
        coverage=coverage,
        calibration=calibration(selection.law, selection.readings, found.values, run_to_run),
        repeatability=diagnostics.repeatability(used, found.offsets),
        drifts=[] if used.are_samples else run_in.drifts(everything, offsets),
        breakaway=_breakaway(data, found),
        standard_errors=dict(zip(names, np.sqrt(np.diag(covariance)).tolist(), strict=True)),
    )


def _breakaway(data: IdentificationData, found: fitting.LawFit) -> BreakawayFit | None:
    readings = data.prepared.breakaway
    if readings is not None and data.outlier is not None:
        readings = readings.taken(readings.level != data.outlier.level)
    if readings is None or len(readings.groups) < 2:
        return None
    return fit_breakaway(readings, found.law.coulomb_friction(readings.at, found.values), found.offsets)


def _levels(
    data: IdentificationData, selection: LawSelection, quality: LawQuality, mounted: tuple[MountedSeal, ...]
) -> tuple[PressureLevel, ...]:
    """Measured and fitted friction at each pressure level, by the ``mounted`` seals."""
    readings = data.prepared.readings
    fitted, std = fitted_readings(mounted, readings.chamber_pressures, readings.at.velocity)
    measured = readings.magnitudes(fitting.offsets_of(readings, fitted))
    is_mean = readings.are_samples or bool(readings.kinds)  # a condition of several kinds holds several speeds
    unseen = np.full((data.used.count, 2), np.nan)
    unseen[:, 0] = selection.validation.predicted
    if selection.chosen_anew is not None:
        unseen[:, 1] = selection.chosen_anew.predicted
    predicted = data.used.level_means(unseen).tolist()
    if data.outlier is not None:
        predicted.insert(list(readings.levels).index(data.outlier.level), [data.outlier.expected] * 2)
    return tuple(
        PressureLevel(
            pressure=float(readings.seal_pressure[inside].mean()),
            speed=float(np.abs(readings.at.velocity[inside]).mean()),
            measured=float(measured[inside].mean()) if is_mean else readings.half_range(inside).friction,
            fitted=float(fitted[inside].mean()),
            std=float(std[inside].mean()),
            left_out=left_out,
            left_out_nested=nested,
            offset=math.nan if readings.are_samples else readings.half_range(inside).offset,
            readings=int(inside.sum()),
            drift=float(np.mean([d.change for d in quality.drifts if d.level == level] or [math.nan])),
            is_used=not data.is_outlier(level),
        )
        for (level, inside), (left_out, nested) in zip(readings.levels.items(), predicted, strict=True)
    )


def mounted_seals(documents: Mapping[str, Mapping[str, Any]]) -> tuple[MountedSeal, ...]:
    """Every seal of the seal files, mounted as they say."""
    each = [(parse_seal(document), document['mounting']['chambers']) for document in documents.values()]
    return tuple(MountedSeal(seal, chamber) for seal, chambers in each for chamber in chambers)


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
