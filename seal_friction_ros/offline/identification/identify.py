"""Sources -> a seal file: the law that the data carry, how sure it is, and what the data cannot tell.

A fit that failed or means nothing is an error and never a file. Nothing is drawn by chance, and every number is rounded
to six digits before anything follows from it, so the same sources give the same bytes.
"""

import dataclasses
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.foundation.parameters import from_mapping
from seal_friction_ros.core.foundation.units import BAR
from seal_friction_ros.core.friction.actuator import MountedSeal, actuator_friction
from seal_friction_ros.core.friction.geometry import SealGeometry
from seal_friction_ros.core.friction.laws.normal_force import NormalForceLaw, squeeze_force
from seal_friction_ros.core.friction.seal_file import law_document, parse_normal_force, parse_seal
from seal_friction_ros.core.identification.fitting import (
    CHANGED,
    ILL_CONDITIONED,
    SETTLED,
    Change,
    CrossValidation,
    Fit,
    Outlier,
    Score,
    Spread,
    Stiction,
    band_coverage,
    between_runs,
    changed_levels,
    climb,
    collinear_regressors,
    compare_with_law,
    fit,
    identify_stiction,
    is_beaten,
    offsets_of,
    outlying_level,
    plain_mean,
    recommended,
    repeatability,
    run_drift,
    spread_of,
    standard_errors,
    traded_off,
)
from seal_friction_ros.core.identification.ladder import Rung, ladder, normal_forces
from seal_friction_ros.core.identification.readings import Prepared, Readings, level_friction
from seal_friction_ros.core.identification.signal_preparation import OffsetLine, offset_line
from seal_friction_ros.files import config_path, read_yaml
from seal_friction_ros.offline.identification.sources import Choices, Sources, read_sources
from seal_friction_ros.offline.work.progress import progress
from seal_friction_ros.offline.work.seal_writer import rounded

DIGITS = 6  # that a number in a seal file has
PRESSURES_FOR_AN_EXPONENT = 6  # fewer do not tell one, once each is left out in turn (our choice)
SPEEDS_DIFFER = 1.5  # fastest over slowest reading from which on terms of the velocity are tried (our choice)
MEANINGLESS = 0.5  # out-of-sample error from which on a law is not worth a file (our choice)
REFERENCE_SEAL = 'ms28775_114'  # its area deformation gain, from finite elements, is taken where there is no other


@dataclass(frozen=True, kw_only=True)
class Wishes:
    """What a person may say of the identification."""

    sources: Choices = dataclasses.field(default_factory=Choices)
    seal: str | None = None
    """seal file with the geometry of the ring, and its normal force: a path, or the name of one in config/seals"""
    squeeze_force: bool = False
    """normal force from the geometry, even if the seal file has one"""
    law: str | None = None
    """rung to save instead of the recommended one"""
    run_to_run: float | None = None
    """[-] relative standard deviation between runs, where it is known from elsewhere"""
    name: str = ''
    """of the seal; empty: the name of the file that is written"""


class Ring(NamedTuple):
    """What is known of the ring beforehand."""

    geometry: SealGeometry
    normal_force: dict[str, Any]
    """as a seal file has it"""


@dataclass(frozen=True, eq=False)
class Data:
    """What the law is fitted to, and what was kept from it."""

    sources: Sources
    prepared: Prepared
    """every reading of the sources that agree, outliers too"""
    used: Readings
    """without outliers"""
    ring: Ring | None
    outlier: Outlier | None
    changes: tuple[Change, ...]
    """each further swept log against the law of the first"""
    kept: tuple[int, ...]
    """sources behind ``prepared``"""


@dataclass(frozen=True, eq=False)
class Choice:
    """The ladder, and the rung that is saved."""

    scores: tuple[Score, ...]
    best: Score
    """the lowest rung that is not beaten beyond the noise"""
    fit: Fit
    validation: CrossValidation
    reference: CrossValidation | None
    """the mean of the other readings at the same pressure, in place of a law"""

    @property
    def rung(self) -> Rung:
        """The one that is saved."""
        return self.fit.rung


@dataclass(frozen=True, eq=False)
class Worth:
    """How far the law can be trusted."""

    spread: Spread
    """standard deviation of a new reading, all seals"""
    run_to_run: float
    """[-] part of it that the deviations cannot show: how far one run is off another"""
    is_drift: bool
    """whether the drift within the runs stands in for that"""
    coverage: float
    """share of left-out readings in a 95 % band that had not seen them"""
    repeatability: float
    """[-] scatter of repeated readings"""
    drift: dict[int, float]
    """pressure level -> relative change of the friction over its run"""
    stiction: Stiction | None
    """None where nothing started from rest"""
    offset_line: OffsetLine | None
    """offset of the force sum over pressure; None for swept logs and tables"""
    standard_errors: dict[str, float]


