"""Documents of an identification: the seal file, and the numbers for JSON."""

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

from seal_friction_ros.core.friction.seal_file import law_document, parse_seal
from seal_friction_ros.core.identification.fitting import LawScore, is_beaten
from seal_friction_ros.offline.identification.results import (
    Identification,
    IdentificationData,
    LawQuality,
    LawSelection,
    PressureLevel,
)
from seal_friction_ros.offline.work.seal_writer import rounded

DIGITS = 6  # of a number in a seal file


def rounded_value(value: float) -> float:
    """A number as a seal file of an identification has it."""
    return rounded(value, DIGITS)


def _finite_or_none(value: float) -> float | None:
    return rounded_value(value) if math.isfinite(value) else None


# -- seal file --------------------------------------------------------------------------------------------------------


def seal_document(data: IdentificationData, selection: LawSelection, quality: LawQuality, name: str) -> dict[str, Any]:
    """Seal file of the selected law, checked as the node checks it.

    Raises:
        ValueError: The law makes no valid seal.
    """
    seals = len(data.sources.chambers)
    values = {key: rounded_value(value) for key, value in selection.fit.values.items()}
    pressure = data.used.at.pressure
    document: dict[str, Any] = {'name': name, 'source': _source_text(data, selection)}
    if data.ring is not None:
        document['geometry'] = dataclasses.asdict(data.ring.geometry)
    document |= law_document(selection.law.friction_law(values))
    stiction, ratio = (0.0, 0.0) if quality.breakaway is None else quality.breakaway[1:3]
    terms = {key: values[key] for key in selection.law.velocity_terms}
    if terms:
        document['velocity_terms'] = terms
        if quality.breakaway is None:
            stiction = terms.get('stribeck_friction', 0.0)
    document['stiction'] = rounded_value(stiction)
    document['stiction_ratio'] = rounded_value(ratio)
    document['uncertainty'] = {
        'relative_std': rounded_value(quality.uncertainty.relative),
        'absolute_std': rounded_value(quality.uncertainty.absolute / seals),
    }
    document['identified_pressure'] = [rounded_value(float(pressure.min())), rounded_value(float(pressure.max()))]
    parse_seal(document)
    return document


def _source_text(data: IdentificationData, selection: LawSelection) -> str:
    files = ', '.join(data.sources.files[i].name for i in data.kept)
    return (
        f'Made by seal_friction identify from {files}: law {selection.law.name} ({selection.law.formula}), parameters '
        f'by least squares over {data.used.count} readings, uncertainty from readings left out.'
    )


def identification_section(
    data: IdentificationData,
    selection: LawSelection,
    quality: LawQuality,
    levels: Sequence[PressureLevel],
    warnings: Sequence[str],
) -> dict[str, Any]:
    """Section ``identification`` of the seal file, which records how it was made; the node ignores it."""
    return {
        'law': selection.law.name,
        'recommended_law': selection.best.law.name,
        'parameters': {key: rounded_value(value) for key, value in selection.fit.values.items()},
        'standard_errors': {key: rounded_value(value) for key, value in quality.standard_errors.items()},
        'seal_chambers': list(data.sources.chambers),
        'pressure_Pa': [rounded_value(level.pressure) for level in levels],
        'measured_N': [rounded_value(level.measured) for level in levels],
        'fitted_N': [rounded_value(level.fitted) for level in levels],
        'residual_N': [rounded_value(rounded_value(level.measured) - rounded_value(level.fitted)) for level in levels],
        'is_outlier': [not level.is_used for level in levels],
        'left_out_by': data.used.left_out_by,
        'cross_validation_error': rounded_value(selection.validation.error),
        'cross_validation_rms_N': rounded_value(selection.validation.rms),
        'band_coverage': rounded_value(quality.coverage),
        'repeatability': _finite_or_none(quality.repeatability),
        'readings': data.used.count,
        'data': [data.sources.files[i]._asdict() for i in data.kept],
        'warnings': list(warnings),
    }


# -- JSON -------------------------------------------------------------------------------------------------------------


def identification_numbers(found: Identification) -> dict[str, Any]:
    """Numbers for JSON."""
    data, selection, quality, levels = found.data, found.selection, found.quality, found.levels
    reference, line = selection.reference, quality.offset_line
    return {
        **found.document['identification'],
        'std_N': [rounded_value(level.std) for level in levels],
        'left_out_N': [rounded_value(level.left_out) for level in levels],
        'worst_left_out_error': rounded_value(worst_left_out(levels)),
        'cross_validation_mean_deviation_N': rounded_value(selection.validation.mean_deviation),
        'ladder': [_ladder_row(score, selection) for score in selection.scores],
        'plain_mean_deviation_N': None if reference is None else rounded_value(reference.mean_deviation),
        'relative_std': rounded_value(quality.uncertainty.relative),
        'absolute_std_N': rounded_value(quality.uncertainty.absolute),
        'condition_number': _finite_or_none(selection.fit.condition_number),
        'correlation': [[_finite_or_none(float(x)) for x in row] for row in selection.fit.correlation],
        'offset_N': [_finite_or_none(level.offset) for level in levels],
        'offset_line': line
        and dict(zip(('constant_N', 'area_error_m2', 'rms_N'), map(rounded_value, line), strict=True)),
        'drift': [_finite_or_none(level.drift) for level in levels],
        'stiction': None if quality.breakaway is None else quality.breakaway._asdict(),
        'changes': [{**c._asdict(), 'is_change': c.is_change} for c in data.changes],
        'samples_used': data.prepared.used,
        'samples_total': data.prepared.total,
        'samples_left_out': data.prepared.left_out,
        'data': [file._asdict() for file in data.sources.files],
        'remarks': list(found.remarks),
    }


def worst_left_out(levels: Sequence[PressureLevel]) -> float:
    """Largest relative deviation of a left-out prediction from the measured friction, over the levels in use [-]."""
    return max(abs(level.left_out / level.measured - 1.0) for level in levels if level.is_used)


def _ladder_row(score: LawScore, selection: LawSelection) -> dict[str, Any]:
    row: dict[str, Any] = {'law': score.law.name, 'parameters': len(score.law.parameters)}
    if score.validation is None or score.fit is None:
        return row | {'why_not': score.why_not}
    best = min((s.validation for s in selection.scores if s.validation), key=lambda v: float(v.losses.mean()))
    return row | {
        'values': {key: rounded_value(value) for key, value in score.fit.values.items()},
        'rms_N': rounded_value(score.validation.rms),
        'mean_deviation_N': rounded_value(score.validation.mean_deviation),
        'error': rounded_value(score.validation.error),
        'is_beaten': is_beaten(score.validation.losses, best.losses),
        'condition_number': _finite_or_none(score.fit.condition_number),
    }
