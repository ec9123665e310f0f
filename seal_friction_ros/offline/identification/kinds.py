"""Identification of several kinds of seals in one cylinder: sources -> readings -> one seal file for each kind."""

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.foundation.units import BAR, MM
from seal_friction_ros.core.friction.force_sum_correction import ForceSumCorrection
from seal_friction_ros.core.friction.seal_file import parse_seal
from seal_friction_ros.core.identification import runs
from seal_friction_ros.core.identification.breakaway import BreakawayFit, fit_breakaway
from seal_friction_ros.core.identification.force_correction import NOTICED
from seal_friction_ros.core.identification.readings import FrictionReadings
from seal_friction_ros.core.identification.several_kinds import (
    LARGEST_KIND_ERROR,
    KindsFit,
    KindsIdentification,
    SealKind,
    fit_kinds,
    kinds_readings,
    poorly_told_apart,
    proposed_conditions,
)
from seal_friction_ros.core.identification.validation import PredictionUncertainty, prediction_uncertainty
from seal_friction_ros.offline.identification.results import rounded_value
from seal_friction_ros.offline.identification.sources import SourceOptions, Sources, read_sources
from seal_friction_ros.offline.identification.wording import one_run_text

LARGEST_ERROR = 0.5  # out-of-sample error above which laws are not saved (our choice)


@dataclass(frozen=True, eq=False)
class SeveralKinds:
    """Result of an identification of several kinds of seals."""

    sources: Sources
    found: KindsIdentification
    uncertainty: PredictionUncertainty  # of a new reading of all seals, in a new run
    between_runs: runs.BetweenRuns
    is_stated: bool  # whether the spread between runs was given
    breakaway: BreakawayFit | None
    documents: dict[str, dict[str, Any]]  # kind -> seal file
    warnings: tuple[str, ...]

    @property
    def error(self) -> float:
        """Sum of the deviations of left-out readings over the sum of the friction [-]."""
        return _error(self.found)


def _error(found: KindsIdentification) -> float:
    return float(np.abs(found.deviation).sum() / np.abs(found.predicted + found.deviation).sum())


def identify_kinds(
    paths: Sequence[Path],
    options: SourceOptions,
    kinds: Sequence[SealKind],
    name: str,
    run_to_run: float | None = None,
    largest_error: float = LARGEST_KIND_ERROR,
) -> SeveralKinds:
    """Read bags or logs, fit all kinds together, and make a seal file for each.

    Args:
        paths: Bags and logs of one cylinder.
        options: On the sources; their chambers are those of the kinds.
        kinds: At least two, with different names.
        name: Of the seals; that of the kind is added.
        run_to_run: Relative standard deviation between runs, if it is known [-].
        largest_error: Standard error up to which a kind is told apart, a share of its friction [-].

    Raises:
        ValueError: The data are unfit, or they do not tell the kinds apart; one line with what to measure.
    """
    chambers = tuple(chamber for kind in kinds for chamber in kind.chambers)
    sources = read_sources(paths, replace(options, chambers=chambers))
    if any(source.log is None for source in sources.each):
        raise ValueError(
            f'{paths[0]}: a table of readings has one pressure, several kinds of seals need those of both chambers: '
            'give bags or logs'
        )
    prepared = sources.prepare()
    if prepared.readings.free_rod is not None:
        raise ValueError(
            f'{paths[0]}: nothing but friction loads the rod, so the pressures are the effect of the friction and '
            'tell no kinds apart: load the rod and record the load, or drive with several supply or return pressures'
        )
    data = kinds_readings(prepared.readings, prepared.chamber_pressures, kinds)
    found = fit_kinds(data, largest_error)
    if not _error(found) <= LARGEST_ERROR:
        raise ValueError(
            f'{", ".join(data.readings.names)}: no laws predict these readings: they are off by '
            f'{100.0 * _error(found):.0f} % on left-out readings: measure more strokes at each pressure'
        )
    readings = found.fit.corrected_readings()
    friction = found.fit.frictions(readings.at).sum(axis=1)
    between = runs.between_runs(readings, friction, found.fit.model.offsets)
    if run_to_run is not None:
        between = between._replace(std=run_to_run)
    of_band = run_to_run if run_to_run is not None else between.of_band
    band = prediction_uncertainty(found.predicted, found.deviation, len(readings.groups), of_band)
    breakaway = None
    if prepared.breakaway is not None and len(prepared.breakaway.groups) >= 2:
        coulomb = found.fit.coulomb_friction(prepared.breakaway.at)
        breakaway = fit_breakaway(prepared.breakaway, coulomb, found.fit.model.offsets)
    documents = {
        kind.name: _seal_document(sources, found, k, band, breakaway, f'{name}_{kind.name}')
        for k, kind in enumerate(kinds)
    }
    result = SeveralKinds(sources, found, band, between, run_to_run is not None, breakaway, documents, ())
    return replace(result, warnings=tuple(_warnings_of(result)))