class Level(NamedTuple):
    """One pressure: measured against fitted."""

    pressure: float
    """[Pa, gauge] mean over seals and readings"""
    speed: float
    """[m/s] mean; NaN where it was not measured"""
    measured: float
    """[N] all seals"""
    fitted: float
    """[N] all seals, by the law of the file"""
    std: float
    """[N] for a new reading, by the law of the file"""
    left_out: float
    """[N] predicted by a law that has not seen these readings"""
    offset: float
    """[N] of the force sum"""
    readings: int
    drift: float
    """[-] change of the friction over the run; NaN where it is not known"""
    is_used: bool
    """false for an outlier, to which the law was not fitted"""


@dataclass(frozen=True, eq=False)
class Identification:
    """All that was found."""

    data: Data
    choice: Choice
    worth: Worth
    levels: tuple[Level, ...]
    document: dict[str, Any]
    """seal file"""
    warnings: tuple[str, ...]
    """what a user of the law has to know"""
    remarks: tuple[str, ...]
    """what was concluded, and can be said otherwise"""


def identify(paths: Sequence[Path], wishes: Wishes, name: str) -> Identification:
    """Read sources, fit every law, choose one, and say what it is worth.

    Args:
        paths: Bags, logs, tables or data sheets.
        wishes: What the person wants otherwise.
        name: Of the seal, unless the wishes name it.

    Raises:
        ValueError: The data are not fit to identify from, or no law means anything; one line that says what is wrong
            and what to measure instead.
    """
    data = gather(paths, wishes)
    choice = choose(data, wishes.law)
    worth = judge(data, choice, wishes.run_to_run)
    document = seal_document(data, choice, worth, wishes.name or name)
    levels = _levels(data, choice, worth, document)
    warnings = tuple(_warnings(data, choice, worth, levels))
    remarks = (*data.sources.remarks, *_remarks(data, choice))
    document['identification'] = _identification_part(data, choice, worth, levels, warnings)
    return Identification(data, choice, worth, levels, document, warnings, remarks)


# -- what goes in -----------------------------------------------------------------------------------------------------


def gather(paths: Sequence[Path], wishes: Wishes) -> Data:
    """Read the sources and put aside what does not belong to one state of one seal.

    Raises:
        ValueError: The data are not fit to identify from.
    """
    sources = read_sources(paths, wishes.sources)
    ring = _ring(sources, wishes)
    prepared, changes, kept = _one_state(sources)
    prepared = prepared._replace(readings=_with_normal_force(prepared.readings, ring))
    readings = prepared.readings
    outlier = _outlier(readings)
    used = readings if outlier is None else _counted_anew(readings.taken(readings.level != outlier.level))
    return Data(sources, prepared, used, ring, outlier, changes, kept)


def _ring(sources: Sources, wishes: Wishes) -> Ring | None:
    """Geometry and normal force of the ring, from the seal that is named, else from what a bag or sheet carries."""
    document, where = sources.seal_document, 'seal of the source'
    if wishes.seal is not None:
        path = config_path('seals', wishes.seal)
        document, where = read_yaml(path), str(path)
        if not isinstance(document, Mapping) or 'geometry' not in document:
            raise ValueError(f'{where}: no geometry in it: measure the ring and its groove, and write them there')
    if document is None or 'geometry' not in document:
        return None
    geometry = from_mapping(SealGeometry, document['geometry'], f'{where}: geometry')
    given = document.get('normal_force')
    if isinstance(given, Mapping) and not wishes.squeeze_force:
        return Ring(geometry, dict(given))
    reference = read_yaml(config_path('seals', REFERENCE_SEAL))['normal_force']['area_deformation_gain']
    force = _rounded(squeeze_force(geometry))
    law = {'law': 'area_deformation_gain', 'area_deformation_gain': reference, 'radial_force': force}
    return Ring(geometry, law)


def normal_force_law(document: Mapping[str, Any]) -> NormalForceLaw:
    """Law of the normal force from the part of a seal file.

    Raises:
        ValueError: It is not valid.
    """
    return parse_normal_force({'normal_force': document}, 'seal')


