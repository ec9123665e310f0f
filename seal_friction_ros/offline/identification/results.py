"""Records of an identification, and its documents: the seal file and the numbers for JSON."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, NamedTuple

import numpy as np

from seal_friction_ros.core.friction.force_sum_correction import ForceSumCorrection
from seal_friction_ros.core.friction.geometry import SealGeometry
from seal_friction_ros.core.friction.laws.normal_force import NormalForceLaw
from seal_friction_ros.core.friction.seal_file import law_document, parse_seal
from seal_friction_ros.core.identification import fitting
from seal_friction_ros.core.identification.admission import together
from seal_friction_ros.core.identification.breakaway import BreakawayFit
from seal_friction_ros.core.identification.calibration import Calibration
from seal_friction_ros.core.identification.candidate_laws import DIVIDED, CandidateLaw, SealKind, columns_of
from seal_friction_ros.core.identification.diagnostics import Outlier, RunChange
from seal_friction_ros.core.identification.force_correction import NOTICED, ForceCorrection
from seal_friction_ros.core.identification.load_over_position import LoadOverPosition, load_at
from seal_friction_ros.core.identification.readings import FrictionReadings, PreparedReadings
from seal_friction_ros.core.identification.run_in import Drift, SettledLaw
from seal_friction_ros.core.identification.runs import BetweenRuns
from seal_friction_ros.core.identification.seal_kinds import ToldApart, proposed_conditions
from seal_friction_ros.core.identification.selection import ChosenAnew, LawScore, NotScored, is_beaten, scored
from seal_friction_ros.core.identification.signal_preparation import LEVEL_GAP, LEVEL_GAP_MIN
from seal_friction_ros.core.identification.temperature import TemperatureFit
from seal_friction_ros.core.identification.validation import (
    CrossValidation,
    PredictionUncertainty,
    covariance_of,
)
from seal_friction_ros.offline.identification.presliding import (
    IdentifiedPresliding,
    presliding_numbers,
    presliding_part,
)
from seal_friction_ros.offline.identification.sources import Sources
from seal_friction_ros.offline.work.seal_writer import rounded_numbers

LOAD_POINTS = 21  # equally spaced positions at which the load is given (our choice)


class Ring(NamedTuple):
    """Ring of known geometry."""

    geometry: SealGeometry
    normal_force_law: NormalForceLaw


@dataclass(frozen=True, eq=False)
class IdentificationData:
    """Readings that the law is fitted to, and those that are excluded."""

    sources: Sources
    prepared: PreparedReadings  # every reading, including outliers
    used: FrictionReadings  # those that the law is fitted to
    ring: Ring | None
    outlier: Outlier | None
    correction: ForceCorrection | None  # made if it is significant; None if unknown
    temperature: TemperatureFit | None = None  # all readings are at its reference if it is identified

    @property
    def kinds(self) -> tuple[SealKind, ...]:
        """Kinds of seals; one without a name unless there are several."""
        return self.used.kinds or (SealKind('', self.sources.chambers),)

    def is_outlier(self, level: int) -> bool:
        """Whether a pressure level is the outlier, which the law is not fitted to."""
        return self.outlier is not None and level == self.outlier.level


@dataclass(frozen=True, eq=False)
class LawSelection:
    """All candidate laws with their scores, and the law that is saved."""

    readings: FrictionReadings  # that laws are chosen, left out and scored on: as measured, or of the settled seal
    scores: tuple[LawScore | NotScored, ...]  # on these readings
    best: LawScore  # recommended: the simplest law that no other law beats beyond the noise
    fit: fitting.LawFit  # to the readings as measured
    settled: SettledLaw | None  # that the seal file holds; None: that of the readings as measured
    is_no_run_in: bool  # whether a drift is evident, but the pressures agree less once corrected for it
    validation: CrossValidation  # of the readings as measured
    reference: CrossValidation | None
    """prediction by the mean of the other readings at the same pressure, without a law"""
    chosen_anew: ChosenAnew | None
    """prediction by laws chosen without each group; None for swept logs and for a law that the user names"""

    @property
    def law(self) -> CandidateLaw:
        """The law that is saved."""
        return self.fit.law

    @property
    def is_chosen_on_settled_seal(self) -> bool:
        """Whether scores and standard errors are of the settled seal."""
        return self.settled is not None and self.readings is self.settled.readings

    @property
    def fits_by_name(self) -> dict[str, fitting.LawFit]:
        """Fits of the saved law by what they are fitted to; the standard errors are those of the first."""
        if self.settled is None:
            return {'as measured': self.fit}
        both = [('settled seal', self.settled.fit), ('as measured', self.fit)]
        return dict(both if self.is_chosen_on_settled_seal else both[::-1])


@dataclass(frozen=True, eq=False)
class LawQuality:
    """Uncertainty of the selected law."""

    uncertainty: PredictionUncertainty  # standard deviation of a new reading, all seals
    of_settled: PredictionUncertainty | None  # the same of the settled seal; None without run-in
    between_runs: BetweenRuns
    """relative standard deviation between runs that is added to what readings left out deviate by"""
    is_stated: bool  # whether the user gave it
    changes: list[RunChange]  # of the friction from run to run, under the same conditions
    told_apart: float  # [-] relative spread of laws that the data cannot tell apart, added likewise
    coverage: float  # share of the left-out readings inside a 95 % band that was made without them
    calibration: Calibration  # share inside the band at each nominal share, within and between runs
    repeatability: float  # [-] scatter of repeated readings
    drifts: list[Drift]  # of the friction over each run
    breakaway: BreakawayFit | None  # None if no stroke starts from rest
    standard_errors: dict[str, float]  # of the parameters, by name
    kinds: ToldApart | None = None  # how well several kinds of seals are told apart; None for one kind


class PressureLevel(NamedTuple):
    """Measured and fitted friction at one pressure."""

    pressure: float  # [Pa, gauge] mean over seals and readings
    speed: float  # [m/s] mean; NaN if not measured
    measured: float  # [N] all seals
    fitted: float  # [N] all seals, by the law fitted to the readings as measured
    std: float  # [N] of a new reading, by that law
    left_out: float  # [N] prediction by the law fitted without these readings; they had a say in its choice
    left_out_nested: float  # [N] prediction by a law chosen and fitted without these readings; NaN if not done
    offset: float  # [N] of the force sum
    readings: int
    drift: float  # [-] relative change of the friction over the run; NaN if unknown
    is_used: bool  # false for an outlier, which the law is not fitted to


@dataclass(frozen=True, eq=False)
class Identification:
    """Result of an identification."""

    data: IdentificationData
    selection: LawSelection
    quality: LawQuality
    levels: tuple[PressureLevel, ...]
    documents: dict[str, dict[str, Any]]
    """kind -> seal file, one without a name unless there are several: of the settled seal, if a drift is evident"""
    as_measured: dict[str, dict[str, Any]]  # with the law of the readings as measured; the same without a drift
    warnings: tuple[str, ...]  # limits of the law that its user has to know
    remarks: tuple[str, ...]  # assumptions, and how an option changes them
    presliding: IdentifiedPresliding | None = None  # None if it was not asked for

    @property
    def document(self) -> dict[str, Any]:
        """Seal file of the first kind, which is the only one unless there are several."""
        return next(iter(self.documents.values()))


def seal_document(
    data: IdentificationData,
    selection: LawSelection,
    quality: LawQuality,
    name: str,
    number: int = 0,
    settled: SettledLaw | None = None,
    presliding: IdentifiedPresliding | None = None,
) -> dict[str, Any]:
    """Seal file of a kind of seals by the selected law, or by that for the ``settled`` seal, checked as by the node.

    The standard deviation is its share of that of all seals together, also at pressures that were not driven.
    ValueError: the law makes no valid seal.
    """
    seals, law, kind = len(data.sources.chambers), selection.law, data.kinds[number]
    values = rounded_numbers(law.of_one_seal((selection.fit if settled is None else settled.fit).values)[number])
    of_settled = '' if settled is None else ', of the settled seal'
    of_kind = f'{kind.name} fitted together with the other kinds of seals of the cylinder: ' if kind.name else ''
    new_reading = quality.of_settled or quality.uncertainty
    files = ', '.join(file.name for file in data.sources.files)
    document: dict[str, Any] = {
        'name': name,
        'source': f'Made by seal_friction identify from {files}: {of_kind}law {law.name} ({law.formula}){of_settled}, '
        f'parameters by least squares over {data.used.count} readings, uncertainty from readings left out.',
    }
    document['mounting'] = {'chambers': list(kind.chambers)}
    if data.ring is not None:
        document['geometry'] = asdict(data.ring.geometry)
    document |= law_document(law.friction_law(values))
    terms = {key: values[key] for key in law.velocity_terms}
    if terms:
        document['velocity_terms'] = terms
    stiction, ratio = (
        (terms.get('stribeck_friction', 0.0), 0.0) if quality.breakaway is None else quality.breakaway[1:3]
    )
    uncertainty = {'relative_std': new_reading.relative, 'absolute_std': new_reading.absolute / seals}
    numbers = {'stiction': stiction, 'stiction_ratio': ratio, 'uncertainty': uncertainty}
    document |= rounded_numbers({**numbers, 'identified_pressure': _identified_pressure(data, number)})
    speed = np.abs(data.used.at.velocity)
    if np.isfinite(speed).all():
        document['identified_speed'] = rounded_numbers([float(speed.min()), float(speed.max())])
    document['identified_directions'] = [int(side) for side in np.unique(data.used.at.direction)]
    lacking = _what_the_force_sum_lacks(data, selection.fit)
    if lacking is not None:
        document['force_sum_correction'] = asdict(lacking)
    warmth = data.temperature
    if warmth is not None and not warmth.why_not:
        document['temperature'] = rounded_numbers(asdict(warmth.scale))
    document['covariance'] = rounded_numbers(_covariance(selection, number))
    if presliding is not None:
        document['presliding'] = rounded_numbers(presliding_part(presliding))
    parse_seal(document)
    return document


def _covariance(selection: LawSelection, number: int) -> dict[str, Any]:
    """Covariance of the parameters of one seal of a kind; of a term that is none: its prior."""
    law, model = selection.law, selection.fit.model
    terms = list(dict.fromkeys(p.name.rpartition('.')[2] for p in law.parameters))  # without the name of a kind
    seals = selection.readings.at.pressure.shape[1]

    def of_one_seal(values: Mapping[str, float]) -> list[float]:
        """Terms of one seal."""
        of_one = law.of_one_seal(values)[number]
        return [of_one[term] for term in terms]

    covariance = covariance_of(selection.fit, selection.validation, seals, of_one_seal)
    std = np.sqrt(np.diag(covariance))
    none = {} if model is None else fitting.std_of_none(law, model, seals)
    of_prior = law.of_one_seal(selection.fit.values | none)[number]
    std = np.array([max(of_prior[t], found) if t in none else found for t, found in zip(terms, std, strict=True)])
    correlation = np.clip(covariance / np.maximum(np.outer(std, std), 1e-300), -1.0, 1.0)
    return {'terms': terms, 'std': std, 'correlation': correlation[np.triu_indices(len(terms), 1)]}


def _identified_pressure(data: IdentificationData, number: int) -> list[float]:
    """Lowest and highest pressure [Pa] at which the law holds: of the longer run of levels on one side of an outlier.

    Of two equally long runs the lower one counts (our choice). One held pressure is a range, too, as wide as
    pressures that count as one level.
    """
    everything, used = data.prepared.readings, data.used.at.pressure
    if data.outlier is not None:
        below, above = (
            everything.taken(side)
            for side in (everything.level < data.outlier.level, everything.level > data.outlier.level)
        )
        used = (above if len(above.levels) > len(below.levels) else below).at.pressure
    used = used[:, columns_of(data.kinds, number)]
    low, high = float(used.min()), float(used.max())
    if high - low <= (step := max(LEVEL_GAP * high, LEVEL_GAP_MIN)):  # one level
        return [max(low - step / 2.0, 0.0), high + step / 2.0]
    return [low, high]


def _what_the_force_sum_lacks(data: IdentificationData, fit: fitting.LawFit) -> ForceSumCorrection | None:
    """Area and offset of the logs, if they matter: at rest they would count as force on the rod; None otherwise.

    The load that was taken out of a log remains in the force sum of the node.
    """
    readings = data.used
    sources = [source for source, index in enumerate(readings.two_sided) if len(index)]
    if data.sources.each[0].log is None or not sources:
        return None
    offset = -float(np.mean(fit.offsets[sources]))
    friction = float(fit.friction(readings.at).mean())
    made = data.correction if data.correction is not None and data.correction.is_significant else None
    area_a, area_b = (0.0, 0.0) if made is None else rounded_numbers(made.areas)
    matters, contains_load = made is not None or abs(offset) >= NOTICED * friction, data.sources.has_fitted_load
    if not matters and not contains_load:
        return None
    zero = rounded_numbers(offset) if matters else 0.0
    return ForceSumCorrection(area_a=area_a, area_b=area_b, offset=zero, contains_load=contains_load)


def _without_nan(numbers: Mapping[str, Any]) -> dict[str, Any]:
    """Rounded numbers without those that are not known, at any depth."""
    return {
        key: _without_nan(value) if isinstance(value, Mapping) else value
        for key, value in rounded_numbers(numbers).items()
        if value is not None
    }


def identification_section(
    data: IdentificationData,
    selection: LawSelection,
    quality: LawQuality,
    levels: Sequence[PressureLevel],
    warnings: Sequence[str],
    presliding: IdentifiedPresliding | None = None,
) -> dict[str, Any]:
    """Section ``identification`` of the seal file, which records how it was made; the node ignores it."""
    measured, fitted = (rounded_numbers([getattr(level, name) for level in levels]) for name in ('measured', 'fitted'))
    section: dict[str, Any] = rounded_numbers(
        {
            'law': selection.law.name,
            'recommended_law': selection.best.law.name,
            'parameters': (selection.settled or selection).fit.values,
            'standard_errors': quality.standard_errors,
            'as_measured': {'parameters': selection.fit.values, 'relative_std': quality.uncertainty.relative},
            'seal_chambers': data.sources.chambers,
            'pressure_Pa': [level.pressure for level in levels],
            'measured_N': measured,
            'fitted_N': fitted,
            'residual_N': [one - other for one, other in zip(measured, fitted, strict=True)],
            'is_outlier': [not level.is_used for level in levels],
            'left_out_by': data.used.left_out_by,
            'cross_validation_error': selection.validation.error,
            'cross_validation_rms_N': selection.validation.rms,
            'band_coverage': quality.coverage,
            'repeatability': quality.repeatability,
            'readings': data.used.count,
            'data': [file._asdict() for file in data.sources.files],
            'warnings': warnings,
        }
    )
    loads = [_load_numbers(source.file.name, source.load) for source in data.sources.each if source.load is not None]
    section |= {'load': loads[0] | ({'others': loads[1:]} if loads[1:] else {})} if loads else {}
    return section if presliding is None else section | {'presliding': _without_nan(presliding_numbers(presliding))}


def _load_numbers(name: str, load: LoadOverPosition) -> dict[str, Any]:
    position = np.linspace(load.knots[0], load.knots[-1], LOAD_POINTS)
    position[-1] = load.knots[-1]
    numbers: dict[str, Any] = rounded_numbers(
        {
            'source': name,
            'position_m': position,
            'force_N': load_at(load, position),
            'std_N': np.interp(position, load.knots, load.std),
            'mass_kg': load.mass,
            'mass_std_kg': load.mass_std,
            'mass_change_kg_per_m': load.mass_change,
            'noise_N': load.noise,
            'strokes': load.strokes,
            'condition_number': load.condition_number,
            'friction_N': load.friction.mean,
            'friction_standard_error_N': load.friction.standard_error,
            'friction_terms': dict(zip(load.friction.names, load.friction.values.tolist(), strict=True)),
            'warnings': load.warnings,
        }
    )
    return numbers


def kind_section(data: IdentificationData, quality: LawQuality, number: int) -> dict[str, Any]:
    """What the section ``identification`` of the seal file of one of several kinds has in addition."""
    kind, told = data.kinds[number], quality.kinds
    if told is None:
        return {}
    return {
        'kind': kind.name,
        'friction_N': rounded_numbers(float(told.friction[number])),
        'std_of_this_kind_alone_N': rounded_numbers(float(told.apart_std[number])),
        'fitted_together_with': [other.name for other in data.kinds if other is not kind],
    }


def kinds_numbers(found: Identification) -> dict[str, Any]:
    """Numbers for JSON that several kinds of seals have in addition; empty for one kind."""
    readings, fit, told = found.data.used, found.selection.fit, found.quality.kinds
    if told is None or fit.model is None:
        return {}
    conditions, correlation = proposed_conditions(readings, fit.model)
    shared = {'friction_at_no_pressure_N' if name == DIVIDED[0] else name: value for name, value in fit.values.items()}
    names = ('friction_at_no_pressure_N', 'viscous_friction', 'stribeck_friction', 'stribeck_velocity', 'asymmetry')
    lacking = found.document.get('force_sum_correction', {})
    return {
        'kinds': [_kind_numbers(found, fit, told, number) for number in range(len(readings.kinds))],
        **{name: shared.get(name, 0.0) for name in names},
        'correlation': told.correlation,
        'pressure_a_Pa': readings.level_means(readings.chamber_pressures[:, 0]),
        'pressure_b_Pa': readings.level_means(readings.chamber_pressures[:, 1]),
        'area_correction_m2': [lacking.get(f'area_{chamber}', 0.0) for chamber in 'ab'],
        'offset_N': fit.offsets,
        'next': [{'pressure_a_Pa': c.a, 'pressure_b_Pa': c.b} for c in conditions],
        'next_correlation': correlation,
    }


def _kind_numbers(found: Identification, fit: fitting.LawFit, told: ToldApart, number: int) -> dict[str, Any]:
    readings, total = found.data.used, float(told.friction.sum())
    kind = readings.kinds[number]
    of_one = fit.law.of_one_seal(fit.values)[number]
    return {
        'name': kind.name,
        'seal_chambers': list(kind.chambers),
        'law': f'{kind.name}: f_0 + k P^{of_one["pressure_exponent"]:.3g}',
        'pressure_exponent': of_one['pressure_exponent'],
        'friction_at_one_bar': of_one['friction_at_one_bar'],
        'friction_N': float(told.friction[number]),
        'rising_N': float(told.rising[number]),
        'rising_standard_error_N': float(told.errors[number]),
        'division_std_N': float(told.division_std[number]),
        'share': float(told.friction[number]) / total,
        'share_std': float(told.apart_std[number]) / total,
        'pressure_correlation': float(told.together[number]),
        'pressure_Pa': readings.level_means(readings.at.pressure[:, columns_of(readings.kinds, number)].mean(axis=1)),
        'fitted_N': readings.level_means(fit.law.frictions(readings.at, fit.values)[:, number]),
    }


def identification_numbers(found: Identification) -> dict[str, Any]:
    """Numbers for JSON."""
    data, selection, quality, levels = found.data, found.selection, found.quality, found.levels
    reference = selection.reference
    numbers: dict[str, Any] = found.document['identification'] | rounded_numbers(
        {
            'std_N': [level.std for level in levels],
            'left_out_N': [level.left_out for level in levels],
            'worst_left_out_error': worst_left_out(levels),
            'left_out_nested_N': [level.left_out_nested for level in levels],
            'left_out_nested_laws': selection.chosen_anew and selection.chosen_anew.laws,
            'cross_validation_mean_deviation_N': selection.validation.mean_deviation,
            'ladder': [_ladder_row(score, selection) for score in selection.scores],
            'plain_mean_deviation_N': reference and reference.mean_deviation,
            'relative_std': found.document['uncertainty']['relative_std'],
            'absolute_std_N': quality.uncertainty.absolute,
            'condition_number': selection.fit.condition_number,
            'correlation': selection.fit.correlation.tolist(),
            'offset_N': [level.offset for level in levels],
            **_correction_numbers(data.correction),
            'between_run_std': quality.between_runs.std,
            'between_runs_measured': quality.between_runs.measured,
            'told_apart_std': quality.told_apart,
            'calibration': {name: getattr(quality.calibration, name).tolist() for name in Calibration._fields[:3]},
            'drift': [level.drift for level in levels],
            'settled': selection.settled
            and quality.of_settled
            and _settled_numbers(selection.settled, quality.of_settled),
            'run_in': _run_in_numbers(data, quality.drifts),
        }
    )
    return numbers | {
        'temperature': data.temperature and data.temperature._asdict(),
        'breakaway': quality.breakaway and _breakaway_numbers(found),
        'stiction': quality.breakaway and quality.breakaway._asdict(),
        'changes': [change._asdict() for change in quality.changes if change.is_changed],
        'load': found.document['identification'].get('load'),
        'presliding': found.document['identification'].get('presliding'),
        'samples_used': {one.name: one.used for one in data.prepared.accounts},
        'samples_total': {one.name: one.total for one in data.prepared.accounts},
        'samples_left_out': together(data.prepared.accounts).left_out,
        'remarks': list(found.remarks),
        **rounded_numbers(kinds_numbers(found)),
    }


def _correction_numbers(correction: ForceCorrection | None) -> dict[str, Any]:
    """The area that the force sum misses; None of each if it was not looked for."""
    if correction is None or correction.line is None:
        return dict.fromkeys(('area_correction_m2', 'area_correction', 'offset_line'))
    line = correction.line
    return {
        'area_correction_m2': correction.area,
        'area_correction': {
            'chamber': correction.chamber,
            'is_made': correction.is_significant,
            'standard_error_m2': correction.standard_error,
        },
        'offset_line': {'constant_N': line.constant, 'area_error_m2': line.area_error, 'rms_N': line.rms},
    }


def _run_in_numbers(data: IdentificationData, drifts: Sequence[Drift]) -> list[dict[str, Any]]:
    return [
        {
            'source': data.sources.files[drift.source].name,
            'pressure_Pa': data.prepared.readings.level_pressures[drift.level],
            **dict(zip(Drift._fields[2:], drift[2:], strict=True)),  # from the change on
        }
        for drift in drifts
    ]


def _settled_numbers(settled: SettledLaw, uncertainty: PredictionUncertainty) -> dict[str, Any]:
    """The settled seal: friction at each pressure in use, from its readings and by its law."""
    readings = settled.readings
    fitted = readings.level_means(settled.fit.friction(readings.at))
    return {
        'parameters': settled.fit.values,
        'relative_std_of_settling': settled.relative_std,
        'pressure_Pa': readings.level_pressures.tolist(),
        'measured_N': readings.half_ranges[0],
        'fitted_N': fitted,
        'std_N': uncertainty.std(fitted),
    }


def _breakaway_numbers(found: Identification) -> dict[str, Any]:
    """Law of the breakaway, and the breakaway force of all seals at each pressure, measured and by the law."""
    law, readings, fit = found.quality.breakaway, found.data.prepared.breakaway, found.selection.fit
    if law is None or readings is None:
        return {}
    measured = readings.magnitudes(fit.offsets)
    coulomb = fit.law.coulomb_friction(readings.at, fit.values)
    fitted = coulomb * (1.0 + law.ratio) + law.stiction * readings.at.pressure.shape[1]
    return {
        **law._asdict(),
        'standard_errors': list(law.standard_errors),
        'pressure_Pa': rounded_numbers(readings.level_pressures),
        'measured_N': rounded_numbers(readings.level_means(measured)),
        'fitted_N': rounded_numbers(readings.level_means(fitted)),
    }


def worst_left_out(levels: Sequence[PressureLevel]) -> float:
    """Largest relative deviation of a left-out prediction from the measured friction, over the levels in use [-]."""
    return max(abs(level.left_out / level.measured - 1.0) for level in levels if level.is_used)


def _ladder_row(score: LawScore | NotScored, selection: LawSelection) -> dict[str, Any]:
    row: dict[str, Any] = {'law': score.law.name, 'parameters': len(score.law.parameters)}
    if isinstance(score, NotScored):
        return row | {'why_not': score.why_not}
    best = min((each.validation.losses for each in scored(selection.scores)), key=np.mean)
    return row | {
        'values': score.fit.values,
        'rms_N': score.validation.rms,
        'mean_deviation_N': score.validation.mean_deviation,
        'error': score.validation.error,
        'is_beaten': is_beaten(score.validation.losses, best),
        'condition_number': score.fit.condition_number,
    }