def _value(value: float) -> float:
    return rounded_value(float(value))


def law_texts(fit: KindsFit) -> list[str]:
    """Law of each kind, in words."""
    values = {'viscous': fit.model.viscous, 'Stribeck': fit.model.stribeck[0], 'asymmetry': fit.model.asymmetry}
    terms = ''.join(f' + {name}' for name, value in values.items() if value)
    kinds = zip(fit.data.kinds, fit.model.exponents, strict=True)
    return [f'{kind.name}: f_0 + k P^{m:.3g}{terms}' for kind, m in kinds]


def _seal_document(
    sources: Sources,
    found: KindsIdentification,
    number: int,
    band: PredictionUncertainty,
    breakaway: BreakawayFit | None,
    name: str,
) -> dict[str, Any]:
    """Seal file of one kind, checked as the node checks it.

    Its standard deviation is its share of that of all seals together, also at pressures that were not driven; that of
    the kind alone is in the section ``identification``.

    Raises:
        ValueError: The law makes no valid seal.
    """
    fit, kind = found.fit, found.fit.data.kinds[number]
    seals, readings = len(kind.chambers), fit.data.readings
    of_kind = float(fit.frictions(readings.at)[:, number].mean())
    share = float(fit.division[number]) / seals
    everyone = readings.at.pressure.shape[1]
    relative = float(np.hypot(band.relative, found.unseen_std))
    pressure = readings.at.pressure[:, fit.data.columns_of(number)]
    files = ', '.join(file.name for file in sources.files)
    document: dict[str, Any] = {
        'name': name,
        'source': f'Made by seal_friction identify from {files}: {kind.name} fitted together with the other kinds of '
        'seals of the cylinder, by least squares, uncertainty from readings left out.',
        'mounting': {'chambers': list(kind.chambers)},
        'coulomb_law': 'pressure_power_law',
        'pressure_power_law': {
            'friction_at_no_pressure': _value(share * fit.model.constant),
            'friction_at_one_bar': _value(fit.model.rises[number]),
            'pressure_exponent': _value(fit.model.exponents[number]),
        },
    }
    falling, speed_of_fall = fit.model.stribeck
    terms = {'viscous_friction': share * fit.model.viscous, 'asymmetry': fit.model.asymmetry}
    terms |= {'stribeck_friction': share * falling, 'stribeck_velocity': speed_of_fall} if falling else {}
    if any(terms.values()):
        document['velocity_terms'] = {term: _value(value) for term, value in terms.items()}
    document |= {
        'stiction': _value(breakaway.stiction) if breakaway else 0.0,
        'stiction_ratio': _value(breakaway.ratio) if breakaway else 0.0,
        'uncertainty': {
            'relative_std': _value(relative),
            'absolute_std': _value(band.absolute / everyone),
        },
        'identified_pressure': [_value(pressure.min()), _value(pressure.max())],
    }
    speed = np.abs(readings.at.velocity)
    if np.isfinite(speed).all():
        document['identified_speed'] = [_value(speed.min()), _value(speed.max())]
    document['identified_directions'] = [int(side) for side in np.unique(readings.at.direction)]
    correction = _correction(fit, contains_load=sources.has_fitted_load)
    if correction is not None:
        document['force_sum_correction'] = asdict(correction)
    document['identification'] = {
        'kind': kind.name,
        'friction_N': _value(of_kind),
        'std_of_this_kind_alone_N': _value(found.apart_std[number]),
        'fitted_together_with': [other.name for other in fit.data.kinds if other is not kind],
        'readings': readings.count,
        'data': [file._asdict() for file in sources.files],
    }
    parse_seal(document)
    return document


def _correction(fit: KindsFit, *, contains_load: bool) -> ForceSumCorrection | None:
    """Areas and offset that the force sum lacks, if they matter; the same in the file of each kind."""
    readings = fit.data.readings
    two_sided = [source for source, index in enumerate(readings.two_sided) if len(index)]
    offset = -float(np.mean(fit.model.offsets[two_sided])) if two_sided else 0.0
    matters = fit.model.areas.any() or abs(offset) >= NOTICED * float(fit.frictions(readings.at).sum(axis=1).mean())
    if not matters and not contains_load:
        return None
    area_a, area_b = (_value(-area) for area in fit.model.areas)
    zero = _value(offset) if matters else 0.0
    return ForceSumCorrection(area_a=area_a, area_b=area_b, offset=zero, contains_load=contains_load)