def _with_normal_force(readings: Readings, ring: Ring | None) -> Readings:
    if ring is None:
        return readings
    forces = normal_forces(readings.at.pressure, ring.geometry, normal_force_law(ring.normal_force))
    return dataclasses.replace(readings, at=readings.at._replace(normal_force=forces))


def _one_state(sources: Sources) -> tuple[Prepared, tuple[Change, ...], tuple[int, ...]]:
    """Readings of sources that agree, how each further swept log compares with the first, and which were kept.

    Sources with readings at held pressures make a law together, so a disagreement between them is an error that names
    it. A swept log makes a law by itself: the first is fitted, the others are scored on it, and one that has changed is
    not averaged in.
    """
    index = tuple(range(len(sources.files)))
    first = _if_swept(sources) if len(index) > 1 else None
    if first is None:
        together = sources.prepare()
        _refuse_changed_levels(together.readings)
        return together, (), index
    rungs = {rung.name: rung for rung in _rungs(first.readings)}
    law = fit(rungs.get('pressure_power_law_viscous', rungs['pressure_power_law']), first.readings)
    changes = tuple(compare_with_law(law, first.readings, sources.prepare([i]).readings) for i in index[1:])
    kept = (0, *(i for i, change in zip(index[1:], changes, strict=True) if not change.is_change))
    return (sources.prepare(kept) if len(kept) > 1 else first), changes, kept


def _if_swept(sources: Sources) -> Prepared | None:
    """The first source if it is a swept log; None for one of readings at held pressures, which may be too few alone."""
    try:
        first = sources.prepare([0])
    except ValueError:
        return None
    return first if first.readings.are_samples else None


def _refuse_changed_levels(readings: Readings) -> None:
    changes = changed_levels(readings)
    if changes:
        worst = max(changes, key=lambda c: abs(c.other_friction / c.friction - 1.0))
        raise ValueError(
            f'the friction has changed: {worst.friction:.4g} N in {worst.name} and {worst.other_friction:.4g} N in '
            f'{worst.other_name}, {100.0 * (worst.other_friction / worst.friction - 1.0):+.0f} %, both at '
            f'{worst.pressure / BAR:.3g} bar, where runs of one seal repeat within {100.0 * CHANGED:.0f} %: these are '
            'two seals or two states of one: identify each for itself'
        )


def _rungs(readings: Readings, ring: Ring | None = None) -> tuple[Rung, ...]:
    speed = np.abs(readings.at.velocity)
    with_speeds = bool(np.isfinite(speed).all()) and float(speed.max()) > SPEEDS_DIFFER * float(speed.min())
    with_exponent = readings.are_samples or len(np.unique(readings.level)) >= PRESSURES_FOR_AN_EXPONENT
    return ladder(
        geometry=ring.geometry if ring else None,
        normal_force_law=normal_force_law(ring.normal_force) if ring else None,
        with_speeds=with_speeds,
        with_exponent=with_exponent,
    )


def _outlier(readings: Readings) -> Outlier | None:
    """Pressure that disagrees with all others, if there are enough of them to say so."""
    if readings.are_samples or len(np.unique(readings.level)) < 4:
        return None
    rung = next(rung for rung in _rungs(readings) if rung.name == 'pressure_power_law')
    found = fit(rung, readings)
    floor = repeatability(readings, found.offsets)
    return outlying_level(rung, readings, found.values, floor if math.isfinite(floor) else 0.0)


def _counted_anew(readings: Readings) -> Readings:
    """Levels, and groups that are levels, counted from 0 again."""
    level = np.unique(readings.level, return_inverse=True)[1]
    group = level if readings.left_out_by == 'pressure' else readings.group
    return dataclasses.replace(readings, level=level, group=group)


# -- which law --------------------------------------------------------------------------------------------------------


def choose(data: Data, law: str | None) -> Choice:
    """Climb the ladder and take the lowest rung that is not beaten, or the one that is wished for.

    Raises:
        ValueError: No law could be fitted, or none means anything, or there is none of that name.
    """
    scores = _climbed(_rungs(data.used, data.ring), data.used)
    best = recommended(scores)
    chosen = best if law is None else _wished(scores, law)
    assert chosen.fit is not None  # noqa: S101
    assert chosen.validation is not None  # noqa: S101
    if not chosen.validation.error <= MEANINGLESS:
        raise ValueError(
            f'{", ".join(data.used.names)}: no law predicts these readings: {chosen.rung.name} is off by '
            f'{100.0 * chosen.validation.error:.0f} % on those that it has not seen: measure more strokes at each '
            'pressure, in both directions, with a settled seal'
        )
    return Choice(scores, best, chosen.fit, chosen.validation, plain_mean(data.used))


def _climbed(rungs: tuple[Rung, ...], readings: Readings) -> tuple[Score, ...]:
    with progress('fit and leave out', len(rungs) * (len(np.unique(readings.group)) + 1)) as advance:
        return climb(rungs, readings, advance)


def _wished(scores: tuple[Score, ...], law: str) -> Score:
    found = next((score for score in scores if score.rung.name == law), None)
    if found is None:
        raise ValueError(f'law {law!r} is not one of {", ".join(score.rung.name for score in scores)}')
    if not found.is_scored:
        raise ValueError(f'law {law} was not fitted: {found.why_not}')
    return found


# -- how far to trust it ----------------------------------------------------------------------------------------------


def judge(data: Data, choice: Choice, run_to_run: float | None) -> Worth:
    """Standard deviation for new readings, and what it was compared with."""
    used, found, validation = data.used, choice.fit, choice.validation
    groups = len(np.unique(used.group))
    everything = data.prepared.readings
    offsets = offsets_of(everything, found.friction(everything.at))
    drift = {} if used.are_samples else run_drift(everything, offsets)
    more, is_drift = _run_to_run(data, drift) if run_to_run is None else (run_to_run, False)
    with progress('test the band', groups * (groups - 1)) as advance:
        coverage = band_coverage(choice.rung, used, found.values, more, advance)
    names = [parameter.name for parameter in choice.rung.parameters]
    return Worth(
        spread_of(validation.predicted, validation.deviation, groups, more),
        more,
        is_drift,
        coverage,
        repeatability(used, found.offsets),
        drift,
        _stiction(data, found),
        _offset_line(everything),
        dict(zip(names, (float(e) for e in standard_errors(validation)), strict=True)),
    )


def _run_to_run(data: Data, drift: Mapping[int, float]) -> tuple[float, bool]:
    """Relative standard deviation between runs, where each pressure has runs of its own; and whether it is the drift.

    If pressures were repeated it is measured. If none was, how far the runs drifted stands in for it, root mean square:
    a seal that changes while it is measured is not the same when it is measured again. Runs of the Delft O-ring drift
    by 11 to 18 %, and repeat within 10 to 15 %. That the one stands in for the other is our choice.
    """
    if data.used.left_out_by != 'pressure' or data.used.are_samples or not data.used.samples:
        return 0.0, False
    measured = between_runs(data.used)
    if math.isfinite(measured):
        return measured, False
    kept = [change for level, change in drift.items() if data.outlier is None or level != data.outlier.level]
    return (math.sqrt(sum(change**2 for change in kept) / len(kept)), True) if kept else (0.0, False)


def _stiction(data: Data, found: Fit) -> Stiction | None:
    breakaway = data.prepared.breakaway
    if breakaway is None:
        return None
    breakaway = _with_normal_force(breakaway, data.ring)
    if data.outlier is not None:
        breakaway = breakaway.taken(breakaway.level != data.outlier.level)
    if len(np.unique(breakaway.group)) < 2:
        return None
    return identify_stiction(breakaway, found.rung.coulomb_friction(breakaway.at, found.values), found.offsets)


def _offset_line(readings: Readings) -> OffsetLine | None:
    if readings.are_samples or not readings.samples:
        return None
    levels = np.unique(readings.level)
    pressures = np.array([readings.seal_pressure[readings.level == level].mean() for level in levels])
    offsets = np.array([level_friction(readings, readings.level == level).offset for level in levels])
    return offset_line(pressures, offsets)


# -- the seal file ----------------------------------------------------------------------------------------------------


def _rounded(value: float) -> float:
    return rounded(value, DIGITS)


def _rounded_or_none(value: float) -> float | None:
    return _rounded(value) if math.isfinite(value) else None