def shares(found: KindsIdentification) -> tuple[FloatArray, FloatArray]:
    """Share of each kind in the mean friction, and its standard deviation [-], shape (kinds,) each."""
    frictions = found.fit.frictions(found.fit.data.readings.at).mean(axis=0)
    return np.asarray(frictions / frictions.sum()), np.asarray(found.apart_std / frictions.sum())


def _warnings_of(result: SeveralKinds) -> Iterator[str]:
    fit, found = result.found.fit, result.found
    names = ' and '.join(kind.name for kind in fit.data.kinds)
    mean = float(fit.frictions(fit.data.readings.at).sum(axis=1).mean())
    constant, viscous = fit.model.constant, ' and the viscous friction' if fit.model.viscous else ''
    if constant > 0.0 or fit.model.viscous > 0.0:
        yield (
            f'the friction at no pressure, {constant:.3g} N of all seals ({100.0 * constant / mean:.0f} % of '
            f'the friction),{viscous} cannot be divided between {names} by any pressure of this cylinder: it is '
            'divided as the rest is: use the seal files together'
        )
    for name, friction, error in poorly_told_apart(found):
        yield (
            f'{name}: {friction:.3g} N with a standard error of {error:.2g} N, which --largest-kind-error lets pass: '
            'the sum of all kinds is better known than each: use the seal files in this cylinder only'
        )
    for kind, part in zip(fit.data.kinds, fit.model.parts.tolist(), strict=True):
        if part < 1e-3 * mean:
            yield f'{kind.name}: these data show no friction that rises with its pressure'
    if fit.model.areas.any():
        change = ' and '.join(
            f'{-1e6 * area:+.3g} mm2 for chamber {c}' for c, area in zip('ab', fit.model.areas, strict=True)
        )
        yield f'the areas in the force sum are off: {change}; the laws are fitted with the corrected areas'
    between = result.between_runs
    if between.std > 0.0 and not between.freedom and not result.is_stated:
        yield one_run_text(between)
    one_way = [
        n for n, index in zip(fit.data.readings.names, fit.data.readings.two_sided, strict=True) if not len(index)
    ]
    if one_way:
        yield f'{", ".join(one_way)}: readings in one direction only, so an offset of the force counts as friction'
    if float(found.together.max()) > 0.9:
        yield (
            f'the pressures of the kinds moved nearly together (correlation {float(found.together.max()):.2f}), so the '
            'kinds are told apart by little'
        )


def kinds_numbers(result: SeveralKinds) -> dict[str, Any]:
    """Numbers for JSON."""
    found, fit = result.found, result.found.fit
    readings = fit.corrected_readings()
    total = fit.frictions(readings.at).sum(axis=1)
    measured = readings.magnitudes(fit.model.offsets)
    conditions, correlation = proposed_conditions(fit.data, fit)

    means = partial(_level_means, readings)
    return {
        'law': '; '.join(law_texts(fit)),
        'kinds': [_kind_numbers(found, k) for k in range(len(fit.data.kinds))],
        'seal_chambers': list(result.sources.chambers),
        'friction_at_no_pressure_N': _value(fit.model.constant),
        'viscous_friction': _value(fit.model.viscous),
        'stribeck_friction': _value(fit.model.stribeck[0]),
        'stribeck_velocity': _value(fit.model.stribeck[1]),
        'asymmetry': _value(fit.model.asymmetry),
        'correlation': [[_value(value) for value in row] for row in found.correlation],
        'pressure_a_Pa': means(fit.data.chamber_pressures[:, 0]),
        'pressure_b_Pa': means(fit.data.chamber_pressures[:, 1]),
        'measured_N': means(measured),
        'fitted_N': means(total),
        'std_N': means(result.uncertainty.std(total)),
        'left_out_N': means(found.predicted),
        'left_out_by': readings.left_out_by,
        'cross_validation_error': _value(result.error),
        'area_correction_m2': [_value(-area) for area in fit.model.areas],
        'offset_N': [_value(offset) for offset in fit.model.offsets],
        'between_run_std': _value(result.between_runs.std),
        'breakaway': result.breakaway and result.breakaway._asdict(),
        'readings': readings.count,
        'next': [{'pressure_a_Pa': _value(c.a), 'pressure_b_Pa': _value(c.b)} for c in conditions],
        'next_correlation': _value(correlation),
        'data': [file._asdict() for file in result.sources.files],
        'warnings': list(result.warnings),
        'remarks': list(result.sources.remarks),
    }