def seal_document(data: Data, choice: Choice, worth: Worth, name: str) -> dict[str, Any]:
    """Seal file of a law, checked by making a seal of it.

    Raises:
        ValueError: The law makes no seal.
    """
    seals = len(data.sources.chambers)
    values = {key: _rounded(value) for key, value in choice.fit.values.items()}
    pressure = data.used.at.pressure
    document: dict[str, Any] = {'name': name, 'source': _source_text(data, choice)}
    if data.ring is not None:
        document['geometry'] = dataclasses.asdict(data.ring.geometry)
    document |= law_document(choice.rung.law(values))
    stiction, ratio = (0.0, 0.0) if worth.stiction is None else worth.stiction[1:3]
    terms = {key: values[key] for key in choice.rung.velocity_terms}
    if terms:
        document['velocity_terms'] = terms
        if worth.stiction is None:
            stiction = terms.get('stribeck_friction', 0.0)
    document['stiction'] = _rounded(stiction)
    document['stiction_ratio'] = _rounded(ratio)
    document['uncertainty'] = {
        'relative_std': _rounded(worth.spread.relative),
        'absolute_std': _rounded(worth.spread.absolute / seals),
    }
    document['identified_pressure'] = [_rounded(float(pressure.min())), _rounded(float(pressure.max()))]
    parse_seal(document)
    return document


def _source_text(data: Data, choice: Choice) -> str:
    files = ', '.join(data.sources.files[i].name for i in data.kept)
    return (
        f'Made by seal_friction identify from {files}: law {choice.rung.name} ({choice.rung.words}), parameters by '
        f'least squares over {data.used.count} readings, uncertainty from readings left out.'
    )


def _identification_part(
    data: Data, choice: Choice, worth: Worth, levels: Sequence[Level], warnings: Sequence[str]
) -> dict[str, Any]:
    """What the file says of its own making; the node passes it over."""
    return {
        'law': choice.rung.name,
        'recommended_law': choice.best.rung.name,
        'parameters': {key: _rounded(value) for key, value in choice.fit.values.items()},
        'standard_errors': {key: _rounded(value) for key, value in worth.standard_errors.items()},
        'seal_chambers': list(data.sources.chambers),
        'pressure_Pa': [_rounded(level.pressure) for level in levels],
        'measured_N': [_rounded(level.measured) for level in levels],
        'fitted_N': [_rounded(level.fitted) for level in levels],
        'residual_N': [_rounded(_rounded(level.measured) - _rounded(level.fitted)) for level in levels],
        'is_outlier': [not level.is_used for level in levels],
        'left_out_by': data.used.left_out_by,
        'cross_validation_error': _rounded(choice.validation.error),
        'cross_validation_rms_N': _rounded(choice.validation.rms),
        'band_coverage': _rounded(worth.coverage),
        'repeatability': _rounded_or_none(worth.repeatability),
        'readings': data.used.count,
        'data': [data.sources.files[i]._asdict() for i in data.kept],
        'warnings': list(warnings),
    }


# -- pressure by pressure ---------------------------------------------------------------------------------------------


def _levels(data: Data, choice: Choice, worth: Worth, document: Mapping[str, Any]) -> tuple[Level, ...]:
    readings, chambers = data.prepared.readings, data.prepared.chamber_pressures
    seal = parse_seal(document)
    mounted = tuple(MountedSeal(seal, chamber) for chamber in data.sources.chambers)
    fitted, std = fitted_readings(mounted, chambers, readings.at.velocity)
    offsets = offsets_of(readings, fitted)
    measured = readings.at.direction * (readings.force - offsets[readings.source])
    found, used = [], 0
    for level in np.unique(readings.level):
        inside = readings.level == level
        is_used = data.outlier is None or level != data.outlier.level
        if is_used:
            left_out = float(choice.validation.predicted[data.used.level == used].mean())
            used += 1
        else:
            left_out = data.outlier.expected if data.outlier is not None else math.nan
        half = level_friction(readings, inside)
        here = measured[inside].mean() if readings.are_samples else half.friction
        offset = math.nan if readings.are_samples else half.offset
        found.append(
            Level(
                float(readings.seal_pressure[inside].mean()),
                float(np.abs(readings.at.velocity[inside]).mean()),
                float(here),
                float(fitted[inside].mean()),
                float(std[inside].mean()),
                left_out,
                offset,
                int(inside.sum()),
                worth.drift.get(int(level), math.nan),
                is_used,
            )
        )
    return tuple(found)


def fitted_readings(
    mounted: tuple[MountedSeal, ...], chambers: FloatArray, velocity: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Friction and its standard deviation [N] by mounted seals, as the node has them, shape (n,) each.

    Args:
        mounted: The seals of the rig.
        chambers: Pressure of chambers a and b [Pa], shape (n, 2).
        velocity: [m/s] shape (n,); NaN counts as standing still, where no term of the velocity counts.
    """
    found = [
        actuator_friction(mounted, float(a), float(b), float(v))
        for (a, b), v in zip(chambers, np.nan_to_num(velocity), strict=True)
    ]
    friction = np.array([f.coulomb_friction + f.velocity_friction for f in found])
    return friction, np.array([f.coulomb_friction_std for f in found])


# -- in words ---------------------------------------------------------------------------------------------------------


def _warnings(data: Data, choice: Choice, worth: Worth, levels: Sequence[Level]) -> Iterator[str]:
    yield from (_change_in_words(data, change) for change in data.changes if abs(change.ratio - 1.0) > 0.0)
    one_way = [name for name, index in zip(data.used.names, data.used.two_sided, strict=True) if not len(index)]
    if one_way:
        yield (
            f'{", ".join(one_way)}: readings in one direction only, so an offset of the force would be taken for '
            'friction: measure the other direction too'
        )
    if data.outlier is not None:
        yield _outlier_in_words(data, levels)
    yield from _collinear_in_words(data, choice)
    yield from _no_pressure_gain_in_words(choice)
    yield from _parameters_in_words(choice)
    if worth.is_drift:
        yield (
            'every pressure was measured in one run, so how far a new run may be off is not in these data: the drift '
            f'of the runs ({100.0 * worth.run_to_run:.0f} %) stands in for it in the standard deviation; repeat runs, '
            'or give what is known with --run-to-run'
        )
    yield from _drift_in_words(levels)
    floor = worth.repeatability
    error = choice.validation.rms / float(np.abs(choice.validation.predicted).mean())
    if math.isfinite(floor) and error > 2.0 * floor:
        yield (
            f'the law is off by {100.0 * error:.0f} % (RMS) on readings that it has not seen, while readings repeat '
            f'within {100.0 * floor:.0f} %: something that is not in the law moves the friction'
        )
    if worth.stiction is None:
        yield 'nothing started from rest, so breakaway is not identified: let the rod rest 30 s before some strokes'


def _change_in_words(data: Data, change: Change) -> str:
    first = data.sources.files[0].name
    percent = f'{100.0 * (change.ratio - 1.0):+.0f} % (standard error {100.0 * change.standard_error:.0f} %)'
    left = (
        f'the law of {first} leaves an RMS of {change.rms:.3g} N there, fitted there it leaves {change.own_rms:.3g} N'
    )
    if change.is_change:
        return (
            f'the friction has changed: in {change.name} it is {percent} against the law of {first}; {left}; it is '
            'another state of the machine and was not averaged in: identify it for itself'
        )
    return f'{change.name} agrees with {first}: friction {percent}; {left}; both are fitted together'


def _outlier_in_words(data: Data, levels: Sequence[Level]) -> str:
    outlier = data.outlier
    assert outlier is not None  # noqa: S101
    level = next(level for level in levels if not level.is_used)
    others = [abs(other.drift) for other in levels if other.is_used and math.isfinite(other.drift)]
    percent = 100.0 * (outlier.measured / outlier.expected - 1.0)
    words = (
        f'outlier: at {level.pressure / BAR:.3g} bar the friction is {outlier.measured:.3g} N where the law of the '
        f'other pressures expects {outlier.expected:.3g} N ({percent:+.0f} %, {outlier.standard_deviations:.1f} '
        'standard deviations); the law was not fitted to it'
    )
    if math.isfinite(level.drift) and abs(level.drift) > SETTLED and abs(level.drift) > 2.0 * max(others, default=0.0):
        return (
            f'{words}. A reason to look: its friction changed by {100.0 * level.drift:+.0f} % during the run, the '
            f"others' by {100.0 * max(others, default=0.0):.0f} % at most: the seal had not settled (lubricant pushed "
            'out, twist, or extrusion into the gap): look at the ring, and repeat that run until it stays'
        )
    return f'{words}. A reason to look: repeat that run; if it comes out the same, the law changes there: measure more'


def _collinear_in_words(data: Data, choice: Choice) -> Iterator[str]:
    chambers = data.prepared.chamber_pressures
    for pair in collinear_regressors(data.prepared.readings, chambers):
        yield (
            f'{pair.one} and {pair.other} are collinear: they changed together (correlation {pair.correlation:+.2f}), '
            'so what is due to which can hardly be told apart: drive several speeds at each pressure'
        )
    for pair in traded_off(choice.fit):
        yield (
            f'{pair.one} and {pair.other} trade off (correlation {pair.correlation:+.3f}): the friction they make '
            'together is known, neither of them alone is'
        )
    if not choice.fit.condition_number <= ILL_CONDITIONED:
        yield f'the fit is ill-conditioned: condition number {choice.fit.condition_number:.0f} (good below 30)'


def _no_pressure_gain_in_words(choice: Choice) -> Iterator[str]:
    with_it, without = pressure_gain(choice.scores)
    if with_it is not None and without is not None and not is_beaten(without[1].losses, with_it[1].losses):
        yield f'no gain is claimed for pressure: {_gain_figures(with_it, without)}, which is not beyond the noise'


def _gain_figures(with_it: 'Named', without: 'Named') -> str:
    return (
        f'out of sample {with_it[1].rms:.3g} N RMS is left with it ({with_it[0]}) and {without[1].rms:.3g} N without '
        f'({without[0]})'
    )


Named = tuple[str, CrossValidation]


def pressure_gain(scores: Sequence[Score]) -> tuple[Named | None, Named | None]:
    """The best rung with and the best without a pressure-dependent Coulomb friction; None where there is none."""
    found: dict[bool, Named] = {}
    for score in scores:
        if score.validation is not None:
            side = score.rung.depends_on_pressure
            if side not in found or score.validation.losses.mean() < found[side][1].losses.mean():
                found[side] = score.rung.name, score.validation
    return found.get(True), found.get(False)


def _parameters_in_words(choice: Choice) -> Iterator[str]:
    for parameter in choice.rung.parameters:
        value = choice.fit.values[parameter.name]
        span = parameter.upper - parameter.lower
        if parameter.upper < 1e3 and value > parameter.upper - 1e-6 * span:
            yield f'{parameter.name} ends at its bound of {parameter.upper:g}: the law bends to fit what is not in it'
        elif value == 0.0 and parameter.lower == 0.0:
            yield f'{parameter.name} is 0: these data show none'
    for name in choice.rung.fixed:
        yield (
            f'{name} is not fitted but that of an elastic contact, 2/3: '
            f'{PRESSURES_FOR_AN_EXPONENT} pressures at least would tell it'
        )


def _drift_in_words(levels: Sequence[Level]) -> Iterator[str]:
    drifted = [level for level in levels if level.is_used and abs(level.drift) > SETTLED]
    if drifted:
        at = ', '.join(f'{100.0 * level.drift:+.0f} % at {level.pressure / BAR:.3g} bar' for level in drifted)
        yield f'the friction drifted during the runs ({at}): let the seal settle, and drive until it stays'


def _remarks(data: Data, choice: Choice) -> Iterator[str]:
    prepared = data.prepared
    total, used = sum(prepared.total.values()), sum(prepared.used.values())
    if prepared.left_out:
        why = ', '.join(f'{name} {100.0 * count / total:.0f} %' for name, count in prepared.left_out.items())
        yield f'{used} of {total} samples used ({100.0 * used / total:.0f} %); not used: {why}'
    with_it, without = pressure_gain(choice.scores)
    if with_it is not None and without is not None and is_beaten(without[1].losses, with_it[1].losses):
        yield f'pressure pays: {_gain_figures(with_it, without)}'
    if data.ring is None:
        yield 'the geometry of the ring is not known, so the physics-based law was not tried: name a seal with --seal'
    if choice.rung.name != choice.best.rung.name:
        yield f'{choice.rung.name} was asked for; recommended is {choice.best.rung.name}'
    chambers = data.sources.chambers
    mounting = f'seals: [{", ".join(["FILE"] * len(chambers))}], seal_chambers: [{", ".join(chambers)}]'
    yield f'the law is that of one seal of {len(chambers)}; for the node: {mounting}'
    if prepared.breakaway is None and prepared.readings.are_samples:
        yield 'breakaway is not looked for in logs without held pressures'


def in_words(found: Identification) -> str:
    """The result for a person: law, numbers at each pressure, ladder, warnings."""
    choice, worth = found.choice, found.worth
    lines = [f'law: {choice.rung.name} ({choice.rung.words})']
    for parameter in choice.rung.parameters:
        error = worth.standard_errors[parameter.name]
        value = choice.fit.values[parameter.name]
        lines.append(f'  {parameter.name} = {value:.4g} {parameter.unit}, standard error {error:.2g}')
    lines += ['  pressure [bar]  measured [N]  fitted [N]  std [N]']
    for level in found.levels:
        row = (level.pressure / BAR, level.measured, level.fitted, level.std)
        numbers = '  '.join(f'{value:{width}.4g}' for value, width in zip(row, (14, 12, 10, 7), strict=True))
        lines.append(f'  {numbers}{"" if level.is_used else "  outlier, not used"}')
    lines += [f'laws on readings left out (by {found.data.used.left_out_by}):']
    lines += [f'  {line}' for line in _ladder_lines(choice)]
    lines += [f'95 % band: {100.0 * worth.coverage:.0f} % of the readings left out']
    lines += [f'note: {remark}' for remark in found.remarks]
    lines += [f'warning: {warning}' for warning in found.warnings]
    return '\n'.join(lines)


def _ladder_lines(choice: Choice) -> Iterator[str]:
    for score in choice.scores:
        if score.validation is None:
            yield f'{score.rung.name:32} not fitted: {score.why_not}'
        else:
            mark = ' <- recommended' if score is choice.best else ''
            validation = score.validation
            yield f'{score.rung.name:32} {validation.rms:9.4g} N RMS  {100.0 * validation.error:5.1f} %{mark}'
    if choice.reference is not None:
        reference = choice.reference
        yield f'{"mean of the other readings":32} {reference.rms:9.4g} N RMS  {100.0 * reference.error:5.1f} %'


# -- as figures -------------------------------------------------------------------------------------------------------


def as_figures(found: Identification) -> dict[str, Any]:
    """The numbers for JSON."""
    data, choice, worth, levels = found.data, found.choice, found.worth, found.levels
    part = found.document['identification']
    names = ('law', 'parameters', 'standard_errors', 'pressure_Pa', 'measured_N', 'fitted_N', 'cross_validation_error')
    figures = {name: part[name] for name in (*names, 'warnings', 'residual_N', 'is_outlier')}
    return figures | {
        'std_N': [_rounded(level.std) for level in levels],
        'left_out_N': [_rounded(level.left_out) for level in levels],
        'left_out_by': data.used.left_out_by,
        'worst_left_out_error': _rounded(worst_left_out(levels)),
        'cross_validation_rms_N': part['cross_validation_rms_N'],
        'cross_validation_mean_deviation_N': _rounded(choice.validation.mean_deviation),
        'recommended_law': choice.best.rung.name,
        'ladder': [_rung_figures(score, choice) for score in choice.scores],
        'plain_mean_deviation_N': None if choice.reference is None else _rounded(choice.reference.mean_deviation),
        'band_coverage': part['band_coverage'],
        'repeatability': part['repeatability'],
        'relative_std': _rounded(worth.spread.relative),
        'absolute_std_N': _rounded(worth.spread.absolute),
        'condition_number': _rounded_or_none(choice.fit.condition_number),
        'correlation': [[_rounded_or_none(float(x)) for x in row] for row in choice.fit.correlation],
        'offset_N': [_rounded_or_none(level.offset) for level in levels],
        'offset_line': _offset_figures(worth.offset_line),
        'drift': [_rounded_or_none(level.drift) for level in levels],
        'stiction': None if worth.stiction is None else worth.stiction._asdict(),
        'changes': [{**c._asdict(), 'is_change': c.is_change} for c in data.changes],
        'samples_used': data.prepared.used,
        'samples_total': data.prepared.total,
        'samples_left_out': data.prepared.left_out,
        'seal_chambers': list(data.sources.chambers),
        'data': [file._asdict() for file in data.sources.files],
        'remarks': list(found.remarks),
    }


def _offset_figures(line: OffsetLine | None) -> dict[str, float] | None:
    if line is None:
        return None
    return {
        'constant_N': _rounded(line.constant),
        'area_error_m2': _rounded(line.area_error),
        'rms_N': _rounded(line.rms),
    }


def worst_left_out(levels: Sequence[Level]) -> float:
    """Largest relative deviation of a left-out prediction from what was measured, over the levels in use [-]."""
    return max(abs(level.left_out / level.measured - 1.0) for level in levels if level.is_used)


def _rung_figures(score: Score, choice: Choice) -> dict[str, Any]:
    figures: dict[str, Any] = {'law': score.rung.name, 'parameters': len(score.rung.parameters)}
    if score.validation is None or score.fit is None:
        return figures | {'why_not': score.why_not}
    best = min((s.validation for s in choice.scores if s.validation), key=lambda v: float(v.losses.mean()))
    return figures | {
        'values': {key: _rounded(value) for key, value in score.fit.values.items()},
        'rms_N': _rounded(score.validation.rms),
        'mean_deviation_N': _rounded(score.validation.mean_deviation),
        'error': _rounded(score.validation.error),
        'is_beaten': is_beaten(score.validation.losses, best.losses),
        'condition_number': _rounded_or_none(score.fit.condition_number),
    }