def _level_means(readings: FrictionReadings, values: FloatArray) -> list[float]:
    """Mean of one value per reading at each pressure level."""
    return [_value(values[inside].mean()) for inside in readings.levels.values()]


def _kind_numbers(found: KindsIdentification, k: int) -> dict[str, Any]:
    """Numbers of the kind of index ``k``."""
    fit, (share, share_std) = found.fit, shares(found)
    readings, kind = fit.corrected_readings(), fit.data.kinds[k]
    friction = fit.frictions(readings.at)[:, k]
    return {
        'name': kind.name,
        'seal_chambers': list(kind.chambers),
        'law': law_texts(fit)[k],
        'pressure_exponent': _value(fit.model.exponents[k]),
        'friction_at_one_bar': _value(fit.model.rises[k]),
        'friction_N': _value(friction.mean()),
        'rising_N': _value(fit.model.parts[k]),
        'rising_standard_error_N': _value(fit.model.errors[k]),
        'division_std_N': _value(found.division_std[k]),
        'share': _value(share[k]),
        'share_std': _value(share_std[k]),
        'pressure_correlation': _value(found.together[k]),
        'pressure_Pa': _level_means(readings, readings.at.pressure[:, fit.data.columns_of(k)].mean(axis=1)),
        'fitted_N': _level_means(readings, friction),
    }


def kinds_summary(result: SeveralKinds) -> str:
    """The result for a person."""
    found, fit = result.found, result.found.fit
    share, share_std = shares(found)
    frictions = fit.frictions(fit.data.readings.at).mean(axis=0)
    lines = ['  kind              seals on         friction [N]   share [%]   std of the share [%]']
    for k, kind in enumerate(fit.data.kinds):
        numbers = f'{frictions[k]:12.4g}  {100.0 * share[k]:10.3g}  {100.0 * share_std[k]:21.2g}'
        lines.append(f'  {kind.name:16}  {",".join(kind.chambers):16} {numbers}')
    lines += [f'law of {text}' for text in law_texts(fit)]
    lines += [f'left-out readings: off by {100.0 * result.error:.1f} % ({fit.data.readings.left_out_by} left out)']
    conditions, correlation = proposed_conditions(fit.data, fit)
    if conditions:
        pairs = ', '.join(f'{c.a / BAR:.3g} and {c.b / BAR:.3g}' for c in conditions)
        change = f'correlation of the pressures {float(found.together.max()):.2f} -> {correlation:.2f}'
        lines += [f'next: chambers a and b at {pairs} bar, both directions: {change}']
    lines += [f'note: {remark}' for remark in result.sources.remarks]
    lines += [f'warning: {warning}' for warning in result.warnings]
    return '\n'.join(lines)


def next_runs_text(result: SeveralKinds) -> str:
    """CSV of the chamber pressures to drive next, one row each, at the mean speed of the readings.

    A log holds the readings of several kinds, so the rows are driven while recording, and nothing is filled in.
    """
    found, readings = result.found, result.found.fit.data.readings
    conditions, correlation = proposed_conditions(found.fit.data, found.fit)
    before = float(found.together.max())
    speed = float(np.nan_to_num(np.abs(readings.at.velocity)).mean()) / MM
    lines = [
        '# Next runs of a cylinder with several kinds of seals: hold both pressures, drive ten strokes in each',
        '# direction, and record each row; then give these and all earlier logs to identify.',
        f'# Correlation of the pressures of the kinds: {before:.2f} now, {min(correlation, before):.2f} with these.',
    ]
    if not conditions:
        lines.append('# The pressures tell the kinds apart as well as this cylinder can: repeat runs on another day.')
    rows = [f'{c.a / BAR:.6g},{c.b / BAR:.6g},{speed:.3g}' for c in conditions]
    return '\n'.join([*lines, 'pressure_a_bar,pressure_b_bar,speed_mm_per_s', *rows]) + '\n'


def seal_files(out: Path, kinds: Sequence[str]) -> dict[str, Path]:
    """Kind -> its seal file: the name of the kind is added to that of ``out``."""
    return {kind: out.with_name(f'{out.stem}_{kind}{out.suffix}') for kind in kinds}
